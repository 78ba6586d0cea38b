//! Every fault class injected into simulated recordings: found in (nearly) all, and clean ones stay silent.

use calib_checks::model::{alignment, up_axis};
use calib_checks::rigid_body::Template;
use calib_checks::{Expectations, checks, held_out_in_training};
use calib_finding::{About, Fact, Finding, Severity, catalog};
use calib_recording::{JointUnit, Poses};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::BTreeMap;

/// σ of a marker coordinate, m.
const SIGMA: f64 = 1e-4;
const SEEDS: u64 = 60;

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// `base_from_hand` of an arm with three axes that do not meet.
pub fn forward(q: [f64; 3]) -> Isometry3<f64> {
    let turn = |axis: Vector3<f64>, angle: f64| {
        Isometry3::from_parts(
            Translation3::identity(),
            UnitQuaternion::from_scaled_axis(axis * angle),
        )
    };
    let shift = Isometry3::translation;
    turn(Vector3::z(), q[0])
        * shift(0.02, 0.0, 0.355)
        * turn(Vector3::y(), q[1])
        * shift(0.375, 0.01, 0.0)
        * turn(Vector3::x(), q[2])
        * shift(0.1, 0.0, 0.05)
}

pub(crate) const JOINTS: [&str; 3] = ["waist", "shoulder", "roll"];

fn hand_markers() -> Vec<Point3<f64>> {
    [
        [0.0, 0.0, 0.0],
        [0.08, 0.01, 0.0],
        [0.03, 0.065, 0.01],
        [-0.03, 0.02, 0.05],
    ]
    .map(Point3::from)
    .to_vec()
}

/// A simulated recording and its truth.
pub struct Recorded {
    pub poses: Poses,
    pub expected: Expectations,
    pub q: Vec<[f64; 3]>,
}

/// Static poses on a 4 × 3 × 3 grid, or a continuous motion of 300 rows at 100 Hz.
pub fn record(seed: u64, timed: bool) -> Recorded {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let q: Vec<[f64; 3]> = if timed {
        (0..300)
            .map(|i| {
                let t = f64::from(i) * 0.01;
                [
                    1.2 * (2.3 * t).sin(),
                    0.8 * (3.1 * t).sin(),
                    1.4 * (2.7 * t + 0.3).sin(),
                ]
            })
            .collect()
    } else {
        let steps = |n: i32, i: i32, low: f64, high: f64| {
            low + (high - low) * f64::from(i) / f64::from(n - 1)
        };
        (0..36)
            .map(|i| {
                [
                    steps(4, i / 9, -1.2, 1.2),
                    steps(3, i / 3 % 3, -0.8, 0.8),
                    steps(3, i % 3, -1.4, 1.4),
                ]
            })
            .collect()
    };
    let n = q.len();
    let tracker_from_base = Isometry3::new(
        Vector3::new(0.5, -0.3, 0.9),
        Vector3::new(0.1, 0.2, rng.random_range(-3.0..3.0)),
    );
    let hand_from_body = Isometry3::new(
        Vector3::new(0.02, 0.03, 0.04),
        Vector3::new(0.5, -0.4, rng.random_range(-1.0..1.0)),
    );
    let mut poses = Poses {
        rows: (2..n as u64 + 2).collect(),
        ..Poses::default()
    };
    poses.t = timed.then(|| (0..n).map(|i| i as f64 * 0.01).collect());
    let mut noisy = |p: Point3<f64>| p + Vector3::from_fn(|_, _| SIGMA * normal(&mut rng));
    for (k, m) in hand_markers().iter().enumerate() {
        let track = q
            .iter()
            .map(|&q| Some(noisy(tracker_from_base * forward(q) * hand_from_body * m)))
            .collect();
        poses.markers.insert(format!("hand_{k}"), track);
    }
    for (k, m) in [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.2, 0.0]]
        .iter()
        .enumerate()
    {
        let track = q
            .iter()
            .map(|_| Some(noisy(tracker_from_base * Point3::from(*m))))
            .collect();
        poses.markers.insert(format!("table_{k}"), track);
    }
    let track: Vec<Option<Isometry3<f64>>> = q
        .iter()
        .map(|&q| {
            let wobble = Isometry3::new(
                Vector3::from_fn(|_, _| SIGMA * normal(&mut rng)),
                Vector3::from_fn(|_, _| 1e-3 * normal(&mut rng)),
            );
            Some(tracker_from_base * forward(q) * hand_from_body * wobble)
        })
        .collect();
    poses.bodies.insert("tool".to_string(), track);
    for (k, joint) in JOINTS.iter().enumerate() {
        poses.joints.insert(
            joint.to_string(),
            q.iter()
                .map(|q| Some(q[k] + 1e-4 * normal(&mut rng)))
                .collect(),
        );
        poses
            .joint_units
            .insert(joint.to_string(), JointUnit::Angle);
    }
    let names = |body: &str, count: usize| {
        (0..count)
            .map(|k| format!("{body}_{k}"))
            .collect::<Vec<_>>()
    };
    let expected = Expectations {
        bodies: BTreeMap::from([
            ("hand".to_string(), names("hand", 4)),
            ("table".to_string(), names("table", 3)),
        ]),
        templates: BTreeMap::from([(
            "hand".to_string(),
            Template::given(names("hand", 4), hand_markers()).expect("a body"),
        )]),
        limits: JOINTS
            .iter()
            .map(|joint| (joint.to_string(), (-1.6, 1.6)))
            .collect(),
        asked: BTreeMap::from([
            ("waist".to_string(), (-1.2, 1.2)),
            ("shoulder".to_string(), (-0.8, 0.8)),
            ("roll".to_string(), (-1.4, 1.4)),
        ]),
        reach: Some(0.9),
        min_poses: 12,
        marker_sigma: Some(SIGMA),
        ..Expectations::default()
    };
    Recorded { poses, expected, q }
}

pub type Fault = fn(&mut Recorded, &mut ChaCha8Rng);

fn marker<'a>(r: &'a mut Recorded, name: &str) -> &'a mut Vec<Option<Point3<f64>>> {
    r.poses.markers.get_mut(name).expect("recorded")
}

fn joint<'a>(r: &'a mut Recorded, name: &str) -> &'a mut Vec<Option<f64>> {
    r.poses.joints.get_mut(name).expect("recorded")
}

fn scale_all(r: &mut Recorded, factor: f64) {
    r.poses
        .markers
        .values_mut()
        .flatten()
        .flatten()
        .for_each(|p| p.coords *= factor);
    r.poses
        .bodies
        .values_mut()
        .flatten()
        .flatten()
        .for_each(|p| p.translation.vector *= factor);
}

/// Id of the finding expected, whether the recording has time, and how the fault comes about.
pub fn faults() -> Vec<(&'static str, &'static str, bool, Fault)> {
    vec![
        (
            "all-zero-triplet",
            "lost samples written as zero",
            false,
            |r, rng| {
                let row = rng.random_range(0..36);
                marker(r, "hand_2")[row] = Some(Point3::origin());
            },
        ),
        (
            "duplicate-column",
            "a marker exported twice",
            false,
            |r, _| {
                let copy = marker(r, "hand_2").clone();
                *marker(r, "hand_3") = copy;
            },
        ),
        (
            "frozen",
            "a marker keeps its last value for 4 rows",
            false,
            |r, rng| {
                let row = rng.random_range(0..31);
                let value = marker(r, "hand_1")[row];
                (row..row + 4).for_each(|i| marker(r, "hand_1")[i] = value);
            },
        ),
        (
            "frozen",
            "a marker keeps its first value in all rows",
            false,
            |r, _| {
                let value = marker(r, "hand_1")[0];
                marker(r, "hand_1").fill(value);
            },
        ),
        (
            "frozen",
            "a body keeps its last pose for 10 samples",
            true,
            |r, rng| {
                let row = rng.random_range(0..280);
                let track = r.poses.bodies.get_mut("tool").expect("recorded");
                let value = track[row];
                track[row..row + 10].fill(value);
            },
        ),
        (
            "virtual-points",
            "points computed from the body's pose",
            false,
            |r, _| {
                let poses = r.poses.bodies["tool"].clone();
                for (k, m) in hand_markers().iter().enumerate() {
                    *marker(r, &format!("hand_{k}")) =
                        poses.iter().map(|pose| pose.map(|pose| pose * m)).collect();
                }
            },
        ),
        (
            "marker-swap",
            "two markers exchanged in 3 rows",
            false,
            |r, rng| {
                let row = rng.random_range(0..34);
                for i in row..row + 3 {
                    let (a, b) = (marker(r, "hand_0")[i], marker(r, "hand_2")[i]);
                    marker(r, "hand_0")[i] = b;
                    marker(r, "hand_2")[i] = a;
                }
            },
        ),
        (
            "marker-outlier",
            "a reflection 5 mm off in 2 rows",
            false,
            |r, rng| {
                let row = rng.random_range(0..35);
                for i in row..row + 2 {
                    let direction = Vector3::from_fn(|_, _| normal(rng)).normalize();
                    let point = marker(r, "hand_1")[i].as_mut().expect("seen");
                    *point += direction * 5e-3;
                }
            },
        ),
        (
            "not-rigid",
            "a loose marker, 2 mm back and forth",
            false,
            |r, rng| {
                for point in marker(r, "hand_3").iter_mut().flatten() {
                    *point += Vector3::from_fn(|_, _| 2e-3 * normal(rng));
                }
            },
        ),
        (
            "not-rigid",
            "a reflection in place of one of two markers in every third row",
            false,
            |r, _| {
                r.expected.bodies.insert(
                    "hand".to_owned(),
                    vec!["hand_0".to_owned(), "hand_1".to_owned()],
                );
                r.expected.templates.remove("hand");
                for i in (0..36).step_by(3) {
                    marker(r, "hand_1")[i].as_mut().expect("seen").x += 0.03;
                }
            },
        ),
        (
            "not-rigid",
            "a part of the body bends by up to 10 mm",
            false,
            |r, _| {
                for i in 0..36 {
                    let bend = 0.01 * (r.q[i][1] / 0.8).max(0.0);
                    let outward = r.poses.bodies["tool"][i].expect("tracked").rotation
                        * Vector3::new(-0.4, 0.9, 0.2);
                    for name in ["hand_2", "hand_3"] {
                        *marker(r, name)[i].as_mut().expect("seen") += outward * bend;
                    }
                }
            },
        ),
        (
            "body-redefined",
            "a marker knocked by 4 mm halfway",
            false,
            |r, rng| {
                let row = rng.random_range(8..28);
                let (markers, q) = (hand_markers(), r.q.clone());
                let knocked = markers[2] + Vector3::new(3e-3, -2e-3, 2e-3);
                // The marker's place in the tracker frame, from the other markers' body pose.
                for i in row..q.len() {
                    let pose = r.poses.bodies["tool"][i].expect("tracked");
                    marker(r, "hand_2")[i] =
                        Some(pose * knocked + Vector3::from_fn(|_, _| SIGMA * normal(rng)));
                }
                // The wobble of the tool's pose would be noise of that marker: use the other markers' own.
                for i in 0..row {
                    let pose = r.poses.bodies["tool"][i].expect("tracked");
                    marker(r, "hand_2")[i] =
                        Some(pose * markers[2] + Vector3::from_fn(|_, _| SIGMA * normal(rng)));
                }
            },
        ),
        ("mirrored", "a left-handed export", false, |r, _| {
            r.poses
                .markers
                .values_mut()
                .flatten()
                .flatten()
                .for_each(|p| p.y = -p.y);
        }),
        ("unit-mismatch", "millimeters as meters", false, |r, _| {
            scale_all(r, 1e3)
        }),
        ("unit-mismatch", "meters as millimeters", false, |r, _| {
            scale_all(r, 1e-3)
        }),
        ("unit-mismatch", "degrees as radians", false, |r, _| {
            joint(r, "roll")
                .iter_mut()
                .flatten()
                .for_each(|q| *q = q.to_degrees())
        }),
        ("unit-mismatch", "radians as degrees", false, |r, _| {
            joint(r, "roll")
                .iter_mut()
                .flatten()
                .for_each(|q| *q = q.to_radians())
        }),
        (
            "joint-outside-limits",
            "a joint beyond its limit",
            false,
            |r, rng| joint(r, "roll")[rng.random_range(0..36)] = Some(1.7),
        ),
        (
            "joint-never-moved",
            "a joint's column stands still",
            false,
            |r, _| joint(r, "waist").iter_mut().for_each(|q| *q = Some(0.4)),
        ),
        (
            "joint-duplicate",
            "a joint's column twice",
            false,
            |r, _| {
                let copy = joint(r, "waist").clone();
                *joint(r, "roll") = copy;
            },
        ),
        (
            "joint-rounded",
            "a joint in tenths of a degree",
            true,
            |r, _| {
                for q in joint(r, "waist").iter_mut().flatten() {
                    *q = ((q.to_degrees() * 10.0).round() / 10.0).to_radians();
                }
            },
        ),
        ("coverage", "half of the range", false, |r, _| {
            let kept: Vec<usize> = (0..36).filter(|&i| r.q[i][0] > 0.0).collect();
            r.poses = r.poses.select(&kept);
        }),
        ("too-few-poses", "ten poses", false, |r, _| {
            r.poses = r.poses.select(&(0..10).collect::<Vec<_>>())
        }),
        (
            "missing-marker",
            "a marker of another name",
            false,
            |r, _| {
                let track = r.poses.markers.remove("hand_1").expect("recorded");
                r.poses.markers.insert("hand1".to_string(), track);
            },
        ),
        (
            "many-lost",
            "a marker hidden most of the time",
            false,
            |r, _| {
                marker(r, "hand_1")
                    .iter_mut()
                    .take(20)
                    .for_each(|p| *p = None)
            },
        ),
        ("not-unit-rotation", "quaternions scaled", false, |r, _| {
            for pose in r
                .poses
                .bodies
                .get_mut("tool")
                .expect("recorded")
                .iter_mut()
                .flatten()
            {
                pose.rotation = UnitQuaternion::new_unchecked(pose.rotation.into_inner() * 1.01);
            }
        }),
        (
            "body-flip",
            "half a turn on the spot for 20 samples",
            true,
            |r, rng| {
                let row = rng.random_range(10..270);
                let half = UnitQuaternion::from_scaled_axis(Vector3::z() * std::f64::consts::PI);
                r.poses.bodies.get_mut("tool").expect("recorded")[row..row + 20]
                    .iter_mut()
                    .flatten()
                    .for_each(|pose| pose.rotation *= half);
            },
        ),
        ("jump", "one sample 30 mm off", true, |r, rng| {
            let row = rng.random_range(1..299);
            let point = marker(r, "hand_1")[row].as_mut().expect("seen");
            *point += Vector3::new(0.03, 0.0, 0.0);
        }),
        ("time-gap", "five frames dropped", true, |r, rng| {
            let row = rng.random_range(1..290);
            r.poses = r.poses.select(
                &(0..300)
                    .filter(|i| !(row..row + 5).contains(i))
                    .collect::<Vec<_>>(),
            );
        }),
        (
            "rows-repeated",
            "the first 5 rows pasted again",
            false,
            |r, _| {
                let twice: Vec<usize> = (0..36).chain(0..5).collect();
                r.poses = r.poses.select(&twice);
            },
        ),
        ("unsettled-rows", "a hold in motion", true, |r, rng| {
            let row = rng.random_range(0..280);
            let label = |i: usize| {
                if (row..row + 15).contains(&i) {
                    "h1".to_string()
                } else {
                    String::new()
                }
            };
            r.poses
                .labels
                .insert("hold".to_string(), (0..300).map(label).collect());
        }),
    ]
}

/// Holds at rest of a tracker that writes 0.1 or 0.01 mm and is much better than that; and one in motion by ten steps.
#[test]
fn rounding_does_not_unsettle_the_rows_of_a_hold() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for step in [1e-3, 1e-4, 1e-5] {
        for moving in [false, true] {
            let expected = Expectations {
                marker_sigma: Some(0.02 * step),
                ..Expectations::default()
            };
            let mut point = |i: usize| {
                let drift = if moving && i < 15 {
                    10.0 * step * i as f64 / 14.0
                } else {
                    0.0
                };
                let at = |x: f64| {
                    let noise: f64 = rng.sample(StandardNormal);
                    ((x + 0.02 * step * noise + 0.5 * step + drift) / step).round() * step
                };
                Some(Point3::from([0.1, 0.2, 0.3].map(at)))
            };
            let poses = Poses {
                rows: (0..30).collect(),
                markers: [("m".to_string(), (0..30).map(&mut point).collect())].into(),
                labels: [(
                    "hold".to_string(),
                    (0..30).map(|i| format!("{}", i / 15)).collect(),
                )]
                .into(),
                ..Poses::default()
            };
            let said = checks(&poses, &expected);
            let said: Vec<_> = said
                .iter()
                .filter(|f| f.id == catalog::UNSETTLED_ROWS)
                .collect();
            assert_eq!(
                said.len(),
                usize::from(moving),
                "{step} {moving}: {said:#?}"
            );
        }
    }
}

#[test]
fn clean_recordings_are_silent() {
    let mut alarms: Vec<Finding> = Vec::new();
    for seed in 0..4 * SEEDS {
        let Recorded {
            poses, expected, ..
        } = record(1000 + seed, seed % 4 == 0);
        alarms.extend(checks(&poses, &expected));
    }
    assert!(alarms.is_empty(), "{alarms:#?}");
}

#[test]
fn a_body_in_another_unit_than_the_others_is_named() {
    for seed in 0..SEEDS {
        let mut recorded = record(3000 + seed, false);
        let track = recorded.poses.bodies.get_mut("tool").expect("recorded");
        for pose in track.iter_mut().flatten() {
            pose.translation.vector *= 1e3;
        }
        let found = checks(&recorded.poses, &recorded.expected);
        let of_units: Vec<&Finding> = found
            .iter()
            .filter(|f| f.id == catalog::UNIT_MISMATCH)
            .collect();
        assert_eq!(of_units.len(), 1, "{found:#?}");
        let text = of_units[0].text();
        assert!(
            text.starts_with("The positions of tool spread over"),
            "{text}"
        );
    }
}

pub fn recorded_q(poses: &Poses) -> Vec<[f64; 3]> {
    (0..poses.len())
        .map(|i| JOINTS.map(|joint| poses.joints[joint][i].expect("recorded")))
        .collect()
}

/// Errors about bodies in a recording whose noise is not stated.
fn errors_about_bodies(mut recorded: Recorded) -> Vec<Finding> {
    recorded.expected.min_poses = 1;
    recorded.expected.marker_sigma = None;
    let mut found = checks(&recorded.poses, &recorded.expected);
    found.retain(|f| f.severity == Severity::Error && matches!(f.subject.about, About::Body(_)));
    found
}

// Power: were 1 in 20 of the bodies called bent, 160 recordings would be silent with probability 3e-4.
#[test]
fn few_poses_are_no_fault_of_a_body() {
    for seed in 0..160 {
        let mut recorded = record(2000 + seed, false);
        let rows: Vec<usize> = (0..36).step_by(7 - seed as usize % 4).collect();
        recorded.poses = recorded.poses.select(&rows);
        let found = errors_about_bodies(recorded);
        assert!(found.is_empty(), "{seed}: {} rows, {found:?}", rows.len());
    }
}

#[test]
fn gross_outliers_in_a_tenth_of_the_samples_are_no_fault_of_a_body() {
    for seed in 0..60 {
        let mut recorded = record(3000 + seed, false);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for track in recorded.poses.markers.values_mut() {
            for point in track.iter_mut().flatten() {
                if rng.random_bool(0.1) {
                    *point += Vector3::from_fn(|_, _| 0.03 * normal(&mut rng));
                }
            }
        }
        let found = errors_about_bodies(recorded);
        assert!(found.is_empty(), "{seed}: {found:?}");
    }
}

#[test]
fn held_out_rows_of_the_fit_are_found() {
    let training = record(1, false).poses;
    let other = record(2, false).poses;
    let shifted = |mut poses: Poses| {
        poses
            .joints
            .values_mut()
            .flatten()
            .flatten()
            .for_each(|q| *q += 0.02);
        poses
    };
    assert!(held_out_in_training(&shifted(other.clone()), &training).is_none());
    let repeated = held_out_in_training(&other.select(&[0, 5]), &training).expect("same grid");
    assert_eq!(
        (repeated.severity, repeated.rows.len()),
        (Severity::Warning, 2)
    );
    let same = held_out_in_training(&training.select(&[4]), &training).expect("same data");
    assert_eq!((same.severity, same.rows), (Severity::Error, vec![6]));
}

#[test]
fn nothing_known_and_nothing_recorded_is_no_panic() {
    assert!(checks(&Poses::default(), &Expectations::default()).is_empty());
    let Recorded {
        mut poses,
        expected,
        ..
    } = record(0, true);
    poses
        .markers
        .values_mut()
        .for_each(|track| track.fill(None));
    poses.bodies.values_mut().for_each(|track| track.fill(None));
    poses.joints.values_mut().for_each(|q| q.fill(None));
    let ids: Vec<&str> = checks(&poses, &expected)
        .iter()
        .map(|finding| finding.id.as_str())
        .collect();
    assert!(
        ids.contains(&"too-few-poses")
            && ids.contains(&"many-lost")
            && ids.contains(&"joint-never-moved"),
        "{ids:?}"
    );
}

/// As recorded live: rows only while the robot stands still, a step of all joints and of time from each hold to the next.
#[test]
fn holds_that_are_named_are_neither_jumps_nor_gaps() {
    let Recorded {
        poses, expected, ..
    } = record(3, false);
    let each = |i: &usize| std::iter::repeat_n(*i, 5);
    let rows: Vec<usize> = (0..36).collect::<Vec<_>>().iter().flat_map(each).collect();
    let mut live = poses.select(&rows);
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for point in live.markers.values_mut().flatten().flatten() {
        *point += Vector3::from_fn(|_, _| SIGMA * normal(&mut rng));
    }
    for pose in live.bodies.values_mut().flatten().flatten() {
        pose.translation.vector += Vector3::from_fn(|_, _| SIGMA * normal(&mut rng));
    }
    let time = |i: usize| (i / 5) as f64 * 4.0 + (i % 5) as f64 * 0.01;
    live.t = Some((0..180).map(time).collect());
    let ids = |poses: &Poses| -> Vec<&str> {
        checks(poses, &expected)
            .iter()
            .map(|f| f.id.as_str())
            .collect()
    };
    // The joints moved as far: no marker jumped.
    assert_eq!(ids(&live), ["time-gap"]);
    let names = (0..180).map(|i| (i / 5 + 1).to_string()).collect();
    live.labels.insert("hold".to_string(), names);
    assert_eq!(ids(&live), [""; 0]);
}

#[test]
fn every_outcome_of_an_alignment_is_said() {
    use calib_checks::sync::{ClockMap, OffsetOutcome};
    let map = ClockMap {
        offset: 3.9,
        drift: 5e-5,
        reference: 0.0,
        offset_sigma: 2e-4,
        drift_sigma: 1e-6,
        correlation: 0.99,
        second: 0.3,
    };
    let lag = alignment(&OffsetOutcome::Found(map), 1e-3).expect("3.9 s");
    assert_eq!(
        lag.text(),
        "The tracker's clock is 3900.00 ± 0.20 ms ahead of the robot's and runs 50.0 ± 1.0 ppm faster."
    );
    assert!(
        alignment(
            &OffsetOutcome::Found(ClockMap {
                offset: 5e-4,
                ..map
            }),
            1e-3
        )
        .is_none()
    );
    for outcome in [
        OffsetOutcome::TooShort,
        OffsetOutcome::NoMatch {
            correlation: 0.2,
            needed: 0.6,
        },
        OffsetOutcome::NotExcited {
            deviation: 0.0,
            needed: 0.02,
        },
        OffsetOutcome::Ambiguous {
            first: 1.0,
            second: 2.0,
            ratio: 0.97,
        },
    ] {
        assert_eq!(
            alignment(&outcome, 1e-3).map(|f| f.severity),
            Some(Severity::Error)
        );
    }
}

#[test]
fn the_up_axis_is_compared_with_the_robots_base() {
    let y_up = Isometry3::rotation(Vector3::x() * -std::f64::consts::FRAC_PI_2)
        * Isometry3::rotation(Vector3::z() * 0.7);
    assert!(up_axis("+Y", &y_up, 0.2).is_none() && up_axis("elsewhere", &y_up, 0.2).is_none());
    let wrong = up_axis("+Z", &y_up, 0.2).expect("a quarter turn");
    let off = wrong
        .facts
        .get("off")
        .and_then(Fact::value)
        .expect("an angle");
    assert!((off - std::f64::consts::FRAC_PI_2).abs() < 1e-9, "{off}");
    assert_eq!(wrong.facts.get("nearest"), Some(&Fact::choice("+Y")));
}
