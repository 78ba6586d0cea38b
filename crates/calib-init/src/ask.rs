//! Links of all bodies and mistakes in the recordings, as facts, and the mistakes corrected.

use std::collections::BTreeMap;

use calib_checks::structural::{Chain, Correction, Decision, Hypothesis, RecordingIndex, Scoped};
use calib_urdf::{LinkId, RobotModel, doubt};

use crate::bodies::Found;
use crate::correct;
use crate::error::InitError;
use crate::fact::{About, CERTAIN, Fact, Mistake, Place, Residuals, Rival};
use crate::links::{Assigned, Choice, Scene, is_of_links};
use crate::robot;
use crate::session::Draft;
use crate::source::Source;

/// Links for all bodies, with what the hypotheses say.
pub struct Asked {
    /// By body.
    pub choices: BTreeMap<usize, Choice>,
    /// The assignment that explains the recordings best.
    pub assigned: Assigned,
}

/// Asks for links and mistakes; a body on the stated link, if one is stated.
#[must_use]
pub fn ask(scene: &Scene<'_>, stated: Option<LinkId>) -> Asked {
    let none = Asked {
        choices: BTreeMap::new(),
        assigned: Assigned {
            on: Vec::new(),
            outcome: None,
        },
    };
    // A model that was read is a tree.
    let Ok(chain) = Chain::from_model(scene.model) else {
        return none;
    };
    let chosen = (0..scene.bodies.len()).filter_map(|b| Some((b, scene.choose(&chain, b)?)));
    let choices: Vec<(usize, Choice)> = chosen.collect();
    // The body that follows the stated link best is the one that was meant.
    let on_stated = stated.and_then(|link| {
        let group = robot::group(scene.model, link);
        let rms = |c: &Choice| {
            c.all
                .iter()
                .find(|(l, _)| *l == group)
                .map_or(f64::INFINITY, |(_, rms)| *rms / c.rms.max(1e-9))
        };
        let best = choices
            .iter()
            .min_by(|a, b| rms(&a.1).total_cmp(&rms(&b.1)))?;
        Some((best.0, link))
    });
    let stated: Vec<(usize, LinkId)> = on_stated.into_iter().collect();
    let assigned = scene.assign(&chain, &choices, &stated);
    Asked {
        choices: choices.into_iter().collect(),
        assigned,
    }
}

impl Asked {
    /// The link of each body, with its runner-up.
    #[must_use]
    pub fn facts(&self, scene: &Scene<'_>, stated: Option<LinkId>) -> Vec<Fact> {
        let model = scene.model;
        let named = |link: LinkId| model.link(link).name.clone();
        let moving = scene.moving();
        let mut facts = Vec::new();
        for (body, link) in &self.assigned.on {
            let Some(choice) = self.choices.get(body) else {
                continue;
            };
            let group = robot::group(model, *link);
            let rms = choice
                .all
                .iter()
                .find(|(l, _)| *l == group)
                .map_or(choice.rms, |(_, rms)| *rms);
            let rivals = || {
                choice
                    .all
                    .iter()
                    .filter(|(l, _)| *l != group && !choice.same.contains(&named(*l)))
            };
            let rival = |(l, rms): &(LinkId, f64)| Rival {
                link: named(*l),
                rms: *rms,
            };
            let carried = robot::movers(model, *link);
            let about = if stated == Some(*link) {
                About::LinkStated {
                    link: named(*link),
                    rms: Some(rms),
                    better: rivals().find(|(_, other)| CERTAIN * other < rms).map(rival),
                }
            } else if !carried.iter().any(|j| moving.contains(j)) {
                About::Still {
                    link: named(*link),
                    rms,
                }
            } else {
                // Links between which no joint with a column lies are the same for these recordings.
                let next = match group == robot::group(model, choice.link) {
                    true => choice.next.clone(),
                    false => rivals().next().map(rival),
                };
                About::Link {
                    link: named(*link),
                    rms,
                    next,
                    same: choice.same.clone(),
                }
            };
            facts.push(Fact::new(
                Place::Body(scene.bodies[*body].name.clone()),
                about,
            ));
        }
        facts
    }
}

/// A correction that was applied, or why none was.
#[derive(Debug, Default)]
pub struct Next {
    /// What was found.
    pub facts: Vec<Fact>,
    /// The files read with the correction; `None`: nothing is to be corrected, or nothing can be.
    pub sources: Option<Vec<Source>>,
}

/// What the hypotheses name, corrected where column maps can hold it.
///
/// # Errors
/// [`InitError::Recording`] where a file cannot be read by its new map.
pub fn next_correction(
    model: &RobotModel,
    sources: &[Source],
    drafts: &[Draft],
    found: &[Found],
    assigned: &Assigned,
) -> Result<Next, InitError> {
    let mut next = Next::default();
    let Some(outcome) = &assigned.outcome else {
        return Ok(next);
    };
    let named = match &outcome.decision {
        Decision::Named(named) => named,
        Decision::Undecided { .. } => {
            let limit = outcome.expected.map_or(0.0, |e| e.limit);
            let about = About::Disagrees {
                rms: outcome.rms,
                limit,
            };
            next.facts.push(Fact::new(Place::Recordings, about));
            return Ok(next);
        }
        Decision::Consistent { .. } => {
            let about = About::Agrees {
                rms: outcome.rms,
                rows: outcome.rows,
                corrected: false,
            };
            next.facts.push(Fact::new(Place::Recordings, about));
            return Ok(next);
        }
        Decision::TooFewData { .. } => {
            let about = About::TooFew { rows: outcome.rows };
            next.facts.push(Fact::new(Place::Recordings, about));
            return Ok(next);
        }
        _ => return Ok(next),
    };
    let bodies: Vec<String> = assigned
        .on
        .iter()
        .map(|(b, _)| found[*b].name.clone())
        .collect();
    let residuals = Residuals {
        none: named.evidence.none,
        best: named.evidence.best,
        next: named.evidence.next,
    };
    let all: Vec<&Correction> = std::iter::once(&named.correction)
        .chain(&named.equivalent)
        .collect();
    let in_words = |correction: &Correction| -> Vec<Mistake> {
        let source = drafts.first().map(|draft| &sources[draft.source]);
        let of = |s: &Scoped| correct::mistake(model, source, &bodies, &s.hypothesis);
        correction.iter().map(of).collect()
    };
    // Of corrections that the recordings do not distinguish, one that a column map can hold.
    let mut first = None;
    let is_of_tables = |c: &Correction| c.iter().any(|s| !is_of_links(&s.hypothesis));
    for (i, correction) in all.iter().enumerate() {
        if i > 0 && !is_of_tables(correction) {
            continue;
        }
        let others = all.iter().enumerate().filter(|(k, _)| *k != i);
        let others: Vec<Vec<Mistake>> = others.map(|(_, c)| in_words(c)).collect();
        let evidence = (residuals, others.as_slice());
        let all = apply_each(model, sources, drafts, &bodies, correction, evidence)?;
        if all.complete {
            first = Some(all);
            break;
        }
        first.get_or_insert(all);
    }
    if let Some(applied) = first {
        next.facts.extend(applied.facts);
        next.sources = applied.sources;
    }
    Ok(next)
}

/// Corrections applied one after the other.
struct Applied {
    facts: Vec<Fact>,
    /// Where any was applied.
    sources: Option<Vec<Source>>,
    /// All of them were.
    complete: bool,
}

fn apply_each(
    model: &RobotModel,
    sources: &[Source],
    drafts: &[Draft],
    bodies: &[String],
    correction: &Correction,
    evidence: (Residuals, &[Vec<Mistake>]),
) -> Result<Applied, InitError> {
    let mut applied = Applied {
        facts: Vec::new(),
        sources: None,
        complete: true,
    };
    // Links are chosen again when the tables are right.
    let of_tables = correction.iter().filter(|s| !is_of_links(&s.hypothesis));
    for scoped in of_tables {
        let now = applied.sources.as_deref().unwrap_or(sources);
        let (fact, done) = apply_one(model, now, drafts, bodies, scoped, evidence)?;
        applied.facts.push(fact);
        applied.complete &= done.is_some();
        applied.sources = done.or(applied.sources);
    }
    Ok(applied)
}

/// A correction, in the column maps where these can hold it, and its fact. `evidence`: residuals, and the corrections that are equivalent.
///
/// # Errors
/// As [`next_correction`].
pub fn apply_one(
    model: &RobotModel,
    sources: &[Source],
    drafts: &[Draft],
    bodies: &[String],
    scoped: &Scoped,
    (residuals, equivalent): (Residuals, &[Vec<Mistake>]),
) -> Result<(Fact, Option<Vec<Source>>), InitError> {
    if correct::is_of_robot(model, &scoped.hypothesis) {
        return Err(InitError::RobotTooLarge {
            reach: doubt::reach(model),
            ratio: scoped.hypothesis.log_scale().exp(),
            rms: (residuals.none, residuals.best),
        });
    }
    let recordings = drafts.iter().enumerate();
    let mut inside = recordings.filter(|(r, _)| scoped.scope.contains(RecordingIndex(*r)));
    let source = inside.next().map(|(_, draft)| &sources[draft.source]);
    let mistake = correct::mistake(model, source, bodies, &scoped.hypothesis);
    let done = correct::corrected(model, sources, drafts, scoped)?;
    let about = match &done {
        Some(_) => About::Corrected {
            mistake,
            residuals,
            equivalent: equivalent.to_vec(),
        },
        None => About::NotCorrected { mistake, residuals },
    };
    Ok((Fact::new(place_of(drafts, scoped), about), done))
}

/// A mistake of one recording stands there.
fn place_of(drafts: &[Draft], scoped: &Scoped) -> Place {
    let inside: Vec<&Draft> = drafts
        .iter()
        .enumerate()
        .filter(|(r, _)| scoped.scope.contains(RecordingIndex(*r)))
        .map(|(_, draft)| draft)
        .collect();
    match (inside.as_slice(), scoped.hypothesis) {
        ([one], _) => Place::Recording(one.name.clone()),
        (_, Hypothesis::TrackerUnit { .. } | Hypothesis::Mirrored) => Place::Tracker,
        _ => Place::Recordings,
    }
}
