//! `RawProfile` → `Profile`: every name resolved, every unit converted, every contradiction named.

use std::collections::{BTreeMap, BTreeSet};

use calib_urdf::{JointId, JointKind, LinkId, RobotModel};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

use crate::error::{Problem, ProfileError, expected, one_of};
use crate::locate::{Place, Places};
use crate::profile::{
    Body, BodyKind, Error3, JointException, Limits, LinkTransform, Loop, Noise, Orientation,
    Origin, Outputs, PointChoice, Prior, Profile, Protocol, RecordingSpec, RobotLog, SimErrors,
    SimMount, SimNoise, Simulation, Solve, Steps, SweptAxis, Timing, Tracker,
};
use crate::raw::{
    RawBody, RawOrientation, RawOrigin, RawPoint, RawProfile, RawProtocol, RawRecording,
    RawSimulate, RawSolve, RawUse,
};
use crate::units::{DEG, MM, pose, split_joint_key};

/// The only version of the format so far.
const VERSION: u32 = 1;

/// Cosine of the largest angle (1°) between a stated axis label and the URDF's axis.
const SAME_DIRECTION: f64 = 0.999_847_7;

/// Center estimator where the profile names none: the paper's.
const DEFAULT_CENTER: &str = "sfe";

/// Axis estimator where the profile names none: the paper's.
const DEFAULT_AXIS: &str = "planar_radial";

/// Checks a profile against the robot it names; `text` and `file` are for the messages.
///
/// # Errors
/// [`ProfileError`] with every problem found, not only the first.
pub fn check(
    raw: &RawProfile,
    text: &str,
    file: &str,
    robot: &RobotModel,
) -> Result<Profile, ProfileError> {
    if robot.joints().is_empty() {
        let place = Places::of(text).value(&["robot", "urdf"]);
        let finding = format!("`{}` has no joints", raw.robot.urdf);
        return Err(ProfileError::new(
            file,
            text,
            vec![Problem::new(place, finding, "name the URDF of a robot")],
        ));
    }
    let mut checker = Checker {
        raw,
        robot,
        places: Places::of(text),
        problems: Vec::new(),
        unknown: BTreeMap::new(),
    };
    let profile = checker.profile();
    checker.name_the_unknown();
    if checker.problems.is_empty() {
        Ok(profile)
    } else {
        Err(ProfileError::new(file, text, checker.problems))
    }
}

mod contact;
mod names;
mod origin;
mod simulate;

/// What does not resolve is left out of the checked profile, and nothing is concluded from it: one slip of the
/// pen is one problem. The profile of a checker with problems is not given out.
struct Checker<'a> {
    raw: &'a RawProfile,
    robot: &'a RobotModel,
    places: Places,
    problems: Vec<Problem>,
    /// Names that nothing is called, with the remedy and every place.
    unknown: BTreeMap<String, (String, Vec<Option<Place>>)>,
}

impl<'a> Checker<'a> {
    fn problem(&mut self, path: &[&str], finding: impl Into<String>, remedy: impl Into<String>) {
        let place = self.places.value(path);
        self.problems.push(Problem::new(place, finding, remedy));
    }

    fn key_problem(
        &mut self,
        path: &[&str],
        finding: impl Into<String>,
        remedy: impl Into<String>,
    ) {
        let place = self.places.key(path).or_else(|| self.places.value(path));
        self.problems.push(Problem::new(place, finding, remedy));
    }

    fn profile(&mut self) -> Profile {
        let raw = self.raw;
        if raw.calib != VERSION {
            self.problem(
                &["calib"],
                format!("profile version {} is not known", raw.calib),
                format!("this program reads version {VERSION}"),
            );
        }
        for place in self.places.not_finite() {
            self.problems.push(Problem::new(
                Some(place),
                "a number that is not finite",
                "give a finite number",
            ));
        }
        if raw.bodies.is_empty() && raw.contacts.is_empty() {
            self.problem(
                &["bodies"],
                "neither a tracking body nor a contact is declared",
                "name at least one body and the link it is bolted to",
            );
        }
        if raw.recordings.is_empty() {
            self.problem(
                &["recordings"],
                "no recording is declared",
                "name at least one recording file",
            );
        }
        for (key, value) in [
            ("marker_sigma_mm", raw.tracker.marker_sigma_mm),
            ("body_sigma_mm", raw.tracker.body_sigma_mm),
            ("body_sigma_deg", raw.tracker.body_sigma_deg),
        ] {
            if let Some(value) = value {
                self.positive(&["tracker", key], value);
            }
        }
        Profile {
            robot: raw.robot.name.clone(),
            urdf: raw.robot.urdf.clone(),
            packages: raw.robot.packages.clone(),
            tracker: Tracker {
                frame: raw.tracker.frame.clone(),
                marker_sigma: raw.tracker.marker_sigma_mm.map(|s| s * MM),
                body_sigma: raw.tracker.body_sigma_mm.map(|s| s * MM),
                body_sigma_rad: raw.tracker.body_sigma_deg.map(|s| s * DEG),
                up_axis: raw.tracker.up_axis,
            },
            bodies: self.bodies(),
            recordings: raw
                .recordings
                .iter()
                .map(|(name, r)| (name.clone(), self.recording(name, r)))
                .collect(),
            plugins: raw.plugins.clone(),
            origins: raw
                .origins
                .iter()
                .filter_map(|(name, o)| Some((name.clone(), self.origin(name, o)?)))
                .collect(),
            transforms: self.transforms(),
            loops: self.loops(),
            points: self.tips(),
            contacts: self.contacts(),
            solve: self.solve(&raw.solve),
            outputs: self.outputs(),
            simulate: raw.simulate.as_ref().map(|s| self.simulation(s)),
        }
    }

    fn bodies(&mut self) -> BTreeMap<String, Body> {
        let raw = self.raw;
        let mut owner: BTreeMap<&str, &str> = BTreeMap::new();
        let mut bodies = BTreeMap::new();
        for (name, body) in &raw.bodies {
            for marker in &body.markers {
                if let Some(other) = owner.insert(marker, name) {
                    self.problem(
                        &["bodies", name, "markers"],
                        format!("marker `{marker}` belongs to `{other}` already"),
                        "one marker belongs to one body; rename or remove it",
                    );
                }
            }
            if let Some(body) = self.body(name, body) {
                bodies.insert(name.clone(), body);
            }
        }
        bodies
    }

    fn body(&mut self, name: &str, raw: &RawBody) -> Option<Body> {
        let link = self.link(&["bodies", name, "link"], &raw.link);
        let kind = match (raw.pose, raw.markers.is_empty()) {
            (true, true) => BodyKind::Pose,
            (false, false) => {
                let template = self.template(name, raw);
                BodyKind::Markers {
                    names: raw.markers.clone(),
                    template,
                }
            }
            (true, false) => {
                self.problem(
                    &["bodies", name, "pose"],
                    "`pose: true` and `markers` contradict each other",
                    "keep one: the recording has either poses of the body or its markers",
                );
                BodyKind::Pose
            }
            (false, true) => {
                self.key_problem(
                    &["bodies", name],
                    format!("body `{name}` has neither `markers` nor `pose: true`"),
                    "list its markers, or say `pose: true` when the tracker exports its pose",
                );
                BodyKind::Pose
            }
        };
        Some(Body {
            link: link?,
            kind,
            mount: raw.mount.as_ref().map(pose),
        })
    }

    fn template(&mut self, name: &str, raw: &RawBody) -> Option<Vec<Point3<f64>>> {
        if raw.template_mm.is_empty() {
            return None;
        }
        self.marker_places(
            &["bodies", name, "template_mm"],
            name,
            &raw.template_mm,
            "give all markers of the body or none",
            true,
        );
        let points = raw.markers.iter().filter_map(|m| raw.template_mm.get(m));
        Some(
            points
                .map(|p| Point3::from(Vector3::from(*p) * MM))
                .collect(),
        )
    }

    fn recording(&mut self, name: &str, raw: &RawRecording) -> RecordingSpec {
        let mut ranges = BTreeMap::new();
        for (key, range) in &raw.joints {
            let path = ["recordings", name, "joints", key];
            if let Some((joint, factor)) = self.joint_key(&path, key) {
                let (low, high) = (
                    range[0].min(range[1]) * factor,
                    range[0].max(range[1]) * factor,
                );
                self.within_limits(&path, joint, low, high);
                ranges.insert(joint, (low, high));
            }
        }
        let hold = self.joint_values(&["recordings", name, "hold"], &raw.hold);
        for joint in hold.keys().filter(|j| ranges.contains_key(j)) {
            let joint = self.robot.joint(*joint).name.clone();
            self.problem(
                &["recordings", name, "hold"],
                format!("`{joint}` cannot both move and be held"),
                "keep it under `joints` or under `hold`",
            );
        }
        if raw.usage == RawUse::Sweep && raw.joints.is_empty() {
            self.key_problem(
                &["recordings", name],
                format!("sweep `{name}` names no joint that moves"),
                "add `joints: {<joint>_deg: [from, to]}`",
            );
        }
        if raw.robot_log.is_some() && raw.timing.is_none() {
            self.key_problem(
                &["recordings", name, "robot_log"],
                "two files have two sets of rows",
                "add `timing: {}`: holds become poses, and the clocks are brought together",
            );
        }
        let timing = raw.timing.as_ref().map(|timing| {
            for (key, value) in [
                ("hold_s", timing.hold_s),
                ("rate_hz", timing.rate_hz),
                ("max_offset_s", timing.max_offset_s),
            ] {
                if !(value > 0.0 || self.named_already(value)) {
                    self.problem(
                        &["recordings", name, "timing", key],
                        format!("{value} is not above 0"),
                        "give a number above 0",
                    );
                }
            }
            Timing {
                poses: timing.poses,
                clock: timing.clock,
                hold: timing.hold_s,
                rate: timing.rate_hz,
                max_offset: timing.max_offset_s,
            }
        });
        RecordingSpec {
            file: raw.file.clone(),
            usage: raw.usage,
            ranges,
            hold,
            group: raw.group.clone(),
            reader: raw.reader.clone(),
            reader_parameters: raw.reader_parameters.clone(),
            columns: raw.columns.clone(),
            robot_log: raw.robot_log.as_ref().map(|log| RobotLog {
                file: log.file.clone(),
                reader: log.reader.clone(),
                columns: log.columns.clone(),
            }),
            timing,
        }
    }

    fn transforms(&mut self) -> BTreeMap<String, LinkTransform> {
        let raw = self.raw;
        let mut transforms = BTreeMap::new();
        for (name, t) in &raw.transforms {
            let parent = self.link(&["transforms", name, "parent"], &t.parent);
            let child = self.link(&["transforms", name, "child"], &t.child);
            let path = ["transforms", name.as_str(), "correct"];
            let correct = t
                .correct
                .as_ref()
                .and_then(|joint| self.joint(&path, joint));
            if let (Some(joint), Some(joint_name)) = (correct, &t.correct) {
                if self.robot.joint(joint).kind != JointKind::Fixed {
                    self.problem(
                        &path,
                        format!("joint `{joint_name}` moves"),
                        "name a fixed joint, e.g. the one that stands the robot on its table",
                    );
                }
                if let (Some(parent), Some(child)) = (parent, child)
                    && !self
                        .robot
                        .chain(parent, child)
                        .iter()
                        .any(|step| step.joint == joint)
                {
                    self.problem(
                        &path,
                        format!(
                            "joint `{joint_name}` is not between `{}` and `{}`",
                            t.parent, t.child
                        ),
                        "name a fixed joint on the way",
                    );
                }
            }
            if let (Some(parent), Some(child)) = (parent, child) {
                transforms.insert(
                    name.clone(),
                    LinkTransform {
                        parent,
                        child,
                        correct,
                    },
                );
            }
        }
        transforms
    }

    fn loops(&mut self) -> BTreeMap<String, Loop> {
        let raw = self.raw;
        for (name, l) in &raw.loops {
            for (key, end) in [("from", &l.from), ("to", &l.to)] {
                self.known("origin", &["loops", name, key], end, raw.origins.keys());
            }
            if l.from == l.to {
                self.problem(
                    &["loops", name, "to"],
                    "the loop ends where it starts",
                    "name two different origins",
                );
            }
            if let Some(recording) = &l.recording {
                self.known(
                    "recording",
                    &["loops", name, "recording"],
                    recording,
                    raw.recordings.keys(),
                );
            }
        }
        raw.loops
            .iter()
            .map(|(name, l)| {
                (
                    name.clone(),
                    Loop {
                        from: l.from.clone(),
                        to: l.to.clone(),
                        recording: l.recording.clone(),
                    },
                )
            })
            .collect()
    }

    fn solve(&mut self, raw: &RawSolve) -> Solve {
        let mut joints = BTreeMap::new();
        for (name, exception) in &raw.joints {
            let path = ["solve", "joints", name.as_str()];
            let Some(joint) = self.joint(&path, name) else {
                continue;
            };
            let mut coupled_to = Vec::new();
            for (i, other) in exception.coupled_to.iter().enumerate() {
                let at = i.to_string();
                coupled_to.extend(self.joint(&["solve", "joints", name, "coupled_to", &at], other));
            }
            for (key, value) in [
                ("sigma_mm", exception.sigma_mm),
                ("sigma_deg", exception.sigma_deg),
                ("within_mm", exception.within_mm),
                ("within_deg", exception.within_deg),
            ] {
                if let Some(value) = value {
                    self.positive(&["solve", "joints", name, key], value);
                }
            }
            joints.insert(
                joint,
                JointException {
                    free: exception
                        .free
                        .as_ref()
                        .map(|list| list.iter().copied().collect()),
                    sigma_m: exception.sigma_mm.map(|s| s * MM),
                    sigma_rad: exception.sigma_deg.map(|s| s * DEG),
                    within_m: exception.within_mm.map(|w| w * MM),
                    within_rad: exception.within_deg.map(|w| w * DEG),
                    coupled_to,
                },
            );
        }
        let prior = &raw.prior;
        for (key, value) in [
            ("position_mm", prior.position_mm),
            ("angle_deg", prior.angle_deg),
            ("offset_deg", prior.offset_deg),
            ("offset_mm", prior.offset_mm),
            ("gain_percent", prior.gain_percent),
            ("eccentricity_deg", prior.eccentricity_deg),
            ("compliance_deg_per_nm", prior.compliance_deg_per_nm),
            ("backlash_deg", prior.backlash_deg),
            ("backlash_mm", prior.backlash_mm),
        ] {
            self.positive(&["solve", "prior", key], value);
        }
        if let Some(sigma) = raw.noise.joint_deg {
            self.not_negative(&["solve", "noise", "joint_deg"], sigma);
        }
        let limits = &raw.limits;
        for loop_name in limits.loop_mean_mm.keys() {
            self.known(
                "loop",
                &["solve", "limits", "loop_mean_mm", loop_name],
                loop_name,
                self.raw.loops.keys(),
            );
        }
        Solve {
            method: raw.method,
            free: raw.free.iter().copied().collect(),
            joints,
            prior: Prior {
                position: prior.position_mm * MM,
                angle: prior.angle_deg * DEG,
                offset_rad: prior.offset_deg * DEG,
                offset_m: prior.offset_mm * MM,
                gain: prior.gain_percent / 100.0,
                eccentricity: prior.eccentricity_deg * DEG,
                compliance: prior.compliance_deg_per_nm * DEG,
                backlash_rad: prior.backlash_deg * DEG,
                backlash_m: prior.backlash_mm * MM,
            },
            noise: Noise {
                joint: raw.noise.joint_deg.map(|s| s * DEG),
                known: raw.noise.known,
            },
            load: raw.load,
            robust: raw.robust,
            limits: Limits {
                held_out_rms: limits.held_out_rms_mm.map(|l| l * MM),
                held_out_max: limits.held_out_max_mm.map(|l| l * MM),
                loop_mean: limits
                    .loop_mean_mm
                    .iter()
                    .map(|(name, l)| (name.clone(), l * MM))
                    .collect(),
                origin_sigma: limits.origin_sigma_mm.map(|l| l * MM),
            },
        }
    }

    fn outputs(&mut self) -> Outputs {
        let raw = &self.raw.outputs;
        for (i, body) in raw.add_bodies.iter().enumerate() {
            let path = ["outputs", "add_bodies", &i.to_string()];
            self.known("body", &path, body, self.raw.bodies.keys());
        }
        let named = |name: &Option<String>, suffix: &str| {
            name.clone()
                .unwrap_or_else(|| format!("{}{suffix}", self.raw.robot.name))
        };
        let outputs = Outputs {
            urdf: named(&raw.urdf, ".calibrated.urdf"),
            scene: named(&raw.scene, ".scene.json"),
            add_bodies: raw.add_bodies.clone(),
            reports: raw.reports.clone(),
        };
        for (key, file) in [("urdf", &outputs.urdf), ("scene", &outputs.scene)] {
            if file.contains(['/', '\\']) {
                self.problem(
                    &["outputs", key],
                    format!("`{file}` is a path"),
                    "give a file name; `--out` chooses the folder",
                );
            }
        }
        outputs
    }
}
