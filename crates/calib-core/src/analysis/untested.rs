//! How far predictions can be off, given all data: parameters, and effects that the model does not have.
//!
//! The stated values x̂ follow from the fitted samples alone; held-out samples say how good they are. With J, e and V of all
//! samples that were kept, a = ∂e/∂c for an effect c ~ N(0, s²) that is not in the model, Λ and x₀ of the priors:
//!
//! ```text
//! H = Σ JᵀV⁻¹J + Λ,   g = Σ JᵀV⁻¹e + Λ(x̂ − x₀),   b = Σ JᵀV⁻¹a                                  (1)
//! v = 1 / (Σ aᵀV⁻¹a − bᵀH⁻¹b + s⁻²),   ĉ = −v (Σ aᵀV⁻¹e − bᵀH⁻¹g)                               (2)
//! u_m = G_m (δ − H⁻¹g) + (d_m − G_m H⁻¹b) c,   δ ~ N(0, H⁻¹),   c ~ N(ĉ, v)                       (3)
//! R² = 1/M Σ_m |u_m|²,   E = tr S + |μ|²,   Var = 2 tr S² + 4 μᵀSμ                               (4)
//! J² = 1/M Σ_m Σ_j θ_j |∂p_m/∂q_j|²                                                              (5)
//! ```
//!
//! u_m is how far the truth is from what is stated at posture m: what the parameters leave open, what the effect does there
//! less what the fit made of it. μ and S are mean and covariance of all u_m/√M. R² is taken as a multiple of χ² with
//! 2E²/Var degrees of freedom, and of F where the noise itself was estimated. One effect at a time: two at once are rare, and each bounds what the
//! other could hide. What the joints do from pose to pose (5), θ as found, is added to every E: it is what a prediction meets, and
//! what is not in the model and was taken for noise of the joints is in it.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3, Vector6};

use crate::analysis::solution::Solution;
use crate::analysis::spread::LinearPoint;
use crate::graph::edge::EdgeKind;
use crate::graph::ids::{EdgeId, FrameId};
use crate::model::cache::State;
use crate::model::pose::Pose;
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::normal::add_prior;
use crate::solve::rows::{dot, residual};
use crate::solve::whitened::{Whitened, covariance_of, whitened};

/// What an effect moves, per unit of its regressor and coefficient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Moves {
    /// A joint, about (along) its axis.
    Joint(EdgeId),
    /// Everything that this frame measures, along one of its axes.
    Reference(FrameId, usize),
    /// Everything that is measured at this frame, along one of its axes.
    Body(FrameId, usize),
}

/// An effect that the model does not have.
#[derive(Debug, Clone, PartialEq)]
pub struct UntestedEffect {
    /// What it moves.
    pub moves: Moves,
    /// s of equation (2): how large such effects are.
    pub sigma: f64,
    /// Regressor in the samples that are looked at, in their order.
    pub at_samples: Vec<f64>,
    /// Regressor at the postures.
    pub at_postures: Vec<f64>,
}

/// A point at one posture: how it follows the parameters, and the motions of the joints.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedPoint {
    /// The point.
    pub point: LinearPoint,
    /// Displacement per unit of motion of each joint about (along) its axis, m.
    pub by: BTreeMap<EdgeId, Vector3<f64>>,
    /// Rotation from the point's frame to the axes that it is seen in.
    pub turn: Matrix3<f64>,
}

impl MovedPoint {
    /// Displacement per unit of an effect, m.
    fn displacement(&self, moves: Moves) -> Vector3<f64> {
        match moves {
            Moves::Joint(joint) => self.by.get(&joint).copied().unwrap_or_else(Vector3::zeros),
            Moves::Reference(_, axis) => Vector3::ith(axis, 1.0),
            Moves::Body(_, axis) => self.turn.column(axis).into(),
        }
    }
}

/// How far predictions are off over the postures, equation (4).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct OpenErrors {
    /// What the fit states, rms, m: √(1/M Σ_m tr(G_m C G_mᵀ)).
    pub stated: f64,
    /// By the joints' noise from pose to pose, rms, m: J of equation (5). It is in the errors below.
    pub joints: f64,
    /// By the parameters alone.
    pub alone: OpenError,
    /// With each cause, in the order in which they were given.
    pub with: Vec<OpenError>,
    /// ĉ and √v of equation (2) of each effect of each cause.
    pub sizes: Vec<Vec<(f64, f64)>>,
}

/// One of them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct OpenError {
    /// √E, m.
    pub rms: f64,
    /// 99 % upper limit of R, m.
    pub upper: f64,
}

/// What does not depend on the effect.
struct Common {
    /// [G_m]_m/√M.
    g: DMatrix<f64>,
    /// −H⁻¹g.
    shift: DVector<f64>,
    /// C = H⁻¹.
    covariance: DMatrix<f64>,
    /// [G_m]_m H^(-½)/√M.
    moved: DMatrix<f64>,
    /// Gram matrix of `moved`, and its trace.
    gram: DMatrix<f64>,
    /// Factor of all variances: memory of the noise.
    level: f64,
    /// Degrees of freedom of the noise.
    freedom: f64,
    /// What the fit states.
    stated: f64,
    /// Mean and variance of what the joints do from pose to pose, m² and m⁴.
    joints: (f64, f64),
}

impl Common {
    /// Equation (4) with mean `mu` and more directions, each per standard deviation.
    fn error(&self, mu: &DVector<f64>, more: &[DVector<f64>]) -> (f64, f64) {
        let mut trace = self.gram.trace();
        let mut squares = self.gram.norm_squared();
        let mut along = self.moved.tr_mul(mu).norm_squared();
        for (i, d) in more.iter().enumerate() {
            trace += d.norm_squared();
            squares += d.norm_squared().powi(2) + 2.0 * self.moved.tr_mul(d).norm_squared();
            for other in &more[..i] {
                squares += 2.0 * d.dot(other).powi(2);
            }
            along += d.dot(mu).powi(2);
        }
        let (joints, spread) = self.joints;
        let mean = self.level * trace + mu.norm_squared() + joints;
        let variance = 2.0 * self.level.powi(2) * squares + 4.0 * self.level * along + spread;
        (mean, variance)
    }

    fn upper(&self, mean: f64, variance: f64) -> f64 {
        if mean <= 0.0 || variance <= 0.0 {
            return mean.max(0.0).sqrt();
        }
        let freedom = 2.0 * mean * mean / variance;
        (mean * f_quantile(freedom, self.freedom)).sqrt()
    }

    fn open(&self, mu: &DVector<f64>, more: &[DVector<f64>]) -> OpenError {
        let (mean, variance) = self.error(mu, more);
        OpenError {
            rms: mean.max(0.0).sqrt(),
            upper: self.upper(mean, variance),
        }
    }
}

impl Solution {
    /// Equation (4) without an effect, then with each cause, which is one effect or several independent ones (the three coordinates of a
    /// slip): over `postures`, from the samples `looked_at`, which stand for `factor` times as many. `None` without postures or free parameters, or where the model cannot be evaluated.
    #[must_use]
    pub fn open_errors(
        &self,
        looked_at: &[usize],
        factor: f64,
        causes: &[Vec<UntestedEffect>],
        postures: &[MovedPoint],
    ) -> Option<OpenErrors> {
        let effects: Vec<&UntestedEffect> = causes.iter().flatten().collect();
        let effects = effects.as_slice();
        let model = &self.model;
        let n = model.free();
        if n == 0 || postures.is_empty() {
            return None;
        }
        let count = effects.len();
        let mut fitted = NormalEquations::new(n);
        let mut held_out = NormalEquations::new(n);
        let mut b = DMatrix::zeros(n, count);
        let mut own = vec![0.0; count];
        let mut score = vec![0.0; count];
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &self.values);
        let weights: Vec<f64> = self
            .model
            .observations
            .iter()
            .zip(&self.weights)
            .map(|(o, w)| if model.is_held_out(o.sample) { 1.0 } else { *w })
            .collect();
        let objective = Objective {
            weights: &weights,
            ..self.objective()
        };
        for (place, &sample) in looked_at.iter().enumerate() {
            let Some(s) = whitened(objective, &self.values, sample, &mut work) else {
                continue;
            };
            let system = if model.is_held_out(sample) {
                &mut held_out
            } else {
                &mut fitted
            };
            // The product of a transpose has no fast kernel.
            let transposed = s.a.transpose();
            add(system, &s, &transposed, factor);
            let columns = &s.l_inverse * self.columns(effects, place, sample, &s, &work);
            b.gemm(factor, &transposed, &columns, 1.0);
            for k in 0..count {
                own[k] += factor * columns.column(k).norm_squared();
                score[k] += factor * columns.column(k).dot(&s.w);
            }
        }
        add_prior(model, &self.values, &mut fitted);
        let mut all = NormalEquations::new(n);
        for (sum, (a, b)) in all.h.iter_mut().zip(fitted.h.iter().zip(&held_out.h)) {
            *sum = a + b;
        }
        for (sum, (a, b)) in all.g.iter_mut().zip(fitted.g.iter().zip(&held_out.g)) {
            *sum = a + b;
        }
        let common = self.common(&all, &fitted, postures)?;
        let root = (postures.len() as f64).sqrt();
        let mu = &common.g * &common.shift;
        let mut found = Vec::new();
        for (k, effect) in effects.iter().enumerate() {
            let taken = &common.covariance * b.column(k);
            let information = (own[k] - b.column(k).dot(&taken)).max(0.0);
            let v = 1.0 / (information / common.level + effect.sigma.powi(-2));
            let estimate = -v * (score[k] + b.column(k).dot(&common.shift)) / common.level;
            let mut d = -(&common.g * taken);
            for (m, posture) in postures.iter().enumerate() {
                let moved = posture.displacement(effect.moves) * effect.at_postures[m];
                let mut place = d.rows_mut(3 * m, 3);
                place += moved / root;
            }
            // `level` is in v already.
            let share = &d * (v / common.level).sqrt();
            found.push((d * estimate, share, (estimate, v.sqrt())));
        }
        let mut out = OpenErrors {
            stated: common.stated,
            joints: common.joints.0.sqrt(),
            alone: common.open(&mu, &[]),
            with: Vec::new(),
            sizes: Vec::new(),
        };
        let mut rest = found.into_iter();
        for cause in causes {
            let own: Vec<_> = rest.by_ref().take(cause.len()).collect();
            let mut mu = mu.clone();
            for (shift, _, _) in &own {
                mu += shift;
            }
            let more: Vec<DVector<f64>> = own.iter().map(|(_, share, _)| share.clone()).collect();
            out.with.push(common.open(&mu, &more));
            out.sizes
                .push(own.iter().map(|(_, _, size)| *size).collect());
        }
        Some(out)
    }

    fn common(
        &self,
        all: &NormalEquations,
        fitted: &NormalEquations,
        postures: &[MovedPoint],
    ) -> Option<Common> {
        let n = all.n;
        let root = (postures.len() as f64).sqrt();
        let mut g = DMatrix::zeros(3 * postures.len(), n);
        for (m, posture) in postures.iter().enumerate() {
            let own = &posture.point.jacobian / root;
            g.view_mut((3 * m, 0), (3, n)).copy_from(&own);
        }
        let covariance = covariance_of(all)?;
        let before = covariance_of(fitted)?;
        // What the fit states against what independent noise gives: above 1 where the noise has a memory.
        let spread = |c: &DMatrix<f64>| (&g * c).dot(&g);
        let stated = spread(&self.information.covariance);
        let level = (stated / spread(&before)).max(1.0);
        let half = covariance.clone().cholesky()?.l();
        let moved = &g * half;
        let gram = moved.tr_mul(&moved);
        let shift = -(&covariance * DVector::from_column_slice(&all.g));
        Some(Common {
            g,
            shift,
            covariance,
            moved,
            gram,
            level: if level.is_finite() { level } else { 1.0 },
            freedom: self.degrees_of_freedom,
            stated: stated.max(0.0).sqrt(),
            joints: self.joints(postures),
        })
    }

    /// Equation (5): its mean, and at most its variance, every posture for itself.
    fn joints(&self, postures: &[MovedPoint]) -> (f64, f64) {
        let noise = |joint: &EdgeId| match &self.model.problem.edges[joint.index()].kind {
            EdgeKind::Joint(j) => j.noise.map_or(0.0, |group| self.theta[group.index()]),
            _ => 0.0,
        };
        let of = |posture: &MovedPoint| -> f64 {
            let by = posture.by.iter();
            by.map(|(joint, by)| noise(joint) * by.norm_squared()).sum()
        };
        let count = postures.len() as f64;
        let of: Vec<f64> = postures.iter().map(of).collect();
        let squares: f64 = of.iter().map(|x| x * x).sum();
        (
            of.iter().sum::<f64>() / count,
            2.0 * squares / (count * count),
        )
    }

    /// a of equation (1) for every effect at one sample, not whitened.
    fn columns(
        &self,
        effects: &[&UntestedEffect],
        place: usize,
        sample: usize,
        rows: &Whitened,
        work: &Workspace,
    ) -> DMatrix<f64> {
        let model = &self.model;
        let state = State::new(&model.problem, &work.cache, &self.values);
        let mut out = DMatrix::zeros(rows.w.len(), effects.len());
        let mut twists = Vec::new();
        let mut measurement = usize::MAX;
        let mut pose = Pose::identity();
        for &(o, first, count) in &rows.blocks {
            let observation = model.observations[o];
            if observation.measurement != measurement {
                measurement = observation.measurement;
                pose = model.paths[measurement].effects(state, sample, &mut twists);
            }
            let jacobian = residual(model, &self.values, measurement, observation.item, &pose);
            let kind = &model.problem.measurements[measurement];
            for (k, effect) in effects.iter().enumerate() {
                let twist = match effect.moves {
                    Moves::Joint(joint) => twists
                        .iter()
                        .filter(|(edge, _)| *edge == joint.index())
                        .map(|(_, twist)| twist[0])
                        .sum(),
                    Moves::Reference(frame, axis) if kind.from == frame => {
                        let v: Vector3<f64> = pose.r.row(axis).transpose();
                        Vector6::new(0.0, 0.0, 0.0, v.x, v.y, v.z)
                    }
                    Moves::Body(frame, axis) if kind.to == frame => Vector6::ith(3 + axis, 1.0),
                    _ => continue,
                };
                let twist = twist * effect.at_samples[place];
                for i in 0..count {
                    out[(first + i, k)] += dot(&jacobian.m[i], &twist);
                }
            }
        }
        out
    }
}

/// 99 % quantile of F(h, ν), by the cube root of χ²/dof, which is nearly normal (Wilson & Hilferty; Paulson 1942): within 8 % from
/// h = 1, ν = 5 up, and infinite where ν is too small for a limit.
///
/// ```text
/// x = F^⅓:   ((1 − b) x − (1 − a))² = z² (a + b x²),   a = 2/(9h),   b = 2/(9ν)
/// ```
fn f_quantile(h: f64, freedom: f64) -> f64 {
    /// 99 % quantile of the normal distribution.
    const Z: f64 = 2.3263;
    let (a, b) = (
        2.0 / (9.0 * h),
        2.0 / (9.0 * freedom.max(f64::MIN_POSITIVE)),
    );
    let (one_a, one_b) = (1.0 - a, 1.0 - b);
    let square = one_b * one_b - Z * Z * b;
    if square <= 0.0 || !square.is_finite() || one_b <= 0.0 {
        return f64::INFINITY;
    }
    let root = (a * one_b * one_b + b * one_a * one_a - Z * Z * a * b).max(0.0);
    ((one_a * one_b + Z * root.sqrt()) / square).powi(3)
}

/// Adds a sample to H (upper triangle) and g.
fn add(out: &mut NormalEquations, s: &Whitened, transposed: &DMatrix<f64>, factor: f64) {
    let n = out.n;
    let h = transposed * &s.a;
    let g = transposed * &s.w;
    for i in 0..n {
        for j in i..n {
            out.h[i * n + j] += factor * h[(i, j)];
        }
        out.g[i] += factor * g[i];
    }
}

#[cfg(test)]
mod tests {
    use super::f_quantile;

    /// Tables of F at 99 %.
    #[test]
    fn quantiles_of_f() {
        for (h, freedom, table) in [
            (1.0, 10.0, 10.044),
            (3.0, 20.0, 4.938),
            (10.0, 10.0, 4.849),
            (20.0, 1e6, 1.878),
            (3.0, 5.0, 12.060),
        ] {
            let found = f_quantile(h, freedom);
            assert!((found / table - 1.0).abs() < 0.08, "{h} {freedom} {found}");
        }
        assert!(f_quantile(3.0, 0.3).is_infinite());
    }
}
