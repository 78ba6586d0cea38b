//! What can be wrong with a problem before any estimate is made.

use thiserror::Error;

/// A problem that cannot be stated. "The data cannot answer" is not here: that is a result.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// No chain of edges joins the two frames.
    #[error("no path from frame `{from}` to frame `{to}`")]
    NoPath {
        /// Start.
        from: String,
        /// End.
        to: String,
    },
    /// A path was given edge by edge and its frames do not meet.
    #[error(
        "path of `{measurement}`: edge `{edge}` begins at frame `{found}` where `{expected}` was reached"
    )]
    BrokenPath {
        /// The measurement.
        measurement: String,
        /// The edge.
        edge: String,
        /// Where the edge begins.
        found: String,
        /// Where the path was.
        expected: String,
    },
    /// A per-sample array has another length than the problem has samples.
    #[error("`{what}` has {found} entries for {expected} samples")]
    Length {
        /// The array.
        what: String,
        /// Its length.
        found: usize,
        /// Number of samples.
        expected: usize,
    },
    /// A number is NaN or infinite.
    #[error("`{what}` is not finite at sample {sample}")]
    NotFinite {
        /// The array.
        what: String,
        /// The sample (0 for constants).
        sample: usize,
    },
    /// A sample index is past the end.
    #[error("`{what}` names sample {sample} of {samples}")]
    NoSuchSample {
        /// The measurement.
        what: String,
        /// The index.
        sample: usize,
        /// Number of samples.
        samples: usize,
    },
    /// A marker belongs to another frame than the one measured.
    #[error(
        "point `{point}` is fixed in frame `{found}`, measurement `{measurement}` is of frame `{expected}`"
    )]
    PointFrame {
        /// The measurement.
        measurement: String,
        /// The point.
        point: String,
        /// Its frame.
        found: String,
        /// The measurement's frame.
        expected: String,
    },
    /// A σ, scale or covariance that is not positive.
    #[error("`{what}` must be positive and finite, got {value}")]
    NotPositive {
        /// What.
        what: String,
        /// Its value.
        value: f64,
    },
    /// A parameter starts outside its bounds, or the bounds are crossed.
    #[error("parameter `{name}` starts at {start} outside its bounds [{lower}, {upper}]")]
    OutOfBounds {
        /// Parameter.
        name: String,
        /// Start.
        start: f64,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// A prediction was asked along an edge that has a value only at recorded samples.
    #[error("edge `{edge}` is measured per sample: it has no value at a new configuration")]
    PerSample {
        /// The edge.
        edge: String,
    },
    /// The model gives no finite residuals at the start values.
    #[error("the model cannot be evaluated at its start values")]
    NotEvaluable,
    /// There is nothing to fit to.
    #[error("the problem has no observations")]
    NoObservations,
    /// Observations were to be kept as in the solution of a problem with other measurements.
    #[error("the measurements are not those of the solution whose observations are to be kept")]
    OtherMeasurements,
    /// A fit was to begin at the solution of a problem with other parameters or noise groups.
    #[error("the parameters and noise groups are not those of the solution to begin at")]
    OtherParameters,
    /// A builder call on an edge of another kind.
    #[error("`Problem::{call}` was called on edge `{edge}`, which is not {expected}")]
    WrongEdge {
        /// The method.
        call: &'static str,
        /// The edge.
        edge: String,
        /// What the edge must be.
        expected: &'static str,
    },
    /// An effect was freed without the regressor that it needs.
    #[error(
        "`{what}` needs its regressor for every sample: free it with `Problem::free_effect_with`"
    )]
    NoRegressor {
        /// Joint and effect.
        what: String,
    },
    /// A parameter has bounds, and the crate was built without the solver for them.
    #[error("parameter `{name}` has bounds: build calib-core with the feature `clarabel`")]
    BoundsNotBuilt {
        /// The parameter.
        name: String,
    },
    /// Two frames have one name.
    #[error("two frames are called `{name}`")]
    DuplicateFrame {
        /// The name.
        name: String,
    },
    /// Two parameters have one name.
    #[error("two parameters are called `{name}`")]
    DuplicateName {
        /// The name.
        name: String,
    },
}
