//! Postures that the robot can take and the tracker can see.

use std::collections::BTreeMap;

use calib_urdf::{LinkId, RobotModel};
use rayon::prelude::*;
use serde::Serialize;

use crate::joints::JointBox;
use crate::known::CameraNoise;
use crate::scene::{Contact, Scene, rigid_parts};
use crate::sight::{Seen, Sight, normal};

/// A posture that is possible and seen.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Joint positions by joint index, rad or m.
    pub q: Vec<f64>,
    /// What is seen, in the order of [`Sight::subjects`].
    pub seen: Vec<Seen>,
}

/// How many postures each constraint removed; each is counted at the first that removes it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Postures that were looked at.
    pub tried: usize,
    /// Two links too near to each other.
    pub self_collision: usize,
    /// The pair of links that did so most often.
    pub worst_pair: Option<[String; 2]>,
    /// A link too near to the ground.
    pub ground: usize,
    /// A link too near to a keep-out, by its name.
    pub keep_outs: BTreeMap<String, usize>,
    /// No moving body is seen by enough cameras.
    pub not_seen: usize,
    /// What is left.
    pub feasible: usize,
}

/// What decides whether a posture is possible.
#[derive(Debug, Clone)]
pub struct Feasible<'a> {
    /// The robot.
    pub model: &'a RobotModel,
    /// What it must not touch.
    pub scene: Scene,
    /// What is seen.
    pub sight: Sight,
    parts: Vec<usize>,
    levers: Vec<f64>,
}

/// Near something, a motion is looked at again after this share of the clearance, and not before [`LEAST_STEP`]: between two looks the distance
/// is then at most half of that below the clearance.
const STEP: f64 = 0.25;
/// Least step between two looks, m.
const LEAST_STEP: f64 = 1e-3;

impl<'a> Feasible<'a> {
    /// For a robot, its surroundings and its tracker.
    #[must_use]
    pub fn new(model: &'a RobotModel, joints: &JointBox, scene: Scene, sight: Sight) -> Self {
        let levers = scene.levers(model, &joints.travel(model));
        Self {
            model,
            scene,
            sight,
            parts: rigid_parts(model),
            levers,
        }
    }

    /// A posture, or why not.
    ///
    /// # Errors
    /// The contact; `None` for a posture in which nothing is seen.
    pub fn candidate(&self, q: Vec<f64>) -> Result<Candidate, Option<Contact>> {
        let placed = self.scene.placed(&self.model.forward_kinematics(&q));
        if let Some(contact) = self.scene.contact(&placed) {
            return Err(Some(contact));
        }
        let seen = self.looked_at(&q);
        if !self.sight.measures(&seen) {
            return Err(None);
        }
        Ok(Candidate { q, seen })
    }

    /// What should be seen of a posture, possible or not.
    #[must_use]
    pub fn looked_at(&self, q: &[f64]) -> Vec<Seen> {
        let root_from_link = self.model.forward_kinematics(q);
        let placed = self.scene.placed(&root_from_link);
        let scene = (&self.scene, self.parts.as_slice());
        self.sight.seen(scene, &placed, &root_from_link)
    }

    /// Those of some postures that are possible, and what removed the others. Covariances of markers are stated relative to these postures
    /// from then on.
    #[must_use]
    pub fn all(&mut self, postures: Vec<Vec<f64>>) -> (Vec<Candidate>, Counts) {
        let mut counts = Counts {
            tried: postures.len(),
            ..Counts::default()
        };
        let judged: Vec<_> = postures
            .into_par_iter()
            .map(|q| self.candidate(q))
            .collect();
        let mut pairs: BTreeMap<(LinkId, LinkId), usize> = BTreeMap::new();
        let mut kept = Vec::new();
        for one in judged {
            match one {
                Ok(candidate) => kept.push(candidate),
                Err(None) => counts.not_seen += 1,
                Err(Some(Contact::Ground)) => counts.ground += 1,
                Err(Some(Contact::KeepOut(name))) => {
                    *counts.keep_outs.entry(name).or_default() += 1
                }
                Err(Some(Contact::Links(a, b))) => {
                    counts.self_collision += 1;
                    *pairs.entry((a, b)).or_default() += 1;
                }
            }
        }
        let name = |link: LinkId| self.model.link(link).name.clone();
        let worst = pairs.into_iter().max_by_key(|(_, count)| *count);
        counts.worst_pair = worst.map(|((a, b), _)| [name(a), name(b)]);
        counts.feasible = kept.len();
        let factor = match self.sight.noise {
            CameraNoise::Stated => normal(kept.iter().flat_map(|c| &c.seen)),
            CameraNoise::Scaled(_) | CameraNoise::Equal => 1.0,
        };
        for shape in kept
            .iter_mut()
            .flat_map(|c| &mut c.seen)
            .flatten()
            .flatten()
        {
            *shape *= factor;
        }
        self.sight.scale *= factor;
        (kept, counts)
    }

    /// Whether the straight motion of all joints between two postures touches nothing, however thin it is.
    ///
    /// Conservative advancement: where everything is at least d away, nothing is touched before some point has moved by d.
    #[must_use]
    pub fn clear(&self, from: &[f64], to: &[f64]) -> bool {
        let moves = from.iter().zip(to).zip(&self.levers);
        let length: f64 = moves.map(|((a, b), lever)| (b - a).abs() * lever).sum();
        let clearance = self.scene.clearance;
        let mut done = 0.0;
        while done < length {
            let t = done / length;
            let q: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + (b - a) * t).collect();
            let placed = self.scene.placed(&self.model.forward_kinematics(&q));
            let nearest = self.scene.nearest(&placed);
            if nearest < clearance {
                return false;
            }
            done += (nearest - clearance).max(STEP * clearance).max(LEAST_STEP);
        }
        true
    }
}
