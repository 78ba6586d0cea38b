//! What is said of the motions between postures: what to do with them, and what they are not checked for.

use crate::note::Note;

/// Whether a note says what motions are not checked for.
#[must_use]
pub fn is_unchecked(note: &Note) -> bool {
    unchecked(std::slice::from_ref(note)).is_some()
}

/// What motions are not checked for, in one sentence; `None`: nothing is known to be left out.
fn unchecked(notes: &[Note]) -> Option<String> {
    let mut parts = Vec::new();
    for note in notes {
        match note {
            Note::PairsNotCompared { pairs } => {
                let of = pairs.iter().map(|[a, b]| format!("`{a}` with `{b}`"));
                parts.push(some(&of.collect::<Vec<_>>()));
            }
            Note::NoShape { links } => {
                let of = links.iter().map(|link| format!("`{link}`"));
                parts.push(format!(
                    "links without shapes ({})",
                    some(&of.collect::<Vec<_>>())
                ));
            }
            Note::ShapeUnread { shapes } => {
                let of = shapes.iter().map(|(link, _)| format!("`{link}`"));
                let of = some(&of.collect::<Vec<_>>());
                parts.push(format!("links whose shapes could not be read ({of})"));
            }
            _ => {}
        }
    }
    (!parts.is_empty()).then(|| parts.join("; "))
}

/// The first few, and how many there are besides.
fn some(all: &[String]) -> String {
    const MOST: usize = 3;
    let mut shown = all.iter().take(MOST).cloned().collect::<Vec<_>>();
    if all.len() > MOST {
        shown.push(format!("{} more", all.len() - MOST));
    }
    shown.join(", ")
}

/// What to do with the files.
#[must_use]
pub fn record_them(folder: &str, detours: usize, trajectory: bool, notes: &[Note]) -> String {
    let mut text = format!(
        "Record the postures of {folder}/plan.csv, moving from row to row in this order; see {folder}/plan.html."
    );
    if detours > 0 {
        text += &format!(
            " {} on the way around obstacles only (`note` is `detour`): move there, but do not record.",
            if detours == 1 {
                "1 row is".to_owned()
            } else {
                format!("{detours} rows are")
            }
        );
    }
    if let Some(unchecked) = unchecked(notes) {
        let what = if trajectory {
            "plan.csv and trajectory.json"
        } else {
            "plan.csv"
        };
        text += &format!(
            " The motions of {what} are not checked for collisions of {unchecked}: move slowly the first time."
        );
    }
    text
}
