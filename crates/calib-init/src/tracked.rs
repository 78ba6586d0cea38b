//! Columns of what a tracker sees: positions in threes, and the orientations beside them in the notations that are in use.
//!
//! A quaternion is known by its letters or its length, a [matrix](crate::matrix) by its names and numbers. Three angles are known as such by their names, which do not say in which order the rotations
//! follow each other, or whether they are a rotation vector: the usual way for such names is taken, and the others are kept for the motion to decide
//! ([`turns`](crate::turns)).

use std::collections::{BTreeMap, BTreeSet};

use calib_recording::{AngleUnit, BodyColumns, EulerAxes, EulerColumns};

use crate::fact::{About, Notation, TurnsHow};
use crate::guess::{Guess, TURN};
use crate::header::Header;
use crate::matrix::{self, Stated};
use crate::name::{self, NamedUnit};
use crate::parts::{self, Part, Set};

/// How far the length of a quaternion may be from 1.
const UNIT: f64 = 5e-3;

/// Columns of one thing: what stands around the letter → the columns by letter.
type Groups = BTreeMap<(String, String), [Option<usize>; 4]>;

/// Columns in threes (x, y, z) and in fours (a quaternion), but for those of joints.
pub(crate) fn tracked(
    header: &Header,
    guess: &mut Guess,
    used: &mut BTreeSet<usize>,
    joints: &BTreeSet<usize>,
) {
    let (mut places, mut turns) = (Groups::new(), Groups::new());
    let free = |i: &usize| !used.contains(i) && !joints.contains(i) && header.has_numbers(*i);
    let mut free: Vec<usize> = (0..header.names.len()).filter(free).collect();
    let stated = matrix::stated(header, &free);
    let matrices = matrix::columns(&stated);
    free.retain(|i| !matrices.contains(i));
    // `x` belongs to `qx`, and `X` beside it to something else.
    free.sort_by_key(|i| header.names[*i].contains(char::is_uppercase));
    for &i in &free {
        let unit = header.unit(i);
        if !matches!(unit.unit, None | Some(NamedUnit::Length(_))) {
            continue;
        }
        for (k, letter) in ['x', 'y', 'z', 'w'].into_iter().enumerate() {
            if let Some((before, behind)) = name::quaternion(unit.stem, letter) {
                let group = turns.entry((before.to_owned(), behind.to_owned()));
                group.or_default()[k].get_or_insert(i);
            } else if k < 3
                && let Some((before, behind)) = name::coordinate(unit.stem, letter)
                && !name::is_no_place(unit.stem)
            {
                let group = places.entry((before.to_owned(), behind.to_owned()));
                group.or_default()[k].get_or_insert(i);
            }
        }
    }
    let names = |columns: &[usize]| -> Vec<String> {
        columns.iter().map(|i| header.names[*i].clone()).collect()
    };
    let mut named: BTreeMap<String, [usize; 3]> = BTreeMap::new();
    for ((before, behind), columns) in &places {
        if let [Some(x), Some(y), Some(z), _] = *columns {
            named.insert(name::of_rest(before, behind, 'm'), [x, y, z]);
        }
    }
    for ((before, behind), columns) in &turns {
        let name = name::of_rest(before, behind, 'm');
        if let [Some(x), Some(y), Some(z), Some(w)] = *columns
            && let Some(position) = named.remove(&name)
        {
            used.extend(position.iter().chain(&[x, y, z, w]));
            let body = BodyColumns {
                position: names(&position).try_into().unwrap_or_default(),
                quaternion_xyzw: names(&[x, y, z, w]).try_into().ok(),
                ..BodyColumns::default()
            };
            guess.map.bodies.insert(name, body);
        }
    }
    // `T_x` and `R_x` may be two markers; where there are no others, they are a translation and a rotation.
    let letters: Vec<String> = named.keys().map(|name| name.to_lowercase()).collect();
    let pairs = [["r", "t"], ["p", "r"], ["p", "q"], ["q", "t"]];
    let single = pairs.iter().any(|pair| letters == *pair);
    other_notations(header, guess, used, (&free, single), stated);
    let has_bodies = !guess.map.bodies.is_empty();
    let column = |position: &[usize; 3]| header.names[position[0]].as_str();
    let quantity = |position: &[usize; 3]| {
        let is_bare = header.unit(position[0]).unit.is_none();
        is_bare && name::is_quantity(column(position))
    };
    // Beside `hand_1`, `F_x` is a force. Beside `B_x`, letters are the names of markers.
    let is_letter = |position: &[usize; 3]| {
        let words = name::words(column(position));
        matches!(words.as_slice(), [of, _] if of.len() == 1)
    };
    let mut places = named.values().filter(|p| !quantity(p)).peekable();
    let quantities = (has_bodies || places.peek().is_some()) && !places.any(is_letter);
    for (name, position) in named.iter().map(|(name, p)| (name.clone(), *p)) {
        if quantities && quantity(&position) {
            continue;
        }
        let is_used = position.iter().any(|i| used.contains(i));
        if is_used || name::is_no_position(&header.names[position[0]]) {
            continue;
        }
        used.extend(position);
        let position = names(&position).try_into().unwrap_or_default();
        guess.map.markers.insert(name, position);
    }
}

/// Positions with an orientation beside them in another notation than `qx` to `qw`.
fn other_notations(
    header: &Header,
    guess: &mut Guess,
    used: &mut BTreeSet<usize>,
    (free, single): (&[usize], bool),
    mut stated: BTreeMap<String, Stated>,
) {
    let mut places: BTreeMap<String, BTreeMap<usize, usize>> = BTreeMap::new();
    let mut turns: BTreeMap<String, BTreeMap<Set, BTreeMap<usize, usize>>> = BTreeMap::new();
    // `x` is a position before `Tx` is, which may be a torque.
    let is_plain = |i: &usize| {
        let words = name::words(header.unit(*i).stem);
        words
            .last()
            .is_some_and(|last| matches!(last.as_str(), "x" | "y" | "z"))
    };
    let open = free.iter().copied().filter(|i| !used.contains(i));
    let (plain, others): (Vec<usize>, Vec<usize>) = open.partition(is_plain);
    for i in plain.into_iter().chain(others) {
        let unit = header.unit(i);
        if name::is_no_place(unit.stem) {
            continue;
        }
        let stem = match single {
            true => parts::in_words(unit.stem),
            false => unit.stem.to_owned(),
        };
        for part in Part::all(&stem) {
            let fits = match (part.set, unit.unit) {
                (_, None) => true,
                (None, Some(NamedUnit::Length(_))) => true,
                (Some(set), Some(NamedUnit::Angle(_))) => set > Set::Numbered,
                _ => false,
            };
            if !fits {
                continue;
            }
            match part.set {
                None => places.entry(part.of).or_default(),
                Some(set) => turns.entry(part.of).or_default().entry(set).or_default(),
            }
            .entry(part.at)
            .or_insert(i);
        }
    }
    for (of, matrix) in &stated {
        if let Some(place) = matrix.place {
            places.insert(of.clone(), place.into_iter().enumerate().collect());
        }
    }
    for (of, place) in places {
        let Some(place) = in_order::<3>(&place) else {
            continue;
        };
        let is_free = |columns: &[usize]| columns.iter().all(|i| !used.contains(i));
        let orientation = match stated.remove(&of) {
            Some(matrix) => Some((matrix.used, matrix.ways)),
            None => turns.get(&of).and_then(|sets| orientation(header, sets)),
        };
        let Some((columns, mut ways)) = orientation.filter(|(columns, _)| is_free(columns)) else {
            continue;
        };
        if !is_free(&place) {
            continue;
        }
        used.extend(place.iter().chain(&columns));
        for way in &mut ways {
            way.position = place.map(|i| header.names[i].clone());
        }
        let body = ways.remove(0);
        // A number alone is no name.
        let name = match of.parse::<u32>() {
            Ok(number) => format!("m{number}"),
            Err(_) if of.is_empty() => "m".to_owned(),
            Err(_) => of,
        };
        let is_taken = |name: &String| guess.map.bodies.contains_key(name);
        let mut names = std::iter::once(name.clone()).chain((2..).map(|k| format!("{name}_{k}")));
        let name = names.find(|name| !is_taken(name)).unwrap_or(name);
        if !ways.is_empty() {
            guess.other_turns.insert(name.clone(), ways);
        }
        guess.map.bodies.insert(name, body);
    }
}

/// Columns by their numbers, which count from 0 or from 1.
fn in_order<const N: usize>(columns: &BTreeMap<usize, usize>) -> Option<[usize; N]> {
    let first = *columns.keys().next()?;
    let all: Vec<usize> = (first..first + N)
        .filter_map(|at| columns.get(&at).copied())
        .collect();
    let whole = first < 2 && columns.len() == N;
    all.try_into().ok().filter(|_| whole)
}

/// The orientation of a body: its columns, and how they may be read, the usual way first.
fn orientation(
    header: &Header,
    sets: &BTreeMap<Set, BTreeMap<usize, usize>>,
) -> Option<(Vec<usize>, Vec<BodyColumns>)> {
    let names = |columns: &[usize]| -> Vec<String> {
        columns.iter().map(|i| header.names[*i].clone()).collect()
    };
    let numbers = |set: Set| sets.get(&set).into_iter().flatten();
    // `rot_x` to `rot_z` beside `rot_w`.
    let letters = numbers(Set::AboutAxes).chain(numbers(Set::Quaternion));
    let letters: BTreeMap<usize, usize> = letters.map(|(at, i)| (*at, *i)).collect();
    if let Some(columns) = in_order::<4>(&letters) {
        if !is_unit(header, &columns) {
            return None;
        }
        let way = BodyColumns {
            quaternion_xyzw: names(&columns).try_into().ok(),
            ..BodyColumns::default()
        };
        return Some((columns.to_vec(), vec![way]));
    }
    if let Some(columns) = sets.get(&Set::Numbered).and_then(in_order::<4>)
        && is_unit(header, &columns)
    {
        // `q0` is the scalar part nearly everywhere; if not, the motion shows it.
        let way = BodyColumns {
            quaternion_wxyz: names(&columns).try_into().ok(),
            ..BodyColumns::default()
        };
        return Some((columns.to_vec(), vec![way]));
    }
    let angles = sets.iter().filter(|(set, _)| **set > Set::Numbered);
    angles.into_iter().find_map(|(set, columns)| {
        let columns = in_order::<3>(columns)?;
        let degrees = unit_of(header, &columns).1 == AngleUnit::Deg;
        let of: [String; 3] = names(&columns).try_into().ok()?;
        // One way twice would seem to be two that the motion does not distinguish.
        let mut distinct: Vec<BodyColumns> = Vec::new();
        for way in ways(*set, &of, degrees) {
            if distinct
                .iter()
                .all(|d| Notation::of(d) != Notation::of(&way))
            {
                distinct.push(way);
            }
        }
        Some((columns.to_vec(), distinct))
    })
}

/// Whether four columns are quaternions in all of their rows.
fn is_unit(header: &Header, columns: &[usize; 4]) -> bool {
    let rows = header.columns[columns[0]].len();
    let length = |row: usize| {
        let squares = columns.map(|i| header.columns[i][row].map(|x| x * x));
        squares.into_iter().sum::<Option<f64>>().map(f64::sqrt)
    };
    let mut lengths = (0..rows)
        .filter_map(length)
        .filter(|l| *l != 0.0)
        .peekable();
    lengths.peek().is_some() && lengths.all(|l| (l - 1.0).abs() < UNIT)
}

/// How three columns may be read, the usual way first.
fn ways(set: Set, columns: &[String; 3], degrees: bool) -> Vec<BodyColumns> {
    let vector = BodyColumns {
        rotation_vector: Some(columns.clone()),
        ..BodyColumns::default()
    };
    let euler = |axes: EulerAxes, columns: [String; 3]| BodyColumns {
        euler: Some(EulerColumns { axes, columns }),
        ..BodyColumns::default()
    };
    // Columns about x, y and z, in the order of the axes.
    let about = |axes: EulerAxes| match axes {
        EulerAxes::Zyx => BodyColumns {
            fixed_xyz: Some(columns.clone()),
            ..BodyColumns::default()
        },
        _ => euler(axes, axes.axes().map(|axis| columns[axis].clone())),
    };
    let orders = [
        EulerAxes::Zyx,
        EulerAxes::Xyz,
        EulerAxes::Zxy,
        EulerAxes::Yxz,
        EulerAxes::Yzx,
        EulerAxes::Xzy,
    ];
    let orders = || orders.into_iter().map(about);
    let written = |axes: EulerAxes| std::iter::once(euler(axes, columns.clone()));
    match set {
        Set::Quaternion | Set::Numbered => Vec::new(),
        Set::Vector => vec![vector],
        Set::AboutAxes if degrees => orders().chain([vector]).collect(),
        Set::AboutAxes => std::iter::once(vector).chain(orders()).collect(),
        Set::Angles | Set::Wpr => orders().chain([vector]).collect(),
        Set::Abc => written(EulerAxes::Zyx).chain(orders()).collect(),
        Set::Oat => written(EulerAxes::Zyz)
            .chain(written(EulerAxes::Zyx))
            .collect(),
        Set::Omega => written(EulerAxes::Xyz).chain(orders()).collect(),
        Set::Greek => {
            let others = [EulerAxes::Zyx, EulerAxes::Zyz, EulerAxes::Zxz];
            orders()
                .chain(others.into_iter().flat_map(written))
                .collect()
        }
    }
}

/// The unit of some angles, and whether the readers find it in their names.
fn unit_of(header: &Header, columns: &[usize]) -> (bool, AngleUnit) {
    let named = columns.iter().find_map(|i| {
        let unit = header.unit(*i);
        match unit.unit {
            Some(NamedUnit::Angle(angle)) => Some((unit.native, angle)),
            _ => None,
        }
    });
    let largest = columns.iter().map(|i| header.largest(*i));
    let by_size = match largest.fold(0.0, f64::max) > TURN {
        true => AngleUnit::Deg,
        false => AngleUnit::Rad,
    };
    named.unwrap_or((false, by_size))
}

/// States the unit of orientations where it is another one than that of the joints, and says how they are read.
pub(crate) fn unit_of_turns(header: &Header, guess: &mut Guess) {
    for (body, columns) in &guess.map.bodies {
        let Some((notation, names)) = Notation::of(columns) else {
            continue;
        };
        let of: Vec<usize> = names.iter().filter_map(|n| header.position(n)).collect();
        let mut unit = None;
        if notation.has_angles() {
            let (_, angle) = unit_of(header, &of);
            if angle != guess.map.angles {
                guess.map.body_angles = Some(angle);
            }
            unit = Some(angle);
        } else if !matches!(notation, Notation::Quaternion { scalar_first: true }) {
            continue;
        }
        // What the motion is to decide is said then.
        if !guess.other_turns.contains_key(body) {
            guess.facts.push(About::Turns {
                columns: names,
                notation,
                unit,
                how: TurnsHow::Named,
            });
        }
    }
}
