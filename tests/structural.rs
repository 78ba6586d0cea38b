//! Structural mistakes through the program, over designs: random poses, one-joint sweeps, six poses; one to four markers.
//! Each is named before a row is blamed, once, with its places; correct data are given no error.

use crate::scratch;

use scratch::Scratch;
use serde_json::Value;

const JOINTS: [(&str, f64, f64); 5] = [
    ("waist", -70.0, 170.0),
    ("shoulder", -100.0, 20.0),
    ("elbow", -20.0, 120.0),
    ("wrist_pitch", -90.0, 90.0),
    ("wrist_roll", -100.0, 100.0),
];

/// Where the joints stand while another one is swept: no two axes coincide.
const HOME: [f64; 5] = [20.0, -35.0, 80.0, -30.0, 15.0];

#[derive(Clone, Copy, PartialEq)]
pub enum Design {
    Random(usize),
    /// A recording of its own for each joint.
    Sweeps,
}

/// Markers of the hand, mm, in the frame of its mount.
pub type Markers = &'static [[f64; 3]];
pub const ONE: Markers = &[[20.0, 30.0, 10.0]];
const TWO: Markers = &[[20.0, 30.0, 10.0], [70.0, -20.0, 15.0]];
pub const FOUR: Markers = &[
    [0.0, 0.0, 0.0],
    [72.0, 0.0, 0.0],
    [25.0, 58.0, 0.0],
    [48.0, 30.0, -40.0],
];
/// All within 15 mm of the wrist's axis once the mount is on it.
const NEAR_THE_AXIS: Markers = &[[0.0, 0.0, 0.0], [60.0, 12.0, 0.0], [30.0, 0.0, 14.0]];

pub struct Setting {
    pub design: Design,
    pub markers: Markers,
    /// mm, from the last link.
    pub mount: [f64; 3],
    pub validation: bool,
    pub seed: u64,
}

impl Setting {
    pub fn new(design: Design, markers: Markers, seed: u64) -> Self {
        Self {
            design,
            markers,
            mount: [55.0, -40.0, 35.0],
            validation: false,
            seed,
        }
    }

    pub fn tables(&self) -> Vec<String> {
        let mut tables: Vec<String> = match self.design {
            Design::Random(_) => vec!["poses".to_owned()],
            Design::Sweeps => JOINTS.iter().map(|j| j.0.to_owned()).collect(),
        };
        if self.validation {
            tables.push("checks".to_owned());
        }
        // In the order of the program.
        tables.sort();
        tables
    }

    /// How one table is simulated.
    fn plan(&self, table: &str) -> String {
        let ranges: Vec<String> = JOINTS
            .iter()
            .map(|(joint, low, high)| format!("{joint}_deg: [{low}, {high}]"))
            .collect();
        let random = |poses| format!("{{random: {{{}}}, poses: {poses}}}", ranges.join(", "));
        match self.design {
            _ if table == "checks" => random(10),
            Design::Random(poses) => random(poses),
            Design::Sweeps => {
                let (_, low, high) = JOINTS.iter().find(|j| j.0 == table).expect("a joint");
                let hold = JOINTS.iter().zip(HOME).filter(|(j, _)| j.0 != table);
                let hold: Vec<String> = hold.map(|(j, q)| format!("{}_deg: {q}", j.0)).collect();
                format!(
                    "{{grid: [{{joint: {table}_deg, from: {low}, to: {high}, poses: 9}}], hold: {{{}}}}}",
                    hold.join(", ")
                )
            }
        }
    }

    /// A folder with the profile and its simulated recordings.
    pub fn folder(&self) -> Scratch {
        let names: Vec<String> = (1..=self.markers.len()).map(|k| format!("m{k}")).collect();
        let of_table = |table: &String, text: String| format!("  {table}: {text}\n");
        let recordings: String = self
            .tables()
            .iter()
            .map(|table| {
                let usage = if table == "checks" {
                    "validation"
                } else {
                    "static"
                };
                of_table(table, format!("{{file: {table}.csv, use: {usage}}}"))
            })
            .collect();
        let plans: String = self
            .tables()
            .iter()
            .map(|table| of_table(table, self.plan(table)).replace("  ", "    "))
            .collect();
        let places: Vec<String> = names
            .iter()
            .zip(self.markers)
            .map(|(name, m)| format!("{name}: {m:?}"))
            .collect();
        let profile = format!(
            "calib: 1
robot: {{name: arm, urdf: robots/ripley/r17.urdf}}
tracker: {{frame: world}}
bodies:
  hand: {{link: gripper, markers: [{}]}}
recordings:
{recordings}solve:
  free: [bodies, tracker, joint_offsets, joint_axes]
simulate:
  seed: {}
  tracker_from_root: {{xyz_mm: [140, -60, 742]}}
  mounts:
    hand: {{xyz_mm: {:?}, markers_mm: {{{}}}}}
  errors: {{joint_offset_deg: 0.3, axis_mm: 0.8, axis_deg: 0.15}}
  noise: {{marker_mm: 0.3, joint_deg: 0.02}}
  recordings:
{plans}",
            names.join(", "),
            self.seed,
            self.mount,
            places.join(", "),
        );
        let dir = Scratch::new().robot("ripley").file("arm.yaml", profile);
        dir.calib(["simulate", "arm.yaml", "--out", "."]).expect(0);
        dir
    }
}

impl Setting {
    /// The same, simulated from a profile with other words: each with what takes its place.
    pub fn simulated_with(&self, words: &[(&str, &str)]) -> Scratch {
        let of_tables = self
            .tables()
            .into_iter()
            .map(|table| format!("{table}.csv"));
        let written = of_tables.chain(["truth.json".to_owned()]);
        let dir = written.fold(self.folder(), |dir, file| dir.without(&file));
        let dir = words
            .iter()
            .fold(dir, |dir, (from, to)| dir.edit("arm.yaml", from, to));
        dir.calib(["simulate", "arm.yaml", "--out", "."]).expect(0);
        dir
    }
}

/// Changes the cells of one column in some tables.
pub fn column(dir: Scratch, tables: &[String], name: &str, change: impl Fn(f64) -> f64) -> Scratch {
    tables.iter().fold(dir, |dir, table| {
        dir.cells(&format!("{table}.csv"), |_, column, cell| {
            match cell.parse::<f64>() {
                Ok(value) if column == name => change(value).to_string(),
                _ => cell.to_owned(),
            }
        })
    })
}

/// Exchanges the names of two columns.
fn exchanged(dir: Scratch, tables: &[String], a: &str, b: &str) -> Scratch {
    tables.iter().fold(dir, |dir, table| {
        let text = dir.read(&format!("{table}.csv"));
        let text = text.replace(a, "\u{1}").replace(b, a).replace('\u{1}', b);
        dir.file(&format!("{table}.csv"), text)
    })
}

/// Row by row, with the names of the columns: the cells may be replaced.
fn rows(dir: Scratch, table: &str, change: impl Fn(usize, &[String], &mut Vec<String>)) -> Scratch {
    let path = format!("{table}.csv");
    let text = dir.read(&path);
    let mut header: Vec<String> = Vec::new();
    let mut row = 0;
    let mut lines = Vec::new();
    for line in text.lines() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if header.is_empty() && !line.starts_with('#') {
            header.clone_from(&cells);
        } else if !line.starts_with('#') {
            change(row, &header, &mut cells);
            row += 1;
        }
        lines.push(cells.join(","));
    }
    dir.file(&path, lines.join("\n") + "\n")
}

/// A table without some of its columns.
fn without_columns(dir: Scratch, table: &str, names: &[&str]) -> Scratch {
    let path = format!("{table}.csv");
    let text = dir.read(&path);
    let header = text.lines().find(|line| !line.starts_with('#'));
    let header: Vec<&str> = header.expect("a header").split(',').collect();
    assert!(names.iter().all(|name| header.contains(name)), "{header:?}");
    let kept = |line: &str| {
        let cells = line.split(',').zip(&header);
        let cells = cells.filter(|(_, name)| !names.contains(name));
        cells.map(|(cell, _)| cell).collect::<Vec<_>>().join(",")
    };
    let lines = text.lines().map(|line| match line.starts_with('#') {
        true => line.to_owned(),
        false => kept(line),
    });
    let lines: Vec<String> = lines.collect();
    dir.file(&path, lines.join("\n") + "\n")
}

/// `to` becomes `to + factor · from`.
pub fn coupled(dir: Scratch, tables: &[String], to: &str, from: &str, factor: f64) -> Scratch {
    tables.iter().fold(dir, |dir, table| {
        rows(dir, table, |_, header, cells| {
            let at = |name: &str| header.iter().position(|h| h == name).expect("a column");
            let value = |k: usize| cells[k].parse::<f64>().expect("a number");
            let sum = value(at(to)) + factor * value(at(from));
            cells[at(to)] = sum.to_string();
        })
    })
}

pub fn findings(dir: &Scratch) -> Vec<Value> {
    let checked = dir.calib(["check", "arm.yaml", "--json"]);
    checked.json()["findings"]
        .as_array()
        .expect("a list")
        .clone()
}

fn errors(found: &[Value]) -> Vec<&Value> {
    found.iter().filter(|f| f["severity"] == "error").collect()
}

/// The only error is `id`, about `about` and with these recordings; no row is blamed.
#[track_caller]
pub fn named(dir: &Scratch, id: &str, about: &str, recordings: &[String]) -> Value {
    let found = findings(dir);
    let wrong = errors(&found);
    assert_eq!(wrong.len(), 1, "{found:#?}");
    assert_eq!(wrong[0]["id"], id, "{found:#?}");
    assert_eq!(wrong[0]["about"]["name"], about, "{found:#?}");
    assert_eq!(
        wrong[0]["about"]["recordings"],
        serde_json::json!(recordings),
        "{found:#?}"
    );
    for finding in &found {
        assert_eq!(finding["rows"], serde_json::json!([]), "{found:#?}");
    }
    wrong[0].clone()
}

#[test]
fn correct_data_are_given_no_error() {
    let designs = [
        (Design::Random(40), FOUR),
        (Design::Random(6), FOUR),
        (Design::Random(6), TWO),
        (Design::Random(8), FOUR),
        (Design::Random(8), FOUR),
        (Design::Random(10), FOUR),
        (Design::Random(10), ONE),
        (Design::Sweeps, ONE),
        (Design::Sweeps, TWO),
        (Design::Sweeps, TWO),
        (Design::Sweeps, FOUR),
        (Design::Sweeps, FOUR),
    ];
    for (k, (design, markers)) in designs.into_iter().enumerate() {
        let setting = Setting {
            validation: true,
            ..Setting::new(design, markers, 30 + k as u64)
        };
        let found = findings(&setting.folder());
        let loud: Vec<_> = found.iter().filter(|f| f["severity"] != "info").collect();
        assert!(loud.is_empty(), "{k}: {loud:#?}");
    }
}

#[test]
fn the_sign_of_a_wrist_with_markers_near_its_axis() {
    let setting = Setting {
        mount: [55.0, 0.0, 0.0],
        ..Setting::new(Design::Random(40), NEAR_THE_AXIS, 3)
    };
    let dir = column(setting.folder(), &setting.tables(), "wrist_roll_deg", |q| {
        -q
    });
    let finding = named(&dir, "joint-sign", "wrist_roll", &setting.tables());
    // The last two axes meet at a right angle: no data can tell the two.
    let same = finding["facts"]["equivalent"].to_string();
    assert!(
        same.contains("offset(wrist_pitch, 180 deg)"),
        "{finding:#?}"
    );
    let remedy = finding["remedy"].as_str().expect("text");
    assert!(remedy.contains("<axis xyz="), "{remedy}");
}

/// An axis of the URDF along another coordinate, forwards and backwards, and one that was not written, over designs and markers.
#[test]
fn an_axis_of_the_urdf_along_another_coordinate_is_named() {
    const ELBOW: &str = "<origin xyz=\"0.375 0 0\" rpy=\"0 0 0\"/>\n    <axis xyz=\"0 1 0\"/>";
    let cases = [
        (Design::Random(30), FOUR, "<axis xyz=\"0 0 1\"/>"),
        (Design::Random(30), ONE, "<axis xyz=\"-1 0 0\"/>"),
        (Design::Sweeps, FOUR, ""),
        (Design::Sweeps, ONE, "<axis xyz=\"0 0 -1\"/>"),
    ];
    for (k, (design, markers, axis)) in cases.into_iter().enumerate() {
        let setting = Setting::new(design, markers, 40 + k as u64);
        let changed = ELBOW.replace("<axis xyz=\"0 1 0\"/>", axis);
        let dir = setting
            .folder()
            .edit("robots/ripley/r17.urdf", ELBOW, &changed);
        let finding = named(&dir, "joint-axis", "elbow", &setting.tables());
        assert_eq!(finding["facts"]["axis"], "0 1 0", "{k}: {finding:#}");
    }
}

/// A joint that follows another one has no column of its own: the multiplier of the wrong sign is an axis that is reversed.
#[test]
fn a_joint_that_follows_another_one_the_wrong_way_is_named() {
    const WRIST: &str = "<joint name=\"wrist_pitch\" type=\"revolute\">";
    let following = |multiplier: &str| {
        format!("{WRIST}\n    <mimic joint=\"elbow\" multiplier=\"{multiplier}\"/>")
    };
    let urdf = "robots/ripley/r17.urdf";
    let setting = Setting::new(Design::Random(30), FOUR, 50);
    let dir = setting.folder().edit(urdf, WRIST, &following("-1")).edit(
        "arm.yaml",
        "wrist_pitch_deg: [-90, 90], ",
        "",
    );
    dir.calib(["simulate", "arm.yaml", "--out", "."]).expect(0);
    let loud = |dir: &Scratch| {
        let found = findings(dir);
        found.iter().any(|f| f["severity"] == "error")
    };
    assert!(!loud(&dir));
    let dir = dir.edit(urdf, &following("-1"), &following("1"));
    let finding = named(&dir, "joint-axis", "wrist_pitch", &setting.tables());
    assert_eq!(finding["facts"]["axis"], "0 -1 0", "{finding:#}");
    let remedy = finding["remedy"].as_str().expect("text");
    let expected = "a `multiplier` in `<mimic joint=\"elbow\"/>` of the other sign";
    assert!(remedy.contains(expected), "{remedy}");
}

/// An arm that is symmetric about a plane moves in a mirror as with the joints reversed whose axes lie in it: no recording tells the two.
#[test]
fn signs_that_look_like_a_mirror_are_named_beside_it() {
    for (markers, seed) in [(FOUR, 11), (ONE, 12)] {
        let setting = Setting::new(Design::Random(40), markers, seed);
        let tables = setting.tables();
        let negated = |names: &[&str]| {
            names.iter().fold(setting.folder(), |dir, name| {
                column(dir, &tables, name, |x| -x)
            })
        };
        let of_tracker: Vec<String> = (1..=markers.len()).map(|k| format!("m{k}.y_m")).collect();
        let of_tracker: Vec<&str> = of_tracker.iter().map(String::as_str).collect();
        for dir in [
            negated(&["waist_deg", "wrist_roll_deg"]),
            negated(&of_tracker),
        ] {
            let found = findings(&dir);
            let mirrored = found.iter().find(|f| f["id"] == "mirrored");
            let same = mirrored.expect("named")["facts"]["equivalent"].to_string();
            assert!(
                same.contains("sign(waist) + sign(wrist_roll)"),
                "{found:#?}"
            );
        }
    }
}

#[test]
fn a_wrong_sign_seen_by_one_marker() {
    for (design, seed) in [(Design::Random(30), 4), (Design::Sweeps, 5)] {
        let setting = Setting::new(design, ONE, seed);
        let dir = column(setting.folder(), &setting.tables(), "elbow_deg", |q| -q);
        named(&dir, "joint-sign", "elbow", &setting.tables());
    }
}

#[test]
fn exchanged_columns_in_one_joint_sweeps() {
    for (markers, seed) in [(ONE, 6), (FOUR, 7)] {
        let setting = Setting::new(Design::Sweeps, markers, seed);
        let tables = setting.tables();
        let dir = exchanged(setting.folder(), &tables, "elbow_deg", "wrist_pitch_deg");
        let finding = named(&dir, "joint-order", "elbow", &tables);
        assert_eq!(finding["facts"]["other"], "wrist_pitch");
    }
}

/// The values of the joints in another order than the names of the columns.
#[test]
fn columns_in_another_order_are_named_with_the_map_that_mends_them() {
    let joints: Vec<&str> = JOINTS.iter().map(|j| j.0).collect();
    let last = joints.len() - 1;
    // Which joint's values each column holds.
    let orders: [fn(usize, usize) -> usize; 3] = [
        |k, last| last - k,
        |k, last| (k + 1) % (last + 1),
        |k, last| (k + last) % (last + 1),
    ];
    for (design, markers, seed) in [(Design::Random(40), FOUR, 31), (Design::Sweeps, ONE, 32)] {
        let setting = Setting::new(design, markers, seed);
        for order in orders {
            let mut dir = setting.folder();
            for table in setting.tables() {
                dir = rows(dir, &table, |_, header, cells| {
                    let column = |joint: &str| {
                        let name = format!("{joint}_deg");
                        header.iter().position(|h| *h == name).expect("a column")
                    };
                    let right = cells.clone();
                    for (k, joint) in joints.iter().enumerate() {
                        cells[column(joint)] = right[column(joints[order(k, last)])].clone();
                    }
                });
            }
            let found = findings(&dir);
            let wrong = errors(&found);
            assert_eq!(wrong.len(), 1, "{found:#?}");
            assert_eq!(wrong[0]["id"], "joint-order", "{found:#?}");
            let entries = wrong[0]["facts"]["entries"].as_str().expect("entries");
            let said: Vec<&str> = entries.split(", ").collect();
            let meant = (0..=last).filter(|k| order(*k, last) != *k).map(|k| {
                let (column, joint) = (joints[k], joints[order(k, last)]);
                format!("{joint}: <column of {column}>")
            });
            let mut meant: Vec<String> = meant.collect();
            meant.sort_by_key(|entry| said.iter().position(|s| s == entry));
            assert_eq!(said, meant);
        }
    }
}

#[test]
fn a_joint_that_moves_with_another_one() {
    for (factor, seed) in [(1.0, 8), (-1.0, 9)] {
        let setting = Setting::new(Design::Random(40), FOUR, seed);
        let tables = setting.tables();
        // The column holds the sum, so the joint itself moves by the difference.
        let dir = coupled(
            setting.folder(),
            &tables,
            "wrist_pitch_deg",
            "elbow_deg",
            factor,
        );
        let finding = named(&dir, "joint-coupling", "wrist_pitch", &tables);
        assert_eq!(finding["facts"]["other"], "elbow");
        assert_eq!(finding["facts"]["factor"]["value"], -factor);
        let remedy = finding["remedy"].as_str().expect("text");
        assert!(
            remedy.contains("wrist_pitch: {coupled_to: [elbow]}"),
            "{remedy}"
        );
        // Declared, it is no mistake, and the fit finds it.
        let declared = "solve:\n  joints: {wrist_pitch: {coupled_to: [elbow]}}\n";
        let dir = dir.edit("arm.yaml", "solve:\n", declared);
        let found = findings(&dir);
        assert!(found.is_empty(), "{found:#?}");
        let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
        assert!(ran.code < 2, "{}", ran.stderr);
        let rms = dir.json("out/report.json")["residuals"]["all"]["rms_m"].as_f64();
        assert!(rms.is_some_and(|rms| rms < 1e-3), "{rms:?}");
    }
}

#[test]
fn a_joint_without_a_column() {
    let setting = Setting::new(Design::Random(40), FOUR, 10);
    let without = |dir: Scratch, joint: &str| {
        rows(dir, "poses", |_, header, cells| {
            let at = header.iter().position(|h| h == joint).expect("a column");
            cells[at] = String::new();
        })
        .edit("poses.csv", joint, "note")
    };
    let dir = without(setting.folder(), "elbow_deg");
    named(&dir, "joint-column-missing", "elbow", &setting.tables());
    // One that stood still, at 15°, in all recordings but its own: one mistake, in those without the column.
    for seed in 10..14 {
        let setting = Setting::new(Design::Sweeps, FOUR, seed);
        let lacking = setting.tables().into_iter().filter(|t| t != "wrist_roll");
        let lacking: Vec<String> = lacking.collect();
        let dir = lacking.iter().fold(setting.folder(), |dir, table| {
            dir.edit(&format!("{table}.csv"), "wrist_roll_deg", "note")
        });
        let said = named(&dir, "joint-column-missing", "wrist_roll", &lacking);
        let said = said["text"].as_str().expect("a sentence");
        let at = ["14", "15", "16"].map(|at| format!("stood at {at} deg"));
        assert!(at.iter().any(|at| said.contains(at)), "{said}");
    }
    // One that stood near 0 moves nothing by more than nominal errors do: a warning about this recording.
    let setting = Setting::new(Design::Sweeps, FOUR, 11);
    let dir = setting.simulated_with(&[("wrist_roll_deg: 15", "wrist_roll_deg: 0.5")]);
    let dir = without_columns(dir, "elbow", &["wrist_roll_deg"]);
    let found = findings(&dir);
    assert!(errors(&found).is_empty(), "{found:#?}");
    let silent = found.iter().find(|f| f["id"] == "joint-column-missing");
    let silent = silent.unwrap_or_else(|| panic!("{found:#?}"));
    assert_eq!(silent["about"]["name"], "wrist_roll");
    assert_eq!(silent["about"]["recordings"], serde_json::json!(["elbow"]));
}

/// No single joint explains it, nor do two: where the others fit without the recording, it is that one, and its columns.
#[test]
fn several_joints_without_a_column_in_one_recording() {
    let setting = Setting::new(Design::Sweeps, FOUR, 11);
    let joints = ["waist", "shoulder", "elbow"];
    let columns = joints.map(|joint| format!("{joint}_deg"));
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let dir = without_columns(setting.folder(), "wrist_pitch", &columns);
    let found = findings(&dir);
    let wrong = errors(&found);
    assert_eq!(wrong.len(), 1, "{found:#?}");
    assert_eq!(wrong[0]["id"], "joint-column-missing", "{found:#?}");
    assert_eq!(
        wrong[0]["about"]["recordings"],
        serde_json::json!(["wrist_pitch"])
    );
    // Nothing more is said of the same columns.
    let of_columns = found.iter().filter(|f| f["id"] == "joint-column-missing");
    assert_eq!(of_columns.count(), 1, "{found:#?}");
    let said = wrong[0]["text"].as_str().expect("a sentence");
    for joint in joints {
        assert!(said.contains(joint), "{said}");
    }
}

#[test]
fn millimeters_in_the_columns_of_meters_of_one_file() {
    let setting = Setting {
        validation: true,
        ..Setting::new(Design::Sweeps, FOUR, 12)
    };
    let wrong = ["elbow".to_owned()];
    let dir = wrong.iter().fold(setting.folder(), |dir, table| {
        dir.cells(&format!("{table}.csv"), |_, column, cell| {
            match cell.parse::<f64>() {
                Ok(value) if column.ends_with("_m") => (1e3 * value).to_string(),
                _ => cell.to_owned(),
            }
        })
    });
    let found = findings(&dir);
    let wrong = errors(&found);
    assert_eq!(wrong.len(), 1, "{found:#?}");
    assert_eq!(wrong[0]["id"], "unit-mismatch");
    assert_eq!(
        wrong[0]["about"]["recordings"],
        serde_json::json!(["elbow"])
    );
}

#[test]
fn what_is_wrong_in_the_validation_alone() {
    let setting = Setting {
        validation: true,
        ..Setting::new(Design::Random(40), FOUR, 13)
    };
    let checks = ["checks".to_owned()];
    let dir = exchanged(setting.folder(), &checks, "elbow_deg", "shoulder_deg");
    let finding = named(&dir, "joint-order", "shoulder", &checks);
    assert_eq!(finding["facts"]["other"], "elbow");
    // The tracker was moved by 0.1 m before the validation.
    let moved = setting
        .folder()
        .cells("checks.csv", |_, column, cell| match cell.parse::<f64>() {
            Ok(value) if column.ends_with(".x_m") => (value + 0.1).to_string(),
            _ => cell.to_owned(),
        });
    let found = findings(&moved);
    let wrong = errors(&found);
    assert_eq!(wrong.len(), 1, "{found:#?}");
    assert_eq!(wrong[0]["id"], "tracker-moved", "{found:#?}");
    assert_eq!(wrong[0]["about"]["recordings"], serde_json::json!(checks));
}

#[test]
fn gross_outliers_do_not_stop_a_run() {
    for (markers, share, seed) in [(FOUR, 10, 14), (FOUR, 5, 15), (ONE, 5, 16), (TWO, 10, 17)] {
        let setting = Setting::new(Design::Random(60), markers, seed);
        // Every so many samples, counted over rows and markers, one is 10 to 60 mm off.
        let every = 100 / share;
        let dir = rows(setting.folder(), "poses", |row, header, cells| {
            for (m, at) in (0..header.len())
                .filter(|&k| header[k].ends_with(".x_m"))
                .enumerate()
            {
                let sample = row * markers.len() + m;
                if (7 * sample + row) % every == 0 {
                    let off = 0.01 + 0.05 * ((sample * 37 % 100) as f64 / 100.0);
                    let value: f64 = cells[at].parse().expect("seen");
                    cells[at] = (value + if sample % 2 == 0 { off } else { -off }).to_string();
                }
            }
        });
        let found = findings(&dir);
        assert!(
            errors(&found).is_empty(),
            "{share} % of {}: {found:#?}",
            markers.len()
        );
        let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
        assert!(ran.code < 2, "{}", ran.stderr);
    }
}

#[test]
fn a_lost_marker_of_a_nearly_collinear_triple_is_no_fault_of_the_row() {
    const NEARLY_A_LINE: Markers = &[
        [0.0, 0.0, 0.0],
        [40.0, 1.0, 0.0],
        [80.0, 0.0, 1.0],
        [30.0, 50.0, 0.0],
    ];
    let setting = Setting::new(Design::Random(40), NEARLY_A_LINE, 18);
    let dir = rows(setting.folder(), "poses", |row, header, cells| {
        for (k, name) in header.iter().enumerate() {
            if name.starts_with("m4.") && row % 8 == 3 {
                cells[k] = String::new();
            }
        }
    });
    let found = findings(&dir);
    assert!(found.is_empty(), "{found:#?}");
}
