//! Which single mistake, or which pair, explains the recordings: asked before any row is blamed.
//!
//! The recordings and the nominal robot, with the couplings that the profile declares, go to the engine
//! ([`calib_checks::structural`]) in one call over all fitted recordings; what it decides becomes findings. Where the
//! fitted recordings agree with the robot, those of the validation join them in a second call.

mod bodies;
mod codes;
mod columns;
mod declared;
mod jump;
mod layout;
mod limits;
mod merge;
mod named;
mod placed;
mod twins;
mod without;

use std::collections::{BTreeMap, BTreeSet};

use calib_checks::structural::{
    BodyIndex, Chain, Correction, Decision, Hypothesis, JointIndex, Options, Outcome,
    RecordingIndex, Scope, Scoped, WrongReadings, apply_all, by_rounding_alone, explain,
    registration_residual, thin,
};
use calib_finding::{Fact, Finding, Severity, Subject, catalog};
use calib_profile::Usage;

use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

pub use declared::{Coupling, coupled};
pub use layout::Layout;
pub use merge::keep_unexplained;

/// A residual of this many times what nominal errors explain is a mistake, not a bad URDF: errors three times the
/// expected ones (3°, 30 mm) reach it in 1 of 100 robots.
const NOT_NOMINAL: f64 = 3.0;

/// No tracker resolves less, m: three decimals of a millimeter are 0.5 µm.
const COMPUTED: f64 = 3e-6;

/// Rows that tell which of two robots is nearer to the recordings.
const ROWS: usize = 200;

/// A mistake that divides the residual by 1.5 raised it by more than this.
const RAISED: f64 = 1.1;

/// What the structural hypotheses say.
#[derive(Debug, Clone, Default)]
pub struct Structural {
    /// For the report and for `calib check`.
    pub findings: Vec<Finding>,
    /// No mistake about whole recordings stands out: single rows may be judged.
    pub rows_count: bool,
    /// Couplings that the profile declares.
    pub couplings: Vec<Coupling>,
    /// Zeros and gains that are off, where that is all that is wrong and the fit estimates them.
    pub of_fit: Correction,
}

/// The nominal robot with the places and the couplings that the profile leaves open as the bodies see them; `None` where its joints are no tree.
#[must_use]
pub fn chain(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
) -> Option<(Chain, Vec<Coupling>)> {
    let mut chain = Chain::from_model(&inputs.robot.model).ok()?;
    let mut plain = Layout::new(inputs, tracks, &chain, false);
    let placed = placed::placed(inputs, tracks);
    if let Some(placed) = placed.and_then(|model| Chain::from_model(&model).ok()) {
        let there = Layout::new(inputs, tracks, &placed, false);
        let residual =
            |of: &Layout<'_>| registration_residual(&thin(&of.data, ROWS)).unwrap_or(f64::INFINITY);
        if residual(&there) < residual(&plain) {
            (chain, plain) = (placed, there);
        }
    }
    let couplings = declared::couplings(inputs, &plain.data);
    Some((declared::coupled(chain, &couplings), couplings))
}

/// Asks the engine about the recordings.
#[must_use]
pub fn structural(inputs: &Inputs, tracks: &BTreeMap<String, BodyTrack>) -> Structural {
    let Some((chain, couplings)) = chain(inputs, tracks) else {
        return Structural::default();
    };
    let mut layout = Layout::new(inputs, tracks, &chain, false);
    let mut found = Structural {
        findings: Vec::new(),
        rows_count: true,
        couplings,
        of_fit: Vec::new(),
    };
    let mut options = Options::default();
    if let Some(sigma) = inputs.robot.profile.tracker.marker_coordinate() {
        options.sigma = sigma;
    }
    // A profile that expects more of the drawing than is usual is believed.
    let prior = &inputs.robot.profile.solve.prior;
    options.prior_angle = options.prior_angle.max(prior.angle);
    options.prior_length = options.prior_length.max(prior.position);
    options.clocks_estimated = layout.clocks_are_estimated();
    let computed = bodies::computed(&layout, tracks);
    let of_bodies = computed.iter().map(|one| one.finding(&layout));
    found.findings.extend(of_bodies);
    layout.leave_out(&computed.iter().map(|one| one.body).collect());
    // Without a body there is nothing to compare; what a reader lets through does not contradict itself.
    let Ok(outcome) = explain(&layout.data, &options) else {
        return found;
    };
    let outcome = twins::likelier_first(&layout, outcome);
    found.findings.extend(decision(&layout, &outcome));
    found.of_fit = left_to_the_fit(&layout, &outcome);
    let consistent = matches!(outcome.decision, Decision::Consistent { .. });
    let consistent = consistent || !found.of_fit.is_empty();
    found
        .findings
        .extend(not_measured(&layout, &outcome, options.sigma));
    let mut beside = limits::findings(&layout, &outcome, consistent);
    beside.retain(|finding| !without::says(&found.findings, finding));
    found.findings.extend(beside);
    let too_few = matches!(outcome.decision, Decision::TooFewData { .. });
    found.rows_count = (consistent || too_few) && computed.is_empty();
    if found.rows_count {
        let mut all = Layout::new(inputs, tracks, &chain, true);
        all.data = apply_all(&found.of_fit, &all.data);
        let (errors, of_fit) = of_validation(&all, &outcome, options);
        found.of_fit.extend(of_fit);
        // A change at one row looks like a gain in the rows around it.
        if errors
            .iter()
            .any(|f| f.id == catalog::CHANGED_WHILE_RECORDING)
        {
            let of_gain = [catalog::JOINT_GAIN, catalog::JOINT_COUPLING];
            found.findings.retain(|f| !of_gain.contains(&f.id));
        }
        found.findings.extend(errors);
    }
    found
}

/// A nominal robot that fits to less than any tracker resolves, and far less than the stated noise `sigma`, m, was not measured.
fn not_measured(layout: &Layout<'_>, outcome: &Outcome, sigma: f64) -> Option<Finding> {
    /// Part of the noise: of as many coordinates as there are, none scatters so little by chance.
    const BELOW: f64 = 0.1;
    /// Rows that leave a residual.
    const ROWS: usize = 6;
    /// A good robot with short links is as close to its drawing as what is written in larger steps shows, m.
    const FINE: f64 = 1e-4;
    let consistent = matches!(outcome.decision, Decision::Consistent { .. });
    let moves = !outcome.design.moving.is_empty() && outcome.rows >= ROWS;
    let limit = COMPUTED.min(BELOW * sigma);
    let rounded = || {
        (0..layout.bodies.len()).all(|body| {
            by_rounding_alone(&layout.data, BodyIndex(body)).is_some_and(|left| left < FINE)
        })
    };
    (consistent && moves && (outcome.rms < limit || rounded())).then(|| {
        let recordings = layout.recordings.iter().map(|r| r.name.clone()).collect();
        let subject = Subject {
            recordings,
            ..Subject::default()
        };
        Finding::of_kind(catalog::NOT_MEASURED, "all", subject)
            .with("none", Fact::meters(outcome.rms))
    })
}

/// The corrections that are named, where all of them are zeros and gains that the fit estimates.
fn left_to_the_fit(layout: &Layout<'_>, outcome: &Outcome) -> Correction {
    let estimated = |scoped: &Scoped| match scoped.hypothesis {
        Hypothesis::Zero { joint, offset } => {
            let slides = layout.data.chain.turns(joint.0) == Some(false);
            let near = slides || offset.abs() <= named::FAR;
            scoped.scope == Scope::All && near && layout.frees_zero(joint)
        }
        Hypothesis::Gain { joint, factor } => {
            let near = named::FITTED_GAINS.contains(&factor);
            scoped.scope == Scope::All && near && layout.frees_gain(joint)
        }
        _ => false,
    };
    match &outcome.decision {
        Decision::Named(named) if named.correction.iter().all(estimated) => {
            named.correction.clone()
        }
        _ => Vec::new(),
    }
}

/// What is wrong in the recordings of the validation alone, where they raise the residual of the fitted ones, and what the fit estimates that only they show.
fn of_validation(
    all: &Layout<'_>,
    fitted: &Outcome,
    mut options: Options,
) -> (Vec<Finding>, Correction) {
    let held_out = |r: &&Loaded| r.spec.usage == Usage::Validation;
    if !all.recordings.iter().any(held_out) {
        return (Vec::new(), Vec::new());
    }
    let rms = registration_residual(&thin(&all.data, options.most_rows));
    let of_fitted = match &fitted.decision {
        Decision::Named(named) => named.evidence.best,
        _ => fitted.rms,
    };
    if rms.is_ok_and(|rms| rms < RAISED * of_fitted) {
        return (Vec::new(), Vec::new());
    }
    (options.list_invisible, options.score_tests) = (false, false);
    // Fitted recordings that were too few to be judged are judged with the others.
    if !matches!(fitted.decision, Decision::TooFewData { .. }) {
        let recordings = all.recordings.iter().enumerate();
        let suspects = recordings.filter(|(_, r)| held_out(r));
        options.suspects = suspects.map(|(r, _)| RecordingIndex(r)).collect();
    }
    let Ok(outcome) = explain(&all.data, &options) else {
        return (Vec::new(), Vec::new());
    };
    let outcome = twins::likelier_first(all, outcome);
    // A large residual alone was judged by the fitted recordings.
    let of_fit = left_to_the_fit(all, &outcome);
    let mut findings = decision(all, &outcome);
    findings.retain(|f| f.severity == Severity::Error || !of_fit.is_empty());
    (findings, of_fit)
}

/// The joint whose readings are wrong.
fn readings(layout: &Layout<'_>, outcome: &Outcome, found: &WrongReadings) -> Finding {
    let name = layout.joint(found.joint);
    let recordings = layout.recordings_in(found.scope);
    let subject = Subject {
        recordings: recordings.iter().map(|r| (*r).to_owned()).collect(),
        ..Subject::joint(name)
    };
    let turns = layout.data.chain.turns(found.joint.0) == Some(true);
    let size = |x: f64| {
        if turns {
            Fact::radians(x)
        } else {
            Fact::meters(x)
        }
    };
    let rows = |shift: i8| Fact::count(usize::from(shift.unsigned_abs()));
    let some = (found.scope != Scope::All).then_some(recordings);
    Finding::of_kind(catalog::MODEL_DISAGREES, "readings", subject)
        .with("joint", Fact::name(name))
        .with_some("recordings", some.map(Fact::names))
        .with("none", Fact::meters(outcome.rms))
        .with_some("limit", outcome.expected.map(|e| Fact::meters(e.limit)))
        .with("best", Fact::meters(found.rms))
        .with_some("next", found.next.map(Fact::meters))
        .with("off", Fact::count(found.off))
        .with("rows", Fact::count(found.rows))
        .with("least", size(found.least))
        .with("median", size(found.median))
        .with_some("earlier", found.shift.filter(|s| *s < 0).map(rows))
        .with_some("later", found.shift.filter(|s| *s > 0).map(rows))
}

/// The findings of a decision.
fn decision(layout: &Layout<'_>, outcome: &Outcome) -> Vec<Finding> {
    match &outcome.decision {
        Decision::Named(named) => {
            // What leaves more than nominal errors explain is not all, where something else is.
            let frames = (named.within_expected == Some(false))
                .then(|| bodies::in_another_frame(layout, outcome))
                .flatten();
            let other = frames.or_else(|| without::in_place_of(layout, outcome, named));
            other.map_or_else(|| named::findings(layout, outcome, named), |f| vec![f])
        }
        Decision::Undecided { .. } if outcome.jump.is_some() => {
            let found = outcome.jump.iter();
            found
                .map(|found| jump::finding(layout, outcome, found))
                .collect()
        }
        Decision::Undecided { .. } if outcome.readings.is_some() => {
            let found = outcome.readings.iter();
            found
                .map(|found| readings(layout, outcome, found))
                .collect()
        }
        Decision::Undecided { leading, .. } => {
            let apart = without::apart(layout, outcome);
            let of_columns = |apart: &without::Apart| apart.of_columns(layout, outcome);
            if let Some(finding) = apart.as_ref().and_then(of_columns) {
                return vec![finding];
            }
            if let Some(finding) = bodies::in_another_frame(layout, outcome) {
                return vec![finding];
            }
            let limit = outcome.expected.map(|e| e.limit);
            let beyond = limit.is_none_or(|limit| outcome.rms > NOT_NOMINAL * limit);
            let kind = if beyond || leading.is_some() {
                "undecided"
            } else {
                "large"
            };
            let recordings = layout.recordings.iter().map(|r| r.name.clone()).collect();
            let subject = Subject {
                recordings,
                ..Subject::default()
            };
            let assumed: BTreeSet<JointIndex> = outcome.assumed_zero.iter().map(|a| a.0).collect();
            let assumed = assumed.iter().map(|joint| layout.joint(*joint).to_owned());
            let assumed: Vec<String> = assumed.collect();
            let finding = Finding::of_kind(catalog::MODEL_DISAGREES, kind, subject)
                .with("none", Fact::meters(outcome.rms))
                .with_some("limit", limit.map(Fact::meters))
                .with_some(
                    "assumed",
                    (!assumed.is_empty()).then(|| Fact::names(assumed)),
                );
            let finding = match apart {
                Some(apart) => apart.noted(layout, finding),
                None => finding,
            };
            let Some(leading) = leading else {
                return vec![finding];
            };
            let finding = named::with_evidence(layout, finding, outcome, leading);
            let code = codes::of_correction(layout, &leading.correction);
            vec![
                finding
                    .with_some("limit", limit.map(Fact::meters))
                    .with("leading", Fact::names([code])),
            ]
        }
        _ => Vec::new(),
    }
}
