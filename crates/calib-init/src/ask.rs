//! Links of all bodies and mistakes in the recordings, as facts, and the mistakes corrected.

use std::collections::{BTreeMap, BTreeSet};

use calib_checks::structural::{
    Chain, Correction, Decision, Hypothesis, Outcome, RecordingIndex, Scoped,
};
use calib_urdf::{LinkId, RobotModel, doubt};

use crate::correct;
use crate::error::InitError;
use crate::fact::{About, CERTAIN, Fact, Place, Residuals, Reversed, Rival};
use crate::links::{Assigned, Choice, Scene, is_of_links};
use crate::mirror::{is_or_mirrored, within_limits};
use crate::mistake::Mistake;
use crate::robot;
use crate::session::Draft;
use crate::signs::{self, Signs};
use crate::source::Source;

/// Below this, what errors of a nominal robot explain is the noise of a tracker, m.
const OF_NOISE: f64 = 2e-3;

/// Links for all bodies, with what the hypotheses say.
pub struct Asked {
    /// By body.
    pub choices: BTreeMap<usize, Choice>,
    /// The assignment that explains the recordings best.
    pub assigned: Assigned,
    /// Bodies whose links a person named.
    pub stated: Vec<usize>,
}

/// Asks for links and mistakes; a body on the stated link, if one is stated, and bodies of a profile that is edited (`fixed`) on theirs.
#[must_use]
pub fn ask(scene: &Scene<'_>, stated: Option<LinkId>, fixed: &[(usize, LinkId)]) -> Asked {
    let none = Asked {
        choices: BTreeMap::new(),
        assigned: Assigned {
            on: Vec::new(),
            outcome: None,
        },
        stated: Vec::new(),
    };
    // A model that was read is a tree.
    let Ok(chain) = Chain::from_model(scene.model) else {
        return none;
    };
    let chosen = (0..scene.bodies.len()).filter_map(|b| Some((b, scene.choose(&chain, b)?)));
    let choices: Vec<(usize, Choice)> = chosen.collect();
    let is_fixed = |body: usize| fixed.iter().any(|(b, _)| *b == body);
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
            .filter(|(body, _)| !is_fixed(*body))
            .min_by(|a, b| rms(&a.1).total_cmp(&rms(&b.1)))?;
        Some((best.0, link))
    });
    let stated: Vec<(usize, LinkId)> = fixed.iter().copied().chain(on_stated).collect();
    let assigned = scene.assign(&chain, &choices, &stated);
    Asked {
        choices: choices.into_iter().collect(),
        assigned,
        stated: stated.iter().map(|(body, _)| *body).collect(),
    }
}

impl Asked {
    /// The link of each body, with its runner-up.
    #[must_use]
    pub fn facts(
        &self,
        scene: &Scene<'_>,
        stated: Option<LinkId>,
        fixed: &[(usize, LinkId)],
    ) -> Vec<Fact> {
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
            let better = || rivals().find(|(_, other)| CERTAIN * other < rms).map(rival);
            let about = if fixed.iter().any(|(b, _)| b == body) {
                About::LinkOfProfile {
                    link: named(*link),
                    rms: Some(rms),
                    better: better(),
                }
            } else if stated == Some(*link) {
                About::LinkStated {
                    link: named(*link),
                    rms: Some(rms),
                    better: better(),
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
    scene: &Scene<'_>,
    sources: &[Source],
    drafts: &[Draft],
    assigned: &Assigned,
) -> Result<Next, InitError> {
    let (model, found) = (scene.model, scene.bodies);
    let mut next = Next::default();
    let Some(outcome) = &assigned.outcome else {
        return Ok(next);
    };
    let limit = outcome.expected.map(|e| e.limit);
    let bodies: Vec<String> = assigned
        .on
        .iter()
        .map(|(b, _)| found[*b].name.clone())
        .collect();
    let context = Context {
        model,
        sources,
        drafts,
        bodies: &bodies,
    };
    let signs = of_signs(scene, assigned);
    if let Some((signs, left)) = &signs
        && signs.is_better_than(*left)
    {
        if is_or_mirrored(scene, &signs.best.correction, signs.best.rms, limit) {
            let mirrored = vec![vec![Mistake::Mirrored]];
            let fact =
                context.sign_or_mirror(&signs.best.correction, signs.residuals(limit), mirrored);
            next.facts.push(fact);
            return Ok(next);
        }
        if let Some(by_signs) = context.by_signs(signs, limit)? {
            return Ok(by_signs);
        }
    }
    let Decision::Named(named) = &outcome.decision else {
        let about = unnamed(outcome, limit, || scene.rms_of_all(&assigned.on));
        next.facts
            .extend(about.map(|about| Fact::new(Place::Recordings, about)));
        return Ok(next);
    };
    let residuals = Residuals {
        none: named.evidence.none,
        best: named.evidence.best,
        next: named.evidence.next,
        over: limit.filter(|limit| named.evidence.best > *limit),
    };
    let all: Vec<&Correction> = std::iter::once(&named.correction)
        .chain(&named.equivalent)
        .collect();
    // Patterns of signs that leave about as much as a correction that leaves too much.
    let as_good: Vec<Correction> = signs.map_or_else(Vec::new, |(signs, left)| signs.like(left));
    let as_good = as_good.iter().filter(|c| !all.contains(c));
    let as_good: Vec<Vec<Mistake>> = as_good.map(|c| context.in_words(c)).collect();
    // Of corrections that the recordings do not distinguish, one that a column map can hold.
    let mut first = None;
    let is_of_tables = |c: &Correction| c.iter().any(|s| !is_of_links(&s.hypothesis));
    // Readings that would be beyond the URDF's limits, where another explanation keeps them within: that one is the right one.
    let within = within_limits(scene, &all);
    let some_are = within.iter().any(|w| *w);
    let is_mirrored = |c: &Correction| c.iter().any(|s| s.hypothesis == Hypothesis::Mirrored);
    let mut possible = all.iter().zip(&within).filter(|(_, w)| **w || !some_are);
    let is_named_mirrored = possible.any(|(c, _)| is_mirrored(c));
    for (i, correction) in all.iter().enumerate() {
        let another = i > 0 && (!is_of_tables(correction) || correction.len() > 1);
        if another || (some_are && !within[i]) {
            continue;
        }
        let others = all.iter().enumerate().filter(|(k, _)| *k != i);
        let others = others.map(|(_, c)| context.in_words(c));
        let others: Vec<Vec<Mistake>> = others.chain(as_good.iter().cloned()).collect();
        // Which of the two it is decides where the real robot moves: that is not ours to choose.
        if signs::is_of_signs(correction)
            && (is_named_mirrored || is_or_mirrored(scene, correction, residuals.best, limit))
        {
            let mut others = others;
            if !is_named_mirrored {
                others.insert(0, vec![Mistake::Mirrored]);
            }
            let fact = context.sign_or_mirror(correction, residuals, others);
            next.facts.push(fact);
            return Ok(next);
        }
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

/// What is said where no mistake is named; `of_all`: the residual with the outliers.
fn unnamed(
    outcome: &Outcome,
    limit: Option<f64>,
    of_all: impl Fn() -> Option<f64>,
) -> Option<About> {
    let (rms, rows) = (outcome.rms, outcome.rows);
    let screened: BTreeSet<usize> = outcome.screened.iter().map(|s| s.row).collect();
    let matters = !screened.is_empty() && of_all() > limit;
    let agrees = About::Agrees {
        rms,
        rows,
        not: if matters { screened.len() } else { 0 },
        corrected: false,
    };
    if let Some(jump) = &outcome.jump {
        let residuals = Residuals {
            none: of_all().unwrap_or(rms),
            best: jump.rms,
            next: None,
            over: None,
        };
        return Some(About::NotCorrected {
            mistake: Mistake::Other,
            residuals,
            equivalent: Vec::new(),
        });
    }
    match &outcome.decision {
        // Where the robot's errors explain nothing, the limit is the noise that was assumed, and the tracker's may be larger.
        Decision::Undecided { leading: None, .. }
            if limit.is_some_and(|limit| limit < OF_NOISE && rms < CERTAIN * limit) =>
        {
            Some(agrees)
        }
        Decision::Undecided { .. } => Some(About::Disagrees {
            rms,
            limit: limit.unwrap_or(0.0),
        }),
        Decision::Consistent { .. } => Some(agrees),
        Decision::TooFewData { .. } => Some(About::TooFew { rows }),
        _ => None,
    }
}

/// What is corrected.
struct Context<'a> {
    model: &'a RobotModel,
    sources: &'a [Source],
    drafts: &'a [Draft],
    bodies: &'a [String],
}

impl Context<'_> {
    fn in_words(&self, correction: &Correction) -> Vec<Mistake> {
        let source = self.drafts.first().map(|d| &self.sources[d.source]);
        let of = |s: &Scoped| correct::mistake(self.model, source, self.bodies, &s.hypothesis);
        correction.iter().map(of).collect()
    }

    /// The joints that a correction reverses, each with its column.
    fn reversed(&self, correction: &Correction) -> Vec<Reversed> {
        let Some(draft) = self.drafts.first() else {
            return Vec::new();
        };
        let source = &self.sources[draft.log.unwrap_or(draft.source)];
        let of = |scoped: &Scoped| match scoped.hypothesis {
            Hypothesis::Sign { joint } => {
                let turns = self.model.joints()[joint.0].kind.turns();
                let joint = self.model.joints()[joint.0].name.clone();
                let column = correct::column(source, &joint);
                let column = column.unwrap_or_else(|| joint.clone());
                Some(Reversed {
                    joint,
                    column,
                    turns,
                })
            }
            _ => None,
        };
        correction.iter().filter_map(of).collect()
    }

    /// Reversed joints that are not corrected, because something else explains the recordings as well.
    fn sign_or_mirror(
        &self,
        correction: &Correction,
        residuals: Residuals,
        equivalent: Vec<Vec<Mistake>>,
    ) -> Fact {
        let about = About::SignOrMirror {
            joints: self.reversed(correction),
            mistakes: self.in_words(correction),
            residuals,
            equivalent,
        };
        Fact::new(Place::Recordings, about)
    }

    /// The best pattern of signs as the correction; `None` where no column map can hold it.
    fn by_signs(&self, signs: &Signs, limit: Option<f64>) -> Result<Option<Next>, InitError> {
        let residuals = signs.residuals(limit);
        let others = signs.others.iter().map(|p| self.in_words(&p.correction));
        let others: Vec<Vec<Mistake>> = others.collect();
        let applied = apply_each(
            self.model,
            self.sources,
            self.drafts,
            self.bodies,
            &signs.best.correction,
            (residuals, others.as_slice()),
        )?;
        Ok(applied.complete.then_some(Next {
            facts: applied.facts,
            sources: applied.sources,
        }))
    }
}

/// Patterns of signs, and what the explanation of the hypotheses leaves, where that is more than errors of a nominal robot explain and signs may be
/// behind it.
fn of_signs(scene: &Scene<'_>, assigned: &Assigned) -> Option<(Signs, f64)> {
    let outcome = assigned.outcome.as_ref()?;
    let (left, of_signs) = match &outcome.decision {
        Decision::Undecided { leading: None, .. } => (outcome.rms, true),
        Decision::Undecided {
            leading: Some(named),
            ..
        }
        | Decision::Named(named) => {
            // Where no mistake explains the data, a zero or a gain takes up part of any.
            let of_sizes = named.correction.iter().all(|s| s.hypothesis.is_sized());
            let of_signs = of_sizes || signs::is_of_signs(&named.correction);
            (named.evidence.best, of_signs)
        }
        _ => return None,
    };
    let too_much = outcome.expected.is_some_and(|e| left > e.limit);
    if !(of_signs && too_much) {
        return None;
    }
    Some((signs::search(scene, assigned)?, left))
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
    let done = correct::corrected(model, sources, drafts, bodies, scoped)?;
    let about = match &done {
        Some(_) => About::Corrected {
            mistake,
            residuals,
            equivalent: equivalent.to_vec(),
        },
        None => About::NotCorrected {
            mistake,
            residuals,
            equivalent: equivalent.to_vec(),
        },
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
