//! What a session may fail to notice: an effect of a joint that is not free, a body that slipped on its link.

use calib_core::EffectKind;
use calib_pipeline::formulate::kinematics::Calibration;
use calib_urdf::JointId;
use nalgebra::{Isometry3, Vector3};

/// Something that is wrong with the robot or the recordings.
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// An effect that the model does not have.
    Effect {
        /// The joint.
        joint: JointId,
        /// Its term.
        kind: EffectKind,
        /// The joint that it is coupled to, of a coupling.
        other: Option<JointId>,
        /// Its coefficient, SI.
        size: f64,
    },
    /// A body sits elsewhere on its link from a row on, and in the recordings after it.
    Slip {
        /// The body.
        body: String,
        /// The recording.
        recording: String,
        /// First row after it, from 0.
        row: usize,
        /// By how much, in the frame of the body, m.
        by: Vector3<f64>,
    },
}

impl Fault {
    /// Puts an effect into a robot.
    pub fn put_into(&self, robot: &mut Calibration) {
        let Self::Effect {
            joint,
            kind,
            other,
            size,
        } = self
        else {
            return;
        };
        let effects = &mut robot.effects[joint.index()];
        match other {
            Some(other) => *effects.coupling.entry(other.index()).or_insert(0.0) += size,
            None => *effects.coefficients.entry(*kind).or_insert(0.0) += size,
        }
    }

    /// By how much a body has slipped in a row; `None`: it has not.
    #[must_use]
    pub fn slip(&self, of: &str, at: &str, row_at: usize) -> Option<Isometry3<f64>> {
        match self {
            Self::Slip {
                body,
                recording,
                row,
                by,
            } if body == of => {
                let after = at > recording.as_str() || (at == recording && row_at >= *row);
                after.then(|| Isometry3::translation(by.x, by.y, by.z))
            }
            _ => None,
        }
    }
}
