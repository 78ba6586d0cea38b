//! Problems for tests within the crate: an arm of two joints that scatter, three markers at its end, and a tracker whose place is not known.

use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3};

use crate::{Axis, Chart, FrameId, GroupId, MarkerObservation, NoiseKind, Problem};

/// Samples.
pub(crate) const SAMPLES: usize = 24;

/// What the origins of the joints are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Origins {
    Known,
    Unknown,
}

/// The joints' axes.
const AXES: [Unit<Vector3<f64>>; 2] = [
    Unit::new_unchecked(Vector3::new(0.0, 0.0, 1.0)),
    Unit::new_unchecked(Vector3::new(0.0, 1.0, 0.0)),
];

/// The origin of each joint, and where the base begins.
fn origin() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.3, 0.1, 0.2), Vector3::new(0.2, -0.4, 0.5))
}

/// The reading of a joint, rad.
fn reading(joint: usize, sample: usize) -> f64 {
    1.2 * ((1.3 + 0.4 * joint as f64) * sample as f64 + joint as f64).sin()
}

/// Two joints that scatter between tracker and the last link, and the noise of markers.
pub(crate) fn joints(samples: usize, origins: Origins) -> (Problem, [FrameId; 2], GroupId) {
    let mut p = Problem::new(samples);
    let (tracker, base) = (p.frame("tracker"), p.frame("base"));
    p.unknown("place", tracker, base, origin(), Chart::full());
    let noise = p.noise_group("markers", NoiseKind::Position, 1e-3, true);
    let mut frame = base;
    for (k, axis) in AXES.into_iter().enumerate() {
        let at = p.frame(&format!("at {k}"));
        let name = format!("origin {k}");
        match origins {
            Origins::Known => p.known(&name, frame, at, origin()),
            Origins::Unknown => p.unknown(&name, frame, at, origin(), Chart::full()),
        };
        frame = p.frame(&format!("link {k}"));
        let q = (0..samples).map(|i| reading(k, i)).collect();
        let edge = p.joint(&format!("j{k}"), at, frame, Axis::Revolute(axis), q);
        let group = p.noise_group(&format!("n{k}"), NoiseKind::Joint, 1e-3, true);
        p.joint_noise(edge, group);
    }
    (p, [tracker, frame], noise)
}

/// It begins a few degrees and centimeters off.
pub(crate) fn arm() -> Problem {
    let (mut p, [tracker, frame], noise) = joints(SAMPLES, Origins::Known);
    let x = origin();
    let places: Vec<Point3<f64>> = (0..3)
        .map(|m| Point3::from(Vector3::from_fn(|i, _| 0.1 * ((3 * m + i) as f64).sin())))
        .collect();
    let points: Vec<_> = places
        .iter()
        .enumerate()
        .map(|(m, at)| p.unknown_point(&format!("m{m}"), frame, *at, Some(0.1)))
        .collect();
    let off = Isometry3::new(
        Vector3::new(0.02, -0.01, 0.03),
        Vector3::new(0.03, 0.02, -0.04),
    );
    let tracker_from_base = x * off;
    let seen = (0..3 * SAMPLES).filter(|i| i % 7 != 0).map(|i| {
        let (sample, m) = (i / 3, i % 3);
        let mut at = tracker_from_base;
        for (k, axis) in AXES.into_iter().enumerate() {
            let scatter = 1e-3 * (5.1 * sample as f64 + k as f64).sin();
            at = at * x * UnitQuaternion::from_axis_angle(&axis, reading(k, sample) + scatter);
        }
        let noise = Vector3::from_fn(|d, _| 1e-3 * (1.9 * i as f64 + 2.3 * d as f64).sin());
        MarkerObservation {
            sample,
            point: points[m],
            position: at * places[m] + noise,
            shape: None,
        }
    });
    p.markers("body", tracker, frame, noise, seen.collect());
    p
}
