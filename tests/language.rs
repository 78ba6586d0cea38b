//! One term per notion, one spelling (US): what people read, and the code that they read it from.
//!
//! `INSTEAD` has the terms that are not used and the ones that are. A line of this list that stands anywhere else in the
//! repository fails the test, with its place.

use std::fs;
use std::path::{Path, PathBuf};

/// Not this, but that.
const INSTEAD: &[(&str, &str)] = &[
    ("a turn of", "a rotation of"),
    ("a turn or a shift", "a rotation or a translation"),
    ("a shift of", "a translation of"),
    ("play", "backlash"),
    ("thrown out", "rejected, excluded"),
    ("throws out", "rejects"),
    ("the description", "the nominal URDF"),
    ("robot description", "URDF"),
    ("described robot", "nominal model"),
    ("as described", "as in the nominal URDF"),
    ("as drawn", "at its zero configuration"),
    ("trade against", "be confounded with"),
    ("trades against", "is confounded with"),
    ("traded against", "confounded with"),
    ("told from", "distinguishable from"),
    ("told apart", "distinguished"),
    ("sharp", "precise"),
    ("sharper", "more precise"),
    ("sharply", "precisely"),
    ("sharpness", "precision"),
    ("ran away", "diverged"),
    ("runs away", "diverges"),
    ("run away", "diverge"),
    ("are no numbers", "are non-finite"),
    ("is no number", "must be a finite number"),
    ("no numbers", "non-finite values"),
    ("is no joint", "is not a joint"),
    ("slip of the pen", "typo"),
    ("take back", "revert"),
    ("takes back", "reverts"),
    ("taken back", "reverted"),
    ("taking back", "reverting"),
    ("take_back", "revert"),
    ("begin anew", "start over"),
    ("begins anew", "starts over"),
    ("made anew", "regenerated"),
    ("anew", "again, regenerated"),
    ("yardstick", "reference"),
    ("may i trust", "can I trust"),
    // Spelling.
    ("centre", "center"),
    ("centred", "centered"),
    ("centring", "centering"),
    ("metre", "meter"),
    ("metres", "meters"),
    ("millimetre", "millimeter"),
    ("millimetres", "millimeters"),
    ("colour", "color"),
    ("colours", "colors"),
    ("coloured", "colored"),
    ("neighbour", "neighbor, adjacent"),
    ("neighbours", "neighbors"),
    ("neighbouring", "adjacent"),
    ("neighbourhood", "neighborhood"),
    ("behaviour", "behavior"),
    ("favour", "favor"),
    ("honour", "honor"),
    ("honoured", "honored"),
    ("modelled", "modeled"),
    ("modelling", "modeling"),
    ("labelled", "labeled"),
    ("travelled", "traveled"),
    ("learnt", "learned"),
    ("whilst", "while"),
    ("judgement", "judgment"),
    ("grey", "gray"),
    ("artefact", "artifact"),
    ("analyse", "analyze"),
    ("analysed", "analyzed"),
    ("catalogue", "catalog"),
];

/// Stems whose endings -ise, -ised, -ises, -ising, -isation, -iser are spelled with z.
const WITH_Z: &[&str] = &[
    "minim",
    "maxim",
    "optim",
    "unoptim",
    "linear",
    "normal",
    "orthonormal",
    "initial",
    "serial",
    "recogn",
    "organ",
    "summar",
    "synchron",
    "factor",
    "regular",
    "general",
    "special",
    "parametr",
    "marginal",
    "orthogonal",
    "discret",
    "vector",
    "standard",
    "character",
    "random",
    "penal",
    "visual",
    "stabil",
    "final",
    "categor",
    "quant",
    "raster",
    "token",
    "util",
    "real",
    "local",
    "equal",
    "symmetr",
    "diagonal",
    "monomorph",
    "memo",
    "author",
    "custom",
    "priorit",
];

/// Words that files written elsewhere contain, a column that programs read, and what plugins say of their offers:
/// (part of the path, word).
const KEPT: &[(&str, &str)] = &[
    ("calib-recording/src/units.rs", "metre"),
    ("calib-recording/src/units.rs", "metres"),
    ("calib-recording/src/units.rs", "millimetre"),
    ("calib-recording/src/units.rs", "millimetres"),
    ("calib-report/src/csv.rs", "normalised"),
    ("crates/calib-plugin/", "the description"),
    ("plugins/column-reader-c/", "the description"),
    ("book/src/plugins/", "the description"),
    // The name of a parameter of ROS.
    ("examples/ros2/", "robot description"),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Sources, pages and profiles below the root as (path, text), sorted.
fn texts() -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut folders = vec![root()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder of the repository is readable") {
            let path = entry.expect("an entry is readable").path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if path.is_dir() {
                if !["target", ".git", "results", ".calib", "node_modules"].contains(&&*name)
                    && !path.ends_with("book/book")
                {
                    folders.push(path);
                }
                continue;
            }
            let read = [
                "rs", "md", "yaml", "yml", "toml", "h", "c", "py", "html", "css", "js", "sh",
                "snap",
            ];
            let extension = path
                .extension()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            if !(read.contains(&extension.as_str()) || *name == *"justfile") {
                continue;
            }
            let relative = path
                .strip_prefix(root())
                .expect("below the root")
                .to_string_lossy()
                .replace('\\', "/");
            // This list, and texts of others.
            if relative != "tests/language.rs" && !relative.starts_with("LICENSE") {
                found.extend(fs::read_to_string(&path).ok().map(|text| (relative, text)));
            }
        }
    }
    found.sort();
    found
}

/// The lower-case words of a line, `_` and camel case taken apart, with single spaces between and around them.
fn words(line: &str) -> String {
    let mut out = String::from(" ");
    let mut last = ' ';
    for c in line.chars() {
        if c.is_uppercase() && last.is_lowercase() {
            out.push(' ');
        }
        if c.is_alphanumeric() {
            out.extend(c.to_lowercase());
        } else if !out.ends_with(' ') {
            out.push(' ');
        }
        last = c;
    }
    if !out.ends_with(' ') {
        out.push(' ');
    }
    out
}

/// What stands in a line and should not: (what, what instead).
fn found_in(line: &str) -> Vec<(String, String)> {
    let words = words(line);
    let mut found: Vec<_> = INSTEAD
        .iter()
        .filter(|(not, _)| words.contains(&format!(" {} ", not.replace('_', " "))))
        .map(|(not, but)| ((*not).to_owned(), (*but).to_owned()))
        .collect();
    for word in words.split(' ') {
        for ending in [
            "ise", "ised", "ises", "ising", "isation", "isations", "iser", "isers", "isable",
        ] {
            if let Some(stem) = word.strip_suffix(ending)
                && WITH_Z.contains(&stem)
            {
                found.push((
                    word.to_owned(),
                    format!("{stem}{}", ending.replacen("is", "iz", 1)),
                ));
            }
        }
    }
    found
}

fn kept(path: &str, word: &str) -> bool {
    KEPT.iter()
        .any(|(part, kept)| path.contains(part) && *kept == word)
}

#[test]
fn one_term_per_notion_and_one_spelling() {
    let texts = texts();
    assert!(texts.len() > 300, "only {} files were found", texts.len());
    let mut wrong = Vec::new();
    for (path, text) in &texts {
        for (number, line) in text.lines().enumerate() {
            for (not, but) in found_in(line)
                .into_iter()
                .filter(|(not, _)| !kept(path, not))
            {
                wrong.push(format!("{path}:{}: `{not}`, use: {but}", number + 1));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "{} places:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
}

#[test]
fn each_term_is_found_where_it_stands() {
    for (not, but) in INSTEAD {
        let line = format!("// the fit: {not}, or so");
        assert!(
            found_in(&line).iter().any(|(n, _)| n == not),
            "{not} (use {but}) was not found"
        );
    }
    for line in [
        "fn linearise_all()",
        "let minimised = 1;",
        "struct LinearisedRows;",
        "/// Normalises it.",
    ] {
        assert_eq!(found_in(line).len(), 1, "{line}");
    }
    for line in [
        "fn display()",
        "a replay of it",
        "center, linearize, meter",
        "a sharpened",
        "raise the promise",
    ] {
        assert_eq!(found_in(line), [], "{line}");
    }
}
