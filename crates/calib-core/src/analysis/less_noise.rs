//! A fit seen under less noise from pose to pose than was found.
//!
//! Where poses are few, an effect or a change that the model does not have is taken for noise of joints or bodies: it is as large as the
//! noise that it makes. What asks for it chooses the level again with each effect, among shares of the one that was found:
//!
//! ```text
//! 2 ln L_g(Δ) = −ν ln(F_g − Δ) − Σ_s ln|V_gs| − ln|H_g|                                             (1)
//! T = max_g 2 ln L_g(Δ_g) − max_g 2 ln L_g(0)                                                        (2)
//! ```
//!
//! ν rows and priors less parameters, F_g, V_gs and H_g cost, covariances and information at level g, Δ_g what the effect takes of the cost.

use crate::analysis::solution::Solution;
use crate::graph::edge::EdgeKind;

/// Poses from which the noise is known well enough beside an effect.
pub(crate) const MANY: usize = 24;
/// Shares of the σ found that are tried: beside noise of a thirtieth the tracker's own decides.
const SHARES: [f64; 3] = [0.3, 0.1, 0.03];

/// F_g, and Σ ln|V| + ln|H|, of one level.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Level {
    pub cost: f64,
    pub log_det: f64,
}

/// T of equation (2) at one of the levels, which takes `gain` of its cost.
pub(crate) fn profiled(freedom: f64, levels: &[Level], level: usize, gain: f64) -> f64 {
    /// Exact data have no noise to compare with.
    const LEFT: f64 = 1e-12;
    let of = |level: &Level, gain: f64| {
        let left = (level.cost - gain).max(level.cost * LEFT);
        freedom * left.max(f64::MIN_POSITIVE).ln() + level.log_det
    };
    let without = levels.iter().map(|level| of(level, 0.0));
    (without.fold(f64::INFINITY, f64::min) - of(&levels[level], gain)).max(0.0)
}

impl Solution {
    /// The same solution with less noise from pose to pose, level by level; none with many samples, or where nothing is random.
    pub(crate) fn with_less_noise(&self, samples: usize) -> Vec<Self> {
        if samples >= MANY {
            return Vec::new();
        }
        let shares = SHARES.iter();
        shares
            .filter_map(|share| self.with_pose_noise_times(*share))
            .collect()
    }

    /// The same solution with this share of the noise from pose to pose; `None` where nothing is random.
    pub(crate) fn with_pose_noise_times(&self, share: f64) -> Option<Self> {
        let edges = self.model.problem.edges.iter();
        let mut groups: Vec<usize> = edges
            .filter_map(|edge| match &edge.kind {
                EdgeKind::Joint(joint) => Some(joint.noise?.index()),
                EdgeKind::Random { group, .. } => Some(group.index()),
                _ => None,
            })
            .collect();
        groups.sort_unstable();
        groups.dedup();
        let mut out = (!groups.is_empty()).then(|| self.clone())?;
        for group in groups {
            out.theta[group] *= share * share;
        }
        Some(out)
    }
}
