//! What no estimator can answer, one row each: every one has a named outcome, none panics.

use crate::common::{Hinge, Joint, Noise, Track, steps};
use calib_aor::{
    Center, FrameSample, Input, InputKind, Known, Options, Outcome, Pose, estimators, fit,
    frame_ml::{self, Residuals},
    frame_planes,
};
use calib_estimator::Verdict;
use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};

fn track(points: impl IntoIterator<Item = [f64; 3]>) -> Track {
    points.into_iter().map(|p| Some(Point3::from(p))).collect()
}

fn word(outcome: Result<Outcome, calib_aor::EstimatorError>) -> &'static str {
    match outcome {
        Ok(outcome) => outcome.verdict().as_str(),
        Err(error) => error.verdict().map_or("error", Verdict::as_str),
    }
}

#[test]
fn points_that_have_no_axis() {
    let mut noise = Noise::new(3);
    let hinge = Hinge::slanted();
    let layout = hinge.layout(1, 0.1);
    let table: Vec<(&str, Vec<Track>, &str)> = vec![
        ("nothing", vec![], "too_few"),
        ("empty marker", vec![vec![]], "too_few"),
        ("all lost", vec![vec![None; 20]], "too_few"),
        (
            "two samples",
            vec![track([[0., 0., 1.], [0., 1., 0.]])],
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
            "an arc flatter than its noise",
            vec![
                hinge
                    .tracks(&layout, &steps(0.0, 3.0, 40), 1e-3, &mut noise)
                    .remove(0),
            ],
            "",
        ),
        (
            "no motion",
            vec![
                hinge
                    .tracks(&layout, &[0.3; 40], 1e-3, &mut noise)
                    .remove(0),
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
        for info in estimators() {
            if !Input::Markers(&data).serves(info.input) {
                continue;
            }
            let got = word(fit(info.id, &Input::Markers(&data), &Options::default()));
            if expected.is_empty() {
                assert_ne!(got, "ok", "{what}: {}", info.id);
            } else {
                assert_eq!(got, expected, "{what}: {}", info.id);
            }
        }
    }
}

#[test]
fn three_points_make_a_circle_where_the_noise_is_stated() {
    let data = vec![track([[1., 0., 0.5], [0., 1., 0.5], [-1., 0., 0.5]])];
    for info in estimators().iter().filter(|e| e.input == InputKind::Points) {
        let input = Input::Points(&data);
        let unknown = fit(info.id, &input, &Options::default()).expect(info.id);
        assert_eq!(unknown.verdict(), Verdict::TooFew, "{}", info.id);
        let stated = Options::default().with_sigma_t(1e-6);
        let outcome = fit(info.id, &input, &stated).expect(info.id);
        let e = outcome
            .estimate()
            .unwrap_or_else(|| panic!("{}: {:?}", info.id, outcome.reason()));
        assert!(
            e.line.direction.z.abs() > 1.0 - 1e-9,
            "{}: {:?}",
            info.id,
            e.line
        );
        assert!(
            (e.circles[0].center - Point3::new(0., 0., 0.5)).norm() < 1e-6,
            "{}",
            info.id
        );
    }
}

#[test]
fn poses_that_have_no_axis() {
    let mut noise = Noise::new(5);
    let hinge = Hinge::slanted();
    let body = Isometry3::new(Vector3::new(1.3, -0.7, 1.0), Vector3::new(0.3, 0.2, -0.5));
    let exact = |angles: &[f64]| hinge.poses(&body, angles, 0.0, 0.0, &mut Noise::new(1));
    let ball: Vec<Option<Pose>> = (0..40)
        .map(|_| {
            let r = UnitQuaternion::from_scaled_axis(noise.vector(0.6));
            Some(Pose {
                rotation: r.to_rotation_matrix().into_inner(),
                translation: -(r * Vector3::new(0.1, 0.0, 0.0)),
            })
        })
        .collect();
    let mut reflected = exact(&steps(0.0, 90.0, 12));
    reflected[3].as_mut().expect("seen").rotation *= -1.0;
    let mut nan = exact(&steps(0.0, 90.0, 12));
    nan[3].as_mut().expect("seen").translation.x = f64::NAN;
    let table = vec![
        ("nothing", vec![], "too_few"),
        ("one pose", exact(&[0.2]), "too_few"),
        ("the same pose", exact(&[0.2; 12]), "no_rotation"),
        (
            "no turn, noisy",
            hinge.poses(&body, &[0.2; 60], 1e-3, 5e-3, &mut noise),
            "",
        ),
        ("a ball", ball, "not_unique"),
        ("reflected", reflected, "not_rotation"),
        ("NaN", nan, "not_finite"),
    ];
    for (what, data, expected) in table {
        for id in ["sara", "rotation_axis", "hinge_poses"] {
            let got = word(fit(id, &Input::Poses(&data), &Options::default()));
            if expected.is_empty() {
                assert_ne!(got, "ok", "{what}: {id}");
            } else {
                assert_eq!(got, expected, "{what}: {id}");
            }
        }
    }
}

#[test]
fn a_chord_leaves_its_line() {
    let data = vec![track(
        (0..12).map(|k| [0.1 * k as f64, 0.2 * k as f64, 1.0]),
    )];
    let outcome = fit("plane", &Input::Points(&data), &Options::default()).expect("points");
    let Outcome::NotObservable(why) = outcome else {
        panic!("a line has no circle")
    };
    let Known::Chord(line) = why.known else {
        panic!("no chord")
    };
    assert!(
        line.direction
            .cross(&Vector3::new(1.0, 2.0, 0.0).normalize())
            .norm()
            < 1e-9
    );
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
        text("sara", &Options::default()),
        "this estimator needs poses of one or two bodies, got points"
    );
    assert!(
        text("hinge", &Options::default())
            .starts_with("unknown axis estimator `hinge`, expected one of plane, planar_radial")
    );
    let bad = Options {
        sigma_t: Some(f64::NAN),
        ..Options::default()
    };
    assert_eq!(
        text("plane", &bad),
        "option sigma_t must be a finite number > 0, got NaN"
    );
    let short = Options {
        angles: vec![0.0],
        ..Options::default()
    };
    let error = fit("hinge_bundle", &Input::Markers(&data), &short).expect_err("angles");
    assert_eq!(
        error.to_string(),
        "joint angles and frames differ in number: 1 and 4"
    );
}

// ---- frames --------------------------------------------------------------------------------------------

fn frame_words(samples: &[FrameSample]) -> [&'static str; 2] {
    let options = Options::default();
    let planes = frame_planes::algorithm1(samples, Center::NearestToAxes, &options);
    let ml = frame_ml::fit(samples, Residuals::Poses, &options);
    [planes, ml].map(|outcome| match outcome {
        Ok(outcome) => outcome.verdict().as_str(),
        Err(error) => error.verdict().map_or("error", Verdict::as_str),
    })
}

#[test]
fn recordings_that_have_no_frame() {
    let joint = Joint::hand();
    let mut noise = Noise::new(9);
    let grid = joint.grid(6, 1e-3, 5e-3, &mut noise);
    assert_eq!(frame_words(&grid), ["ok", "ok"]);

    let mut missing = grid.clone();
    for k in [0, 7, 8, 20, 35] {
        missing[k].world_from_body = None;
    }
    assert_eq!(
        frame_words(&missing),
        ["ok", "ok"],
        "a grid with lost cells"
    );

    let scattered: Vec<_> = (0..36)
        .map(|_| {
            let (p, d) = (3.0 * noise.uniform() - 0.8, 2.0 * noise.uniform() - 0.8);
            joint.sample(p, d, 1e-3, 5e-3, &mut noise)
        })
        .collect();
    assert_eq!(
        frame_words(&scattered),
        ["too_few", "ok"],
        "scattered samples"
    );
    let planes = frame_planes::algorithm1(&scattered, Center::NearestToAxes, &Options::default());
    let reason = planes
        .expect("poses")
        .reason()
        .expect("a reason")
        .to_string();
    assert!(
        reason.contains("scattered samples need `frame_ml`"),
        "{reason}"
    );

    let only_proximal: Vec<_> = steps(-45.0, 135.0, 20)
        .iter()
        .map(|p| joint.sample(*p, 0.3, 1e-3, 5e-3, &mut noise))
        .collect();
    assert_eq!(
        frame_words(&only_proximal),
        ["too_few", "single_axis"],
        "one axis moves"
    );
    let only_distal: Vec<_> = steps(-45.0, 80.0, 20)
        .iter()
        .map(|d| joint.sample(0.3, *d, 1e-3, 5e-3, &mut noise))
        .collect();
    assert_eq!(
        frame_words(&only_distal),
        ["too_few", "single_axis"],
        "one axis moves"
    );

    assert_eq!(frame_words(&[]), ["too_few", "too_few"]);
    assert_eq!(frame_words(&grid[..2]), ["too_few", "too_few"]);
    let lost: Vec<_> = grid
        .iter()
        .map(|s| FrameSample {
            world_from_body: None,
            ..*s
        })
        .collect();
    assert_eq!(frame_words(&lost), ["too_few", "too_few"]);

    let mut nan = grid.clone();
    nan[4].world_from_body.as_mut().expect("seen").translation.y = f64::NAN;
    assert_eq!(frame_words(&nan), ["not_finite", "not_finite"]);
    let mut mirrored = grid.clone();
    mirrored[4].world_from_body.as_mut().expect("seen").rotation *= -1.0;
    assert_eq!(frame_words(&mirrored), ["not_rotation", "not_rotation"]);
    let mut angle = grid.clone();
    angle[4].proximal = f64::INFINITY;
    assert_eq!(frame_words(&angle), ["error", "error"]);

    // Angles that belong to the other joint: the geometry fits no frame.
    let exchanged: Vec<_> = grid
        .iter()
        .map(|s| FrameSample {
            proximal: s.distal,
            distal: s.proximal,
            ..*s
        })
        .collect();
    for word in frame_words(&exchanged) {
        assert_ne!(word, "ok", "exchanged angles");
    }
    // A body that never moves.
    let still: Vec<_> = grid
        .iter()
        .map(|s| FrameSample {
            world_from_body: grid[0].world_from_body,
            ..*s
        })
        .collect();
    for word in frame_words(&still) {
        assert_ne!(word, "ok", "a body that never moves");
    }
}

/// Two joints with parallel axes span no frame.
#[test]
fn parallel_axes_are_named() {
    let mut noise = Noise::new(2);
    let hinge = Hinge::slanted();
    let body = Isometry3::new(Vector3::new(1.3, -0.7, 1.0), Vector3::new(0.3, 0.2, -0.5));
    let mut samples = Vec::new();
    for p in steps(-45.0, 60.0, 6) {
        for d in steps(-45.0, 60.0, 6) {
            let pose = hinge.poses(&body, &[p + d], 0.0, 0.0, &mut noise).remove(0);
            samples.push(FrameSample {
                world_from_body: pose,
                proximal: p,
                distal: d,
                weight: 1.0,
            });
        }
    }
    let center = Center::Given {
        point: hinge.point,
        covariance: Matrix3::zeros(),
    };
    let outcome = frame_planes::algorithm1(&samples, center, &Options::default()).expect("poses");
    assert_eq!(
        outcome.verdict(),
        Verdict::Parallel,
        "{:?}",
        outcome.reason()
    );
}
