//! The least value of a quadratic over the rotations.

use std::sync::LazyLock;

use calib_geometry::decompose::symmetric_eigen_small;
use calib_geometry::so3;
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Vector3};

/// Nine columns of Q, one below the other.
pub(crate) type Vec9 = SVector<f64, 9>;
pub(crate) type Mat9 = SMatrix<f64, 9, 9>;

/// Newton steps: converges in 4–7 from a start inside the basin; a bound, not a tuning.
const MAX_STEPS: usize = 12;
/// A step (rad) after which f changes by less than its rounding.
const SMALL_STEP: f64 = 1e-9;
/// Starts from the cube that are refined beside the linear one: two miss no best minimum of 2 400, one misses 0.5 %.
const CUBE_STARTS: usize = 2;

/// A half turn that costs no more than this many times the best is tried: another minimum is near it.
const COMPARABLE: f64 = 10.0;
/// Rotations between two minima at which f is looked at.
const BETWEEN: u32 = 8;
/// Minima closer than this are one, rad.
const NEAR: f64 = 0.2;
/// By this f rises between two minima, at the least.
const RISE: f64 = 1.02;

/// `f(Q) = qᵀ A q + 2 bᵀ q + d` with `q = vec Q`, columns first.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Quadratic {
    pub a: Mat9,
    pub b: Vec9,
    pub d: f64,
}

impl Quadratic {
    /// f at a rotation.
    pub(crate) fn at(&self, q: &Vec9) -> f64 {
        q.dot(&(self.a * q + self.b * 2.0)) + self.d
    }

    /// The rotation of least f, and f.
    pub(crate) fn minimum(&self) -> (Matrix3<f64>, f64) {
        let mut starts: Vec<(f64, Matrix3<f64>)> = Vec::with_capacity(25);
        for r in cube() {
            starts.push((self.at(&vec9(&r)), r));
        }
        starts.sort_by(|x, y| x.0.total_cmp(&y.0));
        starts.truncate(CUBE_STARTS);
        if let Some(linear) = self.linear_start() {
            starts.push((self.at(&vec9(&linear)), linear));
        }
        let mut best = (starts[0].1, starts[0].0);
        for (_, start) in starts {
            let found = self.newton(start);
            if found.1 < best.1 {
                best = found;
            }
        }
        for turned in self.half_turns(&best.0) {
            if self.at(&vec9(&turned)) < COMPARABLE * best.1 {
                let found = self.newton(turned);
                if found.1 < best.1 {
                    best = found;
                }
            }
        }
        (best.0, best.1.max(0.0))
    }

    /// The rotation turned by 180° about the axes of the curvatures of f: of points that move by little, these have minima of their own.
    fn half_turns(&self, r: &Matrix3<f64>) -> [Matrix3<f64>; 3] {
        let axes = symmetric_eigen_small(&self.slopes(r).1).vectors;
        [0, 1, 2].map(|k| {
            let axis = axes.column(k);
            r * (axis * axis.transpose() * 2.0 - Matrix3::identity())
        })
    }

    /// The rotations of least f in their surroundings, each behind a rise of f from every better one, the best first.
    pub(crate) fn minima(&self) -> Vec<(Matrix3<f64>, f64)> {
        let best = self.minimum().0;
        let starts = cube().map(|r| best * r);
        let mut all: Vec<(Matrix3<f64>, f64)> = starts.map(|start| self.newton(start)).collect();
        all.sort_by(|x, y| x.1.total_cmp(&y.1));
        let mut kept: Vec<(Matrix3<f64>, f64)> = Vec::new();
        for (r, f) in all {
            if kept.iter().all(|(other, _)| self.rises_between(other, &r)) {
                kept.push((r, f.max(0.0)));
            }
        }
        kept
    }

    /// Whether f rises between two rotations above both; along a valley it does not.
    fn rises_between(&self, first: &Matrix3<f64>, second: &Matrix3<f64>) -> bool {
        let between = Rotation3::from_matrix_unchecked(first.tr_mul(second)).scaled_axis();
        let at = |part: f64| {
            let turned = so3::exp(&(between * part))
                .to_rotation_matrix()
                .into_inner();
            self.at(&vec9(&(first * turned)))
        };
        let highest = (1..BETWEEN).map(|k| at(f64::from(k) / f64::from(BETWEEN)));
        let highest = highest.fold(f64::NEG_INFINITY, f64::max);
        between.norm() > NEAR && highest > RISE * at(0.0).max(at(1.0)).max(0.0)
    }

    /// The unconstrained minimum `−(A + εI)⁻¹ b`.
    fn unconstrained(&self) -> Option<Vec9> {
        let ridge = 1e-12 * self.a.trace().max(f64::MIN_POSITIVE);
        let factor = (self.a + Mat9::identity() * ridge).cholesky()?;
        Some(-factor.solve(&self.b))
    }

    /// The least value over all matrices: no rotation has a smaller one.
    pub(crate) fn least(&self) -> f64 {
        self.unconstrained()
            .map_or(0.0, |q| (q.dot(&self.b) + self.d).max(0.0))
    }

    /// The unconstrained minimum, projected on the rotations.
    fn linear_start(&self) -> Option<Matrix3<f64>> {
        let q = self.unconstrained()?;
        let rotation = so3::nearest_rotation(&mat3(&q))?;
        Some(rotation.to_rotation_matrix().into_inner())
    }

    /// Half of the first and second derivatives of f by δ of `Q exp δ`.
    fn slopes(&self, r: &Matrix3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        let slope = self.a * vec9(r) + self.b;
        // ∂vec(Q exp δ)/∂δ: column block a is −Q [e_a]ₓ
        let mut j = SMatrix::<f64, 9, 3>::zeros();
        for a in 0..3 {
            let e = Vector3::ith(a, 1.0);
            j.fixed_rows_mut::<3>(3 * a)
                .copy_from(&(-(r * e.cross_matrix())));
        }
        let g = j.transpose() * slope;
        // H = Jᵀ A J + sym(Gᵀ Q) − tr(Gᵀ Q) I,   G = mat(A q + b)
        let m = mat3(&slope).transpose() * r;
        let h = j.transpose() * self.a * j + (m + m.transpose()) * 0.5
            - Matrix3::identity() * m.trace();
        (g, (h + h.transpose()) * 0.5)
    }

    /// Newton with the absolute values of the curvatures and a damping that grows when f does not fall.
    fn newton(&self, start: Matrix3<f64>) -> (Matrix3<f64>, f64) {
        let mut r = start;
        let mut f = self.at(&vec9(&r));
        let mut damping = 0.0;
        for _ in 0..MAX_STEPS {
            let (g, h) = self.slopes(&r);
            let eigen = symmetric_eigen_small(&h);
            let largest = eigen.values.amax().max(f64::MIN_POSITIVE);
            let mut delta = Vector3::zeros();
            for k in 0..3 {
                let v = eigen.vectors.column(k);
                let curvature = eigen.values[k].abs().max(1e-12 * largest) + damping * largest;
                delta -= v * (v.dot(&g) / curvature);
            }
            let size = delta.norm();
            if size > 1.0 {
                delta /= size;
            }
            let trial = r * so3::exp(&delta).to_rotation_matrix().into_inner();
            let f_trial = self.at(&vec9(&trial));
            if f_trial <= f {
                (r, f) = (trial, f_trial);
                damping *= 0.1;
            } else {
                damping = if damping == 0.0 { 1e-3 } else { damping * 10.0 };
            }
            if size < SMALL_STEP {
                break;
            }
        }
        (r, f)
    }
}

pub(crate) fn vec9(r: &Matrix3<f64>) -> Vec9 {
    Vec9::from_column_slice(r.as_slice())
}

pub(crate) fn mat3(q: &Vec9) -> Matrix3<f64> {
    Matrix3::from_column_slice(q.as_slice())
}

/// The 24 rotations of the cube: signed permutation matrices with determinant +1.
pub(crate) fn cube() -> impl Iterator<Item = Matrix3<f64>> {
    const ORDERS: [[usize; 3]; 6] = [
        [0, 1, 2],
        [1, 2, 0],
        [2, 0, 1],
        [0, 2, 1],
        [2, 1, 0],
        [1, 0, 2],
    ];
    ORDERS.into_iter().flat_map(|order| {
        (0..8_u32).filter_map(move |signs| {
            let mut r = Matrix3::zeros();
            for a in 0..3 {
                r[(order[a], a)] = if signs >> a & 1 == 0 { 1.0 } else { -1.0 };
            }
            (r.determinant() > 0.0).then_some(r)
        })
    })
}

/// The rotation that a [`TrackerAxes`](super::hypothesis::Hypothesis::TrackerAxes) applies to the coordinates of its recording; 0 is the identity.
#[must_use]
pub fn axes_rotation(rotation: u8) -> Matrix3<f64> {
    // Asked for once for every sample.
    static CUBE: LazyLock<Vec<Matrix3<f64>>> = LazyLock::new(|| cube().collect());
    let found = CUBE.get(usize::from(rotation));
    found.copied().unwrap_or_else(Matrix3::identity)
}
