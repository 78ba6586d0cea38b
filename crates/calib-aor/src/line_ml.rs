//! Maximum likelihood circles: one common line, or one common direction with own centers.
//!
//! ```text
//! line_ml     n, c common;      unknowns 4 + 2P,  residuals 2n
//! dir_ml      n common, c_p;    unknowns 2 + 4P
//! circle_ml   the same with one marker: the orthogonal-distance circle in space
//! ```
//!
//! `dir_ml` reports the line that all circles share along its direction: on short arcs own centers diverge, and are
//! named (`weak`) where their σ is beyond a third of their radius.
//!
//! The common-line fit starts from the plane normal and one center for all markers; starting from each
//! circle's own center diverges on short arcs.

use calib_estimator::factor::Factor;
use calib_estimator::{InputKind, Verdict, measured::Cloud};
use nalgebra::{Matrix4, Matrix6};

use crate::{
    circles::{
        Axis, Centers, Free, Normal, OwnCenters, flat_center, information, information_of_marker,
        minimize_line, placed, spread_out,
    },
    judge::{Candidate, OwnCenter, inverse_or_zero, judge, prepare},
    options::{COMMON, EstimatorInfo},
    outcome::{Known, Outcome},
    plane,
};
use calib_estimator::{EstimatorError, Input, Options, cloud_of};

/// What `line_ml` is and needs.
pub(crate) const LINE_ML: EstimatorInfo = EstimatorInfo {
    id: "line_ml",
    name: "common line",
    input: InputKind::Points,
    options: COMMON,
    summary: "several markers around one line",
    source: "orthogonal-distance circles, see the book",
    fit: line,
};

/// A common line for all markers.
///
/// # Errors
/// [`EstimatorError`] for data that are non-finite or of another kind.
pub fn line(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    run("line_ml", input, options, common_line)
}

/// What `dir_ml` is and needs.
pub(crate) const DIR_ML: EstimatorInfo = EstimatorInfo {
    id: "dir_ml",
    name: "common direction",
    input: InputKind::Points,
    options: COMMON,
    summary: "several markers, one direction, own centers",
    source: "orthogonal-distance circles, see the book",
    fit: direction,
};

/// A common direction, an own center for each marker.
///
/// # Errors
/// As [`line()`].
pub fn direction(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    run("dir_ml", input, options, own_centers)
}

/// What `circle_ml` is and needs.
pub(crate) const CIRCLE_ML: EstimatorInfo = EstimatorInfo {
    id: "circle_ml",
    name: "orthogonal-distance circle",
    input: InputKind::Points,
    options: COMMON,
    summary: "maximum likelihood circle in space; several markers share the direction",
    source: "Gander, Golub & Strebel 1994, in space",
    fit: circle,
};

/// The orthogonal-distance circle of one marker (several: as [`direction()`]).
///
/// # Errors
/// As [`line()`].
pub fn circle(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    run("circle_ml", input, options, |id, cloud, factor| {
        if cloud.markers() == 1 {
            common_line(id, cloud, factor)
        } else {
            own_centers(id, cloud, factor)
        }
    })
}

fn run(
    estimator: &'static str,
    input: &Input<'_>,
    options: &Options,
    solve: impl Fn(&'static str, &Cloud, &Factor) -> Option<Candidate>,
) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let cloud = cloud_of(input, options)?;
    let factor = match prepare(estimator, &cloud) {
        Ok(factor) => factor,
        Err(answer) => return Ok(answer),
    };
    match solve(estimator, &cloud, &factor) {
        Some(candidate) => Ok(judge(&cloud, &factor, candidate, options)),
        None => Ok(Outcome::none(
            estimator,
            Verdict::Diverged,
            "the estimate diverged: the arc of a circle is straight within the noise".into(),
            Known::Nothing,
        )),
    }
}

pub(crate) fn common_line(
    estimator: &'static str,
    cloud: &Cloud,
    factor: &Factor,
) -> Option<Candidate> {
    let start = plane::start(cloud, factor, &Options::default());
    let (axis, normal) = minimize_line(cloud, start, Free::Line, factor.s[0])?;
    let unit = information(cloud, &axis).try_inverse()?;
    let (n, markers) = (cloud.points.len(), cloud.markers());
    Some(Candidate {
        estimator,
        axis,
        own_centers: Vec::new(),
        cost: normal.cost,
        dof: (2 * n).saturating_sub(4 + 2 * markers),
        unit_covariance: spread_out(&unit, &axis.frame),
        residuals: 2 * n,
        held: None,
        gain_by_turning: None,
    })
}

fn own_centers(estimator: &'static str, cloud: &Cloud, factor: &Factor) -> Option<Candidate> {
    let start = plane::start(cloud, factor, &Options::default());
    let points = (0..cloud.markers())
        .map(|p| flat_center(cloud, &start.frame, p..p + 1))
        .collect();
    let problem = OwnCenters {
        cloud,
        size: factor.s[0],
    };
    let (end, normals) = problem.minimize(Centers {
        frame: start.frame,
        points,
    })?;
    // For the covariance the curvature at the modeled circles.
    let modeled: Vec<Normal> = normals
        .iter()
        .enumerate()
        .map(|(p, normal)| Normal {
            hessian: information_of_marker(
                cloud.samples(p),
                &Axis {
                    frame: end.frame,
                    point: end.points[p],
                },
            ),
            ..normal.clone()
        })
        .collect();
    let (h, _, own) = problem.reduced(&modeled, 0.0)?;
    let (n, markers) = (cloud.points.len(), cloud.markers());
    // The reported line is the common one of this direction: a mean of centers is as wild as the flattest arc's.
    // Its noise for a held direction is none of the direction's, which came from what the own centers left over.
    let axis = placed(
        cloud,
        Axis {
            frame: end.frame,
            point: start.point,
        },
        factor.s[0],
    );
    let common = information(cloud, &axis);
    let alone = inverse_or_zero(&common.fixed_view::<2, 2>(2, 2).into());
    let cross = -alone * common.fixed_view::<2, 2>(2, 0);
    let of_turn = inverse_or_zero(&h);
    let mut unit = Matrix4::zeros();
    unit.fixed_view_mut::<2, 2>(0, 0).copy_from(&of_turn);
    unit.fixed_view_mut::<2, 2>(2, 2)
        .copy_from(&(alone + cross * of_turn * cross.transpose()));
    unit.fixed_view_mut::<2, 2>(2, 0)
        .copy_from(&(cross * of_turn));
    unit.fixed_view_mut::<2, 2>(0, 2)
        .copy_from(&(cross * of_turn).transpose());
    let unit_covariance: Matrix6<f64> = spread_out(&unit, &axis.frame);
    Some(Candidate {
        estimator,
        axis,
        own_centers: end
            .points
            .iter()
            .zip(&own)
            .map(|(center, (inverse, coupling))| {
                // c_p = −H_cc⁻¹ H_cn turn + own noise
                let shift = inverse * coupling;
                let covariance = inverse + shift * of_turn * shift.transpose();
                OwnCenter {
                    center: *center,
                    unit_variance: covariance.symmetric_eigenvalues().max(),
                }
            })
            .collect(),
        cost: normals.iter().map(|n| n.cost).sum(),
        dof: (2 * n).saturating_sub(2 + 4 * markers),
        unit_covariance,
        residuals: 2 * n,
        held: None,
        gain_by_turning: None,
    })
}
