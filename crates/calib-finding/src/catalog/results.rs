//! What the estimation and its result say.

super::topic! {
    /// A sweep does not determine an origin.
    ORIGIN_NOT_OBSERVABLE = "origin-not-observable" {
        "center": Error,
            "The sweep `{sweep}` does not determine the origin: `{estimator}` finds no center ({said}).",
            "Sweep two joints whose axes meet in the origin over more of their range, or ask for a line with one axis.";
        "axis": Error,
            "The sweep `{sweep}` does not determine the origin: `{estimator}` finds no axis ({said}).",
            "Sweep the joint over more of its range.";
        "frame": Error,
            "The sweep `{sweep}` does not determine the origin: the two axes give no frame ({said}).",
            "Sweep two joints whose axes meet in the origin over more of their range, or ask for a line with one axis.";
        "orientation": Error,
            "The sweep `{sweep}` does not determine the origin: the orientation of the nominal URDF, or the reference point along the axis, is not stated.",
            "Name two axes, or state a reference point.";
        "mean_axis": Error,
            "The sweep `{sweep}` does not determine the origin: the axis has no mean direction in the body.",
            "Check the poses of the body in the sweep.";
    }
    /// An estimator that states no uncertainty.
    ORIGIN_WITHOUT_COVARIANCE = "origin-without-covariance" {
        "center": Warning,
            "The center estimator `{estimator}` states no covariance: the σ of the prior ({sigma}) stands in its place, in every direction.",
            "Name an estimator that states a covariance, or let the plugin give one (`covariance_m2`).";
        "axis": Warning,
            "The axis estimator `{estimator}` states no covariance: the σ of the prior stand in its place ({sigma} across the axis, {sigma_angle} for its direction).",
            "Name an estimator that states a covariance, or let the plugin give one (`covariance`).";
    }
    /// An estimator that no origin calls.
    ORIGIN_ESTIMATOR_UNUSED = "origin-estimator-unused" {
        "center": Warning,
            "The profile names the center estimator `{estimator}` for an origin with one swept axis: only the axis counts there, and `{called}` finds it.",
            "Name an axis estimator (`axis:`) and remove `center:`, or sweep a second joint whose axis meets the first in the origin.";
        "axis": Warning,
            "The profile names the axis estimator `{estimator}` for an origin that does not have exactly one swept axis: only the center counts there, and `{called}` finds it.",
            "Name a center estimator (`center:`) and remove `axis:`, or sweep one joint only.";
    }
    /// A plugin of which nothing is used.
    PLUGIN_UNUSED = "plugin-unused" {
        "": Warning,
            "The profile loads the plugin `{plugin}` and uses nothing of it. It offers {offers:code}.",
            "Name what it offers where it belongs (`origins`, `recordings`, `outputs.reports`, `solve.joints`), or remove it from `plugins`.";
    }
    /// What the method `paper` assumes.
    PAPER_ASSUMPTIONS = "paper-assumptions" {
        "": Info,
            "The closed forms assume that the swept axes meet in one point at a right angle, that the encoders have no zero offset, and that the rest of the robot matches the URDF; the reported uncertainty covers the tracker's noise only.",
            "Solve with `solve: {method: ml}`, which estimates axes, offsets and mounts together.";
    }
    /// The robot may stand in another place before the tracker.
    TWO_PLACES = "two-places" {
        "": Error,
            "The robot may stand in two places before the tracker, {distance} and {angle} apart: χ² differs by {by} only. The markers move too little to decide between them. The positions of these markers are predicted from either; those of other points may be wrong by as much as the places differ.",
            "Move all joints over more of their range, or mount more markers, farther from the axes of the joints. Or state where the robot's root was measured to be: `tracker: {from_root: …}`.";
    }
    /// An active bound.
    ON_ITS_LIMIT = "on-its-limit" {
        "": Warning,
            "The unconstrained estimate lies outside ±{limit}; the bound is active.",
            "Widen `within_mm` or `within_deg` if the limit is not physical; otherwise look for an effect that is not enabled.";
    }
    /// A number far off where its prior expected it.
    BEYOND_ITS_PRIOR = "beyond-its-prior" {
        "stated": Info,
            "The value lies {sigmas} standard deviations of its prior from the nominal one[[; {more:other} of its kind likewise]]. All of this kind together speak for a prior {factor} times as wide.",
            "Check that the URDF is this robot's; if it is, state a wider prior under `solve.prior`.";
        "found": Info,
            "The value lies {sigmas} standard deviations of the default prior from the nominal one[[; {more:other} of its kind likewise]]. All of this kind together speak for a prior {factor} times as wide, which was used.",
            "Check that the URDF is this robot's; if it is, nothing is left to do.";
    }
    /// A coefficient that physics allows on one side of 0 only, and that the data put on the other.
    WRONG_SIGN = "wrong-sign" {
        "": Warning,
            "The estimate is fixed at 0, the physical bound ({physics}); without the bound it would be {value} ± {sigma}.",
            "Check the sign of the torque column, the direction of gravity (`robot.gravity`) and the masses. If they are right, an effect that is not enabled may be the cause; otherwise do not free this effect here.";
    }
    /// Compliance is estimated under loads of masses that nobody stated.
    NO_MASSES = "no-masses" {
        "assumed": Warning,
            "The URDF has no masses: the loads are those of uniform rods between the joints, assumed to weigh {mass} in all. The scale of the compliances is therefore unknown; the deflections depend only on the mass ratios.",
            "Add `<inertial>` to the links or state `robot.total_mass_kg` and `robot.payload`; free `masses` to let the data find the proportions.";
        "stated": Warning,
            "The URDF has no masses: the loads are those of uniform rods between the joints, which weigh the stated {mass} in all. The deflections depend on their mass ratios.",
            "Add `<inertial>` to the links, or free `masses` to let the data find the proportions.";
    }
    /// The residuals show an effect that is not in the model.
    MISSING_PHYSICS = "missing-physics" {
        "effect": Warning,
            "{physics} (`{parameter}`): explains {explains:percent} of χ², p = {p_value}.[[ Nearly as good: {alternatives:code}.]]",
            "Enable the effect under `solve.free`, or for this joint alone[[: `solve: {joints: {{joint}: {free: {free:list}}}}`]]. Compare the held-out errors.";
        "clock": Warning,
            "{physics} (`{parameter}`): explains {explains:percent} of χ², p = {p_value}.[[ Nearly as good: {alternatives:code}.]]",
            "Let the fit estimate it: `timing: {poses: continuous, clock: estimate}` in {recording:code} and in the recordings made in the same way. Or record in holds.";
        "latency": Warning,
            "{physics} (`{parameter}`): explains {explains:percent} of χ², p = {p_value}.[[ Nearly as good: {alternatives:code}.]]",
            "State by how much they are late, in {recordings:code} and in the recordings made in the same way: `timing: {poses: continuous, late_ms: {{joint}: {late:yaml-ms}}}`. Or write them into the log with the time at which they were measured, or record in holds.";
    }
    /// From which side a joint came is not recorded before its first motion.
    SIDE_BY_RESIDUALS = "side-by-residuals" {
        "": Info,
            "The rows of `{recording}` before a joint's first motion do not show from which side the joint came. The residuals do, and the fit takes it from them[[: from below for {below}]][[; from above for {above}]].",
            "None is needed. To have the side recorded, begin each recording with a small motion of every joint.";
    }
    /// What is random from pose to pose is no noise of a joint.
    NOISE_IS_PHYSICS = "noise-is-physics" {
        "swallowed": Info,
            "Joint noise of {sigma} maximizes the likelihood, but predicts left-out poses worse ({poses:pose} left out in turn): physics is missing from the model, or successive rows share the errors of the joints. The fit uses weights that do not depend on the robot model.",
            "If `missing-physics` names effects, enable them and compare the held-out errors; otherwise record more poses.";
        "no_encoder": Info,
            "Joint positions deviate from their readings by {sigma} (σ), differently in each pose. No encoder has that noise: physics is missing from the model (backlash, compliance, eccentricity), or the readings belong to other poses.",
            "If `missing-physics` names effects, enable them and compare the held-out errors; otherwise record more poses.";
    }
    /// Rejected vectors take part after all.
    REJECTED_TAKE_PART = "rejected-take-part" {
        "": Info,
            "{readmitted} of {rejected} rejected measurements were readmitted: left-out poses are predicted {better:percent} better with them. They are poses that the incomplete model fits worst, not errors.",
            "If `missing-physics` names effects, enable them and compare the held-out errors; otherwise record more poses.";
    }
    /// A joint errs once per turn of its motor, whose ratio nobody stated.
    GEAR_RATIO_FOUND = "gear-ratio-found" {
        "": Info,
            "Joint `{joint}` errs by {amplitude}, {ratio} ± {sigma} times per turn, as a gear train out of center does once per turn of its motor (probability of chance over all joints and ratios: {chance}).",
            "Compare the ratio with the gear's data sheet, then state it, `robot: {gear_ratio: {{joint}: {stated}}}`, and add `motor_eccentricity` to the list `solve: free`.";
    }
    /// A gain of a sliding joint that the tracker's scale explains as well.
    GAIN_OR_SCALE = "gain-or-scale" {
        "": Warning,
            "Joint `{joint}` moves {excess:percent-size} ± {sigma:percent} {excess:more-or-less} than its readings say, {moves} over its range. A tracker whose lengths are off by the same ratio gives the same data: only the lengths of the robot distinguish the two.",
            "Measure a known length with the tracker: a scale bar, or two marks at a known distance, best as long as the range of the joint. Where the tracker is right, keep the gain; otherwise correct its lengths and take `gain` out of what is free.";
    }
    /// A number of the robot depends on the ratio of a joint that mimics another.
    MIMIC_RATIO = "mimic-ratio" {
        "another": Warning,
            "Joint `{joint}` follows `{source}` by {ratio} ± {sigma}, if that is estimated; the URDF states {stated}. The {quantity} is then {value} ± {value_sigma}, not {before}.",
            "Correct `multiplier` in the URDF by the mechanism, or estimate it: `solve: {joints: {{joint}: {free: [offset, axis, gain]}}, prior: {gain_percent: 25}}`.";
        "alone": Warning,
            "Joint `{joint}` follows `{source}` by {ratio} ± {sigma}, if that is estimated; the URDF states {stated}. Over the recorded range the difference amounts to {size}.",
            "Correct `multiplier` in the URDF by the mechanism, or estimate it: `solve: {joints: {{joint}: {free: [offset, axis, gain]}}, prior: {gain_percent: 25}}`.";
        "taken": Info,
            "The {quantity} is known to {before_sigma} only if `{joint}` follows `{source}` by exactly {stated}, as the URDF states. With that estimated, {ratio} ± {sigma}, it is {value} ± {value_sigma}.",
            "If the mechanism is exact, nothing is to be done. Otherwise estimate the ratio: `solve: {joints: {{joint}: {free: [offset, axis, gain]}}, prior: {gain_percent: 25}}`.";
    }
    /// A marker scatters unlike the others of its body.
    MARKER_NOISE = "marker-noise" {
        "loose": Warning,
            "Marker `{marker}` of body `{body}` scatters by {sigma} per coordinate, the other markers by {others}. The fit gives it a noise level of its own, but its errors count in those of held-out poses.",
            "Fasten or replace the marker, or leave it out of the body: it is loose, damaged, or partly hidden from the cameras.";
        "differs": Info,
            "Marker `{marker}` of body `{body}` scatters by {sigma} per coordinate, the other markers by {others}: left-out poses are predicted better with a noise level of its own.",
            "Check the marker if it scatters more than the others: it may be loose, damaged, or partly hidden from the cameras.";
    }
    /// The noise that the profile states is not that of the markers about their bodies.
    NOISE_STATED = "noise-stated" {
        "above": Warning,
            "The markers of body `{body}` scatter by {sigma} about it, {ratio} times the noise that the profile states ({stated}).",
            "Check the unit: `marker_sigma_mm` is in millimeters, of one coordinate. Otherwise look for loose or reflecting markers, or leave the key out: the fit then estimates the noise.";
        "below": Warning,
            "The markers of body `{body}` scatter by {sigma} about it; the profile states {stated}, {ratio} times as much.",
            "Check the unit: `marker_sigma_mm` is in millimeters, of one coordinate. Positions that a tracker fitted to a rigid body do not scatter about it: declare such a body with `pose: true`.";
    }
    /// Noise of markers by the cameras of the profile.
    CAMERA_NOISE = "camera-noise" {
        "taken": Info,
            "The noise of a marker follows the cameras of the profile: along its largest direction it is {ratio} times that along its smallest (median), and the fit weighs it so.",
            "No action is needed. Keep the places of the cameras in the profile true: they are part of the weights.";
        "doubted": Warning,
            "The cameras of the profile would make the noise of a marker {ratio} times as large along one direction as along another (median), but left-out poses are likelier with equal noise, which the fit uses.",
            "Check the places and fields of the cameras (`plan: {cameras: …}`): the σ of a plan that was made with them does not hold.";
        "no_fit": Warning,
            "The cameras of the profile would make the noise of a marker {ratio} times as large along one direction as along another (median). With that noise the fit has no result or does not converge: it uses equal noise.",
            "Check the places and fields of the cameras (`plan: {cameras: …}`): two in one place say nothing of depth.";
    }
    /// The noise along the line of sight differs from that across it.
    NOISE_ALONG_SIGHT = "noise-along-sight" {
        "same": Info,
            "The tracker is noisier along the line of sight from the origin of its frame than across it: the positions of body `{body}` have σ = {along} along the line and {across} per coordinate across it. Left-out poses are more likely with these two levels, and the fit uses them.",
            "If the tracker is a single camera, or all its cameras are on one side, state the noise: `tracker: {{key_across}: {across:yaml}, {key_along}: {along:yaml}}`. Otherwise compare a length along the line of sight with a known one: a wrong scale of the tracker has the same effect.";
        "tilt": Info,
            "The tracker measures the tilt of body `{body}` less precisely than its rotation about the line of sight from the origin of the tracker's frame: σ = {tilt} about the axes across the line and {about} about the line. Left-out poses are more likely with these two levels, and the fit uses them.",
            "If the tracker is a single camera, state the noise: `tracker: {body_sigma_deg: {tilt:yaml}, body_sight_sigma_deg: {about:yaml}}`. Otherwise no action is needed.";
        "growing": Info,
            "The tracker is noisier along the line of sight from the origin of its frame than across it, and its noise grows with the distance: at {distance:m}, the positions of body `{body}` have σ = {along} along the line, in proportion to the square of the distance, and {across} per coordinate across it, in proportion to the distance. Left-out poses are more likely with these levels, and the fit uses them.",
            "If the tracker is a single camera, or all its cameras are on one side, state the noise at this distance: `tracker: {{key_across}: {across:yaml}, {key_along}: {along:yaml}}`. Otherwise compare a length along the line of sight with a known one: a wrong scale of the tracker has the same effect.";
    }
    /// Measured poses have the errors of their inverses, or the other way round.
    NOISE_OF_INVERSE = "noise-of-inverse" {
        "body_sees": Info,
            "The errors of these poses are those of an instrument on the body that sees the tracker's frame, such as a camera before a board: an error of an angle moves the body about that frame. A tracker that turns a little from row to row makes the same errors. The fit weighs them so, and the σ of the tracker is that of the frame as the body sees it.",
            "No action is needed if the body is such an instrument. If a tracker beside the robot sees it, check that the tracker stands still.";
        "tracker_sees": Info,
            "The columns state where the tracker's frame is in the body, but their errors are those of a tracker that sees the body: an error of an angle does not move it. The fit weighs them so, and the σ of the tracker is that of the body as the tracker sees it.",
            "No action is needed.";
    }
    /// The tracker's noise in a recording is another one than in the others.
    RECORDING_NOISE = "recording-noise" {
        "fitted": Info,
            "The tracker noise is {sigma} per coordinate in this recording and {others} in the others: the recording has its own noise level in the fit.",
            "If the noise is higher, check the distance, the cameras in view and the exposure. The weights are right.";
        "held_out": Info,
            "The tracker noise is {sigma} per coordinate in this held-out recording and {others} in the fitted ones: its errors are judged by its own noise.",
            "If the noise is higher, check the distance, the cameras in view and the exposure.";
    }
    /// Shapes that the 3-D view lacks.
    SHAPE_NOT_DRAWN = "shape-not-drawn" {
        "format": Info,
            "{missing} of {total:shape} of the links are missing in the 3-D view: neither STL nor OBJ nor Collada (DAE): {shapes:code}[[ and {more} more]].",
            "Convert the meshes to STL, OBJ or DAE to see them. No number depends on it.";
        "no_package": Info,
            "{missing} of {total:shape} of the links are missing in the 3-D view: their package is neither around the URDF nor under `robot.packages`: {shapes:code}[[ and {more} more]].",
            "Name the package under `robot.packages` to see them. No number depends on it.";
        "scheme": Info,
            "{missing} of {total:shape} of the links are missing in the 3-D view: only `file://`, `package://` and `model://` are read: {shapes:code}[[ and {more} more]].",
            "Name the files by a path to see them. No number depends on it.";
        "outside": Info,
            "{missing} of {total:shape} of the links are missing in the 3-D view: the files lie outside of the URDF's folder, of its package and of `robot.packages`: {shapes:code}[[ and {more} more]].",
            "Name the folder of the meshes under `robot.packages`, and the files by `package://`, to see them. No number depends on it.";
        "unreadable": Info,
            "{missing} of {total:shape} of the links are missing in the 3-D view: the files cannot be read: {shapes:code}[[ and {more} more]].",
            "Correct the paths to see them. No number depends on it.";
        "too_large": Info,
            "{missing} of {total:shape} of the links are missing in the 3-D view: the files have more than 128 MB: {shapes:code}[[ and {more} more]].",
            "Reduce the meshes to see them. No number depends on it.";
        "damaged": Info,
            "{missing} of {total:shape} of the links are missing in the 3-D view: the files are damaged meshes: {shapes:code}[[ and {more} more]].",
            "Export the meshes again to see them. No number depends on it.";
        "undefined": Info,
            "{missing} of {total:shape} of the links are missing in the 3-D view: the URDF format does not define the shape: {shapes:code}[[ and {more} more]].",
            "Correct the `<visual>` elements to see them. No number depends on it.";
    }
    /// The data do not see how large the robot is.
    SIZE_NOT_SEEN = "size-not-seen" {
        "contacts": Error,
            "The size of the robot is not observable: a scaled robot satisfies the contacts equally well, so held-out contacts cannot detect it. The priors alone determine it to ±{sigma:percent}, {at_reach} at the reach of {reach:m}[[, and the fit changed it by {change:percent}, which no measurement supports]].",
            "Provide one length: a ball bar, two places at a known distance, or a tracked body on the robot; or state lengths that were measured with their σ.";
        "tracked": Warning,
            "The size of the robot is not observable: the priors alone determine it to ±{sigma:percent}, {at_reach} at the reach of {reach:m}.",
            "Record poses in which the joints move together over their ranges.";
    }
    /// All lengths were found in one ratio to those of the URDF.
    LENGTHS_IN_ONE_RATIO = "lengths-in-one-ratio" {
        "clear": Warning,
            "The {count} lengths of the robot that were found are {scale:percent} ± {sigma:percent} longer than in the URDF (negative: shorter), all in one ratio: the tracker's unit of length is off by as much, or the URDF's is.",
            "Measure a known length with the tracker, such as a scale bar. If the tracker is right, the result is, too. If not, calibrate the tracker, or correct the scale of its export, and record again.";
        "perhaps": Warning,
            "The {count} lengths of the robot that were found are {scale:percent} ± {sigma:percent} longer than in the URDF (negative: shorter). They may be so in one ratio, which errors of single lengths imitate with a probability of {chance:percent}: then the tracker's unit of length is off by as much, or the URDF's is, and all lengths and distances of the result are.",
            "Measure a known length with the tracker, such as a scale bar or the printed board. If the tracker is right, the result is, too. If not, calibrate the tracker, or correct the scale of its export, and record again.";
    }
    /// Contacts that leave a direction of the root open.
    CONTACT_DIRECTION_MISSING = "contact-direction-missing" {
        "": Warning,
            "No contact holds the tip along {directions} of the robot's root: what the joints do along it shows only through the tilt of what is touched.",
            "Add a contact that does: a plane with its normal there, an edge across it, or a socket.";
    }
    /// Priors, not data, hold what matters at the tool.
    HELD_BY_PRIORS = "held-by-priors" {
        "contacts": Error,
            "Over the joint ranges, {held} rms of the uncertainty at the tool is determined by the priors alone, more than the limit of {limit}; held-out contacts cannot detect an error there.",
            "Add contacts in postures spread over the joint ranges, or measure lengths and state them with their σ.";
        "tracked": Warning,
            "Over the joint ranges, {held} rms of the uncertainty at the tool is determined by the priors alone, more than the limit of {limit}.",
            "Record poses in which the joints move together over their ranges.";
        "open_contacts": Error,
            "A combination of parameters that neither data nor priors determine moves the tool: its position is unknown.",
            "State a σ for the places that are touched and for what is free, or add contacts.";
        "open_tracked": Warning,
            "A combination of parameters that neither data nor priors determine moves the tool in other postures.",
            "Record poses in which the joints move together over their ranges, or keep the priors.";
    }
}
