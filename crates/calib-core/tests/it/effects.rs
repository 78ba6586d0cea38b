//! Every entry of the table of joint effects: its coefficients are recovered from simulated measurements.

use crate::common::{axis, jitter, normal, pose, rng};
use calib_core::effect::{
    Effect, compliance, flank_backlash, friction, motor_eccentricity, motor_eccentricity_2, offset,
    thermal_expansion,
};
use calib_core::{
    Axis, Chart, EFFECTS, EffectKind, Gauge, JointMotion, JointState, NoiseKind, Parameter,
    ParameterKind, PoseNoise, PoseObservation, Problem, Settings, Share, Unit, solve,
};
use nalgebra::Vector3;
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
            motor: r.random_range(-100.0..100.0),
            friction: 5.0,
            other: r.random_range(-1.0..1.0),
            warmth: r.random_range(-20.0..20.0),
            given: r.random_range(-1.0..1.0),
        })
        .collect()
}

/// From the joint before, m.
const REACH: Vector3<f64> = Vector3::new(0.5, -0.3, 0.4);

fn recover(effect: &Effect, motion: Axis) {
    let states = states(40, 5);
    let mut r = rng(6);
    let mut p = Problem::new(states.len());
    let (base, a, b) = (p.frame("base"), p.frame("a"), p.frame("b"));
    let base_from_a = pose(0.3, 0.1, -0.2, 0.4, 1.0, -0.3);
    p.unknown("origin", base, a, base_from_a, Chart::none());
    let q = states.iter().map(|s| s.q).collect();
    let joint = p.joint("joint", a, b, motion, q);
    p.joint_reach(joint, REACH);
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
                .map(|(_, term, c)| (term.kind, c * term.regressor.at(state)));
            let moved = JointMotion::new((motion, REACH), state.q, amounts);
            let a_from_b = moved.joint_from_child();
            let pose = base_from_a * a_from_b * jitter(&mut r, NOISE, NOISE);
            PoseObservation {
                sample,
                pose,
                inverse: false,
            }
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

/// Prior σ of a first moment, kg m; what it was assumed to be is 1.
const MOMENT: f64 = 0.4;

/// One recording of a joint that yields, c = 2e-3 rad/(N m), to a load whose two first moments are drawn from their prior.
/// Returns (estimate − truth)/σ of the compliance and of the moments.
fn yielding(seed: u64) -> [f64; 3] {
    const SOFT: f64 = 2e-3;
    let mut r = rng(seed);
    let samples = 40;
    let mut array = || -> Vec<f64> { (0..samples).map(|_| r.random_range(-9.81..9.81)).collect() };
    let lever = [array(), array()];
    let q = array().iter().map(|x| x / 9.81).collect::<Vec<f64>>();
    let truth = [MOMENT * normal(&mut r), MOMENT * normal(&mut r)];
    let mut p = Problem::new(samples);
    let (a, b) = (p.frame("a"), p.frame("b"));
    let motion = Axis::Revolute(axis(0.1, 0.9, 0.3));
    let joint = p.joint("joint", a, b, motion, q.clone());
    let assumed = (0..samples).map(|s| lever[0][s] + lever[1][s]).collect();
    let kind = EffectKind::TorqueCompliance;
    let c = p.free_effect_with(joint, kind, assumed, Some(0.01));
    p.parameter_mut(c).bounds = Some((0.0, f64::INFINITY));
    let moments = ["x", "y"].map(|name| {
        p.parameter(Parameter {
            name: name.to_owned(),
            joint: None,
            kind: ParameterKind::Load,
            unit: Unit::KilogramMeter,
            nominal: 0.0,
            start: 0.0,
            prior_sigma: Some(MOMENT),
            bounds: None,
            fixed: false,
        })
    });
    let shares = moments.iter().zip(&lever).map(|(parameter, values)| Share {
        parameter: *parameter,
        values: values.clone(),
    });
    p.follow(joint, kind, shares.collect());
    let sigma = 1e-3;
    let observations = (0..samples)
        .map(|s| {
            let load = (1.0 + truth[0]) * lever[0][s] + (1.0 + truth[1]) * lever[1][s];
            let moved = JointMotion::new((motion, REACH), q[s], [(kind, SOFT * load)]);
            let pose = moved.joint_from_child() * jitter(&mut r, sigma, sigma);
            PoseObservation {
                sample: s,
                pose,
                inverse: false,
            }
        })
        .collect();
    let noise = PoseNoise::Split {
        orientation: p.noise_group("orientation", NoiseKind::Orientation, sigma, false),
        position: p.noise_group("position", NoiseKind::Position, sigma, false),
    };
    p.poses("body", a, b, noise, observations);
    let solution = solve(&p, &Settings::plain()).expect("a problem");
    assert!(
        solution.status.is_converged(),
        "{seed}: {:?}",
        solution.status
    );
    // What is measured is the product: moments against the compliance, whatever the scale.
    let value = |id: calib_core::ParameterId| solution.parameters[id.index()].value;
    for (i, moment) in moments.iter().enumerate() {
        let product = value(c) * (1.0 + value(*moment));
        assert!((product - SOFT * (1.0 + truth[i])).abs() < 2e-4, "{seed}");
    }
    let z = |id: calib_core::ParameterId, truth: f64| {
        let sigma = solution.parameters[id.index()].sigma.expect("determined");
        (value(id) - truth) / sigma
    };
    [z(c, SOFT), z(moments[0], truth[0]), z(moments[1], truth[1])]
}

/// Without priors and with nothing known of the masses only the products are determined, and the null space says so.
#[test]
fn the_common_scale_of_masses_and_compliances_is_named() {
    let mut p = Problem::new(30);
    let mut r = rng(3);
    let (a, b) = (p.frame("a"), p.frame("b"));
    let lever: Vec<f64> = (0..30).map(|_| r.random_range(-9.81..9.81)).collect();
    let q: Vec<f64> = lever.iter().map(|l| 0.1 * l).collect();
    let motion = Axis::Revolute(axis(0.0, 1.0, 0.0));
    let joint = p.joint("joint", a, b, motion, q.clone());
    let kind = EffectKind::TorqueCompliance;
    let c = p.free_effect_with(joint, kind, vec![0.0; 30], None);
    p.parameter_mut(c).start = 2e-3;
    let moment = p.parameter(Parameter {
        name: "moment".to_owned(),
        joint: None,
        kind: ParameterKind::Load,
        unit: Unit::KilogramMeter,
        nominal: 1.0,
        start: 1.0,
        prior_sigma: None,
        bounds: None,
        fixed: false,
    });
    let share = Share {
        parameter: moment,
        values: lever.clone(),
    };
    p.follow(joint, kind, vec![share]);
    let observations = (0..30)
        .map(|s| {
            let moved = JointMotion::new((motion, REACH), q[s], [(kind, 3e-3 * lever[s])]);
            let pose = moved.joint_from_child() * jitter(&mut r, NOISE, NOISE);
            PoseObservation {
                sample: s,
                pose,
                inverse: false,
            }
        })
        .collect();
    let noise = PoseNoise::Split {
        orientation: p.noise_group("orientation", NoiseKind::Orientation, NOISE, false),
        position: p.noise_group("position", NoiseKind::Position, NOISE, false),
    };
    p.poses("body", a, b, noise, observations);
    let solution = solve(&p, &Settings::plain()).expect("a problem");
    let value = |id: calib_core::ParameterId| solution.parameters[id.index()].value;
    assert!((value(c) * value(moment) - 3e-3).abs() < 1e-5);
    let null = &solution.observability.null;
    assert_eq!(null.len(), 1);
    assert_eq!(null[0].gauge, Gauge::LoadsAgainstCompliances);
}

#[test]
fn products_of_compliance_and_mass_are_found_and_their_uncertainty_is_honest() {
    let runs = 200;
    let z: Vec<[f64; 3]> = (0..runs).map(yielding).collect();
    for k in 1..3 {
        let inside = z.iter().filter(|z| z[k].abs() < 1.96).count();
        // Binomial: 95 % ± 1.5 %; the scale is held by priors on products, which are not normal.
        assert!(
            (176..=199).contains(&inside),
            "moment {k}: {inside} of {runs}"
        );
    }
}

/// One joint that yields and has a zero offset and this effect, with noise of 3e-4 rad in its pose: (estimate − truth)/σ of
/// each coefficient of the effect. Loads come of a posture: τ = 20 cos q, with friction 5 N m.
fn with_confounders(effect: &Effect, seed: u64) -> Vec<f64> {
    const SIGMA: f64 = 3e-4;
    let mut r = rng(seed);
    let mut before = 0.0;
    let states: Vec<JointState> = (0..60)
        .map(|row| {
            let q: f64 = r.random_range(-2.8..2.8);
            let approach = f64::signum(q - before);
            before = q;
            JointState {
                q,
                torque: 20.0 * q.cos(),
                approach,
                motor: 101.0 * q,
                friction: 5.0,
                // From a cold start to 15 K above it.
                warmth: 15.0 * (1.0 - (-row as f64 / 20.0).exp()),
                ..JointState::default()
            }
        })
        .collect();
    let motion = Axis::Revolute(axis(0.2, 0.9, -0.1));
    let mut p = Problem::new(states.len());
    let (a, b) = (p.frame("a"), p.frame("b"));
    let joint = p.joint("joint", a, b, motion, states.iter().map(|s| s.q).collect());
    p.joint_reach(joint, REACH);
    let sizes: Vec<_> = [&offset::EFFECT, &compliance::EFFECT, effect]
        .iter()
        .flat_map(|e| e.terms)
        .map(|term| {
            let size = match term.kind {
                EffectKind::TorqueCompliance => 2e-4,
                EffectKind::Friction => 1e-4,
                EffectKind::ThermalExpansion => 2e-5,
                _ => 1e-3,
            };
            let id = p.free_effect_at(joint, term.kind, &states, None);
            (id, term, size * (0.5 + normal(&mut r).abs()))
        })
        .collect();
    let observations = states
        .iter()
        .enumerate()
        .map(|(sample, state)| {
            let amounts = sizes
                .iter()
                .map(|(_, term, c)| (term.kind, c * term.regressor.at(state)));
            let moved = JointMotion::new((motion, REACH), state.q, amounts).joint_from_child();
            let pose = moved * jitter(&mut r, SIGMA, SIGMA);
            PoseObservation {
                sample,
                pose,
                inverse: false,
            }
        })
        .collect();
    let noise = PoseNoise::Split {
        orientation: p.noise_group("orientation", NoiseKind::Orientation, SIGMA, false),
        position: p.noise_group("position", NoiseKind::Position, SIGMA, false),
    };
    p.poses("body", a, b, noise, observations);
    let solution = solve(&p, &Settings::plain()).expect(effect.id);
    let of_effect = sizes.into_iter().skip(2);
    of_effect
        .map(|(id, _, truth)| {
            let found = &solution.parameters[id.index()];
            (found.value - truth) / found.sigma.expect("determined")
        })
        .collect()
}

/// Coverage of 95 % intervals beside a zero offset and compliance, over 300 joints: 95 % ± three binomial deviations (1.3 %).
#[test]
fn effects_of_the_drive_are_found_beside_their_confounders() {
    for effect in [
        &motor_eccentricity::EFFECT,
        &motor_eccentricity_2::EFFECT,
        &flank_backlash::EFFECT,
        &friction::EFFECT,
        &thermal_expansion::EFFECT,
    ] {
        let z: Vec<f64> = (0..300)
            .flat_map(|seed| with_confounders(effect, seed))
            .collect();
        let inside = z.iter().filter(|z| z.abs() < 1.96).count() as f64 / z.len() as f64;
        println!("{}: {:.1} % of {}", effect.id, 100.0 * inside, z.len());
        assert!((0.912..0.988).contains(&inside), "{}: {inside}", effect.id);
    }
}
