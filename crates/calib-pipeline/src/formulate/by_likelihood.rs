//! The result of the fit of all loops.

use calib_core::Settings;
use calib_finding::{About, Fact, Finding, Severity, catalog};
use calib_report::{Status, Unobservable};

use crate::error::PipelineError;
use crate::formulate::checked::Checked;
use crate::formulate::found::Found;
use crate::formulate::kinematics::Calibration;
use crate::formulate::ml::{self, FreeSet, MlFit};
use crate::formulate::solved::Solved;
use crate::formulate::{clock, model_checks};
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::body_tracks;

/// Fits all loops at once; rows that had not settled are excluded and the fit is repeated.
///
/// # Errors
/// [`PipelineError::Solve`], and those of the body tracks.
pub fn likelihood(
    inputs: &mut Inputs,
    checked: &mut Checked,
    progress: &mut dyn FnMut(&str),
) -> Result<Solved, PipelineError> {
    only_a_cross_check(&mut checked.findings);
    progress("fit registration only");
    // The baseline is plain least squares: what is left then is the geometry's fault, not noise to be estimated.
    let baseline = ml::state(
        inputs,
        &checked.tracks,
        &checked.start,
        FreeSet::RegistrationOnly,
    );
    let registered = ml::fit(baseline, inputs, &Settings::plain())?;
    progress("fit all loops");
    let mut settings = Settings::default();
    settings.robust.enabled = inputs.robot.profile.solve.robust;
    let full = ml::state(inputs, &checked.tracks, &checked.start, FreeSet::Profile);
    let mut fit = ml::fit(full, inputs, &settings)?;
    if settings.robust.enabled {
        let bad = model_checks::bad_rows(inputs, &checked.tracks, &fit);
        checked.findings.extend(bad.findings);
        if !bad.unsettled.is_empty() {
            progress("fit again without the unsettled rows");
            inputs.exclude(bad.unsettled);
            checked.tracks = body_tracks(inputs, &mut Vec::new())?;
            let full = ml::state(inputs, &checked.tracks, &checked.start, FreeSet::Profile);
            fit = ml::fit(full, inputs, &settings)?;
        }
    }
    checked.findings.extend(on_their_limit(&fit));
    *inputs = clock::corrected(inputs, &fit);
    ml_result(inputs, fit, registered.calibration)
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
    Ok(Solved {
        robot: fit.calibration.clone(),
        fk: fit.calibration.clone(),
        registered: Some(registered),
        found,
        root_covariance,
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
