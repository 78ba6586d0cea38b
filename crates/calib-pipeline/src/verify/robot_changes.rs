//! What changed of the robot itself: its dimensions that no choice of frames changes, before and after.

use std::collections::BTreeMap;

use calib_report::{DataInformation, Quantity, RobotChange, Unit};
use nalgebra::DVector;

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::Inputs;
use crate::verify::invariants::invariants;

/// The gauge-free numbers of the robot with their nominal values and their σ, the most significant first.
#[must_use]
pub fn robot_changes(inputs: &Inputs, fit: &MlFit, of: &DataInformation) -> Vec<RobotChange> {
    let nominal: BTreeMap<String, f64> = invariants(&inputs.robot.model)
        .into_iter()
        .map(|q| (q.name, q.value))
        .collect();
    let all = of.quantities.iter().map(|quantity| {
        let gradient = gradient(fit, quantity);
        let before = nominal.get(&quantity.name).copied();
        let change = before.map(|before| difference(quantity, before));
        let information = &fit.solution.information;
        let variance = (&information.covariance * &gradient).dot(&gradient);
        RobotChange {
            name: quantity.name.clone(),
            text: quantity.text.clone(),
            unit: quantity.unit,
            nominal: before,
            // On the nominal value's side of ±180°.
            value: before
                .zip(change)
                .map_or(quantity.value, |(before, change)| before + change),
            change,
            sigma: Some(variance.max(0.0).sqrt()).filter(|sigma| sigma.is_finite()),
            measured: measured(fit, &gradient),
        }
    });
    RobotChange::sorted(all.collect())
}

/// Value − nominal, an angle by the shorter way round.
fn difference(quantity: &Quantity, nominal: f64) -> f64 {
    let plain = quantity.value - nominal;
    if quantity.unit == Unit::Radian {
        plain.sin().atan2(plain.cos())
    } else {
        plain
    }
}

/// Derivative by the free parameters, in the order of the information's columns.
fn gradient(fit: &MlFit, quantity: &Quantity) -> DVector<f64> {
    let free = fit.solution.model.free_parameters();
    let names = free.iter().map(|p| &fit.solution.parameters[*p].name);
    let of = |name: &String| {
        let terms = quantity.gradient.iter();
        let mut of_name = terms.filter(|term| term.parameter == *name);
        of_name.next().map_or(0.0, |term| term.coefficient)
    };
    DVector::from_iterator(free.len(), names.map(of))
}

/// Whether the data alone determine a number: its gradient has no part along what they do not see.
pub(crate) fn measured(fit: &MlFit, gradient: &DVector<f64>) -> bool {
    /// A share of the null space below this is rounding; as in `calib-core`.
    const INDETERMINATE: f64 = 1e-5;
    let information = &fit.solution.information;
    let scaled = gradient.component_mul(&information.scale);
    let leak = information.null_space().tr_mul(&scaled).norm();
    let norm = scaled.norm();
    norm > 0.0 && leak <= INDETERMINATE * norm
}
