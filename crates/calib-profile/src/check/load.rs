//! What loads the joints.

use calib_urdf::Inertial;

use super::*;
use crate::profile::RobotLoad;

impl Checker<'_> {
    pub(super) fn load(&mut self) -> RobotLoad {
        let raw = &self.raw.robot;
        let mut load = RobotLoad::default();
        if let Some(down) = raw.gravity {
            match Unit::try_new(Vector3::from(down), f64::MIN_POSITIVE) {
                Some(down) => load.down = down,
                None => self.problem(
                    &["robot", "gravity"],
                    "gravity has no direction",
                    "give the direction in which things fall, in the frame of the robot's root: [0, 0, -1] where it \
                     stands upright",
                ),
            }
        }
        if let Some(mass) = raw.total_mass_kg {
            self.mass(&["robot", "total_mass_kg"], mass);
            load.total_mass = Some(mass);
        }
        for (name, payload) in &raw.payload {
            let link = self.link(&["robot", "payload", name], name);
            self.mass(&["robot", "payload", name, "mass_kg"], payload.mass_kg);
            let inertial = Inertial {
                mass: payload.mass_kg,
                center_of_mass: Point3::from(Vector3::from(payload.center_mm) * MM),
            };
            load.payload.extend(link.map(|link| (link, inertial)));
        }
        for (name, stiffness) in &raw.stiffness_nm_per_rad {
            let path = ["robot", "stiffness_nm_per_rad", name.as_str()];
            let Some(joint) = self.joint(&path, name) else {
                continue;
            };
            if !self.robot.joint(joint).kind.turns() {
                let finding = format!("joint `{name}` does not turn");
                self.key_problem(&path, finding, "name a revolute joint");
            } else if !(*stiffness > 0.0 || self.named_already(*stiffness)) {
                let finding = format!("{stiffness} is not a stiffness");
                self.problem(&path, finding, "give N m per rad, above 0");
            }
            load.stiffness.insert(joint, *stiffness);
        }
        load
    }

    fn mass(&mut self, path: &[&str], mass: f64) {
        if !(mass > 0.0 || self.named_already(mass)) {
            let finding = format!("{mass} is not a mass");
            self.problem(path, finding, "give kg, above 0");
        }
    }
}
