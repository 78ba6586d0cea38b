//! A camera on the flange that sees a board beside the robot, and the same poses as other software states them.

use crate::scratch;

use std::fmt::Write as _;

use calib_urdf::RobotModel;
use nalgebra::{
    Cholesky, Isometry3, Matrix2x3, Matrix6, SMatrix, Translation3, UnitQuaternion, Vector3,
    Vector6,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;
use serde_json::Value;

/// σ of the board's position and angles in the camera, m and rad.
const SIGMA: (f64, f64) = (3e-4, 2e-3);
/// Name, origin (m) and axis of the joints.
const JOINTS: [(&str, [f64; 3], &str); 6] = [
    ("j1", [0.0, 0.0, 0.29], "0 0 1"),
    ("j2", [0.03, 0.0, 0.11], "0 1 0"),
    ("j3", [0.0, 0.0, 0.35], "0 1 0"),
    ("j4", [0.12, 0.0, 0.06], "1 0 0"),
    ("j5", [0.25, 0.0, 0.0], "0 1 0"),
    ("j6", [0.08, 0.0, 0.0], "1 0 0"),
];

fn normal(rng: &mut ChaCha8Rng, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| {
        let z: f64 = StandardNormal.sample(rng);
        sigma * z
    })
}

/// The arm, with origins that are off by so much (σ, m).
fn urdf(off: f64, rng: &mut ChaCha8Rng) -> String {
    let mut text = String::from("<robot name=\"arm\">\n  <link name=\"l0\"/>\n");
    for (i, (name, at, axis)) in JOINTS.iter().enumerate() {
        let at = Vector3::from(*at) + normal(rng, off);
        let _ = writeln!(
            text,
            "  <link name=\"l{}\"/>\n  <joint name=\"{name}\" type=\"revolute\">\n    <parent link=\"l{i}\"/>\n    <child link=\"l{}\"/>\n    \
             <origin xyz=\"{} {} {}\" rpy=\"0 0 0\"/>\n    <axis xyz=\"{axis}\"/>\n    <limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/>\n  </joint>",
            i + 1,
            i + 1,
            at.x,
            at.y,
            at.z
        );
    }
    text + "</robot>\n"
}

/// Which end has the instrument, and which of the two poses the file states.
#[derive(Clone, Copy)]
struct Way {
    camera_on_flange: bool,
    states_inverse: bool,
}

/// How the instrument errs.
#[derive(Clone, Copy)]
enum Detector {
    /// By [`SIGMA`] in all directions.
    Even,
    /// As a camera that looks at the board and finds its corners to so many pixels.
    Pixels(f64),
}

impl Detector {
    /// A measured pose of the board in the instrument's frame.
    fn measured(self, seen: Isometry3<f64>, rng: &mut ChaCha8Rng) -> Isometry3<f64> {
        match self {
            Self::Even => seen * Isometry3::new(normal(rng, SIGMA.0), normal(rng, SIGMA.1)),
            Self::Pixels(sigma) => {
                let root = Cholesky::new(by_corners(&seen, sigma))
                    .expect("definite")
                    .l();
                let normal: Vector6<f64> = Vector6::from_fn(|_, _| StandardNormal.sample(rng));
                let error = root * normal;
                let rotation =
                    UnitQuaternion::from_scaled_axis(error.fixed_rows::<3>(0).into_owned());
                let place = seen.translation.vector + error.fixed_rows::<3>(3);
                Isometry3::from_parts(place.into(), rotation * seen.rotation)
            }
        }
    }
}

/// Covariance of rotation (rad, in the instrument's axes) and position (m) of a board of 5 × 5 corners on 120 mm, before a camera with a focal length of
/// 1 200 pixels that looks at it: of least squares on the corners' places in the image.
fn by_corners(seen: &Isometry3<f64>, pixels: f64) -> Matrix6<f64> {
    const FOCAL: f64 = 1200.0;
    let place = seen.translation.vector;
    let to_camera = UnitQuaternion::rotation_between(&place, &Vector3::z()).expect("in front");
    let to_camera = to_camera.to_rotation_matrix();
    let mut information = Matrix6::zeros();
    for corner in 0..25 {
        let [i, j] = [corner % 5, corner / 5].map(|k| 0.03 * (f64::from(k) - 2.0));
        let arm = seen.rotation * Vector3::new(i, j, 0.0);
        let p = to_camera * (arm + place);
        let image = Matrix2x3::new(
            1.0 / p.z,
            0.0,
            -p.x / (p.z * p.z),
            0.0,
            1.0 / p.z,
            -p.y / (p.z * p.z),
        ) * FOCAL
            * to_camera;
        let mut row = SMatrix::<f64, 2, 6>::zeros();
        row.fixed_columns_mut::<3>(0)
            .copy_from(&(-image * arm.cross_matrix()));
        row.fixed_columns_mut::<3>(3).copy_from(&image);
        information += row.transpose() * row / (pixels * pixels);
    }
    information
        .try_inverse()
        .expect("a board in a plane is seen")
}

/// Postures of the robot before a board that is 0.4 to 1 m away, and what is measured there.
fn table(
    robot: &RobotModel,
    (way, detector): (Way, Detector),
    rows: usize,
    rng: &mut ChaCha8Rng,
) -> String {
    let link = robot.link_id("l6").expect("a link");
    let mount = Isometry3::new(
        Vector3::new(0.05, -0.03, 0.04),
        Vector3::new(0.3, 1.4, -0.2),
    );
    let home = [0.3, 0.4, 0.5, 0.2, 0.7, -0.4];
    let camera = |q: &[f64]| robot.root_from_link(q, link) * mount;
    let board = camera(&home)
        * Isometry3::from_parts(
            Translation3::new(0.05, -0.02, 0.7),
            UnitQuaternion::from_euler_angles(3.0, 0.2, 0.5),
        );
    let mut text =
        JOINTS.map(|(name, ..)| format!("{name}_rad")).join(",") + ",x_m,y_m,z_m,qx,qy,qz,qw\n";
    let mut written = 0;
    while written < rows {
        let q: Vec<f64> = home
            .iter()
            .map(|at| at + rng.random_range(-0.7..0.7))
            .collect();
        let camera_from_board = camera(&q).inverse() * board;
        let place = camera_from_board.translation.vector;
        if !(0.4..1.0).contains(&place.z) || place.xy().norm() > 0.6 * place.z {
            continue;
        }
        let measured = match way.camera_on_flange {
            true => camera_from_board,
            false => camera_from_board.inverse(),
        };
        let measured = detector.measured(measured, rng);
        let stated = match way.camera_on_flange == way.states_inverse {
            true => measured,
            false => measured.inverse(),
        };
        let r = stated.rotation.coords;
        let mut cells: Vec<String> = q.iter().map(|v| format!("{v:.7}")).collect();
        let numbers = stated.translation.vector.iter().chain(r.iter());
        cells.extend(numbers.map(|v| format!("{v:.7}")));
        text += &(cells.join(",") + "\n");
        written += 1;
    }
    text
}

/// The report of a session of an instrument that errs alike in all directions.
fn judged(way: Way, seed: u64) -> Value {
    judged_by((way, Detector::Even), seed)
}

/// The report of a session.
fn judged_by((way, detector): (Way, Detector), seed: u64) -> Value {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let robot = RobotModel::from_urdf_text(&urdf(3e-4, &mut rng), "arm").expect("an arm");
    let inverted = match way.states_inverse {
        true => ", inverted: true",
        false => "",
    };
    let columns = format!(
        "columns: {{bodies: {{camera: {{position: [x_m, y_m, z_m], quaternion_xyzw: [qx, qy, qz, qw]{inverted}}}}}}}"
    );
    let stated = match detector {
        Detector::Even => format!(
            ", body_sigma_mm: {}, body_sigma_deg: {}",
            SIGMA.0 * 1e3,
            SIGMA.1.to_degrees()
        ),
        Detector::Pixels(_) => String::new(),
    };
    let profile = format!(
        "calib: 1\nrobot: {{name: arm, urdf: arm.urdf}}\ntracker: {{frame: board{stated}}}\n\
         bodies:\n  camera: {{link: l6, pose: true}}\nrecordings:\n  poses: {{file: poses.csv, use: static, {columns}}}\n  \
         checks: {{file: checks.csv, use: validation, {columns}}}\nsolve:\n  free: [bodies, tracker, joint_offsets, joint_axes]\n  \
         prior: {{position_mm: 3, angle_deg: 0.3, offset_deg: 0.5}}\n  limits: {{held_out_rms_mm: 6, held_out_max_mm: 15}}\n"
    );
    let dir = Scratch::new()
        .file("arm.urdf", urdf(0.0, &mut rng))
        .file("poses.csv", table(&robot, (way, detector), 60, &mut rng))
        .file("checks.csv", table(&robot, (way, detector), 20, &mut rng))
        .file("arm.yaml", profile);
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    assert!(ran.code < 2, "{}{}", ran.stdout, ran.stderr);
    dir.json("out/report.json")
}

/// A σ from 60 poses is known to 6 %: 180 numbers of each kind, of which the parameters take about 30.
const OF_STATED: std::ops::Range<f64> = 0.75..1.25;

/// Found over stated σ, of positions and of orientations.
fn noise(report: &Value) -> [f64; 2] {
    let of = |kind: &str| {
        let mut all = report["noise"].as_array().expect("noise").iter();
        let found = all.find(|n| n["kind"] == kind).expect("of a body");
        found["sigma"].as_f64().expect("σ") / found["stated"].as_f64().expect("σ")
    };
    ["position", "orientation"].map(of)
}

fn named(report: &Value, id: &str) -> Option<Value> {
    let mut all = report["findings"].as_array().expect("a list").iter();
    all.find(|f| f["id"] == id).cloned()
}

/// The errors of a camera's angles are no errors of where the robot holds it. One right pose in a thousand or so may be called an outlier.
#[test]
fn the_noise_of_a_camera_is_that_of_the_board_that_it_sees() {
    let way = Way {
        camera_on_flange: true,
        states_inverse: true,
    };
    let mut with_outliers = 0;
    for seed in 0..8 {
        let report = judged(way, seed);
        for ratio in noise(&report) {
            assert!(OF_STATED.contains(&ratio), "{seed}: {ratio}");
        }
        assert!(named(&report, "noise-of-inverse").is_none());
        assert!(named(&report, "pose-convention").is_none());
        with_outliers += usize::from(named(&report, "row-outlier").is_some());
        let verdict = report["verdict"].as_str().expect("a word");
        assert!(verdict.starts_with("accepted"), "{seed}: {verdict}");
        // The errors are those of the board in the picture's frame: its noise, and what 60 poses leave open.
        let held_out = &report["verification"]["held_out"]["calibrated"]["rms_m"];
        let held_out = held_out.as_f64().expect("held out");
        assert!((4e-4..1e-3).contains(&held_out), "{seed}: {held_out}");
    }
    assert!(with_outliers <= 1, "{with_outliers} of 8");
}

/// Software states where the camera is in the board's frame, or the inverse of what a tracker saw: the poses tell.
#[test]
fn poses_that_were_inverted_by_software_have_the_noise_of_what_was_measured() {
    for (camera_on_flange, kind) in [(true, "body_sees"), (false, "tracker_sees")] {
        let way = Way {
            camera_on_flange,
            states_inverse: !camera_on_flange,
        };
        for seed in 0..3 {
            let report = judged(way, 20 + seed);
            let told = named(&report, "noise-of-inverse").expect("named");
            assert_eq!(told["facts"]["kind"], kind, "{told}");
            for ratio in noise(&report) {
                assert!(OF_STATED.contains(&ratio), "{seed}: {ratio}");
            }
        }
    }
    // A tracker beside the robot, as its columns say.
    let way = Way {
        camera_on_flange: false,
        states_inverse: false,
    };
    let report = judged(way, 30);
    assert!(named(&report, "noise-of-inverse").is_none());
    for ratio in noise(&report) {
        assert!(OF_STATED.contains(&ratio), "{ratio}");
    }
}

/// What calculates the noise here is a camera, not the model of the fit: σ along the line of sight is several times that across it, and differs with the
/// angle at which the board is seen. Correct rows that look like outliers remain in some sessions,
/// and held-out errors that exceed what is stated.
#[test]
fn a_camera_that_errs_in_pixels_has_noise_along_its_line_of_sight() {
    let (mut with_outliers, mut accepted) = (0, 0);
    for camera_on_flange in [true, false] {
        let way = Way {
            camera_on_flange,
            states_inverse: camera_on_flange,
        };
        for seed in 0..4 {
            let report = judged_by((way, Detector::Pixels(0.2)), 50 + seed);
            let told = named(&report, "noise-along-sight").expect("named");
            let [along, across] =
                ["along", "across"].map(|key| told["facts"][key]["value"].as_f64().expect("m"));
            assert!(along > 3.0 * across, "{told}");
            with_outliers += usize::from(named(&report, "row-outlier").is_some());
            let verdict = report["verdict"].as_str().expect("a word");
            assert_ne!(verdict, "rejected", "{seed}");
            accepted += usize::from(verdict.starts_with("accepted"));
        }
    }
    assert!(with_outliers <= 4, "{with_outliers} of 8");
    assert!(accepted >= 6, "{accepted} of 8");
}
