//! Baselines, default priors, poses at samples, residual tables.

use crate::common::{Chain, Free, rng, six_r};
use calib_core::{Baseline, ClosureStatistics, Configuration, ErrorSummary, Settings, solve};
use nalgebra::Point3;

fn rig() -> (Chain, crate::common::Handles) {
    let mut r = rng(1);
    let mut free = Free::everything(6);
    free.prior = None;
    let chain = Chain::nominal(six_r())
        .posed(&mut r, 50, 1.3)
        .deviate(&mut r, &free, 0.01, 0.005);
    let mut h = chain.problem(&free, 2e-4);
    chain.observe(&mut r, &mut h, 2e-4, 0.0);
    h.problem.held_out = (30..50).collect();
    h.problem.set_default_priors();
    (chain, h)
}

#[test]
fn calibration_beats_registration_beats_nominal() {
    let (_, h) = rig();
    let error = |p: &calib_core::Problem| {
        let s = solve(p, &Settings::plain()).unwrap();
        assert!(s.status.is_converged());
        ErrorSummary::positions(&s.held_out().unwrap().samples).rms
    };
    let nominal = error(&h.problem.baseline(Baseline::Nominal));
    let registered = error(&h.problem.baseline(Baseline::RegistrationOnly));
    let calibrated = error(&h.problem);
    assert!(calibrated < 0.05 * registered, "{calibrated} {registered}");
    assert!(registered < 0.7 * nominal, "{registered} {nominal}");
}

#[test]
fn default_priors_leave_frames_to_the_data_and_keep_what_was_set() {
    let (_, mut h) = rig();
    let prior = |h: &crate::common::Handles, name: &str| {
        let p = h.problem.find_parameter(name).unwrap();
        h.problem.parameters()[p.index()].prior_sigma
    };
    assert_eq!(prior(&h, "tracker_from_base.x"), None);
    assert_eq!(prior(&h, "body_mount.rx"), None);
    assert_eq!(prior(&h, "j3.origin.z"), Some(0.01));
    assert_eq!(prior(&h, "j3.origin.rz"), Some(1f64.to_radians()));
    assert_eq!(prior(&h, "j3.offset"), Some(1f64.to_radians()));
    let p = h.problem.find_parameter("j3.offset").unwrap();
    h.problem.parameter_mut(p).prior_sigma = Some(0.5);
    h.problem.set_default_priors();
    assert_eq!(prior(&h, "j3.offset"), Some(0.5));
}

#[test]
fn poses_at_samples_equal_poses_at_their_configuration() {
    let (chain, h) = rig();
    let s = solve(&h.problem, &Settings::plain()).unwrap();
    for sample in [0, 7, 49] {
        let mut at = Configuration::zero();
        for (j, q) in h.joints.iter().zip(&chain.q[sample]) {
            at = at.with(*j, *q);
        }
        let a = s.relative_pose(h.tracker, h.body, &at).unwrap().pose;
        let b = s.pose_at_sample(h.tracker, h.body, sample).unwrap();
        let c = ClosureStatistics::of(&[(a, b)]);
        assert!(c.translation.max < 1e-12 && c.rotation.max < 1e-7);
        // And backwards through the graph.
        let back = s.pose_at_sample(h.body, h.tracker, sample).unwrap();
        assert!(((back * b).translation.vector).norm() < 1e-12);
    }
    assert!(s.pose_at_sample(h.tracker, h.body, 50).is_err());
}

#[test]
fn the_residual_table_lists_everything() {
    let (_, h) = rig();
    let s = solve(&h.problem, &Settings::plain()).unwrap();
    let table = s.residuals().unwrap();
    assert_eq!(table.len(), 200);
    let fitted: f64 = table
        .iter()
        .filter(|(sample, _)| *sample < 30)
        .map(|(_, v)| v.z * v.z)
        .sum();
    assert!((fitted - s.chi2).abs() < 1e-6 * s.chi2);
}

#[test]
fn weak_directions_are_priced_at_the_tool() {
    // Hardly any motion: many directions are weak, and the prior keeps the tool within centimeters.
    let mut r = rng(3);
    let mut free = Free::everything(6);
    free.prior = Some((0.02, 0.01));
    let chain = Chain::nominal(six_r()).posed(&mut r, 10, 0.15);
    let mut h = chain.problem(&free, 1e-3);
    chain.observe(&mut r, &mut h, 1e-3, 0.0);
    let s = solve(&h.problem, &Settings::plain()).unwrap();
    assert!(!s.weak().is_empty());
    let mut at = Configuration::zero();
    for j in &h.joints {
        at = at.with(*j, 1.2);
    }
    let price = s
        .weak_at_point(h.tracker, h.body, &Point3::origin(), &at)
        .unwrap();
    assert_eq!(price.len(), s.weak().len());
    let total = s
        .predict_point(h.tracker, h.body, &Point3::origin(), &at)
        .unwrap()
        .covariance
        .unwrap()
        .trace()
        .sqrt();
    assert!(price.iter().all(|p| p.is_finite() && *p <= 3.0 * total));
    assert!(price.iter().any(|p| *p > 1e-4));
    for w in &s.weak() {
        assert!(w.sigma_ratio.unwrap() > 1.0);
    }
}
