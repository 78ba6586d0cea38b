//! What differs between two URDF: as numbers, as a table, as lines.
//!
//! Joints are matched by name. The change of an origin is `a_joint_from_b_joint = a_origin⁻¹ · b_origin`; its
//! translation is given in the parent link's axes, as the `xyz` of the file is, its rotation as one angle.

use crate::error::ReadError;
use crate::kinematics::rpy::angle_between;
use crate::model::{Joint, JointLimits, Mimic, RobotModel};
use nalgebra::Isometry3;
use serde::Serialize;
use std::fmt::{self, Write};

/// Changes under this are rounding of the text: 1e-9 mm.
const SAME_MM: f64 = 1e-9;
/// Changes under this are rounding of the text: 1e-10°.
const SAME_DEG: f64 = 1e-10;

/// Everything that differs between two robots, `a` before and `b` after; empty lists where nothing does.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ModelDiff {
    /// The joints that both have and that differ, in the order of `a`.
    pub joints: Vec<JointDiff>,
    /// Links only in `b`.
    pub added_links: Vec<String>,
    /// Links only in `a`.
    pub removed_links: Vec<String>,
    /// Joints only in `b`.
    pub added_joints: Vec<String>,
    /// Joints only in `a`.
    pub removed_joints: Vec<String>,
    /// Links of both whose mass (kg) or center of mass differs.
    pub inertials: Vec<String>,
    /// The robot's name before and after, where it differs.
    pub name: Option<Changed<String>>,
    /// The root link before and after, where it differs.
    pub root: Option<Changed<String>>,
    /// Joints whose origin could not be compared: xacro computes it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_compared: Vec<String>,
}

/// Before and after.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Changed<T> {
    /// Before.
    pub from: T,
    /// After.
    pub to: T,
}

/// How one joint differs.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct JointDiff {
    /// Its name.
    pub joint: String,
    /// Change of the origin in the parent link's axes, mm.
    pub translation_mm: [f64; 3],
    /// Its length, mm.
    pub distance_mm: f64,
    /// Angle between the two orientations of the joint's frame, degrees.
    pub rotation_deg: f64,
    /// Angle between the two axes in the joint's frame, degrees, where both joints have one and it differs.
    pub axis_deg: Option<f64>,
    /// `revolute` and the like.
    pub kind: Option<Changed<&'static str>>,
    /// The parent link.
    pub parent: Option<Changed<String>>,
    /// The child link.
    pub child: Option<Changed<String>>,
    /// Limits, rad or m; null where the file gives none.
    pub limits: Option<Changed<JointLimits>>,
    /// The mimic law.
    pub mimic: Option<Changed<String>>,
}

impl JointDiff {
    fn origin_moved(&self) -> bool {
        self.distance_mm > SAME_MM || self.rotation_deg > SAME_DEG
    }

    fn is_empty(&self) -> bool {
        !self.origin_moved()
            && self.axis_deg.is_none()
            && self.kind.is_none()
            && self.parent.is_none()
            && self.child.is_none()
            && self.limits.is_none()
            && self.mimic.is_none()
    }
}

/// What differs between two URDF texts, each with the name that stands in messages about it.
///
/// # Errors
/// [`ReadError`] of the first text that cannot be read.
pub fn diff(
    a_text: &str,
    a_name: &str,
    b_text: &str,
    b_name: &str,
) -> Result<ModelDiff, ReadError> {
    let a = RobotModel::from_urdf_text(a_text, a_name)?;
    let b = RobotModel::from_urdf_text(b_text, b_name)?;
    Ok(diff_models(&a, &b))
}

/// What differs between two robots.
#[must_use]
pub fn diff_models(a: &RobotModel, b: &RobotModel) -> ModelDiff {
    let missing = |of: &RobotModel, names: Vec<&String>, link: bool| -> Vec<String> {
        let has = |name: &str| {
            if link {
                of.link_ids.contains_key(name)
            } else {
                of.joint_ids.contains_key(name)
            }
        };
        names
            .into_iter()
            .filter(|name| !has(name))
            .cloned()
            .collect()
    };
    let joints = a.joints().iter().filter_map(|before| {
        let after = b.joint(*b.joint_ids.get(&before.name)?);
        Some(diff_joint(a, before, b, after)).filter(|joint| !joint.is_empty())
    });
    let inertials = a.links().iter().filter(|before| {
        b.link_ids
            .get(&before.name)
            .is_some_and(|id| b.link(*id).inertial != before.inertial)
    });
    ModelDiff {
        joints: joints.collect(),
        added_links: missing(a, b.links().iter().map(|link| &link.name).collect(), true),
        removed_links: missing(b, a.links().iter().map(|link| &link.name).collect(), true),
        added_joints: missing(
            a,
            b.joints().iter().map(|joint| &joint.name).collect(),
            false,
        ),
        removed_joints: missing(
            b,
            a.joints().iter().map(|joint| &joint.name).collect(),
            false,
        ),
        inertials: inertials.map(|link| link.name.clone()).collect(),
        name: changed(a.name().to_owned(), b.name().to_owned()),
        root: changed(a.link(a.root()).name.clone(), b.link(b.root()).name.clone()),
        not_compared: Vec::new(),
    }
}

/// What differs between two lists of origins, `parent_link_from_joint` by joint: all that a xacro or a kinematics YAML tells.
#[must_use]
pub fn diff_origins(a: &[(String, Isometry3<f64>)], b: &[(String, Isometry3<f64>)]) -> ModelDiff {
    let without = |these: &[(String, Isometry3<f64>)], those: &[(String, Isometry3<f64>)]| {
        these
            .iter()
            .filter(|(name, _)| !those.iter().any(|(other, _)| other == name))
            .map(|(name, _)| name.clone())
            .collect()
    };
    let joints = a.iter().filter_map(|(name, from)| {
        let (_, to) = b.iter().find(|(other, _)| other == name)?;
        Some(moved(name, from, to)).filter(|joint| !joint.is_empty())
    });
    ModelDiff {
        joints: joints.collect(),
        added_links: Vec::new(),
        removed_links: Vec::new(),
        added_joints: without(b, a),
        removed_joints: without(a, b),
        inertials: Vec::new(),
        name: None,
        root: None,
        not_compared: Vec::new(),
    }
}

/// A joint whose origin changes and nothing else.
fn moved(joint: &str, from: &Isometry3<f64>, to: &Isometry3<f64>) -> JointDiff {
    let translation = (to.translation.vector - from.translation.vector) * 1e3;
    JointDiff {
        joint: joint.to_owned(),
        translation_mm: translation.into(),
        distance_mm: translation.norm(),
        rotation_deg: angle_between(&from.rotation, &to.rotation).to_degrees(),
        axis_deg: None,
        kind: None,
        parent: None,
        child: None,
        limits: None,
        mimic: None,
    }
}

fn changed<T: PartialEq>(from: T, to: T) -> Option<Changed<T>> {
    (from != to).then_some(Changed { from, to })
}

fn diff_joint(a: &RobotModel, before: &Joint, b: &RobotModel, after: &Joint) -> JointDiff {
    let (from, to) = (
        &before.parent_link_from_joint,
        &after.parent_link_from_joint,
    );
    let axis_deg = match (before.kind.axis(), after.kind.axis()) {
        (Some(from), Some(to)) => {
            let angle = from.cross(&to).norm().atan2(from.dot(&to)).to_degrees();
            (angle > SAME_DEG).then_some(angle)
        }
        _ => None,
    };
    JointDiff {
        axis_deg,
        kind: changed(before.kind.name(), after.kind.name()),
        parent: changed(
            a.link(before.parent).name.clone(),
            b.link(after.parent).name.clone(),
        ),
        child: changed(
            a.link(before.child).name.clone(),
            b.link(after.child).name.clone(),
        ),
        limits: changed(before.limits, after.limits),
        mimic: changed(mimic_text(a, before.mimic), mimic_text(b, after.mimic)),
        ..moved(&before.name, from, to)
    }
}

/// The limits that differ, one line each.
fn limit_changes(
    change: &Changed<JointLimits>,
) -> impl Iterator<Item = (&'static str, String, String)> {
    let (a, b) = (change.from, change.to);
    let text =
        |limit: Option<f64>| limit.map_or_else(|| "none".to_owned(), |limit| limit.to_string());
    [
        ("lower limit", a.lower, b.lower),
        ("upper limit", a.upper, b.upper),
        ("effort limit", a.effort, b.effort),
        ("velocity limit", a.velocity, b.velocity),
    ]
    .into_iter()
    .filter(|(_, from, to)| from != to)
    .map(move |(what, from, to)| (what, text(from), text(to)))
}

fn mimic_text(model: &RobotModel, mimic: Option<Mimic>) -> String {
    mimic.map_or_else(
        || "none".to_owned(),
        |law| {
            format!(
                "{} · {} + {}",
                law.multiplier,
                model.joint(law.joint).name,
                law.offset
            )
        },
    )
}

impl ModelDiff {
    /// Is nothing different that kinematics, limits or gravity would notice?
    #[must_use]
    pub fn is_empty(&self) -> bool {
        let nothing = |lists: [&Vec<String>; 6]| lists.iter().all(|list| list.is_empty());
        self.joints.is_empty()
            && nothing([
                &self.added_links,
                &self.removed_links,
                &self.added_joints,
                &self.removed_joints,
                &self.inertials,
                &self.not_compared,
            ])
            && self.name.is_none()
            && self.root.is_none()
    }
}

/// A table for people: moved origins first, with mm and degrees, then everything else, one line each.
impl fmt::Display for ModelDiff {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return writeln!(f, "no differences");
        }
        let moved: Vec<&JointDiff> = self
            .joints
            .iter()
            .filter(|joint| joint.origin_moved())
            .collect();
        if !moved.is_empty() {
            let width = moved
                .iter()
                .map(|joint| joint.joint.chars().count())
                .max()
                .unwrap_or(0)
                .max("joint".len());
            writeln!(
                f,
                "{:width$}  {:>9} {:>9} {:>9} {:>9} {:>9}",
                "joint", "Δx mm", "Δy mm", "Δz mm", "|Δ| mm", "rotation °"
            )?;
            for joint in moved {
                let [x, y, z] = joint.translation_mm.map(plain_zero);
                writeln!(
                    f,
                    "{:width$}  {x:>9.3} {y:>9.3} {z:>9.3} {:>9.3} {:>9.4}",
                    joint.joint, joint.distance_mm, joint.rotation_deg
                )?;
            }
        }
        let mut lines = String::new();
        let mut line = |subject: &str, what: &str, from: &str, to: &str| {
            writeln!(lines, "{subject}: {what} {from} → {to}")
        };
        if let Some(name) = &self.name {
            line("robot", "name", &name.from, &name.to)?;
        }
        if let Some(root) = &self.root {
            line("robot", "root link", &root.from, &root.to)?;
        }
        for joint in &self.joints {
            if let Some(kind) = &joint.kind {
                line(&joint.joint, "type", kind.from, kind.to)?;
            }
            let texts = [
                ("parent", &joint.parent),
                ("child", &joint.child),
                ("mimic", &joint.mimic),
            ];
            for (what, change) in texts {
                if let Some(change) = change {
                    line(&joint.joint, what, &change.from, &change.to)?;
                }
            }
        }
        for joint in &self.joints {
            for (what, from, to) in joint.limits.iter().flat_map(limit_changes) {
                writeln!(lines, "{}: {what} {from} → {to}", joint.joint)?;
            }
            if let Some(angle) = joint.axis_deg {
                writeln!(lines, "{}: axis turned by {angle:.4}°", joint.joint)?;
            }
        }
        let lists = [
            ("added links", &self.added_links),
            ("removed links", &self.removed_links),
            ("added joints", &self.added_joints),
            ("removed joints", &self.removed_joints),
            ("mass or center of mass changed", &self.inertials),
            ("not compared, xacro computes them", &self.not_compared),
        ];
        for (what, names) in lists {
            if !names.is_empty() {
                writeln!(lines, "{what}: {}", names.join(", "))?;
            }
        }
        f.write_str(&lines)
    }
}

/// No `-0.000` in a table.
fn plain_zero(mm: f64) -> f64 {
    if mm.abs() < 5e-4 { 0.0 } else { mm }
}

/// The differing lines of two texts in the unified format, three lines of context; empty when they are equal.
#[must_use]
pub fn unified(a_text: &str, a_name: &str, b_text: &str, b_name: &str) -> String {
    if a_text == b_text {
        return String::new();
    }
    similar::TextDiff::from_lines(a_text, b_text)
        .unified_diff()
        .context_radius(3)
        .header(a_name, b_name)
        .to_string()
}
