//! Mistakes in tables, corrected in the profile: columns exchanged, negated, or read in another unit. The tables themselves are never changed.

use calib_checks::structural::{Hypothesis, Scoped, UnitMistake};
use calib_recording::{AngleUnit, ColumnMap, LengthUnit};
use calib_urdf::{JointKind, RobotModel};

use crate::error::InitError;
use crate::fact::Mistake;
use crate::header::header;
use crate::name::{self, NamedUnit};
use crate::session::Draft;
use crate::source::Source;

/// The mistake in words that a profile can name.
#[must_use]
pub fn mistake(model: &RobotModel, bodies: &[String], hypothesis: &Hypothesis) -> Mistake {
    let joint = |j: calib_checks::structural::JointIndex| model.joints()[j.0].name.clone();
    match *hypothesis {
        Hypothesis::Sign { joint: j } => Mistake::Sign { joint: joint(j) },
        Hypothesis::Exchange { first, second } => Mistake::Exchange {
            first: joint(first),
            second: joint(second),
        },
        Hypothesis::Unit { joint: j, mistake } => Mistake::Unit {
            joint: Some(joint(j)),
            unit: really(mistake),
        },
        Hypothesis::Units { mistake } => Mistake::Unit {
            joint: None,
            unit: really(mistake),
        },
        Hypothesis::TrackerUnit { mistake } => Mistake::TrackerUnit {
            unit: really(mistake),
        },
        Hypothesis::Offset { joint: j, turns } => Mistake::Offset {
            joint: joint(j),
            degrees: turns.angle().to_degrees(),
        },
        Hypothesis::RowShift { rows } => Mistake::Rows { rows },
        Hypothesis::Mirrored => Mistake::Mirrored,
        Hypothesis::TrackerMoved | Hypothesis::TrackerAxes { .. } => Mistake::TrackerMoved,
        Hypothesis::Remounted { body } => Mistake::Remounted {
            body: bodies.get(body.0).cloned().unwrap_or_default(),
        },
        Hypothesis::Poses { .. } => Mistake::Poses,
        _ => Mistake::Other,
    }
}

/// The unit that the values really have.
fn really(mistake: UnitMistake) -> &'static str {
    match mistake {
        UnitMistake::DegreesReadAsRadians => "deg",
        UnitMistake::RadiansReadAsDegrees => "rad",
        UnitMistake::MillimetersReadAsMeters => "mm",
        UnitMistake::MetersReadAsMillimeters => "m",
    }
}

/// The sources with a mistake corrected in their column maps; `None` where no map corrects it.
///
/// # Errors
/// [`InitError::Recording`] where a file cannot be read by its new map.
pub fn corrected(
    model: &RobotModel,
    sources: &[Source],
    drafts: &[Draft],
    scoped: &Scoped,
) -> Result<Option<Vec<Source>>, InitError> {
    let mut new = sources.to_vec();
    for (r, draft) in drafts.iter().enumerate() {
        if !scoped
            .scope
            .contains(calib_checks::structural::RecordingIndex(r))
        {
            continue;
        }
        let of_tracker = matches!(scoped.hypothesis, Hypothesis::TrackerUnit { .. });
        let at = match draft.log {
            Some(log) if !of_tracker => log,
            _ => draft.source,
        };
        let Some(map) = new_map(model, &sources[at], &scoped.hypothesis) else {
            return Ok(None);
        };
        new[at] = sources[at].with_columns(model, map)?;
    }
    Ok(Some(new))
}

fn new_map(model: &RobotModel, source: &Source, hypothesis: &Hypothesis) -> Option<ColumnMap> {
    let joint = |j: calib_checks::structural::JointIndex| model.joints()[j.0].name.clone();
    let mut map = source.columns.clone().unwrap_or_default();
    match *hypothesis {
        Hypothesis::Sign { joint: j } => {
            let name = joint(j);
            let column = column_of(source, &map, &name)?;
            set(model, &mut map, &name, column);
            match map.reversed.iter().position(|r| *r == name) {
                Some(at) => {
                    map.reversed.remove(at);
                }
                None => map.reversed.push(name),
            }
        }
        Hypothesis::Exchange { first, second } => {
            let (a, b) = (joint(first), joint(second));
            let (of_a, of_b) = (column_of(source, &map, &a)?, column_of(source, &map, &b)?);
            let kinds = [first, second].map(|j| model.joints()[j.0].kind.turns());
            if kinds[0] != kinds[1] {
                return None;
            }
            set(model, &mut map, &a, of_b);
            set(model, &mut map, &b, of_a);
        }
        Hypothesis::Units { mistake } if mistake.of_angles() => {
            let bare = |column: &String| !name::unit(column).native;
            let turning = map.joints.values().chain(&map.joint_columns);
            if turning.clone().count() == 0 || !turning.clone().all(bare) {
                return None;
            }
            map.angles = match really(mistake) {
                "deg" => AngleUnit::Deg,
                _ => AngleUnit::Rad,
            };
        }
        Hypothesis::TrackerUnit { mistake } => {
            let markers = map.markers.values().flatten();
            let bodies = map.bodies.values().flat_map(|b| &b.position);
            let mut columns = markers.chain(bodies);
            let lengths = &map.prismatic;
            let bare = columns.clone().count() > 0 && columns.all(|c| !name::unit(c).native);
            // One unit for all lengths of the map.
            if !bare || lengths.values().any(|c| !name::unit(c).native) {
                return None;
            }
            map.lengths = match really(mistake) {
                "mm" => LengthUnit::Mm,
                _ => LengthUnit::M,
            };
        }
        _ => return None,
    }
    Some(map)
}

/// The column of a joint, by the map or by its own name.
fn column_of(source: &Source, map: &ColumnMap, joint: &str) -> Option<String> {
    let mapped = map.joints.get(joint).or_else(|| map.prismatic.get(joint));
    let own = map.joint_columns.iter().find(|c| *c == joint);
    if let Some(column) = mapped.or(own) {
        return Some(column.clone());
    }
    let table = header(&source.file.bytes)?;
    let named = |name: &&String| {
        let unit = name::unit(name);
        unit.stem == joint && matches!(unit.unit, Some(NamedUnit::Angle(_) | NamedUnit::Length(_)))
    };
    table.names.iter().find(named).cloned()
}

/// Gives a joint a column.
fn set(model: &RobotModel, map: &mut ColumnMap, joint: &str, column: String) {
    map.joint_columns.retain(|c| c != joint);
    let kind = model.joint_id(joint).map(|id| model.joint(id).kind);
    let maps = match kind {
        Ok(JointKind::Prismatic { .. }) => &mut map.prismatic,
        _ => &mut map.joints,
    };
    maps.insert(joint.to_owned(), column);
}
