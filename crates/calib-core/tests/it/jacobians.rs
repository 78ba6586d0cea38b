//! Every edge and every measurement against central differences through the same coordinates.

use crate::common::{axis, central, jitter, normal, normal3, pose, rng};
use calib_core::effect::Source;
use calib_core::{
    Axis, Chart, DirectionObservation, EffectKind, MarkerObservation, Measurement, MeasurementKind,
    Model, NoiseKind, Parameter, ParameterKind, PoseNoise, PoseObservation, Problem, Share, Unit,
    Values, measurement,
};
use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Vector6};
use rand::RngExt;

/// Central differences with h = 1e-6 on quantities of order 1: truncation and rounding about 1e-9.
const AGREEMENT: f64 = 2e-8;

fn assert_jacobian(name: &str, problem: &Problem, values: &Values) {
    let model = Model::new(problem).unwrap();
    let free: Vec<usize> = (0..problem.parameters().len())
        .filter(|&p| !model.problem().parameters()[p].fixed)
        .collect();
    let analytic = model.jacobian(values);
    let numeric = central(|v| model.residuals(v), values, &free, 1e-6);
    let worst = (&analytic - &numeric).amax();
    assert!(
        worst < AGREEMENT,
        "{name}: {worst:.1e}\n{analytic:.6}\n{numeric:.6}"
    );
    assert!(analytic.amax() > 0.1, "{name}: nothing to differentiate");
}

/// Start values moved off the nominal, so that no derivative is taken at a special place.
fn displaced(problem: &Problem, seed: u64) -> Values {
    let mut r = rng(seed);
    Values(
        problem
            .parameters()
            .iter()
            .map(|p| p.start + 0.3 * normal(&mut r))
            .collect(),
    )
}

/// base –(unknown)– a –(joint with every effect)– b –(unknown, skew axis chart)– c –(prismatic)– d
struct Rig {
    problem: Problem,
    base: calib_core::FrameId,
    end: calib_core::FrameId,
    edges: Vec<calib_core::EdgeId>,
    group: calib_core::GroupId,
}

fn rig(samples: usize, seed: u64) -> Rig {
    let mut r = rng(seed);
    let mut p = Problem::new(samples);
    let base = p.frame("base");
    let a = p.frame("a");
    let b = p.frame("b");
    let c = p.frame("c");
    let end = p.frame("d");
    let e0 = p.unknown(
        "first",
        base,
        a,
        pose(0.3, 0.1, -0.2, 0.4, 1.0, -0.3),
        Chart::full(),
    );
    let mut array = || {
        (0..samples)
            .map(|_| r.random_range(-1.5..1.5))
            .collect::<Vec<f64>>()
    };
    let q1 = array();
    let e1 = p.joint("turn", a, b, Axis::Revolute(axis(0.3, -0.5, 0.8)), q1);
    // Every term of the table, each at random states.
    let mut clock = None;
    for kind in EffectKind::all() {
        let v = array();
        let own = matches!(kind.term().source, Source::Constant | Source::Reading);
        let id = if own {
            p.free_effect(e1, kind, None)
        } else {
            p.free_effect_with(e1, kind, v, None)
        };
        if kind == EffectKind::ClockOffset {
            clock = Some(id);
        }
    }
    let clock = clock.expect("in the table");
    // Two masses that load both joints: effects that are bilinear in their coefficient and these.
    let masses = ["near", "far"].map(|name| {
        p.parameter(Parameter {
            name: name.to_owned(),
            joint: None,
            kind: ParameterKind::Load,
            unit: Unit::KilogramMeter,
            nominal: 0.0,
            start: 0.2,
            prior_sigma: None,
            bounds: None,
            fixed: false,
        })
    });
    let mut shares = || {
        let share = |parameter| Share {
            parameter,
            values: array(),
        };
        masses.map(share).to_vec()
    };
    let [about, across] = [EffectKind::TorqueCompliance, EffectKind::Lateral2];
    p.follow(e1, about, shares());
    p.follow(e1, across, shares());
    let of_slide = shares();
    let e2 = p.unknown(
        "second",
        b,
        c,
        pose(-0.1, 0.5, 0.2, -0.7, 0.2, 0.5),
        Chart::axis_line(&axis(0.2, 0.9, -0.4)),
    );
    let q3 = array();
    let e3 = p.joint("slide", c, end, Axis::Prismatic(axis(0.1, 0.7, 0.2)), q3);
    p.free_effect(e3, EffectKind::ZeroOffset, None);
    let v = array();
    p.free_effect_with(e3, about, v, None);
    p.follow(e3, about, of_slide);
    let v = array();
    // One clock for both joints: the contributions must add.
    p.share_effect(e3, EffectKind::ClockOffset, Some(v), clock);
    let group = p.noise_group("n", NoiseKind::Position, 1e-3, false);
    Rig {
        problem: p,
        base,
        end,
        edges: vec![e0, e1, e2, e3],
        group,
    }
}

fn all_heads(rig: &mut Rig, from: calib_core::FrameId, to: calib_core::FrameId, seed: u64) {
    let mut r = rng(seed);
    let n = rig.problem.samples();
    let known = rig
        .problem
        .known_point("pk", to, Point3::new(0.1, -0.2, 0.3));
    let unknown = rig
        .problem
        .unknown_point("pu", to, Point3::new(-0.3, 0.1, 0.2), None);
    let shape = {
        let a = Matrix3::from_fn(|_, _| r.random_range(-1.0..1.0));
        a * a.transpose() + Matrix3::identity() * 0.3
    };
    let noise = rig.group;
    let split = PoseNoise::Split {
        orientation: noise,
        position: noise,
    };
    let mut add = |name: &str, kind: MeasurementKind| {
        rig.problem.add_measurement(Measurement {
            name: name.to_owned(),
            from,
            to,
            path: None,
            kind,
        });
    };
    let mut markers = Vec::new();
    for sample in 0..n {
        for (point, shape) in [
            (known, None),
            (unknown, None),
            (known, Some(shape)),
            (unknown, Some(shape)),
        ] {
            markers.push(MarkerObservation {
                sample,
                point,
                position: Point3::from(normal3(&mut r)),
                shape: shape.map(Box::new),
            });
        }
    }
    add(
        "markers",
        MeasurementKind::Markers(measurement::Markers {
            sight: None,
            own: std::collections::BTreeMap::new(),
            noise,
            observations: markers,
        }),
    );
    let observations = (0..n)
        .map(|sample| PoseObservation {
            sample,
            pose: jitter(&mut r, 0.6, 0.5),
            inverse: false,
        })
        .collect();
    add(
        "poses",
        MeasurementKind::Poses(measurement::Poses {
            sight: None,
            noise: split,
            observations,
        }),
    );
    for sign_free in [false, true] {
        let observations = (0..n)
            .map(|sample| DirectionObservation {
                sample,
                direction: axis(normal(&mut r), normal(&mut r), normal(&mut r)),
            })
            .collect();
        add(
            "directions",
            MeasurementKind::Directions(measurement::Directions {
                direction: axis(0.2, 0.4, -0.9),
                noise,
                observations,
                sign_free,
            }),
        );
    }
    for point in [known, unknown] {
        add(
            "plane",
            MeasurementKind::Plane(measurement::Plane {
                point,
                normal: axis(0.1, 0.2, 0.9),
                noise,
                observations: (0..n).map(|s| (s, 0.1)).collect(),
            }),
        );
        add(
            "line",
            MeasurementKind::Line(measurement::Line {
                point,
                through: Point3::new(0.1, 0.2, 0.3),
                direction: axis(0.5, 0.2, 0.9),
                noise,
                samples: (0..n).collect(),
            }),
        );
        add(
            "distance",
            MeasurementKind::Distance(measurement::Distance {
                point,
                anchor: Point3::new(1.1, 0.2, 0.3),
                noise,
                observations: (0..n).map(|s| (s, 0.7)).collect(),
            }),
        );
    }
}

#[test]
fn heads_and_edges_walked_forward() {
    for seed in 0..5 {
        let mut rig = rig(4, seed);
        let (from, to) = (rig.base, rig.end);
        all_heads(&mut rig, from, to, 100 + seed);
        let at = displaced(&rig.problem, 200 + seed);
        assert_jacobian("forward", &rig.problem, &at);
    }
}

#[test]
fn heads_and_edges_walked_backward() {
    for seed in 0..5 {
        let mut rig = rig(4, seed);
        let (from, to) = (rig.end, rig.base);
        all_heads(&mut rig, from, to, 100 + seed);
        let at = displaced(&rig.problem, 200 + seed);
        assert_jacobian("backward", &rig.problem, &at);
    }
}

#[test]
fn a_block_that_occurs_twice_contributes_twice() {
    // base → d → (the same edges again) through an explicit path: first·turn·first⁻¹ closes on itself.
    let mut rig = rig(4, 3);
    let (e0, e1) = (rig.edges[0], rig.edges[1]);
    let a = rig.problem.find_frame("a").unwrap();
    let b = rig.problem.find_frame("b").unwrap();
    let home = rig.problem.known("home", b, a, Isometry3::identity());
    let noise = rig.group;
    rig.problem.add_measurement(Measurement {
        name: "conjugate".into(),
        from: rig.base,
        to: rig.base,
        path: Some(vec![(e0, false), (e1, false), (home, false), (e0, true)]),
        kind: MeasurementKind::Poses(measurement::Poses {
            sight: None,
            noise: PoseNoise::Split {
                orientation: noise,
                position: noise,
            },
            observations: (0..4)
                .map(|sample| PoseObservation {
                    sample,
                    pose: pose(0.1, 0.2, 0.3, 0.2, 0.1, 0.4),
                    inverse: false,
                })
                .collect(),
        }),
    });
    let at = displaced(&rig.problem, 9);
    assert_jacobian("conjugate", &rig.problem, &at);
}

#[test]
fn loops_of_two_paths() {
    let mut rig = rig(4, 5);
    let e = rig.edges.clone();
    let mut r = rng(50);
    let poses = (0..4).map(|_| Some(jitter(&mut r, 0.5, 0.5))).collect();
    let (base, end) = (rig.base, rig.end);
    let seen = rig.problem.measured("seen", base, end, poses, None);
    let noise = rig.group;
    rig.problem.add_loop(
        "loop",
        end,
        &[(e[0], false), (e[1], false), (e[2], false), (e[3], false)],
        &[(seen, false)],
        PoseNoise::Full {
            shape: Matrix6::identity(),
            scale: noise,
        },
        (0..4).collect(),
    );
    let at = displaced(&rig.problem, 51);
    assert_jacobian("loop", &rig.problem, &at);
}

#[test]
fn random_effects_are_derivatives_too() {
    // The noise of a joint acts like its offset; a wobble like a pose edge in its place.
    for backward in [false, true] {
        let mut rig = rig(3, 7);
        let (from, to) = if backward {
            (rig.end, rig.base)
        } else {
            (rig.base, rig.end)
        };
        all_heads(&mut rig, from, to, 8);
        let joint_group = rig
            .problem
            .noise_group("joint", NoiseKind::Joint, 1e-3, false);
        rig.problem.joint_noise(rig.edges[1], joint_group);
        let at = displaced(&rig.problem, 10);
        let model = Model::new(&rig.problem).unwrap();
        let column = rig.problem.find_parameter("turn.offset").unwrap().index();
        let by_offset = model.jacobian(&at).column(column).into_owned();
        let by_noise = model.random_jacobian(&at).column(0).into_owned();
        assert!((by_offset - by_noise).amax() < 1e-12);
    }
}

#[test]
fn charts_invert_and_differentiate() {
    let charts = [
        Chart::full(),
        Chart::position(),
        Chart::orientation(),
        Chart::axis_line(&axis(0.0, 0.0, 1.0)),
        Chart::axis_line(&axis(1.0, 0.0, 0.0)),
        Chart::axis_line(&axis(0.3, -0.4, 0.8)),
        Chart::direction(&axis(0.0, -1.0, 0.0)),
        Chart::slide(&axis(0.0, 1.0, 0.0)),
        Chart::turn(&axis(0.5, 0.5, 0.0)),
    ];
    let mut r = rng(1);
    for chart in charts {
        for _ in 0..20 {
            let mut c = Vector6::zeros();
            for i in 0..6 {
                if chart.free()[i] {
                    c[i] = r.random_range(-0.9..0.9);
                }
            }
            let x = chart.displacement(&c);
            assert!((chart.coordinates(&x) - c).norm() < 1e-12);
            let d = chart.differential(&c);
            for i in (0..6).filter(|&i| chart.free()[i]) {
                let mut step = Vector6::zeros();
                step[i] = 1e-6;
                let xi = calib_geometry::se3::log(
                    &(chart.displacement(&(c - step)).inverse() * chart.displacement(&(c + step))),
                );
                assert!((xi.0 / 2e-6 - d.column(i)).norm() < 1e-8);
            }
        }
    }
    // Known axes keep their letters: the line of a y joint is free in rx, rz, x, z.
    assert_eq!(
        Chart::axis_line(&axis(0.0, 1.0, 0.0)).free(),
        [true, false, true, true, false, true]
    );
}
