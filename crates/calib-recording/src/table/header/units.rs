//! The row of units below the header against the names of the columns and the column map.

use super::naming::unit_in_name;
use super::{Column, Layout};
use crate::column_map::ColumnMap;
use crate::error::{Against, At, Placed, Problem};
use crate::model::{JointColumn, JointUnit};
use crate::table::stated_unit::{StatedUnit, UnitRow};
use crate::units::{AngleUnit, LengthUnit, TimeUnit};
use std::collections::{BTreeMap, BTreeSet};

/// What a column is read as.
#[derive(Clone, Copy, PartialEq)]
enum Quantity {
    Angle,
    Length,
    Time,
    Torque,
    Celsius,
    None,
}

impl Quantity {
    fn name(self) -> &'static str {
        match self {
            Self::Angle => "an angle",
            Self::Length => "a length",
            Self::Time => "a time",
            Self::Torque => "a torque in N·m",
            Self::Celsius => "a temperature in °C",
            Self::None => "a number without unit",
        }
    }

    /// Units in the SI unit; `None` for a unit of something else.
    fn per_si(self, unit: StatedUnit) -> Option<f64> {
        match (self, unit) {
            (Self::Angle, StatedUnit::Angle(unit)) => Some(unit.per_radian()),
            (Self::Length, StatedUnit::Length(unit)) => Some(unit.per_meter()),
            (Self::Time, StatedUnit::Time(unit)) => Some(unit.per_second()),
            (Self::Torque, StatedUnit::Torque) | (Self::Celsius, StatedUnit::Celsius) => Some(1.0),
            _ => None,
        }
    }

    /// The unit that a column map states for it in words, but for the default.
    fn of_map(self, map: &ColumnMap) -> Option<Against> {
        let of = |key, unit| Some(Against::Map { key, unit });
        match self {
            Self::Angle if map.angles != AngleUnit::default() => of("angles", map.angles.name()),
            Self::Length if map.lengths != LengthUnit::default() => {
                of("lengths", map.lengths.name())
            }
            Self::Time => {
                let time = map.time.as_ref().map(|time| time.unit)?;
                (time != TimeUnit::default())
                    .then(|| of("unit", time.name()))
                    .flatten()
            }
            _ => None,
        }
    }
}

impl Layout {
    /// Takes the units that a row states for columns whose names state none; the names and the map may not contradict them.
    pub(super) fn take_units(&mut self, row: &UnitRow, map: Option<&ColumnMap>) -> Placed<()> {
        for (column, quantity) in self.quantities() {
            let (Some(unit), Column::Number { slot, scale }) =
                (row.units[column], self.columns[column])
            else {
                continue;
            };
            let against = |against| {
                let at = At::Cell {
                    line: row.line,
                    column: self.names[column].clone(),
                };
                let found = unit.name().unwrap_or("another unit").to_owned();
                Err((at, Problem::UnitAgainst { found, against }))
            };
            let Some(per_unit) = quantity.per_si(unit) else {
                return against(Against::Quantity(quantity.name()));
            };
            let named = unit_in_name(&self.names[column], unit);
            if let Some(named) = named.filter(|named| *named != unit) {
                return against(Against::Name(named.name().unwrap_or("another unit")));
            }
            let scale_by_row = if scale < 0.0 { -per_unit } else { per_unit };
            if named.is_none() && scale != scale_by_row {
                if let Some(stated) = map.and_then(|map| quantity.of_map(map)) {
                    return against(stated);
                }
                self.columns[column] = Column::Number {
                    slot,
                    scale: scale_by_row,
                };
            }
        }
        if row.units.iter().any(Option::is_some) {
            self.conversions.push(format!(
                "units from the row below the header (line {})",
                row.line
            ));
        }
        Ok(())
    }

    /// The bodies whose columns hold the pose of the tracker in the body.
    pub(in crate::table) fn inverse_bodies(&self) -> BTreeSet<String> {
        let inverse = self.bodies.iter().filter(|plan| plan.inverted);
        inverse.map(|plan| plan.name.clone()).collect()
    }

    /// The column of each joint, with the unit in which it is read.
    pub(in crate::table) fn joint_columns(&self) -> BTreeMap<String, JointColumn> {
        let of = |(name, unit, slot): &(String, JointUnit, usize)| {
            let column = self.slots[*slot].column;
            let Column::Number { scale, .. } = self.columns[column] else {
                return None;
            };
            let angles = [AngleUnit::Rad, AngleUnit::Deg];
            let angle = angles.iter().find(|unit| unit.per_radian() == scale.abs());
            let length = LengthUnit::ALL
                .iter()
                .find(|unit| unit.per_meter() == scale.abs());
            let unit = match unit {
                JointUnit::Angle => angle.map(|unit| unit.name()),
                JointUnit::Length => length.map(|unit| unit.name()),
            };
            let column = JointColumn {
                name: self.names[column].clone(),
                unit: unit?,
            };
            Some((name.clone(), column))
        };
        self.joints.iter().filter_map(of).collect()
    }

    /// What each column that is read is a measure of.
    fn quantities(&self) -> Vec<(usize, Quantity)> {
        let mut of: Vec<(usize, Quantity)> = Vec::new();
        let mut add = |slot: usize, quantity| of.push((self.slots[slot].column, quantity));
        let times = self.time.iter().chain(&self.received);
        times.for_each(|slot| add(*slot, Quantity::Time));
        self.counter
            .iter()
            .for_each(|slot| add(*slot, Quantity::None));
        for (_, unit, slot) in &self.joints {
            let quantity = match unit {
                JointUnit::Angle => Quantity::Angle,
                JointUnit::Length => Quantity::Length,
            };
            add(*slot, quantity);
        }
        self.torques
            .iter()
            .for_each(|(_, slot)| add(*slot, Quantity::Torque));
        self.temperatures
            .iter()
            .for_each(|(_, slot)| add(*slot, Quantity::Celsius));
        let markers = self.markers.iter().map(|marker| marker.slots);
        let places = markers.chain(self.bodies.iter().map(|body| body.position));
        places
            .flatten()
            .for_each(|slot| add(slot, Quantity::Length));
        for body in &self.bodies {
            let angles = body.rotation.angles();
            for (i, slot) in body.rotation.slots().iter().enumerate() {
                add(
                    *slot,
                    if angles.contains(&i) {
                        Quantity::Angle
                    } else {
                        Quantity::None
                    },
                );
            }
        }
        of
    }
}
