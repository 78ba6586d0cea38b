//! A plan: which postures, in which order, and what they will tell.

use crate::basis::sigma;
use crate::compose::{Effort, choice, compose};
use crate::error::PlanError;
use crate::known::Known;
use crate::list::Plan;
use crate::note::Note;
use crate::prepare::{Options, Prepared, prepare};
use crate::view::view;
use crate::words;

/// Postures where neither a number nor a σ is asked for.
const POSES: usize = 36;
/// Most postures that are tried for a σ.
const MOST: usize = 200;
/// Most postures of which it is said that they would reach a σ, where [`MOST`] do not.
const MOST_CHOSEN: usize = 1000;
/// Postures beyond those that the square root asks for.
const MORE: f64 = 1.2;
/// Fewest postures of a plan.
const FEWEST: usize = 6;

/// Plans.
///
/// # Errors
/// [`PlanError`] where no posture is possible, the task cannot be reached, or the σ is not.
pub fn plan(known: &Known, options: &Options) -> Result<Plan, PlanError> {
    let prepared = prepare(known, options)?;
    let mut plan = match options.sigma.filter(|_| options.poses.is_none()) {
        None => compose(&prepared, options.poses.unwrap_or(POSES).max(FEWEST)),
        Some(asked) => for_sigma(&prepared, asked),
    }?;
    if let Some(most) = options.path_time.filter(|most| plan.motion_time > *most) {
        plan = within(&prepared, &plan, most)?;
    }
    plan.view = view(&prepared, &plan);
    Ok(plan)
}

/// The plan with the most postures, fewer than those of another one, whose motions take no longer than a time, s. More postures take longer,
/// but for what their choice and the detours change: the number is found by halving, and what is returned does fit.
fn within(prepared: &Prepared<'_>, whole: &Plan, most: f64) -> Result<Plan, PlanError> {
    let asked = whole.recorded();
    let fits = |plan: &Plan| plan.motion_time <= most;
    let mut best = compose(prepared, FEWEST)?;
    if !fits(&best) {
        return Err(PlanError::TooLong {
            file: prepared.known.robot.file.clone(),
            asked: most,
            fewest: FEWEST,
            least: best.motion_time,
        });
    }
    let (mut low, mut high) = (FEWEST, asked);
    while high - low > 1 {
        let middle = low.midpoint(high);
        let plan = compose(prepared, middle)?;
        if fits(&plan) {
            (low, best) = (middle, plan);
        } else {
            high = middle;
        }
    }
    best.notes.push(Note::PathTime {
        asked,
        found: best.recorded(),
        most_s: most.round() as u64,
    });
    let needed = prepared
        .options
        .sigma
        .filter(|_| prepared.options.poses.is_none());
    match needed {
        // The time does not allow what the σ needs.
        Some(sigma) if best.sigma.is_none_or(|reached| reached > sigma) => {
            Err(PlanError::NotReachedInTime {
                file: prepared.known.robot.file.clone(),
                asked: words::length(Some(sigma)),
                most_s: most,
                postures: best.recorded(),
                reached: words::length(best.sigma),
            })
        }
        _ => Ok(best),
    }
}

/// The plan with the fewest postures that reaches a σ.
fn for_sigma(prepared: &Prepared<'_>, asked: f64) -> Result<Plan, PlanError> {
    let most = MOST.min(prepared.candidates.len() / 2).max(FEWEST);
    // Without an order and postures from both sides, to begin near the number.
    let without_order = |count: usize| {
        let m = choice(prepared, count, Effort::Quick).information;
        sigma(&m, &prepared.b)
    };
    let reaches = |sigma: Option<f64>| sigma.is_some_and(|s| s <= asked);
    let not_reached = |reached: Option<f64>| {
        // σ falls with the square root of the number, and more slowly where a prior or the joints' scatter is left.
        let share = reached.map(|reached| (reached / asked).powi(2));
        let needed = share.map(|share| (most as f64 * share * MORE).ceil());
        let needed = needed.filter(|n| *n <= MOST_CHOSEN.min(prepared.candidates.len() / 2) as f64);
        let needed = needed.map(|n| n as usize);
        PlanError::NotReached {
            file: prepared.known.robot.file.clone(),
            asked: words::length(Some(asked)),
            most,
            reached: words::length(reached),
            needed: needed.filter(|n| reaches(without_order(*n))),
        }
    };
    let (mut low, mut high) = (FEWEST - 1, most);
    if !reaches(without_order(most)) {
        return Err(not_reached(without_order(most)));
    }
    while high - low > 1 {
        let middle = low.midpoint(high);
        if reaches(without_order(middle)) {
            high = middle;
        } else {
            low = middle;
        }
    }
    let mut best = compose(prepared, high)?;
    while !reaches(best.sigma) {
        high += 1;
        if high > most {
            return Err(not_reached(best.sigma));
        }
        best = compose(prepared, high)?;
    }
    while high > FEWEST {
        high -= 1;
        let fewer = compose(prepared, high)?;
        if !reaches(fewer.sigma) {
            break;
        }
        best = fewer;
    }
    Ok(best)
}
