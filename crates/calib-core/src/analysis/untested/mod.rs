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

mod changed;
mod displacement;
mod sums;

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rayon::prelude::*;

use crate::analysis::change::Change;
use crate::analysis::solution::Solution;
use crate::analysis::spread::LinearPoint;
use crate::graph::edge::EdgeKind;
use crate::graph::ids::{EdgeId, FrameId};
use crate::model::path::Step;
use crate::solve::whitened::covariance_of;
use changed::Changed;
use displacement::{Displacement, add_motion};
use sums::{Columns, Design, Seen};

/// Effects whose products are taken by one task.
const CHUNK: usize = 64;

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

/// Something that may make predictions wrong.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum OpenCause<'a> {
    /// An effect that the model does not have, or several independent ones (the three coordinates of a slip).
    Effects(Vec<UntestedEffect>),
    /// A change while recording that a scan found and that the model does not have. The robot is used as it is after it.
    Found {
        /// The change.
        change: &'a Change,
        /// Whether what moved carries the point; a body elsewhere only misled the fit.
        carries: bool,
    },
}

impl OpenCause<'_> {
    fn effects(&self) -> &[UntestedEffect] {
        match self {
            Self::Effects(effects) => effects,
            Self::Found { .. } => &[],
        }
    }
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
    /// Where the point is in its frame, m.
    pub place: Vector3<f64>,
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
    /// ĉ and √v of equation (2) of each effect of each cause; of a change 1 ± 0 for its jump, and 0 ± 1 for each
    /// independent direction of its uncertainty.
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
    /// The same of the fitted samples alone.
    fitted: DMatrix<f64>,
    /// [G_m]_m C/√M.
    moved: DMatrix<f64>,
    /// K = [G_m]_m C [G_m]_mᵀ/M, what the parameters leave open.
    open: DMatrix<f64>,
    /// tr K and |K|².
    of_open: (f64, f64),
    /// Factor of all variances: memory of the noise.
    level: f64,
    /// Degrees of freedom of the noise.
    freedom: f64,
    /// What the fit states.
    stated: f64,
    /// Mean and variance of what the joints do from pose to pose, m² and m⁴.
    joints: (f64, f64),
}

/// One direction of a cause.
struct Direction {
    /// What it does, per unit.
    displaced: Displacement,
    /// Mean and standard deviation.
    size: (f64, f64),
}

impl Common {
    /// Columns of displacements, with their sizes.
    fn directions(&self, displaced: DMatrix<f64>, sizes: Vec<(f64, f64)>) -> Vec<Direction> {
        let open = &self.open * &displaced;
        let columns = displaced.column_iter().zip(open.column_iter());
        columns
            .zip(sizes)
            .map(|((d, open), size)| Direction {
                displaced: Displacement {
                    d: d.into_owned(),
                    open: open.into_owned(),
                },
                size,
            })
            .collect()
    }

    /// Equations (2) and (3) of the effects from `first` on.
    fn of_effects(
        &self,
        (first, effects): (usize, &[&UntestedEffect]),
        design: &Design,
        seen: &Seen,
        postures: &[MovedPoint],
    ) -> Vec<Direction> {
        let b = design.b.columns(first, effects.len());
        let steps = &self.covariance * b;
        // d_m − G_m H⁻¹b
        let mut displaced = -(&self.g * &steps);
        let mut sizes = Vec::new();
        for (i, effect) in effects.iter().enumerate() {
            let (k, b) = (first + i, b.column(i));
            let information = (design.own[k] - b.dot(&steps.column(i))).max(0.0);
            let v = 1.0 / (information / self.level + effect.sigma.powi(-2));
            let estimate = -v * (seen.score[k] + b.dot(&self.shift)) / self.level;
            sizes.push((estimate, v.sqrt()));
            let at = postures.iter().zip(&effect.at_postures);
            let at = at.map(|(posture, value)| posture.displacement(effect.moves) * *value);
            add_motion(&mut displaced.column_mut(i), at);
        }
        self.directions(displaced, sizes)
    }

    /// Equation (4) with a cause.
    fn with(&self, mu: &Displacement, cause: &[Direction]) -> OpenError {
        let mut mu = mu.clone();
        let mut more = Vec::new();
        for Direction { displaced, size } in cause {
            mu.add(size.0, displaced);
            // `level` is in σ already.
            more.push(displaced.scaled(size.1 / self.level.sqrt()));
        }
        self.open(&mu, &more)
    }

    /// Equation (4) with mean `mu` and more directions, each per standard deviation.
    fn error(&self, mu: &Displacement, more: &[Displacement]) -> (f64, f64) {
        let (mut trace, mut squares) = self.of_open;
        let mut along = mu.along();
        for (i, Displacement { d, .. }) in more.iter().enumerate() {
            trace += d.norm_squared();
            squares += d.norm_squared().powi(2) + 2.0 * more[i].along();
            for other in &more[..i] {
                squares += 2.0 * d.dot(&other.d).powi(2);
            }
            along += d.dot(&mu.d).powi(2);
        }
        let (joints, spread) = self.joints;
        let mean = self.level * trace + mu.d.norm_squared() + joints;
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

    fn open(&self, mu: &Displacement, more: &[Displacement]) -> OpenError {
        let (mean, variance) = self.error(mu, more);
        OpenError {
            rms: mean.max(0.0).sqrt(),
            upper: self.upper(mean, variance),
        }
    }
}

impl Solution {
    /// Equation (4) without an effect, then with each cause: over `postures`, from `samples`. What grows with the square of the
    /// parameters is summed over about `most` of them, each of which stands for others of its recording; what the data say (g, and Σ aᵀV⁻¹e) over
    /// all: a part of the samples, multiplied, would be as noisy as that part. `None` without postures or free parameters, or where the model
    /// cannot be evaluated.
    #[must_use]
    pub fn open_errors(
        &self,
        samples: &[usize],
        most: usize,
        causes: &[OpenCause<'_>],
        postures: &[MovedPoint],
    ) -> Option<OpenErrors> {
        if self.model.free() == 0 || postures.is_empty() {
            return None;
        }
        let effects: Vec<&UntestedEffect> = causes.iter().flat_map(OpenCause::effects).collect();
        let mut changes: Vec<Option<Changed<'_>>> = causes
            .iter()
            .filter_map(|cause| match cause {
                OpenCause::Found { change, carries } => Some(Changed::new(self, change, *carries)),
                OpenCause::Effects(_) => None,
            })
            .collect();
        let held_out = |sample: usize| self.model.is_held_out(sample);
        let observations = self.model.observations.iter().zip(&self.weights);
        let weights: Vec<f64> = observations
            .map(|(o, w)| if held_out(o.sample) { 1.0 } else { *w })
            .collect();
        let columns = Columns::new(self, &effects);
        let (design, seen) = rayon::join(
            || Design::of(&columns, &weights, samples, most, &mut changes),
            || Seen::of(&columns, &weights, samples),
        );
        let common = self.common(&design, &seen, postures)?;
        let of_chunk = |(k, chunk): (usize, &[&UntestedEffect])| {
            common.of_effects((k * CHUNK, chunk), &design, &seen, postures)
        };
        let of_effects: Vec<Vec<Direction>> = effects
            .par_chunks(CHUNK)
            .enumerate()
            .map(of_chunk)
            .collect();
        let mut of_effects = of_effects.into_iter().flatten();
        let mut of_changes = changes.iter().map(|changed| match changed {
            Some(changed) => changed.directions(&common, postures),
            None => Vec::new(),
        });
        let mu = &common.g * &common.shift;
        let mu = Displacement {
            open: &common.open * &mu,
            d: mu,
        };
        let mut out = OpenErrors {
            stated: common.stated,
            joints: common.joints.0.sqrt(),
            alone: common.open(&mu, &[]),
            with: Vec::new(),
            sizes: Vec::new(),
        };
        for cause in causes {
            let own: Vec<Direction> = match cause {
                OpenCause::Effects(effects) => of_effects.by_ref().take(effects.len()).collect(),
                OpenCause::Found { .. } => of_changes.next().unwrap_or_default(),
            };
            out.with.push(common.with(&mu, &own));
            out.sizes.push(own.iter().map(|d| d.size).collect());
        }
        Some(out)
    }

    /// In which of these samples something was measured that an effect would move; held-out ones count.
    #[must_use]
    pub fn moved_in(&self, moves: Moves, samples: &[usize]) -> Vec<bool> {
        let model = &self.model;
        let sees = |measurement: usize| {
            let kind = &model.problem.measurements[measurement];
            match moves {
                Moves::Joint(joint) => {
                    let mut steps = model.paths[measurement].steps.iter();
                    steps.any(|s| matches!(s, Step::Joint { edge, .. } if *edge == joint.index()))
                }
                Moves::Reference(frame, _) => kind.from == frame,
                Moves::Body(frame, _) => kind.to == frame,
            }
        };
        let sees: Vec<bool> = (0..model.paths.len()).map(sees).collect();
        let used = |o: usize| {
            let observation = &model.observations[o];
            let kept = self.weights[o] > 0.0 || model.is_held_out(observation.sample);
            kept && sees[observation.measurement]
        };
        let of_sample = |s: &usize| model.of_sample[*s].clone().any(used);
        samples.iter().map(of_sample).collect()
    }

    fn common(&self, design: &Design, seen: &Seen, postures: &[MovedPoint]) -> Option<Common> {
        let n = self.model.free();
        let root = (postures.len() as f64).sqrt();
        let mut g = DMatrix::zeros(3 * postures.len(), n);
        for (m, posture) in postures.iter().enumerate() {
            let own = &posture.point.jacobian / root;
            g.view_mut((3 * m, 0), (3, n)).copy_from(&own);
        }
        let (covariance, before) = rayon::join(
            || covariance_of(&design.all(self)),
            || covariance_of(&design.fitted(self)),
        );
        let (covariance, before) = (covariance?, before?);
        // What the fit states against what independent noise gives: above 1 where the noise has a memory.
        let spread = |c: &DMatrix<f64>| (&g * c).dot(&g);
        let ((stated, fitted), (moved, open)) = rayon::join(
            || (spread(&self.information.covariance), spread(&before)),
            || {
                let moved = &g * &covariance;
                let open = &moved * g.transpose();
                (moved, open)
            },
        );
        let level = (stated / fitted).max(1.0);
        let shift = -(&covariance * seen.gradient(self));
        Some(Common {
            g,
            shift,
            covariance,
            fitted: before,
            moved,
            of_open: (open.trace(), open.norm_squared()),
            open,
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
