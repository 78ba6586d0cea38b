//! What a person or a program reads, reviewed as snapshots: the summary, the reports, the checks, the help.
//!
//! Long tables are cut after three rows, numbers are rounded to what the next machine gives as well. A long text has
//! several snapshots, one for each part that a person reviews at once.

#[path = "../crates/calib-report/tests/suite/browser.rs"]
mod browser;
use crate::scratch;

use scratch::{Scratch, finished};
use serde_json::{Number, Value, json};

/// Rows of a table, or entries of a list, that a snapshot keeps.
const KEPT: usize = 3;

/// Lines of an entry from which on a snapshot keeps the first entry of a list only.
const LONG_ENTRY: usize = 20;

/// Significant digits of a number in running text.
const DIGITS: usize = 3;

/// Rounds every decimal number of a text to [`DIGITS`] significant digits, and everything below 1e-9 to zero.
pub fn rounded_text(text: &str) -> String {
    let mut out = String::new();
    let mut word = String::new();
    let is_number = |c: char| c.is_ascii_digit() || c == '.';
    let mut previous = ' ';
    for c in text.chars().chain(['\0']) {
        if is_number(c) && (!word.is_empty() || !(previous.is_alphanumeric() || previous == '_')) {
            word.push(c);
            continue;
        }
        if !word.is_empty() {
            let number = word.contains('.')
                && word.matches('.').count() == 1
                && !word.ends_with('.')
                && !c.is_alphabetic();
            match word.parse::<f64>() {
                Ok(value) if number => out += &shown(value),
                _ => out += &word,
            }
            word.clear();
        }
        if c != '\0' {
            out.push(c);
        }
        previous = c;
    }
    out
}

fn shown(value: f64) -> String {
    format!("{}", significant(value))
}

fn significant(value: f64) -> f64 {
    if value.abs() < 1e-9 {
        return 0.0;
    }
    format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value)
}

/// Tables of Markdown or aligned text: the first rows, and how many follow.
fn shortened(markdown: &str) -> String {
    let mut out = Vec::new();
    let mut row = 0;
    for line in markdown.lines() {
        row = if line.starts_with('|') { row + 1 } else { 0 };
        // A header and its rule come before the rows.
        match row {
            r if r <= KEPT + 2 => out.push(line.to_owned()),
            r if r == KEPT + 3 => out.push("| … |".to_owned()),
            _ => {}
        }
    }
    without_digests(&rounded_text(&out.join("\n")))
}

/// Digests follow the last bit of every number.
fn without_digests(text: &str) -> String {
    let is_digest = |w: &&str| w.len() == 64 && w.bytes().all(|b| b.is_ascii_hexdigit());
    let words = text.split([' ', '\n', '|']).filter(is_digest);
    words.fold(text.to_owned(), |text, digest| {
        text.replace(digest, "[sha256]")
    })
}

/// A report with lengths to 0.01 mm, angles to 1e-5 rad and other numbers to three digits; long lists cut.
fn rounded(key: &str, value: &Value) -> Value {
    match value {
        // A matrix as wide as the fit: that it is there, and for how many parameters.
        Value::Object(object) if key == "data_information" => {
            let parameters = object["parameters"].as_array().map_or(0, Vec::len);
            json!(format!("{parameters} parameters"))
        }
        Value::Object(object) => object
            .iter()
            .map(|(k, v)| (k.clone(), rounded(k, v)))
            .collect(),
        Value::Array(list) if key == "covariance" => json!(format!("{} rows", list.len())),
        Value::Array(list) => {
            let lengths = list.iter().all(Value::is_number) && list.len() <= 6;
            let first = list.first().map(|v| rounded(key, v));
            let kept = match first {
                _ if lengths => list.len(),
                Some(entry) if lines_of(&entry) >= LONG_ENTRY => 1,
                _ => KEPT.min(list.len()),
            };
            let mut out: Vec<Value> = list[..kept].iter().map(|v| rounded(key, v)).collect();
            if kept < list.len() {
                out.push(json!(format!("… {} more", list.len() - kept)));
            }
            Value::Array(out)
        }
        Value::Number(number) => match number.as_f64() {
            Some(_) if number.is_u64() || number.is_i64() => value.clone(),
            Some(x) => json!(rounded_number(key, x)),
            None => value.clone(),
        },
        Value::String(text) if key == "sha256" => {
            json!(format!("{} hexadecimal digits", text.len()))
        }
        Value::String(text) => json!(rounded_text(
            &text.lines().take(12).collect::<Vec<_>>().join("\n")
        )),
        _ => value.clone(),
    }
}

fn lines_of(value: &Value) -> usize {
    serde_json::to_string_pretty(value).map_or(0, |text| text.lines().count())
}

/// The keys of an object by the snapshots that show them; what no part names is in the last one.
fn in_parts<'a>(
    value: &Value,
    parts: &[(&'a str, &[&str])],
    rest: &'a str,
) -> Vec<(&'a str, Value)> {
    let object = value.as_object().expect("a report is an object");
    let part_of = |key: &str| {
        let named = parts.iter().find(|(_, keys)| keys.contains(&key));
        named.map_or(rest, |(name, _)| *name)
    };
    let names = parts.iter().map(|(name, _)| *name).chain([rest]);
    names
        .map(|name| {
            let of_part = object.iter().filter(|(key, _)| part_of(key) == name);
            let kept = of_part.map(|(key, v)| (key.clone(), rounded(key, v)));
            (name, Value::Object(kept.collect()))
        })
        .collect()
}

fn rounded_number(key: &str, x: f64) -> Option<Number> {
    let steps = match key {
        "direction" => 1e3,
        _ if ["_m", "_rad", "_xyzw"]
            .iter()
            .any(|unit| key.ends_with(unit)) =>
        {
            1e5
        }
        _ => 0.0,
    };
    let y = if steps > 0.0 {
        (x * steps).round() / steps
    } else {
        significant(x)
    };
    // Adding zero turns −0 into 0.
    Number::from_f64(y + 0.0)
}

#[test]
fn summaries() {
    for robot in ["ripley", "justin"] {
        for method in ["ml", "paper"] {
            let run = finished(robot, method);
            insta::assert_snapshot!(
                format!("summary_{robot}_{method}"),
                rounded_text(&run.ran.stdout)
            );
            assert_eq!(run.ran.stderr, "", "nothing but results without a terminal");
            for line in run.ran.stdout.lines() {
                assert!(line.chars().count() <= 80, "{robot} {method}: {line}");
            }
        }
    }
}

#[test]
fn reports() {
    for robot in ["ripley", "justin"] {
        let run = finished(robot, "ml");
        let page = run.dir.read("out/report.md");
        let (verdict, rest) = page.split_once("\n## What changed").expect("changes");
        let (changes, data) = rest.split_once("\n## Transforms").expect("transforms");
        let (data, values) = data
            .split_once("\n## Changed values")
            .expect("values of the URDF");
        for (part, text) in [
            ("1_verdict", verdict.to_owned()),
            ("2_changes", format!("## What changed{changes}")),
            ("3_data", format!("## Transforms{data}")),
            ("4_values", format!("## Changed values{values}")),
        ] {
            insta::assert_snapshot!(format!("report_md_{robot}_{part}"), shortened(&text));
        }
        for (part, value) in in_parts(&run.report, REPORT_PARTS, "verdict") {
            insta::assert_json_snapshot!(format!("report_json_{robot}_{part}"), value);
        }
    }
}

/// The keys of `report.json` by snapshot; the others stand with the verdict.
const REPORT_PARTS: &[(&str, &[&str])] = &[
    (
        "estimates",
        &["transforms", "parameters", "changes", "robot_changes"],
    ),
    (
        "unobservable",
        &["not_observable", "workspace", "accuracy_limits"],
    ),
    ("checks", &["loops", "estimators", "noise", "clocks"]),
    ("effects", &["tested_effects", "prior_widths"]),
    ("kinematics", &["dh_table"]),
    ("components", &["components"]),
    ("verification", &["verification"]),
    ("residuals", &["residuals"]),
    (
        "data",
        &["recordings", "coverage", "rejected", "inputs", "outputs"],
    ),
];

/// The longest snapshot that a person reads in full when it changes.
const MAX_SNAPSHOT_LINES: usize = 200;

#[test]
fn snapshots_are_short_enough_to_be_reviewed() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut folders = vec![
        root.join("crates"),
        root.join("tests"),
        root.join("plugins"),
    ];
    let mut read = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "snap") {
                let text = std::fs::read_to_string(&path).expect("a snapshot is text");
                let lines = text.lines().count();
                assert!(
                    lines <= MAX_SNAPSHOT_LINES,
                    "{}: {lines} lines",
                    path.display()
                );
                read += 1;
            }
        }
    }
    assert!(read > 50, "{read} snapshots were found");
}

#[test]
fn trees_of_written_files() {
    for robot in ["ripley", "justin"] {
        let files = finished(robot, "ml").dir.files("out");
        let names: Vec<&String> = files.keys().collect();
        insta::assert_json_snapshot!(format!("files_{robot}"), names);
    }
}

#[test]
fn checks() {
    let dir = Scratch::new().robot("ripley").robot("justin");
    for robot in ["ripley", "justin"] {
        let ran = dir
            .calib(["check", &format!("robots/{robot}.yaml")])
            .expect(0);
        insta::assert_snapshot!(format!("check_{robot}"), ran.stdout);
    }
}

#[test]
fn help() {
    let dir = Scratch::new();
    let page = help_page(&dir, &[]);
    insta::assert_snapshot!("help", page);
    for name in commands_of(&page) {
        for (command, page) in help_pages(&dir, &[name]) {
            insta::assert_snapshot!(format!("help_{command}"), page);
        }
    }
}

fn help_page(dir: &Scratch, command: &[&str]) -> String {
    let asked = [command, &["--help"]].concat();
    let page = dir.calib_with(&asked).expect(0).stdout;
    format!("$ calib {}\n{page}\n", asked.join(" "))
}

/// The commands that a page of help lists.
fn commands_of(page: &str) -> Vec<&str> {
    page.lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        // A description that goes on stands deeper.
        .filter(|line| !line.starts_with("    "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect()
}

/// The page of a command and the pages of all commands below it, by their names.
fn help_pages(dir: &Scratch, command: &[&str]) -> Vec<(String, String)> {
    let page = help_page(dir, command);
    let mut pages = vec![(command.join("_"), page.clone())];
    for name in commands_of(&page) {
        pages.extend(help_pages(dir, &[command, &[name]].concat()));
    }
    pages
}

#[test]
fn numbers_are_rounded_where_they_stand() {
    assert_eq!(
        rounded_text("calib 0.1.0: 12.3456 ± 0.00123 mm, 3 poses, v1.25x"),
        "calib 0.1.0: 12.3 ± 0.00123 mm, 3 poses, v1.25x"
    );
    assert_eq!(
        rounded("translation_m", &json!([0.123_456_7, -1e-9])),
        json!([0.12346, 0.0])
    );
}

/// Questions of the page by the ids of their headings.
const QUESTIONS: [&str; 13] = [
    "trust",
    "scope",
    "expected-error",
    "worst-pose",
    "warnings",
    "unobservable",
    "next",
    "changed",
    "rejected",
    "noise",
    "clocks",
    "undo",
    "reproduce",
];

/// One file that is mailed around.
const MAX_PAGE_BYTES: usize = 1_500_000;

#[test]
fn the_page_answers_or_leads_to_the_answer_on_its_first_screen() {
    for robot in ["ripley", "justin"] {
        let page = finished(robot, "ml").dir.read("out/report.html");
        assert!(page.len() < MAX_PAGE_BYTES, "{robot}: {} bytes", page.len());
        for size in [[1280, 800], [400, 800]] {
            let script = browser::first_screen(&QUESTIONS);
            let Some(seen) = browser::open(robot, &page, size, &script) else {
                skipped_tests::skip(skipped_tests::NO_BROWSER);
                return;
            };
            let at = format!("{robot} at {size:?}: {}", seen.told);
            assert!(seen.console.is_empty(), "{at}: {:?}", seen.console);
            assert!(seen.hosts.is_empty(), "{at}: {:?}", seen.hosts);
            assert_eq!(seen.told["loaded"], 0, "{at}");
            assert_eq!(seen.told["overflow"], 0, "wider than the screen: {at}");
            for id in QUESTIONS {
                let how = &seen.told["answers"][id];
                assert!(how == "seen" || how == "linked", "{id} is {how}: {at}");
            }
        }
    }
}

/// The data of the 3-D view in a page.
fn view_data(page: &str) -> Value {
    let data = page
        .split("id=\"view-data\">")
        .nth(1)
        .and_then(|rest| rest.split("</script>").next())
        .expect("the page has a view");
    serde_json::from_str(data).expect("JSON")
}

#[test]
fn the_data_of_the_pages() {
    for robot in ["ripley", "justin"] {
        let data = view_data(&finished(robot, "ml").dir.read("out/report.html"));
        for (part, value) in in_parts(&data, &[("poses", &["poses"])], "shapes") {
            insta::assert_json_snapshot!(format!("view_{robot}_{part}"), value);
        }
    }
}

/// A box of 0.2 m as a binary STL, in millimeters: 12 triangles, 12 edges that bend.
fn box_stl() -> Vec<u8> {
    let corner = |i: usize| [0, 1, 2].map(|k| if i >> k & 1 == 1 { 100.0_f32 } else { -100.0 });
    // Two triangles a face; the diagonal is flat.
    let faces = [
        [0, 1, 3, 2],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 3, 7, 5],
    ];
    let mut stl = vec![0; 80];
    stl.extend_from_slice(&12u32.to_le_bytes());
    for [a, b, c, d] in faces {
        for triangle in [[a, b, c], [a, c, d]] {
            stl.extend_from_slice(&[0; 12]);
            for x in triangle.iter().flat_map(|i| corner(*i)) {
                stl.extend_from_slice(&x.to_le_bytes());
            }
            stl.extend_from_slice(&[0; 2]);
        }
    }
    stl
}

const PLATE_OBJ: &str = "v 0 0 0\nv 100 0 0\nv 100 50 0\nv 0 50 0\nf 1 2 3 4\n";

/// A square of 100 mm in meters.
const SQUARE_DAE: &str = r##"<COLLADA><library_geometries><geometry id="g"><mesh>
<source id="s"><float_array count="12">0 0 0 0.1 0 0 0.1 0.1 0 0 0.1 0</float_array></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<polygons><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 3</p></polygons>
</mesh></geometry></library_geometries></COLLADA>"##;

const TEXT_STL: &str = "solid one\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0.1 0 0\nvertex 0 0.1 0\nendloop\nendfacet\nendsolid\n";

#[test]
fn shapes_of_the_urdf_are_drawn_and_missing_meshes_are_told() {
    let visual = |inside: &str| format!("<visual><geometry>{inside}</geometry></visual>");
    let mesh = |file: &str| {
        visual(&format!(
            "<mesh filename=\"{file}\" scale=\"0.001 0.001 0.001\"/>"
        ))
    };
    let shapes = [
        visual("<box size=\"0.1 0.2 0.3\"/>"),
        visual("<cylinder radius=\"0.1\" length=\"0.3\"/>"),
        visual("<sphere radius=\"0.1\"/>"),
        mesh("../meshes/box.stl"),
        mesh("package://arm_description/one.STL"),
        mesh("package://elsewhere/box.stl"),
        mesh("package://unknown/box.stl"),
        mesh("broken.stl"),
        mesh("gone.stl"),
        mesh("../../private.stl"),
        mesh("body.dae"),
        mesh("plate.obj"),
        mesh("square.dae"),
        mesh("body.blend"),
        visual("<capsule radius=\"1\"/>"),
    ];
    let dir = Scratch::new()
        .robot("ripley")
        .file("robots/meshes/box.stl", box_stl())
        .file("robots/package.xml", "<package/>")
        .file("robots/arm_description/one.STL", TEXT_STL)
        .file("private.stl", box_stl())
        .file("packages/elsewhere/box.stl", box_stl())
        .file("robots/ripley/broken.stl", &box_stl()[..500])
        .file("robots/ripley/body.dae", "<COLLADA/>")
        .file("robots/ripley/plate.obj", PLATE_OBJ)
        .file("robots/ripley/square.dae", SQUARE_DAE)
        .edit(
            "robots/ripley.yaml",
            "urdf: ripley/r17.urdf}",
            "urdf: ripley/r17.urdf, packages: {elsewhere: ../packages/elsewhere}}",
        )
        .edit(
            "robots/ripley/r17.urdf",
            "<link name=\"gripper_tip\"/>",
            &format!("<link name=\"gripper_tip\">{}</link>", shapes.concat()),
        );
    let ran = dir
        .calib(["run", "robots/ripley.yaml", "--out", "out"])
        .expect(0);
    assert_eq!(ran.stderr, "");
    let data = view_data(&dir.read("out/report.html"));
    let solids = data["solids"].as_array().expect("solids");
    let of_tip = solids.last().expect("shapes")["frame"].clone();
    let solids: Vec<&Value> = solids.iter().filter(|s| s["frame"] == of_tip).collect();
    let faces = |solid: &&Value| solid["faces"].as_array().expect("faces").len();
    let faces: Vec<usize> = solids.iter().map(faces).collect();
    // Box; cylinder of 20 sides; ball of 8 rings; the box as triangles; a triangle; the box again; plate; square.
    assert_eq!(faces, [6, 22, 162, 12, 1, 12, 2, 2]);
    let points = solids[3]["points"].as_array().expect("points");
    assert_eq!(points.len(), 8);
    assert!(
        points
            .iter()
            .all(|p| (p[0].as_f64().expect("m").abs() - 0.1).abs() < 1e-9),
        "scaled to meters"
    );
    let report = dir.json("out/report.json");
    let findings = report["findings"].as_array().expect("findings");
    let not_drawn: Vec<&str> = findings
        .iter()
        .filter(|f| f["id"] == "shape-not-drawn")
        .filter_map(|f| f["text"].as_str())
        .collect();
    insta::assert_snapshot!("shapes_not_drawn", not_drawn.join("\n"));
    let read: Vec<&str> = report["inputs"]
        .as_array()
        .expect("inputs")
        .iter()
        .filter_map(|input| input["path"].as_str())
        .filter(|path| {
            [".stl", ".obj", ".dae"]
                .iter()
                .any(|e| path.to_lowercase().ends_with(e))
        })
        .collect();
    assert_eq!(
        read,
        [
            "../meshes/box.stl",
            "package://arm_description/one.STL",
            "package://elsewhere/box.stl",
            "plate.obj",
            "square.dae"
        ]
    );
    // The robot is the same with and without its looks.
    let plain = finished("ripley", "ml");
    assert_eq!(report["transforms"], plain.report["transforms"]);
}
