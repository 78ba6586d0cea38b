//! The noise from pose to pose by evidence, on arms with known truth: complete models with noise of each kind, and models
//! that physics is missing from.

use crate::common::{Chain, Free, Handles, normal, rng, six_r};
use calib_core::{
    Configuration, ErrorSummary, MeasurementKind, NoiseKind, NoiseModel, RobustSettings, Settings,
    Solution, Weighed, solve,
};

const MARKER: f64 = 2e-4;

/// What is true of the arm and not in the model.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Truth {
    /// Nothing.
    White,
    /// Joint noise, rad.
    Joint(f64),
    /// Noise of the last joints only, rad: those of the wrist are worse.
    Wrist(f64),
    /// Gears out of center, rad.
    Eccentric(f64),
    /// Joints give way under the links behind them, rad at full stretch.
    Sags(f64),
    /// A joint rests on either side of its backlash, as gravity pulls, rad.
    Backlash(f64),
}

/// Frames, offsets and the lines of all axes but the first.
fn free() -> Free {
    Free {
        prior: Some((0.0175, 0.01)),
        origins: six_r()
            .iter()
            .enumerate()
            .map(|(i, l)| match l.axis {
                calib_core::Axis::Revolute(a) if i > 0 => calib_core::Chart::axis_line(&a),
                _ => calib_core::Chart::none(),
            })
            .collect(),
        ..Free::frames_and_offsets(6)
    }
}

/// Poses to fit, then 60 to predict.
struct Case {
    chain: Chain,
    handles: Handles,
}

impl Case {
    fn new(seed: u64, fitted: usize, truth: Truth) -> Self {
        Self::with_second(seed, fitted, truth, None)
    }

    /// With a second body, whose markers have so many times the noise.
    fn with_second(seed: u64, fitted: usize, truth: Truth, ratio: Option<f64>) -> Self {
        let mut r = rng(seed);
        let free = free();
        let chain = Chain::nominal(six_r())
            .posed(&mut r, fitted + 60, 1.4)
            .deviate(&mut r, &free, 0.005, 0.001);
        let mut h = chain.problem(&free, MARKER);
        h.problem.group_mut(h.markers).estimate = true;
        let joints = h
            .problem
            .noise_group("joint", NoiseKind::Joint, 1.7e-4, true);
        for j in &h.joints {
            h.problem.joint_noise(*j, joints);
        }
        let phases: Vec<(f64, f64)> = (0..6)
            .map(|_| (normal(&mut r).abs() + 0.5, 3.0 * normal(&mut r)))
            .collect();
        let draws: Vec<Vec<f64>> = chain
            .q
            .iter()
            .map(|q| q.iter().map(|_| normal(&mut r)).collect())
            .collect();
        let q = chain.q.clone();
        // Torque of gravity about the pitching joints, full stretch 1.
        let pull = |s: usize, j: usize| match j {
            1 => 0.6 * q[s][1].cos() + 0.4 * (q[s][1] + q[s][2]).cos(),
            2 => 0.4 * (q[s][1] + q[s][2]).cos(),
            _ => 0.0,
        };
        let extra = |s: usize| -> Vec<f64> {
            (0..6)
                .map(|j| match truth {
                    Truth::White => 0.0,
                    Truth::Joint(sigma) => sigma * draws[s][j],
                    Truth::Wrist(sigma) => {
                        if j > 3 {
                            sigma * draws[s][j]
                        } else {
                            0.0
                        }
                    }
                    Truth::Eccentric(a) => a * phases[j].0 * (q[s][j] + phases[j].1).cos(),
                    Truth::Sags(a) => a * pull(s, j),
                    Truth::Backlash(a) if j == 1 || j == 2 => a * (20.0 * pull(s, j)).tanh(),
                    Truth::Backlash(_) => 0.0,
                })
                .collect()
        };
        chain.observe_moved(&mut r, &mut h, MARKER, extra);
        if let Some(ratio) = ratio {
            let second = h.problem.frame("second");
            let place = nalgebra::Isometry3::identity();
            h.problem.known("between", h.body, second, place);
            h.body = second;
            let points = chain.markers.iter().enumerate();
            h.points = points
                .map(|(i, p)| h.problem.known_point(&format!("n{i}"), second, *p))
                .collect();
            chain.observe_moved(&mut r, &mut h, ratio * MARKER, extra);
            h.problem.measurements_mut()[1].name = "second".to_owned();
        }
        h.problem.held_out = (fitted..fitted + 60).collect();
        Self { chain, handles: h }
    }

    fn solved(&self, noise: NoiseModel) -> Solution {
        let problem = self.handles.problem.with_noise_model(noise).unwrap();
        solve(&problem, &Settings::default()).unwrap()
    }
}

/// rms position error on the poses that were not fitted.
fn held_out(s: &Solution) -> f64 {
    ErrorSummary::positions(&s.held_out().unwrap().samples).rms
}

fn weighed(s: &Solution) -> Weighed {
    s.weighed(&NoiseModel::ALL, &Settings::default()).unwrap()
}

/// rms over several arms.
fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

#[test]
fn joint_noise_is_found_where_it_is() {
    // 12 arms of each kind: a wrong choice in one of six is the limit. 1e-4 rad at a meter is half of a marker's noise.
    for (truth, least, most) in [
        (Truth::White, 0.0, 1e-4),
        (Truth::Joint(3.5e-4), 2.5e-4, 5e-4),
    ] {
        let found: Vec<(NoiseModel, f64)> = (0..12)
            .map(|seed| {
                let joint = Case::new(100 + seed, 40, truth).solved(NoiseModel::Joint);
                let weighed = weighed(&joint);
                let of = weighed.solution.as_ref().unwrap_or(&joint).noise.iter();
                let levels = of.filter(|n| n.kind == NoiseKind::Joint && n.estimated);
                let largest = levels.map(|n| n.sigma).fold(0.0, f64::max);
                (weighed.choice.chosen, largest)
            })
            .collect();
        let right = |(chosen, sigma): &&(NoiseModel, f64)| {
            [NoiseModel::White, NoiseModel::Joint].contains(chosen) && (least..most).contains(sigma)
        };
        assert!(
            found.iter().filter(right).count() >= 10,
            "{truth:?}: {found:?}"
        );
    }
}

/// Part of the coordinates of the body's origin at the poses that were not fitted within their 95 % intervals.
fn covered(case: &Case, s: &Solution) -> f64 {
    let h = &case.handles;
    let (mut inside, mut count) = (0.0, 0.0);
    for &sample in &h.problem.held_out {
        let q = &case.chain.q[sample];
        let joints = h.joints.iter().zip(q);
        let at = joints.fold(Configuration::zero(), |at, (joint, q)| at.with(*joint, *q));
        let truth = case.chain.tracker_from_body(q, &[0.0; 6]);
        let p = nalgebra::Point3::origin();
        let found = s.predict_point(h.tracker, h.body, &p, &at).unwrap();
        let covariance = found.covariance.unwrap();
        for i in 0..3 {
            let z = (found.position - truth.translation.vector)[i] / covariance[(i, i)].sqrt();
            inside += f64::from(z.abs() < 1.96);
            count += 1.0;
        }
    }
    inside / count
}

/// Few poses, joints that scatter more than the tracker: where equal weights, or those of each body, predict as well, the joints do not stand still.
#[test]
fn weights_that_trust_no_joints_state_what_joints_do() {
    let (mut inside, mut count) = (0.0, 0.0);
    for seed in 700..780 {
        let case = Case::new(seed, 12, Truth::Joint(7e-4));
        let joint = case.solved(NoiseModel::Joint);
        let weighed = weighed(&joint);
        let safe = [NoiseModel::White, NoiseModel::BodyPose].contains(&weighed.choice.chosen);
        if let Some(solution) = weighed.solution.filter(|_| safe) {
            inside += covered(&case, &solution);
            count += 1.0;
        }
    }
    assert!(count >= 8.0, "{count}");
    assert!(inside >= 0.9 * count, "{inside} of {count}");
}

/// The cells of the comparison with plain least squares, which keeps every row and weighs all markers alike.
fn cell(truth: Truth, poses: usize, seeds: std::ops::Range<u64>) -> (f64, f64, f64) {
    let (mut chosen, mut plain, mut before) = (Vec::new(), Vec::new(), Vec::new());
    for seed in seeds {
        let case = Case::new(seed, poses, truth);
        let joint = case.solved(NoiseModel::Joint);
        let weighed = weighed(&joint);
        let white = case.handles.problem.with_noise_model(NoiseModel::White);
        let least_squares = solve(&white.unwrap(), &Settings::plain()).unwrap();
        before.push(held_out(&joint));
        plain.push(held_out(&least_squares));
        chosen.push(held_out(weighed.solution.as_ref().unwrap_or(&joint)));
    }
    (rms(&chosen), rms(&plain), rms(&before))
}

const TRUTHS: [Truth; 9] = [
    Truth::White,
    Truth::Joint(3.5e-4),
    Truth::Joint(7e-4),
    Truth::Wrist(2e-3),
    Truth::Eccentric(1e-3),
    Truth::Eccentric(5e-3),
    Truth::Sags(2e-3),
    Truth::Sags(1e-2),
    Truth::Backlash(2e-3),
];

#[test]
fn the_weights_are_never_worse_than_plain_least_squares() {
    if !skipped_tests::thorough() {
        return;
    }
    // 24 arms per cell: the standard error of a ratio is about 0.01.
    for truth in [
        Truth::Joint(7e-4),
        Truth::Eccentric(5e-3),
        Truth::Sags(1e-2),
        Truth::Backlash(2e-3),
    ] {
        let (chosen, plain, before) = cell(truth, 40, 1000..1024);
        println!(
            "{truth:?}: {:.3} and {:.3} of plain",
            chosen / plain,
            before / plain
        );
        assert!(
            chosen <= 1.03 * plain,
            "{truth:?}: {chosen} against {plain}"
        );
    }
}

#[test]
#[ignore = "study: nine truths by three sizes, 24 arms each, a minute"]
fn study_of_weights() {
    for truth in TRUTHS {
        for poses in [20, 40, 80] {
            let (chosen, plain, before) = cell(truth, poses, 1000..1024);
            println!(
                "{truth:?} {poses}: chosen {:.3}, plain {:.3}, joint noise {:.3} mm: {:.3} and {:.3} of plain",
                chosen * 1e3,
                plain * 1e3,
                before * 1e3,
                chosen / plain,
                before / plain
            );
        }
    }
}

/// Two bodies on the last link, the second with `ratio` times the noise of the first.
fn two_bodies(seed: u64, ratio: f64) -> Solution {
    Case::with_second(seed, 40, Truth::Joint(3.5e-4), Some(ratio)).solved(NoiseModel::Joint)
}

#[test]
fn a_body_that_is_seen_worse_has_its_own_noise() {
    let settings = Settings::default();
    let own = (0..4).filter(|seed| {
        let found = two_bodies(400 + seed, 5.0).with_levels_by_body(&settings);
        let Some(found) = found else { return false };
        let of = |name: &str| found.noise.iter().find(|n| n.name == name).map(|n| n.sigma);
        let (first, second) = (of("markers body").unwrap(), of("markers second").unwrap());
        // 480 coordinates each: 3 %.
        assert!((first / MARKER - 1.0).abs() < 0.15, "{first}");
        assert!((second / MARKER / 5.0 - 1.0).abs() < 0.15, "{second}");
        true
    });
    assert_eq!(own.count(), 4);
}

#[test]
fn bodies_that_are_seen_alike_share_their_noise() {
    let settings = Settings::default();
    let alike = |seed: &u64| two_bodies(500 + seed, 1.0).with_levels_by_body(&settings);
    let found = (0..4).filter_map(|seed| alike(&seed)).count();
    // Chance takes one of forty.
    assert!(found <= 1, "{found} of 4");
    let one = Case::new(1, 40, Truth::White).solved(NoiseModel::Joint);
    assert!(one.with_levels_by_body(&settings).is_none(), "one body");
}

#[test]
fn gross_errors_stay_out() {
    for seed in 0..6 {
        let mut case = Case::new(300 + seed, 40, Truth::Joint(3.5e-4));
        let mut r = rng(seed);
        for measurement in case.handles.problem.measurements_mut() {
            if let MeasurementKind::Markers(markers) = &mut measurement.kind {
                for o in markers.observations.iter_mut().step_by(17) {
                    o.position += crate::common::normal3(&mut r) * 0.02;
                }
            }
        }
        let joint = case.solved(NoiseModel::Joint);
        let choice = weighed(&joint).choice;
        let admission = choice.admission.expect("one of 17 was moved by 2 cm");
        assert_eq!(admission.readmitted, 0, "{admission:?}");
        assert_eq!(choice.chosen, NoiseModel::Joint);
    }
}

#[test]
fn what_another_fit_explains_takes_part_and_nothing_else_changes() {
    let case = Case::new(320, 40, Truth::Joint(3.5e-4));
    // Noise that the gate takes for gross errors, in the first of two statements only.
    let mut strict = Settings::default();
    strict.robust.gate = 0.8;
    let noise = case.handles.problem.with_noise_model(NoiseModel::Joint);
    let problem = noise.unwrap();
    let narrow = solve(&problem, &strict).unwrap();
    let all = Settings::default().with_robust(RobustSettings::off());
    let wide = solve(&problem, &all).unwrap();
    assert!(narrow.rejected.len() > 5, "{}", narrow.rejected.len());
    let both = narrow.with_kept_of(&wide, &strict).expect("more is kept");
    assert!(both.rejected.is_empty(), "{:?}", both.rejected);
    let apart = |a: &Solution, b: &Solution| {
        let pairs = a.parameters.iter().zip(&b.parameters);
        let off = pairs.map(|(a, b)| (a.value - b.value).abs() / b.sigma.unwrap_or(1.0));
        off.fold(0.0, f64::max)
    };
    assert!(apart(&both, &wide) < 1e-3, "{}", apart(&both, &wide));
    assert!(apart(&narrow, &wide) > 0.1, "{}", apart(&narrow, &wide));
    // Nothing more, and other observations.
    assert!(wide.with_kept_of(&narrow, &strict).is_none());
    let other = Case::new(320, 39, Truth::White).solved(NoiseModel::Joint);
    let fewer = Case::new(320, 30, Truth::White);
    let mut shorter = fewer.handles.problem.clone();
    for measurement in shorter.measurements_mut() {
        if let MeasurementKind::Markers(markers) = &mut measurement.kind {
            markers.observations.truncate(60);
        }
    }
    let shorter = solve(&shorter, &Settings::default()).unwrap();
    assert!(shorter.with_kept_of(&other, &strict).is_none());
}

/// What the tracker sees of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Seen {
    Markers(usize),
    Pose,
}

/// 50 poses, then 10 after the body was knocked by `shift` along its own x axis, then 30 held out as at first.
fn knocked(seed: u64, seen: Seen, shift: f64) -> Solution {
    let mut r = rng(seed);
    let one = seen == Seen::Markers(1);
    let free = Free {
        points: one,
        mount: if one {
            calib_core::Chart::none()
        } else {
            calib_core::Chart::full()
        },
        ..free()
    };
    let mut chain = Chain::nominal(six_r())
        .posed(&mut r, 90, 1.4)
        .deviate(&mut r, &free, 0.005, 0.001);
    if let Seen::Markers(count) = seen {
        chain.markers.truncate(count);
    }
    let mut h = chain.problem(&free, MARKER);
    h.problem.group_mut(h.markers).estimate = true;
    let joints = h
        .problem
        .noise_group("joint", NoiseKind::Joint, 1.7e-4, true);
    for j in &h.joints {
        h.problem.joint_noise(*j, joints);
    }
    match seen {
        Seen::Markers(_) => chain.observe(&mut r, &mut h, MARKER, 1.7e-4),
        Seen::Pose => chain.observe_poses(&mut r, &mut h, 5e-4, MARKER, 1.7e-4),
    }
    let is_after = |sample: usize| (50..60).contains(&sample);
    let moved = |sample: usize| {
        let body = chain.tracker_from_body(&chain.q[sample], &[0.0; 6]);
        body.rotation * nalgebra::Vector3::x() * shift
    };
    for measurement in h.problem.measurements_mut() {
        match &mut measurement.kind {
            MeasurementKind::Markers(markers) => {
                let after = markers.observations.iter_mut();
                after
                    .filter(|o| is_after(o.sample))
                    .for_each(|o| o.position += moved(o.sample));
            }
            MeasurementKind::Poses(poses) => {
                let after = poses.observations.iter_mut().filter(|o| is_after(o.sample));
                after.for_each(|o| o.pose.translation.vector += moved(o.sample));
            }
            _ => {}
        }
    }
    h.problem.held_out = (60..90).collect();
    let problem = h.problem.with_noise_model(NoiseModel::Joint).unwrap();
    solve(&problem, &Settings::default()).unwrap()
}

/// Poses after a knock predict each other: they gain by readmission, and all others would pay for it.
#[test]
fn a_knocked_body_stays_out() {
    for seen in [Seen::Markers(1), Seen::Markers(3), Seen::Pose] {
        for (seed, shift) in [(600, 0.04), (601, 0.004)] {
            let robust = knocked(seed, seen, shift);
            let weighed = weighed(&robust);
            let admission = weighed.choice.admission.expect("one in six is off");
            assert_eq!(admission.readmitted, 0, "{seen:?} {shift}: {admission:?}");
            let error = held_out(weighed.solution.as_ref().unwrap_or(&robust));
            assert!(error < 1e-3, "{seen:?} {shift}: {error}");
        }
    }
}
