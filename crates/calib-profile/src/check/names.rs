//! Names, units and limits: what every section of a profile is checked with.

use calib_finding::nearest_word;

use super::*;

/// A list of points by marker.
#[derive(Clone, Copy)]
pub(super) enum MarkerList {
    /// `template_mm` of a body.
    Template,
    /// `markers_mm` of a simulated mount.
    Simulated,
}

impl MarkerList {
    /// What to do where a marker is missing.
    fn remedy(self) -> &'static str {
        match self {
            Self::Template => "give all markers of the body or none",
            Self::Simulated => "give it under `markers_mm`",
        }
    }

    /// Whether names that are not markers of the body are a problem.
    fn forbids_others(self) -> bool {
        matches!(self, Self::Template)
    }
}

impl Checker<'_> {
    /// Reports and scenes name frames: that of the tracker has a name of its own.
    pub(super) fn tracker_frame(&mut self) {
        let frame = &self.raw.tracker.frame;
        let other = if self.robot.link_id(frame).is_ok() {
            "a link of the URDF"
        } else if self.raw.bodies.contains_key(frame) {
            "a body"
        } else if self.raw.points.contains_key(frame) {
            "a point"
        } else {
            return;
        };
        self.problem(
            &["tracker", "frame"],
            format!("the tracker's frame `{frame}` has the name of {other}"),
            "give the tracker's frame a name of its own, e.g. `lab`",
        );
    }

    /// Each key is a body or marker, and no two of them are one of the tracker's.
    pub(super) fn tracker_names(&mut self) -> BTreeMap<String, String> {
        let raw = self.raw;
        let bodies = raw.bodies.iter();
        let known: BTreeSet<&String> = bodies
            .flat_map(|(name, body)| std::iter::once(name).chain(&body.markers))
            .collect();
        let mut taken = BTreeMap::new();
        for (name, from) in &raw.names {
            let path = ["names", name.as_str()];
            self.known("body or marker", &path, name, known.iter().copied());
            if let Some(other) = taken.insert(from, name) {
                self.problem(
                    &path,
                    format!("`{from}` is the tracker's name of `{other}` already"),
                    "give each body and marker a tracker name of its own",
                );
            }
        }
        raw.names.clone()
    }

    /// Notes that nothing `what` is called `name`; its place is the key that is the name, or else the value.
    fn unknown(&mut self, path: &[&str], name: &str, finding: String, remedy: String) {
        let place = match path.last() {
            Some(last) if *last == name => self.places.key(path),
            _ => None,
        };
        let place = place.or_else(|| self.places.value(path));
        let (_, places) = self.unknown.entry(finding).or_insert((remedy, Vec::new()));
        places.push(place);
    }

    /// Every unknown name once, at its first place, with the lines of the others.
    pub(super) fn name_the_unknown(&mut self) {
        for (finding, (remedy, mut places)) in std::mem::take(&mut self.unknown) {
            places.sort();
            let first = places.first().copied().flatten();
            let mut others: Vec<usize> = places.iter().flatten().map(|p| p.line).collect();
            others.retain(|line| first.is_none_or(|first| *line != first.line));
            others.dedup();
            let finding = match others
                .iter()
                .map(usize::to_string)
                .collect::<Vec<_>>()
                .as_slice()
            {
                [] => finding,
                [line] => format!("{finding} (also in line {line})"),
                [lines @ .., last] => {
                    format!("{finding} (also in lines {} and {last})", lines.join(", "))
                }
            };
            self.problems.push(Problem::new(first, finding, remedy));
        }
    }

    pub(super) fn known<'n>(
        &mut self,
        what: &str,
        path: &[&str],
        name: &str,
        names: impl IntoIterator<Item = &'n String>,
    ) {
        let names: BTreeSet<&str> = names.into_iter().map(String::as_str).collect();
        if !names.contains(name) {
            let finding = format!("no {what} is called `{name}`");
            self.unknown(path, name, finding, expected(name, names));
        }
    }

    /// Each marker of a body has its place in a list of points; a marker without a place is not named where a
    /// misspelled place is its. The list says whether further points are a problem.
    pub(super) fn marker_places(
        &mut self,
        path: &[&str],
        body: &str,
        points: &BTreeMap<String, [f64; 3]>,
        list: MarkerList,
    ) {
        let Some(markers) = self.raw.bodies.get(body).map(|b| &b.markers) else {
            return;
        };
        let missing = || {
            let without = markers.iter().filter(|m| !points.contains_key(*m));
            without.map(String::as_str)
        };
        let mut meant = BTreeSet::new();
        for stranger in points.keys().filter(|m| !markers.contains(m)) {
            let near = nearest_word(stranger, missing());
            meant.extend(near);
            let help = match near {
                Some(near) => format!("did you mean `{near}`?"),
                None if list.forbids_others() => {
                    expected(stranger, markers.iter().map(String::as_str))
                }
                None => continue,
            };
            let mut at = path.to_vec();
            at.push(stranger);
            let finding = format!("`{stranger}` is not a marker of `{body}`");
            self.unknown(&at, stranger, finding, help);
        }
        for marker in missing().filter(|m| !meant.contains(m)) {
            let finding = format!("marker `{marker}` of `{body}` has no place here");
            self.key_problem(path, finding, list.remedy());
        }
    }

    pub(super) fn link(&mut self, path: &[&str], name: &str) -> Option<LinkId> {
        let found = self.robot.link_id(name).ok();
        if found.is_none() {
            let names = self.robot.links().iter().map(|l| l.name.as_str());
            let finding = format!("the URDF has no link `{name}`");
            self.unknown(path, name, finding, expected(name, names));
        }
        found
    }

    pub(super) fn joint(&mut self, path: &[&str], name: &str) -> Option<JointId> {
        self.joint_called(path, name, name)
    }

    /// The joint `name`, which `written` (the name, or the name and a unit) asks for.
    fn joint_called(&mut self, path: &[&str], written: &str, name: &str) -> Option<JointId> {
        let found = self.robot.joint_id(name).ok();
        if found.is_none() {
            let names = self.robot.joints().iter().map(|j| j.name.as_str());
            let finding = format!("the URDF has no joint `{name}`");
            self.unknown(path, written, finding, expected(name, names));
        }
        found
    }

    /// `waist_deg` → joint and factor to SI, with the unit checked against the kind of the joint.
    pub(super) fn joint_key(&mut self, path: &[&str], key: &str) -> Option<(JointId, f64)> {
        let Some((name, unit)) = split_joint_key(key) else {
            let known = self.robot.independent_joints().map(|id| {
                let joint = self.robot.joint(id);
                let unit = if joint.kind.turns() { "deg" } else { "mm" };
                format!("{}_{unit}", joint.name)
            });
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
        let joint = self.joint_called(path, key, name)?;
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
        if self.named_already(low) || self.named_already(high) {
            return;
        }
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

    /// A number that is not finite is named with all such numbers, at its place.
    pub(super) fn named_already(&self, value: f64) -> bool {
        !value.is_finite() && !self.places.not_finite().is_empty()
    }

    pub(super) fn positive(&mut self, path: &[&str], value: f64) {
        if !(value > 0.0 || self.named_already(value)) {
            self.problem(
                path,
                format!("{value} is not a standard deviation"),
                "give a number above 0",
            );
        }
    }

    pub(super) fn above_zero(&mut self, path: &[&str], value: f64) {
        if !(value > 0.0 || self.named_already(value)) {
            self.problem(
                path,
                format!("{value} is not above 0"),
                "give a number above 0",
            );
        }
    }

    pub(super) fn not_negative(&mut self, path: &[&str], value: f64) {
        if !(value >= 0.0 || self.named_already(value)) {
            self.problem(
                path,
                format!("{value} is not a noise level"),
                "give 0 or a number above",
            );
        }
    }
}
