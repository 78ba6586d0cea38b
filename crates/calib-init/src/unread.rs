//! What columns that nothing uses seem to be.

use std::collections::BTreeSet;

use crate::header::Header;
use crate::name;

/// Words of an orientation.
const WORDS: [&str; 8] = [
    "quat",
    "quaternion",
    "rot",
    "rotation",
    "orientation",
    "euler",
    "rpy",
    "orient",
];
/// Sets of names that are one together: what a name ends with.
const SETS: [&[&str]; 7] = [
    &["q0", "q1", "q2", "q3"],
    &["q1", "q2", "q3", "q4"],
    &["qx", "qy", "qz", "qw"],
    &["rx", "ry", "rz"],
    &["roll", "pitch", "yaw"],
    &["a", "b", "c"],
    &["w", "p", "r"],
];

/// The columns that seem to be an orientation.
pub(crate) fn orientation(header: &Header, columns: &[String]) -> Vec<String> {
    let numeric = |column: &&String| {
        let place = header.names.iter().position(|name| name == *column);
        place.is_some_and(|i| header.columns[i].iter().any(Option::is_some))
    };
    let columns: Vec<&String> = columns.iter().filter(numeric).collect();
    let by_word = columns.iter().filter(|column| {
        let words = name::words(column);
        words.iter().any(|word| WORDS.contains(&word.as_str()))
    });
    let by_word: Vec<String> = by_word.map(|column| (*column).clone()).collect();
    if by_word.len() >= 3 {
        return by_word;
    }
    let ends: Vec<(&String, String)> = columns.iter().map(|c| (*c, end(c))).collect();
    let have: BTreeSet<&str> = ends.iter().map(|(_, end)| end.as_str()).collect();
    let set = SETS
        .iter()
        .find(|set| set.iter().all(|name| have.contains(name)));
    let inside = |end: &String| set.is_some_and(|set| set.contains(&end.as_str()));
    let found = ends.iter().filter(|(_, end)| inside(end));
    found.map(|(column, _)| (*column).clone()).collect()
}

/// The last part of a name without its unit: `q0` of `tool.q0`, `roll` of `Roll [deg]`.
fn end(column: &str) -> String {
    const UNITS: [&str; 5] = ["deg", "rad", "grad", "m", "mm"];
    let mut words = name::words(column);
    while words.len() > 1 && words.last().is_some_and(|w| UNITS.contains(&w.as_str())) {
        words.pop();
    }
    let last = words.pop().unwrap_or_default();
    // A number belongs to the letter before it.
    match (last.parse::<u32>(), words.pop()) {
        (Ok(_), Some(letter)) => letter + &last,
        _ => last,
    }
}

/// The column that is called as times are, and holds text alone.
pub(crate) fn times(header: &Header, columns: &[String]) -> Option<String> {
    let empty = |column: &&String| {
        let place = header.names.iter().position(|name| name == *column);
        place.is_some_and(|i| header.columns[i].iter().all(Option::is_none))
    };
    let mut named = columns.iter().filter(|column| name::time(column).is_some());
    named.find(empty).cloned()
}

/// The columns of whole seconds and of the parts of a second, where one time stands in both: `stamp.sec` and `stamp.nanosec`.
pub(crate) fn parts(header: &Header) -> Option<(String, String)> {
    const WHOLE: [&str; 3] = ["sec", "secs", "seconds"];
    let split = |name: &String| {
        let mut words = name::words(name);
        words.pop().map(|last| (words, last))
    };
    let all = || {
        header
            .names
            .iter()
            .filter_map(|name| Some((name, split(name)?)))
    };
    let is_part = |last: &String| name::PARTS_OF_SECONDS.contains(&last.as_str());
    all().find_map(|(part, (of, last))| {
        let mut others = all().filter(|_| is_part(&last));
        let whole = others.find(|(_, (o, last))| *o == of && WHOLE.contains(&last.as_str()))?;
        Some((whole.0.clone(), part.clone()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_recording::Delimiter;

    fn header(names: &[&str], text: &[&str]) -> Header {
        Header {
            names: names.iter().map(|n| (*n).to_owned()).collect(),
            columns: names
                .iter()
                .map(|name| vec![(!text.contains(name)).then_some(0.5); 3])
                .collect(),
            dates: vec![false; names.len()],
            texts: vec![None; names.len()],
            decimal_comma: false,
            line: 1,
            skip: 0,
            place: crate::located::HeaderPlace::First,
            units: Vec::new(),
            delimiter: Delimiter::Comma,
        }
    }

    #[test]
    fn orientations_and_times_are_known_by_their_names() {
        for names in [
            vec!["q0", "q1", "q2", "q3"],
            vec!["A", "B", "C"],
            vec!["Roll [deg]", "Pitch [deg]", "Yaw [deg]"],
            vec!["tool.rx", "tool.ry", "tool.rz"],
            vec!["rot_x", "rot_y", "rot_z", "rot_w"],
        ] {
            let owned: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
            assert_eq!(orientation(&header(&names, &[]), &owned), owned);
        }
        let names = ["Nr", "temperature", "b", "quality"];
        let owned: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
        assert!(orientation(&header(&names, &[]), &owned).is_empty());
        let names = ["timestamp", "comment"];
        let owned: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
        let times_of = |text: &[&str]| times(&header(&names, text), &owned);
        assert_eq!(
            times_of(&["timestamp", "comment"]).as_deref(),
            Some("timestamp")
        );
        assert_eq!(times_of(&["comment"]), None);
    }
}
