//! The name that a person probably meant.

/// Of `known`, the name nearest to `wrong` by edit distance; `None` when nothing is near enough to be a slip.
///
/// Near enough: a third of the letters (at least one) may be wrong, capital letters count nothing.
#[must_use]
pub fn nearest<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = wrong.to_lowercase();
    known
        .into_iter()
        .map(|name| (edit_distance(&lower, &name.to_lowercase()), name))
        .min()
        .filter(|(distance, name)| {
            *distance <= (name.chars().count().max(lower.chars().count()) / 3).max(1)
        })
        .map(|(_, name)| name)
}

/// Levenshtein distance in characters, one row at a time.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_known_by_hand() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("abc", "abc"), 0);
    }

    #[test]
    fn a_slip_is_found_and_a_stranger_is_not() {
        let known = ["shoulder_lift_joint", "elbow_joint", "wrist_1_joint"];
        assert_eq!(nearest("elbw_joint", known), Some("elbow_joint"));
        assert_eq!(nearest("Elbow_Joint", known), Some("elbow_joint"));
        assert_eq!(nearest("camera", known), None);
        assert_eq!(nearest("x", []), None);
    }
}
