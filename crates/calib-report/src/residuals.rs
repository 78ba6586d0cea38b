use crate::{JointValue, Standardized, Stats, Unit};
use calib_geometry::statistics::quantile_type7;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// One observation compared with the model: predicted − observed. The rows of `residuals.csv`; not part of `report.json`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ResidualRow {
    /// The recording's name, once for all its rows.
    pub recording: Arc<str>,
    /// Row, as the recording numbers it: line from 1 of our own tables, frame of a tracker's file.
    pub row: u64,
    /// Time in the recording, s; `None` for static poses.
    pub time_s: Option<f64>,
    /// The marker, or the body for a pose, once for all rows.
    pub subject: Arc<str>,
    /// predicted − observed, in the tracker frame, m.
    pub residual_m: [f64; 3],
    /// Rotation part for a body's pose, rad; `None` for a marker.
    pub rotation_rad: Option<f64>,
    /// Length of the residual in standard deviations; `None` without a noise model.
    pub normalized: Option<f64>,
    /// Whether it took part in the fit.
    pub used: bool,
    /// Where the joints were: one list for all markers and bodies of a row.
    pub joints: Arc<[JointValue]>,
}

impl ResidualRow {
    /// ‖predicted − observed‖, m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.residual_m.iter().map(|x| x * x).sum::<f64>().sqrt()
    }
}

/// Residuals of the observations that took part in the fit, summarized four ways.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Residuals {
    /// Over all.
    pub all: Option<ResidualGroup>,
    /// Observations that did not take part in the fit; no error below counts them.
    #[serde(default)]
    pub rejected: usize,
    /// Per marker or body, by name.
    pub by_marker: Vec<ResidualGroup>,
    /// Along the tracker's x, y, z: `mean_m` is the signed mean, the others are of magnitudes.
    pub by_direction: Vec<ResidualGroup>,
    /// Over each joint's position.
    pub by_joint: Vec<JointResiduals>,
    /// Over time, or over the row where there is no time; recording by recording.
    pub over_time: Vec<JointResiduals>,
    /// Their distribution in units of their standard deviations; null without a noise model.
    #[serde(default)]
    pub standardized: Option<Standardized>,
}

/// Residual lengths of a group, m.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ResidualGroup {
    /// The marker, body or direction.
    pub name: String,
    /// Observations.
    pub samples: usize,
    /// Observations that did not take part in the fit; the errors do not count them.
    #[serde(default)]
    pub rejected: usize,
    /// Mean length; the signed mean for a direction.
    pub mean_m: f64,
    /// Root of the mean square.
    pub rms_m: f64,
    /// 95 % quantile of the magnitude.
    pub p95_m: f64,
    /// Largest magnitude.
    pub max_m: f64,
}

/// Residuals over one variable, in bins of equal width.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JointResiduals {
    /// The joint, or the recording for residuals over time.
    pub name: String,
    /// SI unit of the variable; 1 for a row number.
    pub unit: Unit,
    /// Bins that hold observations, left to right.
    pub bins: Vec<ResidualBin>,
}

/// One bin.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ResidualBin {
    /// Middle of the bin.
    pub center: f64,
    /// Observations in it.
    pub samples: usize,
    /// Root of the mean square length, m.
    pub rms_m: f64,
    /// Largest length, m.
    pub max_m: f64,
    /// Mean residual vector in the tracker frame, m: a systematic pattern indicates an effect that is not modeled.
    pub mean_m: [f64; 3],
    /// σ of a component of `mean_m` where nothing is systematic, from how the residuals of whole rows scatter, m; null for a
    /// single row.
    #[serde(default)]
    pub mean_sigma_m: Option<f64>,
}

/// Bins over a variable: enough to resolve a systematic pattern of three periods, few enough to have samples in each.
const BINS: usize = 24;

/// A row and its value of the variable.
type At<'a> = (f64, &'a ResidualRow);

impl Residuals {
    /// Summarize the rows that took part in the fit and count the others; rows with non-finite values are excluded.
    #[must_use]
    pub fn from_rows(rows: &[ResidualRow]) -> Self {
        let finite = |row: &&ResidualRow| row.residual_m.iter().all(|x| x.is_finite());
        let (used, rejected): (Vec<&ResidualRow>, Vec<_>) =
            rows.iter().filter(finite).partition(|row| row.used);
        let rejected_of = |name: &str| rejected.iter().filter(|row| &*row.subject == name).count();
        let lengths: Vec<f64> = used.iter().map(|row| row.length_m()).collect();
        let mut by_marker: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        let mut by_joint: BTreeMap<&str, (Unit, Vec<At<'_>>)> = BTreeMap::new();
        let mut over_time: BTreeMap<&str, Vec<&ResidualRow>> = BTreeMap::new();
        for &row in &used {
            by_marker
                .entry(&row.subject)
                .or_default()
                .push(row.length_m());
            over_time.entry(&row.recording).or_default().push(row);
            for joint in row.joints.iter() {
                by_joint
                    .entry(&joint.joint)
                    .or_insert((joint.unit, Vec::new()))
                    .1
                    .push((joint.value, row));
            }
        }
        let over_time = over_time.into_iter().map(|(recording, rows)| {
            let timed = rows.iter().all(|row| row.time_s.is_some());
            let unit = if timed { Unit::Second } else { Unit::One };
            let at = |row: &ResidualRow| row.time_s.filter(|_| timed).unwrap_or(row.row as f64);
            JointResiduals {
                name: recording.to_owned(),
                unit,
                bins: bins(rows.into_iter().map(|row| (at(row), row)).collect()),
            }
        });
        let axis = |i: usize, name: &str| {
            let components: Vec<f64> = used.iter().map(|row| row.residual_m[i]).collect();
            let magnitudes: Vec<f64> = components.iter().map(|x| x.abs()).collect();
            let mean_m = components.iter().sum::<f64>() / components.len().max(1) as f64;
            ResidualGroup::of(name, &magnitudes).map(|group| ResidualGroup {
                mean_m,
                rejected: rejected.len(),
                ..group
            })
        };
        Self {
            all: ResidualGroup::of("all", &lengths).map(|group| ResidualGroup {
                rejected: rejected.len(),
                ..group
            }),
            rejected: rejected.len(),
            by_marker: by_marker
                .into_iter()
                .filter_map(|(name, lengths)| {
                    let rejected = rejected_of(name);
                    let group = ResidualGroup::of(name, &lengths)?;
                    Some(ResidualGroup { rejected, ..group })
                })
                .collect(),
            by_direction: ["x", "y", "z"]
                .iter()
                .enumerate()
                .filter_map(|(i, name)| axis(i, name))
                .collect(),
            by_joint: by_joint
                .into_iter()
                .map(|(name, (unit, rows))| JointResiduals {
                    name: name.to_owned(),
                    unit,
                    bins: bins(rows),
                })
                .collect(),
            over_time: over_time.collect(),
            standardized: None,
        }
    }

    /// The same with their distribution in units of their standard deviations.
    #[must_use]
    pub fn with_standardized(self, standardized: Option<Standardized>) -> Self {
        Self {
            standardized,
            ..self
        }
    }

    /// Whether there are no residuals.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.all.is_none()
    }
}

impl ResidualGroup {
    /// Of magnitudes; `None` when none is finite.
    #[must_use]
    pub fn of(name: impl Into<String>, magnitudes_m: &[f64]) -> Option<Self> {
        let stats = Stats::of(magnitudes_m)?;
        let mut sorted: Vec<f64> = magnitudes_m
            .iter()
            .copied()
            .filter(|x| x.is_finite())
            .collect();
        sorted.sort_by(f64::total_cmp);
        let p95_m = quantile_type7(&sorted, 0.95)?;
        Some(Self {
            name: name.into(),
            samples: sorted.len(),
            rejected: 0,
            mean_m: stats.mean,
            rms_m: stats.rms,
            p95_m,
            max_m: stats.max,
        })
    }
}

fn bins(rows: Vec<At<'_>>) -> Vec<ResidualBin> {
    let rows: Vec<_> = rows.into_iter().filter(|(at, _)| at.is_finite()).collect();
    let from = rows.iter().map(|row| row.0).fold(f64::INFINITY, f64::min);
    let to = rows
        .iter()
        .map(|row| row.0)
        .fold(f64::NEG_INFINITY, f64::max);
    let width = if to > from {
        (to - from) / BINS as f64
    } else {
        0.0
    };
    let variance = variance_of_means(rows.iter().map(|row| row.1));
    let mut parts: BTreeMap<usize, Vec<&ResidualRow>> = BTreeMap::new();
    for (at, row) in rows {
        let bin = if width > 0.0 {
            (((at - from) / width) as usize).min(BINS - 1)
        } else {
            0
        };
        parts.entry(bin).or_default().push(row);
    }
    let summary = |(bin, rows): (usize, Vec<&ResidualRow>)| {
        let lengths: Vec<f64> = rows.iter().map(|row| row.length_m()).collect();
        let stats = Stats::of(&lengths)?;
        let mean_m = std::array::from_fn(|i| {
            rows.iter().map(|row| row.residual_m[i]).sum::<f64>() / rows.len() as f64
        });
        let center = from + (bin as f64 + 0.5) * width;
        Some(ResidualBin {
            center,
            samples: rows.len(),
            rms_m: stats.rms,
            max_m: stats.max,
            mean_m,
            mean_sigma_m: variance.map(|v| (v / rows.len() as f64).sqrt()),
        })
    };
    parts.into_iter().filter_map(summary).collect()
}

/// n times the variance of a component of the mean of n residuals where nothing is systematic, m². `None` for a single row.
///
/// Measurements of one row share its posture's error, so rows count (S_c: the sum of the residuals of row c, k_c of them):
///
/// ```text
/// v = Σ_c |S_c|² / (3 Σ_c k_c)
/// ```
fn variance_of_means<'a>(rows: impl Iterator<Item = &'a ResidualRow>) -> Option<f64> {
    let mut sums: BTreeMap<(&str, u64), [f64; 3]> = BTreeMap::new();
    let mut count = 0.0;
    for row in rows {
        let sum = sums.entry((&row.recording, row.row)).or_default();
        for (sum, x) in sum.iter_mut().zip(row.residual_m) {
            *sum += x;
        }
        count += 1.0;
    }
    let total: f64 = sums.values().flatten().map(|x| x * x).sum();
    (sums.len() > 1).then(|| total / (3.0 * count))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(subject: &str, at: f64, residual_m: [f64; 3]) -> ResidualRow {
        let joints = [JointValue::radians("elbow", at)].into();
        ResidualRow {
            recording: "r".into(),
            row: 1,
            subject: subject.into(),
            residual_m,
            used: true,
            joints,
            ..ResidualRow::default()
        }
    }

    #[test]
    fn no_rows_no_residuals() {
        assert!(Residuals::from_rows(&[]).is_empty());
        assert!(
            Residuals::from_rows(&[ResidualRow {
                used: false,
                ..row("m", 0.0, [1.0; 3])
            }])
            .is_empty()
        );
        assert!(Residuals::from_rows(&[row("m", 0.0, [f64::NAN, 0.0, 0.0])]).is_empty());
    }

    #[test]
    fn every_used_row_is_in_every_summary_once() {
        let rows: Vec<_> = (0..100)
            .map(|i| {
                row(
                    if i % 4 == 0 { "a" } else { "b" },
                    f64::from(i) * 0.01,
                    [0.001, -0.002, 0.002],
                )
            })
            .collect();
        let residuals = Residuals::from_rows(&rows);
        assert_eq!(
            residuals
                .by_marker
                .iter()
                .map(|g| (g.name.as_str(), g.samples))
                .collect::<Vec<_>>(),
            [("a", 25), ("b", 75)]
        );
        assert_eq!(
            residuals.by_joint[0]
                .bins
                .iter()
                .map(|bin| bin.samples)
                .sum::<usize>(),
            100
        );
        assert_eq!(
            residuals.over_time[0]
                .bins
                .iter()
                .map(|bin| bin.samples)
                .sum::<usize>(),
            100
        );
        let y = &residuals.by_direction[1];
        assert!((y.mean_m + 0.002).abs() < 1e-15 && (y.rms_m - 0.002).abs() < 1e-15);
        assert!((residuals.all.expect("rows").rms_m - 0.003).abs() < 1e-15);
        let bin = residuals.by_joint[0].bins[3];
        assert!((bin.mean_m[2] - 0.002).abs() < 1e-15);
    }

    #[test]
    fn rejected_rows_are_counted_beside_the_errors_that_exclude_them() {
        let rejected = ResidualRow {
            used: false,
            ..row("a", 0.5, [1.0; 3])
        };
        let residuals = Residuals::from_rows(&[
            row("a", 0.1, [0.001; 3]),
            rejected,
            row("b", 0.2, [0.001; 3]),
        ]);
        assert_eq!(residuals.rejected, 1);
        let all = residuals.all.expect("two rows took part");
        assert_eq!((all.samples, all.rejected), (2, 1));
        assert!(all.max_m < 0.002);
        let counts: Vec<_> = residuals
            .by_marker
            .iter()
            .map(|g| (g.samples, g.rejected))
            .collect();
        assert_eq!(counts, [(1, 1), (1, 0)]);
    }

    #[test]
    fn a_joint_that_never_moved_has_one_bin() {
        let residuals =
            Residuals::from_rows(&[row("a", 0.5, [0.001; 3]), row("a", 0.5, [0.001; 3])]);
        assert_eq!(residuals.by_joint[0].bins.len(), 1);
        assert_eq!(residuals.by_joint[0].bins[0].center, 0.5);
    }

    #[test]
    fn of_the_means_of_noise_one_in_twenty_leaves_two_sigma_also_where_markers_share_an_error() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        for shared in [0.0, 1e-3] {
            let rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
            let mut noise = StandardNormal.sample_iter(rng);
            let mut normal = |sigma: f64| -> [f64; 3] {
                std::array::from_fn(|_| sigma * noise.next().unwrap_or(0.0))
            };
            let mut rows = Vec::new();
            for i in 0..4000 {
                let common = normal(shared);
                for marker in ["a", "b", "c", "d"] {
                    let own = normal(5e-4);
                    let residual = std::array::from_fn(|k| common[k] + own[k]);
                    rows.push(ResidualRow {
                        row: i,
                        ..row(marker, (i as f64 * 0.618).fract(), residual)
                    });
                }
            }
            let bins = &Residuals::from_rows(&rows).by_joint[0].bins;
            let out = bins.iter().flat_map(|bin| {
                let sigma = bin.mean_sigma_m.expect("many rows");
                bin.mean_m.map(|x| x.abs() > 2.0 * sigma)
            });
            let out = out.filter(|out| *out).count();
            // 72 means: 3.3 expected, more than 9 with a probability of 0.2 %.
            assert!((0..=9).contains(&out), "{shared}: {out} of 72");
            let sigma = bins[0].mean_sigma_m.expect("many rows");
            let one = (shared * shared + 5e-4 * 5e-4 / 4.0).sqrt();
            let expected = one / (bins[0].samples as f64 / 4.0).sqrt();
            assert!((sigma / expected - 1.0).abs() < 0.1, "{sigma} {expected}");
        }
    }

    #[test]
    fn a_pattern_leaves_its_band() {
        let wave = |i: u64| {
            let at = i as f64 * 0.01;
            let noise = if i.is_multiple_of(2) { 1e-4 } else { -1e-4 };
            ResidualRow {
                row: i,
                ..row("a", at, [2e-4 * at.sin() + noise, noise, noise])
            }
        };
        let rows: Vec<ResidualRow> = (0..628).map(wave).collect();
        let bins = &Residuals::from_rows(&rows).by_joint[0].bins;
        let out = |k: usize| {
            let beyond = |b: &&ResidualBin| b.mean_m[k].abs() > 2.0 * b.mean_sigma_m.unwrap_or(0.0);
            bins.iter().filter(beyond).count()
        };
        assert!(out(0) > 12 && out(1) == 0, "{} {}", out(0), out(1));
        let single = Residuals::from_rows(&[row("a", 0.1, [1e-3; 3])]);
        assert_eq!(single.by_joint[0].bins[0].mean_sigma_m, None);
    }
}
