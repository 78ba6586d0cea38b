//! SCoRE: the center between two moving bodies.
//!
//! ```text
//! R_i c₁ + t_i = S_i c₂ + d_i,       [R_i  −S_i] [c₁; c₂] = d_i − t_i                       (1)
//! ```
//!
//! Least squares over both local centers at once. Ehrig et al. 2006, J. Biomech. 39(15), 2798–2809. Seen from
//! the second body it is the hot spot of the relative motion, so the same tests tell a hinge from a ball.

use crate::options::{EstimatorInfo, ROTATIONS};
use calib_estimator::{
    InputKind, Verdict,
    measured::{DataError, Pose, RowWeights},
    pose_sums::PoseSums,
};
use calib_geometry::{
    Line,
    decompose::{SvdSmall, svd_small},
    row_qr::RowQr,
};
use nalgebra::{Matrix3, Matrix6, Point3, Vector3, Vector6};

use crate::outcome::{CorEstimate, Known, Noise, NotObservable, Outcome, Shape};
use calib_estimator::{EstimatorError, Input, Options};

/// What `score` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "score",
    name: "center between two moving bodies",
    input: InputKind::TwoBodies,
    options: ROTATIONS,
    summary: "least squares over both local centers",
    source: "Ehrig et al. 2006 (SCoRE)",
    fit,
};

/// SCoRE on all rows where both bodies were seen.
///
/// # Errors
/// [`EstimatorError`] for tables of different length, poses that are no rotations, or another kind of data.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let Input::TwoBodies {
        parent: first,
        child: second,
    } = *input
    else {
        return Err(input.wrong(InputKind::TwoBodies));
    };
    let relative = second_from_first(first, second)?;
    let sums = match crate::hotspot::prepare("score", &relative, options)? {
        Ok(sums) => sums,
        Err(answer) => return Ok(in_second(answer)),
    };

    let weights = RowWeights(&options.weights);
    let pairs = || {
        first
            .iter()
            .zip(second)
            .enumerate()
            .filter_map(move |(row, (a, b))| Some((a.as_ref()?, b.as_ref()?, weights.of(row))))
            .filter(|(_, _, w)| *w > 0.0)
    };
    let (svd, x) = least_squares(pairs());
    let (in_first, in_second_body): (Vector3<f64>, Vector3<f64>) =
        (x.fixed_rows::<3>(0).into(), x.fixed_rows::<3>(3).into());

    let n = sums.n;
    let (mut rss, mut gaps) = (0.0, 0.0);
    for (a, b, w) in pairs() {
        let gap = a.transform(&in_first) - b.transform(&in_second_body);
        rss += w * gap.norm_squared();
        gaps += gap.norm();
    }
    // σ² = RSS/(3n − 6)
    let sigma2 = rss / (3 * n - 6) as f64;
    // A gap holds position noise of both bodies and their orientation noise times the levers.
    let lever = (in_first.norm_squared() + in_second_body.norm_squared()).sqrt();
    // Relative orientation noise is √2 that of one body; two thirds of it act across a lever.
    let bound = (3.0 * sigma2).sqrt() / lever;
    if let Some((verdict, reason)) =
        sums.noise_verdict(options.sigma_r, bound, 2.0, options.significance)
    {
        let known = axis_line(verdict, &sums);
        return Ok(Outcome::NotObservable(NotObservable {
            estimator: "score",
            verdict,
            reason,
            known,
        }));
    }
    let mut covariance = scaled_covariance(&svd, sigma2);
    // As in the hot spot, orientation noise lengthens AᵀA by 2nσ_r² and draws both points towards their bodies.
    let sigma_r2 = options.sigma_r.map_or_else(
        || {
            orientation_variance(
                pairs(),
                &in_first,
                &in_second_body,
                3.0 * n as f64 * sigma2 / rss,
            )
        },
        |s| s * s,
    );
    let shift = 2.0 * n as f64 * sigma_r2;
    let drawn = drawn(&svd, &x, shift);
    covariance += drawn * drawn.transpose();
    let of_center: Matrix3<f64> = covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let weakest = (sigma2 / (svd.s[5] * svd.s[5]) + drawn.norm_squared()).sqrt();
    let reach = in_first.norm().max(in_second_body.norm());
    let weak = weakest > options.weak_fraction * reach;
    Ok(Outcome::Estimate(Box::new(CorEstimate {
        estimator: "score",
        center: Point3::from(in_second_body),
        covariance: of_center,
        shape: Shape::BodyPoints {
            in_first: Point3::from(in_first),
            in_second: Point3::from(in_second_body),
            covariance,
            mean_gap: gaps / n as f64,
        },
        noise: Noise::seen(sigma2.sqrt(), None),
        // Across the levers orientation noise is added: two of three residuals of a pose carry most of the error.
        degrees_of_freedom: Some(2.0 * n as f64 - 4.0),
        rms: (rss / (3.0 * sums.total)).sqrt(),
        used: n,
        rejected: Vec::new(),
        verdict: if weak { Verdict::Weak } else { Verdict::Ok },
        reason: weak.then(|| {
            format!(
                "σ = {weakest:.3e} along the weakest direction exceeds {:.0} % of the longest lever {reach:.3e}",
                100.0 * options.weak_fraction
            )
        }),
    })))
}

/// `second_from_first`, whose rotations carry the question of one axis.
fn second_from_first(
    first: &[Option<Pose>],
    second: &[Option<Pose>],
) -> Result<Vec<Option<Pose>>, EstimatorError> {
    if first.len() != second.len() {
        return Err(EstimatorError::Data(DataError::Lengths {
            what: "poses of the two bodies",
            left: first.len(),
            right: second.len(),
        }));
    }
    let mut relative = Vec::with_capacity(first.len());
    for (row, pair) in first.iter().zip(second).enumerate() {
        relative.push(match pair {
            (Some(a), Some(b)) => {
                a.check(row)?;
                b.check(row)?;
                Some(Pose {
                    rotation: b.rotation.tr_mul(&a.rotation),
                    translation: b.rotation.tr_mul(&(a.translation - b.translation)),
                })
            }
            _ => None,
        });
    }
    Ok(relative)
}

/// (1) in least squares: its decomposition and `[c₁; c₂]`.
fn least_squares<'a>(
    pairs: impl Iterator<Item = (&'a Pose, &'a Pose, f64)>,
) -> (SvdSmall<6>, Vector6<f64>) {
    // [R_i  −S_i  d_i − t_i], each row times √w
    let mut qr = RowQr::<7>::default();
    for (a, b, w) in pairs {
        let root = w.sqrt();
        for k in 0..3 {
            let (r, s) = (a.rotation.row(k), b.rotation.row(k));
            let rhs = b.translation[k] - a.translation[k];
            let row = [r[0], r[1], r[2], -s[0], -s[1], -s[2], rhs];
            qr.push(row.map(|x| x * root));
        }
    }
    let r = qr.factor();
    let svd = svd_small(&r.fixed_view::<6, 6>(0, 0).into_owned());
    let y = svd.u.tr_mul(&r.fixed_view::<6, 1>(0, 6));
    // x = V S⁻¹ Uᵀ b
    let x: Vector6<f64> = svd.v * y.component_div(&svd.s);
    (svd, x)
}

/// The line of all rotations, where that is what the data show.
fn axis_line(verdict: Verdict, sums: &PoseSums) -> Known {
    if verdict == Verdict::SingleAxis {
        let (_, direction) = sums.axis();
        let point = sums.center(&sums.body_point(1));
        Known::AxisLine(Line {
            point: Point3::from(point),
            direction,
        })
    } else {
        Known::Nothing
    }
}

/// C = σ² Σ v_k v_kᵀ/s_k².
fn scaled_covariance(svd: &SvdSmall<6>, sigma2: f64) -> Matrix6<f64> {
    let mut covariance = Matrix6::zeros();
    for k in 0..6 {
        let v = svd.v.column(k);
        covariance += v * v.transpose() * (sigma2 / (svd.s[k] * svd.s[k]));
    }
    covariance
}

/// How far orientation noise draws x: Σ v_k (v_k·x) shift/(s_k² − shift).
fn drawn(svd: &SvdSmall<6>, x: &Vector6<f64>, shift: f64) -> Vector6<f64> {
    (0..6)
        .map(|k| {
            let (v, square) = (svd.v.column(k), svd.s[k] * svd.s[k]);
            v * (v.dot(x) * shift / (square - shift).max(0.1 * square))
        })
        .sum()
}

/// σ_r² from the gaps: along the longer lever they hold no orientation noise of its own body.
///
/// ```text
/// E|g|² = 6σ_t² + 2σ_r²(l² + s²),    E(g·û)² = 2σ_t² + σ_r² s² (1 − c²)      l ≥ s: levers, û: along l, c: cosine between them
/// ```
fn orientation_variance<'a>(
    pairs: impl Iterator<Item = (&'a Pose, &'a Pose, f64)>,
    in_first: &Vector3<f64>,
    in_second: &Vector3<f64>,
    per_degree: f64,
) -> f64 {
    let of_first = in_first.norm() >= in_second.norm();
    let (mut all, mut along, mut cosines, mut total) = (0.0, 0.0, 0.0, 0.0);
    for (a, b, w) in pairs {
        let (p, q) = (a.rotation * in_first, b.rotation * in_second);
        let gap = p + a.translation - q - b.translation;
        let (long, short) = if of_first { (p, q) } else { (q, p) };
        let unit = long.try_normalize(0.0).unwrap_or_default();
        let other = short.try_normalize(0.0).unwrap_or_default();
        all += w * gap.norm_squared();
        along += w * gap.dot(&unit).powi(2);
        cosines += unit.dot(&other).powi(2);
        total += 1.0;
    }
    let (l2, s2) = (
        in_first.norm_squared().max(in_second.norm_squared()),
        in_first.norm_squared().min(in_second.norm_squared()),
    );
    let of_noise = 2.0 * (l2 + s2) - 3.0 * s2 * (1.0 - cosines / total);
    ((all - 3.0 * along) * per_degree / total / of_noise).max(0.0)
}

/// Text of a rank verdict, with the frame its line is given in.
fn in_second(answer: Outcome) -> Outcome {
    match answer {
        Outcome::NotObservable(mut n) => {
            if matches!(n.known, Known::AxisLine(_)) {
                n.reason += " (line in the second body's frame)";
            }
            Outcome::NotObservable(n)
        }
        estimate @ Outcome::Estimate(_) => estimate,
    }
}
