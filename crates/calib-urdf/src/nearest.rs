//! The name that a person probably meant.

use std::cmp::Reverse;

/// Of `known`, the name nearest to `wrong` by edit distance; `None` when nothing is near enough to be a typo.
///
/// Near enough: a third of the letters (at least one) may be wrong, capital letters count nothing. Of names that
/// are equally near, the one with the same letters in another order (`haed` is `head`, not `hand`), then the one
/// that begins alike.
#[must_use]
pub fn nearest<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = wrong.to_lowercase();
    known
        .into_iter()
        .map(|name| {
            let other = name.to_lowercase();
            let begins_alike = (lower.chars().zip(other.chars()))
                .take_while(|(a, b)| a == b)
                .count();
            let unlike = (letters(&lower) != letters(&other), Reverse(begins_alike));
            (edit_distance(&lower, &other), unlike, name)
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

/// Letters to insert, delete, replace or swap with their neighbor: `wirst` is one typo away from `wrist`.
fn edit_distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    // distance[i][j] between the first i letters of a and the first j of b
    let mut distance = vec![vec![0; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            distance[i][j] = if i == 0 || j == 0 {
                i + j
            } else {
                let exchanged = distance[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
                let best = exchanged
                    .min(distance[i - 1][j] + 1)
                    .min(distance[i][j - 1] + 1);
                let swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
                if swapped {
                    best.min(distance[i - 2][j - 2] + 1)
                } else {
                    best
                }
            };
        }
    }
    distance[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_known_by_hand() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("wirst", "wrist"), 1);
        assert_eq!(edit_distance("abc", "abc"), 0);
    }

    #[test]
    fn of_equally_near_names_the_likelier_typo() {
        assert_eq!(nearest("haed", ["hand", "head"]), Some("head"));
        assert_eq!(nearest("heI", ["haI", "heT"]), Some("heT"));
        assert_eq!(nearest("ab", ["ad", "ac"]), Some("ac"));
        // `sfe` is as near, but half of it would be wrong.
        assert_eq!(nearest("sphere", ["sfe", "ml_sphere"]), Some("ml_sphere"));
    }

    #[test]
    fn a_typo_is_found_and_another_word_is_not() {
        let known = ["shoulder_lift_joint", "elbow_joint", "wrist_1_joint"];
        assert_eq!(nearest("elbw_joint", known), Some("elbow_joint"));
        assert_eq!(nearest("Elbow_Joint", known), Some("elbow_joint"));
        assert_eq!(nearest("camera", known), None);
        assert_eq!(nearest("x", []), None);
    }
}
