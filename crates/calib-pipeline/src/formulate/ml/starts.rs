//! Rows before a joint's first motion in a recording: from which side it came there is not known.

use std::collections::BTreeMap;

use calib_core::effect::{Source, Term};
use calib_core::{EFFECTS, EdgeId, EdgeKind, EffectKind, JointState, OpenStart, StartChange};
use calib_urdf::{JointId, RobotModel};

use super::joints::Row;
use crate::formulate::formulation::Formulation;
use crate::formulate::kinematics::joint_state;
use crate::formulate::starts::FEWEST;
use crate::prepare::inputs::Inputs;

/// Declares the open starts of all joints that are approached from a known side elsewhere.
pub(super) fn open_starts(formulation: &mut Formulation, inputs: &Inputs, rows: &[Row<'_>]) {
    let model = &inputs.robot.model;
    let used = model.joint_ids().filter_map(|joint| {
        let edge = formulation.joints[joint.index()]?;
        let known = |row: &Row<'_>| row.under.approach_of(joint.index()) != 0.0;
        rows.iter().any(known).then_some((joint, edge))
    });
    let starts: Vec<OpenStart> = used
        .flat_map(|(joint, edge)| of_joint(formulation, model, (joint, edge), rows))
        .collect();
    for start in starts {
        formulation.problem.open_start(start);
    }
}

/// The open starts of one joint, recording by recording.
fn of_joint(
    formulation: &Formulation,
    model: &RobotModel,
    (joint, edge): (JointId, EdgeId),
    rows: &[Row<'_>],
) -> Vec<OpenStart> {
    let mut by_recording: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (sample, row) in rows.iter().enumerate() {
        if row.under.approach_of(joint.index()) == 0.0 {
            let recording = formulation.samples[sample].0.as_str();
            by_recording.entry(recording).or_default().push(sample);
        }
    }
    let starts = by_recording.into_values();
    let starts = starts.filter(|samples| samples.len() >= FEWEST);
    let start = |samples: Vec<usize>| {
        let states: Vec<JointState> = samples
            .iter()
            .map(|s| joint_state(model, joint, rows[*s].q, &rows[*s].loads, rows[*s].under))
            .collect();
        let terms = EFFECTS.iter().flat_map(|effect| effect.terms);
        let changes: Vec<StartChange> = terms
            .chain(outside_terms(formulation, edge))
            .filter(|term| matches!(term.source, Source::Approach | Source::Friction))
            .filter_map(|term| change(term, &states))
            .collect();
        (!changes.is_empty()).then_some(OpenStart {
            joint: edge,
            samples,
            changes,
        })
    };
    starts.filter_map(start).collect()
}

/// Terms of a joint's effects that plugins compute.
fn outside_terms(formulation: &Formulation, edge: EdgeId) -> Vec<&'static Term> {
    let EdgeKind::Joint(joint) = &formulation.problem.edges()[edge.index()].kind else {
        return Vec::new();
    };
    let kinds = joint.effects.iter().map(|effect| effect.kind);
    let outside = kinds.filter(|kind| matches!(kind, EffectKind::Outside(_)));
    outside.map(EffectKind::term).collect()
}

/// What the side does to a term; `None` where it does nothing.
fn change(term: &Term, states: &[JointState]) -> Option<StartChange> {
    let from =
        |state: &JointState, approach: f64| term.regressor.at(&JointState { approach, ..*state });
    let by: Vec<f64> = states
        .iter()
        .map(|state| (from(state, 1.0) - from(state, -1.0)) / 2.0)
        .collect();
    let any = by.iter().any(|by| *by != 0.0);
    any.then_some(StartChange {
        kind: term.kind,
        by,
    })
}
