//! Sentences, lists and counts: what every notion needs to become prose.

/// How many items of a list stand in an answer; the rest is counted and stands further down.
pub(crate) const SHOWN: usize = 3;

pub(crate) fn or(lines: Vec<String>, otherwise: &str) -> Vec<String> {
    if lines.is_empty() {
        vec![otherwise.to_owned()]
    } else {
        lines
    }
}

pub(crate) fn short(items: &[String], rest: &str) -> Vec<String> {
    let mut lines: Vec<String> = items.iter().take(SHOWN).cloned().collect();
    if items.len() > SHOWN {
        lines.push(format!("… and {} more {rest}.", items.len() - SHOWN));
    }
    lines
}

/// Commands stand between backticks.
pub(crate) fn commands(commands: &[String]) -> Vec<String> {
    commands
        .iter()
        .map(|command| format!("`{command}`"))
        .collect()
}

/// A capital letter in front where a word of prose begins, a full stop at the end.
pub(crate) fn sentence(text: &str) -> String {
    let text = text.trim();
    let first_word = text.split(' ').next().unwrap_or("");
    let prose = !first_word.is_empty()
        && first_word
            .bytes()
            .all(|b| b.is_ascii_lowercase() || b == b'-' || b == b',');
    if prose {
        full_stop(&(text[..1].to_ascii_uppercase() + &text[1..]))
    } else {
        full_stop(text)
    }
}

/// A full stop at the end, where no other sign is.
pub(crate) fn full_stop(text: &str) -> String {
    let text = text.trim();
    if text.ends_with(['.', '!', '?', '…']) {
        text.to_owned()
    } else {
        format!("{text}.")
    }
}

pub(crate) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}
