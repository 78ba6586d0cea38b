//! The uncertainty budget of the error on a new pose, after the Guide to the expression of uncertainty in measurement (GUM).
//!
//! ```text
//! u_c² = Σ (c_i u(x_i))²,   U = k u_c,   k = 2                                              (1)
//! ν_i = 1 / (2 r_i²),   r_i = σ(u(x_i)) / u(x_i)                    (GUM G.4.2)             (2)
//! u_r² = rms² − Σ (c_i u(x_i))²                  what the held-out errors show beyond all others
//! ν_r = u_r⁴ / (rms⁴/ν_h + Σ (c_i u(x_i))⁴/ν_i),   ν_c = ν_h                                 (3)
//! ν_c = u_c⁴ / Σ (c_i u(x_i))⁴/ν_i               (Welch–Satterthwaite) where u_r = 0        (4)
//! ```
//!
//! All contributions are lengths in space, root mean square over the poses. With u_r the sum is the observed error itself, and
//! has its degrees of freedom ν_h; where the other parts alone exceed it, the sum stays theirs, the larger one.

use crate::{ErrorSource, Noise, NoiseKind, Report, Unit};

/// Coverage factor of the expanded uncertainty.
pub(crate) const COVERAGE_FACTOR: f64 = 2.0;

/// How a standard uncertainty was evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Evaluation {
    /// From the data.
    A,
    /// From what was stated: a data sheet, a prior.
    B,
    /// From the data and from priors.
    AAndB,
}

/// One source of uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BudgetRow {
    pub(crate) kind: ErrorSource,
    pub(crate) evaluation: Evaluation,
    /// u(x), of `unit`.
    pub(crate) u: f64,
    pub(crate) unit: Unit,
    /// ν; `None`: taken as exactly known.
    pub(crate) freedom: Option<f64>,
    /// c, meters per `unit`.
    pub(crate) sensitivity: f64,
    /// |c| u(x), m.
    pub(crate) contribution_m: f64,
}

/// The budget.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Budget {
    pub(crate) rows: Vec<BudgetRow>,
    /// u_c, m.
    pub(crate) combined_m: f64,
    /// ν of u_c; `None`: taken as exactly known.
    pub(crate) freedom: Option<f64>,
    /// u_c without the noise of the tracker's own measurement, m; `None` where that noise is not known.
    pub(crate) robot_m: Option<f64>,
}

impl Budget {
    /// Of a report's headline, its position error on new poses; `None` where that was not verified, or its parts are not known.
    pub(crate) fn of(report: &Report) -> Option<Self> {
        let limits = &report.accuracy_limits;
        let known = |kind: ErrorSource| {
            let mut of_kind = limits.iter().filter(move |limit| limit.kind == kind);
            of_kind.find_map(|limit| limit.sigma_m.filter(|m| *m > 0.0))
        };
        let explained = [
            (ErrorSource::TrackerNoise, tracker as Input),
            (ErrorSource::JointNoise, joints),
            (ErrorSource::Parameters, geometry),
        ];
        let explained = explained.into_iter();
        let explained = explained.filter_map(|(kind, input)| Some(input(report, known(kind)?)));
        let mut rows: Vec<BudgetRow> = explained.collect();
        let squares: f64 = rows.iter().map(|row| row.contribution_m.powi(2)).sum();
        let fourths: f64 = rows.iter().filter_map(fourth).sum();
        let rest = known(ErrorSource::NotModeled);
        let observed = report.verification.held_out.as_ref()?.expected;
        let observed = observed.and_then(|e| Some((e.rms_m, e.degrees_of_freedom?)));
        let combined_m = (squares + rest.unwrap_or(0.0).powi(2)).sqrt();
        if combined_m <= 0.0 || !combined_m.is_finite() {
            return None;
        }
        let all = observed.map_or(0.0, |(rms, freedom)| rms.powi(4) / freedom) + fourths;
        let freedom = match (rest, observed) {
            // (3): the parts add up to what was observed
            (Some(_), Some((_, freedom))) => Some(freedom),
            // (4)
            _ => (fourths > 0.0).then(|| combined_m.powi(4) / fourths),
        };
        rows.extend(rest.map(|rest| BudgetRow {
            kind: ErrorSource::NotModeled,
            evaluation: Evaluation::A,
            u: rest,
            unit: Unit::Meter,
            freedom: (all > 0.0).then(|| rest.powi(4) / all),
            sensitivity: 1.0,
            contribution_m: rest,
        }));
        rows.sort_by(|a, b| b.contribution_m.total_cmp(&a.contribution_m));
        let tracker = known(ErrorSource::TrackerNoise);
        let robot_m = tracker.map(|m| (combined_m.powi(2) - m.powi(2)).max(0.0).sqrt());
        Some(Self {
            rows,
            combined_m,
            freedom,
            robot_m,
        })
    }

    /// U of equation (1), m.
    pub(crate) fn expanded_m(&self) -> f64 {
        COVERAGE_FACTOR * self.combined_m
    }

    /// What noise and the uncertainty of the parameters contribute, m.
    pub(crate) fn stated_m(&self) -> f64 {
        let rows = self.rows.iter();
        let known = rows.filter(|row| row.kind != ErrorSource::NotModeled);
        known
            .map(|row| row.contribution_m.powi(2))
            .sum::<f64>()
            .sqrt()
    }

    /// Share of the variance.
    pub(crate) fn share(&self, row: &BudgetRow) -> f64 {
        (row.contribution_m / self.combined_m).powi(2)
    }
}

/// (c u(x))⁴ / ν.
fn fourth(row: &BudgetRow) -> Option<f64> {
    row.freedom
        .map(|freedom| row.contribution_m.powi(4) / freedom)
}

/// The row of a source from the report and its contribution.
type Input = fn(&Report, f64) -> BudgetRow;

/// Levels of one kind of noise that take part.
fn levels(report: &Report, kind: NoiseKind) -> impl Iterator<Item = (&Noise, f64)> {
    let of_kind = report.noise.iter().filter(move |noise| noise.kind == kind);
    of_kind.filter_map(|noise| Some((noise, noise.sigma.filter(|sigma| *sigma > 0.0)?)))
}

/// Equation (2).
fn freedom(relative_error: f64) -> Option<f64> {
    (relative_error > 0.0).then(|| 0.5 / relative_error.powi(2))
}

/// Noise of one component of a measured position; the length of all three is √3 times it.
fn tracker(report: &Report, contribution_m: f64) -> BudgetRow {
    /// A level that contributes otherwise is that of another kind of measurement.
    const ALIKE: f64 = 1e-6;
    let sqrt_3 = 3.0_f64.sqrt();
    let mut levels = levels(report, NoiseKind::Position);
    let of = levels.find(|(_, sigma)| (sqrt_3 * sigma / contribution_m - 1.0).abs() < ALIKE);
    let (u, error) = of.map_or((contribution_m / sqrt_3, None), |(noise, sigma)| {
        (sigma, noise.relative_error)
    });
    BudgetRow {
        kind: ErrorSource::TrackerNoise,
        evaluation: evaluation(error),
        u,
        unit: Unit::Meter,
        freedom: error.and_then(freedom),
        sensitivity: contribution_m / u,
        contribution_m,
    }
}

fn evaluation(relative_error: Option<f64>) -> Evaluation {
    match relative_error {
        Some(_) => Evaluation::A,
        None => Evaluation::B,
    }
}

/// Noise of a joint's position; its sensitivity is the lever to the body.
fn joints(report: &Report, contribution_m: f64) -> BudgetRow {
    // Of joints that turn and joints that slide there is no common level.
    let slides = levels(report, NoiseKind::Slide).next().is_some();
    let levels: Vec<(&Noise, f64)> = levels(report, NoiseKind::Joint)
        .filter(|_| !slides)
        .collect();
    let squares: f64 = levels.iter().map(|(_, sigma)| sigma * sigma).sum();
    let (u, unit) = match levels.is_empty() {
        true => (contribution_m, Unit::Meter),
        false => ((squares / levels.len() as f64).sqrt(), Unit::Radian),
    };
    // Of the root of the mean of σ²: r² = Σ σ⁴ r² / (Σ σ²)²
    let errors = levels
        .iter()
        .map(|(noise, sigma)| Some(sigma.powi(4) * noise.relative_error?.powi(2)));
    let errors: Option<f64> = errors.sum();
    let error = errors
        .filter(|_| squares > 0.0)
        .map(|sum| sum.sqrt() / squares);
    BudgetRow {
        kind: ErrorSource::JointNoise,
        evaluation: evaluation(error),
        u,
        unit,
        freedom: error.and_then(freedom),
        sensitivity: contribution_m / u,
        contribution_m,
    }
}

/// The covariance of the estimated geometry at the body.
fn geometry(report: &Report, contribution_m: f64) -> BudgetRow {
    let open = report.weak_directions.as_ref();
    let of_priors = open.is_some_and(|open| open.directions.iter().any(|d| d.prior_share > 0.5));
    let of_data = report.data_information.as_ref();
    BudgetRow {
        kind: ErrorSource::Parameters,
        evaluation: if of_priors {
            Evaluation::AAndB
        } else {
            Evaluation::A
        },
        u: contribution_m,
        unit: Unit::Meter,
        freedom: of_data
            .map(|of| of.degrees_of_freedom)
            .filter(|nu| *nu > 0.0),
        sensitivity: 1.0,
        contribution_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AccuracyLimit, ExpectedError, HeldOut, Verification};

    /// A report with these contributions and this observed error.
    fn report(parts: [f64; 4], rms_m: f64) -> Report {
        let kinds = [
            ErrorSource::TrackerNoise,
            ErrorSource::JointNoise,
            ErrorSource::Parameters,
            ErrorSource::NotModeled,
        ];
        let limit = |(kind, m): (ErrorSource, f64)| AccuracyLimit::new(kind, m, 0.0);
        let noise = |kind, sigma: f64, relative_error| Noise {
            kind,
            sigma: Some(sigma),
            relative_error,
            ..Noise::default()
        };
        Report {
            accuracy_limits: kinds.into_iter().zip(parts).map(limit).collect(),
            noise: vec![
                noise(NoiseKind::Position, parts[0] / 3.0_f64.sqrt(), Some(0.05)),
                noise(NoiseKind::Joint, 3e-4, Some(0.1)),
                noise(NoiseKind::Joint, 4e-4, Some(0.1)),
            ],
            verification: Verification {
                held_out: Some(HeldOut {
                    expected: Some(ExpectedError {
                        rms_m,
                        degrees_of_freedom: Some(20.0),
                        ..ExpectedError::default()
                    }),
                    ..HeldOut::default()
                }),
                ..Verification::default()
            },
            ..Report::default()
        }
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-12 * b.abs()
    }

    #[test]
    fn the_budget_adds_up_to_the_stated_uncertainty() {
        let [tracker, joints, geometry] = [5e-4_f64, 3e-4, 1e-4];
        let rms = 8e-4_f64;
        let explained = tracker.powi(2) + joints.powi(2) + geometry.powi(2);
        let rest = (rms.powi(2) - explained).sqrt();
        let budget = Budget::of(&report([tracker, joints, geometry, rest], rms)).expect("parts");
        assert!(close(budget.combined_m, rms), "{}", budget.combined_m);
        assert!(close(budget.expanded_m(), 2.0 * rms));
        let squares: f64 = budget
            .rows
            .iter()
            .map(|r| (r.sensitivity * r.u).powi(2))
            .sum();
        assert!(close(squares.sqrt(), rms), "every row is c·u(x)");
        let shares: f64 = budget.rows.iter().map(|row| budget.share(row)).sum();
        assert!(close(shares, 1.0));
        // It is the observed error, with its degrees of freedom; the rest alone is known less well.
        assert_eq!(budget.freedom, Some(20.0));
        let of_rest = budget
            .rows
            .iter()
            .find(|r| r.kind == ErrorSource::NotModeled);
        let of_rest = of_rest.and_then(|row| row.freedom).expect("estimated");
        assert!(of_rest < 20.0 * (rest / rms).powi(4) + 1e-9, "{of_rest}");
        assert!(close(
            budget.robot_m.expect("known"),
            (rms.powi(2) - tracker.powi(2)).sqrt()
        ));
    }

    #[test]
    fn inputs_carry_the_noise_that_was_found_and_its_degrees_of_freedom() {
        let budget = Budget::of(&report([5e-4, 3e-4, 1e-4, 2e-4], 6.2e-4)).expect("parts");
        let row = |kind| budget.rows.iter().find(|r| r.kind == kind).expect("a row");
        let tracker = row(ErrorSource::TrackerNoise);
        assert!(close(tracker.sensitivity, 3.0_f64.sqrt()) && tracker.evaluation == Evaluation::A);
        assert!(close(tracker.freedom.expect("estimated"), 200.0));
        let joints = row(ErrorSource::JointNoise);
        assert!(close(joints.u, 12.5e-8_f64.sqrt()) && joints.unit == Unit::Radian);
        assert!(close(joints.sensitivity, 3e-4 / 12.5e-8_f64.sqrt()));
        // Two levels known to 10 % each: their mean is known better than one, worse than twice as many readings.
        let freedom = joints.freedom.expect("estimated");
        assert!(freedom > 50.0 && freedom <= 100.0 + 1e-9, "{freedom}");
        assert!(
            budget
                .rows
                .windows(2)
                .all(|w| w[0].contribution_m >= w[1].contribution_m)
        );
    }

    #[test]
    fn parts_that_exceed_the_observed_error_are_stated_as_they_are() {
        let budget = Budget::of(&report([5e-4, 3e-4, 1e-4, 0.0], 4e-4)).expect("parts");
        assert!(close(budget.combined_m, 35e-8_f64.sqrt()) && budget.rows.len() == 3);
        // Welch–Satterthwaite of the two that are estimated.
        let fourths =
            5e-4_f64.powi(4) / 200.0 + 3e-4_f64.powi(4) / budget.rows[1].freedom.unwrap_or(0.0);
        assert!(close(
            budget.freedom.expect("known"),
            35e-8_f64.powi(2) / fourths
        ));
    }

    #[test]
    fn what_was_stated_is_of_type_b_and_what_was_not_verified_has_no_budget() {
        let mut stated = report([5e-4, 3e-4, 1e-4, 2e-4], 6.2e-4);
        stated
            .noise
            .iter_mut()
            .for_each(|noise| noise.relative_error = None);
        let budget = Budget::of(&stated).expect("parts");
        let of_tracker = budget
            .rows
            .iter()
            .find(|r| r.kind == ErrorSource::TrackerNoise);
        let of_tracker = of_tracker.expect("a row");
        assert_eq!(
            (of_tracker.evaluation, of_tracker.freedom),
            (Evaluation::B, None)
        );
        assert_eq!(Budget::of(&Report::default()), None);
        assert_eq!(Budget::of(&report([0.0; 4], 1e-3)), None);
    }
}
