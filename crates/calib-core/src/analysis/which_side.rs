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
use crate::model::cache::State;
use crate::model::path::Derivatives;
use crate::solve::equations::Workspace;

impl Solution {
    /// Λ of equation (1) by measurement of poses, in the order of the measurements: above 0 where the inverses of the poses are likelier to have
    /// been measured, or, of those that state them, the poses. Of long recordings for some thousand samples only.
    #[must_use]
    pub fn other_side_likelier_by(&self) -> Vec<(MeasurementId, f64)> {
        let problem = &self.model.problem;
        let fitted = |(o, weight): (usize, &f64)| {
            let held_out = self.model.is_held_out(self.model.observations[o].sample);
            f64::from(u8::from(*weight > 0.0 && !held_out))
        };
        let mask: Vec<f64> = self.weights.iter().enumerate().map(fitted).collect();
        let mut sums = vec![(0.0, 0.0, 0.0); problem.measurements.len()];
        let mut work = Workspace::new(&self.model);
        work.cache.update(problem, &self.values);
        let state = State::new(problem, &work.cache, &self.values);
        for sample in self.looked_at().samples {
            let rows = &mut work.rows;
            rows.fill(&self.model, state, &mask, sample, Derivatives::None);
            for &(o, first, _) in &rows.blocks {
                let o = self.model.observations[o];
                let kind = &problem.measurements[o.measurement].kind;
                let MeasurementKind::Poses(poses) = kind else {
                    continue;
                };
                if !matches!(poses.noise, PoseNoise::Split { .. }) {
                    continue;
                }
                let three = |at: usize| kind.stated(o.item, &rows.r[first + at..]);
                let (angles, lengths) = (three(0), three(3));
                let lever = poses.observations[o.item].pose.inverse().translation.vector;
                let others = lengths + angles.cross(&lever);
                let (n, own, other) = &mut sums[o.measurement];
                *n += 1.0;
                *own += lengths.norm_squared();
                *other += others.norm_squared();
            }
        }
        let sums = sums.into_iter().enumerate();
        let seen = sums.filter(|(_, (n, own, other))| *n > 0.0 && *own > 0.0 && *other > 0.0);
        seen.map(|(m, (n, own, other))| (MeasurementId::of(m), 1.5 * n * f64::ln(own / other)))
            .collect()
    }
}
