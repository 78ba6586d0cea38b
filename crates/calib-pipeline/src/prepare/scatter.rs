//! How the tracker's noise in one recording compares with that in another, from what no model of the robot enters: distances between the
//! markers of a body, and places of bodies that nothing moves.
//!
//! ```text
//! σ² = ½ var(|p_j − p_k|) of two markers of a body,   ½ var(y_i − y_(i−1)) of a coordinate that nothing moves          (1)
//! ```
//!
//! Outliers by the median of absolute deviations are left out: a marker that jumps, or a body that slips, changes it little.

use calib_geometry::statistics::median;
use calib_profile::{BodyKind, Profile};
use calib_recording::Poses;
use calib_urdf::RobotModel;
use nalgebra::Point3;

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
/// σ below this, m, is computed, not measured.
const COMPUTED: f64 = 1e-7;

/// Equation (1) over all bodies, weighted by how many values tell each; `None` where nothing tells.
pub(crate) fn scatter(profile: &Profile, model: &RobotModel, poses: &Poses) -> Option<Scatter> {
    let (mut sum, mut values) = (0.0, 0.0);
    let mut add = |all: Vec<f64>, share: f64| {
        if let Some(variance) = variance(&all) {
            let n = all.len() as f64 * share;
            sum += n * variance;
            values += n;
        }
    };
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
                    add(rows.filter_map(distance).collect(), share);
                }
                if still && m < 3 {
                    for track in tracks {
                        for axis in 0..3 {
                            add(
                                differences(track.iter().map(|p| p.map(|p| p[axis])), step),
                                1.0,
                            );
                        }
                    }
                }
            }
            BodyKind::Pose if still => {
                if let Some(track) = poses.bodies.get(name) {
                    for axis in 0..3 {
                        let along = track.iter().map(|p| p.map(|p| p.translation.vector[axis]));
                        add(differences(along, step), SUCCESSIVE);
                    }
                }
            }
            BodyKind::Pose => {}
        }
    }
    let variance = sum / values;
    (values > 0.0 && variance > COMPUTED * COMPUTED).then_some(Scatter { variance, values })
}

/// Differences of successive values.
fn differences(track: impl Iterator<Item = Option<f64>>, step: usize) -> Vec<f64> {
    let seen: Vec<f64> = track.step_by(step).flatten().collect();
    seen.windows(2).map(|w| w[1] - w[0]).collect()
}

/// Half of the variance of the values that are no outliers, by the median of absolute deviations; of a normal distribution it misses 0.1 %.
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
    (count > 1.0).then(|| 0.5 * sum / (count - 1.0))
}
