//! Halvorsen's line: the axis from displacements between pairs of samples.
//!
//! ```text
//! d = x_j − x_i,  μ = (x_i + x_j)/2:     d·n = 0,    d·(c − μ) = 0       for every pair          (1)
//! ```
//!
//! n is the direction of least displacement, c the least-squares point of the bisecting planes. With all pairs
//! n is the plane's normal; with pairs a fixed number of rows apart the result depends on that choice.
//! The point is drawn towards the samples, on short arcs by more than its scatter: the covariance holds both.
//! Halvorsen et al. 1999, J. Biomech. 32(11), 1221–1227.

use calib_geometry::row_qr::RowQr;
use nalgebra::{Matrix2, Matrix3, Matrix4, Vector2, Vector3};

use crate::{
    axis_frame::AxisFrame,
    circles::{Axis, Free, information, linearize, minimize_line, placed, spread_out},
    judge::{Candidate, inverse_or_zero, judge, prepare},
    options::{EstimatorInfo, PAIRS},
    outcome::Outcome,
};
use calib_estimator::{EstimatorError, Input, InputKind, Options, cloud_of};

/// What `halvorsen_line` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "halvorsen_line",
    name: "line of the displacements",
    input: InputKind::Points,
    options: PAIRS,
    summary: "bisecting planes of pairs of samples",
    source: "Halvorsen et al. 1999",
    fit,
};

/// Halvorsen's line with the pairs of [`Options::separation`].
///
/// # Errors
/// [`EstimatorError`] for data that are non-finite or of another kind.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let cloud = cloud_of(input, options)?;
    let factor = match prepare("halvorsen_line", &cloud) {
        Ok(factor) => factor,
        Err(answer) => return Ok(answer),
    };
    // Directions of the displacements, from their triangular factor; and Σ d (d·μ).
    let (mut spread, mut right) = (RowQr::<3>::default(), Vector3::zeros());
    let mut pairs = 0;
    let mut add = |i: usize, j: usize| {
        let (a, b) = (&cloud.points[i], &cloud.points[j]);
        // All pairs of rows that count w_i and w_j times.
        let root = (cloud.weight(i) * cloud.weight(j)).sqrt();
        let d = (b - a) * root;
        spread.push([d.x, d.y, d.z]);
        right += d * (0.5 * root * (b.norm_squared() - a.norm_squared()));
        pairs += 1;
    };
    for p in 0..cloud.markers() {
        let range = cloud.range(p);
        match options.separation {
            None => {
                for i in range.clone() {
                    for j in i + 1..range.end {
                        add(i, j);
                    }
                }
            }
            Some(rows) => {
                for i in range.clone() {
                    let other = cloud.labels[i].1 + rows.max(1);
                    if let Some(j) = (i + 1..range.end).find(|&j| cloud.labels[j].1 == other) {
                        add(i, j);
                    }
                }
            }
        }
    }
    let r: Matrix3<f64> = spread.factor();
    let eigen = calib_geometry::decompose::svd_small(&r);
    if pairs < 2 || eigen.s[1] <= 1e-9 * eigen.s[0] {
        return Ok(Outcome::none(
            "halvorsen_line",
            calib_estimator::Verdict::TooFew,
            format!("{pairs} pairs of samples, whose displacements span no plane"),
            crate::outcome::Known::Nothing,
        ));
    }
    let frame = AxisFrame::of(eigen.v.column(2).into_owned());
    // In the plane across n: Σ d dᵀ c = Σ d (d·μ)
    let gram = r.transpose() * r;
    let flat = Matrix2::new(
        frame.e1.dot(&(gram * frame.e1)),
        frame.e1.dot(&(gram * frame.e2)),
        frame.e2.dot(&(gram * frame.e1)),
        frame.e2.dot(&(gram * frame.e2)),
    );
    let c = inverse_or_zero(&flat) * Vector2::new(frame.e1.dot(&right), frame.e2.dot(&right));
    let point = frame.e1 * c.x + frame.e2 * c.y;
    let axis = Axis { frame, point };
    let normal = linearize(&cloud, &axis);
    let (n, markers) = (cloud.points.len(), cloud.markers());
    let known = information(&cloud, &axis);
    let mut unit = Matrix4::zeros();
    let planar: Matrix2<f64> = known.fixed_view::<2, 2>(0, 0).into();
    let shift: Matrix2<f64> = known.fixed_view::<2, 2>(2, 2).into();
    unit.fixed_view_mut::<2, 2>(0, 0)
        .copy_from(&inverse_or_zero(&planar));
    unit.fixed_view_mut::<2, 2>(2, 2)
        .copy_from(&inverse_or_zero(&shift));
    // Noise lengthens every displacement, and pulls the point towards the samples (1): that too is an error of the point.
    let pulled = point - placed(&cloud, axis, factor.s[0]).point;
    // The pairs weigh samples unevenly: the noise level comes from the best line, not from this one.
    let cost = minimize_line(&cloud, axis, Free::Line, factor.s[0])
        .map_or(normal.cost, |(_, best)| best.cost);
    let candidate = Candidate {
        estimator: "halvorsen_line",
        axis,
        own_centers: Vec::new(),
        cost,
        dof: (2 * n).saturating_sub(4 + 2 * markers),
        unit_covariance: spread_out(&unit, &frame),
        residuals: 2 * n,
        held: None,
        gain_by_turning: None,
    };
    let mut outcome = judge(&cloud, &factor, candidate, options);
    if let Outcome::Estimate(e) = &mut outcome {
        let mut of_point = e.covariance.fixed_view_mut::<3, 3>(3, 3);
        of_point += pulled * pulled.transpose();
    }
    Ok(outcome)
}
