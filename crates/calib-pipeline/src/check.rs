//! `calib check`.

use std::fmt::Write as _;
use std::path::Path;

use calib_finding::{Finding, Severity, catalog};

use crate::error::{ExitCode, PipelineError};
use crate::estimate::start::start;
use crate::formulate::{bad_rows, model_checks};
use crate::prepare::checks;
use crate::prepare::inputs::Inputs;
use crate::prepare::load::load_recordings;
use crate::prepare::relabel::relabel;
use crate::prepare::robot::load_robot;
use crate::prepare::tracks::body_tracks;

/// What `calib check` found.
#[derive(Debug, Clone)]
pub struct Checked {
    /// Robot name.
    pub robot: String,
    /// One line per recording.
    pub recordings: Vec<String>,
    /// Findings, worst first.
    pub findings: Vec<Finding>,
}

/// Checks a profile, its robot and its recordings; solves nothing.
///
/// # Errors
/// [`PipelineError`] for what cannot be read at all.
pub fn check(profile: &Path) -> Result<Checked, PipelineError> {
    let mut inputs = load_recordings(load_robot(profile)?, true)?;
    let mut findings = inputs.findings.clone();
    if inputs.robot.profile.solve.robust {
        findings.extend(relabel(&mut inputs));
    }
    let of_data = checks::check(&inputs);
    // A column written twice does not keep the others from being compared with the robot, row by row.
    let is_wrong = |f: &Finding| f.severity == Severity::Error && f.id != catalog::DUPLICATE_COLUMN;
    let wrong = of_data.iter().any(is_wrong);
    findings.extend(of_data);
    match body_tracks(&inputs, &mut findings) {
        Ok(tracks) => {
            let start = start(&inputs, &tracks);
            model_checks::before_the_fit(&inputs, &tracks, &start, &mut findings);
            let wrong = findings.iter().any(is_wrong);
            if !wrong && inputs.robot.profile.solve.robust {
                findings.extend(bad_rows::bad_rows_of_inputs(&inputs, &tracks)?.findings);
            }
        }
        // What the data checks found is the reason.
        Err(_) if wrong => {}
        Err(error) => return Err(error),
    }
    findings.sort_by_key(|f| std::cmp::Reverse(f.severity));
    Ok(Checked {
        robot: inputs.robot.profile.robot.clone(),
        recordings: lines(&inputs),
        findings,
    })
}

fn lines(inputs: &Inputs) -> Vec<String> {
    let line = |r: &crate::prepare::inputs::Loaded| {
        let usage = match r.spec.usage {
            calib_profile::Usage::Sweep => "sweep",
            calib_profile::Usage::Static => "static poses",
            calib_profile::Usage::Validation => "validation",
        };
        let mut line = format!(
            "{} ({usage}): {} rows, {} joints, {} bodies, {} markers",
            r.name,
            r.poses.len(),
            r.poses.joints.len(),
            r.poses.bodies.len(),
            r.poses.markers.len()
        );
        if let Some(alignment) = &r.alignment {
            line += "\n    ";
            line += &alignment.text();
        }
        line
    };
    inputs.recordings.values().map(line).collect()
}

impl Checked {
    /// For people.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = format!("{}\n", self.robot);
        for line in &self.recordings {
            let _ = writeln!(text, "  {line}");
        }
        if self.findings.is_empty() {
            text.push_str("no findings\n");
        }
        for f in &self.findings {
            let _ = write!(text, "{}[{}] {}", f.severity, f.id, f.subject);
            if !f.rows.is_empty() {
                let shown: Vec<String> = f.rows.iter().take(8).map(u64::to_string).collect();
                let more = if f.rows.len() > 8 {
                    format!(" and {} more", f.rows.len() - 8)
                } else {
                    String::new()
                };
                let _ = write!(text, " (rows {}{more})", shown.join(", "));
            }
            let _ = writeln!(text, "\n  {}\n  help: {}", f.text(), f.remedy());
        }
        text
    }

    /// For machines.
    ///
    /// # Errors
    /// [`PipelineError::Report`] when a number has no JSON form.
    pub fn json(&self) -> Result<String, PipelineError> {
        let value = serde_json::json!({ "robot": self.robot, "recordings": self.recordings, "findings": self.findings });
        let mut text = calib_report::json::pretty(&value);
        text.push('\n');
        Ok(text)
    }

    /// 3 with an error among the findings, else 0.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        if checks::stops(&self.findings) {
            ExitCode::Data
        } else {
            ExitCode::Accepted
        }
    }
}
