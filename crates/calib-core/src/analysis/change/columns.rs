//! The columns ∂e/∂c of every candidate at one sample.

use nalgebra::{DMatrix, Vector3, Vector6};

use super::Moved;
use crate::analysis::solution::Solution;
use crate::graph::ids::{EdgeId, FrameId};
use crate::graph::measurement::MeasurementKind;
use crate::model::cache::State;
use crate::model::path::{Derivatives, Step};
use crate::model::pose::Pose;
use crate::solve::equations::Workspace;
use crate::solve::rows::{dot, residual};
use crate::solve::whitened::Whitened;

/// How a candidate's columns enter over the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pattern {
    /// In a range of samples.
    Step,
    /// In proportion to the place of the sample, from −½ to ½.
    Linear,
    /// As what warms up: from −½ to ½, with a quarter of the samples as time constant.
    Settling,
    /// Everywhere.
    Constant,
}

/// Joints whose zeros are asked for together, at most: every range of rows costs their third power.
const MOST_ZEROS: usize = 32;

/// Time constant of [`Pattern::Settling`], in parts of all samples: half to twice as long are distinguished from a step and from an even drift.
const SETTLING: f64 = 0.25;

impl Pattern {
    /// What columns are multiplied by at a place among so many samples.
    pub(crate) fn factor(self, place: usize, samples: usize) -> f64 {
        let part = place as f64 / samples.saturating_sub(1).max(1) as f64;
        match self {
            Self::Linear => part - 0.5,
            Self::Settling => (-part / SETTLING).exp_m1() / (-1.0 / SETTLING).exp_m1() - 0.5,
            Self::Step | Self::Constant => 1.0,
        }
    }
}

pub(crate) struct Candidate {
    pub moved: Moved,
    pub pattern: Pattern,
    /// Its columns among those of all candidates; candidates of one frame share them.
    pub columns: std::ops::Range<usize>,
}

/// What is tried, and the columns that it needs.
pub(crate) struct Candidates {
    pub list: Vec<Candidate>,
    /// Count of columns.
    pub width: usize,
    /// First column by frame or joint.
    bodies: Vec<(FrameId, usize)>,
    references: Vec<(FrameId, usize)>,
    joints: Vec<(usize, usize)>,
    scales: Vec<(FrameId, usize)>,
    /// Middle of what each measuring frame sees, m.
    middles: Vec<(FrameId, Vector3<f64>)>,
    /// Middle of the markers of each body, in its frame, m; of a measured pose its origin.
    body_middles: Vec<(FrameId, Vector3<f64>)>,
}

impl Candidates {
    pub(crate) fn new(solution: &Solution) -> Self {
        let model = &solution.model;
        let mut out = Self {
            list: Vec::new(),
            width: 0,
            bodies: Vec::new(),
            references: Vec::new(),
            joints: Vec::new(),
            scales: Vec::new(),
            middles: Vec::new(),
            body_middles: Vec::new(),
        };
        for measurement in model.problem.measurements.iter() {
            if !sees_places(&measurement.kind) {
                continue;
            }
            let (from, to) = (measurement.from, measurement.to);
            if out.bodies.iter().all(|(f, _)| *f != to) {
                let first = out.add(Moved::Body(to), Pattern::Step, 6);
                out.bodies.push((to, first));
            }
            if out.references.iter().all(|(f, _)| *f != from) {
                let first = out.add(Moved::Reference(from), Pattern::Step, 6);
                let columns = first..first + 6;
                for (moved, pattern) in [
                    (Moved::Drift(from), Pattern::Linear),
                    (Moved::Settling(from), Pattern::Settling),
                ] {
                    out.list.push(Candidate {
                        moved,
                        pattern,
                        columns: columns.clone(),
                    });
                }
                out.references.push((from, first));
                let first = out.add(Moved::Scale(from), Pattern::Constant, 1);
                out.scales.push((from, first));
            }
        }
        out.add_joints(solution);
        out.find_middles(solution);
        out.find_body_middles(solution);
        out
    }

    fn add(&mut self, moved: Moved, pattern: Pattern, columns: usize) -> usize {
        let first = self.width;
        self.width += columns;
        self.list.push(Candidate {
            moved,
            pattern,
            columns: first..self.width,
        });
        first
    }

    /// Each joint, and the zeros of all of them together: the same columns.
    fn add_joints(&mut self, solution: &Solution) {
        let model = &solution.model;
        let all = self.width;
        for (measurement, path) in model.problem.measurements.iter().zip(&model.paths) {
            if !sees_places(&measurement.kind) {
                continue;
            }
            for step in &path.steps {
                if let Step::Joint { edge, .. } = step
                    && self.joints.iter().all(|(e, _)| e != edge)
                {
                    let first = self.add(Moved::Joint(EdgeId::of(*edge)), Pattern::Step, 1);
                    self.joints.push((*edge, first));
                }
            }
        }
        if (2..=MOST_ZEROS).contains(&self.joints.len()) {
            self.list.push(Candidate {
                moved: Moved::Zeros,
                pattern: Pattern::Step,
                columns: all..self.width,
            });
        }
    }

    fn find_middles(&mut self, solution: &Solution) {
        let model = &solution.model;
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &solution.values);
        let at = State::new(&model.problem, &work.cache, &solution.values);
        for &(frame, _) in &self.references {
            let (mut sum, mut count) = (Vector3::zeros(), 0.0);
            for (m, measurement) in model.problem.measurements.iter().enumerate() {
                if measurement.from != frame || !sees_places(&measurement.kind) {
                    continue;
                }
                let mut buffer = model.paths[m].buffer();
                for (sample, _) in &model.of_measurement[m] {
                    sum += model.paths[m]
                        .evaluate(at, *sample, Derivatives::None, &mut buffer)
                        .t;
                    count += 1.0;
                }
            }
            self.middles.push((frame, sum / f64::max(count, 1.0)));
        }
    }

    fn find_body_middles(&mut self, solution: &Solution) {
        let model = &solution.model;
        for &(frame, _) in &self.bodies {
            let (mut sum, mut count) = (Vector3::zeros(), 0.0);
            for (m, measurement) in model.problem.measurements.iter().enumerate() {
                let MeasurementKind::Markers(markers) = &measurement.kind else {
                    continue;
                };
                if measurement.to != frame {
                    continue;
                }
                for (_, seen) in &model.of_measurement[m] {
                    for o in seen.clone() {
                        let point = markers.observations[model.observations[o].item].point;
                        sum += model.point_position(point.index(), &solution.values).coords;
                        count += 1.0;
                    }
                }
            }
            self.body_middles.push((frame, sum / f64::max(count, 1.0)));
        }
    }

    /// What the rotations of a body are about, in its frame, m: the middle of its markers as they were seen, so that a jump of a body whose markers
    /// do not show its orientation has a size.
    pub(crate) fn body_middle(&self, frame: FrameId) -> Vector3<f64> {
        let known = self.body_middles.iter().find(|(f, _)| *f == frame);
        known.map_or_else(Vector3::zeros, |(_, middle)| *middle)
    }

    /// Middle of what a measuring frame sees, m: what its rotations are about.
    pub(crate) fn middle(&self, frame: FrameId) -> Vector3<f64> {
        let known = self.middles.iter().find(|(f, _)| *f == frame);
        known.map_or_else(Vector3::zeros, |(_, middle)| *middle)
    }

    /// The joints whose steps a candidate holds.
    pub(crate) fn joints_of(&self, candidate: usize) -> Vec<EdgeId> {
        match self.list[candidate].moved {
            Moved::Joint(edge) => vec![edge],
            Moved::Zeros => self.joint_columns().0,
            _ => Vec::new(),
        }
    }

    /// Joints, and the column of each.
    pub(crate) fn joint_columns(&self) -> (Vec<EdgeId>, Vec<usize>) {
        let joints = self.joints.iter();
        joints.map(|(edge, c)| (EdgeId::of(*edge), *c)).unzip()
    }

    /// B̃ = L⁻¹ B of one sample, all candidates side by side.
    pub(crate) fn whitened(
        &self,
        solution: &Solution,
        sample: usize,
        rows: &Whitened,
        work: &Workspace,
    ) -> DMatrix<f64> {
        let model = &solution.model;
        let state = State::new(&model.problem, &work.cache, &solution.values);
        let mut out = DMatrix::zeros(rows.w.len(), self.width);
        let mut twists = Vec::new();
        let mut measurement = usize::MAX;
        let mut pose = Pose::identity();
        for &(o, first, count) in &rows.blocks {
            let observation = model.observations[o];
            if observation.measurement != measurement {
                measurement = observation.measurement;
                pose = model.paths[measurement].effects(state, sample, &mut twists);
            }
            let jacobian = residual(
                model,
                &solution.values,
                measurement,
                observation.item,
                &pose,
            );
            let own = &model.problem.measurements[measurement];
            let place = jacobian.point.map_or_else(Vector3::zeros, |(p, _)| {
                model.point_position(p.index(), &solution.values).coords
            });
            let places = sees_places(&own.kind);
            let body = self.bodies.iter().find(|(f, _)| places && *f == own.to);
            let body_middle = self.body_middle(own.to);
            let reference = self
                .references
                .iter()
                .position(|(f, _)| places && *f == own.from);
            for i in 0..count {
                let m = &jacobian.m[i];
                let mut row = out.row_mut(first + i);
                if let Some((_, c)) = body {
                    // [ω; v] about the middle p̄ is [ω; v + p̄ × ω] at the origin.
                    let along = Vector3::new(m[3], m[4], m[5]);
                    let turned = along.cross(&body_middle);
                    for d in 0..3 {
                        row[c + d] = m[d] + turned[d];
                        row[c + 3 + d] = m[3 + d];
                    }
                }
                if let Some(r) = reference {
                    // exp(c) about the middle: ξ = Ad((P⁻¹T)⁻¹) c,  P = (1, middle)
                    let from_middle = Pose {
                        r: pose.r,
                        t: pose.t - self.middles[r].1,
                    };
                    for d in 0..6 {
                        let mut unit = Vector6::zeros();
                        unit[d] = 1.0;
                        row[self.references[r].1 + d] = dot(m, &from_middle.pull_back(&unit));
                    }
                    // Lengths read too long by κ: the point of the model moves by κ (R p + t), v = Rᵀ(R p + t).
                    let v = place + pose.r.tr_mul(&pose.t);
                    row[self.scales[r].1] = dot(m, &Vector6::new(0.0, 0.0, 0.0, v.x, v.y, v.z));
                }
                for (edge, twist) in &twists {
                    if let Some((_, c)) = self.joints.iter().find(|(e, _)| e == edge) {
                        row[*c] += dot(m, &twist[0]);
                    }
                }
            }
        }
        &rows.l_inverse * out
    }

    /// P of equation (1) for each column of a candidate, from how far things move at most.
    pub(crate) fn prior(&self, candidate: usize) -> f64 {
        /// 0.2 rad, 0.2 m: a body that moved farther is found before the fit.
        const WIDE: f64 = 0.2;
        /// 1 %: a tracker whose scale is worse is broken.
        const WIDE_SCALE: f64 = 0.01;
        let wide = match self.list[candidate].moved {
            Moved::Scale(_) => WIDE_SCALE,
            _ => WIDE,
        };
        wide.powi(-2)
    }
}

/// Whether the measurement says where a body is.
fn sees_places(kind: &MeasurementKind) -> bool {
    matches!(
        kind,
        MeasurementKind::Markers(_) | MeasurementKind::Poses(_)
    )
}
