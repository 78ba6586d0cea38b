//! Recordings and nominal robot as the engine of structural hypotheses takes them.

use std::collections::{BTreeMap, BTreeSet};

use calib_checks::structural::{
    Body, BodyIndex, Chain, Data, JointIndex, LinkIndex, Measured, RecordingIndex, Scope,
};
use calib_finding::Unit;
use calib_profile::{BodyKind, Usage};
use calib_urdf::{JointId, LinkId, RobotModel};
use nalgebra::{Isometry3, Point3};

use crate::prepare::aligned::ClockUnknowns;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

/// Noise of a pose where the profile states none, m and rad: an optical tracker's body of 0.1 m.
const BODY_SIGMA: (f64, f64) = (3e-4, 1e-3);

/// The engine's input, and the names behind its numbers.
#[derive(Debug, Clone)]
pub struct Layout<'a> {
    /// Robot used for names.
    pub inputs: &'a Inputs,
    /// The engine's input.
    pub data: Data,
    /// By recording index: fitted ones first.
    pub recordings: Vec<&'a Loaded>,
    /// By body index.
    pub bodies: Vec<&'a str>,
    /// Row of its recording, for every row of `data`.
    pub rows: Vec<usize>,
}

impl<'a> Layout<'a> {
    /// The fitted recordings, and those of the validation behind them where `validation` asks for it.
    #[must_use]
    pub fn new(
        inputs: &'a Inputs,
        tracks: &'a BTreeMap<String, BodyTrack>,
        chain: &Chain,
        validation: bool,
    ) -> Self {
        let held_out = |r: &&Loaded| r.spec.usage == Usage::Validation;
        let all = || inputs.recordings.values();
        let mut recordings: Vec<&Loaded> = all().filter(|r| !held_out(r)).collect();
        if validation {
            recordings.extend(all().filter(held_out));
        }
        let mut layout = Self {
            inputs,
            data: Data {
                chain: chain.clone(),
                readings: Vec::new(),
                recording: Vec::new(),
                rates: Vec::new(),
                bodies: Vec::new(),
            },
            recordings,
            bodies: Vec::new(),
            rows: Vec::new(),
        };
        layout.add_rows();
        for (name, body) in &inputs.robot.profile.bodies {
            let measured = layout.measured(&body.kind, &tracks[name]);
            layout.data.bodies.extend(measured.map(|measured| Body {
                link: LinkIndex::from(body.link),
                measured,
                mounts: Vec::new(),
            }));
            if layout.data.bodies.len() > layout.bodies.len() {
                layout.bodies.push(name);
            }
        }
        layout
    }

    /// Forgets these bodies, by index.
    pub fn leave_out(&mut self, bodies: &BTreeSet<usize>) {
        for body in bodies.iter().rev() {
            self.data.bodies.remove(*body);
            self.bodies.remove(*body);
        }
    }

    /// Rows with joint values; a joint without a column has none, unless the profile holds it.
    fn add_rows(&mut self) {
        let model = &self.inputs.robot.model;
        for (r, loaded) in self.recordings.iter().enumerate() {
            let mut stated = vec![false; model.joints().len()];
            let recorded = loaded.poses.joints.keys();
            let recorded = recorded.filter_map(|name| model.joint_id(name).ok());
            for joint in recorded.chain(loaded.spec.hold.keys().copied()) {
                stated[joint.index()] = true;
            }
            for (row, q) in loaded.q.iter().enumerate() {
                let Some(q) = q else { continue };
                let readings = q.iter().zip(&stated);
                self.data
                    .readings
                    .push(readings.map(|(q, stated)| stated.then_some(*q)).collect());
                self.data.recording.push(RecordingIndex(r));
                self.data.rates.push(rates(model, loaded, row));
                self.rows.push(row);
            }
        }
    }

    /// Markers where markers were measured, poses otherwise; `None` for a body that no row shows.
    fn measured(&self, kind: &BodyKind, track: &BodyTrack) -> Option<Measured> {
        let places = || self.data.recording.iter().zip(&self.rows);
        match kind {
            BodyKind::Markers { names, .. } if !track.is_computed => {
                let at = |marker: &String, r: &RecordingIndex, row: usize| -> Option<Point3<f64>> {
                    *self.recordings[r.0].poses.markers.get(marker)?.get(row)?
                };
                let points: Vec<Vec<_>> = places()
                    .map(|(r, row)| names.iter().map(|m| at(m, r, *row)).collect())
                    .collect();
                let seen = points.iter().flatten().any(Option::is_some);
                seen.then_some(Measured::Markers(points))
            }
            _ => {
                let poses: Vec<Option<Isometry3<f64>>> = places()
                    .map(|(r, row)| {
                        let name = &self.recordings[r.0].name;
                        *track.in_recording(name).get(*row)?
                    })
                    .collect();
                let tracker = &self.inputs.robot.profile.tracker;
                poses.iter().any(Option::is_some).then(|| Measured::Poses {
                    tracker_from_body: poses,
                    sigma_position: track.position_sigma(tracker).unwrap_or(BODY_SIGMA.0),
                    sigma_orientation: tracker.body_sigma_rad.unwrap_or(BODY_SIGMA.1),
                })
            }
        }
    }

    /// Name of a joint.
    #[must_use]
    pub fn joint(&self, joint: JointIndex) -> &'a str {
        let model = &self.inputs.robot.model;
        let id = model.joint_ids().nth(joint.0);
        id.map_or("", |id: JointId| &model.joint(id).name)
    }

    /// A joint's value in the unit that a profile states it in, and that unit: degrees or millimeters.
    #[must_use]
    pub fn shown(&self, joint: JointIndex, value: f64) -> (f64, &'static str) {
        match self.data.chain.turns(joint.0) {
            Some(false) => (1e3 * value, "mm"),
            _ => (value.to_degrees(), "deg"),
        }
    }

    /// Whether the fit estimates how late the readings of every recording in motion are.
    #[must_use]
    pub fn clocks_are_estimated(&self) -> bool {
        let timed: BTreeSet<RecordingIndex> = {
            let rows = self.data.recording.iter().zip(&self.data.rates);
            let rows = rows.filter(|(_, rates)| rates.is_some());
            rows.map(|(recording, _)| *recording).collect()
        };
        !timed.is_empty()
            && timed
                .iter()
                .all(|recording| self.estimates_clock(*recording))
    }

    /// Whether the fit estimates how late the readings of a recording are.
    #[must_use]
    pub fn estimates_clock(&self, recording: RecordingIndex) -> bool {
        let alignment = self.recordings[recording.0].alignment.as_ref();
        alignment.is_some_and(|a| a.unknowns() != ClockUnknowns::None)
    }

    /// Whether the fit estimates the zero of a joint that the recordings move.
    #[must_use]
    pub fn frees_zero(&self, joint: JointIndex) -> bool {
        self.frees(joint, "offset")
    }

    /// Whether it estimates the gain.
    #[must_use]
    pub fn frees_gain(&self, joint: JointIndex) -> bool {
        self.frees(joint, "gain")
    }

    fn frees(&self, joint: JointIndex, effect: &str) -> bool {
        let model = &self.inputs.robot.model;
        let Some(id) = model.joint_ids().nth(joint.0) else {
            return false;
        };
        let slides = !model.joint(id).kind.turns();
        let own = self.inputs.robot.profile.solve.free_set(id, true, slides);
        own.effects.iter().any(|free| free.effect.id == effect)
    }

    /// Unit of a joint's share in the motion of another: none between two that turn or two that slide.
    #[must_use]
    pub fn unit_of_share(&self, joint: JointIndex, source: JointIndex) -> Unit {
        let turns = |j: JointIndex| self.data.chain.turns(j.0) != Some(false);
        match (turns(joint), turns(source)) {
            (true, false) => Unit::RadianPerMeter,
            (false, true) => Unit::MeterPerRadian,
            _ => Unit::One,
        }
    }

    /// Name of a link.
    #[must_use]
    pub fn link(&self, link: LinkIndex) -> &'a str {
        let model = &self.inputs.robot.model;
        let id = model.link_ids().nth(link.0);
        id.map_or("", |id: LinkId| &model.link(id).name)
    }

    /// Name of a body.
    #[must_use]
    pub fn body(&self, body: BodyIndex) -> &'a str {
        self.bodies[body.0]
    }

    /// Names of the bodies that are measured as poses.
    #[must_use]
    pub fn posed(&self) -> Vec<&'a str> {
        let all = self.bodies.iter().zip(&self.data.bodies);
        all.filter(|(_, body)| matches!(body.measured, Measured::Poses { .. }))
            .map(|(name, _)| *name)
            .collect()
    }

    /// Names of the recordings of a scope.
    #[must_use]
    pub fn recordings_in(&self, scope: Scope) -> Vec<&'a str> {
        let inside = |(r, _): &(usize, &&'a Loaded)| scope.contains(RecordingIndex(*r));
        let all = self.recordings.iter().enumerate();
        all.filter(inside).map(|(_, r)| r.name.as_str()).collect()
    }
}

/// How fast each joint moved in a row; `None` where the rows are poses, or where the speed of a recorded joint is not known.
fn rates(model: &RobotModel, loaded: &Loaded, row: usize) -> Option<Vec<f64>> {
    if loaded.velocities.is_empty() {
        return None;
    }
    let mut rates = vec![0.0; model.joints().len()];
    for (joint, speeds) in &loaded.velocities {
        rates[model.joint_id(joint).ok()?.index()] = speeds.get(row).copied().flatten()?;
    }
    Some(rates)
}
