//! `calib fit frame`.

use calib_aor::{FrameAxes, FrameAxis, FrameEstimate, FrameOutcome, FrameSample, Options};
use calib_cor::Pose;
use calib_estimator::{CenterBy, EstimatorError, Input};
use calib_recording::ReadOptions;
use serde_json::json;

use crate::error::FitError;
use crate::table::{it_has, read_poses};
use crate::{
    Answer, FrameRequest, answer, data, doubt, matrix, noise, not_observable, pose_text,
    pose_value, usage,
};

/// `calib fit frame`.
///
/// # Errors
/// As [`crate::cor`]; also for joints that the table does not have.
pub fn frame(request: &FrameRequest) -> Result<Answer, FitError> {
    let file = &request.file;
    let poses = read_poses(file, &ReadOptions::default())?;
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
    let body = body_of(request, &poses.bodies)?;
    let (a, b) = (column(proximal)?, column(distal)?);
    let weights = noise::weights(request.weights.as_deref(), poses.rows.len())?;
    let samples: Vec<FrameSample> = a
        .iter()
        .zip(b)
        .zip(body)
        .enumerate()
        .filter_map(|(row, ((a, b), pose))| {
            Some(FrameSample {
                world_from_body: pose.map(Pose::from),
                proximal: (*a)?,
                distal: (*b)?,
                weight: weights.get(row).copied().unwrap_or(1.0),
            })
        })
        .collect();
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
    let info = calib_aor::frame_estimator(&request.estimator).map_err(|error| match &error {
        // This command has no `--list`: the names fit in the remedy.
        EstimatorError::Unknown { id, known, .. } => usage(
            format!("there is no estimator `{id}`"),
            format!("use one of {}", known.join(", ")),
        ),
        error => usage(error.to_string(), "correct the option"),
    })?;
    let outcome = info.run(&input, &options).map_err(|error| match error {
        EstimatorError::BadOption { .. } | EstimatorError::Ignored { .. } => {
            usage(error.to_string(), "correct the option")
        }
        error => data(file, error.to_string(), "correct or remove the row"),
    })?;
    let f = match outcome {
        FrameOutcome::Estimate(f) => f,
        FrameOutcome::NotObservable(n) => {
            return Ok(not_observable(
                &request.estimator,
                n.verdict.as_str(),
                &n.reason,
            ));
        }
    };
    Ok(frame_answer(&request.estimator, &f))
}

fn frame_answer(id: &str, f: &FrameEstimate) -> Answer {
    let observable = f.verdict == calib_estimator::Verdict::Ok;
    let value = json!({
        "estimator": id,
        "observable": observable,
        "verdict": f.verdict.as_str(),
        "reason": f.reason,
        "body_from_joint": pose_value(&f.body_from_joint),
        "covariance": matrix(f.covariance.row_iter().map(|r| r.iter().copied().collect()).collect()),
        "orthogonality_defect_rad": f.orthogonality_defect,
        "rms_m": f.rms_t,
        "rms_rad": f.rms_r,
        "used": f.used,
    });
    let sigma = f.covariance.diagonal().map(|v| v.max(0.0).sqrt());
    let text = format!(
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
    request: &FrameRequest,
    bodies: &'a std::collections::BTreeMap<String, T>,
) -> Result<&'a T, FitError> {
    let file = &request.file;
    match (&request.body, bodies.len()) {
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
