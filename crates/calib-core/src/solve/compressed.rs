//! The fast way to the normal equations where samples have no random effects: all markers of one body at
//! one pose become a 6×6 matrix and a 6-vector.
//!
//! ```text
//! G_m = [−[p_m]ₓ, I],   e_m = p_m − Rᵀ(y_m − t)   (body axes; isotropic noise does not mind)
//! W = Σ_m w_m G_mᵀG_m = Σ_m w_m [ |p|²I − ppᵀ, [p]ₓ ; −[p]ₓ, I ],   b = Σ_m w_m [ p×e ; e ]          (1)
//! H += JᵀWJ,   g += Jᵀb,   J: 6 × k body twist of the path                                         (2)
//! ```
//!
//! A marker of unknown position adds its own 3 columns: `JᵀG_mᵀ w`, `w I`, `w e`. The result equals the
//! general way to rounding (a test holds both to it).

use std::ops::Range;

use nalgebra::{Vector3, Vector6};

use crate::graph::measurement::{Markers, MeasurementKind, Rows};
use crate::model::cache::{EdgeCache, State};
use crate::model::layout::Model;
use crate::model::path::Derivatives;
use crate::model::values::Values;
use crate::solve::chunks::{chunked, is_one_chunk};
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::panel::Local;
use crate::solve::rows::{add_block, cholesky6, dot, point_columns, residual};
use crate::solve::six_rows::{Upper, upper_product};

/// Where the equations are wanted: the objective, the values, and the edges' poses at them.
struct Pass<'a> {
    objective: Objective<'a>,
    values: &'a Values,
    cache: &'a EdgeCache,
}

/// Adds the data's share of H, g and cost to `out`; the caller clears it and adds the prior.
pub(crate) fn accumulate_compressed(
    objective: Objective,
    values: &Values,
    work: &mut Workspace,
    out: &mut NormalEquations,
) -> bool {
    let model = objective.model;
    let pass = Pass {
        objective,
        values,
        cache: &work.cache,
    };
    for (measurement, seen) in model.of_measurement.iter().enumerate() {
        let columns = &model.paths[measurement].columns;
        if is_one_chunk(seen.len()) {
            let mut local = Local::new(columns.len(), 6);
            if !pass.add(measurement, seen, &mut local, out) {
                return false;
            }
            add_local(columns, &local, out);
            continue;
        }
        let of = |range: Range<usize>| {
            let mut local = Local::new(columns.len(), 6);
            let mut own = NormalEquations::new(model.free());
            let fine = pass.add(measurement, &seen[range], &mut local, &mut own);
            add_local(columns, &local, &mut own);
            fine.then_some(own)
        };
        let fine = chunked(seen.len(), of, |own| {
            out.h.iter_mut().zip(&own.h).for_each(|(sum, h)| *sum += h);
            out.g.iter_mut().zip(&own.g).for_each(|(sum, g)| *sum += g);
            out.data += own.data;
        });
        if fine.is_none() {
            return false;
        }
    }
    out.data.is_finite()
}

/// Adds the sums over the columns of a path.
fn add_local(columns: &[usize], local: &Local, out: &mut NormalEquations) {
    let n = out.n;
    for a in 0..local.k {
        out.g[columns[a]] += local.g[a];
        for b in a..local.k {
            let (i, j) = (columns[a].min(columns[b]), columns[a].max(columns[b]));
            out.h[i * n + j] += local.h[(a, b)];
        }
    }
    out.data += local.cost;
}

/// Samples that a measurement saw, with their observations.
type Seen = [(usize, Range<usize>)];

impl Pass<'_> {
    /// Adds some samples of a measurement: what concerns its path to `local`, the rest to `out`.
    fn add(
        &self,
        measurement: usize,
        seen: &Seen,
        local: &mut Local,
        out: &mut NormalEquations,
    ) -> bool {
        let fine = match self.objective.model.alike_markers(measurement) {
            Some(markers) => {
                self.markers((measurement, markers), seen, local, out);
                true
            }
            None => self.general(measurement, seen, local, out),
        };
        local.multiply();
        fine
    }

    /// Markers of isotropic noise: equations (1) and (2).
    fn markers(
        &self,
        (measurement, kind): (usize, &Markers),
        seen: &Seen,
        local: &mut Local,
        out: &mut NormalEquations,
    ) {
        let model = self.objective.model;
        let information = 1.0 / self.objective.theta[kind.noise.index()];
        let path = &model.paths[measurement];
        let at = State::new(&model.problem, self.cache, self.values);
        let positions = positions(model, self.values);
        let mut sums = Vec::new();
        let mut buffer = path.buffer();
        let mut upper = Upper::default();
        let mut now: Vec<(usize, f64)> = Vec::new();
        for (sample, range) in seen {
            let pose = path.evaluate(at, *sample, Derivatives::All, &mut buffer);
            now.clear();
            let mut moment = Vector3::zeros();
            let mut force = Vector3::zeros();
            for o in range.clone() {
                let w = self.objective.weights[o] * information;
                if w <= 0.0 {
                    continue;
                }
                let marker = &kind.observations[model.observations[o].item];
                let point = marker.point.index();
                // e = p − Rᵀ(y − t),   b = Σ w [p × e; e]
                let p = positions[point];
                let e = p - pose.r.tr_mul(&(marker.position.coords - pose.t));
                let we = e * w;
                moment += p.cross(&we);
                force += we;
                local.cost += we.dot(&e);
                now.push((point, w));
                if let Some(sum) = PointSums::of(&mut sums, model, point, local.k) {
                    sum.add(w, &we, &buffer.columns);
                }
            }
            if now.is_empty() {
                continue;
            }
            // g += Jᵀb,   H += (U J)ᵀ(U J) with UᵀU = W
            let b = Vector6::new(moment.x, moment.y, moment.z, force.x, force.y, force.z);
            for (g, j) in local.g.iter_mut().zip(&buffer.columns) {
                *g += j.dot(&b);
            }
            let factor = upper.of(&now, &positions);
            let twists = buffer.columns.iter().enumerate();
            upper_product(factor, twists, buffer.columns.len(), local.rows(6));
        }
        point_blocks(model, measurement, &positions, &sums, out);
    }
}

/// Current coordinates of all points, m.
fn positions(model: &Model, values: &Values) -> Vec<Vector3<f64>> {
    (0..model.problem.points.len())
        .map(|p| model.point_position(p, values).coords)
        .collect()
}

/// Sum of w Jᵀ over the samples, per point of a body (transposed coupling of pose and point).
struct PointSums {
    point: usize,
    columns: [Option<usize>; 3],
    /// Σ w J, 6 × k by columns.
    coupling: Vec<Vector6<f64>>,
    weight: f64,
    gradient: Vector3<f64>,
}

impl PointSums {
    /// The sums of a point, begun where it has none; `None` for a point of known place.
    #[inline]
    fn of<'s>(
        sums: &'s mut Vec<Self>,
        model: &Model,
        point: usize,
        k: usize,
    ) -> Option<&'s mut Self> {
        let ids = model.problem.points[point].parameters?;
        let i = sums
            .iter()
            .position(|s| s.point == point)
            .unwrap_or_else(|| {
                sums.push(Self {
                    point,
                    columns: ids.map(|id| model.column_of[id.index()]),
                    coupling: vec![Vector6::zeros(); k],
                    weight: 0.0,
                    gradient: Vector3::zeros(),
                });
                sums.len() - 1
            });
        Some(&mut sums[i])
    }

    /// `Σ w`, `Σ w e`, `Σ w J`.
    #[inline]
    fn add(&mut self, w: f64, we: &Vector3<f64>, twists: &[Vector6<f64>]) {
        self.weight += w;
        self.gradient += we;
        for (sum, twist) in self.coupling.iter_mut().zip(twists) {
            *sum += twist * w;
        }
    }
}

/// eᵀV⁻¹e without derivatives; infinite where it cannot be computed.
pub(crate) fn cost_compressed(objective: Objective, values: &Values, work: &mut Workspace) -> f64 {
    let model = objective.model;
    let pass = Pass {
        objective,
        values,
        cache: &work.cache,
    };
    let positions = positions(model, values);
    let mut sum = 0.0;
    for (measurement, seen) in model.of_measurement.iter().enumerate() {
        let fine = if is_one_chunk(seen.len()) {
            let more = pass.data_cost(measurement, seen, &positions, sum);
            more.map(|more| sum = more)
        } else {
            let of =
                |range: Range<usize>| pass.data_cost(measurement, &seen[range], &positions, 0.0);
            chunked(seen.len(), of, |part| sum += part)
        };
        if fine.is_none() {
            return f64::INFINITY;
        }
    }
    sum
}

impl Pass<'_> {
    /// `sum` and eᵀV⁻¹e of some samples of a measurement; `None` where it cannot be computed.
    fn data_cost(
        &self,
        measurement: usize,
        seen: &Seen,
        positions: &[Vector3<f64>],
        mut sum: f64,
    ) -> Option<f64> {
        let Objective {
            model,
            weights,
            theta,
        } = self.objective;
        let at = State::new(&model.problem, self.cache, self.values);
        let path = &model.paths[measurement];
        let markers = match &model.problem.measurements[measurement].kind {
            MeasurementKind::Markers(markers) => Some(markers),
            _ => None,
        };
        let mut buffer = path.buffer();
        for (sample, range) in seen {
            let pose = path.evaluate(at, *sample, Derivatives::None, &mut buffer);
            for o in range.clone() {
                if weights[o] <= 0.0 {
                    continue;
                }
                let item = model.observations[o].item;
                if let Some(markers) = markers
                    && markers.sight.is_none()
                    && markers.observations[item].shape.is_none()
                {
                    // e = R p + t − y,   cost = w |e|² / σ²
                    let marker = &markers.observations[item];
                    let p = positions[marker.point.index()];
                    let e = pose.r * p + pose.t - marker.position.coords;
                    let level = theta[markers.noise_of(marker.point).index()];
                    sum += weights[o] / level * e.norm_squared();
                    continue;
                }
                let e = residual(model, self.values, measurement, item, &pose).e;
                sum += self.cost(o, e)?;
            }
        }
        Some(sum)
    }
}

/// Coupling of pose and points, and the points' own blocks.
fn point_blocks(
    model: &Model,
    measurement: usize,
    positions: &[Vector3<f64>],
    sums: &[PointSums],
    out: &mut NormalEquations,
) {
    let n = out.n;
    let columns = &model.paths[measurement].columns;
    for s in sums {
        let p = positions[s.point];
        for axis in 0..3 {
            let Some(c) = s.columns[axis] else {
                continue;
            };
            out.h[c * n + c] += s.weight;
            out.g[c] += s.gradient[axis];
            for (a, j) in s.coupling.iter().enumerate() {
                // (G_m Σ w J)_axis = (ω × p + v)_axis
                let omega = Vector3::new(j[0], j[1], j[2]);
                let value = (omega.cross(&p))[axis] + j[3 + axis];
                let (i, k) = (columns[a].min(c), columns[a].max(c));
                out.h[i * n + k] += value;
            }
        }
    }
}

impl Pass<'_> {
    /// L with L Lᵀ = V of an observation; `None` where V is not positive definite.
    #[inline]
    fn lower(&self, o: usize) -> Option<[[f64; 6]; 6]> {
        let mut l = [[0.0; 6]; 6];
        // V = σ_g² shape / w
        add_block(self.objective.model, o, |i, j, group, shape| {
            l[i][j] += self.objective.theta[group] * shape / self.objective.weights[o];
        });
        cholesky6(&mut l, self.objective.model.observations[o].rows).then_some(l)
    }

    /// |L⁻¹e|² of an observation.
    #[inline]
    fn cost(&self, o: usize, mut e: [f64; 6]) -> Option<f64> {
        let l = self.lower(o)?;
        let mut sum = 0.0;
        for i in 0..self.objective.model.observations[o].rows {
            for b in 0..i {
                e[i] -= l[i][b] * e[b];
            }
            e[i] /= l[i][i];
            sum += e[i] * e[i];
        }
        Some(sum)
    }

    /// Any measurement without compression: whitened rows of each observation, over local columns.
    fn general(
        &self,
        measurement: usize,
        seen: &Seen,
        local: &mut Local,
        out: &mut NormalEquations,
    ) -> bool {
        let model = self.objective.model;
        let path = &model.paths[measurement];
        let at = State::new(&model.problem, self.cache, self.values);
        let mut buffer = path.buffer();
        for (sample, range) in seen {
            let pose = path.evaluate(at, *sample, Derivatives::All, &mut buffer);
            for o in range.clone() {
                if self.objective.weights[o] <= 0.0 {
                    continue;
                }
                let observation = model.observations[o];
                let mut rows = residual(model, self.values, measurement, observation.item, &pose);
                let Some(l) = self.lower(o) else {
                    return false;
                };
                whiten(&l, observation.rows, &mut rows);
                // cost += eᵀe,   g += Jᵀe,   rows of J = ∂e/∂ξ ∂ξ/∂x
                let Local { g, cost, .. } = local;
                for i in 0..observation.rows {
                    *cost += rows.e[i] * rows.e[i];
                    for (g, twist) in g.iter_mut().zip(&buffer.columns) {
                        *g += dot(&rows.m[i], twist) * rows.e[i];
                    }
                }
                let k = local.k;
                let own = local.rows(observation.rows);
                for i in 0..observation.rows {
                    for (c, twist) in buffer.columns.iter().enumerate() {
                        own[i * k + c] = dot(&rows.m[i], twist);
                    }
                }
                if let Some((columns, by_point)) = point_columns(model, &rows) {
                    let point = (&columns, &by_point[..observation.rows]);
                    add_point(&path.columns, own, point, &rows.e, out);
                }
            }
        }
        true
    }
}

/// e ← L⁻¹e and the same for its derivatives: row_i ← (row_i − Σ_b<i L_ib row_b) / L_ii.
#[inline]
fn whiten(l: &[[f64; 6]; 6], m: usize, rows: &mut Rows) {
    let mut nothing = [[0.0; 3]; 6];
    let point = rows.point.as_mut().map_or(&mut nothing, |(_, j)| j);
    for i in 0..m {
        for b in 0..i {
            let c = l[i][b];
            rows.e[i] -= c * rows.e[b];
            for x in 0..6 {
                rows.m[i][x] -= c * rows.m[b][x];
            }
            for x in 0..3 {
                point[i][x] -= c * point[b][x];
            }
        }
        let d = 1.0 / l[i][i];
        rows.e[i] *= d;
        rows.m[i].iter_mut().for_each(|x| *x *= d);
        point[i].iter_mut().for_each(|x| *x *= d);
    }
}

/// The share of a point's coordinates p in the equations of one observation, `own` its rows of J over the path's
/// columns.
///
/// ```text
/// g_p += ∂e/∂pᵀ e,   H_pp += ∂e/∂pᵀ ∂e/∂p,   H_pJ += ∂e/∂pᵀ J
/// ```
fn add_point(
    path: &[usize],
    own: &[f64],
    (columns, by_point): (&[Option<usize>; 3], &[[f64; 3]]),
    e: &[f64; 6],
    out: &mut NormalEquations,
) {
    let (k, n) = (path.len(), out.n);
    for (axis, c) in columns.iter().enumerate() {
        let Some(c) = *c else { continue };
        for (i, row) in by_point.iter().enumerate() {
            let d = row[axis];
            out.g[c] += d * e[i];
            for (other, c2) in columns.iter().enumerate() {
                if let Some(c2) = *c2
                    && c2 >= c
                {
                    out.h[c * n + c2] += d * row[other];
                }
            }
            for (a, &g) in path.iter().enumerate() {
                out.h[g.min(c) * n + g.max(c)] += d * own[i * k + a];
            }
        }
    }
}
