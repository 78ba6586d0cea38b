//! Column maps: what is wrong with one whatever the table.

use calib_recording::{ColumnMap, MapFault, PRESETS, StatedUnits, WHOLE_ROBOT};

use super::*;

impl Checker<'_> {
    /// Checks the map at this path. Maps that are shared by recordings are the same text: each fault is named once.
    pub(super) fn column_map(&mut self, path: &[&str], map: &ColumnMap) {
        let Some(resolved) = map.resolved() else {
            let preset = map.preset.as_deref().unwrap_or_default();
            let finding = format!("no preset of column maps is called `{preset}`");
            let path = [path, &["preset"]].concat();
            return self.once(&path, finding, expected(preset, PRESETS));
        };
        let joints_known = self.mapped_joints(path, map);
        let stated = |key| self.places.key(&[path, &[key]].concat()).is_some();
        let stated = StatedUnits {
            angles: stated("angles"),
            lengths: stated("lengths"),
        };
        for fault in resolved.faults(stated) {
            // A name of `reversed` may be missing because the joint beside it is misspelled.
            if matches!(fault, MapFault::NotReversible { .. }) && !joints_known {
                continue;
            }
            let steps = fault.path();
            let steps = steps.iter().map(String::as_str);
            let path: Vec<&str> = path.iter().copied().chain(steps).collect();
            self.once(&path, fault.to_string(), fault.remedy());
        }
    }

    /// Whether every joint of the map is one of the robot.
    fn mapped_joints(&mut self, path: &[&str], map: &ColumnMap) -> bool {
        let mut known = true;
        let keys = [
            ("joints", &map.joints),
            ("prismatic", &map.prismatic),
            ("torques", &map.torques),
            ("temperatures", &map.temperatures),
        ];
        for (key, joints) in keys {
            let of_all = |joint: &str| key == "temperatures" && joint == WHOLE_ROBOT;
            for joint in joints.keys().filter(|joint| !of_all(joint)) {
                known &= self.joint(&[path, &[key, joint]].concat(), joint).is_some();
            }
        }
        for (i, joint) in map.joint_columns.iter().enumerate() {
            let i = i.to_string();
            let path = [path, &["joint_columns", i.as_str()]].concat();
            known &= self.joint(&path, joint).is_some();
        }
        known
    }

    /// Notes a problem that other recordings may have too.
    fn once(&mut self, path: &[&str], finding: String, remedy: String) {
        let place = self.places.value(path);
        let (_, places) = self.unknown.entry(finding).or_insert((remedy, Vec::new()));
        places.push(place);
    }
}
