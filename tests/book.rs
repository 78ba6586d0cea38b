//! The book is tested: its links resolve, its commands run, its reference is the schema, its findings are the program's.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::process::Command;

use calib_finding::Id;
use serde_json::Value;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The book's pages and the top-level ones: (path relative to the root, text), sorted.
fn pages() -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    let mut folders = vec![root().join("book/src")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("the book's folders are readable") {
            let path = entry.expect("an entry of the book is readable").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                let text = fs::read_to_string(&path).expect("a page is text");
                let name = path.strip_prefix(root()).expect("below the root");
                found.insert(name.to_string_lossy().replace('\\', "/"), text);
            }
        }
    }
    for name in ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"] {
        let text = fs::read_to_string(root().join(name)).expect("a top-level page is text");
        found.insert(name.to_owned(), text);
    }
    found
}

/// A fenced block: the words behind its fence, its first line's number, and its lines.
struct Block<'a> {
    info: &'a str,
    line: usize,
    lines: Vec<&'a str>,
}

/// Splits a page into its fenced blocks and the lines outside of them.
fn blocks_and_prose(text: &str) -> (Vec<Block<'_>>, Vec<(usize, &str)>) {
    let (mut blocks, mut prose) = (Vec::new(), Vec::new());
    let mut open: Option<Block> = None;
    for (number, line) in text.lines().enumerate() {
        match (line.trim_start().strip_prefix("```"), &mut open) {
            (Some(info), None) => {
                open = Some(Block {
                    info: info.trim(),
                    line: number + 1,
                    lines: Vec::new(),
                });
            }
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (None, Some(block)) => block.lines.push(line),
            (None, None) => prose.push((number + 1, line)),
        }
    }
    (blocks, prose)
}

/// The anchor that mdBook gives a heading: lower case, blanks to hyphens, other signs dropped.
fn anchor(heading: &str) -> String {
    heading
        .trim()
        .chars()
        .filter_map(|c| match c {
            ' ' => Some('-'),
            c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c.to_ascii_lowercase()),
            _ => None,
        })
        .collect()
}

/// Anchors of a page: its headings and its `<a id="…">`.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for (_, line) in blocks_and_prose(text).1 {
        if line.starts_with('#') {
            found.insert(anchor(line.trim_start_matches('#')));
        }
        for id in line.split("id=\"").skip(1) {
            found.extend(id.split('"').next().map(str::to_owned));
        }
    }
    found
}

/// Targets of `](…)` outside code spans.
fn links(line: &str) -> Vec<&str> {
    line.split('`')
        .step_by(2)
        .flat_map(|outside| outside.split("](").skip(1))
        .filter_map(|rest| rest.split(')').next())
        .collect()
}

/// Files that a line includes (`{{#include …}}`) or shows (`src="…"`).
fn included(line: &str) -> Vec<&str> {
    let directives = line
        .split("{{#include ")
        .skip(1)
        .filter_map(|rest| rest.split("}}").next());
    let sources = line
        .split("src=\"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next());
    directives.chain(sources).collect()
}

/// `a/b/../c` → `a/c`.
fn tidy(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                out.pop();
            }
            Component::CurDir => {}
            part => out.push(part),
        }
    }
    out
}

#[test]
fn every_link_resolves() {
    let pages = pages();
    let mut broken = Vec::new();
    for (name, text) in &pages {
        for (number, line) in blocks_and_prose(text).1 {
            // A link whose text is code has its bracket outside the code span: `](` stays visible.
            for target in links(line).into_iter().chain(included(line)) {
                if target.starts_with("http://") || target.starts_with("https://") {
                    continue;
                }
                let (file, fragment) = target.split_once('#').unwrap_or((target, ""));
                let folder = Path::new(name).parent().unwrap_or(Path::new(""));
                let path = if file.is_empty() {
                    PathBuf::from(name)
                } else {
                    tidy(&folder.join(file))
                };
                let shown = path.to_string_lossy().replace('\\', "/");
                if !root().join(&path).exists() {
                    broken.push(format!("{name}:{number}: {target}: there is no {shown}"));
                } else if !fragment.is_empty()
                    && let Some(page) = pages.get(&shown)
                    && !anchors(page).contains(fragment)
                {
                    broken.push(format!("{name}:{number}: {target}: no such heading"));
                }
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// A picture takes the color of the page around it, so that it can be read on a dark one, has a title for those who do not see it, and
/// no blank line, which would end it in Markdown. Every picture is shown.
#[test]
fn every_picture_is_shown_and_fits_the_page() {
    let pages = pages();
    let folder = root().join("book/src/figures");
    let mut pictures = 0;
    for entry in fs::read_dir(folder).expect("the pictures") {
        let path = entry.expect("a picture").path();
        let name = path.file_name().expect("a file").to_string_lossy();
        let text = fs::read_to_string(&path).expect("a picture is text");
        let document = roxmltree::Document::parse(&text);
        let document = document.unwrap_or_else(|error| panic!("{name}: {error}"));
        let svg = document.root_element();
        assert_eq!(svg.attribute("stroke"), Some("currentColor"), "{name}");
        let has = |tag: &str| svg.children().any(|child| child.has_tag_name(tag));
        let named = svg
            .children()
            .any(|child| child.tag_name().name() == "title");
        assert!(
            named && !has("script"),
            "{name} has no title, or has a script"
        );
        assert!(!text.lines().any(str::is_empty), "{name} has a blank line");
        let target = format!("figures/{name}");
        let shown = |page: &String| {
            let lines = blocks_and_prose(page).1;
            lines
                .iter()
                .any(|(_, line)| included(line).contains(&&*target))
        };
        assert!(pages.values().any(shown), "no page shows {name}");
        pictures += 1;
    }
    assert!(pictures >= 6, "only {pictures} pictures");
}

#[test]
fn every_page_with_rust_is_a_doctest() {
    let included = fs::read_to_string(root().join("book/doctests.rs")).expect("it is text");
    for (name, text) in pages() {
        let blocks = blocks_and_prose(&text).0;
        if blocks.iter().any(|block| block.info.starts_with("rust")) {
            let path = name.trim_start_matches("book/");
            assert!(
                included.contains(&format!("include_str!(\"{path}\")")),
                "{name} has Rust blocks: include it in book/doctests.rs"
            );
        }
    }
}

#[test]
fn every_file_that_is_named_exists() {
    let mut missing = Vec::new();
    for (name, text) in pages() {
        for (number, line) in blocks_and_prose(&text).1 {
            for path in line.split('`').skip(1).step_by(2) {
                let of_ours = ["crates/", "book/", "tests/", "plugins/", ".ci/"];
                let exact = of_ours.iter().any(|folder| path.starts_with(folder))
                    && !path.contains(['<', '*', ' ', '…']);
                if exact && !root().join(path).exists() {
                    missing.push(format!("{name}:{number}: there is no {path}"));
                }
            }
        }
    }
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}

#[test]
fn the_summary_lists_every_page_once() {
    let pages = pages();
    let listed: Vec<String> = pages["book/src/SUMMARY.md"]
        .lines()
        .flat_map(links)
        .map(|target| format!("book/src/{target}"))
        .collect();
    for page in pages.keys().filter(|p| p.starts_with("book/src/")) {
        let times = listed.iter().filter(|l| *l == page).count();
        let expected = usize::from(page != "book/src/SUMMARY.md");
        assert_eq!(times, expected, "SUMMARY.md lists {page} {times} times");
    }
}

/// The program in a fresh folder that holds a copy of `robots/` and of the book's files for its pages.
struct Shelf {
    folder: tempfile::TempDir,
}

impl Shelf {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for part in [
            "robots",
            "book/src/tutorial",
            "book/src/run-time",
            "book/src/hand-eye",
        ] {
            copy(&root().join(part), &folder.path().join(part));
        }
        Shelf { folder }
    }

    /// Runs one line of a `console` block through the shell, `calib` being this build.
    fn run(&self, line: &str) -> (Option<i32>, String) {
        let program = Path::new(env!("CARGO_BIN_EXE_calib"));
        let folder = program.parent().expect("the program stands in a folder");
        let path = std::env::var_os("PATH").unwrap_or_default();
        let search = std::env::join_paths(
            std::iter::once(folder.to_path_buf()).chain(std::env::split_paths(&path)),
        )
        .expect("the search path can be extended");
        let output = Command::new("sh")
            .args(["-c", line])
            .current_dir(self.folder.path())
            .env("PATH", search)
            .output()
            .expect("a shell starts");
        let text =
            String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
        (output.status.code(), text.into_owned())
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a folder can be made");
    for entry in fs::read_dir(from).expect("robots/ is readable") {
        let path = entry.expect("an entry of robots/ is readable").path();
        let target = to.join(path.file_name().expect("an entry has a name"));
        if path.is_dir() {
            copy(&path, &target);
        } else {
            fs::copy(&path, &target).expect("a file can be copied");
        }
    }
}

fn has_python() -> bool {
    let asked = Command::new("python3").arg("--version").output();
    asked.is_ok_and(|output| output.status.success())
}

/// Every `$ calib …` of every `console` block runs, page by page in one folder, and ends with the code that the block
/// names (`console,exit=4`), 0 if none. Commands of cargo, git and rustup stand in the blocks for the reader and are not run, except
/// `cargo run --release --`, which is `calib`. Python is run where it is installed.
#[test]
fn every_command_of_the_book_runs() {
    let mut wrong = Vec::new();
    let mut ran = 0;
    for (name, text) in pages() {
        let shelf = Shelf::new();
        for block in blocks_and_prose(&text).0 {
            let Some(options) = block.info.strip_prefix("console") else {
                continue;
            };
            let expected = options
                .strip_prefix(",exit=")
                .map_or(0, |code| code.parse().expect("an exit code is a number"));
            for (offset, line) in block.lines.iter().enumerate() {
                let Some(command) = line.strip_prefix("$ ") else {
                    continue;
                };
                let command = command.replace("cargo run --release -- ", "calib ");
                if ["cargo ", "git ", "just ", "rustup "]
                    .iter()
                    .any(|c| command.starts_with(c))
                {
                    continue;
                }
                if command.starts_with("python3 ") && !has_python() {
                    skipped_tests::skip("commands of the book in Python: there is no python3");
                    continue;
                }
                ran += 1;
                let (code, output) = shelf.run(&command);
                if code != Some(expected) {
                    wrong.push(format!(
                        "{name}:{}: `{command}` ended with {code:?}, not {expected}:\n{output}",
                        block.line + offset + 1,
                    ));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(ran > 0, "the book has no commands");
}

#[test]
fn the_command_line_page_has_every_command() {
    let help = Command::new(env!("CARGO_BIN_EXE_calib"))
        .arg("--help")
        .output()
        .expect("calib starts");
    let help = String::from_utf8_lossy(&help.stdout).into_owned();
    let commands: BTreeSet<&str> = help
        .lines()
        .skip_while(|line| !line.starts_with("Commands:"))
        .skip(1)
        .take_while(|line| !line.is_empty())
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|command| *command != "help")
        .collect();
    let pages = pages();
    let page = blocks_and_prose(&pages["book/src/command-line.md"]).0;
    let listed: BTreeSet<&str> = page
        .iter()
        .flat_map(|block| &block.lines)
        .filter_map(|line| line.strip_prefix("calib ")?.split_whitespace().next())
        .collect();
    assert!(commands.len() > 3, "{help}");
    assert_eq!(
        listed, commands,
        "book/src/command-line.md against `calib --help`"
    );
}

/// One line of a description; a table's cell cannot hold more.
fn one_line(text: &str) -> String {
    text.split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
        .replace('|', "\\|")
}

/// A type of the schema in words, with links to the tables below.
fn type_words(schema: &Value) -> String {
    if let Some(reference) = schema["$ref"].as_str() {
        let name = reference.rsplit('/').next().unwrap_or_default();
        return format!("[{}](#{})", title(name), anchor(&title(name)));
    }
    if let Some(choices) = schema["anyOf"].as_array() {
        return choices
            .iter()
            .filter(|choice| choice["type"] != "null")
            .map(type_words)
            .collect::<Vec<_>>()
            .join(" or ");
    }
    let kind = match &schema["type"] {
        Value::Array(kinds) => kinds
            .iter()
            .filter_map(Value::as_str)
            .find(|kind| *kind != "null"),
        kind => kind.as_str(),
    };
    match kind {
        Some("array") => match schema["minItems"].as_u64() {
            Some(n) => format!("list of {n}: {}", type_words(&schema["items"])),
            None => format!("list of {}", type_words(&schema["items"])),
        },
        Some("object") if schema["additionalProperties"].is_object() => {
            format!("by name: {}", type_words(&schema["additionalProperties"]))
        }
        Some("string") => "text".to_owned(),
        Some(other) => other.to_owned(),
        None => "anything".to_owned(),
    }
}

/// `RawJointSolve` → `joint solve`.
fn title(name: &str) -> String {
    let mut words = String::new();
    for c in name.trim_start_matches("Raw").chars() {
        if c.is_ascii_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.push(c.to_ascii_lowercase());
    }
    words
}

fn default_words(key: &str, schema: &Value, of: &Value) -> String {
    let required = of["required"]
        .as_array()
        .is_some_and(|keys| keys.iter().any(|k| k == key));
    match &schema["default"] {
        _ if required => "**required**".to_owned(),
        Value::Null => "none".to_owned(),
        // A whole table of defaults stands at that table.
        Value::Object(o) if !o.is_empty() => "see there".to_owned(),
        Value::Object(_) => "empty".to_owned(),
        Value::Array(a) if a.is_empty() => "empty".to_owned(),
        value => format!("`{value}`"),
    }
}

/// One table of keys, or one list of words.
fn table(page: &mut String, schema: &Value) {
    use std::fmt::Write as _;
    if let Some(words) = schema["oneOf"].as_array().or(schema["anyOf"].as_array()) {
        page.push_str("| one of | meaning |\n|---|---|\n");
        for word in words {
            let meaning = one_line(word["description"].as_str().unwrap_or_default());
            let shown = match (&word["const"], word["properties"].as_object()) {
                (Value::String(text), _) => format!("`{text}`"),
                (_, Some(keys)) => keys
                    .iter()
                    .map(|(key, of)| format!("`{key}:` {}", type_words(of)))
                    .collect::<Vec<_>>()
                    .join(", "),
                _ => type_words(word),
            };
            let _ = writeln!(page, "| {shown} | {meaning} |");
        }
        return;
    }
    page.push_str("| key | value | default | meaning |\n|---|---|---|---|\n");
    for (key, of) in schema["properties"].as_object().into_iter().flatten() {
        let _ = writeln!(
            page,
            "| `{key}` | {} | {} | {} |",
            type_words(of),
            default_words(key, of, schema),
            one_line(of["description"].as_str().unwrap_or_default()),
        );
    }
}

fn profile_reference(schema: &Value) -> String {
    let mut page = String::from(
        "# Profile reference\n\n\
         This page is made from `robots/profile.schema.json`, which is what `calib schema` prints; `UPDATE_BOOK=1 cargo test \
         -p calib-cli --test suite book::` regenerates it. Unknown keys are errors. Units stand in the key's name; paths are relative to the \
         profile. *none* means that the program estimates it, chooses it, or leaves it out, as the meaning says.\n\n\
         ## profile\n\n",
    );
    table(&mut page, schema);
    for (name, of) in schema["$defs"].as_object().into_iter().flatten() {
        page.push_str(&format!(
            "\n## {}\n\n{}\n\n",
            title(name),
            of["description"]
                .as_str()
                .map(one_line)
                .unwrap_or_default()
                .replace("\\|", "|")
        ));
        table(&mut page, of);
    }
    page
}

#[test]
fn the_profile_reference_is_the_schema() {
    let schema =
        fs::read_to_string(root().join("robots/profile.schema.json")).expect("the schema is text");
    let schema: Value = serde_json::from_str(&schema).expect("the schema is JSON");
    let page = profile_reference(&schema);
    let file = root().join("book/src/reference/profile.md");
    if std::env::var_os("UPDATE_BOOK").is_some() {
        fs::write(&file, &page).expect("the page can be written");
    }
    let written = fs::read_to_string(&file).unwrap_or_default();
    assert!(
        written == page,
        "book/src/reference/profile.md is old: UPDATE_BOOK=1 cargo test -p calib-cli --test suite book::"
    );
    for (number, line) in page.lines().enumerate().filter(|(_, l)| l.starts_with('|')) {
        assert!(
            !line.ends_with("|  |"),
            "line {}: {line}: no meaning",
            number + 1
        );
    }
}

/// The block of a summary that begins with this word, up to the next empty line.
fn section(summary: &str, word: &str) -> String {
    summary
        .lines()
        .skip_while(|line| !line.starts_with(word))
        .take_while(|line| !line.is_empty())
        .map(|line| format!("{}\n", line.trim_end()))
        .collect()
}

/// What the shipped robots reach: both methods on both recordings.
fn results_page() -> String {
    let mut page = String::from(
        "# Results of the shipped robots\n\n\
         Printed by the commands shown, on the simulated recordings in `robots/`; a test compares this page with the program, and \
         `UPDATE_BOOK=1 cargo test -p calib-cli --test suite book::` regenerates it. Errors are positions of tracked bodies or markers on poses \
         that were not fitted. These are excerpts; the commands print more. `method: paper` estimates only the origins that the \
         profile lists, by closed forms; joint zeros and compliances stay nominal. For Justin it ends worse than the nominal robot, and is rejected.\n",
    );
    let shelf = Shelf::new();
    for robot in ["ripley", "justin"] {
        page.push_str(&format!("\n## {robot}\n"));
        for method in ["ml", "paper"] {
            let command = format!(
                "calib run robots/{robot}.yaml --method {method} --out {robot}-{method} --full"
            );
            let (code, output) = shelf.run(&command);
            let code = code.map_or("a signal".to_owned(), |code| code.to_string());
            page.push_str(&format!(
                "\n```text\n$ {command}\n{}```\n\nExit code {code}.\n",
                section(&output, "Held-out error"),
            ));
        }
    }
    page
}

#[test]
fn the_results_page_is_what_the_program_prints() {
    let page = results_page();
    let file = root().join("book/src/reference/results.md");
    if std::env::var_os("UPDATE_BOOK").is_some() {
        fs::write(&file, &page).expect("the page can be written");
    }
    let written = fs::read_to_string(&file).unwrap_or_default();
    assert!(
        written == page,
        "book/src/reference/results.md is old: UPDATE_BOOK=1 cargo test -p calib-cli --test suite book::\n{page}"
    );
    assert_eq!(page.matches("calibrated").count(), 4, "{page}");
}

/// Text of all sources below `crates/<folder>`.
fn sources(folder: &str) -> String {
    let mut text = String::new();
    let mut folders = vec![root().join("crates").join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a source folder is readable") {
            let path = entry.expect("a source is readable").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                text += &fs::read_to_string(&path).expect("a source is text");
            }
        }
    }
    text
}

#[test]
fn every_finding_has_its_section() {
    let page = &pages()["book/src/findings.md"];
    let headings: BTreeSet<String> = page
        .lines()
        .filter_map(|line| line.strip_prefix("## "))
        .map(|heading| heading.trim_matches('`').to_owned())
        .collect();
    let ids: BTreeSet<String> = Id::all().iter().map(ToString::to_string).collect();
    assert_eq!(
        ids, headings,
        "the catalog of calib-finding against book/src/findings.md"
    );
    for id in Id::all() {
        let fragment = id.page().replace("findings.md#", "");
        assert!(anchors(page).contains(&fragment), "{}", id.page());
    }
    for section in page.split("\n## ").skip(1) {
        for part in [
            "**What it means.**",
            "**Why it matters.**",
            "**What to do.**",
        ] {
            let id = section.lines().next().unwrap_or_default();
            assert!(section.contains(part), "{id} lacks {part}");
        }
    }
}

/// An entry of the catalog that no code makes a finding of is a promise that nobody keeps.
#[test]
fn every_finding_of_the_catalog_is_made_somewhere() {
    let made: String = [
        "calib-recording/src",
        "calib-checks/src",
        "calib-pipeline/src",
    ]
    .map(sources)
    .concat();
    for id in Id::all() {
        let name = format!("catalog::{}", id.as_str().to_uppercase().replace('-', "_"));
        let used = made.split(&name).skip(1);
        let whole = |rest: &str| !rest.starts_with(|c: char| c.is_ascii_uppercase() || c == '_');
        assert!(used.into_iter().any(whole), "no code makes `{id}`");
        for kind in id.kinds().into_iter().filter(|kind| !kind.is_empty()) {
            assert!(
                made.contains(&format!("\"{kind}\"")),
                "no code makes `{id}` of kind `{kind}`"
            );
        }
    }
}

#[test]
fn every_reader_is_on_the_page_of_formats() {
    let page = &pages()["book/src/file-formats.md"];
    let source = sources("calib-recording/src/readers");
    let ids: BTreeSet<&str> = source
        .split("id: \"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
        .collect();
    assert!(ids.len() > 8, "only {ids:?}");
    let missing: Vec<_> = ids
        .iter()
        .filter(|id| !page.contains(&format!("`{id}`")))
        .collect();
    assert!(
        missing.is_empty(),
        "book/src/file-formats.md lacks {missing:?}"
    );
}

#[test]
fn the_checks_see_what_they_are_for() {
    let text = "# One `two`, Three\n[a](b.md#c) `[no](x)`\n```console,exit=4\n$ calib x\n```\n";
    assert!(anchors(text).contains("one-two-three"));
    let (blocks, prose) = blocks_and_prose(text);
    assert_eq!((blocks[0].info, blocks[0].line), ("console,exit=4", 3));
    assert_eq!(blocks[0].lines, ["$ calib x"]);
    assert_eq!(links(prose[1].1), ["b.md#c"]);
    assert_eq!(
        included("{{#include a.svg}} <img src=\"b.png\">"),
        ["a.svg", "b.png"]
    );
    assert_eq!(tidy(Path::new("a/b/../c.md")), Path::new("a/c.md"));
    assert_eq!(title("RawJointSolve"), "joint solve");
}
