//! Links that grow while the robot warms up: found with the temperatures of the recording, named where they are not free, and
//! predicted for other temperatures.

use crate::contacts::{ORIGINS, normal, urdf, z};
use crate::scratch::Scratch;

use std::fmt::Write as _;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

/// Noise of a marker's coordinate, m.
const MARKER: f64 = 5e-5;
/// The arm of the other tests, as large as one that carries 100 kg.
const SIZE: f64 = 3.0;
/// °C.
const REFERENCE: f64 = 20.0;

const PROFILE: &str = r#"calib: 1
robot: {name: arm, urdf: arm/arm.urdf}
tracker: {frame: lab, marker_sigma_mm: 0.05}
bodies:
  hand: {link: l6, markers: [f1, f2, f3]}
recordings:
  poses: {file: arm/poses.csv, use: static}
  checks: {file: arm/checks.csv, use: validation}
solve:
  free: [bodies, tracker, joint_offsets, thermal_expansion]
  limits: {held_out_rms_mm: 0.3}
outputs: {add_bodies: [hand]}
"#;

/// A robot that warms up.
struct Warming {
    offsets: [f64; 6],
    /// Of the link before each joint, 1/K.
    expansion: [f64; 6],
    tracker_from_root: Isometry3<f64>,
    rng: ChaCha8Rng,
}

impl Warming {
    fn new(seed: u64, expansion: impl Fn(&mut ChaCha8Rng) -> f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let offsets = [0; 6].map(|_| 2e-3 * normal(&mut rng));
        let expansion = [0; 6].map(|_| expansion(&mut rng));
        let at = Vector3::from_fn(|_, _| normal(&mut rng));
        let turn = Vector3::from_fn(|_, _| 0.5 * normal(&mut rng));
        Self {
            offsets,
            expansion,
            tracker_from_root: Isometry3::from_parts(
                Translation3::from(at),
                UnitQuaternion::from_scaled_axis(turn),
            ),
            rng,
        }
    }

    /// The arm at these temperatures of its links, °C.
    fn arm(&self, celsius: &[f64; 6]) -> RobotModel {
        let grown = |i: usize| 1.0 + self.expansion[i] * (celsius[i] - REFERENCE);
        let origins = std::array::from_fn(|i| ORIGINS[i].map(|x| x * SIZE * grown(i)));
        RobotModel::from_urdf_text(&urdf(&origins, &self.offsets), "true").expect("a robot")
    }

    /// A table of random postures; `columns` names its temperatures, `at` gives them by share of the recording.
    fn table(&mut self, n: usize, columns: &[&str], at: impl Fn(f64) -> [f64; 6]) -> String {
        const MARKERS: [[f64; 3]; 3] = [[0.2, 0.0, 0.1], [0.25, 0.15, 0.0], [0.1, -0.1, 0.2]];
        let mut text = String::from("j1_rad,j2_rad,j3_rad,j4_rad,j5_rad,j6_rad");
        columns.iter().for_each(|c| text += &format!(",{c}"));
        for k in 1..=3 {
            let _ = write!(text, ",f{k}.x_mm,f{k}.y_mm,f{k}.z_mm");
        }
        text.push('\n');
        for row in 0..n {
            let celsius = at(row as f64 / n as f64);
            let arm = self.arm(&celsius);
            let q: Vec<f64> = (0..6).map(|_| self.rng.random_range(-1.4..1.4)).collect();
            let hand = arm.link_id("l6").expect("there");
            let tracker_from_hand = self.tracker_from_root * arm.root_from_link(&q, hand);
            let mut cells: Vec<String> = q.iter().map(|q| format!("{q:.9}")).collect();
            cells.extend(celsius[..columns.len()].iter().map(|t| format!("{t:.3}")));
            for p in MARKERS {
                let noise = Vector3::from_fn(|_, _| MARKER * normal(&mut self.rng));
                let seen = (tracker_from_hand * Point3::from(p)).coords + noise;
                cells.extend(seen.iter().map(|x| format!("{:.6}", x * 1e3)));
            }
            text += &cells.join(",");
            text.push('\n');
        }
        text
    }

    fn folder(&mut self, profile: &str, columns: &[&str], at: impl Fn(f64) -> [f64; 6]) -> Scratch {
        let nominal = ORIGINS.map(|o| o.map(|x| x * SIZE));
        Scratch::new()
            .file("arm/arm.urdf", urdf(&nominal, &[0.0; 6]))
            .file("arm.yaml", profile)
            .file("arm/poses.csv", self.table(60, columns, &at))
            .file("arm/checks.csv", self.table(20, columns, &at))
    }
}

/// A cold start: from 18 °C towards 43 °C.
fn warming_up(share: f64) -> [f64; 6] {
    [18.0 + 25.0 * (1.0 - (-3.0 * share).exp()); 6]
}

const ONE: &[&str] = &["temperature_c"];

fn run(dir: &Scratch) -> Value {
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    assert!(ran.stdout.contains("out/report.html"), "{}", ran.stderr);
    dir.json("out/report.json")
}

fn says<'a>(report: &'a Value, id: &str) -> Option<&'a Value> {
    let mut findings = report["findings"].as_array().expect("a list").iter();
    findings.find(|f| f["id"] == id)
}

fn held_out(report: &Value) -> f64 {
    let rms = &report["verification"]["held_out"]["calibrated"]["rms_m"];
    rms.as_f64().expect("a number")
}

#[test]
fn growth_of_each_link_is_found_beside_zero_offsets() {
    let mut found = Vec::new();
    for seed in 0..12 {
        // Steel or aluminium, about.
        let metal = |r: &mut ChaCha8Rng| 1e-6 * [12.0, 23.0][r.random_range(0..2)];
        let mut robot = Warming::new(seed, metal);
        let report = run(&robot.folder(PROFILE, ONE, warming_up));
        for (i, truth) in robot.expansion.iter().enumerate() {
            found.push(z(&report, &format!("j{}.thermal_expansion", i + 1), *truth));
        }
        assert!(held_out(&report) < 2.5 * MARKER, "{seed}");
    }
    let inside = found.iter().filter(|z| z.abs() < 1.96).count();
    println!("{inside} of {} within 1.96 σ", found.len());
    // 95 % of 72 less three binomial standard deviations.
    assert!(inside >= 62, "{found:?}");
}

#[test]
fn growth_that_is_not_free_is_named_and_its_remedy_works() {
    let held = PROFILE.replace(", thermal_expansion]", "]");
    for (seed, twice) in [(40, false), (41, true)] {
        let mut robot = Warming::new(seed, |_| 23e-6);
        // Warm and cold in turn, or once.
        let at = move |share: f64| match twice {
            true => [30.0 + 12.0 * (12.0 * share).sin(); 6],
            false => warming_up(share),
        };
        let dir = robot.folder(&held, ONE, at);
        let report = run(&dir);
        let missing = says(&report, "missing-physics").expect("named");
        let text = missing.to_string();
        assert!(text.contains("thermal expansion"), "{text}");
        let dir = dir.file("arm.yaml", PROFILE);
        let free = run(&dir);
        assert!(held_out(&free) < 0.6 * held_out(&report), "{seed}");
        assert!(says(&free, "missing-physics").is_none(), "{seed}");
    }
    // At one temperature there is nothing to find.
    let mut robot = Warming::new(42, |_| 23e-6);
    let report = run(&robot.folder(&held, ONE, |_| [31.0; 6]));
    assert!(!report["findings"].to_string().contains("thermal"));
}

#[test]
fn a_warm_link_grows_by_its_own_column_and_predictions_follow_it() {
    let columns: Vec<String> = (1..=6).map(|j| format!("j{j}_temperature_c")).collect();
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    // Only the upper arm warms up.
    let at = |share: f64| [21.0, 20.0, 20.0 + 30.0 * share, 20.0, 22.0, 20.0];
    let mut robot = Warming::new(7, |_| 23e-6);
    let dir = robot.folder(PROFILE, &columns, at);
    let report = run(&dir);
    assert!(z(&report, "j3.thermal_expansion", 23e-6).abs() < 4.0);
    assert!(says(&report, "temperature-missing").is_none());
    let yaml = dir.read("out/arm.calibrated.calibration.yaml");
    assert!(
        yaml.contains("thermal_expansion_of_m: [0, 0, 1.04"),
        "{yaml}"
    );
    assert!(yaml.contains("T0 = 20 degC"), "{yaml}");

    let posture = "0,0,0,0,0,0";
    let dir = dir
        .file(
            "cold.csv",
            format!("j1_rad,j2_rad,j3_rad,j4_rad,j5_rad,j6_rad\n{posture}\n"),
        )
        .file(
            "warm.csv",
            format!("j1_rad,j2_rad,j3_rad,j4_rad,j5_rad,j6_rad,temperature_c,j3_temperature_c\n{posture},20,50\n"),
        );
    let height = |table: &str| -> (f64, String) {
        let model = "out/arm.calibrated.model.json";
        let ran = dir.calib(["predict", model, table, "--of", "l6"]).expect(0);
        let row = ran.stdout.lines().nth(1).expect("a row").to_owned();
        let z = row.split(',').nth(4).expect("z").parse::<f64>();
        (z.expect("a number"), ran.stderr)
    };
    let ((cold, said), (warm, silent)) = (height("cold.csv"), height("warm.csv"));
    assert!(said.contains("20 °C") && !silent.contains("°C"), "{said}");
    let grown = parameter(&report, "j3.thermal_expansion") * 30.0 * 0.35 * SIZE;
    assert!((warm - cold - grown).abs() < 1e-8, "{warm} {cold} {grown}");
}

fn parameter(report: &Value, name: &str) -> f64 {
    let found = crate::contacts::parameter(report, name);
    found["value"].as_f64().expect("a number")
}

#[test]
fn what_is_not_recorded_or_cannot_be_is_said() {
    let mut robot = Warming::new(3, |_| 0.0);
    let report = run(&robot.folder(PROFILE, &[], warming_up));
    let missing = says(&report, "temperature-missing").expect("said");
    assert!(missing.to_string().contains("temperature_c"), "{missing}");
    let cold = PROFILE.replace("arm.urdf}", "arm.urdf, reference_temperature_c: -400}");
    let dir = robot.folder(&cold, ONE, warming_up);
    let ran = dir.calib(["check", "arm.yaml"]).expect(2);
    let text = &ran.stderr;
    assert!(
        text.contains("arm.yaml:2") && text.contains("-400"),
        "{text}"
    );
    // Where lengths are free, another reference is another length, not another growth.
    let long = PROFILE.replace("joint_offsets,", "joint_offsets, joint_axes,");
    let warm = long.replace("arm.urdf}", "arm.urdf, reference_temperature_c: 30}");
    let mut robot = Warming::new(4, |_| 23e-6);
    let dir = robot.folder(&long, ONE, warming_up);
    let at_20 = parameter(&run(&dir), "j3.thermal_expansion");
    let at_30 = parameter(&run(&dir.file("arm.yaml", &warm)), "j3.thermal_expansion");
    assert!((at_20 - at_30).abs() < 1e-7, "{at_20} {at_30}");
}
