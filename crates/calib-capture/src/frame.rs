//! What a tracker says about one instant.

use nalgebra::{Isometry3, Point3};
use std::collections::BTreeMap;

/// One instant of a tracker. Lengths m; what is not in the maps was not seen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// The device's own counter, where it has one.
    pub number: Option<u64>,
    /// The device's own time, s, where it gives one.
    pub device: Option<f64>,
    /// `tracker_from_body` by the device's name for the body.
    pub bodies: BTreeMap<String, Isometry3<f64>>,
    /// Markers that have a name of their own.
    pub markers: BTreeMap<String, Point3<f64>>,
    /// Markers of no body, the one called `marker` included: the device does not know which marker is which.
    pub unlabeled: usize,
}

impl Frame {
    /// The position of a marker, or of a body when no marker has this name.
    pub fn point(&self, name: &str) -> Option<Point3<f64>> {
        self.markers.get(name).copied().or_else(|| {
            let body = self.bodies.get(name)?;
            Some(Point3::from(body.translation.vector))
        })
    }
}
