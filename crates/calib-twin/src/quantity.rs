//! What a calibration finds, against the truth.
//!
//! ```text
//! transform   e = log(T⁻¹ T̂) in [ω; v] of the child, σ from its covariance                            (1)
//! parameter   e = x̂ − x                                                                              (2)
//! position    e_k = p̂(q_k) − p(q_k) of a body in the tracker's frame, over postures k                 (3)
//! ```
//!
//! Of (3) the error is √mean|e_k|², σ is √mean tr C_k, and what is covered is the share of postures with `e_kᵀ C_k⁻¹ e_k ≤ 3 F₀.₉₅(3, ν)`.

use calib_core::{ParameterClass, Target};
use calib_finding::Unit;
use calib_geometry::se3;
use calib_pipeline::estimated::Estimated;
use calib_pipeline::formulate::formulation::MlFit;
use calib_pipeline::verify::accuracy::configuration;
use nalgebra::{Cholesky, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

use crate::truth::{Truth, is_moved, tracked_point};

/// Something that a calibration states with a σ.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Quantity {
    /// Position of a body as the tracker sees it, over the postures of the session, m.
    Position {
        /// The body.
        body: String,
    },
    /// One direction of a transform of the report: 0 to 2 rotations about x, y, z (rad), 3 to 5 translations along them (m), in the child's axes.
    Transform {
        /// Its name.
        name: String,
        /// The direction.
        direction: u8,
    },
    /// A parameter of a joint, in its unit.
    Parameter {
        /// Its name.
        name: String,
    },
}

/// How far one trial is off in one quantity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Off {
    /// The quantity.
    pub of: Quantity,
    /// Its unit.
    pub unit: Unit,
    /// Found minus true; of a position the root mean square over the postures.
    pub error: f64,
    /// σ that the calibration states.
    pub sigma: f64,
    /// 1 where the interval of 95 % holds the truth, 0 where not; of a position the share of postures.
    pub covered: f64,
    /// Share of what is known that the data give; the rest is the prior's.
    pub by_data: f64,
}

/// σ below this is no uncertainty: what is stated, or measured against itself.
const NOTHING: f64 = 1e-12;

/// Every quantity that a calibration states.
#[must_use]
pub fn errors(of: &Estimated, fit: &MlFit, truth: &Truth, places: &[Vec<f64>]) -> Vec<Off> {
    let freedom = fit.solution.degrees_of_freedom.max(1.0);
    let mut all = positions(of, fit, truth, places);
    all.extend(transforms(of, truth, freedom));
    all.extend(parameters(fit, truth, freedom));
    all
}

/// An error with its σ, covered where it lies within the 95 % of Student's t.
fn scalar(
    (of, unit): (Quantity, Unit),
    (error, sigma): (f64, f64),
    freedom: f64,
    by_data: f64,
) -> Option<Off> {
    let student = StudentsT::new(0.0, 1.0, freedom).ok()?;
    let within = error.abs() <= student.inverse_cdf(0.975) * sigma;
    let stated = sigma.is_finite() && sigma > NOTHING && error.is_finite();
    stated.then_some(Off {
        of,
        unit,
        error,
        sigma,
        covered: f64::from(u8::from(within)),
        by_data,
    })
}

/// Equation (3).
fn positions(of: &Estimated, fit: &MlFit, truth: &Truth, places: &[Vec<f64>]) -> Vec<Off> {
    let region = FisherSnedecor::new(3.0, fit.solution.degrees_of_freedom.max(1.0));
    let region = region.map_or(f64::INFINITY, |f| 3.0 * f.inverse_cdf(0.95));
    let found = &fit.calibration;
    let mut all = Vec::new();
    for (name, body) in &of.inputs.robot.profile.bodies {
        if !is_moved(&of.inputs, body.link) {
            continue;
        }
        let frame = fit.formulation.bodies.get(name).copied();
        let of_points = fit.formulation.points.get(name);
        let point = of_points.and_then(|points| points.values().next().copied());
        let target = frame.map(Target::Frame).or(point.map(Target::Point));
        let framed = frame.is_some();
        let on_link = |robot| tracked_point(robot, name, framed);
        let (Some(target), Some(at), Some(true_at)) =
            (target, on_link(found), on_link(&truth.robot))
        else {
            continue;
        };
        let (mut squares, mut variances, mut inside, mut n) = (0.0, 0.0, 0.0, 0.0);
        for q in places {
            let link = body.link.index();
            let seen = found.tracker_from_root * found.root_from_link(q)[link] * at;
            let robot = &truth.robot;
            let real = robot.tracker_from_root * robot.root_from_link(q)[link] * true_at;
            let e: Vector3<f64> = seen - real;
            let posture = configuration(&of.inputs, fit, q);
            let stated = fit
                .solution
                .known_point(fit.formulation.tracker, target, &posture);
            let Some(c) = stated.ok().and_then(|s| s.covariance) else {
                continue;
            };
            let chi2 = Cholesky::new(c).map(|root| e.dot(&root.solve(&e)));
            squares += e.norm_squared();
            variances += c.trace();
            inside += f64::from(u8::from(chi2.is_some_and(|chi2| chi2 <= region)));
            n += 1.0;
        }
        if n > 0.0 && variances > NOTHING * NOTHING {
            all.push(Off {
                of: Quantity::Position { body: name.clone() },
                unit: Unit::Meter,
                error: (squares / n).sqrt(),
                sigma: (variances / n).sqrt(),
                covered: inside / n,
                by_data: 1.0,
            });
        }
    }
    all
}

/// Equation (1), without directions that the data do not see.
fn transforms(of: &Estimated, truth: &Truth, freedom: f64) -> Vec<Off> {
    /// A direction with a larger part that nothing determines is not stated.
    const OPEN: f64 = 1e-3;
    let mut all = Vec::new();
    for found in &of.solved.found {
        let Some(covariance) = found.covariance else {
            continue;
        };
        let frame = |name: &str| truth.frame(&of.inputs, name);
        let origins = &of.inputs.robot.profile.origins;
        let origin = found.origin.as_ref().and_then(|name| origins.get(name));
        let child = match origin {
            Some(origin) => frame(&of.inputs.robot.model.link(origin.link).name),
            None => frame(&found.child),
        };
        let real = frame(&found.parent).inverse() * child;
        let e = se3::log(&(real.inverse() * found.pose));
        let e = [e.angular(), e.linear()];
        for direction in 0..6_u8 {
            let i = usize::from(direction);
            let open = |u: &calib_report::Unobservable| u.direction[i].abs() > OPEN;
            if found.unobservable.iter().any(open) {
                continue;
            }
            let quantity = Quantity::Transform {
                name: found.name.clone(),
                direction,
            };
            let sigma = covariance[(i, i)].max(0.0).sqrt();
            let unit = if i < 3 { Unit::Radian } else { Unit::Meter };
            let off = (e[i / 3][i % 3], sigma);
            all.extend(scalar((quantity, unit), off, freedom, 1.0));
        }
    }
    all
}

/// Equation (2) for what belongs to a joint and is no convention.
fn parameters(fit: &MlFit, truth: &Truth, freedom: f64) -> Vec<Off> {
    let found = fit.solution.parameters.iter();
    let of_joints = found.filter(|p| p.joint.is_some() && !p.at_bound);
    let known = of_joints.filter(|p| p.class != ParameterClass::NotObservable);
    let off = |p: &calib_core::ParameterEstimate| {
        let of = Quantity::Parameter {
            name: p.name.clone(),
        };
        let error = p.value - truth.values.get(&p.name)?;
        scalar(
            (of, unit_of(p.unit)),
            (error, p.sigma?),
            freedom,
            p.data_share,
        )
    };
    known.filter_map(off).collect()
}

/// A unit of the solver as one of the report.
#[must_use]
pub fn unit_of(unit: calib_core::Unit) -> Unit {
    match unit {
        calib_core::Unit::Meter => Unit::Meter,
        calib_core::Unit::Radian => Unit::Radian,
        calib_core::Unit::Second => Unit::Second,
        calib_core::Unit::RadianPerNewtonMeter => Unit::RadianPerNewtonMeter,
        calib_core::Unit::MeterPerNewton => Unit::MeterPerNewton,
        calib_core::Unit::PerKelvin => Unit::PerKelvin,
        calib_core::Unit::KilogramMeter => Unit::KilogramMeter,
        calib_core::Unit::One => Unit::One,
    }
}
