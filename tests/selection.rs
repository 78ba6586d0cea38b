//! `calib run --select`: the physics that the recordings support, chosen by prediction, and a run of the chosen model.

use crate::scratch;

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
