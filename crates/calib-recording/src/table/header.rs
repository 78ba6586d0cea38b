//! What the columns of a table mean: by our own naming rules, and by a column map for the columns it names.
//!
//! The rules, in this order:
//! 1. `t_s`, `t_ms`, `t_us`: time. `host_s`: the recording computer's clock. `frame`, `pose`, `row`, `sample`, `index`, `config`: a counter.
//!    `trial`, `group`, `label`, `phase`, `set`, `hold`, `segment`, `note`: text.
//! 2. `marker` or `body` as a column name: a long table; the row's `x_m,y_m,z_m[,qx,qy,qz,qw]` belong to the
//!    marker or body named there.
//! 3. `NAME.x_m` (`_cm`, `_mm`), `NAME.qx`, `NAME.state`: a marker, or with a quaternion a body.
//! 4. `NAME_x_m`, `NAME_qx`: the same, if `NAME` has another coordinate in this style; a lone `NAME_x_m` is
//!    a prismatic joint `NAME_x`.
//! 5. `x_m` or `qx` without a name: the body `body` with a quaternion, the marker `marker` without.
//! 6. `NAME_rad|_deg`: a revolute joint; `NAME_m|_cm|_mm`: a prismatic one; `NAME_nm`: a torque in N·m.
//!
//! Anything else is an error, or with a column map: ignored, and listed.

use crate::column_map::{BodyColumns, ColumnMap};
use crate::error::{At, Placed, Problem};
use crate::model::JointUnit;
use crate::units::{AngleUnit, LengthUnit, TimeUnit};
use calib_finding::nearest_word;
use std::collections::BTreeMap;

/// Meaning of one column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Column {
    Ignore,
    /// Number into this slot, divided by this: units of the column in the SI unit.
    Number {
        slot: usize,
        scale: f64,
    },
    /// Text into this label.
    Label(usize),
    /// State of this marker.
    State(usize),
    /// Name of the row's entity (long tables).
    Entity,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SlotKind {
    Time,
    Counter,
    Robot,
    Tracker,
}

#[derive(Clone, Debug)]
pub(super) struct Slot {
    pub kind: SlotKind,
    pub column: usize,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Rotation {
    /// Slots of x, y, z, w.
    Quaternion([usize; 4]),
    Vector([usize; 3]),
    FixedXyz([usize; 3]),
}

impl Rotation {
    pub(super) fn slots(&self) -> &[usize] {
        match self {
            Rotation::Quaternion(slots) => slots,
            Rotation::Vector(slots) | Rotation::FixedXyz(slots) => slots,
        }
    }
}

pub(super) struct MarkerPlan {
    pub name: String,
    pub slots: [usize; 3],
}

pub(super) struct BodyPlan {
    pub name: String,
    pub position: [usize; 3],
    pub rotation: Rotation,
}

#[derive(Default)]
pub(super) struct Layout {
    pub names: Vec<String>,
    pub columns: Vec<Column>,
    pub slots: Vec<Slot>,
    pub time: Option<usize>,
    /// The clock of the computer that recorded, s.
    pub received: Option<usize>,
    pub counter: Option<usize>,
    pub joints: Vec<(String, JointUnit, usize)>,
    pub torques: Vec<(String, usize)>,
    pub markers: Vec<MarkerPlan>,
    pub bodies: Vec<BodyPlan>,
    pub labels: Vec<String>,
    /// Long table: column of the entity's name; the only marker or body plan is its template.
    pub entity: Option<usize>,
    pub conversions: Vec<String>,
}

const COUNTERS: [&str; 6] = ["frame", "pose", "row", "sample", "index", "config"];
const LABELS: [&str; 8] = [
    "trial", "group", "label", "phase", "set", "hold", "segment", "note",
];
const EXPECTED: &str = "`<joint>_rad|_deg|_m|_mm`, `<joint>_nm`, `<marker>.x_m|.x_mm`, `<body>.qx`, `t_s`, `frame` or `trial`; or a column map in the profile";

/// One coordinate of a marker or body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    Axis(usize),
    Quaternion(usize),
    State,
}

/// Splits `x_mm` into part and scale.
fn part(text: &str) -> Option<(Part, f64)> {
    match text {
        "qx" => return Some((Part::Quaternion(0), 1.0)),
        "qy" => return Some((Part::Quaternion(1), 1.0)),
        "qz" => return Some((Part::Quaternion(2), 1.0)),
        "qw" => return Some((Part::Quaternion(3), 1.0)),
        "state" => return Some((Part::State, 1.0)),
        _ => {}
    }
    let (axis, unit) = text.split_once('_')?;
    let axis = ["x", "y", "z"].iter().position(|&a| a == axis)?;
    let unit = length_suffix(unit)?;
    Some((Part::Axis(axis), unit.per_metre()))
}

fn length_suffix(unit: &str) -> Option<LengthUnit> {
    match unit {
        "m" => Some(LengthUnit::M),
        "cm" => Some(LengthUnit::Cm),
        "mm" => Some(LengthUnit::Mm),
        _ => None,
    }
}

/// How a column name reads by the rules of this module.
enum Meaning<'a> {
    Time(TimeUnit),
    Received,
    Counter,
    Label,
    Entity,
    /// `dotted`: cannot be anything else.
    Part {
        entity: &'a str,
        part: Part,
        scale: f64,
        dotted: bool,
    },
    Joint {
        name: &'a str,
        unit: JointUnit,
        scale: f64,
    },
    Torque(&'a str),
    Unknown,
}

fn meaning(name: &str) -> Meaning<'_> {
    match name {
        "t_s" => return Meaning::Time(TimeUnit::S),
        "t_ms" => return Meaning::Time(TimeUnit::Ms),
        "t_us" => return Meaning::Time(TimeUnit::Us),
        "host_s" => return Meaning::Received,
        "marker" | "body" => return Meaning::Entity,
        _ if COUNTERS.contains(&name) => return Meaning::Counter,
        _ if LABELS.contains(&name) => return Meaning::Label,
        _ => {}
    }
    if let Some((part, scale)) = part(name) {
        return Meaning::Part {
            entity: "",
            part,
            scale,
            dotted: true,
        };
    }
    if let Some((entity, tail)) = name.rsplit_once('.')
        && let Some((part, scale)) = part(tail)
    {
        return Meaning::Part {
            entity,
            part,
            scale,
            dotted: true,
        };
    }
    let Some((head, last)) = name.rsplit_once('_') else {
        return Meaning::Unknown;
    };
    if head.is_empty() {
        return Meaning::Unknown;
    }
    if let Some((part @ Part::Quaternion(_), scale)) = part(last) {
        return Meaning::Part {
            entity: head,
            part,
            scale,
            dotted: false,
        };
    }
    if let Some(unit) = length_suffix(last) {
        if let Some((entity, axis)) = head.rsplit_once('_')
            && !entity.is_empty()
            && let Some(axis) = ["x", "y", "z"].iter().position(|&a| a == axis)
        {
            return Meaning::Part {
                entity,
                part: Part::Axis(axis),
                scale: unit.per_metre(),
                dotted: false,
            };
        }
        return Meaning::Joint {
            name: head,
            unit: JointUnit::Length,
            scale: unit.per_metre(),
        };
    }
    match last {
        "rad" => Meaning::Joint {
            name: head,
            unit: JointUnit::Angle,
            scale: AngleUnit::Rad.per_radian(),
        },
        "deg" => Meaning::Joint {
            name: head,
            unit: JointUnit::Angle,
            scale: AngleUnit::Deg.per_radian(),
        },
        "nm" | "Nm" => Meaning::Torque(head),
        _ => Meaning::Unknown,
    }
}

/// Columns of one marker or body while they are collected: part → (column, units in the SI unit).
#[derive(Default)]
struct Entity {
    parts: BTreeMap<Part, (usize, f64)>,
    dotted: bool,
}

impl Layout {
    /// Reads the header.
    pub(super) fn new(line: u64, names: Vec<String>, map: Option<&ColumnMap>) -> Placed<Layout> {
        let at = || At::Line(line);
        let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
        for (i, name) in names
            .iter()
            .enumerate()
            .filter(|(_, name)| !name.is_empty())
        {
            if let Some(first) = seen.insert(name, i) {
                let name = name.clone();
                return Err((
                    at(),
                    Problem::DuplicateColumn {
                        name,
                        first: first + 1,
                        second: i + 1,
                    },
                ));
            }
        }
        let mut layout = Layout {
            columns: vec![Column::Ignore; names.len()],
            names,
            ..Layout::default()
        };
        let mut mapped = vec![false; layout.names.len()];
        if let Some(map) = map {
            layout
                .apply(map, &mut mapped)
                .map_err(|problem| (at(), problem))?;
        }
        layout
            .by_rules(&mapped, map.is_some())
            .map_err(|problem| (at(), problem))?;
        Ok(layout)
    }

    fn slot(&mut self, column: usize, kind: SlotKind, scale: f64) -> usize {
        self.slots.push(Slot { kind, column });
        let slot = self.slots.len() - 1;
        self.columns[column] = Column::Number { slot, scale };
        slot
    }

    /// The columns that a map names.
    fn apply(&mut self, map: &ColumnMap, mapped: &mut [bool]) -> Result<(), Problem> {
        let (angle, length) = (map.angles.per_radian(), map.lengths.per_metre());
        let mut find =
            |layout: &mut Layout, what: String, column: &str, kind: SlotKind, scale: f64| {
                let Some(i) = layout.names.iter().position(|name| name == column) else {
                    let nearest = nearest_word(column, layout.names.iter().map(String::as_str))
                        .map(str::to_owned);
                    return Err(Problem::MissingColumn {
                        what,
                        column: column.to_string(),
                        nearest,
                    });
                };
                if mapped[i] {
                    let problem = Problem::Misfit {
                        found: format!("the map uses column `{column}` again for {what}"),
                        expected: "every column once".to_string(),
                    };
                    return Err(problem);
                }
                mapped[i] = true;
                Ok(layout.slot(i, kind, scale))
            };
        if let Some(time) = &map.time {
            self.time = Some(find(
                self,
                "time".into(),
                &time.column,
                SlotKind::Time,
                time.unit.per_second(),
            )?);
        }
        let named = map.joint_columns.iter().map(|name| (name, name));
        for (joint, column) in map.joints.iter().chain(named) {
            let slot = find(
                self,
                format!("joint `{joint}`"),
                column,
                SlotKind::Robot,
                angle,
            )?;
            self.joints.push((joint.clone(), JointUnit::Angle, slot));
        }
        for (joint, column) in &map.prismatic {
            let slot = find(
                self,
                format!("joint `{joint}`"),
                column,
                SlotKind::Robot,
                length,
            )?;
            self.joints.push((joint.clone(), JointUnit::Length, slot));
        }
        for (joint, column) in &map.torques {
            let slot = find(
                self,
                format!("torque of `{joint}`"),
                column,
                SlotKind::Robot,
                1.0,
            )?;
            self.torques.push((joint.clone(), slot));
        }
        let mut three = |layout: &mut Layout, what: &str, columns: &[String; 3], scale: f64| {
            let mut slots = [0; 3];
            for (slot, column) in slots.iter_mut().zip(columns) {
                *slot = find(layout, what.to_string(), column, SlotKind::Tracker, scale)?;
            }
            Ok::<_, Problem>(slots)
        };
        for (name, columns) in &map.markers {
            let slots = three(self, &format!("marker `{name}`"), columns, length)?;
            self.markers.push(MarkerPlan {
                name: name.clone(),
                slots,
            });
        }
        let long_marker = map.long.as_ref().and_then(|long| long.marker.as_ref());
        if let Some(columns) = long_marker {
            let slots = three(self, "the markers", columns, length)?;
            self.markers.push(MarkerPlan {
                name: String::new(),
                slots,
            });
        }
        let long_body = map.long.as_ref().and_then(|long| long.body.as_ref());
        for (name, columns) in map
            .bodies
            .iter()
            .map(|(name, c)| (name.as_str(), c))
            .chain(long_body.map(|c| ("", c)))
        {
            let what = format!("body `{name}`");
            let position = three(self, &what, &columns.position, length)?;
            let rotation = match columns {
                BodyColumns {
                    quaternion_xyzw: Some([x, y, z, w]),
                    quaternion_wxyz: None,
                    rotation_vector: None,
                    fixed_xyz: None,
                    ..
                }
                | BodyColumns {
                    quaternion_wxyz: Some([w, x, y, z]),
                    quaternion_xyzw: None,
                    rotation_vector: None,
                    fixed_xyz: None,
                    ..
                } => {
                    let [x, y, z] = three(self, &what, &[x.clone(), y.clone(), z.clone()], 1.0)?;
                    // `w` alone: the same search with a triple would take two more columns.
                    let i = self
                        .names
                        .iter()
                        .position(|name| name == w)
                        .ok_or_else(|| Problem::MissingColumn {
                            what: what.clone(),
                            column: w.clone(),
                            nearest: nearest_word(w, self.names.iter().map(String::as_str))
                                .map(str::to_owned),
                        })?;
                    Rotation::Quaternion([x, y, z, self.slot(i, SlotKind::Tracker, 1.0)])
                }
                BodyColumns {
                    rotation_vector: Some(columns),
                    quaternion_xyzw: None,
                    quaternion_wxyz: None,
                    fixed_xyz: None,
                    ..
                } => Rotation::Vector(three(self, &what, columns, angle)?),
                BodyColumns {
                    fixed_xyz: Some(columns),
                    quaternion_xyzw: None,
                    quaternion_wxyz: None,
                    rotation_vector: None,
                    ..
                } => Rotation::FixedXyz(three(self, &what, columns, angle)?),
                _ => {
                    return Err(Problem::Misfit {
                        found: format!("the column map gives {what} none or several rotations"),
                        expected:
                            "one of quaternion_xyzw, quaternion_wxyz, rotation_vector, fixed_xyz"
                                .to_string(),
                    });
                }
            };
            self.bodies.push(BodyPlan {
                name: name.to_string(),
                position,
                rotation,
            });
        }
        if let Some(long) = &map.long {
            let column = |layout: &Layout, column: &str| {
                layout
                    .names
                    .iter()
                    .position(|name| name == column)
                    .ok_or_else(|| Problem::MissingColumn {
                        what: "the long table".to_string(),
                        column: column.to_string(),
                        nearest: nearest_word(column, layout.names.iter().map(String::as_str))
                            .map(str::to_owned),
                    })
            };
            let (name, frame) = (column(self, &long.name)?, column(self, &long.frame)?);
            self.entity = Some(name);
            self.columns[name] = Column::Entity;
            self.counter = Some(self.slot(frame, SlotKind::Counter, 1.0));
            if self.markers.len() + self.bodies.len() != 1 {
                return Err(Problem::Misfit {
                    found: "the column map's `long` has none or several kinds of columns"
                        .to_string(),
                    expected:
                        "either `marker` or `body` under `long`, and no other markers or bodies"
                            .to_string(),
                });
            }
        }
        for label in &map.labels {
            let i = self
                .names
                .iter()
                .position(|name| name == label)
                .ok_or_else(|| Problem::MissingColumn {
                    what: "a label".to_string(),
                    column: label.clone(),
                    nearest: nearest_word(label, self.names.iter().map(String::as_str))
                        .map(str::to_owned),
                })?;
            self.columns[i] = Column::Label(self.labels.len());
            self.labels.push(label.clone());
        }
        // Whatever is used now is mapped (the slots of `w`, frame and labels were not marked above).
        for (i, column) in self.columns.iter().enumerate() {
            mapped[i] |= *column != Column::Ignore;
        }
        self.conversions.push(
            format!(
                "column map: angles in {:?}, lengths in {}",
                map.angles,
                map.lengths.name()
            )
            .to_lowercase(),
        );
        Ok(())
    }

    /// The other columns, by our rules.
    fn by_rules(&mut self, mapped: &[bool], lenient: bool) -> Result<(), Problem> {
        let names = self.names.clone();
        let mut entities: BTreeMap<&str, Entity> = BTreeMap::new();
        let mut ignored = Vec::new();
        for (i, name) in names.iter().enumerate().filter(|&(i, _)| !mapped[i]) {
            match meaning(name) {
                Meaning::Time(unit) if self.time.is_none() => {
                    self.time = Some(self.slot(i, SlotKind::Time, unit.per_second()))
                }
                Meaning::Received if self.received.is_none() => {
                    self.received = Some(self.slot(i, SlotKind::Time, 1.0))
                }
                Meaning::Counter if self.counter.is_none() => {
                    self.counter = Some(self.slot(i, SlotKind::Counter, 1.0))
                }
                Meaning::Label => {
                    self.columns[i] = Column::Label(self.labels.len());
                    self.labels.push(name.clone());
                }
                Meaning::Entity if self.entity.is_none() => {
                    self.entity = Some(i);
                    self.columns[i] = Column::Entity;
                }
                Meaning::Part {
                    entity,
                    part,
                    scale,
                    dotted,
                } => {
                    let entry = entities.entry(entity).or_default();
                    entry.dotted |= dotted;
                    if let Some((other, _)) = entry.parts.insert(part, (i, scale)) {
                        return Err(Problem::DuplicateColumn {
                            name: name.clone(),
                            first: other + 1,
                            second: i + 1,
                        });
                    }
                }
                Meaning::Joint { name, unit, scale } => {
                    let slot = self.slot(i, SlotKind::Robot, scale);
                    self.joints.push((name.to_string(), unit, slot));
                }
                Meaning::Torque(name) => {
                    let slot = self.slot(i, SlotKind::Robot, 1.0);
                    self.torques.push((name.to_string(), slot));
                }
                Meaning::Time(_)
                | Meaning::Received
                | Meaning::Counter
                | Meaning::Entity
                | Meaning::Unknown => {
                    if !lenient && !name.is_empty() {
                        return Err(Problem::UnknownColumn {
                            name: name.clone(),
                            expected: EXPECTED.to_string(),
                            nearest: nearest_rule(name),
                        });
                    }
                    if !name.is_empty() {
                        ignored.push(name.as_str());
                    }
                }
            }
        }
        if !ignored.is_empty() {
            self.conversions
                .push(format!("ignored columns: {}", ignored.join(", ")));
        }
        for (name, entity) in entities {
            self.entity_by_rules(name, &entity, &names)?;
        }
        self.check_names()?;
        if self.joints.is_empty()
            && self.torques.is_empty()
            && self.markers.is_empty()
            && self.bodies.is_empty()
        {
            return Err(Problem::Misfit {
                found: "the header has no joints, markers or bodies".to_string(),
                expected: EXPECTED.to_string(),
            });
        }
        Ok(())
    }

    fn entity_by_rules(
        &mut self,
        name: &str,
        entity: &Entity,
        names: &[String],
    ) -> Result<(), Problem> {
        let axis_count = (0..3)
            .filter(|&i| entity.parts.contains_key(&Part::Axis(i)))
            .count();
        let has_rotation = entity
            .parts
            .keys()
            .any(|part| matches!(part, Part::Quaternion(_)));
        if axis_count == 1 && !has_rotation && !entity.dotted {
            // Rule 4: a lone `NAME_x_m` is a prismatic joint.
            for (part, &(column, scale)) in &entity.parts {
                if let Part::Axis(axis) = part {
                    let slot = self.slot(column, SlotKind::Robot, scale);
                    self.joints.push((
                        format!("{name}_{}", ["x", "y", "z"][*axis]),
                        JointUnit::Length,
                        slot,
                    ));
                }
            }
            return Ok(());
        }
        let kind = if has_rotation { "body" } else { "marker" };
        let take = |layout: &mut Layout, part: Part, missing: &str| match entity.parts.get(&part) {
            Some(&(column, scale)) => Ok(layout.slot(column, SlotKind::Tracker, scale)),
            None => {
                let join = if name.is_empty() {
                    String::new()
                } else if entity.dotted {
                    format!("{name}.")
                } else {
                    format!("{name}_")
                };
                let present: Vec<String> = entity
                    .parts
                    .values()
                    .map(|&(i, _)| format!("`{}`", names[i]))
                    .collect();
                Err(Problem::IncompleteEntity {
                    entity: kind,
                    name: name.to_string(),
                    missing: format!("{join}{missing}"),
                    present: present.join(", "),
                })
            }
        };
        let mut position = [0; 3];
        for (i, missing) in ["x_m", "y_m", "z_m"].iter().enumerate() {
            position[i] = take(self, Part::Axis(i), missing)?;
        }
        let long = self.entity.is_some() && name.is_empty();
        let full_name = match (name, long) {
            ("", true) => "",
            ("", false) => kind,
            (name, _) => name,
        };
        if has_rotation {
            let mut q = [0; 4];
            for (i, missing) in ["qx", "qy", "qz", "qw"].iter().enumerate() {
                q[i] = take(self, Part::Quaternion(i), missing)?;
            }
            self.bodies.push(BodyPlan {
                name: full_name.to_string(),
                position,
                rotation: Rotation::Quaternion(q),
            });
        } else {
            if let Some(&(column, _)) = entity.parts.get(&Part::State) {
                self.columns[column] = Column::State(self.markers.len());
            }
            self.markers.push(MarkerPlan {
                name: full_name.to_string(),
                slots: position,
            });
        }
        Ok(())
    }

    /// A joint twice (`a_rad` and `a_deg`), or a long table with other columns than it can carry.
    fn check_names(&self) -> Result<(), Problem> {
        let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
        for (name, _, slot) in &self.joints {
            let column = self.slots[*slot].column;
            if let Some(first) = seen.insert(name, column) {
                return Err(Problem::DuplicateColumn {
                    name: name.clone(),
                    first: first + 1,
                    second: column + 1,
                });
            }
        }
        if self.entity.is_some() {
            let only_template = self.markers.len() + self.bodies.len() == 1
                && self.markers.iter().all(|m| m.name.is_empty())
                && self.bodies.iter().all(|b| b.name.is_empty());
            if !only_template || !self.joints.is_empty() || !self.torques.is_empty() {
                return Err(Problem::Misfit {
                    found: "a `marker` or `body` column stands beside joints or named markers".to_string(),
                    expected: "a long table `frame,marker,x_m,y_m,z_m` or `frame,body,x_m,y_m,z_m,qx,qy,qz,qw`; write joints into a wide table".to_string(),
                });
            }
            if self.counter.is_none() && self.time.is_none() {
                return Err(Problem::MissingColumn {
                    what: "a long table".to_string(),
                    column: "frame".to_string(),
                    nearest: None,
                });
            }
        }
        Ok(())
    }
}

/// The nearest name that the rules understand: a fixed word, or the same name with a unit.
fn nearest_rule(name: &str) -> Option<String> {
    if let Some((head, last)) = name.rsplit_once(['_', '.'])
        && !head.is_empty()
        && let Some(unit) = nearest_word(last, ["rad", "deg", "mm", "nm"])
        && last.len() >= 2
    {
        return Some(format!("{head}_{unit}"));
    }
    let fixed = COUNTERS
        .iter()
        .chain(&LABELS)
        .copied()
        .chain(["t_s", "t_ms", "host_s", "marker", "body", "x_m", "x_mm"]);
    nearest_word(name, fixed)
        .map(str::to_owned)
        .or_else(|| Some(format!("{name}_rad")))
}

/// Whether a header line reads as one of our own tables (for the detection of formats).
pub(crate) fn is_canonical<'a>(names: impl Iterator<Item = &'a str>) -> bool {
    let (mut known, mut unknown) = (0, 0);
    for name in names.filter(|name| !name.is_empty()) {
        match meaning(name) {
            Meaning::Part { .. } | Meaning::Joint { .. } => known += 1,
            Meaning::Unknown => unknown += 1,
            _ => {}
        }
    }
    known > 0 && known >= unknown
}
