//! Single markers.

super::topic! {
    /// Samples at exactly (0, 0, 0).
    ALL_ZERO_TRIPLET = "all-zero-triplet" {
        "kept": Warning,
            "{samples:sample} at exactly (0, 0, 0).",
            "Leave the cells of a lost sample empty.";
        "lost": Warning,
            "{samples:sample} at exactly (0, 0, 0); taken as lost.",
            "Export lost samples as empty. If the origin is a measured place, set `columns: {zero_is_a_point: true}` for the recording.";
    }
    /// Samples whose three coordinates are one number that stands for nothing.
    PLACEHOLDER_TRIPLET = "placeholder-triplet" {
        "known": Warning,
            "{samples:sample} whose coordinates are all the same number, one that stands for a lost sample; taken as lost.",
            "Export lost samples as empty.";
        "repeated": Warning,
            "{samples:sample} whose coordinates are all exactly {value}, far from the others of the marker; taken as lost.",
            "Export lost samples as empty.";
    }
    /// Poses without a position or without an orientation.
    HALF_A_POSE = "half-a-pose" {
        "": Warning,
            "{samples:sample} with a position and no orientation, or an orientation and no position; taken as lost.",
            "Export lost samples as empty. If the tracker sees a point only, give it as a marker.";
    }
    /// Two markers with the same coordinates.
    DUPLICATE_COLUMN = "duplicate-column" {
        "": Error,
            "The marker equals marker `{other}` in {equal} of {shared:row}.",
            "Check the marker's label in the tracker's software, or leave the copy out: one column was written twice.";
    }
    /// A marker or body repeats its value while other things move.
    FROZEN = "frozen" {
        "marker": Error,
            "The marker stands exactly still in {rows:row} while other markers move.",
            "Set the tracker to export lost samples as empty: it repeated its last value.";
        "body": Error,
            "The body stands exactly still in {rows:row} while joints or other bodies move.",
            "Set the tracker to export lost samples as empty: it repeated its last pose.";
    }
    /// Markers that were computed from a fitted body.
    VIRTUAL_POINTS = "virtual-points" {
        "": Warning,
            "The distances between {markers} scatter by at most {scatter:um}.",
            "Export the measured markers, or use these points as one body pose: they were computed from a fitted body.";
    }
    /// A pose and the markers that the tracker computed it from both take part.
    POSE_OF_MARKERS = "pose-of-markers" {
        "": Warning,
            "The pose of {body:code} is the least-squares fit of the markers of {other:code}: the tracker computed it from them. Both take part, so the same measurements count twice and the uncertainties come out too small, by a factor of up to 1.4.",
            "Remove the line of {body:code} from `bodies` and keep the markers: they show the tracker's noise.";
    }
    /// A marker or body is lost in most rows.
    MANY_LOST = "many-lost" {
        "": Warning,
            "Lost, or only interpolated, in {lost} of {rows:row}.",
            "Move the cameras or the marker, or leave it out.";
    }
    /// The profile names a marker that the recording lacks.
    MISSING_MARKER = "missing-marker" {
        "": Error,
            "The recording has no column for marker {markers:code}; it has {known}.",
            "[[Did you mean {nearest:code}? ]]Correct the marker's name in the profile.";
    }
    /// A recording lacks the body whose sweep it is, has none of the profile's bodies, or has one under another name.
    MISSING_BODY = "missing-body" {
        "swept": Error,
            "The recording is the sweep of this body and has no column of it; it has {known}.",
            "[[Did you mean {nearest:code}? ]]Correct the names in the profile, or map those of the recording with `names`.";
        "renamed": Warning,
            "The recording has no column of this body, and has {nearest:code}.",
            "If that is the body, map its names with `names`, or correct those in the profile.";
        "all": Error,
            "The recording has no column of {bodies:code}; it has {known}.",
            "[[Did you mean {nearest:code}? ]]Correct the names in the profile, or map those of the recording with `names`.";
    }
}
