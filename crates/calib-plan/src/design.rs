//! The choice of postures: greedy, exchange, and a certificate.
//!
//! ```text
//! M = M₀ + Σ_i Y_iᵀ Y_i,   K = M⁻¹                    Y_i: whitened rows of posture i (calib-core), M₀: known before   (1)
//! determinant   log det M                    H = K                                                                     (2)
//! subset        −log det S K Sᵀ              H = K Sᵀ (S K Sᵀ)⁻¹ S K     the others are nuisances                      (3)
//! trace         −tr(L K)                     H = K L K                                                                 (4)
//! smallest      1/λ_max(S K Sᵀ)              in `smallest`
//! ```
//!
//! H is the derivative by M. A posture changes K by a matrix of its rows' rank (Woodbury, with `C = 1 ± Y K Yᵀ`):
//!
//! ```text
//! K ± = K ∓ K Yᵀ C⁻¹ Y K                                                                                              (5)
//! gain by (2): log det C,   by (3): log det C − log det(C ∓ Y H Yᵀ),   by (4): tr(C⁻¹ Y H Yᵀ)                         (6)
//! ```
//!
//! How far the choice is from the best possible is the subject of `bound`.

use calib_geometry::decompose;
use nalgebra::{Cholesky, DMatrix};
use rayon::prelude::*;

/// What a design is to be good at.
#[derive(Debug, Clone, PartialEq)]
pub enum Criterion {
    /// All parameters, equation (2): D-optimal.
    Determinant,
    /// Some combinations of them, the rows of the matrix, equation (3): D_s-optimal.
    Subset(DMatrix<f64>),
    /// The mean variance of a task, equation (4), L ≥ 0: I-optimal; with L = 1 A-optimal.
    Trace(DMatrix<f64>),
    /// The least determined combination of some, the rows of the matrix: E-optimal.
    Smallest(DMatrix<f64>),
}

/// What is to be chosen from.
#[derive(Debug, Clone, Copy)]
pub struct Question<'a> {
    /// Y of equation (1) by posture: any number of rows, the same columns.
    pub rows: &'a [DMatrix<f64>],
    /// M₀ of equation (1).
    pub before: &'a DMatrix<f64>,
    /// What is to be good.
    pub criterion: &'a Criterion,
}

/// Added to M₀ while too few postures are chosen: a hundred prior σ (a meter, a hundred degrees) of what has no prior.
const RIDGE: f64 = 1e-4;
/// A round of exchanges, the weakest first, ends when so many in a row gain nothing.
const WEAKEST: usize = 12;
/// Rounds of exchanges at the most.
const ROUNDS: usize = 20;
/// Postures that exchanges choose from: those with the largest derivative of the criterion.
const PROMISING: usize = 300;
/// Postures that the greedy choice is made from, the first of a sequence that fills the space: of more, the derivative tells which to exchange
/// them for.
const GREEDY: usize = 4096;
/// Postures whose rows are multiplied together.
const TOGETHER: usize = 64;
/// An exchange that gains less of the criterion ends the rounds: log of a determinant, relative for a trace.
const GAIN: f64 = 1e-6;

impl Question<'_> {
    /// Chooses `count` postures that are not among `taken`; fewer where there are fewer. Exchanges begin at the greedy choice and at the
    /// largest of the best weights (`bound`); the better end is taken.
    #[must_use]
    pub fn choose(&self, count: usize, taken: &[usize]) -> Vec<usize> {
        if let Criterion::Smallest(s) = self.criterion {
            return self.choose_smallest(s, count, taken);
        }
        let greedy = self.quick(count, taken);
        let Some(best) = self.mixture(&greedy) else {
            return greedy;
        };
        let mut weights = best.weights;
        weights.retain(|(i, _)| !taken.contains(i));
        weights.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let mut heaviest: Vec<usize> = weights.iter().take(count).map(|w| w.0).collect();
        if heaviest.len() < count {
            return greedy;
        }
        self.exchanged(&mut heaviest, taken);
        match (self.value(&heaviest), self.value(&greedy)) {
            (Some(a), Some(b)) if a > b => heaviest,
            _ => greedy,
        }
    }

    /// [`Question::choose`] from the greedy choice only: a few percent worse, in a fraction of the time.
    #[must_use]
    pub fn quick(&self, count: usize, taken: &[usize]) -> Vec<usize> {
        if let Some(mean) = self.criterion.smooth() {
            let question = Question {
                criterion: &mean,
                ..*self
            };
            return question.quick(count, taken);
        }
        let among = self.rows.len().min(GREEDY.max(8 * (count + taken.len())));
        let first = Question {
            rows: &self.rows[..among],
            ..*self
        };
        let mut free = vec![true; among];
        for &i in taken.iter().filter(|i| **i < among) {
            free[i] = false;
        }
        let mut chosen = State::new(&first).greedy(count, &mut free);
        self.exchanged(&mut chosen, taken);
        chosen
    }

    /// Exchanges the weakest of the chosen for others that are not taken and promise most.
    fn exchanged(&self, chosen: &mut [usize], taken: &[usize]) {
        let mut free = vec![true; self.rows.len()];
        for &i in chosen.iter().chain(taken) {
            free[i] = false;
        }
        let n = self.before.nrows();
        let ridged = self.information(chosen) + DMatrix::identity(n, n) * RIDGE;
        let Some(gains) = self.gains(&ridged) else {
            return;
        };
        let mut promising: Vec<usize> = (0..free.len()).filter(|i| free[*i]).collect();
        promising.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]).then(a.cmp(b)));
        promising.truncate(PROMISING);
        let among: Vec<usize> = chosen.iter().copied().chain(promising).collect();
        let rows: Vec<DMatrix<f64>> = among.iter().map(|i| self.rows[*i].clone()).collect();
        let question = Question {
            rows: &rows,
            ..*self
        };
        let mut state = State::new(&question);
        let mut places: Vec<usize> = (0..chosen.len()).collect();
        let mut free: Vec<bool> = (0..among.len()).map(|i| i >= chosen.len()).collect();
        for i in 0..chosen.len() {
            state.update(i, 1.0);
        }
        for _ in 0..ROUNDS {
            if !state.exchange(&mut places, &mut free) {
                break;
            }
        }
        for (chosen, place) in chosen.iter_mut().zip(places) {
            *chosen = among[place];
        }
    }

    /// The postures one after the other, each the best beside those before it.
    #[must_use]
    pub fn greedy(&self, count: usize) -> Vec<usize> {
        if let Some(mean) = self.criterion.smooth() {
            let question = Question {
                criterion: &mean,
                ..*self
            };
            return question.greedy(count);
        }
        State::new(self).greedy(count, &mut vec![true; self.rows.len()])
    }

    /// M of equation (1).
    #[must_use]
    pub fn information(&self, chosen: &[usize]) -> DMatrix<f64> {
        let mut m = self.before.clone();
        for &i in chosen {
            m.gemm_tr(1.0, &self.rows[i], &self.rows[i], 1.0);
        }
        m
    }

    /// tr(H Y_iᵀ Y_i) of all postures at M.
    pub(crate) fn gains(&self, m: &DMatrix<f64>) -> Option<Vec<f64>> {
        Some(self.along(&self.criterion.derivative(&inverse(m)?)?))
    }

    /// tr(Y_i H Y_iᵀ) of all postures.
    pub(crate) fn along(&self, h: &DMatrix<f64>) -> Vec<f64> {
        // One product for many postures: their rows side by side.
        let parts = self.rows.par_chunks(TOGETHER).map(|part| {
            let count = part.iter().map(DMatrix::nrows).sum();
            let mut rows = DMatrix::zeros(count, h.nrows());
            let mut at = 0;
            for y in part {
                rows.rows_mut(at, y.nrows()).copy_from(y);
                at += y.nrows();
            }
            let along = &rows * h;
            let mut at = 0;
            let gain = |y: &DMatrix<f64>| {
                let gain = along.rows(at, y.nrows()).dot(&rows.rows(at, y.nrows()));
                at += y.nrows();
                gain
            };
            part.iter().map(gain).collect::<Vec<f64>>()
        });
        parts.collect::<Vec<_>>().concat()
    }

    /// The criterion of some postures, the larger the better; `None` where M is singular.
    #[must_use]
    pub fn value(&self, chosen: &[usize]) -> Option<f64> {
        self.criterion.value(&inverse(&self.information(chosen))?)
    }
}

impl Criterion {
    /// The mean variance in place of the largest: what a single posture changes shows in it also before all directions are determined.
    fn smooth(&self) -> Option<Self> {
        match self {
            Self::Smallest(s) => Some(Self::Trace(s.transpose() * s)),
            _ => None,
        }
    }

    /// Equations (2) to (4) from K.
    pub(crate) fn value(&self, k: &DMatrix<f64>) -> Option<f64> {
        match self {
            Self::Determinant => Some(-log_det(k)?),
            Self::Subset(s) => Some(-log_det(&(s * k * s.transpose()))?),
            Self::Trace(l) => Some(-l.dot(k)),
            Self::Smallest(s) => {
                let largest = decompose::symmetric_eigen(&(s * k * s.transpose()))
                    .values
                    .max();
                (largest > 0.0).then(|| 1.0 / largest)
            }
        }
    }

    /// H from K.
    pub(crate) fn derivative(&self, k: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        match self {
            Self::Determinant => Some(k.clone()),
            Self::Subset(s) => {
                let sk = s * k;
                let inner = inverse(&(&sk * s.transpose()))?;
                Some(sk.transpose() * inner * sk)
            }
            Self::Trace(l) => Some(k * l * k),
            // Of the largest μ = uᵀ S K Sᵀ u: K Sᵀ u uᵀ S K / μ²
            Self::Smallest(s) => {
                let spectrum = decompose::symmetric_eigen(&(s * k * s.transpose()));
                let (place, largest) = spectrum.values.argmax();
                let along = k * s.transpose() * spectrum.vectors.column(place);
                (largest > 0.0).then(|| &along * along.transpose() / (largest * largest))
            }
        }
    }
}

/// K, H, and what follows from them for every posture.
struct State<'a> {
    question: &'a Question<'a>,
    k: DMatrix<f64>,
    h: DMatrix<f64>,
    /// Y K Yᵀ.
    s: Vec<DMatrix<f64>>,
    /// Y H Yᵀ; empty for the determinant, where it is Y K Yᵀ.
    t: Vec<DMatrix<f64>>,
}

impl<'a> State<'a> {
    fn new(question: &'a Question<'a>) -> Self {
        let n = question.before.nrows();
        let ridged = question.before + DMatrix::identity(n, n) * RIDGE;
        let k = inverse(&ridged).unwrap_or_else(|| DMatrix::identity(n, n) / RIDGE);
        let h = question.criterion.derivative(&k);
        let h = h.unwrap_or_else(|| DMatrix::zeros(n, n));
        let around = |m: &DMatrix<f64>| -> Vec<DMatrix<f64>> {
            let rows = question.rows.par_iter();
            rows.map(|y| y * m * y.transpose()).collect()
        };
        let (s, t) = match question.criterion {
            Criterion::Determinant => (around(&k), Vec::new()),
            _ => (around(&k), around(&h)),
        };
        Self {
            question,
            k,
            h,
            s,
            t,
        }
    }

    fn greedy(&mut self, count: usize, free: &mut [bool]) -> Vec<usize> {
        let mut chosen = Vec::new();
        while chosen.len() < count {
            let Some(best) = self.best(free) else { break };
            self.update(best.0, 1.0);
            free[best.0] = false;
            chosen.push(best.0);
        }
        chosen
    }

    /// Equation (6): what adding (`sign` 1) or removing (−1) a posture changes the criterion by.
    fn change(&self, i: usize, sign: f64) -> f64 {
        let s = &self.s[i];
        let c = DMatrix::identity(s.nrows(), s.nrows()) + s * sign;
        match self.question.criterion {
            Criterion::Determinant => log_det(&c).unwrap_or(f64::NEG_INFINITY),
            Criterion::Subset(_) => {
                let rest = log_det(&(&c - &self.t[i] * sign));
                match (log_det(&c), rest) {
                    (Some(all), Some(rest)) => all - rest,
                    _ => f64::NEG_INFINITY,
                }
            }
            Criterion::Trace(_) => {
                trace_of_solved(c, &self.t[i]).map_or(f64::NEG_INFINITY, |t| sign * t)
            }
            // Its exchanges are those of `smallest`.
            Criterion::Smallest(_) => f64::NEG_INFINITY,
        }
    }

    /// The free posture that gains most, and its gain; of equal ones the first.
    fn best(&self, free: &[bool]) -> Option<(usize, f64)> {
        let gains: Vec<(usize, f64)> = (0..free.len())
            .into_par_iter()
            .filter(|i| free[*i])
            .map(|i| (i, self.change(i, 1.0)))
            .collect();
        let better = |a: (usize, f64), b: (usize, f64)| if b.1 > a.1 { b } else { a };
        gains.into_iter().reduce(better)
    }

    /// Equation (5), and its consequences for every posture.
    fn update(&mut self, i: usize, sign: f64) {
        let y = &self.question.rows[i];
        let c = DMatrix::identity(y.nrows(), y.nrows()) + &self.s[i] * sign;
        let Some(root) = Cholesky::new(c) else { return };
        // W = K Yᵀ C^(−½): K± = K ∓ W Wᵀ
        let Some(w) = root.l().solve_lower_triangular(&(y * &self.k)) else {
            return;
        };
        let w = w.transpose();
        let rows = self.question.rows;
        self.k -= &w * w.transpose() * sign;
        let of_k = |(s, y): (&mut DMatrix<f64>, &DMatrix<f64>)| {
            let yw = y * &w;
            s.gemm(-sign, &yw, &yw.transpose(), 1.0);
        };
        self.s.par_iter_mut().zip(rows).for_each(of_k);
        match self.question.criterion {
            Criterion::Determinant | Criterion::Smallest(_) => {}
            Criterion::Trace(l) => {
                // H± = H ∓ W (K L W)ᵀ ∓ (K L W) Wᵀ + W (Wᵀ L W) Wᵀ, with K before the change
                let lw = l * &w;
                let g = w.transpose() * &lw;
                let klw = (&self.k + &w * w.transpose() * sign) * lw;
                let half = &klw - &w * &g * (0.5 * sign);
                self.h -= (&half * w.transpose() + &w * half.transpose()) * sign;
                let of_h = |(t, y): (&mut DMatrix<f64>, &DMatrix<f64>)| {
                    let (yw, yh) = (y * &w, y * &half);
                    t.gemm(-sign, &yh, &yw.transpose(), 1.0);
                    t.gemm(-sign, &yw, &yh.transpose(), 1.0);
                };
                self.t.par_iter_mut().zip(rows).for_each(of_h);
            }
            Criterion::Subset(_) => {
                if let Some(h) = self.question.criterion.derivative(&self.k) {
                    self.h = h;
                    let h = &self.h;
                    let of_h = |(t, y): (&mut DMatrix<f64>, &DMatrix<f64>)| {
                        *t = y * h * y.transpose();
                    };
                    self.t.par_iter_mut().zip(rows).for_each(of_h);
                }
            }
        }
    }

    /// Replaces the weakest postures where others are better; whether that gained anything.
    fn exchange(&mut self, chosen: &mut [usize], free: &mut [bool]) -> bool {
        let mut by_loss: Vec<(usize, f64)> = (0..chosen.len())
            .map(|place| (place, self.change(chosen[place], -1.0)))
            .collect();
        by_loss.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let scale = match self.question.criterion {
            Criterion::Trace(l) => l.dot(&self.k).abs(),
            _ => 1.0,
        };
        let (mut gained, mut in_vain) = (false, 0);
        for (place, _) in by_loss {
            if in_vain == WEAKEST {
                break;
            }
            let old = chosen[place];
            let loss = self.change(old, -1.0);
            if !loss.is_finite() {
                continue;
            }
            self.update(old, -1.0);
            free[old] = true;
            let best = self.best(free).filter(|best| best.1.is_finite());
            let new = match best {
                Some((new, gain)) if gain + loss > GAIN * scale => new,
                _ => old,
            };
            gained |= new != old;
            in_vain = if new == old { in_vain + 1 } else { 0 };
            self.update(new, 1.0);
            free[new] = false;
            chosen[place] = new;
        }
        gained
    }
}

pub(crate) fn inverse(m: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    Some(Cholesky::new(m.clone())?.inverse())
}

fn log_det(m: &DMatrix<f64>) -> Option<f64> {
    let root = Cholesky::new(m.clone())?;
    let log_det = 2.0 * root.l_dirty().diagonal().map(f64::ln).sum();
    log_det.is_finite().then_some(log_det)
}

/// tr(C⁻¹ T) of symmetric C > 0 and T; `None` where C is not. The lower triangle of C becomes L, C = L Lᵀ.
fn trace_of_solved(mut c: DMatrix<f64>, t: &DMatrix<f64>) -> Option<f64> {
    let n = c.nrows();
    let data = c.as_mut_slice();
    for j in 0..n {
        let (before, column) = data.split_at_mut(j * n);
        for k in 0..j {
            let factor = before[k * n + j];
            let known = &before[k * n + j..(k + 1) * n];
            let rest = column[j..n].iter_mut().zip(known);
            rest.for_each(|(x, l)| *x -= factor * l);
        }
        let pivot = column[j];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        let root = pivot.sqrt();
        column[j..n].iter_mut().for_each(|x| *x /= root);
    }
    let mut total = 0.0;
    let mut column = vec![0.0; n];
    for j in 0..n {
        // From j down, column j of C⁻¹ is that of L⁻ᵀ L⁻¹.
        column[j..].fill(0.0);
        column[j] = 1.0;
        for k in j..n {
            let l = &data[k * n..(k + 1) * n];
            let x = column[k] / l[k];
            column[k] = x;
            let rest = column[k + 1..].iter_mut().zip(&l[k + 1..]);
            rest.for_each(|(y, l)| *y -= x * l);
        }
        for i in (j..n).rev() {
            let l = &data[i * n..(i + 1) * n];
            let below = l[i + 1..].iter().zip(&column[i + 1..]);
            let below: f64 = below.map(|(a, b)| a * b).sum();
            column[i] = (column[i] - below) / l[i];
        }
        let of_t = &t.as_slice()[j * n..(j + 1) * n];
        let below = column[j + 1..].iter().zip(&of_t[j + 1..]);
        total += column[j] * of_t[j] + 2.0 * below.map(|(a, b)| a * b).sum::<f64>();
    }
    Some(total)
}
