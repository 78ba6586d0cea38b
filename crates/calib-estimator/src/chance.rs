//! Tail probabilities of the distributions that observability tests use.

use statrs::distribution::{DiscreteCDF, Hypergeometric};
use statrs::function::{beta::checked_beta_reg, erf::erfc, gamma::checked_gamma_ur};

/// Above this many degrees of freedom on both sides the cube roots are normal to six digits, and the
/// continued fraction of the beta function needs thousands of terms.
const MANY: f64 = 1000.0;

/// P(F ≥ x) for an F(d1, d2) variable; 1 for x ≤ 0, 0 for x = ∞.
#[must_use]
pub fn f_tail(x: f64, d1: f64, d2: f64) -> f64 {
    if x.is_nan() || x <= 0.0 {
        return 1.0;
    }
    if d1 > MANY && d2 > MANY {
        // Paulson 1942: the cube root of F is nearly normal.
        let (a, b) = (2.0 / (9.0 * d1), 2.0 / (9.0 * d2));
        let root = x.cbrt();
        return normal_tail(((1.0 - b) * root - (1.0 - a)) / (a + b * root * root).sqrt());
    }
    // I_{d2/(d2 + d1 x)}(d2/2, d1/2)
    let z = d2 / (d2 + d1 * x);
    if z <= 0.0 {
        return 0.0;
    }
    checked_beta_reg(0.5 * d2, 0.5 * d1, z.min(1.0)).unwrap_or(1.0)
}

/// P(k or more) of the marked ones among `drawn` of `all`, of which `marked` are marked: hypergeometric; 1 for numbers that contradict each other.
#[must_use]
pub fn hypergeometric_tail(all: usize, marked: usize, drawn: usize, k: usize) -> f64 {
    let [all, marked, drawn] = [all, marked, drawn].map(|n| n as u64);
    match (k.checked_sub(1), Hypergeometric::new(all, marked, drawn)) {
        (Some(fewer), Ok(of)) => of.sf(fewer as u64),
        _ => 1.0,
    }
}

/// P(χ² ≥ x) with `dof` degrees of freedom.
#[must_use]
pub fn chi2_tail(x: f64, dof: f64) -> f64 {
    if x.is_nan() || x <= 0.0 || dof <= 0.0 {
        return 1.0;
    }
    if dof > MANY {
        // Wilson & Hilferty 1931
        let a = 2.0 / (9.0 * dof);
        return normal_tail(((x / dof).cbrt() - (1.0 - a)) / a.sqrt());
    }
    // The regularized upper gamma underflows to 0 far in the tail, which is the right answer.
    checked_gamma_ur(0.5 * dof, 0.5 * x).unwrap_or(0.0)
}

/// The value that an F(d1, ν) variable exceeds with probability `tail`; a χ²(d1)/d1 variable where ν is `None`, that is, where the noise
/// was stated.
///
/// ```
/// use calib_estimator::chance::f_quantile;
/// // Printed tables: F(3, 10) at 5 % is 3.708, χ²(3) at 5 % is 7.815.
/// assert!((f_quantile(0.05, 3.0, Some(10.0)) - 3.708).abs() < 1e-3);
/// assert!((3.0 * f_quantile(0.05, 3.0, None) - 7.815).abs() < 1e-3);
/// ```
#[must_use]
pub fn f_quantile(tail: f64, d1: f64, degrees_of_freedom: Option<f64>) -> f64 {
    let chance = |x: f64| match degrees_of_freedom {
        Some(d2) => f_tail(x, d1, d2),
        None => chi2_tail(x * d1, d1),
    };
    let (mut low, mut high) = (0.0, 1.0);
    while chance(high) > tail && high < 1e12 {
        low = high;
        high *= 4.0;
    }
    // Bisection to the last digits: the tail falls monotonically.
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if chance(middle) > tail {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Half width, in standard deviations, of the interval that a Student variable leaves with probability `tail` on both sides together;
/// of the normal where the noise was stated.
#[must_use]
pub fn t_quantile(tail: f64, degrees_of_freedom: Option<f64>) -> f64 {
    f_quantile(tail, 1.0, degrees_of_freedom).sqrt()
}

/// P(Z ≥ z) of a standard normal variable.
fn normal_tail(z: f64) -> f64 {
    0.5 * erfc(z / std::f64::consts::SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn students_quantiles() {
        // Printed tables: t(5) 2.5706, t(2) 4.3027, normal 1.9600, all at 95 %.
        for (dof, value) in [(Some(5.0), 2.5706), (Some(2.0), 4.3027), (None, 1.9600)] {
            assert!((t_quantile(0.05, dof) - value).abs() < 1e-4, "{dof:?}");
        }
    }

    #[test]
    fn draws_without_putting_back() {
        // 10 · 595 + 5 · 35 + 1 of the 658 008 fives of 40 hold three, four or five of five.
        let exact = 6126.0 / 658_008.0;
        assert!((hypergeometric_tail(40, 5, 5, 3) / exact - 1.0).abs() < 1e-9);
        assert_eq!(hypergeometric_tail(40, 5, 5, 0), 1.0);
        assert_eq!(hypergeometric_tail(40, 50, 5, 1), 1.0);
    }

    #[test]
    fn quantiles_of_the_tables() {
        // Printed tables: F(5, 10) at 5 % is 3.3258, χ²(3) at 0.1 % is 16.266.
        assert!((f_tail(3.3258, 5.0, 10.0) - 0.05).abs() < 1e-5);
        assert!((chi2_tail(16.266, 3.0) - 1e-3).abs() < 1e-6);
        assert_eq!(f_tail(f64::INFINITY, 3.0, 3.0), 0.0);
        assert_eq!(f_tail(0.0, 3.0, 3.0), 1.0);
        assert_eq!(chi2_tail(1e6, 28.0), 0.0);
        // Either side of the border between the two formulas.
        assert!((chi2_tail(1074.0, 999.0) / chi2_tail(1076.0, 1001.0) - 1.0).abs() < 0.02);
        let (exact, cube_root) = (f_tail(1.1, 999.0, 2000.0), f_tail(1.1, 1001.0, 2000.0));
        assert!(
            (exact / cube_root - 1.0).abs() < 0.02,
            "{exact} {cube_root}"
        );
        assert_eq!(f_tail(f64::NAN, 3.0, 3.0), 1.0);
    }
}
