//! Layers point down: a crate may depend on crates of a lower layer only, and never on a sibling.
//!
//! The manifests are read as text, so that dev-dependencies, build-dependencies and target tables count as well.
//! Inside the pipeline a stage uses earlier stages only, and in no crate do files import each other in a circle.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The layer of every crate. `calib-sim` stands above `calib-profile` because it reads the checked profile
/// (book/src/decisions/simulation-layer.md).
const LAYERS: &[(&str, u8)] = &[
    ("calib-finding", 0),
    ("calib-files", 0),
    ("calib-geometry", 0),
    ("calib-model", 1),
    ("calib-urdf", 1),
    ("calib-estimator", 1),
    ("calib-recording", 1),
    ("calib-cor", 2),
    ("calib-aor", 2),
    ("calib-handeye", 2),
    ("calib-checks", 2),
    ("calib-core", 2),
    ("calib-export", 2),
    ("calib-capture", 3),
    ("calib-plugin", 3),
    ("calib-profile", 3),
    ("calib-report", 3),
    ("calib-sim", 4),
    ("calib-pipeline", 5),
    ("calib-apply", 5),
    ("calib-drift", 5),
    ("calib-fit", 5),
    ("calib-fleet", 6),
    ("calib-init", 6),
    ("calib-plan", 6),
    ("calib-study", 6),
    ("calib-twin", 7),
    ("calib-cli", 8),
    ("calib-python", 9),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn layer_of(name: &str) -> Option<u8> {
    LAYERS
        .iter()
        .find(|(known, _)| *known == name)
        .map(|(_, l)| *l)
}

/// Names of the crates of this workspace that a manifest depends on, in any kind of dependency table.
fn workspace_dependencies(manifest: &str) -> Vec<String> {
    let mut names = Vec::new();
    let mut in_dependencies = false;
    for line in manifest.lines().map(|line| {
        // A `#` inside a quoted value does not occur in dependency tables of this workspace.
        line.split('#').next().unwrap_or_default().trim()
    }) {
        if let Some(table) = line.strip_prefix('[') {
            let table = table.trim_matches(['[', ']', ' ']);
            in_dependencies = table.split('.').any(|part| part.ends_with("dependencies"));
            // [dependencies.calib-core]
            if let (true, Some(last)) = (in_dependencies, table.rsplit('.').next()) {
                names.extend(layer_of(last).map(|_| last.to_owned()));
            }
            continue;
        }
        if !in_dependencies {
            continue;
        }
        // `calib-core.workspace = true`, `core = { package = "calib-core", … }`, `x = { path = "../calib-core" }`
        for word in line.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-' || c == '_')) {
            if word.starts_with("calib-") {
                names.push(word.to_owned());
            }
        }
    }
    names.sort();
    names.dedup();
    names
}

/// Everything that is wrong with one crate's dependencies.
fn faults(name: &str, layer: u8, manifest: &str) -> Vec<String> {
    workspace_dependencies(manifest)
        .into_iter()
        .filter(|dependency| dependency != name)
        .filter_map(|dependency| match layer_of(&dependency) {
            None => Some(format!(
                "{name} depends on {dependency}, which has no layer"
            )),
            Some(below) if below < layer => None,
            Some(other) if other == layer => Some(format!(
                "{name} depends on its sibling {dependency} (both layer {layer})"
            )),
            Some(above) => Some(format!(
                "{name} (layer {layer}) depends on {dependency} (layer {above})"
            )),
        })
        .collect()
}

/// Manifests of the folders right below `folder`, by crate folder name.
fn manifests(folder: &Path) -> BTreeMap<String, String> {
    let Ok(entries) = fs::read_dir(folder) else {
        return BTreeMap::new();
    };
    entries
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            let text = fs::read_to_string(path.join("Cargo.toml")).ok()?;
            Some((path.file_name()?.to_string_lossy().into_owned(), text))
        })
        .collect()
}

#[test]
fn layers_point_down() {
    let crates = manifests(&root().join("crates"));
    let mut wrong = Vec::new();
    for (folder, manifest) in &crates {
        match layer_of(folder) {
            None => wrong.push(format!(
                "crates/{folder} has no layer: add it to LAYERS in tests/layering.rs"
            )),
            Some(layer) => wrong.extend(faults(folder, layer, manifest)),
        }
        if !manifest.contains(&format!("name = \"{folder}\"")) {
            wrong.push(format!("crates/{folder}: folder and crate name differ"));
        }
        if !manifest.contains("[lints]\nworkspace = true") {
            wrong.push(format!(
                "crates/{folder} does not take the workspace's lints"
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// What a plugin may know: the contract, and the numerical ground below it, whose types do not cross the border.
const FOR_PLUGINS: &[&str] = &["calib-plugin", "calib-geometry"];

#[test]
fn plugins_know_the_contract_and_no_estimator() {
    let mut wrong = Vec::new();
    for (folder, manifest) in manifests(&root().join("plugins")) {
        for dependency in workspace_dependencies(&manifest) {
            let itself = manifest.contains(&format!("name = \"{dependency}\""));
            if !FOR_PLUGINS.contains(&dependency.as_str()) && !itself {
                wrong.push(format!("plugins/{folder} depends on {dependency}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_rule_finds_what_it_is_for() {
    let sibling = "[dependencies]\ncalib-aor.workspace = true\n";
    assert_eq!(
        faults("calib-cor", 2, sibling),
        ["calib-cor depends on its sibling calib-aor (both layer 2)"]
    );
    let upward = "[target.'cfg(unix)'.dev-dependencies]\nx = { package = \"calib-cli\", path = \"../calib-cli\" }\n";
    assert_eq!(
        faults("calib-core", 2, upward),
        ["calib-core (layer 2) depends on calib-cli (layer 8)"]
    );
    let table = "[build-dependencies.calib-pipeline]\nworkspace = true\n";
    assert_eq!(
        faults("calib-report", 3, table),
        ["calib-report (layer 3) depends on calib-pipeline (layer 5)"]
    );
    let down = "[package]\nname = \"calib-core\"\n[dependencies]\ncalib-geometry.workspace = true # calib-cli\n";
    assert_eq!(faults("calib-core", 2, down), Vec::<String>::new());
}

/// The stages of the pipeline, in order: a stage may use those before it and itself.
const STAGES: &[&str] = &["prepare", "estimate", "formulate", "verify", "output"];

/// Code without comments, so that a link in a doc comment is not an import.
fn code(text: &str) -> String {
    let lines = text.lines().filter(|l| !l.trim_start().starts_with("//"));
    lines.collect::<Vec<_>>().join("\n")
}

/// Every path that starts with `root` in code, with braces expanded: `crate::a::{b, c::d}` gives two.
fn paths(code: &str, root: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let free = |c: Option<char>| !c.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':');
    for (at, _) in code.match_indices(&format!("{root}::")) {
        if free(code[..at].chars().next_back()) {
            expand(&code[at + root.len() + 2..], &[], &mut found);
        }
    }
    found
}

/// Reads one path after its root; returns how many bytes it took.
fn expand(text: &str, before: &[String], found: &mut Vec<Vec<String>>) -> usize {
    let mut path = before.to_vec();
    let mut at = 0;
    loop {
        let rest = &text[at..];
        at += rest.len() - rest.trim_start().len();
        let rest = &text[at..];
        if let Some(inner) = rest.strip_prefix('{') {
            let mut read = 1;
            loop {
                let tail = &inner[read - 1..];
                let skipped = tail.len() - tail.trim_start_matches([' ', '\n', ',']).len();
                read += skipped;
                let tail = &inner[read - 1..];
                if tail.is_empty() || tail.starts_with('}') {
                    return at + read + 1;
                }
                // A word at least, or the text is no path: give up rather than loop.
                match expand(tail, &path, found) {
                    0 => return at + read,
                    n => read += n,
                }
            }
        }
        let word: String = rest
            .chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect();
        at += word.len();
        if !word.is_empty() {
            path.push(word);
        }
        match text[at..].strip_prefix("::") {
            Some(_) => at += 2,
            None => {
                if path.len() > before.len() {
                    found.push(path);
                }
                return at;
            }
        }
    }
}

/// Imports of a file of the pipeline that go against the order of its stages.
fn stage_faults(file: &str, text: &str) -> Vec<String> {
    let place = |name: &str| STAGES.iter().position(|s| *s == name);
    let Some(own) = file.split('/').next().and_then(place) else {
        return Vec::new();
    };
    let mut wrong: Vec<String> = paths(&code(text), "crate")
        .into_iter()
        .filter(|path| path[0] == "run" || place(&path[0]).is_some_and(|other| other > own))
        .map(|path| format!("{file} uses crate::{}", path.join("::")))
        .collect();
    wrong.dedup();
    wrong
}

/// The sources below a folder as (path from there, text), sorted.
fn sources(folder: &Path) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(&next).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let name = path.strip_prefix(folder).expect("below the folder");
                let name = name.to_string_lossy().replace('\\', "/");
                found.push((name, fs::read_to_string(&path).expect("a source is text")));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn stages_of_the_pipeline_use_earlier_stages_only() {
    let files = sources(&root().join("crates/calib-pipeline/src"));
    let wrong: Vec<String> = files
        .iter()
        .flat_map(|(file, text)| stage_faults(file, text))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Crates whose files still import each other in circles: the list may only become shorter.
const CIRCLES_LEFT: &[&str] = &[];

/// `a/b/mod.rs`, `a/b.rs` → [a, b]; `lib.rs` → [].
fn module(file: &str) -> Vec<String> {
    let stem = file.trim_end_matches(".rs");
    let mut path: Vec<String> = stem.split('/').map(str::to_owned).collect();
    if path
        .last()
        .is_some_and(|l| l == "mod" || (path.len() == 1 && (l == "lib" || l == "main")))
    {
        path.pop();
    }
    path
}

/// Files of a crate that import each other in a circle; a module and its parents may.
fn circles(files: &[(String, String)]) -> Vec<String> {
    let modules: BTreeMap<Vec<String>, usize> = files
        .iter()
        .enumerate()
        .map(|(i, (file, _))| (module(file), i))
        .collect();
    let names: Vec<Vec<String>> = files.iter().map(|(file, _)| module(file)).collect();
    // The file of the longest beginning of a path that is a module.
    let resolve = |path: &[String]| {
        let mut ends = (1..=path.len()).rev();
        ends.find_map(|n| modules.get(&path[..n]).copied())
    };
    let mut uses: Vec<Vec<usize>> = Vec::new();
    for (i, (_, text)) in files.iter().enumerate() {
        let code = code(text);
        let mut to: Vec<usize> = paths(&code, "crate")
            .iter()
            .filter_map(|p| resolve(p))
            .collect();
        let parent = &names[i][..names[i].len().saturating_sub(1)];
        for path in paths(&code, "super") {
            to.extend(resolve(&[parent, &path].concat()));
        }
        to.retain(|&j| !names[j].starts_with(&names[i]) && !names[i].starts_with(&names[j]));
        uses.push(to);
    }
    let reaches = |from: usize, to: usize| {
        let (mut seen, mut next) = (vec![false; uses.len()], vec![from]);
        while let Some(i) = next.pop() {
            for &j in &uses[i] {
                if j == to {
                    return true;
                }
                if !std::mem::replace(&mut seen[j], true) {
                    next.push(j);
                }
            }
        }
        false
    };
    (0..files.len())
        .filter(|&i| reaches(i, i))
        .map(|i| files[i].0.clone())
        .collect()
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let mut wrong = Vec::new();
    for folder in manifests(&root().join("crates")).keys() {
        if CIRCLES_LEFT.contains(&folder.as_str()) {
            continue;
        }
        let files = sources(&root().join("crates").join(folder).join("src"));
        let found = circles(&files);
        if !found.is_empty() {
            wrong.push(format!("{folder}: {}", found.join(", ")));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_rules_inside_a_crate_find_what_they_are_for() {
    assert_eq!(
        stage_faults(
            "prepare/load.rs",
            "use crate::{error::E, verify::{known, closure::x}};\n"
        ),
        [
            "prepare/load.rs uses crate::verify::known",
            "prepare/load.rs uses crate::verify::closure::x"
        ]
    );
    assert_eq!(
        stage_faults("verify/known.rs", "fn f() { crate::run::run(); }\n"),
        ["verify/known.rs uses crate::run::run"]
    );
    let down =
        "//! [`crate::output`]\nuse crate::prepare::load::Inputs;\nuse crate::verify::known;\n";
    assert_eq!(
        stage_faults("verify/closure.rs", down),
        Vec::<String>::new()
    );

    let file = |name: &str, text: &str| (name.to_owned(), text.to_owned());
    let circle = [
        file("lib.rs", "mod a;\nmod b;\nmod c;\npub use a::A;\n"),
        file("a.rs", "use crate::b::{B, C};\n"),
        file("b.rs", "use super::c::D;\n"),
        file("c.rs", "pub fn f() -> crate::a::A {}\n"),
    ];
    assert_eq!(circles(&circle), ["a.rs", "b.rs", "c.rs"]);
    let family = [
        file("a/mod.rs", "mod b;\nuse crate::a::b::B;\n"),
        file("a/b.rs", "use super::A;\nuse crate::c::C;\n"),
        file("c.rs", "use std::fmt;\n"),
    ];
    assert_eq!(circles(&family), Vec::<String>::new());
}
