//! One table of estimators for each kind.

use crate::{
    error::EstimatorError,
    input::Input,
    kind::{InputKind, Kind},
    option_id::OptionId,
    options::Options,
    outcome::{Estimate, Outcome},
};

/// The entry point of an estimator.
pub type Fit<E> = fn(&Input<'_>, &Options) -> Result<Outcome<E>, EstimatorError>;

/// One built-in estimator.
#[derive(Debug)]
pub struct EstimatorInfo<E: Estimate> {
    /// Name in profiles and on the command line.
    pub id: &'static str,
    /// Its full name.
    pub name: &'static str,
    /// The data it needs.
    pub input: InputKind,
    /// The options it uses; any other one is refused.
    pub options: &'static [OptionId],
    /// What it does, in a line.
    pub summary: &'static str,
    /// Where it was published.
    pub source: &'static str,
    /// The function.
    pub fit: Fit<E>,
}

impl<E: Estimate> EstimatorInfo<E> {
    /// Runs it.
    ///
    /// # Errors
    /// [`EstimatorError`] for data of another kind, data that are not finite, or an option that it does not use.
    pub fn run(&self, input: &Input<'_>, options: &Options) -> Result<Outcome<E>, EstimatorError> {
        if !input.serves(self.input) {
            return Err(input.wrong(self.input));
        }
        if let Some(option) = options
            .given()
            .into_iter()
            .find(|o| !self.options.contains(o))
        {
            return Err(EstimatorError::Ignored {
                id: self.id.to_owned(),
                option,
            });
        }
        Ok((self.fit)(input, options)?.checked())
    }
}

/// The estimator called `id`.
///
/// # Errors
/// [`EstimatorError::Unknown`] with the names of the table.
pub fn find<E: Estimate>(
    kind: Kind,
    table: &'static [EstimatorInfo<E>],
    id: &str,
) -> Result<&'static EstimatorInfo<E>, EstimatorError> {
    table
        .iter()
        .find(|e| e.id == id)
        .ok_or_else(|| EstimatorError::Unknown {
            kind,
            id: id.to_owned(),
            known: table.iter().map(|e| e.id.to_owned()).collect(),
        })
}

/// The functions by which a crate offers a table of estimators: all entries, and one by name.
///
/// ```text
/// offers!(Kind::Center, TABLE: EstimatorInfo, "doc of the first" estimators, estimator);
/// ```
#[macro_export]
macro_rules! offers {
    ($kind:expr, $table:ident: $info:ty, $about:literal $all:ident, $one:ident) => {
        #[doc = $about]
        #[must_use]
        pub fn $all() -> &'static [$info] {
            $table
        }

        /// The estimator of this kind called `id`.
        ///
        /// # Errors
        /// [`Unknown`](calib_estimator::EstimatorError::Unknown) with the names of the table.
        pub fn $one(id: &str) -> Result<&'static $info, $crate::EstimatorError> {
            $crate::find($kind, $table, id)
        }
    };
}
