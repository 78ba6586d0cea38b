//! From a URDF's text to a checked [`RobotModel`].
//!
//! Everything that kinematics needs is checked here, with its place, and all findings are reported at once. Readers
//! elsewhere are more trusting: urdf-rs 0.10 takes `xyz="0 abc 0"`, doubled names, unknown parents and circles without
//! a word, and turns a `quat_xyzw` near pitch ±π/2 by up to 0.26°. It is therefore the second reader, whose
//! forward kinematics a patched file has to agree with (see [`crate::verify()`]), and not the first.
//!
//! What does not bear on kinematics (collisions, `<gazebo>`, `<ros2_control>`) is not looked at; visuals are read apart,
//! see [`crate::visual`] and [`crate::mesh`].

mod elements;
pub mod mesh;
mod nesting;
pub(crate) mod numbers;
pub mod source;
mod tree;
pub mod visual;

use crate::error::{Hint, Place, Problem, ReadError, ReadProblem};
use crate::model::{
    Joint, JointId, JointKind, JointLimits, Link, LinkId, Mimic, MimicLaw, RobotModel,
};
use crate::read::source::OwnAttributes as _;
use crate::read::source::{
    decode, has_quaternions, parse, read_text, top_level, value_start, xacro_evidence,
};
use calib_finding::nearest_word;
use nalgebra::Isometry3;
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
            warnings: Vec::new(),
        };
        let model = reader.robot(&document);
        match model {
            Some(mut model) if reader.found.is_empty() => {
                model.warnings = reader.warnings;
                Ok(model)
            }
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

/// Links of the file with their places.
struct ReadLinks<'a, 'b> {
    all: Vec<Link>,
    /// Element of each link.
    nodes: Vec<Node<'a, 'b>>,
    ids: BTreeMap<String, LinkId>,
}

/// Joints of the file whose names are not yet ids.
struct RawJoints<'a, 'b> {
    all: Vec<RawJoint<'a, 'b>>,
    ids: BTreeMap<String, JointId>,
}

/// Collects findings, so that a person sees all of them at once.
struct Reader<'t> {
    text: &'t str,
    quaternions: bool,
    found: Vec<ReadProblem>,
    warnings: Vec<ReadProblem>,
}

impl Reader<'_> {
    fn report(&mut self, offset: usize, problem: Problem) {
        if self.full() {
            return;
        }
        self.found.push(ReadProblem::at(self.text, offset, problem));
    }

    /// What is wrong, and no reason to refuse the robot.
    fn warn(&mut self, offset: usize, problem: Problem) {
        if self.warnings.len() < MAX_FINDINGS {
            self.warnings
                .push(ReadProblem::at(self.text, offset, problem));
        }
    }

    /// More than a screen shows: the rest is not even looked up, since each place costs a walk through the text.
    fn full(&self) -> bool {
        self.found.len() >= MAX_FINDINGS
    }

    fn line_of(&self, node: Node<'_, '_>) -> usize {
        if self.full() {
            return 0;
        }
        Place::of_byte(self.text, node.range().start).line
    }

    /// The whole robot; `None` when anything was found. Each step needs the one before to be without findings: a link
    /// that could not be read would turn up again as "does not exist".
    fn robot(&mut self, document: &Document<'_>) -> Option<RobotModel> {
        let mut links = self.links(document);
        let raw = self.raw_joints(document);
        self.clean()?;
        let mut joints = self.resolve(&raw, &links.ids);
        self.clean()?;
        self.attach(&mut links.all, &joints, &raw.all);
        self.clean()?;
        self.circles(&links.all, &joints, &raw.all);
        let root = self.root(&links);
        self.follow_mimics(&mut joints, &raw.all);
        self.clean()?;
        let root = root?;
        let from_root = tree::breadth_first(root, &links.all, &joints);
        let name = document.root_element().own("name").unwrap_or("").to_owned();
        Some(RobotModel {
            name,
            links: links.all,
            joints,
            root,
            from_root,
            link_ids: links.ids,
            joint_ids: raw.ids,
            warnings: Vec::new(),
        })
    }

    /// `None` when something was found.
    fn clean(&self) -> Option<()> {
        self.found.is_empty().then_some(())
    }

    /// All links, not yet connected.
    fn links<'a, 'b>(&mut self, document: &'a Document<'b>) -> ReadLinks<'a, 'b> {
        let mut links = ReadLinks {
            all: Vec::new(),
            nodes: Vec::new(),
            ids: BTreeMap::new(),
        };
        for node in top_level(document, "link") {
            let Some(name) = self.name(node) else {
                continue;
            };
            if let Some(LinkId(first)) = links.ids.get(name) {
                let first = links.nodes[*first as usize];
                self.duplicate("link", name, node, first);
                continue;
            }
            let inertial = self.inertial(node, name);
            let id = LinkId(links.all.len() as u32);
            links.ids.insert(name.to_owned(), id);
            links.all.push(Link {
                name: name.to_owned(),
                parent_joint: None,
                child_joints: Vec::new(),
                inertial,
            });
            links.nodes.push(node);
        }
        if links.all.is_empty() && self.found.is_empty() {
            self.report(document.root_element().range().start, Problem::NoLinks);
        }
        links
    }

    /// All joints, their links still names.
    fn raw_joints<'a, 'b>(&mut self, document: &'a Document<'b>) -> RawJoints<'a, 'b> {
        let mut joints = RawJoints {
            all: Vec::new(),
            ids: BTreeMap::new(),
        };
        for node in top_level(document, "joint") {
            let Some(joint) = self.joint(node) else {
                continue;
            };
            if let Some(JointId(first)) = joints.ids.get(joint.name) {
                let first = joints.all[*first as usize].node;
                self.duplicate("joint", joint.name, node, first);
                continue;
            }
            let id = JointId(joints.all.len() as u32);
            joints.ids.insert(joint.name.to_owned(), id);
            joints.all.push(joint);
        }
        joints
    }

    /// Two elements of one name: reported at the second.
    fn duplicate(
        &mut self,
        kind: &'static str,
        name: &str,
        second: Node<'_, '_>,
        first: Node<'_, '_>,
    ) {
        let problem = Problem::DuplicateName {
            kind,
            name: name.to_owned(),
            first_line: self.line_of(first),
        };
        self.report(second.range().start, problem);
    }

    /// Joints with ids in place of names; each is its own law until the mimics are followed.
    fn resolve(
        &mut self,
        raw_joints: &RawJoints<'_, '_>,
        link_ids: &BTreeMap<String, LinkId>,
    ) -> Vec<Joint> {
        let mut joints = Vec::new();
        for (i, raw) in raw_joints.all.iter().enumerate() {
            let parent = self.link_of(raw, raw.parent, "parent", link_ids);
            let child = self.link_of(raw, raw.child, "child", link_ids);
            let mimic = raw.mimic.and_then(|(node, multiplier, offset)| {
                self.mimic_source(raw, node, raw_joints).map(|joint| Mimic {
                    joint,
                    multiplier,
                    offset,
                })
            });
            let (Some(parent), Some(child)) = (parent, child) else {
                continue;
            };
            joints.push(Joint {
                name: raw.name.to_owned(),
                parent,
                child,
                parent_link_from_joint: raw.origin,
                kind: raw.kind,
                limits: raw.limits,
                mimic,
                law: MimicLaw {
                    source: JointId(i as u32),
                    multiplier: 1.0,
                    offset: 0.0,
                },
            });
        }
        joints
    }

    /// Connects the links by the joints; a link has at most one parent.
    fn attach(&mut self, links: &mut [Link], joints: &[Joint], raw: &[RawJoint<'_, '_>]) {
        for (i, joint) in joints.iter().enumerate() {
            let id = JointId(i as u32);
            let child = &mut links[joint.child.index()];
            if let Some(first) = child.parent_joint {
                let problem = Problem::TwoParents {
                    link: child.name.clone(),
                    first: joints[first.index()].name.clone(),
                    first_line: self.line_of(raw[first.index()].node),
                    second: joint.name.clone(),
                };
                self.report(raw[i].child.range().start, problem);
                continue;
            }
            child.parent_joint = Some(id);
            links[joint.parent.index()].child_joints.push(id);
        }
    }

    /// The link without parent; a second one is reported. `None` where all links stand in circles.
    fn root(&mut self, links: &ReadLinks<'_, '_>) -> Option<LinkId> {
        let roots: Vec<usize> = (0..links.all.len())
            .filter(|i| links.all[*i].parent_joint.is_none())
            .collect();
        if roots.len() > 1 {
            let names = roots.iter().map(|i| links.all[*i].name.clone()).collect();
            self.report(
                links.nodes[roots[1]].range().start,
                Problem::SeveralRoots { roots: names },
            );
        }
        roots.first().map(|root| LinkId(*root as u32))
    }

    fn link_of(
        &mut self,
        joint: &RawJoint<'_, '_>,
        node: Node<'_, '_>,
        role: &'static str,
        link_ids: &BTreeMap<String, LinkId>,
    ) -> Option<LinkId> {
        let attribute = node.own_attribute("link")?;
        let id = link_ids.get(attribute.value()).copied();
        if id.is_none() && !self.full() {
            let near = nearest_word(attribute.value(), link_ids.keys().map(String::as_str));
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
        joints: &RawJoints<'_, '_>,
    ) -> Option<JointId> {
        let attribute = node.own_attribute("joint")?;
        let Some(id) = joints.ids.get(attribute.value()).copied() else {
            let others = joints
                .ids
                .keys()
                .map(String::as_str)
                .filter(|name| *name != joint.name);
            let problem = Problem::UnknownMimic {
                joint: joint.name.to_owned(),
                source_joint: attribute.value().to_owned(),
                hint: Hint(nearest_word(attribute.value(), others).map(str::to_owned)),
            };
            self.report(value_start(&attribute), problem);
            return None;
        };
        if joints.all[id.index()].kind == JointKind::Fixed {
            let problem = Problem::MimicOfFixed {
                joint: joint.name.to_owned(),
                source_joint: attribute.value().to_owned(),
            };
            // Such a joint stands still, which is what simulators make of it.
            self.warn(value_start(&attribute), problem);
        }
        Some(id)
    }
}
