//! What the uncertainty of the parameters does to a point over a set of postures, and how much of it only the priors hold.
//!
//! ```text
//! u_m = G_m δ,   δ ~ N(0, C)                                how far the point is off at posture m            (1)
//! σ² = 1/M Σ_m tr(G_m C G_mᵀ)                               over all postures                                (2)
//! [G_m]_m C^½ / √M = U diag(s) Wᵀ,   v_k = C^½ w_k          independent directions: s_k is the rms of u for v_k (3)
//! share_k = v_kᵀ P v_k                                      since v_kᵀ C⁻¹ v_k = 1 and C⁻¹ = data + P        (4)
//! ρ = Σ_m d_m·u_m / Σ_m |d_m|²,   d_m = p_m − p̄             relative change of the size of what is reached   (5)
//! ```
//!
//! The eigenvectors of (3) are those of what the postures show against what data and priors leave (H v = λ C⁻¹ v). A rigid
//! motion of all postures does not change (5). Equation (4) of a sum aᵀδ, as (5) is one, is aᵀCPCa / aᵀCa.

use nalgebra::{DMatrix, DVector, Point3, Vector3};

use calib_geometry::decompose;
use calib_geometry::so3;

use crate::analysis::solution::Solution;
use crate::graph::ids::ParameterId;
use crate::solve::whitened::covariance_of;

/// A point at one posture, and how it follows the free parameters.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LinearPoint {
    /// Where it is predicted, m.
    pub position: Point3<f64>,
    /// G of equation (1): 3 × free parameters.
    pub jacobian: DMatrix<f64>,
}

/// What of a displacement counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Placement {
    /// All of it: the frame in which the point is predicted was measured.
    Counts,
    /// What is left after the best rigid motion of all postures: where the robot stands is another question.
    Free,
}

/// One independent direction of the parameters' uncertainty.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SpreadDirection {
    /// s of equation (3): rms displacement for one standard deviation along it, m.
    pub rms: f64,
    /// Largest displacement, m.
    pub max: f64,
    /// Share of the prior in what is known along it, in [0, 1].
    pub prior_share: f64,
    /// Deviation of the parameters along it, in the parameter's unit; those that matter most first.
    pub terms: Vec<(ParameterId, f64)>,
}

/// The relative size of what is reached, equation (5).
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SizeSpread {
    /// Its standard deviation, 1.
    pub sigma: f64,
    /// Share of the prior in what is known of it, in [0, 1].
    pub prior_share: f64,
}

/// What the uncertainty of the parameters does to a point over a set of postures.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PostureSpread {
    /// √tr(G_m C G_mᵀ) per posture, m.
    pub sigma: Vec<f64>,
    /// Equation (2), m.
    pub rms: f64,
    /// Share of equation (2) that only the priors hold, in [0, 1].
    pub prior_share: f64,
    /// Equation (5); `None` where all postures reach one place.
    pub size: Option<SizeSpread>,
    /// Equation (3), the worst first.
    pub directions: Vec<SpreadDirection>,
    /// A direction that neither data nor prior determine moves the point: the numbers leave it out.
    pub unbounded: bool,
}

/// Displacements of a unit deviation below this (m) are rounding.
const NOTHING: f64 = 1e-8;

/// A direction of one scale that nothing determines and that moves the point by more than this (m) makes it unknown; null
/// vectors are accurate to about 1e-9.
const OPEN: f64 = 1e-6;

/// A variance above this many times that of the noise alone was widened.
const WIDENED: f64 = 1.5;

/// Parameters named per direction.
const TERMS: usize = 6;

impl Solution {
    /// Equations (1) to (5) over some postures; `None` without postures or free parameters.
    #[must_use]
    pub fn spread(&self, points: &[LinearPoint], placement: Placement) -> Option<PostureSpread> {
        let g = self.moved(points, placement)?;
        let half = self.half_covariance();
        let prior = self.prior_information();
        let moved = &g * &half;
        let root = (points.len() as f64).sqrt();
        let sigma: Vec<f64> = (0..points.len())
            .map(|m| moved.rows(3 * m, 3).norm())
            .collect();
        let rms = moved.norm() / root;
        let svd = decompose::right_singular(&moved);
        let known = svd.s.iter().take_while(|s| **s / root > NOTHING).count();
        let along = &half * svd.v.columns(0, known);
        let displaced = &g * &along;
        let directions: Vec<SpreadDirection> = svd
            .s
            .iter()
            .take(known)
            .enumerate()
            .map(|(k, s)| {
                let v: DVector<f64> = along.column(k).into();
                let at = |m: usize| displaced.view((3 * m, k), (3, 1)).norm();
                SpreadDirection {
                    rms: s / root,
                    max: (0..points.len()).map(at).fold(0.0, f64::max),
                    prior_share: weighted(&prior, &v).clamp(0.0, 1.0),
                    terms: self.terms(&v),
                }
            })
            .collect();
        let held = directions.iter().map(|d| d.prior_share * d.rms * d.rms);
        let all: f64 = directions.iter().map(|d| d.rms * d.rms).sum();
        Some(PostureSpread {
            sigma,
            rms,
            prior_share: if all > 0.0 {
                held.sum::<f64>() / all
            } else {
                0.0
            },
            size: self.size(points, &g, &half, &prior),
            directions,
            unbounded: self.is_unbounded(&g, root),
        })
    }

    /// [`PostureSpread::rms`] alone.
    #[must_use]
    pub fn spread_rms(&self, points: &[LinearPoint], placement: Placement) -> Option<f64> {
        let g = self.moved(points, placement)?;
        let squares = (&g * &self.information.covariance).dot(&g);
        Some((squares.max(0.0) / points.len() as f64).sqrt())
    }

    /// How the points follow the free parameters, 3 rows each; `None` without any of either.
    fn moved(&self, points: &[LinearPoint], placement: Placement) -> Option<DMatrix<f64>> {
        let n = self.model.free();
        if n == 0 || points.is_empty() {
            return None;
        }
        let mut g = DMatrix::zeros(3 * points.len(), n);
        for (m, point) in points.iter().enumerate() {
            g.view_mut((3 * m, 0), (3, n)).copy_from(&point.jacobian);
        }
        if placement == Placement::Free {
            let rigid = rigid_motions(points);
            g -= &rigid * (rigid.transpose() * &g);
        }
        Some(g)
    }

    /// A square root of C of equation (2) of [`Information`](crate::Information): C = H Hᵀ, free parameters × directions that are known.
    #[must_use]
    pub fn half_covariance(&self) -> DMatrix<f64> {
        let scale = &self.information.scale;
        let n = scale.len();
        let covariance = &self.information.covariance;
        let scaled = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] / (scale[i] * scale[j]));
        let mut half = decompose::square_root(&scaled);
        for (i, s) in scale.iter().enumerate() {
            half.row_mut(i).scale_mut(*s);
        }
        half
    }

    /// Diagonal of P: 1/σ² of the priors.
    pub(crate) fn prior_information(&self) -> DVector<f64> {
        let parameters = self.model.problem().parameters();
        let of = |p: &usize| parameters[*p].prior_sigma.map_or(0.0, |s| s.powi(-2));
        let free = self.model.free_parameters();
        DVector::from_iterator(free.len(), free.iter().map(of))
    }

    /// Equation (5) and the share of (4).
    fn size(
        &self,
        points: &[LinearPoint],
        g: &DMatrix<f64>,
        half: &DMatrix<f64>,
        prior: &DVector<f64>,
    ) -> Option<SizeSpread> {
        let center = centroid(points);
        let d: Vec<f64> = points
            .iter()
            .flat_map(|p| {
                (p.position.coords - center)
                    .iter()
                    .copied()
                    .collect::<Vec<_>>()
            })
            .collect();
        let d = DVector::from_vec(d);
        let reach = d.norm_squared();
        if reach.sqrt() < NOTHING {
            return None;
        }
        // a = Gᵀ d / |d|²,   Ca = H (Hᵀ a)
        let a = g.transpose() * &d / reach;
        let ha = half.transpose() * &a;
        let variance = ha.norm_squared();
        let ca = half * ha;
        let share = |ca: &DVector<f64>| match a.dot(ca) {
            variance if variance > 0.0 => weighted(prior, ca) / variance,
            _ => 0.0,
        };
        // Residuals that are no noise make σ larger than the data's, and priors no better known.
        let by_noise = covariance_of(&self.information.curvature(&self.model)).map(|c| c * &a);
        let widened = by_noise.filter(|own| variance > WIDENED * a.dot(own));
        let share = share(widened.as_ref().unwrap_or(&ca));
        Some(SizeSpread {
            sigma: variance.sqrt(),
            prior_share: share.clamp(0.0, 1.0),
        })
    }

    fn is_unbounded(&self, g: &DMatrix<f64>, root: f64) -> bool {
        let mut open = self.information.indeterminate.clone();
        for (i, s) in self.information.scale.iter().enumerate() {
            open.row_mut(i).scale_mut(*s);
        }
        let moved = g * open;
        moved.column_iter().any(|c| c.norm() / root > OPEN)
    }

    /// The parameters that a direction moves most, in units of their scale, the first of them forward.
    fn terms(&self, v: &DVector<f64>) -> Vec<(ParameterId, f64)> {
        /// A part of the direction below this needs no name.
        const SMALL: f64 = 0.05;
        /// Parts that differ by less of the largest are equal, whatever their last bits: the parameter that comes first goes first.
        const EQUAL: f64 = 1e-6;
        let part = |c: usize| (v[c] / self.information.scale[c]).abs();
        let all = (0..v.len()).map(part).fold(0.0, f64::max);
        let mut columns: Vec<usize> = (0..v.len()).filter(|c| part(*c) > SMALL * all).collect();
        let rank = |c: &usize| -(part(*c) / (EQUAL * all)).round();
        columns.sort_by(|a, b| rank(a).total_cmp(&rank(b)).then(a.cmp(b)));
        columns.truncate(TERMS);
        let sign = columns.first().map_or(1.0, |c| v[*c].signum());
        let free = self.model.free_parameters();
        let term = |c: usize| (ParameterId::of(free[c]), sign * v[c]);
        columns.into_iter().map(term).collect()
    }
}

/// Orthonormal displacements of all postures by one rigid motion, 3M × 6 or fewer.
fn rigid_motions(points: &[LinearPoint]) -> DMatrix<f64> {
    let center = centroid(points);
    let mut b = DMatrix::zeros(3 * points.len(), 6);
    for (m, point) in points.iter().enumerate() {
        // ω × d + v
        let d = point.position.coords - center;
        b.view_mut((3 * m, 0), (3, 3)).copy_from(&-so3::skew(&d));
        b.view_mut((3 * m, 3), (3, 3)).fill_with_identity();
    }
    let svd = decompose::svd(&b);
    let rank = svd.s.iter().filter(|s| **s > NOTHING * svd.s[0]).count();
    svd.u.columns(0, rank).into_owned()
}

fn centroid(points: &[LinearPoint]) -> Vector3<f64> {
    let sum: Vector3<f64> = points.iter().map(|p| p.position.coords).sum();
    sum / points.len() as f64
}

/// vᵀ diag(w) v
fn weighted(w: &DVector<f64>, v: &DVector<f64>) -> f64 {
    v.iter().zip(w.iter()).map(|(v, w)| v * v * w).sum()
}
