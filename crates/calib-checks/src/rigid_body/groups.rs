//! Which markers keep their distances: the bodies that a table holds, found without being told.
//!
//! ```text
//! s_jk = q₈₀(|d_jk − median d_jk|) / 1.28        spread of the distance of two markers over the rows that show both
//! S_AB = max s_jk over j ∈ A, k ∈ B              groups are joined in the order of S (complete linkage)              (1)
//! stop where S > 5 · max(S of the last join, 0.002 · the largest distance)
//! ```
//!
//! A joint changes distances by centimeters, noise and skin by parts of a millimeter to some, and bodies need not be equally stiff: what tells a
//! joint is the leap. The 80 % quantile bears one bad row in five and still sees a joint that moves in one row of four.

use nalgebra::Point3;

/// The leap of (1).
const LEAP: f64 = 5.0;
/// Spread up to which markers are on one body whatever the leap, as a part of the largest distance.
const STIFF: f64 = 2e-3;
/// Rows that two markers must share to be distinguished.
const MIN_ROWS: usize = 4;

/// The markers in groups that each keep their distances (1), by the first marker of each.
///
/// Two markers that are never seen together are not distinguished by their own distance.
#[must_use]
pub fn rigid_groups(tracks: &[&[Option<Point3<f64>>]]) -> Vec<Vec<usize>> {
    let n = tracks.len();
    let mut spread = vec![vec![0.0; n]; n];
    let mut extent = 0.0_f64;
    for j in 0..n {
        for k in 0..j {
            if let Some((median, wide)) = distance(tracks[j], tracks[k]) {
                spread[j][k] = wide;
                spread[k][j] = wide;
                extent = extent.max(median);
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
    while let Some((nearest, a, b)) = (0..groups.len())
        .flat_map(|b| (0..b).map(move |a| (a, b)))
        .map(|(a, b)| (apart(&groups[a], &groups[b]), a, b))
        .min_by(|x, y| x.0.total_cmp(&y.0))
    {
        if nearest > LEAP * last {
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
    let median = quantile(&mut lengths, 0.5);
    for length in &mut lengths {
        *length = (*length - median).abs();
    }
    Some((median, quantile(&mut lengths, 0.8) / 1.28))
}

/// 0 for no values.
fn quantile(values: &mut [f64], part: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = ((values.len() - 1) as f64 * part).round() as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::rigid_groups;
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
        rigid_groups(&tracks)
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
