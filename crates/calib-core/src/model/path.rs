//! A path through the graph, compiled: `T(s; x)` and its right Jacobian, from the end to the start.
//!
//! With suffix `P` behind an edge, the path's pose moves by
//!
//! ```text
//! edge X·exp(δ) :   Ad(P⁻¹) δ                  edge X⁻¹, X·exp(δ) :  −Ad(P⁻¹) Ad(X) δ       (1)
//! ```
//!
//! A parameter that occurs several times contributes several times: columns add.

use nalgebra::{Matrix3, Vector3, Vector6};

use calib_geometry::so3;

use crate::graph::edge::{Axis, EdgeKind, Joint};
use crate::graph::ids::EdgeId;
use crate::graph::problem::Problem;
use crate::model::layout::{EdgeCache, Slot, Values, coordinates, covariance_directions};
use crate::model::pose::Pose;

#[derive(Debug, Clone)]
pub(crate) struct CompiledPath {
    pub steps: Vec<Step>,
    /// Local column → global column.
    pub columns: Vec<usize>,
    /// Local random effect → global slot.
    pub slots: Vec<usize>,
}

#[derive(Debug, Clone)]
pub(crate) enum Step {
    /// Product of neighbouring constant edges.
    Constant(Pose),
    /// (chart coordinate, local column) of the free directions.
    Unknown {
        edge: usize,
        inverse: bool,
        columns: Vec<(usize, usize)>,
    },
    /// (effect, local column) of the free effects; local slot of the joint's noise.
    Joint {
        edge: usize,
        inverse: bool,
        columns: Vec<(usize, usize)>,
        slot: Option<usize>,
    },
    /// Pose per sample; directions of its noise.
    Measured {
        edge: usize,
        inverse: bool,
        noise: Vec<(Vector6<f64>, usize)>,
    },
    /// Identity with noise.
    Random {
        inverse: bool,
        noise: Vec<(Vector6<f64>, usize)>,
    },
}

/// Where a path writes its derivatives.
#[derive(Debug, Clone, Default)]
pub(crate) struct PathBuffer {
    /// ∂ξ/∂(local column), body twist of the path's end.
    pub columns: Vec<Vector6<f64>>,
    /// ∂ξ/∂(local random effect).
    pub slots: Vec<Vector6<f64>>,
}

/// What to differentiate by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Derivatives {
    None,
    Random,
    All,
}

impl CompiledPath {
    pub(crate) fn new(
        problem: &Problem,
        values: &Values,
        column_of: &[Option<usize>],
        slots: &[Slot],
        walk: &[(EdgeId, bool)],
    ) -> Self {
        let mut path = Self {
            steps: Vec::new(),
            columns: Vec::new(),
            slots: Vec::new(),
        };
        let local = |list: &mut Vec<usize>, global: usize| {
            list.iter().position(|&g| g == global).unwrap_or_else(|| {
                list.push(global);
                list.len() - 1
            })
        };
        for &(id, inverse) in walk {
            let e = id.index();
            let noise_of = |directions: &[Vector6<f64>], own: &mut Vec<usize>| {
                directions
                    .iter()
                    .enumerate()
                    .filter_map(|(d, twist)| {
                        let slot = slots.iter().position(|s| s.edge == e && s.direction == d)?;
                        Some((*twist, local(own, slot)))
                    })
                    .collect::<Vec<_>>()
            };
            let step = match &problem.edges[e].kind {
                EdgeKind::Known(x) => Step::Constant(oriented(Pose::of(x), inverse)),
                EdgeKind::Unknown(u) => {
                    let columns: Vec<(usize, usize)> = (0..6)
                        .filter_map(|i| {
                            let column = column_of[u.parameters[i]?.index()]?;
                            Some((i, local(&mut path.columns, column)))
                        })
                        .collect();
                    if columns.is_empty() {
                        let x = u.nominal * u.chart.displacement(&coordinates(u, values));
                        Step::Constant(oriented(Pose::of(&x), inverse))
                    } else {
                        Step::Unknown {
                            edge: e,
                            inverse,
                            columns,
                        }
                    }
                }
                EdgeKind::Joint(j) => Step::Joint {
                    edge: e,
                    inverse,
                    columns: j
                        .effects
                        .iter()
                        .enumerate()
                        .filter_map(|(f, effect)| {
                            let column = column_of[effect.parameter.index()]?;
                            Some((f, local(&mut path.columns, column)))
                        })
                        .collect(),
                    slot: slots
                        .iter()
                        .position(|s| s.edge == e)
                        .map(|s| local(&mut path.slots, s)),
                },
                EdgeKind::Measured { covariance, .. } => {
                    let directions: Vec<Vector6<f64>> = covariance
                        .as_ref()
                        .and_then(covariance_directions)
                        .map(|l| l.column_iter().map(nalgebra::Matrix::into_owned).collect())
                        .unwrap_or_default();
                    Step::Measured {
                        edge: e,
                        inverse,
                        noise: noise_of(&directions, &mut path.slots),
                    }
                }
                EdgeKind::Random { directions, .. } => Step::Random {
                    inverse,
                    noise: noise_of(directions, &mut path.slots),
                },
            };
            match (path.steps.last_mut(), step) {
                (Some(Step::Constant(before)), Step::Constant(next)) => {
                    *before = before.then(&next)
                }
                (_, step) => path.steps.push(step),
            }
        }
        path
    }

    pub(crate) fn buffer(&self) -> PathBuffer {
        PathBuffer {
            columns: vec![Vector6::zeros(); self.columns.len()],
            slots: vec![Vector6::zeros(); self.slots.len()],
        }
    }

    /// `T(s; x)`; derivatives go into `out`. Measured edges must be present at this sample.
    pub(crate) fn evaluate(
        &self,
        problem: &Problem,
        cache: &EdgeCache,
        values: &Values,
        sample: usize,
        wanted: Derivatives,
        out: &mut PathBuffer,
    ) -> Pose {
        let all = wanted == Derivatives::All;
        let random = wanted != Derivatives::None;
        if all {
            out.columns.fill(Vector6::zeros());
        }
        if random {
            out.slots.fill(Vector6::zeros());
        }
        // P: what lies behind the step in hand.
        let mut suffix = Pose::identity();
        for step in self.steps.iter().rev() {
            match step {
                Step::Constant(x) => suffix = x.then(&suffix),
                Step::Unknown {
                    edge,
                    inverse,
                    columns,
                } => {
                    if all {
                        let twists = if *inverse {
                            &cache.backward[*edge]
                        } else {
                            &cache.forward[*edge]
                        };
                        for &(i, c) in columns {
                            // Coordinates 3 to 5 are translations, walked either way.
                            out.columns[c] += if i < 3 {
                                suffix.pull_back(&twists[i])
                            } else {
                                suffix.pull_back_translation(&twists[i])
                            };
                        }
                    }
                    suffix = oriented(cache.pose[*edge], *inverse).then(&suffix);
                }
                Step::Joint {
                    edge,
                    inverse,
                    columns,
                    slot,
                } => {
                    let EdgeKind::Joint(joint) = &problem.edges[*edge].kind else {
                        continue;
                    };
                    suffix = joint_step(
                        joint, *edge, cache, values, sample, *inverse, columns, *slot, wanted,
                        suffix, out,
                    );
                }
                Step::Measured {
                    edge,
                    inverse,
                    noise,
                } => {
                    let EdgeKind::Measured { poses, .. } = &problem.edges[*edge].kind else {
                        continue;
                    };
                    let x = poses[sample].as_ref().map_or_else(Pose::identity, Pose::of);
                    if random {
                        for (direction, s) in noise {
                            let twist = if *inverse {
                                -x.push_forward(direction)
                            } else {
                                *direction
                            };
                            out.slots[*s] += suffix.pull_back(&twist);
                        }
                    }
                    suffix = oriented(x, *inverse).then(&suffix);
                }
                Step::Random { inverse, noise } => {
                    if random {
                        let sign = if *inverse { -1.0 } else { 1.0 };
                        for (direction, s) in noise {
                            out.slots[*s] += suffix.pull_back(direction) * sign;
                        }
                    }
                }
            }
        }
        suffix
    }

    /// For every joint on the path (once per occurrence): body twists of the path's end per unit of
    /// motion along its axis and per unit of rotation about its two lateral axes, for effects that
    /// are not in the model. Returns `T(s; x)`.
    pub(crate) fn effects(
        &self,
        problem: &Problem,
        cache: &EdgeCache,
        values: &Values,
        sample: usize,
        out: &mut Vec<(usize, [Vector6<f64>; 3])>,
    ) -> Pose {
        out.clear();
        let mut suffix = Pose::identity();
        for step in self.steps.iter().rev() {
            suffix = match step {
                Step::Constant(x) => x.then(&suffix),
                Step::Unknown { edge, inverse, .. } => {
                    oriented(cache.pose[*edge], *inverse).then(&suffix)
                }
                Step::Joint { edge, inverse, .. } => {
                    let EdgeKind::Joint(joint) = &problem.edges[*edge].kind else {
                        continue;
                    };
                    let motion = Motion::of(joint, *edge, cache, values, sample);
                    out.push((
                        *edge,
                        [None, Some(0), Some(1)].map(|lateral| {
                            joint_direction(joint, &motion, *inverse, lateral, &suffix)
                        }),
                    ));
                    joint_pose(joint, &motion, *inverse).then(&suffix)
                }
                Step::Measured { edge, inverse, .. } => {
                    let EdgeKind::Measured { poses, .. } = &problem.edges[*edge].kind else {
                        continue;
                    };
                    let x = poses[sample].as_ref().map_or_else(Pose::identity, Pose::of);
                    oriented(x, *inverse).then(&suffix)
                }
                Step::Random { .. } => suffix,
            };
        }
        suffix
    }
}

/// The joint's transform at a sample, in the direction of walking.
fn joint_pose(joint: &Joint, motion: &Motion, inverse: bool) -> Pose {
    let mut x = motion.screw_motion(&joint.axis, false);
    if let Some(theta) = motion.theta {
        x.r *= so3::exp(&theta).to_rotation_matrix().matrix();
    }
    oriented(x, inverse)
}

fn oriented(x: Pose, inverse: bool) -> Pose {
    if inverse { x.inverse() } else { x }
}

/// A joint's motion at a sample: sine and cosine of φ (revolute) or φ itself (prismatic), and the
/// lateral rotation vector θ.
struct Motion {
    phi: f64,
    sin: f64,
    cos: f64,
    theta: Option<Vector3<f64>>,
}

impl Motion {
    #[inline]
    fn of(joint: &Joint, edge: usize, cache: &EdgeCache, values: &Values, sample: usize) -> Self {
        // Only a constant is added to the reading: the addition theorem saves a sine and a cosine.
        if let (Some((sin_c, cos_c)), Some(table)) = (cache.offset[edge], cache.trig.get(edge))
            && let Some(&(sin_q, cos_q)) = table.get(sample)
        {
            return Self {
                phi: 0.0,
                sin: sin_q * cos_c + cos_q * sin_c,
                cos: cos_q * cos_c - sin_q * sin_c,
                theta: None,
            };
        }
        let mut phi = joint.q[sample];
        let mut theta: Option<Vector3<f64>> = None;
        for f in &joint.effects {
            let amount = f.value(sample) * values.0[f.parameter.index()];
            match f.kind.lateral() {
                None => phi += amount,
                Some(k) => {
                    *theta.get_or_insert_with(Vector3::zeros) += joint.axis.across()[k] * amount;
                }
            }
        }
        let (sin, cos) = match joint.axis {
            Axis::Revolute(_) => phi.sin_cos(),
            Axis::Prismatic(_) => (0.0, 1.0),
        };
        Self {
            phi,
            sin,
            cos,
            theta,
        }
    }

    /// exp(S φ), or exp(−S φ).
    #[inline]
    fn screw_motion(&self, axis: &Axis, inverse: bool) -> Pose {
        let sign = if inverse { -1.0 } else { 1.0 };
        match axis {
            Axis::Revolute(a) => {
                // R = cos φ I + sin φ [a]ₓ + (1 − cos φ) a aᵀ
                let (s, c) = (self.sin * sign, self.cos);
                let k = 1.0 - c;
                let (x, y, z) = (a.x, a.y, a.z);
                Pose {
                    r: Matrix3::new(
                        c + k * x * x,
                        k * x * y - s * z,
                        k * x * z + s * y,
                        k * x * y + s * z,
                        c + k * y * y,
                        k * y * z - s * x,
                        k * x * z - s * y,
                        k * y * z + s * x,
                        c + k * z * z,
                    ),
                    t: Vector3::zeros(),
                }
            }
            Axis::Prismatic(a) => Pose {
                r: Matrix3::identity(),
                t: a.into_inner() * (self.phi * sign),
            },
        }
    }
}

fn screw(axis: &Axis) -> Vector6<f64> {
    let a = axis.direction();
    match axis {
        Axis::Revolute(_) => Vector6::new(a.x, a.y, a.z, 0.0, 0.0, 0.0),
        Axis::Prismatic(_) => Vector6::new(0.0, 0.0, 0.0, a.x, a.y, a.z),
    }
}

/// One joint: `exp(Sφ)·Exp(θ)` forward, `Exp(−θ)·exp(−Sφ)` backward.
#[expect(
    clippy::too_many_arguments,
    reason = "the inner loop's whole context, called once"
)]
#[inline]
fn joint_step(
    joint: &Joint,
    edge: usize,
    cache: &EdgeCache,
    values: &Values,
    sample: usize,
    inverse: bool,
    columns: &[(usize, usize)],
    slot: Option<usize>,
    wanted: Derivatives,
    suffix: Pose,
    out: &mut PathBuffer,
) -> Pose {
    let all = wanted == Derivatives::All;
    let motion = Motion::of(joint, edge, cache, values, sample);
    let s = screw(&joint.axis);
    let swing = motion.theta.map(|theta| {
        (
            Pose {
                r: *so3::exp(&theta).to_rotation_matrix().matrix(),
                t: Vector3::zeros(),
            },
            so3::right_jacobian(&theta),
        )
    });
    let along = |suffix: &Pose, out: &mut PathBuffer, sign: f64| {
        if wanted == Derivatives::None {
            return;
        }
        // S commutes with exp(Sφ): the same twist on either side of it.
        let column = suffix.pull_back(&s) * sign;
        if all {
            for &(f, c) in columns {
                let effect = &joint.effects[f];
                if effect.kind.lateral().is_none() {
                    out.columns[c] += column * effect.value(sample);
                }
            }
        }
        if let Some(k) = slot {
            out.slots[k] += column;
        }
    };
    let across = |suffix: &Pose, out: &mut PathBuffer, map: &Matrix3<f64>, sign: f64| {
        if all {
            for &(f, c) in columns {
                let effect = &joint.effects[f];
                if let Some(k) = effect.kind.lateral() {
                    let w = map * joint.axis.across()[k] * (sign * effect.value(sample));
                    out.columns[c] += suffix.pull_back(&Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0));
                }
            }
        }
    };
    if inverse {
        along(&suffix, out, -1.0);
        let suffix = motion.screw_motion(&joint.axis, true).then(&suffix);
        match swing {
            None => suffix,
            Some((r, jr)) => {
                // Exp(−θ)·P, θ ← θ + dθ: −Ad(P⁻¹) Exp(θ) Jr(θ) dθ
                across(&suffix, out, &(r.r * jr), -1.0);
                r.inverse().then(&suffix)
            }
        }
    } else {
        let suffix = match swing {
            None => suffix,
            Some((r, jr)) => {
                across(&suffix, out, &jr, 1.0);
                r.then(&suffix)
            }
        };
        along(&suffix, out, 1.0);
        motion.screw_motion(&joint.axis, false).then(&suffix)
    }
}

/// Body twist at the path's end per unit of φ (or of a lateral angle) of one joint.
fn joint_direction(
    joint: &Joint,
    motion: &Motion,
    inverse: bool,
    lateral: Option<usize>,
    suffix: &Pose,
) -> Vector6<f64> {
    let theta = motion.theta.unwrap_or_else(Vector3::zeros);
    let swing = Pose {
        r: *so3::exp(&theta).to_rotation_matrix().matrix(),
        t: Vector3::zeros(),
    };
    let jr = so3::right_jacobian(&theta);
    let twist_of = |w: Vector3<f64>| Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0);
    match (inverse, lateral) {
        (false, None) => swing.then(suffix).pull_back(&screw(&joint.axis)),
        (true, None) => -suffix.pull_back(&screw(&joint.axis)),
        (false, Some(k)) => suffix.pull_back(&twist_of(jr * joint.axis.across()[k])),
        (true, Some(k)) => -motion
            .screw_motion(&joint.axis, true)
            .then(suffix)
            .pull_back(&twist_of(swing.r * jr * joint.axis.across()[k])),
    }
}
