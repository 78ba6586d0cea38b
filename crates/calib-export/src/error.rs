//! What stops a prediction, a correction or an export.

use calib_model::ModelError;

/// Why nothing was computed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The model file cannot be opened.
    #[error(
        "{file}: cannot be read: {source}\n  help: {}",
        instead(model.as_deref())
    )]
    Open {
        /// The file.
        file: String,
        /// The model file in it, where it is a folder of results.
        model: Option<String>,
        /// Why.
        source: std::io::Error,
    },
    /// The model file is wrong.
    #[error(
        "{file}: {source}\n  help: give the `<robot>.calibrated.model.json` that `calib run` wrote"
    )]
    Model {
        /// The file.
        file: String,
        /// Where and why.
        source: Box<ModelError>,
    },
    /// A plugin computes an effect of the robot.
    #[error(
        "{file}: {source}\n  help: `calib predict` and `calib correct` take the plugin with `--plugin`; other formats cannot hold its effect"
    )]
    Plugin {
        /// The file.
        file: String,
        /// Which effect of which plugin.
        source: Box<ModelError>,
    },
    /// The table cannot be read.
    #[error(transparent)]
    Table(#[from] calib_recording::Error),
    /// The table has several clocks.
    #[error("{file}: {source}\n  help: give a table with one row for each posture")]
    NotOneTable {
        /// The file.
        file: String,
        /// Why.
        source: calib_recording::NotOneTable,
    },
    /// A column is not what the robot has.
    #[error("{file}: {found} {what}\n  help: {remedy}")]
    Column {
        /// The file.
        file: String,
        /// The column.
        found: String,
        /// What is wrong with it.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// A name that the robot does not have.
    #[error("{name} is not a link, body or point of this robot\n  help: it has {known}")]
    Name {
        /// As given.
        name: String,
        /// What there is.
        known: String,
    },
    /// A tool that the robot does not have.
    #[error("{name} is not a link or point of this robot\n  help: it has {known}")]
    Tool {
        /// As given.
        name: String,
        /// What there is.
        known: String,
    },
    /// A row cannot be computed.
    #[error("{file}: line {line}: {source}\n  help: correct the row, or remove it")]
    Row {
        /// The file.
        file: String,
        /// From 1.
        line: u64,
        /// Why.
        source: Box<ModelError>,
    },
    /// Too few postures to fit and to state an error of.
    #[error(
        "the region has fewer than two postures\n  help: give a table of the postures where the robot is used; every second one is kept for the error"
    )]
    Region,
    /// A target that cannot hold this robot.
    #[error("{target} cannot hold this robot: {reason}\n  help: {remedy}")]
    Unfit {
        /// The target.
        target: &'static str,
        /// Why.
        reason: String,
        /// What to do.
        remedy: &'static str,
    },
}

/// What to give in place of what cannot be read.
fn instead(model: Option<&str>) -> String {
    model.map_or_else(
        || "give the `<robot>.calibrated.model.json` that `calib run` wrote".to_owned(),
        |model| format!("give the model file in this folder: `{model}`"),
    )
}

impl ExportError {
    /// File and, where there is one, line of what is wrong.
    #[must_use]
    pub fn place(&self) -> Option<(&str, Option<u64>)> {
        match self {
            Self::Open { file, .. }
            | Self::Plugin { file, .. }
            | Self::NotOneTable { file, .. }
            | Self::Column { file, .. } => Some((file, None)),
            Self::Model { file, source } => match &**source {
                ModelError::Syntax { line, .. } => Some((file, Some(*line as u64))),
                _ => Some((file, None)),
            },
            Self::Row { file, line, .. } => Some((file, Some(*line))),
            Self::Table(_)
            | Self::Name { .. }
            | Self::Tool { .. }
            | Self::Region
            | Self::Unfit { .. } => None,
        }
    }
}
