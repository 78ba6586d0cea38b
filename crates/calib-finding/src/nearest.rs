//! The name that a person probably meant.

use std::cmp::Reverse;

/// Longest name that is compared, in letters: the distance takes quadratic time, and files may hold anything.
const LONGEST: usize = 200;

/// Of `known`, the name nearest to `wrong` by edit distance (insert, delete, replace, swap neighbors); `None` when
/// nothing is near enough to be a typo.
///
/// Near enough: a third of the letters (at least one) may be wrong; upper and lower case count as
/// equal, and so do `-` and `_`. Of names
/// that are equally near, the one with the same letters in another order (`haed` is `head`, not `hand`), then the
/// one that begins alike.
///
/// ```
/// use calib_finding::nearest_word;
/// assert_eq!(nearest_word("elbw", ["elbow", "wrist"]), Some("elbow"));
/// assert_eq!(nearest_word("camera", ["elbow", "wrist"]), None);
/// ```
#[must_use]
pub fn nearest_word<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |word: &str| word.to_lowercase().replace('-', "_");
    let lower = plain(wrong);
    if lower.chars().count() > LONGEST {
        return None;
    }
    known
        .into_iter()
        .filter(|name| name.chars().count() <= LONGEST)
        .map(|name| {
            let other = plain(name);
            let begins_alike = (lower.chars().zip(other.chars()))
                .take_while(|(a, b)| a == b)
                .count();
            let unlike = (letters(&lower) != letters(&other), Reverse(begins_alike));
            (strsim::osa_distance(&lower, &other), unlike, name)
        })
        .filter(|(distance, _, name)| {
            *distance <= (name.chars().count().max(lower.chars().count()) / 3).max(1)
        })
        .min()
        .map(|(_, _, name)| name)
}

fn letters(word: &str) -> Vec<char> {
    let mut letters: Vec<char> = word.chars().collect();
    letters.sort_unstable();
    letters
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_equally_near_names_the_likelier_typo() {
        assert_eq!(nearest_word("haed", ["hand", "head"]), Some("head"));
        assert_eq!(nearest_word("heI", ["haI", "heT"]), Some("heT"));
        assert_eq!(nearest_word("ab", ["ad", "ac"]), Some("ac"));
        // `sfe` is as near, but half of it would be wrong.
        assert_eq!(
            nearest_word("sphere", ["sfe", "ml_sphere"]),
            Some("ml_sphere")
        );
    }

    #[test]
    fn a_typo_is_found_and_a_stranger_is_not() {
        let known = ["shoulder_lift_joint", "elbow_joint", "wrist_1_joint"];
        assert_eq!(nearest_word("elbw_joint", known), Some("elbow_joint"));
        assert_eq!(nearest_word("Elbow_Joint", known), Some("elbow_joint"));
        assert_eq!(nearest_word("a-b-c", ["a_b_c", "a_bxc"]), Some("a_b_c"));
        assert_eq!(nearest_word("wirst_1_joint", known), Some("wrist_1_joint"));
        assert_eq!(nearest_word("camera", known), None);
        assert_eq!(nearest_word("x", []), None);
        assert_eq!(nearest_word(&"x".repeat(100_000), known), None);
    }
}
