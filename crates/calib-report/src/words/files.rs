//! Files read and written, and the commands about them.

use super::prose::{commands, or};
use crate::Report;

pub(crate) fn changed(report: &Report) -> Vec<String> {
    let mut lines: Vec<String> = report
        .outputs
        .iter()
        .filter_map(|output| {
            output.changes.as_ref().map(|of| {
                format!(
                    "`{}` is new ({}); `{of}` itself is untouched.",
                    output.path, output.what
                )
            })
        })
        .collect();
    if lines.is_empty() {
        let written: Vec<&str> = report
            .outputs
            .iter()
            .map(|output| output.path.as_str())
            .collect();
        lines.push(if written.is_empty() {
            "None.".to_owned()
        } else {
            format!("None of yours. Written: {}.", written.join(", "))
        });
    }
    lines
}

pub(crate) fn reproduce(report: &Report) -> Vec<String> {
    let mut lines = or(commands(&report.reproduce), "Run the same profile again.");
    let inputs = if report.inputs.len() == 1 {
        "1 input".to_owned()
    } else {
        format!("{} inputs", report.inputs.len())
    };
    lines.push(format!(
        "calib {}, seed {}, {inputs} by SHA-256 below.",
        report.version, report.seed
    ));
    lines
}
