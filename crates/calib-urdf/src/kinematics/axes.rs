//! How the axes of consecutive joints lie to each other: what decides which origins are observable.
//!
//! Along two parallel axes only the sum of the offsets is in the motion, and where axes meet, some
//! origins may be moved along them unseen. A solver that chooses its gauges needs the list of such pairs.

use crate::kinematics::ChainStep;
use crate::model::{JointId, LinkId, RobotModel};
use calib_geometry::Line;
use nalgebra::{Isometry3, Point3};

/// How two axes lie to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum AxisRelation {
    /// Same line.
    Coincident,
    /// Same direction (or opposite), apart.
    Parallel,
    /// They meet in a point.
    Intersecting,
    /// Neither.
    Skew,
}

/// Two turning or sliding joints with no moving joint between them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct AxisPair {
    /// The one nearer to the chain's beginning.
    pub first: JointId,
    /// The one after it.
    pub second: JointId,
    /// Angle between the lines, rad, in [0, π/2].
    pub angle: f64,
    /// Shortest distance of the lines, m.
    pub distance: f64,
    /// By the tolerances of [`RobotModel::axis_pairs`].
    pub relation: AxisRelation,
}

impl RobotModel {
    /// The axis of a joint as a line in the root link's frame, through the joint's origin; `None` for a fixed joint.
    ///
    /// A sliding joint has a direction but no line of its own; the one through its origin is given.
    #[must_use]
    pub fn axis_in_root(&self, root_from_link: &[Isometry3<f64>], joint: JointId) -> Option<Line> {
        let axis = self.joint(joint).kind.axis()?;
        // The child link's frame is the joint's frame after a motion that leaves the axis where it is.
        let root_from_child = root_from_link.get(self.joint(joint).child.index())?;
        Line::new(
            Point3::from(root_from_child.translation.vector),
            root_from_child.rotation * axis.into_inner(),
        )
    }

    /// The moving joints on the way from a link to another, with the side from which each is passed.
    #[must_use]
    pub fn moving_chain(&self, from: LinkId, to: LinkId) -> Vec<ChainStep> {
        let moves = |step: &ChainStep| self.joint(step.joint).kind.axis().is_some();
        self.chain(from, to).into_iter().filter(moves).collect()
    }

    /// Consecutive axes along the chain between two links, at joint positions `q`.
    ///
    /// Angles under `angle_tolerance` (rad) count as parallel, distances under `distance_tolerance` (m) as touching. The
    /// relation of neighboring revolute joints does not depend on `q`.
    #[must_use]
    pub fn axis_pairs(
        &self,
        q: &[f64],
        from: LinkId,
        to: LinkId,
        angle_tolerance: f64,
        distance_tolerance: f64,
    ) -> Vec<AxisPair> {
        let root_from_link = self.forward_kinematics(q);
        let axes: Vec<(JointId, Line)> = self
            .moving_chain(from, to)
            .into_iter()
            .filter_map(|step| Some((step.joint, self.axis_in_root(&root_from_link, step.joint)?)))
            .collect();
        axes.windows(2)
            .map(|pair| {
                let [(first, a), (second, b)] = [&pair[0], &pair[1]];
                let angle = a.angle_to(b);
                let parallel = angle <= angle_tolerance;
                // Of nearly parallel lines the nearest points diverge: the distance at the joint is meant then.
                let distance = if parallel {
                    a.distance_to_point(&b.point)
                } else {
                    a.distance_to_line(b)
                };
                let relation = match (parallel, distance <= distance_tolerance) {
                    (true, true) => AxisRelation::Coincident,
                    (true, false) => AxisRelation::Parallel,
                    (false, true) => AxisRelation::Intersecting,
                    (false, false) => AxisRelation::Skew,
                };
                AxisPair {
                    first: *first,
                    second: *second,
                    angle,
                    distance,
                    relation,
                }
            })
            .collect()
    }
}
