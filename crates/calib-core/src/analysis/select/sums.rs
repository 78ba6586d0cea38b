//! Sums over samples that a linearized fit rests on.

use nalgebra::{DMatrix, DVector};

use crate::analysis::select::sample::Sample;

/// Sums over samples.
pub(super) struct Sums {
    pub h: DMatrix<f64>,
    pub g: DVector<f64>,
    pub rows: f64,
    pub squares: f64,
    pub count: usize,
    pub samples: Vec<Sample>,
}

impl Sums {
    pub(super) fn new(n: usize) -> Self {
        Self {
            h: DMatrix::zeros(n, n),
            g: DVector::zeros(n),
            rows: 0.0,
            squares: 0.0,
            count: 0,
            samples: Vec::new(),
        }
    }

    /// Of some samples: their A and w.
    pub(super) fn of(n: usize, samples: &[(&DMatrix<f64>, &DVector<f64>)]) -> Self {
        let rows = samples.iter().map(|(_, w)| w.len()).sum();
        let mut a = DMatrix::zeros(rows, n);
        let mut w = DVector::zeros(rows);
        let mut first = 0;
        for (own, own_w) in samples {
            a.rows_mut(first, own_w.len()).copy_from(own);
            w.rows_mut(first, own_w.len()).copy_from(own_w);
            first += own_w.len();
        }
        Self {
            h: a.transpose() * &a,
            g: a.tr_mul(&w),
            rows: rows as f64,
            squares: w.norm_squared(),
            count: samples.len(),
            samples: Vec::new(),
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.h += &other.h;
        self.g += &other.g;
        self.rows += other.rows;
        self.squares += other.squares;
        self.count += other.count;
    }

    pub(super) fn join(&mut self, other: Self) {
        self.add(&other);
        self.samples.extend(other.samples);
    }
}
