//! What single samples tell about the free parameters, and how a frame follows them, before anything was measured.
//!
//! ```text
//! A_s = J_sᵀ V_s⁻¹ J_s = Y_sᵀ Y_s,   Y_s = L_s⁻¹ J_s,   V_s = L_s L_sᵀ                    (1)
//! p(s; x ⊞ δ) = p(s; x) + G_s δ                                                           (2)
//! ```
//!
//! J, V and G are those of the fit: at a posture that nobody has recorded yet, the sample states the joint readings and which
//! markers would be seen. The measured values do not enter Y.

use std::ops::Range;

use nalgebra::{DMatrix, Point3};

use crate::analysis::spread::LinearPoint;
use crate::graph::error::Error;
use crate::graph::ids::FrameId;
use crate::model::cache::{EdgeCache, State};
use crate::model::derived::Target;
use crate::model::layout::Model;
use crate::model::path::Derivatives;
use crate::model::values::Values;
use crate::solve::rows::SampleRows;

impl Model {
    /// Y of equation (1) for each of some samples: rows × free parameters, in σ per unit of the parameter (rad, m, …). A sample
    /// without observations has no rows.
    ///
    /// `variances`: σ² of each noise group, in the order of [`Problem::groups`](crate::Problem::groups). `None` where a covariance
    /// is not positive definite.
    #[must_use]
    pub fn whitened_rows(
        &self,
        values: &Values,
        variances: &[f64],
        samples: Range<usize>,
    ) -> Option<Vec<DMatrix<f64>>> {
        let cache = self.cache_at(values);
        let at = State::new(&self.problem, &cache, values);
        let weights = vec![1.0; self.observations.len()];
        let mut rows = SampleRows::new(self);
        let of_sample = |sample: usize| {
            rows.fill(self, at, &weights, sample, Derivatives::All);
            rows.covariance(self, &weights, variances);
            rows.factor()?;
            rows.whiten(true);
            let whitened = DMatrix::from_row_slice(rows.m, rows.n, &rows.j[..rows.m * rows.n]);
            whitened.iter().all(|x| x.is_finite()).then_some(whitened)
        };
        samples.map(of_sample).collect()
    }

    /// A target as seen from `from` at each of some samples: equation (2). Of a point, its own coordinates are among the parameters.
    ///
    /// # Errors
    /// [`Error::NoPath`] between the frames.
    pub fn linear_points(
        &self,
        values: &Values,
        (from, target): (FrameId, Target),
        samples: Range<usize>,
    ) -> Result<Vec<LinearPoint>, Error> {
        let (to, point) = match target {
            Target::Frame(frame) => (frame, None),
            Target::Point(id) => (self.problem.points[id.index()].frame, Some(id.index())),
        };
        let place = point.map_or_else(Point3::origin, |p| self.point_position(p, values));
        let own = point.and_then(|p| self.problem.points[p].parameters);
        let path = self.compile_between(from, to, values)?;
        let cache = self.cache_at(values);
        let at = State::new(&self.problem, &cache, values);
        let mut buffer = path.buffer();
        let of_sample = |sample: usize| {
            let pose = path.evaluate(at, sample, Derivatives::All, &mut buffer);
            let mut jacobian = DMatrix::zeros(3, self.free());
            for (&column, twist) in path.columns.iter().zip(&buffer.columns) {
                // ∂(R p + t) = R (ω × p + v) of the body twist [ω; v]
                let (w, v) = (twist.fixed_rows::<3>(0), twist.fixed_rows::<3>(3));
                let moved = pose.r * (w.cross(&place.coords) + v);
                jacobian.column_mut(column).copy_from(&moved);
            }
            for (k, parameter) in own.into_iter().flatten().enumerate() {
                // ∂(R p + t)/∂p_k = R e_k
                if let Some(column) = self.column_of[parameter.index()] {
                    let mut column = jacobian.column_mut(column);
                    column += pose.r.column(k);
                }
            }
            LinearPoint {
                position: Point3::from(pose.r * place.coords + pose.t),
                jacobian,
            }
        };
        Ok(samples.map(of_sample).collect())
    }

    fn cache_at(&self, values: &Values) -> EdgeCache {
        let mut cache = EdgeCache::new(&self.problem, self.trig.clone());
        cache.update(&self.problem, values);
        cache
    }
}
