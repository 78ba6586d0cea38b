//! One sample's residuals, their Jacobian, and the covariance they should have.
//!
//! ```text
//! e_s(x) ∈ R^m,   J_s = ∂e/∂x (m × n),   G_s = ∂e/∂u (m × k)
//! V_s = blockdiag( σ_g² shape / w ) + G_s diag(σ_k²) G_sᵀ                                (1)
//! ```
//!
//! u are the sample's random effects (joint noise, wobble), w the robust weight of each vector.

use std::ops::Range;
use std::sync::Arc;

use calib_geometry::decompose;
use nalgebra::{Matrix6, Vector6};

use crate::graph::measurement::{At, Rows};
use crate::model::cache::State;
use crate::model::layout::Model;
use crate::model::parts::Part;
use crate::model::path::{Derivatives, PathBuffer};
use crate::model::pose::Pose;
use crate::model::values::Values;
use crate::solve::turned::{Rest, Turned, TurnedBlock};

/// Scratch and result of [`SampleRows::fill`]; all matrices row-major.
#[derive(Debug, Clone)]
pub(crate) struct SampleRows {
    /// Whose rows, columns and random effects these are.
    pub part: Arc<Part>,
    pub m: usize,
    pub n: usize,
    pub k: usize,
    /// m × n
    pub j: Vec<f64>,
    /// m
    pub r: Vec<f64>,
    /// m × k
    pub g: Vec<f64>,
    /// m × m, lower triangle: V_s, then (after [`SampleRows::factor`]) its Cholesky factor.
    pub v: Vec<f64>,
    /// (observation, first row, rows); observations of weight 0 are absent, those of [`SampleRows::turned`] too.
    pub blocks: Vec<(usize, usize, usize)>,
    /// Bodies whose markers are six whitened rows: none but after [`SampleRows::fill_turned`].
    pub turned: Vec<TurnedBlock>,
    /// What the turning of each measurement's markers needs.
    turns: Vec<Turned>,
    buffers: Vec<PathBuffer>,
}

/// Columns of a point's coordinates, and ∂e/∂p by rows.
type PointRows = ([Option<usize>; 3], [[f64; 3]; 6]);

impl SampleRows {
    /// Of all measurements.
    pub(crate) fn new(model: &Model) -> Self {
        Self::of(model, &model.whole)
    }

    /// Of those of a part.
    pub(crate) fn of(model: &Model, part: &Arc<Part>) -> Self {
        let (m, n, k) = (part.max_rows, part.columns.len(), part.slots.len());
        Self {
            part: Arc::clone(part),
            m: 0,
            n,
            k,
            j: vec![0.0; m * n],
            r: vec![0.0; m],
            g: vec![0.0; m * k],
            v: Vec::new(),
            blocks: Vec::with_capacity(m),
            turned: Vec::new(),
            turns: vec![Turned::default(); model.paths.len()],
            buffers: model
                .paths
                .iter()
                .map(crate::model::path::CompiledPath::buffer)
                .collect(),
        }
    }

    /// Residuals (and derivatives as wanted) of a sample at `values`.
    pub(crate) fn fill(
        &mut self,
        model: &Model,
        at: State,
        weights: &[f64],
        sample: usize,
        wanted: Derivatives,
    ) {
        self.clear();
        for (measurement, seen) in self.seen_together(model, sample) {
            self.add_measurement(model, at, weights, (measurement, seen), wanted);
        }
    }

    /// As [`SampleRows::fill`] with all derivatives, but what the markers of a body say of its twist is six whitened rows
    /// where they are alike and more than six. What the others say goes to `rest`. The blocks are still to be whitened.
    pub(crate) fn fill_turned(
        &mut self,
        model: &Model,
        at: State,
        (weights, theta): (&[f64], &[f64]),
        sample: usize,
        mut rest: impl FnMut(&Rest<'_>),
    ) {
        self.clear();
        for (measurement, seen) in self.seen_together(model, sample) {
            let kept = seen.clone().filter(|&o| weights[o] > 0.0);
            let alike = model.alike_markers(measurement);
            let Some(markers) = alike.filter(|_| 3 * kept.clone().count() > 6) else {
                self.add_measurement(model, at, weights, (measurement, seen), Derivatives::All);
                continue;
            };
            let group = markers.noise.index();
            let buffer = &mut self.buffers[measurement];
            let path = &model.paths[measurement];
            let pose = path.evaluate(at, sample, Derivatives::All, buffer);
            let kept = kept.map(|o| (o, (weights[o] / theta[group]).sqrt()));
            let turn = &mut self.turns[measurement];
            turn.see((model, &self.part), at.values, markers, &pose, kept);
            let (first, n, k) = (self.m, self.n, self.k);
            self.m += 6;
            self.r[first..first + 6].copy_from_slice(&turn.residual);
            let j = &mut self.j[first * n..(first + 6) * n];
            let columns = self.part.path_columns(measurement);
            turn.write_jacobian(j, n, columns, &buffer.columns);
            let g = &mut self.g[first * k..(first + 6) * k];
            let slots = self.part.path_slots(measurement);
            turn.write_twists(g, k, slots, &buffer.slots);
            self.turned.push(TurnedBlock {
                measurement,
                group,
                first,
                r: pose.r,
            });
            rest(&turn.rest(measurement, group));
        }
    }

    /// What each measurement of the part saw at a sample: its observations.
    fn seen_together<'m>(
        &self,
        model: &'m Model,
        sample: usize,
    ) -> impl Iterator<Item = (usize, Range<usize>)> + use<'m> {
        let part = Arc::clone(&self.part);
        seen_together(model, sample).filter(move |(measurement, _)| part.has(*measurement))
    }

    fn clear(&mut self) {
        self.m = 0;
        self.blocks.clear();
        self.turned.clear();
    }

    /// Rows of what a measurement saw at a sample.
    fn add_measurement(
        &mut self,
        model: &Model,
        at: State,
        weights: &[f64],
        (measurement, seen): (usize, Range<usize>),
        wanted: Derivatives,
    ) {
        let mut pose = None;
        for o in seen {
            if weights[o] <= 0.0 {
                continue;
            }
            let observation = model.observations[o];
            let pose = pose.get_or_insert_with(|| {
                let buffer = &mut self.buffers[measurement];
                model.paths[measurement].evaluate(at, observation.sample, wanted, buffer)
            });
            let rows = residual(model, at.values, measurement, observation.item, pose);
            let first = self.m;
            self.blocks.push((o, first, observation.rows));
            self.m += observation.rows;
            for i in 0..observation.rows {
                self.r[first + i] = rows.e[i];
            }
            if wanted == Derivatives::All {
                self.fill_jacobian(model, measurement, &rows, first);
            }
            if wanted != Derivatives::None && self.k > 0 {
                self.fill_random(measurement, &rows, first);
            }
        }
    }

    /// Appends a matrix of `k` columns with the rows of this sample, as one with the rows that [`SampleRows::fill`] makes.
    pub(crate) fn append_unturned(&self, matrix: &[f64], k: usize, out: &mut Vec<f64>) {
        let mut row = 0;
        while row < self.m {
            if let Some(block) = self.turned.iter().find(|b| b.first == row) {
                let six = &matrix[row * k..(row + 6) * k];
                self.turns[block.measurement].append_unturned(&block.r, six, k, out);
                row += 6;
            } else {
                out.extend_from_slice(&matrix[row * k..(row + 1) * k]);
                row += 1;
            }
        }
    }

    /// Rows of J from `first` on: the chain rule of the path, and the point's own coordinates.
    ///
    /// ```text
    /// ∂e/∂x = ∂e/∂ξ ∂ξ/∂x + ∂e/∂p ∂p/∂x
    /// ```
    #[inline]
    fn fill_jacobian(&mut self, model: &Model, measurement: usize, rows: &Rows, first: usize) {
        let n = self.n;
        let point = point_columns(model, rows);
        let own = self.j[first * n..self.m * n].chunks_exact_mut(n.max(1));
        for (i, out) in own.enumerate() {
            out.fill(0.0);
            let twists = &self.buffers[measurement].columns;
            for (&own, twist) in self.part.path_columns(measurement).iter().zip(twists) {
                out[own] = dot(&rows.m[i], twist);
            }
            if let Some((columns, jacobian)) = &point {
                for (c, &d) in columns.iter().zip(&jacobian[i]) {
                    if let Some(c) = c {
                        out[self.part.column(*c)] += d;
                    }
                }
            }
        }
    }

    /// Rows of G from `first` on: `∂e/∂u = ∂e/∂ξ ∂ξ/∂u`.
    #[inline]
    fn fill_random(&mut self, measurement: usize, rows: &Rows, first: usize) {
        let k = self.k;
        let own = self.g[first * k..self.m * k].chunks_exact_mut(k);
        for (i, out) in own.enumerate() {
            out.fill(0.0);
            let twists = &self.buffers[measurement].slots;
            for (&own, twist) in self.part.path_slots(measurement).iter().zip(twists) {
                out[own] = dot(&rows.m[i], twist);
            }
        }
    }

    /// V_s of equation (1) into the lower triangle of `v`. `theta`: σ² per group.
    pub(crate) fn covariance(&mut self, model: &Model, weights: &[f64], theta: &[f64]) {
        let m = self.m;
        self.v.clear();
        self.v.resize(m * m, 0.0);
        // V_s = blockdiag( σ_g² shape / w )
        for &(o, first, _) in &self.blocks {
            add_block(model, o, |i, j, group, shape| {
                self.v[(first + i) * m + first + j] += theta[group] * shape / weights[o];
            });
        }
        // V_s += Σ_k σ_k² g_k g_kᵀ
        for (s, &slot) in self.part.slots.iter().enumerate() {
            let variance = model.slots[slot].group.map_or(1.0, |g| theta[g]);
            for i in 0..m {
                let gi = self.g[i * self.k + s] * variance;
                if gi != 0.0 {
                    for j in 0..=i {
                        self.v[i * m + j] += gi * self.g[j * self.k + s];
                    }
                }
            }
        }
    }

    /// V = L Lᵀ in place; log det V, or `None` if V is not positive definite.
    pub(crate) fn factor(&mut self) -> Option<f64> {
        let m = self.m;
        let mut log_det = 0.0;
        for j in 0..m {
            for i in j..m {
                // L_jj² = V_jj − Σ L_jl²,   L_ij = (V_ij − Σ L_il L_jl) / L_jj,   log det V = 2 Σ log L_jj
                let (of_i, of_j) = (&self.v[i * m..i * m + j], &self.v[j * m..j * m + j]);
                let sum = self.v[i * m + j] - decompose::dot(of_i, of_j);
                if i == j {
                    if !(sum > 0.0 && sum.is_finite()) {
                        return None;
                    }
                    log_det += sum.ln();
                    self.v[i * m + i] = sum.sqrt();
                } else {
                    self.v[i * m + j] = sum / self.v[j * m + j];
                }
            }
        }
        Some(log_det)
    }

    /// r ← L⁻¹ r and, if asked, J ← L⁻¹ J.
    pub(crate) fn whiten(&mut self, jacobian: bool) {
        let (m, n) = (self.m, self.n);
        // Forward substitution: row_i ← (row_i − Σ_l<i L_il row_l) / L_ii
        for i in 0..m {
            let (done, rest) = self.j.split_at_mut(i * n);
            let row = &mut rest[..n];
            for l in 0..i {
                let c = self.v[i * m + l];
                if c != 0.0 {
                    self.r[i] -= c * self.r[l];
                    if jacobian {
                        for (x, y) in row.iter_mut().zip(&done[l * n..(l + 1) * n]) {
                            *x -= c * y;
                        }
                    }
                }
            }
            let d = 1.0 / self.v[i * m + i];
            self.r[i] *= d;
            if jacobian {
                row.iter_mut().for_each(|x| *x *= d);
            }
        }
    }

    /// |L⁻¹r|² after whitening.
    pub(crate) fn squared_norm(&self) -> f64 {
        self.r[..self.m].iter().map(|x| x * x).sum()
    }
}

/// What each measurement saw at a sample: its observations.
fn seen_together(model: &Model, sample: usize) -> impl Iterator<Item = (usize, Range<usize>)> {
    let range = model.of_sample[sample].clone();
    let first = range.start;
    let runs = model.observations[range].chunk_by(|a, b| a.measurement == b.measurement);
    runs.scan(first, |at, run| {
        let start = *at;
        *at += run.len();
        Some((run[0].measurement, start..*at))
    })
}

#[inline]
pub(crate) fn dot(row: &[f64; 6], twist: &Vector6<f64>) -> f64 {
    row[0] * twist[0]
        + row[1] * twist[1]
        + row[2] * twist[2]
        + row[3] * twist[3]
        + row[4] * twist[4]
        + row[5] * twist[5]
}

/// Calls `f(i, j ≤ i, group, shape_ij)` for every entry of an observation's own covariance `σ_group² shape`.
#[inline]
pub(crate) fn add_block(
    model: &Model,
    observation: usize,
    mut f: impl FnMut(usize, usize, usize, f64),
) {
    let o = model.observations[observation];
    let kind = model.problem.measurements[o.measurement].kind.of();
    kind.covariance(o.item, &mut |i, j, group, shape| {
        f(i, j, group.index(), shape);
    });
}

/// Equations (1)–(7) of the measurements at the path's pose.
#[inline]
pub(crate) fn residual(
    model: &Model,
    values: &Values,
    measurement: usize,
    item: usize,
    pose: &Pose,
) -> Rows {
    let at = At {
        r: &pose.r,
        t: &pose.t,
        point: &|p| model.point_position(p.index(), values).coords,
    };
    let kind = model.problem.measurements[measurement].kind.of();
    kind.residual(item, &at)
}

/// Columns of the coordinates of the point that an observation measures, and ∂e/∂p by rows; `None` where its place
/// is known.
pub(crate) fn point_columns(model: &Model, rows: &Rows) -> Option<PointRows> {
    let (point, jacobian) = rows.point?;
    let ids = model.problem.points[point.index()].parameters?;
    Some((ids.map(|id| model.column_of[id.index()]), jacobian))
}

/// Covariance of a measured body pose given as 6×6: kept for callers that need the dense form.
pub(crate) fn symmetric(a: &Matrix6<f64>) -> Matrix6<f64> {
    (a + a.transpose()) * 0.5
}

/// Lower Cholesky factor of the leading m × m block, in place.
pub(crate) fn cholesky6(l: &mut [[f64; 6]; 6], m: usize) -> bool {
    for i in 0..m {
        for j in 0..=i {
            // L_ij = (V_ij − Σ L_ik L_jk) / L_jj,   L_ii² = V_ii − Σ L_ik²
            let mut sum = l[i][j];
            for k in 0..j {
                sum -= l[i][k] * l[j][k];
            }
            if i == j {
                if !(sum > 0.0 && sum.is_finite()) {
                    return false;
                }
                l[i][i] = sum.sqrt();
            } else {
                l[i][j] = sum / l[j][j];
            }
        }
    }
    true
}
