//! Where bodies and tracker are, in a line each.

use crate::{ContactPoint, Report, Transform, Unit, number};

/// So many are shown where they are all that was looked for.
const FEW: usize = 3;

/// Whether the transforms are what the run was made for: nothing of the robot itself was estimated, as in a hand-eye calibration.
pub(crate) fn is_the_result(report: &Report) -> bool {
    let few = (1..=FEW).contains(&report.transforms.len());
    few && report.changes.is_empty() && report.robot_changes.is_empty()
}

/// `hand in gripper: x y z 55.02 ± 0.05, −40.11 ± 0.05, 35.07 ± 0.06 mm; roll pitch yaw …`
pub(crate) fn line(transform: &Transform) -> String {
    let three = |values: [f64; 3], sigma: Option<[f64; 3]>, unit: Unit| {
        let one = |k: usize| number::bare_with_sigma(values[k], sigma.map(|s| s[k]), unit);
        let all = [0, 1, 2].map(one).join(", ");
        format!("{all}{}", unit.display().1)
    };
    format!(
        "{} in {}: x y z {}; roll pitch yaw {}",
        transform.child,
        transform.parent,
        three(
            transform.translation_m,
            transform.sigma_translation_m,
            Unit::Meter
        ),
        three(
            transform.rpy_rad,
            transform.sigma_rotation_rad,
            Unit::Radian
        ),
    )
}

/// Directions of a pose.
const ALL: usize = 6;

/// What is known of it.
pub(crate) fn status(transform: &Transform) -> String {
    let word = transform.status.word();
    match transform.unobservable.len() {
        _ if transform.observable => word.to_owned(),
        ALL.. => "not observable".to_owned(),
        _ => format!("{word} in part"),
    }
}

/// The same in a word or two, for a narrow table.
pub(crate) fn short_status(transform: &Transform) -> &'static str {
    match transform.unobservable.len() {
        _ if transform.observable => transform.status.word(),
        ALL.. => "open",
        _ => "in part",
    }
}

/// Heading of [`contact_points`] on a terminal.
pub(crate) const CONTACT_POINTS: &str = "Contact points in their links [mm]";

/// Name and coordinates with σ of every contact point, mm.
pub(crate) fn contact_points(report: &Report) -> Vec<[String; 4]> {
    let row = |point: &ContactPoint| {
        let cell = |i: usize| {
            let sigma = point.sigma_m.map(|sigma| sigma[i]);
            number::bare_with_sigma(point.position_m[i], sigma, Unit::Meter)
        };
        [point.name.clone(), cell(0), cell(1), cell(2)]
    };
    report.contact_points.iter().map(row).collect()
}
