use nalgebra::{Point3, Vector3};

use super::*;
use crate::example::{Origins, joints};
use crate::solve::whitened::whitened;
use crate::{MarkerObservation, PointId};

/// Unknown places of four markers, of which always others are hidden, behind two joints that scatter: the information of the whitened rows themselves.
#[test]
fn the_information_is_that_of_all_rows() {
    const SAMPLES: usize = 70;
    let (mut p, [tracker, frame], noise) = joints(SAMPLES, Origins::Unknown);
    let place = |m: usize| Point3::from(Vector3::from_fn(|i, _| 0.1 * ((3 * m + i) as f64).sin()));
    let points: Vec<PointId> = (0..4)
        .map(|m| p.unknown_point(&format!("m{m}"), frame, place(m), Some(0.1)))
        .collect();
    let seen = (0..4 * SAMPLES).filter(|i| i % 7 != 0 && i % 11 > 1);
    let seen = seen.map(|i| MarkerObservation {
        sample: i / 4,
        point: points[i % 4],
        position: Point3::new(0.2, 0.1, 1e-3 * (1.9 * i as f64).sin()),
        shape: None,
    });
    p.markers("body", tracker, frame, noise, seen.collect());
    let model = Model::new(&p).unwrap();
    let (values, theta) = (model.start(), [1e-6, 4e-6, 9e-6]);
    let weights = vec![1.0; model.observations.len()];
    let objective = Objective {
        model: &model,
        weights: &weights,
        theta: &theta,
    };
    let mut work = Workspace::new(&model);
    work.cache.update(&model.problem, &values);
    let n = model.free();
    let mut h = DMatrix::zeros(n, n);
    for sample in 0..SAMPLES {
        if let Some(rows) = whitened(objective, &values, sample, &mut work) {
            rows.a.add_gram(1.0, &mut h);
        }
    }
    let found = Information::at(&model, &values, &weights, &theta).expect("evaluable");
    let r = DMatrix::from_fn(n, n, |i, j| found.root[(i, j)] / found.scale[j]);
    let off = r.transpose() * &r - &h;
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        // Sums of some 200 rows in another order.
        assert!(off[(i, j)].abs() <= 1e-12 * (h[(i, i)] * h[(j, j)]).sqrt());
    }
}

/// Against the inverse itself; where priors leave a direction open there is none.
#[test]
fn the_posterior_root_is_one_of_the_inverse() {
    let n = 7;
    let mut r = DMatrix::from_fn(n, n, |i, k| ((i * 31 + k * 17) as f64).sin());
    r.fill_lower_triangle(0.0, 1);
    for i in 0..n - 1 {
        r[(i, i)] += 3.0;
    }
    r[(6, 6)] = 0.0;
    let priors = [(2, 0.5), (6, 2.0)];
    let mut information = r.tr_mul(&r);
    for (c, weight) in priors {
        information[(c, c)] += weight * weight;
    }
    let root = posterior_root(&r, &priors).expect("every direction is known");
    let inverse = information.try_inverse().expect("regular");
    assert!((&root * root.transpose() - &inverse).amax() < 1e-10 * inverse.amax());
    assert!(posterior_root(&r, &[]).is_none());
}

/// The last chunk of samples may be one row of one marker: what rounding leaves of its rows must not become infinite.
#[test]
fn fewer_rows_than_columns_have_a_finite_factor() {
    for (rows, n) in [(1, 40), (2, 40), (3, 24), (3, 40), (3, 90), (6, 120)] {
        for seed in 0..40 {
            let a = DMatrix::from_fn(rows, n, |i, j| {
                let x = (1.3 * (i * n + j + 1) as f64 + seed as f64).sin();
                10.0_f64.powi(j as i32 % 5) * x
            });
            let mut qr = StreamedQr::new(n);
            a.row_iter()
                .for_each(|row| qr.append(row.transpose().as_slice()));
            let r = qr.finish();
            let off = r.transpose() * &r - a.transpose() * &a;
            assert!(off.amax() < 1e-6, "{rows} × {n}, {seed}: {}", off.amax());
        }
    }
}
