//! Gear ratios that nobody stated, from the error that a joint makes once per turn of its motor.
//!
//! For the motion of joint j by 1 rad, u_s = L⁻¹∂e/∂φ_j at sample s. A motor that turns n times as fast adds a₁ cos nq + a₂ sin nq:
//!
//! ```text
//! U_i(n) = Σ_s f_i(q_s) u_s·w_s,   I_il(n) = Σ_s f_i f_l |u_s|² − b_iᵀ C b_l,   b_i = Σ_s f_i A_sᵀ u_s        (1)
//! z²(n) = min over model and poses as in the other score tests  ~  χ²(2)                                   (2)
//! σ_n² = 2 / |d²z²/dn²|  at the largest z²                                                                (3)
//! ```
//!
//! f is cos nq and sin nq minus their means: a constant is the zero offset. Every ratio of a grid so fine that none between two of its
//! places is missed is tried, at every joint, and the evidence is corrected for all of them.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::analysis::goodness::Candidate;
use crate::analysis::score::{Scored, Tested};
use crate::analysis::solution::Solution;
use crate::graph::axis::Axis;
use crate::graph::edge::EdgeKind;
use crate::graph::effect::{EffectKind, Source};
use crate::graph::ids::EdgeId;
use crate::solve::whitened::covariance_of;

/// Turns of a motor per turn of its joint, found from the joint's errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct GearRatio {
    /// The joint.
    pub joint: EdgeId,
    /// Its name.
    pub name: String,
    /// n.
    pub ratio: f64,
    /// σ of equation (3).
    pub sigma: f64,
    /// Amplitude of the error, rad.
    pub amplitude: f64,
    /// z² of equation (2).
    pub z2: f64,
    /// The same at the best ratio that is not beside this one: readings in equal steps cannot tell some ratios apart.
    pub next: f64,
    /// Probability of so large a z² at any joint and ratio that was tried, where there is none.
    pub p_corrected: f64,
}

impl GearRatio {
    /// Chance would show one as clear in less than 1 of 1000 analyses, and no other ratio is nearly as likely.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        self.p_corrected < SIGNIFICANT && self.z2 - self.next > DISTINCT
    }
}

/// Chance of a ratio where there is none.
const SIGNIFICANT: f64 = 1e-3;
/// z² by which the next ratio must be less likely: three standard errors.
const DISTINCT: f64 = 9.0;
/// Samples that the scan looks at, evenly over all.
const SAMPLES: usize = 400;
/// Fewer do not show a harmonic and its phase beside the robot's geometry.
const FEWEST: usize = 20;
/// Places of the grid per period of z² over n, which is 2π over the range of the readings.
const PER_PERIOD: f64 = 4.0;
/// A joint that moves by less, rad, shows no period of a slow motor.
const RANGE: f64 = 0.3;

impl Solution {
    /// For every revolute joint whose gear ratio is not known, the likeliest ratio of those between `from` and `to`, the clearest first.
    /// `None` when the model cannot be evaluated.
    #[must_use]
    pub fn gear_ratios(&self, from: f64, to: f64) -> Option<Vec<GearRatio>> {
        let joints = self.ungeared();
        let used = self.used_samples();
        let step = used.len().div_ceil(SAMPLES).max(1);
        let samples: Vec<usize> = used.into_iter().step_by(step).collect();
        if joints.is_empty() || samples.len() < FEWEST {
            return Some(Vec::new());
        }
        let scans = self.scans(&joints, &samples)?;
        let tried: usize = scans.iter().map(|scan| scan.grid(from, to).len()).sum();
        let best: Vec<Option<GearRatio>> = scans
            .par_iter()
            .map(|scan| scan.best(from, to, tried))
            .collect();
        let mut found: Vec<GearRatio> = best.into_iter().flatten().collect();
        found.sort_by(|a, b| a.p_corrected.total_cmp(&b.p_corrected));
        Some(found)
    }

    /// Revolute joints without an effect of their motor.
    fn ungeared(&self) -> Vec<EdgeId> {
        let edges = self.model.problem.edges.iter().enumerate();
        edges
            .filter_map(|(e, edge)| {
                let EdgeKind::Joint(joint) = &edge.kind else {
                    return None;
                };
                let of_motor = |kind: EffectKind| kind.term().source == Source::Motor;
                let known = joint.effects.iter().any(|f| of_motor(f.kind))
                    || joint.candidates.iter().any(|c| of_motor(c.kind));
                let turns = matches!(joint.axis, Axis::Revolute(_)) && range(&joint.q) > RANGE;
                (turns && !known).then(|| EdgeId::of(e))
            })
            .collect()
    }

    /// What the scan of each joint is made of: one pass over the samples.
    fn scans(&self, joints: &[EdgeId], samples: &[usize]) -> Option<Vec<Scan>> {
        let count = self.model.problem.samples;
        let moved =
            |joint: &EdgeId| Candidate::of_joint(*joint, EffectKind::ZeroOffset, vec![1.0; count]);
        let candidates: Vec<Candidate> = joints.iter().map(moved).collect();
        let c = covariance_of(&self.held_curvature())?;
        let half = c.cholesky()?.l();
        let excess = (self.chi2 / self.degrees_of_freedom.max(1.0)).max(1.0);
        let mut scans: Vec<Scan> = joints
            .iter()
            .map(|joint| Scan::new(self, *joint, excess))
            .collect();
        for seen in self.seen(&candidates, samples) {
            let (s, alpha) = (&seen.rows, &seen.columns);
            // Rows of Lᵀ with C = LLᵀ: bᵀCb is the square of Lᵀb.
            let taken = s.a.times(&half);
            for (scan, u) in scans.iter_mut().zip(alpha.column_iter()) {
                let square = u.norm_squared();
                if square > 0.0 {
                    scan.q.push(scan.reading[seen.sample]);
                    scan.push.push(u.dot(&s.w));
                    scan.square.push(square);
                    scan.along.push(taken.tr_mul(&u));
                    scan.free.push(taken.tr_mul(&s.w));
                }
            }
        }
        Some(scans)
    }
}

fn range(q: &[f64]) -> f64 {
    let least = q.iter().copied().fold(f64::INFINITY, f64::min);
    let most = q.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    most - least
}

/// One joint: equation (1) without f.
struct Scan {
    joint: EdgeId,
    name: String,
    /// Readings of all samples, rad.
    reading: Vec<f64>,
    excess: f64,
    /// Of the samples that are looked at: reading, u·w, |u|², LᵀAᵀu and LᵀAᵀw.
    q: Vec<f64>,
    push: Vec<f64>,
    square: Vec<f64>,
    along: Vec<DVector<f64>>,
    free: Vec<DVector<f64>>,
}

/// Equation (1) at one ratio.
struct At {
    u: Vector2<f64>,
    information: Matrix2<f64>,
    raw: [f64; 2],
    /// f at every sample.
    f: Vec<[f64; 2]>,
    /// Lᵀb.
    b: [DVector<f64>; 2],
}

impl Scan {
    fn new(of: &Solution, joint: EdgeId, excess: f64) -> Self {
        let edge = &of.model.problem.edges[joint.index()];
        let reading = match &edge.kind {
            EdgeKind::Joint(joint) => joint.q.clone(),
            _ => Vec::new(),
        };
        Self {
            joint,
            name: edge.name.clone(),
            reading,
            excess,
            q: Vec::new(),
            push: Vec::new(),
            square: Vec::new(),
            along: Vec::new(),
            free: Vec::new(),
        }
    }

    /// Ratios that are tried.
    fn grid(&self, from: f64, to: f64) -> Vec<f64> {
        let range = range(&self.q);
        if self.q.len() < FEWEST || range <= RANGE {
            return Vec::new();
        }
        let step = 2.0 * std::f64::consts::PI / range / PER_PERIOD;
        let count = ((to - from) / step).floor().max(0.0) as usize;
        (0..=count).map(|k| from + step * k as f64).collect()
    }

    /// The ratio of the largest z², with its evidence among `tried`; `None` where the readings show none.
    fn best(&self, from: f64, to: f64, tried: usize) -> Option<GearRatio> {
        /// Sections of the search between two places of the grid: to a ten-thousandth of it.
        const SECTIONS: usize = 20;
        let grid = self.grid(from, to);
        let z2 = |n: f64| {
            self.at(n)
                .and_then(|at| self.test(&at, false))
                .map_or(0.0, |t| t.z2)
        };
        let values: Vec<f64> = grid.iter().map(|n| z2(*n)).collect();
        let most = (0..grid.len()).max_by(|a, b| values[*a].total_cmp(&values[*b]))?;
        let step = grid.get(1)? - grid[0];
        // A peak is two periods wide with its first side lobes.
        let beside = 2 * PER_PERIOD as usize;
        let others = (0..grid.len()).filter(|k| k.abs_diff(most) > beside);
        let next = others.map(|k| values[k]).fold(0.0, f64::max);
        let (mut low, mut high) = (grid[most] - step, grid[most] + step);
        for _ in 0..SECTIONS {
            let third = (high - low) / 3.0;
            if z2(low + third) < z2(high - third) {
                low += third;
            } else {
                high -= third;
            }
        }
        let ratio = 0.5 * (low + high);
        let at = self.at(ratio)?;
        let tested = self.test(&at, true)?;
        // The curvature over a tenth of a step, where z² is a parabola.
        let h = 0.1 * step;
        let curvature = (2.0 * z2(ratio) - z2(ratio - h) - z2(ratio + h)) / (h * h);
        let amplitude = at.information.try_inverse()? * at.u;
        Some(GearRatio {
            joint: self.joint,
            name: self.name.clone(),
            ratio,
            sigma: (2.0 / curvature.max(f64::MIN_POSITIVE)).sqrt(),
            amplitude: amplitude.norm(),
            z2: z2(ratio),
            next,
            p_corrected: (tested.p_value * tried as f64).min(1.0),
        })
    }

    /// Equation (1).
    fn at(&self, n: f64) -> Option<At> {
        let total: f64 = self.square.iter().sum();
        let waves: Vec<[f64; 2]> = self
            .q
            .iter()
            .map(|q| [(n * q).cos(), (n * q).sin()])
            .collect();
        let mean = |i: usize| {
            let weighed = waves.iter().zip(&self.square).map(|(f, k)| f[i] * k);
            weighed.sum::<f64>() / total
        };
        let mean = [mean(0), mean(1)];
        let f: Vec<[f64; 2]> = waves
            .iter()
            .map(|f| [f[0] - mean[0], f[1] - mean[1]])
            .collect();
        let size = self.along.first()?.len();
        let mut b = [DVector::zeros(size), DVector::zeros(size)];
        let mut u = Vector2::zeros();
        let mut sums = Matrix2::zeros();
        for (s, f) in f.iter().enumerate() {
            for i in 0..2 {
                u[i] += f[i] * self.push[s];
                b[i].axpy(f[i], &self.along[s], 1.0);
                for l in 0..2 {
                    sums[(i, l)] += f[i] * f[l] * self.square[s];
                }
            }
        }
        let information = Matrix2::from_fn(|i, l| sums[(i, l)] - b[i].dot(&b[l]));
        let raw = [sums[(0, 0)], sums[(1, 1)]];
        Some(At {
            u,
            information,
            raw,
            f,
            b,
        })
    }

    /// Equation (2); the shares of the poses are counted where asked.
    fn test(&self, at: &At, by_poses: bool) -> Option<Tested> {
        let clusters = by_poses.then(|| self.shares(at)).flatten();
        let information = DMatrix::from_fn(2, 2, |i, l| at.information[(i, l)]);
        Scored {
            u: &DVector::from_column_slice(at.u.as_slice()),
            information: &information,
            raw: &at.raw,
            clusters: clusters.as_ref(),
            excess: self.excess,
            samples: self.q.len(),
        }
        .test()
    }

    /// Σ of the poses' own shares of U once the harmonic is fitted.
    fn shares(&self, at: &At) -> Option<DMatrix<f64>> {
        let fitted = at.information.try_inverse()? * at.u;
        let mut out = DMatrix::zeros(2, 2);
        for s in 0..self.q.len() {
            let share = |i: usize| {
                let own = at.f[s][i] * self.push[s] - at.b[i].dot(&self.free[s]);
                // What the fitted harmonic itself makes of the share, but for the square of what the parameters take.
                let mine = |l: usize| {
                    at.f[s][i] * at.f[s][l] * self.square[s]
                        - at.f[s][i] * at.b[l].dot(&self.along[s])
                        - at.f[s][l] * at.b[i].dot(&self.along[s])
                };
                own - mine(0) * fitted[0] - mine(1) * fitted[1]
            };
            let share = [share(0), share(1)];
            for i in 0..2 {
                for l in 0..2 {
                    out[(i, l)] += share[i] * share[l];
                }
            }
        }
        Some(out)
    }
}
