//! Whether what was measured scatters otherwise along the line of sight than across it.
//!
//! With e an error of a position and φ one of an orientation, in parts along the line of sight (∥) and across it (⊥), and the factors a and b of the
//! [levels](crate::measurement::Sight) at the distances, n observations are likelier by
//!
//! ```text
//! Λ = n ( 3/2 ln s(e) − ln s(e⊥/a) − ½ ln s(e∥/b) ) − Σ ln a²b
//!   + n ( 3/2 ln s(φ) − ln s(φ⊥/b) − ½ ln s(φ∥/a) ) − Σ ln b²a                                   (1)
//! ```
//!
//! s is the mean square of one component. The second line is of poses; each statement of the noise has the levels that fit it best. Where depth
//! is known better than place, or an angle about the line worse than one across it, the line counts 0: a laser tracker sees so,
//! but a tracker that turns a little from row to row makes the same residuals.

use calib_geometry::statistics::median;
use nalgebra::Vector3;

use crate::analysis::solution::Solution;
use crate::graph::ids::MeasurementId;
use crate::graph::measurement::{MeasurementKind, PoseNoise, growth};

/// What the residuals of a measurement say of its noise along the line of sight.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct AlongSight {
    /// Which measurement.
    pub measurement: MeasurementId,
    /// Median distance of what was seen, m.
    pub distance: f64,
    /// First line of equation (1).
    pub positions: Likelier,
    /// Its second line; 0 of markers.
    pub orientations: Likelier,
}

/// By how much the logarithm of the likelihood is larger than with noise that is the same in all directions.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Likelier {
    /// With levels that are the same at all distances.
    pub same: f64,
    /// With levels that grow with the distance.
    pub growing: f64,
}

impl std::ops::AddAssign for Likelier {
    fn add_assign(&mut self, other: Self) {
        self.same += other.same;
        self.growing += other.growing;
    }
}

/// An observation in parts along and across its line of sight.
struct Seen {
    distance: f64,
    position: Parts,
    orientation: Option<Parts>,
}

/// Squares of the part across the line, of two components, and of that along it.
#[derive(Debug, Clone, Copy)]
struct Parts {
    across: f64,
    along: f64,
}

impl Parts {
    fn of(error: &Vector3<f64>, line: &Vector3<f64>) -> Self {
        let along = error.dot(line).powi(2);
        Self {
            across: (error.norm_squared() - along).max(0.0),
            along,
        }
    }
}

impl Solution {
    /// Equation (1) by measurement of markers or poses, whichever statement of their noise this fit has. Of long recordings for some
    /// thousand samples only.
    #[must_use]
    pub fn likelier_along_sight_by(&self) -> Vec<AlongSight> {
        let measurements = &self.model.problem.measurements;
        let mut seen: Vec<Vec<Seen>> = Vec::new();
        seen.resize_with(measurements.len(), Vec::new);
        self.for_each_fitted(|o, rows| {
            let kind = &measurements[o.measurement].kind;
            let three = |at: usize| kind.stated(o.item, &rows[at..]);
            let (sight, position, orientation) = match kind {
                MeasurementKind::Markers(of) if of.observations[o.item].shape.is_none() => {
                    (of.observations[o.item].position.coords, three(0), None)
                }
                MeasurementKind::Poses(of) if matches!(of.noise, PoseNoise::Split { .. }) => {
                    let sight = of.observations[o.item].line_of_sight();
                    (sight, three(3), Some(three(0)))
                }
                _ => return,
            };
            let Some(line) = sight.try_normalize(0.0) else {
                return;
            };
            seen[o.measurement].push(Seen {
                distance: sight.norm(),
                position: Parts::of(&position, &line),
                orientation: orientation.map(|turn| Parts::of(&turn, &line)),
            });
        });
        let of = |(m, seen): (usize, Vec<Seen>)| {
            let distance = median(seen.iter().map(|s| s.distance).collect())?;
            let positions = seen.iter().map(|s| (s.distance, s.position));
            let orientations = seen
                .iter()
                .filter_map(|s| Some((s.distance, s.orientation?)));
            Some(AlongSight {
                measurement: MeasurementId::of(m),
                distance,
                positions: likelier(positions, distance, Larger::Along)?,
                orientations: likelier(orientations, distance, Larger::Across).unwrap_or_default(),
            })
        };
        seen.into_iter().enumerate().filter_map(of).collect()
    }
}

/// Which of the two levels of a line of equation (1) is the larger.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Larger {
    Along,
    Across,
}

/// A line of equation (1) for levels that are the same at all distances and for those that grow; `None` where there is nothing to compare.
fn likelier(
    seen: impl Iterator<Item = (f64, Parts)> + Clone,
    distance: f64,
    larger: Larger,
) -> Option<Likelier> {
    let by = |from| {
        let seen = seen.clone();
        let factors = |(distance, parts)| (growth(from, distance), parts);
        part(seen.map(factors), larger).filter(|by| by.is_finite())
    };
    Some(Likelier {
        same: by(None)?,
        growing: by(Some(distance))?,
    })
}

/// One line of equation (1), with the factors of what is read in the image and of what perspective tells; the latter is the larger level.
fn part(seen: impl Iterator<Item = ([f64; 2], Parts)>, larger: Larger) -> Option<f64> {
    let (mut n, mut all, mut of_across, mut of_along, mut volume) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for ([image, depth], parts) in seen {
        let [a, b] = match larger {
            Larger::Along => [image, depth],
            Larger::Across => [depth, image],
        };
        n += 1.0;
        all += parts.across + parts.along;
        of_across += parts.across / (a * a);
        of_along += parts.along / (b * b);
        volume += 2.0 * a.ln() + b.ln();
    }
    if n == 0.0 || all <= 0.0 {
        return None;
    }
    if (of_along > of_across / 2.0) != (larger == Larger::Along) {
        return Some(0.0);
    }
    let log = |sum: f64, components: f64| (sum / (components * n)).ln();
    Some(n * (1.5 * log(all, 3.0) - log(of_across, 2.0) - 0.5 * log(of_along, 1.0)) - volume)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors with the same squares at each distance, of standard deviations 1 across and `along` along, that grow or not.
    fn seen(along: f64, grows: bool) -> Vec<(f64, Parts)> {
        let at = |i: u32| {
            let distance = 0.5 + 0.1 * f64::from(i);
            let [a, b] = growth(grows.then_some(1.0), distance);
            let parts = Parts {
                across: 2.0 * a * a,
                along: (along * b).powi(2),
            };
            (distance, parts)
        };
        (0..20).map(at).collect()
    }

    #[test]
    fn the_statement_that_made_the_errors_is_the_likeliest() {
        for (along, grows) in [(1.0, false), (4.0, false), (4.0, true)] {
            let seen = seen(along, grows);
            let by = likelier(seen.iter().copied(), 1.3, Larger::Along).expect("seen");
            assert_eq!(by.growing > by.same, grows, "{along} {grows}: {by:?}");
            if along < 2.0 {
                assert!(by.same.abs() < 1e-9, "{by:?}");
            } else {
                assert!(by.same.max(by.growing) > 20.0);
            }
        }
    }

    #[test]
    fn depth_that_is_known_better_than_place_is_not_looked_for() {
        let seen = seen(0.2, false);
        let by = likelier(seen.iter().copied(), 1.3, Larger::Along);
        assert_eq!(by, Some(Likelier::default()));
    }
}
