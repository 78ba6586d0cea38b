//! What readers notice in files.

super::topic! {
    /// Frame numbers or stamps out of order.
    ROWS_OUT_OF_ORDER = "rows-out-of-order" {
        "frames": Warning,
            "{count:frame number} not larger than the one before.",
            "Cut the log there: it may hold several recordings, or datagrams out of order.";
        "sorted": Info,
            "{count:message} out of order; sorted by time.",
            "Check whether several nodes publish this topic; otherwise nothing is needed.";
    }
    /// Frames without time.
    NO_TIME = "no-time" {
        "": Warning,
            "{without} of {frames:frame} have no time stamp; the recording is read without time.",
            "Switch on `ts` or `ts2` in DTrack's output.";
    }
    /// Cells without a finite number.
    NOT_A_NUMBER = "not-a-number" {
        "cells": Warning,
            "{count:cell} with a non-finite value; taken as lost.",
            "Leave the cells empty where nothing was measured.";
        "points": Warning,
            "{count:point} with non-finite values; taken as lost.",
            "Export the file again.";
    }
    /// One name for several things.
    DUPLICATE_NAME = "duplicate-name" {
        "": Warning,
            "The name `{name}` occurs {count:time}; this one is now called `{unique}`.",
            "Give every marker and body its own name in the tracker's software.";
    }
    /// Another number of frames than the header says.
    FRAME_COUNT_DIFFERS = "frame-count-differs" {
        "": Warning,
            "The header states {promised:frame}, the file has {found}.",
            "Check that the file was written to its end.";
    }
    /// A file that does not say its unit.
    UNIT_MISSING = "unit-missing" {
        "": Warning,
            "The file does not state its unit of length; millimeters are assumed.",
            "Check one distance against the body.";
    }
    /// The last row of a live recording is incomplete.
    ROW_CUT_OFF = "row-cut-off" {
        "": Info,
            "The last row was cut off while it was being written; it is left out.",
            "Continue with `calib record --append` if you need more rows; otherwise nothing is needed.";
    }
    /// A column that nothing uses.
    COLUMN_IGNORED = "column-ignored" {
        "": Info,
            "The column map does not mention {columns}, and the robot has no joint of that name; ignored.",
            "Map the column if it matters.";
    }
    /// A name of the tracker that the profile states, and that no recording has.
    TRACKER_NAME_UNUSED = "tracker-name-unused" {
        "": Info,
            "The profile says that the tracker calls `{name}` `{tracker}`, and no recording has the name `{tracker}`. Where a recording has the name `{name}`, that is used.",
            "Correct the name under `names`, or remove it if the recordings have the profile's names.";
    }
}
