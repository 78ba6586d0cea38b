//! A study of estimators as units of work that do not depend on each other: pieces of its scenes. Other machines can make them.

use std::ops::Range;

use crate::{
    cell::Cell,
    experiment::Experiment,
    pieces::{Sums, cells, pieces, sums},
    run::{StudyResult, plan, result},
    settings::{Study, StudyError, StudyOptions},
    tried::Tried,
};

/// The pieces of all scenes of a study.
pub struct Units<'a> {
    study: Study,
    tried: &'a Tried,
    options: &'a StudyOptions,
    plan: Vec<Box<dyn Experiment>>,
    /// Scene, and its trials.
    units: Vec<(usize, Range<u64>)>,
}

impl<'a> Units<'a> {
    /// The pieces, the scenes in the order of the report.
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
        let plan = plan(study, tried);
        let pieces = plan
            .iter()
            .map(|e| pieces(e.trials(options.trials), options.trials));
        let numbered = pieces.enumerate();
        let of = |(scene, all): (usize, Vec<Range<u64>>)| all.into_iter().map(move |p| (scene, p));
        let units = numbered.flat_map(of).collect();
        Ok(Self {
            study,
            tried,
            options,
            plan,
            units,
        })
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.units.len() as u64
    }

    /// Everything that the results depend on besides their number, as one text.
    #[must_use]
    pub fn settings(&self) -> String {
        let plugins = self.tried.names().join(", ");
        format!("{} trials, plugins: {plugins}", self.options.trials)
    }

    /// Scene, first and last trial from 1, and the sums; `None` beyond the last.
    #[must_use]
    pub fn one(&self, unit: u64) -> Option<(String, Sums)> {
        let place = usize::try_from(unit).ok()?;
        let (scene, trials) = self.units.get(place)?;
        let experiment = self.plan[*scene].as_ref();
        let id = experiment.scene().id();
        let name = format!("{id}, trials {} to {}", trials.start + 1, trials.end);
        let made = sums(experiment, self.options.seed, trials, &|_| {});
        Some((name, made))
    }

    /// The study from the sums of all units, in their order: what [`run_with`](crate::run_with) gives. One scene's are held at a time.
    ///
    /// # Errors
    /// Those of `made`.
    pub fn result<E>(&self, made: impl Iterator<Item = Result<Sums, E>>) -> Result<StudyResult, E> {
        let mut left = self.units.iter().zip(made).peekable();
        let mut all: Vec<Vec<Cell>> = Vec::with_capacity(self.plan.len());
        for (scene, experiment) in self.plan.iter().enumerate() {
            let own = std::iter::from_fn(|| left.next_if(|((of, _), _)| *of == scene));
            let own: Vec<Sums> = own.map(|(_, sums)| sums).collect::<Result<_, E>>()?;
            all.push(cells(experiment.as_ref(), own.iter()));
        }
        Ok(result(self.study, self.tried, self.options, all))
    }
}
