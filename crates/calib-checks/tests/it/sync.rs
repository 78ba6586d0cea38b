//! Holds and clock offsets.

use calib_checks::sync::{
    ClockMap, HoldSettings, LinkTrack, OffsetOutcome, OffsetSettings, PointTrack, RotationTrack,
    clock_offset, clock_offset_of_point, holds, static_poses,
};
use calib_recording::{JointUnit, Poses};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn noise(rng: &mut ChaCha8Rng, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| {
        let z: f64 = StandardNormal.sample(rng);
        z * sigma
    })
}

/// An arm's irregular motion: three joints, sums of incommensurate sines.
fn link(t: f64, seed: f64) -> UnitQuaternion<f64> {
    let q = |k: f64| {
        0.5 * (0.7 * k * t + seed).sin()
            + 0.4 * (1.13 * k * t + 2.0 * seed).sin()
            + 0.2 * (0.31 * k * t * (1.0 + 0.004 * t)).sin()
    };
    UnitQuaternion::from_scaled_axis(Vector3::z() * q(1.0))
        * UnitQuaternion::from_scaled_axis(Vector3::y() * q(1.37))
        * UnitQuaternion::from_scaled_axis(Vector3::x() * q(0.83))
}

/// Tracker at 100 Hz with 0.06° of noise against encoders at 125 Hz, `t_a = t_b + offset + drift·(t_b − 30)`.
fn tracks(
    offset: f64,
    drift: f64,
    seed: u64,
    motion: &dyn Fn(f64) -> UnitQuaternion<f64>,
) -> (RotationTrack, RotationTrack) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mount = UnitQuaternion::from_euler_angles(0.3, -0.8, 1.1);
    let world = UnitQuaternion::from_euler_angles(-0.2, 0.5, 2.0);
    let a = (0..6000).map(|i| {
        let t_b = f64::from(i) * 0.01;
        let t_a = t_b + offset + drift * (t_b - 30.0);
        let seen =
            world * motion(t_b) * mount * UnitQuaternion::from_scaled_axis(noise(&mut rng, 1e-3));
        (t_a, (rng.random::<f64>() > 0.02).then_some(seen))
    });
    let a = RotationTrack::new(a.collect::<Vec<_>>());
    let b = RotationTrack::new((0..7500).map(|i| {
        let t = f64::from(i) * 0.008 + 0.0013;
        (t, Some(motion(t)))
    }));
    (a, b)
}

#[test]
fn offset_and_drift_are_found_within_two_milliseconds() {
    let mut worst = 0.0f64;
    let mut squares = 0.0;
    for seed in 0..12 {
        let (offset, drift) = (3.9 - 0.61 * seed as f64, 50e-6);
        let (a, b) = tracks(offset, drift, seed, &|t| link(t, seed as f64));
        let OffsetOutcome::Found(map) = clock_offset(&a, &b, &OffsetSettings::default()) else {
            panic!("seed {seed}")
        };
        for t_b in [0.0, 20.0, 40.0, 60.0] {
            let truth = t_b + offset + drift * (t_b - 30.0);
            worst = worst.max((map.to_a(t_b) - truth).abs());
            assert!((map.to_b(map.to_a(t_b)) - t_b).abs() < 1e-9);
        }
        let at_30 = map.to_a(30.0) - 30.0 - offset;
        squares += (at_30 / map.offset_sigma).powi(2) / 12.0;
        assert!(
            (map.drift - drift).abs() < 5.0 * map.drift_sigma + 1e-6,
            "{map:?}"
        );
    }
    println!("worst {:.3} ms, mean (error/σ)² {squares:.2}", worst * 1e3);
    assert!(worst < 2e-3, "{worst} s");
    assert!(
        (0.2..3.0).contains(&squares),
        "σ is wrong by a factor {}",
        squares.sqrt()
    );
}

/// Six joints at angles of slow sines, with errors of `crooked` rad in every axis and 10 `crooked` m in every link.
fn arm(t: f64, seed: u64, crooked: f64) -> Isometry3<f64> {
    let mut motion = ChaCha8Rng::seed_from_u64(seed);
    let mut errors = ChaCha8Rng::seed_from_u64(seed + 1000);
    let mut pose = Isometry3::identity();
    for j in 0..6 {
        let mut q = 0.0;
        for _ in 0..3 {
            let rate = std::f64::consts::TAU * motion.random_range(0.02..0.12);
            q += 0.5 * (rate * t + motion.random_range(0.0..std::f64::consts::TAU)).sin();
        }
        let wrong = noise(&mut errors, crooked);
        let axis = [Vector3::z(), Vector3::y(), Vector3::y(), Vector3::x()][j % 4] + wrong;
        let turn = UnitQuaternion::from_scaled_axis(axis.normalize() * q);
        let along = Vector3::new(0.05, 0.0, 0.3) + noise(&mut errors, 0.1 * crooked);
        pose *= Isometry3::from_parts(along.into(), turn);
    }
    pose
}

const POINT_OFFSET: f64 = 3.7;
const POINT_DRIFT: f64 = 40e-6;

/// One marker on a crooked arm, 50 Hz for 60 s, moving or in holds of 1.5 s, and the straight arm's link; the same of turns.
fn seen_and_nominal(
    seed: u64,
    held: bool,
) -> (PointTrack, LinkTrack, RotationTrack, RotationTrack) {
    seen_and_nominal_at(seed, &|t: f64| {
        let (hold, part) = ((t / 3.0).floor(), (t / 3.0).fract());
        let way = ((part - 0.5) / 0.5).clamp(0.0, 1.0);
        if held {
            9.0 * (hold + way * way * (3.0 - 2.0 * way))
        } else {
            t
        }
    })
}

/// The same where the arm is at `when(t)` of its motion at `t`.
fn seen_and_nominal_at(
    seed: u64,
    when: &dyn Fn(f64) -> f64,
) -> (PointTrack, LinkTrack, RotationTrack, RotationTrack) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 2000);
    let world = Isometry3::new(Vector3::new(1.2, -0.4, 0.9), Vector3::new(0.3, -1.0, 2.0));
    let times: Vec<f64> = (0..3000).map(|i| f64::from(i) * 0.02).collect();
    let tracker = |t: f64| t + POINT_OFFSET + POINT_DRIFT * (t - 29.99);
    let seen: Vec<(f64, Point3<f64>, UnitQuaternion<f64>)> = times
        .iter()
        .map(|&t| {
            let pose = world * arm(when(t), seed, 0.005);
            let point = pose * Point3::new(0.03, 0.05, 0.02) + noise(&mut rng, 2e-4);
            let turn = UnitQuaternion::from_scaled_axis(noise(&mut rng, 1e-3));
            (tracker(t), point, pose.rotation * turn)
        })
        .collect();
    let link: Vec<(f64, Isometry3<f64>)> = times
        .iter()
        .map(|&t| (t, arm(when(t), seed, 0.0)))
        .collect();
    (
        PointTrack::new(seen.iter().map(|s| (s.0, Some(s.1)))),
        LinkTrack::new(link.iter().map(|l| (l.0, Some(l.1)))),
        RotationTrack::new(seen.iter().map(|s| (s.0, Some(s.2)))),
        RotationTrack::new(link.iter().map(|l| (l.0, Some(l.1.rotation)))),
    )
}

/// Errors of an estimate in units of its σ at the middle, and of its drift.
fn in_sigma(map: &ClockMap) -> [f64; 2] {
    let at = map.to_a(map.reference) - map.reference - POINT_OFFSET;
    [
        at / map.offset_sigma,
        (map.drift - POINT_DRIFT) / map.drift_sigma,
    ]
}

#[test]
fn a_stated_sigma_covers_the_truth_on_a_robot_with_nominal_errors() {
    let (mut covered, mut all, mut squares) = (0, 0, 0.0);
    for seed in 0..20 {
        for held in [false, true] {
            let (point, link, turns, of_link) = seen_and_nominal(seed, held);
            let settings = OffsetSettings::default();
            let found = [
                clock_offset_of_point(&point, &link, &settings),
                clock_offset(&turns, &of_link, &settings),
            ];
            for outcome in found {
                let OffsetOutcome::Found(map) = outcome else {
                    panic!("seed {seed}, held {held}: {outcome:?}")
                };
                assert!((map.offset - POINT_OFFSET).abs() < 0.02, "{map:?}");
                println!(
                    "seed {seed}, held {held}: {:.2?} σ of {:.2} ms",
                    in_sigma(&map),
                    map.offset_sigma * 1e3
                );
                for z in in_sigma(&map) {
                    all += 1;
                    squares += z * z;
                    covered += i32::from(z.abs() < 2.0);
                }
            }
        }
    }
    println!(
        "{covered} of {all} within 2 σ, rms {:.2} σ",
        (squares / f64::from(all)).sqrt()
    );
    // 95 % less three standard deviations of a count.
    assert!(
        f64::from(covered) > 0.9 * f64::from(all),
        "{covered} of {all}"
    );
    assert!(squares > 0.2 * f64::from(all), "σ is much too large");
}

/// A third of the speed, and offsets up to half of the recording: thirteen free numbers explain such a motion at any of them.
#[test]
fn a_slow_motion_is_like_another_one_only_where_it_may_bend() {
    let settings = OffsetSettings {
        max_offset: 40.0,
        ..OffsetSettings::default()
    };
    for seed in 0..12 {
        let (point, link, _, _) = seen_and_nominal_at(seed, &|t| 0.3 * t);
        let outcome = clock_offset_of_point(&point, &link, &settings);
        let OffsetOutcome::Found(map) = outcome else {
            panic!("seed {seed}: {outcome:?}")
        };
        let [offset, _] = in_sigma(&map);
        println!(
            "seed {seed}: {offset:.2} σ of {:.2} ms",
            map.offset_sigma * 1e3
        );
        assert!((map.offset - POINT_OFFSET).abs() < 0.1, "{seed}: {map:?}");
        assert!(
            offset.abs() < 5.0 && map.offset_sigma < 0.05,
            "{seed}: {map:?}"
        );
    }
}

#[test]
fn a_marker_of_another_motion_or_at_rest_is_refused() {
    let settings = OffsetSettings::default();
    for seed in 0..4 {
        let (point, _, _, _) = seen_and_nominal(seed, false);
        let (_, link, _, _) = seen_and_nominal(seed + 50, false);
        let outcome = clock_offset_of_point(&point, &link, &settings);
        assert!(
            matches!(
                outcome,
                OffsetOutcome::NoMatch { .. } | OffsetOutcome::Ambiguous { .. }
            ),
            "seed {seed}: {outcome:?}"
        );
        let still =
            PointTrack::new((0..500).map(|i| (f64::from(i) * 0.02, Some(Point3::origin()))));
        let outcome = clock_offset_of_point(&still, &link, &settings);
        assert!(
            matches!(outcome, OffsetOutcome::NotMoved { .. }),
            "{outcome:?}"
        );
        let short = PointTrack::new((0..20).map(|i| (f64::from(i), Some(Point3::origin()))));
        let outcome = clock_offset_of_point(&short, &link, &settings);
        assert_eq!(outcome, OffsetOutcome::TooShort);
    }
}

#[test]
fn periodic_motion_is_refused() {
    let (a, b) = tracks(1.3, 0.0, 1, &|t| {
        UnitQuaternion::from_scaled_axis(Vector3::z() * (1.5 * t).sin())
    });
    let outcome = clock_offset(&a, &b, &OffsetSettings::default());
    assert!(
        matches!(outcome, OffsetOutcome::Ambiguous { ratio, .. } if ratio > 0.9),
        "{outcome:?}"
    );
}

/// A robot's script: it turns for a second and rests for 1.2 s, again and again, by another angle each time.
#[test]
fn postures_at_equal_intervals_are_no_periodic_motion() {
    const EVERY: f64 = 2.2;
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let turns: Vec<f64> = (0..40).map(|_| rng.random_range(0.6..1.4)).collect();
    let ends: Vec<f64> = turns
        .iter()
        .scan(0.0, |sum, turn| {
            *sum += turn;
            Some(*sum)
        })
        .collect();
    let motion = |t: f64| {
        let k = (t / EVERY).floor().max(0.0) as usize;
        // Smooth from one posture to the next.
        let x = (t - k as f64 * EVERY).clamp(0.0, 1.0);
        let angle = ends[k] - turns[k] * (1.0 - x * x * (3.0 - 2.0 * x));
        UnitQuaternion::from_scaled_axis(Vector3::z() * angle)
    };
    for seed in 0..4 {
        let offset = 1.3 - f64::from(seed);
        let (a, b) = tracks(offset, 0.0, u64::from(seed as u8), &motion);
        let outcome = clock_offset(&a, &b, &OffsetSettings::default());
        let OffsetOutcome::Found(map) = outcome else {
            panic!("{seed}: {outcome:?}")
        };
        assert!(map.second > 0.9, "{seed}: {map:?}");
        let off = map.to_a(30.0) - 30.0 - offset;
        assert!(
            off.abs() < 4.0 * map.offset_sigma.max(1e-3),
            "{seed}: {map:?}"
        );
    }
}

#[test]
fn what_cannot_be_aligned_is_said() {
    let still = |_: f64| UnitQuaternion::identity();
    let (a, b) = tracks(1.0, 0.0, 2, &still);
    assert!(matches!(
        clock_offset(&a, &b, &OffsetSettings::default()),
        OffsetOutcome::NotExcited { .. }
    ));
    let (a, _) = tracks(1.0, 0.0, 3, &|t| link(t, 1.0));
    let (_, b) = tracks(1.0, 0.0, 3, &|t| link(5.0 + 0.77 * t, 9.0));
    assert!(matches!(
        clock_offset(&a, &b, &OffsetSettings::default()),
        OffsetOutcome::NoMatch { .. }
    ));
    let short = RotationTrack::new((0..20).map(|i| (f64::from(i), Some(link(f64::from(i), 0.0)))));
    assert_eq!(
        clock_offset(&short, &b, &OffsetSettings::default()),
        OffsetOutcome::TooShort
    );
    assert_eq!(
        clock_offset(&RotationTrack::default(), &b, &OffsetSettings::default()),
        OffsetOutcome::TooShort
    );
    // An offset outside the range looked at.
    let (a, b) = tracks(40.0, 0.0, 4, &|t| link(t, 1.0));
    assert!(!matches!(
        clock_offset(&a, &b, &OffsetSettings::default()),
        OffsetOutcome::Found(_)
    ));
}

/// Five holds of 1.5 s with moves of 1 s between, 100 Hz.
fn stop_and_go(drift: f64) -> Poses {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let angle = |t: f64| {
        let (k, s) = ((t / 2.5).floor(), t % 2.5);
        0.2 * (k + (s - 1.5).clamp(0.0, 1.0))
    };
    let n = 1250;
    let t: Vec<f64> = (0..n).map(|i| f64::from(i) * 0.01).collect();
    let pose = |t: f64| Isometry3::rotation(Vector3::z() * angle(t));
    let track: Vec<Isometry3<f64>> = t
        .iter()
        .map(|&t| {
            pose(t)
                * Isometry3::new(
                    Vector3::new(0.5, 0.0, 0.2) + Vector3::y() * drift * t,
                    Vector3::zeros(),
                )
        })
        .collect();
    Poses {
        rows: (0..n as u64).collect(),
        joints: [("q".to_string(), t.iter().map(|&t| Some(angle(t))).collect())].into(),
        joint_units: [("q".to_string(), JointUnit::Angle)].into(),
        bodies: [(
            "hand".to_string(),
            track
                .iter()
                .map(|p| Some(p * Isometry3::new(noise(&mut rng, 5e-5), noise(&mut rng, 5e-4))))
                .collect(),
        )]
        .into(),
        markers: [(
            "m".to_string(),
            track
                .iter()
                .map(|p| Some(p * Point3::new(0.1, 0.0, 0.0) + noise(&mut rng, 5e-5)))
                .collect(),
        )]
        .into(),
        t: Some(t),
        ..Poses::default()
    }
}

#[test]
fn holds_are_found_and_averaged() {
    let poses = stop_and_go(0.0);
    let found = holds(&poses, &HoldSettings::default());
    assert_eq!(found.len(), 5, "{found:?}");
    for (k, hold) in found.iter().enumerate() {
        let start = 2.5 * k as f64;
        assert!(
            hold.span.0 > start + 0.2 && hold.span.1 < start + 1.55,
            "{hold:?}"
        );
    }
    let table = static_poses(&poses, &found);
    assert!(table.findings.is_empty(), "{:?}", table.findings);
    assert_eq!(table.poses.len(), 5);
    for (k, pose) in table.poses.bodies["hand"].iter().enumerate() {
        let expected = Isometry3::rotation(Vector3::z() * 0.2 * k as f64)
            * Isometry3::translation(0.5, 0.0, 0.2);
        let pose = pose.expect("seen");
        assert!((pose.translation.vector - expected.translation.vector).norm() < 5e-5);
        assert!(pose.rotation.angle_to(&expected.rotation) < 5e-4);
        let covariance = table.body_covariance["hand"][k].expect("many samples");
        assert!(
            (covariance[(0, 0)].sqrt() / 5e-4 - 1.0).abs() < 0.4
                && (covariance[(4, 4)].sqrt() / 5e-5 - 1.0).abs() < 0.4
        );
        let marker = table.marker_covariance["m"][k].expect("many samples");
        assert!((marker[(0, 0)].sqrt() / 5e-5 - 1.0).abs() < 0.4);
    }
    assert!(holds(&Poses::default(), &HoldSettings::default()).is_empty());
}

/// Noise of which twenty samples spread over more than the millimeter, or 0.6°, that a quiet tracker stays within: the joints tell that it is rest.
#[test]
fn holds_of_a_noisy_tracker_are_found_and_not_split() {
    for [place, turn] in [[2e-4, 5e-4], [5e-4, 5e-4], [5e-5, 4e-3]] {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut poses = stop_and_go(0.0);
        for pose in poses.bodies.values_mut().flatten().flatten() {
            *pose *= Isometry3::new(noise(&mut rng, place), noise(&mut rng, turn));
        }
        for point in poses.markers.values_mut().flatten().flatten() {
            *point += noise(&mut rng, place);
        }
        let found = holds(&poses, &HoldSettings::default());
        assert_eq!(found.len(), 5, "{place} {turn}: {found:?}");
        for (k, hold) in found.iter().enumerate() {
            let start = 2.5 * k as f64;
            let (first, last) = hold.span;
            assert!(first > start + 0.2 && last < start + 1.6, "{hold:?}");
            assert!(last - first > 0.9, "{hold:?}");
        }
    }
}

/// As recorded live: only rows that stand still, so that nothing but the gap in time, or the column `hold`, tells one
/// hold from the next.
#[test]
fn holds_end_where_rows_are_missing_or_the_table_says_so() {
    let poses = stop_and_go(0.0);
    let settings = HoldSettings::default();
    let all = holds(&poses, &settings);
    let still: Vec<usize> = all.iter().flat_map(|hold| hold.rows.clone()).collect();
    let mut cut = poses.select(&still);
    let found = holds(&cut, &settings);
    assert_eq!(found.len(), all.len(), "{found:?}");
    let average = static_poses(&cut, &found);
    for (a, b) in average.poses.joints["q"].iter().zip(0..) {
        assert!((a.expect("recorded") - 0.2 * f64::from(b)).abs() < 1e-9);
    }
    // Without a gap in the clock, but named.
    let n = cut.len();
    cut.t = Some((0..n).map(|i| i as f64 * 0.01).collect());
    for track in cut.bodies.values_mut() {
        let first = track[0];
        track.fill(first);
    }
    for track in cut.markers.values_mut() {
        let first = track[0];
        track.fill(first);
    }
    cut.joints.values_mut().for_each(|q| q.fill(Some(0.1)));
    assert_eq!(holds(&cut, &settings).len(), 1);
    let names = (0..n).map(|i| (2 * i / n).to_string()).collect();
    cut.labels.insert("hold".to_string(), names);
    assert_eq!(holds(&cut, &settings).len(), 2);
}

#[test]
fn a_hold_that_drifts_is_reported() {
    let poses = stop_and_go(5e-4);
    let found = holds(&poses, &HoldSettings::default());
    let table = static_poses(&poses, &found);
    assert!(
        table
            .findings
            .iter()
            .filter(|f| f.id == calib_finding::catalog::UNSETTLED_ROWS)
            .count()
            >= 5,
        "{:?}",
        table.findings
    );
}

/// Positions written with 3 to 6 decimals of a meter: a robot that stands still is settled whatever its place between two multiples of the
/// step, and one that drifts by several steps is not.
#[test]
fn rounding_steps_neither_unsettle_nor_settle_a_hold() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let trials = 40;
    for decimals in 3..=6 {
        let step = 10f64.powi(-decimals);
        for sigma in [1e-6, 2e-5, 1e-4] {
            let (mut alarms, mut missed, mut found_of) = (0, 0, 0);
            for _ in 0..trials {
                // A place just below the middle of two multiples: the tracker's creep of a fifth of σ moves it over.
                let place = Vector3::new(0.5, 0.1, 0.2) + Vector3::repeat(0.5 * step)
                    - Vector3::repeat(0.1 * sigma);
                let mut recorded = |drift: f64| {
                    let mut point = |i: usize| {
                        let creep = Vector3::repeat((0.2 * sigma + drift) * i as f64 / 149.0);
                        let p = place + creep + noise(&mut rng, sigma);
                        Some(Point3::from(p.map(|x| (x / step).round() * step)))
                    };
                    Poses {
                        rows: (0..150).collect(),
                        t: Some((0..150).map(|i| 0.01 * f64::from(i)).collect()),
                        markers: [("m".to_string(), (0..150).map(&mut point).collect())].into(),
                        ..Poses::default()
                    }
                };
                let still = recorded(0.0);
                let found = holds(&still, &HoldSettings::default());
                found_of += found.len();
                alarms += static_poses(&still, &found).findings.len();
                // Each half of the hold is off the other by half of it along each axis.
                let moving = recorded(8.0 * step + 4.0 * sigma);
                let settings = HoldSettings {
                    point_range: 0.1,
                    ..HoldSettings::default()
                };
                let found = holds(&moving, &settings);
                missed += usize::from(static_poses(&moving, &found).findings.is_empty());
            }
            assert_eq!(found_of, trials, "{decimals} decimals, σ {sigma}: holds");
            assert_eq!(alarms, 0, "{decimals} decimals, σ {sigma}: false alarms");
            assert_eq!(missed, 0, "{decimals} decimals, σ {sigma}: not found");
        }
    }
}
