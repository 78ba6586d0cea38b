//! Rows in their order: jumps, gaps, motion within holds, rows that are used twice.

super::topic! {
    /// A sample far from its neighbors.
    JUMP = "jump" {
        "": Warning,
            "Jumps by up to {worst} relative to the neighboring rows; {usual} is usual.",
            "Drop these samples: a reflection or another marker was taken for this one.";
    }
    /// Rows are missing in time.
    TIME_GAP = "time-gap" {
        "": Warning,
            "{gaps:gap} in time, the longest {longest}; {usual} is usual.",
            "Use a cable, or a lower rate: the tracker or its network dropped frames.";
    }
    /// The robot moved where it should have stood still.
    UNSETTLED_ROWS = "unsettled-rows" {
        "spread": Warning,
            "The tracker's values spread over {spread} within the hold; noise explains {limit}.",
            "Wait longer before recording, or drop the first rows of the hold.";
        "drift": Warning,
            "Drifts by {drift} within the hold at {time:s}; noise explains {limit}.",
            "Wait longer before each hold, or stiffen the robot's stand.";
        "holds": Warning,
            "{restless} of {holds:hold} had not settled and were excluded.[[ `{name}` drifts by {drift} at {time:s}.]][[ `{name}` scatters by {scatter}; {usual} is usual.]]",
            "Wait longer before each hold, or stiffen the robot's stand.";
        "holds_kept": Warning,
            "{restless} of {holds:hold} had not settled, too many to reject.[[ `{name}` drifts by {drift} at {time:s}.]][[ `{name}` scatters by {scatter}; {usual} is usual.]]",
            "Wait longer before each hold, or stiffen the robot's stand.";
        "model": Warning,
            "In {count:row} the body deviates from the robot's model by up to {position} and {angle}, {ratio} times the usual.",
            "Drop these rows, or synchronize the clocks: the robot had not settled, or tracker and robot were read at different times.";
        "between": Warning,
            "In {count:row} the body deviates by up to {position}[[ and {angle}]]; interpolating the joint values toward an adjacent row explains it ({fraction:percent} in the worst row).",
            "Record again, in holds of a second: joints and tracker were read at different times, or the robot had not settled. The fit rejects these rows.";
    }
    /// Rows that stand in a recording twice.
    ROWS_REPEATED = "rows-repeated" {
        "within": Warning,
            "{repeated} of {rows:row} repeat an earlier row in every joint and every tracked value. They are copies of the same measurements and were left out.",
            "Remove the copies from the file: counted twice, they would make the uncertainties too small.";
        "recordings": Warning,
            "{repeated} of {rows:row} repeat rows of {of:code} in every joint and every tracked value. They are copies of the same measurements and were left out.",
            "Remove the recording from the profile, or the copies from its file: counted twice, they would make the uncertainties too small.";
        "origins": Warning,
            "{repeated} of {rows:row} repeat rows of {of:code} in every joint and every tracked value. Origins are found from both recordings, so that the same measurements count twice and the uncertainties are too small.",
            "Name one of the recordings as the `sweep` of all these origins, and remove the other one from the profile.";
    }
    /// A table with more rows than the tracker has frames.
    FRAMES_REPEATED = "frames-repeated" {
        "": Info,
            "In {repeated} of {rows:row} the values of {names} are, to the last digit, those of the row before, while the robot moves. One frame stands in up to {longest:row}: the file has more rows than the tracker had frames. Of each frame only the first row was used.",
            "Write a row for every frame of the tracker, with the joints' readings of that time, if you can: the time of a frame is known only to within a row.";
    }
    /// Validation rows that the fit uses as well.
    HELD_OUT_IN_TRAINING = "held-out-in-training" {
        "measurement": Error,
            "{shared} of {rows:held-out row} are measurements that the fit uses too[[, in `{training}`]].",
            "Validate with separate poses, ideally recorded on another day.";
        "pose": Warning,
            "{shared} of {rows:held-out row} repeat joint positions of the fit[[, in `{training}`]].",
            "Validate with separate poses, ideally recorded on another day.";
    }
}
