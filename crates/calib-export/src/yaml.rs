//! Tables of parameters as YAML.

use std::fmt::Write as _;

use calib_urdf::decimal::{decimal, decimals};
use calib_urdf::sha256_hex;
use nalgebra::{Isometry3, Vector3};

use crate::opw::Opw;
use crate::{dh, poe, ur, xml};

/// What stands above every table.
pub(crate) struct Head<'a> {
    /// Sentences for the reader.
    pub notes: &'a [String],
    /// Name of the format.
    pub convention: &'a str,
    /// First link of the chain.
    pub root: &'a str,
    /// Last one.
    pub tool: &'a str,
}

impl Head<'_> {
    fn comments(&self) -> String {
        self.notes.iter().map(|n| format!("# {n}\n")).collect()
    }

    fn text(&self) -> String {
        format!(
            "{}# Lengths in m, angles in rad; transforms: 12 numbers by rows, R | t.\nconvention: {}\nroot: {}\ntool_link: {}\n",
            self.comments(),
            self.convention,
            quoted(self.root),
            quoted(self.tool)
        )
    }
}

/// Denavit–Hartenberg parameters; `beta`: Hayati's too.
pub(crate) fn dh(head: &Head<'_>, table: &dh::Table, beta: bool) -> String {
    let mut out = head.text();
    let last = if beta { " Ry(beta)" } else { "" };
    let _ = writeln!(
        out,
        "# root_from_tool = base * A_1 * … * A_n * tool,  A = Rz(theta) Tz(d) Tx(a) Rx(alpha){last}\n\
         # A revolute joint adds multiplier * q + offset to theta, a prismatic one to d; q is what `reads` reads.\n\
         base: [{}]\njoints:",
        rows(&table.base)
    );
    for row in &table.rows {
        let kind = if row.prismatic {
            "prismatic"
        } else {
            "revolute"
        };
        let _ = write!(
            out,
            "  - {{joint: {}, type: {kind}, theta: {}, d: {}, a: {}, alpha: {}",
            quoted(&row.joint),
            decimal(row.theta),
            decimal(row.d),
            decimal(row.a),
            decimal(row.alpha)
        );
        if beta {
            let _ = write!(out, ", beta: {}", decimal(row.beta));
        }
        let _ = writeln!(out, "{}}}", reads(&row.reads, row.multiplier, row.offset));
    }
    let _ = writeln!(out, "tool: [{}]", rows(&table.tool));
    out
}

/// Screws and home.
pub(crate) fn poe(head: &Head<'_>, (screws, end): &(Vec<poe::Screw>, Isometry3<f64>)) -> String {
    let mut out = head.text();
    out.push_str(
        "# root_from_tool = exp([S_1] q_1) * … * exp([S_n] q_n) * home; S = [omega; v] in the root; q is multiplier * q + offset of what `reads` reads.\njoints:\n",
    );
    for s in screws {
        let _ = writeln!(
            out,
            "  - {{joint: {}, omega: [{}], v: [{}]{}}}",
            quoted(&s.joint),
            vector(&s.omega),
            vector(&s.v),
            reads(&s.reads, s.multiplier, s.offset)
        );
    }
    let _ = writeln!(out, "home: [{}]", rows(end));
    out
}

/// Parameters of an arm with a spherical wrist, under the keys of ROS-Industrial.
pub(crate) fn opw(head: &Head<'_>, of: &Opw) -> String {
    let mut out = head.text();
    let l = &of.lengths;
    out.push_str(
        "# root_from_tool = root_from_base * Rz(p1) T(a1, b, c1) Ry(p2) T(0, 0, c2) Ry(p3) T(a2, 0, c3) Rz(p4) Ry(p5) Rz(p6) T(0, 0, c4) * flange_from_tool\n\
         # p = sign correction * reading - offset\n\
         opw_kinematics_geometric_parameters:\n",
    );
    for (name, length) in [
        ("a1", l.a1),
        ("a2", l.a2),
        ("b", l.b),
        ("c1", l.c1),
        ("c2", l.c2),
        ("c3", l.c3),
        ("c4", l.c4),
    ] {
        let _ = writeln!(out, "  {name}: {}", real(length));
    }
    let list = |of: Vec<String>| of.join(", ");
    let _ = writeln!(
        out,
        "opw_kinematics_joint_offsets: [{}]\nopw_kinematics_joint_sign_corrections: [{}]\njoints: [{}]",
        list(of.offsets.iter().map(|o| real(*o)).collect()),
        list(of.signs.iter().map(|s| decimal(*s)).collect()),
        list(of.joints.iter().map(|j| quoted(j)).collect()),
    );
    let _ = writeln!(
        out,
        "root_from_base: [{}]\nflange_from_tool: [{}]",
        rows(&of.root_from_base),
        rows(&of.flange_from_tool)
    );
    out
}

/// Origins of a UR arm's joints. The hash is one of the numbers.
pub(crate) fn ur(head: &Head<'_>, arm: &ur::Arm) -> String {
    let mut numbers = String::new();
    for joint in arm.joints.iter().map(|i| &arm.file.joints[*i]) {
        let origin = &joint.parent_from_joint;
        let values = origin.xyz_m.into_iter().chain(xml::rpy(origin));
        let _ = writeln!(numbers, "  {}:", ur::key(joint));
        for (name, value) in ["x", "y", "z", "roll", "pitch", "yaw"].iter().zip(values) {
            let _ = writeln!(numbers, "    {name}: {}", real(value));
        }
    }
    let sha = sha256_hex(numbers.as_bytes());
    let hash = u64::from_str_radix(&sha[..16], 16).unwrap_or_default();
    format!(
        "{}kinematics:\n{numbers}  hash: calib_{hash}\n",
        head.comments()
    )
}

fn reads(other: &str, multiplier: f64, offset: f64) -> String {
    format!(
        ", reads: {}, multiplier: {multiplier}, offset: {offset}",
        quoted(other)
    )
}

/// A name as a YAML string.
fn quoted(name: &str) -> String {
    format!(
        "\"{}\"",
        name.replace('\\', "\\\\")
            .replace('"', "\\\"")
            .replace('\n', " ")
    )
}

/// A number that no reader takes for an integer: a list of both is refused as parameters of a ROS 2 node.
fn real(of: f64) -> String {
    let text = decimal(of);
    if text.contains('.') {
        text
    } else {
        format!("{text}.0")
    }
}

/// Twelve numbers of a pose by rows.
fn rows(of: &Isometry3<f64>) -> String {
    let rows = calib_model::Pose::of(of).rows();
    decimals(&rows).replace(' ', ", ")
}

fn vector(of: &Vector3<f64>) -> String {
    decimals(of.as_slice()).replace(' ', ", ")
}
