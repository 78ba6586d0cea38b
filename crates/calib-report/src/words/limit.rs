//! Limits of the profile, and what was measured against them.

use crate::{Limit, Limited, Outcome, Unit, number};

/// What the limits of the profile are about.
impl Limited {
    /// rms position error; `left_out` where each fitted pose was left out in turn.
    #[must_use]
    pub fn position_rms(left_out: bool) -> Self {
        Self::held_out(
            "held_out_rms_mm",
            "rms position error",
            Unit::Meter,
            left_out,
        )
    }

    /// Largest position error.
    #[must_use]
    pub fn position_max(left_out: bool) -> Self {
        Self::held_out(
            "held_out_max_mm",
            "largest position error",
            Unit::Meter,
            left_out,
        )
    }

    /// rms orientation error.
    #[must_use]
    pub fn orientation_rms(left_out: bool) -> Self {
        Self::held_out(
            "held_out_rms_deg",
            "rms orientation error",
            Unit::Radian,
            left_out,
        )
    }

    /// Largest orientation error.
    #[must_use]
    pub fn orientation_max(left_out: bool) -> Self {
        Self::held_out(
            "held_out_max_deg",
            "largest orientation error",
            Unit::Radian,
            left_out,
        )
    }

    /// Mean translation error of a loop.
    #[must_use]
    pub fn loop_mean(name: &str) -> Self {
        Self {
            name: format!("loop_mean_mm.{name}"),
            quantity: format!("mean translation error of loop `{name}`"),
            unit: Unit::Meter,
        }
    }

    /// Standard deviation of the position of a transform.
    #[must_use]
    pub fn origin_sigma(name: &str) -> Self {
        Self {
            name: "origin_sigma_mm".to_owned(),
            quantity: format!("standard deviation of the position of `{name}`"),
            unit: Unit::Meter,
        }
    }

    fn held_out(name: &str, quantity: &str, unit: Unit, left_out: bool) -> Self {
        let poses = if left_out {
            ", leave-one-out"
        } else {
            " on held-out poses"
        };
        Self {
            name: name.to_owned(),
            quantity: format!("{quantity}{poses}"),
            unit,
        }
    }

    /// The limit where nothing was measured that it speaks of.
    #[must_use]
    pub fn unknown(self, limit: f64) -> Limit {
        let reason = match self.unit {
            Unit::Radian => "no measured orientation on validation poses",
            _ => "no validation poses",
        };
        Limit::not_evaluated(self, limit, reason)
    }
}

impl Limit {
    /// The limit as a reason for the verdict: value, interval, limit and outcome.
    #[must_use]
    pub fn sentence(&self) -> String {
        let plain = |value| number::plain(value, self.unit);
        let interval = match (self.low, self.high) {
            (Some(low), Some(high)) => {
                format!(" (95 % interval {} to {})", plain(low), plain(high))
            }
            _ => String::new(),
        };
        match (self.outcome, self.value) {
            (Outcome::NotEvaluated, _) | (_, None) => {
                format!("{}: not evaluated ({}).", self.quantity, self.reason)
            }
            (outcome, Some(value)) => format!(
                "{}: {}{interval}, limit {} ({}).",
                self.quantity,
                plain(value),
                plain(self.limit),
                outcome.word()
            ),
        }
    }
}
