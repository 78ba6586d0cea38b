//! Recordings against the robot's model.

super::topic! {
    /// A joint has the opposite sign.
    JOINT_SIGN = "joint-sign" {
        "": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with the opposite sign of joint `{joint}`[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Negate this joint's column in the profile: `columns: {{map}: {{joint}: <column>}, reversed: [{joint}]}`, or reverse its axis in the URDF: `<axis xyz=\"{axis}\"/>`.[[ First rule out {equivalent:code}: only if joint `{joint}`, moved by a positive amount, moves against its axis in the URDF is its sign wrong.]]";
    }
    /// A joint moves along another axis than the URDF has.
    JOINT_AXIS = "joint-axis" {
        "": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with the axis of joint `{joint}`[[, which follows `{follows}`,]] along `{axis}`[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Compare the axis in the URDF with the robot: `<axis xyz=\"{axis}\"/>` in the frame of joint `{joint}`; without this element it is `1 0 0`.[[ A reversed axis of a joint that follows another one is a `multiplier` in `<mimic joint=\"{follows}\"/>` of the other sign.]]";
    }
    /// Joint columns hold the values of other joints.
    JOINT_ORDER = "joint-order" {
        "two": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with joints `{joint}` and `{other}` exchanged[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Exchange the names of these columns in the header, or map them: `columns: {{map}: {{joint}: <column of {other}>, {other}: <column of {joint}>}}`.";
        "several": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with {count} joint columns in another order[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Correct the names in the header, or map each joint to the column that holds its values: `columns: {{map}: {{entries}}}`.";
    }
    /// The zero of a joint is off farther than nominal errors explain, or a joint that never moved stood elsewhere than it was read.
    JOINT_OFFSET = "joint-offset" {
        "turned": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with {offset} added to joint `{joint}`[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Correct the zero of this joint: add {offset} to its column, or rotate the joint's origin in the URDF by {offset} about its axis.[[ First rule out {equivalent:code}: move joints by a small positive amount, and see whether each moves along its axis in the URDF.]]";
        "zero": Warning,
            "The recordings fit the nominal robot to {none} rms, but to {best} with {offset} added to joint `{joint}`[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "The fit estimates this zero. If the controller counts from another zero than the URDF, that is all; otherwise check how the joint is homed, its encoder and its coupling.";
        "zero_held": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with {offset} added to joint `{joint}`[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Let the fit estimate the zeros: `joint_offsets` in `solve: {free: …}`. Or add {offset} to the column of this joint.";
        "zero_of_some": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with {offset} added to joint `{joint}` in {recordings:code}[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "If the robot was homed or its controller restarted in between, its zeros are those of one homing: record everything after one homing. Otherwise check the encoder of this joint and its coupling.";
        "stood": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} if joint `{joint}`, whose readings never change, stood at {at} {unit}[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "State the position that the controller showed for this joint, about {at} {unit}: in its column, or in `hold: {{joint}_{unit}: {at}}` of a recording without this column.";
    }
    /// A joint also moves with another joint.
    JOINT_COUPLING = "joint-coupling" {
        "whole": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} if joint `{joint}` also moves by {factor} times joint `{other}`[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Declare the coupling: `solve: {joints: {{joint}: {coupled_to: [{other}]}}}`. If the controller computes it already, record the joint's own position.";
        "fraction": Warning,
            "Joint `{joint}` seems to move by {factor:percent} (± {sigma:percent}) of joint `{other}` as well; this changes the registration by {effect} rms.[[ Nearly as good: {alternatives:code}.]]",
            "Declare the coupling, and compare the held-out errors: `solve: {joints: {{joint}: {coupled_to: [{other}]}}}`.";
        "unlike": Warning,
            "Joint `{joint}` seems to move with joint `{other}` as well, by {factor} (± {sigma}); this changes the registration by {effect} rms.[[ Nearly as good: {alternatives:code}.]]",
            "Declare the coupling, and compare the held-out errors: `solve: {joints: {{joint}: {coupled_to: [{other}]}}}`.";
    }
    /// A joint moves more or less than its readings.
    JOINT_GAIN = "joint-gain" {
        "excess": Warning,
            "Joint `{joint}` seems to move {excess:percent-size} (± {sigma:percent}) {excess:more-or-less} than its readings say; this changes the registration by {effect} rms.[[ Nearly as good: {alternatives:code}.]]",
            "Check the joint's transmission ratio.[[ To estimate it, state `solve: {joints: {{joint}: {free: {free:list}}}}`.]]";
        "held_out": Warning,
            "Joint `{joint}` seems to move {excess:percent-size} (± {sigma:percent}) {excess:more-or-less} than its readings say: the fitted recordings hardly show it, but with its readings corrected the held-out errors are {best} rms in place of {none}.[[ Nearly as good: {alternatives:code}.]]",
            "Check the joint's transmission ratio.[[ To estimate it, state `solve: {joints: {{joint}: {free: {free:list}}}}`, and fit poses in which the joints move together.]]";
        "multiple": Warning,
            "The recordings fit the nominal robot to {none} rms, but to {best} if joint `{joint}` moves {factor} times as far as its column says[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "The fit estimates this gain. Look for a ratio near {factor} that explains it: of the gear, of the counts per turn, or of the units of this column.";
        "multiple_held": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} if joint `{joint}` moves {factor} times as far as its column says[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Look for a ratio near {factor} that explains it: of the gear, of the counts per turn, or of the units of this column. Correct it in the controller or in the column, or let the fit estimate the gains: `joint_gains` in `solve: {free: …}`.";
        "multiple_far": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} if joint `{joint}` moves {factor} times as far as its column says[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Look for a ratio near {factor} that explains it: of the gear, of the counts per turn, or of the units of this column. Correct it in the controller or in the column: a fit does not find a gain as far from 1.";
        "multiple_of_some": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} if joint `{joint}` moves {factor} times as far as its column says in {recordings:code}[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Export these recordings with the unit and the scale of the others.";
    }
    /// A joint of a body's chain without readings.
    JOINT_COLUMN_MISSING = "joint-column-missing" {
        "assumed_zero": Warning,
            "The recording has no values of joint `{joint}`, which moves {bodies:code}; it is taken to stand at 0.",
            "Record this joint, or state where it stood: `hold: {{joint}_{unit}: 0}` in the recording.";
        "moved": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} if joint `{joint}`, which has no column, moved[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Record this joint: export its column. If it stood still, state where: `hold: {{joint}_{unit}: 0}` in the recording.";
        "stuck": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} if joint `{joint}`, whose readings never change, moved[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Export the column of this joint again, or map another one to it: the one that is read does not follow it. Where a recording has no column for it, `hold` in the profile says that it stood still, and it did not.";
        "stood": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} if joint `{joint}`, which has no column, stood at {at} {unit}[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Record this joint, or state the position that the controller showed for it, about {at} {unit}: `hold: {{joint}_{unit}: {at}}` in the recording.";
        "apart": Error,
            "The recordings fit the nominal robot to {none} rms, where nominal errors explain {limit}. Without {recordings:code}, where joints without a column were taken to stand at 0 ({joints:code}), the others fit to {rest}.",
            "Record these joints, or state the position that the controller showed for each: `hold: {{joint}_{unit}: 0}` in the recording, with its value in place of 0.";
    }
    /// A body is on another link.
    WRONG_MOUNT = "wrong-mount" {
        "other_link": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with body `{body}` on link `{other}` instead of `{link}`[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Correct the body's link in the profile: `link: {other}`.";
        "exchanged": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with bodies `{body}` and `{other}` exchanged[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Exchange the links of these bodies in the profile, or their names in the tracker's software.";
    }
    /// The tracker's frame is another one in some recordings.
    TRACKER_MOVED = "tracker-moved" {
        "moved": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} if the tracker was moved for {recordings:code}[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Record these again without moving the tracker or the robot's base, or calibrate them in a profile of their own.";
        "axes": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with other tracker axes in {recordings:code}[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Export these recordings with the axes of the others.";
        "held_out": Error,
            "The errors in {recordings:code} are {none} per coordinate, but only {best} if the tracker, or the whole robot, moved by {distance} ± {sigma} and {angle} before.[[ These recordings do not distinguish it from {equivalent:code}.]][[ A changed zero of {joints:or} explains it as well.]]",
            "Record the validation again without moving the tracker or the robot's base between it and the fitted recordings.";
        "displaced": Error,
            "In {recordings:code} the tracker, or the whole robot, stands {distance} ± {sigma}[[ and {angle}]] away from where it stood in the fitted recordings; the held-out error is {rms} rms. With this taken into account, χ²/dof of these errors is {after} in place of {before}.[[ These recordings do not distinguish it from {equivalent:code}.]][[ A changed zero of {joints:or} explains it as well.]]",
            "Record the validation again without moving the tracker or the robot's base between it and the fitted recordings.";
    }
    /// A body has another mount in some recordings.
    BODY_REMOUNTED = "body-remounted" {
        "recordings": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} if body `{body}` was remounted for {recordings:code}[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Give the body another name in these recordings, and add it to the profile under this name as one more body. A held-out recording must show a body of the fitted ones: record it again, or fit it (`use: static`) and hold another one out.";
        "held_out": Error,
            "The errors in {recordings:code} are {none} per coordinate, but only {best} if body `{body}` moved on its link by {distance} ± {sigma}[[ and {angle}]] before.[[ These recordings do not distinguish it from {equivalent:code}.]][[ A changed zero of {joints:or} explains it as well.]]",
            "Record the validation again without remounting the body between it and the fitted recordings.";
        "displaced": Error,
            "In {recordings:code} body `{body}` is {distance} ± {sigma}[[ and {angle}]] away on its link from where it was in the fitted recordings; its held-out error is {rms} rms. With this taken into account, χ²/dof of these errors is {after} in place of {before}.[[ These recordings do not distinguish it from {equivalent:code}.]][[ A changed zero of {joints:or} explains it as well.]]",
            "Fasten the body, and record the validation again, or everything.";
    }
    /// A joint's zero is another one in held-out recordings.
    JOINT_ZERO_CHANGED = "joint-zero-changed" {
        "one": Error,
            "The errors in {recordings:code} are {none} per coordinate, but only {best} if the zero of joint `{joint}` changed by {step} ± {sigma} before.[[ These recordings do not distinguish it from {equivalent:code}.]][[ A changed zero of {joints:or} explains it as well.]]",
            "Check the encoder of joint `{joint}`, its coupling, how it is homed and, where a recording states its value, this value. If its zero changed, record the fitted recordings again as well: they are of the robot as it was.";
        "several": Error,
            "The errors in {recordings:code} are {none} per coordinate, but only {best} if the zeros of joints {joints:code} changed before, most clearly that of `{joint}`: by {step} ± {sigma}.",
            "If the robot was homed or its controller restarted in between, its zeros are those of one homing: record everything after one homing. Otherwise check the encoders and couplings of these joints.";
        "displaced": Error,
            "In {recordings:code} the zero of joint `{joint}` is {step} ± {sigma} away from that of the fitted recordings; the held-out error of what follows the joint is {rms} rms. With this taken into account, χ²/dof of these errors is {after} in place of {before}.[[ These recordings do not distinguish it from {equivalent:code}.]][[ A changed zero of {joints:or} explains it as well.]]",
            "Check the encoder of joint `{joint}`, its coupling, how it is homed and, where a recording states its value, this value. If its zero changed, record the fitted recordings again as well: they are of the robot as it was.";
    }
    /// What follows a joint is at another place on the link before it.
    JOINT_ORIGIN_MOVED = "joint-origin-moved" {
        "": Error,
            "In {recordings:code} everything that follows joint `{joint}` is {distance} ± {sigma}[[ and {angle}]] away on link `{link}` from where it was in the fitted recordings; the held-out error of what follows the joint is {rms} rms. With this taken into account, χ²/dof of these errors is {after} in place of {before}.[[ These recordings do not distinguish it from {equivalent:code}.]][[ A changed zero of {joints:or} explains it as well.]]",
            "Look for loose screws and for damage where joint `{joint}` is mounted on link `{link}`, and ask for collisions between the recordings. Then record everything again: the fitted recordings are of the robot as it was.";
    }
    /// Tracker and joints were read at different times.
    CLOCK_LAG = "clock-lag" {
        "rows_before": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with the joint values {rows:row} before[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Synchronize the two, or record in holds: the joint values are ahead of the tracker.";
        "rows_after": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with the joint values {rows:row} after[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Synchronize the two, or record in holds: the joint values lag behind the tracker.";
        "behind": Warning,
            "The joint values of {recording:code} lag {offset} ± {sigma} behind the tracker's data of their rows: that changes the registration by {effect} rms.[[ Nearly as good: {alternatives:code}.]]",
            "Let the fit estimate it: `timing: {poses: continuous, clock: estimate}` in {recording:code} and in the recordings made in the same way. Or record in holds.";
        "ahead": Warning,
            "The joint values of {recording:code} are {offset} ± {sigma} ahead of the tracker's data of their rows: that changes the registration by {effect} rms.[[ Nearly as good: {alternatives:code}.]]",
            "Let the fit estimate it: `timing: {poses: continuous, clock: estimate}` in {recording:code} and in the recordings made in the same way. Or record in holds.";
        "joint_behind": Warning,
            "The values of joint `{joint}` in {recordings:code} lag {offset} ± {sigma} behind those of the other joints and the tracker's data of their rows[[, beyond the {stated} that the profile states]]: that changes the registration by {effect} rms.[[ Nearly as good: {alternatives:code}.]]",
            "State by how much they are late, in {recordings:code} and in the recordings made in the same way: `timing: {poses: continuous, late_ms: {{joint}: {late:yaml-ms}}}`. Or write them into the log with the time at which they were measured, or record in holds.";
        "joint_ahead": Warning,
            "The values of joint `{joint}` in {recordings:code} are {offset} ± {sigma} ahead of those of the other joints and of the tracker's data of their rows[[, beyond the {stated} that the profile states]]: that changes the registration by {effect} rms.[[ Nearly as good: {alternatives:code}.]]",
            "State by how much they are late, in {recordings:code} and in the recordings made in the same way: `timing: {poses: continuous, late_ms: {{joint}: {late:yaml-ms}}}`. Or write them into the log with the time at which they were measured, or record in holds.";
        "joints_behind": Warning,
            "The values of joints {joints:code} in {recordings:code} lag {offset} ± {sigma} behind those of the other joints and the tracker's data of their rows[[, beyond the {stated} that the profile states]]: that changes the registration by {effect} rms.[[ Nearly as good: {alternatives:code}.]]",
            "Look whether these joints have a controller or a bus of their own. State by how much they are late, in {recordings:code} and in the recordings made in the same way[[: `timing: {poses: continuous, late_ms: {{joints:each late}}}`]]. Or write them into the log with the time at which they were measured, or record in holds.";
        "joints_ahead": Warning,
            "The values of joints {joints:code} in {recordings:code} are {offset} ± {sigma} ahead of those of the other joints and of the tracker's data of their rows[[, beyond the {stated} that the profile states]]: that changes the registration by {effect} rms.[[ Nearly as good: {alternatives:code}.]]",
            "Look whether these joints have a controller or a bus of their own. State by how much they are late, in {recordings:code} and in the recordings made in the same way[[: `timing: {poses: continuous, late_ms: {{joints:each late}}}`]]. Or write them into the log with the time at which they were measured, or record in holds.";
        "sweep_behind": Warning,
            "In {recording:code} joint `{joint}` alone moves, and its values lag {offset} ± {sigma} further behind the tracker's data than the joint values of the other recordings[[, beyond the {stated} that the profile states]]. There this was corrected; where other joints move as well, one offset of all joints does not correct it.",
            "If this recording was not logged otherwise than the others, state by how much the values of this joint are late, in {recordings:code}: `timing: {poses: continuous, late_ms: {{joint}: {late:yaml-ms}}}`. Or record in holds.";
        "sweep_ahead": Warning,
            "In {recording:code} joint `{joint}` alone moves, and its values are {offset} ± {sigma} further ahead of the tracker's data than the joint values of the other recordings[[, beyond the {stated} that the profile states]]. There this was corrected; where other joints move as well, one offset of all joints does not correct it.",
            "If this recording was not logged otherwise than the others, state by how much the values of this joint are late, in {recordings:code}: `timing: {poses: continuous, late_ms: {{joint}: {late:yaml-ms}}}`. Or record in holds.";
        "corrected_behind": Warning,
            "The joint values of {recording:code} lag {offset} ± {sigma} behind the tracker's data of their rows. This was estimated from the motion and corrected.",
            "Correct the times of the joint values if you can. The offset is taken into account.";
        "corrected_ahead": Warning,
            "The joint values of {recording:code} are {offset} ± {sigma} ahead of the tracker's data of their rows. This was estimated from the motion and corrected.",
            "Correct the times of the joint values if you can. The offset is taken into account.";
        "offset": Info,
            "The tracker's clock is {offset:size} ± {sigma} {offset:ahead-or-behind} the robot's[[ and runs {drift:ppm-size} ± {sigma_drift:ppm} {drift:faster-or-slower}]].",
            "Use a shared clock if you can. The offset is taken into account.";
        "ambiguous": Error,
            "Offsets of {first} and {second} explain the motion nearly equally well (ratio {ratio}).",
            "Move irregularly once at the start, or record static poses: the motion is periodic.";
        "not_excited": Error,
            "The angular speed varies by {deviation}; aligning the clocks needs {needed}.",
            "Move faster, or record static poses.";
        "not_moved": Error,
            "The marker moves by {motion} rms; aligning the clocks needs {needed}.",
            "Move more joints, or record static poses.";
        "no_match": Error,
            "The two motions correlate by {correlation} at most; {needed} is needed.",
            "Check that both recordings are of the same motion, and check the body's link, the names and signs of the joints, and `max_offset_s`.";
        "too_short": Error,
            "Tracker and robot have too few samples in common.",
            "Record at least several seconds with both clocks running.";
        "apart": Error,
            "The times of tracker and robot have too little in common: offsets of up to {searched:s} are looked for, and the recordings overlap at offsets from {least:s} to {most:s}.",
            "If they were recorded together, set `timing: {max_offset_s: {needed}}` for the recording: the offset is then looked for up to there.";
        "disjoint": Error,
            "The tracker's times and those of the joints have nothing in common: the tracker's begin {gap:s-size} {gap:ahead-or-behind} the robot's, and each lasts at most {lasts:s}. They are taken for times of one clock.",
            "If one clock wrote both, correct the times of one file (whole hours are a time zone). Otherwise remove `clock: shared` from `timing`, and set `max_offset_s: {needed}`: the offset is then estimated from the motion.";
        "holds_apart": Warning,
            "The bodies stand still {bodies} times, but the joints with them only {both} times: the others are no poses.",
            "Check that the times of both files are of one clock, and that the robot's log is of the whole recording. If there are two clocks, remove `clock: shared` from `timing`: the offset is then estimated from the motion.";
    }
    /// Quaternions in another order.
    QUATERNION_ORDER = "quaternion-order" {
        "scalar_first": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with the quaternions of {bodies:code} read scalar first[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "The file writes w, x, y, z: name the four columns in that order (`qw`, `qx`, `qy`, `qz`). Or keep their names and list them in the order of the file under `quaternion_wxyz` of the body in the column map: `columns: {bodies: {NAME: {position: [X, Y, Z], quaternion_wxyz: [FIRST, SECOND, THIRD, FOURTH]}}}`.";
        "scalar_last": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with the quaternions of {bodies:code} read scalar last[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "The file writes x, y, z, w: list the four columns in the order of the file under `quaternion_xyzw` of the body in the column map, not under `quaternion_wxyz`; or name them in that order (`qx`, `qy`, `qz`, `qw`).";
    }
    /// Poses in another convention.
    POSE_CONVENTION = "pose-convention" {
        "inverse": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with the poses of {bodies:code} inverted[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "The file has the pose of the tracker in the body's frame. Say so in the column map, `columns: {bodies: {NAME: {position: [X, Y, Z], quaternion_xyzw: [X, Y, Z, W], inverted: true}}}`, or export the pose of the body in the tracker's frame.";
        "transposed": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with the rotations of {bodies:code} transposed[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "The file has the rotation from tracker to body coordinates. Export its inverse; columns of a matrix can be listed column by column in the column map, `columns: {bodies: {NAME: {position: [X, Y, Z], rotation_matrix: [R11, R21, R31, R12, R22, R32, R13, R23, R33]}}}`.";
    }
    /// The recordings contradict the nominal robot, and nothing that is known explains it.
    MODEL_DISAGREES = "model-disagrees" {
        "readings": Error,
            "The recordings fit the nominal robot to {none} rms, where nominal errors explain {limit}. Without the readings of joint `{joint}`[[ in {recordings:code}]], its position taken from the tracker instead, {best} rms remain[[ ({next} without those of another joint)]]. In {off} of {rows:row} they are off by more than {least}, in half of them by more than {median}.[[ What belongs to a row stands {earlier:row} earlier in this column.]][[ What belongs to a row stands {later:row} later in this column.]]",
            "Look at the column of this joint: values that are sorted, smoothed, stuck or shifted against the other columns, or those of another joint.";
        "undecided": Error,
            "The recordings fit the nominal robot to {none} rms, where nominal errors explain {limit}; no single mistake and no pair explains it[[; the best attempt, {leading:code}, leaves {best}]].[[ Without {recordings:code} the others fit to {rest}.]][[ Joints without a column were taken to stand at 0, and nothing fits where one of them moved: {assumed:code}.]]",
            "Check that URDF and robot are the same model, the links of the bodies, and that joints and tracker recorded the same motion.";
        "frames": Error,
            "Alone, body `{body}` fits the nominal robot to {alone} rms, and without it the others fit to {rest}. Together they fit to {none} rms, where nominal errors explain {limit}: they are not seen in one frame.",
            "If a controller computed the coordinates of `{body}`, or another tracker measured them, leave this body out. Otherwise look for what moved between its rows and those of the others: the tracker, or a joint without a column.";
        "large": Warning,
            "The recordings fit the nominal robot to {none} rms, where nominal errors explain {limit}; no single mistake explains it.[[ Joints without a column were taken to stand at 0, and nothing fits where one of them moved: {assumed:code}.]]",
            "Check the URDF against a drawing, and validate with separate poses.";
        "range": Warning,
            "Most rows with joint `{joint}` between {low} and {high} disagree with the nominal robot: {count} of {rows:row}.",
            "Check what is special about this range of the joint: a stop, a cable, or a wrong reading.";
    }
    /// Coordinates that nobody measured.
    NOT_MEASURED = "not-measured" {
        "body": Error,
            "The coordinates of body `{body}` fit the nominal robot to {none} rms, those of `{other}` to {next}. No robot is that close to its drawing, and no tracker is that precise: the coordinates of `{body}` were computed from the joint values, by a controller or a simulation.",
            "Leave this body out. The position of the tool that a controller shows or logs is no measurement.";
        "all": Error,
            "The recordings fit the nominal robot to {none} rms. No robot is that close to its drawing, and no tracker is that precise: these coordinates were computed from the joint values, by a controller or a simulation, and say nothing of the real robot.",
            "Record what a tracker measures. The position of the tool that a controller shows or logs is no measurement; leave its columns out.";
        "fitted": Warning,
            "The fit leaves {left} rms of the positions of body `{body}`[[, as the decimals of the file do: they alone leave {rounding}]]. Neither the noise of a tracker nor the repeatability of a robot shows: the coordinates may have been computed from the joint values, by a controller that knows its own calibration or by a simulation. Then the result says what that program assumes, and nothing of the real robot.",
            "If a tracker measured them, record positions and joint values with more decimals. If a controller computed them, record what a tracker measures.";
    }
    /// A body that could not be compared with the robot.
    NOT_CHECKED = "not-checked" {
        "": Warning,
            "Too few rows to compare the body's motion with the nominal robot ({rows:row} with {samples:sample}).",
            "Record more poses of this body.";
    }
    /// Mistakes that these recordings cannot show.
    INVISIBLE_MISTAKES = "invisible-mistakes" {
        "": Info,
            "These recordings cannot show whether {mistakes:code} is true: the corrected data fit equally well.",
            "Add combined poses in which all joints move, or a marker away from the last axis, if the result must hold beyond the recorded motions.";
    }
    /// Another axis of the tracker points up.
    UP_AXIS = "up-axis" {
        "": Warning,
            "The declared up axis is {declared}, but the z axis of the robot's root is {off} from it; the closest axis is {nearest}.",
            "Export with the other axis up. If the robot is mounted that way, set `tracker: {up_axis: {nearest}}`.";
    }
    /// Rows that no fit explains.
    ROW_OUTLIER = "row-outlier" {
        "exchanged": Error,
            "In {count:row} bodies `{first}` and `{second}` have each other's names: each is where the other should be.",
            "Correct the names in these rows, or drop the rows. Give the bodies clearly different shapes before the next recording.";
        "exchanged_few": Warning,
            "In {count:row} bodies `{first}` and `{second}` have each other's names: each is where the other should be.",
            "The robust fit leaves these rows out. Give the bodies clearly different shapes before the next recording.";
        "several_bodies": Error,
            "Several bodies disagree with the robot's model at once in {count:row}: their joint values are wrong, or the tracker's frame was off.",
            "Correct or drop these rows.";
        "several_bodies_few": Warning,
            "Several bodies disagree with the robot's model at once in {count:row}: their joint values are wrong, or the tracker's frame was off.",
            "Look at these rows. The robust fit leaves out what it cannot explain.";
        "one_body": Warning,
            "In {count:row} the body deviates by up to {position}[[ and {angle}]], {ratio} times the usual; no motion between rows explains it[[; an error of joint {joints:or} alone would]].",
            "Look at these rows: a wrong reading, or backlash of that joint. The robust fit leaves out what it cannot explain.";
        "model": Warning,
            "In {count:row} the body deviates from the nominal robot by up to {position} and {angle}, {ratio} times the usual.",
            "Look at these rows: a wrong reading of a joint or of the body. The robust fit leaves out what it cannot explain.";
    }
}
