//! What is wrong with a model file or a call.

/// A model that cannot be read, or a call that cannot be answered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The text is not JSON of the expected shape.
    #[error("line {line}, column {column}: {problem}; expected a model file of calib")]
    Syntax {
        /// From 1.
        line: usize,
        /// From 1.
        column: usize,
        /// What the reader says.
        problem: String,
    },
    /// Another format version.
    #[error("calib_model: version {found}; this program reads version {expected}")]
    Version {
        /// In the file.
        found: u32,
        /// That can be read.
        expected: u32,
    },
    /// A value that cannot be used.
    #[error("{place}: found {found}; expected {expected}")]
    Value {
        /// Where, as `joints[2].axis`.
        place: String,
        /// What stands there.
        found: String,
        /// What should.
        expected: &'static str,
    },
    /// An effect that a plugin computes.
    #[error(
        "joint {joint}: its effect `{effect}` is computed by the plugin `{plugin}` {version}, which is not loaded; without it no pose of this robot is known"
    )]
    Plugin {
        /// The joint.
        joint: String,
        /// The effect.
        effect: String,
        /// The plugin.
        plugin: String,
        /// Its version.
        version: String,
    },
    /// A name that is not in the model.
    #[error("{kind} {name} is not in the model; it has {known}")]
    Name {
        /// link, body, point or joint.
        kind: &'static str,
        /// As asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// A slice of the wrong length.
    #[error("{what}: {found} numbers given, {expected} needed")]
    Length {
        /// Which.
        what: &'static str,
        /// Given.
        found: usize,
        /// Needed.
        expected: usize,
    },
    /// A number that is not finite.
    #[error("{what}[{index}] is not a finite number")]
    NotFinite {
        /// Which slice.
        what: &'static str,
        /// Where in it.
        index: usize,
    },
    /// The file has no covariance.
    #[error("the model has no uncertainty: its run estimated none")]
    NoUncertainty,
    /// The [`Work`](crate::Work) was made by another model.
    #[error("this working memory was made for another model")]
    ForeignWork,
}
