//! Whether a run takes the noise that the cameras of a profile cause, where it is so and where it is not.

use std::collections::BTreeMap;

use calib_core::{Settings, SolveStatus};
use calib_finding::{Severity, catalog};
use calib_pipeline::estimated::{Estimated, estimated};
use calib_pipeline::formulate::cameras::{Outcome, outcome};
use calib_pipeline::formulate::formulation::MlFit;
use calib_pipeline::options::{Plugins, RunOptions};
use calib_pipeline::prepare::inputs::RobotProfile;
use calib_pipeline::prepare::load::of_tables;
use calib_recording::Poses;

use crate::reached::CAMERAS;
use crate::robots::{SIX, Seen, robot};

/// An arm whose noise the fit finds, with that many postures.
fn arm(markers: usize, poses: usize, extra: &str) -> RobotProfile {
    let mut robot = robot(SIX, Seen::Markers(markers), false, extra);
    robot.profile.solve.noise.known = false;
    let section = robot.profile.simulate.as_mut().expect("simulated");
    let recording = section.recordings.get_mut("poses").expect("there");
    recording.poses = poses;
    for (name, low, high) in [
        ("j1", -1.0, 1.0),
        ("j2", -1.0, 1.2),
        ("j3", -1.2, 1.0),
        ("j4", -2.0, 2.0),
        ("j5", -1.5, 1.5),
        ("j6", -2.5, 2.5),
    ] {
        let id = robot.model.joint_id(name).expect("there");
        recording.random.insert(id, (low, high));
    }
    robot
}

fn recorded(robot: &RobotProfile, seed: u64) -> BTreeMap<String, Poses> {
    let simulated = calib_sim::simulate(&robot.profile, &robot.model, Some(seed));
    simulated.unwrap_or_else(|e| panic!("{e}")).recordings
}

fn run(robot: &RobotProfile, tables: BTreeMap<String, Poses>) -> Estimated {
    let inputs = of_tables(robot.clone(), tables, Plugins::Refused);
    let inputs = inputs.unwrap_or_else(|e| panic!("{e}"));
    let options = RunOptions::default();
    let found = estimated(inputs, Vec::new(), &options, None, &mut |_| {});
    found.unwrap_or_else(|e| panic!("{e}"))
}

const TAKEN: Option<Severity> = Some(Severity::Info);
const DOUBTED: Option<Severity> = Some(Severity::Warning);

/// What was said of the cameras.
fn of_cameras(found: &Estimated) -> Option<Severity> {
    let mut findings = found.checked.findings.iter();
    let finding = findings.find(|f| f.id == catalog::CAMERA_NOISE);
    finding.map(|f| f.severity)
}

/// Parameters that a fit found, by name.
fn parameters(found: &Estimated) -> BTreeMap<String, f64> {
    let fit = found.solved.fit.as_ref().expect("a fit");
    let all = fit.solution.parameters.iter();
    all.map(|p| (p.name.clone(), p.value)).collect()
}

const DESIGNS: [(usize, usize); 4] = [(1, 60), (2, 40), (4, 24), (4, 60)];

#[test]
fn noise_of_cameras_is_taken_where_they_cause_it() {
    for (markers, poses) in DESIGNS {
        let arm = arm(markers, poses, CAMERAS);
        for seed in 1..4 {
            let found = run(&arm, recorded(&arm, seed));
            assert_eq!(
                of_cameras(&found),
                TAKEN,
                "{markers} markers, {poses} poses, seed {seed}"
            );
        }
    }
}

/// The same places of cameras, and a tracker whose noise is equal in all directions: the result is that of a profile without cameras.
#[test]
fn stated_cameras_do_not_bend_equal_noise() {
    for (markers, poses) in DESIGNS {
        let (with, without) = (arm(markers, poses, CAMERAS), arm(markers, poses, ""));
        for seed in 1..4 {
            let tables = recorded(&without, seed);
            let found = run(&with, tables.clone());
            assert_eq!(
                of_cameras(&found),
                DOUBTED,
                "{markers} markers, {poses} poses, seed {seed}"
            );
            let equal = run(&without, tables);
            assert_eq!(of_cameras(&equal), None);
            assert_eq!(parameters(&found), parameters(&equal));
        }
    }
}

/// Cameras all around see every direction alike: nothing is said.
#[test]
fn cameras_all_around_are_no_finding() {
    let around = "plan:\n  cameras:\n    \
        a: {at_mm: [900, 300, 9000], toward_mm: [900, 300, 600], field_deg: 70}\n    \
        b: {at_mm: [9300, 300, 600], toward_mm: [900, 300, 600], field_deg: 70}\n    \
        c: {at_mm: [900, 8700, 600], toward_mm: [900, 300, 600], field_deg: 70}\n";
    let arm = arm(4, 24, around);
    let found = run(&arm, recorded(&arm, 1));
    assert_eq!(of_cameras(&found), None);
}

/// Two cameras nearly in one place see no depth: the run has the result of equal noise, and says so.
#[test]
fn cameras_in_one_place_do_not_bend_a_run() {
    for apart_mm in [1.0, 1e-4, 1e-7] {
        let near = format!(
            "plan:\n  cameras:\n    \
            a: {{at_mm: [4900, 300, 900], toward_mm: [900, 300, 600], field_deg: 70}}\n    \
            b: {{at_mm: [4900, {}, 900], toward_mm: [900, 300, 600], field_deg: 70}}\n",
            300.0 + apart_mm
        );
        let (with, without) = (arm(4, 24, &near), arm(4, 24, ""));
        let tables = recorded(&without, 1);
        let found = run(&with, tables.clone());
        assert_eq!(of_cameras(&found), DOUBTED, "{apart_mm} mm");
        assert_eq!(parameters(&found), parameters(&run(&without, tables)));
    }
}

/// A fit with the cameras that is none, or has not converged, does not stand before one with equal noise that has.
#[test]
fn a_fit_that_did_not_converge_is_not_taken_for_its_cameras() {
    let arm = arm(4, 24, "");
    let found = run(&arm, recorded(&arm, 1));
    let equal = found.solved.fit.expect("a fit");
    let settings = Settings::default();
    let of = |with: Option<&MlFit>, equal: &MlFit| outcome(with, equal, &settings);
    assert_eq!(of(Some(&equal), &equal), Outcome::Taken);
    assert_eq!(of(None, &equal), Outcome::NoFit);
    let mut other = equal.clone();
    other.solution.status = SolveStatus::MaxIterations;
    assert_eq!(of(Some(&other), &equal), Outcome::NoFit);
    assert_eq!(of(Some(&other), &other), Outcome::Taken);
}
