//! The fit as the report's data.

use calib_core::{Gauge, NoiseKind};
use calib_report::{FitSummary, Meaning, NotObservable, Parameter, Term, Transform, Unit};

use crate::formulate::found::Found;
use crate::formulate::ml::MlFit;
use crate::output::assemble::fit_end;
use crate::output::evidence::Evidence;

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
        calib_core::Unit::Metre => Unit::Metre,
        calib_core::Unit::Radian => Unit::Radian,
        calib_core::Unit::Second => Unit::Second,
        calib_core::Unit::One => Unit::One,
        calib_core::Unit::RadianPerNewtonMetre => Unit::RadianPerNewtonMetre,
        calib_core::Unit::MetrePerNewton => Unit::MetrePerNewton,
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
    all.map(|(_, p)| Parameter {
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
        data_share: Some(p.data_share),
        class: match p.class {
            calib_core::ParameterClass::Solid => calib_report::Class::Solid,
            calib_core::ParameterClass::Weak => calib_report::Class::Weak,
            calib_core::ParameterClass::Prior => calib_report::Class::Prior,
            calib_core::ParameterClass::NotObservable => calib_report::Class::NotObservable,
        },
    })
    .collect()
}

pub(crate) fn not_observable(fit: &MlFit) -> Vec<NotObservable> {
    let mut out: Vec<NotObservable> = fit
        .solution
        .observability
        .null
        .iter()
        .map(|d| NotObservable {
            meaning: match d.gauge {
                Gauge::WorldAgainstBase
                | Gauge::OffsetAgainstOwnOrigin
                | Gauge::OffsetAgainstNeighbour
                | Gauge::SlideAlongAxis
                | Gauge::TurnAboutAxis
                | Gauge::ParallelAxes
                | Gauge::ToolAgainstLastOrigin
                | Gauge::MarkersAgainstMount => Meaning::Convention,
                // With other motion or another mark it would show.
                _ => Meaning::NotMeasured,
            },
            subject: d.terms.first().map_or_else(String::new, |t| t.name.clone()),
            direction: d
                .terms
                .iter()
                .map(|t| Term {
                    parameter: t.name.clone(),
                    coefficient: t.amount,
                })
                .collect(),
            text: d.text.clone(),
            remedy: d.remedy.clone(),
        })
        .collect();
    for joint in &fit.solution.observability.unmoved {
        out.push(NotObservable {
            meaning: Meaning::NotMeasured,
            subject: joint.clone(),
            direction: Vec::new(),
            text: format!(
                "joint `{joint}` did not move in the fitted recordings and keeps its nominal parameters"
            ),
            remedy: "Move it in a sweep or in static poses.".to_owned(),
        });
    }
    out
}

pub(crate) fn fit_summary(fit: &MlFit) -> FitSummary {
    let s = &fit.solution;
    FitSummary {
        ended: fit_end(fit),
        status: fit_end(fit).after(s.iterations),
        converged: s.status.is_converged(),
        iterations: s.iterations,
        observations: s.weights.iter().filter(|w| **w > 0.0).count(),
        unknowns: s.model.free(),
        chi2_per_dof: Some(s.chi2_stated / s.degrees_of_freedom.max(1.0)),
    }
}

pub(crate) fn noise(e: &Evidence<'_>, fit: &MlFit) -> Vec<calib_report::Noise> {
    let profile = &e.inputs.robot.profile;
    let stated = |name: &str| match name {
        "marker" => profile.tracker.marker_sigma,
        "body position" => profile.tracker.body_sigma,
        "body orientation" => profile.tracker.body_sigma_rad,
        _ => profile.solve.noise.joint,
    };
    fit.solution
        .noise
        .iter()
        .map(|n| calib_report::Noise {
            group: n.name.clone(),
            kind: match n.kind {
                NoiseKind::Position => calib_report::NoiseKind::Position,
                NoiseKind::Orientation => calib_report::NoiseKind::Orientation,
                NoiseKind::Joint => calib_report::NoiseKind::Joint,
                NoiseKind::Scale => calib_report::NoiseKind::Scale,
            },
            unit: match n.kind {
                NoiseKind::Position => Unit::Metre,
                _ => Unit::Radian,
            },
            sigma: Some(n.sigma),
            stated: stated(&n.name),
            samples: fit.solution.weights.iter().filter(|w| **w > 0.0).count(),
            text: calib_report::Noise::method(n.estimated).to_owned(),
        })
        .collect()
}
