//! What suspects and the scatter of a joint explain alone, and beside each other.

use super::{Left, SHOWN, Scatter};

/// What alone explains more than a joint's scatter alone by this much is no scatter: twice the log-likelihood ratio of 20 : 1.
const DISTINCT: f64 = 6.0;
/// What 2 ln L grows by that no chance and no shape of a scatter makes.
const OVERWHELMING: f64 = 100.0;

/// −2 ln L without a suspect, with each, and with all.
#[derive(Clone)]
pub(super) struct Fits {
    pub without: f64,
    pub with: Vec<f64>,
    pub all: f64,
}

impl Fits {
    /// The less surprising of two, each for itself.
    pub(super) fn least(mut self, other: Self) -> Self {
        self.without = self.without.min(other.without);
        self.all = self.all.min(other.all);
        for (own, other) in self.with.iter_mut().zip(&other.with) {
            *own = own.min(*other);
        }
        self
    }
}

/// Suspects beside the scatter of one joint.
pub(super) struct Compared {
    /// Where no joint scatters.
    pub alone: Fits,
    /// The least of each, over the joints that may scatter.
    pub least: Fits,
    /// The scatter that explains most.
    pub best: Option<Scatter>,
}

impl Compared {
    /// Whether the scatter explains as much as what gains `by` alone.
    pub(super) fn explains(&self, by: f64) -> bool {
        self.best
            .is_some_and(|best| best.score + SHOWN + DISTINCT >= by)
    }

    /// Whether the suspects explain so much beside the scatter that they are no trace of it: half of what the scatter explains beside them, and more than
    /// any chance. Late readings of a motion are this: what they leave, the scatter of one joint takes up, and one draw for each row imitates them.
    pub(super) fn leaves_suspects(&self) -> bool {
        let suspects = self.least.without - self.least.all;
        let scatter = self.alone.all - self.least.all;
        suspects > OVERWHELMING && suspects > 0.5 * scatter
    }

    /// What is left of one suspect.
    pub(super) fn left(&self, k: usize) -> Left {
        let score = self.alone.without - self.alone.with[k];
        let part = (self.least.without - self.least.with[k]) / score;
        let part = match score > 0.0 && part.is_finite() {
            true => part.clamp(0.0, 1.0),
            false => 1.0,
        };
        Left { score, part }
    }
}
