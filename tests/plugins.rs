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
    // Whose code it was stands in the report and in the scene.
    let [report, scene] = ["out/report.json", "out/justin.scene.json"].map(|file| dir.json(file));
    for components in [&report["components"], &scene["provenance"]["components"]] {
        let components = components.as_array().expect("a list");
        let used = |kind: &str| components.iter().find(|c| c["kind"] == kind).expect(kind);
        let center = used("calib.cor/1");
        assert_eq!(center["name"], "geometric_median");
        assert_eq!(center["plugin"]["name"], "geometric-median");
        let hash = center["plugin"]["sha256"].as_str().expect("a hash");
        assert_eq!(hash.len(), 64, "{hash}");
        assert!(used("calib.reader/1")["plugin"].is_null());
    }
    let page = dir.read("out/report.md");
    assert!(page.contains("plugin geometric-median"), "{page}");
    let table = root().join("robots/justin/head_sweep.csv");
    let table = table.to_str().expect("a path");
    let place = library.to_str().expect("a path");
    let only = ["--use-only", "heT"];
    let fit = [
        "fit", "cor", table, "--plugin", place, only[0], only[1], "--json",
    ];
    let fitted = dir.calib(fit);
    assert_eq!(fitted.code, 0, "{}", fitted.stderr);
    let fitted: Value = serde_json::from_str(&fitted.stdout).expect("JSON");
    assert_eq!(fitted["plugin"]["name"], "geometric-median");
    assert!(fitted["rms_m"].as_f64() < Some(1e-3));
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

/// What a stranger does from an installed program: a project, its library, and a file that only it reads.
#[test]
fn a_reader_of_a_new_project_is_asked_whether_it_knows_a_file() {
    let dir = Scratch::new().file("sweep.txt", "#my_table 1\n0.00,1.5,-20.25,300\n0.01,,,\n");
    let made = dir.calib([
        "plugins", "new", "my-table", "--kind", "reader", "--lang", "c",
    ]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let built = Command::new("cc")
        .args([
            "-std=c11",
            "-fPIC",
            "-shared",
            "-Iinclude",
            "plugin.c",
            "-o",
            "my-table.so",
        ])
        .current_dir(dir.path("my-table"))
        .status();
    if built.is_err() {
        skipped_tests::skip("no C compiler");
        return;
    }
    let place = "./my-table/my-table.so";
    let alone = dir.calib(["convert", "sweep.txt", "alone.csv"]);
    assert_ne!(alone.code, 0, "{}", alone.stdout);
    let marker = "marker=ball";
    let convert = [
        "convert",
        "sweep.txt",
        "sweep.csv",
        "--plugin",
        place,
        "--parameter",
        marker,
    ];
    let converted = dir.calib(convert);
    assert_eq!(converted.code, 0, "{}", converted.stderr);
    assert!(
        converted.stderr.contains("read as my_table"),
        "{}",
        converted.stderr
    );
    assert!(
        dir.read("sweep.csv").contains("ball"),
        "{}",
        dir.read("sweep.csv")
    );
    let wrong = [
        "convert",
        "sweep.txt",
        "x.csv",
        "--plugin",
        place,
        "--parameter",
        "markr=ball",
    ];
    let wrong = dir.calib(wrong);
    assert_eq!(wrong.code, 2, "{}", wrong.stderr);
    assert!(
        wrong.stderr.contains("did you mean `marker`?"),
        "{}",
        wrong.stderr
    );
}

/// The project's estimator of a center states no covariance: its number counts, and what stands in place of σ is said.
#[test]
fn a_center_of_a_new_project_shapes_the_result() {
    let dir = Scratch::new().robot("ripley");
    let new = [
        "plugins",
        "new",
        "my-sphere",
        "--kind",
        "center",
        "--lang",
        "c",
        "--out",
        "new",
    ];
    dir.calib(new).expect(0);
    let project = dir.path("new/my-sphere");
    std::fs::create_dir(dir.path("robots/plugins")).expect("a folder");
    let library = dir.path("robots/plugins/libmy-sphere.so");
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
        .arg(&library)
        .current_dir(&project)
        .status();
    if built.is_err() {
        skipped_tests::skip("no C compiler");
        return;
    }
    let plain = [
        "run",
        "robots/ripley.yaml",
        "--method",
        "paper",
        "--out",
        "plain",
    ];
    dir.calib(plain);
    let dir = dir
        .edit("robots/ripley.yaml", "center: sfe", "center: my_sphere")
        .edit(
            "robots/ripley.yaml",
            "recordings:\n",
            "plugins: {my-sphere: {}}\nrecordings:\n",
        );
    let ran = dir.calib([
        "run",
        "robots/ripley.yaml",
        "--method",
        "paper",
        "--out",
        "out",
    ]);
    assert!(ran.code < 2, "{}", ran.stderr);
    let report = dir.json("out/report.json");
    let findings = report["findings"].as_array().expect("findings");
    let said = findings
        .iter()
        .find(|f| f["id"] == "origin-without-covariance");
    assert_eq!(said.expect("said")["facts"]["estimator"], "my_sphere");
    let place = |report: &Value| {
        let all = report["transforms"].as_array().expect("transforms");
        let found = all.iter().find(|t| t["name"] == "linkM_from_base");
        let found = found.expect("the base")["translation_m"].clone();
        [0, 1, 2].map(|i| found[i].as_f64().expect("m"))
    };
    let (own, built_in) = (place(&report), place(&dir.json("plain/report.json")));
    let squares = own.iter().zip(built_in).map(|(a, b)| (a - b).powi(2));
    let distance = squares.sum::<f64>().sqrt();
    // The same formula with another rounding at most: within a tenth of a millimeter.
    assert!(distance < 1e-4, "{distance}");
}

#[test]
fn check_refuses_what_run_would_refuse() {
    for (from, to, said) in [
        ("center: sfe", "center: sfx", "sfe"),
        (
            "center: sfe",
            "center: sfe\n    center_parameters: {weak_fractoin: 0.1}",
            "weak_fraction",
        ),
        ("center: sfe", "center: score", "two bodies"),
    ] {
        let dir = Scratch::new()
            .robot("justin")
            .edit("robots/justin.yaml", from, to);
        let checked = dir.calib(["check", "robots/justin.yaml"]);
        let ran = dir.calib(["run", "robots/justin.yaml", "--out", "out"]);
        assert_eq!(
            (checked.code, ran.code),
            (2, 2),
            "{to}: {} {}",
            checked.stderr,
            ran.stderr
        );
        assert!(checked.stderr.contains(said), "{to}: {}", checked.stderr);
        assert_eq!(checked.stderr, ran.stderr);
    }
    let dir = Scratch::new().robot("ripley").edit(
        "robots/ripley.yaml",
        "  add_bodies: [linkM, gripM]",
        "  add_bodies: [linkM, gripM]\n  reports: {sumary: {}}",
    );
    let checked = dir.calib(["check", "robots/ripley.yaml"]);
    assert_eq!(checked.code, 2, "{}", checked.stderr);
    assert!(checked.stderr.contains("summary"), "{}", checked.stderr);
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
