//! Priors against what was found: widths that the data contradict.
//!
//! ```text
//! z_i = (x_i − nominal_i)/σ_i,   f² = Σ z_i² / Σ share_i     over the parameters of one kind                 (1)
//! ```
//!
//! (1) is a step of the fixed point of the marginal likelihood (MacKay 1992) for one common factor f on the widths of a kind; the data
//! share is the part of each parameter that the data and not the prior decide. It is reported, not used: on two real robots wider
//! priors than the stated ones predicted new poses neither better nor worse than 1 %.

use std::collections::BTreeMap;

use calib_core::{ParameterEstimate, ParameterKind};
use calib_finding::{About, Fact, Finding, catalog};

use crate::formulate::formulation::MlFit;

/// Of a hundred numbers one is beyond this by chance in one robot of four whose nominal values are as good as stated.
const BEYOND: f64 = 3.0;

/// What is known of one kind.
#[derive(Default)]
struct Kind<'a> {
    /// Σ z².
    squares: f64,
    /// Σ share.
    shares: f64,
    beyond: usize,
    largest: Option<(f64, &'a ParameterEstimate)>,
}

/// Kinds of parameters of the robot of which one is beyond [`BEYOND`] standard deviations of its prior.
pub(crate) fn contradicted(fit: &MlFit) -> Vec<Finding> {
    let stated = fit.formulation.problem.parameters();
    let mut kinds: BTreeMap<ParameterKind, Kind<'_>> = BTreeMap::new();
    for (found, stated) in fit.solution.parameters.iter().zip(stated) {
        let sigma = stated.prior_sigma.filter(|sigma| *sigma > 0.0);
        let Some(sigma) = sigma.filter(|_| found.joint.is_some() && !stated.fixed) else {
            continue;
        };
        let z = (found.value - found.nominal).abs() / sigma;
        let kind = kinds.entry(found.kind).or_default();
        kind.squares += z * z;
        kind.shares += found.data_share.clamp(0.0, 1.0);
        kind.beyond += usize::from(z > BEYOND);
        if kind.largest.is_none_or(|(largest, _)| z > largest) {
            kind.largest = Some((z, found));
        }
    }
    kinds.values().filter_map(Kind::finding).collect()
}

impl Kind<'_> {
    fn finding(&self) -> Option<Finding> {
        let (z, largest) = self.largest.filter(|(z, _)| *z > BEYOND)?;
        let factor = (self.squares / self.shares.max(1.0)).sqrt().max(1.0);
        let more = Some(self.beyond - 1).filter(|more| *more > 0);
        let about = About::Parameter(largest.name.clone());
        Some(
            Finding::new(catalog::BEYOND_ITS_PRIOR, about)
                .with("sigmas", Fact::ratio(z))
                .with_some("more", more.map(Fact::count))
                .with("factor", Fact::ratio(factor)),
        )
    }
}
