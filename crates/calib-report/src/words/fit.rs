//! How the solver ended.

use super::prose::counted;
use super::rejection::{excluded_of, rejected_of};
use crate::{FitEnd, FitSummary, Report, Unit, number};

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

/// `converged after 7 iterations (354 measured poses and points, 88 unknowns, χ²/dof 1.03 (at the stated noise: marker))`
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

/// `Fit: converged after 7 iterations, χ²/dof 1.03, rms residual 0.51 mm, 5 of 2935 measurements rejected.`
pub(crate) fn in_short(report: &Report) -> String {
    let chi2 = |fit: &FitSummary| {
        let chi2 = fit.chi2_per_dof?;
        let own = if fit.stated_noise.is_empty() {
            " (1 by construction)"
        } else {
            ""
        };
        Some(format!("χ²/dof {}{own}", number::fixed(chi2, 2)))
    };
    let fit = report.fit.as_ref();
    let all = report.residuals.all.as_ref();
    let rejected = rejected_of(report);
    let parts = [
        fit.map(|fit| fit.status.clone()),
        fit.and_then(chi2),
        all.map(|all| format!("rms residual {}", number::plain(all.rms_m, Unit::Meter))),
        rejected.map(|[part, of]| format!("{part} of {of} measurements rejected")),
        Some(excluded_of(report))
            .filter(|n| *n > 0)
            .map(|n| format!("{n} excluded before the fit")),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    match parts.is_empty() {
        true => "Fit: none.".to_owned(),
        false => format!("Fit: {}.", parts.join(", ")),
    }
}

/// How the uncertainty compares with one that does not trust the noise model.
pub(crate) fn cluster_robust(ratio: f64) -> String {
    format!(
        "Cluster-robust standard deviations (CR2, postures as clusters) do not assume the noise model: their median ratio to the values above is {}.",
        number::fixed(ratio, 2)
    )
}
