//! What made the residuals: missing effects, a change while recording, or what was suspected before the fit. Each is stated only
//! where it explains something beside the others.

use calib_core::{ChanceOfChanges, Change, ChangeScan, Contest, GoodnessOfFit, ScoreTest, Suspect};
use calib_finding::{Fact, Finding, catalog};

use super::elimination::{Asked, Held, eliminated};
use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::Inputs;
use crate::verify::changes::{self, Beside};
use crate::verify::scatter::beside_scatter;
use crate::verify::suspects::{RELEVANT, SIGNIFICANT, suspected_before};

/// A cause that was found at a lower level of noise than that of the fit shows less here: it must keep this part of it beside others.
const KEPT: f64 = 0.9;

/// Part of the T of a cause from which another effect is as good: where something is missing, the noise is not what likelihoods take it for.
const ALIKE: f64 = 0.75;
/// The same of what was suspected before the fit, which may have rejected the rows that show it.
const ALIKE_BEFORE: f64 = 0.5;

/// The causes that hold.
#[derive(Debug, Clone, Default)]
pub struct Causes {
    /// The tests, with the effects that are missing beside all other causes.
    pub goodness: Option<GoodnessOfFit>,
    /// What is as likely as a missing effect, by its name.
    pub alike: Vec<(String, Vec<String>)>,
    /// What changed while recording.
    pub change: Option<Finding>,
    /// The same, as the scan found it.
    pub changed: Option<Change>,
    /// The joint whose scatter looked like a change or a missing effect; none where something did change.
    pub scatter: Option<Finding>,
    /// All that the scan for changes found.
    pub scan: Option<ChangeScan>,
    /// Findings from before the fit that other causes explain.
    pub explained: Vec<Finding>,
}

impl Causes {
    /// The change that the finding tells, as it was found.
    fn with_change_of(mut self, scan: Option<&ChangeScan>) -> Self {
        let told = self.change.as_ref().and(scan);
        self.changed = told.and_then(ChangeScan::significant).cloned();
        self.scan = scan.cloned();
        self
    }

    /// Whether the model lacks something, of which a part is in the noise as it was found.
    pub(crate) fn lacks_effects(&self) -> bool {
        let missing = self.goodness.as_ref().map(|g| &g.missing);
        missing.is_some_and(|missing| !missing.is_empty()) || self.change.is_some()
    }

    /// Leaves neither changes nor missing effects: joints that are held explain them.
    pub(crate) fn explained_by_held_joints(&mut self) {
        (self.change, self.changed, self.scatter) = (None, None, None);
        self.leave_effects();
    }

    /// Leaves no missing effects.
    pub(crate) fn leave_effects(&mut self) {
        if let Some(goodness) = &mut self.goodness {
            goodness.missing.clear();
        }
    }

    /// Leaves out a change that explains a smaller share of the cost than something else does.
    pub(crate) fn leave_change_that_explains_less(&mut self, share: f64) {
        let less = self.changed.as_ref().is_some_and(|c| c.explains < share);
        if less {
            (self.change, self.changed) = (None, None);
        }
    }

    /// Takes out what other causes explain.
    pub fn leave_unexplained(&self, findings: &mut Vec<Finding>) {
        findings.retain(|finding| !self.explained.contains(finding));
    }
}

/// What may have made the residuals, in the order of the contest.
#[derive(Debug, Clone)]
enum Cause<'a> {
    Missing(&'a ScoreTest),
    Change,
    Before(&'a Finding, String),
}

impl Cause<'_> {
    /// What it is called where it is as good as another; a change is told by what moved.
    fn code(&self) -> Option<String> {
        match self {
            Self::Missing(test) => Some(test.name.clone()),
            Self::Change => None,
            Self::Before(_, code) => Some(code.clone()),
        }
    }
}

/// The causes that the data show; `before`: findings from before the fit; `known`: as for [`changes::scan`].
#[must_use]
pub fn causes(
    inputs: &Inputs,
    fit: &MlFit,
    before: &[Finding],
    known: Option<&ChanceOfChanges>,
) -> Causes {
    let (scan, goodness) = rayon::join(
        || changes::scan(fit, known),
        || fit.solution.goodness_of_fit(),
    );
    let beside = beside_scatter(inputs, fit, before, goodness);
    let open: Vec<Finding> = before
        .iter()
        .filter(|finding| !beside.explained.contains(finding))
        .cloned()
        .collect();
    let of_scan = scan.as_ref().and_then(|s| s.scatter);
    let of_scan = of_scan.and_then(|scatter| changes::scatter(inputs, fit, scatter));
    let steady = scan.as_ref().is_none_or(|s| s.significant().is_none());
    let mut causes = those_that_hold(inputs, fit, &open, scan, beside.goodness);
    causes.scatter = beside.finding.or(of_scan).filter(|_| steady);
    causes.explained.extend(beside.explained);
    // Lengths that disagree with a wrong template say nothing of the tracker's scale.
    let off_template = before
        .iter()
        .any(|f| f.id == catalog::NOT_RIGID && is_kind(f, "template"));
    causes.change = causes
        .change
        .filter(|f| !(off_template && is_kind(f, "scale")));
    if let Some(change) = &causes.changed {
        let rows = changes::rows_of(inputs, fit, change, before);
        causes.explained.extend(rows);
        let memory = changes::memory_of(change, before);
        causes.explained.extend(memory.cloned());
    }
    causes
}

/// Whether the kind of a finding begins so.
fn is_kind(finding: &Finding, begins: &str) -> bool {
    let kind = finding.facts.get("kind").and_then(Fact::word);
    kind.is_some_and(|kind| kind.starts_with(begins))
}

fn those_that_hold(
    inputs: &Inputs,
    fit: &MlFit,
    before: &[Finding],
    scan: Option<ChangeScan>,
    goodness: Option<GoodnessOfFit>,
) -> Causes {
    let everything = || {
        Causes {
            change: scan.as_ref().and_then(|scan| {
                changes::finding(inputs, fit, scan, Beside::of_tests(goodness.as_ref()))
            }),
            goodness: goodness.clone(),
            ..Causes::default()
        }
        .with_change_of(scan.as_ref())
    };
    let suspected = suspected(inputs, fit, before, scan.as_ref(), goodness.as_ref());
    let Some(Suspected {
        list,
        contest,
        tested,
    }) = suspected
    else {
        return everything();
    };
    let tests = goodness.as_ref().map_or(1, |g| g.tests.len().max(1));
    let asked: Vec<Asked> = list
        .iter()
        .enumerate()
        .map(|(k, cause)| asked(&contest, (k, cause), scan.as_ref(), tests))
        .collect();
    let held = eliminated(&contest, &asked);
    if held.causes.is_empty() {
        return everything();
    }
    Outcome {
        inputs,
        fit,
        list: &list,
        tested: &tested,
        contest: &contest,
        held: &held,
    }
    .causes(scan.as_ref(), goodness.clone())
}

/// What one cause must show.
fn asked(
    contest: &Contest,
    (number, cause): (usize, &Cause<'_>),
    scan: Option<&ChangeScan>,
    tests: usize,
) -> Asked {
    let (alone, directions) = contest.score(number, &[]);
    match cause {
        Cause::Change => {
            let change = scan.and_then(ChangeScan::significant).zip(scan);
            // T of the scan, whose level of noise may be another.
            let part = change.map_or(1.0, |(change, scan)| {
                (change.score - change.excess + scan.threshold) / change.score
            });
            Asked {
                least: part * alone,
                share: 0.0,
                part: 1.0,
                linearized: change.map_or(0.0, |(change, _)| turned(change).powi(2)),
            }
        }
        Cause::Missing(test) => Asked {
            least: contest
                .threshold(SIGNIFICANT / tests as f64, directions)
                .min(KEPT * alone),
            // What counts for what the parameters took up of it leaves less than others.
            share: match test.explains > RELEVANT {
                true => RELEVANT,
                false => 0.5 * test.explains,
            },
            part: ALIKE,
            linearized: 0.0,
        },
        Cause::Before(..) => Asked {
            least: contest.threshold(SIGNIFICANT / tests as f64, directions),
            share: RELEVANT,
            part: ALIKE_BEFORE,
            linearized: 0.0,
        },
    }
}

/// By how much a step of a joint turns what lies behind it, rad: a row that it moves by d is linearized to within d times this.
fn turned(change: &Change) -> f64 {
    let steps = change.jump.iter().take(change.joints.len());
    steps.map(|step| step.abs()).fold(0.0, f64::max)
}

/// What is set beside each other.
struct Suspected<'a> {
    /// The causes that are asked.
    list: Vec<Cause<'a>>,
    /// Findings from before the fit that its tests name as well, by the name of the test: no causes of their own.
    tested: Vec<(&'a Finding, String)>,
    contest: Contest,
}

/// The causes that are asked, and the contest of them; `None` where there is nothing to choose.
fn suspected<'a>(
    inputs: &Inputs,
    fit: &MlFit,
    before: &'a [Finding],
    scan: Option<&ChangeScan>,
    goodness: Option<&'a GoodnessOfFit>,
) -> Option<Suspected<'a>> {
    let change = scan.and_then(ChangeScan::significant);
    let missing = goodness.map_or(&[][..], |g| &g.missing);
    let mut list: Vec<Cause<'_>> = missing.iter().map(Cause::Missing).collect();
    let mut suspects: Vec<Suspect<'_>> = missing.iter().map(|t| Suspect::Tested(&t.name)).collect();
    if let Some(change) = change {
        list.push(Cause::Change);
        suspects.push(Suspect::Change(change));
    }
    let mut tested = Vec::new();
    for finding in before {
        let Some((code, suspect)) = suspected_before(inputs, fit, finding, goodness?) else {
            continue;
        };
        // Named by the tests of the fit as well: one cause.
        if missing.iter().any(|t| t.name == code) {
            tested.push((finding, code));
            continue;
        }
        list.push(Cause::Before(finding, code));
        suspects.push(suspect);
    }
    if list.len() < 2 {
        return None;
    }
    let contest = fit
        .solution
        .contest(&suspects, scan, &fit.formulation.borders())?;
    Some(Suspected {
        list,
        tested,
        contest,
    })
}

/// What holds, as findings.
struct Outcome<'a> {
    inputs: &'a Inputs,
    fit: &'a MlFit,
    list: &'a [Cause<'a>],
    tested: &'a [(&'a Finding, String)],
    contest: &'a Contest,
    held: &'a Held,
}

impl Outcome<'_> {
    fn causes(&self, scan: Option<&ChangeScan>, goodness: Option<GoodnessOfFit>) -> Causes {
        let is_held = |wanted: &dyn Fn(&Cause<'_>) -> bool| {
            let mut held = self.held.causes.iter();
            held.any(|k| wanted(&self.list[*k]))
        };
        let changed =
            is_held(&|cause| matches!(cause, Cause::Change)) || self.beside_change().is_some();
        let is_missing =
            |test: &ScoreTest| is_held(&|c| matches!(c, Cause::Missing(t) if t.name == test.name));
        let explained = self
            .list
            .iter()
            .enumerate()
            .filter_map(|(k, cause)| match cause {
                Cause::Before(finding, _) if !self.held.causes.contains(&k) => {
                    Some((*finding).clone())
                }
                _ => None,
            });
        // Named by a test that another cause explains, and better: the finding is about that cause.
        let tested = self
            .tested
            .iter()
            .filter(|(_, code)| !self.is_as_good(code));
        let tested = tested.map(|(finding, _)| (*finding).clone());
        let explained = explained.chain(tested).collect();
        let alike = self
            .held
            .causes
            .iter()
            .zip(&self.held.alike)
            .filter_map(|(k, alike)| {
                let code = self.list[*k].code()?;
                let alike: Vec<String> =
                    alike.iter().filter_map(|a| self.list[*a].code()).collect();
                (!alike.is_empty()).then_some((code, alike))
            });
        Causes {
            alike: alike.collect(),
            change: scan
                .filter(|_| changed)
                .and_then(|scan| changes::finding(self.inputs, self.fit, scan, self.beside())),
            goodness: goodness.map(|mut goodness| {
                goodness.missing.retain(is_missing);
                goodness
            }),
            explained,
            ..Causes::default()
        }
        .with_change_of(scan)
    }

    /// Whether a test holds, or explains the data as well in the place of what does.
    fn is_as_good(&self, code: &str) -> bool {
        let own = |k: &usize| matches!(self.list[*k], Cause::Missing(test) if test.name == code);
        let held = &self.held;
        held.causes
            .iter()
            .chain(held.alike.iter().flatten())
            .any(own)
    }

    /// The effect that holds, and that a change explains as well as.
    fn beside_change(&self) -> Option<usize> {
        let is_change = |k: &usize| matches!(self.list[*k], Cause::Change);
        let mut held = self.held.causes.iter().zip(&self.held.alike);
        held.find(|(_, alike)| alike.iter().any(is_change))
            .map(|(k, _)| *k)
    }

    /// What the change is to be told beside.
    fn beside(&self) -> Beside {
        let place = |k: &usize| matches!(self.list[*k], Cause::Change);
        let Some(change) = self.held.causes.iter().position(place) else {
            return Beside {
                physics: self.beside_change().and_then(|k| self.list[k].code()),
                alike: Vec::new(),
            };
        };
        let own = self.held.causes[change];
        let beside = |k: usize| -> Vec<usize> {
            let all = self.held.causes.iter().copied();
            all.filter(|c| *c != k).collect()
        };
        let score = |k: usize| self.contest.score(k, &beside(k)).0;
        let stronger = self.held.causes.iter().copied().filter(|k| *k != own);
        let stronger = stronger.filter(|k| score(*k) > score(own));
        let stronger = stronger.max_by(|a, b| score(*a).total_cmp(&score(*b)));
        let alike = self.held.alike[change].iter();
        Beside {
            physics: stronger.and_then(|k| self.list[k].code()),
            alike: alike.filter_map(|k| self.list[*k].code()).collect(),
        }
    }
}
