//! What the first screen of the report and the last lines of the terminal say, word for word, for one run of each kind.

use crate::scratch;

use scratch::{Ran, Scratch, finished};
use serde_json::Value;

const PROFILE: &str = "robots/ripley.yaml";
const VALIDATION: &str = "  checks: {file: ripley/checks.csv, use: validation}\n";
const LIMITS: &str = "  limits: {held_out_rms_mm: 1.5, held_out_max_mm: 4}\n";

/// Lines of a terminal that nobody resized.
const ROWS: usize = 24;

fn ripley() -> Scratch {
    Scratch::new().robot("ripley")
}

/// The text of an element of the page and below, one line per paragraph.
fn text_between(page: &str, from: &str, to: &str) -> String {
    let start = page.find(from).unwrap_or_else(|| panic!("no {from}"));
    let end = start + page[start..].find(to).unwrap_or_else(|| panic!("no {to}"));
    let mut text = String::new();
    let mut rest = &page[start..end];
    let mut in_picture = false;
    while let Some((before, after)) = rest.split_once('<') {
        if !in_picture {
            text += before;
        }
        let (tag, after) = after.split_once('>').expect("an element ends");
        in_picture = match tag {
            "/svg" => false,
            _ if tag.starts_with("svg") => true,
            _ => in_picture,
        };
        if ["/p", "/li", "/h1", "/figcaption"].contains(&tag) {
            text.push('\n');
        }
        rest = after;
    }
    let lines = text
        .lines()
        .map(|l| l.split_whitespace().collect::<Vec<_>>().join(" "));
    let lines = lines.filter(|line| !line.is_empty());
    let lines = lines.map(|l| {
        l.replace("&quot;", "\"")
            .replace("&gt;", ">")
            .replace("&lt;", "<")
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// The terminal and the first screen of a run.
fn screens(ran: &Ran, dir: &Scratch) -> String {
    let page = dir.read("out/report.html");
    let first = text_between(&page, "<header>", "<nav class=\"quick\"");
    let shown = format!("exit code {}\n{}---\n{first}\n", ran.code, ran.stdout);
    crate::shown::rounded_text(&shown)
}

#[track_caller]
fn reviewed(name: &str, ran: &Ran, dir: &Scratch) {
    assert!(ran.stdout.lines().count() <= 20, "{}", ran.stdout);
    let mut last = ran.stdout.lines().rev();
    assert_eq!(last.next(), Some("report: out/report.html"));
    let verdict = last.next().expect("a verdict");
    assert_eq!(verdict, verdict.to_uppercase());
    insta::assert_snapshot!(format!("screens_{name}"), screens(ran, dir));
}

#[track_caller]
fn run(name: &str, dir: &Scratch, arguments: &[&str], code: i32) -> Value {
    let ran = dir.calib_with(&[&["run", PROFILE, "-o", "out"], arguments].concat());
    let ran = ran.expect(code);
    reviewed(name, &ran, dir);
    dir.json("out/report.json")
}

#[test]
fn accepted() {
    let run = finished("ripley", "ml");
    reviewed("accepted", &run.ran, &run.dir);
    assert!(run.report["diagnosis"].is_null());
}

#[test]
fn warned() {
    let profile = ripley().read(PROFILE);
    let stated = profile.split("simulate:").next().unwrap_or_default();
    let dir = ripley().file(PROFILE, stated).edit(PROFILE, VALIDATION, "");
    let report = run("warned", &dir, &[], 0);
    assert_eq!(report["verdict"], "accepted_with_warnings");
}

/// The tracker's noise alone is 0.52 mm.
#[test]
fn rejected_by_a_limit_below_the_noise() {
    let dir = ripley().edit(PROFILE, "held_out_rms_mm: 1.5", "held_out_rms_mm: 0.3");
    let report = run("limit_below_noise", &dir, &[], 1);
    assert_eq!(report["verdict"], "rejected");
    assert_eq!(report["diagnosis"]["kind"], "limit_below_noise");
}

#[test]
fn rejected_by_a_missing_effect() {
    let dir = Scratch::new()
        .robot("justin")
        .edit("robots/justin.yaml", ", compliance]", "]")
        .edit(
            "robots/justin.yaml",
            "held_out_rms_mm: 3",
            "held_out_rms_mm: 1",
        );
    let ran = dir
        .calib(["run", "robots/justin.yaml", "-o", "out"])
        .expect(1);
    reviewed("missing_effect", &ran, &dir);
    let report = dir.json("out/report.json");
    assert_eq!(report["verdict"], "rejected");
    assert_eq!(report["diagnosis"]["kind"], "missing_effect");
}

#[test]
fn not_evaluated() {
    let dir = ripley().edit(PROFILE, LIMITS, "");
    let report = run("not_evaluated", &dir, &[], 1);
    assert_eq!(report["verdict"], "not_evaluated");
    assert_eq!(report["diagnosis"]["kind"], "no_limits");
}

/// An encoder value outside of its limits is an error of the data.
#[test]
fn forced() {
    let dir = ripley().cells("robots/ripley/base_sweep.csv", |row, name, cell| {
        if row == 9 && name == "waist_deg" {
            "200".to_owned()
        } else {
            cell.to_owned()
        }
    });
    let report = run("forced", &dir, &["--force"], 1);
    assert_eq!(report["diagnosis"]["kind"], "structural_fault");
}

/// What the report quotes works from where it says, with all flags, and gives the same report.
#[test]
fn quoted_commands_run() {
    let dir = ripley();
    dir.calib(["run", PROFILE, "-o", "robots/results/ripley", "--strict"])
        .expect(0);
    let report = dir.read("robots/results/ripley/report.json");
    let told: Value = serde_json::from_str(&report).expect("JSON");
    let quoted = told["reproduce"][0].as_str().expect("a command");
    assert_eq!(quoted, "calib run ripley.yaml --strict");
    dir.quoted("robots", quoted).expect(0);
    assert_eq!(dir.read("robots/results/ripley/report.json"), report);
    for undo in told["undo"].as_array().expect("commands") {
        dir.quoted("robots/results/ripley", undo.as_str().expect("a command"))
            .expect(0);
    }
    let page = dir.read("robots/results/ripley/report.html");
    let next = text_between(&page, "<strong>Next:", "</p>");
    let next = next.split("calib apply ").nth(1).expect("a command");
    let next = format!("calib apply {}", next.replace("/path/to/", "../../ripley/"));
    let shown = dir.quoted("robots/results/ripley", &next).expect(0);
    assert!(shown.stdout.contains("+++"), "{}", shown.stdout);
    // What the terminal quotes works where it was shown.
    let ran = dir.calib(["run", PROFILE, "-o", "out"]).expect(0);
    let next = ran.stdout.lines().find_map(|l| l.strip_prefix("Next: "));
    dir.quoted("", next.expect("a command")).expect(0);
}

#[test]
fn one_line_and_all_tables() {
    let dir = ripley();
    let quiet = dir.calib(["run", PROFILE, "-o", "out", "-q"]).expect(0);
    assert_eq!(quiet.stdout.lines().count(), 1, "{}", quiet.stdout);
    assert!(quiet.stdout.starts_with("accepted: ripley, "));
    assert!(quiet.stdout.ends_with(": out/report.html\n"));
    let full = dir.calib(["run", PROFILE, "-o", "out", "--full"]).expect(0);
    assert!(full.stdout.lines().count() > ROWS, "{}", full.stdout);
    assert!(full.stdout.ends_with("ACCEPTED\nreport: out/report.html\n"));
    insta::assert_snapshot!("screens_full", crate::shown::rounded_text(&full.stdout));
    let wide = dir.calib_in(&["run", PROFILE, "-o", "out"], &[("COLUMNS", "100")]);
    let longest = wide.stdout.lines().map(|l| l.chars().count()).max();
    assert!(
        (81..=100).contains(&longest.unwrap_or(0)),
        "{}",
        wide.stdout
    );
}

/// In a terminal of 60 columns, whatever a command says is wrapped, and nothing is cut.
#[test]
fn narrow_terminals() {
    let dir = ripley();
    let narrow = [("COLUMNS", "60")];
    let commands: [(&[&str], i32); 4] = [
        (&["run", PROFILE, "-o", "out", "--full"], 0),
        (&["drift", "out", "out"], 0),
        (
            &[
                "plan",
                PROFILE,
                "--poses",
                "12",
                "--candidates",
                "128",
                "-o",
                "plan",
            ],
            0,
        ),
        (&["fit", "cor", "robots/ripley/base_sweep.csv"], 3),
    ];
    for (arguments, code) in commands {
        let ran = dir.calib_in(arguments, &narrow);
        assert_eq!(ran.code, code, "{arguments:?}: {}", ran.stderr);
        let said = ran.stdout.lines().chain(ran.stderr.lines());
        for line in said {
            assert!(line.chars().count() <= 60, "{arguments:?}: {line}");
            assert!(!line.trim_end().ends_with("m…"), "{arguments:?}: {line}");
        }
    }
}

#[test]
fn colors_are_as_asked_for() {
    let dir = Scratch::new().brief("ripley");
    let colored = |arguments: &[&str], variables: &[(&str, &str)]| {
        let all = [&["run", PROFILE, "-o", "out", "-q"], arguments].concat();
        dir.calib_in(&all, variables).stdout.contains('\u{1b}')
    };
    assert!(!colored(&[], &[]), "not a terminal");
    assert!(colored(&["--color", "always"], &[("NO_COLOR", "1")]));
    assert!(colored(&[], &[("CLICOLOR_FORCE", "1")]));
    assert!(!colored(&[], &[("CLICOLOR_FORCE", "0")]));
    assert!(!colored(&[], &[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")]));
    assert!(!colored(&["--color", "never"], &[("CLICOLOR_FORCE", "1")]));
}

/// What the profile says of the measurement stands beside the verdict.
#[test]
fn a_measurement_is_identified_by_the_profile() {
    let stated = "robot: {name: ripley, urdf: ripley/r17.urdf}\n";
    let identified = format!(
        "{stated}identification: {{serial_number: \"48\", operator: A. Smith, date: \"2026-11-03\", tracker: \"8 cameras\"}}\n"
    );
    let dir = ripley().edit(PROFILE, stated, &identified);
    let ran = dir.calib(["run", PROFILE, "-o", "out"]).expect(0);
    let line = "s/n 48 · measured 2026-11-03 by A. Smith · 8 cameras";
    assert!(
        ran.stdout.starts_with(&format!("ripley · {line}")),
        "{}",
        ran.stdout
    );
    assert!(dir.read("out/report.html").contains(line));
}

/// Errors, progress and written files are JSON where JSON is asked for.
#[test]
fn json_is_json_everywhere() {
    let dir = ripley();
    let lines = |text: &str| -> Vec<Value> {
        let lines = text.lines();
        lines
            .map(|line| serde_json::from_str(line).expect("a JSON line"))
            .collect()
    };
    for (arguments, code) in [
        (&["run", "absent.yaml", "--json"][..], 2),
        (&["run", "--json"], 2),
        (&["drift", "a", "b", "--json"], 3),
    ] {
        let ran = dir.calib_with(arguments).expect(code);
        let progress = lines(&ran.stderr);
        assert!(progress.iter().all(|s| s["progress"].is_string()));
        let said = lines(&ran.stdout);
        let last = said.last().expect("an error");
        assert_eq!(last["exit_code"], code, "{last}");
        assert!(last["error"].as_str().is_some_and(|e| !e.is_empty()));
    }
    let ran = dir.calib(["run", PROFILE, "-o", "out", "--json"]).expect(0);
    assert_eq!(ran.json()["verdict"], "accepted");
    let stages = lines(&ran.stderr);
    assert!(stages.len() > 3 && stages.iter().all(|s| s["progress"].is_string()));
    let ran = dir.calib(["check", PROFILE, "--json"]).expect(0);
    assert!(ran.json()["checks"].as_array().is_some_and(|c| c.len() > 5));
    let ran = dir
        .calib(["simulate", PROFILE, "-o", "new", "--json"])
        .expect(0);
    let written = ran.json();
    let written = written["written"].as_array().expect("files");
    assert!(
        written
            .iter()
            .all(|f| dir.path(f.as_str().expect("a path")).exists())
    );
}
