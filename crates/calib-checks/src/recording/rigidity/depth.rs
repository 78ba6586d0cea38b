//! Distances seen by a tracker that is noisier along its line of sight than across it.
//!
//! With θ the angle of a distance to the line of sight from the tracker's origin, and σ of each coordinate across that line and along it:
//!
//! ```text
//! var d = 2 (σ²_across sin²θ + σ²_along cos²θ)                                                   (1)
//! ```
//!
//! Distances that lie across the line and those that lie along it tell both.

use nalgebra::Point3;

use super::Pair;
use crate::statistics::robust_sigma;

/// cos²θ up to which a distance lies across the line of sight, and from which it lies along it.
const ACROSS: f64 = 0.2;
const ALONG: f64 = 0.5;
/// Fewer distances of a kind do not show their noise.
const FEWEST: usize = 8;
/// A σ along the line that is less than this many times that across it makes no difference to the tolerance of distances.
const CLEARLY: f64 = 2.0;

/// σ along the line of sight, m, where it is clearly larger than that across it, whichever marker is left out: one that is loose is no depth.
pub(super) fn sigma(tracks: &[&[Option<Point3<f64>>]], pairs: &[Pair]) -> Option<f64> {
    let all = 0..tracks.len();
    let least = |of: Vec<Option<f64>>| {
        let of: Option<Vec<f64>> = of.into_iter().collect();
        of?.into_iter().reduce(f64::min)
    };
    let without = |k: usize| of_pairs(tracks, pairs.iter().filter(|p| p.i != k && p.j != k));
    least(all.map(without).collect())
}

/// Equation (1) of these distances; `None` where too few lie across the line or along it, or depth is known as well as place.
fn of_pairs<'p>(
    tracks: &[&[Option<Point3<f64>>]],
    pairs: impl Iterator<Item = &'p Pair>,
) -> Option<f64> {
    let (mut across, mut along) = (Vec::new(), Vec::new());
    for pair in pairs {
        for (a, b) in tracks[pair.i].iter().zip(tracks[pair.j]) {
            let (Some(a), Some(b)) = (a, b) else {
                continue;
            };
            let middle = nalgebra::center(a, b).coords;
            let squares = (a - b).norm_squared() * middle.norm_squared();
            if squares <= 0.0 {
                continue;
            }
            let cos2 = (a - b).dot(&middle).powi(2) / squares;
            let off = (a - b).norm() - pair.distance;
            if cos2 < ACROSS {
                across.push((cos2, off));
            } else if cos2 > ALONG {
                along.push((cos2, off));
            }
        }
    }
    // Robust variance of a coordinate, and mean cos²θ.
    let of = |seen: &[(f64, f64)]| {
        let sigma = robust_sigma(seen.iter().map(|(_, off)| *off), 0.0)?;
        let cos2 = seen.iter().map(|(cos2, _)| cos2).sum::<f64>() / seen.len() as f64;
        (seen.len() >= FEWEST).then_some((sigma * sigma / 2.0, cos2))
    };
    let (low, at_low) = of(&across)?;
    let (high, at_high) = of(&along)?;
    let slope = (high - low) / (at_high - at_low);
    let of_across = (low - slope * at_low).max(0.0);
    let of_along = of_across + slope;
    let clearly = slope > 0.0 && of_along > CLEARLY * CLEARLY * of_across;
    clearly.then(|| of_along.sqrt())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use calib_recording::Poses;
    use nalgebra::Vector3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use crate::recording::rigidity::Body;
    use crate::recording::shapes::tests::recording;
    use crate::recording::{Expectations, rigidity::rigidity};

    const AT: [[f64; 3]; 4] = [
        [0.0, 0.0, 0.0],
        [0.08, 0.0, 0.01],
        [0.02, 0.09, 0.0],
        [0.07, 0.06, 0.04],
    ];

    /// The body in random poses, with more noise along the line of sight, m.
    fn seen(more: f64, rng: &mut ChaCha8Rng) -> Poses {
        let mut poses = recording(&AT.map(Vector3::from), 30, 1.0, rng);
        for at in poses.markers.values_mut().flatten().flatten() {
            let error: f64 = StandardNormal.sample(rng);
            *at += at.coords.normalize() * (more * error);
        }
        poses
    }

    fn expected() -> Expectations {
        let names = (0..AT.len()).map(|k| format!("m{k}")).collect();
        Expectations {
            bodies: BTreeMap::from([("hand".to_owned(), names)]),
            marker_sigma: Some(3e-4),
            ..Expectations::default()
        }
    }

    fn found(poses: &Poses) -> Option<f64> {
        let expected = expected();
        let body = Body::new("hand", &expected.bodies["hand"], poses, &expected)?;
        super::sigma(&body.tracks, &body.pairs)
    }

    #[test]
    fn noise_of_depth_is_found_and_no_marker_is_called_loose() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let poses = seen(3e-3, &mut rng);
            let along = found(&poses).expect("found");
            // The least of four estimates from about ten distances each: far below, never far above.
            assert!((1e-3..4.5e-3).contains(&along), "{seed}: {along}");
            let said = rigidity(&poses, &expected());
            assert!(said.is_empty(), "{seed}: {said:?}");
        }
    }

    #[test]
    fn equal_noise_and_a_loose_marker_are_no_depth() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(100 + seed);
            let mut poses = seen(0.0, &mut rng);
            assert_eq!(found(&poses), None, "{seed}");
            let loose = poses.markers.get_mut("m2").expect("a marker");
            for at in loose.iter_mut().flatten() {
                *at += 4e-3 * Vector3::from_fn(|_, _| -> f64 { StandardNormal.sample(&mut rng) });
            }
            assert_eq!(found(&poses), None, "{seed}");
            let said = rigidity(&poses, &expected());
            assert_eq!(said.len(), 1, "{seed}: {said:?}");
        }
    }
}
