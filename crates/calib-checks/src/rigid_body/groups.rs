//! Which markers keep their distances: the bodies that a table holds, found without being told.
//!
//! ```text
//! s_jk = q₈₀(|d_jk − median d_jk|) / 1.28        spread of the distance of two markers over the rows that show both
//! S_AB = max s_jk over j ∈ A, k ∈ B              groups are joined in the order of S (complete linkage)              (1)
//! stop where S > max(5 · S of the last join, 0.01 · the largest distance, 2.5 · √2 σ)
//! ```
//!
//! σ is the noise of one coordinate: stated, or what the stiffest pair shows, up to 5 mm; beyond, markers are not on one body whatever the noise.
//!
//! A joint changes distances by centimeters, noise and skin by parts of a millimeter to some, and bodies need not be equally stiff: what tells a
//! joint is the leap. The 80 % quantile bears one bad row in five and still sees a joint that moves in one row of four.

use calib_geometry::statistics::quantile_nearest;
use nalgebra::Point3;

/// The leap of (1).
const LEAP: f64 = 5.0;
/// Spread up to which markers are on one body whatever the leap, as a part of the largest distance.
const STIFF: f64 = 2e-3;
/// Noise of a coordinate, m, up to which the spread of the stiffest pair counts as noise where none is stated.
const PLAUSIBLE_NOISE: f64 = 5e-3;
/// Spread of a pair, in units of its noise, up to which it is noise: that of four rows, the fewest, exceeds it once in a thousand.
const NOISY: f64 = 2.5;
/// Spread of a distance in a file that only a joint makes, m: a marker that slips, or a bad row in five, stays below.
const OF_A_JOINT: f64 = 0.01;
/// Rows that two markers must share in such a file.
const ROWS_OF_A_FILE: usize = 8;
/// Rows that two markers must share to be distinguished.
const MIN_ROWS: usize = 4;

/// The markers in groups that each keep their distances (1), by the first marker of each.
///
/// Two markers that are never seen together are not distinguished by their own distance. `sigma`: noise of a coordinate, m, where it is stated.
#[must_use]
pub fn rigid_groups(tracks: &[&[Option<Point3<f64>>]], sigma: Option<f64>) -> Vec<Vec<usize>> {
    rigid_groups_of_files(tracks, sigma, &[])
}

/// The same of several files, one after the other, which begin at these rows: a joint that moves two bodies in one file only shows them apart there.
#[must_use]
pub fn rigid_groups_of_files(
    tracks: &[&[Option<Point3<f64>>]],
    sigma: Option<f64>,
    begins: &[usize],
) -> Vec<Vec<usize>> {
    let n = tracks.len();
    let mut spread = vec![vec![0.0; n]; n];
    let (mut extent, mut stiffest) = (0.0_f64, f64::INFINITY);
    for j in 0..n {
        for k in 0..j {
            if let Some((median, wide)) = distance(tracks[j], tracks[k]) {
                let wide = wide.max(moved_in_a_file(tracks[j], tracks[k], begins));
                spread[j][k] = wide;
                spread[k][j] = wide;
                extent = extent.max(median);
                stiffest = stiffest.min(wide);
            }
        }
    }
    let apart = |a: &[usize], b: &[usize]| -> f64 {
        a.iter()
            .flat_map(|&j| b.iter().map(move |&k| (j, k)))
            .map(|(j, k)| spread[j][k])
            .fold(0.0, f64::max)
    };
    let mut groups: Vec<Vec<usize>> = (0..n).map(|j| vec![j]).collect();
    let mut last = STIFF * extent;
    // The distance of two markers has the noise of both.
    let of_noise = sigma.map_or(stiffest.min(PLAUSIBLE_NOISE * f64::sqrt(2.0)), |s| {
        s * f64::sqrt(2.0)
    });
    while let Some((nearest, a, b)) = (0..groups.len())
        .flat_map(|b| (0..b).map(move |a| (a, b)))
        .map(|(a, b)| (apart(&groups[a], &groups[b]), a, b))
        .min_by(|x, y| x.0.total_cmp(&y.0))
    {
        if nearest > (LEAP * last).max(NOISY * of_noise) {
            break;
        }
        last = last.max(nearest);
        let joined = groups.remove(b);
        groups[a].extend(joined);
        groups[a].sort_unstable();
    }
    groups.sort_unstable();
    groups
}

/// The largest spread within a file, where it is that of a joint.
fn moved_in_a_file(a: &[Option<Point3<f64>>], b: &[Option<Point3<f64>>], begins: &[usize]) -> f64 {
    let end = a.len().min(b.len());
    let ends = begins.iter().skip(1).copied().chain([end]);
    let files = begins.iter().zip(ends);
    let of_file = |(begin, end): (&usize, usize)| {
        let rows = (*begin).min(end)..end;
        let shared = rows.clone().filter(|i| a[*i].is_some() && b[*i].is_some());
        let enough = shared.count() >= ROWS_OF_A_FILE;
        let (_, wide) = distance(&a[rows.clone()], &b[rows]).filter(|_| enough)?;
        Some(wide).filter(|wide| *wide > OF_A_JOINT)
    };
    files.filter_map(of_file).fold(0.0, f64::max)
}

/// Median and spread of the distance of two markers.
fn distance(a: &[Option<Point3<f64>>], b: &[Option<Point3<f64>>]) -> Option<(f64, f64)> {
    let mut lengths: Vec<f64> = a
        .iter()
        .zip(b)
        .filter_map(|(a, b)| Some((*a.as_ref()? - *b.as_ref()?).norm()))
        .collect();
    if lengths.len() < MIN_ROWS {
        return None;
    }
    let median = quantile_nearest(&mut lengths, 0.5)?;
    for length in &mut lengths {
        *length = (*length - median).abs();
    }
    Some((median, quantile_nearest(&mut lengths, 0.8)? / 1.28))
}

#[cfg(test)]
mod tests {
    use super::{rigid_groups, rigid_groups_of_files};
    use nalgebra::{Point3, Rotation3, Vector3};

    /// Two bodies of three markers about one axis; the second turns in `turning` of 20 rows.
    fn hinge(turning: usize, shake: f64) -> Vec<Vec<Option<Point3<f64>>>> {
        let layout = [
            [0.0, 0.0, 0.0],
            [0.1, 0.0, 0.0],
            [0.0, 0.1, 0.02],
            [0.3, 0.0, 0.0],
            [0.4, 0.02, 0.0],
            [0.3, 0.1, 0.0],
        ];
        layout
            .iter()
            .enumerate()
            .map(|(m, p)| {
                (0..20)
                    .map(|row| {
                        let moved = m >= 3 && row < turning;
                        let angle = if moved { 0.5 + 0.05 * row as f64 } else { 0.0 };
                        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
                        let noise = |k: usize| shake * ((row * 7 + m * 13 + k * 5) % 11) as f64;
                        let at = turn * Point3::from(*p);
                        Some(at + Vector3::new(noise(0), noise(1), noise(2)))
                    })
                    .collect()
            })
            .collect()
    }

    fn groups(tracks: &[Vec<Option<Point3<f64>>>]) -> Vec<Vec<usize>> {
        let tracks: Vec<&[Option<Point3<f64>>]> = tracks.iter().map(Vec::as_slice).collect();
        rigid_groups(&tracks, None)
    }

    #[test]
    fn two_bodies_are_two_groups_and_one_is_one() {
        for shake in [0.0, 1e-4] {
            assert_eq!(
                groups(&hinge(20, shake)),
                [vec![0, 1, 2], vec![3, 4, 5]],
                "{shake}"
            );
            // Six of twenty rows move.
            assert_eq!(groups(&hinge(6, shake)).len(), 2, "{shake}");
            assert_eq!(
                groups(&hinge(0, shake)),
                [vec![0, 1, 2, 3, 4, 5]],
                "{shake}"
            );
        }
    }

    #[test]
    fn a_joint_that_moves_in_one_file_only_shows_two_bodies() {
        // Ten of a hundred rows.
        let mut tracks = hinge(0, 1e-4);
        let moving = hinge(10, 1e-4);
        for (track, moving) in tracks.iter_mut().zip(&moving) {
            let still = track.clone();
            (0..3).for_each(|_| track.extend(still.iter().copied()));
            track.extend(moving[..10].iter().copied());
        }
        let slices: Vec<&[Option<Point3<f64>>]> = tracks.iter().map(Vec::as_slice).collect();
        assert_eq!(rigid_groups(&slices, None).len(), 1);
        let begins = [0, 20, 40, 60, 80];
        assert_eq!(rigid_groups_of_files(&slices, None, &begins).len(), 2);
        // A file in which a marker slipped by a centimeter splits nothing.
        let mut slipped = hinge(0, 1e-4);
        slipped[2]
            .iter_mut()
            .skip(10)
            .flatten()
            .for_each(|p| p.x += 0.01);
        let slices: Vec<&[Option<Point3<f64>>]> = slipped.iter().map(Vec::as_slice).collect();
        let apart = rigid_groups(&slices, None).len();
        assert_eq!(rigid_groups_of_files(&slices, None, &[0]).len(), apart);
    }

    #[test]
    fn noise_of_millimeters_splits_no_body() {
        let layout = [
            [0.0, 0.0, 0.0],
            [0.06, 0.0, 0.0],
            [0.0, 0.05, 0.0],
            [0.04, 0.05, 0.03],
        ];
        // SplitMix64, and twelve uniform numbers for a normal one.
        let mut state = 0_u64;
        let mut normal = || -> f64 {
            let uniform = |_| {
                state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
                let mut z = state;
                z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
            };
            (0..12).map(uniform).sum::<f64>() - 6.0
        };
        let mut split = 0;
        for trial in 0..200 {
            let rows = [8, 16, 63][trial % 3];
            let sigma = [1e-3, 2.5e-3, 5e-3][trial % 3];
            let tracks: Vec<Vec<_>> = layout
                .iter()
                .map(|p| {
                    let seen = |row: usize| {
                        let turn =
                            Rotation3::from_axis_angle(&Vector3::z_axis(), 0.05 * row as f64);
                        let noise = Vector3::new(normal(), normal(), normal()) * sigma;
                        Some(turn * Point3::from(*p) + noise)
                    };
                    (0..rows).map(seen).collect()
                })
                .collect();
            split += usize::from(groups(&tracks).len() > 1);
            let slices: Vec<&[_]> = tracks.iter().map(Vec::as_slice).collect();
            split += usize::from(rigid_groups(&slices, Some(sigma)).len() > 1);
        }
        assert!(split <= 2, "{split} of 400");
    }

    #[test]
    fn a_few_bad_rows_and_gaps_split_nothing() {
        let mut tracks = hinge(0, 1e-4);
        for row in [3, 9, 14] {
            tracks[2][row] = Some(Point3::new(5.0, 5.0, 5.0));
            tracks[4][row] = None;
        }
        assert_eq!(groups(&tracks).len(), 1);
        // Never seen with the others: nothing says that it belongs elsewhere.
        tracks[5].fill(None);
        assert_eq!(groups(&tracks).len(), 1);
        assert!(groups(&[]).is_empty());
    }
}
