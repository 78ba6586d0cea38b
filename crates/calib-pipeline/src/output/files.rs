//! The files of a run.

use calib_files::OutputFile;
use calib_model::file::RobotModelFile;
use calib_report::{Output, Report, ResidualRow};

use crate::error::PipelineError;
use crate::formulate::kinematics::Calibration;
use crate::output::export::{PatchedUrdf, calibration_name, calibration_yaml};
use crate::output::model_file::model_name;
use crate::prepare::estimators::values;
use crate::prepare::inputs::Inputs;

/// The robot in its forms.
pub(crate) struct Robots<'a> {
    /// The patched URDF.
    pub urdf: &'a PatchedUrdf,
    /// The URDF that was fitted to be used without effects, where there are any.
    pub alone: Option<PatchedUrdf>,
    /// Everything that was found.
    pub model: &'a RobotModelFile,
    /// The same as the program has it.
    pub robot: &'a Calibration,
}

/// Name of the URDF that is used without effects: `r.calibrated.urdf` gives `r.calibrated.alone.urdf`.
pub(crate) fn alone_name(urdf: &str) -> String {
    format!("{}.alone.urdf", urdf.trim_end_matches(".urdf"))
}

/// The files but for the report's own, and what they are in words.
pub(crate) fn written(
    inputs: &Inputs,
    residuals: &[ResidualRow],
    (scene, view): (&calib_report::Scene, &calib_report::view3d::View3d),
    robots: &Robots<'_>,
) -> Result<Vec<(OutputFile, String)>, PipelineError> {
    let outputs = &inputs.robot.profile.outputs;
    let urdf = robots.urdf;
    let mut record = calib_report::json::exact_json(&urdf.record)?;
    record.push('\n');
    let ((glb, mcap), (model, residuals)) = rayon::join(
        || {
            rayon::join(
                || calib_report::glb::glb(scene, view),
                || calib_report::mcap::mcap(scene, view),
            )
        },
        || {
            rayon::join(
                || calib_report::json::exact_json(robots.model),
                || calib_report::csv::residuals_csv(residuals),
            )
        },
    );
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
    if let Some(yaml) = calibration_yaml(inputs, robots.robot) {
        let name = calibration_name(&outputs.urdf);
        let what = "joint effects that a URDF cannot hold".to_owned();
        files.push((OutputFile::text(name, yaml), what));
    }
    if let Some(alone) = &robots.alone {
        let what = "URDF fitted to be used without the joint effects".to_owned();
        let text = alone.text.clone();
        files.push((OutputFile::text(alone_name(&outputs.urdf), text), what));
    }
    let mut model = model?;
    model.push('\n');
    let mut put = |name: String, text: String, what: &str| {
        files.push((OutputFile::text(name, text), what.to_owned()));
    };
    put(
        model_name(&outputs.urdf),
        model,
        "the calibrated robot with its effects and uncertainty, for programs",
    );
    put(
        outputs.scene.clone(),
        scene.json()?,
        "scene: frames, joints and touched things with uncertainty (JSON)",
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
        residuals?,
        "residuals of the fit, row by row",
    );
    files.push((
        OutputFile {
            name: format!("{stem}.glb"),
            bytes: glb?,
        },
        "robot, markers, errors as glTF for viewers".to_owned(),
    ));
    files.push((
        OutputFile {
            name: format!("{stem}.mcap"),
            bytes: mcap?,
        },
        "the poses as a recording for players (MCAP)".to_owned(),
    ));
    Ok(files)
}

/// What is written, with its digest but for the report's own files.
pub(crate) fn listed(inputs: &Inputs, written: &[(OutputFile, String)]) -> Vec<Output> {
    let profile = &inputs.robot.profile;
    let written = written.iter().map(|(file, what)| Output {
        path: file.name.clone(),
        what: (*what).to_owned(),
        sha256: Some(calib_urdf::sha256_hex(&file.bytes)),
        changes: (file.name == profile.outputs.urdf).then(|| profile.urdf.clone()),
    });
    let own = [
        ("report.md", "this report as Markdown"),
        ("report.json", "this report as data"),
        ("report.html", "this report as a page"),
    ];
    let own = own.map(|(path, what)| Output {
        path: path.to_owned(),
        what: what.to_owned(),
        sha256: None,
        changes: None,
    });
    written.chain(own).collect()
}

/// All files; none where a plugin failed to compute what they rest on.
pub(crate) fn files(
    inputs: &Inputs,
    report: &Report,
    scene: &calib_report::Scene,
    written: Vec<(OutputFile, String)>,
    view: &calib_report::view3d::View3d,
) -> Result<Vec<OutputFile>, PipelineError> {
    inputs.estimators.evaluated()?;
    let outputs = &inputs.robot.profile.outputs;
    let (html, (json, markdown)) = rayon::join(
        || calib_report::html::html(report, Some(view)),
        || {
            rayon::join(
                || calib_report::json::report_json(report),
                || calib_report::markdown::markdown(report),
            )
        },
    );
    let mut files = vec![
        OutputFile::text("report.md", markdown),
        OutputFile::text("report.json", json?),
        OutputFile::text("report.html", html?),
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
