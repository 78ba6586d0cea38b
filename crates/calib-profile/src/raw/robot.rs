//! The robot, its description, and what loads its joints.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The robot and its description.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawRobot {
    /// Name of the robot in reports.
    pub name: String,
    /// URDF file, relative to the profile.
    pub urdf: String,
    /// Folders of the packages that the URDF's meshes name (`package://<name>/…`), relative to the profile, by name. For
    /// the picture and the collisions of a plan; packages that lie around the URDF are found without it.
    #[serde(default)]
    pub packages: BTreeMap<String, String>,
    /// Direction of gravity in the frame of the robot's root; its length does not matter. `[0, 0, -1]` when absent: the root
    /// stands upright. `[0, 0, 1]`: it hangs from a ceiling; `[1, 0, 0]`: its x axis points to the floor.
    #[serde(default)]
    pub gravity: Option<[f64; 3]>,
    /// Mass of the whole robot without payload, kg: the masses of the URDF, or those that are assumed where it has none, are
    /// scaled to it.
    #[serde(default)]
    pub total_mass_kg: Option<f64>,
    /// What the robot carried while it was recorded and its URDF does not have, by link.
    #[serde(default)]
    pub payload: BTreeMap<String, RawPayload>,
    /// Known stiffness K of revolute joints, N m per rad, by joint: forward kinematics turns them by 1/K times their load. A
    /// compliance that is freed is expected there.
    #[serde(default)]
    pub stiffness_nm_per_rad: BTreeMap<String, f64>,
    /// Turns of the motor per turn of the joint, by joint, for effects at the motor.
    #[serde(default)]
    pub gear_ratio: BTreeMap<String, f64>,
    /// Load that the joint's friction holds, N m (N of a prismatic joint), by joint: below it the direction of approach decides on
    /// which flank a gear rests; 0 when absent.
    #[serde(default)]
    pub friction_nm: BTreeMap<String, f64>,
    /// Temperature at which the nominal lengths hold, °C; 20 when absent, as drawings state it. `thermal_expansion` counts from there.
    #[serde(default)]
    pub reference_temperature_c: Option<f64>,
}

/// A mass on a link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawPayload {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Center of mass in the link's frame, mm.
    #[serde(default)]
    pub center_mm: [f64; 3],
}
