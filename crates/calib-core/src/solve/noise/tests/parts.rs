//! The parts of a model, each for itself, against all of its measurements in one.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::graph::chart::Chart;
use crate::model::layout::Model;
use crate::model::values::Values;
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::noise::score;
use crate::solve::normal::{accumulate, cost};
use crate::solve::whitened::whitened;
use crate::*;
use nalgebra::{Isometry3, Point3, Vector3};

const SAMPLES: usize = 150;

/// Two arms of two noisy joints each, and a body on the base, all seen by one tracker; the markers of one arm are unknown, some are hidden, and
/// the tracker's frame is unknown: its columns belong to all parts.
fn problem() -> Problem {
    let mut p = Problem::new(SAMPLES);
    let tracker = p.frame("tracker");
    let base = p.frame("base");
    let x = Isometry3::new(Vector3::new(0.3, 0.1, 0.2), Vector3::new(0.2, -0.4, 0.5));
    p.unknown("place", tracker, base, x, Chart::full());
    let noise = p.noise_group("markers", NoiseKind::Position, 1e-3, true);
    let mut bodies = vec![("still".to_owned(), base)];
    for arm in 0..2 {
        let mut parent = base;
        for joint in 0..2 {
            let name = format!("j{arm}{joint}");
            let at = p.frame(&format!("{name} at rest"));
            let x = Isometry3::new(Vector3::new(0.1, 0.3, 0.2), Vector3::new(0.3, 0.1, -0.2));
            p.unknown(&format!("{name} origin"), parent, at, x, Chart::full());
            let child = p.frame(&name);
            let turn = 1.3 + arm as f64 + 0.4 * joint as f64;
            let q = (0..SAMPLES).map(|i| (turn * i as f64).sin()).collect();
            let axis = [Vector3::z_axis(), Vector3::y_axis()][joint];
            let edge = p.joint(&name, at, child, Axis::Revolute(axis), q);
            let group = p.noise_group(&format!("{arm}{joint}"), NoiseKind::Joint, 1e-3, true);
            p.joint_noise(edge, group);
            p.free_effect(edge, EffectKind::ZeroOffset, Some(0.1));
            parent = child;
        }
        bodies.push((format!("hand {arm}"), parent));
    }
    for (b, (name, frame)) in bodies.into_iter().enumerate() {
        let points: Vec<PointId> = (0..4)
            .map(|m| {
                let at = Point3::from(Vector3::from_fn(|i, _| {
                    0.1 * ((3 * m + i + b) as f64).sin()
                }));
                match b {
                    2 => p.unknown_point(&format!("m{b}{m}"), frame, at, Some(0.1)),
                    _ => p.known_point(&format!("m{b}{m}"), frame, at),
                }
            })
            .collect();
        let seen = (0..4 * SAMPLES).filter(|i| (i + b) % 7 != 0).map(|i| {
            let off = |k: f64| 1e-3 * (k * (i + 11 * b) as f64).sin();
            MarkerObservation {
                sample: i / 4,
                point: points[i % 4],
                position: Point3::new(0.2 + off(1.1), 0.1 + off(1.9), off(2.3)),
                shape: None,
            }
        });
        p.markers(&name, tracker, frame, noise, seen.collect());
    }
    p
}

/// The model in its parts, and with all measurements in one.
fn models() -> (Model, Model) {
    let parted = Model::new(&problem()).unwrap();
    assert_eq!(parted.parts.len(), 3);
    let mut whole = parted.clone();
    whole.parts = vec![Arc::clone(&parted.whole)];
    (parted, whole)
}

fn near(a: &[f64], b: &[f64]) -> bool {
    let size = b.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-9 * size)
}

fn at(model: &Model) -> (Values, Vec<f64>, Vec<f64>) {
    let mut values = model.start();
    for (i, v) in values.0.iter_mut().enumerate() {
        *v += 0.05 * (i as f64).sin();
    }
    let weights = (0..model.observation_count()).map(|o| [1.0, 0.0, 0.7, 1.0, 2.0][o % 5]);
    let theta = (0..model.problem.groups.len()).map(|g| 1e-6 * (1 + g) as f64);
    (values, weights.collect(), theta.collect())
}

/// Normal equations, the cost at other values by the same V, one step of the noise levels, information and rows.
#[test]
fn parts_say_what_the_whole_says() {
    let (parted, whole) = models();
    let (values, weights, theta) = at(&parted);
    let of = |model: &Model| {
        let objective = Objective {
            model,
            weights: &weights,
            theta: &theta,
        };
        let mut work = Workspace::new(model);
        let mut system = NormalEquations::new(model.free());
        assert!(accumulate(objective, &values, &mut work, &mut system));
        let mut other = values.clone();
        other.0.iter_mut().for_each(|v| *v += 1e-3);
        let cost = cost(objective, &other, &mut work);
        let scored = score(objective, &values, &mut work).unwrap();
        let seen = Information::at(model, &values, &weights, &theta).unwrap();
        (system, cost, scored, seen)
    };
    let ((a, a_cost, a_scored, a_seen), (b, b_cost, b_scored, b_seen)) = (of(&parted), of(&whole));
    assert!(near(&a.h, &b.h) && near(&a.g, &b.g));
    assert!(near(&[a.cost(), a_cost], &[b.cost(), b_cost]));
    assert!(near(&a_scored.theta, &b_scored.theta));
    assert!(near(
        a_seen.singular_values().as_slice(),
        b_seen.singular_values().as_slice()
    ));
    assert!(near(
        a_seen.covariance.as_slice(),
        b_seen.covariance.as_slice()
    ));
}

#[test]
fn products_are_those_of_the_dense_matrix() {
    let (parted, whole) = models();
    let (values, weights, theta) = at(&parted);
    let of = |model: &Model, sample: usize| {
        let objective = Objective {
            model,
            weights: &weights,
            theta: &theta,
        };
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &values);
        whitened(objective, &values, sample, &mut work).unwrap()
    };
    for sample in [0, 1, 77] {
        let (own, one) = (of(&parted, sample), of(&whole, sample));
        let a = own.a.dense();
        assert!(near(a.as_slice(), one.a.dense().as_slice()));
        assert!(near(own.w.as_slice(), one.w.as_slice()));
        assert!(near(own.l.as_slice(), one.l.as_slice()));
        assert!(near(own.l_inverse.as_slice(), one.l_inverse.as_slice()));
        assert!(near(&[own.log_det], &[one.log_det]));
        assert_eq!(own.blocks, one.blocks);
        let (m, n) = a.shape();
        let x = DMatrix::from_fn(n, 3, |i, k| ((i + 5 * k) as f64).sin());
        let mut b = DMatrix::from_fn(m, 4, |i, k| ((2 * i + k) as f64).cos());
        b.rows_mut(0, m / 2).column_mut(1).fill(0.0);
        let c = &x * x.transpose() + DMatrix::identity(n, n);
        for s in [&own, &one] {
            assert!(near(s.a.times(&x).as_slice(), (&a * &x).as_slice()));
            let first = x.column(0).into_owned();
            assert!(near(
                s.a.times_vector(&first).as_slice(),
                (&a * &first).as_slice()
            ));
            let products = a.tr_mul(&b);
            assert!(near(
                s.a.transposed_times(&b).as_slice(),
                products.as_slice()
            ));
            let mut g = DVector::zeros(n);
            s.a.add_transposed_vector(&b.column(1).into_owned(), &mut g);
            assert!(near(
                g.as_slice(),
                products.column(1).into_owned().as_slice()
            ));
            let mut h = DMatrix::identity(n, n);
            s.a.add_gram(2.0, &mut h);
            let expected = DMatrix::identity(n, n) + 2.0 * a.tr_mul(&a);
            assert!(near(h.as_slice(), expected.as_slice()));
            let (ac, q) = s.a.between(&c);
            assert!(near(ac.as_slice(), (&a * &c).as_slice()));
            let expected = &a * &c * a.transpose();
            assert!(near(q.as_slice(), expected.as_slice()));
            let symmetric = &c * c.transpose();
            let expected_of = &a * &symmetric * a.transpose();
            let found = s.a.gram_with(&symmetric);
            assert!(near(found.as_slice(), expected_of.as_slice()));
            let diagonal: Vec<f64> = expected.diagonal().iter().copied().collect();
            assert!(near(&s.a.squares_with(&c), &diagonal));
        }
    }
}
