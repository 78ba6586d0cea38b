//! Directions along which no contact holds the tip.
//!
//! A plane with the unit normal n holds the tip along n alone, a line or a cylinder along d everywhere but along d; a point, a spot and a
//! sphere hold it in every direction. The sum of what they hold,
//!
//! ```text
//! H = Σ over contacts   n nᵀ (plane),   1 − d dᵀ (line, cylinder),   1 (all others)              (1)
//! ```
//!
//! has a small eigenvalue where a direction is missing. What the joints do along it shows through tilts of the touched
//! thing at most.

use calib_finding::{About, Fact, Finding, catalog};
use calib_geometry::decompose::symmetric_eigen_small;
use calib_profile::{Contact, ContactBase, Touched, Usage};
use nalgebra::{Matrix3, Vector3};

use crate::prepare::inputs::Inputs;

/// sin² of the angle between a normal and the direction that it misses, below which it does not hold it: 10°.
const HELD: f64 = 0.03;

/// Says which directions of the root are missing; nothing where a body is tracked, or something is touched that a moving link carries.
pub(crate) fn missing(inputs: &Inputs) -> Option<Finding> {
    let profile = &inputs.robot.profile;
    let fitted = |contact: &&Contact| {
        contact.recordings.iter().any(|name| {
            let recording = profile.recordings.get(name);
            recording.is_some_and(|r| r.usage != Usage::Validation)
        })
    };
    let contacts: Vec<&Contact> = profile.contacts.values().filter(fitted).collect();
    let root = ContactBase::Link(inputs.robot.model.root());
    if !profile.bodies.is_empty() || contacts.is_empty() || contacts.iter().any(|c| c.on != root) {
        return None;
    }
    let held: Matrix3<f64> = contacts.iter().map(|c| holds(c)).sum();
    let missing = directions(&held);
    if missing.is_empty() {
        return None;
    }
    let names = missing.iter().map(name);
    let finding = Finding::new(catalog::CONTACT_DIRECTION_MISSING, About::Fit);
    Some(finding.with("directions", Fact::names(names)))
}

/// The summand of (1).
fn holds(contact: &Contact) -> Matrix3<f64> {
    let z = contact.base_from_place.rotation * Vector3::z();
    match contact.touched {
        Touched::Plane => z * z.transpose(),
        Touched::Line | Touched::Cylinder(_) => Matrix3::identity() - z * z.transpose(),
        Touched::Point | Touched::Distance(_) | Touched::Listed | Touched::Unknown => {
            Matrix3::identity()
        }
    }
}

/// Unit directions in which a sum of (1) is as good as zero, the least held first. Two that are missing are told by the normal of what is
/// held: across it any pair is as good, and the coordinate axes nearest to it are named.
fn directions(held: &Matrix3<f64>) -> Vec<Vector3<f64>> {
    let eigen = symmetric_eigen_small(held);
    let column = |i: usize| Vector3::from(eigen.vectors.column(i));
    let missing: Vec<usize> = (0..3).filter(|i| eigen.values[*i] < HELD).collect();
    match missing.as_slice() {
        [_, _] => {
            let other = (0..3).find(|i| !missing.contains(i)).map(column);
            let normal = other.unwrap_or_else(Vector3::z);
            let mut axes: Vec<Vector3<f64>> = (0..3).map(|i| Vector3::ith(i, 1.0)).collect();
            axes.sort_by(|a, b| a.dot(&normal).abs().total_cmp(&b.dot(&normal).abs()));
            let first = (axes[0] - normal * normal.dot(&axes[0])).normalize();
            vec![first, normal.cross(&first)]
        }
        few => few.iter().map(|i| column(*i)).collect(),
    }
}

/// A direction in words: an axis of the root where it is one to 5°, else its components.
fn name(direction: &Vector3<f64>) -> String {
    /// cos 5°.
    const AXIS: f64 = 0.996;
    let axes = ["x", "y", "z"].into_iter().enumerate();
    for (i, axis) in axes {
        if direction[i].abs() > AXIS {
            return axis.to_owned();
        }
    }
    // The sign of a direction that is missing says nothing: the largest component is positive.
    let sign = direction[direction.iamax()].signum();
    let [x, y, z] = <[f64; 3]>::from(direction * sign).map(|c| c + 0.0);
    format!("({x:.2}, {y:.2}, {z:.2})")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(normal: [f64; 3]) -> Matrix3<f64> {
        let n = Vector3::from(normal).normalize();
        n * n.transpose()
    }

    fn named(held: &Matrix3<f64>) -> Vec<String> {
        directions(held).iter().map(name).collect()
    }

    #[test]
    fn what_is_not_touched_is_named() {
        assert_eq!(named(&plane([0.0, 0.0, 1.0])), ["x", "y"]);
        let corner = plane([0.0, 0.0, 1.0]) + plane([1.0, 0.0, 0.02]);
        assert_eq!(named(&corner), ["y"]);
        let slanted = plane([0.0, 0.0, 1.0]) + plane([1.0, 1.0, 0.0]);
        assert_eq!(named(&slanted), ["(0.71, -0.71, 0.00)"]);
        let all = corner + plane([0.0, 1.0, 0.3]);
        assert!(named(&all).is_empty());
        // Planes that are nearly alike do not hold what they differ in.
        assert_eq!(
            named(&(plane([0.0, 0.0, 1.0]) + plane([0.0, 0.1, 1.0]))).len(),
            2
        );
    }
}
