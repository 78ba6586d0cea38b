//! Whether the errors of measured poses are those of the poses or those of their inverses.
//!
//! A tracker beside the robot measures where a body is; a camera on the robot measures where a board beside it is. Errors of the angles move what is
//! measured about itself, and the other end of the path by a lever. With φ and e the rows of an observation that are angles and lengths, and
//! p_z = −R_zᵀ t_z,
//!
//! ```text
//! e' = e + φ × p_z,      Λ = 3/2 n ln(Σ |e|² / Σ |e'|²)                                       (1)
//! ```
//!
//! e' are the lengths of the other direction (but for the sign), to first order in the errors, and Λ is by how much the logarithm of the
//! likelihood is larger with them, each direction with the σ that fits it best: φ and e change with a determinant of 1.

use crate::analysis::solution::Solution;
use crate::graph::ids::MeasurementId;
use crate::graph::measurement::{MeasurementKind, PoseNoise};

impl Solution {
    /// Λ of equation (1) by measurement of poses, in the order of the measurements: above 0 where the inverses of the poses are likelier to have
    /// been measured, or, of those that state them, the poses. Of long recordings for some thousand samples only.
    #[must_use]
    pub fn other_side_likelier_by(&self) -> Vec<(MeasurementId, f64)> {
        let measurements = &self.model.problem.measurements;
        let mut sums = vec![(0.0, 0.0, 0.0); measurements.len()];
        self.for_each_fitted(|o, rows| {
            let kind = &measurements[o.measurement].kind;
            let MeasurementKind::Poses(poses) = kind else {
                return;
            };
            if !matches!(poses.noise, PoseNoise::Split { .. }) {
                return;
            }
            let (angles, lengths) = (kind.stated(o.item, rows), kind.stated(o.item, &rows[3..]));
            let lever = poses.observations[o.item].pose.inverse().translation.vector;
            let others = lengths + angles.cross(&lever);
            let (n, own, other) = &mut sums[o.measurement];
            *n += 1.0;
            *own += lengths.norm_squared();
            *other += others.norm_squared();
        });
        let sums = sums.into_iter().enumerate();
        let seen = sums.filter(|(_, (n, own, other))| *n > 0.0 && *own > 0.0 && *other > 0.0);
        seen.map(|(m, (n, own, other))| (MeasurementId::of(m), 1.5 * n * f64::ln(own / other)))
            .collect()
    }
}
