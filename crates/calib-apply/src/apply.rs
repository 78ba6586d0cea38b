//! Applies a result to a target: nothing is written unless every joint was found, held what the calibration started from,
//! and stands in a number of its own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use calib_urdf::rpy::{rotation_from_rpy, rpy_from_rotation};
use calib_urdf::{JointDiff, ModelDiff, Patched, RobotModel, UrdfEdit, diff_models, diff_origins};
use nalgebra::Isometry3;

use crate::change::{Destination, FileChange};
use crate::error::{ApplyError, OriginDifference};
use crate::files;
use crate::kind::Kind;
use crate::result::{self, Calibrated};
use crate::revert::{Recorded, record_of, recorded, reverted};
use crate::target::{PatchedTarget, Target};

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
/// [`ApplyError`] with place, finding and remedy; nothing is written then.
pub fn apply(request: &ApplyRequest) -> Result<Applied, ApplyError> {
    if result::are_exchanged(&request.result, &request.target) {
        return Err(ApplyError::Exchanged {
            result: request.target.clone(),
            target: request.result.clone(),
        });
    }
    let result = result::find(&request.result, request.force)?;
    let mut target = Target::read(&request.target, request.yaml.as_deref())?;
    let mut notes = result.notes.clone();
    if request.destination == Destination::InPlace {
        if files::complete(target.paths())? {
            target = Target::read(&request.target, request.yaml.as_deref())?;
            notes.push(
                "an earlier change was stopped between two files: it was completed".to_owned(),
            );
        }
        target.recover(&mut notes)?;
    }
    same_kinematics(&result, &target)?;
    let edits = result.edits(target.kind, &mut notes);
    let (patched, state) = match patched(&result, &mut target, &edits, &mut notes) {
        Err(ApplyError::PartlyApplied { target: file, .. })
            if files::is_stopped(target.paths()) =>
        {
            return Err(ApplyError::Stopped { file });
        }
        other => other?,
    };
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
            files.push(file_change(path, original, patched)?);
        }
    }
    target.add_notes(&files, &mut notes);
    files::announce(&files, &request.destination, &mut notes);
    if request.destination == Destination::InPlace {
        let many = files.iter().filter(|file| has_other_names(&file.path));
        notes.extend(many.map(|file| {
            let file = file.path.display();
            format!("{file} has other names (hard links): those keep the old numbers")
        }));
    }
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

/// A URDF whose joints of the same names turn about other axes, slide, or connect other links is of another robot, whatever its origins are.
fn same_kinematics(result: &Calibrated, target: &Target) -> Result<(), ApplyError> {
    // What cannot be read is refused where it is patched; a xacro and a YAML tell origins alone.
    let name = target.path.display().to_string();
    let read = (target.kind == Kind::Urdf).then(|| RobotModel::from_urdf_text(&target.text, &name));
    let Some(Ok(there)) = read else {
        return Ok(());
    };
    let found = diff_models(&result.before, &there).joints;
    let moves = |joint: &str| {
        let mut joints = result.before.joints().iter();
        joints.any(|own| own.name == joint && own.kind.axis().is_some())
    };
    let differs = |joint: &JointDiff| {
        let turns = |kind: &str| ["revolute", "continuous"].contains(&kind);
        let kind = joint.kind.as_ref();
        joint.axis_deg.is_some()
            || kind.is_some_and(|kind| !(turns(kind.from) && turns(kind.to)))
            || joint.parent.is_some()
            || joint.child.is_some()
    };
    let others: Vec<String> = found
        .into_iter()
        .filter(|joint| moves(&joint.joint) && differs(joint))
        .map(|joint| joint.joint)
        .collect();
    match others.is_empty() {
        true => Ok(()),
        false => Err(ApplyError::OtherKinematics {
            target: target.path.clone(),
            joints: others,
        }),
    }
}

/// The target after the edits. Where it holds an earlier change of ours and the calibration did not start from that, the earlier change
/// is replaced.
fn patched(
    result: &Calibrated,
    target: &mut Target,
    edits: &[UrdfEdit],
    notes: &mut Vec<String>,
) -> Result<(PatchedTarget, State), ApplyError> {
    let patched = target.patch(result, edits)?;
    let refused = match compare(result, &patched.before, &target.path) {
        Ok(State::Before) => {
            let edits = with_own_digits(result, &patched.before, edits);
            return Ok((target.patch(result, &edits)?, State::Before));
        }
        Ok(state) => return Ok((patched, state)),
        Err(refused) => refused,
    };
    if !target.go_back()? {
        return Err(refused);
    }
    let patched = target.patch(result, edits)?;
    match compare(result, &patched.before, &target.path) {
        Ok(state) => {
            notes.push(
                "the target holds an earlier calibration, which this one replaces: it started from the same original"
                    .to_owned(),
            );
            Ok((patched, state))
        }
        Err(_) => Err(refused),
    }
}

/// The edits as changes of what stands in the target. A target may state its numbers with more digits than the file that was calibrated (an
/// expanded URDF has six decimals, a UR arm's YAML sixteen): a coordinate that the calibration left alone keeps them, and a rotation is
/// changed by what the calibration changed of it.
fn with_own_digits(
    result: &Calibrated,
    there: &BTreeMap<String, Isometry3<f64>>,
    edits: &[UrdfEdit],
) -> Vec<UrdfEdit> {
    /// The last decimal that is written, m and rad.
    const WRITTEN: f64 = 1e-9;
    const UNCHANGED: f64 = 0.5 * WRITTEN;
    /// Closer than this the target has the same digits, m and rad.
    const SAME_DIGITS: f64 = 1e-12;
    let own = |edit: &UrdfEdit| -> Option<UrdfEdit> {
        let UrdfEdit::SetOrigin {
            joint,
            parent_link_from_joint: wanted,
        } = edit
        else {
            return None;
        };
        let (there, before) = (there.get(joint)?, result.before(joint)?);
        let off = before.inverse() * there;
        if off.translation.vector.norm() + off.rotation.angle() < SAME_DIGITS {
            return None;
        }
        let mut own = *wanted;
        own.rotation = wanted.rotation * before.rotation.inverse() * there.rotation;
        let (new, old) = (
            rpy_from_rotation(&own.rotation),
            rpy_from_rotation(&there.rotation),
        );
        own.rotation = rotation_from_rpy(&new.zip_map(&old, |new, old| match new - old {
            change if change.abs() < UNCHANGED => old,
            _ => (new / WRITTEN).round() * WRITTEN,
        }));
        let coordinates = own.translation.vector.iter_mut().enumerate();
        for (i, own) in coordinates {
            if (*own - before.translation.vector[i]).abs() < UNCHANGED {
                *own = there.translation.vector[i];
            }
        }
        Some(UrdfEdit::SetOrigin {
            joint: joint.clone(),
            parent_link_from_joint: own,
        })
    };
    let edits = edits.iter();
    edits
        .map(|edit| own(edit).unwrap_or_else(|| edit.clone()))
        .collect()
}

/// A changed file with the record that leads back to its first original.
fn file_change(
    path: PathBuf,
    original: String,
    patched: Patched,
) -> Result<FileChange, ApplyError> {
    let own = patched.record(&original);
    let record = match recorded(&path, &original) {
        Recorded::After => {
            let earlier = record_of(&path, &original)?;
            let first = reverted(&path, &original, &earlier)?;
            earlier.then(&own, &first, &patched.text)
        }
        Recorded::Before | Recorded::No => own,
    };
    let on_disk = calib_urdf::source::read_text(&path, &path.display().to_string())?;
    Ok(FileChange {
        path,
        original: on_disk,
        patched,
        record,
        written: None,
    })
}

/// Whether a file has more than one name; the system may not tell.
fn has_other_names(path: &Path) -> bool {
    #[cfg(unix)]
    let names = std::fs::metadata(path).map(|m| std::os::unix::fs::MetadataExt::nlink(&m));
    #[cfg(not(unix))]
    let names = std::fs::metadata(path).map(|_| 1);
    names.is_ok_and(|n| n > 1)
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
    there: &BTreeMap<String, Isometry3<f64>>,
    target: &Path,
) -> Result<State, ApplyError> {
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
        let (translation, rotation) = far(found, &before);
        others.push(OriginDifference {
            joint: joint.clone(),
            translation,
            rotation,
        });
    }
    if others.is_empty() && applied == joints && joints > 0 {
        return Ok(State::After);
    }
    if others.is_empty() && applied == 0 {
        return Ok(State::Before);
    }
    if others.is_empty() {
        return Err(ApplyError::PartlyApplied {
            target: target.to_path_buf(),
            applied,
            joints,
        });
    }
    Err(ApplyError::OtherOrigins {
        target: target.to_path_buf(),
        others,
    })
}
