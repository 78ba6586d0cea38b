//! One case: a robot, a design, a body and a fault, as the tables and the profile that a user would have.

use std::collections::BTreeMap;

use calib_recording::{JointUnit, Poses};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::design::{Body, Design, Validation, random};
use super::disturbance::Disturbance;
use super::fault::Fault;
use super::robot::{Errors, Robot, Transmission};
use crate::noise::Noise;

/// Tracker noise of each coordinate, m.
pub(crate) const SIGMA: f64 = 3e-4;
/// Orientation noise of a 6-DoF body, rad.
pub(super) const SIGMA_ORIENTATION: f64 = 1e-3;
/// Noise of the joints from pose to pose, rad (0.01°).
pub(super) const SIGMA_JOINT: f64 = 1.75e-4;
/// Postures at which a result is compared with the truth.
const EVALUATED: usize = 24;

/// Which case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Cell {
    /// What is wrong.
    pub fault: Fault,
    /// How the fitted poses were chosen.
    pub design: Design,
    /// How the held-out poses were chosen.
    pub validation: Validation,
    /// What the tracker sees.
    pub body: Body,
    /// How far the nominal robot is off.
    pub errors: Errors,
}

/// A case, drawn.
#[derive(Clone)]
pub(crate) struct Case {
    pub cell: Cell,
    pub robot: Robot,
    pub disturbance: Disturbance,
    pub(super) tracker_from_root: Isometry3<f64>,
    tip_from_body: Isometry3<f64>,
    pub(super) markers: Vec<Point3<f64>>,
    pub(super) readings: Vec<(&'static str, Vec<Vec<f64>>)>,
    evaluated: Vec<Vec<f64>>,
}

/// The last recording, in time.
pub(super) const LAST: &str = "checks";

impl Case {
    /// Case `number` of a cell.
    pub fn draw(cell: Cell, number: u64, noise: &mut Noise) -> Self {
        let robot = Robot::draw(number, cell.errors.sizes(), noise);
        let mut readings = cell.design.readings(&robot, noise);
        if let Some(held_out) = cell.validation.readings(cell.design, &robot, noise) {
            readings.push((LAST, held_out));
        }
        let evaluated = random(&robot, EVALUATED, noise);
        let markers = markers(cell.body.markers(), noise);
        let (side, off) = (
            noise.between(0.0, std::f64::consts::TAU),
            noise.between(0.05, 0.12),
        );
        let mount = Translation3::new(
            off * side.cos(),
            off * side.sin(),
            noise.between(0.05, 0.15),
        );
        let tip_from_body = Isometry3::from_parts(mount, noise.turn(2.0));
        let tracker_from_root = Isometry3::from_parts(noise.vector(1.5).into(), noise.turn(2.0));
        let disturbance = Disturbance::draw(cell.fault, cell.design, &robot, noise);
        Self {
            cell,
            robot,
            disturbance,
            tracker_from_root,
            tip_from_body,
            markers,
            readings,
            evaluated,
        }
    }

    pub(super) fn has(&self, fault: Fault) -> bool {
        self.disturbance.faults.contains(&fault)
    }

    /// Whether the held-out rows take part, and the recordings by name, in time's order.
    pub fn tables(&self, noise: &mut Noise) -> BTreeMap<String, Poses> {
        let mut tables = BTreeMap::new();
        let total: usize = self.readings.iter().map(|(_, rows)| rows.len()).sum();
        let mut before = 0;
        for (name, rows) in &self.readings {
            let first = before == 0;
            let seen: Vec<Seen> = self.seen(name, rows, (before, total), first, noise);
            before += rows.len();
            tables.insert(
                (*name).to_owned(),
                self.written(name, rows, &seen, Some(noise)),
            );
        }
        if self.has(Fault::HeldOutCopies)
            && let Some(first) = self.readings.first().map(|(name, _)| tables[*name].clone())
        {
            let mut copy = first;
            for p in copy.markers.values_mut().flatten().flatten() {
                p.coords += noise.vector(1e-6);
            }
            tables.insert(LAST.to_owned(), copy);
        }
        tables
    }

    /// What the tracker would see at new readings without noise, as the profile's user would compare it.
    pub fn truth(&self) -> Vec<(Vec<f64>, Seen)> {
        let now = State {
            late: true,
            ..State::default()
        };
        let of = |q: &Vec<f64>| {
            let mut seen = self.ideal(q, &now);
            self.misread(&mut seen, false);
            (self.reported(q, false, true), seen)
        };
        self.evaluated.iter().map(of).collect()
    }

    fn seen(
        &self,
        name: &str,
        rows: &[Vec<f64>],
        (before, total): (usize, usize),
        first: bool,
        noise: &mut Noise,
    ) -> Vec<Seen> {
        let repeats = if self.has(Fault::RepeatedFrames) && name != LAST {
            10
        } else {
            1
        };
        let mut memory = vec![Vector3::zeros(); self.markers.len().max(1)];
        let mut out = Vec::new();
        for (i, q) in rows.iter().enumerate() {
            let state = self.state(name, i, rows.len(), (before, total), first);
            let moving: Vec<f64> = q
                .iter()
                .map(|q| q + SIGMA_JOINT * noise.vector(1.0).x)
                .collect();
            let ideal = self.ideal(&moving, &state);
            for _ in 0..repeats {
                let mut seen = ideal.clone();
                self.disturb(&mut seen, &mut memory, noise);
                self.misread(&mut seen, self.in_one(name));
                out.push(seen);
            }
        }
        out
    }

    /// The row of the first recording from which a change holds.
    pub(super) fn change(&self, rows: usize) -> usize {
        (self.disturbance.from * rows as f64) as usize
    }

    fn state(
        &self,
        name: &str,
        row: usize,
        rows: usize,
        (before, total): (usize, usize),
        first: bool,
    ) -> State {
        State {
            late: !first || row >= self.change(rows),
            last: self.in_one(name),
            share: (before + row) as f64 / total as f64,
        }
    }

    /// The fitted recordings without noise: true readings, and the body as a perfect tracker would see it.
    pub(super) fn perfect(&self) -> Vec<(Vec<f64>, Seen)> {
        let total: usize = self.readings.iter().map(|(_, rows)| rows.len()).sum();
        let mut out = Vec::new();
        let fitted = self.readings.iter().filter(|(name, _)| *name != LAST);
        for (name, rows) in fitted {
            let before = out.len();
            for (i, q) in rows.iter().enumerate() {
                let state = self.state(name, i, rows.len(), (before, total), before == 0);
                out.push((q.clone(), self.ideal(q, &state)));
            }
        }
        out
    }

    /// The same robot, poses and mount with nothing wrong.
    pub(super) fn without_fault(&self) -> Self {
        let mut out = self.clone();
        out.disturbance.faults = vec![Fault::None];
        out.disturbance.transmission = Transmission::default();
        out
    }

    /// The same case with a change that holds from its first row on.
    pub(super) fn changed_from_the_first_row(&self) -> Self {
        let mut out = self.clone();
        out.disturbance.from = 0.0;
        out
    }

    /// The tables that the nominal robot would give without noise, under the fault.
    pub(super) fn twin(&self) -> BTreeMap<String, Poses> {
        let mut nominal = self.clone();
        for joint in &mut nominal.robot.joints {
            joint.actual = joint.nominal;
        }
        let total: usize = self.readings.iter().map(|(_, rows)| rows.len()).sum();
        let mut tables = BTreeMap::new();
        let mut before = 0;
        for (name, rows) in &self.readings {
            let see = |(i, q): (usize, &Vec<f64>)| {
                let state = self.state(name, i, rows.len(), (before, total), before == 0);
                let mut seen = nominal.ideal(q, &state);
                self.misread(&mut seen, self.in_one(name));
                seen
            };
            let seen: Vec<Seen> = rows.iter().enumerate().map(see).collect();
            before += rows.len();
            tables.insert((*name).to_owned(), self.written(name, rows, &seen, None));
        }
        tables
    }

    /// The body as a perfect tracker would see it.
    fn ideal(&self, q: &[f64], state: &State) -> Seen {
        let d = &self.disturbance;
        let mut transmission = d.transmission;
        if self.has(Fault::OffsetStep) && state.late {
            transmission.offset = Some((d.joint, 0.3_f64.to_radians()));
        }
        let bent: Vec<f64> = if self.has(Fault::Compliance) {
            let torque = self.robot.gravity(q);
            let per_nm = 0.02_f64.to_radians();
            let bend = |(j, q): (usize, &f64)| {
                if self.robot.joints[j].prismatic {
                    *q
                } else {
                    q + per_nm * torque[j]
                }
            };
            q.iter().enumerate().map(bend).collect()
        } else {
            q.to_vec()
        };
        let mut tracker = self.tracker_from_root;
        let mut mount = self.tip_from_body;
        if self.has(Fault::Bump) && state.late {
            tracker = d.step * tracker;
        }
        if self.has(Fault::Drift) {
            let share = if state.late && state.share == 0.0 {
                1.0
            } else {
                state.share
            };
            tracker = Translation3::from(d.step.translation.vector * share) * tracker;
        }
        if self.has(Fault::TrackerMoved) && state.last {
            tracker = d.moved * tracker;
        }
        if (self.has(Fault::Slip) || self.has(Fault::SmallSlip)) && state.late {
            mount *= d.step;
        }
        if self.has(Fault::Remounted) && state.last {
            mount *= d.moved;
        }
        let links = self.robot.links(&bent, &transmission);
        let body = tracker * links[self.robot.joints.len()] * mount;
        Seen {
            points: self.markers.iter().map(|m| body * m).collect(),
            body,
        }
    }

    fn disturb(&self, seen: &mut Seen, memory: &mut [Vector3<f64>], noise: &mut Noise) {
        let rho: f64 = if self.has(Fault::Memory) { 0.9 } else { 0.0 };
        let error = |memory: &mut Vector3<f64>, noise: &mut Noise| {
            *memory = *memory * rho + noise.vector(SIGMA * (1.0 - rho * rho).sqrt());
            let gross = self.has(Fault::Outliers) && noise.uniform() < self.disturbance.outliers;
            let jump = if gross {
                noise.direction() * noise.between(0.01, 0.1)
            } else {
                Vector3::zeros()
            };
            *memory + jump
        };
        for (point, memory) in seen.points.iter_mut().zip(memory.iter_mut()) {
            *point += error(memory, noise);
        }
        if seen.points.is_empty() {
            seen.body.translation.vector += error(&mut memory[0], noise);
            seen.body.rotation *= noise.turn(SIGMA_ORIENTATION);
        }
    }

    /// What the file makes of it.
    fn misread(&self, seen: &mut Seen, in_one: bool) {
        if self.has(Fault::Mirrored) {
            for p in &mut seen.points {
                p.y = -p.y;
            }
            let q = seen.body.rotation.quaternion();
            let mirrored = Quaternion::new(q.w, -q.i, q.j, -q.k);
            seen.body.rotation = UnitQuaternion::new_normalize(mirrored);
            seen.body.translation.y = -seen.body.translation.y;
        }
        if self.has(Fault::QuaternionOrder) {
            let q = seen.body.rotation.quaternion();
            seen.body.rotation = UnitQuaternion::new_normalize(Quaternion::new(q.k, q.w, q.i, q.j));
        }
        if self.has(Fault::InversePoses) {
            seen.body = seen.body.inverse();
        }
        if (self.has(Fault::TrackerUnitInOne) && in_one) || self.has(Fault::TrackerUnit) {
            let scale = if self.disturbance.up { 1e3 } else { 1e-3 };
            seen.points.iter_mut().for_each(|p| p.coords *= scale);
            seen.body.translation.vector *= scale;
        }
    }

    /// Whether a fault of one recording holds in this one.
    fn in_one(&self, name: &str) -> bool {
        self.readings.last().is_some_and(|(last, _)| *last == name)
    }

    /// The readings as the file has them; `later`: as the robot will report them in use.
    fn reported(&self, q: &[f64], in_one: bool, later: bool) -> Vec<f64> {
        let d = &self.disturbance;
        let mut q = q.to_vec();
        if self.has(Fault::Sign) || (self.has(Fault::SignInOne) && in_one && !later) {
            q[d.joint] = -q[d.joint];
        }
        if self.has(Fault::Exchange) || (self.has(Fault::ExchangeInOne) && in_one && !later) {
            q.swap(d.joint, d.other);
        }
        if self.has(Fault::JointUnit) {
            q[d.joint] = if d.up {
                q[d.joint].to_degrees()
            } else {
                q[d.joint].to_radians()
            };
        }
        q
    }

    fn written(
        &self,
        name: &str,
        rows: &[Vec<f64>],
        seen: &[Seen],
        mut noise: Option<&mut Noise>,
    ) -> Poses {
        let d = &self.disturbance;
        let repeats = seen.len() / rows.len().max(1);
        let mut q: Vec<Vec<f64>> = rows
            .iter()
            .map(|q| self.reported(q, self.in_one(name), false))
            .collect();
        if self.has(Fault::RowShift) {
            let shifted = |i: usize| {
                i.checked_add_signed(d.lag)
                    .and_then(|k| q.get(k))
                    .unwrap_or(&q[i])
                    .clone()
            };
            q = (0..q.len()).map(shifted).collect();
        }
        let copies = if self.has(Fault::CopiedRows) && name != LAST {
            3
        } else {
            1
        };
        let order: Vec<usize> = (0..seen.len())
            .flat_map(|i| std::iter::repeat_n(i, copies))
            .collect();
        // Copies differ by what a text file rounds.
        let mut round = |p: &Point3<f64>| match &mut noise {
            Some(noise) => p + noise.vector(1e-7),
            None => *p,
        };
        let n = self.robot.joints.len();
        let mut table = Poses {
            rows: (0..order.len() as u64).map(|i| i + 2).collect(),
            ..Poses::default()
        };
        for j in (0..n).filter(|j| !(self.has(Fault::MissingColumn) && *j == d.joint)) {
            let name = format!("j{}", j + 1);
            let unit = if self.robot.joints[j].prismatic {
                JointUnit::Length
            } else {
                JointUnit::Angle
            };
            let column = order.iter().map(|i| Some(q[i / repeats][j])).collect();
            table.joints.insert(name.clone(), column);
            table.joint_units.insert(name, unit);
        }
        for m in 0..self.markers.len() {
            let column = order
                .iter()
                .map(|i| Some(round(&seen[*i].points[m])))
                .collect();
            table.markers.insert(format!("tip_{}", m + 1), column);
        }
        if self.markers.is_empty() {
            let column = order.iter().map(|i| Some(seen[*i].body)).collect();
            table.bodies.insert("tip".to_owned(), column);
        }
        table
    }
}

/// Largest rms error that the profiles of the study accept, mm.
pub(crate) const LIMIT_MM: f64 = 2.0;

/// Markers of a body: three are never mounted on a line.
fn markers(count: usize, noise: &mut Noise) -> Vec<Point3<f64>> {
    /// Least distance of the third marker from the line through the first two, m.
    const OFF_THE_LINE: f64 = 0.005;
    loop {
        let markers: Vec<Point3<f64>> = (0..count)
            .map(|_| {
                Point3::new(
                    noise.between(-0.06, 0.06),
                    noise.between(-0.06, 0.06),
                    noise.between(-0.06, 0.06),
                )
            })
            .collect();
        let on_a_line = match markers[..] {
            [a, b, c, ..] => (b - a).normalize().cross(&(c - a)).norm() < OFF_THE_LINE,
            _ => false,
        };
        if !on_a_line {
            return markers;
        }
    }
}

/// One sample of the body.
#[derive(Debug, Clone)]
pub(crate) struct Seen {
    pub points: Vec<Point3<f64>>,
    pub body: Isometry3<f64>,
}

/// When a sample was taken.
#[derive(Debug, Clone, Copy, Default)]
struct State {
    /// After a change.
    late: bool,
    /// In the last recording.
    last: bool,
    /// Share of all rows before it.
    share: f64,
}

impl Cell {
    /// The cell's name: fault, design, held-out design, body, size of the nominal errors.
    pub(crate) fn id(&self) -> String {
        format!(
            "{:?}/{:?}/{:?}/{:?}/{}",
            self.fault,
            self.design,
            self.validation,
            self.body,
            self.errors.id()
        )
    }
}

impl Case {
    /// The profile names a link before the last.
    pub fn wrong_link(&self) -> bool {
        self.has(Fault::WrongLink)
    }
}
