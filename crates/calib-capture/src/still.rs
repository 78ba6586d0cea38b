//! Whether everything that is seen stands still.

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
    since: Option<f64>,
}

impl Stillness {
    /// Nothing seen yet.
    pub fn new(settings: StillSettings) -> Self {
        Stillness {
            settings,
            recent: VecDeque::new(),
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
        let size = |(_, far, turned): &(String, f64, f64)| {
            (far / self.settings.point_range).max(turned / self.settings.turn_range)
        };
        let each = last.iter().map(of);
        each.max_by(|a, b| size(a).total_cmp(&size(b)))
    }

    fn together(&self) -> bool {
        let Some((_, last)) = self.recent.back() else {
            return false;
        };
        // Half the range to either side of the last sample is at most the range between any two.
        let near = |a: &Isometry3<f64>, b: &Isometry3<f64>| {
            (a.translation.vector - b.translation.vector).norm() <= self.settings.point_range
                && a.rotation.angle_to(&b.rotation) <= self.settings.turn_range
        };
        self.recent.iter().all(|(_, earlier)| {
            last.iter()
                .all(|(name, pose)| earlier.get(name).is_none_or(|other| near(pose, other)))
        })
    }
}
