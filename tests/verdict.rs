//! What the verdict alone must stop, through the program, and that its counts are true.

use crate::scratch;

use scratch::{Scratch, finished};
use serde_json::Value;

const PROFILE: &str = "robots/ripley.yaml";
const CHECKS: &str = "robots/ripley/checks.csv";
const WRIST: &str = "robots/ripley/wrist_sweep.csv";
const VALIDATION: &str = "  checks: {file: ripley/checks.csv, use: validation}\n";

fn ripley() -> Scratch {
    Scratch::new().robot("ripley")
}

/// The report of a run that ends with this code.
#[track_caller]
fn report(dir: &Scratch, arguments: &[&str], code: i32) -> Value {
    let all = [&["run", PROFILE, "--out", "out"], arguments].concat();
    dir.calib_with(&all).expect(code);
    dir.json("out/report.json")
}

fn reasons(report: &Value) -> Vec<&str> {
    let ids = report["reason_ids"].as_array().expect("ids");
    ids.iter().filter_map(Value::as_str).collect()
}

/// A cell that is a number, moved.
fn moved(cell: &str, by: f64) -> String {
    cell.parse::<f64>()
        .map_or_else(|_| cell.to_owned(), |value| format!("{:.6}", value + by))
}

#[test]
fn reasons_have_ids_effects_and_values_beside_their_sentences() {
    for robot in ["ripley", "justin"] {
        for method in ["ml", "paper"] {
            let report = &finished(robot, method).report;
            let count = |key: &str| report[key].as_array().map_or(0, Vec::len);
            assert!(count("reasons") > 0);
            assert_eq!(count("reasons"), count("reason_ids"), "{robot} {method}");
            assert_eq!(count("reasons"), count("reason_facts"), "{robot} {method}");
            for (id, fact) in reasons(report)
                .iter()
                .zip(report["reason_facts"].as_array().expect("facts"))
            {
                assert_eq!(fact["id"], **id);
                assert!(fact["effect"].is_string() && fact["values"].is_object());
            }
        }
        let accepted = &finished(robot, "ml").report;
        assert!(
            accepted["reason_facts"]
                .as_array()
                .expect("facts")
                .iter()
                .all(|f| f["effect"] == "supports")
        );
        assert!(
            accepted["limits"][0]["high"].is_number(),
            "{}",
            accepted["limits"]
        );
    }
}

/// An encoder value outside of its limits is an error of the data; going on over it decides nothing.
#[test]
fn a_forced_run_is_never_accepted() {
    let dir = ripley().cells("robots/ripley/base_sweep.csv", |row, name, cell| {
        if row == 9 && name == "waist_deg" {
            "200".to_owned()
        } else {
            cell.to_owned()
        }
    });
    let report = report(&dir, &["--force"], 1);
    assert_eq!(report["verdict"], "not_evaluated");
    assert_eq!(reasons(&report)[0], "unresolved-error");
    assert_eq!(
        report["reason_facts"][0]["values"]["finding"],
        "joint-outside-limits"
    );
}

/// Fitted rows as validation, each coordinate 1 µm off: no byte is the same, and nothing new is tested.
#[test]
fn validation_that_repeats_fitted_rows_is_void() {
    let dir = ripley();
    let poses = dir.read("robots/ripley/arm_poses.csv");
    let few: Vec<&str> = poses.lines().take(3 + 12).collect();
    let dir = dir
        .file(CHECKS, few.join("\n") + "\n")
        .cells(CHECKS, |_, name, cell| {
            if name.ends_with("_m") {
                moved(cell, 1e-6)
            } else {
                cell.to_owned()
            }
        });
    let report = report(&dir, &[], 1);
    assert_eq!(report["verdict"], "not_evaluated");
    assert_eq!(reasons(&report)[0], "validation-repeats-fit");
    // The same postures read again, within the noise of the readings, are no better.
    let again = dir.cells(CHECKS, |row, name, cell| {
        if name.ends_with("_deg") {
            moved(cell, if row % 2 == 0 { 0.015 } else { -0.015 })
        } else {
            cell.to_owned()
        }
    });
    let report = self::report(&again, &[], 1);
    assert_eq!(reasons(&report)[0], "validation-repeats-fit");
}

/// The gripper's body was knocked by 40 mm before the sweep of the wrist: what the rest of the data explain is right, and a
/// whole recording contradicts it.
#[test]
fn a_sweep_that_is_rejected_as_a_whole_is_not_a_quiet_line() {
    if !skipped_tests::thorough() {
        return;
    }
    let dir = ripley().cells(WRIST, |_, name, cell| {
        if name.starts_with("gripM") && name.ends_with(".z_m") {
            moved(cell, 0.04)
        } else {
            cell.to_owned()
        }
    });
    let ran = dir.calib(["run", PROFILE, "--out", "out"]);
    assert_ne!(ran.code, 0, "{}", ran.stdout);
    if ran.code == 1 {
        let report = dir.json("out/report.json");
        assert_eq!(report["verdict"], "rejected");
        let findings = report["findings"].as_array().expect("a list").iter();
        let mut of_rows = findings.filter(|f| f["id"] == "row-outlier");
        let knocked = of_rows
            .any(|f| f["about"]["name"] == "gripM" && f["about"]["recordings"][0] == "wrist_sweep");
        assert!(knocked, "{:#}", report["findings"]);
        assert_eq!(reasons(&report)[0], "rejected-part");
        // The rest of the data are not given up for it.
        let held_out = &report["verification"]["held_out"]["calibrated"]["rms_m"];
        assert!(held_out.as_f64() < Some(1e-3), "{held_out}");
    }
}

/// Without a validation recording every fitted pose is predicted from the others: a warning, and the limits apply.
#[test]
fn without_validation_poses_are_left_out_in_turn() {
    if !skipped_tests::thorough() {
        return;
    }
    let profile = ripley().read(PROFILE);
    let stated = profile.split("simulate:").next().unwrap_or_default();
    let dir = ripley().file(PROFILE, stated).edit(PROFILE, VALIDATION, "");
    let ran = dir.calib(["run", PROFILE, "--out", "out"]).expect(0);
    assert!(
        ran.stdout.contains("ACCEPTED WITH 1 WARNING\n"),
        "{}",
        ran.stdout
    );
    let report = dir.json("out/report.json");
    assert_eq!(report["verdict"], "accepted_with_warnings");
    assert_eq!(reasons(&report)[0], "leave-one-out");
    let held_out = &report["verification"]["held_out"];
    assert_eq!(held_out["left_out"], true);
    // The stated uncertainty predicts the errors.
    let z2 = held_out["z2_per_dof"].as_f64().expect("predicted");
    assert!((0.9..1.1).contains(&z2), "{z2}");
    self::report(&dir, &["--strict"], 1);
    // One row is held out and the rest fitted again: the same error, up to noise levels and outliers of the new fit.
    let table = dir.read("robots/ripley/arm_poses.csv");
    let lines: Vec<&str> = table.lines().collect();
    let (head, rows) = lines.split_at(3);
    let rest: Vec<&str> = head.iter().chain(&rows[1..]).copied().collect();
    let alone = [head, &rows[..1]].concat();
    let refit = dir
        .file("robots/ripley/arm_poses.csv", rest.join("\n") + "\n")
        .file(CHECKS, alone.join("\n") + "\n")
        .edit(
            PROFILE,
            "  arm_poses: {",
            &format!("{VALIDATION}  arm_poses: {{"),
        );
    refit.calib(["run", PROFILE, "--out", "again"]);
    let refit = refit.json("again/report.json");
    let first = |report: &Value, pose: &str| -> Vec<f64> {
        let poses = report["verification"]["held_out"]["poses"]
            .as_array()
            .expect("poses")
            .clone();
        let of_pose = poses.iter().filter(|p| p["pose"] == pose);
        of_pose.filter_map(|p| p["calibrated_m"].as_f64()).collect()
    };
    let (hat, refitted) = (first(&report, "arm_poses:4"), first(&refit, "checks:4"));
    assert!(
        hat.len() >= 7 && hat.len() == refitted.len(),
        "{hat:?} {refitted:?}"
    );
    for (hat, refitted) in hat.iter().zip(&refitted) {
        assert!(
            (hat - refitted).abs() < 0.03 * refitted + 5e-6,
            "{hat} {refitted}"
        );
    }
}

/// Held-out rows are screened by the gate of the fit: declared, counted, shown with and without.
#[test]
fn gross_outliers_among_held_out_rows_are_screened_and_counted() {
    let spoiled = |rows: usize| {
        ripley().cells(CHECKS, move |row, name, cell| {
            if row < rows && name == "gripM_2.y_m" {
                moved(cell, 0.03)
            } else {
                cell.to_owned()
            }
        })
    };
    let one = spoiled(1);
    let ran = one.calib(["run", PROFILE, "--force", "--out", "out", "--full"]);
    let report = one.json("out/report.json");
    let held_out = &report["verification"]["held_out"];
    assert_eq!(held_out["screened"], 1, "{}", ran.stdout);
    assert!(held_out["calibrated"]["max_m"].as_f64() < Some(0.004));
    assert!(held_out["with_screened"]["max_m"].as_f64() > Some(0.025));
    assert!(
        reasons(&report).contains(&"screened-held-out"),
        "{:?}",
        reasons(&report)
    );
    assert!(ran.words().contains("screened out"), "{}", ran.stdout);
}

/// Every measurement of every recording has one fate, and all lists agree on it.
#[test]
fn counts_add_up_everywhere() {
    let mut reports = Vec::new();
    for robot in ["ripley", "justin"] {
        for method in ["ml", "paper"] {
            reports.push((
                format!("{robot} {method}"),
                finished(robot, method).report.clone(),
            ));
        }
    }
    let knocked = ripley().cells(WRIST, |row, name, cell| {
        if row < 3 && name.starts_with("gripM_1") {
            moved(cell, 0.02)
        } else {
            cell.to_owned()
        }
    });
    knocked.calib(["run", PROFILE, "--force", "--out", "out"]);
    reports.push(("outliers".to_owned(), knocked.json("out/report.json")));
    let lost = ripley().cells(WRIST, |row, name, cell| {
        let gone =
            row % 5 == 0 && name.starts_with("gripM") || row == 7 && name == "wrist_roll_deg";
        if gone { String::new() } else { cell.to_owned() }
    });
    lost.calib(["run", PROFILE, "--force", "--out", "out"]);
    reports.push(("lost".to_owned(), lost.json("out/report.json")));
    for (name, report) in &reports {
        let number = |value: &Value| value.as_u64().unwrap_or_else(|| panic!("{name}: {value}"));
        let (mut used, mut rejected) = (0, 0);
        for recording in report["recordings"].as_array().expect("recordings") {
            let of = |key: &str| number(&recording[key]);
            assert_eq!(
                of("used") + of("rejected") + of("excluded") + of("rows_lost"),
                of("rows"),
                "{name}: {recording}"
            );
            let fates = &recording["measurements"];
            let of = |key: &str| number(&fates[key]);
            assert_eq!(
                of("used") + of("rejected") + of("excluded") + of("lost"),
                of("of"),
                "{name}: {fates}"
            );
            let listed = report["rejected"].as_array().expect("a list");
            let listed = listed
                .iter()
                .filter(|r| r["recording"] == recording["name"]);
            let listed: u64 = listed.map(|r| number(&r["measurements"])).sum();
            assert_eq!(
                listed,
                of("rejected") + of("excluded"),
                "{name}: {recording}"
            );
            if recording["used_for"] == "validation" {
                let held_out = &report["verification"]["held_out"];
                assert_eq!(number(&held_out["n"]), of("used"), "{name}: {recording}");
                assert_eq!(
                    number(&held_out["screened"]),
                    of("rejected"),
                    "{name}: {recording}"
                );
            } else {
                used += of("used");
                rejected += of("rejected");
            }
        }
        let residuals = &report["residuals"];
        assert_eq!(number(&residuals["all"]["samples"]), used, "{name}");
        assert_eq!(number(&residuals["rejected"]), rejected, "{name}");
        if report["fit"].is_object() {
            assert_eq!(number(&report["fit"]["observations"]), used, "{name}");
        }
    }
}

/// Six revolute joints: yaw, pitch, pitch, roll, pitch, roll.
fn arm_urdf() -> String {
    let joints = [
        ("0 0 0.29", "0 0 1"),
        ("0.03 0 0.11", "0 1 0"),
        ("0 0 0.35", "0 1 0"),
        ("0.12 0 0.06", "1 0 0"),
        ("0.25 0 0", "0 1 0"),
        ("0.08 0 0", "1 0 0"),
    ];
    let mut text = String::from("<robot name=\"arm\"><link name=\"l0\"/>\n");
    for (i, (xyz, axis)) in joints.iter().enumerate() {
        let n = i + 1;
        text += &format!(
            "<link name=\"l{n}\"/><joint name=\"j{n}\" type=\"revolute\"><parent link=\"l{i}\"/><child link=\"l{n}\"/>\
             <origin xyz=\"{xyz}\" rpy=\"0 0 0\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-3\" upper=\"3\" effort=\"50\" velocity=\"2\"/></joint>\n"
        );
    }
    text + "</robot>\n"
}

/// An arm with a body on its flange; `(name, use, what simulates it)` per recording.
fn arm(markers: &str, names: &str, recordings: &[(&str, &str, &str)]) -> Scratch {
    let lines = |line: &dyn Fn(&(&str, &str, &str)) -> String| -> String {
        recordings.iter().map(line).collect::<Vec<_>>().join("\n")
    };
    let files =
        lines(&|(name, usage, _)| format!("  {name}: {{file: arm/{name}.csv, use: {usage}}}"));
    let simulated = lines(&|(name, _, how)| format!("    {name}: {{{how}}}"));
    let foot = "b1: [-120, -100, 0], b2: [130, -90, 0], b3: [110, 100, 20], b4: [-100, 120, 60]";
    let profile = format!(
        "calib: 1
robot: {{name: arm, urdf: arm/arm.urdf}}
tracker: {{frame: lab, marker_sigma_mm: 0.1}}
bodies:
  foot: {{link: l0, markers: [b1, b2, b3, b4], mount: {{}}, template_mm: {{{foot}}}}}
  flange: {{link: l6, markers: [{names}]}}
recordings:
{files}
solve:
  free: [bodies, tracker, joint_offsets, joint_axes]
  limits: {{held_out_rms_mm: 2, held_out_max_mm: 10}}
outputs: {{urdf: arm.calibrated.urdf, scene: arm.scene.json}}
simulate:
  seed: 6
  tracker_from_root: {{xyz_mm: [900, 300, 100], rpy_deg: [0, 0, 40]}}
  mounts:
    foot: {{markers_mm: {{{foot}}}}}
    flange: {{xyz_mm: [40, 0, 0], markers_mm: {{{markers}}}}}
  errors: {{joint_offset_deg: 0.2, axis_mm: 0.5, axis_deg: 0.1, mount_mm: 0, mount_deg: 1}}
  noise: {{marker_mm: 0.1, joint_deg: 0.005}}
  recordings:
{simulated}
"
    );
    let dir = Scratch::new()
        .file("arm/arm.urdf", arm_urdf())
        .file("arm.yaml", profile);
    dir.calib(["simulate", "arm.yaml", "--out", "arm"])
        .expect(0);
    dir
}

const EVERYWHERE: &str = "random: {j1_deg: [-150, 150], j2_deg: [-60, 90], j3_deg: [-60, 60], \
                          j4_deg: [-150, 150], j5_deg: [-100, 100], j6_deg: [-170, 170]}, poses: ";

/// One joint at a time in the fit and in the validation: nothing is known of poses in which several move.
#[test]
fn sweeps_alone_are_never_accepted_without_a_warning() {
    let sweep = |joint: &str, to: i32, poses: usize| {
        let hold = [("j2", 20), ("j3", 30), ("j5", 40)]
            .into_iter()
            .filter(|(j, _)| *j != joint);
        let hold: Vec<String> = hold.map(|(j, at)| format!("{j}_deg: {at}")).collect();
        let hold = hold.join(", ");
        format!(
            "grid: [{{joint: {joint}_deg, from: -80, to: {to}, poses: {poses}}}], hold: {{{hold}}}"
        )
    };
    let joints = ["j1", "j2", "j3", "j4", "j5", "j6"];
    let how: Vec<(String, &str, String)> = joints
        .iter()
        .flat_map(|j| {
            let fitted = (format!("s_{j}"), "static", sweep(j, 80, 15));
            [fitted, (format!("v_{j}"), "validation", sweep(j, 71, 8))]
        })
        .collect();
    let how: Vec<(&str, &str, &str)> = how.iter().map(|(a, b, c)| (&**a, *b, &**c)).collect();
    let dir = arm(
        "f1: [0, 0, 0], f2: [70, 0, 0], f3: [20, 60, 0], f4: [40, 20, 45]",
        "f1, f2, f3, f4",
        &how,
    );
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    let report = dir.json("out/report.json");
    assert_ne!(report["verdict"], "accepted", "{}", ran.stdout);
    assert!(
        reasons(&report).contains(&"single-joint-data"),
        "{:?}",
        report["reasons"]
    );
    assert!(
        report["scope"].to_string().contains("one joint at a time"),
        "{}",
        report["scope"]
    );
    let strict = dir.calib(["run", "arm.yaml", "--strict", "--out", "out"]);
    assert_eq!(strict.code, 1, "{}", strict.stdout);
    // The columns of two joints exchanged: sweeps fit as well with a geometry that is 200 mm and 40° off.
    let exchanged = how.iter().fold(dir, |dir, (name, _, _)| {
        let table = format!("arm/{name}.csv");
        let text = dir.read(&table).replacen("j4_deg", "x", 1);
        let text = text
            .replace("j6_deg", "j4_deg")
            .replacen(",x,", ",j6_deg,", 1);
        dir.file(&table, text)
    });
    let ran = exchanged.calib(["run", "arm.yaml", "--out", "out"]);
    assert_ne!(ran.code, 0, "{}", ran.stdout);
    if ran.code == 1 {
        let report = exchanged.json("out/report.json");
        let named = reasons(&report).contains(&"implausible-change");
        assert!(named, "{:?}", report["reasons"]);
    }
}

/// The last joint has the wrong sign and all markers are within 12 mm of its axis, the first one on it: positions alone say
/// little, in any order of the markers.
#[test]
fn a_wrist_sign_near_its_axis_is_not_accepted() {
    let markers = "f1: [0, 0, 0], f2: [60, 8, 0], f3: [25, 0, 12]";
    let recordings = [
        ("poses", "static", format!("{EVERYWHERE}40")),
        ("checks", "validation", format!("{EVERYWHERE}15")),
    ];
    let recordings: Vec<(&str, &str, &str)> = recordings
        .iter()
        .map(|(a, b, c)| (*a, *b, c.as_str()))
        .collect();
    for names in ["f1, f2, f3", "f3, f2, f1"] {
        let clean = arm(markers, names, &recordings);
        let ran = clean.calib(["run", "arm.yaml", "--out", "out"]);
        assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
        let held_out = clean.json("out/report.json")["verification"]["held_out"].clone();
        assert_eq!(held_out["n"], 45, "every marker counts");
        let faulty = ["arm/poses.csv", "arm/checks.csv"]
            .iter()
            .fold(clean, |dir, table| {
                dir.cells(table, |_, name, cell| match cell.parse::<f64>() {
                    Ok(q) if name == "j6_deg" => (-q).to_string(),
                    _ => cell.to_owned(),
                })
            });
        for force in [false, true] {
            let arguments = ["run", "arm.yaml", "--out", "faulty", "--force"];
            let ran = faulty.calib_with(&arguments[..if force { 5 } else { 4 }]);
            assert_ne!(ran.code, 0, "{names}: {}", ran.stdout);
        }
        let report = faulty.json("faulty/report.json");
        assert_eq!(report["verdict"], "rejected", "{:?}", report["reasons"]);
    }
}

/// Where a tracker writes poses and nobody states their noise, a fault of the recordings is part of the noise that the fit finds: it is no bound of
/// any robot.
#[test]
fn noise_that_only_the_residuals_show_is_no_bound() {
    const JUSTIN: &str = "robots/justin.yaml";
    let stated = ", body_sigma_mm: 0.5, body_sigma_deg: 0.15";
    for (noise, from_residuals) in [(stated, false), ("", true)] {
        let dir = Scratch::new()
            .robot("justin")
            .edit(JUSTIN, "held_out_rms_mm: 3", "held_out_rms_mm: 0.3")
            .edit(JUSTIN, stated, noise);
        let ran = dir.calib(["run", JUSTIN, "--out", "out"]);
        assert_eq!(ran.code, 1, "{}{}", ran.stdout, ran.stderr);
        let diagnosis = &dir.json("out/report.json")["diagnosis"];
        assert_eq!(diagnosis["kind"], "limit_below_noise");
        assert_eq!(diagnosis["from_residuals"], from_residuals);
        let words = ran.words();
        assert_eq!(words.contains("no robot can meet it"), !from_residuals);
        assert_eq!(
            words.contains("State the noise of the tracker"),
            from_residuals
        );
    }
}
