//! All residuals and the whole Jacobian as dense matrices: for tests and for looking at small problems.

use nalgebra::{DMatrix, DVector};

use crate::model::cache::State;
use crate::model::layout::Model;
use crate::model::path::Derivatives;
use crate::model::values::Values;
use crate::solve::equations::Workspace;
use crate::solve::rows::SampleRows;

impl Model {
    /// Residuals `predicted ⊟ observed` of all observations, stacked in the order (sample, measurement, item);
    /// rad and m, not whitened.
    #[must_use]
    pub fn residuals(&self, values: &Values) -> DVector<f64> {
        let mut out = DVector::zeros(self.rows);
        self.each_sample(values, Derivatives::None, |first, rows| {
            out.rows_mut(first, rows.m)
                .copy_from_slice(&rows.r[..rows.m]);
        });
        out
    }

    /// ∂(residuals)/∂(free parameters), rows as in [`Model::residuals`], columns in the order of the free
    /// parameters. Dense: not for more than about 1e4 rows.
    #[must_use]
    pub fn jacobian(&self, values: &Values) -> DMatrix<f64> {
        let n = self.free();
        let mut out = DMatrix::zeros(self.rows, n);
        self.each_sample(values, Derivatives::All, |first, rows| {
            for i in 0..rows.m {
                for c in 0..n {
                    out[(first + i, c)] = rows.j[i * n + c];
                }
            }
        });
        out
    }

    /// ∂(residuals)/∂(random effects of the row's own sample), one column per effect.
    #[must_use]
    pub fn random_jacobian(&self, values: &Values) -> DMatrix<f64> {
        let k = self.slots.len();
        let mut out = DMatrix::zeros(self.rows, k);
        self.each_sample(values, Derivatives::All, |first, rows| {
            for i in 0..rows.m {
                for c in 0..k {
                    out[(first + i, c)] = rows.g[i * k + c];
                }
            }
        });
        out
    }

    fn each_sample(
        &self,
        values: &Values,
        wanted: Derivatives,
        mut see: impl FnMut(usize, &SampleRows),
    ) {
        let weights = vec![1.0; self.observations.len()];
        let mut work = Workspace::new(self);
        work.cache.update(&self.problem, values);
        let mut first = 0;
        for sample in 0..self.problem.samples {
            let at = State::new(&self.problem, &work.cache, values);
            work.rows.fill(self, at, &weights, sample, wanted);
            see(first, &work.rows);
            first += work.rows.m;
        }
    }
}
