//! Bodies and recordings as entries of a profile.

use calib_profile::edit::Value;
use calib_recording::ColumnMap;
use calib_report::terminal::{COLUMNS, wrapped};
use calib_urdf::{JointId, RobotModel};

use crate::fact::{Fact, Place};
use crate::proposal::{Body, Recording};
use crate::session::{Stream, Use};
use crate::words;
use crate::yaml;

/// A comment as lines that begin with `#`, to stand after `indent`.
#[must_use]
pub fn comment(indent: &str, text: &str) -> Vec<String> {
    let (first, rest) = (format!("{indent}# "), format!("{indent}#   "));
    let lines = wrapped(text, COLUMNS, &first, &rest);
    let lines = lines.trim_end().lines();
    lines.map(|line| line[indent.len()..].to_owned()).collect()
}

/// The facts about a part, as comments that stand after `indent`.
#[must_use]
pub fn comments(facts: &[Fact], indent: &str, place: &Place) -> Vec<String> {
    let of = |fact: &Fact| {
        let mark = if fact.check { "CHECK: " } else { "" };
        comment(indent, &format!("{mark}{}", words::sentence(&fact.about)))
    };
    let facts = facts.iter().filter(|fact| fact.place == *place);
    facts.flat_map(of).collect()
}

/// A body.
#[must_use]
pub fn body(model: &RobotModel, body: &Body) -> Value {
    let link = yaml::text(&model.link(body.link).name);
    let what = match body.markers.is_empty() {
        true => "pose: true".to_owned(),
        false => format!("markers: {}", yaml::list(&body.markers)),
    };
    Value::Flow(format!("{{link: {link}, {what}}}"))
}

/// Places of markers in a simulated body, mm: no three of the first four on a line, no symmetry.
#[must_use]
pub fn marker_mm(k: usize) -> [i32; 3] {
    const FIRST: [[i32; 3]; 4] = [[0, 0, 0], [80, 0, 0], [20, 60, 0], [45, 20, 40]];
    let further = || {
        let k = i32::try_from(k).unwrap_or(i32::MAX / 100);
        [90 + 10 * (k % 9), 7 * (k * k % 11), 5 * (k % 17)]
    };
    FIRST.get(k).copied().unwrap_or_else(further)
}

/// Where a simulated body is on its link, mm.
pub const MOUNT_MM: [i32; 3] = [30, 20, 40];

/// The mount of a body in a simulation.
#[must_use]
pub fn mount(body: &Body) -> Value {
    let of = |at: [i32; 3]| format!("[{}, {}, {}]", at[0], at[1], at[2]);
    let markers = body.markers.iter().enumerate();
    let markers = markers.map(|(k, name)| format!("{}: {}", yaml::text(name), of(marker_mm(k))));
    let markers: Vec<String> = markers.collect();
    let mut entries = vec![("xyz_mm".to_owned(), Value::Flow(of(MOUNT_MM)))];
    if !markers.is_empty() {
        let markers = format!("{{{}}}", markers.join(", "));
        entries.push(("markers_mm".to_owned(), Value::Flow(markers)));
    }
    Value::Map {
        anchor: None,
        entries,
    }
}

/// A recording; `columns`: a column map as its value, by itself or by an alias.
#[must_use]
pub fn recording<'r>(
    model: &RobotModel,
    recording: &'r Recording,
    mut columns: impl FnMut(&'r ColumnMap) -> Value,
) -> Vec<(String, Value)> {
    let flow = |text: &str| Value::Flow(text.to_owned());
    let mut entries: Vec<(String, Value)> = Vec::new();
    let mut push = |key: &str, value: Value| entries.push((key.to_owned(), value));
    push("file", Value::Flow(yaml::text(&recording.table.path)));
    match &recording.usage {
        Use::Sweep(swept) => {
            push("use", flow("sweep"));
            let swept: Vec<_> = swept
                .iter()
                .map(|(j, r)| (*j, reachable(model, *j, *r)))
                .collect();
            push("joints", Value::Flow(ranges(model, &swept)));
        }
        Use::Static => push("use", flow("static")),
        Use::Validation => push("use", flow("validation")),
    }
    if !recording.hold.is_empty() {
        let at = |(joint, at): &(JointId, f64)| {
            let scale = if model.joint(*joint).kind.turns() {
                1f64.to_degrees()
            } else {
                1e3
            };
            // As the profile states it elsewhere.
            format!("{}: {}", key(model, *joint), yaml::number(at * scale, 6))
        };
        let at: Vec<String> = recording.hold.iter().map(at).collect();
        push("hold", Value::Flow(format!("{{{}}}", at.join(", "))));
    }
    if let Some(map) = &recording.table.columns {
        push("columns", columns(map));
    }
    if let Some(log) = &recording.log {
        let mut of_log = vec![("file".to_owned(), Value::Flow(yaml::text(&log.path)))];
        if let Some(map) = &log.columns {
            of_log.push(("columns".to_owned(), columns(map)));
        }
        if recording.stream.is_none() {
            of_log.push(("rows".to_owned(), flow("same")));
        }
        let of_log = Value::Map {
            anchor: None,
            entries: of_log,
        };
        push("robot_log", of_log);
    }
    let far = recording
        .max_offset
        .map(|s| format!(", max_offset_s: {s:.0}"));
    let far = far.unwrap_or_default();
    match recording.stream {
        Some(Stream::Settle) => push("timing", flow(&format!("{{poses: settle{far}}}"))),
        Some(Stream::Continuous) => push("timing", flow(&format!("{{poses: continuous{far}}}"))),
        None => {}
    }
    entries
}

/// `elbow_deg`, `lift_mm`.
#[must_use]
pub fn key(model: &RobotModel, joint: JointId) -> String {
    let joint = model.joint(joint);
    let unit = if joint.kind.turns() { "deg" } else { "mm" };
    yaml::text(&format!("{}_{unit}", joint.name))
}

/// A position of a joint in the unit of its key.
#[must_use]
pub fn value(model: &RobotModel, joint: JointId, value: f64) -> String {
    match model.joint(joint).kind.turns() {
        true => yaml::number(value.to_degrees(), 1),
        false => yaml::number(value * 1e3, 1),
    }
}

/// What of a range a joint can reach by the URDF: a profile that asks for more is refused, and the readings may be wrong.
fn reachable(model: &RobotModel, joint: JointId, (low, high): (f64, f64)) -> (f64, f64) {
    match model.joint(joint).limits.range() {
        Some((lower, upper)) if low < upper && high > lower => (low.max(lower), high.min(upper)),
        Some(all) => all,
        None => (low, high),
    }
}

/// `{elbow_deg: [-90, 90]}`.
#[must_use]
pub fn ranges(model: &RobotModel, ranges: &[(JointId, (f64, f64))]) -> String {
    let of = |(joint, (low, high)): &(JointId, (f64, f64))| {
        format!(
            "{}: [{}, {}]",
            key(model, *joint),
            value(model, *joint, *low),
            value(model, *joint, *high)
        )
    };
    let all: Vec<String> = ranges.iter().map(of).collect();
    format!("{{{}}}", all.join(", "))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn markers_of_a_simulated_body_have_places_of_their_own() {
        let places: BTreeSet<[i32; 3]> = (0..60).map(marker_mm).collect();
        assert_eq!(places.len(), 60);
    }
}
