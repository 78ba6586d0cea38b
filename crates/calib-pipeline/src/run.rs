//! `calib run`: everything, in order.

use std::collections::BTreeMap;
use std::path::Path;

use calib_core::Settings;
use calib_files::OutputFile;
use calib_finding::{About, Fact, Finding, Severity, catalog};
use calib_profile::{BodyKind, Method};
use calib_report::{Report, ResidualRow, Status, Unobservable, Verdict};
use calib_urdf::JointId;
use nalgebra::{Isometry3, Matrix6};

use crate::error::{ExitCode, PipelineError};
use crate::estimate::estimators::values;
use crate::estimate::paper::{self, OriginEstimate};
use crate::estimate::start::{Start, mean_pose, start};
use crate::formulate::kinematics::Calibration;
use crate::formulate::ml::{self, FreeSet, MlFit};
use crate::output::assemble::{Evidence, assemble};
use crate::output::export::{Found, calibration_yaml, patch_urdf, scene};
use crate::output::shapes;
use crate::output::view::{Shown, view};
use crate::prepare::checks;
use crate::prepare::clock;
use crate::prepare::load::{Inputs, load_recordings, load_robot};
use crate::prepare::model_checks;
use crate::prepare::relabel::relabel;
use crate::prepare::tracks::{BodyTrack, body_tracks};
use crate::verify::closure::close_loops;
use crate::verify::held_out;
use crate::verify::known::{Known, known_numbers};

/// How to run.
#[derive(Debug, Clone, Default)]
pub struct RunOptions {
    /// Instead of the profile's method.
    pub method: Option<Method>,
    /// Go on although the data checks found errors.
    pub force: bool,
    /// Load no plugin; a profile that names one fails.
    pub no_plugins: bool,
}

/// What a run gives.
#[derive(Debug, Clone)]
pub struct RunOutput {
    /// The report.
    pub report: Report,
    /// Every file to be written.
    pub files: Vec<OutputFile>,
    /// How the program should end.
    pub exit: ExitCode,
}

/// Runs a profile; `progress` is told the name of each stage as it begins. Writes nothing.
///
/// # Errors
/// [`PipelineError`] for everything that stops a run before a report exists.
pub fn run(
    profile: &Path,
    options: &RunOptions,
    progress: &mut dyn FnMut(&str),
) -> Result<RunOutput, PipelineError> {
    progress("read profile and robot");
    let robot = load_robot(profile)?;
    progress("read recordings");
    run_on(
        load_recordings(robot, !options.no_plugins)?,
        options,
        progress,
    )
}

/// [`run`] on recordings that are in memory.
///
/// # Errors
/// As [`run`].
pub fn run_on(
    mut inputs: Inputs,
    options: &RunOptions,
    progress: &mut dyn FnMut(&str),
) -> Result<RunOutput, PipelineError> {
    progress("check data");
    let mut findings = inputs.findings.clone();
    if inputs.robot.profile.solve.robust {
        findings.extend(relabel(&mut inputs));
    }
    findings.extend(checks::check(&inputs));
    let (outlines, meshes) = shapes::outlines(&inputs.robot, &mut findings);
    inputs.digests.extend(meshes);
    let stops = |findings: &[Finding]| checks::stops(findings) && !options.force;
    let mut tracks = match body_tracks(&inputs, &mut findings) {
        Err(_) if stops(&findings) => return Err(stopped(&inputs, &findings)),
        tracks => tracks?,
    };
    let start = start(&inputs, &tracks);
    findings.extend(model_checks::before_the_fit(&inputs, &tracks, &start));
    if stops(&findings) {
        return Err(stopped(&inputs, &findings));
    }
    progress("estimate origins");
    let origins = paper::origins(&inputs, &tracks, &start, &inputs.estimators, &mut findings)?;
    let method = options.method.unwrap_or(inputs.robot.profile.solve.method);
    let nominal = nominal(&inputs, &start);
    let solved = match method {
        Method::Paper => {
            findings.push(paper_assumptions());
            paper_result(&inputs, &tracks, &start, &origins, &nominal)
        }
        Method::Ml => {
            only_a_cross_check(&mut findings);
            progress("fit registration only");
            // The baseline is plain least squares: what is left then is the geometry's fault, not noise to be estimated.
            let baseline = ml::state(&inputs, &tracks, &start, FreeSet::RegistrationOnly);
            let registered = ml::fit(baseline, &inputs, &Settings::plain())?;
            progress("fit all loops");
            let mut settings = Settings::default();
            settings.robust.enabled = inputs.robot.profile.solve.robust;
            let mut fit = ml::fit(
                ml::state(&inputs, &tracks, &start, FreeSet::Profile),
                &inputs,
                &settings,
            )?;
            if settings.robust.enabled {
                let bad = model_checks::bad_rows(&inputs, &tracks, &fit);
                findings.extend(bad.findings);
                if !bad.unsettled.is_empty() {
                    progress("fit again without the unsettled rows");
                    inputs.exclude(bad.unsettled);
                    tracks = body_tracks(&inputs, &mut Vec::new())?;
                    let stated = ml::state(&inputs, &tracks, &start, FreeSet::Profile);
                    fit = ml::fit(stated, &inputs, &settings)?;
                }
            }
            findings.extend(on_their_limit(&fit));
            inputs = clock::corrected(&inputs, &fit);
            ml_result(&inputs, fit, registered.calibration)?
        }
    };
    progress("verify");
    let body_from_origin: BTreeMap<String, Isometry3<f64>> = inputs
        .robot
        .profile
        .origins
        .iter()
        .filter_map(|(name, o)| {
            let found = solved
                .found
                .iter()
                .find(|f| f.name == format!("{}_from_{name}", o.body))?;
            Some((name.clone(), found.pose))
        })
        .collect();
    let loops = close_loops(&inputs, &tracks, &body_from_origin, &solved.fk);
    let held_out = held_out::held_out(
        &inputs,
        &tracks,
        Some(&nominal),
        solved.registered.as_ref(),
        &solved.robot,
    );
    progress("patch the URDF");
    let urdf = patch_urdf(&inputs, &solved.robot, &solved.known)?;
    let scene = scene(
        &inputs,
        &tracks,
        &solved.robot,
        solved.root_covariance.as_ref(),
        &solved.found,
    );
    progress("write the report");
    let residuals = crate::verify::residuals::residual_rows(
        &inputs,
        &tracks,
        &solved.robot,
        solved.fit.as_ref(),
    );
    let shown = Shown {
        nominal: &nominal,
        robot: &solved.robot,
        origins: &origins,
        held_out: held_out.as_ref(),
        fit: solved.fit.as_ref(),
    };
    let view = view(&inputs, &tracks, &shown, outlines);
    let written = written(&inputs, &residuals, &scene, &view, &urdf, &solved.robot)?;
    let report = assemble(&Evidence {
        inputs: &inputs,
        tracks: &tracks,
        method,
        findings: &findings,
        origins: &origins,
        found: &solved.found,
        fit: solved.fit.as_ref(),
        robot: &solved.robot,
        loops,
        held_out,
        urdf: &urdf,
        written: &written,
        residuals: &residuals,
    });
    let files = files(&inputs, &report, &scene, written, &view)?;
    let exit = exit_code(&report, solved.fit.as_ref(), &origins);
    Ok(RunOutput {
        report,
        files,
        exit,
    })
}

/// What either method hands on.
struct Solved {
    robot: Calibration,
    /// The robot whose forward kinematics the loops are closed with.
    fk: Calibration,
    registered: Option<Calibration>,
    found: Vec<Found>,
    root_covariance: Option<Matrix6<f64>>,
    known: BTreeMap<String, Known>,
    fit: Option<MlFit>,
}

pub(crate) fn stopped(inputs: &Inputs, findings: &[Finding]) -> PipelineError {
    let errors: Vec<String> = findings
        .iter()
        .filter(|f| f.severity == Severity::Error)
        .map(|f| {
            let rows: Vec<String> = f.rows.iter().take(5).map(u64::to_string).collect();
            let at = if rows.is_empty() {
                String::new()
            } else {
                format!(" (rows {})", rows.join(", "))
            };
            format!(
                "{} [{}]{at}: {}\n  help: {}",
                f.subject,
                f.id,
                f.text(),
                f.remedy()
            )
        })
        .collect();
    PipelineError::Data {
        file: inputs.robot.file.clone(),
        finding: format!(
            "the data checks found {} error(s)\n{}",
            errors.len(),
            errors.join("\n")
        ),
        remedy: "correct the data, or go on at your own risk with --force".to_owned(),
    }
}

/// What the paper's method takes for granted; its regions hold only as far as this is true.
fn paper_assumptions() -> Finding {
    Finding::new(catalog::PAPER_ASSUMPTIONS, About::Method)
}

/// Numbers that a physical limit of the profile stopped.
fn on_their_limit(fit: &MlFit) -> Vec<Finding> {
    let stated = fit.formulation.problem.parameters();
    let stopped = fit.solution.parameters.iter().zip(stated);
    stopped
        .filter(|(found, _)| found.at_bound)
        .filter_map(|(found, stated)| {
            let (_, limit) = stated.bounds?;
            let limit = match found.unit {
                calib_core::Unit::Metre => Fact::meters(limit),
                _ => Fact::radians(limit),
            };
            let about = About::Parameter(found.name.clone());
            Some(Finding::new(catalog::ON_ITS_LIMIT, about).with("limit", limit))
        })
        .collect()
}

/// The closed forms are start values here: where one has no answer, the likelihood may still have it.
fn only_a_cross_check(findings: &mut [Finding]) {
    for finding in findings
        .iter_mut()
        .filter(|f| f.id == catalog::ORIGIN_NOT_OBSERVABLE)
    {
        finding.severity = Severity::Warning;
    }
}

/// The robot as described, with the bodies placed by closed forms.
fn nominal(inputs: &Inputs, start: &Start) -> Calibration {
    let mut robot = Calibration::nominal(&inputs.robot.model, start.tracker_from_root);
    robot.mounts = start.mounts.clone();
    robot.points = start.points.clone();
    let profile = &inputs.robot.profile;
    let tips = profile.points.iter();
    robot.contact_points = tips.map(|(name, tip)| (name.clone(), tip.at)).collect();
    let contacts = profile.contacts.iter();
    robot.places = contacts
        .map(|(name, contact)| (name.clone(), contact.base_from_place))
        .collect();
    robot
}

/// The paper's result as a robot: mounts from the origins, everything else nominal.
fn paper_result(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    start: &Start,
    origins: &BTreeMap<String, OriginEstimate>,
    nominal: &Calibration,
) -> Solved {
    let profile = &inputs.robot.profile;
    let model = &inputs.robot.model;
    let zero = model.forward_kinematics(&model.zero_positions());
    let mut robot = nominal.clone();
    let mut found = Vec::new();
    let mut places = Vec::new();
    for (name, estimate) in origins {
        let origin = &profile.origins[name];
        let Some(pose) = estimate.pose else { continue };
        let body = &profile.bodies[&origin.body];
        // link_from_body = link_from_origin · (body_from_origin)⁻¹
        let link_from_origin = zero[body.link.index()].inverse() * zero[origin.link.index()];
        robot
            .mounts
            .insert(origin.body.clone(), link_from_origin * pose.inverse());
        let sweep = &inputs.recordings[&origin.sweep];
        for (q, seen) in sweep
            .q
            .iter()
            .zip(tracks[&origin.body].in_recording(&origin.sweep))
        {
            if let (Some(q), Some(seen)) = (q, seen) {
                places.push(seen * pose * model.root_from_link(q, origin.link).inverse());
            }
        }
        found.push(Found {
            name: format!("{}_from_{name}", origin.body),
            parent: origin.body.clone(),
            child: name.clone(),
            pose,
            covariance: estimate.covariance,
            unobservable: estimate.unobservable.clone(),
            status: estimate.status,
        });
    }
    let known_place = profile.bodies.values().any(|b| b.mount.is_some());
    if let (false, Some(place)) = (known_place, mean_pose(&places)) {
        robot.tracker_from_root = place;
    }
    for (name, t) in &profile.transforms {
        if let Some((joint, found_transform)) =
            paper_transform(inputs, tracks, start, origins, name, t)
        {
            if let Some(joint) = joint {
                let (id, origin) = joint;
                robot.model = robot.model.with_origin(id, origin);
            }
            found.push(found_transform);
        }
    }
    Solved {
        fk: Calibration {
            mounts: robot.mounts.clone(),
            ..nominal.clone()
        },
        robot,
        registered: None,
        found,
        root_covariance: None,
        known: BTreeMap::new(),
        fit: None,
    }
}

type CorrectedJoint = Option<(JointId, Isometry3<f64>)>;

/// A transform between links by the paper's method: from the sweep of the origin whose link is its child.
fn paper_transform(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    start: &Start,
    origins: &BTreeMap<String, OriginEstimate>,
    name: &str,
    t: &calib_profile::LinkTransform,
) -> Option<(CorrectedJoint, Found)> {
    let profile = &inputs.robot.profile;
    let model = &inputs.robot.model;
    let (origin_name, origin) = profile.origins.iter().find(|(_, o)| o.link == t.child)?;
    let estimate = origins.get(origin_name)?;
    let pose = estimate.pose?;
    let zero = model.forward_kinematics(&model.zero_positions());
    let sweep = &inputs.recordings[&origin.sweep];
    let mut samples = Vec::new();
    for (q, seen) in sweep
        .q
        .iter()
        .zip(tracks[&origin.body].in_recording(&origin.sweep))
    {
        let (Some(q), Some(seen)) = (q, seen) else {
            continue;
        };
        let root_from_link = model.forward_kinematics(q);
        // The child as it would stand at zero: undo the swept joints in the robot's own frame.
        let child_from_child_at_zero =
            root_from_link[t.child.index()].inverse() * zero[t.child.index()];
        let parent = start.tracker_from_root * root_from_link[t.parent.index()];
        samples.push(parent.inverse() * seen * pose * child_from_child_at_zero);
    }
    let parent_from_child = mean_pose(&samples)?;
    let corrected = t.correct.map(|joint| {
        let j = model.joint(joint);
        let parent_from_joint_parent = zero[t.parent.index()].inverse() * zero[j.parent.index()];
        let joint_child_from_child = zero[j.child.index()].inverse() * zero[t.child.index()];
        (
            joint,
            parent_from_joint_parent.inverse()
                * parent_from_child
                * joint_child_from_child.inverse(),
        )
    });
    let found = Found {
        name: name.to_owned(),
        parent: model.link(t.parent).name.clone(),
        child: model.link(t.child).name.clone(),
        pose: parent_from_child,
        covariance: estimate.covariance,
        unobservable: estimate.unobservable.clone(),
        status: estimate.status,
    };
    Some((corrected, found))
}

fn ml_result(
    inputs: &Inputs,
    fit: MlFit,
    registered: Calibration,
) -> Result<Solved, PipelineError> {
    let profile = &inputs.robot.profile;
    let model = &inputs.robot.model;
    let at_zero = calib_core::Configuration::zero();
    let mut found = Vec::new();
    let mut push =
        |name: String, parent: &str, child: &str, from, to| -> Result<(), PipelineError> {
            let derived = fit.solution.relative_pose(from, to, &at_zero)?;
            found.push(Found {
                name,
                parent: parent.to_owned(),
                child: child.to_owned(),
                pose: derived.pose,
                covariance: derived.covariance,
                unobservable: derived.unobservable.iter().map(in_words).collect(),
                status: Status::Calibrated,
            });
            Ok(())
        };
    for (name, origin) in &profile.origins {
        if let (Some(body), Some(link)) = (
            fit.formulation.bodies.get(&origin.body),
            fit.formulation.links[origin.link.index()],
        ) {
            push(
                format!("{}_from_{name}", origin.body),
                &origin.body,
                name,
                *body,
                link,
            )?;
        }
    }
    for (name, t) in &profile.transforms {
        if let (Some(parent), Some(child)) = (
            fit.formulation.links[t.parent.index()],
            fit.formulation.links[t.child.index()],
        ) {
            push(
                name.clone(),
                &model.link(t.parent).name,
                &model.link(t.child).name,
                parent,
                child,
            )?;
        }
    }
    let root = fit.formulation.links[model.root().index()];
    let root_covariance = match root {
        Some(root) => {
            fit.solution
                .relative_pose(fit.formulation.tracker, root, &at_zero)?
                .covariance
        }
        None => None,
    };
    let known = known_numbers(inputs, &fit);
    Ok(Solved {
        robot: fit.calibration.clone(),
        fk: fit.calibration.clone(),
        registered: Some(registered),
        found,
        root_covariance,
        known,
        fit: Some(fit),
    })
}

/// A twist of the child that the data do not see, as a sentence.
fn in_words(twist: &calib_geometry::Twist) -> Unobservable {
    let (w, v) = (twist.angular(), twist.linear());
    let direction = [w.x, w.y, w.z, v.x, v.y, v.z];
    let axis = |a: &nalgebra::Vector3<f64>| {
        /// A direction this near to a coordinate axis (cosine, 0.6°) is called by its letter.
        const ON_AXIS: f64 = 0.999_95;
        let n = a / a.norm();
        match n.iter().position(|c| c.abs() > ON_AXIS) {
            Some(k) => format!("{} axis", ["x", "y", "z"][k]),
            None => format!("direction [{:.2}, {:.2}, {:.2}]", n.x, n.y, n.z),
        }
    };
    let motion = match (w.norm() > 1e-6, v.norm() > 1e-6) {
        (true, false) => format!("a turn about its {}", axis(&w)),
        (false, true) => format!("a shift along its {}", axis(&v)),
        _ => format!(
            "a turn about its {} with a shift along its {}",
            axis(&w),
            axis(&v)
        ),
    };
    let text = format!("{motion}: no measurement shows it, the priors chose its size");
    Unobservable {
        direction,
        text,
        remedy: "usually nothing: it is a convention between this frame and the next, and the combinations below say with which; a mark or a second axis on the link would define it".to_owned(),
    }
}

/// The files that do not depend on the report, and what they are in words.
fn written(
    inputs: &Inputs,
    residuals: &[ResidualRow],
    scene: &calib_report::Scene,
    view: &calib_report::view3d::View3d,
    urdf: &crate::output::export::PatchedUrdf,
    robot: &Calibration,
) -> Result<Vec<(OutputFile, String)>, PipelineError> {
    let outputs = &inputs.robot.profile.outputs;
    let mut record = calib_report::json::exact_json(&urdf.record)?;
    record.push('\n');
    let stem = outputs.scene.trim_end_matches(".json");
    let mut files = vec![
        (
            OutputFile::text(outputs.urdf.clone(), urdf.text.clone()),
            format!("URDF with {} changed numbers", urdf.changes.len()),
        ),
        (
            OutputFile::text(format!("{}.changes.json", outputs.urdf), record),
            "what `calib revert` needs".to_owned(),
        ),
    ];
    if let Some(yaml) = calibration_yaml(inputs, robot) {
        let name = crate::output::export::calibration_name(&outputs.urdf);
        let what = "joint effects that a URDF cannot hold".to_owned();
        files.push((OutputFile::text(name, yaml), what));
    }
    let mut put = |name: String, text: String, what: &str| {
        files.push((OutputFile::text(name, text), what.to_owned()));
    };
    put(
        outputs.scene.clone(),
        scene.json()?,
        "scene for the situation model",
    );
    put(
        format!("{stem}.launch.py"),
        scene.ros_launch()?,
        "the scene as a ROS 2 launch file",
    );
    put(
        format!("{stem}.sdf"),
        scene.sdf()?,
        "the scene as an SDF world",
    );
    put(
        "residuals.csv".to_owned(),
        calib_report::csv::residuals_csv(residuals)?,
        "residuals of the fit, row by row",
    );
    files.push((
        OutputFile {
            name: format!("{stem}.glb"),
            bytes: calib_report::glb::glb(scene, view)?,
        },
        "robot, markers, errors as glTF for viewers".to_owned(),
    ));
    Ok(files)
}

fn files(
    inputs: &Inputs,
    report: &Report,
    scene: &calib_report::Scene,
    written: Vec<(OutputFile, String)>,
    view: &calib_report::view3d::View3d,
) -> Result<Vec<OutputFile>, PipelineError> {
    let outputs = &inputs.robot.profile.outputs;
    let mut files = vec![
        OutputFile::text("report.md", calib_report::markdown::markdown(report)),
        OutputFile::text("report.json", calib_report::json::report_json(report)?),
        OutputFile::text("report.html", calib_report::html::html(report, Some(view))?),
    ];
    files.extend(written.into_iter().map(|(file, _)| file));
    let report_json = files[1].bytes.clone();
    let scene_json = scene.json()?.into_bytes();
    for (name, parameters) in &outputs.reports {
        let writer = inputs
            .estimators
            .tables
            .report
            .get(name)?
            .with(&values(parameters))?;
        let input = calib_plugin::ReportInput {
            report_json: &report_json,
            scene_json: Some(&scene_json),
        };
        for file in writer.write(&input, &calib_plugin::Control::default())? {
            let own = format!("{name}.{}", file.path.replace(['/', '\\'], "."));
            files.push(OutputFile {
                name: own,
                bytes: file.bytes,
            });
        }
    }
    Ok(files)
}

fn exit_code(
    report: &Report,
    fit: Option<&MlFit>,
    origins: &BTreeMap<String, OriginEstimate>,
) -> ExitCode {
    if fit.is_some_and(|f| !f.solution.status.is_converged()) {
        return ExitCode::NotConverged;
    }
    if fit.is_none() && origins.values().any(|o| o.pose.is_none()) {
        return ExitCode::NotObservable;
    }
    match report.verdict {
        Verdict::Accepted => ExitCode::Accepted,
        Verdict::Rejected | Verdict::NotEvaluated => ExitCode::VerdictFail,
    }
}

/// Whether any body of the profile is made of markers.
#[must_use]
pub fn has_markers(inputs: &Inputs) -> bool {
    inputs
        .robot
        .profile
        .bodies
        .values()
        .any(|b| matches!(b.kind, BodyKind::Markers { .. }))
}
