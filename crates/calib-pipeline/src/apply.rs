//! `calib apply`: the origins that a calibration found, written into somebody's own description of the robot.
//!
//! ```text
//! result:  robot.calibrated.urdf + its change record  ─►  before, after: parent_link_from_joint of every joint
//! target:  URDF | xacro (+ the YAML that it loads) | kinematics YAML  ─►  the same joints' origins as they stand there
//! before = there (to 1e-6 m, 1e-6 rad)  ─►  after is written, number by number; every other byte stays
//! ```
//!
//! Nothing is written unless every joint was found, held what the calibration started from, and stands in a number of its
//! own. Beside each written file lies the record that [`crate::take_back::revert`] needs.

mod files;
mod render;
mod result;
mod target;

pub use render::{json, text};
pub(crate) use result::read_report;
pub use result::{Calibrated, find as find_result};
pub(crate) use target::origins;
pub use target::{Kind, Target};

use std::path::{Path, PathBuf};

use calib_urdf::{ChangeRecord, ModelDiff, Patched, UrdfEdit, diff_origins};
use nalgebra::Isometry3;
use serde::Serialize;

use crate::error::PipelineError;

/// Where the changed files go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Destination {
    /// Nowhere: a dry run.
    Nowhere,
    /// Over the target and the YAML that it loads.
    InPlace,
    /// A new file; a folder where more than one file changes.
    To(PathBuf),
}

/// What to apply to what.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ApplyRequest {
    /// A folder of results, its `report.json`, the calibrated URDF, its change record or its `calibration.yaml`.
    pub result: PathBuf,
    /// A URDF, a xacro, or a YAML with origins of joints.
    pub target: PathBuf,
    /// The YAML that the xacro loads, where its own path cannot be followed.
    pub yaml: Option<PathBuf>,
    /// Where to.
    pub destination: Destination,
    /// Also a result that was not accepted.
    pub force: bool,
}

/// One file that changes.
#[derive(Debug, Clone)]
pub struct FileChange {
    /// The file, as the caller named it or as it was found from there.
    pub path: PathBuf,
    /// Its text before.
    pub original: String,
    /// Its text after, and what differs.
    pub patched: Patched,
    /// What takes it back.
    pub record: ChangeRecord,
    /// Where it was written.
    pub written: Option<PathBuf>,
}

/// What was applied.
#[derive(Debug, Clone)]
pub struct Applied {
    /// The calibrated URDF that the numbers come from.
    pub from: PathBuf,
    /// The target.
    pub target: PathBuf,
    /// What it is.
    pub kind: Kind,
    /// What moved.
    pub moved: ModelDiff,
    /// Files that change; empty where the target already holds the result.
    pub files: Vec<FileChange>,
    /// What the reader should know.
    pub notes: Vec<String>,
    /// Where it went.
    pub destination: Destination,
}

/// The origin of a joint in a target and in the result's robot agree to this, or they are different robots (m, rad):
/// expanded files have six decimals at least, and no calibration moves a joint by as little.
const SAME_ROBOT: f64 = 1e-6;

/// Applies a result to a target.
///
/// # Errors
/// [`PipelineError`] with place, finding and remedy; nothing is written then.
pub fn apply(request: &ApplyRequest) -> Result<Applied, PipelineError> {
    let result = result::find(&request.result, request.force)?;
    let target = Target::read(&request.target, request.yaml.as_deref())?;
    let mut notes = result.notes.clone();
    let edits = result.edits(target.kind, &mut notes);
    let patched = target.patch(&result, &edits)?;
    let state = compare(&result, &patched.before, &request.target)?;
    let mut moved = diff_origins(
        &result.changed(&result.before),
        &result.changed(&result.after),
    );
    for edit in &edits {
        if let UrdfEdit::AddFixedFrame {
            name, joint_name, ..
        } = edit
        {
            moved.added_links.push(name.clone());
            moved.added_joints.push(joint_name.clone());
        }
    }
    let mut files = Vec::new();
    if state == State::Before || patched.adds_frames {
        for (path, original, patched) in patched.files {
            if patched.splices.is_empty() {
                continue;
            }
            let record = patched.record(&original);
            files.push(FileChange {
                path,
                original,
                patched,
                record,
                written: None,
            });
        }
    }
    target.add_notes(&files, &mut notes);
    let mut applied = Applied {
        from: result.urdf.clone(),
        target: request.target.clone(),
        kind: target.kind,
        moved,
        files,
        notes,
        destination: request.destination.clone(),
    };
    files::write(&mut applied.files, &request.destination)?;
    Ok(applied)
}

/// How a target stands to a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// It holds what the calibration started from.
    Before,
    /// It holds the result already.
    After,
}

/// Are the target's origins those that the calibration started from, or those that it found?
fn compare(
    result: &Calibrated,
    there: &std::collections::BTreeMap<String, Isometry3<f64>>,
    target: &Path,
) -> Result<State, PipelineError> {
    let far = |a: &Isometry3<f64>, b: &Isometry3<f64>| {
        let off = a.inverse() * b;
        (off.translation.vector.norm(), off.rotation.angle())
    };
    let same = |(m, rad): (f64, f64)| m <= SAME_ROBOT && rad <= SAME_ROBOT;
    let mut others = Vec::new();
    let mut applied = 0;
    let mut joints = 0;
    for (joint, found) in there {
        let (Some(before), Some(after)) = (result.before(joint), result.after(joint)) else {
            continue;
        };
        joints += 1;
        if same(far(found, &before)) {
            continue;
        }
        if same(far(found, &after)) {
            applied += 1;
            continue;
        }
        let (m, rad) = far(found, &before);
        others.push(format!(
            "`{joint}` by {:.3} mm and {:.4} deg",
            m * 1e3,
            rad.to_degrees()
        ));
    }
    if others.is_empty() && applied == joints && joints > 0 {
        return Ok(State::After);
    }
    if others.is_empty() && applied == 0 {
        return Ok(State::Before);
    }
    if others.is_empty() {
        return Err(PipelineError::Data {
            file: target.display().to_string(),
            finding: format!(
                "{applied} of {joints} joints hold this result already, the others what it started from"
            ),
            remedy: "take the file back to what was calibrated first".to_owned(),
        });
    }
    /// More lines than this say the same again.
    const SHOWN: usize = 3;
    let more = match others.len().checked_sub(SHOWN) {
        Some(n @ 1..) => format!(" and {n} more"),
        _ => String::new(),
    };
    others.truncate(SHOWN);
    Err(PipelineError::Data {
        file: target.display().to_string(),
        finding: format!(
            "its origins are not those that were calibrated: they differ in {}{more}",
            others.join(", ")
        ),
        remedy: "apply to the description that the profile names, or calibrate with this one"
            .to_owned(),
    })
}

/// The keys of `calib apply --json`.
#[derive(Debug, Serialize)]
struct Json<'a> {
    calib_apply: u32,
    result: String,
    target: String,
    kind: &'static str,
    written: bool,
    moved: &'a ModelDiff,
    files: Vec<JsonFile<'a>>,
    notes: &'a [String],
    undo: Vec<String>,
}

#[derive(Debug, Serialize)]
struct JsonFile<'a> {
    path: String,
    written: Option<String>,
    record: Option<String>,
    original_sha256: &'a str,
    patched_sha256: &'a str,
    changes: &'a [calib_urdf::Change],
    diff: String,
}
