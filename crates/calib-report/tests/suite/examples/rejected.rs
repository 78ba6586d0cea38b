//! A report that is rejected, with quantities that the data cannot give.

use super::{Draw, inputs, judged};
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_report::{
    Clock, ClockCheck, ErrorStats, FitEnd, HeldOut, JointValue, Limit, Limited, LoopClosure,
    LoopGroup, Method, Noise, NoiseKind, NotObservable, Outcome, PoseError, Rejected, RejectedFor,
    Report, Stats, Status, Term, Transform, Unit, Unobservable, Verification,
};
use nalgebra::Isometry3;

/// The paper's table of five torso positions; the wrist hardly moved, two parameters are confounded.
pub fn rejected() -> Report {
    let mut draw = Draw::new(9);
    let angles = ["0°", "90°", "90° again", "-90°", "90° third"];
    let mut poses = Vec::new();
    let mut groups = Vec::new();
    let mut all = (Vec::new(), Vec::new());
    for angle in angles {
        let bias = if angle == "-90°" { 0.0076 } else { 0.0056 };
        let lengths: Vec<f64> = (0..30)
            .map(|_| (bias + draw.normal(0.0011)).abs())
            .collect();
        let turns: Vec<f64> = (0..30)
            .map(|_| (0.018 + draw.normal(0.005)).abs())
            .collect();
        for (i, length) in lengths.iter().enumerate() {
            poses.push(PoseError {
                pose: format!("torso {angle} hand {}", i + 1),
                group: format!("torso {angle}"),
                joints: vec![
                    JointValue::meters("lift", 0.1),
                    JointValue::radians("arm_1", draw.even()),
                ],
                nominal_m: None,
                registration_only_m: Some(length * 1.1),
                calibrated_m: Some(*length),
                vector_m: None,
                calibrated_rad: Some(0.004 + 0.000_02 * i as f64),
                ..PoseError::default()
            });
        }
        groups.push(LoopGroup {
            name: angle.into(),
            samples: 30,
            translation_m: Stats::of(&lengths).expect("30"),
            rotation_rad: Stats::of(&turns),
        });
        all.0.extend(lengths);
        all.1.extend(turns);
    }
    let held_out = HeldOut::from_poses("TCP from the head", poses);
    let rms = held_out
        .calibrated
        .map_or(f64::NAN, |stats: ErrorStats| stats.rms_m);
    let limits = vec![
        Limit::evaluated(Limited::position_rms(false), 0.004, rms),
        Limited::orientation_max(false).unknown(0.001),
    ];
    let judgment = judged(&limits, Some(&held_out), FitEnd::Converged);
    Report {
        profile: "robots/justin.yaml".into(),
        robot: "justin".into(),
        method: Method::Paper,
        limits,
        next_steps: vec![
            "Move arm_7 over at least 30° and record again.".into(),
            "Choose one of the two offsets in the profile.".into(),
            "Check the rows of torso -90°: the cameras may have been occluded.".into(),
            "Then run the profile again.".into(),
        ],
        transforms: vec![
            Transform::new(
                "hand",
                "haT",
                "hand",
                &Isometry3::translation(0.1, 0.02, -0.04),
                None,
                Status::Calibrated,
            )
            .with_unobservable(vec![Unobservable {
                direction: [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
                text: "rotation about z: arm_7 moved 0.4° in total".into(),
                remedy: "Move arm_7 over at least 30°.".into(),
            }]),
        ],
        not_observable: vec![NotObservable::new(
            calib_report::Cause::ParallelAxes,
            vec![
                Term {
                    parameter: "arm_2.origin.z".into(),
                    coefficient: std::f64::consts::FRAC_1_SQRT_2,
                },
                Term {
                    parameter: "arm_3.origin.z".into(),
                    coefficient: -std::f64::consts::FRAC_1_SQRT_2,
                },
            ],
        )],
        loops: vec![LoopClosure {
            name: "hand_in_head".into(),
            samples: all.0.len(),
            translation_m: Stats::of(&all.0).expect("150"),
            rotation_rad: Stats::of(&all.1),
            norm_error_m: None,
            groups,
            grouped_by: "torso angle".into(),
        }],
        verification: Verification {
            held_out: Some(held_out),
            outcome: Outcome::Exceeded,
            reason: String::new(),
        },
        clocks: vec![Clock {
            recording: "hand_sweep".into(),
            clock: "tracker".into(),
            against: "joints".into(),
            check: ClockCheck::Aligned,
            offset_s: Some(0.0213),
            sigma_s: Some(0.0008),
            drift: None,
            drift_sigma: None,
            agrees: Some(false),
            text: "rows with motion were rejected".into(),
        }],
        noise: vec![Noise {
            group: "body orientation".into(),
            kind: NoiseKind::Orientation,
            unit: Unit::Radian,
            sigma: None,
            relative_error: None,
            stated: Some(0.002),
            samples: 0,
            text: "the closed forms do not estimate it".into(),
        }],
        rejected: vec![Rejected::new(
            "hand_sweep",
            "haT",
            (3..=20).collect(),
            RejectedFor::OnTheWay,
        )],
        findings: vec![
            Finding::of_kind(catalog::JOINT_NEVER_MOVED, "still", Subject::joint("arm_7"))
                .with("at", Fact::radians(0.007)),
        ],
        inputs: inputs(),
        reproduce: vec!["calib run robots/justin.yaml".into()],
        version: "0.1.0".into(),
        ..Report::default()
    }
    .judged(judgment)
}
