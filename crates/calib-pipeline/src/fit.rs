//! `calib fit`: one estimator on one table, without a profile.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use calib_aor::{Center, FrameAxes, FrameOptions, FrameOutcome, FrameSample, Letter};
use calib_cor::{InputKind, Pose, Shape};
use calib_recording::rigid_body::{Template, body_poses};
use calib_recording::{BodyColumns, ColumnMap, Filled, Poses, ReadOptions, read_path};
use nalgebra::{Isometry3, Point3};
use serde_json::{Value, json};

use crate::error::{ExitCode, PipelineError};

/// What to fit with what.
#[derive(Debug, Clone, Default)]
pub struct TableRequest {
    /// The table.
    pub file: Option<PathBuf>,
    /// Estimator id; the kind of data decides when not given.
    pub estimator: Option<String>,
    /// All estimators that take the data.
    pub all: bool,
    /// Only list the estimators.
    pub list: bool,
    /// Markers or bodies to use; all when empty.
    pub only: Vec<String>,
    /// Markers (or the body) on one side of the joint, for estimators of two moving bodies.
    pub parent: Vec<String>,
    /// Markers (or the body) on the other side.
    pub child: Vec<String>,
    /// Stated noise of one coordinate, m.
    pub sigma_m: Option<f64>,
    /// Stated noise of the orientation about each axis, rad.
    pub sigma_rad: Option<f64>,
}

/// What to make a frame of.
#[derive(Debug, Clone, Default)]
pub struct FrameRequest {
    /// The table: poses of one body and two joint columns.
    pub file: PathBuf,
    /// `z=pan`.
    pub proximal: String,
    /// `x=tilt`.
    pub distal: String,
    /// The body, when there are several.
    pub body: Option<String>,
    /// `algorithm1` or `frame_ml`.
    pub estimator: String,
}

/// An answer in both forms.
#[derive(Debug, Clone)]
pub struct Answer {
    /// For people.
    pub text: String,
    /// For machines.
    pub json: String,
    /// How to end.
    pub exit: ExitCode,
}

fn answer(text: String, value: &Value, observable: bool) -> Answer {
    let json = calib_report::json::pretty(&calib_report::json::rounded(value.clone())) + "\n";
    let exit = if observable {
        ExitCode::Accepted
    } else {
        ExitCode::NotObservable
    };
    Answer { text, json, exit }
}

fn usage(finding: impl Into<String>, remedy: impl Into<String>) -> PipelineError {
    PipelineError::Usage {
        finding: finding.into(),
        remedy: remedy.into(),
    }
}

fn data(file: &Path, finding: impl Into<String>, remedy: impl Into<String>) -> PipelineError {
    PipelineError::Data {
        file: file.display().to_string(),
        finding: finding.into(),
        remedy: remedy.into(),
    }
}

/// The measurements of a table, in whichever forms it can give.
struct Table {
    file: PathBuf,
    rows: Vec<u64>,
    markers: Vec<(String, Vec<Option<Point3<f64>>>)>,
    body: Option<Vec<Option<Pose>>>,
    pair: Option<[Vec<Option<Pose>>; 2]>,
}

impl Table {
    fn read(request: &TableRequest) -> Result<Self, PipelineError> {
        let Some(file) = &request.file else {
            return Err(usage(
                "no table was given",
                "name a CSV of points or poses, or --list the estimators",
            ));
        };
        let poses = read_poses(file, &ReadOptions::default())?;
        let wanted = |name: &String| request.only.is_empty() || request.only.contains(name);
        for name in &request.only {
            if !poses.markers.contains_key(name) && !poses.bodies.contains_key(name) {
                return Err(data(
                    file,
                    format!("has no marker or body `{name}`"),
                    it_has(poses.markers.keys().chain(poses.bodies.keys())),
                ));
            }
        }
        let markers: Vec<(String, Vec<Option<Point3<f64>>>)> = poses
            .markers
            .iter()
            .filter(|(name, _)| wanted(name))
            .map(|(name, track)| (name.clone(), track.clone()))
            .collect();
        let bodies: Vec<&String> = poses.bodies.keys().filter(|n| wanted(n)).collect();
        let body = match bodies.as_slice() {
            [only] => Some(as_poses(&poses.bodies[*only])),
            [] if markers.len() >= 3 => poses_of_markers(file, &markers).ok(),
            _ => None,
        };
        let pair = match (request.parent.is_empty(), request.child.is_empty()) {
            (false, false) => Some([
                side(file, &poses, &request.parent)?,
                side(file, &poses, &request.child)?,
            ]),
            (true, true) => None,
            _ => {
                return Err(usage(
                    "one side of the joint is missing",
                    "give both --parent and --child",
                ));
            }
        };
        if markers.is_empty() && body.is_none() && pair.is_none() {
            return Err(data(
                file,
                format!("has {} bodies and no markers to choose from", bodies.len()),
                "name one body with --use-only",
            ));
        }
        Ok(Self {
            file: file.clone(),
            rows: poses.rows,
            markers,
            body,
            pair,
        })
    }

    fn tracks(&self) -> Vec<Vec<Option<Point3<f64>>>> {
        self.markers.iter().map(|(_, t)| t.clone()).collect()
    }
}

/// What a table has instead of what was asked for.
fn it_has<'a>(names: impl Iterator<Item = &'a String>) -> String {
    let names: Vec<String> = names.map(|n| format!("`{n}`")).collect();
    if names.is_empty() {
        "it has none".to_owned()
    } else {
        format!("it has {}", names.join(", "))
    }
}

fn read_poses(file: &Path, options: &ReadOptions) -> Result<Poses, PipelineError> {
    let recording = read_path(file, options)?;
    recording
        .poses(Filled::Exclude)
        .map_err(|e| data(file, e.to_string(), "give one table"))
}

fn as_poses(track: &[Option<Isometry3<f64>>]) -> Vec<Option<Pose>> {
    track.iter().map(|p| p.map(Pose::from)).collect()
}

fn poses_of_markers(
    file: &Path,
    markers: &[(String, Vec<Option<Point3<f64>>>)],
) -> Result<Vec<Option<Pose>>, PipelineError> {
    let names: Vec<String> = markers.iter().map(|(n, _)| n.clone()).collect();
    let tracks: Vec<&[Option<Point3<f64>>]> = markers.iter().map(|(_, t)| t.as_slice()).collect();
    let template = Template::learn(&names, &tracks)
        .map_err(|e| data(file, e.to_string(), "give the markers of one rigid body"))?;
    let poses = body_poses(&names, &tracks, Some(template), None)
        .map_err(|e| data(file, e.to_string(), "give the markers of one rigid body"))?;
    Ok(as_poses(&poses.track()))
}

/// One side of a joint: a body of the table, or its markers as one.
fn side(file: &Path, poses: &Poses, names: &[String]) -> Result<Vec<Option<Pose>>, PipelineError> {
    if let [body] = names
        && let Some(track) = poses.bodies.get(body)
    {
        return Ok(as_poses(track));
    }
    let mut markers = Vec::new();
    for name in names {
        let track = poses.markers.get(name).ok_or_else(|| {
            data(
                file,
                format!("has no marker `{name}`"),
                it_has(poses.markers.keys()),
            )
        })?;
        markers.push((name.clone(), track.clone()));
    }
    poses_of_markers(file, &markers)
}

/// Without a named estimator, rows that raise the residuals so many times are left out: they are no noise.
const GROSS: f64 = 3.0;

/// `calib fit cor`.
///
/// # Errors
/// [`PipelineError`] for tables that cannot be read and estimators that do not fit them.
pub fn cor(request: &TableRequest) -> Result<Answer, PipelineError> {
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
        ..Default::default()
    };
    let tracks = table.tracks();
    let run = |id: &str| -> Result<calib_cor::Outcome, calib_cor::CorError> {
        let info = calib_cor::estimator(id)?;
        match (info.input, &table.body, &table.pair) {
            (InputKind::TwoBodies, _, Some([first, second])) => {
                calib_cor::fit(id, &calib_cor::Input::TwoBodies { first, second }, &options)
            }
            (InputKind::Poses, Some(poses), _) => {
                calib_cor::fit(id, &calib_cor::Input::Poses(poses), &options)
            }
            (_, Some(poses), _) if tracks.is_empty() => {
                calib_cor::fit(id, &calib_cor::Input::Poses(poses), &options)
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
    let outcome = run(id).map_err(|e| cor_error(&table.file, e))?;
    Ok(cor_answer(&table, id, &outcome))
}

fn cor_error(file: &Path, error: calib_cor::CorError) -> PipelineError {
    match &error {
        calib_cor::CorError::Unknown { .. }
        | calib_cor::CorError::WrongInput { .. }
        | calib_cor::CorError::BadOption { .. } => usage(
            error.to_string(),
            "see `calib fit cor --list`; bodies of two sides need --parent and --child",
        ),
        _ => data(file, error.to_string(), "correct or remove the row"),
    }
}

fn cor_answer(table: &Table, id: &str, outcome: &calib_cor::Outcome) -> Answer {
    let Some(e) = outcome.estimate().filter(|_| outcome.is_observable()) else {
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
        "observable": true,
        "reason": e.reason,
        "center_m": e.center.coords.as_slice(),
    });
    let mut text = format!(
        "{id}: center {} m\n",
        coordinates(e.center.coords.as_slice())
    );
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
    answer(text, &value, true)
}

/// `calib fit aor`.
///
/// # Errors
/// As [`cor`].
pub fn aor(request: &TableRequest) -> Result<Answer, PipelineError> {
    if request.list {
        let rows = calib_aor::estimators()
            .iter()
            .map(|e| (e.id, format!("{:?}", e.input), e.name, e.source));
        return Ok(listed(rows));
    }
    let table = Table::read(request)?;
    let options = calib_aor::Options {
        sigma_t: request.sigma_m,
        sigma_r: request.sigma_rad,
        ..Default::default()
    };
    let tracks = table.tracks();
    let run = |id: &str| -> Result<calib_aor::Outcome, calib_aor::AorError> {
        let info = calib_aor::estimator(id)?;
        match (info.input, &table.body, &table.pair) {
            (calib_aor::InputKind::Poses, _, Some([parent, child])) => {
                calib_aor::fit(id, &calib_aor::Input::TwoBodies { parent, child }, &options)
            }
            (calib_aor::InputKind::Poses, Some(poses), _) => {
                calib_aor::fit(id, &calib_aor::Input::Poses(poses), &options)
            }
            (_, Some(poses), _) if tracks.is_empty() => {
                calib_aor::fit(id, &calib_aor::Input::Poses(poses), &options)
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
    } else if table.body.is_some() && !tracks.is_empty() {
        "hinge_bundle"
    } else if tracks.is_empty() {
        "sara"
    } else {
        "planar_radial"
    };
    let id = request.estimator.as_deref().unwrap_or(default);
    let outcome = run(id).map_err(|error| match &error {
        calib_aor::AorError::Data(_) => {
            data(&table.file, error.to_string(), "correct or remove the row")
        }
        _ => usage(
            error.to_string(),
            "see `calib fit aor --list`; bodies of two sides need --parent and --child",
        ),
    })?;
    let Some(e) = outcome.estimate().filter(|_| outcome.is_observable()) else {
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
        "observable": true,
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
    Ok(answer(text, &value, true))
}

/// The frame that an axis is given in: the tracker's, or the parent's when two bodies move.
fn axis_frame(request: &TableRequest) -> String {
    match request.parent.as_slice() {
        [] => "the tracker".to_owned(),
        [body] => format!("`{body}`"),
        // As calib_recording::rigid_body (1).
        [first, second, ..] => {
            format!("the parent body (origin {first}, x towards {second})")
        }
    }
}

/// `calib fit frame`.
///
/// # Errors
/// As [`cor`]; also for joints that the table does not have.
pub fn frame(request: &FrameRequest) -> Result<Answer, PipelineError> {
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
    let body = match (&request.body, poses.bodies.len()) {
        (Some(name), _) => poses
            .bodies
            .get(name)
            .ok_or_else(|| data(file, format!("has no body `{name}`"), "correct --body"))?,
        (None, 1) => poses
            .bodies
            .values()
            .next()
            .ok_or_else(|| data(file, "has no body", "give poses"))?,
        (None, n) => {
            return Err(data(
                file,
                format!("has {n} bodies"),
                "name one with --body",
            ));
        }
    };
    let (a, b) = (column(proximal)?, column(distal)?);
    let samples: Vec<FrameSample> = a
        .iter()
        .zip(b)
        .zip(body)
        .filter_map(|((a, b), pose)| {
            Some(FrameSample {
                world_from_body: pose.map(Pose::from),
                proximal: (*a)?,
                distal: (*b)?,
            })
        })
        .collect();
    let options = FrameOptions {
        axes: FrameAxes {
            proximal: proximal_letter,
            distal: distal_letter,
        },
        ..FrameOptions::default()
    };
    let outcome = match request.estimator.as_str() {
        "algorithm1" => {
            let center = |poses: &[Option<Pose>]| {
                let fit = calib_cor::fit(
                    "sfe",
                    &calib_cor::Input::Poses(poses),
                    &calib_cor::Options::default(),
                )
                .ok()?;
                fit.estimate().map(|e| e.center)
            };
            calib_aor::frame_planes::algorithm1(&samples, Center::From(&center), &options)
        }
        "frame_ml" => {
            calib_aor::frame_ml::fit(&samples, calib_aor::frame_ml::Residuals::Poses, &options)
        }
        other => {
            return Err(usage(
                format!("unknown estimator `{other}`"),
                "algorithm1 or frame_ml",
            ));
        }
    };
    let outcome = outcome.map_err(|e| data(file, e.to_string(), "correct or remove the row"))?;
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
    let value = json!({
        "estimator": request.estimator,
        "observable": true,
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
        "{}: body_from_joint {}\n  sigma {:.4}, {:.4}, {:.4} mm; {:.4}, {:.4}, {:.4} deg\n  axes {:.3} deg off square; rms {:.4} mm, {:.4} deg; {} samples\n",
        request.estimator,
        pose_text(&f.body_from_joint),
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
    Ok(answer(text, &value, true))
}

fn axis_of(text: &str) -> Result<(Letter, &str), PipelineError> {
    let wrong = || {
        usage(
            format!("`{text}` is no axis and joint"),
            "write it like z=pan",
        )
    };
    let (letter, joint) = text.split_once('=').ok_or_else(wrong)?;
    let letter = match letter {
        "x" => Letter::X,
        "y" => Letter::Y,
        "z" => Letter::Z,
        _ => return Err(wrong()),
    };
    Ok((letter, joint))
}

/// `calib fit handeye`: `robot_i · X = Z · measured_i`.
///
/// # Errors
/// As [`cor`].
pub fn handeye(file: &Path, robot: &str, measured: &str) -> Result<Answer, PipelineError> {
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
            read_poses(file, &options).map_err(|error| PipelineError::Data {
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
    let solved = match calib_core::handeye::solve_ax_zb(
        &a,
        &b,
        calib_core::handeye::HandEyeWeights::default(),
    ) {
        Ok(solved) => solved,
        Err(
            error @ (calib_core::handeye::HandEyeError::OneAxis { .. }
            | calib_core::handeye::HandEyeError::TooFew { .. }),
        ) => {
            return Ok(not_observable("handeye", "single_axis", &error.to_string()));
        }
        Err(error) => return Err(data(file, error.to_string(), "correct the table")),
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

fn not_observable(id: &str, verdict: &str, reason: &str) -> Answer {
    let value =
        json!({ "estimator": id, "observable": false, "verdict": verdict, "reason": reason });
    answer(
        format!("{id}: not observable ({verdict}): {reason}\n"),
        &value,
        false,
    )
}

fn listed<'a>(rows: impl Iterator<Item = (&'a str, String, &'a str, &'a str)>) -> Answer {
    let mut text = String::new();
    let mut values = Vec::new();
    for (id, input, name, source) in rows {
        let _ = writeln!(text, "{id:<16} {input:<10} {name} ({source})");
        values.push(json!({ "id": id, "input": input, "name": name, "source": source }));
    }
    answer(text, &Value::Array(values), true)
}

/// Verdict, reason and estimate (value, σ) of each estimator.
type Line<'a> = (
    &'a str,
    &'a str,
    String,
    Option<(nalgebra::Vector3<f64>, f64)>,
);

/// A table of estimates with the distance of each from the first that is observable.
fn comparison(what: &str, lines: &[Line<'_>]) -> Answer {
    let lengths = what == "center_m";
    let reference = lines.iter().find(|l| l.1 == "ok").and_then(|l| l.3);
    let mut text = String::new();
    let mut values = Vec::new();
    for (id, verdict, reason, point) in lines {
        let Some((p, sigma)) = point else {
            let _ = writeln!(text, "{id:<16} {verdict}: {reason}");
            values.push(json!({ "estimator": id, "observable": false, "reason": reason }));
            continue;
        };
        let distance = reference.map(|(r, _)| {
            if lengths {
                (p - r).norm()
            } else {
                p.cross(&r).norm().atan2(p.dot(&r).abs())
            }
        });
        let combined = reference.map_or(f64::INFINITY, |(_, s)| (s * s + sigma * sigma).sqrt());
        let agrees = distance.is_some_and(|d| d <= 4.0 * combined);
        let (shown_sigma, shown_distance) = if lengths {
            (
                format!("{:.4} mm", sigma * 1e3),
                distance.map(|d| format!("{:.4} mm", d * 1e3)),
            )
        } else {
            (
                format!("{:.4} deg", sigma.to_degrees()),
                distance.map(|d| format!("{:.4} deg", d.to_degrees())),
            )
        };
        let _ = writeln!(
            text,
            "{id:<16} {verdict:<6} {}  sigma {shown_sigma}  off {}  {}",
            coordinates(p.as_slice()),
            shown_distance.unwrap_or_default(),
            if agrees { "agrees" } else { "DIFFERS" }
        );
        values.push(json!({ "estimator": id, "observable": *verdict == "ok", "reason": reason, what: p.as_slice(), "sigma": sigma, "distance": distance, "agrees": agrees }));
    }
    let observable = lines.iter().any(|l| l.1 == "ok");
    answer(text, &Value::Array(values), observable)
}

fn coordinates(values: &[f64]) -> String {
    let shown: Vec<String> = values.iter().map(|v| format!("{v:.6}")).collect();
    format!("[{}]", shown.join(", "))
}

fn matrix(rows: Vec<Vec<f64>>) -> Value {
    json!(rows)
}

fn pose_value(pose: &Isometry3<f64>) -> Value {
    json!({ "translation_m": pose.translation.vector.as_slice(), "rotation_xyzw": pose.rotation.coords.as_slice() })
}

fn pose_text(pose: &Isometry3<f64>) -> String {
    format!(
        "xyz {} m, xyzw {}",
        coordinates(pose.translation.vector.as_slice()),
        coordinates(pose.rotation.coords.as_slice())
    )
}
