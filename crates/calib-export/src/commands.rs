//! The commands of a program, one after the other.
//!
//! From which side a joint comes is known once its command is: the search begins with the directions in which the wanted positions move,
//! and is repeated with those of the commands that it found. What is stated of a row is evaluated with these.

use calib_model::{
    Aim, Approach, Correction, Model, ModelError, Options, Outcome, Place, Pose, Scope, Under, Work,
};
use nalgebra::Matrix6;

use crate::starts::{LEVER, Starts};
use crate::table::WrittenLike;

/// Searches of a row; a joint whose direction still changes then is between its two sides.
const SEARCHES: usize = 4;
/// A tool that is further from a pose than this is nowhere near it, m and rad (1°).
const NEAR: (f64, f64) = (5e-3, 0.0175);
/// A command whose tool is as near is there, m: a thousandth of what any tracker resolves.
const THERE: f64 = 1e-7;

/// What is corrected.
#[derive(Debug, Clone, Default)]
pub struct CorrectOptions {
    /// The link or point that is to be right; `None`: the last link.
    pub tool: Option<String>,
    /// Only its position.
    pub position_only: bool,
    /// Bound on the change of a joint, rad and m; `None`: that of [`Options::default`].
    pub largest_rad: Option<f64>,
    /// The same of sliding joints.
    pub largest_m: Option<f64>,
    /// How the table is written.
    pub like: WrittenLike,
}

impl CorrectOptions {
    fn within(&self, default: Options) -> Options {
        Options {
            aim: match self.position_only {
                true => Aim::Position,
                false => default.aim,
            },
            largest_rad: self.largest_rad.unwrap_or(default.largest_rad),
            largest_m: self.largest_m.unwrap_or(default.largest_m),
            ..default
        }
    }
}

/// What a row became.
#[derive(Debug, Clone)]
pub(crate) struct Command {
    /// rad or m.
    pub q: Vec<f64>,
    pub outcome: Outcome,
    /// A joint outside of its fitted range.
    pub outside: Option<usize>,
    /// By another posture than that of the row before.
    pub elsewhere: bool,
    /// How far the tool is from where it is wanted without the correction, m and rad.
    pub before: (f64, f64),
    /// With it.
    pub after: (f64, f64),
}

/// What is commanded, and where the joints come from.
pub(crate) struct Commands<'a> {
    model: &'a Model,
    tool: Place,
    options: &'a CorrectOptions,
    /// The table has no joint positions: the search begins where the last row ended.
    without_joints: bool,
    work: Work,
    starts: Option<Starts>,
    /// Of the commands so far.
    approach: Approach,
    /// Of the program as it is, without correction.
    uncorrected: Approach,
    last: Vec<f64>,
}

impl<'a> Commands<'a> {
    pub(crate) fn new(
        model: &'a Model,
        tool: Place,
        options: &'a CorrectOptions,
        without_joints: bool,
    ) -> Self {
        Self {
            model,
            tool,
            options,
            without_joints,
            work: model.work(),
            starts: None,
            approach: Approach::new(model),
            uncorrected: Approach::new(model),
            last: vec![0.0; model.joints().len()],
        }
    }

    /// The command of the next row: to the pose, else to where the nominal model has the tool at the joint positions.
    pub(crate) fn next(
        &mut self,
        q: &[f64],
        pose: Option<Pose>,
        temperature_c: &[f64],
    ) -> Result<Command, ModelError> {
        let model = self.model;
        let seed = match self.without_joints {
            true => self.last.clone(),
            false => q.to_vec(),
        };
        let wanted = match pose {
            Some(pose) => pose,
            None => {
                model.forward_nominal(&seed, &mut self.work)?;
                model.root_from(self.tool, &self.work)?
            }
        };
        let from = |before: &Approach, q: &[f64]| -> Result<Approach, ModelError> {
            let mut after = before.clone();
            after.update(model, q)?;
            Ok(after)
        };
        let mut from_side = from(&self.approach, &seed)?;
        let mut found = None;
        for _ in 0..SEARCHES {
            let under = Under {
                approach: from_side.directions(),
                held: None,
                temperature_c,
            };
            let (done, command, elsewhere) = self.search(&seed, &wanted, pose.is_some(), &under)?;
            let moved = from(&self.approach, &command)?;
            let settled = moved.directions() == from_side.directions();
            from_side = moved;
            found = Some((done, command, elsewhere));
            if settled {
                break;
            }
        }
        let (done, mut command, mut elsewhere) = found.ok_or(ModelError::ForeignWork)?;
        self.uncorrected = from(&self.uncorrected, &seed)?;
        let sides = self.uncorrected.clone();
        let before = self.error(&seed, &wanted, (sides.directions(), temperature_c))?;
        let sides = from_side.directions();
        let mut after = self.error(&command, &wanted, (sides, temperature_c))?;
        let mut outcome = done.outcome;
        let reached = matches!(outcome, Outcome::Reached | Outcome::OutOfScope(_));
        if reached && self.weighed(after) > THERE {
            // Between the two sides of a joint.
            outcome = match self.weighed(after) < self.weighed(before) {
                true => Outcome::Nearer,
                false => Outcome::NotReached,
            };
        }
        if !outcome.is_usable() {
            command.copy_from_slice(&seed);
            elsewhere = false;
            from_side = from(&self.approach, &seed)?;
            after = self.error(&seed, &wanted, (from_side.directions(), temperature_c))?;
        }
        self.approach = from_side;
        self.last.copy_from_slice(&command);
        let outside = match model.scope(&command)? {
            Scope::Inside => None,
            Scope::Outside(i) | Scope::BeyondLimits(i) => Some(i),
        };
        Ok(Command {
            q: command,
            outcome,
            outside,
            elsewhere,
            before,
            after,
        })
    }

    /// How well the model knows where the tool stands in the root's frame at the command of the last row.
    pub(crate) fn sigma(
        &mut self,
        q: &[f64],
        temperature_c: &[f64],
    ) -> Result<Matrix6<f64>, ModelError> {
        let under = Under {
            approach: self.approach.directions(),
            held: None,
            temperature_c,
        };
        self.model.sigma(q, self.tool, &under, &mut self.work)
    }

    /// The command from these sides, and whether it is by another posture.
    fn search(
        &mut self,
        seed: &[f64],
        wanted: &Pose,
        is_pose: bool,
        under: &Under,
    ) -> Result<(Correction, Vec<f64>, bool), ModelError> {
        let model = self.model;
        let with = self.options.within(match is_pose {
            true => Options::inverse(),
            false => Options::default(),
        });
        let mut command = seed.to_vec();
        let out = (&mut self.work, &mut command[..]);
        let mut done = model.ik(wanted, seed, self.tool, &with, under, out)?;
        // Who states how far a joint may go wants no other posture.
        let stated = self.options.largest_rad.is_some() || self.options.largest_m.is_some();
        if !is_pose || !self.without_joints || stated || is_there(&done) {
            return Ok((done, command, false));
        }
        let known = match self.starts.take() {
            Some(known) => known,
            None => Starts::of(model, self.tool, &mut self.work)?,
        };
        let near = known.near(wanted, with.aim);
        let from = |start: &[f64], other: &mut [f64]| {
            model.ik(
                wanted,
                start,
                self.tool,
                &with,
                under,
                (&mut self.work, other),
            )
        };
        let elsewhere = nearest(&near, from, (&mut done, &mut command))?;
        self.starts = Some(known);
        // From none of them the tool came there: where it ended says nothing of the pose.
        if matches!(done.outcome, Outcome::Nearer) && is_elsewhere(&done) {
            command.copy_from_slice(seed);
            done.outcome = Outcome::NotReached;
        }
        Ok((done, command, elsewhere))
    }

    /// How far the tool is from its pose at a command, m and rad.
    fn error(
        &mut self,
        q: &[f64],
        wanted: &Pose,
        (approach, temperature_c): (&[f64], &[f64]),
    ) -> Result<(f64, f64), ModelError> {
        let under = Under {
            approach,
            held: None,
            temperature_c,
        };
        self.model.forward(q, &under, &mut self.work)?;
        let at = self.model.root_from(self.tool, &self.work)?;
        let apart = at.isometry().inverse() * wanted.isometry();
        Ok((apart.translation.vector.norm(), apart.rotation.angle()))
    }

    /// As far as it counts, m.
    fn weighed(&self, (at, turned): (f64, f64)) -> f64 {
        match self.options.position_only {
            true => at,
            false => at + LEVER * turned,
        }
    }
}

fn is_there(done: &Correction) -> bool {
    matches!(done.outcome, Outcome::Reached | Outcome::OutOfScope(_))
}

/// Replaces the command by the one that ends nearest to the pose, from these starts; whether it did and the tool is there, or nearly.
fn nearest<F>(
    starts: &[&[f64]],
    mut from: F,
    (done, command): (&mut Correction, &mut Vec<f64>),
) -> Result<bool, ModelError>
where
    F: FnMut(&[f64], &mut [f64]) -> Result<Correction, ModelError>,
{
    let mut other = command.clone();
    let mut replaced = false;
    for start in starts {
        let tried = from(start, &mut other)?;
        // A pose that the real robot just misses, its arm stretched, is reached from nowhere: the nearest counts.
        let nearer = tried.outcome == Outcome::Nearer && away(&tried) < away(done);
        if is_there(&tried) || nearer {
            command.copy_from_slice(&other);
            replaced = true;
            *done = tried;
        }
        if is_there(done) {
            break;
        }
    }
    Ok(replaced && !is_elsewhere(done))
}

/// How far the tool is from its pose, m: a rotation by 1 rad counts as by [`LEVER`].
fn away(done: &Correction) -> f64 {
    done.after_m + LEVER * done.after_rad
}

fn is_elsewhere(done: &Correction) -> bool {
    done.after_m > NEAR.0 || done.after_rad > NEAR.1
}
