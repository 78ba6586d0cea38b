//! The table of a recording checked against the robot: names, units, and the joint positions of each row.

use std::collections::{BTreeMap, BTreeSet};

use calib_finding::{Fact, Finding, Subject, catalog, nearest_word};
use calib_profile::{ByRow, Contact, Profile, RecordingSpec};
use calib_recording::{JointUnit, Meta, Poses};
use calib_urdf::RobotModel;

use crate::error::{DataProblem, PipelineError};
use crate::prepare::blanks;
use crate::prepare::inputs::{Loaded, RobotProfile};
use crate::prepare::row_noise::RowNoise;
use crate::prepare::scatter::scatter;
use crate::prepare::speeds::speeds;

/// Checks the names of a table against robot and profile and makes its joint vectors.
pub(crate) fn prepare(
    robot: &RobotProfile,
    name: &str,
    spec: &RecordingSpec,
    mut poses: Poses,
    meta: Meta,
    findings: &mut Vec<Finding>,
) -> Result<Loaded, PipelineError> {
    let model = &robot.model;
    let error = |problem: DataProblem| {
        PipelineError::data(robot.folder.join(&spec.file).display().to_string(), problem)
    };
    if poses.is_empty() {
        return Err(error(DataProblem::NoPoses));
    }
    findings.extend(meta.findings.iter().cloned().map(|mut finding| {
        finding.subject = finding.subject.in_file(&spec.file);
        finding
    }));
    ignore_unmapped(robot, name, spec, &mut poses, findings);
    for joint in poses.joints.keys() {
        let id = model.joint_id(joint).map_err(|unknown| {
            error(DataProblem::ColumnNotAJoint {
                column: joint.clone(),
                unknown,
            })
        })?;
        let kind = model.joint(id).kind;
        let is_angle = poses
            .joint_units
            .get(joint)
            .is_none_or(|u| *u == JointUnit::Angle);
        if kind.turns() != is_angle {
            return Err(error(DataProblem::JointUnit {
                joint: joint.clone(),
                kind,
            }));
        }
        if spec.hold.contains_key(&id) {
            return Err(error(DataProblem::HeldAndRecorded {
                joint: joint.clone(),
            }));
        }
    }
    let aligned = spec.timing.is_some();
    // Streams were asked before they became rows.
    if !aligned {
        let joints = poses.joints.iter();
        blanks::none_is_empty(joints.map(|(joint, q)| (joint, q.as_slice()))).map_err(error)?;
    }
    findings.extend(blanks::of_table(name, &poses, aligned));
    touched_by_row(&robot.profile, name, &poses).map_err(error)?;
    let q = joint_vectors(model, spec, &poses);
    let velocities = speeds(&poses);
    let scatter = scatter(&robot.profile, model, &poses);
    Ok(Loaded {
        name: name.to_owned(),
        spec: spec.clone(),
        poses,
        q,
        meta,
        alignment: None,
        velocities,
        starts: BTreeMap::new(),
        shapes: BTreeMap::new(),
        by_camera: BTreeSet::new(),
        row_noise: RowNoise::default(),
        scatter,
        mixed: BTreeMap::new(),
    })
}

/// The coordinates and the names of spots that contacts take from a recording are there.
fn touched_by_row(profile: &Profile, recording: &str, poses: &Poses) -> Result<(), DataProblem> {
    fn near<'n>(name: &str, names: impl Iterator<Item = &'n String>) -> Option<String> {
        nearest_word(name, names.map(String::as_str)).map(str::to_owned)
    }
    let here = |c: &Contact| c.recordings.iter().any(|r| r == recording);
    for (contact, spec) in profile.contacts.iter().filter(|(_, c)| here(c)) {
        let contact = contact.clone();
        match &spec.by_row {
            Some(ByRow::Coordinates(columns)) if !poses.markers.contains_key(columns) => {
                let meant = near(columns, poses.markers.keys());
                return Err(DataProblem::NoCoordinates {
                    contact,
                    columns: columns.clone(),
                    meant,
                });
            }
            Some(ByRow::Spots(spots)) => {
                let Some(names) = poses.labels.get(&spots.named_in) else {
                    return Err(DataProblem::NoSpotNames {
                        contact,
                        column: spots.named_in.clone(),
                        meant: near(&spots.named_in, poses.labels.keys()),
                    });
                };
                let named = |spot: &String| spots.at.is_empty() || spots.at.contains_key(spot);
                // A row without a name touches nothing.
                let unknown = |spot: &&String| !spot.is_empty() && !named(spot);
                if let Some(row) = names.iter().position(|spot| unknown(&spot)) {
                    return Err(DataProblem::UnknownSpot {
                        contact,
                        spot: names[row].clone(),
                        row: poses.rows[row],
                        meant: near(&names[row], spots.at.keys()),
                    });
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// In a table with a column map, a column that only looks like a joint is ignored, and said so.
fn ignore_unmapped(
    robot: &RobotProfile,
    name: &str,
    spec: &RecordingSpec,
    poses: &mut Poses,
    findings: &mut Vec<Finding>,
) {
    if spec.columns.is_none() {
        return;
    }
    let strangers: Vec<String> = poses
        .joints
        .keys()
        .filter(|j| robot.model.joint_id(j).is_err())
        .cloned()
        .collect();
    if strangers.is_empty() {
        return;
    }
    for joint in &strangers {
        poses.joints.remove(joint);
        poses.joint_units.remove(joint);
    }
    findings.push(
        Finding::new(catalog::COLUMN_IGNORED, Subject::recording(name))
            .with("columns", Fact::names(strangers)),
    );
}

fn joint_vectors(model: &RobotModel, spec: &RecordingSpec, poses: &Poses) -> Vec<Option<Vec<f64>>> {
    let mut base = model.zero_positions();
    for (joint, value) in &spec.hold {
        base[joint.index()] = *value;
    }
    let columns: Vec<(usize, &Vec<Option<f64>>)> = poses
        .joints
        .iter()
        .filter_map(|(joint, column)| Some((model.joint_id(joint).ok()?.index(), column)))
        .collect();
    (0..poses.len())
        .map(|row| {
            let mut q = base.clone();
            for (joint, column) in &columns {
                q[*joint] = column[row]?;
            }
            Some(q)
        })
        .collect()
}
