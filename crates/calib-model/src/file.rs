//! The calibrated robot as one file: everything that a program needs to predict poses as the fit does, with uncertainty.
//!
//! ```text
//! tracker_from_link = tracker_from_root · Π_joints parent_from_joint · joint_from_child                  (1)
//! φ = q + Σ c F,  θ = Σ c F e,  δ = Σ c F along:
//!                                joint_from_child = Trans(δ) · exp(axis φ) · Exp(θ)   turning joints
//!                                joint_from_child = translation by δ + axis φ         sliding joints
//! F: 1, q, cos q − 1, sin q, cos 2q − 1, sin 2q, the same of n q and 2 n q (n: gear ratio), the load,
//!    −(direction of approach), the sign of the load or −(direction of approach) where |load| ≤ friction,
//!    −(direction of approach) |load|, another joint's q, temperature − reference_temperature_c,
//!    or what a plugin computes                                                                              (2)
//! load about the axis = axis · Σ (moment_k − mass_k o) × g   over the links that the joint carries           (3)
//! ```
//!
//! Everything is SI; readings are those of the controller. Equation (3) takes the geometry of `load_origins` at the readings; mass and moment of a link are its own, in the root's axes; o
//! is the joint's origin. A sliding joint feels the force axis · Σ mass_k g. Loads are what gravity exerts: minus what a torque sensor reads.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Serialize};

/// Version of the format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(transparent)]
pub struct FormatVersion(pub u32);

/// The version that is written, and the only one that is read.
pub const VERSION: u32 = 1;

impl Default for FormatVersion {
    fn default() -> Self {
        Self(VERSION)
    }
}

/// A file that the result comes from.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Input {
    /// Relative to the profile.
    pub path: String,
    /// Of its bytes, 64 hexadecimal digits.
    pub sha256: String,
}

/// The calibrated robot. SI; quaternions x, y, z, w.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RobotModelFile {
    /// Version of this format.
    pub calib_model: FormatVersion,
    /// The robot's name.
    pub robot: String,
    /// The link that carries all others.
    pub root: String,
    /// Gravity in the root's frame, m/s².
    pub gravity_m_s2: [f64; 3],
    /// Whether the masses were assumed, because the URDF has none: their scale then belongs to the compliances.
    pub masses_assumed: bool,
    /// Links, as the URDF has them, with payloads and the first moments that were found.
    pub links: Vec<ModelLink>,
    /// Joints; each after the one that carries it.
    pub joints: Vec<ModelJoint>,
    /// The joint that moves by less than this from one posture to the next keeps its direction of approach, rad or m.
    pub approach_threshold: f64,
    /// Name of the tracker's frame.
    pub tracker: String,
    /// Where the root stands in the tracker.
    pub tracker_from_root: ModelPose,
    /// Tracking bodies.
    #[serde(deserialize_with = "unique")]
    pub bodies: BTreeMap<String, ModelBody>,
    /// Points of the robot: tool tips.
    #[serde(deserialize_with = "unique")]
    pub points: BTreeMap<String, ModelPoint>,
    /// Uncertainty of all of these numbers; null with the closed forms.
    pub uncertainty: Option<ModelUncertainty>,
    /// Sign of every load that an effect depends on.
    #[serde(default)]
    pub loads: ModelLoads,
    /// Temperature at which the lengths hold, °C; written where some grow with it. 20 where it is not stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_temperature_c: Option<f64>,
    /// Position of every joint where the harmonic effects and gains are 0, rad or m: zero offsets are what is wrong there.
    #[serde(default)]
    pub reference_position: f64,
    /// What the model was shown to be good for; null where nothing was predicted.
    #[serde(default)]
    pub validity: Option<ModelValidity>,
    /// Name and version of the program.
    pub written_by: String,
    /// All files that the result comes from.
    pub inputs: Vec<Input>,
}

/// Sign of loads.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ModelLoads {
    /// What gravity exerts on the joint: minus the torque that the joint holds, and that a sensor in it reads.
    #[default]
    Exerted,
}

/// What a model was shown to be good for. The range of each joint is its `fitted_range`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelValidity {
    /// As in report.json.
    pub verdict: String,
    /// Position error to expect on a new pose, rms, m; null where none was predicted.
    pub position_error_m: Option<f64>,
    /// Ends of its 95 % interval, m.
    pub interval_m: Option<[f64; 2]>,
    /// What the result was shown to be good for, in sentences.
    pub scope: Vec<String>,
    /// What it was not shown to be good for, in sentences.
    pub not_for: Vec<String>,
}

/// A pose, `outer_from_inner`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelPose {
    /// Origin, m.
    pub xyz_m: [f64; 3],
    /// Orientation, unit quaternion x, y, z, w.
    pub quat_xyzw: [f64; 4],
}

impl Default for ModelPose {
    fn default() -> Self {
        Self {
            xyz_m: [0.0; 3],
            quat_xyzw: [0.0, 0.0, 0.0, 1.0],
        }
    }
}

/// A link.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelLink {
    /// Its name.
    pub name: String,
    /// Its mass, kg.
    pub mass_kg: f64,
    /// Mass times center, in the link's frame, kg m.
    pub first_moment_kg_m: [f64; 3],
}

/// How a joint moves.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ModelMotion {
    /// It does not.
    #[default]
    Fixed,
    /// It turns, rad.
    Revolute,
    /// It slides, m.
    Prismatic,
}

/// A joint.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelJoint {
    /// Its name.
    pub name: String,
    /// The link that carries it.
    pub parent: String,
    /// The link that it moves.
    pub child: String,
    /// How it moves.
    pub motion: ModelMotion,
    /// `parent_from_joint`, calibrated, without the zero offset.
    pub parent_from_joint: ModelPose,
    /// The same in the nominal URDF: loads are computed with it, and a controller without calibration moves by it.
    pub load_origin: ModelPose,
    /// Axis in the joint's frame; null for a fixed joint.
    pub axis: Option<[f64; 3]>,
    /// Limits of the URDF, rad or m.
    pub limits: Option<[f64; 2]>,
    /// The joint whose reading it follows (a mimic joint): reading = multiplier · other + offset.
    pub mimic: Option<ModelMimic>,
    /// Smallest and largest reading of the recordings that were fitted: nothing is verified outside; equal where it stood still, null where it moves nothing that was seen.
    pub fitted_range: Option<[f64; 2]>,
    /// Its effects, in the order of application.
    pub effects: Vec<ModelEffect>,
}

/// A joint that follows another.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelMimic {
    /// The other.
    pub joint: String,
    /// Multiplier.
    pub multiplier: f64,
    /// Offset, rad or m.
    pub offset: f64,
}

/// One term of equation (2).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelEffect {
    /// Which: `offset`, `gain`, `eccentricity_cos`, … `coupling`.
    pub kind: String,
    /// F · c in symbols.
    pub formula: String,
    /// Its coefficient.
    pub value: f64,
    /// Unit of the coefficient.
    pub unit: String,
    /// The axis that it turns about after the joint's own motion, in the child's frame; null: the joint's own.
    pub about: Option<[f64; 3]>,
    /// The length that grows, m, in the axes of the joint, for thermal expansion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along: Option<[f64; 3]>,
    /// The joint whose reading it follows, for couplings.
    pub other: Option<String>,
    /// n, turns of the motor per turn of the joint, for effects at the motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gear_ratio: Option<f64>,
    /// Load that friction holds, N m or N, for effects of the loaded flank and of friction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<f64>,
    /// Who computes F, where it is no formula of this format: without that plugin the robot cannot be evaluated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plugin: Option<ModelPlugin>,
}

/// A plugin that computes an effect.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelPlugin {
    /// What it calls itself.
    pub name: String,
    /// Its own version.
    pub version: String,
    /// Of its file, 64 hexadecimal digits; null: linked into the program.
    pub sha256: Option<String>,
    /// Parameters of the effect as the profile gives them.
    pub parameters: BTreeMap<String, serde_json::Value>,
}

/// A tracking body.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelBody {
    /// The link that it is fixed to.
    pub link: String,
    /// `link_from_body`; null where its markers have no frame of their own.
    pub link_from_body: Option<ModelPose>,
    /// Its markers in the link's frame, m.
    pub markers_m: BTreeMap<String, [f64; 3]>,
}

/// A point of the robot.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelPoint {
    /// The link that it is fixed to.
    pub link: String,
    /// In the link's frame, m.
    pub xyz_m: [f64; 3],
}

/// Covariance C = R Rᵀ of the numbers of a model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelUncertainty {
    /// What each row of R is the uncertainty of.
    pub numbers: Vec<ModelNumber>,
    /// R by rows: independent standard deviations as columns.
    pub root: Vec<Vec<f64>>,
}

/// A number of a model that is uncertain. Poses T change by T · exp([ω; v]).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelNumber {
    /// What it belongs to: `joint`, `tracker`, `body`, `marker` (body/marker), `point`, `link`.
    pub of: String,
    /// Its name.
    pub name: String,
    /// Which number: `rx`, `ry`, `rz`, `x`, `y`, `z`, or an effect (`coupling:other`).
    pub number: String,
}

/// A map in which a name stands once: of two, one would be lost.
fn unique<'de, D, T>(deserializer: D) -> Result<BTreeMap<String, T>, D::Error>
where
    D: serde::Deserializer<'de>,
    T: Deserialize<'de>,
{
    struct Entries<T>(PhantomData<T>);
    impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
        type Value = BTreeMap<String, T>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("an object with names as keys")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut entries = BTreeMap::new();
            while let Some(name) = map.next_key::<String>()? {
                if entries.contains_key(&name) {
                    return Err(A::Error::custom(format!("the name `{name}` stands twice")));
                }
                entries.insert(name, map.next_value()?);
            }
            Ok(entries)
        }
    }
    deserializer.deserialize_map(Entries(PhantomData))
}
