//! What the data allow: rejections, what the result was verified with, how the joints moved.

use calib_finding::{Fact, catalog};

use crate::verdict::facts::{Facts, Part, RejectedPart, Share, Validation};
use crate::verdict::{Effect, Reason, ReasonId};

pub(super) fn rejected_parts(facts: &Facts) -> Vec<Reason> {
    let reason = |(part, share, subjects): &(&Part, Share, Vec<&str>)| {
        let reason = Reason::new(ReasonId::RejectedPart, Effect::Rejects)
            .with("rejected", Fact::count(share.part))
            .with("of", Fact::count(share.of));
        match part {
            Part::Recording(recording) => reason.with("recording", Fact::name(recording)),
            Part::Subject { recording, subject } => {
                let reason = reason.with("recording", Fact::name(recording));
                match subjects.as_slice() {
                    [_] => reason.with("subject", Fact::name(subject)),
                    all => reason.with("subjects", Fact::names(all.iter().copied())),
                }
            }
            Part::Range {
                joint,
                from,
                to,
                unit,
            } => reason
                .with("joint", Fact::name(joint))
                .with("from", Fact::number(*from, *unit))
                .with("to", Fact::number(*to, *unit)),
        }
    };
    together(&facts.rejected_parts).iter().map(reason).collect()
}

/// The parts, the markers and bodies of a recording as one: what happened to a body happened to each of its markers.
fn together(parts: &[RejectedPart]) -> Vec<(&Part, Share, Vec<&str>)> {
    let mut all: Vec<(&Part, Share, Vec<&str>)> = Vec::new();
    for RejectedPart { part, rejected } in parts {
        let Part::Subject { recording, subject } = part else {
            all.push((part, *rejected, Vec::new()));
            continue;
        };
        let same = |of: &&mut (&Part, Share, Vec<&str>)| matches!(of.0, Part::Subject { recording: other, .. } if other == recording);
        match all.iter_mut().find(same) {
            Some((_, share, subjects)) => {
                share.part += rejected.part;
                share.of += rejected.of;
                subjects.push(subject);
            }
            None => all.push((part, *rejected, vec![subject])),
        }
    }
    all
}

/// Validation that repeats fitted postures in this share, measured again, proves little about new ones…
pub(super) const REPEATED: f64 = 2.0 / 3.0;

/// …and below this share it does not matter.
const FEW_REPEATED: f64 = 0.05;

pub(super) fn validation(facts: &Facts) -> Vec<Reason> {
    match facts.validation {
        Validation::None => vec![Reason::new(ReasonId::NoValidation, Effect::LeavesOpen)],
        Validation::LeaveOneOut { postures } => vec![
            Reason::new(ReasonId::LeaveOneOut, Effect::Warns)
                .with("postures", Fact::count(postures)),
        ],
        Validation::Recordings { postures, repeated } => {
            let share = repeated as f64 / postures.max(1) as f64;
            let effect = match share {
                share if share >= REPEATED => Effect::LeavesOpen,
                share if share > FEW_REPEATED => Effect::Warns,
                _ => return Vec::new(),
            };
            vec![
                Reason::new(ReasonId::ValidationRepeatsFit, effect)
                    .with("repeated", Fact::count(repeated))
                    .with("postures", Fact::count(postures)),
            ]
        }
    }
}

/// Rejected or screened measurements from this share on are a warning: the robust fit is still right…
const NOTABLE: f64 = 0.05;

/// …and where the share of which they are a sample is above this one, nothing is accepted: the rest was chosen by the model that it
/// is to confirm.
pub(super) const TOO_MANY: f64 = 0.10;

/// Chance with which a share of [`TOO_MANY`] shows itself so large.
const CHANCE: f64 = 0.05;

fn share_effect(share: Share) -> Effect {
    if share.ratio() < NOTABLE {
        Effect::Supports
    } else if share.chance_of_more(TOO_MANY) < CHANCE {
        Effect::LeavesOpen
    } else {
        Effect::Warns
    }
}

pub(super) fn rejected_share(facts: &Facts) -> Vec<Reason> {
    let effect = match share_effect(facts.rejected) {
        Effect::Supports => return Vec::new(),
        // Rows of a change look unsettled: without other poses nothing tells that the right ones were excluded.
        _ if warns(facts, catalog::UNSETTLED_ROWS) && !has_recordings(facts) => Effect::LeavesOpen,
        effect => effect,
    };
    vec![
        Reason::new(ReasonId::RejectedShare, effect)
            .with("rejected", Fact::count(facts.rejected.part))
            .with("of", Fact::count(facts.rejected.of)),
    ]
}

pub(super) fn screened(facts: &Facts) -> Vec<Reason> {
    if facts.screened.part == 0 {
        return Vec::new();
    }
    vec![
        Reason::new(ReasonId::ScreenedHeldOut, share_effect(facts.screened))
            .with("screened", Fact::count(facts.screened.part))
            .with("of", Fact::count(facts.screened.of)),
    ]
}

pub(super) fn single_joint(facts: &Facts) -> Vec<Reason> {
    let single = facts.single_joint;
    let which = match (single.fitted, single.held_out) {
        (false, false) => return Vec::new(),
        (true, false) => "fitted",
        (false, true) => "held_out",
        (true, true) => "all",
    };
    // What is missing was fitted to motions of one joint; nothing tells what it does where several move. Joints that are swept one
    // after another make missing physics look like a change between two sweeps.
    let seen_together = has_recordings(facts) && !single.held_out;
    let missing = [catalog::MISSING_PHYSICS, catalog::CHANGED_WHILE_RECORDING];
    let missing = missing.into_iter().any(|id| warns(facts, id));
    let effect = if single.fitted && !seen_together && missing {
        Effect::LeavesOpen
    } else {
        Effect::Warns
    };
    vec![Reason::new(ReasonId::SingleJointData, effect).with("data", Fact::choice(which))]
}

fn has_recordings(facts: &Facts) -> bool {
    matches!(facts.validation, Validation::Recordings { .. })
}

fn warns(facts: &Facts, id: catalog::Id) -> bool {
    facts.warnings.iter().any(|warning| *warning == id.as_str())
}

pub(super) fn verified_bodies(facts: &Facts) -> Vec<Reason> {
    let of = facts.unseen_bodies.iter().map(|body| {
        let effect = match body.joints.is_empty() && !body.remounted {
            true => Effect::Warns,
            false => Effect::LeavesOpen,
        };
        let joints = (!body.joints.is_empty()).then(|| Fact::names(body.joints.clone()));
        Reason::new(ReasonId::BodyNotVerified, effect)
            .with("body", Fact::name(body.name.clone()))
            .with_some("joints", joints)
    });
    of.collect()
}

pub(super) fn verified_joints(facts: &Facts) -> Vec<Reason> {
    if facts.not_verified.is_empty() {
        return Vec::new();
    }
    vec![
        Reason::new(ReasonId::JointsNotVerified, Effect::Warns)
            .with("joints", Fact::names(facts.not_verified.clone())),
    ]
}
