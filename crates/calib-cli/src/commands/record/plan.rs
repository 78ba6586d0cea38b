//! What a capture session is asked for: columns, poses and bodies.

use calib_capture::{
    Guide, JointColumn, JointSource, Plan, Screen, Survey, Unit, Watched, grid, parse_joints,
};
use calib_pipeline::prepare::load::RobotProfile;
use calib_profile::{RecordingSpec, TimedPoses};
use calib_urdf::JointId;

use super::bodies::{joints_of, moved, watched};
use super::planned::Planned;
use super::rules::{NEAR, is_continuous};
use super::{Record, RecordError};

/// More poses than this are a typo in `--poses`: nobody records them.
const MOST_POSES: usize = 100_000;

/// Columns, poses and bodies.
pub(super) fn plan(
    robot: &RobotProfile,
    (spec, planned): (&RecordingSpec, Option<&Planned>),
    options: &Record,
    (joints, heard): (JointSource, &Survey),
    screen: &mut dyn Screen,
) -> Result<Plan, RecordError> {
    let (guided, ranges): (Vec<JointId>, Vec<(f64, f64)>) = match planned {
        // In the order in which a person reads them: along the chain.
        Some(planned) => {
            let ranges = planned.ranges();
            planned.joints.iter().map(|id| (*id, ranges[id])).unzip()
        }
        None => spec.ranges.iter().map(|(id, range)| (*id, *range)).unzip(),
    };
    let in_grid = if planned.is_some() { 0 } else { guided.len() };
    let poses = checked(options, in_grid)?;
    let continuous = is_continuous(spec);
    let guide = Guide {
        joints: (0..guided.len()).collect(),
        steps: if continuous || planned.is_some() {
            Vec::new()
        } else {
            grid(&ranges, poses)
        },
        ranges,
    };
    let named = |id: &JointId| {
        let joint = robot.model.joint(*id);
        column(&joint.name, joint.kind.turns(), None)
    };
    let swept = guided.iter().map(named).collect();
    let columns = columns(robot, spec, (swept, &options.at), heard, screen)?;
    let unheard: Vec<&str> = columns
        .iter()
        .filter(|c| c.fixed.is_none() && !heard.joints.contains(&c.name))
        .map(|c| c.name.as_str())
        .collect();
    if joints != JointSource::Targets && !unheard.is_empty() {
        screen.line(&format!(
            "not yet received from the robot: {}",
            unheard.join(", ")
        ));
    }
    let watched = watched(robot, &options.map, heard, screen)?;
    let moved = moved(robot, &guided.iter().copied().collect(), &watched);
    if moved.is_empty() && !guided.is_empty() {
        if let Some(planned) = planned {
            return Err(RecordError::PlanMovesNothing {
                plan: planned.name.clone(),
            });
        }
        screen.line(
            "The swept joints move none of the recorded bodies. Map one that they move (`--map`).",
        );
    }
    say_zero(&assumed_zero(robot, spec, &columns, &watched), screen);
    if let Some(poses) = guide.poses(&columns) {
        screen.line(&format!(
            "{poses}. Keys, each with Enter: none = the robot is at the pose; r = record the last pose again; s = skip the pose; k = count the pose though a body is hidden; q = stop."
        ));
    }
    say_short(spec, options.hold, screen);
    Ok(Plan {
        columns,
        joints,
        guide,
        watched,
        moved,
        continuous,
        hold: options.hold,
        near: NEAR,
        all: options.all,
        patience: options.patience,
        longest: options.seconds,
    })
}

/// Joints that move a recorded body, without a column and without a value in the profile: they are taken as 0.
pub(super) fn assumed_zero(
    robot: &RobotProfile,
    spec: &RecordingSpec,
    columns: &[JointColumn],
    watched: &[Watched],
) -> Vec<String> {
    // Where the robot writes a log of its own, its joints are there.
    if spec.robot_log.is_some() {
        return Vec::new();
    }
    let joints = joints_of(robot, watched).into_iter();
    let named = joints.filter(|id| !spec.hold.contains_key(id));
    let names = named.map(|id| robot.model.joint(id).name.clone());
    names
        .filter(|name| !columns.iter().any(|c| c.name == *name))
        .collect()
}

/// What is recorded must count as a hold afterwards.
fn say_short(spec: &RecordingSpec, hold: f64, screen: &mut dyn Screen) {
    let settles = spec
        .timing
        .as_ref()
        .filter(|t| t.poses == TimedPoses::Settle);
    if let Some(needed) = settles
        .map(|timing| timing.hold)
        .filter(|needed| hold < *needed)
    {
        screen.line(&format!(
            "warning: --hold {hold} s is shorter than the hold of {needed} s that the profile asks for: unless the tracker's clock runs faster, nothing of the file can be used. Record longer (--hold {}), or state a shorter `timing: {{hold_s: …}}`.",
            2.0 * needed
        ));
    }
}

fn say_zero(joints: &[String], screen: &mut dyn Screen) {
    if let Some(first) = joints.first() {
        screen.line(&format!(
            "taken as 0, because nobody sends them: {}. State those that stand elsewhere: --at {first}_deg=20",
            joints.join(", ")
        ));
    }
}

/// What can be said of the options before anything is heard.
pub(super) fn check_options(
    robot: &RobotProfile,
    spec: &RecordingSpec,
    options: &Record,
) -> Result<(), RecordError> {
    let guided = if options.plan.is_some() {
        0
    } else {
        spec.ranges.len()
    };
    checked(options, guided)?;
    parse_at(robot, &options.at)?;
    Ok(())
}

/// Values of each joint of a grid, and durations, that make sense.
fn checked(options: &Record, joints: usize) -> Result<usize, RecordError> {
    let poses = options.poses.unwrap_or(if joints == 1 { 11 } else { 6 });
    let count = poses.checked_pow(joints as u32).unwrap_or(usize::MAX);
    if poses == 0 || count > MOST_POSES {
        return Err(RecordError::Poses { poses, count });
    }
    for (option, value) in [
        ("--hold", options.hold),
        ("--patience", options.patience),
        ("--seconds", options.seconds.unwrap_or(1.0)),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(RecordError::Duration { option, value });
        }
    }
    Ok(poses)
}

/// Columns of the joints: swept ones, those held by `--at`, and those that the robot sends.
fn columns(
    robot: &RobotProfile,
    spec: &RecordingSpec,
    (swept, at): (Vec<JointColumn>, &[String]),
    heard: &Survey,
    screen: &mut dyn Screen,
) -> Result<Vec<JointColumn>, RecordError> {
    let mut columns = swept;
    let fixed = parse_at(robot, at)?;
    for (name, turns, value) in &fixed {
        if columns.iter().any(|c| c.name == *name) {
            return Err(RecordError::HoldsSwept {
                joint: name.clone(),
            });
        }
        columns.push(column(name, *turns, Some(*value)));
    }
    for name in &heard.joints {
        match robot.model.joint_id(name) {
            Ok(id) if !columns.iter().any(|c| c.name == *name) && !spec.hold.contains_key(&id) => {
                columns.push(column(name, robot.model.joint(id).kind.turns(), None));
            }
            Ok(_) => {}
            Err(unknown) => screen.line(&format!("not recorded: the robot sends {unknown}")),
        }
    }
    Ok(columns)
}

fn column(name: &str, turns: bool, fixed: Option<f64>) -> JointColumn {
    JointColumn {
        name: name.to_string(),
        unit: if turns { Unit::Angle } else { Unit::Length },
        fixed,
    }
}

/// `waist_deg=20` as (joint, turns, SI).
fn parse_at(robot: &RobotProfile, at: &[String]) -> Result<Vec<(String, bool, f64)>, RecordError> {
    let mut fixed = Vec::new();
    for text in at {
        let joints = parse_joints(text.as_bytes()).map_err(RecordError::At)?;
        for (name, value) in joints {
            let id = robot.model.joint_id(&name)?;
            let turns = robot.model.joint(id).kind.turns();
            let unit = text.split('=').next().unwrap_or("");
            if turns != (unit.ends_with("_deg") || unit.ends_with("_rad")) {
                return Err(RecordError::JointUnit {
                    given: text.clone(),
                    kind: robot.model.joint(id).kind.name(),
                    joint: name,
                });
            }
            fixed.push((name, turns, value));
        }
    }
    Ok(fixed)
}
