//! Gear ratios that nobody stated, found from the errors of joints on simulated arms.

use crate::common::{Chain, Free, normal, rng, six_r};
use calib_core::{GearRatio, NoiseKind, Settings, solve};
use rand::RngExt;

const MARKER: f64 = 2e-4;

/// An arm whose third joint errs by `amplitude`, rad, `ratio` times per turn; what is found, the clearest first.
fn found(
    seed: u64,
    (ratio, amplitude): (f64, f64),
    joint_noise: f64,
    step: Option<f64>,
) -> Vec<GearRatio> {
    let mut r = rng(seed);
    let free = Free {
        prior: Some((0.0175, 0.01)),
        ..Free::frames_and_offsets(6)
    };
    let mut chain = Chain::nominal(six_r()).posed(&mut r, 60, 1.4);
    if let Some(step) = step {
        for q in chain.q.iter_mut().flatten() {
            *q = (*q / step).round() * step;
        }
    }
    let chain = chain.deviate(&mut r, &free, 0.005, 0.001);
    let mut h = chain.problem(&free, MARKER);
    h.problem.group_mut(h.markers).estimate = true;
    let joints = h.problem.noise_group("joint", NoiseKind::Joint, 2e-4, true);
    for j in &h.joints {
        h.problem.joint_noise(*j, joints);
    }
    let phase = r.random_range(0.0..6.0);
    let draws: Vec<f64> = (0..6 * chain.q.len()).map(|_| normal(&mut r)).collect();
    let q = chain.q.clone();
    chain.observe_moved(&mut r, &mut h, MARKER, |s| {
        let mut extra: Vec<f64> = (0..6).map(|j| joint_noise * draws[6 * s + j]).collect();
        extra[2] += amplitude * (ratio * q[s][2] + phase).cos();
        extra
    });
    let solution = solve(&h.problem, &Settings::default()).unwrap();
    solution.gear_ratios(20.0, 200.0).expect("evaluable")
}

#[test]
fn the_ratio_of_a_gear_train_out_of_center_is_found() {
    let mut within = 0;
    for (k, ratio) in [51.0, 80.0, 100.0, 101.0, 160.0, 121.5]
        .into_iter()
        .enumerate()
    {
        let all = found(20 + k as u64, (ratio, 5e-4), 1e-4, None);
        let best = &all[0];
        assert!(best.is_significant(), "{ratio}: {best:?}");
        assert_eq!(best.name, "j3", "{best:?}");
        assert!(!all[1].is_significant(), "{:?}", all[1]);
        assert!(
            (best.ratio - ratio).abs() < 5.0 * best.sigma + 0.02,
            "{best:?}"
        );
        assert!((best.amplitude / 5e-4 - 1.0).abs() < 0.4, "{best:?}");
        within += usize::from((best.ratio - ratio).abs() < 2.0 * best.sigma);
    }
    // 95 % each; four of six or fewer in 3 of 100.
    assert!(within >= 4, "{within} of 6 within 2 standard deviations");
}

#[test]
fn without_an_error_of_the_motor_no_ratio_is_found() {
    for seed in 0..8 {
        let all = found(60 + seed, (100.0, 0.0), 2e-4, None);
        assert!(all.iter().all(|g| !g.is_significant()), "{:?}", all[0]);
    }
}

/// With readings in steps of 2°, n and 180 − n turns of the motor are one and the same error.
#[test]
fn ratios_that_the_readings_cannot_tell_apart_are_not_stated() {
    let all = found(90, (80.0, 5e-4), 1e-4, Some(2f64.to_radians()));
    assert!(all.iter().all(|g| !g.is_significant()), "{:?}", all[0]);
    assert!(all[0].p_corrected < 1e-3, "{:?}", all[0]);
}
