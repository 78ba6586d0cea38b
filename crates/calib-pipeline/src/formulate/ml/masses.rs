//! First moments of the masses that load the compliant joints, as parameters.
//!
//! ```text
//! F_j(s) = F_j⁰(s) + Σ_k ∂F_j/∂h_k(s) δh_k      h_k = m_k c_k + Σ_{joints i on k} M_i r_i        (1)
//! ```
//!
//! M_i is the mass that hangs on link k at the joint i, r_i where: a mass further out acts on the joints before k as if it were
//! there. The h are all that static postures can tell of the masses (the base inertial parameters of gravity); a single mass or
//! center is not among them. Their scale is a gauge against the compliances, which the priors of both hold.

use calib_core::effect::{Drives, Source};
use calib_core::{EdgeKind, EffectKind, Parameter, ParameterId, ParameterKind, Share, Unit};

use super::joints::Row;
use crate::formulate::formulation::Formulation;
use crate::prepare::inputs::Inputs;
use crate::prepare::loads::FirstMoment;

/// A first moment that changes no load by this much, N m per kg m, is not seen (gravity along an axis).
const UNSEEN: f64 = 1e-6;

/// Axes of a link's frame.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Frees the first moments of all moved links that load a joint with a free effect of its load.
pub(super) fn free_masses(formulation: &mut Formulation, inputs: &Inputs, rows: &[Row<'_>]) {
    let effects = loaded_effects(formulation, inputs);
    let model = &inputs.robot.model;
    let masses = &inputs.robot.masses;
    let moved = model.joint_ids().filter(|j| {
        let used = formulation.joints[j.index()].is_some();
        used && model.joint(*j).kind.axis().is_some()
    });
    let links = moved.map(|j| model.joint(j).child);
    let all: Vec<FirstMoment> = links
        .flat_map(|link| (0..3).map(move |axis| (link, axis)))
        .collect();
    // Per effect, sample and moment.
    let tables: Vec<Vec<Vec<f64>>> = effects
        .iter()
        .map(|(joint, kind)| {
            let at = |row: &Row<'_>| masses.shares(row.q, *joint, *kind, &all);
            rows.iter().map(at).collect()
        })
        .collect();
    let prior = &inputs.robot.profile.solve.prior;
    let mut seen: Vec<(usize, ParameterId)> = Vec::new();
    for (i, moment) in all.iter().enumerate() {
        let sees = |row: &Vec<f64>| row[i].abs() > UNSEEN;
        let sigma = masses.moment_sigma(moment.0, prior)[moment.1];
        // A link without mass, with nothing on it, has none.
        if sigma <= 0.0 || !tables.iter().flatten().any(sees) {
            continue;
        }
        let parameter = parameter(inputs, *moment, sigma);
        let id = formulation.problem.parameter(parameter);
        formulation.masses.push((*moment, id));
        seen.push((i, id));
    }
    for ((joint, kind), table) in effects.iter().zip(&tables) {
        let shares = seen.iter().map(|(i, parameter)| Share {
            parameter: *parameter,
            values: table.iter().map(|row| row[*i]).collect(),
        });
        if let Some(edge) = formulation.joints[joint.index()] {
            formulation.problem.follow(edge, *kind, shares.collect());
        }
    }
}

/// Free or given effects whose regressor is computed from masses.
fn loaded_effects(
    formulation: &Formulation,
    inputs: &Inputs,
) -> Vec<(calib_urdf::JointId, EffectKind)> {
    let measured = inputs.robot.profile.solve.load == calib_profile::Load::Measured;
    let mut found = Vec::new();
    for joint in inputs.robot.model.joint_ids() {
        let edge = formulation.joints[joint.index()];
        let edge = edge.map(|e| &formulation.problem.edges()[e.index()].kind);
        let Some(EdgeKind::Joint(j)) = edge else {
            continue;
        };
        let by_masses = |kind: &EffectKind| {
            let about = kind.drives() == Drives::About;
            kind.term().source == Source::Load && !(measured && about)
        };
        let kinds = j.effects.iter().map(|f| f.kind).filter(by_masses);
        found.extend(kinds.map(|kind| (joint, kind)));
    }
    found
}

fn parameter(inputs: &Inputs, (link, axis): FirstMoment, sigma: f64) -> Parameter {
    let model = &inputs.robot.model;
    let joint = model.link(link).parent_joint;
    let joint = joint.map(|j| model.joint(j).name.clone());
    let of = joint.as_deref().unwrap_or(&model.link(link).name);
    Parameter {
        name: format!("{of}.first_moment.{}", AXES[axis]),
        joint,
        kind: ParameterKind::Load,
        unit: Unit::KilogramMeter,
        nominal: 0.0,
        start: 0.0,
        prior_sigma: Some(sigma),
        bounds: None,
        fixed: false,
    }
}
