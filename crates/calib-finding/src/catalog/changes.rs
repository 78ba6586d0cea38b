//! What changed while the data were recorded, and what successive rows share.

super::topic! {
    /// Successive rows of one posture.
    FRAMES_MERGED = "frames-merged" {
        "": Info,
            "The {rows:row} show {poses:pose}: successive rows in which the joints rest, within 0.011° or 0.2 mm, were merged into their mean, which counts once.[[ {copies:row} repeat the row before in every tracked value.]]",
            "Nothing is needed. Record more poses rather than more frames of a pose: the frames share the error of the posture.";
    }
    /// Residuals of successive rows are correlated.
    NOISE_HAS_MEMORY = "noise-has-memory" {
        "apart": Warning,
            "The residuals of successive rows are correlated ({correlation}). The stated uncertainties allow for it and are up to {factor} times larger than for independent noise.",
            "Record the poses in random order and wait between them; switch off filters of the tracker. If an effect is named as missing, enable it first.";
        "together": Warning,
            "Everything that the tracker sees moves together from row to row, by amounts that are correlated in successive rows ({correlation}). The stated uncertainties allow for it and are up to {factor} times larger than for independent noise.",
            "Let tracker and stand warm up, keep drafts and vibrations away, and record the poses in random order. If an effect is named as missing, enable it first.";
    }
    /// Too few rows for the tests of the fit.
    NOT_TESTED = "not-tested" {
        "": Warning,
            "The fit leaves {freedom} degrees of freedom; testing the residuals needs {needed}. Missing effects, and changes while the data were recorded, cannot be detected.",
            "Record more postures, or markers on more links.";
    }
    /// Something moved while the data were recorded.
    CHANGED_WHILE_RECORDING = "changed-while-recording" {
        "body": Warning,
            "Body `{body}` moved on its link by {distance} ± {sigma}[[ and {angle}]] between row {before}[[ of `{before_in}`]] and row {row}, or another change affected this part of the data.[[ Nearly as likely: {rivals:code} moved.]][[ Nearly as likely: the zeros of {zeros:code} changed.]][[ An effect explains the data as well: {alternatives:code}.]][[ Missing physics explains as much: `{physics}`.]]",
            "Fasten the body and record again, or estimate one mount for each part: add `split: {recording: {recording}, at_row: {row}[[, before: {earlier:list}]]}` to the body in the profile, and list held-out recordings that were made before the change under `before` as well.";
        "tracker": Warning,
            "The tracker, or the whole robot, moved by {distance} ± {sigma}[[ and {angle}]] between row {before}[[ of `{before_in}`]] and row {row}.[[ Nearly as likely: {rivals:code} moved.]][[ Nearly as likely: the zeros of {zeros:code} changed.]][[ An effect explains the data as well: {alternatives:code}.]][[ Missing physics explains as much: `{physics}`.]]",
            "Secure the tracker and the robot's stand, and record again; until then keep only the rows of one side.";
        "joint": Warning,
            "The zero of this joint changed by {angle} ± {sigma_angle} between row {before}[[ of `{before_in}`]] and row {row}.[[ Nearly as likely: {rivals:code} moved.]][[ Nearly as likely: the zeros of {zeros:code} changed.]][[ An effect explains the data as well: {alternatives:code}.]][[ Missing physics explains as much: `{physics}`.]]",
            "Check the joint's encoder and its coupling, and whether the robot took up or put down a load there. Home it, and record again.";
        "axis": Warning,
            "The zero of this joint changed by {distance} ± {sigma} between row {before}[[ of `{before_in}`]] and row {row}.[[ Nearly as likely: {rivals:code} moved.]][[ Nearly as likely: the zeros of {zeros:code} changed.]][[ An effect explains the data as well: {alternatives:code}.]][[ Missing physics explains as much: `{physics}`.]]",
            "Check the joint's encoder and its coupling, and whether the robot took up or put down a load there. Home it, and record again.";
        "zeros": Warning,
            "The zeros of joints {joints:code} changed between row {before}[[ of `{before_in}`]] and row {row}, most clearly that of `{joint}`: by [[{angle} ± {sigma_angle}]][[{distance} ± {sigma}]].[[ Nearly as likely: {rivals:code} moved.]][[ An effect explains the data as well: {alternatives:code}.]][[ Missing physics explains as much: `{physics}`.]]",
            "If the robot was homed or its controller restarted in between, its zeros are those of one homing: record everything after one homing, or keep only the rows of one side. Otherwise check the encoders and couplings of these joints, and whether the robot took up or put down a load there.";
        "tracker-far": Error,
            "The tracker, or the whole robot, moved by {distance} and {angle} between row {before} and row {row}[[; {later:code} came after]]: with that the recordings fit the nominal robot to {best} rms, without it to {none} rms, where nominal errors explain {limit}.[[ Nearly as likely: {rivals:code} moved.]]",
            "Secure the tracker and the robot's stand, and record again; until then keep only the rows of one side.";
        "body-far": Error,
            "Body `{body}` moved on its link[[ by {distance}]][[ and {angle}]] between row {before} and row {row}[[; {later:code} came after]]: with that the recordings fit the nominal robot to {best} rms, without it to {none} rms, where nominal errors explain {limit}.[[ Nearly as likely: {rivals:code} moved.]]",
            "Fasten the body and record again, or estimate one mount for each part: add `split: {recording: {recording}, at_row: {row}[[, before: {earlier:list}]]}` to the body in the profile, and list held-out recordings that were made before the change under `before` as well.";
        "joint-far": Error,
            "The zero of this joint changed by [[{angle}]][[{distance}]] between row {before} and row {row}[[; {later:code} came after]]: with that the recordings fit the nominal robot to {best} rms, without it to {none} rms, where nominal errors explain {limit}.[[ Nearly as likely: {rivals:code} moved.]]",
            "Check the joint's encoder and its coupling, home the robot, and record again; until then keep only the rows of one side.";
        "names-after": Error,
            "Bodies `{body}` and `{other}` have each other's names from row {row} on[[; {later:code} came after]]: with the names exchanged there, the recordings fit the nominal robot to {best} rms, without that to {none} rms, where nominal errors explain {limit}.[[ Nearly as likely: {rivals:code} moved.]]",
            "Correct the names in the tracker's software, or in the rows from {row} on[[, and in {later:code}]]. Give the bodies clearly different shapes before the next recording.";
        "names-before": Error,
            "Bodies `{body}` and `{other}` have each other's names up to row {before}[[; {earlier:code} came before]]: with the names exchanged there, the recordings fit the nominal robot to {best} rms, without that to {none} rms, where nominal errors explain {limit}.[[ Nearly as likely: {rivals:code} moved.]]",
            "Correct the names in the tracker's software, or in the rows up to {before}[[, and in {earlier:code}]]. Give the bodies clearly different shapes before the next recording.";
        "rows-earlier": Error,
            "From row {row} on, the joint values that belong to a row stand {rows:row} earlier: with them paired so, the recordings fit the nominal robot to {best} rms, without that to {none} rms, where nominal errors explain {limit}.[[ Nearly as likely: {rivals:code} moved.]]",
            "Joint values were lost between row {before} and row {row}, or the tracker wrote more rows. Pair the two tables by their times, or keep only the rows before {row}.";
        "rows-later": Error,
            "From row {row} on, the joint values that belong to a row stand {rows:row} later: with them paired so, the recordings fit the nominal robot to {best} rms, without that to {none} rms, where nominal errors explain {limit}.[[ Nearly as likely: {rivals:code} moved.]]",
            "Rows of the tracker were lost between row {before} and row {row}, or the robot wrote more. Pair the two tables by their times, or keep only the rows before {row}.";
        "drift": Warning,
            "The tracker's frame drifted by {distance} ± {sigma}[[ and {angle}]] from the first row to the last.[[ Missing physics explains as much: `{physics}`.]]",
            "Let tracker and robot warm up before recording, and record the poses in random order.";
        "settling": Warning,
            "The tracker's frame drifted by {distance} ± {sigma}[[ and {angle}]] from the first row to the last, fast at first and slower later, as a tracker or a stand that warms up.[[ Missing physics explains as much: `{physics}`.]]",
            "Let tracker and robot warm up before recording, and record the poses in random order.";
        "scale": Warning,
            "The tracker reports lengths that differ by {scale:ppm} ± {sigma_scale:ppm} from those of the robot and the stated templates (positive: too long).",
            "Check the tracker's calibration and the unit of the export against a known length.";
    }
    /// All lengths of a recording differ in one ratio from those of another one.
    TRACKER_SCALE = "tracker-scale" {
        "": Error,
            "Lengths in this recording are {scale:percent} (± {sigma:percent}) longer than in `{other}` (negative: shorter), alike for all bodies.",
            "Record again without calibrating the tracker in between, or leave the recording out. If its file was written with another scale, export it again.";
    }
    /// A body that no joint moves moves in the tracker's frame, and the others with it.
    TRACKER_SWAYS = "tracker-sways" {
        "": Warning,
            "Body `{body}`, which no joint moves, moves by {motion} rms from row to row in the tracker's frame, and the other bodies move with it: the tracker, or what the robot stands on, does not stand still. This explains {explains:percent} of their squared residuals.",
            "Fasten the tracker and the robot's stand, and record again. Where the tracker must move, let its program report all coordinates in the frame of `{body}`; the noise of that frame then moves the other bodies, more the farther away they are.";
    }
    /// A body that no joint moves follows the arm.
    BASE_MOVES = "base-moves" {
        "": Warning,
            "Body `{body}`, which no joint moves, moves with the arm: by {motion} rms and by up to {largest} from its mean place in the tracker's frame. This is {share:percent} of its squared deviations. The base, or what it stands on, yields under the arm. The fit takes part of this motion for geometry or for effects of the joints, and these parameters are then off by more than their uncertainties.",
            "Fasten the base, stiffen what it stands on, and record again. If this is how the robot works, fasten the tracker to the same base, or let its program report all coordinates in the frame of `{body}`, with markers that are far apart.";
    }
    /// The errors are a smooth function of the place in the tracker's volume.
    ERRORS_FOLLOW_PLACE = "errors-follow-place" {
        "": Warning,
            "The residuals follow the place in the tracker's frame: a smooth displacement of about {rms} rms explains {explains:percent} of χ², more than effects of the joints do. Either the tracker distorts its volume, bodies are seen by trackers that do not agree, or a guide, a bearing or what the robot stands on is bent or yields. The fit takes part of such a displacement for geometry, and these parameters are then off by more than their uncertainties.",
            "Measure a bar of known length at several places of the volume, and calibrate the tracker again where the lengths differ. If they agree, look for what is bent or yields. To separate the two, move the tracker and record again: errors of the tracker stay at their places in its volume, errors of the robot stay with the postures.";
    }
    /// Nothing of the joints is free although they are not as the URDF says.
    JOINTS_HELD = "joints-held" {
        "": Warning,
            "The profile estimates no parameter of a joint. The residuals of the fitted recordings are {none} rms, and {best} if the offsets and axes of the joints are estimated: the robot is not as its URDF says.",
            "To calibrate the robot, add `joint_offsets` and `joint_axes` to `solve: {free: …}`. To verify the URDF as it is, nothing needs to be changed: the errors in the report are its errors.";
    }
    /// A joint stops off its readings by more than the others.
    JOINT_SCATTERS = "joint-scatters" {
        "rows": Warning,
            "Joint `{joint}` deviates from its readings by {sigma} (σ), differently in each row and more than the other joints. That explains what else looks like a change while recording or like a missing effect.",
            "Check the encoder, the coupling and the brake of this joint, and record a row only when the joint is at rest. If it does scatter like this, state `solve: {noise: {model: joint_each}}`.";
        "stops": Warning,
            "Joint `{joint}` deviates from its readings by {sigma} (σ), differently at each stop and more than the other joints. That explains what else looks like a change while recording or like a missing effect.",
            "Check the encoder, the coupling and the brake of this joint, and look for effects of its gear. In the poses to come, let the joint stop often and from both sides.";
        "readings": Warning,
            "The readings of joint `{joint}` scatter by {sigma} (σ) while the tracker sees the joint at rest.",
            "Check the encoder, its cable and the program that records it, or record the mean of the readings of each rest. Until then, state `solve: {noise: {model: joint_each}}`.";
    }
}
