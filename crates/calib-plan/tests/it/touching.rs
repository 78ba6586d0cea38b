//! What planned postures and motions must not touch.

use calib_plan::Note;
use calib_plan::prepare::prepare;
use calib_plan::shape::Capsule;
use nalgebra::{Point3, Vector3};

use crate::plans::{few, planned};
use crate::robots::{SCARA, SEVEN, SIX, Seen, folding, known, robot, six};

#[test]
fn nothing_touches_by_points_sampled_on_the_capsules() {
    let extra = "plan:\n  clearance_mm: 15\n  ground_mm: 60\n  keep_outs:\n    \
                 post: {size_mm: [120, 120, 900], center: {xyz_mm: [420, 250, 450]}}\n";
    let known = six(Seen::Markers(4), extra);
    let options = few(20);
    let prepared = prepare(&known, &options).unwrap_or_else(|e| panic!("{e}"));
    let found = planned(&known, &options);
    assert!(prepared.counts.self_collision > 0 && prepared.counts.ground > 0);
    assert!(prepared.counts.keep_outs["post"] > 0);
    let model = &known.robot.model;
    let scene = &prepared.feasible.scene;
    let says = |n: &Note| matches!(n, Note::NoClearMotion { .. });
    assert_eq!(found.blocked.is_empty(), !found.notes.iter().any(says));
    let files = found.files(&known.robot.model, "six.yaml");
    let files = files.unwrap_or_else(|e| panic!("{e}"));
    let drives = files.iter().any(|f| f.name == "trajectory.json");
    assert_eq!(drives, found.blocked.is_empty());
    let mut looked = 0;
    for (k, pair) in found.postures.windows(2).enumerate() {
        if found.blocked.contains(&(k + 1)) {
            continue;
        }
        // Other places than those that the planner looks at.
        for t in 0..17 {
            let t = f64::from(t) / 16.0;
            let q: Vec<f64> = pair[0]
                .q
                .iter()
                .zip(&pair[1].q)
                .map(|(a, b)| a + (b - a) * t)
                .collect();
            let placed = scene.placed(&model.forward_kinematics(&q));
            looked += 1;
            for (i, (of, at)) in scene.capsules.iter().zip(&placed).enumerate() {
                for p in surface(at) {
                    if of.body != 0 {
                        assert!(p.z > 0.06, "posture {k}: link {i} in the ground");
                        let d = (p - Point3::new(0.42, 0.25, 0.45)).abs();
                        assert!(
                            d.x > 0.06 || d.y > 0.06 || d.z > 0.45,
                            "posture {k}: in the post"
                        );
                    }
                    for (other, place) in scene.capsules.iter().zip(&placed) {
                        let pair = (of.body.min(other.body), of.body.max(other.body));
                        if scene.pairs.contains(&pair) {
                            assert!(!holds(place, &p), "posture {k}: {pair:?}");
                        }
                    }
                }
            }
        }
    }
    assert!(looked > 200, "{looked}");
}

/// A clearance that the links of an arm never have from each other is no reason to refuse every posture.
#[test]
fn links_that_are_always_close_are_kept_from_touching() {
    let known = six(Seen::Markers(4), "plan:\n  clearance_mm: 90\n");
    let options = few(10);
    let prepared = prepare(&known, &options).unwrap_or_else(|e| panic!("{e}"));
    let (scene, model) = (&prepared.feasible.scene, &known.robot.model);
    assert!(!scene.close.is_empty());
    let says = |n: &Note| matches!(n, Note::PairsAlwaysClose { .. });
    assert!(prepared.notes.iter().any(says));
    for candidate in &prepared.candidates {
        let placed = scene.placed(&model.forward_kinematics(&candidate.q));
        for (i, a) in scene.capsules.iter().enumerate() {
            for (j, b) in scene.capsules.iter().enumerate().skip(i + 1) {
                let pair = (a.body.min(b.body), a.body.max(b.body));
                let least = if scene.close.contains(&pair) {
                    0.0
                } else {
                    0.09
                };
                let compared = scene.pairs.contains(&pair);
                assert!(!compared || placed[i].distance(&placed[j]) >= least);
            }
        }
    }
}

/// Links with one joint between them are kept apart where their shapes end before it; where these overlap in most postures, it is said.
#[test]
fn links_next_to_each_other_are_not_folded_onto_each_other() {
    let known = folding();
    let options = few(16);
    let prepared = prepare(&known, &options).unwrap_or_else(|e| panic!("{e}"));
    let (scene, model) = (&prepared.feasible.scene, &known.robot.model);
    let made = planned(&known, &options);
    let least = |q: &[f64]| {
        let placed = scene.placed(&model.forward_kinematics(q));
        placed[0].distance(&placed[1])
    };
    assert_eq!(scene.capsules.len(), 2);
    // Postures by chance fold it.
    let joint = model.joint_id("j2").expect("a joint").index();
    let mut folded = model.zero_positions();
    folded[joint] = 3.05;
    assert!(least(&folded) < 0.0);
    for posture in &made.postures {
        assert!(least(&posture.q) > 0.0, "{:?}", posture.q);
    }
    let known = six(Seen::Markers(4), "");
    let made = planned(&known, &options);
    let said = made.notes.iter().any(|note| match note {
        Note::PairsNotCompared { pairs } => pairs.iter().any(|p| p[0] == "l1" && p[1] == "l2"),
        _ => false,
    });
    assert!(said, "{:?}", made.notes);
}

/// No point of the robot moves further than the sum over the joints of their move times the way to the farthest point that they carry.
#[test]
fn no_point_moves_further_than_the_levers_say() {
    for joints in [SIX, SCARA, SEVEN] {
        let known = known(robot(joints, Seen::Markers(4), true, ""));
        let options = few(10);
        let prepared = prepare(&known, &options).unwrap_or_else(|e| panic!("{e}"));
        let (scene, model) = (&prepared.feasible.scene, &known.robot.model);
        let levers = scene.levers(model, &prepared.joints.travel(model));
        let mut tightest: f64 = 0.0;
        for pair in prepared.candidates.windows(2) {
            // A thousandth of the motion, where the way of a point is nearly straight.
            let from = &pair[0].q;
            let to: Vec<f64> = from
                .iter()
                .zip(&pair[1].q)
                .map(|(a, b)| a + (b - a) * 1e-3)
                .collect();
            let bound: f64 = from
                .iter()
                .zip(&to)
                .zip(&levers)
                .map(|((a, b), l)| (b - a).abs() * l)
                .sum();
            let [first, second] = [from, &to].map(|q| scene.placed(&model.forward_kinematics(q)));
            for (a, b) in first.iter().zip(&second) {
                let moved = (a.a - b.a).norm().max((a.b - b.b).norm());
                assert!(moved <= bound * (1.0 + 1e-9), "{moved} against {bound}");
                tightest = tightest.max(moved / bound);
            }
        }
        assert!(tightest > 0.2, "the bound is of no use: {tightest}");
    }
}

/// All joints move at once past a plate of 2 mm.
#[test]
fn no_motion_that_is_called_clear_passes_through_a_thin_plate() {
    let extra = "plan:\n  clearance_mm: 4\n  keep_outs:\n    \
                 plate: {size_mm: [2, 600, 600], center: {xyz_mm: [380, 0, 500]}}\n";
    let known = six(Seen::Markers(4), extra);
    let options = few(20);
    let prepared = prepare(&known, &options).unwrap_or_else(|e| panic!("{e}"));
    let (feasible, model) = (&prepared.feasible, &known.robot.model);
    let (mut clear, mut blocked) = (0, 0);
    for pair in prepared.candidates.windows(2) {
        let (from, to) = (&pair[0].q, &pair[1].q);
        if !feasible.clear(from, to) {
            blocked += 1;
            continue;
        }
        clear += 1;
        for k in 0..=1500 {
            let t = f64::from(k) / 1500.0;
            let q = from.iter().zip(to).map(|(a, b)| a + (b - a) * t);
            let q: Vec<f64> = q.collect();
            let placed = feasible.scene.placed(&model.forward_kinematics(&q));
            // The clearance of 4 mm, and half a step below it.
            let nearest = feasible.scene.nearest(&placed);
            assert!(nearest >= 0.0035 - 1e-9, "{nearest} at {t}");
        }
    }
    assert!(
        clear >= 10 && blocked >= 10,
        "{clear} clear, {blocked} blocked"
    );
}

/// Points on a capsule.
fn surface(c: &Capsule) -> Vec<Point3<f64>> {
    let axis = (c.b - c.a).try_normalize(1e-9).unwrap_or_else(Vector3::z);
    let side = axis.cross(&Vector3::new(0.3, -0.7, 0.64)).normalize();
    let other = axis.cross(&side);
    let mut points = vec![c.a - axis * c.r, c.b + axis * c.r];
    for i in 0..7 {
        for k in 0..8 {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 8.0).sin_cos();
            let on = c.a + (c.b - c.a) * (f64::from(i) / 6.0);
            points.push(on + (side * cos + other * sin) * c.r);
        }
    }
    points
}

/// Whether a point is inside a capsule, by the nearest of many points of its axis.
fn holds(c: &Capsule, p: &Point3<f64>) -> bool {
    (0..=50).any(|i| (c.a + (c.b - c.a) * (f64::from(i) / 50.0) - p).norm() < c.r)
}
