//! `calib fit cor`.

use std::fmt::Write as _;

use calib_cor::{CorEstimate, Shape};
use serde_json::json;

use crate::comparison::comparison;
use crate::error::FitError;
use crate::road::{self, Road};
use crate::table::Table;
use crate::{Answer, TableRequest, answer, coordinates, doubt, listed, matrix, not_observable};

/// Without a named estimator, rows that raise the residuals by more than this factor are rejected: they are not noise.
const GROSS: f64 = 3.0;

/// `calib fit cor`.
///
/// # Errors
/// [`FitError`] for tables that cannot be read and estimators that do not fit them.
pub fn cor(request: &TableRequest) -> Result<Answer, FitError> {
    if request.list {
        let rows = calib_cor::estimators()
            .iter()
            .map(|e| (e.id, e.input.to_string(), e.name, e.source));
        return Ok(listed(rows));
    }
    let table = Table::read(request)?;
    let options = road::options(request, &table)?;
    let tracks = table.tracks();
    let road = Road {
        table: &table,
        tracks: &tracks,
        options: &options,
        estimators: calib_cor::estimators(),
        command: "calib fit cor",
    };
    road.check()?;
    if request.all {
        let mut lines = Vec::new();
        for info in calib_cor::estimators() {
            if let Ok(outcome) = road.run_with_its_own(info) {
                let point = outcome
                    .estimate()
                    .map(|e| (e.center.coords, e.covariance.trace().max(0.0).sqrt()));
                lines.push((
                    info.id,
                    outcome.verdict().as_str(),
                    outcome.reason().unwrap_or("").to_owned(),
                    point,
                ));
            }
        }
        return Ok(comparison("center_m", &lines));
    }
    let id = match &request.estimator {
        Some(id) => id.as_str(),
        None => preferred(&road),
    };
    let outcome = calib_cor::estimator(id)
        .and_then(|info| road.run(info))
        .map_err(|e| road.refusal(id, &e))?;
    Ok(cor_answer(&table, id, &outcome))
}

/// The estimator for a table where none was named.
fn preferred(road: &Road<'_, CorEstimate>) -> &'static str {
    let options = road.options;
    if options.noise_per_marker || !options.covariances.is_empty() {
        "sphere_eiv"
    } else if road.table.pair.is_some() {
        "score"
    } else if road.table.body.is_some() {
        // A rigid body: pivot calibration as everybody else does it. `--all` shows the likelihood estimates beside it.
        let rms = |id: &str| {
            let outcome = road.run_with_its_own(calib_cor::estimator(id).ok()?).ok()?;
            outcome.estimate().map(|e| e.rms)
        };
        match (rms("hse"), rms("consensus")) {
            (Some(all), Some(inliers)) if GROSS * inliers < all => "consensus",
            _ => "hse",
        }
    } else {
        "sfe"
    }
}

fn cor_answer(table: &Table, id: &str, outcome: &calib_cor::Outcome) -> Answer {
    let Some(e) = outcome.estimate() else {
        return not_observable(
            id,
            outcome.verdict().as_str(),
            outcome.reason().unwrap_or(""),
        );
    };
    let rejected: Vec<u64> = e
        .rejected
        .iter()
        .filter_map(|r| table.rows.get(r.row).copied())
        .collect();
    let mut value = json!({
        "estimator": id,
        "observable": outcome.is_observable(),
        "verdict": outcome.verdict().as_str(),
        "reason": e.reason,
        "center_m": e.center.coords.as_slice(),
    });
    let mut text = format!(
        "{id}: center {} m\n",
        coordinates(e.center.coords.as_slice())
    );
    text += &doubt(e.reason.as_deref());
    let sigma = e.covariance.diagonal().map(|v| v.max(0.0).sqrt() * 1e3);
    let _ = writeln!(
        text,
        "  sigma  {:.4}, {:.4}, {:.4} mm",
        sigma.x, sigma.y, sigma.z
    );
    match &e.shape {
        Shape::Radii { radii, .. } => {
            value["radius_m"] = if radii.len() == 1 {
                json!(radii[0])
            } else {
                json!(radii)
            };
            let shown: Vec<String> = radii.iter().map(|r| format!("{:.3}", r * 1e3)).collect();
            let _ = writeln!(text, "  radius {} mm", shown.join(", "));
        }
        Shape::BodyPoint { body_point, .. } => {
            value["offset_m"] = json!(body_point.coords.as_slice());
            let _ = writeln!(
                text,
                "  offset {} m in the body",
                coordinates(body_point.coords.as_slice())
            );
        }
        Shape::BodyPoints {
            in_first,
            in_second,
            mean_gap,
            ..
        } => {
            value["in_parent_m"] = json!(in_first.coords.as_slice());
            value["in_child_m"] = json!(in_second.coords.as_slice());
            value["mean_gap_m"] = json!(mean_gap);
            let _ = writeln!(
                text,
                "  in parent {} m, in child {} m, mean gap {:.3} mm",
                coordinates(in_first.coords.as_slice()),
                coordinates(in_second.coords.as_slice()),
                mean_gap * 1e3
            );
        }
        _ => {}
    }
    value["covariance"] = matrix(
        e.covariance
            .row_iter()
            .map(|r| r.iter().copied().collect())
            .collect(),
    );
    value["rms_m"] = json!(e.rms);
    value["used"] = json!(e.used);
    value["rejected"] = json!(rejected);
    let _ = writeln!(
        text,
        "  rms {:.4} mm, {} samples used, {} rejected",
        e.rms * 1e3,
        e.used,
        rejected.len()
    );
    answer(text, &value, outcome.is_observable())
}
