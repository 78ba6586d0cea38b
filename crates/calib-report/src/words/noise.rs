//! The noise of the measurements.

use super::prose::{capital, full_stop, or, short};
use crate::{Noise, Report, number};

pub(crate) fn noise(report: &Report, rest: &str) -> Vec<String> {
    // The question is about the tracker; the joints come after it.
    let (joints, tracker): (Vec<&Noise>, Vec<&Noise>) = report
        .noise
        .iter()
        .partition(|noise| noise.group.starts_with("joint"));
    let line = |noise: &&Noise| match noise.sigma {
        Some(sigma) => {
            let stated = noise.stated.map_or_else(String::new, |stated| {
                format!(" (stated: {})", number::sigma(Some(stated), noise.unit))
            });
            format!(
                "{}: σ = {} per component{stated}.",
                capital(&noise.group),
                number::sigma(Some(sigma), noise.unit)
            )
        }
        None if noise.text.is_empty() => format!("{}: not known.", capital(&noise.group)),
        None => format!(
            "{}: not known, {}",
            capital(&noise.group),
            full_stop(&noise.text)
        ),
    };
    let lines: Vec<String> = tracker.iter().chain(&joints).map(line).collect();
    or(short(&lines, rest), "Not estimated.")
}
