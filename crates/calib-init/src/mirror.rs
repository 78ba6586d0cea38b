//! Whether a left-handed tracker explains the recordings as well as reversed joints do: an arm whose axes lie in a plane in some posture is its own
//! mirror image but for some signs, and on which links the bodies are is found with right-handed coordinates only.

use std::collections::BTreeSet;

use calib_checks::structural::{Chain, Correction, Hypothesis, JointIndex, Scope, Scoped};
use calib_recording::Poses;
use calib_urdf::Joint;

use crate::links::Scene;

/// Residuals within this factor do not decide between signs and a mirror.
const SAME: f64 = 1.5;

/// The correction: one axis of the tracker negated.
fn mirrored() -> Correction {
    vec![Scoped {
        hypothesis: Hypothesis::Mirrored,
        scope: Scope::All,
    }]
}

/// Whether a left-handed tracker, with each body on the link that fits best then, leaves about as little as reversed joints do (rms, m), or clearly less.
/// What it leaves must be within `limit`, m, what errors of a nominal robot explain, to be as good.
fn is_as_good(scene: &Scene<'_>, signs: f64, limit: Option<f64>) -> bool {
    let Ok(chain) = Chain::from_model(scene.model) else {
        return false;
    };
    let correction = mirrored();
    let least = |body: usize| -> Option<f64> {
        let all = scene.residuals(&chain, body, correction.first())?;
        all.into_iter().map(|(_, rms)| rms).min_by(f64::total_cmp)
    };
    let left = (0..scene.bodies.len()).filter_map(least);
    let Some(left) = left.max_by(f64::total_cmp) else {
        return false;
    };
    let explained = limit.is_some_and(|limit| left <= limit);
    (explained && left <= SAME * signs) || SAME * left < signs
}

/// Whether a left-handed tracker explains the recordings as well as these reversed joints, which leave so much (rms, m), and no limit of the URDF decides.
pub(crate) fn is_or_mirrored(
    scene: &Scene<'_>,
    signs: &Correction,
    left: f64,
    limit: Option<f64>,
) -> bool {
    let mirror = mirrored();
    let decided = within_limits(scene, &[signs, &mirror]) == [true, false];
    !decided && is_as_good(scene, left, limit)
}

/// For each correction: whether the readings of the joints that any of them reverses are within the URDF's limits after it.
pub(crate) fn within_limits(scene: &Scene<'_>, all: &[&Correction]) -> Vec<bool> {
    let reversed = |correction: &Correction| -> BTreeSet<JointIndex> {
        let joints = correction.iter().filter_map(|s| match s.hypothesis {
            Hypothesis::Sign { joint } => Some(joint),
            _ => None,
        });
        joints.collect()
    };
    let any: BTreeSet<JointIndex> = all.iter().flat_map(|c| reversed(c)).collect();
    let inside =
        |joint: &JointIndex, sign: f64| is_within(scene, &scene.model.joints()[joint.0], sign);
    let of = |correction: &&Correction| {
        let reversed = reversed(correction);
        any.iter()
            .all(|j| inside(j, if reversed.contains(j) { -1.0 } else { 1.0 }))
    };
    all.iter().map(of).collect()
}

/// Whether all readings of a joint, times this sign, are within its limits.
fn is_within(scene: &Scene<'_>, joint: &Joint, sign: f64) -> bool {
    /// rad or m, half a degree: readings at a limit may be beyond it by this, as where a profile is read.
    const TOLERANCE: f64 = 0.009;
    let Some((low, high)) = joint.limits.range() else {
        return true;
    };
    let of = |poses: &Poses| poses.joints.get(&joint.name).cloned().unwrap_or_default();
    let mut readings = scene.tables.iter().flat_map(of).flatten();
    readings.all(|q| (low - TOLERANCE..=high + TOLERANCE).contains(&(sign * q)))
}
