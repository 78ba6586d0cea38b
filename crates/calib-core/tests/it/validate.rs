//! Left-out and held-out predictions.

use crate::common::{Chain, Free, Handles, rng, six_r};
use std::collections::BTreeSet;

use calib_core::{ErrorSummary, Level, MeasurementKind, NoiseKind, Settings, solve};

fn fitted(seed: u64, poses: usize, joint: bool) -> (Chain, Handles) {
    let mut r = rng(seed);
    let free = Free::frames_and_offsets(6);
    let chain = Chain::nominal(six_r())
        .posed(&mut r, poses, 1.4)
        .deviate(&mut r, &free, 0.01, 0.005);
    let mut h = chain.problem(&free, 5e-4);
    if joint {
        let g = h
            .problem
            .noise_group("joints", NoiseKind::Joint, 5e-4, false);
        for j in &h.joints {
            h.problem.joint_noise(*j, g);
        }
    }
    chain.observe(&mut r, &mut h, 5e-4, if joint { 5e-4 } else { 0.0 });
    (chain, h)
}

#[test]
fn left_out_by_the_hat_matrix_equals_refits() {
    for joint in [false, true] {
        let (_, mut h) = fitted(4, 14, joint);
        let whole = solve(&h.problem, &Settings::plain()).unwrap();
        let loo = whole.leave_one_out().unwrap();
        assert_eq!(loo.samples.len(), 14);
        for p in &loo.samples {
            h.problem.held_out = [p.sample].into();
            let refit = solve(&h.problem, &Settings::plain()).unwrap();
            let predicted = refit.held_out().unwrap();
            let (a, b) = (&p.vectors, &predicted.samples[0].vectors);
            for (a, b) in a.iter().zip(b) {
                for (x, y) in a.error.iter().zip(&b.error) {
                    // Second order in the residuals (1 mm on 1 m): 1e-5 m, as measured elsewhere.
                    assert!((x - y).abs() < 1e-5, "sample {}: {x} {y}", p.sample);
                }
            }
            assert!((p.z2 - predicted.samples[0].z2).abs() < 0.05 * p.z2.max(1.0));
            assert!((p.log_density - predicted.samples[0].log_density).abs() < 0.3);
        }
    }
}

#[test]
fn held_out_z_scores_are_standard() {
    let (_, mut h) = fitted(5, 120, true);
    h.problem.held_out = (60..120).collect();
    let s = solve(&h.problem, &Settings::plain()).unwrap();
    let held = s.held_out().unwrap();
    assert_eq!(held.samples.len(), 60);
    let z2: f64 = held.samples.iter().map(|p| p.z2).sum();
    let rows: usize = held.samples.iter().map(|p| p.rows).sum();
    // 720 rows: σ of the ratio 5 %.
    assert!((z2 / rows as f64 - 1.0).abs() < 0.2, "{}", z2 / rows as f64);
    let errors = ErrorSummary::positions(&held.samples);
    assert_eq!(errors.n, 240);
    assert!(errors.mean < errors.rms && errors.rms < errors.p95 && errors.p95 < errors.max);
}

#[test]
fn rows_with_more_noise_than_the_fit_are_standard_at_their_own_level() {
    let mut r = rng(8);
    let free = Free::frames_and_offsets(6);
    let chain = Chain::nominal(six_r())
        .posed(&mut r, 120, 1.4)
        .deviate(&mut r, &free, 0.01, 0.005);
    let (mut means, mut rows) = (chain.problem(&free, 1e-4), chain.problem(&free, 4e-4));
    chain.observe(&mut r, &mut means, 1e-4, 0.0);
    chain.observe(&mut r, &mut rows, 4e-4, 0.0);
    let markers = |h: &Handles| match &h.problem.measurements()[0].kind {
        MeasurementKind::Markers(markers) => markers.observations.clone(),
        _ => panic!("markers"),
    };
    // Means of the first sixty poses, single rows of the others.
    let (fitted, held) = (markers(&means), markers(&rows));
    let seen = fitted.into_iter().filter(|o| o.sample < 60);
    let seen = seen.chain(held.into_iter().filter(|o| o.sample >= 60));
    let seen = seen.collect();
    if let MeasurementKind::Markers(markers) = &mut means.problem.measurements_mut()[0].kind {
        markers.observations = seen;
    }
    means.problem.held_out = (60..120).collect();
    let s = solve(&means.problem, &Settings::plain()).unwrap();
    let ratio = |level: Level<'_>| {
        let held = s.held_out_at(level).unwrap();
        let z2: f64 = held.samples.iter().map(|p| p.z2).sum();
        let rows: usize = held.samples.iter().map(|p| p.rows).sum();
        let (chi2, all) = s.held_out_chi2(&BTreeSet::new(), level).unwrap();
        assert_eq!(all, rows);
        (z2 / rows as f64, chi2 / rows as f64)
    };
    let (of_means, together) = ratio(&|_, _, found| found);
    assert!(of_means > 10.0 && together > 10.0, "{of_means} {together}");
    // 720 rows: σ of the ratio 5 %.
    let (own, together) = ratio(&|_, _, found| found + 15e-8);
    assert!((own - 1.0).abs() < 0.2, "{own}");
    assert!((together - 1.0).abs() < 0.2, "{together}");
}

#[test]
fn a_sample_that_alone_determines_something_is_named() {
    // Joint 6 moves in one sample only: without it, its axis line is unknown.
    let mut r = rng(6);
    let mut free = Free::frames_and_offsets(6);
    free.world = calib_core::Chart::none();
    free.mount = calib_core::Chart::none();
    free.offsets = vec![false; 6];
    free.origins[5] = calib_core::Chart::slide(&crate::common::axis(1.0, 0.0, 0.0));
    let chain = Chain::nominal(six_r()).posed(&mut r, 1, 1.0);
    let mut h = chain.problem(&free, 1e-4);
    // One sample: everything comes from it.
    h.problem
        .parameter_mut(h.problem.find_parameter("j6.origin.x").unwrap())
        .prior_sigma = None;
    chain.observe(&mut r, &mut h, 1e-4, 0.0);
    let s = solve(&h.problem, &Settings::plain()).unwrap();
    // All joints rest in a single sample: nothing can be learned of their origins.
    assert_eq!(s.observability.unmoved.len(), 6);
}

#[test]
fn summaries_of_no_errors_are_zero() {
    assert_eq!(ErrorSummary::of(&[]), ErrorSummary::default());
    let one = ErrorSummary::of(&[2.0]);
    assert_eq!(
        (one.n, one.mean, one.rms, one.p95, one.max),
        (1, 2.0, 2.0, 2.0, 2.0)
    );
}

#[test]
fn left_out_errors_are_as_large_as_expected_and_larger_than_with_all() {
    let (mut squares, mut expected, mut with_all) = (0.0, 0.0, 0.0);
    for seed in 0..30 {
        let (_, h) = fitted(300 + seed, 8, false);
        let whole = solve(&h.problem, &Settings::plain()).unwrap();
        for v in whole
            .leave_one_out()
            .unwrap()
            .samples
            .iter()
            .flat_map(|s| &s.vectors)
        {
            squares += v.position.unwrap().powi(2);
            expected += v.expected.unwrap().powi(2);
            with_all += v.expected_with_all.unwrap().powi(2);
            assert!(v.expected_with_all < v.expected);
        }
    }
    // 30 × 8 poses: ± 5 %.
    assert!(
        (squares / expected - 1.0).abs() < 0.2,
        "{}",
        squares / expected
    );
    assert!(expected / with_all > 1.1, "{}", expected / with_all);
    // What is held out took no part: both are the same.
    let (_, mut h) = fitted(5, 20, true);
    h.problem.held_out = (10..20).collect();
    let whole = solve(&h.problem, &Settings::plain()).unwrap();
    let held = whole.held_out().unwrap();
    let of = held.samples.iter().flat_map(|s| &s.vectors);
    of.for_each(|v| {
        assert!((v.expected.unwrap() / v.expected_with_all.unwrap() - 1.0).abs() < 1e-9)
    });
}
