//! `calib record --plan`: the postures of a plan, and what is chosen again while they are recorded.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use calib_capture::{
    Held, Instead, Outcome, Planner, Progress, Screen, Step, Survey, Table, asked_is_reached,
};
use calib_pipeline::prepare::load::RobotProfile;
use calib_plan::candidates::Candidate;
use calib_plan::follow::{Follow, Next, Reached, options};
use calib_plan::write::PlanFile;
use calib_plan::{Known, Options, PlanError};
use calib_profile::{RecordingSpec, Usage};
use calib_urdf::JointId;

use super::rules::{NEAR, is_continuous};
use super::{Record, RecordError, out_path};
use crate::commands::plan_file::plan_of;
use crate::error::CliError;

/// A plan, and what the profile and the recordings say beside it.
pub(super) struct Planned {
    /// Its file as it was named.
    pub name: String,
    file: PlanFile,
    options: Options,
    known: Known,
    /// Whether the recording validates: then the held-out postures are asked for.
    pub validates: bool,
    /// Joints that the plan moves, in the order of the URDF.
    pub joints: Vec<JointId>,
}

impl Planned {
    /// Reads a plan and what is recorded already, but for the recording that is made.
    pub(super) fn read(
        path: &Path,
        robot: &RobotProfile,
        (recording, spec): (&str, &RecordingSpec),
        asked: &Record,
    ) -> Result<Self, CliError> {
        let name = path.display().to_string();
        let file = plan_of(path, robot)?;
        let recording = recording.to_owned();
        if spec.usage == Usage::Sweep || is_continuous(spec) {
            return Err(RecordError::PlanInSweep { recording }.into());
        }
        let joints = file.joints(&robot.model);
        if let Some(joint) = joints.iter().find(|j| spec.hold.contains_key(j)) {
            let joint = robot.model.joint(*joint).name.clone();
            return Err(RecordError::PlanMovesHeld { recording, joint }.into());
        }
        let mut before = robot.clone();
        // A file that does not exist counts nowhere.
        let own = robot.folder.join(&spec.file).canonicalize().ok();
        if own.is_some() && own == out_path(robot, spec, asked).canonicalize().ok() {
            // It counts as it is recorded, posture by posture.
            before.profile.recordings.remove(&recording);
            for contact in before.profile.contacts.values_mut() {
                contact.recordings.retain(|name| *name != recording);
            }
        }
        let known = Known::of(before, asked.plugins.plugins())?;
        Ok(Self {
            options: options(&file, &known, asked.sigma_mm.map(|mm| mm * 1e-3)),
            validates: spec.usage == Usage::Validation,
            name,
            file,
            known,
            joints,
        })
    }

    /// The same where some bodies and markers are not recorded.
    pub(super) fn without(&self, unrecorded: BTreeSet<String>) -> Self {
        let mut known = self.known.clone();
        known.unrecorded = unrecorded;
        Self {
            name: self.name.clone(),
            file: self.file.clone(),
            options: self.options.clone(),
            known,
            validates: self.validates,
            joints: self.joints.clone(),
        }
    }

    /// The postures, checked against the robot and what is known of it.
    pub(super) fn follow(&self) -> Result<Follow<'_>, PlanError> {
        let (known, options) = (&self.known, &self.options);
        if self.validates {
            return Follow::held_out(known, options, &self.file, &self.name);
        }
        if self.known.unrecorded.is_empty() {
            return Follow::fitted(known, options, &self.file, &self.name);
        }
        // Fewer bodies tell less than the plan says.
        Follow::unchecked(known, options, &self.file, &self.name)
    }

    /// Range of each joint over the postures, rad or m.
    pub(super) fn ranges(&self) -> BTreeMap<JointId, (f64, f64)> {
        let model = &self.known.robot.model;
        let [fitted, held_out] = self.file.positions(model, &model.zero_positions());
        let postures = if self.validates { held_out } else { fitted };
        let of = |joint: &JointId| {
            let at = postures.iter().map(|q| q[joint.index()]);
            let none = (f64::INFINITY, f64::NEG_INFINITY);
            (*joint, at.fold(none, |(a, b), q| (a.min(q), b.max(q))))
        };
        self.joints.iter().map(of).collect()
    }

    /// Says what is asked for and what is known; whether the asked σ is reached already.
    pub(super) fn begins(
        &self,
        guided: &Guided<'_>,
        spec: &RecordingSpec,
        screen: &mut dyn Screen,
    ) -> Result<bool, PlanError> {
        if spec.timing.is_none() {
            screen.line(
                "The file gets a row for each frame: give this recording `timing: {poses: settle}` in the profile, so that each hold counts once.",
            );
        }
        let rest = guided.follow.rest().iter();
        let count = rest.filter(|n| !n.is_on_the_way()).count();
        let what = if self.validates {
            "held-out postures"
        } else {
            "postures"
        };
        screen.line(&format!(
            "{count} {what} of {} to record. Keys, each with Enter: none = the robot is at the posture; n = the next best posture instead (of held-out ones: this one at the end); r = record the last posture again; s = skip the posture; k = count it though a body is hidden; q = stop.",
            self.name
        ));
        if !guided.follow.is_fitted() {
            return Ok(false);
        }
        let reached = guided.follow.reached()?;
        screen.line(&progress(&reached).to_string());
        let asked = guided.follow.is_reached(&reached);
        if let Some(asked) = asked {
            screen.line(&asked_is_reached(asked));
        }
        Ok(asked.is_some())
    }

    /// Where the robot sends joint values, those of the plan must be among them.
    pub(super) fn is_heard(&self, heard: &Survey) -> Result<(), RecordError> {
        let model = &self.known.robot.model;
        let names = self.joints.iter().map(|j| model.joint(*j).name.clone());
        let missing: Vec<String> = names.filter(|n| !heard.joints.contains(n)).collect();
        if heard.joints.is_empty() || missing.is_empty() {
            return Ok(());
        }
        Err(RecordError::PlanJointsNotSent {
            plan: self.name.clone(),
            missing,
            sent: heard.joints.iter().cloned().collect(),
        })
    }
}

/// A plan as the session follows it.
#[derive(Debug)]
pub(super) struct Guided<'a> {
    follow: Follow<'a>,
    /// Joints in the order of the guide.
    joints: Vec<JointId>,
    /// Bodies that they move, in the order of the session.
    moved: Vec<String>,
}

impl<'a> Guided<'a> {
    /// Goes on after the holds that a file has already.
    pub(super) fn new(
        mut follow: Follow<'a>,
        plan: &calib_capture::Plan,
        (planned, table): (&Planned, &Table),
    ) -> Self {
        let model = &planned.known.robot.model;
        let near = |a: &[f64], b: &[f64]| {
            planned.joints.iter().all(|joint| {
                let turns = model.joint(*joint).kind.turns();
                let near = if turns { NEAR.0 } else { NEAR.1 };
                (a[joint.index()] - b[joint.index()]).abs() <= near
            })
        };
        let holds: Vec<Candidate> = table
            .holds
            .iter()
            .map(|held| follow.as_held(&held.joints, &held.seen))
            .collect();
        let exchanged: Vec<Vec<f64>> = table
            .exchanged
            .iter()
            .map(|joints| follow.as_held(joints, &BTreeSet::new()).q)
            .collect();
        follow.resume(holds, &exchanged, &near);
        Self {
            follow,
            joints: planned.joints.clone(),
            moved: plan.moved.iter().map(|body| body.name.clone()).collect(),
        }
    }

    fn step(&self, next: &Next) -> Step {
        let measured = self.follow.measured(next);
        let unseen = self.moved.iter().enumerate();
        let unseen = unseen.filter(|(_, body)| !measured.contains(*body));
        let targets = self.joints.iter().map(|j| next.candidate.q[j.index()]);
        Step {
            targets: targets.collect(),
            through: next.is_on_the_way(),
            blocked: next.blocked,
            unseen: unseen.map(|(place, _)| place).collect(),
        }
    }
}

fn progress(reached: &Reached) -> Progress {
    Progress {
        sigma: reached.sigma,
        expected: reached.expected,
    }
}

impl Planner for Guided<'_> {
    fn rest(&self) -> Vec<Step> {
        self.follow.rest().iter().map(|n| self.step(n)).collect()
    }

    fn held(&mut self, held: Held) -> Outcome {
        let posture = self.follow.as_held(&held.joints, &held.seen);
        let replanned = self.follow.hold(posture);
        // Where the problem cannot be stated, nothing is said of it.
        let reached = self
            .follow
            .reached()
            .ok()
            .filter(|_| self.follow.is_fitted());
        Outcome {
            progress: reached.as_ref().map(progress),
            reached: reached.and_then(|reached| self.follow.is_reached(&reached)),
            replanned,
        }
    }

    fn passed(&mut self) {
        self.follow.pass();
    }

    fn forget(&mut self) {
        self.follow.forget();
    }

    fn skipped(&mut self) {
        self.follow.skip();
    }

    fn offer(&mut self) -> Option<Step> {
        let next = self.follow.offer()?.clone();
        Some(self.step(&next))
    }

    fn instead(&mut self) -> Instead {
        if self.follow.instead() {
            Instead::Exchanged
        } else if self.follow.later() {
            Instead::Later
        } else {
            Instead::Nothing
        }
    }
}
