//! Lengths of the robot that were all found in one ratio to those of the URDF: a tracker in another unit of length, or a drawing in one.
//!
//! ```text
//! δ_i = s L_i + ε_i,   var ε_i = σ_i² + τ²        τ² from Σ (δ_i − s L_i)²/(σ_i² + τ²) = n − 1        (1)
//! ```
//!
//! with change δ_i ± σ_i of every dimension that is known to 2 mm and its nominal value L_i. τ is the scatter of the robot about its drawing, which
//! dimensions that are nominally 0 show as well (Mandel and Paule 1970). One long link that is wrong makes a slope too: without the longest length
//! the others must show the same one.

use calib_estimator::chance::f_tail;
use calib_finding::{About, Fact, Finding, catalog};
use calib_report::{RobotChange, Unit};

/// Shorter dimensions are not called lengths, m.
const LENGTH: f64 = 0.02;
/// A dimension is known with less than this, m: what the priors hold alone says nothing.
const KNOWN: f64 = 2e-3;
/// Lengths that tell a ratio, beside dimensions that are nominally 0.
const FEWEST: usize = 2;
/// A smaller ratio is within what trackers are sold with.
const SMALLEST: f64 = 5e-4;
/// Probability of chance of the slope, and of that without the longest: of a ratio that is clear, and of one that may be.
const CHANCE: [(&str, f64, f64); 2] = [("clear", 1e-4, 0.01), ("perhaps", 0.01, 0.2)];
/// Slopes with and without the longest length differ by no more, standard errors.
const ALIKE: f64 = 3.0;

/// Nominal value, change and σ, m.
type Dimension = [f64; 3];

/// The slope of equation (1).
struct Slope {
    value: f64,
    sigma: f64,
    chance: f64,
}

/// What is said where all lengths were found in one ratio.
#[must_use]
pub(crate) fn finding(changes: &[RobotChange]) -> Option<Finding> {
    let of = |c: &RobotChange| -> Option<Dimension> {
        let known = |sigma: &f64| c.unit == Unit::Meter && (0.0..KNOWN).contains(sigma);
        let sigma = c.sigma.filter(known)?.max(f64::MIN_POSITIVE);
        Some([c.nominal?, c.change?, sigma])
    };
    let mut all: Vec<Dimension> = changes.iter().filter_map(of).collect();
    all.sort_by(|a, b| b[0].abs().total_cmp(&a[0].abs()));
    let lengths = all.iter().filter(|d| d[0].abs() >= LENGTH).count();
    if lengths < FEWEST {
        return None;
    }
    let (found, rest) = (slope(&all)?, slope(&all[1..])?);
    let alike = (found.value - rest.value).abs() <= ALIKE * rest.sigma;
    if !alike || found.value.abs() < SMALLEST {
        return None;
    }
    let mut kinds = CHANCE.into_iter();
    let (kind, ..) =
        kinds.find(|(_, of_all, of_rest)| found.chance < *of_all && rest.chance < *of_rest)?;
    let finding = Finding::of_kind(catalog::LENGTHS_IN_ONE_RATIO, kind, About::Lengths)
        .with("chance", Fact::ratio(found.chance))
        .with("count", Fact::count(lengths))
        .with("scale", Fact::ratio(found.value))
        .with("sigma", Fact::ratio(found.sigma));
    Some(finding)
}

/// Equation (1), τ² by bisection; `None` for too few dimensions.
fn slope(all: &[Dimension]) -> Option<Slope> {
    const HALVINGS: usize = 60;
    let dof = all.len().checked_sub(1).filter(|dof| *dof > 0)? as f64;
    let at = |tau2: f64| {
        let sums = all.iter().fold((0.0, 0.0), |sums, [l, d, s]| {
            let w = 1.0 / (s * s + tau2);
            (sums.0 + w * l * l, sums.1 + w * l * d)
        });
        let value = sums.1 / sums.0;
        let left = all
            .iter()
            .map(|[l, d, s]| (d - value * l).powi(2) / (s * s + tau2));
        (value, 1.0 / sums.0, left.sum::<f64>())
    };
    let largest = all.iter().map(|d| d[1].powi(2)).fold(0.0, f64::max);
    let (mut low, mut high) = (0.0, largest);
    if at(0.0).2 > dof {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            match at(middle).2 > dof {
                true => low = middle,
                false => high = middle,
            }
        }
    } else {
        high = 0.0;
    }
    let (value, variance, _) = at(high);
    variance.is_finite().then(|| Slope {
        value,
        // τ is known from few dimensions.
        sigma: (variance * (dof / (dof - 2.0).max(1.0))).sqrt(),
        chance: f_tail(value * value / variance, 1.0, dof),
    })
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    fn changes(of: &[Dimension]) -> Vec<RobotChange> {
        let one = |d: &Dimension| RobotChange {
            name: String::new(),
            text: String::new(),
            unit: Unit::Meter,
            nominal: Some(d[0]),
            value: d[0] + d[1],
            change: Some(d[1]),
            sigma: Some(d[2]),
            measured: true,
        };
        of.iter().map(one).collect()
    }

    const LENGTHS: [f64; 6] = [0.65, -0.15, -0.12, 0.4, 0.0, 0.0];
    const ERRORS: [f64; 6] = [3e-4, -4e-4, 2e-4, 5e-4, -6e-4, 1e-4];

    #[test]
    fn one_ratio_of_all_lengths_is_said_and_one_wrong_length_is_not() {
        let scaled = |s: f64| {
            let of = LENGTHS.iter().zip(ERRORS);
            let of: Vec<Dimension> = of.map(|(l, e)| [*l, s * l + e, 1e-4]).collect();
            finding(&changes(&of))
        };
        let found = scaled(-0.01).expect("a ratio");
        let kind = |found: &Finding| {
            found
                .facts
                .get("kind")
                .and_then(Fact::word)
                .map(str::to_owned)
        };
        assert_eq!(kind(&found).as_deref(), Some("clear"));
        let found = scaled(0.004).expect("a ratio");
        assert_eq!(kind(&found).as_deref(), Some("perhaps"));
        let found = scaled(-0.01).expect("a ratio");
        let scale = found.facts.get("scale").and_then(Fact::value);
        assert!((scale.expect("a number") + 0.01).abs() < 2e-3, "{scale:?}");
        assert!(scaled(0.0).is_none());
        // A collaborative arm of seven joints has two lengths between its axes.
        let two: Vec<Dimension> = [0.4, 0.4].iter().map(|l| [*l, 0.008 * l, 1e-4]).collect();
        let with = |zeros: &[f64]| {
            let zeros = zeros.iter().map(|e| [0.0, *e, 1e-4]);
            let all: Vec<Dimension> = two.iter().copied().chain(zeros).collect();
            finding(&changes(&all))
        };
        assert!(with(&ERRORS).is_some());
        assert!(with(&[]).is_none());
        for wrong in 0..4 {
            let of = LENGTHS.iter().zip(ERRORS).enumerate();
            let of: Vec<Dimension> = of
                .map(|(i, (l, e))| [*l, e + if i == wrong { 7e-3 } else { 0.0 }, 1e-4])
                .collect();
            assert!(finding(&changes(&of)).is_none(), "{wrong}");
        }
    }

    /// Robots that scatter about their drawings by 0.3 mm: a warning of 1 in 100 is one of at most 2 in 100 in 2 000, five standard errors above.
    #[test]
    fn right_robots_are_rarely_warned_of() {
        const TRIALS: usize = 2000;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let designs: [&[f64]; 3] = [
            &[0.43, 0.39, 0.11, 0.09, 0.08, 0.0, 0.0, 0.0],
            &[0.4, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            &[0.65, 0.4, 0.15],
        ];
        for lengths in designs {
            let mut warned = 0;
            for _ in 0..TRIALS {
                let error = |l: &f64| {
                    let z: f64 = StandardNormal.sample(&mut rng);
                    [*l, 3.3e-4 * z, 1.5e-4]
                };
                let robot: Vec<Dimension> = lengths.iter().map(error).collect();
                warned += usize::from(finding(&changes(&robot)).is_some());
            }
            assert!(warned <= TRIALS / 50, "{lengths:?}: {warned}");
        }
    }
}
