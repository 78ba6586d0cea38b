//! The border to C: the header names what the library exports, and the example of the repository compiles and runs, in C and in C++.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const HEADER: &str = include_str!("../include/calib_model.h");
const BORDER: &str = concat!(
    include_str!("../src/c/mod.rs"),
    include_str!("../src/c/calls.rs")
);

/// Names of functions that are declared or defined with a `(` after them, without comments.
fn functions(text: &str, before: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for (at, _) in text.match_indices(before) {
        let name: String = text[at + before.len() - "calib_model_".len()..]
            .chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect();
        let after = text[at + before.len() - "calib_model_".len() + name.len()..]
            .chars()
            .next();
        if after == Some('(') {
            found.insert(name);
        }
    }
    found
}

fn declared() -> BTreeSet<String> {
    let code: String = HEADER
        .split("/*")
        .map(|part| part.split_once("*/").map_or(part, |p| p.1))
        .collect();
    functions(&code, "calib_model_")
}

/// What cargo has built of this library, with this ending.
fn library(ending: &str) -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    let deps = program.parent()?;
    let folders = [deps, deps.parent()?];
    let named = |path: &Path| {
        let name = path
            .file_name()
            .map(|n| n.to_string_lossy().into_owned())
            .unwrap_or_default();
        name.starts_with("libcalib_model") && name.ends_with(ending)
    };
    let files = folders
        .iter()
        .filter_map(|f| std::fs::read_dir(f).ok())
        .flatten()
        .flatten();
    let files = files.map(|f| f.path()).filter(|p| named(p));
    files.max_by_key(|p| p.metadata().and_then(|m| m.modified()).ok())
}

/// A command's output; `None`, counted as skipped, where the program is not installed.
fn output(command: &mut Command, what: &str) -> Option<Output> {
    match command.output() {
        Ok(output) => Some(output),
        Err(_) => {
            skipped_tests::skip(what);
            None
        }
    }
}

#[test]
fn the_header_declares_what_the_library_exports() {
    let defined = functions(BORDER, "extern \"C\" fn calib_model_");
    assert_eq!(declared(), defined);
    assert!(defined.len() > 18, "{defined:?}");
    let Some(library) = library(".so") else {
        return skipped_tests::skip("no shared library of calib-model was built");
    };
    let symbols = Command::new("nm")
        .args(["-D", "--defined-only"])
        .arg(library)
        .output();
    let Some(symbols) = symbols.ok().filter(|o| o.status.success()) else {
        return skipped_tests::skip("no nm");
    };
    let text = String::from_utf8_lossy(&symbols.stdout);
    let exported: BTreeSet<String> = text
        .lines()
        .filter_map(|line| line.split_whitespace().last())
        .filter(|name| name.starts_with("calib_"))
        .map(str::to_owned)
        .collect();
    assert_eq!(exported, defined);
}

/// Compiles a program with the library; `false`, counted as skipped, where there is no compiler.
fn compiled(
    (compiler, arguments): (&str, &[&str]),
    source: &Path,
    archive: &Path,
    program: &Path,
) -> bool {
    let mut command = Command::new(compiler);
    command
        .args(arguments)
        .args(["-Wall", "-Wextra", "-Werror", "-O1", "-I"])
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("include"))
        .arg(source)
        .args(["-x", "none"])
        .arg(archive)
        .args(["-lm", "-lpthread", "-ldl", "-o"])
        .arg(program);
    let Some(built) = output(&mut command, "no C compiler") else {
        return false;
    };
    let said = String::from_utf8_lossy(&built.stderr);
    assert!(built.status.success(), "{said}");
    true
}

/// Under valgrind, where it is installed.
fn runs_clean(program: &Path, model: &Path) {
    let mut command = Command::new("valgrind");
    command.args([
        "--error-exitcode=9",
        "--leak-check=full",
        "--show-leak-kinds=all",
        "-q",
    ]);
    if let Some(checked) = output(command.arg(program).arg(model), "no valgrind") {
        let said = String::from_utf8_lossy(&checked.stderr).into_owned();
        assert!(checked.status.success() && said.is_empty(), "{said}");
    }
}

#[test]
fn the_example_compiles_without_a_warning_and_runs_clean() {
    let Some(archive) = library(".a") else {
        return skipped_tests::skip("no static library of calib-model was built");
    };
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().expect("a folder");
    let model = here.join("tests/it/arm.model.json");
    let mut texts = Vec::new();
    for (compiler, arguments) in [
        ("cc", &["-std=c11"][..]),
        ("c++", &["-x", "c++", "-std=c++17"][..]),
    ] {
        let program = folder.path().join(compiler);
        let source = here.join("../../examples/c/arm.c");
        if !compiled((compiler, arguments), &source, &archive, &program) {
            return;
        }
        let ran = Command::new(&program)
            .arg(&model)
            .output()
            .expect("it starts");
        let text = String::from_utf8_lossy(&ran.stdout).into_owned();
        assert!(
            ran.status.success() && text.starts_with("1000 cycles, 0 refused"),
            "{text}{ran:?}"
        );
        texts.push(text);
    }
    assert_eq!(texts[0], texts[1]);
    let program = folder.path().join("cc");
    // A file that is none is refused in words.
    let refused = Command::new(&program)
        .arg(here.join("Cargo.toml"))
        .output()
        .expect("it starts");
    assert_eq!(refused.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("line 1, column"));
    runs_clean(&program, &model);
}

/// The header promises both.
#[test]
fn what_is_refused_leaves_outputs_and_memory_as_they_were() {
    let Some(archive) = library(".a") else {
        return skipped_tests::skip("no static library of calib-model was built");
    };
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("refused");
    let source = here.join("tests/refused.c");
    if compiled(("cc", &["-std=c11"]), &source, &archive, &program) {
        let model = here.join("tests/it/arm.model.json");
        let ran = Command::new(&program).arg(&model).output();
        let ran = ran.expect("it starts");
        assert!(ran.status.success(), "{ran:?}");
        runs_clean(&program, &model);
    }
}
