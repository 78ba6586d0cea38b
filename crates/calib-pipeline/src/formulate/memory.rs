//! Noise with a memory: the uncertainty of the fit where successive rows share a part of their errors.

use calib_core::MemoryOf;
use calib_finding::{About, Fact, Finding, catalog};

use crate::formulate::formulation::MlFit;

/// The strongest correlation that is stated.
const LARGEST: f64 = 0.99;

/// Gives the fit the uncertainty that it has under the memory that its residuals show, with the finding that says so.
pub(crate) fn with_memory(fit: &mut MlFit) -> Option<Finding> {
    let borders = fit.formulation.borders();
    let found = fit.solution.dependence(&borders)?;
    if !found.is_significant() {
        return None;
    }
    let largest = |s: &calib_core::Solution| -> Vec<f64> {
        s.parameters.iter().filter_map(|p| p.sigma).collect()
    };
    let under = fit.solution.under(&found, &borders)?;
    // The factor that a parameter's σ grows by at most.
    let (before, after) = (largest(&fit.solution), largest(&under));
    let ratios = before
        .iter()
        .zip(&after)
        .filter(|(b, _)| **b > 0.0)
        .map(|(b, a)| a / b);
    let factor = ratios.fold(1.0, f64::max);
    fit.solution = under;
    let form = match found.of {
        MemoryOf::Together => "together",
        _ => "apart",
    };
    let finding = Finding::of_kind(catalog::NOISE_HAS_MEMORY, form, About::Fit)
        // An estimate, which may exceed what a correlation can be.
        .with("correlation", Fact::ratio(found.lag_one.min(LARGEST)))
        .with("factor", Fact::number(factor, calib_finding::Unit::One));
    Some(finding)
}
