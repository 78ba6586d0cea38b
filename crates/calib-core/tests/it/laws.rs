//! What must hold for any chain: order, placement and repetition change nothing that they should not.

use crate::common::{Chain, Free, Handles, jitter, rng, six_r};
use calib_core::{Configuration, MeasurementKind, Problem, Settings, Solution, measurement, solve};
use nalgebra::{Isometry3, Point3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 12,
        rng_seed: RngSeed::Fixed(20_260_101),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn rig(seed: u64, poses: usize) -> (Chain, Handles) {
    let mut r = rng(seed);
    let free = Free::frames_and_offsets(6);
    let chain = Chain::nominal(six_r())
        .posed(&mut r, poses, 1.4)
        .deviate(&mut r, &free, 0.02, 0.01);
    let mut h = chain.problem(&free, 1e-3);
    h.problem.group_mut(h.markers).estimate = true;
    chain.observe(&mut r, &mut h, 1e-3, 0.0);
    (chain, h)
}

fn tool(s: &Solution, h: &Handles) -> Point3<f64> {
    let mut at = Configuration::zero();
    for (i, j) in h.joints.iter().enumerate() {
        at = at.with(*j, 0.2 * i as f64 - 0.4);
    }
    s.predict_point(h.tracker, h.body, &Point3::new(0.0, 0.0, 0.1), &at)
        .unwrap()
        .position
}

fn fit(p: &Problem) -> Solution {
    let s = solve(p, &Settings::default()).unwrap();
    assert!(s.status.is_converged());
    s
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn the_order_of_observations_does_not_matter(seed in 0u64..1000) {
        let (_, mut h) = rig(seed, 20);
        let before = fit(&h.problem);
        for measurement in h.problem.measurements_mut() {
            if let MeasurementKind::Markers(measurement::Markers { observations, .. }) = &mut measurement.kind {
                observations.reverse();
            }
        }
        let after = fit(&h.problem);
        prop_assert!((tool(&before, &h) - tool(&after, &h)).norm() < 1e-9);
        prop_assert!((before.chi2 - after.chi2).abs() < 1e-6 * before.chi2);
        prop_assert!((before.noise[0].sigma / after.noise[0].sigma - 1.0).abs() < 1e-6);
    }

    #[test]
    fn moving_the_tracker_moves_the_predictions_with_it(seed in 0u64..1000) {
        let (_, mut h) = rig(seed, 20);
        let before = fit(&h.problem);
        let new_from_old: Isometry3<f64> = jitter(&mut rng(seed + 1), 0.3, 0.5);
        for measurement in h.problem.measurements_mut() {
            if let MeasurementKind::Markers(measurement::Markers { observations, .. }) = &mut measurement.kind {
                for o in observations {
                    o.position = new_from_old * o.position;
                }
            }
        }
        let after = fit(&h.problem);
        prop_assert!((new_from_old * tool(&before, &h) - tool(&after, &h)).norm() < 1e-8);
        prop_assert!((before.chi2 - after.chi2).abs() < 1e-6 * before.chi2);
        for (a, b) in before.parameters.iter().zip(&after.parameters) {
            if a.joint.is_some() {
                prop_assert!((a.value - b.value).abs() < 1e-8, "{}", a.name);
                prop_assert!((a.sigma.unwrap() / b.sigma.unwrap() - 1.0).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn calibrating_a_calibrated_robot_proposes_no_edit(seed in 0u64..1000) {
        let (chain, h) = rig(seed, 20);
        let first = fit(&h.problem);
        // The solution becomes the nominal robot, seen without noise.
        let mut again = Chain::nominal(six_r());
        again.q.clone_from(&chain.q);
        again.world = first.model.edge_pose(h.world, &first.values).unwrap();
        again.mount = first.model.edge_pose(h.mount, &first.values).unwrap();
        (again.true_world, again.true_mount) = (again.world, again.mount);
        let mut h2 = again.problem(&Free::frames_and_offsets(6), 1e-3);
        again.observe(&mut rng(0), &mut h2, 0.0, 0.0);
        let second = fit(&h2.problem);
        for p in &second.parameters {
            prop_assert!((p.value - p.nominal).abs() < 1e-9, "{} {}", p.name, p.value);
        }
    }

    #[test]
    fn the_same_input_gives_the_same_bits(seed in 0u64..1000) {
        let (_, h) = rig(seed, 15);
        let (a, b) = (fit(&h.problem), fit(&h.problem));
        prop_assert_eq!(a.values, b.values);
        prop_assert_eq!(a.information.covariance, b.information.covariance);
        prop_assert_eq!(a.observability, b.observability);
    }
}

#[test]
fn errors_fall_like_one_over_root_n() {
    let rms = |poses: usize| {
        let n = 30;
        let sum: f64 = (0..n)
            .map(|seed| {
                let (chain, h) = rig(seed, poses);
                let s = fit(&h.problem);
                let q: Vec<f64> = (0..6).map(|i| 0.2 * f64::from(i) - 0.4).collect();
                let truth = chain.tracker_from_body(&q, &[]) * Point3::new(0.0, 0.0, 0.1);
                (tool(&s, &h) - truth).norm_squared()
            })
            .sum();
        (sum / n as f64).sqrt()
    };
    let ratio = rms(16) / rms(144);
    // Nine times the poses: a third of the error, within the scatter of 30 draws.
    assert!((2.2..4.2).contains(&ratio), "{ratio}");
}
