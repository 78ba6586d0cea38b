//! Origins of joints in a YAML file: the `kinematics_params` of a UR arm, or any file with the same keys.
//!
//! ```text
//! kinematics:
//!   shoulder: {x: 0, y: 0, z: 0.1625, roll: 0, pitch: 0, yaw: 0}      ur_description: joint shoulder_pan_joint
//!   …
//!   hash: calib_7273392255357398276                                    kept as it is
//! joints:
//!   elbow: {xyz: [0.4, 0, 0], rpy: [0, 0, 0]}                          the joint's own name
//! ```
//!
//! Lengths m, angles rad, `parent_link_from_joint` as in a URDF's `<origin>`. A key counts as a joint where its value has
//! any of these numbers; a number that is not there is 0.

use crate::edit::change::{Change, UrdfEdit};
use crate::edit::decimal::{Splice, decimal, same_number};
use crate::edit::error::EditError;
use crate::edit::patch::{Patched, PatchedFiles};
use crate::edit::rotation::rpy_for;
use crate::error::{Hint, Place};
use crate::kinematics::rpy::rotation_from_rpy;
use crate::read::numbers::parse_numbers;
use crate::yaml::{YamlKind, YamlNode, parse};
use calib_finding::nearest_word;
use nalgebra::{Isometry3, Translation3, Vector3};
use std::collections::BTreeMap;
use std::ops::Range;

/// ur_description's keys below `kinematics`, and the end of the joint's name that each stands for.
const UR: [(&str, &str); 6] = [
    ("shoulder", "shoulder_pan_joint"),
    ("upper_arm", "shoulder_lift_joint"),
    ("forearm", "elbow_joint"),
    ("wrist_1", "wrist_1_joint"),
    ("wrist_2", "wrist_2_joint"),
    ("wrist_3", "wrist_3_joint"),
];

/// The numbers of an origin: key, place in the list under that key, place among x y z roll pitch yaw.
const NUMBERS: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];

/// An origin that a YAML file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct YamlOrigin {
    /// The key.
    pub key: String,
    /// The line of its first number, from 1.
    pub line: usize,
    /// `parent_link_from_joint`.
    pub parent_link_from_joint: Isometry3<f64>,
}

impl YamlOrigin {
    /// Is this the origin of that joint: by its own name, or by the name that a UR arm's driver gives it?
    #[must_use]
    pub fn is_of(&self, joint: &str) -> bool {
        self.key == joint || ur_key(joint) == Some(self.key.as_str())
    }
}

/// The origins of a YAML text, in its order; empty for a file that has none.
///
/// # Errors
/// [`EditError::Yaml`] for a text that is not YAML, [`EditError::YamlValue`] for an origin whose numbers cannot be read.
pub fn yaml_origins(text: &str, name_for_errors: &str) -> Result<Vec<YamlOrigin>, EditError> {
    let tree = parse(text, name_for_errors)?;
    let mut found = Vec::new();
    collect(&tree, &mut found);
    found
        .into_iter()
        .map(|(key, node)| {
            let slots = slots(text, name_for_errors, key, key, node)?;
            let numbers = slots
                .clone()
                .map(|slot| slot.map_or(0.0, |(_, value)| value));
            let line = slots
                .iter()
                .flatten()
                .next()
                .map_or(0, |(range, _)| Place::of_byte(text, range.start).line);
            Ok(YamlOrigin {
                key: key.to_owned(),
                line,
                parent_link_from_joint: pose(numbers),
            })
        })
        .collect()
}

/// Sets origins of joints in a YAML's text; every byte but those of the changed numbers stays.
///
/// # Errors
/// [`EditError`]: no YAML, a joint that is not there or in several places, a number that is none or that others share.
pub fn patch_yaml(
    text: &str,
    name_for_errors: &str,
    edits: &[UrdfEdit],
) -> Result<PatchedFiles, EditError> {
    let file = name_for_errors;
    let tree = parse(text, file)?;
    let mut all = Vec::new();
    collect(&tree, &mut all);
    let (mut changes, mut splices) = (Vec::new(), Vec::new());
    let mut before = BTreeMap::new();
    for edit in edits {
        let UrdfEdit::SetOrigin {
            joint,
            parent_link_from_joint: wanted,
        } = edit
        else {
            return Err(EditError::YamlOnlyOrigins {
                file: file.to_owned(),
            });
        };
        let finite = wanted.to_homogeneous().iter().all(|x| x.is_finite());
        if !finite {
            return Err(EditError::NotFinite {
                joint: joint.clone(),
                what: "origin",
            });
        }
        if before.contains_key(joint) {
            return Err(EditError::EditedTwice {
                joint: joint.clone(),
                what: "origin",
            });
        }
        let (key, node) = of_joint(&all, text, file, joint)?;
        let slots = slots(text, file, joint, key, node)?;
        let old = slots
            .clone()
            .map(|slot| slot.map_or(0.0, |(_, value)| value));
        before.insert(joint.clone(), pose(old));
        let rpy = rpy_for(&wanted.rotation, [old[3], old[4], old[5]]);
        let new: Vec<f64> = wanted
            .translation
            .vector
            .iter()
            .copied()
            .chain(rpy)
            .collect();
        for ((slot, name), (old, new)) in slots.iter().zip(NUMBERS).zip(old.iter().zip(&new)) {
            if same_number(*old, *new) {
                continue;
            }
            let Some((range, _)) = slot else {
                return Err(EditError::YamlValue {
                    file: file.to_owned(),
                    place: Place::of_byte(text, node.range.start),
                    joint: joint.clone(),
                    keys: format!("{key}.{name}"),
                    fault: "the key is missing",
                });
            };
            changes.push(Change {
                line: Place::of_byte(text, range.start).line,
                joint: joint.clone(),
                attribute: format!("{key}.{name}"),
                old: text[range.clone()].to_owned(),
                new: decimal(*new),
            });
            splices.push(Splice {
                range: range.clone(),
                new: decimal(*new),
            });
        }
    }
    let patched = Patched::of(text, changes, splices);
    reread(&patched.text, file, edits)?;
    Ok(PatchedFiles {
        main: patched,
        yaml: Vec::new(),
        before,
    })
}

/// The patched text has to hold what was asked for.
fn reread(text: &str, file: &str, edits: &[UrdfEdit]) -> Result<(), EditError> {
    let tree = parse(text, file)?;
    let mut all = Vec::new();
    collect(&tree, &mut all);
    for edit in edits {
        let UrdfEdit::SetOrigin {
            joint,
            parent_link_from_joint: wanted,
        } = edit
        else {
            continue;
        };
        let (key, node) = of_joint(&all, text, file, joint)?;
        let slots = slots(text, file, joint, key, node)?;
        let found = pose(slots.map(|slot| slot.map_or(0.0, |(_, value)| value)));
        let off = found.inverse() * wanted;
        let (far, turned) = (off.translation.vector.norm(), off.rotation.angle());
        let size = wanted.translation.vector.norm().max(1.0);
        if !(far <= crate::edit::verify::POSITION_TOLERANCE * size
            && turned <= crate::edit::verify::ROTATION_TOLERANCE)
        {
            return Err(EditError::StructureChanged {
                file: file.to_owned(),
                what: format!("the origin of `{joint}` is {far:.1e} m and {turned:.1e} rad off"),
            });
        }
    }
    Ok(())
}

/// Every key whose value holds numbers of an origin, in the order of the file.
fn collect<'a>(node: &'a YamlNode, found: &mut Vec<(&'a str, &'a YamlNode)>) {
    for (key, value) in node.entries() {
        let is_origin = NUMBERS
            .iter()
            .chain(&["xyz", "rpy"])
            .any(|number| value.get(number).0.is_some_and(|n| n.entries().is_empty()));
        if is_origin {
            found.push((key, value));
        } else {
            collect(value, found);
        }
    }
    if let YamlKind::List(items) = &node.kind {
        for item in items {
            collect(item, found);
        }
    }
}

/// ur_description's key for a joint of a UR arm, whatever stands before its name: `left_elbow_joint` is `forearm`.
#[must_use]
pub fn ur_key(joint: &str) -> Option<&'static str> {
    UR.iter()
        .find(|(_, end)| joint.ends_with(end))
        .map(|(key, _)| *key)
}

fn of_joint<'a>(
    all: &[(&'a str, &'a YamlNode)],
    text: &str,
    file: &str,
    joint: &str,
) -> Result<(&'a str, &'a YamlNode), EditError> {
    let named = |name: &str| -> Vec<(&'a str, &'a YamlNode)> {
        all.iter()
            .copied()
            .filter(|(key, _)| *key == name)
            .collect()
    };
    let mut found = named(joint);
    if let (true, Some(alias)) = (found.is_empty(), ur_key(joint)) {
        found = named(alias);
    }
    match found.as_slice() {
        [one] => Ok(*one),
        [] => Err(EditError::YamlNoJoint {
            file: file.to_owned(),
            joint: joint.to_owned(),
            keys: match ur_key(joint) {
                Some(alias) => format!("`{joint}` or `{alias}`"),
                None => format!("`{joint}`"),
            },
            hint: Hint(nearest_word(joint, all.iter().map(|(key, _)| *key)).map(str::to_owned)),
        }),
        several => Err(EditError::YamlSeveral {
            file: file.to_owned(),
            joint: joint.to_owned(),
            lines: several
                .iter()
                .map(|(_, node)| Place::of_byte(text, node.range.start).line)
                .collect(),
        }),
    }
}

/// Bytes and value of one number.
type Slot = Option<(Range<usize>, f64)>;

/// Where x, y, z, roll, pitch, yaw stand; `None` where a number is not written.
fn slots(
    text: &str,
    file: &str,
    joint: &str,
    key: &str,
    node: &YamlNode,
) -> Result<[Slot; 6], EditError> {
    let bad = |at: &YamlNode, what: &str, fault: &'static str| EditError::YamlValue {
        file: file.to_owned(),
        place: Place::of_byte(text, at.range.start),
        joint: joint.to_owned(),
        keys: format!("{key}.{what}"),
        fault,
    };
    if node.anchored || node.get("<<").0.is_some() {
        return Err(bad(
            node,
            "*",
            "it has an anchor or takes keys from another (`<<`), so that others share it",
        ));
    }
    let number = |at: &YamlNode, what: &str| -> Result<(Range<usize>, f64), EditError> {
        if at.anchored || at.kind == YamlKind::Alias {
            return Err(bad(at, what, "it has an anchor, so that others share it"));
        }
        match &at.kind {
            YamlKind::Scalar { text, plain: true } => parse_numbers::<1>(text)
                .map(|[value]| (at.range.clone(), value))
                .map_err(|_| bad(at, what, "it is not a number")),
            YamlKind::Scalar { .. } => Err(bad(at, what, "it has quotes, a tag or a block style")),
            _ => Err(bad(at, what, "it is not a number")),
        }
    };
    let mut slots: [Slot; 6] = Default::default();
    for (k, name) in NUMBERS.into_iter().enumerate() {
        let (value, times) = node.get(name);
        let Some(value) = value else { continue };
        if times > 1 {
            return Err(bad(value, name, "the key stands there twice"));
        }
        slots[k] = Some(number(value, name)?);
    }
    for (name, first) in [("xyz", 0), ("rpy", 3)] {
        let (value, times) = node.get(name);
        let Some(value) = value else { continue };
        if times > 1 || slots[first..first + 3].iter().any(Option::is_some) {
            return Err(bad(value, name, "its numbers are given twice"));
        }
        if value.anchored {
            return Err(bad(
                value,
                name,
                "it has an anchor, so that others share it",
            ));
        }
        let YamlKind::List(items) = &value.kind else {
            return Err(bad(value, name, "it is not a list of three numbers"));
        };
        if items.len() != 3 {
            return Err(bad(value, name, "it is not a list of three numbers"));
        }
        for (k, item) in items.iter().enumerate() {
            slots[first + k] = Some(number(item, name)?);
        }
    }
    Ok(slots)
}

fn pose(numbers: [f64; 6]) -> Isometry3<f64> {
    let [x, y, z, roll, pitch, yaw] = numbers;
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        rotation_from_rpy(&Vector3::new(roll, pitch, yaw)),
    )
}
