//! Bodies of markers: swapped, loose and shifted markers, a body that became another, mirrored or scaled ones.
//!
//! Everything is read from the distances `d_ij` between markers, which no motion changes.

mod depth;
mod rows;
mod template;
mod two;

use std::f64::consts::SQRT_2;

use super::Expectations;
use crate::rigid_body::Template;
use crate::statistics::{median, robust_sigma};
use calib_finding::{Fact, Finding, Id, Subject, catalog, nearest_word};
use calib_geometry::pairs::is_compared;
use calib_geometry::registration::rigid_registration;
use calib_recording::Poses;
use nalgebra::Point3;

/// Gaussian distances stay within this many σ: one in 10¹⁵ does not.
const SIGMAS: f64 = 8.0;
/// Smallest deviation of a distance that is called a fault, m: refraction and calibration of good trackers.
const SMALLEST_FAULT: f64 = 4e-4;
/// A distance that keeps its new value is another one from this part of the tolerance on: less is what trackers distort.
const STEADY: f64 = 0.5;
/// Rows on either side of a change, and rows for a body to be judged at all.
const ROWS: usize = 5;
/// Markers up to which all permutations are tried; beyond, exchanges of two.
const ALL_PERMUTATIONS: usize = 5;

/// Part of the rows from which bad rows are the body's nature, not mistakes of the tracker.
const BENDING: f64 = 0.15;
/// Gross outliers strike all markers alike: one marker in this part of the bad rows is its own fault.
const ALWAYS_THE_SAME: f64 = 0.9;
/// A marker out of place is farther off than this many σ of its own distances: one that always scatters is not.
const OWN_SIGMAS: f64 = 5.0;
/// The least of a few scatters, each from n rows, is below σ: by up to 1 + this over n.
const FEW_ROWS: f64 = 24.0;

/// One body's markers over all rows.
pub(super) struct Body<'a> {
    name: &'a str,
    pub markers: Vec<&'a str>,
    tracks: Vec<&'a [Option<Point3<f64>>]>,
    pub pairs: Vec<Pair>,
    /// Deviation of a distance that is a fault, m.
    tolerance: f64,
}

pub(super) struct Pair {
    pub i: usize,
    pub j: usize,
    /// Median distance, m.
    pub distance: f64,
    /// Robust σ of the distance, m.
    pub sigma: f64,
    /// In which both markers are seen.
    pub rows: usize,
}

pub(super) fn rigidity(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, markers) in &expected.bodies {
        let missing: Vec<&str> = markers
            .iter()
            .map(String::as_str)
            .filter(|marker| !poses.markers.contains_key(*marker))
            .collect();
        if !missing.is_empty() {
            findings.push(missing_markers(name, &missing, poses, expected));
            continue;
        }
        let Some(body) = Body::new(name, markers, poses, expected) else {
            findings.extend(two::changes(name, markers, poses));
            continue;
        };
        if let Some(template) = expected.templates.get(name) {
            let sigma = expected.template_sigmas.get(name).copied();
            let off = || body.off_template(template, sigma, expected.marker_sigma);
            findings.extend(body.against_template(template, sigma).or_else(off));
        }
        if let Some(finding) = body.redefined(poses) {
            findings.push(finding);
            continue;
        }
        let loose = body.loose_markers();
        findings.extend(if loose.is_empty() {
            body.bad_rows(poses)
        } else {
            loose
        });
    }
    findings
}

/// Markers of rows in which they are farther out of place than their body is long, as the distances show: a reflection was taken for the marker.
///
/// No model of the robot takes part: the others are where they belong without this one, and only without this one.
#[must_use]
pub fn out_of_place(poses: &Poses, expected: &Expectations) -> Vec<(String, usize)> {
    let mut found = Vec::new();
    for (name, markers) in &expected.bodies {
        let all = |marker: &String| poses.markers.contains_key(marker);
        if !markers.iter().all(all) {
            continue;
        }
        let Some(body) = Body::new(name, markers, poses, expected) else {
            continue;
        };
        if body.redefined(poses).is_none() && body.loose_markers().is_empty() {
            found.extend(body.reflections(poses.len()));
        }
    }
    found
}

/// Markers of a body that the recording does not have.
fn missing_markers(
    body: &str,
    missing: &[&str],
    poses: &Poses,
    expected: &Expectations,
) -> Finding {
    // A column of another body is not what was meant.
    let ours = |column: &&str| !expected.bodies.values().flatten().any(|m| m == column);
    let known = || poses.markers.keys().map(String::as_str);
    let near: Vec<&str> = missing
        .iter()
        .filter_map(|marker| nearest_word(marker, known().filter(ours)))
        .collect();
    let nearest = (!near.is_empty()).then(|| Fact::names(near));
    Finding::new(catalog::MISSING_MARKER, Subject::body(body))
        .with("markers", Fact::names(missing.iter().copied()))
        .with("known", Fact::names(known()))
        .with_some("nearest", nearest)
}

impl<'a> Body<'a> {
    fn finding(&self, id: Id) -> Finding {
        Finding::new(id, Subject::body(self.name))
    }

    pub(super) fn finding_of(&self, id: Id, kind: &'static str) -> Finding {
        Finding::of_kind(id, kind, Subject::body(self.name))
    }

    /// `None` where fewer than three distances are known.
    pub(super) fn new(
        name: &'a str,
        markers: &'a [String],
        poses: &'a Poses,
        expected: &Expectations,
    ) -> Option<Self> {
        let tracks: Vec<&[Option<Point3<f64>>]> = markers
            .iter()
            .map(|marker| poses.markers[marker].as_slice())
            .collect();
        let mut pairs = Vec::new();
        for i in 0..tracks.len() {
            for j in (0..i).filter(|j| is_compared(i, *j, tracks.len())) {
                let distances: Vec<f64> = distances(tracks[i], tracks[j]).map(|(_, d)| d).collect();
                if distances.len() < ROWS {
                    continue;
                }
                let rows = distances.len();
                let distance = median(distances.clone())?;
                let sigma = robust_sigma(distances.into_iter(), distance)?;
                pairs.push(Pair {
                    i,
                    j,
                    distance,
                    sigma,
                    rows,
                });
            }
        }
        if pairs.len() < 3 {
            return None;
        }
        // The quieter pairs tell the noise, even when one marker is loose.
        let mut sigmas: Vec<f64> = pairs.iter().map(|pair| pair.sigma).collect();
        sigmas.sort_by(f64::total_cmp);
        let quiet = sigmas[(sigmas.len() - 1) / 4];
        // A distance has the noise of two coordinates along the line between the markers.
        let sigma = match expected.marker_sigma {
            Some(stated) => quiet.max(stated * SQRT_2),
            None => {
                let rows = tracks.iter().map(|track| track.iter().flatten().count());
                let rows = rows.min().unwrap_or(0).max(ROWS) as f64;
                quiet * (1.0 + FEW_ROWS / rows)
            }
        };
        // Distances along the line of sight have the noise of depth, and any of them may come to lie there.
        let of_depth = depth::sigma(&tracks, &pairs).map_or(0.0, |along| along * SQRT_2);
        let tolerance = (SIGMAS * sigma.max(of_depth)).max(SMALLEST_FAULT);
        Some(Body {
            name,
            markers: markers.iter().map(String::as_str).collect(),
            tracks,
            pairs,
            tolerance,
        })
    }

    /// A distance that keeps another value is another one from here on, m.
    pub(super) fn least_step(&self) -> f64 {
        (STEADY * self.tolerance).max(SMALLEST_FAULT)
    }

    /// The only marker whose distances are among those that changed, at least two of them.
    pub(super) fn only_of_one(changed: &[&Pair]) -> Option<usize> {
        let first = changed.first().filter(|_| changed.len() > 1)?;
        let of_all = |k: &usize| changed.iter().all(|pair| pair.i == *k || pair.j == *k);
        [first.i, first.j].into_iter().find(of_all)
    }

    /// That the body is another one: by a marker that is known to have moved, else by the distance that changed most.
    pub(super) fn redefined_by(
        &self,
        marker: Option<usize>,
        worst: &Pair,
        [of_marker, of_distance]: [&'static str; 2],
    ) -> Finding {
        match marker {
            Some(k) => self
                .finding_of(catalog::BODY_REDEFINED, of_marker)
                .with("marker", Fact::name(self.markers[k])),
            None => self
                .finding_of(catalog::BODY_REDEFINED, of_distance)
                .with("first", Fact::name(self.markers[worst.j]))
                .with("second", Fact::name(self.markers[worst.i])),
        }
    }

    /// Another shape from some row on: distances that are steady on both sides of it and differ.
    fn redefined(&self, poses: &Poses) -> Option<Finding> {
        let steps = self.pairs.iter().filter_map(|pair| self.step(pair));
        let worst = steps.max_by(|a, b| a.change.total_cmp(&b.change))?;
        let changed: Vec<&Pair> = self
            .pairs
            .iter()
            .filter(|pair| self.changes_at(pair, worst.row))
            .collect();
        let marker = Self::only_of_one(&changed);
        let finding = self.redefined_by(marker, worst.pair, ["marker_from_row", "from_row"]);
        let row = poses.rows[worst.row];
        Some(
            finding
                .with("change", Fact::meters(worst.change))
                .with("row", Fact::Count(row))
                .at_rows([row]),
        )
    }

    /// A step of a distance that is steady before and after it.
    fn step<'b>(&self, pair: &'b Pair) -> Option<Step<'b>> {
        let series: Vec<(usize, f64)> =
            distances(self.tracks[pair.i], self.tracks[pair.j]).collect();
        let mean = series.iter().map(|(_, d)| d).sum::<f64>() / series.len() as f64;
        // The largest cumulative sum marks the change.
        let mut sum = 0.0;
        let mut at = (0.0, 0);
        for (k, (_, d)) in series.iter().enumerate() {
            sum += d - mean;
            if f64::abs(sum) > at.0 {
                at = (f64::abs(sum), k + 1);
            }
        }
        let (before, after) = series.split_at(at.1);
        let (change, threshold) = self.change_between(before, after)?;
        let (a, b) = (level(before)?, level(after)?);
        let close = |part: &[(usize, f64)], level: f64| {
            let near = |(_, d): &&(usize, f64)| (d - level).abs() < self.tolerance / 2.0;
            part.iter().filter(near).count() * 10 >= part.len() * 9
        };
        let steady = close(before, a) && close(after, b);
        (steady && change > threshold.max(self.least_step())).then(|| Step {
            change,
            row: after[0].0,
            pair,
        })
    }

    /// A distance has another median from a row on.
    fn changes_at(&self, pair: &Pair, row: usize) -> bool {
        let series: Vec<(usize, f64)> =
            distances(self.tracks[pair.i], self.tracks[pair.j]).collect();
        let (before, after) = series.split_at(series.partition_point(|(at, _)| *at < row));
        let changed = self.change_between(before, after);
        changed.is_some_and(|(change, threshold)| change > threshold)
    }

    /// By how much two medians of a distance differ, and the limit of what is no fault, m; `None` where rows are too few.
    fn change_between(
        &self,
        before: &[(usize, f64)],
        after: &[(usize, f64)],
    ) -> Option<(f64, f64)> {
        if before.len() < ROWS || after.len() < ROWS {
            return None;
        }
        let change = (level(before)? - level(after)?).abs();
        Some((change, self.limit(before.len(), after.len())))
    }

    /// The limit of what noise and the tracker's distortion do to the difference of two levels, from so many rows, m: a row is a fault from the
    /// tolerance on, rows that agree with each other before.
    pub(super) fn limit(&self, before: usize, after: usize) -> f64 {
        let noise = self.tolerance * (1.0 / before as f64 + 1.0 / after as f64).sqrt();
        noise.max(SMALLEST_FAULT)
    }

    /// Markers whose distances to the others are unsteady, while those of the others among each other are not; fewer than half of all, or none.
    fn loose_markers(&self) -> Vec<Finding> {
        let steady = self.tolerance / 2.0;
        let mut in_rest = vec![true; self.markers.len()];
        let mut loose: Vec<(usize, f64)> = Vec::new();
        while self.among(&in_rest).any(|pair| pair.sigma > steady) {
            let rest = (0..in_rest.len()).filter(|&k| in_rest[k]);
            let scatters = rest.map(|k| (k, self.scatter(k, &in_rest)));
            let worst = scatters.max_by(|a, b| a.1.total_cmp(&b.1));
            // A single unsteady distance does not tell which of its markers is loose.
            let Some(worst) = worst.filter(|(_, scatter)| *scatter > steady) else {
                return Vec::new();
            };
            loose.push(worst);
            in_rest[worst.0] = false;
            // A body is what most of its markers agree on.
            if 2 * loose.len() >= self.markers.len() {
                return Vec::new();
            }
        }
        if self.among(&in_rest).next().is_none() {
            return Vec::new();
        }
        let finding = |(marker, scatter): (usize, f64)| {
            self.finding_of(catalog::NOT_RIGID, "loose")
                .with("marker", Fact::name(self.markers[marker]))
                .with("scatter", Fact::meters(scatter))
        };
        loose.into_iter().map(finding).collect()
    }

    /// The distances among the markers that are marked.
    fn among(&self, marked: &[bool]) -> impl Iterator<Item = &Pair> {
        self.pairs
            .iter()
            .filter(|pair| marked[pair.i] && marked[pair.j])
    }

    /// Robust σ of the distances of a marker from those that are marked, m: the median over them.
    fn scatter(&self, marker: usize, marked: &[bool]) -> f64 {
        let of_marker = |pair: &&Pair| pair.i == marker || pair.j == marker;
        let of_marker = self.among(marked).filter(of_marker);
        let mut sigmas: Vec<f64> = of_marker.map(|pair| pair.sigma).collect();
        sigmas.sort_by(f64::total_cmp);
        let middle = sigmas.len().saturating_sub(1) / 2;
        sigmas.get(middle).copied().unwrap_or(0.0)
    }

    /// Scale and handedness against a template that is known beforehand; `sigma`: of its coordinates, m, where it is stated.
    fn against_template(&self, template: &Template, sigma: Option<f64>) -> Option<Finding> {
        let place = |k: usize| {
            let at = template
                .names
                .iter()
                .position(|name| name == self.markers[k])?;
            template.points.get(at).copied()
        };
        let ratios = self.pairs.iter().filter_map(|pair| {
            let known = (place(pair.i)? - place(pair.j)?).norm();
            (known > 0.0).then(|| pair.distance / known)
        });
        let ratio = median(ratios.collect())?;
        for (factor, kind) in [
            (1e3, "template_millimeters"),
            (1e-3, "template_meters"),
            (10.0, "template_ten"),
            (0.1, "template_ten"),
        ] {
            if (0.8..1.25).contains(&(ratio / factor)) {
                let finding = self.finding_of(catalog::UNIT_MISMATCH, kind);
                return Some(finding.with("ratio", Fact::ratio(ratio)));
            }
        }
        let off = self
            .pairs
            .iter()
            .filter_map(|pair| {
                Some((pair.distance - (place(pair.i)? - place(pair.j)?).norm()).abs())
            })
            .fold(0.0, f64::max);
        let uncertain = SIGMAS * std::f64::consts::SQRT_2 * sigma.unwrap_or(0.0);
        if off > self.tolerance.max(2e-3).max(uncertain) {
            return Some(
                self.finding_of(catalog::NOT_RIGID, "template")
                    .with("difference", Fact::meters(off)),
            );
        }
        self.mirrored(&place)
    }

    /// The mirror image of the template fits, the template does not.
    fn mirrored(&self, place: &dyn Fn(usize) -> Option<Point3<f64>>) -> Option<Finding> {
        let row = (0..self.tracks[0].len())
            .find(|&row| self.tracks.iter().all(|track| track[row].is_some()))?;
        let seen: Vec<Point3<f64>> = self.tracks.iter().filter_map(|track| track[row]).collect();
        let known: Vec<Point3<f64>> = (0..self.markers.len()).filter_map(place).collect();
        let mirror: Vec<Point3<f64>> = known.iter().map(|p| Point3::new(p.x, p.y, -p.z)).collect();
        let rms = |from: &[Point3<f64>]| {
            rigid_registration(from, &seen, None)
                .ok()
                .map(|registration| registration.rms)
        };
        let (plain, mirrored) = (rms(&known)?, rms(&mirror)?);
        (plain > self.tolerance && mirrored < self.tolerance && plain > 5.0 * mirrored).then(|| {
            self.finding_of(catalog::MIRRORED, "template")
                .with("mirrored", Fact::meters(mirrored))
                .with("plain", Fact::meters(plain))
        })
    }
}

/// A distance that keeps another value from a row on.
struct Step<'a> {
    /// m.
    change: f64,
    /// Index of the first row with the new value.
    row: usize,
    pair: &'a Pair,
}

fn level(part: &[(usize, f64)]) -> Option<f64> {
    median(part.iter().map(|(_, d)| *d).collect())
}

/// Rows and distances where both are seen.
fn distances<'a>(
    a: &'a [Option<Point3<f64>>],
    b: &'a [Option<Point3<f64>>],
) -> impl Iterator<Item = (usize, f64)> + 'a {
    a.iter()
        .zip(b)
        .enumerate()
        .filter_map(|(row, (a, b))| Some((row, (a.as_ref()? - b.as_ref()?).norm())))
}
