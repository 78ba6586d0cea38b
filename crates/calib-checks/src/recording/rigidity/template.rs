//! A body whose mean distances disagree with the template that is stated for it: one marker's place is wrong, or more.
//!
//! ```text
//! r_ij = d_ij − s k_ij,   s = Σ d k / Σ k²        d: median distance seen, k: distance in the template           (1)
//! σ_ij² = (1.25 σ_d)² / n + 2 σ_t² + σ_c²         σ_t: of a template's coordinate, σ_c: [`CENTERS`]              (2)
//! ```
//!
//! The common scale s of a body is the tracker's, and no fault of the template. A marker is named if the others agree without it, and
//! clearly less well without any other marker.

use super::{Body, Pair};
use crate::rigid_body::Template;
use calib_finding::{Fact, Finding, catalog};

/// Distances stay within this many σ: one in 10⁶ does not.
const SIGMAS: f64 = 5.0;
/// σ of a mean distance of however many rows, m: the center that a tracker sees of a marker is off by some 0.1 mm, which depends on its
/// calibration and on the side that the marker shows. With [`SIGMAS`], less than 0.5 mm is never a fault.
const CENTERS: f64 = 1e-4;
/// σ of a median over that of a mean.
const MEDIAN: f64 = 1.2533;
/// Without any other marker, the rest disagrees by at least this part of the limit …
const OTHERS_DISAGREE: f64 = 0.5;
/// … and this many times as much as without the marker that is named.
const CLEARLY: f64 = 2.0;
/// Of fewer distances no scale is estimated.
const FOR_SCALE: usize = 3;

/// One distance in the recording and in the template.
struct Compared<'a> {
    pair: &'a Pair,
    /// In the template, m.
    known: f64,
    /// Largest difference that is no fault, m.
    limit: f64,
}

impl Body<'_> {
    /// Mean distances that the template does not have; `template_sigma`: of its coordinates, m, `marker_sigma`: of the tracker's, m.
    pub(super) fn off_template(
        &self,
        template: &Template,
        template_sigma: Option<f64>,
        marker_sigma: Option<f64>,
    ) -> Option<Finding> {
        let place = |k: usize| {
            let mut names = template.names.iter();
            let at = names.position(|name| name == self.markers[k])?;
            template.points.get(at).copied()
        };
        let stated = marker_sigma.unwrap_or(0.0) * std::f64::consts::SQRT_2;
        let coordinate = template_sigma.unwrap_or(0.0);
        let compared = self.pairs.iter().filter_map(|pair| {
            let known = (place(pair.i)? - place(pair.j)?).norm();
            let noise = MEDIAN * pair.sigma.max(stated) / (pair.rows as f64).sqrt();
            let sigma = (noise.powi(2) + 2.0 * coordinate.powi(2) + CENTERS.powi(2)).sqrt();
            let limit = SIGMAS * sigma;
            (known > 0.0).then_some(Compared { pair, known, limit })
        });
        let all: Vec<Compared<'_>> = compared.collect();
        let (_, worst) = most_off(all.iter()).filter(|(ratio, _)| *ratio > 1.0)?;
        let marker = self.only_off(&all);
        let of_marker = |c: &&Compared<'_>| marker.is_some_and(|k| c.pair.i == k || c.pair.j == k);
        let scale = common_scale(all.iter().filter(|c| !of_marker(c)));
        let off = |c: &Compared<'_>| (c.pair.distance - scale * c.known).abs();
        Some(match marker {
            Some(marker) => self
                .finding_of(catalog::NOT_RIGID, "template_marker")
                .with("marker", Fact::name(self.markers[marker]))
                .with(
                    "difference",
                    Fact::meters(all.iter().filter(of_marker).map(off).fold(0.0, f64::max)),
                ),
            None => self
                .finding_of(catalog::NOT_RIGID, "template_distance")
                .with("first", Fact::name(self.markers[worst.pair.j]))
                .with("second", Fact::name(self.markers[worst.pair.i]))
                .with("difference", Fact::meters(off(worst))),
        })
    }

    /// The only marker without which the distances agree with the template.
    fn only_off(&self, all: &[Compared<'_>]) -> Option<usize> {
        let without = |k: usize| {
            let rest = all.iter().filter(move |c| c.pair.i != k && c.pair.j != k);
            most_off(rest).map(|(ratio, _)| (ratio, k))
        };
        let mut ratios: Vec<(f64, usize)> = (0..self.markers.len()).filter_map(without).collect();
        ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [(best, marker), (next, _), ..] = ratios[..] else {
            return None;
        };
        let others_disagree = next > OTHERS_DISAGREE && next > CLEARLY * best;
        (best <= 1.0 && others_disagree).then_some(marker)
    }
}

/// Seen over known, of all distances together.
fn common_scale<'c, 'a: 'c>(of: impl Iterator<Item = &'c Compared<'a>>) -> f64 {
    let (mut product, mut square, mut count) = (0.0, 0.0, 0);
    for c in of {
        product += c.pair.distance * c.known;
        square += c.known * c.known;
        count += 1;
    }
    if count < FOR_SCALE {
        1.0
    } else {
        product / square
    }
}

/// The distance that disagrees most, in units of its limit, beside the common scale.
fn most_off<'c, 'a: 'c>(
    of: impl Iterator<Item = &'c Compared<'a>> + Clone,
) -> Option<(f64, &'c Compared<'a>)> {
    let scale = common_scale(of.clone());
    let ratio = |c: &'c Compared<'a>| ((c.pair.distance - scale * c.known).abs() / c.limit, c);
    of.map(ratio).max_by(|a, b| a.0.total_cmp(&b.0))
}
