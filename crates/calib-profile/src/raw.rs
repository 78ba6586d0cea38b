//! The profile as a person writes it: units in key names, no logic, unknown keys refused.
//!
//! Field documentation here is the source of the profile reference in the book and of the JSON Schema
//! that editors use.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A robot calibration profile, version 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawProfile {
    /// Version of this format: 1.
    pub calib: u32,
    /// The robot and its description.
    pub robot: RawRobot,
    /// The optical tracker.
    pub tracker: RawTracker,
    /// What the tracker sees, by name, and which link each body is bolted to.
    pub bodies: BTreeMap<String, RawBody>,
    /// The recordings, by name.
    pub recordings: BTreeMap<String, RawRecording>,
    /// Plugins to load, by name; found beside the profile in `plugins/` or on the search path.
    #[serde(default)]
    pub plugins: BTreeMap<String, RawPlugin>,
    /// The unknown transforms: joint origins relative to tracking bodies, by name.
    #[serde(default)]
    pub origins: BTreeMap<String, RawOrigin>,
    /// Transforms between links to report beside the origins, by name.
    #[serde(default)]
    pub transforms: BTreeMap<String, RawTransform>,
    /// Loop closures: two origins measured by the tracker against forward kinematics, by name.
    #[serde(default)]
    pub loops: BTreeMap<String, RawLoop>,
    /// Points of links that touch things, by name.
    #[serde(default)]
    pub points: BTreeMap<String, RawTip>,
    /// Touches: a point of one link on a plane, line, point or at a distance fixed to another link, by name.
    #[serde(default)]
    pub contacts: BTreeMap<String, RawContact>,
    /// How to solve, and what counts as good enough.
    #[serde(default)]
    pub solve: RawSolve,
    /// What is written.
    #[serde(default)]
    pub outputs: RawOutputs,
    /// How `calib simulate` makes recordings with known truth for this robot.
    #[serde(default)]
    pub simulate: Option<RawSimulate>,
}

/// The robot and its description.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawRobot {
    /// Name of the robot in reports.
    pub name: String,
    /// URDF file, relative to the profile.
    pub urdf: String,
    /// Folders of the packages that the URDF's meshes name (`package://<name>/…`), relative to the profile, by name. Only for
    /// the picture; packages that lie around the URDF are found without it.
    #[serde(default)]
    pub packages: BTreeMap<String, String>,
}

/// The optical tracker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawTracker {
    /// Name of the tracker's world frame in reports and scenes.
    pub frame: String,
    /// Stated standard deviation of one marker coordinate, mm; estimated from the data when absent.
    #[serde(default)]
    pub marker_sigma_mm: Option<f64>,
    /// Stated standard deviation of one coordinate of a body's position, mm.
    #[serde(default)]
    pub body_sigma_mm: Option<f64>,
    /// Stated standard deviation of a body's orientation about each axis, deg.
    #[serde(default)]
    pub body_sigma_deg: Option<f64>,
    /// The axis of the tracker's world frame along which the robot's root frame has its z: `+Z` for a robot that stands
    /// upright before a tracker whose z is up. Only compared with what the recordings show, never assumed.
    #[serde(default)]
    pub up_axis: Option<RawUpAxis>,
}

/// An axis of the tracker's world frame, with its sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum RawUpAxis {
    /// Along x.
    #[serde(rename = "+X")]
    PlusX,
    /// Along y.
    #[serde(rename = "+Y")]
    PlusY,
    /// Along z.
    #[serde(rename = "+Z")]
    PlusZ,
    /// Against x.
    #[serde(rename = "-X")]
    MinusX,
    /// Against y.
    #[serde(rename = "-Y")]
    MinusY,
    /// Against z.
    #[serde(rename = "-Z")]
    MinusZ,
}

impl RawUpAxis {
    /// As in the profile: `+Z`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::PlusX => "+X",
            Self::PlusY => "+Y",
            Self::PlusZ => "+Z",
            Self::MinusX => "-X",
            Self::MinusY => "-Y",
            Self::MinusZ => "-Z",
        }
    }
}

/// A tracking body: markers, or a 6-DoF body, bolted to one link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawBody {
    /// The link it is bolted to.
    pub link: String,
    /// Its markers. The body frame has its origin at the first, +x through the second, and the third in
    /// the half plane y > 0, unless `template_mm` says otherwise. One or two markers give points, not a frame.
    #[serde(default)]
    pub markers: Vec<String>,
    /// The recording has poses of this body (position and quaternion) instead of markers.
    #[serde(default)]
    pub pose: bool,
    /// Marker positions in the body frame, mm, where the tracker's definition of the body is known.
    #[serde(default)]
    pub template_mm: BTreeMap<String, [f64; 3]>,
    /// Pose of the body on its link where it is known by construction (`link_from_body`): it is then not estimated.
    #[serde(default)]
    pub mount: Option<RawPose>,
}

/// A pose: position and fixed-axis roll, pitch, yaw (URDF convention).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawPose {
    /// Position, mm.
    #[serde(default)]
    pub xyz_mm: [f64; 3],
    /// Roll, pitch, yaw about fixed axes, deg.
    #[serde(default)]
    pub rpy_deg: [f64; 3],
}

/// What a recording is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawUse {
    /// One or two joints turned over their range of motion.
    Sweep,
    /// Any static poses, used to fit.
    Static,
    /// Held out: never used to fit, only to verify.
    Validation,
}

/// One recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawRecording {
    /// File, relative to the profile.
    pub file: String,
    /// What it is for.
    #[serde(rename = "use")]
    pub usage: RawUse,
    /// Joints moved and the range asked of each: `<joint>_deg|_rad|_mm|_m: [from, to]`.
    #[serde(default)]
    pub joints: BTreeMap<String, [f64; 2]>,
    /// Joints that the file does not list and that stood still: `<joint>_deg|_rad|_mm|_m: value`.
    #[serde(default)]
    pub hold: BTreeMap<String, f64>,
    /// Text column whose values group the poses in the report (e.g. the torso position).
    #[serde(default)]
    pub group: Option<String>,
    /// Reader to use, built-in or of a plugin; found from the content when absent (see `calib plugins`).
    #[serde(default)]
    pub reader: Option<String>,
    /// Parameters of the reader, by name.
    #[serde(default)]
    pub reader_parameters: BTreeMap<String, RawValue>,
    /// How to read columns that do not name their unit.
    #[serde(default)]
    pub columns: Option<calib_recording::ColumnMap>,
    /// The robot's own log of its joints, where it is another file than the tracker's.
    #[serde(default)]
    pub robot_log: Option<RawRobotLog>,
    /// How rows with a time become poses, and how the clocks of tracker and robot go together. Without it every row is
    /// a pose, and tracker and joints must share their rows.
    #[serde(default)]
    pub timing: Option<RawTiming>,
}

/// The robot's own log of its joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawRobotLog {
    /// File, relative to the profile.
    pub file: String,
    /// Reader to use; found from the content when absent.
    #[serde(default)]
    pub reader: Option<String>,
    /// How to read columns that do not name their unit.
    #[serde(default)]
    pub columns: Option<calib_recording::ColumnMap>,
}

/// Where poses come from in a recording with time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawTimedPoses {
    /// Every hold gives one static pose: robust mean, weighted by its scatter.
    #[default]
    Settle,
    /// Rows of the motion itself, at `rate_hz`; the fit estimates what is left of the clocks' offset.
    Continuous,
}

/// What is known of the clocks of tracker and robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawClocks {
    /// Two clocks: offset and drift are found from the motion.
    #[default]
    Estimate,
    /// One clock (synchronised machines): the times are taken as they are.
    Shared,
}

/// Time in a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawTiming {
    /// Where the poses come from: `settle` (default) or `continuous`.
    pub poses: RawTimedPoses,
    /// What is known of the clocks: `estimate` (default) or `shared`.
    pub clock: RawClocks,
    /// Shortest hold, s.
    pub hold_s: f64,
    /// Rows taken from a motion, per s.
    pub rate_hz: f64,
    /// Largest offset between the clocks that is looked for, s.
    pub max_offset_s: f64,
}

impl Default for RawTiming {
    fn default() -> Self {
        Self {
            poses: RawTimedPoses::Settle,
            clock: RawClocks::Estimate,
            hold_s: 0.5,
            rate_hz: 10.0,
            max_offset_s: 10.0,
        }
    }
}

/// An unknown transform `body_from_joint`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawOrigin {
    /// The joint whose origin is sought; the frame is that of its child link.
    pub joint: String,
    /// The tracking body that moves with it.
    pub body: String,
    /// The recording that sweeps it.
    pub sweep: String,
    /// Report the origin at this link instead, which must be fixed to the joint's child link (a TCP behind a sphere joint).
    #[serde(default)]
    pub link: Option<String>,
    /// Center-of-rotation estimator (see `calib plugins`).
    #[serde(default)]
    pub center: Option<String>,
    /// Parameters of the center estimator, by name.
    #[serde(default)]
    pub center_parameters: BTreeMap<String, RawValue>,
    /// Axis-of-rotation estimator (see `calib plugins`).
    #[serde(default)]
    pub axis: Option<String>,
    /// Parameters of the axis estimator, by name.
    #[serde(default)]
    pub axis_parameters: BTreeMap<String, RawValue>,
    /// The swept joints and the axis of the joint frame each turns about at the zero position: `{z: pan, y: tilt}`;
    /// a minus turns it about (`-z: pan`).
    #[serde(default)]
    pub axes: BTreeMap<String, String>,
    /// Where the orientation comes from when fewer than two axes are swept.
    #[serde(default)]
    pub orientation: Option<RawOrientation>,
    /// With one swept axis: the point of the line that is called the origin.
    #[serde(default)]
    pub point: Option<RawPoint>,
}

/// Where an orientation comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RawOrientation {
    /// The robot is taken to stand as the URDF says relative to the link that carries this body. An assumption.
    From(String),
}

/// The chosen point on an axis of which only the line can be observed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RawPoint {
    /// The point of the axis nearest to the center of another origin, moved along the axis by the URDF's nominal distance.
    NominalDistanceFrom(String),
    /// The foot of the perpendicular from the body's origin, moved along the axis by this distance, mm.
    FromBodyMm(f64),
}

/// A transform between two links, at the zero position of all joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawTransform {
    /// The link in whose frame it is expressed.
    pub parent: String,
    /// The link whose frame it is.
    pub child: String,
    /// With `method: paper`, the fixed joint between them whose origin in the URDF takes up the difference.
    #[serde(default)]
    pub correct: Option<String>,
}

/// A plugin to load.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawPlugin {
    /// The library, relative to the profile; found by its name when absent.
    pub path: Option<String>,
    /// SHA-256 of the library: another file is refused.
    pub sha256: Option<String>,
}

/// A value of an estimator's parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum RawValue {
    /// Yes or no.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
}

/// A loop closure between two origins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawLoop {
    /// The origin that is the reference.
    pub from: String,
    /// The origin that is measured relative to it.
    pub to: String,
    /// The recording to evaluate; all validation recordings when absent.
    #[serde(default)]
    pub recording: Option<String>,
}

/// A point of a link, e.g. the tip of a stylus or the center of a ball.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawTip {
    /// The link that carries it.
    pub link: String,
    /// Where it is in the frame of that link, mm.
    #[serde(default)]
    pub at_mm: [f64; 3],
    /// Prior standard deviation of each of its coordinates, mm: it is estimated; exact when absent.
    #[serde(default)]
    pub sigma_mm: Option<f64>,
}

/// Poses in which a point of the robot touches something.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawContact {
    /// The recordings; every row of them is a touch. They may have joint positions only.
    pub recordings: Vec<String>,
    /// The touching point, by its name under `points`.
    pub point: String,
    /// What is touched is fixed to this link, or to the tracker's frame by its name; the robot's root when absent.
    #[serde(default)]
    pub on: Option<String>,
    /// What is touched.
    pub touches: RawTouched,
    /// Prior standard deviation of where it is, mm: its place is estimated; exact when absent.
    #[serde(default)]
    pub place_sigma_mm: Option<f64>,
    /// Prior standard deviation of how it is turned (planes and lines), deg: estimated; exact when absent.
    #[serde(default)]
    pub place_sigma_deg: Option<f64>,
    /// Standard deviation of one touch, mm.
    pub sigma_mm: f64,
}

/// What a point touches, in the frame of what it is fixed to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RawTouched {
    /// A plane, e.g. a table.
    Plane {
        /// Any point of the plane, mm.
        through_mm: [f64; 3],
        /// Its normal; any length.
        normal: [f64; 3],
    },
    /// A line, e.g. an edge or a taut wire.
    Line {
        /// Any point of the line, mm.
        through_mm: [f64; 3],
        /// Its direction; any length.
        direction: [f64; 3],
    },
    /// A point, e.g. a cone or a socket.
    Point {
        /// Where it is, mm.
        at_mm: [f64; 3],
    },
    /// A point at a known distance, e.g. the far ball of a ball bar.
    Distance {
        /// Where the far point is, mm.
        from_mm: [f64; 3],
        /// How far away, mm.
        distance_mm: f64,
    },
}

/// Which estimation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawMethod {
    /// The closed forms of the paper, each origin alone.
    Paper,
    /// Maximum likelihood over all loops at once.
    #[default]
    Ml,
}

/// What the solver may change.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum RawFree {
    /// Mounts of the tracking bodies on their links.
    Bodies,
    /// Pose of the robot's root in the tracker.
    Tracker,
    /// Zero offsets of the moved joints.
    JointOffsets,
    /// Axis lines of the moved joints: two tilts and two shifts across the axis.
    JointAxes,
    /// Whole origins of the moved joints, six numbers each.
    JointOrigins,
    /// Gains of the moved joints: true angle per indicated angle.
    JointGains,
    /// First-harmonic eccentricity of the moved joints' gears or encoders.
    Eccentricity,
    /// Turn of the moved joints per gravity torque about their axis.
    Compliance,
    /// Tilt of the moved joints' axes per gravity torque across them.
    LateralCompliance,
    /// Play of the moved joints: half of it to either side by the direction of approach from the row before.
    Backlash,
}

/// Extra effects or prior width of one joint (fixed joints included).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawJointSolve {
    /// What of this joint is free, instead of what `free` says for all.
    #[serde(default)]
    pub free: Option<Vec<RawJointFree>>,
    /// Prior standard deviation of its position numbers, mm.
    #[serde(default)]
    pub sigma_mm: Option<f64>,
    /// Prior standard deviation of its angle numbers, deg.
    #[serde(default)]
    pub sigma_deg: Option<f64>,
    /// Physical limit: each position number of its origin stays within this of the description, mm.
    #[serde(default)]
    pub within_mm: Option<f64>,
    /// Physical limit: each angle number (tilts, turns, zero offset) stays within this of the description, deg.
    #[serde(default)]
    pub within_deg: Option<f64>,
    /// The joint also turns by an unknown share of these joints' angles (belt or parallelogram coupling).
    #[serde(default)]
    pub coupled_to: Vec<String>,
}

/// What of one joint is free.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum RawJointFree {
    /// Zero offset.
    Offset,
    /// Gain.
    Gain,
    /// First-harmonic eccentricity.
    Eccentricity,
    /// Compliance about the axis.
    Compliance,
    /// Compliance across the axis.
    LateralCompliance,
    /// Play, by the direction of approach.
    Backlash,
    /// Whole origin.
    Origin,
    /// Axis line only.
    Axis,
}

/// Prior standard deviations of what is freed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawPrior {
    /// Position numbers of joint origins, mm.
    pub position_mm: f64,
    /// Orientation numbers of joint origins, deg.
    pub angle_deg: f64,
    /// Zero offsets of joints, deg.
    pub offset_deg: f64,
    /// Zero offsets of prismatic joints, mm.
    pub offset_mm: f64,
    /// Gains and couplings, per cent.
    pub gain_percent: f64,
    /// Eccentricity, deg.
    pub eccentricity_deg: f64,
    /// Compliance, deg per N m.
    pub compliance_deg_per_nm: f64,
    /// Half of a joint's play, deg.
    pub backlash_deg: f64,
    /// Half of a prismatic joint's play, mm.
    pub backlash_mm: f64,
}

impl Default for RawPrior {
    fn default() -> Self {
        Self {
            position_mm: 10.0,
            angle_deg: 1.0,
            offset_deg: 1.0,
            offset_mm: 10.0,
            gain_percent: 1.0,
            eccentricity_deg: 0.5,
            compliance_deg_per_nm: 0.05,
            backlash_deg: 0.2,
            backlash_mm: 0.5,
        }
    }
}

/// Where the load of a joint comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawLoad {
    /// Gravity on the masses of the URDF at the indicated joint positions.
    #[default]
    Gravity,
    /// The torque columns of the recordings, N m; a joint without one carries no load.
    Measured,
}

/// Noise levels: the start of their estimation, or fixed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawNoise {
    /// Standard deviation of the joint angles from pose to pose, deg; estimated when absent.
    #[serde(default)]
    pub joint_deg: Option<f64>,
    /// Take the stated levels as true instead of estimating them.
    #[serde(default)]
    pub known: bool,
}

/// Limits of the verdict. A limit that could not be evaluated is never a pass.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawLimits {
    /// Largest accepted rms position error on held-out poses, mm.
    #[serde(default)]
    pub held_out_rms_mm: Option<f64>,
    /// Largest accepted position error on held-out poses, mm.
    #[serde(default)]
    pub held_out_max_mm: Option<f64>,
    /// Largest accepted mean translation error of a loop, by loop, mm.
    #[serde(default)]
    pub loop_mean_mm: BTreeMap<String, f64>,
    /// Largest accepted standard deviation of an origin's observable position, mm.
    #[serde(default)]
    pub origin_sigma_mm: Option<f64>,
}

/// How to solve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSolve {
    /// `ml` (default) or `paper`.
    pub method: RawMethod,
    /// What is free, for all moved joints.
    pub free: Vec<RawFree>,
    /// Exceptions by joint.
    pub joints: BTreeMap<String, RawJointSolve>,
    /// Prior standard deviations.
    pub prior: RawPrior,
    /// Noise levels.
    pub noise: RawNoise,
    /// Where the torques of compliance come from: `gravity` (default) or `measured`.
    pub load: RawLoad,
    /// Detect and remove outliers and swapped markers.
    pub robust: bool,
    /// Limits of the verdict.
    pub limits: RawLimits,
}

impl Default for RawSolve {
    fn default() -> Self {
        Self {
            method: RawMethod::Ml,
            free: vec![
                RawFree::Bodies,
                RawFree::Tracker,
                RawFree::JointOffsets,
                RawFree::JointAxes,
            ],
            joints: BTreeMap::new(),
            prior: RawPrior::default(),
            noise: RawNoise::default(),
            load: RawLoad::default(),
            robust: true,
            limits: RawLimits::default(),
        }
    }
}

/// What is written, relative to the output folder.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawOutputs {
    /// Name of the patched URDF; `<robot>.calibrated.urdf` when absent.
    pub urdf: Option<String>,
    /// Name of the scene; `<robot>.scene.json` when absent.
    pub scene: Option<String>,
    /// Tracking bodies to add to the patched URDF as fixed joints and links.
    pub add_bodies: Vec<String>,
    /// Report writers to run too, built-in or of a plugin, each with its parameters.
    pub reports: BTreeMap<String, BTreeMap<String, RawValue>>,
}

/// How `calib simulate` makes recordings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSimulate {
    /// Seed of the random numbers; `--seed` overrides it.
    pub seed: u64,
    /// Pose of the robot's root in the tracker (`tracker_from_root`).
    pub tracker_from_root: RawPose,
    /// Where the bodies are bolted on (`link_from_body`) and, for marker bodies, where their markers are.
    pub mounts: BTreeMap<String, RawSimMount>,
    /// What differs between the true robot and its description.
    #[serde(default)]
    pub errors: RawSimErrors,
    /// Measurement noise.
    #[serde(default)]
    pub noise: RawSimNoise,
    /// The protocol of each recording.
    pub recordings: BTreeMap<String, RawProtocol>,
}

/// A simulated mount.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSimMount {
    /// Position of the body on its link, mm.
    #[serde(default)]
    pub xyz_mm: [f64; 3],
    /// Roll, pitch, yaw of the body on its link, deg.
    #[serde(default)]
    pub rpy_deg: [f64; 3],
    /// Markers in the body frame, mm.
    #[serde(default)]
    pub markers_mm: BTreeMap<String, [f64; 3]>,
}

/// Standard deviations of the differences between the true robot and its description.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSimErrors {
    /// Zero offset of every moved joint, deg.
    pub joint_offset_deg: f64,
    /// Shift of every moved joint's axis across itself, mm.
    pub axis_mm: f64,
    /// Tilt of every moved joint's axis, deg.
    pub axis_deg: f64,
    /// Position of the mounts, mm.
    pub mount_mm: f64,
    /// Orientation of the mounts, deg.
    pub mount_deg: f64,
    /// Exact differences of fixed joints' origins (e.g. where the arm really stands on its table).
    pub fixed: BTreeMap<String, RawPose>,
    /// True compliance of joints, deg per N m of gravity torque about the axis.
    pub compliance_deg_per_nm: BTreeMap<String, f64>,
}

/// Measurement noise, standard deviations.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSimNoise {
    /// One marker coordinate, mm.
    pub marker_mm: f64,
    /// One coordinate of a body's position, mm.
    pub body_mm: f64,
    /// A body's orientation about each axis, deg.
    pub body_deg: f64,
    /// A joint's true angle about its indicated one, pose to pose, deg.
    pub joint_deg: f64,
    /// Share of samples lost to occlusion, 0..1.
    pub occluded: f64,
}

/// The poses of one recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawProtocol {
    /// Joints stepped over a grid; the last one varies fastest.
    #[serde(default)]
    pub grid: Vec<RawSteps>,
    /// Joints drawn at random from a range: `<joint>_deg: [from, to]`.
    #[serde(default)]
    pub random: BTreeMap<String, [f64; 2]>,
    /// Number of random poses.
    #[serde(default)]
    pub poses: usize,
    /// Repeat all poses with this joint at each of these values, one group each: `<joint>_deg: [values]`.
    #[serde(default)]
    pub repeat_at: BTreeMap<String, Vec<f64>>,
    /// Joints held still: `<joint>_deg: value`; all others stand at zero.
    #[serde(default)]
    pub hold: BTreeMap<String, f64>,
    /// Bodies in view; all when absent.
    #[serde(default)]
    pub bodies: Option<Vec<String>>,
}

/// Equal steps over a range, ends included.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSteps {
    /// The joint with its unit: `<joint>_deg|_rad|_mm|_m`.
    pub joint: String,
    /// First value.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// How many values.
    pub poses: usize,
}
