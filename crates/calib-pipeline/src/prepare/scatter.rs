//! How the tracker's noise in one recording compares with that in another, from what no model of the robot enters: distances between the
//! markers of a body, and places of bodies that nothing moves.
//!
//! ```text
//! σ² = ½ var(|p_j − p_k|) of two markers of a body,   ½ var(y_i − y_(i−1)) of a coordinate that nothing moves          (1)
//! ```
//!
//! Without outliers by the median of absolute deviations, and the middle one of all pairs: one marker that slips or is loose changes it little.

use calib_geometry::statistics::median;
use calib_profile::{BodyKind, Profile};
use calib_recording::Poses;
use calib_urdf::RobotModel;
use nalgebra::{Point3, Vector3};

/// Variance of a coordinate in one recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatter {
    /// m²; only its ratio to that of another recording means something.
    pub variance: f64,
    /// Independent values that tell it.
    pub values: f64,
}

/// σ of a normal distribution over its median absolute deviation.
const NORMAL: f64 = 1.482_602_218_505_602;
/// Pairs of markers of a body that are looked at.
const PAIRS: usize = 12;
/// Rows that are looked at, evenly taken.
const ROWS: usize = 2000;
/// Fewer rows tell nothing.
const FEWEST: usize = 5;
/// What a difference of successive values tells, in independent values: each value is in two of them.
const SUCCESSIVE: f64 = 2.0 / 3.0;
/// Efficiency of a median against the mean.
const OF_MEDIAN: f64 = 0.64;
/// σ below this, m, is computed, not measured.
const COMPUTED: f64 = 1e-7;

/// A scatter counts as another one from this ratio of σ…
pub(crate) const UNLIKE: f64 = 1.5;
/// …and these standard errors of its logarithm on.
const CERTAIN: f64 = 4.0;
/// Variance of ln σ without outliers, times the number of values.
const OF_LOG: f64 = 0.55;
/// Values that a small scatter needs: half of a few values are often close together by chance, and the others pass for outliers.
const SMALL: f64 = 20.0;

impl Scatter {
    /// How far ln σ is above that of another recording, where that is certain.
    pub(crate) fn above(self, other: Self) -> Option<f64> {
        let above = 0.5 * (self.variance / other.variance).ln();
        let smaller = if above < 0.0 { self } else { other };
        let error = (OF_LOG * (1.0 / self.values + 1.0 / other.values)).sqrt();
        let differs = above.abs() > UNLIKE.ln() && above.abs() > CERTAIN * error;
        (differs && smaller.values >= SMALL).then_some(above)
    }
}

/// Equation (1): the median over all pairs and places, so that a loose marker is not taken for the tracker; `None` where nothing
/// shows it.
pub(crate) fn scatter(profile: &Profile, model: &RobotModel, poses: &Poses) -> Option<Scatter> {
    let (mut found, mut values) = (Vec::new(), 0.0);
    let step = poses.rows.len().div_ceil(ROWS).max(1);
    for (name, body) in &profile.bodies {
        let chain = model.chain_to_root(body.link);
        let moves = |joint: &String| model.joint_id(joint).is_ok_and(|id| chain.contains(&id));
        let still = !poses.joints.keys().any(moves);
        match &body.kind {
            BodyKind::Markers { names, .. } => {
                let tracks: Vec<&Vec<Option<Point3<f64>>>> =
                    names.iter().filter_map(|m| poses.markers.get(m)).collect();
                let m = tracks.len();
                let pairs: Vec<(usize, usize)> = (0..m)
                    .flat_map(|j| (j + 1..m).map(move |k| (j, k)))
                    .collect();
                let every = pairs.len().div_ceil(PAIRS).max(1);
                let looked: Vec<_> = pairs.iter().step_by(every).collect();
                // Of m markers, 3m − 6 distances are independent.
                let independent = if m < 3 { pairs.len() } else { 3 * m - 6 };
                let share = (independent as f64 / looked.len().max(1) as f64).min(1.0);
                for (j, k) in looked {
                    let rows = tracks[*j].iter().zip(tracks[*k]).step_by(step);
                    let distance = |(a, b): (&Option<Point3<f64>>, &Option<Point3<f64>>)| {
                        Some((a.as_ref()? - b.as_ref()?).norm())
                    };
                    let distances: Vec<f64> = rows.filter_map(distance).collect();
                    if let Some(variance) = variance(&distances) {
                        found.push(0.5 * variance);
                        values += distances.len() as f64 * share;
                    }
                }
                for track in tracks.iter().filter(|_| still && m < 3) {
                    let seen = track.iter().step_by(step).flatten();
                    let seen: Vec<Vector3<f64>> = seen.map(|p| p.coords).collect();
                    if let Some(variance) = at_rest(&seen) {
                        found.push(variance);
                        values += 3.0 * seen.len() as f64 * SUCCESSIVE;
                    }
                }
            }
            BodyKind::Pose if still => {
                let seen = poses.bodies.get(name).into_iter().flatten();
                let seen = seen.step_by(step).flatten();
                let seen: Vec<Vector3<f64>> = seen.map(|p| p.translation.vector).collect();
                if let Some(variance) = at_rest(&seen) {
                    found.push(variance);
                    values += 3.0 * seen.len() as f64 * SUCCESSIVE;
                }
            }
            BodyKind::Pose => {}
        }
    }
    if found.len() > 2 {
        values *= OF_MEDIAN;
    }
    let variance = median(found)?;
    (variance > COMPUTED * COMPUTED).then_some(Scatter { variance, values })
}

/// Equation (1) of a place that nothing moves, the mean over its coordinates.
fn at_rest(seen: &[Vector3<f64>]) -> Option<f64> {
    let along = |axis: usize| {
        let differences = seen.windows(2).map(|w| w[1][axis] - w[0][axis]);
        variance(&differences.collect::<Vec<f64>>())
    };
    Some((along(0)? + along(1)? + along(2)?) / 6.0)
}

/// The variance of the values that are no outliers, by the median of absolute deviations; of a normal distribution it misses 0.1 %.
fn variance(values: &[f64]) -> Option<f64> {
    /// Values farther out than this many σ are outliers.
    const OUTLIER: f64 = 4.0;
    let n = values.len() as f64;
    if values.len() < FEWEST {
        return None;
    }
    let middle = median(values.to_vec())?;
    let off: Vec<f64> = values.iter().map(|x| (x - middle).abs()).collect();
    // Few values have a median deviation that is too small.
    let sigma = NORMAL * median(off.clone())? * (1.0 + 1.0 / n);
    let kept = off.iter().filter(|off| **off <= OUTLIER * sigma);
    let (sum, count) = kept.fold((0.0, 0.0), |(sum, n), off| (sum + off * off, n + 1.0));
    (count > 1.0).then(|| sum / (count - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn of(rng: &mut ChaCha8Rng, values: usize, sigma: f64) -> Scatter {
        let one = |rng: &mut ChaCha8Rng| -> f64 { StandardNormal.sample(rng) };
        let drawn: Vec<f64> = (0..values).map(|_| sigma * one(rng)).collect();
        Scatter {
            variance: variance(&drawn).expect("values that differ"),
            values: values as f64,
        }
    }

    /// Power and false alarms of 1000 pairs of recordings each.
    #[test]
    fn few_values_are_no_smaller_noise() {
        let mut rng = ChaCha8Rng::seed_from_u64(17);
        let mut share = |values: usize, others: usize, sigma: f64| {
            let differ = (0..1000)
                .filter(|_| {
                    let own = of(&mut rng, values, sigma);
                    own.above(of(&mut rng, others, 1.0)).is_some()
                })
                .count();
            differ as f64 / 1000.0
        };
        for (values, others) in [(5, 24), (7, 24), (10, 10), (20, 24), (24, 200)] {
            let false_alarms = share(values, others, 1.0);
            assert!(false_alarms <= 3e-3, "{values}, {others}: {false_alarms}");
        }
        for (values, others, sigma) in [(10, 40, 5.0), (60, 60, 3.0), (60, 60, 1.0 / 3.0)] {
            let power = share(values, others, sigma);
            assert!(power >= 0.9, "{values}, {others}, {sigma}: {power}");
        }
    }
}
