//! Which link carries a body: the one whose motion the body follows, and what else must be wrong in the recordings for it to do so.
//!
//! Each body alone is registered to every group of links that move together ([`calib_checks::structural`], equation (2)); the link with the smallest
//! residual is taken, and the next best stated. A wrong sign or a wrong order makes that choice wrong as well, so the structural hypotheses are asked
//! about the best links and about the ends of the chains, and the assignment with the smallest residual after its correction is kept.

use calib_checks::structural::{
    Body, Chain, Data, Decision, Hypothesis, LinkIndex, Measured, Named, Options, Outcome,
    RecordingIndex, Scope, Scoped, TRACKER_UNITS, apply, explain, registration_residual, thin,
};
use calib_recording::{LengthUnit, Poses};
use calib_urdf::{JointId, LinkId, RobotModel, doubt};

use crate::bodies::Found;
use crate::correct;
use crate::fact::{CERTAIN, Residuals, Rival};
use crate::robot;

/// Another unit of length must divide the residual by this.
const OTHER_UNIT: f64 = 5.0;
/// Residuals of robots of meters are not known better, m.
const ROUNDING: f64 = 1e-7;
/// Noise of a pose, m and rad: what the pipeline takes where the profile states none.
const POSE_SIGMA: (f64, f64) = (3e-4, 1e-3);
/// Rows that a link is chosen from.
const ROWS: usize = 150;
/// Rows that hypotheses are asked about.
const ROWS_OF_HYPOTHESES: usize = 250;
/// Residuals within this factor, and this length, m, do not distinguish links.
const SAME: (f64, f64) = (1.1, 2e-5);

/// Bodies and tables of one robot.
pub struct Scene<'a> {
    /// The nominal robot.
    pub model: &'a RobotModel,
    /// Its bodies.
    pub bodies: &'a [Found],
    /// The recordings, as poses.
    pub tables: &'a [Poses],
}

/// How well a body follows the links.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The link that it follows best; among links that are not distinguished the most distal one whose joints are all recorded.
    pub link: LinkId,
    /// Its residual, rms, m.
    pub rms: f64,
    /// The best of the others.
    pub next: Option<Rival>,
    /// Links with the same residual that recorded joints separate from it.
    pub same: Vec<String>,
    /// All residuals, smallest first.
    pub all: Vec<(LinkId, f64)>,
}

impl<'a> Scene<'a> {
    /// Bodies and tables of a robot.
    #[must_use]
    pub fn new(model: &'a RobotModel, bodies: &'a [Found], tables: &'a [Poses]) -> Self {
        Self {
            model,
            bodies,
            tables,
        }
    }

    /// The engine's input for these bodies on these links.
    #[must_use]
    pub fn data(&self, chain: &Chain, on: &[(usize, LinkId)]) -> Data {
        let joints = self.model.joints().len();
        let mut data = Data {
            chain: chain.clone(),
            readings: Vec::new(),
            recording: Vec::new(),
            rates: Vec::new(),
            bodies: Vec::new(),
        };
        for (r, poses) in self.tables.iter().enumerate() {
            let columns: Vec<(usize, &Vec<Option<f64>>)> = poses
                .joints
                .iter()
                .filter_map(|(name, q)| Some((self.model.joint_id(name).ok()?.index(), q)))
                .collect();
            for row in 0..poses.len() {
                let mut readings = vec![None; joints];
                for (joint, q) in &columns {
                    readings[*joint] = q[row];
                }
                data.readings.push(readings);
                data.recording.push(RecordingIndex(r));
            }
        }
        for (body, link) in on {
            let link = LinkIndex::from(*link);
            let measured = self.measured(&self.bodies[*body]);
            data.bodies.push(Body {
                link,
                measured,
                mounts: Vec::new(),
            });
        }
        data
    }

    fn measured(&self, body: &Found) -> Measured {
        if body.markers.is_empty() {
            let of = |poses: &Poses| match poses.bodies.get(&body.name) {
                Some(track) => track.clone(),
                None => vec![None; poses.len()],
            };
            return Measured::Poses {
                tracker_from_body: self.tables.iter().flat_map(of).collect(),
                sigma_position: POSE_SIGMA.0,
                sigma_orientation: POSE_SIGMA.1,
            };
        }
        let of = |poses: &Poses| -> Vec<Vec<_>> {
            let at = |name: &String, row: usize| *poses.markers.get(name)?.get(row)?;
            let row = |row: usize| body.markers.iter().map(|m| at(m, row)).collect();
            (0..poses.len()).map(row).collect()
        };
        Measured::Markers(self.tables.iter().flat_map(of).collect())
    }

    /// Joints that move in any table.
    #[must_use]
    pub fn moving(&self) -> Vec<JointId> {
        let mut found: Vec<JointId> = Vec::new();
        for poses in self.tables {
            for (joint, _) in crate::session::moved(self.model, poses) {
                if !found.contains(&joint) {
                    found.push(joint);
                }
            }
        }
        found
    }

    /// Joints with a column in any table.
    fn recorded(&self) -> Vec<JointId> {
        let names = self.tables.iter().flat_map(|poses| poses.joints.keys());
        let mut found: Vec<JointId> = names.filter_map(|n| self.model.joint_id(n).ok()).collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The ends of the chains: the last links that recorded joints move.
    #[must_use]
    pub fn recorded_tips(&self) -> Vec<LinkId> {
        let recorded = self.recorded();
        let of = |tip: robot::Tip| {
            let mut joints = tip.joints.into_iter().rev();
            let last = joints.find(|j| recorded.contains(j))?;
            Some(robot::group(self.model, self.model.joint(last).child))
        };
        robot::tips(self.model).into_iter().filter_map(of).collect()
    }

    /// The link of a body; `None` where no row shows it with joints.
    #[must_use]
    pub fn choose(&self, chain: &Chain, body: usize) -> Option<Choice> {
        let mut all = self.residuals(chain, body, None)?;
        all.sort_by(|a, b| a.1.total_cmp(&b.1));
        Some(self.chosen(all))
    }

    /// Residual of a body on each group of links, rms, m, after a correction.
    pub(crate) fn residuals(
        &self,
        chain: &Chain,
        body: usize,
        correction: Option<&Scoped>,
    ) -> Option<Vec<(LinkId, f64)>> {
        let data = thin(&self.data(chain, &[(body, self.model.root())]), ROWS);
        let mut data = match correction {
            Some(scoped) => apply(scoped, &data),
            None => data,
        };
        let mut all = Vec::new();
        for link in robot::groups(self.model) {
            data.bodies[0].link = LinkIndex::from(link);
            all.push((link, registration_residual(&data).ok()?));
        }
        Some(all)
    }

    /// The unit of the tracker's lengths, if another one explains the motion of the bodies better on whatever links. A body read too small seems to
    /// stand still, so this is asked before any link, of a file that was read as `read_as`: residuals are compared as densities of what was measured, per unit of the file.
    #[must_use]
    pub fn tracker_unit(&self, read_as: LengthUnit) -> Option<(Scoped, Residuals)> {
        let chain = Chain::from_model(self.model).ok()?;
        // What is smaller than the rounding of the sums says nothing of a body that was made a thousand times smaller.
        let least = |body: usize, correction: Option<&Scoped>| {
            let all = self.residuals(&chain, body, correction)?;
            let least = all.into_iter().map(|(_, rms)| rms).min_by(f64::total_cmp);
            least.map(|rms| rms.max(ROUNDING))
        };
        let mut best: Option<(f64, Scoped, Residuals)> = None;
        // A URDF in millimeters makes every unit too small.
        let too_large = doubt::reach(self.model) > doubt::LARGEST;
        let of_robot = TRACKER_UNITS.into_iter().filter(|_| too_large);
        for (unit, read_as) in correct::units_but(read_as).chain(of_robot) {
            let scoped = Scoped {
                hypothesis: Hypothesis::TrackerUnit { unit, read_as },
                scope: Scope::All,
            };
            let factor = unit.meters() / read_as.meters();
            let (mut gain, mut none, mut after) = (0.0, 0.0_f64, 0.0_f64);
            for body in 0..self.bodies.len() {
                let (Some(as_read), Some(scaled)) = (least(body, None), least(body, Some(&scoped)))
                else {
                    continue;
                };
                // Half of what a pose states has no unit of length.
                let share = if self.bodies[body].markers.is_empty() {
                    0.5
                } else {
                    1.0
                };
                gain += (as_read / scaled).ln() + share * factor.ln();
                (none, after) = (none.max(as_read), after.max(scaled));
            }
            let residuals = Residuals {
                none,
                best: after,
                next: None,
                over: None,
            };
            if gain > OTHER_UNIT.ln() && best.as_ref().is_none_or(|b| gain > b.0) {
                best = Some((gain, scoped, residuals));
            }
        }
        best.map(|(_, scoped, residuals)| (scoped, residuals))
    }

    fn chosen(&self, all: Vec<(LinkId, f64)>) -> Choice {
        let recorded = self.recorded();
        let best = all[0].1;
        let near = |rms: f64| rms <= SAME.0 * best + SAME.1;
        let named = |link: LinkId| self.model.link(link).name.clone();
        // A joint without a column stands still as far as anybody knows.
        let movers = |link: LinkId| -> Vec<JointId> {
            let all = robot::movers(self.model, link);
            all.into_iter().filter(|j| recorded.contains(j)).collect()
        };
        let whole = |link: LinkId| movers(link).len() == robot::movers(self.model, link).len();
        let candidates = all.iter().filter(|(_, rms)| near(*rms));
        let chosen = candidates
            .clone()
            .filter(|(link, _)| whole(*link))
            .fold(
                None,
                |known: Option<(LinkId, f64)>, (link, rms)| match known {
                    Some((other, _)) if movers(other).len() >= movers(*link).len() => known,
                    _ => Some((*link, *rms)),
                },
            )
            .unwrap_or(all[0]);
        let mine = movers(chosen.0);
        let distinct = |link: &LinkId| movers(*link) != mine;
        let same = candidates
            .filter(|(link, _)| distinct(link))
            .map(|(link, _)| named(*link));
        let same: Vec<String> = same.collect();
        let next = all.iter().find(|(link, rms)| !near(*rms) && distinct(link));
        Choice {
            link: chosen.0,
            rms: chosen.1,
            next: next.map(|(link, rms)| Rival {
                link: named(*link),
                rms: *rms,
            }),
            same,
            all,
        }
    }

    /// Bodies of two markers that follow different links: two markers alone can keep their distance by chance.
    #[must_use]
    pub fn not_rigid(&self) -> Vec<usize> {
        let Ok(chain) = Chain::from_model(self.model) else {
            return Vec::new();
        };
        let alone = |marker: &String, poses: &[Poses]| {
            let one = [Found {
                name: marker.clone(),
                markers: vec![marker.clone()],
            }];
            let scene = Scene {
                model: self.model,
                bodies: &one,
                tables: poses,
            };
            scene.choose(&chain, 0)
        };
        let apart = |(i, body): (usize, &Found)| {
            let [first, second] = body.markers.as_slice() else {
                return None;
            };
            let (first, second) = (alone(first, self.tables)?, alone(second, self.tables)?);
            let together = self.choose(&chain, i)?;
            let each = ((first.rms.powi(2) + second.rms.powi(2)) / 2.0).sqrt();
            (first.link != second.link && together.rms > CERTAIN * each).then_some(i)
        };
        self.bodies.iter().enumerate().filter_map(apart).collect()
    }

    /// Asks the structural hypotheses about bodies on these links.
    #[must_use]
    pub fn ask(&self, chain: &Chain, on: &[(usize, LinkId)]) -> Option<Outcome> {
        let data = self.data(chain, on);
        let mut options = Options::default();
        options.list_invisible = false;
        options.score_tests = false;
        options.most_rows = ROWS_OF_HYPOTHESES;
        explain(&data, &options).ok()
    }

    /// Residual of all rows that hypotheses are asked about, rms, m, outliers among them.
    #[must_use]
    pub fn rms_of_all(&self, on: &[(usize, LinkId)]) -> Option<f64> {
        let chain = Chain::from_model(self.model).ok()?;
        let data = thin(&self.data(&chain, on), ROWS_OF_HYPOTHESES);
        registration_residual(&data).ok()
    }

    /// The assignment that explains the recordings best after its correction, among the links that bodies follow best and the ends of the chains.
    /// Each body's own choice comes first and wins a tie.
    #[must_use]
    pub fn assign(
        &self,
        chain: &Chain,
        choices: &[(usize, Choice)],
        stated: &[(usize, LinkId)],
    ) -> Assigned {
        let own: Vec<(usize, LinkId)> = choices
            .iter()
            .map(|(body, choice)| {
                let link = stated
                    .iter()
                    .find(|(b, _)| b == body)
                    .map(|(_, link)| *link);
                (*body, link.unwrap_or(choice.link))
            })
            .collect();
        let outcome = self.ask(chain, &own);
        let mut best = Assigned::new(own.clone(), outcome);
        if best.settled() {
            return best;
        }
        // A joint that moved without a column, or with one that never changes, hides the links beyond it.
        let mut tips = self.recorded_tips();
        for tip in robot::tips(self.model) {
            let link = robot::group(self.model, tip.link);
            if !tips.contains(&link) {
                tips.push(link);
            }
        }
        for (at, (body, _)) in own.iter().enumerate() {
            if stated.iter().any(|(b, _)| b == body) {
                continue;
            }
            let near = choices.iter().filter(|(b, _)| b == body);
            let near = near.flat_map(|(_, choice)| &choice.same);
            let near = near.filter_map(|name| self.model.link_id(name).ok());
            for link in tips.iter().copied().chain(near) {
                let mut on = best.on.clone();
                if on[at].1 == link {
                    continue;
                }
                on[at].1 = link;
                let asked = Assigned::new(on.clone(), self.ask(chain, &on));
                // Where the correction is another link, that link is the one to compare.
                if !asked.is_on_a_wrong_link() && asked.explains_more_than(&best) {
                    best = asked;
                }
            }
        }
        best
    }
}

/// Bodies on links, and what the hypotheses say of it.
#[derive(Debug, Clone)]
pub struct Assigned {
    /// Body and link.
    pub on: Vec<(usize, LinkId)>,
    /// What the engine found; `None`: too little to ask.
    pub outcome: Option<Outcome>,
}

impl Assigned {
    fn new(on: Vec<(usize, LinkId)>, outcome: Option<Outcome>) -> Self {
        Self { on, outcome }
    }

    /// The correction that is named, alone or as the leading one.
    #[must_use]
    pub fn named(&self) -> Option<&Named> {
        match &self.outcome.as_ref()?.decision {
            Decision::Named(named) => Some(named),
            Decision::Undecided { leading, .. } => leading.as_ref(),
            _ => None,
        }
    }

    /// Nothing stands out, and errors of a nominal robot explain what is left.
    fn settled(&self) -> bool {
        self.outcome.as_ref().is_none_or(|outcome| {
            // A change at one row leaves the links as they are.
            if outcome.jump.is_some() {
                return true;
            }
            let consistent = matches!(
                outcome.decision,
                Decision::Consistent { .. } | Decision::TooFewData { .. }
            );
            consistent && outcome.expected.is_none_or(|e| outcome.rms <= e.limit)
        })
    }

    /// The correction puts a body on another link.
    fn is_on_a_wrong_link(&self) -> bool {
        let mut corrections = self.named().into_iter().flat_map(|named| &named.correction);
        corrections.any(|scoped| matches!(scoped.hypothesis, Hypothesis::WrongLink { .. }))
    }

    /// A clearly smaller residual, or about the same with fewer corrections.
    fn explains_more_than(&self, other: &Self) -> bool {
        let corrections = |a: &Self| a.named().map_or(0, |named| named.correction.len());
        let fewer = corrections(self) < corrections(other);
        let limit = if fewer { SAME.0 } else { 1.0 / SAME.0 };
        self.left() < limit * other.left()
    }

    /// The residual after the correction, m.
    fn left(&self) -> f64 {
        let rms = self.outcome.as_ref().map_or(f64::INFINITY, |o| o.rms);
        let jump = self.outcome.as_ref().and_then(|o| o.jump.as_ref());
        let rms = jump.map_or(rms, |jump| jump.rms);
        self.named().map_or(rms, |named| named.evidence.best)
    }
}

/// Whether a hypothesis is about the links that carry bodies.
#[must_use]
pub fn is_of_links(hypothesis: &Hypothesis) -> bool {
    matches!(
        hypothesis,
        Hypothesis::WrongLink { .. } | Hypothesis::ExchangedBodies { .. }
    )
}
