//! Rigid bodies from markers.

use calib_checks::rigid_body::{
    Distances, NotABody, Template, WithoutPose, body_from_markers, body_poses,
};
use calib_geometry::se3;
use calib_recording::Poses;
use nalgebra::{Isometry3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

type Track = Vec<Option<Point3<f64>>>;

fn names(count: usize) -> Vec<String> {
    (1..=count).map(|i| format!("m{i}")).collect()
}

fn refs(tracks: &[Track]) -> Vec<&[Option<Point3<f64>>]> {
    tracks.iter().map(Vec::as_slice).collect()
}

fn shape() -> Vec<Point3<f64>> {
    [
        [0.0, 0.0, 0.0],
        [0.1, 0.0, 0.0],
        [0.03, 0.07, 0.0],
        [0.05, 0.02, 0.06],
        [-0.04, 0.05, 0.03],
    ]
    .map(Point3::from)
    .to_vec()
}

fn a_pose(rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    let mut three = |scale: f64| Vector3::from_fn(|_, _| rng.random_range(-scale..scale));
    Isometry3::from_parts(
        Translation3::from(three(1.0)),
        UnitQuaternion::from_scaled_axis(three(1.8)),
    )
}

fn noise(rng: &mut ChaCha8Rng, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| {
        let z: f64 = StandardNormal.sample(rng);
        z * sigma
    })
}

/// Tracks of the shape over random poses, some markers occluded.
fn tracks(
    shape: &[Point3<f64>],
    rows: usize,
    sigma: f64,
    lost: f64,
    seed: u64,
) -> (Vec<Isometry3<f64>>, Vec<Track>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let poses: Vec<_> = (0..rows).map(|_| a_pose(&mut rng)).collect();
    let tracks = shape
        .iter()
        .map(|m| {
            poses
                .iter()
                .map(|pose| {
                    let p = pose * m + noise(&mut rng, sigma);
                    (rng.random::<f64>() >= lost).then_some(p)
                })
                .collect()
        })
        .collect();
    (poses, tracks)
}

#[test]
fn exact_markers_give_the_exact_body_also_when_occluded() {
    let shape = shape();
    let (poses, tracks) = tracks(&shape, 40, 0.0, 0.3, 1);
    let body = body_poses(&names(5), &refs(&tracks), None, None).expect("a body");
    for (learned, truth) in body.template.points.iter().zip(&shape) {
        // The shape is given in the convention's own frame: m1 at the origin, m2 on +x, m3 in the plane.
        assert!((learned - truth).norm() < 1e-10, "{learned} {truth}");
    }
    let mut used = 0;
    for (row, truth) in body.rows.iter().zip(&poses) {
        if let Ok(pose) = row {
            used += 1;
            assert!(
                se3::log(&(truth.inverse() * pose.tracker_from_body))
                    .0
                    .norm()
                    < 1e-9
            );
        }
    }
    assert!(used > 30, "{used} rows");
}

#[test]
fn the_frame_depends_only_on_the_order_of_the_markers() {
    let (_, tracks) = tracks(&shape(), 30, 1e-4, 0.2, 2);
    let body = |rows: &dyn Fn(usize) -> usize| {
        let shuffled: Vec<Track> = tracks
            .iter()
            .map(|t| (0..30).map(|i| t[rows(i)]).collect())
            .collect();
        Template::learn(&names(5), &refs(&shuffled)).expect("a body")
    };
    let (forward, backward) = (body(&|i| i), body(&|i| 29 - i));
    for (a, b) in forward.points.iter().zip(&backward.points) {
        assert!((a - b).norm() < 1e-9);
    }
    let p = &forward.points;
    assert!(
        p[0].coords.norm() < 1e-15 && p[1].y.abs() < 1e-12 && p[1].z.abs() < 1e-12 && p[1].x > 0.0
    );
    assert!(p[2].z.abs() < 1e-12 && p[2].y > 0.0);
}

/// Long recordings are thinned, marker by marker: one that is rarely seen keeps its rows.
#[test]
fn long_recordings_give_a_good_template_and_rarely_seen_markers_a_place() {
    let (shape, sigma) = (shape(), 3e-4);
    let (_, mut tracks) = tracks(&shape, 9001, sigma, 0.0, 21);
    for row in 0..9001 {
        if row % 3 == 0 || row % 50 != 1 {
            tracks[4][row] = None;
        }
    }
    let learned = Template::learn(&names(5), &refs(&tracks)).expect("a body");
    for (k, (a, b)) in learned.points.iter().zip(&shape).enumerate() {
        let rows: f64 = if k == 4 { 100.0 } else { 3000.0 };
        assert!((a - b).norm() < 8.0 * sigma / rows.sqrt(), "marker {k}");
    }
}

/// Five percent of the samples off by 50 mm: without them the learned places are as good as without outliers.
#[test]
fn gross_samples_neither_bend_the_template_nor_turn_a_row() {
    for (seed, rows) in [(11, 12), (12, 40), (13, 200)] {
        let (shape, sigma) = (shape(), 3e-4);
        let (_, clean) = tracks(&shape, rows, sigma, 0.0, seed);
        let mut spoiled = clean.clone();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut gross = Vec::new();
        for row in (0..rows)
            .filter(|_| rng.random::<f64>() < 0.25)
            .collect::<Vec<_>>()
        {
            let k = rng.random_range(0..5);
            let off = noise(&mut rng, 1.0).normalize() * 0.05;
            spoiled[k][row] = spoiled[k][row].map(|p| p + off);
            gross.push((k, row));
        }
        assert!(!gross.is_empty());
        let distances = Distances::of(&refs(&spoiled), Some(sigma));
        let kept = distances.without_gross(&refs(&spoiled));
        for (k, row) in &gross {
            assert_eq!(kept[*k][*row], None, "marker {k}, row {row} of {rows}");
        }
        let seen = |tracks: &[Track]| tracks.iter().flatten().flatten().count();
        assert_eq!(seen(&kept) + gross.len(), seen(&clean), "good samples went");
        let worst = |tracks: &[Track]| {
            let learned = Template::learn(&names(5), &refs(tracks)).expect("a body");
            let off = learned
                .points
                .iter()
                .zip(&shape)
                .map(|(a, b)| (a - b).norm());
            off.fold(0.0, f64::max)
        };
        let limit = 8.0 * sigma / (rows as f64).sqrt();
        assert!(worst(&kept) < limit, "{} of {limit}", worst(&kept));
        // The power of this test: the plain mean fails it.
        assert!(worst(&spoiled) > limit, "{} of {limit}", worst(&spoiled));
    }
}

/// Another shape in most rows is not a gross sample, and neither is a marker that always wanders.
#[test]
fn a_body_that_is_not_rigid_keeps_its_samples() {
    let (_, good) = tracks(&shape(), 60, 3e-4, 0.0, 14);
    let distances = Distances::of(&refs(&good), Some(3e-4));
    let mut other = good.clone();
    for p in other[2].iter_mut().skip(20).flatten() {
        p.x += 0.03;
    }
    assert_eq!(distances.without_gross(&refs(&other)), other);
    let mut rng = ChaCha8Rng::seed_from_u64(15);
    let mut loose = good.clone();
    for p in loose[1].iter_mut().flatten() {
        *p += noise(&mut rng, 5e-3);
    }
    let distances = Distances::of(&refs(&loose), Some(3e-4));
    assert_eq!(distances.without_gross(&refs(&loose)), loose);
}

#[test]
fn noise_and_covariance_are_estimated_truly() {
    let (shape, sigma) = (shape(), 2e-4);
    let (poses, tracks) = tracks(&shape, 4000, sigma, 0.15, 3);
    let body = body_poses(&names(5), &refs(&tracks), None, None).expect("a body");
    let estimated = body.sigma.expect("redundant");
    assert!((estimated / sigma - 1.0).abs() < 0.03, "{estimated}");
    // Mean of ξᵀ C⁻¹ ξ over rows is 6 when C is true.
    let (mut sum, mut count) = (0.0, 0.0);
    for (row, truth) in body.rows.iter().zip(&poses) {
        let Ok(pose) = row else { continue };
        let xi: Vector6<f64> = se3::log(&(truth.inverse() * pose.tracker_from_body)).0;
        let inverse: Matrix6<f64> = pose
            .covariance
            .expect("σ known")
            .try_inverse()
            .expect("regular");
        sum += (xi.transpose() * inverse * xi)[0];
        count += 1.0;
    }
    let mean: f64 = sum / count;
    assert!((mean - 6.0).abs() < 0.35, "mean {mean} over {count} rows");
}

#[test]
fn a_template_given_beforehand_keeps_its_frame() {
    let shifted: Vec<_> = shape()
        .iter()
        .map(|p| p + Vector3::new(0.5, -0.2, 0.1))
        .collect();
    let (poses, tracks) = tracks(&shifted, 5, 0.0, 0.0, 4);
    let template = Template::given(names(5), shifted).expect("a body");
    let body = body_poses(&names(5), &refs(&tracks), Some(template), Some(1e-4)).expect("a body");
    for (row, truth) in body.rows.iter().zip(&poses) {
        let pose = row.as_ref().expect("seen");
        assert!(
            se3::log(&(truth.inverse() * pose.tracker_from_body))
                .0
                .norm()
                < 1e-9
        );
        assert!(pose.covariance.is_some());
    }
}

#[test]
fn a_marker_that_moves_on_the_body_is_named_with_its_travel() {
    for count in [3, 4, 5] {
        let (_, mut tracks) = tracks(&shape()[..count], 60, 1e-4, 0.0, 5);
        for (row, point) in tracks[1].iter_mut().enumerate() {
            *point = point.map(|p| {
                p + Vector3::new(
                    0.004 * (row as f64 * 0.7).sin(),
                    0.003 * (row as f64 * 0.3).cos(),
                    0.0,
                )
            });
        }
        let body = body_poses(&names(count), &refs(&tracks), None, None).expect("a body");
        let (marker, wandering) = body
            .moving_marker(1e-3)
            .unwrap_or_else(|| panic!("{count} markers: {:?}", body.fits));
        assert_eq!(marker.name, "m2", "{count} markers");
        assert!((5e-4..6e-3).contains(&wandering), "{wandering}");
    }
    let (_, rigid) = tracks(&shape(), 60, 1e-4, 0.0, 5);
    assert!(
        body_poses(&names(5), &refs(&rigid), None, None)
            .expect("a body")
            .moving_marker(1e-3)
            .is_none()
    );
}

#[test]
fn what_makes_no_body_is_said_with_numbers() {
    let line: Vec<_> = [0.0, 0.1, 0.25]
        .iter()
        .map(|&x| Point3::new(x, 0.0, 0.0))
        .collect();
    let (_, on_a_line) = tracks(&line, 10, 1e-5, 0.0, 6);
    let learn = |tracks: &[Track]| {
        Template::learn(&names(tracks.len()), &refs(tracks)).expect_err("no body")
    };
    assert!(
        matches!(learn(&on_a_line), NotABody::Collinear { across_mm, along_mm } if across_mm < 0.1 && along_mm > 50.0)
    );

    let mut doubled = shape();
    doubled[4] = doubled[1];
    let (_, coincident) = tracks(&doubled, 10, 0.0, 0.0, 7);
    assert!(
        matches!(learn(&coincident), NotABody::Coincident { a, b, .. } if a == "m2" && b == "m5")
    );

    let (_, two) = tracks(&shape()[..2], 10, 0.0, 0.0, 8);
    assert_eq!(learn(&two), NotABody::TooFewMarkers { got: 2 });

    let (_, mut hidden) = tracks(&shape(), 10, 0.0, 0.0, 9);
    hidden[3] = vec![None; 10];
    assert_eq!(
        learn(&hidden),
        NotABody::NeverSeen {
            name: "m4".into(),
            seen: 0
        }
    );
    hidden[0] = vec![None; 10];
    hidden[1] = vec![None; 10];
    assert_eq!(learn(&hidden), NotABody::NoRow { rows: 10, most: 2 });
    hidden[2].pop();
    assert!(matches!(
        learn(&hidden),
        NotABody::Length {
            got: 9,
            expected: 10,
            ..
        }
    ));
}

#[test]
fn rows_without_a_pose_say_why() {
    // m1, m2 and m4 on a line, m3 beside it.
    let shape = [
        [0.0, 0.0, 0.0],
        [0.1, 0.0, 0.0],
        [0.05, 0.08, 0.0],
        [0.2, 0.0, 0.0],
    ]
    .map(Point3::from);
    let (_, mut tracks) = tracks(&shape, 6, 0.0, 0.0, 10);
    tracks[2][4] = None;
    tracks[0][5] = None;
    tracks[1][5] = None;
    let body = body_poses(&names(4), &refs(&tracks), None, None).expect("a body");
    assert_eq!(body.rows[4], Err(WithoutPose::OnALine { seen: 3 }));
    assert_eq!(body.rows[5], Err(WithoutPose::TooFewSeen { seen: 2 }));
    assert_eq!(body.track().iter().flatten().count(), 4);
}

#[test]
fn markers_that_are_never_all_seen_at_once_still_make_one_body() {
    let (poses, mut tracks) = tracks(&shape(), 40, 0.0, 0.0, 11);
    for row in 0..40 {
        tracks[row % 5][row] = None;
    }
    let body = body_poses(&names(5), &refs(&tracks), None, None).expect("a body");
    for (row, truth) in body.rows.iter().zip(&poses) {
        let pose = row.as_ref().expect("four seen");
        assert!(
            se3::log(&(truth.inverse() * pose.tracker_from_body))
                .0
                .norm()
                < 1e-8
        );
    }
}

#[test]
fn three_markers_in_one_row_have_a_pose_without_covariance() {
    let (_, tracks) = tracks(&shape()[..3], 1, 1e-4, 0.0, 12);
    let body = body_poses(&names(3), &refs(&tracks), None, None).expect("a body");
    assert!(body.sigma.is_none());
    assert!(body.rows[0].as_ref().expect("seen").covariance.is_none());
}

#[test]
fn a_body_of_a_table_is_found_by_its_markers_names() {
    let (_, tracks) = tracks(&shape(), 10, 1e-4, 0.0, 13);
    let poses = Poses {
        rows: (0..10).collect(),
        markers: names(5).into_iter().zip(tracks.iter().cloned()).collect(),
        ..Poses::default()
    };
    let by_name = body_from_markers(&poses, &names(5), None, None).expect("a body");
    assert_eq!(
        by_name,
        body_poses(&names(5), &refs(&tracks), None, None).expect("a body")
    );
    let wrong = body_from_markers(
        &poses,
        &["m1".into(), "m2".into(), "mm3".into()],
        None,
        None,
    )
    .expect_err("unknown");
    assert_eq!(
        wrong.to_string(),
        "there is no marker `mm3`; the recording has m1, m2, m3, m4, m5; did you mean `m3`?"
    );
}
