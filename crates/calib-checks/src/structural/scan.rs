//! Scores of hypotheses: the residual of the best registration under each.

use std::sync::OnceLock;

use nalgebra::Vector3;

use super::chain::{Axis, Pose, Walk};
use super::channels::{Channel, channels_of, mounts, point};
use super::correct::{correct, remount};
use super::data::{Data, Measured};
use super::hypothesis::{Hypothesis, Scope, Scoped};
use super::ids::{LinkIndex, RecordingIndex, SampleIndex};
use super::moments::{Moments, Normal, Placed, Registration};

/// Residual of a hypothesis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Score {
    /// Root mean square of the residual vectors, m, for the degrees of freedom that are left.
    pub rms: f64,
    /// `rms` per unit of the measured coordinates: what hypotheses are compared by.
    pub score: f64,
}

/// A hypothesis with its residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scored {
    pub scoped: Scoped,
    pub score: Score,
}

impl Scored {
    /// What is left, m, as it stands beside what `best` leaves: another unit of length would make any residual small.
    pub fn left_beside(&self, best: &Self) -> f64 {
        let is_unit = |s: &Self| matches!(s.scoped.hypothesis, Hypothesis::TrackerUnit { .. });
        match is_unit(self) && !is_unit(best) {
            true => self.score.score,
            false => self.score.rms,
        }
    }
}

/// The data laid out for scoring: sums of the uncorrected data per recording, and what a hypothesis needs to change them.
pub(crate) struct Scan<'a> {
    pub data: &'a Data,
    pub channels: Vec<Channel>,
    pub recordings: usize,
    /// rows × joints; an empty column is 0.
    readings: Vec<f64>,
    /// The row has every reading that it needs.
    pub(super) usable: Vec<bool>,
    /// rows × channels, m, centered.
    pub(super) points: Vec<Vector3<f64>>,
    /// rows × channels; 0 where lost, screened or without readings.
    pub weights: Vec<f64>,
    center: Vector3<f64>,
    /// rows × bodies.
    pub(super) poses: Vec<Pose>,
    /// recordings × channels.
    pub(super) sums: Vec<Moments>,
    pub(super) walk: Walk,
    /// rows × joints; found when a hypothesis first asks.
    pub(super) axes: OnceLock<Vec<Axis>>,
}

/// A registration with the points in their links, for residuals.
pub(crate) struct Fit {
    pub registration: Registration,
    /// recordings × channels: the point in its link, m.
    pub points: Vec<Vector3<f64>>,
    pub score: Score,
    /// The center that was subtracted from the measured points, m.
    pub center: Vector3<f64>,
}

impl<'a> Scan<'a> {
    /// Lays out the data; `screened` samples are left out.
    pub(crate) fn new(data: &'a Data, screened: &[SampleIndex]) -> Self {
        let channels = channels_of(data);
        let recordings = data.recordings();
        let empty = data.assumed_zero();
        let relevant = data.relevant_joints();
        let joints = data.chain.joints.len();
        let rows = data.readings.len();
        let mut readings = vec![0.0; rows * joints];
        let mut usable = vec![true; rows];
        for i in 0..rows {
            for j in 0..joints {
                readings[i * joints + j] = data.readings[i][j].unwrap_or(0.0);
            }
            usable[i] = relevant.iter().all(|j| {
                data.readings[i][j.0].is_some() || empty.contains(&(*j, data.recording[i]))
            });
        }
        let mut links: Vec<LinkIndex> = data.bodies.iter().map(|b| b.link).collect();
        links.dedup();
        let mut scan = Self {
            data,
            recordings,
            readings,
            points: vec![Vector3::zeros(); rows * channels.len()],
            weights: vec![0.0; rows * channels.len()],
            center: Vector3::zeros(),
            poses: vec![Pose::IDENTITY; rows * data.bodies.len()],
            sums: Vec::new(),
            walk: Walk::new(&data.chain, &links),
            axes: OnceLock::new(),
            usable,
            channels,
        };
        scan.read_points();
        scan.screen(screened);
        scan
    }

    fn read_points(&mut self) {
        let mut count = 0.0;
        let n = self.channels.len();
        for i in 0..self.data.readings.len() {
            for (k, channel) in self.channels.iter().enumerate() {
                if let Some(y) = point(self.data, i, channel, None)
                    && self.usable[i]
                {
                    self.points[i * n + k] = y;
                    self.weights[i * n + k] = 1.0;
                    self.center += y;
                    count += 1.0;
                }
            }
        }
        self.center /= f64::max(count, 1.0);
        let center = self.center;
        self.points.iter_mut().for_each(|p| *p -= center);
        let mut walk = self.walk.clone();
        for i in 0..self.data.readings.len() {
            walk.go(&self.data.chain, self.row(i));
            for (b, body) in self.data.bodies.iter().enumerate() {
                self.poses[i * self.data.bodies.len() + b] = walk.root_from_link[body.link.0];
            }
        }
    }

    /// Sets the samples' weights to 1, those of the screened ones to 0, and sums up.
    pub(crate) fn screen(&mut self, screened: &[SampleIndex]) {
        let n = self.channels.len();
        for sample in screened {
            for (k, channel) in self.channels.iter().enumerate() {
                let pose = matches!(
                    self.data.bodies[channel.body].measured,
                    Measured::Poses { .. }
                );
                if channel.body == sample.body.0 && (pose || channel.point == sample.marker) {
                    self.weights[sample.row * n + k] = 0.0;
                }
            }
        }
        self.sum_up();
    }

    /// Weights of the samples, rows × channels; lost samples keep 0.
    pub(crate) fn set_weights(&mut self, weights: Vec<f64>) {
        self.weights = weights;
        self.sum_up();
    }

    fn sum_up(&mut self) {
        let mut sums = vec![Moments::ZERO; self.recordings * self.channels.len()];
        for i in 0..self.data.readings.len() {
            self.add_row(
                &mut sums,
                i,
                |body| Some(self.poses[i * self.data.bodies.len() + body]),
                &self.points,
            );
        }
        self.sums = sums;
    }

    pub(super) fn row(&self, i: usize) -> &[f64] {
        let joints = self.data.chain.joints.len();
        &self.readings[i * joints..(i + 1) * joints]
    }

    pub(super) fn add_row(
        &self,
        sums: &mut [Moments],
        i: usize,
        pose: impl Fn(usize) -> Option<Pose>,
        points: &[Vector3<f64>],
    ) {
        let n = self.channels.len();
        let recording = self.data.recording[i].0;
        // The channels of a body follow each other.
        let mut placed: Option<(usize, Option<Placed>)> = None;
        for (k, channel) in self.channels.iter().enumerate() {
            let w = self.weights[i * n + k];
            if w <= 0.0 {
                continue;
            }
            if placed.is_none_or(|(body, _)| body != channel.body) {
                let of_body = pose(channel.body);
                placed = Some((channel.body, of_body.as_ref().map(Placed::from)));
            }
            if let Some((_, Some(placed))) = &placed {
                sums[recording * n + k].add(&points[i * n + k], placed, w);
            }
        }
    }

    /// The uncorrected data.
    pub(crate) fn none(&self) -> Score {
        self.combine(&self.sums, Scope::All).1
    }

    /// A hypothesis in each of the scopes, which share the sums; not one that estimates something of its own. Where a lower
    /// bound of the residual is beyond `enough`, m, the bound is the score.
    pub(crate) fn score(
        &self,
        hypothesis: &Hypothesis,
        scopes: &[Scope],
        enough: f64,
    ) -> Vec<Scored> {
        let sums = self.moved_sums(hypothesis, scopes);
        let sums = sums.or_else(|| self.point_sums(hypothesis, scopes));
        let one = |scope: &Scope| {
            let scoped = Scoped {
                hypothesis: *hypothesis,
                scope: *scope,
            };
            let score = match &sums {
                Some(sums) => self.bounded(sums, *scope, enough),
                None => self.fit(Some(&scoped)).score,
            };
            Scored { scoped, score }
        };
        scopes.iter().map(one).collect()
    }

    /// The sums under a hypothesis that changes measured points alone, in the recordings of the scopes. One that scales them has a
    /// center of its own in each scope: a thousand times nearer or farther, they lose their digits to that of the others.
    fn point_sums(&self, h: &Hypothesis, scopes: &[Scope]) -> Option<Vec<Moments>> {
        if !changes_points(h) || h.log_scale() != 0.0 {
            return None;
        }
        let n = self.channels.len();
        let mut sums = vec![Moments::ZERO; self.sums.len()];
        for i in 0..self.data.readings.len() {
            if !self.asked(scopes, i) {
                continue;
            }
            let recording = self.data.recording[i].0;
            let weights = &self.weights[i * n..(i + 1) * n];
            for (k, channel) in self.channels.iter().enumerate() {
                if weights[k] > 0.0 {
                    let y = point(self.data, i, channel, Some(h)).unwrap_or_default();
                    let pose = &self.poses[i * self.data.bodies.len() + channel.body];
                    sums[recording * n + k].add(&(y - self.center), &pose.into(), weights[k]);
                }
            }
        }
        Some(sums)
    }

    /// −ln p(y) = N ln rms(z) − N_scaled ln s: the density of y, not that of z = s y.
    fn of_density(&self, mut score: Score, scoped: &Scoped) -> Score {
        let (mut scaled, mut all) = (0.0, 0.0);
        let n = self.channels.len();
        for (at, sum) in self.sums.iter().enumerate() {
            let inside = scoped.scope.contains(RecordingIndex(at / n));
            all += sum.w;
            if inside && self.channels[at % n].scales {
                scaled += sum.w;
            }
        }
        score.score *= (-scoped.hypothesis.log_scale() * scaled / f64::max(all, 1.0)).exp();
        score
    }

    /// Solves with the corrected sums inside the scope and the uncorrected ones outside.
    fn combine(&self, sums: &[Moments], scope: Scope) -> (Registration, Score) {
        self.solve(self.scoped(sums, scope), self.data)
    }

    /// The corrected sums inside the scope and the uncorrected ones outside, by recording and channel.
    fn scoped<'s>(
        &'s self,
        sums: &'s [Moments],
        scope: Scope,
    ) -> impl Fn(usize, usize) -> &'s Moments {
        move |r, k| {
            let source = if scope.contains(RecordingIndex(r)) {
                sums
            } else {
                &self.sums
            };
            &source[r * self.channels.len() + k]
        }
    }

    /// As [`combine`](Self::combine), or a lower bound beyond `enough`.
    fn bounded(&self, sums: &[Moments], scope: Scope, enough: f64) -> Score {
        let normal = self.normal(self.scoped(sums, scope), self.data);
        let bound = rms(normal.least(), normal.w, normal.points);
        let rms = if bound > enough {
            bound
        } else {
            rms(normal.solve().f, normal.w, normal.points)
        };
        Score { rms, score: rms }
    }

    fn solve<'s>(
        &self,
        sum: impl Fn(usize, usize) -> &'s Moments,
        data: &Data,
    ) -> (Registration, Score) {
        let normal = self.normal(sum, data);
        let registration = normal.solve();
        let rms = rms(registration.f, normal.w, normal.points);
        (registration, Score { rms, score: rms })
    }

    /// The cost of all points with the sums of a recording and a channel.
    fn normal<'s>(&self, sum: impl Fn(usize, usize) -> &'s Moments, data: &Data) -> Normal {
        let mut normal = Normal::new();
        for (k, channel) in self.channels.iter().enumerate() {
            for group in mounts(data, channel.body, self.recordings) {
                let mut total = Moments::ZERO;
                group.iter().for_each(|&r| total.include(sum(r, k)));
                normal.include(&total);
            }
        }
        normal
    }

    /// The registration under a hypothesis (or of the uncorrected data), with the points; no sharing of sums.
    pub(crate) fn fit(&self, scoped: Option<&Scoped>) -> Fit {
        let Some(scoped) = scoped else {
            let (registration, score) = self.combine(&self.sums, Scope::All);
            return self.finish(registration, score, &self.sums, self.data, self.center);
        };
        if let Hypothesis::Remounted { body } = scoped.hypothesis {
            let mut data = Data {
                readings: Vec::new(),
                recording: self.data.recording.clone(),
                ..shell(self.data)
            };
            remount(&mut data, scoped.scope, body);
            let n = self.channels.len();
            let (registration, score) = self.solve(|r, k| &self.sums[r * n + k], &data);
            return self.finish(registration, score, &self.sums, &data, self.center);
        }
        if changes_points(&scoped.hypothesis) {
            return self.fit_points(scoped);
        }
        self.fit_corrected(&correct(scoped, self.data))
    }

    /// The registration of corrected data with the weights of these.
    pub(crate) fn fit_corrected(&self, corrected: &Data) -> Fit {
        let mut scan = Scan::new(corrected, &[]);
        for (weight, own) in scan.weights.iter_mut().zip(&self.weights) {
            *weight = weight.min(*own);
        }
        scan.screen(&[]);
        scan.fit(None)
    }

    /// Corrections of the measured points: the poses of the links stay.
    fn fit_points(&self, scoped: &Scoped) -> Fit {
        let n = self.channels.len();
        let mut points = vec![Vector3::zeros(); self.points.len()];
        let mut all = 0.0;
        let mut center = Vector3::zeros();
        for i in 0..self.data.readings.len() {
            let inside = scoped.scope.contains(self.data.recording[i]);
            for (k, channel) in self.channels.iter().enumerate() {
                let w = self.weights[i * n + k];
                if w <= 0.0 {
                    continue;
                }
                let h = inside.then_some(&scoped.hypothesis);
                let y = point(self.data, i, channel, h).unwrap_or_default();
                points[i * n + k] = y;
                center += y * w;
                all += w;
            }
        }
        center /= f64::max(all, 1.0);
        points.iter_mut().for_each(|p| *p -= center);
        let mut sums = vec![Moments::ZERO; self.sums.len()];
        for i in 0..self.data.readings.len() {
            self.add_row(
                &mut sums,
                i,
                |body| Some(self.poses[i * self.data.bodies.len() + body]),
                &points,
            );
        }
        let (registration, score) = self.solve(|r, k| &sums[r * n + k], self.data);
        let score = self.of_density(score, scoped);
        self.finish(registration, score, &sums, self.data, center)
    }

    fn finish(
        &self,
        registration: Registration,
        score: Score,
        sums: &[Moments],
        data: &Data,
        center: Vector3<f64>,
    ) -> Fit {
        let n = self.channels.len();
        let x = registration.x();
        let mut points = vec![Vector3::zeros(); sums.len()];
        for (k, channel) in self.channels.iter().enumerate() {
            for group in mounts(data, channel.body, self.recordings) {
                let mut total = Moments::ZERO;
                group.iter().for_each(|&r| total.include(&sums[r * n + k]));
                let point = total.point(&x);
                group.iter().for_each(|&r| points[r * n + k] = point);
            }
        }
        Fit {
            registration,
            points,
            score,
            center,
        }
    }

    /// Where the fit puts a point, in the root frame, and the pose of its link.
    pub(crate) fn predicted(&self, fit: &Fit, i: usize, k: usize) -> (Vector3<f64>, Pose) {
        let pose = self.poses[i * self.data.bodies.len() + self.channels[k].body];
        let m = fit.points[self.data.recording[i].0 * self.channels.len() + k];
        (pose.r * m + pose.t, pose)
    }

    /// `Q y + c − (R m + t)`, m, of a sample of the uncorrected data.
    pub(crate) fn residual(&self, fit: &Fit, i: usize, k: usize) -> Vector3<f64> {
        self.seen(fit, i, k) - self.predicted(fit, i, k).0
    }

    /// The measured point in the root frame, `Q y + c`.
    pub(crate) fn seen(&self, fit: &Fit, i: usize, k: usize) -> Vector3<f64> {
        let y = self.points[i * self.channels.len() + k] + self.center - fit.center;
        fit.registration.q * y + fit.registration.c
    }

    /// Readings of a row, empty columns as 0.
    pub(crate) fn readings(&self, i: usize) -> &[f64] {
        self.row(i)
    }

    /// Σ w and the degrees of freedom left by the registration alone.
    pub(crate) fn freedom(&self) -> (f64, f64) {
        let w: f64 = self.weights.iter().sum();
        let points: usize = (0..self.channels.len())
            .map(|k| mounts(self.data, self.channels[k].body, self.recordings).len())
            .sum();
        (w, 3.0 * w - 6.0 - 3.0 * points as f64)
    }
}

/// Whether a hypothesis is about what was measured, and not about readings or links.
fn changes_points(h: &Hypothesis) -> bool {
    h.point(&Vector3::zeros()).is_some() || matches!(h, Hypothesis::Poses { .. })
}

/// Data without rows, for what depends on bodies and recordings alone.
fn shell(data: &Data) -> Data {
    data.select(&[])
}

/// Root mean square of residual vectors: `√(3 f / (3 W − 6 − 3 points))`.
fn rms(f: f64, w: f64, points: usize) -> f64 {
    let freedom = 3.0 * w - 6.0 - 3.0 * points as f64;
    if freedom > 0.0 {
        (3.0 * f.max(0.0) / freedom).sqrt()
    } else {
        0.0
    }
}
