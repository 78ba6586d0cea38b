//! Postures for the least determined combination of parameters: E-optimal, with a certificate from the relaxed problem.
//!
//! ```text
//! t(M) = 1/λ_max(S K Sᵀ) = the largest t with M ⪰ t Sᵀ S        S: the wanted combinations; all: t = λ_min(M)             (1)
//! relaxed:  max t   with   X = M₀ + Σ w_i Y_iᵀ Y_i − t SᵀS ⪰ 0,   0 ≤ w_i ≤ 1,   Σ w_i = n                             (2)
//! t(M(w)) ≤ tr(Z M₀) + sum of the n largest tr(Y_i Z Y_iᵀ)       for every w of (2) and Z ⪰ 0 with tr(Z SᵀS) = 1        (3)
//! efficiency in σ ≥ √(t(M) / (right side of (3)))                                                                       (4)
//! ```
//!
//! (3) because `t ≤ tr(Z M)` for such Z. It holds for every Z and is tight at the dual solution of (2), `Z = X⁻¹/tr(X⁻¹ SᵀS)` on its
//! central path, which Newton's method follows:
//!
//! ```text
//! min −τ t − log det X − Σ (log w_i + log(1 − w_i)),   τ → ∞          the gap of (2) is at most (p + 2N)/τ             (5)
//! ∂²/∂w_i∂w_j = tr(X⁻¹ A_i X⁻¹ A_j),   A_i = Y_iᵀ Y_i,   −SᵀS in place of A for t                                       (6)
//! ```
//!
//! Clarabel solves matrix inequalities with an installed BLAS only; (2) has one of a few dozen rows. Exchanges see λ_max through
//! `(Σ μ^q)^(1/q)`, μ: eigenvalues of S K Sᵀ, so that one posture that improves one of two equal directions counts; then by itself.

use calib_geometry::decompose;
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use crate::design::{Criterion, Question, inverse};

/// Postures that the relaxed problem takes at first beside the chosen ones, and in each round after that.
const ADMITTED: usize = 60;
/// Rounds of taking postures.
const ADMISSIONS: usize = 4;
/// Gap of the relaxed problem that is left, of t.
const GAP: f64 = 2e-3;
/// τ grows by this factor.
const GROWTH: f64 = 8.0;
/// Newton steps for one τ at the most.
const STEPS: usize = 30;
/// Postures that exchanges choose from: those with the largest tr(Y Z Yᵀ).
const PROMISING: usize = 60;
/// Rounds of exchanges at the most.
const ROUNDS: usize = 8;
/// An exchange that gains less, of the logarithm, ends the rounds.
const GAIN: f64 = 1e-5;
/// q of the exchanges: ten equal directions count as 1.15 times the worst of them, and none beside it.
const POWERS: [f64; 2] = [16.0, f64::INFINITY];

/// A point near the solution of equation (2).
struct Relaxed {
    /// Postures that have a weight, and their weights.
    weights: Vec<(usize, f64)>,
    /// Z of equation (3).
    z: DMatrix<f64>,
}

impl Question<'_> {
    /// The postures for equation (1): from those with the largest weights of (2) and from those of the smallest mean variance, the
    /// better after exchanges.
    pub(crate) fn choose_smallest(
        &self,
        s: &DMatrix<f64>,
        count: usize,
        taken: &[usize],
    ) -> Vec<usize> {
        let mean = Criterion::Trace(s.transpose() * s);
        let by_mean = Question {
            criterion: &mean,
            ..*self
        };
        let mut best = by_mean.quick(count, taken);
        let Some(relaxed) = self.relaxed(s, &best) else {
            return best;
        };
        let mut weights = relaxed.weights;
        weights.retain(|(i, _)| !taken.contains(i));
        weights.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let mut heaviest: Vec<usize> = weights.iter().take(count).map(|w| w.0).collect();
        let promising = self.promising(&relaxed.z, taken);
        self.exchange_smallest(s, &mut best, &promising);
        if heaviest.len() == count {
            self.exchange_smallest(s, &mut heaviest, &promising);
            if self.value(&heaviest) > self.value(&best) {
                best = heaviest;
            }
        }
        best
    }

    /// Equation (4).
    pub(crate) fn certificate_smallest(&self, s: &DMatrix<f64>, chosen: &[usize]) -> Option<f64> {
        let own = self.value(chosen)?;
        let z = self.relaxed(s, chosen)?.z;
        let bound = self.bound_smallest(&z, chosen.len());
        Some((own / bound).min(1.0).sqrt())
    }

    /// Right side of equation (3).
    fn bound_smallest(&self, z: &DMatrix<f64>, n: usize) -> f64 {
        let mut gains = self.along(z);
        gains.sort_by(|a, b| b.total_cmp(a));
        z.dot(self.before) + gains.iter().take(n).sum::<f64>()
    }

    fn promising(&self, z: &DMatrix<f64>, taken: &[usize]) -> Vec<usize> {
        let gains = self.along(z);
        let mut all: Vec<usize> = (0..gains.len()).filter(|i| !taken.contains(i)).collect();
        all.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]).then(a.cmp(b)));
        all.truncate(PROMISING);
        all
    }

    /// Replaces postures by promising ones while that is better.
    fn exchange_smallest(&self, s: &DMatrix<f64>, chosen: &mut [usize], promising: &[usize]) {
        for power in POWERS {
            for _ in 0..ROUNDS {
                if !self.round_smallest(s, power, chosen, promising) {
                    break;
                }
            }
        }
    }

    fn round_smallest(
        &self,
        s: &DMatrix<f64>,
        power: f64,
        chosen: &mut [usize],
        promising: &[usize],
    ) -> bool {
        let mut gained = false;
        for place in 0..chosen.len() {
            let whole = self.information(chosen);
            let Some(now) = inverse(&whole).map(|k| merit(s, &k, power)) else {
                return false;
            };
            let old = &self.rows[chosen[place]];
            let without = whole - old.transpose() * old;
            let open: Vec<usize> = promising
                .iter()
                .copied()
                .filter(|i| !chosen.contains(i))
                .collect();
            let of = |i: usize| {
                let mut m = without.clone();
                m.gemm_tr(1.0, &self.rows[i], &self.rows[i], 1.0);
                inverse(&m).map_or(f64::NEG_INFINITY, |k| merit(s, &k, power))
            };
            let merits: Vec<(usize, f64)> = open.par_iter().map(|i| (*i, of(*i))).collect();
            let better = |a: (usize, f64), b: (usize, f64)| if b.1 > a.1 { b } else { a };
            if let Some((new, merit)) = merits.into_iter().reduce(better)
                && merit > now + GAIN
            {
                chosen[place] = new;
                gained = true;
            }
        }
        gained
    }

    /// A point near the solution of equation (2), among the postures that matter; `None` where no start is inside.
    fn relaxed(&self, s: &DMatrix<f64>, chosen: &[usize]) -> Option<Relaxed> {
        let n = chosen.len();
        let k = inverse(&self.information(chosen))?;
        let mut z = self.criterion.derivative(&k)?;
        let mut among = chosen.to_vec();
        let mut best: Option<(f64, Relaxed)> = None;
        for _ in 0..ADMISSIONS {
            let before = among.len();
            let gains = self.along(&z);
            let mut order: Vec<usize> = (0..gains.len()).filter(|i| !among.contains(i)).collect();
            order.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]).then(a.cmp(b)));
            among.extend(order.into_iter().take(ADMITTED));
            if among.len() == before {
                break;
            }
            let Some(found) = Barrier::new(self, s, &among, n).solved() else {
                break;
            };
            let bound = self.bound_smallest(&found.z, n);
            z = found.z.clone();
            // Those without weight make room.
            let heavy = |i: &usize| found.weights.iter().any(|w| w.0 == *i && w.1 > 1e-3);
            among.retain(heavy);
            if best.as_ref().is_none_or(|b| bound < b.0) {
                best = Some((bound, found));
            } else {
                break;
            }
        }
        best.map(|b| b.1)
    }
}

/// The logarithm of `1/(Σ μ^q)^(1/q)`; at q = ∞ that of equation (1).
fn merit(s: &DMatrix<f64>, k: &DMatrix<f64>, power: f64) -> f64 {
    let values = decompose::symmetric_eigen(&(s * k * s.transpose())).values;
    let largest = values.max();
    if largest.is_nan() || largest <= 0.0 {
        return f64::NEG_INFINITY;
    }
    let beside = if power.is_finite() {
        let relative = values.iter().map(|v| (v / largest).max(0.0).powf(power));
        relative.sum::<f64>().ln() / power
    } else {
        0.0
    };
    -largest.ln() - beside
}

/// Equation (5) for some postures.
struct Barrier<'a> {
    question: &'a Question<'a>,
    among: &'a [usize],
    /// SᵀS.
    l: DMatrix<f64>,
    n: f64,
    w: DVector<f64>,
    t: f64,
}

impl<'a> Barrier<'a> {
    fn new(question: &'a Question<'a>, s: &DMatrix<f64>, among: &'a [usize], n: usize) -> Self {
        let count = among.len().max(1) as f64;
        Self {
            question,
            among,
            l: s.transpose() * s,
            n: n as f64,
            w: DVector::from_element(among.len(), n as f64 / count),
            t: 0.0,
        }
    }

    /// X of equation (2).
    fn x(&self, w: &DVector<f64>, t: f64) -> DMatrix<f64> {
        let mut x = self.question.before - &self.l * t;
        for (i, w) in self.among.iter().zip(w.iter()) {
            let y = &self.question.rows[*i];
            x.gemm_tr(*w, y, y, 1.0);
        }
        x
    }

    /// Equation (5); `None` outside.
    fn value(&self, tau: f64, w: &DVector<f64>, t: f64) -> Option<f64> {
        if w.iter().any(|w| *w <= 0.0 || *w >= 1.0) {
            return None;
        }
        let root = Cholesky::new(self.x(w, t))?;
        let log_det = 2.0 * root.l_dirty().diagonal().map(f64::ln).sum();
        let walls: f64 = w.iter().map(|w| w.ln() + (1.0 - w).ln()).sum();
        let value = -tau * t - log_det - walls;
        value.is_finite().then_some(value)
    }

    /// Follows the central path to the gap.
    fn solved(mut self) -> Option<Relaxed> {
        // With as many postures as are wanted no weight is inside.
        if self.n >= self.among.len() as f64 {
            return None;
        }
        let k = inverse(&self.x(&self.w, 0.0))?;
        // tr(S K Sᵀ) ≥ λ_max: half of this lower bound of t is inside.
        self.t = 0.5 / self.l.dot(&k).max(f64::MIN_POSITIVE);
        let size = (self.l.nrows() + 2 * self.among.len()) as f64;
        let mut tau = size / self.t;
        loop {
            self.center(tau)?;
            if size / tau < GAP * self.t {
                break;
            }
            tau *= GROWTH;
        }
        let inverse = inverse(&self.x(&self.w, self.t))?;
        let z = &inverse / self.l.dot(&inverse);
        let weights = self.among.iter().copied().zip(self.w.iter().copied());
        Some(Relaxed {
            weights: weights.collect(),
            z,
        })
    }

    /// Newton's method for equation (5) with Σ w = n.
    fn center(&mut self, tau: f64) -> Option<()> {
        /// Half of the squared Newton decrement that is left.
        const LEFT: f64 = 1e-3;
        let count = self.among.len();
        for _ in 0..STEPS {
            let (gradient, hessian) = self.derivatives(tau)?;
            let root = Cholesky::new(hessian)?;
            let ones = DVector::from_fn(count + 1, |i, _| f64::from(u8::from(i < count)));
            let (free, along) = (root.solve(&gradient), root.solve(&ones));
            // The step keeps Σ w.
            let step = -(&free - &along * (ones.dot(&free) / ones.dot(&along)));
            let slope = gradient.dot(&step);
            if -slope / 2.0 < LEFT {
                return Some(());
            }
            let now = self.value(tau, &self.w, self.t)?;
            let mut part = 1.0;
            loop {
                let w = &self.w + step.rows(0, count) * part;
                let t = self.t + step[count] * part;
                let value = self.value(tau, &w, t);
                if value.is_some_and(|v| v <= now + 0.1 * part * slope) {
                    (self.w, self.t) = (w, t);
                    break;
                }
                part *= 0.5;
                if part < 1e-9 {
                    // Rounding: the point is as good as numbers allow.
                    return Some(());
                }
            }
        }
        Some(())
    }

    /// Gradient and Hessian of equation (5) by (w, t); (6).
    fn derivatives(&self, tau: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let count = self.among.len();
        let p = self.l.nrows();
        let root = Cholesky::new(self.x(&self.w, self.t))?.l();
        // R⁻¹ A R⁻ᵀ of every posture as a column, X = R Rᵀ; the last is that of −SᵀS.
        let columns: Vec<DVector<f64>> = (0..=count)
            .into_par_iter()
            .filter_map(|c| {
                let whitened = match self.among.get(c) {
                    Some(i) => {
                        let y = root.solve_lower_triangular(&self.question.rows[*i].transpose())?;
                        &y * y.transpose()
                    }
                    None => {
                        let half = root.solve_lower_triangular(&self.l)?;
                        -root.solve_lower_triangular(&half.transpose())?
                    }
                };
                Some(DVector::from_column_slice(whitened.as_slice()))
            })
            .collect();
        if columns.len() != count + 1 {
            return None;
        }
        let all = DMatrix::from_columns(&columns);
        let mut hessian = all.tr_mul(&all);
        let mut gradient = DVector::zeros(count + 1);
        for i in 0..p {
            gradient -= all.row(i * (p + 1)).transpose();
        }
        gradient[count] -= tau;
        for (i, w) in self.w.iter().enumerate() {
            gradient[i] -= 1.0 / w - 1.0 / (1.0 - w);
            hessian[(i, i)] += w.powi(-2) + (1.0 - w).powi(-2);
        }
        Some((gradient, hessian))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Derivatives of equation (5) against differences of its values.
    #[test]
    fn derivatives_are_those_of_the_values() {
        let rows: Vec<DMatrix<f64>> = (0..7)
            .map(|k| DMatrix::from_fn(2, 4, |i, j| f64::sin((k * 11 + i * 5 + j * 3) as f64)))
            .collect();
        let before = DMatrix::identity(4, 4);
        let s = DMatrix::identity(4, 4).rows(1, 2).into_owned();
        let criterion = Criterion::Smallest(s.clone());
        let question = Question {
            rows: &rows,
            before: &before,
            criterion: &criterion,
        };
        let among: Vec<usize> = (0..7).collect();
        let mut barrier = Barrier::new(&question, &s, &among, 3);
        barrier.t = 0.3;
        let (gradient, hessian) = barrier.derivatives(2.0).expect("inside");
        let h = 1e-5;
        for i in 0..8 {
            let moved = |by: f64| {
                let (mut w, mut t) = (barrier.w.clone(), barrier.t);
                match i {
                    7 => t += by,
                    _ => w[i] += by,
                }
                let mut other = Barrier::new(&question, &s, &among, 3);
                (other.w, other.t) = (w, t);
                other
            };
            let value = |b: &Barrier<'_>| b.value(2.0, &b.w, b.t).expect("inside");
            let slope = (value(&moved(h)) - value(&moved(-h))) / (2.0 * h);
            assert!(
                (slope - gradient[i]).abs() < 1e-6,
                "{i}: {slope} {}",
                gradient[i]
            );
            let of = |by: f64| moved(by).derivatives(2.0).expect("inside").0;
            let column = (of(h) - of(-h)) / (2.0 * h);
            assert!((column - hessian.column(i)).amax() < 1e-5, "{i}");
        }
    }

    /// The bound of the relaxed problem is as near to its value as was asked for, and no weights are better.
    #[test]
    fn the_relaxed_problem_is_solved_to_its_gap() {
        let rows: Vec<DMatrix<f64>> = (0..40)
            .map(|k| DMatrix::from_fn(3, 6, |i, j| f64::cos((k * 17 + i * 7 + j * 29) as f64)))
            .collect();
        let before = DMatrix::identity(6, 6) * 0.1;
        let s = DMatrix::identity(6, 6);
        let criterion = Criterion::Smallest(s.clone());
        let question = Question {
            rows: &rows,
            before: &before,
            criterion: &criterion,
        };
        let relaxed = question.relaxed(&s, &[0, 1, 2, 3, 4]).expect("inside");
        let mut m = before.clone();
        for (i, w) in &relaxed.weights {
            m.gemm_tr(*w, &rows[*i], &rows[*i], 1.0);
        }
        let t = m.symmetric_eigenvalues().min();
        let bound = question.bound_smallest(&relaxed.z, 5);
        assert!(bound >= t && bound <= t * (1.0 + 2.0 * GAP), "{t} {bound}");
    }
}
