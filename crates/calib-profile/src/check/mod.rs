//! `RawProfile` → `Profile`: every name resolved, every unit converted, every contradiction named.

use std::collections::{BTreeMap, BTreeSet};

use calib_files::{NameFault, check_name};
use calib_urdf::{JointId, JointKind, LinkId, RobotModel};
use nalgebra::{Isometry3, Point3, Translation3, Unit, Vector3};

use crate::error::{Problem, ProfileError, escaped, expected, one_of};
use crate::locate::{Place, Places};
use crate::profile::{FromRoot, Outputs, Profile, SightSigma, Tracker};
use crate::raw::{RawFree, RawFromRoot, RawPose, RawProfile};
use crate::slip;
use crate::units::{DEG, MM, split_joint_key};

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
    let places = Places::of(text);
    let hidden = places.hidden().into_iter();
    let of_path = |place| escaped(text, place).filter(|_| slip::is_path(text, place));
    let hidden = hidden.map(|hidden| of_path(hidden.0).unwrap_or_else(|| hides(hidden)));
    let hidden: Vec<Problem> = hidden.collect();
    if !hidden.is_empty() {
        return Err(ProfileError::new(file, text, hidden));
    }
    let mut checker = Checker {
        raw,
        robot,
        places,
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

/// A text that shows something else than it is, on a terminal, in a report or in a table.
fn hides((place, c): (Place, char)) -> Problem {
    let what = match c {
        '\n' | '\r' => "a line break".to_owned(),
        '\t' => "a tab".to_owned(),
        c => format!("the character U+{:04X}, which is not shown", u32::from(c)),
    };
    let finding = format!("this text has {what}");
    Problem::new(
        Some(place),
        finding,
        "write names without control characters",
    )
}

mod body;
mod columns;
mod contact;
mod load;
mod names;
mod origin;
mod plan;
mod recording;
mod simulate;
mod solve;
mod transform;

/// A name that does not resolve is excluded from the checked profile, and nothing is concluded from it: one typo
/// yields exactly one diagnostic. A profile with problems is never returned.
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
            ("marker_sight_sigma_mm", raw.tracker.marker_sight_sigma_mm),
            ("body_sight_sigma_mm", raw.tracker.body_sight_sigma_mm),
            ("body_sight_sigma_deg", raw.tracker.body_sight_sigma_deg),
        ] {
            if let Some(value) = value {
                self.positive(&["tracker", key], value);
            }
        }
        self.tracker_frame();
        Profile {
            robot: raw.robot.name.clone(),
            urdf: raw.robot.urdf.clone(),
            packages: raw.robot.packages.clone(),
            identification: raw.identification.clone(),
            load: self.load(),
            tracker: Tracker {
                frame: raw.tracker.frame.clone(),
                marker_sigma: raw.tracker.marker_sigma_mm.map(|s| s * MM),
                body_sigma: raw.tracker.body_sigma_mm.map(|s| s * MM),
                body_sigma_rad: raw.tracker.body_sigma_deg.map(|s| s * DEG),
                sight: SightSigma {
                    marker: raw.tracker.marker_sight_sigma_mm.map(|s| s * MM),
                    body: raw.tracker.body_sight_sigma_mm.map(|s| s * MM),
                    body_rad: raw.tracker.body_sight_sigma_deg.map(|s| s * DEG),
                },
                up_axis: raw.tracker.up_axis,
                from_root: raw
                    .tracker
                    .from_root
                    .as_ref()
                    .map(|f| self.measured_root(f)),
            },
            bodies: self.bodies(),
            names: self.tracker_names(),
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
            plan: self.plan(&raw.plan),
            simulate: raw.simulate.as_ref().map(|s| self.simulation(s)),
        }
    }

    /// Where the root was measured to be.
    fn measured_root(&mut self, raw: &RawFromRoot) -> FromRoot {
        for (key, value) in [("sigma_mm", raw.sigma_mm), ("sigma_deg", raw.sigma_deg)] {
            self.positive(&["tracker", "from_root", key], value);
        }
        if self.raw.bodies.is_empty() {
            self.key_problem(
                &["tracker", "from_root"],
                "no body is tracked, so nothing relates the tracker to the robot",
                "remove the key, or declare a body",
            );
        }
        if !self.raw.solve.free.contains(&RawFree::Tracker) {
            self.key_problem(
                &["tracker", "from_root"],
                "`tracker` is not free, so the measured pose would be ignored",
                "add `tracker` to `solve.free`",
            );
        }
        FromRoot {
            pose: pose(&RawPose {
                xyz_mm: raw.xyz_mm,
                rpy_deg: raw.rpy_deg,
            }),
            sigma: raw.sigma_mm * MM,
            sigma_rad: raw.sigma_deg * DEG,
        }
    }

    fn outputs(&mut self) -> Outputs {
        let raw = &self.raw.outputs;
        for (i, body) in raw.add_bodies.iter().enumerate() {
            let path = ["outputs", "add_bodies", &i.to_string()];
            self.known("body", &path, body, self.raw.bodies.keys());
        }
        for (i, point) in raw.add_points.iter().enumerate() {
            let path = ["outputs", "add_points", &i.to_string()];
            self.known("point", &path, point, self.raw.points.keys());
        }
        let named = |name: &Option<String>, suffix: &str| {
            name.clone()
                .unwrap_or_else(|| format!("{}{suffix}", self.raw.robot.name))
        };
        let outputs = Outputs {
            urdf: named(&raw.urdf, ".calibrated.urdf"),
            scene: named(&raw.scene, ".scene.json"),
            add_bodies: raw.add_bodies.clone(),
            add_points: raw.add_points.clone(),
            reports: raw.reports.clone(),
        };
        let own = [("urdf", &raw.urdf), ("scene", &raw.scene)];
        for (key, name) in own {
            let (path, name) = match name {
                Some(name) => (["outputs", key], name),
                None => (["robot", "name"], &self.raw.robot.name),
            };
            let Err(fault) = check_name(name) else {
                continue;
            };
            let found = match fault {
                NameFault::Separator if path[0] == "outputs" => format!("`{name}` is a path"),
                fault => format!("no file can be named {name:?}: {fault}"),
            };
            let remedy = match path[0] {
                "outputs" => "give a file name; `--out` chooses the folder",
                _ => "rename the robot, or name the files under `outputs`",
            };
            self.problem(&path, found, remedy);
        }
        outputs
    }
}

/// URDF convention: fixed-axis roll, pitch, yaw.
fn pose(raw: &RawPose) -> Isometry3<f64> {
    let rpy = Vector3::from(raw.rpy_deg) * DEG;
    Isometry3::from_parts(
        Translation3::from(Vector3::from(raw.xyz_mm) * MM),
        calib_urdf::rpy::rotation_from_rpy(&rpy),
    )
}
