//! A problem for tests within the crate: an arm of two joints that scatter, three markers at its end, and a tracker whose place is not known.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use crate::{Axis, Chart, MarkerObservation, NoiseKind, Problem};

/// Samples.
pub(crate) const SAMPLES: usize = 24;

/// It begins a few degrees and centimeters off.
pub(crate) fn arm() -> Problem {
    let mut p = Problem::new(SAMPLES);
    let (tracker, base) = (p.frame("tracker"), p.frame("base"));
    let x = Isometry3::new(Vector3::new(0.3, 0.1, 0.2), Vector3::new(0.2, -0.4, 0.5));
    p.unknown("place", tracker, base, x, Chart::full());
    let noise = p.noise_group("markers", NoiseKind::Position, 1e-3, true);
    let mut frame = base;
    let axes = [Vector3::z_axis(), Vector3::y_axis()];
    let turn = |k: usize, i: usize| 1.2 * ((1.3 + 0.4 * k as f64) * i as f64 + k as f64).sin();
    for (k, axis) in axes.into_iter().enumerate() {
        let at = p.frame(&format!("at {k}"));
        p.known(&format!("origin {k}"), frame, at, x);
        frame = p.frame(&format!("link {k}"));
        let q = (0..SAMPLES).map(|i| turn(k, i)).collect();
        let edge = p.joint(&format!("j{k}"), at, frame, Axis::Revolute(axis), q);
        let group = p.noise_group(&format!("n{k}"), NoiseKind::Joint, 1e-3, true);
        p.joint_noise(edge, group);
    }
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
        for (k, axis) in axes.into_iter().enumerate() {
            let scatter = 1e-3 * (5.1 * sample as f64 + k as f64).sin();
            at = at * x * UnitQuaternion::from_axis_angle(&axis, turn(k, sample) + scatter);
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
