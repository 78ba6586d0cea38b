//! What the data of a fit say about its parameters, for `report.json`: the prior is left out, so that two calibrations
//! that share it can be compared as if they were independent, which their data are.

use calib_report::{DataInformation, Quantity, Term};
use nalgebra::DMatrix;

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::Inputs;
use crate::verify::invariants::{Invariant, invariants};

/// The square root of the data's information and the gauge-free numbers of the robot, with their derivatives.
#[must_use]
pub fn data_information(inputs: &Inputs, fit: &MlFit) -> DataInformation {
    let solution = &fit.solution;
    let free = solution.model.free_parameters();
    let information = &solution.information;
    // A parameter on one of its limits is held there: its own gradient is the limit's, not the data's.
    let columns: Vec<usize> = (0..free.len())
        .filter(|c| !solution.parameters[free[*c]].at_bound)
        .collect();
    let n = columns.len();
    if n == 0 {
        return DataInformation::default();
    }
    // The triangular factor is unique up to signs.
    let mut root: DMatrix<f64> = information.root.select_columns(&columns).qr().r();
    for (c, &column) in columns.iter().enumerate() {
        root.column_mut(c).unscale_mut(information.scale[column]);
    }
    let free: Vec<usize> = columns.iter().map(|&c| free[c]).collect();
    for r in 0..n {
        if root[(r, r)] < 0.0 {
            root.row_mut(r).neg_mut();
        }
    }
    let of_problem = solution.model.problem().parameters();
    DataInformation {
        parameters: free
            .iter()
            .map(|&p| solution.parameters[p].name.clone())
            .collect(),
        prior_sigma: free.iter().map(|&p| of_problem[p].prior_sigma).collect(),
        root: (0..n)
            .map(|r| root.view((r, r), (1, n - r)).iter().copied().collect())
            .collect(),
        degrees_of_freedom: solution.degrees_of_freedom,
        quantities: quantities(inputs, fit),
        effect_signs: Some(EFFECT_SIGNS),
    }
}

/// Signs as in version 2 of the effects file: compliance gives way, backlash is against the approach.
const EFFECT_SIGNS: u32 = 2;

/// A step for central differences: far above rounding, far below anything that bends (in the parameter's unit).
const STEP: f64 = 1e-5;

fn quantities(inputs: &Inputs, fit: &MlFit) -> Vec<Quantity> {
    let solution = &fit.solution;
    let at = |values: &calib_core::Values| {
        let robot =
            crate::formulate::ml::calibration_at(&fit.formulation, &solution.model, values, inputs);
        invariants(&robot.urdf_model())
    };
    let found = at(&solution.values);
    let mut quantities: Vec<Quantity> = found
        .iter()
        .map(|q| Quantity {
            name: q.name.clone(),
            text: q.text.clone(),
            unit: q.unit,
            value: q.value,
            gradient: Vec::new(),
        })
        .collect();
    for &p in solution.model.free_parameters() {
        // Only what belongs to a joint moves an axis.
        if solution.parameters[p].joint.is_none() {
            continue;
        }
        let shifted = |step: f64| {
            let mut values = solution.values.clone();
            values.0[p] += step;
            at(&values)
        };
        let (plus, minus) = (shifted(STEP), shifted(-STEP));
        for (quantity, name) in quantities.iter_mut().zip(&found) {
            let value = |of: &[Invariant]| {
                let same = |q: &&Invariant| (q.kind, q.joints) == (name.kind, name.joints);
                of.iter().find(same).map(|q| q.value)
            };
            let (Some(high), Some(low)) = (value(&plus), value(&minus)) else {
                continue;
            };
            let coefficient = difference(name, high, low) / (2.0 * STEP);
            /// A derivative below this is rounding of the difference.
            const NOTHING: f64 = 1e-9;
            if coefficient.abs() > NOTHING {
                quantity.gradient.push(Term {
                    parameter: solution.parameters[p].name.clone(),
                    coefficient,
                });
            }
        }
    }
    quantities.retain(|q| !q.gradient.is_empty());
    quantities
}

/// `high − low`, an angle by the shorter way round.
fn difference(of: &Invariant, high: f64, low: f64) -> f64 {
    let plain = high - low;
    if of.is_angle() {
        plain.sin().atan2(plain.cos())
    } else {
        plain
    }
}
