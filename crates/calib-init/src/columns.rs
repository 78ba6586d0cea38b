//! Columns of somebody else's table: which are joints of this robot, which are markers and bodies, and in what units.
//!
//! A name that is a joint's, up to words such as `joint` or `actual`, decides. Columns that are only numbered (`q1` … `q6`) go to the joints of a
//! chain in their order from the root, and the order is tested by the motion afterwards ([`links`](crate::links)). Units stand in the names, or follow
//! from the largest numbers: no joint moves by more than a turn and a bit, and no marker is further away than the robot reaches many times.

use std::collections::{BTreeMap, BTreeSet};

use calib_recording::{AngleUnit, BodyColumns, LengthUnit, TimeColumn, TimeUnit};
use calib_urdf::{JointId, JointKind, RobotModel};

use crate::fact::{About, AngleHow, LengthHow, Notation};
use crate::guess::{Guess, TURN};
use crate::header::Header;
use crate::located::HeaderPlace;
use crate::name::{self, NamedUnit};
use crate::robot;
use crate::tracked;
use crate::unread;

/// Markers spread over so many times the robot's reach are not in meters.
const FAR: f64 = 20.0;

/// The map of a table.
#[must_use]
pub fn guess(model: &RobotModel, header: &Header) -> Guess {
    let mut guess = Guess::default();
    guess.map.decimal_comma = header.decimal_comma;
    if header.place != HeaderPlace::First {
        guess.map.skip_lines = header.skip;
        guess.map.delimiter = Some(header.delimiter);
    }
    if header.place == HeaderPlace::Comment {
        guess.map.names.clone_from(&header.names);
    }
    let mut used: BTreeSet<usize> = BTreeSet::new();
    time(header, &mut guess, &mut used);
    let (stated, mut named) = like_coordinates(model, header);
    let of_pose = angles_of_a_pose(model, header, &stated, &named);
    named.retain(|i| !of_pose.contains(i));
    // The columns `x`, `y` and `z` are a marker where the table has no other.
    let both: BTreeSet<usize> = stated.union(&named).copied().collect();
    tracked::tracked(header, &mut guess, &mut used, &both);
    if guess.map.markers.is_empty() && guess.map.bodies.is_empty() {
        tracked::tracked(header, &mut guess, &mut used, &stated);
    }
    joints(model, header, &mut guess, &mut used);
    angles(model, header, &mut guess);
    lengths(model, header, &mut guess);
    tracked::unit_of_turns(header, &mut guess);
    let ignored =
        (0..header.names.len()).filter(|i| !used.contains(i) && !header.names[*i].is_empty());
    let ignored: Vec<String> = ignored.map(|i| header.names[i].clone()).collect();
    if !ignored.is_empty() {
        let time = guess.map.time.is_none();
        let of_joint = |column: &&String| {
            let numbers = header
                .position(column)
                .is_some_and(|i| header.has_numbers(i));
            let stem = name::unit(column).stem;
            numbers && name::numbered(stem).is_some() && name::is_of_joints(stem)
        };
        let alike: Vec<String> = ignored.iter().filter(of_joint).cloned().collect();
        guess.facts.push(About::Ignored {
            // A body that has one is no point without them.
            orientation: match guess.map.bodies.is_empty() {
                true => unread::orientation(header, &ignored),
                false => Vec::new(),
            },
            joints: if alike.len() > 1 { alike } else { Vec::new() },
            times: time.then(|| unread::times(header, &ignored)).flatten(),
            parts: time.then(|| unread::parts(header)).flatten(),
            columns: ignored,
        });
    }
    guess
}

/// A column of time: named so, with numbers that never decrease.
fn time(header: &Header, guess: &mut Guess, used: &mut BTreeSet<usize>) {
    let rank = |i: usize| name::time(&header.names[i]);
    // Seconds whose parts stand in a column of their own are too coarse to be one.
    let parts = |i: &usize| {
        let words = name::words(&header.names[*i]);
        words
            .iter()
            .any(|w| name::PARTS_OF_SECONDS.contains(&w.as_str()))
    };
    let in_parts = (0..header.names.len()).any(|i| parts(&i));
    let whole = |i: &usize| {
        let t = || header.columns[*i].iter().flatten();
        !(in_parts && t().all(|t| t.fract() == 0.0))
    };
    let rises = |i: &usize| {
        let t: Vec<f64> = header.columns[*i].iter().flatten().copied().collect();
        t.len() > 1 && t.windows(2).all(|pair| pair[1] >= pair[0]) && t[t.len() - 1] > t[0]
    };
    let named = (0..header.names.len()).filter(|i| rank(*i).is_some() && !parts(i));
    let Some(i) = named
        .filter(|i| whole(i) && rises(i))
        .min_by_key(|i| rank(*i))
    else {
        return;
    };
    let stated = match header.unit(i).unit {
        _ if header.dates[i] => Some(TimeUnit::S),
        Some(NamedUnit::Time(unit)) => Some(unit),
        _ => None,
    };
    let unit = stated.unwrap_or_else(|| unit_of_time(&header.columns[i]));
    used.insert(i);
    guess.map.time = Some(TimeColumn {
        column: header.names[i].clone(),
        unit,
    });
    guess.facts.push(About::Time {
        column: header.names[i].clone(),
        unit,
        named: stated.is_some(),
    });
}

/// Whether nearly all times are a step apart.
fn is_even(t: &[f64], step: f64) -> bool {
    let apart = t.windows(2).map(|pair| pair[1] - pair[0]);
    let even = apart.filter(|d| (d - step).abs() < 0.3 * step).count();
    10 * even >= 9 * (t.len() - 1)
}

/// Seconds, unless the numbers are those of a clock since 1970 in a smaller unit, or steps of many that are whole or equal.
fn unit_of_time(column: &[Option<f64>]) -> TimeUnit {
    let t: Vec<f64> = column.iter().flatten().copied().collect();
    let last = t.last().copied().unwrap_or(0.0);
    let whole = t.iter().all(|t| t.fract() == 0.0);
    let step = if t.len() > 1 {
        (last - t[0]) / (t.len() - 1) as f64
    } else {
        0.0
    };
    match last {
        x if x > 1e17 => TimeUnit::Ns,
        x if x > 1e14 => TimeUnit::Us,
        x if x > 1e11 => TimeUnit::Ms,
        _ if whole && (1.0..=200.0).contains(&step) && t.len() > 100 => TimeUnit::Ms,
        // Nobody takes a hundred poses at equal intervals of five seconds and more.
        _ if (5.0..=200.0).contains(&step) && t.len() > 100 && is_even(&t, step) => TimeUnit::Ms,
        _ => TimeUnit::S,
    }
}

/// What stands before the name of a joint that would read as something else.
const JOINT: &str = "joint:";

/// The name of a joint's column without its unit and without [`JOINT`].
fn stem_of(column: &str) -> &str {
    let stem = name::unit(column).stem;
    stem.strip_prefix(JOINT).unwrap_or(stem)
}

/// Whether a column is called as a joint, or by the same words beside such as `actual`: `actual_X`.
fn is_named(joint: &str, stem: &str) -> bool {
    let key = name::key(joint);
    let alike = || key == name::key(stem) && key.chars().any(char::is_alphabetic);
    // A `pos_x` is as well that of a marker.
    let of_place = || name::words(stem).iter().any(|word| word.starts_with("pos"));
    joint == stem || (alike() && !of_place() && !name::is_no_position(stem))
}

/// Columns with the names of joints that are called like coordinates: those with [`JOINT`] before them, and the others.
fn like_coordinates(model: &RobotModel, header: &Header) -> (BTreeSet<usize>, BTreeSet<usize>) {
    let of_joint = |i: &usize| {
        let column = &header.names[*i];
        let mut joints = model.independent_joints();
        joints
            .any(|j| is_named(&model.joint(j).name, stem_of(column)) && fits(model, j, header, *i))
    };
    let all = (0..header.names.len()).filter(of_joint);
    all.partition(|i| header.names[*i].starts_with(JOINT))
}

/// Columns that have the names of joints, such as `yaw`, and are the orientation of a body: a position stands beside them, and other columns are those
/// of the joints.
fn angles_of_a_pose(
    model: &RobotModel,
    header: &Header,
    stated: &BTreeSet<usize>,
    named: &BTreeSet<usize>,
) -> BTreeSet<usize> {
    let mut seen = Guess::default();
    tracked::tracked(header, &mut seen, &mut BTreeSet::new(), stated);
    let is_named = |column: &String| header.position(column).is_some_and(|i| named.contains(&i));
    let of_body = |body: &BodyColumns| -> Vec<usize> {
        let turns = Notation::of(body).map_or_else(Vec::new, |(_, columns)| columns);
        let all = !body.position.iter().any(is_named) && turns.iter().all(is_named);
        let turns = turns.iter().filter(|_| all);
        turns.filter_map(|column| header.position(column)).collect()
    };
    let angles: BTreeSet<usize> = seen.map.bodies.values().flat_map(of_body).collect();
    if angles.is_empty() {
        return angles;
    }
    let count = |without: &BTreeSet<usize>| {
        let (mut guess, mut used) = (Guess::default(), without.clone());
        joints(model, header, &mut guess, &mut used);
        guess.joints.len()
    };
    match count(&angles) >= count(&BTreeSet::new()) {
        true => angles,
        false => BTreeSet::new(),
    }
}

/// Columns of joints.
fn joints(model: &RobotModel, header: &Header, guess: &mut Guess, used: &mut BTreeSet<usize>) {
    let free = |used: &BTreeSet<usize>, i: &usize| !used.contains(i) && header.has_numbers(*i);
    let mut found = by_texts(model, header, used);
    let stem = |i: usize| stem_of(&header.names[i]);
    let mut unnamed: Vec<JointId> = model.independent_joints().collect();
    unnamed.retain(|joint| !found.contains_key(joint));
    for joint in unnamed {
        let wanted = &model.joint(joint).name;
        let columns = (0..header.names.len()).filter(|i| free(used, i));
        let columns: Vec<usize> = columns.filter(|i| fits(model, joint, header, *i)).collect();
        // The joint's own name, else its words.
        let exact = columns
            .iter()
            .find(|i| stem(**i) == wanted || header.names[**i] == *wanted);
        // A number alone is no name: some count from 0, some from 1.
        let key = name::key(wanted);
        let told = key.chars().any(char::is_alphabetic);
        let mut alike = columns
            .iter()
            .filter(|i| told && name::key(stem(**i)) == key && !name::is_no_position(stem(**i)));
        let column = exact.or_else(|| alike.next());
        if let Some(column) = column {
            found.insert(joint, *column);
            used.insert(*column);
        }
    }
    let by_name = found.len();
    // A rail with its own name beside an arm whose columns are numbered.
    let beside = match by_name {
        1 => family(model, header, used, &found),
        _ => None,
    };
    if let Some(family) = beside {
        guess.by_order = true;
        used.extend(family.values());
        found.extend(family);
    // One column alone may have a joint's name by chance.
    } else if by_name < 2
        && let Some(family) = family(model, header, used, &BTreeMap::new())
    {
        found.values().for_each(|i| {
            used.remove(i);
        });
        guess.by_order = true;
        found = family;
        used.extend(found.values());
    }
    let pairs = |found: &BTreeMap<JointId, usize>| -> Vec<(String, String)> {
        let of = |(joint, i): (&JointId, &usize)| {
            (model.joint(*joint).name.clone(), header.names[*i].clone())
        };
        found.iter().map(of).collect()
    };
    if guess.by_order {
        guess.facts.push(About::JointsByOrder {
            pairs: pairs(&found),
        });
    } else if !found.is_empty() {
        guess.facts.push(About::JointsByName { count: found.len() });
    }
    for (joint, column) in &found {
        let name = model.joint(*joint).name.clone();
        let column = header.names[*column].clone();
        guess.joints.push((*joint, column.clone()));
        match model.joint(*joint).kind {
            JointKind::Prismatic { .. } => {
                guess.map.prismatic.insert(name, column);
            }
            _ if name == column => guess.map.joint_columns.push(name),
            _ => {
                guess.map.joints.insert(name, column);
            }
        }
    }
}

/// Joints whose names stand in the cells of a column beside each: `field.name0` and `field.position0` of `rostopic echo -p`. The columns of positions
/// are used, also where a name is that of no joint or changes from row to row: their order says nothing.
fn by_texts(
    model: &RobotModel,
    header: &Header,
    used: &mut BTreeSet<usize>,
) -> BTreeMap<JointId, usize> {
    let mut found = BTreeMap::new();
    for (i, name) in header.names.iter().enumerate() {
        let Some((before, number, "")) = name::numbered(name) else {
            continue;
        };
        let Some(position) = before
            .strip_suffix("name")
            .and_then(|of| header.position(&format!("{of}position{number}")))
            .filter(|_| !header.has_numbers(i))
        else {
            continue;
        };
        used.insert(position);
        let mut joints = model.independent_joints();
        let text = header.texts[i].as_ref();
        if let Some(joint) = joints.find(|j| Some(&model.joint(*j).name) == text) {
            used.insert(i);
            found.insert(joint, position);
        }
    }
    found
}

/// The unit of a column, in its name or in a row of units, does not speak against the joint.
fn fits(model: &RobotModel, joint: JointId, header: &Header, column: usize) -> bool {
    let in_row = header.units.get(column).copied().flatten();
    // A joint may have a unit's word in its own name.
    let unit = match model.joint(joint).name == header.names[column] {
        true => in_row.map(NamedUnit::from),
        false => header.unit(column).unit,
    };
    match unit {
        Some(NamedUnit::Angle(_)) => model.joint(joint).kind.turns(),
        Some(NamedUnit::Length(_)) => !model.joint(joint).kind.turns(),
        Some(NamedUnit::Time(_) | NamedUnit::Other) => false,
        None => true,
    }
}

/// Numbered columns for the joints of a chain, in their order from the root; for all joints of a chain but those that are `known`.
fn family(
    model: &RobotModel,
    header: &Header,
    used: &BTreeSet<usize>,
    known: &BTreeMap<JointId, usize>,
) -> Option<BTreeMap<JointId, usize>> {
    let mut families: BTreeMap<(String, String), Vec<(u32, usize)>> = BTreeMap::new();
    for i in (0..header.names.len()).filter(|i| !used.contains(i) && header.has_numbers(*i)) {
        if name::is_no_position(&header.names[i]) {
            continue;
        }
        if let Some((before, number, behind)) = name::numbered(&header.names[i]) {
            let key = (before.to_owned(), behind.to_owned());
            families.entry(key).or_default().push((number, i));
        }
    }
    let chains: Vec<Vec<JointId>> = robot::tips(model)
        .into_iter()
        .map(|tip| tip.joints)
        .filter(|joints| known.keys().all(|joint| joints.contains(joint)))
        .map(|joints| {
            let rest = joints.into_iter().filter(|j| !known.contains_key(j));
            rest.collect()
        })
        .collect();
    let turns = |joint: &JointId| model.joint(*joint).kind.turns();
    let turning: Vec<Vec<JointId>> = chains
        .iter()
        .map(|chain| chain.iter().copied().filter(turns).collect())
        .collect();
    let consecutive = |of: &[(u32, usize)]| of.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1);
    let mut best: Option<(bool, usize, BTreeMap<JointId, usize>)> = None;
    for mut members in families.into_values() {
        members.sort_unstable();
        if members.len() < 2 || !consecutive(&members) {
            continue;
        }
        // A rail is numbered apart from the arm on it: `E1` beside `A1` to `A6`.
        let mut all = chains.iter().chain(&turning);
        let chain = all.find(|chain| chain.len() == members.len());
        let whole = chain.is_some();
        // Three pressures are no joints of a chain of six.
        let of_joints = name::is_of_joints(&header.names[members[0].1]);
        let longer = || {
            chains
                .iter()
                .find(|chain| known.is_empty() && of_joints && chain.len() > members.len())
        };
        let Some(chain) = chain.or_else(longer) else {
            continue;
        };
        let agrees = chain
            .iter()
            .zip(&members)
            .all(|(joint, (_, i))| fits(model, *joint, header, *i));
        let better = best
            .as_ref()
            .is_none_or(|(was_whole, count, _)| (whole, members.len()) > (*was_whole, *count));
        if agrees && better {
            let pairs = chain.iter().copied().zip(members.iter().map(|(_, i)| *i));
            best = Some((whole, members.len(), pairs.collect()));
        }
    }
    let mut pairs = best.map(|(_, _, pairs)| pairs)?;
    let with_all = |chain: &&Vec<JointId>| pairs.keys().all(|joint| chain.contains(joint));
    let rest = chains.iter().find(with_all).into_iter().flatten();
    let rest: Vec<JointId> = rest.copied().filter(|j| !pairs.contains_key(j)).collect();
    let taken: BTreeSet<usize> = pairs.values().copied().collect();
    let left = (0..header.names.len()).filter(|i| {
        let name = &header.names[*i];
        let free = !used.contains(i) && !taken.contains(i) && header.has_numbers(*i);
        free && name::is_of_joints(name) && !name::is_no_position(name)
    });
    let left: Vec<usize> = left.collect();
    if let ([joint], [column]) = (&rest[..], &left[..])
        && !turns(joint)
        && fits(model, *joint, header, *column)
    {
        pairs.insert(*joint, *column);
    }
    Some(pairs)
}

/// The unit of the angles that do not name it.
fn angles(model: &RobotModel, header: &Header, guess: &mut Guess) {
    let turning = guess
        .joints
        .iter()
        .filter(|(j, _)| model.joint(*j).kind.turns());
    let units: Vec<(Option<NamedUnit>, bool, f64)> = turning
        .filter_map(|(_, column)| {
            let i = header.position(column)?;
            let unit = header.unit(i);
            Some((unit.unit, unit.native, header.largest(i)))
        })
        .collect();
    if units.is_empty() {
        return;
    }
    let in_names = |unit: AngleUnit| units.iter().any(|u| u.0 == Some(NamedUnit::Angle(unit)));
    let largest = units.iter().map(|u| u.2).fold(0.0, f64::max);
    let native = units.iter().all(|u| u.0.is_some() && u.1);
    let (unit, how) = match (in_names(AngleUnit::Deg), in_names(AngleUnit::Rad)) {
        // Each column says it itself.
        (true, true) => (AngleUnit::Rad, AngleHow::Named),
        (true, false) => (AngleUnit::Deg, AngleHow::Named),
        (false, true) => (AngleUnit::Rad, AngleHow::Named),
        _ if largest > TURN => (AngleUnit::Deg, AngleHow::Range { largest }),
        _ => (AngleUnit::Rad, AngleHow::Range { largest }),
    };
    guess.map.angles = if native { AngleUnit::Rad } else { unit };
    guess.facts.push(About::Angles { unit, how });
}

/// The unit of the lengths that do not name it.
fn lengths(model: &RobotModel, header: &Header, guess: &mut Guess) {
    let markers = guess.map.markers.values().flatten();
    let bodies = guess.map.bodies.values().flat_map(|b| &b.position);
    let columns: Vec<usize> = markers
        .chain(bodies)
        .filter_map(|name| header.position(name))
        .collect();
    if columns.is_empty() {
        return;
    }
    let units: Vec<_> = columns.iter().map(|i| header.unit(*i)).collect();
    let named = units.iter().find_map(|u| match u.unit {
        Some(NamedUnit::Length(unit)) => Some(unit),
        _ => None,
    });
    let extent = columns.iter().map(|i| header.span(*i)).fold(0.0, f64::max);
    let reach = calib_urdf::doubt::reach(model).max(0.1);
    let (unit, how) = match named {
        Some(unit) => (unit, LengthHow::Named),
        None => {
            let unit = match extent / reach {
                times if times > FAR => LengthUnit::Mm,
                _ => LengthUnit::M,
            };
            (unit, LengthHow::Range { extent, reach })
        }
    };
    let native = units.iter().all(|u| u.unit.is_some() && u.native);
    guess.map.lengths = if native { LengthUnit::M } else { unit };
    guess.facts.push(About::Lengths { unit, how });
}
