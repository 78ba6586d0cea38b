//! What the data leave open at the tool.

use super::prose::code;
use crate::{OpenDirection, RobotSize, Unit, WeakDirections, WeakTerm, number};

impl RobotSize {
    /// "The size of the robot: ±0.6 %, 3.2 mm at the reach of 540 mm, 98 % from the prior."
    #[must_use]
    pub fn sentence(&self) -> String {
        format!(
            "The size of the robot, in the tracker's unit of length: ±{}, {} at the reach of {}; {} of this is determined by the priors.",
            relative(self.sigma),
            number::plain(self.at_reach_m(), Unit::Meter),
            number::plain(self.reach_m, Unit::Meter),
            number::percent(self.prior_share)
        )
    }

    /// What to do where the data do not see it.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        "Provide one length: a ball bar, two places at a known distance, or a tracked body on the robot."
    }
}

/// A ratio in percent with two digits.
fn relative(ratio: f64) -> String {
    let percent = 100.0 * ratio;
    let decimals = if percent >= 1.0 {
        1
    } else if percent >= 0.1 {
        2
    } else {
        3
    };
    format!("{percent:.decimals$} %")
}

/// The same with its sign.
fn signed(ratio: f64) -> String {
    let sign = if ratio < 0.0 { "−" } else { "+" };
    format!("{sign}{}", relative(ratio.abs()))
}

/// What was predicted where, and how much of its uncertainty the data decided.
pub(crate) fn summary(weak: &WeakDirections) -> Vec<String> {
    let length = |m| number::plain(m, Unit::Meter);
    let seen = if weak.placed {
        "in the tracker's frame"
    } else {
        "up to a rigid motion of the whole robot"
    };
    let recorded = weak.recorded_rms_sigma_m.map_or_else(String::new, |m| {
        format!(" (the postures of the fit: {} rms)", length(m))
    });
    let mut lines = vec![format!(
        "Predicted position of {} {seen}, over {} postures spread over the recorded joint ranges, joints combined freely: σ = {} rms, {} maximum{recorded}. The priors determine {} of the variance, {} rms.",
        code(&weak.point),
        weak.postures,
        length(weak.rms_sigma_m),
        length(weak.max_sigma_m),
        number::percent(weak.prior_share),
        length(weak.held_by_prior_m())
    )];
    if weak.unbounded {
        lines.push(
            "A combination of parameters that neither data nor priors determine moves it as well: the values here exclude it."
                .to_owned(),
        );
    }
    if let Some(size) = weak.size.filter(|size| size.sigma > 0.0) {
        let mut line = size.sentence();
        if size.is_unseen() {
            line += " The data do not see it.";
            if let Some(change) = size.change {
                line += &format!(
                    " The fit changed it by {}, which no measurement supports.",
                    signed(change)
                );
            }
            line.push(' ');
            line += size.remedy();
        }
        lines.push(line);
    }
    lines
}

/// "`j2.origin.z` +1.2 mm, `tip.x` −0.8 mm"; of what is neither a length nor an angle, the name.
pub(crate) fn terms(direction: &OpenDirection) -> String {
    let term = |t: &WeakTerm| match t.unit {
        Unit::Meter | Unit::Radian => {
            let change = number::change(t.change, None, t.unit);
            format!("{} {change}", code(&t.parameter))
        }
        _ => code(&t.parameter),
    };
    let all: Vec<String> = direction.terms.iter().take(TERMS).map(term).collect();
    let more = direction.terms.len().saturating_sub(TERMS);
    let more = if more > 0 { ", …" } else { "" };
    all.join(", ") + more
}

/// Parameters named per combination; `report.json` has more.
const TERMS: usize = 4;
