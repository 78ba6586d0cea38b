//! `calib fit handeye`.

use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;
use std::fmt::Write as _;

use calib_estimator::{Input, Kind, Options, Verdict};
use calib_handeye::{Correction, HandEye, Residuals, explained_as_written};
use calib_recording::{BodyColumns, ColumnMap, Poses, Problem, ReadOptions};
use calib_urdf::rpy::{rotation_from_rpy, rpy_from_rotation};
use nalgebra::{Isometry3, Matrix3, Translation3, Vector3};
use serde_json::{Value, json};

use crate::HandEyeRequest;
use crate::answer::{
    Answer, OF_FRAME, answer, copied, doubt, freedom, matrix, pose_text, pose_value,
};
use crate::comparison::{Found, Quantity, in_parent};
use crate::error::FitError;
use crate::measured::Measured;
use crate::road::{Command, Data, Road, Wish};
use crate::table::no_table;

fn command() -> Command<HandEye> {
    Command {
        name: "calib fit handeye",
        kind: Kind::HandEye,
        estimators: calib_handeye::estimators(),
        quantity: Quantity::Place("x_translation_m"),
        found: |e| Found {
            value: e.x.translation.vector,
            covariance: e.covariance.map_or(Matrix3::zeros(), |c| {
                in_parent(&e.x, &c.fixed_view::<3, 3>(3, 3).into_owned())
            }),
            degrees_of_freedom: e.noise.degrees_of_freedom,
            sigma: e.sigmas().map_or(f64::INFINITY, |s| {
                (s[3] * s[3] + s[4] * s[4] + s[5] * s[5]).sqrt()
            }),
        },
    }
}

/// `calib fit handeye`: `base_from_flange_i · X = Z · tracker_from_body_i`, X = `flange_from_body`, Z = `base_from_tracker`.
///
/// # Errors
/// As [`crate::cor`].
pub fn handeye(request: &HandEyeRequest) -> Result<Answer, FitError> {
    let command = command();
    if request.list {
        return Ok(command.list());
    }
    let table = request.file.as_ref().ok_or_else(no_table)?;
    let file = table.name();
    let PosePairs {
        rows,
        robot,
        measured,
        copies,
    } = pose_pairs(table, &request.robot, &request.measured)?;
    let written = measured;
    let measured: Vec<Isometry3<f64>> = match request.inverted {
        true => written.iter().map(Isometry3::inverse).collect(),
        false => written.clone(),
    };
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
        against: &|_| None,
    };
    let wish = Wish {
        estimator: request.estimator.as_deref(),
        all: request.all,
    };
    road.answer(
        wish,
        |_| "handeye",
        |id, e| {
            let e = &match request.inverted {
                true => explained_as_written(e, &robot, &written),
                false => e.clone(),
            };
            handeye_answer(request, id, e, (&rows, copies))
        },
    )
}

/// Poses of one side and of the other, with their rows in the file.
struct PosePairs {
    rows: Vec<u64>,
    robot: Vec<Isometry3<f64>>,
    measured: Vec<Isometry3<f64>>,
    /// Rows that repeat an earlier one to the last digit, which are left out.
    copies: usize,
}

/// The rows in which both poses are known.
fn pose_pairs(table: &Measured, robot: &str, measured: &str) -> Result<PosePairs, FitError> {
    let file = table.name();
    let own = table
        .poses(&ReadOptions::default())
        .ok()
        .filter(|p| p.bodies.contains_key(robot) && p.bodies.contains_key(measured));
    let poses = match own {
        Some(poses) => poses,
        None => read_by_names(table, robot, measured).map_err(|error| match error {
            // Nothing of the columns is known of a file that is not there.
            FitError::Recording(unread) if matches!(*unread.problem, Problem::Io(_)) => {
                unread.into()
            }
            error => FitError::Data {
                file: file.display().to_string(),
                finding: format!(
                    "does not hold two poses per row, `{robot}` and `{measured}`: {error}"
                ),
                remedy: "name the columns <prefix>_x, _y, _z and _qx, _qy, _qz, _qw (a quaternion), _rvec_x, _rvec_y, _rvec_z (axis times angle, rad) or _r11, _r12 … _r33 (a matrix), and give the prefixes with --robot and --measured".to_owned(),
            },
        })?,
    };
    let both = poses.bodies[robot].iter().zip(&poses.bodies[measured]);
    let mut pairs = PosePairs {
        rows: Vec::new(),
        robot: Vec::new(),
        measured: Vec::new(),
        copies: 0,
    };
    let mut seen = BTreeSet::new();
    for ((a, b), row) in both.zip(&poses.rows) {
        if let (Some(a), Some(b)) = (a, b) {
            let bits = [a, b].map(|pose| {
                let (t, r) = (pose.translation.vector, pose.rotation.coords);
                t.iter()
                    .chain(r.iter())
                    .map(|x| x.to_bits())
                    .collect::<Vec<u64>>()
            });
            if !seen.insert(bits) {
                pairs.copies += 1;
                continue;
            }
            pairs.rows.push(*row);
            pairs.robot.push(*a);
            pairs.measured.push(*b);
        }
    }
    Ok(pairs)
}

/// The columns of a pose by its prefix, in each notation of the rotation.
fn by_prefix(prefix: &str) -> [BodyColumns; 3] {
    let named = |of: &str| format!("{prefix}_{of}");
    let position = ["x", "y", "z"].map(named);
    let turned = |body: BodyColumns| BodyColumns {
        position: position.clone(),
        ..body
    };
    let entry = |k: usize| named(&format!("r{}{}", k / 3 + 1, k % 3 + 1));
    [
        turned(BodyColumns {
            quaternion_xyzw: Some(["qx", "qy", "qz", "qw"].map(named)),
            ..BodyColumns::default()
        }),
        turned(BodyColumns {
            rotation_vector: Some(["rvec_x", "rvec_y", "rvec_z"].map(named)),
            ..BodyColumns::default()
        }),
        turned(BodyColumns {
            rotation_matrix: Some(std::array::from_fn(entry)),
            ..BodyColumns::default()
        }),
    ]
}

/// The poses in the notations that the table has; where it has none, what is missing of the first.
fn read_by_names(table: &Measured, robot: &str, measured: &str) -> Result<Poses, FitError> {
    let read = |of_robot: &BodyColumns, of_measured: &BodyColumns| {
        let bodies = [(robot, of_robot), (measured, of_measured)];
        let bodies = bodies.map(|(name, columns)| (name.to_owned(), columns.clone()));
        table.poses(&ReadOptions {
            columns: Some(ColumnMap {
                bodies: bodies.into(),
                ..ColumnMap::default()
            }),
            ..ReadOptions::default()
        })
    };
    let is_there = |read: &Result<Poses, FitError>| match read {
        Err(FitError::Recording(e)) => !matches!(*e.problem, Problem::MissingColumn { .. }),
        _ => true,
    };
    let (robots, bodies) = (by_prefix(robot), by_prefix(measured));
    let mut pairs = robots
        .iter()
        .flat_map(|a| bodies.iter().map(move |b| (a, b)));
    let found = pairs.find_map(|(a, b)| Some(read(a, b)).filter(is_there));
    found.unwrap_or_else(|| read(&robots[0], &bodies[0]))
}

/// What the rows and columns of the covariance are of: X, then Z, each in its own axes.
fn of_both() -> Vec<String> {
    let both = ["x", "z"].into_iter();
    both.flat_map(|of| OF_FRAME.map(|name| format!("{of}.{name}")))
        .collect()
}

/// `rows`: of the poses, in the file.
fn handeye_answer(
    request: &HandEyeRequest,
    id: &str,
    e: &HandEye,
    (rows, copies): (&[u64], usize),
) -> Answer {
    let rejected: Vec<u64> = e.rejected.iter().map(|&k| rows[k]).collect();
    let observable = e.verdict == Verdict::Ok;
    let camera = (request.optical && observable).then(|| e.x * link_from_optical().inverse());
    let mut value = json!({
        "estimator": id,
        "observable": observable,
        "verdict": e.verdict.as_str(),
        "reason": e.reason,
        "explanation": e.explanation,
        "open_direction": e.open_direction,
        "x": pose_value(&e.x),
        "z": pose_value(&e.z),
        "x_urdf": observable.then(|| origin_value(&e.x)),
        "camera_link_urdf": camera.as_ref().map(origin_value),
        "covariance": e.covariance.as_ref().map(matrix),
        "covariance_of": of_both(),
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
    if let Some(remedy) = remedy(request, e, rows) {
        let _ = writeln!(text, "  {remedy}");
    }
    text += &direction(e);
    for (name, pose, at) in [
        ("X, flange_from_body:", &e.x, 0),
        ("Z, base_from_tracker:", &e.z, 6),
    ] {
        let _ = writeln!(text, "  {name}\n    {}", pose_text(pose));
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
    // A line to copy is for a pose that can be used.
    if observable {
        let _ = writeln!(text, "  X in a URDF: {}", origin_text(&e.x));
    }
    if let Some(camera) = &camera {
        let _ = writeln!(
            text,
            "  the camera's own frame (x along the view, z up) in a URDF: {}",
            origin_text(camera)
        );
    }
    text += &freedom(e.noise.degrees_of_freedom);
    text += &copied(copies);
    if copies > 0 {
        value["copies"] = json!(copies);
    }
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

/// What the answer takes for granted where the poses do not show their direction.
fn direction(e: &HandEye) -> String {
    let Some(open) = &e.open_direction else {
        return String::new();
    };
    let shown = |r: &Residuals| {
        let (mm, deg) = (r.rms_translation * 1e3, r.rms_rotation.to_degrees());
        format!("{mm:.3} mm and {deg:.3}°")
    };
    format!(
        "  warning: the direction of the measured poses is not observable from these {} poses: the residuals are {} as used, {} inverted\n  \
         help: Add poses rotated about other axes, or make sure that the direction is right: with the wrong one, X and Z are wrong.\n",
        e.used,
        shown(&open.as_used),
        shown(&open.inverted)
    )
}

/// What to do about a mistake of the tables.
fn remedy(request: &HandEyeRequest, e: &HandEye, rows: &[u64]) -> Option<String> {
    let candidates = &e.explanation.as_ref()?.candidates;
    let of = |c: &Correction| -> Option<String> {
        let row = |pose: &usize| rows.get(*pose).copied().unwrap_or_default();
        Some(match c {
            Correction::InvertedPoses(_) if request.inverted => {
                "Run it again without --inverted, or give the flange in the robot's base."
                    .to_owned()
            }
            Correction::InvertedPoses(_) => {
                "If the measured poses are those of a board or tag in the camera, run it again with --inverted; else give the flange in the robot's base."
                    .to_owned()
            }
            Correction::Scaled(_) => {
                "Check the size of the board's squares or of the tag as it was stated, the tracker's or camera's calibration, and the robot's own lengths; then \
                 measure again."
                    .to_owned()
            }
            Correction::BodyMoved(pose) => format!(
                "It was elsewhere on the flange from row {} on: use the rows before, or those from it on.",
                row(pose)
            ),
            Correction::TrackerMoved(pose) => format!(
                "One of them was elsewhere from row {} on: use the rows before, or those from it on.",
                row(pose)
            ),
            _ => return None,
        })
    };
    candidates.iter().flatten().find_map(of)
}

/// How the optical frame of a camera (z along the view, x to the right, y down) stands in the camera's frame of a URDF (x along the view,
/// y to the left, z up): REP 103 of ROS.
fn link_from_optical() -> Isometry3<f64> {
    let rotation = rotation_from_rpy(&Vector3::new(-FRAC_PI_2, 0.0, -FRAC_PI_2));
    Isometry3::from_parts(Translation3::identity(), rotation)
}

fn origin_value(pose: &Isometry3<f64>) -> Value {
    json!({ "xyz_m": pose.translation.vector.as_slice(), "rpy_rad": rpy_from_rotation(&pose.rotation).as_slice() })
}

/// A micrometer and a microradian: more is below any σ of a hand and an eye.
fn origin_text(pose: &Isometry3<f64>) -> String {
    let three = |v: [f64; 3]| v.map(|x| format!("{:.6}", x + 0.0)).join(" ");
    format!(
        "<origin xyz=\"{}\" rpy=\"{}\"/>",
        three(pose.translation.vector.into()),
        three(rpy_from_rotation(&pose.rotation).into())
    )
}
