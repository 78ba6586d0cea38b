//! The bundle's unknowns and its normal equations, (1) and (2).

use calib_estimator::{
    EstimatorError,
    levenberg::Problem,
    measured::{Cloud, longest},
};
use calib_geometry::so3;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, SMatrix, Vector2, Vector3, Vector4};

use crate::{axis_frame::AxisFrame, circles::Axis, straight};

/// Distance of the markers from their middle, across the axis and in units of the noise, from which their relative motion
/// holds the turn within the range where it is two numbers ([`crate::straight`]).
const SEEN_APART: f64 = 5.0;

/// The bundle on one rigid body.
pub(super) struct Bundle {
    /// For each frame: (marker, position).
    frames: Vec<Vec<(usize, Vector3<f64>)>>,
    /// Weight of each frame.
    weights: Vec<f64>,
    /// Encoder angle of each frame, or empty.
    angles: Vec<f64>,
    markers: usize,
    /// The frame whose angle is zero.
    pub reference: usize,
    size: f64,
}

/// The unknowns.
#[derive(Clone)]
pub(super) struct State {
    pub axis: Axis,
    pub angles: Vec<f64>,
    /// Marker places in the frame of the axis, at angle zero.
    pub places: Vec<Vector3<f64>>,
}

/// One frame's share: its own curvature, its pull, its coupling to the shared unknowns.
struct FrameBlock {
    own: f64,
    gradient: f64,
    to_axis: Vector4<f64>,
    to_places: Vec<(usize, Vector3<f64>)>,
}

/// The normal equations before the angles are eliminated.
pub(super) struct Normal {
    shared: DMatrix<f64>,
    gradient: DVector<f64>,
    frames: Vec<FrameBlock>,
    pub cost: f64,
}

impl Bundle {
    pub fn of(cloud: &Cloud, angles: &[f64], size: f64) -> Result<Self, EstimatorError> {
        let rows = cloud.labels.iter().map(|l| l.1 + 1).max().unwrap_or(0);
        if !angles.is_empty() && angles.len() < rows {
            return Err(EstimatorError::Data(
                calib_estimator::measured::DataError::Lengths {
                    what: "joint angles and frames",
                    left: angles.len(),
                    right: rows,
                },
            ));
        }
        let (mut kept, mut weights, mut kept_angles) = (Vec::new(), Vec::new(), Vec::new());
        for row in cloud.rows() {
            kept.push(row.markers);
            weights.push(row.weight);
            kept_angles.extend(angles.get(row.row));
        }
        Ok(Self::new(kept, weights, kept_angles, cloud.markers(), size))
    }

    pub fn new(
        frames: Vec<Vec<(usize, Vector3<f64>)>>,
        weights: Vec<f64>,
        angles: Vec<f64>,
        markers: usize,
        size: f64,
    ) -> Self {
        Self {
            reference: longest(&frames),
            frames,
            weights,
            angles,
            markers,
            size,
        }
    }

    pub fn degrees_of_freedom(&self) -> usize {
        let samples: usize = self.frames.iter().map(Vec::len).sum();
        let turns = if self.angles.is_empty() {
            self.frames.len() - 1
        } else {
            0
        };
        (3 * samples).saturating_sub(4 + 3 * self.markers + turns)
    }

    /// Angles and places around a first axis: chained from the reference frame over shared markers.
    pub fn start(&self, axis: Axis) -> Option<State> {
        let m = axis.frame.matrix();
        let local = |v: &Vector3<f64>| m.tr_mul(&(v - axis.point));
        if !self.angles.is_empty() {
            return self.start_by_encoder(axis);
        }
        let mut places: Vec<Option<Vector3<f64>>> = vec![None; self.markers];
        for (p, v) in &self.frames[self.reference] {
            places[*p] = Some(local(v));
        }
        let mut angles = vec![None; self.frames.len()];
        angles[self.reference] = Some(0.0);
        loop {
            let mut placed = false;
            for (frame, angle) in self.frames.iter().zip(&mut angles) {
                if angle.is_some() {
                    continue;
                }
                // Turn that carries the known places to where they are seen: Σ r² exp(i(φ − φ₀)).
                let (mut sin, mut cos, mut known) = (0.0, 0.0, false);
                for (p, v) in frame {
                    if let Some(b) = places[*p] {
                        let y = local(v);
                        sin += b.x * y.y - b.y * y.x;
                        cos += b.x * y.x + b.y * y.y;
                        known = true;
                    }
                }
                if !known {
                    continue;
                }
                let turn: f64 = sin.atan2(cos);
                *angle = Some(turn);
                placed = true;
                for (p, v) in frame {
                    if places[*p].is_none() {
                        places[*p] = Some(turned(-turn, &local(v)));
                    }
                }
            }
            if !placed {
                break;
            }
        }
        Some(State {
            axis,
            angles: angles.into_iter().collect::<Option<_>>()?,
            places: places.into_iter().collect::<Option<_>>()?,
        })
    }

    /// Axis in the encoder's sense, places by its angles.
    fn start_by_encoder(&self, axis: Axis) -> Option<State> {
        let m = axis.frame.matrix();
        let turns = self.frames.iter().zip(&self.angles).flat_map(|(frame, q)| {
            frame.iter().filter(|(p, _)| *p == 0).map(move |(_, v)| {
                let y = m.tr_mul(&(v - axis.point));
                (y.y.atan2(y.x), *q)
            })
        });
        let s = crate::axis_frame::sign(&axis.frame.n, None, turns.collect::<Vec<_>>().into_iter());
        if s < 0.0 {
            let f = axis.frame;
            let flipped = AxisFrame {
                e1: f.e1,
                e2: -f.e2,
                n: -f.n,
            };
            return self.known_angles(Axis {
                frame: flipped,
                point: axis.point,
            });
        }
        self.known_angles(axis)
    }

    /// Places as means of the samples turned back by the encoder.
    fn known_angles(&self, axis: Axis) -> Option<State> {
        let m = axis.frame.matrix();
        let mut sums = vec![(Vector3::zeros(), 0.0); self.markers];
        for (frame, q) in self.frames.iter().zip(&self.angles) {
            for (p, v) in frame {
                sums[*p].0 += turned(-q, &m.tr_mul(&(v - axis.point)));
                sums[*p].1 += 1.0;
            }
        }
        let places = sums
            .into_iter()
            .map(|(s, n)| s / f64::max(n, 1.0))
            .collect();
        Some(State {
            axis,
            angles: self.angles.clone(),
            places,
        })
    }

    /// What the best straight motion costs above the hinge; `None` where the markers are as one point seen along the axis.
    pub fn gain_by_turning(&self, x: &State, normal: &Normal) -> Option<f64> {
        let count = self.markers as f64;
        let middle = x.places.iter().map(Vector3::xy).sum::<Vector2<f64>>() / count;
        let spread = x.places.iter().map(|b| (b.xy() - middle).norm_squared());
        let noise = normal.cost / self.degrees_of_freedom().max(1) as f64;
        if spread.sum::<f64>() / count <= SEEN_APART * SEEN_APART * noise {
            return None;
        }
        // Straight motion has a free number for every frame: so has the hinge, encoder or not.
        let gained = |f: &FrameBlock| f.gradient * f.gradient / f.own;
        let moving = normal.frames.iter().filter(|f| f.own > 0.0);
        let hinge = normal.cost - moving.map(gained).sum::<f64>();
        Some(straight::cost(&self.frames, &self.weights, self.markers)? - hinge)
    }

    /// Information about axis and places at the modeled positions: measured ones would add their noise to every lever arm.
    pub fn information(&self, x: &State) -> Option<DMatrix<f64>> {
        let m = x.axis.frame.matrix();
        let modeled = |(frame, angle): (&Vec<(usize, Vector3<f64>)>, &f64)| {
            let place = |p: usize| x.axis.point + m * turned(*angle, &x.places[p]);
            frame.iter().map(|(p, _)| (*p, place(*p))).collect()
        };
        let frames = self.frames.iter().zip(&x.angles).map(modeled).collect();
        let at = Self {
            frames,
            weights: self.weights.clone(),
            angles: self.angles.clone(),
            ..*self
        };
        let (h, _) = at.reduced(&at.linearize(x), 0.0)?;
        Some(h)
    }

    fn angle_is_free(&self, frame: usize) -> bool {
        self.angles.is_empty() && frame != self.reference
    }

    /// Normal equations of axis and places with the angles eliminated.
    pub fn reduced(&self, normal: &Normal, damping: f64) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let mut h = normal.shared.clone();
        for k in 0..h.nrows() {
            h[(k, k)] *= 1.0 + damping;
        }
        let mut g = normal.gradient.clone();
        let mut row = DVector::zeros(h.nrows());
        for (i, frame) in normal.frames.iter().enumerate() {
            if !self.angle_is_free(i) || frame.own <= 0.0 {
                continue;
            }
            row.fill(0.0);
            row.fixed_rows_mut::<4>(0).copy_from(&frame.to_axis);
            for (p, c) in &frame.to_places {
                row.fixed_rows_mut::<3>(4 + 3 * p).copy_from(c);
            }
            let inverse = 1.0 / (frame.own * (1.0 + damping));
            // The lower triangle.
            for (k, mut column) in h.column_iter_mut().enumerate() {
                let by = inverse * row[k];
                for (entry, value) in column.as_mut_slice()[k..]
                    .iter_mut()
                    .zip(&row.as_slice()[k..])
                {
                    *entry -= by * value;
                }
            }
            g.axpy(-inverse * frame.gradient, &row, 1.0);
        }
        h.fill_upper_triangle_with_lower_triangle();
        h.iter().all(|x| x.is_finite()).then_some((h, g))
    }
}

/// Rz(angle) v.
pub(super) fn turned(angle: f64, v: &Vector3<f64>) -> Vector3<f64> {
    let (s, c) = angle.sin_cos();
    Vector3::new(c * v.x - s * v.y, s * v.x + c * v.y, v.z)
}

impl Problem for Bundle {
    type Point = State;
    type Normal = Normal;
    type Step = (DVector<f64>, Vec<f64>);

    fn linearize(&self, x: &State) -> Normal {
        let size = 4 + 3 * self.markers;
        let mut normal = Normal {
            shared: DMatrix::zeros(size, size),
            gradient: DVector::zeros(size),
            frames: Vec::with_capacity(self.frames.len()),
            cost: 0.0,
        };
        let m = x.axis.frame.matrix();
        for ((frame, angle), &w) in self.frames.iter().zip(&x.angles).zip(&self.weights) {
            let rz: Matrix3<f64> =
                Rotation3::from_axis_angle(&Vector3::z_axis(), *angle).into_inner();
            let mut block = FrameBlock {
                own: 0.0,
                gradient: 0.0,
                to_axis: Vector4::zeros(),
                to_places: Vec::with_capacity(frame.len()),
            };
            for (p, v) in frame {
                let y = m.tr_mul(&(x.axis.point - v));
                let z = rz * x.places[*p];
                let e = y + z;
                normal.cost += w * e.norm_squared();
                // n ← n + a e₁ + b e₂ is the turn (−b, a, 0) in the frame
                let cross = so3::skew(&y);
                let mut j = SMatrix::<f64, 3, 4>::zeros();
                j.set_column(0, &cross.column(1));
                j.set_column(1, &(-cross.column(0)));
                j[(0, 2)] = 1.0;
                j[(1, 3)] = 1.0;
                let spin = Vector3::new(-z.y, z.x, 0.0);
                let at = 4 + 3 * p;
                let mut corner = normal.shared.fixed_view_mut::<4, 4>(0, 0);
                corner += j.transpose() * j * w;
                let side = j.transpose() * rz * w;
                // The lower triangle.
                let mut below = normal.shared.fixed_view_mut::<3, 4>(at, 0);
                below += side.transpose();
                for k in 0..3 {
                    normal.shared[(at + k, at + k)] += w;
                }
                let mut g = normal.gradient.fixed_rows_mut::<4>(0);
                g += j.transpose() * e * w;
                let mut g = normal.gradient.fixed_rows_mut::<3>(at);
                g += rz.transpose() * e * w;
                block.own += w * spin.norm_squared();
                block.gradient += w * spin.dot(&e);
                block.to_axis += j.transpose() * spin * w;
                block.to_places.push((*p, rz.transpose() * spin * w));
            }
            normal.frames.push(block);
        }
        normal.shared.fill_upper_triangle_with_lower_triangle();
        normal
    }

    fn cost(&self, normal: &Normal) -> f64 {
        normal.cost
    }

    fn solve(&self, normal: &Normal, damping: f64) -> Option<(Self::Step, f64)> {
        let (h, g) = self.reduced(normal, damping)?;
        let shared = -h.cholesky()?.solve(&g);
        let mut predicted = -shared.dot(&normal.gradient);
        let turns = normal
            .frames
            .iter()
            .enumerate()
            .map(|(i, frame)| {
                if !self.angle_is_free(i) || frame.own <= 0.0 {
                    return 0.0;
                }
                let mut pull = frame.gradient + frame.to_axis.dot(&shared.fixed_rows::<4>(0));
                for (p, c) in &frame.to_places {
                    pull += c.dot(&shared.fixed_rows::<3>(4 + 3 * p));
                }
                let turn = -pull / (frame.own * (1.0 + damping));
                predicted -= turn * frame.gradient;
                turn
            })
            .collect();
        Some(((shared, turns), predicted))
    }

    fn retract(&self, x: &State, (shared, turns): &Self::Step) -> State {
        let f = x.axis.frame;
        // Exact rotation of the whole frame by the small turn (−b, a, 0): the gauge about n stays put.
        let turn = so3::exp(&Vector3::new(-shared[1], shared[0], 0.0)).to_rotation_matrix();
        let next = f.matrix() * turn.matrix();
        State {
            axis: Axis {
                frame: AxisFrame {
                    e1: next.column(0).into(),
                    e2: next.column(1).into(),
                    n: next.column(2).into(),
                },
                point: x.axis.point + f.e1 * shared[2] + f.e2 * shared[3],
            },
            angles: x.angles.iter().zip(turns).map(|(a, t)| a + t).collect(),
            places: x
                .places
                .iter()
                .enumerate()
                .map(|(p, b)| b + shared.fixed_rows::<3>(4 + 3 * p))
                .collect(),
        }
    }

    fn is_negligible(&self, _: &State, (shared, turns): &Self::Step) -> bool {
        shared[0].hypot(shared[1]) <= 1e-15
            && shared.rows(2, shared.len() - 2).amax() <= 1e-15 * self.size
            && turns.iter().all(|t| t.abs() <= 1e-15)
    }
}
