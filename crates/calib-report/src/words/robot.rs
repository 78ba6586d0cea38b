//! What changed of the robot itself.

use super::prose::{capital, code, counted};
use crate::{Class, Report, RobotChange, Unit, number};

/// A change is significant beyond this many standard deviations: about 1 % of unchanged numbers are.
pub(crate) const SIGNIFICANT: f64 = 2.6;

/// Kinds of parameters whose value alone depends on a choice of frames, or on where bodies and tracker stood.
const PLACES: [&str; 3] = ["translation", "rotation", "point"];

/// Effects of the joints that the data determine, as changes: a gain, a compliance, a zero offset.
pub(crate) fn effects(report: &Report) -> Vec<RobotChange> {
    let parameters = report.parameters.iter();
    let own = parameters.filter(|p| {
        p.joint.is_some() && p.class == Class::Solid && !PLACES.contains(&p.kind.as_str())
    });
    RobotChange::sorted(
        own.map(|p| RobotChange {
            name: p.name.clone(),
            text: p.name.clone(),
            unit: p.unit,
            nominal: Some(p.nominal),
            value: p.value,
            change: Some(p.value - p.nominal),
            sigma: p.sigma,
            measured: true,
        })
        .collect(),
    )
}

/// "Distance between the axes of shoulder and elbow: 375.000 mm → 375.090 ± 0.041 mm."
pub(crate) fn sentence(change: &RobotChange) -> String {
    let [before, after] = before_and_after(change);
    let what = match change.text == change.name {
        true => code(&change.name),
        false => capital(&change.text),
    };
    format!("{what}: {before} → {after}.")
}

/// Nominal value and value ± σ, both rounded by σ.
pub(crate) fn before_and_after(change: &RobotChange) -> [String; 2] {
    let before = change.nominal.map_or_else(
        || number::UNKNOWN.to_owned(),
        |x| number::rounded_by_sigma(x, change.sigma, change.unit),
    );
    [
        before,
        number::with_sigma(change.value, change.sigma, change.unit),
    ]
}

/// `12 σ`, or a dash.
pub(crate) fn significance(change: &RobotChange) -> String {
    change.significance().map_or_else(
        || number::UNKNOWN.to_owned(),
        |z| format!("{} σ", number::bare(z, Unit::One)),
    )
}

/// What changed, in a few sentences: the most significant first.
pub(crate) fn changed(report: &Report) -> Vec<String> {
    let all = RobotChange::sorted([report.robot_changes.clone(), effects(report)].concat());
    let significant: Vec<&RobotChange> = all
        .iter()
        .filter(|c| c.measured && c.significance().is_some_and(|z| z > SIGNIFICANT))
        .collect();
    if all.is_empty() {
        return Vec::new();
    }
    let mut lines: Vec<String> = significant.iter().take(2).map(|c| sentence(c)).collect();
    match significant.len() {
        0 => lines.push("No measured dimension of the robot changed significantly.".to_owned()),
        n if n > 2 => lines.push(format!("… and {} more below.", n - 2)),
        _ => {}
    }
    lines
}

/// What no σ of a length holds: the instrument's own scale.
pub(crate) fn scale(changes: &[RobotChange]) -> Option<String> {
    let lengths = changes
        .iter()
        .filter(|c| c.unit == Unit::Meter && c.sigma.is_some());
    let longest = lengths.map(|c| c.value.abs()).fold(0.0, f64::max);
    (longest > 0.0).then(|| {
        format!(
            "No σ includes the scale of the measuring instrument: where its unit of length is off by 0.01 %, every length is, the longest of these by {}.",
            number::fixed_with_unit(1e-4 * longest, Unit::Meter, 2)
        )
    })
}

/// How the parameters of the fit are known: "61 parameters: 21 identifiable, 40 arbitrary conventions."
pub(crate) fn parameters(report: &Report) -> Option<String> {
    let of = |classes: &[Class]| {
        let parameters = report.parameters.iter();
        parameters.filter(|p| classes.contains(&p.class)).count()
    };
    let parts = [
        (of(&[Class::Solid]), "identifiable"),
        (of(&[Class::Weak]), "weakly identifiable"),
        (of(&[Class::Prior]), "known by their priors only"),
        (of(&[Class::NotObservable]), "not identifiable"),
        (of(&[Class::Convention]), "arbitrary conventions"),
    ];
    let shown: Vec<String> = parts
        .into_iter()
        .filter(|(n, _)| *n > 0)
        .map(|(n, what)| format!("{n} {what}"))
        .collect();
    let all = report.parameters.len();
    (all > 0).then(|| format!("{}: {}.", counted(all, "parameter"), shown.join(", ")))
}

/// What the conventions mean.
pub(crate) const CONVENTIONS: &str = "The position of an origin along its joint axis and its rotation about that axis are arbitrary. Two equally good calibrations may differ by millimeters there; no prediction changes.";
