//! A stated covariance must never be too small: the squared error over it, for every estimator of a center, also where it is biased.

use crate::common::{Noise, grid};
use calib_cor::{Input, InputKind, Options, Pose, estimators, fit};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;

const CENTER: Vector3<f64> = Vector3::new(0.3, -0.2, 0.9);

struct Cell {
    name: &'static str,
    turns: Vec<UnitQuaternion<f64>>,
    radius: f64,
    sigma_t: f64,
    sigma_r: f64,
}

fn cells() -> Vec<Cell> {
    let mut out = Vec::new();
    for (name, z, x) in [
        ("hand", [-45.0, 135.0], [-45.0, 80.0]),
        ("60°", [-30.0, 30.0], [-30.0, 30.0]),
        ("20°", [-10.0, 10.0], [-10.0, 10.0]),
    ] {
        for n in [4, 7] {
            for (radius, sigma_t, degrees) in [
                (0.1, 1e-4, 0.05),
                (0.1, 1e-3, 0.5),
                (0.25, 1e-3, 1.0),
                (0.25, 1e-3, 5.0),
                (0.1, 5e-3, 2.0),
            ] {
                out.push(Cell {
                    name,
                    turns: grid(z, n, x, n),
                    radius,
                    sigma_t,
                    sigma_r: f64::to_radians(degrees),
                });
            }
        }
    }
    out
}

/// Mean of eᵀC⁻¹e/3 over the answers that are not called weak, and their number.
fn ratio(cell: &Cell, id: &str, kind: InputKind, trials: u64) -> (f64, u64) {
    let layout = [
        Vector3::new(1.0, 0.2, 0.0),
        Vector3::new(0.8, -0.3, 0.5),
        Vector3::new(0.9, 0.1, -0.4),
    ];
    let arm = Vector3::new(-0.8, 0.5, -0.3).normalize() * cell.radius;
    let place = Vector3::new(-0.05, 0.03, 0.08);
    let (mut sum, mut answered) = (0.0, 0);
    for seed in 0..trials {
        let mut noise = Noise::new(seed);
        let mut markers = vec![Vec::new(); layout.len()];
        let (mut poses, mut second) = (Vec::new(), Vec::new());
        for turn in &cell.turns {
            for (track, b) in markers.iter_mut().zip(&layout) {
                let x = CENTER + turn * b.normalize() * cell.radius + noise.vector(cell.sigma_t);
                track.push(Some(Point3::from(x)));
            }
            let mut pose = |turn: UnitQuaternion<f64>, point: &Vector3<f64>| {
                let seen = turn * UnitQuaternion::from_scaled_axis(noise.vector(cell.sigma_r));
                Some(Pose {
                    rotation: seen.to_rotation_matrix().into_inner(),
                    translation: CENTER - turn * point + noise.vector(cell.sigma_t),
                })
            };
            poses.push(pose(*turn, &arm));
            second.push(pose(
                UnitQuaternion::from_scaled_axis(turn.scaled_axis().yzx() * 0.4),
                &place,
            ));
        }
        let (input, truth) = match kind {
            InputKind::Poses => (Input::Poses(&poses), CENTER),
            InputKind::TwoBodies => (
                Input::TwoBodies {
                    parent: &poses,
                    child: &second,
                },
                place,
            ),
            _ => (Input::Markers(&markers), CENTER),
        };
        let outcome = fit(id, &input, &Options::default()).expect(id);
        let Some(estimate) = outcome.estimate().filter(|_| outcome.is_observable()) else {
            continue;
        };
        answered += 1;
        let e = estimate.center.coords - truth;
        let inverse = estimate.covariance.try_inverse().expect("definite");
        sum += e.dot(&(inverse * e)) / 3.0;
    }
    (sum / answered.max(1) as f64, answered)
}

#[test]
fn covariances_are_not_too_small() {
    if !skipped_tests::thorough() {
        return;
    }
    const TRIALS: u64 = 100;
    /// Of fewer answers those that look best have been picked by the tests of observability.
    const ENOUGH: u64 = 50;
    /// 1 and five Monte-Carlo errors of 100 trials; estimated noise adds to few degrees of freedom.
    const LIMIT: f64 = 1.45;
    let judged: usize = cells()
        .par_iter()
        .map(|cell| {
            let name = format!(
                "{}, n {}, r {} mm, {} mm, {:.2}°",
                cell.name,
                cell.turns.len(),
                cell.radius * 1e3,
                cell.sigma_t * 1e3,
                cell.sigma_r.to_degrees()
            );
            let mut judged = 0;
            for info in estimators() {
                // COBYLA finds what SFE finds; the robust ones are judged with outliers.
                if matches!(info.id, "sfa" | "robust" | "consensus") {
                    continue;
                }
                let (ratio, answered) = ratio(cell, info.id, info.input, TRIALS);
                if answered >= ENOUGH {
                    judged += 1;
                    assert!(
                        ratio < LIMIT,
                        "{name}: the mean squared error of `{}` is {ratio:.2} times what its covariance says, at most {LIMIT}",
                        info.id
                    );
                }
            }
            judged
        })
        .sum();
    assert!(judged > 300, "{judged} cells");
}
