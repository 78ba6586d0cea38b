//! Metamorphic laws: what must not matter does not, what must scale scales.

use crate::common::{Noise, hand, marker, poses};
use calib_cor::{CorEstimate, Input, InputKind, Options, Pose, Shape, estimators, fit};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use proptest::prelude::*;

type Track = Vec<Option<Point3<f64>>>;

/// COBYLA and CGLS stop by their own tolerances, of the size of the radius.
fn slack(id: &str) -> f64 {
    match id {
        "sfa" => 1e-4,
        _ => 1e-9,
    }
}

#[derive(Debug, Clone)]
struct Scene {
    markers: Vec<Track>,
    poses: Vec<Option<Pose>>,
    second: Vec<Option<Pose>>,
    center: Vector3<f64>,
}

prop_compose! {
    fn a_pose(far: f64)(t in prop::array::uniform3(-1.0..1.0), w in prop::array::uniform3(-3.0..3.0))
        -> Isometry3<f64>
    {
        Isometry3::new(Vector3::from(t) * far, Vector3::from(w))
    }
}

prop_compose! {
    fn a_scene()(seed in 0u64..1_000_000, center in prop::array::uniform3(-2.0..2.0),
                 sigma in 1e-4..2e-3, sigma_r in 1e-4..1e-2) -> Scene {
        let mut noise = Noise::new(seed);
        let center = Vector3::from(center);
        let turns = hand(36);
        let layout = [Vector3::new(0.1, 0.02, 0.0), Vector3::new(0.0, 0.12, 0.03), Vector3::new(-0.04, 0.0, 0.09)];
        let arm = Vector3::new(0.02, -0.15, 0.04);
        // The second body wanders by itself; the joint's center sits at `place` in it.
        let place = Vector3::new(-0.05, 0.03, 0.08);
        let first = poses(&turns, &center, &arm, sigma, sigma_r, &mut noise);
        let second = turns.iter().map(|_| {
            let r = UnitQuaternion::from_scaled_axis(noise.vector(0.4));
            Some(Pose {
                rotation: r.to_rotation_matrix().into_inner(),
                translation: center - r * place + noise.vector(sigma),
            })
        }).collect();
        Scene {
            markers: layout.iter().map(|b| marker(&turns, &center, b, sigma, &mut noise)).collect(),
            poses: first,
            second,
            center,
        }
    }
}

fn run(scene: &Scene, id: &str, kind: InputKind) -> CorEstimate {
    let input = match kind {
        InputKind::Poses => Input::Poses(&scene.poses),
        InputKind::TwoBodies => Input::TwoBodies {
            parent: &scene.poses,
            child: &scene.second,
        },
        _ => Input::Markers(&scene.markers),
    };
    fit(id, &input, &Options::default())
        .expect(id)
        .estimate()
        .expect(id)
        .clone()
}

fn moved(scene: &Scene, new_from_old: &Isometry3<f64>) -> Scene {
    let pose = |p: &Option<Pose>| {
        p.map(|p| Pose {
            rotation: new_from_old.rotation.to_rotation_matrix() * p.rotation,
            translation: (new_from_old * Point3::from(p.translation)).coords,
        })
    };
    Scene {
        markers: scene
            .markers
            .iter()
            .map(|t| t.iter().map(|p| p.map(|p| new_from_old * p)).collect())
            .collect(),
        poses: scene.poses.iter().map(pose).collect(),
        second: scene.second.iter().map(pose).collect(),
        center: (new_from_old * Point3::from(scene.center)).coords,
    }
}

fn scaled(scene: &Scene, by: f64) -> Scene {
    let pose = |p: &Option<Pose>| {
        p.map(|p| Pose {
            rotation: p.rotation,
            translation: p.translation * by,
        })
    };
    Scene {
        markers: scene
            .markers
            .iter()
            .map(|t| t.iter().map(|p| p.map(|p| p * by)).collect())
            .collect(),
        poses: scene.poses.iter().map(pose).collect(),
        second: scene.second.iter().map(pose).collect(),
        center: scene.center * by,
    }
}

/// Same seeded permutation of all rows.
fn shuffled(scene: &Scene, seed: u64) -> Scene {
    let mut order: Vec<usize> = (0..scene.poses.len()).collect();
    let mut noise = Noise::new(seed);
    for k in (1..order.len()).rev() {
        order.swap(k, (noise.uniform() * (k + 1) as f64) as usize);
    }
    Scene {
        markers: scene
            .markers
            .iter()
            .map(|t| order.iter().map(|&k| t[k]).collect())
            .collect(),
        poses: order.iter().map(|&k| scene.poses[k]).collect(),
        second: order.iter().map(|&k| scene.second[k]).collect(),
        center: scene.center,
    }
}

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 16,
        rng_seed: proptest::test_runner::RngSeed::Fixed(20_130_907),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Robust estimators draw subsets by index, so a new order may choose another inlier at the gate's edge.
fn depends_on_order(id: &str) -> bool {
    matches!(id, "robust" | "consensus")
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn moving_the_tracker_moves_the_center(scene in a_scene(), near in a_pose(2.0), far in a_pose(100.0)) {
        for info in estimators() {
            let before = run(&scene, info.id, info.input);
            for (step, allowed) in [(near, slack(info.id)), (far, slack(info.id).max(1e-8))] {
                let after = run(&moved(&scene, &step), info.id, info.input);
                // Two bodies: the center is reported in the second body, which moves along.
                let expected = if info.input == InputKind::TwoBodies { before.center } else { step * before.center };
                let off = (after.center - expected).norm();
                prop_assert!(off < allowed, "`{}`: the center of the moved tracker is {off:e} m from the moved center, at most {allowed:e}", info.id);
                let (a, b) = (before.covariance.trace(), after.covariance.trace());
                prop_assert!((a / b - 1.0).abs() < 1e-4, "`{}`: moving the tracker changes the trace of the covariance from {a:e} to {b:e} m²", info.id);
            }
        }
    }

    #[test]
    fn millimeters_give_the_same_center(scene in a_scene()) {
        for info in estimators() {
            let meters = run(&scene, info.id, info.input);
            let millimeters = run(&scaled(&scene, 1000.0), info.id, info.input);
            let off = (millimeters.center.coords / 1000.0 - meters.center.coords).norm();
            prop_assert!(off < slack(info.id), "`{}`: the center in millimeters is {off:e} m from that in meters, at most {:e}", info.id, slack(info.id));
            let ratio = millimeters.covariance.trace() / meters.covariance.trace() / 1e6;
            prop_assert!((ratio - 1.0).abs() < 1e-4, "`{}`: the covariance in mm² is {ratio} times that in m² instead of once", info.id);
        }
    }

    #[test]
    fn the_order_of_samples_does_not_matter(scene in a_scene(), seed in 0u64..1000) {
        for info in estimators() {
            let a = run(&scene, info.id, info.input);
            let b = run(&shuffled(&scene, seed), info.id, info.input);
            let off = (a.center - b.center).norm();
            let allowed = if depends_on_order(info.id) { a.covariance.trace().sqrt() } else { slack(info.id) };
            prop_assert!(off < allowed, "`{}`: samples in another order move the center by {off:e} m, at most {allowed:e} (`depends_on_order` has the exceptions)", info.id);
        }
    }

    #[test]
    fn the_center_is_near_the_truth_as_the_covariance_says(scene in a_scene()) {
        /// χ²(3) at one in a million: 17 estimators × 16 scenes must not trip it by chance.
        const FAR: f64 = 30.7;
        for info in estimators() {
            // Biased by construction on these scenes: Kåsa-like fits shrink, linear hot spots attenuate.
            if matches!(info.id, "hse" | "hsa" | "score" | "consensus") {
                continue;
            }
            let e = run(&scene, info.id, info.input);
            let error = e.center.coords - scene.center;
            let d = error.dot(&e.covariance.cholesky().expect("positive definite").solve(&error));
            prop_assert!(d < FAR, "`{}`: the squared distance from the truth is {d} by its own covariance, at most {FAR}: the covariance is too small, or the center biased", info.id);
        }
    }

    /// HSE and HSA are one point; Halvorsen with one marker is Taubin; Gamage & Lasenby is Kåsa for equal counts.
    #[test]
    fn identities(scene in a_scene()) {
        let close = |a: &str, b: &str, scene: &Scene, kind| {
            (run(scene, a, kind).center - run(scene, b, kind).center).norm()
        };
        prop_assert!(close("hse", "hsa", &scene, InputKind::Poses) < 1e-11);
        prop_assert!(close("gamage_lasenby", "kasa", &scene, InputKind::Points) < 1e-12);
        let one = Scene { markers: scene.markers[..1].to_vec(), ..scene.clone() };
        prop_assert!(close("halvorsen", "taubin", &one, InputKind::Points) < 1e-12);
        // A fixed second body: SCoRE is the hot spot.
        let still = Scene {
            second: vec![Some(Isometry3::identity().into()); scene.poses.len()],
            ..scene.clone()
        };
        prop_assert!((run(&still, "score", InputKind::TwoBodies).center
            - run(&scene, "hse", InputKind::Poses).center).norm() < 1e-11);
    }

    /// Swapping the bodies swaps the two local centers.
    #[test]
    fn score_is_symmetric(scene in a_scene()) {
        let a = run(&scene, "score", InputKind::TwoBodies);
        let swapped = Scene { poses: scene.second.clone(), second: scene.poses.clone(), ..scene.clone() };
        let b = run(&swapped, "score", InputKind::TwoBodies);
        let (Shape::BodyPoints { in_first: a1, in_second: a2, .. },
             Shape::BodyPoints { in_first: b1, in_second: b2, .. }) = (&a.shape, &b.shape) else {
            panic!("no body points")
        };
        prop_assert!((a1 - b2).norm() < 1e-12 && (a2 - b1).norm() < 1e-12);
    }
}

/// Numbers that sit at the edges of arithmetic.
fn an_edge() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(0.0),
        Just(-0.0),
        Just(1.0),
        Just(-1.0),
        Just(1e-300),
        Just(1e300),
        Just(-1e160),
        Just(1e-160),
        Just(f64::EPSILON),
        Just(1.0 + f64::EPSILON),
        -1.0..1.0
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..config() })]

    /// Whatever the numbers, the answer is a verdict, an error, or finite.
    #[test]
    fn garbage_neither_panics_nor_returns_nan(
        points in prop::collection::vec(prop::collection::vec(prop::option::weighted(0.9, prop::array::uniform3(an_edge())), 0..9), 0..4),
        poses in prop::collection::vec(prop::option::weighted(0.9, (prop::array::uniform3(an_edge()), prop::array::uniform3(an_edge()))), 0..9),
        sigma in prop::option::of(prop_oneof![Just(1e-300), Just(1.0), Just(1e300)]),
    ) {
        let rows = points.iter().map(Vec::len).max().unwrap_or(0);
        let tracks: Vec<Track> = points.iter().map(|t| {
            let mut t: Track = t.iter().map(|p| p.map(Point3::from)).collect();
            t.resize(rows, None);
            t
        }).collect();
        let poses: Vec<Option<Pose>> = poses.iter().map(|p| p.map(|(w, t)| Pose {
            rotation: UnitQuaternion::from_scaled_axis(Vector3::from(w).map(|x| x.clamp(-10.0, 10.0))).to_rotation_matrix().into_inner(),
            translation: Vector3::from(t),
        })).collect();
        let options = Options { sigma_t: sigma, subsets: 20, ..Options::default() };
        for info in estimators() {
            let inputs = [Input::Markers(&tracks), Input::Poses(&poses), Input::TwoBodies { parent: &poses, child: &poses }];
            for input in inputs.iter().filter(|i| i.serves(info.input)) {
                if let Ok(outcome) = fit(info.id, input, &options)
                    && let Some(e) = outcome.estimate()
                {
                    prop_assert!(e.center.iter().all(|x| x.is_finite()), "`{}`: the center is not finite: {e:?}", info.id);
                    prop_assert!(e.covariance.iter().all(|x| x.is_finite()), "`{}`: the covariance is not finite: {e:?}", info.id);
                }
            }
        }
    }
}

/// Sixteen times the samples quarter the error.
#[test]
fn the_error_falls_like_one_over_root_n() {
    let arm = Vector3::new(0.02, -0.15, 0.04);
    let rms = |turns: Vec<UnitQuaternion<f64>>, id: &str, as_points: bool| {
        let mut sum = 0.0;
        const TRIALS: u64 = 200;
        for seed in 0..TRIALS {
            let mut noise = Noise::new(seed);
            let data = if as_points {
                let track = vec![marker(&turns, &Vector3::zeros(), &arm, 1e-3, &mut noise)];
                fit(id, &Input::Points(&track), &Options::default())
            } else {
                let data = poses(&turns, &Vector3::zeros(), &arm, 1e-3, 5e-3, &mut noise);
                fit(id, &Input::Poses(&data), &Options::default())
            };
            sum += data
                .expect(id)
                .estimate()
                .expect(id)
                .center
                .coords
                .norm_squared();
        }
        (sum / TRIALS as f64).sqrt()
    };
    let repeated = |times: usize| {
        hand(36)
            .into_iter()
            .cycle()
            .take(36 * times)
            .collect::<Vec<_>>()
    };
    for (id, as_points) in [("sfe", true), ("ml_sphere", true), ("hotspot_ml", false)] {
        let ratio = rms(repeated(1), id, as_points) / rms(repeated(16), id, as_points);
        // Monte-Carlo error of a ratio of two rms over 200 trials of three components: 4 %; allowed 3 of them.
        assert!((ratio / 4.0 - 1.0).abs() < 0.12, "{id}: {ratio}");
    }
}
