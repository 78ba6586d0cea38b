//! A new project builds, passes its own test, loads, and passes the conformance check.

use std::{collections::BTreeMap, path::Path, process::Command, time::Duration};

use calib_plugin::{
    Control, Host, Language, MotionData, SearchPath,
    check::{Limits, check},
    new_project,
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
    let project = new_project("my-sphere", Language::Rust, folder.path()).unwrap();
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

#[test]
fn a_c_project_is_complete() {
    let folder = tempfile::tempdir().unwrap();
    let project = new_project("my-sphere", Language::C, folder.path()).unwrap();
    insta::assert_snapshot!(tree(&project).join("\n"));
    if cfg!(windows) || compiler("cc", &["--version"]).is_none() {
        return;
    }
    let flags = "CFLAGS=-std=c11 -Wall -Wextra -Werror -pedantic -O2 -fPIC -Iinclude";
    for target in ["all-but-check", "test"] {
        let mut make = Command::new("make");
        make.current_dir(&project).arg(flags);
        if target == "test" {
            make.arg("test");
        }
        let output = match make.output() {
            Ok(output) => output,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                skipped_tests::skip("no `make`");
                return;
            }
            Err(error) => panic!("make: {error}"),
        };
        let messages = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "make {target}\n{messages}");
    }
    let file = format!(
        "{}my-sphere{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    );
    passes(&project.join(file));
}

#[test]
fn bad_names_and_folders_in_use_leave_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["", "My", "1st", "a/b", "..", "a_b", "calib-plugin"] {
        let error = new_project(name, Language::C, folder.path()).unwrap_err();
        assert_eq!(
            error.to_string(),
            format!(
                "`{name}` is not a plugin name: lower-case letters, digits and `-`, a letter first, at most 64"
            )
        );
    }
    new_project("twice", Language::C, folder.path()).unwrap();
    let error = new_project("twice", Language::Rust, folder.path()).unwrap_err();
    assert!(
        error.to_string().contains("twice exists already\n  help: "),
        "{error}"
    );
    let missing = new_project(
        "x",
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
