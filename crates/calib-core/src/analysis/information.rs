//! What the data say about the parameters: the whitened Jacobian's triangular factor, its singular
//! values, and the posterior covariance.
//!
//! ```text
//! A = [V_s^(-½) J_s]_s · S = Q R,   R = U diag(d) Wᵀ,   S = diag(prior σ, or 1°, 1 cm, …)     (1)
//! C = S (RᵀR + P)⁺ S,   P = S Λ S                                                             (2)
//! ```
//!
//! R comes from QR block by block over the samples: JᵀWJ would lose every direction below 1e-8 of the
//! strongest, and those are the ones that matter here.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use nalgebra::{DMatrix, DVector};

use calib_geometry::decompose::{self, NullSpace, RightSingular, lower_inverse};

use crate::model::cache::State;
use crate::model::layout::Model;
use crate::model::parts::Part;
use crate::model::values::Values;
use crate::solve::chunks::{chunked, is_one_chunk};
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::rows::SampleRows;
use crate::solve::structured::RandomPart;

/// A direction whose singular value is below this fraction of the largest is a gauge: rounding
/// leaves about 1e-14, the weakest physical effect seen on real robots about 1e-6.
pub const NULL_TOLERANCE: f64 = 1e-9;

/// Sum of squares, of rows in units of their σ, that is nothing: its square root is far above the least number that has all digits.
const NOTHING: f64 = 1e-280;

/// Upper-triangular factor, built up by appending rows (row-major n × n).
#[derive(Debug, Clone)]
pub(crate) struct StreamedQr {
    n: usize,
    r: Vec<f64>,
    pending: Vec<f64>,
    rows: usize,
}

impl StreamedQr {
    pub(crate) fn new(n: usize) -> Self {
        Self {
            n,
            r: vec![0.0; n * n],
            pending: Vec::new(),
            rows: 0,
        }
    }

    pub(crate) fn append(&mut self, row: &[f64]) {
        self.pending.extend_from_slice(row);
        self.rows += 1;
        // Blocks of a few n amortise the pass over R.
        if self.rows >= 2 * self.n.max(8) {
            self.reduce();
        }
    }

    /// Householder reflections that fold the pending rows into R.
    fn reduce(&mut self) {
        let (n, m) = (self.n, self.rows);
        let (r, b) = (&mut self.r, &mut self.pending);
        let mut dots = vec![0.0; n];
        for k in 0..n {
            let mut tail = 0.0;
            for i in 0..m {
                tail += b[i * n + k] * b[i * n + k];
            }
            // What rounding leaves of fewer rows than columns shrinks to its own rounding in each column, until squares are lost.
            if tail < NOTHING {
                continue;
            }
            let pivot = r[k * n + k];
            let norm = pivot.hypot(tail.sqrt());
            let alpha = if pivot > 0.0 { -norm } else { norm };
            // v = [pivot − α; column], reflect every later column by I − 2vvᵀ/vᵀv.
            let head = pivot - alpha;
            let scale = 2.0 / (head * head + tail);
            for c in k + 1..n {
                dots[c] = head * r[k * n + c];
            }
            for i in 0..m {
                let v = b[i * n + k];
                if v != 0.0 {
                    for (d, &x) in dots[k + 1..].iter_mut().zip(&b[i * n + k + 1..(i + 1) * n]) {
                        *d += v * x;
                    }
                }
            }
            for c in k + 1..n {
                dots[c] *= scale;
                r[k * n + c] -= head * dots[c];
            }
            r[k * n + k] = alpha;
            for i in 0..m {
                let v = b[i * n + k];
                if v != 0.0 {
                    b[i * n + k] = 0.0;
                    for (x, &d) in b[i * n + k + 1..(i + 1) * n].iter_mut().zip(&dots[k + 1..]) {
                        *x -= v * d;
                    }
                }
            }
        }
        self.pending.clear();
        self.rows = 0;
    }

    /// R, n × n upper triangular.
    pub(crate) fn finish(mut self) -> DMatrix<f64> {
        self.reduce();
        DMatrix::from_row_slice(self.n, self.n, &self.r)
    }
}

/// Spectrum and covariance at a solution.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Information {
    /// S of equation (1): one length unit per free parameter.
    pub scale: DVector<f64>,
    /// How many directions the data see at all.
    pub rank: usize,
    /// C of equation (2), with prior; directions that neither data nor prior see count as 0 here and
    /// are listed in `indeterminate`.
    pub covariance: DMatrix<f64>,
    /// Unit directions (in units of `scale`) that neither data nor prior determine.
    pub indeterminate: DMatrix<f64>,
    /// R of equation (1), upper triangular.
    pub root: DMatrix<f64>,
    /// Directions that the data do not see at all.
    null: DMatrix<f64>,
    /// d and W of equation (1): many times the price of all else here, and few ask.
    spectrum: OnceLock<RightSingular>,
}

/// The triangular factor of a part's rows of some samples, columns in units of `scale`, those of the part.
///
/// Of the markers of a body six rows say all of its motion. What the others say of the markers' own places is the same as long as the same markers are
/// seen, and is taken once with its count.
fn factor_of(
    objective: Objective,
    at: State,
    samples: Range<usize>,
    scale: &DVector<f64>,
    part: &Arc<Part>,
) -> Option<DMatrix<f64>> {
    let Objective {
        model,
        weights,
        theta,
    } = objective;
    let mut rows = SampleRows::of(model, part);
    let mut random = RandomPart::default();
    let n = rows.n;
    let mut qr = StreamedQr::new(n);
    let (mut whitened, mut scaled) = (vec![0.0; part.max_rows * n], vec![0.0; n]);
    let mut append = |qr: &mut StreamedQr, rows: &[f64], factor: f64| {
        for row in rows.chunks_exact(n.max(1)) {
            for (c, x) in row.iter().enumerate() {
                scaled[c] = x * scale[part.columns[c]] * factor;
            }
            qr.append(&scaled);
        }
    };
    let mut rests: BTreeMap<usize, Counted> = BTreeMap::new();
    for sample in samples {
        rows.fill_turned(model, at, (weights, theta), sample, |rest| {
            let counted = rests.entry(rest.measurement).or_default();
            if counted.turn != rest.turn {
                append(&mut qr, &counted.rows, counted.count.sqrt());
                *counted = Counted {
                    turn: rest.turn,
                    count: 0.0,
                    rows: rest.jacobian(n),
                };
            }
            counted.count += 1.0;
        });
        let m = rows.m;
        if m == 0 {
            continue;
        }
        rows.whiten_blocks(model, weights, theta, true)?;
        rows.random_part(&mut random)?;
        let whitened = &mut whitened[..m * n];
        random.whiten_rows(&rows.j[..m * n], n, whitened);
        append(&mut qr, whitened, 1.0);
    }
    for counted in rests.into_values() {
        append(&mut qr, &counted.rows, counted.count.sqrt());
    }
    Some(qr.finish())
}

/// Rows that so many samples have in common.
#[derive(Default)]
struct Counted {
    turn: usize,
    count: f64,
    rows: Vec<f64>,
}

/// R over all columns, from that of each part.
fn joined(model: &Model, parts: impl Iterator<Item = DMatrix<f64>>) -> DMatrix<f64> {
    let n = model.free();
    let mut all = StreamedQr::new(n);
    let mut row = vec![0.0; n];
    for (part, factor) in model.parts.iter().zip(parts) {
        if model.parts.len() == 1 && part.columns.len() == n {
            return factor;
        }
        for own in factor.row_iter() {
            row.fill(0.0);
            for (x, &column) in own.iter().zip(&part.columns) {
                row[column] = *x;
            }
            all.append(&row);
        }
    }
    all.finish()
}

/// K with K Kᵀ = (RᵀR + P)⁻¹, from the triangular factor of [R; P^½]; `None` where some direction may be known by neither.
fn posterior_root(r: &DMatrix<f64>, priors: &[(usize, f64)]) -> Option<DMatrix<f64>> {
    /// Largest |R| |R⁻¹| of a factor that leaves no doubt: far from [`NULL_TOLERANCE`].
    const CONDITION: f64 = 1e8;
    let n = r.ncols();
    let mut factor = StreamedQr::new(n);
    for (i, row) in factor.r.chunks_exact_mut(n.max(1)).enumerate() {
        row.iter_mut()
            .zip(r.row(i).iter())
            .for_each(|(to, x)| *to = *x);
    }
    let mut row = vec![0.0; n];
    for &(c, weight) in priors {
        row[c] = weight;
        factor.append(&row);
        row[c] = 0.0;
    }
    let factor = factor.finish();
    // Column after column of F is row after row of Fᵀ; those of its inverse are the columns of F⁻¹.
    let inverse = DMatrix::from_vec(n, n, lower_inverse(factor.as_slice(), n));
    (factor.norm() * inverse.norm() < CONDITION).then_some(inverse)
}

impl Information {
    /// Equations (1) and (2) at `values`; `None` when the model cannot be evaluated there.
    #[must_use]
    pub fn at(model: &Model, values: &Values, weights: &[f64], theta: &[f64]) -> Option<Self> {
        let n = model.free();
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, values);
        let scale = DVector::from_iterator(
            n,
            model
                .columns
                .iter()
                .map(|&p| model.problem.parameters[p].scale()),
        );
        let objective = Objective {
            model,
            weights,
            theta,
        };
        let at = State::new(&model.problem, &work.cache, values);
        let of = |samples: Range<usize>| -> Option<Vec<DMatrix<f64>>> {
            let parts = model.parts.iter();
            parts
                .map(|part| factor_of(objective, at, samples.clone(), &scale, part))
                .collect()
        };
        let count = model.problem.samples;
        let r = if is_one_chunk(count) {
            joined(model, of(0..count)?.into_iter())
        } else {
            let parts = model.parts.iter();
            let mut sums: Vec<StreamedQr> = parts
                .map(|part| StreamedQr::new(part.columns.len()))
                .collect();
            chunked(count, of, |chunk| {
                for (sum, factor) in sums.iter_mut().zip(chunk) {
                    let rows = factor.row_iter();
                    rows.for_each(|row| sum.append(row.transpose().as_slice()));
                }
            })?;
            joined(model, sums.into_iter().map(StreamedQr::finish))
        };
        if !r.iter().all(|x| x.is_finite()) {
            return None;
        }
        Some(Self::from_factor(model, scale, r))
    }

    fn from_factor(model: &Model, scale: DVector<f64>, r: DMatrix<f64>) -> Self {
        let n = scale.len();
        let spectrum = OnceLock::new();
        let of_all = || spectrum.get_or_init(|| decompose::right_singular(&r));
        let NullSpace { rank, basis: null } = decompose::null_space(&r, NULL_TOLERANCE)
            .unwrap_or_else(|| {
                let RightSingular { s, v } = of_all();
                let rank = decompose::rank(s, NULL_TOLERANCE);
                NullSpace {
                    rank,
                    basis: v.columns(rank, n - rank).into_owned(),
                }
            });
        // [R; P^½]
        let priors: Vec<(usize, f64)> = model
            .columns
            .iter()
            .enumerate()
            .filter_map(|(c, &p)| {
                let sigma = model.problem.parameters[p].prior_sigma?;
                Some((c, scale[c] / sigma))
            })
            .collect();
        let (mut half, indeterminate) = match posterior_root(&r, &priors) {
            Some(root) => (root, DMatrix::zeros(n, 0)),
            None => {
                let mut augmented = DMatrix::zeros(n + priors.len(), n);
                augmented.view_mut((0, 0), (n, n)).copy_from(&r);
                for (i, &(c, weight)) in priors.iter().enumerate() {
                    augmented[(n + i, c)] = weight;
                }
                let posterior = if priors.is_empty() {
                    of_all().clone()
                } else {
                    decompose::right_singular(&augmented)
                };
                let known = decompose::rank(&posterior.s, NULL_TOLERANCE * 1e-3);
                let known = if priors.is_empty() { rank } else { known };
                let mut half = posterior.v.columns(0, known).into_owned();
                for i in 0..known {
                    half.column_mut(i).unscale_mut(posterior.s[i]);
                }
                (half, posterior.v.columns(known, n - known).into_owned())
            }
        };
        // C = S W d⁻² Wᵀ S
        for c in 0..n {
            half.row_mut(c).scale_mut(scale[c]);
        }
        let covariance = &half * half.transpose();
        Self {
            scale,
            rank,
            covariance,
            indeterminate,
            root: r,
            null,
            spectrum,
        }
    }

    /// H = JᵀV⁻¹J + Λ from R of equation (1), without another pass over the samples.
    pub(crate) fn curvature(&self, model: &Model) -> NormalEquations {
        let n = self.scale.len();
        let mut system = NormalEquations::new(n);
        let squared = self.root.transpose() * &self.root;
        for i in 0..n {
            for j in i..n {
                system.h[i * n + j] = squared[(i, j)] / (self.scale[i] * self.scale[j]);
            }
        }
        for (i, &p) in model.columns.iter().enumerate() {
            if let Some(sigma) = model.problem.parameters[p].prior_sigma {
                system.h[i * n + i] += sigma.powi(-2);
            }
        }
        system
    }

    /// tr(C JᵀV⁻¹J): how many parameters the data determined.
    pub(crate) fn effective_parameters(&self) -> f64 {
        // A = Q R carries S, C carries S on both sides: tr(R S⁻¹ C S⁻¹ Rᵀ)
        let n = self.scale.len();
        let mut unscaled = self.covariance.clone();
        for i in 0..n {
            for j in 0..n {
                unscaled[(i, j)] /= self.scale[i] * self.scale[j];
            }
        }
        (&self.root * unscaled).dot(&self.root)
    }

    /// d of equation (1), descending: how many σ of the data one prior σ along each direction is.
    #[must_use]
    pub fn singular_values(&self) -> &DVector<f64> {
        &self.spectrum().s
    }

    /// W of equation (1): columns are directions in units of `scale`, in the order of `singular_values`.
    #[must_use]
    pub fn directions(&self) -> &DMatrix<f64> {
        &self.spectrum().v
    }

    fn spectrum(&self) -> &RightSingular {
        let of_root = || decompose::right_singular(&self.root);
        self.spectrum.get_or_init(of_root)
    }

    /// Directions that the data do not see at all, orthonormal columns in units of `scale`.
    #[must_use]
    pub fn null_space(&self) -> &DMatrix<f64> {
        &self.null
    }

    /// Posterior σ of a free parameter; `None` where nothing determines it.
    #[must_use]
    pub fn sigma(&self, column: usize) -> Option<f64> {
        let leak = self.indeterminate.row(column).norm();
        (leak < INDETERMINATE).then(|| self.covariance[(column, column)].max(0.0).sqrt())
    }

    /// Posterior σ along singular direction i, in units of `scale`: `√(w_iᵀ S⁻¹ C S⁻¹ w_i)`.
    #[must_use]
    pub fn posterior_along(&self, i: usize) -> f64 {
        let w = self.directions().column(i).component_div(&self.scale);
        (&self.covariance * &w).dot(&w).max(0.0).sqrt()
    }

    /// Largest share of a unit null direction in this column: 0 when the data alone determine it.
    #[must_use]
    pub fn null_share(&self, column: usize) -> f64 {
        self.null.row(column).norm()
    }
}

/// A component of a unit null vector under this is rounding.
pub(crate) const INDETERMINATE: f64 = 1e-5;

#[cfg(test)]
mod tests;
