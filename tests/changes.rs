//! What moved while the data were recorded, and rows that are not independent: said by `calib run`, with row and size.

use crate::scratch;

use scratch::{Ran, Scratch};
use serde_json::Value;

const PROFILE: &str = "robots/ripley.yaml";
const POSES: &str = "robots/ripley/arm_poses.csv";
/// Recordings that were made after the change, besides the rest of `arm_poses`.
const LATER: [&str; 2] = ["robots/ripley/wrist_sweep.csv", "robots/ripley/checks.csv"];
/// First changed row of `arm_poses`, counted from 0.
const FROM: usize = 22;
/// Comment lines and header before the first row.
const BEFORE: usize = 3;

/// Every row of a table as (name, cell) pairs, changed by `change(row, get, set)`.
fn rows(
    dir: &Scratch,
    table: &str,
    change: impl Fn(usize, &mut dyn FnMut(&str, [f64; 3]), &dyn Fn(&str) -> Option<[f64; 3]>),
) -> String {
    let text = dir.read(table);
    let mut out = Vec::new();
    let mut header: Vec<String> = Vec::new();
    let mut row = 0;
    for line in text.lines() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if line.starts_with('#') || header.is_empty() {
            if !line.starts_with('#') {
                header = cells;
            }
            out.push(line.to_owned());
            continue;
        }
        let place = |marker: &str, axis: &str| {
            let column = header
                .iter()
                .position(|h| *h == format!("{marker}.{axis}_m"));
            column.expect("a marker of the table")
        };
        let before = cells.clone();
        let get = |marker: &str| {
            let [x, y, z] = ["x", "y", "z"].map(|axis| before[place(marker, axis)].parse().ok());
            Some([x?, y?, z?])
        };
        let mut set = |marker: &str, p: [f64; 3]| {
            for (axis, value) in ["x", "y", "z"].iter().zip(p) {
                cells[place(marker, axis)] = format!("{value:.6}");
            }
        };
        change(row, &mut set, &get);
        row += 1;
        out.push(cells.join(","));
    }
    out.join("\n") + "\n"
}

/// Ripley with one change of the marker positions from row [`FROM`] of `arm_poses` on, and in the recordings that were made `later`.
fn changed_from(
    later: &[&str],
    markers: &[&str],
    shift: impl Fn(&dyn Fn(&str) -> Option<[f64; 3]>) -> Option<[f64; 3]>,
) -> Scratch {
    let mut dir = Scratch::new().robot("ripley");
    for table in [POSES].iter().chain(later) {
        let first = if *table == POSES { FROM } else { 0 };
        let text = rows(&dir, table, |row, set, get| {
            if let (true, Some(by)) = (row >= first, shift(get)) {
                for marker in markers {
                    if let Some(p) = get(marker) {
                        set(marker, [0, 1, 2].map(|i| p[i] + by[i]));
                    }
                }
            }
        });
        dir = dir.file(table, text);
    }
    dir
}

fn run(dir: &Scratch) -> (Ran, Value) {
    let ran = dir.calib(["run", PROFILE, "--out", "out", "--full"]);
    let report = dir.json("out/report.json");
    (ran, report)
}

fn finding<'a>(report: &'a Value, id: &str) -> Option<&'a Value> {
    let mut all = report["findings"].as_array().expect("a list").iter();
    all.find(|f| f["id"] == id)
}

const GRIPPER: [&str; 4] = ["gripM_1", "gripM_2", "gripM_3", "gripM_4"];

/// The gripper's body slips by 1.5 mm along the line of two markers: the same direction on the body at every pose.
fn slipped() -> Scratch {
    slipped_before(&LATER)
}

fn slipped_before(later: &[&str]) -> Scratch {
    changed_from(later, &GRIPPER, |get| {
        let (a, b) = (get("gripM_1")?, get("gripM_2")?);
        let d = [0, 1, 2].map(|i| b[i] - a[i]);
        let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
        Some(d.map(|x| 1.5e-3 * x / length))
    })
}

#[test]
fn a_body_that_slips_is_named_with_its_row() {
    let dir = slipped();
    let (_, report) = run(&dir);
    let found = finding(&report, "changed-while-recording").expect("the slip is named");
    assert_eq!(found["facts"]["kind"], "body", "{found:#}");
    assert_eq!(found["facts"]["body"], "gripM", "{found:#}");
    assert_eq!(found["facts"]["recording"], "arm_poses", "{found:#}");
    let row: usize = found["facts"]["row"]
        .as_str()
        .and_then(|r| r.parse().ok())
        .expect("a row");
    assert!(row.abs_diff(FROM + BEFORE + 1) <= 1, "{found:#}");
    let distance = found["facts"]["distance"]["value"]
        .as_f64()
        .expect("a length");
    assert!((distance - 1.5e-3).abs() < 0.4e-3, "{found:#}");
}

/// Ripley with one joint that is off its readings by σ, drawn for each row from a plain generator.
fn scattered(joint: &str, sigma_deg: f64) -> Scratch {
    let mut dir = Scratch::new().robot("ripley");
    let mut state: u64 = 1;
    let mut uniform = || {
        state = (state * 1_103_515_245 + 12_345) % (1 << 31);
        state as f64 / (1u64 << 31) as f64
    };
    for table in [&[POSES][..], &LATER].concat() {
        let mut column: Option<usize> = None;
        let lines: Vec<String> = dir
            .read(table)
            .lines()
            .map(|line| {
                let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
                match column {
                    Some(column) if !line.starts_with('#') => {
                        let normal = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
                        let q: f64 = cells[column].parse().expect("a reading");
                        cells[column] = format!("{:.5}", q + sigma_deg * normal);
                    }
                    _ => column = cells.iter().position(|c| *c == format!("{joint}_deg")),
                }
                cells.join(",")
            })
            .collect();
        dir = dir.file(table, lines.join("\n") + "\n");
    }
    dir
}

#[test]
fn a_joint_that_scatters_is_named_and_no_change() {
    if !skipped_tests::thorough() {
        return;
    }
    for (joint, sigma) in [("elbow", 0.2), ("shoulder", 0.2)] {
        let (_, report) = run(&scattered(joint, sigma));
        let change = finding(&report, "changed-while-recording");
        assert!(change.is_none(), "{joint}: {change:#?}");
        let found = finding(&report, "joint-scatters");
        let found = found
            .unwrap_or_else(|| panic!("{joint}: {} {}", report["reason_ids"], report["findings"]));
        assert_eq!(found["facts"]["joint"], joint, "{found:#}");
        let found = found["facts"]["sigma"]["value"].as_f64().expect("an angle");
        let ratio = found.to_degrees() / sigma;
        assert!((0.5..2.0).contains(&ratio), "{joint}: {ratio}");
    }
}

/// The profile gives the body that slipped two mounts, the first also in the recordings `before`.
fn split(dir: Scratch, before: &str) -> Scratch {
    dir.edit(
        PROFILE,
        "gripM: {link: gripper, markers: [gripM_1, gripM_2, gripM_3, gripM_4]}",
        &format!(
            "gripM: {{link: gripper, markers: [gripM_1, gripM_2, gripM_3, gripM_4], split: {{recording: arm_poses, at_row: {}, before: [{before}]}}}}",
            FROM + BEFORE + 1
        ),
    )
}

#[test]
fn a_split_gives_the_body_two_mounts() {
    let dir = split(slipped(), "base_sweep");
    let (ran, report) = run(&dir);
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    assert!(
        finding(&report, "changed-while-recording").is_none(),
        "{:#}",
        report["findings"]
    );
    // `calib check` follows the profile, and counts the markers as they are.
    let checked = dir.calib(["check", PROFILE]);
    assert_eq!(checked.code, 0, "{}{}", checked.stdout, checked.stderr);
    let words = checked.words();
    assert!(!words.contains("changed-while-recording"), "{words}");
    assert!(
        words.contains("12 markers, 4 of 480 samples lost"),
        "{words}"
    );
    // Both mounts are in the scene.
    let scene = dir.read("out/ripley.scene.json");
    assert!(scene.contains("gripM_before"), "{scene}");
    let wrong = dir.edit(
        PROFILE,
        "recording: arm_poses, at_row",
        "recording: arm_pose, at_row",
    );
    let ran = wrong.calib(["check", PROFILE]);
    assert!(ran.stderr.contains("arm_poses"), "{}", ran.stderr);
}

/// The mount after the slip is in the last rows of one recording only: they are not held to hide another slip before them.
#[test]
fn a_mount_that_only_the_last_rows_see_is_judged_by_them() {
    let dir = split(slipped_before(&[]), "base_sweep, wrist_sweep, checks");
    let (_, report) = run(&dir);
    let change = finding(&report, "changed-while-recording");
    assert!(change.is_none(), "{change:#?}");
    // The held-out poses were recorded before the slip: nothing verifies the mount that is published.
    assert_eq!(report["verdict"], "not_evaluated");
    assert_eq!(report["reason_ids"][0], "body-not-verified", "{report:#}");
}

#[test]
fn a_tracker_that_is_bumped_is_named_with_its_row() {
    if !skipped_tests::thorough() {
        return;
    }
    let dir = Scratch::new().robot("ripley");
    let header = dir.read(POSES);
    let header = header
        .lines()
        .find(|l| l.starts_with("pose,"))
        .expect("a header");
    let markers: Vec<&str> = header
        .split(',')
        .filter_map(|c| c.strip_suffix(".x_m"))
        .collect();
    let dir = changed_from(&LATER, &markers, |_| Some([1.2e-3, -0.8e-3, 0.5e-3]));
    let (_, report) = run(&dir);
    let found = finding(&report, "changed-while-recording").expect("the bump is named");
    assert_eq!(found["facts"]["kind"], "tracker", "{found:#}");
    let row: usize = found["facts"]["row"]
        .as_str()
        .and_then(|r| r.parse().ok())
        .expect("a row");
    assert!(row.abs_diff(FROM + BEFORE + 1) <= 1, "{found:#}");
}

/// The tracker stood elsewhere while some recordings were made: the motion is between two of them, never at the first row of all.
#[test]
fn a_tracker_that_moved_between_recordings_is_said_with_both() {
    if !skipped_tests::thorough() {
        return;
    }
    const FIRST: &str = "robots/ripley/a_first.csv";
    let whole = Scratch::new().robot("ripley").read(POSES);
    let lines: Vec<&str> = whole.lines().collect();
    let [first, rest] = [BEFORE..BEFORE + 12, BEFORE + 12..lines.len()]
        .map(|part| [&lines[..BEFORE], &lines[part]].concat().join("\n") + "\n");
    let header = lines.iter().find(|l| !l.starts_with('#')).expect("names");
    let markers = header
        .split(',')
        .filter_map(|name| name.strip_suffix(".x_m"));
    let markers: Vec<&str> = markers.collect();
    let shifted = |dir: &Scratch, table: &str| {
        rows(dir, table, |_, set, get| {
            for marker in &markers {
                if let Some(p) = get(marker) {
                    set(marker, [p[0] + 2e-3, p[1], p[2]]);
                }
            }
        })
    };
    // All poses, and the first twelve of them as a recording of their own.
    let dir = Scratch::new().robot("ripley");
    let text = shifted(&dir, POSES);
    let long = dir.file(POSES, text);
    let dir = Scratch::new().robot("ripley").file(POSES, rest);
    let dir = dir.file(FIRST, first).edit(
        PROFILE,
        "  arm_poses: {",
        "  a_first: {file: ripley/a_first.csv, use: static}\n  arm_poses: {",
    );
    let text = shifted(&dir, FIRST);
    let short = dir.file(FIRST, text);
    let sweeps = &["base_sweep", "wrist_sweep"][..];
    let all = &["arm_poses", "base_sweep", "wrist_sweep"][..];
    // The few poses between the sweeps and the others fit neither: they are put behind all.
    for (dir, before, recording, earlier) in [
        (long, "wrist_sweep", "arm_poses", sweeps),
        (short, "arm_poses", "a_first", all),
    ] {
        let (ran, report) = run(&dir);
        let found = finding(&report, "changed-while-recording");
        let found = found.unwrap_or_else(|| panic!("{}", ran.stdout));
        let facts = &found["facts"];
        assert_eq!(facts["before_in"], before, "{found:#}");
        assert_eq!(facts["recording"], recording, "{found:#}");
        assert_eq!(facts["earlier"], serde_json::json!(earlier), "{found:#}");
    }
}

/// The rows of `arm_poses`, each written `copies` times with another error of 0.3 mm in every coordinate.
fn frames(copies: usize) -> Scratch {
    let dir = Scratch::new().robot("ripley");
    let text = dir.read(POSES);
    let mut state = 1u64;
    // Sums of uniform numbers: nearly normal, from a plain generator with a fixed seed.
    let mut normal = || {
        let mut sum = 0.0;
        for _ in 0..12 {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            sum += (state >> 11) as f64 / (1u64 << 53) as f64;
        }
        sum - 6.0
    };
    let mut out = Vec::new();
    let mut header: Vec<&str> = Vec::new();
    for line in text.lines() {
        if line.starts_with('#') || header.is_empty() {
            if !line.starts_with('#') {
                header = line.split(',').collect();
            }
            out.push(line.to_owned());
            continue;
        }
        for _ in 0..copies {
            let cells =
                line.split(',')
                    .zip(&header)
                    .map(|(cell, name)| match cell.parse::<f64>() {
                        Ok(x) if name.ends_with("_m") => format!("{:.6}", x + 3e-4 * normal()),
                        _ => cell.to_owned(),
                    });
            out.push(cells.collect::<Vec<_>>().join(","));
        }
    }
    dir.file(POSES, out.join("\n") + "\n")
}

#[test]
fn frames_of_one_pose_count_once() {
    let (_, plain) = run(&Scratch::new().robot("ripley"));
    let (ran, report) = run(&frames(8));
    let found = finding(&report, "frames-merged").expect("said");
    // On one line of a terminal, and in the report.
    assert!(
        ran.words().contains("The 320 rows show 40 poses"),
        "{}",
        ran.stdout
    );
    assert!(found["facts"]["copies"].is_null());
    assert_eq!(found["severity"], "info");
    assert_eq!(found["facts"]["rows"], 320);
    assert_eq!(found["facts"]["poses"], 40);
    // The noise of a mean is less than that which the profile states of a frame.
    assert!(ran.words().contains("ACCEPTED"), "{}", ran.stdout);
    let reasons = report["reason_ids"].as_array().expect("a list");
    assert!(
        !reasons.contains(&"noise-below-stated".into()),
        "{reasons:?}"
    );
    // The uncertainty is that of 40 poses, not of 320.
    let sigma = |report: &Value| -> Vec<f64> {
        let all = report["parameters"].as_array().expect("a list").iter();
        all.filter_map(|p| p["sigma"].as_f64())
            .filter(|s| *s > 0.0)
            .collect()
    };
    let (a, b) = (sigma(&plain), sigma(&report));
    assert_eq!(a.len(), b.len());
    assert!(a.len() > 10);
    for (a, b) in a.iter().zip(&b) {
        assert!(*b > 0.7 * a, "{b} after merging, {a} with single frames");
    }
    assert!(finding(&plain, "frames-merged").is_none());
}

/// Held-out postures that are written eight times are no more postures.
#[test]
fn frames_of_a_held_out_pose_count_once() {
    const CHECKS: &str = "robots/ripley/checks.csv";
    let interval = |dir: &Scratch| {
        let report = run(dir).1;
        report["verification"]["held_out"]["expected"].clone()
    };
    let dir = Scratch::new().robot("ripley");
    let plain = interval(&dir);
    assert!(plain["high_m"].as_f64().is_some(), "{plain}");
    let text = dir.read(CHECKS);
    let mut header = true;
    let lines = text.lines().flat_map(|line| {
        let first = line.starts_with('#') || std::mem::take(&mut header);
        std::iter::repeat_n(line, if first { 1 } else { 8 })
    });
    let copied = lines.collect::<Vec<_>>().join("\n") + "\n";
    assert_eq!(interval(&dir.file(CHECKS, copied)), plain);
}

/// Every row three times, as a logger writes it that is faster than the robot: said how many are copies.
#[test]
fn copies_of_a_row_count_once_and_are_said() {
    let dir = Scratch::new().robot("ripley");
    let text = dir.read(POSES);
    let comment = |line: &str| {
        line.starts_with('#') || !line.starts_with(|c: char| c.is_ascii_digit() || c == '-')
    };
    let copied: Vec<&str> = text
        .lines()
        .flat_map(|line| std::iter::repeat_n(line, if comment(line) { 1 } else { 3 }))
        .collect();
    let (ran, report) = run(&dir.file(POSES, copied.join("\n") + "\n"));
    let found = finding(&report, "frames-merged").expect("said");
    assert_eq!(found["facts"]["poses"], 40);
    assert_eq!(found["facts"]["copies"], 80);
    assert!(ran.words().contains("80 rows repeat"), "{}", ran.stdout);
}

#[test]
fn a_clean_recording_has_neither() {
    for robot in ["ripley", "justin"] {
        let report = &scratch::finished(robot, "ml").report;
        for id in [
            "changed-while-recording",
            "frames-merged",
            "noise-has-memory",
        ] {
            assert!(finding(report, id).is_none(), "{robot}: {id}");
        }
    }
}

/// One mistake, one finding: not its rows, not an effect that explains a part of it, and no marker that pays for it; by `check` as by `run`.
/// Five degrees are no small angle: the size is true to its uncertainty.
#[test]
fn a_zero_that_jumps_far_is_all_that_is_said_and_has_its_size() {
    // Whether the rows after the jump are few or most of the recording.
    for (joint, first, table, jump) in [
        ("shoulder", 12, POSES, 5.0),
        ("elbow", 32, POSES, -5.0),
        ("waist", 32, POSES, 5.0),
        // None of these rows is rejected: without the jump, a coupling would explain a part.
        ("shoulder", 55, "robots/ripley/base_sweep.csv", -2.0),
    ] {
        let dir = jumped(joint, first, table, jump);
        let (_, report) = run(&dir);
        let checked = dir.calib(["check", PROFILE, "--json"]);
        let checked: Value = serde_json::from_str(&checked.stdout).expect("JSON");
        for said in [&report, &checked] {
            let all = said["findings"].as_array().expect("a list").iter();
            let worse = all.clone().filter(|f| f["severity"] != "info");
            let ids: Vec<&Value> = worse.map(|f| &f["id"]).collect();
            assert_eq!(
                ids,
                ["changed-while-recording"],
                "{joint} {first}: {said:#}"
            );
            assert!(!all.clone().any(|f| f["id"] == "marker-noise"), "{said:#}");
            let found = finding(said, "changed-while-recording").expect("just seen");
            let value = |name: &str| found["facts"][name]["value"].as_f64();
            let off = value("angle").expect("a size").to_degrees() - f64::abs(jump);
            let sigma = value("sigma_angle").expect("a sigma").to_degrees();
            assert!(off.abs() < 4.0 * sigma, "{joint}: {off} of {sigma}");
            let at = (first + BEFORE + 1).to_string();
            assert_eq!(found["facts"]["row"], *at, "{joint}: {found:#}");
        }
    }
}

/// Ripley with readings of a joint that are off by so many degrees from a row of a table on.
pub(crate) fn jumped(joint: &str, first: usize, table: &str, degrees: f64) -> Scratch {
    let dir = Scratch::new().robot("ripley");
    let mut column = None;
    let mut row = 0;
    let line = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        match column {
            _ if line.starts_with('#') => {}
            None => column = cells.iter().position(|c| *c == format!("{joint}_deg")),
            Some(column) => {
                if row >= first {
                    let reading: f64 = cells[column].parse().expect("a reading");
                    cells[column] = format!("{:.6}", reading + degrees);
                }
                row += 1;
            }
        }
        cells.join(",")
    };
    let lines: Vec<String> = dir.read(table).lines().map(line).collect();
    dir.file(table, lines.join("\n") + "\n")
}
