//! The noise of the measurements.

use super::prose::{capital, full_stop, or, short};
use crate::{Noise, NoiseChoice, NoiseKind, NoiseModel, Report, WidthSource, number};

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

impl WidthSource {
    /// Where a prior width is from.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Stated => "as stated",
            Self::Default => "default",
            Self::Found => "marginal likelihood",
        }
    }
}

impl NoiseModel {
    /// What is random from pose to pose.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::White => "none (ordinary least squares)",
            Self::Joint => "the joint positions, one level",
            Self::BodyPose => "the pose of each body",
            Self::JointEach => "the joint positions, a level each",
        }
    }
}

/// What was taken, and what the tails and the rejected measurements say.
pub(crate) fn choice(choice: &NoiseChoice) -> String {
    /// Normal noise of 100 vectors exceeds this in one of 100 fits.
    const HEAVY: f64 = 1.5;
    let mut text = format!(
        "Noise from pose to pose, beside that of each measurement: {}, selected by leave-one-out prediction over {} poses.",
        choice.chosen.words(),
        choice.poses
    );
    if choice.tails > HEAVY {
        text += &format!(
            " The tails of the leave-one-out errors are {} times those of normal noise: keep `robust` on.",
            number::fixed(choice.tails, 1)
        );
    }
    if choice.rejected > 0 {
        text += &format!(
            " {} of {} rejected measurements were readmitted, because they improve the predictions.",
            choice.readmitted, choice.rejected
        );
    }
    text
}
