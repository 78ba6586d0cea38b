//! Hand-made reports that look like real ones: one accepted, one rejected with quantities that the data cannot give, one not evaluated.
//!
//! The arm is made up (five joints, link lengths of a small table-top robot); the numbers come from a seeded generator, so

mod accepted;
mod rejected;
mod scene;
mod view;

pub use accepted::accepted;
pub use rejected::rejected;
pub use scene::scene;
pub use view::view;

use calib_report::{
    FitEnd, HeldOut, Improvement, Input, JointValue, Judgment, Limit, Limited, Orientation,
    Outcome, PoseError, Report, ResidualRow, Solver, Standardized, Status, Transform, Validation,
    Verdict, VerdictFacts, Verification, judge,
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
                joints: joint_values(&q).into(),
                ..ResidualRow::default()
            });
        }
    }
    rows
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
