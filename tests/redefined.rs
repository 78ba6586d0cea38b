//! A marker that moved on its body while nobody recorded.

use crate::scratch;

use scratch::Scratch;
use serde_json::Value;

const PROFILE: &str = "robots/ripley.yaml";
const CHECKS: &str = "robots/ripley/checks.csv";

/// The held-out recording with one marker 3 mm farther from another one of its body: the calibration would be judged by a body that is not the one
/// it is of.
#[test]
fn a_marker_that_moved_between_recordings_is_named() {
    let dir = Scratch::new().robot("ripley");
    let text = dir.read(CHECKS);
    let mut header: Vec<String> = Vec::new();
    let mut lines = Vec::new();
    for line in text.lines() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if header.is_empty() || line.starts_with('#') {
            if !line.starts_with('#') {
                header = cells;
            }
            lines.push(line.to_owned());
            continue;
        }
        let places = |marker: &str| {
            ["x", "y", "z"].map(|axis| {
                let column = format!("{marker}.{axis}_m");
                header.iter().position(|c| *c == column).expect("a column")
            })
        };
        let at = |cells: &[String], marker: &str| {
            places(marker).map(|k| cells[k].parse::<f64>().unwrap_or(f64::NAN))
        };
        let (from, to) = (at(&cells, "gripM_2"), at(&cells, "gripM_3"));
        let apart = [0, 1, 2].map(|i| to[i] - from[i]);
        let length = apart.iter().map(|d| d * d).sum::<f64>().sqrt();
        if length.is_finite() {
            for (i, k) in places("gripM_3").into_iter().enumerate() {
                cells[k] = format!("{:.6}", to[i] + 3e-3 * apart[i] / length);
            }
        }
        lines.push(cells.join(","));
    }
    let dir = dir.file(CHECKS, lines.join("\n") + "\n");
    let ran = dir.calib(["check", PROFILE, "--json"]);
    assert_eq!(ran.code, 3, "{}", ran.stdout);
    let said: Value = serde_json::from_str(&ran.stdout).expect("JSON");
    let findings = said["findings"].as_array().expect("a list").iter();
    let worse: Vec<&Value> = findings.filter(|f| f["severity"] != "info").collect();
    assert_eq!(worse.len(), 1, "{worse:#?}");
    let [found] = worse[..] else { return };
    assert_eq!(found["id"], "body-redefined", "{found:#}");
    assert_eq!(found["subject"], "checks: gripM", "{found:#}");
    assert_eq!(found["facts"]["marker"], "gripM_3", "{found:#}");
    let change = found["facts"]["change"]["value"]
        .as_f64()
        .expect("a length");
    // Up to 0.6 % of the distance may be the tracker's scale.
    assert!((2e-3..3.3e-3).contains(&change), "{found:#}");
}
