//! Did a body, the tracker or a joint's zero move while the data were recorded?

use std::collections::BTreeSet;

use calib_core::{
    ChanceOfChanges, Change, ChangeScan, ChangeSettings, GoodnessOfFit, Moved, Scatter,
};
use calib_core::{EdgeId, FrameId};
use calib_finding::{About, Fact, Finding, Severity, Subject, catalog};
use calib_profile::Usage;
use calib_urdf::Joint;

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::Inputs;

/// Standard deviations within which the size of a change lies, 97.5 % on the side that counts.
const CERTAIN: f64 = 2.0;

/// Standard deviations from which the zero of one of several joints counts as changed.
const CLEAR: f64 = 3.0;

/// An angle below it is rounding, rad.
const ROUNDING: f64 = 1e-9;

/// The scan of the fitted recordings; `known`: the chance of changes, where that of recordings in the same postures is known.
#[must_use]
pub fn scan(fit: &MlFit, known: Option<&ChanceOfChanges>) -> Option<ChangeScan> {
    let mut settings = settings(fit);
    settings.known = known.cloned();
    fit.solution.changes(&settings)
}

/// The chance of changes in recordings as those of a fit.
#[must_use]
pub fn chance(fit: &MlFit) -> Option<ChanceOfChanges> {
    fit.solution.chance_of_changes(&settings(fit))
}

fn settings(fit: &MlFit) -> ChangeSettings {
    let mut settings = ChangeSettings::default();
    settings.borders = fit.formulation.borders();
    settings
}

/// What a change is to be told beside.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Beside {
    /// The missing effect that explains more than the change does.
    pub physics: Option<String>,
    /// Effects that explain the data as well in its place.
    pub alike: Vec<String>,
}

impl Beside {
    /// Where the change is the only suspect that was found.
    #[must_use]
    pub fn of_tests(goodness: Option<&GoodnessOfFit>) -> Self {
        let missing = goodness.and_then(|g| g.missing.first());
        Self {
            physics: missing.map(|t| t.name.clone()),
            alike: Vec::new(),
        }
    }
}

/// At most one finding: the change that the data show best. Others appear once it has been dealt with.
#[must_use]
pub fn finding(inputs: &Inputs, fit: &MlFit, scan: &ChangeScan, beside: Beside) -> Option<Finding> {
    let change = scan.significant()?;
    // What is fast at first looks like the effects of the joints that are swept first.
    if matches!(change.moved, Moved::Settling(_)) && beside.physics.is_some() {
        return None;
    }
    let names = Names { inputs, fit };
    let finding = names.described(change)?;
    // The tracker that moved and the tracker that drifted have one name.
    let is_tracker = |moved| {
        matches!(
            moved,
            Moved::Reference(_) | Moved::Drift(_) | Moved::Settling(_)
        )
    };
    let rivals = scan.rivals().into_iter();
    let others = rivals.filter(|c| !(is_tracker(c.moved) && is_tracker(change.moved)));
    let (zeros, others): (Vec<_>, Vec<_>) = others.partition(|c| c.moved == Moved::Zeros);
    let mut rivals: Vec<String> = others.into_iter().filter_map(|c| names.of(c)).collect();
    rivals.dedup();
    let zeros = zeros
        .into_iter()
        .flat_map(|c| names.clear_steps(c))
        .collect();
    // What of the size is beyond doubt.
    let of = |name| finding.facts.get(name).and_then(Fact::value);
    let size = of("distance").map(|size| size - CERTAIN * of("sigma").unwrap_or(0.0));
    let limits = &inputs.robot.profile.solve.limits;
    // What an effect explains as well is no certain step.
    let certain = beside.physics.is_none();
    let harmful = match (size, limits.held_out_max.or(limits.held_out_rms)) {
        (Some(size), Some(limit)) => size > limit,
        _ => false,
    };
    let names = |all: Vec<String>| (!all.is_empty()).then(|| Fact::names(all));
    let finding = finding
        .with_some("rivals", names(rivals))
        .with_some("zeros", names(zeros))
        .with_some("alternatives", names(beside.alike))
        .with_some("physics", beside.physics.map(Fact::name));
    Some(if harmful && certain {
        finding.with_severity(Severity::Error)
    } else {
        finding
    })
}

/// Findings of rows that deviate because something moved: they are nearly all rows on the shorter side of a step, and no others.
#[must_use]
pub fn rows_of(
    inputs: &Inputs,
    fit: &MlFit,
    change: &Change,
    findings: &[Finding],
) -> Vec<Finding> {
    /// Part of the rows of that side.
    const NEARLY_ALL: f64 = 0.7;
    if !matches!(
        change.moved,
        Moved::Body(_) | Moved::Reference(_) | Moved::Joint(_) | Moved::Zeros
    ) {
        return Vec::new();
    }
    let samples = &fit.formulation.samples;
    let also: BTreeSet<&String> = change.also.iter().map(|s| &samples[*s].0).collect();
    let (mut after, mut before) = (BTreeSet::new(), BTreeSet::new());
    for (s, (name, row)) in samples.iter().enumerate() {
        let loaded = &inputs.recordings[name];
        if loaded.spec.usage == Usage::Validation {
            continue;
        }
        let is_after = (change.first..change.end).contains(&s) || also.contains(name);
        let side = if is_after { &mut after } else { &mut before };
        side.insert((name, loaded.poses.rows[*row]));
    }
    let shorter = if after.len() <= before.len() {
        after
    } else {
        before
    };
    let of_rows = |f: &&Finding| {
        let about_rows = [catalog::ROW_OUTLIER, catalog::UNSETTLED_ROWS].contains(&f.id);
        let at = |row: &u64| {
            let mut recordings = f.subject.recordings.iter();
            recordings.any(|name| shorter.contains(&(name, *row)))
        };
        about_rows && !f.rows.is_empty() && f.rows.iter().all(at)
    };
    let found: Vec<&Finding> = findings.iter().filter(of_rows).collect();
    let rows = found.iter().flat_map(|f| {
        let name = f.subject.recordings.first();
        f.rows.iter().map(move |row| (name, row))
    });
    let rows: BTreeSet<_> = rows.collect();
    if (rows.len() as f64) < NEARLY_ALL * shorter.len() as f64 {
        return Vec::new();
    }
    found.into_iter().cloned().collect()
}

/// The finding on a memory of the noise, where it is all that the change makes of successive rows: a step that most of the residuals are, or of
/// everything that is seen, a tracker that moved.
pub fn memory_of<'f>(
    change: &Change,
    findings: &'f [Finding],
) -> impl Iterator<Item = &'f Finding> {
    let tracker = matches!(
        change.moved,
        Moved::Reference(_) | Moved::Drift(_) | Moved::Settling(_)
    );
    /// Share of the cost.
    const MOST: f64 = 0.5;
    let most = change.explains > MOST;
    let kind = |f: &Finding| f.facts.get("kind").and_then(Fact::word) == Some("together");
    let all = findings.iter();
    all.filter(move |f| f.id == catalog::NOISE_HAS_MEMORY && (most || tracker && kind(f)))
}

/// The joint that scatters.
#[must_use]
pub fn scatter(inputs: &Inputs, fit: &MlFit, scatter: Scatter) -> Option<Finding> {
    let names = Names { inputs, fit };
    let joint = names.joint(scatter.joint)?;
    let kind = if scatter.by_stop { "stops" } else { "rows" };
    let sigma = match joint.kind.turns() {
        true => Fact::radians(scatter.sigma),
        false => Fact::meters(scatter.sigma),
    };
    let subject = Subject::joint(joint.name.clone());
    let finding = Finding::of_kind(catalog::JOINT_SCATTERS, kind, subject);
    Some(
        finding
            .with("joint", Fact::name(joint.name.clone()))
            .with("sigma", sigma),
    )
}

/// What moved, as the profile and the URDF call it.
#[must_use]
pub fn name_of(inputs: &Inputs, fit: &MlFit, change: &Change) -> Option<String> {
    Names { inputs, fit }.of(change)
}

/// What the parts of the problem are called.
struct Names<'a> {
    inputs: &'a Inputs,
    fit: &'a MlFit,
}

impl Names<'_> {
    fn body(&self, frame: FrameId) -> Option<&String> {
        self.fit.formulation.body_of(self.inputs, frame)
    }

    fn joint(&self, edge: EdgeId) -> Option<&Joint> {
        let joints = &self.fit.formulation.joints;
        let place = joints.iter().position(|j| *j == Some(edge))?;
        self.inputs.robot.model.joints().get(place)
    }

    /// What a rival explanation is called; of several joints the one whose step is clearest.
    fn of(&self, change: &Change) -> Option<String> {
        match change.moved {
            Moved::Body(frame) => self.body(frame).cloned(),
            Moved::Joint(_) | Moved::Zeros => {
                let steps = self.steps(change);
                steps.first().map(|step| step.joint.name.clone())
            }
            Moved::Reference(_) | Moved::Drift(_) | Moved::Settling(_) => {
                Some(self.inputs.robot.profile.tracker.frame.clone())
            }
            _ => None,
        }
    }

    /// The steps of joints, the clearest first.
    fn steps(&self, change: &Change) -> Vec<Step<'_>> {
        let sizes = change.jump.iter().zip(&change.sigma);
        let joints = change.joints.iter().zip(sizes);
        let mut steps: Vec<Step<'_>> = joints
            .filter_map(|(edge, (size, sigma))| {
                Some(Step {
                    joint: self.joint(*edge)?,
                    size: *size,
                    sigma: *sigma,
                })
            })
            .collect();
        steps.sort_by(|a, b| b.clearness().total_cmp(&a.clearness()));
        steps
    }

    /// The joints whose steps are clear.
    fn clear_steps(&self, change: &Change) -> Vec<String> {
        let steps = self.steps(change).into_iter();
        let clear = steps.filter(Step::is_clear);
        clear.map(|step| step.joint.name.clone()).collect()
    }

    fn described(&self, change: &Change) -> Option<Finding> {
        let id = catalog::CHANGED_WHILE_RECORDING;
        let finding = match change.moved {
            Moved::Body(frame) => {
                let name = self.body(frame)?;
                Finding::of_kind(id, "body", Subject::body(name.clone()))
                    .with("body", Fact::name(name.clone()))
            }
            Moved::Reference(_) => Finding::of_kind(id, "tracker", About::Tracker),
            Moved::Drift(_) => Finding::of_kind(id, "drift", About::Tracker),
            Moved::Settling(_) => Finding::of_kind(id, "settling", About::Tracker),
            Moved::Scale(_) => Finding::of_kind(id, "scale", About::Tracker)
                .with("scale", Fact::ratio(change.jump[0]))
                .with("sigma_scale", Fact::ratio(change.sigma[0])),
            Moved::Joint(_) => {
                let steps = self.steps(change);
                let own = steps.first()?;
                let kind = match own.joint.kind.turns() {
                    true => "joint",
                    false => "axis",
                };
                own.told(Finding::of_kind(id, kind, own.subject()))
            }
            Moved::Zeros => {
                let steps = self.steps(change);
                let most = steps.first()?;
                let finding = Finding::of_kind(id, "zeros", most.subject())
                    .with("joint", Fact::name(&most.joint.name))
                    .with("joints", Fact::names(self.clear_steps(change)));
                most.told(finding)
            }
            _ => return None,
        };
        let finding = match change.moved {
            Moved::Joint(_) | Moved::Zeros => finding,
            _ if change.jump.len() == 6 => {
                let (angle, _) = size(&change.jump[..3], &change.sigma[..3]);
                let (distance, sigma) = size(&change.jump[3..], &change.sigma[3..]);
                // A lone marker shows no rotation.
                let turned = (angle > ROUNDING).then(|| Fact::radians(angle));
                finding
                    .with_some("angle", turned)
                    .with("distance", Fact::meters(distance))
                    .with("sigma", Fact::meters(sigma))
            }
            _ => finding,
        };
        Some(match change.moved {
            Moved::Drift(_) | Moved::Settling(_) | Moved::Scale(_) => finding,
            _ => self.placed(finding, change),
        })
    }

    /// The recording, and the rows on either side of the change.
    fn placed(&self, finding: Finding, change: &Change) -> Finding {
        let samples = &self.fit.formulation.samples;
        let at = change.first;
        let row = |s: usize| {
            let (recording, row) = &samples[s];
            (
                recording,
                self.inputs.recordings[recording].poses.rows[*row],
            )
        };
        let is_fitted =
            |name: &String| self.inputs.recordings[name].spec.usage != Usage::Validation;
        // A change that holds from the first sample on: the motion was at its end.
        let rest = (change.end..samples.len()).find(|s| is_fitted(&samples[*s].0));
        let turned = rest.filter(|_| at == 0);
        let at = turned.unwrap_or(at);
        let (recording, after) = row(at);
        // Recordings that lie before the change, of those that were fitted.
        let changed: BTreeSet<&String> = change.also.iter().map(|s| &samples[*s].0).collect();
        let all: BTreeSet<&String> = samples.iter().map(|(name, _)| name).collect();
        let others = all
            .into_iter()
            .filter(|name| is_fitted(name) && *name != recording);
        let earlier: Vec<String> = others
            .filter(|name| match turned {
                Some(_) => changed.contains(name) || *name == &samples[0].0,
                None => !changed.contains(name),
            })
            .cloned()
            .collect();
        // Between recordings: from the last row of what lies before, which need not be the recording before in the order of the names.
        let within = at > 0 && samples[at - 1].0 == *recording;
        let last = samples.iter().rposition(|(name, _)| earlier.contains(name));
        let before = row(last.filter(|_| !within).unwrap_or(at.max(1) - 1));
        finding
            .with("before", Fact::name(before.1.to_string()))
            .with_some("before_in", (!within).then(|| Fact::name(before.0.clone())))
            .with("row", Fact::name(after.to_string()))
            .with("recording", Fact::name(recording.clone()))
            .with_some(
                "earlier",
                (!earlier.is_empty()).then(|| Fact::names(earlier)),
            )
            .in_recording(recording.clone())
            .at_rows([after])
    }
}

/// How far the zero of a joint went, rad or m.
struct Step<'a> {
    joint: &'a Joint,
    size: f64,
    sigma: f64,
}

impl Step<'_> {
    fn clearness(&self) -> f64 {
        self.size.abs() / self.sigma.max(f64::MIN_POSITIVE)
    }

    fn is_clear(&self) -> bool {
        self.clearness() > CLEAR
    }

    fn subject(&self) -> Subject {
        Subject::joint(self.joint.name.clone())
    }

    fn told(&self, finding: Finding) -> Finding {
        let size = self.size.abs();
        match self.joint.kind.turns() {
            true => finding
                .with("angle", Fact::radians(size))
                .with("sigma_angle", Fact::radians(self.sigma)),
            false => finding
                .with("distance", Fact::meters(size))
                .with("sigma", Fact::meters(self.sigma)),
        }
    }
}

/// Length of a jump, and its σ along it.
fn size(jump: &[f64], sigma: &[f64]) -> (f64, f64) {
    let length = jump.iter().map(|x| x * x).sum::<f64>().sqrt();
    // σ² = Σ (j_i/|j|)² σ_i²
    let along = jump
        .iter()
        .zip(sigma)
        .map(|(j, s)| (j / length.max(f64::MIN_POSITIVE) * s).powi(2));
    (length, along.sum::<f64>().sqrt())
}
