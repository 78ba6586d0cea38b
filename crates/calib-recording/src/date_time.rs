//! Dates with a time of day as ISO 8601 writes them, year first: `2024-05-01T12:00:00.123Z`, `2024-05-01 14:00:00+02:00`.

/// An instant that a text states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DateTime {
    /// Seconds since 1970-01-01 00:00 UTC.
    pub seconds: f64,
    /// The text states its offset from UTC; without one it is taken as UTC.
    pub zoned: bool,
}

/// The instant that a cell states; `None` for any other text. Other orders of year, month and day are ambiguous, and a time of day alone has no date.
pub fn date_time(cell: &str) -> Option<DateTime> {
    let mut rest = cell.trim();
    let year = digits(&mut rest, 4)?;
    let separator = one_of(&mut rest, "-/")?;
    let month = digits(&mut rest, 2)?;
    (one_of(&mut rest, "-/")? == separator).then_some(())?;
    let day = digits(&mut rest, 2)?;
    one_of(&mut rest, "Tt ")?;
    let hour = digits(&mut rest, 2)?;
    one_of(&mut rest, ":")?;
    let minute = digits(&mut rest, 2)?;
    one_of(&mut rest, ":")?;
    let second = digits(&mut rest, 2)?;
    let mut part = 0.0;
    if one_of(&mut rest, ".,").is_some() {
        let count = rest.bytes().take_while(u8::is_ascii_digit).count();
        let text = format!("0.{}", rest.get(..count).filter(|text| !text.is_empty())?);
        part = text.parse().ok()?;
        rest = &rest[count..];
    }
    let offset = offset(rest.trim_start())?;
    let days_of = [
        31,
        28 + i64::from(is_leap(year)),
        31,
        30,
        31,
        30,
        31,
        31,
        30,
        31,
        30,
        31,
    ];
    let in_month = usize::try_from(month - 1).ok().and_then(|m| days_of.get(m));
    // A leap second is the first one of the next minute, as computers count.
    let valid = in_month.is_some_and(|days| (1..=*days).contains(&day))
        && hour < 24
        && minute < 60
        && second <= 60;
    let whole = days(year, month, day) * 86_400 + hour * 3600 + minute * 60 + second;
    valid.then_some(DateTime {
        seconds: (whole - offset.unwrap_or(0)) as f64 + part,
        zoned: offset.is_some(),
    })
}

/// Seconds ahead of UTC, `Some(None)` where nothing is stated; `None` for another text.
fn offset(text: &str) -> Option<Option<i64>> {
    let mut rest = text;
    if rest.is_empty() {
        return Some(None);
    }
    if matches!(rest, "Z" | "z" | "UTC") {
        return Some(Some(0));
    }
    let sign = match one_of(&mut rest, "+-")? {
        '+' => 1,
        _ => -1,
    };
    let hours = digits(&mut rest, 2)?;
    one_of(&mut rest, ":");
    let minutes = if rest.is_empty() {
        0
    } else {
        digits(&mut rest, 2)?
    };
    let valid = rest.is_empty() && hours < 24 && minutes < 60;
    valid.then_some(Some(sign * (hours * 3600 + minutes * 60)))
}

/// A number of exactly so many digits.
fn digits(rest: &mut &str, count: usize) -> Option<i64> {
    let text = rest.get(..count)?;
    let number = text
        .bytes()
        .all(|b| b.is_ascii_digit())
        .then(|| text.parse().ok());
    *rest = &rest[count..];
    number.flatten()
}

fn one_of(rest: &mut &str, characters: &str) -> Option<char> {
    let c = rest.chars().next().filter(|c| characters.contains(*c))?;
    *rest = &rest[c.len_utf8()..];
    Some(c)
}

fn is_leap(year: i64) -> bool {
    year % 4 == 0 && (year % 100 != 0 || year % 400 == 0)
}

/// Days from 1970-01-01 to a date of the Gregorian calendar.
fn days(year: i64, month: i64, day: i64) -> i64 {
    // Years begin in March, so that the leap day is the last one: 153 days in five months.
    let year = if month <= 2 { year - 1 } else { year };
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    year * 365 + year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400) + of_year
        - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_seconds_since_1970_in_utc() {
        for (text, seconds, zoned) in [
            ("1970-01-01T00:00:00Z", 0.0, true),
            ("2024-05-01T12:00:00.125Z", 1_714_564_800.125, true),
            ("2024-05-01 14:00:00.125+02:00", 1_714_564_800.125, true),
            ("2024-05-01T06:30:00,125 -0530", 1_714_564_800.125, true),
            ("2024/05/01 12:00:00.125 UTC", 1_714_564_800.125, true),
            ("2024-05-01t13:00:00.125000000+01", 1_714_564_800.125, true),
            ("2024-05-01 12:00:00", 1_714_564_800.0, false),
            ("2000-02-29T23:59:60Z", 951_868_800.0, true),
            ("1969-12-31T23:59:59Z", -1.0, true),
        ] {
            assert_eq!(date_time(text), Some(DateTime { seconds, zoned }), "{text}");
        }
        for text in [
            "",
            "1.5",
            "2024-05-01",
            "12:00:00.1",
            "01.05.2024 12:00:00",
            "05/01/2024 12:00:00",
            "2023-02-29T00:00:00Z",
            "2024-13-01T00:00:00Z",
            "2024-05-01T24:00:00Z",
            "2024-05-01T12:00:00.Z",
            "2024-05-01T12:00:00CEST",
            "2024-05-01T12:00",
            "２024-05-01",
        ] {
            assert_eq!(date_time(text), None, "{text}");
        }
    }
}
