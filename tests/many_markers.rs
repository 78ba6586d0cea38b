//! Bodies of very many markers: a few points stand for them, also where half of the markers are hidden.

use crate::scratch;

use std::fmt::Write as _;

use scratch::Scratch;
use serde_json::Value;

const MARKERS: usize = 60;
/// Noise of a marker coordinate, mm.
const SIGMA_MM: f64 = 0.1;

/// Markers on a ball of 90 mm, along a spiral.
fn ball() -> Vec<[f64; 3]> {
    let at = |k: usize| {
        let z = 1.0 - (2 * k + 1) as f64 / MARKERS as f64;
        let (turn, out) = (2.399_963 * k as f64, (1.0 - z * z).sqrt());
        [90.0 * out * turn.cos(), 90.0 * out * turn.sin(), 90.0 * z]
    };
    (0..MARKERS).map(at).collect()
}

/// A robot of three joints with a ball on its end; the foot has four markers and a known mount.
fn robot(seed: u64) -> Scratch {
    let mut urdf = "<robot name=\"three\"><link name=\"l0\"/>".to_owned();
    for (k, axis) in ["0 0 1", "0 1 0", "1 0 0"].iter().enumerate() {
        let (parent, child) = (k, k + 1);
        let _ = write!(
            urdf,
            "<link name=\"l{child}\"/><joint name=\"j{k}\" type=\"revolute\"><parent link=\"l{parent}\"/><child link=\"l{child}\"/>\
             <origin xyz=\"0.15 0.02 0.2\"/><axis xyz=\"{axis}\"/><limit lower=\"-3\" upper=\"3\" effort=\"9\" velocity=\"2\"/></joint>"
        );
    }
    urdf.push_str("</robot>");
    let named = |body: &str, points: &[[f64; 3]]| -> (String, String) {
        let names = (0..points.len()).map(|k| format!("{body}_{k}"));
        let places = points.iter().enumerate();
        let places = places.map(|(k, [x, y, z])| format!("{body}_{k}: [{x:.3}, {y:.3}, {z:.3}]"));
        (
            names.collect::<Vec<_>>().join(", "),
            places.collect::<Vec<_>>().join(", "),
        )
    };
    let (ball, ball_places) = named("ball", &ball());
    let corners = [
        [0.0; 3],
        [120.0, 0.0, 0.0],
        [30.0, 90.0, 0.0],
        [10.0, 20.0, 80.0],
    ];
    let (foot, foot_places) = named("foot", &corners);
    let mount = "{xyz_mm: [30, 20, 40], rpy_deg: [5, -7, 12]}";
    let turns = "{j0_deg: [-80, 80], j1_deg: [-80, 80], j2_deg: [-80, 80]}";
    let profile = format!(
        "calib: 1
robot: {{name: three, urdf: three.urdf}}
tracker: {{frame: lab}}
bodies:
  foot: {{link: l0, markers: [{foot}], mount: {mount}, template_mm: {{{foot_places}}}}}
  ball: {{link: l3, markers: [{ball}]}}
recordings:
  poses: {{file: poses.csv, use: static}}
  checks: {{file: checks.csv, use: validation}}
solve: {{free: [bodies, tracker, joint_offsets, joint_axes]}}
simulate:
  seed: {seed}
  tracker_from_root: {{xyz_mm: [300, -200, 100], rpy_deg: [3, 2, 40]}}
  mounts:
    foot: {{xyz_mm: [30, 20, 40], rpy_deg: [5, -7, 12], markers_mm: {{{foot_places}}}}}
    ball: {{xyz_mm: [40, -10, 60], rpy_deg: [4, 9, -15], markers_mm: {{{ball_places}}}}}
  errors: {{joint_offset_deg: 0.2, axis_mm: 0.5, axis_deg: 0.1}}
  noise: {{marker_mm: {SIGMA_MM}, joint_deg: 0.002}}
  recordings:
    poses: {{random: {turns}, poses: 40}}
    checks: {{random: {turns}, poses: 12}}
"
    );
    let dir = Scratch::new()
        .file("three.urdf", urdf)
        .file("three.yaml", profile);
    dir.calib(["simulate", "three.yaml", "--out", ".", "--quiet"])
        .expect(0);
    dir
}

/// Hides the markers of the ball that are on the far side of a plane which turns from row to row.
fn half_hidden(dir: Scratch) -> Scratch {
    let ball = ball();
    let hidden = |row: usize, column: &str, cell: &str| {
        let marker = column.strip_prefix("ball_");
        let marker = marker.and_then(|rest| rest.split('.').next()?.parse::<usize>().ok());
        let Some(marker) = marker else {
            return cell.to_owned();
        };
        let z = 1.0 - 2.0 * ((row as f64 * 0.618) % 1.0);
        let (turn, out) = (1.3 * row as f64, (1.0 - z * z).sqrt());
        let [x, y, up] = ball[marker];
        match out * (x * turn.cos() + y * turn.sin()) + z * up > -20.0 {
            true => cell.to_owned(),
            false => String::new(),
        }
    };
    let dir = dir.cells("poses.csv", hidden);
    dir.cells("checks.csv", hidden)
}

/// Found noise of a marker coordinate, mm, and the findings.
fn run(dir: &Scratch) -> (f64, Vec<Value>) {
    dir.calib(["run", "three.yaml", "--out", "out"]);
    let report = dir.json("out/report.json");
    let noise = report["noise"].as_array().expect("a list");
    let marker = noise.iter().find(|n| n["group"] == "marker");
    let sigma = marker.and_then(|n| n["sigma"].as_f64()).expect("a level");
    let findings = report["findings"].as_array().expect("a list");
    (1e3 * sigma, findings.clone())
}

#[test]
fn the_noise_of_many_markers_is_found_whether_all_are_seen_or_half() {
    let (mut all, mut half) = (Vec::new(), Vec::new());
    for seed in 1..=4 {
        let dir = robot(seed);
        let (sigma, findings) = run(&dir);
        assert!(findings.iter().any(|f| f["id"] == "body-condensed"));
        all.push(sigma);
        let dir = half_hidden(dir);
        let (sigma, findings) = run(&dir);
        let condensed = findings.iter().filter(|f| f["id"] == "body-condensed");
        for found in condensed {
            assert_eq!(found["severity"], "info", "{found:#}");
        }
        half.push(sigma);
        // The checks see the markers themselves.
        let checked = dir.calib(["check", "three.yaml", "--json"]).json();
        let bodies = checked["noise"].as_array().expect("a list");
        let ball = bodies.iter().find(|b| b["body"] == "ball");
        let scatter = ball.and_then(|b| b["sigma_m"].as_f64()).expect("a scatter");
        assert!((1e3 * scatter / SIGMA_MM - 1.0).abs() < 0.04, "{scatter}");
    }
    // 40 rows of 24 coordinates less the unknowns: 2.5 % each, 1.3 % the mean of four.
    for found in [&all, &half] {
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        assert!((mean / SIGMA_MM - 1.0).abs() < 0.04, "{all:?} {half:?}");
    }
}
