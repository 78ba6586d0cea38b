//! Checks of one table of poses, before anything is fitted to it.
//!
//! [`checks`] looks at the table alone, against what is known beforehand ([`Expectations`]).

mod held_out;
mod joints;
mod markers;
mod motion;
mod rigidity;
mod rows;
mod shapes;

pub use held_out::held_out_in_training;
pub use shapes::other_shapes;

use crate::rigid_body::Template;
use calib_finding::Finding;
use calib_recording::Poses;
use std::collections::BTreeMap;

/// What is known about a recording beforehand. Everything may be left out; what is not given is not checked.
#[derive(Clone, Debug, Default)]
pub struct Expectations {
    /// Body → its markers.
    pub bodies: BTreeMap<String, Vec<String>>,
    /// Body → where its markers sit, m, when known beforehand (a drawing, an earlier calibration).
    pub templates: BTreeMap<String, Template>,
    /// Joint → limits from the URDF, rad or m.
    pub limits: BTreeMap<String, (f64, f64)>,
    /// Joint → range of motion that the sweep asks for, rad or m. These joints must move.
    pub asked: BTreeMap<String, (f64, f64)>,
    /// Longest distance of anything on the robot from its base, m.
    pub reach: Option<f64>,
    /// Fewest rows that the fit can use.
    pub min_poses: usize,
    /// Standard deviation of a marker coordinate, m, when known.
    pub marker_sigma: Option<f64>,
}

/// All checks that need no model, in a fixed order.
pub fn checks(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    let mut findings = Vec::new();
    findings.extend(joints::too_few(poses, expected));
    findings.extend(joints::units(poses, expected));
    findings.extend(joints::limits(poses, expected));
    findings.extend(joints::coverage(poses, expected));
    findings.extend(joints::duplicates(poses));
    findings.extend(markers::zeros(poses));
    findings.extend(markers::length_unit(poses, expected));
    findings.extend(markers::duplicates(poses));
    findings.extend(markers::frozen(poses, expected));
    findings.extend(markers::virtual_points(poses));
    findings.extend(rigidity::rigidity(poses, expected));
    findings.extend(rows::repeated(poses));
    findings.extend(motion::rotations(poses));
    findings.extend(motion::flips(poses));
    findings.extend(motion::jumps(poses));
    findings.extend(motion::gaps(poses));
    findings.extend(motion::unsettled(poses, expected));
    findings
}
