//! The linear model behind the score tests: registration, nominal geometry and tested parameters, summed over the rows.
//!
//! Equations: [`continuous`](super::continuous).

use std::collections::BTreeSet;
use std::ops::Range;

use calib_geometry::decompose::{InverseRoot, inverse_root};
use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

use super::Options;
use super::chain::{Motion, Pose, Walk};
use super::channels::mounts;
use super::data::{Data, Measured};
use super::ids::{LinkIndex, SampleIndex};
use super::scan::{Fit, Scan};
use super::tested::{Instant, Test, TestedSums};
use super::whitened::{JointNoise, Tall, Whitened};

/// A marker is never known better (m): keeps the priors effective on noise-free data.
const LEAST_SIGMA: f64 = 3e-5;
/// Ridge relative to the largest diagonal entry: the mount and the registration share directions.
const RIDGE: f64 = 1e-10;
/// Rows that are summed one after the other, and how many such sums are held at once: they make the same bits on any number of cores.
const PIECE: usize = 60;
const AT_ONCE: usize = 16;

/// The linear model at one point of linearization: sums over the rows.
pub(crate) struct Model<'a> {
    pub scan: Scan<'a>,
    pub fit: Fit,
    pub tests: &'a [Test],
    /// Columns of registration, of geometry, of tests, and the residual.
    pub registration: usize,
    pub geometry: Vec<usize>,
    /// Joints whose readings move a body, in their order.
    sources: Vec<usize>,
    /// For each channel and recording the first column of its point.
    pub point_column: Vec<usize>,
}

/// Bodies whose rows err together, for joints that move one move the others; V is block-diagonal over the groups.
struct Group {
    bodies: Vec<usize>,
    channels: Vec<usize>,
    /// Column of the group → column of the model, ascending.
    columns: Vec<usize>,
    /// Column of the model → column of the group; their number where it has none.
    place: Vec<usize>,
}

/// The groups of a model, by their first body.
fn groups(model: &Model<'_>) -> Vec<Group> {
    let data = model.scan.data;
    let joints = data.chain.joints();
    let moved_by = |body: usize| -> BTreeSet<usize> {
        let path = data.chain.path(data.bodies[body].link);
        let laws = path.into_iter().flat_map(|j| &joints[j.0].law);
        laws.map(|(source, _)| source.0).collect()
    };
    let mut groups: Vec<(BTreeSet<usize>, Vec<usize>)> = Vec::new();
    for body in 0..data.bodies.len() {
        let (mut sources, mut bodies) = (moved_by(body), vec![body]);
        let (together, apart): (Vec<_>, Vec<_>) =
            groups.into_iter().partition(|g| !g.0.is_disjoint(&sources));
        for (more, others) in together {
            sources.extend(more);
            bodies.extend(others);
        }
        bodies.sort_unstable();
        groups = apart;
        groups.push((sources, bodies));
    }
    groups.sort_by(|a, b| a.1.cmp(&b.1));
    groups
        .into_iter()
        .map(|(_, bodies)| group_of(model, bodies))
        .collect()
}

fn group_of(model: &Model<'_>, bodies: Vec<usize>) -> Group {
    let (data, count) = (model.scan.data, model.scan.channels.len());
    let of_group = |k: &usize| bodies.contains(&model.scan.channels[*k].body);
    let channels: Vec<usize> = (0..count).filter(of_group).collect();
    // Registration, then the points and the joints of the group.
    let mut columns: BTreeSet<usize> = (0..6).collect();
    for (r, &k) in (0..model.scan.recordings).flat_map(|r| channels.iter().map(move |k| (r, k))) {
        let first = model.point_column[r * count + k];
        columns.extend(first..first + 3);
    }
    for joint in bodies
        .iter()
        .flat_map(|&b| data.chain.path(data.bodies[b].link))
    {
        if let Some(g) = model.geometry.iter().position(|j| *j == joint.0) {
            let first = model.registration + 6 * g;
            columns.extend(first..first + 6);
        }
    }
    let columns: Vec<usize> = columns.into_iter().collect();
    let mut place = vec![columns.len(); model.columns()];
    for (own, &column) in columns.iter().enumerate() {
        place[column] = own;
    }
    Group {
        bodies,
        channels,
        columns,
        place,
    }
}

/// Sums of a whitened model.
pub(crate) struct Sums {
    /// Products of the columns of registration and geometry and the residual, which is last.
    pub gram: DMatrix<f64>,
    /// Those of the same with the columns of the tests.
    pub cross: DMatrix<f64>,
    /// Square of every test's column.
    pub own: DVector<f64>,
    pub log_det: f64,
    pub observations: f64,
}

impl Sums {
    /// Adds those of a group with these columns.
    fn add(&mut self, own: &Self, columns: &[usize]) {
        let residual = [self.gram.ncols() - 1];
        let places: Vec<usize> = columns.iter().chain(&residual).copied().collect();
        for (own, &column) in own.gram.column_iter().zip(&places) {
            let mut to = self.gram.column_mut(column);
            places
                .iter()
                .zip(own.iter())
                .for_each(|(&row, x)| to[row] += x);
        }
        for (mut to, own) in self.cross.column_iter_mut().zip(own.cross.column_iter()) {
            places
                .iter()
                .zip(own.iter())
                .for_each(|(&row, x)| to[row] += x);
        }
        self.own += &own.own;
        self.log_det += own.log_det;
        self.observations += own.observations;
    }
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
        let geometry = moving_joints(data);
        let laws = geometry.iter().flat_map(|j| &data.chain.joints()[*j].law);
        let sources: BTreeSet<usize> = laws.map(|(source, _)| source.0).collect();
        Self {
            geometry,
            sources: sources.into_iter().collect(),
            scan,
            fit,
            tests,
            registration: next,
            point_column,
        }
    }

    /// Columns of registration and geometry.
    fn columns(&self) -> usize {
        self.registration + 6 * self.geometry.len()
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
        let [sums] = self.sums_of([lambda]);
        sums
    }

    /// [`sums`](Self::sums) for several ratios: the rows are the same.
    pub(crate) fn sums_of<const N: usize>(&self, lambdas: [f64; N]) -> [Sums; N] {
        let (width, tests) = (self.columns() + 1, self.tests.len());
        let mut out = lambdas.map(|_| Sums {
            gram: DMatrix::zeros(width, width),
            cross: DMatrix::zeros(width, tests),
            own: DVector::zeros(tests),
            log_det: 0.0,
            observations: 0.0,
        });
        let rows = self.scan.data.readings.len();
        let groups = groups(self);
        let pieces: Vec<(&Group, Range<usize>)> = groups
            .iter()
            .flat_map(|group| {
                let firsts = (0..rows).step_by(PIECE);
                firsts.map(move |first| (group, first..rows.min(first + PIECE)))
            })
            .collect();
        // A few at a time, for every sum is as large as all together.
        for some in pieces.chunks(AT_ONCE) {
            let sums: Vec<[Sums; N]> = some
                .par_iter()
                .map(|(group, rows)| self.sums_of_group(group, rows.clone(), lambdas))
                .collect();
            for ((group, _), own) in some.iter().zip(sums) {
                for (all, own) in out.iter_mut().zip(own) {
                    all.add(&own, &group.columns);
                }
            }
        }
        out
    }

    /// Those of some rows of a group, over its columns.
    fn sums_of_group<const N: usize>(
        &self,
        group: &Group,
        rows: Range<usize>,
        lambdas: [f64; N],
    ) -> [Sums; N] {
        let width = group.columns.len() + 1;
        let mut white = Tall::new(width);
        let mut out = lambdas.map(|lambda| {
            let tested = TestedSums::new(lambda, width, self.tests);
            (Whitened::new(lambda, width), tested)
        });
        let mut observations = 0.0;
        let data = self.scan.data;
        let links: Vec<LinkIndex> = group.bodies.iter().map(|&b| data.bodies[b].link).collect();
        let mut walk = Walk::new(&data.chain, &links);
        for i in rows {
            let of_row = i * self.scan.channels.len();
            let kept = group.channels.iter().copied();
            let seen: Vec<usize> = kept
                .filter(|k| self.scan.weights[of_row + k] > 0.0)
                .collect();
            if seen.is_empty() {
                continue;
            }
            walk.go(&data.chain, self.scan.readings(i));
            let (mut block, mut by_reading) = self.row(i, &seen, group, &walk);
            for (s, &k) in seen.iter().enumerate() {
                block.rows_mut(3 * s, 3).scale_mut(self.share(k));
                by_reading
                    .iter_mut()
                    .for_each(|d| d.1.rows_mut(3 * s, 3).scale_mut(self.share(k)));
            }
            let measured = 3.0 * seen.iter().map(|&k| self.share(k).powi(2)).sum::<f64>();
            observations += measured;
            let noise = JointNoise::of(&data.chain, &block, by_reading);
            if noise.is_narrow() {
                white.push(&block);
                out.iter_mut().for_each(|w| w.0.subtract(&noise));
            } else {
                out.iter_mut().for_each(|w| w.0.add(&block, &noise));
            }
            let instant = Instant {
                readings: self.scan.readings(i),
                recording: data.recording[i],
                rates: data.rates.get(i).and_then(Option::as_deref),
            };
            out.iter_mut().for_each(|w| w.1.add(&noise, &instant));
        }
        let white = white.gram();
        out.map(|(whitened, tested)| Sums {
            gram: &white + whitened.added.gram() - whitened.subtracted.gram(),
            cross: tested.cross,
            own: tested.own,
            log_det: whitened.log_det,
            observations,
        })
    }

    /// The rows of one instant: the group's columns of registration and geometry and the residual; and ∂p/∂reading for each reading.
    fn row(
        &self,
        i: usize,
        seen: &[usize],
        group: &Group,
        walk: &Walk,
    ) -> (DMatrix<f64>, Vec<(usize, DVector<f64>)>) {
        let data = self.scan.data;
        let width = group.columns.len() + 1;
        let mut block = DMatrix::zeros(3 * seen.len(), width);
        let sources = self.sources.iter();
        let mut by_reading: Vec<(usize, DVector<f64>)> = sources
            .map(|j| (*j, DVector::zeros(3 * seen.len())))
            .collect();
        for (s, &k) in seen.iter().enumerate() {
            let at = 3 * s;
            let (p, link) = self.scan.predicted(&self.fit, i, k);
            let y = self.scan.seen(&self.fit, i, k) - self.fit.registration.c;
            // r changes by δ × (Q y) for Q ← exp(δ) Q, and by the change of c
            set(&mut block, at, 0, &(-y.cross_matrix()));
            set(&mut block, at, 3, &nalgebra::Matrix3::identity());
            let column = self.point_column[data.recording[i].0 * self.scan.channels.len() + k];
            set(&mut block, at, group.place[column], &(-link.r));
            for joint in data
                .chain
                .path(data.bodies[self.scan.channels[k].body].link)
            {
                let frame = walk.root_from_joint[joint.0];
                if let Some(g) = self.geometry.iter().position(|j| *j == joint.0) {
                    // p changes by (R e_a) × (p − o) for a rotation of the joint's frame, by R e_a for a translation
                    let arm = (p - frame.t).cross_matrix();
                    let column = group.place[self.registration + 6 * g];
                    set(&mut block, at, column, &(arm * frame.r));
                    set(&mut block, at, column + 3, &(-frame.r));
                }
                let along = motion_column(data.chain.joints()[joint.0].motion, &frame, &p);
                for (source, factor) in &data.chain.joints()[joint.0].law {
                    if let Ok(place) = self.sources.binary_search(&source.0) {
                        let mut rows = by_reading[place].1.fixed_rows_mut::<3>(at);
                        rows += along * *factor;
                    }
                }
            }
            let r = self.scan.residual(&self.fit, i, k);
            block.fixed_view_mut::<3, 1>(at, width - 1).copy_from(&r);
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

/// Joints above a body whose frames carry nominal errors.
pub(crate) fn moving_joints(data: &Data) -> Vec<usize> {
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
pub(crate) struct Map {
    pub x: DVector<f64>,
    /// W with W Wᵀ = N⁻¹.
    pub root: DMatrix<f64>,
    pub chi2: f64,
    pub log_likelihood: f64,
    pub sigma: f64,
    /// Degrees of freedom left by registration and geometry, priors counted.
    pub freedom: f64,
}

/// Solves for registration and geometry; `deviation` is how far the geometry is from nominal already.
pub(crate) fn solve(
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
    let InverseRoot {
        root,
        log_det: log_n,
        ..
    } = inverse_root(&n)?;
    let x = &root * root.tr_mul(&rhs);
    let chi2 = (sums.gram[(last, last)] + prior_chi2 - rhs.dot(&x)).max(f64::MIN_POSITIVE);
    let freedom = (sums.observations - m as f64).max(1.0);
    let log_prior: f64 = precision.iter().map(|x| x.ln()).sum();
    // −2 ln L_REML = ν ln χ² + ln|V| + ln|N| − ln|P|
    let log_likelihood = -0.5 * (freedom * chi2.ln() + sums.log_det + log_n - log_prior);
    // ν = observations − tr(N⁻¹ AᵀA) = observations − p + tr(N⁻¹ P)
    let held: f64 = (0..g)
        .map(|a| root.row(m + a).norm_squared() * precision[a])
        .sum();
    let left = (sums.observations - p as f64 + held).max(1.0);
    let sigma = (chi2 / left).sqrt().max(LEAST_SIGMA);
    Some(Map {
        x,
        root,
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

/// The Gram matrix `own` of some columns after the first m of `gram` are projected out, whose products with them are `cross`, m × columns.
pub(crate) fn projected(
    gram: &DMatrix<f64>,
    cross: DMatrix<f64>,
    own: DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let m = cross.nrows();
    let mut n = gram.view((0, 0), (m, m)).into_owned();
    let ridge = RIDGE * n.diagonal().amax().max(f64::MIN_POSITIVE);
    (0..m).for_each(|a| n[(a, a)] += ridge);
    let half = inverse_root(&n)?.root.transpose() * cross;
    Some(own - half.transpose() * half)
}

#[cfg(test)]
mod tests;
