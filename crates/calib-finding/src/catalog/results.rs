//! What the estimation and its result say.

super::topic! {
    /// A sweep does not determine an origin.
    ORIGIN_NOT_OBSERVABLE = "origin-not-observable" {
        "": Error,
            "The sweep `{sweep}` does not determine the origin ({verdict}): {reason}.",
            "Sweep two joints whose axes meet in the origin over more of their range, or ask for a line with one axis.";
    }
    /// What the method `paper` assumes.
    PAPER_ASSUMPTIONS = "paper-assumptions" {
        "": Info,
            "The closed forms assume that the swept axes meet in one point at a right angle, that the encoders have no zero offset, and that the rest of the robot matches the URDF; the reported uncertainty covers the tracker's noise only.",
            "Solve with `solve: {method: ml}`, which estimates axes, offsets and mounts together.";
    }
    /// An active bound.
    ON_ITS_LIMIT = "on-its-limit" {
        "": Warning,
            "The unconstrained estimate lies outside ±{limit}; the bound is active.",
            "Widen `within_mm` or `within_deg` if the limit is not physical; otherwise look for an effect that is not enabled.";
    }
    /// The residuals show an effect that is not in the model.
    MISSING_PHYSICS = "missing-physics" {
        "": Warning,
            "{pattern}.",
            "Enable the effect under `solve.free` or `solve.joints`, and compare the held-out errors.";
    }
    /// Shapes that the 3-D view lacks.
    SHAPE_NOT_DRAWN = "shape-not-drawn" {
        "": Info,
            "{missing} of {total:shape} of the links are missing in the 3-D view: {shapes}[[, and {more} more]].",
            "Convert meshes to STL and name their package under `robot.packages` to see them. No number depends on it.";
    }
}
