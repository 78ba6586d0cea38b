//! What was found, as data. [`words`](crate::words) makes the sentences.

mod guess;
mod how;
mod place;
mod turns;

use calib_recording::{AngleUnit, LengthUnit, TimeUnit};
use serde::Serialize;

use crate::mistake::Mistake;

pub use how::{AngleHow, LengthHow};
pub use place::Place;
pub use turns::{Notation, TurnsHow};

/// Residuals of the registration of all recordings to the nominal robot, rms, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Residuals {
    /// Of the recordings as they are.
    pub none: f64,
    /// After the correction.
    pub best: f64,
    /// After the best other correction.
    pub next: Option<f64>,
    /// What errors of a nominal robot explain, where more is left.
    pub over: Option<f64>,
}

/// A joint that may count the other way.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Reversed {
    /// Its name.
    pub joint: String,
    /// Its column.
    pub column: String,
    /// Whether it turns.
    pub turns: bool,
}

/// Another link, and how much worse it explains a body's motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rival {
    /// The link.
    pub link: String,
    /// Its residual, rms, m.
    pub rms: f64,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "fact")]
#[non_exhaustive]
pub enum About {
    /// Joints of the URDF.
    Joints {
        /// Those that move on their own.
        moving: usize,
        /// Those of them without position limits.
        unlimited: Vec<String>,
        /// Those of them whose lower limit is above the upper one.
        reversed: Vec<String>,
        /// Those of them that turn without end.
        endless: Vec<String>,
        /// Those of them whose limits leave no range.
        no_range: Vec<String>,
        /// Those of them whose limits are probably in degrees.
        in_degrees: Vec<String>,
    },
    /// The robot is larger than robots are: its lengths are probably not in meters.
    TooLarge {
        /// Its reach, m.
        reach: f64,
    },
    /// The body is put on the end of a chain, since nothing was recorded.
    TipOfChain {
        /// The link.
        link: String,
        /// Joints that carry it.
        joints: usize,
        /// Ends of other chains.
        others: Vec<String>,
    },
    /// The caller named the link.
    LinkStated {
        /// The link.
        link: String,
        /// Its residual, rms, m; `None` without recordings.
        rms: Option<f64>,
        /// A link that explains the motion better by more than the engine's ratio.
        better: Option<Rival>,
    },
    /// The profile that is edited names the link.
    LinkOfProfile {
        /// The link.
        link: String,
        /// Its residual, rms, m; `None` where no row shows the body with joints.
        rms: Option<f64>,
        /// A link that explains the motion better by more than the engine's ratio.
        better: Option<Rival>,
    },
    /// The link that explains a body's motion.
    Link {
        /// The link.
        link: String,
        /// Residual of its registration alone, rms, m.
        rms: f64,
        /// The next best.
        next: Option<Rival>,
        /// Links that these recordings do not distinguish from it.
        same: Vec<String>,
    },
    /// Nothing shows which link carries the body: the last one that recorded joints move is taken.
    LinkUnknown {
        /// The link.
        link: String,
    },
    /// Joints whose values change while no body moves with them.
    Unfollowed {
        /// Their names, root first.
        joints: Vec<String>,
        /// A body that may be mounted beyond one of them, if that joint stood still.
        body: Option<String>,
    },
    /// Nothing that the recordings moved carries the body.
    Still {
        /// The link.
        link: String,
        /// Residual, rms, m.
        rms: f64,
    },
    /// Columns that have the joints' names.
    JointsByName {
        /// How many.
        count: usize,
    },
    /// Numbered columns, paired with the joints of a chain in its order.
    JointsByOrder {
        /// Joint and column.
        pairs: Vec<(String, String)>,
    },
    /// Joints that carry a body and have no column: taken to stand at 0.
    JointsMissing {
        /// Their names.
        joints: Vec<String>,
    },
    /// A joint that carries a body, has no column and cannot stand at 0: taken to stand at the end of its range that is nearest to it.
    JointAtItsLimit {
        /// Its name.
        joint: String,
        /// Where, rad or m.
        at: f64,
        /// Whether it turns.
        turns: bool,
    },
    /// The unit of the angles.
    Angles {
        /// The unit.
        unit: AngleUnit,
        /// How it was found.
        how: AngleHow,
    },
    /// The unit of the lengths.
    Lengths {
        /// The unit.
        unit: LengthUnit,
        /// How it was found.
        how: LengthHow,
    },
    /// The column of time.
    Time {
        /// The column.
        column: String,
        /// Its unit.
        unit: TimeUnit,
        /// The name says the unit.
        named: bool,
    },
    /// The orientation of tracked bodies.
    Turns {
        /// Their columns.
        columns: Vec<String>,
        /// What they are read as.
        notation: Notation,
        /// The unit of angles; `None` for quaternions.
        unit: Option<AngleUnit>,
        /// How that was found.
        how: TurnsHow,
    },
    /// Columns that nothing uses.
    Ignored {
        /// Their names.
        columns: Vec<String>,
        /// Those that seem to be an orientation.
        orientation: Vec<String>,
        /// Those that are named like joints.
        joints: Vec<String>,
        /// The one that seems to hold times as text.
        times: Option<String>,
        /// Those that hold whole seconds and the parts of a second.
        parts: Option<(String, String)>,
    },
    /// A marker that repeats another one in every row: left out.
    Duplicate {
        /// The marker.
        marker: String,
        /// The one that it repeats.
        of: String,
    },
    /// A tracked pose that was computed from markers which are recorded too: left out.
    PoseOfMarkers {
        /// The tracked body.
        body: String,
    },
    /// A body that fits the nominal robot closer than the tracker lets any measured body: left out.
    Computed {
        /// Its name.
        body: String,
        /// Its markers; empty: a pose.
        markers: Vec<String>,
        /// The columns of the markers.
        columns: Vec<String>,
        /// The body that fits worst.
        other: String,
        /// Residuals of the two, rms, m.
        rms: [f64; 2],
    },
    /// Markers that are seen in too few rows: left out.
    Seldom {
        /// Their names.
        markers: Vec<String>,
    },
    /// Markers that keep their distances are one body.
    Rigid {
        /// How many.
        markers: usize,
        /// Standard deviation of one coordinate about the body, m; `None` where nothing tells it.
        sigma: Option<f64>,
    },
    /// Labels of markers that were exchanged in single rows: a run puts them right by the distances.
    LabelsExchanged {
        /// The markers.
        markers: Vec<String>,
        /// Rows, of those that are looked at.
        rows: usize,
    },
    /// Markers of one body that do not span a frame: only two of them are used.
    Flat {
        /// Markers that are not used.
        left_out: Vec<String>,
    },
    /// A single marker, or two: points.
    Points {
        /// How many.
        markers: usize,
    },
    /// A tracked body with six degrees of freedom.
    Pose,
    /// Noise of a marker coordinate, from what markers of one body do to their distances.
    MarkerSigma {
        /// m.
        sigma: f64,
        /// Rows that tell it.
        rows: usize,
    },
    /// Noise of a body that never moved.
    BodySigma {
        /// Of a coordinate, m.
        position: f64,
        /// About an axis, rad.
        orientation: f64,
    },
    /// The markers were calculated from a body: their distances do not show the noise.
    Calculated,
    /// Nothing shows the noise before a fit.
    SigmaUnknown,
    /// A recording that moves one or two joints.
    Sweep {
        /// Their names.
        joints: Vec<String>,
        /// Poses.
        rows: usize,
    },
    /// Any other recording.
    Static {
        /// Poses.
        rows: usize,
        /// Joints that move.
        moved: usize,
    },
    /// Held out because of its name.
    ValidationByName {
        /// The word in it.
        word: &'static str,
        /// Poses.
        rows: usize,
    },
    /// Held out because it is the smallest of several.
    ValidationSmallest {
        /// Poses.
        rows: usize,
    },
    /// No recording is held out: every pose is left out in turn.
    LeftOutInTurn,
    /// A stream in which the robot stood still now and then.
    Holds {
        /// How often.
        holds: usize,
    },
    /// A stream of a motion.
    Continuous,
    /// The robot's own log, with a clock of its own.
    Log {
        /// The file.
        file: String,
        /// It is the only one, or shares most words with the name of the tracker's file; else paired by order.
        named: bool,
        /// How many rows both files have, one for every posture; `None`: two clocks.
        rows: Option<usize>,
    },
    /// A mistake in the recordings that the profile corrects.
    Corrected {
        /// What is wrong.
        mistake: Mistake,
        /// What it explains.
        residuals: Residuals,
        /// Other mistakes that these recordings do not distinguish from it.
        equivalent: Vec<Vec<Mistake>>,
    },
    /// A mistake in the recordings that no profile can correct.
    NotCorrected {
        /// What is wrong.
        mistake: Mistake,
        /// What it explains.
        residuals: Residuals,
        /// Corrections that the recordings do not distinguish from it.
        equivalent: Vec<Vec<Mistake>>,
    },
    /// Joints that count the other way, or a left-handed tracker: a robot that is symmetric about a plane moves the same with either, so nothing is
    /// corrected.
    SignOrMirror {
        /// The joints, each with its column.
        joints: Vec<Reversed>,
        /// The same as mistakes.
        mistakes: Vec<Mistake>,
        /// What either explains.
        residuals: Residuals,
        /// The left-handed tracker, and what else these recordings do not distinguish.
        equivalent: Vec<Vec<Mistake>>,
    },
    /// No mistake stands out: signs, order, units and links agree with the robot.
    Agrees {
        /// Residual of the registration to the nominal robot, rms, m.
        rms: f64,
        /// Poses.
        rows: usize,
        /// Those of them that do not.
        not: usize,
        /// After the corrections that stand beside it.
        corrected: bool,
    },
    /// A number stands for lost samples of markers.
    LostByNumber {
        /// The number, m.
        value: f64,
        /// Its samples.
        samples: usize,
    },
    /// The clocks are further apart than a profile looks for by itself.
    FarClocks {
        /// Tracker's clock from the robot's, s.
        offset: f64,
        /// How far the profile looks for it, s.
        searched: f64,
    },
    /// Too few poses to test order, signs and units.
    TooFew {
        /// Poses.
        rows: usize,
    },
    /// The recordings disagree with the robot, and no single mistake explains it.
    Disagrees {
        /// Residual, rms, m.
        rms: f64,
        /// What errors of a nominal robot explain, m.
        limit: f64,
    },
    /// A recording that the edited profile has already, and that can be read.
    Listed,
    /// The file of a recording of the edited profile took the place of one that does not exist.
    Replaced {
        /// The file that does not exist.
        file: String,
    },
    /// The file of a recording of the edited profile does not exist.
    Absent {
        /// The file.
        file: String,
    },
    /// No recording that was given shows a body of the edited profile.
    NotSeen {
        /// Its markers; empty: a tracked pose.
        markers: Vec<String>,
        /// Nor any other body of it.
        none_is: bool,
    },
    /// Markers that keep their distances from those of a body of the edited profile, which does not have them.
    MoreMarkers {
        /// Their names.
        markers: Vec<String>,
    },
    /// The use that the edited profile states for a recording whose file took the place of another does not fit the file.
    OtherUse {
        /// Joints that move in the file.
        moved: usize,
        /// Poses.
        rows: usize,
    },
    /// A link was named for new bodies, and none is new.
    NoNewBody {
        /// The link.
        link: String,
    },
    /// A joint without a column stands where other recordings of the edited profile hold it.
    HeldAsElsewhere {
        /// Its name.
        joint: String,
        /// Where, rad or m.
        at: f64,
        /// Whether it turns.
        turns: bool,
    },
    /// Noise of bodies that the edited profile states, and what the recordings show: of a coordinate, m, and about an axis, rad.
    StatedBodySigma {
        /// As stated.
        stated: (f64, f64),
        /// As shown by a body that stands still.
        shown: (f64, f64),
    },
    /// The mount of a new body in the simulation of the edited profile is invented.
    InventedMount,
    /// Noise of a marker coordinate that the edited profile states, and what the recordings show.
    StatedSigma {
        /// m.
        stated: f64,
        /// m.
        shown: f64,
    },
    /// Limits from the noise.
    Limits {
        /// Noise of a coordinate, m.
        sigma: f64,
    },
    /// No limits: the noise is not known.
    NoLimits,
    /// What is simulated and planned is invented.
    Invented,
}

/// A fact, where it belongs, and whether a person must look at it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fact {
    /// The part of the profile.
    pub place: Place,
    /// What was found.
    #[serde(flatten)]
    pub about: About,
    /// It was guessed.
    pub check: bool,
}

/// How many times worse the next best explanation must be before a guess counts as certain.
pub const CERTAIN: f64 = 2.0;

impl Fact {
    /// A fact with the certainty that its values give it.
    #[must_use]
    pub fn new(place: Place, about: About) -> Self {
        let check = guess::is_guess(&about);
        Self {
            place,
            about,
            check,
        }
    }
}
