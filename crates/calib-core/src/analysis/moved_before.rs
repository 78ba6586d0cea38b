//! Did something move between the fitted samples and held-out ones, by less than their noise? Score tests of motions that are the same in all of
//! these samples.
//!
//! Held-out errors share the errors of the parameters. With A, w and C as in `validate`, B̃ the whitened columns ∂e/∂c of all motions side by side
//! and sums over the held-out samples:
//!
//! ```text
//! K = (C⁻¹ + Σ AᵀA)⁻¹,   F = Σ wᵀw − gᵀKg,   g = Σ Aᵀw                                          (1)
//! G = Σ B̃ᵀB̃ − EᵀKE + P,   b = Σ B̃ᵀw − EᵀKg,   E = Σ AᵀB̃                                         (2)
//! Δ = bᵀG⁻¹b,   ĉ = −G⁻¹b,   cov ĉ = G⁻¹                                                        (3)
//! ```
//!
//! F − Δ is the χ² of the same errors once the motion is taken into account. P is a wide prior, which keeps motions finite that no sample shows.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector, Isometry3, Vector6};

use crate::analysis::looked_at::looked_at;
use crate::analysis::solution::Solution;
use crate::analysis::validate::Level;
use crate::graph::ids::{EdgeId, FrameId};
use crate::model::cache::State;
use crate::model::pose::Pose;
use crate::solve::equations::{Objective, Workspace};
use crate::solve::rows::{dot, residual};
use crate::solve::whitened::{Whitened, whitened};

/// What may have moved.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Displaced {
    /// The zero of a joint, rad or m: one unknown.
    Zero(EdgeId),
    /// Everything that is seen in these frames, as one, about and along the axes of a place: six unknowns `[ω; v]`, rad and m.
    Seen(BTreeSet<FrameId>),
}

impl Displaced {
    const fn unknowns(&self) -> usize {
        match self {
            Self::Zero(_) => 1,
            Self::Seen(_) => 6,
        }
    }
}

/// Where the axes of a motion are, in the measuring frame, by number of the motion and sample.
pub type PlaceOf<'a> = &'a dyn Fn(usize, usize) -> Isometry3<f64>;

/// A motion that was tried.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct HeldOutMotion {
    /// Δ of equation (3).
    pub explains: f64,
    /// How many unknowns the samples show: each as the part of its information that is not the prior's.
    pub unknowns: f64,
    /// ĉ of equation (3).
    pub motion: Vec<f64>,
    /// Its covariance at the stated noise.
    pub covariance: DMatrix<f64>,
}

/// Motions of held-out samples.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct HeldOutMotions {
    /// F of equation (1).
    pub chi2: f64,
    /// Numbers in these samples.
    pub rows: usize,
    /// Samples with one.
    pub samples: usize,
    /// In the order in which they were given; `None` where nothing shows one.
    pub motions: Vec<Option<HeldOutMotion>>,
}

/// Samples that are looked at, at most: a motion of a tenth of the noise of one is then 3 σ.
const MOST: usize = 1000;

/// Sums over samples.
struct Sums {
    h: DMatrix<f64>,
    g: DVector<f64>,
    e: DMatrix<f64>,
    own: DMatrix<f64>,
    score: DVector<f64>,
    squares: f64,
    rows: usize,
    samples: usize,
}

impl Solution {
    /// Equation (3) for every motion, over the held-out samples but those of `without`; levels as of [`Self::held_out_at`]. Of long recordings some
    /// samples are taken, as if no others had been made. `None` where nothing is held out, or the model cannot be evaluated.
    #[must_use]
    pub fn held_out_motions(
        &self,
        without: &BTreeSet<usize>,
        level: Level<'_>,
        displaced: &[Displaced],
        place: PlaceOf<'_>,
    ) -> Option<HeldOutMotions> {
        let model = &self.model;
        let n = model.free();
        let width = displaced.iter().map(Displaced::unknowns).sum();
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &self.values);
        let held = self.held_out_weights(level);
        let objective = Objective {
            weights: &held,
            ..self.objective()
        };
        let mut sums = Sums {
            h: DMatrix::zeros(n, n),
            g: DVector::zeros(n),
            e: DMatrix::zeros(n, width),
            own: DMatrix::zeros(width, width),
            score: DVector::zeros(width),
            squares: 0.0,
            rows: 0,
            samples: 0,
        };
        let kept = |sample: &usize| !without.contains(sample);
        let kept: Vec<usize> = model
            .problem
            .held_out
            .iter()
            .copied()
            .filter(kept)
            .collect();
        let looked_at = looked_at(&kept, &model.problem.borders, MOST);
        for sample in looked_at.samples {
            let Some(s) = whitened(objective, &self.values, sample, &mut work) else {
                continue;
            };
            let columns = self.displacements(displaced, place, (sample, &s), &work);
            sums.rows += s.w.len();
            sums.samples += usize::from(!s.w.is_empty());
            sums.squares += s.w.norm_squared();
            s.a.add_gram(1.0, &mut sums.h);
            s.a.add_transposed_vector(&s.w, &mut sums.g);
            sums.e += s.a.transposed_times(&columns);
            sums.own += columns.tr_mul(&columns);
            sums.score += columns.tr_mul(&s.w);
        }
        (sums.rows > 0).then_some(())?;
        // C = L Lᵀ;   K = L (1 + Lᵀ H L)⁻¹ Lᵀ
        let l = self.half_covariance();
        let inner = DMatrix::identity(l.ncols(), l.ncols()) + l.tr_mul(&(&sums.h * &l));
        let inner = inner.cholesky()?;
        let (along, of_motions) = (l.tr_mul(&sums.g), l.tr_mul(&sums.e));
        let solved = inner.solve(&along);
        let own = &sums.own - of_motions.tr_mul(&inner.solve(&of_motions));
        let score = &sums.score - of_motions.tr_mul(&solved);
        let mut first = 0;
        let motions = displaced.iter().map(|one| {
            let range = (first, one.unknowns());
            first += range.1;
            motion(
                &own.view((range.0, range.0), (range.1, range.1))
                    .into_owned(),
                &score.rows(range.0, range.1).into_owned(),
            )
        });
        Some(HeldOutMotions {
            chi2: sums.squares - along.dot(&solved),
            rows: sums.rows,
            samples: sums.samples,
            motions: motions.collect(),
        })
    }

    /// B̃ of one sample, all motions side by side.
    fn displacements(
        &self,
        displaced: &[Displaced],
        place: PlaceOf<'_>,
        (sample, rows): (usize, &Whitened),
        work: &Workspace,
    ) -> DMatrix<f64> {
        let (model, values) = (&self.model, &self.values);
        let state = State::new(&model.problem, &work.cache, values);
        let places: Vec<Option<Pose>> = displaced
            .iter()
            .enumerate()
            .map(|(k, one)| {
                let is_place = matches!(one, Displaced::Seen(_));
                is_place.then(|| Pose::of(&place(k, sample)).inverse())
            })
            .collect();
        let width = displaced.iter().map(Displaced::unknowns).sum();
        let mut out = DMatrix::zeros(rows.w.len(), width);
        let mut twists = Vec::new();
        let mut measurement = usize::MAX;
        let mut pose = Pose::identity();
        for &(o, first, count) in &rows.blocks {
            let observation = model.observations[o];
            if observation.measurement != measurement {
                measurement = observation.measurement;
                pose = model.paths[measurement].effects(state, sample, &mut twists);
            }
            let jacobian = residual(model, values, measurement, observation.item, &pose);
            let to = model.problem.measurements[measurement].to;
            let mut column = 0;
            for (one, place) in displaced.iter().zip(&places) {
                let begin = column;
                column += one.unknowns();
                let columns: Vec<Vector6<f64>> = match (one, place) {
                    (Displaced::Zero(joint), _) => {
                        let own = twists.iter().filter(|(edge, _)| *edge == joint.index());
                        vec![own.map(|(_, twist)| twist[0]).sum()]
                    }
                    (Displaced::Seen(frames), Some(place)) if frames.contains(&to) => {
                        let from_place = place.then(&pose);
                        let unit = |d| from_place.pull_back(&Vector6::ith(d, 1.0));
                        (0..6).map(unit).collect()
                    }
                    _ => continue,
                };
                for (k, twist) in columns.iter().enumerate() {
                    for i in 0..count {
                        out[(first + i, begin + k)] += dot(&jacobian.m[i], twist);
                    }
                }
            }
        }
        &rows.l_inverse * out
    }
}

/// Equation (3) of one motion.
fn motion(own: &DMatrix<f64>, score: &DVector<f64>) -> Option<HeldOutMotion> {
    /// 0.2 rad, 0.2 m: what moved farther needs no such test.
    const WIDE: f64 = 0.2;
    if own.iter().all(|x| *x == 0.0) {
        return None;
    }
    let k = own.nrows();
    let with_prior = own + DMatrix::identity(k, k) * WIDE.powi(-2);
    let covariance = with_prior.cholesky()?.inverse();
    let unknowns = (&covariance * own).trace();
    let motion = -(&covariance * score);
    Some(HeldOutMotion {
        explains: -score.dot(&motion),
        unknowns,
        motion: motion.as_slice().to_vec(),
        covariance,
    })
}
