//! Whitened rows that are formed once: whoever asks for those of a sample first forms them, the others read them.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use crate::model::layout::Model;
use crate::solve::whitened::Whitened;

/// Numbers that are kept at most, 8 MB: a robot of 60 unknowns and twelve markers in 150 poses.
const MOST: usize = 1 << 20;

/// Those of every sample that was asked for; `None` within where a sample has no rows.
#[derive(Debug, Default)]
pub(crate) struct KeptRows(OnceLock<Vec<OnceLock<Option<Arc<Whitened>>>>>);

/// A copy forms its own: whoever copies a solution may change the copy.
impl Clone for KeptRows {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl KeptRows {
    /// Those of a sample, by `form` where they are not kept yet, or too many to be kept.
    pub(crate) fn of(
        &self,
        model: &Model,
        sample: usize,
        form: impl FnOnce() -> Option<Whitened>,
    ) -> Option<Arc<Whitened>> {
        let form = || form().map(Arc::new);
        let kept = self.0.get_or_init(|| {
            let samples = match numbers(model) <= MOST {
                true => model.problem.samples,
                false => 0,
            };
            (0..samples).map(|_| OnceLock::new()).collect()
        });
        match kept.get(sample) {
            Some(kept) => kept.get_or_init(form).clone(),
            None => form(),
        }
    }
}

/// What the rows of all samples need at most: A twice, L and L⁻¹.
fn numbers(model: &Model) -> usize {
    let of_sample = |own: &Range<usize>| {
        let rows: usize = model.observations[own.clone()].iter().map(|o| o.rows).sum();
        2 * rows * (rows + model.free())
    };
    model.of_sample.iter().map(of_sample).sum()
}
