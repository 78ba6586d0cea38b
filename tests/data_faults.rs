//! What a laboratory gets wrong between recording and profile: each mistake put into Ripley's recordings is named by
//! `calib check` and by `calib run`; exchanged markers are put right; the clean recordings stay silent.

use crate::scratch;
use crate::truth;

use calib_geometry::registration::rigid_registration;
use nalgebra::Point3;
use scratch::Scratch;
use serde_json::Value;
use truth::{CHI2_99_SIX, Truth, errors};

const PROFILE: &str = "robots/ripley.yaml";
const TABLES: [&str; 4] = [
    "robots/ripley/arm_poses.csv",
    "robots/ripley/base_sweep.csv",
    "robots/ripley/wrist_sweep.csv",
    "robots/ripley/checks.csv",
];

fn ripley() -> Scratch {
    Scratch::new().robot("ripley")
}

fn findings(dir: &Scratch, profile: &str) -> Vec<Value> {
    let checked = dir.calib(["check", profile, "--json"]);
    let json: Value = serde_json::from_str(&checked.stdout)
        .unwrap_or_else(|e| panic!("{e}: {}{}", checked.stdout, checked.stderr));
    json["findings"].as_array().expect("a list").clone()
}

/// `calib check` names `id`, and `calib run` stops with it and writes nothing.
fn is_named(dir: &Scratch, id: &str, words: &str) {
    let found = findings(dir, PROFILE);
    let named = found.iter().find(|f| f["id"] == id);
    let named = named.unwrap_or_else(|| panic!("no {id} in {found:#?}"));
    let text = named.to_string();
    assert!(text.contains(words), "{text}");
    assert!(!named["remedy"].as_str().unwrap_or_default().is_empty());
    let ran = dir.calib(["run", PROFILE, "--out", "out"]);
    assert_eq!(ran.code, 3, "{}", ran.stdout);
    assert!(ran.stderr.contains(id), "{}", ran.stderr);
    assert!(!dir.path("out").exists());
}

/// All tables with the cells of one column changed.
fn changed(column: &str, change: impl Fn(f64) -> f64) -> Scratch {
    TABLES.iter().fold(ripley(), |dir, table| {
        dir.cells(table, |_, name, cell| match cell.parse::<f64>() {
            Ok(value) if name == column => change(value).to_string(),
            _ => cell.to_owned(),
        })
    })
}

#[test]
fn clean_recordings_are_silent() {
    for robot in ["ripley", "justin"] {
        let dir = Scratch::new().robot(robot);
        let found = findings(&dir, &format!("robots/{robot}.yaml"));
        assert!(found.is_empty(), "{robot}: {found:#?}");
    }
}

#[test]
fn a_joint_with_the_wrong_sign() {
    // Within its limits on both sides.
    is_named(
        &changed("wrist_pitch_deg", |q| -q),
        "joint-sign",
        "wrist_pitch",
    );
}

#[test]
fn two_joints_in_the_wrong_order() {
    let dir = TABLES.iter().fold(ripley(), |dir, table| {
        let text = dir.read(table);
        let text = text
            .replace("wrist_pitch_deg", "X")
            .replace("wrist_roll_deg", "wrist_pitch_deg")
            .replace('X', "wrist_roll_deg");
        dir.file(table, text)
    });
    is_named(&dir, "joint-order", "wrist_roll");
}

#[test]
fn a_body_on_another_link() {
    // Without the origins, which the profile itself would contradict.
    let profile = ripley().read(PROFILE);
    let cut = |from: &str, to: &str, text: String| -> String {
        let (start, end) = (
            text.find(from).expect("there"),
            text.find(to).expect("there"),
        );
        text[..start].to_owned() + &text[end..]
    };
    let profile = cut("origins:\n", "solve:\n", profile);
    let end = profile.find("simulate:\n").expect("there");
    let dir = ripley().file(PROFILE, &profile[..end]).edit(
        PROFILE,
        "gripM: {link: gripper",
        "gripM: {link: forearm",
    );
    is_named(&dir, "wrong-mount", "gripM");
}

#[test]
fn joint_values_of_the_row_before() {
    // Postures at random, each with the joint values of the one before.
    let dir = ripley();
    let table = TABLES[0];
    let text = dir.read(table);
    let (comments, rows): (Vec<&str>, Vec<&str>) = text.lines().partition(|l| l.starts_with('#'));
    let header: Vec<&str> = rows[0].split(',').collect();
    let is_joint: Vec<bool> = header.iter().map(|h| h.ends_with("_deg")).collect();
    let cells: Vec<Vec<&str>> = rows[1..].iter().map(|r| r.split(',').collect()).collect();
    let mut lines = comments.iter().map(|c| (*c).to_owned()).collect::<Vec<_>>();
    lines.push(rows[0].to_owned());
    for (i, row) in cells.iter().enumerate() {
        let before = &cells[i.saturating_sub(1)];
        let mixed = row.iter().zip(before).zip(&is_joint);
        let mixed: Vec<&str> = mixed
            .map(|((own, old), j)| if *j { *old } else { *own })
            .collect();
        lines.push(mixed.join(","));
    }
    let dir = dir.file(table, lines.join("\n") + "\n");
    is_named(&dir, "clock-lag", "1 row after");
}

#[test]
fn radians_in_a_column_of_degrees() {
    let dir = [
        "waist_deg",
        "shoulder_deg",
        "elbow_deg",
        "wrist_pitch_deg",
        "wrist_roll_deg",
    ]
    .iter()
    .fold(ripley(), |dir, column| {
        TABLES.iter().fold(dir, |dir, table| {
            dir.cells(table, |_, name, cell| match cell.parse::<f64>() {
                Ok(value) if name == *column => value.to_radians().to_string(),
                _ => cell.to_owned(),
            })
        })
    });
    is_named(&dir, "unit-mismatch", "radians");
}

#[test]
fn quaternions_with_w_first() {
    let profile = "robots/justin.yaml";
    let tables = ["arm_poses", "hand_sweep", "head_sweep", "torso_tests"];
    // The columns keep their names: what is called x is w.
    let dir = tables
        .iter()
        .fold(Scratch::new().robot("justin"), |dir, table| {
            let table = format!("robots/justin/{table}.csv");
            let text = dir.read(&table);
            let named = |text: String, body: &str| {
                [
                    ("qw", "w first"),
                    ("qz", "qw"),
                    ("qy", "qz"),
                    ("qx", "qy"),
                    ("w first", "qx"),
                ]
                .iter()
                .fold(text, |text, (from, to)| {
                    text.replace(&format!("{body}.{from}"), &format!("{body}.{to}"))
                })
            };
            let text = ["heT", "haT"].iter().fold(text, |t, body| named(t, body));
            dir.file(&table, text)
        });
    let found = findings(&dir, profile);
    // One mistake of the exporter, one finding, with both bodies.
    let errors: Vec<_> = found.iter().filter(|f| f["severity"] == "error").collect();
    assert_eq!(errors.len(), 1, "{found:#?}");
    assert_eq!(errors[0]["id"], "quaternion-order", "{found:#?}");
    assert_eq!(
        errors[0]["facts"]["bodies"],
        serde_json::json!(["haT", "heT"])
    );
    let remedy = errors[0]["remedy"].as_str().unwrap_or_default();
    assert!(remedy.contains("quaternion_wxyz"), "{remedy}");
    let checked = dir.calib(["check", profile]);
    assert_eq!(checked.code, 3, "{}", checked.stdout);
    let ran = dir.calib(["run", profile, "--out", "out"]);
    assert_eq!(ran.code, 3, "{}", ran.stdout);
    assert!(ran.stderr.contains("quaternion_wxyz"), "{}", ran.stderr);
    assert!(!dir.path("out").exists());
    // With the scalar under its own name again, nothing is wrong.
    let clean = Scratch::new().robot("justin");
    assert!(findings(&clean, profile).is_empty());
}

#[test]
fn a_recording_with_y_up() {
    if !skipped_tests::thorough() {
        return;
    }
    let said = |dir: Scratch| dir.edit(PROFILE, "frame: vicon,", "frame: vicon, up_axis: +Z,");
    let clean = findings(&said(ripley()), PROFILE);
    assert!(clean.is_empty(), "{clean:#?}");
    // (x, y, z) with z up is (x, z, −y) with y up.
    let dir = TABLES.iter().fold(said(ripley()), |dir, table| {
        let dir = dir.cells(table, |_, name, cell| match cell.parse::<f64>() {
            Ok(y) if name.ends_with(".y_m") => (-y).to_string(),
            _ => cell.to_owned(),
        });
        let text = dir.read(table);
        let text = text
            .replace(".y_m", ".\u{1}")
            .replace(".z_m", ".y_m")
            .replace(".\u{1}", ".z_m");
        dir.file(table, text)
    });
    let found = findings(&dir, PROFILE);
    assert_eq!(found.len(), TABLES.len(), "{found:#?}");
    for finding in &found {
        assert_eq!(finding["id"], "up-axis");
        assert_eq!(finding["severity"], "warning");
        let facts = &finding["facts"];
        let off = facts["off"]["value"].as_f64().unwrap_or_default();
        assert!((off - std::f64::consts::FRAC_PI_2).abs() < 0.01, "{facts}");
        assert_eq!(facts["nearest"], "+Y");
        let remedy = finding["remedy"].as_str().unwrap_or_default();
        assert!(remedy.contains("`tracker: {up_axis: +Y}`"), "{remedy}");
    }
    // Only gravity asks where up is: a warning, which the report repeats.
    let ran = dir.calib(["run", PROFILE, "--out", "out"]);
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    let report = dir.json("out/report.json");
    let listed = report["findings"].as_array().expect("a list");
    assert!(listed.iter().any(|f| f["id"] == "up-axis"), "{listed:#?}");
    let other = dir.edit(PROFILE, "up_axis: +Z", "up_axis: +Y");
    assert!(findings(&other, PROFILE).is_empty());
}

#[test]
fn exchanged_markers_are_put_right_and_listed() {
    // Two labels exchanged in every seventh row of the arm poses, three turned around in every eleventh.
    let dir = ripley();
    let table = TABLES[0];
    let text = dir.read(table);
    let mut lines: Vec<String> = Vec::new();
    let mut header: Vec<String> = Vec::new();
    let mut rows = Vec::new();
    for line in text.lines() {
        if line.starts_with('#') || header.is_empty() {
            if !line.starts_with('#') {
                header = line.split(',').map(str::to_owned).collect();
            }
            lines.push(line.to_owned());
            continue;
        }
        let cells: Vec<&str> = line.split(',').collect();
        let mut new: Vec<&str> = cells.clone();
        let data = lines.len() - lines.iter().take_while(|l| l.starts_with('#')).count() - 1;
        let place = |marker: &str| {
            header
                .iter()
                .position(|h| *h == format!("{marker}.x_m"))
                .or_else(|| header.iter().position(|h| *h == format!("{marker}.x_mm")))
                .expect("a marker")
        };
        let order: &[(&str, &str)] = if data % 7 == 3 {
            &[("gripM_1", "gripM_3"), ("gripM_3", "gripM_1")]
        } else if data % 11 == 5 {
            &[
                ("linkM_1", "linkM_2"),
                ("linkM_2", "linkM_4"),
                ("linkM_4", "linkM_1"),
            ]
        } else {
            &[]
        };
        let all_seen = order.iter().all(|(m, _)| !cells[place(m)].is_empty());
        if all_seen {
            for (to, from) in order {
                for k in 0..3 {
                    new[place(to) + k] = cells[place(from) + k];
                }
            }
            if !order.is_empty() {
                // Line of the file, from 1.
                rows.push(lines.len() as u64 + 1);
            }
        }
        lines.push(new.join(","));
    }
    assert!(rows.len() >= 7, "{rows:?}");
    let dir = dir.file(table, lines.join("\n") + "\n");
    let ran = dir.calib(["run", PROFILE, "--out", "out"]);
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    let report = dir.json("out/report.json");
    let mut listed: Vec<u64> = report["findings"]
        .as_array()
        .expect("a list")
        .iter()
        .filter(|f| f["id"] == "marker-swap-repaired")
        .flat_map(|f| f["rows"].as_array().expect("a list").clone())
        .filter_map(|row| row.as_u64())
        .collect();
    listed.sort_unstable();
    assert_eq!(listed, rows);
    let truth = Truth::read(&dir.json("robots/ripley/truth.json"));
    for error in errors(&report, &truth) {
        assert!(
            error.chi2 < CHI2_99_SIX,
            "{}: χ² {}",
            error.name,
            error.chi2
        );
    }
    // And it is the calibration of the recording before the exchange.
    let clean = ripley();
    assert_eq!(clean.calib(["run", PROFILE, "--out", "out"]).code, 0);
    let clean = clean.json("out/report.json");
    assert_eq!(clean["transforms"], report["transforms"]);
}

/// A marker of one body is called like a marker of another: in all recordings, or in one. It is the calibration of the recordings before.
#[test]
fn labels_of_two_bodies_that_are_exchanged_are_put_right() {
    let tables = ["base_sweep", "wrist_sweep", "arm_poses", "checks"];
    let calibrated = |dir: &Scratch| {
        assert_eq!(dir.calib(["run", PROFILE, "--out", "out"]).code, 0);
        dir.json("out/report.json")
    };
    let clean = calibrated(&ripley())["transforms"].clone();
    for exchanged in [&tables[..], &tables[2..3], &tables[3..]] {
        let dir = exchanged.iter().fold(ripley(), |dir, table| {
            let path = format!("robots/ripley/{table}.csv");
            let text = dir.read(&path);
            let text = text
                .replace("linkM_2.", "\u{1}")
                .replace("gripM_3.", "linkM_2.")
                .replace('\u{1}', "gripM_3.");
            dir.file(&path, text)
        });
        let report = calibrated(&dir);
        let found = report["findings"].as_array().expect("a list").iter();
        let found: Vec<&Value> = found
            .filter(|f| f["id"] == "marker-swap-repaired")
            .collect();
        assert_eq!(found.len(), exchanged.len(), "{found:#?}");
        for finding in found {
            assert_eq!(finding["facts"]["kind"], "between_bodies");
            let names = [&finding["facts"]["first"], &finding["facts"]["second"]];
            assert!(names.contains(&&"linkM_2".into()) && names.contains(&&"gripM_3".into()));
        }
        assert_eq!(report["transforms"], clean);
        assert_ne!(report["verdict"], "rejected");
    }
}

/// One mistake: its name, the finding that must name it, and how it is made.
type Mistake = (&'static str, &'static str, fn(Scratch) -> Scratch);

/// The cells of one column in all tables.
fn column(dir: Scratch, column: &str, change: impl Fn(f64) -> f64) -> Scratch {
    TABLES.iter().fold(dir, |dir, table| {
        dir.cells(table, |_, name, cell| match cell.parse::<f64>() {
            Ok(value) if name == column => change(value).to_string(),
            _ => cell.to_owned(),
        })
    })
}

/// Two columns' names exchanged in all tables.
fn exchanged(dir: Scratch, a: &str, b: &str) -> Scratch {
    TABLES.iter().fold(dir, |dir, table| {
        let text = dir.read(table);
        let text = text.replace(a, "\u{1}").replace(b, a).replace('\u{1}', b);
        dir.file(table, text)
    })
}

const MISTAKES: [Mistake; 8] = [
    ("sign of wrist_pitch", "joint-sign", |dir| {
        column(dir, "wrist_pitch_deg", |q| -q)
    }),
    ("sign of waist", "joint-sign", |dir| {
        column(dir, "waist_deg", |q| -q)
    }),
    ("sign of elbow", "joint-sign", |dir| {
        column(dir, "elbow_deg", |q| -q)
    }),
    (
        "wrist_pitch and wrist_roll exchanged",
        "joint-order",
        |dir| exchanged(dir, "wrist_pitch_deg", "wrist_roll_deg"),
    ),
    ("elbow and shoulder exchanged", "joint-order", |dir| {
        exchanged(dir, "elbow_deg", "shoulder_deg")
    }),
    ("radians for degrees", "unit-mismatch", |dir| {
        ["waist", "shoulder", "elbow", "wrist_pitch", "wrist_roll"]
            .iter()
            .fold(dir, |dir, joint| {
                column(dir, &format!("{joint}_deg"), f64::to_radians)
            })
    }),
    ("half the counts of elbow", "joint-gain", |dir| {
        column(dir, "elbow_deg", |q| 2.0 * q)
    }),
    ("another gear of shoulder", "joint-gain", |dir| {
        column(dir, "shoulder_deg", |q| 0.7 * q)
    }),
];

/// A gain that the fit estimates does not stop a run: the fit finds it, and the held-out poses decide.
#[test]
fn a_gain_that_the_fit_estimates_is_a_warning() {
    let dir = column(ripley(), "elbow_deg", |q| 2.0 * q);
    let held = findings(&dir, PROFILE);
    assert!(
        held.iter().any(|f| f["facts"]["kind"] == "multiple_held"),
        "{held:#?}"
    );
    let free = dir.read(PROFILE).replace(
        "joint_offsets, joint_axes]",
        "joint_offsets, joint_axes, joint_gains]",
    );
    let dir = dir.file(PROFILE, free);
    let found = findings(&dir, PROFILE);
    let gain = found
        .iter()
        .find(|f| f["id"] == "joint-gain")
        .expect("named");
    assert_eq!(
        (&gain["severity"], &gain["facts"]["kind"]),
        (&"warning".into(), &"multiple".into())
    );
    let run = dir.calib(["run", PROFILE, "--out", "out"]);
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
}

/// Ripley with recordings of another robot of its kind.
fn drawn(seed: u64) -> Scratch {
    let dir = ripley();
    let seed = seed.to_string();
    let ran = dir.calib(["simulate", PROFILE, "--seed", &seed, "--out", "drawn"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    TABLES.iter().fold(dir, |dir, table| {
        let name = table.rsplit('/').next().expect("a name");
        let text = dir.read(&format!("drawn/{name}"));
        dir.file(table, text)
    })
}

/// (mistakes named, mistakes made, clean recordings with an error or warning)
fn recall(seeds: std::ops::Range<u64>) -> (usize, usize, usize) {
    let (mut named, mut made, mut alarms) = (0, 0, 0);
    for seed in seeds {
        let clean = findings(&drawn(seed), PROFILE);
        if clean.iter().any(|f| f["severity"] != "info") {
            println!("seed {seed}, clean: {clean:?}");
            alarms += 1;
        }
        for (what, id, make) in MISTAKES {
            let found = findings(&make(drawn(seed)), PROFILE);
            made += 1;
            if found.iter().any(|f| f["id"] == id) {
                named += 1;
            } else {
                println!("seed {seed}, {what}: {found:?}");
            }
        }
    }
    println!("{named} of {made} mistakes named, {alarms} false alarms");
    (named, made, alarms)
}

#[test]
fn mistakes_are_named_for_any_robot_of_the_kind() {
    if !skipped_tests::thorough() {
        return;
    }
    let (named, made, alarms) = recall(100..102);
    assert_eq!((named, alarms), (made, 0));
}

#[test]
#[ignore = "study: 50 robots, about ten minutes"]
fn recall_and_false_alarms_of_the_checks_against_the_model() {
    let (named, made, alarms) = recall(200..250);
    assert!(named * 100 >= made * 99, "{named} of {made}");
    assert!(alarms == 0, "{alarms} of 50");
}

/// One file under two names: each measurement counts once, and everything but the warning is what it is without the copy.
#[test]
fn a_recording_that_is_listed_twice_counts_once() {
    let dir = ripley();
    let copy = "recordings:\n  again: {file: ripley/arm_poses.csv, use: static}\n";
    let twice = dir.read(PROFILE).replacen("recordings:\n", copy, 1);
    let dir = dir.file("robots/twice.yaml", twice);
    let once = dir.calib(["run", PROFILE, "--out", "once"]);
    assert_eq!(once.code, 0, "{}", once.stderr);
    let found = findings(&dir, "robots/twice.yaml");
    assert_eq!(found.len(), 1, "{found:#?}");
    let named = &found[0];
    assert_eq!(
        (&named["id"], &named["severity"]),
        (&"rows-repeated".into(), &"warning".into())
    );
    let text = named.to_string();
    assert!(
        text.contains("again") && text.contains("arm_poses"),
        "{text}"
    );
    let ran = dir.calib(["run", "robots/twice.yaml", "--out", "twice"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(
        ran.words().contains("ACCEPTED WITH 1 WARNING"),
        "{}",
        ran.stdout
    );
    let sigmas = |out: &str| -> Vec<f64> {
        let report = dir.json(&format!("{out}/report.json"));
        let all = report["parameters"].as_array().expect("a list").clone();
        all.iter().filter_map(|p| p["sigma"].as_f64()).collect()
    };
    let (once, twice) = (sigmas("once"), sigmas("twice"));
    assert!(once.len() > 50 && once.len() == twice.len());
    for (a, b) in once.iter().zip(&twice) {
        assert!((a - b).abs() < 1e-6 * a.abs(), "{a} {b}");
    }
}

/// A table that was pasted below itself.
#[test]
fn rows_that_were_pasted_twice_count_once() {
    let dir = ripley();
    let table = "robots/ripley/arm_poses.csv";
    let text = dir.read(table);
    let rows: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
    let dir = dir.file(table, format!("{text}{}\n", rows[1..21].join("\n")));
    let found = findings(&dir, PROFILE);
    let named: Vec<&Value> = found
        .iter()
        .filter(|f| f["id"] == "rows-repeated")
        .collect();
    assert_eq!(named.len(), 1, "{found:#?}");
    assert!(named[0].to_string().contains("20 of"), "{named:?}");
    let ran = dir.calib(["run", PROFILE, "--out", "out"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(
        ran.words().contains("copies of the same measurements"),
        "{}",
        ran.stdout
    );
}

/// In every fourth row a marker is its mirror image in a window behind the robot: the distances prove it, and the fit never sees it. Taken for errors of an
/// incomplete model, such rows were readmitted.
#[test]
fn reflections_in_a_quarter_of_the_rows_are_left_out() {
    let tables = ["robots/ripley/arm_poses.csv", "robots/ripley/checks.csv"];
    let dir = tables.iter().fold(ripley(), |dir, table| {
        dir.cells(table, |row, name, cell| {
            let mirrored = name == "gripM_3.y_m" && row % 4 == 1;
            match cell.parse::<f64>() {
                Ok(y) if mirrored => (2.6 - y).to_string(),
                _ => cell.to_owned(),
            }
        })
    });
    let ran = dir.calib(["run", PROFILE, "--out", "out"]);
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    let report = dir.json("out/report.json");
    let rejected = report["rejected"].as_array().expect("a list");
    let ghosts = rejected.iter().filter(|r| r["cause"] == "out_of_place");
    let ghosts: Vec<&Value> = ghosts.collect();
    assert!(!ghosts.is_empty(), "{rejected:#?}");
    assert!(
        ghosts.iter().all(|r| r["subject"] == "gripM_3"),
        "{ghosts:#?}"
    );
    let rows = |name: &str| ghosts.iter().any(|r| r["recording"] == name);
    assert!(rows("arm_poses") && rows("checks"), "{ghosts:#?}");
    let names: Vec<&str> = report["findings"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|f| f["id"].as_str())
        .collect();
    assert!(names.contains(&"marker-outlier"), "{names:?}");
    let held_out = &report["verification"]["held_out"]["calibrated"]["rms_m"];
    assert!(
        held_out.as_f64().is_some_and(|rms| rms < 8e-4),
        "{held_out}"
    );
}

/// A sweep that is listed twice: an origin keeps the recording that it is found from, whichever name comes first. Where origins use both, that is said.
#[test]
fn a_sweep_that_is_listed_twice_stays_with_its_origin() {
    let dir = ripley();
    let profile = dir.read(PROFILE);
    let copy = |name: &str| {
        let spec =
            "file: ripley/wrist_sweep.csv, use: sweep, joints: {wrist_roll_deg: [-100, 100]}";
        let line = format!("recordings:\n  {name}: {{{spec}}}\n");
        profile.replacen("recordings:\n", &line, 1)
    };
    for name in ["a_copy", "z_copy"] {
        let dir = ripley().file(PROFILE, copy(name));
        let ran = dir.calib(["run", PROFILE, "--out", "out"]);
        assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
        let words = ran.words();
        assert!(words.contains("ACCEPTED WITH 1 WARNING"), "{name}: {words}");
        assert!(
            words.contains(&format!(
                "{name}: 21 of 21 rows repeat rows of `wrist_sweep`"
            )),
            "{words}"
        );
    }
    let again = "origins:\n  endK:\n    joint: wrist_roll\n    body: gripM\n    sweep: z_copy\n    axes: {x: wrist_roll}\n    orientation: {from: table}\n    point: {nominal_distance_from: base}\n";
    let both = copy("z_copy").replacen("origins:\n", again, 1);
    let found = findings(&ripley().file(PROFILE, both), PROFILE);
    let named = found.iter().find(|f| f["id"] == "rows-repeated");
    let named = named.unwrap_or_else(|| panic!("{found:#?}"));
    assert!(named.to_string().contains("count twice"), "{named:#}");
}

/// The tracker wrote the pose of a body beside the markers that it computed it from: `calib check` says that both are one measurement.
#[test]
fn a_pose_beside_its_own_markers_is_named() {
    let table = ripley().read("robots/ripley/arm_poses.csv");
    let mut header: Vec<String> = Vec::new();
    let mut template: Vec<Point3<f64>> = Vec::new();
    let mut lines = Vec::new();
    for line in table.lines() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if line.starts_with('#') {
            lines.push(line.to_owned());
            continue;
        }
        if header.is_empty() {
            header = cells.clone();
            cells.extend(
                ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"].map(|c| format!("plate.{c}")),
            );
            lines.push(cells.join(","));
            continue;
        }
        let at = |column: String| {
            let place = header.iter().position(|c| *c == column).expect("a column");
            cells[place].parse::<f64>().ok()
        };
        let marker = |k: usize| {
            let of = |axis: &str| at(format!("gripM_{k}.{axis}_m"));
            Some(Point3::new(of("x")?, of("y")?, of("z")?))
        };
        let seen: Option<Vec<Point3<f64>>> = (1..=4).map(marker).collect();
        let pose = seen.map(|seen| {
            if template.is_empty() {
                template.clone_from(&seen);
            }
            rigid_registration(&template, &seen, None)
                .expect("no line")
                .b_from_a
        });
        cells.extend(pose.map_or_else(
            || vec![String::new(); 7],
            |pose| {
                let (t, q) = (pose.translation, pose.rotation);
                [t.x, t.y, t.z, q.i, q.j, q.k, q.w]
                    .map(|v| format!("{v:.9}"))
                    .to_vec()
            },
        ));
        lines.push(cells.join(","));
    }
    let dir = ripley()
        .file("robots/ripley/arm_poses.csv", lines.join("\n") + "\n")
        .edit(
            PROFILE,
            "  linkM: {",
            "  plate: {link: gripper, pose: true}\n  linkM: {",
        )
        .edit(
            PROFILE,
            "  mounts:\n",
            "  mounts:\n    plate: {xyz_mm: [0, 0, 0]}\n",
        );
    eprintln!("DBG {}", dir.calib(["check", PROFILE]).stderr);
    let found = findings(&dir, PROFILE);
    let is_named = |f: &Value| {
        f["id"] == "pose-of-markers"
            && f["facts"]["body"] == "plate"
            && f["facts"]["other"] == "gripM"
    };
    assert!(found.iter().any(is_named), "{found:#?}");
}
