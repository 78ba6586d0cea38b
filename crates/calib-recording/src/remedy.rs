//! What the person can do about a problem of a file.

use crate::error::{Against, Problem};

/// Of times that go back.
const CLOCK_SET_BACK: &str = "if rows were exchanged, sort them by time; if the clock was set back here, add the difference to all later times, or make two recordings";

impl Problem {
    /// What the person can do about it.
    #[must_use]
    pub fn remedy(&self) -> String {
        let text = match self {
            Problem::Io(source) => match source.kind() {
                std::io::ErrorKind::PermissionDenied => "give yourself the right to read it",
                std::io::ErrorKind::IsADirectory => "name a file in it",
                _ => "correct the path",
            },
            Problem::Empty | Problem::NoRows => {
                "export the recording again; the copy or download was probably cut off"
            }
            Problem::EmptyRows { .. } => {
                "record again: nothing was seen, or the values stand in other columns than the header has"
            }
            Problem::TooLarge { .. } => "cut the recording into parts, or raise the limit",
            Problem::NotUtf8 { .. } => "save the file as UTF-8",
            Problem::NotUtf16 => "copy the file again, or save it as UTF-8",
            Problem::SeparatorLine { .. } => {
                "export with `,`, `;` or tabs between the cells, or delete this line and state `columns: {delimiter: …}`"
            }
            Problem::UnknownUnit { .. } => {
                "write rad, deg, m, cm, mm, um, in, ft, s, ms, us, ns, Nm or °C (`-` for none); or delete this row and state the units in the columns' names, as `elbow_deg`"
            }
            Problem::UnitAgainst { against, .. } => match against {
                Against::Name(_) => {
                    "find out which unit the numbers have, and correct the other: the row or the name"
                }
                Against::Map { .. } => {
                    "find out which unit the numbers have, and correct the other: the row or the map"
                }
                Against::Quantity(_) => {
                    "correct the unit, or what the column map says of this column"
                }
            },
            Problem::LineTooLong { .. } => {
                "give the recording: a text file of lines, or name its format"
            }
            Problem::DuplicateColumn { .. } => "rename or remove one",
            Problem::UnknownColumn { .. } | Problem::MissingColumn { .. } => {
                "correct the name, or map the columns with a column map (`columns` in the profile)"
            }
            Problem::IncompleteEntity { .. } => {
                "export all its columns, or remove those that are there"
            }
            Problem::ColumnMap(fault) => return fault.remedy(),
            Problem::Ragged {
                decimal_comma: Some(_),
                ..
            } => {
                "write decimal points, or separate the cells with `;` and state `columns: {decimal_comma: true}`; otherwise delete the extra cells"
            }
            Problem::Ragged {
                found, expected, ..
            } if found > expected => "delete the extra cells",
            Problem::Ragged { .. } => "complete the line; a lost sample has empty cells",
            Problem::Unexpected { .. } | Problem::Misfit { .. } => {
                "export the recording again, or correct it there"
            }
            Problem::TimeText { .. } => {
                "write seconds, or a date with the year first (`2024-05-01T12:00:00.123Z`); a time of day needs its date"
            }
            Problem::OtherTime { .. } => "write the times of all rows in one way",
            Problem::NotFinite { .. } => "leave the cell empty where nothing was measured",
            Problem::PartlyLost { .. } => "leave all empty when it was lost",
            Problem::TimeBackwards { .. } => CLOCK_SET_BACK,
            Problem::FrameBackwards { .. } => "sort the rows by frame",
            Problem::RepeatedSample { .. } => "remove one of them",
            Problem::PoseTwice { .. } => "give every pose a name of its own",
            Problem::PointTwice { .. } => {
                "give a repeated measurement a pose of its own, or remove one of them"
            }
            Problem::NotUnit { .. } | Problem::NotRotation { .. } => {
                "check the columns' order and scale"
            }
            Problem::Truncated { .. } => "copy the file again: its end is missing",
            Problem::TooSparse { .. } => "is the name column right? correct the column map",
            Problem::UnknownFormat { .. } => {
                "name the format, or describe the columns with a column map"
            }
            Problem::UnknownReader { .. } => {
                "name one of these, or leave it out: the content tells"
            }
            Problem::NameTaken { name, .. } => {
                return format!(
                    "map `{name}` to another name too (two names can be exchanged), or leave it out (`names` of the profile, `--map`)"
                );
            }
            Problem::NoSuchName { known, .. } if known.is_empty() => {
                "leave it out: the recording has joints only"
            }
            Problem::NoSuchName { known, .. } => {
                return format!(
                    "write the name that the recording has: {}",
                    known.join(", ")
                );
            }
            Problem::Unsupported { remedy, .. } => remedy,
        };
        text.to_owned()
    }
}
