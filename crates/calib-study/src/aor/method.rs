//! An estimator of the table, and what is recorded of its axis.

use calib_aor::{EstimatorInfo, Input, Options, estimators};
use calib_geometry::Line;
use nalgebra::{Matrix6, Point3, Unit, UnitQuaternion, Vector3};

use crate::{
    cell::Quantity,
    tally::{Row, Tally},
};

/// A point of the axis in the tracker's frame, m.
pub(crate) const POINT: Vector3<f64> = Vector3::new(1.2, -0.8, 0.9);

/// The axis in the tracker's frame: no coordinate special.
pub(crate) fn axis() -> Unit<Vector3<f64>> {
    Unit::new_normalize(Vector3::new(-0.18, -0.83, 0.53))
}

/// The true line.
pub(crate) fn truth() -> Line {
    Line {
        point: Point3::from(POINT),
        direction: axis(),
    }
}

/// The body's arm at angle 0: across the axis at the radius, and 0.3 of it along the axis.
pub(crate) fn arm(radius: f64) -> Vector3<f64> {
    let n = axis().into_inner();
    let across = n.cross(&Vector3::x()).normalize();
    across * radius + n * (0.3 * radius)
}

/// The hinge's turn.
pub(crate) fn turned(angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&axis(), angle)
}

/// One way of using one estimator: two rows of tallies.
pub(crate) struct Method {
    pub info: &'static EstimatorInfo,
    pub options: Options,
    pub every: u64,
}

/// The method and its two rows; `bound` over `[direction; point]` at the true point, `control` for the direction.
pub(crate) fn method(
    name: &str,
    id: &str,
    options: Options,
    every: u64,
    (bound, control): (Option<Matrix6<f64>>, Option<f64>),
) -> Option<(Method, [Row; 2])> {
    let info = estimators().iter().find(|e| e.id == id)?;
    let row = |quantity, first: usize| Row {
        method: name.to_owned(),
        estimator: info.id,
        quantity,
        bound: bound
            .map(|b| b.fixed_view::<3, 3>(first, first).trace())
            .filter(|b| *b > 0.0),
        control: control.filter(|_| quantity == Quantity::Direction),
    };
    let rows = [row(Quantity::Direction, 0), row(Quantity::Offset, 3)];
    Some((
        Method {
            info,
            options,
            every,
        },
        rows,
    ))
}

impl Method {
    /// Runs the estimator; `tallies`: direction, offset. `linear`: the efficient linear estimator's direction error.
    pub fn record(&self, input: &Input<'_>, linear: Option<Vector3<f64>>, tallies: &mut [Tally]) {
        let [direction, offset] = tallies else {
            return;
        };
        let outcome = match self.info.run(input, &self.options.only(self.info.options)) {
            Ok(outcome) => outcome,
            Err(_) => {
                direction.verdict(false, false);
                offset.verdict(false, false);
                return;
            }
        };
        let Some(e) = outcome.estimate() else {
            direction.verdict(false, false);
            offset.verdict(false, false);
            return;
        };
        let observable = outcome.is_observable();
        let covariance = |first: usize| e.covariance.fixed_view::<3, 3>(first, first).trace();
        direction.error(observable, tilt(&e.line.direction), covariance(0), linear);
        // The estimate's covariance is that of its own point, not of the one nearest to ours.
        let beside = e.line.closest_point_to(&Point3::from(POINT)) - Point3::from(POINT);
        offset.error(observable, beside, f64::NAN, None);
    }
}

/// The rotation vector that turns the true axis to the estimate, across the axis; an axis has no sign.
fn tilt(estimate: &Unit<Vector3<f64>>) -> Vector3<f64> {
    let n = axis();
    let cross = n.cross(estimate);
    let sine = cross.norm();
    if sine == 0.0 {
        return cross;
    }
    let angle = sine.atan2(n.dot(estimate).abs());
    cross * (n.dot(estimate).signum() * angle / sine)
}
