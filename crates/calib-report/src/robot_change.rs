//! What changed of the robot itself, in numbers that no choice of frames changes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Unit;

/// A quantity of the robot that does not depend on the choice of frames, before and after: the distance between two axes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RobotChange {
    /// Stable name: `distance.shoulder.elbow`.
    pub name: String,
    /// In words: "distance between the axes of shoulder and elbow".
    pub text: String,
    /// SI unit of the numbers.
    pub unit: Unit,
    /// By the nominal model; null where it has no such number.
    pub nominal: Option<f64>,
    /// By the calibration.
    pub value: f64,
    /// value − nominal, an angle by the shorter way round; null where there is no nominal value.
    pub change: Option<f64>,
    /// Standard deviation of `value`; null where it is unknown.
    pub sigma: Option<f64>,
    /// Whether the data alone determine it.
    pub measured: bool,
}

impl RobotChange {
    /// |change| in standard deviations; `None` where either is unknown or σ is 0.
    #[must_use]
    pub fn significance(&self) -> Option<f64> {
        let sigma = self.sigma.filter(|sigma| *sigma > 0.0)?;
        Some(self.change?.abs() / sigma).filter(|z| z.is_finite())
    }

    /// Most significant first; what the data do not determine comes last.
    #[must_use]
    pub fn sorted(mut changes: Vec<Self>) -> Vec<Self> {
        let rank = |c: &Self| (c.measured, c.significance().unwrap_or(-1.0));
        changes.sort_by(|a, b| {
            let ((of_a, z_a), (of_b, z_b)) = (rank(a), rank(b));
            of_b.cmp(&of_a).then(z_b.total_cmp(&z_a))
        });
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_significant_change_comes_first_and_what_is_not_measured_last() {
        let change = |name: &str, change: f64, sigma: f64, measured| RobotChange {
            name: name.into(),
            change: Some(change),
            sigma: Some(sigma),
            measured,
            ..RobotChange::default()
        };
        let sorted = RobotChange::sorted(vec![
            change("large", 9e-3, 9e-3, true),
            change("open", 1.0, 1e-9, false),
            change("significant", -7e-5, 1e-5, true),
        ]);
        let names: Vec<&str> = sorted.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["significant", "large", "open"]);
        assert_eq!(change("exact", 1.0, 0.0, true).significance(), None);
    }
}
