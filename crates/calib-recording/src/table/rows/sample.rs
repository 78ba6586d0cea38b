//! One sample of a marker or body from the numbers of a row.

use super::{Rows, State};
use crate::error::{At, Placed, Problem};
use crate::model::MarkerSample;
use crate::placeholder::is_placeholder;
use crate::table::header::{BodyPlan, Rotation};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// How far a quaternion's length may be from 1. Four written decimals (NDI) give 1e-4; swapped or scaled columns
/// give tenths.
pub(crate) const UNIT_TOLERANCE: f64 = 5e-3;

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
            rotation,
            inverted,
        } = &self.layout.bodies[index];
        let inverted = *inverted;
        let name = self.name_of(name).to_string();
        let slots = position.iter().chain(rotation.slots());
        let needed = 3 + rotation.slots().len();
        let given = slots
            .clone()
            .filter(|&&slot| !self.values[slot].is_nan())
            .count();
        if given == 0 {
            return Ok(None);
        }
        // The pose of nothing has no position, and often the orientation of a frame that nobody turned.
        let missing = |slots: &[usize]| slots.iter().all(|&slot| self.values[slot].is_nan());
        if missing(position) || missing(rotation.slots()) {
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
            && matches!(rotation, Rotation::Quaternion(_))
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
        let rotation = match rotation {
            Rotation::Quaternion([x, y, z, w]) => {
                let q = Quaternion::new(value(*w), value(*x), value(*y), value(*z));
                let norm = q.norm();
                if (norm - 1.0).abs() > UNIT_TOLERANCE {
                    return Err((
                        At::Line(line),
                        Problem::NotUnit {
                            body: name,
                            norm,
                            tolerance: UNIT_TOLERANCE,
                        },
                    ));
                }
                UnitQuaternion::from_quaternion(q)
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
        let pose = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
        Ok(Some(if inverted { pose.inverse() } else { pose }))
    }
}
