//! What a URDF says of the look of its links: `<visual>` shapes, read apart from the kinematics.
//!
//! A picture is not a reason to refuse a robot: a shape that cannot be read is a [`VisualFault`], never an error, and
//! [`RobotModel`](crate::RobotModel) does not depend on any of it. Meshes are named, not opened.

use crate::error::{Place, ReadError};
use crate::kinematics::rpy::rotation_from_rpy;
use crate::read::numbers::parse_numbers;
use crate::read::source::OwnAttributes as _;
use crate::read::source::{parse, top_level};
use nalgebra::{Isometry3, Translation3, Vector3};
use roxmltree::Node;

/// A shape around its own frame; lengths in m.
#[derive(Debug, Clone, PartialEq)]
pub enum Geometry {
    /// Edge lengths along x, y, z.
    Box {
        /// m.
        size: [f64; 3],
    },
    /// Along z.
    Cylinder {
        /// m.
        radius: f64,
        /// m.
        length: f64,
    },
    /// A ball.
    Sphere {
        /// m.
        radius: f64,
    },
    /// A file, as the URDF names it: `package://name/path`, `file:///path` or a path relative to the URDF.
    Mesh {
        /// As written.
        filename: String,
        /// Factors on x, y, z of the file's numbers; 1 where none is given.
        scale: [f64; 3],
    },
}

/// One `<visual>` or `<collision>` of a link.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Visual {
    /// The link's name.
    pub link: String,
    /// `<origin>`; the identity where none is given.
    pub link_from_visual: Isometry3<f64>,
    /// What is drawn there.
    pub geometry: Geometry,
}

/// A `<visual>` that could not be understood.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct VisualFault {
    /// The link's name.
    pub link: String,
    /// Where in the file.
    pub place: Place,
    /// Why.
    pub text: String,
}

/// All shapes of a URDF in the order of the file, and those that could not be understood.
///
/// # Errors
/// [`ReadError`] when the text is not XML with the root `<robot>`.
///
/// ```
/// use calib_urdf::visual::{Geometry, visuals};
/// let text = r#"<robot name="r"><link name="a"><visual>
///   <origin xyz="0 0 0.1"/><geometry><sphere radius="0.05"/></geometry></visual></link></robot>"#;
/// let (shapes, faults) = visuals(text, "r.urdf")?;
/// assert_eq!(shapes[0].geometry, Geometry::Sphere { radius: 0.05 });
/// assert_eq!(shapes[0].link_from_visual.translation.z, 0.1);
/// assert!(faults.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn visuals(
    text: &str,
    name_for_errors: &str,
) -> Result<(Vec<Visual>, Vec<VisualFault>), ReadError> {
    shapes(text, name_for_errors, "visual")
}

/// The same of `<collision>`: the shapes that the robot's maker states for collision checks.
///
/// # Errors
/// As [`visuals`].
pub fn collisions(
    text: &str,
    name_for_errors: &str,
) -> Result<(Vec<Visual>, Vec<VisualFault>), ReadError> {
    shapes(text, name_for_errors, "collision")
}

fn shapes(
    text: &str,
    name_for_errors: &str,
    tag: &str,
) -> Result<(Vec<Visual>, Vec<VisualFault>), ReadError> {
    let document = parse(text, name_for_errors)?;
    let (mut shapes, mut faults) = (Vec::new(), Vec::new());
    for link in top_level(&document, "link") {
        let name = link.own("name").unwrap_or("");
        for visual in link.children().filter(|node| node.has_tag_name(tag)) {
            match shape(visual) {
                Ok((link_from_visual, geometry)) => shapes.push(Visual {
                    link: name.to_owned(),
                    link_from_visual,
                    geometry,
                }),
                Err(why) => faults.push(VisualFault {
                    link: name.to_owned(),
                    place: Place::of_byte(text, visual.range().start),
                    text: why,
                }),
            }
        }
    }
    Ok((shapes, faults))
}

fn child<'a, 'b>(node: Node<'a, 'b>, tag: &str) -> Option<Node<'a, 'b>> {
    node.children().find(|child| child.has_tag_name(tag))
}

fn shape(visual: Node<'_, '_>) -> Result<(Isometry3<f64>, Geometry), String> {
    let link_from_visual = match child(visual, "origin") {
        None => Isometry3::identity(),
        Some(origin) => {
            let xyz = numbers::<3>(origin, "xyz", Some([0.0; 3]))?;
            let rpy = numbers::<3>(origin, "rpy", Some([0.0; 3]))?;
            Isometry3::from_parts(
                Translation3::new(xyz[0], xyz[1], xyz[2]),
                rotation_from_rpy(&Vector3::from(rpy)),
            )
        }
    };
    let geometry = child(visual, "geometry").ok_or("a visual has a `<geometry>`")?;
    let solid = geometry
        .children()
        .find(Node::is_element)
        .ok_or("a `<geometry>` holds one shape")?;
    let geometry = match solid.tag_name().name() {
        "box" => Geometry::Box {
            size: numbers::<3>(solid, "size", None)?,
        },
        "cylinder" => Geometry::Cylinder {
            radius: number(solid, "radius")?,
            length: number(solid, "length")?,
        },
        "sphere" => Geometry::Sphere {
            radius: number(solid, "radius")?,
        },
        "mesh" => Geometry::Mesh {
            filename: solid
                .own("filename")
                .map(str::trim)
                .filter(|name| !name.is_empty())
                .ok_or("a mesh has a `filename`")?
                .to_owned(),
            scale: numbers::<3>(solid, "scale", Some([1.0; 3]))?,
        },
        other => return Err(format!("`<{other}>` is not a URDF shape")),
    };
    Ok((link_from_visual, geometry))
}

fn number(node: Node<'_, '_>, name: &str) -> Result<f64, String> {
    numbers::<1>(node, name, None).map(|[x]| x)
}

fn numbers<const N: usize>(
    node: Node<'_, '_>,
    name: &str,
    absent: Option<[f64; N]>,
) -> Result<[f64; N], String> {
    match (node.own(name), absent) {
        (Some(value), _) => {
            parse_numbers(value).map_err(|fault| format!("`{name}`: {}", fault.reason))
        }
        (None, Some(absent)) => Ok(absent),
        (None, None) => Err(format!("`{name}` is missing")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shape_is_read_and_anything_else_is_reported_with_its_place() {
        let text = r#"<robot name="r">
<link name="a">
  <visual><geometry><box size="1 2 3"/></geometry></visual>
  <visual><origin xyz="0 0 1" rpy="0 0 1.5"/><geometry><cylinder radius="0.1" length="0.4"/></geometry></visual>
  <collision><geometry><sphere radius="9"/></geometry></collision>
</link>
<link name="b">
  <visual><geometry><mesh filename="package://p/m.stl" scale="0.001 0.001 0.001"/></geometry></visual>
  <visual><geometry><capsule radius="1"/></geometry></visual>
  <visual><geometry><box size="1 2"/></geometry></visual>
  <visual/>
  <visual><geometry><mesh filename=" "/></geometry></visual>
</link>
</robot>"#;
        let (shapes, faults) = visuals(text, "r.urdf").expect("XML");
        let (stated, _) = collisions(text, "r.urdf").expect("XML");
        assert_eq!(stated.len(), 1);
        assert_eq!(stated[0].geometry, Geometry::Sphere { radius: 9.0 });
        let names: Vec<&str> = shapes.iter().map(|s| s.link.as_str()).collect();
        assert_eq!(names, ["a", "a", "b"]);
        assert_eq!(
            shapes[2].geometry,
            Geometry::Mesh {
                filename: "package://p/m.stl".into(),
                scale: [1e-3; 3]
            }
        );
        assert!((shapes[1].link_from_visual.rotation.angle() - 1.5).abs() < 1e-12);
        let reported: Vec<(usize, &str)> = faults
            .iter()
            .map(|f| (f.place.line, f.text.as_str()))
            .collect();
        assert_eq!(
            reported,
            [
                (9, "`<capsule>` is not a URDF shape"),
                (10, "`size`: there are 2"),
                (11, "a visual has a `<geometry>`"),
                (12, "a mesh has a `filename`"),
            ]
        );
    }
}
