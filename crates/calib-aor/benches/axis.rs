//! Time of each axis estimator at n = 36, 1 000 and 100 000 samples, between two bodies too, and of the frames on grids
//! of 36 and 1 000, one thread.

use calib_aor::{
    Center, FrameSample, Input, InputKind, Options, Pose, estimators, fit,
    frame_ml::{self, Residuals},
    frame_planes,
};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Isometry3, Matrix3, Point3, Unit, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::hint::black_box;

fn axes(c: &mut Criterion) {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut normal = |sigma: f64| {
        Vector3::from_fn(|_, _| sigma * Distribution::<f64>::sample(&StandardNormal, &mut rng))
    };
    let point = Vector3::new(1.2, -0.8, 0.9);
    let axis = Unit::new_normalize(Vector3::new(-0.18, -0.83, 0.53));
    for n in [36, 1_000, 100_000] {
        let mut markers = vec![Vec::new(); 3];
        let (mut poses, mut parents) = (Vec::new(), Vec::new());
        for k in 0..n {
            let turn = UnitQuaternion::from_axis_angle(&axis, 2.0 * f64::from(k) / f64::from(n));
            for (p, track) in markers.iter_mut().enumerate() {
                let b = Vector3::new(0.1, 0.02 * p as f64, 0.05 - 0.04 * p as f64);
                track.push(Some(Point3::from(point + turn * b + normal(1e-3))));
            }
            let measured = turn * UnitQuaternion::from_scaled_axis(normal(5e-3));
            poses.push(Some(Pose {
                rotation: measured.to_rotation_matrix().into_inner(),
                translation: point + turn * Vector3::new(0.1, 0.0, 0.05) + normal(1e-3),
            }));
        }
        // The parent stands still and is measured with the same noise.
        for _ in 0..n {
            let turn = UnitQuaternion::from_scaled_axis(normal(5e-3));
            parents.push(Some(Pose {
                rotation: turn.to_rotation_matrix().into_inner(),
                translation: normal(1e-3),
            }));
        }
        let mut group = c.benchmark_group(format!("axis/{n}"));
        group.throughput(Throughput::Elements(n as u64));
        group.sample_size(10);
        for info in estimators() {
            // All pairs of 100 000 samples, and simplex walks over them, are no benchmark.
            if n > 10_000 && matches!(info.id, "halvorsen_line" | "planar_radial") {
                continue;
            }
            let input = match info.input {
                InputKind::Points => Input::Points(&markers[..1]),
                InputKind::Markers => Input::Markers(&markers),
                _ => Input::Poses(&poses),
            };
            group.bench_function(BenchmarkId::from_parameter(info.id), |b| {
                b.iter(|| fit(info.id, black_box(&input), &Options::default()));
            });
            if info.input == InputKind::OneOrTwoBodies {
                let input = Input::TwoBodies {
                    parent: &parents,
                    child: &poses,
                };
                let name = format!("{}, two bodies", info.id);
                group.bench_function(BenchmarkId::from_parameter(name), |b| {
                    b.iter(|| fit(info.id, black_box(&input), &Options::default()));
                });
            }
        }
        group.finish();
    }

    let joint = Isometry3::new(point, Vector3::new(0.4, -0.7, 1.1));
    let body = Isometry3::new(Vector3::new(0.0, -0.1, 0.0), Vector3::new(-0.9, 0.3, 0.5));
    let options = Options::default();
    let center = Center::Given {
        point: point.into(),
        covariance: Matrix3::identity() * 1e-8,
    };
    for (proximal, distal) in [(6, 6), (40, 25)] {
        let mut samples = Vec::new();
        for i in 0..proximal {
            for j in 0..distal {
                let p = 3.0 * f64::from(i) / f64::from(proximal - 1) - 0.8;
                let d = 2.0 * f64::from(j) / f64::from(distal - 1) - 0.8;
                let truth = joint * options.axes.turned(p, d) * body.inverse();
                let measured = truth.rotation * UnitQuaternion::from_scaled_axis(normal(5e-3));
                samples.push(FrameSample {
                    world_from_body: Some(Pose {
                        rotation: measured.to_rotation_matrix().into_inner(),
                        translation: truth.translation.vector + normal(1e-3),
                    }),
                    proximal: p,
                    distal: d,
                    weight: 1.0,
                });
            }
        }
        let mut group = c.benchmark_group(format!("frame/{}", samples.len()));
        group.throughput(Throughput::Elements(samples.len() as u64));
        group.sample_size(10);
        group.bench_function("algorithm1", |b| {
            b.iter(|| frame_planes::algorithm1(black_box(&samples), center, &options));
        });
        group.bench_function("frame_ml", |b| {
            b.iter(|| frame_ml::fit(black_box(&samples), Residuals::Poses, &options));
        });
        group.finish();
    }
}

criterion_group!(benches, axes);
criterion_main!(benches);
