//! Body poses: `e = [Log(R_zᵀ R); R_zᵀ (t − t_z)]`, six rows in body axes, rad and m.
//!
//! A camera on the robot states where a board beside it is, `to_from_from`. The errors of its angles are those of the board's angles, not of a
//! lever from the board to the camera, so that the residual is formed there: `e = [Log(R_zᵀ R); −Rᵀt + R_zᵀt_z]`.

use nalgebra::{Isometry3, Matrix6};

use super::{At, Deviation, Input, Kind, Rows, isotropic, norm};
use crate::graph::error::Error;
use crate::graph::ids::GroupId;

/// Body poses.
#[derive(Debug, Clone, PartialEq)]
pub struct Poses {
    /// How their noise is described.
    pub noise: PoseNoise,
    /// What was seen.
    pub observations: Vec<PoseObservation>,
}

/// Body seen at a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseObservation {
    /// Sample index.
    pub sample: usize,
    /// `from_from_to`.
    pub pose: Isometry3<f64>,
    /// The inverse was measured: noise, residual and deviation are those of `to_from_from`.
    pub inverse: bool,
}

/// Noise of a measured pose.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "one per measurement, not per observation; a box would cost Copy"
)]
#[non_exhaustive]
pub enum PoseNoise {
    /// Isotropic in orientation and position.
    Split {
        /// σ rad.
        orientation: GroupId,
        /// σ m.
        position: GroupId,
    },
    /// Full covariance `[ω; v]` in the body frame, times the group's σ².
    Full {
        /// Shape.
        shape: Matrix6<f64>,
        /// Its scale.
        scale: GroupId,
    },
}

impl PoseNoise {
    pub(super) fn check(&self, input: &Input<'_>) -> Result<(), Error> {
        match self {
            Self::Split { .. } => Ok(()),
            Self::Full { shape, .. } => input.definite(*shape, shape.determinant()),
        }
    }

    pub(super) fn covariance(&self, add: &mut dyn FnMut(usize, usize, GroupId, f64)) {
        match self {
            Self::Split {
                orientation,
                position,
            } => {
                isotropic(0..3, *orientation, add);
                isotropic(3..6, *position, add);
            }
            Self::Full { shape, scale } => {
                for i in 0..6 {
                    for j in 0..=i {
                        add(i, j, *scale, shape[(i, j)]);
                    }
                }
            }
        }
    }
}

/// Rotation and position of a residual (2).
pub(super) fn deviation(e: &[f64]) -> Deviation {
    Deviation {
        rotation: Some(norm(&e[..3])),
        position: Some(norm(&e[3..])),
    }
}

impl Kind for Poses {
    fn samples(&self) -> Vec<usize> {
        self.observations.iter().map(|o| o.sample).collect()
    }

    fn rows(&self) -> usize {
        6
    }

    fn check(&self, input: &Input<'_>) -> Result<(), Error> {
        for o in &self.observations {
            input.pose(o.sample, &o.pose)?;
        }
        self.noise.check(input)
    }

    fn residual(&self, item: usize, at: &At<'_>) -> Rows {
        let PoseObservation { pose, inverse, .. } = &self.observations[item];
        let r_z = pose.rotation.to_rotation_matrix();
        match inverse {
            false => Rows::pose(r_z.matrix(), &pose.translation.vector, at),
            true => Rows::inverse_pose(r_z.matrix(), &pose.translation.vector, at),
        }
    }

    fn covariance(&self, _item: usize, add: &mut dyn FnMut(usize, usize, GroupId, f64)) {
        self.noise.covariance(add);
    }

    fn deviation(&self, e: &[f64]) -> Deviation {
        deviation(e)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::graph::measurement::tests::assert_jacobian;

    #[test]
    fn derivatives_are_those_of_the_residual_in_both_directions() {
        for inverse in [false, true] {
            let pose = Isometry3::new(Vector3::new(0.2, -0.1, 0.7), Vector3::new(0.4, 0.3, -0.2));
            let noise = PoseNoise::Split {
                orientation: GroupId::of(0),
                position: GroupId::of(1),
            };
            let observations = vec![PoseObservation {
                sample: 0,
                pose,
                inverse,
            }];
            assert_jacobian(&Poses {
                noise,
                observations,
            });
        }
    }
}
