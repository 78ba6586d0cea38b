//! What a person reads, as snapshots; and rules that hold for every report.

use crate::examples;
use crate::parts::parts;

use calib_report::terminal::{Look, Places};
use calib_report::{answers, json, markdown, report_schema, scene_schema, terminal};
use insta::assert_snapshot;

#[test]
fn markdown_of_the_examples() {
    for (name, report) in examples::all() {
        let cuts: &[&str] = match name {
            "accepted" => &["## Transforms", "## Uncertainty budget"],
            _ => &[],
        };
        for (i, part) in parts(&markdown::markdown(&report), cuts).iter().enumerate() {
            assert_snapshot!(format!("markdown_{name}_{}", i + 1), part);
        }
    }
}

#[test]
fn terminal_of_the_examples() {
    for (name, report) in examples::all() {
        let full = terminal::full(&report, Look::default(), PLACES);
        assert_snapshot!(format!("terminal_{name}"), full);
        let short = terminal::summary(&report, Look::default(), PLACES);
        assert!(full.ends_with(&short), "{full}");
        assert!(short.lines().count() <= 20, "{short}");
    }
}

/// As `calib run robots/arm.yaml --out results/arm`.
const PLACES: Places<'_> = Places {
    profile: "robots/arm.yaml",
    folder: "results/arm",
    page: "results/arm/report.html",
};

/// The first screen of a page in words, and the last lines of a terminal.
#[test]
fn first_screens_of_the_examples() {
    for (name, report) in examples::all() {
        let terminal = terminal::summary(&report, Look::default(), PLACES);
        let line = terminal::line(&report, Look::default(), PLACES);
        assert_eq!(line.lines().count(), 1, "{line}");
        let screen = format!("{terminal}---\n{line}---\n{}", first_screen(&report));
        assert_snapshot!(format!("first_screen_{name}"), screen);
    }
}

/// Text of the page down to the questions, one line per element.
fn first_screen(report: &calib_report::Report) -> String {
    let page = calib_report::html::html(report, None).expect("a page");
    let from = page.find("<header>").expect("a header");
    let to = page.find("<nav class=\"quick\"").expect("questions");
    let mut text = String::new();
    let mut rest = &page[from..to];
    while let Some((before, after)) = rest.split_once('<') {
        text += before;
        let (tag, after) = after.split_once('>').expect("an element ends");
        if tag.starts_with("/p") || tag.starts_with("/li") || tag.starts_with("/h1") {
            text.push('\n');
        }
        rest = after;
    }
    let lines = text
        .lines()
        .map(|l| l.split_whitespace().collect::<Vec<_>>().join(" "));
    lines
        .filter(|l| !l.is_empty())
        .collect::<Vec<_>>()
        .join("\n")
        + "\n"
}

#[test]
fn json_of_the_examples() {
    for (name, report) in examples::all() {
        let mut report = report;
        // The shape is what matters here; 300 places and 150 poses would bury it.
        if let Some(workspace) = &mut report.workspace {
            workspace.points.truncate(2);
        }
        if let Some(held_out) = &mut report.verification.held_out {
            held_out.poses.truncate(2);
        }
        report.residuals.by_joint.truncate(1);
        for over_time in &mut report.residuals.over_time {
            over_time.bins.truncate(12);
        }
        if let Some(standardized) = &mut report.residuals.standardized {
            standardized.quantiles.truncate(2);
        }
        let cuts: &[&str] = match name {
            "accepted" => &[
                "  \"transforms\"",
                "  \"parameters\"",
                "  \"dh_table\"",
                "  \"verification\"",
                "  \"estimators\"",
                "    \"by_joint\"",
                "    \"over_time\"",
                "    \"standardized\"",
                "  \"noise\"",
                "  \"rejected\"",
            ],
            "rejected" => &["  \"transforms\"", "  \"verification\"", "  \"estimators\""],
            _ => &[],
        };
        let text = json::report_json(&report).expect("finite");
        for (i, part) in parts(&text, cuts).iter().enumerate() {
            assert_snapshot!(format!("json_{name}_{}", i + 1), part);
        }
    }
}

#[test]
fn the_answers_of_the_examples() {
    for (name, report) in examples::all() {
        let answers = answers(&report);
        assert_eq!(answers.len(), 13);
        assert!(
            answers.iter().all(|answer| !answer.lines.is_empty()
                && answer.lines.iter().all(|line| !line.is_empty())),
            "{answers:?}"
        );
        let text: Vec<String> = answers
            .iter()
            .map(|answer| {
                format!(
                    "{} [{}]\n  {}\n",
                    answer.question,
                    answer.id,
                    answer.lines.join("\n  ")
                )
            })
            .collect();
        assert_snapshot!(format!("answers_{name}"), text.concat());
    }
}

#[test]
fn the_terminal_text_fits_its_columns_whatever_the_names() {
    for (name, mut report) in examples::all() {
        let long = "a_name_that_somebody_generated_from_a_path/".repeat(4);
        for transform in &mut report.transforms {
            transform.name = long.clone();
        }
        for finding in &mut report.findings {
            finding.subject = calib_finding::Subject::joint(long.clone());
        }
        for change in &mut report.changes {
            change.joint = long.clone();
        }
        report.undo.push(long.clone());
        report.profile = long;
        for columns in [60, 80, 120] {
            let look = Look {
                columns,
                ..Look::default()
            };
            let text = terminal::full(&report, look, Places::default());
            for line in text.lines() {
                assert!(line.chars().count() <= columns, "{name}: {line}");
            }
        }
    }
}

#[test]
fn color_changes_nothing_but_color() {
    for (_, report) in examples::all() {
        let look = Look {
            color: true,
            ..Look::default()
        };
        let colored = terminal::full(&report, look, PLACES);
        let mut plain = String::new();
        let mut rest = colored.as_str();
        while let Some((before, after)) = rest.split_once('\u{1b}') {
            plain += before;
            rest = after.split_once('m').expect("a complete sequence").1;
        }
        plain += rest;
        assert!(colored.contains('\u{1b}'));
        assert_eq!(plain, terminal::full(&report, Look::default(), PLACES));
    }
}

#[test]
fn an_empty_report_is_not_accepted_and_renders() {
    let report = calib_report::Report::default();
    assert!(markdown::markdown(&report).contains("not decided"));
    let text = terminal::summary(&report, Look::default(), PLACES);
    assert!(text.contains("NOT DECIDED"));
    assert!(
        json::report_json(&report)
            .expect("finite")
            .contains("\"verdict\": \"not_evaluated\"")
    );
}

#[test]
fn every_report_reads_back() {
    for (name, report) in examples::all() {
        let text = json::report_json(&report).expect("finite");
        let read = json::read_report(&text).expect("its own JSON");
        assert_eq!(json::report_json(&read).expect("finite"), text, "{name}");
    }
    assert!(json::read_report("{\"calib\": 1}").is_err());
}

#[test]
fn a_number_that_is_not_finite_is_an_error_and_not_a_null() {
    let mut report = examples::accepted();
    report.transforms[0].translation_m[1] = f64::NAN;
    let error = json::report_json(&report).expect_err("NaN must not be written");
    assert!(
        matches!(error, calib_report::ReportError::NotFinite(_)),
        "{error}"
    );
}

#[test]
fn the_stable_keys_are_there() {
    let value = json::report_value(&examples::accepted()).expect("finite");
    let paths = [
        "/calib",
        "/profile",
        "/robot",
        "/method",
        "/verdict",
        "/reasons",
        "/transforms/0/name",
        "/transforms/0/parent",
        "/transforms/0/child",
        "/transforms/0/translation_m/2",
        "/transforms/0/rotation_xyzw/3",
        "/transforms/0/covariance/5/5",
        "/transforms/0/observable",
        "/transforms/1/unobservable/0/direction",
        "/transforms/1/unobservable/0/text",
        "/transforms/1/unobservable/0/remedy",
        "/parameters/0/name",
        "/parameters/0/joint",
        "/parameters/0/kind",
        "/parameters/0/unit",
        "/parameters/0/nominal",
        "/parameters/0/value",
        "/parameters/0/sigma",
        "/parameters/0/data_share",
        "/parameters/0/class",
        "/loops/0/name",
        "/loops/0/samples",
        "/loops/0/translation_m/mean",
        "/loops/0/translation_m/std",
        "/loops/0/translation_m/max",
        "/loops/0/translation_m/rms",
        "/loops/0/rotation_rad",
        "/verification/held_out/n",
        "/verification/held_out/nominal/mean_m",
        "/verification/held_out/nominal/rms_m",
        "/verification/held_out/nominal/p95_m",
        "/verification/held_out/nominal/max_m",
        "/verification/held_out/registration_only",
        "/verification/held_out/calibrated",
        "/estimators/0/quantity",
        "/estimators/0/estimator",
        "/estimators/0/value",
        "/estimators/0/sigma",
        "/estimators/0/agrees",
        "/findings/0/id",
        "/findings/0/severity",
        "/findings/0/subject",
        "/findings/0/rows",
        "/findings/0/text",
        "/findings/0/remedy",
        "/inputs/0/path",
        "/inputs/0/sha256",
        "/version",
    ];
    for path in paths {
        assert!(value.pointer(path).is_some(), "{path} is missing");
    }
}

#[test]
fn the_examples_are_valid_by_the_published_schema() {
    let validator = jsonschema::validator_for(&report_schema()).expect("a schema");
    for (name, report) in examples::all() {
        let value = json::report_value(&report).expect("finite");
        let errors: Vec<String> = validator
            .iter_errors(&value)
            .map(|error| format!("{}: {error}", error.instance_path))
            .collect();
        assert!(errors.is_empty(), "{name}: {errors:?}");
    }
    assert!(!validator.is_valid(&serde_json::json!({"calib": 1, "verdict": "perfect"})));
    let scene = serde_json::from_str(&examples::scene().json().expect("a tree")).expect("JSON");
    let validator = jsonschema::validator_for(&scene_schema()).expect("a schema");
    assert!(validator.is_valid(&scene));
}

/// The schemas in `schema/` are what the structs say; `CALIB_UPDATE_SCHEMA=1` regenerates them.
#[test]
fn the_published_schemas_are_up_to_date() {
    for (file, schema) in [
        ("report.schema.json", report_schema()),
        ("scene.schema.json", scene_schema()),
        ("model.schema.json", calib_report::model_schema()),
    ] {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("schema")
            .join(file);
        let text = json::pretty(&schema);
        if std::env::var_os("CALIB_UPDATE_SCHEMA").is_some() {
            std::fs::create_dir_all(path.parent().expect("a folder"))
                .expect("a folder to write to");
            std::fs::write(&path, &text).expect("a file to write");
        }
        let published = std::fs::read_to_string(&path).expect("the schema is published");
        assert!(
            published == text,
            "{file} is out of date: run with CALIB_UPDATE_SCHEMA=1 and look at the difference"
        );
    }
}
