//! The profile as the program needs it: SI, ids, every reference resolved.

use std::collections::{BTreeMap, BTreeSet};

use calib_recording::ColumnMap;
use calib_urdf::{JointId, LinkId};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

pub use crate::raw::{
    RawClocks as Clocks, RawFree as Free, RawJointFree as JointFree, RawLoad as Load,
    RawMethod as Method, RawTimedPoses as TimedPoses, RawUpAxis as UpAxis, RawUse as Usage,
};
pub use crate::raw::{RawPlugin as Plugin, RawValue as ParameterValue};

/// A checked profile. Lengths m, angles rad, torques N m.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Name of the robot in reports.
    pub robot: String,
    /// URDF file, relative to the profile.
    pub urdf: String,
    /// Folders of packages with meshes, relative to the profile, by name.
    pub packages: BTreeMap<String, String>,
    /// The tracker.
    pub tracker: Tracker,
    /// Tracking bodies by name.
    pub bodies: BTreeMap<String, Body>,
    /// Recordings by name.
    pub recordings: BTreeMap<String, RecordingSpec>,
    /// Plugins to load, by name.
    pub plugins: BTreeMap<String, Plugin>,
    /// Unknown transforms by name.
    pub origins: BTreeMap<String, Origin>,
    /// Transforms between links to report, by name.
    pub transforms: BTreeMap<String, LinkTransform>,
    /// Loop closures by name.
    pub loops: BTreeMap<String, Loop>,
    /// Touching points by name.
    pub points: BTreeMap<String, Tip>,
    /// Touches by name.
    pub contacts: BTreeMap<String, Contact>,
    /// How to solve.
    pub solve: Solve,
    /// What is written.
    pub outputs: Outputs,
    /// How to simulate, when the profile says.
    pub simulate: Option<Simulation>,
}

/// The tracker and what its maker states about its noise (standard deviations).
#[derive(Debug, Clone, PartialEq)]
pub struct Tracker {
    /// Name of its world frame.
    pub frame: String,
    /// One marker coordinate, m.
    pub marker_sigma: Option<f64>,
    /// One coordinate of a body's position, m.
    pub body_sigma: Option<f64>,
    /// A body's orientation about each axis, rad.
    pub body_sigma_rad: Option<f64>,
    /// Axis of the tracker's frame along which the robot's root has its z, where it was said.
    pub up_axis: Option<UpAxis>,
}

/// A tracking body on a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// The link that carries it.
    pub link: LinkId,
    /// What is recorded of it.
    pub kind: BodyKind,
    /// `link_from_body` where known by construction.
    pub mount: Option<Isometry3<f64>>,
}

/// What is recorded of a tracking body.
#[derive(Debug, Clone, PartialEq)]
pub enum BodyKind {
    /// Markers, in the order that defines the body frame; with their positions in it (m) where known.
    Markers {
        /// Names as in the recordings.
        names: Vec<String>,
        /// Positions in the body frame, one per name, m.
        template: Option<Vec<Point3<f64>>>,
    },
    /// Poses of the body.
    Pose,
}

/// A recording and what it is for.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingSpec {
    /// File, relative to the profile.
    pub file: String,
    /// What it is for.
    pub usage: Usage,
    /// Range asked of each moved joint, rad or m, lower first.
    pub ranges: BTreeMap<JointId, (f64, f64)>,
    /// Joints that stood still and are not in the file, rad or m.
    pub hold: BTreeMap<JointId, f64>,
    /// Text column that groups the poses.
    pub group: Option<String>,
    /// Reader by id; found from the content when `None`.
    pub reader: Option<String>,
    /// Parameters of the reader.
    pub reader_parameters: BTreeMap<String, ParameterValue>,
    /// Meaning of columns that do not follow our own names.
    pub columns: Option<ColumnMap>,
    /// The robot's own log, where it is another file.
    pub robot_log: Option<RobotLog>,
    /// How rows with a time become poses; `None`: every row is a pose.
    pub timing: Option<Timing>,
}

/// The robot's own log of its joints.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotLog {
    /// File, relative to the profile.
    pub file: String,
    /// Reader by id; found from the content when `None`.
    pub reader: Option<String>,
    /// Meaning of columns that do not follow our own names.
    pub columns: Option<ColumnMap>,
}

/// Time in a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// Where the poses come from.
    pub poses: TimedPoses,
    /// What is known of the clocks.
    pub clock: Clocks,
    /// Shortest hold, s.
    pub hold: f64,
    /// Rows taken from a motion, Hz.
    pub rate: f64,
    /// Largest offset between the clocks, s.
    pub max_offset: f64,
}

/// An unknown transform `body_from_joint`, the joint's frame being that of its child link.
#[derive(Debug, Clone, PartialEq)]
pub struct Origin {
    /// The joint.
    pub joint: JointId,
    /// Link whose frame is reported, fixed to the joint's child link (the child link itself by default).
    pub link: LinkId,
    /// The body that moves with it.
    pub body: String,
    /// The recording that sweeps it.
    pub sweep: String,
    /// Center estimator, by id.
    pub center: String,
    /// Parameters of the center estimator.
    pub center_parameters: BTreeMap<String, ParameterValue>,
    /// Axis estimator, by id.
    pub axis: String,
    /// Parameters of the axis estimator.
    pub axis_parameters: BTreeMap<String, ParameterValue>,
    /// The swept joints, proximal first.
    pub axes: Vec<SweptAxis>,
    /// Where the orientation comes from.
    pub orientation: Orientation,
    /// With one axis only: which point of the line is the origin.
    pub point: Option<PointChoice>,
}

/// A swept joint and the direction it turns about in the origin's joint frame at the zero position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SweptAxis {
    /// The joint.
    pub joint: JointId,
    /// Unit direction in the joint frame of the origin, at the zero position of all joints.
    pub direction: Unit<Vector3<f64>>,
}

/// Where the orientation of an origin comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Orientation {
    /// From the axes of rotation.
    Axes,
    /// Taken from the URDF relative to the link that carries this body: an assumption.
    FromBody(String),
}

/// The point that is called the origin where only a line is observable.
#[derive(Debug, Clone, PartialEq)]
pub enum PointChoice {
    /// The foot of the other origin's center on the axis, moved along it by the URDF's nominal distance.
    NominalDistanceFrom(String),
    /// The foot of the body's origin on the axis, moved along it by this distance, m.
    FromBody(f64),
}

/// A transform between two links at the zero position of all joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LinkTransform {
    /// Link in whose frame it is expressed.
    pub parent: LinkId,
    /// Link whose frame it is.
    pub child: LinkId,
    /// Fixed joint that takes up the difference with `method: paper`.
    pub correct: Option<JointId>,
}

/// Two origins measured by the tracker against forward kinematics.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Loop {
    /// Reference origin.
    pub from: String,
    /// Measured origin.
    pub to: String,
    /// Recording; all validation recordings when absent.
    pub recording: Option<String>,
}

/// A point of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Tip {
    /// Link that carries it.
    pub link: LinkId,
    /// Where it is in that link's frame, m.
    pub at: Point3<f64>,
    /// Prior σ of its coordinates where they are estimated, m.
    pub sigma: Option<f64>,
}

/// Poses in which a point of one link touches something that is fixed to another.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// Recordings whose every row is a touch.
    pub recordings: Vec<String>,
    /// The touching point.
    pub point: String,
    /// What carries the thing that is touched.
    pub on: ContactBase,
    /// What is touched; at `base_from_place` its own frame stands, with z along normal or direction.
    pub touched: Touched,
    /// Pose of the touched thing's frame in its base.
    pub base_from_place: Isometry3<f64>,
    /// Prior σ of its position where it is estimated, m.
    pub place_sigma: Option<f64>,
    /// Prior σ of its orientation where it is estimated, rad.
    pub place_sigma_rad: Option<f64>,
    /// σ of one touch, m.
    pub sigma: f64,
}

/// What a touched thing is fixed to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactBase {
    /// The tracker's frame.
    Tracker,
    /// A link.
    Link(LinkId),
}

/// What is touched, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Touched {
    /// The plane z = 0.
    Plane,
    /// The line along z.
    Line,
    /// The origin.
    Point,
    /// The sphere of this radius about the origin, m.
    Distance(f64),
}

/// How to solve.
#[derive(Debug, Clone, PartialEq)]
pub struct Solve {
    /// Closed forms or maximum likelihood.
    pub method: Method,
    /// What is free for all moved joints.
    pub free: BTreeSet<Free>,
    /// Exceptions by joint.
    pub joints: BTreeMap<JointId, JointException>,
    /// Prior standard deviations.
    pub prior: Prior,
    /// Noise levels.
    pub noise: Noise,
    /// Where the torques of compliance come from.
    pub load: Load,
    /// Detect and remove outliers and swapped markers.
    pub robust: bool,
    /// Limits of the verdict.
    pub limits: Limits,
}

/// What one joint does differently.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointException {
    /// What is free, instead of the general list.
    pub free: Option<BTreeSet<JointFree>>,
    /// Prior of its position numbers, m.
    pub sigma_m: Option<f64>,
    /// Prior of its angle numbers, rad.
    pub sigma_rad: Option<f64>,
    /// Limit of its position numbers about the description, m.
    pub within_m: Option<f64>,
    /// Limit of its angle numbers about the description, rad.
    pub within_rad: Option<f64>,
    /// Joints whose motion it follows by an unknown share.
    pub coupled_to: Vec<JointId>,
}

/// How much of a joint origin is free.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OriginFreeSet {
    /// Held at the URDF's value.
    Held,
    /// The axis line: two tilts, two shifts.
    Axis,
    /// All six numbers.
    Full,
}

/// What is free of one joint, with its priors.
#[derive(Debug, Clone, PartialEq)]
pub struct JointFreeSet {
    /// Its origin.
    pub origin: OriginFreeSet,
    /// Zero offset.
    pub offset: bool,
    /// Gain.
    pub gain: bool,
    /// First-harmonic eccentricity.
    pub eccentricity: bool,
    /// Compliance about the axis.
    pub compliance: bool,
    /// Compliance across the axis.
    pub lateral_compliance: bool,
    /// Play by the direction of approach.
    pub backlash: bool,
    /// Joints whose motion it follows.
    pub coupled_to: Vec<JointId>,
    /// Prior of position numbers, m.
    pub position_sigma: f64,
    /// Prior of orientation numbers, rad.
    pub angle_sigma: f64,
    /// Prior of the zero offset, rad (or m for a prismatic joint).
    pub offset_sigma: f64,
    /// Prior of half the play, rad (or m for a prismatic joint).
    pub backlash_sigma: f64,
    /// Limit of the position numbers, m.
    pub position_within: Option<f64>,
    /// Limit of the angle numbers, rad.
    pub angle_within: Option<f64>,
}

impl JointFreeSet {
    /// The same joint with nothing free.
    #[must_use]
    pub fn held(self) -> Self {
        Self {
            origin: OriginFreeSet::Held,
            offset: false,
            gain: false,
            eccentricity: false,
            compliance: false,
            lateral_compliance: false,
            backlash: false,
            coupled_to: Vec::new(),
            ..self
        }
    }
}

impl Solve {
    /// What is free of `joint`; `moved` tells whether the fitted recordings move it, `slides` whether it is prismatic.
    #[must_use]
    pub fn free_set(&self, joint: JointId, moved: bool, slides: bool) -> JointFreeSet {
        let exception = self.joints.get(&joint).cloned().unwrap_or_default();
        let general = |free: Free| moved && self.free.contains(&free);
        let has = |own: JointFree, all: Free| match &exception.free {
            Some(list) => list.contains(&own),
            None => general(all),
        };
        let origin = if has(JointFree::Origin, Free::JointOrigins) {
            OriginFreeSet::Full
        } else if has(JointFree::Axis, Free::JointAxes) {
            OriginFreeSet::Axis
        } else {
            OriginFreeSet::Held
        };
        let offset_prior = if slides {
            self.prior.offset_m
        } else {
            self.prior.offset_rad
        };
        JointFreeSet {
            origin,
            offset: has(JointFree::Offset, Free::JointOffsets),
            gain: has(JointFree::Gain, Free::JointGains),
            eccentricity: has(JointFree::Eccentricity, Free::Eccentricity),
            compliance: has(JointFree::Compliance, Free::Compliance),
            lateral_compliance: has(JointFree::LateralCompliance, Free::LateralCompliance),
            backlash: has(JointFree::Backlash, Free::Backlash),
            coupled_to: exception.coupled_to,
            position_sigma: exception.sigma_m.unwrap_or(self.prior.position),
            angle_sigma: exception.sigma_rad.unwrap_or(self.prior.angle),
            offset_sigma: if slides {
                exception.sigma_m
            } else {
                exception.sigma_rad
            }
            .unwrap_or(offset_prior),
            backlash_sigma: if slides {
                self.prior.backlash_m
            } else {
                self.prior.backlash_rad
            },
            position_within: exception.within_m,
            angle_within: exception.within_rad,
        }
    }
}

/// Prior standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Position numbers of joint origins, m.
    pub position: f64,
    /// Orientation numbers of joint origins, rad.
    pub angle: f64,
    /// Zero offsets of revolute joints, rad.
    pub offset_rad: f64,
    /// Zero offsets of prismatic joints, m.
    pub offset_m: f64,
    /// Gains and couplings, 1.
    pub gain: f64,
    /// Eccentricity, rad.
    pub eccentricity: f64,
    /// Compliance, rad per N m.
    pub compliance: f64,
    /// Half the play of a revolute joint, rad.
    pub backlash_rad: f64,
    /// Half the play of a prismatic joint, m.
    pub backlash_m: f64,
}

/// Noise levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Joint angle from pose to pose, rad.
    pub joint: Option<f64>,
    /// Take stated levels as true.
    pub known: bool,
}

/// Limits of the verdict.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Limits {
    /// rms position error on held-out poses, m.
    pub held_out_rms: Option<f64>,
    /// Largest position error on held-out poses, m.
    pub held_out_max: Option<f64>,
    /// Mean translation error by loop, m.
    pub loop_mean: BTreeMap<String, f64>,
    /// Standard deviation of an origin's observable position, m.
    pub origin_sigma: Option<f64>,
}

/// What is written.
#[derive(Debug, Clone, PartialEq)]
pub struct Outputs {
    /// Patched URDF.
    pub urdf: String,
    /// Scene.
    pub scene: String,
    /// Bodies added to the patched URDF.
    pub add_bodies: Vec<String>,
    /// Report writers to run too, with their parameters.
    pub reports: BTreeMap<String, BTreeMap<String, ParameterValue>>,
}

/// How to simulate recordings with known truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// Seed.
    pub seed: u64,
    /// `tracker_from_root`.
    pub tracker_from_root: Isometry3<f64>,
    /// Nominal mounts by body.
    pub mounts: BTreeMap<String, SimMount>,
    /// Differences between the true robot and its description.
    pub errors: SimErrors,
    /// Measurement noise.
    pub noise: SimNoise,
    /// Protocol by recording.
    pub recordings: BTreeMap<String, Protocol>,
}

/// A simulated mount.
#[derive(Debug, Clone, PartialEq)]
pub struct SimMount {
    /// `link_from_body`.
    pub link_from_body: Isometry3<f64>,
    /// Markers in the body frame, m.
    pub markers: BTreeMap<String, Point3<f64>>,
}

/// Position and angle standard deviations, m and rad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Error3 {
    /// m.
    pub position: f64,
    /// rad.
    pub angle: f64,
}

/// Differences between the true robot and its description (standard deviations, or exact where said).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SimErrors {
    /// Zero offsets, rad.
    pub joint_offset: f64,
    /// Axis lines.
    pub axis: Error3,
    /// Mounts.
    pub mount: Error3,
    /// Exact right-hand changes of fixed joints' origins.
    pub fixed: BTreeMap<JointId, Isometry3<f64>>,
    /// Exact compliance, rad per N m.
    pub compliance: BTreeMap<JointId, f64>,
}

/// Measurement noise, standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SimNoise {
    /// One marker coordinate, m.
    pub marker: f64,
    /// A body's pose.
    pub body: Error3,
    /// A joint, rad.
    pub joint: f64,
    /// Share of lost samples.
    pub occluded: f64,
}

/// The poses of one simulated recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Protocol {
    /// Grid joints; the last varies fastest.
    pub grid: Vec<(JointId, Steps)>,
    /// Random joints and ranges, rad or m.
    pub random: BTreeMap<JointId, (f64, f64)>,
    /// Number of random poses.
    pub poses: usize,
    /// One group of all poses per value of this joint.
    pub repeat_at: Option<(JointId, Vec<f64>)>,
    /// Held joints.
    pub hold: BTreeMap<JointId, f64>,
    /// Bodies in view.
    pub bodies: Vec<String>,
}

/// Equal steps, ends included, rad or m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steps {
    /// First.
    pub from: f64,
    /// Last.
    pub to: f64,
    /// How many.
    pub poses: usize,
}
