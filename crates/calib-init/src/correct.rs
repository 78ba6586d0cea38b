//! Mistakes in tables, corrected in the profile: columns exchanged, negated, or read in another unit. The tables themselves are never changed.

use calib_checks::structural::{
    BodyIndex, Chain, ColumnOrder, Hypothesis, Length, PoseMistake, Scoped, UnitMistake,
};
use calib_recording::{AngleUnit, BodyColumns, ColumnMap, LengthUnit};
use calib_urdf::{JointKind, RobotModel, doubt};

use crate::conventions;
use crate::error::InitError;
use crate::header::{Header, header};
use crate::mistake::Mistake;
use crate::name::{self, NamedUnit, Unit};
use crate::session::Draft;
use crate::source::Source;

/// The mistake in words that a profile can name.
#[must_use]
pub fn mistake(
    model: &RobotModel,
    source: Option<&Source>,
    bodies: &[String],
    hypothesis: &Hypothesis,
) -> Mistake {
    let joint = |j: calib_checks::structural::JointIndex| model.joints()[j.0].name.clone();
    let named = |b: BodyIndex| bodies.get(b.0).cloned().unwrap_or_default();
    match *hypothesis {
        Hypothesis::Sign { joint: j } => Mistake::Sign { joint: joint(j) },
        Hypothesis::Exchange { first, second } => Mistake::Exchange {
            first: joint(first),
            second: joint(second),
        },
        Hypothesis::Order { order } => Mistake::Order {
            columns: moved(model, order),
        },
        Hypothesis::Unit { joint: j, mistake } => Mistake::Unit {
            joint: Some(joint(j)),
            unit: really(mistake),
        },
        Hypothesis::Units { mistake } => Mistake::Unit {
            joint: None,
            unit: really(mistake),
        },
        Hypothesis::TrackerUnit { unit, read_as } => {
            let was = source.and_then(lengths_of);
            match was.and_then(|was| scaled(was, unit, read_as)) {
                Some(unit) => Mistake::TrackerUnit { unit: unit.name() },
                None => Mistake::Other,
            }
        }
        Hypothesis::Offset { joint: j, turns } => Mistake::Offset {
            joint: joint(j),
            value: turns.angle(),
            turns: true,
        },
        Hypothesis::Zero { joint: j, offset } => Mistake::Offset {
            joint: joint(j),
            value: offset,
            turns: model.joints()[j.0].kind.turns(),
        },
        Hypothesis::Gain { joint: j, factor } => Mistake::Gain {
            joint: joint(j),
            factor,
        },
        Hypothesis::RowShift { rows } => Mistake::Rows { rows },
        Hypothesis::Mirrored => Mistake::Mirrored,
        Hypothesis::TrackerMoved | Hypothesis::TrackerAxes { .. } => Mistake::TrackerMoved,
        Hypothesis::Remounted { body } => Mistake::Remounted { body: named(body) },
        Hypothesis::Poses { mistake, .. } => match mistake {
            PoseMistake::ScalarFirstReadAsLast => Mistake::Quaternions { first: true },
            PoseMistake::ScalarLastReadAsFirst => Mistake::Quaternions { first: false },
            PoseMistake::Inverse => Mistake::Inverted,
            PoseMistake::Transposed => Mistake::Poses,
        },
        Hypothesis::MissingColumn { joint: j } => Mistake::MissingColumn { joint: joint(j) },
        Hypothesis::StoodAt { joint: j, value } => Mistake::StoodAt {
            joint: joint(j),
            value,
            turns: model.joints()[j.0].kind.turns(),
        },
        Hypothesis::WrongLink { body, link } => Mistake::Link {
            body: named(body),
            link: model.links()[link.0].name.clone(),
        },
        Hypothesis::ExchangedBodies { first, second } => Mistake::Bodies {
            first: named(first),
            second: named(second),
        },
        _ => Mistake::Other,
    }
}

/// Each joint with the name of the one in whose column its values are, where that is another one.
fn moved(model: &RobotModel, order: ColumnOrder) -> Vec<(String, String)> {
    let Ok(chain) = Chain::from_model(model) else {
        return Vec::new();
    };
    let name = |joint: usize| model.joints()[joint].name.clone();
    let columns = order.columns(&chain).into_iter().enumerate();
    let moved = columns.filter(|(joint, column)| column.0 != *joint);
    moved
        .map(|(joint, column)| (name(joint), name(column.0)))
        .collect()
}

/// Lengths that are too small for a robot which is larger than robots are: its URDF has another unit.
pub fn is_of_robot(model: &RobotModel, hypothesis: &Hypothesis) -> bool {
    hypothesis.log_scale() > 0.0 && doubt::reach(model) > doubt::LARGEST
}

/// The unit that the values really have.
fn really(mistake: UnitMistake) -> &'static str {
    match mistake {
        UnitMistake::DegreesReadAsRadians => "deg",
        UnitMistake::RadiansReadAsDegrees => "rad",
        UnitMistake::Length { unit, .. } => match unit {
            Length::Meter => "m",
            Length::Centimeter => "cm",
            Length::Millimeter => "mm",
            Length::Micrometer => "um",
            Length::Inch => "in",
            Length::Foot => "ft",
        },
    }
}

/// The sources with a mistake corrected in their column maps; `None` where no map corrects it. `bodies`: their names in the profile.
///
/// # Errors
/// [`InitError::Recording`] where a file cannot be read by its new map.
pub fn corrected(
    model: &RobotModel,
    sources: &[Source],
    drafts: &[Draft],
    bodies: &[String],
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
        let of_tracker = matches!(
            scoped.hypothesis,
            Hypothesis::TrackerUnit { .. } | Hypothesis::Poses { .. }
        );
        let at = match draft.log {
            Some(log) if !of_tracker => log,
            _ => draft.source,
        };
        let map = match scoped.hypothesis {
            Hypothesis::Poses { body, mistake } => {
                let one = body.and_then(|b| bodies.get(b.0));
                let names = sources[at]
                    .recording
                    .bodies
                    .iter()
                    .map(|stream| &stream.name);
                let names: Vec<&String> =
                    names.filter(|n| one.is_none_or(|one| one == *n)).collect();
                if names.is_empty() {
                    continue;
                }
                conventions::as_written(model, &sources[at], &names, mistake)
            }
            _ => new_map(model, &sources[at], &scoped.hypothesis),
        };
        let Some(map) = map else {
            return Ok(None);
        };
        new[at] = sources[at].with_columns(model, map)?;
    }
    Ok(Some(new))
}

fn new_map(model: &RobotModel, source: &Source, hypothesis: &Hypothesis) -> Option<ColumnMap> {
    let joint = |j: calib_checks::structural::JointIndex| model.joints()[j.0].name.clone();
    let mut map = source.columns.clone().unwrap_or_default();
    let of_unit = matches!(
        hypothesis,
        Hypothesis::Unit { .. } | Hypothesis::Units { .. } | Hypothesis::TrackerUnit { .. }
    );
    let has_units = |table: Header| table.units.iter().any(Option::is_some);
    if of_unit && map.names.is_empty() && header(&source.file.bytes).is_some_and(has_units) {
        map = without_unit_row(source, &map)?;
    }
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
        Hypothesis::Order { order } => {
            let columns = moved(model, order).into_iter();
            let columns: Option<Vec<(String, String)>> = columns
                .map(|(joint, of)| Some((joint, column_of(source, &map, &of)?)))
                .collect();
            for (joint, column) in columns? {
                set(model, &mut map, &joint, column);
            }
        }
        Hypothesis::Unit { joint: j, mistake } => {
            let column = column_of(source, &map, &joint(j))?;
            return renamed(source, &map, &[column], really(mistake));
        }
        Hypothesis::Units { mistake } => {
            let is_one = |name: &String| {
                let id = model.joint_id(name);
                id.is_ok_and(|id| model.joint(id).kind.turns() == mistake.of_angles())
            };
            let names = source.recording.joints.iter().map(|s| &s.name);
            let of = names
                .filter(|n| is_one(n))
                .map(|n| column_of(source, &map, n));
            let columns: Vec<String> = of.collect::<Option<_>>()?;
            let bare = columns.iter().all(|column| !name::unit(column).native);
            if !(bare && mistake.of_angles()) {
                return renamed(source, &map, &columns, really(mistake));
            }
            map.angles = match really(mistake) {
                "deg" => AngleUnit::Deg,
                _ => AngleUnit::Rad,
            };
        }
        Hypothesis::TrackerUnit { unit, read_as } => {
            let unit = scaled(lengths_of(source)?, unit, read_as)?;
            let columns = places(source, &map);
            let bare = columns.iter().all(|column| !name::unit(column).native);
            // One unit for all lengths of the map.
            let alone = map
                .prismatic
                .values()
                .all(|column| name::unit(column).native);
            if !(bare && alone) {
                return renamed(source, &map, &columns, unit.name());
            }
            map.lengths = unit;
        }
        _ => return None,
    }
    Some(map)
}

/// The other units of length, each with the one that was read.
pub fn units_but(read_as: LengthUnit) -> impl Iterator<Item = (Length, Length)> {
    let others = LengthUnit::ALL.into_iter().filter(move |u| *u != read_as);
    others.map(move |unit| (length(unit), length(read_as)))
}

fn length(unit: LengthUnit) -> Length {
    match unit {
        LengthUnit::M => Length::Meter,
        LengthUnit::Cm => Length::Centimeter,
        LengthUnit::Mm => Length::Millimeter,
        LengthUnit::Um => Length::Micrometer,
        LengthUnit::In => Length::Inch,
        LengthUnit::Ft => Length::Foot,
    }
}

/// The unit that differs from another one as `unit` does from `read_as`.
fn scaled(was: LengthUnit, unit: Length, read_as: Length) -> Option<LengthUnit> {
    let wanted = length(was).meters() * unit.meters() / read_as.meters();
    let mut all = LengthUnit::ALL.into_iter();
    all.find(|u| (length(*u).meters() / wanted - 1.0).abs() < 1e-9)
}

/// The one unit that the positions of a file are read in; `None` where there are several, or the file states it itself.
#[must_use]
pub fn lengths_of(source: &Source) -> Option<LengthUnit> {
    let map = source.columns.clone().unwrap_or_default();
    let map = without_unit_row(source, &map).unwrap_or(map);
    let columns = places(source, &map);
    let unit = |column: &String| match name::unit(column) {
        Unit {
            unit: Some(NamedUnit::Length(unit)),
            native: true,
            ..
        } => unit,
        _ => map.lengths,
    };
    let first = unit(columns.first()?);
    columns.iter().all(|c| unit(c) == first).then_some(first)
}

/// Columns of positions: those of the map, and those that the readers' own rules take.
fn places(source: &Source, map: &ColumnMap) -> Vec<String> {
    let mapped = map.markers.values().flatten();
    let bodies = map.bodies.values().flat_map(|b| &b.position);
    let mut columns: Vec<String> = mapped.chain(bodies).cloned().collect();
    let of_joints: Vec<&String> = map.prismatic.values().collect();
    let is_place = |column: &String| {
        let unit = name::unit(column);
        let letters = ['x', 'y', 'z'].into_iter();
        unit.native
            && matches!(unit.unit, Some(NamedUnit::Length(_)))
            && !of_joints.contains(&column)
            && letters
                .filter(|l| name::coordinate(unit.stem, *l).is_some())
                .count()
                > 0
    };
    let of_file = || header(&source.file.bytes).map_or_else(Vec::new, |table| table.names);
    let names = match map.names.is_empty() {
        true => of_file(),
        false => map.names.clone(),
    };
    for name in names {
        if is_place(&name) && !columns.contains(&name) {
            columns.push(name);
        }
    }
    columns
}

/// The map with names of its own for these columns, which state the unit; the header line of the file is not read any more.
fn renamed(source: &Source, map: &ColumnMap, columns: &[String], unit: &str) -> Option<ColumnMap> {
    let table = header(&source.file.bytes)?;
    if columns.is_empty() || map.decimal_comma {
        return None;
    }
    let mut renamed = map.clone();
    // One word for the lengths of a map would contradict the new names: all of them state their unit then.
    let is_length = LengthUnit::ALL.into_iter().any(|u| u.name() == unit);
    let mut of_map = Vec::new();
    if is_length && map.lengths != LengthUnit::M {
        of_map = places(source, map);
        of_map.extend(map.prismatic.values().cloned());
        of_map.retain(|column| !name::unit(column).native);
        renamed.lengths = LengthUnit::M;
    }
    let new = |name: &String| match (columns.contains(name), of_map.contains(name)) {
        (true, _) => format!("{}_{unit}", name::unit(name).stem),
        (false, true) => format!("{}_{}", name::unit(name).stem, map.lengths.name()),
        (false, false) => name.clone(),
    };
    // A name that states the unit already corrects nothing: the values are wrong.
    if columns.iter().any(|column| new(column) == *column) {
        return None;
    }
    rename(&mut renamed, &table, new);
    Some(renamed)
}

/// Gives the columns of a map and of the file new names; the header line of the file is not read any more.
fn rename(map: &mut ColumnMap, table: &Header, new: impl Fn(&String) -> String) {
    if map.names.is_empty() {
        map.names = table.names.clone();
    }
    map.names = map.names.iter().map(&new).collect();
    map.skip_lines = table.line;
    map.delimiter = Some(table.delimiter);
    let all = std::mem::take(&mut map.joint_columns).into_iter();
    let (bare, moved): (Vec<_>, Vec<_>) = all.partition(|column| new(column) == *column);
    map.joint_columns = bare;
    map.joints
        .extend(moved.into_iter().map(|name| (name.clone(), name)));
    let joints = map.joints.values_mut().chain(map.prismatic.values_mut());
    let markers = map.markers.values_mut().flatten();
    let bodies = map.bodies.values_mut().flat_map(BodyColumns::all_mut);
    let time = map.time.iter_mut().map(|time| &mut time.column);
    for column in joints.chain(markers).chain(bodies).chain(time) {
        *column = new(column);
    }
}

/// The map with names that state the units of a row of units, which is not read any more; `None` where the file has none.
fn without_unit_row(source: &Source, map: &ColumnMap) -> Option<ColumnMap> {
    let table = header(&source.file.bytes)?;
    if !table.units.iter().any(Option::is_some) || !map.names.is_empty() || map.decimal_comma {
        return None;
    }
    let new = |name: &String| {
        let i = table.position(name);
        let unit = i.and_then(|i| table.unit(i).unit.map(|unit| (unit, i)));
        match unit {
            Some((NamedUnit::Angle(_) | NamedUnit::Length(_), i))
                if name::unit(name).unit.is_none() =>
            {
                let unit = table.unit(i).unit.map_or("", NamedUnit::name);
                format!("{name}_{unit}")
            }
            _ => name.clone(),
        }
    };
    let mut spelled = map.clone();
    if let Some(time) = &mut spelled.time
        && let Some(i) = table.position(&time.column)
        && let Some(NamedUnit::Time(unit)) = table.unit(i).unit
    {
        time.unit = unit;
    }
    rename(&mut spelled, &table, new);
    Some(spelled)
}

/// The column of a joint in a file.
#[must_use]
pub fn column(source: &Source, joint: &str) -> Option<String> {
    let map = source.columns.clone().unwrap_or_default();
    column_of(source, &map, joint)
}

/// The column of a joint, by the map or by its own name.
fn column_of(source: &Source, map: &ColumnMap, joint: &str) -> Option<String> {
    let mapped = map.joints.get(joint).or_else(|| map.prismatic.get(joint));
    let own = map.joint_columns.iter().find(|c| *c == joint);
    if let Some(column) = mapped.or(own) {
        return Some(column.clone());
    }
    let table = header(&source.file.bytes)?;
    let names = if map.names.is_empty() {
        &table.names
    } else {
        &map.names
    };
    let named = |name: &&String| {
        let unit = name::unit(name);
        unit.stem == joint && matches!(unit.unit, Some(NamedUnit::Angle(_) | NamedUnit::Length(_)))
    };
    names.iter().find(named).cloned()
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
