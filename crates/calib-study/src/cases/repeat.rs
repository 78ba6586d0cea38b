//! Repeatability: how far the calibrations of one robot from several recordings scatter (paper §7).
//!
//! ```text
//! s² = Σ_k |x_k − x̄|²/(n − 1) = Σ_{k<l} |x_k − x_l|²/(n (n − 1))                           (1)
//! ```
//!
//! x are positions, and rotations by the angle between two of them: the second form needs no mean of rotations. The same poses that are wrong in
//! every recording do not show in (1): a method can repeat itself far better than it is right.

use std::collections::BTreeMap;

use super::{Found, Off};

/// Equation (1) of each transform that every calibration has; none from fewer than two.
pub(super) fn scatter(all: &[Found]) -> BTreeMap<String, Off> {
    let Some((first, others)) = all.split_first() else {
        return BTreeMap::new();
    };
    if others.is_empty() {
        return BTreeMap::new();
    }
    let n = all.len() as f64;
    let of = |name: &String| {
        let each: Vec<_> = all
            .iter()
            .map(|found| found.get(name))
            .collect::<Option<_>>()?;
        let (mut shift, mut turn) = (0.0, 0.0);
        for (k, a) in each.iter().enumerate() {
            for b in &each[..k] {
                shift += (a.translation.vector - b.translation.vector).norm_squared();
                turn += a.rotation.angle_to(&b.rotation).powi(2);
            }
        }
        let one = |squares: f64| (squares / (n * (n - 1.0))).sqrt();
        Some(Off {
            translation_m: one(shift),
            rotation_rad: one(turn),
        })
    };
    first
        .keys()
        .filter_map(|name| Some((name.clone(), of(name)?)))
        .collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};

    use super::*;

    fn found(x: f64, turn: f64) -> Found {
        let at = Isometry3::new(Vector3::new(x, 0.0, 0.0), Vector3::z() * turn);
        BTreeMap::from([("t".to_owned(), at)])
    }

    #[test]
    fn it_is_the_standard_deviation_of_one() {
        let all = [found(1.0, 0.1), found(2.0, 0.2), found(6.0, 0.6)];
        let s = scatter(&all)["t"];
        // Of 1, 2, 6: mean 3, squares 4 + 1 + 9 over 2.
        assert!((s.translation_m - 7.0_f64.sqrt()).abs() < 1e-12);
        assert!((s.rotation_rad - 0.1 * 7.0_f64.sqrt()).abs() < 1e-12);
        assert!(scatter(&all[..1]).is_empty());
    }
}
