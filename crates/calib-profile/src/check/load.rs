//! What loads the joints.

use calib_core::effect::{Effect, Source};
use calib_urdf::Inertial;

use super::*;
use crate::profile::RobotLoad;
use crate::raw::{RawFree, RawJointFree};

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
        if let Some(celsius) = raw.reference_temperature_c {
            // Absolute zero, and what no robot survives.
            if !(-273.15..=1000.0).contains(&celsius) && !self.named_already(celsius) {
                let path = ["robot", "reference_temperature_c"];
                let finding = format!("{celsius} is not the temperature of a robot");
                self.problem(&path, finding, "give degrees Celsius, 20 for most drawings");
            }
            load.reference_temperature_c = celsius;
        }
        self.drives(&mut load);
        load
    }

    /// Gear ratios and friction.
    fn drives(&mut self, load: &mut RobotLoad) {
        let raw = &self.raw.robot;
        for (name, ratio) in &raw.gear_ratio {
            let path = ["robot", "gear_ratio", name.as_str()];
            let Some(joint) = self.joint(&path, name) else {
                continue;
            };
            if !self.robot.joint(joint).kind.turns() {
                let finding = format!("joint `{name}` does not turn");
                self.key_problem(&path, finding, "name a revolute joint");
            } else if *ratio == 0.0 {
                let remedy = "give turns of the motor per turn of the joint, e.g. 100";
                self.problem(&path, "0 is not a gear ratio", remedy);
            }
            load.gear_ratio.insert(joint, *ratio);
        }
        for (name, friction) in &raw.friction_nm {
            let path = ["robot", "friction_nm", name.as_str()];
            self.not_negative(&path, *friction);
            let joint = self.joint(&path, name);
            load.friction.extend(joint.map(|joint| (joint, *friction)));
        }
        let freed = |wanted: fn(&Effect) -> bool| {
            let mut all = self.raw.solve.free.iter();
            let all = all.any(|f| matches!(f, RawFree::Effect(e) if wanted(e)));
            let own = self
                .raw
                .solve
                .joints
                .values()
                .flat_map(|j| &j.free)
                .flatten();
            let mut own = own.filter(|f| matches!(f, RawJointFree::Effect(e) if wanted(e)));
            all || own.next().is_some()
        };
        let at_motor: fn(&Effect) -> bool = |e| e.terms.iter().any(|t| t.source == Source::Motor);
        if raw.gear_ratio.is_empty() && freed(at_motor) {
            self.problem(
                &["solve"],
                "an effect at the motor is free, and no gear ratio is stated",
                "state turns of the motor per turn of the joint: `robot: {gear_ratio: {<joint>: 100}}`",
            );
        }
    }

    fn mass(&mut self, path: &[&str], mass: f64) {
        if !(mass > 0.0 || self.named_already(mass)) {
            let finding = format!("{mass} is not a mass");
            self.problem(path, finding, "give kg, above 0");
        }
    }
}
