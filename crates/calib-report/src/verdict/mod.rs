//! The verdict on a result: one pure function over facts.
//!
//! [`VerdictFacts`] holds what the verdict depends on and nothing else; [`judge`] applies every rule of [`RULES`] to it. A rule
//! gives no reason, or one [`Reason`] with its id, its [`Effect`] and its values. The verdict is that of the gravest
//! effect. The sentences are those of `words::verdict`; the book's page on the verdict lists every rule, and a test
//! compares the two.

mod compare;
mod facts;
mod reason;
mod rules;

pub use compare::{Improvement, Quantity as Compared};
pub use facts::{
    Agreement, BodyError, Change as ImplausibleChange, Facts as VerdictFacts, FoundNoise, Goodness,
    Orientation, Part, Predicted, Prediction, RejectedPart, Share, SingleJoint, Solver, UnseenBody,
    Untested, UntestedKind, UrdfAlone, Validation,
};
pub use reason::{Effect, Reason, ReasonId};
pub use rules::{Judgment, RULES, judge};
