//! Bodies of markers, and tracked bodies.

super::topic! {
    /// A distance on the body changes for good.
    BODY_REDEFINED = "body-redefined" {
        "from_row": Error,
            "The distance between `{first}` and `{second}` changes by {change} from row {row} on, and keeps its new value.",
            "Keep only the rows of one side, or write those of the other side to a recording of its own, in which the body has another name and is a body of its own in the profile: a marker was moved or relabeled, or the body was created again.";
        "marker_from_row": Error,
            "Marker `{marker}` moved on the body at row {row} and stayed there: only its distances change, by up to {change}.",
            "Leave the marker out of the body, or keep only the rows of one side: it slipped or was relabeled.";
        "between": Error,
            "The distance between `{first}` and `{second}` differs by {change} from that in `{other}`.",
            "Leave one of the recordings out, or give the body another name in it, with a column map of that recording (`columns: {markers: …}`, or `bodies`) and as a body of its own: a marker was moved or relabeled between them, or the body was created again.";
        "marker_between": Error,
            "Marker `{marker}` is at another place of the body than in `{other}`: only its distances differ, by up to {change}.",
            "Leave the marker out of the body, or give the body another name in one of the recordings, with a column map of that recording (`columns: {markers: …}`) and as a body of its own: the marker was moved or relabeled between them.";
    }
    /// A body that is not rigid.
    NOT_RIGID = "not-rigid" {
        "loose": Error,
            "Marker `{marker}` moves on the body: its distances to the others scatter by {scatter}.",
            "Fix the marker, or leave it out of the body.";
        "bends": Error,
            "The body is not rigid: the distance between `{first}` and `{second}` varies by {range}; {rows:row} affected. No single marker could be identified as the cause.",
            "Stiffen the body and fix its markers, or define bodies from markers whose mutual distances are constant.";
        "one_marker": Error,
            "Marker `{marker}` moves on the body: only its distances change, by up to {range}; {rows:row} affected.",
            "Fix the marker, or leave it out of the body.";
        "template": Error,
            "The body differs from its template by up to {difference} in a distance.",
            "Check the order of the markers, or remove the template so that it is learned from the recording.";
        "template_marker": Warning,
            "Marker `{marker}` is not where the template has it: only its mean distances differ from the template's, by up to {difference}.",
            "Measure the marker's place on the body again, or remove the template so that it is learned from the recording.";
        "template_distance": Warning,
            "The mean distance between `{first}` and `{second}` differs from that in the template by {difference}. No single marker explains it.",
            "Measure the markers' places on the body again, or remove the template so that it is learned from the recording.";
    }
    /// Markers exchanged in some rows.
    MARKER_SWAP = "marker-swap" {
        "": Error,
            "The labels of markers {markers:exchange} are exchanged; {rows:row} in all.",
            "Correct the labels in the tracker's software, or drop these rows.";
    }
    /// Exchanged labels that were corrected.
    MARKER_SWAP_REPAIRED = "marker-swap-repaired" {
        "rows": Warning,
            "{rows:row} had exchanged labels, corrected by the distances between the markers: {exchanges}.",
            "Place the markers at clearly different distances before the next recording. This recording needs nothing.";
        "bodies_in_rows": Warning,
            "Bodies `{first}` and `{second}` have each other's labels in {rows:row}: each has there the shape that the other has elsewhere. This was corrected.",
            "Correct the labels in the tracker's software, and give the bodies clearly different shapes before the next recording. This recording needs nothing.";
        "markers_in_rows": Warning,
            "Markers `{first}` and `{second}` have each other's labels in {rows:row}: exchanged, both bodies have the shape that they have elsewhere. This was corrected.",
            "Correct the labels in the tracker's software. This recording needs nothing.";
        "between_bodies": Warning,
            "Markers `{first}` and `{second}` have each other's labels: the distances in their bodies change by {change}, and exchanged both are rigid. This was corrected.",
            "Correct the labels in the tracker's software, or state it in the profile where all recordings have them so: `names: {{first}: {second}, {second}: {first}}`.";
    }
    /// One marker out of place in some rows.
    MARKER_OUTLIER = "marker-outlier" {
        "": Warning,
            "A marker is out of place in {rows:row}; the worst is `{marker}`, by {off}.",
            "Drop these samples: a reflection or a neighboring marker was taken for the marker. Those that are grossly off are left out.";
    }
    /// A body of very many markers, as a few points.
    BODY_CONDENSED = "body-condensed" {
        "all_rows": Info,
            "Its {markers} markers take part in the fit as {points} points, which say as much of its pose.",
            "Nothing is to be done. Residuals are those of the points.";
        "some_lost": Warning,
            "Its {markers} markers take part in the fit as {points} points, which say as much of its pose. Too few of them, or only markers near one plane, were seen in {rows:row}, which the fit leaves out.",
            "Show the cameras markers on more than one side of the body.";
    }
    /// The mirror image fits.
    MIRRORED = "mirrored" {
        "template": Error,
            "The body fits the mirror image of its template to {mirrored}, the template only to {plain}.",
            "Check the axes of the export: the recording's frame is left-handed, or an axis has the wrong sign.";
        "tracker": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with one axis of the tracker reversed[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Check the axes of the export: the tracker's frame is left-handed, or an axis has the wrong sign.[[ Or correct {equivalent:code}: before you choose, move one of these joints and compare its direction with the axis in the URDF.]]";
    }
    /// A marker moves on its body over all recordings together.
    BODY_NOT_RIGID = "body-not-rigid" {
        "": Warning,
            "Marker `{marker}` moves on its body by {distance} (limit {limit}).",
            "Fix the marker, correct its label, or remove it from the body in the profile.";
    }
    /// Quaternions whose length is not 1.
    NOT_UNIT_ROTATION = "not-unit-rotation" {
        "kept": Error,
            "{count:quaternion} with a length up to {worst} away from 1.",
            "Normalize them where they are made, and check the order of the columns.";
        "lost": Warning,
            "{count:quaternion} not a rotation; taken as lost.",
            "Check the node that publishes them.";
    }
    /// A body changes its orientation abruptly.
    BODY_FLIP = "body-flip" {
        "rows": Error,
            "The body rotates by more than {limit} between two rows, {count:time}; {usual} is usual.",
            "Drop the flipped rows, and move one marker: the marker pattern is nearly symmetric.";
        "model": Error,
            "In {count:row} the body deviates from the robot's model by up to {position} and {angle}, {ratio} times the usual.",
            "Drop the flipped rows, and move one marker: the marker pattern is nearly symmetric.";
    }
}
