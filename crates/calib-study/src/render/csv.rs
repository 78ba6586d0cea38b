//! Every cell as a row, SI units.

use std::fmt::Write;

use crate::run::StudyResult;

/// One row for each cell. Lengths in m, angles in rad; errors in the column `unit`. Empty: not measured.
#[must_use]
pub fn csv(result: &StudyResult) -> String {
    let mut out = String::from(
        "study,part,motion,condition,samples,radius_m,sigma_t_m,sigma_r_rad,method,estimator,quantity,unit,trials,answered,observable,\
         rms,rms_mc,mean_abs,bias,bias_mc,bound,efficiency,efficiency_mc,covariance_ratio,unbiased_limit,second_order_limit\n",
    );
    for cell in &result.cells {
        let s = &cell.scene;
        let _ = write!(
            out,
            "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
            result.study.word(),
            s.part.word(),
            quoted(&s.motion),
            quoted(&s.condition),
            s.samples,
            s.radius_m,
            s.sigma_t_m,
            s.sigma_r_rad,
            quoted(&cell.method),
            cell.estimator,
            cell.quantity.word(),
            cell.quantity.unit(),
            cell.trials,
            cell.answered,
            cell.observable,
        );
        for value in [
            cell.rms,
            cell.rms_mc,
            cell.mean_abs,
            cell.bias,
            cell.bias_mc,
            cell.bound,
            cell.efficiency,
            cell.efficiency_mc,
            cell.covariance_ratio,
            cell.unbiased_limit,
            cell.second_order_limit,
        ] {
            out.push(',');
            if let Some(value) = value {
                let _ = write!(out, "{value}");
            }
        }
        out.push('\n');
    }
    out
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
