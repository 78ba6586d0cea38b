//! Recordings of many samples: a fit begins with some of them and tests look at some of them, and nothing that matters is lost by it.

use crate::common::{Chain, Free, Handles, normal, normal3, rng, six_r};
use calib_core::{ChangeSettings, MarkerObservation, Moved, Settings, Solution, solve, solve_some};
use nalgebra::{Point3, Translation3, Vector3};
use rand::RngExt;

/// Marker noise, m.
const SIGMA: f64 = 3e-4;
/// Joint noise, rad (0.01°).
const JOINT: f64 = 1.7e-4;
/// Samples of the first recording: it alone moves the last joint.
const SHORT: usize = 60;
/// Samples of both, more than tests look at.
const SAMPLES: usize = 5_000;

/// What the recordings have beside noise.
#[derive(Clone, Copy, Default)]
struct Has {
    /// Share of samples one marker of which is 20 mm off.
    outliers: f64,
    /// The body moves on its link: sample and distance, m.
    slip: Option<(usize, f64)>,
    /// The last joint moves farther than it reads, by this ratio.
    gain: f64,
    /// Readings have noise, and the model knows.
    joint_noise: bool,
}

struct Case {
    h: Handles,
    /// Observations that are gross, by their place.
    gross: Vec<usize>,
}

fn case(seed: u64, has: Has) -> Case {
    let mut r = rng(seed);
    let free = Free::frames_and_offsets(6);
    let mut chain = Chain::nominal(six_r()).posed(&mut r, SAMPLES, 1.4);
    for (s, q) in chain.q.iter_mut().enumerate() {
        if s >= SHORT {
            q[5] = 0.2;
        }
    }
    let mut chain = chain.deviate(&mut r, &free, 0.02, 0.01);
    let mut h = chain.problem(&free, SIGMA);
    h.problem.group_mut(h.markers).estimate = true;
    h.problem.borders = vec![SHORT];
    if has.joint_noise {
        h.scattering_joints(JOINT);
    }
    let mount = chain.true_mount;
    let (mut seen, mut gross) = (Vec::new(), Vec::new());
    for s in 0..SAMPLES {
        let slip = has.slip.filter(|(at, _)| s >= *at).map_or(0.0, |(_, m)| m);
        chain.true_mount = mount * Translation3::from(Vector3::x() * slip);
        let q = chain.q[s].clone();
        let mut extra: Vec<f64> = match has.joint_noise {
            true => (0..6).map(|_| normal(&mut r) * JOINT).collect(),
            false => vec![0.0; 6],
        };
        extra[5] += has.gain * q[5];
        let x = chain.tracker_from_body(&q, &extra);
        let struck = r.random_bool(has.outliers).then(|| r.random_range(0..4));
        for (m, p) in chain.markers.iter().enumerate() {
            let mut position = Point3::from((x * p).coords + normal3(&mut r) * SIGMA);
            if struck == Some(m) {
                gross.push(seen.len());
                position += normal3(&mut r).normalize() * 0.02;
            }
            seen.push(MarkerObservation {
                sample: s,
                point: h.points[m],
                position,
                shape: None,
            });
        }
    }
    h.problem
        .markers("body", h.tracker, h.body, h.markers, seen);
    Case { h, gross }
}

fn fit(case: &Case) -> Solution {
    solve(&case.h.problem, &Settings::default()).expect("solves")
}

/// The fit that knows which observations are gross.
fn informed(case: &Case) -> Solution {
    let mut problem = case.h.problem.clone();
    let calib_core::MeasurementKind::Markers(markers) = &mut problem.measurements_mut()[0].kind
    else {
        unreachable!("the chain has one marker measurement");
    };
    let mut place = 0..;
    markers.observations.retain(|_| {
        let place = place.next();
        place.is_some_and(|p| case.gross.binary_search(&p).is_err())
    });
    let mut settings = Settings::default();
    settings.robust.enabled = false;
    solve(&problem, &settings).expect("solves")
}

#[test]
fn a_fit_that_begins_with_some_samples_ends_where_all_of_them_say() {
    for joint_noise in [false, true] {
        let has = Has {
            outliers: 0.05,
            joint_noise,
            ..Has::default()
        };
        let case = case(1, has);
        let (found, best) = (fit(&case), informed(&case));
        assert!(found.status.is_converged());
        for (found, best) in found.parameters.iter().zip(&best.parameters) {
            if let (Some(sigma), Some(least)) = (found.sigma, best.sigma) {
                // The gate leaves out one good observation of a thousand.
                let off = (found.value - best.value) / least;
                assert!(off.abs() < 0.3, "{}: {off} σ", found.name);
                assert!((sigma / least - 1.0).abs() < 0.02, "{}", found.name);
            }
        }
        let rejected: Vec<usize> = found
            .rejected
            .iter()
            .map(|r| 4 * r.sample + r.item % 4)
            .collect();
        let missed = case.gross.iter().filter(|g| !rejected.contains(g)).count();
        assert_eq!(missed, 0);
        let chance = rejected.len() - case.gross.len();
        assert!(chance < SAMPLES * 4 / 500, "{chance} good ones rejected");
        // The short recording is like any other.
        let of_short = rejected.iter().filter(|o| **o < 4 * SHORT).count();
        assert!(of_short < 10, "{of_short} of the short recording");
    }
}

#[test]
fn a_fit_of_some_samples_rejects_all_that_the_fit_of_all_rejects() {
    for joint_noise in [false, true] {
        let has = Has {
            outliers: 0.01,
            joint_noise,
            ..Has::default()
        };
        let case = case(6, has);
        let settings = Settings::default();
        let some = solve_some(&case.h.problem, &settings).expect("solves");
        let (some, all) = (some.expect("a long recording"), fit(&case));
        assert!(some.status.is_converged());
        let places = |of: &Solution| -> Vec<(usize, usize)> {
            of.rejected.iter().map(|r| (r.sample, r.item)).collect()
        };
        let (some, all) = (places(&some), places(&all));
        assert!(all.iter().all(|place| some.contains(place)));
        // Five good observations of a thousand in place of one.
        let more = some.len() - all.len();
        assert!((20..160).contains(&more), "{more} of {}", 4 * SAMPLES);
    }
}

#[test]
fn a_slip_is_found_at_its_sample() {
    let at = 3_217;
    let has = Has {
        slip: Some((at, 3.0 * SIGMA)),
        joint_noise: true,
        ..Has::default()
    };
    let slipped = case(1, has);
    let mut settings = ChangeSettings::default();
    settings.borders = vec![SHORT];
    let scan = fit(&slipped).changes(&settings).expect("evaluable");
    let change = scan.significant().expect("a slip");
    assert_eq!(change.moved, Moved::Body(slipped.h.body));
    assert!(change.first.abs_diff(at) <= 1, "{} for {at}", change.first);
    let length = Vector3::new(change.jump[3], change.jump[4], change.jump[5]).norm();
    assert!((length / (3.0 * SIGMA) - 1.0).abs() < 0.1, "{length}");
}

#[test]
fn nothing_moved_in_a_long_recording() {
    if !skipped_tests::thorough() {
        return;
    }
    let clean = case(3, Has::default());
    let scan = fit(&clean).changes(&ChangeSettings::default());
    assert_eq!(scan.expect("evaluable").significant(), None);
}

#[test]
fn what_only_a_short_recording_shows_is_named() {
    let has = Has {
        gain: 0.004,
        ..Has::default()
    };
    let with = fit(&case(4, has)).goodness_of_fit().expect("evaluable");
    // Over ±80° the reading is nearly its sine.
    let first = with.tests.first().expect("tests");
    assert!(first.name.starts_with("j6."), "{}", first.name);
    let gain = with.tests.iter().find(|t| t.name == "j6.gain");
    let gain = gain.expect("tested");
    assert!(gain.is_significant());
    assert!(
        (gain.estimate / 0.004 - 1.0).abs() < 0.25,
        "{}",
        gain.estimate
    );
    let without = fit(&case(4, Has::default()));
    let without = without.goodness_of_fit().expect("evaluable");
    assert!(
        !without
            .tests
            .iter()
            .any(calib_core::ScoreTest::is_significant)
    );
}

#[test]
fn standard_deviations_of_clusters_and_residuals_are_those_of_all_samples() {
    let has = Has {
        joint_noise: true,
        ..Has::default()
    };
    let solution = fit(&case(5, has));
    let robust = solution.cluster_robust_sigmas().expect("evaluable");
    for (parameter, robust) in solution.parameters.iter().zip(robust) {
        if let (Some(sigma), Some(robust)) = (parameter.sigma, robust) {
            // What only sixty samples determine varies by a tenth.
            let ratio = robust / sigma;
            assert!((0.7..1.4).contains(&ratio), "{}: {ratio}", parameter.name);
        }
    }
    let residuals = solution.standardized_residuals().expect("evaluable").rows;
    let squares: f64 = residuals.iter().map(|r| r * r).sum();
    let variance = squares / residuals.len() as f64;
    assert!((variance - 1.0).abs() < 0.02, "{variance}");
}
