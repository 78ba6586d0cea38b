//! What a posture must not touch: the robot itself, keep-outs, the ground.

use std::collections::{BTreeMap, BTreeSet};

use calib_profile::{KeepOut, PlanSpec};
use calib_report::view3d::Solid;
use calib_urdf::{JointId, JointKind, LinkId, RobotModel};
use nalgebra::{Isometry3, Point3};

use crate::joints::JointBox;
use crate::shape::{Capsule, capsules};

/// Why a posture or a motion is not possible.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Contact {
    /// Two links are too near to each other.
    Links(LinkId, LinkId),
    /// A link is too near to a keep-out.
    KeepOut(String),
    /// A link is too near to the ground.
    Ground,
}

/// A capsule of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkCapsule {
    /// The link that carries it.
    pub link: LinkId,
    /// The links that no joint moves against it have the same number.
    pub body: usize,
    /// In the link's frame.
    pub capsule: Capsule,
}

/// What a posture must not touch.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// All capsules of the robot.
    pub capsules: Vec<LinkCapsule>,
    /// Pairs of rigid parts that are compared, lower number first.
    pub pairs: Vec<(usize, usize)>,
    /// Pairs that touch in nearly all postures, so that their capsules tell nothing: not compared.
    pub always: Vec<(usize, usize)>,
    /// Pairs of parts with one part between them that are nearer than the clearance in nearly all postures: they may be, but must not touch.
    pub close: Vec<(usize, usize)>,
    /// Pairs of parts with one joint between them that are compared: they are near it by design, and must not touch.
    next: BTreeSet<(usize, usize)>,
    /// Distance that is kept, m.
    pub clearance: f64,
    keep_outs: BTreeMap<String, KeepOut>,
    ground: Option<f64>,
    /// The rigid parts that planned joints move: the others may stand on the ground and in a keep-out.
    moving: BTreeSet<usize>,
}

/// Pairs that touch in more than this share of all postures of the joint box do so by the size of their capsules.
const ALWAYS: f64 = 0.9;
/// The same of parts with one joint between them, which mostly overlap there; those that do not are folded onto each other where they do.
const ALWAYS_NEXT: f64 = 0.5;

impl Scene {
    /// From the shapes of the links; `postures` (over the joint box) tell which pairs touch always. What no joint of the box moves is compared with
    /// what moves only.
    #[must_use]
    pub fn new(
        model: &RobotModel,
        solids: &[Solid],
        spec: &PlanSpec,
        (joints, postures): (&JointBox, &[Vec<f64>]),
    ) -> Self {
        let body = rigid_parts(model);
        let mut all = Vec::new();
        for solid in solids {
            let points: Vec<Point3<f64>> = solid.points.iter().map(|p| Point3::from(*p)).collect();
            let Some(link) = model.link_ids().nth(solid.frame) else {
                continue;
            };
            all.extend(capsules(&points).into_iter().map(|capsule| LinkCapsule {
                link,
                body: body[link.index()],
                capsule,
            }));
        }
        let neighbors = neighbors(model, &body);
        let parts = all
            .iter()
            .map(|c| c.body)
            .collect::<std::collections::BTreeSet<_>>();
        let parts: Vec<usize> = parts.into_iter().collect();
        // The joints of the box that carry a part; the links of a part have the same ones.
        let carriers = |part: usize| -> Vec<JointId> {
            let link = all.iter().find(|c| c.body == part).map(|c| c.link);
            link.map_or_else(Vec::new, |link| joints.movers(model, link))
        };
        let carried: BTreeMap<usize, Vec<JointId>> =
            parts.iter().map(|part| (*part, carriers(*part))).collect();
        let mut pairs = Vec::new();
        for (i, a) in parts.iter().enumerate() {
            for b in &parts[i + 1..] {
                // What no joint of the box moves against each other is as it is in every posture.
                let rigid = carried[a] == carried[b];
                if !rigid {
                    pairs.push((*a, *b));
                }
            }
        }
        let mut scene = Self {
            capsules: all,
            pairs,
            always: Vec::new(),
            close: Vec::new(),
            next: neighbors.iter().copied().collect(),
            keep_outs: spec.keep_outs.clone(),
            ground: spec.ground,
            clearance: spec.clearance,
            moving: carried
                .into_iter()
                .filter(|(_, by)| !by.is_empty())
                .map(|(part, _)| part)
                .collect(),
        };
        // Next but one in the chain: how near they are is of the robot's making.
        let next = |a: usize, b: usize| neighbors.contains(&(a.min(b), a.max(b)));
        let beyond = |(a, b): (usize, usize)| body.iter().any(|c| next(a, *c) && next(*c, b));
        scene.skip_those_that_touch_always(model, postures, &beyond);
        scene
    }

    fn skip_those_that_touch_always(
        &mut self,
        model: &RobotModel,
        postures: &[Vec<f64>],
        next_but_one: &dyn Fn((usize, usize)) -> bool,
    ) {
        let mut touching = vec![[0_usize; 2]; self.pairs.len()];
        for q in postures {
            let placed = self.placed(&model.forward_kinematics(q));
            for (counts, pair) in touching.iter_mut().zip(&self.pairs) {
                for (count, clearance) in counts.iter_mut().zip([0.0, self.clearance]) {
                    *count += usize::from(self.near(&placed, *pair, clearance).is_some());
                }
            }
        }
        let more = |count: usize, share: f64| {
            !postures.is_empty() && count as f64 > share * postures.len() as f64
        };
        let mostly = |count: usize| more(count, ALWAYS);
        let pairs = std::mem::take(&mut self.pairs);
        for (pair, [touch, close]) in pairs.into_iter().zip(touching) {
            let next = self.next.contains(&pair);
            if mostly(touch) || (next && more(touch, ALWAYS_NEXT)) {
                self.always.push(pair);
                continue;
            }
            self.pairs.push(pair);
            if mostly(close) && next_but_one(pair) && !next {
                self.close.push(pair);
            }
        }
    }

    /// All capsules where the links are.
    #[must_use]
    pub fn placed(&self, root_from_link: &[Isometry3<f64>]) -> Vec<Capsule> {
        let place = |c: &LinkCapsule| c.capsule.moved(&root_from_link[c.link.index()]);
        self.capsules.iter().map(place).collect()
    }

    /// What the robot would touch; `None`: nothing.
    #[must_use]
    pub fn contact(&self, placed: &[Capsule]) -> Option<Contact> {
        let mut moving = self.moving(placed);
        if let Some(contact) = moving.find_map(|(_, at)| self.surroundings(at)) {
            return Some(contact);
        }
        let touching = self
            .pairs
            .iter()
            .find_map(|pair| self.near(placed, *pair, self.clearance - self.allowed(*pair)));
        touching.map(|(a, b)| Contact::Links(a, b))
    }

    /// By how much less than the clearance a pair of parts may be apart, m.
    fn allowed(&self, pair: (usize, usize)) -> f64 {
        if self.close.contains(&pair) || self.next.contains(&pair) {
            self.clearance
        } else {
            0.0
        }
    }

    /// Distance of the robot to what it must not touch and of its parts to each other, m, the clearance more for those that are always close; below 0
    /// where others overlap.
    #[must_use]
    pub fn nearest(&self, placed: &[Capsule]) -> f64 {
        let mut least = f64::INFINITY;
        for (_, at) in self.moving(placed) {
            if let Some(ground) = self.ground {
                least = least.min(at.lowest() - ground);
            }
            for b in self.keep_outs.values() {
                least = least.min(at.distance_to_box(&b.size, &b.root_from_box));
            }
        }
        for (i, first) in self.capsules.iter().enumerate() {
            for (j, second) in self.capsules.iter().enumerate().skip(i + 1) {
                let (a, b) = (first.body.min(second.body), first.body.max(second.body));
                if self.pairs.contains(&(a, b)) {
                    let distance = placed[i].distance(&placed[j]);
                    least = least.min(distance + self.allowed((a, b)));
                }
            }
        }
        least
    }

    /// Links that no planned joint moves, and that are in contact with ground or a keep-out in every posture; those of the root's part are not among
    /// them.
    #[must_use]
    pub fn standing(&self, model: &RobotModel, base: &[f64]) -> Vec<LinkId> {
        let placed = self.placed(&model.forward_kinematics(base));
        let root = rigid_parts(model)[model.root().index()];
        let all = self.capsules.iter().zip(&placed);
        let still = all.filter(|(c, _)| c.body != root && !self.moving.contains(&c.body));
        let mut links: Vec<LinkId> = still
            .filter(|(_, at)| self.surroundings(at).is_some())
            .map(|(c, _)| c.link)
            .collect();
        links.dedup();
        links
    }

    /// What a capsule is too near to, beside the robot.
    fn surroundings(&self, at: &Capsule) -> Option<Contact> {
        if self
            .ground
            .is_some_and(|z| at.lowest() < z + self.clearance)
        {
            return Some(Contact::Ground);
        }
        let mut keep_outs = self.keep_outs.iter();
        let near =
            keep_outs.find(|(_, b)| at.distance_to_box(&b.size, &b.root_from_box) < self.clearance);
        near.map(|(name, _)| Contact::KeepOut(name.clone()))
    }

    /// Capsules of all parts that planned joints move.
    fn moving<'a>(
        &'a self,
        placed: &'a [Capsule],
    ) -> impl Iterator<Item = (&'a LinkCapsule, &'a Capsule)> {
        let all = self.capsules.iter().zip(placed);
        all.filter(|(c, _)| self.moving.contains(&c.body))
    }

    /// How far any point of a capsule moves at the most by one unit (rad, m) of each joint, by joint index: the length of the way from the
    /// joint to the farthest point that it carries, whatever the posture. A joint that follows another adds to that one.
    ///
    /// `travel`: the largest displacement of each sliding joint from 0, m.
    #[must_use]
    pub fn levers(&self, model: &RobotModel, travel: &[f64]) -> Vec<f64> {
        let mut levers = vec![0.0; model.joints().len()];
        for id in model.joint_ids() {
            let joint = model.joint(id);
            let carried = self.capsules.iter().filter(|c| model.carries(id, c.link));
            let reach = |c: &LinkCapsule| {
                let own = c.capsule.a.coords.norm().max(c.capsule.b.coords.norm()) + c.capsule.r;
                let way = model.chain_to_root(c.link).into_iter();
                let way = way.take_while(|above| *above != id);
                let of = |j: JointId| {
                    let origin = model.joint(j).parent_link_from_joint.translation;
                    origin.vector.norm() + travel[j.index()]
                };
                own + way.map(of).sum::<f64>()
            };
            let reach = match joint.kind.turns() {
                true => carried.map(reach).fold(0.0, f64::max),
                false => f64::from(u8::from(carried.count() > 0)),
            };
            levers[joint.law.source.index()] += joint.law.multiplier.abs() * reach;
        }
        levers
    }

    /// The first capsules of a pair of parts that are too near.
    fn near(
        &self,
        placed: &[Capsule],
        (a, b): (usize, usize),
        clearance: f64,
    ) -> Option<(LinkId, LinkId)> {
        let of = |part: usize| {
            let all = self.capsules.iter().enumerate();
            all.filter(move |(_, c)| c.body == part)
        };
        for (i, first) in of(a) {
            for (j, second) in of(b) {
                if placed[i].distance(&placed[j]) < clearance {
                    return Some((first.link, second.link));
                }
            }
        }
        None
    }

    /// Whether a line of sight to a point of a link passes all other rigid parts.
    #[must_use]
    pub fn sees(
        &self,
        placed: &[Capsule],
        from: &Point3<f64>,
        (to, body): (&Point3<f64>, usize),
    ) -> bool {
        let others = self.capsules.iter().zip(placed);
        let mut others = others.filter(|(c, _)| c.body != body);
        !others.any(|(_, at)| at.hides(from, to))
    }
}

/// Number of the rigid part that each link belongs to: links joined by fixed joints are one.
#[must_use]
pub fn rigid_parts(model: &RobotModel) -> Vec<usize> {
    let mut part: Vec<usize> = (0..model.links().len()).collect();
    // Parents first, by the length of the way to the root.
    let mut joints: Vec<_> = model.joint_ids().collect();
    joints.sort_by_key(|j| model.chain_to_root(model.joint(*j).child).len());
    for id in joints {
        let joint = model.joint(id);
        if joint.kind == JointKind::Fixed {
            part[joint.child.index()] = part[joint.parent.index()];
        }
    }
    part
}

/// Pairs of rigid parts with one joint between them, lower number first.
fn neighbors(model: &RobotModel, part: &[usize]) -> Vec<(usize, usize)> {
    let of = |joint: &calib_urdf::Joint| {
        let (a, b) = (part[joint.parent.index()], part[joint.child.index()]);
        (a != b).then_some((a.min(b), a.max(b)))
    };
    model.joints().iter().filter_map(of).collect()
}
