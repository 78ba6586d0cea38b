//! The road from the input of an estimator to a judged pair of transforms, the same for all of them.
//!
//! Structural mistakes come first, rows with gross errors are blamed only where none explains the residuals.

use calib_estimator::{
    EstimatorError, Input, InputKind, Options, Outcome, Verdict, measured::DataError,
};
use nalgebra::Isometry3;

use crate::{
    gross,
    input::{HandEyeError, check, check_axes},
    judge::{judged, plausible, verdict},
    minimum::{Minimum, minimized},
    options::{COMMON, HandEyeInfo},
    outcome::HandEye,
    problem::{HandEyeWeights, Weights},
    residuals::spread,
    simulated::simulated,
    structure,
    unmodelled::unmodelled,
};

/// What `handeye` is and needs.
pub(crate) const INFO: HandEyeInfo = HandEyeInfo {
    id: "handeye",
    name: "robot–world and hand–eye, certified",
    input: InputKind::PosePairs,
    options: COMMON,
    summary: "both transforms of A X = Z B at once, with a proof of optimality",
    source: "quadratic cost with orthogonality constraints, see the book",
    fit: certified,
};

/// Least squares over both transforms.
pub(crate) fn certified(
    input: &Input<'_>,
    options: &Options,
) -> Result<Outcome<HandEye>, EstimatorError> {
    let solve = |a: &[_], b: &[_], w: Weights| Ok(minimized(a, b, w));
    run("handeye", input, options, Uncertainty::OfCost, solve)
}

/// Where an estimator's covariance comes from.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Uncertainty {
    /// (5): it minimizes the cost (1).
    OfCost,
    /// (9): it does not.
    Simulated,
}

/// From poses of both sides and weights to both transforms.
pub(crate) trait Solve:
    Fn(&[Isometry3<f64>], &[Isometry3<f64>], Weights) -> Result<Minimum, HandEyeError>
{
}

impl<F> Solve for F where
    F: Fn(&[Isometry3<f64>], &[Isometry3<f64>], Weights) -> Result<Minimum, HandEyeError>
{
}

/// Solves, after the data were checked, and judges; the noise that is stated gives the weights.
pub(crate) fn run(
    estimator: &'static str,
    input: &Input<'_>,
    options: &Options,
    uncertainty: Uncertainty,
    solve: impl Solve,
) -> Result<Outcome<HandEye>, EstimatorError> {
    options.check()?;
    let Input::PosePairs { robot, measured } = *input else {
        return Err(input.wrong(InputKind::PosePairs));
    };
    let none = HandEyeWeights::default();
    let w = Weights::of(HandEyeWeights {
        sigma_rotation: options.sigma_r.unwrap_or(none.sigma_rotation),
        sigma_translation: options.sigma_t.unwrap_or(none.sigma_translation),
    });
    let solved = check(robot, measured, 3)
        .and_then(|()| check_axes(robot))
        .and_then(|()| check_axes(measured))
        .and_then(|()| {
            fitted(
                estimator,
                [robot, measured],
                w,
                (uncertainty, &solve),
                options,
            )
        });
    match solved {
        Ok(mut found) => {
            let size = [spread(robot), spread(measured)];
            verdict(&mut found, size, robot.len(), options);
            Ok(Outcome::Estimate(Box::new(found)))
        }
        Err(error) => refused(estimator, &error),
    }
}

fn fitted(
    estimator: &'static str,
    [robot, measured]: [&[Isometry3<f64>]; 2],
    w: Weights,
    (uncertainty, solve): (Uncertainty, &impl Solve),
    options: &Options,
) -> Result<HandEye, HandEyeError> {
    let solved = |a: &[Isometry3<f64>], b: &[Isometry3<f64>]| -> Result<HandEye, HandEyeError> {
        let found = solve(a, b, w)?;
        let judged = judged(estimator, [a, b], &found, w, options);
        let covariance = match uncertainty {
            Uncertainty::OfCost => judged.covariance,
            Uncertainty::Simulated => simulated(a, &found, &judged.noise, |a, b| solve(a, b, w)),
        };
        Ok(HandEye {
            covariance,
            ..judged
        })
    };
    let structure = structure::structure(robot, measured, w, |left, a, b| {
        plausible(left, [spread(a), spread(b)])
    });
    if structure.explanation.is_some() {
        return Ok(HandEye {
            explanation: structure.explanation,
            ..solved(robot, measured)?
        });
    }
    let keep = gross::kept(robot, measured, w);
    let chosen = |poses: &[Isometry3<f64>]| -> Vec<Isometry3<f64>> {
        keep.iter().map(|&i| poses[i]).collect()
    };
    let (a, b) = (chosen(robot), chosen(measured));
    let judged = solved(&a, &b)?;
    let beyond = unmodelled(
        [robot, measured],
        &keep,
        &judged,
        options.significance,
        |left| plausible(left, [spread(robot), spread(measured)]),
    );
    Ok(HandEye {
        rejected: (0..robot.len()).filter(|i| !keep.contains(i)).collect(),
        covariance: judged.covariance.map(|c| c + beyond.covariance),
        explanation: beyond.explanation,
        open_direction: structure.open_direction,
        ..judged
    })
}

fn refused(
    estimator: &'static str,
    error: &HandEyeError,
) -> Result<Outcome<HandEye>, EstimatorError> {
    let none = |verdict| Ok(Outcome::none(estimator, verdict, error.to_string(), ()));
    match *error {
        HandEyeError::TooFew { .. } => none(Verdict::TooFew),
        HandEyeError::OneAxis { .. } | HandEyeError::NoRotation => none(Verdict::SingleAxis),
        HandEyeError::Lengths { a, b } => Err(DataError::Lengths {
            what: "poses of the robot and of the tracker",
            left: a,
            right: b,
        }
        .into()),
        HandEyeError::NotFinite { index } => Err(DataError::NotFinite {
            marker: 0,
            row: index,
        }
        .into()),
    }
}
