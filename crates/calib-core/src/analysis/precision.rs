//! How near the minimum a fit ends: that of a result, and that of a trial.

/// How near the minimum a fit ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Precision {
    /// Noise levels have settled when log σ² changes by less than this.
    pub settled: f64,
    /// Decrement while outliers are still being decided.
    pub between_rounds: f64,
    /// Decrement from one round of the noise levels to the next: sums of squares do not change in the first order at the minimum.
    pub between_levels: f64,
    /// Decrement of the last round, at least.
    pub last: f64,
}

/// Of a result: levels to 0.05 %, values to 1e-3 σ and 1e-2 σ on the way, and in the end as the settings say.
pub(crate) const FULL: Precision = Precision {
    settled: 1e-3,
    between_rounds: 1e-6,
    between_levels: 1e-4,
    last: 0.0,
};
/// Of a trial, which only tells how well a model predicts: levels to 2.5 %, values to 1e-2 σ.
pub(crate) const ROUGH: Precision = Precision {
    settled: 5e-2,
    between_rounds: 1e-3,
    between_levels: 1e-3,
    last: 1e-4,
};
