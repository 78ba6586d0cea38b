//! What the passes over the samples share: the function to be minimized, the sums of its linearization, and the
//! memory that they reuse.

use nalgebra::{DMatrix, DVector};

use crate::model::cache::EdgeCache;
use crate::model::layout::Model;
use crate::model::values::Values;
use crate::solve::rows::SampleRows;

/// The function to be minimized, but for the values that it is taken at.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Objective<'a> {
    pub model: &'a Model,
    /// One weight per observation; 0: rejected.
    pub weights: &'a [f64],
    /// σ² per noise group.
    pub theta: &'a [f64],
}

/// H (upper triangle, row-major n × n), g, and twice F split into data and prior.
#[derive(Debug, Clone)]
pub(crate) struct NormalEquations {
    pub n: usize,
    pub h: Vec<f64>,
    pub g: Vec<f64>,
    pub data: f64,
    pub prior: f64,
}

impl NormalEquations {
    pub(crate) fn new(n: usize) -> Self {
        Self {
            n,
            h: vec![0.0; n * n],
            g: vec![0.0; n],
            data: 0.0,
            prior: 0.0,
        }
    }

    /// Those of a symmetric matrix and a gradient.
    pub(crate) fn of(h: &DMatrix<f64>, g: &DVector<f64>) -> Self {
        let n = g.len();
        let mut out = Self::new(n);
        for i in 0..n {
            for j in i..n {
                out.h[i * n + j] = h[(i, j)];
            }
            out.g[i] = g[i];
        }
        out
    }

    pub(crate) fn cost(&self) -> f64 {
        self.data + self.prior
    }
}

/// Everything that the passes over the samples need; allocated once.
#[derive(Debug, Clone)]
pub(crate) struct Workspace {
    pub cache: EdgeCache,
    pub rows: SampleRows,
    /// The same of each part of the model; none where they were not needed yet.
    pub parts: Vec<SampleRows>,
    /// The random part of every V_s at the last linearization, by chunks of samples, where random effects make V_s depend
    /// on the values: a step is judged by the same V_s that proposed it. (With V_s moving along, the
    /// cost would reward values that only make the noise look larger.)
    pub factors: Vec<Vec<f64>>,
    /// In place of `factors`, where there are so many samples that these would fill the memory: the values of the last linearization and the
    /// edges' poses at them.
    pub linearized: Option<(Values, EdgeCache)>,
}

impl Workspace {
    pub(crate) fn new(model: &Model) -> Self {
        Self::with(model, EdgeCache::new(&model.problem, model.trig.clone()))
    }

    /// With the edges' poses that are known already.
    pub(crate) fn with(model: &Model, cache: EdgeCache) -> Self {
        Self {
            cache,
            rows: SampleRows::new(model),
            parts: Vec::new(),
            factors: Vec::new(),
            linearized: None,
        }
    }
}
