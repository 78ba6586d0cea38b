//! The noise of the measurements.

use super::prose::{capital, full_stop, or, short};
use crate::{Noise, NoiseChoice, NoiseKind, NoiseModel, Report, Tails, WidthSource, number};

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
        .partition(|noise| matches!(noise.kind, NoiseKind::Joint | NoiseKind::Slide));
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
            Self::JointAndSlide => {
                "the joint positions, one level for the joints that turn and one for those that slide"
            }
            Self::BodyPose => "the pose of each body",
            Self::JointEach => "the joint positions, a level each",
        }
    }
}

/// What was taken, and what the rejected measurements say.
pub(crate) fn choice(choice: &NoiseChoice) -> String {
    let mut text = format!(
        "Noise from pose to pose, beside that of each measurement: {}, selected by leave-one-out prediction over {} poses.",
        choice.chosen.words(),
        choice.poses
    );
    if choice.rejected > 0 {
        text += &format!(
            " {} of {} rejected measurements were readmitted, because they improve the predictions.",
            choice.readmitted, choice.rejected
        );
    }
    text
}

/// What heavy tails of the residuals mean.
pub(crate) fn tails(tails: &Tails) -> String {
    let of = |degrees: f64| number::fixed(degrees, usize::from(degrees < 10.0));
    format!(
        "The residuals have heavier tails than normal noise: Student's t with {} degrees of freedom (95 % interval: {} to {}). Large errors are common: keep `robust` on, and read the stated intervals as those of the bulk of the measurements.",
        of(tails.degrees_of_freedom),
        of(tails.least),
        of(tails.most)
    )
}
