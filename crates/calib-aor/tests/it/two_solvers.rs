//! The paper's cost has one minimum: the simplex and Gauss–Newton stand on it, center held or free.

use crate::common::{Hinge, Noise, Track, steps};
use calib_aor::{AorEstimate, Input, Options, Outcome, fit};
use nalgebra::{Point3, Unit, Vector3};
use rayon::prelude::*;

/// Both answers, or neither.
fn both(data: &[Track], center: Option<Point3<f64>>, what: &str) -> Option<[AorEstimate; 2]> {
    let options = Options {
        center,
        ..Options::default()
    };
    let data = data.to_vec();
    let answers = ["planar_radial", "planar_radial_gn"]
        .map(|id| fit(id, &Input::Points(&data), &options).expect(id));
    match answers {
        [Outcome::Estimate(a), Outcome::Estimate(b)] => Some([*a, *b]),
        [a, b] => {
            assert_eq!(a.verdict(), b.verdict(), "{what}");
            None
        }
    }
}

#[test]
fn the_simplex_ends_where_gauss_newton_does() {
    let all: Vec<(usize, [f64; 2])> = (0..6).into_par_iter().map(compare).collect();
    let compared: usize = all.iter().map(|(n, _)| n).sum();
    let worst = [0, 1].map(|k| all.iter().map(|(_, worst)| worst[k]).fold(0.0, f64::max));
    println!(
        "{compared} pairs, at most {:e} rad and {:e} m apart",
        worst[0], worst[1]
    );
    assert!(compared > 250, "{compared}");
}

/// Pairs of one hinge that were compared, and how far they are apart at most: rad, m.
fn compare(seed: u64) -> (usize, [f64; 2]) {
    let mut worst = [0.0_f64; 2];
    let mut compared = 0;
    let mut noise = Noise::new(seed);
    let hinge = Hinge {
        point: Point3::from(noise.vector(1.0)),
        axis: Unit::new_normalize(noise.vector(1.0)),
    };
    for (markers, n, arc, sigma) in [
        (1, 10, 180.0, 1e-3),
        (1, 19, 125.0, 5e-3),
        (1, 12, 330.0, 1e-3),
        (1, 19, 60.0, 1e-3),
        (1, 40, 20.0, 1e-4),
        (1, 8, 90.0, 0.0),
        (4, 19, 60.0, 2.5e-3),
        (4, 19, 20.0, 1e-3),
        (3, 10, 125.0, 5e-3),
    ] {
        let places = hinge.layout(markers, 0.1);
        let data = hinge.tracks(&places, &steps(-30.0, arc - 30.0, n), sigma, &mut noise);
        let aside = hinge.axis.into_inner() * 0.04 + noise.vector(5e-3);
        for (unit, far) in [(1.0, 0.0), (1000.0, 0.0), (1.0, 100.0)] {
            let moved = |p: &Point3<f64>| (p + Vector3::repeat(far)) * unit;
            let data: Vec<Track> = data
                .iter()
                .map(|t| t.iter().map(|p| p.as_ref().map(moved)).collect())
                .collect();
            let held = moved(&(hinge.point + aside));
            for center in [None, Some(held)] {
                let what = format!(
                    "seed {seed}, {markers} markers, n {n}, {arc}°, σ {sigma}, unit {unit}, far {far}, held {}",
                    center.is_some()
                );
                let Some([a, b]) = both(&data, center, &what) else {
                    continue;
                };
                compared += 1;
                let angle = a.line.direction.cross(&b.line.direction).norm();
                let beside = b.line.distance_to_point(&a.line.point) / unit;
                worst = [worst[0].max(angle), worst[1].max(beside)];
                assert!(angle < 1e-9, "{what}: {angle:e} rad");
                assert!(beside < 1e-9, "{what}: {beside:e} m beside");
            }
        }
    }
    (compared, worst)
}
