//! Numbers from an independent implementation (numpy, SciPy, 50-digit arithmetic), in millimeters and rad.
//!
//! Read from `tests/golden` of the workspace, or from the folder that `CALIB_GOLDEN` names; never written here.

use calib_cor::{Input, InputKind, Known, Options, Outcome, Pose, Shape, estimator, fit};
use nalgebra::{Matrix3, Matrix6, Point3, Vector3};
use serde_json::Value;

/// The covariance of our fits includes the correction 1/(1 − 1/κ) of the weakest direction, which the
/// reference states separately; where κ is above 100 both agree within a per cent.
const COVARIANCE: f64 = 0.015;
/// COBYLA's own tolerance on the flattest case (a second axis of ±2°), relative to the center's σ of 7 mm.
const COBYLA_MM: f64 = 0.01;

fn cases(kind: &str) -> Vec<Value> {
    let file = skipped_tests::golden("estimators.json");
    let text = std::fs::read_to_string(file).expect("the golden file is readable");
    let all: Value = serde_json::from_str(&text).expect("golden file is JSON");
    let found: Vec<Value> = all["cases"]
        .as_array()
        .expect("cases")
        .iter()
        .filter(|c| c["kind"] == kind)
        .cloned()
        .collect();
    assert!(!found.is_empty(), "no case of kind {kind}");
    found
}

fn vector(v: &Value) -> Vector3<f64> {
    Vector3::from_fn(|i, _| v[i].as_f64().expect("a number"))
}

fn matrix(v: &Value) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| v[i][j].as_f64().expect("a number"))
}

fn list(v: &Value) -> &[Value] {
    v.as_array().expect("a list")
}

fn tracks(v: &Value) -> Vec<Vec<Option<Point3<f64>>>> {
    let sample = |p: &Value| (!p.is_null()).then(|| Point3::from(vector(p)));
    list(v)
        .iter()
        .map(|marker| list(marker).iter().map(sample).collect())
        .collect()
}

/// frame × marker → marker × frame
fn transposed(frames: &[Vec<Option<Point3<f64>>>]) -> Vec<Vec<Option<Point3<f64>>>> {
    (0..frames[0].len())
        .map(|p| frames.iter().map(|row| row[p]).collect())
        .collect()
}

fn poses(r: &Value, t: &Value) -> Vec<Option<Pose>> {
    list(r)
        .iter()
        .zip(list(t))
        .map(|(r, t)| {
            Some(Pose {
                rotation: matrix(r),
                translation: vector(t),
            })
        })
        .collect()
}

fn id(case: &Value) -> &str {
    case["id"].as_str().expect("id")
}

/// The final verdict of a case, and whether its numbers are to be compared.
fn expected(case: &Value) -> (&str, bool) {
    let verdict = case["expect"]["final_verdict"].as_str().unwrap_or("ok");
    (verdict, case["compare_values"].as_bool().unwrap_or(true))
}

#[test]
fn spheres() {
    let names = [
        ("kasa", "kasa"),
        ("sfe", "pratt"),
        ("sfa", "pratt"),
        ("taubin", "taubin"),
        ("hyper", "hyper"),
        ("hyper_n", "hyper_n"),
        ("gamage_lasenby", "gamage_lasenby"),
        ("halvorsen", "halvorsen"),
        ("ml_sphere", "ml"),
    ];
    for case in cases("sphere") {
        let data = tracks(&case["input"]["markers"]);
        let (verdict, compare) = expected(&case);
        let tolerance = case["tol"].as_f64().expect("tol");
        // As many samples as unknowns: answered only where the noise is stated.
        let samples = data.iter().flatten().flatten().count();
        let options = if samples == data.len() + 3 {
            Options::default().with_sigma_t(1e-9)
        } else {
            Options::default()
        };
        for (ours, theirs) in names {
            let what = format!("{} {ours}", id(&case));
            let outcome = fit(ours, &Input::Points(&data), &options).expect(&what);
            assert_eq!(
                outcome.verdict().as_str(),
                verdict,
                "{what}: {:?}",
                outcome.reason()
            );
            if !compare || verdict != "ok" {
                assert!(outcome.estimate().is_none(), "{what} gives numbers");
                continue;
            }
            let estimate = outcome.estimate().expect(&what);
            let want = &case["expect"][theirs];
            if want.is_null() {
                continue;
            }
            let off = (estimate.center.coords - vector(&want["center"])).norm();
            if ours == "sfa" {
                assert!(off < COBYLA_MM, "{what}: center off by {off:e}");
                continue;
            }
            assert!(off < tolerance, "{what}: center off by {off:e}");
            let Shape::Radii { radii, bias } = &estimate.shape else {
                panic!("{what}: no radii")
            };
            for (p, (r, b)) in radii.iter().zip(bias).enumerate() {
                let off = (r + b - want["radius"][p].as_f64().expect("radius")).abs();
                assert!(off < tolerance, "{what}: radius {p} off by {off:e}");
            }
            if ours == "ml_sphere" && want["sigma"].is_number() {
                let off = (estimate.noise.sigma_t - want["sigma"].as_f64().expect("sigma")).abs();
                assert!(off < tolerance, "{what}: sigma off by {off:e}");
            }
            let kappa = case["expect"]["observability"]["kappa"]
                .as_f64()
                .unwrap_or(0.0);
            if ours == "ml_sphere" && kappa > 100.0 {
                let cov = matrix(&want["cov"]);
                let off = (estimate.covariance - cov).amax() / cov.amax();
                assert!(off < COVARIANCE, "{what}: covariance off by {off:e}");
            }
            if let (Some(want), "ml_sphere") =
                (case["expect"]["observability"]["sd_corr"].as_f64(), ours)
            {
                let weakest = estimate.covariance.symmetric_eigenvalues().max().sqrt();
                assert!(
                    (weakest / want - 1.0).abs() < 1e-4,
                    "{what}: weakest σ {weakest}, {want}"
                );
            }
        }
        if let Some(table) = case["input"]["covs"].as_array() {
            let covariances = table
                .iter()
                .map(|marker| list(marker).iter().map(matrix).collect())
                .collect();
            let options = Options {
                covariances,
                ..Options::default()
            };
            let outcome = fit("ml_sphere", &Input::Points(&data), &options).expect("covariances");
            let estimate = outcome.estimate().expect("covariances");
            let off = (estimate.center.coords - vector(&case["expect"]["ml_cov"]["center"])).norm();
            assert!(
                off < tolerance,
                "{}: weighted center off by {off:e}",
                id(&case)
            );
        }
    }
}

#[test]
fn hot_spots() {
    for case in cases("pose") {
        let data = poses(&case["input"]["R"], &case["input"]["t"]);
        let input = Input::Poses(&data);
        let known = Options {
            sigma_t: case["input"]["s_t"].as_f64(),
            sigma_r: case["input"]["s_r"].as_f64(),
            ..Options::default()
        };
        let unknown = Options::default();
        let tolerance = case["tol"].as_f64().expect("tol");
        if case["expect"]["verdict"] == "not_rotation" {
            let error = fit("hse", &input, &unknown).expect_err("a scaled matrix");
            assert_eq!(
                error.verdict().map(calib_estimator::Verdict::as_str),
                Some("not_rotation")
            );
            continue;
        }
        let (verdict, compare) = expected(&case);
        for (ours, theirs, options) in [
            ("hse", "hse", &unknown),
            ("hse", "hse", &known),
            ("hsa", "hse", &unknown),
            ("hotspot_ml", "hotspot_ml_known", &known),
            ("hotspot_ml", "hotspot_ml_adaptive", &unknown),
        ] {
            let what = format!("{} {ours} as {theirs}", id(&case));
            let info = estimator(ours).expect(ours);
            let own = options.only(info.options);
            let outcome = info.run(&input, &own).expect(&what);
            assert_eq!(
                outcome.verdict().as_str(),
                verdict,
                "{what}: {:?}",
                outcome.reason()
            );
            if let Outcome::NotObservable(why) = &outcome {
                if verdict == "single_axis" {
                    let Known::AxisLine(line) = why.known else {
                        panic!("{what}: no line")
                    };
                    let axis = vector(&case["expect"]["rank"]["axis_world"]).normalize();
                    let off = line.direction.cross(&axis).norm();
                    assert!(off < tolerance, "{what}: axis off by {off:e} rad");
                }
                continue;
            }
            let want = &case["expect"][theirs];
            if !compare || want.is_null() {
                continue;
            }
            let estimate = outcome.estimate().expect(&what);
            let Shape::BodyPoint {
                body_point,
                covariance,
            } = &estimate.shape
            else {
                panic!("{what}: no body point")
            };
            let off = (estimate.center.coords - vector(&want["center"])).norm();
            assert!(off < tolerance, "{what}: center off by {off:e}");
            let off = (body_point.coords - vector(&want["offset"])).norm();
            assert!(off < tolerance, "{what}: body point off by {off:e}");
            if let Some(rms) = want["rms"].as_f64() {
                assert!((estimate.rms - rms).abs() < tolerance, "{what}: rms");
            }
            if want["cov"].is_array() {
                let cov = Matrix6::from_fn(|i, j| want["cov"][i][j].as_f64().expect("cov"));
                let off = (covariance - cov).amax() / cov.amax();
                assert!(off < COVARIANCE, "{what}: covariance off by {off:e}");
            }
            if theirs == "hotspot_ml_adaptive" && id(&case) != "pose_exact16" {
                let sigma_r = estimate.noise.sigma_r.expect("sigma_r");
                let off_t = (estimate.noise.sigma_t - want["s_t"].as_f64().expect("s_t")).abs();
                let off_r = (sigma_r - want["s_r"].as_f64().expect("s_r")).abs();
                assert!(
                    off_t < tolerance && off_r < tolerance,
                    "{what}: {off_t:e} {off_r:e}"
                );
            }
        }
    }
}

#[test]
fn two_bodies() {
    for case in cases("two_body") {
        let first = poses(&case["input"]["R"], &case["input"]["t"]);
        let second = poses(&case["input"]["S"], &case["input"]["d"]);
        let input = Input::TwoBodies {
            parent: &first,
            child: &second,
        };
        let outcome = fit("score", &input, &Options::default()).expect("score");
        assert_eq!(outcome.verdict().as_str(), "ok", "{}", id(&case));
        let estimate = outcome.estimate().expect("score");
        let Shape::BodyPoints {
            in_first,
            in_second,
            ..
        } = &estimate.shape
        else {
            panic!("no body points")
        };
        let want = &case["expect"]["score"];
        let tolerance = case["tol"].as_f64().expect("tol");
        assert!(
            (in_first.coords - vector(&want["c1"])).norm() < tolerance,
            "{}",
            id(&case)
        );
        assert!(
            (in_second.coords - vector(&want["c2"])).norm() < tolerance,
            "{}",
            id(&case)
        );
    }
}

#[test]
fn ball_bundles() {
    for case in cases("ball") {
        let data = transposed(&tracks(&case["input"]["frames"]));
        let input = Input::Markers(&data);
        let tolerance = case["tol"].as_f64().expect("tol");
        for (ours, theirs) in [("ball_bundle", "ball_bundle"), ("ml_sphere", "sphere_ml")] {
            let want = &case["expect"][theirs];
            if want.is_null() {
                continue;
            }
            let outcome = fit(ours, &input, &Options::default()).expect(ours);
            assert_eq!(outcome.verdict().as_str(), "ok", "{} {ours}", id(&case));
            let estimate = outcome.estimate().expect(ours);
            let off = (estimate.center.coords - vector(&want["center"])).norm();
            assert!(
                off < tolerance,
                "{} {ours}: center off by {off:e}",
                id(&case)
            );
            if let Some(sigma) = want["sigma"].as_f64() {
                let off = (estimate.noise.sigma_t - sigma).abs();
                assert!(
                    off < tolerance,
                    "{} {ours}: sigma off by {off:e}",
                    id(&case)
                );
            }
            if want["cov"].is_array() {
                let cov = matrix(&want["cov"]);
                let off = (estimate.covariance - cov).amax() / cov.amax();
                assert!(
                    off < COVARIANCE,
                    "{} {ours}: covariance off by {off:e}",
                    id(&case)
                );
            }
        }
    }
}

#[test]
fn every_estimator_says_what_it_needs() {
    let empty: Vec<Option<Pose>> = Vec::new();
    for info in calib_cor::estimators() {
        let serves = Input::Poses(&empty).serves(info.input);
        let answer = (info.fit)(&Input::Poses(&empty), &Options::default());
        match info.input {
            InputKind::Poses | InputKind::Points | InputKind::PointsOrPoses => {
                let outcome = answer.expect(info.id);
                assert_eq!(outcome.verdict().as_str(), "too_few", "{}", info.id);
            }
            _ => {
                assert!(!serves && answer.is_err(), "{}", info.id)
            }
        }
    }
}
