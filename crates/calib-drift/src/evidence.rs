//! One calibration's side of the comparison: U, x̃, and the numbers to be compared.

use std::collections::{BTreeMap, BTreeSet};

use calib_finding::{Fact, catalog};
use calib_geometry::decompose;
use calib_report::{DataInformation, Parameter, Report, Unit, Verdict};
use nalgebra::{DMatrix, DVector};

use crate::error::DriftError;
use crate::freedom::degrees_of_freedom;

/// A number whose change is of interest: gradient in the evidence's parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Number {
    /// Stable name.
    pub name: String,
    /// In words.
    pub text: String,
    /// Its unit.
    pub unit: Unit,
    /// Value at the estimate, with the prior.
    pub value: f64,
    /// Derivative by the parameters, scaled as the columns of [`Evidence::root`].
    pub gradient: DVector<f64>,
    /// Free of any choice of frames.
    pub gauge_free: bool,
    /// A displacement from the nominal URDF.
    pub displaces: bool,
}

/// What one calibration knows.
#[derive(Debug, Clone)]
pub struct Evidence {
    /// Its file, for messages.
    pub file: String,
    /// The robot's name.
    pub robot: String,
    /// SHA-256 of the nominal URDF that it started from.
    pub description: String,
    /// Whether it was rejected.
    pub rejected: bool,
    /// Effects that its residuals show and its model lacks.
    pub lacking: Vec<String>,
    /// SHA-256 of the recordings.
    pub recordings: BTreeSet<String>,
    /// Parameters, by column.
    pub parameters: Vec<String>,
    /// Whether a parameter belongs to the robot and not to where tracker and bodies stood.
    pub of_robot: Vec<bool>,
    /// U with its columns scaled to 1°, 1 cm and the like.
    pub root: DMatrix<f64>,
    /// The scales: parameter = scaled · scale.
    pub scale: DVector<f64>,
    /// U x̃, whitened.
    pub seen: DVector<f64>,
    /// x̂, scaled.
    pub found: DVector<f64>,
    /// x̃ − x̂, scaled, of least norm.
    pub without_prior: DVector<f64>,
    /// The part of it along directions that the data see well.
    pub credible_step: DVector<f64>,
    /// Singular values and directions of `root`.
    pub singular: DVector<f64>,
    /// Columns are directions.
    pub directions: DMatrix<f64>,
    /// How many the data see.
    pub rank: usize,
    /// How many the data see so well that the linear step to what the data alone say is to be believed.
    pub credible: usize,
    /// Columns whose product with their transpose is the covariance of what the data do not see.
    pub gauges: DMatrix<f64>,
    /// Degrees of freedom of the noise: those of the level that is known worst.
    pub degrees_of_freedom: f64,
    /// Degrees of freedom of all residuals together.
    pub of_residuals: f64,
    /// What can be compared.
    pub numbers: Vec<Number>,
}

/// As in `calib-core`: a direction below this share of the strongest is a gauge.
pub(super) const NULL: f64 = calib_core::NULL_TOLERANCE;

/// A direction that the data alone leave open by more than this (scaled: 1°, 1 cm and the like) bends over that distance: a linear step
/// along it means nothing.
const CREDIBLE: f64 = 1.0;

fn scale(unit: Unit) -> f64 {
    match unit {
        Unit::Meter => 0.01,
        Unit::Radian => 1_f64.to_radians(),
        Unit::Second | Unit::One | Unit::RadianPerSecond => 0.01,
        // Compliances.
        _ => 1e-4,
    }
}

/// P (x̂ − x₀), scaled: how the priors pull at the estimate.
fn pull(info: &DataInformation, parameters: &[&Parameter], scale: &DVector<f64>) -> DVector<f64> {
    DVector::from_iterator(
        parameters.len(),
        parameters.iter().enumerate().map(|(i, p)| {
            info.prior_sigma[i].map_or(0.0, |sigma| {
                (p.value - p.nominal) / (sigma * sigma) * scale[i]
            })
        }),
    )
}

/// Columns whose product with their transpose is the covariance of what the data do not see, by the priors alone: N (Nᵀ P N)⁻¹ Nᵀ.
fn gauges(null: &DMatrix<f64>, info: &DataInformation, scale: &DVector<f64>) -> DMatrix<f64> {
    /// Without a prior a gauge is anywhere within this, scaled: 1 m, 100°.
    const ANYWHERE: f64 = 100.0;
    let weights = info.prior_sigma.iter().zip(scale.iter());
    let weights = weights.map(|(sigma, scale)| sigma.map_or(0.0, |sigma| (scale / sigma).powi(2)));
    let weights = DVector::from_iterator(scale.len(), weights);
    let mut weighted = null.clone();
    for (r, weight) in weights.iter().enumerate() {
        weighted.row_mut(r).scale_mut(*weight);
    }
    let eigen = decompose::symmetric_eigen(&null.tr_mul(&weighted));
    let mut columns = null * &eigen.vectors;
    for (k, value) in eigen.values.iter().enumerate() {
        let precision = value.max(0.0) + ANYWHERE.powi(-2);
        columns.column_mut(k).unscale_mut(precision.sqrt());
    }
    columns
}

/// SHA-256 of the nominal URDF; empty where the report does not tell.
fn description(report: &Report) -> String {
    report
        .outputs
        .iter()
        .find_map(|o| o.changes.clone())
        .and_then(|path| report.inputs.iter().find(|i| i.path == path))
        .map(|i| i.sha256.clone())
        .unwrap_or_default()
}

/// SHA-256 of the files that were recorded: not those of profile, URDF and meshes.
fn recordings(report: &Report) -> BTreeSet<String> {
    let written = ["yaml", "yml", "urdf", "xacro", "stl", "dae", "obj"];
    let inputs = report.inputs.iter();
    let recorded = inputs.filter(|i| {
        !written
            .iter()
            .any(|ext| i.path.ends_with(&format!(".{ext}")))
    });
    recorded.map(|i| i.sha256.clone()).collect()
}

/// The parameters that `missing-physics` names.
fn lacking(report: &Report) -> Vec<String> {
    let of = report
        .findings
        .iter()
        .filter(|f| f.id == catalog::MISSING_PHYSICS);
    let names = of.filter_map(|f| f.facts.get("parameter").and_then(Fact::word));
    names.map(str::to_owned).collect()
}

/// Whether a parameter of this kind is a displacement from the nominal URDF; effects of joints are 0 in every URDF.
fn displaces(kind: &str) -> bool {
    ["translation", "rotation", "zero_offset", "point"].contains(&kind)
}

/// Refuses parameters that follow loads or the approach where a report does not state their signs.
fn signs_are_known(
    info: &DataInformation,
    parameters: &[&Parameter],
    file: &str,
) -> Result<(), DriftError> {
    /// Kinds of parameters that existed when the signs were the other ones.
    const SIGNED: [&str; 3] = ["torque_compliance", "lateral_compliance", "backlash"];
    let signed = parameters
        .iter()
        .filter(|p| SIGNED.contains(&p.kind.as_str()));
    let signed: Vec<String> = signed.map(|p| format!("`{}`", p.name)).collect();
    if info.effect_signs.is_some() || signed.is_empty() {
        return Ok(());
    }
    Err(DriftError::OldSigns {
        file: file.to_owned(),
        parameters: signed,
    })
}

impl Evidence {
    /// From a report.
    ///
    /// # Errors
    /// [`DriftError`] for a report without `data_information`, or one whose tables do not fit together.
    pub fn of(report: &Report, file: &str) -> Result<Self, DriftError> {
        let Some(info) = &report.data_information else {
            return Err(DriftError::NoInformation {
                file: file.to_owned(),
            });
        };
        let damaged = || DriftError::Inconsistent {
            file: file.to_owned(),
        };
        let n = info.parameters.len();
        let fits = n > 0
            && info.prior_sigma.len() == n
            && info.root.len() == n
            && info
                .root
                .iter()
                .enumerate()
                .all(|(r, row)| row.len() == n - r);
        if !fits {
            return Err(damaged());
        }
        let known: BTreeMap<&str, &calib_report::Parameter> = report
            .parameters
            .iter()
            .map(|p| (p.name.as_str(), p))
            .collect();
        let parameters: Option<Vec<_>> = info
            .parameters
            .iter()
            .map(|name| known.get(name.as_str()).copied())
            .collect();
        let parameters = parameters.ok_or_else(damaged)?;
        signs_are_known(info, &parameters, file)?;
        let scale = DVector::from_iterator(n, parameters.iter().map(|p| scale(p.unit)));
        let mut root = DMatrix::zeros(n, n);
        for (r, row) in info.root.iter().enumerate() {
            for (k, x) in row.iter().enumerate() {
                root[(r, r + k)] = x * scale[r + k];
            }
        }
        let pull = pull(info, &parameters, &scale);
        let svd = decompose::svd(&root);
        let rank = decompose::rank(&svd.s, NULL);
        let gauges = gauges(&svd.v.columns(rank, n - rank).into_owned(), info, &scale);
        let well = |s: &&f64| **s * CREDIBLE >= 1.0;
        let credible = svd.s.iter().take(rank).filter(well).count();
        // Uᵀ r = P (x̂ − x₀),  U (x̃ − x̂) = r
        let mut r = DVector::zeros(n);
        let mut without_prior = DVector::zeros(n);
        let mut credible_step = DVector::zeros(n);
        for i in 0..rank {
            let along = svd.v.column(i).dot(&pull) / svd.s[i];
            r += svd.u.column(i) * along;
            without_prior += svd.v.column(i) * (along / svd.s[i]);
            if i + 1 == credible {
                credible_step.copy_from(&without_prior);
            }
        }
        let found = DVector::from_iterator(
            n,
            parameters
                .iter()
                .enumerate()
                .map(|(i, p)| p.value / scale[i]),
        );
        let seen = &root * &found + r;
        let finite = [&seen, &without_prior, &pull]
            .iter()
            .all(|v| v.iter().all(|x| x.is_finite()));
        if !finite {
            return Err(damaged());
        }
        let mut evidence = Self {
            file: file.to_owned(),
            robot: report.robot.clone(),
            description: description(report),
            rejected: report.verdict == Verdict::Rejected,
            lacking: lacking(report),
            recordings: recordings(report),
            of_robot: parameters.iter().map(|p| p.joint.is_some()).collect(),
            parameters: info.parameters.clone(),
            root,
            scale,
            seen,
            found,
            without_prior,
            credible_step,
            singular: svd.s,
            directions: svd.v,
            rank,
            credible,
            gauges,
            degrees_of_freedom: degrees_of_freedom(info, report),
            of_residuals: info.degrees_of_freedom,
            numbers: Vec::new(),
        };
        evidence.numbers = numbers(info, &parameters, &evidence.scale);
        Ok(evidence)
    }

    /// Is there a parameter of the robot with this name?
    #[must_use]
    pub fn has_of_robot(&self, name: &str) -> bool {
        let mut all = self.parameters.iter().zip(&self.of_robot);
        all.any(|(other, robot)| *robot && other == name)
    }

    /// Does the data alone determine this number?
    ///
    /// Axes that are nearly parallel lie to each other as they do at one place along them, and that place is a convention: with a tilt of 0.1° a step of
    /// 1 cm along an upper arm of 0.6 m turns the normal by 3e-5 rad. What gauges move so little is known, with a σ that contains it.
    #[must_use]
    pub fn determines(&self, number: &Number) -> bool {
        /// A share in the null space below this is rounding; as in `calib-core`.
        const INDETERMINATE: f64 = 1e-5;
        /// What robots' parallel axes stay below: an arm with a tilt of 0.1° has 1e-4, a SCARA whose axes are tilted by 0.15° has 4e-3.
        const NEARLY: f64 = 1e-2;
        let norm = number.gradient.norm();
        let along = (self.rank..self.parameters.len()).map(|i| self.along(i, number).powi(2));
        let leak = along.sum::<f64>().sqrt();
        let limit = if number.gauge_free {
            NEARLY
        } else {
            INDETERMINATE
        };
        norm > 0.0 && leak <= limit * norm
    }

    /// Variance of a number in the directions that the data see.
    fn by_data(&self, number: &Number) -> f64 {
        let along = (0..self.rank).map(|i| self.along(i, number) / self.singular[i]);
        along.map(|share| share.powi(2)).sum()
    }

    /// By how much a number changes with a unit step along a direction.
    fn along(&self, direction: usize, number: &Number) -> f64 {
        self.directions.column(direction).dot(&number.gradient)
    }

    /// Value and variance of a number by the data alone.
    #[must_use]
    pub fn estimate(&self, number: &Number) -> (f64, f64) {
        let variance = self.by_data(number) + self.gauges.tr_mul(&number.gradient).norm_squared();
        (
            number.value + number.gradient.dot(&self.without_prior),
            variance,
        )
    }

    /// Numbers as rows of a matrix whose product with its transpose is their covariance by the data alone.
    #[must_use]
    pub(super) fn of_numbers<'n>(&self, numbers: impl Iterator<Item = &'n Number>) -> DMatrix<f64> {
        let rows: Vec<_> = numbers
            .map(|number| {
                let by_data = |i: usize| self.along(i, number) / self.singular[i];
                let of_gauges = self.gauges.tr_mul(&number.gradient);
                let all = (0..self.rank).map(by_data).chain(of_gauges.iter().copied());
                DVector::from_iterator(self.parameters.len(), all).transpose()
            })
            .collect();
        DMatrix::from_rows(&rows)
    }

    /// Whether the linear step from the estimate to what the data alone say is short enough for this number to be believed.
    #[must_use]
    pub fn is_credible(&self, number: &Number) -> bool {
        if !matches!(number.unit, Unit::Radian | Unit::Meter) {
            return true;
        }
        let value = self.estimate(number).0;
        let limit = CREDIBLE * scale(number.unit);
        self.by_data(number).sqrt() <= limit && (value - number.value).abs() <= limit
    }

    /// Directions that the data see too badly for a linear step.
    #[must_use]
    pub fn not_credible(&self) -> usize {
        self.rank - self.credible
    }

    /// A, A x̃ − A x_ref and x̃ − x_ref of the robot's own parameters, in the order of `names`: what is left when tracker and
    /// bodies may stand anywhere. `reference` is x_ref by name, scaled.
    #[must_use]
    pub(super) fn of_robot(&self, names: &[&str], reference: &DVector<f64>) -> Side {
        let column = |name: &&str| self.parameters.iter().position(|p| p == name);
        let shared: Vec<usize> = names.iter().filter_map(column).collect();
        let rest: Vec<usize> = (0..self.parameters.len())
            .filter(|i| !shared.contains(i))
            .collect();
        let (root, seen) = self.credibly_seen();
        let mut a = root.select_columns(&shared);
        let mut y = seen - &a * reference;
        if !rest.is_empty() {
            let svd = decompose::svd(&root.select_columns(&rest));
            let q = svd.u.columns(0, decompose::rank(&svd.s, NULL)).into_owned();
            a -= &q * (q.transpose() * &a);
            y -= &q * (q.transpose() * &y);
        }
        let from_reference = DVector::from_iterator(
            shared.len(),
            shared
                .iter()
                .enumerate()
                .map(|(k, &i)| self.found[i] + self.credible_step[i] - reference[k]),
        );
        Side {
            a,
            y,
            from_reference,
        }
    }

    /// U and U x̃ without the directions that the data see badly.
    fn credibly_seen(&self) -> (DMatrix<f64>, DVector<f64>) {
        if self.not_credible() == 0 {
            return (self.root.clone(), self.seen.clone());
        }
        let v = self.directions.columns(0, self.credible);
        // Left singular vectors, times the singular values.
        let us = &self.root * v;
        let mut seen = DVector::zeros(self.seen.len());
        for (i, column) in us.column_iter().enumerate() {
            seen += column * (column.dot(&self.seen) / self.singular[i].powi(2));
        }
        (us * v.transpose(), seen)
    }

    /// x̂ of some parameters, scaled.
    #[must_use]
    pub(super) fn found(&self, names: &[&str]) -> DVector<f64> {
        let place = |name: &&str| self.parameters.iter().position(|p| p == name);
        DVector::from_iterator(
            names.len(),
            names
                .iter()
                .map(|name| place(name).map_or(0.0, |i| self.found[i])),
        )
    }
}

/// One calibration's part of equation (1), tracker and bodies projected out.
#[derive(Debug, Clone)]
pub(super) struct Side {
    /// A, whitened rows by shared parameters.
    pub a: DMatrix<f64>,
    /// What the data say, A (x̃ − x_ref).
    pub y: DVector<f64>,
    /// x̃ − x_ref.
    pub from_reference: DVector<f64>,
}

/// The invariants, and every parameter of the robot by itself.
fn numbers(
    info: &calib_report::DataInformation,
    parameters: &[&calib_report::Parameter],
    scale: &DVector<f64>,
) -> Vec<Number> {
    let n = parameters.len();
    let mut numbers: Vec<Number> = info
        .quantities
        .iter()
        .map(|q| {
            let mut gradient = DVector::zeros(n);
            for term in &q.gradient {
                if let Some(i) = info.parameters.iter().position(|p| *p == term.parameter) {
                    gradient[i] = term.coefficient * scale[i];
                }
            }
            Number {
                name: q.name.clone(),
                text: q.text.clone(),
                unit: q.unit,
                value: q.value,
                gradient,
                gauge_free: true,
                displaces: false,
            }
        })
        .collect();
    // Where a name stands for several numbers, as in reports of earlier versions of robots that branch, none is known by it.
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for number in &numbers {
        *counts.entry(number.name.clone()).or_default() += 1;
    }
    numbers.retain(|number| counts[&number.name] == 1);
    for (i, p) in parameters.iter().enumerate() {
        if p.joint.is_none() {
            continue;
        }
        let mut gradient = DVector::zeros(n);
        gradient[i] = scale[i];
        numbers.push(Number {
            name: p.name.clone(),
            text: p.name.clone(),
            unit: p.unit,
            value: p.value,
            gradient,
            gauge_free: false,
            displaces: displaces(&p.kind),
        });
    }
    numbers
}
