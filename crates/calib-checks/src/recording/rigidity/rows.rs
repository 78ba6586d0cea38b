//! Rows in which a body is not what it is in the others: exchanged labels, outliers, bending.

use calib_finding::{Fact, Finding, catalog};
use calib_recording::Poses;
use nalgebra::Point3;

use super::{ALL_PERMUTATIONS, ALWAYS_THE_SAME, BENDING, Body, OWN_SIGMAS, Pair, ROWS, distances};
use crate::statistics::{median, range};

/// Markers seen in a row of which one can be shown to be out of place: the distance of the two others is right, and no other one.
const FEWEST: usize = 3;

/// A row with one marker out of place.
struct Outlier {
    /// As the recording numbers it.
    row: u64,
    /// Index of the marker.
    marker: usize,
    /// By how much, m.
    off: f64,
    /// The distance that is farthest off, in its own σ.
    sigmas: f64,
}

impl<'a> Body<'a> {
    /// Rows in which markers are exchanged, or one is out of place.
    pub(super) fn bad_rows(&self, poses: &Poses) -> Vec<Finding> {
        let mut swapped: Vec<(u64, Vec<&str>)> = Vec::new();
        let mut outliers: Vec<Outlier> = Vec::new();
        // Markers each of which alone explains a bad row.
        let mut alone: Vec<Vec<usize>> = Vec::new();
        // Rows that an exchange explains, and one marker out of place as well: always so with three markers, two of them exchanged.
        let mut either: Vec<(usize, Vec<&str>)> = Vec::new();
        for row in 0..poses.len() {
            let points: Vec<Option<Point3<f64>>> =
                self.tracks.iter().map(|track| track[row]).collect();
            let worst = self.deviation(&points);
            if worst <= self.tolerance {
                continue;
            }
            match self.exchange(&points) {
                Some(exchanged) if !self.explained_by_one(&points).is_empty() => {
                    either.push((row, exchanged));
                }
                Some(exchanged) => swapped.push((poses.rows[row], exchanged)),
                None => outliers.push(self.outlier(poses, row, &mut alone)),
            }
        }
        let (same, others) = again_and_again(either, outliers.len());
        swapped.extend(
            same.into_iter()
                .map(|(row, which)| (poses.rows[row], which)),
        );
        swapped.sort_unstable();
        outliers.extend(
            others
                .into_iter()
                .map(|row| self.outlier(poses, row, &mut alone)),
        );
        outliers.sort_by_key(|outlier| outlier.row);
        let mut findings = Vec::new();
        if let Some((_, which)) = swapped.first() {
            findings.push(
                self.finding(catalog::MARKER_SWAP)
                    .with("markers", Fact::names(which.iter().copied()))
                    .with("rows", Fact::count(swapped.len()))
                    .at_rows(swapped.iter().map(|(row, _)| *row)),
            );
        }
        if self.bends(&alone, poses.len()) {
            findings.extend(self.bending(&outliers, &alone));
            return findings;
        }
        outliers.retain(|outlier| outlier.sigmas > OWN_SIGMAS);
        if let Some(worst) = outliers.iter().max_by(|a, b| a.off.total_cmp(&b.off)) {
            findings.push(
                self.finding(catalog::MARKER_OUTLIER)
                    .with("marker", Fact::name(self.markers[worst.marker]))
                    .with("off", Fact::meters(worst.off))
                    .with("rows", Fact::count(outliers.len()))
                    .at_rows(outliers.iter().map(|outlier| outlier.row)),
            );
        }
        findings
    }

    /// Markers in whose place a reflection was seen, with their rows.
    pub(super) fn reflections(&self, rows: usize) -> Vec<(String, usize)> {
        let of_row = |row: usize| {
            let points: Vec<Option<Point3<f64>>> =
                self.tracks.iter().map(|track| track[row]).collect();
            let marker = self.reflection(&points, &self.explained_by_one(&points))?;
            Some((self.markers[marker].to_owned(), row))
        };
        (0..rows).filter_map(of_row).collect()
    }

    /// The marker that is farther off than the body is long, where it `alone` explains a row: no marker moves so far on its body.
    fn reflection(&self, points: &[Option<Point3<f64>>], alone: &[usize]) -> Option<usize> {
        let [marker] = *alone else { return None };
        let longest = self.pairs.iter().map(|pair| pair.distance);
        let longest = longest.fold(self.tolerance, f64::max);
        let seen = points.iter().flatten().count();
        (seen >= FEWEST && self.off(points, marker) > longest).then_some(marker)
    }

    /// A row with its marker out of place, by how much, and in `alone` the markers each of which explains it alone.
    fn outlier(&self, poses: &Poses, row: usize, alone: &mut Vec<Vec<usize>>) -> Outlier {
        let points: Vec<Option<Point3<f64>>> = self.tracks.iter().map(|track| track[row]).collect();
        let explained = self.explained_by_one(&points);
        // A body of which a reflection was taken for a marker neither bends nor has a loose marker.
        if self.reflection(&points, &explained).is_none() {
            alone.push(explained);
        }
        let (marker, off) = self.out_of_place(&points);
        Outlier {
            row: poses.rows[row],
            marker,
            off,
            sigmas: self.sigmas(&points),
        }
    }

    /// The markers without which the distances of a row are right.
    fn explained_by_one(&self, points: &[Option<Point3<f64>>]) -> Vec<usize> {
        let without = |k: &usize| {
            let mut rest = points.to_vec();
            rest[*k] = None;
            self.deviation(&rest) <= self.tolerance
        };
        (0..points.len()).filter(without).collect()
    }

    /// Bad rows that are too many for rare mistakes, and that no marker explains, or always the same one.
    fn bends(&self, alone: &[Vec<usize>], rows: usize) -> bool {
        let many = |count: usize| count >= ROWS && count as f64 > BENDING * rows as f64;
        let unexplained = alone.iter().filter(|markers| markers.is_empty()).count();
        // Two outliers meet in a row far less often than one stands alone.
        let bent = many(unexplained) && 2 * unexplained > alone.len();
        bent || (!self.always(alone).is_empty() && many(alone.len()))
    }

    /// The markers each of which alone explains almost all bad rows.
    fn always(&self, alone: &[Vec<usize>]) -> Vec<usize> {
        let of_marker = |k: usize| alone.iter().filter(|markers| markers.contains(&k)).count();
        let always = |k: &usize| of_marker(*k) as f64 > ALWAYS_THE_SAME * alone.len() as f64;
        (0..self.markers.len()).filter(always).collect()
    }

    /// Many rows, none of them a rare mistake: one marker moves, or the body bends.
    fn bending(&self, outliers: &[Outlier], alone: &[Vec<usize>]) -> Option<Finding> {
        let rows = outliers.iter().map(|outlier| outlier.row);
        let finding = match self.always(alone)[..] {
            // In a body of three, leaving out another marker must not explain the rows as well.
            [marker] => self
                .finding_of(catalog::NOT_RIGID, "one_marker")
                .with("marker", Fact::name(self.markers[marker]))
                .with("range", Fact::meters(self.range_of(marker))),
            _ => {
                let widest = self.pairs.iter().map(|pair| (pair, self.range(pair)));
                let (pair, range) = widest.max_by(|a, b| a.1.total_cmp(&b.1))?;
                self.finding_of(catalog::NOT_RIGID, "bends")
                    .with("first", Fact::name(self.markers[pair.j]))
                    .with("second", Fact::name(self.markers[pair.i]))
                    .with("range", Fact::meters(range))
            }
        };
        Some(
            finding
                .with("rows", Fact::count(outliers.len()))
                .at_rows(rows),
        )
    }

    /// How far a distance varies, m.
    fn range(&self, pair: &Pair) -> f64 {
        let all = distances(self.tracks[pair.i], self.tracks[pair.j]);
        range(all.map(|(_, distance)| distance)).map_or(0.0, |(low, high)| high - low)
    }

    /// How far a distance of a marker varies at most, m.
    fn range_of(&self, marker: usize) -> f64 {
        let own = self.pairs.iter();
        let own = own.filter(|pair| pair.i == marker || pair.j == marker);
        own.map(|pair| self.range(pair)).fold(0.0, f64::max)
    }

    /// Largest departure of a distance from its median.
    fn deviation(&self, points: &[Option<Point3<f64>>]) -> f64 {
        let departures = self.pairs.iter().filter_map(|pair| {
            Some(((points[pair.i]? - points[pair.j]?).norm() - pair.distance).abs())
        });
        departures.fold(0.0, f64::max)
    }

    /// The same in σ of each distance.
    fn sigmas(&self, points: &[Option<Point3<f64>>]) -> f64 {
        let departures = self.pairs.iter().filter_map(|pair| {
            let departure = ((points[pair.i]? - points[pair.j]?).norm() - pair.distance).abs();
            Some(departure / pair.sigma)
        });
        departures.fold(0.0, f64::max)
    }

    /// The permutation of the markers seen that brings all distances back: the markers that it moves.
    fn exchange(&self, points: &[Option<Point3<f64>>]) -> Option<Vec<&'a str>> {
        let n = points.len();
        let mut best: Option<(f64, Vec<usize>)> = None;
        let mut consider = |order: &[usize]| {
            let moved: Vec<Option<Point3<f64>>> = order.iter().map(|&k| points[k]).collect();
            let deviation = self.deviation(&moved);
            if deviation < self.tolerance
                && best.as_ref().is_none_or(|(least, _)| deviation < *least)
            {
                best = Some((deviation, order.to_vec()));
            }
        };
        if n <= ALL_PERMUTATIONS {
            permutations(n, &mut consider);
        } else {
            for i in 0..n {
                for j in 0..i {
                    let mut order: Vec<usize> = (0..n).collect();
                    order.swap(i, j);
                    consider(&order);
                }
            }
        }
        // At least four markers, or a triangle, must be seen for a permutation to mean anything.
        let seen = points.iter().flatten().count();
        let (_, order) = best.filter(|_| seen >= 3)?;
        let moved = (0..n).filter(|&k| order[k] != k);
        Some(moved.map(|k| self.markers[k]).collect())
    }

    /// By how much the distances of a marker are off, m.
    fn off(&self, points: &[Option<Point3<f64>>], marker: usize) -> f64 {
        let own = self.pairs.iter();
        let own = own.filter(|pair| pair.i == marker || pair.j == marker);
        let departures = own.filter_map(|pair| {
            Some(((points[pair.i]? - points[pair.j]?).norm() - pair.distance).abs())
        });
        median(departures.collect()).unwrap_or(0.0)
    }

    /// The marker whose distances are most off, and by how much.
    fn out_of_place(&self, points: &[Option<Point3<f64>>]) -> (usize, f64) {
        let worst = (0..self.markers.len())
            .map(|k| (k, self.off(points, k)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        worst.unwrap_or((0, 0.0))
    }
}

/// Rows of an exchange that chance would bring, by an outlier that happens to fit it, less than this many times.
const AGAIN: usize = 3;

/// Of rows that an exchange or an outlier explains: those of one exchange that explains most bad rows, and the others.
fn again_and_again(
    either: Vec<(usize, Vec<&str>)>,
    outliers: usize,
) -> (Vec<(usize, Vec<&str>)>, Vec<usize>) {
    let bad = either.len() + outliers;
    let times = |which: &Vec<&str>| either.iter().filter(|(_, w)| w == which).count();
    let most = either
        .iter()
        .map(|(_, which)| times(which))
        .max()
        .unwrap_or(0);
    let real = |which: &Vec<&str>| {
        let times = times(which);
        times == most && times >= AGAIN && 2 * times > bad
    };
    let is_real: Vec<bool> = either.iter().map(|(_, which)| real(which)).collect();
    let (same, others): (Vec<_>, Vec<_>) =
        either.into_iter().zip(is_real).partition(|(_, real)| *real);
    let same = same.into_iter().map(|(row, _)| row).collect();
    (same, others.into_iter().map(|((row, _), _)| row).collect())
}

/// Calls `visit` with every order of `0..n`.
fn permutations(n: usize, visit: &mut dyn FnMut(&[usize])) {
    fn place(k: usize, order: &mut Vec<usize>, visit: &mut dyn FnMut(&[usize])) {
        if k == order.len() {
            visit(order);
            return;
        }
        for i in k..order.len() {
            order.swap(k, i);
            place(k + 1, order, visit);
            order.swap(k, i);
        }
    }
    place(0, &mut (0..n).collect(), visit);
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::recording::Expectations;
    use crate::recording::rigidity::rigidity;

    const ROWS: usize = 60;

    /// Markers of a body in random poses; `place` gives each marker's place on it in a row, noise `sigma`, m.
    fn body(
        count: usize,
        place: impl Fn(usize, usize) -> Vector3<f64>,
        sigma: f64,
        rng: &mut ChaCha8Rng,
    ) -> Poses {
        let mut poses = Poses {
            rows: (1..=ROWS as u64).collect(),
            ..Poses::default()
        };
        let normal =
            |rng: &mut ChaCha8Rng| Vector3::from_fn(|_, _| -> f64 { StandardNormal.sample(rng) });
        for row in 0..ROWS {
            let pose = Isometry3::from_parts(
                Translation3::from(normal(rng)),
                UnitQuaternion::from_scaled_axis(normal(rng)),
            );
            for k in 0..count {
                let seen = pose * Point3::from(place(k, row)) + sigma * normal(rng);
                let track = poses.markers.entry(format!("m{k}")).or_default();
                track.push(Some(seen));
            }
        }
        poses
    }

    /// A triangle with its third corner above `x`, m, noise 0.3 mm.
    fn triangle(x: f64, rng: &mut ChaCha8Rng) -> Poses {
        let shape = [
            Vector3::new(0.0, 0.0, 0.0),
            Vector3::new(0.06, 0.0, 0.0),
            Vector3::new(x, 0.05, 0.0),
        ];
        body(3, |k, _| shape[k], 3e-4, rng)
    }

    fn found(poses: &Poses) -> Vec<Finding> {
        let expected = Expectations {
            bodies: [("hand".to_owned(), poses.markers.keys().cloned().collect())].into(),
            ..Expectations::default()
        };
        rigidity(poses, &expected)
    }

    #[test]
    fn an_outlier_that_happens_to_fit_an_exchange_is_no_exchange() {
        for seed in 0..60 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut poses = triangle(0.027, &mut rng);
            for track in poses.markers.values_mut() {
                for p in track.iter_mut().flatten() {
                    if rng.random::<f64>() < 0.05 {
                        let off = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
                        *p += off.normalize() * rng.random_range(0.002..0.06);
                    }
                }
            }
            let swaps = found(&poses).iter().any(|f| f.id == catalog::MARKER_SWAP);
            assert!(!swaps, "seed {seed}");
        }
    }

    /// A third of the rows has a reflection in the place of one of three, four or five markers: these and no others are found, also where the same
    /// marker is always the one; a marker that slips by less than its body is long is none.
    #[test]
    fn reflections_are_found_with_their_rows() {
        for count in 3..=5 {
            for seed in 0..20 {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let always = seed % 2 == 0;
                let slips = |k: usize, row: usize| match k == 1 && row % 10 == 1 {
                    true => Vector3::from(PLACES[k]) + Vector3::new(0.0, 0.0, 0.02),
                    false => Vector3::from(PLACES[k]),
                };
                let mut poses = body(count, slips, 1e-4, &mut rng);
                let mut expected = Vec::new();
                for row in (0..ROWS).step_by(3).filter(|row| row % 10 != 1) {
                    let marker = format!("m{}", if always { 0 } else { row % count });
                    let seen = poses.markers.get_mut(&marker).expect("there")[row].as_mut();
                    seen.expect("seen").z += rng.random_range(0.5..2.0);
                    expected.push((marker, row));
                }
                let known = Expectations {
                    bodies: [("hand".to_owned(), poses.markers.keys().cloned().collect())].into(),
                    ..Expectations::default()
                };
                let reflections = super::super::out_of_place(&poses, &known);
                assert_eq!(reflections, expected, "{count} {seed}");
            }
        }
    }

    #[test]
    fn labels_of_a_triangle_that_are_exchanged_again_and_again_are_named() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut poses = triangle(0.015, &mut rng);
            for row in 20..24 {
                let (a, b) = (poses.markers["m0"][row], poses.markers["m1"][row]);
                poses.markers.get_mut("m0").expect("there")[row] = b;
                poses.markers.get_mut("m1").expect("there")[row] = a;
            }
            let found = found(&poses);
            let swap = found.iter().find(|f| f.id == catalog::MARKER_SWAP);
            let swap = swap.unwrap_or_else(|| panic!("seed {seed}: {found:?}"));
            assert_eq!(swap.facts.get("rows"), Some(&Fact::count(4)), "seed {seed}");
        }
    }

    const PLACES: [[f64; 3]; 5] = [
        [0.0, 0.0, 0.0],
        [0.08, 0.0, 0.0],
        [0.02, 0.06, 0.0],
        [0.03, 0.02, 0.05],
        [-0.04, 0.05, 0.03],
    ];

    /// The markers that findings name, and the first of two markers where only a distance is named.
    fn named<'a>(found: &'a [Finding]) -> Vec<&'a Fact> {
        let name = |f: &'a Finding| f.facts.get("marker").or_else(|| f.facts.get("first"));
        found.iter().filter_map(name).collect()
    }

    /// A coordinate of a marker by row, m.
    type Motion<'a> = &'a dyn Fn(usize) -> f64;

    /// A marker that slips once, in every third row, or moves all the time: named, with three, four and five markers, also where the
    /// tracker stretches all lengths by 0.2 % from the slip on.
    #[test]
    fn the_marker_that_moves_on_its_body_is_named() {
        let slips = |row: usize| if row < 30 { 0.0 } else { 8e-3 };
        let jumps = |row: usize| if row.is_multiple_of(3) { 8e-3 } else { 0.0 };
        let wanders = |row: usize| 8e-3 * (1.7 * row as f64).sin();
        let motions: [(&str, Motion<'_>, f64); 4] = [
            ("slips", &slips, 1.0),
            ("slips in a tracker that warms up", &slips, 1.002),
            ("jumps", &jumps, 1.0),
            ("wanders", &wanders, 1.0),
        ];
        for count in 3..=5 {
            for (name, motion, scale) in &motions {
                for seed in 0..10 {
                    let moved = seed as usize % count;
                    let along = Vector3::new(0.8, 0.3, -0.5);
                    let place = |k: usize, row: usize| {
                        let off = if k == moved { motion(row) } else { 0.0 };
                        let stretched = if row < 30 { 1.0 } else { *scale };
                        (Vector3::from(PLACES[k]) + off * along) * stretched
                    };
                    // So little noise that the stretch is beyond it.
                    let sigma = if *scale == 1.0 { 1e-4 } else { 2e-5 };
                    let mut rng = ChaCha8Rng::seed_from_u64(seed);
                    let found = found(&body(count, place, sigma, &mut rng));
                    let right = Fact::name(format!("m{moved}"));
                    assert_eq!(named(&found), [&right], "{count} {name} {seed}: {found:?}");
                    assert!(found[0].facts.get("marker").is_some(), "{found:?}");
                }
            }
        }
    }

    /// Two markers move together. Of four none is to blame: the body bends. Against three others both are.
    #[test]
    fn a_body_that_bends_is_not_blamed_on_a_marker() {
        for count in [4, 5] {
            for seed in 0..10 {
                let place = |k: usize, row: usize| {
                    let together = Vector3::new(0.0, 3.6e-3, 4.8e-3) * (1.7 * row as f64).sin();
                    Vector3::from(PLACES[k]) + if k < 2 { together } else { Vector3::zeros() }
                };
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let found = found(&body(count, place, 1e-4, &mut rng));
                let markers: Vec<_> = found.iter().map(|f| f.facts.get("marker")).collect();
                if count == 4 {
                    assert_eq!(markers, [None], "{seed}: {found:?}");
                    continue;
                }
                let mut both = named(&found);
                both.sort_by_key(|name| format!("{name:?}"));
                let [m0, m1] = ["m0", "m1"].map(Fact::name);
                assert_eq!(both, [&m0, &m1], "{seed}: {found:?}");
            }
        }
    }
}
