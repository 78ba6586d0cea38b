//! Priors and the data: widths that nobody stated are found from the data, and numbers that are far from where their prior expects
//! them are named.
//!
//! ```text
//! z_i = (x_i − nominal_i)/σ_i,   f² = Σ z_i² / Σ share_i     over the parameters of one kind                 (1)
//! ```
//!
//! (1) is a step of the fixed point of the marginal likelihood (MacKay 1992) for one common factor f on the widths of a kind; the data
//! share is the part of each parameter that the data and not the prior decide. For widths that the profile states it is reported, not
//! used.

use std::borrow::Cow;
use std::collections::BTreeMap;

use calib_core::effect::Source;
use calib_core::{
    ParameterEstimate, ParameterId, ParameterKind, Problem, Settings, Solution, WidthEstimate,
    WidthKind,
};
use calib_finding::{About, Fact, Finding, catalog};

use crate::formulate::formulation::{MlFit, PriorKind};
use crate::formulate::ml::calibration;
use crate::prepare::inputs::Inputs;

/// Takes the prior widths that the data speak for, where the profile does not state them.
pub(crate) fn by_evidence(fit: &mut MlFit, inputs: &Inputs, settings: &Settings) {
    let formulation = &fit.formulation;
    let parameters = formulation.problem.parameters();
    // Masses and what yields to them have one scale that no data tell: widths would follow each other along it.
    let masses = !formulation.masses.is_empty();
    let of_masses = |kind: &PriorKind| {
        let of = |id: &ParameterId| match parameters[id.index()].kind {
            ParameterKind::Effect(kind) => kind.term().source == Source::Load,
            _ => false,
        };
        masses && kind.parameters.iter().any(of)
    };
    let open = |k: &usize| {
        let kind = &formulation.widths[*k];
        !kind.width.stated && !of_masses(kind)
    };
    let places: Vec<usize> = (0..formulation.widths.len()).filter(open).collect();
    let kinds: Vec<WidthKind> = places.iter().map(|k| kind_of(fit, *k)).collect();
    if kinds.is_empty() {
        return;
    }
    let widened = fit.solution.widened(&kinds, settings);
    let Some(widened) = widened.filter(|widened| !widened.widths.is_empty()) else {
        return;
    };
    if let Some(solution) = widened.solution {
        fit.calibration = calibration(&fit.formulation, &solution, inputs);
        fit.solution = solution;
    }
    fit.widths = vec![None; fit.formulation.widths.len()];
    for (place, width) in places.into_iter().zip(widened.widths) {
        fit.widths[place] = Some(width);
    }
}

fn kind_of(fit: &MlFit, kind: usize) -> WidthKind {
    let mut of = WidthKind::new(fit.formulation.widths[kind].parameters.clone());
    of.factor = found(fit, kind).map_or(1.0, |width| width.factor);
    of
}

/// The solution as what the data leave open is judged by: under the given widths where narrower ones were found.
pub(crate) fn judged(fit: &MlFit) -> Cow<'_, Solution> {
    let all = 0..fit.formulation.widths.len();
    let kinds: Vec<WidthKind> = all.map(|k| kind_of(fit, k)).collect();
    let narrower = kinds.iter().any(|kind| kind.factor < 1.0);
    let wider = narrower.then(|| fit.solution.with_given_widths(&kinds));
    wider
        .flatten()
        .map_or(Cow::Borrowed(&fit.solution), Cow::Owned)
}

/// What was found of a width of the formulation.
pub(crate) fn found(fit: &MlFit, kind: usize) -> Option<WidthEstimate> {
    fit.widths.get(kind).copied().flatten()
}

/// The widths that a fit found, in another statement of the same robot.
pub(crate) fn take_over(fit: &MlFit, kinds: &[PriorKind], problem: &mut Problem) {
    for (k, of_fit) in fit.formulation.widths.iter().enumerate() {
        let Some(width) = found(fit, k).filter(|width| width.factor != 1.0) else {
            continue;
        };
        let same = kinds.iter().filter(|kind| kind.width == of_fit.width);
        for id in same.flat_map(|kind| &kind.parameters) {
            if let Some(sigma) = &mut problem.parameter_mut(*id).prior_sigma {
                *sigma *= width.factor;
            }
        }
    }
}

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
    /// The factor that was found and used for the kind of the largest.
    found: Option<f64>,
}

/// Kinds of parameters of the robot of which one is beyond [`BEYOND`] standard deviations of its prior: of the width that the profile
/// states or the default, not of one that was found. A width that was found from all numbers of a kind is as wide as its largest
/// ones ask for: measured by it, the one mount that moved far would look like its kind, and a robot that is off as a whole like any
/// other.
pub(crate) fn contradicted(fit: &MlFit) -> Vec<Finding> {
    let stated = fit.formulation.problem.parameters();
    let width_of = |id: ParameterId| {
        let mut shared = fit.formulation.widths.iter();
        let place = shared.position(|kind| kind.parameters.contains(&id))?;
        let width = found(fit, place)?;
        (width.factor > 1.0).then_some(width.factor)
    };
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
            kind.found = width_of(found.id);
        }
    }
    kinds.values().filter_map(Kind::finding).collect()
}

impl Kind<'_> {
    fn finding(&self) -> Option<Finding> {
        let (z, largest) = self.largest.filter(|(z, _)| *z > BEYOND)?;
        let asked = (self.squares / self.shares.max(1.0)).sqrt().max(1.0);
        let form = match self.found {
            Some(_) => "found",
            None => "stated",
        };
        let more = Some(self.beyond - 1).filter(|more| *more > 0);
        let about = About::Parameter(largest.name.clone());
        Some(
            Finding::of_kind(catalog::BEYOND_ITS_PRIOR, form, about)
                .with("sigmas", Fact::ratio(z))
                .with_some("more", more.map(Fact::count))
                .with("factor", Fact::ratio(self.found.unwrap_or(asked))),
        )
    }
}
