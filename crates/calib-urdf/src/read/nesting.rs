//! What no parser is given: elements that are nested without end, and a document type definition.
//!
//! A parser that calls itself for each level ends with a stack overflow, and entities that name each other grow a few
//! kilobytes to gigabytes. A URDF needs neither.

use crate::error::Problem;

/// Links do not nest in a URDF: `robot > link > visual > geometry > box` is 5 deep, `<gazebo>` extensions some dozen.
pub const DEEPEST: usize = 1_000;

/// Looks at the tags alone, without any memory; what is not well-formed is left to the parser.
///
/// # Errors
/// Byte offset and [`Problem::TooDeep`] or [`Problem::Dtd`].
pub(crate) fn check(text: &str) -> Result<(), (usize, Problem)> {
    let mut depth = 0_usize;
    let mut at = 0;
    while let Some(found) = text[at..].find('<') {
        let start = at + found;
        let rest = &text[start..];
        let length = if rest.starts_with("<!--") {
            after(rest, "-->")
        } else if rest.starts_with("<![CDATA[") {
            after(rest, "]]>")
        } else if rest.starts_with("<?") {
            after(rest, "?>")
        } else if rest.starts_with("<!") {
            return Err((start, Problem::Dtd));
        } else {
            let end = tag_end(rest);
            let Some(end) = end else { return Ok(()) };
            if rest.starts_with("</") {
                depth = depth.saturating_sub(1);
            } else if !rest[..end].ends_with('/') {
                depth += 1;
            }
            if depth > DEEPEST {
                return Err((start, Problem::TooDeep { limit: DEEPEST }));
            }
            Some(end + 1)
        };
        let Some(length) = length else { return Ok(()) };
        at = start + length;
    }
    Ok(())
}

/// The byte after the next `end`.
fn after(text: &str, end: &str) -> Option<usize> {
    text.find(end).map(|at| at + end.len())
}

/// Where the `>` of a tag stands that is not in quotes.
fn tag_end(tag: &str) -> Option<usize> {
    let mut quote = None;
    for (at, byte) in tag.bytes().enumerate() {
        match (quote, byte) {
            (None, b'>') => return Some(at),
            (None, b'"' | b'\'') => quote = Some(byte),
            (Some(open), _) if open == byte => quote = None,
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::{DEEPEST, check};
    use crate::error::Problem;

    fn nested(levels: usize) -> String {
        "<a>".repeat(levels) + &"</a>".repeat(levels)
    }

    #[test]
    fn depth_is_that_of_open_elements() {
        assert_eq!(check(&nested(DEEPEST)), Ok(()));
        let deep = check(&nested(DEEPEST + 1));
        assert_eq!(
            deep,
            Err((3 * DEEPEST, Problem::TooDeep { limit: DEEPEST }))
        );
        let flat =
            "<r>".to_owned() + &"<a b='>' c=\"</\"/><!--<x>--><?p <y>?><b></b>".repeat(2_000);
        assert_eq!(check(&flat), Ok(()));
        let cdata = "<r>".to_owned() + &"<![CDATA[<a>]]>".repeat(2_000);
        assert_eq!(check(&cdata), Ok(()));
    }

    #[test]
    fn a_definition_is_found_behind_comments_and_not_in_them() {
        assert_eq!(
            check("<?xml version='1.0'?><!-- <!DOCTYPE r> --><r/>"),
            Ok(())
        );
        assert_eq!(
            check("<!-- x -->\n<!DOCTYPE r []><r/>"),
            Err((11, Problem::Dtd))
        );
    }
}
