//! The fit as the report's data.

use std::collections::BTreeSet;

use calib_core::{Gauge, GoodnessOfFit, NoiseKind};
use calib_geometry::statistics::median;
use calib_profile::Profile;
use calib_report::{
    Cause, ContactPoint, FitSummary, NotObservable, Parameter, Standardized, Term, TestAnswer,
    TestedEffect, Transform, Unit,
};

use crate::formulate::formulation::MlFit;
use crate::formulate::found::Found;
use crate::formulate::ml;
use crate::output::evidence::{Evidence, fit_end};

pub(crate) fn transform(found: &Found) -> Transform {
    Transform::new(
        &found.name,
        &found.parent,
        &found.child,
        &found.pose,
        found.covariance.as_ref(),
        found.status,
    )
    .with_unobservable(found.unobservable.clone())
}

pub(crate) fn unit(unit: calib_core::Unit) -> Unit {
    match unit {
        calib_core::Unit::Meter => Unit::Meter,
        calib_core::Unit::Radian => Unit::Radian,
        calib_core::Unit::Second => Unit::Second,
        calib_core::Unit::One => Unit::One,
        calib_core::Unit::RadianPerNewtonMeter => Unit::RadianPerNewtonMeter,
        calib_core::Unit::MeterPerNewton => Unit::MeterPerNewton,
        calib_core::Unit::PerKelvin => Unit::PerKelvin,
        calib_core::Unit::KilogramMeter => Unit::KilogramMeter,
    }
}

pub(crate) fn parameters(fit: &MlFit) -> Vec<Parameter> {
    let held = |i: usize| fit.formulation.problem.parameters()[i].fixed;
    let all = fit
        .solution
        .parameters
        .iter()
        .enumerate()
        .filter(|(i, _)| !held(*i));
    let robust = fit.solution.cluster_robust_sigmas().unwrap_or_default();
    let conventions = conventions(fit);
    all.map(|(i, p)| Parameter {
        name: p.name.clone(),
        joint: p.joint.clone(),
        kind: serde_json::to_value(p.kind)
            .ok()
            .and_then(|v| v.as_str().map(str::to_owned))
            .unwrap_or_default(),
        unit: unit(p.unit),
        nominal: p.nominal,
        value: p.value,
        sigma: p.sigma,
        sigma_cluster_robust: robust
            .get(i)
            .copied()
            .flatten()
            .filter(|_| p.sigma.is_some()),
        data_share: Some(p.data_share),
        class: match p.class {
            calib_core::ParameterClass::Solid => calib_report::Class::Solid,
            calib_core::ParameterClass::Weak => calib_report::Class::Weak,
            calib_core::ParameterClass::Prior => calib_report::Class::Prior,
            calib_core::ParameterClass::NotObservable if conventions.contains(&i) => {
                calib_report::Class::Convention
            }
            calib_core::ParameterClass::NotObservable => calib_report::Class::NotObservable,
        },
    })
    .collect()
}

/// Parameters whose values no prediction depends on: every combination that leaves them open is a convention.
fn conventions(fit: &MlFit) -> BTreeSet<usize> {
    let observability = &fit.solution.observability;
    let of = |convention: bool| -> BTreeSet<usize> {
        let directions = observability.null.iter();
        let of = directions.filter(|d| {
            (cause(d.gauge).meaning() == calib_report::Meaning::Convention) == convention
        });
        of.flat_map(|d| d.terms.iter().map(|t| t.parameter.index()))
            .collect()
    };
    &of(true) - &of(false)
}

pub(crate) fn not_observable(fit: &MlFit) -> Vec<NotObservable> {
    let parameters = fit.formulation.problem.parameters();
    let terms = |d: &calib_core::Direction| {
        let terms = d.terms.iter().map(|t| Term {
            parameter: parameters[t.parameter.index()].name.clone(),
            coefficient: t.amount,
        });
        terms.collect()
    };
    let observability = &fit.solution.observability;
    let directions = observability.null.iter();
    let edges = fit.formulation.problem.edges();
    let unmoved = observability.unmoved.iter();
    directions
        .map(|d| NotObservable::new(cause(d.gauge), terms(d)))
        .chain(unmoved.map(|e| NotObservable::joint_not_moved(&edges[e.index()].name)))
        .collect()
}

fn cause(gauge: Gauge) -> Cause {
    match gauge {
        Gauge::NotMeasured => Cause::NotMeasured,
        Gauge::WorldAgainstBase => Cause::WorldAgainstBase,
        Gauge::OffsetAgainstOwnOrigin => Cause::OffsetAgainstOwnOrigin,
        Gauge::OffsetAgainstNeighbor => Cause::OffsetAgainstNeighbor,
        Gauge::TranslationAlongAxis => Cause::TranslationAlongAxis,
        Gauge::RotationAboutAxis => Cause::RotationAboutAxis,
        Gauge::ParallelAxes => Cause::ParallelAxes,
        Gauge::CollinearAxes => Cause::CollinearAxes,
        Gauge::ToolAgainstLastOrigin => Cause::ToolAgainstLastOrigin,
        Gauge::PointOnlyTool => Cause::PointOnlyTool,
        Gauge::MarkersAgainstMount => Cause::MarkersAgainstMount,
        Gauge::WorldAgainstTool => Cause::WorldAgainstTool,
        Gauge::Scale => Cause::Scale,
        Gauge::LoadsAgainstCompliances => Cause::LoadsAgainstCompliances,
        Gauge::TableAgainstContact => Cause::TableAgainstContact,
        Gauge::Unnamed => Cause::Combination,
    }
}

/// Median of the cluster-robust standard deviation over the stated one where the data determine a parameter.
fn cluster_robust_ratio(parameters: &[Parameter]) -> Option<f64> {
    let solid = parameters
        .iter()
        .filter(|p| p.class == calib_report::Class::Solid);
    let ratios =
        solid.filter_map(|p| Some(p.sigma_cluster_robust? / p.sigma.filter(|s| *s > 0.0)?));
    median(ratios.collect())
}

pub(crate) fn fit_summary(profile: &Profile, fit: &MlFit, parameters: &[Parameter]) -> FitSummary {
    let s = &fit.solution;
    // Against what the profile states, where it states something; what was found explains itself.
    let levels = s
        .noise
        .iter()
        .map(|n| stated_sigma(profile, &n.name).unwrap_or(n.sigma));
    let chi2 = s.chi2_with(&levels.collect::<Vec<_>>()).unwrap_or(s.chi2);
    let groups = s.noise.iter().filter(|n| n.samples > 0).map(|n| &n.name);
    FitSummary {
        ended: fit_end(fit),
        status: fit_end(fit).after(s.iterations),
        converged: s.status.is_converged(),
        iterations: s.iterations,
        observations: s.weights.iter().filter(|w| **w > 0.0).count(),
        unknowns: s.model.free(),
        chi2_per_dof: Some(chi2 / s.degrees_of_freedom.max(1.0)),
        chi2_used_per_dof: Some(s.chi2 / s.degrees_of_freedom.max(1.0)),
        stated_noise: groups
            .filter(|name| stated_sigma(profile, name).is_some())
            .cloned()
            .collect(),
        cluster_robust_ratio: cluster_robust_ratio(parameters),
    }
}

/// The noise level that the profile states for a group of observations.
pub(crate) fn stated_sigma(profile: &Profile, group: &str) -> Option<f64> {
    // With a level for each body, its name follows.
    let of = |of: &str| {
        group
            .strip_prefix(of)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with(' '))
    };
    let sight = profile.tracker.sight;
    match group {
        // What is stated of all directions alike says nothing of depth.
        _ if of(ml::MARKER_ALONG_SIGHT) => sight.marker,
        _ if of(ml::BODY_ALONG_SIGHT) => sight.body,
        _ if of(ml::BODY_ABOUT_SIGHT) => sight.body_rad,
        _ if of("marker") => profile.tracker.marker_sigma,
        _ if of("body position") => profile.tracker.body_sigma,
        _ if of("body orientation") => profile.tracker.body_sigma_rad,
        joint if joint == "joint" || joint.starts_with("joint ") => profile.solve.noise.joint,
        _ => None,
    }
}

pub(crate) fn noise(e: &Evidence<'_>, fit: &MlFit) -> Vec<calib_report::Noise> {
    let profile = &e.inputs.robot.profile;
    fit.solution
        .noise
        .iter()
        .filter(|n| n.samples > 0)
        .map(|n| calib_report::Noise {
            group: n.name.clone(),
            kind: match n.kind {
                NoiseKind::Position => calib_report::NoiseKind::Position,
                NoiseKind::Orientation => calib_report::NoiseKind::Orientation,
                NoiseKind::Joint => calib_report::NoiseKind::Joint,
                NoiseKind::Slide => calib_report::NoiseKind::Slide,
                NoiseKind::Scale => calib_report::NoiseKind::Scale,
            },
            unit: match n.kind {
                NoiseKind::Position | NoiseKind::Slide => Unit::Meter,
                _ => Unit::Radian,
            },
            sigma: Some(n.sigma),
            relative_error: n.relative_error,
            stated: stated_sigma(profile, &n.name).filter(|_| n.kind != NoiseKind::Slide),
            samples: n.samples,
            text: calib_report::Noise::method(n.estimated).to_owned(),
        })
        .collect()
}

/// How the residuals are distributed, with their tails where these are heavy.
pub(crate) fn standardized(found: &calib_core::StandardizedResiduals) -> Option<Standardized> {
    /// Chance of calling normal noise heavy-tailed.
    const CHANCE: f64 = 1e-3;
    let heavy = calib_core::Tails::of(&found.vectors).filter(|t| t.p_value < CHANCE);
    let tails = heavy.and_then(|t| {
        Some(calib_report::Tails {
            degrees_of_freedom: t.degrees_of_freedom?,
            least: t.least,
            most: t.most?,
            p_value: t.p_value,
        })
    });
    Some(Standardized::of(&found.rows)?.with_tails(tails))
}

/// What was tried of the noise from pose to pose.
pub(crate) fn noise_choice(fit: &MlFit) -> Option<calib_report::NoiseChoice> {
    let choice = fit.noise.as_ref()?;
    let candidates = choice.candidates.iter();
    let of_joints = |c: &calib_core::NoiseCandidate| {
        let joints = c.levels.iter().filter(|l| l.kind == NoiseKind::Joint);
        joints.map(|l| l.sigma).max_by(f64::total_cmp)
    };
    Some(calib_report::NoiseChoice {
        chosen: noise_model(choice.chosen),
        poses: choice.poses,
        rejected: choice.admission.map_or(0, |a| a.rejected),
        readmitted: choice.admission.map_or(0, |a| a.readmitted),
        candidates: candidates
            .map(|c| calib_report::NoiseCandidate {
                model: noise_model(c.model),
                left_out_rms_m: c.left_out_rms,
                surprise: c.surprise,
                surprise_error: c.surprise_error,
                admitted: c.admitted,
                joint_sigma_rad: of_joints(c),
            })
            .collect(),
    })
}

fn noise_model(model: calib_core::NoiseModel) -> calib_report::NoiseModel {
    match model {
        calib_core::NoiseModel::Joint => calib_report::NoiseModel::Joint,
        calib_core::NoiseModel::BodyPose => calib_report::NoiseModel::BodyPose,
        calib_core::NoiseModel::JointAndSlide => calib_report::NoiseModel::JointAndSlide,
        calib_core::NoiseModel::JointEach => calib_report::NoiseModel::JointEach,
        _ => calib_report::NoiseModel::White,
    }
}

/// The tests effect by effect, the most significant of each first.
pub(crate) fn tested_effects(goodness: &GoodnessOfFit) -> Vec<TestedEffect> {
    let mut out: Vec<TestedEffect> = Vec::new();
    for test in &goodness.tests {
        let effect = match test.physics {
            calib_core::Physics::Effect(kind) => Some(kind.effect().id.to_owned()),
            _ => None,
        };
        let answer = if goodness.missing.iter().any(|m| m.name == test.name) {
            TestAnswer::AskedFor
        } else if test.is_significant() {
            TestAnswer::Small
        } else {
            TestAnswer::NotSeen
        };
        let place = out.iter().position(|t| t.effect == effect);
        let place = place.unwrap_or_else(|| {
            out.push(TestedEffect::default());
            out.len() - 1
        });
        let known = &mut out[place];
        let matters = answer == TestAnswer::AskedFor && known.answer != TestAnswer::AskedFor;
        if known.tested == 0 || matters {
            *known = TestedEffect {
                effect,
                tested: known.tested,
                parameter: test.name.clone(),
                explains: test.explains,
                p_value: test.p_corrected,
                answer,
            };
        }
        known.tested += 1;
    }
    out
}

/// A significant score test as the report tells it.
pub(crate) fn missing_physics(test: &calib_core::ScoreTest) -> calib_report::MissingPhysics {
    calib_report::MissingPhysics {
        physics: match test.physics {
            calib_core::Physics::Effect(kind) => calib_report::Physics::Effect(kind.physics()),
            _ => calib_report::Physics::Drift,
        },
        parameter: test.name.clone(),
        estimate: test.estimate,
        explains: test.explains,
        p_value: test.p_corrected,
    }
}

/// Points of the robot that touch something, with σ where they were estimated.
pub(crate) fn contact_points(e: &Evidence<'_>, parameters: &[Parameter]) -> Vec<ContactPoint> {
    let profile = &e.inputs.robot.profile;
    let point = |(name, tip): (&String, &calib_profile::Tip)| {
        let sigma = |axis: &str| {
            let name = format!("{name}.{axis}");
            parameters.iter().find(|p| p.name == name)?.sigma
        };
        let sigmas = sigma("x").zip(sigma("y")).zip(sigma("z"));
        let at = e.robot.contact_points.get(name).copied();
        ContactPoint {
            name: name.clone(),
            link: e.inputs.robot.model.link(tip.link).name.clone(),
            position_m: at.unwrap_or(tip.at).coords.into(),
            sigma_m: sigmas.map(|((x, y), z)| [x, y, z]),
        }
    };
    profile.points.iter().map(point).collect()
}
