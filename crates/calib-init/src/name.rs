//! What a column's name says: its words, its unit, its number.

use calib_recording::{AngleUnit, LengthUnit, StatedUnit, TimeUnit};

/// A unit that stands in a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NamedUnit {
    /// Of an angle.
    Angle(AngleUnit),
    /// Of a length.
    Length(LengthUnit),
    /// Of a time.
    Time(TimeUnit),
    /// Of something else, such as a speed or a torque.
    Other,
}

impl From<StatedUnit> for NamedUnit {
    fn from(unit: StatedUnit) -> Self {
        match unit {
            StatedUnit::Angle(unit) => Self::Angle(unit),
            StatedUnit::Length(unit) => Self::Length(unit),
            StatedUnit::Time(unit) => Self::Time(unit),
            _ => Self::Other,
        }
    }
}

/// A name without its unit, and the unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit<'n> {
    /// What stands before the unit.
    pub stem: &'n str,
    /// The unit, where there is one.
    pub unit: Option<NamedUnit>,
    /// The readers understand it: it stands behind `_`.
    pub native: bool,
}

/// Splits `elbow_deg`, `x [mm]`, `t(ms)`.
#[must_use]
pub fn unit(name: &str) -> Unit<'_> {
    let bracket = name
        .strip_suffix([']', ')'])
        .and_then(|head| head.rsplit_once(['[', '(']));
    let split = bracket.or_else(|| name.rsplit_once('_'));
    let found = split.and_then(|(stem, word)| {
        let word = word.trim();
        let unit = word_of_unit(word)?;
        // `plug_in` is no length.
        let is_word = matches!(word, "in" | "ft") && bracket.is_none();
        let of_place = || {
            let before = stem.strip_suffix(['x', 'y', 'z', 'X', 'Y', 'Z']);
            before.is_some_and(|b| !b.ends_with(char::is_alphabetic))
        };
        (!is_word || of_place()).then_some((stem, word, unit))
    });
    match found {
        Some((stem, word, unit)) if !stem.is_empty() => Unit {
            stem: stem.trim_end(),
            unit: Some(unit),
            native: bracket.is_none() && word == unit.name(),
        },
        _ => Unit {
            stem: name,
            unit: None,
            native: false,
        },
    }
}

impl NamedUnit {
    /// As the readers understand it behind `_`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Angle(unit) => unit.name(),
            Self::Length(unit) => unit.name(),
            Self::Time(unit) => unit.name(),
            Self::Other => "",
        }
    }
}

fn word_of_unit(word: &str) -> Option<NamedUnit> {
    if let Some(unit) = LengthUnit::from_text(word) {
        return Some(NamedUnit::Length(unit));
    }
    Some(match word.to_ascii_lowercase().as_str() {
        "rad" | "radian" | "radians" => NamedUnit::Angle(AngleUnit::Rad),
        "deg" | "degree" | "degrees" | "°" => NamedUnit::Angle(AngleUnit::Deg),
        "s" | "sec" => NamedUnit::Time(TimeUnit::S),
        "ms" => NamedUnit::Time(TimeUnit::Ms),
        "us" => NamedUnit::Time(TimeUnit::Us),
        "ns" => NamedUnit::Time(TimeUnit::Ns),
        _ => return None,
    })
}

/// Where the words of a name stand: runs of letters, runs of digits; `handX` is `hand` and `X`.
#[must_use]
pub fn spans(name: &str) -> Vec<std::ops::Range<usize>> {
    let mut spans: Vec<std::ops::Range<usize>> = Vec::new();
    let mut last = ' ';
    for (at, c) in name.char_indices() {
        if c.is_alphanumeric() {
            let same = (last.is_alphabetic()
                && c.is_alphabetic()
                && !(last.is_lowercase() && c.is_uppercase()))
                || (last.is_numeric() && c.is_numeric());
            let end = at + c.len_utf8();
            match spans.last_mut().filter(|_| same) {
                Some(span) => span.end = end,
                None => spans.push(at..end),
            }
        }
        last = c;
    }
    spans
}

/// The words of a name in lower case.
#[must_use]
pub fn words(name: &str) -> Vec<String> {
    let spans = spans(name).into_iter();
    spans.map(|span| name[span].to_lowercase()).collect()
}

/// Words of a column with the parts of a second that another column has whole.
pub const PARTS_OF_SECONDS: [&str; 6] = [
    "nsec",
    "nsecs",
    "nanosec",
    "nanosecs",
    "nanoseconds",
    "usec",
];

/// How well a name says that a column is the time of its row, best first: a word alone, the stamp of a message, a word among others.
#[must_use]
pub fn time(name: &str) -> Option<u8> {
    const ALONE: [&str; 13] = [
        "date",
        "datetime",
        "t",
        "time",
        "timestamp",
        "timestamps",
        "stamp",
        "ts",
        "sec",
        "secs",
        "zeit",
        "zeitstempel",
        "temps",
    ];
    const AMONG: [&str; 7] = [
        "datetime",
        "time",
        "timestamp",
        "timestamps",
        "stamp",
        "zeit",
        "zeitstempel",
    ];
    let unit = unit(name);
    if matches!(unit.unit, Some(NamedUnit::Angle(_) | NamedUnit::Length(_))) {
        return None;
    }
    let words = words(unit.stem);
    let all: Vec<&str> = words.iter().map(String::as_str).collect();
    match all.as_slice() {
        // When `rostopic` received a message: later than its own stamp.
        [_] if name.starts_with('%') => Some(2),
        [word] if ALONE.contains(word) => Some(0),
        ["header", "stamp", ..] | [_, "header", "stamp"] => Some(1),
        words if words.iter().any(|w| AMONG.contains(w)) => Some(2),
        _ => None,
    }
}

/// Words that say of a joint's column nothing but that it is one.
const FILLERS: [&str; 15] = [
    "joint",
    "joints",
    "pos",
    "position",
    "positions",
    "angle",
    "angles",
    "actual",
    "measured",
    "meas",
    "state",
    "states",
    "value",
    "q",
    "enc",
];

/// The words of a joint's name or column without fillers, run together.
#[must_use]
pub fn key(name: &str) -> String {
    let all = words(name);
    let kept: Vec<&String> = all
        .iter()
        .filter(|w| !FILLERS.contains(&w.as_str()))
        .collect();
    // A name of fillers only, `joint_1`, is its number.
    kept.iter().map(|w| w.as_str()).collect()
}

/// Whether a numbered column's name has no other words than those of joints: `q1`, `actual_joint_2`, `A3`.
#[must_use]
pub fn is_of_joints(name: &str) -> bool {
    const MORE: [&str; 9] = [
        "j", "a", "axis", "theta", "arm", "robot", "e", "ext", "external",
    ];
    let words = words(unit(name).stem);
    let is_known = |w: &String| {
        let word = w.as_str();
        FILLERS.contains(&word) || MORE.contains(&word) || word.parse::<u32>().is_ok()
    };
    words.iter().all(is_known)
}

/// Words of columns that are about joints, but hold no position, or not the one that was reached.
const OTHERS: [&str; 39] = [
    "gravity",
    "gyro",
    "magnetometer",
    "mag",
    "imu",
    "accel",
    "std",
    "stddev",
    "sigma",
    "err",
    "nm",
    "vel",
    "velocity",
    "speed",
    "speeds",
    "qd",
    "dq",
    "qdd",
    "acc",
    "acceleration",
    "effort",
    "torque",
    "torques",
    "tau",
    "current",
    "moment",
    "target",
    "desired",
    "des",
    "cmd",
    "command",
    "commanded",
    "temp",
    "temperature",
    "temperatures",
    "tcp",
    "pose",
    "force",
    "voltage",
];

/// Whether a column's name says that it holds something else than positions that were reached.
#[must_use]
pub fn is_no_position(name: &str) -> bool {
    words(name).iter().any(|w| OTHERS.contains(&w.as_str()))
}

/// Whether a column's name says that it holds something else than a place of what was tracked: as [`is_no_position`], but the pose of a
/// camera's target is one.
#[must_use]
pub fn is_no_place(name: &str) -> bool {
    let others = |w: &String| OTHERS.contains(&w.as_str()) && w != "pose" && w != "target";
    words(name).iter().any(others)
}

/// Whether a column's name is that of a coordinate of a force, a moment, a velocity, an acceleration or a field by its letter: `F_x`, `a.z`, `omega_y`.
#[must_use]
pub fn is_quantity(name: &str) -> bool {
    const LETTERS: [&str; 9] = ["f", "m", "t", "v", "w", "a", "g", "omega", "alpha"];
    match words(name).as_slice() {
        [of, axis] => LETTERS.contains(&of.as_str()) && matches!(axis.as_str(), "x" | "y" | "z"),
        _ => false,
    }
}

/// `(what stands before, the number, what stands behind)` for the last number of a name.
#[must_use]
pub fn numbered(name: &str) -> Option<(&str, u32, &str)> {
    let end = name.rfind(|c: char| c.is_ascii_digit())? + 1;
    let head = &name[..end];
    let start = head.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |i| {
        i + head[i..].chars().next().map_or(1, char::len_utf8)
    });
    let number = head[start..].parse().ok()?;
    Some((&name[..start], number, &name[end..]))
}

/// A coordinate letter of a name, `(before, behind)`: `x1`, `hand_x`, `handX`, `TX`, `pos.x`.
#[must_use]
pub fn coordinate(name: &str, letter: char) -> Option<(&str, &str)> {
    let upper = letter.to_ascii_uppercase();
    let places = name
        .char_indices()
        .filter(|(_, c)| *c == letter || *c == upper);
    let free = |at: usize, c: char| {
        let before = name[..at].chars().next_back();
        let behind = name[at + 1..].chars().next();
        let ends = behind.is_none_or(|b| !b.is_alphabetic());
        let begins =
            before.is_none_or(|b| !b.is_alphabetic() || (b.is_lowercase() && c.is_uppercase()));
        // `tx`, `pX`: a position's letter before it.
        let of_position = before.is_some_and(|b| matches!(b, 't' | 'T' | 'p' | 'P'))
            && name[..at - 1]
                .chars()
                .next_back()
                .is_none_or(|b| !b.is_alphabetic());
        ends && (begins || of_position)
    };
    let (at, _) = places.rev().find(|(at, c)| free(*at, *c))?;
    Some((&name[..at], &name[at + 1..]))
}

/// A part of a quaternion, `(before, behind)`: `hand_qx`, `qw`.
#[must_use]
pub fn quaternion(name: &str, letter: char) -> Option<(&str, &str)> {
    let wanted = [
        format!("q{letter}"),
        format!("Q{}", letter.to_ascii_uppercase()),
    ];
    let lower = name.to_ascii_lowercase();
    let at = lower.rfind(&wanted[0])?;
    let before = name[..at].chars().next_back();
    let behind = name[at + 2..].chars().next();
    let alone =
        before.is_none_or(|c| !c.is_alphabetic()) && behind.is_none_or(|c| !c.is_alphabetic());
    alone.then(|| (&name[..at], &name[at + 2..]))
}

/// A name for what is left of a name without its coordinate: separators at its ends removed; `letter` before a number alone.
#[must_use]
pub fn of_rest(before: &str, behind: &str, letter: char) -> String {
    let separators = |c: char| !c.is_alphanumeric() && c != '*';
    let before = before.trim_matches(separators);
    let behind = behind.trim_matches(separators);
    let joined = match (before.is_empty(), behind.is_empty()) {
        (false, false) => format!("{before}_{behind}"),
        _ => format!("{before}{behind}"),
    };
    match joined.chars().next() {
        None => letter.to_string(),
        Some(c) if c.is_ascii_digit() => format!("{letter}{joined}"),
        Some(_) => joined,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_stand_behind_names() {
        assert_eq!(
            unit("elbow_deg").unit,
            Some(NamedUnit::Angle(AngleUnit::Deg))
        );
        assert!(unit("elbow_deg").native && !unit("elbow [deg]").native);
        assert_eq!(unit("elbow [deg]").stem, "elbow");
        assert_eq!(unit("x(mm)").unit, Some(NamedUnit::Length(LengthUnit::Mm)));
        assert_eq!(unit("arm_1").unit, None);
        assert_eq!(unit("m").stem, "m");
    }

    #[test]
    fn names_are_read_by_their_words() {
        assert_eq!(words("ArmJoint12.Pos"), ["arm", "joint", "12", "pos"]);
        assert_eq!(key("arm_1_joint"), key("Arm1.position"));
        assert_eq!(key("joint_3"), "3");
        assert_eq!(numbered("state.q[4]"), Some(("state.q[", 4, "]")));
        assert_eq!(numbered("elbow"), None);
        assert!(is_no_position("target_qd_3") && !is_no_position("actual_q_3"));
    }

    #[test]
    fn times_are_known_by_their_words() {
        for name in [
            "t",
            "%time",
            "Zeit [s]",
            "time_ms",
            "rosbagTimestamp",
            "header.stamp",
        ] {
            assert!(time(name).is_some(), "{name}");
        }
        for name in ["x", "t_mm", "estimate", "sometimes", "stampede"] {
            assert_eq!(time(name), None, "{name}");
        }
        assert!(time("header.stamp") < time("rosbagTimestamp"));
        assert!(time("field.header.stamp") < time("%time"));
    }

    #[test]
    fn coordinates_stand_alone() {
        assert_eq!(coordinate("x1", 'x'), Some(("", "1")));
        assert_eq!(coordinate("hand_x", 'x'), Some(("hand_", "")));
        assert_eq!(coordinate("handX", 'x'), Some(("hand", "")));
        assert_eq!(coordinate("TX", 'x'), Some(("T", "")));
        assert_eq!(coordinate("flange_qx", 'x'), None);
        assert_eq!(coordinate("axis", 'x'), None);
        assert_eq!(coordinate("max", 'x'), None);
        assert_eq!(quaternion("flange_qx", 'x'), Some(("flange_", "")));
        assert_eq!(of_rest("", "1", 'm'), "m1");
        assert_eq!(of_rest("hand_", "", 'm'), "hand");
        assert_eq!(of_rest("", "", 'm'), "m");
    }
}
