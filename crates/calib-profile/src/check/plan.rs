//! The `plan` section.

use super::*;
use crate::profile::{Camera, Facing, KeepOut, PlanSpec};
use crate::raw::RawPlan;

impl Checker<'_> {
    pub(super) fn plan(&mut self, raw: &RawPlan) -> PlanSpec {
        let mut joints = BTreeMap::new();
        for (key, range) in &raw.joints {
            let path = ["plan", "joints", key];
            if let Some((joint, factor)) = self.joint_key(&path, key) {
                let (low, high) = (
                    range[0].min(range[1]) * factor,
                    range[0].max(range[1]) * factor,
                );
                self.within_limits(&path, joint, low, high);
                joints.insert(joint, (low, high));
            }
        }
        let hold = self.joint_values(&["plan", "hold"], &raw.hold);
        for joint in hold.keys().filter(|j| joints.contains_key(j)) {
            let joint = self.robot.joint(*joint).name.clone();
            self.problem(
                &["plan", "hold"],
                format!("`{joint}` cannot both move and be held"),
                "keep it under `joints` or under `hold`",
            );
        }
        self.amount(&["plan", "clearance_mm"], raw.clearance_mm, 0.0);
        if raw.min_cameras == 0 {
            self.problem(
                &["plan", "min_cameras"],
                "a marker that no camera sees is not measured",
                "give 1 or more",
            );
        }
        PlanSpec {
            joints,
            hold,
            clearance: raw.clearance_mm * MM,
            ground: raw.ground_mm.map(|z| z * MM),
            keep_outs: self.keep_outs(raw),
            cameras: self.cameras(raw),
            min_cameras: raw.min_cameras,
            facing: self.facing(raw),
            task_box: self.task_box(raw),
        }
    }

    fn keep_outs(&mut self, raw: &RawPlan) -> BTreeMap<String, KeepOut> {
        let mut boxes = BTreeMap::new();
        for (name, keep_out) in &raw.keep_outs {
            for (i, size) in keep_out.size_mm.iter().enumerate() {
                let path = ["plan", "keep_outs", name, "size_mm", &i.to_string()];
                self.amount(&path, *size, f64::MIN_POSITIVE);
            }
            let keep_out = KeepOut {
                size: Vector3::from(keep_out.size_mm) * MM,
                root_from_box: pose(&keep_out.center),
            };
            boxes.insert(name.clone(), keep_out);
        }
        boxes
    }

    fn cameras(&mut self, raw: &RawPlan) -> BTreeMap<String, Camera> {
        let mut cameras = BTreeMap::new();
        for (name, camera) in &raw.cameras {
            let at = |key: &'static str| ["plan", "cameras", name.as_str(), key];
            let possible = camera.field_deg > 0.0 && camera.field_deg <= 180.0;
            if !possible && !self.named_already(camera.field_deg) {
                self.problem(
                    &at("field_deg"),
                    format!("{} is not a field of view", camera.field_deg),
                    "give the full angle, above 0 and up to 180",
                );
            }
            if let Some(range) = camera.range_mm {
                self.amount(&at("range_mm"), range, f64::MIN_POSITIVE);
            }
            let (from, to) = (
                Vector3::from(camera.at_mm) * MM,
                Vector3::from(camera.toward_mm) * MM,
            );
            let Some(axis) = Unit::try_new(to - from, 1e-9) else {
                self.problem(
                    &at("toward_mm"),
                    format!("camera `{name}` looks at itself"),
                    "give another place on its optical axis",
                );
                continue;
            };
            let camera = Camera {
                at: Point3::from(from),
                axis,
                half_field: camera.field_deg * DEG / 2.0,
                range: camera.range_mm.map_or(f64::INFINITY, |range| range * MM),
            };
            cameras.insert(name.clone(), camera);
        }
        if !cameras.is_empty() && raw.min_cameras > cameras.len() {
            self.problem(
                &["plan", "min_cameras"],
                format!(
                    "{} cameras are asked for, {} are declared",
                    raw.min_cameras,
                    cameras.len()
                ),
                "declare more under `cameras`, or lower `min_cameras`",
            );
        }
        cameras
    }

    fn facing(&mut self, raw: &RawPlan) -> BTreeMap<String, Facing> {
        let bodies = self.raw.bodies.iter();
        let names: BTreeSet<&String> = bodies
            .flat_map(|(name, body)| std::iter::once(name).chain(&body.markers))
            .collect();
        let mut facing = BTreeMap::new();
        for (name, side) in &raw.facing {
            let path = ["plan", "facing", name];
            self.known("body or marker", &path, name, names.iter().copied());
            let within = ["plan", "facing", name, "within_deg"];
            self.amount(&within, side.within_deg, f64::MIN_POSITIVE);
            match Unit::try_new(Vector3::from(side.normal), 1e-9) {
                Some(normal) => {
                    let within = side.within_deg * DEG;
                    facing.insert(name.clone(), Facing { normal, within });
                }
                None => self.problem(
                    &["plan", "facing", name, "normal"],
                    "a vector of length 0 has no direction",
                    "give the direction that it faces",
                ),
            }
        }
        facing
    }

    fn task_box(&mut self, raw: &RawPlan) -> Option<[Point3<f64>; 2]> {
        let [a, b] = raw.task_box_mm?.map(Vector3::from);
        if (a - b).iter().any(|edge| *edge == 0.0) {
            self.problem(
                &["plan", "task_box_mm"],
                "two corners of a box differ in all three coordinates",
                "give opposite corners",
            );
        }
        let corners = [a.inf(&b) * MM, a.sup(&b) * MM];
        Some(corners.map(Point3::from))
    }

    fn amount(&mut self, path: &[&str], value: f64, least: f64) {
        if !(value >= least || self.named_already(value)) {
            let above = if least > 0.0 { "above 0" } else { "≥ 0" };
            self.problem(
                path,
                format!("{value} is not possible here"),
                format!("give a number {above}"),
            );
        }
    }
}
