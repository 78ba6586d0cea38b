//! A joint's `<origin>`, `<axis>` and `<limit>`.

use super::attribute::Site;
use super::patcher::Patcher;
use crate::edit::decimal::{SAME_NUMBER, decimals, tidy_angle};
use crate::edit::error::EditError;
use crate::edit::insert;
use crate::edit::rotation::{is_zero, quaternion_near, rpy_for};
use crate::kinematics::rpy::{angle_between, rotation_from_rpy, rpy_from_rotation};
use crate::read::source::OwnAttributes as _;
use crate::read::source::child;
use crate::xacro::value::Context;
use crate::xacro::{self, Block};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3, Vector4};

impl Patcher<'_, '_> {
    pub(super) fn set_origin(
        &mut self,
        joint: &str,
        wanted: &Isometry3<f64>,
    ) -> Result<(), EditError> {
        let (node, mut call) = self.joint_and_call(joint)?;
        let mut written = child(node, "origin");
        if written.is_none() && self.is_xacro {
            match xacro::block(self.context.document, node, call) {
                Block::None => {
                    if let Some(inside) = xacro::gives_origin(node) {
                        return Err(EditError::XacroChosen {
                            file: self.file.to_owned(),
                            place: self.place(inside.range().start),
                            joint: joint.to_owned(),
                            element: inside.tag_name().name().to_owned(),
                        });
                    }
                }
                // The text of one call is that of one joint.
                Block::Origin(origin) => (written, call) = (Some(origin), None),
                Block::Hidden(insert) => {
                    return Err(EditError::XacroBlock {
                        file: self.file.to_owned(),
                        place: self.place(insert.range().start),
                        joint: joint.to_owned(),
                        block: insert.own("name").unwrap_or("").to_owned(),
                    });
                }
            }
        }
        let xyz = wanted.translation.vector;
        let mut before = Isometry3::identity();
        let Some(origin) = written else {
            self.before.insert(joint.to_owned(), before);
            let rpy = rpy_from_rotation(&wanted.rotation).map(tidy_angle);
            if is_zero(&xyz)
                && angle_between(&wanted.rotation, &UnitQuaternion::identity()) <= SAME_NUMBER
            {
                return Ok(());
            }
            if call.is_some() {
                let Context { text, document, .. } = self.context;
                return Err(xacro::several_calls(document, text, node, joint, self.file));
            }
            let element = format!(
                "<{}origin xyz=\"{}\" rpy=\"{}\"/>",
                insert::prefix(self.context.text, node),
                decimals(xyz.as_slice()),
                decimals(rpy.as_slice())
            );
            self.insert_element(node, joint, "origin", element);
            return Ok(());
        };
        let site = |name| Site {
            element: origin,
            joint,
            name,
            call,
        };
        self.set_numbers::<3>(&site("xyz"), [0.0; 3], |old| {
            before.translation.vector = old.into();
            xyz.into()
        })?;
        if self.quaternions && origin.has_own("quat_xyzw") {
            self.set_numbers::<4>(&site("quat_xyzw"), [0.0, 0.0, 0.0, 1.0], |old| {
                before.rotation =
                    UnitQuaternion::new_normalize(Quaternion::from(Vector4::from(old)));
                quaternion_near(&wanted.rotation, old)
            })?;
        } else {
            self.set_numbers::<3>(&site("rpy"), [0.0; 3], |old| {
                before.rotation = rotation_from_rpy(&Vector3::from(old));
                rpy_for(&wanted.rotation, old)
            })?;
        }
        self.before.insert(joint.to_owned(), before);
        Ok(())
    }

    pub(super) fn set_axis(&mut self, joint: &str, wanted: &Vector3<f64>) -> Result<(), EditError> {
        let node = self.joint(joint)?;
        if node.own("type") == Some("fixed") {
            let place = self.place(node.range().start);
            return Err(EditError::NoAxis {
                file: self.file.to_owned(),
                place,
                joint: joint.to_owned(),
            });
        }
        let keep_direction = |old: [f64; 3]| {
            let old = Vector3::from(old);
            // A text such as "0 2 0" already is this direction.
            let same = (old / old.norm() - wanted).amax() <= SAME_NUMBER;
            if same { old.into() } else { (*wanted).into() }
        };
        match child(node, "axis") {
            Some(axis) => {
                let site = Site {
                    element: axis,
                    joint,
                    name: "xyz",
                    call: None,
                };
                self.set_numbers::<3>(&site, [1.0, 0.0, 0.0], keep_direction)
            }
            None if is_zero(&(wanted - Vector3::x())) => Ok(()),
            None => {
                let element = format!(
                    "<{}axis xyz=\"{}\"/>",
                    insert::prefix(self.context.text, node),
                    decimals(wanted.as_slice())
                );
                self.insert_element(node, joint, "axis", element);
                Ok(())
            }
        }
    }

    pub(super) fn set_limits(
        &mut self,
        joint: &str,
        lower: f64,
        upper: f64,
    ) -> Result<(), EditError> {
        let node = self.joint(joint)?;
        if let Some(kind @ ("fixed" | "continuous")) = node.own("type") {
            return Err(EditError::NoPositionLimits {
                file: self.file.to_owned(),
                place: self.place(node.range().start),
                joint: joint.to_owned(),
                kind: kind.to_owned(),
            });
        }
        let Some(limit) = child(node, "limit") else {
            let place = self.place(node.range().start);
            return Err(EditError::NoLimit {
                file: self.file.to_owned(),
                place,
                joint: joint.to_owned(),
            });
        };
        // NaN: a limit that is not written is written, also when it is 0.
        let site = |name| Site {
            element: limit,
            joint,
            name,
            call: None,
        };
        self.set_numbers::<1>(&site("lower"), [f64::NAN], |_| [lower])?;
        self.set_numbers::<1>(&site("upper"), [f64::NAN], |_| [upper])
    }
}
