//! Rows of one observation against the body twist `[ω; v]` of the path's end, before the chain rule of the path.

use nalgebra::{Matrix3, Vector3};

use calib_geometry::so3;

use crate::graph::ids::PointId;

/// Where a residual is wanted: the path's pose, and the points of the problem at the same values.
pub(crate) struct At<'a> {
    /// R of `from_from_to`.
    pub r: &'a Matrix3<f64>,
    /// t of `from_from_to`, m.
    pub t: &'a Vector3<f64>,
    /// Coordinates of a point in its frame, m.
    pub point: &'a dyn Fn(PointId) -> Vector3<f64>,
}

impl At<'_> {
    /// R p + t
    pub(crate) fn place(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.r * p + self.t
    }
}

/// Residual and derivatives; rows beyond the kind's count stay 0.
pub(crate) struct Rows {
    /// Residual.
    pub e: [f64; 6],
    /// ∂e/∂[ω; v].
    pub m: [[f64; 6]; 6],
    /// The point measured, and ∂e/∂p.
    pub point: Option<(PointId, [[f64; 3]; 6])>,
}

impl Rows {
    pub(crate) fn zeros() -> Self {
        Self {
            e: [0.0; 6],
            m: [[0.0; 6]; 6],
            point: None,
        }
    }

    /// Three rows of `e = R p + t − y`:
    ///
    /// ```text
    /// de = R (−[p]ₓ ω + v + dp)
    /// ```
    ///
    /// Never −[Rᵀ(y − t)]ₓ, which is as good a derivative of e turned into the body, but lets the noise of y into the
    /// Jacobian: it would then see turns of the body that no marker can show.
    pub(crate) fn place(id: PointId, p: &Vector3<f64>, r: &Matrix3<f64>, e: &Vector3<f64>) -> Self {
        let mut out = Self::zeros();
        let rotation = -(r * so3::skew(p));
        let mut by_point = [[0.0; 3]; 6];
        for i in 0..3 {
            out.e[i] = e[i];
            for c in 0..3 {
                out.m[i][c] = rotation[(i, c)];
                out.m[i][3 + c] = r[(i, c)];
                by_point[i][c] = r[(i, c)];
            }
        }
        out.point = Some((id, by_point));
        out
    }

    /// Sets one row of residual e whose gradient by the place R p + t is b:
    ///
    /// ```text
    /// de = bᵀ R (ω × p + v + dp) = (p × Rᵀb)·ω + Rᵀb·(v + dp)
    /// ```
    pub(crate) fn project(
        &mut self,
        row: usize,
        e: f64,
        b: &Vector3<f64>,
        (id, p): (PointId, &Vector3<f64>),
        at: &At<'_>,
    ) {
        let in_body = at.r.tr_mul(b);
        let omega = p.cross(&in_body);
        self.e[row] = e;
        let (_, by_point) = self.point.get_or_insert((id, [[0.0; 3]; 6]));
        for c in 0..3 {
            self.m[row][c] = omega[c];
            self.m[row][3 + c] = in_body[c];
            by_point[row][c] = in_body[c];
        }
    }

    /// Six rows of a pose against a measured one:
    ///
    /// ```text
    /// e = [Log(R_zᵀR); R_zᵀ(t − t_z)],   de = [Jr⁻¹ ω; R_zᵀR v]
    /// ```
    pub(crate) fn pose(r_z: &Matrix3<f64>, t_z: &Vector3<f64>, at: &At<'_>) -> Self {
        let relative = r_z.tr_mul(at.r);
        let mut out = Self::rotation(&relative);
        let shift = r_z.tr_mul(&(at.t - t_z));
        for i in 0..3 {
            out.e[3 + i] = shift[i];
            for c in 0..3 {
                out.m[3 + i][3 + c] = relative[(i, c)];
            }
        }
        out
    }

    /// Six rows of the inverse of a pose against the inverse of a measured one:
    ///
    /// ```text
    /// e = [Log(R_zᵀR); p − p_z],  p = −Rᵀt,      de = [Jr⁻¹ ω; [p]ₓ ω − v]
    /// ```
    pub(crate) fn inverse_pose(r_z: &Matrix3<f64>, t_z: &Vector3<f64>, at: &At<'_>) -> Self {
        let mut out = Self::rotation(&r_z.tr_mul(at.r));
        let place = -at.r.tr_mul(at.t);
        let shift = place + r_z.tr_mul(t_z);
        let by_rotation = so3::skew(&place);
        for i in 0..3 {
            out.e[3 + i] = shift[i];
            out.m[3 + i][3 + i] = -1.0;
            for c in 0..3 {
                out.m[3 + i][c] = by_rotation[(i, c)];
            }
        }
        out
    }

    /// Three rows from `first` on, in other axes.
    pub(crate) fn in_axes(mut self, first: usize, axes: &Matrix3<f64>) -> Self {
        let (e, m, point) = (self.e, self.m, self.point);
        for i in 0..3 {
            let part =
                |of: &dyn Fn(usize) -> f64| (0..3).map(|c| axes[(i, c)] * of(first + c)).sum();
            self.e[first + i] = part(&|row| e[row]);
            for x in 0..6 {
                self.m[first + i][x] = part(&|row| m[row][x]);
            }
            if let (Some((_, by_point)), Some((_, before))) = (&mut self.point, &point) {
                for x in 0..3 {
                    by_point[first + i][x] = part(&|row| before[row][x]);
                }
            }
        }
        self
    }

    /// Three rows of Log(R_zᵀR).
    fn rotation(relative: &Matrix3<f64>) -> Self {
        let mut out = Self::zeros();
        let log = so3::log(&so3::quaternion_of(
            &nalgebra::Rotation3::from_matrix_unchecked(*relative),
        ));
        let jr = so3::right_jacobian_inverse(&log);
        for i in 0..3 {
            out.e[i] = log[i];
            for c in 0..3 {
                out.m[i][c] = jr[(i, c)];
            }
        }
        out
    }
}

/// Two unit vectors across d, deterministic: E(d).
pub(crate) fn tangent_basis(d: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let k = d.iamin();
    let mut seed = Vector3::zeros();
    seed[k] = 1.0;
    let e1 = (seed - d * d.dot(&seed)).normalize();
    [e1, d.cross(&e1)]
}
