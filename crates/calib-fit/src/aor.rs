//! `calib fit aor`.

use std::fmt::Write as _;

use calib_aor::AorEstimate;
use calib_estimator::Kind;
use serde_json::json;

use crate::TableRequest;
use crate::answer::{
    Answer, OF_LINE, answer, contradicted, coordinates, copied, doubt, freedom, matrix,
};
use crate::comparison::{Found, Quantity};
use crate::error::FitError;
use crate::explained::{self, Against, Judged};
use crate::marker_noise::About;
use crate::road::{self, Command, Data, Road, Wish};
use crate::table::Table;

/// What explains the points.
const WHAT: &str = "axis";

fn command() -> Command<AorEstimate> {
    Command {
        name: "calib fit aor",
        kind: Kind::Axis,
        estimators: calib_aor::estimators(),
        quantity: Quantity::Direction("direction"),
        found: |e| Found {
            value: e.line.direction.into_inner(),
            covariance: e.covariance.fixed_view::<3, 3>(0, 0).into_owned(),
            sigma: e.sigma_direction,
            degrees_of_freedom: e.degrees_of_freedom,
        },
    }
}

/// `calib fit aor`.
///
/// # Errors
/// As [`crate::cor`].
pub fn aor(request: &TableRequest) -> Result<Answer, FitError> {
    if !request.plugins.is_empty() {
        return crate::plugin::aor(request);
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
    road.answer(
        wish,
        |_| preferred(&table),
        |id, e| aor_answer(request, &table, id, e),
    )
}

/// The estimator for a table where none was named.
fn preferred(table: &Table) -> &'static str {
    if table.pair.is_some() || table.origin_only {
        "sara"
    } else if table.body.is_some() {
        "hinge_bundle"
    } else {
        "planar_radial"
    }
}

fn rejected(table: &Table, e: &AorEstimate) -> Vec<u64> {
    let rows = e.rejected.iter();
    rows.filter_map(|r| table.rows.get(*r).copied()).collect()
}

/// Residuals that are no noise about an axis.
fn against(request: &TableRequest, table: &Table, e: &AorEstimate) -> Against {
    let about = About::Axis(e.line.point, e.line.direction);
    explained::against(request, table, about, e.rms, &rejected(table, e))
}

fn aor_answer(request: &TableRequest, table: &Table, id: &str, e: &AorEstimate) -> Answer {
    let own = (e.verdict, e.reason.as_deref());
    let against = against(request, table, e);
    let judged = Judged::new(own, &against, WHAT);
    let observable = judged.is_observable();
    let rejected = rejected(table, e);
    let frame = axis_frame(request);
    let mut value = json!({
        "estimator": id,
        "observable": observable,
        "verdict": judged.verdict.as_str(),
        "reason": judged.reason,
        "frame": frame,
        "point_m": e.line.point.coords.as_slice(),
        "direction": e.line.direction.as_slice(),
        "covariance": matrix(&e.covariance),
        "covariance_of": OF_LINE,
        "degrees_of_freedom": e.degrees_of_freedom,
        "contradicts": e.contradicts,
        "marker_noise": against.noise.map(|n| n.value()),
        "rms_m": e.rms,
        "used": e.used,
        "rejected": rejected,
    });
    let mut text = format!(
        "{id}:{} direction {} in the frame of {frame}\n",
        judged.head,
        coordinates(e.line.direction.as_slice())
    );
    text += &doubt(e.reason.as_deref());
    let _ = writeln!(text, "  sigma {:.4} deg", e.sigma_direction.to_degrees());
    text += &freedom(e.degrees_of_freedom);
    text += &copied(table.copies);
    if table.copies > 0 {
        value["copies"] = json!(table.copies);
    }
    text += &contradicted(e.contradicts.as_ref());
    text += &against.note();
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
    answer(text, &value, observable)
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
