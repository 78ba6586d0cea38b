//! What no estimator can answer, one row each: every one has a named outcome, none panics.

use crate::common::{Noise, grid, marker, poses, sweep};
use calib_cor::{Input, InputKind, Known, Options, Outcome, Pose, estimators, fit};
use calib_estimator::Verdict;
use nalgebra::{Matrix3, Point3, Vector3};

type Track = Vec<Option<Point3<f64>>>;

const CENTER: Vector3<f64> = Vector3::new(1.2, -0.8, 0.9);
const ARM: Vector3<f64> = Vector3::new(0.05, 0.02, 0.12);

fn track(points: impl IntoIterator<Item = [f64; 3]>) -> Track {
    points.into_iter().map(|p| Some(Point3::from(p))).collect()
}

fn point_verdicts(data: &[Track]) -> Vec<(&'static str, String)> {
    estimators()
        .iter()
        .filter(|e| Input::Markers(data).serves(e.input))
        .map(|e| {
            let word = match fit(e.id, &Input::Markers(data), &Options::default()) {
                Ok(outcome) => outcome.verdict().as_str().to_string(),
                Err(error) => error.verdict().map_or("error", Verdict::as_str).to_string(),
            };
            (e.id, word)
        })
        .collect()
}

fn pose_verdicts(data: &[Option<Pose>], options: &Options) -> Vec<(&'static str, String)> {
    estimators()
        .iter()
        .filter(|e| e.input == InputKind::Poses)
        .map(|e| {
            let word = match fit(e.id, &Input::Poses(data), options) {
                Ok(outcome) => outcome.verdict().as_str().to_string(),
                Err(error) => error.verdict().map_or("error", Verdict::as_str).to_string(),
            };
            (e.id, word)
        })
        .collect()
}

#[test]
fn points_that_have_no_center() {
    let mut noise = Noise::new(3);
    let arc = |k: usize| (0.2 * k as f64).sin_cos();
    let table: Vec<(&str, Vec<Track>, &str)> = vec![
        ("nothing", vec![], "too_few"),
        ("empty marker", vec![vec![]], "too_few"),
        ("all lost", vec![vec![None; 20]], "too_few"),
        ("one sample", vec![track([[1.0, 2.0, 3.0]])], "too_few"),
        (
            "three samples",
            vec![track([[0., 0., 1.], [0., 1., 0.], [1., 0., 0.]])],
            "too_few",
        ),
        (
            "one place",
            vec![track([[1.0, 2.0, 3.0]; 12])],
            "coincident",
        ),
        (
            "one place far off",
            vec![track([[1e4, 2e4, 3e4]; 12])],
            "coincident",
        ),
        (
            "a line",
            vec![track((0..12).map(|k| [k as f64, 2.0 * k as f64, 1.0]))],
            "collinear",
        ),
        (
            "two places",
            vec![track((0..12).map(|k| [(k % 2) as f64, 0.0, 1.0]))],
            "collinear",
        ),
        (
            "a circle",
            vec![track((0..12).map(|k| [arc(k).0, arc(k).1, 1.0]))],
            "coplanar",
        ),
        (
            "a circle 100 m away",
            vec![track((0..12).map(|k| {
                [100.0 + 0.1 * arc(k).0, 50.0 + 0.1 * arc(k).1, -80.0]
            }))],
            "coplanar",
        ),
        (
            "two parallel circles",
            vec![
                track((0..12).map(|k| [arc(k).0, arc(k).1, 1.0])),
                track((0..12).map(|k| [2.0 * arc(k).1, 2.0 * arc(k).0, 3.0])),
            ],
            "coplanar",
        ),
        (
            "a noisy circle",
            vec![marker(
                &sweep(Vector3::new(1., 2., 3.), 150.0, 40),
                &CENTER,
                &ARM,
                5e-4,
                &mut noise,
            )],
            "coplanar",
        ),
        (
            "noise around one place",
            vec![
                (0..40)
                    .map(|_| Some(Point3::from(CENTER + noise.vector(1e-3))))
                    .collect(),
            ],
            "",
        ),
        (
            "NaN",
            vec![track([
                [0., 0., 1.],
                [0., f64::NAN, 0.],
                [1., 0., 0.],
                [1., 1., 1.],
            ])],
            "not_finite",
        ),
        (
            "infinity",
            vec![track([[0., 0., 1.], [0., f64::INFINITY, 0.], [1., 0., 0.]])],
            "not_finite",
        ),
    ];
    for (what, data, expected) in table {
        for (id, got) in point_verdicts(&data) {
            if expected.is_empty() {
                assert_ne!(got, "ok", "{what}: {id}");
            } else {
                assert_eq!(got, expected, "{what}: {id}");
            }
        }
    }
}

#[test]
fn poses_that_have_no_center() {
    let mut noise = Noise::new(5);
    let ball = grid([-45.0, 135.0], 4, [-45.0, 80.0], 4);
    let exact = |turns: &[_]| poses(turns, &CENTER, &ARM, 0.0, 0.0, &mut Noise::new(1));
    let mut reflected = exact(&ball);
    reflected[3].as_mut().expect("seen").rotation *= -1.0;
    let mut scaled = exact(&ball);
    scaled[3].as_mut().expect("seen").rotation *= 1.01;
    let mut sheared = exact(&ball);
    sheared[3].as_mut().expect("seen").rotation[(0, 1)] += 0.02;
    let mut zero = exact(&ball);
    zero[3].as_mut().expect("seen").rotation = Matrix3::zeros();
    let mut nan = exact(&ball);
    nan[3].as_mut().expect("seen").translation.x = f64::NAN;
    let mut nan_rotation = exact(&ball);
    nan_rotation[3].as_mut().expect("seen").rotation[(1, 1)] = f64::NAN;
    let one_axis = sweep(Vector3::new(1.0, 2.0, 3.0), 150.0, 40);
    let slide: Vec<_> = (0..20)
        .map(|k| {
            Some(Pose {
                rotation: Matrix3::identity(),
                translation: Vector3::x() * k as f64,
            })
        })
        .collect();
    let table = vec![
        ("nothing", vec![], "too_few"),
        ("all lost", vec![None; 9], "too_few"),
        ("one pose", exact(&ball[..1]), "too_few"),
        ("two poses", exact(&ball[..2]), "single_axis"),
        ("the same pose", exact(&[ball[2]; 12]), "no_rotation"),
        ("a slide", slide, "no_rotation"),
        ("one axis", exact(&one_axis), "single_axis"),
        (
            "one axis, noisy",
            poses(&one_axis, &CENTER, &ARM, 5e-4, 5e-3, &mut noise),
            "single_axis",
        ),
        (
            "one axis, nearly exact",
            poses(&one_axis, &CENTER, &ARM, 1e-7, 1e-7, &mut noise),
            "single_axis",
        ),
        (
            "no turn, noisy",
            poses(&[ball[2]; 40], &CENTER, &ARM, 5e-4, 5e-3, &mut noise),
            "no_rotation",
        ),
        ("reflected", reflected, "not_rotation"),
        ("scaled", scaled, "not_rotation"),
        ("sheared", sheared, "not_rotation"),
        ("zero matrix", zero, "not_rotation"),
        ("NaN", nan, "not_finite"),
        ("NaN in a rotation", nan_rotation, "not_finite"),
    ];
    for (what, data, expected) in table {
        for (id, got) in pose_verdicts(&data, &Options::default()) {
            assert_eq!(got, expected, "{what}: {id}");
        }
    }
}

/// What is left when the center is not: the line of the one axis.
#[test]
fn a_single_axis_leaves_its_line() {
    let mut noise = Noise::new(11);
    let axis = Vector3::new(1.0, 2.0, 3.0).normalize();
    let turns = sweep(axis, 150.0, 60);
    let data = poses(&turns, &CENTER, &ARM, 1e-4, 1e-3, &mut noise);
    let outcome = fit("hse", &Input::Poses(&data), &Options::default()).expect("poses");
    let Outcome::NotObservable(why) = &outcome else {
        panic!("{outcome:?}")
    };
    let Known::AxisLine(line) = why.known else {
        panic!("no line")
    };
    assert!(
        line.direction.cross(&axis).norm() < 2e-3,
        "{}",
        line.direction.cross(&axis).norm()
    );
    assert!(line.distance_to_point(&CENTER.into()) < 5e-4);
    let track = vec![marker(&turns, &CENTER, &ARM, 1e-4, &mut noise)];
    let outcome = fit("sfe", &Input::Points(&track), &Options::default()).expect("points");
    let Outcome::NotObservable(why) = &outcome else {
        panic!("{outcome:?}")
    };
    let Known::AxisLine(line) = why.known else {
        panic!("no line")
    };
    assert!(line.distance_to_point(&CENTER.into()) < 1e-3);
    assert!(why.reason.contains("noise"), "{}", why.reason);
}

#[test]
fn wrong_kinds_names_and_options_are_errors() {
    let data = vec![track([
        [0., 0., 1.],
        [0., 1., 0.],
        [1., 0., 0.],
        [1., 1., 1.],
    ])];
    let input = Input::Points(&data);
    let text = |id: &str, options: &Options| fit(id, &input, options).expect_err(id).to_string();
    assert_eq!(
        text("hse", &Options::default()),
        "this estimator needs poses, got points"
    );
    assert!(
        text("pratt", &Options::default())
            .starts_with("unknown center estimator `pratt`, expected one of hse, hsa, sfe")
    );
    let bad = Options {
        sigma_t: Some(-1.0),
        ..Options::default()
    };
    assert_eq!(
        text("sfe", &bad),
        "option sigma_t must be a finite number > 0, got -1"
    );
    let bad = Options {
        covariances: vec![vec![Matrix3::identity(); 3]],
        ..Options::default()
    };
    assert_eq!(
        text("ml_sphere", &bad),
        "covariances and samples of a marker differ in number: 3 and 4"
    );
    let bad = Options {
        covariances: vec![vec![Matrix3::zeros(); 4]],
        ..Options::default()
    };
    assert_eq!(
        text("ml_sphere", &bad),
        "marker 0, row 0: the covariance is not positive definite"
    );
}

/// Lost rows change nothing but the count.
#[test]
fn lost_samples_are_skipped() {
    let mut noise = Noise::new(7);
    let turns = grid([-45.0, 135.0], 6, [-45.0, 80.0], 6);
    let full = poses(&turns, &CENTER, &ARM, 1e-3, 5e-3, &mut noise);
    let mut gaps = Vec::new();
    for pose in &full {
        gaps.push(*pose);
        gaps.push(None);
    }
    for id in ["hse", "hsa", "hotspot_ml", "sfe", "ml_sphere"] {
        let a = fit(id, &Input::Poses(&full), &Options::default()).expect(id);
        let b = fit(id, &Input::Poses(&gaps), &Options::default()).expect(id);
        assert_eq!(
            a.estimate().expect(id).center,
            b.estimate().expect(id).center,
            "{id}"
        );
        assert_eq!(b.estimate().expect(id).used, 36, "{id}");
    }
}

/// A body mounted right at the center: no lever, but a center all the same.
#[test]
fn a_body_at_the_center() {
    let turns = grid([-45.0, 135.0], 6, [-45.0, 80.0], 6);
    for (arm, sigma) in [(0.0, 1e-3), (2e-3, 1e-3), (0.0, 0.0)] {
        let arm = Vector3::new(arm, 0.0, 0.0);
        let data = poses(&turns, &CENTER, &arm, sigma, 5e-3, &mut Noise::new(8));
        for id in ["hse", "hsa", "hotspot_ml", "robust", "consensus"] {
            let outcome = fit(id, &Input::Poses(&data), &Options::default()).expect(id);
            let e = outcome
                .estimate()
                .unwrap_or_else(|| panic!("{id}: {:?}", outcome.reason()));
            let off = (e.center.coords - CENTER).norm();
            assert!(off < 1e-9 + sigma, "{id}: {off:e}");
        }
    }
}
