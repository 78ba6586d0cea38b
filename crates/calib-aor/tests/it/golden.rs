//! Numbers from an independent implementation (numpy, SciPy, 50-digit arithmetic), in millimeters and rad.
//!
//! Read from `tests/golden` of the workspace, or from the folder that `CALIB_GOLDEN` names; never written here.

use calib_aor::{
    AorEstimate, Center, FrameAxis, FrameOutcome, FrameSample, Input, Options, Outcome, PlaneFit,
    Pose, fit, frame_from_axes, frame_ml, frame_planes,
};
use calib_estimator::Verdict;
use calib_geometry::{mean, so3};
use nalgebra::{Matrix3, Point3, Rotation3, Unit, Vector3};
use serde_json::Value;

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

fn unit(v: &Value) -> Unit<Vector3<f64>> {
    Unit::new_normalize(vector(v))
}

fn list(v: &Value) -> &[Value] {
    v.as_array().expect("a list")
}

fn numbers(v: &Value) -> Vec<f64> {
    list(v)
        .iter()
        .map(|x| x.as_f64().expect("a number"))
        .collect()
}

/// frame × marker → marker × frame
fn tracks(v: &Value) -> Vec<Vec<Option<Point3<f64>>>> {
    let sample = |p: &Value| (!p.is_null()).then(|| Point3::from(vector(p)));
    let frames: Vec<Vec<_>> = list(v)
        .iter()
        .map(|f| list(f).iter().map(sample).collect())
        .collect();
    (0..frames[0].len())
        .map(|p| frames.iter().map(|row| row[p]).collect())
        .collect()
}

fn poses(case: &Value) -> Vec<Option<Pose>> {
    list(&case["input"]["R"])
        .iter()
        .zip(list(&case["input"]["t"]))
        .map(|(r, t)| {
            Some(Pose {
                rotation: matrix(r),
                translation: vector(t),
            })
        })
        .collect()
}

/// Compares what the case states of an axis.
fn compare(what: &str, got: &AorEstimate, want: &Value, tolerance: f64) {
    let axis = if want["n"].is_array() {
        &want["n"]
    } else {
        &want["axis"]
    };
    let off = got.line.direction.cross(&vector(axis)).norm();
    assert!(off < tolerance, "{what}: direction off by {off:e} rad");
    for key in ["point", "point_on_line"] {
        if want[key].is_array() {
            let off = got
                .line
                .distance_to_point(&Point3::from(vector(&want[key])));
            assert!(off < tolerance, "{what}: line off by {off:e}");
        }
    }
    if want["circle_center"].is_array() {
        let off = (got.circles[0].center.coords - vector(&want["circle_center"])).norm();
        assert!(off < tolerance, "{what}: circle center off by {off:e}");
    }
    if let Some(radius) = want["radius"].as_f64() {
        assert!(
            (got.circles[0].radius - radius).abs() < tolerance,
            "{what}: radius"
        );
    }
    if let Some(tau) = want["tau_abs"].as_f64() {
        assert!(
            (got.tau.abs() - tau).abs() < tolerance,
            "{what}: tau {}",
            got.tau
        );
    }
    if let Some(sigma) = want["sigma"].as_f64() {
        assert!(
            (got.sigma - sigma).abs() < tolerance,
            "{what}: sigma {} {sigma}",
            got.sigma
        );
    }
    if want["heights"].is_array() {
        let (radii, heights) = (numbers(&want["radii"]), numbers(&want["heights"]));
        let n = vector(&want["n"]);
        // The origin of heights along the axis is a convention: compare differences.
        let height = |p: usize| (got.circles[p].center - got.circles[0].center).dot(&n);
        for (p, circle) in got.circles.iter().enumerate() {
            let off = (circle.radius - radii[p])
                .abs()
                .max((height(p) - heights[p] + heights[0]).abs());
            assert!(
                off < tolerance,
                "{what}: radius or height {p} off by {off:e}"
            );
        }
    }
    for (p, center) in want["centers"].as_array().into_iter().flatten().enumerate() {
        let off = (got.circles[p].center.coords - vector(center)).norm();
        assert!(off < tolerance, "{what}: center {p} off by {off:e}");
    }
}

#[test]
fn circles() {
    for case in cases("circle") {
        let marker = list(&case["input"]["points"])
            .iter()
            .map(|p| Some(Point3::from(vector(p))));
        let data = vec![marker.collect::<Vec<_>>()];
        let input = Input::Points(&data);
        let free = Options::default();
        let held = Options {
            center: case["input"]["m"]
                .is_array()
                .then(|| Point3::from(vector(&case["input"]["m"]))),
            ..Options::default()
        };
        let pairs = Options {
            separation: Some(2),
            ..Options::default()
        };
        let verdict = case["expect"]["final_verdict"].as_str().expect("verdict");
        let tolerance = case["tol"].as_f64().expect("tol");
        for (ours, theirs, options) in [
            ("plane", "plane", &free),
            ("circle_ml", "circle_ml", &free),
            ("line_ml", "circle_ml", &free),
            ("dir_ml", "circle_ml", &free),
            ("planar_radial", "circle_ml", &free),
            ("planar_radial_gn", "circle_ml", &free),
            ("planar_radial", "planar_radial_fixed_m", &held),
            ("planar_radial_gn", "planar_radial_fixed_m", &held),
            ("halvorsen_line", "halvorsen_all", &free),
            ("halvorsen_line", "halvorsen_sep2", &pairs),
        ] {
            let what = format!("{} {ours} as {theirs}", case["id"]);
            let outcome = fit(ours, &input, options).expect(&what);
            assert_eq!(
                outcome.verdict().as_str(),
                verdict,
                "{what}: {:?}",
                outcome.reason()
            );
            let want = &case["expect"][theirs];
            if verdict == "ok" && want.is_object() {
                let mut want = want.clone();
                if ours.starts_with("planar_radial") || ours == "halvorsen_line" {
                    // Stated for another residual or not at all.
                    want["sigma"] = Value::Null;
                }
                compare(&what, outcome.estimate().expect(&what), &want, tolerance);
            }
        }
    }
}

/// The two solvers of the paper's cost find one minimum.
#[test]
fn simplex_and_gauss_newton_agree() {
    for case in cases("circle") {
        let marker = list(&case["input"]["points"])
            .iter()
            .map(|p| Some(Point3::from(vector(p))));
        let data = vec![marker.collect::<Vec<_>>()];
        let held = case["input"]["m"]
            .is_array()
            .then(|| Point3::from(vector(&case["input"]["m"])));
        for center in [None, held] {
            let options = Options {
                center,
                ..Options::default()
            };
            let both = ["planar_radial", "planar_radial_gn"]
                .map(|id| fit(id, &Input::Points(&data), &options).expect(id));
            let [Outcome::Estimate(a), Outcome::Estimate(b)] = &both else {
                continue;
            };
            let off = a.line.direction.cross(&b.line.direction).norm();
            assert!(
                off < 1e-9,
                "{} held {}: {off:e} rad",
                case["id"],
                center.is_some()
            );
        }
    }
}

#[test]
fn hinges() {
    for case in cases("hinge") {
        let data = tracks(&case["input"]["frames"]);
        let tolerance = case["tol"].as_f64().expect("tol");
        for (ours, theirs) in [
            ("plane", "plane"),
            ("line_ml", "line_ml"),
            ("dir_ml", "dir_ml"),
            ("halvorsen_line", "halvorsen_all"),
            ("hinge_bundle", "hinge_bundle"),
        ] {
            let want = &case["expect"][theirs];
            if want.is_null() {
                continue;
            }
            let what = format!("{} {ours}", case["id"]);
            let outcome = fit(ours, &Input::Markers(&data), &Options::default()).expect(&what);
            assert_eq!(
                outcome.verdict(),
                Verdict::Ok,
                "{what}: {:?}",
                outcome.reason()
            );
            compare(&what, outcome.estimate().expect(&what), want, tolerance);
        }
    }
}

#[test]
fn axes_of_poses() {
    for case in cases("pose") {
        let data = poses(&case);
        let tolerance = case["tol"].as_f64().expect("tol");
        for (ours, theirs) in [("sara", "sara"), ("rotation_axis", "rotation_only")] {
            let what = format!("{} {ours}", case["id"]);
            // Two poses leave nothing to see the noise in: answered only where it is stated.
            let options = if data.len() == 2 {
                Options::default().with_sigma_r(1e-9)
            } else {
                Options::default()
            };
            let outcome = fit(ours, &Input::Poses(&data), &options);
            if case["expect"]["verdict"] == "not_rotation" {
                let error = outcome.expect_err("a scaled matrix");
                assert_eq!(error.verdict(), Some(Verdict::NotRotation));
                continue;
            }
            let outcome = outcome.expect(&what);
            let want = &case["expect"][theirs];
            if want.is_object() {
                let estimate = outcome.estimate().expect(&what);
                compare(&what, estimate, want, tolerance);
                let child = estimate.in_child.expect(&what);
                let off = child.direction.cross(&vector(&want["axis_body"])).norm();
                assert!(off < tolerance, "{what}: axis in the body off by {off:e}");
            } else {
                assert_ne!(outcome.verdict(), Verdict::Ok, "{what}: a ball has no axis");
            }
        }
    }
}

fn grid(case: &Value) -> Vec<FrameSample> {
    let (alpha, beta) = (
        numbers(&case["input"]["alpha"]),
        numbers(&case["input"]["beta"]),
    );
    let mut samples = Vec::new();
    for (i, distal) in alpha.iter().enumerate() {
        for (j, proximal) in beta.iter().enumerate() {
            let pose = Pose {
                rotation: matrix(&case["input"]["R_meas"][i * beta.len() + j]),
                translation: vector(&case["input"]["grid"][i][j]),
            };
            samples.push(FrameSample {
                world_from_body: Some(pose),
                proximal: *proximal,
                distal: *distal,
                weight: 1.0,
            });
        }
    }
    samples
}

#[test]
fn frames() {
    /// Of unit vectors; the reference's own simplex stopped near 1e-11.
    const DIRECTION: f64 = 1e-10;
    /// Of lengths in mm, for joint minima of well-posed problems.
    const LENGTH: f64 = 1e-9;
    for case in cases("frame_grid") {
        let samples = grid(&case);
        for (name, plane_fit) in [
            ("fixed_m_derot", PlaneFit::PlanarRadial),
            ("plane_derot", PlaneFit::Plane),
            ("line_derot", PlaneFit::CommonLine),
        ] {
            let want = &case["expect"][name];
            let options = Options {
                plane_fit,
                ..Options::default()
            };
            let center = Center::Given {
                point: Point3::from(vector(&want["t"])),
                covariance: Matrix3::zeros(),
            };
            let outcome = frame_planes::algorithm1(&samples, center, &options).expect(name);
            assert_eq!(
                outcome.verdict(),
                Verdict::Ok,
                "{name}: {:?}",
                outcome.reason()
            );
            let estimate = outcome.estimate().expect(name);
            let rotation = estimate.world_from_joint.rotation.to_rotation_matrix();
            let off = (rotation.matrix() - matrix(&want["R"])).amax();
            assert!(off < DIRECTION, "{name}: axes off by {off:e}");
            let square = vector(&want["x"]).dot(&vector(&want["z"]));
            let off = estimate.orthogonality_defect + square.asin();
            assert!(
                off.abs() < DIRECTION,
                "{name}: orthogonality defect off by {off:e}"
            );
        }
        let options = Options {
            sigma_t: case["input"]["s_t"].as_f64(),
            sigma_r: case["input"]["s_r"].as_f64(),
            ..Options::default()
        };
        for (name, which) in [
            ("bundle_points", frame_ml::Residuals::Points),
            ("bundle_points_rot", frame_ml::Residuals::Poses),
        ] {
            let want = &case["expect"][name];
            let outcome = frame_ml::fit(&samples, which, &options).expect(name);
            let FrameOutcome::Estimate(estimate) = outcome else {
                panic!("{name} has no frame")
            };
            let rotation = estimate.world_from_joint.rotation.to_rotation_matrix();
            let joint_from_body = estimate.body_from_joint.inverse();
            assert!(
                (rotation.matrix() - matrix(&want["R"])).amax() < DIRECTION,
                "{name}: R"
            );
            let origin = estimate.world_from_joint.translation.vector;
            assert!(
                (origin - vector(&want["t"])).norm() < LENGTH,
                "{name}: origin"
            );
            let p = joint_from_body.translation.vector;
            assert!((p - vector(&want["p"])).norm() < LENGTH, "{name}: p");
            if want["RB"].is_array() {
                let r = joint_from_body.rotation.to_rotation_matrix();
                assert!(
                    (r.matrix() - matrix(&want["RB"])).amax() < DIRECTION,
                    "{name}: RB"
                );
            }
        }
    }
}

#[test]
fn frames_of_two_axes() {
    for case in cases("frame_axes") {
        let (x, z) = (unit(&case["input"]["x"]), unit(&case["input"]["z"]));
        let got = frame_from_axes((FrameAxis::X, x), (FrameAxis::Z, z));
        if case["expect"]["verdict"] == "parallel" {
            assert_eq!(got, Err(Verdict::Parallel), "{}", case["id"]);
            continue;
        }
        let off = (got.expect("a frame").rotation.matrix() - matrix(&case["expect"]["so3"])).amax();
        assert!(
            off < case["tol"].as_f64().expect("tol"),
            "{}: off by {off:e}",
            case["id"]
        );
        // The order of the two axes does not matter.
        let swapped = frame_from_axes((FrameAxis::Z, z), (FrameAxis::X, x)).expect("a frame");
        assert!(
            (swapped.rotation.matrix() - got.expect("a frame").rotation.matrix()).amax() < 1e-14
        );
    }
}

#[test]
fn means() {
    for case in cases("rot_avg") {
        let rotations: Vec<_> = list(&case["input"]["R"])
            .iter()
            .map(|r| so3::quaternion_of(&Rotation3::from_matrix_unchecked(matrix(r))))
            .collect();
        let got = mean::chordal_mean(&rotations);
        let want = &case["expect"]["rot_avg"];
        if want["verdict"] == "ok" {
            let off =
                (got.expect("a mean").to_rotation_matrix().matrix() - matrix(&want["R"])).amax();
            assert!(
                off < case["tol"].as_f64().expect("tol"),
                "{}: {off:e}",
                case["id"]
            );
        } else {
            assert!(
                matches!(got, Err(mean::MeanError::NotUnique { .. })),
                "{}",
                case["id"]
            );
        }
    }
    for case in cases("axis_avg") {
        let axes: Vec<_> = list(&case["input"]["axes"]).iter().map(unit).collect();
        let reference = case["input"]["ref"]
            .is_array()
            .then(|| unit(&case["input"]["ref"]));
        let got = mean::axis_mean(&axes, reference);
        let want = &case["expect"]["axis_avg"];
        if want["verdict"] == "ok" {
            let off = (got.expect("a mean").into_inner() - vector(&want["n"])).amax();
            assert!(
                off < case["tol"].as_f64().expect("tol"),
                "{}: {off:e}",
                case["id"]
            );
        } else {
            assert!(
                matches!(got, Err(mean::MeanError::NotUnique { .. })),
                "{}",
                case["id"]
            );
        }
    }
}
