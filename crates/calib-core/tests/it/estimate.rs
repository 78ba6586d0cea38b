//! Simulated truth: what the solver finds, and how sure it says it is.

use crate::common::{Chain, Free, rng, six_r};
use calib_core::{Configuration, Settings, solve};
use nalgebra::Vector3;

#[test]
fn exact_data_give_the_truth_back() {
    let mut r = rng(1);
    let free = Free::frames_and_offsets(6);
    let chain = Chain::nominal(six_r())
        .posed(&mut r, 20, 1.5)
        .deviate(&mut r, &free, 0.05, 0.02);
    let mut h = chain.problem(&free, 1e-4);
    chain.observe(&mut r, &mut h, 0.0, 0.0);
    let solution = solve(&h.problem, &Settings::default()).unwrap();
    assert!(solution.status.is_converged(), "{:?}", solution.status);
    let q = [0.3, -0.2, 0.8, 0.1, -1.0, 0.4];
    let mut at = Configuration::zero();
    for (j, q) in h.joints.iter().zip(q) {
        at = at.with(*j, q);
    }
    let found = solution.relative_pose(h.tracker, h.body, &at).unwrap();
    let truth = chain.tracker_from_body(&q, &[]);
    assert!((found.pose.translation.vector - truth.translation.vector).norm() < 1e-9);
    assert!(found.pose.rotation.angle_to(&truth.rotation) < 1e-8);
    assert!(found.estimable);
    for (i, j) in h.joints.iter().enumerate() {
        if free.offsets[i] {
            let name = format!("{}.offset", h.problem.edge_name(*j));
            let p = solution.parameters.iter().find(|p| p.name == name).unwrap();
            assert!((p.value - chain.true_offsets[i]).abs() < 1e-8, "{name}");
        }
    }
}

#[test]
fn the_prior_makes_an_overparametrised_chain_solvable_and_says_so() {
    let mut r = rng(2);
    let free = Free::everything(6);
    let chain = Chain::nominal(six_r())
        .posed(&mut r, 40, 1.5)
        .deviate(&mut r, &free, 0.01, 0.005);
    let mut h = chain.problem(&free, 1e-4);
    chain.observe(&mut r, &mut h, 1e-4, 0.0);
    let solution = solve(&h.problem, &Settings::default()).unwrap();
    assert!(solution.status.is_converged());
    // 6 + 36 + 6 + 6 scalars; a complete chain of 6 revolute joints has 4·6 + 6.
    assert_eq!(solution.information.rank, 30);
    assert_eq!(solution.model.free() - solution.information.rank, 24);
    // The tool is known although its parts are not.
    let tool = solution
        .relative_pose(h.tracker, h.body, &Configuration::zero())
        .unwrap();
    assert!(tool.estimable);
    let part = solution
        .relative_pose(h.tracker, h.base, &Configuration::zero())
        .unwrap();
    assert!(!part.estimable);
    let ratio = solution.chi2 / solution.degrees_of_freedom;
    assert!((ratio - 1.0).abs() < 0.2, "{ratio}");
}

#[test]
fn predicted_points_carry_the_covariance_that_simulation_shows() {
    // 200 noise draws of one arm: mean squared prediction error against the predicted variance.
    let free = Free::frames_and_offsets(6);
    let chain = Chain::nominal(six_r()).posed(&mut rng(3), 15, 1.2);
    let mut predicted = 0.0;
    let mut actual = 0.0;
    let runs = 200;
    let q = [0.5; 6];
    for run in 0..runs {
        let mut r = rng(1000 + run);
        let mut h = chain.problem(&free, 1e-3);
        chain.observe(&mut r, &mut h, 1e-3, 0.0);
        let solution = solve(&h.problem, &Settings::default()).unwrap();
        let mut at = Configuration::zero();
        for j in &h.joints {
            at = at.with(*j, 0.5);
        }
        let p = nalgebra::Point3::new(0.1, 0.0, 0.05);
        let found = solution.predict_point(h.tracker, h.body, &p, &at).unwrap();
        let truth = chain.tracker_from_body(&q, &[]) * p;
        predicted += found.covariance.unwrap().trace() / runs as f64;
        let error: Vector3<f64> = found.position - truth;
        actual += error.norm_squared() / runs as f64;
    }
    // 200 runs of 3 coordinates: the ratio has σ ≈ 0.08.
    assert!(
        (actual / predicted - 1.0).abs() < 0.3,
        "{actual} {predicted}"
    );
}
