//! A robot that was homed between its recordings: the zeros of several joints are others, and neither the tracker nor a body moved.

use crate::scratch;

use scratch::Scratch;
use serde_json::Value;

const PROFILE: &str = "robots/ripley.yaml";
const POSES: &str = "robots/ripley/arm_poses.csv";
const SWEEPS: [&str; 2] = [
    "robots/ripley/base_sweep.csv",
    "robots/ripley/wrist_sweep.csv",
];
const CHECKS: &str = "robots/ripley/checks.csv";

/// Where the zeros went, degrees.
const HOMED: [(&str, f64); 4] = [
    ("waist", 0.12),
    ("shoulder", -0.2),
    ("elbow", 0.25),
    ("wrist_pitch", 0.15),
];

/// Ripley with readings of these joints that are off from a row of a table on, and in other tables.
fn homed(joints: &[(&str, f64)], (first, table): (usize, &str), others: &[&str]) -> Scratch {
    let mut dir = Scratch::new().robot("ripley");
    for (table, first) in [(table, first)]
        .into_iter()
        .chain(others.iter().map(|t| (*t, 0)))
    {
        let text = off(&dir.read(table), first, joints);
        dir = dir.file(table, text);
    }
    dir
}

/// A table with readings that are off from a row on.
fn off(table: &str, first: usize, joints: &[(&str, f64)]) -> String {
    let mut header: Vec<String> = Vec::new();
    let mut row = 0;
    let mut out = String::new();
    for line in table.lines() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if line.starts_with('#') {
        } else if header.is_empty() {
            header.clone_from(&cells);
        } else {
            for (joint, by) in joints.iter().filter(|_| row >= first) {
                let column = header.iter().position(|h| *h == format!("{joint}_deg"));
                let cell = &mut cells[column.expect("a column")];
                *cell = format!("{:.6}", cell.parse::<f64>().expect("a reading") + by);
            }
            row += 1;
        }
        out += &cells.join(",");
        out.push('\n');
    }
    out
}

fn run(dir: &Scratch) -> Value {
    dir.calib(["run", PROFILE, "--out", "out"]);
    dir.json("out/report.json")
}

/// Findings that are more than information.
fn warnings(report: &Value) -> Vec<&Value> {
    let all = report["findings"].as_array().expect("findings").iter();
    all.filter(|f| f["severity"] != "info").collect()
}

fn names(fact: &Value) -> Vec<&str> {
    let all = fact.as_array().expect("names").iter();
    all.map(|name| name.as_str().expect("a name")).collect()
}

/// Joints that are said to have another zero are those that have, and the size of the clearest one is true to its uncertainty.
fn is_true(finding: &Value, (step, sigma): (&str, &str), sign: f64) {
    let facts = &finding["facts"];
    let told = names(&facts["joints"]);
    assert!(told.len() > 1, "{finding:#}");
    let own = |joint: &str| HOMED.iter().find(|(name, _)| *name == joint);
    assert!(told.iter().all(|joint| own(joint).is_some()), "{finding:#}");
    let most = facts["joint"].as_str().expect("a name");
    let (_, truth) = own(most).expect("one of them");
    let value = |key: &str| facts[key]["value"].as_f64().expect("a number");
    let found = value(step).to_degrees();
    let truth = match sign {
        0.0 => truth.abs(),
        _ => sign * truth,
    };
    let sigma = value(sigma).to_degrees();
    assert!((found - truth).abs() < 4.0 * sigma, "{truth}: {finding:#}");
}

#[test]
fn zeros_of_several_joints_are_named_and_not_the_tracker() {
    let between = [(20, POSES), (0, SWEEPS[0])];
    for (first, table) in between {
        let others: &[&str] = match table {
            POSES => &[SWEEPS[1], CHECKS],
            _ => &[SWEEPS[1]],
        };
        let report = run(&homed(&HOMED, (first, table), others));
        let found = warnings(&report);
        let [one] = found[..] else {
            panic!("{table}: {found:#?}");
        };
        assert_eq!(one["id"], "changed-while-recording", "{table}: {one:#}");
        assert_eq!(one["facts"]["kind"], "zeros", "{table}: {one:#}");
        is_true(one, ("angle", "sigma_angle"), 0.0);
        assert_eq!(report["diagnosis"]["evidence"], "changed-while-recording");
    }
}

#[test]
fn zeros_that_changed_before_the_validation_are_named_together() {
    // A quarter of a degree is 2 mm, twice that is far beyond the noise.
    let twice = HOMED.map(|(joint, by)| (joint, 2.0 * by));
    let report = run(&homed(&twice, (0, CHECKS), &[]));
    let found = warnings(&report);
    let [one] = found[..] else {
        panic!("{found:#?}");
    };
    assert_eq!(one["id"], "joint-zero-changed", "{one:#}");
    assert_eq!(one["facts"]["kind"], "several", "{one:#}");
    is_true(one, ("step", "sigma"), -2.0);
    assert_eq!(report["diagnosis"]["evidence"], "joint-zero-changed");
    assert_eq!(report["verdict"], "rejected");
}

/// One zero, and the step of a body or the tracker, stay what they are: `changes` and `zero_changed` ask that. Beside them, other joints that changed
/// little are no reason to name all.
#[test]
fn one_joint_is_named_alone_where_it_explains_nearly_all() {
    let most = [("elbow", 0.5), ("wrist_roll", 0.01)];
    let report = run(&homed(&most, (20, POSES), &[SWEEPS[1], CHECKS]));
    let found = warnings(&report);
    let [one] = found[..] else {
        panic!("{found:#?}");
    };
    assert_eq!(one["facts"]["kind"], "joint", "{one:#}");
    assert_eq!(one["about"]["name"], "elbow", "{one:#}");
}

/// The zero of `elbow` is off by 10° in these tables.
fn off_by_ten(tables: &[&str]) -> Scratch {
    let joints = [("elbow", 10.0)];
    let (first, others) = tables.split_first().expect("a table");
    homed(&joints, (0, *first), others)
}

/// The one finding about a zero, its kind and its offset, degrees.
fn zero(report: &Value) -> (&Value, f64) {
    let about = |f: &&Value| f["id"] == "joint-offset";
    let all = report["findings"].as_array().expect("findings").iter();
    let found: Vec<&Value> = all.filter(about).collect();
    let [one] = found[..] else {
        panic!("{:#}", report["findings"]);
    };
    assert_eq!(one["about"]["name"], "elbow", "{one:#}");
    let offset = one["facts"]["offset"]["value"].as_f64();
    (one, offset.expect("an angle").to_degrees())
}

#[test]
fn a_zero_that_is_off_in_all_recordings_is_found_by_the_fit_and_said() {
    let all = [POSES, SWEEPS[0], SWEEPS[1], CHECKS];
    let dir = off_by_ten(&all);
    let report = run(&dir);
    let (found, offset) = zero(&report);
    assert_eq!(found["facts"]["kind"], "zero", "{found:#}");
    assert_eq!(found["severity"], "warning", "{found:#}");
    assert!((offset + 10.0).abs() < 1.0, "{offset}");
    assert_eq!(report["verdict"], "accepted_with_warnings", "{report:#}");
    // What the fit may not change is to be freed.
    let free = "joint_offsets, joint_axes]";
    let profile = dir.read(PROFILE);
    assert!(profile.contains(free));
    let dir = dir.file(PROFILE, profile.replace(free, "joint_axes]"));
    dir.calib(["run", PROFILE, "--out", "held", "--force"]);
    let report = dir.json("held/report.json");
    let (found, _) = zero(&report);
    assert_eq!(found["facts"]["kind"], "zero_held", "{found:#}");
    assert_eq!(found["severity"], "error", "{found:#}");
    assert_ne!(report["verdict"], "accepted");
}
