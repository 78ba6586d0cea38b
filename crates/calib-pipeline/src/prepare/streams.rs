//! Streams between their samples: linear for numbers and points, along the shortest turn for orientations.

use std::collections::BTreeMap;

use calib_recording::{JointUnit, Recording};
use nalgebra::{Isometry3, Point3};

/// Longest gap, in units of the usual step, that is interpolated.
const MAX_GAP: f64 = 5.0;

/// Steps shorter than this share of the usual one, or as much longer, are no samples of a cubic.
const UNEVEN: f64 = 0.5;

/// A number over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Scalars {
    /// Times, s, never decreasing; empty where the stream has none.
    pub t: Vec<f64>,
    /// Values; `None` = not recorded.
    pub values: Vec<Option<f64>>,
    /// Angle or length, of a joint.
    pub unit: Option<JointUnit>,
    /// Index of its time line.
    pub timeline: usize,
    step: f64,
}

impl Scalars {
    fn new(
        recording: &Recording,
        timeline: usize,
        values: &[Option<f64>],
        unit: Option<JointUnit>,
    ) -> Self {
        let line = recording.timelines.get(timeline);
        let t = line.and_then(|l| l.t.clone()).unwrap_or_default();
        Self {
            step: usual_step(&t),
            t,
            values: values.to_vec(),
            unit,
            timeline,
        }
    }

    /// Values at these times, s, of an angle.
    #[cfg(test)]
    pub(crate) fn given(t: Vec<f64>, values: Vec<Option<f64>>) -> Self {
        Self {
            step: usual_step(&t),
            t,
            values,
            unit: Some(JointUnit::Angle),
            timeline: 0,
        }
    }

    /// All joints of a recording.
    #[must_use]
    pub fn of_joints(recording: &Recording) -> BTreeMap<String, Self> {
        let stream = |j: &calib_recording::JointStream| {
            (
                j.name.clone(),
                Self::new(recording, j.timeline, &j.q, Some(j.unit)),
            )
        };
        recording.joints.iter().map(stream).collect()
    }

    /// Puts values that are `late`, s, to the times to which they belong.
    pub(crate) fn was_late(&mut self, late: f64) {
        self.t.iter_mut().for_each(|t| *t -= late);
    }

    /// All torques of a recording.
    #[must_use]
    pub fn of_torques(recording: &Recording) -> BTreeMap<String, Self> {
        let stream = |s: &calib_recording::TorqueStream| {
            (
                s.name.clone(),
                Self::new(recording, s.timeline, &s.torque, None),
            )
        };
        recording.torques.iter().map(stream).collect()
    }

    /// All temperatures of a recording.
    #[must_use]
    pub fn of_temperatures(recording: &Recording) -> BTreeMap<String, Self> {
        let stream = |s: &calib_recording::TemperatureStream| {
            let scalars = Self::new(recording, s.timeline, &s.celsius, None);
            (s.name.clone(), scalars)
        };
        recording.temperatures.iter().map(stream).collect()
    }

    /// The value at `t`; `None` outside, in gaps, and next to a lost sample.
    #[must_use]
    pub fn at(&self, t: f64) -> Option<f64> {
        let (i, j, f) = between(&self.t, t, self.step)?;
        let a = *self.values.get(i)?.as_ref()?;
        if f == 0.0 {
            return Some(a);
        }
        let b = *self.values.get(j)?.as_ref()?;
        Some(a + f * (b - a))
    }

    /// The same on the cubic through the two samples before and the two after, where they are evenly there: a line cuts the
    /// bends of a motion that is sampled slowly.
    #[must_use]
    pub fn smooth_at(&self, t: f64) -> Option<f64> {
        let line = self.at(t)?;
        let (i, j, f) = between(&self.t, t, self.step)?;
        let cubic = || {
            let four = i.checked_sub(1)?..j + 2;
            let times = self.t.get(four.clone())?;
            let values: Option<Vec<f64>> = self.values.get(four)?.iter().copied().collect();
            let even = |w: &[f64]| (UNEVEN..1.0 / UNEVEN).contains(&((w[1] - w[0]) / self.step));
            let values = values.filter(|_| times.windows(2).all(even))?;
            let weight = |k: usize| {
                let others = (0..times.len()).filter(|m| *m != k);
                let factors = others.map(|m| (t - times[m]) / (times[k] - times[m]));
                factors.product::<f64>()
            };
            Some((0..times.len()).map(|k| weight(k) * values[k]).sum())
        };
        if f == 0.0 {
            Some(line)
        } else {
            cubic().or(Some(line))
        }
    }

    /// Speed at `t`, per s, over the chord `t ± half` (at least one sample to either side).
    #[must_use]
    pub fn speed(&self, t: f64, half: f64) -> Option<f64> {
        let half = half.max(self.step);
        if half <= 0.0 {
            return None;
        }
        Some((self.at(t + half)? - self.at(t - half)?) / (2.0 * half))
    }
}

/// Median step of times, s.
fn usual_step(t: &[f64]) -> f64 {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

/// Samples before and after `t` and the fraction between them.
fn between(times: &[f64], t: f64, step: f64) -> Option<(usize, usize, f64)> {
    let after = times.partition_point(|&known| known <= t);
    let i = after.checked_sub(1)?;
    if times[i] == t {
        return Some((i, i, 0.0));
    }
    let gap = times.get(after)? - times[i];
    (gap <= MAX_GAP * step && gap > 0.0).then(|| (i, after, (t - times[i]) / gap))
}

/// A marker at `t`; `None` outside, in gaps, and next to a lost sample.
#[must_use]
pub fn interpolated_point(
    times: &[f64],
    points: &[Option<Point3<f64>>],
    t: f64,
) -> Option<Point3<f64>> {
    let (i, j, f) = between(times, t, usual_step(times))?;
    let a = *points.get(i)?.as_ref()?;
    let b = *points.get(j)?.as_ref()?;
    Some(a + (b - a) * f)
}

/// A body at `t`; `None` outside, in gaps, and next to a lost sample.
#[must_use]
pub fn interpolated_body(
    times: &[f64],
    poses: &[Option<Isometry3<f64>>],
    t: f64,
) -> Option<Isometry3<f64>> {
    let (i, j, f) = between(times, t, usual_step(times))?;
    let a = poses.get(i)?.as_ref()?;
    let b = poses.get(j)?.as_ref()?;
    a.try_lerp_slerp(b, f, 1e-9)
}
