//! A checked problem, laid out for the solver: columns, compiled paths, observations by sample.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix6, Vector6};

use crate::graph::edge::{Axis, EdgeKind, EffectKind};
use crate::graph::error::Error;
use crate::graph::ids::{EdgeId, FrameId};
use crate::graph::problem::Problem;
use crate::model::path::CompiledPath;
use crate::model::pose::Pose;

/// A joint whose reading varies by less than this (rad or m) over the samples that use it did not
/// move: 1 mrad on a lever of 1 m is the tracker's noise, so its axis cannot be seen.
pub const MIN_JOINT_RANGE: f64 = 1e-3;

/// A compiled [`Problem`].
#[derive(Debug, Clone)]
pub struct Model {
    pub(crate) problem: Problem,
    /// Column → parameter.
    pub(crate) columns: Vec<usize>,
    /// Parameter → column.
    pub(crate) column_of: Vec<Option<usize>>,
    /// One per measurement.
    pub(crate) paths: Vec<CompiledPath>,
    /// Sorted by (sample, measurement, order given).
    pub(crate) observations: Vec<Observation>,
    /// Observations of each sample.
    pub(crate) of_sample: Vec<Range<usize>>,
    /// The same, by measurement: (sample, observations).
    pub(crate) of_measurement: Vec<Vec<(usize, Range<usize>)>>,
    pub(crate) trig: Trig,
    /// Random effects of a sample.
    pub(crate) slots: Vec<Slot>,
    /// Residual rows over all observations.
    pub(crate) rows: usize,
    /// Largest number of rows in one sample.
    pub(crate) max_rows: usize,
    unmoved: Vec<EdgeId>,
    /// (measurement, sample, item) of observations whose path has no measurement at their sample.
    lost: Vec<(usize, usize, usize)>,
}

/// One observation (vector-valued) of one measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Observation {
    pub sample: usize,
    pub measurement: usize,
    /// Index into the measurement's own list.
    pub item: usize,
    pub rows: usize,
}

/// One scalar random effect per sample; its direction already carries any given scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Slot {
    pub edge: usize,
    pub direction: usize,
    /// `None`: unit variance (a measured edge's own covariance).
    pub group: Option<usize>,
}

/// Values of every parameter (free and fixed), in the order of the problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Values(pub Vec<f64>);

impl Model {
    /// Checks a problem and lays it out.
    ///
    /// # Errors
    /// [`Error`] names what cannot be used: lengths, non-finite numbers, frames that do not join.
    pub fn new(problem: &Problem) -> Result<Self, Error> {
        crate::graph::check::check(problem)?;
        let mut problem = problem.clone();
        let mut walks = Vec::with_capacity(problem.measurements.len());
        for measurement in &problem.measurements {
            walks.push(walk(
                &problem,
                measurement.from,
                measurement.to,
                measurement.path.as_deref(),
                &measurement.name,
            )?);
        }

        let mut observations = Vec::new();
        let mut lost_items = Vec::new();
        for (h, measurement) in problem.measurements.iter().enumerate() {
            let rows = measurement.kind.rows();
            for (item, sample) in measurement.kind.samples().into_iter().enumerate() {
                let lost = walks[h].iter().any(|&(e, _)| {
                    matches!(&problem.edges[e.index()].kind,
                        EdgeKind::Measured { poses, .. } if poses[sample].is_none())
                });
                if lost {
                    lost_items.push((h, sample, item));
                } else {
                    observations.push(Observation {
                        sample,
                        measurement: h,
                        item,
                        rows,
                    });
                }
            }
        }
        if observations
            .iter()
            .all(|o: &Observation| problem.held_out.contains(&o.sample))
        {
            return Err(Error::NoObservations);
        }
        observations.sort_by_key(|o| (o.sample, o.measurement, o.item));
        let mut of_sample = Vec::with_capacity(problem.samples);
        let mut start = 0;
        for s in 0..problem.samples {
            let mut end = start;
            while end < observations.len() && observations[end].sample == s {
                end += 1;
            }
            of_sample.push(start..end);
            start = end;
        }

        let mut of_measurement: Vec<Vec<(usize, Range<usize>)>> =
            vec![Vec::new(); problem.measurements.len()];
        for (i, o) in observations.iter().enumerate() {
            match of_measurement[o.measurement].last_mut() {
                Some((sample, range)) if *sample == o.sample => range.end = i + 1,
                _ => of_measurement[o.measurement].push((o.sample, i..i + 1)),
            }
        }

        let unmoved = contract_unmoved(&mut problem, &walks, &of_sample);

        // Only parameters that some observation can feel, or that are free by themselves, get columns.
        let mut column_of = vec![None; problem.parameters.len()];
        let mut columns = Vec::new();
        for (p, parameter) in problem.parameters.iter().enumerate() {
            if !parameter.fixed {
                column_of[p] = Some(columns.len());
                columns.push(p);
            }
        }

        let slots = random_slots(&problem, &walks);
        let start_values = Values(problem.parameters.iter().map(|p| p.start).collect());
        let paths = walks
            .iter()
            .map(|w| CompiledPath::new(&problem, &start_values, &column_of, &slots, w))
            .collect();
        let rows = observations.iter().map(|o| o.rows).sum();
        let max_rows = of_sample
            .iter()
            .map(|r| observations[r.clone()].iter().map(|o| o.rows).sum())
            .max()
            .unwrap_or(0);
        Ok(Self {
            columns,
            column_of,
            paths,
            observations,
            of_sample,
            of_measurement,
            trig: tabulate(&problem),
            slots,
            rows,
            max_rows,
            unmoved,
            lost: lost_items,
            problem,
        })
    }

    /// The problem as it is solved (parameters of joints that never moved are held).
    #[must_use]
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// Joints that never moved: contracted, not fitted.
    #[must_use]
    pub fn unmoved(&self) -> &[EdgeId] {
        &self.unmoved
    }

    /// (measurement, sample, index within the measurement) of observations whose path has a measured edge that was
    /// lost at their sample.
    #[must_use]
    pub fn lost(&self) -> Vec<(String, usize, usize)> {
        self.lost
            .iter()
            .map(|&(h, sample, item)| (self.problem.measurements[h].name.clone(), sample, item))
            .collect()
    }

    /// Whether a sample is kept for validation.
    #[must_use]
    pub fn is_held_out(&self, sample: usize) -> bool {
        self.problem.held_out.contains(&sample)
    }

    /// The free parameters, by their place in the problem, in the order of the columns of every matrix.
    #[must_use]
    pub fn free_parameters(&self) -> &[usize] {
        &self.columns
    }

    /// Number of free parameters.
    #[must_use]
    pub fn free(&self) -> usize {
        self.columns.len()
    }

    /// Residual rows (3 per marker, 6 per pose, …).
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Start values of all parameters.
    #[must_use]
    pub fn start(&self) -> Values {
        Values(self.problem.parameters.iter().map(|p| p.start).collect())
    }

    /// Number of observations (vectors, not rows).
    #[must_use]
    pub fn observation_count(&self) -> usize {
        self.observations.len()
    }

    /// Sample, measurement name and index within the measurement of an observation.
    #[must_use]
    pub fn describe(&self, observation: usize) -> (usize, &str, usize) {
        let o = self.observations[observation];
        (
            o.sample,
            &self.problem.measurements[o.measurement].name,
            o.item,
        )
    }

    /// Current `parent_from_child` of a constant edge (known or unknown); `None` for the others.
    #[must_use]
    pub fn edge_pose(&self, edge: EdgeId, values: &Values) -> Option<Isometry3<f64>> {
        match &self.problem.edges.get(edge.index())?.kind {
            EdgeKind::Known(x) => Some(*x),
            EdgeKind::Unknown(u) => Some(u.nominal * u.chart.displacement(&coordinates(u, values))),
            _ => None,
        }
    }

    /// Current coordinates of a point in its frame, m.
    #[must_use]
    pub fn point_position(&self, point: usize, values: &Values) -> nalgebra::Point3<f64> {
        let point = &self.problem.points[point];
        match point.parameters {
            None => point.position,
            Some(ids) => nalgebra::Point3::new(
                values.0[ids[0].index()],
                values.0[ids[1].index()],
                values.0[ids[2].index()],
            ),
        }
    }

    /// Compiles the way between two frames that need not be measured.
    pub(crate) fn compile_between(
        &self,
        from: FrameId,
        to: FrameId,
        values: &Values,
    ) -> Result<CompiledPath, Error> {
        let walk = walk(&self.problem, from, to, None, "derived quantity")?;
        Ok(CompiledPath::new(
            &self.problem,
            values,
            &self.column_of,
            &self.slots,
            &walk,
        ))
    }
}

/// Chart coordinates of an unknown pose.
pub(crate) fn coordinates(u: &crate::graph::edge::UnknownPose, values: &Values) -> Vector6<f64> {
    let mut c = Vector6::zeros();
    for i in 0..6 {
        if let Some(p) = u.parameters[i] {
            c[i] = values.0[p.index()];
        }
    }
    c
}

/// The edges of a path, with the frames checked where they are joined.
fn walk(
    problem: &Problem,
    from: FrameId,
    to: FrameId,
    given: Option<&[(EdgeId, bool)]>,
    measurement: &str,
) -> Result<Vec<(EdgeId, bool)>, Error> {
    let Some(given) = given else {
        return problem.path(from, to);
    };
    let mut here = from;
    for &(id, inverse) in given {
        let edge = &problem.edges[id.index()];
        let (begin, end) = if inverse {
            (edge.child, edge.parent)
        } else {
            (edge.parent, edge.child)
        };
        if begin != here {
            return Err(Error::BrokenPath {
                measurement: measurement.to_owned(),
                edge: edge.name.clone(),
                found: problem.frame_name(begin).to_owned(),
                expected: problem.frame_name(here).to_owned(),
            });
        }
        here = end;
    }
    if here != to {
        return Err(Error::NoPath {
            from: problem.frame_name(from).to_owned(),
            to: problem.frame_name(to).to_owned(),
        });
    }
    Ok(given.to_vec())
}

/// Holds every parameter that only unmoved joints feel; returns those joints.
fn contract_unmoved(
    problem: &mut Problem,
    walks: &[Vec<(EdgeId, bool)>],
    of_sample: &[Range<usize>],
) -> Vec<EdgeId> {
    let on_path: BTreeSet<usize> = walks.iter().flatten().map(|&(e, _)| e.index()).collect();
    let used: Vec<usize> = (0..problem.samples)
        .filter(|&s| !of_sample[s].is_empty() && !problem.held_out.contains(&s))
        .collect();
    let range_of = |f: &dyn Fn(usize) -> f64| {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &s in &used {
            low = low.min(f(s));
            high = high.max(f(s));
        }
        high - low
    };
    let mut unmoved = Vec::new();
    let mut moving_parameters = BTreeSet::new();
    let mut still_parameters = BTreeSet::new();
    for &e in &on_path {
        let EdgeKind::Joint(joint) = &problem.edges[e].kind else {
            continue;
        };
        let reading = |s: usize| {
            joint.q[s]
                + joint
                    .effects
                    .iter()
                    .filter(|f| f.kind.lateral().is_none())
                    .map(|f| f.value(s) * problem.parameters[f.parameter.index()].start)
                    .sum::<f64>()
        };
        let driven = joint.effects.iter().any(|f| {
            matches!(f.kind, EffectKind::Coupling | EffectKind::Other)
                && !problem.parameters[f.parameter.index()].fixed
                && range_of(&|s| f.value(s)) > MIN_JOINT_RANGE
        });
        let own: Vec<usize> = joint.effects.iter().map(|f| f.parameter.index()).collect();
        if driven || range_of(&reading) > MIN_JOINT_RANGE {
            moving_parameters.extend(own);
        } else {
            unmoved.push(EdgeId::of(e));
            still_parameters.extend(own);
        }
    }
    for &e in &unmoved {
        let name = problem.edges[e.index()].name.clone();
        for edge in &problem.edges {
            if let EdgeKind::Unknown(u) = &edge.kind
                && u.role == crate::graph::edge::Role::JointOrigin
                && u.joint.as_deref() == Some(&name)
            {
                still_parameters.extend(u.parameters.iter().flatten().map(|p| p.index()));
            }
        }
    }
    for p in still_parameters.difference(&moving_parameters) {
        problem.parameters[*p].fixed = true;
    }
    unmoved
}

/// One slot per noisy joint, per random direction, per dimension of a measured edge's covariance.
fn random_slots(problem: &Problem, walks: &[Vec<(EdgeId, bool)>]) -> Vec<Slot> {
    let on_path: BTreeSet<usize> = walks.iter().flatten().map(|&(e, _)| e.index()).collect();
    let mut slots = Vec::new();
    for &edge in &on_path {
        let (count, group) = match &problem.edges[edge].kind {
            EdgeKind::Joint(j) => (
                usize::from(j.noise.is_some()),
                j.noise.map(crate::graph::ids::GroupId::index),
            ),
            EdgeKind::Random { directions, group } => (directions.len(), Some(group.index())),
            EdgeKind::Measured {
                covariance: Some(_),
                ..
            } => (6, None),
            _ => (0, None),
        };
        slots.extend((0..count).map(|direction| Slot {
            edge,
            direction,
            group,
        }));
    }
    slots
}

/// Directions of a measured edge's noise: columns of the Cholesky factor of its covariance.
pub(crate) fn covariance_directions(covariance: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    nalgebra::Cholesky::new(*covariance).map(|c| c.l())
}

/// Per edge: (sin q, cos q) of every sample of a revolute joint; empty for the other edges.
pub(crate) type Trig = Arc<Vec<Vec<(f64, f64)>>>;

fn tabulate(problem: &Problem) -> Trig {
    Arc::new(
        problem
            .edges
            .iter()
            .map(|e| match &e.kind {
                EdgeKind::Joint(j) if matches!(j.axis, Axis::Revolute(_)) => {
                    j.q.iter().map(|q| q.sin_cos()).collect()
                }
                _ => Vec::new(),
            })
            .collect(),
    )
}

/// Poses and right-twist columns of the unknown edges at the current values: constant over samples.
#[derive(Debug, Clone)]
pub(crate) struct EdgeCache {
    pub pose: Vec<Pose>,
    /// sin, cos of what is added to the reading, for revolute joints where that is a constant.
    pub offset: Vec<Option<(f64, f64)>>,
    /// sin, cos of the readings; empty where they are not tabulated.
    pub trig: Trig,
    /// Columns per coordinate, for the edge walked forward and backward.
    pub forward: Vec<[Vector6<f64>; 6]>,
    pub backward: Vec<[Vector6<f64>; 6]>,
}

impl EdgeCache {
    pub(crate) fn new(problem: &Problem, trig: Trig) -> Self {
        let n = problem.edges.len();
        Self {
            offset: vec![None; n],
            trig,
            pose: vec![Pose::identity(); n],
            forward: vec![[Vector6::zeros(); 6]; n],
            backward: vec![[Vector6::zeros(); 6]; n],
        }
    }

    pub(crate) fn update(&mut self, problem: &Problem, values: &Values) {
        for (e, edge) in problem.edges.iter().enumerate() {
            if let EdgeKind::Unknown(u) = &edge.kind {
                let c = coordinates(u, values);
                let x = Pose::of(&(u.nominal * u.chart.displacement(&c)));
                let d = u.chart.differential(&c);
                for i in 0..6 {
                    let column: Vector6<f64> = d.column(i).into_owned();
                    self.forward[e][i] = column;
                    // X⁻¹ moves by exp(−δ)·X⁻¹ = X⁻¹·exp(−Ad(X) δ)
                    self.backward[e][i] = -x.push_forward(&column);
                }
                self.pose[e] = x;
            }
            if let EdgeKind::Joint(j) = &edge.kind {
                let constant = matches!(j.axis, Axis::Revolute(_))
                    && j.effects
                        .iter()
                        .all(|f| f.values.is_none() && f.kind.lateral().is_none());
                self.offset[e] = constant.then(|| {
                    j.effects
                        .iter()
                        .map(|f| values.0[f.parameter.index()])
                        .sum::<f64>()
                        .sin_cos()
                });
            }
        }
    }
}
