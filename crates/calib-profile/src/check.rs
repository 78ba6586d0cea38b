//! `RawProfile` → `Profile`: every name resolved, every unit converted, every contradiction named.

use std::collections::{BTreeMap, BTreeSet};

use calib_urdf::{JointId, JointKind, LinkId, RobotModel};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

use crate::error::{Problem, ProfileError, expected, one_of};
use crate::locate::Places;
use crate::profile::{
    Body, BodyKind, Error3, JointException, Limits, LinkTransform, Loop, Noise, Orientation,
    Origin, Outputs, PointChoice, Prior, Profile, Protocol, RecordingSpec, SimErrors, SimMount,
    SimNoise, Simulation, Solve, Steps, SweptAxis, Tracker,
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
    let Some(any_joint) = robot.joint_ids().next() else {
        let place = Places::of(text).value(&["robot", "urdf"]);
        let finding = format!("`{}` has no joints", raw.robot.urdf);
        return Err(ProfileError::new(
            file,
            text,
            vec![Problem::new(place, finding, "name the URDF of a robot")],
        ));
    };
    let mut checker = Checker {
        raw,
        robot,
        any_joint,
        places: Places::of(text),
        problems: Vec::new(),
    };
    let profile = checker.profile();
    if checker.problems.is_empty() {
        Ok(profile)
    } else {
        Err(ProfileError::new(file, text, checker.problems))
    }
}

struct Checker<'a> {
    raw: &'a RawProfile,
    robot: &'a RobotModel,
    any_joint: JointId,
    places: Places,
    problems: Vec<Problem>,
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
        if raw.bodies.is_empty() {
            self.problem(
                &["bodies"],
                "no tracking body is declared",
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
            tracker: Tracker {
                frame: raw.tracker.frame.clone(),
                marker_sigma: raw.tracker.marker_sigma_mm.map(|s| s * MM),
                body_sigma: raw.tracker.body_sigma_mm.map(|s| s * MM),
                body_sigma_rad: raw.tracker.body_sigma_deg.map(|s| s * DEG),
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
                .map(|(name, o)| (name.clone(), self.origin(name, o)))
                .collect(),
            transforms: self.transforms(),
            loops: self.loops(),
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
            bodies.insert(name.clone(), self.body(name, body));
        }
        bodies
    }

    fn body(&mut self, name: &str, raw: &RawBody) -> Body {
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
        Body {
            link,
            kind,
            mount: raw.mount.as_ref().map(pose),
        }
    }

    fn template(&mut self, name: &str, raw: &RawBody) -> Option<Vec<Point3<f64>>> {
        if raw.template_mm.is_empty() {
            return None;
        }
        for marker in raw.template_mm.keys().filter(|m| !raw.markers.contains(m)) {
            self.problem(
                &["bodies", name, "template_mm", marker],
                format!("`{marker}` is not a marker of `{name}`"),
                expected(marker, raw.markers.iter().map(String::as_str)),
            );
        }
        let mut points = Vec::new();
        for marker in &raw.markers {
            match raw.template_mm.get(marker) {
                Some(p) => points.push(Point3::from(Vector3::from(*p) * MM)),
                None => self.problem(
                    &["bodies", name, "template_mm"],
                    format!("the template has no marker `{marker}`"),
                    "give all markers of the body or none",
                ),
            }
        }
        Some(points)
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
        RecordingSpec {
            file: raw.file.clone(),
            usage: raw.usage,
            ranges,
            hold,
            group: raw.group.clone(),
            reader: raw.reader.clone(),
            reader_parameters: raw.reader_parameters.clone(),
            columns: raw.columns.clone(),
        }
    }

    fn origin(&mut self, name: &str, raw: &RawOrigin) -> Origin {
        let joint = self.joint(&["origins", name, "joint"], &raw.joint);
        let child = self.robot.joint(joint).child;
        let link = match &raw.link {
            Some(link) => self.link(&["origins", name, "link"], link),
            None => child,
        };
        if !self.rigidly_joined(child, link) {
            let child_name = self.robot.link(child).name.clone();
            self.problem(
                &["origins", name, "link"],
                format!(
                    "link `{}` moves against `{child_name}`, the child link of `{}`",
                    self.robot.link(link).name,
                    raw.joint
                ),
                "name a link that is fixed to it",
            );
        }
        self.known(
            &["origins", name, "body"],
            &raw.body,
            self.raw.bodies.keys(),
        );
        if let Some(body) = self.raw.bodies.get(&raw.body) {
            if let Ok(body_link) = self.robot.link_id(&body.link)
                && !self.rigidly_joined(child, body_link)
            {
                self.problem(
                    &["origins", name, "body"],
                    format!(
                        "body `{}` sits on `{}`, which moves against the child link of `{}`",
                        raw.body, body.link, raw.joint
                    ),
                    "mount the body on the joint's child link, or name the joint that carries it",
                );
            }
            if !body.pose && body.markers.len() < 3 {
                self.problem(
                    &["origins", name, "body"],
                    format!(
                        "body `{}` has {} markers: they give points, not a frame",
                        raw.body,
                        body.markers.len()
                    ),
                    "an origin is expressed in a body frame: it needs 3 markers or a 6-DoF body",
                );
            }
        }
        self.known(
            &["origins", name, "sweep"],
            &raw.sweep,
            self.raw.recordings.keys(),
        );
        if let Some(recording) = self.raw.recordings.get(&raw.sweep)
            && recording.usage == RawUse::Validation
        {
            self.problem(
                &["origins", name, "sweep"],
                format!("`{}` is held out for validation", raw.sweep),
                "sweep another recording, or change its `use`",
            );
        }
        let axes = self.axes(name, raw, joint);
        let orientation = self.orientation(name, raw, axes.len());
        let point = self.point(name, raw, axes.len());
        Origin {
            joint,
            link,
            body: raw.body.clone(),
            sweep: raw.sweep.clone(),
            center: raw
                .center
                .clone()
                .unwrap_or_else(|| DEFAULT_CENTER.to_owned()),
            center_parameters: raw.center_parameters.clone(),
            axis: raw.axis.clone().unwrap_or_else(|| DEFAULT_AXIS.to_owned()),
            axes,
            orientation,
            point,
        }
    }

    /// The swept joints, proximal first, each checked to turn about the stated axis of the joint frame at zero.
    fn axes(&mut self, name: &str, raw: &RawOrigin, origin_joint: JointId) -> Vec<SweptAxis> {
        let child = self.robot.joint(origin_joint).child;
        let zero = self.robot.forward_kinematics(&self.robot.zero_positions());
        let mut axes = Vec::new();
        for (label, joint_name) in &raw.axes {
            let path = ["origins", name, "axes", label];
            let Some(stated) = axis_label(label) else {
                self.key_problem(
                    &path,
                    format!("`{label}` is no axis"),
                    "axes are x, y, z, -x, -y or -z of the joint frame",
                );
                continue;
            };
            let joint = self.joint(&path, joint_name);
            let Some(axis) = self
                .robot
                .joint(joint)
                .kind
                .axis()
                .filter(|_| self.robot.joint(joint).kind.turns())
            else {
                self.problem(
                    &path,
                    format!("joint `{joint_name}` does not turn"),
                    "name a revolute joint",
                );
                continue;
            };
            if !self.robot.carries(joint, child) {
                self.problem(
                    &path,
                    format!(
                        "joint `{joint_name}` does not move `{}`",
                        self.robot.link(child).name
                    ),
                    "name joints between the root and the origin's joint",
                );
                continue;
            }
            // child_from_joint · axis, at the zero position
            let at = self.robot.joint(joint).child;
            let in_child =
                zero[child.index()].rotation.inverse() * zero[at.index()].rotation * axis;
            if in_child.dot(&stated) < SAME_DIRECTION {
                let found = format!("[{:.3}, {:.3}, {:.3}]", in_child.x, in_child.y, in_child.z);
                self.problem(&path, format!("`{joint_name}` turns about {found} of the frame of `{}` at zero, not about `{label}`", raw.joint), "correct the label, or the URDF");
            }
            axes.push(SweptAxis {
                joint,
                direction: Unit::new_normalize(in_child.into_inner()),
            });
        }
        if axes.len() > 2 {
            self.problem(
                &["origins", name, "axes"],
                format!("{} axes were given", axes.len()),
                "an origin takes one or two swept axes",
            );
        }
        axes.sort_by_key(|a| {
            self.robot
                .chain_to_root(self.robot.joint(a.joint).child)
                .len()
        });
        if let [a, b] = axes.as_slice()
            && a.direction.dot(&b.direction).abs() > SAME_DIRECTION
        {
            self.problem(
                &["origins", name, "axes"],
                "the two axes are parallel",
                "two axes that are not parallel give an orientation",
            );
        }
        axes
    }

    fn orientation(&mut self, name: &str, raw: &RawOrigin, axes: usize) -> Orientation {
        match &raw.orientation {
            Some(RawOrientation::From(body)) => {
                self.known(
                    &["origins", name, "orientation", "from"],
                    body,
                    self.raw.bodies.keys(),
                );
                Orientation::FromBody(body.clone())
            }
            None => {
                if axes < 2 {
                    self.key_problem(&["origins", name], format!("origin `{name}` has {axes} swept axes: its orientation is open"), "give two `axes`, or `orientation: {from: <body>}` to take it from the URDF");
                }
                Orientation::Axes
            }
        }
    }

    fn point(&mut self, name: &str, raw: &RawOrigin, axes: usize) -> Option<PointChoice> {
        match &raw.point {
            Some(RawPoint::NominalDistanceFrom(origin)) => {
                self.known(
                    &["origins", name, "point", "nominal_distance_from"],
                    origin,
                    self.raw.origins.keys(),
                );
                if origin == name {
                    self.problem(
                        &["origins", name, "point"],
                        "an origin cannot be its own reference",
                        "name another origin",
                    );
                }
                Some(PointChoice::NominalDistanceFrom(origin.clone()))
            }
            Some(RawPoint::FromBodyMm(distance)) => Some(PointChoice::FromBody(distance * MM)),
            None => {
                if axes == 1 {
                    self.key_problem(&["origins", name], format!("origin `{name}` sweeps one axis: only a line can be observed, not a point on it"), "choose the point with `point: {from_body_mm: 0}` or `point: {nominal_distance_from: <origin>}`");
                }
                None
            }
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
                .and_then(|joint| self.joint_at(&path, joint));
            if let (Some(joint), Some(joint_name)) = (correct, &t.correct) {
                if self.robot.joint(joint).kind != JointKind::Fixed {
                    self.problem(
                        &path,
                        format!("joint `{joint_name}` moves"),
                        "name a fixed joint, e.g. the one that stands the robot on its table",
                    );
                }
                if !self
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
            transforms.insert(
                name.clone(),
                LinkTransform {
                    parent,
                    child,
                    correct,
                },
            );
        }
        transforms
    }

    fn loops(&mut self) -> BTreeMap<String, Loop> {
        let raw = self.raw;
        for (name, l) in &raw.loops {
            self.known(&["loops", name, "from"], &l.from, raw.origins.keys());
            self.known(&["loops", name, "to"], &l.to, raw.origins.keys());
            if l.from == l.to {
                self.problem(
                    &["loops", name, "to"],
                    "the loop ends where it starts",
                    "name two different origins",
                );
            }
            if let Some(recording) = &l.recording {
                self.known(
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
            let Some(joint) = self.joint_at(&path, name) else {
                continue;
            };
            let mut coupled_to = Vec::new();
            for other in &exception.coupled_to {
                if let Some(id) = self.joint_at(&["solve", "joints", name, "coupled_to"], other) {
                    coupled_to.push(id);
                }
            }
            for (key, value) in [
                ("sigma_mm", exception.sigma_mm),
                ("sigma_deg", exception.sigma_deg),
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
        ] {
            self.positive(&["solve", "prior", key], value);
        }
        if let Some(sigma) = raw.noise.joint_deg {
            self.not_negative(&["solve", "noise", "joint_deg"], sigma);
        }
        let limits = &raw.limits;
        for loop_name in limits.loop_mean_mm.keys() {
            self.known(
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
            },
            noise: Noise {
                joint: raw.noise.joint_deg.map(|s| s * DEG),
                known: raw.noise.known,
            },
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
        for body in &raw.add_bodies {
            self.known(&["outputs", "add_bodies"], body, self.raw.bodies.keys());
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

    fn simulation(&mut self, raw: &RawSimulate) -> Simulation {
        let mut mounts = BTreeMap::new();
        for (name, mount) in &raw.mounts {
            self.known(&["simulate", "mounts", name], name, self.raw.bodies.keys());
            if let Some(body) = self.raw.bodies.get(name) {
                for marker in &body.markers {
                    if !mount.markers_mm.contains_key(marker) {
                        self.problem(
                            &["simulate", "mounts", name],
                            format!("marker `{marker}` has no place"),
                            "give it under `markers_mm`",
                        );
                    }
                }
            }
            let rigid = pose(&crate::raw::RawPose {
                xyz_mm: mount.xyz_mm,
                rpy_deg: mount.rpy_deg,
            });
            let markers = mount
                .markers_mm
                .iter()
                .map(|(m, p)| (m.clone(), Point3::from(Vector3::from(*p) * MM)))
                .collect();
            mounts.insert(
                name.clone(),
                SimMount {
                    link_from_body: rigid,
                    markers,
                },
            );
        }
        for name in self
            .raw
            .bodies
            .keys()
            .filter(|name| !raw.mounts.contains_key(*name))
        {
            self.problem(
                &["simulate", "mounts"],
                format!("body `{name}` has no simulated mount"),
                format!("add `{name}: {{xyz_mm: […], rpy_deg: […]}}`"),
            );
        }
        let mut fixed: BTreeMap<JointId, Isometry3<f64>> = BTreeMap::new();
        for (joint, change) in &raw.errors.fixed {
            if let Some(id) = self.joint_at(&["simulate", "errors", "fixed", joint], joint) {
                fixed.insert(id, pose(change));
            }
        }
        let mut compliance = BTreeMap::new();
        for (joint, value) in &raw.errors.compliance_deg_per_nm {
            if let Some(id) = self.joint_at(
                &["simulate", "errors", "compliance_deg_per_nm", joint],
                joint,
            ) {
                compliance.insert(id, value * DEG);
            }
        }
        if !(0.0..1.0).contains(&raw.noise.occluded) {
            self.problem(
                &["simulate", "noise", "occluded"],
                format!("{} is no share of lost samples", raw.noise.occluded),
                "give a number from 0 to below 1",
            );
        }
        let mut recordings = BTreeMap::new();
        for (name, protocol) in &raw.recordings {
            self.known(
                &["simulate", "recordings", name],
                name,
                self.raw.recordings.keys(),
            );
            recordings.insert(name.clone(), self.protocol(name, protocol));
        }
        Simulation {
            seed: raw.seed,
            tracker_from_root: pose(&raw.tracker_from_root),
            mounts,
            errors: SimErrors {
                joint_offset: raw.errors.joint_offset_deg * DEG,
                axis: Error3 {
                    position: raw.errors.axis_mm * MM,
                    angle: raw.errors.axis_deg * DEG,
                },
                mount: Error3 {
                    position: raw.errors.mount_mm * MM,
                    angle: raw.errors.mount_deg * DEG,
                },
                fixed,
                compliance,
            },
            noise: SimNoise {
                marker: raw.noise.marker_mm * MM,
                body: Error3 {
                    position: raw.noise.body_mm * MM,
                    angle: raw.noise.body_deg * DEG,
                },
                joint: raw.noise.joint_deg * DEG,
                occluded: raw.noise.occluded,
            },
            recordings,
        }
    }

    fn protocol(&mut self, name: &str, raw: &RawProtocol) -> Protocol {
        let at = |key: &'static str| ["simulate", "recordings", name, key];
        let mut grid = Vec::new();
        for (i, steps) in raw.grid.iter().enumerate() {
            let path = [
                "simulate",
                "recordings",
                name,
                "grid",
                &i.to_string(),
                "joint",
            ];
            if let Some((joint, factor)) = self.joint_key(&path, &steps.joint) {
                self.within_limits(
                    &path,
                    joint,
                    steps.from.min(steps.to) * factor,
                    steps.from.max(steps.to) * factor,
                );
                grid.push((
                    joint,
                    Steps {
                        from: steps.from * factor,
                        to: steps.to * factor,
                        poses: steps.poses,
                    },
                ));
            }
            if steps.poses == 0 {
                self.problem(&path, "a grid of no poses", "give `poses: 1` or more");
            }
        }
        let mut random = BTreeMap::new();
        for (key, range) in &raw.random {
            let path = ["simulate", "recordings", name, "random", key];
            if let Some((joint, factor)) = self.joint_key(&path, key) {
                let (low, high) = (
                    range[0].min(range[1]) * factor,
                    range[0].max(range[1]) * factor,
                );
                self.within_limits(&path, joint, low, high);
                random.insert(joint, (low, high));
            }
        }
        if random.is_empty() != (raw.poses == 0) {
            self.problem(
                &at("poses"),
                "`random` and `poses` belong together",
                "give both or neither",
            );
        }
        if grid.is_empty() == random.is_empty() {
            self.problem(
                &["simulate", "recordings", name],
                "a protocol is either a grid or random poses",
                "give `grid` or `random`, not both",
            );
        }
        let mut repeat_at = None;
        for (key, values) in &raw.repeat_at {
            if let Some((joint, factor)) =
                self.joint_key(&["simulate", "recordings", name, "repeat_at", key], key)
            {
                repeat_at = Some((joint, values.iter().map(|v| v * factor).collect()));
            }
        }
        if raw.repeat_at.len() > 1 {
            self.problem(
                &at("repeat_at"),
                "poses repeat at the values of one joint",
                "name one joint",
            );
        }
        for body in raw.bodies.iter().flatten() {
            self.known(&at("bodies"), body, self.raw.bodies.keys());
        }
        Protocol {
            grid,
            random,
            poses: raw.poses,
            repeat_at,
            hold: self.joint_values(&at("hold"), &raw.hold),
            bodies: raw
                .bodies
                .clone()
                .unwrap_or_else(|| self.raw.bodies.keys().cloned().collect()),
        }
    }

    fn known<'n>(
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

    fn link(&mut self, path: &[&str], name: &str) -> LinkId {
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
    fn joint(&mut self, path: &[&str], name: &str) -> JointId {
        self.joint_at(path, name).unwrap_or(self.any_joint)
    }

    fn joint_at(&mut self, path: &[&str], name: &str) -> Option<JointId> {
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
    fn joint_key(&mut self, path: &[&str], key: &str) -> Option<(JointId, f64)> {
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

    fn joint_values(
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

    fn within_limits(&mut self, path: &[&str], joint: JointId, low: f64, high: f64) {
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

    fn rigidly_joined(&self, a: LinkId, b: LinkId) -> bool {
        self.robot
            .chain(a, b)
            .iter()
            .all(|step| self.robot.joint(step.joint).kind == JointKind::Fixed)
    }

    fn positive(&mut self, path: &[&str], value: f64) {
        if !(value.is_finite() && value > 0.0) {
            self.problem(
                path,
                format!("{value} is no standard deviation"),
                "give a number above 0",
            );
        }
    }

    fn not_negative(&mut self, path: &[&str], value: f64) {
        if !(value.is_finite() && value >= 0.0) {
            self.problem(
                path,
                format!("{value} is no noise level"),
                "give 0 or a number above",
            );
        }
    }
}

fn axis_label(label: &str) -> Option<Vector3<f64>> {
    let (sign, name) = match label.strip_prefix('-') {
        Some(rest) => (-1.0, rest),
        None => (1.0, label),
    };
    let axis = match name {
        "x" => Vector3::x(),
        "y" => Vector3::y(),
        "z" => Vector3::z(),
        _ => return None,
    };
    Some(axis * sign)
}
