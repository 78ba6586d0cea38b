//! `calib fit handeye`.

use std::fmt::Write as _;
use std::path::Path;

use calib_estimator::{Input, Kind, Options, Verdict};
use calib_handeye::HandEye;
use calib_recording::{BodyColumns, ColumnMap, ReadOptions};
use nalgebra::Isometry3;
use serde_json::json;

use crate::HandEyeRequest;
use crate::answer::{Answer, answer, doubt, freedom, matrix, pose_text, pose_value};
use crate::comparison::{Found, Quantity};
use crate::error::FitError;
use crate::road::{Command, Data, Road, Wish};
use crate::table::{no_table, read_poses};

fn command() -> Command<HandEye> {
    Command {
        name: "calib fit handeye",
        kind: Kind::HandEye,
        estimators: calib_handeye::estimators(),
        quantity: Quantity::Place("x_translation_m"),
        found: |e| Found {
            value: e.x.translation.vector,
            sigma: e.sigmas().map_or(f64::INFINITY, |s| {
                (s[3] * s[3] + s[4] * s[4] + s[5] * s[5]).sqrt()
            }),
        },
    }
}

/// `calib fit handeye`: `robot_i · X = Z · measured_i`.
///
/// # Errors
/// As [`crate::cor`].
pub fn handeye(request: &HandEyeRequest) -> Result<Answer, FitError> {
    let command = command();
    if request.list {
        return Ok(command.list());
    }
    let file = request.file.as_deref().ok_or_else(no_table)?;
    let PosePairs {
        rows,
        robot,
        measured,
    } = pose_pairs(file, &request.robot, &request.measured)?;
    let input = Input::PosePairs {
        robot: &robot,
        measured: &measured,
    };
    let options = Options {
        sigma_t: request.sigma_m,
        sigma_r: request.sigma_rad,
        ..Options::default()
    };
    let road = Road {
        command: &command,
        file,
        data: Data::Only(input),
        options: &options,
    };
    let wish = Wish {
        estimator: request.estimator.as_deref(),
        all: request.all,
    };
    road.answer(
        wish,
        |_| "handeye",
        |id, e| {
            let rejected: Vec<u64> = e.rejected.iter().map(|&k| rows[k]).collect();
            handeye_answer(request, id, e, &rejected)
        },
    )
}

/// Poses of one side and of the other, with their rows in the file.
struct PosePairs {
    rows: Vec<u64>,
    robot: Vec<Isometry3<f64>>,
    measured: Vec<Isometry3<f64>>,
}

/// The rows in which both poses are known.
fn pose_pairs(file: &Path, robot: &str, measured: &str) -> Result<PosePairs, FitError> {
    let columns = |prefix: &str| BodyColumns {
        position: ["x", "y", "z"].map(|a| format!("{prefix}_{a}")),
        quaternion_xyzw: Some(["qx", "qy", "qz", "qw"].map(|a| format!("{prefix}_{a}"))),
        ..BodyColumns::default()
    };
    let map = ColumnMap {
        bodies: [
            (robot.to_owned(), columns(robot)),
            (measured.to_owned(), columns(measured)),
        ]
        .into(),
        ..ColumnMap::default()
    };
    let own = read_poses(file, &ReadOptions::default())
        .ok()
        .filter(|p| p.bodies.contains_key(robot) && p.bodies.contains_key(measured));
    let poses = match own {
        Some(poses) => poses,
        None => {
            let options = ReadOptions {
                columns: Some(map),
                ..ReadOptions::default()
            };
            read_poses(file, &options).map_err(|error| FitError::Data {
                file: file.display().to_string(),
                finding: format!("does not hold two poses per row, `{robot}` and `{measured}`: {error}"),
                remedy: "name the columns <prefix>_x, _y, _z, _qx, _qy, _qz, _qw and give the prefixes with --robot and --measured".to_owned(),
            })?
        }
    };
    let both = poses.bodies[robot].iter().zip(&poses.bodies[measured]);
    let mut pairs = PosePairs {
        rows: Vec::new(),
        robot: Vec::new(),
        measured: Vec::new(),
    };
    for ((a, b), row) in both.zip(&poses.rows) {
        if let (Some(a), Some(b)) = (a, b) {
            pairs.rows.push(*row);
            pairs.robot.push(*a);
            pairs.measured.push(*b);
        }
    }
    Ok(pairs)
}

fn handeye_answer(request: &HandEyeRequest, id: &str, e: &HandEye, rejected: &[u64]) -> Answer {
    let observable = e.verdict == Verdict::Ok;
    let value = json!({
        "estimator": id,
        "observable": observable,
        "verdict": e.verdict.as_str(),
        "reason": e.reason,
        "explanation": e.explanation,
        "x": pose_value(&e.x),
        "z": pose_value(&e.z),
        "covariance": e.covariance.as_ref().map(matrix),
        "degrees_of_freedom": e.noise.degrees_of_freedom,
        "sigma_m": e.noise.sigma_t,
        "sigma_rad": e.noise.sigma_r,
        "rms_m": e.rms_translation,
        "rms_rad": e.rms_rotation,
        "gap": e.gap,
        "certified": e.certified,
        "used": e.used,
        "rejected": rejected,
    });
    let mut text = format!(
        "{id}: {} X = Z {}, {} poses\n",
        request.robot, request.measured, e.used
    );
    text += &doubt(e.reason.as_deref());
    for (name, pose, at) in [("X", &e.x, 0), ("Z", &e.z, 6)] {
        let _ = writeln!(text, "  {name} {}", pose_text(pose));
        if let Some(s) = e.sigmas() {
            let _ = writeln!(
                text,
                "    sigma {:.4}, {:.4}, {:.4} mm; {:.4}, {:.4}, {:.4} deg",
                s[at + 3] * 1e3,
                s[at + 4] * 1e3,
                s[at + 5] * 1e3,
                s[at].to_degrees(),
                s[at + 1].to_degrees(),
                s[at + 2].to_degrees()
            );
        }
    }
    text += &freedom(e.noise.degrees_of_freedom);
    let _ = writeln!(
        text,
        "  rms {:.4} mm, {:.4} deg\n  certificate: {} (gap at most {:.1e})",
        e.rms_translation * 1e3,
        e.rms_rotation.to_degrees(),
        if e.certified {
            "global optimum of these poses"
        } else {
            "not certified"
        },
        e.gap
    );
    if !rejected.is_empty() {
        let _ = writeln!(text, "  gross errors in rows {rejected:?}");
    }
    answer(text, &value, observable)
}
