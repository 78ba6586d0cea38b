//! One sample of a marker or body from the numbers of a row.

use super::{Rows, State};
use crate::error::{At, Placed, Problem};
use crate::model::MarkerSample;
use crate::placeholder::is_placeholder;
use crate::rotation::{axis_angle, from_matrix, quaternion};
use crate::table::header::{BodyPlan, Rotation};
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};

impl Rows<'_> {
    /// Name of a plan, or in a long table of the row's entity.
    fn name_of<'b>(&'b self, plan: &'b str) -> &'b str {
        if plan.is_empty() { &self.entity } else { plan }
    }

    /// The sample of this marker.
    pub(super) fn marker(&mut self, line: u64, index: usize) -> Placed<MarkerSample> {
        let plan = &self.layout.markers[index];
        let [x, y, z] = plan.slots.map(|slot| self.values[slot]);
        let given = [x, y, z].iter().filter(|value| !value.is_nan()).count();
        let state = self.states[index];
        if given == 0 || state == State::Lost {
            return Ok(MarkerSample::Lost);
        }
        if given < 3 {
            let name = self.name_of(&plan.name).to_string();
            return Err((
                At::Line(line),
                Problem::PartlyLost {
                    entity: "marker",
                    name,
                    given,
                    needed: 3,
                },
            ));
        }
        if x == 0.0 && y == 0.0 && z == 0.0 && !self.map.is_some_and(|map| map.zero_is_a_point) {
            let name = self.name_of(&plan.name).to_string();
            self.zeros.entry(name).or_default().push(line);
            return Ok(MarkerSample::Lost);
        }
        if is_placeholder([x, y, z]) {
            let name = self.name_of(&plan.name).to_string();
            self.placeholders.take(&name, [x, y, z], line);
            return Ok(MarkerSample::Lost);
        }
        let point = Point3::new(x, y, z);
        Ok(if state == State::Filled {
            MarkerSample::Filled(point)
        } else {
            MarkerSample::Measured(point)
        })
    }

    /// The pose of this body, `None` when it was lost.
    pub(super) fn body(&mut self, line: u64, index: usize) -> Placed<Option<Isometry3<f64>>> {
        let BodyPlan {
            name,
            position,
            rotation: by,
            inverted,
        } = &self.layout.bodies[index];
        let inverted = *inverted;
        let name = self.name_of(name).to_string();
        let slots = position.iter().chain(by.slots());
        let needed = 3 + by.slots().len();
        let given = slots
            .clone()
            .filter(|&&slot| !self.values[slot].is_nan())
            .count();
        if given == 0 {
            return Ok(None);
        }
        // The pose of nothing has no position, and often the orientation of a frame that nobody turned.
        let missing = |slots: &[usize]| slots.iter().all(|&slot| self.values[slot].is_nan());
        if missing(position) || missing(by.slots()) {
            self.halves.entry(name).or_default().push(line);
            return Ok(None);
        }
        if given < needed {
            return Err((
                At::Line(line),
                Problem::PartlyLost {
                    entity: "body",
                    name,
                    given,
                    needed,
                },
            ));
        }
        if slots.clone().all(|&slot| self.values[slot] == 0.0)
            && matches!(by, Rotation::Quaternion(_) | Rotation::Matrix(_))
        {
            self.zeros.entry(name).or_default().push(line);
            return Ok(None);
        }
        if self
            .placeholders
            .take(&name, position.map(|slot| self.values[slot]), line)
        {
            return Ok(None);
        }
        let value = |slot: usize| self.values[slot];
        let turned = match by {
            Rotation::Quaternion(slots) => quaternion(At::Line(line), &name, slots.map(value))?,
            Rotation::Matrix(slots) => {
                let matrix = Matrix3::from_row_slice(&slots.map(value));
                from_matrix(At::Line(line), &name, &matrix)?
            }
            Rotation::AxisAngle(slots) => {
                let [x, y, z, angle] = slots.map(value);
                axis_angle(At::Line(line), &name, Vector3::new(x, y, z), angle)?
            }
            Rotation::Vector(slots) => {
                let [x, y, z] = slots.map(value);
                UnitQuaternion::from_scaled_axis(Vector3::new(x, y, z))
            }
            Rotation::FixedXyz(slots) => {
                let [a, b, c] = slots.map(value);
                UnitQuaternion::from_euler_angles(a, b, c)
            }
            Rotation::Euler(axes, slots) => axes.rotation(slots.map(value)),
        };
        let [x, y, z] = position.map(value);
        let pose = Isometry3::from_parts(Translation3::new(x, y, z), turned);
        Ok(Some(if inverted { pose.inverse() } else { pose }))
    }
}
