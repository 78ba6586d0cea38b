//! The noise of a session: what the fit found of markers, bodies and joints.

use std::collections::BTreeMap;

use calib_core::measurement::{Growth, PoseNoise, growth};
use calib_core::{EdgeKind, FrameId, GroupId, MeasurementKind, Problem};
use calib_pipeline::formulate::formulation::{Formulation, MlFit};
use calib_urdf::{JointId, RobotModel};

/// Standard deviations that a replay draws from.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Noise {
    /// Each coordinate of a marker, m, by marker.
    pub markers: BTreeMap<String, f64>,
    /// Rotation (rad) and translation (m) of a body that is measured as a pose, each coordinate, by body.
    pub bodies: BTreeMap<String, [f64; 2]>,
    /// The same along the line of sight, where it has levels of its own, by body.
    pub sights: BTreeMap<String, SightNoise>,
    /// Rotation (rad) and translation (m) of a marker body on its link, drawn for each posture, by body.
    pub poses: BTreeMap<String, [f64; 2]>,
    /// Reading of a joint, rad or m, drawn for each posture.
    pub joints: BTreeMap<JointId, f64>,
}

/// Standard deviations along a line of sight; those of [`Noise::bodies`] and [`Noise::markers`] are then the ones across it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SightNoise {
    /// Of positions along it, m.
    pub along: f64,
    /// Of orientations about it, rad.
    pub about: f64,
    /// How they grow with the distance.
    pub growth: Growth,
}

impl SightNoise {
    /// σ of orientations about the axes across the line and about it, rad, and of positions across it and along it, m, of what is at a distance, m.
    pub(crate) fn levels(&self, [turn, shift]: [f64; 2], distance: f64) -> [[f64; 2]; 2] {
        let [across, along] = growth(self.growth.positions, distance);
        let [about, tilt] = growth(self.growth.orientations, distance);
        [
            [turn * tilt, self.about * about],
            [shift * across, self.along * along],
        ]
    }
}

impl Noise {
    /// What a fit found.
    #[must_use]
    pub fn found(fit: &MlFit, model: &RobotModel) -> Self {
        let sigma = |group: GroupId| fit.solution.noise[group.index()].sigma;
        Self::of(&fit.formulation, model, &sigma)
    }

    /// The noise of a stated problem, with σ by group.
    #[must_use]
    pub fn of(
        formulation: &Formulation,
        model: &RobotModel,
        sigma: &dyn Fn(GroupId) -> f64,
    ) -> Self {
        let problem = &formulation.problem;
        let mut noise = Self::default();
        for measurement in problem.measurements() {
            if let Some(sight) = measurement.kind.sight() {
                let levels = SightNoise {
                    along: sigma(sight.along),
                    about: sight.about.map_or(0.0, sigma),
                    growth: sight.growth,
                };
                noise.sights.insert(measurement.name.clone(), levels);
            }
            match &measurement.kind {
                MeasurementKind::Markers(markers) => {
                    for o in &markers.observations {
                        let name = &problem.points()[o.point.index()].name;
                        let level = sigma(markers.noise_of(o.point));
                        noise.markers.insert(name.clone(), level);
                    }
                }
                MeasurementKind::Poses(poses) => {
                    if let PoseNoise::Split {
                        orientation,
                        position,
                    } = poses.noise
                    {
                        let levels = [sigma(orientation), sigma(position)];
                        noise.bodies.insert(measurement.name.clone(), levels);
                    }
                }
                _ => {}
            }
        }
        for joint in model.joint_ids() {
            let edge = formulation.joints[joint.index()];
            let edge = edge.map(|edge| &problem.edges()[edge.index()].kind);
            if let Some(EdgeKind::Joint(of)) = edge
                && let Some(group) = of.noise
            {
                noise.joints.insert(joint, sigma(group));
            }
        }
        for (name, frame) in &formulation.bodies {
            let shift = random_into(problem, *frame);
            let turn = shift.and_then(|(parent, _)| random_into(problem, parent));
            if let (Some((_, shift)), Some((_, turn))) = (shift, turn) {
                noise
                    .poses
                    .insert(name.clone(), [sigma(turn), sigma(shift)]);
            }
        }
        noise
    }

    /// The same with every σ times a factor.
    #[must_use]
    pub fn times(mut self, factor: f64) -> Self {
        let pairs = self.bodies.values_mut().chain(self.poses.values_mut());
        let of_pairs = pairs.flat_map(|pair| pair.iter_mut());
        let single = self.markers.values_mut().chain(self.joints.values_mut());
        let sights = self.sights.values_mut();
        let of_sights = sights.flat_map(|sight| [&mut sight.along, &mut sight.about]);
        let all = of_pairs.chain(single).chain(of_sights);
        all.for_each(|sigma| *sigma *= factor);
        self
    }
}

/// The random step that ends in a frame: where it begins, and its noise.
fn random_into(problem: &Problem, frame: FrameId) -> Option<(FrameId, GroupId)> {
    let mut edges = problem.edges().iter();
    edges.find_map(|edge| match &edge.kind {
        EdgeKind::Random { group, .. } if edge.child == frame => Some((edge.parent, *group)),
        _ => None,
    })
}
