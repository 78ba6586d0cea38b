//! Commands that a person copies into a shell.

use std::borrow::Cow;

/// A word of a command as a POSIX shell must have it: in single quotes where it has blanks, or anything else that a shell would act upon.
#[must_use]
pub fn shell_word(text: &str) -> Cow<'_, str> {
    let plain = |c: char| c.is_alphanumeric() || "_./:,+@%-=".contains(c);
    match !text.is_empty() && text.chars().all(plain) && !text.starts_with('=') {
        true => Cow::Borrowed(text),
        false => Cow::Owned(format!("'{}'", text.replace('\'', r"'\''"))),
    }
}

/// [`shell_word`] for a path: one that begins with `-` is no option.
#[must_use]
pub fn shell_path(path: &str) -> Cow<'_, str> {
    match path.starts_with('-') {
        true => Cow::Owned(shell_word(&format!("./{path}")).into_owned()),
        false => shell_word(path),
    }
}

#[cfg(test)]
mod tests {
    use super::{shell_path, shell_word};

    #[test]
    fn a_shell_takes_a_word_as_it_is() {
        assert_eq!(shell_word("robots/ä_1.yaml"), "robots/ä_1.yaml");
        assert_eq!(shell_word("--method=ml"), "--method=ml");
        assert_eq!(shell_word("a; rm -rf x"), "'a; rm -rf x'");
        assert_eq!(shell_word("it's"), r"'it'\''s'");
        assert_eq!(shell_word("~x"), "'~x'");
        assert_eq!(shell_word(""), "''");
        assert_eq!(shell_path("-x"), "./-x");
        assert_eq!(shell_path("- x"), "'./- x'");
        assert_eq!(shell_path("a b"), "'a b'");
    }
}
