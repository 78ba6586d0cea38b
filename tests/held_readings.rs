//! Joint readings that were held while the robot went on: a log that hung, or that is slower than the tracker. The rows are named and left out, whatever
//! was recorded and however many markers were seen; what only looks alike stays.

use crate::scratch;
use crate::structural::{Design, FOUR, Markers, ONE, Setting};

use scratch::Scratch;
use serde_json::Value;

/// A table with the rows that `rows_of` makes of each; it is given the place of a row, the header and all rows as they were.
fn rewritten(
    dir: Scratch,
    table: &str,
    rows_of: impl Fn(usize, &[String], &[Vec<String>]) -> Vec<Vec<String>>,
) -> Scratch {
    let path = format!("{table}.csv");
    let text = dir.read(&path);
    let cells = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let (comments, lines): (Vec<&str>, Vec<&str>) =
        text.lines().partition(|line| line.starts_with('#'));
    let header = cells(lines[0]);
    let rows: Vec<Vec<String>> = lines[1..].iter().map(|line| cells(line)).collect();
    let written = (0..rows.len()).flat_map(|k| rows_of(k, &header, &rows));
    let written = written.map(|cells| cells.join(","));
    let all: Vec<String> = comments
        .into_iter()
        .chain([lines[0]])
        .map(str::to_owned)
        .chain(written)
        .collect();
    dir.file(&path, all.join("\n") + "\n")
}

/// The tracker's cells of one row with the joints' of another.
fn joined(header: &[String], tracked: &[String], joints: &[String]) -> Vec<String> {
    let is_joint = |name: &String| name.ends_with("_deg");
    let cells = header.iter().zip(tracked.iter().zip(joints));
    cells
        .map(|(name, (tracked, joint))| if is_joint(name) { joint } else { tracked }.clone())
        .collect()
}

/// The readings of the row before each range stay through it: rows from one to before another, counted from 0.
fn held(dir: Scratch, table: &str, ranges: &[(usize, usize)]) -> Scratch {
    rewritten(dir, table, |k, header, rows| {
        let range = ranges.iter().find(|(from, to)| (*from..*to).contains(&k));
        let reported = range.map_or(k, |(from, _)| from - 1);
        vec![joined(header, &rows[k], &rows[reported])]
    })
}

/// As if the tracker had seen nothing in these rows.
fn lost(dir: Scratch, table: &str, ranges: &[(usize, usize)]) -> Scratch {
    dir.cells(&format!("{table}.csv"), |row, column, cell| {
        let is_lost = ranges.iter().any(|(from, to)| (*from..*to).contains(&row));
        match is_lost && column.ends_with("_m") {
            true => String::new(),
            false => cell.to_owned(),
        }
    })
}

/// The line of a table's first data row.
fn first_line(dir: &Scratch, table: &str) -> u64 {
    let text = dir.read(&format!("{table}.csv"));
    let comments = text.lines().take_while(|line| line.starts_with('#'));
    comments.count() as u64 + 2
}

/// The report, and the patched robot.
fn calibrated(dir: &Scratch) -> (Value, String) {
    calibrated_with(dir, &[])
}

/// The same with more arguments.
fn calibrated_with(dir: &Scratch, more: &[&str]) -> (Value, String) {
    let ran = dir.calib_with(&[&["run", "arm.yaml", "--out", "out"], more].concat());
    assert!([0, 1, 4].contains(&ran.code), "{}", ran.stderr);
    let files = dir.files("out");
    let urdf = files.keys().find(|name| name.ends_with(".urdf"));
    let urdf = dir.read(&format!("out/{}", urdf.expect("a robot")));
    (dir.json("out/report.json"), urdf)
}

fn findings(report: &Value) -> &[Value] {
    report["findings"].as_array().expect("a list")
}

/// The recordings and rows whose readings are said to have been held, rows as lines of the file.
fn found(findings: &[Value]) -> Vec<(String, Vec<u64>)> {
    let ours = findings.iter().filter(|f| f["id"] == "joint-readings-held");
    let of = ours.map(|f| {
        let recording = &f["about"]["recordings"][0];
        let rows = f["rows"].as_array().expect("a list").iter();
        let rows = rows.map(|row| row.as_u64().expect("a row"));
        (
            recording.as_str().expect("a name").to_owned(),
            rows.collect(),
        )
    });
    of.collect()
}

const TWO: Markers = &[[20.0, 30.0, 10.0], [70.0, -20.0, 15.0]];

#[test]
fn rows_of_a_log_that_hung_are_left_out() {
    /// Which readings stay, of which table.
    type Case = (Design, &'static str, &'static [(usize, usize)]);
    let cases: [Case; 5] = [
        (Design::Random(24), "poses", &[(8, 13)]),
        (
            Design::Random(24),
            "poses",
            &[(3, 4), (9, 10), (15, 17), (20, 21)],
        ),
        (Design::Random(24), "checks", &[(5, 8)]),
        (Design::Sweeps, "elbow", &[(3, 6)]),
        (Design::Sweeps, "waist", &[(1, 2), (3, 4), (5, 6)]),
    ];
    for (seed, (design, table, ranges)) in cases.into_iter().enumerate() {
        for markers in [ONE, TWO, FOUR] {
            let setting = Setting {
                validation: true,
                ..Setting::new(design, markers, 70 + seed as u64)
            };
            let dir = held(setting.folder(), table, ranges);
            let first = first_line(&dir, table);
            let rows: Vec<u64> = ranges
                .iter()
                .flat_map(|(from, to)| first + *from as u64..first + *to as u64)
                .collect();
            let (report, urdf) = calibrated(&dir);
            let (of_lost, without) = calibrated(&lost(setting.folder(), table, ranges));
            let place = format!("{table} {ranges:?}, {} markers", markers.len());
            assert_eq!(
                found(findings(&report)),
                [(table.to_owned(), rows.clone())],
                "{place}"
            );
            // Nothing else is said of these rows, and the result is what it is without them.
            let ids = |report: &Value| {
                let all = findings(report).iter().map(|f| f["id"].to_string());
                all.filter(|id| !id.contains("joint-readings-held"))
                    .collect::<Vec<_>>()
            };
            assert_eq!(ids(&report), ids(&of_lost), "{place}");
            assert!(urdf == without, "{place}");
            let rejected = report["rejected"].as_array().expect("a list");
            let ours = rejected.iter().filter(|r| r["cause"] == "held_readings");
            let of_ours: Vec<&Value> = ours.map(|r| &r["rows"]).collect();
            assert_eq!(of_ours, [&serde_json::json!(rows)], "{place}");
            let checked = dir.calib(["check", "arm.yaml", "--json"]).json();
            assert_eq!(
                found(checked["findings"].as_array().expect("a list")),
                [(table.to_owned(), rows)],
                "{place}"
            );
        }
    }
}

#[test]
fn a_log_that_hung_in_every_recording_is_named_in_each() {
    let setting = Setting {
        validation: true,
        ..Setting::new(Design::Sweeps, FOUR, 85)
    };
    let tables = ["checks", "elbow", "shoulder", "wrist_roll"];
    let dir = tables
        .iter()
        .fold(setting.folder(), |dir, table| held(dir, table, &[(3, 6)]));
    let checked = dir.calib(["check", "arm.yaml", "--json"]).json();
    let all = checked["findings"].as_array().expect("a list");
    let mut found: Vec<String> = found(all).into_iter().map(|(table, _)| table).collect();
    found.sort();
    assert_eq!(found, tables, "{all:#?}");
}

/// Elbow and wrist roll moved on a grid.
const GRID: &str = "{grid: [{joint: elbow_deg, from: -20, to: 100, poses: 6}, {joint: wrist_roll_deg, from: -80, to: 80, poses: 4}], \
                    hold: {waist_deg: 20, shoulder_deg: -35, wrist_pitch_deg: -30}}";

/// Beside random poses, a grid in which the column of the inner joint is not of that joint: it stays at one value.
fn with_a_standing_column(markers: Markers, at: f64) -> Scratch {
    let setting = Setting {
        validation: true,
        ..Setting::new(Design::Random(24), markers, 84)
    };
    let dir = setting.simulated_with(&[
        (
            "recordings:\n",
            "recordings:\n  grid: {file: grid.csv, use: static}\n",
        ),
        (
            "  recordings:\n",
            &format!("  recordings:\n    grid: {GRID}\n"),
        ),
        ("solve:\n", "solve:\n  limits: {held_out_rms_mm: 2}\n"),
    ]);
    dir.cells("grid.csv", |_, column, cell| match column {
        "wrist_roll_deg" => format!("{at}"),
        _ => cell.to_owned(),
    })
}

/// Three of four rows repeat the readings of the row before: where the column has the value of the first of them, the others are left out, and count for
/// no fault of the model; where it has another value, the column is named before the fit, and after it if that is forced.
#[test]
fn a_column_that_stands_still_is_named_or_its_rows_are_left_out() {
    let first = with_a_standing_column(FOUR, -80.0);
    let (report, _) = calibrated(&first);
    let of_grid = found(findings(&report));
    assert!(
        matches!(&of_grid[..], [(name, rows)] if name == "grid" && rows.len() == 18),
        "{of_grid:?}"
    );
    assert!(
        findings(&report).iter().all(|f| f["id"] != "many-lost"),
        "{:#}",
        report["findings"]
    );
    let verdict = report["verdict"].as_str().expect("a verdict");
    assert!(
        verdict.starts_with("accepted"),
        "{verdict}: {:#}",
        report["reasons"]
    );

    let other = with_a_standing_column(FOUR, 0.0);
    let (report, _) = calibrated_with(&other, &["--force"]);
    assert!(found(findings(&report)).is_empty());
    let ours = findings(&report)
        .iter()
        .find(|f| f["id"] == "joint-never-moved");
    let ours = ours.unwrap_or_else(|| panic!("{:#}", report["findings"]));
    assert_eq!(ours["about"]["name"], "wrist_roll");
    assert_eq!(ours["about"]["recordings"], serde_json::json!(["grid"]));
    assert_eq!(report["diagnosis"]["kind"], "structural_fault");
    assert_eq!(report["diagnosis"]["evidence"], "joint-column-missing");
    let checked = other.calib(["check", "arm.yaml", "--json"]).json();
    let all = checked["findings"].as_array().expect("a list");
    let errors: Vec<&Value> = all.iter().filter(|f| f["severity"] == "error").collect();
    assert!(
        matches!(&errors[..], [one] if one["id"] == "joint-column-missing"
            && one["about"]["recordings"] == serde_json::json!(["grid"])),
        "{all:#?}"
    );
}

/// Of one marker nothing but the fit says how it scatters: 20 mm are not called the tracker's.
#[test]
fn noise_that_no_tracker_has_makes_no_limit_too_small() {
    let (report, _) = calibrated_with(&with_a_standing_column(ONE, 0.0), &["--force"]);
    assert_eq!(report["verdict"], "rejected");
    let noise = report["noise"].as_array().expect("a list").iter();
    let marker = noise
        .filter(|n| n["group"] == "marker")
        .filter_map(|n| n["sigma"].as_f64());
    assert!(marker.fold(0.0, f64::max) > 0.01, "{:#}", report["noise"]);
    assert_ne!(report["diagnosis"]["kind"], "limit_below_noise");
}

/// Frames of one posture, positions that were asked for, readings that were rounded or cut off: each repeats readings.
#[test]
fn what_repeats_readings_for_another_reason_is_not_called_so() {
    let random = |seed| Setting::new(Design::Random(24), FOUR, seed);
    // Every posture is there four times, within the noise.
    let frames = rewritten(random(81).folder(), "poses", |k, header, rows| {
        let of = |frame: usize| {
            let cells = header.iter().zip(&rows[k]).enumerate();
            let cells = cells.map(|(c, (name, cell))| match cell.parse::<f64>() {
                Ok(x) if name.ends_with("_m") => {
                    let noise = 3e-4 * ((7 * k + 5 * c + 11 * frame) as f64).sin();
                    format!("{:.6}", x + noise)
                }
                _ => cell.clone(),
            });
            cells.collect::<Vec<String>>()
        };
        (0..4).map(of).collect()
    });
    // The readings are those of the place where the robot was going: it arrives in the last row.
    let ahead = rewritten(random(82).folder(), "poses", |k, header, rows| {
        let arrives = [(3..6), (9..12), (15..18)]
            .into_iter()
            .find(|r| r.contains(&k));
        vec![joined(
            header,
            &rows[k],
            &rows[arrives.map_or(k, |r| r.end)],
        )]
    });
    // Slow motions with readings of whole degrees.
    let slow = || {
        Setting::new(Design::Sweeps, FOUR, 83).simulated_with(&[
            (
                "from: -20, to: 120, poses: 9",
                "from: -20, to: -8, poses: 60",
            ),
            (
                "from: -100, to: 20, poses: 9",
                "from: -100, to: -88, poses: 60",
            ),
        ])
    };
    let written = |dir: Scratch, digits: fn(f64) -> f64| {
        ["elbow", "shoulder"].into_iter().fold(dir, |dir, table| {
            dir.cells(&format!("{table}.csv"), |_, column, cell| {
                match cell.parse::<f64>() {
                    Ok(q) if column.ends_with("_deg") => format!("{:.3}", digits(q)),
                    _ => cell.to_owned(),
                }
            })
        })
    };
    let rounded = written(slow(), f64::round);
    // The first row of every degree is the right one.
    let cut = written(slow(), f64::floor);
    for (what, dir) in [
        ("frames", frames),
        ("ahead", ahead),
        ("rounded", rounded),
        ("cut", cut),
    ] {
        let checked = dir.calib(["check", "arm.yaml", "--json"]).json();
        let all = checked["findings"].as_array().expect("a list");
        assert!(found(all).is_empty(), "{what}: {all:#?}");
    }
}
