//! Every decomposition rebuilds its input, near-singular and repeated spectra included.

use calib_geometry::decompose::{
    null_space, pencil_eigen, rank, right_singular, semidefinite_eigen, singular_values,
    solve_least_squares, square_root, svd, svd_small, symmetric_eigen,
};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix5};
use proptest::prelude::*;

/// Rounding of n ≤ 12 Jacobi sweeps, relative to the largest singular value.
const TOLERANCE: f64 = 1e-13;

/// Share of the largest singular value at which another counts as nothing.
const OPEN: f64 = 1e-9;

fn assert_svd(a: &DMatrix<f64>) {
    let d = svd(a);
    let k = d.s.len();
    let scale = a.amax().max(f64::MIN_POSITIVE);
    let rebuilt = &d.u * DMatrix::from_diagonal(&d.s) * d.v.transpose();
    assert!(
        (rebuilt - a).amax() <= TOLERANCE * scale * 20.0,
        "does not rebuild: {a}"
    );
    assert!(
        (d.u.tr_mul(&d.u) - DMatrix::identity(k, k)).amax() < TOLERANCE * 20.0,
        "U: {a} {}",
        d.u
    );
    assert!(
        (d.v.tr_mul(&d.v) - DMatrix::identity(k, k)).amax() < TOLERANCE * 20.0,
        "V"
    );
    assert!(d.s.as_slice().windows(2).all(|w| w[0] >= w[1]) && d.s[k - 1] >= 0.0);
    assert!((singular_values(a) - &d.s).amax() <= TOLERANCE * scale * 20.0);
    assert_right(a, &d.s, scale);
}

/// The half of it on the right, and the two of AᵀA.
fn assert_right(a: &DMatrix<f64>, s: &DVector<f64>, scale: f64) {
    let n = a.ncols();
    let unit = DMatrix::identity(n, n);
    let right = right_singular(a);
    assert!((right.s.rows(0, s.len()) - s).amax() <= TOLERANCE * scale * 20.0);
    assert!((right.v.tr_mul(&right.v) - &unit).amax() < TOLERANCE * 20.0);
    // The squares of tiny numbers are 0.
    let along = (a / scale) * &right.v;
    for i in 0..n {
        assert!((along.column(i).norm() - right.s[i] / scale).abs() <= TOLERANCE * 20.0);
    }
    if let Some(found) = null_space(a, OPEN) {
        let (known, none) = (rank(&right.s, OPEN), &found.basis);
        assert_eq!((found.rank, none.ncols()), (known, n - known));
        assert!((none.tr_mul(none) - DMatrix::identity(n - known, n - known)).amax() < TOLERANCE);
        let leak = right.v.columns(0, known).tr_mul(none);
        assert!(leak.is_empty() || leak.amax() < 1e-10, "{leak}");
    }
    let square = a.tr_mul(a);
    let rounding = TOLERANCE * square.amax() * 20.0;
    let root = square_root(&square);
    assert!((&root * root.transpose() - &square).amax() <= rounding);
    let eigen = semidefinite_eigen(&square);
    assert!((eigen.vectors.tr_mul(&eigen.vectors) - unit).amax() < TOLERANCE * 20.0);
    assert!(eigen.values.as_slice().windows(2).all(|w| w[0] <= w[1]) && eigen.values[0] >= 0.0);
    let rebuilt =
        &eigen.vectors * DMatrix::from_diagonal(&eigen.values) * eigen.vectors.transpose();
    assert!((rebuilt - square).amax() <= rounding);
}

fn matrix(m: usize, n: usize) -> impl Strategy<Value = DMatrix<f64>> {
    prop::collection::vec(-1.0..1.0, m * n).prop_map(move |v| DMatrix::from_vec(m, n, v))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..Default::default() })]

    #[test]
    fn svd_rebuilds_random(a in (1usize..14, 1usize..8).prop_flat_map(|(m, n)| matrix(m, n))) {
        assert_svd(&a);
    }

    #[test]
    fn svd_rebuilds_rank_deficient(b in matrix(18, 3), c in matrix(3, 6), scale in -12i32..12) {
        let a = b * c * 10f64.powi(scale);
        assert_svd(&a);
        let s = svd(&a).s;
        prop_assert!(s[3] <= 1e-13 * s[0]);
    }

    #[test]
    fn svd_rebuilds_repeated(b in matrix(6, 6), spectrum in prop::collection::vec(0usize..3, 6)) {
        let values = [0.0, 1.0, 1e-9];
        let q = b.qr().q();
        let d = DMatrix::from_diagonal(&DVector::from_iterator(6, spectrum.iter().map(|&i| values[i])));
        assert_svd(&(&q * d * q.transpose()));
    }

    #[test]
    fn symmetric_eigen_rebuilds(b in matrix(7, 7)) {
        let a = &b + b.transpose();
        let e = symmetric_eigen(&a);
        let rebuilt = &e.vectors * DMatrix::from_diagonal(&e.values) * e.vectors.transpose();
        prop_assert!((rebuilt - &a).amax() < 1e-12);
        prop_assert!(e.values.as_slice().windows(2).all(|w| w[0] <= w[1]));
    }

    #[test]
    fn pencil_satisfies_its_equation(d in matrix(20, 5)) {
        let mut c = DMatrix::identity(5, 5);
        c[(0, 0)] = 0.0; c[(4, 4)] = 0.0; c[(0, 4)] = -2.0; c[(4, 0)] = -2.0;
        let s = d.transpose() * &d;
        for pair in pencil_eigen(&d, &c) {
            let residual = &s * &pair.u - &c * &pair.u * pair.lambda;
            prop_assert!(residual.amax() < 1e-9 * (1.0 + pair.lambda.abs()), "λ {} residual {}", pair.lambda, residual.amax());
        }
    }

    #[test]
    fn least_squares_leaves_an_orthogonal_residual(a in matrix(15, 4), b in matrix(15, 1)) {
        let b = b.column(0).into_owned();
        let fit = solve_least_squares(&a, &b, 1e-12);
        prop_assert!(a.tr_mul(&(&a * fit.x - b)).amax() < 1e-11);
    }
}

#[test]
fn exact_hinges_are_rank_five() {
    // The case for which a bidiagonal SVD was measured wrong: [R_i, −I] of one-axis rotations.
    for seed in 0..200 {
        let axis = nalgebra::Unit::new_normalize(nalgebra::Vector3::new(
            (f64::from(seed) * 0.7).sin(),
            (f64::from(seed) * 1.3).cos(),
            0.3,
        ));
        let mut a = DMatrix::zeros(30, 6);
        for i in 0..10 {
            let r = nalgebra::Rotation3::from_axis_angle(&axis, 0.2 * i as f64);
            a.view_mut((3 * i, 0), (3, 3)).copy_from(r.matrix());
            a.view_mut((3 * i, 3), (3, 3))
                .copy_from(&-Matrix3::identity());
        }
        assert_svd(&a);
        let s = svd(&a).s;
        assert!(s[5] < 1e-14 * s[0] && s[4] > 1e-2, "{s}");
    }
}

#[test]
fn zero_and_tiny_matrices() {
    assert_svd(&DMatrix::zeros(4, 4));
    assert_svd(&DMatrix::zeros(9, 3));
    assert_svd(&(DMatrix::identity(5, 5) * 1e-200));
    let d = svd_small(&(Matrix5::identity() * 3.0));
    assert_eq!(d.s.as_slice(), &[3.0; 5]);
}

#[test]
fn small_singular_values_keep_relative_accuracy() {
    // diag(1, 1e-10, 1e-20) turned: Jacobi finds 1e-20 where a bidiagonal method returns 1e-17.
    let scale = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 1e-10, 1e-20]));
    let q = DMatrix::from_row_slice(3, 3, &[2.0, -1.0, 2.0, 2.0, 2.0, -1.0, -1.0, 2.0, 2.0]) / 3.0;
    let s = svd(&(q * scale)).s;
    assert!((s[2] / 1e-20 - 1.0).abs() < 1e-9, "{}", s[2]);
}

#[test]
fn a_matrix_of_no_columns_has_no_directions() {
    let nothing = right_singular(&DMatrix::zeros(3, 0));
    assert_eq!((nothing.s.len(), nothing.v.shape()), (0, (0, 0)));
    assert_eq!(square_root(&DMatrix::zeros(0, 0)).shape(), (0, 0));
    assert_eq!(square_root(&DMatrix::zeros(2, 2)).shape(), (2, 0));
}

/// Ranks 0 to 7 of seven columns, from rows that see some directions hardly; and one that is seen as little as the tolerance.
#[test]
fn the_null_space_is_found_where_the_rank_leaves_no_doubt() {
    let wave = |i: usize, k: usize| ((13 * i + 7 * k + 5 * i * k) as f64).sin();
    let v = svd(&DMatrix::from_fn(7, 7, wave)).v;
    for seen in 0..=7 {
        for size in [1e-200, 1.0, 1e150] {
            let mut s = DMatrix::zeros(7, 7);
            for i in 0..seen {
                s[(i, i)] = size * 10_f64.powi(-(i as i32));
            }
            let a = DMatrix::from_fn(7, 7, |i, k| wave(k, i)) * s * v.transpose();
            let found = null_space(&a, OPEN).unwrap();
            assert_eq!(found.rank, seen);
            let leak = v.columns(0, seen).tr_mul(&found.basis);
            assert!(leak.is_empty() || leak.amax() < 1e-9, "{seen} {leak}");
        }
    }
    let doubtful = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 1.0, 2.0 * OPEN]));
    assert_eq!(null_space(&doubtful, OPEN), None);
    assert_eq!(
        null_space(&DMatrix::from_element(2, 2, f64::NAN), OPEN),
        None
    );
    assert_eq!(
        null_space(&DMatrix::zeros(3, 0), OPEN).map(|n| n.rank),
        Some(0)
    );
}
