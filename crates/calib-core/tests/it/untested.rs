//! How far predictions can be off with an effect that the model does not have, against the truth; and held-out errors against
//! what is stated of them.

use std::collections::BTreeSet;

use crate::common::*;
use calib_core::{
    Change, ChangeSettings, Configuration, MovedPoint, Moves, NoiseKind, OpenCause, OpenErrors,
    Settings, Solution, Target, UntestedEffect, solve,
};

const SIGMA: f64 = 3e-4;
const FITTED: usize = 12;
const HELD_OUT: usize = 6;
const POSTURES: usize = 24;
/// Joint with the gain.
const JOINT: usize = 3;
/// σ of the gain.
const GAIN: f64 = 0.005;

struct Rig {
    chain: Chain,
    solution: Solution,
    handles: Handles,
    gain: f64,
}

/// A robot off by the priors of the fit, with a gain that the fit does not know.
fn rig(seed: u64, gain: f64) -> Rig {
    rig_with(seed, gain, None)
}

/// The same, with joints that the fit knows to be noisy.
fn rig_with(seed: u64, gain: f64, joints: Option<f64>) -> Rig {
    rig_of(seed, gain, joints, (FITTED, HELD_OUT))
}

/// The same with so many fitted and held-out poses.
fn rig_of(seed: u64, gain: f64, joints: Option<f64>, count: (usize, usize)) -> Rig {
    let (fitted, held_out) = count;
    let mut r = rng(seed);
    let mut free = Free::everything(6);
    free.prior = Some((0.005, 0.002));
    let chain = Chain::nominal(six_r()).deviate(&mut r, &free, 0.005, 0.002);
    let chain = chain.posed(&mut r, fitted + held_out, 1.2);
    let gain = gain * normal(&mut r);
    let mut handles = chain.problem(&free, SIGMA);
    handles.problem.group_mut(handles.markers).estimate = false;
    if let Some(sigma) = joints {
        let p = &mut handles.problem;
        let noise = p.noise_group("joints", NoiseKind::Joint, sigma, false);
        handles.joints.iter().for_each(|j| p.joint_noise(*j, noise));
    }
    let q = chain.q.clone();
    let noise: Vec<[f64; 6]> = q
        .iter()
        .map(|_| [0.0; 6].map(|_: f64| joints.map_or(0.0, |sigma| sigma * normal(&mut r))))
        .collect();
    let extra = |s: usize| {
        let moved = |j: usize| if j == JOINT { gain * q[s][j] } else { 0.0 };
        (0..6).map(|j| moved(j) + noise[s][j]).collect()
    };
    chain.observe_moved(&mut r, &mut handles, SIGMA, extra);
    handles.problem.held_out = (fitted..fitted + held_out).collect();
    let solution = solve(&handles.problem, &Settings::plain()).expect("solved");
    Rig {
        chain,
        solution,
        handles,
        gain,
    }
}

fn postures() -> Vec<Vec<f64>> {
    let at = |i: usize, k: usize| 1.2 * (0.7 * (i * (k + 2)) as f64).sin();
    (0..POSTURES)
        .map(|i| (0..6).map(|k| at(i, k)).collect())
        .collect()
}

fn open(rig: &Rig, looked_at: &[usize]) -> OpenErrors {
    open_with(rig, looked_at, looked_at.len(), None)
}

/// With a change that was found as a second cause; the design from at most so many samples.
fn open_with(rig: &Rig, looked_at: &[usize], most: usize, change: Option<&Change>) -> OpenErrors {
    let h = &rig.handles;
    let postures = postures();
    let point = |q: &Vec<f64>| {
        let joints = h.joints.iter().zip(q);
        let at = joints.fold(Configuration::zero(), |at, (j, q)| at.with(*j, *q));
        let seen = rig
            .solution
            .moved_point(h.tracker, Target::Frame(h.body), &at);
        seen.expect("a path")
    };
    let points: Vec<MovedPoint> = postures.iter().map(point).collect();
    let effect = UntestedEffect {
        moves: Moves::Joint(h.joints[JOINT]),
        sigma: GAIN,
        at_samples: looked_at.iter().map(|s| rig.chain.q[*s][JOINT]).collect(),
        at_postures: postures.iter().map(|q| q[JOINT]).collect(),
    };
    let found = change.map(|change| OpenCause::Found {
        change,
        carries: true,
    });
    let gain = OpenCause::Effects(vec![effect]);
    let causes: Vec<OpenCause<'_>> = std::iter::once(gain).chain(found).collect();
    let found = rig.solution.open_errors(looked_at, most, &causes, &points);
    found.expect("postures")
}

/// Mean square of what the fit predicts less the truth, m².
fn truth(rig: &Rig) -> f64 {
    truth_with(rig, || 0.0)
}

/// The same where the joints stop at readings that are off by `noise`.
fn truth_with(rig: &Rig, mut noise: impl FnMut() -> f64) -> f64 {
    let h = &rig.handles;
    let squares = postures().into_iter().map(|q| {
        let joints = h.joints.iter().zip(&q);
        let at = joints.fold(Configuration::zero(), |at, (j, q)| at.with(*j, *q));
        let found = rig.solution.relative_pose(h.tracker, h.body, &at);
        let mut extra = [0.0; 6].map(|_: f64| noise());
        extra[JOINT] += rig.gain * q[JOINT];
        let true_pose = rig.chain.tracker_from_body(&q, &extra);
        let found = found.expect("a path").pose.translation.vector;
        (found - true_pose.translation.vector).norm_squared()
    });
    squares.sum::<f64>() / POSTURES as f64
}

#[test]
fn the_error_with_an_unknown_gain_is_as_large_as_expected() {
    let all: Vec<usize> = (0..FITTED + HELD_OUT).collect();
    let (mut found, mut expected, mut stated, mut covered) = (0.0, 0.0, 0.0, 0);
    const ROBOTS: u64 = 60;
    for seed in 0..ROBOTS {
        let rig = rig(seed, GAIN);
        let (open, error) = (open(&rig, &all), truth(&rig));
        found += error;
        expected += open.with[0].rms.powi(2);
        stated += open.stated.powi(2);
        covered += usize::from(error.sqrt() <= open.with[0].upper);
        let (estimate, sigma) = open.sizes[0][0];
        assert!((estimate - rig.gain).abs() < 5.0 * sigma);
    }
    let ratio = found / expected;
    assert!((0.7..1.4).contains(&ratio), "{ratio}");
    // The fit alone states much less: it does not know of gains.
    assert!(found / stated > 2.0, "{}", found / stated);
    // 99 of 100: at least 55 of 60 but once in ten thousand.
    assert!(covered >= 55, "{covered}");
}

#[test]
fn without_an_effect_the_parameters_alone_are_left() {
    let fitted: Vec<usize> = (0..FITTED).collect();
    let all: Vec<usize> = (0..FITTED + HELD_OUT).collect();
    let (mut found, mut expected) = (0.0, 0.0);
    for seed in 100..140 {
        let rig = rig(seed, 0.0);
        let alone = open(&rig, &fitted).alone;
        // What the fit states, but for rounding: nothing is held out.
        let stated = open(&rig, &fitted).stated;
        assert!(
            (alone.rms / stated - 1.0).abs() < 0.01,
            "{alone:?} {stated}"
        );
        let with_held_out = open(&rig, &all);
        found += truth(&rig);
        expected += with_held_out.alone.rms.powi(2);
        // The data say something of the gain, and held-out data more.
        let sigma = |open: &OpenErrors| open.sizes[0][0].1;
        assert!(sigma(&with_held_out) < sigma(&open(&rig, &fitted)));
        assert!(sigma(&with_held_out) < GAIN);
    }
    assert!((0.7..1.4).contains(&(found / expected)));
}

/// Many rows of which a part stands for all: what that part happens to say must not be multiplied.
#[test]
fn a_part_of_many_rows_makes_no_error_larger() {
    const ROWS: usize = 240;
    let all: Vec<usize> = (0..ROWS).collect();
    let (mut with, mut of_all, mut stated) = (0.0, 0.0, 0.0);
    for seed in 500..508 {
        let rig = rig_of(seed, 0.0, None, (ROWS, 0));
        let part = open_with(&rig, &all, ROWS / 4, None);
        let exact = open_with(&rig, &all, ROWS, None);
        assert!(
            (part.alone.rms / part.stated - 1.0).abs() < 0.3,
            "{:?} {}",
            part.alone,
            part.stated
        );
        with += part.with[0].rms.powi(2);
        of_all += exact.with[0].rms.powi(2);
        stated += part.stated.powi(2);
    }
    // One number more beside those of the fit.
    assert!(with < 2.0 * stated, "{}", with / stated);
    // Sixty samples of the design; multiplied residuals would make it 4.
    assert!((0.6..1.8).contains(&(with / of_all)), "{}", with / of_all);
}

/// A body that slips, the last fifth of the rows after it, and a fit that does not know: the robot is used as it is after.
fn slipped(seed: u64) -> (Rig, Change) {
    const ROWS: usize = 40;
    const FIRST: usize = 32;
    const SLIP: f64 = 1e-3;
    let mut r = rng(seed);
    let mut free = Free::everything(6);
    free.prior = Some((0.005, 0.002));
    let chain = Chain::nominal(six_r()).deviate(&mut r, &free, 0.005, 0.002);
    let mut chain = chain.posed(&mut r, ROWS, 1.2);
    let mut handles = chain.problem(&free, SIGMA);
    handles.problem.group_mut(handles.markers).estimate = true;
    let direction = normal3(&mut r).normalize() * SLIP;
    let mut seen = Vec::new();
    for s in 0..ROWS {
        if s == FIRST {
            chain.true_mount *= nalgebra::Translation3::from(direction);
        }
        let x = chain.tracker_from_body(&chain.q[s], &[0.0; 6]);
        for (m, p) in chain.markers.iter().enumerate() {
            seen.push(calib_core::MarkerObservation {
                sample: s,
                point: handles.points[m],
                position: x * p + normal3(&mut r) * SIGMA,
                shape: None,
            });
        }
    }
    let (tracker, body, group) = (handles.tracker, handles.body, handles.markers);
    handles.problem.markers("body", tracker, body, group, seen);
    let mut settings = Settings::default();
    settings.robust.enabled = false;
    let solution = solve(&handles.problem, &settings).expect("solved");
    let scan = solution
        .changes(&ChangeSettings::default())
        .expect("a scan");
    let change = scan.significant().expect("a slip").clone();
    let rig = Rig {
        chain,
        solution,
        handles,
        gain: 0.0,
    };
    (rig, change)
}

#[test]
fn a_slip_that_was_found_is_in_the_expected_error() {
    let all: Vec<usize> = (0..40).collect();
    let (mut found, mut expected, mut alone, mut covered) = (0.0, 0.0, 0.0, 0);
    const ROBOTS: usize = 8;
    for seed in 0..ROBOTS as u64 {
        let (rig, change) = slipped(600 + seed);
        let (open, error) = (open_with(&rig, &all, all.len(), Some(&change)), truth(&rig));
        found += error;
        expected += open.with[1].rms.powi(2);
        alone += open.alone.rms.powi(2);
        covered += usize::from(error.sqrt() <= open.with[1].upper);
    }
    // The parameters alone do not know of it.
    assert!(found > 3.0 * alone, "{}", found / alone);
    assert!(
        (0.7..1.4).contains(&(found / expected)),
        "{}",
        found / expected
    );
    assert!(covered >= ROBOTS - 1, "{covered}");
}

#[test]
fn a_prediction_carries_what_the_joints_do_from_pose_to_pose() {
    const JOINTS: f64 = 1e-3;
    let all: Vec<usize> = (0..FITTED + HELD_OUT).collect();
    let (mut found, mut expected, mut joints, mut covered) = (0.0, 0.0, 0.0, 0);
    const ROBOTS: u64 = 40;
    for seed in 400..400 + ROBOTS {
        let rig = rig_with(seed, 0.0, Some(JOINTS));
        let mut r = rng(seed + 7000);
        let (open, error) = (
            open(&rig, &all),
            truth_with(&rig, || JOINTS * normal(&mut r)),
        );
        found += error;
        expected += open.alone.rms.powi(2);
        joints += open.joints.powi(2);
        covered += usize::from(error.sqrt() <= open.alone.upper);
        assert!(open.joints < open.alone.rms && open.joints < open.with[0].rms);
    }
    assert!(
        (0.75..1.33).contains(&(found / expected)),
        "{}",
        found / expected
    );
    // The parameters alone explain two thirds of it at most.
    assert!(joints / expected > 0.33, "{}", joints / expected);
    assert!(covered >= 36, "{covered}");
    let none = open(&rig(1, 0.0), &all).joints;
    assert!(none == 0.0);
}

#[test]
fn held_out_errors_have_the_distribution_that_is_stated() {
    let none = BTreeSet::new();
    let of = |gain: f64| -> f64 {
        let mean = (200..230).map(|seed| {
            let rig = rig(seed, gain);
            let (chi2, rows) = rig
                .solution
                .held_out_chi2(&none, &|_, _, found| found)
                .expect("held out");
            assert_eq!(rows, HELD_OUT * 4 * 3);
            chi2 / rows as f64
        });
        mean.sum::<f64>() / 30.0
    };
    // 30 × 72 degrees of freedom: ± 0.03.
    let clean = of(0.0);
    assert!((0.88..1.12).contains(&clean), "{clean}");
    assert!(of(GAIN) > 1.5);
    // Samples that are left out do not count.
    let rig = rig(1, 0.0);
    let half: BTreeSet<usize> = (FITTED..FITTED + HELD_OUT / 2).collect();
    assert_eq!(
        rig.solution
            .held_out_chi2(&half, &|_, _, found| found)
            .expect("held out")
            .1,
        36
    );
    let every: BTreeSet<usize> = (0..FITTED + HELD_OUT).collect();
    assert!(
        rig.solution
            .held_out_chi2(&every, &|_, _, found| found)
            .is_none()
    );
}
