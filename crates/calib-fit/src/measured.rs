//! Where the measurements of a request are: in a file, or in the hands of the caller.

use std::path::{Path, PathBuf};

use calib_recording::{Filled, Poses, ReadOptions, read_path};

use crate::error::FitError;
use crate::{data, noise};

/// A table in a file, or one that the caller holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Measured {
    /// A file that a reader understands.
    File(PathBuf),
    /// A table in memory.
    Held(Box<Held>),
}

/// A table in memory.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Held {
    /// The rows; SI.
    pub poses: Poses,
    /// How many readings each row is worth; empty where all are alike.
    pub weights: Vec<f64>,
}

impl From<PathBuf> for Measured {
    fn from(file: PathBuf) -> Self {
        Self::File(file)
    }
}

impl From<Held> for Measured {
    fn from(held: Held) -> Self {
        Self::Held(Box::new(held))
    }
}

impl Measured {
    /// What messages call it.
    pub(crate) fn name(&self) -> &Path {
        match self {
            Self::File(file) => file,
            Self::Held(_) => Path::new("the arrays"),
        }
    }

    pub(crate) fn poses(&self, options: &ReadOptions) -> Result<Poses, FitError> {
        match self {
            Self::File(file) => read_path(file, options)?
                .poses(Filled::Exclude)
                .map_err(|e| data(file, e.to_string(), "give one table")),
            Self::Held(held) => Ok(held.poses.clone()),
        }
    }

    /// How many readings each of `rows` rows is worth: from a file of its own, or as the caller holds them.
    pub(crate) fn weights(&self, file: Option<&Path>, rows: usize) -> Result<Vec<f64>, FitError> {
        let held = match self {
            Self::Held(held) if file.is_none() => &held.weights,
            _ => return noise::weights(file, rows),
        };
        if let Some(row) = held.iter().position(|w| !(w.is_finite() && *w >= 0.0)) {
            return Err(data(
                self.name(),
                format!(
                    "the weight of row {row} is {}, it must be a finite number ≥ 0",
                    held[row]
                ),
                "say how many readings the row is worth; 0 excludes it",
            ));
        }
        if !held.is_empty() && held.len() != rows {
            return Err(data(
                self.name(),
                format!("{} weights for {rows} rows", held.len()),
                "give one weight for each row",
            ));
        }
        Ok(held.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    /// A marker on a sphere about (0.1, 0.2, 0.3) m, one sample of which is lost.
    fn held(weights: Vec<f64>) -> Held {
        let at = |k: usize| {
            let (a, b) = (0.37 * k as f64, 0.71 * k as f64);
            let radius = 0.25;
            Point3::new(
                0.1 + radius * a.cos() * b.sin(),
                0.2 + radius * a.sin() * b.sin(),
                0.3 + radius * b.cos(),
            )
        };
        let track = (0..40).map(|k| (k != 7).then(|| at(k))).collect();
        Held {
            poses: Poses {
                rows: (0..40).collect(),
                markers: [("tip".to_owned(), track)].into(),
                ..Poses::default()
            },
            weights,
        }
    }

    fn fit(weights: Vec<f64>) -> Result<crate::Answer, FitError> {
        crate::cor(&crate::TableRequest {
            file: Some(held(weights).into()),
            ..crate::TableRequest::default()
        })
    }

    #[test]
    fn a_table_in_memory_is_fitted_without_a_file() {
        let answer = fit(Vec::new()).expect("an answer");
        assert!(answer.observable);
        let value: serde_json::Value = serde_json::from_str(&answer.json).expect("JSON");
        let center: Vec<f64> = (value["center_m"].as_array().expect("three").iter())
            .filter_map(serde_json::Value::as_f64)
            .collect();
        for (found, true_one) in center.iter().zip([0.1, 0.2, 0.3]) {
            assert!((found - true_one).abs() < 1e-9, "{center:?}");
        }
        assert_eq!(value["used"], 39);
    }

    /// A table that was written twice says no more than once.
    #[test]
    fn copies_of_rows_count_once() {
        let once = held(Vec::new());
        let mut twice = once.clone();
        twice.poses.rows = (0..80).collect();
        let track = twice.poses.markers.get_mut("tip").expect("a marker");
        let again = track.clone();
        track.extend(again);
        let fit = |held: Held| {
            let answer = crate::cor(&crate::TableRequest {
                file: Some(held.into()),
                ..crate::TableRequest::default()
            });
            answer.expect("an answer")
        };
        let (once, twice) = (fit(once), fit(twice));
        let note = "  39 rows repeat earlier ones to the last digit: each counts once\n";
        assert!(twice.text.contains(note), "{}", twice.text);
        assert_eq!(twice.text.replace(note, ""), once.text);
        let value: serde_json::Value = serde_json::from_str(&twice.json).expect("JSON");
        assert_eq!((&value["used"], &value["copies"]), (&39.into(), &39.into()));
    }

    #[test]
    fn weights_that_do_not_fit_are_refused_with_the_row() {
        let said = |weights: Vec<f64>| fit(weights).expect_err("refused").to_string();
        assert!(said(vec![1.0; 39]).starts_with("the arrays: 39 weights for 40 rows"));
        let mut negative = vec![1.0; 40];
        negative[3] = -1.0;
        assert!(said(negative).contains("the weight of row 3 is -1"));
    }
}
