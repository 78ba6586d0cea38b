//! Means of holds and single rows have different noise: a level for each where both are fitted, and (C17b) for rows that are held out.

use calib_core::NoiseKind;
use calib_profile::Usage;

use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::row_noise::{RowNoise, middle};

/// Whether a fit has both means of holds and single rows, and finds a level of noise for each.
pub(crate) fn own_levels(inputs: &Inputs, samples: &[(String, usize)]) -> bool {
    let known = inputs.robot.profile.solve.noise.known;
    let fitted = || fitted(inputs, samples);
    !known && fitted().any(of_means) && !fitted().all(of_means)
}

/// The recordings of the fitted samples.
fn fitted<'a>(
    inputs: &'a Inputs,
    samples: &'a [(String, usize)],
) -> impl Iterator<Item = &'a Loaded> {
    let recordings = samples.iter().map(|(name, _)| &inputs.recordings[name]);
    recordings.filter(|recording| recording.spec.usage != Usage::Validation)
}

/// Whether the rows of a recording are means of holds.
pub(crate) fn of_means(recording: &Loaded) -> bool {
    let alignment = recording.alignment.as_ref();
    alignment.is_some_and(|alignment| alignment.holds.is_some())
}

/// The level of single rows that are held out, from the one that a fit finds. Where it has nothing but means of holds, that level is the means';
/// where it has both, a level of few single rows is known badly, and no row has less noise than within holds:
///
/// ```text
/// σ²_row = σ²_level + s²   of means,   max(σ²_level, s²)   of single rows        s²: the rows' variance within holds
/// ```
#[derive(Debug, Clone, Copy)]
pub(crate) struct SingleRows {
    /// s² of the fitted means.
    pub(crate) within: RowNoise,
    fitted: Fitted,
}

/// What the levels that are found were found of.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fitted {
    /// Means of holds alone.
    Means,
    /// Means of holds and single rows, each with a level.
    Both,
    /// Single rows, or nothing: the profile states the levels.
    Other,
}

impl SingleRows {
    /// Of a fit's samples: recording and row.
    pub(crate) fn of(inputs: &Inputs, samples: &[(String, usize)]) -> Self {
        let means = fitted(inputs, samples).filter(|recording| of_means(recording));
        let noise: Vec<RowNoise> = means.map(|recording| recording.row_noise).collect();
        let usual = |of: fn(&RowNoise) -> f64| middle(noise.iter().map(of)).unwrap_or(0.0);
        let within = RowNoise {
            position: usual(|n| n.position),
            orientation: usual(|n| n.orientation),
        };
        let known = inputs.robot.profile.solve.noise.known;
        let fitted = if known || noise.is_empty() {
            Fitted::Other
        } else if own_levels(inputs, samples) {
            Fitted::Both
        } else {
            Fitted::Means
        };
        Self { within, fitted }
    }

    /// σ² of a kind of noise in a recording, from the one that was found.
    pub(crate) fn level(&self, recording: &Loaded, kind: NoiseKind, found: f64) -> f64 {
        let within = self.within.of_kind(kind);
        match self.fitted {
            Fitted::Other => found,
            _ if of_means(recording) => found,
            Fitted::Means => found + within,
            Fitted::Both => found.max(within),
        }
    }
}
