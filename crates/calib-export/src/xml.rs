//! The geometry as URDF, MJCF and SDF. Numbers have the digits that a reader needs to get the same ones back.

use std::fmt::Write as _;

use calib_model::file::{ModelJoint, ModelMotion, ModelPose, RobotModelFile};
use calib_urdf::decimal::{decimal, decimals, tidy_angle};
use calib_urdf::rpy::rpy_from_rotation;

use crate::geometric::isometry;

/// A name or text in an attribute or element.
fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}

/// A comment: two hyphens would end it.
pub(crate) fn comment(lines: &[String]) -> String {
    let lines: String = lines
        .iter()
        .map(|l| format!("  {}\n", l.replace("--", "- -")))
        .collect();
    format!("<!--\n{lines}-->\n")
}

/// Roll, pitch, yaw of a pose, rad.
pub(crate) fn rpy(pose: &ModelPose) -> [f64; 3] {
    let of = rpy_from_rotation(&isometry(pose).rotation);
    [of[0], of[1], of[2]].map(tidy_angle)
}

/// Center of mass of a link, m; `None` where it weighs nothing.
fn center(file: &RobotModelFile, link: &str) -> Option<(f64, [f64; 3])> {
    let link = file.links.iter().find(|l| l.name == *link)?;
    let mass = link.mass_kg;
    (mass > 0.0).then(|| (mass, link.first_moment_kg_m.map(|h| h / mass)))
}

/// Names of all links, the root first.
fn links(file: &RobotModelFile) -> impl Iterator<Item = &str> {
    let children = file.joints.iter().map(|j| j.child.as_str());
    std::iter::once(file.root.as_str()).chain(children)
}

/// URDF of the joints and masses.
pub(crate) fn urdf(file: &RobotModelFile, notes: &[String]) -> String {
    let mut out = format!("<?xml version=\"1.0\"?>\n{}", comment(notes));
    let _ = writeln!(out, "<robot name=\"{}\">", escaped(&file.robot));
    for link in links(file) {
        let name = escaped(link);
        match center(file, link) {
            None => {
                let _ = writeln!(out, "  <link name=\"{name}\"/>");
            }
            Some((mass, at)) => {
                let at = decimals(&at);
                let mass = decimal(mass);
                let _ = writeln!(
                    out,
                    "  <link name=\"{name}\">\n    <inertial>\n      <origin xyz=\"{at}\"/>\n      <mass value=\"{mass}\"/>\n      \
                     <inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>\n    </inertial>\n  </link>"
                );
            }
        }
    }
    for joint in &file.joints {
        urdf_joint(joint, &mut out);
    }
    out.push_str("</robot>\n");
    out
}

fn urdf_joint(joint: &ModelJoint, out: &mut String) {
    let kind = match (joint.motion, joint.limits) {
        (ModelMotion::Fixed, _) => "fixed",
        (ModelMotion::Prismatic, _) => "prismatic",
        (ModelMotion::Revolute, Some(_)) => "revolute",
        (ModelMotion::Revolute, None) => "continuous",
    };
    let origin = &joint.parent_from_joint;
    let (name, parent, child) = (
        escaped(&joint.name),
        escaped(&joint.parent),
        escaped(&joint.child),
    );
    let (xyz, rpy) = (decimals(&origin.xyz_m), decimals(&rpy(origin)));
    let _ = writeln!(
        out,
        "  <joint name=\"{name}\" type=\"{kind}\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{child}\"/>\n    \
         <origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>"
    );
    if let Some(axis) = joint.axis.filter(|_| joint.motion != ModelMotion::Fixed) {
        let _ = writeln!(out, "    <axis xyz=\"{}\"/>", decimals(&axis));
    }
    if let Some([low, high]) = joint.limits.filter(|_| joint.motion != ModelMotion::Fixed) {
        let (low, high) = (decimal(low), decimal(high));
        let _ = writeln!(
            out,
            "    <limit lower=\"{low}\" upper=\"{high}\" effort=\"0\" velocity=\"0\"/>"
        );
    }
    if let Some(m) = &joint.mimic {
        let _ = writeln!(
            out,
            "    <mimic joint=\"{}\" multiplier=\"{}\" offset=\"{}\"/>",
            escaped(&m.joint),
            m.multiplier,
            m.offset
        );
    }
    out.push_str("  </joint>\n");
}

/// MJCF: bodies inside each other.
pub(crate) fn mjcf(file: &RobotModelFile, notes: &[String]) -> String {
    let mut out = comment(notes);
    let gravity = decimals(&file.gravity_m_s2);
    let _ = writeln!(
        out,
        "<mujoco model=\"{}\">\n  <compiler angle=\"radian\" autolimits=\"true\" boundmass=\"1e-6\" boundinertia=\"1e-9\"/>\n  \
         <option gravity=\"{gravity}\"/>\n  <worldbody>",
        escaped(&file.robot)
    );
    mjcf_body(file, None, &file.root, 2, &mut out);
    out.push_str("  </worldbody>\n");
    let mimics: Vec<&ModelJoint> = file.joints.iter().filter(|j| j.mimic.is_some()).collect();
    if !mimics.is_empty() {
        out.push_str("  <equality>\n");
        for joint in mimics {
            if let Some(m) = &joint.mimic {
                let (own, other) = (escaped(&joint.name), escaped(&m.joint));
                let _ = writeln!(
                    out,
                    "    <joint joint1=\"{own}\" joint2=\"{other}\" polycoef=\"{} {} 0 0 0\"/>",
                    m.offset, m.multiplier
                );
            }
        }
        out.push_str("  </equality>\n");
    }
    out.push_str("</mujoco>\n");
    out
}

/// A body and what hangs on it: as deep as the robot has joints in a row.
fn mjcf_body(
    file: &RobotModelFile,
    by: Option<&ModelJoint>,
    link: &str,
    depth: usize,
    out: &mut String,
) {
    let pad = "  ".repeat(depth);
    let origin = by.map_or_else(ModelPose::default, |j| j.parent_from_joint);
    let [x, y, z, w] = origin.quat_xyzw;
    let (at, turn) = (decimals(&origin.xyz_m), decimals(&[w, x, y, z]));
    let _ = writeln!(
        out,
        "{pad}<body name=\"{}\" pos=\"{at}\" quat=\"{turn}\">",
        escaped(link)
    );
    if let Some(joint) = by {
        let kind = match joint.motion {
            ModelMotion::Fixed => None,
            ModelMotion::Revolute => Some("hinge"),
            ModelMotion::Prismatic => Some("slide"),
        };
        if let (Some(kind), Some(axis)) = (kind, joint.axis) {
            let range = joint.limits.filter(|[low, high]| low < high);
            let range = range.map_or_else(String::new, |limits| {
                format!(" range=\"{}\"", decimals(&limits))
            });
            let _ = writeln!(
                out,
                "{pad}  <joint name=\"{}\" type=\"{kind}\" axis=\"{}\"{range}/>",
                escaped(&joint.name),
                decimals(&axis)
            );
        }
    }
    if let Some((mass, at)) = center(file, link) {
        let (mass, at) = (decimal(mass), decimals(&at));
        let _ = writeln!(
            out,
            "{pad}  <inertial pos=\"{at}\" mass=\"{mass}\" diaginertia=\"1e-9 1e-9 1e-9\"/>"
        );
    }
    for joint in file.joints.iter().filter(|j| j.parent == link) {
        mjcf_body(file, Some(joint), &joint.child, depth + 1, out);
    }
    let _ = writeln!(out, "{pad}</body>");
}

/// SDF: joints in their parents, links in their joints. Version 1.9, and 1.11 where a joint mimics another: the first that knows how.
pub(crate) fn sdf(file: &RobotModelFile, notes: &[String]) -> String {
    let mut out = format!("<?xml version=\"1.0\"?>\n{}", comment(notes));
    let mimics = file.joints.iter().any(|j| j.mimic.is_some());
    let version = if mimics { "1.11" } else { "1.9" };
    let _ = writeln!(
        out,
        "<sdf version=\"{version}\">\n  <model name=\"{}\">\n    <link name=\"{}\">",
        escaped(&file.robot),
        escaped(&file.root)
    );
    sdf_inertial(file, &file.root, &mut out);
    out.push_str("    </link>\n");
    for joint in &file.joints {
        let kind = match (joint.motion, joint.limits) {
            (ModelMotion::Fixed, _) => "fixed",
            (ModelMotion::Prismatic, _) => "prismatic",
            (ModelMotion::Revolute, Some(_)) => "revolute",
            (ModelMotion::Revolute, None) => "continuous",
        };
        let (name, parent, child) = (
            escaped(&joint.name),
            escaped(&joint.parent),
            escaped(&joint.child),
        );
        let origin = &joint.parent_from_joint;
        let (xyz, rpy) = (decimals(&origin.xyz_m), decimals(&rpy(origin)));
        let _ = writeln!(
            out,
            "    <joint name=\"{name}\" type=\"{kind}\">\n      <pose relative_to=\"{parent}\">{xyz} {rpy}</pose>\n      \
             <parent>{parent}</parent>\n      <child>{child}</child>"
        );
        if let Some(axis) = joint.axis.filter(|_| joint.motion != ModelMotion::Fixed) {
            let _ = writeln!(out, "      <axis>\n        <xyz>{}</xyz>", decimals(&axis));
            if let Some([low, high]) = joint.limits {
                let (low, high) = (decimal(low), decimal(high));
                let _ = writeln!(
                    out,
                    "        <limit>\n          <lower>{low}</lower>\n          <upper>{high}</upper>\n        </limit>"
                );
            }
            if let Some(m) = &joint.mimic {
                let _ = writeln!(
                    out,
                    "        <mimic joint=\"{}\">\n          <multiplier>{}</multiplier>\n          <offset>{}</offset>\n          \
                     <reference>0</reference>\n        </mimic>",
                    escaped(&m.joint),
                    m.multiplier,
                    m.offset
                );
            }
            out.push_str("      </axis>\n");
        }
        let _ = writeln!(
            out,
            "    </joint>\n    <link name=\"{child}\">\n      <pose relative_to=\"{name}\">0 0 0 0 0 0</pose>"
        );
        sdf_inertial(file, &joint.child, &mut out);
        out.push_str("    </link>\n");
    }
    out.push_str("  </model>\n</sdf>\n");
    out
}

/// The mass of a link.
fn sdf_inertial(file: &RobotModelFile, link: &str, out: &mut String) {
    if let Some((mass, at)) = center(file, link) {
        let (mass, at) = (decimal(mass), decimals(&at));
        let _ = writeln!(
            out,
            "      <inertial>\n        <pose>{at} 0 0 0</pose>\n        <mass>{mass}</mass>\n      </inertial>"
        );
    }
}
