//! Columns of a rotation matrix, of a homogeneous matrix, or of an axis and an angle: names alone are not enough, the numbers must be rotations.

use std::collections::{BTreeMap, BTreeSet};

use calib_recording::BodyColumns;
use nalgebra::{Matrix3, Vector3};

use crate::header::Header;
use crate::name::{self, NamedUnit};
use crate::parts;

/// How far RᵀR may be from I, and the length of an axis from 1.
const ROTATION: f64 = 5e-3;

/// Words before the two numbers of an entry.
const MATRICES: [&str; 15] = [
    "r",
    "rot",
    "rotation",
    "rotmat",
    "rm",
    "dcm",
    "m",
    "mat",
    "matrix",
    "t",
    "tf",
    "h",
    "transform",
    "pose",
    "xform",
];

/// An orientation that columns state.
pub(crate) struct Stated {
    /// All columns that belong to it, also those of a homogeneous matrix that are always 0 or 1.
    pub used: Vec<usize>,
    /// How it may be read, the usual way first.
    pub ways: Vec<BodyColumns>,
    /// The columns of the position, where they are of the same matrix.
    pub place: Option<[usize; 3]>,
}

/// How the entries of a matrix are named.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Entries {
    /// `r11`, `R_1_1`: the row and the column.
    Numbers,
    /// `r1` to `r9`: one after the other.
    Counted,
    /// `nx`, `oy`, `az`: the axis of the body, which is a column, and the coordinate.
    Axes,
    /// `rxy`: the row and the column.
    Letters,
}

/// Orientations by the name of their body.
pub(crate) fn stated(header: &Header, free: &[usize]) -> BTreeMap<String, Stated> {
    let mut found: BTreeMap<String, Stated> = BTreeMap::new();
    let bare: Vec<usize> = free
        .iter()
        .copied()
        .filter(|i| header.unit(*i).unit.is_none())
        .collect();
    let mut groups: BTreeMap<(String, Entries), BTreeMap<(usize, usize), usize>> = BTreeMap::new();
    for &i in &bare {
        let stem = header.unit(i).stem;
        let words = name::words(stem);
        for (words, entries, at) in entry(&words).into_iter().chain(counted(&words)) {
            let of = parts::of_words(stem, &words, "");
            let group = groups.entry((of, entries)).or_default();
            group.entry(at).or_insert(i);
        }
    }
    for ((of, entries), group) in groups {
        if let Some(matrix) = matrix(header, entries, &group) {
            found.entry(of).or_insert(matrix);
        }
    }
    for (of, stated) in axes(header, free, &bare) {
        found.entry(of).or_insert(stated);
    }
    found
}

fn is_matrix(words: &[String]) -> bool {
    let last = words.last();
    last.is_some_and(|word| MATRICES.contains(&word.as_str()))
}

/// What is left of `pose_R` is `pose`, which says no more.
fn without(words: &[String]) -> Vec<String> {
    let mut words = words.to_vec();
    while is_matrix(&words) {
        words.pop();
    }
    words
}

/// An entry that is counted, and what stands before it.
fn counted(words: &[String]) -> Option<(Vec<String>, Entries, (usize, usize))> {
    let (last, before) = words.split_last().filter(|(_, of)| is_matrix(of))?;
    Some((without(before), Entries::Counted, (0, last.parse().ok()?)))
}

/// The words before those of an entry of a matrix, how it is named, and its row and column.
fn entry(words: &[String]) -> Option<(Vec<String>, Entries, (usize, usize))> {
    let digit = |word: &str| word.parse::<usize>().ok().filter(|_| word.len() == 1);
    let letter = |c: &str, of: &str| of.find(c).filter(|_| c.len() == 1);
    let (last, before) = words.split_last()?;
    if let Some((first, of)) = before.split_last()
        && let (Some(row), Some(column)) = (digit(first), digit(last))
        && is_matrix(of)
    {
        return Some((without(of), Entries::Numbers, (row, column)));
    }
    if is_matrix(before)
        && let (2, Some(row), Some(column)) = (
            last.len(),
            last.get(..1).and_then(digit),
            last.get(1..).and_then(digit),
        )
    {
        return Some((without(before), Entries::Numbers, (row, column)));
    }
    let pair = |two: &str, rows: &str, columns: &str| {
        let (a, b) = (two.get(..1)?, two.get(1..)?);
        Some((letter(a, rows)?, letter(b, columns)?))
    };
    let three = last.strip_prefix('r').unwrap_or(last);
    if (three.len() < last.len() || is_matrix(before))
        && let Some(at) = pair(three, "xyz", "xyz")
    {
        return Some((without(before), Entries::Letters, at));
    }
    let (axis, of) = match before.split_last() {
        Some((axis, of)) if last.len() == 1 => (format!("{axis}{last}"), of),
        _ => (last.clone(), before),
    };
    let (column, row) = pair(&axis, "noa", "xyz")?;
    Some((without(of), Entries::Axes, (row, column)))
}

/// A matrix from its entries, if they are all there and the numbers are rotations.
fn matrix(
    header: &Header,
    entries: Entries,
    group: &BTreeMap<(usize, usize), usize>,
) -> Option<Stated> {
    let first = group.keys().next()?.1;
    // Counted entries are three or four in a row of the matrix.
    let in_row = if group.len() == 9 { 3 } else { 4 };
    let placed = |(&(row, column), &i): (&(usize, usize), &usize)| match entries {
        Entries::Counted => {
            let at = column - first;
            ((at / in_row, at % in_row), i)
        }
        Entries::Numbers => ((row - first.min(row), column - first.min(column)), i),
        Entries::Axes | Entries::Letters => ((row, column), i),
    };
    let at: BTreeMap<(usize, usize), usize> = group.iter().map(placed).collect();
    if first > 1 || !matches!(group.len(), 9 | 12 | 16) || at.len() != group.len() {
        return None;
    }
    let places = (0..9).map(|k| at.get(&(k / 3, k % 3)).copied());
    let columns: [usize; 9] = places.collect::<Option<Vec<_>>>()?.try_into().ok()?;
    if !is_rotation(header, &columns) {
        return None;
    }
    let three = |entry: fn(usize) -> (usize, usize)| -> Option<[usize; 3]> {
        let all = (0..3).map(|k| at.get(&entry(k)).copied());
        all.collect::<Option<Vec<_>>>()?.try_into().ok()
    };
    let moves = |of: &[usize; 3]| of.iter().any(|i| header.largest(*i) > 0.0);
    let right = three(|k| (k, 3)).filter(moves);
    let below = three(|k| (3, k)).filter(moves);
    let names = |columns: [usize; 9]| BodyColumns {
        rotation_matrix: Some(columns.map(|i| header.names[i].clone())),
        ..BodyColumns::default()
    };
    let [a, b, c, d, e, f, g, h, i] = columns;
    let by_rows = names(columns);
    let by_columns = names([a, d, g, b, e, h, c, f, i]);
    // The position stands in the last column; entries that are written column by column have it in the last row.
    let (ways, place) = match (right, below) {
        (Some(place), None) => (vec![by_rows], Some(place)),
        (None, Some(place)) => (vec![by_columns], Some(place)),
        _ if entries == Entries::Axes => (vec![by_rows], None),
        _ => (vec![by_rows, by_columns], None),
    };
    Some(Stated {
        used: group.values().copied().collect(),
        ways,
        place,
    })
}

/// Whether nine columns are rotations in all rows that have them.
fn is_rotation(header: &Header, columns: &[usize; 9]) -> bool {
    let rows = header.columns[columns[0]].len();
    let at = |row: usize| {
        let numbers = columns.map(|i| header.columns[i][row]);
        let numbers: Option<Vec<f64>> = numbers.into_iter().collect();
        Some(Matrix3::from_row_slice(&numbers?))
    };
    let mut given = (0..rows)
        .filter_map(at)
        .filter(|m| m.amax() > 0.0)
        .peekable();
    let turned = |m: Matrix3<f64>| {
        let off = (m.transpose() * m - Matrix3::identity()).amax();
        off <= ROTATION && m.determinant() > 0.0
    };
    given.peek().is_some() && given.all(turned)
}

/// Axes with the angle about them: `axis_x`, `axis_y`, `axis_z` and `angle`, or `ux`, `uy`, `uz` and `theta`.
fn axes(header: &Header, free: &[usize], bare: &[usize]) -> BTreeMap<String, Stated> {
    const ANGLES: [&str; 3] = ["angle", "theta", "phi"];
    let mut vectors: BTreeMap<String, BTreeMap<usize, usize>> = BTreeMap::new();
    let mut angles: BTreeMap<String, usize> = BTreeMap::new();
    for &i in free {
        let unit = header.unit(i);
        let words = name::words(unit.stem);
        let Some((last, before)) = words.split_last() else {
            continue;
        };
        let is_angle = matches!(unit.unit, None | Some(NamedUnit::Angle(_)));
        if is_angle && ANGLES.contains(&last.as_str()) {
            let of = parts::of_words(unit.stem, before, "");
            angles.entry(of).or_insert(i);
        }
        if !bare.contains(&i) {
            continue;
        }
        let letters = ["x", "y", "z"];
        let joined = letters.iter().position(|l| {
            ["a", "u", "k", "e", "axis"]
                .iter()
                .any(|a| *last == format!("{a}{l}"))
        });
        let of_axis = before.last().is_some_and(|word| word == "axis");
        let single = letters.iter().position(|l| last == l).filter(|_| of_axis);
        if let Some(at) = joined.or(single) {
            let of = parts::of_words(unit.stem, before, "");
            vectors.entry(of).or_default().entry(at).or_insert(i);
        }
    }
    let of = |(of, vector): (String, BTreeMap<usize, usize>)| {
        let columns: Vec<usize> = vector.into_values().collect();
        let axis: [usize; 3] = columns.try_into().ok()?;
        let angle = *angles.get(&of)?;
        let rows = header.columns[angle].len();
        let at = |row: usize| {
            let [x, y, z] = axis.map(|i| header.columns[i][row]);
            Some((Vector3::new(x?, y?, z?), header.columns[angle][row]?))
        };
        let mut given = (0..rows)
            .filter_map(at)
            .filter(|(_, angle)| *angle != 0.0)
            .peekable();
        let is_axis = |(axis, _): (Vector3<f64>, f64)| (axis.norm() - 1.0).abs() <= ROTATION;
        if given.peek().is_none() || !given.all(is_axis) {
            return None;
        }
        let [x, y, z] = axis;
        let columns = [x, y, z, angle];
        let way = BodyColumns {
            axis_angle: Some(columns.map(|i| header.names[i].clone())),
            ..BodyColumns::default()
        };
        let stated = Stated {
            used: columns.to_vec(),
            ways: vec![way],
            place: None,
        };
        Some((of, stated))
    };
    vectors.into_iter().filter_map(of).collect()
}

/// Columns that are no positions, whatever their names.
pub(crate) fn columns(stated: &BTreeMap<String, Stated>) -> BTreeSet<usize> {
    let all = stated.values().flat_map(|one| &one.used);
    all.copied().collect()
}
