//! `calib fit aor`.

use std::fmt::Write as _;

use calib_aor::AorError;
use nalgebra::Unit;
use serde_json::json;

use crate::comparison::comparison;
use crate::error::FitError;
use crate::table::Table;
use crate::{
    Answer, TableRequest, answer, coordinates, data, doubt, listed, matrix, not_observable,
    unknown, usage,
};

/// `calib fit aor`.
///
/// # Errors
/// As [`crate::cor`].
pub fn aor(request: &TableRequest) -> Result<Answer, FitError> {
    if request.list {
        let rows = calib_aor::estimators()
            .iter()
            .map(|e| (e.id, format!("{:?}", e.input), e.name, e.source));
        return Ok(listed(rows));
    }
    let table = Table::read(request)?;
    if request.towards.is_some_and(|d| d.norm() == 0.0) {
        return Err(usage(
            "--towards 0,0,0 is no direction",
            "name a side, like 0,0,1",
        ));
    }
    let options = calib_aor::Options {
        sigma_t: request.sigma_m,
        sigma_r: request.sigma_rad,
        center: request.center_m,
        angles: table.angles.clone(),
        weights: table.weights.clone(),
        towards: request.towards.and_then(|d| Unit::try_new(d, 0.0)),
        ..Default::default()
    };
    for (stated, flag) in [
        (request.noise_per_marker, "--noise-per-marker"),
        (!table.covariances.is_empty(), "the covariance of samples"),
    ] {
        if stated {
            return Err(usage(
                format!("no estimator of an axis uses {flag}"),
                "leave it out; `calib fit cor` weighs samples",
            ));
        }
    }
    let tracks = table.tracks();
    let run = |id: &str| -> Result<calib_aor::Outcome, AorError> {
        let info = calib_aor::estimator(id)?;
        match (info.input, &table.body, &table.pair) {
            (calib_aor::InputKind::Poses, _, Some([parent, child])) => {
                calib_aor::fit(id, &calib_aor::Input::TwoBodies { parent, child }, &options)
            }
            (calib_aor::InputKind::Poses, Some(poses), _) => {
                calib_aor::fit(id, &calib_aor::Input::Poses(poses), &options)
            }
            _ if table.origin_only => {
                calib_aor::fit(id, &calib_aor::Input::Points(&tracks), &options)
            }
            _ => calib_aor::fit(id, &calib_aor::Input::Markers(&tracks), &options),
        }
    };
    if request.all {
        let mut lines = Vec::new();
        for info in calib_aor::estimators() {
            if let Ok(outcome) = run(info.id) {
                let axis = outcome
                    .estimate()
                    .map(|e| (e.line.direction.into_inner(), e.sigma_direction));
                lines.push((
                    info.id,
                    outcome.verdict().as_str(),
                    outcome.reason().unwrap_or("").to_owned(),
                    axis,
                ));
            }
        }
        return Ok(comparison("direction", &lines));
    }
    let default = if table.pair.is_some() {
        "sara"
    } else if table.body.is_some() && !table.origin_only {
        "hinge_bundle"
    } else if table.origin_only {
        "sara"
    } else {
        "planar_radial"
    };
    let id = request.estimator.as_deref().unwrap_or(default);
    let outcome = run(id).map_err(|error| aor_error(&table, id, &error))?;
    let Some(e) = outcome.estimate() else {
        return Ok(not_observable(
            id,
            outcome.verdict().as_str(),
            outcome.reason().unwrap_or(""),
        ));
    };
    let rejected: Vec<u64> = e
        .rejected
        .iter()
        .filter_map(|r| table.rows.get(*r).copied())
        .collect();
    let frame = axis_frame(request);
    let value = json!({
        "estimator": id,
        "observable": outcome.is_observable(),
        "verdict": outcome.verdict().as_str(),
        "reason": e.reason,
        "frame": frame,
        "point_m": e.line.point.coords.as_slice(),
        "direction": e.line.direction.as_slice(),
        "covariance": matrix(e.covariance.row_iter().map(|r| r.iter().copied().collect()).collect()),
        "rms_m": e.rms,
        "used": e.used,
        "rejected": rejected,
    });
    let mut text = format!(
        "{id}: direction {} in the frame of {frame}\n",
        coordinates(e.line.direction.as_slice())
    );
    text += &doubt(e.reason.as_deref());
    let _ = writeln!(text, "  sigma {:.4} deg", e.sigma_direction.to_degrees());
    let _ = writeln!(
        text,
        "  through {} m",
        coordinates(e.line.point.coords.as_slice())
    );
    let _ = writeln!(
        text,
        "  rms {:.4} mm, {} samples used, {} rejected",
        e.rms * 1e3,
        e.used,
        rejected.len()
    );
    Ok(answer(text, &value, outcome.is_observable()))
}

fn aor_error(table: &Table, id: &str, error: &AorError) -> FitError {
    const LIST: &str = "calib fit aor";
    match error {
        AorError::Unknown { id, known } => unknown(id, known, LIST),
        AorError::WrongInput { .. } => table.wrong_input(id, error, LIST),
        AorError::BadOption { .. } => usage(error.to_string(), "correct the option"),
        AorError::Data(_) => data(&table.file, error.to_string(), "correct or remove the row"),
    }
}

/// The frame that an axis is given in: the tracker's, or the parent's when two bodies move.
fn axis_frame(request: &TableRequest) -> String {
    match request.parent.as_slice() {
        [] => "the tracker".to_owned(),
        [body] => format!("`{body}`"),
        // As calib_checks::rigid_body (1).
        [first, second, ..] => {
            format!("the parent body (origin {first}, x towards {second})")
        }
    }
}
