//! What either method finds.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Matrix6, Point3};

use crate::estimate::start::Start;
use crate::formulate::formulation::MlFit;
use crate::formulate::found::Found;
use crate::formulate::kinematics::Calibration;
use crate::prepare::inputs::Inputs;

/// What either method hands on.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The calibrated robot.
    pub robot: Calibration,
    /// The robot whose forward kinematics the loops are closed with.
    pub fk: Calibration,
    /// The robot at its zero configuration, with tracker and bodies fitted; `None` with the paper's method.
    pub registered: Option<Calibration>,
    /// The fit that it comes from.
    pub registration: Option<MlFit>,
    /// Transforms found.
    pub found: Vec<Found>,
    /// Covariance of where the robot stands.
    pub root_covariance: Option<Matrix6<f64>>,
    /// The fit, with `method: ml`.
    pub fit: Option<MlFit>,
}

impl Solved {
    /// Where each origin of the profile stands on its body.
    #[must_use]
    pub fn body_from_origin(&self) -> BTreeMap<String, Isometry3<f64>> {
        let placed = self.found.iter();
        placed
            .filter_map(|f| Some((f.origin.clone()?, f.pose)))
            .collect()
    }
}

/// The robot as in the nominal URDF, with the bodies placed by closed forms.
#[must_use]
pub fn nominal(inputs: &Inputs, start: &Start) -> Calibration {
    let mut robot = Calibration::nominal(
        &inputs.robot.model,
        &inputs.robot.profile.load,
        start.tracker_from_root,
    );
    robot.mounts = start.mounts.clone();
    robot.points = start.points.clone();
    let profile = &inputs.robot.profile;
    let tips = profile.points.iter();
    robot.contact_points = tips.map(|(name, tip)| (name.clone(), tip.at)).collect();
    let contacts = profile.contacts.iter();
    robot.spots = stated_spots(inputs);
    robot.places = contacts
        .map(|(name, contact)| (name.clone(), contact.base_from_place))
        .collect();
    robot
}

/// The spots of touched things where the profile states them, m, by contact and spot.
pub(crate) fn stated_spots(inputs: &Inputs) -> BTreeMap<String, BTreeMap<String, Point3<f64>>> {
    let contacts = inputs.robot.profile.contacts.iter();
    let stated = contacts.filter_map(|(name, c)| Some((name.clone(), c.spots()?.at.clone())));
    stated.collect()
}
