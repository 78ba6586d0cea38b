//! What is said of a profile that is edited.

use calib_finding::{Unit, number};

use super::{mm, plural, quoted};
use crate::edit::Edited;
use crate::fact::About;

/// What stands in the profile, beside what the recordings show.
pub(super) fn sentence(about: &About) -> String {
    match about {
        About::LinkOfProfile { link, rms, better } => {
            let fit = rms.map_or_else(
                || "no pose shows the body together with moving joints".to_owned(),
                |rms| format!("the body follows it to {} rms", mm(rms)),
            );
            let better = better.as_ref().map_or_else(String::new, |b| {
                format!(
                    " `{}` explains its motion better: {} rms.",
                    b.link,
                    mm(b.rms)
                )
            });
            format!("The profile has it on `{link}`: {fit}.{better}")
        }
        About::Listed => {
            "The profile has this recording already: its entry stays as it is.".to_owned()
        }
        About::Replaced { file } => {
            format!(
                "The file of this recording, `{file}`, does not exist: the one that was given takes its place."
            )
        }
        About::Absent { file } => {
            format!("Its file `{file}` does not exist: record it, or delete the entry.")
        }
        About::NotSeen { markers, none_is } => {
            let what = match markers.as_slice() {
                [] => "Its pose".to_owned(),
                markers => format!(
                    "{} {}",
                    if markers.len() == 1 {
                        "Its marker"
                    } else {
                        "Its markers"
                    },
                    quoted(markers)
                ),
            };
            let is = if markers.len() > 1 { "are" } else { "is" };
            let hint = match none_is {
                true => {
                    " If the tracker has another name for it, state it under `names`, and delete the body that was added in its place."
                }
                false => "",
            };
            format!("{what} {is} in none of these recordings.{hint}")
        }
        About::MoreMarkers { markers } => format!(
            "{} {} the distance from its markers: add {} to `markers` if {} mounted there.",
            quoted(markers),
            if markers.len() == 1 { "keeps" } else { "keep" },
            if markers.len() == 1 { "it" } else { "them" },
            if markers.len() == 1 {
                "it is"
            } else {
                "they are"
            },
        ),
        About::OtherUse { moved, rows } => format!(
            "The entry's `use` was stated for another file: in this one {} in {}.",
            plural(*moved, "joint moves", "joints move"),
            plural(*rows, "pose", "poses")
        ),
        About::NoNewBody { link } => {
            format!("No body of these recordings is new: `--markers-on {link}` has no use.")
        }
        About::HeldAsElsewhere { joint, at, turns } => format!(
            "`{joint}` has no column: it is taken to stand at {}, where other recordings of the profile hold it.",
            number::plain(*at, if *turns { Unit::Radian } else { Unit::Meter })
        ),
        About::StatedBodySigma { stated, shown } => format!(
            "A body that stands still scatters by {} and {}; the profile states {} and {}.",
            number::plain(shown.0, Unit::Meter),
            number::plain(shown.1, Unit::Radian),
            number::plain(stated.0, Unit::Meter),
            number::plain(stated.1, Unit::Radian)
        ),
        About::InventedMount => {
            "The mount of this body in the simulation is invented: put in what you expect."
                .to_owned()
        }
        About::StatedSigma { stated, shown } => format!(
            "The markers scatter about their bodies by {} per coordinate; the profile states {}.",
            number::plain(*shown, Unit::Meter),
            number::plain(*stated, Unit::Meter)
        ),
        _ => String::new(),
    }
}

/// What was written.
#[must_use]
pub fn wrote(file: &str, edited: Option<&Edited>) -> String {
    let Some(edited) = edited else {
        return format!("Wrote {file}");
    };
    if edited.is_same() {
        return format!("Nothing is to be added to {file}.");
    }
    let of = |names: &[String], one: &str, many: &str| match names {
        [] => None,
        [name] => Some(format!("{one} `{name}`")),
        names => Some(format!("{many} {}", quoted(names))),
    };
    let added = [
        of(&edited.bodies, "body", "bodies"),
        of(&edited.recordings, "recording", "recordings"),
    ];
    let added: Vec<String> = added.into_iter().flatten().collect();
    let added = match added.is_empty() {
        true => None,
        false => Some(format!("added {}", added.join(" and "))),
    };
    let completed = of(
        &edited.completed,
        "completed recording",
        "completed recordings",
    );
    let all: Vec<String> = [added, completed].into_iter().flatten().collect();
    format!(
        "Edited {file}: {}. Everything else stands as it was.",
        all.join("; ")
    )
}

/// Above the facts that a person must look at.
#[must_use]
pub fn to_check(edited: Option<&Edited>) -> &'static str {
    match edited {
        None => "To check (marked CHECK in the file)",
        Some(_) => "To check (what is new is marked CHECK in the file)",
    }
}

/// What to do next where recordings of the profile have no file.
#[must_use]
pub fn next_of_absent(file: &str) -> String {
    let file = calib_finding::shell_path(file);
    format!("Next: record what is missing, or delete its entries, then calib check {file}")
}
