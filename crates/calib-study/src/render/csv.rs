//! Every cell as a row, SI units.

use csv::WriterBuilder;

use crate::{cell::Cell, run::StudyResult, settings::Study};

/// Columns of the table.
const HEADER: [&str; 26] = [
    "study",
    "part",
    "motion",
    "condition",
    "samples",
    "radius_m",
    "sigma_t_m",
    "sigma_r_rad",
    "method",
    "estimator",
    "quantity",
    "unit",
    "trials",
    "answered",
    "observable",
    "rms",
    "rms_mc",
    "mean_abs",
    "bias",
    "bias_mc",
    "bound",
    "efficiency",
    "efficiency_mc",
    "covariance_ratio",
    "unbiased_limit",
    "second_order_limit",
];

/// One row for each cell. Lengths in m, angles in rad; errors in the column `unit`. Empty: not measured.
#[must_use]
pub fn csv(result: &StudyResult) -> String {
    let mut writer = WriterBuilder::new().from_writer(Vec::new());
    // Neither memory nor rows of one length can fail.
    let _ = writer.write_record(HEADER);
    for cell in &result.cells {
        let _ = writer.write_record(row(result.study, cell));
    }
    let bytes = writer.into_inner().unwrap_or_default();
    String::from_utf8(bytes).unwrap_or_default()
}

/// The texts of one row, in the order of the columns.
fn row(study: Study, cell: &Cell) -> [String; 26] {
    let s = &cell.scene;
    let measured = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    [
        study.word().to_owned(),
        s.part.word().to_owned(),
        s.motion.clone(),
        s.condition.clone(),
        s.samples.to_string(),
        s.radius_m.to_string(),
        s.sigma_t_m.to_string(),
        s.sigma_r_rad.to_string(),
        cell.method.clone(),
        cell.estimator.clone(),
        cell.quantity.word().to_owned(),
        cell.quantity.unit().to_owned(),
        cell.trials.to_string(),
        cell.answered.to_string(),
        cell.observable.to_string(),
        measured(cell.rms),
        measured(cell.rms_mc),
        measured(cell.mean_abs),
        measured(cell.bias),
        measured(cell.bias_mc),
        measured(cell.bound),
        measured(cell.efficiency),
        measured(cell.efficiency_mc),
        measured(cell.covariance_ratio),
        measured(cell.unbiased_limit),
        measured(cell.second_order_limit),
    ]
}
