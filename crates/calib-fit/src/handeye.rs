//! `calib fit handeye`.

use std::path::Path;

use calib_estimator::{Input, Options, Outcome};
use calib_recording::{BodyColumns, ColumnMap, ReadOptions};
use nalgebra::Isometry3;
use serde_json::{Value, json};

use crate::error::FitError;
use crate::table::read_poses;
use crate::{Answer, answer, data, not_observable, pose_text, pose_value};

/// `calib fit handeye`: `robot_i · X = Z · measured_i`.
///
/// # Errors
/// As [`crate::cor`].
pub fn handeye(file: &Path, robot: &str, measured: &str) -> Result<Answer, FitError> {
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
    let pairs: Vec<(Isometry3<f64>, Isometry3<f64>)> = poses.bodies[robot]
        .iter()
        .zip(&poses.bodies[measured])
        .filter_map(|(a, b)| Some(((*a)?, (*b)?)))
        .collect();
    let (a, b): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
    let input = Input::PosePairs {
        robot: &a,
        measured: &b,
    };
    let outcome = calib_handeye::estimator("handeye")
        .and_then(|info| info.run(&input, &Options::default()))
        .map_err(|error| data(file, error.to_string(), "correct the table"))?;
    let solved = match outcome {
        Outcome::Estimate(solved) => solved,
        Outcome::NotObservable(n) => {
            return Ok(not_observable("handeye", n.verdict.as_str(), &n.reason));
        }
    };
    let value = json!({
        "estimator": "handeye",
        "observable": true,
        "reason": Value::Null,
        "x": pose_value(&solved.x),
        "z": pose_value(&solved.z),
        "rms_m": solved.rms_translation,
        "rms_rad": solved.rms_rotation,
        "gap": solved.gap,
        "certified": solved.certified,
        "used": a.len(),
    });
    let text = format!(
        "handeye: {robot} X = Z {measured}, {} poses\n  X {}\n  Z {}\n  rms {:.4} mm, {:.4} deg\n  certificate: {} (gap at most {:.1e})\n",
        a.len(),
        pose_text(&solved.x),
        pose_text(&solved.z),
        solved.rms_translation * 1e3,
        solved.rms_rotation.to_degrees(),
        if solved.certified {
            "global optimum"
        } else {
            "not certified"
        },
        solved.gap
    );
    Ok(answer(text, &value, true))
}
