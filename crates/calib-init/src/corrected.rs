//! What was said before mistakes were corrected, as it is after.

use crate::fact::{About, AngleHow, Fact, LengthHow, Place};
use crate::mistake::Mistake;

/// A mistake of the recordings that the profile corrects.
#[must_use]
pub fn is_correction(fact: &Fact) -> bool {
    matches!(fact.about, About::Corrected { .. })
}

/// What was said of noise before units were corrected, as it is after.
pub fn noise(facts: &mut [Fact], again: Vec<Fact>) {
    let is_noise = |about: &About| {
        matches!(
            about,
            About::MarkerSigma { .. } | About::BodySigma { .. } | About::Rigid { .. }
        )
    };
    for new in again.into_iter().filter(|new| is_noise(&new.about)) {
        let same = facts.iter_mut().find(|fact| {
            fact.place == new.place
                && std::mem::discriminant(&fact.about) == std::mem::discriminant(&new.about)
        });
        if let Some(fact) = same {
            *fact = new;
        }
    }
}

/// Removes guesses of a unit that the motion corrected; what agrees then agrees with the corrections.
pub fn without_guesses(of_files: &mut Vec<Fact>, corrections: &mut [Fact]) {
    let any = corrections
        .iter()
        .any(|f| matches!(f.about, About::Corrected { .. }));
    for fact in corrections.iter_mut() {
        if let About::Agrees { corrected, .. } = &mut fact.about {
            *corrected = any;
        }
    }
    for correction in corrections {
        let About::Corrected { mistake, .. } = &correction.about else {
            continue;
        };
        let is_wrong = |about: &About| match mistake {
            Mistake::TrackerUnit { .. } => {
                matches!(
                    about,
                    About::Lengths {
                        how: LengthHow::Range { .. },
                        ..
                    }
                )
            }
            Mistake::Unit { joint: None, unit } if matches!(*unit, "deg" | "rad") => {
                matches!(
                    about,
                    About::Angles {
                        how: AngleHow::Range { .. },
                        ..
                    }
                )
            }
            _ => false,
        };
        let everywhere = !matches!(correction.place, Place::Recording(_));
        let there = |fact: &Fact| everywhere || fact.place == correction.place;
        of_files.retain(|fact| !(there(fact) && is_wrong(&fact.about)));
    }
}
