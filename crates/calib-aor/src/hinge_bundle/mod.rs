//! Hinge bundle: the axis, the markers' places around it and the joint angle of every frame, jointly.
//!
//! ```text
//! v_ip = c + F Rz(θ_i) β_p,     F = [e₁ e₂ n]                                             (1)
//! e = y + z,   y = Fᵀ(c − v_ip),  z = Rz(θ_i) β_p
//! de = (γ, δ, 0) + [y]ₓ (turn) + Rz dβ_p + (ẑ × z) dθ_i                                   (2)
//! ```
//!
//! All seen samples count, frames may miss markers. The angles are eliminated frame by frame; with encoder
//! angles ([`Options::angles`]) they are data instead. It reaches the bound where a circle for each marker does not:
//! the body is rigid, and the angle of a frame is one number for all its markers. Where the noise of such an angle is a
//! part of the arc itself (20° at 5 mm and 100 mm) nobody reaches it who treats all frames alike: see `tests/it/short_arcs.rs`.

mod bundle;

use calib_estimator::{
    EstimatorError, Input, InputKind, Options, Verdict, cloud_of,
    levenberg::{Problem as _, Stop, minimize},
};
use nalgebra::{DMatrix, Matrix4, Vector3};

use crate::{
    circles::{Axis, Free, minimize_line, spread_out},
    judge::{Candidate, judge, prepare},
    options::{COMMON, EstimatorInfo},
    outcome::{Known, Outcome},
    plane,
};
use bundle::{Bundle, State, turned};

/// What `hinge_bundle` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "hinge_bundle",
    name: "markers of a rigid body on a hinge, jointly",
    input: InputKind::Markers,
    options: COMMON,
    summary: "axis, marker layout and all joint angles at once; markers may be occluded",
    source: "joint likelihood, see the book",
    fit,
};

const MAX_STEPS: usize = 200;

/// The bundle on markers of one rigid body.
///
/// # Errors
/// [`EstimatorError`] for data that are not finite, another kind of data, or angles of another length.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    const ID: &str = "hinge_bundle";
    options.check()?;
    if !matches!(input, Input::Markers(_)) {
        return Err(input.wrong(InputKind::Markers));
    }
    let cloud = cloud_of(input, options)?;
    let factor = match prepare(ID, &cloud) {
        Ok(factor) => factor,
        Err(answer) => return Ok(answer),
    };
    let start = plane::start(&cloud, &factor, &Options::default());
    // A common line is a better start than the plane's normal, where it exists.
    let start =
        minimize_line(&cloud, start, Free::Line, factor.s[0]).map_or(start, |(axis, _)| axis);
    let problem = Bundle::of(&cloud, &options.angles, factor.s[0])?;
    let Some(state) = problem.start(start) else {
        return Ok(Outcome::none(
            ID,
            Verdict::TooFew,
            "the frames do not share enough markers to chain their angles".into(),
            Known::Nothing,
        ));
    };
    let end = minimize(&problem, state, MAX_STEPS);
    let inverse = problem
        .information(&end.x)
        .and_then(DMatrix::cholesky)
        .map(|c| c.inverse());
    let far = (end.x.axis.point - start.point).norm() > 1e4 * factor.s[0];
    let (Some(inverse), false, true) = (inverse, far, end.stop != Stop::Broken) else {
        return Ok(Outcome::none(
            ID,
            Verdict::Diverged,
            format!("no minimum after {} steps", end.iterations),
            Known::Nothing,
        ));
    };
    let unit: Matrix4<f64> = inverse.fixed_view::<4, 4>(0, 0).into();
    let candidate = Candidate {
        estimator: ID,
        axis: end.x.axis,
        own_centers: Vec::new(),
        cost: end.normal.cost,
        dof: problem.degrees_of_freedom(),
        unit_covariance: spread_out(&unit, &end.x.axis.frame),
        residuals: 3 * cloud.points.len(),
        held: None,
        gain_by_turning: problem.gain_by_turning(&end.x, &end.normal),
    };
    Ok(judge(&cloud, &factor, candidate, options))
}

/// Unit-noise covariance of (turn, shift) at the truth; `places` in the frame of the axis.
pub(crate) fn unit_bound(
    axis: &Axis,
    places: &[Vector3<f64>],
    angles: &[f64],
    angles_known: bool,
) -> Option<Matrix4<f64>> {
    let m = axis.frame.matrix();
    let frames = angles
        .iter()
        .map(|a| {
            places
                .iter()
                .enumerate()
                .map(|(p, b)| (p, axis.point + m * turned(*a, b)))
                .collect()
        })
        .collect();
    let known = if angles_known {
        angles.to_vec()
    } else {
        Vec::new()
    };
    let weights = vec![1.0; angles.len()];
    let problem = Bundle::new(frames, weights, known, places.len(), 1.0);
    // The reference frame's angle is the zero of the others.
    let zero = if angles_known {
        0.0
    } else {
        angles[problem.reference]
    };
    let truth = State {
        axis: *axis,
        angles: angles.iter().map(|a| a - zero).collect(),
        places: places.iter().map(|b| turned(zero, b)).collect(),
    };
    let (h, _) = problem.reduced(&problem.linearize(&truth), 0.0)?;
    Some(
        h.cholesky()?
            .inverse()
            .fixed_view::<4, 4>(0, 0)
            .into_owned(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{axis_frame::AxisFrame, circles::flat_center};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// What is wide of the mark at 20° and 5 mm is the likelihood's own minimum: no start finds a lower one, the truth included.
    #[test]
    fn the_minimum_is_the_lowest() {
        const RADIUS: f64 = 0.1;
        const STARTS: usize = 12;
        let axis = Axis {
            frame: AxisFrame::of(Vector3::new(-0.18, -0.83, 0.53)),
            point: Vector3::new(1.2, -0.8, 0.9),
        };
        let m = axis.frame.matrix();
        let place = |p: f64| Vector3::new((0.6 * p).cos(), (0.6 * p).sin(), 0.3 * (2.3 * p).cos());
        for (frames, trials) in [(19, 60), (10, 60), (6, 100)] {
            for seed in 0..trials {
                let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
                let mut noise = || {
                    let mut one = || Distribution::<f64>::sample(&StandardNormal, &mut rng);
                    Vector3::from_fn(|_, _| 5e-3 * one())
                };
                let tracks: Vec<Vec<_>> = (0..4)
                    .map(|p| {
                        let at = |i: i32| {
                            let angle = 0.35 * f64::from(i) / f64::from(frames - 1);
                            m * turned(angle, &(place(f64::from(p)) * RADIUS)) + axis.point
                        };
                        (0..frames)
                            .map(|i| Some((at(i) + noise()).into()))
                            .collect()
                    })
                    .collect();
                let input = Input::Markers(&tracks);
                let outcome = fit(&input, &Options::default()).expect("markers");
                let Some(found) = outcome.estimate() else {
                    continue;
                };
                let cloud = cloud_of(&input, &Options::default()).expect("markers");
                let cost = found.rms * found.rms * (3 * cloud.points.len()) as f64;
                let size = prepare("", &cloud).expect("a plane").s[0];
                let bundle = Bundle::of(&cloud, &[], size).expect("frames");
                let truth = Axis {
                    point: axis.point - cloud.origin,
                    ..axis
                };
                let everywhere = (0..STARTS).map(|k| {
                    // Fibonacci's half sphere.
                    let z = (k as f64 + 0.5) / STARTS as f64;
                    let (s, c) = (2.4 * k as f64).sin_cos();
                    let across = (1.0 - z * z).sqrt();
                    let frame = AxisFrame::of(Vector3::new(across * c, across * s, z));
                    let point = flat_center(&cloud, &frame, 0..4);
                    Axis { frame, point }
                });
                for start in everywhere.chain([truth]) {
                    let state = bundle.start(start).expect("linked frames");
                    let other = minimize(&bundle, state, MAX_STEPS).normal.cost;
                    assert!(
                        cost <= other * (1.0 + 1e-9),
                        "{frames} frames, seed {seed}: {cost:e} above {other:e}"
                    );
                }
            }
        }
    }
}
