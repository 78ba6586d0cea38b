//! Robots that the session could be of.
//!
//! ```text
//! found    x ~ N(x̂, C)                        the robot that was found, as far as it is known             (1)
//! prior    x_i ~ N(x₀_i, s_i²)                 where there is a prior; x̂_i elsewhere (mounts, tracker)      (2)
//! ```
//!
//! Coefficients that physics does not allow are mirrored at their limit. Over both, an interval of 95 % that follows from prior and data holds in
//! 95 % of the trials: this is what a twin checks.

use std::collections::BTreeMap;

use calib_core::{Model, Values};
use calib_geometry::decompose;
use calib_pipeline::estimated::Estimated;
use calib_pipeline::formulate::formulation::MlFit;
use calib_pipeline::formulate::kinematics::Calibration;
use calib_pipeline::prepare::inputs::Inputs;
use calib_urdf::{JointId, LinkId};
use nalgebra::{DMatrix, DVector, Isometry3, Point3};
use rand::Rng;
use rand::RngExt;
use rand_distr::StandardNormal;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where true robots are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum About {
    /// About the robot that was found, as far as its parameters are known.
    Found,
    /// From the priors of the profile.
    Prior,
}

/// Draws robots.
#[derive(Debug, Clone)]
pub struct Draws {
    center: Values,
    /// x = center + root z, on the free parameters.
    root: DMatrix<f64>,
    free: Vec<usize>,
    bounds: Vec<Option<(f64, f64)>>,
}

impl Draws {
    /// Equation (1) or (2), from the values and the covariance that a fit found.
    #[must_use]
    pub fn new(model: &Model, found: &Values, covariance: &DMatrix<f64>, about: About) -> Self {
        let free = model.free_parameters().to_vec();
        let parameters = model.problem().parameters();
        let mut center = found.clone();
        let root = match about {
            About::Found => root_of(covariance),
            About::Prior => {
                for &p in &free {
                    if parameters[p].prior_sigma.is_some() {
                        center.0[p] = parameters[p].nominal;
                    }
                }
                let sigmas = free.iter().map(|p| parameters[*p].prior_sigma);
                let sigmas = sigmas.map(|sigma| sigma.unwrap_or(0.0));
                DMatrix::from_diagonal(&DVector::from_iterator(free.len(), sigmas))
            }
        };
        let bounds = free.iter().map(|p| parameters[*p].bounds).collect();
        Self {
            center,
            root,
            free,
            bounds,
        }
    }

    /// One robot's parameters.
    #[must_use]
    pub fn draw(&self, rng: &mut impl Rng) -> Values {
        let normal = |_: usize, _: usize| rng.sample::<f64, _>(StandardNormal);
        let z = DVector::from_fn(self.root.ncols(), normal);
        let moved = &self.root * z;
        let mut values = self.center.clone();
        for ((p, by), bounds) in self.free.iter().zip(moved.iter()).zip(&self.bounds) {
            let at = values.0[*p] + by;
            values.0[*p] = match bounds {
                Some((low, high)) if at < *low => (2.0 * low - at).min(*high),
                Some((low, high)) if at > *high => (2.0 * high - at).max(*low),
                _ => at,
            };
        }
        values
    }
}

/// R with C = R Rᵀ.
fn root_of(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let spectrum = decompose::symmetric_eigen(covariance);
    let mut root = spectrum.vectors;
    for (k, value) in spectrum.values.iter().enumerate() {
        root.column_mut(k).scale_mut(value.max(0.0).sqrt());
    }
    root
}

/// A true robot.
#[derive(Debug, Clone)]
pub struct Truth {
    /// Geometry, effects, mounts, place.
    pub robot: Calibration,
    /// Parameters by name.
    pub values: BTreeMap<String, f64>,
}

impl Truth {
    pub(crate) fn of(own: &Estimated, fit: &MlFit, robot: Calibration, values: &Values) -> Self {
        let parameters = fit.solution.model.problem().parameters().iter();
        let named = parameters.zip(&values.0);
        let mut truth = Self {
            values: named.map(|(p, v)| (p.name.clone(), *v)).collect(),
            robot,
        };
        // Templates that are given are no parameters.
        for (name, track) in &own.checked.tracks {
            if let (Some(template), Some(mount)) = (&track.template, truth.robot.mounts.get(name)) {
                let points = truth.robot.points.entry(name.clone()).or_default();
                for (marker, point) in template.names.iter().zip(&template.points) {
                    points.entry(marker.clone()).or_insert(mount * point);
                }
            }
        }
        truth
    }

    /// A frame as seen from the tracker, joints at zero: a link or a body by its name, else the tracker itself.
    #[must_use]
    pub fn frame(&self, inputs: &Inputs, name: &str) -> Isometry3<f64> {
        let model = self.robot.urdf_model();
        let links = model.forward_kinematics(&model.zero_positions());
        let link = |link: LinkId| self.robot.tracker_from_root * links[link.index()];
        if let Some(body) = inputs.robot.profile.bodies.get(name)
            && let Some(mount) = self.robot.mounts.get(name)
        {
            return link(body.link) * mount;
        }
        match model.link_id(name) {
            Ok(id) => link(id),
            Err(_) => Isometry3::identity(),
        }
    }
}

/// Whether a joint moves a link.
#[must_use]
pub fn is_moved(inputs: &Inputs, link: LinkId) -> bool {
    let model = &inputs.robot.model;
    let moves = |joint: &JointId| model.joint(*joint).kind.axis().is_some();
    model.chain_to_root(link).iter().any(moves)
}

/// Where the origin of a body, or the first marker of one without a frame, is on its link.
#[must_use]
pub fn tracked_point(robot: &Calibration, body: &str, framed: bool) -> Option<Point3<f64>> {
    if framed {
        let mount = robot.mounts.get(body)?;
        return Some(mount.translation.vector.into());
    }
    robot.points.get(body)?.values().next().copied()
}
