//! Correlations between the estimates of the parameters that the data determine.

use super::{Plot, PlotKind};
use crate::{Class, DataInformation, Report, number};
use calib_geometry::decompose::{InverseRoot, inverse_root, semidefinite_eigen};
use nalgebra::{DMatrix, DVector};

/// Parameters in the picture: more are not readable.
const MOST: usize = 28;

/// An eigenvalue below this share of the largest is a combination that nothing determines: a convention, in which the
/// parameters of the picture take no part.
const OPEN: f64 = 1e-10;

/// Pairs that the caption names.
const NAMED: usize = 3;

/// A pair correlated by more than this is named: the data hardly distinguish the two.
const STRONG: f64 = 0.9;

pub(super) fn correlation(plots: &mut Vec<Plot>, report: &Report) {
    let Some((names, rows)) = correlations(report) else {
        return;
    };
    let mut description = String::from(
        "Correlation of the estimates of two parameters. Near ± 1 the data determine the two together, but hardly each alone.",
    );
    if let Some(pairs) = strongest(&names, &rows) {
        description = format!("{description} Strongest: {pairs}.");
    }
    plots.push(Plot {
        id: "plot-correlation".into(),
        section: "parameters",
        title: "Correlations of the measured parameters".into(),
        description,
        kind: PlotKind::Matrix {
            value: "correlation [1]".into(),
            names,
            rows,
        },
    });
}

/// Names of the parameters that the data determine, and the lower triangle of their correlations without its diagonal.
///
/// ```text
/// C = (UᵀU + P)⁺,   ρ_ij = C_ij / √(C_ii C_jj)
/// ```
fn correlations(report: &Report) -> Option<(Vec<String>, Vec<Vec<f64>>)> {
    let of = report.data_information.as_ref()?;
    let measured = |name: &String| {
        let mut parameters = report.parameters.iter();
        parameters.any(|p| p.name == *name && p.class == Class::Solid)
    };
    let columns: Vec<usize> = (0..of.parameters.len())
        .filter(|i| measured(&of.parameters[*i]))
        .take(MOST)
        .collect();
    if columns.len() < 2 {
        return None;
    }
    let root = root(of)?.select_rows(&columns);
    let c = &root * root.transpose();
    let rho = |i: usize, j: usize| c[(i, j)] / (c[(i, i)] * c[(j, j)]).sqrt();
    let row = |i: usize| (0..i).map(|j| rho(i, j)).collect();
    let rows: Vec<Vec<f64>> = (0..columns.len()).map(row).collect();
    let finite = rows.iter().flatten().all(|x: &f64| x.is_finite());
    let names = columns.iter().map(|i| of.parameters[*i].clone());
    finite.then(|| (names.collect(), rows))
}

/// A root of (UᵀU + P)⁺ where each parameter is in units of what the data say of it alone: lengths beside angles.
fn root(of: &DataInformation) -> Option<DMatrix<f64>> {
    let n = of.parameters.len();
    let mut u = DMatrix::zeros(n, n);
    for (i, row) in of.root.iter().enumerate().take(n) {
        for (k, value) in row.iter().enumerate().take(n - i) {
            u[(i, i + k)] = *value;
        }
    }
    let mut h = u.transpose() * &u;
    for (i, sigma) in of.prior_sigma.iter().enumerate().take(n) {
        if let Some(sigma) = sigma {
            h[(i, i)] += 1.0 / (sigma * sigma);
        }
    }
    let scale = DVector::from_fn(n, |i, _| {
        if h[(i, i)] > 0.0 {
            h[(i, i)].powf(-0.5)
        } else {
            1.0
        }
    });
    for i in 0..n {
        for j in 0..n {
            h[(i, j)] *= scale[i] * scale[j];
        }
    }
    if h.iter().any(|x| !x.is_finite()) {
        return None;
    }
    // No eigenvalue is larger than the trace, and none smaller than 1/|W|².
    let determined = |of: &InverseRoot| of.root.norm_squared() * h.trace() * OPEN < 1.0;
    if let Some(of) = inverse_root(&h).filter(determined) {
        return Some(of.root);
    }
    let eigen = semidefinite_eigen(&h);
    let least = OPEN * eigen.values.iter().fold(0.0_f64, |a, b| a.max(*b));
    let mut root = eigen.vectors;
    for (mut column, value) in root.column_iter_mut().zip(&eigen.values) {
        column.scale_mut(if *value > least {
            value.powf(-0.5)
        } else {
            0.0
        });
    }
    Some(root)
}

/// `a and b 0.97`, the pairs that are correlated most.
fn strongest(names: &[String], rows: &[Vec<f64>]) -> Option<String> {
    let pairs = rows.iter().enumerate().flat_map(|(i, row)| {
        let row = row.iter().enumerate();
        row.map(move |(j, rho)| (*rho, i, j))
    });
    let mut strong: Vec<(f64, usize, usize)> = pairs.filter(|p| p.0.abs() > STRONG).collect();
    strong.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    let words = strong.iter().take(NAMED).map(|(rho, i, j)| {
        let rho = number::fixed(*rho, 2);
        format!("{} and {} {rho}", names[*j], names[*i])
    });
    let words: Vec<String> = words.collect();
    (!words.is_empty()).then(|| words.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parameter;

    fn report(root: Vec<Vec<f64>>, prior: Vec<Option<f64>>, classes: &[Class]) -> Report {
        let names: Vec<String> = (0..classes.len()).map(|i| format!("p{i}")).collect();
        let parameter = |(name, class): (&String, &Class)| Parameter {
            name: name.clone(),
            class: *class,
            ..Parameter::default()
        };
        Report {
            parameters: names.iter().zip(classes).map(parameter).collect(),
            data_information: Some(DataInformation {
                parameters: names,
                prior_sigma: prior,
                root,
                ..DataInformation::default()
            }),
            ..Report::default()
        }
    }

    #[test]
    fn correlations_are_those_of_the_inverse_of_the_information() {
        // C = [4 1; 1 9]: ρ = 1/6. H = C⁻¹ = [9 −1; −1 4]/35, U = chol(H)ᵀ.
        let h = DMatrix::from_row_slice(2, 2, &[9.0, -1.0, -1.0, 4.0]) / 35.0;
        let u = h.cholesky().expect("positive").l().transpose();
        let root = vec![vec![u[(0, 0)], u[(0, 1)]], vec![u[(1, 1)]]];
        let solid = [Class::Solid; 2];
        let (names, rows) = correlations(&report(root, vec![None, None], &solid)).expect("two");
        assert_eq!(names, ["p0", "p1"]);
        assert_eq!(rows[0].len(), 0);
        assert!((rows[1][0] - 1.0 / 6.0).abs() < 1e-12, "{rows:?}");
    }

    #[test]
    fn priors_count_and_units_do_not_matter() {
        // The data see the sum only; priors of 1 and 2 share it out: ρ = (H⁻¹)₀₁ over the root of its diagonal.
        for unit in [1.0, 1e-6] {
            let root = vec![vec![10.0, 10.0 / unit], vec![0.0]];
            let prior = vec![Some(1.0), Some(2.0 * unit)];
            let (_, rows) = correlations(&report(root, prior, &[Class::Solid; 2])).expect("two");
            let expected = -100.0 / (101.0_f64 * 100.25).sqrt();
            assert!((rows[1][0] - expected).abs() < 1e-9, "{rows:?}");
        }
    }

    #[test]
    fn conventions_are_left_out_and_do_not_disturb() {
        // p1 and p2 are known only by their sum, without priors: conventions. p0 and p3 are measured, independently.
        let root = vec![
            vec![1.0, 0.0, 0.0, 0.0],
            vec![1.0, 1.0, 0.0],
            vec![0.0, 0.0],
            vec![2.0],
        ];
        let classes = [
            Class::Solid,
            Class::Convention,
            Class::Convention,
            Class::Solid,
        ];
        let (names, rows) = correlations(&report(root, vec![None; 4], &classes)).expect("two");
        assert_eq!(names, ["p0", "p3"]);
        assert!(rows[1][0].abs() < 1e-12);
        let one = report(vec![vec![1.0]], vec![None], &[Class::Solid]);
        assert_eq!(correlations(&one), None);
    }

    #[test]
    fn strong_pairs_are_named_strongest_first() {
        let names = ["a", "b", "c"].map(str::to_owned);
        let rows = [vec![], vec![-0.95], vec![0.2, 0.99]];
        let named = strongest(&names, &rows).expect("two pairs");
        assert_eq!(named, "b and c 0.99; a and b −0.95");
        assert_eq!(strongest(&names, &[vec![], vec![0.1]]), None);
    }
}
