//! Checks of one table of poses, before anything is fitted to it.
//!
//! [`checks`] looks at the table alone, against what is known beforehand ([`Expectations`]).

mod held_out;
mod joints;
mod markers;
mod motion;
mod rigidity;
mod rows;
mod scales;
mod shapes;

pub use held_out::held_out_in_training;
pub use rigidity::out_of_place;
pub use rows::{Copied, copied_rows, repeated_rows};
pub use scales::other_scales;
pub use shapes::other_shapes;

use crate::rigid_body::Template;
use calib_finding::Finding;
use calib_recording::Poses;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// What is known about a recording beforehand. Everything may be left out; what is not given is not checked.
#[derive(Clone, Debug, Default)]
pub struct Expectations {
    /// Body → its markers.
    pub bodies: BTreeMap<String, Vec<String>>,
    /// Body → where its markers sit, m, when known beforehand (a drawing, an earlier calibration).
    pub templates: BTreeMap<String, Template>,
    /// Body → σ of a coordinate of its template, m, where it is known.
    pub template_sigmas: BTreeMap<String, f64>,
    /// Joint → limits from the URDF, rad or m.
    pub limits: BTreeMap<String, (f64, f64)>,
    /// Joint → range of motion that the sweep asks for, rad or m. These joints must move.
    pub asked: BTreeMap<String, (f64, f64)>,
    /// Joint → what the joints that mimic it turn, rad, and slide, m, for a unit of its reading.
    pub followers: BTreeMap<String, [f64; 2]>,
    /// Longest distance of anything on the robot from its base, m.
    pub reach: Option<f64>,
    /// Fewest rows that the fit can use.
    pub min_poses: usize,
    /// Standard deviation of a marker coordinate, m, when known.
    pub marker_sigma: Option<f64>,
}

/// All checks that need no model, in a fixed order.
pub fn checks(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    // Side by side; the findings are in this order.
    let all: [&(dyn Fn() -> Vec<Finding> + Sync); 17] = [
        &|| listed(joints::too_few(poses, expected)),
        &|| listed(joints::units(poses, expected)),
        &|| listed(joints::limits(poses, expected)),
        &|| listed(joints::coverage(poses, expected)),
        &|| listed(joints::duplicates(poses)),
        &|| listed(markers::zeros(poses)),
        &|| listed(markers::length_unit(poses, expected)),
        &|| listed(markers::duplicates(poses)),
        &|| listed(markers::frozen(poses, expected)),
        &|| listed(markers::virtual_points(poses, expected)),
        &|| listed(rigidity::rigidity(poses, expected)),
        &|| listed(rows::repeated(poses)),
        &|| listed(motion::rotations(poses)),
        &|| listed(motion::flips(poses, expected)),
        &|| listed(motion::jumps(poses)),
        &|| listed(motion::gaps(poses)),
        &|| listed(motion::unsettled(poses, expected)),
    ];
    let found: Vec<Vec<Finding>> = all.par_iter().map(|check| check()).collect();
    found.concat()
}

fn listed(found: impl IntoIterator<Item = Finding>) -> Vec<Finding> {
    found.into_iter().collect()
}
