//! The uncertainty budget in words.

use super::prose::code;
use crate::budget::{Budget, COVERAGE_FACTOR, Evaluation};
use crate::{ErrorSource, Report, Unit, number};
use calib_finding::printable_line;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Below this many degrees of freedom k = 2 covers less than 94.5 % of a normal error: the factor for 95 % is stated.
const FEW: f64 = 28.0;

impl Evaluation {
    /// As in a budget's column.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
            Self::AAndB => "A, B",
        }
    }
}

impl ErrorSource {
    /// What was evaluated, and where its number comes from.
    pub(crate) fn input(self) -> &'static str {
        match self {
            Self::TrackerNoise => "tracker noise, one component",
            Self::JointNoise => "joint noise",
            Self::Parameters => "geometry (covariance of the parameters)",
            Self::NotModeled => "unexplained part of the held-out errors",
        }
    }
}

/// What the budget is of.
pub(crate) fn measurand(report: &Report) -> String {
    let held_out = report.verification.held_out.as_ref();
    let left_out = held_out.is_some_and(|held_out| held_out.left_out);
    let poses = if left_out {
        "on poses left out in turn"
    } else {
        "on a new pose"
    };
    format!(
        "Of the error in the predicted position of a tracked body {poses}, as the tracker measures it: length in space, root mean square over poses like the held-out ones. Type A: evaluated from the data; type B: stated by the profile or a prior. All distributions are taken as normal."
    )
}

/// The line for a certificate.
pub(crate) fn certificate(report: &Report, budget: &Budget) -> String {
    let length = |m: f64| number::plain(m, Unit::Meter);
    let freedom = freedom(budget.freedom);
    let robot = budget.robot_m.map_or_else(String::new, |m| {
        let [u, expanded] = [m, COVERAGE_FACTOR * m].map(length);
        format!("\nWithout the noise of the tracker's measurement (the robot itself): u = {u}, U = {expanded} (k = 2)")
    });
    let [u, expanded] = [budget.combined_m, budget.expanded_m()].map(length);
    format!(
        "{}: position error on a new pose, u = {u}, U = {expanded} (k = 2), effective degrees of freedom {freedom}{robot}",
        printable_line(&report.robot)
    )
}

/// What k = 2 covers.
pub(crate) fn coverage(budget: &Budget) -> String {
    let mut text = String::from(
        "U covers 95 % of the errors where they lie along one line, and 99 % where they are alike in all directions.",
    );
    let factor = budget.freedom.filter(|freedom| *freedom < FEW);
    let student = factor.and_then(|freedom| StudentsT::new(0.0, 1.0, freedom).ok());
    if let Some(student) = student {
        let k = number::fixed(student.inverse_cdf(0.975), 2);
        text = format!(
            "{text} With so few degrees of freedom, 95 % along one line takes k = {k} (Student's t)."
        );
    }
    text
}

/// `26`, `∞` for what is taken as exactly known, `< 1` for a small difference of large numbers.
pub(crate) fn freedom(freedom: Option<f64>) -> String {
    freedom.map_or_else(
        || "∞".to_owned(),
        |nu| match nu {
            ..1.0 => "< 1".to_owned(),
            ..10.0 => number::fixed(nu, 1),
            _ => number::fixed(nu, 0),
        },
    )
}

/// The heads of the table: text of the units in the last two columns.
pub(crate) fn caption(report: &Report) -> String {
    format!("Uncertainty budget of {}:", code(&report.robot))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_of_freedom_are_never_none_at_all() {
        assert_eq!(freedom(None), "∞");
        assert_eq!(freedom(Some(0.02)), "< 1");
        assert_eq!(freedom(Some(3.21)), "3.2");
        assert_eq!(freedom(Some(26.4)), "26");
    }
}
