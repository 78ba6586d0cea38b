//! The columns that no map names, by the rules of [`naming`](super::naming). A name without meaning is an error, or
//! with a column map: ignored, and listed.

use super::naming::{Meaning, Part, meaning, nearest_rule, with_unit};
use super::{BodyPlan, Column, Known, Layout, MarkerPlan, Rotation, SlotKind};
use crate::error::Problem;
use crate::model::JointUnit;
use crate::table::stated_unit::StatedUnit;
use std::collections::BTreeMap;

const EXPECTED: &str = "`<joint>_rad|_deg|_m|_mm`, `<joint>_nm`, `temperature_c`, `<marker>.x_m|.x_mm`, `<body>.qx`, `t_s`, `frame` or `trial`; or a column map in the profile";

/// Columns of one marker or body while they are collected: part → (column, units in the SI unit).
#[derive(Default)]
struct Entity {
    parts: BTreeMap<Part, (usize, f64)>,
    /// Written `NAME.x_m`: cannot be anything else.
    dotted: bool,
}

/// The joint that a column of a coordinate would be by its name: `x` of `x_mm`, `base_x` of `base_x_m`.
fn joint_of(column: &str) -> Option<&str> {
    let coordinate = matches!(
        meaning(column),
        Meaning::Part { entity, part: Part::Axis(_), dotted, .. } if entity.is_empty() || !dotted
    );
    let name = column.rsplit_once('_').map(|(name, _)| name);
    name.filter(|_| coordinate)
}

/// The robot's joints whose columns read as coordinates. Three coordinates of one thing may be a marker: they are joints where all three are called
/// so, and coordinates without a name where other markers or bodies have one (`tracked`: in the column map), where the robot alone wrote the table, or where
/// others of its joints stand beside: a table that has some has all.
fn joints_like_coordinates<'n>(
    names: &'n [String],
    mapped: &[bool],
    tracked: bool,
    known: Known<'_>,
) -> Vec<&'n str> {
    let own = names.iter().zip(mapped).filter(|(_, mapped)| !**mapped);
    let meanings = || own.clone().map(|(name, _)| meaning(name));
    if known.joints.is_empty() || meanings().any(|m| matches!(m, Meaning::Entity)) {
        return Vec::new();
    }
    let is_known = |name: &str| known.joints.iter().any(|joint| joint == name);
    let others = tracked
        || known.of_robot
        || meanings().any(|m| matches!(m, Meaning::Joint { name, .. } if is_known(name)))
        || meanings().any(|m| matches!(m, Meaning::Part { entity, .. } if !entity.is_empty()));
    let coordinates: Vec<&str> = own.filter_map(|(name, _)| joint_of(name)).collect();
    let of = |name: &str| {
        // `base_` of `base_x`, nothing of `x`.
        let entity = &name[..name.len() - 1];
        let same = |other: &&&str| other.len() == name.len() && other.starts_with(entity);
        let together: Vec<&&str> = coordinates.iter().filter(same).collect();
        let all = together.iter().all(|name| is_known(name));
        all && (together.len() < 3 || !entity.is_empty() || others)
    };
    let joints = coordinates.iter().copied();
    joints.filter(|name| is_known(name) && of(name)).collect()
}

/// The column of one of these joints.
fn of_joint<'n>(column: &'n str, joints: &[&str]) -> Option<Meaning<'n>> {
    let name = joint_of(column).filter(|name| joints.contains(name))?;
    let Meaning::Part { scale, .. } = meaning(column) else {
        return None;
    };
    Some(Meaning::Joint {
        name,
        unit: JointUnit::Length,
        scale,
    })
}

fn unknown(name: &str) -> Problem {
    Problem::UnknownColumn {
        name: name.to_owned(),
        expected: EXPECTED.to_owned(),
        nearest: nearest_rule(name),
    }
}

impl Layout {
    /// The columns that are not mapped, by our rules; `lenient`: unknown ones are ignored. `stated`: the unit that a row of units gives a column.
    pub(super) fn by_rules(
        &mut self,
        mapped: &[bool],
        lenient: bool,
        stated: impl Fn(usize) -> Option<StatedUnit>,
        known: Known<'_>,
    ) -> Result<(), Problem> {
        let names = self.names.iter().enumerate();
        let names: Vec<String> = names.map(|(i, name)| with_unit(name, stated(i))).collect();
        let mut entities: BTreeMap<&str, Entity> = BTreeMap::new();
        let mut ignored = Vec::new();
        // A column `point` beside named markers is somebody's remark.
        let is_nameless = |name: &String| matches!(meaning(name), Meaning::Part { entity: "", .. });
        let nameless = names.iter().any(is_nameless);
        // Before the rules there is what the map names.
        let tracked = self.slots.iter().any(|s| s.kind == SlotKind::Tracker);
        let joints = joints_like_coordinates(&names, mapped, tracked, known);
        for (i, name) in names.iter().enumerate().filter(|&(i, _)| !mapped[i]) {
            match of_joint(name, &joints).unwrap_or_else(|| meaning(name)) {
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
                Meaning::Entity if self.entity.is_none() && (name != "point" || nameless) => {
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
                Meaning::Temperature(name) => {
                    let slot = self.slot(i, SlotKind::Robot, 1.0);
                    self.temperatures.push((name.to_string(), slot));
                }
                Meaning::Time(_)
                | Meaning::Received
                | Meaning::Counter
                | Meaning::Entity
                | Meaning::Unknown => {
                    // A speed or a current is not read, and says so.
                    let other = stated(i) == Some(StatedUnit::Other) || known.is_remark(i);
                    let own = &self.names[i];
                    if !lenient && !other && !name.is_empty() {
                        return Err(unknown(own));
                    }
                    ignored.extend((!name.is_empty()).then(|| own.clone()));
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

    /// Plans a marker or body from its collected columns, or by rule 4 a prismatic joint.
    fn entity_by_rules(
        &mut self,
        name: &str,
        entity: &Entity,
        names: &[String],
    ) -> Result<(), Problem> {
        let has_rotation = entity.has_rotation();
        if entity.axis_count() == 1 && !has_rotation && !entity.dotted {
            self.prismatic_by_rules(name, entity);
            return Ok(());
        }
        let kind = entity.kind();
        let take = |layout: &mut Layout, part: Part, missing: &str| match entity.parts.get(&part) {
            Some(&(column, scale)) => Ok(layout.slot(column, SlotKind::Tracker, scale)),
            None => Err(entity.incomplete(name, missing, names)),
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
                inverted: false,
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

    /// Rule 4: a lone `NAME_x_m` is a prismatic joint.
    fn prismatic_by_rules(&mut self, name: &str, entity: &Entity) {
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
    }
}

impl Entity {
    fn axis_count(&self) -> usize {
        (0..3)
            .filter(|&i| self.parts.contains_key(&Part::Axis(i)))
            .count()
    }

    fn has_rotation(&self) -> bool {
        self.parts
            .keys()
            .any(|part| matches!(part, Part::Quaternion(_)))
    }

    fn kind(&self) -> &'static str {
        if self.has_rotation() {
            "body"
        } else {
            "marker"
        }
    }

    /// The problem of an entity without its column `missing`.
    fn incomplete(&self, name: &str, missing: &str, names: &[String]) -> Problem {
        let join = if name.is_empty() {
            String::new()
        } else if self.dotted {
            format!("{name}.")
        } else {
            format!("{name}_")
        };
        let present: Vec<String> = self
            .parts
            .values()
            .map(|&(i, _)| format!("`{}`", names[i]))
            .collect();
        Problem::IncompleteEntity {
            entity: self.kind(),
            name: name.to_string(),
            missing: format!("{join}{missing}"),
            present: present.join(", "),
        }
    }
}
