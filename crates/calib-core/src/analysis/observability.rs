//! What the data cannot tell, in words, and what would help.

use nalgebra::{DVector, Vector3};
use serde::{Deserialize, Serialize};

use crate::analysis::information::Information;
use crate::graph::edge::{Axis, EdgeKind, Role};
use crate::graph::parameter::ParameterKind;
use crate::model::cache::EdgeCache;
use crate::model::layout::Model;
use crate::model::null_space::{TERM, sparse_basis};
use crate::model::path::{Derivatives, Step};
use crate::model::values::Values;

/// A family of directions that measurements cannot see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gauge {
    /// No measurement changes when this parameter does.
    NotSeen,
    /// The robot's base can be shifted or turned against the tracker's world.
    WorldAgainstBase,
    /// A zero offset is the same as a turn of the joint's own origin about its axis.
    OffsetAgainstOwnOrigin,
    /// A zero offset is the same as a turn of the neighbouring origin or mount about its axis.
    OffsetAgainstNeighbour,
    /// An origin slides along its own axis into the next.
    SlideAlongAxis,
    /// An origin turns about its own axis into the next.
    TurnAboutAxis,
    /// Two parallel axes: shifts along them add up.
    ParallelAxes,
    /// The axes of several joints coincide in every pose: their offsets add up.
    CollinearAxes,
    /// The body on the last link moves against the last joint's origin.
    ToolAgainstLastOrigin,
    /// The points that are seen leave their body free to turn.
    PointOnlyTool,
    /// Marker coordinates move against the frame that only they define.
    MarkersAgainstMount,
    /// The whole chain moves between tracker and body without a trace: too few axes moved.
    WorldAgainstTool,
    /// A gain or coupling is the same as a size: nothing metric is known.
    Scale,
    /// A plane, table or contact moves against another.
    TableAgainstContact,
    /// A combination without a name.
    Unnamed,
}

/// Share of one parameter in a direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Term {
    /// Parameter.
    pub name: String,
    /// Its change, in its unit, when the first term changes by one of its scales (1°, 1 cm or prior σ).
    pub amount: f64,
}

/// A direction in the space of parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Direction {
    /// Parameters that move together, largest share first.
    pub terms: Vec<Term>,
    /// Posterior σ along it if the data alone decided, in units of the prior; `None`: infinite.
    pub sigma: Option<f64>,
    /// Its family.
    pub gauge: Gauge,
    /// In words.
    pub text: String,
    /// What would help.
    pub remedy: String,
}

/// Result of the analysis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Observability {
    /// Singular values of the whitened Jacobian in units of the parameters' scales, descending.
    pub singular_values: Vec<f64>,
    /// Directions that the data see.
    pub rank: usize,
    /// Gauges: directions that no data of this kind would see.
    pub null: Vec<Direction>,
    /// Seen, but with a σ larger than the prior's.
    pub weak: Vec<Direction>,
    /// Joints that never moved, held at nominal.
    pub unmoved: Vec<String>,
}

impl Observability {
    /// Number of directions that the data do not see.
    #[must_use]
    pub fn nullity(&self) -> usize {
        self.null.len()
    }
}

/// A direction with a singular value below this has more σ left than the prior had.
const WEAK: f64 = 1.0;
/// Terms printed for a direction that is not sparse.
const MAX_TERMS: usize = 4;
/// Two axes are parallel when the sine between them stays below this in every pose.
const PARALLEL: f64 = 1e-6;

/// Where a free parameter sits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    Pose(usize),
    Effects(usize),
    Points(usize),
    Loose(usize),
}

pub(crate) fn observe(model: &Model, values: &Values, information: &Information) -> Observability {
    let places = places(model);
    let mut blocks: Vec<(Place, Vec<usize>)> = Vec::new();
    for (c, place) in places.iter().enumerate() {
        match blocks.iter_mut().find(|(p, _)| p == place) {
            Some((_, columns)) => columns.push(c),
            None => blocks.push((*place, vec![c])),
        }
    }
    let order = chain_order(model);
    blocks.sort_by_key(|(p, columns)| (order_of(*p, &order), columns[0]));
    let columns: Vec<Vec<usize>> = blocks.into_iter().map(|(_, c)| c).collect();
    let null = information.null_space();
    let basis = if null.ncols() == 0 {
        Vec::new()
    } else {
        sparse_basis(&null, &columns)
    };
    let axes = Axes::new(model, values);
    let null = basis
        .iter()
        .map(|v| direction(model, information, &places, &axes, v, None))
        .collect();
    let weak = (0..information.rank)
        .filter(|&i| information.singular_values[i] < WEAK)
        .map(|i| {
            let v: DVector<f64> = information.directions.column(i).into_owned();
            let sigma = 1.0 / information.singular_values[i];
            direction(model, information, &places, &axes, &v, Some(sigma))
        })
        .collect();
    Observability {
        singular_values: information.singular_values.iter().copied().collect(),
        rank: information.rank,
        null,
        weak,
        unmoved: model
            .unmoved()
            .iter()
            .map(|e| model.problem.edge_name(*e).to_owned())
            .collect(),
    }
}

fn places(model: &Model) -> Vec<Place> {
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

/// Edges in the order in which the longest path meets them.
fn chain_order(model: &Model) -> Vec<usize> {
    let mut order = Vec::new();
    let mut paths: Vec<_> = model.paths.iter().collect();
    paths.sort_by_key(|p| std::cmp::Reverse(p.steps.len()));
    for path in paths {
        for step in &path.steps {
            if let Step::Unknown { edge, .. } | Step::Joint { edge, .. } = step
                && !order.contains(edge)
            {
                order.push(*edge);
            }
        }
    }
    order
}

fn order_of(place: Place, order: &[usize]) -> usize {
    match place {
        Place::Pose(e) | Place::Effects(e) => {
            order.iter().position(|o| *o == e).unwrap_or(order.len())
        }
        Place::Points(_) => order.len() + 1,
        Place::Loose(_) => order.len() + 2,
    }
}

/// Joint axes in a common frame for a few samples, to see which are parallel.
struct Axes {
    /// (edge, direction per probed sample)
    joints: Vec<(usize, Vec<Vector3<f64>>)>,
}

impl Axes {
    fn new(model: &Model, values: &Values) -> Self {
        /// Samples probed: parallel in five different poses is parallel.
        const PROBES: usize = 5;
        let used: Vec<usize> = (0..model.problem.samples)
            .filter(|&s| !model.of_sample[s].is_empty())
            .collect();
        let stride = (used.len() / PROBES).max(1);
        let probes: Vec<usize> = used.iter().step_by(stride).copied().collect();
        let mut cache = EdgeCache::new(&model.problem, model.trig.clone());
        cache.update(&model.problem, values);
        let mut joints: Vec<(usize, Vec<Vector3<f64>>)> = Vec::new();
        for path in &model.paths {
            let mut out = path.buffer();
            for (k, step) in path.steps.iter().enumerate() {
                let Step::Joint { edge, .. } = step else {
                    continue;
                };
                let EdgeKind::Joint(joint) = &model.problem.edges[*edge].kind else {
                    continue;
                };
                if joints.iter().any(|(e, _)| e == edge) {
                    continue;
                }
                let mut before = path.clone();
                before.steps.truncate(k);
                let directions = probes
                    .iter()
                    .map(|&s| {
                        let x = before.evaluate(
                            &model.problem,
                            &cache,
                            values,
                            s,
                            Derivatives::None,
                            &mut out,
                        );
                        x.r * joint.axis.direction().into_inner()
                    })
                    .collect();
                joints.push((*edge, directions));
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

fn direction(
    model: &Model,
    information: &Information,
    places: &[Place],
    axes: &Axes,
    v: &DVector<f64>,
    sigma: Option<f64>,
) -> Direction {
    let largest = v.amax();
    let mut columns: Vec<usize> = (0..v.len())
        .filter(|&c| v[c].abs() > TERM * largest)
        .collect();
    columns.sort_by(|&a, &b| v[b].abs().total_cmp(&v[a].abs()).then(a.cmp(&b)));
    let lead = columns.first().map_or(1.0, |&c| v[c]);
    let terms: Vec<Term> = columns
        .iter()
        .map(|&c| Term {
            name: name(model, c).to_owned(),
            amount: v[c] / lead * information.scale[c],
        })
        .collect();
    let gauge = classify(model, places, axes, &columns);
    let mut text = match terms.as_slice() {
        [] => String::new(),
        [only] => format!("`{}`", only.name),
        [first, rest @ ..] => {
            let mut shown: Vec<String> = rest
                .iter()
                .take(MAX_TERMS - 1)
                .map(|t| format!("`{}`", t.name))
                .collect();
            if rest.len() > MAX_TERMS - 1 {
                shown.push(format!("{} more", rest.len() + 1 - MAX_TERMS));
            }
            format!("`{}` trades against {}", first.name, listing(&shown))
        }
    };
    match sigma {
        None => text.push_str(&format!(": {}", reason(gauge))),
        Some(s) => text.push_str(&format!(
            ": seen, but {s:.1} times less sharply than it was known beforehand"
        )),
    }
    Direction {
        terms,
        sigma,
        gauge,
        text,
        remedy: if sigma.is_some() {
            "add poses in which the joints involved turn further and differently, or keep the prior"
                .to_owned()
        } else {
            remedy(gauge).to_owned()
        },
    }
}

fn listing(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [all @ .., last] => format!("{} and {last}", all.join(", ")),
    }
}

fn name(model: &Model, column: usize) -> &str {
    &model.problem.parameters[model.columns[column]].name
}

/// The family of a sparse null vector, from the places and kinds of its terms.
fn classify(model: &Model, places: &[Place], axes: &Axes, columns: &[usize]) -> Gauge {
    let problem = &model.problem;
    let kind = |c: usize| problem.parameters[model.columns[c]].kind;
    let mut world = Vec::new();
    let mut origins = Vec::new();
    let mut mounts = Vec::new();
    let mut others = Vec::new();
    let mut effects = Vec::new();
    let mut points = Vec::new();
    for &c in columns {
        let (list, id) = match places[c] {
            Place::Pose(e) => match &problem.edges[e].kind {
                EdgeKind::Unknown(u) => match u.role {
                    Role::World => (&mut world, e),
                    Role::JointOrigin => (&mut origins, e),
                    Role::Mount => (&mut mounts, e),
                    Role::Other => (&mut others, e),
                },
                _ => (&mut others, e),
            },
            Place::Effects(e) => (&mut effects, e),
            Place::Points(f) => (&mut points, f),
            Place::Loose(p) => (&mut others, p),
        };
        if !list.contains(&id) {
            list.push(id);
        }
    }
    let scale = columns.iter().any(|&c| kind(c).is_scale());
    let rotates = columns.iter().any(|&c| kind(c) == ParameterKind::Rotation);
    if columns.len() == 1 && points.is_empty() && mounts.is_empty() {
        return Gauge::NotSeen;
    }
    if !others.is_empty() {
        return Gauge::TableAgainstContact;
    }
    if scale && columns.len() > 1 {
        return Gauge::Scale;
    }
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
        (1.., 0, 0, 0, 0) => Gauge::NotSeen,
        (1.., ..) => Gauge::WorldAgainstTool,
        (0, 1, 1, 0, 0) if owns(problem, origins[0], effects[0]) => Gauge::OffsetAgainstOwnOrigin,
        (0, 0, 2.., 0, 0) => Gauge::CollinearAxes,
        (0, _, 0, 1.., _) | (0, _, 0, 0, 1..) => Gauge::ToolAgainstLastOrigin,
        (0, _, 1.., ..) => Gauge::OffsetAgainstNeighbour,
        (0, 2.., 0, 0, 0) => {
            let joints: Vec<usize> = origins
                .iter()
                .filter_map(|&o| joint_of(problem, o))
                .collect();
            let parallel =
                joints.len() >= 2 && joints.windows(2).all(|w| axes.parallel(w[0], w[1]));
            if rotates {
                Gauge::TurnAboutAxis
            } else if parallel {
                Gauge::ParallelAxes
            } else {
                Gauge::SlideAlongAxis
            }
        }
        (0, 1, 0, 0, 0) => Gauge::NotSeen,
        _ => Gauge::Unnamed,
    }
}

/// The joint edge whose origin this edge is.
fn joint_of(problem: &crate::graph::problem::Problem, origin: usize) -> Option<usize> {
    let EdgeKind::Unknown(u) = &problem.edges[origin].kind else {
        return None;
    };
    let name = u.joint.as_deref()?;
    problem.edges.iter().position(|e| {
        e.name == name
            && matches!(&e.kind, EdgeKind::Joint(j)
                if matches!(j.axis, Axis::Revolute(_) | Axis::Prismatic(_)))
    })
}

fn owns(problem: &crate::graph::problem::Problem, origin: usize, joint: usize) -> bool {
    joint_of(problem, origin) == Some(joint)
}

fn reason(gauge: Gauge) -> &'static str {
    match gauge {
        Gauge::NotSeen => "no measurement changes with it",
        Gauge::WorldAgainstBase => "only the robot as a whole is seen, not where its base begins",
        Gauge::OffsetAgainstOwnOrigin => {
            "a zero offset is a turn of the joint's own origin about its axis"
        }
        Gauge::OffsetAgainstNeighbour => {
            "a zero offset is a turn of what comes next about its axis"
        }
        Gauge::SlideAlongAxis => "an origin may slide along its own axis into the next",
        Gauge::TurnAboutAxis => "an origin may turn about its own axis into the next",
        Gauge::ParallelAxes => "parallel axes",
        Gauge::CollinearAxes => "their axes coincide in every pose",
        Gauge::ToolAgainstLastOrigin => "the body moves with the last joint as one piece",
        Gauge::PointOnlyTool => "the points that are seen leave the body free to turn",
        Gauge::MarkersAgainstMount => "only its markers say where the body's frame is",
        Gauge::WorldAgainstTool => {
            "the joints that moved leave the whole chain free between tracker and body"
        }
        Gauge::Scale => "a size and a gain act alike: no length is known",
        Gauge::TableAgainstContact => "the contact sees only their difference",
        Gauge::Unnamed => "the measurements see only their combination",
    }
}

fn remedy(gauge: Gauge) -> &'static str {
    match gauge {
        Gauge::NotSeen => "hold it, or put a marker behind it",
        Gauge::WorldAgainstBase => {
            "hold one of the two, or put a tracking body on the base and measure it too"
        }
        Gauge::OffsetAgainstOwnOrigin => {
            "free only one of the two: the offset, or the origin's turn"
        }
        Gauge::OffsetAgainstNeighbour => {
            "hold the offset (the URDF's zero is a convention), or fix the mark that defines zero"
        }
        Gauge::SlideAlongAxis | Gauge::TurnAboutAxis | Gauge::ParallelAxes => {
            "harmless for the tool: hold one of them, or keep the prior that shares it out"
        }
        Gauge::CollinearAxes => "move the joint between them, so that the axes part",
        Gauge::ToolAgainstLastOrigin => {
            "hold the mount or the last origin, or measure a second body on the last link"
        }
        Gauge::PointOnlyTool => "put at least three markers, not in a line, on the body",
        Gauge::MarkersAgainstMount => "hold the mount, or measure the markers on their body",
        Gauge::WorldAgainstTool => "move more joints, with axes that are not parallel",
        Gauge::Scale => "give one length: a known marker distance or a known origin",
        Gauge::TableAgainstContact => "measure the table (or the contact point) by itself once",
        Gauge::Unnamed => "hold one of them, or add motion of the joints between them",
    }
}
