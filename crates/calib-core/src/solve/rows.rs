//! One sample's residuals, their Jacobian, and the covariance they should have.
//!
//! ```text
//! e_s(x) ∈ R^m,   J_s = ∂e/∂x (m × n),   G_s = ∂e/∂u (m × k)
//! V_s = blockdiag( σ_g² shape / w ) + G_s diag(σ_k²) G_sᵀ                                (1)
//! ```
//!
//! u are the sample's random effects (joint noise, wobble), w the robust weight of each vector.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use calib_geometry::so3;

use crate::graph::measurement::{MeasurementKind, PoseNoise};
use crate::model::cache::EdgeCache;
use crate::model::layout::Model;
use crate::model::path::{Derivatives, PathBuffer};
use crate::model::pose::Pose;
use crate::model::values::Values;

/// Scratch and result of [`SampleRows::fill`]; all matrices row-major.
#[derive(Debug, Clone)]
pub(crate) struct SampleRows {
    pub m: usize,
    pub n: usize,
    pub k: usize,
    /// m × n
    pub j: Vec<f64>,
    /// m
    pub r: Vec<f64>,
    /// m × k
    pub g: Vec<f64>,
    /// m × m, lower triangle: V_s, then (after [`SampleRows::factor`]) its Cholesky factor.
    pub v: Vec<f64>,
    /// (observation, first row, rows); observations of weight 0 are absent.
    pub blocks: Vec<(usize, usize, usize)>,
    buffers: Vec<PathBuffer>,
}

/// Columns of a point's coordinates, and ∂e/∂p by rows.
type PointRows = ([Option<usize>; 3], [[f64; 3]; 6]);

/// Rows of one observation against the body twist, before the chain rule.
pub(crate) struct MeasurementRows {
    pub e: [f64; 6],
    pub m: [[f64; 6]; 6],
    /// ∂e/∂(point coordinates), rows × 3.
    pub point: Option<PointRows>,
}

impl SampleRows {
    pub(crate) fn new(model: &Model) -> Self {
        let (m, n, k) = (model.max_rows, model.free(), model.slots.len());
        Self {
            m: 0,
            n,
            k,
            j: vec![0.0; m * n],
            r: vec![0.0; m],
            g: vec![0.0; m * k],
            v: vec![0.0; m * m],
            blocks: Vec::with_capacity(m),
            buffers: model
                .paths
                .iter()
                .map(crate::model::path::CompiledPath::buffer)
                .collect(),
        }
    }

    /// Residuals (and derivatives as wanted) of a sample at `values`.
    pub(crate) fn fill(
        &mut self,
        model: &Model,
        cache: &EdgeCache,
        values: &Values,
        weights: &[f64],
        sample: usize,
        wanted: Derivatives,
    ) {
        self.m = 0;
        self.blocks.clear();
        let (n, k) = (self.n, self.k);
        let range = model.of_sample[sample].clone();
        let mut measurement = usize::MAX;
        let mut pose = Pose::identity();
        for o in range {
            if weights[o] <= 0.0 {
                continue;
            }
            let observation = model.observations[o];
            if observation.measurement != measurement {
                measurement = observation.measurement;
                pose = model.paths[measurement].evaluate(
                    &model.problem,
                    cache,
                    values,
                    sample,
                    wanted,
                    &mut self.buffers[measurement],
                );
            }
            let rows = residual(
                model,
                values,
                observation.measurement,
                observation.item,
                &pose,
            );
            let first = self.m;
            let count = observation.rows;
            self.blocks.push((o, first, count));
            self.m += count;
            let path = &model.paths[measurement];
            let buffer = &self.buffers[measurement];
            for i in 0..count {
                let row = first + i;
                self.r[row] = rows.e[i];
                if wanted == Derivatives::All {
                    let out = &mut self.j[row * n..(row + 1) * n];
                    out.fill(0.0);
                    for (&global, twist) in path.columns.iter().zip(&buffer.columns) {
                        out[global] = dot(&rows.m[i], twist);
                    }
                    if let Some((columns, jacobian)) = &rows.point {
                        for (c, &d) in columns.iter().zip(&jacobian[i]) {
                            if let Some(c) = c {
                                out[*c] += d;
                            }
                        }
                    }
                }
                if wanted != Derivatives::None && k > 0 {
                    let out = &mut self.g[row * k..(row + 1) * k];
                    out.fill(0.0);
                    for (&global, twist) in path.slots.iter().zip(&buffer.slots) {
                        out[global] = dot(&rows.m[i], twist);
                    }
                }
            }
        }
    }

    /// V_s of equation (1) into the lower triangle of `v`. `theta`: σ² per group.
    pub(crate) fn covariance(&mut self, model: &Model, weights: &[f64], theta: &[f64]) {
        let m = self.m;
        self.v[..m * m].fill(0.0);
        for &(o, first, count) in &self.blocks {
            add_block(model, o, |i, j, group, shape| {
                self.v[(first + i) * m + first + j] += theta[group] * shape / weights[o];
            });
            let _ = count;
        }
        for (s, slot) in model.slots.iter().enumerate() {
            let variance = slot.group.map_or(1.0, |g| theta[g]);
            for i in 0..m {
                let gi = self.g[i * self.k + s] * variance;
                if gi != 0.0 {
                    for j in 0..=i {
                        self.v[i * m + j] += gi * self.g[j * self.k + s];
                    }
                }
            }
        }
    }

    /// V = L Lᵀ in place; log det V, or `None` if V is not positive definite.
    pub(crate) fn factor(&mut self) -> Option<f64> {
        let m = self.m;
        let mut log_det = 0.0;
        for j in 0..m {
            for i in j..m {
                let mut sum = self.v[i * m + j];
                for l in 0..j {
                    sum -= self.v[i * m + l] * self.v[j * m + l];
                }
                if i == j {
                    if !(sum > 0.0 && sum.is_finite()) {
                        return None;
                    }
                    log_det += sum.ln();
                    self.v[i * m + i] = sum.sqrt();
                } else {
                    self.v[i * m + j] = sum / self.v[j * m + j];
                }
            }
        }
        Some(log_det)
    }

    /// r ← L⁻¹ r and, if asked, J ← L⁻¹ J.
    pub(crate) fn whiten(&mut self, jacobian: bool) {
        let (m, n) = (self.m, self.n);
        for i in 0..m {
            let (done, rest) = self.j.split_at_mut(i * n);
            let row = &mut rest[..n];
            for l in 0..i {
                let c = self.v[i * m + l];
                if c != 0.0 {
                    self.r[i] -= c * self.r[l];
                    if jacobian {
                        for (x, y) in row.iter_mut().zip(&done[l * n..(l + 1) * n]) {
                            *x -= c * y;
                        }
                    }
                }
            }
            let d = 1.0 / self.v[i * m + i];
            self.r[i] *= d;
            if jacobian {
                row.iter_mut().for_each(|x| *x *= d);
            }
        }
    }

    /// |L⁻¹r|² after whitening.
    pub(crate) fn squared_norm(&self) -> f64 {
        self.r[..self.m].iter().map(|x| x * x).sum()
    }
}

#[inline]
pub(crate) fn dot(row: &[f64; 6], twist: &Vector6<f64>) -> f64 {
    row[0] * twist[0]
        + row[1] * twist[1]
        + row[2] * twist[2]
        + row[3] * twist[3]
        + row[4] * twist[4]
        + row[5] * twist[5]
}

/// Calls `f(i, j ≤ i, group, shape_ij)` for every entry of an observation's own covariance.
pub(crate) fn add_block(
    model: &Model,
    observation: usize,
    mut f: impl FnMut(usize, usize, usize, f64),
) {
    let o = model.observations[observation];
    let mut isotropic = |group: usize, rows: std::ops::Range<usize>| {
        for i in rows {
            f(i, i, group, 1.0);
        }
    };
    match &model.problem.measurements[o.measurement].kind {
        MeasurementKind::Markers {
            noise,
            observations,
        } => match observations[o.item].shape {
            None => isotropic(noise.index(), 0..3),
            Some(shape) => {
                for i in 0..3 {
                    for j in 0..=i {
                        f(i, j, noise.index(), shape[(i, j)]);
                    }
                }
            }
        },
        MeasurementKind::Poses { noise, .. } | MeasurementKind::Loop { noise, .. } => match noise {
            PoseNoise::Split {
                orientation,
                position,
            } => {
                isotropic(orientation.index(), 0..3);
                isotropic(position.index(), 3..6);
            }
            PoseNoise::Full { shape, scale } => {
                for i in 0..6 {
                    for j in 0..=i {
                        f(i, j, scale.index(), shape[(i, j)]);
                    }
                }
            }
        },
        MeasurementKind::Directions { noise, .. } | MeasurementKind::Line { noise, .. } => {
            isotropic(noise.index(), 0..2);
        }
        MeasurementKind::Plane { noise, .. } | MeasurementKind::Distance { noise, .. } => {
            isotropic(noise.index(), 0..1);
        }
    }
}

/// Two unit vectors across d, deterministic.
pub(crate) fn tangent_basis(d: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let k = d.iamin();
    let mut seed = Vector3::zeros();
    seed[k] = 1.0;
    let e1 = (seed - d * d.dot(&seed)).normalize();
    [e1, d.cross(&e1)]
}

/// Equations (1)–(7) of the measurements at the path's pose.
pub(crate) fn residual(
    model: &Model,
    values: &Values,
    measurement: usize,
    item: usize,
    pose: &Pose,
) -> MeasurementRows {
    let mut out = MeasurementRows {
        e: [0.0; 6],
        m: [[0.0; 6]; 6],
        point: None,
    };
    match &model.problem.measurements[measurement].kind {
        MeasurementKind::Markers { observations, .. } => {
            let o = &observations[item];
            let p = model.point_position(o.point.index(), values).coords;
            // e = R p + t − y; de = R (−[p]ₓ ω + v + dp). Never −[Rᵀ(y − t)]ₓ, which is as good a
            // derivative of e turned into the body, but lets the noise of y into the Jacobian: it
            // would then see turns of the body that no marker can show.
            let e = pose.r * p + pose.t - o.position.coords;
            set_point_rows(&mut out, &pose.r, &p, &e);
            out.point = point_columns(model, o.point.index(), &pose.r, 3);
        }
        MeasurementKind::Poses { observations, .. } => {
            pose_rows(&mut out, &Pose::of(&observations[item].pose), pose);
        }
        MeasurementKind::Loop { .. } => pose_rows(&mut out, &Pose::identity(), pose),
        MeasurementKind::Directions {
            direction,
            observations,
            sign_free,
            ..
        } => {
            let d = observations[item].direction.into_inner();
            let predicted = pose.r * direction.into_inner();
            let d = if *sign_free && d.dot(&predicted) < 0.0 {
                -d
            } else {
                d
            };
            // d(R a) = −R [a]ₓ ω
            let by_omega = -(pose.r * so3::skew(direction));
            for (i, b) in tangent_basis(&d).iter().enumerate() {
                out.e[i] = b.dot(&predicted);
                let row = by_omega.tr_mul(b);
                out.m[i][..3].copy_from_slice(row.as_slice());
            }
        }
        MeasurementKind::Plane {
            point,
            normal,
            observations,
            ..
        } => {
            let p = model.point_position(point.index(), values).coords;
            let e = normal.dot(&(pose.r * p + pose.t)) - observations[item].1;
            project(&mut out, model, point.index(), pose, &p, 0, normal, e);
        }
        MeasurementKind::Line {
            point,
            through,
            direction,
            ..
        } => {
            let p = model.point_position(point.index(), values).coords;
            let off = pose.r * p + pose.t - through.coords;
            for (i, b) in tangent_basis(direction).iter().enumerate() {
                project(&mut out, model, point.index(), pose, &p, i, b, b.dot(&off));
            }
        }
        MeasurementKind::Distance {
            point,
            anchor,
            observations,
            ..
        } => {
            let p = model.point_position(point.index(), values).coords;
            let off = pose.r * p + pose.t - anchor.coords;
            let length = off.norm();
            // At distance 0 the gradient has no direction; any unit vector is a subgradient.
            let unit = if length > 0.0 {
                off / length
            } else {
                Vector3::x()
            };
            let e = length - observations[item].1;
            project(&mut out, model, point.index(), pose, &p, 0, &unit, e);
        }
    }
    out
}

/// Rows of `A (ω × p + v)` with residual e.
fn set_point_rows(out: &mut MeasurementRows, a: &Matrix3<f64>, p: &Vector3<f64>, e: &Vector3<f64>) {
    let rotation = -(a * so3::skew(p));
    for i in 0..3 {
        out.e[i] = e[i];
        for c in 0..3 {
            out.m[i][c] = rotation[(i, c)];
            out.m[i][3 + c] = a[(i, c)];
        }
    }
}

/// One row `bᵀ (R p + t)`.
#[expect(clippy::too_many_arguments, reason = "one row of one measurement")]
fn project(
    out: &mut MeasurementRows,
    model: &Model,
    point: usize,
    pose: &Pose,
    p: &Vector3<f64>,
    row: usize,
    b: &Vector3<f64>,
    e: f64,
) {
    out.e[row] = e;
    let in_body = pose.r.tr_mul(b);
    // bᵀ R (ω × p + v) = (p × Rᵀb)·ω + Rᵀb·v
    let omega = p.cross(&in_body);
    for c in 0..3 {
        out.m[row][c] = omega[c];
        out.m[row][3 + c] = in_body[c];
    }
    let mut a = Matrix3::zeros();
    a.row_mut(0).copy_from(&in_body.transpose());
    if let Some((columns, jacobian)) = point_columns(model, point, &a, 1) {
        let entry = out.point.get_or_insert((columns, [[0.0; 3]; 6]));
        entry.1[row] = jacobian[0];
    }
}

/// Columns of a point's coordinates and the first `rows` rows of ∂e/∂p = A.
fn point_columns(model: &Model, point: usize, a: &Matrix3<f64>, rows: usize) -> Option<PointRows> {
    let ids = model.problem.points[point].parameters?;
    let columns = ids.map(|id| model.column_of[id.index()]);
    let mut jacobian = [[0.0; 3]; 6];
    for i in 0..rows {
        for c in 0..3 {
            jacobian[i][c] = a[(i, c)];
        }
    }
    Some((columns, jacobian))
}

/// e = [Log(R_zᵀR); R_zᵀ(t − t_z)], de = [Jr⁻¹ ω; R_zᵀR v]
fn pose_rows(out: &mut MeasurementRows, measured: &Pose, pose: &Pose) {
    let relative = measured.r.tr_mul(&pose.r);
    let log = so3::log(&so3::quaternion_of(
        &nalgebra::Rotation3::from_matrix_unchecked(relative),
    ));
    let shift = measured.r.tr_mul(&(pose.t - measured.t));
    let jr = so3::right_jacobian_inverse(&log);
    for i in 0..3 {
        out.e[i] = log[i];
        out.e[3 + i] = shift[i];
        for c in 0..3 {
            out.m[i][c] = jr[(i, c)];
            out.m[3 + i][3 + c] = relative[(i, c)];
        }
    }
}

/// Covariance of a measured body pose given as 6×6: kept for callers that need the dense form.
pub(crate) fn symmetric(a: &Matrix6<f64>) -> Matrix6<f64> {
    (a + a.transpose()) * 0.5
}
