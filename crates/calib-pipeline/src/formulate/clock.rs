//! What is left of the clocks' offset after the alignment, estimated with everything else.
//!
//! A row of a motion has joint values of the time τ that the alignment gives. If the true time is τ + c₀ + c₁ u, u from −1
//! at the recording's first row to 1 at its last, every joint was at
//!
//! ```text
//! φ = q(τ) + q̇(τ) (c₀ + c₁ u)                                                                        (1)
//! ```
//!
//! so one c₀ and one c₁ are shared by all joints of a recording ([`calib_core::EffectKind::ClockOffset`]).

use std::collections::BTreeMap;

use calib_checks::sync::ClockMap;
use calib_core::{EffectKind, Parameter, ParameterId, ParameterKind, Problem, Unit};
use calib_finding::{About, Fact, Finding, Subject, catalog};
use calib_profile::Usage;
use calib_report::{Clock, ClockCheck, number};

use crate::formulate::formulation::{ClockParameters, Formulation, FreeSet, MlFit};
use crate::formulate::late;
use crate::prepare::aligned::{Alignment, ClockState, ClockUnknowns, SAME_TIME};
use crate::prepare::inputs::{Inputs, Loaded};

/// Prior σ of c₀ and c₁, s: ten times what the alignment leaves on a bad recording.
pub(crate) const PRIOR: f64 = 5e-3;

/// The clocks of one recording as the whole fit sees them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockEstimate {
    /// Tracker minus robot in the middle of the recording, s.
    pub offset: f64,
    /// Its standard deviation, s.
    pub sigma: Option<f64>,
    /// How much faster the tracker's clock runs, 1 (5e-5 = 50 ppm).
    pub drift: f64,
    /// Its standard deviation.
    pub drift_sigma: Option<f64>,
}

/// First and last time, s, of the rows; `None` without time or with one row.
fn span(loaded: &Loaded) -> Option<(f64, f64)> {
    let t = loaded.poses.t.as_ref()?;
    let (first, last) = (*t.first()?, *t.last()?);
    (last > first).then_some((first, last))
}

/// u of equation (1).
pub(crate) fn position(loaded: &Loaded, row: usize) -> Option<f64> {
    let (first, last) = span(loaded)?;
    let t = *loaded.poses.t.as_ref()?.get(row)?;
    Some((2.0 * t - first - last) / (last - first))
}

/// Frees c₀ and c₁ of every fitted recording whose clocks were found from its motion, and c₀ where the clocks are one; where
/// they are declared so, or no `timing` is given, the offset is only offered to the test for missing physics.
pub fn add_clocks(formulation: &mut Formulation, inputs: &Inputs, free_set: FreeSet) {
    for (name, loaded) in &inputs.recordings {
        if loaded.spec.usage == Usage::Validation || loaded.velocities.is_empty() {
            continue;
        }
        let alignment = loaded.alignment.as_ref();
        let unknowns = alignment.map_or(ClockUnknowns::None, Alignment::unknowns);
        for (joint, speeds) in &loaded.velocities {
            let Some(edge) = inputs
                .robot
                .model
                .joint_id(joint)
                .ok()
                .and_then(|id| formulation.joints[id.index()])
            else {
                continue;
            };
            let regressor = |weight: &dyn Fn(usize) -> f64| -> Vec<f64> {
                let value = |(recording, row): &(String, usize)| {
                    if recording != name {
                        return 0.0;
                    }
                    speeds.get(*row).copied().flatten().unwrap_or(0.0) * weight(*row)
                };
                formulation.samples.iter().map(value).collect()
            };
            let constant = regressor(&|_| 1.0);
            if unknowns == ClockUnknowns::None || free_set == FreeSet::RegistrationOnly {
                let problem = &mut formulation.problem;
                let clock = format!("{name}.clock_offset");
                problem.shared_candidate(edge, EffectKind::ClockOffset, clock, constant);
                continue;
            }
            let drifts = unknowns == ClockUnknowns::OffsetAndDrift;
            let linear = regressor(&|row| position(loaded, row).unwrap_or(0.0));
            let problem = &mut formulation.problem;
            let clock = formulation.clocks.entry(name.clone());
            let ClockParameters { offset, drift } =
                *clock.or_insert_with(|| clock_parameters(problem, name, drifts));
            problem.share_effect(edge, EffectKind::ClockOffset, Some(constant), offset);
            if let Some(drift) = drift {
                problem.share_effect(edge, EffectKind::ClockOffset, Some(linear), drift);
            }
        }
    }
    late::add_latencies(formulation, inputs);
}

/// c₀ of a recording, and c₁ where the clocks are two.
fn clock_parameters(problem: &mut Problem, recording: &str, drifts: bool) -> ClockParameters {
    let mut parameter = |what: &str| {
        problem.parameter(Parameter {
            name: format!("{recording}.{what}"),
            joint: None,
            kind: ParameterKind::Effect(EffectKind::ClockOffset),
            unit: Unit::Second,
            nominal: 0.0,
            start: 0.0,
            prior_sigma: Some(PRIOR),
            bounds: None,
            fixed: false,
        })
    };
    ClockParameters {
        offset: parameter("clock_offset"),
        drift: drifts.then(|| parameter("clock_drift")),
    }
}

/// Values and σ of c₀ and c₁ of a recording; `None` where the fit does not estimate them.
pub(crate) fn estimates(fit: &MlFit, recording: &str) -> Option<[(f64, Option<f64>); 2]> {
    let clock = fit.formulation.clocks.get(recording)?;
    let estimate = |id: ParameterId| {
        let found = &fit.solution.parameters[id.index()];
        (found.value, found.sigma)
    };
    let drift = clock.drift.map_or((0.0, None), estimate);
    Some([estimate(clock.offset), drift])
}

/// The clocks of a recording: from the fit where it estimates them, from a held-out recording's own rows and the calibrated
/// robot, else from the alignment; `None` where nothing was estimated.
#[must_use]
pub fn clock_estimate(loaded: &Loaded, fit: Option<&MlFit>) -> Option<ClockEstimate> {
    let alignment = loaded.alignment.as_ref()?;
    let same = ClockMap {
        offset: 0.0,
        drift: 0.0,
        reference: 0.0,
        offset_sigma: 0.0,
        drift_sigma: 0.0,
        correlation: 1.0,
        second: 0.0,
    };
    let (map, aligned) = match &alignment.clocks {
        ClockState::Found { map, .. } => (*map, true),
        ClockState::OneWithLag { start } => (
            ClockMap {
                offset: *start,
                ..same
            },
            false,
        ),
        ClockState::One | ClockState::Declared => return None,
    };
    let by_correlation = aligned.then_some(ClockEstimate {
        offset: map.offset,
        sigma: Some(map.offset_sigma),
        drift: map.drift,
        drift_sigma: Some(map.drift_sigma),
    });
    let Some((first, last)) = span(loaded) else {
        return by_correlation;
    };
    let refined = alignment.refined.as_ref();
    let [k0, k1] = refined.map_or([0.0; 2], |r| r.shift);
    let own = refined.and_then(|r| r.sigma);
    let ([c0, c1], [sigma, drift_sigma]) =
        match (fit.and_then(|fit| estimates(fit, &loaded.name)), own) {
            (Some([(c0, s0), (c1, s1)]), _) => ([k0 + c0, k1 + c1], [s0, s1]),
            (None, Some([s0, s1])) => ([k0, k1], [Some(s0), Some(s1)]),
            (None, None) => return by_correlation,
        };
    let (middle, half) = (0.5 * (first + last), 0.5 * (last - first));
    Some(ClockEstimate {
        offset: middle - map.to_b(middle) - c0,
        sigma,
        drift: map.drift - c1 / half,
        drift_sigma: drift_sigma.filter(|_| aligned).map(|s| s / half),
    })
}

/// What the fit says of the clocks, in place of what was noticed before it: the numbers of an offset, and joint values that
/// were read late.
pub fn noticed(findings: &mut Vec<Finding>, inputs: &Inputs, fit: &MlFit) {
    let fitted = inputs.recordings.values();
    let fitted = fitted.filter(|r| r.spec.usage != Usage::Validation);
    // Late joint values show the tracker's event later on the robot's clock.
    let lags: BTreeMap<&str, (f64, f64)> = fitted
        .filter(|r| r.alignment.as_ref().map(Alignment::unknowns) == Some(ClockUnknowns::Offset))
        .filter_map(|r| {
            let clock = clock_estimate(r, Some(fit))?;
            Some((r.name.as_str(), (-clock.offset, clock.sigma?)))
        })
        .collect();
    let of_one_joint: BTreeMap<&String, Finding> = inputs
        .recordings
        .keys()
        .filter_map(|name| Some((name, late::of_one_joint(inputs, &lags, name)?)))
        .collect();
    findings.extend(of_one_joint.values().cloned());
    for loaded in inputs.recordings.values() {
        let Some(alignment) = &loaded.alignment else {
            continue;
        };
        let Some(clock) = clock_estimate(loaded, Some(fit)) else {
            continue;
        };
        if of_one_joint.contains_key(&loaded.name) {
            continue;
        }
        let sigma = clock.sigma.unwrap_or_default();
        if alignment.unknowns() == ClockUnknowns::OffsetAndDrift {
            let own = findings.iter_mut().filter(|f| {
                f.id == catalog::CLOCK_LAG && f.subject.recordings.contains(&loaded.name)
            });
            for finding in own {
                let mut own = finding
                    .clone()
                    .with("offset", Fact::seconds(clock.offset))
                    .with("sigma", Fact::seconds(sigma));
                // A rate that the fit does not tell stays as it was found before.
                if let Some(sigma) = clock.drift_sigma {
                    own = own
                        .with("drift", Fact::ratio(clock.drift))
                        .with("sigma_drift", Fact::ratio(sigma));
                }
                *finding = own;
            }
        } else if alignment.unknowns() == ClockUnknowns::Offset
            && clock.offset.abs() > SAME_TIME.max(4.0 * sigma)
        {
            let kind = match clock.offset < 0.0 {
                true => "corrected_behind",
                false => "corrected_ahead",
            };
            let subject = Subject {
                recordings: vec![loaded.name.clone()],
                ..About::Clocks.into()
            };
            findings.push(
                Finding::of_kind(catalog::CLOCK_LAG, kind, subject)
                    .with("recording", Fact::name(&loaded.name))
                    .with("offset", Fact::seconds(clock.offset.abs()))
                    .with("sigma", Fact::seconds(sigma)),
            );
        }
    }
}

/// Takes joint values at the times that the fit found, for residuals and predictions.
pub fn correct(inputs: &mut Inputs, fit: &MlFit) {
    let model = &inputs.robot.model;
    for (name, loaded) in &mut inputs.recordings {
        let Some([(c0, _), (c1, _)]) = estimates(fit, name) else {
            continue;
        };
        let places: Vec<Option<f64>> = (0..loaded.q.len())
            .map(|row| position(loaded, row))
            .collect();
        for (joint, speeds) in &loaded.velocities {
            let Ok(id) = model.joint_id(joint) else {
                continue;
            };
            for (row, q) in loaded.q.iter_mut().enumerate() {
                let (Some(q), Some(speed), Some(u)) =
                    (q, speeds.get(row).copied().flatten(), places[row])
                else {
                    continue;
                };
                q[id.index()] += speed * (c0 + c1 * u);
            }
        }
    }
}

/// Whether a finding says that joint values and tracker data of a recording are not of the same time.
fn is_off(findings: &[Finding], recording: &str) -> bool {
    // Readings of one joint that are late are no clock.
    let of_joint = |f: &Finding| matches!(f.subject.about, About::Joint(_));
    let lag = |f: &&Finding| f.id == catalog::CLOCK_LAG && !of_joint(f);
    let mut lags = findings.iter().filter(lag);
    let named = |f: &Finding| {
        let of = &f.subject.recordings;
        of.is_empty() || of.iter().any(|name| name == recording)
    };
    let mut missing = findings.iter().filter(|f| f.id == catalog::MISSING_PHYSICS);
    lags.any(named)
        || missing.any(|f| f.facts.get("recording").and_then(Fact::word) == Some(recording))
}

/// The report's answer to "did the clocks agree?", recording by recording; what a finding says of them is not contradicted.
#[must_use]
pub fn clocks(inputs: &Inputs, fit: Option<&MlFit>, findings: &[Finding]) -> Vec<Clock> {
    let untimed = inputs
        .recordings
        .values()
        .all(|r| r.poses.t.is_none() && r.alignment.is_none());
    let any_off = || inputs.recordings.keys().any(|r| is_off(findings, r));
    if untimed && !any_off() {
        return vec![Clock {
            recording: "all".to_owned(),
            clock: "tracker".to_owned(),
            against: "joints".to_owned(),
            check: ClockCheck::NotNeeded,
            agrees: Some(true),
            text: ClockCheck::NotNeeded.text().to_owned(),
            ..Clock::default()
        }];
    }
    inputs
        .recordings
        .values()
        .map(|r| {
            let off = is_off(findings, &r.name);
            aligned_clock(r, fit, off).unwrap_or_else(|| {
                let check = match (off, r.poses.t.is_none()) {
                    (true, _) => ClockCheck::Noticed,
                    (false, true) => ClockCheck::NotNeeded,
                    (false, false) => ClockCheck::NotTested,
                };
                Clock {
                    recording: r.name.clone(),
                    clock: "tracker".to_owned(),
                    against: "joints".to_owned(),
                    check,
                    agrees: match check {
                        ClockCheck::Noticed => Some(false),
                        ClockCheck::NotNeeded => Some(true),
                        _ => None,
                    },
                    text: check.text().to_owned(),
                    ..Clock::default()
                }
            })
        })
        .collect()
}

/// Where the clocks of rows of a motion come from.
fn estimated(r: &Loaded, clock: &ClockEstimate) -> String {
    let refined = r.alignment.as_ref().and_then(|a| a.refined.as_ref());
    let from = match refined.and_then(|r| r.sigma) {
        Some(_) => {
            "estimated from its own rows with the calibrated robot (for each tenth of them from the other nine)"
        }
        None => "estimated from all loops",
    };
    let drift = clock.drift_sigma.map_or_else(String::new, |sigma| {
        let drift = number::fixed(clock.drift * 1e6, 0);
        format!(", {drift} ± {:.0} ppm", sigma * 1e6)
    });
    format!(
        "; {from}: {} at mid-recording{drift}, and corrected",
        number::with_sigma(clock.offset, clock.sigma, calib_report::Unit::Second),
    )
}

/// The clocks of a recording whose rows were made from streams.
fn aligned_clock(r: &Loaded, fit: Option<&MlFit>, off: bool) -> Option<Clock> {
    let alignment = r.alignment.as_ref()?;
    let estimate = clock_estimate(r, fit);
    let mut text = alignment.text();
    if let Some(clock) = estimate.filter(|_| alignment.holds.is_none()) {
        text += &estimated(r, &clock);
    } else if estimate.is_some() {
        text += "; the remaining offset has no effect on holds";
    }
    Some(Clock {
        recording: r.name.clone(),
        clock: alignment.tracker_clock.clone(),
        against: alignment.robot_clock.clone(),
        check: ClockCheck::Aligned,
        offset_s: estimate.map(|c| c.offset),
        sigma_s: estimate.and_then(|c| c.sigma),
        drift: estimate.map(|c| c.drift),
        drift_sigma: estimate.and_then(|c| c.drift_sigma),
        agrees: Some(!off),
        text,
    })
}
