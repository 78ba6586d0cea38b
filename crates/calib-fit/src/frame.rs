//! `calib fit frame`.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use calib_aor::{FrameAxes, FrameAxis, FrameEstimate, FrameSample, Options};
use calib_cor::Pose;
use calib_estimator::{CenterBy, Input, Kind, Verdict};
use calib_recording::ReadOptions;
use serde_json::json;

use crate::answer::{Answer, OF_FRAME, answer, doubt, matrix, pose_text, pose_value};
use crate::comparison::{Found, Quantity, in_parent};
use crate::error::FitError;
use crate::road::{Command, Data, Road, Wish};
use crate::table::{it_has, no_table};
use crate::{FrameRequest, data, usage};

fn command() -> Command<FrameEstimate> {
    Command {
        name: "calib fit frame",
        kind: Kind::Frame,
        estimators: calib_aor::frame_estimators(),
        quantity: Quantity::Place("translation_m"),
        found: |f| Found {
            value: f.body_from_joint.translation.vector,
            covariance: in_parent(
                &f.body_from_joint,
                &f.covariance.fixed_view::<3, 3>(3, 3).into_owned(),
            ),
            sigma: f.covariance.diagonal().rows(3, 3).sum().max(0.0).sqrt(),
            degrees_of_freedom: None,
        },
    }
}

/// `calib fit frame`.
///
/// # Errors
/// As [`crate::cor`]; also for joints that the table does not have.
pub fn frame(request: &FrameRequest) -> Result<Answer, FitError> {
    let command = command();
    if request.list {
        return Ok(command.list());
    }
    let measured = request.file.as_ref().ok_or_else(no_table)?;
    let file = measured.name();
    let poses = measured.poses(&ReadOptions::default())?;
    let (proximal_letter, proximal) = axis_of(&request.proximal)?;
    let (distal_letter, distal) = axis_of(&request.distal)?;
    let column = |joint: &str| {
        poses.joints.get(joint).ok_or_else(|| {
            data(
                file,
                format!("has no joint `{joint}`"),
                it_has(poses.joints.keys()),
            )
        })
    };
    let body = body_of(file, request.body.as_deref(), &poses.bodies)?;
    let (a, b) = (column(proximal)?, column(distal)?);
    let weights = measured.weights(request.weights.as_deref(), poses.rows.len())?;
    let (samples, rows): (Vec<FrameSample>, Vec<u64>) = a
        .iter()
        .zip(b)
        .zip(body)
        .enumerate()
        .filter_map(|(row, ((a, b), pose))| {
            let sample = FrameSample {
                world_from_body: pose.map(Pose::from),
                proximal: (*a)?,
                distal: (*b)?,
                weight: weights.get(row).copied().unwrap_or(1.0),
            };
            Some((sample, *poses.rows.get(row)?))
        })
        .unzip();
    let options = Options {
        axes: FrameAxes {
            proximal: proximal_letter,
            distal: distal_letter,
        },
        sigma_t: request.sigma_m,
        sigma_r: request.sigma_rad,
        ..Options::default()
    };
    let center = |poses: &[Option<Pose>]| {
        let options = calib_cor::Options {
            weights: samples.iter().map(|s| s.weight).collect(),
            ..calib_cor::Options::default()
        };
        let fit = calib_cor::fit("sfe", &Input::Poses(poses), &options).ok()?;
        fit.estimate().map(|e| e.center)
    };
    let input = Input::TwoJoints {
        samples: &samples,
        center: Some(CenterBy(&center)),
    };
    let road = Road {
        command: &command,
        file,
        data: Data::Only(input),
        options: &options,
        against: &|_| None,
    };
    let wish = Wish {
        estimator: request.estimator.as_deref(),
        all: request.all,
    };
    road.answer(
        wish,
        |_| "algorithm1",
        |id, f| {
            let rejected: Vec<u64> = f.rejected.iter().map(|&k| rows[k]).collect();
            frame_answer(id, f, &rejected)
        },
    )
}

fn frame_answer(id: &str, f: &FrameEstimate, rejected: &[u64]) -> Answer {
    let observable = f.verdict == Verdict::Ok;
    let value = json!({
        "estimator": id,
        "observable": observable,
        "verdict": f.verdict.as_str(),
        "reason": f.reason,
        "body_from_joint": pose_value(&f.body_from_joint),
        "covariance": matrix(&f.covariance),
        "covariance_of": OF_FRAME,
        "orthogonality_defect_rad": f.orthogonality_defect,
        "rms_m": f.rms_t,
        "rms_rad": f.rms_r,
        "used": f.used,
        "rejected": rejected,
    });
    let sigma = f.covariance.diagonal().map(|v| v.max(0.0).sqrt());
    let mut text = format!(
        "{}: body_from_joint {}\n{}  sigma {:.4}, {:.4}, {:.4} mm; {:.4}, {:.4}, {:.4} deg\n  axes {:.3} deg off square; rms {:.4} mm, {:.4} deg; {} samples\n",
        id,
        pose_text(&f.body_from_joint),
        doubt(f.reason.as_deref()),
        sigma[3] * 1e3,
        sigma[4] * 1e3,
        sigma[5] * 1e3,
        sigma[0].to_degrees(),
        sigma[1].to_degrees(),
        sigma[2].to_degrees(),
        f.orthogonality_defect.to_degrees(),
        f.rms_t * 1e3,
        f.rms_r.to_degrees(),
        f.used
    );
    if !rejected.is_empty() {
        let _ = writeln!(text, "  gross errors in rows {rejected:?}");
    }
    answer(text, &value, observable)
}

fn axis_of(text: &str) -> Result<(FrameAxis, &str), FitError> {
    let wrong = || {
        usage(
            format!("`{text}` is no axis and joint"),
            "write it like z=pan",
        )
    };
    let (letter, joint) = text.split_once('=').ok_or_else(wrong)?;
    let letter = match letter {
        "x" => FrameAxis::X,
        "y" => FrameAxis::Y,
        "z" => FrameAxis::Z,
        _ => return Err(wrong()),
    };
    Ok((letter, joint))
}

/// The body that the request names, or the only one.
fn body_of<'a, T>(
    file: &Path,
    named: Option<&str>,
    bodies: &'a BTreeMap<String, T>,
) -> Result<&'a T, FitError> {
    match (named, bodies.len()) {
        (Some(name), _) => bodies
            .get(name)
            .ok_or_else(|| data(file, format!("has no body `{name}`"), "correct --body")),
        (None, 1) => bodies
            .values()
            .next()
            .ok_or_else(|| data(file, "has no body", "give poses")),
        (None, n) => Err(data(
            file,
            format!("has {n} bodies"),
            "name one with --body",
        )),
    }
}
