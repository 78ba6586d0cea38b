//! Recordings.

use super::*;
use crate::profile::{RecordingSpec, RobotLog, Timing};
use crate::raw::{RawRecording, RawTiming, RawUse};

impl Checker<'_> {
    pub(super) fn recording(&mut self, name: &str, raw: &RawRecording) -> RecordingSpec {
        let mut ranges = BTreeMap::new();
        for (key, range) in &raw.joints {
            let path = ["recordings", name, "joints", key];
            if let Some((joint, factor)) = self.joint_key(&path, key) {
                let (low, high) = (
                    range[0].min(range[1]) * factor,
                    range[0].max(range[1]) * factor,
                );
                self.within_limits(&path, joint, low, high);
                ranges.insert(joint, (low, high));
            }
        }
        let hold = self.joint_values(&["recordings", name, "hold"], &raw.hold);
        for joint in hold.keys().filter(|j| ranges.contains_key(j)) {
            let joint = self.robot.joint(*joint).name.clone();
            self.problem(
                &["recordings", name, "hold"],
                format!("`{joint}` cannot both move and be held"),
                "keep it under `joints` or under `hold`",
            );
        }
        if raw.usage == RawUse::Sweep && raw.joints.is_empty() {
            self.key_problem(
                &["recordings", name],
                format!("sweep `{name}` names no joint that moves"),
                "add `joints: {<joint>_deg: [from, to]}`",
            );
        }
        let rows = raw.robot_log.as_ref().map(|log| log.rows.is_some());
        match (rows, raw.timing.is_some()) {
            (Some(false), false) => self.key_problem(
                &["recordings", name, "robot_log"],
                "two files have two sets of rows",
                "add `timing: {}` for two clocks: holds become poses; or `rows: same` to the log if both have one row for every posture",
            ),
            (Some(true), true) => self.key_problem(
                &["recordings", name, "robot_log", "rows"],
                "with `timing` the clocks tell which rows belong together",
                "remove `rows`, or `timing`",
            ),
            _ => {}
        }
        if raw.reader.is_none() && !raw.reader_parameters.is_empty() {
            self.key_problem(
                &["recordings", name, "reader_parameters"],
                "no reader is named that these could be parameters of",
                "add `reader: <reader>`, or remove the key; `calib plugins` lists readers",
            );
        }
        if let Some(map) = &raw.columns {
            self.column_map(&["recordings", name, "columns"], map);
        }
        if let Some(map) = raw.robot_log.as_ref().and_then(|log| log.columns.as_ref()) {
            self.column_map(&["recordings", name, "robot_log", "columns"], map);
        }
        let timing = raw.timing.as_ref().map(|timing| self.timing(name, timing));
        RecordingSpec {
            file: raw.file.clone(),
            usage: raw.usage,
            ranges,
            hold,
            group: raw.group.clone(),
            reader: raw.reader.clone(),
            reader_parameters: raw.reader_parameters.clone(),
            columns: raw.columns.clone(),
            robot_log: raw.robot_log.as_ref().map(|log| RobotLog {
                file: log.file.clone(),
                reader: log.reader.clone(),
                columns: log.columns.clone(),
            }),
            timing,
            place: raw.place.0,
        }
    }

    fn timing(&mut self, name: &str, raw: &RawTiming) -> Timing {
        for (key, value) in [
            ("hold_s", raw.hold_s),
            ("rate_hz", raw.rate_hz),
            ("max_offset_s", raw.max_offset_s),
        ] {
            self.above_zero(&["recordings", name, "timing", key], value);
        }
        let mut late = BTreeMap::new();
        for (joint, ms) in &raw.late_ms {
            let path = ["recordings", name, "timing", "late_ms", joint];
            if !ms.is_finite() {
                self.problem(&path, format!("{ms} is not a time"), "give ms, e.g. 30");
            }
            if let Some(joint) = self.joint(&path, joint) {
                late.insert(joint, ms * 1e-3);
            }
        }
        Timing {
            late,
            poses: raw.poses,
            clock: raw.clock,
            hold: raw.hold_s,
            rate: raw.rate_hz,
            max_offset: raw.max_offset_s,
        }
    }
}
