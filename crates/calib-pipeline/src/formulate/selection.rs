//! `calib run --select`: the effects, axes and origins that the recordings support, by prediction of poses that were left out.
//!
//! It starts from what the profile frees, on the rows that a run of the profile fits, with its noise, priors and robust weights.

use std::collections::{BTreeMap, BTreeSet};

use calib_core::{SelectionRule, Settings, StepOutcome};
use calib_report::{
    ModelPart, NestedSelection, PartKind, Selection, SelectionOutcome, SelectionStep,
};

use crate::error::PipelineError;
use crate::formulate::by_likelihood::likelihood;
use crate::formulate::checked::check_data;
use crate::formulate::chosen::Chosen;
use crate::formulate::formulation::{FreeSet, MlFit};
use crate::formulate::ml::state;
use crate::formulate::parts::{Parts, RobotPart, What, everything, open_joints, with_parts, yaml};
use crate::prepare::inputs::Inputs;

/// Chooses what to free; `inputs` are as they were read.
///
/// # Errors
/// As for a run: data errors stop unless `force`.
pub fn choose(
    mut inputs: Inputs,
    force: bool,
    progress: &mut dyn FnMut(&str),
) -> Result<Chosen, PipelineError> {
    let profile = inputs.robot.profile.clone();
    let mut checked = check_data(&mut inputs, Vec::new(), force)?;
    let solved = likelihood(&mut inputs, &mut checked, None, progress)?;
    let Some(base) = solved.fit else {
        return Ok(Chosen {
            solve: profile.solve,
            selection: Selection::default(),
            nested: None,
            values: BTreeMap::new(),
            levels: Vec::new(),
        });
    };
    progress("choose effects");
    let open = open_joints(&inputs, &base.formulation);
    let mut all = inputs.clone();
    all.robot.profile.solve = everything(&inputs, &open);
    let mut stated = state(&all, &checked.tracks, &checked.start, FreeSet::Profile);
    start_at(&base, &mut stated.problem);
    let parts = Parts::of(&inputs, &open, &stated);
    let mut settings = Settings::default();
    settings.robust.enabled = profile.solve.robust;
    let stated_noise = profile.solve.noise.model.is_some() || profile.solve.noise.known;
    let rule = SelectionRule {
        noise_by_evidence: !stated_noise,
        ..SelectionRule::default()
    };
    let found = calib_core::select(
        &stated.problem,
        &parts.parts,
        &parts.first,
        &settings,
        &rule,
        &mut |fits| progress(&format!("choose effects: {fits} models fitted")),
    )?;
    let added: Vec<RobotPart> = found
        .parts
        .difference(&parts.first)
        .map(|p| parts.named[*p])
        .collect();
    let solve = with_parts(&inputs, &added);
    let facts = Facts {
        inputs: &inputs,
        parts: &parts,
        found: &found,
    };
    Ok(Chosen {
        selection: facts.selection(yaml(&solve, &inputs.robot.model)),
        nested: found.nested.clone().filter(|_| !added.is_empty()),
        values: stated
            .problem
            .parameters()
            .iter()
            .zip(&found.values)
            .map(|(parameter, value)| (parameter.name.clone(), *value))
            .collect(),
        levels: found.levels.clone(),
        solve,
    })
}

/// Values of a fit as start values of the parameters that have the same names.
fn start_at(fit: &MlFit, problem: &mut calib_core::Problem) {
    let known = fit.solution.parameters.iter();
    let ids: Vec<_> = known
        .filter_map(|p| Some((problem.find_parameter(&p.name)?, p.value)))
        .collect();
    for (id, value) in ids {
        problem.parameter_mut(id).start = value;
    }
}

/// The report's data of a choice.
struct Facts<'a> {
    inputs: &'a Inputs,
    parts: &'a Parts,
    found: &'a calib_core::Selection,
}

impl Facts<'_> {
    fn part(&self, part: usize) -> ModelPart {
        let model = &self.inputs.robot.model;
        let name = |joint| model.joint(joint).name.clone();
        let named = self.parts.named[part];
        let (kind, effect, other) = match named.what {
            What::Axis => (PartKind::Axis, None, None),
            What::Origin => (PartKind::Origin, None, None),
            What::Effect(effect) => (PartKind::Effect, Some(effect.id.to_owned()), None),
            What::Coupling(other) => (PartKind::Coupling, None, Some(name(other))),
            What::Masses => (PartKind::Masses, None, None),
        };
        ModelPart {
            kind,
            effect,
            joint: named.joint.map(name),
            other,
        }
    }

    fn all(&self, parts: &[usize]) -> Vec<ModelPart> {
        parts.iter().map(|p| self.part(*p)).collect()
    }

    fn step(&self, step: &calib_core::SelectionStep) -> SelectionStep {
        let folds = self.found.nested.as_ref();
        SelectionStep {
            part: self.part(step.part),
            outcome: match step.outcome {
                StepOutcome::Added => SelectionOutcome::Added,
                StepOutcome::NoBetter => SelectionOutcome::NoBetter,
                StepOutcome::Removed => SelectionOutcome::Removed,
                _ => SelectionOutcome::NotSignificant,
            },
            parameters: step.parameters,
            z2: step.z2,
            rank: step.rank,
            p_value: step.p_corrected,
            before_rms_m: step.rms.0,
            after_rms_m: step.rms.1,
            saved: step.gain.0,
            saved_error: step.gain.1,
            members: self.all(&step.members),
            alike: self.all(&step.alike),
            replaced_by: step.exchanged.last().map(|e| self.part(e.1)),
            in_folds: folds.map(|n| n.added[step.part]),
        }
    }

    fn selection(&self, solve: String) -> Selection {
        let found = self.found;
        let unsupported: Vec<usize> = found.unsupported.clone();
        let added: BTreeSet<usize> = found.parts.difference(&self.parts.first).copied().collect();
        Selection {
            steps: found.steps.iter().map(|s| self.step(s)).collect(),
            added: self.all(&added.into_iter().collect::<Vec<_>>()),
            unsupported: self.all(&unsupported),
            tested: found.tested,
            first_parameters: found.ranks.0,
            chosen_parameters: found.ranks.1,
            first_rms_m: found.rms.0,
            chosen_rms_m: found.rms.1,
            nested: found.nested.as_ref().map(|n| NestedSelection {
                folds: n.folds,
                rms_m: n.rms,
                first_rms_m: n.rms_first,
                chosen_rms_m: n.rms_chosen,
            }),
            sigma_factor: None,
            solve,
        }
    }
}
