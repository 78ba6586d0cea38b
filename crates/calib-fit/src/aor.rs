//! `calib fit aor`.

use std::fmt::Write as _;

use serde_json::json;

use crate::comparison::comparison;
use crate::error::FitError;
use crate::road::{self, Road};
use crate::table::Table;
use crate::{Answer, TableRequest, answer, coordinates, doubt, listed, matrix, not_observable};

/// `calib fit aor`.
///
/// # Errors
/// As [`crate::cor`].
pub fn aor(request: &TableRequest) -> Result<Answer, FitError> {
    if request.list {
        let rows = calib_aor::estimators()
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
        estimators: calib_aor::estimators(),
        command: "calib fit aor",
    };
    road.check()?;
    if request.all {
        let mut lines = Vec::new();
        for info in calib_aor::estimators() {
            if let Ok(outcome) = road.run_with_its_own(info) {
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
    let outcome = calib_aor::estimator(id)
        .and_then(|info| road.run(info))
        .map_err(|e| road.refusal(id, &e))?;
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
