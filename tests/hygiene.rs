//! What must not lie around in the repository, and what every file of a kind has.
//!
//! Forbidden words are put together at run time, so that this file does not contain them itself.

#[path = "language.rs"]
mod language;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// What holds nothing of ours: build output, results, version control (a file in a linked worktree).
const SKIPPED: &[&str] = &["target", ".git", "results", ".calib", "node_modules"];

/// Every file below the root, as (path relative to the root with `/`, absolute path), sorted.
fn files() -> Vec<(String, PathBuf)> {
    let mut found = Vec::new();
    let mut folders = vec![root()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder of the repository is readable") {
            let path = entry
                .expect("an entry of the repository is readable")
                .path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if SKIPPED.contains(&&*name) || path.ends_with("book/book") {
                continue;
            }
            if path.is_dir() {
                folders.push(path);
            } else {
                let relative = path.strip_prefix(root()).expect("below the root");
                found.push((relative.to_string_lossy().replace('\\', "/"), path));
            }
        }
    }
    found.sort();
    found
}

/// Files that are text, with their text.
fn texts() -> Vec<(String, String)> {
    files()
        .into_iter()
        .filter_map(|(name, path)| Some((name, String::from_utf8(fs::read(path).ok()?).ok()?)))
        .collect()
}

/// `file:line: text` of every line that `is_bad` names a reason for.
fn bad_lines(
    files: &[(String, String)],
    is_bad: impl Fn(&str, &str) -> Option<&'static str>,
) -> Vec<String> {
    let mut found = Vec::new();
    for (name, text) in files {
        for (number, line) in text.lines().enumerate() {
            if let Some(reason) = is_bad(name, line) {
                let shown: String = line.trim().chars().take(100).collect();
                found.push(format!("{name}:{}: {reason}: {shown}", number + 1));
            }
        }
    }
    found
}

/// Whether `word` stands in `line` with no letter or digit on either side.
fn has_word(line: &str, word: &str) -> bool {
    let free = |c: Option<char>| !c.is_some_and(|c| c.is_alphanumeric() || c == '_');
    line.match_indices(word).any(|(at, _)| {
        free(line[..at].chars().next_back()) && free(line[at + word.len()..].chars().next())
    })
}

fn machine_path(line: &str) -> Option<&'static str> {
    // A path that begins on one machine: preceded by nothing that could make it relative or a URL.
    ["root/", "home/", "work/", "tmp/", "Users/"]
        .iter()
        .any(|start| {
            let absolute = format!("/{start}");
            line.match_indices(&absolute).any(|(at, _)| {
                line[..at].chars().next_back().is_none_or(|c| {
                    !(c.is_alphanumeric() || matches!(c, '.' | '_' | '-' | '/' | '}' | '*' | '>'))
                })
            })
        })
        .then_some("names a path of one machine")
}

fn registry_address(line: &str) -> Option<&'static str> {
    let line = line.trim();
    let public = "registry+https://github.com/rust-lang/crates.io-index";
    let foreign = (line.starts_with("source = \"") && !line.contains(public))
        || line.starts_with(&["[sour", "ce."].concat())
        || line.contains(&["sparse", "+http"].concat())
        || line.contains(&["--index", "-url"].concat())
        || line.starts_with(&["registry", " = "].concat());
    foreign.then_some("names a package registry")
}

fn left_over(line: &str) -> Option<&'static str> {
    let words = [["TO", "DO"], ["FIX", "ME"], ["XX", "X"]];
    let calls = [["todo", "!("], ["unimplemented", "!("], ["dbg", "!("]];
    (words.iter().any(|w| has_word(line, &w.concat()))
        || calls.iter().any(|c| line.contains(&c.concat())))
    .then_some("is unfinished")
}

/// The general SVD of nalgebra is wrong on repeated or vanishing singular values (dimforge/nalgebra#1172).
fn untrusted_svd(line: &str) -> Option<&'static str> {
    let code = line.split("//").next().unwrap_or_default();
    [
        [".sv", "d("],
        [".sv", "d_unordered("],
        ["SVD", "::new"],
        [".try_sv", "d("],
    ]
    .iter()
    .any(|call| code.contains(&call.concat()))
    .then_some("uses nalgebra's SVD instead of calib_geometry::decompose")
}

/// Every output goes through `calib-files`, every input of a person's file too: links, pipes, full disks and stops are its business.
fn past_the_road(name: &str, line: &str) -> Option<&'static str> {
    let ours = name.starts_with("crates/") && name.contains("/src/") && name.ends_with(".rs");
    if !ours || name.starts_with("crates/calib-files/") || line.trim_start().starts_with("//") {
        return None;
    }
    let writes = [
        "fs::write(",
        "File::create",
        "OpenOptions",
        "fs::rename(",
        "fs::remove_",
        "fs::create_dir",
        "fs::copy(",
        "fs::hard_link(",
        "set_permissions(",
        "create_new(",
    ];
    let reads = ["fs::read(", "fs::read_to_string(", "fs::File::open("];
    // The kernel's own files are no person's.
    let of_system = line.contains("/proc/self");
    if writes.iter().any(|call| line.contains(call)) {
        return Some("writes past calib-files");
    }
    let reads = reads.iter().any(|call| line.contains(call)) && !of_system;
    reads.then_some("reads past calib_files::input")
}

#[test]
fn files_go_one_road() {
    let found = bad_lines(&texts(), past_the_road);
    assert!(found.is_empty(), "{}", found.join("\n"));
    let is_bad = |line: &str| past_the_road("crates/calib-x/src/a.rs", line).is_some();
    assert!(is_bad("    std::fs::write(&path, text)?;"));
    assert!(is_bad("let bytes = fs::read(path)?;"));
    assert!(!is_bad("calib_files::replace(path, bytes)?;"));
}

#[test]
fn nothing_names_a_machine_a_registry_or_unfinished_work() {
    let texts = texts();
    assert!(
        texts.len() > 100,
        "the walk found only {} files",
        texts.len()
    );
    let mut found = bad_lines(&texts, |_, line| machine_path(line));
    found.extend(bad_lines(&texts, |name, line| {
        (name == "Cargo.lock" || !name.ends_with(".lock"))
            .then(|| registry_address(line))
            .flatten()
    }));
    found.extend(bad_lines(&texts, |name, line| {
        (name != "Cargo.lock").then(|| left_over(line)).flatten()
    }));
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn the_words_are_found_where_they_stand() {
    let slash = "/";
    assert!(machine_path(&format!("see {slash}root/x")).is_some());
    assert!(machine_path(&format!("\"{slash}tmp/x\"")).is_some());
    assert!(machine_path("../work/x, a/tmp/b, https://x.org/home/y").is_none());
    assert!(registry_address("source = \"registry+https://example.org/index\"").is_some());
    assert!(
        registry_address("source = \"registry+https://github.com/rust-lang/crates.io-index\"")
            .is_none()
    );
    assert!(left_over(&["// TO", "DO: later"].concat()).is_some());
    assert!(left_over("TODOS are a dish").is_none());
    assert!(untrusted_svd(&["let s = m.sv", "d(true, true);"].concat()).is_some());
    assert!(untrusted_svd("let s = decompose::svd(&m); // not m.svd(…)").is_none());
}

#[test]
fn estimation_uses_the_trusted_decompositions() {
    let sources: Vec<_> = texts()
        .into_iter()
        .filter(|(name, _)| {
            name.starts_with("crates/") && name.contains("/src/") && name.ends_with(".rs")
        })
        .collect();
    assert!(sources.len() > 50, "only {} source files", sources.len());
    let found = bad_lines(&sources, |_, line| untrusted_svd(line));
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// Archives and programs come in by chance; all that belongs here can be read.
#[test]
fn every_file_is_text() {
    let is_text = |path: &Path| String::from_utf8(fs::read(path).unwrap_or_default()).is_ok();
    let others: Vec<String> = files()
        .into_iter()
        // What a fuzzer found stays on the machine.
        .filter(|(name, _)| !name.starts_with("fuzz/"))
        .filter(|(_, path)| !is_text(path))
        .map(|(name, _)| name)
        .collect();
    assert!(others.is_empty(), "no text: {}", others.join(", "));
}

#[test]
fn no_snapshot_waits_for_review() {
    let waiting: Vec<String> = files()
        .into_iter()
        .map(|(name, _)| name)
        .filter(|name| name.ends_with(".snap.new"))
        .collect();
    assert!(waiting.is_empty(), "not reviewed: {}", waiting.join(", "));
}

#[test]
fn every_profile_names_its_schema() {
    let profiles: Vec<_> = texts()
        .into_iter()
        .filter(|(name, _)| {
            name.starts_with("robots/") && (name.ends_with(".yaml") || name.ends_with(".yml"))
        })
        .collect();
    assert!(profiles.len() >= 2, "robots/ has no profiles");
    for (name, text) in profiles {
        let depth = name.matches('/').count() - 1;
        let schema = format!("{}profile.schema.json", "../".repeat(depth));
        assert_eq!(
            text.lines().next().unwrap_or_default(),
            format!("# yaml-language-server: $schema={schema}"),
            "first line of {name}"
        );
    }
}

#[test]
fn the_schema_file_is_what_the_program_prints() {
    let output = Command::new(env!("CARGO_BIN_EXE_calib"))
        .arg("schema")
        .output()
        .expect("calib starts");
    assert!(output.status.success(), "calib schema: {}", output.status);
    let file = fs::read(root().join("robots/profile.schema.json")).expect("the schema is there");
    assert!(
        file == output.stdout,
        "robots/profile.schema.json is old: `cargo run -- schema > robots/profile.schema.json`"
    );
}
