//! Noise, covariance and verdict of a pair of transforms.
//!
//! ```text
//! σ_t² = Σ|e_t|² / (3n − tr H⁻¹H_t),   σ_r² = Σθ² / (3n − tr H⁻¹H_r),   H = H_t + H_r       (4)
//! C = H⁻¹ (w_t σ_t² H_t + 2 w_R σ_r² H_r) H⁻¹                                              (5)
//! ```
//!
//! The weights of (1) need not be those of the noise: (5) is the covariance of least squares with any weights.

use calib_estimator::{
    Options, Verdict,
    noise::{Contradiction, Level},
};
use nalgebra::Isometry3;

use crate::{
    certificate::certificate,
    minimum::Minimum,
    outcome::{HandEye, HandEyeNoise},
    problem::{Weights, linearize},
    residuals::{Residuals, squares},
};

/// A relative gap below this is rounding of the 19 × 19 eigenproblem.
const CERTIFIED: f64 = 1e-6;

/// Residuals above this part of the spread of the positions are not those of one rigid body: a tracker and an arm agree to a percent
/// of the range of motion, and a worn one to three.
const IMPLAUSIBLE: f64 = 0.05;
/// Orientation residuals above this are not noise: trackers know an orientation to 1°, worn arms theirs to 2°.
const IMPLAUSIBLE_ANGLE: f64 = 0.1;
/// Positions that spread over more than this, m, are not in meters: no arm reaches so far.
const NO_ARM: f64 = 30.0;
/// Part of the poses above which rejected ones speak against the recording.
const MANY: f64 = 0.1;

/// Noise, stated or from the residuals, covariance and certificate; a reason where the residuals contradict what was stated.
pub(crate) fn judged(
    estimator: &'static str,
    [a, b]: [&[Isometry3<f64>]; 2],
    found: &Minimum,
    w: Weights,
    options: &Options,
) -> HandEye {
    let Minimum { x, z, iterations } = *found;
    let (gap, least_eigenvalue) = certificate(a, b, &x, &z, w);
    let n = a.len() as f64;
    let [st, sr] = a.iter().zip(b).fold([0.0, 0.0], |sum, (a, b)| {
        let s = squares(a, b, &x, &z);
        [sum[0] + s[0], sum[1] + s[1]]
    });
    let none = Weights { rotation: 0.0, ..w };
    let h = linearize(a, b, &x, &z, w).0;
    let of_positions = linearize(a, b, &x, &z, none).0;
    let of_rotations = h - of_positions;
    let inverse = nalgebra::Cholesky::new(h).map(|c| c.inverse());
    let share = inverse.map_or(6.0, |i| (i * of_positions).trace());
    // (4)
    let freedom = [3.0 * n - share, 3.0 * n - 12.0 + share];
    let variance = |sum: f64, freedom: f64| sum / freedom.max(0.5);
    let position = Level::of(
        options.sigma_t,
        variance(st, freedom[0]).sqrt(),
        freedom[0],
        options.significance,
    );
    let rotation = Level::of(
        options.sigma_r,
        variance(sr, freedom[1]).sqrt(),
        freedom[1],
        options.significance,
    );
    let (t2, r2) = (position.sigma.powi(2), rotation.sigma.powi(2));
    // (5)
    let covariance = inverse.map(|i| {
        i * (of_positions * (w.translation * t2) + of_rotations * (2.0 * w.rotation * r2)) * i
    });
    HandEye {
        estimator,
        x,
        z,
        covariance,
        noise: HandEyeNoise {
            sigma_t: position.sigma,
            sigma_r: rotation.sigma,
            degrees_of_freedom: match (position.degrees_of_freedom, rotation.degrees_of_freedom) {
                (Some(t), Some(r)) => Some(t.min(r)),
                (one, other) => one.or(other),
            },
        },
        rms_translation: (st / n).sqrt(),
        rms_rotation: (sr / n).sqrt(),
        certified: gap <= CERTIFIED,
        gap,
        least_eigenvalue,
        used: a.len(),
        rejected: Vec::new(),
        explanation: None,
        open_direction: None,
        verdict: Verdict::Ok,
        reason: contradicted(&position, &rotation),
        iterations,
    }
}

fn contradicted(position: &Level, rotation: &Level) -> Option<String> {
    if let Some(Contradiction { stated, chance, .. }) = position.contradicts {
        return Some(format!(
            "the residuals show a position noise of {:.3} mm, {:.3} mm was stated (chance {chance:.1e})",
            position.sigma * 1e3,
            stated * 1e3
        ));
    }
    let Contradiction { stated, chance, .. } = rotation.contradicts?;
    Some(format!(
        "the residuals show an orientation noise of {:.4}°, {:.4}° was stated (chance {chance:.1e})",
        rotation.sigma.to_degrees(),
        stated.to_degrees()
    ))
}

/// Residuals that two measurements of one motion may have.
pub(crate) fn plausible(left: &Residuals, size: [f64; 2]) -> bool {
    let largest = size[0].max(size[1]);
    left.rms_rotation <= IMPLAUSIBLE_ANGLE
        && left.rms_translation <= IMPLAUSIBLE * largest
        && largest <= NO_ARM
}

/// The verdict: the first of the rules that speaks against the estimate. `size`: [`crate::residuals::spread`] of the robot's and of the measured positions;
/// `rows`: poses given.
pub(crate) fn verdict(e: &mut HandEye, size: [f64; 2], rows: usize, options: &Options) {
    let contradicted = e.reason.take();
    let reason = structural(e)
        .or_else(|| too_large(size))
        .or_else(|| implausible(e, size))
        .or(contradicted)
        .or_else(|| many_rejected(e, rows))
        .or_else(|| imprecise(e, size, options));
    if reason.is_some() {
        e.verdict = Verdict::Weak;
        e.reason = reason;
    }
}

pub(crate) fn structural(e: &HandEye) -> Option<String> {
    let found = e.explanation.as_ref()?;
    Some(format!("the tables fit after a correction: {found}"))
}

fn too_large(size: [f64; 2]) -> Option<String> {
    let largest = size[0].max(size[1]);
    (largest > NO_ARM).then(|| {
        format!("the positions spread over {largest:.0} m, more than any arm reaches: convert millimeters to meters")
    })
}

fn implausible(e: &HandEye, size: [f64; 2]) -> Option<String> {
    let limit = IMPLAUSIBLE * size[0].max(size[1]);
    if e.rms_rotation <= IMPLAUSIBLE_ANGLE && e.rms_translation <= limit {
        return None;
    }
    Some(format!(
        "the residuals of {:.2} mm and {:.2}° are too large for two measurements of one motion (limits {:.2} mm and {:.1}°), and no \
         structural mistake explains them",
        e.rms_translation * 1e3,
        e.rms_rotation.to_degrees(),
        limit * 1e3,
        IMPLAUSIBLE_ANGLE.to_degrees()
    ))
}

fn many_rejected(e: &HandEye, rows: usize) -> Option<String> {
    let part = e.rejected.len() as f64 / rows.max(1) as f64;
    (part > MANY).then(|| {
        format!(
            "{} of {rows} poses have gross errors, more than {:.0} %",
            e.rejected.len(),
            100.0 * MANY
        )
    })
}

fn imprecise(e: &HandEye, size: [f64; 2], options: &Options) -> Option<String> {
    let Some(sigmas) = e.sigmas() else {
        return Some("the poses do not fix both transforms".to_owned());
    };
    let largest = |of: [usize; 6]| of.into_iter().map(|k| sigmas[k]).fold(0.0, f64::max);
    let (angle, length) = (largest([0, 1, 2, 6, 7, 8]), largest([3, 4, 5, 9, 10, 11]));
    let limit = options.weak_fraction * size[0].max(size[1]);
    if angle > options.weak_angle {
        return Some(format!(
            "σ of an orientation is {:.2}°, more than {:.1}°",
            angle.to_degrees(),
            options.weak_angle.to_degrees()
        ));
    }
    (length > limit).then(|| {
        format!(
            "σ of a translation is {:.2} mm, more than {:.0} % of the spread of the positions",
            length * 1e3,
            100.0 * options.weak_fraction
        )
    })
}
