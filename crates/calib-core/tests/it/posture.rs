//! What postures would tell before they are recorded: against the information of a fit of the same postures.

use crate::common::*;
use calib_core::{Configuration, Model, NoiseKind, Settings, Target, solve};
use nalgebra::DMatrix;

#[test]
fn the_rows_of_all_samples_and_the_priors_are_the_information_of_the_fit() {
    for joint_noise in [false, true] {
        let mut r = rng(5);
        let chain = Chain::nominal(six_r()).posed(&mut r, 12, 1.2);
        let free = Free::everything(6);
        let mut h = chain.problem(&free, 2e-4);
        if joint_noise {
            let group = h
                .problem
                .noise_group("joint", NoiseKind::Joint, 1e-4, false);
            for joint in h.joints.clone() {
                h.problem.joint_noise(joint, group);
            }
        }
        chain.observe(&mut r, &mut h, 2e-4, 0.0);
        let s = solve(&h.problem, &Settings::plain()).expect("solved");
        let variances: Vec<f64> = s.noise.iter().map(|n| n.sigma * n.sigma).collect();
        let rows = s.model.whitened_rows(&s.values, &variances, 0..12);
        let rows = rows.expect("positive definite");
        // S⁻¹ (Σ YᵀY + Λ) C = S⁻¹ restricted to what is determined: all of it, with these priors and known markers.
        let n = s.model.free();
        let mut information = DMatrix::zeros(n, n);
        for y in &rows {
            information += y.transpose() * y;
        }
        for (c, p) in s.model.free_parameters().iter().enumerate() {
            let sigma = s.model.problem().parameters()[*p].prior_sigma;
            information[(c, c)] += sigma.map_or(0.0, |sigma| sigma.powi(-2));
        }
        let scale = &s.information.scale;
        let product = DMatrix::from_fn(n, n, |i, j| {
            let row = information.row(i);
            (row * s.information.covariance.column(j))[(0, 0)] * scale[i] / scale[j]
        });
        let worst = (product - DMatrix::identity(n, n)).amax();
        assert!(worst < 1e-5, "{worst}");
    }
}

#[test]
fn places_and_their_derivatives_are_those_of_predictions_of_a_fit() {
    let mut r = rng(6);
    let chain = Chain::nominal(six_r()).posed(&mut r, 12, 1.2);
    let mut free = Free::everything(6);
    free.points = true;
    let mut h = chain.problem(&free, 2e-4);
    chain.observe(&mut r, &mut h, 2e-4, 0.0);
    let s = solve(&h.problem, &Settings::plain()).expect("solved");
    for target in [Target::Frame(h.body), Target::Point(h.points[2])] {
        let seen = s.model.linear_points(&s.values, (h.tracker, target), 0..12);
        for (point, q) in seen.expect("a path").iter().zip(&chain.q) {
            let joints = h.joints.iter().zip(q);
            let at = joints.fold(Configuration::zero(), |at, (joint, q)| at.with(*joint, *q));
            let other = s.linear_point(h.tracker, target, &at).expect("a path");
            assert!((point.position - other.position).norm() < 1e-12);
            assert!((&point.jacobian - &other.jacobian).amax() < 1e-12);
        }
    }
}

#[test]
fn measured_values_do_not_change_what_markers_would_tell() {
    let mut r = rng(7);
    let chain = Chain::nominal(six_r()).posed(&mut r, 4, 1.2);
    let rows = |noise: f64| {
        let mut h = chain.problem(&Free::everything(6), 2e-4);
        chain.observe(&mut rng(8), &mut h, noise, 0.0);
        let model = Model::new(&h.problem).expect("a problem");
        model.whitened_rows(&model.start(), &[4e-8], 0..4)
    };
    assert_eq!(rows(0.0).expect("rows"), rows(0.05).expect("rows"));
}
