//! From data and flags to an estimator, the same for every kind of estimate.

use std::path::Path;

use calib_estimator::{
    Estimate, EstimatorError, EstimatorInfo, Input, InputKind, Kind, OptionId, Options, Outcome,
    Verdict, find,
};
use nalgebra::{Point3, Unit};

use crate::{
    FitError, TableRequest,
    answer::{Answer, listed, not_observable},
    comparison::{Found, Line, Quantity, comparison},
    data,
    table::Table,
    usage,
};

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

/// One command of `calib fit`: its estimators, and what `--all` compares of them.
pub(crate) struct Command<E: Estimate + 'static> {
    pub name: &'static str,
    pub kind: Kind,
    pub estimators: &'static [EstimatorInfo<E>],
    pub quantity: Quantity,
    pub found: fn(&E) -> Found,
}

/// What a request wants of the estimators of its command.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wish<'a> {
    pub estimator: Option<&'a str>,
    pub all: bool,
}

/// The measurements in the shapes that they have.
#[derive(Clone, Copy)]
pub(crate) enum Data<'a> {
    /// Markers, or a body, or both sides of a joint.
    Table(&'a Table, &'a [Vec<Option<Point3<f64>>>]),
    /// One shape only.
    Only(Input<'a>),
}

impl<'a> Data<'a> {
    /// The shape that estimators of this kind prefer.
    fn input(self, kind: InputKind) -> Input<'a> {
        let (table, tracks) = match self {
            Self::Only(input) => return input,
            Self::Table(table, tracks) => (table, tracks),
        };
        let markers = if table.origin_only {
            Input::Points(tracks)
        } else {
            Input::Markers(tracks)
        };
        let given = |shape: &InputKind| match (shape, &table.body, &table.pair) {
            (InputKind::TwoBodies, _, Some([parent, child])) => {
                Some(Input::TwoBodies { parent, child })
            }
            (InputKind::Poses, Some(poses), _) => Some(Input::Poses(poses)),
            (shape, ..) => (*shape == markers.kind()).then_some(markers),
        };
        kind.shapes().iter().find_map(given).unwrap_or(markers)
    }
}

impl<E: Estimate> Command<E> {
    /// The answer to `--list`.
    pub fn list(&self) -> Answer {
        listed(self.estimators)
    }

    fn users(&self, option: OptionId) -> Vec<&'static str> {
        let uses = self
            .estimators
            .iter()
            .filter(|e| e.options.contains(&option));
        uses.map(|e| e.id).collect()
    }
}

/// Measurements with their options, ready for any estimator of one command.
pub(crate) struct Road<'a, E: Estimate + 'static> {
    pub command: &'a Command<E>,
    /// Where the measurements come from, for messages.
    pub file: &'a Path,
    pub data: Data<'a>,
    pub options: &'a Options,
    /// What the data as a whole say against an estimate.
    pub against: &'a dyn Fn(&E) -> Option<String>,
}

impl<E: Estimate> Road<'_, E> {
    /// The answer of the estimator that is wanted, or of `preferred`; or all of them side by side.
    pub fn answer(
        &self,
        wish: Wish<'_>,
        preferred: impl Fn(&Self) -> &'static str,
        shown: impl Fn(&str, &E) -> Answer,
    ) -> Result<Answer, FitError> {
        self.check()?;
        if wish.all {
            let estimators = self.command.estimators.iter();
            let lines: Vec<Line> = estimators
                .filter_map(|info| Some(self.line(info, &self.run_with_its_own(info).ok()?)))
                .collect();
            return Ok(comparison(self.command.quantity, &lines));
        }
        let id = wish.estimator.unwrap_or_else(|| preferred(self));
        let outcome = find(self.command.kind, self.command.estimators, id)
            .and_then(|info| info.run(&self.data.input(info.input), self.options))
            .map_err(|e| self.refusal(id, &e))?;
        Ok(match &outcome {
            Outcome::Estimate(estimate) => shown(id, estimate),
            Outcome::NotObservable(why) => not_observable(id, why),
        })
    }

    /// Runs one estimator with those of the options that it uses.
    pub fn run_with_its_own(&self, info: &EstimatorInfo<E>) -> Result<Outcome<E>, EstimatorError> {
        let options = self.options.only(info.options);
        info.run(&self.data.input(info.input), &options)
    }

    fn line(&self, info: &EstimatorInfo<E>, outcome: &Outcome<E>) -> Line {
        let against = outcome.estimate().and_then(self.against);
        let verdict = match against {
            Some(_) => Verdict::Weak,
            None => outcome.verdict(),
        };
        Line {
            id: info.id,
            verdict: verdict.as_str(),
            reason: against.unwrap_or_else(|| outcome.reason().unwrap_or("").to_owned()),
            found: outcome.estimate().map(self.command.found),
        }
    }

    /// Some estimator uses every option that was given; otherwise the first that none uses is refused.
    fn check(&self) -> Result<(), FitError> {
        let given = self.options.given();
        match given
            .into_iter()
            .find(|o| self.command.users(*o).is_empty())
        {
            Some(option) => Err(self.not_used(None, option)),
            None => Ok(()),
        }
    }

    fn not_used(&self, id: Option<&str>, option: OptionId) -> FitError {
        let users = self.command.users(option);
        let elsewhere = commands_that_use(option);
        let remedy = if !users.is_empty() {
            format!(
                "remove it, or name an estimator that uses it: --estimator {}",
                users.join(", ")
            )
        } else if !elsewhere.is_empty() {
            format!(
                "remove it; estimators of `{}` use it",
                elsewhere.join("`, `")
            )
        } else {
            "remove it".to_owned()
        };
        let finding = match id {
            Some(id) => format!("`{id}` does not use {}", flag(option)),
            None => format!(
                "no estimator of `{}` uses {}",
                self.command.name,
                flag(option)
            ),
        };
        usage(finding, remedy)
    }

    /// Why an estimator did not run, in terms of the command.
    fn refusal(&self, id: &str, error: &EstimatorError) -> FitError {
        let command = self.command.name;
        match error {
            EstimatorError::Unknown { id, known, .. } => unknown(id, known, command),
            EstimatorError::WrongInput { .. } => match self.data {
                Data::Table(table, _) => table.wrong_input(id, error, command),
                Data::Only(_) => usage(
                    format!("`{id}`: {error}"),
                    format!("see `{command} --list`"),
                ),
            },
            EstimatorError::Ignored { option, .. } => self.not_used(Some(id), *option),
            EstimatorError::BadOption { .. } => usage(error.to_string(), "correct the option"),
            _ => data(self.file, error.to_string(), "correct or remove the row"),
        }
    }
}

/// The commands with an estimator that uses an option.
fn commands_that_use(option: OptionId) -> Vec<&'static str> {
    fn some<E: Estimate>(estimators: &[EstimatorInfo<E>], option: OptionId) -> bool {
        estimators.iter().any(|e| e.options.contains(&option))
    }
    let commands = [
        ("calib fit cor", some(calib_cor::estimators(), option)),
        ("calib fit aor", some(calib_aor::estimators(), option)),
        (
            "calib fit frame",
            some(calib_aor::frame_estimators(), option),
        ),
        (
            "calib fit handeye",
            some(calib_handeye::estimators(), option),
        ),
    ];
    let using = commands.into_iter().filter(|(_, uses)| *uses);
    using.map(|(name, _)| name).collect()
}

/// An estimator that does not exist, with the nearest that does.
fn unknown(id: &str, known: &[String], command: &str) -> FitError {
    let remedy = match calib_finding::nearest_word(id, known.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`? `{command} --list` shows them all"),
        None => format!("`{command} --list` shows what there is"),
    };
    usage(format!("there is no estimator `{id}`"), remedy)
}
