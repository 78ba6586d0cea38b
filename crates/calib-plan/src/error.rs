//! Why there is no plan.

use calib_finding::{number, shell_path};
use calib_pipeline::{ExitCode, PipelineError};

use crate::candidates::Counts;
use crate::words;

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// The profile, the robot or its recordings.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// No posture of the joint ranges is possible.
    #[error("{file}: none of {} postures is possible: {}\n  help: {}", counts.tried, words::removed(counts), words::most_removing(counts))]
    NoPosture {
        /// The profile.
        file: String,
        /// What removed how many.
        counts: Box<Counts>,
    },
    /// Fewer postures are possible than were asked for.
    #[error("{file}: {} of {} postures are possible, {asked} are asked for: {}\n  help: {}", counts.feasible, counts.tried, words::removed(counts), words::most_removing(counts))]
    TooFew {
        /// The profile.
        file: String,
        /// Postures that were asked for, held-out ones among them.
        asked: usize,
        /// What removed how many.
        counts: Box<Counts>,
    },
    /// A joint slides without limits.
    #[error(
        "{file}: joint `{joint}` slides and has no limits\n  help: give its range: `plan: {{joints: {{{joint}_mm: [0, 500]}}}}`"
    )]
    NoRange {
        /// The profile.
        file: String,
        /// The joint.
        joint: String,
    },
    /// Limits of a joint are probably in degrees.
    #[error(
        "{file}: the limits of joint `{joint}` in the URDF are {}: probably degrees, where a URDF has radians\n  help: correct the URDF, or state the range: `plan: {{joints: {{{joint}_deg: [-170, 170]}}}}`",
        words::many_turns(*low, *high)
    )]
    InDegrees {
        /// The profile.
        file: String,
        /// The joint.
        joint: String,
        /// Lower limit as the URDF has it, rad.
        low: f64,
        /// Upper limit as the URDF has it, rad.
        high: f64,
    },
    /// No joint that carries a body can move.
    #[error(
        "{file}: no joint that carries a body can move: {}\n  help: {}",
        words::standing(held, fixed),
        words::to_move(fixed)
    )]
    NothingMoves {
        /// The profile.
        file: String,
        /// Joints that `plan.hold` holds, or that stood still in all recordings.
        held: Vec<String>,
        /// Joints whose limits leave no range.
        fixed: Vec<String>,
    },
    /// Parameters are named for a goal that is none of parameters.
    #[error(
        "{file}: `--of` names parameters, `--goal task` is the position of the tool\n  help: use `--goal parameters`, `--goal variances` or `--goal weakest`, or leave out `--of`"
    )]
    OfWithoutParameters {
        /// The profile.
        file: String,
    },
    /// No free parameter has the name that was asked for.
    #[error(
        "{file}: `--of {part}` names no free parameter{}\n  help: give a part of one of their names: {}", words::nearest(nearest.as_deref()), words::some_of(known, 8)
    )]
    NoSuchParameter {
        /// The profile.
        file: String,
        /// What was asked for.
        part: String,
        /// The nearest name, or part of a name between points.
        nearest: Option<String>,
        /// All free parameters.
        known: Vec<String>,
    },
    /// Cameras are given in a frame of which nobody knows where it is.
    #[error(
        "{file}: the cameras are given in the frame of the tracker, and it is not known where the robot stands in it\n  help: give `tracker: {{from_root: …}}`, or record some postures first"
    )]
    NoPlace {
        /// The profile.
        file: String,
    },
    /// A posture of the task list cannot be taken.
    #[error(
        "{file}, row {row}: joint `{joint}` is asked to be at {found}, its range is {range}\n  help: give postures inside the joint ranges, or widen `plan.joints`"
    )]
    OutOfReach {
        /// The list.
        file: String,
        /// Row from 1.
        row: usize,
        /// The joint.
        joint: String,
        /// Where it is asked to be.
        found: String,
        /// Where it can be.
        range: String,
    },
    /// The task box is not reached.
    #[error(
        "{file}: {found} of {tried} postures bring the tool into `plan.task_box_mm`\n  help: the box is in the frame of the robot's root, mm; the tool reaches {reach}"
    )]
    BoxOutOfReach {
        /// The profile.
        file: String,
        /// Postures in the box.
        found: usize,
        /// Postures tried.
        tried: usize,
        /// What the tool reaches.
        reach: String,
    },
    /// Joints of a list are not joints of this robot.
    #[error(
        "{file}: {why}\n  help: give a table of joint positions of this robot, `<joint>_deg` in the header"
    )]
    NotJoints {
        /// The list.
        file: String,
        /// Why.
        why: String,
    },
    /// A table of places is none.
    #[error(
        "{file}: {why}\n  help: give joint positions, `<joint>_deg` in the header, or the places of one link, body or marker in the frame of the robot's root: `flange.x_m,flange.y_m,flange.z_m`"
    )]
    NotPlaces {
        /// The list.
        file: String,
        /// Why.
        why: String,
    },
    /// A place of the task has no posture.
    #[error("{file}, row {row}: {}", words::no_posture(*nearest_mm, *nearest_deg, *starts, *oriented, *touching))]
    PlaceOutOfReach {
        /// The list.
        file: String,
        /// Row from 1.
        row: usize,
        /// How near the tool comes, mm; for the least sum of squares with the angle, a radian as 300 mm.
        nearest_mm: f64,
        /// Angle between the orientations there, deg; 0 where none is asked for.
        nearest_deg: f64,
        /// Searches from other postures.
        starts: usize,
        /// Whether an orientation is asked for.
        oriented: bool,
        /// Whether there are postures that touch something.
        touching: bool,
    },
    /// A file is no plan of this robot.
    #[error("{file}: {why}\n  help: give the `plan.yaml` that `calib plan` wrote for this robot")]
    NotAPlan {
        /// The file.
        file: String,
        /// Why.
        why: String,
    },
    /// A plan was made for another robot.
    #[error(
        "{file}: the plan is for `{planned}`, {profile} describes `{robot}`\n  help: give the plan of this robot: `calib plan {}`",
        shell_path(profile)
    )]
    OtherRobot {
        /// The plan.
        file: String,
        /// Its robot.
        planned: String,
        /// The profile.
        profile: String,
        /// The profile's robot.
        robot: String,
    },
    /// A profile has no recording for the postures of a plan.
    #[error(
        "{profile}: no recording has `use: static` or `use: validation`, where the postures of a plan belong\n  help: add one: `recordings: {{poses: {{file: poses.csv, use: static}}}}`"
    )]
    NoRecording {
        /// The profile.
        profile: String,
    },
    /// Postures of a plan are outside the ranges that hold now.
    #[error(
        "{file}: a posture is outside the range that joint `{joint}` has now\n  help: plan again: `calib plan {}`",
        shell_path(profile)
    )]
    OutsideRanges {
        /// The plan.
        file: String,
        /// The profile.
        profile: String,
        /// The joint.
        joint: String,
    },
    /// Postures of a plan are not possible now.
    #[error(
        "{file}: {} of {} postures are no longer possible: {}\n  help: plan again: `calib plan {}`", counts.tried - counts.feasible, counts.tried, words::removed(counts), shell_path(profile)
    )]
    Impossible {
        /// The plan.
        file: String,
        /// The profile.
        profile: String,
        /// What removed how many.
        counts: Box<Counts>,
    },
    /// A plan was made of something else than is there now.
    #[error(
        "{file}: when the plan was made: {}; now: {}. The profile, the robot or the recordings have changed since\n  help: plan again: `calib plan {}`. Where the recording itself was part of the plan, record into another file with `--out`.", words::sigmas(*then), words::sigmas(*now), shell_path(profile)
    )]
    Outdated {
        /// The plan.
        file: String,
        /// The profile.
        profile: String,
        /// σ before and after its postures that the plan states, m; `None`: not determined.
        then: [Option<f64>; 2],
        /// The same now, m.
        now: [Option<f64>; 2],
    },
    /// The σ that was asked for is not reached.
    #[error(
        "{file}: σ of {asked} is not reached with {most} postures: {reached}\n  help: {}ask for a larger σ, reduce the tracker's noise, or move markers further apart (`calib plan --poses {most}` shows what remains)",
        needed.map_or_else(String::new, |n| format!("record about {n} postures (`calib plan --poses {n}`), "))
    )]
    NotReached {
        /// The profile.
        file: String,
        /// Asked for.
        asked: String,
        /// Most postures that were tried.
        most: usize,
        /// What they reach.
        reached: String,
        /// How many would reach it, where so many can be chosen.
        needed: Option<usize>,
    },
    /// The motions of the shortest plan take longer than they may.
    #[error(
        "{file}: the motions between {fewest} postures take {} s, {} s are asked for\n  help: allow more time, or make the ranges of `plan.joints` smaller", number::fixed(*least, 1), number::fixed(*asked, 1)
    )]
    TooLong {
        /// The profile.
        file: String,
        /// Time that they may take, s.
        asked: f64,
        /// Postures of the shortest plan.
        fewest: usize,
        /// Time that they take, s.
        least: f64,
    },
    /// The σ that was asked for is not reached in the time that the motions may take.
    #[error(
        "{file}: σ of {asked} is not reached in {} s of motion: {postures} postures fit, and reach {reached}\n  help: allow more time, or a larger σ", number::fixed(*most_s, 1)
    )]
    NotReachedInTime {
        /// The profile.
        file: String,
        /// Asked for.
        asked: String,
        /// Time that the motions may take, s.
        most_s: f64,
        /// Postures that fit.
        postures: usize,
        /// What they reach.
        reached: String,
    },
    /// A posture of the profile's robot tells nothing.
    #[error(
        "{file}: nothing is free, so no posture tells anything\n  help: name what is to be found under `solve.free`"
    )]
    NothingFree {
        /// The profile.
        file: String,
    },
    /// A plan cannot be written or read.
    #[error("{file}: {why}\n  help: {help}")]
    Table {
        /// The file.
        file: String,
        /// Why.
        why: String,
        /// What to do.
        help: &'static str,
    },
}

impl PlanError {
    /// The file that it is about; `None`: the error of the pipeline knows.
    #[must_use]
    pub fn file(&self) -> Option<&str> {
        match self {
            Self::Pipeline(_) => None,
            Self::NoPosture { file, .. }
            | Self::TooFew { file, .. }
            | Self::NoRange { file, .. }
            | Self::InDegrees { file, .. }
            | Self::NothingMoves { file, .. }
            | Self::NoSuchParameter { file, .. }
            | Self::OfWithoutParameters { file }
            | Self::NoRecording { profile: file }
            | Self::NoPlace { file }
            | Self::OutOfReach { file, .. }
            | Self::BoxOutOfReach { file, .. }
            | Self::NotJoints { file, .. }
            | Self::NotPlaces { file, .. }
            | Self::PlaceOutOfReach { file, .. }
            | Self::NotAPlan { file, .. }
            | Self::OtherRobot { file, .. }
            | Self::OutsideRanges { file, .. }
            | Self::Impossible { file, .. }
            | Self::Outdated { file, .. }
            | Self::NotReached { file, .. }
            | Self::NotReachedInTime { file, .. }
            | Self::TooLong { file, .. }
            | Self::NothingFree { file }
            | Self::Table { file, .. } => Some(file),
        }
    }

    /// The exit code of the program.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Pipeline(error) => error.exit_code(),
            Self::NotReached { .. } | Self::NotReachedInTime { .. } => ExitCode::VerdictFail,
            Self::OutOfReach { .. }
            | Self::NotJoints { .. }
            | Self::NotPlaces { .. }
            | Self::PlaceOutOfReach { .. }
            | Self::NotAPlan { .. }
            | Self::OtherRobot { .. }
            | Self::OutsideRanges { .. }
            | Self::Impossible { .. }
            | Self::Outdated { .. } => ExitCode::Data,
            Self::Table { .. } => ExitCode::NotWritten,
            _ => ExitCode::Usage,
        }
    }
}
