//! The prior widths in use as the report's data.

use calib_report::{PriorWidth, WidthSource};

use crate::formulate::formulation::MlFit;
use crate::formulate::priors::found;
use crate::output::of_fit::unit;

pub(crate) fn prior_widths(fit: &MlFit) -> Vec<PriorWidth> {
    let declared = fit.formulation.problem.parameters();
    let used = fit.solution.model.problem().parameters();
    let kinds = fit.formulation.widths.iter().enumerate();
    kinds
        .filter_map(|(k, kind)| {
            let first = kind.parameters.first()?.index();
            let width = found(fit, k);
            Some(PriorWidth {
                key: kind.width.key.key.to_owned(),
                unit: unit(declared[first].unit),
                sigma: used[first].prior_sigma?,
                source: match width {
                    _ if kind.width.stated => WidthSource::Stated,
                    Some(width) if width.factor != 1.0 => WidthSource::Found,
                    _ => WidthSource::Default,
                },
                declared: declared[first].prior_sigma?,
                likeliest: width
                    .and_then(|width| Some(width.likeliest * declared[first].prior_sigma?)),
                relative_error: width.map(|width| width.relative_error),
                numbers: kind.parameters.len(),
            })
        })
        .collect()
}
