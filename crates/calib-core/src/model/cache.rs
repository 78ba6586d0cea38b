//! What is the same for many samples: poses of the unknown edges, sines and cosines of readings.

use std::sync::Arc;

use nalgebra::Vector6;

use crate::graph::axis::Axis;
use crate::graph::edge::{EdgeKind, Joint};
use crate::graph::effect::Drives;
use crate::graph::problem::Problem;
use crate::model::pose::Pose;
use crate::model::values::{Values, coordinates};
use calib_model::motion::JointMotion;

/// Where a path is evaluated: parameters' values, and what follows from them for all samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct State<'a> {
    pub problem: &'a Problem,
    pub cache: &'a EdgeCache,
    pub values: &'a Values,
}

impl<'a> State<'a> {
    pub(crate) fn new(problem: &'a Problem, cache: &'a EdgeCache, values: &'a Values) -> Self {
        Self {
            problem,
            cache,
            values,
        }
    }
}

/// Per edge: (sin q, cos q) of every sample of a revolute joint; empty for the other edges.
pub(crate) type Trig = Arc<Vec<Vec<(f64, f64)>>>;

pub(crate) fn tabulate(problem: &Problem) -> Trig {
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
    /// Motion of a joint at a sample.
    #[inline]
    pub(crate) fn motion(
        &self,
        joint: &Joint,
        edge: usize,
        values: &Values,
        sample: usize,
    ) -> JointMotion {
        // Only a constant is added to the reading: the addition theorem saves a sine and a cosine.
        if let (Some(constant), Some(table)) = (self.offset[edge], self.trig.get(edge))
            && let Some(&reading) = table.get(sample)
        {
            return JointMotion::shifted(joint.axis, reading, constant);
        }
        let amounts = joint.effects.iter().map(|f| {
            (
                f.drives,
                f.value(sample, &values.0) * values.0[f.parameter.index()],
            )
        });
        JointMotion::sum((joint.axis, &joint.reach), joint.q[sample], amounts)
    }

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
                        .all(|f| f.values.is_none() && f.drives == Drives::About);
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
