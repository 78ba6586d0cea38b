//! Motions that all held-out samples share.

use crate::common::{Chain, Free, Handles, rng, six_r};
use std::collections::BTreeSet;

use calib_core::{
    Displaced, HeldOutMotions, MeasurementKind, NoiseKind, Settings, Solution, solve,
};
use nalgebra::{Isometry3, Vector3};

/// A robot of six joints with scattering readings, half of whose poses are held out; everything that they show was moved by `by` in the
/// tracker's axes, m.
fn fitted(seed: u64, by: Vector3<f64>) -> (Handles, Solution) {
    let mut r = rng(seed);
    let free = Free::frames_and_offsets(6);
    let chain = Chain::nominal(six_r())
        .posed(&mut r, 60, 1.4)
        .deviate(&mut r, &free, 0.01, 0.005);
    let mut h = chain.problem(&free, 5e-4);
    let g = h
        .problem
        .noise_group("joints", NoiseKind::Joint, 5e-4, false);
    for joint in &h.joints {
        h.problem.joint_noise(*joint, g);
    }
    chain.observe(&mut r, &mut h, 5e-4, 5e-4);
    if let MeasurementKind::Markers(markers) = &mut h.problem.measurements_mut()[0].kind {
        let late = markers.observations.iter_mut().filter(|o| o.sample >= 30);
        late.for_each(|o| o.position += by);
    }
    h.problem.held_out = (30..60).collect();
    let solution = solve(&h.problem, &Settings::plain()).expect("a solution");
    (h, solution)
}

/// The tracker and every zero, in this order.
fn asked(h: &Handles, solution: &Solution) -> HeldOutMotions {
    let tracker = Displaced::Seen(std::iter::once(h.body).collect());
    let zeros = h.joints.iter().map(|joint| Displaced::Zero(*joint));
    let displaced: Vec<Displaced> = std::iter::once(tracker).chain(zeros).collect();
    let place = |_: usize, _: usize| Isometry3::identity();
    let found = |_, _, found: f64| found;
    let motions = solution.held_out_motions(&BTreeSet::new(), &found, &displaced, &place);
    motions.expect("held-out samples")
}

#[test]
fn a_motion_is_found_to_its_uncertainty() {
    let by = Vector3::new(4e-4, -3e-4, 5e-4);
    for seed in 0..5 {
        let (h, solution) = fitted(seed, by);
        let found = asked(&h, &solution);
        assert_eq!((found.samples, found.rows), (30, 360));
        let all = solution.held_out_chi2(&BTreeSet::new(), &|_, _, found| found);
        let (chi2, rows) = all.expect("held-out samples");
        assert!((found.chi2 - chi2).abs() < 1e-9 * chi2 && rows == found.rows);
        let tracker = found.motions[0].as_ref().expect("a motion");
        assert!((tracker.unknowns - 6.0).abs() < 0.01);
        let truth = [0.0, 0.0, 0.0, by.x, by.y, by.z];
        for (k, truth) in truth.into_iter().enumerate() {
            let off = tracker.motion[k] - truth;
            let sigma = tracker.covariance[(k, k)].sqrt();
            assert!(off.abs() < 4.0 * sigma, "{seed} {k}: {off} of {sigma}");
        }
        let zeros = found.motions[1..].iter().flatten();
        let best = zeros.map(|zero| zero.explains).fold(0.0, f64::max);
        assert!(tracker.explains > 30.0 + best, "{seed}: {tracker:?} {best}");
    }
}

/// Where nothing moved, what a motion explains is χ² of its unknowns.
#[test]
fn where_nothing_moved_little_is_explained() {
    let (mut of_tracker, mut of_zeros, mut zeros) = (0.0, 0.0, 0.0);
    const SESSIONS: u64 = 40;
    for seed in 100..100 + SESSIONS {
        let (h, solution) = fitted(seed, Vector3::zeros());
        let found = asked(&h, &solution);
        let explains: Vec<f64> = found.motions.iter().flatten().map(|m| m.explains).collect();
        of_tracker += explains[0] / SESSIONS as f64;
        of_zeros += explains[1..].iter().sum::<f64>();
        zeros += (explains.len() - 1) as f64;
    }
    // σ of the means: √(12/40) = 0.55, and at most √(2/40) = 0.22 as the zeros of one session are correlated.
    assert!((of_tracker - 6.0).abs() < 2.2, "{of_tracker}");
    assert!((of_zeros / zeros - 1.0).abs() < 0.9, "{}", of_zeros / zeros);
}
