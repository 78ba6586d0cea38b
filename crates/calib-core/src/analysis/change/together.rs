//! Steps of all zeros together, beside what is simpler.
//!
//! As many numbers as the robot has joints explain nearly what any one of the other candidates does. They are named where they explain more
//! than the chance of so many asks, and where no joint alone explains nearly as much.

use super::{Change, Moved};

/// What zeros together must explain beyond other candidates, in T: where one of these is the cause, five more numbers explain that much more than
/// their quantile with a chance of 1 %.
const MORE: f64 = 6.0;

/// Part of their T from which one joint alone is told: the others, if they changed as well, show when it has been dealt with.
const ONE: f64 = 0.85;

/// Standard deviations from which the zero of a joint counts as changed.
const CLEAR: f64 = 3.0;

/// What a candidate must explain beyond others to be named before them, in T.
pub(super) fn asked_more(moved: Moved) -> f64 {
    match moved {
        Moved::Zeros => MORE,
        _ => 0.0,
    }
}

/// Takes out the steps of all zeros where fewer than two are clear, or where one joint alone explains nearly as much.
pub(super) fn leave_what_is_simpler(changes: &mut Vec<(usize, Change)>) {
    let Some(place) = changes.iter().position(|(_, c)| c.moved == Moved::Zeros) else {
        return;
    };
    let zeros = &changes[place].1;
    let alone = |change: &Change| {
        matches!(change.moved, Moved::Joint(_)) && change.score >= ONE * zeros.score
    };
    let steps = zeros.jump.iter().zip(&zeros.sigma);
    let clear = steps.filter(|(step, sigma)| step.abs() > CLEAR * **sigma);
    if clear.count() < 2 || changes.iter().any(|(_, change)| alone(change)) {
        changes.remove(place);
    }
}
