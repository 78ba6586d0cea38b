//! What loads the joints: gravity, masses, payloads; and how stiff they are known to be.

use calib_core::effect::thermal_expansion::REFERENCE_TEMPERATURE_C;
use calib_urdf::{Inertial, JointId, LinkId, RobotModel};
use nalgebra::{Unit, Vector3};
use std::collections::BTreeMap;

/// Acceleration of gravity, m/s².
const GRAVITY: f64 = 9.81;

/// Mass of a robot's links per length between their joints, kg/m, where nothing is stated. Arms that carry 5 to 15 kg have 10
/// to 20 (22 kg on 1.3 m, 29 kg on 1.9 m, 14 kg on 1.2 m).
const ROD: f64 = 15.0;

/// What a profile states about loads.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotLoad {
    /// Direction of gravity in the root's frame.
    pub down: Unit<Vector3<f64>>,
    /// Mass of the robot without payload, kg.
    pub total_mass: Option<f64>,
    /// Payloads by link: kg, center in the link's frame, m.
    pub payload: BTreeMap<LinkId, Inertial>,
    /// Known stiffness by joint, N m per rad.
    pub stiffness: BTreeMap<JointId, f64>,
    /// Turns of the motor per turn of the joint.
    pub gear_ratio: BTreeMap<JointId, f64>,
    /// Load that friction holds, N m or N.
    pub friction: BTreeMap<JointId, f64>,
    /// Temperature at which the nominal lengths hold, °C.
    pub reference_temperature_c: f64,
}

impl Default for RobotLoad {
    /// Upright, with the URDF's masses.
    fn default() -> Self {
        Self {
            down: -Vector3::z_axis(),
            total_mass: None,
            payload: BTreeMap::new(),
            stiffness: BTreeMap::new(),
            gear_ratio: BTreeMap::new(),
            friction: BTreeMap::new(),
            reference_temperature_c: REFERENCE_TEMPERATURE_C,
        }
    }
}

impl RobotLoad {
    /// Gravity in the root's frame, m/s².
    #[must_use]
    pub fn gravity(&self) -> Vector3<f64> {
        self.down.into_inner() * GRAVITY
    }

    /// The robot with everything that gravity acts on: the masses of its URDF, or uniform rods where it has none, scaled to
    /// the total mass, and the payloads.
    #[must_use]
    pub fn loaded(&self, robot: &RobotModel) -> RobotModel {
        let mut loaded = self.unladen(robot);
        for (link, payload) in &self.payload {
            loaded = loaded.with_payload(*link, *payload);
        }
        loaded
    }

    /// The same without the payloads.
    #[must_use]
    pub fn unladen(&self, robot: &RobotModel) -> RobotModel {
        let robot = robot.clone();
        let robot = if robot.has_masses() {
            robot
        } else {
            robot.with_rods(ROD)
        };
        match (self.total_mass, robot.total_mass()) {
            (Some(total), found) if found > 0.0 => robot.with_masses_scaled(total / found),
            _ => robot,
        }
    }
}
