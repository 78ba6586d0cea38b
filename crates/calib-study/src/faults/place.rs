//! How well the recordings of a case show where a step lies, to one who knows all else of it.
//!
//! With e_i the whitened difference that the step makes in row i once it has happened, a step from row c on is d_c = (e_i for i ≥ c, else 0). With A, P
//! and N = Σ AᵀV⁻¹A + P as in [`evidence`](super::evidence) and Q = 1 − A N⁻¹ Aᵀ of the whitened rows and priors together,
//!
//! ```text
//! K_cc' = d_cᵀ Q d_c',   u_c = K_cr + d_cᵀ Q z,   z ~ N(0, 1)               a step from row r, as the data show it
//! p_c ∝ exp(u_c − K_cc / 2)                                        every row being as likely beforehand
//! r̂ = the row with the largest p_(r̂−1) + p_r̂ + p_(r̂+1)
//! ```
//!
//! No estimate is within one row of the true one more often than r̂, on the mean over rows.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::case::Case;
use super::evidence::Known;
use super::fault::Fault;

/// Draws of the noise.
const DRAWS: usize = 400;

/// How often r̂ is within one row of the true one; `None` for faults that are no step.
pub(super) fn chance(case: &Case) -> Option<f64> {
    let steps = [
        Fault::Slip,
        Fault::SmallSlip,
        Fault::Bump,
        Fault::OffsetStep,
    ];
    if !steps.contains(&case.cell.fault) {
        return None;
    }
    let rows = case.readings.first()?.1.len();
    let known = Known::of(&case.changed_from_the_first_row())?;
    Some(within_one(&known, rows, case.change(rows)))
}

/// Of a step among the first `rows` rows, which holds in all others.
fn within_one(known: &Known, rows: usize, truth: usize) -> f64 {
    let n = known.prior.len();
    // Sums over the rows from c on, last first: Aᵀe, and |e|².
    let mut places: Vec<(DVector<f64>, f64)> = Vec::new();
    let mut sum = (DVector::zeros(n), 0.0);
    for (i, (a, e)) in known.rows.iter().enumerate().rev() {
        sum.0 += a.tr_mul(e);
        sum.1 += e.norm_squared();
        if (1..rows).contains(&i) {
            places.push(sum.clone());
        }
    }
    places.reverse();
    let solved: Vec<DVector<f64>> = places.iter().map(|p| known.factor.solve(&p.0)).collect();
    let k = DMatrix::from_fn(places.len(), places.len(), |c, d| {
        places[c.max(d)].1 - places[c].0.dot(&solved[d])
    });
    let Some(truth) = truth.checked_sub(1).filter(|t| *t < places.len()) else {
        return 0.0;
    };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let hits = (0..DRAWS).filter(|_| {
        let u = k.column(truth) + of_noise(known, &solved, &mut rng);
        let log_odds = u - k.diagonal() * 0.5;
        best(&log_odds).abs_diff(truth) <= 1
    });
    hits.count() as f64 / DRAWS as f64
}

/// d_cᵀ Q z of one draw.
fn of_noise(known: &Known, solved: &[DVector<f64>], rng: &mut ChaCha8Rng) -> DVector<f64> {
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let mut h = known.prior.map(|p| p.sqrt() * normal());
    let mut along: Vec<f64> = Vec::new();
    for (a, e) in &known.rows {
        let z = DVector::from_fn(e.len(), |_, _| normal());
        h.gemv_tr(1.0, a, &z, 1.0);
        along.push(e.dot(&z));
    }
    let mut out = DVector::zeros(solved.len());
    let mut later: f64 = along[solved.len() + 1..].iter().sum();
    for c in (0..solved.len()).rev() {
        later += along[c + 1];
        out[c] = later - solved[c].dot(&h);
    }
    out
}

/// r̂, as a place among the rows that are asked.
fn best(log_odds: &DVector<f64>) -> usize {
    let most = log_odds.max();
    let p = log_odds.map(|l| (l - most).exp());
    let around = |c: usize| {
        p.rows_range(c.saturating_sub(1)..(c + 2).min(p.len()))
            .sum()
    };
    let sums: Vec<f64> = (0..p.len()).map(around).collect();
    (0..p.len())
        .max_by(|a, b| sums[*a].total_cmp(&sums[*b]))
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use nalgebra::Cholesky;

    use super::*;

    /// A step of known height in white noise about an unknown mean, against the likelihood of every row written out.
    #[test]
    fn the_row_of_a_step_is_found_as_often_as_by_its_likelihood_written_out() {
        const ROWS: usize = 30;
        const TRUTH: usize = 14;
        for height in [0.5, 1.5, 3.0] {
            let row = || {
                (
                    DMatrix::from_element(1, 1, 1.0),
                    DVector::from_element(1, height),
                )
            };
            let known = Known {
                rows: (0..ROWS).map(|_| row()).collect(),
                prior: DVector::zeros(1),
                factor: Cholesky::new(DMatrix::from_element(1, 1, ROWS as f64)).expect("positive"),
            };
            let mut rng = ChaCha8Rng::seed_from_u64(5);
            let trials = 4000;
            let hits = (0..trials).filter(|_| {
                let y: Vec<f64> = (0..ROWS)
                    .map(|i| {
                        let z: f64 = StandardNormal.sample(&mut rng);
                        z + if i >= TRUTH { height } else { 0.0 }
                    })
                    .collect();
                // Squares about their own mean, the step taken out.
                let squares = |c: usize| {
                    let left: Vec<f64> = (0..ROWS)
                        .map(|i| y[i] - if i >= c { height } else { 0.0 })
                        .collect();
                    let mean = left.iter().sum::<f64>() / ROWS as f64;
                    left.iter().map(|x| (x - mean).powi(2)).sum::<f64>()
                };
                let odds = DVector::from_fn(ROWS - 1, |c, _| -0.5 * squares(c + 1));
                (best(&odds) + 1).abs_diff(TRUTH) <= 1
            });
            let expected = hits.count() as f64 / f64::from(trials);
            let said = within_one(&known, ROWS, TRUTH);
            assert!(
                (said - expected).abs() < 0.08,
                "{height}: {said} {expected}"
            );
        }
    }
}
