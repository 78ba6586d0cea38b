//! Recordings against the robot's model.

super::topic! {
    /// A joint has the opposite sign.
    JOINT_SIGN = "joint-sign" {
        "": Error,
            "The body's motion disagrees with link `{link}` by {claimed}, but only by {explained} with the opposite sign of joint `{joint}`.",
            "Reverse the sign of this joint's column, or of its axis in the URDF.";
    }
    /// Two joint columns are exchanged.
    JOINT_ORDER = "joint-order" {
        "": Error,
            "The body's motion disagrees with link `{link}` by {claimed}, but only by {explained} with joints `{joint}` and `{other}` exchanged.",
            "Exchange these joints' columns, or correct the joint names in the header.";
    }
    /// A body is on another link.
    WRONG_MOUNT = "wrong-mount" {
        "other_link": Error,
            "The body's motion disagrees with link `{link}` by {claimed}, but only by {explained} with link `{other}`.",
            "Correct the body's link in the profile: `link: {other}`.";
        "no_link": Error,
            "The body does not move with link `{link}`: the motions disagree by {claimed}, and no single mistake explains it.",
            "Check the body's link, that its name is on the right body, and that joints and tracker recorded the same motion.";
    }
    /// Tracker and joints were read at different times.
    CLOCK_LAG = "clock-lag" {
        "rows_before": Error,
            "The body's motion disagrees with link `{link}` by {claimed}, but only by {explained} with the joint values {rows:row} before.",
            "Synchronize the two, or record in holds: the joint values are ahead of the tracker.";
        "rows_after": Error,
            "The body's motion disagrees with link `{link}` by {claimed}, but only by {explained} with the joint values {rows:row} after.",
            "Synchronize the two, or record in holds: the joint values lag behind the tracker.";
        "offset": Warning,
            "The tracker's clock is {offset} ± {sigma} ahead of the robot's and runs {drift:ppm} faster.",
            "Use a shared clock if you can. The offset is taken into account.";
        "ambiguous": Error,
            "Offsets of {first} and {second} explain the motion nearly equally well (ratio {ratio}).",
            "Move irregularly once at the start, or record static poses: the motion is periodic.";
        "not_excited": Error,
            "The angular speed varies by {deviation}; aligning the clocks needs {needed}.",
            "Move faster, or record static poses.";
        "no_match": Error,
            "The two motions correlate by {correlation} at most; {needed} is needed.",
            "Check that both recordings are of the same motion, and check the body's link.";
        "too_short": Error,
            "Tracker and robot have too few samples in common.",
            "Record at least several seconds with both clocks running.";
    }
    /// Quaternions in another order.
    QUATERNION_ORDER = "quaternion-order" {
        "": Error,
            "The body's motion disagrees with the robot's by {claimed}, but only by {explained} with the quaternions read scalar first.",
            "Rename the columns, or list them under `quaternion_wxyz` in the column map: the file writes w, x, y, z.";
    }
    /// Another axis of the tracker points up.
    UP_AXIS = "up-axis" {
        "": Warning,
            "The declared up axis is {declared}, but the robot's base points {off} away from it, nearest to {nearest}.",
            "Export with the other axis up. If the robot is mounted that way, set `tracker: {up_axis: {nearest}}`.";
    }
    /// Rows that no fit explains.
    ROW_OUTLIER = "row-outlier" {
        "several_bodies": Error,
            "Several bodies disagree with the robot's model at once in {count:row}.",
            "Correct or drop the joint values of these rows.";
        "one_body": Warning,
            "{count:row} deviate by up to {position} and {angle}, {ratio} times the usual; no motion between rows explains it[[; an error of joint {joints:or} alone would]].",
            "Look at these rows: a wrong reading, or backlash of that joint. A robust fit rejects them.";
    }
}
