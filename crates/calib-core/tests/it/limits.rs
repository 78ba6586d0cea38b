//! Bounds, degenerate problems and everything that must be refused with both sides named.

use crate::common::{Chain, Free, axis, normal3, pose, rng, six_r};
use calib_core::{
    Axis, Chart, ClosureStatistics, Configuration, EffectKind, Error, MarkerObservation,
    Measurement, MeasurementKind, NoiseKind, PoseNoise, PoseObservation, Problem, Settings,
    SolveStatus, Spread, measurement, solve,
};
use nalgebra::{Isometry3, Matrix6, Point3, Vector3};

/// A tool tip on one link whose origin has a physical limit.
fn boxed(limit: f64) -> calib_core::Solution {
    let mut r = rng(1);
    let mut free = Free::frames_and_offsets(6);
    free.origins[3] = Chart::position();
    let mut chain = Chain::nominal(six_r()).posed(&mut r, 30, 1.3);
    // Joint 4 sits 8 mm off along its axis' normals, outside a housing of ±5 mm.
    chain.true_origins[3] *= nalgebra::Translation3::new(0.0, 0.008, -0.003);
    let mut h = chain.problem(&free, 1e-4);
    for name in ["j4.origin.x", "j4.origin.y", "j4.origin.z"] {
        let p = h.problem.find_parameter(name).unwrap();
        h.problem.parameter_mut(p).bounds = Some((-limit, limit));
        h.problem.parameter_mut(p).prior_sigma = Some(0.05);
    }
    chain.observe(&mut r, &mut h, 1e-4, 0.0);
    solve(&h.problem, &Settings::plain()).unwrap()
}

#[test]
fn a_box_holds_and_is_reported() {
    let inside = boxed(0.02);
    let y = |s: &calib_core::Solution| {
        s.parameters
            .iter()
            .find(|p| p.name == "j4.origin.y")
            .cloned()
            .unwrap()
    };
    assert!(inside.status.is_converged());
    assert!((y(&inside).value - 0.008).abs() < 1e-3 && !y(&inside).at_bound);
    let held = boxed(0.005);
    assert!(held.status.is_converged(), "{:?}", held.status);
    assert_eq!(y(&held).value, 0.005);
    assert!(y(&held).at_bound);
    assert!(held.chi2 > inside.chi2);
    for p in &held.parameters {
        if p.name.starts_with("j4.origin") {
            assert!(p.value.abs() <= 0.005);
        }
    }
}

#[test]
fn the_estimate_without_its_bound_is_known_on_the_bound() {
    let inside = boxed(0.02);
    assert_eq!(inside.without_bounds(), Some(Vec::new()));
    let held = boxed(0.005);
    let found = held.without_bounds().expect("a model");
    assert!(!found.is_empty());
    for without in found {
        let free = &inside.parameters[without.parameter.index()];
        let sigma = free.sigma.expect("determined");
        assert!(
            (without.value - free.value).abs() < 0.2 * sigma,
            "{without:?} {free:?}"
        );
        assert!(
            (without.sigma / sigma - 1.0).abs() < 0.1,
            "{without:?} {free:?}"
        );
    }
}

#[test]
fn bounds_that_do_not_bind_change_nothing() {
    let (a, b) = (boxed(0.02), boxed(0.5));
    for (a, b) in a.parameters.iter().zip(&b.parameters) {
        assert!((a.value - b.value).abs() < 1e-8, "{}", a.name);
    }
}

#[test]
fn priors_beat_boxes_on_poorly_excited_data() {
    // Small motion, whole geometry free: the prior knows what the data cannot.
    let mut free = Free::everything(6);
    let mut errors = [0.0; 2];
    for (k, use_prior) in [true, false].into_iter().enumerate() {
        free.prior = use_prior.then_some((0.01, 0.005));
        for seed in 0..6 {
            let mut r = rng(seed);
            let chain = Chain::nominal(six_r())
                .posed(&mut r, 12, 0.25)
                .deviate(&mut r, &free, 0.01, 0.005);
            let mut h = chain.problem(&free, 1e-3);
            for e in [h.world, h.mount] {
                h.problem.set_prior(e, Some(0.01), Some(0.005));
            }
            if !use_prior {
                for i in 0..h.problem.parameters().len() {
                    let name = h.problem.parameters()[i].name.clone();
                    let p = h.problem.find_parameter(&name).unwrap();
                    let p = h.problem.parameter_mut(p);
                    p.prior_sigma = None;
                    p.bounds = Some((-0.03, 0.03));
                }
            }
            chain.observe(&mut r, &mut h, 1e-3, 0.0);
            let s = solve(&h.problem, &Settings::plain()).unwrap();
            let mut at = Configuration::zero();
            for j in &h.joints {
                at = at.with(*j, 1.0);
            }
            let found = s.relative_pose(h.tracker, h.body, &at).unwrap();
            let truth = chain.tracker_from_body(&[1.0; 6], &[]);
            errors[k] += (found.pose.translation.vector - truth.translation.vector).norm();
        }
    }
    assert!(errors[0] < 0.6 * errors[1], "{errors:?}");
}

fn tiny() -> (
    Problem,
    calib_core::FrameId,
    calib_core::FrameId,
    calib_core::GroupId,
) {
    let mut p = Problem::new(3);
    let a = p.frame("a");
    let b = p.frame("b");
    p.unknown("x", a, b, Isometry3::identity(), Chart::full());
    let g = p.noise_group("n", NoiseKind::Position, 1e-3, false);
    (p, a, b, g)
}

fn refused(p: &Problem) -> String {
    solve(p, &Settings::default()).unwrap_err().to_string()
}

#[test]
fn what_cannot_be_stated_is_refused_by_name() {
    let (p, ..) = tiny();
    assert_eq!(
        solve(&p, &Settings::default()).unwrap_err(),
        Error::NoObservations
    );

    let (mut p, a, b, g) = tiny();
    let lonely = p.frame("lonely");
    let point = p.known_point("m", lonely, Point3::origin());
    p.markers(
        "h",
        a,
        lonely,
        g,
        vec![MarkerObservation {
            sample: 0,
            point,
            position: Point3::origin(),
            shape: None,
        }],
    );
    assert_eq!(refused(&p), "no path from frame `a` to frame `lonely`");

    let (mut p, a, b2, g) = tiny();
    assert_eq!(b, b2);
    let point = p.known_point("m", a, Point3::origin());
    p.markers(
        "h",
        a,
        b2,
        g,
        vec![MarkerObservation {
            sample: 0,
            point,
            position: Point3::origin(),
            shape: None,
        }],
    );
    assert_eq!(
        refused(&p),
        "point `m` is fixed in frame `a`, measurement `h` is of frame `b`"
    );

    let (mut p, a, b, g) = tiny();
    let point = p.known_point("m", b, Point3::origin());
    p.markers(
        "h",
        a,
        b,
        g,
        vec![MarkerObservation {
            sample: 7,
            point,
            position: Point3::origin(),
            shape: None,
        }],
    );
    assert_eq!(refused(&p), "`h` names sample 7 of 3");

    let (mut p, a, b, g) = tiny();
    let point = p.known_point("m", b, Point3::origin());
    p.markers(
        "h",
        a,
        b,
        g,
        vec![MarkerObservation {
            sample: 1,
            point,
            position: Point3::new(f64::NAN, 0.0, 0.0),
            shape: None,
        }],
    );
    assert_eq!(refused(&p), "`h` is not finite at sample 1");

    let (mut p, _, b, _) = tiny();
    let c = p.frame("c");
    p.joint(
        "elbow",
        b,
        c,
        Axis::Revolute(axis(0.0, 0.0, 1.0)),
        vec![0.0; 2],
    );
    assert_eq!(refused(&p), "`elbow` has 2 entries for 3 samples");

    let (mut p, _, b, _) = tiny();
    let c = p.frame("c");
    p.joint(
        "elbow",
        b,
        c,
        Axis::Revolute(axis(0.0, 0.0, 1.0)),
        vec![0.0, f64::INFINITY, 0.0],
    );
    assert_eq!(refused(&p), "`elbow` is not finite at sample 1");

    let (mut p, _, _, g) = tiny();
    p.group_mut(g).sigma = 0.0;
    assert_eq!(refused(&p), "`n` must be positive and finite, got 0");

    let (mut p, ..) = tiny();
    let x = p.find_parameter("x.z").unwrap();
    p.parameter_mut(x).bounds = Some((0.5, 1.0));
    assert_eq!(
        refused(&p),
        "parameter `x.z` starts at 0 outside its bounds [0.5, 1]"
    );

    let (mut p, a, b, _) = tiny();
    p.unknown("x", a, b, Isometry3::identity(), Chart::position());
    assert_eq!(refused(&p), "two parameters are called `x.x`");

    let (mut p, a, b, g) = tiny();
    let c = p.frame("c");
    let e = p.known("y", b, c, Isometry3::identity());
    p.add_measurement(Measurement {
        name: "h".into(),
        from: a,
        to: c,
        path: Some(vec![(e, false)]),
        kind: MeasurementKind::Poses(measurement::Poses {
            sight: None,
            noise: PoseNoise::Split {
                orientation: g,
                position: g,
            },
            observations: vec![PoseObservation {
                sample: 0,
                pose: Isometry3::identity(),
                inverse: false,
            }],
        }),
    });
    assert_eq!(
        refused(&p),
        "path of `h`: edge `y` begins at frame `b` where `a` was reached"
    );

    let (mut p, a, b, g) = tiny();
    p.poses(
        "h",
        a,
        b,
        PoseNoise::Full {
            shape: -Matrix6::identity(),
            scale: g,
        },
        vec![PoseObservation {
            sample: 0,
            pose: Isometry3::identity(),
            inverse: false,
        }],
    );
    assert!(refused(&p).starts_with("`h covariance` must be positive"));
}

#[test]
fn predictions_along_measured_edges_are_refused() {
    let (mut p, a, b, g) = tiny();
    let c = p.frame("c");
    p.measured("seen", b, c, vec![Some(Isometry3::identity()); 3], None);
    p.poses(
        "h",
        a,
        c,
        PoseNoise::Split {
            orientation: g,
            position: g,
        },
        (0..3)
            .map(|sample| PoseObservation {
                sample,
                pose: Isometry3::identity(),
                inverse: false,
            })
            .collect(),
    );
    let s = solve(&p, &Settings::default()).unwrap();
    assert!(matches!(
        s.relative_pose(a, c, &Configuration::zero()),
        Err(Error::PerSample { edge }) if edge == "seen"
    ));
}

#[test]
fn lost_measurements_drop_their_observations_with_a_reason() {
    let (mut p, a, b, g) = tiny();
    let c = p.frame("c");
    p.measured(
        "seen",
        b,
        c,
        vec![
            Some(Isometry3::identity()),
            None,
            Some(Isometry3::identity()),
        ],
        None,
    );
    p.poses(
        "h",
        a,
        c,
        PoseNoise::Split {
            orientation: g,
            position: g,
        },
        (0..3)
            .map(|sample| PoseObservation {
                sample,
                pose: pose(0.1, 0.0, 0.0, 0.0, 0.0, 0.2),
                inverse: false,
            })
            .collect(),
    );
    let s = solve(&p, &Settings::default()).unwrap();
    assert_eq!(s.rejected.len(), 1);
    assert_eq!(
        (s.rejected[0].sample, s.rejected[0].reason),
        (1, calib_core::RejectReason::Occlusion)
    );
    assert!(s.status.is_converged());
}

#[test]
fn a_measured_edge_with_covariance_weighs_like_noise_of_the_head() {
    // base –Z(noisy)– x: the noise may be stated on the edge or on the measurement.
    let mut r = rng(3);
    let n = 12;
    let truth = pose(0.2, 0.1, 0.3, 0.3, -0.2, 0.5);
    let seen: Vec<Isometry3<f64>> = (0..n)
        .map(|_| pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0) * crate::common::jitter(&mut r, 1e-3, 1e-3))
        .collect();
    let mut sigmas = Vec::new();
    for on_edge in [true, false] {
        let mut p = Problem::new(n);
        let [a, b, c] = ["a", "b", "c"].map(|f| p.frame(f));
        p.measured(
            "z",
            a,
            b,
            seen.iter().map(|x| Some(*x)).collect(),
            on_edge.then(|| Matrix6::identity() * 1e-6),
        );
        p.unknown("x", b, c, truth, Chart::position());
        let sigma = if on_edge { 1e-9 } else { 1e-3 };
        let g = p.noise_group("n", NoiseKind::Position, sigma, false);
        p.poses(
            "h",
            a,
            c,
            PoseNoise::Split {
                orientation: g,
                position: g,
            },
            (0..n)
                .map(|sample| PoseObservation {
                    sample,
                    pose: truth,
                    inverse: false,
                })
                .collect(),
        );
        let s = solve(&p, &Settings::plain()).unwrap();
        assert!(s.status.is_converged());
        sigmas.push(s.parameters[0].sigma.unwrap());
    }
    // Rotation noise of the edge acts on the lever too when it is stated there.
    assert!(
        sigmas[0] >= 0.9 * sigmas[1] && sigmas[0] < 1.2 * sigmas[1],
        "{sigmas:?}"
    );
}

#[test]
fn nothing_free_is_an_evaluation_only() {
    let mut r = rng(4);
    let chain = Chain::nominal(six_r()).posed(&mut r, 5, 1.0);
    let mut h = chain.problem(&Free::nothing(6), 1e-3);
    chain.observe(&mut r, &mut h, 1e-3, 0.0);
    let s = solve(&h.problem, &Settings::default()).unwrap();
    assert_eq!(s.status, SolveStatus::Converged);
    assert_eq!(s.parameters.len(), 0);
    assert!((s.chi2 / s.degrees_of_freedom - 1.0).abs() < 0.6);
    assert_eq!(s.leave_one_out().unwrap().samples.len(), 5);
}

#[test]
fn a_coarse_start_is_enough() {
    // (0.35 rad, 150 mm) per link: the paper figure is 499 of 500 starts of a 6R chain with 36 poses.
    let mut good = 0;
    let runs = 25;
    for seed in 0..runs {
        let mut r = rng(seed);
        let mut free = Free::frames_and_offsets(6);
        for i in 1..6 {
            free.origins[i] = Chart::axis_line(&match six_r()[i].axis {
                Axis::Revolute(a) | Axis::Prismatic(a) => a,
            });
        }
        let chain = Chain::nominal(six_r()).posed(&mut r, 36, 1.4).deviate(
            &mut r,
            &free,
            0.35 / 3f64.sqrt(),
            0.15 / 3f64.sqrt(),
        );
        let mut h = chain.problem(&free, 1e-4);
        chain.observe(&mut r, &mut h, 1e-4, 0.0);
        let s = solve(&h.problem, &Settings::plain()).unwrap();
        good += usize::from(s.status.is_converged() && s.chi2 / s.degrees_of_freedom < 2.0);
    }
    assert!(good >= runs as usize - 1, "{good}");
}

#[test]
fn closure_statistics() {
    let a = pose(0.1, 0.2, 0.3, 0.1, 0.2, 0.3);
    let pairs: Vec<_> = [0.001, 0.002, 0.003]
        .iter()
        .map(|&d| (a, a * pose(d, 0.0, 0.0, 0.0, 0.0, 10.0 * d)))
        .collect();
    let s = ClosureStatistics::of(&pairs);
    assert_eq!(s.samples, 3);
    assert!((s.translation.mean - 0.002).abs() < 1e-12);
    assert!((s.translation.std - 0.001).abs() < 1e-12);
    assert!((s.translation.max - 0.003).abs() < 1e-12);
    assert!((s.translation.rms - (14.0_f64 / 3.0).sqrt() * 1e-3).abs() < 1e-12);
    assert!((s.rotation.mean - 0.02).abs() < 1e-9);
    let swapped: Vec<_> = pairs.iter().map(|(a, b)| (*b, *a)).collect();
    let t = ClosureStatistics::of(&swapped);
    assert!((t.translation.mean - s.translation.mean).abs() < 1e-12);
    assert!((t.rotation.rms - s.rotation.rms).abs() < 1e-12);
    assert_eq!(ClosureStatistics::of(&[]).translation, Spread::default());
}

#[test]
fn several_arms_share_their_torso() {
    // base –torso– two arms with one body each; the torso's offset is seen by both.
    let mut r = rng(6);
    let n = 25;
    let mut p = Problem::new(n);
    let base = p.frame("base");
    let torso = p.frame("torso");
    let q: Vec<f64> = (0..n).map(|i| (i as f64 * 0.7).sin()).collect();
    let t = p.joint(
        "torso",
        base,
        torso,
        Axis::Revolute(axis(0.0, 0.0, 1.0)),
        q.clone(),
    );
    p.free_effect(t, EffectKind::ZeroOffset, None);
    let g = p.noise_group("m", NoiseKind::Position, 1e-3, false);
    let mut sigma = Vec::new();
    for arm in 0..2 {
        let side = if arm == 0 { 0.3 } else { -0.3 };
        let shoulder = p.frame(&format!("shoulder{arm}"));
        let hand = p.frame(&format!("hand{arm}"));
        let mount = pose(0.1, side, 0.5, 0.0, 0.0, 0.0);
        p.known(&format!("mount{arm}"), torso, shoulder, mount);
        let qa: Vec<f64> = (0..n).map(|i| (i as f64 * 1.3 + side).cos()).collect();
        p.joint(
            &format!("arm{arm}"),
            shoulder,
            hand,
            Axis::Revolute(axis(0.0, 1.0, 0.0)),
            qa.clone(),
        );
        let tip = Point3::new(0.5, 0.0, 0.0);
        let point = p.known_point(&format!("tip{arm}"), hand, tip);
        let seen = (0..n)
            .map(|s| {
                let x = Isometry3::rotation(Vector3::z() * (q[s] + 0.02))
                    * mount
                    * Isometry3::rotation(Vector3::y() * qa[s]);
                MarkerObservation {
                    sample: s,
                    point,
                    position: x * tip + normal3(&mut r) * 1e-3,
                    shape: None,
                }
            })
            .collect();
        p.markers(&format!("hand{arm}"), base, hand, g, seen);
        let s = solve(&p, &Settings::plain()).unwrap();
        let offset = &s.parameters[0];
        assert!((offset.value - 0.02).abs() < 4.0 * offset.sigma.unwrap());
        sigma.push(offset.sigma.unwrap());
    }
    assert!(sigma[1] < 0.8 * sigma[0]);
}

#[test]
fn a_builder_call_on_the_wrong_kind_of_edge_is_an_error() {
    type Call = fn(&mut Problem, calib_core::EdgeId, calib_core::EdgeId);
    let calls: [(&str, Call); 8] = [
        ("set_role", |p, _, joint| {
            p.set_role(joint, calib_core::Role::Mount, None);
        }),
        ("set_prior", |p, _, joint| {
            p.set_prior(joint, Some(0.1), None);
        }),
        ("set_start", |p, _, joint| {
            p.set_start(joint, &Isometry3::identity());
        }),
        ("free_effect", |p, pose, _| {
            p.free_effect(pose, EffectKind::Gain, None);
        }),
        ("free_effect", |p, pose, _| {
            p.free_effect_with(pose, EffectKind::Backlash, vec![1.0, -1.0], None);
        }),
        ("candidate", |p, pose, _| {
            p.candidate(pose, EffectKind::Backlash, vec![1.0, -1.0]);
        }),
        ("joint_noise", |p, pose, _| {
            let group = p.noise_group("joint", NoiseKind::Joint, 1e-3, false);
            p.joint_noise(pose, group);
        }),
        ("share_effect", |p, pose, joint| {
            let shared = p.free_effect(joint, EffectKind::Gain, None);
            p.share_effect(pose, EffectKind::Gain, Some(vec![0.1, 0.2]), shared);
        }),
    ];
    for (name, call) in calls {
        let mut p = Problem::new(2);
        let (a, b, c) = (p.frame("a"), p.frame("b"), p.frame("c"));
        let pose = p.unknown("pose", a, b, Isometry3::identity(), Chart::full());
        let axis = Axis::Revolute(nalgebra::Vector3::z_axis());
        let joint = p.joint("joint", b, c, axis, vec![0.1, 0.2]);
        call(&mut p, pose, joint);
        let error = calib_core::Model::new(&p).expect_err(name);
        assert!(
            matches!(&error, Error::WrongEdge { call, .. } if *call == name),
            "{name}: {error}"
        );
    }
}

/// A frame or a parameter of a name that is taken: a result could not say which it is of.
#[test]
fn names_that_are_taken_are_refused() {
    let mut p = Problem::new(1);
    let (a, b) = (p.frame("a"), p.frame("b"));
    p.unknown("pose", a, b, Isometry3::identity(), Chart::full());
    let mut frames = p.clone();
    frames.frame("a");
    let error = calib_core::Model::new(&frames).expect_err("two frames");
    assert_eq!(error, Error::DuplicateFrame { name: "a".into() });
    assert_eq!(error.to_string(), "two frames are called `a`");
    let c = p.frame("c");
    p.unknown("pose", b, c, Isometry3::identity(), Chart::full());
    let error = calib_core::Model::new(&p).expect_err("two parameters");
    assert!(matches!(error, Error::DuplicateName { .. }), "{error}");
}

#[test]
fn an_effect_that_needs_its_regressor_is_not_freed_without_it() {
    let mut p = Problem::new(2);
    let (a, b) = (p.frame("a"), p.frame("b"));
    let axis = Axis::Revolute(nalgebra::Vector3::z_axis());
    let joint = p.joint("joint", a, b, axis, vec![0.1, 0.2]);
    p.free_effect(joint, EffectKind::TorqueCompliance, None);
    let error = calib_core::Model::new(&p).expect_err("no torque");
    assert!(error.to_string().contains("joint.compliance"), "{error}");
}

#[test]
fn a_direction_that_is_not_finite_is_refused() {
    let bad = nalgebra::Unit::new_unchecked(nalgebra::Vector3::new(f64::NAN, 0.0, 1.0));
    let good = nalgebra::Vector3::z_axis();
    type Make = fn(calib_core::GroupId, calib_core::PointId, [Direction; 2]) -> MeasurementKind;
    let measurements: [Make; 3] = [
        |noise, _, [fixed, seen]| {
            MeasurementKind::Directions(measurement::Directions {
                direction: fixed,
                noise,
                observations: vec![calib_core::DirectionObservation {
                    sample: 1,
                    direction: seen,
                }],
                sign_free: false,
            })
        },
        |noise, point, [normal, _]| {
            MeasurementKind::Plane(measurement::Plane {
                point,
                normal,
                noise,
                observations: vec![(1, 0.1)],
            })
        },
        |noise, point, [direction, _]| {
            MeasurementKind::Line(measurement::Line {
                point,
                through: nalgebra::Point3::origin(),
                direction,
                noise,
                samples: vec![1],
            })
        },
    ];
    for (k, kind) in measurements.iter().enumerate() {
        for directions in [[bad, good], [good, bad], [good, good]] {
            let mut p = Problem::new(2);
            let (a, b) = (p.frame("a"), p.frame("b"));
            p.unknown("pose", a, b, Isometry3::identity(), Chart::full());
            let point = p.known_point("p", b, nalgebra::Point3::origin());
            let noise = p.noise_group("n", NoiseKind::Orientation, 1e-3, false);
            p.add_measurement(Measurement {
                name: "m".into(),
                from: a,
                to: b,
                path: None,
                kind: kind(noise, point, directions),
            });
            let refused = calib_core::Model::new(&p).is_err();
            let seen = directions[1] == good || k > 0;
            assert_eq!(refused, !(directions[0] == good && seen), "{k}");
        }
    }
}

type Direction = nalgebra::Unit<nalgebra::Vector3<f64>>;
