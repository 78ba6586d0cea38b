//! Edits of a URDF's text: the bytes that do not have to change, do not change.
//!
//! An attribute's numbers are replaced one by one through the byte ranges that the parser gives. Missing `<origin>`,
//! `<axis>` and attributes are inserted in the style of their neighbours (indentation, line ending, quotes). The text of a
//! number that already is the new one within [`SAME_NUMBER`] stays, so a second patch with the same values changes nothing.

use crate::companions::Companions;
use crate::decimal::{
    SAME_NUMBER, Splice, apply, decimals, same_number, splice_numbers, tidy_angle,
};
use crate::edit::{Change, EditError, UrdfEdit};
use crate::error::{Place, Problem, ReadError, ReadProblem};
use crate::insert;
use crate::model::{RobotModel, UnknownName};
use crate::numbers::parse_numbers;
use crate::revert::ChangeRecord;
use crate::rpy::{angle_between, rotation_from_rpy, rpy_from_rotation, rpy_near};
use crate::source::{child, has_quaternions, parse, top_level, value_range, xacro_evidence};
use crate::xacro;
use crate::xacro_value::{self, Context, Unwritable};
use crate::yaml::{self, YamlNode};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3, Vector4};
use roxmltree::{Document, Node};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// A patched text and what is different in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Patched {
    /// The new text.
    pub text: String,
    /// Attribute by attribute, in the order of the file.
    pub changes: Vec<Change>,
    /// The replaced byte ranges of the original, sorted, not overlapping.
    pub splices: Vec<Splice>,
}

/// What [`patch_with`] makes of a text and of the files that it reads.
#[derive(Debug, Clone, PartialEq)]
pub struct PatchedFiles {
    /// The text itself.
    pub main: Patched,
    /// YAML files that changed: their place in [`Companions::yaml`].
    pub yaml: Vec<(usize, Patched)>,
    /// The origins as the texts had them, `parent_link_from_joint` by joint, of all joints that the edits name.
    pub before: BTreeMap<String, Isometry3<f64>>,
}

/// Makes the edits in a URDF's text, or in a xacro's where the text is literal.
///
/// For a URDF, the result is read again and compared with the request ([`crate::verify()`]) before it is returned.
///
/// # Errors
/// [`EditError`]: an unreadable text, an unknown name, a number that is not finite, a text that xacro computes.
pub fn patch(text: &str, name_for_errors: &str, edits: &[UrdfEdit]) -> Result<Patched, EditError> {
    Ok(patch_with(text, name_for_errors, edits, &Companions::default())?.main)
}

/// [`patch()`] of a xacro whose included files and YAML are known: a number that stands in the YAML is replaced there.
///
/// # Errors
/// Those of [`patch()`], and those that begin with `Yaml`.
pub fn patch_with(
    text: &str,
    name_for_errors: &str,
    edits: &[UrdfEdit],
    companions: &Companions,
) -> Result<PatchedFiles, EditError> {
    check_values(edits)?;
    let document = parse(text, name_for_errors)?;
    if xacro_evidence(&document).is_none() {
        let nominal = RobotModel::from_urdf_text(text, name_for_errors)?;
        let patched = splice_edits(text, name_for_errors, &document, false, edits, companions)?;
        crate::verify::verify(
            &patched.main.text,
            &nominal.with_edits(name_for_errors, edits)?,
            name_for_errors,
        )?;
        return Ok(patched);
    }
    // A xacro is not expanded here: the new texts have at least to hold the numbers that were asked for.
    let patched = splice_edits(text, name_for_errors, &document, true, edits, companions)?;
    let again = parse(&patched.main.text, name_for_errors)?;
    let mut around = companions.clone();
    for (file, yaml) in &patched.yaml {
        around.yaml[*file].text.clone_from(&yaml.text);
    }
    let left = splice_edits(
        &patched.main.text,
        name_for_errors,
        &again,
        true,
        edits,
        &around,
    )?;
    let rest = left.yaml.iter().flat_map(|(_, yaml)| &yaml.changes);
    match left.main.changes.iter().chain(rest).next() {
        None => Ok(patched),
        Some(change) => Err(EditError::StructureChanged {
            file: name_for_errors.to_owned(),
            what: format!(
                "`{}` of joint `{}` still reads \"{}\"",
                change.attribute, change.joint, change.old
            ),
        }),
    }
}

/// The edits as splices of the text, without a look at the result.
fn splice_edits(
    text: &str,
    file: &str,
    document: &Document<'_>,
    is_xacro: bool,
    edits: &[UrdfEdit],
    companions: &Companions,
) -> Result<PatchedFiles, EditError> {
    // A YAML that cannot be read matters only where a number is looked for in it.
    let yaml: Vec<_> = companions
        .yaml
        .iter()
        .map(|file| yaml::parse(&file.text, &file.name))
        .collect();
    let mut patcher = Patcher {
        text,
        file,
        document,
        is_xacro,
        companions,
        yaml: &yaml,
        quaternions: has_quaternions(document),
        changes: Vec::new(),
        splices: Vec::new(),
        in_yaml: Vec::new(),
        before: BTreeMap::new(),
    };
    for edit in edits {
        match edit {
            UrdfEdit::SetOrigin {
                joint,
                parent_link_from_joint,
            } => patcher.set_origin(joint, parent_link_from_joint)?,
            UrdfEdit::SetAxis { joint, axis } => patcher.set_axis(joint, axis)?,
            UrdfEdit::SetLimits {
                joint,
                lower,
                upper,
            } => patcher.set_limits(joint, *lower, *upper)?,
            UrdfEdit::AddFixedFrame {
                name,
                parent_link,
                joint_name,
                parent_from_frame,
                comment,
            } => {
                patcher.add_frame(
                    name,
                    parent_link,
                    joint_name,
                    parent_from_frame,
                    comment.as_deref(),
                    edits,
                )?;
            }
            UrdfEdit::AddProvenance { text } => patcher.add_provenance(text),
        }
    }
    let Patcher {
        changes,
        splices,
        in_yaml,
        before,
        ..
    } = patcher;
    let mut by_file: BTreeMap<usize, (Vec<Change>, Vec<Splice>)> = BTreeMap::new();
    for (file, change, splice) in in_yaml {
        let entry = by_file.entry(file).or_default();
        entry.0.push(change);
        entry.1.push(splice);
    }
    Ok(PatchedFiles {
        main: Patched::of(text, changes, splices),
        yaml: by_file
            .into_iter()
            .map(|(file, (changes, splices))| {
                let text = &companions.yaml[file].text;
                (file, Patched::of(text, changes, splices))
            })
            .collect(),
        before,
    })
}

impl Patched {
    /// The patch that a record tells of; `patched_text` is the text that the record belongs to.
    #[must_use]
    pub fn from_record(patched_text: &str, record: &ChangeRecord) -> Self {
        let mut grown: isize = 0;
        let splices = record
            .replacements
            .iter()
            .map(|r| {
                let start = r.at.saturating_add_signed(-grown);
                grown += r.new.len() as isize - r.old.len() as isize;
                Splice {
                    range: start..start + r.old.len(),
                    new: r.new.clone(),
                }
            })
            .collect();
        Self {
            text: patched_text.to_owned(),
            changes: record.changes.clone(),
            splices,
        }
    }

    pub(crate) fn of(text: &str, mut changes: Vec<Change>, mut splices: Vec<Splice>) -> Self {
        // Stable: insertions at one place stay in the order of the edits.
        splices.sort_by_key(|splice| splice.range.start);
        changes.sort_by_key(|change| change.line);
        Self {
            text: apply(text, &splices),
            changes,
            splices,
        }
    }
}

/// Numbers that must not reach a file, and edits that contradict each other.
fn check_values(edits: &[UrdfEdit]) -> Result<(), EditError> {
    let mut seen = BTreeSet::new();
    for edit in edits {
        let (joint, what, finite) = match edit {
            UrdfEdit::SetOrigin {
                joint,
                parent_link_from_joint,
            } => (joint, "origin", is_finite(parent_link_from_joint)),
            UrdfEdit::SetAxis { joint, axis } => {
                (joint, "axis", axis.iter().all(|x| x.is_finite()))
            }
            UrdfEdit::SetLimits {
                joint,
                lower,
                upper,
            } => {
                if lower > upper {
                    let (lower, upper) = (lower.to_string(), upper.to_string());
                    return Err(EditError::LimitsReversed {
                        joint: joint.clone(),
                        lower,
                        upper,
                    });
                }
                (joint, "limits", lower.is_finite() && upper.is_finite())
            }
            UrdfEdit::AddFixedFrame {
                name,
                joint_name,
                parent_from_frame,
                ..
            } => {
                if !seen.insert((name, "link")) {
                    return Err(EditError::FrameTwice { name: name.clone() });
                }
                (joint_name, "origin", is_finite(parent_from_frame))
            }
            UrdfEdit::AddProvenance { .. } => continue,
        };
        if !finite {
            return Err(EditError::NotFinite {
                joint: joint.clone(),
                what,
            });
        }
        if !seen.insert((joint, what)) {
            return Err(EditError::EditedTwice {
                joint: joint.clone(),
                what,
            });
        }
    }
    Ok(())
}

fn is_finite(pose: &Isometry3<f64>) -> bool {
    pose.translation
        .vector
        .iter()
        .chain(pose.rotation.coords.iter())
        .all(|x| x.is_finite())
}

struct Patcher<'t, 'd> {
    text: &'t str,
    file: &'t str,
    document: &'d Document<'t>,
    is_xacro: bool,
    companions: &'d Companions,
    yaml: &'d [Result<YamlNode, EditError>],
    quaternions: bool,
    changes: Vec<Change>,
    splices: Vec<Splice>,
    /// Changes of companions: which one, what, where.
    in_yaml: Vec<(usize, Change, Splice)>,
    /// Origins as read, by joint.
    before: BTreeMap<String, Isometry3<f64>>,
}

impl<'t, 'd> Patcher<'t, 'd> {
    fn place(&self, offset: usize) -> Place {
        Place::of_byte(self.text, offset)
    }

    fn joint(&self, name: &str) -> Result<Node<'d, 't>, EditError> {
        if self.is_xacro {
            return xacro::joint(self.document, self.text, name, self.file);
        }
        top_level(self.document, "joint")
            .find(|node| node.attribute("name") == Some(name))
            .ok_or_else(|| EditError::UnknownName {
                file: self.file.to_owned(),
                source: UnknownName::among(
                    self.document.root_element().attribute("name").unwrap_or(""),
                    "joint",
                    name,
                    top_level(self.document, "joint").filter_map(|node| node.attribute("name")),
                ),
            })
    }

    fn set_origin(&mut self, joint: &str, wanted: &Isometry3<f64>) -> Result<(), EditError> {
        let node = self.joint(joint)?;
        let xyz = wanted.translation.vector;
        let mut before = Isometry3::identity();
        let Some(origin) = child(node, "origin") else {
            self.before.insert(joint.to_owned(), before);
            let rpy = rpy_from_rotation(&wanted.rotation).map(tidy_angle);
            if is_zero(&xyz)
                && angle_between(&wanted.rotation, &UnitQuaternion::identity()) <= SAME_NUMBER
            {
                return Ok(());
            }
            let element = format!(
                "<{}origin xyz=\"{}\" rpy=\"{}\"/>",
                insert::prefix(self.text, node),
                decimals(xyz.as_slice()),
                decimals(rpy.as_slice())
            );
            self.insert_element(node, joint, "origin", element);
            return Ok(());
        };
        self.set_numbers::<3>(origin, joint, "xyz", [0.0; 3], |old| {
            before.translation.vector = old.into();
            xyz.into()
        })?;
        if self.quaternions && origin.has_attribute("quat_xyzw") {
            self.set_numbers::<4>(origin, joint, "quat_xyzw", [0.0, 0.0, 0.0, 1.0], |old| {
                before.rotation =
                    UnitQuaternion::new_normalize(Quaternion::from(Vector4::from(old)));
                quaternion_near(&wanted.rotation, old)
            })?;
        } else {
            self.set_numbers::<3>(origin, joint, "rpy", [0.0; 3], |old| {
                before.rotation = rotation_from_rpy(&Vector3::from(old));
                rpy_for(&wanted.rotation, old)
            })?;
        }
        self.before.insert(joint.to_owned(), before);
        Ok(())
    }

    fn set_axis(&mut self, joint: &str, wanted: &Vector3<f64>) -> Result<(), EditError> {
        let node = self.joint(joint)?;
        if node.attribute("type") == Some("fixed") {
            let place = self.place(node.range().start);
            return Err(EditError::NoAxis {
                file: self.file.to_owned(),
                place,
                joint: joint.to_owned(),
            });
        }
        let keep_direction = |old: [f64; 3]| {
            let old = Vector3::from(old);
            // A text such as "0 2 0" already is this direction.
            let same = (old / old.norm() - wanted).amax() <= SAME_NUMBER;
            if same { old.into() } else { (*wanted).into() }
        };
        match child(node, "axis") {
            Some(axis) => {
                self.set_numbers::<3>(axis, joint, "xyz", [1.0, 0.0, 0.0], keep_direction)
            }
            None if is_zero(&(wanted - Vector3::x())) => Ok(()),
            None => {
                let element = format!(
                    "<{}axis xyz=\"{}\"/>",
                    insert::prefix(self.text, node),
                    decimals(wanted.as_slice())
                );
                self.insert_element(node, joint, "axis", element);
                Ok(())
            }
        }
    }

    fn set_limits(&mut self, joint: &str, lower: f64, upper: f64) -> Result<(), EditError> {
        let node = self.joint(joint)?;
        if let Some(kind @ ("fixed" | "continuous")) = node.attribute("type") {
            return Err(EditError::NoPositionLimits {
                file: self.file.to_owned(),
                place: self.place(node.range().start),
                joint: joint.to_owned(),
                kind: kind.to_owned(),
            });
        }
        let Some(limit) = child(node, "limit") else {
            let place = self.place(node.range().start);
            return Err(EditError::NoLimit {
                file: self.file.to_owned(),
                place,
                joint: joint.to_owned(),
            });
        };
        // NaN: a limit that is not written is written, also when it is 0.
        self.set_numbers::<1>(limit, joint, "lower", [f64::NAN], |_| [lower])?;
        self.set_numbers::<1>(limit, joint, "upper", [f64::NAN], |_| [upper])
    }

    /// Sets the numbers of one attribute; `new` gets the old ones, or `default` where there is no attribute.
    fn set_numbers<const N: usize>(
        &mut self,
        element: Node<'_, '_>,
        joint: &str,
        name: &str,
        default: [f64; N],
        new: impl FnOnce([f64; N]) -> [f64; N],
    ) -> Result<(), EditError> {
        let Some(attribute) = element.attribute_node(name) else {
            let new = new(default);
            if !default
                .iter()
                .zip(&new)
                .all(|(old, new)| same_number(*old, *new))
            {
                self.insert_attribute(element, joint, name, &decimals(&new));
            }
            return Ok(());
        };
        let raw = value_range(self.text, &attribute);
        let value = &self.text[raw.clone()];
        if self.is_xacro && xacro::is_expression(attribute.value()) {
            return self.set_looked_up(element, joint, name, raw, new);
        }
        let old: [f64; N] = parse_numbers(attribute.value()).map_err(|fault| {
            // A URDF was checked before; a xacro was not.
            let problem = Problem::BadNumber {
                owner: format!("joint `{joint}`"),
                attribute: name.to_owned(),
                found: attribute.value().to_owned(),
                expected: "numbers",
                reason: fault.reason,
            };
            ReadError::one(self.file, ReadProblem::at(self.text, raw.start, problem))
        })?;
        let splices = splice_numbers(value, raw.start, &old, &new(old));
        if splices.is_empty() {
            return Ok(());
        }
        let local: Vec<Splice> = splices
            .iter()
            .map(|splice| Splice {
                range: splice.range.start - raw.start..splice.range.end - raw.start,
                new: splice.new.clone(),
            })
            .collect();
        self.changes.push(Change {
            line: self.place(raw.start).line,
            joint: joint.to_owned(),
            attribute: format!("{} {name}", element.tag_name().name()),
            old: value.to_owned(),
            new: apply(value, &local),
        });
        self.splices.extend(splices);
        Ok(())
    }

    /// [`Self::set_numbers`] where xacro computes the attribute, and all it does is to look up values.
    fn set_looked_up<const N: usize>(
        &mut self,
        element: Node<'_, '_>,
        joint: &str,
        name: &str,
        raw: Range<usize>,
        new: impl FnOnce([f64; N]) -> [f64; N],
    ) -> Result<(), EditError> {
        let place = self.place(raw.start);
        let context = Context {
            text: self.text,
            document: self.document,
            companions: self.companions,
            yaml: self.yaml,
        };
        let cells = xacro_value::cells::<N>(&context, raw.clone(), element)
            .map_err(|why| self.unwritable(why, place, joint, name, raw))?;
        let wanted = new(std::array::from_fn(|i| cells[i].value));
        for (cell, wanted) in cells
            .iter()
            .zip(wanted)
            .filter(|(cell, wanted)| !same_number(cell.value, *wanted))
        {
            let mut attribute = format!("{} {name}", element.tag_name().name());
            if let Some(leaf) = &cell.from {
                let readers = xacro_value::readers(&context, leaf);
                if !readers.is_one() {
                    let yaml = cell.yaml.map(|file| &self.companions.yaml[file].name);
                    let bare = leaf.bare_name();
                    return Err(EditError::XacroShared {
                        file: self.file.to_owned(),
                        place,
                        joint: joint.to_owned(),
                        value: match yaml {
                            Some(file) => format!("`{bare}` of {file}"),
                            None => format!("the property `{bare}`"),
                        },
                        lines: readers.lines.into(),
                        included: readers.included.into(),
                    });
                }
                attribute = format!("{attribute} ({})", leaf.name(self.companions));
            }
            let text = match cell.yaml {
                None => self.text,
                Some(file) => &self.companions.yaml[file].text,
            };
            let change = Change {
                line: Place::of_byte(text, cell.range.start).line,
                joint: joint.to_owned(),
                attribute,
                old: text[cell.range.clone()].to_owned(),
                new: decimals(&[wanted]),
            };
            let splice = Splice {
                range: cell.range.clone(),
                new: decimals(&[wanted]),
            };
            match cell.yaml {
                Some(file) => self.in_yaml.push((file, change, splice)),
                None => {
                    self.changes.push(change);
                    self.splices.push(splice);
                }
            }
        }
        Ok(())
    }

    fn unwritable(
        &self,
        why: Unwritable,
        place: Place,
        joint: &str,
        attribute: &str,
        raw: Range<usize>,
    ) -> EditError {
        let file = self.file.to_owned();
        let joint = joint.to_owned();
        match why {
            Unwritable::Computed => EditError::XacroExpression {
                file,
                place,
                joint,
                attribute: attribute.to_owned(),
                found: self.text[raw].to_owned(),
            },
            Unwritable::NotFound(argument) => EditError::XacroYamlNotFound {
                file,
                place,
                joint,
                argument,
            },
            Unwritable::NoYaml(error) => *error,
            Unwritable::BadYaml {
                file: yaml,
                offset,
                keys,
                fault,
            } => {
                let yaml = &self.companions.yaml[yaml];
                EditError::YamlValue {
                    file: yaml.name.clone(),
                    place: Place::of_byte(&yaml.text, offset),
                    joint,
                    keys,
                    fault,
                }
            }
        }
    }

    fn insert_attribute(&mut self, element: Node<'_, '_>, joint: &str, name: &str, value: &str) {
        let (at, text) = insert::attribute(self.text, element, name, value);
        self.changes.push(Change {
            line: self.place(at).line,
            joint: joint.to_owned(),
            attribute: format!("{} {name}", element.tag_name().name()),
            old: String::new(),
            new: value.to_owned(),
        });
        self.splices.push(Splice {
            range: at..at,
            new: text,
        });
    }

    fn insert_element(&mut self, joint: Node<'_, '_>, name: &str, element: &str, text: String) {
        let (at, with_space) = insert::first_child(self.text, joint, &text);
        self.changes.push(Change {
            line: self.place(at).line,
            joint: name.to_owned(),
            attribute: format!("<{element}>"),
            old: String::new(),
            new: text,
        });
        self.splices.push(Splice {
            range: at..at,
            new: with_space,
        });
    }

    fn add_frame(
        &mut self,
        name: &str,
        parent_link: &str,
        joint_name: &str,
        parent_from_frame: &Isometry3<f64>,
        comment: Option<&str>,
        edits: &[UrdfEdit],
    ) -> Result<(), EditError> {
        insert::check_name("link", name)?;
        insert::check_name("joint", joint_name)?;
        let link =
            top_level(self.document, "link").find(|node| node.attribute("name") == Some(name));
        let joint = top_level(self.document, "joint")
            .find(|node| node.attribute("name") == Some(joint_name));
        let names = |node: Node<'_, '_>, element| {
            child(node, element).and_then(|end| end.attribute("link").map(str::to_owned))
        };
        match (link, joint) {
            (None, None) => {}
            (Some(_), Some(node))
                if node.attribute("type") == Some("fixed")
                    && names(node, "parent").as_deref() == Some(parent_link)
                    && names(node, "child").as_deref() == Some(name) =>
            {
                return self.set_origin(joint_name, parent_from_frame);
            }
            (Some(_), _) => {
                return Err(EditError::NameTaken {
                    file: self.file.to_owned(),
                    kind: "link",
                    name: name.to_owned(),
                });
            }
            (None, Some(_)) => {
                return Err(EditError::NameTaken {
                    file: self.file.to_owned(),
                    kind: "joint",
                    name: joint_name.to_owned(),
                });
            }
        }
        let added = edits.iter().filter_map(|edit| match edit {
            UrdfEdit::AddFixedFrame { name, .. } => Some(name.as_str()),
            _ => None,
        });
        let known: Vec<&str> = top_level(self.document, "link")
            .filter_map(|node| node.attribute("name"))
            .chain(added)
            .collect();
        // A xacro may get its links from elsewhere.
        if !self.is_xacro && !known.contains(&parent_link) {
            let robot = self.document.root_element().attribute("name").unwrap_or("");
            let source = UnknownName::among(robot, "link", parent_link, known);
            return Err(EditError::UnknownName {
                file: self.file.to_owned(),
                source,
            });
        }
        let style = insert::Style::of(self.text, self.document);
        let text = style.fixed_frame(name, parent_link, joint_name, parent_from_frame, comment);
        let at = insert::before_closing_tag(self.text, self.document);
        self.changes.push(Change {
            line: self.place(at).line,
            joint: joint_name.to_owned(),
            attribute: "<link>".to_owned(),
            old: String::new(),
            new: text.trim().to_owned(),
        });
        self.splices.push(Splice {
            range: at..at,
            new: text,
        });
        Ok(())
    }

    fn add_provenance(&mut self, text: &str) {
        let style = insert::Style::of(self.text, self.document);
        let comment = insert::comment(text, style.line_ending);
        if self
            .document
            .descendants()
            .any(|node| node.is_comment() && self.text[node.range()] == comment)
        {
            return;
        }
        let at = self.document.root_element().range().start;
        self.changes.push(Change {
            line: self.place(at).line,
            joint: String::new(),
            attribute: "<!-- -->".to_owned(),
            old: String::new(),
            new: comment.clone(),
        });
        self.splices.push(Splice {
            range: at..at,
            new: format!("{comment}{}", style.line_ending),
        });
    }
}

/// The `rpy` of a rotation, as near to the old one as can be.
pub(crate) fn rpy_for(wanted: &UnitQuaternion<f64>, old: [f64; 3]) -> [f64; 3] {
    let old = Vector3::from(old);
    // The rotation decides, not its angles: at pitch ±π/2 they may differ and mean the same.
    if angle_between(&rotation_from_rpy(&old), wanted) <= SAME_NUMBER {
        old.into()
    } else {
        rpy_near(wanted, &old).map(tidy_angle).into()
    }
}

fn is_zero(vector: &Vector3<f64>) -> bool {
    vector.iter().all(|x| same_number(*x, 0.0))
}

/// Of ±q, the one nearer to the text; the text itself where it is the same rotation.
fn quaternion_near(wanted: &UnitQuaternion<f64>, old: [f64; 4]) -> [f64; 4] {
    let written = Vector4::from(old);
    let current = UnitQuaternion::new_normalize(Quaternion::from(written));
    if angle_between(&current, wanted) <= SAME_NUMBER {
        return old;
    }
    if wanted.coords.dot(&written) < 0.0 {
        (-wanted.coords).into()
    } else {
        wanted.coords.into()
    }
}
