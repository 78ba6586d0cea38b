//! `calib run --select`: the physics that the recordings support, chosen by prediction, and a run of the chosen model.

use crate::scratch;

use crate::structural::{Design, FOUR, Setting};
use scratch::Scratch;
use serde_json::Value;

/// What a test compares: everything that was estimated.
fn estimates(report: &Value) -> Value {
    serde_json::json!({
        "parameters": report["parameters"],
        "transforms": report["transforms"],
        "verification": report["verification"],
        "noise": report["noise"],
    })
}

/// The lines of a profile without its `solve:` block.
pub fn without_solve(profile: &str) -> String {
    let mut inside = false;
    let kept = profile.lines().filter(|line| {
        if !line.starts_with([' ', '#']) && !line.is_empty() {
            inside = line.starts_with("solve:");
        }
        !inside
    });
    kept.map(|line| format!("{line}\n")).collect()
}

#[test]
fn compliance_is_chosen_where_the_profile_does_not_free_it() {
    if !skipped_tests::thorough() {
        return;
    }
    let dir = Scratch::new().robot("justin").edit(
        "robots/justin.yaml",
        "free: [bodies, tracker, joint_offsets, joint_axes, compliance]",
        "free: [bodies, tracker, joint_offsets, joint_axes]",
    );
    let plain = dir.calib(["run", "robots/justin.yaml", "--out", "plain"]);
    let chosen = dir.calib(["run", "robots/justin.yaml", "--select", "--out", "chosen"]);
    assert!(plain.code <= 2 && chosen.code <= 2, "{}", chosen.stderr);
    let report = dir.json("chosen/report.json");
    let selection = &report["selection"];
    let added = selection["added"].as_array().expect("a list");
    let compliant = |part: &&Value| {
        part["effect"]
            .as_str()
            .is_some_and(|e| e.ends_with("compliance"))
    };
    assert!(added.iter().filter(compliant).count() >= 2, "{added:?}");
    let rms = |report: &Value| {
        let held_out = &report["verification"]["held_out"]["calibrated"];
        held_out["rms_m"].as_f64().expect("validation poses")
    };
    let (before, after) = (rms(&dir.json("plain/report.json")), rms(&report));
    assert!(after < 0.9 * before, "{before} {after}");
    // The block that it prints gives the same numbers without the choice.
    let block = selection["solve"].as_str().expect("YAML");
    let rest = "  prior: {position_mm: 5, angle_deg: 0.5, offset_deg: 0.5, compliance_deg_per_nm: 0.02}\n  \
                limits: {held_out_rms_mm: 3, held_out_max_mm: 8}\n";
    let profile = without_solve(&dir.read("robots/justin.yaml")) + block + rest;
    let dir = dir.file("robots/pasted.yaml", profile);
    let pasted = dir.calib(["run", "robots/pasted.yaml", "--out", "pasted"]);
    assert_eq!(pasted.code, chosen.code, "{}{block}", pasted.stderr);
    let pasted = dir.json("pasted/report.json");
    // …but for what the choice leaves uncertain, which is as large for every number.
    let factor = selection["sigma_factor"].as_f64().unwrap_or(1.0);
    assert!((1.0..3.0).contains(&factor), "{factor}");
    let numbers = |report: &Value, key: &str| -> Vec<(String, Option<f64>)> {
        let parameters = report["parameters"].as_array().expect("a list");
        let of = |p: &Value| (p["name"].to_string(), p[key].as_f64());
        parameters.iter().map(of).collect()
    };
    assert_eq!(numbers(&pasted, "value"), numbers(&report, "value"));
    let (given, chosen) = (numbers(&pasted, "sigma"), numbers(&report, "sigma"));
    for ((name, given), (_, chosen)) in given.into_iter().zip(chosen) {
        let (Some(given), Some(chosen)) = (given, chosen) else {
            continue;
        };
        assert!(
            (chosen / given / factor - 1.0).abs() < 1e-6,
            "{name}: {given} {chosen}"
        );
    }
}

#[test]
fn nothing_to_choose_is_the_run_of_the_profile() {
    if !skipped_tests::thorough() {
        return;
    }
    let dir = Scratch::new().robot("ripley");
    let plain = dir.calib(["run", "robots/ripley.yaml", "--out", "plain"]);
    let chosen = dir.calib(["run", "robots/ripley.yaml", "--select", "--out", "chosen"]);
    assert_eq!(plain.code, chosen.code, "{}", chosen.stderr);
    let report = dir.json("chosen/report.json");
    assert_eq!(report["selection"]["added"], serde_json::json!([]));
    assert_eq!(
        estimates(&report),
        estimates(&dir.json("plain/report.json"))
    );
    let shown = dir.calib(["run", "robots/ripley.yaml", "--compare-models"]);
    assert_eq!(shown.code, 0, "{}", shown.stderr);
    let again = dir.calib(["run", "robots/ripley.yaml", "--compare-models", "--json"]);
    let again: Value = serde_json::from_str(&again.stdout).expect("JSON");
    assert_eq!(again, report["selection"]);
}

/// The elbow's gear train is 0.6 mrad out of center and its motor turns 121 times as fast: nobody stated the ratio.
#[test]
fn a_gear_ratio_that_nobody_stated_is_found_and_its_remedy_works() {
    let setting = Setting::new(Design::Random(60), FOUR, 50);
    let dir = setting.simulated_with(&[
        ("joint_offsets, joint_axes]", "joint_offsets]"),
        (", axis_mm: 0.8, axis_deg: 0.15", ""),
        (
            "{marker_mm: 0.3, joint_deg: 0.02}",
            "{marker_mm: 0.1, joint_deg: 0.005}",
        ),
    ]);
    let clean = dir.calib(["run", "arm.yaml", "--select", "--out", "clean"]);
    assert!(clean.code < 2, "{}", clean.stderr);
    let found = |report: &Value| {
        let all = report["findings"].as_array().expect("a list").iter();
        let of_gear = |f: &&Value| f["id"] == "gear-ratio-found";
        all.clone().find(of_gear).map(|f| f["facts"].clone())
    };
    assert_eq!(found(&dir.json("clean/report.json")), None);
    let dir = dir.cells("poses.csv", |_, column, cell| match cell.parse::<f64>() {
        Ok(q) if column == "elbow_deg" => {
            let error = 6e-4 * (121.0 * q.to_radians()).sin();
            format!("{:.6}", q - error.to_degrees())
        }
        _ => cell.to_owned(),
    });
    let chosen = dir.calib(["run", "arm.yaml", "--select", "--out", "chosen"]);
    assert!(chosen.code < 2, "{}", chosen.stderr);
    let facts = found(&dir.json("chosen/report.json")).expect("a gear ratio");
    assert_eq!(facts["joint"], "elbow");
    assert_eq!(facts["stated"], "121");
    // The remedy, as it is said.
    let dir = dir
        .edit(
            "arm.yaml",
            "r17.urdf}",
            "r17.urdf, gear_ratio: {elbow: 121}}",
        )
        .edit(
            "arm.yaml",
            "joint_offsets]",
            "joint_offsets, motor_eccentricity]",
        );
    let applied = dir.calib(["run", "arm.yaml", "--out", "applied"]);
    assert!(applied.code < 2, "{}", applied.stderr);
    let report = dir.json("applied/report.json");
    let parameters = report["parameters"].as_array().expect("a list").iter();
    let of_gear = |p: &&Value| p["name"] == "elbow.motor_eccentricity_sin";
    let sine = parameters.clone().find(of_gear).expect("the gear's error");
    let number = |key: &str| sine[key].as_f64().expect("a number");
    assert!(
        (number("value") - 6e-4).abs() < 4.0 * number("sigma") && number("sigma") < 1e-4,
        "{sine}"
    );
    let rms = |report: &Value| {
        let predicted = &report["verification"]["held_out"]["calibrated"];
        predicted["rms_m"].as_f64().expect("left-out poses")
    };
    let (before, after) = (rms(&dir.json("chosen/report.json")), rms(&report));
    assert!(after < 0.85 * before, "{before} {after}");
}
