//! From a URDF's text to a checked [`RobotModel`].
//!
//! Everything that kinematics needs is checked here, with its place, and all findings are reported at once. Readers
//! elsewhere are more trusting: urdf-rs 0.10 takes `xyz="0 abc 0"`, doubled names, unknown parents and circles without
//! a word, and turns a `quat_xyzw` near pitch ±π/2 by up to 0.26°. It is therefore the second reader, whose
//! forward kinematics a patched file has to agree with (see [`crate::verify()`]), and not the first.
//!
//! What does not bear on kinematics (visuals, collisions, meshes, `<gazebo>`, `<ros2_control>`) is not looked at.

use crate::error::{Hint, Problem, ReadError, ReadProblem};
use crate::model::{
    Inertial, Joint, JointId, JointKind, JointLimits, Link, LinkId, Mimic, MimicLaw, RobotModel,
};
use crate::nearest::nearest;
use crate::rpy::rotation_from_rpy;
use crate::source::{
    decode, has_quaternions, is_element, parse, read_text, top_level, value_start, xacro_evidence,
};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::{Document, Node};
use std::collections::BTreeMap;
use std::path::Path;

/// Findings that are collected of one file.
const MAX_FINDINGS: usize = 50;
/// The types of the standard that move one coordinate or none.
const JOINT_TYPES: [&str; 4] = ["revolute", "continuous", "prismatic", "fixed"];
/// The types of the standard (and of URDF 1.2) that a chain of single motions does not cover.
const UNSUPPORTED_TYPES: [&str; 3] = ["floating", "planar", "spherical"];

impl RobotModel {
    /// Reads and checks a URDF. `name_for_errors` stands in the messages, typically the path as the person gave it.
    ///
    /// # Errors
    /// [`ReadError`] with every finding: see [`Problem`].
    pub fn from_urdf_text(text: &str, name_for_errors: &str) -> Result<Self, ReadError> {
        let document = parse(text, name_for_errors)?;
        if let Some((offset, evidence)) = xacro_evidence(&document) {
            let found = ReadProblem::at(text, offset, Problem::Xacro { evidence });
            return Err(ReadError::one(name_for_errors, found));
        }
        let mut reader = Reader {
            text,
            quaternions: has_quaternions(&document),
            found: Vec::new(),
        };
        let model = reader.robot(&document);
        match model {
            Some(model) if reader.found.is_empty() => Ok(model),
            _ => {
                let mut problems = reader.found;
                problems.sort_by_key(|found| found.place);
                Err(ReadError {
                    file: name_for_errors.to_owned(),
                    problems,
                })
            }
        }
    }

    /// [`RobotModel::from_urdf_text`] of bytes, which may turn out not to be text.
    ///
    /// # Errors
    /// [`ReadError`]: see [`decode`] and [`RobotModel::from_urdf_text`].
    pub fn from_urdf_bytes(bytes: &[u8], name_for_errors: &str) -> Result<Self, ReadError> {
        Self::from_urdf_text(decode(bytes, name_for_errors)?, name_for_errors)
    }

    /// [`RobotModel::from_urdf_text`] of a file.
    ///
    /// # Errors
    /// [`ReadError`]: see [`read_text`] and [`RobotModel::from_urdf_text`].
    pub fn from_urdf_file(path: &Path) -> Result<Self, ReadError> {
        let name = path.display().to_string();
        Self::from_urdf_text(&read_text(path, &name)?, &name)
    }
}

/// A joint whose names are not yet ids.
struct RawJoint<'a, 'b> {
    node: Node<'a, 'b>,
    name: &'a str,
    parent: Node<'a, 'b>,
    child: Node<'a, 'b>,
    origin: Isometry3<f64>,
    kind: JointKind,
    limits: JointLimits,
    mimic: Option<(Node<'a, 'b>, f64, f64)>,
}

/// Collects findings, so that a person sees all of them at once.
struct Reader<'t> {
    text: &'t str,
    quaternions: bool,
    found: Vec<ReadProblem>,
}

impl Reader<'_> {
    fn report(&mut self, offset: usize, problem: Problem) {
        if self.full() {
            return;
        }
        self.found.push(ReadProblem::at(self.text, offset, problem));
    }

    /// More than a screen shows: the rest is not even looked up, since each place costs a walk through the text.
    fn full(&self) -> bool {
        self.found.len() >= MAX_FINDINGS
    }

    fn line_of(&self, node: Node<'_, '_>) -> usize {
        if self.full() {
            return 0;
        }
        crate::error::Place::of_byte(self.text, node.range().start).line
    }

    fn robot(&mut self, document: &Document<'_>) -> Option<RobotModel> {
        let mut links = Vec::new();
        let mut link_nodes = Vec::new();
        let mut link_ids = BTreeMap::new();
        for node in top_level(document, "link") {
            let Some(name) = self.name(node) else {
                continue;
            };
            if let Some(LinkId(first)) = link_ids.get(name) {
                let first_line = self.line_of(link_nodes[*first as usize]);
                self.report(
                    node.range().start,
                    Problem::DuplicateName {
                        kind: "link",
                        name: name.to_owned(),
                        first_line,
                    },
                );
                continue;
            }
            let inertial = self.inertial(node, name);
            link_ids.insert(name.to_owned(), LinkId(links.len() as u32));
            links.push(Link {
                name: name.to_owned(),
                parent_joint: None,
                child_joints: Vec::new(),
                inertial,
            });
            link_nodes.push(node);
        }
        if links.is_empty() && self.found.is_empty() {
            self.report(document.root_element().range().start, Problem::NoLinks);
        }

        let mut raw_joints: Vec<RawJoint<'_, '_>> = Vec::new();
        let mut joint_ids = BTreeMap::new();
        for node in top_level(document, "joint") {
            let Some(joint) = self.joint(node) else {
                continue;
            };
            if let Some(JointId(first)) = joint_ids.get(joint.name) {
                let first_line = self.line_of(raw_joints[*first as usize].node);
                let name = joint.name.to_owned();
                self.report(
                    node.range().start,
                    Problem::DuplicateName {
                        kind: "joint",
                        name,
                        first_line,
                    },
                );
                continue;
            }
            joint_ids.insert(joint.name.to_owned(), JointId(raw_joints.len() as u32));
            raw_joints.push(joint);
        }

        // A link or joint that could not be read would turn up again as "does not exist".
        if !self.found.is_empty() {
            return None;
        }
        let mut joints = Vec::new();
        for (i, raw) in raw_joints.iter().enumerate() {
            let parent = self.link_of(raw, raw.parent, "parent", &link_ids);
            let child = self.link_of(raw, raw.child, "child", &link_ids);
            let mimic = raw.mimic.and_then(|(node, multiplier, offset)| {
                self.mimic_source(raw, node, &raw_joints, &joint_ids)
                    .map(|joint| Mimic {
                        joint,
                        multiplier,
                        offset,
                    })
            });
            let (Some(parent), Some(child)) = (parent, child) else {
                continue;
            };
            let id = JointId(i as u32);
            joints.push(Joint {
                name: raw.name.to_owned(),
                parent,
                child,
                parent_link_from_joint: raw.origin,
                kind: raw.kind,
                limits: raw.limits,
                mimic,
                law: MimicLaw {
                    source: id,
                    multiplier: 1.0,
                    offset: 0.0,
                },
            });
        }
        if !self.found.is_empty() {
            return None;
        }

        for (i, joint) in joints.iter().enumerate() {
            let id = JointId(i as u32);
            if let Some(first) = links[joint.child.index()].parent_joint {
                let problem = Problem::TwoParents {
                    link: links[joint.child.index()].name.clone(),
                    first: joints[first.index()].name.clone(),
                    first_line: self.line_of(raw_joints[first.index()].node),
                    second: joint.name.clone(),
                };
                self.report(raw_joints[i].child.range().start, problem);
                continue;
            }
            links[joint.child.index()].parent_joint = Some(id);
            links[joint.parent.index()].child_joints.push(id);
        }
        if !self.found.is_empty() {
            return None;
        }
        self.circles(&links, &joints, &raw_joints);
        let roots: Vec<usize> = (0..links.len())
            .filter(|i| links[*i].parent_joint.is_none())
            .collect();
        if roots.len() > 1 {
            let names = roots.iter().map(|i| links[*i].name.clone()).collect();
            self.report(
                link_nodes[roots[1]].range().start,
                Problem::SeveralRoots { roots: names },
            );
        }
        self.follow_mimics(&mut joints, &raw_joints);
        if !self.found.is_empty() {
            return None;
        }
        let root = LinkId(*roots.first()? as u32);
        let from_root = breadth_first(root, &links, &joints);
        let name = document
            .root_element()
            .attribute("name")
            .unwrap_or("")
            .to_owned();
        Some(RobotModel {
            name,
            links,
            joints,
            root,
            from_root,
            link_ids,
            joint_ids,
        })
    }

    /// The `name` of a link or joint.
    fn name<'a>(&mut self, node: Node<'a, '_>) -> Option<&'a str> {
        self.required(node, "name").filter(|name| {
            let blank = name.trim().is_empty();
            if blank {
                let problem = Problem::MissingAttribute {
                    element: node.tag_name().name().to_owned(),
                    attribute: "name",
                    hint: Hint::default(),
                };
                self.report(node.range().start, problem);
            }
            !blank
        })
    }

    fn required<'a>(&mut self, node: Node<'a, '_>, attribute: &'static str) -> Option<&'a str> {
        let value = node.attribute(attribute);
        if value.is_none() {
            let near = nearest(attribute, node.attributes().map(|a| a.name()));
            let problem = Problem::MissingAttribute {
                element: node.tag_name().name().to_owned(),
                attribute,
                hint: Hint(near.map(|written| format!("{attribute}` instead of `{written}"))),
            };
            self.report(node.range().start, problem);
        }
        value
    }

    /// The one child element of that name.
    fn only<'a, 'b>(
        &mut self,
        node: Node<'a, 'b>,
        element: &'static str,
        owner: &str,
    ) -> Option<Node<'a, 'b>> {
        let mut all = node.children().filter(|child| is_element(*child, element));
        let first = all.next()?;
        if let Some(second) = all.next() {
            let first_line = self.line_of(first);
            self.report(
                second.range().start,
                Problem::RepeatedElement {
                    owner: owner.to_owned(),
                    element,
                    first_line,
                },
            );
        }
        Some(first)
    }

    fn inertial(&mut self, link: Node<'_, '_>, name: &str) -> Option<Inertial> {
        let owner = format!("the inertial of link `{name}`");
        let inertial = self.only(link, "inertial", &format!("link `{name}`"))?;
        let mass_node = self.only(inertial, "mass", &owner)?;
        let mass = self.number(mass_node, "value", &owner)?;
        if mass < 0.0 {
            let found = mass_node.attribute("value").unwrap_or("").to_owned();
            self.report(
                mass_node.range().start,
                Problem::NegativeMass {
                    link: name.to_owned(),
                    found,
                },
            );
        }
        let origin = self.origin(inertial, &owner);
        Some(Inertial {
            mass,
            centre_of_mass: Point3::from(origin.translation.vector),
        })
    }

    fn joint<'a, 'b>(&mut self, node: Node<'a, 'b>) -> Option<RawJoint<'a, 'b>> {
        let name = self.name(node)?;
        let owner = format!("joint `{name}`");
        let origin = self.origin(node, &owner);
        let parent = self.link_element(node, "parent", &owner);
        let child = self.link_element(node, "child", &owner);
        let kind = self.kind(node, name, &owner);
        let limits = self.limits(node, name, &owner, kind);
        let mimic = self.mimic(node, &owner);
        Some(RawJoint {
            node,
            name,
            parent: parent?,
            child: child?,
            origin,
            kind: kind?,
            limits,
            mimic,
        })
    }

    fn link_element<'a, 'b>(
        &mut self,
        joint: Node<'a, 'b>,
        element: &'static str,
        owner: &str,
    ) -> Option<Node<'a, 'b>> {
        let Some(node) = self.only(joint, element, owner) else {
            self.report(
                joint.range().start,
                Problem::MissingElement {
                    owner: owner.to_owned(),
                    element,
                },
            );
            return None;
        };
        self.required(node, "link").map(|_| node)
    }

    fn kind(&mut self, node: Node<'_, '_>, name: &str, owner: &str) -> Option<JointKind> {
        let written = self.required(node, "type")?;
        let at = node
            .attribute_node("type")
            .map_or(node.range().start, |a| value_start(&a));
        if UNSUPPORTED_TYPES.contains(&written) {
            self.report(
                at,
                Problem::UnsupportedJointType {
                    joint: name.to_owned(),
                    found: written.to_owned(),
                },
            );
            return None;
        }
        if !JOINT_TYPES.contains(&written) {
            let hint = Hint(nearest(written, JOINT_TYPES).map(str::to_owned));
            self.report(
                at,
                Problem::UnknownJointType {
                    joint: name.to_owned(),
                    found: written.to_owned(),
                    hint,
                },
            );
            return None;
        }
        if written == "fixed" {
            return Some(JointKind::Fixed);
        }
        let axis = self.axis(node, name, owner)?;
        Some(match written {
            "revolute" => JointKind::Revolute { axis },
            "continuous" => JointKind::Continuous { axis },
            _ => JointKind::Prismatic { axis },
        })
    }

    /// `<axis xyz>`, made a unit vector; x where the file gives none.
    fn axis(&mut self, joint: Node<'_, '_>, name: &str, owner: &str) -> Option<Unit<Vector3<f64>>> {
        let Some(node) = self.only(joint, "axis", owner) else {
            return Some(Vector3::x_axis());
        };
        self.unknown_attribute(node, "axis", owner, &["xyz"], "xyz");
        let Some(xyz) = self.triple(node, "xyz", owner) else {
            // Readers take a missing xyz as the default.
            return (!node.has_attribute("xyz")).then(Vector3::x_axis);
        };
        // Scaled first: 1e-200 is a direction, although its square is 0.
        let scale = xyz.amax();
        if scale == 0.0 {
            self.report(
                node.range().start,
                Problem::ZeroAxis {
                    joint: name.to_owned(),
                },
            );
            return None;
        }
        Some(Unit::new_normalize(xyz / scale))
    }

    /// `<origin xyz rpy>`; zeros where the file gives none.
    fn origin(&mut self, owner_node: Node<'_, '_>, owner: &str) -> Isometry3<f64> {
        let Some(node) = self.only(owner_node, "origin", owner) else {
            return Isometry3::identity();
        };
        self.unknown_attribute(
            node,
            "origin",
            owner,
            &["xyz", "rpy", "quat_xyzw"],
            "xyz and rpy",
        );
        let translation = self
            .triple(node, "xyz", owner)
            .unwrap_or_else(Vector3::zeros);
        let rotation = if self.quaternions && node.has_attribute("quat_xyzw") {
            if let Some(rpy) = node.attribute_node("rpy") {
                self.report(
                    value_start(&rpy),
                    Problem::TwoRotations {
                        owner: owner.to_owned(),
                    },
                );
            }
            self.quaternion(node, owner)
        } else {
            rotation_from_rpy(
                &self
                    .triple(node, "rpy", owner)
                    .unwrap_or_else(Vector3::zeros),
            )
        };
        Isometry3::from_parts(Translation3::from(translation), rotation)
    }

    fn quaternion(&mut self, node: Node<'_, '_>, owner: &str) -> UnitQuaternion<f64> {
        let Some([x, y, z, w]) = self.numbers::<4>(node, "quat_xyzw", owner) else {
            return UnitQuaternion::identity();
        };
        match UnitQuaternion::try_new(Quaternion::new(w, x, y, z), f64::MIN_POSITIVE) {
            Some(rotation) => rotation,
            None => {
                self.report(
                    node.range().start,
                    Problem::ZeroQuaternion {
                        owner: owner.to_owned(),
                    },
                );
                UnitQuaternion::identity()
            }
        }
    }

    /// A slip such as `xzy="…"` would otherwise mean "all zeros".
    fn unknown_attribute(
        &mut self,
        node: Node<'_, '_>,
        element: &'static str,
        owner: &str,
        known: &[&str],
        expected: &'static str,
    ) {
        for attribute in node.attributes() {
            if known.contains(&attribute.name()) || attribute.namespace().is_some() {
                continue;
            }
            let meant = nearest(attribute.name(), known.iter().copied())
                .filter(|name| !node.has_attribute(*name));
            // A slip keeps the letters; other names are somebody's extension.
            let slip = meant.is_some_and(|name| same_letters(name, attribute.name()))
                || (known.iter().all(|name| !node.has_attribute(*name))
                    && node.attributes().len() > 0);
            if slip {
                let problem = Problem::UnknownAttribute {
                    owner: owner.to_owned(),
                    element,
                    found: attribute.name().to_owned(),
                    expected,
                    hint: Hint(meant.map(str::to_owned)),
                };
                self.report(attribute.range().start, problem);
            }
        }
    }

    /// `lower` and `upper` are required nowhere here: a calibration does not need them.
    fn limits(
        &mut self,
        joint: Node<'_, '_>,
        name: &str,
        owner: &str,
        kind: Option<JointKind>,
    ) -> JointLimits {
        let Some(node) = self.only(joint, "limit", owner) else {
            return JointLimits::default();
        };
        let mut limits = JointLimits {
            lower: self.optional_number(node, "lower", owner),
            upper: self.optional_number(node, "upper", owner),
            effort: self.optional_number(node, "effort", owner),
            velocity: self.optional_number(node, "velocity", owner),
        };
        match kind {
            Some(JointKind::Continuous { .. } | JointKind::Fixed) => {
                // The standard: these have no position limits, whatever is written.
                limits.lower = None;
                limits.upper = None;
            }
            _ => {
                if let Some((lower, upper)) = limits.range().filter(|(lower, upper)| lower > upper)
                {
                    let problem = Problem::LimitsReversed {
                        joint: name.to_owned(),
                        lower: lower.to_string(),
                        upper: upper.to_string(),
                    };
                    self.report(node.range().start, problem);
                }
            }
        }
        limits
    }

    fn mimic<'a, 'b>(
        &mut self,
        joint: Node<'a, 'b>,
        owner: &str,
    ) -> Option<(Node<'a, 'b>, f64, f64)> {
        let node = self.only(joint, "mimic", owner)?;
        self.required(node, "joint")?;
        let multiplier = self
            .optional_number(node, "multiplier", owner)
            .unwrap_or(1.0);
        let offset = self.optional_number(node, "offset", owner).unwrap_or(0.0);
        Some((node, multiplier, offset))
    }

    fn number(&mut self, node: Node<'_, '_>, attribute: &'static str, owner: &str) -> Option<f64> {
        self.required(node, attribute)?;
        self.optional_number(node, attribute, owner)
    }

    fn optional_number(&mut self, node: Node<'_, '_>, attribute: &str, owner: &str) -> Option<f64> {
        node.has_attribute(attribute)
            .then(|| self.numbers::<1>(node, attribute, owner))?
            .map(|[value]| value)
    }

    fn triple(&mut self, node: Node<'_, '_>, attribute: &str, owner: &str) -> Option<Vector3<f64>> {
        node.has_attribute(attribute)
            .then(|| self.numbers::<3>(node, attribute, owner))?
            .map(Vector3::from)
    }

    /// The N numbers of an attribute that is there.
    fn numbers<const N: usize>(
        &mut self,
        node: Node<'_, '_>,
        attribute: &str,
        owner: &str,
    ) -> Option<[f64; N]> {
        let written = node.attribute_node(attribute)?;
        match parse_numbers(written.value()) {
            Ok(numbers) => Some(numbers),
            Err(fault) => {
                let problem = Problem::BadNumber {
                    owner: owner.to_owned(),
                    attribute: attribute.to_owned(),
                    found: written.value().to_owned(),
                    expected: match N {
                        1 => "a number",
                        3 => "three numbers",
                        _ => "four numbers",
                    },
                    reason: fault.reason,
                };
                // The place of the token, where the text stands as the value does (no entities before it).
                let raw = written.range_value();
                let in_text = self.text.get(raw.clone()) == Some(written.value());
                let offset = raw.start + if in_text { fault.offset } else { 0 };
                self.report(offset, problem);
                None
            }
        }
    }

    fn link_of(
        &mut self,
        joint: &RawJoint<'_, '_>,
        node: Node<'_, '_>,
        role: &'static str,
        link_ids: &BTreeMap<String, LinkId>,
    ) -> Option<LinkId> {
        let attribute = node.attribute_node("link")?;
        let id = link_ids.get(attribute.value()).copied();
        if id.is_none() && !self.full() {
            let near = nearest(attribute.value(), link_ids.keys().map(String::as_str));
            let problem = Problem::UnknownLink {
                joint: joint.name.to_owned(),
                role,
                link: attribute.value().to_owned(),
                hint: Hint(near.map(str::to_owned)),
            };
            self.report(value_start(&attribute), problem);
        }
        id
    }

    fn mimic_source(
        &mut self,
        joint: &RawJoint<'_, '_>,
        node: Node<'_, '_>,
        all: &[RawJoint<'_, '_>],
        joint_ids: &BTreeMap<String, JointId>,
    ) -> Option<JointId> {
        let attribute = node.attribute_node("joint")?;
        let Some(id) = joint_ids.get(attribute.value()).copied() else {
            let others = joint_ids
                .keys()
                .map(String::as_str)
                .filter(|name| *name != joint.name);
            let problem = Problem::UnknownMimic {
                joint: joint.name.to_owned(),
                source_joint: attribute.value().to_owned(),
                hint: Hint(nearest(attribute.value(), others).map(str::to_owned)),
            };
            self.report(value_start(&attribute), problem);
            return None;
        };
        if all[id.index()].kind == JointKind::Fixed {
            let problem = Problem::MimicOfFixed {
                joint: joint.name.to_owned(),
                source_joint: attribute.value().to_owned(),
            };
            self.report(value_start(&attribute), problem);
            return None;
        }
        Some(id)
    }

    /// Every link has at most one parent here, so a walk upwards ends at a root or goes round.
    fn circles(&mut self, links: &[Link], joints: &[Joint], raw: &[RawJoint<'_, '_>]) {
        let mut seen_in_walk = vec![usize::MAX; links.len()];
        for start in 0..links.len() {
            let mut here = start;
            while seen_in_walk[here] == usize::MAX {
                seen_in_walk[here] = start;
                match links[here].parent_joint {
                    Some(joint) => here = joints[joint.index()].parent.index(),
                    None => break,
                }
            }
            if seen_in_walk[here] != start || links[here].parent_joint.is_none() {
                continue;
            }
            // Round once more, from parent to child: collect upwards, then reverse.
            let mut path = Vec::new();
            let mut at = here;
            while let Some(joint) = links[at].parent_joint {
                path.push(links[at].name.clone());
                at = joints[joint.index()].parent.index();
                if at == here {
                    break;
                }
            }
            path.reverse();
            if let Some(joint) = links[here].parent_joint {
                self.report(
                    raw[joint.index()].node.range().start,
                    Problem::Cycle { path },
                );
            }
        }
    }

    /// Fills [`Joint::law`] by walking along the mimics.
    fn follow_mimics(&mut self, joints: &mut [Joint], raw: &[RawJoint<'_, '_>]) {
        let mut reported = vec![false; joints.len()];
        for start in 0..joints.len() {
            let mut law = joints[start].law;
            let mut path = vec![start];
            while let Some(mimic) = joints[law.source.index()].mimic {
                // q = m·q_s + b  and  q_s = m'·q_t + b'   ⇒   q = m·m'·q_t + (m·b' + b)
                law = MimicLaw {
                    source: mimic.joint,
                    multiplier: law.multiplier * mimic.multiplier,
                    offset: law.multiplier * mimic.offset + law.offset,
                };
                let next = mimic.joint.index();
                if let Some(begin) = path.iter().position(|joint| *joint == next) {
                    if !path.iter().any(|joint| reported[*joint]) {
                        let circle = path[begin..]
                            .iter()
                            .map(|joint| joints[*joint].name.clone())
                            .collect();
                        self.report(
                            raw[next].node.range().start,
                            Problem::MimicCycle { path: circle },
                        );
                    }
                    path.iter().for_each(|joint| reported[*joint] = true);
                    break;
                }
                path.push(next);
            }
            joints[start].law = law;
        }
    }
}

fn breadth_first(root: LinkId, links: &[Link], joints: &[Joint]) -> Vec<JointId> {
    let mut order = links[root.index()].child_joints.clone();
    let mut next = 0;
    while next < order.len() {
        let child = joints[order[next].index()].child;
        order.extend(&links[child.index()].child_joints);
        next += 1;
    }
    order
}

/// `xzy` for `xyz`: the same letters in another order, or another case.
fn same_letters(a: &str, b: &str) -> bool {
    let sorted = |text: &str| {
        let mut letters: Vec<char> = text.to_lowercase().chars().collect();
        letters.sort_unstable();
        letters
    };
    sorted(a) == sorted(b)
}

/// Why an attribute is not N finite numbers, and at which byte of the value.
pub(crate) struct NumberFault {
    pub(crate) offset: usize,
    pub(crate) reason: String,
}

/// N finite numbers, separated by white space, as every URDF reader takes them.
pub(crate) fn parse_numbers<const N: usize>(value: &str) -> Result<[f64; N], NumberFault> {
    let mut numbers = [0.0; N];
    let mut count = 0;
    for (offset, token) in tokens(value) {
        let number = parse_number(token).map_err(|reason| NumberFault { offset, reason })?;
        if let Some(place) = numbers.get_mut(count) {
            *place = number;
        }
        count += 1;
    }
    if count == N {
        Ok(numbers)
    } else {
        Err(NumberFault {
            offset: 0,
            reason: format!("there {} {count}", if count == 1 { "is" } else { "are" }),
        })
    }
}

fn parse_number(token: &str) -> Result<f64, String> {
    match token.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        // Rust reads 1e999 as infinity, and inf, infinity and nan as such.
        Ok(_) => Err(format!("`{token}` is not a finite number")),
        Err(_) if token.replace(',', ".").parse::<f64>().is_ok() => {
            Err(format!("`{token}` has a comma where numbers have a point"))
        }
        Err(_) if token.contains(',') => Err(format!(
            "`{token}`: numbers are separated by spaces, not by commas"
        )),
        Err(_) => Err(format!("`{token}` is not a number")),
    }
}

/// The words of an attribute's value with their byte offsets; white space as in XML.
pub(crate) fn tokens(value: &str) -> impl Iterator<Item = (usize, &str)> {
    let is_space = |c: char| matches!(c, ' ' | '\t' | '\n' | '\r');
    value
        .split(is_space)
        .filter(|token| !token.is_empty())
        .map(move |token| {
            // Both are slices of the same text.
            (token.as_ptr() as usize - value.as_ptr() as usize, token)
        })
}
