//! Motions between the fitted recordings and a held-out one, each fitted to the points of that recording.
//!
//! ```text
//! none      e = p_i − s_i                                            p predicted, s seen
//! tracker   e = T p_i − s_i,   T ∈ SE(3) the same for all bodies      6 unknowns
//! body      e = m_k − (tracker_from_link_i)⁻¹ s_ik                    one place m_k per point of the body on its link
//! joint     e = p_i(q_j + c_j) − s_i                                  1 unknown, or one for each of several joints (`zeros.rs`)
//! r² = Σ|e|² / (3N − unknowns)                                                                            (1)
//! ```

use calib_geometry::registration::rigid_registration;
use calib_urdf::JointId;
use nalgebra::{Isometry3, Point3, Vector3};

use crate::verify::seen::Seen;

/// Errors beyond this many times the median under a hypothesis are gross outliers of the tracker.
const GROSS: f64 = 5.0;

/// What may have moved.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Motion {
    Tracker,
    Body(String),
    Joint(JointId),
    /// The zeros of several joints.
    Zeros,
}

/// How much further a joint stands than it is read, and its σ, rad or m.
#[derive(Clone, Copy)]
pub(super) struct ZeroStep {
    pub(super) joint: JointId,
    pub(super) by: f64,
    pub(super) sigma: f64,
}

impl ZeroStep {
    pub(super) fn clearness(&self) -> f64 {
        self.by.abs() / self.sigma.max(f64::MIN_POSITIVE)
    }
}

/// A motion that was tried.
pub(super) struct Tried {
    pub(super) motion: Motion,
    /// r of (1), m, and of the same points without a motion.
    pub(super) left: f64,
    pub(super) none: f64,
    /// Where the middle of what was seen went, m, and its σ; of joints the step of the clearest one, rad or m.
    pub(super) shift: f64,
    pub(super) sigma: f64,
    /// Of joints, the clearest first.
    pub(super) steps: Vec<ZeroStep>,
    /// Rotation, where it is determined, rad; none of a joint.
    pub(super) angle: Option<f64>,
    /// Which of the points were taken: the others are gross outliers.
    pub(super) kept: Vec<bool>,
}

/// T of (1).
pub(super) fn tracker(points: &[Seen<'_>]) -> Option<Tried> {
    let motion = |kept: &[bool]| -> Option<Isometry3<f64>> {
        let pairs = points.iter().zip(kept).filter(|(_, kept)| **kept);
        let (from, to): (Vec<_>, Vec<_>) = pairs.map(|(p, _)| (p.predicted, p.seen)).unzip();
        Some(rigid_registration(&from, &to, None).ok()?.b_from_a)
    };
    let (left, none, kept) = robustly(points, 6, |kept| {
        let t = motion(kept)?;
        Some(points.iter().map(|p| t * p.predicted - p.seen).collect())
    })?;
    let t = motion(&kept)?;
    let middle = points
        .iter()
        .map(|p| p.predicted.coords)
        .sum::<Vector3<f64>>()
        / points.len() as f64;
    let middle = Point3::from(middle);
    Some(Tried {
        motion: Motion::Tracker,
        left,
        none,
        shift: (t * middle - middle).norm(),
        sigma: sigma(points, left),
        steps: Vec::new(),
        angle: Some(t.rotation.angle()),
        kept,
    })
}

/// The m_k of (1), for the points of one body; those of the others stay.
pub(super) fn remounted(points: &[Seen<'_>], body: &str) -> Option<Tried> {
    let own = || points.iter().filter(|p| p.body == body);
    let count = own().map(|p| p.point + 1).max()?;
    let on_link = |p: &Seen<'_>, at: &Point3<f64>| p.tracker_from_link.inverse_transform_point(at);
    // Seen minus predicted place of every point on the link, mean over the rows.
    let places = |kept: &[bool]| -> Vec<(Vector3<f64>, Vector3<f64>, usize)> {
        let mut sums = vec![(Vector3::zeros(), Vector3::zeros(), 0); count];
        for (p, _) in points
            .iter()
            .zip(kept)
            .filter(|(p, kept)| **kept && p.body == body)
        {
            let sum = &mut sums[p.point];
            sum.0 += on_link(p, &p.predicted).coords;
            sum.1 += on_link(p, &p.seen).coords;
            sum.2 += 1;
        }
        sums
    };
    let (left, none, kept) = robustly(points, 3 * count, |kept| {
        let sums = places(kept);
        let error = |p: &Seen<'_>| {
            let moved = sums.get(p.point).filter(|s| p.body == body && s.2 > 0);
            let moved = moved.map_or_else(Vector3::zeros, |s| (s.1 - s.0) / s.2 as f64);
            p.predicted - p.seen + p.tracker_from_link.rotation * moved
        };
        Some(points.iter().map(error).collect())
    })?;
    let sums = places(&kept);
    let known = || sums.iter().filter(|s| s.2 > 0);
    let (from, to): (Vec<_>, Vec<_>) = known()
        .map(|s| {
            (
                Point3::from(s.0 / s.2 as f64),
                Point3::from(s.1 / s.2 as f64),
            )
        })
        .unzip();
    let shift = from
        .iter()
        .zip(&to)
        .map(|(a, b)| b - a)
        .sum::<Vector3<f64>>()
        / known().count().max(1) as f64;
    if !is_rigid(&from, &to, sigma(points, left)) {
        return None;
    }
    let turned = rigid_registration(&from, &to, None).ok();
    Some(Tried {
        motion: Motion::Body(body.to_owned()),
        left,
        none,
        shift: shift.norm(),
        sigma: sigma(points, left),
        steps: Vec::new(),
        angle: turned.map(|t| t.b_from_a.rotation.angle()),
        kept,
    })
}

/// Whether places moved as one body: the distances between them, whose means have σ, m, stayed. Labels that were exchanged in some of the rows that
/// were fitted put places where no marker is, and those that are right seem to have moved.
fn is_rigid(from: &[Point3<f64>], to: &[Point3<f64>], sigma: f64) -> bool {
    /// A distance has the noise of two means, and one of a few may be off by this many σ.
    const CHANCE: f64 = 5.0;
    /// Small errors of the places, beside a motion that is many times as large, are no reason to doubt the motion.
    const LITTLE: f64 = 0.2;
    let pairs = from.iter().zip(to);
    let squares: f64 = pairs.clone().map(|(a, b)| (b - a).norm_squared()).sum();
    let moved = (squares / from.len().max(1) as f64).sqrt();
    let most = f64::max(CHANCE * sigma, LITTLE * moved);
    pairs.enumerate().all(|(i, (a, b))| {
        let mut others = from[..i].iter().zip(to);
        others.all(|(c, d)| ((a - c).norm() - (b - d).norm()).abs() < most)
    })
}

/// σ of a mean over the postures, m: points of one posture share its error.
fn sigma(points: &[Seen<'_>], left: f64) -> f64 {
    left * (3.0 / rows(points).max(1) as f64).sqrt()
}

/// Number of postures.
pub(super) fn rows(points: &[Seen<'_>]) -> usize {
    let mut rows: Vec<usize> = points.iter().map(|p| p.row).collect();
    rows.dedup();
    rows.len()
}

/// r of (1) with and without a motion, and the points that it was computed from: gross outliers under the motion are left out.
pub(super) fn robustly(
    points: &[Seen<'_>],
    unknowns: usize,
    fit: impl Fn(&[bool]) -> Option<Vec<Vector3<f64>>>,
) -> Option<(f64, f64, Vec<bool>)> {
    /// Rounds of leaving out.
    const ROUNDS: usize = 3;
    let mut kept = vec![true; points.len()];
    let mut errors = fit(&kept)?;
    for _ in 0..ROUNDS {
        let mut lengths: Vec<f64> = errors.iter().map(Vector3::norm).collect();
        let each = lengths.clone();
        lengths.sort_by(f64::total_cmp);
        let gross = GROSS * lengths[lengths.len() / 2];
        kept = each.iter().map(|e| *e <= gross).collect();
        errors = fit(&kept)?;
    }
    let count = kept.iter().filter(|k| **k).count();
    let freedom = (3 * count).checked_sub(unknowns).filter(|f| *f > 0)?;
    let sum = |errors: &mut dyn Iterator<Item = f64>| -> f64 {
        errors.zip(&kept).filter(|(_, k)| **k).map(|(e, _)| e).sum()
    };
    let left = sum(&mut errors.iter().map(Vector3::norm_squared));
    let none = sum(&mut points.iter().map(|p| (p.predicted - p.seen).norm_squared()));
    let r = |sum: f64, freedom: usize| (sum / freedom as f64).sqrt();
    Some((r(left, freedom), r(none, 3 * count), kept))
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    #[test]
    fn a_body_moves_as_one_and_exchanged_labels_do_not() {
        let [a, b, c] = [[0.0, 0.0, 0.0], [0.07, 0.0, 0.0], [0.02, 0.06, 0.0]].map(Point3::from);
        let moved = Isometry3::new(
            Vector3::new(0.02, -0.01, 0.0),
            UnitQuaternion::from_euler_angles(0.1, 0.0, 0.8).scaled_axis(),
        );
        let noise = Vector3::new(3e-4, -3e-4, 2e-4);
        let before = [a, b, c];
        let after = [moved * a + noise, moved * b, moved * c - noise];
        assert!(is_rigid(&before, &after, 2e-4));
        assert!(is_rigid(&before[..1], &[b], 2e-4), "one marker");
        // Labels that are exchanged in half of the fitted rows put both markers into the middle.
        let middle = nalgebra::center(&a, &b);
        assert!(!is_rigid(&[middle, middle], &[a, b], 2e-4));
        assert!(!is_rigid(&[middle, middle, c], &before, 2e-4));
    }
}
