//! Joint columns and the number of rows.

super::topic! {
    /// A joint of the URDF contradicts itself; no calibrated number depends on it.
    URDF_INCONSISTENT = "urdf-inconsistent" {
        "mimic_of_fixed": Warning,
            "In the URDF the joint mimics the fixed joint `{source}`: it is taken to stand still.",
            "Mimic a joint that moves, or make this joint fixed.";
        "limits_reversed": Warning,
            "In the URDF the limits of the joint are in the wrong order, {lower} and {upper}: it is taken to have none.",
            "Exchange the two numbers.";
        "limits_in_degrees": Warning,
            "In the URDF the limits of the joint are {lower:rad} and {upper:rad}: probably degrees were written where a URDF has radians.",
            "Correct the limits in the URDF.";
        "too_large": Warning,
            "The robot of the URDF reaches {reach:m}: probably its lengths are not in meters.",
            "Divide the origins, the limits of prismatic joints and the meshes by the ratio of the units: 1000 for millimeters.";
    }
    /// Fewer rows than the fit needs.
    TOO_FEW_POSES = "too-few-poses" {
        "": Error,
            "Only {usable:row} with a tracked body or marker; the fit needs {needed}.",
            "Record more poses.";
    }
    /// A joint, the tracker or a template is in another unit than its column says.
    UNIT_MISMATCH = "unit-mismatch" {
        "degrees": Error,
            "The joint reaches {largest:rad} ({largest:turns}).",
            "If the column is in degrees, name it `…_deg`; columns without a unit in their name follow `columns: {angles: deg}`. If its name ends in `_deg` already, its values were probably converted to degrees twice: divide them by 57.2958.";
        "radians": Error,
            "The joint moves by {moved}, the profile asks for {asked}: a ratio of {ratio}.",
            "If the column is in radians, name it `…_rad`; columns without a unit in their name follow `columns: {angles: rad}`. If its name ends in `_rad` already, its values were probably converted to radians twice: multiply them by 57.2958.";
        "millimeters": Error,
            "The points spread over {spread:m}, up to {farthest:m} from the tracker's origin.",
            "Check whether these are millimeters: name the columns `…_mm`. Columns without a unit in their name follow `columns: {lengths: mm}`.";
        "some_millimeters": Error,
            "The positions of {names} spread over {spread:m}, all others of the recording over {others}: they are in different units.",
            "Check whether {names} are in millimeters: name their columns `…_mm`.";
        "meters": Error,
            "All points lie within {farthest} of the tracker's origin.",
            "Check whether these are meters: name the columns `…_m`. Columns without a unit in their name follow `columns: {lengths: m}`.";
        "template_millimeters": Error,
            "The body is {ratio} times as large as its template: millimeters were read as meters.",
            "Correct the unit of length of the recording or of the template.";
        "template_meters": Error,
            "The body is {ratio} times as large as its template: meters were read as millimeters.",
            "Correct the unit of length of the recording or of the template.";
        "template_ten": Error,
            "The body is {ratio} times as large as its template: a factor of ten.",
            "Correct the unit of length of the recording or of the template.";
        "all_degrees": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with all joint angles read as degrees[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "[[Correct the unit in the columns' names: `{rename}` instead of `{column}`. Columns without a unit in their name follow `columns: {angles: deg}`.]][[The columns state their unit already, as `{twice}` does, so their values were probably converted to degrees twice. Divide them by 57.2958.]][[Correct the unit of the joints, such as `{unnamed}`, where they were recorded.]]";
        "all_radians": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with all joint angles read as radians[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "[[Correct the unit in the columns' names: `{rename}` instead of `{column}`. Columns without a unit in their name follow `columns: {angles: rad}`.]][[The columns state their unit already, as `{twice}` does, so their values were probably converted to radians twice. Multiply them by 57.2958.]][[Correct the unit of the joints, such as `{unnamed}`, where they were recorded.]]";
        "all_millimeters": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with all prismatic joints read as millimeters[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "[[Correct the unit in the columns' names: `{rename}` instead of `{column}`. Columns without a unit in their name follow `columns: {lengths: mm}`.]][[The columns state their unit already, as `{twice}` does, so their values were probably converted to millimeters twice. Divide them by 1000.]][[Correct the unit of the joints, such as `{unnamed}`, where they were recorded.]][[ Or the tracker's lengths are in {tracker_unit:code}: one distance that was measured by hand decides.]]";
        "all_meters": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with all prismatic joints read as meters[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "[[Correct the unit in the columns' names: `{rename}` instead of `{column}`. Columns without a unit in their name follow `columns: {lengths: m}`.]][[The columns state their unit already, as `{twice}` does, so their values were probably converted to meters twice. Multiply them by 1000.]][[Correct the unit of the joints, such as `{unnamed}`, where they were recorded.]][[ Or the tracker's lengths are in {tracker_unit:code}: one distance that was measured by hand decides.]]";
        "all_lengths": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with all prismatic joints read as {unit:code} instead of {read_as:code}[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "[[Correct the unit in the columns' names: `{rename}` instead of `{column}`. Columns without a unit in their name follow `columns: {lengths: …}`.]][[The columns state their unit already, as `{twice}` does, so their values were probably converted twice: multiply them by {factor}.]][[Correct the unit of the joints, such as `{unnamed}`, where they were recorded.]][[ Or the tracker's lengths are in {tracker_unit:code}: one distance that was measured by hand decides.]]";
        "joint_degrees": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with joint `{joint}` read as degrees[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "[[Rename column `{column}` to `{rename}`, in the column map as well where that names it.]][[Column `{twice}` states its unit already, so its values were probably converted to degrees twice. Divide them by 57.2958.]][[Correct the unit of joint `{unnamed}` where it was recorded.]]";
        "joint_radians": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with joint `{joint}` read as radians[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "[[Rename column `{column}` to `{rename}`, in the column map as well where that names it.]][[Column `{twice}` states its unit already, so its values were probably converted to radians twice. Multiply them by 57.2958.]][[Correct the unit of joint `{unnamed}` where it was recorded.]]";
        "joint_millimeters": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with joint `{joint}` read as millimeters[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "[[Rename column `{column}` to `{rename}`, in the column map as well where that names it.]][[Column `{twice}` states its unit already, so its values were probably converted to millimeters twice. Divide them by 1000.]][[Correct the unit of joint `{unnamed}` where it was recorded.]]";
        "joint_meters": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with joint `{joint}` read as meters[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "[[Rename column `{column}` to `{rename}`, in the column map as well where that names it.]][[Column `{twice}` states its unit already, so its values were probably converted to meters twice. Multiply them by 1000.]][[Correct the unit of joint `{unnamed}` where it was recorded.]]";
        "joint_lengths": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with joint `{joint}` read as {unit:code} instead of {read_as:code}[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "[[Rename column `{column}` to `{rename}`, in the column map as well where that names it.]][[Column `{twice}` states its unit already, so its values were probably converted twice: multiply them by {factor}.]][[Correct the unit of joint `{unnamed}` where it was recorded.]]";
        "lengths_too_large": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with the tracker's lengths {ratio} times smaller, as where {unit:code} was read as {read_as:code}[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Correct the unit in the columns' names. Columns without a unit in their name follow `columns: {lengths: mm}`; the units are m, cm, mm, um, in and ft.[[ Or the prismatic joints are in {slides_unit:code}: one distance that was measured by hand decides.]]";
        "lengths_too_small": Error,
            "The recordings fit the nominal robot to {none} rms, but to {best} with the tracker's lengths {ratio} times larger, as where {unit:code} was read as {read_as:code}[[ and {other_correction:code}]][[; the next best explanation leaves {next}]].[[ If errors of the robot within the priors are allowed for, the noise is {allowed_none} without this correction and {allowed} with it.]][[ These recordings do not distinguish it from {equivalent:code}.]][[ Nearly as good: {alternatives:code}.]][[ The remaining residual exceeds {limit}, the most that nominal errors explain: look for a second mistake.]]",
            "Correct the unit in the columns' names. Columns without a unit in their name follow `columns: {lengths: m}`; the units are m, cm, mm, um, in and ft.[[ Or the prismatic joints are in {slides_unit:code}: one distance that was measured by hand decides.]]";
        "robot_too_large": Error,
            "The robot of the URDF reaches {reach:m}, and the recordings fit it to {none} rms, but to {best} with the tracker's lengths {ratio} times larger[[ and {other_correction:code}]]: the URDF is {ratio} times too large, and so is this residual.[[ These recordings do not distinguish it from {equivalent:code}.]]",
            "Lengths of a URDF are in meters: divide its origins, joint limits of prismatic joints and meshes by {ratio}. The recordings are right.";
    }
    /// A joint has values beyond its limits.
    JOINT_OUTSIDE_LIMITS = "joint-outside-limits" {
        "beyond": Error,
            "{rows:row} outside the limits {low} to {high}; the worst value is {worst}.",
            "Check the joint's name, sign and zero, or correct the limits in the URDF.";
        "wraps": Error,
            "{rows:row} outside the limits {low} to {high}; the worst value is {worst}. A full turn more or less, all lie within.",
            "If the readings jump by 360° where the joint passes a boundary, as those of many controllers do, add or subtract 360° in these rows. Otherwise check the joint's name, sign and zero, or the limits in the URDF.";
    }
    /// A joint covers less of its range than the profile asks for.
    COVERAGE = "coverage" {
        "": Warning,
            "The joint covers {low} to {high}, {share:percent} of the requested {from} to {to}.",
            "Sweep the whole range, or ask for less in the profile.";
    }
    /// A joint that is to be swept stays where it is.
    JOINT_NEVER_MOVED = "joint-never-moved" {
        "still": Error,
            "The joint stays at {at} in all rows.",
            "Check that the column is the measured position of this joint, and that the joint was swept.";
        "empty": Error,
            "The joint has no values.",
            "Check that the column is the measured position of this joint, and that the joint was swept.";
        "although": Error,
            "All readings of the joint are {at}, but in {count} of {of:row} body `{body}` is where it would be if the joint had moved, over {moved} in all.",
            "Look for why the readings of this joint do not change: another column was exported, or its encoder is not read. Record again.";
        "although_in_rows": Warning,
            "In {of:row} in succession all readings of the joint are {at}, but in {count} of them body `{body}` is where it would be if the joint had moved, over {moved} in all.[[ These {left_out:row} take no part in the fit.]]",
            "Look for why the readings of this joint stopped changing, and record these rows again.";
    }
    /// Rows without a reading of a joint.
    JOINT_VALUES_MISSING = "joint-values-missing" {
        "rows": Warning,
            "In {count} of {rows:row} there is no value of {joints:code}: left out.",
            "Export the joint's value in every row. Where it stood still, remove its column and say where: `hold` in the recording.";
        "gaps": Warning,
            "Between the first and the last reading of {joints:code} there are gaps of {all} in all, the longest {longest}: what the tracker saw then is left out.",
            "Look for the readings that the robot's log lost, or record again.";
    }
    /// Joint readings that stood still while the robot moved.
    JOINT_READINGS_HELD = "joint-readings-held" {
        "": Warning,
            "In {rows} of {of:row} all joint readings repeat those of an earlier row, but the bodies moved by up to {distance} meanwhile: left out. Of rows with the same readings, the first fits the nominal robot ({first} rms with all other rows), the last does not ({last}).",
            "Look for what stopped or slowed the log of the joints, or what else moved the bodies. Record again if too few rows are left.";
    }
    /// Two joints are equal in every row.
    JOINT_DUPLICATE = "joint-duplicate" {
        "": Warning,
            "The joint equals `{other}` in all {rows:row}.",
            "Check the export: one column was written twice. A mimic joint need not be recorded.";
    }
    /// Readings with too few digits.
    JOINT_ROUNDED = "joint-rounded" {
        "": Info,
            "Every reading of this joint is a multiple of {step}. If they were rounded when they were written, each is off by {sigma} (σ).",
            "If these are measured positions, write them with three decimals of a degree or more, or five of a radian. If they are positions that were asked for, nothing is wrong.";
    }
    /// Joints with readings that never change.
    JOINTS_STOOD_STILL = "joints-stood-still" {
        "": Warning,
            "No recording moves {joints}: zero and axis of such a joint are not calibrated, and postures in which it stands elsewhere are not covered.",
            "Move it in some recordings. If something other than its own motor moves it (a passive joint), declare what: `<mimic>` in the URDF, or `coupled_to` under `solve: {joints: …}`. With `free: []` there you state that it is locked.";
    }
    /// Growth with temperature is free, and a recording has no temperature.
    TEMPERATURE_MISSING = "temperature-missing" {
        "": Warning,
            "The profile frees `thermal_expansion`, but the recording has no temperature of {joints}; their links are taken as warm as the reference.",
            "Record a column `temperature_c` (the whole robot) or `<joint>_temperature_c`, map one under `columns`, or leave `thermal_expansion` out of `free`.";
    }
    /// The load is to be measured, and joints have no torque.
    TORQUE_MISSING = "torque-missing" {
        "": Warning,
            "The profile says `load: measured`, but the recording has no torque of {joints}; no load is assumed.",
            "Record a column `<joint>_nm`, map one under `columns`, or set `solve: {load: gravity}`.";
    }
}
