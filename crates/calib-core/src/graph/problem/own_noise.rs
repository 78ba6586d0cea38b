//! Noise levels of their own for bodies and markers that share one, for one and the same measurements.

use std::collections::BTreeMap;

use crate::graph::ids::{FrameId, GroupId, PointId};
use crate::graph::measurement::{MeasurementKind, PoseNoise};
use crate::graph::problem::Problem;

/// A problem with noise levels beside those that another has. Frames, edges, parameters, measurements and groups keep their places; new
/// groups follow them.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct OwnNoise {
    /// The problem.
    pub problem: Problem,
    /// Each new group, and the common one whose level it had.
    pub common: BTreeMap<GroupId, GroupId>,
}

impl OwnNoise {
    /// σ² of every group of the problem, from those of the groups that it had before: a new level starts from the common one.
    #[must_use]
    pub fn levels(&self, before: &[f64]) -> Vec<f64> {
        let mut levels = before.to_vec();
        for (group, stated) in self.problem.groups.iter().enumerate().skip(before.len()) {
            let common = self.common.get(&GroupId::of(group));
            let known = common.and_then(|common| before.get(common.index()));
            levels.push(known.copied().unwrap_or(stated.sigma * stated.sigma));
        }
        levels
    }

    fn of(problem: &Problem) -> Self {
        Self {
            problem: problem.clone(),
            common: BTreeMap::new(),
        }
    }

    /// A new level that starts from a common one, under the name of that and what it is the level of.
    fn level(&mut self, common: GroupId, name: &str) -> GroupId {
        let stated = self.problem.groups[common.index()].clone();
        let name = format!("{} {name}", stated.name);
        let level = self
            .problem
            .noise_group(&name, stated.kind, stated.sigma, true);
        self.common.insert(level, common);
        level
    }

    /// `None` where nothing got a level of its own.
    fn found(self) -> Option<Self> {
        (!self.common.is_empty()).then_some(self)
    }
}

impl Problem {
    /// The same problem with noise levels of its own for each body, started from the common ones; `None` where no two bodies share a level
    /// that is estimated.
    #[must_use]
    pub fn with_noise_by_body(&self) -> Option<OwnNoise> {
        let mut out = OwnNoise::of(self);
        // Of each common level, the first body keeps the place.
        let mut first: BTreeMap<GroupId, BodyLevel> = BTreeMap::new();
        let mut own: BTreeMap<(GroupId, FrameId), GroupId> = BTreeMap::new();
        for i in 0..self.measurements.len() {
            let (body, name) = (self.measurements[i].to, self.measurements[i].name.clone());
            let common: Vec<GroupId> = levels_of(&mut out.problem.measurements_mut()[i].kind)
                .into_iter()
                .map(|level| *level)
                .collect();
            for common in common {
                if !self.groups[common.index()].estimate {
                    continue;
                }
                let known = first.entry(common).or_insert_with(|| BodyLevel {
                    body,
                    name: name.clone(),
                });
                if known.body == body {
                    continue;
                }
                let level = *own
                    .entry((common, body))
                    .or_insert_with(|| out.level(common, &name));
                let levels = levels_of(&mut out.problem.measurements_mut()[i].kind);
                levels
                    .into_iter()
                    .filter(|l| **l == common)
                    .for_each(|l| *l = level);
            }
        }
        for common in own.keys().map(|(common, _)| *common) {
            let name = &self.groups[common.index()].name;
            out.problem.groups[common.index()].name = format!("{name} {}", first[&common].name);
        }
        out.found()
    }

    /// The same problem with a noise level of its own for each of these markers, started from that of its body; `None` where none of them
    /// is seen with a level that is estimated.
    #[must_use]
    pub fn with_noise_by_marker(&self, apart: &[PointId]) -> Option<OwnNoise> {
        let mut out = OwnNoise::of(self);
        let mut own: BTreeMap<(GroupId, PointId), GroupId> = BTreeMap::new();
        for i in 0..self.measurements.len() {
            let MeasurementKind::Markers(markers) = &self.measurements[i].kind else {
                continue;
            };
            for &point in apart {
                let common = markers.noise_of(point);
                let seen = markers.observations.iter().any(|o| o.point == point);
                if !seen || !self.groups[common.index()].estimate {
                    continue;
                }
                let name = &self.points[point.index()].name;
                let level = *own
                    .entry((common, point))
                    .or_insert_with(|| out.level(common, name));
                if let MeasurementKind::Markers(markers) =
                    &mut out.problem.measurements_mut()[i].kind
                {
                    markers.own.insert(point, level);
                }
            }
        }
        out.found()
    }
}

/// The body that a common level belongs to at first.
struct BodyLevel {
    body: FrameId,
    name: String,
}

/// Noise levels of what is seen of a body.
fn levels_of(kind: &mut MeasurementKind) -> Vec<&mut GroupId> {
    let (mut levels, sight) = match kind {
        MeasurementKind::Markers(markers) => (vec![&mut markers.noise], &mut markers.sight),
        MeasurementKind::Poses(poses) => {
            let levels = match &mut poses.noise {
                PoseNoise::Split {
                    orientation,
                    position,
                } => vec![orientation, position],
                PoseNoise::Full { scale, .. } => vec![scale],
            };
            (levels, &mut poses.sight)
        }
        _ => return Vec::new(),
    };
    if let Some(sight) = sight {
        levels.push(&mut sight.along);
        levels.extend(&mut sight.about);
    }
    levels
}
