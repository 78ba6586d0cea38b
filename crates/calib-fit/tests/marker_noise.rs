//! Residuals far beyond the noise that the distances of markers show are said to be no center and no axis; those of clean joints are not.

use std::f64::consts::TAU;

use calib_fit::{Answer, FitError, Held, TableRequest, aor, cor};
use calib_recording::Poses;
use nalgebra::{Point3, Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;

/// Noise of a coordinate, m.
const SIGMA: f64 = 3e-4;

fn normal(r: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(r))
}

fn uniform(r: &mut ChaCha8Rng, by: f64) -> f64 {
    r.random_range(-by..by)
}

/// Markers of a body whose places at a row are `place(row, marker in the body)`, with a noise of σ, and without a part of the samples.
fn recording(
    r: &mut ChaCha8Rng,
    [rows, markers]: [usize; 2],
    lost: f64,
    mut place: impl FnMut(&mut ChaCha8Rng) -> Box<dyn Fn(&Vector3<f64>) -> Vector3<f64>>,
) -> TableRequest {
    let turned = Rotation3::new(normal(r));
    let of_body: Vec<Vector3<f64>> = (0..markers)
        .map(|_| turned * (Vector3::new(0.1, 0.0, 0.2) + normal(r) * 0.06))
        .collect();
    let mut tracks = vec![Vec::new(); markers];
    for _ in 0..rows {
        let at = place(r);
        for (track, marker) in tracks.iter_mut().zip(&of_body) {
            let seen = Point3::from(at(marker) + normal(r) * SIGMA);
            track.push((r.random_range(0.0..1.0) >= lost).then_some(seen));
        }
    }
    let named = tracks.into_iter().enumerate();
    let held = Held {
        poses: Poses {
            rows: (0..rows as u64).collect(),
            markers: named.map(|(k, t)| (format!("m{k}"), t)).collect(),
            ..Poses::default()
        },
        ..Held::default()
    };
    TableRequest {
        file: Some(held.into()),
        ..TableRequest::default()
    }
}

/// A body about one center, by rotations of up to `range` about each axis.
fn spherical(seed: u64, size: [usize; 2], range: f64, lost: f64) -> TableRequest {
    let mut r = ChaCha8Rng::seed_from_u64(seed);
    let center = normal(&mut r);
    recording(&mut r, size, lost, |r| {
        let by = Rotation3::new(Vector3::from_fn(|_, _| uniform(r, range)));
        Box::new(move |x| center + by * x)
    })
}

/// A body about one axis.
fn hinge(seed: u64, size: [usize; 2], range: f64, lost: f64) -> TableRequest {
    let mut r = ChaCha8Rng::seed_from_u64(seed);
    let axis = normal(&mut r).normalize();
    recording(&mut r, size, lost, |r| {
        let by = Rotation3::new(axis * uniform(r, range));
        Box::new(move |x| by * x)
    })
}

/// A universal joint whose axes pass each other at `apart`, m.
fn universal(seed: u64, apart: f64) -> TableRequest {
    let mut r = ChaCha8Rng::seed_from_u64(seed);
    recording(&mut r, [36, 4], 0.0, |r| {
        let first = Rotation3::new(Vector3::z() * uniform(r, 1.0));
        let second = Rotation3::new(Vector3::x() * uniform(r, 1.0));
        Box::new(move |x| first * (Vector3::y() * apart + second * x))
    })
}

/// A hinge whose axis runs out by `runout`, m, twice in a turn.
fn bent(seed: u64, runout: f64) -> TableRequest {
    let mut r = ChaCha8Rng::seed_from_u64(seed);
    recording(&mut r, [60, 4], 0.0, |r| {
        let angle = uniform(r, 0.5 * TAU);
        let by = Rotation3::new(Vector3::z() * angle);
        Box::new(move |x| by * x + Vector3::z() * (2.0 * angle).sin() * runout)
    })
}

/// Whether it is refused for what the distances show, and the answer's JSON.
fn judged(answer: Result<Answer, FitError>) -> (bool, Value) {
    let answer = answer.expect("an answer");
    let value: Value = serde_json::from_str(&answer.json).expect("JSON");
    let refused = value["reason"]
        .as_str()
        .is_some_and(|reason| reason.contains("that the distances of the markers show"));
    assert!(!(refused && answer.observable), "{}", answer.text);
    (refused, value)
}

#[test]
fn a_joint_without_a_center_is_said_to_be_one() {
    let mut refusals = 0;
    for seed in 0..40 {
        let (refused, value) = judged(cor(&universal(seed, 0.01)));
        refusals += u32::from(refused);
        assert_eq!(refused, value["verdict"] == "weak", "{seed}: {value}");
        let noise = |key: &str| value["marker_noise"][key].as_f64().expect("a noise");
        assert!(
            (noise("sigma_m") / SIGMA - 1.0).abs() < 0.3,
            "{seed}: {value}"
        );
        assert!(noise("chance") < 1e-6, "{seed}: {value}");
    }
    println!("{refusals} of 40 refused");
    // Markers that are near each other and far from the joint see a tenth of what it does; then there is a note.
    assert!(refusals >= 36, "{refusals}");
    let all = TableRequest {
        all: true,
        ..universal(0, 0.01)
    };
    let answer = cor(&all).expect("a comparison");
    assert!(
        !answer.observable && !answer.text.contains("DIFFERS"),
        "{}",
        answer.text
    );
    // The heads state the units, and the lines fit a terminal of 80 columns.
    let head = answer.text.lines().next().expect("heads");
    assert!(
        ["place, m", "σ, mm", "off, mm"]
            .iter()
            .all(|unit| head.contains(unit)),
        "{head}"
    );
    let mut lines = answer.text.lines().filter(|line| line.contains('['));
    assert!(lines.clone().count() > 0, "{}", answer.text);
    assert!(
        lines.all(|line| line.chars().count() <= 80),
        "{}",
        answer.text
    );
    // A noise that is stated may be one that all markers share.
    let stated = TableRequest {
        sigma_m: Some(2e-3),
        estimator: Some("ml_sphere".to_owned()),
        ..universal(0, 0.01)
    };
    assert!(!judged(cor(&stated)).0);
}

#[test]
fn a_joint_without_an_axis_is_said_to_be_one() {
    for seed in 0..20 {
        let (refused, value) = judged(aor(&bent(seed, 3e-3)));
        assert!(refused, "{seed}: {value}");
    }
}

#[test]
fn clean_joints_are_not_refuted() {
    let seeds = if skipped_tests::thorough() { 20 } else { 4 };
    let (mut refused, mut noted, mut all) = (0, 0, 0);
    for markers in 1..=6 {
        for rows in [6, 12, 40, 200] {
            for range in [0.15, 0.5, 1.2] {
                for lost in [0.0, 0.3] {
                    for seed in 0..seeds {
                        let size = [rows, markers];
                        let tables = [
                            cor(&spherical(seed, size, range, lost)),
                            aor(&hinge(seed, size, range, lost)),
                        ];
                        for answer in tables.into_iter().filter(Result::is_ok) {
                            let (is_refused, value) = judged(answer);
                            let chance = value["marker_noise"]["chance"].as_f64();
                            refused += u32::from(is_refused);
                            noted += u32::from(chance.is_some_and(|p| p < 1e-3));
                            all += u32::from(chance.is_some());
                        }
                    }
                }
            }
        }
    }
    println!("{refused} refused, {noted} noted of {all}");
    assert!(refused == 0, "{refused} of {all}");
    assert!(noted * 1000 <= all, "{noted} of {all}");
}

#[test]
fn rows_of_a_wrong_body_do_not_refute_a_center() {
    for seed in 0..20 {
        let mut r = ChaCha8Rng::seed_from_u64(900 + seed);
        let center = normal(&mut r);
        let table = recording(&mut r, [40, 4], 0.0, |r| {
            let by = Rotation3::new(Vector3::from_fn(|_, _| uniform(r, 0.6)));
            let is_wrong = r.random_range(0.0..1.0) < 0.08;
            let wrong = normal(r) * if is_wrong { 0.02 } else { 0.0 };
            Box::new(move |x| center + wrong + by * x)
        });
        // An estimator that such rows pull.
        let estimator = Some("ml_sphere".to_owned());
        let (refused, value) = judged(cor(&TableRequest { estimator, ..table }));
        assert!(!refused, "{seed}: {value}");
    }
}

/// Estimates that are said to differ from the first, of those that are good.
fn differing(answer: Result<Answer, FitError>) -> [u32; 2] {
    let answer = answer.expect("a comparison");
    let lines: Vec<Value> = serde_json::from_str(&answer.json).expect("JSON");
    let good = lines.iter().filter(|l| l["observable"] == true);
    good.fold([0, 0], |[differ, all], line| {
        [differ + u32::from(line["agrees"] == false), all + 1]
    })
}

#[test]
fn estimates_agree_as_far_as_their_uncertainties_allow() {
    let all = |table: TableRequest| TableRequest { all: true, ..table };
    let (mut clean, mut apart) = ([0; 2], 0);
    let add = |sum: [u32; 2], of: [u32; 2]| [sum[0] + of[0], sum[1] + of[1]];
    for seed in 0..20 {
        for [rows, markers] in [[12, 4], [40, 4], [100, 3]] {
            for range in [0.3, 1.0] {
                let size = [rows, markers];
                clean = add(
                    clean,
                    differing(cor(&all(spherical(seed, size, range, 0.1)))),
                );
                clean = add(clean, differing(aor(&all(hinge(seed, size, range, 0.1)))));
            }
        }
        // Axes so near that the joint passes for one with a center: the estimates are millimeters apart.
        apart += u32::from(differing(cor(&all(universal(seed, 0.004))))[0] > 0);
    }
    println!("clean joints: {clean:?} differ; {apart} of 20 joints without a center");
    assert!(clean[0] * 200 <= clean[1], "{clean:?}");
    assert!(apart >= 5, "{apart}");
}
