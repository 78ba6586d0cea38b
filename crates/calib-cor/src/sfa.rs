//! SFA: Pratt's constrained problem by constrained linear approximation (COBYLA), ten seeded starts.
//!
//! ```text
//! minimize u'Su  subject to  u'Cu = 1,      u = (a, b, c, d, e)              (paper §3.2.2, Eq. 7)
//! ```
//!
//! The points are centered and scaled to unit mean square first; in raw millimeters the entries of S
//! span 10¹² and the method stops anywhere, as a test below shows. On centered data it equals the closed form to its own
//! tolerance. It is here because the paper compares it; [`crate::algebraic`] is faster and exact.

use calib_estimator::measured::Cloud;
use nalgebra::{SMatrix, SVector, Vector3};

use crate::{
    options::{EstimatorInfo, SEEDED},
    outcome::Outcome,
    seeded::Seeded,
    sphere::{Candidate, judge, prepare},
};
use calib_estimator::{EstimatorError, Input, InputKind, Options, cloud_of};

/// What `sfa` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "sfa",
    name: "sphere fit, Pratt's constraint, COBYLA",
    input: InputKind::Points,
    options: SEEDED,
    summary: "constrained linear approximation from ten seeded starts",
    source: "Powell 1994; paper §3.2.2",
    fit,
};

/// The paper's number of starts.
const STARTS: usize = 10;
/// Evaluations allowed for each start; five unknowns need a few hundred.
const EVALUATIONS: usize = 4000;
/// First and last size of the trust region, in units of u (whose components are of order one here).
const FIRST_STEP: f64 = 0.3;
/// The best start is taken up again, each time from a tenth of the step: on a flat valley (a small range of
/// motion) the linear models stop early.
const RESTARTS: i32 = 8;
/// Below this the linear models are rounding.
const LAST_STEP: f64 = 1e-9;

/// SFA on all markers of `input` (one marker as in the paper; several share a, b, c, d).
///
/// # Errors
/// [`EstimatorError`] for data that are non-finite or of another kind.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let cloud = cloud_of(input, options)?;
    let factor = match prepare("sfa", &cloud, false) {
        Ok(factor) => factor,
        Err(answer) => return Ok(answer),
    };
    let scale = factor.mean_square.sqrt();
    let scaled: Vec<Vector3<f64>> = cloud.points.iter().map(|x| x / scale).collect();
    let (a, b) = minimize_algebraic(&cloud, &scaled, options.seed, &UNIT);
    let center = b * (-0.5 / a) * scale;
    let radii = crate::sphere::mean_radii(&cloud, &center);
    let candidate = Candidate {
        estimator: "sfa",
        center,
        radii,
        radius_bias: 1.0,
        weights: Vec::new(),
        absolute: false,
        known_bias: Vector3::zeros(),
        rejected: Vec::new(),
    };
    Ok(judge(&cloud, &factor, candidate, options))
}

/// Where the starts lie, and how far the unknowns may go.
struct Around {
    center: Vector3<f64>,
    size: f64,
    bound: f64,
}

/// Around centered points of unit mean square.
const UNIT: Around = Around {
    center: Vector3::new(0.0, 0.0, 0.0),
    size: 1.0,
    bound: 1e3,
};

/// (a, b) of least cost over all starts. The offsets e_p follow from (a, b) in closed form for all
/// markers but enter the constraint through their mean, which is the fifth unknown.
fn minimize_algebraic(
    cloud: &Cloud,
    points: &[Vector3<f64>],
    seed: u64,
    around: &Around,
) -> (f64, Vector3<f64>) {
    // S/n over (w, x, y, z, 1) with each marker's mean taken out of the first four, and the mean offset back in.
    let n = cloud.total(0..points.len());
    let mut s = SMatrix::<f64, 5, 5>::zeros();
    let mut mean = SVector::<f64, 4>::zeros();
    let row = |x: &Vector3<f64>| SVector::<f64, 4>::new(x.norm_squared(), x.x, x.y, x.z);
    for p in 0..cloud.markers() {
        let marker = || cloud.range(p).map(|k| (&points[k], cloud.weight(k)));
        let total = cloud.total(cloud.range(p));
        let own = marker().map(|(x, w)| row(x) * w).sum::<SVector<f64, 4>>() / total;
        for (x, w) in marker() {
            let d = row(x) - own;
            let mut block = s.fixed_view_mut::<4, 4>(0, 0);
            block += d * d.transpose() * (w / n);
        }
        mean += own * (total / n);
    }
    let mut full = SVector::<f64, 5>::zeros();
    full.fixed_rows_mut::<4>(0).copy_from(&mean);
    full[4] = 1.0;
    s += full * full.transpose();

    let cost = |u: &[f64], _: &mut ()| {
        let u = SVector::<f64, 5>::from_column_slice(u);
        (u.transpose() * s * u)[(0, 0)]
    };
    // u'Cu = |b|² − 4ae, held at 1 from both sides
    let norm = |u: &[f64]| u[1] * u[1] + u[2] * u[2] + u[3] * u[3] - 4.0 * u[0] * u[4];
    let below = move |u: &[f64], _: &mut ()| norm(u) - 1.0;
    let above = move |u: &[f64], _: &mut ()| 1.0 - norm(u);
    let constraints: Vec<&dyn cobyla::Func<()>> = vec![&below, &above];

    let run = |start: &[f64; 5], step: f64| -> Option<(f64, [f64; 5])> {
        let tolerances = cobyla::StopTols {
            xtol_abs: vec![LAST_STEP; 5],
            ..Default::default()
        };
        let end = cobyla::minimize(
            cost,
            start,
            &[(-around.bound, around.bound); 5],
            &constraints,
            (),
            EVALUATIONS,
            cobyla::RhoBeg::All(step),
            Some(tolerances),
        );
        // Rounding-limited with the right answer is how it ends on exact data.
        let (Ok((_, u, _)) | Err((cobyla::FailStatus::RoundoffLimited, u, _))) = end else {
            return None;
        };
        let held = norm(&u);
        if !((held - 1.0).abs() < 1e-3 && u.iter().all(|x| x.is_finite())) {
            return None;
        }
        // Back onto the constraint exactly.
        let scale = held.sqrt().recip();
        let on: [f64; 5] = std::array::from_fn(|k| u[k] * scale);
        Some((cost(&on, &mut ()), on))
    };

    let mut random = Seeded::new(seed);
    let mut best: Option<(f64, [f64; 5])> = None;
    for _ in 0..STARTS {
        // A sphere of random center around the data with a radius of their own size: u scaled to u'Cu = 1.
        let center = around.center + Vector3::from_fn(|_, _| random.symmetric()) * around.size;
        let radius = (0.5 + random.unit()) * around.size;
        let a = 0.5 / radius;
        let b = center * (-2.0 * a);
        let start = [
            a,
            b.x,
            b.y,
            b.z,
            a * (center.norm_squared() - radius * radius),
        ];
        if let Some(end) = run(&start, FIRST_STEP)
            && best.as_ref().is_none_or(|(lowest, _)| end.0 < *lowest)
        {
            best = Some(end);
        }
    }
    for k in 1..=RESTARTS {
        let Some((lowest, u)) = best else { break };
        match run(&u, FIRST_STEP * 0.1_f64.powi(k % 4)) {
            Some(end) if end.0 < lowest => best = Some(end),
            _ => {}
        }
    }
    best.map_or((f64::NAN, Vector3::repeat(f64::NAN)), |(_, u)| {
        (u[0], Vector3::new(u[1], u[2], u[3]))
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    /// The hand of the paper's study: 63 places of a marker 100 mm from the center, σ 2.5 mm, in the tracker's frame; mm.
    fn recording(random: &mut Seeded) -> (Vector3<f64>, Vec<Option<Point3<f64>>>) {
        let center = Vector3::new(1200.0, -800.0, 900.0);
        let at = |k: usize| {
            let (tilt, turn) = ((k % 7) as f64 / 6.0, (k / 7) as f64 / 8.0);
            let (tilt, turn) = (2.4 * tilt - 1.2, 3.1 * turn - 0.8);
            Vector3::new(tilt.cos() * turn.cos(), tilt.cos() * turn.sin(), tilt.sin())
        };
        let mut seen = |k: usize| {
            // Twelve uniform numbers have the spread of a normal one.
            let noise = Vector3::from_fn(|_, _| (0..12).map(|_| 0.5 * random.symmetric()).sum());
            Some(Point3::from(center + at(k) * 100.0 + noise * 2.5))
        };
        (center, (0..63).map(&mut seen).collect())
    }

    /// The paper calls SFA very unstable (§3.3). It is, as printed, in raw millimeters; the problem itself is not.
    #[test]
    fn in_raw_millimeters_it_stops_far_off() {
        let mut random = Seeded::new(3);
        let (mut raw, mut scaled): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        for _ in 0..8 {
            let (truth, seen) = recording(&mut random);
            let markers = [seen];
            let input = Input::Points(&markers);
            let found = fit(&input, &Options::default()).expect("points");
            let found = found.estimate().expect("a sphere").center.coords;
            scaled.push((found - truth).norm());
            let cloud = cloud_of(&input, &Options::default()).expect("points");
            // As generous as may be: the starts lie around the data, as large as they are.
            let points: Vec<Vector3<f64>> = markers[0].iter().flatten().map(|p| p.coords).collect();
            let middle = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
            let around = Around {
                center: middle,
                size: 100.0,
                bound: 1e9,
            };
            let (a, b) = minimize_algebraic(&cloud, &points, 0, &around);
            raw.push((b * (-0.5 / a) - truth).norm());
        }
        let largest = |e: &[f64]| e.iter().fold(0.0, |a: f64, b| a.max(*b));
        println!("error of the center: {scaled:.2?} mm scaled, {raw:.1?} mm raw");
        assert!(largest(&scaled) < 5.0, "{scaled:?}");
        let astray = raw.iter().filter(|e| e.is_nan() || **e > 20.0).count();
        assert!(astray >= 6, "{raw:?}");
    }
}
