//! What is known of every sample: its covariance, from a file or from the noise along the line of sight, and the weight of its row.
//!
//! ```text
//! Σ = σ² (I − u uᵀ) + σ_s² u uᵀ,      u = (x − camera) / |x − camera|                                  (1)
//! ```
//!
//! A stereo tracker knows a point three to five times worse along its sight than across; [`crate::cor`] weighs by it where the estimator can.

use std::path::Path;

use nalgebra::{Matrix3, Point3};

use crate::error::FitError;
use crate::{TableRequest, Track, data, usage};

/// The entries of a symmetric matrix in a file of covariances.
const ENTRIES: [(&str, usize, usize); 6] = [
    ("xx", 0, 0),
    ("xy", 0, 1),
    ("xz", 0, 2),
    ("yy", 1, 1),
    ("yz", 1, 2),
    ("zz", 2, 2),
];
const MM2: f64 = 1e-6;

/// Marker × row, m²; empty where nothing was stated.
pub(crate) fn covariances(
    request: &TableRequest,
    markers: &[Track],
    rows: &[u64],
) -> Result<Vec<Vec<Matrix3<f64>>>, FitError> {
    match (&request.covariances, request.sight_m) {
        (None, None) => Ok(Vec::new()),
        (Some(_), Some(_)) => Err(usage(
            "--covariances and --sigma-sight-mm both state the noise",
            "give one of them",
        )),
        (Some(file), None) => from_file(file, markers, rows.len()),
        (None, Some(along)) => {
            let across = request.sigma_m.ok_or_else(|| {
                usage(
                    "--sigma-sight-mm is the noise along the line of sight alone",
                    "state the noise across it with --sigma-mm",
                )
            })?;
            for (name, value) in [("--sigma-sight-mm", along), ("--sigma-mm", across)] {
                if !(value.is_finite() && value > 0.0) {
                    return Err(usage(
                        format!("{name} is {}", value * 1e3),
                        "give a noise above zero",
                    ));
                }
            }
            let seen = |x: &Point3<f64>| along_sight(x, &request.camera_m, across, along);
            Ok(markers
                .iter()
                .map(|(_, track)| {
                    let all = track.iter();
                    all.map(|x| x.as_ref().map_or_else(Matrix3::identity, seen))
                        .collect()
                })
                .collect())
        }
    }
}

/// How many readings each row is worth, from the column `weight` of a CSV; empty where no file was given.
pub(crate) fn weights(file: Option<&Path>, rows: usize) -> Result<Vec<f64>, FitError> {
    const COLUMN: &str = "weight";
    let Some(file) = file else {
        return Ok(Vec::new());
    };
    let (header, records) = read(file, "a CSV with the column `weight`")?;
    let column = column(file, &header, COLUMN, "one line for each row of the table")?;
    let mut out = Vec::with_capacity(rows);
    for (row, record) in records.iter().enumerate() {
        let cell = record.get(column).unwrap_or("");
        let weight = cell
            .parse()
            .ok()
            .filter(|w: &f64| w.is_finite() && *w >= 0.0);
        out.push(weight.ok_or_else(|| {
            data(
                file,
                format!(
                    "line {}: the weight is `{cell}`, no number from 0 up",
                    row + 2
                ),
                "say how many readings the row is worth; 0 leaves it out",
            )
        })?);
    }
    same_rows(file, out.len(), rows)?;
    Ok(out)
}

fn read(
    file: &Path,
    remedy: &str,
) -> Result<(csv::StringRecord, Vec<csv::StringRecord>), FitError> {
    let unreadable = |error: csv::Error| data(file, error.to_string(), format!("give {remedy}"));
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(file)
        .map_err(unreadable)?;
    let header = reader.headers().map_err(unreadable)?.clone();
    let records = reader
        .records()
        .collect::<Result<_, _>>()
        .map_err(unreadable)?;
    Ok((header, records))
}

fn column(
    file: &Path,
    header: &csv::StringRecord,
    name: &str,
    remedy: &str,
) -> Result<usize, FitError> {
    header
        .iter()
        .position(|h| h == name)
        .ok_or_else(|| data(file, format!("has no column `{name}`"), remedy))
}

fn same_rows(file: &Path, lines: usize, rows: usize) -> Result<(), FitError> {
    if lines == rows {
        return Ok(());
    }
    Err(data(
        file,
        format!("has {lines} lines, the table {rows} rows"),
        "one line for each row of the table",
    ))
}

/// (1).
fn along_sight(x: &Point3<f64>, camera: &Point3<f64>, across: f64, along: f64) -> Matrix3<f64> {
    let u = (x - camera).try_normalize(0.0).unwrap_or_default();
    Matrix3::identity() * (across * across) + u * u.transpose() * (along * along - across * across)
}

/// Columns `<marker>.xx_mm2` to `<marker>.zz_mm2`, one line for each row of the table.
fn from_file(
    file: &Path,
    markers: &[Track],
    rows: usize,
) -> Result<Vec<Vec<Matrix3<f64>>>, FitError> {
    let (header, records) = read(
        file,
        "a CSV with the columns <marker>.xx_mm2, xy, xz, yy, yz, zz",
    )?;
    let mut columns = Vec::new();
    for (marker, _) in markers {
        let mut of_marker = [0; 6];
        for (at, (entry, ..)) in of_marker.iter_mut().zip(ENTRIES) {
            *at = column(
                file,
                &header,
                &format!("{marker}.{entry}_mm2"),
                "six columns are needed for every marker that is used: xx, xy, xz, yy, yz, zz",
            )?;
        }
        columns.push(of_marker);
    }
    let mut out = vec![Vec::with_capacity(rows); markers.len()];
    for (row, record) in records.iter().enumerate() {
        for (p, ((marker, track), at)) in markers.iter().zip(&columns).enumerate() {
            let lost = track.get(row).is_none_or(Option::is_none);
            let mut sigma = Matrix3::identity();
            for (&column, (entry, i, j)) in at.iter().zip(ENTRIES) {
                let cell = record.get(column).unwrap_or("");
                if lost && cell.is_empty() {
                    continue;
                }
                let value: f64 = cell.parse().map_err(|_| {
                    data(
                        file,
                        format!(
                            "line {}: `{marker}.{entry}_mm2` is `{cell}`, no number",
                            row + 2
                        ),
                        "every sample that is seen needs its covariance in mm²",
                    )
                })?;
                sigma[(i, j)] = value * MM2;
                sigma[(j, i)] = value * MM2;
            }
            out[p].push(sigma);
        }
    }
    same_rows(file, records.len(), rows)?;
    Ok(out)
}
