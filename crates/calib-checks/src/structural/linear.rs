//! Continuous faults (gain, coupling by a fraction) by score tests, and the residual that nominal errors explain.
//!
//! The residuals `r = Q y + c − R m − t` are linear in small changes of the registration (Q, c, m: columns A_r), of the nominal
//! geometry (six per moving joint, with priors: A_g) and of the tested parameter (one column G per gain and per coupling):
//!
//! ```text
//! r ≈ A x + G k + e,   cov e = σ² (I + λ Σ_j D_j D_jᵀ) per row,   D_j = ∂(R m + t)/∂reading_j         joint noise
//! N = Aᵀ V⁻¹ A + P,    P = σ²/σ_prior² for the geometry
//! g = Gᵀ V⁻¹ (r − A x̂),   h = Gᵀ V⁻¹ G − Gᵀ V⁻¹ A N⁻¹ Aᵀ V⁻¹ G,   k̂ = g/h
//! T = ν ln(χ²/(χ² − g²/h)),   ν = n − tr(N⁻¹ Aᵀ V⁻¹ A)
//! ```
//!
//! λ by restricted maximum likelihood over a grid, σ² from χ². The geometry is relinearized before the tests.
//! The largest T of all tests is compared with the F quantile at `false_alarm / tests`.

use calib_geometry::se3;
use nalgebra::{Cholesky, DMatrix, DVector, Isometry3, Vector3};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::Options;
use super::candidates::span;
use super::chain::{Chain, Motion, Pose, Walk};
use super::channels::mounts;
use super::data::{Data, Measured};
use super::hypothesis::Hypothesis;
use super::ids::{JointIndex, LinkIndex, SampleIndex};
use super::scan::{Fit, Scan};

/// Joint noise against marker noise, (rad/m)²: none, and 0.003° … 0.1° for a marker of 0.3 mm.
const NOISE_RATIOS: [f64; 5] = [0.0, 0.03, 0.3, 3.0, 30.0];
/// Noise of a prismatic joint in m where a revolute one has it in rad: 0.01 mm beside 0.01°.
const PRISMATIC_NOISE: f64 = 0.06;
/// A marker is never known better (m): keeps the priors effective on noise-free data.
const LEAST_SIGMA: f64 = 3e-5;
/// Relinearizations of the geometry before the tests.
const RELINEARIZATIONS: usize = 3;
/// With fewer degrees of freedom the priors, not the data, decide a test.
const LEAST_FREEDOM: f64 = 8.0;
/// Ridge relative to the largest diagonal entry: the mount and the registration share directions.
const RIDGE: f64 = 1e-10;
/// Fall of T from the best within which another test explains the data as well (log-likelihood difference 3).
const AS_GOOD: f64 = 6.0;

/// A continuous fault that the data demand.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Continuous {
    /// [`Hypothesis::Gain`] or [`Hypothesis::Coupling`], with its estimated factor.
    pub hypothesis: Hypothesis,
    /// Standard deviation of the factor.
    pub sigma: f64,
    /// The score statistic.
    pub statistic: f64,
    /// Its familywise threshold.
    pub threshold: f64,
    /// What the fault moves the registration residual by, rms, m.
    pub effect: f64,
    /// Others whose statistic is within 6 of the largest.
    pub alternatives: Vec<Hypothesis>,
}

/// One test.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Test {
    joint: JointIndex,
    source: JointIndex,
}

impl Test {
    fn hypothesis(&self, k: f64) -> Hypothesis {
        if self.joint == self.source {
            Hypothesis::Gain {
                joint: self.joint,
                factor: 1.0 + k,
            }
        } else {
            Hypothesis::Coupling {
                joint: self.joint,
                source: self.source,
                factor: k,
            }
        }
    }
}

/// The linear model at one point of linearization: sums over the rows.
pub(crate) struct Model<'a> {
    pub scan: Scan<'a>,
    fit: Fit,
    tests: &'a [Test],
    /// Columns of registration, of geometry, of tests, and the residual.
    pub registration: usize,
    pub geometry: Vec<usize>,
    /// For each channel and recording the first column of its point.
    point_column: Vec<usize>,
}

/// Sums of a whitened model.
pub(crate) struct Sums {
    /// (columns + 1)², the residual last.
    pub gram: DMatrix<f64>,
    log_det: f64,
    observations: f64,
}

impl<'a> Model<'a> {
    pub(crate) fn new(data: &'a Data, tests: &'a [Test], screened: &[SampleIndex]) -> Self {
        let scan = Scan::new(data, screened);
        let fit = scan.fit(None);
        let n = scan.channels.len();
        let mut point_column = vec![0; scan.recordings * n];
        let mut next = 6;
        for (k, channel) in scan.channels.iter().enumerate() {
            for group in mounts(data, channel.body, scan.recordings) {
                group.iter().for_each(|&r| point_column[r * n + k] = next);
                next += 3;
            }
        }
        Self {
            geometry: moving_joints(data),
            scan,
            fit,
            tests,
            registration: next,
            point_column,
        }
    }

    fn columns(&self) -> usize {
        self.registration + 6 * self.geometry.len() + self.tests.len()
    }

    /// Weight of a channel: the twelve coordinates of a pose hold six measurements.
    fn share(&self, k: usize) -> f64 {
        match self.scan.data.bodies[self.scan.channels[k].body].measured {
            Measured::Markers(_) => 1.0,
            Measured::Poses { .. } => std::f64::consts::FRAC_1_SQRT_2,
        }
    }

    /// Sums over all rows with joint noise ratio λ.
    pub(crate) fn sums(&self, lambda: f64) -> Sums {
        let width = self.columns() + 1;
        let mut gram = DMatrix::zeros(width, width);
        let (mut log_det, mut observations) = (0.0, 0.0);
        let links: Vec<LinkIndex> = self.scan.data.bodies.iter().map(|b| b.link).collect();
        let mut walk = Walk::new(&self.scan.data.chain, &links);
        for i in 0..self.scan.data.readings.len() {
            let seen: Vec<usize> = (0..self.scan.channels.len())
                .filter(|k| self.scan.weights[i * self.scan.channels.len() + k] > 0.0)
                .collect();
            if seen.is_empty() {
                continue;
            }
            walk.go(&self.scan.data.chain, self.scan.readings(i));
            let (mut block, mut by_reading) = self.row(i, &seen, &walk);
            for (s, &k) in seen.iter().enumerate() {
                block.rows_mut(3 * s, 3).scale_mut(self.share(k));
                by_reading
                    .iter_mut()
                    .for_each(|d| d.1.rows_mut(3 * s, 3).scale_mut(self.share(k)));
            }
            if lambda > 0.0 {
                let mut v = DMatrix::identity(block.nrows(), block.nrows());
                for (j, d) in &by_reading {
                    v.ger(lambda * noise_weight(&self.scan.data.chain, *j), d, d, 1.0);
                }
                if let Some(cholesky) = Cholesky::new(v) {
                    log_det += 2.0
                        * cholesky
                            .l_dirty()
                            .diagonal()
                            .iter()
                            .map(|x| x.ln())
                            .sum::<f64>();
                    cholesky.l_dirty().solve_lower_triangular_mut(&mut block);
                }
            }
            observations += 3.0 * seen.iter().map(|&k| self.share(k).powi(2)).sum::<f64>();
            // The product of a transpose has no fast kernel.
            gram.gemm(1.0, &block.transpose(), &block, 1.0);
        }
        Sums {
            gram,
            log_det,
            observations,
        }
    }

    /// The rows of one instant: all columns and the residual; and ∂p/∂reading for each reading.
    fn row(
        &self,
        i: usize,
        seen: &[usize],
        walk: &Walk,
    ) -> (DMatrix<f64>, Vec<(usize, DVector<f64>)>) {
        let data = self.scan.data;
        let width = self.columns() + 1;
        let mut block = DMatrix::zeros(3 * seen.len(), width);
        let joints = data.chain.joints().len();
        let mut by_reading: Vec<(usize, DVector<f64>)> = (0..joints)
            .map(|j| (j, DVector::zeros(3 * seen.len())))
            .collect();
        let readings = self.scan.readings(i);
        for (s, &k) in seen.iter().enumerate() {
            let at = 3 * s;
            let (p, link) = self.scan.predicted(&self.fit, i, k);
            let y = self.scan.seen(&self.fit, i, k) - self.fit.registration.c;
            // r changes by δ × (Q y) for Q ← exp(δ) Q, and by the change of c
            set(&mut block, at, 0, &(-y.cross_matrix()));
            set(&mut block, at, 3, &nalgebra::Matrix3::identity());
            let column = self.point_column[data.recording[i].0 * self.scan.channels.len() + k];
            set(&mut block, at, column, &(-link.r));
            for joint in data
                .chain
                .path(data.bodies[self.scan.channels[k].body].link)
            {
                let frame = walk.root_from_joint[joint.0];
                if let Some(g) = self.geometry.iter().position(|j| *j == joint.0) {
                    // p changes by (R e_a) × (p − o) for a rotation of the joint's frame, by R e_a for a translation
                    let arm = (p - frame.t).cross_matrix();
                    set(&mut block, at, self.registration + 6 * g, &(arm * frame.r));
                    set(&mut block, at, self.registration + 6 * g + 3, &(-frame.r));
                }
                let along = motion_column(data.chain.joints()[joint.0].motion, &frame, &p);
                for (source, factor) in &data.chain.joints()[joint.0].law {
                    let mut rows = by_reading[source.0].1.fixed_rows_mut::<3>(at);
                    rows += along * *factor;
                }
            }
            let r = self.scan.residual(&self.fit, i, k);
            block.fixed_view_mut::<3, 1>(at, width - 1).copy_from(&r);
        }
        let first = self.registration + 6 * self.geometry.len();
        for (n, test) in self.tests.iter().enumerate() {
            // r = … − p, and p changes by ∂p/∂reading_joint · reading_source · k
            let d = &by_reading[test.joint.0].1 * -readings[test.source.0];
            block.column_mut(first + n).copy_from(&d);
        }
        by_reading.retain(|(_, d)| d.amax() > 0.0);
        (block, by_reading)
    }
}

fn set(block: &mut DMatrix<f64>, row: usize, column: usize, value: &nalgebra::Matrix3<f64>) {
    block.fixed_view_mut::<3, 3>(row, column).copy_from(value);
}

/// ∂p/∂q of a joint in the root frame.
fn motion_column(motion: Motion, frame: &Pose, p: &Vector3<f64>) -> Vector3<f64> {
    match motion {
        Motion::Fixed => Vector3::zeros(),
        Motion::Revolute(axis) => (frame.r * axis.into_inner()).cross(&(p - frame.t)),
        Motion::Prismatic(axis) => frame.r * axis.into_inner(),
    }
}

fn noise_weight(chain: &Chain, joint: usize) -> f64 {
    match chain.joints()[joint].motion {
        Motion::Prismatic(_) => PRISMATIC_NOISE * PRISMATIC_NOISE,
        _ => 1.0,
    }
}

/// Joints above a body whose frames carry nominal errors.
fn moving_joints(data: &Data) -> Vec<usize> {
    let mut joints: Vec<usize> = data
        .bodies
        .iter()
        .flat_map(|b| data.chain.path(b.link))
        .map(|j| j.0)
        .collect();
    joints.sort_unstable();
    joints.dedup();
    joints.retain(|&j| data.chain.joints()[j].motion != Motion::Fixed);
    joints
}

/// The MAP solution of a whitened model.
struct Map {
    x: DVector<f64>,
    factor: Cholesky<f64, nalgebra::Dyn>,
    chi2: f64,
    log_likelihood: f64,
    sigma: f64,
    /// Degrees of freedom left by registration and geometry, priors counted.
    freedom: f64,
}

/// Solves for registration and geometry; `deviation` is how far the geometry is from nominal already.
fn solve(
    model: &Model<'_>,
    sums: &Sums,
    sigma: f64,
    deviation: &DVector<f64>,
    options: &Options,
) -> Option<Map> {
    let (m, g) = (model.registration, 6 * model.geometry.len());
    let p = m + g;
    let last = sums.gram.ncols() - 1;
    let mut n = sums.gram.view((0, 0), (p, p)).into_owned();
    // r(x) = r + A x, minimized: right-hand side −Aᵀ r
    let mut rhs: DVector<f64> = -sums.gram.view((0, last), (p, 1)).column(0).into_owned();
    let precision = prior_precision(model, options) * (sigma * sigma);
    let mut prior_chi2 = 0.0;
    for a in 0..g {
        n[(m + a, m + a)] += precision[a];
        rhs[m + a] -= precision[a] * deviation[a];
        prior_chi2 += precision[a] * deviation[a] * deviation[a];
    }
    let ridge = RIDGE * n.diagonal().amax();
    (0..p).for_each(|a| n[(a, a)] += ridge);
    let factor = Cholesky::new(n)?;
    let x = factor.solve(&rhs);
    let chi2 = (sums.gram[(last, last)] + prior_chi2 - rhs.dot(&x)).max(f64::MIN_POSITIVE);
    let freedom = (sums.observations - m as f64).max(1.0);
    let log_n: f64 = factor
        .l_dirty()
        .diagonal()
        .iter()
        .map(|x| 2.0 * x.ln())
        .sum();
    let log_prior: f64 = precision.iter().map(|x| x.ln()).sum();
    // −2 ln L_REML = ν ln χ² + ln|V| + ln|N| − ln|P|
    let log_likelihood = -0.5 * (freedom * chi2.ln() + sums.log_det + log_n - log_prior);
    // ν = observations − tr(N⁻¹ AᵀA) = observations − p + tr(N⁻¹ P)
    let inverse = factor.inverse();
    let held: f64 = (0..g).map(|a| inverse[(m + a, m + a)] * precision[a]).sum();
    let left = (sums.observations - p as f64 + held).max(1.0);
    let sigma = (chi2 / left).sqrt().max(LEAST_SIGMA);
    Some(Map {
        x,
        factor,
        chi2,
        log_likelihood,
        sigma,
        freedom: left,
    })
}

/// 1/σ_prior² of the geometry columns.
pub(crate) fn prior_precision(model: &Model<'_>, options: &Options) -> DVector<f64> {
    let (angle, length) = (options.prior_angle.powi(-2), options.prior_length.powi(-2));
    DVector::from_fn(6 * model.geometry.len(), |a, _| {
        if a % 6 < 3 { angle } else { length }
    })
}

/// The Gram matrix of some columns after the first `m` are projected out.
pub(crate) fn projected(
    gram: &DMatrix<f64>,
    m: usize,
    first: usize,
    count: usize,
) -> Option<DMatrix<f64>> {
    let mut n = gram.view((0, 0), (m, m)).into_owned();
    let ridge = RIDGE * n.diagonal().amax().max(f64::MIN_POSITIVE);
    (0..m).for_each(|a| n[(a, a)] += ridge);
    let cross = gram.view((0, first), (m, count)).into_owned();
    let solved = Cholesky::new(n)?.solve(&cross);
    Some(gram.view((first, first), (count, count)) - cross.transpose() * solved)
}

/// The most significant continuous fault, if any is significant and large enough to matter.
pub(crate) fn continuous(
    data: &Data,
    screened: &[SampleIndex],
    options: &Options,
) -> Option<Continuous> {
    let tests = tests(data);
    if tests.is_empty() {
        return None;
    }
    let (at_map, deviation, sigma) = relinearized(data, screened, options)?;
    let (lambda, sigma) = noise_ratio(&at_map, &deviation, sigma, screened, options)?;
    let model = Model::new(&at_map, &tests, screened);
    let sums = model.sums(lambda);
    let map = solve(&model, &sums, sigma, &deviation, options)?;
    let mut scored = score_tests(&model, &sums, &map);
    scored.sort_by(|a, b| b.1.total_cmp(&a.1));
    let &(which, statistic, factor, h) = scored.first()?;
    if map.freedom < LEAST_FREEDOM {
        return None;
    }
    let threshold = threshold(options.false_alarm / tests.len() as f64, map.freedom);
    if statistic < threshold {
        return None;
    }
    let plain = model.sums(0.0);
    let first = model.registration + 6 * model.geometry.len() + which;
    let moved = projected(&plain.gram, model.registration, first, 1)?[(0, 0)].max(0.0);
    let effect = factor.abs() * (3.0 * moved / plain.observations).sqrt();
    if effect < options.least_effect {
        return None;
    }
    let alternatives = scored[1..].iter().take_while(|s| statistic - s.1 < AS_GOOD);
    Some(Continuous {
        hypothesis: tests[which].hypothesis(factor),
        sigma: map.sigma / h.sqrt(),
        statistic,
        threshold,
        effect,
        alternatives: alternatives.map(|s| tests[s.0].hypothesis(s.2)).collect(),
    })
}

/// The noise ratio λ of the largest restricted likelihood, and σ under it.
fn noise_ratio(
    data: &Data,
    deviation: &DVector<f64>,
    mut sigma: f64,
    screened: &[SampleIndex],
    options: &Options,
) -> Option<(f64, f64)> {
    let model = Model::new(data, &[], screened);
    let mut best: Option<(f64, f64, f64)> = None;
    for lambda in NOISE_RATIOS {
        let sums = model.sums(lambda);
        sigma = solve(&model, &sums, sigma, deviation, options)?.sigma;
        let map = solve(&model, &sums, sigma, deviation, options)?;
        if best.is_none_or(|b| map.log_likelihood > b.0) {
            best = Some((map.log_likelihood, lambda, sigma));
        }
    }
    best.map(|(_, lambda, sigma)| (lambda, sigma))
}

fn tests(data: &Data) -> Vec<Test> {
    let joints = data.relevant_joints();
    let mut tests = Vec::new();
    for &joint in &joints {
        for &source in joints.iter().filter(|s| span(data, **s) > 0.0) {
            tests.push(Test { joint, source });
        }
    }
    tests
}

/// (test, T, k̂, h) for every test.
fn score_tests(model: &Model<'_>, sums: &Sums, map: &Map) -> Vec<(usize, f64, f64, f64)> {
    let p = model.registration + 6 * model.geometry.len();
    let last = sums.gram.ncols() - 1;
    let count = model.tests.len();
    let cross = sums.gram.view((0, p), (p, count)).into_owned();
    let solved = map.factor.solve(&cross);
    (0..count)
        .map(|t| {
            let own = sums.gram[(p + t, p + t)];
            let h = own - cross.column(t).dot(&solved.column(t));
            let g = sums.gram[(p + t, last)] + cross.column(t).dot(&map.x);
            // A column that the geometry explains altogether tests nothing.
            if h <= 1e-9 * own || own <= 0.0 {
                return (t, 0.0, 0.0, f64::INFINITY);
            }
            let explained = (g * g / h).min(map.chi2 * (1.0 - 1e-12));
            // r + A x + G k is minimal at k = −g/h; the correction is reading += k reading_source
            let statistic = map.freedom * (map.chi2 / (map.chi2 - explained)).ln();
            (t, statistic, -g / h, h)
        })
        .collect()
}

/// T that the largest of all tests exceeds with probability `level` times their number.
fn threshold(level: f64, freedom: f64) -> f64 {
    let f = FisherSnedecor::new(1.0, freedom).map_or(1e3, |d| d.inverse_cdf(1.0 - level));
    // g²/h = χ² F/(F + ν)
    freedom * (1.0 + f / freedom).ln()
}

/// The data with the chain at its MAP geometry, how far that is from nominal, and σ.
fn relinearized(
    data: &Data,
    screened: &[SampleIndex],
    options: &Options,
) -> Option<(Data, DVector<f64>, f64)> {
    let mut data = data.clone();
    let nominal = data.chain.clone();
    let moving = moving_joints(&data);
    let mut deviation = DVector::zeros(6 * moving.len());
    let mut sigma = options.sigma;
    for _ in 0..RELINEARIZATIONS {
        let x = {
            let model = Model::new(&data, &[], screened);
            let sums = model.sums(NOISE_RATIOS[2]);
            let map = solve(&model, &sums, sigma, &deviation, options)?;
            sigma = map.sigma;
            map.x.rows(model.registration, deviation.len()).into_owned()
        };
        deviation += x;
        for (g, &j) in moving.iter().enumerate() {
            let xi = deviation.rows(6 * g, 6);
            let twist = se3::Twist::new(
                Vector3::new(xi[0], xi[1], xi[2]),
                Vector3::new(xi[3], xi[4], xi[5]),
            );
            let step: Isometry3<f64> = se3::exp(&twist);
            data.chain.joints[j].parent_from_joint = nominal.joints[j].parent_from_joint * step;
        }
    }
    Some((data, deviation, sigma))
}
