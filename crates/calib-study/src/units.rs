//! A study of estimators as units of work that do not depend on each other: its scenes. Other machines can make them.

use crate::{
    cell::Cell,
    experiment::Experiment,
    run::{StudyResult, cells_of, plan, result},
    settings::{Study, StudyError, StudyOptions},
    tried::Tried,
};

/// The scenes of a study, each with all of its trials.
pub struct Units<'a> {
    study: Study,
    tried: &'a Tried,
    options: &'a StudyOptions,
    plan: Vec<Box<dyn Experiment>>,
}

impl<'a> Units<'a> {
    /// The scenes in the order of the report.
    ///
    /// # Errors
    /// [`StudyError::NoTrials`].
    pub fn new(
        study: Study,
        tried: &'a Tried,
        options: &'a StudyOptions,
    ) -> Result<Self, StudyError> {
        if options.trials == 0 {
            return Err(StudyError::NoTrials { got: 0 });
        }
        Ok(Self {
            study,
            tried,
            options,
            plan: plan(study, tried),
        })
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.plan.len() as u64
    }

    /// Everything that the results depend on besides their number, as one text.
    #[must_use]
    pub fn settings(&self) -> String {
        let plugins = self.tried.names().join(", ");
        format!("{} trials, plugins: {plugins}", self.options.trials)
    }

    /// Name and cells of a scene; `None` beyond the last.
    #[must_use]
    pub fn one(&self, unit: u64) -> Option<(String, Vec<Cell>)> {
        let place = usize::try_from(unit).ok()?;
        let experiment = self.plan.get(place)?;
        let id = experiment.scene().id();
        let cells = cells_of(experiment.as_ref(), &id, self.options, &|_| {});
        Some((id, cells))
    }

    /// The study from the cells of all scenes, in their order: what [`run_with`](crate::run_with) gives.
    #[must_use]
    pub fn result(&self, cells: Vec<Vec<Cell>>) -> StudyResult {
        result(self.study, self.tried, self.options, cells)
    }
}
