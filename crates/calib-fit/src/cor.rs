//! `calib fit cor`.

use std::fmt::Write as _;

use calib_cor::{CorError, InputKind, Shape};
use serde_json::json;

use crate::comparison::comparison;
use crate::error::FitError;
use crate::table::Table;
use crate::{
    Answer, TableRequest, answer, coordinates, data, doubt, listed, matrix, not_observable,
    unknown, usage,
};

/// The estimators that weigh samples by their covariance, or markers by a noise of their own.
const WEIGHING: [&str; 2] = ["sphere_eiv", "ml_sphere"];

/// Without a named estimator, rows that raise the residuals so many times are left out: they are no noise.
const GROSS: f64 = 3.0;

/// `calib fit cor`.
///
/// # Errors
/// [`FitError`] for tables that cannot be read and estimators that do not fit them.
pub fn cor(request: &TableRequest) -> Result<Answer, FitError> {
    if request.list {
        let rows = calib_cor::estimators()
            .iter()
            .map(|e| (e.id, format!("{:?}", e.input), e.name, e.source));
        return Ok(listed(rows));
    }
    let table = Table::read(request)?;
    let options = calib_cor::Options {
        sigma_t: request.sigma_m,
        sigma_r: request.sigma_rad,
        covariances: table.covariances.clone(),
        weights: table.weights.clone(),
        noise_per_marker: request.noise_per_marker,
        ..Default::default()
    };
    for (given, flag) in [
        (request.joint.is_some(), "--joint"),
        (request.center_m.is_some(), "--center-m"),
        (request.towards.is_some(), "--towards"),
    ] {
        if given {
            return Err(usage(
                format!("{flag} is for axes"),
                "leave it out, or ask `calib fit aor`",
            ));
        }
    }
    let weighing = request.noise_per_marker || !table.covariances.is_empty();
    if let Some(id) = &request.estimator
        && weighing
        && !WEIGHING.contains(&id.as_str())
    {
        return Err(usage(
            format!("`{id}` takes all samples for equally good"),
            format!("weigh them with --estimator {}", WEIGHING.join(" or ")),
        ));
    }
    let tracks = table.tracks();
    let run = |id: &str| -> Result<calib_cor::Outcome, CorError> {
        let info = calib_cor::estimator(id)?;
        match (info.input, &table.body, &table.pair) {
            (InputKind::TwoBodies, _, Some([first, second])) => {
                calib_cor::fit(id, &calib_cor::Input::TwoBodies { first, second }, &options)
            }
            (InputKind::Poses | InputKind::PointsOrPoses, Some(poses), _) => {
                calib_cor::fit(id, &calib_cor::Input::Poses(poses), &options)
            }
            _ if table.origin_only => {
                calib_cor::fit(id, &calib_cor::Input::Points(&tracks), &options)
            }
            _ => calib_cor::fit(id, &calib_cor::Input::Markers(&tracks), &options),
        }
    };
    if request.all {
        let mut lines = Vec::new();
        for info in calib_cor::estimators() {
            if let Ok(outcome) = run(info.id) {
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
    let default = if request.estimator.is_some() {
        ""
    } else if weighing {
        WEIGHING[0]
    } else if table.pair.is_some() {
        "score"
    } else if table.body.is_some() {
        // A rigid body: pivot calibration as everybody else does it. `--all` shows the likelihood estimates beside it.
        let rms = |id: &str| run(id).ok()?.estimate().map(|e| e.rms);
        match (rms("hse"), rms("consensus")) {
            (Some(all), Some(inliers)) if GROSS * inliers < all => "consensus",
            _ => "hse",
        }
    } else {
        "sfe"
    };
    let id = request.estimator.as_deref().unwrap_or(default);
    let outcome = run(id).map_err(|e| cor_error(&table, id, &e))?;
    Ok(cor_answer(&table, id, &outcome))
}

fn cor_error(table: &Table, id: &str, error: &CorError) -> FitError {
    const LIST: &str = "calib fit cor";
    match error {
        CorError::Unknown { id, known } => unknown(id, known, LIST),
        CorError::WrongInput { .. } => table.wrong_input(id, error, LIST),
        CorError::BadOption { .. } => usage(error.to_string(), "correct the option"),
        _ => data(&table.file, error.to_string(), "correct or remove the row"),
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
