//! What changed while the data were recorded.

super::topic! {
    /// Something moved while the data were recorded.
    CHANGED_WHILE_RECORDING = "changed-while-recording" {
        "body": Warning,
            "Body `{body}` moved on its link by {distance} ± {sigma} and {angle} between rows {before} and {row}, or this part of the data differs for another reason.[[ The data show nearly as well that {rivals:code} moved.]][[ Missing physics explains as much: `{physics}`.]]",
            "Fasten the body and record again, or estimate one mount for each part: add `split: {recording: {recording}, at_row: {row}}` to the body in the profile.";
        "tracker": Warning,
            "The tracker, or the whole robot, moved by {distance} ± {sigma} and {angle} between rows {before} and {row}.[[ The data show nearly as well that {rivals:code} moved.]][[ Missing physics explains as much: `{physics}`.]]",
            "Secure the tracker and the robot's stand, and record again; until then keep only the rows of one side.";
        "joint": Warning,
            "The zero of this joint changed by {angle} ± {sigma_angle} between rows {before} and {row}.[[ The data show nearly as well that {rivals:code} moved.]][[ Missing physics explains as much: `{physics}`.]]",
            "Check the joint's encoder and its coupling, home the robot, and record again.";
        "axis": Warning,
            "The zero of this joint changed by {distance} ± {sigma} between rows {before} and {row}.[[ The data show nearly as well that {rivals:code} moved.]][[ Missing physics explains as much: `{physics}`.]]",
            "Check the joint's encoder and its coupling, home the robot, and record again.";
        "drift": Warning,
            "The tracker's frame drifted by {distance} ± {sigma} and {angle} from the first row to the last.[[ Missing physics explains as much: `{physics}`.]]",
            "Let tracker and robot warm up before recording, and record the poses in random order.";
        "scale": Warning,
            "The tracker reports lengths that differ by {scale:ppm} ± {sigma_scale:ppm} from those of the robot and the stated templates (positive: too long).",
            "Check the tracker's calibration and the unit of the export against a known length.";
    }
}
