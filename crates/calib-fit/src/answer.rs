//! An answer for people and for machines, and the parts that all answers share.

use std::fmt::Write as _;

use calib_estimator::{
    Estimate, EstimatorInfo, NotObservable, chance::t_quantile, noise::Contradiction,
};
use nalgebra::{Isometry3, SMatrix};
use serde_json::{Value, json};

/// An answer in both forms.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Answer {
    /// For people.
    pub text: String,
    /// For machines.
    pub json: String,
    /// The quantity is determined by the data.
    pub observable: bool,
}

/// What the rows and columns of a center's covariance are of.
pub(crate) const OF_CENTER: [&str; 3] = ["center_x_m", "center_y_m", "center_z_m"];
/// The same of an axis.
pub(crate) const OF_LINE: [&str; 6] = [
    "direction_x",
    "direction_y",
    "direction_z",
    "point_x_m",
    "point_y_m",
    "point_z_m",
];
/// The same of a frame: small rotations about and translations along its own axes.
pub(crate) const OF_FRAME: [&str; 6] = [
    "about_x_rad",
    "about_y_rad",
    "about_z_rad",
    "along_x_m",
    "along_y_m",
    "along_z_m",
];

pub(crate) fn answer(text: String, value: &Value, observable: bool) -> Answer {
    let json = calib_report::json::pretty(&calib_report::json::rounded(value.clone())) + "\n";
    Answer {
        text,
        json,
        observable,
    }
}

/// The line of an answer that is not to be relied upon.
pub(crate) fn doubt(reason: Option<&str>) -> String {
    reason.map_or_else(String::new, |why| format!("  weak: {why}\n"))
}

/// Rows that were left out as copies of others.
pub(crate) fn copied(copies: usize) -> String {
    match copies {
        0 => String::new(),
        1 => "  1 row repeats an earlier one to the last digit: it counts once\n".to_owned(),
        n => format!("  {n} rows repeat earlier ones to the last digit: each counts once\n"),
    }
}

/// How far the intervals of 95 % reach: σ times Student's quantile, which few degrees of freedom widen.
pub(crate) fn freedom(degrees_of_freedom: Option<f64>) -> String {
    match degrees_of_freedom {
        Some(dof) => format!(
            "  95 % intervals: {:.2} sigma ({dof:.0} degrees of freedom)\n",
            t_quantile(0.05, degrees_of_freedom)
        ),
        None => String::new(),
    }
}

/// How often chance alone does this, as people say it.
fn by_chance(chance: f64) -> String {
    match 1.0 / chance {
        times if times > 1e6 => "by chance less than once in 1 000 000".to_owned(),
        times if times > 2.0 => format!("by chance once in {times:.0}"),
        _ => format!("by chance in {:.0} %", chance * 100.0),
    }
}

/// A stated noise that the residuals exceed.
pub(crate) fn contradicted(found: Option<&Contradiction>) -> String {
    found.map_or_else(String::new, |c| {
        format!(
            "  noise: the residuals show {:.2} times what was stated ({}); sigma follows the residuals\n",
            c.ratio,
            by_chance(c.chance)
        )
    })
}

/// The data do not answer.
pub(crate) fn not_observable<K>(id: &str, why: &NotObservable<K>) -> Answer {
    let (verdict, reason) = (why.verdict.as_str(), &why.reason);
    let value =
        json!({ "estimator": id, "observable": false, "verdict": verdict, "reason": reason });
    answer(
        format!("{id}: not observable ({verdict}): {reason}\n"),
        &value,
        false,
    )
}

/// The estimators of a command.
pub(crate) fn listed<E: Estimate>(estimators: &[EstimatorInfo<E>]) -> Answer {
    let mut text = String::new();
    let mut values = Vec::new();
    for EstimatorInfo {
        id,
        input,
        name,
        source,
        ..
    } in estimators
    {
        let input = input.to_string();
        let _ = writeln!(text, "{id:<16} {input:<10} {name} ({source})");
        values.push(json!({ "id": id, "input": input, "name": name, "source": source }));
    }
    answer(text, &Value::Array(values), true)
}

pub(crate) fn coordinates(values: &[f64]) -> String {
    let shown: Vec<String> = values.iter().map(|v| format!("{v:.6}")).collect();
    format!("[{}]", shown.join(", "))
}

/// The rows of a matrix.
pub(crate) fn matrix<const N: usize>(m: &SMatrix<f64, N, N>) -> Value {
    let rows = m.row_iter().map(|r| r.iter().copied().collect());
    json!(rows.collect::<Vec<Vec<f64>>>())
}

pub(crate) fn pose_value(pose: &Isometry3<f64>) -> Value {
    json!({ "translation_m": pose.translation.vector.as_slice(), "rotation_xyzw": pose.rotation.coords.as_slice() })
}

pub(crate) fn pose_text(pose: &Isometry3<f64>) -> String {
    format!(
        "xyz {} m, xyzw {}",
        coordinates(pose.translation.vector.as_slice()),
        coordinates(pose.rotation.coords.as_slice())
    )
}
