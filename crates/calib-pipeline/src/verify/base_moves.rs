//! What the robot stands on yields under the arm: a body that no joint moves follows the place of what the joints carry.
//!
//! ```text
//! d_i = c_r + t_r i + B p_i + e_i                                                                      (1)
//! ```
//!
//! with `d` measured − predicted of the body in row i, `c`, `t` mean and trend of each recording, and `p` where the nominal robot has the other bodies'
//! links, on average. B is tested for each coordinate apart (F, Bonferroni), with as many rows as successive ones are independent (Bartlett 1935). The
//! model of the robot takes no part: that body stands, or it does not.

use std::collections::{BTreeMap, BTreeSet};

use calib_estimator::chance::f_tail;
use calib_finding::{About, Fact, Finding, catalog};
use calib_report::ResidualRow;
use nalgebra::{Matrix3, Vector3};

use crate::prepare::inputs::Inputs;
use crate::verify::sways::{stands, subjects};

/// Probability of chance.
const CHANCE: f64 = 1e-6;
/// Share of the body's squared deviations that follows the arm at least.
const SHARE: f64 = 0.2;
/// Rows of a recording that are compared, at least: mean and trend take two.
const FEWEST: usize = 6;
/// Directions in which the arm moves less than this part of the farthest one say nothing.
const MOVES: f64 = 0.05;

/// One row: measured − predicted of the body, and the place of the others, m.
type Row = [Vector3<f64>; 2];

/// That a body which no joint moves follows the arm, of several the one that does so most.
pub(super) fn base_moves(inputs: &Inputs, residuals: &[ResidualRow]) -> Option<Finding> {
    let bodies = &inputs.robot.profile.bodies;
    let places = places(inputs);
    let still = bodies.iter().filter(|(_, body)| stands(inputs, body));
    let found = still.filter_map(|(name, body)| {
        let recordings = rows(residuals, &subjects(name, body), &places);
        let follows = Follows::of(&recordings)?;
        let finding = Finding::new(catalog::BASE_MOVES, About::Body(name.clone()))
            .with("body", Fact::name(name))
            .with("motion", Fact::meters(follows.rms))
            .with("largest", Fact::meters(follows.largest))
            .with("share", Fact::ratio(follows.share));
        Some((finding, follows.share))
    });
    let most = found.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(most.0)
}

/// Mean place of the links that joints move and bodies are on, in the root's frame, by recording and row.
fn places(inputs: &Inputs) -> BTreeMap<(&str, u64), Vector3<f64>> {
    let (model, bodies) = (&inputs.robot.model, &inputs.robot.profile.bodies);
    let moved = bodies.values().filter(|body| !stands(inputs, body));
    let links: BTreeSet<usize> = moved.map(|body| body.link.index()).collect();
    let mut places = BTreeMap::new();
    if links.is_empty() {
        return places;
    }
    for (name, loaded) in &inputs.recordings {
        for (row, q) in loaded.poses.rows.iter().zip(&loaded.q) {
            let Some(q) = q else { continue };
            let all = model.forward_kinematics(q);
            let sum: Vector3<f64> = links.iter().map(|l| all[*l].translation.vector).sum();
            places.insert((name.as_str(), *row), sum / links.len() as f64);
        }
    }
    places
}

/// The rows of each recording that show the body, in their order.
fn rows(
    residuals: &[ResidualRow],
    own: &BTreeSet<&str>,
    places: &BTreeMap<(&str, u64), Vector3<f64>>,
) -> Vec<Vec<Row>> {
    let mut means: BTreeMap<(&str, u64), (Vector3<f64>, f64)> = BTreeMap::new();
    for row in residuals.iter().filter(|row| own.contains(&*row.subject)) {
        let mean = means.entry((&row.recording, row.row)).or_default();
        mean.0 -= Vector3::from(row.residual_m);
        mean.1 += 1.0;
    }
    let mut recordings: BTreeMap<&str, Vec<Row>> = BTreeMap::new();
    for (key, (sum, count)) in means {
        let seen = sum / count;
        if let Some(place) = places
            .get(&key)
            .filter(|_| seen.iter().all(|x| x.is_finite()))
        {
            recordings.entry(key.0).or_default().push([seen, *place]);
        }
    }
    let recordings = recordings.into_values();
    recordings.filter(|rows| rows.len() >= FEWEST).collect()
}

/// How far a body follows the arm.
struct Follows {
    /// rms of the motion that follows, m.
    rms: f64,
    /// The most, m.
    largest: f64,
    /// Share of the squared deviations.
    share: f64,
}

impl Follows {
    fn of(recordings: &[Vec<Row>]) -> Option<Self> {
        let taken = 2.0 * recordings.len() as f64;
        let recordings: Vec<Vec<Row>> = recordings.iter().map(|r| without_trend(r)).collect();
        let rows = || recordings.iter().flatten();
        let count = rows().count() as f64;
        let places: Matrix3<f64> = rows().map(|[_, p]| p * p.transpose()).sum();
        let products: Matrix3<f64> = rows().map(|[d, p]| d * p.transpose()).sum();
        let eigen = places.symmetric_eigen();
        let most = eigen.eigenvalues.max();
        let told = |k: &usize| eigen.eigenvalues[*k] > MOVES * MOVES * most;
        let axes: Vec<usize> = (0..3).filter(told).filter(|_| most > 0.0).collect();
        // B of equation (1) in the directions that the arm moves in.
        let along = |k: &usize| {
            let axis = eigen.eigenvectors.column(*k).into_owned();
            products * axis * axis.transpose() / eigen.eigenvalues[*k]
        };
        let by_place: Matrix3<f64> = axes.iter().map(along).sum();
        let squares = |of: &dyn Fn(&Row) -> Vector3<f64>| -> Vector3<f64> {
            rows().map(|row| of(row).component_mul(&of(row))).sum()
        };
        let all = squares(&|[d, _]| *d);
        let left = squares(&|[d, p]| d - by_place * p);
        let (share, free) = (1.0 - left.sum() / all.sum(), axes.len() as f64);
        // Successive rows of a motion are alike, in noise and in place.
        let both = alike(&recordings, 0) * alike(&recordings, 1);
        let independent = (count - taken) * (1.0 - both) / (1.0 + both) - free;
        let chance = (0..3).map(|k| {
            let ratio = (all[k] - left[k]) / free / (left[k] / independent);
            3.0 * f_tail(ratio, free, independent)
        });
        let chance = chance.fold(1.0, f64::min);
        let is_told = !axes.is_empty() && independent > 0.0 && left.min() > 0.0;
        let follows = || {
            let motion = rows().map(|[_, p]| (by_place * p).norm());
            let largest = motion.clone().fold(0.0, f64::max);
            let rms = (motion.map(|m| m * m).sum::<f64>() / count).sqrt();
            Self {
                rms,
                largest,
                share,
            }
        };
        (is_told && chance < CHANCE && share >= SHARE).then(follows)
    }
}

/// Correlation of successive rows, 0 at least: of the body's deviations (0) or of the places (1).
fn alike(recordings: &[Vec<Row>], of: usize) -> f64 {
    let all: f64 = recordings
        .iter()
        .flatten()
        .map(|r| r[of].norm_squared())
        .sum();
    let pairs = recordings.iter().flat_map(|rows| rows.windows(2));
    let next: f64 = pairs.map(|two| two[0][of].dot(&two[1][of])).sum();
    (next / all).clamp(0.0, 0.99)
}

/// Less mean and straight line over the rows.
fn without_trend(rows: &[Row]) -> Vec<Row> {
    let count = rows.len() as f64;
    let at = |i: usize| i as f64 - 0.5 * (count - 1.0);
    let square: f64 = (0..rows.len()).map(|i| at(i).powi(2)).sum();
    let line = |k: usize| {
        let mean = rows.iter().map(|row| row[k]).sum::<Vector3<f64>>() / count;
        let slopes = rows.iter().enumerate().map(|(i, row)| row[k] * at(i));
        (mean, slopes.sum::<Vector3<f64>>() / square)
    };
    let lines = [line(0), line(1)];
    let rows = rows.iter().enumerate();
    rows.map(|(i, row)| [0, 1].map(|k| row[k] - lines[k].0 - lines[k].1 * at(i)))
        .collect()
}
