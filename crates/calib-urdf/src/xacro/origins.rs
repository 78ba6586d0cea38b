//! The origins that a xacro's text shows without expanding it.

use crate::edit::error::EditError;
use crate::error::ReadError;
use crate::kinematics::rpy::rotation_from_rpy;
use crate::read::numbers::parse_numbers;
use crate::read::source::OwnAttributes as _;
use crate::read::source::{child, parse, value_range, xacro_evidence};
use crate::xacro::companions::Companions;
use crate::xacro::value::{Context, cells};
use crate::xacro::{gives_origin, is_expression, is_joint};
use crate::yaml;
use nalgebra::{Isometry3, Translation3, Vector3};
use roxmltree::Node;

/// Origins by joint, `parent_link_from_joint`, and the names of joints whose origin xacro computes.
pub type Origins = (Vec<(String, Isometry3<f64>)>, Vec<String>);

/// Does a text need xacro before it is a URDF?
///
/// # Errors
/// [`ReadError`] for a text that is not XML with the root `<robot>`.
pub fn is_xacro(text: &str, name_for_errors: &str) -> Result<bool, ReadError> {
    Ok(xacro_evidence(&parse(text, name_for_errors)?).is_some())
}

/// Could xacro turn a name as it is written (`${side}_elbow`) into this one?
#[must_use]
pub fn xacro_may_name(written: &str, name: &str) -> bool {
    super::matches(written, name)
}

/// The origins of all joints of a xacro, in the order of the text, under the names as written (`${side}_elbow`).
///
/// # Errors
/// [`ReadError`] for a text that is not XML with the root `<robot>`.
pub fn xacro_origins(
    text: &str,
    name_for_errors: &str,
    companions: &Companions,
) -> Result<Origins, ReadError> {
    let document = parse(text, name_for_errors)?;
    let yaml: Vec<Result<_, EditError>> = companions
        .yaml
        .iter()
        .map(|file| yaml::parse(&file.text, &file.name))
        .collect();
    let context = Context {
        text,
        document: &document,
        companions,
        yaml: &yaml,
    };
    let (mut found, mut computed) = (Vec::new(), Vec::new());
    for joint in document.descendants().filter(|node| is_joint(*node)) {
        let name = joint.own("name").unwrap_or("").to_owned();
        let origin = child(joint, "origin");
        let numbers = |attribute: &str| match origin {
            None => Some([0.0; 3]),
            Some(origin) => read(&context, origin, attribute),
        };
        let quaternion = origin.is_some_and(|o| o.has_own("quat_xyzw"));
        let shown = !quaternion && gives_origin(joint).is_none();
        match (numbers("xyz"), numbers("rpy")) {
            (Some(xyz), Some(rpy)) if shown => found.push((
                name,
                Isometry3::from_parts(
                    Translation3::from(Vector3::from(xyz)),
                    rotation_from_rpy(&Vector3::from(rpy)),
                ),
            )),
            _ => computed.push(name),
        }
    }
    Ok((found, computed))
}

fn read(context: &Context<'_, '_>, origin: Node<'_, '_>, name: &str) -> Option<[f64; 3]> {
    let Some(attribute) = origin.own_attribute(name) else {
        return Some([0.0; 3]);
    };
    if !is_expression(attribute.value()) {
        return parse_numbers(attribute.value()).ok();
    }
    let raw = value_range(context.text, &attribute);
    let cells = cells::<3>(context, raw, origin, None).ok()?;
    Some(std::array::from_fn(|i| cells[i].value))
}
