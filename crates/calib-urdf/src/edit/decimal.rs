//! Numbers as a URDF's reader takes them: the shortest decimals that give the same `f64` back.

use crate::read::numbers::tokens;
use std::ops::Range;

/// Rounding noise of rotations and products of poses (m, rad): a text number this near to the new one is the new one.
///
/// A hundred times below the 1e-12 m that a patched file has to keep, at a lever arm of 1 m.
pub const SAME_NUMBER: f64 = 1e-14;

/// Noise of this size around zero is written as `0` and not as seventeen zeros and a digit.
const ZERO: f64 = 1e-15;

/// The shortest decimal digits that read back as the same number: no exponent, no negative zero.
#[must_use]
pub fn decimal(value: f64) -> String {
    if value.abs() < ZERO {
        "0".to_owned()
    } else {
        format!("{value}")
    }
}

/// Numbers separated by single spaces.
#[must_use]
pub fn decimals(values: &[f64]) -> String {
    values
        .iter()
        .map(|value| decimal(*value))
        .collect::<Vec<_>>()
        .join(" ")
}

/// An angle that came through a rotation, without the noise of that: 0.09999999999999999 is 0.1.
///
/// Moves it by less than a rounding of the rotation itself, 2.3e-16 rad; to a number of nine decimals by less than [`SAME_NUMBER`].
#[must_use]
pub fn tidy_angle(angle: f64) -> f64 {
    let short = (angle * 1e9).round() / 1e9;
    if (short - angle).abs() <= SAME_NUMBER {
        return short;
    }
    let rounded = (angle * 1e15).round() / 1e15;
    if (rounded - angle).abs() <= f64::EPSILON {
        rounded
    } else {
        angle
    }
}

/// Is the number in the text still the right one?
#[must_use]
pub fn same_number(old: f64, new: f64) -> bool {
    (old - new).abs() <= SAME_NUMBER
}

/// A byte range of a text and what is to stand there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Splice {
    /// In the original text; empty for an insertion.
    pub range: Range<usize>,
    /// The new text.
    pub new: String,
}

/// Replaces the numbers of an attribute one by one; those that stay keep their text, and so do the spaces between.
///
/// `raw` is the attribute's text between its quotes, which begins at byte `start`; `old` are the numbers that it means.
#[must_use]
pub fn splice_numbers(raw: &str, start: usize, old: &[f64], new: &[f64]) -> Vec<Splice> {
    if old
        .iter()
        .zip(new)
        .all(|(old, new)| same_number(*old, *new))
    {
        return Vec::new();
    }
    let words: Vec<(usize, &str)> = tokens(raw).collect();
    if words.len() != new.len() {
        // An entity holds several numbers: only the whole value can be replaced.
        return vec![Splice {
            range: start..start + raw.len(),
            new: decimals(new),
        }];
    }
    let changed = words
        .iter()
        .zip(old.iter().zip(new))
        .filter(|(_, (old, new))| !same_number(**old, **new));
    changed
        .map(|((offset, word), (_, new))| Splice {
            range: start + offset..start + offset + word.len(),
            new: decimal(*new),
        })
        .collect()
}

/// The text with all splices made; they must be sorted by their start and must not overlap.
#[must_use]
pub fn apply(text: &str, splices: &[Splice]) -> String {
    let mut patched = String::with_capacity(
        text.len() + splices.iter().map(|splice| splice.new.len()).sum::<usize>(),
    );
    let mut at = 0;
    for splice in splices {
        patched.push_str(&text[at..splice.range.start]);
        patched.push_str(&splice.new);
        at = splice.range.end;
    }
    patched.push_str(&text[at..]);
    patched
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn texts_of_numbers() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (-6.1e-17, "0"),
            (1e-10, "0.0000000001"),
            (0.1 + 0.2, "0.30000000000000004"),
            (-1.5, "-1.5"),
            (1e21, "1000000000000000000000"),
        ] {
            assert_eq!(decimal(value), text);
        }
    }

    fn patched(raw: &str, old: &[f64], new: &[f64]) -> String {
        apply(raw, &splice_numbers(raw, 0, old, new))
    }

    #[test]
    fn numbers_that_stay_keep_their_text() {
        assert_eq!(
            patched(" 1.50\t -0.0\n+3e0 ", &[1.5, 0.0, 3.0], &[1.5, 0.0, 4.25]),
            " 1.50\t -0.0\n4.25 "
        );
        assert_eq!(
            patched("-6.123E-17 0 0", &[-6.123e-17, 0.0, 0.0], &[0.0, 0.5, 0.0]),
            "-6.123E-17 0.5 0"
        );
        assert_eq!(
            patched("1 2 3", &[1.0, 2.0, 3.0], &[1.0, 2.0, 3.0 + 1e-15]),
            "1 2 3"
        );
        assert_eq!(
            patched("&h; 0 &#49;", &[0.3, 0.0, 1.0], &[0.3, 0.1, 1.0]),
            "&h; 0.1 &#49;"
        );
        assert_eq!(
            patched("&all;", &[0.3, 0.0, 1.0], &[0.3, 0.1, 1.0]),
            "0.3 0.1 1"
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(2), ..ProptestConfig::default() })]
        #[test]
        fn decimals_read_back_exactly(value in proptest::num::f64::NORMAL) {
            let text = decimal(value);
            prop_assert!(!text.contains(['e', 'E']));
            prop_assert!(text != "-0");
            if value.abs() >= ZERO {
                prop_assert_eq!(text.parse::<f64>().unwrap(), value);
            }
        }
    }
}
