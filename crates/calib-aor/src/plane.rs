//! Plane fit: the two-step baseline. The axis is the normal of the best plane of each marker's samples.
//!
//! ```text
//! n = direction of least spread of x − x̄_p;   point: the circle's center in that plane (least distances), or a given center
//! ```
//!
//! Gamage & Lasenby 2002, Cerveri et al. 2005. For one clean circle it is as good as any (errors of second
//! order apart); on short arcs of several markers a common line tells more.

use calib_estimator::factor::Factor;
use calib_estimator::measured::Cloud;
use nalgebra::{Matrix2, Matrix4};

use crate::{
    axis_frame::AxisFrame,
    circles::{Axis, flat_center, information, linearize, placed, spread_out},
    judge::{Candidate, inverse_or_zero, judge, prepare},
    options::{CENTERED, EstimatorInfo},
    outcome::Outcome,
};
use calib_estimator::{EstimatorError, Input, InputKind, Options, cloud_of};

/// What `plane` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "plane",
    name: "plane fit",
    input: InputKind::Points,
    options: CENTERED,
    summary: "normal of the best plane, circle center in it: the two-step baseline",
    source: "Gamage & Lasenby 2002; Cerveri et al. 2005",
    fit,
};

/// The plane fit on all markers of `input`.
///
/// # Errors
/// [`EstimatorError`] for data that are non-finite or of another kind.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let cloud = cloud_of(input, options)?;
    let factor = match prepare("plane", &cloud) {
        Ok(factor) => factor,
        Err(answer) => return Ok(answer),
    };
    let mut axis = start(&cloud, &factor, options);
    if options.center.is_none() {
        axis = placed(&cloud, axis, factor.s[0]);
    }
    let normal = linearize(&cloud, &axis);
    let (n, markers) = (cloud.points.len(), cloud.markers());
    // Only the planar part of the cost speaks about n: Σ (d·e)² across the normal.
    let spread: Matrix2<f64> = {
        let f = axis.frame;
        let mut m = Matrix2::zeros();
        for k in 0..3 {
            let v = factor.v.column(k);
            let d = nalgebra::Vector2::new(v.dot(&f.e1), v.dot(&f.e2));
            m += d * d.transpose() * (factor.s[k] * factor.s[k]);
        }
        m
    };
    let shift: Matrix2<f64> = information(&cloud, &axis).fixed_view::<2, 2>(2, 2).into();
    let mut unit = Matrix4::zeros();
    unit.fixed_view_mut::<2, 2>(0, 0)
        .copy_from(&inverse_or_zero(&spread));
    unit.fixed_view_mut::<2, 2>(2, 2)
        .copy_from(&inverse_or_zero(&shift));
    // One circle: its radial residuals speak about the noise too. Several may not share a center.
    let (cost, dof, residuals) = if markers == 1 && options.center.is_none() && n > 3 {
        (normal.cost, 2 * n - 6, 2 * n)
    } else {
        (factor.s[2] * factor.s[2], n - markers - 2, n)
    };
    let candidate = Candidate {
        estimator: "plane",
        axis,
        own_centers: Vec::new(),
        cost,
        dof,
        unit_covariance: spread_out(&unit, &axis.frame),
        residuals,
        held: options.center,
        gain_by_turning: None,
    };
    Ok(judge(&cloud, &factor, candidate, options))
}

/// Normal of the best plane, with a point: the held center, or the circles' common center in the plane.
pub(crate) fn start(cloud: &Cloud, factor: &Factor, options: &Options) -> Axis {
    let frame = AxisFrame::of(factor.v.column(2).into_owned());
    let point = match options.center {
        Some(center) => center.coords - cloud.origin,
        None => flat_center(cloud, &frame, 0..cloud.markers()),
    };
    Axis { frame, point }
}
