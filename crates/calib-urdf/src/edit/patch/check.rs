//! What is refused before a text is looked at.

use crate::edit::change::UrdfEdit;
use crate::edit::error::EditError;
use nalgebra::Isometry3;
use std::collections::BTreeSet;

/// Numbers that must not reach a file, and edits that contradict each other.
pub(super) fn values(edits: &[UrdfEdit]) -> Result<(), EditError> {
    let mut seen = BTreeSet::new();
    for edit in edits {
        let (joint, what, finite) = match edit {
            UrdfEdit::SetOrigin {
                joint,
                parent_link_from_joint,
            } => (joint, "origin", is_finite(parent_link_from_joint)),
            UrdfEdit::SetAxis { joint, axis } => {
                (joint, "axis", axis.iter().all(|x| x.is_finite()))
            }
            UrdfEdit::SetLimits {
                joint,
                lower,
                upper,
            } => {
                if lower > upper {
                    let (lower, upper) = (lower.to_string(), upper.to_string());
                    return Err(EditError::LimitsReversed {
                        joint: joint.clone(),
                        lower,
                        upper,
                    });
                }
                (joint, "limits", lower.is_finite() && upper.is_finite())
            }
            UrdfEdit::AddFixedFrame {
                name,
                joint_name,
                parent_from_frame,
                ..
            } => {
                if !seen.insert((name, "link")) {
                    return Err(EditError::FrameTwice { name: name.clone() });
                }
                (joint_name, "origin", is_finite(parent_from_frame))
            }
            UrdfEdit::AddProvenance { .. } => continue,
        };
        if !finite {
            return Err(EditError::NotFinite {
                joint: joint.clone(),
                what,
            });
        }
        if !seen.insert((joint, what)) {
            return Err(EditError::EditedTwice {
                joint: joint.clone(),
                what,
            });
        }
    }
    Ok(())
}

fn is_finite(pose: &Isometry3<f64>) -> bool {
    pose.translation
        .vector
        .iter()
        .chain(pose.rotation.coords.iter())
        .all(|x| x.is_finite())
}
