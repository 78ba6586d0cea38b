//! A path through the graph, compiled: `T(s; x)` and its right Jacobian, from the end to the start.
//!
//! With suffix `P` behind an edge, the path's pose moves by
//!
//! ```text
//! edge X·exp(δ) :   Ad(P⁻¹) δ                  edge X⁻¹, X·exp(δ) :  −Ad(P⁻¹) Ad(X) δ       (1)
//! ```
//!
//! A parameter that occurs several times contributes several times: columns add.

use nalgebra::Vector6;

use crate::graph::edge::{EdgeKind, Joint};
use crate::graph::effect::Drives;
use crate::graph::ids::EdgeId;
use crate::graph::problem::Problem;
use crate::model::cache::State;
use crate::model::joint::{JointDerivatives, JointPass};
use crate::model::pose::Pose;
use crate::model::values::{Slot, Values, coordinates, covariance_directions};

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
    /// Product of neighboring constant edges.
    Constant(Pose),
    /// (chart coordinate, local column) of the free directions.
    Unknown {
        edge: usize,
        inverse: bool,
        columns: Vec<(usize, usize)>,
    },
    /// (effect, local column) of the free effects; (effect, share, local column) of the shares of their regressors;
    /// local slot of the joint's noise.
    Joint {
        edge: usize,
        inverse: bool,
        columns: Vec<(usize, usize)>,
        shares: Vec<(usize, usize, usize)>,
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

/// What terms of joints can drive, in the order of [`CompiledPath::effects`].
pub(crate) const DRIVEN: [Drives; 4] = [
    Drives::About,
    Drives::Across(0),
    Drives::Across(1),
    Drives::Along,
];

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

/// Columns of an edge of unknown pose, `twists` those of its six coordinates: `∂ξ/∂δ_i = Ad(P⁻¹) twist_i`.
#[inline]
fn add_unknown(
    twists: &[Vector6<f64>; 6],
    columns: &[(usize, usize)],
    suffix: &Pose,
    out: &mut [Vector6<f64>],
) {
    for &(i, c) in columns {
        // Coordinates 3 to 5 are translations, walked either way.
        out[c] += if i < 3 {
            suffix.pull_back(&twists[i])
        } else {
            suffix.pull_back_translation(&twists[i])
        };
    }
}

/// (effect, share, local column) of the shares that are free.
fn shares_of(
    joint: &Joint,
    mut column: impl FnMut(usize) -> Option<usize>,
) -> Vec<(usize, usize, usize)> {
    let mut out = Vec::new();
    for (f, effect) in joint.effects.iter().enumerate() {
        for (i, share) in effect.shares.iter().enumerate() {
            out.extend(column(share.parameter.index()).map(|c| (f, i, c)));
        }
    }
    out
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
                EdgeKind::Known(x) => Step::Constant(Pose::of(x).oriented(inverse)),
                EdgeKind::Unknown(u) => {
                    let columns: Vec<(usize, usize)> = (0..6)
                        .filter_map(|i| {
                            let column = column_of[u.parameters[i]?.index()]?;
                            Some((i, local(&mut path.columns, column)))
                        })
                        .collect();
                    if columns.is_empty() {
                        let x = u.nominal * u.chart.displacement(&coordinates(u, values));
                        Step::Constant(Pose::of(&x).oriented(inverse))
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
                    shares: shares_of(j, |parameter| {
                        let column = column_of[parameter]?;
                        Some(local(&mut path.columns, column))
                    }),
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
        at: State,
        sample: usize,
        wanted: Derivatives,
        out: &mut PathBuffer,
    ) -> Pose {
        let State {
            problem,
            cache,
            values,
        } = at;
        let all = wanted == Derivatives::All;
        let random = wanted != Derivatives::None;
        if all {
            out.columns.fill(Vector6::zeros());
        }
        if random {
            out.slots.fill(Vector6::zeros());
        }
        // P: what lies behind the step in hand; from the end of the path to its start P ← X^±1 P.
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
                        add_unknown(twists, columns, &suffix, &mut out.columns);
                    }
                    suffix = cache.pose[*edge].oriented(*inverse).then(&suffix);
                }
                Step::Joint {
                    edge,
                    inverse,
                    columns,
                    shares,
                    slot,
                } => {
                    let EdgeKind::Joint(joint) = &problem.edges[*edge].kind else {
                        continue;
                    };
                    let pass = JointPass {
                        joint,
                        motion: cache.motion(joint, *edge, values, sample),
                        inverse: *inverse,
                        sample,
                        values,
                        columns,
                        shares,
                        slot: *slot,
                    };
                    let derivatives = random.then_some(JointDerivatives {
                        columns: all.then_some(out.columns.as_mut_slice()),
                        slots: &mut out.slots,
                    });
                    suffix = pass.then(suffix, derivatives);
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
                            // Ad(P⁻¹) δ, or −Ad(P⁻¹) Ad(X) δ
                            let twist = if *inverse {
                                -x.push_forward(direction)
                            } else {
                                *direction
                            };
                            out.slots[*s] += suffix.pull_back(&twist);
                        }
                    }
                    suffix = x.oriented(*inverse).then(&suffix);
                }
                Step::Random { inverse, noise } if random => {
                    // ±Ad(P⁻¹) δ: X is the identity
                    let sign = if *inverse { -1.0 } else { 1.0 };
                    for (direction, s) in noise {
                        out.slots[*s] += suffix.pull_back(direction) * sign;
                    }
                }
                Step::Random { .. } => {}
            }
        }
        suffix
    }

    /// For every joint on the path (once per occurrence): body twists of the path's end per unit of
    /// motion along its axis and per unit of rotation about its two lateral axes, for effects that
    /// are not in the model. Returns `T(s; x)`.
    pub(crate) fn effects(
        &self,
        at: State,
        sample: usize,
        out: &mut Vec<(usize, [Vector6<f64>; 4])>,
    ) -> Pose {
        let State {
            problem,
            cache,
            values,
        } = at;
        out.clear();
        let mut suffix = Pose::identity();
        for step in self.steps.iter().rev() {
            suffix = match step {
                Step::Constant(x) => x.then(&suffix),
                Step::Unknown { edge, inverse, .. } => {
                    cache.pose[*edge].oriented(*inverse).then(&suffix)
                }
                Step::Joint { edge, inverse, .. } => {
                    let EdgeKind::Joint(joint) = &problem.edges[*edge].kind else {
                        continue;
                    };
                    let motion = cache.motion(joint, *edge, values, sample);
                    let pass = JointPass {
                        joint,
                        motion,
                        inverse: *inverse,
                        sample,
                        values,
                        columns: &[],
                        shares: &[],
                        slot: None,
                    };
                    out.push((*edge, DRIVEN.map(|drives| pass.twist(drives, &suffix))));
                    motion.pose(*inverse).then(&suffix)
                }
                Step::Measured { edge, inverse, .. } => {
                    let EdgeKind::Measured { poses, .. } = &problem.edges[*edge].kind else {
                        continue;
                    };
                    let x = poses[sample].as_ref().map_or_else(Pose::identity, Pose::of);
                    x.oriented(*inverse).then(&suffix)
                }
                Step::Random { .. } => suffix,
            };
        }
        suffix
    }
}
