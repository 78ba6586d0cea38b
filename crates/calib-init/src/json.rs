//! A proposal for programs.

use serde_json::{Value, json};

use crate::checked::Checked;
use crate::edit::Edited;
use crate::proposal::Proposal;
use crate::words;

/// The facts with their places and sentences, the file, what was added to it, and what its check found; an object.
#[must_use]
pub fn proposal(
    proposal: &Proposal,
    edited: Option<&Edited>,
    file: &str,
    checked: &Checked<'_>,
) -> Value {
    let facts = proposal.facts.iter().map(|fact| {
        let mut value = serde_json::to_value(fact).unwrap_or_default();
        if let Some(object) = value.as_object_mut() {
            object.insert("place".to_owned(), json!(words::place(&fact.place)));
            object.insert("text".to_owned(), json!(words::sentence(&fact.about)));
        }
        value
    });
    let facts: Vec<Value> = facts.collect();
    let errors = (!matches!(checked, Checked::Not)).then(|| {
        let errors = checked.errors().into_iter();
        let of = |(id, text): (Option<String>, String)| json!({"id": id, "text": text});
        errors.map(of).collect::<Vec<Value>>()
    });
    let added = edited.map(|edited| {
        json!({
            "bodies": edited.bodies,
            "recordings": edited.recordings,
            "completed": edited.completed,
        })
    });
    json!({
        "profile": file,
        "added": added,
        "robot": proposal.robot,
        "noise": proposal.noise,
        "facts": facts,
        "errors": errors,
    })
}
