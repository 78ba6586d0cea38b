//! The closed hand–eye problem and the frame graph state the same thing: two routes to the same transforms.

use calib_core::{Chart, NoiseKind, PoseNoise, PoseObservation, Problem, Settings, solve};
use calib_handeye::{HandEyeWeights, solve_ax_zb};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

fn normal3(rng: &mut impl Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(rng))
}

/// A displacement with rotation σ (rad) and translation σ (m) per component.
fn jitter(rng: &mut impl Rng, rotation: f64, translation: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(normal3(rng) * translation),
        UnitQuaternion::from_scaled_axis(normal3(rng) * rotation),
    )
}

struct Case {
    a: Vec<Isometry3<f64>>,
    b: Vec<Isometry3<f64>>,
}

fn random_pose(r: &mut impl Rng, angle: f64) -> Isometry3<f64> {
    let axis = normal3(r).normalize();
    Isometry3::from_parts(
        Translation3::from(normal3(r) * 0.5),
        UnitQuaternion::from_scaled_axis(axis * r.random_range(0.0..angle)),
    )
}

fn case(seed: u64, n: usize, rotation: f64, translation: f64) -> Case {
    let mut r = rng(seed);
    let (x, z) = (random_pose(&mut r, 3.1), random_pose(&mut r, 3.1));
    let a: Vec<_> = (0..n).map(|_| random_pose(&mut r, 1.5)).collect();
    let b = a
        .iter()
        .map(|a| z.inverse() * a * x * jitter(&mut r, rotation, translation))
        .collect();
    Case { a, b }
}

fn distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    (
        (a.translation.vector - b.translation.vector).norm(),
        a.rotation.angle_to(&b.rotation),
    )
}

#[test]
fn the_frame_graph_states_the_same_problem() {
    // tracker –Z– base –A(measured)– flange –X– body, one pose measurement: same transforms as the closed problem.
    let c = case(21, 20, 1e-3, 1e-3);
    let s = solve_ax_zb(&c.a, &c.b, HandEyeWeights::default()).unwrap();
    let mut p = Problem::new(c.a.len());
    let [tracker, base, flange, body] = ["tracker", "base", "flange", "body"].map(|n| p.frame(n));
    let z = p.unknown("base_from_tracker", base, tracker, s.z, Chart::full());
    p.measured(
        "robot",
        base,
        flange,
        c.a.iter().map(|a| Some(*a)).collect(),
        None,
    );
    let x = p.unknown("flange_from_body", flange, body, s.x, Chart::full());
    let o = p.noise_group("orientation", NoiseKind::Orientation, 1e-3, false);
    let t = p.noise_group("position", NoiseKind::Position, 1e-3, false);
    let seen =
        c.b.iter()
            .enumerate()
            .map(|(sample, b)| PoseObservation {
                sample,
                pose: *b,
                inverse: false,
            })
            .collect();
    p.poses(
        "body",
        tracker,
        body,
        PoseNoise::Split {
            orientation: o,
            position: t,
        },
        seen,
    );
    let fit = solve(&p, &Settings::plain()).unwrap();
    assert!(fit.status.is_converged());
    for (edge, found) in [(x, s.x), (z, s.z)] {
        let (t, r) = distance(&fit.model.edge_pose(edge, &fit.values).unwrap(), &found);
        // Both are least squares of the same errors, seen in two frames: second order apart.
        assert!(t < 1e-5 && r < 1e-5, "{t} {r}");
    }
}
