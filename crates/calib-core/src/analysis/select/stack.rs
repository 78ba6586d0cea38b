//! Rows of some samples in one matrix: one product with C in place of one for each of them.

use nalgebra::{Cholesky, DMatrix, DMatrixView, Dyn};

use crate::analysis::select::sample::Sample;

/// Samples whose rows are looked at together, for one model.
pub(super) struct Stack<'a> {
    pub samples: &'a [&'a Sample],
    /// First row of each sample, and the number of all.
    first: Vec<usize>,
    /// A_M.
    own: DMatrix<f64>,
    /// A_M C.
    along: DMatrix<f64>,
}

impl<'a> Stack<'a> {
    /// `active`: the columns of M; `c`: their C.
    pub(super) fn new(active: &[usize], c: &DMatrix<f64>, samples: &'a [&'a Sample]) -> Self {
        let mut first = vec![0];
        for s in samples {
            first.push(first[first.len() - 1] + s.w.len());
        }
        let mut own = DMatrix::zeros(first[samples.len()], active.len());
        for (s, &at) in samples.iter().zip(&first) {
            for (k, &column) in active.iter().enumerate() {
                let mut rows = own.view_mut((at, k), (s.w.len(), 1));
                rows.copy_from(&s.a.column(column));
            }
        }
        let along = &own * c;
        Self {
            samples,
            first,
            own,
            along,
        }
    }

    /// A_M of a sample.
    pub(super) fn own(&self, i: usize) -> DMatrixView<'_, f64, nalgebra::U1, Dyn> {
        self.own
            .rows(self.first[i], self.first[i + 1] - self.first[i])
    }

    /// A_M C of a sample.
    pub(super) fn along(&self, i: usize) -> DMatrix<f64> {
        let rows = self.first[i + 1] - self.first[i];
        self.along.rows(self.first[i], rows).into_owned()
    }

    /// I − Q of a sample, Q = A_M C A_Mᵀ.
    pub(super) fn remainder(&self, i: usize) -> DMatrix<f64> {
        let q = self.along(i) * self.own(i).transpose();
        DMatrix::identity(q.nrows(), q.nrows()) - q
    }

    /// (I − Q)⁻¹ of a sample; `None` where it alone determines something.
    pub(super) fn left_out(&self, i: usize) -> Option<DMatrix<f64>> {
        Self::inverse_of(self.remainder(i))
    }

    /// (I − Q)⁻¹; `None` where a direction has leverage 1.
    pub(super) fn inverse_of(remainder: DMatrix<f64>) -> Option<DMatrix<f64>> {
        // A direction of leverage 1 has no Cholesky factor, or a pivot of rounding.
        const LEVERAGE_LEFT: f64 = 1e-9;
        let factor = Cholesky::<f64, Dyn>::new(remainder)?;
        let least = factor.l_dirty().diagonal().min();
        (least * least > LEVERAGE_LEFT).then(|| factor.inverse())
    }
}
