//! The study of faults as units of work that do not depend on each other: its cases. Other machines can make them.

use super::case::Cell;
use super::outcome::{CaseResult, run_case};
use super::run::{FaultResult, plan, result};
use super::settings::FaultOptions;
use crate::settings::StudyError;

/// The cases of the study.
pub struct Units<'a> {
    options: &'a FaultOptions,
    plan: Vec<(Cell, u64)>,
}

impl<'a> Units<'a> {
    /// The cases in the order of the matrix.
    ///
    /// # Errors
    /// [`StudyError::NoTrials`].
    pub fn new(options: &'a FaultOptions) -> Result<Self, StudyError> {
        if options.cases == 0 {
            return Err(StudyError::NoTrials { got: 0 });
        }
        let plan = plan(options);
        Ok(Self { options, plan })
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.plan.len() as u64
    }

    /// Everything that the results depend on besides their number, as one text.
    #[must_use]
    pub fn settings(&self) -> String {
        format!("{} cases of each cell", self.options.cases)
    }

    /// Name and result of a case; `None` beyond the last.
    #[must_use]
    pub fn one(&self, unit: u64) -> Option<(String, CaseResult)> {
        let place = usize::try_from(unit).ok()?;
        let (cell, number) = *self.plan.get(place)?;
        let result = run_case(cell, number, self.options.seed);
        Some((format!("{} {number}", cell.id()), result))
    }

    /// The study from all cases, in their order: what [`run_faults`](super::run_faults) gives.
    #[must_use]
    pub fn result(&self, results: Vec<CaseResult>) -> FaultResult {
        result(self.options, results)
    }
}
