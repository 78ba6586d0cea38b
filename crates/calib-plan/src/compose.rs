//! From candidates to a list: what is chosen by information, what fills the space, what is repeated, and in which order.

use calib_report::view3d::View3d;
use nalgebra::DMatrix;

use crate::candidates::Candidate;
use crate::design::Question;
use crate::error::PlanError;
use crate::list::{Asked, Plan, Posture, Why};
use crate::note::Note;
use crate::order::{Ways, detour};
use crate::prepare::Prepared;

/// Postures per posture that fills the space.
const FILLING: usize = 4;
/// Postures per pair from both sides.
const PAIR_EVERY: usize = 18;
/// Postures in the order of information, before the order of the way: a list that is stopped early is then still good.
pub(crate) const BY_INFORMATION: usize = 24;
/// Joints go back so far to come from the other side, rad and m: more than any backlash.
const BACK: (f64, f64) = (0.14, 0.02);
/// Detours are looked for among so many candidates.
const DETOURS: usize = 300;

/// A posture of a list: why it is there, and the place of the one that it repeats.
pub(crate) type Listed = (Candidate, Why, Option<usize>);

/// Why a candidate was chosen that is no other visit.
fn why(filling: &[usize], candidate: usize) -> Why {
    if filling.contains(&candidate) {
        Why::SpaceFilling
    } else {
        Why::Information
    }
}

/// A plan of so many postures.
///
/// # Errors
/// [`PlanError::TooFew`], and those of the linearization.
pub fn compose(prepared: &Prepared<'_>, poses: usize) -> Result<Plan, PlanError> {
    let held_out = poses.div_ceil(FILLING);
    if prepared.candidates.len() < poses {
        return Err(PlanError::TooFew {
            file: prepared.known.robot.file.clone(),
            asked: poses,
            counts: Box::new(prepared.counts.clone()),
        });
    }
    let pairs = pairs_of(poses);
    let Choice {
        filling,
        chosen: by_information,
        information: _,
    } = choice(prepared, poses, Effort::Full);
    let efficiency = certificate(prepared, &filling, &by_information);
    let mut notes = prepared.notes.clone();
    let chosen: Vec<usize> = by_information.iter().chain(&filling).copied().collect();
    let of = |i: &usize| prepared.candidates[*i].clone();
    let postures: Vec<Candidate> = chosen.iter().map(of).collect();
    let rows: Vec<_> = chosen.iter().map(|i| prepared.rows[*i].clone()).collect();
    let first = prepared.options.path_time.map_or(BY_INFORMATION, |_| 0);
    let order = in_order(
        prepared,
        (&postures, &rows),
        &prepared.before,
        (first, None),
    );
    let mut list: Vec<Listed> = order
        .into_iter()
        .map(|k| {
            let i = chosen[k];
            (postures[k].clone(), why(&filling, i), None)
        })
        .collect();
    // First the ways around, so that it is known from where each posture is approached.
    with_detours(prepared, &mut list);
    let found = both_sides(prepared, &mut list, pairs);
    if found < pairs {
        notes.push(Note::FewerPairs {
            planned: pairs,
            found,
        });
    }
    let blocked = with_detours(prepared, &mut list);
    if !blocked.is_empty() {
        let to = blocked.clone();
        notes.push(Note::NoClearMotion { to });
    }
    let as_recorded: Vec<Candidate> = list
        .iter()
        .map(|(candidate, why, _)| {
            let mut candidate = candidate.clone();
            if *why == Why::Detour {
                candidate.seen.fill(None);
            }
            candidate
        })
        .collect();
    let (sigma_before, after, parameters) = prepared.predicted(&as_recorded)?;
    let times = list.windows(2);
    let motion_time = times
        .map(|w| prepared.joints.time(&w[0].0.q, &w[1].0.q))
        .sum();
    let postures = list.into_iter().zip(&after);
    let postures = postures.map(|((candidate, why, repeats), sigma)| Posture {
        seen: candidate.seen.iter().flatten().count(),
        q: candidate.q,
        why,
        repeats,
        sigma: *sigma,
    });
    Ok(Plan {
        robot: prepared.known.robot.profile.robot.clone(),
        goal: prepared.options.goal,
        joints: prepared.joints.clone(),
        asked: Asked {
            sigma: prepared.options.sigma,
            path_time: prepared.options.path_time,
            of: prepared.options.of.clone(),
            seed: prepared.options.seed,
            task: prepared.options.task.clone().unwrap_or_default(),
        },
        postures: postures.collect(),
        held_out: prepared.held_out(held_out),
        counts: prepared.counts.clone(),
        efficiency,
        sigma_before,
        sigma: after.last().copied().flatten(),
        parameters,
        motion_time,
        blocked,
        notes,
        view: View3d::default(),
    })
}

/// What is chosen of the candidates.
pub(crate) struct Choice {
    /// Those that fill the space.
    pub filling: Vec<usize>,
    /// Those chosen by information beside them.
    pub chosen: Vec<usize>,
    /// M with all of them.
    pub information: DMatrix<f64>,
}

fn pairs_of(poses: usize) -> usize {
    (poses / PAIR_EVERY).max(usize::from(poses >= 12))
}

/// How well postures are chosen: for a list that is recorded, or to know how many it takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Effort {
    /// From both starts.
    Full,
    /// From the greedy choice.
    Quick,
}

/// The choice for a plan of so many postures, those from both sides left out.
pub(crate) fn choice(prepared: &Prepared<'_>, poses: usize, effort: Effort) -> Choice {
    // The sequence begins with postures that fill the space, however many of it are possible.
    let filling: Vec<usize> = (0..poses.div_ceil(FILLING)).collect();
    let with_filling = beside(prepared, &filling);
    let question = Question {
        rows: &prepared.rows,
        before: &with_filling,
        criterion: &prepared.criterion,
    };
    let count = poses - filling.len() - 2 * pairs_of(poses);
    let chosen = match effort {
        Effort::Full => question.choose(count, &filling),
        Effort::Quick => question.quick(count, &filling),
    };
    let information = question.information(&chosen);
    Choice {
        filling,
        chosen,
        information,
    }
}

/// M₀ with the postures that fill the space.
fn beside(prepared: &Prepared<'_>, filling: &[usize]) -> DMatrix<f64> {
    let mut m = prepared.before.clone();
    for &i in filling {
        let y = &prepared.rows[i];
        m.gemm_tr(1.0, y, y, 1.0);
    }
    m
}

fn certificate(prepared: &Prepared<'_>, filling: &[usize], chosen: &[usize]) -> f64 {
    let question = Question {
        rows: &prepared.rows,
        before: &beside(prepared, filling),
        criterion: &prepared.criterion,
    };
    question.certificate(chosen).unwrap_or(0.0)
}

/// Places of some postures in their order: the first `count` by information beside what is known `before`, the rest by a short way from there,
/// or from where the robot is.
pub(crate) fn in_order(
    prepared: &Prepared<'_>,
    (chosen, rows): (&[Candidate], &[DMatrix<f64>]),
    before: &DMatrix<f64>,
    (count, at): (usize, Option<&[f64]>),
) -> Vec<usize> {
    let question = Question {
        rows,
        before,
        criterion: &prepared.criterion,
    };
    let first = question.greedy(count.min(chosen.len()));
    let rest: Vec<usize> = (0..chosen.len()).filter(|i| !first.contains(i)).collect();
    // Of the motions between postures, only those of the rest are compared.
    let from = match first.last() {
        Some(last) => Some(chosen[*last].q.as_slice()),
        None => at,
    };
    let of_rest = rest.iter().map(|i| chosen[*i].q.as_slice());
    let postures: Vec<&[f64]> = from.into_iter().chain(of_rest).collect();
    let ways = Ways::new(&prepared.feasible, &prepared.joints, &postures);
    let begin = usize::from(from.is_some());
    let places: Vec<usize> = (begin..postures.len()).collect();
    let way = ways.shortest(from.map(|_| 0), &places);
    let rest = way.into_iter().map(|place| rest[place - begin]);
    first.into_iter().chain(rest).collect()
}

/// Adds earlier postures again, every joint coming from the other side; how many.
fn both_sides(prepared: &Prepared<'_>, list: &mut Vec<Listed>, pairs: usize) -> usize {
    let mut found = 0;
    for k in 1..list.len() {
        if found == pairs {
            break;
        }
        if list[k].1 != Why::Information {
            continue;
        }
        let (before, again) = (list[k - 1].0.q.clone(), list[k].0.clone());
        // The joint went on beyond the posture, so that it comes back against its first direction.
        let mut q = again.q.clone();
        for m in &prepared.joints.moved {
            let j = m.joint.index();
            let back = if m.turns { BACK.0 } else { BACK.1 };
            q[j] = m.rounded(q[j] + back * (again.q[j] - before[j]).signum());
        }
        let Ok(approach) = prepared.feasible.candidate(q) else {
            continue;
        };
        if !prepared.feasible.clear(&approach.q, &again.q) {
            continue;
        }
        list.push((approach, Why::Approach, None));
        list.push((again, Why::OtherSide, Some(k)));
        found += 1;
    }
    found
}

/// Puts postures on the way where the straight motion is blocked; places in the list of those that stay blocked.
pub(crate) fn with_detours(prepared: &Prepared<'_>, list: &mut Vec<Listed>) -> Vec<usize> {
    let (mut out, mut blocked): (Vec<Listed>, _) = (Vec::new(), Vec::new());
    // Where each posture of the list went.
    let mut place = Vec::new();
    for mut next in std::mem::take(list) {
        if let Some(last) = out.last() {
            let (feasible, joints) = (&prepared.feasible, &prepared.joints);
            if !feasible.clear(&last.0.q, &next.0.q) {
                let step = prepared.candidates.len().div_ceil(DETOURS).max(1);
                let others = prepared.candidates.iter().step_by(step);
                let others = others.map(|c| c.q.as_slice());
                let by = detour(feasible, joints, (&last.0.q, &next.0.q), others);
                match by.and_then(|q| feasible.candidate(q.to_vec()).ok()) {
                    Some(by) => out.push((by, Why::Detour, None)),
                    None => blocked.push(out.len()),
                }
            }
        }
        place.push(out.len());
        next.2 = next.2.map(|k| place[k]);
        out.push(next);
    }
    *list = out;
    blocked
}
