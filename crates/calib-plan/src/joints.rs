//! The joint box: what moves, how far, how fast; postures that fill it.

use calib_profile::PlanSpec;
use calib_urdf::range::{narrowed, range, resting_positions};
use calib_urdf::{JointId, JointKind, LinkId, RobotModel};

/// A joint that planned postures move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moved {
    /// The joint.
    pub joint: JointId,
    /// Least position, rad or m.
    pub low: f64,
    /// Largest position, rad or m.
    pub high: f64,
    /// Speed, rad/s or m/s: the URDF's, or 1 rad/s and 0.25 m/s.
    pub speed: f64,
    /// Whether it turns.
    pub turns: bool,
}

/// What planned postures move.
#[derive(Debug, Clone, PartialEq)]
pub struct JointBox {
    /// Moved joints, in the order of the URDF.
    pub moved: Vec<Moved>,
    /// Positions of all others, by joint index.
    pub base: Vec<f64>,
    /// Joints that carry a body and whose limits leave no range: they stand there.
    pub fixed: Vec<JointId>,
    /// Joints whose stated range is wider than the limits of a joint that follows them allow.
    pub narrowed: Vec<JointId>,
}

/// Planned positions are whole hundredths of a degree and hundredths of a millimeter: a list that a person can type.
const STEP_RAD: f64 = std::f64::consts::PI / 18000.0;
/// As [`STEP_RAD`], m.
const STEP_M: f64 = 1e-5;

impl JointBox {
    /// Of the joints that move a body: the profile's ranges, else the URDF's limits, else ±180°, within the limits of the joints that follow
    /// them. Joints of `still` stand at the position given there unless the profile gives a range, others as near to 0 as their limits allow.
    /// `Err`: a joint that slides without limits.
    ///
    /// # Errors
    /// The joint that has no range.
    pub fn new(
        model: &RobotModel,
        spec: &PlanSpec,
        used: &[JointId],
        still: &[(JointId, f64)],
    ) -> Result<Self, JointId> {
        let mut base = resting_positions(model);
        for (joint, value) in still {
            base[joint.index()] = *value;
        }
        for (joint, value) in &spec.hold {
            base[joint.index()] = *value;
        }
        let (mut moved, mut fixed, mut by_followers) = (Vec::new(), Vec::new(), Vec::new());
        for id in model.independent_joints() {
            let joint = model.joint(id);
            let stated = spec.joints.get(&id).copied();
            let stands = spec.hold.contains_key(&id) || still.iter().any(|s| s.0 == id);
            if stated.is_none() && (stands || !used.contains(&id)) {
                continue;
            }
            let turns = joint.kind.turns();
            let turn = turns.then_some((-std::f64::consts::PI, std::f64::consts::PI));
            let allowed = match stated {
                Some(_) => narrowed(model, id, stated),
                None => range(model, id),
            };
            if stated.is_some() && allowed != stated {
                by_followers.push(id);
            }
            let (low, high) = allowed.or(turn).ok_or(id)?;
            if high <= low {
                base[id.index()] = low;
                if stated.is_none() {
                    fixed.push(id);
                }
                continue;
            }
            let usual = if turns { 1.0 } else { 0.25 };
            let speed = joint.limits.velocity.filter(|v| *v > 0.0).unwrap_or(usual);
            moved.push(Moved {
                joint: id,
                low,
                high,
                speed,
                turns,
            });
        }
        Ok(Self {
            moved,
            base,
            fixed,
            narrowed: by_followers,
        })
    }

    /// Postures by an Owen-scrambled Sobol sequence, the same for the same seed; after 65 536 by another one of another seed.
    #[must_use]
    pub fn postures(&self, count: usize, seed: u32) -> Vec<Vec<f64>> {
        /// Postures of one sequence.
        const LENGTH: usize = 1 << 16;
        /// Between the seeds of sequences that follow each other: odd and large, so that they share nothing with seeds that people choose.
        const NEXT: u32 = 0x9e37_79b9;
        let one = |i: usize| {
            let sequence = (i / LENGTH) as u32;
            let seed = seed.wrapping_add(sequence.wrapping_mul(NEXT));
            self.posture((i % LENGTH) as u32, seed)
        };
        (0..count).map(one).collect()
    }

    fn posture(&self, i: u32, seed: u32) -> Vec<f64> {
        let mut q = self.base.clone();
        for (d, m) in self.moved.iter().enumerate() {
            let u = f64::from(sobol_burley::sample(i, d as u32, seed));
            q[m.joint.index()] = m.rounded(m.low + (m.high - m.low) * u);
        }
        q
    }

    /// Time from one posture to another, s: that of the slowest joint.
    #[must_use]
    pub fn time(&self, from: &[f64], to: &[f64]) -> f64 {
        let of = |m: &Moved| (to[m.joint.index()] - from[m.joint.index()]).abs() / m.speed;
        self.moved.iter().map(of).fold(0.0, f64::max)
    }

    /// Distance of postures where every range counts the same.
    #[must_use]
    pub fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let of = |m: &Moved| {
            let range = (m.high - m.low).max(1e-9);
            ((a[m.joint.index()] - b[m.joint.index()]) / range).powi(2)
        };
        self.moved.iter().map(of).sum::<f64>().sqrt()
    }

    /// The largest displacement of each sliding joint from 0, by joint index, m; 0 of all others.
    #[must_use]
    pub fn travel(&self, model: &RobotModel) -> Vec<f64> {
        let (mut low, mut high) = (self.base.clone(), self.base.clone());
        for m in &self.moved {
            (low[m.joint.index()], high[m.joint.index()]) = (m.low, m.high);
        }
        let of = |id: JointId| {
            let joint = model.joint(id);
            let (law, slides) = (
                &joint.law,
                matches!(joint.kind, JointKind::Prismatic { .. }),
            );
            let ends = [low[law.source.index()], high[law.source.index()]];
            let ends = ends.map(|q| (law.multiplier * q + law.offset).abs());
            if slides { ends[0].max(ends[1]) } else { 0.0 }
        };
        model.joint_ids().map(of).collect()
    }

    /// The moved joints that carry a link, themselves or by one that follows them, in the order of the URDF.
    #[must_use]
    pub fn movers(&self, model: &RobotModel, link: LinkId) -> Vec<JointId> {
        let chain = model.chain_to_root(link).into_iter();
        let laws = chain.map(|j| model.joint(j).law);
        let sources: Vec<JointId> = laws
            .filter(|law| law.multiplier != 0.0)
            .map(|law| law.source)
            .collect();
        let moved = self.moved.iter().map(|m| m.joint);
        moved.filter(|joint| sources.contains(joint)).collect()
    }

    /// A posture inside the ranges.
    #[must_use]
    pub fn holds(&self, q: &[f64]) -> bool {
        self.moved.iter().all(|m| m.holds(q[m.joint.index()]))
    }
}

impl Moved {
    /// A position inside the range, to 0.06° or 1 mm.
    #[must_use]
    pub fn holds(&self, q: f64) -> bool {
        (self.low - 1e-3..=self.high + 1e-3).contains(&q)
    }

    /// The nearest position that is written, inside the range.
    #[must_use]
    pub fn rounded(&self, q: f64) -> f64 {
        let step = if self.turns { STEP_RAD } else { STEP_M };
        let (first, last) = ((self.low / step).ceil(), (self.high / step).floor());
        if first > last {
            return self.low;
        }
        (q / step).round().clamp(first, last) * step
    }
}

/// Factor and name of the unit in which a joint is written.
pub(crate) fn shown(turns: bool) -> (f64, &'static str) {
    if turns {
        (180.0 / std::f64::consts::PI, "deg")
    } else {
        (1e3, "mm")
    }
}
