//! What a format costs that cannot hold the effects: equation (1) of the crate.

use calib_model::{LinkId, Model, Pose, Under};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Of the tool's position over postures, m.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Cost {
    /// Root mean square.
    pub rms_m: f64,
    /// Largest.
    pub largest_m: f64,
    /// How many postures.
    pub postures: usize,
}

/// A joint that was not moved in the recordings, and has no limits, is drawn from this range, rad or m.
const OPEN: [f64; 2] = [-0.5, 0.5];

/// Postures in the fitted range of every joint; where it was not moved, within its limits, but no further than ±0.5 rad (m).
pub(crate) fn postures(model: &Model, n: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let range = |j: &calib_model::JointInfo| {
        j.fitted_range.unwrap_or_else(|| {
            let [low, high] = j.limits.unwrap_or(OPEN);
            // Limits that do not contain 0 are kept.
            [low.max(OPEN[0]).min(high), high.min(OPEN[1]).max(low)]
        })
    };
    let ranges: Vec<[f64; 2]> = model.joints().iter().map(range).collect();
    (0..n)
        .map(|_| {
            let of = |[low, high]: &[f64; 2]| match low < high {
                true => rng.random_range(*low..*high),
                false => *low,
            };
            ranges.iter().map(of).collect()
        })
        .collect()
}

/// Postures wherever an arm can be, no matter what was recorded: its kind shows there. Sliding joints stay.
pub(crate) fn anywhere(model: &Model, n: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let one = |prismatic: bool, q: f64| if prismatic { 0.0 } else { q };
    let joints = model.joints();
    (0..n)
        .map(|_| {
            joints
                .iter()
                .map(|j| one(j.prismatic, rng.random_range(-ANYWHERE..ANYWHERE)))
                .collect()
        })
        .collect()
}

/// Most of the range of an arm's joints, rad.
const ANYWHERE: f64 = 2.0;

/// Where the model has a link at postures.
pub(crate) fn truth(model: &Model, link: LinkId, postures: &[Vec<f64>]) -> Vec<Pose> {
    let mut work = model.work();
    let at = |q: &Vec<f64>| {
        // Postures are finite and of the model's length.
        let _ = model.forward(q, &Under::default(), &mut work);
        work.root_from_link(link)
    };
    postures.iter().map(at).collect()
}

/// Distances of positions.
pub(crate) fn between(a: &[Pose], b: &[Pose]) -> Cost {
    let mut cost = Cost {
        postures: a.len(),
        ..Cost::default()
    };
    for (a, b) in a.iter().zip(b) {
        let off = (a.t - b.t).norm();
        cost.rms_m += off * off;
        cost.largest_m = cost.largest_m.max(off);
    }
    cost.rms_m = (cost.rms_m / a.len().max(1) as f64).sqrt();
    cost
}
