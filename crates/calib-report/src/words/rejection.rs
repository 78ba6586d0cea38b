//! Samples that did not take part in the fit.

use super::prose::{or, short};
use crate::Report;

pub(crate) fn thrown_out(report: &Report, rest: &str) -> Vec<String> {
    let lines: Vec<String> = report
        .rejected
        .iter()
        .map(|rejected| {
            let subject = if rejected.subject.is_empty() {
                String::new()
            } else {
                format!(" {}", rejected.subject)
            };
            let rows = if rejected.rows.len() == 1 {
                "row"
            } else {
                "rows"
            };
            format!(
                "{}{subject}: {} {rows}, {}.",
                rejected.recording,
                rejected.rows.len(),
                rejected.reason
            )
        })
        .collect();
    let lost: usize = report
        .recordings
        .iter()
        .flat_map(|recording| &recording.lost)
        .map(|lost| lost.lost)
        .sum();
    let mut lines = or(short(&lines, rest), "Nothing.");
    match lost {
        0 => {}
        1 => lines.push("1 sample was lost by the tracker.".to_owned()),
        n => lines.push(format!("{n} samples were lost by the tracker.")),
    }
    lines
}
