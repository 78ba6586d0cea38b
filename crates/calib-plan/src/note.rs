//! What a plan assumed, and what it could not look at: facts; [`crate::words`] makes the sentences.

use serde::Serialize;

/// Where the noise of the joints is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum JointNoiseOf {
    /// Recordings that exist show it.
    Recordings,
    /// The profile's `solve` section states it.
    Solve,
    /// The profile's `simulate` section states it.
    Simulation,
    /// Nothing tells it.
    Program,
}

/// One assumption or limit of a plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "id", rename_all = "snake_case")]
pub enum Note {
    /// Recordings of the profile whose files do not exist.
    NotRecordedYet {
        /// Their names.
        recordings: Vec<String>,
    },
    /// Recordings exist but could not be fitted: nothing was taken from them.
    RecordingsUnused {
        /// Why.
        why: String,
    },
    /// Mounts, markers and the robot's place are those of the profile's `simulate` section.
    FromSimulation,
    /// Where a body is mounted is not known: at the origin of its link.
    MountAssumed {
        /// The body.
        body: String,
    },
    /// Where the markers of a body are is not known: a layout of usual size.
    LayoutAssumed {
        /// The body.
        body: String,
    },
    /// The tracker's noise is not stated.
    NoiseAssumed,
    /// The noise of the joints.
    JointNoise {
        /// σ of a reading, rad.
        sigma: f64,
        /// Where it is taken from.
        of: JointNoiseOf,
    },
    /// Joints that stood still in all recordings stand still in the plan.
    JointsStill {
        /// Their names.
        joints: Vec<String>,
    },
    /// Links that move and have no shape: collisions with them are not found.
    NoShape {
        /// Their names.
        links: Vec<String>,
    },
    /// Ground or keep-outs are stated, and links that move have no shape to compare with them.
    SurroundingsUnchecked {
        /// What is stated: keys of `plan`.
        stated: Vec<String>,
        /// The links that have none in the URDF.
        links: Vec<String>,
        /// Those of which one could not be read, with the file of the shape.
        unread: Vec<(String, Option<String>)>,
    },
    /// Links that no planned joint moves touch what is stated in every posture: they are not compared with it.
    StandsThere {
        /// What is stated: keys of `plan`.
        stated: Vec<String>,
        /// The links.
        links: Vec<String>,
    },
    /// Joints whose limits leave no range: they do not move in the plan.
    NoRoom {
        /// Their names.
        joints: Vec<String>,
    },
    /// Joints whose stated range is wider than the limits of a joint that follows them allow.
    NarrowedByFollower {
        /// Each with a joint that follows it.
        joints: Vec<[String; 2]>,
    },
    /// Shapes that could not be read.
    ShapeUnread {
        /// Their links and files.
        shapes: Vec<(String, Option<String>)>,
    },
    /// Pairs of links that touch in nearly all postures by the size of their capsules: not compared.
    PairsNotCompared {
        /// The first link of each and the second.
        pairs: Vec<[String; 2]>,
    },
    /// Pairs of links with one part between them that are nearer than the clearance in nearly all postures: they are kept from touching only.
    PairsAlwaysClose {
        /// The first link of each and the second.
        pairs: Vec<[String; 2]>,
    },
    /// No cameras are stated: every marker counts as seen.
    EverythingSeen,
    /// Sides that markers face were stated, but no cameras.
    FacingUnused,
    /// Motions that touch something whichever way they are taken.
    NoClearMotion {
        /// Numbers in `plan.csv` of the postures at their ends.
        to: Vec<usize>,
    },
    /// Fewer postures from both sides than planned: the way to them is blocked.
    FewerPairs {
        /// How many were planned.
        planned: usize,
        /// How many there are.
        found: usize,
    },
    /// Fewer postures than asked for: the time of all motions allows no more.
    PathTime {
        /// How many were asked for.
        asked: usize,
        /// How many there are.
        found: usize,
        /// Time that they were to take at the most, whole seconds.
        most_s: u64,
    },
    /// The task depends on something that neither plan nor prior determines.
    TaskOpen,
}
