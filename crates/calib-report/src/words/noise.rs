//! The noise of the measurements.

use super::prose::{capital, full_stop, or, short};
use crate::{Noise, NoiseKind, Report, number};

impl Noise {
    /// How the level was determined.
    #[must_use]
    pub fn method(estimated: bool) -> &'static str {
        if estimated {
            "variance components (REML)"
        } else {
            "as stated"
        }
    }

    fn sentence(&self) -> String {
        let group = capital(&self.group);
        match self.sigma {
            Some(sigma) => {
                let stated = self.stated.map_or_else(String::new, |stated| {
                    format!(" (stated: {})", number::sigma(Some(stated), self.unit))
                });
                let sigma = number::sigma(Some(sigma), self.unit);
                format!("{group}: σ = {sigma} per component{stated}.")
            }
            None if self.text.is_empty() => format!("{group}: not observable."),
            None => format!("{group}: not observable, {}", full_stop(&self.text)),
        }
    }
}

pub(crate) fn noise(report: &Report, rest: &str) -> Vec<String> {
    // The question is about the tracker; the joints follow.
    let (joints, tracker): (Vec<&Noise>, Vec<&Noise>) = report
        .noise
        .iter()
        .partition(|noise| noise.kind == NoiseKind::Joint);
    let lines: Vec<String> = tracker
        .iter()
        .chain(&joints)
        .map(|noise| noise.sentence())
        .collect();
    or(short(&lines, rest), "Not estimated.")
}
