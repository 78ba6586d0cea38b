//! Every entry of the table of joint effects: its coefficients are recovered from simulated measurements.

mod common;

use calib_core::effect::Effect;
use calib_core::{
    Axis, Chart, EFFECTS, JointMotion, JointState, NoiseKind, PoseNoise, PoseObservation, Problem,
    Settings, solve,
};
use common::{axis, jitter, pose, rng};
use rand::RngExt;

/// Noise of position (m) and orientation (rad).
const NOISE: f64 = 1e-5;

/// Everything that a regressor may depend on, drawn at random.
fn states(samples: usize, seed: u64) -> Vec<JointState> {
    let mut r = rng(seed);
    (0..samples)
        .map(|_| JointState {
            q: r.random_range(-1.5..1.5),
            velocity: r.random_range(-1.0..1.0),
            torque: r.random_range(-20.0..20.0),
            across: [r.random_range(-20.0..20.0), r.random_range(-20.0..20.0)],
            approach: if r.random_bool(0.5) { 1.0 } else { -1.0 },
            other: r.random_range(-1.0..1.0),
            given: r.random_range(-1.0..1.0),
        })
        .collect()
}

fn recover(effect: &Effect, motion: Axis) {
    let states = states(40, 5);
    let mut r = rng(6);
    let mut p = Problem::new(states.len());
    let (base, a, b) = (p.frame("base"), p.frame("a"), p.frame("b"));
    let base_from_a = pose(0.3, 0.1, -0.2, 0.4, 1.0, -0.3);
    p.unknown("origin", base, a, base_from_a, Chart::none());
    let q = states.iter().map(|s| s.q).collect();
    let joint = p.joint("joint", a, b, motion, q);
    let mut truth = Vec::new();
    for (i, term) in effect.terms.iter().enumerate() {
        let id = p.free_effect_at(joint, term.kind, &states, None);
        let size = p.parameters()[id.index()].unit.typical_deviation();
        truth.push((id, term, size * (0.5 - 0.8 * i as f64)));
    }
    let observations = states
        .iter()
        .enumerate()
        .map(|(sample, state)| {
            let amounts = truth
                .iter()
                .map(|(_, term, c)| (term.kind, c * (term.regressor)(state)));
            let a_from_b = JointMotion::new(motion, state.q, amounts).joint_from_child();
            let pose = base_from_a * a_from_b * jitter(&mut r, NOISE, NOISE);
            PoseObservation { sample, pose }
        })
        .collect();
    let noise = PoseNoise::Split {
        orientation: p.noise_group("orientation", NoiseKind::Orientation, NOISE, false),
        position: p.noise_group("position", NoiseKind::Position, NOISE, false),
    };
    p.poses("body", base, b, noise, observations);
    let solution = solve(&p, &Settings::plain()).expect(effect.id);
    for (id, term, c) in truth {
        let found = &solution.parameters[id.index()];
        let sigma = found.sigma.expect(term.name);
        assert!(
            (found.value - c).abs() < 5.0 * sigma && sigma < 0.05 * c.abs(),
            "{}: {} ± {sigma} for {c}",
            found.name,
            found.value
        );
    }
}

#[test]
fn every_effect_is_recovered_from_simulated_measurements() {
    for effect in EFFECTS {
        for motion in [
            Axis::Revolute(axis(0.3, -0.5, 0.8)),
            Axis::Prismatic(axis(0.1, 0.7, 0.2)),
        ] {
            if effect.applies_to(&motion) {
                recover(effect, motion);
            }
        }
    }
}
