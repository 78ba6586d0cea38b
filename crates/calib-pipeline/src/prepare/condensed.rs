//! A body of very many markers as a few points that say as much of its pose.
//!
//! ```text
//! c, e_a, s_a: center, principal axes, rms extent along them of the markers x_m on the body     x̃_m = (1, e_a·(x_m − c)/s_a)
//! v_i = c + Σ_a h_ia s_a e_a,    h_i: the corners of a simplex,  h̃_i = (1, h_i),  h̃_i·h̃_j = (d + 1) δ_ij          (1)
//! G = Σ_m x̃_m x̃_mᵀ,   w_im = h̃_iᵀ G⁻¹ x̃_m:        Σ_m w_im x_m = v_i,   Cov(v_i, v_j) = σ² h̃_iᵀ G⁻¹ h̃_j          (2)
//! ```
//!
//! Sums run over the markers that a row shows. Where that is all of them, G = M·1: the points have independent errors of σ²(d + 1)/M, and the same
//! information about the body's six coordinates as the M markers. In a row that shows S of them the errors of the v_i are correlated, and those of
//! other points of the body are not:
//!
//! ```text
//! G/S = B Bᵀ,   a_ji = h̃_jᵀ Bᵀ h̃_i / (d + 1):   u_j = Σ_i a_ji v_i,   Cov(u_i, u_j) = σ² δ_ij (d + 1)/S                   (3)
//! ```
//!
//! The fit then costs what a body of d + 1 markers costs, where 3M rows of a pose and 3M unknown coordinates would cost their cube. What is given up: no
//! single marker has a residual or a level of noise of its own after the checks of the recordings, and the shape of a learned body is not
//! estimated once more with the robot.

use calib_checks::rigid_body::{Distances, Template, body_poses};
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::{Body, BodyKind, Usage};
use nalgebra::{DMatrix, DVector, Matrix3, Point3, Vector3};

use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::mixed::Mixed;
use crate::prepare::tracks::{gather, slices};

/// Bodies of more markers are condensed: up to here a run takes seconds, and trackers' own bodies have fewer.
const MOST: usize = 24;
/// An extent below this part of the largest one is none: the markers lie in a plane.
const FLAT: f64 = 1e-3;
/// A row is lost where a point would be less certain than this in variances of a marker: few markers are seen, or those near a plane.
const LARGEST_VARIANCE: f64 = 4.0;

/// The points in one row.
struct RowPoints {
    /// v and their variances in units of that of a marker.
    points: Vec<(Point3<f64>, f64)>,
    /// a of equation (3) where not all markers are seen, and the variance of the points u.
    mixed: Option<(DMatrix<f64>, f64)>,
}

/// The points v_i of equation (1), and what finds them in a row.
struct Condensed {
    /// x̃ of the markers.
    places: Vec<DVector<f64>>,
    /// h̃ of the points.
    corners: Vec<DVector<f64>>,
    points: Vec<Point3<f64>>,
}

impl Condensed {
    /// `None` where the markers are on a line.
    fn of(markers: &[Point3<f64>]) -> Option<Self> {
        let n = markers.len() as f64;
        let center = markers.iter().map(|p| p.coords).sum::<Vector3<f64>>() / n;
        let arms: Vec<Vector3<f64>> = markers.iter().map(|p| p.coords - center).collect();
        let moments: Matrix3<f64> =
            arms.iter().map(|x| x * x.transpose()).sum::<Matrix3<f64>>() / n;
        let moments = DMatrix::from_column_slice(3, 3, moments.as_slice());
        let eigen = calib_geometry::decompose::symmetric_eigen(&moments);
        let extents = eigen.values.iter().map(|v| v.max(0.0).sqrt());
        let largest = extents.clone().fold(0.0, f64::max);
        let axes: Vec<(Vector3<f64>, f64)> = extents
            .enumerate()
            .filter(|(_, s)| *s > FLAT * largest)
            .map(|(a, s)| (eigen.vectors.fixed_view::<3, 1>(0, a).into_owned(), s))
            .collect();
        let simplex: &[&[f64]] = match axes.len() {
            3 => &[
                &[1.0, 1.0, 1.0],
                &[1.0, -1.0, -1.0],
                &[-1.0, 1.0, -1.0],
                &[-1.0, -1.0, 1.0],
            ],
            // (√2, 0) and (−√½, ±√1.5)
            2 => &[
                &[std::f64::consts::SQRT_2, 0.0],
                &[-std::f64::consts::FRAC_1_SQRT_2, 1.224_744_871_391_589],
                &[-std::f64::consts::FRAC_1_SQRT_2, -1.224_744_871_391_589],
            ],
            _ => return None,
        };
        let with_one =
            |of: Vec<f64>| DVector::from_iterator(of.len() + 1, std::iter::once(1.0).chain(of));
        let along = |x: &Vector3<f64>| axes.iter().map(|(e, s)| e.dot(x) / s).collect();
        let at = |h: &&[f64]| -> Point3<f64> {
            let out = axes
                .iter()
                .zip(*h)
                .map(|((e, s), h)| e * (s * h))
                .sum::<Vector3<f64>>();
            Point3::from(center + out)
        };
        Some(Self {
            places: arms.iter().map(|x| with_one(along(x))).collect(),
            corners: simplex.iter().map(|h| with_one(h.to_vec())).collect(),
            points: simplex.iter().map(at).collect(),
        })
    }

    /// Equations (2) and (3) in one row; `None` where too few markers are seen.
    fn row(&self, seen: &[(usize, Point3<f64>)]) -> Option<RowPoints> {
        let width = self.corners[0].len();
        if seen.len() < width {
            return None;
        }
        let mut gram = DMatrix::zeros(width, width);
        let mut sums = DMatrix::zeros(width, 3);
        for (m, point) in seen {
            let place = &self.places[*m];
            gram.ger(1.0, place, place, 1.0);
            sums.ger(1.0, place, &point.coords, 1.0);
        }
        let factor = gram.cholesky()?;
        let solved = factor.solve(&sums);
        let at = |h: &DVector<f64>| {
            let point = solved.tr_mul(h);
            let variance = h.dot(&factor.solve(h));
            (Point3::new(point[0], point[1], point[2]), variance)
        };
        let points: Vec<(Point3<f64>, f64)> = self.corners.iter().map(at).collect();
        // Neither infinite nor undefined.
        if !points.iter().all(|(_, v)| *v <= LARGEST_VARIANCE) {
            return None;
        }
        let mixed = (seen.len() < self.places.len()).then(|| {
            let b = factor.l() / (seen.len() as f64).sqrt();
            let weight = |j: usize, i: usize| {
                self.corners[j].dot(&b.tr_mul(&self.corners[i])) / width as f64
            };
            let weights = DMatrix::from_fn(width, width, weight);
            (weights, width as f64 / seen.len() as f64)
        });
        Some(RowPoints { points, mixed })
    }
}

/// Gives every body of more than [`MOST`] markers its points in their place, and says so.
pub fn condense(inputs: &mut Inputs) -> Vec<Finding> {
    let bodies = inputs.robot.profile.bodies.clone();
    let mut findings = Vec::new();
    for (name, body) in &bodies {
        if let BodyKind::Markers { names, template } = &body.kind
            && names.len() > MOST
        {
            let markers = (names.as_slice(), template.as_deref());
            // What is no body is said where the tracks are made.
            findings.extend(condense_body(inputs, (name, body), markers));
        }
    }
    findings
}

fn condense_body(
    inputs: &mut Inputs,
    (name, body): (&str, &Body),
    (names, template): (&[String], Option<&[Point3<f64>]>),
) -> Option<Finding> {
    let shown = |r: &&Loaded| names.iter().any(|m| r.poses.markers.contains_key(m));
    let fitted = inputs.recordings.values();
    let fitted: Vec<&Loaded> = fitted
        .filter(|r| r.spec.usage != Usage::Validation)
        .filter(shown)
        .collect();
    let gathered = gather(names, &fitted);
    let distances = Distances::of(
        &slices(&gathered),
        inputs.robot.profile.tracker.marker_coordinate(),
    );
    let given = template.map(|points| Template::given(names.to_vec(), points.to_vec()));
    let given = given.transpose().ok()?;
    let good = distances.without_gross(&slices(&gathered));
    let all = body_poses(names, &slices(&good), given, None).ok()?;
    let condensed = Condensed::of(&all.template.points)?;
    let count = condensed.points.len();
    let own: Vec<String> = (1..=count)
        .map(|i| format!("{name} {i} of {count}"))
        .collect();
    let mut lost = 0;
    for loaded in inputs.recordings.values_mut() {
        lost += condense_recording(loaded, (name, names), &own, &condensed, &distances);
    }
    inputs.condensed.insert(name.to_owned(), all.sigma);
    if let Some(changed) = inputs.robot.profile.bodies.get_mut(name) {
        changed.kind = BodyKind::Markers {
            names: own,
            template: Some(condensed.points),
        };
        // Independent errors of the template's coordinates, as those of a row.
        let share = (count as f64 / names.len() as f64).sqrt();
        changed.template_sigma = body.template_sigma.map(|sigma| sigma * share);
    }
    let kind = if lost > 0 { "some_lost" } else { "all_rows" };
    let finding = Finding::of_kind(catalog::BODY_CONDENSED, kind, Subject::body(name))
        .with("markers", Fact::count(names.len()))
        .with("points", Fact::count(count));
    Some(match lost {
        0 => finding,
        _ => finding.with("rows", Fact::count(lost)),
    })
}

/// The points in one recording, and the shapes of their covariances; how many rows that show markers say too little.
fn condense_recording(
    loaded: &mut Loaded,
    (body, names): (&str, &[String]),
    own: &[String],
    condensed: &Condensed,
    distances: &Distances,
) -> usize {
    if !names.iter().any(|m| loaded.poses.markers.contains_key(m)) {
        return 0;
    }
    let tracks = distances.without_gross(&slices(&gather(names, &[&*loaded])));
    let mut points = vec![Vec::with_capacity(loaded.poses.len()); own.len()];
    let mut shapes = points.iter().map(|_| Vec::new()).collect::<Vec<Vec<_>>>();
    let mut mixed = Vec::with_capacity(loaded.poses.len());
    let mut lost = 0;
    for row in 0..loaded.poses.len() {
        let seen: Vec<(usize, Point3<f64>)> = tracks
            .iter()
            .enumerate()
            .filter_map(|(m, track)| Some((m, track[row]?)))
            .collect();
        // Where holds have a scatter, the mean of the markers' own.
        let stated = |m: &usize| loaded.shapes.get(&names[*m])?.get(row).copied().flatten();
        let stated: Vec<Matrix3<f64>> = seen.iter().filter_map(|(m, _)| stated(m)).collect();
        let usual = match stated.len() {
            0 => Matrix3::identity(),
            n => stated.iter().sum::<Matrix3<f64>>() / n as f64,
        };
        let of_row = condensed.row(&seen);
        if of_row.is_none() && !seen.is_empty() {
            lost += 1;
        }
        for i in 0..own.len() {
            let of_point = of_row.as_ref().map(|row| row.points[i]);
            points[i].push(of_point.map(|(point, _)| point));
            shapes[i].push(of_point.map(|(_, variance)| usual * variance));
        }
        mixed.push(of_row.and_then(|row| {
            let (weights, variance) = row.mixed?;
            let shape = usual * variance;
            Some(Mixed { weights, shape })
        }));
    }
    for name in names {
        loaded.poses.markers.remove(name);
        loaded.shapes.remove(name);
    }
    for ((name, points), shapes) in own.iter().zip(points).zip(shapes) {
        loaded.poses.markers.insert(name.clone(), points);
        loaded.shapes.insert(name.clone(), shapes);
    }
    loaded.mixed.insert(body.to_owned(), mixed);
    lost
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Matrix6};

    fn body(n: usize, thick: f64) -> Vec<Point3<f64>> {
        let at = |k: usize| {
            let k = k as f64;
            Point3::new(
                0.1 * (1.7 * k).sin(),
                0.2 + 0.05 * (2.9 * k).cos(),
                thick * (0.7 * k + 1.0).sin(),
            )
        };
        (0..n).map(at).collect()
    }

    /// Σ Jᵀ J / variance with J = [−[x]ₓ, 1]: what points say of their body's twist.
    fn information(points: impl Iterator<Item = (Point3<f64>, f64)>) -> Matrix6<f64> {
        let of = |(point, variance): (Point3<f64>, f64)| {
            let mut j = nalgebra::Matrix3x6::zeros();
            j.fixed_view_mut::<3, 3>(0, 0)
                .copy_from(&-point.coords.cross_matrix());
            j.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
            j.transpose() * j / variance
        };
        points.map(of).sum()
    }

    #[test]
    fn the_points_are_on_the_body_and_say_as_much_as_all_markers() {
        let pose = Isometry3::new(Vector3::new(0.4, -1.0, 2.0), Vector3::new(0.3, -0.8, 1.1));
        for (thick, count) in [(0.03, 4), (0.0, 3)] {
            let markers = body(60, thick);
            let condensed = Condensed::of(&markers).expect("a body");
            assert_eq!(condensed.points.len(), count);
            let all: Vec<_> = markers.iter().map(|p| pose * p).enumerate().collect();
            // All markers, and without every fifth.
            for step in [usize::MAX, 5] {
                let seen: Vec<_> = all
                    .iter()
                    .copied()
                    .filter(|(m, _)| (m + 1) % step != 0)
                    .collect();
                let row = condensed.row(&seen).expect("seen");
                for ((found, _), point) in row.points.iter().zip(&condensed.points) {
                    assert!((found - pose * point).norm() < 1e-12);
                }
            }
            let row = condensed.row(&all).expect("seen");
            let points = condensed
                .points
                .iter()
                .zip(&row.points)
                .map(|(p, (_, variance))| (*p, *variance));
            let (own, of_all) = (
                information(points),
                information(markers.iter().map(|p| (*p, 1.0))),
            );
            assert!(
                (own - of_all).norm() < 1e-9 * of_all.norm(),
                "{own} {of_all}"
            );
            assert!(row.mixed.is_none());
            assert!(condensed.row(&all[..3]).is_none());
        }
        let line: Vec<_> = (0..30)
            .map(|k| Point3::new(f64::from(k), 0.0, 0.0))
            .collect();
        assert!(Condensed::of(&line).is_none());
    }

    /// Where half of the markers are hidden, other points of the body have independent errors and say as much as those that are seen.
    #[test]
    fn in_a_row_with_hidden_markers_other_points_are_independent() {
        let markers = body(60, 0.04);
        let condensed = Condensed::of(&markers).expect("a body");
        let middle = condensed
            .points
            .iter()
            .map(|p| p.coords)
            .sum::<Vector3<f64>>()
            / 4.0;
        for direction in [Vector3::x(), -Vector3::y(), Vector3::new(1.0, 1.0, -2.0)] {
            let seen: Vec<_> = markers
                .iter()
                .copied()
                .enumerate()
                .filter(|(_, p)| (p.coords - middle).dot(&direction) > 0.0)
                .collect();
            let row = condensed.row(&seen).expect("seen");
            let (weights, variance) = row.mixed.expect("some are hidden");
            // Σ of equation (2)
            let mut gram = DMatrix::zeros(4, 4);
            for (m, _) in &seen {
                gram.ger(1.0, &condensed.places[*m], &condensed.places[*m], 1.0);
            }
            let corners = DMatrix::from_columns(&condensed.corners);
            let inverse = gram.try_inverse().expect("four markers or more");
            let sigma = corners.transpose() * inverse * &corners;
            let independent = &weights * sigma * weights.transpose();
            assert!((independent / variance - DMatrix::identity(4, 4)).amax() < 1e-10);
            let shape = Matrix3::identity() * variance;
            let mixed = Mixed { weights, shape };
            let places = mixed.of(&condensed.points);
            let own = information(places.iter().map(|p| (*p, variance)));
            let of_seen = information(seen.iter().map(|(_, p)| (*p, 1.0)));
            assert!((own - of_seen).norm() < 1e-9 * of_seen.norm());
            // There and back.
            let errors: Vec<Vector3<f64>> = places.iter().map(|p| p.coords).collect();
            let back = mixed.back(&errors).expect("four points");
            for (back, point) in back.iter().zip(&condensed.points) {
                assert!((back - point.coords).norm() < 1e-9);
            }
        }
        // Markers of one face tell nothing of what is off it.
        let face: Vec<_> = (0..20)
            .map(|m| (m, Point3::new(m as f64, (m * m) as f64, 0.0)))
            .collect();
        let thin = Condensed::of(&{
            let off = |k: usize| Point3::new(k as f64, (7 * k % 11) as f64, 3.0);
            face.iter()
                .map(|(_, p)| *p)
                .chain((0..20).map(off))
                .collect::<Vec<_>>()
        });
        assert!(thin.expect("a body").row(&face).is_none());
    }
}
