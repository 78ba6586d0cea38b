//! The robot in the parameters of Denavit and Hartenberg, and of Hayati between parallel axes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Unit;

/// A chain of joints. Frame i has its z on the axis of joint i; M turns about z by what the joint indicates, or slides along it:
///
/// ```text
/// root_from_link(q) = B · M(q_1) · T_1 · M(q_2) · T_2 … M(q_n) · E
/// T = Rz(theta) Tz(d) Tx(a) Rx(alpha), or between parallel axes Rz(theta) Tx(a) Rx(alpha) Ry(beta)
/// ```
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DhTable {
    /// The root link.
    pub root: String,
    /// The link at the end.
    pub link: String,
    /// The joint that nothing but E follows.
    pub last_joint: String,
    /// The T, one for each joint but the last.
    pub rows: Vec<DhTableRow>,
    /// B of the nominal and of the calibrated robot: x, y, z (m), roll, pitch, yaw of the URDF (rad).
    pub root_from_first: [[f64; 6]; 2],
    /// E of the nominal and of the calibrated robot, in the same form.
    pub last_from_link: [[f64; 6]; 2],
}

/// T behind a joint.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DhTableRow {
    /// The joint in front.
    pub joint: String,
    /// Four numbers, in the order in which they act.
    pub values: Vec<DhValue>,
}

/// One number of the table.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DhValue {
    /// `theta`, `d`, `a`, `alpha` or `beta`.
    pub parameter: String,
    /// m or rad.
    pub unit: Unit,
    /// Of the nominal robot.
    pub nominal: f64,
    /// Of the calibrated robot; an angle on the nominal one's side of ±180°.
    pub value: f64,
    /// Standard deviation of `value`; null where it is unknown.
    pub sigma: Option<f64>,
    /// Whether the data alone determine it; else it is a convention, or comes from the priors.
    pub measured: bool,
}

impl DhTableRow {
    /// The number of this name.
    #[must_use]
    pub fn value(&self, parameter: &str) -> Option<&DhValue> {
        self.values
            .iter()
            .find(|value| value.parameter == parameter)
    }
}
