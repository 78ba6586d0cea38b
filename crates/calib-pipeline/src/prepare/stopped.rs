//! The error of data that checks refuse.

use calib_finding::{Finding, Severity};

use crate::error::PipelineError;
use crate::prepare::inputs::Inputs;

pub(crate) fn stopped(inputs: &Inputs, findings: &[Finding]) -> PipelineError {
    let errors: Vec<String> = findings
        .iter()
        .filter(|f| f.severity == Severity::Error)
        .map(|f| {
            let rows: Vec<String> = f.rows.iter().take(5).map(u64::to_string).collect();
            let at = if rows.is_empty() {
                String::new()
            } else {
                format!(" (rows {})", rows.join(", "))
            };
            format!(
                "{} [{}]{at}: {}\n  help: {}",
                f.subject,
                f.id,
                f.text(),
                f.remedy()
            )
        })
        .collect();
    PipelineError::Data {
        file: inputs.robot.file.clone(),
        finding: format!(
            "the data checks found {} error(s)\n{}",
            errors.len(),
            errors.join("\n")
        ),
        remedy: "correct the data, or go on at your own risk with --force".to_owned(),
    }
}
