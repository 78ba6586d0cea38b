//! Do the trials resemble the recording? Numbers of the residuals, and one test of all of them together.
//!
//! ```text
//! D_k = max_i |s_ki − median_i| / τ_i,   τ = max(q₉₅|s − median| / 1.96, ¼ rms)        over trials and the recording    (1)
//! p = #{k: D_k ≥ D of the recording} / (N + 1)                                                             (2)
//! ```
//!
//! If the recording is another draw of what the trials are drawn from, all orders of the N + 1 are equally likely, and (2) is exact whatever the
//! numbers are: no distribution is assumed. For that, the numbers of the recording and of all trials come from one way of fitting: that with the
//! statement of the session where it has one, also in the trials that are calibrated as a whole.
//!
//! The power of (2) is that of the number with the longest tail: q₉₅, which is σ for a normal distribution as well, is wide where a tail is long, so that no
//! such number sets D for all others. Where one is found at 0 in some trials, it is not a logarithm: 0 would be infinitely far from a small one.

use std::collections::BTreeMap;

use calib_core::ChanceOfChanges;
use calib_geometry::statistics::median;
use calib_pipeline::estimated::Estimated;
use calib_pipeline::formulate::formulation::MlFit;
use calib_pipeline::verify::causes::{Causes, causes};
use calib_pipeline::verify::deviations::deviations;
use calib_pipeline::verify::residuals::residual_rows;
use calib_profile::Usage;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A number of the residuals.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Mark {
    /// rms of the position residuals that were kept, log.
    Level,
    /// rms of the angles between measured and predicted poses, log.
    Orientation,
    /// rms of the errors on the validation recordings, log.
    HeldOut,
    /// Noise of the joints that was found, rms, mrad or mm; often 0.
    JointNoise,
    /// χ² per degree of freedom with the noise as stated, log.
    Goodness,
    /// The largest |z| of the tests for missing effects.
    LargestTest,
    /// The largest excess of the scan for changes.
    LargestChange,
    /// Correlation of successive residuals of one marker or body.
    Memory,
    /// Largest over smallest rms of the bodies, log.
    Bodies,
    /// Mean fourth power of the residuals over their mean square squared, log.
    Tails,
}

/// The numbers of one calibration.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Likeness(pub BTreeMap<Mark, f64>);

/// Values below this are taken for it before a logarithm: what is 0 up to rounding.
const FLOOR: f64 = 1e-12;

impl Likeness {
    /// Of one calibration, with what it says of its residuals, where the chance of changes is `known` by that; `None`: it has no fit.
    #[must_use]
    pub fn of_estimated(of: &Estimated, known: Option<&ChanceOfChanges>) -> Option<Self> {
        let fit = of.solved.fit.as_ref()?;
        let causes = causes(&of.inputs, fit, &of.checked.findings, known);
        Some(Self::of(of, fit, &causes))
    }

    /// Of one calibration.
    #[must_use]
    pub fn of(of: &Estimated, fit: &MlFit, causes: &Causes) -> Self {
        let mut marks = BTreeMap::new();
        let mut put = |mark: Mark, value: Option<f64>| {
            if let Some(value) = value.filter(|v| v.is_finite()) {
                marks.insert(mark, value);
            }
        };
        let log = |value: f64| value.max(FLOOR).ln();
        let tracks = &of.checked.tracks;
        let rows = residual_rows(&of.inputs, tracks, &fit.calibration, Some(fit));
        let kept: Vec<_> = rows.iter().filter(|r| r.used).collect();
        let square = |r: [f64; 3]| r.iter().map(|x| x * x).sum::<f64>();
        let squares: Vec<f64> = kept.iter().map(|r| square(r.residual_m)).collect();
        put(Mark::Level, rms(&squares).map(log));
        let angles = kept.iter().filter_map(|r| r.rotation_rad.map(|a| a * a));
        put(Mark::Orientation, rms(&angles.collect::<Vec<_>>()).map(log));
        let fourth = squares.iter().map(|s| s * s).sum::<f64>() * squares.len() as f64;
        let second = squares.iter().sum::<f64>().powi(2);
        put(Mark::Tails, (second > 0.0).then(|| log(fourth / second)));
        let mut of_subject: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        let mut last: BTreeMap<(&str, &str), [f64; 3]> = BTreeMap::new();
        let mut product = 0.0;
        for (r, s) in kept.iter().zip(&squares) {
            of_subject.entry(&r.subject).or_default().push(*s);
            let key = (&*r.recording, &*r.subject);
            if let Some(before) = last.insert(key, r.residual_m) {
                product += before
                    .iter()
                    .zip(r.residual_m)
                    .map(|(a, b)| a * b)
                    .sum::<f64>();
            }
        }
        let total: f64 = squares.iter().sum();
        put(Mark::Memory, (total > 0.0).then(|| product / total));
        let levels: Vec<f64> = of_subject.values().filter_map(|s| rms(s)).collect();
        let largest = levels.iter().copied().fold(FLOOR, f64::max);
        let smallest = levels.iter().copied().fold(f64::INFINITY, f64::min);
        put(
            Mark::Bodies,
            (levels.len() > 1).then(|| log(largest / smallest.max(FLOOR))),
        );
        let validation = |usage: Usage| usage == Usage::Validation;
        let held_out = deviations(&of.inputs, tracks, &fit.calibration, validation);
        let held_out: Vec<f64> = held_out.iter().map(|d| d.vector.norm_squared()).collect();
        put(Mark::HeldOut, rms(&held_out).map(log));
        put(Mark::JointNoise, fit.joint_sigma().map(|s| s * 1e3));
        put(
            Mark::Goodness,
            causes.goodness.as_ref().map(|g| log(g.chi2_per_dof)),
        );
        let tests = causes.goodness.iter().flat_map(|g| &g.tests);
        let largest = tests.map(|t| t.z2).reduce(f64::max);
        put(Mark::LargestTest, largest.map(f64::sqrt));
        let change = causes.scan.as_ref().and_then(|scan| scan.changes.first());
        put(Mark::LargestChange, change.map(|c| c.excess));
        Self(marks)
    }
}

fn rms(squares: &[f64]) -> Option<f64> {
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    (!squares.is_empty()).then(|| mean.sqrt())
}

/// Whether the trials resemble the recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Resemblance {
    /// p of equation (2); null with fewer trials than can tell.
    pub p_value: Option<f64>,
    /// Whether chance explains the difference in less than 2 of 100 recordings.
    pub differs: bool,
    /// Every number: that of the recording, and median and robust σ of the trials. The most different first.
    pub marks: Vec<Compared>,
}

/// One number of the recording beside those of the trials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Compared {
    /// Which.
    pub mark: Mark,
    /// Of the recording.
    pub recording: f64,
    /// Median of the trials.
    pub twin: f64,
    /// Robust σ of the trials.
    pub spread: f64,
}

impl Compared {
    /// How far the recording lies from the trials, in their σ.
    #[must_use]
    pub fn distance(&self) -> f64 {
        (self.recording - self.twin) / self.spread
    }
}

/// Fewer trials cannot reach the level.
pub const LEAST_TRIALS: usize = 50;
/// Chance of a recording that differs although nothing is wrong.
const LEVEL: f64 = 0.02;

/// Equations (1) and (2).
#[must_use]
pub fn resemblance(recording: &Likeness, trials: &[&Likeness]) -> Resemblance {
    // A spread below this is rounding: numbers are logarithms or of the order of 1.
    const ROUNDING: f64 = 1e-9;
    // A normal deviation is below so many σ with this probability.
    const TAIL: (f64, f64) = (0.95, 1.96);
    let mut marks = Vec::new();
    let mut distances = vec![0.0_f64; trials.len() + 1];
    for (mark, own) in &recording.0 {
        let of: Vec<Option<f64>> = trials.iter().map(|t| t.0.get(mark).copied()).collect();
        let known: Vec<f64> = of.iter().flatten().copied().collect();
        if known.len() * 2 < trials.len() || known.is_empty() {
            continue;
        }
        let all: Vec<f64> = known.iter().copied().chain([*own]).collect();
        let middle = median(all.clone()).unwrap_or(*own);
        let deviations: Vec<f64> = all.iter().map(|x| (x - middle).abs()).collect();
        let squares: f64 = deviations.iter().map(|d| d * d).sum();
        // Where most are equal, the few others do not count as infinitely far.
        let wide = (squares / all.len() as f64).sqrt() / 4.0;
        let tail = quantile(deviations, TAIL.0) / TAIL.1;
        let spread = tail.max(wide).max(ROUNDING);
        for (d, x) in distances
            .iter_mut()
            .zip(of.iter().copied().chain([Some(*own)]))
        {
            *d = x.map_or(*d, |x| d.max((x - middle).abs() / spread));
        }
        marks.push(Compared {
            mark: *mark,
            recording: *own,
            twin: middle,
            spread,
        });
    }
    marks.sort_by(|a, b| b.distance().abs().total_cmp(&a.distance().abs()));
    let own = distances[trials.len()];
    let larger = distances.iter().filter(|d| **d >= own).count();
    let p = larger as f64 / distances.len() as f64;
    let p_value = (trials.len() >= LEAST_TRIALS && !marks.is_empty()).then_some(p);
    Resemblance {
        p_value,
        differs: p_value.is_some_and(|p| p <= LEVEL),
        marks,
    }
}

/// The smallest value that so large a share does not exceed; 0 of nothing.
fn quantile(mut of: Vec<f64>, share: f64) -> f64 {
    of.sort_by(f64::total_cmp);
    let place = (share * of.len() as f64).ceil() as usize;
    of.get(place.saturating_sub(1)).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    fn drawn(rng: &mut rand_chacha::ChaCha12Rng, shift: f64) -> Likeness {
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let marks = [Mark::Level, Mark::Tails, Mark::LargestTest, Mark::Memory];
        let mut all: BTreeMap<Mark, f64> = marks.map(|m| (m, normal())).into();
        // A heavy tail, as that of the largest of many tests.
        all.insert(Mark::LargestTest, all[&Mark::LargestTest].exp());
        *all.entry(Mark::Level).or_default() += shift;
        Likeness(all)
    }

    #[test]
    fn a_recording_like_the_trials_differs_at_the_level_and_another_one_always() {
        let mut rng = rand_chacha::ChaCha12Rng::seed_from_u64(3);
        let mut flagged = [0; 2];
        for _ in 0..600 {
            for (count, shift) in flagged.iter_mut().zip([0.0, 60.0]) {
                let trials: Vec<Likeness> = (0..60).map(|_| drawn(&mut rng, 0.0)).collect();
                let trials: Vec<&Likeness> = trials.iter().collect();
                let found = resemblance(&drawn(&mut rng, shift), &trials);
                *count += u32::from(found.differs);
            }
        }
        // 1 of 61 orders: 1.6 %, 10 of 600 expected; 99.99 % are below 23.
        assert!(flagged[0] <= 23, "{flagged:?}");
        assert!(flagged[1] >= 570, "{flagged:?}");
    }

    /// A level that is at its limit in most trials and far from it in a few, and an excess with a long tail, hide no other number.
    #[test]
    fn numbers_with_long_tails_do_not_hide_one_that_differs() {
        let mut rng = rand_chacha::ChaCha12Rng::seed_from_u64(6);
        let mut flagged = [0; 2];
        for _ in 0..300 {
            for (count, shift) in flagged.iter_mut().zip([0.0, 12.0]) {
                let mut one = |shift: f64| {
                    let mut of = drawn(&mut rng, shift);
                    // Half of the noise levels of joints are found at 0.
                    let level: f64 = rng.sample(StandardNormal);
                    of.0.insert(Mark::JointNoise, 0.1 * level.max(0.0));
                    let excess: f64 = rng.sample(rand_distr::Exp1);
                    of.0.insert(Mark::LargestChange, 2.0 * excess);
                    of
                };
                let trials: Vec<Likeness> = (0..60).map(|_| one(0.0)).collect();
                let trials: Vec<&Likeness> = trials.iter().collect();
                *count += u32::from(resemblance(&one(shift), &trials).differs);
            }
        }
        // 1.6 % by chance: 5 of 300 expected; 99.99 % are below 16.
        assert!(flagged[0] < 16 && flagged[1] >= 285, "{flagged:?}");
    }

    #[test]
    fn few_trials_do_not_tell() {
        let mut rng = rand_chacha::ChaCha12Rng::seed_from_u64(4);
        let trials: Vec<Likeness> = (0..20).map(|_| drawn(&mut rng, 0.0)).collect();
        let trials: Vec<&Likeness> = trials.iter().collect();
        let found = resemblance(&drawn(&mut rng, 50.0), &trials);
        assert!(found.p_value.is_none() && !found.differs);
        assert_eq!(found.marks[0].mark, Mark::Level);
    }
}
