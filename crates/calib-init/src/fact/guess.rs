//! Which facts a person must look at.

use super::{About, CERTAIN, TurnsHow};
use crate::labels::LOOSE;

/// How many times larger or smaller than stated the noise must be before that is one to look at.
const OTHER_NOISE: f64 = 1.5;

fn is_other_noise(stated: f64, shown: f64) -> bool {
    (stated / shown).ln().abs() > OTHER_NOISE.ln()
}

pub(super) fn is_guess(about: &About) -> bool {
    match about {
        About::Joints {
            unlimited,
            reversed,
            no_range,
            in_degrees,
            ..
        } => {
            let unusual = [unlimited, reversed, no_range, in_degrees];
            unusual.iter().any(|names| !names.is_empty())
        }
        About::LinkStated { better, .. } | About::LinkOfProfile { better, .. } => better.is_some(),
        About::NotSeen { none_is, .. } => *none_is,
        About::Unfollowed { body, .. } => body.is_some(),
        About::Agrees { not, .. } => *not > 0,
        About::StatedSigma { stated, shown } => is_other_noise(*stated, *shown),
        About::StatedBodySigma { stated, shown } => {
            is_other_noise(stated.0, shown.0) || is_other_noise(stated.1, shown.1)
        }
        About::Link {
            rms, next, same, ..
        } if !same.is_empty() || next.as_ref().is_some_and(|n| n.rms < CERTAIN * rms) => true,
        About::Rigid { sigma, .. } => sigma.is_some_and(|s| s >= LOOSE),
        About::Time { named, .. } => !named,
        About::Turns { how, .. } => *how == TurnsHow::Assumed,
        About::Ignored {
            orientation,
            joints,
            times,
            parts,
            ..
        } => {
            let unused = [orientation, joints];
            times.is_some() || parts.is_some() || unused.iter().any(|names| !names.is_empty())
        }
        About::Log { named, rows, .. } => !named || rows.is_some(),
        About::TipOfChain { .. }
        | About::LinkUnknown { .. }
        | About::TooFew { .. }
        | About::JointsByOrder { .. }
        | About::JointsMissing { .. }
        | About::JointAtItsLimit { .. }
        | About::Duplicate { .. }
        | About::LostByNumber { .. }
        | About::FarClocks { .. }
        | About::Seldom { .. }
        | About::Flat { .. }
        | About::ValidationSmallest { .. }
        | About::Corrected { .. }
        | About::NotCorrected { .. }
        | About::SignOrMirror { .. }
        | About::TooLarge { .. }
        | About::Absent { .. }
        | About::Replaced { .. }
        | About::OtherUse { .. }
        | About::NoNewBody { .. }
        | About::HeldAsElsewhere { .. }
        | About::InventedMount
        | About::MoreMarkers { .. }
        | About::Disagrees { .. }
        | About::Limits { .. }
        | About::NoLimits
        | About::Invented => true,
        // A unit by its range alone is confirmed by the registration or corrected by it.
        _ => false,
    }
}
