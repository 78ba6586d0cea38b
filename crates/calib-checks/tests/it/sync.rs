//! Holds and clock offsets.

use calib_checks::sync::{
    HoldSettings, OffsetOutcome, OffsetSettings, RotationTrack, clock_offset, holds, static_poses,
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
