//! Which of several corrections that the recordings do not distinguish is said first: one that keeps readings within the URDF's limits, and of those a sign
//! before a zero that is off by a quarter or half turn, and a gain last: the rarer mistakes.

use calib_checks::structural::{
    Correction, Decision, Hypothesis, JointIndex, Outcome, Scoped, apply_all,
};

use super::layout::Layout;

/// Readings at a limit may be beyond it by this, as where a profile is read: rad or m, half a degree.
const TOLERANCE: f64 = 0.009;

/// The outcome with the likelier correction of a name first.
pub(super) fn likelier_first(layout: &Layout<'_>, mut outcome: Outcome) -> Outcome {
    let Decision::Named(named) = &mut outcome.decision else {
        return outcome;
    };
    if !is_of_readings(&named.correction) {
        return outcome;
    }
    // The first of equals stays the first.
    let all = std::iter::once(&named.correction).chain(&named.equivalent);
    let best = all
        .enumerate()
        .filter(|(_, c)| is_of_readings(c))
        .min_by_key(|(_, c)| (!is_within(layout, c), rarity(c)));
    if let Some((place, _)) = best.filter(|(place, _)| *place > 0) {
        std::mem::swap(&mut named.correction, &mut named.equivalent[place - 1]);
    }
    outcome
}

/// Single corrections of what a joint reads.
fn is_of_readings(correction: &Correction) -> bool {
    let [scoped] = &correction[..] else {
        return false;
    };
    matches!(
        scoped.hypothesis,
        Hypothesis::Sign { .. }
            | Hypothesis::Offset { .. }
            | Hypothesis::Zero { .. }
            | Hypothesis::Gain { .. }
    )
}

/// Larger for the rarer mistakes.
fn rarity(correction: &Correction) -> usize {
    let rarity = |scoped: &Scoped| match scoped.hypothesis {
        Hypothesis::Offset { .. } => 1,
        Hypothesis::Gain { .. } => 2,
        _ => 0,
    };
    correction.iter().map(rarity).max().unwrap_or(0)
}

/// Whether no reading that the correction changes is beyond the limits of its joint.
fn is_within(layout: &Layout<'_>, correction: &Correction) -> bool {
    let corrected = apply_all(correction, &layout.data);
    let model = &layout.inputs.robot.model;
    let limits: Vec<Option<(f64, f64)>> = model
        .joint_ids()
        .map(|id| model.joint(id).limits.range())
        .collect();
    let rows = layout.data.readings.iter().zip(&corrected.readings);
    let beyond = |joint: JointIndex, before: Option<f64>, after: Option<f64>| {
        let (Some(before), Some(after), Some(Some((low, high)))) =
            (before, after, limits.get(joint.0))
        else {
            return false;
        };
        before != after && !(low - TOLERANCE..=high + TOLERANCE).contains(&after)
    };
    let mut readings = rows.flat_map(|(before, after)| {
        let pairs = before.iter().zip(after).enumerate();
        pairs.map(|(j, (before, after))| (JointIndex(j), *before, *after))
    });
    !readings.any(|(joint, before, after)| beyond(joint, before, after))
}
