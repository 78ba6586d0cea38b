//! Names, units and limits: what every section of a profile is checked with.

use super::*;

impl Checker<'_> {
    pub(super) fn known<'n>(
        &mut self,
        path: &[&str],
        name: &str,
        names: impl IntoIterator<Item = &'n String>,
    ) {
        let names: BTreeSet<&str> = names.into_iter().map(String::as_str).collect();
        if !names.contains(name) {
            let what = path.iter().rev().find_map(|k| match *k {
                "body" | "bodies" | "add_bodies" | "mounts" => Some("body"),
                "sweep" | "recording" | "recordings" => Some("recording"),
                "point" => Some("point"),
                "from" | "to" if path[0] == "loops" => Some("origin"),
                "from" => Some("body"),
                "loop_mean_mm" => Some("loop"),
                _ => None,
            });
            self.problem(
                path,
                format!("no {} is called `{name}`", what.unwrap_or("origin")),
                expected(name, names),
            );
        }
    }

    pub(super) fn link(&mut self, path: &[&str], name: &str) -> LinkId {
        match self.robot.link_id(name) {
            Ok(id) => id,
            Err(_) => {
                let names: Vec<&str> = self.robot.links().iter().map(|l| l.name.as_str()).collect();
                self.problem(
                    path,
                    format!("the URDF has no link `{name}`"),
                    expected(name, names),
                );
                self.robot.root()
            }
        }
    }

    /// The joint, or any joint where the name did not resolve: the problem is noted and no profile is returned.
    pub(super) fn joint(&mut self, path: &[&str], name: &str) -> JointId {
        self.joint_at(path, name).unwrap_or(self.any_joint)
    }

    pub(super) fn joint_at(&mut self, path: &[&str], name: &str) -> Option<JointId> {
        match self.robot.joint_id(name) {
            Ok(id) => Some(id),
            Err(_) => {
                let names: Vec<&str> = self
                    .robot
                    .joints()
                    .iter()
                    .map(|j| j.name.as_str())
                    .collect();
                self.problem(
                    path,
                    format!("the URDF has no joint `{name}`"),
                    expected(name, names),
                );
                None
            }
        }
    }

    /// `waist_deg` → joint and factor to SI, with the unit checked against the kind of the joint.
    pub(super) fn joint_key(&mut self, path: &[&str], key: &str) -> Option<(JointId, f64)> {
        let Some((name, unit)) = split_joint_key(key) else {
            let known = self
                .robot
                .independent_joints()
                .map(|id| format!("{}_deg", self.robot.joint(id).name));
            let known: Vec<String> = known.collect();
            self.key_problem(
                path,
                format!("`{key}` does not say its unit"),
                format!(
                    "end it in _deg, _rad, _mm or _m: {}",
                    expected(key, known.iter().map(String::as_str))
                ),
            );
            return None;
        };
        let joint = match self.robot.joint_id(name) {
            Ok(id) => id,
            Err(_) => {
                let names: Vec<&str> = self
                    .robot
                    .joints()
                    .iter()
                    .map(|j| j.name.as_str())
                    .collect();
                self.key_problem(
                    path,
                    format!("the URDF has no joint `{name}`"),
                    expected(name, names),
                );
                return None;
            }
        };
        let kind = &self.robot.joint(joint).kind;
        if *kind == JointKind::Fixed {
            self.key_problem(
                path,
                format!("joint `{name}` is fixed"),
                "name a joint that moves",
            );
            return None;
        }
        if kind.turns() != unit.is_angle() {
            let units = if kind.turns() {
                ["_deg", "_rad"]
            } else {
                ["_mm", "_m"]
            };
            self.key_problem(
                path,
                format!(
                    "joint `{name}` is {}: `{key}` has the wrong unit",
                    kind.name()
                ),
                format!("end it in {}", one_of(units)),
            );
            return None;
        }
        Some((joint, unit.factor()))
    }

    pub(super) fn joint_values(
        &mut self,
        path: &[&str],
        values: &BTreeMap<String, f64>,
    ) -> BTreeMap<JointId, f64> {
        let mut resolved = BTreeMap::new();
        for (key, value) in values {
            let mut full = path.to_vec();
            full.push(key);
            if let Some((joint, factor)) = self.joint_key(&full, key) {
                self.within_limits(&full, joint, value * factor, value * factor);
                resolved.insert(joint, value * factor);
            }
        }
        resolved
    }

    pub(super) fn within_limits(&mut self, path: &[&str], joint: JointId, low: f64, high: f64) {
        let joint = self.robot.joint(joint);
        let Some((lower, upper)) = joint
            .limits
            .range()
            .filter(|_| !matches!(joint.kind, JointKind::Continuous { .. }))
        else {
            return;
        };
        /// Rounding of degrees written with two decimals.
        const SLACK: f64 = 1e-3;
        if low < lower - SLACK || high > upper + SLACK {
            let (unit, factor) = if joint.kind.turns() {
                ("deg", DEG)
            } else {
                ("mm", MM)
            };
            let show = |v: f64| format!("{:.1}", v / factor);
            self.key_problem(
                path,
                format!(
                    "`{}` is asked to reach {} … {} {unit}, its limits are {} … {} {unit}",
                    joint.name,
                    show(low),
                    show(high),
                    show(lower),
                    show(upper)
                ),
                "keep inside the URDF's limits, or correct them",
            );
        }
    }

    pub(super) fn rigidly_joined(&self, a: LinkId, b: LinkId) -> bool {
        self.robot
            .chain(a, b)
            .iter()
            .all(|step| self.robot.joint(step.joint).kind == JointKind::Fixed)
    }

    pub(super) fn positive(&mut self, path: &[&str], value: f64) {
        if !(value.is_finite() && value > 0.0) {
            self.problem(
                path,
                format!("{value} is no standard deviation"),
                "give a number above 0",
            );
        }
    }

    pub(super) fn not_negative(&mut self, path: &[&str], value: f64) {
        if !(value.is_finite() && value >= 0.0) {
            self.problem(
                path,
                format!("{value} is no noise level"),
                "give 0 or a number above",
            );
        }
    }
}
