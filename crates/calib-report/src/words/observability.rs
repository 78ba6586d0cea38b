//! What is not observable: the words of causes, combinations of parameters and degrees of freedom.

use super::prose::{or, sentence};
use crate::{Cause, Meaning, NotObservable, Report, Term, Transform, Unobservable};

/// Parameters of a combination that are named; the rest is counted.
const NAMED: usize = 4;

/// Items in the short answer, which shares the first screen with the others; the rest is counted.
const ANSWERED: usize = 2;

/// Where nothing is missing.
pub(crate) const ALL_OBSERVABLE: &str = "All requested quantities are observable.";

/// The answer to "what is not observable?", in short.
pub(crate) fn unobservable(report: &Report, rest: &str) -> Vec<String> {
    if report.transforms.is_empty() && report.parameters.is_empty() {
        return vec!["Nothing was solved.".to_owned()];
    }
    let items = report.not_observable.iter();
    let of = |meaning: Meaning| items.clone().filter(move |item| item.meaning == meaning);
    let measured = of(Meaning::NotMeasured).map(|item| sentence(&item.in_short()));
    let open = report.transforms.iter().filter(|t| !t.observable);
    let all: Vec<String> = measured.chain(open.map(degrees_of_freedom)).collect();
    let mut lines: Vec<String> = all.iter().take(ANSWERED).cloned().collect();
    if all.len() > ANSWERED {
        lines.push(format!("… and {} more {rest}.", all.len() - ANSWERED));
    }
    match of(Meaning::Convention).count() {
        0 => {}
        1 => lines.push(
            "1 parameter combination is an arbitrary convention; no prediction depends on it."
                .to_owned(),
        ),
        n => lines.push(format!(
            "{n} parameter combinations are arbitrary conventions; no prediction depends on them."
        )),
    }
    or(lines, ALL_OBSERVABLE)
}

/// "2 of the 6 degrees of freedom of `a_from_b` are not observable (rotation about y, translation along y)."
fn degrees_of_freedom(transform: &Transform) -> String {
    let open = &transform.unobservable;
    let verb = if open.len() == 1 { "is" } else { "are" };
    let motions: Vec<String> = open.iter().map(|u| motion(&u.direction, "")).collect();
    format!(
        "{} of the 6 degrees of freedom of `{}` {verb} not observable ({}).",
        open.len(),
        transform.name,
        motions.join(", ")
    )
}

impl Unobservable {
    /// Of a unit twist [ω; v] in axes of the child, with its words.
    #[must_use]
    pub fn along(direction: [f64; 6]) -> Self {
        Self {
            direction,
            text: format!(
                "the {} is not observable; the value comes from the prior",
                motion(&direction, "its ")
            ),
            remedy: "Usually none is needed: it is a convention between this frame and the next, and the combinations \
                     below name its counterpart. A mark or a second axis on the link would define it."
                .to_owned(),
        }
    }
}

/// "rotation about y", "translation along [0.71, 0.71, 0.00]", or both; `whose` stands before the axis.
fn motion(direction: &[f64; 6], whose: &str) -> String {
    /// A part of a unit twist below this is rounding.
    const NOTHING: f64 = 1e-6;
    let (w, v) = (&direction[..3], &direction[3..]);
    let rotation = || format!("rotation about {}", axis(w, whose));
    let translation = || format!("translation along {}", axis(v, whose));
    match (norm(w) > NOTHING, norm(v) > NOTHING) {
        (true, false) => rotation(),
        (false, true) => translation(),
        _ => format!("{} with a {}", rotation(), translation()),
    }
}

fn axis(a: &[f64], whose: &str) -> String {
    /// A direction this near to a coordinate axis (cosine, 0.6°) is called by its letter.
    const ON_AXIS: f64 = 0.999_95;
    let n = norm(a);
    let after = if whose.is_empty() { "" } else { " axis" };
    match a.iter().position(|c| c.abs() > ON_AXIS * n) {
        Some(k) => format!("{whose}{}{after}", ["x", "y", "z"][k]),
        None => {
            let [x, y, z] = [a[0] / n, a[1] / n, a[2] / n];
            let of = if whose.is_empty() {
                ""
            } else {
                "its direction "
            };
            format!("{of}[{x:.2}, {y:.2}, {z:.2}]")
        }
    }
}

fn norm(a: &[f64]) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

impl Cause {
    /// What it means for the user of the result.
    #[must_use]
    pub fn meaning(self) -> Meaning {
        match self {
            Self::WorldAgainstBase
            | Self::OffsetAgainstOwnOrigin
            | Self::OffsetAgainstNeighbor
            | Self::TranslationAlongAxis
            | Self::RotationAboutAxis
            | Self::ParallelAxes
            | Self::ToolAgainstLastOrigin
            | Self::MarkersAgainstMount => Meaning::Convention,
            // With other motion or another mark it would be observable.
            _ => Meaning::NotMeasured,
        }
    }

    /// The reason, without a full stop.
    #[must_use]
    pub fn reason(self) -> &'static str {
        match self {
            Self::NotMeasured => "no measurement depends on it",
            Self::JointNotMoved => {
                "the joint did not move in the fitted recordings; it keeps its nominal value"
            }
            Self::WorldAgainstBase => {
                "the measurements determine the pose of the robot as a whole, not of its base frame"
            }
            Self::OffsetAgainstOwnOrigin => {
                "a joint offset is indistinguishable from a rotation of the joint's own origin about its axis"
            }
            Self::OffsetAgainstNeighbor => {
                "a joint offset is indistinguishable from a rotation of the next frame about the joint axis"
            }
            Self::TranslationAlongAxis => {
                "a translation of one origin along the joint axis is indistinguishable from one of the next origin"
            }
            Self::RotationAboutAxis => {
                "a rotation of one origin about the joint axis is indistinguishable from one of the next origin"
            }
            Self::ParallelAxes => "the joint axes are parallel",
            Self::CollinearAxes => "the joint axes coincide in every pose",
            Self::ToolAgainstLastOrigin => {
                "only the combined pose of the last joint's origin and the mount of the body is observable"
            }
            Self::PointOnlyTool => {
                "the observed points do not determine the orientation of the body"
            }
            Self::MarkersAgainstMount => "only the markers of the body define its frame",
            Self::WorldAgainstTool => {
                "the joints that moved do not separate the pose of the tracker from the mount of the body"
            }
            Self::Scale => "a length and a gain have the same effect; no length is known",
            Self::LoadsAgainstCompliances => {
                "the measurements determine products of masses and compliances, not each of them"
            }
            Self::TableAgainstContact => "the contacts determine only their difference",
            Self::Combination | Self::Unstated => {
                "the measurements determine only their combination"
            }
        }
    }

    /// What to do about it: whole sentences.
    #[must_use]
    pub fn remedy(self) -> &'static str {
        match self {
            Self::NotMeasured => "Fix it, or add a marker distal to this joint.",
            Self::JointNotMoved => "Move it in a sweep or in static poses.",
            Self::WorldAgainstBase => {
                "Fix one of the two, or attach a tracked body to the base and measure it too."
            }
            Self::OffsetAgainstOwnOrigin => {
                "Free only one of the two: the offset or the rotation of the origin."
            }
            Self::OffsetAgainstNeighbor => {
                "Fix the offset (the zero of the URDF is a convention), or measure the mark that defines zero."
            }
            Self::TranslationAlongAxis | Self::RotationAboutAxis | Self::ParallelAxes => {
                "This does not affect predictions: fix one of them, or keep the prior."
            }
            Self::CollinearAxes => {
                "Move the joint between them so that the axes no longer coincide."
            }
            Self::ToolAgainstLastOrigin => {
                "Fix the mount or the last origin, or measure a second body on the last link."
            }
            Self::PointOnlyTool => "Put at least three markers that are not collinear on the body.",
            Self::MarkersAgainstMount => {
                "Fix the mount, or measure the marker positions on the body."
            }
            Self::WorldAgainstTool => "Move more joints, with axes that are not parallel.",
            Self::Scale => "Provide one length: a known marker distance or a known origin.",
            Self::LoadsAgainstCompliances => {
                "State what is known: a mass, a payload or a stiffness; or record postures in which the loads differ more."
            }
            Self::TableAgainstContact => "Measure the table or the contact point separately once.",
            Self::Combination | Self::Unstated => {
                "Fix one of them, or add motion of the joints between them."
            }
        }
    }
}

impl NotObservable {
    /// Of a combination of parameters, largest share first, with its words.
    #[must_use]
    pub fn new(cause: Cause, direction: Vec<Term>) -> Self {
        let subject = direction
            .first()
            .map_or_else(String::new, |t| t.parameter.clone());
        let combination = match others(&direction).as_str() {
            "" => format!("`{subject}`"),
            others => format!("`{subject}` is confounded with {others}"),
        };
        Self {
            meaning: cause.meaning(),
            cause,
            subject,
            direction,
            text: format!("{combination}: {}", cause.reason()),
            remedy: cause.remedy().to_owned(),
        }
    }

    /// Of a joint that did not move.
    #[must_use]
    pub fn joint_not_moved(joint: &str) -> Self {
        let cause = Cause::JointNotMoved;
        Self {
            meaning: cause.meaning(),
            cause,
            subject: joint.to_owned(),
            direction: Vec::new(),
            text: format!("`{joint}`: {}", cause.reason()),
            remedy: cause.remedy().to_owned(),
        }
    }

    /// The subject and the reason, without the other parameters: those stand in the long report.
    pub(crate) fn in_short(&self) -> String {
        match self.cause {
            Cause::Unstated => self.text.clone(),
            cause => format!("`{}`: {}", self.subject, cause.reason()),
        }
    }
}

/// "`b`, `c` and 2 more": every parameter but the first.
fn others(direction: &[Term]) -> String {
    let rest = direction.get(1..).unwrap_or_default();
    let shown = rest.len().min(NAMED - 1);
    let mut names: Vec<String> = rest[..shown]
        .iter()
        .map(|t| format!("`{}`", t.parameter))
        .collect();
    if rest.len() > shown {
        names.push(format!("{} more", rest.len() - shown));
    }
    match names.as_slice() {
        [] => String::new(),
        [one] => one.clone(),
        [all @ .., last] => format!("{} and {last}", all.join(", ")),
    }
}

/// Combinations with one cause as one item: (text, remedy).
pub(crate) fn grouped(items: &[&NotObservable]) -> Vec<(String, String)> {
    let mut out: Vec<(String, String)> = Vec::new();
    let mut groups: Vec<(Cause, &str, Vec<String>)> = Vec::new();
    for item in items {
        let others = others(&item.direction);
        if item.cause == Cause::Unstated || others.is_empty() {
            out.push((item.text.clone(), item.remedy.clone()));
            continue;
        }
        let combination = format!("`{}` with {others}", item.subject);
        match groups.iter_mut().find(|(cause, ..)| *cause == item.cause) {
            Some((.., combinations)) => combinations.push(combination),
            None => groups.push((item.cause, &item.remedy, vec![combination])),
        }
    }
    out.extend(groups.into_iter().map(|(cause, remedy, combinations)| {
        let list = combinations.join("; ");
        (format!("{}: {list}", cause.reason()), remedy.to_owned())
    }));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn terms(names: &[&str]) -> Vec<Term> {
        let term = |name: &&str| Term {
            parameter: (*name).to_owned(),
            coefficient: 1.0,
        };
        names.iter().map(term).collect()
    }

    #[test]
    fn a_combination_names_four_parameters_and_counts_the_rest() {
        let two = NotObservable::new(Cause::ParallelAxes, terms(&["a.z", "b.z"]));
        assert_eq!(
            two.text,
            "`a.z` is confounded with `b.z`: the joint axes are parallel"
        );
        assert_eq!(two.meaning, Meaning::Convention);
        let six = NotObservable::new(Cause::Combination, terms(&["a", "b", "c", "d", "e", "f"]));
        assert!(
            six.text
                .starts_with("`a` is confounded with `b`, `c`, `d` and 2 more: "),
            "{}",
            six.text
        );
        let one = NotObservable::new(Cause::NotMeasured, terms(&["a"]));
        assert_eq!(one.text, "`a`: no measurement depends on it");
    }

    #[test]
    fn degrees_of_freedom_are_named_by_their_axes() {
        let about_y = Unobservable::along([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        let along_y = Unobservable::along([0.0, 0.0, 0.0, 0.0, -1.0, 0.0]);
        assert!(
            about_y
                .text
                .starts_with("the rotation about its y axis is not observable")
        );
        let transform = Transform {
            name: "a_from_b".to_owned(),
            ..Transform::default()
        }
        .with_unobservable(vec![about_y, along_y]);
        assert_eq!(
            degrees_of_freedom(&transform),
            "2 of the 6 degrees of freedom of `a_from_b` are not observable (rotation about y, translation along y)."
        );
        let oblique = Unobservable::along([0.6, 0.8, 0.0, 0.0, 0.0, 0.0]);
        assert!(
            oblique
                .text
                .contains("rotation about its direction [0.60, 0.80, 0.00]")
        );
    }
}
