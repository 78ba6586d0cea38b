//! Names that a file may have on every system.

/// Why a file cannot have a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NameFault {
    /// Nothing.
    #[error("it is empty")]
    Empty,
    /// `.` or `..`.
    #[error("it names a folder")]
    Folder,
    /// `/` or `\`.
    #[error("it holds a path separator")]
    Separator,
    /// A line break, a terminal sequence, or another character that is not printed.
    #[error("it holds a control character")]
    Control,
    /// A device of Windows, or a file that this program keeps for itself.
    #[error("the name is reserved")]
    Reserved,
    /// A suffix would make it too long for a file system.
    #[error("it has more than {LONGEST_NAME} bytes")]
    TooLong,
}

/// Name of the list in a folder of results: what this program wrote there and may replace.
pub const MANIFEST: &str = "calib.manifest";

/// What a file is called while it is written: `.calib-`, random digits, `.part`.
const FIRST: &str = ".calib-";
const LAST: &str = ".part";
/// Hexadecimal digits between the two: 64 bits.
const DIGITS: usize = 16;

/// The name with these digits.
pub(crate) fn part(random: u64) -> String {
    format!("{FIRST}{random:0DIGITS$x}{LAST}")
}

/// Whether a name is one that [`part`] gives.
pub(crate) fn is_part(name: &str) -> bool {
    let middle = name
        .strip_prefix(FIRST)
        .and_then(|rest| rest.strip_suffix(LAST));
    middle.is_some_and(|m| m.len() == DIGITS && m.bytes().all(|b| b.is_ascii_hexdigit()))
}

/// Most file systems hold 255 bytes; the rest is for what is added to a name (`.changes.json`).
pub const LONGEST_NAME: usize = 200;

/// Whether a file can have this name in a folder of results.
///
/// # Errors
/// [`NameFault`].
pub fn check_name(name: &str) -> Result<(), NameFault> {
    match name {
        "" => Err(NameFault::Empty),
        "." | ".." => Err(NameFault::Folder),
        _ if name.contains(['/', '\\']) => Err(NameFault::Separator),
        _ if name.contains(char::is_control) => Err(NameFault::Control),
        _ if is_reserved(name) => Err(NameFault::Reserved),
        _ if name.len() > LONGEST_NAME => Err(NameFault::TooLong),
        _ => Ok(()),
    }
}

fn is_reserved(name: &str) -> bool {
    let stem = name.split('.').next().unwrap_or(name).trim_end();
    let numbered = |word: &str| {
        let is_device = word == "COM" || word == "LPT";
        is_device && stem.len() == 4 && stem.ends_with(|c: char| ('1'..='9').contains(&c))
    };
    let upper = stem.to_ascii_uppercase();
    matches!(upper.as_str(), "CON" | "PRN" | "AUX" | "NUL")
        || upper.get(..3).is_some_and(numbered)
        || name.eq_ignore_ascii_case(MANIFEST)
        || is_part(name)
}

#[cfg(test)]
mod tests {
    use super::{NameFault, check_name};

    #[test]
    fn names_that_no_folder_can_hold_are_refused() {
        for good in [
            "a.urdf",
            "report",
            ".hidden",
            "COM10.csv",
            "Ωμέγα.csv",
            "console.txt",
        ] {
            assert_eq!(check_name(good), Ok(()), "{good}");
        }
        let bad = [
            ("", NameFault::Empty),
            ("..", NameFault::Folder),
            ("a/b", NameFault::Separator),
            ("a\\b", NameFault::Separator),
            ("a\u{1b}[2Jb", NameFault::Control),
            ("a\u{9b}b", NameFault::Control),
            ("nul.csv", NameFault::Reserved),
            ("lpt1", NameFault::Reserved),
            ("calib.manifest", NameFault::Reserved),
            (".calib-0123456789abcdef.part", NameFault::Reserved),
        ];
        for (name, fault) in bad {
            assert_eq!(check_name(name), Err(fault), "{name:?}");
        }
        assert_eq!(check_name(&"x".repeat(201)), Err(NameFault::TooLong));
    }
}
