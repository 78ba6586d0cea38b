//! The quadratic cost: its weights, and its Gauss–Newton system.

use calib_geometry::so3;
use nalgebra::{Isometry3, Matrix3, SMatrix, SVector, Translation3, Vector3, Vector6};

/// Weights of (1): 1/σ² of orientation (per rad², the Frobenius norm counts it twice) and position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandEyeWeights {
    /// σ of orientation, rad.
    pub sigma_rotation: f64,
    /// σ of position, m.
    pub sigma_translation: f64,
}

impl Default for HandEyeWeights {
    /// 1 mm against 1 mrad: errors weigh alike on a lever of a meter.
    fn default() -> Self {
        Self {
            sigma_rotation: 1e-3,
            sigma_translation: 1e-3,
        }
    }
}

#[derive(Clone, Copy)]
pub(crate) struct Weights {
    pub rotation: f64,
    pub translation: f64,
}

impl Weights {
    pub fn of(w: HandEyeWeights) -> Self {
        Self {
            // ‖ΔR‖²_F = 2 θ²
            rotation: 0.5 / (w.sigma_rotation * w.sigma_rotation),
            translation: 1.0 / (w.sigma_translation * w.sigma_translation),
        }
    }
}

pub(crate) fn rotation_of(x: &Isometry3<f64>) -> Matrix3<f64> {
    *x.rotation.to_rotation_matrix().matrix()
}

/// Hessian, gradient and value of the cost.
pub(crate) type System = (SMatrix<f64, 12, 12>, SVector<f64, 12>, f64);

/// Gauss–Newton system of (1) in right perturbations, and its value.
pub(crate) fn linearize(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    x: &Isometry3<f64>,
    z: &Isometry3<f64>,
    w: Weights,
) -> System {
    let mut h = SMatrix::<f64, 12, 12>::zeros();
    let mut g = SVector::<f64, 12>::zeros();
    let mut f = 0.0;
    let (rx, rz) = (rotation_of(x), rotation_of(z));
    for (a, b) in a.iter().zip(b) {
        let (ra, rb) = (rotation_of(a), rotation_of(b));
        // Translation: e = R_A t_X + t_A − R_Z t_B − t_Z; dt = R v; d(R_Z t_B) = −R_Z [t_B]ₓ ω
        let e = ra * x.translation.vector + a.translation.vector
            - rz * b.translation.vector
            - z.translation.vector;
        let mut j = SMatrix::<f64, 3, 12>::zeros();
        j.fixed_view_mut::<3, 3>(0, 3).copy_from(&(ra * rx));
        j.fixed_view_mut::<3, 3>(0, 6)
            .copy_from(&(rz * so3::skew(&b.translation.vector)));
        j.fixed_view_mut::<3, 3>(0, 9).copy_from(&-rz);
        h += j.transpose() * j * w.translation;
        g += j.transpose() * e * w.translation;
        f += w.translation * e.norm_squared();
        // Rotation, 9 rows: E = R_A R_X − R_Z R_B; dE = R_A R_X [ω_x]ₓ − R_Z [ω_z]ₓ R_B
        let left = ra * rx;
        let error = left - rz * rb;
        let mut j = SMatrix::<f64, 9, 12>::zeros();
        for c in 0..3 {
            let mut unit = Vector3::zeros();
            unit[c] = 1.0;
            let s = so3::skew(&unit);
            let dx = left * s;
            let dz = -(rz * s * rb);
            for i in 0..9 {
                j[(i, c)] = dx[i];
                j[(i, 6 + c)] = dz[i];
            }
        }
        let e = SVector::<f64, 9>::from_iterator(error.iter().copied());
        h += j.transpose() * j * w.rotation;
        g += j.transpose() * e * w.rotation;
        f += w.rotation * e.norm_squared();
    }
    (h, g, f)
}

pub(crate) fn solve12(system: &System) -> Option<SVector<f64, 12>> {
    nalgebra::Cholesky::new(system.0).map(|c| -c.solve(&system.1))
}

pub(crate) fn moved(x: &Isometry3<f64>, xi: &Vector6<f64>) -> Isometry3<f64> {
    let omega = Vector3::new(xi[0], xi[1], xi[2]);
    let v = Vector3::new(xi[3], xi[4], xi[5]);
    Isometry3::from_parts(
        Translation3::from(x.translation.vector + x.rotation * v),
        x.rotation * so3::exp(&omega),
    )
}
