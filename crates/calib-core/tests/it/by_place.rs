//! Errors that follow the place in the measuring frame: a tracker that distorts its volume is named, and nothing else is.

use crate::common::{Chain, Free, normal, normal3, rng, six_r};
use calib_core::{ByPlace, MarkerObservation, Settings, solve};
use nalgebra::Vector3;

/// Marker noise, m.
const SIGMA: f64 = 1e-4;
/// Probability that the program asks for.
const CHANCE: f64 = 1e-5;

/// What a simulated session has beyond the model.
#[derive(Clone, Copy, Default)]
struct Session {
    poses: usize,
    /// Rows from one random posture to the next; 0: every row is one.
    motion: usize,
    /// ρ of the markers' noise from row to row.
    rho: f64,
    /// Displacement by a quadratic function of the place, m at 1 m from the middle.
    bend: f64,
    /// Eccentricity of the second joint, rad.
    eccentricity: f64,
    /// Gain of the fourth joint.
    gain: f64,
}

fn by_place(seed: u64, session: Session) -> Option<ByPlace> {
    let mut r = rng(seed);
    let free = Free::everything(6);
    let mut chain = Chain::nominal(six_r())
        .posed(&mut r, session.poses, 1.4)
        .deviate(&mut r, &free, 0.005, 0.002);
    if session.motion > 0 {
        let q = chain.q.clone();
        for (s, own) in chain.q.iter_mut().enumerate() {
            let part = (s % session.motion) as f64 / session.motion as f64;
            let (from, to) = (&q[s / session.motion], &q[s / session.motion + 1]);
            let between = from.iter().zip(to).map(|(a, b)| a + (b - a) * part);
            *own = between.collect();
        }
    }
    let mut h = chain.problem(&free, SIGMA);
    h.problem.group_mut(h.markers).estimate = true;
    h.scattering_joints(1e-4);
    let curves: Vec<Vector3<f64>> = (0..6).map(|_| normal3(&mut r)).collect();
    let still = [0.0; 6];
    let places = chain.q.iter().map(|q| chain.tracker_from_body(q, &still));
    let places: Vec<Vector3<f64>> = places.map(|x| x.translation.vector).collect();
    let middle = places.iter().sum::<Vector3<f64>>() / places.len() as f64;
    let bent = |p: Vector3<f64>| -> Vector3<f64> {
        let d = p - middle;
        let terms = [
            d.x * d.x,
            d.y * d.y,
            d.z * d.z,
            d.x * d.y,
            d.x * d.z,
            d.y * d.z,
        ];
        let sum = curves.iter().zip(terms).map(|(c, t)| c * t);
        sum.sum::<Vector3<f64>>() * session.bend
    };
    let mut state: Vec<Vector3<f64>> = chain.markers.iter().map(|_| normal3(&mut r)).collect();
    let mut markers = Vec::new();
    for (sample, q) in chain.q.iter().enumerate() {
        let mut off: Vec<f64> = q.iter().map(|_| normal(&mut r) * 1e-4).collect();
        off[1] += session.eccentricity * q[1].sin();
        off[3] += session.gain * q[3];
        let x = chain.tracker_from_body(q, &off);
        for (m, p) in chain.markers.iter().enumerate() {
            let new = normal3(&mut r) * (1.0 - session.rho * session.rho).sqrt();
            state[m] = state[m] * session.rho + new;
            let seen = x * p;
            markers.push(MarkerObservation {
                sample,
                point: h.points[m],
                position: seen + state[m] * SIGMA + bent(seen.coords),
                shape: None,
            });
        }
    }
    let p = &mut h.problem;
    p.markers("body", h.tracker, h.body, h.markers, markers);
    let solution = solve(&h.problem, &Settings::default()).expect("solves");
    solution.by_place(h.tracker, CHANCE)
}

/// Of some robots, those whose errors are said to follow the place more than joints explain.
fn named(robots: u64, session: Session) -> usize {
    let found = (0..robots).filter_map(|seed| by_place(seed, session));
    found.filter(|found| found.more_than_effects).count()
}

const POSES: Session = Session {
    poses: 80,
    motion: 0,
    rho: 0.0,
    bend: 0.0,
    eccentricity: 0.0,
    gain: 0.0,
};

#[test]
fn a_tracker_that_distorts_its_volume_is_named() {
    let bend = 6e-4;
    let found = named(12, Session { bend, ..POSES });
    println!("{found} of 12");
    assert!(found >= 10, "{found} of 12");
    let one = by_place(1, Session { bend, ..POSES }).expect("named");
    assert!((5e-5..1e-3).contains(&one.rms), "{one:?}");
    assert!(one.explains > 0.05, "{one:?}");
}

/// A clean robot, at postures or in a motion whose rows share their noise, and joints with effects that the model lacks.
#[test]
fn nothing_else_is() {
    let motion = Session {
        poses: 400,
        motion: 10,
        rho: 0.9,
        ..POSES
    };
    let eccentric = Session {
        eccentricity: 2e-3,
        ..POSES
    };
    let gain = Session {
        gain: 5e-3,
        ..POSES
    };
    let both = Session {
        gain: 3e-3,
        ..eccentric
    };
    for (session, robots) in [
        (POSES, 24),
        (motion, 6),
        (eccentric, 12),
        (gain, 12),
        (both, 12),
    ] {
        let found = named(robots, session);
        println!("{found} of {robots}");
        assert_eq!(found, 0, "of {robots}");
    }
}

#[test]
fn few_poses_are_not_asked() {
    let few = Session {
        poses: 30,
        bend: 1e-3,
        ..POSES
    };
    assert!(by_place(1, few).is_none());
}
