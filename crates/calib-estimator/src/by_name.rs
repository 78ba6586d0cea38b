//! The registry: built-in estimators and those of plugins, of all kinds, called by name.
//!
//! Profiles name estimators; code calls the typed functions of the estimators' crates. What comes back by name is the part of an
//! estimate that every estimator has, whoever wrote it.

use std::collections::BTreeMap;

use calib_geometry::Line;
use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix6, Point3};

use crate::{
    error::EstimatorError,
    input::{Input, InputKind},
    options::{OptionId, Options},
    outcome::{Estimate, Outcome},
    parameter::{self, Parameter, ParameterError, Parameters},
    registry::{EstimatorInfo, Kind},
    verdict::Verdict,
};

/// A center of rotation, by name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CenterFit {
    /// In the tracker's frame, m.
    pub center: Point3<f64>,
    /// Its covariance, m²; `None` when the estimator gives none.
    pub covariance: Option<Matrix3<f64>>,
}

/// An axis of rotation, by name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisFit {
    /// In the tracker's frame.
    pub line: Line,
    /// Over `[direction; point]` (rad, m); `None` when the estimator gives none.
    pub covariance: Option<Matrix6<f64>>,
}

/// The frame of a joint, by name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameFit {
    /// The joint's frame in the body.
    pub body_from_joint: Isometry3<f64>,
    /// Over `[ω; v]` (rad, m) in the joint's frame; `None` when the estimator gives none.
    pub covariance: Option<Matrix6<f64>>,
}

/// The transforms of `A X = Z B`, by name.
#[derive(Debug, Clone, PartialEq)]
pub struct HandEyeFit {
    /// X.
    pub x: Isometry3<f64>,
    /// Z.
    pub z: Isometry3<f64>,
    /// 12 × 12 over the right perturbations of X and Z; `None` when the estimator gives none.
    pub covariance: Option<DMatrix<f64>>,
}

/// What an estimator answers by name.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Answer<F> {
    /// Determined by the data.
    Found(F),
    /// Determined only badly, or not at all.
    NotObservable {
        /// The verdict, where the estimator gives one.
        verdict: Option<Verdict>,
        /// The reason, with numbers.
        reason: String,
    },
}

/// What an estimator is and takes.
#[derive(Debug, Clone, PartialEq)]
pub struct About {
    /// How a profile names it.
    pub id: String,
    /// One line.
    pub summary: String,
    /// Publication or document; may be empty.
    pub source: String,
    /// The plugin that offers it and its version; `None`: built in.
    pub plugin: Option<(String, String)>,
    /// The data it takes.
    pub shapes: Vec<InputKind>,
    /// What it uses of that which is known of a recording.
    pub options: Vec<OptionId>,
    /// What a profile can set.
    pub parameters: Vec<Parameter>,
}

impl About {
    /// Where it comes from.
    #[must_use]
    pub fn origin(&self) -> String {
        match &self.plugin {
            None => "built in".to_owned(),
            Some((plugin, version)) => format!("from plugin `{plugin}` {version}"),
        }
    }
}

/// An estimator that can be called by name.
pub trait Named<F>: Send + Sync {
    /// What it is and takes.
    fn about(&self) -> &About;

    /// Runs it. Options that it does not use are left aside: they say what is known of the recording. Parameters that it does not have
    /// are refused: they say what the user wants.
    ///
    /// # Errors
    /// [`EstimatorError`] for data that it does not take, parameters that it does not have, and failures.
    fn fit(
        &self,
        input: &Input<'_>,
        options: &Options,
        parameters: &Parameters,
    ) -> Result<Answer<F>, EstimatorError>;
}

/// A built-in estimator.
struct BuiltIn<E: Estimate + 'static> {
    about: About,
    info: &'static EstimatorInfo<E>,
}

impl<E: Estimate, F> Named<F> for BuiltIn<E>
where
    E: Clone + Into<F>,
{
    fn about(&self) -> &About {
        &self.about
    }

    fn fit(
        &self,
        input: &Input<'_>,
        options: &Options,
        parameters: &Parameters,
    ) -> Result<Answer<F>, EstimatorError> {
        let refused = |problem: ParameterError| EstimatorError::Parameter {
            id: self.about.id.clone(),
            problem,
        };
        let mut options = options.only(self.info.options);
        for (name, value) in
            parameter::given(&self.about.parameters, parameters).map_err(refused)?
        {
            for option in self.info.options {
                if parameter::parameter(*option).is_some_and(|p| p.name == name) {
                    parameter::set(&mut options, *option, &value);
                }
            }
        }
        let outcome = self.info.run(input, &options)?;
        Ok(match outcome {
            Outcome::Estimate(e) if e.verdict() == Verdict::Ok => Answer::Found((*e).into()),
            Outcome::Estimate(e) => Answer::NotObservable {
                verdict: None,
                reason: e.reason().unwrap_or_default().to_owned(),
            },
            Outcome::NotObservable(n) => Answer::NotObservable {
                verdict: Some(n.verdict),
                reason: n.reason,
            },
        })
    }
}

/// The estimators of one kind, by name.
pub struct Table<F> {
    kind: Kind,
    entries: BTreeMap<String, Box<dyn Named<F>>>,
}

impl<F> Table<F> {
    fn new(kind: Kind) -> Self {
        Self {
            kind,
            entries: BTreeMap::new(),
        }
    }

    /// Adds one.
    ///
    /// # Errors
    /// [`EstimatorError::Taken`] when the name is in use.
    pub fn register(&mut self, it: Box<dyn Named<F>>) -> Result<(), EstimatorError> {
        let id = it.about().id.clone();
        if let Some(first) = self.entries.get(&id) {
            return Err(EstimatorError::Taken {
                kind: self.kind,
                first: first.about().origin(),
                second: it.about().origin(),
                id,
            });
        }
        self.entries.insert(id, it);
        Ok(())
    }

    /// Adds the built-in estimators of a crate.
    ///
    /// # Errors
    /// [`EstimatorError::Taken`] when a name is in use.
    pub fn built_in<E>(&mut self, table: &'static [EstimatorInfo<E>]) -> Result<(), EstimatorError>
    where
        E: Estimate + Clone + Into<F> + 'static,
    {
        table.iter().try_for_each(|info| {
            let about = About {
                id: info.id.to_owned(),
                summary: info.summary.to_owned(),
                source: info.source.to_owned(),
                plugin: None,
                shapes: info.input.shapes().to_vec(),
                options: info.options.to_vec(),
                parameters: info
                    .options
                    .iter()
                    .filter_map(|o| parameter::parameter(*o))
                    .collect(),
            };
            self.register(Box::new(BuiltIn { about, info }))
        })
    }

    /// The one of this name.
    ///
    /// # Errors
    /// [`EstimatorError::Unknown`] with the names of the table.
    pub fn get(&self, id: &str) -> Result<&dyn Named<F>, EstimatorError> {
        match self.entries.get(id) {
            Some(entry) => Ok(entry.as_ref()),
            None => Err(EstimatorError::Unknown {
                kind: self.kind,
                id: id.to_owned(),
                known: self.entries.keys().cloned().collect(),
            }),
        }
    }

    /// All, by name.
    pub fn iter(&self) -> impl Iterator<Item = &About> {
        self.entries.values().map(|e| e.about())
    }
}

/// The estimators of all kinds.
pub struct Registry {
    /// Of a center.
    pub centers: Table<CenterFit>,
    /// Of an axis.
    pub axes: Table<AxisFit>,
    /// Of a frame.
    pub frames: Table<FrameFit>,
    /// Of hand-eye transforms.
    pub hand_eyes: Table<HandEyeFit>,
}

impl Default for Registry {
    /// Empty.
    fn default() -> Self {
        Self {
            centers: Table::new(Kind::Center),
            axes: Table::new(Kind::Axis),
            frames: Table::new(Kind::Frame),
            hand_eyes: Table::new(Kind::HandEye),
        }
    }
}

impl std::fmt::Debug for Registry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Registry").finish_non_exhaustive()
    }
}
