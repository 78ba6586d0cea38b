//! Facts are data: no code of ours cuts, seeks or compares text that was made for people.
//!
//! A finding, an error and a report item have ids and values; the words are made from them at the end. Code that looks
//! into the words again breaks when a sentence is corrected.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Fields and methods that hold text for people.
const WORDS: [&str; 6] = [
    ".text",
    ".text()",
    ".remedy",
    ".remedy()",
    ".subject",
    ".to_string()",
];

/// What looks into a text.
const LOOKS: [&str; 11] = [
    ".contains(",
    ".starts_with(",
    ".ends_with(",
    ".split(",
    ".split_once(",
    ".rsplit_once(",
    ".strip_prefix(",
    ".strip_suffix(",
    ".trim_end_matches(",
    ".trim_start_matches(",
    ".matches(",
];

/// Files that still look into their own words; an entry without need fails.
const LEFT: [&str; 0] = [];

/// Every source of the crates, without their tests, as (path from the root, text), sorted.
fn sources() -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut folders = vec![root().join("crates")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder is readable") {
            let path = entry.expect("an entry is readable").path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if path.is_dir() {
                if !["target", "tests", "benches", "examples"].contains(&&*name) {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = fs::read_to_string(&path).expect("a source is text");
                let shown = path.strip_prefix(root()).expect("below the root");
                found.push((shown.to_string_lossy().replace('\\', "/"), text));
            }
        }
    }
    found.sort();
    found
}

/// Statements that look into words: (first line's number from 1, the statement on one line). Tests inside of a
/// source, which compare sentences on purpose, are left out.
fn looks_into_words(source: &str) -> Vec<(usize, String)> {
    let code = source.split("#[cfg(test)]").next().unwrap_or_default();
    let mut found = Vec::new();
    let mut statement = String::new();
    let mut first = 1;
    for (number, line) in code.lines().enumerate() {
        let line = line.trim();
        if line.starts_with("//") {
            continue;
        }
        if !line.starts_with('.') {
            statement.clear();
            first = number + 1;
        }
        statement += line;
        let looks = WORDS.iter().any(|word| {
            LOOKS
                .iter()
                .any(|look| statement.contains(&format!("{word}{look}")))
        });
        let compares = [".text", ".text()", ".remedy", ".remedy()", ".subject"]
            .iter()
            .any(|word| {
                statement.contains(&format!("{word} == \""))
                    || statement.contains(&format!("{word} != \""))
            });
        if looks || compares {
            found.push((first, statement.clone()));
            statement.clear();
        }
    }
    found
}

#[test]
fn no_code_looks_into_words() {
    let mut wrong = Vec::new();
    let mut needed = Vec::new();
    for (path, text) in sources() {
        for (line, statement) in looks_into_words(&text) {
            match LEFT.iter().find(|file| **file == path) {
                Some(file) => needed.push(*file),
                None => wrong.push(format!("{path}:{line}: {statement}")),
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "compare ids, subjects and values instead of text:\n{}",
        wrong.join("\n")
    );
    for file in LEFT {
        assert!(needed.contains(&file), "mended, remove from LEFT: {file}");
    }
}

#[test]
fn findings_are_made_without_words() {
    let mut wrong = Vec::new();
    for (path, text) in sources() {
        for (place, _) in text.match_indices("Finding::new(") {
            let argument = text[place + "Finding::new(".len()..].trim_start();
            if argument.starts_with('"') {
                wrong.push(path.clone());
            }
        }
    }
    assert!(wrong.is_empty(), "an id comes from the catalog: {wrong:?}");
}

#[test]
fn the_test_sees_what_it_is_for() {
    let bad = [
        "if finding.text().contains(\"left-handed\") {",
        "let body = f.subject\n    .split_once(\": \");",
        "if f.remedy == \"nothing\" {",
        "error.to_string().starts_with(\"no\")",
    ];
    for source in bad {
        assert_eq!(looks_into_words(source).len(), 1, "{source}");
    }
    let good = [
        "if finding.id == catalog::MIRRORED {",
        "// text.contains(",
        "#[cfg(test)]\nmod tests { f.text().contains(\"x\") }",
        "let t = f.text();\nline.contains('x')",
    ];
    for source in good {
        assert!(looks_into_words(source).is_empty(), "{source}");
    }
}
