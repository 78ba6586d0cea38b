//! The choice against dense references: every equation written out with whole matrices.

use calib_plan::basis::{Basis, compressed, sigma};
use calib_plan::design::{Criterion, Question};
use nalgebra::{DMatrix, DVector};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

fn normal(rng: &mut impl Rng, rows: usize, columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| rng.sample::<f64, _>(StandardNormal))
}

/// Postures of 3 rows each that differ in size, p parameters of which some have a prior.
fn postures(seed: u64, count: usize, p: usize) -> (Vec<DMatrix<f64>>, DMatrix<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let rows = (0..count)
        .map(|_| normal(&mut rng, 3, p) * rng.random_range(0.3..3.0))
        .collect();
    let prior = DVector::from_fn(p, |i, _| f64::from(u8::from(i % 3 == 0)));
    (rows, DMatrix::from_diagonal(&prior))
}

fn criteria(p: usize) -> [Criterion; 5] {
    let mut rng = ChaCha8Rng::seed_from_u64(99);
    let b = normal(&mut rng, 4, p);
    let subset = DMatrix::identity(p, p).rows(1, p / 2).into_owned();
    [
        Criterion::Determinant,
        Criterion::Subset(subset.clone()),
        Criterion::Trace(b.transpose() * b),
        Criterion::Smallest(DMatrix::identity(p, p)),
        Criterion::Smallest(subset),
    ]
}

/// What is left of the parameters from 1 to p/2 when all others are eliminated.
fn eliminated(m: &DMatrix<f64>) -> DMatrix<f64> {
    let p = m.nrows();
    let (from, len) = (1, p / 2);
    let kept: Vec<usize> = (from..from + len).collect();
    let rest: Vec<usize> = (0..p).filter(|i| !kept.contains(i)).collect();
    let part = |a: &[usize], b: &[usize]| m.select_rows(a).select_columns(b);
    let inner = part(&rest, &rest).try_inverse().expect("regular");
    part(&kept, &kept) - part(&kept, &rest) * inner * part(&rest, &kept)
}

/// The criterion from the whole matrix, by determinants and inverses of a general solver; the subset by its Schur complement,
/// which is what is left when the nuisances are eliminated.
fn dense(criterion: &Criterion, m: &DMatrix<f64>) -> f64 {
    match criterion {
        Criterion::Determinant => m.determinant().ln(),
        Criterion::Subset(_) => eliminated(m).determinant().ln(),
        Criterion::Smallest(s) if s.nrows() == m.nrows() => m.symmetric_eigenvalues().min(),
        Criterion::Smallest(_) => eliminated(m).symmetric_eigenvalues().min(),
        Criterion::Trace(l) => -(l * m.clone().try_inverse().expect("regular")).trace(),
    }
}

/// Efficiency of one design against another in the unit of the certificate.
fn ratio(criterion: &Criterion, of: f64, best: f64, p: usize) -> f64 {
    match criterion {
        Criterion::Determinant => ((of - best) / p as f64).exp(),
        Criterion::Subset(s) => ((of - best) / s.nrows() as f64).exp(),
        Criterion::Trace(_) => (best / of).sqrt(),
        Criterion::Smallest(_) => (of / best).sqrt(),
    }
}

#[test]
fn values_are_those_of_whole_matrices_and_nuisances_are_eliminated() {
    let (rows, before) = postures(1, 12, 7);
    for criterion in &criteria(7) {
        let question = Question {
            rows: &rows,
            before: &before,
            criterion,
        };
        let chosen = [0, 3, 4, 9];
        let value = question.value(&chosen).expect("regular");
        let reference = dense(criterion, &question.information(&chosen));
        assert!((value - reference).abs() < 1e-9 * reference.abs().max(1.0));
    }
}

#[test]
fn greedy_steps_are_the_best_single_steps_of_whole_matrices() {
    let (rows, before) = postures(2, 40, 7);
    // A regular start: the ridge of the greedy choice then changes nothing that can be seen.
    let before = before + DMatrix::identity(7, 7);
    for criterion in &criteria(7) {
        let question = Question {
            rows: &rows,
            before: &before,
            criterion,
        };
        let best = (0..rows.len()).max_by(|a, b| {
            let of = |i: usize| dense(criterion, &question.information(&[i]));
            of(*a).total_cmp(&of(*b))
        });
        let (best, chosen) = (best.expect("postures"), question.choose(1, &[]));
        // Three rows leave four directions as they were: where all seven count, all postures are equally good. Exchanges end at a gain of 1e-5.
        let value = |of: &[usize]| dense(criterion, &question.information(of));
        match criterion {
            Criterion::Smallest(_) => assert!(value(&chosen) > value(&[best]) * (1.0 - 2e-5)),
            _ => assert_eq!(chosen, [best]),
        }
    }
}

#[test]
fn no_exchange_of_one_posture_is_better_than_the_choice() {
    let (rows, before) = postures(3, 30, 6);
    for criterion in &criteria(6) {
        let question = Question {
            rows: &rows,
            before: &before,
            criterion,
        };
        let chosen = question.choose(5, &[]);
        let value = dense(criterion, &question.information(&chosen));
        for place in 0..5 {
            for other in 0..rows.len() {
                if chosen.contains(&other) {
                    continue;
                }
                let mut changed = chosen.clone();
                changed[place] = other;
                let changed = dense(criterion, &question.information(&changed));
                assert!(changed < value + 2e-3 * value.abs(), "{changed} {value}");
            }
        }
    }
}

#[test]
fn the_certificate_is_below_the_truth_of_all_choices() {
    for seed in 10..12 {
        let (rows, before) = postures(seed, 9, 4);
        for criterion in &criteria(4) {
            let question = Question {
                rows: &rows,
                before: &before,
                criterion,
            };
            // Every set of three different ones.
            let mut values = Vec::new();
            for a in 0..9 {
                for b in a + 1..9 {
                    for c in b + 1..9 {
                        let m = question.information(&[a, b, c]);
                        values.push(([a, b, c], dense(criterion, &m)));
                    }
                }
            }
            let best = values.iter().map(|v| v.1).fold(f64::NEG_INFINITY, f64::max);
            for (set, value) in values.iter().step_by(7) {
                let stated = question.certificate(set).expect("regular");
                let truth = ratio(criterion, *value, best, 4);
                assert!(stated <= truth + 1e-9, "{set:?}: {stated} > {truth}");
            }
            let chosen = question.choose(3, &[]);
            let stated = question.certificate(&chosen).expect("regular");
            assert!(stated > 0.7, "{criterion:?} {stated}");
        }
    }
}

/// The bound is one of all weights between 0 and 1, not only of whole postures; some postures are so large that their weights are cut.
#[test]
fn the_certificate_is_below_the_truth_of_all_weights() {
    let (mut rows, before) = postures(31, 12, 5);
    rows[3] *= 6.0;
    rows[7] *= 4.0;
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for criterion in &criteria(5) {
        let question = Question {
            rows: &rows,
            before: &before,
            criterion,
        };
        let chosen = question.choose(4, &[]);
        let stated = question.certificate(&chosen).expect("regular");
        let value = dense(criterion, &question.information(&chosen));
        let mut nearest = f64::INFINITY;
        for _ in 0..2000 {
            // Weights with the sum 4, each at most 1: those that are not are drawn again.
            let power = rng.random_range(0.2..6.0);
            let drawn: Vec<f64> = (0..12).map(|_| rng.random::<f64>().powf(power)).collect();
            let sum: f64 = drawn.iter().sum();
            let weights: Vec<f64> = drawn.iter().map(|w| 4.0 * w / sum).collect();
            if weights.iter().any(|w| *w > 1.0) {
                continue;
            }
            let mut m = before.clone();
            for (y, w) in rows.iter().zip(&weights) {
                m += y.transpose() * y * *w;
            }
            let truth = ratio(criterion, value, dense(criterion, &m), 5);
            nearest = nearest.min(truth);
            assert!(stated <= truth + 1e-9, "{criterion:?}: {stated} > {truth}");
        }
        assert!(nearest < 1.5 && stated > 0.8, "{nearest} {stated}");
    }
}

#[test]
fn the_updates_stay_exact_over_many_steps_and_exchanges() {
    let (rows, before) = postures(20, 60, 9);
    let before = before + DMatrix::identity(9, 9);
    for criterion in &criteria(9) {
        let question = Question {
            rows: &rows,
            before: &before,
            criterion,
        };
        let chosen = question.choose(14, &[5, 6]);
        assert_eq!(chosen.len(), 14);
        assert!(!chosen.contains(&5) && !chosen.contains(&6));
        // The greedy choice by whole matrices, without any update.
        let mut greedy: Vec<usize> = Vec::new();
        while greedy.len() < 14 {
            let of = |i: usize| {
                let with: Vec<usize> = greedy.iter().copied().chain([i]).collect();
                dense(criterion, &question.information(&with))
            };
            let open = (0..60).filter(|i| ![5, 6].contains(i) && !greedy.contains(i));
            let best = open.max_by(|a, b| of(*a).total_cmp(&of(*b)));
            greedy.push(best.expect("postures"));
        }
        let value = |set: &[usize]| dense(criterion, &question.information(set));
        let (found, plain) = (value(&chosen), value(&greedy));
        assert!(found >= plain - 1e-9 * plain.abs(), "{found} {plain}");
    }
}

#[test]
fn what_nothing_determines_is_no_part_of_the_question() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    // Parameters 0 and 1 enter only as their sum, parameter 2 not at all and has no prior.
    let rows: Vec<DMatrix<f64>> = (0..20)
        .map(|_| {
            let mut y = normal(&mut rng, 3, 5) * 50.0;
            let first = y.column(0).into_owned();
            y.set_column(1, &first);
            y.column_mut(2).fill(0.0);
            y
        })
        .collect();
    let has_prior = [false, false, false, true, true];
    let scale = DVector::from_element(5, 0.01);
    let basis = Basis::new(scale, &has_prior, &[&rows]);
    assert_eq!((basis.known.ncols(), basis.open.ncols()), (3, 2));
    let reduced: Vec<DMatrix<f64>> = rows.iter().map(|y| basis.of(y)).collect();
    let mut m = basis.prior(&has_prior);
    for y in &reduced {
        m += y.transpose() * y;
    }
    let sigmas = basis.sigmas(&m);
    assert!(sigmas[0].is_none() && sigmas[1].is_none() && sigmas[2].is_none());
    // Dense: the sum as one parameter.
    let mut whole = DMatrix::zeros(3, 3);
    for y in &rows {
        let y = DMatrix::from_columns(&[y.column(0), y.column(3), y.column(4)]);
        whole += y.transpose() * y;
    }
    whole[(1, 1)] += 1e4;
    whole[(2, 2)] += 1e4;
    let covariance = whole.try_inverse().expect("regular");
    for (i, k) in [(3, 1), (4, 2)] {
        let reference = covariance[(k, k)].sqrt();
        assert!((sigmas[i].expect("determined") / reference - 1.0).abs() < 1e-9);
    }
    let sum = DMatrix::from_row_slice(1, 5, &[1.0, 1.0, 0.0, 0.0, 0.0]);
    assert!(basis.leak(&sum) < 1e-9);
    let of_sum = sigma(&m, &basis.of(&sum)).expect("determined");
    assert!((of_sum / covariance[(0, 0)].sqrt() - 1.0).abs() < 1e-9);
    let one = DMatrix::from_row_slice(1, 5, &[1.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(basis.leak(&one) > 1e-3);
}

#[test]
fn compressed_rows_say_the_same() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let cases = [
        (20, 3, 9, 3),
        (8, 8, 30, 8),
        (9, 40, 30, 9),
        (40, 40, 7, 7),
        (12, 0, 5, 0),
    ];
    for (rows, inner, columns, rank) in cases {
        let y = normal(&mut rng, rows, inner) * normal(&mut rng, inner, columns);
        let short = compressed(&y);
        assert_eq!(short.nrows(), rank, "{rows} × {columns}");
        let difference = y.transpose() * &y - short.transpose() * &short;
        assert!(difference.amax() <= 1e-12 * y.norm_squared());
    }
}

/// More postures than the greedy choice looks at: those beyond are exchanged in, and the bound is that of all.
#[test]
fn the_last_of_very_many_postures_are_found() {
    let (mut rows, prior) = postures(21, 5000, 6);
    for y in rows.iter_mut().skip(4900).step_by(10) {
        *y *= 8.0;
    }
    for criterion in criteria(6) {
        let question = Question {
            rows: &rows,
            before: &prior,
            criterion: &criterion,
        };
        let chosen = question.choose(8, &[]);
        let strong = |i: &&usize| **i >= 4900 && (**i - 4900).is_multiple_of(10);
        assert_eq!(chosen.iter().filter(strong).count(), 8, "{chosen:?}");
        let least = question.certificate(&chosen).expect("regular");
        assert!(least > 0.9, "{least}");
    }
}
