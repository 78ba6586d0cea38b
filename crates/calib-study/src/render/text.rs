//! Words and numbers that several renderers share.

use statrs::distribution::{Beta, ContinuousCDF};

use crate::cell::{Cell, shortest};

/// Scene and method in one line.
pub(crate) fn label(cell: &Cell) -> String {
    let s = &cell.scene;
    let mut text = format!("{}, {}", cell.method, s.motion);
    if !s.condition.is_empty() {
        text.push_str(", ");
        text.push_str(&s.condition);
    }
    text.push_str(&format!(
        ", n {}, r {} mm, σ {} mm",
        s.samples,
        shortest(s.radius_m * 1e3),
        shortest(s.sigma_t_m * 1e3)
    ));
    if s.sigma_r_rad > 0.0 {
        text.push_str(&format!(", {}°", shortest(s.sigma_r_rad.to_degrees())));
    }
    text
}

/// One-sided 95 % limits of a probability of which `count` of `trials` were seen (Clopper & Pearson 1934).
pub(crate) fn probability(count: u64, trials: u64) -> (f64, f64) {
    let (k, n) = (count as f64, trials as f64);
    let quantile = |a: f64, b: f64, p: f64| Beta::new(a, b).ok().map(|beta| beta.inverse_cdf(p));
    let low = quantile(k, n - k + 1.0, 0.05).unwrap_or(0.0);
    let high = quantile(k + 1.0, n - k, 0.95).unwrap_or(1.0);
    (low, high)
}

/// Three significant digits, no exponent between 10⁻³ and 10⁵.
pub(crate) fn three(x: f64) -> String {
    if !x.is_finite() {
        return "—".to_owned();
    }
    if x == 0.0 {
        return "0".to_owned();
    }
    let exponent = x.abs().log10().floor() as i32;
    if !(-3..5).contains(&exponent) {
        return format!("{x:.1e}");
    }
    format!("{x:.*}", (2 - exponent).max(0) as usize)
}

/// A number that may not exist.
pub(crate) fn three_or_dash(x: Option<f64>) -> String {
    x.map_or_else(|| "—".to_owned(), three)
}

/// `0.987 ± 0.004`.
pub(crate) fn with_error(value: Option<f64>, error: Option<f64>) -> String {
    match (value, error) {
        (Some(v), Some(e)) => format!("{v:.3} ± {e:.3}"),
        (Some(v), None) => format!("{v:.3}"),
        _ => "—".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_of_a_probability() {
        // None of n: 1 − 0.05^(1/n)
        let (low, high) = probability(0, 2995);
        assert_eq!(low, 0.0);
        assert!(
            (high - (1.0 - 0.05_f64.powf(1.0 / 2995.0))).abs() < 1e-9,
            "{high}"
        );
        // All of n, by symmetry.
        let (low, high) = probability(10, 10);
        assert_eq!(high, 1.0);
        assert!((low - 0.05_f64.powf(0.1)).abs() < 1e-9, "{low}");
    }

    #[test]
    fn three_digits() {
        for (x, text) in [
            (0.0, "0"),
            (0.001234, "0.00123"),
            (1.0, "1.00"),
            (94.37, "94.4"),
            (1234.5, "1234"),
            (1.5e-7, "1.5e-7"),
            (f64::NAN, "—"),
        ] {
            assert_eq!(three(x), text);
        }
    }
}
