//! Sentences, lists and counts: what every notion needs to become prose.

/// Items of a list shown in an answer; the rest is counted and listed further down.
pub(crate) const SHOWN: usize = 3;

/// The lines, or `otherwise` where there is none.
pub(crate) fn or(lines: Vec<String>, otherwise: &str) -> Vec<String> {
    if lines.is_empty() {
        vec![otherwise.to_owned()]
    } else {
        lines
    }
}

/// The first [`SHOWN`] items and how many more there are.
pub(crate) fn short(items: &[String], rest: &str) -> Vec<String> {
    let mut lines: Vec<String> = items.iter().take(SHOWN).cloned().collect();
    if items.len() > SHOWN {
        lines.push(format!("… and {} more {rest}.", items.len() - SHOWN));
    }
    lines
}

/// Commands between backticks.
pub(crate) fn commands(commands: &[String]) -> Vec<String> {
    commands.iter().map(|command| code(command)).collect()
}

/// A name, a path or a key as code.
pub(crate) fn code(text: &str) -> String {
    if text.is_empty() {
        String::new()
    } else {
        format!("`{}`", text.replace('`', "'"))
    }
}

/// `1 error`, `2 errors`.
pub(crate) fn counted(n: usize, one: &str) -> String {
    let s = if n == 1 { "" } else { "s" };
    format!("{n} {one}{s}")
}

/// A capital letter in front where a word of prose begins, a period at the end.
pub(crate) fn sentence(text: &str) -> String {
    let text = text.trim();
    let first_word = text.split(' ').next().unwrap_or("");
    let prose = !first_word.is_empty()
        && first_word
            .bytes()
            .all(|b| b.is_ascii_lowercase() || b == b'-' || b == b',');
    if prose {
        full_stop(&capital(text))
    } else {
        full_stop(text)
    }
}

/// [`sentence`] of every item.
pub(crate) fn sentences(items: &[String]) -> Vec<String> {
    items.iter().map(|item| sentence(item)).collect()
}

/// A period at the end, where there is no other end mark.
pub(crate) fn full_stop(text: &str) -> String {
    let text = text.trim();
    if text.ends_with(['.', '!', '?', '…']) {
        text.to_owned()
    } else {
        format!("{text}.")
    }
}

/// A capital letter in front.
pub(crate) fn capital(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(characters).collect()
    })
}
