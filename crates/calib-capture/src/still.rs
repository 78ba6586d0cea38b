//! Whether everything that is seen stands still.
//!
//! The limits follow the noise that is seen. Second differences of a track have little of a smooth motion and all of white noise: for σ per coordinate
//! |x₂ − 2x₁ + x₀| has the median √6·1.54 σ = 3.8 σ, and two samples of a body that stands still differ by more than √2·6.4 σ = 9 σ once in 10⁸ times.

use crate::Frame;
use nalgebra::{Isometry3, Point3};
use std::collections::{BTreeMap, VecDeque};

/// When it stands still; the same limits as the hold detection in files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StillSettings {
    /// Window in which everything must stay together, s.
    pub window: f64,
    /// Range of a position within it, m.
    pub point_range: f64,
    /// Range of a turn within it, rad.
    pub turn_range: f64,
}

impl Default for StillSettings {
    fn default() -> Self {
        let files = calib_checks::sync::HoldSettings::default();
        StillSettings {
            window: 0.3,
            point_range: files.point_range,
            turn_range: files.turn_range,
        }
    }
}

/// The last moments of every watched body.
#[derive(Clone, Debug)]
pub struct Stillness {
    settings: StillSettings,
    recent: VecDeque<(f64, BTreeMap<String, Isometry3<f64>>)>,
    /// Second differences of each, m and rad.
    shaking: BTreeMap<String, VecDeque<(f64, f64)>>,
    since: Option<f64>,
}

/// Second differences that the noise is taken from: about a second.
const SHAKING: usize = 60;
/// Fewer of them tell no noise.
const FEWEST: usize = 20;
/// By how much two samples of what stands still may differ, in medians of the second differences: 9 σ.
const OF_MEDIAN: f64 = 9.0 / 3.8;

impl Stillness {
    /// Nothing seen yet.
    pub fn new(settings: StillSettings) -> Self {
        Stillness {
            settings,
            recent: VecDeque::new(),
            shaking: BTreeMap::new(),
            since: None,
        }
    }

    /// Takes the frame at this time, s, looking at the bodies and markers of these names; how long they have been
    /// still, s, `None` while they move or nothing is seen.
    pub fn sees(&mut self, t: f64, frame: &Frame, names: &[&str]) -> Option<f64> {
        let pose = |name: &str| {
            let marker = |p: &Point3<f64>| Isometry3::translation(p.x, p.y, p.z);
            let body = frame.bodies.get(name).copied();
            body.or_else(|| frame.markers.get(name).map(marker))
        };
        let seen = names
            .iter()
            .filter_map(|name| Some((name.to_string(), pose(name)?)));
        let seen: BTreeMap<String, Isometry3<f64>> = seen.collect();
        if seen.is_empty() {
            // Out of sight for a moment is not moved; for longer than the window nobody knows.
            let last = self.recent.back().map(|(last, _)| *last);
            let moment = last.is_some_and(|last| t - last <= self.settings.window);
            self.since = self.since.filter(|_| moment);
            return self.since.map(|since| t - since);
        }
        self.note_shaking(&seen);
        self.recent.push_back((t, seen));
        while self
            .recent
            .front()
            .is_some_and(|(first, _)| t - first > self.settings.window)
        {
            self.recent.pop_front();
        }
        let began = self.recent.front().map_or(t, |(first, _)| *first);
        let long_enough = t - began >= 0.7 * self.settings.window && self.recent.len() >= 3;
        if !long_enough || !self.together() {
            self.since = None;
            return None;
        }
        let since = *self.since.get_or_insert(t);
        Some(t - since)
    }

    /// What moved most within the window: its name, how far, m, and by what angle, rad; `None` where nothing is seen.
    pub fn moving(&self) -> Option<(String, f64, f64)> {
        let (_, last) = self.recent.back()?;
        let of = |(name, pose): (&String, &Isometry3<f64>)| {
            let earlier = self.recent.iter().filter_map(|(_, seen)| seen.get(name));
            let (mut far, mut turned) = (0.0_f64, 0.0_f64);
            for other in earlier {
                far = far.max((pose.translation.vector - other.translation.vector).norm());
                turned = turned.max(pose.rotation.angle_to(&other.rotation));
            }
            (name.clone(), far, turned)
        };
        let size = |(name, far, turned): &(String, f64, f64)| {
            let (point, turn) = self.ranges(name);
            (far / point).max(turned / turn)
        };
        let each = last.iter().map(of);
        each.max_by(|a, b| size(a).total_cmp(&size(b)))
    }

    fn together(&self) -> bool {
        let Some((_, last)) = self.recent.back() else {
            return false;
        };
        // Half the range to either side of the last sample is at most the range between any two.
        last.iter().all(|(name, pose)| {
            let (point, turn) = self.ranges(name);
            let near = |other: &Isometry3<f64>| {
                (pose.translation.vector - other.translation.vector).norm() <= point
                    && pose.rotation.angle_to(&other.rotation) <= turn
            };
            let mut earlier = self.recent.iter().filter_map(|(_, seen)| seen.get(name));
            earlier.all(near)
        })
    }

    /// Ranges within which something stands still, m and rad: the usual ones, or what its noise needs.
    fn ranges(&self, name: &str) -> (f64, f64) {
        let (usual, turn) = (self.settings.point_range, self.settings.turn_range);
        let Some(shaking) = self.shaking.get(name).filter(|s| s.len() >= FEWEST) else {
            return (usual, turn);
        };
        let median = |of: fn(&(f64, f64)) -> f64| {
            let mut all: Vec<f64> = shaking.iter().map(of).collect();
            all.sort_by(f64::total_cmp);
            all[all.len() / 2]
        };
        (
            usual.max(OF_MEDIAN * median(|s| s.0)),
            turn.max(OF_MEDIAN * median(|s| s.1)),
        )
    }

    /// Takes the second differences that a new frame makes with the last two.
    fn note_shaking(&mut self, seen: &BTreeMap<String, Isometry3<f64>>) {
        let mut before = self.recent.iter().rev();
        let (Some((_, first)), Some((_, second))) = (before.next(), before.next()) else {
            return;
        };
        for (name, x2) in seen {
            let (Some(x1), Some(x0)) = (first.get(name), second.get(name)) else {
                continue;
            };
            let bend = x2.translation.vector - x1.translation.vector * 2.0 + x0.translation.vector;
            let turns = [x1.rotation / x0.rotation, x2.rotation / x1.rotation];
            let all = self.shaking.entry(name.clone()).or_default();
            all.push_back((bend.norm(), turns[0].angle_to(&turns[1])));
            if all.len() > SHAKING {
                all.pop_front();
            }
        }
    }
}
