//! Weights of rows: what a row of weight w must do, in every estimator.

use crate::common::{Noise, hand, sweep};
use calib_cor::{CorEstimate, EstimatorInfo, Input, InputKind, Options, Pose, estimators, fit};
use nalgebra::{Point3, UnitQuaternion, Vector3};

/// What one recording offers to each kind of estimator.
struct Recording {
    markers: Vec<Vec<Option<Point3<f64>>>>,
    poses: Vec<Option<Pose>>,
    second: Vec<Option<Pose>>,
}

const CENTER: Vector3<f64> = Vector3::new(0.3, -0.2, 0.9);
const SIGMA_T: f64 = 1e-3;
const SIGMA_R: f64 = 5e-3;

impl Recording {
    /// Row k has the noise divided by the root of its weight.
    fn of(turns: &[UnitQuaternion<f64>], weights: &[f64], noise: &mut Noise) -> Self {
        let layout = [
            Vector3::new(0.1, 0.02, 0.0),
            Vector3::new(0.0, 0.12, 0.03),
            Vector3::new(-0.04, 0.0, 0.09),
        ];
        let arm = Vector3::new(0.02, -0.15, 0.04);
        let place = Vector3::new(-0.05, 0.03, 0.08);
        let mut out = Self {
            markers: vec![Vec::new(); layout.len()],
            poses: Vec::new(),
            second: Vec::new(),
        };
        for (turn, w) in turns.iter().zip(weights) {
            let (t, r) = (SIGMA_T / w.sqrt(), SIGMA_R / w.sqrt());
            for (track, b) in out.markers.iter_mut().zip(&layout) {
                track.push(Some(Point3::from(CENTER + turn * b + noise.vector(t))));
            }
            let mut pose = |turn: UnitQuaternion<f64>, point: &Vector3<f64>| {
                let seen = turn * UnitQuaternion::from_scaled_axis(noise.vector(r));
                Some(Pose {
                    rotation: seen.to_rotation_matrix().into_inner(),
                    translation: CENTER - turn * point + noise.vector(t),
                })
            };
            out.poses.push(pose(*turn, &arm));
            // The other body wanders on its own way.
            let other = UnitQuaternion::from_scaled_axis(turn.scaled_axis().yzx() * 0.4);
            out.second.push(pose(other, &place));
        }
        out
    }

    /// Row k, `counts[k]` times.
    fn repeated(&self, counts: &[usize]) -> Self {
        fn each<T: Clone>(track: &[T], counts: &[usize]) -> Vec<T> {
            let rows = track.iter().zip(counts);
            rows.flat_map(|(x, n)| vec![x.clone(); *n]).collect()
        }
        Self {
            markers: self.markers.iter().map(|m| each(m, counts)).collect(),
            poses: each(&self.poses, counts),
            second: each(&self.second, counts),
        }
    }

    fn fit(&self, info: &EstimatorInfo, options: &Options) -> calib_cor::Outcome {
        let input = match info.input {
            InputKind::Poses => Input::Poses(&self.poses),
            InputKind::TwoBodies => Input::TwoBodies {
                parent: &self.poses,
                child: &self.second,
            },
            _ => Input::Markers(&self.markers),
        };
        info.run(&input, &options.only(info.options))
            .expect(info.id)
    }

    fn estimate(&self, info: &EstimatorInfo, options: &Options) -> CorEstimate {
        let outcome = self.fit(info, options);
        outcome.estimate().expect(info.id).clone()
    }
}

/// With the noise known, so that nothing depends on the number of rows.
fn known() -> Options {
    Options {
        sigma_t: Some(SIGMA_T),
        sigma_r: Some(SIGMA_R),
        ..Options::default()
    }
}

fn slack(id: &str) -> f64 {
    if id == "sfa" { 1e-4 } else { 1e-9 }
}

/// Estimators of least squares and likelihood: a row of weight 3 is the same row three times.
#[test]
fn a_weight_is_a_number_of_rows() {
    let counts: Vec<usize> = (0..36).map(|k| 1 + (k * k) % 4).collect();
    let weights: Vec<f64> = counts.iter().map(|n| *n as f64).collect();
    let recording = Recording::of(&hand(36), &[1.0; 36], &mut Noise::new(3));
    let often = recording.repeated(&counts);
    let mut compared = 0;
    for info in estimators() {
        // What takes a bias off counts rows as they were measured: three equal rows have one noise, not three. Subsets are drawn of rows.
        if matches!(info.id, "hyper_n" | "halvorsen" | "robust" | "consensus") {
            continue;
        }
        let weighted = Options {
            weights: weights.clone(),
            ..known()
        };
        let (a, b) = (
            recording.estimate(info, &weighted),
            often.estimate(info, &known()),
        );
        let off = (a.center - b.center).norm();
        assert!(off < slack(info.id), "{}: {off:e}", info.id);
        let spread = (a.covariance - b.covariance).norm() / b.covariance.norm();
        // Where the residuals give the noise, it counts rows; the tests of observability count them too, and their spread enters.
        assert!(
            a.noise.estimated || spread < 0.03,
            "{}: covariance {spread:e}",
            info.id
        );
        compared += 1;
    }
    assert_eq!(compared, estimators().len() - 4);
}

/// Weights have a scale only where the noise is stated.
#[test]
fn equal_weights_change_nothing() {
    let recording = Recording::of(&hand(36), &[1.0; 36], &mut Noise::new(4));
    for info in estimators() {
        let equal = Options {
            weights: vec![7.0; 36],
            ..Options::default()
        };
        let (a, b) = (
            recording.estimate(info, &equal),
            recording.estimate(info, &Options::default()),
        );
        let off = (a.center - b.center).norm();
        assert!(off < slack(info.id), "{}: {off:e}", info.id);
        let spread = (a.covariance - b.covariance).norm() / b.covariance.norm();
        assert!(spread < 1e3 * slack(info.id), "{}: {spread:e}", info.id);
        let noise = a.noise.sigma_t / b.noise.sigma_t / 7_f64.sqrt();
        assert!((noise - 1.0).abs() < 1e-3, "{}: σ {noise}", info.id);
    }
}

/// Half of the rows are five times noisier: with weights the error is that of the good rows and a little better, and the covariance is true.
#[test]
fn weights_reach_what_the_good_rows_allow() {
    if !skipped_tests::thorough() {
        return;
    }
    const TRIALS: u64 = 200;
    let weights: Vec<f64> = (0..36)
        .map(|k| if k % 2 == 0 { 1.0 } else { 0.04 })
        .collect();
    for info in estimators() {
        // The paper's COBYLA takes milliseconds; it is SFE.
        if info.id == "sfa" {
            continue;
        }
        let (mut with, mut without, mut consistency) = (0.0, 0.0, 0.0);
        for seed in 0..TRIALS {
            let recording = Recording::of(&hand(36), &weights, &mut Noise::new(100 + seed));
            let options = Options {
                weights: weights.clone(),
                ..Options::default()
            };
            let weighted = recording.estimate(info, &options);
            // SCoRE's center is a point of the second body.
            let truth = match info.input {
                InputKind::TwoBodies => Vector3::new(-0.05, 0.03, 0.08),
                _ => CENTER,
            };
            let e = weighted.center.coords - truth;
            let inverse = weighted.covariance.try_inverse().expect("definite");
            consistency += e.dot(&(inverse * e)) / 3.0 / TRIALS as f64;
            with += e.norm_squared();
            let plain = recording.estimate(info, &Options::default());
            without += (plain.center.coords - truth).norm_squared();
        }
        println!(
            "{:<14} rms ratio {:.3}, squared error over covariance {consistency:.3}",
            info.id,
            (with / without).sqrt()
        );
        // Σw = 18.72 of variance σ², against 36 rows of 13 σ²: the mean square falls to 0.15.
        assert!(with < 0.2 * without, "{}", info.id);
        // 200 trials of three components: ±0.06; estimated noise widens it.
        assert!(
            (0.75..1.3).contains(&consistency),
            "{}: {consistency}",
            info.id
        );
    }
}

#[test]
fn a_row_of_weight_zero_is_lost() {
    let recording = Recording::of(&hand(36), &[1.0; 36], &mut Noise::new(5));
    let mut lost = Recording::of(&hand(36), &[1.0; 36], &mut Noise::new(5));
    let mut weights = vec![1.0; 36];
    for row in [0, 7, 35] {
        weights[row] = 0.0;
        for track in &mut lost.markers {
            track[row] = None;
        }
        lost.poses[row] = None;
        lost.second[row] = None;
    }
    let options = Options {
        weights,
        ..Options::default()
    };
    for info in estimators() {
        let (a, b) = (
            recording.estimate(info, &options),
            lost.estimate(info, &Options::default()),
        );
        assert_eq!(a.used, b.used, "{}", info.id);
        let off = (a.center - b.center).norm();
        assert!(off < slack(info.id), "{}: {off:e}", info.id);
    }
}

/// Weights must not make a sweep about one axis look like a center.
#[test]
fn one_axis_stays_one_axis() {
    let weights: Vec<f64> = (0..30).map(|k| [1.0, 0.1, 4.0][k % 3]).collect();
    let turns = sweep(Vector3::new(0.2, 0.5, 1.0), 120.0, 30);
    for seed in 0..100 {
        let recording = Recording::of(&turns, &weights, &mut Noise::new(900 + seed));
        let options = Options {
            weights: weights.clone(),
            ..Options::default()
        };
        for info in estimators() {
            // COBYLA is slow, SCoRE's second body turns too.
            if matches!(info.id, "sfa" | "score" | "robust" | "consensus") {
                continue;
            }
            let outcome = recording.fit(info, &options);
            assert!(!outcome.is_observable(), "{} seed {seed}", info.id);
        }
    }
}

#[test]
fn weights_that_are_none_are_errors() {
    let recording = Recording::of(&hand(9), &[1.0; 9], &mut Noise::new(6));
    for (weights, says) in [
        (vec![1.0; 8], "weights and rows differ in number: 8 and 9"),
        (
            vec![1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
            "row 2: the weight -1 is not a finite number from 0 up",
        ),
        (
            vec![f64::NAN; 9],
            "row 0: the weight NaN is not a finite number from 0 up",
        ),
    ] {
        let options = Options {
            weights,
            ..Options::default()
        };
        for (id, input) in [
            ("sfe", Input::Markers(&recording.markers)),
            ("hse", Input::Poses(&recording.poses)),
            ("ball_bundle", Input::Markers(&recording.markers)),
            (
                "score",
                Input::TwoBodies {
                    parent: &recording.poses,
                    child: &recording.second,
                },
            ),
        ] {
            let error = fit(id, &input, &options).expect_err(id).to_string();
            assert_eq!(error, says, "{id}");
        }
    }
}
