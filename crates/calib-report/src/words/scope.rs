//! What a result is valid for.

use crate::Scope;

impl Scope {
    /// The condition as a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        match self {
            Self::TrackedBodies { frame } => format!(
                "Positions of the tracked bodies in the tracker frame `{frame}`, within the recorded joint ranges and at the recorded load."
            ),
            Self::Contacts => {
                "The recorded contacts, within the recorded joint ranges and at the recorded load."
                    .to_owned()
            }
            Self::EffectsOf { file } => format!(
                "Only together with the joint effects in `{file}`: a URDF cannot represent them."
            ),
            Self::OriginsOneByOne => {
                "Origins were estimated one at a time (`method: paper`); the link geometry is that of the nominal URDF."
                    .to_owned()
            }
        }
    }
}
