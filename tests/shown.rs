//! What a person or a program reads, reviewed as snapshots: the summary, the reports, the checks, the help.
//!
//! Long tables are cut after three rows, numbers are rounded to what the next machine gives as well.

mod scratch;

use scratch::{Scratch, finished};
use serde_json::{Number, Value, json};

/// Rows of a table, or entries of a list, that a snapshot keeps.
const KEPT: usize = 3;

/// Significant digits of a number in running text.
const DIGITS: usize = 3;

/// Rounds every decimal number of a text to [`DIGITS`] significant digits, and everything below 1e-9 to zero.
fn rounded_text(text: &str) -> String {
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
        Value::Object(object) => object
            .iter()
            .map(|(k, v)| (k.clone(), rounded(k, v)))
            .collect(),
        Value::Array(list) if key == "covariance" => json!(format!("{} rows", list.len())),
        Value::Array(list) => {
            let lengths = list.iter().all(Value::is_number) && list.len() <= 6;
            let kept = if lengths {
                list.len()
            } else {
                KEPT.min(list.len())
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
        }
    }
}

#[test]
fn reports() {
    for robot in ["ripley", "justin"] {
        let run = finished(robot, "ml");
        insta::assert_snapshot!(
            format!("report_md_{robot}"),
            shortened(&run.dir.read("out/report.md"))
        );
        insta::assert_json_snapshot!(format!("report_json_{robot}"), rounded("", &run.report));
    }
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
    insta::assert_snapshot!(help_pages(&dir, &[]));
}

/// The page of a command and the pages of all commands below it.
fn help_pages(dir: &Scratch, command: &[&str]) -> String {
    let asked = [command, &["--help"]].concat();
    let page = dir.calib_with(&asked).expect(0).stdout;
    let mut text = format!("$ calib {}\n{page}\n", asked.join(" "));
    let below = page
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        // A description that goes on stands deeper.
        .filter(|line| !line.starts_with("    "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help");
    for name in below {
        text += &help_pages(dir, &[command, &[name]].concat());
    }
    text
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
