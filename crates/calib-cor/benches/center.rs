//! Time of each center estimator at n = 36, 1 000 and 100 000 samples, one thread.

use calib_cor::{Input, InputKind, Options, Pose, estimators, fit};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::hint::black_box;

struct Data {
    markers: Vec<Vec<Option<Point3<f64>>>>,
    poses: Vec<Option<Pose>>,
    second: Vec<Option<Pose>>,
}

fn data(n: usize) -> Data {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut normal = |sigma: f64| {
        Vector3::from_fn(|_, _| sigma * Distribution::<f64>::sample(&StandardNormal, &mut rng))
    };
    let center = Vector3::new(1.2, -0.8, 0.9);
    let layout = [
        Vector3::new(0.1, 0.02, 0.0),
        Vector3::new(0.0, 0.12, 0.03),
        Vector3::new(-0.04, 0.0, 0.09),
    ];
    let mut out = Data {
        markers: vec![Vec::new(); 3],
        poses: Vec::new(),
        second: Vec::new(),
    };
    for _ in 0..n {
        let r = UnitQuaternion::from_scaled_axis(normal(0.6));
        for (track, b) in out.markers.iter_mut().zip(&layout) {
            track.push(Some(Point3::from(center + r * b + normal(1e-3))));
        }
        let measured = r * UnitQuaternion::from_scaled_axis(normal(5e-3));
        out.poses.push(Some(Pose {
            rotation: measured.to_rotation_matrix().into_inner(),
            translation: center - r * layout[1] + normal(1e-3),
        }));
        let s = UnitQuaternion::from_scaled_axis(normal(0.3));
        out.second.push(Some(Pose {
            rotation: s.to_rotation_matrix().into_inner(),
            translation: center - s * layout[2] + normal(1e-3),
        }));
    }
    out
}

fn centers(c: &mut Criterion) {
    for n in [36, 1_000, 100_000] {
        let data = data(n);
        let mut group = c.benchmark_group(format!("center/{n}"));
        group.throughput(Throughput::Elements(n as u64));
        group.sample_size(10);
        for info in estimators() {
            // A bundle over 100 000 frames is a batch job, not a benchmark.
            if n > 10_000 && matches!(info.id, "ball_bundle" | "sfa") {
                continue;
            }
            let input = match info.input {
                InputKind::Points => Input::Points(&data.markers[..1]),
                InputKind::Markers => Input::Markers(&data.markers),
                InputKind::TwoBodies => Input::TwoBodies {
                    parent: &data.poses,
                    child: &data.second,
                },
                _ => Input::Poses(&data.poses),
            };
            group.bench_function(BenchmarkId::from_parameter(info.id), |b| {
                b.iter(|| fit(info.id, black_box(&input), &Options::default()));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, centers);
criterion_main!(benches);
