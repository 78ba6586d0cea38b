//! Bodies and recordings as entries of a profile.

use calib_profile::edit::Value;
use calib_recording::ColumnMap;
use calib_report::terminal::wrapped;
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
    let lines = wrapped(text, &first, &rest);
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
            push("joints", Value::Flow(ranges(model, swept)));
        }
        Use::Static => push("use", flow("static")),
        Use::Validation => push("use", flow("validation")),
    }
    if !recording.hold.is_empty() {
        let at = |(joint, at): &(JointId, f64)| {
            format!("{}: {}", key(model, *joint), value(model, *joint, *at))
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
