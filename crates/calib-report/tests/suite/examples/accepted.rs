//! A report in which every limit is met.

use super::{
    Draw, JOINTS, LIMITS_DEG, covariance, frames, held_out_poses, inputs, judged, residual_rows,
    standardized,
};
use calib_finding::{About, Fact, Finding, Subject, catalog};
use calib_report::{
    AccuracyLimit, Change, Class, Clock, ClockCheck, DhTable, DhTableRow, DhValue, ErrorSource,
    EstimatorResult, FitEnd, FitSummary, HeldOut, JointCoverage, Limit, Limited, LoopClosure, Lost,
    Method, Noise, NoiseKind, Outcome, Output, Parameter, RecordingSummary, RecordingUse, Rejected,
    RejectedFor, Report, Residuals, Stats, Status, Transform, Unit, Unobservable, Verification,
    Workspace, WorkspacePoint,
};
use nalgebra::{Isometry3, Vector3};

/// One row of a chain of two joints.
fn dh_table() -> DhTable {
    let value = |parameter: &str, unit, nominal, value, sigma, measured| DhValue {
        parameter: parameter.into(),
        unit,
        nominal,
        value,
        sigma: Some(sigma),
        measured,
    };
    DhTable {
        root: "base".into(),
        link: "gripper".into(),
        last_joint: "elbow".into(),
        rows: vec![DhTableRow {
            joint: "shoulder".into(),
            values: vec![
                value("theta", Unit::Radian, 0.0, -0.0123, 0.000_31, false),
                value("a", Unit::Meter, 0.27, 0.270_07, 0.000_04, true),
                value("alpha", Unit::Radian, 0.0, 0.000_5, 0.000_2, true),
                value("beta", Unit::Radian, 0.0, -0.001_2, 0.000_2, true),
            ],
        }],
        root_from_first: [[0.0, 0.0, 0.4, 0.0, 0.0, 0.0]; 2],
        last_from_link: [[0.3, 0.0, 0.0, 0.0, 1.2, 0.0]; 2],
    }
}

/// Every limit is met; one origin is only observable as a line, as the profile expects.
pub fn accepted() -> Report {
    let mut draw = Draw::new(3);
    let held_out = HeldOut::from_poses(
        "position of gripM",
        held_out_poses().into_iter().map(|pose| pose.1).collect(),
    );
    let calibrated = held_out.calibrated.expect("ten poses");
    let expected = held_out.expected.expect("ten poses");
    let limits = vec![Limit::compared(
        Limited::position_rms(false),
        0.005,
        calibrated.rms_m,
        Some((expected.low_m, expected.high_m)),
    )];
    let judgment = judged(&limits, Some(&held_out), FitEnd::Converged);
    let parent_from_child = |x: f64, y: f64, z: f64, yaw: f64| {
        Isometry3::new(Vector3::new(x, y, z), Vector3::z() * yaw)
    };
    let slide = Unobservable {
        direction: [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        text: "translation along the axis of wrist_roll: one rotating axis determines a line, not a point".into(),
        remedy: "None needed: the profile chose the point nearest to the body. To determine a point, sweep wrist_pitch as well.".into(),
    };
    let change =
        |joint: &str, what: &str, unit: Unit, old: f64, delta: f64, sigma: f64, share: f64| {
            Change {
                joint: joint.into(),
                what: what.into(),
                unit,
                old: Some(old),
                new: old + delta,
                delta: Some(delta),
                sigma: Some(sigma),
                data_share: Some(share),
            }
        };
    let changes = vec![
        change(
            "shoulder",
            "zero offset",
            Unit::Radian,
            0.0,
            0.006_03,
            0.000_09,
            0.9999,
        ),
        change(
            "elbow",
            "origin z",
            Unit::Meter,
            0.375,
            0.002_91,
            0.000_052,
            0.997,
        ),
        change(
            "elbow",
            "zero offset",
            Unit::Radian,
            0.0,
            -0.004_08,
            0.000_11,
            0.999,
        ),
        change(
            "wrist_pitch",
            "origin x",
            Unit::Meter,
            0.0,
            0.001_97,
            0.000_061,
            0.996,
        ),
        change(
            "wrist_pitch",
            "zero offset",
            Unit::Radian,
            0.0,
            0.007_9,
            0.000_2,
            0.998,
        ),
        change(
            "wrist_roll",
            "origin z",
            Unit::Meter,
            0.042,
            0.000_000_2,
            0.009_8,
            0.04,
        ),
    ];
    let parameters = changes
        .iter()
        .map(|change| Parameter {
            name: format!("{}.{}", change.joint, change.what.replace(' ', ".")),
            joint: Some(change.joint.clone()),
            kind: if change.what == "zero offset" {
                "joint_offset".into()
            } else {
                "origin".into()
            },
            unit: change.unit,
            nominal: change.old.unwrap_or(0.0),
            value: change.new,
            sigma: change.sigma,
            sigma_cluster_robust: change.sigma.map(|s| 1.04 * s),
            data_share: change.data_share,
            class: if change.data_share > Some(0.9) {
                Class::Solid
            } else {
                Class::Prior
            },
        })
        .collect();
    let sweeps: Vec<[f64; 5]> = (0..40).map(|_| draw.pose()).collect();
    let coverage = (0..5)
        .filter_map(|i| {
            let (lower, upper) = LIMITS_DEG[i];
            let positions: Vec<f64> = sweeps.iter().map(|q| q[i]).collect();
            JointCoverage::of(
                JOINTS[i],
                Unit::Radian,
                Some((lower.to_radians(), upper.to_radians())),
                &positions,
            )
        })
        .collect();
    let places = (0..300)
        .map(|_| {
            let tool =
                frames(&draw.pose(), 1.0)[6].translation.vector - Vector3::new(0.4, -0.2, 0.72);
            WorkspacePoint {
                position_m: tool.into(),
                sigma_m: 0.000_12 + 0.000_35 * tool.norm_squared(),
            }
        })
        .collect();
    let estimator =
        |name: &str, value: [f64; 3], sigma: f64, agrees: bool, text: &str| EstimatorResult {
            quantity: "base center in linkM".into(),
            estimator: name.into(),
            value: Some(value.into()),
            sigma: Some(vec![sigma; 3]),
            agrees,
            unit: Unit::Meter,
            distance: Some((value[0] - 0.0213).abs()),
            text: text.into(),
        };
    Report {
        profile: "robots/ripley.yaml".into(),
        robot: "ripley".into(),
        method: Method::Ml,
        scope: vec![
            "Position of gripM, within the recorded joint ranges.".into(),
            "No load: compliance was not modeled.".into(),
        ],
        limits,
        next_steps: vec![
            "Use results/ripley/ripley.calibrated.urdf.".into(),
            "Record five poses with the elbow beyond 120° if the task needs that range.".into(),
        ],
        transforms: vec![
            Transform::new("base", "linkM", "base", &parent_from_child(0.0213, -0.0541, 0.1187, 0.3), Some(&covariance(0.0003, 0.000_05)), Status::Calibrated),
            Transform::new("endJ", "gripM", "endJ", &parent_from_child(-0.0012, 0.0304, -0.0452, -1.2), Some(&covariance(0.0006, 0.000_08)), Status::Calibrated)
                .with_unobservable(vec![slide]),
            Transform::new("table_from_base", "table", "base", &parent_from_child(0.4, -0.2, 0.355, 0.01), None, Status::Measured),
            Transform::new("camera", "gripper", "camera", &parent_from_child(0.05, 0.0, -0.02, 0.0), None, Status::Assumed),
        ],
        parameters,
        changes,
        urdf_diff: "--- ripley/r17.urdf\n+++ ripley.calibrated.urdf\n@@ -41,1 +41,1 @@\n-    <origin xyz=\"0 0 0.375\" rpy=\"0 0 0\"/>\n+    <origin xyz=\"0 0 0.37791\" rpy=\"0 -0.00408 0\"/>\n".into(),
        loops: vec![LoopClosure {
            name: "endJ_in_base".into(),
            samples: 10,
            translation_m: Stats { mean: 0.004_61, std: 0.000_31, max: 0.005_12, rms: 0.004_62 },
            rotation_rad: None,
            norm_error_m: Some(Stats { mean: 0.004_56, std: 0.000_04, max: 0.004_61, rms: 0.004_56 }),
            ..LoopClosure::default()
        }],
        verification: Verification { held_out: Some(held_out), outcome: Outcome::Met, reason: String::new() },
        estimators: vec![
            estimator("ml", [0.0213, -0.0541, 0.1187], 0.000_05, true, ""),
            estimator("sfe", [0.0219, -0.0537, 0.1191], 0.000_42, true, ""),
            estimator("hse", [0.0236, -0.0555, 0.1179], 0.000_31, false, "biased by the orientation noise of the body"),
            EstimatorResult {
                quantity: "endJ center in gripM".into(),
                estimator: "sfe".into(),
                unit: Unit::Meter,
                text: "not observable: one rotating axis".into(),
                ..EstimatorResult::default()
            },
        ],
        fit: Some(FitSummary {
            ended: FitEnd::Converged,
            status: FitEnd::Converged.after(7),
            converged: true,
            iterations: 7,
            observations: 357,
            unknowns: 31,
            chi2_per_dof: Some(1.0612),
            chi2_used_per_dof: Some(1.0),
            stated_noise: vec!["marker".into()],
            cluster_robust_ratio: Some(1.04),
        }),
        dh_table: Some(dh_table()),
        residuals: Residuals::from_rows(&residual_rows()).with_standardized(standardized()),
        noise: vec![
            Noise { group: "marker".into(), kind: NoiseKind::Position, unit: Unit::Meter, sigma: Some(0.000_131), relative_error: Some(0.04), stated: Some(0.000_1), samples: 357, text: "variance components (REML)".into() },
            Noise { group: "joint".into(), kind: NoiseKind::Joint, unit: Unit::Radian, sigma: Some(0.000_31), relative_error: Some(0.09), stated: None, samples: 200, text: "variance components (REML)".into() },
        ],
        clocks: vec![Clock {
            recording: "arm_sweep".into(),
            clock: "tracker".into(),
            against: "joints".into(),
            agrees: Some(true),
            check: ClockCheck::NotNeeded,
            text: ClockCheck::NotNeeded.text().into(),
            ..Clock::default()
        }],
        recordings: vec![
            RecordingSummary {
                name: "arm_sweep".into(),
                path: "ripley/arm_sweep.csv".into(),
                used_for: RecordingUse::Sweep,
                rows: 41,
                used: 40,
                rejected: 1,
                lost: vec![Lost { subject: "gripM_2".into(), lost: 3, of: 41 }],
                ..RecordingSummary::default()
            },
            RecordingSummary { name: "checks".into(), path: "ripley/checks.csv".into(), used_for: RecordingUse::Validation, rows: 10, used: 10, ..RecordingSummary::default() },
        ],
        coverage,
        rejected: vec![
            Rejected::new("arm_sweep", "", vec![23], RejectedFor::NotSettled),
            Rejected::new("arm_sweep", "gripM_1", vec![18], RejectedFor::Swap),
        ],
        workspace: Workspace::of("gripper", "base", places),
        accuracy_limits: vec![
            AccuracyLimit::new(ErrorSource::JointNoise, 0.000_21, 0.62),
            AccuracyLimit::new(ErrorSource::TrackerNoise, 0.000_13, 0.24),
            AccuracyLimit { source: "systematic pattern over the elbow angle".into(), text: "mean residuals per bin".into(), remedy: "Enable the gear eccentricity of the elbow.".into(), ..AccuracyLimit::default() },
        ],
        findings: vec![
            Finding::new(catalog::MARKER_OUTLIER, Subject::body("gripM").in_recording("arm_poses"))
                .with("marker", Fact::name("gripM_1"))
                .with("off", Fact::meters(0.0042))
                .with("rows", Fact::count(1))
                .at_rows([18]),
            Finding::new(catalog::PAPER_ASSUMPTIONS, About::Method),
        ],
        inputs: inputs(),
        outputs: vec![
            Output { path: "ripley.calibrated.urdf".into(), what: "URDF with 6 changed values".into(), sha256: Some("4".repeat(64)), changes: Some("ripley/r17.urdf".into()) },
            Output { path: "ripley.scene.json".into(), what: "scene for the situation model".into(), sha256: Some("5".repeat(64)), changes: None },
            Output { path: "report.json".into(), what: "this report".into(), sha256: None, changes: None },
        ],
        reproduce: vec!["calib run robots/ripley.yaml".into()],
        undo: vec!["calib revert results/ripley/ripley.calibrated.urdf".into()],
        seed: 1,
        version: "0.1.0".into(),
        ..Report::default()
    }
    .judged(judgment)
}
