//! Points and measurements.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Point3;

use crate::graph::ids::{EdgeId, FrameId, GroupId, PointId};
use crate::graph::measurement::{
    Loop, MarkerObservation, Markers, Measurement, MeasurementKind, PoseNoise, PoseObservation,
    Poses, Sight,
};
use crate::graph::parameter::{Parameter, ParameterKind};
use crate::graph::problem::{Point, Problem};
use crate::graph::unit::Unit;

impl Problem {
    /// A point of known coordinates in `frame`.
    pub fn known_point(&mut self, name: &str, frame: FrameId, position: Point3<f64>) -> PointId {
        self.points.push(Point {
            name: name.to_owned(),
            frame,
            position,
            parameters: None,
        });
        PointId::of(self.points.len() - 1)
    }

    /// A point of unknown coordinates near `position`: parameters `<name>.x`, `.y`, `.z`.
    pub fn unknown_point(
        &mut self,
        name: &str,
        frame: FrameId,
        position: Point3<f64>,
        prior_sigma: Option<f64>,
    ) -> PointId {
        let coordinate = |axis: &str, value: f64| Parameter {
            name: format!("{name}.{axis}"),
            joint: None,
            kind: ParameterKind::Point,
            unit: Unit::Meter,
            nominal: value,
            start: value,
            prior_sigma,
            bounds: None,
            fixed: false,
        };
        let x = self.parameter(coordinate("x", position.x));
        let y = self.parameter(coordinate("y", position.y));
        let z = self.parameter(coordinate("z", position.z));
        self.points.push(Point {
            name: name.to_owned(),
            frame,
            position,
            parameters: Some([x, y, z]),
        });
        PointId::of(self.points.len() - 1)
    }

    /// Adds a measurement.
    pub fn add_measurement(&mut self, measurement: Measurement) {
        Arc::make_mut(&mut self.measurements).push(measurement);
    }

    /// Markers of frame `to` seen from frame `from`, along the shortest path.
    pub fn markers(
        &mut self,
        name: &str,
        from: FrameId,
        to: FrameId,
        noise: GroupId,
        observations: Vec<MarkerObservation>,
    ) {
        self.add_measurement(Measurement {
            name: name.to_owned(),
            from,
            to,
            path: None,
            kind: MeasurementKind::Markers(Markers {
                noise,
                own: BTreeMap::new(),
                sight: None,
                observations,
            }),
        });
    }

    /// Poses of frame `to` seen from frame `from`, along the shortest path.
    pub fn poses(
        &mut self,
        name: &str,
        from: FrameId,
        to: FrameId,
        noise: PoseNoise,
        observations: Vec<PoseObservation>,
    ) {
        self.add_measurement(Measurement {
            name: name.to_owned(),
            from,
            to,
            path: None,
            kind: MeasurementKind::Poses(Poses {
                noise,
                sight: None,
                observations,
            }),
        });
    }

    /// Gives the noise of the measurement that was added last another level along the line of sight, where it is of poses or markers.
    pub fn noise_along_sight(&mut self, sight: Sight) {
        match self.measurements_mut().last_mut().map(|m| &mut m.kind) {
            Some(MeasurementKind::Markers(markers)) => markers.sight = Some(sight),
            Some(MeasurementKind::Poses(poses)) => poses.sight = Some(sight),
            _ => {}
        }
    }

    /// Two paths between the same frames that must agree at `samples`: out along `there`, home
    /// against `back` (both given from the common start to the common end).
    pub fn add_loop(
        &mut self,
        name: &str,
        end: FrameId,
        there: &[(EdgeId, bool)],
        back: &[(EdgeId, bool)],
        noise: PoseNoise,
        samples: Vec<usize>,
    ) {
        // closed path from the end: back⁻¹ · there
        let mut path: Vec<(EdgeId, bool)> = back.iter().rev().map(|&(e, inv)| (e, !inv)).collect();
        path.extend_from_slice(there);
        self.add_measurement(Measurement {
            name: name.to_owned(),
            from: end,
            to: end,
            path: Some(path),
            kind: MeasurementKind::Loop(Loop { noise, samples }),
        });
    }
}
