//! What a `<link>` and a `<joint>` say, element by element.

use super::{JOINT_TYPES, RawJoint, Reader, UNSUPPORTED_TYPES};
use crate::error::{Hint, Problem};
use crate::kinematics::rpy::rotation_from_rpy;
use crate::model::{Inertial, JointKind, JointLimits};
use crate::read::numbers::parse_numbers;
use crate::read::source::OwnAttributes as _;
use crate::read::source::{is_element, value_start};
use calib_finding::nearest_word;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::Node;

impl Reader<'_> {
    /// The `name` of a link or joint.
    pub(super) fn name<'a>(&mut self, node: Node<'a, '_>) -> Option<&'a str> {
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
        let value = node.own(attribute);
        if value.is_none() {
            let near = nearest_word(attribute, node.attributes().map(|a| a.name()));
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

    pub(super) fn inertial(&mut self, link: Node<'_, '_>, name: &str) -> Option<Inertial> {
        let owner = format!("the inertial of link `{name}`");
        let inertial = self.only(link, "inertial", &format!("link `{name}`"))?;
        let mass_node = self.only(inertial, "mass", &owner)?;
        let mass = self.number(mass_node, "value", &owner)?;
        if mass < 0.0 {
            let found = mass_node.own("value").unwrap_or("").to_owned();
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
            center_of_mass: Point3::from(origin.translation.vector),
        })
    }

    pub(super) fn joint<'a, 'b>(&mut self, node: Node<'a, 'b>) -> Option<RawJoint<'a, 'b>> {
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
            .own_attribute("type")
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
            let hint = Hint(nearest_word(written, JOINT_TYPES).map(str::to_owned));
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
            return (!node.has_own("xyz")).then(Vector3::x_axis);
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
        let rotation = if self.quaternions && node.has_own("quat_xyzw") {
            if let Some(rpy) = node.own_attribute("rpy") {
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

    /// A typo such as `xzy="…"` would otherwise mean "all zeros".
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
            let meant = nearest_word(attribute.name(), known.iter().copied())
                .filter(|name| !node.has_own(name));
            // A typo keeps the letters; other names are extensions.
            let typo = meant.is_some_and(|name| same_letters(name, attribute.name()))
                || (known.iter().all(|name| !node.has_own(name)) && node.attributes().len() > 0);
            if typo {
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
                    // Many joints of a robot take no part in a calibration.
                    self.warn(node.range().start, problem);
                    limits.lower = None;
                    limits.upper = None;
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
        node.has_own(attribute)
            .then(|| self.numbers::<1>(node, attribute, owner))?
            .map(|[value]| value)
    }

    fn triple(&mut self, node: Node<'_, '_>, attribute: &str, owner: &str) -> Option<Vector3<f64>> {
        node.has_own(attribute)
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
        let written = node.own_attribute(attribute)?;
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
