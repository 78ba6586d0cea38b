//! The triangular factor that planes, circles and spheres share.
//!
//! With `x` a point relative to the common centroid, `w = |x|²`, and both centered for each marker,
//!
//! ```text
//! [ x − x̄_p   w − w̄_p ] = Q R,     R = [ R_xx  r ; 0  ρ ],     R_xx = U diag(s) Vᵀ          (1)
//! ```
//!
//! s are the singular values that say whether the points leave a line or a plane, V their directions (the last
//! is the plane's normal), `c = Uᵀr` the correlation of squared length with each direction, ρ what no sphere explains.

use nalgebra::{Matrix3, Vector3};

use calib_geometry::{decompose::svd_small, row_qr::RowQr};

use crate::{measured::Cloud, verdict::Verdict};

/// Relative singular value of exact data: below it rounding decides.
const RANK: f64 = 1e-9;

/// The factor (1) of a cloud.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Factor {
    /// Singular values of the centered cloud, descending.
    pub s: Vector3<f64>,
    /// Directions that belong to them, in columns.
    pub v: Matrix3<f64>,
    /// `Uᵀ r`.
    pub c: Vector3<f64>,
    /// What no sphere explains.
    pub rho: f64,
    /// Mean of |x|² over all samples.
    pub mean_square: f64,
    /// Sum of the weights (the number of samples where all weigh 1).
    pub total: f64,
}

impl Factor {
    /// Factor of the cloud with its weights (centroids are weighted too); `equal_markers` weighs a sample of marker p by 1/n_p (Gamage & Lasenby).
    #[must_use]
    pub fn of(cloud: &Cloud, equal_markers: bool) -> Self {
        let mut qr = RowQr::<4>::default();
        let mut mean_square = 0.0;
        for p in 0..cloud.markers() {
            let own = cloud.total(cloud.range(p));
            let mean = cloud.samples(p).map(|(x, w)| x * w).sum::<Vector3<f64>>() / own;
            let mean_w = cloud
                .samples(p)
                .map(|(x, w)| x.norm_squared() * w)
                .sum::<f64>()
                / own;
            mean_square += own * mean_w;
            let share = if equal_markers { 1.0 / own } else { 1.0 };
            for (x, w) in cloud.samples(p) {
                let root = (share * w).sqrt();
                let d = (x - mean) * root;
                qr.push([d.x, d.y, d.z, (x.norm_squared() - mean_w) * root]);
            }
        }
        let total = cloud.total(0..cloud.points.len());
        let r = qr.factor();
        let svd = svd_small(&r.fixed_view::<3, 3>(0, 0).into_owned());
        Self {
            s: svd.s,
            v: svd.v,
            c: svd.u.tr_mul(&r.fixed_view::<3, 1>(0, 3)),
            rho: r[(3, 3)],
            mean_square: mean_square / total.max(f64::MIN_POSITIVE),
            total: if equal_markers {
                cloud.markers() as f64
            } else {
                total
            },
        }
    }

    /// ½ V diag(s / (s² − shift)) c, relative to the cloud's origin: the sphere center where noise variance `shift` is taken off the spectrum.
    #[must_use]
    pub fn center(&self, shift: f64) -> Vector3<f64> {
        self.truncated_center(shift, 3)
    }

    /// The same over the `rank` strongest directions only.
    #[must_use]
    pub fn truncated_center(&self, shift: f64, rank: usize) -> Vector3<f64> {
        (0..rank)
            .map(|k| {
                let s = self.s[k];
                self.v.column(k) * (0.5 * s * self.c[k] / (s * s - shift))
            })
            .sum()
    }
}

/// Why the points span no space, from their rank alone: coincident, collinear or coplanar.
#[must_use]
pub fn rank_verdict(cloud: &Cloud, factor: &Factor) -> Option<Verdict> {
    // Coordinates carry rounding of this size each.
    let rounding = 8.0 * f64::EPSILON * cloud.magnitude * cloud.total(0..cloud.points.len()).sqrt();
    let s = factor.s;
    let floor = (RANK * s[0]).max(rounding);
    if s[0] <= rounding {
        Some(Verdict::Coincident)
    } else if s[1] <= floor {
        Some(Verdict::Collinear)
    } else if s[2] <= floor {
        Some(Verdict::Coplanar)
    } else {
        None
    }
}
