//! The columns that a column map names.

use super::naming::length_unit;
use super::{BodyPlan, Column, Layout, MarkerPlan, Rotation, SlotKind};
use crate::column_map::{BodyColumns, ColumnMap, LongColumns, RotationColumns};
use crate::error::Problem;
use crate::map_fault::{MapFault, StatedUnits, angle_unit};
use crate::model::JointUnit;
use crate::units::{AngleUnit, LengthUnit};
use calib_finding::nearest_word;
use std::ops::Range;

/// Takes the columns that the map names into the layout and marks them in `mapped`.
pub(super) fn apply(
    layout: &mut Layout,
    map: &ColumnMap,
    mapped: &mut [bool],
) -> Result<(), Problem> {
    if let Some(fault) = map.faults(StatedUnits::default()).into_iter().next() {
        return Err(Problem::ColumnMap(fault));
    }
    let mut columns = Mapping {
        layout,
        mapped,
        angle: map.angles,
        body_angle: map.body_angles.unwrap_or(map.angles),
        length: map.lengths,
    };
    if let Some(time) = &map.time {
        let scale = time.unit.per_second();
        let slot = columns.take("time", &time.column, SlotKind::Time, scale)?;
        columns.layout.time = Some(slot);
    }
    columns.robot(map)?;
    columns.markers(map)?;
    columns.bodies(map)?;
    if let Some(long) = &map.long {
        columns.long(long)?;
    }
    columns.labels(&map.labels)?;
    // Whatever is used now is mapped (the slots of `w`, frame and labels were not marked above).
    for (used, column) in mapped.iter_mut().zip(&layout.columns) {
        *used |= *column != Column::Ignore;
    }
    layout.conversions.push(
        format!(
            "column map: angles in {:?}, lengths in {}",
            map.angles,
            map.lengths.name()
        )
        .to_lowercase(),
    );
    Ok(())
}

/// A layout while a map is applied.
struct Mapping<'a> {
    layout: &'a mut Layout,
    /// Columns that the map used so far.
    mapped: &'a mut [bool],
    /// Unit of angles in columns whose names end in none.
    angle: AngleUnit,
    /// The same of rotation vectors and Euler angles.
    body_angle: AngleUnit,
    /// Unit of lengths in columns whose names end in none.
    length: LengthUnit,
}

impl Mapping<'_> {
    /// Where a column stands; `what` needs it.
    fn position(&self, what: &str, column: &str) -> Result<usize, Problem> {
        let names = &self.layout.names;
        names
            .iter()
            .position(|name| name == column)
            .ok_or_else(|| Problem::MissingColumn {
                what: what.to_string(),
                column: column.to_string(),
                nearest: nearest_word(column, names.iter().map(String::as_str)).map(str::to_owned),
            })
    }

    /// The slot of a column of numbers; the map uses it once.
    fn take(
        &mut self,
        what: &str,
        column: &str,
        kind: SlotKind,
        scale: f64,
    ) -> Result<usize, Problem> {
        let i = self.position(what, column)?;
        self.mapped[i] = true;
        Ok(self.layout.slot(i, kind, scale))
    }

    /// The slots of a position's columns.
    fn place(&mut self, what: &str, columns: &[String; 3]) -> Result<[usize; 3], Problem> {
        let mut slots = [0; 3];
        for (slot, column) in slots.iter_mut().zip(columns) {
            let scale = self.lengths(column);
            *slot = self.take(what, column, SlotKind::Tracker, scale)?;
        }
        Ok(slots)
    }

    /// Units per radian of a column: of its name where that ends in a unit, else of the map.
    fn angles(&self, column: &str) -> f64 {
        angle_unit(column).unwrap_or(self.angle).per_radian()
    }

    /// Units per radian of a column of a body's orientation.
    fn body_angles(&self, column: &str) -> f64 {
        angle_unit(column).unwrap_or(self.body_angle).per_radian()
    }

    /// Units per meter of a column: of its name where that ends in a unit, else of the map.
    fn lengths(&self, column: &str) -> f64 {
        let own = length_unit(column).map(|(_, unit)| unit);
        own.unwrap_or(self.length).per_meter()
    }

    /// Joints, torques and temperatures.
    fn robot(&mut self, map: &ColumnMap) -> Result<(), Problem> {
        let named = map.joint_columns.iter().map(|name| (name, name));
        let sign = |joint: &String| match map.reversed.contains(joint) {
            true => -1.0,
            false => 1.0,
        };
        for (joint, column) in map.joints.iter().chain(named) {
            self.joint(joint, column, JointUnit::Angle, sign(joint))?;
        }
        for (joint, column) in &map.prismatic {
            self.joint(joint, column, JointUnit::Length, sign(joint))?;
        }
        for (joint, column) in &map.torques {
            let what = format!("torque of `{joint}`");
            let slot = self.take(&what, column, SlotKind::Robot, 1.0)?;
            self.layout.torques.push((joint.clone(), slot));
        }
        for (joint, column) in &map.temperatures {
            let what = format!("temperature of `{joint}`");
            let slot = self.take(&what, column, SlotKind::Robot, 1.0)?;
            self.layout.temperatures.push((joint.clone(), slot));
        }
        Ok(())
    }

    /// `sign`: −1 for a column that counts the other way.
    fn joint(
        &mut self,
        joint: &str,
        column: &str,
        unit: JointUnit,
        sign: f64,
    ) -> Result<(), Problem> {
        let per_unit = match unit {
            JointUnit::Angle => self.angles(column),
            JointUnit::Length => self.lengths(column),
        };
        let scale = sign * per_unit;
        let what = format!("joint `{joint}`");
        let slot = self.take(&what, column, SlotKind::Robot, scale)?;
        self.layout.joints.push((joint.to_string(), unit, slot));
        Ok(())
    }

    /// Markers by name, or the template of a long table.
    fn markers(&mut self, map: &ColumnMap) -> Result<(), Problem> {
        for (name, columns) in &map.markers {
            let slots = self.place(&format!("marker `{name}`"), columns)?;
            self.layout.markers.push(MarkerPlan {
                name: name.clone(),
                slots,
            });
        }
        let long = map.long.as_ref().and_then(|long| long.marker.as_ref());
        if let Some(columns) = long {
            let slots = self.place("the markers", columns)?;
            self.layout.markers.push(MarkerPlan {
                name: String::new(),
                slots,
            });
        }
        Ok(())
    }

    /// Bodies by name, or the template of a long table.
    fn bodies(&mut self, map: &ColumnMap) -> Result<(), Problem> {
        let named = map.bodies.iter().map(|(name, c)| (name.as_str(), c));
        let long = map.long.as_ref().and_then(|long| long.body.as_ref());
        for (name, columns) in named.chain(long.map(|c| ("", c))) {
            let what = format!("body `{name}`");
            let position = self.place(&what, &columns.position)?;
            let rotation = self.rotation(&what, columns)?;
            self.layout.bodies.push(BodyPlan {
                name: name.to_string(),
                position,
                rotation,
                inverted: columns.inverted,
            });
        }
        Ok(())
    }

    /// The one rotation of a body.
    fn rotation(&mut self, what: &str, columns: &BodyColumns) -> Result<Rotation, Problem> {
        let given: Vec<RotationColumns<'_>> = columns.rotations().collect();
        let [given] = given[..] else {
            return Err(Problem::ColumnMap(MapFault::Rotations {
                path: vec![what.to_string()],
                count: given.len(),
            }));
        };
        let angles = given.angles();
        Ok(match given {
            RotationColumns::QuaternionXyzw(of) => {
                Rotation::Quaternion(self.slots(what, of, angles)?)
            }
            RotationColumns::QuaternionWxyz(of) => {
                let [w, x, y, z] = self.slots(what, of, angles)?;
                Rotation::Quaternion([x, y, z, w])
            }
            RotationColumns::RotationVector(of) => Rotation::Vector(self.slots(what, of, angles)?),
            RotationColumns::FixedXyz(of) => Rotation::FixedXyz(self.slots(what, of, angles)?),
            RotationColumns::Euler(axes, of) => {
                Rotation::Euler(axes, self.slots(what, of, angles)?)
            }
            RotationColumns::Matrix(of) => Rotation::Matrix(self.slots(what, of, angles)?),
            RotationColumns::AxisAngle(of) => Rotation::AxisAngle(self.slots(what, of, angles)?),
        })
    }

    /// The slots of a rotation's columns, of which these are `angles`.
    fn slots<const N: usize>(
        &mut self,
        what: &str,
        columns: &[String; N],
        angles: Range<usize>,
    ) -> Result<[usize; N], Problem> {
        let mut slots = [0; N];
        for (i, (slot, column)) in slots.iter_mut().zip(columns).enumerate() {
            let scale = match angles.contains(&i) {
                true => self.body_angles(column),
                false => 1.0,
            };
            *slot = self.take(what, column, SlotKind::Tracker, scale)?;
        }
        Ok(slots)
    }

    /// Names and frames of a long table.
    fn long(&mut self, long: &LongColumns) -> Result<(), Problem> {
        let name = self.position("the long table", &long.name)?;
        let frame = self.position("the long table", &long.frame)?;
        let layout = &mut *self.layout;
        layout.entity = Some(name);
        layout.columns[name] = Column::Entity;
        layout.counter = Some(layout.slot(frame, SlotKind::Counter, 1.0));
        Ok(())
    }

    fn labels(&mut self, labels: &[String]) -> Result<(), Problem> {
        for label in labels {
            let i = self.position("a label", label)?;
            self.layout.columns[i] = Column::Label(self.layout.labels.len());
            self.layout.labels.push(label.clone());
        }
        Ok(())
    }
}
