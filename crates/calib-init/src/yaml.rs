//! Values as YAML, in flow style.

use std::collections::BTreeMap;

use calib_profile::edit::Value;
use calib_recording::{AngleUnit, BodyColumns, ColumnMap, Delimiter, LengthUnit, RotationColumns};

/// A text, quoted where YAML would read something else.
#[must_use]
pub fn text(value: &str) -> String {
    const WORDS: [&str; 10] = [
        "true", "false", "null", "yes", "no", "on", "off", "y", "n", "~",
    ];
    let plain = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '/');
    let begins = value
        .chars()
        .next()
        .is_some_and(|c| c.is_alphabetic() || c == '_' || c == '.' || c == '/');
    let is_word = WORDS.contains(&value.to_ascii_lowercase().as_str());
    let is_number = value.parse::<f64>().is_ok();
    if begins && value.chars().all(plain) && !is_word && !is_number {
        return value.to_owned();
    }
    // A JSON string is a YAML string.
    serde_json::Value::from(value).to_string()
}

/// `[a, b]`.
#[must_use]
pub fn list<'t>(values: impl IntoIterator<Item = &'t String>) -> String {
    let values: Vec<String> = values.into_iter().map(|v| text(v)).collect();
    format!("[{}]", values.join(", "))
}

/// A number with at most `decimals` decimals, without zeros at its end.
#[must_use]
pub fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let short = match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => text.as_str(),
    };
    match short {
        "-0" | "" => "0".to_owned(),
        short => short.to_owned(),
    }
}

/// A positive number with two significant digits.
#[must_use]
pub fn two_digits(value: f64) -> String {
    let decimals = (1.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    number(value, decimals)
}

/// `{a: b, c: d}`.
fn map(values: &BTreeMap<String, String>) -> String {
    let of = |(key, value): (&String, &String)| format!("{}: {}", text(key), text(value));
    let all: Vec<String> = values.iter().map(of).collect();
    format!("{{{}}}", all.join(", "))
}

/// A column map: its keys with their values.
#[must_use]
pub fn columns(columns: &ColumnMap) -> Vec<(String, Value)> {
    let mut out = Vec::new();
    let mut line = |key: &str, value: String| out.push((key.to_owned(), Value::Flow(value)));
    if columns.skip_lines > 0 {
        line("skip_lines", columns.skip_lines.to_string());
    }
    if let Some(delimiter) = columns.delimiter {
        let word = match delimiter {
            Delimiter::Comma => "comma",
            Delimiter::Semicolon => "semicolon",
            Delimiter::Tab => "tab",
            Delimiter::Space => "space",
        };
        line("delimiter", word.to_owned());
    }
    if !columns.names.is_empty() {
        line("names", list(&columns.names));
    }
    if columns.decimal_comma {
        line("decimal_comma", "true".to_owned());
    }
    if columns.angles != AngleUnit::Rad {
        line("angles", "deg".to_owned());
    }
    if let Some(unit) = columns.body_angles {
        line("body_angles", unit.name().to_owned());
    }
    if columns.lengths != LengthUnit::M {
        line("lengths", columns.lengths.name().to_owned());
    }
    if let Some(time) = &columns.time {
        let unit = time.unit.name();
        line(
            "time",
            format!("{{column: {}, unit: {unit}}}", text(&time.column)),
        );
    }
    if !columns.joint_columns.is_empty() {
        line("joint_columns", list(&columns.joint_columns));
    }
    if !columns.joints.is_empty() {
        line("joints", map(&columns.joints));
    }
    if !columns.prismatic.is_empty() {
        line("prismatic", map(&columns.prismatic));
    }
    if !columns.reversed.is_empty() {
        line("reversed", list(&columns.reversed));
    }
    if !columns.markers.is_empty() {
        let of = |(name, xyz): (&String, &[String; 3])| format!("{}: {}", text(name), list(xyz));
        let all: Vec<String> = columns.markers.iter().map(of).collect();
        line("markers", format!("{{{}}}", all.join(", ")));
    }
    if !columns.bodies.is_empty() {
        let all: Vec<String> = columns
            .bodies
            .iter()
            .map(|(name, b)| body(name, b))
            .collect();
        line("bodies", format!("{{{}}}", all.join(", ")));
    }
    out
}

fn body(name: &str, body: &BodyColumns) -> String {
    let turns = body.rotations().map(|of| {
        let columns = list(of.columns());
        match of {
            RotationColumns::Euler(axes, _) => {
                format!(", euler: {{axes: {}, columns: {columns}}}", axes.name())
            }
            of => format!(", {}: {columns}", of.keys().join(".")),
        }
    });
    let inverted = if body.inverted {
        ", inverted: true"
    } else {
        ""
    };
    let turn = turns.collect::<String>() + inverted;
    format!(
        "{}: {{position: {}{turn}}}",
        text(name),
        list(&body.position)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_that_yaml_would_read_otherwise_are_quoted() {
        for plain in ["arm_1_joint", "a/b.csv", "../x.urdf", "Sub-1"] {
            assert_eq!(text(plain), plain);
        }
        for quoted in [
            "state.q[0]",
            "no",
            "1",
            "a: b",
            "x #1",
            "",
            "1e3",
            "*12",
            "-a",
        ] {
            assert_eq!(text(quoted), format!("\"{quoted}\""));
        }
        assert_eq!(text("a\"b"), r#""a\"b""#);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(number(0.30, 3), "0.3");
        assert_eq!(number(-0.0001, 2), "0");
        assert_eq!(number(120.0, 0), "120");
        assert_eq!(two_digits(0.3041), "0.3");
        assert_eq!(two_digits(12.34), "12");
        assert_eq!(two_digits(0.01234), "0.012");
    }
}
