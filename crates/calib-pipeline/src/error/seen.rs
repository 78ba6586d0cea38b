//! What the recordings have in the place of a body that none of them shows.

/// What the recordings have in the place of a body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SeenInstead {
    /// Bodies or markers of other names.
    Others {
        /// Names that the profile does not have, in order.
        names: Vec<String>,
        /// The name among the profile's that the tracker's name belongs to: the body, or its first marker.
        wanted: String,
        /// The name that is almost the wanted one.
        meant: Option<String>,
    },
    /// The body, lost in every row.
    AlwaysLost,
    /// The position of the body without its orientation.
    Point,
    /// The pose of the body, for which the profile declares markers.
    Pose,
    /// The body, in held-out recordings only.
    HeldOut {
        /// These recordings.
        recordings: Vec<String>,
    },
}

/// Names of a list; the rest is counted.
const LISTED: usize = 6;

impl SeenInstead {
    /// The end of a sentence that says that the body is not seen.
    #[must_use]
    pub fn words(&self) -> String {
        match self {
            Self::Others { names, .. } if names.is_empty() => String::new(),
            Self::Others { names, .. } => format!("; the recordings have {}", listed(names)),
            Self::AlwaysLost => ": it is lost in every row".to_owned(),
            Self::Point => ": its columns have a position, and no orientation".to_owned(),
            Self::Pose => {
                ": they have the pose of the body itself, and none of its markers".to_owned()
            }
            Self::HeldOut { recordings } => {
                format!(": only {} shows it, which is held out", listed(recordings))
            }
        }
    }

    /// What to do.
    #[must_use]
    pub fn remedy(&self, body: &str) -> String {
        match self {
            Self::Others {
                names,
                wanted,
                meant,
            } => {
                let near = did_you_mean(meant.as_ref());
                let example = meant.as_ref().or(names.first());
                let map = example.map_or_else(String::new, |from| {
                    format!(", state the tracker's name (`names: {{{wanted}: {from}}}`)")
                });
                format!(
                    "{near}record it, check the column names{map}, or remove it from the profile"
                )
            }
            Self::AlwaysLost => {
                "check that the tracker sees it, or remove it from the profile".to_owned()
            }
            Self::Point => {
                format!("declare it with `markers: [{body}]`, or record its orientation too")
            }
            Self::Pose => {
                format!(
                    "declare `{body}` with `pose: true` in place of `markers`, or record its markers"
                )
            }
            Self::HeldOut { .. } => {
                "use a recording with it for the fit (`use: static`), or remove it from the profile"
                    .to_owned()
            }
        }
    }
}

fn listed(names: &[String]) -> String {
    let first: Vec<String> = names
        .iter()
        .take(LISTED)
        .map(|n| format!("`{n}`"))
        .collect();
    let rest = names.len().saturating_sub(LISTED);
    if rest == 0 {
        first.join(", ")
    } else {
        format!("{} and {rest} more", first.join(", "))
    }
}

pub(super) fn did_you_mean(meant: Option<&String>) -> String {
    meant.map_or_else(String::new, |m| format!("did you mean `{m}`? "))
}
