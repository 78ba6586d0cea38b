//! `calib study` as a user runs it: small studies, and the book's pages against them.

use crate::scratch;

use scratch::{Scratch, root};

/// Headings, table heads and numbers of rows: what a page has whatever the number of trials. Refused grids are listed only where there are
/// any.
fn shape(page: &str) -> Vec<String> {
    let mut out = Vec::new();
    let mut rows = 0;
    let mut lines = page.lines().peekable();
    while let Some(line) = lines.next() {
        if line.contains("# Grids called not observable") {
            break;
        }
        if line.starts_with('|') {
            if lines.peek().is_some_and(|next| next.starts_with("|---")) {
                out.push(line.to_owned());
                rows = 0;
            } else {
                rows += 1;
            }
        } else if rows > 0 {
            // The rule below a table's head is no row.
            out.push(format!("{} rows", rows - 1));
            rows = 0;
        }
        if let Some(heading) = line.strip_prefix('#') {
            // Numbers of robots and seeds differ.
            out.push(heading.split(':').next().unwrap_or(heading).to_owned());
        }
    }
    out
}

/// What the lines of a long table are about: all columns but the value.
fn subjects(table: &str) -> Vec<Vec<String>> {
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    reader
        .records()
        .map(|record| {
            let record = record.expect("rows of one length");
            let columns = record.len() - 1;
            record.iter().take(columns).map(str::to_owned).collect()
        })
        .collect()
}

/// The book's pages are outputs of the studies as they are now: the same parts, methods and scenes, on the page and in the long tables.
#[test]
fn the_books_pages_have_the_shape_of_the_studies() {
    if !skipped_tests::thorough() {
        return;
    }
    for study in ["cor", "aor", "justin", "ripley"] {
        let dir = Scratch::new().robot("justin").robot("ripley");
        let printed = dir
            .calib([
                "study",
                study,
                "--trials",
                "1",
                "--recorded",
                "1",
                "--out",
                "out",
            ])
            .expect(0)
            .stdout;
        let book = |name: &str| {
            let path = root().join(format!("book/src/studies/{name}"));
            std::fs::read_to_string(path).expect("the page or the table of a study")
        };
        if ["cor", "aor"].contains(&study) {
            let name = format!("{study}-tables.csv");
            let found = subjects(&book(&name));
            assert!(found.len() > 500, "{name}");
            assert!(
                found == subjects(&dir.read(&format!("out/{name}"))),
                "book/src/studies/{name} is old: `just studies` regenerates it"
            );
        }
        let page = book(&format!("{study}.md"));
        assert_eq!(
            shape(&page),
            shape(&printed),
            "book/src/studies/{study}.md is old: `just studies` regenerates it"
        );
    }
}

/// Threads and interruptions change nothing, and the likelihood is nearer to the truth than the two steps.
#[test]
fn a_case_study_continues_where_it_stopped() {
    if !skipped_tests::thorough() {
        return;
    }
    let dir = Scratch::new().robot("ripley");
    let run = |more: &[&str]| {
        let mut words = vec!["study", "ripley", "--json"];
        words.extend_from_slice(more);
        dir.calib_with(&words).expect(0).json()
    };
    let once = ["--recorded", "1"];
    let whole = run(&[&["--trials", "3", "--threads", "2"], &once[..]].concat());
    run(&[&["--trials", "1", "--out", "kept"], &once[..]].concat());
    let more = ["--trials", "3", "--out", "kept", "--threads", "1"];
    let continued = run(&[&more, &once[..]].concat());
    assert_eq!(whole, continued);
    for file in [
        "ripley.csv",
        "ripley.json",
        "ripley.md",
        "ripley.svg",
        "ripley.state.jsonl",
    ] {
        assert!(dir.path("kept").join(file).exists(), "{file}");
    }
    let mean = |method: &str| {
        let off: Vec<f64> = whole["results"]
            .as_array()
            .expect("results")
            .iter()
            .filter(|r| r["method"] == method)
            .map(|r| {
                assert!(r["failure"].is_null(), "{}", r["failure"]);
                r["off"]["gripM_from_endJ"]["translation_m"]
                    .as_f64()
                    .expect("an error")
            })
            .collect();
        assert_eq!(off.len(), 3);
        off.iter().sum::<f64>() / 3.0
    };
    assert!(
        mean("ml") < 0.5 * mean("paper"),
        "{} {}",
        mean("ml"),
        mean("paper")
    );
}

/// Two recordings of one robot give results that differ by their noise, about as far as one is from the truth or less.
#[test]
fn the_same_robot_is_recorded_again() {
    let dir = Scratch::new().robot("ripley");
    let out = dir
        .calib(["study", "ripley", "--trials", "1", "--json"])
        .expect(0)
        .json();
    for result in out["results"].as_array().expect("results") {
        let scatter = &result["scatter"]["gripM_from_endJ"]["translation_m"];
        let scatter = scatter.as_f64().expect("a size");
        // In fifty robots 0.02 to 0.5 mm.
        assert!(scatter > 1e-5 && scatter < 1e-3, "{scatter}");
    }
}

#[test]
fn a_state_of_another_robot_is_not_continued() {
    let dir = Scratch::new()
        .robot("ripley")
        .file("kept/ripley.state.jsonl", "{\"calib_case_study\":0}\n");
    let ran = dir.calib(["study", "ripley", "--trials", "1", "--out", "kept"]);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("--restart"), "{}", ran.stderr);
}
