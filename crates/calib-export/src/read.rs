//! The model file.

use std::path::Path;

use calib_model::file::RobotModelFile;
use calib_model::{FindOutside, LinkId, Model, ModelError, Place};

use crate::error::ExportError;

/// Larger than any robot: covariance of 500 joints.
const LARGEST: u64 = 256 << 20;

/// A calibrated robot as a file and ready to be evaluated.
#[derive(Debug, Clone)]
pub struct Robot {
    /// What stands in the file.
    pub file: RobotModelFile,
    /// The same, for evaluation.
    pub model: Model,
}

/// Reads a model file.
///
/// # Errors
/// [`ExportError::Open`], [`ExportError::Model`].
pub fn robot(path: &Path) -> Result<Robot, ExportError> {
    robot_with(path, &|_, _| None)
}

/// The same with the effects that plugins compute: `outside` gives what computes an effect of the file.
///
/// # Errors
/// As [`robot`].
pub fn robot_with(path: &Path, outside: FindOutside<'_>) -> Result<Robot, ExportError> {
    let file = path.display().to_string();
    let bytes = calib_files::input::read(path, LARGEST).map_err(|source| ExportError::Open {
        file: file.clone(),
        source,
    })?;
    let read = RobotModelFile::from_json(&bytes);
    let read = read.and_then(|read| Robot::of(read, outside));
    read.map_err(|source| {
        let source = Box::new(source);
        match *source {
            ModelError::Plugin { .. } => ExportError::Plugin { file, source },
            _ => ExportError::Model { file, source },
        }
    })
}

impl Robot {
    /// From the text of a model file.
    ///
    /// # Errors
    /// [`ModelError`] with its place.
    pub fn from_json(bytes: &[u8]) -> Result<Self, ModelError> {
        Self::of(RobotModelFile::from_json(bytes)?, &|_, _| None)
    }

    /// From the contents of a model file, with the effects that plugins compute.
    fn of(file: RobotModelFile, outside: FindOutside<'_>) -> Result<Self, ModelError> {
        let model = Model::with_outside(&file, outside)?;
        Ok(Self { file, model })
    }

    /// A link, body or point by its name.
    pub(crate) fn place(&self, name: &str) -> Result<Place, ExportError> {
        self.model.place(name).ok_or_else(|| {
            let links = self.model.links().iter().map(String::as_str);
            let names = links.chain(self.model.bodies()).chain(self.model.points());
            ExportError::Name {
                name: name.to_owned(),
                known: names.collect::<Vec<_>>().join(", "),
            }
        })
    }

    /// The link that is named, or the last one.
    pub(crate) fn tool(&self, name: Option<&str>) -> Result<LinkId, ExportError> {
        let Some(name) = name else {
            return Ok(self.model.last_link());
        };
        self.model.link(name).map_err(|_| ExportError::Name {
            name: name.to_owned(),
            known: self.model.links().join(", "),
        })
    }
}
