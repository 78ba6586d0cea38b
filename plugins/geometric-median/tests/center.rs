//! The estimator itself, and the shared library that this package builds.

use std::{collections::BTreeMap, path::PathBuf};

use calib_plugin::{
    Answer, BodyPose, Bound, Control, Cor, CorFit, Entry, Host, MotionData, SearchPath,
    check::{Limits, check},
};
use geometric_median::GeometricMedian;
use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const CENTER: Vector3<f64> = Vector3::new(1.0, -2.0, 0.5);

/// The library beside this test's own file: `target/…/deps`, or the folder above it.
fn library() -> PathBuf {
    let name = format!(
        "{}geometric_median{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    );
    let program = std::env::current_exe().unwrap();
    let mut folders = program.ancestors().skip(1).take(2);
    folders
        .find_map(|folder| Some(folder.join(&name)).filter(|p| p.is_file()))
        .unwrap()
}

fn host() -> Host {
    Host::new(SearchPath::default(), true)
}

fn loaded() -> Bound<dyn Cor> {
    let plugin = host().load(library().to_str().unwrap(), None).unwrap();
    plugin
        .cor("geometric_median")
        .unwrap()
        .with(&BTreeMap::new())
        .unwrap()
}

fn built_in() -> Bound<dyn Cor> {
    Entry::built_in_cor(GeometricMedian)
        .with(&BTreeMap::new())
        .unwrap()
}

fn fit(data: &MotionData) -> Answer<CorFit> {
    built_in().fit(&data.view(), &Control::default()).unwrap()
}

fn found(data: &MotionData) -> CorFit {
    match fit(data) {
        Answer::Found(fit) => fit,
        Answer::NotObservable(reason) => panic!("{reason}"),
    }
}

fn error(fit: &CorFit) -> f64 {
    (Vector3::from(fit.center_m) - CENTER).norm()
}

struct Made {
    rotations: Vec<Rotation3<f64>>,
    random: ChaCha8Rng,
}

impl Made {
    fn new(samples: usize, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let rotations = (0..samples)
            .map(|_| {
                let mut angle = || random.random_range(-0.7..0.7);
                Rotation3::from_euler_angles(angle(), angle(), angle())
            })
            .collect();
        Self { rotations, random }
    }

    fn noise(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| {
            let x: f64 = StandardNormal.sample(&mut self.random);
            sigma * x
        })
    }

    /// Every `every`-th sample is off by up to `size`.
    fn wrong(&mut self, i: usize, every: usize, size: f64) -> Vector3<f64> {
        if every == 0 || !i.is_multiple_of(every) {
            return Vector3::zeros();
        }
        Vector3::from_fn(|_, _| self.random.random_range(-size..size))
    }

    fn points(&mut self, sigma: f64, every: usize, size: f64) -> MotionData {
        let track = |made: &mut Self, marker: Vector3<f64>| -> Vec<Option<[f64; 3]>> {
            (0..made.rotations.len())
                .map(|i| {
                    let x = CENTER + made.rotations[i] * marker + made.noise(sigma);
                    Some((x + made.wrong(i, every, size)).into())
                })
                .collect()
        };
        let first = track(self, Vector3::new(0.3, 0.0, 0.1));
        let second = track(self, Vector3::new(0.0, 0.2, -0.2));
        MotionData::points(&[first, second])
    }

    fn poses(&mut self, sigma: f64, every: usize, size: f64) -> MotionData {
        let poses: Vec<_> = (0..self.rotations.len())
            .map(|i| {
                let t = CENTER - self.rotations[i] * Vector3::new(0.05, 0.3, -0.2);
                let t = t + self.noise(sigma) + self.wrong(i, every, size);
                let r = self.rotations[i].matrix();
                Some(BodyPose {
                    rotation: std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)])),
                    translation_m: t.into(),
                })
            })
            .collect();
        MotionData::poses(&poses)
    }
}

#[test]
fn the_shared_library_passes_the_conformance_check() {
    let limits = Limits {
        huge: 20_000,
        ..Limits::default()
    };
    let table = check(&host(), library().to_str().unwrap(), &limits);
    assert!(table.passed(), "{table}");
    assert!(
        table.rows.iter().all(|row| row.outcome.word() == "ok"),
        "{table}"
    );
}

#[test]
fn plugin_and_built_in_agree_to_the_last_bit() {
    for seed in 0..5 {
        let mut made = Made::new(60, seed);
        for data in [made.points(1e-3, 7, 0.3), made.poses(1e-3, 7, 0.3)] {
            let (a, b) = (
                loaded().fit(&data.view(), &Control::default()).unwrap(),
                built_in().fit(&data.view(), &Control::default()).unwrap(),
            );
            assert_eq!(format!("{a:?}"), format!("{b:?}"));
        }
    }
}

/// By hand: the corners of a cube lie on one sphere; a ninth point far away pulls another sphere through itself.
#[test]
fn one_wrong_corner_of_a_cube_changes_nothing() {
    let side = |i: u32, bit: u32| if i >> bit & 1 == 0 { -0.1 } else { 0.1 };
    let corner = |i| Some([1.0 + side(i, 0), -2.0 + side(i, 1), 0.5 + side(i, 2)]);
    let mut cube: Vec<Option<[f64; 3]>> = (0..8).map(corner).collect();
    cube.push(Some([4.0, 4.0, 4.0]));
    let fit = found(&MotionData::points(&[cube]));
    assert!(error(&fit) < 1e-6, "{fit:?}");
    // Half the cube's diagonal.
    assert!((fit.radii_m[0] - 0.03_f64.sqrt()).abs() < 1e-6);
}

#[test]
fn a_fifth_of_wrong_samples_does_not_move_the_center() {
    for seed in 0..10 {
        let mut made = Made::new(200, seed);
        // 1 mm noise: the clean center is good to 0.3 mm; squares would be 30 mm off.
        let points = found(&made.points(1e-3, 5, 0.5));
        assert!(
            error(&points) < 2e-3,
            "points, seed {seed}: {}",
            error(&points)
        );
        let poses = found(&made.poses(1e-3, 5, 0.5));
        assert!(
            error(&poses) < 1e-3,
            "poses, seed {seed}: {}",
            error(&poses)
        );
    }
}

/// The stated covariance is the one that repetition shows: the normalized squared error has mean 3.
#[test]
fn covariances_are_honest() {
    const RUNS: u64 = 200;
    for (name, poses) in [("points", false), ("poses", true)] {
        let mut sum = 0.0;
        for seed in 0..RUNS {
            let mut made = Made::new(80, 1000 + seed);
            let data = if poses {
                made.poses(1e-3, 0, 0.0)
            } else {
                made.points(1e-3, 0, 0.0)
            };
            let fit = found(&data);
            let c = fit.covariance_m2.unwrap();
            let c = nalgebra::Matrix3::from_fn(|i, j| c[i][j]);
            let e = Vector3::from(fit.center_m) - CENTER;
            sum += e.dot(&(c.try_inverse().unwrap() * e)) / RUNS as f64;
        }
        println!("{name}: mean squared error in units of the covariance {sum:.2}, 3 is honest");
        // ±4 standard errors of χ²₃ (√6/√200 = 0.17), and the approximations of both formulas.
        assert!((2.2..4.2).contains(&sum), "{name}: {sum}");
    }
}

#[test]
fn what_the_data_cannot_answer_is_said() {
    let still = [Some([1.0, 2.0, 3.0]); 20];
    let about_z = |i: usize, z: f64| -> Option<[f64; 3]> {
        let (s, c) = (0.05 * i as f64).sin_cos();
        Some([c, s, z])
    };
    let pose = |i: usize| {
        let (s, c) = (0.05 * i as f64).sin_cos();
        Some(BodyPose {
            rotation: [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
            translation_m: [c, s, 0.0],
        })
    };
    let circle: Vec<_> = (0..40).map(|i| about_z(i, 0.0)).collect();
    let other: Vec<_> = (0..40).map(|i| about_z(i, 0.4)).collect();
    let hinge: Vec<_> = (0..40).map(pose).collect();
    for (name, data) in [
        ("nothing", MotionData::points(&[])),
        ("three points", MotionData::points(&[still[..3].to_vec()])),
        (
            "no motion",
            MotionData::points(&[still.to_vec(), still.to_vec()]),
        ),
        (
            "one circle",
            MotionData::points(std::slice::from_ref(&circle)),
        ),
        (
            "two circles about one axis",
            MotionData::markers(&[circle.clone(), other]),
        ),
        ("a hinge", MotionData::poses(&hinge)),
        (
            "a hinge seen from itself",
            MotionData::two_bodies(&hinge, &hinge),
        ),
        ("two poses", MotionData::poses(&hinge[..2])),
    ] {
        assert!(matches!(fit(&data), Answer::NotObservable(_)), "{name}");
    }
}

#[test]
fn a_noisy_hinge_is_not_taken_for_a_ball() {
    for seed in 0..20 {
        let mut made = Made::new(300, seed);
        made.rotations = (0..300)
            .map(|i| Rotation3::from_euler_angles(0.0, 0.0, 0.005 * f64::from(i)))
            .collect();
        let points = made.points(1e-3, 0, 0.0);
        assert!(
            matches!(fit(&points), Answer::NotObservable(_)),
            "points, seed {seed}"
        );
        // Orientation noise of 0.1°.
        for i in 0..300 {
            let tilt = made.noise(1.7e-3);
            made.rotations[i] *= Rotation3::new(tilt);
        }
        let poses = made.poses(1e-3, 0, 0.0);
        assert!(
            matches!(fit(&poses), Answer::NotObservable(_)),
            "poses, seed {seed}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(7), ..ProptestConfig::with_cases(24) })]

    /// Moving the tracker's frame moves the center with it; the order of samples does not matter for poses.
    #[test]
    fn the_frame_and_the_order_do_not_matter(
        seed in 0..1000_u64, by in prop::array::uniform3(-20.0..20.0_f64), turn in prop::array::uniform3(-3.0..3.0_f64)
    ) {
        let mut made = Made::new(40, seed);
        let (points, poses) = (made.points(1e-3, 9, 0.2), made.poses(1e-3, 9, 0.2));
        let (turn, by) = (Rotation3::new(turn.into()), Vector3::from(by));
        let moved = |x: [f64; 3]| -> [f64; 3] { (turn * Vector3::from(x) + by).into() };
        let view = points.view();
        let tracks: Vec<Vec<_>> = (0..2).map(|k| view.points(k).map(|x| x.map(moved)).collect()).collect();
        let expected = Vector3::from(moved(found(&points).center_m));
        let shifted = Vector3::from(found(&MotionData::points(&tracks)).center_m);
        // The minimum is flat to the square root of rounding, and the kinks of |e| are smoothed over a thousandth.
        prop_assert!((expected - shifted).norm() < 1e-5, "{}", (expected - shifted).norm());

        let reversed: Vec<_> = poses.view().poses(0).collect::<Vec<_>>().into_iter().rev().map(|pose| {
            pose.map(|p| {
                let r = turn * nalgebra::Matrix3::from_fn(|i, j| p.rotation[i][j]);
                BodyPose {
                    rotation: std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)])),
                    translation_m: moved(p.translation_m),
                }
            })
        }).collect();
        let expected = Vector3::from(moved(found(&poses).center_m));
        let shifted = Vector3::from(found(&MotionData::poses(&reversed)).center_m);
        prop_assert!((expected - shifted).norm() < 1e-7, "{}", (expected - shifted).norm());
    }
}
