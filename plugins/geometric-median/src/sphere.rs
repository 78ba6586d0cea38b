//! Points: concentric spheres, one for each marker, with the least sum of distances to the samples.
//!
//! ```text
//! min over m, r_k   Σ_k Σ_i | ‖x_ki − m‖ − r_k |
//! ```
//!
//! Not convex: a far wrong sample also fits a large sphere that takes all others for a plane, and with a smaller sum.
//! So it starts from the geometric median of the centers of seeded four-point spheres, which withstands one wrong
//! sample in six, and from the least-squares center, and the end with the smaller [`COUNTED`] quantile of residuals counts.

use calib_geometry::decompose::symmetric_eigen_small;
use calib_plugin::{Answer, Call, CorFit, Failure, Motion};
use nalgebra::{Matrix3, Vector3};

use crate::lines::{
    SETTLED, SMOOTHING, WEAK_FRACTION, inverse, largest_sigma, median, quantile, rows,
};

/// The directions to the samples must spread by this many standard deviations of the noise: fewer, and a plane of
/// points is taken for a sphere.
const EXCITATION_FACTOR: f64 = 3.0;
/// Part of the residuals that decides between two ends: the rest may be wrong samples, a little more than the starts
/// withstand. A median would take any five points on a sphere of nine for the sphere.
const COUNTED: f64 = 0.75;
/// Below this the spread is rounding.
const ROUNDING: f64 = 1e-7;
/// The median absolute deviation of normal noise is σ / 1.4826.
const MAD: f64 = 1.4826;

struct Cloud {
    origin: Vector3<f64>,
    /// Relative to the origin, marker after marker; markers with fewer than four samples are left out.
    tracks: Vec<(usize, Vec<Vector3<f64>>)>,
    samples: usize,
}

struct Spheres {
    m: Vector3<f64>,
    radii: Vec<f64>,
}

impl Cloud {
    fn of(motion: &Motion<'_>) -> Self {
        let mut tracks: Vec<(usize, Vec<Vector3<f64>>)> = (0..motion.tracks)
            .map(|k| {
                (
                    k,
                    motion
                        .points(k)
                        .flatten()
                        .map(Vector3::from)
                        .collect::<Vec<_>>(),
                )
            })
            .filter(|(_, points)| points.len() >= 4)
            .collect();
        let samples = tracks.iter().map(|(_, points)| points.len()).sum::<usize>();
        // A median keeps single far samples from costing digits.
        let origin = Vector3::from_fn(|i, _| {
            let values: Vec<f64> = tracks
                .iter()
                .flat_map(|(_, p)| p.iter().map(|x| x[i]))
                .collect();
            median(&values)
        });
        for (_, points) in &mut tracks {
            points.iter_mut().for_each(|x| *x -= origin);
        }
        Self {
            origin,
            tracks,
            samples,
        }
    }

    /// Radii as medians: the least sum of distances for a given center.
    fn around(&self, m: Vector3<f64>) -> Spheres {
        let radius = |points: &[Vector3<f64>]| {
            median(&points.iter().map(|x| (x - m).norm()).collect::<Vec<_>>())
        };
        Spheres {
            m,
            radii: self
                .tracks
                .iter()
                .map(|(_, points)| radius(points))
                .collect(),
        }
    }

    fn residuals(&self, s: &Spheres) -> Vec<f64> {
        let of = |(points, r): (&Vec<Vector3<f64>>, f64)| {
            points
                .iter()
                .map(move |x| (x - s.m).norm() - r)
                .collect::<Vec<_>>()
        };
        self.tracks
            .iter()
            .map(|(_, points)| points)
            .zip(s.radii.iter().copied())
            .flat_map(of)
            .collect()
    }
}

/// The center of spheres around which the markers move.
pub fn fit(motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
    let cloud = Cloud::of(motion);
    if cloud.tracks.is_empty() {
        return Ok(Answer::NotObservable("no marker has 4 samples".into()));
    }
    let iterations = call.integer("iterations")?;
    let starts = [
        least_squares(&cloud),
        median_of_spheres(&cloud, motion.seed, call.integer("subsets")?, call)?,
    ];
    let mut best: Option<(f64, Spheres, bool)> = None;
    for start in starts.into_iter().flatten() {
        let (spheres, settled) = descend(&cloud, cloud.around(start), iterations, call)?;
        let typical = quantile(
            &cloud
                .residuals(&spheres)
                .iter()
                .map(|e| e.abs())
                .collect::<Vec<_>>(),
            COUNTED,
        );
        if typical.is_finite() && best.as_ref().is_none_or(|(least, ..)| typical < *least) {
            best = Some((typical, spheres, settled));
        }
    }
    let Some((_, spheres, settled)) = best else {
        return Ok(Answer::NotObservable(
            "the points determine no sphere".into(),
        ));
    };

    let residuals = cloud.residuals(&spheres);
    let absolute: Vec<f64> = residuals.iter().map(|e| e.abs()).collect();
    let unknowns = 3 + spheres.radii.len();
    if cloud.samples <= unknowns {
        return Ok(Answer::NotObservable(format!(
            "{} samples for {unknowns} unknowns",
            cloud.samples
        )));
    }
    // Rousseeuw's factor for small samples.
    let finite = 1.0 + 5.0 / (cloud.samples - unknowns) as f64;
    let sigma = (MAD * median(&absolute) * finite).max(motion.sigma_t_m.unwrap_or(0.0));
    let radius = median(&spheres.radii);
    let spread = spread(&cloud, &spheres);
    let eigen = symmetric_eigen_small(&(spread / cloud.samples as f64));
    let weakest = eigen.values[0].max(0.0).sqrt();
    let needed = (EXCITATION_FACTOR * sigma / radius).max(ROUNDING);
    if weakest.is_nan() || weakest <= needed {
        return Ok(Answer::NotObservable(format!(
            "seen from the center the samples spread by {weakest:.1e} rad in one direction, {needed:.1e} are needed"
        )));
    }
    let Some(inverse) = inverse(&spread) else {
        return Ok(Answer::NotObservable(
            "the points determine no sphere".into(),
        ));
    };
    // Least absolute deviations of normal noise: σ² π/2 (Σ ũ ũᵀ)⁻¹
    let covariance = inverse * (sigma * sigma * std::f64::consts::FRAC_PI_2);
    let weakest_sigma = largest_sigma(&covariance);
    let weak = if !settled {
        Some(format!("still moving after {iterations} iterations"))
    } else if weakest_sigma > WEAK_FRACTION * radius {
        Some(format!(
            "σ of the weakest direction is {weakest_sigma:.1e} m, the radius {radius:.1e} m"
        ))
    } else {
        None
    };
    let mut radii_m = vec![0.0; motion.tracks];
    for ((track, _), radius) in cloud.tracks.iter().zip(&spheres.radii) {
        radii_m[*track] = *radius;
    }
    let squares: f64 = residuals.iter().map(|e| e * e).sum();
    Ok(Answer::Found(CorFit {
        center_m: (cloud.origin + spheres.m).into(),
        covariance_m2: Some(rows(&covariance)),
        body_points_m: Vec::new(),
        radii_m,
        rms_m: (squares / cloud.samples as f64).sqrt(),
        used: cloud.samples,
        rejected: Vec::new(),
        weak,
    }))
}

/// `Σ (u − ū)(u − ū)ᵀ`, ū the mean direction of each marker.
fn spread(cloud: &Cloud, spheres: &Spheres) -> Matrix3<f64> {
    let mut sum = Matrix3::zeros();
    for (_, points) in &cloud.tracks {
        let directions: Vec<Vector3<f64>> = points
            .iter()
            .map(|x| {
                (x - spheres.m)
                    .try_normalize(0.0)
                    .unwrap_or_else(Vector3::zeros)
            })
            .collect();
        let mean = directions.iter().sum::<Vector3<f64>>() / directions.len() as f64;
        sum += directions
            .iter()
            .map(|u| (u - mean) * (u - mean).transpose())
            .sum::<Matrix3<f64>>();
    }
    sum
}

/// Least squares of `2 x·m − c_k = |x|²`, the c_k eliminated (Kåsa).
fn least_squares(cloud: &Cloud) -> Option<Vector3<f64>> {
    let (mut a, mut b) = (Matrix3::zeros(), Vector3::zeros());
    for (_, points) in &cloud.tracks {
        let n = points.len() as f64;
        let mean = points.iter().sum::<Vector3<f64>>() / n;
        let square = points.iter().map(Vector3::norm_squared).sum::<f64>() / n;
        for x in points {
            let d = x - mean;
            a += d * d.transpose();
            b += d * (0.5 * (x.norm_squared() - square));
        }
    }
    Some(inverse(&a)? * b)
}

/// Geometric median of the centers of spheres through four samples of one marker each.
fn median_of_spheres(
    cloud: &Cloud,
    seed: u64,
    subsets: i64,
    call: &Call<'_>,
) -> Result<Option<Vector3<f64>>, Failure> {
    let mut state = seed;
    let mut below = |n: usize| {
        // SplitMix64 (Steele et al. 2014)
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n as u64) as usize
    };
    let mut centers = Vec::new();
    for k in 0..subsets {
        if k % 64 == 0 {
            call.keep_going()?;
        }
        let (_, points) = &cloud.tracks[below(cloud.tracks.len())];
        let x: [Vector3<f64>; 4] = std::array::from_fn(|_| points[below(points.len())]);
        // (x_j − x_0)·m = (|x_j|² − |x_0|²) / 2
        let a = Matrix3::from_fn(|i, j| x[i + 1][j] - x[0][j]);
        let b = Vector3::from_fn(|i, _| 0.5 * (x[i + 1].norm_squared() - x[0].norm_squared()));
        if let Some(center) = a.lu().solve(&b).filter(|c| c.iter().all(|v| v.is_finite())) {
            centers.push(center);
        }
    }
    if centers.is_empty() {
        return Ok(None);
    }
    // Weiszfeld, from the medians of the coordinates.
    let coordinate = |i: usize| median(&centers.iter().map(|c| c[i]).collect::<Vec<_>>());
    let mut m = Vector3::new(coordinate(0), coordinate(1), coordinate(2));
    for _ in 0..100 {
        let d: Vec<f64> = centers.iter().map(|c| (c - m).norm()).collect();
        let epsilon = SMOOTHING * median(&d) + f64::MIN_POSITIVE.sqrt();
        let (mut total, mut sum) = (0.0, Vector3::zeros());
        for (c, d) in centers.iter().zip(&d) {
            let w = epsilon / d.hypot(epsilon);
            total += w;
            sum += c * w;
        }
        let next = sum / total;
        let step = (next - m).norm();
        m = next;
        // A start needs no more digits.
        if step <= 1e-6 * median(&d) {
            break;
        }
    }
    Ok(m.iter().all(|v| v.is_finite()).then_some(m))
}

/// Reweighted Gauss–Newton with halved steps; true when it has settled.
fn descend(
    cloud: &Cloud,
    mut spheres: Spheres,
    iterations: i64,
    call: &Call<'_>,
) -> Result<(Spheres, bool), Failure> {
    for _ in 0..iterations {
        call.keep_going()?;
        let e = cloud.residuals(&spheres);
        let absolute: Vec<f64> = e.iter().map(|e| e.abs()).collect();
        let size = median(&spheres.radii) + spheres.m.norm();
        let epsilon = SMOOTHING * median(&absolute) + SETTLED * size + f64::MIN_POSITIVE.sqrt();
        let cost = |e: &[f64]| e.iter().map(|e| e.hypot(epsilon)).sum::<f64>();
        let before = cost(&e);

        // e ≈ e₀ − u·δm − δr_k;  weighted means take the δr_k out
        let (mut a, mut b) = (Matrix3::zeros(), Vector3::zeros());
        let mut start = 0;
        let mut means = Vec::new();
        for (_, points) in &cloud.tracks {
            let e = &e[start..start + points.len()];
            start += points.len();
            let rows: Vec<(f64, Vector3<f64>, f64)> = points
                .iter()
                .zip(e)
                .map(|(x, e)| {
                    let u = (x - spheres.m)
                        .try_normalize(0.0)
                        .unwrap_or_else(Vector3::zeros);
                    (epsilon / e.hypot(epsilon), u, *e)
                })
                .collect();
            let total: f64 = rows.iter().map(|(w, ..)| w).sum();
            let mean_u = rows.iter().map(|(w, u, _)| u * *w).sum::<Vector3<f64>>() / total;
            let mean_e = rows.iter().map(|(w, _, e)| w * e).sum::<f64>() / total;
            for (w, u, e) in &rows {
                let d = u - mean_u;
                a += d * d.transpose() * *w;
                b += d * (w * (e - mean_e));
            }
            means.push((mean_u, mean_e));
        }
        let Some(inverse) = inverse(&a) else {
            return Ok((spheres, false));
        };
        let step = inverse * b;
        let mut scale = 1.0;
        loop {
            let m = spheres.m + step * scale;
            // δr_k = ē_k − ū_k·δm
            let radii = spheres
                .radii
                .iter()
                .zip(&means)
                .map(|(r, (mean_u, mean_e))| r + scale * (mean_e - mean_u.dot(&step)))
                .collect();
            let trial = Spheres { m, radii };
            if cost(&cloud.residuals(&trial)) <= before {
                spheres = trial;
                break;
            }
            scale *= 0.5;
            // No shorter step goes down: rounding is all that is left.
            if scale < 1e-10 {
                return Ok((spheres, true));
            }
        }
        if scale * step.norm() <= SETTLED * size {
            return Ok((spheres, true));
        }
    }
    Ok((spheres, false))
}
