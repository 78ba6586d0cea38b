//! Whether held-out errors are as large as the fit states.

use std::collections::BTreeSet;

use calib_report::{Agreement, HeldOut};

use crate::formulate::formulation::MlFit;
use crate::formulate::row_levels::HeldOutLevels;
use crate::prepare::inputs::Inputs;

/// Held-out errors, the screened ones left out, against what the fit states of them, with how many numbers they are.
pub(crate) fn agreement(
    inputs: &Inputs,
    fit: &MlFit,
    held_out: Option<&HeldOut>,
) -> Option<(Agreement, usize)> {
    let without = screened(inputs, fit, held_out);
    let samples = &fit.formulation.samples;
    let rows = HeldOutLevels::of(inputs, samples);
    let recording = |sample: usize| &inputs.recordings[&samples[sample].0];
    let level = |sample, kind, found| rows.level(recording(sample), kind, found);
    let (chi2, rows) = fit.solution.held_out_chi2(&without, &level)?;
    let freedom = fit.solution.degrees_of_freedom;
    Some((Agreement::of(chi2, rows, freedom), rows))
}

/// Samples with a held-out error that was screened out.
pub(crate) fn screened(
    inputs: &Inputs,
    fit: &MlFit,
    held_out: Option<&HeldOut>,
) -> BTreeSet<usize> {
    let errors = held_out
        .iter()
        .filter(|h| !h.left_out)
        .flat_map(|h| &h.poses);
    let gross: BTreeSet<&String> = errors.filter(|p| p.screened).map(|p| &p.pose).collect();
    let of = |(recording, row): &(String, usize)| {
        format!(
            "{recording}:{}",
            inputs.recordings[recording].poses.rows[*row]
        )
    };
    let samples = fit.formulation.samples.iter().enumerate();
    samples
        .filter(|(_, sample)| gross.contains(&of(sample)))
        .map(|(s, _)| s)
        .collect()
}
