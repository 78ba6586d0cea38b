//! Sentences with places for values.
//!
//! `{key}` stands for a value: a number in the unit that people read, with three significant digits; `{key:um}` for a
//! number in that unit; `{key:yaml-ms}` for milliseconds as YAML has them, without the unit; `{key} ± {sigma}` for a value with the digits that its standard deviation leaves; `{key:row}` for a count with its noun (`1 row`, `2 rows`);
//! `{key:each other}` for names as YAML has them, each with the milliseconds of another key;
//! `{key:size}` and `{key:percent-size}` for a number without its sign, which `{key:more-or-less}`, `{key:ahead-or-behind}` or `{key:faster-or-slower}` says in a word. `[[ … ]]` is left out unless every
//! value in it is known.

use crate::{Fact, Facts, Unit, number, printable_line};

/// What stands where a value is not known.
const UNKNOWN: &str = "—";

/// The template with the values filled in.
pub(crate) fn fill(template: &str, facts: &Facts) -> String {
    let mut out = String::new();
    let mut rest = template;
    while let Some((before, group)) = rest.split_once("[[") {
        out += &filled(before, facts).0;
        let (inside, after) = group.split_once("]]").unwrap_or((group, ""));
        let (text, whole) = filled(inside, facts);
        if whole {
            out += &text;
        }
        rest = after;
    }
    out + &filled(rest, facts).0
}

/// The keys of all places, also of those in optional groups.
#[cfg(test)]
pub(crate) fn keys(template: &str) -> Vec<String> {
    let places = template.split('{').skip(1);
    let inside = places.filter_map(|place| place.split('}').next());
    inside
        .filter(|inside| is_place(inside))
        .map(|inside| inside.split(':').next().unwrap_or_default().to_owned())
        .collect()
}

/// The text, and whether all its values are known.
fn filled(template: &str, facts: &Facts) -> (String, bool) {
    let mut out = String::new();
    let mut whole = true;
    let mut rest = template;
    while let Some((before, place)) = rest.split_once('{') {
        out += before;
        // A place ends with its brace; a YAML line in a remedy has spaces in its braces and is text.
        let Some((inside, after)) = place.split_once('}').filter(|(inside, _)| is_place(inside))
        else {
            out.push('{');
            rest = place;
            continue;
        };
        if let Some((text, after)) = with_sigma(inside, after, facts) {
            out += &text;
            rest = after;
            continue;
        }
        let (key, form) = inside.split_once(':').unwrap_or((inside, ""));
        let shown = match form.strip_prefix("each ") {
            Some(other) => each(facts, key, other),
            None => facts.get(key).map(|fact| shown(fact, form)),
        };
        match shown {
            Some(text) => out += &text,
            None => {
                out += UNKNOWN;
                whole = false;
            }
        }
        rest = after;
    }
    (out + rest, whole)
}

/// `key` or `key:form`, where a form begins with a letter.
pub(crate) fn is_place(inside: &str) -> bool {
    let (key, form) = inside.split_once(':').unwrap_or((inside, "form"));
    let is_key = |b: u8| b.is_ascii_lowercase() || b == b'_';
    let is_form = |b: u8| b.is_ascii_lowercase() || b == b'-' || b == b' ';
    !key.is_empty()
        && key.bytes().all(is_key)
        && form.bytes().all(is_form)
        && form.starts_with(|c: char| c.is_ascii_lowercase())
}

fn shown(fact: &Fact, form: &str) -> String {
    match fact {
        Fact::Number { value, unit } => lone(*value, *unit, form),
        Fact::Count(count) if form.is_empty() => count.to_string(),
        Fact::Count(count) => format!("{count} {form}{}", if *count == 1 { "" } else { "s" }),
        Fact::Name(name) => printable_line(name).into_owned(),
        Fact::Names(names) => {
            let names: Vec<_> = names.iter().map(|name| printable_line(name)).collect();
            match form {
                "or" => names.join(" or "),
                "code" => format!("`{}`", names.join("`, `")),
                "exchange" => names.join(" ↔ "),
                "list" => format!("[{}]", names.join(", ")),
                _ => names.join(", "),
            }
        }
        Fact::Unknown => UNKNOWN.to_owned(),
    }
}

/// Names with the milliseconds of another key behind each.
fn each(facts: &Facts, names: &str, other: &str) -> Option<String> {
    let (Fact::Names(names), Fact::Number { value, unit }) = (facts.get(names)?, facts.get(other)?)
    else {
        return None;
    };
    let time = lone(*value, *unit, "yaml-ms");
    let names = names.iter().map(|name| printable_line(name));
    let each: Vec<String> = names.map(|name| format!("{name}: {time}")).collect();
    Some(each.join(", "))
}

/// A value whose standard deviation follows, `{value} ± {sigma}` or `{value} (± {sigma})`, with the digits that σ leaves, and the
/// template behind the two.
fn with_sigma<'a>(inside: &str, after: &'a str, facts: &Facts) -> Option<(String, &'a str)> {
    let (bracket, after) = match after.strip_prefix(" (± {") {
        Some(after) => (true, after),
        None => (false, after.strip_prefix(" ± {")?),
    };
    let (sigma, after) = after.split_once('}')?;
    let (key, form) = inside.split_once(':').unwrap_or((inside, ""));
    let (sigma, _) = sigma.split_once(':').unwrap_or((sigma, ""));
    let (Fact::Number { value, unit }, Fact::Number { value: sigma, .. }) =
        (facts.get(key)?, facts.get(sigma)?)
    else {
        return None;
    };
    let (form, value) = sized(form, *value);
    let (factor, suffix) = scale(*unit, form);
    let (value, sigma) = number::rounded_pair(value * factor, sigma * factor)?;
    let text = if bracket {
        format!("{value}{suffix} (± {sigma}{suffix}")
    } else if suffix.starts_with(' ') {
        format!("{value} ± {sigma}{suffix}")
    } else {
        format!("{value}{suffix} ± {sigma}{suffix}")
    };
    Some((text, after))
}

/// The word for the sign of a number, where a form asks for one.
fn word(form: &str, value: f64) -> Option<&'static str> {
    let (plus, minus) = match form {
        "more-or-less" => ("more", "less"),
        "ahead-or-behind" => ("ahead of", "behind"),
        "faster-or-slower" => ("faster", "slower"),
        _ => return None,
    };
    Some(if value < 0.0 { minus } else { plus })
}

/// A form without the ending that asks for a size, and the number without its sign where it has that ending.
fn sized(form: &str, value: f64) -> (&str, f64) {
    match form.strip_suffix("size") {
        Some(unit) => (unit.trim_end_matches('-'), value.abs()),
        None => (form, value),
    }
}

/// The factor to the unit that `form` names, else to the unit that people read, and its suffix.
fn scale(unit: Unit, form: &str) -> (f64, &'static str) {
    match form {
        "m" => (1.0, " m"),
        "um" => (1e6, " µm"),
        "s" => (1.0, " s"),
        "rad" => (1.0, " rad"),
        "turns" => (0.5 / std::f64::consts::PI, " revolutions"),
        "percent" => (100.0, " %"),
        "ppm" => (1e6, " ppm"),
        _ => unit.display(),
    }
}

/// A number in the unit that `form` names, else in the unit that people read.
fn lone(value: f64, unit: Unit, form: &str) -> String {
    match form {
        "yaml-ms" => return format!("{:.1}", value * 1e3),
        // What people read, without its unit and with the minus of data.
        "yaml" => return significant(value * unit.display().0).replace('−', "-"),
        _ => {}
    }
    if let Some(word) = word(form, value) {
        return word.to_owned();
    }
    let (form, value) = sized(form, value);
    let (factor, suffix) = scale(unit, form);
    format!("{}{suffix}", significant(value * factor))
}

/// Three significant digits, at most three decimals; a scientific form for what would be all zeros.
fn significant(value: f64) -> String {
    /// Below this three decimals show nothing.
    const SMALL: f64 = 5e-4;
    let size = value.abs();
    let text = if size > 0.0 && size < SMALL {
        format!("{value:.1e}")
    } else {
        let digits = if size >= 1.0 {
            size.log10().floor() as i32 + 1
        } else {
            0
        };
        let decimals = usize::try_from((3 - digits).clamp(0, 3)).unwrap_or(0);
        let fixed = format!("{value:.decimals$}");
        if fixed.contains('.') {
            fixed.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            fixed
        }
    };
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts() -> Facts {
        let mut facts = Facts::new();
        facts.insert("length", Fact::meters(0.00123456));
        facts.insert("angle", Fact::radians(-std::f64::consts::FRAC_PI_6));
        facts.insert("rows", Fact::count(1));
        facts.insert("lost", Fact::count(0));
        facts.insert("markers", Fact::names(["a", "b"]));
        facts.insert("nan", Fact::meters(f64::NAN));
        facts.insert("late", Fact::seconds(-0.012_34));
        facts
    }

    #[test]
    fn values_in_the_unit_that_people_read() {
        let said = |template| fill(template, &facts());
        assert_eq!(
            said("a_mm: {length:yaml}, b_deg: {angle:yaml}"),
            "a_mm: 1.23, b_deg: -30"
        );
        assert_eq!(
            said("{length}, {length:um}, {length:m}"),
            "1.23 mm, 1235 µm, 0.001 m"
        );
        assert_eq!(said("{angle}, {angle:rad}"), "−30°, −0.524 rad");
        assert_eq!(said("{rows:row} of {lost:row}"), "1 row of 0 rows");
        assert_eq!(said("{late: {late:yaml-ms}}"), "{late: -12.3}");
        assert_eq!(said("{{markers:each late}}"), "{a: -12.3, b: -12.3}");
        assert_eq!(said("a[[: {markers:each none}]]"), "a");
        assert_eq!(
            said("{markers:exchange}; {markers:code}"),
            "a ↔ b; `a`, `b`"
        );
        assert_eq!(said("{nan}{missing}"), "——");
    }

    #[test]
    fn sigma_sets_the_digits_of_its_value() {
        let mut facts = Facts::new();
        facts.insert("offset", Fact::seconds(-2.7503));
        facts.insert("sigma", Fact::seconds(0.000_165));
        facts.insert("angle", Fact::radians(0.02));
        facts.insert("sigma_angle", Fact::radians(0.000_3));
        facts.insert("factor", Fact::ratio(0.123_456));
        facts.insert("spread", Fact::ratio(0.001_2));
        let said = |template| fill(template, &facts);
        assert_eq!(said("{offset} ± {sigma} ahead"), "−2750.30 ± 0.17 ms ahead");
        assert_eq!(said("{angle} ± {sigma_angle}."), "1.146° ± 0.017°.");
        assert_eq!(
            said("{factor:percent} (± {spread:percent})"),
            "12.35 % (± 0.12 %)"
        );
        assert_eq!(said("{offset} ± {unknown}"), "−2750 ms ± —");
    }

    #[test]
    fn a_group_needs_all_its_values() {
        assert_eq!(
            fill("a[[, {rows:row}]][[, {missing}]].", &facts()),
            "a, 1 row."
        );
    }

    #[test]
    fn a_line_of_yaml_is_text() {
        let line = "`tracker: {up_axis: +Y}`";
        assert_eq!(fill(line, &facts()), line);
    }

    #[test]
    fn no_number_is_shown_as_zero_that_is_not() {
        assert_eq!(significant(0.0), "0");
        assert_eq!(significant(1.0e-6), "1.0e−6");
        assert_eq!(significant(1234.5), "1234");
        assert_eq!(significant(12.345), "12.3");
        assert_eq!(significant(0.9996), "1");
    }
}
