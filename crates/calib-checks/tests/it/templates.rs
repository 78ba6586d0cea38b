//! Mean distances between markers against a template that is stated.

use calib_checks::rigid_body::Template;
use calib_checks::{Expectations, checks};
use calib_finding::{Fact, Finding, Severity, catalog};
use calib_recording::Poses;
use nalgebra::{Isometry3, Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// σ of a marker coordinate, m.
const SIGMA: f64 = 2e-4;

fn vector(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(rng))
}

/// A body of `count` markers in 40 poses of a tracker whose lengths are `scale` times too long; the template is right.
fn recorded(seed: u64, count: usize, scale: f64) -> (Poses, Expectations) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let near =
        |points: &[Point3<f64>], p: &Point3<f64>| points.iter().any(|q| (p - q).norm() < 0.04);
    let mut points: Vec<Point3<f64>> = Vec::new();
    while points.len() < count {
        let p = Point3::from(Vector3::from_fn(|_, _| rng.random_range(-0.07..0.07)));
        if !near(&points, &p) {
            points.push(p);
        }
    }
    let names: Vec<String> = (0..count).map(|k| format!("m{k}")).collect();
    let mut poses = Poses {
        rows: (2..42).collect(),
        ..Poses::default()
    };
    for _ in 0..40 {
        let pose = Isometry3::new(vector(&mut rng), vector(&mut rng));
        for (name, p) in names.iter().zip(&points) {
            let seen = pose * Point3::from(p.coords * scale) + SIGMA * vector(&mut rng);
            poses
                .markers
                .entry(name.clone())
                .or_default()
                .push(Some(seen));
        }
    }
    let mut expected = Expectations {
        marker_sigma: Some(SIGMA),
        ..Expectations::default()
    };
    expected.bodies.insert("body".into(), names.clone());
    expected
        .templates
        .insert("body".into(), Template { names, points });
    (poses, expected)
}

fn of_template(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    let mut found = checks(poses, expected);
    found.retain(|f| f.id == catalog::NOT_RIGID);
    found
}

fn place(expected: &mut Expectations, marker: usize) -> &mut Point3<f64> {
    let template = expected.templates.get_mut("body").expect("stated");
    &mut template.points[marker]
}

#[test]
fn a_marker_that_is_stated_wrong_by_a_millimeter_and_a_half_is_named() {
    for count in [4, 5, 8] {
        let (mut found, mut named) = (0, 0);
        for seed in 0..100 {
            let (poses, mut expected) = recorded(seed, count, 1.0);
            let wrong = seed as usize % count;
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            *place(&mut expected, wrong) += 1.5e-3 * vector(&mut rng).normalize();
            let findings = of_template(&poses, &expected);
            found += findings.len();
            for finding in &findings {
                assert_eq!(finding.severity, Severity::Warning, "{finding:?}");
                if let Some(marker) = finding.facts.get("marker") {
                    assert_eq!(
                        *marker,
                        Fact::name(format!("m{wrong}")),
                        "{seed}: {finding:?}"
                    );
                    named += 1;
                }
            }
        }
        assert!(found >= 90 && named >= 80, "{count}: {found}, {named}");
    }
}

/// Two markers that are stated wrong are no reason to name one.
#[test]
fn two_markers_that_are_stated_wrong_are_seldom_one() {
    let mut wrong = 0;
    for seed in 0..100 {
        let (poses, mut expected) = recorded(300 + seed, 6, 1.0);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for marker in [1, 4] {
            *place(&mut expected, marker) += 1.5e-3 * vector(&mut rng).normalize();
        }
        for finding in of_template(&poses, &expected) {
            let named = finding.facts.get("marker");
            wrong += usize::from(named.is_some());
        }
    }
    assert!(wrong <= 5, "{wrong}");
}

/// A right template, one that is as uncertain as is stated, lengths that are seen too long, and coordinates to a tenth of a millimeter.
#[test]
fn a_right_template_is_silent() {
    for seed in 0..200 {
        for count in [3, 4, 8] {
            let (poses, expected) = recorded(1000 + seed, count, 1.0);
            assert_eq!(of_template(&poses, &expected), [], "{seed} {count}");
            let (poses, expected) = recorded(1000 + seed, count, 1.004);
            if count > 3 {
                assert_eq!(of_template(&poses, &expected), [], "scale, {seed} {count}");
            }
            for (sigma, stated) in [(4e-4, Some(4e-4)), (1e-4, None)] {
                let (poses, mut expected) = recorded(1000 + seed, count, 1.0);
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                for marker in 0..count {
                    *place(&mut expected, marker) += sigma * vector(&mut rng);
                }
                if let Some(stated) = stated {
                    expected.template_sigmas.insert("body".into(), stated);
                }
                let found = of_template(&poses, &expected);
                assert_eq!(found, [], "{sigma}, {seed} {count}");
            }
        }
    }
}
