//! Clocks of the recordings.

use super::prose::{capital, or, sentence, short};
use crate::{Clock, Report, Unit, number};

pub(crate) fn clocks(report: &Report, rest: &str) -> Vec<String> {
    let line = |clock: &Clock| {
        let verdict = match clock.agrees {
            Some(true) => "yes",
            Some(false) => "no",
            None => "not known",
        };
        let offset = clock.offset_s.map_or_else(String::new, |offset| {
            format!(
                ", {} against {} {}",
                clock.clock,
                clock.against,
                number::change(offset, clock.sigma_s, Unit::Second)
            )
        });
        let text = if clock.text.is_empty() {
            String::new()
        } else {
            format!(": {}", clock.text)
        };
        // One answer for everything needs no name.
        if clock.recording == "all" {
            sentence(&format!("{}{offset}{text}", capital(verdict)))
        } else {
            sentence(&format!("{}: {verdict}{offset}{text}", clock.recording))
        }
    };
    let lines: Vec<String> = report.clocks.iter().map(line).collect();
    or(
        short(&lines, rest),
        "Not compared: no recording has two clocks.",
    )
}
