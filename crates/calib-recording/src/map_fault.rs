//! What a column map contradicts in itself, whatever the table.

use crate::column_map::{BodyColumns, ColumnMap};
use crate::table::length_unit;
use crate::units::{AngleUnit, LengthUnit};
use calib_finding::nearest_word;
use std::collections::BTreeMap;

/// Which units a map states in words: `rad` and `m` are also the defaults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StatedUnits {
    /// `angles` is written.
    pub angles: bool,
    /// `lengths` is written.
    pub lengths: bool,
}

/// A fault of a column map.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MapFault {
    /// The names of columns end in another unit than the map states.
    #[error("`{key}: {stated}` in the column map contradicts the name of column `{}`{}", .columns[0], others(.columns.len() - 1))]
    Unit {
        /// `angles`, `body_angles` or `lengths`.
        key: &'static str,
        /// The unit that the map states.
        stated: &'static str,
        /// The unit of the first column's name.
        named: &'static str,
        /// The columns, at least one.
        columns: Vec<String>,
    },
    /// One column is used twice.
    #[error("the column map uses column `{column}` twice: at `{}` and at `{}`", .first.join("."), .again.join("."))]
    ColumnTwice {
        /// The column.
        column: String,
        /// Keys that lead to its first use.
        first: Vec<String>,
        /// Keys that lead to its second use.
        again: Vec<String>,
    },
    /// `reversed` names something else than a joint of the map.
    #[error("`reversed` names `{joint}`, which is not among the map's joints")]
    NotReversible {
        /// Position in the list, from 0.
        index: usize,
        /// The name.
        joint: String,
        /// The joint of the map that is called almost like it.
        nearest: Option<String>,
    },
    /// A body without a rotation, or with several.
    #[error("`{}` of the column map has {count} rotations", .path.join("."))]
    Rotations {
        /// Keys that lead to the body.
        path: Vec<String>,
        /// Rotations given.
        count: usize,
    },
    /// `long` without columns of a marker or body, or beside such columns.
    #[error("`long` of the column map has {count} kinds of columns")]
    LongKinds {
        /// Markers and bodies of the map.
        count: usize,
    },
}

fn others(count: usize) -> String {
    match count {
        0 => String::new(),
        1 => " and of 1 other".to_owned(),
        n => format!(" and of {n} others"),
    }
}

impl MapFault {
    /// Keys of the map (and list positions as decimal numbers) that lead to the fault.
    #[must_use]
    pub fn path(&self) -> Vec<String> {
        match self {
            Self::Unit { key, .. } => vec![(*key).to_owned()],
            Self::ColumnTwice { again, .. } => again.clone(),
            Self::NotReversible { index, .. } => vec!["reversed".to_owned(), index.to_string()],
            Self::Rotations { path, .. } => path.clone(),
            Self::LongKinds { .. } => vec!["long".to_owned()],
        }
    }

    /// What to do.
    #[must_use]
    pub fn remedy(&self) -> String {
        match self {
            Self::Unit { key, named, .. } => {
                format!("write `{key}: {named}`, or correct the names of the columns")
            }
            Self::ColumnTwice { .. } => "correct one of the two: each column has one meaning".to_owned(),
            Self::NotReversible {
                nearest: Some(near), ..
            } => format!("did you mean `{near}`?"),
            Self::NotReversible { joint, .. } => {
                format!("map the joint too: `joints: {{{joint}: <column>}}`, or remove it from `reversed`")
            }
            Self::Rotations { .. } => {
                "give exactly one of `quaternion_xyzw`, `quaternion_wxyz`, `rotation_vector`, `fixed_xyz`, `euler`, `rotation_matrix` and `axis_angle`"
                    .to_owned()
            }
            Self::LongKinds { .. } => {
                "give either `marker` or `body` under `long`, and no other `markers` or `bodies`"
                    .to_owned()
            }
        }
    }
}

/// What a mapped column is a measure of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Quantity {
    Angle,
    BodyAngle,
    Length,
    Other,
}

/// A use of a column: keys that lead to it, its name, what it measures.
struct Use<'a> {
    path: Vec<String>,
    column: &'a str,
    quantity: Quantity,
}

impl ColumnMap {
    /// Everything that is wrong with the map itself; it must be resolved (see [`resolved`](Self::resolved)).
    #[must_use]
    pub fn faults(&self, stated: StatedUnits) -> Vec<MapFault> {
        let uses = self.uses();
        let mut faults: Vec<MapFault> = self.unit_faults(&uses, stated).collect();
        let mut seen: BTreeMap<&str, &[String]> = BTreeMap::new();
        for one in uses.iter().filter(|one| !one.column.is_empty()) {
            let Some(first) = seen.insert(one.column, &one.path) else {
                continue;
            };
            faults.push(MapFault::ColumnTwice {
                column: one.column.to_owned(),
                first: first.to_vec(),
                again: one.path.clone(),
            });
        }
        let joints = || {
            let named = self.joints.keys().chain(self.prismatic.keys());
            named.chain(&self.joint_columns)
        };
        for (index, joint) in self.reversed.iter().enumerate() {
            if !joints().any(|known| known == joint) {
                let nearest = nearest_word(joint, joints().map(String::as_str));
                faults.push(MapFault::NotReversible {
                    index,
                    joint: joint.clone(),
                    nearest: nearest.map(str::to_owned),
                });
            }
        }
        for (path, body) in self.body_columns() {
            let count = body.rotations().count();
            if count != 1 {
                faults.push(MapFault::Rotations { path, count });
            }
        }
        if let Some(long) = &self.long {
            let own = usize::from(long.marker.is_some()) + usize::from(long.body.is_some());
            let count = own + self.markers.len() + self.bodies.len();
            if count != 1 {
                faults.push(MapFault::LongKinds { count });
            }
        }
        faults
    }

    /// Names of columns that contradict the units of the map.
    fn unit_faults<'a>(
        &self,
        uses: &[Use<'a>],
        stated: StatedUnits,
    ) -> impl Iterator<Item = MapFault> + use<'a> {
        let fault = |key, stated, named: Vec<(&str, &'static str)>| {
            let first = named.first()?.1;
            let columns = named.iter().map(|(column, _)| (*column).to_owned());
            Some(MapFault::Unit {
                key,
                stated,
                named: first,
                columns: columns.collect(),
            })
        };
        let of = |quantity: Quantity| uses.iter().filter(move |one| one.quantity == quantity);
        let other_angle = |one: &Use<'a>, unit: AngleUnit| {
            let own = angle_unit(one.column).filter(|own| *own != unit)?;
            Some((one.column, own.name()))
        };
        let angles = (stated.angles || self.angles != AngleUnit::default()).then(|| {
            let of_bodies = of(Quantity::BodyAngle).filter(|_| self.body_angles.is_none());
            let named = of(Quantity::Angle).chain(of_bodies);
            let named = named.filter_map(|one| other_angle(one, self.angles));
            fault("angles", self.angles.name(), named.collect())
        });
        let of_bodies = self.body_angles.map(|unit| {
            let named = of(Quantity::BodyAngle).filter_map(|one| other_angle(one, unit));
            fault("body_angles", unit.name(), named.collect())
        });
        let lengths = (stated.lengths || self.lengths != LengthUnit::default()).then(|| {
            let named = of(Quantity::Length).filter_map(|one| {
                let (_, own) = length_unit(one.column).filter(|(_, own)| *own != self.lengths)?;
                Some((one.column, own.name()))
            });
            fault("lengths", self.lengths.name(), named.collect())
        });
        [angles, of_bodies, lengths].into_iter().flatten().flatten()
    }

    /// Every body of the map with the keys that lead to it.
    fn body_columns(&self) -> impl Iterator<Item = (Vec<String>, &BodyColumns)> {
        let named = self.bodies.iter();
        let named = named.map(|(name, body)| (vec!["bodies".to_owned(), name.clone()], body));
        let long = self.long.as_ref().and_then(|long| long.body.as_ref());
        named.chain(long.map(|body| (vec!["long".to_owned(), "body".to_owned()], body)))
    }

    /// Every column of numbers that the map uses.
    fn uses(&self) -> Vec<Use<'_>> {
        let mut uses = Vec::new();
        let mut push = |path: &[&str], column, quantity| {
            let path = path.iter().map(|key| (*key).to_owned()).collect();
            uses.push(Use {
                path,
                column,
                quantity,
            });
        };
        if let Some(time) = &self.time {
            push(&["time", "column"], &time.column, Quantity::Other);
        }
        for (i, joint) in self.joint_columns.iter().enumerate() {
            push(&["joint_columns", &i.to_string()], joint, Quantity::Angle);
        }
        for (key, columns, quantity) in [
            ("joints", &self.joints, Quantity::Angle),
            ("prismatic", &self.prismatic, Quantity::Length),
            ("torques", &self.torques, Quantity::Other),
            ("temperatures", &self.temperatures, Quantity::Other),
        ] {
            for (name, column) in columns {
                push(&[key, name], column, quantity);
            }
        }
        let named = self.markers.iter();
        let named = named.map(|(name, columns)| (["markers", name.as_str()], columns));
        let long = self.long.as_ref().and_then(|long| long.marker.as_ref());
        for (path, columns) in named.chain(long.map(|columns| (["long", "marker"], columns))) {
            for (i, column) in columns.iter().enumerate() {
                push(
                    &[&path[..], &[&i.to_string()]].concat(),
                    column,
                    Quantity::Length,
                );
            }
        }
        for (path, body) in self.body_columns() {
            let path: Vec<&str> = path.iter().map(String::as_str).collect();
            let mut of_body = |keys: &[&str], i: usize, column, quantity| {
                push(
                    &[&path[..], keys, &[&i.to_string()]].concat(),
                    column,
                    quantity,
                );
            };
            for (i, column) in body.position.iter().enumerate() {
                of_body(&["position"], i, column, Quantity::Length);
            }
            for rotation in body.rotations() {
                for (i, column) in rotation.columns().iter().enumerate() {
                    let quantity = match rotation.angles().contains(&i) {
                        true => Quantity::BodyAngle,
                        false => Quantity::Other,
                    };
                    of_body(rotation.keys(), i, column, quantity);
                }
            }
        }
        uses
    }
}

/// The unit in which a column of angles is by its name.
pub(crate) fn angle_unit(column: &str) -> Option<AngleUnit> {
    let (_, unit) = column.rsplit_once('_')?;
    [AngleUnit::Rad, AngleUnit::Deg]
        .into_iter()
        .find(|one| one.name() == unit)
}
