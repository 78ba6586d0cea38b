//! Priors so wide that they say nothing: the fit is that without priors, and is reached as fast.

use crate::common::{Chain, Free, rng, six_r};
use calib_core::{Settings, Solution, solve};

const MARKER: f64 = 2e-4;

/// A whole arm with priors of this width, rad and m.
fn solved(seed: u64, width: Option<f64>, missing: f64, estimated: bool) -> Solution {
    let mut r = rng(seed);
    let free = Free {
        prior: width.map(|w| (w, w)),
        ..Free::everything(6)
    };
    let chain = Chain::nominal(six_r())
        .posed(&mut r, 40, 1.4)
        .deviate(&mut r, &free, 0.005, 0.001);
    let mut h = chain.problem(&free, MARKER);
    h.problem.group_mut(h.markers).estimate = estimated;
    if estimated {
        let g = h
            .problem
            .noise_group("joint", calib_core::NoiseKind::Joint, 1.7e-4, true);
        for j in &h.joints {
            h.problem.joint_noise(*j, g);
        }
    }
    let q = chain.q.clone();
    chain.observe_moved(&mut r, &mut h, MARKER, |s| {
        q[s].iter().map(|q| missing * (2.0 * q).cos()).collect()
    });
    let settings = if estimated {
        Settings::default()
    } else {
        Settings::plain()
    };
    solve(&h.problem, &settings).unwrap()
}

#[test]
fn wide_priors_end_at_the_optimum_of_the_data() {
    for estimated in [false, true] {
        for missing in [0.0, 2e-3] {
            for seed in 0..2 {
                let free = solved(seed, None, missing, estimated);
                for width in [0.1, 1.0, 10.0, 1e2, 1e3, 1e4, 1e6] {
                    let wide = solved(seed, Some(width), missing, estimated);
                    let case = format!("{estimated} {missing} {seed} {width}");
                    println!("{case}: {} for {}", wide.iterations, free.iterations);
                    assert!(wide.status.is_converged(), "{case}: {:?}", wide.status);
                    assert!(wide.iterations <= 50, "{case}: {}", wide.iterations);
                    let change = (wide.chi2 / free.chi2 - 1.0).abs();
                    assert!(change < 1e-5, "{case}: {change}");
                }
            }
        }
    }
}

/// What nothing determines is as small as it can be: along gauges the values end where they started, at the nominal robot, whether
/// there is no prior or one that says nothing.
#[test]
fn gauges_end_at_minimum_norm() {
    let without = solved(3, None, 2e-3, false);
    let null = without.information.null_space();
    assert!(null.ncols() >= 12, "{}", null.ncols());
    for width in [None, Some(1e2), Some(1e6)] {
        let s = solved(3, width, 2e-3, false);
        let free = s.parameters.iter();
        let free = free.filter(|p| s.column_of(p.id.index()).is_some());
        let off: Vec<f64> = free.map(|p| p.value - p.nominal).collect();
        let x = nalgebra::DVector::from_vec(off).component_div(&without.information.scale);
        let along = null.tr_mul(&x).norm();
        assert!(
            along < 0.05 * x.norm(),
            "{width:?}: {along} of {}",
            x.norm()
        );
    }
}
