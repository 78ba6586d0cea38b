//! The effects of plugins that a profile names, made ready and tried.

use calib_core::effect::{EFFECTS, Effect};
use calib_core::{EffectKind, JointState};
use calib_finding::Fact;
use calib_plugin::{DependsOn, PluginError};
use calib_profile::{Free, FreeEffect, Method};

use crate::error::PipelineError;
use crate::prepare::estimators::{Estimators, values};
use crate::prepare::inputs::{Inputs, RobotProfile};
use crate::prepare::plugin_effect::PluginEffect;

/// Makes the effects that the profile names ready, and part of what is free of their joints.
///
/// # Errors
/// [`PipelineError::Plugin`] for names and parameters that are not there, and for joints that cannot have the effect.
pub(crate) fn resolve(
    robot: &mut RobotProfile,
    estimators: &mut Estimators,
) -> Result<(), PipelineError> {
    let masses = robot.profile.solve.free.contains(&Free::Masses);
    for (joint, exception) in &mut robot.profile.solve.joints {
        let of = robot.model.joint(*joint);
        for (name, parameters) in &exception.effects {
            let entry = estimators.tables.effect.get(name)?;
            let term = entry.term();
            let geared = robot.masses.drives()[joint.index()].gear_ratio != 0.0;
            let terms = || EFFECTS.iter().flat_map(|e| e.terms);
            let why = if of.kind.axis().is_none() {
                "the joint is fixed"
            } else if term.revolute_only && !of.kind.turns() {
                "it is an effect of turning joints, and this one slides"
            } else if term.depends_on == DependsOn::Motor && !geared {
                "it depends on the motor's angle, and `robot.gear_ratio` does not state one for the joint"
            } else if term.depends_on == DependsOn::Load && masses {
                "it depends on the load, and the masses that load the joint are free"
            } else if terms().any(|t| t.name == *name) || EFFECTS.iter().any(|e| e.id == *name) {
                "an effect of the program has this name"
            } else {
                ""
            };
            if !why.is_empty() {
                return Err(PipelineError::from(PluginError::Joint {
                    of: entry.title(),
                    joint: of.name.clone(),
                    why,
                }));
            }
            let made = PluginEffect::new(entry, &values(parameters), !of.kind.turns())?;
            exception.outside.push(FreeEffect {
                effect: made.outside.effect(),
                sigma: Some(term.prior_sigma),
                width: None,
                within: None,
            });
            estimators.effects.push(made);
        }
    }
    Ok(())
}

/// Refuses effects where the closed forms would leave them out.
///
/// # Errors
/// [`PipelineError::Plugin`].
pub(crate) fn taken(inputs: &Inputs, method: Method) -> Result<(), PipelineError> {
    let joints = inputs.robot.profile.solve.joints.iter();
    for (joint, exception) in joints.filter(|_| method == Method::Paper) {
        if let Some(name) = exception.effects.keys().next() {
            return Err(PipelineError::from(PluginError::Joint {
                of: inputs.estimators.tables.effect.get(name)?.title(),
                joint: inputs.robot.model.joint(*joint).name.clone(),
                why: "`method: paper` estimates no joint effects, `method: ml` does",
            }));
        }
    }
    Ok(())
}

/// Evaluates every effect at all readings once, so that one which fails is named before anything is computed.
///
/// # Errors
/// [`PipelineError::Plugin`].
pub(crate) fn evaluate(inputs: &Inputs) -> Result<(), PipelineError> {
    let robot = &inputs.robot;
    for (joint, exception) in &robot.profile.solve.joints {
        let gear_ratio = robot.masses.drives()[joint.index()].gear_ratio;
        let rows = inputs
            .recordings
            .values()
            .flat_map(|r| r.q.iter().flatten());
        for q in rows.filter(|_| !exception.outside.is_empty()) {
            let q = robot.model.position(q, *joint);
            let state = JointState {
                q,
                motor: gear_ratio * q,
                ..JointState::default()
            };
            for free in &exception.outside {
                // What it gives is asked for again by the fit; here only whether it gives anything.
                let _ = free.effect.terms[0].regressor.at(&state);
            }
        }
    }
    Ok(inputs.estimators.evaluated()?)
}

/// What the profile is to state as free of a joint, so that an effect is free beside what is free of it now; `None` for an unknown joint.
pub(crate) fn free_with(inputs: &Inputs, joint: &str, effect: &'static Effect) -> Option<Fact> {
    let model = &inputs.robot.model;
    let id = model.joint_id(joint).ok()?;
    let solve = &inputs.robot.profile.solve;
    let free = solve.free_with(id, !model.joint(id).kind.turns(), effect);
    Some(Fact::names(free.iter().map(|free| free.key().to_owned())))
}

/// The same of its gain.
pub(crate) fn free_with_gain(inputs: &Inputs, joint: &str) -> Option<Fact> {
    free_with(inputs, joint, EffectKind::Gain.effect())
}
