//! Clocks of the recordings.

use super::prose::{full_stop, or, short};
use crate::{Clock, ClockCheck, Report, Unit, number};

impl ClockCheck {
    /// What was done about the clocks, as a clause.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::NotNeeded => "each row holds the joints and the tracker data of one static pose",
            Self::NotTested => {
                "joints and tracker share the rows of one table; their offset was not tested"
            }
            Self::Aligned => "the streams were aligned",
            Self::Noticed => {
                "a finding says that joint values and tracker data of its rows are not of the same time"
            }
        }
    }
}

impl Clock {
    fn sentence(&self) -> String {
        let verdict = match (self.check, self.agrees) {
            (ClockCheck::NotNeeded, _) => "not needed",
            (_, Some(true)) => "yes",
            (ClockCheck::Aligned, Some(false)) => "no, but they were aligned by the motion",
            (_, Some(false)) => "no",
            (_, None) => "not tested",
        };
        let offset = self.offset_s.map_or_else(String::new, |offset| {
            let offset = number::change(offset, self.sigma_s, Unit::Second);
            format!(", {} relative to {} {offset}", self.clock, self.against)
        });
        let text = if self.text.is_empty() {
            String::new()
        } else {
            format!(": {}", self.text)
        };
        full_stop(&format!("{verdict}{offset}{text}"))
    }
}

pub(crate) fn clocks(report: &Report, rest: &str) -> Vec<String> {
    let lines: Vec<String> = match report.clocks.as_slice() {
        // One answer for everything needs no name.
        [only] => vec![super::prose::capital(&only.sentence())],
        all => all
            .iter()
            .map(|clock| format!("{}: {}", clock.recording, clock.sentence()))
            .collect(),
    };
    or(
        short(&lines, rest),
        "Not compared: no recording has two clocks.",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_that_a_finding_says_are_apart_were_not_synchronized() {
        let of = |check, agrees| {
            let clock = Clock {
                check,
                agrees,
                ..Clock::default()
            };
            clock.sentence()
        };
        assert_eq!(
            of(ClockCheck::Aligned, Some(false)),
            "no, but they were aligned by the motion."
        );
        assert_eq!(of(ClockCheck::Aligned, Some(true)), "yes.");
        assert_eq!(of(ClockCheck::Noticed, Some(false)), "no.");
    }
}
