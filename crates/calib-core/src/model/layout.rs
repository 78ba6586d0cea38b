//! A checked problem, laid out for the solver: columns, compiled paths, observations by sample.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::Isometry3;

use crate::graph::edge::EdgeKind;
use crate::graph::error::Error;
use crate::graph::ids::{EdgeId, FrameId, MeasurementId};
use crate::graph::measurement::{Markers, Measurement, MeasurementKind};
use crate::graph::problem::Problem;
use crate::model::cache::{Trig, tabulate};
use crate::model::parts::{Laid, Part};
use crate::model::path::CompiledPath;
use crate::model::values::{Slot, Values, coordinates};
use crate::model::walk::{contract_unmoved, random_slots, walk};

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
    /// Per measurement: whether it is of markers with the same noise in all directions.
    alike: Vec<bool>,
    pub(crate) trig: Trig,
    /// Random effects of a sample.
    pub(crate) slots: Vec<Slot>,
    /// All measurements.
    pub(crate) whole: Arc<Part>,
    /// Those that share random effects, apart from the others.
    pub(crate) parts: Vec<Arc<Part>>,
    /// Residual rows over all observations.
    pub(crate) rows: usize,
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

/// All observations whose path is known at their sample, sample after sample; and (measurement, sample, item) of those
/// whose path is not.
fn lay_out(
    problem: &Problem,
    walks: &[Vec<(EdgeId, bool)>],
) -> (Vec<Observation>, Vec<(usize, usize, usize)>) {
    let count = |m: &Measurement| m.kind.of().samples().len();
    let mut observations = Vec::with_capacity(problem.measurements.iter().map(count).sum());
    let mut lost_items = Vec::new();
    for (h, measurement) in problem.measurements.iter().enumerate() {
        let kind = measurement.kind.of();
        for (item, sample) in kind.samples().into_iter().enumerate() {
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
                    rows: kind.rows(),
                });
            }
        }
    }
    observations.sort_by_key(|o| (o.sample, o.measurement, o.item));
    (observations, lost_items)
}

/// Range of the observations of each sample.
fn of_sample(observations: &[Observation], samples: usize) -> Vec<Range<usize>> {
    let mut ranges = Vec::with_capacity(samples);
    let mut start = 0;
    for s in 0..samples {
        let mut end = start;
        while end < observations.len() && observations[end].sample == s {
            end += 1;
        }
        ranges.push(start..end);
        start = end;
    }
    ranges
}

/// Per measurement: the samples that it saw, and the range of its observations there.
fn of_measurement(
    observations: &[Observation],
    measurements: usize,
) -> Vec<Vec<(usize, Range<usize>)>> {
    let mut ranges: Vec<Vec<(usize, Range<usize>)>> = vec![Vec::new(); measurements];
    for (i, o) in observations.iter().enumerate() {
        match ranges[o.measurement].last_mut() {
            Some((sample, range)) if *sample == o.sample => range.end = i + 1,
            _ => ranges[o.measurement].push((o.sample, i..i + 1)),
        }
    }
    ranges
}

/// Whether these are markers that were all seen with the same noise, in all directions.
fn is_alike(measurement: &Measurement) -> bool {
    match &measurement.kind {
        MeasurementKind::Markers(markers) => {
            markers.own.is_empty()
                && markers.sight.is_none()
                && markers.observations.iter().all(|o| o.shape.is_none())
        }
        _ => false,
    }
}

impl Model {
    /// Checks a problem and lays it out.
    ///
    /// # Errors
    /// [`Error`] names what cannot be used: lengths, non-finite numbers, frames that do not join.
    pub fn new(problem: &Problem) -> Result<Self, Error> {
        crate::graph::check::check(problem)?;
        let mut problem = problem.clone();
        let mut walks = Vec::with_capacity(problem.measurements.len());
        for measurement in problem.measurements.iter() {
            walks.push(walk(
                &problem,
                measurement.from,
                measurement.to,
                measurement.path.as_deref(),
                &measurement.name,
            )?);
        }

        let (observations, lost_items) = lay_out(&problem, &walks);
        if observations
            .iter()
            .all(|o| problem.held_out.contains(&o.sample))
        {
            return Err(Error::NoObservations);
        }
        let of_sample = of_sample(&observations, problem.samples);
        let of_measurement = of_measurement(&observations, problem.measurements.len());
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
        let paths: Vec<CompiledPath> = walks
            .iter()
            .map(|w| CompiledPath::new(&problem, &start_values, &column_of, &slots, w))
            .collect();
        let laid = Laid {
            problem: &problem,
            column_of: &column_of,
            paths: &paths,
            of_measurement: &of_measurement,
            sizes: (columns.len(), slots.len()),
        };
        let whole = Arc::new(laid.whole());
        let parts = laid.parts().into_iter().map(Arc::new).collect();
        let rows = observations.iter().map(|o| o.rows).sum();
        Ok(Self {
            columns,
            column_of,
            paths,
            observations,
            of_sample,
            of_measurement,
            alike: problem.measurements.iter().map(is_alike).collect(),
            trig: tabulate(&problem),
            slots,
            whole,
            parts,
            rows,
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

    /// The markers of a measurement, where the noise of all is the same, in all directions.
    pub(crate) fn alike_markers(&self, measurement: usize) -> Option<&Markers> {
        match &self.problem.measurements[measurement].kind {
            MeasurementKind::Markers(markers) if self.alike[measurement] => Some(markers),
            _ => None,
        }
    }

    /// Joints that never moved: contracted, not fitted.
    #[must_use]
    pub fn unmoved(&self) -> &[EdgeId] {
        &self.unmoved
    }

    /// (measurement, sample, index within the measurement) of observations whose path has a measured edge that was
    /// lost at their sample.
    #[must_use]
    pub fn lost(&self) -> Vec<(MeasurementId, usize, usize)> {
        self.lost
            .iter()
            .map(|&(m, sample, item)| (MeasurementId::of(m), sample, item))
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
