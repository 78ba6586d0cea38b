//! Plugins through the program: a reader in C gives the same calibration as the built-in reader, an estimator in Rust
//! is called by its name, and what cannot be loaded is refused.

use crate::scratch;

use std::path::PathBuf;
use std::process::Command;

use scratch::{Scratch, root};
use serde_json::Value;

/// Largest difference of any reported number between the two ways of reading: none is computed differently.
const SAME: f64 = 1e-12;

/// The C reader as a shared library in the scratch folder; `None` without a C compiler.
fn column_reader(dir: &Scratch) -> Option<PathBuf> {
    let out = dir.path("robots/libcolumn_reader.so");
    let built = Command::new("cc")
        .args(["-std=c11", "-O2", "-fPIC", "-shared", "-I"])
        .arg(root().join("crates/calib-plugin/include"))
        .arg(root().join("plugins/column-reader-c/column_reader.c"))
        .args(["-lm", "-o"])
        .arg(&out)
        .status();
    match built {
        Ok(status) => {
            assert!(status.success(), "the C reader does not compile");
            Some(out)
        }
        Err(_) => {
            skipped_tests::skip("no C compiler");
            None
        }
    }
}

/// Splits a canonical table into the plugin's layout text and the table without its heading.
fn without_heading(table: &str) -> (String, String) {
    let mut rows = table.lines().filter(|l| !l.starts_with('#'));
    let heading = rows.next().expect("a heading");
    let layout: Vec<&str> = heading
        .split(',')
        .map(|c| if c == "pose" { "-" } else { c })
        .collect();
    let body: String = rows.map(|l| format!("{l}\n")).collect();
    (layout.join(", "), body)
}

fn assert_same(a: &Value, b: &Value, at: &str) {
    match (a, b) {
        (Value::Number(x), Value::Number(y)) => {
            let (x, y) = (x.as_f64().expect("finite"), y.as_f64().expect("finite"));
            assert!(
                (x - y).abs() <= SAME * (1.0 + x.abs()),
                "{at}: {x} against {y}"
            );
        }
        (Value::Array(x), Value::Array(y)) => {
            assert_eq!(x.len(), y.len(), "{at}");
            for (i, (x, y)) in x.iter().zip(y).enumerate() {
                assert_same(x, y, &format!("{at}[{i}]"));
            }
        }
        (Value::Object(x), Value::Object(y)) => {
            assert!(x.keys().eq(y.keys()), "{at}");
            for (key, x) in x {
                assert_same(x, &y[key], &format!("{at}.{key}"));
            }
        }
        _ => assert_eq!(a, b, "{at}"),
    }
}

#[test]
fn a_reader_in_c_gives_the_calibration_of_the_built_in_one() {
    let mut dir = Scratch::new().brief("ripley");
    if column_reader(&dir).is_none() {
        return;
    }
    let plain = dir.calib(["run", "robots/ripley.yaml", "--out", "built_in"]);
    assert_eq!(plain.code, 0, "{}", plain.stderr);
    for recording in ["base_sweep", "wrist_sweep", "arm_poses", "checks"] {
        let path = format!("robots/ripley/{recording}.csv");
        let (layout, body) = without_heading(&dir.read(&path));
        let file = format!("file: ripley/{recording}.csv");
        let with = format!(
            "{file}, reader: columns, reader_parameters: {{columns: \"{layout}\", separator: comma}}"
        );
        let block = format!("file: ripley/{recording}.csv\n");
        let profile = dir.read("robots/ripley.yaml");
        dir = if profile.contains(&block) {
            let nested = format!(
                "{block}    reader: columns\n    reader_parameters: {{columns: \"{layout}\", separator: comma}}\n"
            );
            dir.edit("robots/ripley.yaml", &block, &nested)
        } else {
            dir.edit("robots/ripley.yaml", &file, &with)
        };
        dir = dir.file(&path, body);
    }
    let dir = dir.edit(
        "robots/ripley.yaml",
        "recordings:\n",
        "plugins: {column-reader: {path: libcolumn_reader.so}}\nrecordings:\n",
    );
    let plugged = dir.calib(["run", "robots/ripley.yaml", "--out", "plugged"]);
    assert_eq!(plugged.code, 0, "{}", plugged.stderr);
    let (a, b) = (
        dir.json("built_in/report.json"),
        dir.json("plugged/report.json"),
    );
    for (list, numbers) in [
        ("transforms", &["translation_m", "rotation_xyzw"][..]),
        ("parameters", &["value"][..]),
    ] {
        let (x, y) = (
            a[list].as_array().expect("a list"),
            b[list].as_array().expect("a list"),
        );
        assert_eq!(x.len(), y.len());
        for (x, y) in x.iter().zip(y) {
            for number in numbers {
                assert_same(
                    &x[number],
                    &y[number],
                    &format!("{list} {}.{number}", x["name"]),
                );
            }
        }
    }
    let errors = |report: &Value| report["verification"]["held_out"]["calibrated"].clone();
    assert_same(&errors(&a), &errors(&b), "held-out errors");
}

#[test]
fn an_estimator_in_rust_is_named_like_a_built_in_one() {
    let program = PathBuf::from(env!("CARGO_BIN_EXE_calib"));
    let name = format!(
        "{}geometric_median{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    );
    let built = program.parent().expect("a folder");
    let places = [built.join(&name), built.join("deps").join(&name)];
    let library = places
        .iter()
        .find(|p| p.exists())
        .unwrap_or(&places[0])
        .clone();
    if !library.exists() {
        skipped_tests::skip("the plugin is not built (`cargo test --workspace` builds it)");
        return;
    }
    let plugins = format!(
        "plugins: {{geometric-median: {{path: \"{}\"}}}}\nrecordings:\n",
        library.display()
    );
    let dir = Scratch::new()
        .brief("justin")
        .edit("robots/justin.yaml", "recordings:\n", &plugins)
        .edit(
            "robots/justin.yaml",
            "center: sfe",
            "center: geometric_median",
        );
    let ran = dir.calib([
        "run",
        "robots/justin.yaml",
        "--method",
        "paper",
        "--out",
        "out",
        "--allow-plugins",
    ]);
    assert!(ran.code == 0 || ran.code == 1, "{}", ran.stderr);
    let built_in = Scratch::new().brief("justin");
    built_in.calib([
        "run",
        "robots/justin.yaml",
        "--method",
        "paper",
        "--out",
        "out",
    ]);
    let place = |report: Value| -> Vec<f64> {
        let all = report["transforms"].as_array().expect("transforms").clone();
        let found = all
            .iter()
            .find(|t| t["name"] == "heT_from_head")
            .expect("the head")
            .clone();
        found["translation_m"]
            .as_array()
            .expect("three")
            .iter()
            .map(|x| x.as_f64().expect("a number"))
            .collect()
    };
    let (a, b) = (
        place(dir.json("out/report.json")),
        place(built_in.json("out/report.json")),
    );
    let distance = a
        .iter()
        .zip(&b)
        .map(|(x, y)| (x - y).powi(2))
        .sum::<f64>()
        .sqrt();
    // Two estimators of one center from 63 poses at 0.5 mm: within a millimeter, and not the same numbers.
    assert!(distance < 1e-3 && distance > 0.0, "{distance}");
    let off = dir.calib(["run", "robots/justin.yaml", "--no-plugins", "--out", "off"]);
    assert_eq!(off.code, 6);
    assert!(
        off.stderr.contains("geometric") && off.stderr.contains("--no-plugins"),
        "{}",
        off.stderr
    );
}

#[test]
fn what_is_no_plugin_is_refused_and_nothing_is_written() {
    let dir = Scratch::new()
        .brief("justin")
        .file("robots/notes.so", "no library at all")
        .edit(
            "robots/justin.yaml",
            "recordings:\n",
            "plugins: {notes: {path: notes.so}}\nrecordings:\n",
        );
    let ran = dir.calib(["run", "robots/justin.yaml", "--out", "out"]);
    assert_eq!(ran.code, 6, "{}", ran.stderr);
    assert!(ran.stderr.contains("notes"), "{}", ran.stderr);
    assert!(!dir.path("out").exists());
    let pinned = Scratch::new()
        .brief("justin")
        .file("robots/notes.so", "no library at all")
        .edit(
            "robots/justin.yaml",
            "recordings:\n",
            &format!(
                "plugins: {{notes: {{path: notes.so, sha256: \"{}\"}}}}\nrecordings:\n",
                "0".repeat(64)
            ),
        );
    let ran = pinned.calib(["run", "robots/justin.yaml", "--out", "out"]);
    assert_eq!(ran.code, 6, "{}", ran.stderr);
    assert!(ran.stderr.contains("0000"), "{}", ran.stderr);
}

#[test]
fn an_estimator_that_does_not_exist_is_a_usage_error_with_the_nearest() {
    let dir =
        Scratch::new()
            .brief("justin")
            .edit("robots/justin.yaml", "center: sfe", "center: sfx");
    let ran = dir.calib(["run", "robots/justin.yaml", "--out", "out"]);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("sfe"), "{}", ran.stderr);
}

#[test]
fn a_built_in_report_writer_runs_by_name() {
    let dir = Scratch::new().brief("ripley").edit(
        "robots/ripley.yaml",
        "  add_bodies: [linkM, gripM]",
        "  add_bodies: [linkM, gripM]\n  reports: {summary: {}}",
    );
    let ran = dir.calib(["run", "robots/ripley.yaml", "--out", "out"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(dir.read("out/summary.summary.txt").contains("ripley"));
}
