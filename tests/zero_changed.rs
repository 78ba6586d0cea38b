//! A joint's zero that changed between the fitted recordings and the validation.

use crate::changes;
use crate::effects;
use crate::scratch;

use effects::{Effect, PROFILE, laboratory};
use scratch::Scratch;
use serde_json::Value;

/// What changed in the arm before its validation, rad.
const SLIPPED: f64 = 0.005;

fn run(dir: &Scratch, profile: &str) -> Value {
    dir.calib(["run", profile, "--out", "out"]);
    dir.json("out/report.json")
}

/// Findings that are more than information.
fn warnings(report: &Value) -> Vec<&Value> {
    let all = report["findings"].as_array().expect("findings").iter();
    all.filter(|f| f["severity"] != "info").collect()
}

/// The arm with what its joints do in the validation alone.
fn arm(in_validation: Effect) -> Scratch {
    let later = laboratory(PROFILE, 0.0, in_validation).read("arm/checks.csv");
    laboratory(PROFILE, 0.0, |_, _, _, _| 0.0).file("arm/checks.csv", later)
}

#[test]
fn a_zero_that_changed_before_the_validation_is_named() {
    let designs: [(&str, Effect); 2] = [
        (
            "j1",
            |joint, _, _, _| if joint == 1 { SLIPPED } else { 0.0 },
        ),
        (
            "j2",
            |joint, _, _, _| if joint == 2 { SLIPPED } else { 0.0 },
        ),
    ];
    for (joint, effect) in designs {
        let report = run(&arm(effect), "arm.yaml");
        let found = warnings(&report);
        let [one] = found[..] else {
            panic!("{joint}: {found:#?}");
        };
        assert_eq!(one["id"], "joint-zero-changed", "{joint}: {one:#}");
        assert_eq!(one["severity"], "error", "{joint}: {one:#}");
        assert_eq!(one["facts"]["joint"], joint, "{one:#}");
        assert_eq!(one["about"]["recordings"], serde_json::json!(["checks"]));
        let value = |key: &str| one["facts"][key]["value"].as_f64().expect("a number");
        let off = value("step") - SLIPPED;
        assert!(off.abs() < 4.0 * value("sigma"), "{joint}: {one:#}");
        assert!(value("none") > 3.0 * value("best"), "{joint}: {one:#}");
        assert_eq!(report["diagnosis"]["evidence"], "joint-zero-changed");
        assert_eq!(report["verdict"], "rejected");
    }
}

/// At the last joint the body can have turned on its link as well.
#[test]
fn a_body_that_explains_as_much_as_a_zero_is_named_with_it() {
    let report = run(
        &arm(|joint, _, _, _| if joint == 3 { SLIPPED } else { 0.0 }),
        "arm.yaml",
    );
    let found = warnings(&report);
    let [one] = found[..] else {
        panic!("{found:#?}");
    };
    let named = &one["facts"];
    let told = one["id"] == "body-remounted" && named["joints"] == serde_json::json!(["j3"]);
    assert!(told, "{one:#}");
}

/// Readings of the validation that are off by a step are that of a changed zero; its sign is that of the readings turned.
#[test]
fn a_step_of_any_size_is_found_to_its_uncertainty() {
    for (joint, degrees) in [("shoulder", 0.6), ("elbow", -0.6), ("elbow", 4.0)] {
        let dir = changes::jumped(joint, 0, "robots/ripley/checks.csv", degrees);
        let report = run(&dir, "robots/ripley.yaml");
        let found = warnings(&report);
        let changed = found.iter().find(|f| f["id"] == "joint-zero-changed");
        let changed = changed.unwrap_or_else(|| panic!("{joint} {degrees}: {found:#?}"));
        assert_eq!(changed["facts"]["joint"], joint, "{changed:#}");
        let value = |key: &str| changed["facts"][key]["value"].as_f64().expect("a number");
        let off = value("step").to_degrees() + degrees;
        let sigma = value("sigma").to_degrees();
        assert!(off.abs() < 4.0 * sigma, "{joint}: {off} of {sigma}");
    }
}

/// A robot whose errors differ from posture to posture has no changed zero: its gain is wrong.
#[test]
fn a_robot_that_is_wrong_in_another_way_has_no_changed_zero() {
    let report = run(
        &laboratory(PROFILE, 0.0, |joint, _, _, q| match joint {
            2 => 0.01 * q,
            _ => 0.0,
        }),
        "arm.yaml",
    );
    let found = warnings(&report);
    let zero = found.iter().any(|f| f["id"] == "joint-zero-changed");
    assert!(!zero && !found.is_empty(), "{found:#?}");
}
