//! Files read and written, and the commands about them.

use super::prose::{code, commands, counted, or};
use crate::Report;

pub(crate) fn changed(report: &Report) -> Vec<String> {
    let replaced = report.outputs.iter().filter_map(|output| {
        let original = output.changes.as_ref()?;
        Some(format!(
            "{} is new ({}); {} itself is unchanged.",
            code(&output.path),
            output.what,
            code(original)
        ))
    });
    let lines: Vec<String> = replaced.collect();
    if !lines.is_empty() {
        return lines;
    }
    let written = report.outputs.iter().map(|output| output.path.as_str());
    let written: Vec<&str> = written.collect();
    vec![if written.is_empty() {
        "None.".to_owned()
    } else {
        format!("None of yours. Written: {}.", written.join(", "))
    }]
}

pub(crate) fn reproduce(report: &Report) -> Vec<String> {
    let mut lines = or(commands(&report.reproduce), "Run the same profile again.");
    lines.push(format!(
        "calib {}, seed {}; {} identified by SHA-256 below.",
        report.version,
        report.seed,
        counted(report.inputs.len(), "input")
    ));
    lines
}

/// Program and seed, below the table of files.
pub(crate) fn program(report: &Report) -> String {
    format!(
        "calib {}, seed {}. A report cannot contain its own digest.",
        report.version, report.seed
    )
}
