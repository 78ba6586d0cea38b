//! What loads the joints: gravity's direction, payloads, masses that nobody stated, stiffness that is known.

use crate::scratch;

use scratch::Scratch;
use serde_json::Value;

/// Four joints; `inertial` of the three moving links that have one.
pub fn urdf(inertial: [&str; 3]) -> String {
    let joint = |i: usize, xyz: &str, axis: &str, inertial: &str| {
        format!(
            "  <link name=\"l{i}\">{inertial}</link>\n  <joint name=\"j{i}\" type=\"revolute\"><parent link=\"l{}\"/><child link=\"l{i}\"/>\n    \
             <origin xyz=\"{xyz}\"/><axis xyz=\"{axis}\"/><limit lower=\"-3\" upper=\"3\" effort=\"50\" velocity=\"2\"/></joint>\n",
            i - 1
        )
    };
    format!(
        "<robot name=\"arm\">\n  <link name=\"l0\"/>\n{}{}{}{}</robot>\n",
        joint(1, "0 0 0.3", "0 0 1", ""),
        joint(2, "0.05 0 0.1", "0 1 0", inertial[0]),
        joint(3, "0 0 0.4", "0 1 0", inertial[1]),
        joint(4, "0.3 0 0", "1 0 0", inertial[2]),
    )
}

pub const MASSLESS: [&str; 3] = ["", "", ""];

pub const PROFILE: &str = r#"calib: 1
robot: {name: arm, urdf: arm.urdf}
tracker: {frame: lab, body_sigma_mm: 0.1, body_sigma_deg: 0.02}
bodies:
  hand: {link: l4, pose: true}
recordings:
  poses: {file: poses.csv, use: static}
  checks: {file: checks.csv, use: validation}
solve:
  free: [bodies, tracker, joint_offsets, joint_axes, compliance]
  limits: {held_out_rms_mm: 0.5}
simulate:
  seed: 3
  tracker_from_root: {xyz_mm: [300, 150, 620], rpy_deg: [0, 0, 15]}
  mounts:
    hand: {xyz_mm: [70, -30, 45], rpy_deg: [10, -75, 20]}
  errors:
    joint_offset_deg: 0.1
    axis_mm: 0.3
    axis_deg: 0.05
    compliance_deg_per_nm: {j2: 0.02, j3: 0.03}
  noise: {body_mm: 0.1, body_deg: 0.02, joint_deg: 0.002}
  recordings:
    poses:
      random: &ranges {j1_deg: [-120, 120], j2_deg: [-60, 70], j3_deg: [-90, 90], j4_deg: [-120, 120]}
      poses: 80
    checks:
      random: *ranges
      poses: 40
"#;

/// Recordings of a robot (URDF and profile) simulated, beside the URDF and profile of the run.
pub fn laboratory(truth: (&str, &str), run: (&str, &str)) -> Scratch {
    let real = Scratch::new()
        .file("arm.urdf", truth.0)
        .file("arm.yaml", truth.1);
    real.calib(["simulate", "arm.yaml", "--out", "trial"])
        .expect(0);
    Scratch::new()
        .file("arm.urdf", run.0)
        .file("arm.yaml", run.1)
        .file("poses.csv", real.read("trial/poses.csv"))
        .file("checks.csv", real.read("trial/checks.csv"))
}

fn ran(dir: &Scratch) -> Value {
    dir.calib(["run", "arm.yaml", "--out", "out"]);
    dir.json("out/report.json")
}

fn rms_m(report: &Value) -> f64 {
    let held_out = &report["verification"]["held_out"]["calibrated"]["rms_m"];
    held_out.as_f64().expect("held out")
}

fn parameter(report: &Value, name: &str) -> (f64, f64) {
    let all = report["parameters"].as_array().expect("a list");
    let found = all.iter().find(|p| p["name"] == name).expect(name);
    let number = |key: &str| found[key].as_f64().expect(key);
    (number("value"), number("sigma"))
}

fn says<'a>(report: &'a Value, id: &str) -> Option<&'a Value> {
    let findings = report["findings"].as_array().expect("findings");
    findings.iter().find(|f| f["id"] == id)
}

/// rms of a held-out position where nothing is wrong: 0.1 mm per coordinate, and what joints and parameters add.
const NOISE: f64 = 0.25e-3;

#[test]
fn without_masses_the_loads_are_rods_and_the_report_says_so() {
    let arm = urdf(MASSLESS);
    let heavy = PROFILE.replace("urdf: arm.urdf}", "urdf: arm.urdf, total_mass_kg: 30}");
    let dir = laboratory((&arm, &heavy), (&arm, PROFILE));
    let report = ran(&dir);
    let finding = says(&report, "no-masses").expect("masses were assumed");
    assert!(
        finding["text"]
            .as_str()
            .expect("a text")
            .contains("assumed"),
        "{finding}"
    );
    assert!(rms_m(&report) < NOISE, "{}", rms_m(&report));
    // The product of mass and compliance is what was found.
    let assumed = finding["facts"]["mass"].clone();
    let yaml = dir.read("out/arm.calibrated.calibration.yaml");
    let masses = yaml.split("mass_kg: ").skip(1);
    let total: f64 = masses
        .map(|m| {
            m.split(',')
                .next()
                .and_then(|m| m.parse().ok())
                .unwrap_or(0.0)
        })
        .sum();
    assert!(total > 5.0 && total < 30.0, "{total} of {assumed}");
    let (value, sigma) = parameter(&report, "j2.compliance");
    let truth = 0.02_f64.to_radians() * 30.0 / total;
    assert!(
        (value - truth).abs() < 4.0 * sigma && sigma < 0.1 * truth,
        "{value} ± {sigma} for {truth}"
    );

    // With the total stated the compliance is the real one, and the finding says what was stated.
    let dir = laboratory((&arm, &heavy), (&arm, &heavy));
    let report = ran(&dir);
    let (value, sigma) = parameter(&report, "j2.compliance");
    assert!((value - 0.02_f64.to_radians()).abs() < 4.0 * sigma);
    let text = says(&report, "no-masses").expect("rods")["text"].clone();
    assert!(text.as_str().expect("a text").contains("30 kg"), "{text}");
}

#[test]
fn a_wall_and_a_payload_load_the_joints_as_the_profile_states_them() {
    let arm = urdf(MASSLESS);
    let wall = PROFILE.replace(
        "urdf: arm.urdf}",
        "urdf: arm.urdf, gravity: [1, 0, 0], total_mass_kg: 20, payload: {l4: {mass_kg: 3, center_mm: [0, 100, 0]}}}",
    );
    let report = ran(&laboratory((&arm, &wall), (&arm, &wall)));
    assert!(rms_m(&report) < NOISE, "{}", rms_m(&report));
    for (joint, deg) in [("j2", 0.02_f64), ("j3", 0.03)] {
        let (value, sigma) = parameter(&report, &format!("{joint}.compliance"));
        assert!(
            (value - deg.to_radians()).abs() < 4.0 * sigma,
            "{joint}: {value} ± {sigma}"
        );
    }
    // On a wall the first joint holds a load.
    parameter(&report, "j1.compliance");
    let upright = wall.replace("gravity: [1, 0, 0], ", "");
    let wrong = ran(&laboratory((&arm, &wall), (&arm, &upright)));
    assert!(rms_m(&wrong) > 1.5 * rms_m(&report), "{}", rms_m(&wrong));
    let ceiling = wall.replace("gravity: [1, 0, 0], ", "gravity: [-1, 0, 0], ");
    let wrong = ran(&laboratory((&arm, &wall), (&arm, &ceiling)));
    assert!(rms_m(&wrong) > 1.5 * rms_m(&report), "{}", rms_m(&wrong));
    says(&wrong, "wrong-sign").expect("a joint cannot rise under its load");
}

#[test]
fn a_stated_stiffness_yields_without_being_estimated() {
    let arm = urdf(MASSLESS);
    let k = |deg: f64| 1.0 / deg.to_radians();
    let stiff = PROFILE.replace(
        "urdf: arm.urdf}",
        &format!(
            "urdf: arm.urdf, total_mass_kg: 20, stiffness_nm_per_rad: {{j2: {}, j3: {}}}}}",
            k(0.02),
            k(0.03)
        ),
    );
    let given = stiff.replace(", compliance]", "]");
    let heavy = PROFILE
        .replace("urdf: arm.urdf}", "urdf: arm.urdf, total_mass_kg: 20}")
        .replace(", compliance]", "]");
    let without = ran(&laboratory((&arm, &stiff), (&arm, &heavy)));
    let dir = laboratory((&arm, &stiff), (&arm, &given));
    let report = ran(&dir);
    assert!(rms_m(&report) < NOISE, "{}", rms_m(&report));
    assert!(
        rms_m(&without) > 2.0 * rms_m(&report),
        "{}",
        rms_m(&without)
    );
    let registered = |r: &Value| {
        let baseline = &r["verification"]["held_out"]["registration_only"]["rms_m"];
        baseline.as_f64().expect("registered")
    };
    assert!(registered(&report) < registered(&without));
    let yaml = dir.read("out/arm.calibrated.calibration.yaml");
    assert!(yaml.contains("compliance_rad_per_nm: 3.49"), "{yaml}");
}

#[test]
fn the_urdf_fitted_without_effects_predicts_better_than_the_one_whose_effects_are_left_out() {
    let arm = urdf(MASSLESS);
    let heavy = PROFILE.replace("urdf: arm.urdf}", "urdf: arm.urdf, total_mass_kg: 30}");
    let dir = laboratory((&arm, &heavy), (&arm, &heavy));
    let report = ran(&dir);
    let rms = |which: &str| {
        let found = &report["verification"]["held_out"][which]["rms_m"];
        found.as_f64().expect(which)
    };
    let refitted = rms("urdf_refitted");
    assert!(rms("calibrated") < refitted, "{refitted}");
    assert!(refitted < 0.9 * rms("urdf_alone"), "{refitted}");
    // Without its effects the calibrated URDF is worse than the untouched one: nobody is told to apply it.
    assert!(rms("urdf_alone") > rms("registration_only"));
    let step = report["next_steps"][0].as_str().expect("a step");
    for file in ["`arm.calibrated.model.json`", "`arm.calibrated.alone.urdf`"] {
        assert!(step.contains(file), "{step}");
    }
    let told = dir.calib(["run", "arm.yaml", "--out", "out2"]);
    assert!(!told.stdout.contains("calib apply"), "{}", told.stdout);
    let applied = dir.calib(["apply", "out", "arm.urdf", "--diff"]);
    let said = applied.words()
        + &applied
            .stderr
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
    assert!(said.contains("use it only with the effects"), "{said}");
    // As a robot of its own, with nothing free but where it stands, the file does what was stated of it.
    let alone = dir.read("out/arm.calibrated.alone.urdf");
    let registered = heavy.replace(", joint_offsets, joint_axes, compliance", "");
    let again = ran(&laboratory((&arm, &heavy), (&alone, &registered)));
    let again = &again["verification"]["held_out"]["registration_only"]["rms_m"];
    let again = again.as_f64().expect("registered");
    assert!((again / refitted - 1.0).abs() < 0.02, "{again} {refitted}");
}

/// Masses far from rods: a light upper arm, a heavy forearm, a hand with its center aside.
pub const UNEVEN: [&str; 3] = [
    "<inertial><origin xyz=\"0.03 0 0.1\"/><mass value=\"3\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>",
    "<inertial><origin xyz=\"0.2 0 0.08\"/><mass value=\"6\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>",
    "<inertial><origin xyz=\"0.1 0.12 0\"/><mass value=\"4\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>",
];

#[test]
fn free_masses_find_the_proportions_that_rods_do_not_have() {
    let (real, nominal) = (urdf(UNEVEN), urdf(MASSLESS));
    let soft = PROFILE.replace("{j2: 0.02, j3: 0.03}", "{j2: 0.04, j3: 0.06}");
    let rods = ran(&laboratory((&real, &soft), (&nominal, &soft)));
    let freed = soft.replace(", compliance]", ", compliance, masses]");
    let dir = laboratory((&real, &soft), (&nominal, &freed));
    let report = ran(&dir);
    assert!(
        rms_m(&rods) > 2.0 * rms_m(&report),
        "{} {}",
        rms_m(&rods),
        rms_m(&report)
    );
    assert!(rms_m(&report) < NOISE, "{}", rms_m(&report));
    let found = report["parameters"].as_array().expect("a list");
    let moments = found.iter().filter(|p| p["kind"] == "first_moment");
    assert!(moments.count() >= 5);
}
