//! How column names read by our own rules.
//!
//! The rules, in this order:
//! 1. `t_s`, `t_ms`, `t_us`, `t_ns`: time. `host_s`: the recording computer's clock. `frame`, `pose`, `row`, `sample`, `index`, `config`: a counter.
//!    `trial`, `group`, `label`, `phase`, `set`, `hold`, `segment`, `note`: text.
//! 2. `marker`, `point` or `body` as a column name: a long table; the row's `x_m,y_m,z_m[,qx,qy,qz,qw]` belong to the
//!    marker or body named there. Without time its rows are put together by the counter, whose cells may be any text.
//! 3. `NAME.x_m` (`_cm`, `_mm`), `NAME.qx`, `NAME.state`: a marker, or with a quaternion a body.
//! 4. `NAME_x_m`, `NAME_qx`: the same, if `NAME` has another coordinate in this style; a lone `NAME_x_m` is
//!    a prismatic joint `NAME_x`.
//! 5. `x_m` or `qx` without a name: the body `body` with a quaternion, the marker `marker` without.
//! 6. `NAME_rad|_deg`: a revolute joint; `NAME_m|_cm|_mm`: a prismatic one; `NAME_nm`: a torque in N·m;
//!    `NAME_temperature_c`, `temperature_c`: a temperature in °C.
//!
//! Anything else has no meaning here.

use crate::map_fault::angle_unit;
use crate::model::{JointUnit, WHOLE_ROBOT};
use crate::table::stated_unit::StatedUnit;
use crate::units::{AngleUnit, LengthUnit, TimeUnit};
use calib_finding::nearest_word;

/// A temperature, °C.
const TEMPERATURE: &str = "temperature_c";

const COUNTERS: [&str; 6] = ["frame", "pose", "row", "sample", "index", "config"];
const LABELS: [&str; 8] = [
    "trial", "group", "label", "phase", "set", "hold", "segment", "note",
];
/// One coordinate of a marker or body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Part {
    Axis(usize),
    Quaternion(usize),
    State,
}

/// Splits `x_mm` into part and scale.
fn part(text: &str) -> Option<(Part, f64)> {
    match text {
        "qx" => return Some((Part::Quaternion(0), 1.0)),
        "qy" => return Some((Part::Quaternion(1), 1.0)),
        "qz" => return Some((Part::Quaternion(2), 1.0)),
        "qw" => return Some((Part::Quaternion(3), 1.0)),
        "state" => return Some((Part::State, 1.0)),
        _ => {}
    }
    let (axis, unit) = text.split_once('_')?;
    let axis = ["x", "y", "z"].iter().position(|&a| a == axis)?;
    let unit = LengthUnit::from_name(unit)?;
    Some((Part::Axis(axis), unit.per_meter()))
}

/// The name of a column without its unit of length, and the unit. `in` and `ft` are words as well (`plug_in`): they are units behind a coordinate only.
pub(crate) fn length_unit(column: &str) -> Option<(&str, LengthUnit)> {
    let (stem, unit) = column.rsplit_once('_')?;
    let unit = LengthUnit::from_name(unit)?;
    let word = matches!(unit, LengthUnit::In | LengthUnit::Ft);
    let before = stem.strip_suffix(['x', 'y', 'z', 'X', 'Y', 'Z']);
    let of_place = before.is_some_and(|b| !b.ends_with(char::is_alphabetic));
    (!word || of_place).then_some((stem, unit))
}

/// How a column name reads by the rules of this module.
pub(super) enum Meaning<'a> {
    Time(TimeUnit),
    Received,
    Counter,
    Label,
    Entity,
    /// `dotted`: cannot be anything else.
    Part {
        entity: &'a str,
        part: Part,
        scale: f64,
        dotted: bool,
    },
    Joint {
        name: &'a str,
        unit: JointUnit,
        scale: f64,
    },
    Torque(&'a str),
    Temperature(&'a str),
    Unknown,
}

/// Before the name of a joint that would read as something else: joints `x`, `y` and `z` are no marker.
pub(crate) const JOINT: &str = "joint:";

/// A joint's column: its name behind [`JOINT`], and a unit.
fn stated_joint(name: &str) -> Option<Meaning<'_>> {
    let (name, unit) = name.strip_prefix(JOINT)?.rsplit_once('_')?;
    let (unit, scale) = match unit {
        "rad" => (JointUnit::Angle, AngleUnit::Rad.per_radian()),
        "deg" => (JointUnit::Angle, AngleUnit::Deg.per_radian()),
        _ => {
            let length = LengthUnit::from_name(unit)?;
            (JointUnit::Length, length.per_meter())
        }
    };
    (!name.is_empty()).then_some(Meaning::Joint { name, unit, scale })
}

pub(super) fn meaning(name: &str) -> Meaning<'_> {
    if let Some(joint) = stated_joint(name) {
        return joint;
    }
    match name {
        "t_s" => return Meaning::Time(TimeUnit::S),
        "t_ms" => return Meaning::Time(TimeUnit::Ms),
        "t_us" => return Meaning::Time(TimeUnit::Us),
        "t_ns" => return Meaning::Time(TimeUnit::Ns),
        "host_s" => return Meaning::Received,
        TEMPERATURE => return Meaning::Temperature(WHOLE_ROBOT),
        "marker" | "body" | "point" => return Meaning::Entity,
        _ if COUNTERS.contains(&name) => return Meaning::Counter,
        _ if LABELS.contains(&name) => return Meaning::Label,
        _ => {}
    }
    if let Some(joint) = name.strip_suffix(TEMPERATURE)
        && let Some(joint) = joint.strip_suffix(['_', '.'])
        && !joint.is_empty()
    {
        return Meaning::Temperature(joint);
    }
    if let Some((part, scale)) = part(name) {
        return Meaning::Part {
            entity: "",
            part,
            scale,
            dotted: true,
        };
    }
    if let Some((entity, tail)) = name.rsplit_once('.')
        && let Some((part, scale)) = part(tail)
    {
        return Meaning::Part {
            entity,
            part,
            scale,
            dotted: true,
        };
    }
    let Some((head, last)) = name.rsplit_once('_') else {
        return Meaning::Unknown;
    };
    if head.is_empty() {
        return Meaning::Unknown;
    }
    if let Some((part @ Part::Quaternion(_), scale)) = part(last) {
        return Meaning::Part {
            entity: head,
            part,
            scale,
            dotted: false,
        };
    }
    if let Some((_, unit)) = length_unit(name) {
        if let Some((entity, axis)) = head.rsplit_once('_')
            && !entity.is_empty()
            && let Some(axis) = ["x", "y", "z"].iter().position(|&a| a == axis)
        {
            return Meaning::Part {
                entity,
                part: Part::Axis(axis),
                scale: unit.per_meter(),
                dotted: false,
            };
        }
        return Meaning::Joint {
            name: head,
            unit: JointUnit::Length,
            scale: unit.per_meter(),
        };
    }
    match last {
        "rad" => Meaning::Joint {
            name: head,
            unit: JointUnit::Angle,
            scale: AngleUnit::Rad.per_radian(),
        },
        "deg" => Meaning::Joint {
            name: head,
            unit: JointUnit::Angle,
            scale: AngleUnit::Deg.per_radian(),
        },
        "nm" | "Nm" => Meaning::Torque(head),
        _ => Meaning::Unknown,
    }
}

/// The nearest name that the rules understand: a fixed word, or the same name with a unit.
pub(super) fn nearest_rule(name: &str) -> Option<String> {
    if let Some((head, last)) = name.rsplit_once(['_', '.'])
        && !head.is_empty()
        && let Some(unit) = nearest_word(last, ["rad", "deg", "mm", "nm"])
        && last.len() >= 2
    {
        return Some(format!("{head}_{unit}"));
    }
    if is_time_word(name) {
        // Whole seconds beside the parts of a second are no time alone.
        let mut words = name.split(|c: char| !c.is_alphanumeric());
        let parts = words.any(|w| matches!(w, "sec" | "secs" | "nsec" | "nsecs" | "nanosec"));
        return (!parts).then(|| "t_s".to_owned());
    }
    let fixed = COUNTERS.iter().chain(&LABELS).copied().chain([
        "t_s",
        "t_ms",
        "host_s",
        TEMPERATURE,
        "marker",
        "point",
        "body",
        "x_m",
        "x_mm",
    ]);
    nearest_word(name, fixed)
        .map(str::to_owned)
        .or_else(|| Some(format!("{name}_rad")))
}

/// Whether texts stand in a column of this name.
pub(crate) fn is_text_column(name: &str) -> bool {
    matches!(
        meaning(name),
        Meaning::Label | Meaning::Entity | Meaning::Counter
    )
}

/// The unit at the end of a column's name, where it is one of this kind: `deg` of `elbow_deg`.
pub(super) fn unit_in_name(name: &str, of: StatedUnit) -> Option<StatedUnit> {
    if let Some(unit) = StatedUnit::in_brackets(name) {
        return Some(unit);
    }
    let (_, word) = name.rsplit_once('_')?;
    match of {
        StatedUnit::Angle(_) => angle_unit(name).map(StatedUnit::Angle),
        StatedUnit::Length(_) => length_unit(name).map(|(_, unit)| StatedUnit::Length(unit)),
        StatedUnit::Time(_) => TimeUnit::from_text(word).map(StatedUnit::Time),
        StatedUnit::Torque => matches!(word, "nm" | "Nm").then_some(StatedUnit::Torque),
        StatedUnit::Celsius => (word == "c").then_some(StatedUnit::Celsius),
        StatedUnit::Other => None,
    }
}

/// A column's name with the unit that a row of units states, where the name alone has no meaning.
pub(super) fn with_unit(name: &str, unit: Option<StatedUnit>) -> String {
    let Some(word) = unit.and_then(StatedUnit::name) else {
        return name.to_owned();
    };
    match meaning(name) {
        Meaning::Unknown if matches!(unit, Some(StatedUnit::Time(_))) && is_time_word(name) => {
            format!("t_{word}")
        }
        Meaning::Unknown if !name.is_empty() => format!("{name}_{word}"),
        _ => name.to_owned(),
    }
}

/// Whether a name says that the column holds times: `Timestamp`, `time (UTC)`, `rec_time`.
fn is_time_word(name: &str) -> bool {
    const WORDS: [&str; 10] = [
        "t",
        "time",
        "timestamp",
        "stamp",
        "date",
        "datetime",
        "zeit",
        "zeitstempel",
        "datum",
        "temps",
    ];
    let mut words = name.split(|c: char| !c.is_alphanumeric());
    words.any(|one| WORDS.iter().any(|word| one.eq_ignore_ascii_case(word)))
}

/// Whether a header line reads as one of our own tables (for the detection of formats).
pub(crate) fn is_canonical<'a>(names: impl Iterator<Item = &'a str>) -> bool {
    let (mut known, mut unknown) = (0, 0);
    for name in names.filter(|name| !name.is_empty()) {
        match meaning(name) {
            Meaning::Part { .. } | Meaning::Joint { .. } => known += 1,
            Meaning::Unknown => unknown += 1,
            _ => {}
        }
    }
    known > 0 && known >= unknown
}

/// Whether a column's name alone reads as this joint.
pub(crate) fn reads_as_joint(column: &str, joint: &str) -> bool {
    matches!(meaning(column), Meaning::Joint { name, .. } if name == joint)
}
