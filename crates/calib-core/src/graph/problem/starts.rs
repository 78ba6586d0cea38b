//! Where a recording does not tell from which side a joint came: the samples before its first motion.

use crate::graph::edge::EdgeKind;
use crate::graph::effect::EffectKind;
use crate::graph::error::Error;
use crate::graph::ids::EdgeId;
use crate::graph::problem::Problem;

/// Samples of one recording in which a joint still stands as it stood when the recording began. It came from one side, the same
/// in all of them; the regressors of its effects are those of a joint that came from neither.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenStart {
    /// The joint.
    pub joint: EdgeId,
    /// The samples.
    pub samples: Vec<usize>,
    /// Effects that depend on the direction.
    pub changes: Vec<StartChange>,
}

/// What the direction of a start does to one effect.
#[derive(Debug, Clone, PartialEq)]
pub struct StartChange {
    /// The effect.
    pub kind: EffectKind,
    /// What its regressor gains at each of the samples where the joint came from below, and loses where it came from above.
    pub by: Vec<f64>,
}

impl Problem {
    /// Declares samples in which the direction of approach of a joint is not known. [`Solution::start_directions`](crate::Solution::start_directions)
    /// says what the residuals tell of it, and the goodness-of-fit test tries both. What does not fit together is reported by
    /// [`Model::new`](crate::Model::new).
    pub fn open_start(&mut self, start: OpenStart) {
        let known = self.edges.get(start.joint.index());
        if !known.is_some_and(|e| matches!(e.kind, EdgeKind::Joint(_))) {
            self.wrong_edge(start.joint, "open_start", "a joint");
            return;
        }
        let fits = |change: &StartChange| change.by.len() == start.samples.len();
        let inside = start.samples.iter().all(|s| *s < self.samples);
        if !inside || !start.changes.iter().all(fits) {
            let what = format!("{}.start", self.edge_name(start.joint));
            self.faults.push(Error::NoRegressor { what });
            return;
        }
        self.starts.push(start);
    }

    /// The starts that were declared.
    #[must_use]
    pub fn open_starts(&self) -> &[OpenStart] {
        &self.starts
    }
}
