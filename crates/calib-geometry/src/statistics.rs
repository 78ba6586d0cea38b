//! Order statistics, each under the name of its definition: they differ by up to the distance of two neighbors.
//!
//! ```text
//! x_0 ≤ … ≤ x_{n−1}                                                  sorted, divisions of whole numbers rounded down
//! median            (x_{(n−1)/2} + x_{n/2}) / 2                                                       (1)
//! upper_median      x_{n/2}: one of the values, which robust scales with a factor for it rely on      (2)
//! quantile_nearest  x_k, k = p (n − 1) rounded: one of the values                                     (3)
//! quantile_type7    between the two neighbors of p (n − 1), linear (Hyndman & Fan 1996, type 7)       (4)
//! ```
//!
//! None of them looks at NaN: `total_cmp` sorts it to an end.

/// (1); `None` of nothing.
#[must_use]
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    Some(0.5 * (values.get(n.checked_sub(1)? / 2)? + values.get(n / 2)?))
}

/// σ of a Gaussian per median absolute deviation, 1 / Φ⁻¹(3/4).
pub const SIGMA_PER_MAD: f64 = 1.4826;

/// (2), which changes the order of the values; `None` of nothing.
pub fn upper_median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// (3) for p in 0 … 1, which changes the order of the values; `None` of nothing.
pub fn quantile_nearest(values: &mut [f64], p: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    let at = ((last as f64 * p).round() as usize).min(last);
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// (4) for p in 0 … 1 of sorted values; `None` of nothing.
#[must_use]
pub fn quantile_type7(sorted: &[f64], p: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let position = p * last as f64;
    let below = (position.floor() as usize).min(last);
    let above = (below + 1).min(last);
    Some(sorted[below] + (position - below as f64) * (sorted[above] - sorted[below]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_definition_on_values_that_tell_them_apart() {
        let values = || vec![4.0, 1.0, 8.0, 2.0];
        assert_eq!(median(values()), Some(3.0));
        assert_eq!(upper_median(&mut values()), Some(4.0));
        // p (n − 1) = 2.25 → x_2; type 7: 4 + 0.25 · 4
        assert_eq!(quantile_nearest(&mut values(), 0.75), Some(4.0));
        assert_eq!(quantile_type7(&[1.0, 2.0, 4.0, 8.0], 0.75), Some(5.0));
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
    }

    #[test]
    fn the_ends_and_nothing() {
        let sorted = [1.0, 2.0, 4.0];
        for (p, end) in [(0.0, 1.0), (1.0, 4.0)] {
            assert_eq!(quantile_nearest(&mut sorted.to_vec(), p), Some(end));
            assert_eq!(quantile_type7(&sorted, p), Some(end));
        }
        assert_eq!(median(Vec::new()), None);
        assert_eq!(upper_median(&mut []), None);
        assert_eq!(quantile_nearest(&mut [], 0.5), None);
        assert_eq!(quantile_type7(&[], 0.5), None);
    }
}
