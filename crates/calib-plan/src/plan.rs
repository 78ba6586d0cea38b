//! A plan: which postures, in which order, and what they will tell.

use crate::basis::sigma;
use crate::compose::{Effort, choice, compose};
use crate::error::PlanError;
use crate::known::Known;
use crate::list::Plan;
use crate::prepare::{Options, Prepared, prepare};
use crate::view::view;
use crate::words;

/// Postures where neither a number nor a σ is asked for.
const POSES: usize = 36;
/// Most postures that are tried for a σ.
const MOST: usize = 200;
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
    plan.view = view(&prepared, &plan);
    Ok(plan)
}

/// The plan with the fewest postures that reaches a σ.
fn for_sigma(prepared: &Prepared<'_>, asked: f64) -> Result<Plan, PlanError> {
    let most = MOST.min(prepared.candidates.len() / 2).max(FEWEST);
    let not_reached = |reached: Option<f64>| PlanError::NotReached {
        file: prepared.known.robot.file.clone(),
        asked: words::length(Some(asked)),
        most,
        reached: words::length(reached),
    };
    // Without an order and postures from both sides, to begin near the number.
    let without_order = |count: usize| {
        let m = choice(prepared, count, Effort::Quick).information;
        sigma(&m, &prepared.b)
    };
    let reaches = |sigma: Option<f64>| sigma.is_some_and(|s| s <= asked);
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
