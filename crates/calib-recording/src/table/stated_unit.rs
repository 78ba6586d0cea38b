//! Units as a name or a cell states them.

use crate::units::{AngleUnit, LengthUnit, TimeUnit};

/// A unit as a text states it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StatedUnit {
    /// Of an angle.
    Angle(AngleUnit),
    /// Of a length.
    Length(LengthUnit),
    /// Of a time.
    Time(TimeUnit),
    /// N·m.
    Torque,
    /// °C.
    Celsius,
    /// Of something that is not read, such as a speed.
    Other,
}

impl StatedUnit {
    /// From the words for a unit, with or without brackets: `deg`, `[mm]`, `(°)`.
    pub fn from_text(text: &str) -> Option<Self> {
        let word = without_brackets(text);
        let angle = AngleUnit::from_text(word).map(Self::Angle);
        let length = || LengthUnit::from_text(word).map(Self::Length);
        let time = || TimeUnit::from_text(word).map(Self::Time);
        if let Some(unit) = angle.or_else(length).or_else(time) {
            return Some(unit);
        }
        // A speed, an acceleration: what stands before the line is a unit of its own.
        if let Some((of, _)) = word.split_once('/') {
            return Self::from_text(of).map(|_| Self::Other);
        }
        match word.to_ascii_lowercase().as_str() {
            "nm" | "n·m" | "n*m" | "n.m" | "n m" => Some(Self::Torque),
            "°c" | "degc" | "deg c" | "celsius" | "c" => Some(Self::Celsius),
            "n" | "kg" | "v" | "a" | "ma" | "hz" | "rpm" | "%" | "bar" | "k" | "°f" => {
                Some(Self::Other)
            }
            _ => None,
        }
    }

    /// As it stands behind `_` in a column's name; `None` where no name has it.
    pub fn name(self) -> Option<&'static str> {
        match self {
            Self::Angle(unit) => Some(unit.name()),
            Self::Length(unit) => Some(unit.name()),
            Self::Time(unit) => Some(unit.name()),
            Self::Torque => Some("nm"),
            Self::Celsius => Some("c"),
            Self::Other => None,
        }
    }

    /// The unit in brackets at the end of a column's name: `elbow [deg]`.
    pub(crate) fn in_brackets(name: &str) -> Option<Self> {
        let (_, word) = name.strip_suffix([']', ')'])?.rsplit_once(['[', '('])?;
        Self::from_text(word)
    }
}

pub(super) fn without_brackets(text: &str) -> &str {
    let inner = text
        .strip_prefix(['[', '('])
        .and_then(|inner| inner.strip_suffix([']', ')']));
    inner.unwrap_or(text).trim()
}

/// What a row of units says: a unit for each column that has one.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitRow {
    /// Its line, from 1.
    pub line: u64,
    /// The unit of each column.
    pub units: Vec<Option<StatedUnit>>,
}
