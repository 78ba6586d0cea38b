//! Edits of a URDF's text: bytes that need not change stay as they are.
//!
//! An attribute's numbers are replaced one by one through the byte ranges that the parser gives. A missing `<origin>`,
//! `<axis>` or attribute is inserted in the style of its neighbors (indentation, line ending, quotes). A number that
//! already equals the new one within [`SAME_NUMBER`](crate::decimal::SAME_NUMBER) keeps its text, so a second patch
//! with the same values changes nothing.

mod attribute;
mod check;
mod frame;
mod joint;
mod looked_up;
mod patched;
mod patcher;

use crate::edit::change::{Change, UrdfEdit};
use crate::edit::decimal::Splice;
use crate::edit::error::EditError;
use crate::edit::insert::FixedFrame;
use crate::edit::verify::verify;
use crate::model::RobotModel;
use crate::read::source::{has_quaternions, parse, xacro_evidence};
use crate::xacro::companions::Companions;
use crate::xacro::value::Context;
use crate::yaml;
pub use patched::{Patched, PatchedFiles};
use patcher::Patcher;
use roxmltree::Document;
use std::collections::BTreeMap;

/// Makes the edits in a URDF's text, or in a xacro's where the text is literal.
///
/// For a URDF, the result is read again and compared with the request ([`crate::verify()`]) before it is returned.
///
/// # Errors
/// [`EditError`]: an unreadable text, an unknown name, a non-finite number, a value that xacro computes.
pub fn patch(text: &str, name_for_errors: &str, edits: &[UrdfEdit]) -> Result<Patched, EditError> {
    Ok(patch_with(text, name_for_errors, edits, &Companions::default())?.main)
}

/// [`patch()`] of a xacro whose included files and YAML are known: a number that comes from the YAML is replaced there.
///
/// # Errors
/// Those of [`patch()`], and those that begin with `Yaml`.
pub fn patch_with(
    text: &str,
    name_for_errors: &str,
    edits: &[UrdfEdit],
    companions: &Companions,
) -> Result<PatchedFiles, EditError> {
    check::values(edits)?;
    let source = Source {
        text,
        file: name_for_errors,
        companions,
    };
    let document = parse(text, name_for_errors)?;
    if xacro_evidence(&document).is_none() {
        let nominal = RobotModel::from_urdf_text(text, name_for_errors)?;
        let patched = splice_edits(&source, &document, edits)?;
        let expected = nominal.with_edits(name_for_errors, edits)?;
        verify(&patched.main.text, &expected, name_for_errors)?;
        return Ok(patched);
    }
    let patched = splice_edits(&source, &document, edits)?;
    verify_xacro(&source, &patched, edits)?;
    Ok(patched)
}

/// A xacro is not expanded here: the new texts have at least to hold the numbers that were asked for.
fn verify_xacro(
    source: &Source<'_>,
    patched: &PatchedFiles,
    edits: &[UrdfEdit],
) -> Result<(), EditError> {
    let mut companions = source.companions.clone();
    for (file, yaml) in &patched.yaml {
        companions.yaml[*file].text.clone_from(&yaml.text);
    }
    let again = Source {
        text: &patched.main.text,
        file: source.file,
        companions: &companions,
    };
    let left = splice_edits(&again, &parse(again.text, again.file)?, edits)?;
    let rest = left.yaml.iter().flat_map(|(_, yaml)| &yaml.changes);
    match left.main.changes.iter().chain(rest).next() {
        None => Ok(()),
        Some(change) => Err(EditError::StructureChanged {
            file: source.file.to_owned(),
            what: format!(
                "`{}` of joint `{}` still reads \"{}\"",
                change.attribute, change.joint, change.old
            ),
        }),
    }
}

/// A text to patch, its name in messages, and the files around it.
struct Source<'t> {
    text: &'t str,
    file: &'t str,
    companions: &'t Companions,
}

/// The edits as splices of the text; the result is not checked.
fn splice_edits(
    source: &Source<'_>,
    document: &Document<'_>,
    edits: &[UrdfEdit],
) -> Result<PatchedFiles, EditError> {
    // A YAML that cannot be read matters only where a number is looked for in it.
    let yaml: Vec<_> = source
        .companions
        .yaml
        .iter()
        .map(|file| yaml::parse(&file.text, &file.name))
        .collect();
    let mut patcher = Patcher {
        file: source.file,
        context: Context {
            text: source.text,
            document,
            companions: source.companions,
            yaml: &yaml,
        },
        is_xacro: xacro_evidence(document).is_some(),
        quaternions: has_quaternions(document),
        changes: Vec::new(),
        splices: Vec::new(),
        in_yaml: Vec::new(),
        before: BTreeMap::new(),
    };
    for edit in edits {
        patcher.edit(edit, edits)?;
    }
    let mut by_file: BTreeMap<usize, (Vec<Change>, Vec<Splice>)> = BTreeMap::new();
    for (file, change, splice) in patcher.in_yaml {
        let entry = by_file.entry(file).or_default();
        entry.0.push(change);
        entry.1.push(splice);
    }
    Ok(PatchedFiles {
        main: Patched::of(source.text, patcher.changes, patcher.splices),
        yaml: by_file
            .into_iter()
            .map(|(file, (changes, splices))| {
                let text = &source.companions.yaml[file].text;
                (file, Patched::of(text, changes, splices))
            })
            .collect(),
        before: patcher.before,
    })
}

impl Patcher<'_, '_> {
    /// Makes one of `edits`.
    fn edit(&mut self, edit: &UrdfEdit, edits: &[UrdfEdit]) -> Result<(), EditError> {
        match edit {
            UrdfEdit::SetOrigin {
                joint,
                parent_link_from_joint,
            } => self.set_origin(joint, parent_link_from_joint),
            UrdfEdit::SetAxis { joint, axis } => self.set_axis(joint, axis),
            UrdfEdit::SetLimits {
                joint,
                lower,
                upper,
            } => self.set_limits(joint, *lower, *upper),
            UrdfEdit::AddFixedFrame {
                name,
                parent_link,
                joint_name,
                parent_from_frame,
                comment,
            } => {
                let frame = FixedFrame {
                    link: name,
                    parent_link,
                    joint: joint_name,
                    parent_from_frame,
                    comment: comment.as_deref(),
                };
                self.add_frame(&frame, edits)
            }
            UrdfEdit::AddProvenance { text } => {
                self.add_provenance(text);
                Ok(())
            }
        }
    }
}
