//! How certain a predicted pose is: equation (4) of the crate.
//!
//! ```text
//! ∂pose/∂origin_i = Ad(root_from_place⁻¹ root_from_joint_i)      ∂pose/∂c_t = s_i F_t  or  w_it F_t                      (1)
//! ∂load_i/∂h_k = R_k e × g,   through ∂F/∂load                   ∂pose/∂mount = 1,   ∂pose/∂point = [0; e]             (2)
//! ```
//!
//! The covariance is of the robot's numbers alone: neither the noise of a measurement nor how well a posture repeats is in it.

use nalgebra::{Matrix6, Vector3, Vector6};

use crate::effect::{JointState, Source};
use crate::error::ModelError;
use crate::forward::{Under, Work};
use crate::jacobian::Across;
use crate::model::{LinkId, Model, Number, Place};
use crate::motion::translation_twist;
use crate::pose::Pose;

/// In which frame a pose is predicted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum From {
    Root,
    Tracker,
}

impl Model {
    /// Covariance of `root_from_place` at `q`: `[ω; v]` in the place's frame (rad, m).
    ///
    /// # Errors
    /// As [`Model::forward`], and [`ModelError::NoUncertainty`].
    pub fn sigma(
        &self,
        q: &[f64],
        place: Place,
        under: &Under,
        work: &mut Work,
    ) -> Result<Matrix6<f64>, ModelError> {
        self.covariance(q, place, under, work, From::Root)
    }

    /// The same of `tracker_from_place`: where the root stands in the tracker counts too.
    ///
    /// # Errors
    /// As [`Model::sigma`].
    pub fn sigma_in_tracker(
        &self,
        q: &[f64],
        place: Place,
        under: &Under,
        work: &mut Work,
    ) -> Result<Matrix6<f64>, ModelError> {
        self.covariance(q, place, under, work, From::Tracker)
    }

    fn covariance(
        &self,
        q: &[f64],
        place: Place,
        under: &Under,
        work: &mut Work,
        from: From,
    ) -> Result<Matrix6<f64>, ModelError> {
        if self.columns == 0 {
            return Err(ModelError::NoUncertainty);
        }
        self.forward(q, under, work)?;
        let (link, offset) = self.fixed(place).ok_or(ModelError::ForeignWork)?;
        self.find_yields(LinkId(link), q, work);
        work.spread.fill(Vector6::zeros());
        let at = work.at[link].then(&offset);
        for (n, number) in self.numbers.iter().enumerate() {
            let Some(twist) = self.twist(*number, (link, &offset, &at), place, q, (work, from))
            else {
                continue;
            };
            let row = &self.root[n * self.columns..(n + 1) * self.columns];
            for (sum, r) in work.spread.iter_mut().zip(row) {
                *sum += twist * *r;
            }
        }
        let mut covariance = Matrix6::zeros();
        for column in &work.spread {
            covariance.ger(1.0, column, column, 1.0);
        }
        Ok(covariance)
    }

    /// How φ and θ of the joints that lead to a link follow their loads.
    fn find_yields(&self, link: LinkId, q: &[f64], work: &mut Work) {
        /// N m or N. Regressors are linear in the load but for its sign.
        const STEP: f64 = 1e-3;
        if !self.loaded {
            return;
        }
        for &i in &self.chains[link.0] {
            let mut yields = (0.0, [0.0; 2]);
            let by_load = |source| matches!(source, Source::Load | Source::Friction);
            let terms = self.joints[i].terms.iter();
            for t in terms.filter(|t| !t.jumps && by_load(t.term.source)) {
                let state = work.state[i];
                let moved = |by: f64| match t.across {
                    None => JointState {
                        torque: state.torque + by,
                        ..state
                    },
                    Some((k, _)) => {
                        let mut across = state.across;
                        across[k] += by;
                        JointState { across, ..state }
                    }
                };
                let f = |by: f64| self.regressor(t, &moved(by), q);
                let slope = t.value * (f(STEP) - f(-STEP)) / (2.0 * STEP);
                match t.across {
                    None => yields.0 += slope,
                    Some((k, _)) => yields.1[k] += slope,
                }
            }
            work.yields[i] = yields;
        }
    }

    /// Twist of a link where the length before a joint that leads to it grows by this, m in the joint's axes.
    fn along_twist(&self, i: usize, link: LinkId, work: &Work, by: &Vector3<f64>) -> Vector6<f64> {
        let joint = &self.joints[i];
        let root_from_joint = work.at[joint.parent].r * joint.origin.pose.r;
        let moved = work.at[link.0].r.tr_mul(&(root_from_joint * by));
        translation_twist(&moved)
    }

    /// A column of G; `None` where the number moves nothing here.
    fn twist(
        &self,
        number: Number,
        (link, offset, at): (usize, &Pose, &Pose),
        place: Place,
        q: &[f64],
        (work, from): (&Work, From),
    ) -> Option<Vector6<f64>> {
        let chain = &self.chains[link];
        let id = LinkId(link);
        match number {
            Number::Tracker(k) => (from == From::Tracker).then(|| at.pull_back(&axis(k))),
            Number::Origin(i, k) => chain.contains(&i).then(|| {
                let joint = &self.joints[i];
                let root_from_joint = work.at[joint.parent].then(&joint.origin.pose);
                let joint_from_place = root_from_joint.inverse().then(at);
                joint_from_place.pull_back(&axis(k))
            }),
            Number::Coefficient(i, t) => {
                let term = &self.joints[i].terms[t];
                chain.contains(&i).then_some(())?;
                let f = self.regressor(term, &work.state[i], q);
                let twist = match (term.across, term.along) {
                    (None, None) => self.about_twist(i, id, work)? * f,
                    (Some((_, e)), _) => Across::of(i, id, work).twist(&(e * f)),
                    (None, Some(reach)) => self.along_twist(i, id, work, &(reach * f)),
                };
                Some(offset.pull_back(&twist))
            }
            Number::Mount(body, k) => (place == Place::Body(body)).then(|| axis(k)),
            Number::Point(point, k) => (place == Place::Point(point)).then(|| axis(3 + k)),
            Number::Moment(of, k) => {
                if !self.loaded || of == 0 {
                    return None;
                }
                // Equation (2): along the joints that carry the link and lead to the place.
                let along = work.nominal[of].r * Vector3::ith(k, 1.0);
                let torque = along.cross(&self.gravity);
                let mut sum = Vector6::zeros();
                for &i in chain.iter().filter(|i| self.chains[of].contains(i)) {
                    let (load, across) = self.about(i, &torque, &Vector3::zeros(), work);
                    let (about, lateral) = work.yields[i];
                    if about != 0.0 {
                        sum += self.about_twist(i, id, work)? * (about * load);
                    }
                    if lateral != [0.0; 2] {
                        let e = &self.joints[i].across;
                        let change =
                            e[0] * (lateral[0] * across[0]) + e[1] * (lateral[1] * across[1]);
                        sum += Across::of(i, id, work).twist(&change);
                    }
                }
                Some(offset.pull_back(&sum))
            }
            Number::Unused => None,
        }
    }
}

/// Unit twist.
fn axis(k: usize) -> Vector6<f64> {
    Vector6::ith(k, 1.0)
}
