//! The tests: everything at once, and number by number.

use calib_estimator::chance;
use calib_geometry::decompose;
use calib_report::Unit;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::FALSE_ALARMS;
use crate::error::DriftError;
use crate::evidence::{Evidence, NULL, Number, Side};
use crate::freedom::combined;

/// A number that both calibrations know.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Changed {
    /// Stable name: `distance.shoulder.elbow`, `elbow.compliance`.
    pub name: String,
    /// In words.
    pub text: String,
    /// Of the numbers.
    pub unit: Unit,
    /// By the old data alone.
    pub old: f64,
    /// By the new data alone.
    pub new: f64,
    /// new − old; angles by the shorter way round.
    pub change: f64,
    /// σ of the change.
    pub sigma: f64,
    /// Degrees of freedom of σ, by Welch and Satterthwaite.
    pub degrees_of_freedom: f64,
    /// Probability of such a change where nothing changed, for this number alone.
    pub p_value: f64,
    /// The same for the whole list (Holm).
    pub p_adjusted: f64,
    /// p-value if the noise were known as well as all residuals together show it.
    #[serde(skip)]
    pub(crate) p_of_known_noise: f64,
    /// Said to have changed.
    pub significant: bool,
    /// Free of any choice of frames.
    pub gauge_free: bool,
}

/// The test of everything at once.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Joint {
    /// Squared Mahalanobis distance, eq. (1).
    pub statistic: f64,
    /// How many directions both data see.
    pub degrees_of_freedom: usize,
    /// Of the noise of both, combined.
    pub noise_degrees_of_freedom: f64,
    /// Probability of such a distance where nothing changed.
    pub p_value: f64,
    /// The same if the noise were known as well as all residuals together show it.
    #[serde(skip)]
    pub(crate) p_of_known_noise: f64,
    /// Said to have changed.
    pub significant: bool,
}

/// Why it is not decided whether anything changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Undecided {
    /// One of them estimates parameters that the other holds at their nominal values, and what they differ by may be these.
    OtherParameters,
    /// They differ by more than the noise as it was found explains, but a level of it is known from too few data.
    NoiseHardlyKnown,
}

/// What two calibrations say together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Drift {
    /// Version of these keys: 1.
    pub calib_drift: u32,
    /// The robot.
    pub robot: String,
    /// The old report.
    pub old: String,
    /// The new one.
    pub new: String,
    /// The probability that an unchanged robot is said to have changed in anything.
    pub false_alarms: f64,
    /// Anything changed.
    pub changed: bool,
    /// Why that is not known.
    pub undecided: Option<Undecided>,
    /// Everything at once.
    pub joint: Joint,
    /// Number by number, most certain first.
    pub numbers: Vec<Changed>,
    /// Numbers of both that only one of the two data determine.
    pub known_in_one: Vec<String>,
    /// Numbers that neither determines without a convention.
    pub known_in_neither: Vec<String>,
    /// Numbers that one of the data leaves open by more than 1° or 1 cm: a linear step over that distance is not believed.
    pub not_credible: Vec<String>,
    /// Directions left out of the test of everything at once for the same reason, in the calibration that has more.
    pub directions_not_credible: usize,
    /// Both start from the same nominal URDF. Otherwise parameters are displacements from different places, and only what no choice of
    /// frames changes, and effects of joints, are compared.
    pub same_nominal: bool,
    /// Which of both were rejected: what their models do not explain may look like a change.
    pub rejected: Vec<String>,
    /// Effects that the residuals of one of them show and its model lacks, by report: what they make of other postures looks like a change.
    pub lacking: Vec<(String, Vec<String>)>,
    /// Both were made from the same recordings.
    pub same_recordings: bool,
    /// Parameters that only the old calibration had.
    pub only_old: Vec<String>,
    /// Parameters that only the new one has.
    pub only_new: Vec<String>,
}

/// Compares two calibrations of one robot.
///
/// # Errors
/// [`DriftError`] for two robots, or nothing that can be compared.
pub fn compare(old: &Evidence, new: &Evidence) -> Result<Drift, DriftError> {
    same_robot(old, new)?;
    let same_nominal = old.description == new.description && !old.description.is_empty();
    let named = |of: &Evidence, other: &Evidence| -> Vec<String> {
        of.parameters
            .iter()
            .zip(&of.of_robot)
            .filter(|(name, robot)| **robot && !other.parameters.contains(name))
            .map(|(name, _)| name.clone())
            .collect()
    };
    let (mut known_in_one, mut known_in_neither, mut not_credible) =
        (Vec::new(), Vec::new(), Vec::new());
    let mut pairs = Vec::new();
    for number in &old.numbers {
        let Some(other) = new.numbers.iter().find(|n| n.name == number.name) else {
            continue;
        };
        if !same_nominal && (number.displaces || other.displaces) {
            continue;
        }
        match (old.determines(number), new.determines(other)) {
            (true, true) if !(old.is_credible(number) && new.is_credible(other)) => {
                not_credible.push(number.name.clone());
            }
            (true, true) => pairs.push((number, other)),
            (false, false) => known_in_neither.push(number.name.clone()),
            _ => known_in_one.push(number.name.clone()),
        }
    }
    let joint = if same_nominal {
        joint(old, new)?
    } else {
        of_numbers(old, new, &pairs)?
    };
    let pairs = pairs.into_iter();
    let mut numbers: Vec<Changed> = pairs
        .filter_map(|(number, other)| change(old, number, new, other))
        .collect();
    holm(&mut numbers);
    let (only_old, only_new) = (named(old, new), named(new, old));
    let same_parameters = only_old.is_empty() && only_new.is_empty();
    let differ = joint.significant || numbers.iter().any(|n| n.significant);
    let undecided = match (differ, same_parameters) {
        (true, false) => Some(Undecided::OtherParameters),
        (false, _) => hidden_by_noise(&joint, &numbers).then_some(Undecided::NoiseHardlyKnown),
        (true, true) => None,
    };
    Ok(Drift {
        calib_drift: 1,
        robot: new.robot.clone(),
        old: old.file.clone(),
        new: new.file.clone(),
        false_alarms: FALSE_ALARMS,
        changed: differ && undecided.is_none(),
        undecided,
        joint,
        numbers,
        known_in_one,
        known_in_neither,
        not_credible,
        directions_not_credible: old.not_credible().max(new.not_credible()),
        same_nominal,
        rejected: [old, new]
            .iter()
            .filter(|e| e.rejected)
            .map(|e| e.file.clone())
            .collect(),
        lacking: [old, new]
            .iter()
            .filter(|e| !e.lacking.is_empty())
            .map(|e| (e.file.clone(), e.lacking.clone()))
            .collect(),
        same_recordings: !new.recordings.is_empty() && old.recordings == new.recordings,
        only_old,
        only_new,
    })
}

/// Whether something would have changed if the noise were known.
fn hidden_by_noise(joint: &Joint, numbers: &[Changed]) -> bool {
    let limit = 0.5 * FALSE_ALARMS;
    let of_numbers = numbers.iter().map(|n| n.p_of_known_noise);
    let least = of_numbers.fold(f64::INFINITY, f64::min);
    joint.p_of_known_noise < limit || least * (numbers.len() as f64) < limit
}

fn same_robot(old: &Evidence, new: &Evidence) -> Result<(), DriftError> {
    if old.robot != new.robot {
        return Err(DriftError::OtherRobot {
            old: (old.file.clone(), old.robot.clone()),
            new: (new.file.clone(), new.robot.clone()),
        });
    }
    Ok(())
}

/// Equation (1).
fn joint(old: &Evidence, new: &Evidence) -> Result<Joint, DriftError> {
    let shared: Vec<&str> = old
        .parameters
        .iter()
        .zip(&old.of_robot)
        .filter(|(name, robot)| **robot && new.has_of_robot(name))
        .map(|(name, _)| name.as_str())
        .collect();
    if shared.is_empty() {
        return Err(DriftError::NothingInCommon {
            old: old.file.clone(),
            new: new.file.clone(),
        });
    }
    let reference = 0.5 * (old.found(&shared) + new.found(&shared));
    let mut sides = [
        old.of_robot(&shared, &reference),
        new.of_robot(&shared, &reference),
    ];
    let largest = sides
        .iter()
        .map(|side| decompose::singular_values(&side.a).max())
        .fold(0.0, f64::max);
    // One tolerance for all ranks: a direction counts in the sum if it counts in a part.
    let limit = NULL * largest;
    forget_common_gauges(&mut sides, limit);
    let [Side { a: a1, y: y1, .. }, Side { a: a2, y: y2, .. }] = &sides;
    let mut a = DMatrix::zeros(a1.nrows() + a2.nrows(), shared.len());
    a.rows_mut(0, a1.nrows()).copy_from(a1);
    a.rows_mut(a1.nrows(), a2.nrows()).copy_from(a2);
    let mut y = DVector::zeros(a.nrows());
    // Only what lies in the range of each A says anything about the robot.
    let [of_old, of_new, of_both] = [a1, a2, &a].map(|a| range_of(a, limit));
    y.rows_mut(0, a1.nrows())
        .copy_from(&(&of_old * of_old.tr_mul(y1)));
    y.rows_mut(a1.nrows(), a2.nrows())
        .copy_from(&(&of_new * of_new.tr_mul(y2)));
    let statistic = (&y - &of_both * of_both.tr_mul(&y)).norm_squared();
    let degrees = (of_old.ncols() + of_new.ncols()).saturating_sub(of_both.ncols());
    // s = yᵀ Π y: the diagonal block of Π has the eigenvalues of S₁ S⁻¹ in (3).
    let both = of_both.rows(0, a1.nrows());
    let block = &of_old * of_old.transpose() - both * both.transpose();
    let values = decompose::singular_values(&block);
    let shares: Vec<f64> = values.iter().copied().take(degrees).collect();
    Ok(tested(statistic, &shares, old, new))
}

/// Equation (1) on the numbers that both data determine: x̃₂ − x̃₁ of them, whitened by both covariances.
fn of_numbers(
    old: &Evidence,
    new: &Evidence,
    pairs: &[(&Number, &Number)],
) -> Result<Joint, DriftError> {
    if pairs.is_empty() {
        return Err(DriftError::NothingInCommon {
            old: old.file.clone(),
            new: new.file.clone(),
        });
    }
    let sides = [
        old.of_numbers(pairs.iter().map(|(number, _)| *number)),
        new.of_numbers(pairs.iter().map(|(_, number)| *number)),
    ];
    let covariance = sides.iter().fold(
        DMatrix::zeros(pairs.len(), pairs.len()),
        |sum, spread: &DMatrix<f64>| sum + spread * spread.transpose(),
    );
    let change = DVector::from_iterator(
        pairs.len(),
        pairs.iter().map(|(a, b)| step(old, a, new, b).2),
    );
    // In units of each number's own σ.
    let sigma = covariance.diagonal().map(f64::sqrt);
    let scaled = DMatrix::from_fn(pairs.len(), pairs.len(), |r, c| {
        covariance[(r, c)] / (sigma[r] * sigma[c])
    });
    let change = change.component_div(&sigma);
    let svd = decompose::svd(&scaled);
    let counts: Vec<usize> = (0..svd.s.len())
        .filter(|i| svd.s[*i] > INDEPENDENT)
        .collect();
    let squares = counts
        .iter()
        .map(|&i| svd.v.column(i).dot(&change).powi(2) / svd.s[i]);
    let statistic = squares.sum();
    // Rows of V diag(1/√s): what turns numbers in units of their σ into independent ones of variance 1.
    let mut whiten = svd.v.select_columns(&counts);
    for (k, &i) in counts.iter().enumerate() {
        whiten.column_mut(k).unscale_mut(svd.s[i].sqrt());
    }
    let mut of_old = sides[0].clone();
    for (r, sigma) in sigma.iter().enumerate() {
        of_old.row_mut(r).unscale_mut(*sigma);
    }
    let root = whiten.tr_mul(&of_old);
    let values = decompose::singular_values(&(&root * root.transpose()));
    let shares: Vec<f64> = values.iter().copied().collect();
    Ok(tested(statistic, &shares, old, new))
}

/// A combination of numbers whose variance is below this share of theirs is the same number twice.
const INDEPENDENT: f64 = 1e-6;

/// The test of a squared distance; `shares`: the old calibration's in each of its directions.
fn tested(statistic: f64, shares: &[f64], old: &Evidence, new: &Evidence) -> Joint {
    let degrees = shares.len();
    let freedom = |first: f64, second: f64| match degrees {
        0 => first + second,
        _ => combined(shares, first, second),
    };
    let p_of = |dof: f64| match degrees {
        0 => 1.0,
        _ => chance::f_tail(statistic / degrees as f64, degrees as f64, dof.max(1.0)),
    };
    let dof = freedom(old.degrees_of_freedom, new.degrees_of_freedom);
    let known = freedom(old.of_residuals, new.of_residuals);
    let p_value = p_of(dof);
    Joint {
        statistic,
        degrees_of_freedom: degrees,
        noise_degrees_of_freedom: dof,
        p_value,
        p_of_known_noise: p_of(known),
        significant: p_value < 0.5 * FALSE_ALARMS,
    }
}

/// A gauge of one calibration is treated as a gauge of both where that moves no whitened residual by more than this.
const GAUGE_TILT: f64 = 0.1;

/// Takes the directions out of both sides that neither sees, but for how they bend from one estimate to the other.
///
/// A gauge is a curve; the two null spaces are its tangents at two places, and each side seems to see the other's a little.
/// Left alone, every such pair would cost a direction that both do see.
fn forget_common_gauges(sides: &mut [Side; 2], limit: f64) {
    let null = |a: &DMatrix<f64>| {
        let svd = decompose::svd(a);
        let unseen: Vec<usize> = (0..svd.v.ncols())
            .filter(|i| svd.s.get(*i).is_none_or(|s| *s <= limit))
            .collect();
        svd.v.select_columns(&unseen)
    };
    let (n1, n2) = (null(&sides[0].a), null(&sides[1].a));
    if n1.ncols() == 0 || n2.ncols() == 0 {
        return;
    }
    // Principal vectors, nearest pairs first.
    let svd = decompose::svd(&(n1.transpose() * &n2));
    let mut taken: Vec<DVector<f64>> = Vec::new();
    for i in 0..svd.s.len() {
        let mut middle = &n1 * svd.u.column(i) + &n2 * svd.v.column(i);
        for other in &taken {
            middle -= other * other.dot(&middle);
        }
        let norm = middle.norm();
        // Half of what two unit vectors at a right angle have: these are no pair.
        if norm < std::f64::consts::FRAC_1_SQRT_2 {
            continue;
        }
        middle /= norm;
        let moves =
            |side: &Side| (&side.a * &middle).norm() * side.from_reference.dot(&middle).abs();
        if sides.iter().all(|side| moves(side) <= GAUGE_TILT) {
            taken.push(middle);
        }
    }
    for side in sides {
        for gauge in &taken {
            let seen = &side.a * gauge;
            side.y -= &seen * gauge.dot(&side.from_reference);
            side.a -= &seen * gauge.transpose();
        }
    }
}

/// Orthonormal columns that span the range of A.
fn range_of(a: &DMatrix<f64>, limit: f64) -> DMatrix<f64> {
    let svd = decompose::svd(a);
    let seen: Vec<usize> = (0..svd.s.len()).filter(|i| svd.s[*i] > limit).collect();
    svd.u.select_columns(&seen)
}

/// A number before and after, and its change; angles by the shorter way round.
fn step(
    old: &Evidence,
    old_number: &Number,
    new: &Evidence,
    new_number: &Number,
) -> (f64, f64, f64) {
    let (from, to) = (old.estimate(old_number).0, new.estimate(new_number).0);
    let plain = to - from;
    let change = if old_number.unit == Unit::Radian {
        plain.sin().atan2(plain.cos())
    } else {
        plain
    };
    (from, to, change)
}

/// Equation (2).
fn change(
    old: &Evidence,
    old_number: &Number,
    new: &Evidence,
    new_number: &Number,
) -> Option<Changed> {
    let (from, to, change) = step(old, old_number, new, new_number);
    let (old_variance, new_variance) = (old.estimate(old_number).1, new.estimate(new_number).1);
    let sigma = (old_variance + new_variance).sqrt();
    if !(sigma > 0.0 && change.is_finite() && sigma.is_finite()) {
        return None;
    }
    // t² is F(1, ν), ν by (3).
    let share = old_variance / sigma.powi(2);
    let dof = combined(&[share], old.degrees_of_freedom, new.degrees_of_freedom);
    let known = combined(&[share], old.of_residuals, new.of_residuals);
    let p_of = |dof: f64| chance::f_tail((change / sigma).powi(2), 1.0, dof);
    let p_value = p_of(dof);
    Some(Changed {
        name: old_number.name.clone(),
        text: old_number.text.clone(),
        unit: old_number.unit,
        old: from,
        new: to,
        change,
        sigma,
        degrees_of_freedom: dof,
        p_value,
        p_adjusted: 1.0,
        p_of_known_noise: p_of(known),
        significant: false,
        gauge_free: old_number.gauge_free,
    })
}

/// Holm 1979: the i-th smallest of m probabilities counts m − i times, and none less than one before it.
fn holm(numbers: &mut [Changed]) {
    numbers.sort_by(|a, b| {
        a.p_value.total_cmp(&b.p_value).then(
            (b.change / b.sigma)
                .abs()
                .total_cmp(&(a.change / a.sigma).abs()),
        )
    });
    let m = numbers.len();
    let mut least = 0.0_f64;
    for (i, number) in numbers.iter_mut().enumerate() {
        least = least.max(number.p_value * (m - i) as f64).min(1.0);
        number.p_adjusted = least;
        number.significant = least < 0.5 * FALSE_ALARMS;
    }
}
