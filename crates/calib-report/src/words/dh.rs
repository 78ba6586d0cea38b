//! The kinematic table in words.

use super::prose::code;
use crate::DhTable;

/// What the numbers mean.
pub(crate) fn table(table: &DhTable) -> String {
    format!(
        "From {} to {}: each joint turns about the z axis of its frame, or slides along it; behind it come Rz(θ) Tz(d) Tx(a) Rx(α) (Denavit and Hartenberg), or between parallel axes Rz(θ) Tx(a) Rx(α) Ry(β) (Hayati). θ adds to the indicated position of the joint. Values marked with * are conventions, were held, or come from their priors: the data do not determine them.",
        code(&table.root),
        code(&table.link)
    )
}

/// Where the chain begins and ends.
pub(crate) const ENDS: &str =
    "Before the first and behind the last joint: x, y, z; roll, pitch, yaw as in the URDF.";

/// What the offsets mean.
pub(crate) fn offsets(table: &DhTable) -> String {
    format!(
        "Controller offsets: calibrated minus nominal θ, to be added to the position that the joint indicates. The zero of {} is not distinguishable from the rotation of what it carries; those marked with * are not distinguishable from the placement of the base, or come from their priors.",
        code(&table.last_joint)
    )
}
