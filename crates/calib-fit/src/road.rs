//! From a table and flags to an estimator, the same for centers and axes.

use calib_estimator::{
    Estimate, EstimatorError, EstimatorInfo, Input, InputKind, OptionId, Options, Outcome,
};
use nalgebra::{Point3, Unit};

use crate::{FitError, TableRequest, data, table::Table, unknown, usage};

/// The options that a request and its table state.
pub(crate) fn options(request: &TableRequest, table: &Table) -> Result<Options, FitError> {
    if request.towards.is_some_and(|d| d.norm() == 0.0) {
        return Err(usage(
            "--towards 0,0,0 has no direction",
            "name a side, like 0,0,1",
        ));
    }
    Ok(Options {
        sigma_t: request.sigma_m,
        sigma_r: request.sigma_rad,
        covariances: table.covariances.clone(),
        weights: table.weights.clone(),
        noise_per_marker: request.noise_per_marker,
        center: request.center_m,
        angles: table.angles.clone(),
        towards: request.towards.and_then(|d| Unit::try_new(d, 0.0)),
        ..Options::default()
    })
}

/// What the user wrote to set an option.
fn flag(option: OptionId) -> &'static str {
    match option {
        OptionId::SigmaT => "--sigma-mm",
        OptionId::SigmaR => "--sigma-deg",
        OptionId::Covariances => "the covariance of samples (--covariances, --sigma-sight-mm)",
        OptionId::Weights => "--weights",
        OptionId::NoisePerMarker => "--noise-per-marker",
        OptionId::Center => "--center-m",
        OptionId::Angles => "--joint",
        OptionId::Towards => "--towards",
        other => other.name(),
    }
}

/// A table of measurements with its options, ready for any estimator of one kind.
pub(crate) struct Road<'a, E: Estimate + 'static> {
    pub table: &'a Table,
    pub tracks: &'a [Vec<Option<Point3<f64>>>],
    pub options: &'a Options,
    pub estimators: &'static [EstimatorInfo<E>],
    /// The command, for messages.
    pub command: &'static str,
}

impl<E: Estimate> Road<'_, E> {
    /// Runs one estimator on the form of the table that it prefers.
    pub fn run(&self, info: &EstimatorInfo<E>) -> Result<Outcome<E>, EstimatorError> {
        info.run(&self.input(info.input), self.options)
    }

    /// Runs one estimator with those of the options that it uses.
    pub fn run_with_its_own(&self, info: &EstimatorInfo<E>) -> Result<Outcome<E>, EstimatorError> {
        info.run(&self.input(info.input), &self.options.only(info.options))
    }

    fn input(&self, kind: InputKind) -> Input<'_> {
        let markers = if self.table.origin_only {
            Input::Points(self.tracks)
        } else {
            Input::Markers(self.tracks)
        };
        let given = |shape: &InputKind| match (shape, &self.table.body, &self.table.pair) {
            (InputKind::TwoBodies, _, Some([parent, child])) => {
                Some(Input::TwoBodies { parent, child })
            }
            (InputKind::Poses, Some(poses), _) => Some(Input::Poses(poses)),
            (shape, ..) => (*shape == markers.kind()).then_some(markers),
        };
        kind.shapes().iter().find_map(given).unwrap_or(markers)
    }

    /// Some estimator uses every option that was given; otherwise the first that none uses is refused.
    pub fn check(&self) -> Result<(), FitError> {
        match self
            .options
            .given()
            .into_iter()
            .find(|o| self.users(*o).is_empty())
        {
            Some(option) => Err(self.not_used(None, option)),
            None => Ok(()),
        }
    }

    fn users(&self, option: OptionId) -> Vec<&'static str> {
        let uses = self
            .estimators
            .iter()
            .filter(|e| e.options.contains(&option));
        uses.map(|e| e.id).collect()
    }

    fn not_used(&self, id: Option<&str>, option: OptionId) -> FitError {
        let users = self.users(option);
        let remedy = if users.is_empty() {
            match self.command {
                "calib fit cor" => {
                    "leave it out, or use calib fit aor, whose estimators take more options"
                }
                _ => "leave it out",
            }
            .to_owned()
        } else {
            format!(
                "leave it out, or name one that uses it: --estimator {}",
                users.join(", ")
            )
        };
        let finding = match id {
            Some(id) => format!("`{id}` does not use {}", flag(option)),
            None => format!("no estimator of `{}` uses {}", self.command, flag(option)),
        };
        usage(finding, remedy)
    }

    /// Why an estimator did not run, in terms of the command.
    pub fn refusal(&self, id: &str, error: &EstimatorError) -> FitError {
        match error {
            EstimatorError::Unknown { id, known, .. } => unknown(id, known, self.command),
            EstimatorError::WrongInput { .. } => self.table.wrong_input(id, error, self.command),
            EstimatorError::Ignored { option, .. } => self.not_used(Some(id), *option),
            EstimatorError::BadOption { .. } => usage(error.to_string(), "correct the option"),
            _ => data(
                &self.table.file,
                error.to_string(),
                "correct or remove the row",
            ),
        }
    }
}
