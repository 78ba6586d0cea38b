//! The kinematic table of the report: the chain to the tool before and after, with the σ of every number.

use calib_geometry::so3::rpy_to_read;
use calib_report::{DhTable, DhTableRow, DhValue, Unit};
use calib_urdf::LinkId;
use nalgebra::{DVector, Isometry3};

use crate::formulate::formulation::MlFit;
use crate::formulate::ml::calibration_at;
use crate::prepare::inputs::Inputs;
use crate::verify::accuracy::tool_link;
use crate::verify::hayati::{DhChain, DhParameter, dh_chain};
use crate::verify::robot_changes::measured;

/// A step for central differences: far above rounding, far below anything that bends (in the parameter's unit).
const STEP: f64 = 1e-5;

/// The table of the chain that carries the tool; `None` where fewer than two joints move it.
#[must_use]
pub(crate) fn dh_table(inputs: &Inputs, fit: &MlFit) -> Option<DhTable> {
    let model = &inputs.robot.model;
    let link = tool_link(inputs)?;
    let nominal = dh_chain(model, link, None)?;
    let forms = nominal.forms();
    let at = |values: &calib_core::Values| {
        let robot = calibration_at(&fit.formulation, &fit.solution.model, values, inputs);
        dh_chain(&robot.urdf_model(), link, Some(&forms))
    };
    let found = at(&fit.solution.values)?;
    let free = fit.solution.model.free_parameters();
    let numbers = numbers(&found).len();
    let mut gradients = vec![DVector::zeros(free.len()); numbers];
    for (column, &p) in free.iter().enumerate() {
        // Only what belongs to a joint moves an axis.
        if fit.solution.parameters[p].joint.is_none() {
            continue;
        }
        let shifted = |step: f64| {
            let mut values = fit.solution.values.clone();
            values.0[p] += step;
            at(&values).map(|chain| self::numbers(&chain))
        };
        let (plus, minus) = (shifted(STEP)?, shifted(-STEP)?);
        for (gradient, (high, low)) in gradients.iter_mut().zip(plus.iter().zip(&minus)) {
            gradient[column] = difference(high.0, high.1, low.1) / (2.0 * STEP);
        }
    }
    Some(table(inputs, (&nominal, &found), link, |i| {
        let gradient = &gradients[i];
        let variance = (&fit.solution.information.covariance * gradient).dot(gradient);
        // What no free parameter moves was held: nothing is known of its error.
        let sigma = Some(variance.max(0.0).sqrt()).filter(|s| s.is_finite() && *s > ROUNDING);
        (sigma, measured(fit, gradient))
    }))
}

/// A standard deviation below this, rad or m, is what rounding leaves of none.
const ROUNDING: f64 = 1e-12;

/// The numbers of all rows, one after the other.
fn numbers(chain: &DhChain) -> Vec<(DhParameter, f64)> {
    chain.rows.iter().flat_map(|row| row.values).collect()
}

/// high − low, an angle by the shorter way round.
fn difference(parameter: DhParameter, high: f64, low: f64) -> f64 {
    let plain = high - low;
    if parameter.is_angle() {
        plain.sin().atan2(plain.cos())
    } else {
        plain
    }
}

/// `known`: σ of a number, and whether it is measured.
fn table(
    inputs: &Inputs,
    (nominal, found): (&DhChain, &DhChain),
    link: LinkId,
    known: impl Fn(usize) -> (Option<f64>, bool),
) -> DhTable {
    let model = &inputs.robot.model;
    let name = |joint| model.joint(joint).name.clone();
    let mut i = 0;
    let rows = nominal.rows.iter().zip(&found.rows).map(|(before, after)| {
        let values = before.values.iter().zip(&after.values);
        let values = values.map(|((parameter, nominal), (_, value))| {
            let (sigma, measured) = known(i);
            i += 1;
            DhValue {
                parameter: word(*parameter).to_owned(),
                unit: if parameter.is_angle() {
                    Unit::Radian
                } else {
                    Unit::Meter
                },
                nominal: *nominal,
                value: nominal + difference(*parameter, *value, *nominal),
                sigma,
                measured,
            }
        });
        DhTableRow {
            joint: name(before.joint),
            values: values.collect(),
        }
    });
    DhTable {
        rows: rows.collect(),
        root: model.link(model.root()).name.clone(),
        link: model.link(link).name.clone(),
        last_joint: name(nominal.last),
        root_from_first: [pose(&nominal.root_from_first), pose(&found.root_from_first)],
        last_from_link: [pose(&nominal.last_from_link), pose(&found.last_from_link)],
    }
}

fn pose(a_from_b: &Isometry3<f64>) -> [f64; 6] {
    let t = a_from_b.translation.vector;
    let [roll, pitch, yaw] = rpy_to_read(&a_from_b.rotation);
    [t.x, t.y, t.z, roll, pitch, yaw]
}

fn word(parameter: DhParameter) -> &'static str {
    match parameter {
        DhParameter::Theta => "theta",
        DhParameter::D => "d",
        DhParameter::A => "a",
        DhParameter::Alpha => "alpha",
        DhParameter::Beta => "beta",
    }
}
