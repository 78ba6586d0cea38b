//! The model file.

use std::path::Path;

use calib_model::file::{ModelJoint, ModelLink, ModelPose, RobotModelFile};
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
        model: model_in(path),
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

/// The only model file of a folder of results.
fn model_in(folder: &Path) -> Option<String> {
    /// How `calib run` ends the name of a model file.
    const END: &str = ".calibrated.model.json";
    let files = std::fs::read_dir(folder).ok()?.filter_map(Result::ok);
    let models = files.map(|file| file.path());
    let mut models = models.filter(|path| path.to_string_lossy().ends_with(END));
    let only = models.next()?;
    models.next().is_none().then(|| only.display().to_string())
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

    /// The link or point that is named, or the last link. A body is no tool: tables name its poses in the tracker.
    pub(crate) fn tool(&self, name: Option<&str>) -> Result<Place, ExportError> {
        let Some(name) = name else {
            return Ok(self.model.last_link().into());
        };
        let found = self.model.place(name);
        found
            .filter(|place| !matches!(place, Place::Body(_)))
            .ok_or_else(|| {
                let links = self.model.links().iter().map(String::as_str);
                ExportError::Tool {
                    name: name.to_owned(),
                    known: links
                        .chain(self.model.points())
                        .collect::<Vec<_>>()
                        .join(", "),
                }
            })
    }

    /// The same robot with a point of it as a link, fixed to the one that carries it.
    ///
    /// # Errors
    /// What is in the way.
    pub(crate) fn with_link(&self, point: &str) -> Result<(Self, LinkId), String> {
        let mut file = self.file.clone();
        let mut renamed = self.model.renamed().iter();
        let own = renamed.find(|(_, name)| name == point);
        let own = own.map_or(point, |(own, _)| own.as_str());
        let Some(at) = file.points.get(own).cloned() else {
            return Err(format!("it has no point {point}"));
        };
        let joint = format!("{point}_fixed");
        if file.joints.iter().any(|j| j.name == joint) {
            return Err(format!("it has a joint {joint} already"));
        }
        let origin = ModelPose {
            xyz_m: at.xyz_m,
            ..ModelPose::default()
        };
        file.joints.push(ModelJoint {
            name: joint,
            parent: at.link,
            child: point.to_owned(),
            parent_from_joint: origin,
            load_origin: origin,
            ..ModelJoint::default()
        });
        file.links.push(ModelLink {
            name: point.to_owned(),
            ..ModelLink::default()
        });
        let robot = Self::of(file, &|_, _| None).map_err(|e| e.to_string())?;
        let link = robot.model.link(point).map_err(|e| e.to_string())?;
        Ok((robot, link))
    }
}
