//! How the solver ended.

use super::prose::counted;
use crate::{FitEnd, FitSummary, number};

impl FitEnd {
    /// How the solver ended, after this many iterations: `converged after 7 iterations`.
    #[must_use]
    pub fn after(self, iterations: usize) -> String {
        let how = match self {
            Self::Converged => "converged",
            Self::Stalled => "stalled before convergence: no step lowered the cost",
            Self::MaxIterations => "reached the iteration limit",
            Self::NotEvaluable => "could not evaluate the model at the start values",
            Self::Unknown => "ended",
        };
        format!("{how} after {}", counted(iterations, "iteration"))
    }
}

/// `converged after 7 iterations (354 measured poses and points, 89 unknowns, χ²/dof 1.03 (at the stated noise: marker))`
pub(crate) fn summary(fit: &FitSummary) -> String {
    let against = if fit.stated_noise.is_empty() {
        "1 by construction: the profile states no noise".to_owned()
    } else {
        format!("at the stated noise: {}", fit.stated_noise.join(", "))
    };
    let chi2 = fit.chi2_per_dof.map_or_else(String::new, |chi2| {
        format!(", χ²/dof {} ({against})", number::fixed(chi2, 2))
    });
    format!(
        "{} ({} measured poses and points, {} unknowns{chi2})",
        fit.status, fit.observations, fit.unknowns
    )
}

/// How the uncertainty compares with one that does not trust the noise model.
pub(crate) fn cluster_robust(ratio: f64) -> String {
    format!(
        "Cluster-robust standard deviations (CR2, postures as clusters) do not trust the noise model: in the median they are {} times the ones above.",
        number::fixed(ratio, 2)
    )
}
