//! What a calibration found, from the files that `calib run` wrote.

use std::path::{Path, PathBuf};

use calib_report::{REPORT, Report, Verdict, read_report};
use calib_urdf::{ChangeRecord, RobotModel, UrdfEdit, source};
use nalgebra::Isometry3;

use crate::error::ApplyError;
use crate::kind::Kind;
use crate::revert::{read_record, reverted};

/// A calibration's robot before and after.
#[derive(Debug, Clone)]
pub struct Calibrated {
    /// The calibrated URDF.
    pub urdf: PathBuf,
    /// Its text.
    pub urdf_text: String,
    /// The robot that was calibrated.
    pub before: RobotModel,
    /// The robot that was found.
    pub after: RobotModel,
    /// How the one text becomes the other.
    pub record: ChangeRecord,
    /// What the reader should know.
    pub notes: Vec<String>,
}

/// An origin that moved by less than this (m, rad) did not: the threshold of `calib run`.
const UNCHANGED: f64 = 1e-12;

/// Finds the calibrated URDF and its record from any file of a folder of results.
///
/// # Errors
/// [`ApplyError`] when a file is missing or does not belong to the others, and when the verdict is no pass and `force`
/// does not say to go on.
pub fn find(path: &Path, force: bool) -> Result<Calibrated, ApplyError> {
    let (urdf, report) = locate(path)?;
    let mut notes = Vec::new();
    let held_out = report
        .as_ref()
        .and_then(|r| r.verification.held_out.clone());
    match report.as_ref().map(|r| r.verdict) {
        Some(Verdict::Accepted) => {}
        Some(Verdict::AcceptedWithWarnings) => {
            let line = report.as_ref().map(Report::verdict_line);
            notes.push(format!(
                "this calibration was {}: see its report.md",
                line.unwrap_or_default()
            ));
        }
        Some(verdict) if force => notes.push(format!(
            "the verdict of this calibration is \"{}\", and --force was given",
            verdict.word()
        )),
        Some(verdict) => {
            return Err(ApplyError::NotAccepted {
                path: path.to_path_buf(),
                verdict,
                reasons: report.map(|r| r.reasons).unwrap_or_default(),
            });
        }
        None => notes.push(
            "there is no report.json beside the calibrated URDF: its verdict is not known"
                .to_owned(),
        ),
    }
    let name = urdf.display().to_string();
    let urdf_text = source::read_text(&urdf, &name)?;
    let record = read_record(&urdf)?;
    let original = reverted(&urdf, &urdf_text, &record)?;
    let before = RobotModel::from_urdf_text(&original, &name)?;
    let after = RobotModel::from_urdf_text(&urdf_text, &name)?;
    let effects = effects_path(&urdf);
    if effects.is_file() {
        notes.push(format!(
            "joint effects that a URDF cannot hold stay in {}: without them a part of the error remains",
            effects.display()
        ));
        let held_out = held_out.filter(|held_out| !held_out.urdf_alone_gains());
        if let Some((alone, untouched)) =
            held_out.and_then(|h| Some((h.urdf_alone?, h.registration_only?)))
        {
            notes.push(format!(
                "without these effects this URDF predicts new poses to {:.2} mm rms, the untouched one to {:.2} mm: use it only with the effects",
                1e3 * alone.rms_m,
                1e3 * untouched.rms_m
            ));
        }
    }
    Ok(Calibrated {
        urdf,
        urdf_text,
        before,
        after,
        record,
        notes,
    })
}

fn effects_path(urdf: &Path) -> PathBuf {
    let name = urdf.display().to_string();
    PathBuf::from(format!(
        "{}.calibration.yaml",
        name.trim_end_matches(".urdf")
    ))
}

/// Whether the target is a result and the result is none: a folder with a report or a JSON file is never changed.
pub(crate) fn are_exchanged(result: &Path, target: &Path) -> bool {
    let is_json = |path: &Path| path.extension().is_some_and(|end| end == "json");
    let target_is_result = target.join(REPORT).is_file() || target.is_file() && is_json(target);
    target_is_result && result.is_file() && !is_json(result)
}

/// The calibrated URDF, and the report where there is one.
fn locate(path: &Path) -> Result<(PathBuf, Option<Report>), ApplyError> {
    let name = path.display().to_string();
    if path.is_dir() {
        return from_report(&path.join(REPORT));
    }
    if !path.is_file() {
        return Err(ApplyError::NoResult {
            path: path.to_path_buf(),
        });
    }
    let urdf = if let Some(urdf) = name.strip_suffix(".changes.json") {
        PathBuf::from(urdf)
    } else if let Some(stem) = name.strip_suffix(".calibration.yaml") {
        PathBuf::from(format!("{stem}.urdf"))
    } else if name.ends_with(".json") {
        return from_report(path);
    } else {
        path.to_path_buf()
    };
    let report = urdf.with_file_name(REPORT);
    let report = if report.is_file() {
        Some(read_report(&report)?)
    } else {
        None
    };
    let listed = report.as_ref().is_some_and(|r| {
        r.outputs
            .iter()
            .any(|o| o.changes.is_some() && urdf.ends_with(&o.path))
    });
    Ok((urdf, report.filter(|_| listed)))
}

fn from_report(path: &Path) -> Result<(PathBuf, Option<Report>), ApplyError> {
    let report = read_report(path)?;
    let urdf = report
        .outputs
        .iter()
        .find(|o| o.changes.is_some())
        .map(|o| path.with_file_name(&o.path))
        .ok_or_else(|| ApplyError::NoUrdf {
            report: path.to_path_buf(),
        })?;
    Ok((urdf, Some(report)))
}

impl Calibrated {
    /// The origin of a joint before.
    #[must_use]
    pub fn before(&self, joint: &str) -> Option<Isometry3<f64>> {
        origin(&self.before, joint)
    }

    /// The origin of a joint after.
    #[must_use]
    pub fn after(&self, joint: &str) -> Option<Isometry3<f64>> {
        origin(&self.after, joint)
    }

    /// The joints that moved, in the order of the file.
    fn moved(&self) -> impl Iterator<Item = &str> {
        self.before.joints().iter().filter_map(|joint| {
            let after = self.after(&joint.name)?;
            let off = joint.parent_link_from_joint.inverse() * after;
            let moved =
                off.translation.vector.norm() > UNCHANGED || off.rotation.angle() > UNCHANGED;
            moved.then_some(joint.name.as_str())
        })
    }

    /// The origins of the moved joints in one of the two robots.
    #[must_use]
    pub fn changed(&self, of: &RobotModel) -> Vec<(String, Isometry3<f64>)> {
        self.moved()
            .filter_map(|joint| Some((joint.to_owned(), origin(of, joint)?)))
            .collect()
    }

    /// What to change in a target of that kind.
    #[must_use]
    pub fn edits(&self, kind: Kind, notes: &mut Vec<String>) -> Vec<UrdfEdit> {
        let mut edits: Vec<UrdfEdit> = self
            .changed(&self.after)
            .into_iter()
            .map(|(joint, parent_link_from_joint)| UrdfEdit::SetOrigin {
                joint,
                parent_link_from_joint,
            })
            .collect();
        let added = self
            .after
            .joints()
            .iter()
            .filter(|joint| self.before.joint_id(&joint.name).is_err());
        for joint in added {
            let name = self.after.link(joint.child).name.clone();
            if kind == Kind::Yaml {
                notes.push(format!(
                    "the frame `{name}` is not added: a kinematics YAML holds existing joints only"
                ));
                continue;
            }
            edits.push(UrdfEdit::AddFixedFrame {
                comment: Some(format!("tracking body {name}")),
                name,
                parent_link: self.after.link(joint.parent).name.clone(),
                joint_name: joint.name.clone(),
                parent_from_frame: joint.parent_link_from_joint,
            });
        }
        edits
    }
}

fn origin(model: &RobotModel, joint: &str) -> Option<Isometry3<f64>> {
    let id = model.joint_id(joint).ok()?;
    Some(model.joint(id).parent_link_from_joint)
}
