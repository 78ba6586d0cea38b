//! Families of directions that the measurements cannot see, from the places and kinds of the parameters in them.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::graph::edge::{EdgeKind, Role};
use crate::graph::parameter::ParameterKind;
use crate::graph::problem::Problem;
use crate::model::cache::{EdgeCache, State};
use crate::model::layout::Model;
use crate::model::path::{CompiledPath, Derivatives, Step};
use crate::model::values::Values;

/// A family of directions that measurements cannot see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gauge {
    /// No measurement depends on this parameter.
    NotMeasured,
    /// The robot's base can be translated or rotated against the tracker's world.
    WorldAgainstBase,
    /// A joint offset is the same as a rotation of the joint's own origin about its axis.
    OffsetAgainstOwnOrigin,
    /// A joint offset is the same as a rotation of the neighboring origin or mount about the joint axis.
    OffsetAgainstNeighbor,
    /// A translation of an origin along its own axis is the same as one of the next origin.
    TranslationAlongAxis,
    /// A rotation of an origin about its own axis is the same as one of the next origin.
    RotationAboutAxis,
    /// Two parallel axes: translations along them add up.
    ParallelAxes,
    /// The axes of several joints coincide in every pose: their offsets add up.
    CollinearAxes,
    /// The body on the last link moves against the last joint's origin.
    ToolAgainstLastOrigin,
    /// The observed points do not determine the orientation of their body.
    PointOnlyTool,
    /// Marker coordinates move against the frame that only they define.
    MarkersAgainstMount,
    /// The whole chain moves between tracker and body without effect: too few axes moved.
    WorldAgainstTool,
    /// A gain or coupling is the same as a length: no length is known.
    Scale,
    /// Masses and the compliances that yield to them: only products of both act.
    LoadsAgainstCompliances,
    /// A plane, table or contact moves against another.
    TableAgainstContact,
    /// A combination without a name.
    Unnamed,
}

/// Two axes are parallel when the sine between them stays below this in every pose: far above the rounding of a
/// product of rotations, far below any assembly error.
const PARALLEL: f64 = 1e-6;

/// Where a free parameter belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Place {
    /// An unknown pose: the edge.
    Pose(usize),
    /// The effects of a joint: the edge.
    Effects(usize),
    /// Point coordinates: the frame.
    Points(usize),
    /// Neither: the parameter.
    Loose(usize),
}

/// Place of every free parameter, in the order of the columns.
pub(crate) fn places(model: &Model) -> Vec<Place> {
    let mut place: Vec<Place> = (0..model.problem.parameters.len())
        .map(Place::Loose)
        .collect();
    for (e, edge) in model.problem.edges.iter().enumerate() {
        match &edge.kind {
            EdgeKind::Unknown(u) => {
                for p in u.parameters.iter().flatten() {
                    place[p.index()] = Place::Pose(e);
                }
            }
            EdgeKind::Joint(j) => {
                for f in &j.effects {
                    place[f.parameter.index()] = Place::Effects(e);
                    for share in &f.shares {
                        place[share.parameter.index()] = Place::Effects(e);
                    }
                }
            }
            _ => {}
        }
    }
    for point in &model.problem.points {
        for p in point.parameters.iter().flatten() {
            place[p.index()] = Place::Points(point.frame.index());
        }
    }
    model.columns.iter().map(|&p| place[p]).collect()
}

/// Directions of the joint axes in a common frame for a few samples, to see which are parallel.
pub(crate) struct Axes {
    /// (edge, direction per probed sample)
    joints: Vec<(usize, Vec<Vector3<f64>>)>,
}

impl Axes {
    pub(crate) fn new(model: &Model, values: &Values) -> Self {
        /// Samples probed: parallel in five different poses is parallel.
        const PROBES: usize = 5;
        let used: Vec<usize> = (0..model.problem.samples)
            .filter(|&s| !model.of_sample[s].is_empty())
            .collect();
        let stride = (used.len() / PROBES).max(1);
        let probes: Vec<usize> = used.iter().step_by(stride).copied().collect();
        let mut cache = EdgeCache::new(&model.problem, model.trig.clone());
        cache.update(&model.problem, values);
        let at = State::new(&model.problem, &cache, values);
        let mut joints: Vec<(usize, Vec<Vector3<f64>>)> = Vec::new();
        for path in &model.paths {
            for (k, step) in path.steps.iter().enumerate() {
                if let Step::Joint { edge, .. } = step
                    && joints.iter().all(|(e, _)| e != edge)
                    && let EdgeKind::Joint(joint) = &model.problem.edges[*edge].kind
                {
                    let mut before = path.clone();
                    before.steps.truncate(k);
                    let axis = joint.axis.direction().into_inner();
                    joints.push((*edge, directions(at, &before, axis, &probes)));
                }
            }
        }
        Self { joints }
    }

    fn parallel(&self, a: usize, b: usize) -> bool {
        let of = |e: usize| self.joints.iter().find(|(j, _)| *j == e).map(|(_, d)| d);
        match (of(a), of(b)) {
            (Some(a), Some(b)) => a.iter().zip(b).all(|(a, b)| a.cross(b).norm() < PARALLEL),
            _ => false,
        }
    }
}

/// An axis at the end of a path, in the path's first frame, at several samples.
fn directions(
    at: State,
    path: &CompiledPath,
    axis: Vector3<f64>,
    samples: &[usize],
) -> Vec<Vector3<f64>> {
    let mut buffer = path.buffer();
    let mut direction = |&s: &usize| path.evaluate(at, s, Derivatives::None, &mut buffer).r * axis;
    samples.iter().map(&mut direction).collect()
}

/// What the parameters of a direction belong to: edges of unknown poses by their role, joints, frames of points.
#[derive(Default)]
struct Parts {
    world: Vec<usize>,
    origins: Vec<usize>,
    mounts: Vec<usize>,
    others: Vec<usize>,
    effects: Vec<usize>,
    points: Vec<usize>,
}

impl Parts {
    fn of(problem: &Problem, places: impl Iterator<Item = Place>) -> Self {
        let mut parts = Self::default();
        for place in places {
            let (list, id) = match place {
                Place::Pose(e) => match &problem.edges[e].kind {
                    EdgeKind::Unknown(u) => match u.role {
                        Role::World => (&mut parts.world, e),
                        Role::JointOrigin => (&mut parts.origins, e),
                        Role::Mount => (&mut parts.mounts, e),
                        Role::Other => (&mut parts.others, e),
                    },
                    _ => (&mut parts.others, e),
                },
                Place::Effects(e) => (&mut parts.effects, e),
                Place::Points(f) => (&mut parts.points, f),
                Place::Loose(p) => (&mut parts.others, p),
            };
            if !list.contains(&id) {
                list.push(id);
            }
        }
        parts
    }
}

/// The family of a sparse null vector with these columns, from the places and kinds of its terms.
pub(crate) fn classify(model: &Model, places: &[Place], axes: &Axes, columns: &[usize]) -> Gauge {
    let problem = &model.problem;
    let parts = Parts::of(problem, columns.iter().map(|&c| places[c]));
    let kind = |c: &usize| problem.parameters[model.columns[*c]].kind;
    let rotates = || columns.iter().any(|c| kind(c) == ParameterKind::Rotation);
    if columns.len() == 1 && parts.points.is_empty() && parts.mounts.is_empty() {
        return Gauge::NotMeasured;
    }
    if columns.iter().any(|c| kind(c) == ParameterKind::Load) {
        return Gauge::LoadsAgainstCompliances;
    }
    if !parts.others.is_empty() {
        return Gauge::TableAgainstContact;
    }
    if columns.len() > 1 && columns.iter().any(|c| kind(c).is_scale()) {
        return Gauge::Scale;
    }
    let Parts {
        world,
        origins,
        mounts,
        effects,
        points,
        ..
    } = &parts;
    match (
        world.len(),
        origins.len(),
        effects.len(),
        mounts.len(),
        points.len(),
    ) {
        (0, 0, 0, 1.., 0) => Gauge::PointOnlyTool,
        (0, 0, 0, _, 1..) => Gauge::MarkersAgainstMount,
        (1.., 0, 0, 1.., _) | (1.., 0, 0, 0, 1..) => Gauge::WorldAgainstTool,
        (1.., _, _, 0, 0) if !(origins.is_empty() && effects.is_empty()) => Gauge::WorldAgainstBase,
        (1.., 0, 0, 0, 0) => Gauge::NotMeasured,
        (1.., ..) => Gauge::WorldAgainstTool,
        (0, 1, 1, 0, 0) if joint_of(problem, origins[0]) == Some(effects[0]) => {
            Gauge::OffsetAgainstOwnOrigin
        }
        (0, 0, 2.., 0, 0) => Gauge::CollinearAxes,
        (0, _, 0, 1.., _) | (0, _, 0, 0, 1..) => Gauge::ToolAgainstLastOrigin,
        (0, _, 1.., ..) => Gauge::OffsetAgainstNeighbor,
        (0, 2.., 0, 0, 0) if rotates() => Gauge::RotationAboutAxis,
        (0, 2.., 0, 0, 0) if all_parallel(problem, axes, origins) => Gauge::ParallelAxes,
        (0, 2.., 0, 0, 0) => Gauge::TranslationAlongAxis,
        (0, 1, 0, 0, 0) => Gauge::NotMeasured,
        _ => Gauge::Unnamed,
    }
}

/// The joints of these origins have parallel axes in every probed pose.
fn all_parallel(problem: &Problem, axes: &Axes, origins: &[usize]) -> bool {
    let joints: Vec<usize> = origins
        .iter()
        .filter_map(|&o| joint_of(problem, o))
        .collect();
    joints.len() >= 2 && joints.windows(2).all(|w| axes.parallel(w[0], w[1]))
}

/// The joint whose origin this edge is: the one that begins where the edge ends.
fn joint_of(problem: &Problem, origin: usize) -> Option<usize> {
    let end = problem.edges[origin].child;
    let joints = problem.edges.iter();
    joints
        .map(|e| e.parent == end && matches!(e.kind, EdgeKind::Joint(_)))
        .position(|is_it| is_it)
}
