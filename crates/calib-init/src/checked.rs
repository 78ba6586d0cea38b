//! What the check of a written profile said.

use calib_finding::{Finding, Severity};

/// What the check of a written profile said.
#[derive(Debug, Clone)]
pub enum Checked<'f> {
    /// There was nothing to check yet.
    Not,
    /// Its findings.
    Findings(&'f [Finding]),
    /// It ended with an error.
    Stopped(String),
}

impl Checked<'_> {
    /// Errors, each with the id of its finding.
    #[must_use]
    pub fn errors(&self) -> Vec<(Option<String>, String)> {
        match self {
            Self::Not => Vec::new(),
            Self::Findings(findings) => {
                let errors = findings.iter().filter(|f| f.severity == Severity::Error);
                let of = |f: &Finding| (Some(f.id.to_string()), f.text());
                errors.map(of).collect()
            }
            Self::Stopped(error) => vec![(None, error.clone())],
        }
    }
}
