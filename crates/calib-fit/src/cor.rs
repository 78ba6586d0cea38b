//! `calib fit cor`.

use std::fmt::Write as _;

use calib_cor::{CorEstimate, Shape};
use calib_estimator::Kind;
use serde_json::json;

use crate::TableRequest;
use crate::answer::{
    Answer, OF_CENTER, answer, contradicted, coordinates, copied, doubt, freedom, matrix,
};
use crate::comparison::{Found, Quantity};
use crate::error::FitError;
use crate::explained::{self, Against, Judged};
use crate::marker_noise::About;
use crate::road::{self, Command, Data, Road, Wish};
use crate::table::Table;

/// Without a named estimator, rows that raise the residuals by more than this factor are rejected: they are not noise.
const GROSS: f64 = 3.0;

/// What explains the points.
const WHAT: &str = "center";

fn command() -> Command<CorEstimate> {
    Command {
        name: "calib fit cor",
        kind: Kind::Center,
        estimators: calib_cor::estimators(),
        quantity: Quantity::Place("center_m"),
        found: |e| Found {
            value: e.center.coords,
            covariance: e.covariance,
            sigma: e.covariance.trace().max(0.0).sqrt(),
            degrees_of_freedom: e.degrees_of_freedom,
        },
    }
}

/// `calib fit cor`.
///
/// # Errors
/// [`FitError`] for tables that cannot be read and estimators that do not fit them.
pub fn cor(request: &TableRequest) -> Result<Answer, FitError> {
    if !request.plugins.is_empty() {
        return crate::plugin::cor(request);
    }
    let command = command();
    if request.list {
        return Ok(command.list());
    }
    let table = Table::read(request)?;
    let tracks = table.tracks();
    let road = Road {
        command: &command,
        file: &table.file,
        data: Data::Table(&table, &tracks),
        options: &road::options(request, &table)?,
        against: &|e| against(request, &table, e).reason(WHAT),
    };
    let wish = Wish {
        estimator: request.estimator.as_deref(),
        all: request.all,
    };
    let preferred = |road: &Road<'_, _>| preferred(road, &table);
    road.answer(wish, preferred, |id, e| cor_answer(request, &table, id, e))
}

/// The estimator for a table where none was named.
fn preferred(road: &Road<'_, CorEstimate>, table: &Table) -> &'static str {
    let options = road.options;
    if options.noise_per_marker || !options.covariances.is_empty() {
        "sphere_eiv"
    } else if table.pair.is_some() {
        "score"
    } else if table.body.is_some() {
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

fn rejected(table: &Table, e: &CorEstimate) -> Vec<u64> {
    let rows = e.rejected.iter();
    rows.filter_map(|r| table.rows.get(r.row).copied())
        .collect()
}

/// Residuals that are no noise about a center.
fn against(request: &TableRequest, table: &Table, e: &CorEstimate) -> Against {
    let about = About::Center(e.center);
    explained::against(request, table, about, e.rms, &rejected(table, e))
}

fn cor_answer(request: &TableRequest, table: &Table, id: &str, e: &CorEstimate) -> Answer {
    let own = (e.verdict, e.reason.as_deref());
    let against = against(request, table, e);
    let judged = Judged::new(own, &against, WHAT);
    let observable = judged.is_observable();
    let rejected = rejected(table, e);
    let mut value = json!({
        "estimator": id,
        "observable": observable,
        "verdict": judged.verdict.as_str(),
        "reason": judged.reason,
        "center_m": e.center.coords.as_slice(),
    });
    let mut text = format!(
        "{id}:{} center {} m\n",
        judged.head,
        coordinates(e.center.coords.as_slice())
    );
    text += &doubt(e.reason.as_deref());
    let sigma = e.covariance.diagonal().map(|v| v.max(0.0).sqrt() * 1e3);
    let _ = writeln!(
        text,
        "  sigma  {:.4}, {:.4}, {:.4} mm",
        sigma.x, sigma.y, sigma.z
    );
    text += &freedom(e.degrees_of_freedom);
    text += &copied(table.copies);
    if table.copies > 0 {
        value["copies"] = json!(table.copies);
    }
    text += &contradicted(e.noise.contradicts.as_ref());
    text += &against.note();
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
    value["covariance"] = matrix(&e.covariance);
    value["covariance_of"] = json!(OF_CENTER);
    value["contradicts"] = json!(e.noise.contradicts);
    value["marker_noise"] = json!(against.noise.map(|n| n.value()));
    value["degrees_of_freedom"] = json!(e.degrees_of_freedom);
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
    answer(text, &value, observable)
}
