//! Origins: the joint, the body that moves with it, the swept axes, and what is assumed.

use super::*;
use crate::profile::{Orientation, Origin, PointChoice, SweptAxis};
use crate::raw::{RawOrientation, RawOrigin, RawPoint, RawUse};

impl Checker<'_> {
    pub(super) fn origin(&mut self, name: &str, raw: &RawOrigin) -> Option<Origin> {
        let joint = self.joint(&["origins", name, "joint"], &raw.joint);
        let child = joint.map(|joint| self.robot.joint(joint).child);
        let link = match &raw.link {
            Some(link) => self.link(&["origins", name, "link"], link),
            None => child,
        };
        if let (Some(child), Some(link)) = (child, link)
            && !self.rigidly_joined(child, link)
        {
            let child_name = self.robot.link(child).name.clone();
            self.problem(
                &["origins", name, "link"],
                format!(
                    "link `{}` moves against `{child_name}`, the child link of `{}`",
                    self.robot.link(link).name,
                    raw.joint
                ),
                "name a link that is fixed to it",
            );
        }
        self.origin_body(name, raw, child);
        self.known(
            "recording",
            &["origins", name, "sweep"],
            &raw.sweep,
            self.raw.recordings.keys(),
        );
        if let Some(recording) = self.raw.recordings.get(&raw.sweep)
            && recording.usage == RawUse::Validation
        {
            self.problem(
                &["origins", name, "sweep"],
                format!("`{}` is held out for validation", raw.sweep),
                "sweep another recording, or change its `use`",
            );
        }
        let axes = self.axes(name, raw, joint);
        let orientation = self.orientation(name, raw);
        let point = self.point(name, raw);
        Some(Origin {
            joint: joint?,
            link: link?,
            body: raw.body.clone(),
            sweep: raw.sweep.clone(),
            center: raw
                .center
                .clone()
                .unwrap_or_else(|| DEFAULT_CENTER.to_owned()),
            center_stated: raw.center.is_some(),
            center_parameters: raw.center_parameters.clone(),
            axis: raw.axis.clone().unwrap_or_else(|| DEFAULT_AXIS.to_owned()),
            axis_stated: raw.axis.is_some(),
            axis_parameters: raw.axis_parameters.clone(),
            axes,
            orientation,
            point,
        })
    }

    /// The body that moves with the origin; `child` is the child link of the origin's joint.
    fn origin_body(&mut self, name: &str, raw: &RawOrigin, child: Option<LinkId>) {
        let path = ["origins", name, "body"];
        self.known("body", &path, &raw.body, self.raw.bodies.keys());
        let Some(body) = self.raw.bodies.get(&raw.body) else {
            return;
        };
        if let (Some(child), Ok(body_link)) = (child, self.robot.link_id(&body.link))
            && !self.rigidly_joined(child, body_link)
        {
            self.problem(
                &path,
                format!(
                    "body `{}` sits on `{}`, which moves against the child link of `{}`",
                    raw.body, body.link, raw.joint
                ),
                "mount the body on the joint's child link, or name the joint that carries it",
            );
        }
        if !body.pose && body.markers.len() < 3 {
            self.problem(
                &path,
                format!(
                    "body `{}` has {} markers: they give points, not a frame",
                    raw.body,
                    body.markers.len()
                ),
                "an origin is expressed in a body frame: it needs 3 markers or a 6-DoF body",
            );
        }
    }

    /// The swept joints, proximal first, each checked to turn about the stated axis of the joint frame at zero.
    fn axes(
        &mut self,
        name: &str,
        raw: &RawOrigin,
        origin_joint: Option<JointId>,
    ) -> Vec<SweptAxis> {
        let child = origin_joint.map(|joint| self.robot.joint(joint).child);
        let mut axes: Vec<SweptAxis> = raw
            .axes
            .iter()
            .filter_map(|(label, joint)| self.axis(name, raw, (label, joint), child))
            .collect();
        if raw.axes.len() > 2 {
            self.problem(
                &["origins", name, "axes"],
                format!("{} axes were given", raw.axes.len()),
                "an origin takes one or two swept axes",
            );
        }
        axes.sort_by_key(|a| {
            self.robot
                .chain_to_root(self.robot.joint(a.joint).child)
                .len()
        });
        if let [a, b] = axes.as_slice()
            && a.direction.dot(&b.direction).abs() > SAME_DIRECTION
        {
            self.problem(
                &["origins", name, "axes"],
                "the two axes are parallel",
                "two axes that are not parallel give an orientation",
            );
        }
        axes
    }

    /// One swept axis; `child` is the link that the origin's joint carries.
    fn axis(
        &mut self,
        name: &str,
        raw: &RawOrigin,
        (label, joint_name): (&str, &str),
        child: Option<LinkId>,
    ) -> Option<SweptAxis> {
        let path = ["origins", name, "axes", label];
        let Some(stated) = axis_label(label) else {
            self.key_problem(
                &path,
                format!("`{label}` is not an axis"),
                "axes are x, y, z, -x, -y or -z of the joint frame",
            );
            return None;
        };
        let joint = self.joint(&path, joint_name)?;
        let Some(axis) = self
            .robot
            .joint(joint)
            .kind
            .axis()
            .filter(|_| self.robot.joint(joint).kind.turns())
        else {
            self.problem(
                &path,
                format!("joint `{joint_name}` does not turn"),
                "name a revolute joint",
            );
            return None;
        };
        let child = child?;
        if !self.robot.carries(joint, child) {
            self.problem(
                &path,
                format!(
                    "joint `{joint_name}` does not move `{}`",
                    self.robot.link(child).name
                ),
                "name joints between the root and the origin's joint",
            );
            return None;
        }
        let zero = self.robot.forward_kinematics(&self.robot.zero_positions());
        // child_from_joint · axis, at the zero position
        let at = self.robot.joint(joint).child;
        let in_child = zero[child.index()].rotation.inverse() * zero[at.index()].rotation * axis;
        if in_child.dot(&stated) < SAME_DIRECTION {
            let found = format!("[{:.3}, {:.3}, {:.3}]", in_child.x, in_child.y, in_child.z);
            self.problem(&path, format!("`{joint_name}` turns about {found} of the frame of `{}` at zero, not about `{label}`", raw.joint), "correct the label, or the URDF");
        }
        Some(SweptAxis {
            joint,
            direction: Unit::new_normalize(in_child.into_inner()),
        })
    }

    fn orientation(&mut self, name: &str, raw: &RawOrigin) -> Orientation {
        match &raw.orientation {
            Some(RawOrientation::From(body)) => {
                self.known(
                    "body",
                    &["origins", name, "orientation", "from"],
                    body,
                    self.raw.bodies.keys(),
                );
                Orientation::FromBody(body.clone())
            }
            None => {
                // As many as were written: one whose name is wrong was named above.
                let axes = raw.axes.len();
                if axes < 2 {
                    self.key_problem(&["origins", name], format!("`axes` of origin `{name}` has {axes} of the two entries that its orientation takes"), "name a second swept joint under `axes`, or `orientation: {from: <body>}` to take it from the URDF");
                }
                Orientation::Axes
            }
        }
    }

    fn point(&mut self, name: &str, raw: &RawOrigin) -> Option<PointChoice> {
        match &raw.point {
            Some(RawPoint::NominalDistanceFrom(origin)) => {
                self.known(
                    "origin",
                    &["origins", name, "point", "nominal_distance_from"],
                    origin,
                    self.raw.origins.keys(),
                );
                if origin == name {
                    self.problem(
                        &["origins", name, "point"],
                        "an origin cannot be its own reference",
                        "name another origin",
                    );
                }
                Some(PointChoice::NominalDistanceFrom(origin.clone()))
            }
            Some(RawPoint::FromBodyMm(distance)) => Some(PointChoice::FromBody(distance * MM)),
            None => {
                if raw.axes.len() == 1 {
                    self.key_problem(&["origins", name], format!("`axes` of origin `{name}` has one entry: only a line can be observed, not a point on it"), "name a second swept joint under `axes`, or choose the point with `point: {from_body_mm: 0}` or `point: {nominal_distance_from: <origin>}`");
                }
                None
            }
        }
    }
}

fn axis_label(label: &str) -> Option<Vector3<f64>> {
    let (sign, name) = match label.strip_prefix('-') {
        Some(rest) => (-1.0, rest),
        None => (1.0, label),
    };
    let axis = match name {
        "x" => Vector3::x(),
        "y" => Vector3::y(),
        "z" => Vector3::z(),
        _ => return None,
    };
    Some(axis * sign)
}
