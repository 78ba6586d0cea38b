//! Postures from which a pose of the tool is approached where the row before it is no start.
//!
//! Points of a Halton sequence in the fitted ranges, else the limits, of the joints; for a pose, those whose tool is nearest, a rotation by 1 rad
//! counting as 0.3 m.

use calib_model::{Aim, Model, ModelError, Place, Pose, Under, Work};

/// Postures that are known.
const POSTURES: usize = 1024;
/// Of them, those that are tried for a pose; most poses need one or two.
const TRIED: usize = 128;
/// Bases of the sequence, one for each joint; more joints use them again from another point on.
const PRIMES: [usize; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];
/// m per rad.
pub(crate) const LEVER: f64 = 0.3;
/// Half the range of a joint without limits, rad; of one that slides, m.
const HALF: (f64, f64) = (std::f64::consts::PI, 0.5);

/// Postures with their poses of the tool.
pub(crate) struct Starts {
    known: Vec<(Vec<f64>, Pose)>,
}

impl Starts {
    /// Of a tool.
    pub(crate) fn of(model: &Model, tool: Place, work: &mut Work) -> Result<Self, ModelError> {
        let ranges: Vec<[f64; 2]> = model
            .joints()
            .iter()
            .map(|joint| {
                let half = if joint.prismatic { HALF.1 } else { HALF.0 };
                joint.fitted_range.or(joint.limits).unwrap_or([-half, half])
            })
            .collect();
        let posture = |k: usize| -> Vec<f64> {
            let joints = ranges.iter().enumerate();
            let of = joints.map(|(j, [low, high])| {
                let from = k + 1 + POSTURES * (j / PRIMES.len());
                low + (high - low) * halton(from, PRIMES[j % PRIMES.len()])
            });
            of.collect()
        };
        let mut known = Vec::with_capacity(POSTURES);
        for q in (0..POSTURES).map(posture) {
            model.forward(&q, &Under::default(), work)?;
            let pose = model.root_from(tool, work)?;
            known.push((q, pose));
        }
        Ok(Self { known })
    }

    /// Those whose tool is nearest to a pose, the nearest first.
    pub(crate) fn near(&self, wanted: &Pose, aim: Aim) -> Vec<&[f64]> {
        let away = |pose: &Pose| {
            let apart = pose.isometry().inverse() * wanted.isometry();
            match aim {
                Aim::Position => apart.translation.vector.norm(),
                Aim::Pose => apart.translation.vector.norm() + LEVER * apart.rotation.angle(),
            }
        };
        let mut all: Vec<(f64, &[f64])> =
            self.known.iter().map(|(q, p)| (away(p), &q[..])).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all.into_iter().take(TRIED).map(|(_, q)| q).collect()
    }
}

/// The digits of k in a base, behind the point in the opposite order.
fn halton(mut k: usize, base: usize) -> f64 {
    let (mut part, mut sum) = (1.0, 0.0);
    while k > 0 {
        part /= base as f64;
        sum += part * (k % base) as f64;
        k /= base;
    }
    sum
}
