//! Group laws of SO(3) and SE(3) at the identity, at 1e-8, near π and at random; two routes to each number.

use calib_geometry::line::{Line, ScrewAxis};
use calib_geometry::mean::{MeanError, axis_mean, chordal_mean};
use calib_geometry::registration::{RegistrationError, rigid_registration};
use calib_geometry::{Twist, se3, so3};
use nalgebra::{
    Isometry3, Matrix3, Matrix4, Matrix6, Point3, Unit, UnitQuaternion, Vector3, Vector6,
};
use proptest::prelude::*;
use std::f64::consts::PI;

fn vector(range: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-range..range).prop_map(Vector3::from)
}

/// Rotation vectors at the angles where implementations break.
fn rotation_vector() -> impl Strategy<Value = Vector3<f64>> {
    let angle = prop_oneof![
        Just(0.0),
        Just(1e-12),
        Just(1e-8),
        Just(1e-4),
        Just(0.2499999),
        Just(0.2500001),
        Just(PI - 1e-6),
        Just(PI - 1e-3),
        0.0..PI
    ];
    (vector(1.0), angle).prop_filter_map("zero axis", |(axis, angle)| {
        Unit::try_new(axis, 1e-3).map(|a| a.into_inner() * angle)
    })
}

fn twist() -> impl Strategy<Value = Twist> {
    (rotation_vector(), vector(2.0)).prop_map(|(w, v)| Twist::new(w, v))
}

/// Brute-force matrix exponential: scaling, a Taylor series, and squaring.
fn expm4(a: Matrix4<f64>) -> Matrix4<f64> {
    let scaled = a / 1024.0;
    let (mut term, mut sum) = (Matrix4::identity(), Matrix4::identity());
    for k in 1..20 {
        term = term * scaled / f64::from(k);
        sum += term;
    }
    for _ in 0..10 {
        sum *= sum;
    }
    sum
}

fn hat(xi: &Twist) -> Matrix4<f64> {
    let mut m = Matrix4::zeros();
    m.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&so3::skew(&xi.angular()));
    m.fixed_view_mut::<3, 1>(0, 3).copy_from(&xi.linear());
    m
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    #[test]
    fn log_inverts_exp(xi in twist()) {
        let back = se3::log(&se3::exp(&xi));
        prop_assert!((back.0 - xi.0).amax() < 2e-9 * (1.0 + xi.0.amax()), "{xi:?} {back:?}");
    }

    #[test]
    fn exp_is_the_matrix_exponential(xi in twist()) {
        let closed = se3::exp(&xi).to_homogeneous();
        prop_assert!((closed - expm4(hat(&xi))).amax() < 1e-11);
    }

    #[test]
    fn adjoint_moves_twists(x in twist(), xi in twist()) {
        let x = se3::exp(&x);
        let left = x * se3::exp(&xi) * x.inverse();
        let right = se3::exp(&Twist(se3::adjoint(&x) * xi.0));
        prop_assert!((left.to_homogeneous() - right.to_homogeneous()).amax() < 1e-10);
    }

    #[test]
    fn right_jacobian_is_the_derivative(xi in twist()) {
        let step = 1e-6;
        let analytic = se3::right_jacobian(&xi);
        let inverse = se3::exp(&xi).inverse();
        for i in 0..6 {
            let mut d = Vector6::zeros();
            d[i] = step;
            let plus = se3::log(&(inverse * se3::exp(&Twist(xi.0 + d)))).0;
            let minus = se3::log(&(inverse * se3::exp(&Twist(xi.0 - d)))).0;
            let numeric = (plus - minus) / (2.0 * step);
            prop_assert!((numeric - analytic.column(i)).amax() < 2e-8, "{i} {numeric} {}", analytic.column(i));
        }
        let product = analytic * se3::right_jacobian_inverse(&xi);
        prop_assert!((product - Matrix6::identity()).amax() < 1e-10);
    }

    #[test]
    fn rotations_of_matrices(phi in rotation_vector()) {
        let r = so3::exp(&phi).to_rotation_matrix();
        let q = so3::check_rotation(r.matrix(), 1e-9).unwrap();
        prop_assert!(q.angle_to(&so3::exp(&phi)) < 1e-7);
        prop_assert!(so3::check_rotation(&(r.matrix() * 1.01), 1e-6).is_err());
        prop_assert!(so3::check_rotation(&-r.matrix(), 1e-6).is_err());
    }

    #[test]
    fn screw_of_a_turn_about_a_line(p in vector(1.0), d in vector(1.0), angle in 0.01..3.1_f64, slide in -1.0..1.0_f64) {
        prop_assume!(d.norm() > 1e-2);
        let line = Line::new(p.into(), d).unwrap();
        let turn = UnitQuaternion::from_axis_angle(&line.direction, angle);
        let t: Vector3<f64> = p - turn * p + line.direction.into_inner() * slide;
        let screw = ScrewAxis::of(&Isometry3::from_parts(t.into(), turn), 1e-6).unwrap();
        prop_assert!(screw.line.same_line(&line, 1e-9));
        prop_assert!((screw.angle - angle).abs() < 1e-12 && (screw.slide - slide).abs() < 1e-9);
    }

    #[test]
    fn lines_measure_symmetrically(a in vector(1.0), da in vector(1.0), b in vector(1.0), db in vector(1.0)) {
        prop_assume!(da.norm() > 1e-2 && db.norm() > 1e-2);
        let (l, m) = (Line::new(a.into(), da).unwrap(), Line::new(b.into(), db).unwrap());
        prop_assert!((l.distance_to_line(&m) - m.distance_to_line(&l)).abs() < 1e-9);
        prop_assert!(l.distance_to_line(&m) <= (a - b).norm() + 1e-12);
        prop_assert!((l.angle_to(&m) - m.angle_to(&l)).abs() < 1e-12);
        let (p, q) = l.closest_points(&m);
        prop_assert!((q - p).dot(&l.direction).abs() < 1e-9 && (q - p).dot(&m.direction).abs() < 1e-9);
    }

    #[test]
    fn registration_finds_the_motion(xi in twist(), points in prop::collection::vec(vector(1.0), 3..8)) {
        let motion = se3::exp(&xi);
        let a: Vec<Point3<f64>> = points.iter().map(|&p| p.into()).collect();
        let b: Vec<Point3<f64>> = a.iter().map(|p| motion * p).collect();
        match rigid_registration(&a, &b, None) {
            Ok(fit) => prop_assert!((fit.b_from_a.to_homogeneous() - motion.to_homogeneous()).amax() < 1e-6),
            Err(error) => {
                let collinear = matches!(error, RegistrationError::Collinear { .. });
                prop_assert!(collinear, "got {error}");
            }
        }
    }

    #[test]
    fn means_commute_with_turning(phis in prop::collection::vec(vector(0.5), 2..6), turn in rotation_vector()) {
        let rotations: Vec<_> = phis.iter().map(so3::exp).collect();
        let turn = so3::exp(&turn);
        let moved: Vec<_> = rotations.iter().map(|r| turn * r).collect();
        let (a, b) = (chordal_mean(&rotations).unwrap(), chordal_mean(&moved).unwrap());
        prop_assert!((turn * a).angle_to(&b) < 1e-7);
    }
}

#[test]
fn means_that_do_not_exist_say_so() {
    let half_turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI);
    assert!(matches!(
        chordal_mean(&[UnitQuaternion::identity(), half_turn]),
        Err(MeanError::NotUnique { .. })
    ));
    assert_eq!(chordal_mean(&[]), Err(MeanError::Empty));
    assert!(matches!(
        axis_mean(&[Vector3::x_axis(), Vector3::y_axis()], None),
        Err(MeanError::NotUnique { .. })
    ));
    let nan = Unit::new_unchecked(Vector3::repeat(f64::NAN));
    assert_eq!(
        axis_mean(&[nan], None),
        Err(MeanError::NotFinite { index: 0 })
    );
}

#[test]
fn axis_mean_has_no_sign() {
    let tilt = |a: f64| Unit::new_normalize(Vector3::new(a.sin(), 0.0, a.cos()));
    let mean = axis_mean(
        &[tilt(0.1), -tilt(-0.1), tilt(0.0)],
        Some(-Vector3::z_axis()),
    )
    .unwrap();
    assert!((mean.into_inner() + Vector3::z()).norm() < 1e-12);
}

#[test]
fn registration_refuses_what_it_cannot_know() {
    let p = |x: f64| Point3::new(x, 2.0 * x, -x);
    let line = [p(0.0), p(1.0), p(2.0)];
    assert!(matches!(
        rigid_registration(&line, &line, None),
        Err(RegistrationError::Collinear { .. })
    ));
    assert_eq!(
        rigid_registration(&line[..2], &line[..2], None),
        Err(RegistrationError::TooFew { got: 2 })
    );
    let nan = [p(0.0), p(f64::NAN), p(1.0)];
    assert_eq!(
        rigid_registration(&line, &nan, None),
        Err(RegistrationError::NotFinite { index: 1 })
    );
}

#[test]
fn mirrored_points_give_a_rotation_not_a_reflection() {
    let a = [
        Point3::new(1.0, 0.0, 0.0),
        Point3::new(0.0, 2.0, 0.0),
        Point3::new(0.0, 0.0, 3.0),
        Point3::origin(),
    ];
    let b = a.map(|p| Point3::new(-p.x, p.y, p.z));
    let fit = rigid_registration(&a, &b, None).unwrap();
    let r: Matrix3<f64> = *fit.b_from_a.rotation.to_rotation_matrix().matrix();
    assert!((r.determinant() - 1.0).abs() < 1e-12 && fit.rms > 0.1);
}
