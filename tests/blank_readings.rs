//! Rows without a joint's reading, through the program: what takes no part is told.

use crate::scratch;
use crate::structural::{Design, FOUR, Setting};

use scratch::Scratch;
use serde_json::Value;

/// Empties the cells of a column in these rows, counted from 0.
fn emptied(dir: Scratch, table: &str, column: &str, rows: std::ops::Range<usize>) -> Scratch {
    let path = format!("{table}.csv");
    let text = dir.read(&path);
    let header = text.lines().position(|line| !line.starts_with('#'));
    let header = header.expect("a header");
    let names = text.lines().nth(header).expect("a header").split(',');
    let at = names.clone().position(|name| name == column);
    let at = at.expect("a column");
    let line = |(k, line): (usize, &str)| {
        let inside = k > header && rows.contains(&(k - header - 1));
        let cells = line.split(',').enumerate();
        let cells = cells.map(|(c, cell)| if inside && c == at { "" } else { cell });
        cells.collect::<Vec<_>>().join(",")
    };
    let lines: Vec<String> = text.lines().enumerate().map(line).collect();
    dir.file(&path, lines.join("\n") + "\n")
}

fn found(dir: &Scratch) -> Vec<Value> {
    let checked = dir.calib(["check", "arm.yaml", "--json"]);
    let all = checked.json()["findings"]
        .as_array()
        .expect("a list")
        .clone();
    let ours = |f: &Value| f["id"] == "joint-values-missing";
    all.into_iter().filter(ours).collect()
}

#[test]
fn rows_without_a_reading_are_told() {
    let setting = Setting {
        validation: true,
        ..Setting::new(Design::Random(20), FOUR, 31)
    };
    for (table, rows, severity) in [
        ("poses", 3..8, "warning"),
        ("poses", 1..20, "error"),
        ("checks", 0..4, "warning"),
        ("checks", 2..10, "error"),
    ] {
        let dir = emptied(setting.folder(), table, "elbow_deg", rows.clone());
        // Joints that lack the same rows are one finding.
        let dir = emptied(dir, table, "waist_deg", rows.clone());
        let found = found(&dir);
        assert_eq!(found.len(), 1, "{found:#?}");
        assert_eq!(found[0]["severity"], severity, "{found:#?}");
        assert_eq!(found[0]["facts"]["count"], rows.len(), "{found:#?}");
        assert_eq!(
            found[0]["facts"]["joints"],
            serde_json::json!(["elbow", "waist"]),
            "{found:#?}"
        );
        assert_eq!(found[0]["about"]["recordings"], serde_json::json!([table]));
        let numbers = found[0]["rows"].as_array().expect("a list");
        assert_eq!(numbers.len(), rows.len(), "{found:#?}");
    }
    assert!(found(&setting.folder()).is_empty());
}

/// In a fit, in a validation, in all recordings: neither a posture at 0 nor a table without rows.
#[test]
fn a_column_without_any_reading_is_refused() {
    let setting = Setting {
        validation: true,
        ..Setting::new(Design::Random(20), FOUR, 32)
    };
    for tables in [vec!["poses"], vec!["checks"], vec!["poses", "checks"]] {
        let dir = tables.iter().fold(setting.folder(), |dir, table| {
            emptied(dir, table, "elbow_deg", 0..20)
        });
        for command in ["check", "run"] {
            let ended = dir.calib([command, "arm.yaml", "--json"]);
            let ended = ended.expect(3);
            let said = ended.json()["error"].to_string();
            assert!(
                said.contains("elbow") && said.contains("no value"),
                "{said}"
            );
        }
    }
}
