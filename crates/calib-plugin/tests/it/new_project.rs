//! A new project builds, passes its own test, loads, and passes the conformance check.

use std::{collections::BTreeMap, path::Path, process::Command, time::Duration};

use calib_plugin::{
    Control, Host, Kind, Language, MotionData, SearchPath,
    check::{Limits, check},
    kind_from_name, new_project,
};

use crate::bed::compiler;

fn tree(folder: &Path) -> Vec<String> {
    let mut out = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            out.extend(
                tree(&entry.path())
                    .iter()
                    .map(|inner| format!("{name}/{inner}")),
            );
        } else {
            out.push(name);
        }
    }
    out.sort();
    out
}

fn passes(library: &Path) {
    let limits = Limits {
        huge: 20_000,
        call: Duration::from_secs(20),
        ..Limits::default()
    };
    let host = Host::new(SearchPath::default(), true);
    let table = check(&host, library.to_str().unwrap(), &limits);
    assert!(table.passed(), "{table}");
}

fn cargo(command: &str, project: &Path, target: &Path) {
    let output = Command::new(env!("CARGO"))
        .args([command, "--offline", "--manifest-path"])
        .arg(project.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(target)
        .env("RUSTFLAGS", "-Dwarnings")
        .output()
        .unwrap();
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo {command}\n{messages}");
}

#[test]
fn a_rust_project_is_complete() {
    let folder = tempfile::tempdir().unwrap();
    let project = new_project("my-sphere", Kind::Cor, Language::Rust, folder.path()).unwrap();
    insta::assert_snapshot!(tree(&project).join("\n"));
    // Offline and with no registry: it depends on nothing outside of its folder.
    let target = folder.path().join("target");
    cargo("test", &project, &target);
    cargo("build", &project, &target);
    let file = format!(
        "{}my_sphere{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    );
    let library = target.join("debug").join(file);
    passes(&library);

    // A panic in a real shared library, with its own copy of the standard library, stops at its border.
    let source = project.join("src/lib.rs");
    let text = std::fs::read_to_string(&source).unwrap();
    let panics = text.replace(
        "let scale =",
        "assert!(used != 7, \"seven samples\");\n        let scale =",
    );
    assert_ne!(panics, text);
    std::fs::write(&source, panics).unwrap();
    cargo("build", &project, &target);
    let copy = folder
        .path()
        .join(format!("panics{}", std::env::consts::DLL_SUFFIX));
    std::fs::copy(&library, &copy).unwrap();
    let plugin = Host::new(SearchPath::default(), true)
        .load(copy.to_str().unwrap(), None)
        .unwrap();
    let bound = plugin
        .cor("my_sphere")
        .unwrap()
        .with(&BTreeMap::new())
        .unwrap();
    let seven = MotionData::points(&[(0..7).map(|i| Some([f64::from(i), 0.0, 0.0])).collect()]);
    let error = bound.fit(&seven.view(), &Control::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "plugin `my-sphere`, center estimator `my_sphere`: panicked: seven samples"
    );
}

/// Runs a command in a folder, which must succeed; `None` where it is not installed.
fn runs(command: &mut Command, folder: &Path) -> Option<()> {
    let output = match command.current_dir(folder).output() {
        Ok(output) => output,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            skipped_tests::skip(&format!("{command:?} is not installed"));
            return None;
        }
        Err(error) => panic!("{command:?}: {error}"),
    };
    let messages = String::from_utf8_lossy(&output.stderr);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{command:?}\n{messages}\n{said}");
    Some(())
}

/// The other kinds in Rust: without cargo, which would compile the author's side once for each.
#[test]
fn rust_projects_of_every_kind_are_complete() {
    let folder = tempfile::tempdir().unwrap();
    let mut author_side = false;
    for name in ["axis", "reader", "report", "effect"] {
        let kind = kind_from_name(name).unwrap();
        let project = new_project(&format!("my-{name}"), kind, Language::Rust, folder.path());
        let project = project.unwrap();
        let rustc = |arguments: &[&str]| {
            let mut command = Command::new("rustc");
            command
                .args(["--edition", "2024", "-Dwarnings", "-L", "."])
                .args(arguments)
                .env("CARGO_PKG_VERSION", "0.1.0")
                .env("CARGO_PKG_LICENSE", "MIT");
            command
        };
        if !author_side {
            let source = project.join("calib-plugin/src/lib.rs");
            let of_author = [source.to_str().unwrap(), "--crate-type", "rlib"];
            let mut command = rustc(&of_author);
            if runs(
                command.args(["--crate-name", "calib_plugin"]),
                folder.path(),
            )
            .is_none()
            {
                return;
            }
            author_side = true;
        }
        let source = project.join("src/lib.rs");
        let with = ["--extern", "calib_plugin=libcalib_plugin.rlib"];
        let tests = [source.to_str().unwrap(), "--test", "-o", "tests"];
        runs(rustc(&tests).args(with), folder.path());
        runs(
            &mut Command::new(folder.path().join("tests")),
            folder.path(),
        );
        let library = format!("lib{name}.so");
        let plugin = [
            source.to_str().unwrap(),
            "--crate-type",
            "cdylib",
            "-o",
            &library,
        ];
        runs(rustc(&plugin).args(with), folder.path());
        passes(&folder.path().join(&library));
    }
}

#[test]
fn c_projects_of_every_kind_are_complete() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["center", "axis", "reader", "report", "effect"] {
        let kind = kind_from_name(name).unwrap();
        let project = new_project(&format!("my-{name}"), kind, Language::C, folder.path()).unwrap();
        if name == "center" {
            insta::assert_snapshot!("a_c_project_is_complete", tree(&project).join("\n"));
        }
        if cfg!(windows) || compiler("cc", &["--version"]).is_none() {
            return;
        }
        let flags = "CFLAGS=-std=c11 -Wall -Wextra -Werror -pedantic -O1 -fPIC -Iinclude";
        if runs(Command::new("make").arg(flags), &project).is_none() {
            return;
        }
        runs(Command::new("make").args(["test", flags]), &project);
        let suffix = std::env::consts::DLL_SUFFIX;
        passes(&project.join(format!("libmy-{name}{suffix}")));
    }
}

/// Every `depends_on` with its array, and a project without parameters, pass the check: what is not asked for is not read.
#[test]
fn a_c_effect_of_anything_passes_the_check() {
    if cfg!(windows) || compiler("cc", &["--version"]).is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let formula = "sin(order * states->readings[s])";
    let one = "    const double order = (double)call->values[0].integer;";
    for (k, (on, changed, parameters)) in [
        ("CALIB_ON_READING", "sin(3 * states->readings[s])", false),
        ("CALIB_ON_MOTOR", "sin(order * states->motor_rad[s])", true),
        ("CALIB_ON_LOAD", "order * states->loads[s]", true),
        ("CALIB_ON_LOAD", "states->loads[s]", false),
        ("CALIB_ON_APPROACH", "order * states->approaches[s]", true),
    ]
    .into_iter()
    .enumerate()
    {
        let name = format!("my-effect-{k}");
        let project = new_project(&name, Kind::Effect, Language::C, folder.path()).unwrap();
        let source = std::fs::read_to_string(project.join("plugin.c")).unwrap();
        let mut text = source.replace(formula, changed).replace(
            ".depends_on = CALIB_ON_READING",
            &format!(".depends_on = {on}"),
        );
        assert!(text.contains(changed) && text.contains(&format!(".depends_on = {on}")));
        if !parameters {
            text = text.replace(one, "");
            let begin = text.find("static const calib_parameter").unwrap();
            let end = text.find("static const calib_offer").unwrap();
            text.replace_range(begin..end, "");
            let lines = text.lines().filter(|l| !l.contains(".parameter"));
            text = lines.collect::<Vec<_>>().join("\n") + "\n";
        }
        std::fs::write(project.join("plugin.c"), text).unwrap();
        if runs(
            Command::new("make").arg("CFLAGS=-std=c11 -Wall -O1 -fPIC -Iinclude"),
            &project,
        )
        .is_none()
        {
            return;
        }
        // The project's own test expects the third harmonic; of another formula it says so, and does not crash.
        let test = Command::new("make")
            .arg("test")
            .current_dir(&project)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&test.stdout);
        assert!(
            said.contains("FAILED: the third harmonic") || said.contains("ok"),
            "{on}: {said}"
        );
        let suffix = std::env::consts::DLL_SUFFIX;
        passes(&project.join(format!("lib{name}{suffix}")));
    }
}

/// What an author forgets ends with a line that says so, not with a segmentation fault.
#[test]
fn a_c_test_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    if cfg!(windows) || compiler("cc", &["--version"]).is_none() {
        return;
    }
    let project = new_project("my-sphere", Kind::Cor, Language::C, folder.path()).unwrap();
    let source = std::fs::read_to_string(project.join("plugin.c")).unwrap();
    for (from, to, said) in [
        ("? &table : NULL", "? NULL : NULL", "find() knows the kind"),
        (".fit = fit", ".fit = NULL", "the table has fit()"),
        (
            "CALIB_TAKES_POINTS | CALIB_TAKES_MARKERS",
            "CALIB_TAKES_POSES",
            "it takes points",
        ),
        (
            ".offer_count = sizeof offers / sizeof offers[0]",
            ".offer_count = 0",
            "the plugin offers something",
        ),
    ] {
        let changed = source.replace(from, to);
        assert_ne!(changed, source, "{from}");
        std::fs::write(project.join("plugin.c"), changed).unwrap();
        let built = Command::new("cc")
            .args([
                "-std=c11",
                "-w",
                "-Iinclude",
                "plugin.c",
                "test.c",
                "-o",
                "t",
                "-lm",
            ])
            .current_dir(&project)
            .status();
        assert!(built.unwrap().success(), "{to}");
        let ran = Command::new(project.join("t")).output().unwrap();
        let text = String::from_utf8_lossy(&ran.stdout);
        assert_eq!(ran.status.code(), Some(1), "{to}: {text}");
        assert!(text.contains(said), "{to}: {text}");
    }
}

#[test]
fn bad_names_and_folders_in_use_leave_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["", "My", "1st", "a/b", "..", "a_b", "calib-plugin"] {
        let error = new_project(name, Kind::Cor, Language::C, folder.path()).unwrap_err();
        assert_eq!(
            error.to_string(),
            format!(
                "`{name}` is not a plugin name: lower-case letters, digits and `-`, a letter first, at most 64"
            )
        );
    }
    new_project("twice", Kind::Cor, Language::C, folder.path()).unwrap();
    let error = new_project("twice", Kind::Cor, Language::Rust, folder.path()).unwrap_err();
    assert!(
        error.to_string().contains("twice exists already\n  help: "),
        "{error}"
    );
    let missing = new_project(
        "x",
        Kind::Cor,
        Language::C,
        &folder.path().join("twice").join("plugin.c"),
    );
    assert!(
        missing
            .unwrap_err()
            .to_string()
            .contains("cannot be written")
    );
    assert!(
        Language::from_name("go")
            .unwrap_err()
            .to_string()
            .contains("`rust`, `c`")
    );
    let left: Vec<_> = tree(folder.path())
        .into_iter()
        .filter(|f| !f.starts_with("twice/"))
        .collect();
    assert_eq!(left, Vec::<String>::new());
}
