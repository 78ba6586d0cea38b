//! An estimator of the table, and what is recorded of its axis.

use calib_aor::{EstimatorInfo, Input, Options, estimators};
use calib_geometry::Line;
use nalgebra::{Matrix6, Point3, Unit, UnitQuaternion, Vector3};

use calib_plugin::{Aor, MotionData, Shape};

use crate::{
    cell::Quantity,
    tally::{Row, Tally},
    tried::{Tool, Tried},
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
        estimator: info.id.to_owned(),
        from_plugin: false,
        quantity,
        bound: part(bound, first),
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
        let outcome = match self.info.run(input, &self.options.only(self.info.options)) {
            Ok(outcome) => outcome,
            Err(_) => {
                tallies.iter_mut().for_each(|t| t.verdict(false, false));
                return;
            }
        };
        let Some(e) = outcome.estimate() else {
            tallies.iter_mut().for_each(|t| t.verdict(false, false));
            return;
        };
        let covariance = e.covariance.fixed_view::<3, 3>(0, 0).trace();
        recorded(
            &e.line,
            (outcome.is_observable(), covariance),
            linear,
            tallies,
        );
    }
}

/// The errors of a line; the trace of the covariance of its direction may be NaN.
fn recorded(
    line: &Line,
    (observable, covariance): (bool, f64),
    linear: Option<Vector3<f64>>,
    tallies: &mut [Tally],
) {
    let [direction, offset] = tallies else {
        return;
    };
    direction.error(observable, tilt(&line.direction), covariance, linear);
    // The estimate's covariance is that of its own point, not of the one nearest to ours.
    let beside = line.closest_point_to(&Point3::from(POINT)) - Point3::from(POINT);
    offset.error(observable, beside, f64::NAN, None);
}

/// One trial of an estimator of a plugin; `tallies`: direction, offset.
pub(crate) fn record(
    tool: &Tool<dyn Aor>,
    motion: &MotionData,
    linear: Option<Vector3<f64>>,
    tallies: &mut [Tally],
) {
    match tool.axis(motion) {
        Some((line, answer)) => recorded(&line, answer, linear, tallies),
        None => tallies.iter_mut().for_each(|t| t.verdict(false, false)),
    }
}

/// Estimators of plugins that take one of these shapes, the first that fits.
pub(crate) fn taking(tried: &Tried, shapes: &[Shape]) -> Vec<(Tool<dyn Aor>, Shape)> {
    let all = tried.axes().iter();
    all.filter_map(|tool| Some((tool.clone(), tool.takes(shapes)?)))
        .collect()
}

/// The rows of an estimator of a plugin.
pub(crate) fn plugin_rows(
    tool: &Tool<dyn Aor>,
    (bound, control): (Option<Matrix6<f64>>, Option<f64>),
) -> [Row; 2] {
    [
        tool.row(Quantity::Direction, part(bound, 0), control),
        tool.row(Quantity::Offset, part(bound, 3), None),
    ]
}

/// Trace of the bound of the direction (0) or of the point (3).
fn part(bound: Option<Matrix6<f64>>, first: usize) -> Option<f64> {
    let trace = bound.map(|b| b.fixed_view::<3, 3>(first, first).trace());
    trace.filter(|b| *b > 0.0)
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
