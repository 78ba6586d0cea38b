//! Plugins as a person meets them who writes one and names it in a profile: names that are wrong, things that nothing uses, labels that are lost.

use crate::scratch;

use std::process::Command;

use calib_plugin::check::reserved_label;
use scratch::{Scratch, root};
use serde_json::Value;

const PROFILE: &str = "robots/ripley.yaml";

/// A project of `calib plugins new` with its source changed, built into the folder `plugins` beside the profile; `None` without a C compiler.
fn project(dir: &Scratch, name: &str, kind: &str, changes: &[(&str, &str)]) -> Option<String> {
    let new = [
        "plugins", "new", name, "--kind", kind, "--lang", "c", "--out", "new",
    ];
    dir.calib(new).expect(0);
    let folder = dir.path(&format!("new/{name}"));
    let mut source = std::fs::read_to_string(folder.join("plugin.c")).expect("a source");
    for (from, to) in changes {
        assert!(source.contains(from), "{from}");
        source = source.replace(from, to);
    }
    std::fs::write(folder.join("plugin.c"), source).expect("written");
    std::fs::create_dir_all(dir.path("robots/plugins")).expect("a folder");
    let library = format!("robots/plugins/lib{name}.so");
    let built = Command::new("cc")
        .args([
            "-std=c11",
            "-O1",
            "-fPIC",
            "-shared",
            "-Iinclude",
            "plugin.c",
            "-lm",
            "-o",
        ])
        .arg(dir.path(&library))
        .current_dir(&folder)
        .status();
    match built {
        Ok(status) => {
            assert!(status.success(), "{name} does not compile");
            Some(format!("./{library}"))
        }
        Err(_) => {
            skipped_tests::skip("no C compiler");
            None
        }
    }
}

/// The arm with plugins and some changes of its profile.
fn arm(plugins: &str, changes: &[(&str, &str)]) -> Scratch {
    let named = format!("plugins: {plugins}\nrecordings:\n");
    let begun = Scratch::new().robot("ripley");
    let begun = match plugins {
        "" => begun,
        _ => begun.edit(PROFILE, "recordings:\n", &named),
    };
    let changes = changes.iter();
    changes.fold(begun, |dir, (from, to)| dir.edit(PROFILE, from, to))
}

fn findings(report: &Value, id: &str) -> Vec<Value> {
    let all = report["findings"].as_array().expect("a list").iter();
    all.filter(|f| f["id"] == id).cloned().collect()
}

#[test]
fn a_name_that_nothing_is_called_has_its_line_and_the_nearest() {
    let writers = "  add_bodies: [linkM, gripM]";
    for (from, to, place, said) in [
        (
            "center: sfe",
            "center: sfee",
            "ripley.yaml:40:13",
            "did you mean `sfe`?",
        ),
        (
            "axes: {x: wrist_roll}",
            "axes: {x: wrist_roll}\n    axis: planar-radial",
            "ripley.yaml:48:11",
            "did you mean `planar_radial`?",
        ),
        (
            writers,
            "  add_bodies: [linkM, gripM]\n  reports: {sumary: {}}",
            ": outputs: no report writer is called `sumary`",
            "did you mean `summary`?",
        ),
        (
            "    table_to_base: {free",
            "    elbow: {effects: {my_wave: {}}}\n    table_to_base: {free",
            ": joint `elbow`: no joint effect is called `my_wave`",
            "name the plugin that offers a joint effect under `plugins`",
        ),
        (
            "file: ripley/checks.csv,",
            "file: ripley/checks.csv, reader: csvv,",
            ": recording `checks`: no reader is called `csvv`",
            "known: ",
        ),
    ] {
        let dir = arm("", &[(from, to)]);
        let ran = dir.calib(["check", PROFILE]);
        assert_eq!(ran.code, 2, "{to}: {}", ran.stderr);
        assert!(
            ran.stderr.contains(place) && ran.stderr.contains(said),
            "{to}: {}",
            ran.stderr
        );
        let first = ran.stderr.lines().next().expect("a line");
        assert!(first.starts_with("error: robots/ripley.yaml:"), "{first}");
    }
}

/// The same beside a plugin, whose names count; what a plugin is called is not what it offers.
#[test]
fn beside_a_plugin_a_wrong_name_has_its_line_too() {
    let dir = arm("{my-ball: {}}", &[]);
    if project(&dir, "my-ball", "center", &[]).is_none() {
        return;
    }
    for (name, said) in [
        (
            "my-ball",
            "`my-ball` is the plugin; as center estimator it offers `my_ball`",
        ),
        ("my_bal", "did you mean `my_ball`?"),
        ("MY-BALL", "did you mean `my_ball`?"),
    ] {
        let profile = dir.read(PROFILE);
        let wrong = profile.replace("center: sfe", &format!("center: {name}"));
        std::fs::write(dir.path(PROFILE), wrong).expect("written");
        let ran = dir.calib(["check", PROFILE]);
        std::fs::write(dir.path(PROFILE), profile).expect("written");
        assert_eq!(ran.code, 2, "{name}: {}", ran.stderr);
        assert!(ran.stderr.contains("ripley.yaml:41:13"), "{}", ran.stderr);
        assert!(ran.stderr.contains(said), "{name}: {}", ran.stderr);
    }
}

#[test]
fn plugins_of_the_wrong_form_are_said_in_the_words_of_the_profile() {
    for (plugins, place, said) in [
        (
            "[my-ball]",
            "`plugins`: each plugin is a key",
            "write `plugins: {my-sphere: {}}`",
        ),
        (
            "my-ball",
            "`plugins`: each plugin is a key",
            "write `plugins: {my-sphere: {}}`",
        ),
        (
            "\n  - my-ball",
            "`plugins`: each plugin is a key",
            "write `plugins: {my-sphere: {}}`",
        ),
        (
            "{my-ball: libmy-ball.so}",
            "plugin `my-ball`: keys with values belong here",
            "`my-ball: {path: FILE}`",
        ),
        (
            "{my-ball: [1]}",
            "plugin `my-ball`: keys with values belong here",
            "`my-ball: {}`",
        ),
    ] {
        let ran = arm(plugins, &[]).calib(["check", PROFILE]);
        assert_eq!(ran.code, 2, "{plugins}: {}", ran.stderr);
        assert!(
            ran.stderr.contains(place) && ran.stderr.contains(said),
            "{plugins}: {}",
            ran.stderr
        );
        assert!(!ran.stderr.contains("mapping"), "{}", ran.stderr);
    }
}

#[test]
fn what_is_named_and_not_used_is_a_warning() {
    let swept = (
        "axes: {x: wrist_roll}",
        "axes: {x: wrist_roll}\n    center: my_ball",
    );
    let dir = arm("{my-ball: {}}", &[swept]);
    if project(&dir, "my-ball", "center", &[]).is_none() {
        return;
    }
    let said = |ran: &scratch::Ran| -> Value { serde_json::from_str(&ran.stdout).expect("JSON") };
    let checked = dir.calib(["check", PROFILE, "--json"]);
    assert_eq!(checked.code, 0, "{}", checked.stderr);
    let report = said(&checked);
    let unused = findings(&report, "origin-estimator-unused");
    assert_eq!(unused.len(), 1, "{report:#}");
    assert_eq!(unused[0]["facts"]["estimator"], "my_ball");
    assert_eq!(unused[0]["facts"]["called"], "planar_radial");
    let plugin = findings(&report, "plugin-unused");
    assert_eq!(plugin.len(), 1, "{report:#}");
    assert_eq!(plugin[0]["facts"]["plugin"], "my-ball");
    assert_eq!(plugin[0]["facts"]["offers"], serde_json::json!(["my_ball"]));
    // Where the center counts, both are silent.
    let dir = dir.edit(PROFILE, "\n    center: my_ball", "").edit(
        PROFILE,
        "center: sfe",
        "center: my_ball",
    );
    let checked = dir.calib(["check", PROFILE, "--json"]);
    let report = said(&checked);
    for id in ["origin-estimator-unused", "plugin-unused"] {
        assert!(findings(&report, id).is_empty(), "{id}: {report:#}");
    }
}

#[test]
fn the_listing_says_how_to_see_a_profile_and_shows_its_plugins() {
    let dir = arm("{my-ball: {}}", &[]);
    if project(&dir, "my-ball", "center", &[]).is_none() {
        return;
    }
    let plain = dir.calib(["plugins"]).expect(0);
    assert!(plain.stdout.contains("  sfe "), "{}", plain.stdout);
    assert!(!plain.stdout.contains("my_ball"), "{}", plain.stdout);
    assert!(
        plain.stdout.contains("calib plugins --profile PROFILE"),
        "{}",
        plain.stdout
    );
    let with = dir.calib(["plugins", "--profile", PROFILE]).expect(0);
    let line = with
        .stdout
        .lines()
        .find(|l| l.trim_start().starts_with("my_ball"));
    assert!(
        line.is_some_and(|l| l.ends_with("(from plugin `my-ball` 0.1.0)")),
        "{}",
        with.stdout
    );
    let json = dir
        .calib(["plugins", "--profile", PROFILE, "--json"])
        .expect(0);
    let listed: Value = serde_json::from_str(&json.stdout).expect("JSON");
    let centers = listed["calib.cor/1"].as_array().expect("a list");
    let plugin =
        |name: &str| centers.iter().find(|c| c["name"] == name).expect("listed")["plugin"].clone();
    assert_eq!(plugin("my_ball"), "my-ball");
    assert!(plugin("sfe").is_null());
    let checked = ["plugins", "--profile", PROFILE, "check", "x"];
    let checked = dir.calib(checked).expect(2);
    assert!(
        checked.stderr.contains("--profile lists what"),
        "{}",
        checked.stderr
    );
    let header = dir.calib(["plugins", "--json", "header"]).expect(0);
    assert!(header.stdout.starts_with('{'), "{}", header.stdout);
    let refused = dir.calib(["plugins", "--profile", PROFILE, "--no-plugins"]);
    assert_eq!(refused.code, 6, "{}", refused.stderr);
}

#[test]
fn all_estimators_and_a_plugin_are_refused_together_with_the_remedy() {
    let dir = Scratch::new().robot("ripley");
    let Some(library) = project(&dir, "my-ball", "center", &[]) else {
        return;
    };
    let table = root().join("robots/ripley/base_sweep.csv");
    let table = table.to_str().expect("a path");
    let fit = [
        "fit",
        "cor",
        table,
        "--use-only",
        "linkM_1",
        "--plugin",
        &library,
    ];
    let ran = dir.calib_with(&[&fit[..], &["--all"]].concat());
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("replace --all by --estimator NAME"),
        "{}",
        ran.stderr
    );
    let ran = dir.calib_with(&[&fit[..], &["--estimator", "my_ball"]].concat());
    assert!(ran.code == 0 || ran.code == 4, "{}", ran.stderr);
    let ran = dir.calib_with(&[&fit[..], &["--estimator", "my-ball"]].concat());
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("did you mean `my_ball`?"),
        "{}",
        ran.stderr
    );
}

#[test]
fn the_check_refuses_a_label_with_a_reserved_name() {
    let dir = Scratch::new();
    let label = |name: &str| {
        format!(
            "    if (status == CALIB_OK) {{\n        const char *texts[3] = {{\"a\", \"b\", \"c\"}};\n        \
             if (all.count == 3) status = sink->label(sink->context, timeline, \"{name}\", texts, 3);\n    }}\n    \
             if (status == CALIB_OK) status = sink->note("
        )
    };
    let note = "    if (status == CALIB_OK) status = sink->note(";
    let bad = label("pose");
    let Some(library) = project(&dir, "my-table", "reader", &[(note, &bad)]) else {
        return;
    };
    let ran = dir.calib(["plugins", "check", &library]);
    assert_eq!(ran.code, 6, "{}", ran.stdout);
    let said = "the label `pose` has a reserved name: tables take it for the number of the row";
    assert!(ran.stdout.contains(said), "{}", ran.stdout);
    let good = label("trial");
    let library = project(&dir, "my-trials", "reader", &[(note, &good)]).expect("a compiler");
    dir.calib(["plugins", "check", &library]).expect(0);
}

/// What is called reserved is no text in a table, and what is not, is.
#[test]
fn reserved_names_are_those_that_tables_read_as_something_else() {
    let read = |name: &str| {
        let text = format!("{name},j1_rad,j2_rad\n0,0.1,0.2\n1,0.2,0.3\n");
        let options = calib_recording::ReadOptions::default();
        calib_recording::read_bytes("t.csv", text.as_bytes(), &options)
    };
    for name in [
        "trial", "group", "label", "phase", "set", "hold", "segment", "note",
    ] {
        assert_eq!(reserved_label(name), None, "{name}");
        let recording = read(name).expect(name);
        assert!(recording.timelines[0].labels.contains_key(name), "{name}");
    }
    for name in ["operator", "shift_name"] {
        // No meaning at all: a profile's column map can name it.
        assert_eq!(reserved_label(name), None, "{name}");
        let problem = read(name).expect_err(name).to_string();
        assert!(problem.contains(name), "{problem}");
    }
    for name in [
        "t_s",
        "t_ms",
        "t_us",
        "host_s",
        "frame",
        "pose",
        "row",
        "sample",
        "index",
        "config",
        "marker",
        "body",
        "point",
        "elbow_rad",
        "elbow_deg",
        "slide_m",
        "slide_mm",
        "elbow_nm",
        "tip.x_m",
        "tip_qx",
        "qx",
        "state",
    ] {
        assert!(reserved_label(name).is_some(), "{name}");
        let labels = read(name).map(|r| r.timelines.iter().any(|t| t.labels.contains_key(name)));
        assert!(!labels.unwrap_or(false), "{name}");
    }
}

/// A plugin that ends the program fails the test that it was asked; the program goes on.
#[test]
fn a_plugin_that_crashes_fails_by_name() {
    let dir = Scratch::new();
    let first = "    const double least_flatness = call->values[0].number;\n";
    let crashes = [
        (
            "reads",
            "    if (motion->rotations[0] > 2) return CALIB_FAILED;\n",
            "signal 11 (SIGSEGV); the usual cause: a pointer of the input that is NULL",
        ),
        ("leaves", "    exit(3);\n", "ended the program with code 3"),
    ];
    for (name, line, cause) in crashes {
        let changed = format!("{line}{first}");
        let changes = [(first, changed.as_str())];
        let Some(library) = project(&dir, name, "center", &changes) else {
            return;
        };
        let said = dir.calib(["plugins", "check", &library]);
        assert_eq!(said.code, 6, "{}{}", said.stdout, said.stderr);
        assert!(said.stdout.contains(cause), "{}", said.stdout);
        assert!(said.stdout.contains("golden cases"), "{}", said.stdout);
        let table = dir.calib(["plugins", "check", &library, "--json"]);
        let table: Value = serde_json::from_str(&table.stdout).expect("JSON");
        let tests = table["tests"].as_array().expect("tests");
        let last = tests.iter().rev().take(2).rev();
        let last: Vec<&str> = last.filter_map(|row| row["outcome"].as_str()).collect();
        assert_eq!(
            (table["passed"].as_bool(), last),
            (Some(false), vec!["FAILED", "skipped"])
        );
    }
}

/// Parameters that an estimator does not have, or not so, have their line; names have the nearest.
#[test]
fn a_wrong_parameter_has_its_line() {
    for (given, place, said) in [
        (
            "{weak_fractoin: 0.1}",
            "ripley.yaml:41:25: ",
            "did you mean `weak_fraction`?",
        ),
        (
            "{weak_fraction: little}",
            "ripley.yaml:41:40: ",
            "must be a number, got",
        ),
        (
            "{weak_fraction: 0.1, seed: 3}",
            "ripley.yaml:41:45: ",
            "no parameter is called `seed`",
        ),
    ] {
        let changed = format!("center: sfe\n    center_parameters: {given}");
        let ran = arm("", &[("center: sfe", &changed)]).calib(["check", PROFILE]);
        assert_eq!(ran.code, 2, "{given}: {}", ran.stderr);
        assert!(
            ran.stderr.contains(place) && ran.stderr.contains(said),
            "{given}: {}",
            ran.stderr
        );
    }
    // The same of a plugin.
    let changed = "center: my_ball\n    center_parameters: {flatnes: 0.1}";
    let dir = arm("{my-ball: {}}", &[("center: sfe", changed)]);
    if project(&dir, "my-ball", "center", &[]).is_none() {
        return;
    }
    let ran = dir.calib(["check", PROFILE]);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("ripley.yaml:42:25: "), "{}", ran.stderr);
    assert!(
        ran.stderr.contains("did you mean `flatness`?"),
        "{}",
        ran.stderr
    );
}

#[test]
fn a_new_plugin_has_no_name_that_is_built_in() {
    let dir = Scratch::new();
    let new = |name: &str, kind: &str| dir.calib(["plugins", "new", name, "--kind", kind]);
    for (name, kind) in [
        ("sfe", "center"),
        ("planar-radial", "axis"),
        ("csv", "reader"),
        ("summary", "report"),
        ("compliance", "effect"),
    ] {
        let ran = new(name, kind).expect(2);
        let said = format!("`{}` is built in", name.replace('-', "_"));
        assert!(ran.stderr.contains(&said), "{name}: {}", ran.stderr);
        assert!(!dir.path(name).exists(), "{name}");
    }
    // A name is taken among its own kind only.
    new("csv", "center").expect(0);
}
