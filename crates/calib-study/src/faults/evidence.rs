//! What the recordings of a case show of its fault, to one who knows it.
//!
//! The samples of row i with the fault less those without it, free of noise at the same readings, are d_i. A test that knows the
//! fault, its place and its size, but neither where tracker and body stand nor the origins of the joints beyond the profile's priors P,
//! has the evidence
//!
//! ```text
//! V_i = σ² 1 + σ_J² Σ_j D_ij D_ijᵀ                 tracker and joints as they are
//! A_i = [tracker | body or its markers | origins]    what has to be estimated beside the fault
//! Λ = Σ dᵀV⁻¹d − bᵀ (Σ AᵀV⁻¹A + P)⁻¹ b,   b = Σ AᵀV⁻¹d,   evidence = √Λ                            (1)
//! ```
//!
//! in standard deviations: its statistic is N(√Λ, 1) with the fault and N(0, 1) without, and by Neyman and Pearson no test
//! has more power. No program knows the noise of the joints beforehand; from ν degrees of freedom it is known to 1/√(2ν), and what is asked for is
//!
//! ```text
//! ν = observations − tr((Σ AᵀV⁻¹A + P)⁻¹ Σ AᵀV⁻¹A) − 1,   t = t_ν(1 − 5·10⁻⁷)
//! √Λ ≥ t + 2.6 √(1 + t²/2ν)                            missed 1 in 200 times (Johnson and Welch 1940)           (2)
//! mean over χ²_ν of Φ(√Λ − t √(χ²/ν))                   how often it names the fault                             (3)
//! ```
//!
//! 10⁻⁶ for each of the thousand effects, places and rows that are tried is 1 in 1 000 recordings, the level of the program. What a discrete fault leaves is in [`odds`](super::odds).

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Isometry3, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

use super::case::{Case, SIGMA, SIGMA_JOINT, SIGMA_ORIENTATION, Seen};
use super::fault::Class;
use super::odds::moved;

/// What the recordings of a case show of its fault.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Shown {
    /// √Λ of equation (1), where the fault is an effect or a change.
    pub evidence: Option<f64>,
    /// What equation (2) asks of it.
    pub needed: Option<f64>,
    /// How often the best test names the fault, equation (3).
    pub chance: Option<f64>,
    /// What the fault moves the residual of a registration by, rms, m.
    pub moved_m: Option<f64>,
}

/// Of a case with a fault that the recordings can show.
pub(crate) fn shown(case: &Case) -> Shown {
    let class = case.cell.fault.class();
    let in_fitted = matches!(class, Class::Continuous | Class::Change);
    if !in_fitted && !matches!(class, Class::Discrete | Class::Pair) {
        return Shown::default();
    }
    let found = in_fitted.then(|| evidence(case)).flatten();
    Shown {
        evidence: found.map(|(evidence, _)| evidence),
        needed: found.map(|(_, best)| best.needed()),
        chance: found.map(|(evidence, best)| best.chance(evidence)),
        moved_m: moved(case, !in_fitted),
    }
}

/// What a test knows that knows the fault: the rows of the fitted recordings, whitened.
pub(super) struct Known {
    /// L⁻¹A and L⁻¹d of each row, V = L Lᵀ.
    pub rows: Vec<(DMatrix<f64>, DVector<f64>)>,
    /// Diagonal of P.
    pub prior: DVector<f64>,
    /// Of Σ AᵀV⁻¹A + P.
    pub factor: Cholesky<f64, Dyn>,
}

impl Known {
    /// `None` where the rows do not fix what has to be estimated.
    pub fn of(case: &Case) -> Option<Self> {
        let clean = case.without_fault();
        let body = match case.markers.len() {
            0 => 6,
            markers => 3 * markers,
        };
        let n = 6 + body + 6 * case.robot.joints.len();
        let prior = precision(case, 6 + body, n);
        let mut information = DMatrix::from_diagonal(&prior);
        let mut rows = Vec::new();
        for ((q, without), (_, with)) in clean.perfect().iter().zip(&case.perfect()) {
            let row = Row::new(&clean, q, without);
            let v = DMatrix::identity(row.a.nrows(), row.a.nrows())
                + SIGMA_JOINT * SIGMA_JOINT * &row.joints * row.joints.transpose();
            let l = Cholesky::new(v)?.l();
            let a = l.solve_lower_triangular(&row.a)?;
            let d = l.solve_lower_triangular(&difference(with, without))?;
            information += a.tr_mul(&a);
            rows.push((a, d));
        }
        Some(Self {
            rows,
            prior,
            factor: Cholesky::new(information)?,
        })
    }
}

/// Equation (1), and the test that has it.
fn evidence(case: &Case) -> Option<(f64, Best)> {
    let known = Known::of(case)?;
    let n = known.prior.len();
    let mut b = DVector::zeros(n);
    let (mut own, mut observations) = (0.0, 0);
    for (a, d) in &known.rows {
        b += a.tr_mul(d);
        own += d.norm_squared();
        observations += d.len();
    }
    let evidence = (own - b.dot(&known.factor.solve(&b))).max(0.0).sqrt();
    // tr(N⁻¹ (N − P)) = n − tr(N⁻¹ P)
    let held = known.factor.inverse().diagonal().dot(&known.prior);
    let freedom = observations as f64 - (n as f64 - held) - 1.0;
    Some((evidence, Best::of(freedom)))
}

/// The test that knows the fault and not the noise.
#[derive(Debug, Clone, Copy)]
struct Best {
    /// Its threshold t; infinite without a degree of freedom.
    threshold: f64,
    /// √(1 + t²/2ν)
    spread: f64,
    /// ν
    freedom: f64,
}

impl Best {
    fn of(freedom: f64) -> Self {
        /// Both sides together one in a million.
        const LEVEL: f64 = 5e-7;
        let student = (freedom >= 1.0).then(|| StudentsT::new(0.0, 1.0, freedom).ok());
        let Some(student) = student.flatten() else {
            return Self {
                threshold: f64::INFINITY,
                spread: 1.0,
                freedom,
            };
        };
        let threshold = student.inverse_cdf(1.0 - LEVEL);
        let spread = (1.0 + threshold * threshold / (2.0 * freedom)).sqrt();
        Self {
            threshold,
            spread,
            freedom,
        }
    }

    /// Equation (2).
    fn needed(self) -> f64 {
        /// Normal quantile of 99.5 %.
        const POWER: f64 = 2.6;
        (self.threshold + POWER * self.spread).min(f64::MAX)
    }

    /// Equation (3).
    fn chance(self, evidence: f64) -> f64 {
        /// Quantiles that stand for the distribution of the noise as found.
        const QUANTILES: usize = 64;
        let Some(squares) = ChiSquared::new(self.freedom)
            .ok()
            .filter(|_| self.threshold.is_finite())
        else {
            return 0.0;
        };
        let of = |k: usize| {
            let found = squares.inverse_cdf((k as f64 + 0.5) / QUANTILES as f64);
            let noise = (found / self.freedom).sqrt();
            Normal::standard().cdf(evidence - self.threshold * noise)
        };
        (0..QUANTILES).map(of).sum::<f64>() / QUANTILES as f64
    }
}

/// 1/σ² of the origins, as the profile says; nothing is known of tracker and body.
fn precision(case: &Case, first: usize, n: usize) -> DVector<f64> {
    let prior = case.prior();
    let sigma = [
        prior.tilt_deg.to_radians(),
        prior.tilt_deg.to_radians(),
        prior.offset_deg.to_radians(),
        prior.origin_mm * 1e-3,
        prior.origin_mm * 1e-3,
        prior.origin_mm * 1e-3,
    ];
    DVector::from_fn(n, |k, _| match k.checked_sub(first) {
        Some(k) => sigma[k % 6].powi(-2),
        None => 0.0,
    })
}

/// With the fault less without, in standard deviations of the tracker.
fn difference(with: &Seen, without: &Seen) -> DVector<f64> {
    if with.points.is_empty() {
        let moved = with.body.translation.vector - without.body.translation.vector;
        let turned = (with.body.rotation * without.body.rotation.inverse()).scaled_axis();
        let (moved, turned) = (moved / SIGMA, turned / SIGMA_ORIENTATION);
        return DVector::from_iterator(6, moved.iter().chain(&turned).copied());
    }
    let pairs = with.points.iter().zip(&without.points);
    let each = pairs.flat_map(|(a, b)| ((a - b) / SIGMA).iter().copied().collect::<Vec<_>>());
    DVector::from_vec(each.collect())
}

/// Columns of one row, in standard deviations of the tracker.
struct Row {
    a: DMatrix<f64>,
    /// D: by the motion of each joint.
    joints: DMatrix<f64>,
}

impl Row {
    fn new(case: &Case, q: &[f64], seen: &Seen) -> Self {
        let joints = &case.robot.joints;
        let points = seen.points.len();
        let body = if points == 0 { 6 } else { 3 * points };
        let rows = body;
        let mut out = Self {
            a: DMatrix::zeros(rows, 6 + body + 6 * joints.len()),
            joints: DMatrix::zeros(rows, joints.len()),
        };
        out.twists(0, seen, &case.tracker_from_root);
        if points == 0 {
            out.twists(6, seen, &seen.body);
        } else {
            // Each marker along the axes of the body.
            let turn = seen.body.rotation.to_rotation_matrix().into_inner() / SIGMA;
            for k in 0..points {
                out.a.view_mut((3 * k, 6 + 3 * k), (3, 3)).copy_from(&turn);
            }
        }
        let links = case.robot.links(q, &case.disturbance.transmission);
        for (j, joint) in joints.iter().enumerate() {
            let frame = case.tracker_from_root * links[j] * joint.actual;
            let first = 6 + body + 6 * j;
            out.twists(first, seen, &frame);
            let along = first + if joint.prismatic { 5 } else { 2 };
            let column = out.a.column(along).into_owned();
            out.joints.set_column(j, &column);
        }
        out
    }

    /// Six columns: rotation about and motion along the axes of a frame.
    fn twists(&mut self, first: usize, seen: &Seen, frame: &Isometry3<f64>) {
        for axis in 0..3 {
            let e = frame.rotation * Vector3::ith(axis, 1.0);
            let places = match seen.points.len() {
                0 => vec![seen.body.translation.vector],
                _ => seen.points.iter().map(|p| p.coords).collect(),
            };
            for (k, p) in places.iter().enumerate() {
                let turned = e.cross(&(p - frame.translation.vector)) / SIGMA;
                self.a
                    .view_mut((3 * k, first + axis), (3, 1))
                    .copy_from(&turned);
                self.a
                    .view_mut((3 * k, first + 3 + axis), (3, 1))
                    .copy_from(&(e / SIGMA));
            }
            if seen.points.is_empty() {
                self.a
                    .view_mut((3, first + axis), (3, 1))
                    .copy_from(&(e / SIGMA_ORIENTATION));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{ChiSquared as Squares, Distribution, StandardNormal};

    use super::*;

    /// Equations (2) and (3) against draws of the test's own statistic: (√Λ + a normal number) over a noise that was found.
    #[test]
    fn the_best_test_names_as_often_as_draws_of_it() {
        const DRAWS: usize = 20_000;
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for freedom in [8.0, 20.0, 200.0] {
            let best = Best::of(freedom);
            let squares = Squares::new(freedom).expect("positive");
            for of_needed in [0.6, 0.8, 1.0] {
                let evidence = of_needed * best.needed();
                let named = (0..DRAWS).filter(|_| {
                    let draw: f64 = StandardNormal.sample(&mut rng);
                    let found: f64 = squares.sample(&mut rng);
                    (evidence + draw) / (found / freedom).sqrt() > best.threshold
                });
                let share = named.count() as f64 / DRAWS as f64;
                let said = best.chance(evidence);
                assert!(
                    (share - said).abs() < 0.02,
                    "{freedom} {of_needed}: {share} {said}"
                );
            }
        }
        assert_eq!(Best::of(0.5).chance(1e9), 0.0);
    }
}
