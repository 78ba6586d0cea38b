//! Our own tables, and any delimited table with a column map.

use super::common::head_text;
use super::{Input, ReadOptions, Reader};
use crate::error::{At, Placed, Problem};
use crate::model::Recording;
use crate::table::{Known, is_canonical, read_table};
use crate::text::{cells, header_line};
use calib_finding::nearest_word;
use std::io::BufReader;

pub(super) const READER: Reader = Reader {
    id: "csv",
    name: "table with units in the column names, or with a column map",
    extensions: &["csv", "tsv", "txt"],
    detect,
    read,
};

/// The controller log of UR's `record.py`.
pub(super) const UR_RTDE: Reader = Reader {
    id: "ur_rtde",
    name: "UR RTDE log",
    extensions: &["csv"],
    detect: |head| has_columns(head, &["timestamp", "actual_q_0"]),
    read: |input, options| with_preset("ur_rtde", input, options),
};

/// libfranka's `logToCSV`.
pub(super) const FRANKA: Reader = Reader {
    id: "franka",
    name: "Franka log",
    extensions: &["csv"],
    detect: |head| has_columns(head, &["time", "state.q[0]", "state.q[6]"]),
    read: |input, options| with_preset("franka", input, options),
};

/// NDI's combined API sample.
pub(super) const NDI: Reader = Reader {
    id: "ndi",
    name: "NDI tool log",
    extensions: &["csv"],
    detect: |head| has_columns(head, &["Frame#", "ToolHandle", "q0", "tx"]),
    read: |input, options| with_preset("ndi", input, options),
};

/// Whether a reader of this id reads tables, and with them everything that a column map says.
pub(super) fn is_of_tables(id: &str) -> bool {
    [&READER, &UR_RTDE, &FRANKA, &NDI]
        .iter()
        .any(|reader| reader.id == id)
}

fn has_columns(head: &[u8], wanted: &[&str]) -> bool {
    header_line(head_text(head)).is_some_and(|(line, separator)| {
        let has = |name: &&str| cells(line, separator).any(|cell| cell == *name);
        wanted.iter().all(has)
    })
}

/// The preset, or the caller's own map on top of it.
fn with_preset(preset: &str, input: &mut dyn Input, options: &ReadOptions) -> Placed<Recording> {
    let mut map = options.columns.clone().unwrap_or_default();
    map.preset.get_or_insert_with(|| preset.to_string());
    read(
        input,
        &ReadOptions {
            columns: Some(map),
            ..options.clone()
        },
    )
}

fn detect(head: &[u8]) -> bool {
    header_line(head_text(head))
        .is_some_and(|(line, separator)| is_canonical(cells(line, separator)))
}

/// Several cells, none of them binary; or nothing but comments.
pub(super) fn looks_like_a_table(head: &[u8]) -> bool {
    !head.contains(&0)
        && header_line(head_text(head)).is_none_or(|(line, separator)| {
            cells(line, separator).count() >= 2
                && !line.chars().any(|c| c.is_control() && c != '\t')
        })
}

fn read(input: &mut dyn Input, options: &ReadOptions) -> Placed<Recording> {
    let map = match &options.columns {
        None => None,
        Some(map) => Some(map.resolved().ok_or_else(|| {
            let id = map.preset.clone().unwrap_or_default();
            let known = crate::column_map::PRESETS;
            let nearest = nearest_word(&id, known).map(str::to_owned);
            (
                At::File,
                Problem::UnknownReader {
                    id,
                    known: known.join(", "),
                    nearest,
                },
            )
        })?),
    };
    let known = Known {
        joints: &options.joints,
        of_robot: options.of_robot,
        remarks: options.remarks.then_some(&[]),
    };
    let input = BufReader::with_capacity(1 << 16, input);
    let mut recording = read_table(input, map.as_ref(), known)?;
    if options
        .columns
        .as_ref()
        .and_then(|map| map.preset.as_deref())
        == Some("vive")
    {
        let note = "angles A, B, C taken as turns about fixed x, y, z (the log does not say)";
        recording.meta.conversions.push(note.to_string());
    }
    Ok(recording)
}
