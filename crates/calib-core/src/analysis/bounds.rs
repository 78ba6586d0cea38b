//! Where the parameters that a bound stopped would be without it.
//!
//! ```text
//! x̂ = x − C g,   g = ∂F/∂x at the solution, C = (∂²F/∂x²)⁻¹                                 (1)
//! ```
//!
//! g is 0 but for the parameters on their bounds: (1) is one Newton step of the unconstrained fit, exact where the model
//! is linear.
//!
//! Tests of what the model lacks hold them there ([`Solution::held`]): a gradient that is not 0 would be read as that of whatever looks like them.

use nalgebra::DVector;

use crate::analysis::solution::Solution;
use crate::graph::ids::ParameterId;
use crate::solve::equations::{NormalEquations, Workspace};
use crate::solve::normal::accumulate;
use crate::solve::whitened::covariance_of;

/// A parameter on one of its bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Unbounded {
    /// Which.
    pub parameter: ParameterId,
    /// Estimate without bounds, in the parameter's unit.
    pub value: f64,
    /// Its σ, from data and prior.
    pub sigma: f64,
}

impl Solution {
    /// H of the fit, for tests that start from its minimum.
    pub(crate) fn held_curvature(&self) -> NormalEquations {
        self.held(self.information.curvature(&self.model))
    }

    /// Normal equations whose steps leave the parameters on their bounds there.
    pub(crate) fn held(&self, mut system: NormalEquations) -> NormalEquations {
        /// Times its own curvature: a step of nothing.
        const FIXED: f64 = 1e12;
        let n = system.n;
        for (column, p) in self.model.columns.iter().enumerate() {
            if !self.parameters[*p].at_bound {
                continue;
            }
            for other in (0..n).filter(|other| *other != column) {
                system.h[column * n + other] = 0.0;
                system.h[other * n + column] = 0.0;
            }
            system.h[column * n + column] *= FIXED;
            system.g[column] = 0.0;
        }
        system
    }

    /// Equation (1) for every parameter on one of its bounds; `None` when the model cannot be evaluated.
    #[must_use]
    pub fn without_bounds(&self) -> Option<Vec<Unbounded>> {
        let on_bounds = || self.parameters.iter().filter(|p| p.at_bound);
        if on_bounds().next().is_none() {
            return Some(Vec::new());
        }
        let mut work = Workspace::new(&self.model);
        let mut system = NormalEquations::new(self.model.free());
        if !accumulate(self.objective(), &self.values, &mut work, &mut system) {
            return None;
        }
        let covariance = covariance_of(&system)?;
        let step = -(&covariance * DVector::from_column_slice(&system.g));
        let found = on_bounds().filter_map(|p| {
            let column = self.model.column_of[p.id.index()]?;
            Some(Unbounded {
                parameter: p.id,
                value: p.value + step[column],
                sigma: covariance[(column, column)].max(0.0).sqrt(),
            })
        });
        Some(found.collect())
    }
}
