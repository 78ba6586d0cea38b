//! An estimator of the table, and how a study uses it.

use calib_cor::{EstimatorInfo, Input, Options, estimators};
use calib_plugin::{Cor, Shape};
use nalgebra::Vector3;

use crate::{
    cell::Quantity,
    tally::{Row, Tally},
    tried::{Tool, Tried},
};

/// The data a method is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Gets {
    Points,
    Poses,
}

/// One way of using one estimator.
pub(crate) struct Method {
    pub name: &'static str,
    pub info: &'static EstimatorInfo,
    pub gets: Gets,
    /// The tracker states its noise.
    pub known: bool,
    /// Runs in every n-th trial: the slow ones.
    pub every: u64,
}

/// The method `name` by estimator `id`; `None` where the table has no such estimator.
pub(crate) fn method(
    name: &'static str,
    id: &str,
    gets: Gets,
    known: bool,
    every: u64,
) -> Option<Method> {
    let info = estimators().iter().find(|e| e.id == id)?;
    Some(Method {
        name,
        info,
        gets,
        known,
        every,
    })
}

/// Estimators of plugins that take one of these shapes, the first that fits.
pub(crate) fn taking(tried: &Tried, shapes: &[Shape]) -> Vec<(Tool<dyn Cor>, Shape)> {
    let all = tried.centers().iter();
    all.filter_map(|tool| Some((tool.clone(), tool.takes(shapes)?)))
        .collect()
}

impl Method {
    pub fn row(&self, bound: Option<f64>) -> Row {
        Row {
            method: self.name.to_owned(),
            estimator: self.info.id.to_owned(),
            from_plugin: false,
            quantity: Quantity::Center,
            bound,
            control: bound,
        }
    }
}

/// Runs an estimator and records the error of its center; `linear` is the control variate, (2) of `tally.rs`.
pub(crate) fn record(
    info: &EstimatorInfo,
    input: &Input<'_>,
    options: &Options,
    (truth, linear): (Vector3<f64>, Option<Vector3<f64>>),
    tally: &mut Tally,
) {
    match info.run(input, &options.only(info.options)) {
        Ok(outcome) => match outcome.estimate() {
            Some(e) => tally.error(
                outcome.is_observable(),
                e.center.coords - truth,
                e.covariance.trace(),
                linear,
            ),
            None => tally.verdict(false, false),
        },
        Err(_) => tally.verdict(false, false),
    }
}
