//! The registration alone: where the tracker stands, from points of unknown place on links of known poses.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::chain::Pose;
use super::moments::{Moments, Normal, Placed, Registration};

/// The best registration, equation (2) of [`structural`](super), and one to compare it with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registered {
    /// Where the root of the robot is.
    pub tracker_from_root: Isometry3<f64>,
    /// Root mean square of the residuals, m.
    pub rms: f64,
    /// The same for the rotation of the other registration, everything else at its best, m.
    pub rms_of_other: f64,
}

/// The rows that see a point: `(root_from_link, position in the tracker's frame)`.
pub type PointRows = Vec<(Isometry3<f64>, Point3<f64>)>;

/// The rotation of least residual over all rotations, and position and points that go with it; `other` is compared with it.
/// `None` without rows.
#[must_use]
pub fn registration(points: &[PointRows], other: &Isometry3<f64>) -> Option<Registered> {
    let summed = Summed::of(points)?;
    let found = summed.normal.solve();
    let inverse: Matrix3<f64> = other.rotation.inverse().to_rotation_matrix().into_inner();
    Some(Registered {
        tracker_from_root: summed.tracker_from_root(&found),
        rms: summed.rms(found.f),
        rms_of_other: summed.rms(summed.normal.at(&inverse)),
    })
}

/// All registrations with less residual than those around them: `tracker_from_root` and rms, m, the best first. Points that move little leave several.
#[must_use]
pub fn registrations(points: &[PointRows]) -> Vec<(Isometry3<f64>, f64)> {
    let Some(summed) = Summed::of(points) else {
        return Vec::new();
    };
    let all = summed.normal.minima().into_iter();
    all.map(|found| (summed.tracker_from_root(&found), summed.rms(found.f)))
        .collect()
}

/// Rows of points as sums, relative to their mean position, so that the translation does not swamp the rest.
struct Summed {
    normal: Normal,
    mean: Vector3<f64>,
    count: usize,
}

impl Summed {
    /// `None` without rows.
    fn of(points: &[PointRows]) -> Option<Self> {
        let rows = || points.iter().flatten();
        let count = rows().count();
        if count == 0 {
            return None;
        }
        let mean = rows().map(|(_, y)| y.coords).sum::<Vector3<f64>>() / count as f64;
        let mut normal = Normal::new();
        for point in points {
            let mut moments = Moments::ZERO;
            for (root_from_link, y) in point {
                let link = Pose {
                    r: root_from_link.rotation.to_rotation_matrix().into_inner(),
                    t: root_from_link.translation.vector,
                };
                moments.add(&(y.coords - mean), &Placed::from(&link), 1.0);
            }
            normal.include(&moments);
        }
        Some(Self {
            normal,
            mean,
            count,
        })
    }

    fn tracker_from_root(&self, found: &Registration) -> Isometry3<f64> {
        let rotation = Rotation3::from_matrix_unchecked(found.q);
        let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
        let translation = Translation3::from(found.c - rotation * self.mean);
        Isometry3::from_parts(translation, rotation).inverse()
    }

    /// Root mean square of residuals, m, from their sum of squares.
    fn rms(&self, f: f64) -> f64 {
        (f.max(0.0) / self.count as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six poses of a body that the linear equations leave open: the registration is exact all the same.
    #[test]
    fn few_poses_are_registered_exactly() {
        let tracker_from_root =
            Isometry3::new(Vector3::new(0.4, -1.2, 0.7), Vector3::new(1.1, -2.0, 0.6));
        for turn in 0..20 {
            let phase = f64::from(turn) * 0.37;
            let link = |i: usize| {
                let a = |k: f64| (phase + (i as f64 + 1.0) * k).sin();
                Isometry3::new(
                    Vector3::new(a(0.9), a(1.7), a(2.3)) * 0.4,
                    Vector3::new(a(1.3), a(0.7), a(2.9)),
                )
            };
            let at = [
                Point3::new(0.05, -0.02, 0.1),
                Point3::new(-0.04, 0.03, 0.12),
            ];
            let points: Vec<PointRows> = at
                .iter()
                .map(|p| {
                    (0..6)
                        .map(|i| (link(i), tracker_from_root * link(i) * p))
                        .collect()
                })
                .collect();
            let found = registration(&points, &Isometry3::identity()).expect("rows");
            let off = found.tracker_from_root.inverse() * tracker_from_root;
            assert!(
                off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-6,
                "{off}"
            );
            assert!(found.rms < 1e-6, "{}", found.rms);
            assert!(found.rms_of_other > 0.02, "{}", found.rms_of_other);
            let same = registration(&points, &tracker_from_root).expect("rows");
            assert!(same.rms_of_other < 1e-6);
        }
        assert!(registration(&[], &tracker_from_root).is_none());
    }
}
