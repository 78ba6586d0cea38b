//! Sums under hypotheses that change readings or links: only what the change moves is computed again.
//!
//! A joint that moves by δ more turns (or shifts) everything behind it about (or along) its own axis:
//!
//! ```text
//! root_from_link' = S_1(δ_1) S_2(δ_2) … root_from_link                                               (1)
//! ```
//!
//! S_j is the motion by δ_j about axis j as it stands in the root frame at the readings as they are, from the root outward. One
//! sine and a few products replace the walk from the root to the link.

use super::chain::{Axis, Pose, Walk};
use super::correct::shifted_row;
use super::hypothesis::{Hypothesis, Scope};
use super::ids::{JointIndex, LinkIndex};
use super::moments::{Moments, Placed};
use super::scan::Scan;

/// A joint that a change of readings moves: by how much for each of (at most two) changed readings.
struct Moving {
    joint: usize,
    turns: bool,
    factors: [f64; 2],
}

impl Scan<'_> {
    /// The sums under a hypothesis that changes readings or links alone, in the recordings of the scopes.
    pub(super) fn moved_sums(&self, h: &Hypothesis, scopes: &[Scope]) -> Option<Vec<Moments>> {
        match *h {
            Hypothesis::RowShift { rows } => Some(self.shifted_sums(rows, scopes)),
            Hypothesis::Units { .. } | Hypothesis::Order { .. } => {
                let bodies = &self.data.bodies;
                let links = bodies.iter().map(|body| Some(body.link)).collect();
                Some(self.walked_sums(h, links, scopes))
            }
            Hypothesis::WrongLink { body, link } => {
                let mut links = vec![None; self.data.bodies.len()];
                links[body.0] = Some(link);
                Some(self.walked_sums(h, links, scopes))
            }
            Hypothesis::Exchange { .. } => Some(self.turned_sums(h, scopes)),
            _ => h.affine().map(|_| self.turned_sums(h, scopes)),
        }
    }

    /// Every row with the poses of another.
    fn shifted_sums(&self, rows: i8, scopes: &[Scope]) -> Vec<Moments> {
        let bodies = self.data.bodies.len();
        let mut sums = vec![Moments::ZERO; self.sums.len()];
        for i in 0..self.data.readings.len() {
            let from = shifted_row(&self.data.recording, i, rows);
            let Some(from) = from.filter(|&from| self.asked(scopes, i) && self.usable[from]) else {
                continue;
            };
            let pose = |body: usize| Some(self.poses[from * bodies + body]);
            self.add_row(&mut sums, i, pose, &self.points);
        }
        sums
    }

    /// The sums with bodies on these links, walked from the root with corrected readings; `None`: not moved.
    fn walked_sums(
        &self,
        h: &Hypothesis,
        links: Vec<Option<LinkIndex>>,
        scopes: &[Scope],
    ) -> Vec<Moments> {
        let moved: Vec<LinkIndex> = links.iter().copied().flatten().collect();
        let mut walk = Walk::new(&self.data.chain, &moved);
        let mut row = Vec::new();
        let columns = match *h {
            Hypothesis::Order { order } => Some(order.columns(&self.data.chain)),
            _ => None,
        };
        self.sums_with(
            scopes,
            |body| links[body].is_some(),
            |i, poses| {
                match &columns {
                    Some(columns) => {
                        row.clear();
                        row.extend(columns.iter().map(|column| self.row(i)[column.0]));
                    }
                    None => self.corrected_units(h, i, &mut row),
                }
                walk.go(&self.data.chain, &row);
                for (pose, link) in poses.iter_mut().zip(&links) {
                    *pose = link.map_or(*pose, |link| walk.root_from_link[link.0]);
                }
            },
        )
    }

    /// The readings of a row, in other units where the hypothesis says so.
    fn corrected_units(&self, h: &Hypothesis, i: usize, out: &mut Vec<f64>) {
        out.clear();
        out.extend_from_slice(self.row(i));
        if let Hypothesis::Units { mistake } = *h {
            for (joint, q) in out.iter_mut().enumerate() {
                if self.data.chain.turns(joint) == Some(mistake.of_angles()) {
                    *q *= mistake.factor();
                }
            }
        }
    }

    /// Equation (1) for a change of one or two readings.
    fn turned_sums(&self, h: &Hypothesis, scopes: &[Scope]) -> Vec<Moments> {
        let changed = match *h {
            Hypothesis::Exchange { first, second } => vec![first.0, second.0],
            _ => h.affine().map(|a| a.joint).into_iter().collect(),
        };
        let bodies = self.data.bodies.iter();
        let moving: Vec<Vec<Moving>> = bodies.map(|b| self.moving(b.link, &changed)).collect();
        let (axes, joints) = (self.axes(), self.data.chain.joints.len());
        let bodies = self.data.bodies.len();
        self.sums_with(
            scopes,
            |body| !moving[body].is_empty(),
            |i, poses| {
                let more = self.more(h, i);
                for (body, pose) in poses.iter_mut().enumerate() {
                    *pose = self.poses[i * bodies + body];
                    for own in moving[body].iter().rev() {
                        let by = own.factors[0] * more[0] + own.factors[1] * more[1];
                        *pose = axes[i * joints + own.joint].moved(own.turns, by, pose);
                    }
                }
            },
        )
    }

    /// By how much a hypothesis about one or two readings changes them.
    fn more(&self, h: &Hypothesis, i: usize) -> [f64; 2] {
        let q = self.row(i);
        if let Hypothesis::Exchange { first, second } = *h {
            let step = q[second.0] - q[first.0];
            return [step, -step];
        }
        h.affine().map_or([0.0; 2], |a| {
            let corrected = a.factor * q[a.joint] + a.coupling * q[a.source] + a.offset;
            [corrected - q[a.joint], 0.0]
        })
    }

    /// The joints between the root and a link that the changed readings move, root first.
    fn moving(&self, link: LinkIndex, changed: &[usize]) -> Vec<Moving> {
        let chain = &self.data.chain;
        let path = chain.path(link).into_iter();
        let of = |joint: JointIndex| {
            let mut factors = [0.0; 2];
            for (source, factor) in &chain.joints[joint.0].law {
                for (own, changed) in factors.iter_mut().zip(changed) {
                    *own += if source.0 == *changed { *factor } else { 0.0 };
                }
            }
            let turns = chain.turns(joint.0)?;
            let moves = factors.iter().any(|f| *f != 0.0);
            moves.then_some(Moving {
                joint: joint.0,
                turns,
                factors,
            })
        };
        path.filter_map(of).collect()
    }

    /// Axes of all joints that carry a body, rows × joints.
    fn axes(&self) -> &[Axis] {
        self.axes.get_or_init(|| {
            let chain = &self.data.chain;
            let mut walk = self.walk.clone();
            let mut axes = Vec::with_capacity(self.data.readings.len() * chain.joints.len());
            for i in 0..self.data.readings.len() {
                walk.go(chain, self.row(i));
                let own = walk.root_from_joint.iter().zip(&chain.joints);
                axes.extend(own.map(|(at, joint)| Axis::of(at, &joint.motion)));
            }
            axes
        })
    }

    /// The sums with poses of some bodies changed row by row; those of the others stay.
    fn sums_with(
        &self,
        scopes: &[Scope],
        moves: impl Fn(usize) -> bool,
        mut change: impl FnMut(usize, &mut [Pose]),
    ) -> Vec<Moments> {
        let n = self.channels.len();
        let moved: Vec<usize> = (0..n).filter(|k| moves(self.channels[*k].body)).collect();
        let mut sums = self.sums.clone();
        for (at, sum) in sums.iter_mut().enumerate() {
            if moves(self.channels[at % n].body) {
                *sum = sum.without_poses();
            }
        }
        let mut poses = vec![Pose::IDENTITY; self.data.bodies.len()];
        let mut placed: Vec<Placed> = poses.iter().map(Placed::from).collect();
        for i in 0..self.data.readings.len() {
            if !self.asked(scopes, i) || !self.usable[i] {
                continue;
            }
            change(i, &mut poses);
            let bodies = placed.iter_mut().zip(&poses).enumerate();
            let moved_bodies = bodies.filter(|(body, _)| moves(*body));
            moved_bodies.for_each(|(_, (placed, pose))| *placed = pose.into());
            let recording = self.data.recording[i].0;
            for &k in &moved {
                let w = self.weights[i * n + k];
                if w > 0.0 {
                    let link = &placed[self.channels[k].body];
                    sums[recording * n + k].add_pose(&self.points[i * n + k], link, w);
                }
            }
        }
        sums
    }

    pub(super) fn asked(&self, scopes: &[Scope], i: usize) -> bool {
        scopes.iter().any(|s| s.contains(self.data.recording[i]))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, Unit, Vector3};

    use super::super::chain::{Chain, ChainJoint, Motion};
    use super::super::correct::correct;
    use super::super::data::{Body, Data, Measured};
    use super::super::hypothesis::{QuarterTurns, Scoped};
    use super::super::ids::RecordingIndex;
    use super::super::units::UnitMistake;
    use super::*;

    /// A number in [−1, 1] that looks random.
    fn drawn(k: usize) -> f64 {
        (k as f64 * 12.9898 + 4.1).sin()
    }

    /// Five joints, one of them sliding, the fourth coupled to the second; two bodies, and points that fit no registration.
    fn data() -> Data {
        let joint = |j: usize| ChainJoint {
            parent: LinkIndex(j),
            child: LinkIndex(j + 1),
            parent_from_joint: Isometry3::new(
                Vector3::new(drawn(j), drawn(j + 20), drawn(j + 40)) * 0.3,
                Vector3::new(drawn(j + 60), drawn(j + 80), drawn(j + 100)),
            ),
            motion: match j {
                2 => Motion::Prismatic(Unit::new_normalize(Vector3::new(0.2, 1.0, 0.1))),
                _ => Motion::Revolute(Unit::new_normalize(Vector3::new(drawn(j), 0.3, 1.0))),
            },
            law: vec![(JointIndex(j), 1.0)],
            offset: 0.1,
        };
        let chain = Chain::new(6, (0..5).map(joint).collect()).expect("a tree");
        let chain = chain.with_coupling(JointIndex(3), JointIndex(1), -0.5);
        let rows = 24;
        let marker = |i: usize, m: usize| {
            let at = 7 * i + 300 * m;
            Some(Point3::new(drawn(at), drawn(at + 1), drawn(at + 2)))
        };
        let body = |link: usize, first: usize| Body {
            link: LinkIndex(link),
            measured: Measured::Markers(
                (0..rows)
                    .map(|i| (first..first + 2).map(|m| marker(i, m)).collect())
                    .collect(),
            ),
            mounts: Vec::new(),
        };
        Data {
            chain,
            readings: (0..rows)
                .map(|i| (0..5).map(|j| Some(drawn(31 * i + j))).collect())
                .collect(),
            recording: (0..rows).map(|i| RecordingIndex(i / 12)).collect(),
            rates: Vec::new(),
            bodies: vec![body(5, 0), body(3, 2)],
        }
    }

    #[test]
    fn sums_are_those_of_corrected_data() {
        let data = data();
        let scan = Scan::new(&data, &[]);
        let (joint, source) = (JointIndex(1), JointIndex(4));
        let hypotheses = [
            Hypothesis::Sign { joint },
            Hypothesis::Sign {
                joint: JointIndex(2),
            },
            Hypothesis::Unit {
                joint,
                mistake: UnitMistake::RadiansReadAsDegrees,
            },
            Hypothesis::Units {
                mistake: UnitMistake::DegreesReadAsRadians,
            },
            Hypothesis::Offset {
                joint,
                turns: QuarterTurns::Plus90,
            },
            Hypothesis::Coupling {
                joint,
                source,
                factor: -1.0,
            },
            Hypothesis::Exchange {
                first: joint,
                second: source,
            },
            Hypothesis::RowShift { rows: 1 },
            Hypothesis::WrongLink {
                body: super::super::ids::BodyIndex(0),
                link: LinkIndex(2),
            },
        ];
        let scopes = [
            Scope::All,
            Scope::Recording(RecordingIndex(1)),
            Scope::AllExcept(RecordingIndex(0)),
        ];
        for hypothesis in hypotheses {
            let whole = matches!(hypothesis, Hypothesis::WrongLink { .. });
            let scopes = if whole { &scopes[..1] } else { &scopes[..] };
            for scored in scan.score(&hypothesis, scopes, f64::INFINITY) {
                let scoped = Scoped {
                    hypothesis,
                    scope: scored.scoped.scope,
                };
                let walked = scan.fit_corrected(&correct(&scoped, &data)).score.rms;
                let off = (scored.score.rms / walked - 1.0).abs();
                assert!(off < 1e-9, "{scoped:?}: {off}");
            }
        }
    }

    #[test]
    fn sums_of_corrected_points_are_those_of_each_scope_alone() {
        let data = data();
        let scan = Scan::new(&data, &[]);
        let scopes = [
            Scope::All,
            Scope::Recording(RecordingIndex(1)),
            Scope::AllExcept(RecordingIndex(0)),
        ];
        for hypothesis in [
            Hypothesis::Mirrored,
            Hypothesis::TrackerAxes { rotation: 5 },
        ] {
            for scored in scan.score(&hypothesis, &scopes, f64::INFINITY) {
                let alone = scan.fit(Some(&scored.scoped)).score;
                for (shared, alone) in [
                    (scored.score.rms, alone.rms),
                    (scored.score.score, alone.score),
                ] {
                    let off = (shared / alone - 1.0).abs();
                    assert!(off < 1e-9, "{:?}: {off}", scored.scoped);
                }
            }
        }
    }
}
