//! Hand-made reports that look like real ones: one accepted, one rejected with quantities that the data cannot give, one not evaluated.
//!
//! The arm is made up (five joints, link lengths of a small table-top robot); the numbers come from a seeded generator, so
//! that the summaries (bins, quantiles, intervals) are consistent with each other.

use calib_finding::{About, Fact, Finding, Subject, catalog};
use calib_report::scene::{Provenance, SceneBody, SceneMarker, SceneObject, SceneRobot, Shape};
use calib_report::view3d::{
    Axis, Circle, Cloud, Outline, Sphere, ViewFrame, ViewMarker, ViewPose, pose_row,
};
use calib_report::{
    AccuracyLimit, Change, Class, Clock, ClockCheck, DhTable, DhTableRow, DhValue, ErrorSource,
    ErrorStats, EstimatorResult, FitEnd, FitSummary, HeldOut, Improvement, Input, JointCoverage,
    JointValue, Judgment, Limit, Limited, LoopClosure, LoopGroup, Lost, Method, Noise, NoiseKind,
    NotObservable, Orientation, Outcome, Output, Parameter, PoseError, RecordingSummary,
    RecordingUse, Rejected, RejectedFor, Report, ResidualRow, Residuals, Scene, Solver,
    Standardized, Stats, Status, Term, Transform, Unit, Unobservable, Validation, Verdict,
    VerdictFacts, Verification, View3d, Workspace, WorkspacePoint, judge, scene::SceneFrame,
};
use nalgebra::{Isometry3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub const JOINTS: [&str; 5] = ["waist", "shoulder", "elbow", "wrist_pitch", "wrist_roll"];
pub const LIMITS_DEG: [(f64, f64); 5] = [
    (-178.0, 178.0),
    (-140.0, 160.0),
    (-150.0, 150.0),
    (-110.0, 110.0),
    (-100.0, 100.0),
];

pub struct Draw(ChaCha8Rng);

impl Draw {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn normal(&mut self, sigma: f64) -> f64 {
        let x: f64 = StandardNormal.sample(&mut self.0);
        sigma * x
    }

    pub fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::new(self.normal(sigma), self.normal(sigma), self.normal(sigma))
    }

    /// Evenly in [−1, 1].
    pub fn even(&mut self) -> f64 {
        rand::RngExt::random_range(&mut self.0, -1.0..1.0)
    }

    pub fn pose(&mut self) -> [f64; 5] {
        std::array::from_fn(|i| {
            let (lower, upper) = LIMITS_DEG[i];
            (0.5 * (lower + upper) + 0.4 * (upper - lower) * self.even()).to_radians()
        })
    }
}

/// Frames of the arm in the world: base, five links, gripper. `error` scales the difference of the real robot from the nominal one.
pub fn frames(q: &[f64; 5], error: f64) -> Vec<Isometry3<f64>> {
    let turn = |axis: Vector3<f64>, angle: f64| {
        Isometry3::from_parts(Translation3::identity(), UnitQuaternion::new(axis * angle))
    };
    let step = |x: f64, z: f64| Isometry3::translation(x, 0.0, z);
    let origins = [
        step(0.0, 0.033),
        step(0.0, 0.322),
        step(0.0, 0.375 + 0.003 * error),
        step(0.002 * error, 0.375),
        step(0.0, 0.042),
    ];
    let axes = [
        Vector3::z(),
        Vector3::y(),
        Vector3::y(),
        Vector3::y(),
        Vector3::z(),
    ];
    let offsets = [0.0, 0.006, -0.004, 0.008, 0.0].map(|offset| offset * error);
    let mut frame = Isometry3::translation(0.4, -0.2, 0.72);
    let mut all = vec![frame];
    for i in 0..5 {
        frame = frame * origins[i] * turn(axes[i], q[i] + offsets[i]);
        all.push(frame);
    }
    all.push(frame * step(0.0, 0.159));
    all
}

pub fn joint_values(q: &[f64; 5]) -> Vec<JointValue> {
    JOINTS
        .iter()
        .zip(q)
        .map(|(joint, value)| JointValue::radians(*joint, *value))
        .collect()
}

pub const MARKERS: [(&str, [f64; 3]); 3] = [
    ("gripM_1", [0.03, 0.02, 0.01]),
    ("gripM_2", [-0.035, 0.015, 0.0]),
    ("gripM_3", [0.0, -0.04, 0.02]),
];

/// Residuals of 40 sweep poses, three markers each, with a systematic pattern over the elbow angle that is not modeled.
pub fn residual_rows() -> Vec<ResidualRow> {
    let mut draw = Draw::new(11);
    let mut rows = Vec::new();
    for pose in 0..40 {
        let q = draw.pose();
        for (marker, (name, _)) in MARKERS.iter().enumerate() {
            let pattern = Vector3::x() * 0.000_15 * (2.0 * q[2]).sin();
            let residual = draw.vector(if marker == 2 { 0.000_25 } else { 0.000_12 }) + pattern;
            rows.push(ResidualRow {
                recording: "arm_sweep".into(),
                row: pose + 1,
                subject: (*name).into(),
                residual_m: residual.into(),
                normalized: Some(residual.norm() / 0.000_2),
                used: !(marker == 0 && pose == 17),
                joints: joint_values(&q),
                ..ResidualRow::default()
            });
        }
    }
    rows
}

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

/// Every component in units of the noise that the example found.
fn standardized() -> Option<Standardized> {
    let rows = residual_rows();
    let used = rows.iter().filter(|row| row.used);
    let components = used.flat_map(|row| row.residual_m.map(|x| x / 0.000_17));
    Standardized::of(&components.collect::<Vec<_>>())
}

fn covariance(sigma_rad: f64, sigma_m: f64) -> Matrix6<f64> {
    Matrix6::from_diagonal(
        &Vector6::new(
            sigma_rad,
            sigma_rad,
            sigma_rad * 2.0,
            sigma_m,
            sigma_m * 1.5,
            sigma_m,
        )
        .map(|s| s * s),
    )
}

pub fn held_out_poses() -> Vec<([f64; 5], PoseError)> {
    let mut draw = Draw::new(5);
    (0..10)
        .map(|i| {
            let q = draw.pose();
            let tool = |error: f64| frames(&q, error)[6] * Point3::origin();
            let observed = tool(1.0) + draw.vector(0.000_15);
            let predicted = tool(0.97);
            let vector = predicted - observed;
            let pose = PoseError {
                pose: format!("check {}", i + 1),
                joints: joint_values(&q),
                nominal_m: Some((tool(0.0) - observed).norm() + 0.004),
                registration_only_m: Some((tool(0.35) - observed).norm()),
                calibrated_m: Some(vector.norm()),
                vector_m: Some(vector.into()),
                ..PoseError::default()
            };
            (q, pose)
        })
        .collect()
}

fn inputs() -> Vec<Input> {
    let input = |path: &str, digit: char| Input {
        path: path.into(),
        sha256: digit.to_string().repeat(64),
    };
    vec![
        input("ripley/r17.urdf", '1'),
        input("ripley/arm_sweep.csv", '2'),
        input("ripley/checks.csv", '3'),
    ]
}

/// The judgment on a fit that freed the robot, with these limits and held-out errors.
fn judged(limits: &[Limit], held_out: Option<&HeldOut>, ended: FitEnd) -> Judgment {
    judge(&VerdictFacts {
        limits: limits.to_vec(),
        solver: Some(Solver {
            ended,
            iterations: 7,
        }),
        freed: true,
        improvements: held_out.map(Improvement::of).unwrap_or_default(),
        validation: held_out.map_or(Validation::None, |h| Validation::Recordings {
            postures: h.postures,
            repeated: 0,
        }),
        orientation: Orientation {
            rms: Some(0.004),
            expected: Some(0.003),
        },
        ..VerdictFacts::default()
    })
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

/// No validation poses: nothing can be decided.
pub fn not_evaluated() -> Report {
    let limits = vec![Limited::position_rms(false).unknown(0.005)];
    let judgment = judged(&limits, None, FitEnd::Converged);
    Report {
        profile: "robots/arm.yaml".into(),
        robot: "arm | <six>".into(),
        limits,
        next_steps: vec![
            "Record ten separate poses and list them in the profile with `use: validation`.".into(),
        ],
        transforms: vec![Transform::new(
            "base",
            "mount",
            "base",
            &Isometry3::translation(0.1, -1e-9, 0.0),
            Some(&covariance(0.001, 0.002)),
            Status::Calibrated,
        )],
        verification: Verification {
            held_out: None,
            outcome: Outcome::NotEvaluated,
            reason: "the profile has no recording with `use: validation`.".into(),
        },
        version: "0.1.0".into(),
        ..Report::default()
    }
    .judged(judgment)
}

pub fn all() -> [(&'static str, Report); 3] {
    let reports = [
        ("accepted", accepted()),
        ("rejected", rejected()),
        ("not_evaluated", not_evaluated()),
    ];
    assert_eq!(
        reports.each_ref().map(|(_, report)| report.verdict),
        [Verdict::Accepted, Verdict::Rejected, Verdict::NotEvaluated]
    );
    reports
}

/// A table, a robot on it, a body on the gripper.
pub fn scene() -> Scene {
    let frame = |name: &str, parent: &str, xyz: [f64; 3], yaw: f64, status| {
        SceneFrame::new(
            name,
            parent,
            &Isometry3::new(xyz.into(), Vector3::z() * yaw),
            None,
            status,
        )
    };
    let mut base = frame(
        "base_link",
        "table",
        [0.4, -0.2, 0.0],
        0.1,
        Status::Calibrated,
    )
    .in_urdf();
    base.covariance = Some(std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            if i == j {
                if i < 3 { 1e-8 } else { 2.5e-9 }
            } else {
                0.0
            }
        })
    }));
    Scene {
        name: "ripley".into(),
        robot: SceneRobot {
            name: "ripley".into(),
            urdf: "ripley.calibrated.urdf".into(),
            base: "base_link".into(),
            joints: joint_values(&[0.1, -0.2, 0.3, 0.0, 1.0 / 3.0]),
            has_masses: true,
        },
        frames: vec![
            SceneFrame::root("vicon", Status::Measured),
            frame("table", "vicon", [0.0, 0.1, 0.72], 0.0, Status::Measured),
            base,
            frame(
                "gripper",
                "base_link",
                [0.3, 0.0, 0.9],
                0.0,
                Status::Calibrated,
            )
            .in_urdf(),
            frame(
                "gripM",
                "gripper",
                [0.01, 0.0, 0.05],
                -1.2,
                Status::Calibrated,
            ),
            frame(
                "camera",
                "gripper",
                [0.05, 0.0, -0.02],
                0.0,
                Status::Assumed,
            ),
        ],
        bodies: vec![SceneBody {
            name: "gripM".into(),
            link: "gripper".into(),
            markers: MARKERS
                .iter()
                .map(|(name, xyz_m)| SceneMarker {
                    name: (*name).into(),
                    xyz_m: *xyz_m,
                })
                .collect(),
        }],
        objects: vec![SceneObject {
            name: "table_top".into(),
            frame: "table".into(),
            shape: Shape::Box {
                size_m: [1.6, 0.8, 0.03],
            },
            xyz_m: [0.0, 0.0, -0.015],
            quat_xyzw: [0.0, 0.0, 0.0, 1.0],
            status: Status::Assumed,
        }],
        provenance: Provenance {
            tool: "calib".into(),
            version: "0.1.0".into(),
            profile: "robots/ripley.yaml".into(),
            inputs: inputs(),
        },
        ..Scene::default()
    }
}

/// The arm of [`frames`] in its ten validation poses, with two sweeps.
pub fn view() -> View3d {
    let names = [
        "base_link",
        "waist",
        "shoulder",
        "elbow",
        "wrist_pitch",
        "wrist_roll",
        "gripper",
    ];
    let mut draw = Draw::new(21);
    let marker = |frames: &[Isometry3<f64>], place: &[f64; 3]| frames[6] * Point3::from(*place);
    let poses = held_out_poses()
        .into_iter()
        .map(|(q, pose)| {
            let (real, model) = (frames(&q, 1.0), frames(&q, 0.97));
            ViewPose {
                name: pose.pose,
                text: format!(
                    "error {:.2} mm",
                    pose.calibrated_m.expect("a held-out error") * 1e3
                ),
                nominal: frames(&q, 0.0).iter().map(pose_row).collect(),
                calibrated: model.iter().map(pose_row).collect(),
                markers: MARKERS
                    .iter()
                    .map(|(name, place)| ViewMarker {
                        name: (*name).into(),
                        observed: Some((marker(&real, place) + draw.vector(0.000_1)).into()),
                        predicted: marker(&model, place).into(),
                    })
                    .collect(),
            }
        })
        .collect();
    // The upper arm swept over waist and shoulder, the gripper over wrist_roll.
    let sweep: Vec<[f64; 3]> = (0..12)
        .flat_map(|i| {
            (0..20).map(move |j| {
                [
                    f64::from(i) * 0.35 - 1.2,
                    f64::from(j) * 0.25 - 2.4,
                    0.0,
                    0.0,
                    0.0,
                ]
            })
        })
        .map(|q| frames(&q, 1.0)[3].translation.vector.into())
        .collect();
    let bent = [0.4, 0.5, 1.2, 0.6, 0.0];
    let wrist = frames(&bent, 1.0)[5];
    let roll: Vec<[f64; 3]> = (0..21)
        .map(|i| {
            marker(
                &frames(&[0.4, 0.5, 1.2, 0.6, f64::from(i) * 0.17 - 1.7], 1.0),
                &[0.03, 0.02, 0.01],
            )
            .into()
        })
        .collect();
    let shoulder = frames(&[0.0; 5], 1.0)[2].translation.vector;
    View3d {
        frame: "vicon".into(),
        magnification: 100.0,
        frames: names
            .iter()
            .enumerate()
            .map(|(i, name)| ViewFrame {
                name: (*name).into(),
                parent: i.checked_sub(1),
            })
            .collect(),
        outlines: vec![
            Outline::cylinder(0, &Isometry3::translation(0.0, 0.0, 0.1), 0.09, 0.2),
            Outline::cuboid(2, &Isometry3::translation(0.0, 0.0, 0.19), [0.08, 0.1, 0.4]),
            Outline::cuboid(
                3,
                &Isometry3::translation(0.0, 0.0, 0.19),
                [0.06, 0.08, 0.4],
            ),
        ],
        poses,
        clouds: vec![
            Cloud {
                name: "base_sweep linkM".into(),
                points: sweep,
            },
            Cloud {
                name: "wrist_sweep gripM_1".into(),
                points: roll,
            },
        ],
        spheres: vec![Sphere {
            name: "shoulder".into(),
            center: shoulder.into(),
            radius: 0.378,
            sigma: Some(0.000_5),
        }],
        circles: vec![Circle {
            name: "wrist_roll".into(),
            center: (wrist * Point3::new(0.0, 0.0, 0.169)).into(),
            normal: (wrist.rotation * Vector3::z()).into(),
            radius: 0.036,
        }],
        axes: vec![Axis {
            name: "wrist_roll".into(),
            point: (wrist * Point3::origin()).into(),
            direction: (wrist.rotation * Vector3::z()).into(),
            half_length: 0.25,
            sigma_point: Some(0.000_2),
            sigma_direction: Some(0.001),
            frame: None,
        }],
    }
}
