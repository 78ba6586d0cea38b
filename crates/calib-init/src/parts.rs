//! What a column is of, by its name: a position, an angle, a part of a quaternion.

use crate::name;

/// Names of three angles, or of four numbers of a quaternion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Set {
    /// x, y, z, w, or the numbers of a quaternion.
    Quaternion,
    /// A quaternion's numbers in their order.
    Numbered,
    /// A rotation vector.
    Vector,
    /// `rx`, `rot_x`: a rotation vector or angles.
    AboutAxes,
    /// Angles about x, y, z: `roll`, `euler_x`.
    Angles,
    /// `a`, `b`, `c` of a KUKA controller: about z, y, x.
    Abc,
    /// `w`, `p`, `r` of a FANUC controller: about x, y, z.
    Wpr,
    /// `o`, `a`, `t` of a Kawasaki controller: about z, y, z.
    Oat,
    /// Greek letters in the order in which they are written: about x, y, z, or about z first.
    Greek,
    /// `omega`, `phi`, `kappa` of photogrammetry: about x, the new y and the new z.
    Omega,
}

/// What a column is of, by its name: what the columns of one thing have in common, its set or a position, and its place in it.
pub(crate) struct Part {
    pub of: String,
    pub set: Option<Set>,
    pub at: usize,
}

/// Words before the letter or number of a position.
const PLACES: [&str; 6] = ["position", "pos", "translation", "trans", "tvec", "xyz"];
/// Words before the letter or number of an orientation.
const TURNS: [&str; 10] = [
    "orientation",
    "orient",
    "ori",
    "attitude",
    "att",
    "rotation",
    "rot",
    "quaternion",
    "quat",
    "q",
];
/// Words before the letter of an angle.
const ANGLES: [&str; 7] = ["euler", "eul", "rpy", "angle", "angles", "ang", "theta"];
/// Words before the letter or number of a rotation vector.
const VECTORS: [&str; 7] = [
    "rvec",
    "rotvec",
    "rodrigues",
    "rotationvector",
    "rotvector",
    "rv",
    "aa",
];
/// Words that say of a body that it has a pose, or of numbers that they are several.
const FILLERS: [&str; 7] = [
    "pose",
    "transform",
    "field",
    "data",
    "vec",
    "vector",
    "axis",
];

impl Part {
    /// All readings of a name without its unit.
    pub fn all(stem: &str) -> Vec<Self> {
        let all = name::words(stem);
        let mut found = Vec::new();
        let Some((last, words)) = all.split_last() else {
            return found;
        };
        let mut add = |words: usize, behind: &str, set, at| {
            let of = of_words(stem, &all[..words], behind);
            found.push(Self { of, set, at });
        };
        let count = words.len();
        let before = words.last().map_or("", String::as_str);
        if let Ok(number) = last.parse::<usize>() {
            // `q0` beside `qx`, `qy` and `qz`.
            if number == 0 && before == "q" {
                add(count, "", Some(Set::Quaternion), 3);
            }
            if matches!(before, "q" | "quat" | "quaternion" | "orientation") {
                add(count, "", Some(Set::Numbered), number);
            } else if VECTORS.contains(&before) {
                add(count, "", Some(Set::Vector), number);
            } else if PLACES.contains(&before) {
                add(count, "", None, number);
            }
            // `rx1` is of the first body.
            if let Some((letter, words)) = words.split_last() {
                for (set, at) in of_letter(letter, words) {
                    add(words.len(), last, set, at);
                }
            }
        } else {
            for (set, at) in of_letter(last, words) {
                add(count, "", set, at);
            }
        }
        found
    }
}

/// The name of one thing: the words of a column before those of a position or an orientation, and without fillers.
pub(crate) fn of_words(stem: &str, words: &[String], behind: &str) -> String {
    let is_kind = |word: &String| {
        let kinds = [&PLACES[..], &TURNS, &ANGLES, &VECTORS, &FILLERS];
        kinds.iter().any(|kind| kind.contains(&word.as_str()))
    };
    let first = usize::from(words.first().is_some_and(|word| word == "field"));
    let end = words
        .iter()
        .rposition(|word| !is_kind(word))
        .map_or(0, |at| at + 1);
    let spans = name::spans(stem);
    let kept = match end > first {
        true => &stem[spans[first].start..spans[end - 1].end],
        false => "",
    };
    let plain = |c: char| c.is_alphanumeric() || matches!(c, '-' | '.');
    let kept: String = kept
        .chars()
        .map(|c| if plain(c) { c } else { '_' })
        .collect();
    match (kept.is_empty(), behind.is_empty()) {
        (false, false) => format!("{kept}_{behind}"),
        _ => kept + behind,
    }
}

/// What a letter, or a word of letters, may say behind these words.
fn of_letter(last: &str, words: &[String]) -> Vec<(Option<Set>, usize)> {
    let before = words.last().map_or("", String::as_str);
    let of = |letters: &[&str]| letters.iter().position(|letter| *letter == last);
    if let Some(at) = of(&["x", "y", "z", "w"]) {
        let pairs = [["rotation", "vector"], ["rot", "vec"], ["axis", "angle"]];
        let vector = pairs
            .iter()
            .any(|pair| words.ends_with(&pair.map(str::to_owned)));
        let set = match before {
            _ if (vector || VECTORS.contains(&before)) && at < 3 => Some(Set::Vector),
            word if TURNS.contains(&word) && at < 3 => Some(Set::AboutAxes),
            word if TURNS.contains(&word) => Some(Set::Quaternion),
            word if ANGLES.contains(&word) && at < 3 => Some(Set::Angles),
            _ => None,
        };
        if at < 3 || set.is_some() {
            return vec![(set, at)];
        }
    }
    const SETS: [(Option<Set>, &[&str]); 14] = [
        (Some(Set::Quaternion), &["qx", "qy", "qz", "qw"]),
        (Some(Set::AboutAxes), &["rx", "ry", "rz"]),
        (Some(Set::AboutAxes), &["rotx", "roty", "rotz"]),
        (Some(Set::Angles), &["ex", "ey", "ez"]),
        (Some(Set::Angles), &["roll", "pitch", "yaw"]),
        (Some(Set::Angles), &["", "", "heading"]),
        (Some(Set::Greek), &["phi", "theta", "psi"]),
        (Some(Set::Greek), &["alpha", "beta", "gamma"]),
        (Some(Set::Omega), &["omega", "phi", "kappa"]),
        (Some(Set::Abc), &["a", "b", "c"]),
        (Some(Set::Wpr), &["w", "p", "r"]),
        (Some(Set::Oat), &["o", "a", "t"]),
        (None, &["tx", "ty", "tz"]),
        (None, &["px", "py", "pz"]),
    ];
    // A letter may stand in several sets.
    let sets = SETS.into_iter();
    sets.filter_map(|(set, letters)| Some((set, of(letters)?)))
        .collect()
}

/// `T_x` as `pos_x`, `R_x` as `rot_x`.
pub(crate) fn in_words(stem: &str) -> String {
    let (letter, rest) = stem.split_at(stem.chars().next().map_or(0, char::len_utf8));
    if rest.starts_with(char::is_alphanumeric) {
        return stem.to_owned();
    }
    let word = match letter.to_lowercase().as_str() {
        "t" | "p" => "pos",
        "r" | "q" => "rot",
        _ => letter,
    };
    format!("{word}{rest}")
}
