use super::*;
use crate::example::{SAMPLES, arm};
use crate::{Settings, solve};

/// Formed for the solution as it is.
fn formed(of: &Solution, sample: usize) -> Option<Whitened> {
    let mut work = at(of);
    whitened(of.objective(), &of.values, sample, &mut work)
}

fn at(of: &Solution) -> Workspace {
    let mut work = Workspace::new(&of.model);
    work.cache.update(&of.model.problem, &of.values);
    work
}

fn is_same(a: &Whitened, b: &Whitened) -> bool {
    let matrices = a.a.dense() == b.a.dense() && a.l == b.l && a.l_inverse == b.l_inverse;
    matrices && a.w == b.w && a.log_det == b.log_det && a.blocks == b.blocks
}

#[test]
fn rows_are_formed_once_and_those_of_the_fit() {
    let solution = solve(&arm(), &Settings::default()).unwrap();
    let mut work = at(&solution);
    for sample in 0..SAMPLES {
        let first = solution.rows_of(sample, &mut work).unwrap();
        let again = solution.rows_of(sample, &mut work).unwrap();
        assert!(Arc::ptr_eq(&first, &again));
        assert!(is_same(&first, &formed(&solution, sample).unwrap()));
        let own = solution.rows_with(&solution.weights, sample, &mut work);
        assert!(Arc::ptr_eq(&first, &own.unwrap()));
    }
}

#[test]
fn what_was_changed_has_rows_of_its_own() {
    let solution = solve(&arm(), &Settings::default()).unwrap();
    let mut work = at(&solution);
    let before = solution.rows_of(3, &mut work).unwrap();
    let mut louder = solution.clone();
    louder.theta.iter_mut().for_each(|theta| *theta *= 4.0);
    let of_copy = louder.rows_of(3, &mut work).unwrap();
    assert!(is_same(&of_copy, &formed(&louder, 3).unwrap()));
    assert!((of_copy.w.norm() / before.w.norm() - 0.5).abs() < 1e-12);
    louder.theta.iter_mut().for_each(|theta| *theta /= 4.0);
    louder.forget_rows();
    let back = louder.rows_of(3, &mut work).unwrap();
    assert!(is_same(&back, &before));
    // One marker less.
    let mut weights = solution.weights.clone();
    weights[solution.model.of_sample[3].start] = 0.0;
    let fewer = solution.rows_with(&weights, 3, &mut work).unwrap();
    assert_eq!(fewer.w.len() + 3, before.w.len());
}
