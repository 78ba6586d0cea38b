//! Missing physics is named, and disappears when it is modeled; model comparison prefers the truth.

use crate::common::{Chain, Free, Handles, rng, six_r};
use calib_core::{Criterion, EffectKind, NoiseKind, Settings, Solution, compare, k_fold, solve};
use rand::RngExt;

const SIGMA: f64 = 2e-4;

struct Rig {
    chain: Chain,
    h: Handles,
    /// Torque about each joint's axis per sample, N·m.
    torque: Vec<Vec<f64>>,
    velocity: Vec<Vec<f64>>,
    approach: Vec<Vec<f64>>,
}

/// Which physics the simulated robot has beyond the model.
#[derive(Clone, Copy, PartialEq)]
enum Physics {
    None,
    Compliance,
    Backlash,
    Clock,
    Eccentricity,
    Gain,
}

fn rig(seed: u64, physics: Physics, stated: bool) -> Rig {
    let mut r = rng(seed);
    let free = Free::frames_and_offsets(6);
    let chain = Chain::nominal(six_r())
        .posed(&mut r, 60, 1.4)
        .deviate(&mut r, &free, 0.01, 0.005);
    let n = chain.q.len();
    let mut table = |scale: f64| -> Vec<Vec<f64>> {
        (0..6)
            .map(|_| (0..n).map(|_| r.random_range(-scale..scale)).collect())
            .collect()
    };
    let torque = table(40.0);
    let velocity = table(0.5);
    let approach: Vec<Vec<f64>> = table(1.0)
        .into_iter()
        .map(|v| v.into_iter().map(f64::signum).collect())
        .collect();
    let mut h = chain.problem(&free, SIGMA);
    h.problem.group_mut(h.markers).estimate = !stated;
    let q = chain.q.clone();
    let (t, v, a) = (torque.clone(), velocity.clone(), approach.clone());
    let extra = move |s: usize| {
        (0..6)
            .map(|j| match physics {
                Physics::None => 0.0,
                Physics::Compliance if j == 1 => 3e-5 * t[j][s],
                Physics::Backlash if j == 2 => 5e-4 * a[j][s],
                Physics::Clock => 4e-3 * v[j][s],
                Physics::Eccentricity if j == 3 => 1.5e-3 * q[s][j].sin(),
                Physics::Gain if j == 4 => 6e-3 * q[s][j],
                _ => 0.0,
            })
            .collect()
    };
    let mut noise = rng(seed + 1);
    chain.observe_moved(&mut noise, &mut h, SIGMA, extra);
    for (j, edge) in h.joints.clone().into_iter().enumerate() {
        h.problem
            .candidate(edge, EffectKind::TorqueCompliance, torque[j].clone());
        h.problem
            .candidate(edge, EffectKind::Backlash, approach[j].clone());
        h.problem
            .candidate(edge, EffectKind::ClockOffset, velocity[j].clone());
    }
    h.problem.times = Some((0..n).map(|s| s as f64).collect());
    Rig {
        chain,
        h,
        torque,
        velocity,
        approach,
    }
}

fn fit(r: &Rig) -> Solution {
    solve(&r.h.problem, &Settings::default()).unwrap()
}

#[test]
fn each_missing_effect_is_named_first() {
    for (physics, name, size) in [
        (Physics::Compliance, "j2.compliance", 3e-5),
        (Physics::Backlash, "j3.backlash", 5e-4),
        (Physics::Clock, "clock_offset", 4e-3),
        (Physics::Eccentricity, "j4.eccentricity_sin", 1.5e-3),
        (Physics::Gain, "j5.gain", 6e-3),
    ] {
        for stated in [true, false] {
            let g = fit(&rig(3, physics, stated)).goodness_of_fit().unwrap();
            assert_eq!(g.tests[0].name, name, "{:#?}", &g.tests[..3]);
            assert!(g.tests[0].p_corrected < 1e-6);
            assert!(
                !g.missing.is_empty() && g.missing[0].name == name,
                "{:?}",
                g.missing
            );
            // One step of the score test finds the coefficient to within a third.
            let ratio = g.tests[0].estimate / size;
            assert!((0.66..1.5).contains(&ratio), "{name}: {ratio}");
            if stated {
                assert!(g.chi2_per_dof > 1.5, "{name}: {}", g.chi2_per_dof);
                assert!(g.p_value.unwrap() < 1e-6);
            }
        }
    }
}

#[test]
fn nothing_is_missing_where_nothing_is() {
    let mut false_alarms = 0;
    for seed in 0..20 {
        let g = fit(&rig(100 + seed, Physics::None, true))
            .goodness_of_fit()
            .unwrap();
        assert!(g.tests.len() > 30);
        false_alarms += usize::from(!g.missing.is_empty());
        assert!((g.chi2_per_dof - 1.0).abs() < 0.25);
    }
    // One analysis in a thousand by design.
    assert_eq!(false_alarms, 0);
}

#[test]
fn score_tests_have_the_size_they_claim() {
    // p-values under the null are uniform: share under 0.05 over 20 × 35 correlated tests.
    let (mut small, mut all) = (0.0, 0.0);
    for seed in 0..20 {
        let g = fit(&rig(200 + seed, Physics::None, true))
            .goodness_of_fit()
            .unwrap();
        small += g.tests.iter().filter(|t| t.p_value < 0.05).count() as f64;
        all += g.tests.len() as f64;
    }
    let share: f64 = small / all;
    // The cluster variance only ever makes the test more cautious.
    assert!((0.005..0.075).contains(&share), "{share}");
}

#[test]
fn the_finding_disappears_when_the_effect_is_freed() {
    let mut r = rig(3, Physics::Compliance, true);
    let edge = r.h.joints[1];
    let p = r.h.problem.free_effect_with(
        edge,
        EffectKind::TorqueCompliance,
        r.torque[1].clone(),
        None,
    );
    let s = fit(&r);
    let g = s.goodness_of_fit().unwrap();
    assert!(g.missing.is_empty(), "{:?}", g.missing);
    assert!((g.chi2_per_dof - 1.0).abs() < 0.25);
    let found = &s.parameters[p.index()];
    assert!((found.value - 3e-5).abs() < 3.0 * found.sigma.unwrap());
    assert_eq!(found.name, "j2.compliance");
}

/// A stiff arm: half of its compliances rest on 0, where the fit is stopped. What looks like one of them is not missing for that.
#[test]
fn what_looks_like_a_parameter_on_its_bound_is_not_missing() {
    let mut stopped = 0;
    for seed in 300..320 {
        let mut r = rig(seed, Physics::None, true);
        for (j, edge) in r.h.joints.clone().into_iter().enumerate() {
            // The load of a pendulum, and a little of another.
            let own = r.chain.q.iter().zip(&r.torque[j]);
            let load: Vec<f64> = own.map(|(q, t)| 40.0 * q[j].sin() + 0.05 * t).collect();
            let kind = EffectKind::TorqueCompliance;
            let p = r.h.problem.free_effect_with(edge, kind, load, None);
            r.h.problem.parameter_mut(p).bounds = Some((0.0, f64::INFINITY));
        }
        let s = fit(&r);
        stopped += s.parameters.iter().filter(|p| p.at_bound).count();
        let g = s.goodness_of_fit().unwrap();
        assert!(g.missing.is_empty(), "{seed}: {:?}", g.missing);
    }
    assert!(stopped > 30, "{stopped}");
}

#[test]
fn one_clock_for_all_joints_is_recovered() {
    let mut r = rig(5, Physics::Clock, true);
    let first = r.h.joints[0];
    let p =
        r.h.problem
            .free_effect_with(first, EffectKind::ClockOffset, r.velocity[0].clone(), None);
    for j in 1..6 {
        let edge = r.h.joints[j];
        r.h.problem.share_effect(
            edge,
            EffectKind::ClockOffset,
            Some(r.velocity[j].clone()),
            p,
        );
    }
    let s = fit(&r);
    let found = &s.parameters[p.index()];
    assert!((found.value - 4e-3).abs() < 3.0 * found.sigma.unwrap());
    assert!((s.chi2_stated / s.degrees_of_freedom - 1.0).abs() < 0.25);
}

#[test]
fn drift_of_the_tracker_is_seen() {
    let mut r = rig(6, Physics::None, true);
    for measurement in r.h.problem.measurements_mut() {
        if let calib_core::MeasurementKind::Markers(calib_core::measurement::Markers {
            observations,
            ..
        }) = &mut measurement.kind
        {
            for o in observations {
                o.position.x += 1e-5 * o.sample as f64;
            }
        }
    }
    let g = fit(&r).goodness_of_fit().unwrap();
    assert_eq!(g.tests[0].name, "drift.x");
    // Predicted minus observed grows backwards.
    assert!((g.tests[0].estimate + 1e-5).abs() < 3e-6 || (g.tests[0].estimate - 1e-5).abs() < 3e-6);
    assert_eq!(g.missing[0].physics, calib_core::Physics::Drift);
}

#[test]
fn the_comparison_chooses_the_smallest_model_that_predicts_as_well() {
    let r = rig(3, Physics::Compliance, false);
    let offsets_only = r.h.problem.clone();
    let mut compliance = r.h.problem.clone();
    compliance.free_effect_with(
        r.h.joints[1],
        EffectKind::TorqueCompliance,
        r.torque[1].clone(),
        None,
    );
    let mut everything = compliance.clone();
    for (j, edge) in r.h.joints.iter().enumerate() {
        everything.free_effect_with(*edge, EffectKind::Backlash, r.approach[j].clone(), None);
        everything.free_effect(*edge, EffectKind::EccentricitySin, None);
        everything.free_effect(*edge, EffectKind::EccentricityCos, None);
    }
    let variants = [
        ("offsets".to_owned(), offsets_only),
        ("+ compliance".to_owned(), compliance),
        ("+ everything".to_owned(), everything),
    ];
    let by_density = compare(&variants, &Settings::default(), Criterion::LogDensity).unwrap();
    let ranked = compare(&variants, &Settings::default(), Criterion::PositionError).unwrap();
    for list in [&by_density, &ranked] {
        assert_eq!(list.iter().find(|v| v.chosen).unwrap().name, "+ compliance");
        assert_eq!(list.last().unwrap().name, "offsets");
    }
    let chosen = ranked.iter().find(|v| v.chosen).unwrap();
    assert_eq!(chosen.name, "+ compliance");
    let rich = ranked.iter().find(|v| v.name == "+ everything").unwrap();
    // Most of the 18 effects that the robot does not have are called noise.
    assert!(
        rich.noise_parameters.len() >= 12,
        "{:?}",
        rich.noise_parameters
    );
    let names: Vec<&str> = rich
        .noise_parameters
        .iter()
        .map(|p| variants[2].1.parameters()[p.index()].name.as_str())
        .collect();
    assert!(!names.contains(&"j2.compliance"));
    let poor = ranked.iter().find(|v| v.name == "offsets").unwrap();
    assert!(poor.worse_by > 3.0 * poor.standard_error);
    assert!(ranked[0].worse_by == 0.0 && poor.loo_rms > 1.5 * chosen.loo_rms);
    assert_eq!(r.chain.q.len(), 60);
}

#[test]
fn folds_partition_the_samples_and_predict_them_all() {
    let mut r = rig(8, Physics::None, true);
    r.h.problem.held_out = [0, 1].into();
    let folds = calib_core::folds(&r.h.problem, 10);
    let mut all: Vec<usize> = folds.iter().flatten().copied().collect();
    all.sort_unstable();
    assert_eq!(all, (2..60).collect::<Vec<_>>());
    assert!(folds.iter().all(|f| (5..=6).contains(&f.len())));
    assert_eq!(folds, calib_core::folds(&r.h.problem, 10));
    let cv = k_fold(&r.h.problem, &Settings::plain(), 10).unwrap();
    assert_eq!(cv.samples.len(), 58);
    let z2: f64 = cv.samples.iter().map(|s| s.z2).sum();
    let rows: usize = cv.samples.iter().map(|s| s.rows).sum();
    assert!((z2 / rows as f64 - 1.0).abs() < 0.2);
}

#[test]
fn noise_groups_keep_their_kind() {
    let r = rig(8, Physics::None, true);
    assert_eq!(fit(&r).noise[0].kind, NoiseKind::Position);
}

/// Mean, standard deviation and share beyond ± 2 of the standardized residuals.
fn spread(residuals: &[f64]) -> (f64, f64, f64) {
    let n = residuals.len() as f64;
    let mean = residuals.iter().sum::<f64>() / n;
    let variance = residuals.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / n;
    let beyond = residuals.iter().filter(|r| r.abs() > 2.0).count() as f64;
    (mean, variance.sqrt(), beyond / n)
}

#[test]
fn standardized_residuals_are_standard_normal_where_the_noise_is_right() {
    for seed in 0..4 {
        let s = fit(&rig(300 + seed, Physics::None, true));
        let residuals = s.standardized_residuals().unwrap().rows;
        assert!(residuals.len() as f64 > s.degrees_of_freedom);
        let (mean, std, beyond) = spread(&residuals);
        assert!(
            mean.abs() < 0.15 && (std - 1.0).abs() < 0.12,
            "{mean} {std}"
        );
        // 4.6 % of a standard normal distribution.
        assert!((0.02..0.08).contains(&beyond), "{beyond}");
    }
    // Half of the noise stated: everything is twice as large.
    let mut wrong = rig(300, Physics::None, true);
    let markers = wrong.h.markers;
    wrong.h.problem.group_mut(markers).sigma *= 0.5;
    let (_, std, _) = spread(&fit(&wrong).standardized_residuals().unwrap().rows);
    assert!((std - 2.0).abs() < 0.3, "{std}");
}
