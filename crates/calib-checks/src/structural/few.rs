//! Few samples: one bad row, or a mistake.
//!
//! Where a registration leaves a handful of degrees of freedom, a gross sample cannot be screened, and makes the data as they are look
//! as wrong as a mistake would. It is the rival of every name then: the residual that a name has to divide is that of the data
//! without the row that helps most.
//!
//! ```text
//! rms₋ = min over rows s of rms(none, without s),   named where min(rms, rms₋)/rms_best ≥ 1.5 (1 + 4/ν₋)
//! ```

use super::candidates::Candidate;
use super::data::Data;
use super::hypothesis::Hypothesis;
use super::ids::{BodyIndex, SampleIndex};
use super::naming::Asked;
use super::outcome::{Decision, Options};
use super::ranking::{Ranking, least_ratio};
use super::scan::Scan;

/// Degrees of freedom that must be left without the row with the most samples.
const LEAST_FREEDOM: f64 = 6.0;

/// The decision where the whole data leave `freedom` degrees of freedom.
pub(super) fn decide(
    data: &Data,
    mut candidates: Vec<Candidate>,
    freedom: f64,
    options: &Options,
) -> Decision {
    let too_few = Decision::TooFewData { freedom };
    let scan = Scan::new(data, &[]);
    let row = 3.0 * samples_of_a_row(&scan);
    if freedom - row < LEAST_FREEDOM {
        return too_few;
    }
    candidates.retain(|c| is_cheap(&c.0, freedom, row));
    let ranking = Ranking::of(data, &candidates, &[]);
    let Some(best) = ranking.scored.first() else {
        return too_few;
    };
    let without_one = (0..data.readings.len()).map(|s| without_row(data, s));
    let rival = without_one.fold(ranking.none.score, f64::min);
    let asked = options.name_ratio * least_ratio(freedom - row);
    if rival < asked * best.score.score {
        return too_few;
    }
    let asked = Asked {
        data,
        candidates: &candidates,
        ranking: &ranking,
        screened: &[],
        options,
    };
    let named = asked.name(best);
    if named.verified(options) {
        Decision::Named(named)
    } else {
        too_few
    }
}

/// A hypothesis that spends no degree of freedom, or not too many.
fn is_cheap(hypothesis: &Hypothesis, freedom: f64, row: f64) -> bool {
    match hypothesis {
        Hypothesis::RowShift { rows } => {
            freedom - f64::from(rows.unsigned_abs()) * row >= LEAST_FREEDOM
        }
        Hypothesis::TrackerMoved
        | Hypothesis::Remounted { .. }
        | Hypothesis::MissingColumn { .. } => false,
        _ => true,
    }
}

/// The most samples that a row has.
fn samples_of_a_row(scan: &Scan<'_>) -> f64 {
    let rows = scan.weights.chunks(scan.channels.len().max(1));
    rows.map(|row| row.iter().sum::<f64>()).fold(0.0, f64::max)
}

/// Residual of the data as they are without a row.
fn without_row(data: &Data, row: usize) -> f64 {
    let bodies = data.bodies.iter().enumerate();
    let samples = bodies.flat_map(|(b, body)| {
        let markers = body.measured.markers();
        (0..markers).map(move |marker| SampleIndex {
            row,
            body: BodyIndex(b),
            marker,
        })
    });
    let samples: Vec<SampleIndex> = samples.collect();
    Scan::new(data, &samples).none().score
}
