//! Layers point down: a crate may depend on crates of a lower layer only, and never on a sibling.
//!
//! The manifests are read as text, so that dev-dependencies, build-dependencies and target tables count as well.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The layer of every crate. `calib-sim` stands above `calib-profile` because it reads the checked profile
/// (book/src/decisions/simulation-layer.md).
const LAYERS: &[(&str, u8)] = &[
    ("calib-finding", 0),
    ("calib-files", 0),
    ("calib-geometry", 0),
    ("calib-urdf", 1),
    ("calib-estimator", 1),
    ("calib-recording", 1),
    ("calib-cor", 2),
    ("calib-aor", 2),
    ("calib-handeye", 2),
    ("calib-checks", 2),
    ("calib-core", 2),
    ("calib-capture", 3),
    ("calib-plugin", 3),
    ("calib-profile", 3),
    ("calib-report", 3),
    ("calib-sim", 4),
    ("calib-pipeline", 5),
    ("calib-apply", 5),
    ("calib-drift", 5),
    ("calib-fit", 5),
    ("calib-study", 6),
    ("calib-cli", 7),
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
        ["calib-core (layer 2) depends on calib-cli (layer 7)"]
    );
    let table = "[build-dependencies.calib-pipeline]\nworkspace = true\n";
    assert_eq!(
        faults("calib-report", 3, table),
        ["calib-report (layer 3) depends on calib-pipeline (layer 5)"]
    );
    let down = "[package]\nname = \"calib-core\"\n[dependencies]\ncalib-geometry.workspace = true # calib-cli\n";
    assert_eq!(faults("calib-core", 2, down), Vec::<String>::new());
}
