//! Whether one center or axis explains markers to within the noise that their own distances show.
//!
//! ```text
//! σ² = Σ (d_pq − mean d_pq)² / Σ 2 (n_pq − 1)       over pairs p, q of markers; no motion changes a distance          (1)
//! ν  = (Σ k)² / Σ tr R² · Σ (n_pq − 1) / Σ n_pq     k: distances of a row, R: their correlations, u·u'/2 of a shared marker
//! s² = Σ e² / (N − p)                               least residuals about one center: |x − c| − mean of the marker;
//!                                                    about one axis: the same, and the place along it − its mean
//! κ² = max over w of (1 + (k² − 1) wᵀN w) / (1 + (k² − 1) wᵀM w),   M, N: mean u uᵀ of distances and of residuals   (2)
//! ```
//!
//! A tracker may know points k times worse along its sight w than across; the distances then show less of it than the residuals, by (2) at most.
//! Residuals are more than noise where P(F(N − p, ν) > s²/(κσ)²) < 10⁻³ says so. They refute a center or an axis where they exceed [`LIMIT`] σ as
//! well: errors that the markers of a body share, and a little backlash, leave some.

use calib_checks::rigid_body::{Distances, computed_below};
use calib_estimator::chance::f_tail;
use calib_geometry::{decompose::symmetric_eigen_small, statistics::quantile_nearest};
use nalgebra::{DMatrix, DVector, Matrix3, Point3, Unit, Vector3};
use serde_json::{Value, json};

use crate::table::Table;

/// Residuals up to this multiple of the markers' noise do not refute a center or an axis.
pub(crate) const LIMIT: f64 = 3.0;
/// k of (2): stereo trackers know a point three to five times worse along their sight.
const ALONG_SIGHT: f64 = 5.0;
/// Chance below which residuals are more than noise.
const SIGNIFICANT: f64 = 1e-3;
/// Rows that are asked; more decide nothing else.
const ROWS: usize = 2000;
/// Fewest degrees of freedom on either side.
const FEWEST: f64 = 3.0;
/// Rounds of Gauss–Newton: an estimate is the start.
const ROUNDS: usize = 20;
/// Residuals beyond this multiple of the usual ones hardly count.
const FAR: f64 = 3.0;
const ROBUST_ROUNDS: usize = 4;
/// Φ⁻¹(0.9): the 80 % quantile of |x| of a Gaussian, which gross errors in a tenth of the rows hardly move.
const QUANTILE: f64 = 1.2816;

type Tracks = [Vec<Option<Point3<f64>>>];

/// Residuals beside the noise that the distances of the markers show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MarkerNoise {
    /// (1), m.
    pub sigma_m: f64,
    pub degrees_of_freedom: f64,
    /// s, m.
    pub residual_m: f64,
    /// s in units of σ.
    pub ratio: f64,
    /// Ratio up to which the noise may be another one along the sight.
    pub of_sight: f64,
    /// Chance of such residuals at that noise.
    pub chance: f64,
    /// Residuals are beyond what a joint of one center or axis has.
    pub refuted: bool,
}

/// What the markers are supposed to turn about.
#[derive(Debug, Clone, Copy)]
pub(crate) enum About {
    Center(Point3<f64>),
    Axis(Point3<f64>, Unit<Vector3<f64>>),
}

/// `None` where the noise does not show: no two markers of one body, or too few rows. `rejected`: numbers of rows in the table's file.
pub(crate) fn marker_noise(table: &Table, rejected: &[u64], about: About) -> Option<MarkerNoise> {
    if table.origin_only || table.pair.is_some() || !table.rigid || table.markers.len() < 2 {
        return None;
    }
    let mut tracks = table.tracks();
    let excluded: Vec<usize> = (0..table.rows.len())
        .filter(|&k| rejected.contains(&table.rows[k]) || table.weights.get(k) == Some(&0.0))
        .collect();
    for track in &mut tracks {
        excluded.iter().for_each(|&k| track[k] = None);
        *track = thinned(track);
    }
    let slices: Vec<&[Option<Point3<f64>>]> = tracks.iter().map(Vec::as_slice).collect();
    judged(&Distances::of(&slices, None).without_gross(&slices), about)
}

/// Every k-th row of a long recording.
fn thinned(track: &[Option<Point3<f64>>]) -> Vec<Option<Point3<f64>>> {
    let every = track.len().div_ceil(ROWS).max(1);
    track.iter().step_by(every).copied().collect()
}

fn judged(tracks: &Tracks, about: About) -> Option<MarkerNoise> {
    // Markers that were computed from the pose of their body have no noise of their own.
    let computed = computed_below(tracks.iter().flatten().flatten(), None);
    let distances = of_distances(tracks).filter(|d| d.sigma > computed)?;
    let left = left(tracks, about, distances.sigma).filter(|r| r.freedom >= FEWEST)?;
    let more = ALONG_SIGHT * ALONG_SIGHT - 1.0;
    let of_sight = largest_ratio(
        &(Matrix3::identity() + left.directions * more),
        &(Matrix3::identity() + distances.directions * more),
    )?
    .sqrt()
    .max(1.0);
    let ratio = left.sigma / distances.sigma;
    let chance = f_tail((ratio / of_sight).powi(2), left.freedom, distances.freedom);
    let limit = of_sight.max(LIMIT) * distances.sigma;
    Some(MarkerNoise {
        sigma_m: distances.sigma,
        degrees_of_freedom: distances.freedom,
        residual_m: left.sigma,
        ratio,
        of_sight,
        chance,
        // A few rows in which the body as a whole was wrong are no other joint.
        refuted: chance < SIGNIFICANT && left.sigma.min(left.typical) > limit,
    })
}

impl MarkerNoise {
    /// For machines.
    pub fn value(&self) -> Value {
        json!({
            "sigma_m": self.sigma_m,
            "degrees_of_freedom": self.degrees_of_freedom,
            "residual_m": self.residual_m,
            "ratio": self.ratio,
            "of_sight": self.of_sight,
            "chance": self.chance,
        })
    }

    /// Residuals are more than noise.
    pub fn is_exceeded(&self) -> bool {
        self.chance < SIGNIFICANT
    }
}

/// A noise with its degrees of freedom, and the mean u uᵀ of the directions that show it.
struct Seen {
    sigma: f64,
    /// By a quantile, which few bad samples do not raise.
    typical: f64,
    freedom: f64,
    directions: Matrix3<f64>,
}

/// (1).
fn of_distances(tracks: &Tracks) -> Option<Seen> {
    let m = tracks.len();
    let pairs: Vec<(usize, usize)> = (0..m).flat_map(|j| (0..j).map(move |k| (j, k))).collect();
    let rows = tracks.iter().map(Vec::len).min()?;
    let between = |row: usize, (j, k): (usize, usize)| Some(tracks[j][row]? - tracks[k][row]?);
    let (mut squares, mut all, mut lost) = (0.0, 0.0, 0.0);
    for &pair in &pairs {
        let lengths: Vec<f64> = (0..rows)
            .filter_map(|row| Some(between(row, pair)?.norm()))
            .collect();
        squares += centered(&lengths).iter().map(|e| e * e).sum::<f64>();
        all += lengths.len() as f64;
        lost += f64::from(u8::from(!lengths.is_empty()));
    }
    let mut directions = Matrix3::zeros();
    let mut correlated = 0.0;
    for row in 0..rows {
        let seen: Vec<(usize, usize, Vector3<f64>)> = pairs
            .iter()
            .filter_map(|&(j, k)| Some((j, k, between(row, (j, k))?.try_normalize(0.0)?)))
            .collect();
        for &(j, k, u) in &seen {
            directions += u * u.transpose() / all;
            for &(p, q, v) in &seen {
                let shared = [j == p, k == q, j == q, k == p];
                let of_both = shared.iter().filter(|s| **s).count() as f64;
                correlated += (0.5 * of_both * u.dot(&v)).powi(2);
            }
        }
    }
    let freedom = all * (all - lost) / correlated;
    let sigma = (squares / (2.0 * (all - lost))).sqrt();
    (freedom >= FEWEST).then_some(Seen {
        sigma,
        typical: sigma,
        freedom,
        directions,
    })
}

/// What is left about the best center or axis near the estimate.
fn left(tracks: &Tracks, about: About, noise: f64) -> Option<Seen> {
    let markers = tracks.iter().filter(|t| t.iter().any(Option::is_some));
    let (parameters, of_each) = match about {
        About::Center(_) => (3, 1),
        About::Axis(..) => (4, 2),
    };
    let lost = (parameters + of_each * markers.count()) as f64;
    let of = |by: &DVector<f64>, centered: fn(&[f64]) -> Vec<f64>| {
        residuals(tracks, &moved(about, by), centered)
    };
    let best = minimized(DVector::zeros(parameters), |by| of(by, centered));
    let e = of(&best, centered);
    let freedom = e.len() as f64 - lost;
    // The same for most of the samples: a few that are far off, such as exchanged markers, do not pull it.
    let mut usual = (best.clone(), typical(&of(&best, about_median))?);
    for _ in 0..ROBUST_ROUNDS {
        let far = FAR * usual.1.max(LIMIT * noise);
        // Geman & McClure 1985: e²/(1 + e²/c²)
        let weighed = |e: f64| e / (e / far).hypot(1.0);
        let next = minimized(usual.0, |by| of(by, about_median).map(weighed));
        usual = (next.clone(), typical(&of(&next, about_median))?);
    }
    Some(Seen {
        sigma: (e.norm_squared() / freedom.max(1.0)).sqrt(),
        typical: usual.1,
        freedom,
        directions: mean_directions(tracks, &moved(about, &best)),
    })
}

/// σ of residuals by their 80 % quantile.
fn typical(e: &DVector<f64>) -> Option<f64> {
    let mut sizes: Vec<f64> = e.iter().map(|x| x.abs()).collect();
    Some(quantile_nearest(&mut sizes, 0.8)? / QUANTILE)
}

/// A center moved by three lengths, or an axis by two angles and two lengths.
fn moved(about: About, by: &DVector<f64>) -> About {
    match about {
        About::Center(c) => About::Center(c + Vector3::new(by[0], by[1], by[2])),
        About::Axis(p, a) => {
            let (u, v) = across(&a);
            let direction = a.into_inner() + u * by[0] + v * by[1];
            About::Axis(p + u * by[2] + v * by[3], Unit::new_normalize(direction))
        }
    }
}

/// Two directions across an axis.
fn across(a: &Unit<Vector3<f64>>) -> (Vector3<f64>, Vector3<f64>) {
    let u = a.cross(&Vector3::ith(a.iamin(), 1.0)).normalize();
    (u, a.cross(&u))
}

/// Across the way of a point: its direction from the center or axis, and its distance.
fn outward(about: &About, x: &Point3<f64>) -> (Vector3<f64>, f64) {
    let r = match about {
        About::Center(c) => x - c,
        About::Axis(p, a) => {
            let r = x - p;
            r - a.into_inner() * a.dot(&r)
        }
    };
    (r.try_normalize(0.0).unwrap_or_default(), r.norm())
}

fn residuals(tracks: &Tracks, about: &About, centered: fn(&[f64]) -> Vec<f64>) -> DVector<f64> {
    let mut all = Vec::new();
    for track in tracks {
        let seen = track.iter().flatten();
        let lengths: Vec<f64> = seen.clone().map(|x| outward(about, x).1).collect();
        all.extend(centered(&lengths));
        if let About::Axis(p, a) = about {
            let along: Vec<f64> = seen.map(|x| a.dot(&(x - p))).collect();
            all.extend(centered(&along));
        }
    }
    DVector::from_vec(all)
}

fn mean_directions(tracks: &Tracks, about: &About) -> Matrix3<f64> {
    let seen = tracks.iter().flatten().flatten();
    let (mut sum, mut n) = (Matrix3::zeros(), 0.0);
    for x in seen {
        let (u, _) = outward(about, x);
        sum += u * u.transpose();
        n += 1.0;
        if let About::Axis(_, a) = about {
            sum += a.into_inner() * a.transpose();
            n += 1.0;
        }
    }
    sum / f64::max(n, 1.0)
}

/// Differences from the mean.
fn centered(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter().map(|v| v - mean).collect()
}

/// Differences from the median.
fn about_median(values: &[f64]) -> Vec<f64> {
    let middle = quantile_nearest(&mut values.to_vec(), 0.5).unwrap_or(0.0);
    values.iter().map(|v| v - middle).collect()
}

/// Levenberg–Marquardt with differences; the unknowns are of the order of a meter and of a radian.
fn minimized(
    start: DVector<f64>,
    residuals: impl Fn(&DVector<f64>) -> DVector<f64>,
) -> DVector<f64> {
    const STEP: f64 = 1e-6;
    let (mut x, mut damping) = (start, 1e-6);
    let mut e = residuals(&x);
    for _ in 0..ROUNDS {
        let mut j = DMatrix::zeros(e.len(), x.len());
        for k in 0..x.len() {
            let mut at = x.clone();
            at[k] += STEP;
            j.set_column(k, &((residuals(&at) - &e) / STEP));
        }
        let mut h = j.transpose() * &j;
        for k in 0..x.len() {
            h[(k, k)] *= 1.0 + damping;
        }
        let Some(step) = h.cholesky().map(|c| c.solve(&(j.transpose() * &e))) else {
            break;
        };
        let next = residuals(&(&x - &step));
        if next.norm_squared() < e.norm_squared() {
            (x, e, damping) = (x - &step, next, damping * 0.1);
        } else {
            damping *= 10.0;
        }
        if step.amax() < 1e-9 {
            break;
        }
    }
    x
}

/// The largest wᵀA w / wᵀB w; B is positive definite.
fn largest_ratio(a: &Matrix3<f64>, b: &Matrix3<f64>) -> Option<f64> {
    let l = b.cholesky()?.l();
    let half = l.solve_lower_triangular(a)?;
    let whole = l.solve_lower_triangular(&half.transpose())?;
    let eigen = symmetric_eigen_small(&(0.5 * (whole + whole.transpose())));
    Some(eigen.values[2])
}
