//! The rows of a body's markers, turned so that six of them say all that the markers say of its twist ξ.
//!
//! ```text
//! e_m = Rᵀ(R p_m + t − y_m),   A = [s_m (−[p_m]ₓ, I)]_m (3M × 6),   s_m = √(w_m/θ),   A = Q U,  QᵀQ = I
//! Qᵀ rows (six):        U ξ + Qᵀ B dp + Qᵀ s e,   B = diag(s_m) on the unknown coordinates               (1)
//! (I − Q Qᵀ) rows:      (I − Q Qᵀ)(B dp + s e):   no twist, hence no joint noise: V is the unit matrix   (2)
//! ```
//!
//! Noise that is the same in all directions does not mind being turned. Q depends on which markers were seen, where they
//! are on the body and how they count: it is kept while those stay.

use nalgebra::{DMatrix, Matrix3, Vector3, Vector6};

use crate::graph::measurement::Markers;
use crate::model::layout::Model;
use crate::model::parts::Part;
use crate::model::pose::Pose;
use crate::model::values::Values;
use crate::solve::six_rows::upper_product;

/// Six rows of a sample that stand for the markers of a body.
#[derive(Debug, Clone)]
pub(crate) struct TurnedBlock {
    pub measurement: usize,
    /// The noise group of all of them.
    pub group: usize,
    pub first: usize,
    /// Axes of the body in those of the measurement.
    pub r: Matrix3<f64>,
}

/// An unknown coordinate of a marker: column c of B, a column of the part, is `scale` in one row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Own {
    pub column: usize,
    row: usize,
    scale: f64,
}

/// Equation (2) of one sample.
pub(crate) struct Rest<'a> {
    pub measurement: usize,
    /// The same while Q and B are.
    pub turn: usize,
    pub group: usize,
    /// 3M − 6.
    pub rows: usize,
    /// Sum of the squared residuals.
    pub cost: f64,
    pub own: &'a [Own],
    /// Bᵀ(I − QQᵀ) s e
    pub gradient: &'a [f64],
    /// Bᵀ(I − QQᵀ)B, p × p.
    gram: &'a [f64],
    q: &'a [[f64; 6]],
}

impl Rest<'_> {
    /// (I − QQᵀ)B, 3M rows of n columns one after the other, none where no coordinate is unknown.
    pub(crate) fn jacobian(&self, n: usize) -> Vec<f64> {
        if self.own.is_empty() {
            return Vec::new();
        }
        let mut out = vec![0.0; self.q.len() * n];
        for (row, (out, q)) in out.chunks_exact_mut(n).zip(self.q).enumerate() {
            for own in self.own {
                let unit = if own.row == row { 1.0 } else { 0.0 };
                let taken: f64 = q.iter().zip(&self.q[own.row]).map(|(a, b)| a * b).sum();
                out[own.column] += own.scale * (unit - taken);
            }
        }
        out
    }

    /// Adds Bᵀ(I − QQᵀ)B to a matrix over all columns.
    pub(crate) fn add_gram(&self, h: &mut DMatrix<f64>) {
        let p = self.own.len();
        for (a, row) in self.own.iter().zip(self.gram.chunks_exact(p.max(1))) {
            for (b, x) in self.own.iter().zip(row) {
                h[(a.column, b.column)] += x;
            }
        }
    }
}

/// Q, U and what follows from them, and the residual of one sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct Turned {
    /// How often Q was found.
    turns: usize,
    /// (point, s) and place of every marker that was seen.
    seen: Vec<(usize, f64)>,
    places: Vec<Vector3<f64>>,
    /// Q, 3M rows.
    q: Vec<[f64; 6]>,
    u: [[f64; 6]; 6],
    own: Vec<Own>,
    gram: Vec<f64>,
    /// Qᵀ s e
    pub residual: [f64; 6],
    /// (I − QQᵀ) s e
    left: Vec<f64>,
    gradient: Vec<f64>,
    cost: f64,
    now: (Vec<(usize, f64)>, Vec<Vector3<f64>>),
}

impl Turned {
    /// A sample: its markers by their observations with s, at this pose of the body.
    pub(crate) fn see(
        &mut self,
        (model, part): (&Model, &Part),
        values: &Values,
        markers: &Markers,
        pose: &Pose,
        kept: impl Iterator<Item = (usize, f64)>,
    ) {
        let (seen, places) = &mut self.now;
        seen.clear();
        places.clear();
        self.left.clear();
        for (o, s) in kept {
            let marker = &markers.observations[model.observations[o].item];
            let place = model.point_position(marker.point.index(), values).coords;
            let e = (place - pose.r.tr_mul(&(marker.position.coords - pose.t))) * s;
            self.left.extend_from_slice(e.as_slice());
            seen.push((marker.point.index(), s));
            places.push(place);
        }
        if *seen != self.seen || *places != self.places {
            std::mem::swap(&mut self.seen, seen);
            std::mem::swap(&mut self.places, places);
            self.turn(model, part);
        }
        // Qᵀ s e, then what it leaves
        self.residual = [0.0; 6];
        for (e, q) in self.left.iter().zip(&self.q) {
            self.residual
                .iter_mut()
                .zip(q)
                .for_each(|(r, q)| *r += q * e);
        }
        for (e, q) in self.left.iter_mut().zip(&self.q) {
            *e -= q
                .iter()
                .zip(&self.residual)
                .map(|(q, r)| q * r)
                .sum::<f64>();
        }
        self.cost = self.left.iter().map(|e| e * e).sum();
        let along = self.own.iter().map(|own| own.scale * self.left[own.row]);
        self.gradient.clear();
        self.gradient.extend(along);
    }

    /// Q, U, B and Bᵀ(I − QQᵀ)B of the markers that are seen now.
    fn turn(&mut self, model: &Model, part: &Part) {
        let mut a = DMatrix::zeros(3 * self.seen.len(), 6);
        self.own.clear();
        for (m, (&(point, s), p)) in self.seen.iter().zip(&self.places).enumerate() {
            let arm = -p.cross_matrix() * s;
            a.fixed_view_mut::<3, 3>(3 * m, 0).copy_from(&arm);
            a.fixed_view_mut::<3, 3>(3 * m, 3).fill_diagonal(s);
            let Some(ids) = model.problem.points[point].parameters else {
                continue;
            };
            for (axis, id) in ids.iter().enumerate() {
                if let Some(column) = model.column_of[id.index()] {
                    self.own.push(Own {
                        column: part.column(column),
                        row: 3 * m + axis,
                        scale: s,
                    });
                }
            }
        }
        self.turns += 1;
        let qr = a.qr();
        let (q, u) = (qr.q(), qr.r());
        self.q.clear();
        let rows = (0..q.nrows()).map(|i| std::array::from_fn(|c| q[(i, c)]));
        self.q.extend(rows);
        self.u = std::array::from_fn(|r| std::array::from_fn(|c| u[(r, c)]));
        self.gram.clear();
        for a in &self.own {
            for b in &self.own {
                let taken: f64 = self.q[a.row]
                    .iter()
                    .zip(&self.q[b.row])
                    .map(|(a, b)| a * b)
                    .sum();
                let unit = if a.row == b.row { 1.0 } else { 0.0 };
                self.gram.push(a.scale * b.scale * (unit - taken));
            }
        }
    }

    /// The six rows of J, n long each: U ξ in the columns of the path, Qᵀ B in those of unknown coordinates.
    pub(crate) fn write_jacobian(
        &self,
        rows: &mut [f64],
        n: usize,
        columns: &[usize],
        twists: &[Vector6<f64>],
    ) {
        self.write_twists(rows, n, columns, twists);
        for own in &self.own {
            for (r, q) in self.q[own.row].iter().enumerate() {
                rows[r * n + own.column] += q * own.scale;
            }
        }
    }

    /// U ξ in these columns of six rows, n long each, and nothing else.
    pub(crate) fn write_twists(
        &self,
        rows: &mut [f64],
        n: usize,
        columns: &[usize],
        twists: &[Vector6<f64>],
    ) {
        rows.fill(0.0);
        let places = columns.iter().copied().zip(twists);
        upper_product(&self.u, places, n, rows);
    }

    /// Equation (2) of the sample that was seen last.
    pub(crate) fn rest(&self, measurement: usize, group: usize) -> Rest<'_> {
        Rest {
            measurement,
            turn: self.turns,
            group,
            rows: self.left.len() - 6,
            cost: self.cost,
            own: &self.own,
            gradient: &self.gradient,
            gram: &self.gram,
            q: &self.q,
        }
    }

    /// Appends R Q X of a matrix X of six rows and k columns: three rows of every marker, in axes of the measurement.
    pub(crate) fn append_unturned(
        &self,
        r: &Matrix3<f64>,
        six: &[f64],
        k: usize,
        out: &mut Vec<f64>,
    ) {
        for q in self.q.chunks_exact(3) {
            // three rows of R Q
            let turned: [[f64; 6]; 3] = std::array::from_fn(|i| {
                std::array::from_fn(|c| {
                    r[(i, 0)] * q[0][c] + r[(i, 1)] * q[1][c] + r[(i, 2)] * q[2][c]
                })
            });
            for row in &turned {
                for c in 0..k {
                    out.push(
                        row.iter()
                            .enumerate()
                            .map(|(j, x)| x * six[j * k + c])
                            .sum(),
                    );
                }
            }
        }
    }
}
