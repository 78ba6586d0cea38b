//! Sums over the samples of one point, and the elimination of everything but the tracker's rotation.

use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, Vector3, Vector4};

use super::chain::Pose;
use super::rotation::{Mat9, Quadratic, Vec9};

/// Relative ridge on the normal matrix of the tracker's position: directions that the markers absorb as well are harmless.
const RIDGE: f64 = 1e-12;

/// Where a link is, with what all points on it share.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placed {
    rt: Matrix3<f64>,
    t: Vector3<f64>,
    /// Rᵀ t
    u: Vector3<f64>,
    /// tᵀ t
    tt: f64,
}

impl From<&Pose> for Placed {
    fn from(root_from_link: &Pose) -> Self {
        let (r, t) = (&root_from_link.r, root_from_link.t);
        Self {
            rt: r.transpose(),
            t,
            u: r.tr_mul(&t),
            tt: t.norm_squared(),
        }
    }
}

/// Moments of one marker (or virtual point of a pose) over some rows; they add up.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moments {
    /// Σ w
    pub w: f64,
    /// Σ w z̃ z̃ᵀ,  z̃ = [y; 1]
    z: Matrix4<f64>,
    /// Σ w t z̃ᵀ
    t: SMatrix<f64, 3, 4>,
    /// Σ w z̃ᵀ ⊗ Rᵀ, which is Σ w Rᵀ D with D = z̃ᵀ ⊗ I
    b: SMatrix<f64, 3, 12>,
    /// Σ w Rᵀ t
    u: Vector3<f64>,
    /// Σ w tᵀ t
    tt: f64,
}

impl Moments {
    pub(crate) const ZERO: Moments = Moments {
        w: 0.0,
        z: Matrix4::from_array_storage(nalgebra::ArrayStorage([[0.0; 4]; 4])),
        t: SMatrix::from_array_storage(nalgebra::ArrayStorage([[0.0; 3]; 4])),
        b: SMatrix::from_array_storage(nalgebra::ArrayStorage([[0.0; 3]; 12])),
        u: Vector3::new(0.0, 0.0, 0.0),
        tt: 0.0,
    };

    /// One sample: the measured point y (m), where its link is, the weight.
    pub(crate) fn add(&mut self, y: &Vector3<f64>, link: &Placed, w: f64) {
        let z = Vector4::new(y.x, y.y, y.z, 1.0);
        self.w += w;
        self.z.ger(w, &z, &z, 1.0);
        self.add_pose(y, link, w);
    }

    /// What of the sums depends on the measured points alone; the poses are to be added again.
    pub(crate) fn without_poses(&self) -> Self {
        Moments {
            w: self.w,
            z: self.z,
            ..Self::ZERO
        }
    }

    /// What of a sample depends on the link's pose.
    pub(crate) fn add_pose(&mut self, y: &Vector3<f64>, link: &Placed, w: f64) {
        let z = [w * y.x, w * y.y, w * y.z, w];
        let (rt, t) = (link.rt.as_slice(), link.t.as_slice());
        for (sums, wz) in self.b.as_mut_slice().chunks_exact_mut(9).zip(z) {
            sums.iter_mut().zip(rt).for_each(|(sum, r)| *sum += wz * r);
        }
        for (sums, wz) in self.t.as_mut_slice().chunks_exact_mut(3).zip(z) {
            sums.iter_mut().zip(t).for_each(|(sum, t)| *sum += wz * t);
        }
        self.u += link.u * w;
        self.tt += w * link.tt;
    }

    /// The other's sums on top.
    pub(crate) fn include(&mut self, other: &Moments) {
        self.w += other.w;
        self.z += other.z;
        self.t += other.t;
        self.b += other.b;
        self.u += other.u;
        self.tt += other.tt;
    }

    /// The point in its link that fits best for x = [vec Q; c]: `m = (B x − u)/W`.
    pub(crate) fn point(&self, x: &SVector<f64, 12>) -> Vector3<f64> {
        if self.w > 0.0 {
            (self.b * x - self.u) / self.w
        } else {
            Vector3::zeros()
        }
    }
}

/// The cost of all points as a quadratic of x = [vec Q; c], marker positions eliminated: `xᵀ H x + 2 gᵀ x + d`.
#[derive(Debug, Clone)]
pub(crate) struct Normal {
    /// Its lower half.
    h: SMatrix<f64, 12, 12>,
    g: SVector<f64, 12>,
    d: f64,
    /// Σ w
    pub w: f64,
    /// Points that have a sample.
    pub points: usize,
}

/// Where everything is in the best registration.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Registration {
    /// `root_from_tracker`, rotation.
    pub q: Matrix3<f64>,
    /// `root_from_tracker`, translation of the centered coordinates, m.
    pub c: Vector3<f64>,
    /// Weighted sum of squared residuals, m².
    pub f: f64,
}

impl Registration {
    pub(crate) fn x(&self) -> SVector<f64, 12> {
        let mut x = SVector::<f64, 12>::zeros();
        x.fixed_rows_mut::<9>(0).copy_from_slice(self.q.as_slice());
        x.fixed_rows_mut::<3>(9).copy_from(&self.c);
        x
    }
}

/// The quadratic of the rotation, and what gives the translation: `c = −L⁻ᵀ (X q + y)` with `L Lᵀ = H_cc`, `X = L⁻¹ H_cq`, `y = L⁻¹ g_c`.
struct Reduced {
    of_rotation: Quadratic,
    x: SMatrix<f64, 3, 9>,
    y: Vector3<f64>,
    root: Matrix3<f64>,
}

impl Reduced {
    fn of(
        h_qq: Mat9,
        g: SVector<f64, 12>,
        d: f64,
        x: SMatrix<f64, 3, 9>,
        y: Vector3<f64>,
        root: Matrix3<f64>,
    ) -> Self {
        let g_q: Vec9 = g.fixed_rows::<9>(0).into_owned();
        Self {
            of_rotation: Quadratic {
                a: h_qq - x.tr_mul(&x),
                b: g_q - x.tr_mul(&y),
                d: d - y.norm_squared(),
            },
            x,
            y,
            root,
        }
    }

    fn translation(&self, q: &Vec9) -> Vector3<f64> {
        let mut c = -(self.x * q + self.y);
        self.root.tr_solve_lower_triangular_mut(&mut c);
        c
    }
}

impl Normal {
    pub(crate) fn new() -> Self {
        Self {
            h: SMatrix::zeros(),
            g: SVector::zeros(),
            d: 0.0,
            w: 0.0,
            points: 0,
        }
    }

    /// Adds one point with all of its samples, its position in the link eliminated.
    pub(crate) fn include(&mut self, m: &Moments) {
        if m.w <= 0.0 {
            return;
        }
        // f = xᵀ(Z̃ ⊗ I)x − 2 vec(T̃)ᵀx + Σ w tᵀt − |B x − u|²/W
        for a in 0..4 {
            for b in 0..4 {
                for i in 0..3 {
                    self.h[(3 * a + i, 3 * b + i)] += m.z[(a, b)];
                }
            }
        }
        // The lower half: `reduced` needs no more.
        let b = m.b.data.0;
        for (k, right) in b.iter().enumerate() {
            let right = right.map(|x| x / m.w);
            for (i, left) in b.iter().enumerate().skip(k) {
                let dot = left[0] * right[0] + left[1] * right[1] + left[2] * right[2];
                self.h[(i, k)] -= dot;
            }
        }
        for a in 0..4 {
            for i in 0..3 {
                self.g[3 * a + i] -= m.t[(i, a)];
            }
        }
        self.g += m.b.tr_mul(&m.u) / m.w;
        self.d += m.tt - m.u.norm_squared() / m.w;
        self.w += m.w;
        self.points += 1;
    }

    /// A lower bound of the cost: its least value over all matrices Q.
    pub(crate) fn least(&self) -> f64 {
        self.reduced().of_rotation.least()
    }

    /// The quadratic of the rotation, with c eliminated, and what gives c.
    fn reduced(&self) -> Reduced {
        let mut h_qq: Mat9 = self.h.fixed_view::<9, 9>(0, 0).into_owned();
        h_qq.fill_upper_triangle_with_lower_triangle();
        let mut h_cq: SMatrix<f64, 3, 9> = self.h.fixed_view::<3, 9>(9, 0).into_owned();
        let mut g_c: Vector3<f64> = self.g.fixed_rows::<3>(9).into_owned();
        let ridge = RIDGE * self.w.max(f64::MIN_POSITIVE);
        let h_cc = self.h.fixed_view::<3, 3>(9, 9) + Matrix3::identity() * ridge;
        // Where one joint turns, its axis is a direction that the markers absorb: the inverse by minors has no digits left there, the factor has.
        let Some(factor) = h_cc.cholesky() else {
            h_cq.fill(0.0);
            g_c.fill(0.0);
            let root = Matrix3::identity();
            return Reduced::of(h_qq, self.g, self.d, h_cq, g_c, root);
        };
        let root = factor.l();
        root.solve_lower_triangular_mut(&mut h_cq);
        root.solve_lower_triangular_mut(&mut g_c);
        Reduced::of(h_qq, self.g, self.d, h_cq, g_c, root)
    }

    /// The cost at a rotation, with c eliminated.
    pub(crate) fn at(&self, q: &Matrix3<f64>) -> f64 {
        self.reduced().of_rotation.at(&super::rotation::vec9(q))
    }

    /// All minima over the rotations, the best first.
    pub(crate) fn minima(&self) -> Vec<Registration> {
        let reduced = self.reduced();
        let all = reduced.of_rotation.minima().into_iter();
        let with_c = |(q, f)| {
            let c = reduced.translation(&super::rotation::vec9(&q));
            Registration { q, c, f }
        };
        all.map(with_c).collect()
    }

    /// Eliminates c and minimizes over the rotations.
    pub(crate) fn solve(&self) -> Registration {
        let reduced = self.reduced();
        let (q, f) = reduced.of_rotation.minimum();
        let c = reduced.translation(&super::rotation::vec9(&q));
        Registration { q, c, f }
    }
}

#[cfg(test)]
mod tests {
    use calib_geometry::so3;

    use super::*;

    /// One joint turns, and all others stand still to the last bit: its axis is a direction that the markers absorb. The cost of the sums is that
    /// of the samples, wherever the joint is.
    #[test]
    fn the_cost_of_one_joint_that_turns_is_that_of_its_samples() {
        let wave = |k: usize| {
            Vector3::new(
                (k as f64).sin(),
                (1.7 * k as f64).cos(),
                (2.3 * k as f64).sin(),
            )
        };
        let turned = |v: Vector3<f64>| so3::exp(&v).to_rotation_matrix().into_inner();
        for case in 0..40 {
            let (q, c) = (turned(wave(case) * 1.5), wave(case + 100));
            let (r0, t0) = (turned(wave(case + 200)), wave(case + 300) * 0.6);
            let axis = wave(case + 400).normalize();
            let mut samples: Vec<(usize, Vector3<f64>, Pose)> = Vec::new();
            for row in 0..15 {
                let r = r0 * turned(axis * (0.2 * row as f64 - 1.4));
                let pose = Pose { r, t: t0 };
                for marker in 0..4 {
                    let noise = wave(7 * row + 31 * marker + case) * 2e-4;
                    let at = r * (wave(marker + 500) * 0.05) + t0 - c;
                    samples.push((marker, q.tr_mul(&at) + noise, pose));
                }
            }
            let center = samples.iter().map(|s| s.1).sum::<Vector3<f64>>() / samples.len() as f64;
            let mut moments = [Moments::ZERO; 4];
            for (marker, y, pose) in &samples {
                moments[*marker].add(&(y - center), &pose.into(), 1.0);
            }
            let mut normal = Normal::new();
            moments.iter().for_each(|m| normal.include(m));
            let found = normal.solve();
            let x = found.x();
            let of = |(marker, y, pose): &(usize, Vector3<f64>, Pose)| {
                let seen = found.q * (y - center) + found.c;
                let predicted = pose.r * moments[*marker].point(&x) + pose.t;
                (seen - predicted).norm_squared()
            };
            let direct: f64 = samples.iter().map(of).sum();
            // The rounding of sums over meters, beside 1e-8 m² a sample.
            assert!(
                (found.f - direct).abs() < 1e-3 * direct,
                "{case}: {} {direct}",
                found.f
            );
            assert!(direct < 60.0 * 3.0 * 4e-8, "{case}: {direct}");
        }
    }
}
