//! Everything that the choice needs: candidates, task, and their linearization.

use std::collections::BTreeSet;

use calib_pipeline::output::shapes::{Unread, collision_solids};
use calib_urdf::{JointId, LinkId, doubt};
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::basis::{Basis, compressed, sigma};
use crate::candidates::{Candidate, Counts, Feasible};
use crate::design::Criterion;
use crate::error::PlanError;
use crate::joints::JointBox;
use crate::known::{CameraNoise, Known};
use crate::linear::Linear;
use crate::list::{Goal, Parameter};
use crate::note::Note;
use crate::scene::Scene;
use crate::sight::{Sight, Subject};
use crate::unchecked;
use crate::words;

/// What is asked for.
#[derive(Debug, Clone)]
pub struct Options {
    /// Postures to record; [`Options::sigma`] decides where it is absent, else 36.
    pub poses: Option<usize>,
    /// σ of the tool's position to be reached, m.
    pub sigma: Option<f64>,
    /// Time of all motions at the most, s: fewer postures are taken where they take longer, and the way decides their order.
    pub path_time: Option<f64>,
    /// What the postures are to be good at.
    pub goal: Goal,
    /// Parameters that the plan is to determine, by a part of their names; all when empty.
    pub of: Vec<String>,
    /// Postures that the choice is made from, before they are filtered.
    pub candidates: usize,
    /// Postures of the task, by joint index.
    pub task: Option<Vec<Vec<f64>>>,
    /// Seed of the sequences.
    pub seed: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            poses: None,
            sigma: None,
            path_time: None,
            goal: Goal::Task,
            of: Vec::new(),
            candidates: CANDIDATES,
            task: None,
            seed: 1,
        }
    }
}

/// Candidates: with 10 000 the σ of the task was 0.6 % better than with 300.
const CANDIDATES: usize = 4096;
/// Task postures.
const TASK: usize = 128;
/// Sequences of postures beside the candidates, each with a seed of its own.
const SEED_TASK: u32 = 0x7a5c;
const SEED_HELD_OUT: u32 = 0x41d0;
const SEED_PAIRS: u32 = 0x9a12;
/// Postures that tell which pairs of links touch always.
const PAIR_POSTURES: usize = 256;

/// Everything that the choice needs, prepared once.
#[derive(Debug)]
pub struct Prepared<'a> {
    /// What is known.
    pub known: &'a Known,
    /// What is asked for.
    pub options: &'a Options,
    /// What moves.
    pub joints: JointBox,
    /// What is possible.
    pub feasible: Feasible<'a>,
    /// Candidates.
    pub candidates: Vec<Candidate>,
    /// What removed others.
    pub counts: Counts,
    /// Task postures.
    pub task: Vec<Vec<f64>>,
    /// Names of the free parameters.
    pub names: Vec<String>,
    /// Directions that can be known.
    pub basis: Basis,
    /// Rows of the candidates in the basis.
    pub rows: Vec<DMatrix<f64>>,
    /// Information before the first posture, in the basis.
    pub before: DMatrix<f64>,
    /// The task in the basis.
    pub b: DMatrix<f64>,
    /// What is to be good.
    pub criterion: Criterion,
    /// What was assumed.
    pub notes: Vec<Note>,
}

/// Candidates, task and linearization.
///
/// # Errors
/// As [`plan`](crate::plan::plan).
pub fn prepare<'a>(known: &'a Known, options: &'a Options) -> Result<Prepared<'a>, PlanError> {
    let spec = &known.robot.profile.plan;
    let file = || known.robot.file.clone();
    let joints = known.joint_box()?;
    if joints.moved.is_empty() {
        return Err(nothing_moves(known, &joints));
    }
    if !spec.cameras.is_empty() && !known.placed {
        return Err(PlanError::NoPlace { file: file() });
    }
    let mut notes = known.notes.clone();
    let (mut feasible, unread) = known.feasible(&joints, options.seed);
    notes.extend(unchecked::notes(known, &joints, &feasible.scene, &unread));
    // The terminal shows the first few: what can damage the robot is among them.
    notes.sort_by_key(|note| match note {
        Note::SurroundingsUnchecked { .. } => 0,
        Note::StandsThere { .. } => 1,
        _ => 2,
    });
    let (candidates, counts) = feasible.all(joints.postures(options.candidates, options.seed));
    if candidates.is_empty() {
        let counts = Box::new(counts);
        return Err(PlanError::NoPosture {
            file: file(),
            counts,
        });
    }
    let task = match &options.task {
        Some(task) => task.clone(),
        None => task_postures(known, &joints, &feasible, options.seed)?,
    };
    let mut linear = known.linearize_in_parts(&candidates, &feasible.sight.subjects, &task)?;
    if linear.names.is_empty() {
        return Err(PlanError::NothingFree { file: file() });
    }
    all_named(&options.of, &linear.names, file)?;
    let basis = Basis::new(
        linear.scale.clone(),
        &linear.has_prior,
        &[&linear.recorded, &linear.planned],
    );
    let before = information(&basis, &linear);
    let b = basis.of(&linear.task);
    if basis.leak(&linear.task) > 1e-6 {
        notes.push(Note::TaskOpen);
    }
    let criterion = criterion(options, &basis, &linear, &b);
    let planned = std::mem::take(&mut linear.planned).into_par_iter();
    let rows = planned.map(|y| basis.of(&y)).collect();
    Ok(Prepared {
        known,
        options,
        joints,
        feasible,
        candidates,
        counts,
        task,
        names: linear.names,
        basis,
        rows,
        before,
        b,
        criterion,
        notes,
    })
}

fn nothing_moves(known: &Known, joints: &JointBox) -> PlanError {
    let model = &known.robot.model;
    let name = |joint: &JointId| model.joint(*joint).name.clone();
    let still = known.still.iter().map(|s| s.0);
    let held = known.robot.profile.plan.hold.keys().copied();
    let held: BTreeSet<JointId> = still.chain(held).collect();
    PlanError::NothingMoves {
        file: known.robot.file.clone(),
        held: held.iter().map(name).collect(),
        fixed: joints.fixed.iter().map(name).collect(),
    }
}

/// Whether every part of a name that is asked for is in the name of a free parameter.
fn all_named(of: &[String], names: &[String], file: impl Fn() -> String) -> Result<(), PlanError> {
    let is_none = |part: &&String| !names.iter().any(|name| name.contains(part.as_str()));
    let Some(part) = of.iter().find(is_none) else {
        return Ok(());
    };
    let words = names
        .iter()
        .flat_map(|n| std::iter::once(n.as_str()).chain(n.split('.')));
    let nearest = calib_finding::nearest_word(part, words);
    Err(PlanError::NoSuchParameter {
        file: file(),
        part: part.clone(),
        nearest: nearest.map(str::to_owned),
        known: names.to_vec(),
    })
}

/// Priors and recorded samples, in the basis.
pub(crate) fn information(basis: &Basis, linear: &Linear) -> DMatrix<f64> {
    let mut m = basis.prior(&linear.has_prior);
    for y in &linear.recorded {
        let y = basis.of(y);
        m.gemm_tr(1.0, &y, &y, 1.0);
    }
    m
}

/// What the profile's words for a goal mean in the basis.
fn criterion(options: &Options, basis: &Basis, linear: &Linear, b: &DMatrix<f64>) -> Criterion {
    let wanted = |name: &String| {
        options.of.is_empty() || options.of.iter().any(|part| name.contains(part.as_str()))
    };
    let names = linear.names.iter().enumerate();
    let chosen: Vec<usize> = names.filter(|(_, n)| wanted(n)).map(|(i, _)| i).collect();
    // What no data determine is no part of the question.
    let determined = |i: &&usize| basis.open.row(**i).norm() < 1e-5;
    let chosen: Vec<usize> = chosen.iter().filter(determined).copied().collect();
    let s = basis.known.select_rows(&chosen);
    match options.goal {
        Goal::Task => Criterion::Trace(b.transpose() * b),
        Goal::Variances => Criterion::Trace(s.transpose() * s),
        Goal::Parameters if options.of.is_empty() => Criterion::Determinant,
        Goal::Parameters => Criterion::Subset(s),
        Goal::Weakest => Criterion::Smallest(s),
    }
}

impl Known {
    /// What decides whether a posture is possible and what is seen in it, and the shapes that could not be read.
    #[must_use]
    pub fn feasible(&self, joints: &JointBox, seed: u32) -> (Feasible<'_>, Vec<Unread>) {
        let model = &self.robot.model;
        let spec = &self.robot.profile.plan;
        let (solids, unread) = collision_solids(&self.robot);
        let for_pairs = joints.postures(PAIR_POSTURES, seed ^ SEED_PAIRS);
        let scene = Scene::new(model, &solids, spec, (joints, &for_pairs));
        let moves = |link: LinkId| !joints.movers(model, link).is_empty();
        let place = self.start.tracker_from_root;
        let mut sight = Sight::new(spec, self.subjects(&moves), place);
        sight.unrecorded = self.unrecorded.clone();
        sight.noise = self.camera_noise();
        if let CameraNoise::Scaled(scale) = sight.noise {
            sight.scale = scale;
        }
        (Feasible::new(model, joints, scene, sight), unread)
    }

    /// What planned postures move: the joints between the root and a body.
    ///
    /// # Errors
    /// [`PlanError::NoRange`] for a joint that slides without limits.
    pub fn joint_box(&self) -> Result<JointBox, PlanError> {
        let model = &self.robot.model;
        let bodies = self.robot.profile.bodies.values();
        let chains = bodies.flat_map(|body| model.chain_to_root(body.link));
        // A joint that follows another moves with it.
        let used: Vec<JointId> = chains.map(|joint| model.joint(joint).law.source).collect();
        let spec = &self.robot.profile.plan;
        let doubtful = doubt::limits_in_degrees(model).into_iter();
        let mut in_use = doubtful.filter(|j| used.contains(j) && !spec.joints.contains_key(j));
        if let Some(joint) = in_use.find(|j| !spec.hold.contains_key(j)) {
            return Err(self.in_degrees(joint));
        }
        JointBox::new(model, spec, &used, &self.still).map_err(|joint| PlanError::NoRange {
            file: self.robot.file.clone(),
            joint: model.joint(joint).name.clone(),
        })
    }

    fn in_degrees(&self, joint: JointId) -> PlanError {
        let joint = self.robot.model.joint(joint);
        let (low, high) = joint.limits.range().unwrap_or_default();
        PlanError::InDegrees {
            file: self.robot.file.clone(),
            joint: joint.name.clone(),
            low,
            high,
        }
    }
}

/// Postures of the task box that touch nothing, seen or not.
fn task_postures(
    known: &Known,
    joints: &JointBox,
    feasible: &Feasible<'_>,
    seed: u32,
) -> Result<Vec<Vec<f64>>, PlanError> {
    /// Postures that are tried for a box.
    const TRIED: usize = 1 << 14;
    let spec = &known.robot.profile.plan;
    let tool = tool_subject(&feasible.sight);
    let mut found = Vec::new();
    let mut reach: Option<[nalgebra::Vector3<f64>; 2]> = None;
    let tried = if spec.task_box.is_some() { TRIED } else { 2048 };
    for q in joints.postures(tried, seed ^ SEED_TASK) {
        let places = known.robot.model.forward_kinematics(&q);
        let placed = feasible.scene.placed(&places);
        if feasible.scene.contact(&placed).is_some() {
            continue;
        }
        let at = tool.map(|t| places[t.link] * t.at);
        if let (Some([low, high]), Some(at)) = (&spec.task_box, at) {
            let [least, most] = reach.get_or_insert([at.coords, at.coords]);
            (*least, *most) = (least.inf(&at.coords), most.sup(&at.coords));
            if (0..3).any(|i| at[i] < low[i] || at[i] > high[i]) {
                continue;
            }
        }
        found.push(q);
        if found.len() == TASK {
            break;
        }
    }
    /// Fewer postures do not stand for a region.
    const STAND_FOR: usize = 8;
    if found.len() < STAND_FOR {
        return Err(PlanError::BoxOutOfReach {
            file: known.robot.file.clone(),
            found: found.len(),
            tried,
            reach: reach.map_or_else(|| "nothing".to_owned(), |r| words::region(&r)),
        });
    }
    Ok(found)
}

/// Something at the end of the longest chain: where the tool is.
fn tool_subject(sight: &Sight) -> Option<&Subject> {
    let mut moved = sight.subjects.iter().filter(|s| s.moves);
    let first = moved.next();
    moved.fold(first, |last, s| match last {
        Some(l) if l.link >= s.link => Some(l),
        _ => Some(s),
    })
}

/// σ of the task before the first posture and after each, m (`None`: not determined), and what becomes of the parameters.
pub type Predicted = (Option<f64>, Vec<Option<f64>>, Vec<Parameter>);

impl Prepared<'_> {
    /// Held-out postures: independent of the candidates, possible and seen, in the task box where there is one.
    #[must_use]
    pub fn held_out(&self, count: usize) -> Vec<Vec<f64>> {
        let seed = self.options.seed ^ SEED_HELD_OUT;
        let spec = &self.known.robot.profile.plan;
        let tool = tool_subject(&self.feasible.sight);
        let inside = |q: &[f64]| match (&spec.task_box, tool) {
            (Some([low, high]), Some(tool)) => {
                let at = self.known.robot.model.forward_kinematics(q)[tool.link] * tool.at;
                (0..3).all(|i| at[i] >= low[i] && at[i] <= high[i])
            }
            _ => true,
        };
        let all = self.joints.postures(1 << 13, seed).into_iter();
        let seen = all.filter(|q| inside(q) && self.feasible.candidate(q.clone()).is_ok());
        seen.take(count).collect()
    }

    /// Rows of some postures in the basis.
    ///
    /// # Errors
    /// [`PlanError::Pipeline`] where the problem cannot be stated.
    pub fn rows_of(&self, postures: &[Candidate]) -> Result<Vec<DMatrix<f64>>, PlanError> {
        if postures.is_empty() {
            return Ok(Vec::new());
        }
        let subjects = &self.feasible.sight.subjects;
        let linear = self.known.linearize(postures, subjects, &self.task)?;
        // What no posture of these shows may be no parameter of theirs.
        let place = |name: &String| linear.names.iter().position(|n| n == name);
        let places: Vec<Option<usize>> = self.names.iter().map(place).collect();
        let rows = linear.planned.iter().map(|y| {
            let columns = places.iter().map(|place| match place {
                Some(place) => y.column(*place).into_owned(),
                None => nalgebra::DVector::zeros(y.nrows()),
            });
            let columns: Vec<_> = columns.collect();
            compressed(&self.basis.of(&DMatrix::from_columns(&columns)))
        });
        Ok(rows.collect())
    }

    /// The joint of a posture that is outside its range.
    #[must_use]
    pub fn outside(&self, q: &[f64]) -> String {
        let mut moved = self.joints.moved.iter();
        let out = moved.find(|m| !m.holds(q[m.joint.index()]));
        let model = &self.known.robot.model;
        out.map_or_else(String::new, |m| model.joint(m.joint).name.clone())
    }

    /// σ of the task and of the parameters after postures in this order, with the sides from which joints come.
    ///
    /// # Errors
    /// [`PlanError::Pipeline`] where the problem cannot be stated.
    pub fn predicted(&self, postures: &[Candidate]) -> Result<Predicted, PlanError> {
        let subjects = &self.feasible.sight.subjects;
        let linear = self.known.linearize(postures, subjects, &self.task)?;
        let all = [linear.recorded.as_slice(), linear.planned.as_slice()];
        let basis = Basis::new(linear.scale.clone(), &linear.has_prior, &all);
        let mut m = information(&basis, &linear);
        let b = basis.of(&linear.task);
        let leaks = basis.leak(&linear.task) > 1e-6;
        let of = |m: &DMatrix<f64>| sigma(m, &b).filter(|_| !leaks);
        let before = of(&m);
        let mut after = Vec::new();
        for y in &linear.planned {
            let y = basis.of(y);
            m.gemm_tr(1.0, &y, &y, 1.0);
            after.push(of(&m));
        }
        let sigmas = basis.sigmas(&m);
        let parameters = (0..linear.names.len()).map(|i| Parameter {
            name: linear.names[i].clone(),
            unit: linear.units[i],
            prior: linear.has_prior[i].then(|| linear.scale[i]),
            after: sigmas[i],
        });
        Ok((before, after, parameters.collect()))
    }
}
