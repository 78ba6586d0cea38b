//! Files and functions stay short enough to be read at once.

use std::fs;
use std::path::{Path, PathBuf};

/// Lines of a file of `src`, at the most.
const FILE: usize = 500;
/// Lines of the file in the middle of all, at the most.
const MEDIAN: usize = 180;
/// Lines of a function, at the most.
const FUNCTION: usize = 100;
/// Lines of the file that names the steps of a run, at the most.
const RUN: usize = 149;

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of the repository is readable") {
        let path = entry.expect("an entry is readable").path();
        if path.is_dir() && !path.ends_with("target") {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// Every file of a crate's or a plugin's `src`, with its text.
fn all() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut found = Vec::new();
    sources(&root.join("crates"), &mut found);
    sources(&root.join("plugins"), &mut found);
    let src = |p: &PathBuf| p.components().any(|c| c.as_os_str() == "src");
    found.retain(src);
    found.sort();
    let read = |p: PathBuf| {
        let text = fs::read_to_string(&p).expect("a source is text");
        let name = p.strip_prefix(&root).unwrap_or(&p).display().to_string();
        (name, text)
    };
    found.into_iter().map(read).collect()
}

/// Name and length of every function with a body: from its `fn` to the brace that closes it, which stands below its first letter.
fn functions(text: &str) -> Vec<(String, usize)> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (start, line) in lines.iter().enumerate() {
        let code = line.trim_start();
        let words = [
            "pub ",
            "pub(crate) ",
            "pub(super) ",
            "const ",
            "unsafe ",
            "extern \"C\" ",
        ];
        let mut rest = code;
        while let Some(cut) = words.iter().find_map(|w| rest.strip_prefix(w)) {
            rest = cut;
        }
        let Some(rest) = rest.strip_prefix("fn ") else {
            continue;
        };
        let name: String = rest
            .chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect();
        let indent = &line[..line.len() - code.len()];
        let close = format!("{indent}}}");
        let declared = |l: &&str| l.trim_end().ends_with(';') && !l.contains('{');
        for (end, l) in lines.iter().enumerate().skip(start) {
            // The signature ends without a body.
            if l.starts_with(indent)
                && declared(l)
                && !lines[start..=end].iter().any(|l| l.contains('{'))
            {
                break;
            }
            if **l == close || (end == start && l.ends_with('}')) {
                found.push((name, end - start + 1));
                break;
            }
        }
    }
    found
}

#[test]
fn files_and_functions_are_short() {
    let all = all();
    let mut lengths: Vec<usize> = all.iter().map(|(_, text)| text.lines().count()).collect();
    lengths.sort_unstable();
    let mut faults: Vec<String> = Vec::new();
    for (name, text) in &all {
        let lines = text.lines().count();
        let most = match name.as_str() {
            "crates/calib-pipeline/src/run.rs" => RUN,
            _ => FILE,
        };
        if lines > most {
            faults.push(format!(
                "{name} has {lines} lines, at most {most} are wanted"
            ));
        }
        let long = functions(text).into_iter().filter(|f| f.1 > FUNCTION);
        faults.extend(long.map(|(f, n)| format!("{name}: {f} has {n} lines, at most {FUNCTION}")));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    let median = lengths[lengths.len() / 2];
    assert!(
        median <= MEDIAN,
        "the file in the middle has {median} lines"
    );
}

#[test]
fn the_lengths_are_those_that_one_counts() {
    let text = "impl A {\n    /// One.\n    pub fn one(\n        a: u8,\n    ) -> u8 {\n        a\n    }\n}\n\ntrait T {\n    fn none(&self);\n    fn two() {\n    }\n}\nfn three() {}\n";
    let expected = [("one", 5), ("two", 2), ("three", 1)];
    let found = functions(text);
    let found: Vec<(&str, usize)> = found.iter().map(|(n, l)| (n.as_str(), *l)).collect();
    assert_eq!(found, expected);
}
