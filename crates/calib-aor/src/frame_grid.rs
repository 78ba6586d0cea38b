//! The grid of a frame's recording: which rows form a circle around which axis, and the circles' axes.

use calib_estimator::Verdict;
use nalgebra::{Matrix3, Point3, Unit, Vector3};

use crate::{
    frame::FrameOutcome,
    line_ml,
    outcome::{Known, NotObservable, Outcome},
    planar_radial, plane,
};
use calib_estimator::{FrameSample, Input, Options, PlaneFit};

/// Name of the estimator that works on grids.
pub(crate) const ID: &str = "algorithm1";

pub(crate) fn none(verdict: Verdict, reason: String) -> NotObservable {
    NotObservable {
        estimator: ID,
        verdict,
        reason,
        known: Known::Nothing,
    }
}

/// Rows of each circle.
pub(crate) struct Grid {
    /// Rows of one held distal angle: circles around the proximal axis.
    pub around_proximal: Vec<Vec<usize>>,
    /// Rows of one held proximal angle: circles around the distal axis.
    pub around_distal: Vec<Vec<usize>>,
}

impl Grid {
    pub fn circles(&self) -> usize {
        self.around_proximal.len() + self.around_distal.len()
    }

    /// Rows of circle c, those around the proximal axis first.
    fn rows(&self, c: usize) -> &[usize] {
        let proximal = self.around_proximal.len();
        if c < proximal {
            &self.around_proximal[c]
        } else {
            &self.around_distal[c - proximal]
        }
    }

    /// Axis of circle c, its sense given by the swept joint angle.
    pub fn normal_of(
        &self,
        c: usize,
        samples: &[FrameSample],
        m: &Point3<f64>,
        options: &Options,
    ) -> Result<Unit<Vector3<f64>>, NotObservable> {
        if c < self.around_proximal.len() {
            let circles = match options.plane_fit {
                PlaneFit::CommonLine => &self.around_proximal[..],
                _ => &self.around_proximal[c..=c],
            };
            circle_axis(samples, circles, |s| s.proximal, m, options)
        } else {
            let circle = std::slice::from_ref(&self.around_distal[c - self.around_proximal.len()]);
            circle_axis(samples, circle, |s| s.distal, m, options)
        }
    }

    /// True when a change of `row` changes the axis of circle c.
    pub fn depends(&self, c: usize, row: usize, options: &Options) -> bool {
        let common = options.plane_fit == PlaneFit::CommonLine && c < self.around_proximal.len();
        self.rows(c).contains(&row)
            || (common && self.around_proximal.iter().any(|rows| rows.contains(&row)))
    }

    pub fn of(samples: &[FrameSample], options: &Options) -> Result<Self, FrameOutcome> {
        let around_proximal = planes(samples, options.same_angle, |s| (s.distal, s.proximal));
        let around_distal = planes(samples, options.same_angle, |s| (s.proximal, s.distal));
        let seen = samples.iter().filter(|s| s.seen().is_some()).count();
        for (axis, held, found) in [
            ("proximal", "distal", &around_proximal),
            ("distal", "proximal", &around_distal),
        ] {
            if found.is_empty() {
                return Err(FrameOutcome::NotObservable(NotObservable {
                    estimator: ID,
                    verdict: Verdict::TooFew,
                    reason: format!(
                        "the {seen} samples form no circle around the {axis} axis: no {held} angle is held \
                         (to {:.2}°) over three or more {axis} angles; scattered samples need `frame_ml`",
                        options.same_angle.to_degrees()
                    ),
                    known: Known::Nothing,
                }));
            }
        }
        Ok(Self {
            around_proximal,
            around_distal,
        })
    }
}

/// Groups of rows with the same held angle and at least three different swept angles.
fn planes(
    samples: &[FrameSample],
    same: f64,
    held_and_swept: impl Fn(&FrameSample) -> (f64, f64),
) -> Vec<Vec<usize>> {
    let mut rows: Vec<usize> = (0..samples.len())
        .filter(|&k| samples[k].seen().is_some())
        .collect();
    rows.sort_by(|&a, &b| {
        held_and_swept(&samples[a])
            .0
            .total_cmp(&held_and_swept(&samples[b]).0)
    });
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for row in rows {
        let held = held_and_swept(&samples[row]).0;
        match groups.last_mut() {
            Some(group) if held - held_and_swept(&samples[group[0]]).0 <= same => group.push(row),
            _ => groups.push(vec![row]),
        }
    }
    groups.retain(|group| {
        let mut swept: Vec<f64> = group
            .iter()
            .map(|&k| held_and_swept(&samples[k]).1)
            .collect();
        swept.sort_by(f64::total_cmp);
        swept.dedup_by(|a, b| (*a - *b).abs() <= same);
        swept.len() >= 3
    });
    groups
}

/// The axis of one circle, or of several around one line, its sense given by the swept joint angles.
fn circle_axis(
    samples: &[FrameSample],
    circles: &[Vec<usize>],
    swept: impl Fn(&FrameSample) -> f64,
    m: &Point3<f64>,
    options: &Options,
) -> Result<Unit<Vector3<f64>>, NotObservable> {
    // Every circle in its own rows of one table, so that the angles pair up.
    let rows: usize = circles.iter().map(Vec::len).sum();
    let mut tracks = vec![vec![None; rows]; circles.len()];
    let (mut angles, mut weights) = (Vec::with_capacity(rows), Vec::with_capacity(rows));
    for (track, circle) in tracks.iter_mut().zip(circles) {
        for &k in circle {
            let pose = samples[k].world_from_body.as_ref();
            track[angles.len()] = pose.map(|p| Point3::from(p.translation));
            angles.push(swept(&samples[k]));
            weights.push(samples[k].weight);
        }
    }
    let fit_options = Options {
        center: (options.plane_fit != PlaneFit::CommonLine).then_some(*m),
        angles,
        weights,
        // The mean over all planes is judged, not each plane.
        significance: 1.0,
        weak_angle: f64::MAX,
        ..Options::default()
    };
    let input = Input::Points(&tracks);
    let outcome = match options.plane_fit {
        PlaneFit::PlanarRadial => planar_radial::gauss_newton(&input, &fit_options),
        PlaneFit::Plane => plane::fit(&input, &fit_options),
        PlaneFit::CommonLine => line_ml::line(&input, &fit_options),
    };
    match outcome {
        Ok(Outcome::Estimate(estimate)) => Ok(estimate.line.direction),
        Ok(Outcome::NotObservable(mut why)) => {
            why.estimator = ID;
            why.reason = format!("circles of {rows} samples: {}", why.reason);
            Err(why)
        }
        Err(error) => Err(none(
            error.verdict().unwrap_or(Verdict::Diverged),
            error.to_string(),
        )),
    }
}

/// Point of least squared distance to the axes of all circles.
pub(crate) fn nearest_to_axes(samples: &[FrameSample], grid: &Grid) -> Option<Point3<f64>> {
    let (mut a, mut b) = (Matrix3::zeros(), Vector3::zeros());
    let mut reference: Option<Vector3<f64>> = None;
    for rows in grid.around_proximal.iter().chain(&grid.around_distal) {
        let track: Vec<_> = rows
            .iter()
            .map(|&k| {
                samples[k]
                    .world_from_body
                    .as_ref()
                    .map(|p| Point3::from(p.translation))
            })
            .collect();
        let tracks = [track];
        let options = Options {
            weights: rows.iter().map(|&k| samples[k].weight).collect(),
            significance: 1.0,
            weak_angle: f64::MAX,
            ..Options::default()
        };
        let Ok(Outcome::Estimate(e)) = plane::fit(&Input::Points(&tracks), &options) else {
            continue;
        };
        let n = e.line.direction.into_inner();
        let across = Matrix3::identity() - n * n.transpose();
        let from = *reference.get_or_insert(e.line.point.coords);
        a += across;
        b += across * (e.line.point.coords - from);
    }
    let eigen = calib_geometry::decompose::symmetric_eigen_small(&a);
    // Parallel axes have no nearest point.
    if eigen.values[0] <= 1e-9 * eigen.values[2] {
        return None;
    }
    Some(Point3::from(reference? + a.cholesky()?.solve(&b)))
}
