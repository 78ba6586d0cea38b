//! Numbers for people: a unit, and no more digits than the uncertainty carries.
//!
//! One rule for a value with a standard deviation σ: σ is rounded to two significant digits and the value to the same
//! decimal place, `1.234 ± 0.041 mm`. A value without σ has three significant digits and at most three decimals. A number that
//! rounds to zero has no sign; a negative number has a true minus sign (−). A value that is not finite is a dash, never `NaN`.
//!
//! Numbers for programs (CSV, URDF, JSON) are ASCII: [`round_trip`].

use crate::Unit;

/// Shown in place of an unknown number.
pub const UNKNOWN: &str = "—";

/// Largest number of decimals: a nanometer in mm, a microdegree in degrees.
const MAX_DECIMALS: i32 = 6;

/// From here on a fixed-point number is unreadable: use an exponent.
const SCIENTIFIC_FROM: f64 = 1e7;

/// Decimals of a value whose uncertainty is unknown: a micrometer, a millidegree, a microsecond.
const PLAIN_DECIMALS: i32 = 3;

/// Smaller numbers, in the unit that is shown, are rounding of 0: their last bits differ between machines, and no text may.
const NOTHING: f64 = 1e-9;

/// `1.234 ± 0.041 mm` from SI numbers. Without a finite σ the value stands alone.
///
/// ```
/// use calib_finding::{number, Unit};
/// assert_eq!(number::with_sigma(0.00123456, Some(0.0000412), Unit::Meter), "1.235 ± 0.041 mm");
/// assert_eq!(number::with_sigma(-1e-9, Some(0.002), Unit::Meter), "0.0 ± 2.0 mm");
/// ```
#[must_use]
pub fn with_sigma(value: f64, sigma: Option<f64>, unit: Unit) -> String {
    let Some((value, sigma)) = scaled(value, sigma, unit) else {
        return plain(value, unit);
    };
    let suffix = unit.display().1;
    // Both numbers carry the degree sign; a unit with a space stands once.
    if suffix.starts_with(' ') || suffix.is_empty() {
        format!("{value} ± {sigma}{suffix}")
    } else {
        format!("{value}{suffix} ± {sigma}{suffix}")
    }
}

/// Value and σ as text in the unit that a person reads; `None` without a finite σ.
fn scaled(value: f64, sigma: Option<f64>, unit: Unit) -> Option<(String, String)> {
    let factor = unit.display().0;
    // A number that is finite in meters may not be finite in millimeters.
    sigma
        .map(|sigma| (value * factor, sigma.abs() * factor))
        .filter(|(value, sigma)| value.is_finite() && sigma.is_finite())
        .map(|(value, sigma)| digits_from_sigma(value, sigma))
}

/// [`with_sigma`] without its unit, for a table whose heading names the unit.
#[must_use]
pub fn bare_with_sigma(value: f64, sigma: Option<f64>, unit: Unit) -> String {
    scaled(value, sigma, unit).map_or_else(
        || bare(value, unit),
        |(value, sigma)| format!("{value} ± {sigma}"),
    )
}

/// The value alone with its unit, rounded as [`with_sigma`] rounds it.
#[must_use]
pub fn rounded_by_sigma(value: f64, sigma: Option<f64>, unit: Unit) -> String {
    scaled(value, sigma, unit).map_or_else(
        || plain(value, unit),
        |(value, _)| format!("{value}{}", unit.display().1),
    )
}

/// `+1.235 ± 0.041 mm`: a change, with its sign.
#[must_use]
pub fn change(value: f64, sigma: Option<f64>, unit: Unit) -> String {
    let rounded = scaled(value, sigma, unit).map_or_else(|| bare(value, unit), |(value, _)| value);
    let plus = if value > 0.0 && rounded.contains(|c: char| ('1'..='9').contains(&c)) {
        "+"
    } else {
        ""
    };
    format!("{plus}{}", with_sigma(value, sigma, unit))
}

/// `± 0.041 mm`: a standard deviation alone, two significant digits.
#[must_use]
pub fn sigma(sigma: Option<f64>, unit: Unit) -> String {
    let (factor, suffix) = unit.display();
    match sigma.map(|sigma| sigma.abs() * factor) {
        Some(sigma) if sigma.is_finite() => format!("{}{suffix}", digits_from_sigma(0.0, sigma).1),
        _ => UNKNOWN.to_owned(),
    }
}

/// `4.56 mm`: three significant digits, at most three decimals.
#[must_use]
pub fn plain(value: f64, unit: Unit) -> String {
    let (factor, suffix) = unit.display();
    let text = significant(value * factor, PLAIN_DECIMALS);
    if text == UNKNOWN {
        text
    } else {
        format!("{text}{suffix}")
    }
}

/// [`plain`] of a number that may be unknown.
#[must_use]
pub fn plain_or_unknown(value: Option<f64>, unit: Unit) -> String {
    value.map_or_else(|| UNKNOWN.to_owned(), |value| plain(value, unit))
}

/// [`plain`] without its unit, for a table whose heading names the unit.
#[must_use]
pub fn bare(value: f64, unit: Unit) -> String {
    significant(value * unit.display().0, PLAIN_DECIMALS)
}

/// The heading's unit for [`bare`] numbers: `mm`, `deg`, `ms`.
#[must_use]
pub fn unit_name(unit: Unit) -> &'static str {
    unit.heading()
}

/// A length in centimeters with two decimals, as the paper's Table 1 prints it.
#[must_use]
pub fn centimeters(meters: f64) -> String {
    fixed(meters * 1e2, 2)
}

/// An angle in degrees with two decimals, as the paper's Table 1 prints it.
#[must_use]
pub fn degrees(radians: f64) -> String {
    fixed(radians.to_degrees(), 2)
}

/// A fixed number of decimals in the unit that a person reads, without the unit.
#[must_use]
pub fn fixed_in(value: f64, unit: Unit, decimals: usize) -> String {
    fixed(value * unit.display().0, decimals)
}

/// [`fixed_in`] with its unit: `377.910 mm`, `0.345°`.
#[must_use]
pub fn fixed_with_unit(value: f64, unit: Unit, decimals: usize) -> String {
    let (factor, suffix) = unit.display();
    format!("{}{suffix}", fixed(value * factor, decimals))
}

/// `37 %` of a share in [0, 1]; `> 99 %` and `< 1 %` where rounding would give 100 % or 0 %.
#[must_use]
pub fn percent(share: f64) -> String {
    if !share.is_finite() {
        return UNKNOWN.to_owned();
    }
    let percent = share * 100.0;
    if percent > 99.0 && percent < 100.0 - NOTHING {
        "> 99 %".to_owned()
    } else if percent > NOTHING && percent < 1.0 {
        "< 1 %".to_owned()
    } else {
        format!("{} %", fixed(percent, 0))
    }
}

/// The shortest decimal that reads back to the same `f64`, without an exponent and without a negative zero.
///
/// Numbers that are not finite do not occur in a checked scene; they become `0` so that no file contains `NaN`.
#[must_use]
pub fn round_trip(value: f64) -> String {
    if !value.is_finite() || value == 0.0 {
        "0".to_owned()
    } else {
        format!("{value}")
    }
}

/// Fixed decimals with a true minus sign, without `−0.00`.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return UNKNOWN.to_owned();
    }
    if value.abs() >= SCIENTIFIC_FROM {
        return exponential(value);
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(magnitude) if magnitude.bytes().all(|b| matches!(b, b'0' | b'.')) => {
            magnitude.to_owned()
        }
        Some(magnitude) => format!("−{magnitude}"),
        None => text,
    }
}

/// Two significant digits and an exponent, with a true minus sign.
fn exponential(value: f64) -> String {
    // −0 + 0 is 0.
    format!("{:.1e}", value + 0.0).replacen('-', "−", usize::from(value < 0.0))
}

/// Three significant digits, between 0 and `max_decimals` decimals.
fn significant(value: f64, max_decimals: i32) -> String {
    if !value.is_finite() {
        return UNKNOWN.to_owned();
    }
    let decimals = if value.abs() < NOTHING {
        0
    } else {
        (2 - exponent(value, 3)).clamp(0, max_decimals)
    };
    fixed(value, decimals as usize)
}

/// Value and σ of any unit, both already in it, as [`with_sigma`] rounds them; `None` where one is not finite.
pub(crate) fn rounded_pair(value: f64, sigma: f64) -> Option<(String, String)> {
    (value.is_finite() && sigma.is_finite()).then(|| digits_from_sigma(value, sigma.abs()))
}

/// Value and σ > 0 as text with the decimals that two significant digits of σ leave.
fn digits_from_sigma(value: f64, sigma: f64) -> (String, String) {
    if value.abs() >= SCIENTIFIC_FROM || sigma >= SCIENTIFIC_FROM {
        return (exponential(value), exponential(sigma));
    }
    if sigma < NOTHING {
        return (significant(value, PLAIN_DECIMALS), "0".to_owned());
    }
    let decimals = 1 - exponent(sigma, 2);
    if decimals > MAX_DECIMALS {
        let smallest = 10f64.powi(-MAX_DECIMALS);
        let places = MAX_DECIMALS as usize;
        return (
            fixed(value, places),
            if sigma < smallest {
                format!("<{smallest:.places$}")
            } else {
                fixed(sigma, places)
            },
        );
    }
    if decimals >= 0 {
        (
            fixed(value, decimals as usize),
            fixed(sigma, decimals as usize),
        )
    } else {
        let step = 10f64.powi(-decimals);
        (
            fixed((value / step).round() * step, 0),
            fixed((sigma / step).round() * step, 0),
        )
    }
}

/// The decimal exponent of a number after it was rounded to `digits` significant digits: 9.96 to two digits is 10, exponent 1.
fn exponent(value: f64, digits: usize) -> i32 {
    // `{:e}` rounds correctly in decimal; log10 does not at 9.995.
    let text = format!("{:.*e}", digits - 1, value.abs());
    text.rsplit('e')
        .next()
        .and_then(|e| e.parse().ok())
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn two_digits_of_sigma_set_the_decimals() {
        let table = [
            (1.23456e-3, 0.0412e-3, "1.235 ± 0.041 mm"),
            (1.23456e-3, 0.0996e-3, "1.23 ± 0.10 mm"),
            (1.23456e-3, 0.00996e-3, "1.235 ± 0.010 mm"),
            (-0.4e-9, 0.02e-3, "0.000 ± 0.020 mm"),
            (0.5392, 0.0123, "539 ± 12 mm"),
            (0.5392, 0.123, "540 ± 120 mm"),
            (12.3456, 1.234, "12300 ± 1200 mm"),
            (0.1, 1e-11, "100.000000 ± <0.000001 mm"),
            (0.1, 1e-13, "100 ± 0 mm"),
            (0.1, 0.0, "100 ± 0 mm"),
            (0.1, 3e8, "1.0e2 ± 3.0e11 mm"),
        ];
        for (value, sigma, text) in table {
            assert_eq!(
                with_sigma(value, Some(sigma), Unit::Meter),
                text,
                "{value} ± {sigma}"
            );
        }
    }

    #[test]
    fn every_unit_is_shown_in_the_unit_people_read() {
        assert_eq!(
            with_sigma(0.02, Some(0.0003), Unit::Radian),
            "1.146° ± 0.017°"
        );
        assert_eq!(
            with_sigma(-0.0123, Some(0.0011), Unit::Second),
            "−12.3 ± 1.1 ms"
        );
        assert_eq!(
            with_sigma(1.0002, Some(0.0001), Unit::One),
            "1.00020 ± 0.00010"
        );
        assert_eq!(plain(1e-5, Unit::RadianPerNewtonMeter), "0.001°/(N·m)");
        assert_eq!(plain(1e-6, Unit::MeterPerNewton), "0.001 mm/N");
    }

    #[test]
    fn a_value_without_sigma_has_three_digits_and_at_most_three_decimals() {
        let table = [
            (4.5612e-3, "4.56 mm"),
            (0.0412e-3, "0.041 mm"),
            (0.00041e-3, "0.000 mm"),
            (-0.00041e-3, "0.000 mm"),
            (0.5392, "539 mm"),
            (9.996e-3, "10.0 mm"),
            (12.34567, "12346 mm"),
            (0.0, "0 mm"),
            (-1e-13, "0 mm"),
            (f64::NAN, "—"),
            (f64::INFINITY, "—"),
        ];
        for (value, text) in table {
            assert_eq!(plain(value, Unit::Meter), text, "{value}");
        }
    }

    #[test]
    fn an_unknown_sigma_leaves_the_value_and_an_unknown_value_leaves_a_dash() {
        assert_eq!(with_sigma(0.1234, None, Unit::Meter), "123 mm");
        assert_eq!(
            with_sigma(0.1234, Some(f64::INFINITY), Unit::Meter),
            "123 mm"
        );
        assert_eq!(with_sigma(f64::NAN, Some(0.1), Unit::Meter), "—");
        assert_eq!(sigma(None, Unit::Meter), "—");
        assert_eq!(sigma(Some(0.000_012_3), Unit::Meter), "0.012 mm");
        assert_eq!(plain_or_unknown(None, Unit::Meter), "—");
    }

    #[test]
    fn a_change_has_a_sign_unless_it_is_nothing() {
        assert_eq!(change(0.001, Some(0.0001), Unit::Meter), "+1.00 ± 0.10 mm");
        assert_eq!(change(-0.001, Some(0.0001), Unit::Meter), "−1.00 ± 0.10 mm");
        assert_eq!(change(1e-9, Some(0.0001), Unit::Meter), "0.00 ± 0.10 mm");
        assert_eq!(
            change(1e-9, Some(0.0001), Unit::Radian),
            "0.0000° ± 0.0057°"
        );
    }

    #[test]
    fn shares_never_claim_all_or_nothing_by_rounding() {
        let table = [
            (0.0, "0 %"),
            (4.4e-16, "0 %"),
            (0.004, "< 1 %"),
            (0.37, "37 %"),
            (0.9999, "> 99 %"),
            (1.0 - 2.2e-16, "100 %"),
            (1.0, "100 %"),
            (f64::NAN, "—"),
        ];
        for (share, text) in table {
            assert_eq!(percent(share), text, "{share}");
        }
    }

    #[test]
    fn the_papers_table_has_two_decimals() {
        assert_eq!(centimeters(0.00862), "0.86");
        assert_eq!(degrees(0.0233), "1.33");
        assert_eq!(centimeters(-1e-9), "0.00");
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(16), ..ProptestConfig::default() })]

        /// What is printed is the value to within half of the last digit shown, and σ to within 5 %.
        #[test]
        fn the_printed_number_is_the_number(value in -10.0..10.0f64, exponent in -7.5..1.0f64) {
            let sigma = 10f64.powf(exponent);
            let text = with_sigma(value, Some(sigma), Unit::Meter);
            let number = text.strip_suffix(" mm").expect("a unit");
            let (shown_value, shown_sigma) = number.split_once(" ± ").expect("a sigma");
            let decimals = |s: &str| s.split_once('.').map_or(0, |(_, d)| d.len());
            prop_assert_eq!(decimals(shown_value), decimals(shown_sigma), "{}", &text);
            let printed: f64 = shown_value.replace('−', "-").parse().expect("a number");
            let printed_sigma: f64 = shown_sigma.parse().expect("a number");
            prop_assert!((printed_sigma / (sigma * 1e3) - 1.0).abs() <= 0.0501, "{}", &text);
            // Two significant digits of σ: half of the last place is at most σ/20 (σ = 10), at least σ/198.
            prop_assert!((printed - value * 1e3).abs() <= sigma * 1e3 / 19.9, "{}", &text);
            let digits = shown_sigma.trim_start_matches(['0', '.']).replace('.', "");
            prop_assert!(digits.trim_end_matches('0').len() <= 2, "{}", &text);
        }

        #[test]
        fn nothing_is_minus_zero_or_not_a_number(value in proptest::num::f64::ANY, sigma in proptest::num::f64::ANY) {
            for text in [with_sigma(value, Some(sigma), Unit::Meter), plain(value, Unit::Radian), change(value, Some(sigma), Unit::One),
                         fixed(value, 2), percent(value), round_trip(value)] {
                prop_assert!(!text.contains("NaN") && !text.contains("inf"), "{}", &text);
                let first = text.split([' ', '°']).next().unwrap_or("");
                let is_minus_zero = first.starts_with('−') && !first.contains(|c: char| ('1'..='9').contains(&c));
                prop_assert!(!is_minus_zero, "{}", &text);
            }
        }

        #[test]
        fn a_round_trip_decimal_reads_back(value in proptest::num::f64::NORMAL) {
            prop_assert_eq!(round_trip(value).parse::<f64>().expect("a number"), value);
        }
    }
}
