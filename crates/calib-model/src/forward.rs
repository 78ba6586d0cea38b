//! Loads, joint motions and poses: equations (1) to (3) of the crate.

use calib_geometry::so3;
use nalgebra::{Matrix3, Vector3};

use crate::axis::Axis;
use crate::effect::flank_backlash::flank;
use crate::effect::{HARMONICS, JointState, OF_STATE, SinCos};
use crate::error::ModelError;
use crate::model::{JointTerm, LinkId, Model, Place};
use crate::pose::Pose;

/// What readings alone do not say. The default: every joint in the middle of its backlash, loaded by gravity.
#[derive(Debug, Clone, Copy, Default)]
pub struct Under<'a> {
    /// Direction of approach by joint: +1 from below, −1 from above, 0 not known; empty: none is known
    /// ([`Approach::directions`](crate::Approach::directions)).
    pub approach: &'a [f64],
    /// Torques (N m) or forces (N) that the joints hold about (along) their axes, as sensors in them read; `None`: gravity loads them.
    pub held: Option<&'a [f64]>,
    /// Temperature of the link before each joint, °C; empty: that at which the model's lengths hold
    /// ([`Model::reference_temperature_c`]).
    pub temperature_c: &'a [f64],
}

/// Working memory of one thread, made by [`Model::work`]. It holds the result of the last call.
#[derive(Debug, Clone)]
pub struct Work {
    /// `root_from_link` by link.
    pub(crate) at: Vec<Pose>,
    /// The same of the nominal geometry.
    pub(crate) nominal: Vec<Pose>,
    /// First moment of everything that hangs on a link, in the root's frame.
    pub(crate) moment: Vec<Vector3<f64>>,
    pub(crate) state: Vec<JointState>,
    /// Sine and cosine of readings.
    pub(crate) reading: Vec<SinCos>,
    /// φ and θ of each joint.
    pub(crate) phi: Vec<f64>,
    pub(crate) theta: Vec<Vector3<f64>>,
    /// Positions that are tried.
    pub(crate) q: Vec<f64>,
    /// Positions that a caller of the C border gave.
    pub(crate) caller: Vec<f64>,
    /// ∂φ/∂q by joint and entry of q, ∂θ/∂q the same.
    pub(crate) phi_slope: Vec<f64>,
    pub(crate) theta_slope: Vec<Vector3<f64>>,
    /// Jacobian, 6 × entries of q by columns.
    pub(crate) jacobian: Vec<nalgebra::Vector6<f64>>,
    /// G R, 6 × columns by columns.
    pub(crate) spread: Vec<nalgebra::Vector6<f64>>,
    /// What one unit of load about each joint adds: ∂φ/∂load, ∂θ/∂loads across.
    pub(crate) yields: Vec<(f64, [f64; 2])>,
}

impl Work {
    pub(crate) fn of(model: &Model) -> Self {
        let (n, dof) = (model.joints.len(), model.moved.len());
        Self {
            at: vec![Pose::identity(); n + 1],
            nominal: vec![Pose::identity(); n + 1],
            moment: vec![Vector3::zeros(); n + 1],
            state: vec![JointState::default(); n],
            reading: vec![ZERO; n],
            phi: vec![0.0; n],
            theta: vec![Vector3::zeros(); n],
            q: vec![0.0; dof],
            caller: vec![0.0; dof],
            phi_slope: vec![0.0; n * dof],
            theta_slope: vec![Vector3::zeros(); n * dof],
            jacobian: vec![nalgebra::Vector6::zeros(); dof],
            spread: vec![nalgebra::Vector6::zeros(); model.columns],
            yields: vec![(0.0, [0.0; 2]); n],
        }
    }

    /// `root_from_link` of the last posture.
    #[must_use]
    pub fn root_from_link(&self, link: LinkId) -> Pose {
        self.at.get(link.0).copied().unwrap_or_else(Pose::identity)
    }
}

impl Model {
    /// Working memory for one thread.
    #[must_use]
    pub fn work(&self) -> Work {
        Work::of(self)
    }

    /// Poses of all links at `q` (rad or m, as [`Model::joints`]): read them with [`Work::root_from_link`] or [`Model::root_from`].
    ///
    /// # Errors
    /// [`ModelError::Length`], [`ModelError::NotFinite`], [`ModelError::ForeignWork`].
    pub fn forward(&self, q: &[f64], under: &Under, work: &mut Work) -> Result<(), ModelError> {
        self.ready(q, under, work)?;
        self.motions(q, under, work);
        self.poses(work);
        Ok(())
    }

    /// The same for `rows` postures, one after the other in `q`; `root_from_place` of each into `out`, 12 numbers by rows: R | t.
    ///
    /// # Errors
    /// As [`Model::forward`], and [`ModelError::Length`] of `out`.
    pub fn forward_many(
        &self,
        q: &[f64],
        place: Place,
        under: &Under,
        work: &mut Work,
        out: &mut [f64],
    ) -> Result<(), ModelError> {
        let dof = self.moved.len().max(1);
        let rows = q.len() / dof;
        for (what, found, expected) in [("q", q.len(), rows * dof), ("out", out.len(), 12 * rows)] {
            if found != expected {
                return Err(ModelError::Length {
                    what,
                    found,
                    expected,
                });
            }
        }
        for (q, out) in q.chunks_exact(dof).zip(out.chunks_exact_mut(12)) {
            self.forward(q, under, work)?;
            let pose = self.root_from(place, work)?;
            out.copy_from_slice(&pose.rows());
        }
        Ok(())
    }

    /// `root_from_place` of the last posture.
    ///
    /// # Errors
    /// [`ModelError::ForeignWork`] where the place is not of this model.
    pub fn root_from(&self, place: Place, work: &Work) -> Result<Pose, ModelError> {
        let (link, offset) = self.fixed(place).ok_or(ModelError::ForeignWork)?;
        let at = work.at.get(link).ok_or(ModelError::ForeignWork)?;
        Ok(at.then(&offset))
    }

    /// `tracker_from_place` of the last posture.
    ///
    /// # Errors
    /// As [`Model::root_from`].
    pub fn tracker_from(&self, place: Place, work: &Work) -> Result<Pose, ModelError> {
        Ok(self.tracker_from_root.then(&self.root_from(place, work)?))
    }

    /// Poses of all links by the nominal model: what a controller without calibration believes.
    ///
    /// # Errors
    /// As [`Model::forward`].
    pub fn forward_nominal(&self, q: &[f64], work: &mut Work) -> Result<(), ModelError> {
        self.ready(q, &Under::default(), work)?;
        self.nominal_poses(q, work);
        work.at.copy_from_slice(&work.nominal);
        Ok(())
    }

    /// Whether arguments fit the model.
    pub(crate) fn ready(&self, q: &[f64], under: &Under, work: &Work) -> Result<(), ModelError> {
        self.checked("q", q)?;
        if let Some(held) = under.held {
            self.checked("held", held)?;
        }
        if !under.approach.is_empty() {
            self.checked("approach", under.approach)?;
        }
        if !under.temperature_c.is_empty() {
            self.checked("temperature", under.temperature_c)?;
        }
        let same = work.at.len() == self.links.len()
            && work.q.len() == self.moved.len()
            && work.spread.len() == self.columns;
        same.then_some(()).ok_or(ModelError::ForeignWork)
    }

    /// Equations (1) and (2): states, φ and θ of all joints.
    pub(crate) fn motions(&self, q: &[f64], under: &Under, work: &mut Work) {
        self.motions_with::<true>((q, 0), under, work);
    }

    /// The same without the terms that jump; the nominal poses before the joint `from` are as they were.
    pub(crate) fn smooth_motions(&self, q: &[f64], from: usize, under: &Under, work: &mut Work) {
        self.motions_with::<false>((q, from), under, work);
    }

    #[inline]
    fn motions_with<const JUMPS: bool>(
        &self,
        (q, from): (&[f64], usize),
        under: &Under,
        work: &mut Work,
    ) {
        if self.loaded {
            self.nominal_poses_from(from, q, work);
            self.moments(work);
        }
        for (i, joint) in self.joints.iter().enumerate() {
            if joint.axis.is_none() {
                continue;
            }
            let state = self.state(i, q, under, work);
            let (mut phi, mut theta) = (state.q, Vector3::zeros());
            if joint.turns || joint.geared {
                let reading = match self.loaded {
                    true => work.reading[i],
                    false => SinCos::of(state.q),
                };
                let motor = match joint.geared {
                    true => SinCos::of(state.motor),
                    false => ZERO,
                };
                for (kind, c) in HARMONICS.iter().zip(&joint.harmonics) {
                    phi += c * kind.of_angles(&reading, &motor).unwrap_or(0.0);
                }
            }
            for (kind, c) in OF_STATE.iter().zip(&joint.of_state) {
                phi += c * kind.of_state(&state).unwrap_or(0.0);
            }
            for (other, c) in &joint.couplings {
                phi += c * self.reading(*other, q);
            }
            if joint.yields {
                let tilt = |k: usize| joint.across[k] * (joint.lateral[k] * state.across[k]);
                theta = tilt(0) + tilt(1);
            }
            if JUMPS && joint.flank != 0.0 {
                phi += joint.flank * flank(&state);
            }
            for t in &joint.direct {
                let amount = t.value * self.regressor(t, &state, q);
                match t.across {
                    None => phi += amount,
                    Some((_, axis)) => theta += axis * amount,
                }
            }
            work.state[i] = state;
            work.phi[i] = phi;
            work.theta[i] = theta;
        }
    }

    /// F of a term.
    pub(crate) fn regressor(&self, t: &JointTerm, s: &JointState, q: &[f64]) -> f64 {
        match t.other {
            None => t.term.regressor.at(s),
            Some(other) => {
                let state = JointState {
                    other: self.reading(other, q),
                    ..JointState::default()
                };
                t.term.regressor.at(&state)
            }
        }
    }

    /// Of a joint, rad or m.
    #[inline]
    fn reading(&self, i: usize, q: &[f64]) -> f64 {
        let joint = &self.joints[i];
        joint.multiplier * q[joint.source] + joint.offset
    }

    /// What the effects of a joint depend on; loads from the moments of the nominal posture.
    fn state(&self, i: usize, q: &[f64], under: &Under, work: &Work) -> JointState {
        let joint = &self.joints[i];
        let reading = self.reading(i, q);
        let mut state = JointState {
            q: reading,
            motor: joint.gear_ratio * reading,
            friction: joint.friction,
            ..JointState::default()
        };
        if joint.terms.is_empty() {
            return state;
        }
        if joint.grows && !under.temperature_c.is_empty() {
            state.warmth = under.temperature_c[joint.source] - self.reference_temperature;
        }
        if joint.own && !under.approach.is_empty() {
            state.approach = under.approach[joint.source];
        }
        if self.loaded {
            let (torque, force) = self.load(i, work);
            (state.torque, state.across) = self.about(i, &torque, &force, work);
        }
        if let Some(held) = under.held {
            state.torque = if joint.own { -held[joint.source] } else { 0.0 };
        }
        state
    }

    /// Torque about the origin of a joint's child, and force, of gravity on everything that it carries; N m and N, root's axes.
    fn load(&self, i: usize, work: &Work) -> (Vector3<f64>, Vector3<f64>) {
        let mass = self.joints[i].carried;
        let moment = work.moment[i + 1] - work.nominal[i + 1].t * mass;
        (moment.cross(&self.gravity), self.gravity * mass)
    }

    /// Components of a load about (along) the axis of a joint and about the axes across, which turn with it.
    pub(crate) fn about(
        &self,
        i: usize,
        torque: &Vector3<f64>,
        force: &Vector3<f64>,
        work: &Work,
    ) -> (f64, [f64; 2]) {
        let joint = &self.joints[i];
        // The motion leaves the axis where it is.
        let r = &work.nominal[i + 1].r;
        match joint.axis {
            None => (0.0, [0.0; 2]),
            Some(Axis::Prismatic(a)) => ((r * a.into_inner()).dot(force), [0.0; 2]),
            Some(Axis::Revolute(a)) => {
                let axis = r * a.into_inner();
                // e · Rᵀ torque
                let across = match joint.yields {
                    true => {
                        let torque = r.tr_mul(torque);
                        joint.across.map(|e| e.dot(&torque))
                    }
                    false => [0.0; 2],
                };
                (axis.dot(torque), across)
            }
        }
    }

    /// Equation (3) of the nominal geometry, without effects.
    pub(crate) fn nominal_poses(&self, q: &[f64], work: &mut Work) {
        self.nominal_poses_from(0, q, work);
    }

    /// The same of this joint and those after it: the ones before it are as they were.
    fn nominal_poses_from(&self, from: usize, q: &[f64], work: &mut Work) {
        for (i, joint) in self.joints.iter().enumerate().skip(from) {
            let mut by = 0.0;
            if joint.axis.is_some() {
                by = self.reading(i, q);
                work.reading[i] = match joint.axis {
                    Some(Axis::Revolute(_)) => SinCos::of(by),
                    _ => ZERO,
                };
            }
            let local = joint.nominal.moved(joint.axis, by, &work.reading[i]);
            work.nominal[i + 1] = then(&work.nominal[joint.parent], &local);
        }
    }

    /// First moments of everything that hangs on each link.
    fn moments(&self, work: &mut Work) {
        work.moment[0] = Vector3::zeros();
        for (i, joint) in self.joints.iter().enumerate() {
            let at = &work.nominal[i + 1];
            work.moment[i + 1] = at.r * joint.moment + at.t * joint.mass;
        }
        for (i, joint) in self.joints.iter().enumerate().rev() {
            let below = work.moment[i + 1];
            work.moment[joint.parent] += below;
        }
    }

    /// Equation (3).
    pub(crate) fn poses(&self, work: &mut Work) {
        for (i, joint) in self.joints.iter().enumerate() {
            let phi = work.phi[i];
            let turned = match joint.axis {
                Some(Axis::Revolute(_)) if self.loaded => {
                    turned_on(&work.reading[i], phi - work.state[i].q, phi)
                }
                Some(Axis::Revolute(_)) => SinCos::of(phi),
                _ => ZERO,
            };
            let mut local = joint.origin.moved(joint.axis, phi, &turned);
            if joint.yields {
                local.r = product(&local.r, &swing(&work.theta[i]));
            }
            if joint.grows {
                local.t += joint.origin.pose.r * (joint.growth * work.state[i].warmth);
            }
            work.at[i + 1] = then(&work.at[joint.parent], &local);
        }
    }
}

/// Sine and cosine of φ = q + δ from those of q. Effects are small: the series are exact to rounding there.
///
/// ```text
/// sin δ = δ − δ³/6 + δ⁵/120,   cos δ = 1 − δ²/2 + δ⁴/24 − δ⁶/720
/// ```
#[inline]
fn turned_on(reading: &SinCos, delta: f64, phi: f64) -> SinCos {
    /// rad: the next term of the sine is δ⁷/5040.
    const SMALL: f64 = 0.02;
    if delta.abs() > SMALL {
        return SinCos::of(phi);
    }
    let square = delta * delta;
    let sin = delta * (1.0 - square * (1.0 / 6.0 - square / 120.0));
    let cos = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square / 720.0));
    SinCos {
        sin: reading.sin * cos + reading.cos * sin,
        cos: reading.cos * cos - reading.sin * sin,
    }
}

/// a b, written out: nalgebra's general product takes twice as long.
#[inline(always)]
fn product(a: &Matrix3<f64>, b: &Matrix3<f64>) -> Matrix3<f64> {
    let (a, b) = (&a.data.0, &b.data.0);
    let column = |j: usize| {
        let b = &b[j];
        let entry = |i: usize| a[0][i] * b[0] + a[1][i] * b[1] + a[2][i] * b[2];
        [entry(0), entry(1), entry(2)]
    };
    Matrix3::from_data(nalgebra::ArrayStorage([column(0), column(1), column(2)]))
}

/// `a_from_c`.
#[inline(always)]
fn then(a: &Pose, b: &Pose) -> Pose {
    let (r, t) = (&a.r.data.0, &b.t);
    let entry = |i: usize| a.t[i] + (r[0][i] * t.x + r[1][i] * t.y + r[2][i] * t.z);
    Pose {
        r: product(&a.r, &b.r),
        t: Vector3::new(entry(0), entry(1), entry(2)),
    }
}

/// Of an angle of 0.
const ZERO: SinCos = SinCos { sin: 0.0, cos: 1.0 };

/// Exp(θ). What yields, yields by millirad: its series is exact to rounding there.
///
/// ```text
/// Exp(θ) = 1 + a [θ]ₓ + b [θ]ₓ²,   a = 1 − t²/6 + t⁴/120,   b = 1/2 − t²/24 + t⁴/720,   t = |θ|
/// ```
#[inline]
fn swing(theta: &Vector3<f64>) -> Matrix3<f64> {
    /// rad²: the next term of a is t⁶/5040.
    const SMALL: f64 = 1e-4;
    let square = theta.norm_squared();
    if square > SMALL {
        return *so3::exp(theta).to_rotation_matrix().matrix();
    }
    let a = 1.0 - square * (1.0 / 6.0 - square / 120.0);
    let b = 0.5 - square * (1.0 / 24.0 - square / 720.0);
    let (x, y, z) = (theta.x, theta.y, theta.z);
    Matrix3::new(
        1.0 - b * (y * y + z * z),
        b * x * y - a * z,
        b * x * z + a * y,
        b * x * y + a * z,
        1.0 - b * (x * x + z * z),
        b * y * z - a * x,
        b * x * z - a * y,
        b * y * z + a * x,
        1.0 - b * (x * x + y * y),
    )
}
