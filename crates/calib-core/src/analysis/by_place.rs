//! Do the errors follow the place in the measuring frame? A tracker that distorts its volume displaces what it sees by a smooth function of the place.
//!
//! ```text
//! d(p) = Σ_ak c_ak φ_k(p) e_a,   a = x, y, z,   k = 1 … 6                                       (1)
//! ```
//!
//! φ_k are the quadratic monomials of the place, less what 1, x, y and z explain of them over the places seen (registration and scale are that), each
//! with an rms of 1. The eighteen columns are tested together ([`score`](super::score)). What joints lack displaces a body by smooth functions of the
//! place, too: both are compared by what they take of χ² beyond chance, which is one for each of the columns, and 2 ln M for the best of M effects; the
//! effects are taken one after the other.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Vector3};
use serde::{Deserialize, Serialize};

use crate::analysis::bends::{Bend, Bends, TERMS};
use crate::analysis::goodness::Candidate;
use crate::analysis::looked_at::LookedAt;
use crate::analysis::score::{IMITATED, Scored};
use crate::analysis::solution::Solution;
use crate::analysis::successive::clustered;
use crate::graph::ids::FrameId;
use crate::graph::measurement::MeasurementKind;
use crate::model::cache::State;
use crate::model::path::Derivatives;
use crate::solve::equations::Workspace;
use crate::solve::whitened::covariance_of;

/// Columns of equation (1).
const COLUMNS: usize = 3 * TERMS.len();
/// Samples that tell so many columns from what each of them has of its own.
const SAMPLES: usize = 2 * COLUMNS;
/// What a coefficient may be before the data are seen, m: 1 mm where the curvature is largest.
const WIDE: f64 = 1e-3;
/// Effects of joints that are taken one after the other, at most.
const EFFECTS: usize = 10;

/// That the errors follow the place in the measuring frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ByPlace {
    /// Probability of so much by chance.
    pub p_value: f64,
    /// Share of χ² that the columns of equation (1) take.
    pub explains: f64,
    /// The displacement, rms over what was seen, m, with what the parameters took up of it.
    pub rms: f64,
    /// Whether effects of the joints explain less beyond chance.
    pub more_than_effects: bool,
}

/// Sums over the samples for the score of columns.
struct Sums {
    u: DVector<f64>,
    information: DMatrix<f64>,
    raw: Vec<f64>,
    chi2: f64,
    samples: usize,
    /// Each sample's own share of U, where asked.
    shares: Vec<DVector<f64>>,
}

impl Solution {
    /// Whether errors follow the place in `frame`, by equation (1). `None` where chance explains it with a probability of `most` or more, where the
    /// model cannot be evaluated, or where there are fewer than 36 samples.
    #[must_use]
    pub fn by_place(&self, frame: FrameId, most: f64) -> Option<ByPlace> {
        let looked_at = self.looked_at();
        if !self.is_testable() || looked_at.samples.len() < SAMPLES {
            return None;
        }
        let places = self.places(frame, &looked_at);
        let bends = bends(Bends::of(frame, &places)?);
        let columns: Vec<Candidate> = bends.iter().cloned().map(Candidate::of_place).collect();
        let sums = self.sums(&columns, &looked_at, true)?;
        let wide = DMatrix::from_diagonal_element(COLUMNS, COLUMNS, WIDE.powi(-2));
        let estimate = (&sums.information + wide).cholesky()?.solve(&sums.u);
        let clusters = clustered(&sums.shares, COLUMNS);
        let excess = (self.chi2 / self.degrees_of_freedom.max(1.0)).max(1.0);
        let scored = Scored {
            u: &sums.u,
            information: &sums.information,
            raw: &sums.raw,
            clusters: Some(&clusters),
            excess,
            samples: sums.samples,
        };
        let tested = scored.test().filter(|tested| tested.p_value < most)?;
        let place = sums.u.dot(&estimate);
        let mut effects = self.candidates();
        let count = effects.len();
        effects.extend(columns);
        let all = self.sums(&effects, &looked_at, false)?;
        let price = 2.0 * (count.max(2) as f64).ln();
        let of_effects = one_by_one(&all, count, price * excess);
        Some(ByPlace {
            p_value: tested.p_value,
            explains: (place / sums.chi2.max(f64::MIN_POSITIVE)).min(1.0),
            rms: rms(&bends, &estimate, frame, &places),
            more_than_effects: place - excess * tested.rank as f64 > of_effects,
        })
    }

    /// Where the observations of the samples lie in the frame that they are measured from, m.
    fn places(&self, frame: FrameId, looked_at: &LookedAt) -> Vec<Vector3<f64>> {
        let model = &self.model;
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &self.values);
        let at = State::new(&model.problem, &work.cache, &self.values);
        let mut places = Vec::new();
        for (m, measurement) in model.problem.measurements.iter().enumerate() {
            let markers = match &measurement.kind {
                MeasurementKind::Markers(markers) => Some(markers),
                MeasurementKind::Poses(_) => None,
                _ => continue,
            };
            if measurement.from != frame {
                continue;
            }
            let mut buffer = model.paths[m].buffer();
            for (sample, seen) in &model.of_measurement[m] {
                if looked_at.samples.binary_search(sample).is_err() {
                    continue;
                }
                let pose = model.paths[m].evaluate(at, *sample, Derivatives::None, &mut buffer);
                for o in seen.clone().filter(|o| self.weights[*o] > 0.0) {
                    let point = markers.map_or_else(Vector3::zeros, |markers| {
                        let point = markers.observations[model.observations[o].item].point;
                        model.point_position(point.index(), &self.values).coords
                    });
                    places.push(pose.t + pose.r * point);
                }
            }
        }
        places
    }

    fn sums(&self, columns: &[Candidate], looked_at: &LookedAt, shares: bool) -> Option<Sums> {
        let (n, count) = (self.model.free(), columns.len());
        let (mut u, mut gram) = (DVector::zeros(count), DMatrix::zeros(count, count));
        let mut b = DMatrix::zeros(n, count);
        let (mut h, mut g) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let mut kept = Vec::new();
        for seen in self.seen(columns, &looked_at.samples) {
            let rows = &seen.rows;
            u.gemv_tr(1.0, &seen.columns, &rows.w, 1.0);
            gram.gemm_tr(1.0, &seen.columns, &seen.columns, 1.0);
            rows.a.add_transposed_times(1.0, &seen.columns, &mut b);
            if !looked_at.all {
                rows.a.add_gram(1.0, &mut h);
                rows.a.add_transposed_vector(&rows.w, &mut g);
            }
            if shares {
                kept.push(seen);
            }
        }
        let (c, step) = match looked_at.all {
            true => (covariance_of(&self.held_curvature())?, None),
            false => {
                let (c, step) = self.to_own_minimum(&h, &g)?;
                u.gemv_tr(1.0, &b, &step, 1.0);
                (c, Some(step))
            }
        };
        let taken = &c * &b;
        let raw = gram.diagonal().iter().copied().collect();
        let information = &gram - b.tr_mul(&taken);
        let wide = DMatrix::from_diagonal_element(count, count, WIDE.powi(-2));
        let estimate = match shares {
            true => (&information + wide).cholesky()?.solve(&u),
            false => DVector::zeros(count),
        };
        let mut chi2 = 0.0;
        let of = kept.iter().map(|seen| {
            let left = &seen.columns - seen.rows.a.times(&taken);
            let moved = step.as_ref().map(|step| seen.rows.a.times_vector(step));
            let w = moved.map_or_else(|| seen.rows.w.clone(), |moved| &seen.rows.w + moved);
            chi2 += w.norm_squared();
            left.tr_mul(&(w - &left * &estimate))
        });
        let of_samples = of.collect();
        Some(Sums {
            u,
            information,
            raw,
            chi2: if looked_at.all { self.chi2 } else { chi2 },
            samples: looked_at.samples.len(),
            shares: of_samples,
        })
    }
}

/// The columns of equation (1), axis by axis.
fn bends(of: Bends) -> Vec<Bend> {
    let of = Arc::new(of);
    let bend = |c: usize| Bends::along(&of, c / TERMS.len(), c % TERMS.len());
    (0..COLUMNS).map(bend).collect()
}

/// Displacement of equation (1) with these coefficients, rms over the places, m.
fn rms(bends: &[Bend], c: &DVector<f64>, frame: FrameId, places: &[Vector3<f64>]) -> f64 {
    let squared = |place: &Vector3<f64>| {
        let parts = bends.iter().zip(c.iter());
        let displaced = parts.map(|(bend, c)| bend.at(frame, place) * *c);
        displaced.sum::<Vector3<f64>>().norm_squared()
    };
    (places.iter().map(squared).sum::<f64>() / places.len().max(1) as f64).sqrt()
}

/// What the first `count` columns take of χ² less their price, taken one after the other as long as one is worth it.
fn one_by_one(sums: &Sums, count: usize, price: f64) -> f64 {
    let (mut u, mut left) = (sums.u.clone(), sums.information.clone());
    let mut total = 0.0;
    for _ in 0..EFFECTS {
        let gain = |k: usize| match left[(k, k)] > IMITATED * sums.raw[k] {
            true => u[k] * u[k] / left[(k, k)],
            false => 0.0,
        };
        let best = (0..count).map(|k| (k, gain(k)));
        let best = best.max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((k, gain)) = best.filter(|best| best.1 > price) else {
            break;
        };
        total += gain - price;
        let (own, of_k) = (left.column(k).into_owned(), left[(k, k)]);
        let along = u[k] / of_k;
        u.axpy(-along, &own, 1.0);
        left.ger(-1.0 / of_k, &own, &own, 1.0);
    }
    total
}
