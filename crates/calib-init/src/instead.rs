//! What a file is that was given as the URDF and is none.

use calib_recording::readers::{HEAD_BYTES, readers};
use calib_urdf::{Problem, ReadError, RobotModel};

use crate::columns::guess;
use crate::error::{InitError, Instead};
use crate::header::header;

/// Bytes of the file that are looked at.
pub const HEAD: usize = 1 << 20;

/// Why the robot cannot be read: where the file is no XML, what it is instead. `head`: its first bytes, at most [`HEAD`] of them.
#[must_use]
pub fn not_a_urdf(file: &str, error: ReadError, head: &[u8]) -> InitError {
    let of_text = |problem: &Problem| {
        matches!(
            problem,
            Problem::Xml { .. } | Problem::NotUtf8 { .. } | Problem::TooLarge { .. }
        )
    };
    let may_be_another = error.problems.iter().all(|found| of_text(&found.problem));
    match instead(head).filter(|_| may_be_another) {
        Some(found) => InitError::NotAUrdf {
            file: file.to_owned(),
            found,
        },
        None => error.into(),
    }
}

/// What some bytes are; `None` where they begin as XML does, and of nothing.
fn instead(head: &[u8]) -> Option<Instead> {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    let first = text.iter().find(|byte| !byte.is_ascii_whitespace())?;
    if *first == b'<' {
        return None;
    }
    if is_profile(&String::from_utf8_lossy(text)) {
        return Some(Instead::Profile);
    }
    let begin = &head[..head.len().min(HEAD_BYTES)];
    let reader = readers().iter().find(|reader| (reader.detect)(begin));
    // Any table is one of the last reader's.
    if let Some(reader) = reader.filter(|reader| reader.id != "csv") {
        return Some(Instead::Recording(reader.name));
    }
    if text.contains(&0) {
        return Some(Instead::Binary);
    }
    let table = header(head).filter(|t| (0..t.names.len()).any(|i| t.has_numbers(i)));
    if let Some(table) = table {
        let bodies = RobotModel::from_urdf_text(NO_JOINTS, "none").ok();
        let bodies = bodies.map(|model| guess(&model, &table).map.bodies);
        let bodies: Vec<String> = bodies.into_iter().flatten().map(|b| b.0).collect();
        return Some(match <[String; 2]>::try_from(bodies) {
            Ok(pair) => Instead::Pairs(pair),
            Err(_) => Instead::Table(table.names),
        });
    }
    let is_text = |bytes: &[u8]| match std::str::from_utf8(bytes) {
        Ok(_) => true,
        // The last character may be cut.
        Err(e) => e.error_len().is_none(),
    };
    Some(match is_text(text) {
        true => Instead::Text,
        false => Instead::Binary,
    })
}

/// A robot of which no column is a joint.
const NO_JOINTS: &str = "<robot name=\"none\"><link name=\"none\"/></robot>";

/// Whether a text is a profile of calib: the version is a key of the first level of every profile, and of nothing else.
pub(crate) fn is_profile(text: &str) -> bool {
    text.lines().any(|line| {
        let version = line.strip_prefix("calib:").map(str::trim);
        version.is_some_and(|v| v.starts_with(|c: char| c.is_ascii_digit()))
    })
}
