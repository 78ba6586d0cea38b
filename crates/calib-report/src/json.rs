//! JSON that is the same text for the same report: keys in the order of the structs, floats with 12 significant digits.
//!
//! Twelve digits are a picometer in a meter: finer than optimizers repeat across machines and finer than measurements.

use crate::{DataChecks, Report, ReportError, Selection};
use std::fmt::Write as _;

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Significant digits of a float in `report.json`.
pub const DIGITS: usize = 12;

/// `report.json`: SI, floats with [`DIGITS`] significant digits, ordered keys, one trailing newline.
///
/// # Errors
/// [`ReportError::NotFinite`] when a required number is NaN or infinite (an unknown one is `None`).
pub fn report_json(report: &Report) -> Result<String, ReportError> {
    Ok(pretty(&report_value(report)?))
}

/// How a model was chosen, in the form of `selection` of the report.
///
/// # Errors
/// As [`report_json`].
pub fn selection_json(selection: &Selection) -> Result<String, ReportError> {
    let value = rounded(to_value(selection)?);
    Selection::deserialize(&value).map_err(|source| ReportError::NotFinite(source.to_string()))?;
    Ok(pretty(&value))
}

/// What was checked of recordings.
///
/// # Errors
/// As [`report_json`].
pub fn checks_json(checks: &DataChecks) -> Result<String, ReportError> {
    let value = rounded(to_value(checks)?);
    DataChecks::deserialize(&value).map_err(|source| ReportError::NotFinite(source.to_string()))?;
    Ok(pretty(&value) + "\n")
}

/// The value behind [`report_json`].
///
/// # Errors
/// As [`report_json`].
pub fn report_value(report: &Report) -> Result<Value, ReportError> {
    let value = rounded(to_value(report)?);
    // serde_json writes NaN as null; a null where a number must be does not read back.
    Report::deserialize(&value).map_err(|source| ReportError::NotFinite(source.to_string()))?;
    Ok(value)
}

/// Read a `report.json`.
///
/// # Errors
/// [`ReportError::Json`] when the text is not a report; the message has line and column.
pub fn read_report(text: &str) -> Result<Report, ReportError> {
    serde_json::from_str(text).map_err(|source| ReportError::Json(source.to_string()))
}

/// Any serializable value as JSON, floats untouched: shortest decimals that read back to the same number.
///
/// # Errors
/// [`ReportError::Json`] when the value has no JSON form.
pub fn exact_json<T: Serialize>(value: &T) -> Result<String, ReportError> {
    Ok(pretty(&to_value(value)?))
}

pub(crate) fn to_value<T: Serialize>(value: &T) -> Result<Value, ReportError> {
    serde_json::to_value(value).map_err(|source| ReportError::Json(source.to_string()))
}

/// Every float rounded to [`DIGITS`] significant digits; −0 becomes 0.
#[must_use]
pub fn rounded(value: Value) -> Value {
    rounded_to(value, DIGITS)
}

pub(crate) fn rounded_to(mut value: Value, digits: usize) -> Value {
    round_all(&mut value, digits);
    value
}

fn round_all(value: &mut Value, digits: usize) {
    match value {
        Value::Number(number) if number.is_f64() => {
            let rounded = number.as_f64().map(|x| Value::from(round(x, digits)));
            *value = rounded.unwrap_or(Value::Null);
        }
        Value::Array(items) => items.iter_mut().for_each(|item| round_all(item, digits)),
        Value::Object(map) => map.values_mut().for_each(|item| round_all(item, digits)),
        _ => {}
    }
}

fn round(x: f64, digits: usize) -> f64 {
    /// Whole numbers below have at most so many digits that nothing is rounded.
    const WHOLE: f64 = 1e6;
    let whole = x.abs() < WHOLE && x.fract() == 0.0 && digits > 6;
    let rounded = match whole {
        true => x,
        false => format!("{x:.*e}", digits - 1).parse().unwrap_or(x),
    };
    if rounded == 0.0 { 0.0 } else { rounded }
}

/// Indented by two spaces; an array of plain values is on one line, so that a matrix is readable.
#[must_use]
pub fn pretty(value: &Value) -> String {
    let mut text = String::new();
    write_value(&mut text, value, 0);
    text.push('\n');
    text
}

fn write_value(text: &mut String, value: &Value, indent: usize) {
    match value {
        Value::Array(items) if items.iter().any(|item| item.is_array() || item.is_object()) => {
            text.push('[');
            for (i, item) in items.iter().enumerate() {
                new_line(text, i, indent);
                write_value(text, item, indent + 2);
            }
            end_line(text, indent);
            text.push(']');
        }
        Value::Array(items) => {
            text.push('[');
            for (i, item) in items.iter().enumerate() {
                if i > 0 {
                    text.push_str(", ");
                }
                write_plain(text, item);
            }
            text.push(']');
        }
        Value::Object(map) if !map.is_empty() => {
            text.push('{');
            for (i, (key, item)) in map.iter().enumerate() {
                new_line(text, i, indent);
                write_plain(text, &Value::from(key.as_str()));
                text.push_str(": ");
                write_value(text, item, indent + 2);
            }
            end_line(text, indent);
            text.push('}');
        }
        other => write_plain(text, other),
    }
}

/// Before an item.
fn new_line(text: &mut String, item: usize, indent: usize) {
    if item > 0 {
        text.push(',');
    }
    end_line(text, indent + 2);
}

fn end_line(text: &mut String, indent: usize) {
    text.push('\n');
    text.extend(std::iter::repeat_n(' ', indent));
}

/// Without indentation.
fn write_plain(text: &mut String, value: &Value) {
    // Text takes what is written to it.
    let _ = write!(text, "{value}");
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    #[test]
    fn floats_keep_twelve_digits_and_integers_all() {
        let value = json!({"a": 0.1 + 0.2, "b": [1.0 / 3.0, -0.0, 1e-300], "n": 12_345_678_901_234_567_u64, "t": "0.30000000000000004"});
        let expected = json!({"a": 0.3, "b": [0.333333333333, 0.0, 1e-300], "n": 12_345_678_901_234_567_u64, "t": "0.30000000000000004"});
        assert_eq!(rounded(value), expected);
        assert_eq!(rounded(json!(-0.0)).to_string(), "0.0");
    }

    #[test]
    fn a_matrix_looks_like_a_matrix() {
        let text = pretty(&json!({"m": [[1, 2], [3, 4]], "v": [1, 2], "o": {}, "e": []}));
        assert_eq!(
            text,
            "{\n  \"m\": [\n    [1, 2],\n    [3, 4]\n  ],\n  \"v\": [1, 2],\n  \"o\": {},\n  \"e\": []\n}\n"
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(12), ..ProptestConfig::default() })]
        #[test]
        fn rounding_is_idempotent_and_close(x in proptest::num::f64::NORMAL) {
            let once = round(x, DIGITS);
            prop_assert_eq!(round(once, DIGITS), once);
            prop_assert!((once - x).abs() <= x.abs() * 0.51e-11);
        }
    }
}
