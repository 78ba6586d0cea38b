//! Body poses: `e = [Log(R_zᵀ R); R_zᵀ (t − t_z)]`, six rows in body axes, rad and m.
//!
//! A camera on the robot states where a board beside it is, `to_from_from`. The errors of its angles are those of the board's angles, not of a
//! lever from the board to the camera, so that the residual is formed there: `e = [Log(R_zᵀ R); −Rᵀt + R_zᵀt_z]`.

use nalgebra::{Isometry3, Matrix3, Matrix6, Vector3};

use super::{At, Deviation, Input, Kind, Rows, Sight, isotropic, norm};
use crate::graph::error::Error;
use crate::graph::ids::GroupId;

/// Body poses.
#[derive(Debug, Clone, PartialEq)]
pub struct Poses {
    /// How their noise is described.
    pub noise: PoseNoise,
    /// How it differs along the line of sight; `None` where it does not, and of a full covariance.
    pub sight: Option<Sight>,
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

impl PoseObservation {
    /// R_zᵀ t_z: from the instrument to what it saw, in axes of the rows, m, whichever end the instrument is at.
    #[must_use]
    pub fn line_of_sight(&self) -> Vector3<f64> {
        self.pose
            .rotation
            .inverse_transform_vector(&self.pose.translation.vector)
    }
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
        let rows = match inverse {
            false => Rows::pose(r_z.matrix(), &pose.translation.vector, at),
            true => Rows::inverse_pose(r_z.matrix(), &pose.translation.vector, at),
        };
        match self.axes(item) {
            Some(axes) => rows.in_axes(0, &axes).in_axes(3, &axes),
            None => rows,
        }
    }

    fn covariance(&self, item: usize, add: &mut dyn FnMut(usize, usize, GroupId, f64)) {
        if let Some(sight) = &self.sight
            && let PoseNoise::Split {
                orientation,
                position,
            } = self.noise
        {
            let seen = self.observations[item].line_of_sight();
            sight.orientations((0, orientation), &seen, add);
            sight.positions((3, position), &seen, add);
            return;
        }
        self.noise.covariance(add);
    }

    fn deviation(&self, e: &[f64]) -> Deviation {
        deviation(e)
    }

    fn axes(&self, item: usize) -> Option<Matrix3<f64>> {
        let split = matches!(self.noise, PoseNoise::Split { .. });
        let seen = self.sight.filter(|_| split);
        seen.map(|_| Sight::axes(&self.observations[item].line_of_sight()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::measurement::Growth;
    use crate::graph::measurement::tests::assert_jacobian;

    #[test]
    fn derivatives_are_those_of_the_residual_in_both_directions() {
        for inverse in [false, true] {
            let pose = Isometry3::new(Vector3::new(0.2, -0.1, 0.7), Vector3::new(0.4, 0.3, -0.2));
            let noise = PoseNoise::Split {
                orientation: GroupId::of(0),
                position: GroupId::of(1),
            };
            let sight = Sight {
                along: GroupId::of(2),
                about: Some(GroupId::of(3)),
                growth: Growth::default(),
            };
            for sight in [None, Some(sight)] {
                let observations = vec![PoseObservation {
                    sample: 0,
                    pose,
                    inverse,
                }];
                assert_jacobian(&Poses {
                    noise,
                    sight,
                    observations,
                });
            }
        }
    }
}
