//! The curvature that Gauss–Newton leaves out, gathered from the gradients met on the way.

use calib_geometry::decompose::dot;

use crate::solve::equations::NormalEquations;

/// K of equation (2) of [`minimize`](crate::solve::minimize).
pub(crate) struct Curvature {
    n: usize,
    pub s: Vec<f64>,
    pub slow: bool,
    pub known: bool,
}

impl Curvature {
    pub fn new(n: usize) -> Self {
        Self {
            n,
            s: vec![0.0; n * n],
            slow: false,
            known: false,
        }
    }

    /// Takes what the gradients before and after `step` say.
    pub fn learn(&mut self, before: &NormalEquations, after: &NormalEquations, step: &[f64]) {
        if !self.slow {
            return;
        }
        let n = self.n;
        let mut v = vec![0.0; n];
        for i in 0..n {
            let mut predicted = 0.0;
            for j in 0..n {
                predicted += (after.h[i.min(j) * n + i.max(j)] + self.s[i * n + j]) * step[j];
            }
            v[i] = after.g[i] - before.g[i] - predicted;
        }
        let along = dot(&v, step);
        // In units of √H_ii, so that meters and radians count alike.
        let size = |x: &[f64], power: i32| -> f64 {
            (0..n)
                .map(|i| {
                    let d = after.h[i * n + i];
                    if d > 0.0 {
                        x[i] * x[i] * d.powi(power)
                    } else {
                        0.0
                    }
                })
                .sum::<f64>()
                .sqrt()
        };
        if along.abs() <= 1e-8 * size(&v, -1) * size(step, 1) {
            return;
        }
        for i in 0..n {
            for j in 0..n {
                self.s[i * n + j] += v[i] * v[j] / along;
            }
        }
        self.known = true;
    }
}
