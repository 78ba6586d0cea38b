//! From which side a joint came before it first moved in a recording, where an effect depends on it and the residuals tell.

use std::collections::{BTreeMap, BTreeSet};

use calib_core::effect::Source;
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::{Load, Solve, Usage};
use calib_urdf::JointId;

use crate::formulate::formulation::MlFit;
use crate::prepare::conditions::conditions;
use crate::prepare::inputs::Inputs;

/// Whether the profile frees anything that depends on the side.
pub(crate) fn matter(inputs: &Inputs) -> bool {
    sided_joints(inputs).next().is_some()
}

/// Joints of which the profile frees anything that depends on the side.
fn sided_joints(inputs: &Inputs) -> impl Iterator<Item = JointId> + '_ {
    let solve: &Solve = &inputs.robot.profile.solve;
    let model = &inputs.robot.model;
    model.joint_ids().filter(move |joint| {
        let free = solve.free_set(*joint, true, !model.joint(*joint).kind.turns());
        let terms = free.effects.iter().flat_map(|free| free.effect.terms);
        let mut sources = terms.map(|term| term.source);
        sources.any(|source| matches!(source, Source::Approach | Source::Friction))
    })
}

/// With fewer rows before a joint's first motion, which side it came from is told by little more than the noise of one of them.
pub(crate) const FEWEST: usize = 3;

/// Rows (recording, row) that no side is asked for: too few of them stand before the first motion of some joint. Their errors are those of
/// a joint in the middle of its backlash, which is where it never stands.
pub(crate) fn rows_of_no_side(inputs: &Inputs) -> BTreeSet<(String, usize)> {
    let joints: Vec<JointId> = sided_joints(inputs).collect();
    let mut out = BTreeSet::new();
    for (name, loaded) in inputs.recordings.iter().filter(|_| !joints.is_empty()) {
        let under = conditions(loaded, &inputs.robot, Load::Gravity);
        for joint in &joints {
            let open = |row: &usize| under[*row].approach_of(joint.index()) == 0.0;
            let rows: Vec<usize> = (0..under.len()).take_while(open).collect();
            if rows.len() < FEWEST {
                out.extend(rows.into_iter().map(|row| (name.clone(), row)));
            }
        }
    }
    out
}

/// Sides by recording and joint index.
pub(crate) type Sides = BTreeMap<(String, usize), f64>;

/// The sides that the residuals of a fit tell.
pub(crate) fn told(fit: &MlFit) -> Sides {
    let formulation = &fit.formulation;
    let starts = formulation.problem.open_starts();
    let of = |found: &calib_core::StartDirection| {
        let start = &starts[found.start];
        let joints = formulation.joints.iter();
        let joint = joints.clone().position(|j| *j == Some(start.joint))?;
        let recording = formulation.samples[*start.samples.first()?].0.clone();
        Some(((recording, joint), found.direction))
    };
    let found = fit.solution.start_directions();
    found.iter().filter_map(of).collect()
}

/// Those of fitted recordings, where there are any: a fit that has none of them predicts held-out rows too badly to tell theirs.
pub(crate) fn fitted_first(inputs: &Inputs, sides: Sides) -> Sides {
    let held_out = |recording: &String| {
        let loaded = inputs.recordings.get(recording);
        loaded.is_some_and(|loaded| loaded.spec.usage == Usage::Validation)
    };
    let (later, fitted): (Sides, Sides) = sides
        .into_iter()
        .partition(|((recording, _), _)| held_out(recording));
    if fitted.is_empty() { later } else { fitted }
}

/// Takes the sides as known.
pub(crate) fn take(inputs: &mut Inputs, sides: &Sides) {
    for ((recording, joint), side) in sides {
        if let Some(loaded) = inputs.recordings.get_mut(recording) {
            loaded.starts.insert(*joint, *side);
        }
    }
}

/// What was taken as known, one finding for each recording.
pub(crate) fn findings(inputs: &Inputs) -> Vec<Finding> {
    let model = &inputs.robot.model;
    let of = |(name, loaded): (&String, &crate::prepare::inputs::Loaded)| {
        let from = |side: f64| {
            let joints = model.joint_ids().filter(|joint| {
                loaded
                    .starts
                    .get(&joint.index())
                    .is_some_and(|s| *s == side)
            });
            let names: Vec<String> = joints.map(|j| model.joint(j).name.clone()).collect();
            (!names.is_empty()).then(|| Fact::names(names))
        };
        (!loaded.starts.is_empty()).then(|| {
            Finding::new(catalog::SIDE_BY_RESIDUALS, Subject::recording(name))
                .with("recording", Fact::name(name))
                .with_some("below", from(1.0))
                .with_some("above", from(-1.0))
        })
    };
    inputs.recordings.iter().filter_map(of).collect()
}
