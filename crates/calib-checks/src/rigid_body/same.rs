//! A tracked pose that was computed from markers which are recorded too: one measurement under two names.

use nalgebra::{Isometry3, Point3, Vector3};

/// Rows that decide it.
const ROWS: usize = 8;
/// Part of the variance that independent markers give their centroid about the pose. A least-squares pose leaves none; of 24 coordinates and more,
/// chance leaves less than this in fewer than one of 10¹⁵.
const OF_INDEPENDENT: f64 = 0.05;
/// No tracker's markers scatter less, m: below, numbers are rounded.
const SCATTER: f64 = 1e-6;

/// Whether the pose (`tracker_from_body`) is the least-squares fit of these markers (points in the tracker's frame, m): their centroid does not move
/// in its frame although they do. Rows that lack a marker or the pose are passed over. `false` where fewer than 8 rows or 3 markers show it.
#[must_use]
pub fn is_pose_of(poses: &[Option<Isometry3<f64>>], markers: &[&[Option<Point3<f64>>]]) -> bool {
    if markers.len() < 3 {
        return false;
    }
    let rows = poses.iter().enumerate().filter_map(|(row, pose)| {
        let body_from_tracker = pose.as_ref()?.inverse();
        let seen = markers
            .iter()
            .map(|track| track.get(row).copied().flatten());
        let seen = seen.map(|point| Some((body_from_tracker * point?).coords));
        seen.collect::<Option<Vec<Vector3<f64>>>>()
    });
    let rows: Vec<Vec<Vector3<f64>>> = rows.collect();
    if rows.len() < ROWS {
        return false;
    }
    let (count, n) = (rows.len() as f64, markers.len() as f64);
    let means: Vec<Vector3<f64>> = (0..markers.len())
        .map(|k| rows.iter().map(|row| row[k]).sum::<Vector3<f64>>() / count)
        .collect();
    let (mut of_centroid, mut within) = (0.0, 0.0);
    for row in &rows {
        let left: Vec<Vector3<f64>> = row.iter().zip(&means).map(|(p, m)| p - m).collect();
        let centroid = left.iter().sum::<Vector3<f64>>() / n;
        of_centroid += centroid.norm_squared();
        within += left
            .iter()
            .map(|p| (p - centroid).norm_squared())
            .sum::<f64>();
    }
    // Of the 3(n − 1) coordinates of a row about their centroid, the rotation takes three.
    let freedom = (count - 1.0) * 3.0;
    let variance = within / (freedom * (n - 2.0));
    variance.sqrt() > SCATTER && of_centroid / freedom < OF_INDEPENDENT * variance / n
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    type Tracks = Vec<Vec<Option<Point3<f64>>>>;

    /// Forty rows of a body of `count` markers with noise of 0.1 mm, and its poses: true ones with noise of `sigma` (m; rad per 0.1 m), or the ones
    /// that put the markers' centroid where it belongs.
    fn rows(count: usize, sigma: Option<f64>) -> (Vec<Option<Isometry3<f64>>>, Tracks) {
        let mut rng = ChaCha8Rng::seed_from_u64(count as u64);
        let mut normal = move |s: f64| s * rng.sample::<f64, _>(StandardNormal);
        let corners = [
            [0.0, 0.0, 0.0],
            [0.08, 0.0, 0.0],
            [0.0, 0.06, 0.0],
            [0.03, 0.02, 0.05],
            [0.07, 0.06, 0.01],
        ];
        let (mut poses, mut tracks) = (Vec::new(), vec![Vec::new(); count]);
        for row in 0..40 {
            let x = f64::from(row);
            let turn = UnitQuaternion::from_euler_angles(x.sin(), (0.7 * x).cos(), (0.3 * x).sin());
            let true_pose =
                Isometry3::from_parts(Translation3::new(x.cos(), 2.0, (0.4 * x).sin()), turn);
            let mut mean = Vector3::zeros();
            for (track, corner) in tracks.iter_mut().zip(corners) {
                let noise = Vector3::new(normal(1e-4), normal(1e-4), normal(1e-4));
                mean += noise / count as f64;
                track.push(Some(true_pose * Point3::from(corner) + noise));
            }
            let shift = sigma.map_or(mean, |s| Vector3::new(normal(s), normal(s), normal(s)));
            poses.push(Some(Translation3::from(shift) * true_pose));
        }
        (poses, tracks)
    }

    #[test]
    fn a_pose_computed_from_the_markers_is_theirs_and_one_measured_apart_is_not() {
        for count in [3, 4, 5] {
            let is = |sigma| {
                let (poses, tracks) = rows(count, sigma);
                is_pose_of(
                    &poses,
                    &tracks.iter().map(Vec::as_slice).collect::<Vec<_>>(),
                )
            };
            assert!(is(None));
            assert!(!is(Some(1e-4)));
            // Even a pose without any noise of its own.
            assert!(!is(Some(0.0)));
        }
        let (poses, tracks) = rows(4, None);
        let few: Vec<_> = tracks.iter().map(|track| &track[..7]).collect();
        assert!(!is_pose_of(&poses[..7], &few));
    }
}
