//! What mends a column that is in another unit than it was read in: another name, or other values.

use calib_checks::structural::{JointIndex, Scope, UnitMistake};
use calib_finding::{Fact, Finding};
use calib_recording::{JointColumn, LengthUnit};

use super::layout::Layout;

/// What to do about a column.
#[derive(Debug, PartialEq)]
enum Remedy {
    /// The unit in its name is wrong, or there is none: this name states the right one.
    Rename(String),
    /// It states the right unit: its values were converted twice.
    Twice,
}

/// The finding with the column of this joint, or of the first joint that a unit of all is about, and what mends it.
pub(super) fn with_remedy(
    layout: &Layout<'_>,
    finding: Finding,
    joint: Option<JointIndex>,
    mistake: UnitMistake,
    scope: Scope,
) -> Finding {
    let joints = || {
        let all = (0..layout.inputs.robot.model.joints().len()).map(JointIndex);
        let concerned = all.filter(|j| layout.data.chain.turns(j.0) == Some(mistake.of_angles()));
        concerned.filter(|j| joint.is_none_or(|one| one == *j))
    };
    let names = layout.recordings_in(scope);
    let recordings = || {
        let all = layout.recordings.iter();
        all.filter(|recording| names.contains(&recording.name.as_str()))
    };
    let columns = joints().flat_map(|joint| {
        let name = layout.joint(joint);
        recordings().filter_map(move |recording| recording.meta.joint_columns.get(name))
    });
    let columns: Vec<&JointColumn> = columns.collect();
    // Of all columns one that another name mends, where there is one.
    let renamed = columns.iter().find(|c| remedy(c, mistake) != Remedy::Twice);
    match renamed.or(columns.first()) {
        Some(column) => match remedy(column, mistake) {
            Remedy::Rename(name) => finding
                .with("column", Fact::name(&column.name))
                .with("rename", Fact::name(name)),
            Remedy::Twice => finding.with("twice", Fact::name(&column.name)),
        },
        None => {
            let joint = joints().next().map(|joint| layout.joint(joint));
            finding.with("unnamed", Fact::name(joint.unwrap_or_default()))
        }
    }
}

fn remedy(column: &JointColumn, mistake: UnitMistake) -> Remedy {
    let length = |smaller: f64| {
        let read = LengthUnit::from_name(column.unit)?.per_meter();
        let mut all = LengthUnit::ALL.into_iter();
        let unit = all.find(|unit| (unit.per_meter() / read / smaller - 1.0).abs() < 1e-9);
        unit.map(LengthUnit::name)
    };
    let unit = match mistake {
        UnitMistake::DegreesReadAsRadians => (column.unit == "rad").then_some("deg"),
        UnitMistake::RadiansReadAsDegrees => (column.unit == "deg").then_some("rad"),
        UnitMistake::Length { .. } => length(mistake.factor().recip()),
    };
    let Some(unit) = unit else {
        return Remedy::Twice;
    };
    let stem = column.name.strip_suffix(column.unit);
    let stem = stem.and_then(|stem| stem.strip_suffix('_'));
    Remedy::Rename(format!("{}_{unit}", stem.unwrap_or(&column.name)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_checks::structural::Length;
    use calib_finding::{Subject, catalog};

    #[test]
    fn a_name_that_states_the_unit_already_is_not_asked_for() {
        use UnitMistake::{DegreesReadAsRadians, RadiansReadAsDegrees};
        let small = UnitMistake::MILLIMETERS_READ_AS_METERS;
        let large = UnitMistake::METERS_READ_AS_MILLIMETERS;
        let ten = UnitMistake::Length {
            unit: Length::Centimeter,
            read_as: Length::Millimeter,
        };
        let rename = |name: &str| Remedy::Rename(name.to_owned());
        for (name, unit, mistake, wanted) in [
            ("a5_rad", "rad", DegreesReadAsRadians, rename("a5_deg")),
            ("A5", "rad", DegreesReadAsRadians, rename("A5_deg")),
            ("a5_deg", "deg", DegreesReadAsRadians, Remedy::Twice),
            ("A5", "deg", RadiansReadAsDegrees, rename("A5_rad")),
            ("a5_rad", "rad", RadiansReadAsDegrees, Remedy::Twice),
            ("rail_m", "m", small, rename("rail_mm")),
            ("rail_mm", "mm", small, rename("rail_um")),
            ("rail_um", "um", small, Remedy::Twice),
            ("rail_mm", "mm", large, rename("rail_m")),
            ("rail_m", "m", large, Remedy::Twice),
            ("rail_mm", "mm", ten, rename("rail_cm")),
            ("rail_m", "m", ten, Remedy::Twice),
        ] {
            let column = JointColumn {
                name: name.to_owned(),
                unit,
            };
            assert_eq!(remedy(&column, mistake), wanted, "{name} {mistake:?}");
        }
        let of = |key, name: &str| {
            let subject = Subject::joint("a5");
            let finding = Finding::of_kind(catalog::UNIT_MISMATCH, "joint_degrees", subject);
            finding.with(key, Fact::name(name)).remedy()
        };
        let twice = of("twice", "a5_deg");
        assert!(
            !twice.contains("Rename") && twice.contains("twice"),
            "{twice}"
        );
        assert!(of("unnamed", "a5").contains("joint `a5` where it was recorded"));
    }
}
