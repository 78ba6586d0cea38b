//! The minimum of (1): the closed-form start, then Gauss–Newton.

use nalgebra::Isometry3;

use crate::{
    problem::{Weights, linearize, moved, solve12},
    start::start,
};

const MAX_STEPS: usize = 50;

/// A pair of transforms, and the steps taken to it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Minimum {
    pub x: Isometry3<f64>,
    pub z: Isometry3<f64>,
    pub iterations: usize,
}

/// The minimum of (1) that the closed form leads to.
pub(crate) fn minimized(a: &[Isometry3<f64>], b: &[Isometry3<f64>], w: Weights) -> Minimum {
    let (mut x, mut z) = start(a, b, w);
    let mut iterations = 0;
    let mut system = linearize(a, b, &x, &z, w);
    for _ in 0..MAX_STEPS {
        iterations += 1;
        let Some(step) = solve12(&system) else { break };
        let (nx, nz) = (
            moved(&x, &step.fixed_rows::<6>(0).into_owned()),
            moved(&z, &step.fixed_rows::<6>(6).into_owned()),
        );
        let next = linearize(a, b, &nx, &nz, w);
        let decrement = -system.1.dot(&step);
        if next.2 > system.2 * (1.0 + 1e-12) {
            break;
        }
        (x, z, system) = (nx, nz, next);
        if decrement <= 1e-18 * (1.0 + system.2) {
            break;
        }
    }
    Minimum { x, z, iterations }
}
