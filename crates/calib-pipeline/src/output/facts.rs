//! The facts that the verdict depends on.

use std::collections::BTreeSet;

use calib_core::NoiseKind;
use calib_finding::{Finding, Severity, catalog};
use calib_geometry::statistics::median;
use calib_profile::Usage;
use calib_report::{
    BodyError, FoundNoise, Goodness, HeldOut, ImplausibleChange, Improvement, Limit, Orientation,
    Share, SingleJoint, Solver, Unit, UrdfAlone, Validation, VerdictFacts,
};
use nalgebra::UnitVector3;

use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::motion_axis;
use crate::formulate::ml;
use crate::formulate::row_levels::{HeldOutLevels, row_levels};
use crate::output::counts::{Tracks, rejected_parts, rejected_share};
use crate::output::evidence::{Evidence, fit_end};
use crate::output::of_fit::{stated_sigma, unit};
use crate::output::open;
use crate::prepare::inputs::Inputs;
use crate::verify::accuracy::{ToolBody, body_of, tool_bodies};
use crate::verify::agreement::agreement;
use crate::verify::motions::Motions;
use crate::verify::tracker_noise::recording_of;

/// Everything that the rules of the verdict look at.
pub(crate) fn facts(
    e: &Evidence<'_>,
    findings: &[Finding],
    limits: &[Limit],
    motions: &Motions,
    tracks: &Tracks,
) -> VerdictFacts {
    let held_out = e.held_out;
    let left_out = held_out.is_some_and(|h| h.left_out);
    let undetermined = e.origins.iter();
    let undetermined = undetermined.filter(|(_, origin)| origin.pose.is_none() && e.fit.is_none());
    VerdictFacts {
        limits: limits.to_vec(),
        of_bodies: held_out
            .filter(|h| !h.left_out)
            .map_or_else(Vec::new, |h| of_bodies(e.inputs, h)),
        solver: e.fit.map(|fit| Solver {
            ended: fit_end(fit),
            iterations: fit.solution.iterations,
        }),
        undetermined_origins: undetermined.map(|(name, _)| name.clone()).collect(),
        errors: of_severity(findings, Severity::Error),
        warnings: of_severity(findings, Severity::Warning),
        rejected: rejected_share(e.inputs, tracks),
        rejected_parts: rejected_parts(e.inputs, tracks),
        screened: held_out
            .filter(|h| !h.left_out)
            .map_or_else(Share::default, |h| Share {
                part: h.screened,
                of: h.n + h.screened,
            }),
        freed: e.fit.is_some_and(frees_the_robot),
        improvements: held_out.map(Improvement::of).unwrap_or_default(),
        changes: e.fit.map(|fit| changes(e, fit)).unwrap_or_default(),
        urdf_alone: held_out.and_then(|h| urdf_alone(e, h)),
        validation: match held_out {
            None => Validation::None,
            Some(h) if h.left_out => Validation::LeaveOneOut {
                postures: h.postures,
            },
            Some(_) => Validation::Recordings {
                postures: motions.postures,
                repeated: motions.repeated,
            },
        },
        orientation: orientation(e),
        single_joint: SingleJoint {
            fitted: motions.fitted_one_by_one,
            held_out: motions.held_out_one_by_one && !left_out && held_out.is_some(),
        },
        not_verified: motions.still.clone(),
        unseen_bodies: motions.unseen.clone(),
        goodness: e.fit.map(|fit| goodness(e, fit)),
        prediction: e
            .fit
            .and_then(|fit| open::prediction(e.inputs, fit, held_out, e.causes.changed.as_ref())),
        agreement: e
            .fit
            .filter(|_| !left_out)
            .and_then(|fit| agreement(e.inputs, fit, held_out))
            .map(|(agreement, _)| agreement),
    }
}

/// Held-out errors body by body, where several were seen.
fn of_bodies(inputs: &Inputs, held_out: &HeldOut) -> Vec<BodyError> {
    let of_body = |name: &String| {
        let is_of = |subject: &str| {
            body_of(inputs, subject).is_some_and(|(of_subject, _)| of_subject == name)
        };
        let found = held_out.expected_of(is_of)?;
        Some(BodyError {
            name: name.clone(),
            rms: found.rms_m,
            interval: (found.low_m, found.high_m),
        })
    };
    let names = inputs.robot.profile.bodies.keys();
    let all: Vec<BodyError> = names.filter_map(of_body).collect();
    if all.len() > 1 { all } else { Vec::new() }
}

/// The patched URDF without effects, beside the calibrated robot.
fn urdf_alone(e: &Evidence<'_>, held_out: &HeldOut) -> Option<UrdfAlone> {
    Some(UrdfAlone {
        rms: held_out.urdf_alone?.rms_m,
        refitted: held_out.urdf_refitted.map(|e| e.rms_m),
        with_effects: held_out.calibrated?.rms_m,
        limit: e.inputs.robot.profile.solve.limits.held_out_rms,
    })
}

/// Ids of the findings of one severity. What a rule of its own judges better is left to it.
fn of_severity(findings: &[Finding], severity: Severity) -> Vec<String> {
    let judged = |f: &&Finding| {
        f.severity == severity
            && !(severity == Severity::Warning && f.id == catalog::HELD_OUT_IN_TRAINING)
    };
    let of = findings.iter().filter(judged);
    of.map(|f| f.id.as_str().to_owned()).collect()
}

/// Whether anything of the robot itself was free, beyond where it and the bodies are.
fn frees_the_robot(fit: &MlFit) -> bool {
    let parameters = fit.formulation.problem.parameters().iter();
    parameters
        .into_iter()
        .any(|p| p.joint.is_some() && !p.fixed)
}

/// A change beyond this many standard deviations of its prior is one that the prior did not expect.
const IMPLAUSIBLE: f64 = 5.0;
/// An axis that turned by more than this was reversed, rad (150°).
const REVERSED: f64 = 150.0 * std::f64::consts::PI / 180.0;

/// Numbers far from their nominal values. Along directions that a gauge leaves open the priors hold the nominal values, so
/// that whatever is far off was moved by the data.
fn changes(e: &Evidence<'_>, fit: &MlFit) -> Vec<ImplausibleChange> {
    let model = &e.inputs.robot.model;
    let found = fit.calibration.urdf_model();
    let mut out = Vec::new();
    let mut reversed = BTreeSet::new();
    for joint in model.joint_ids() {
        let place = |of: &calib_urdf::RobotModel| of.joint(joint).parent_link_from_joint.rotation;
        let before = place(model);
        let off = before.angle_to(&place(&found));
        let axis = |axis: UnitVector3<f64>| (before * axis).angle(&(place(&found) * axis));
        let of_axis = motion_axis(model, joint).map(|a| axis(a.direction()));
        // A rotation about the axis itself is a zero offset: 180° of it are a sign, too.
        if off > REVERSED || of_axis.is_some_and(|angle| angle > REVERSED) {
            let name = &model.joint(joint).name;
            reversed.insert(name.clone());
            out.push(ImplausibleChange {
                name: name.clone(),
                change: of_axis.map_or(off, |angle| angle.max(off)),
                unit: Unit::Radian,
                sigmas: None,
            });
        }
    }
    let stated = fit.formulation.problem.parameters();
    for (p, stated) in fit.solution.parameters.iter().zip(stated) {
        let of_reversed = p.joint.as_ref().is_some_and(|j| reversed.contains(j));
        let Some(prior) = stated.prior_sigma.filter(|s| *s > 0.0) else {
            continue;
        };
        let sigmas = (p.value - p.nominal).abs() / prior;
        if !stated.fixed && !of_reversed && sigmas > IMPLAUSIBLE {
            out.push(ImplausibleChange {
                name: p.name.clone(),
                change: p.value - p.nominal,
                unit: unit(p.unit),
                sigmas: Some(sigmas),
            });
        }
    }
    out
}

/// Orientation of the bodies on the last link on held-out poses; a split body is two.
fn orientation(e: &Evidence<'_>) -> Orientation {
    let tools = tool_bodies(e.inputs);
    let subjects: Vec<&String> = tools.iter().flat_map(ToolBody::subjects).collect();
    let errors = e.held_out.iter().flat_map(|h| &h.poses);
    let angles: Vec<f64> = errors
        .filter(|pose| !pose.screened && subjects.contains(&&pose.subject))
        .filter_map(|pose| pose.calibrated_rad)
        .collect();
    let squares: f64 = angles.iter().map(|angle| angle * angle).sum();
    let expected = |fit: &MlFit| {
        let rows = HeldOutLevels::of(e.inputs, &fit.formulation.samples);
        let first = e.held_out.iter().flat_map(|h| &h.poses).next();
        let recording = first.and_then(|error| recording_of(e.inputs, error));
        let level = |kind, found| recording.map_or(found, |r| rows.level(r, kind, found));
        let mut tools = tools.iter();
        tools.find_map(|tool| tool.orientation_noise(e.tracks, fit, &level))
    };
    Orientation {
        rms: (!angles.is_empty()).then(|| (squares / angles.len() as f64).sqrt()),
        expected: e.fit.and_then(expected),
    }
}

fn goodness(e: &Evidence<'_>, fit: &MlFit) -> Goodness {
    let s = &fit.solution;
    /// Levels from fewer samples say little.
    const ENOUGH: usize = 20;
    /// Standard errors of ln σ: by chance one level of 30 000 is as far above, of a level from few samples; else one of 700.
    const CERTAIN: [f64; 2] = [4.0, 3.0];
    /// Standard errors of σ²: 99 % on one side.
    const CERTAIN_SQUARE: f64 = 2.33;
    let of_markers = e.tracks.values().filter_map(|track| track.marker_sigma);
    let rigid = median(of_markers.collect());
    // Means of holds have less noise than the rows that a profile states it of: those are no less certain than stated for it.
    let samples = &fit.formulation.samples;
    let within = HeldOutLevels::of(e.inputs, samples).within;
    // The same of frames of one posture.
    let fitted = e.inputs.recordings.values();
    let fitted = fitted.filter(|r| r.spec.usage != Usage::Validation);
    let of_frames = |kind: NoiseKind| {
        let merged = fitted.clone().map(|r| r.row_noise.of_kind(kind));
        merged.fold(within.of_kind(kind), f64::max)
    };
    let levels = row_levels(e.inputs, samples);
    // Where recordings have levels of their own, each has a scatter of its own.
    let rigid_of = |group: &str| {
        let own = levels.iter().skip(1).find(|l| group.contains(&l.name));
        let level = own.or(levels.first()).filter(|_| levels.len() > 1);
        level.map_or(rigid, |level| level.scatter(e.inputs))
    };
    let beside = s.noise.iter().filter_map(|n| {
        let of_slide = n.kind == NoiseKind::Slide;
        let stated =
            stated_sigma(&e.inputs.robot.profile, &n.name).filter(|s| *s > 0.0 && !of_slide)?;
        let few = (n.samples < ENOUGH).then_some(n.samples);
        let known = n.estimated && n.kind != NoiseKind::Scale;
        let relative = n.relative_error.filter(|_| known)?;
        let factor = n.sigma / stated;
        let of_rows = n.sigma.max(of_frames(n.kind).sqrt()) / stated;
        // What is beyond doubt above or below what is stated. Joints' noise hides behind that of markers: its square, not its logarithm, is found with
        // an error that does not depend on it.
        let certain = CERTAIN[usize::from(few.is_none())];
        let of_square =
            |ratio: f64| n.kind != NoiseKind::Joint || ratio > CERTAIN_SQUARE * 2.0 * relative;
        let above = factor * (-certain * relative).exp() > 1.0 && of_square(1.0 - factor.powi(-2));
        let below = few.is_none()
            && of_rows * (certain * relative).exp() < 1.0
            && of_square(of_rows.powi(-2) - 1.0);
        (above || below).then(|| FoundNoise {
            group: n.name.clone(),
            factor,
            of_rows,
            rigid: rigid_of(&n.name)
                .filter(|_| n.kind == NoiseKind::Position)
                .map(|sigma| sigma / stated),
            few,
        })
    });
    let beside: Vec<FoundNoise> = beside.collect();
    let unstated = s.noise.iter().filter(|n| {
        let stated = stated_sigma(&e.inputs.robot.profile, &n.name);
        n.estimated && n.samples >= ENOUGH && n.kind == NoiseKind::Position && stated.is_none()
    });
    let above = unstated.filter_map(|n| {
        // The scatter is that of all directions: along one of them there is more by right.
        let of_markers = (n.name == "marker" || n.name.starts_with("marker "))
            && !n.name.starts_with(ml::MARKER_ALONG_SIGHT);
        let rigid = rigid_of(&n.name).filter(|rigid| of_markers && *rigid > 0.0)?;
        Some((n.name.clone(), n.sigma / rigid))
    });
    let by_factor = |a: &&FoundNoise, b: &&FoundNoise| a.factor.total_cmp(&b.factor);
    let by_rows = |a: &&FoundNoise, b: &&FoundNoise| a.of_rows.total_cmp(&b.of_rows);
    Goodness {
        used: s.chi2 / s.degrees_of_freedom.max(1.0),
        band: Goodness::band_of(s.degrees_of_freedom),
        above_stated: beside.iter().max_by(by_factor).cloned(),
        below_stated: beside.iter().min_by(by_rows).cloned(),
        above_scatter: above.max_by(|a, b| a.1.total_cmp(&b.1)),
    }
}
