//! Rank checks before a circle fit, and the judgment of a fitted axis.
//!
//! ```text
//! κ = (s₂² / (n − P − 1)) / σ̂²  ~  F(n − P − 1, ν)      if the points stay on a line within noise    (1)
//! C = σ² (JᵀJ)⁻¹,  the direction's weakest variance divided by 1 − 1/κ                              (2)
//! ```
//!
//! A short arc looks like a chord: its normal is known only as well as its sagitta stands out of the noise. Markers of one
//! rigid body know more ([`crate::straight`]): there κ is the gain over a motion without a turn,
//!
//! ```text
//! κ = (cost of straight motion − cost of the hinge) / 2 / σ̂²  ~  F(2, ν)    if the body does not turn    (3)
//! ```

use calib_estimator::factor::{Factor, rank_verdict};
use calib_estimator::noise::Level;
use calib_estimator::{Verdict, chance, measured::Cloud};
use calib_geometry::{Line, decompose::symmetric_eigen_small};
use nalgebra::{Matrix2, Matrix3, Matrix6, Point3, Unit, Vector3};

use crate::{
    axis_frame::{arc_covered, sign},
    circles::Axis,
    outcome::{AorEstimate, Circle, Known, Outcome},
};
use calib_estimator::Options;

/// Samples, factor and rank; `Err` carries the answer where there is no plane.
pub(crate) fn prepare(estimator: &'static str, cloud: &Cloud) -> Result<Factor, Outcome> {
    let needed = cloud.markers().max(1) + 2;
    if cloud.points.len() < needed {
        return Err(Outcome::none(
            estimator,
            Verdict::TooFew,
            format!(
                "{} samples (of markers seen at least twice), at least {needed} are needed",
                cloud.points.len()
            ),
            Known::Nothing,
        ));
    }
    let factor = Factor::of(cloud, false);
    match rank_verdict(cloud, &factor) {
        Some(verdict @ (Verdict::Coincident | Verdict::Collinear)) => Err(no_plane(
            estimator,
            verdict,
            format!(
                "the points are {verdict}: singular values {:.3e}, {:.3e}, {:.3e}",
                factor.s[0], factor.s[1], factor.s[2]
            ),
            cloud,
            &factor,
        )),
        // Exact planar data are the best that a circle can have.
        _ => Ok(factor),
    }
}

fn no_plane(
    estimator: &'static str,
    verdict: Verdict,
    reason: String,
    cloud: &Cloud,
    factor: &Factor,
) -> Outcome {
    let known = match verdict {
        Verdict::Collinear => Known::Chord(Line {
            point: Point3::from(cloud.origin),
            direction: Unit::new_normalize(factor.v.column(0).into_owned()),
        }),
        _ => Known::Nothing,
    };
    Outcome::none(estimator, verdict, reason, known)
}

/// σ of an own center, in radii, above which its circle is as good as straight: the curvature is three deviations from none.
const KNOWN_CENTER: f64 = 1.0 / 3.0;

/// Degrees of freedom below which three spreads are too uncertain to tell an arc from a cloud.
const ENOUGH_TO_TELL: usize = 9;

/// Chance, in units of the significance, from which so few samples are beyond doubt.
const BEYOND_DOUBT: f64 = 0.1;

/// Center of one marker's circle.
pub(crate) struct OwnCenter {
    pub center: Vector3<f64>,
    /// Largest variance of the center for unit noise.
    pub unit_variance: f64,
}

/// A fitted axis to be judged.
pub(crate) struct Candidate {
    pub estimator: &'static str,
    /// Relative to the cloud's origin.
    pub axis: Axis,
    /// Center of each marker's circle where they have their own; empty: all on the line.
    pub own_centers: Vec<OwnCenter>,
    /// Σ of squared residuals.
    pub cost: f64,
    /// Residuals less unknowns.
    pub dof: usize,
    /// Covariance over [direction; point] for unit noise.
    pub unit_covariance: Matrix6<f64>,
    /// Number of residuals.
    pub residuals: usize,
    /// Center that was held, world.
    pub held: Option<Point3<f64>>,
    /// What the best motion without a turn costs above the fitted one; `None` for circles that are not rigid to each other.
    pub gain_by_turning: Option<f64>,
}

/// Noise, observability, sign and the circles of each marker.
pub(crate) fn judge(
    cloud: &Cloud,
    factor: &Factor,
    candidate: Candidate,
    options: &Options,
) -> Outcome {
    let Candidate {
        estimator,
        axis,
        own_centers,
        cost,
        dof,
        unit_covariance,
        residuals,
        held,
        gain_by_turning,
    } = candidate;
    let estimated = (cost / dof.max(1) as f64).sqrt();
    let level = match (dof, options.sigma_t) {
        // As many residuals as unknowns: any noise would fit.
        (0, None) => {
            let of = "samples where no noise is stated (of markers seen at least twice)";
            let got = cloud.points.len();
            return Outcome::too_few(estimator, got, got + 1, of);
        }
        (0, Some(stated)) => Level::stated(stated),
        (_, stated) => Level::of(stated, estimated, dof as f64, options.significance),
    };
    let sigma = level.sigma;
    let test = match gain_by_turning {
        Some(gain) => turns(estimator, cloud, factor, estimated, dof, gain, options)
            .map(|kappa| Turn { kappa, doubt: None }),
        None => {
            let own = cloud.markers() == 1 || !own_centers.is_empty();
            leaves_its_line(estimator, cloud, factor, estimated, dof, own, options)
        }
    };
    let Turn { kappa, doubt } = match test {
        Ok(turn) => turn,
        Err(answer) => return answer,
    };

    let (covariance, sigma_direction) = inflated(&unit_covariance, sigma, kappa);

    let n = axis.frame.n;
    let center_of = |p: usize| own_centers.get(p).map_or(axis.point, |c| c.center);
    let angle_about = |p: usize, x: &Vector3<f64>| {
        let d = x - center_of(p);
        d.dot(&axis.frame.e2).atan2(d.dot(&axis.frame.e1))
    };
    let turns = (0..cloud.markers()).flat_map(|p| {
        let angle_about = &angle_about;
        (cloud.starts[p]..cloud.starts[p + 1]).filter_map(move |k| {
            let q = options.angles.get(cloud.labels[k].1)?;
            Some((angle_about(p, &cloud.points[k]), *q))
        })
    });
    let s = sign(&n, options.towards, turns);

    let circles = circles_of(cloud, &n, center_of, angle_about);
    // τ = (v̄ − m)·n (paper Eq. 15, ‖n‖ = 1)
    let from = held.map_or(axis.point + cloud.origin, |m| m.coords);
    let tau = (cloud.origin - from).dot(&n) * s;
    let arc = circles.iter().map(|c| c.arc).fold(0.0, f64::max);
    let weak = weak_direction(sigma_direction, options, || {
        format!(
            "arcs of at most {:.0}° with a noise of {sigma:.2e}",
            arc.to_degrees()
        )
    });
    let (verdict, reason) = match (weak, doubt) {
        ((Verdict::Ok, _), Some(doubt)) => (Verdict::Weak, Some(doubt)),
        ((Verdict::Ok, _), None) => own_centers_known(&own_centers, &circles, sigma),
        (weak, _) => weak,
    };
    let per_weight = cloud.points.len() as f64 / cloud.total(0..cloud.points.len());
    Outcome::Estimate(Box::new(AorEstimate {
        estimator,
        line: Line {
            point: held.unwrap_or_else(|| Point3::from(cloud.origin + axis.point)),
            direction: Unit::new_normalize(n * s),
        },
        in_child: None,
        covariance,
        sigma_direction,
        tau,
        circles,
        sigma,
        degrees_of_freedom: level.degrees_of_freedom,
        contradicts: level.contradicts,
        rms: (cost / residuals.max(1) as f64 * per_weight).sqrt(),
        used: cloud.points.len(),
        rejected: Vec::new(),
        verdict,
        reason,
    }))
}

/// Covariance with the share of noise taken off what the weakest direction seems to tell, and σ of that direction, (2).
fn inflated(unit_covariance: &Matrix6<f64>, sigma: f64, kappa: f64) -> (Matrix6<f64>, f64) {
    // C = σ² (JᵀJ)⁻¹
    let mut covariance = unit_covariance * (sigma * sigma);
    let of_direction: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0).into();
    let eigen = symmetric_eigen_small(&of_direction);
    let worst = eigen.vectors.column(2).into_owned();
    // 1/(1 − 1/κ) = 1 + 1/(κ − 1)
    let excess = if kappa.is_finite() {
        1.0 / (kappa - 1.0)
    } else {
        0.0
    };
    // Along the worst turn w the joint change of (n, c) is C[:, w]/C_ww.
    let mut along = nalgebra::Vector6::zeros();
    along.fixed_rows_mut::<3>(0).copy_from(&worst);
    let joint = covariance * along;
    if eigen.values[2] > 0.0 {
        covariance += joint * joint.transpose() * (excess / eigen.values[2]);
    }
    let sigma_direction = (eigen.values[2].max(0.0) * (1.0 + excess)).sqrt();
    (covariance, sigma_direction)
}

/// The circle of each marker about the axis: mean height, mean radius, arc.
fn circles_of(
    cloud: &Cloud,
    n: &Vector3<f64>,
    center_of: impl Fn(usize) -> Vector3<f64>,
    angle_about: impl Fn(usize, &Vector3<f64>) -> f64,
) -> Vec<Circle> {
    let mut circles = Vec::with_capacity(cloud.markers());
    for p in 0..cloud.markers() {
        let count = cloud.total(cloud.range(p));
        let c = center_of(p);
        let height = cloud
            .samples(p)
            .map(|(x, w)| w * (x - c).dot(n))
            .sum::<f64>()
            / count;
        let radius = cloud
            .samples(p)
            .map(|(x, w)| {
                let d = x - c;
                w * (d - n * d.dot(n)).norm()
            })
            .sum::<f64>()
            / count;
        let mut angles: Vec<f64> = cloud.marker(p).iter().map(|x| angle_about(p, x)).collect();
        circles.push(Circle {
            center: Point3::from(cloud.origin + c + n * height),
            radius,
            arc: arc_covered(&mut angles),
        });
    }
    circles
}

/// `weak` where an own center is not known against its radius.
fn own_centers_known(
    own_centers: &[OwnCenter],
    circles: &[Circle],
    sigma: f64,
) -> (Verdict, Option<String>) {
    let adrift = own_centers
        .iter()
        .zip(circles)
        .map(|(own, circle)| (own.unit_variance.max(0.0).sqrt() * sigma, circle.radius))
        .filter(|(deviation, radius)| *deviation > KNOWN_CENTER * radius)
        .max_by(|a, b| (a.0 / a.1).total_cmp(&(b.0 / b.1)));
    let Some((deviation, radius)) = adrift else {
        return (Verdict::Ok, None);
    };
    let text = format!(
        "the direction is known, the own center of a circle is not: σ {deviation:.2e} for a radius of {radius:.2e}; \
         where the markers share an axis, `line_ml` tells it"
    );
    (Verdict::Weak, Some(text))
}

/// `weak`, with the reason, where the direction is known worse than [`Options::weak_angle`].
pub(crate) fn weak_direction(
    sigma: f64,
    options: &Options,
    because: impl FnOnce() -> String,
) -> (Verdict, Option<String>) {
    if sigma <= options.weak_angle {
        return (Verdict::Ok, None);
    }
    let text = format!(
        "σ of the direction is {:.2}°, more than {:.1}°: {}",
        sigma.to_degrees(),
        options.weak_angle.to_degrees(),
        because()
    );
    (Verdict::Weak, Some(text))
}

/// The noise that a test compares with, and its degrees of freedom (`None`: stated, exact).
struct Reference {
    noise: f64,
    dof: Option<f64>,
}

impl Reference {
    /// `None` where nothing tells the noise: all is answered.
    fn of(sigma: f64, dof: usize, options: &Options) -> Option<Self> {
        /// Residual degrees of freedom from which they say more about the noise than the tracker does.
        const ENOUGH_DOF: usize = 10;
        match options.sigma_t {
            Some(noise) if dof < ENOUGH_DOF => Some(Self { noise, dof: None }),
            _ if dof == 0 => None,
            _ => Some(Self {
                noise: sigma,
                dof: Some(dof as f64),
            }),
        }
    }

    /// Sum of squares over its degrees of freedom in units of the noise, and the chance of it being noise alone.
    fn test(&self, squares: f64, dof: usize) -> (f64, f64) {
        let d = dof.max(1) as f64;
        let kappa = squares / d / (self.noise * self.noise);
        let chance = match self.dof {
            Some(noise_dof) => chance::f_tail(kappa, d, noise_dof),
            None => chance::chi2_tail(kappa * d, d),
        };
        (kappa, chance)
    }

    /// Markers that only scatter about their places: their spread is no wider than the noise.
    fn rests(&self, cloud: &Cloud, factor: &Factor, options: &Options) -> bool {
        let dof = cloud.points.len() - cloud.markers();
        self.test(factor.s[0] * factor.s[0], dof).1 > options.significance
    }

    /// The word for markers that do not turn: do they move at all?
    fn word(&self, cloud: &Cloud, factor: &Factor, options: &Options) -> Verdict {
        if !self.rests(cloud, factor, options) {
            Verdict::Collinear
        } else {
            Verdict::Coincident
        }
    }
}

/// Chance of such unlike spreads in three directions where noise alone, alike in all, makes them (Mauchly 1940, Bartlett's factor).
fn alike_in_all_directions(factor: &Factor, dof: usize) -> f64 {
    if dof < ENOUGH_TO_TELL {
        return 0.0;
    }
    let squares = factor.s.component_mul(&factor.s);
    let mean = squares.sum() / 3.0;
    let log: f64 = squares.iter().map(|x| (x / mean).ln()).sum();
    let count = dof as f64 - 23.0 / 18.0;
    chance::chi2_tail(-count * log, 5.0)
}

/// The markers turn.
struct Turn {
    /// In units of the noise variance.
    kappa: f64,
    /// Why rest is unlikely, but not excluded.
    doubt: Option<String>,
}

/// H₀: every marker stays on a line within its noise, so that s₂² is noise alone. Returns κ. `own_circles`: no two markers share a
/// center.
fn leaves_its_line(
    estimator: &'static str,
    cloud: &Cloud,
    factor: &Factor,
    sigma: f64,
    dof: usize,
    own_circles: bool,
    options: &Options,
) -> Result<Turn, Outcome> {
    let Some(reference) = Reference::of(sigma, dof, options) else {
        return Ok(Turn {
            kappa: f64::INFINITY,
            doubt: None,
        });
    };
    let across = cloud.points.len() - cloud.markers() - 1;
    let (kappa, chance) = reference.test(factor.s[1] * factor.s[1], across);
    // A circle of its own through a cloud of noise leaves too little for the noise: κ alone would take one cloud in a hundred for a circle.
    let cloudy = own_circles
        && reference.dof.is_some()
        && alike_in_all_directions(factor, across + 1) > options.significance;
    if chance <= options.significance && !cloudy {
        // So few samples cannot be asked whether they scatter alike in all directions; one cloud in a hundred passes.
        let few = own_circles && reference.dof.is_some() && across + 1 < ENOUGH_TO_TELL;
        let doubt = (few && chance > BEYOND_DOUBT * options.significance).then(|| {
            format!(
                "the marker may rest: its spread across the best line is {:.2} times the noise of {:.3e} (chance {chance:.1e}, beyond \
                 doubt below {:.0e})",
                kappa.sqrt(),
                reference.noise,
                BEYOND_DOUBT * options.significance
            )
        });
        return Ok(Turn { kappa, doubt });
    }
    let verdict = if cloudy {
        Verdict::Coincident
    } else {
        reference.word(cloud, factor, options)
    };
    let reason = format!(
        "the points are {verdict} within their noise: their spread across the best line is {:.2} times the \
         noise of {:.3e} (chance {chance:.1e}, accepted below {:.0e})",
        kappa.sqrt(),
        reference.noise,
        options.significance
    );
    Err(no_plane(estimator, verdict, reason, cloud, factor))
}

/// H₀: the markers' body does not turn, so that the hinge's gain over a straight motion is noise alone. Returns κ.
fn turns(
    estimator: &'static str,
    cloud: &Cloud,
    factor: &Factor,
    sigma: f64,
    dof: usize,
    gain: f64,
    options: &Options,
) -> Result<f64, Outcome> {
    let Some(reference) = Reference::of(sigma, dof, options) else {
        return Ok(f64::INFINITY);
    };
    let (kappa, chance) = reference.test(gain.max(0.0), 2);
    let verdict = reference.word(cloud, factor, options);
    if chance <= options.significance && verdict == Verdict::Collinear {
        return Ok(kappa);
    }
    let reason = format!(
        "the points are {verdict} within their noise: a rotation of their body explains {:.2} times the noise of \
         {:.3e} more than a straight motion (chance {chance:.1e}, accepted below {:.0e})",
        kappa.sqrt(),
        reference.noise,
        options.significance
    );
    Err(no_plane(estimator, verdict, reason, cloud, factor))
}

/// 2 × 2 inverse that is zero where singular.
pub(crate) fn inverse_or_zero(m: &Matrix2<f64>) -> Matrix2<f64> {
    m.try_inverse().unwrap_or_else(Matrix2::zeros)
}
