use crate::Unit;
use calib_geometry::so3::rpy_to_read;
use nalgebra::{Isometry3, Matrix3, Matrix6, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A transform `parent_from_child`, estimated or assumed.
///
/// The covariance is of the perturbation ξ = [ω; v] in `parent_from_child · exp(ξ)`, in axes of the child (rad², rad·m, m²).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Transform {
    /// The origin's or body's name in the profile.
    pub name: String,
    /// The frame that it is expressed in.
    pub parent: String,
    /// The frame that it places.
    pub child: String,
    /// The child's origin in the parent, m.
    pub translation_m: [f64; 3],
    /// Unit quaternion x, y, z, w.
    pub rotation_xyzw: [f64; 4],
    /// 6×6 in [ω; v] of the child, or null when it is unknown.
    pub covariance: Option<[[f64; 6]; 6]>,
    /// Whether all six degrees of freedom are observable.
    pub observable: bool,
    /// The directions that are not.
    pub unobservable: Vec<Unobservable>,
    /// Fixed-axis roll, pitch, yaw of the URDF: `Rz(yaw)·Ry(pitch)·Rx(roll)`, rad.
    #[serde(default)]
    pub rpy_rad: [f64; 3],
    /// σ of the origin along the axes of the *parent*, m: the σ of `translation_m`.
    #[serde(default)]
    pub sigma_translation_m: Option<[f64; 3]>,
    /// σ of the rotation about the axes of the *child*, rad.
    #[serde(default)]
    pub sigma_rotation_rad: Option<[f64; 3]>,
    /// Where the numbers come from.
    #[serde(default)]
    pub status: Status,
}

impl Transform {
    /// From `parent_from_child` and its covariance in [ω; v] of the child. A covariance with non-finite entries counts as unknown.
    #[must_use]
    pub fn new(
        name: impl Into<String>,
        parent: impl Into<String>,
        child: impl Into<String>,
        parent_from_child: &Isometry3<f64>,
        covariance: Option<&Matrix6<f64>>,
        status: Status,
    ) -> Self {
        let covariance = covariance.filter(|c| c.iter().all(|x| x.is_finite()));
        let q = parent_from_child.rotation.coords;
        let rotation = parent_from_child.rotation.to_rotation_matrix();
        Self {
            name: name.into(),
            parent: parent.into(),
            child: child.into(),
            translation_m: parent_from_child.translation.vector.into(),
            rotation_xyzw: [q.x, q.y, q.z, q.w],
            covariance: covariance
                .map(|c| std::array::from_fn(|i| std::array::from_fn(|j| c[(i, j)]))),
            observable: true,
            unobservable: Vec::new(),
            rpy_rad: rpy_to_read(&parent_from_child.rotation),
            sigma_translation_m: covariance.map(|c| {
                // C_parent = R · C_vv · Rᵀ
                let c_vv: Matrix3<f64> = c.fixed_view::<3, 3>(3, 3).into();
                sigmas(&(rotation.matrix() * c_vv * rotation.matrix().transpose()))
            }),
            sigma_rotation_rad: covariance.map(|c| sigmas(&c.fixed_view::<3, 3>(0, 0).into())),
            status,
        }
    }

    /// The same with directions that are not observable; an empty list leaves it observable.
    #[must_use]
    pub fn with_unobservable(mut self, unobservable: Vec<Unobservable>) -> Self {
        self.observable = unobservable.is_empty();
        self.unobservable = unobservable;
        self
    }
}

fn sigmas(covariance: &Matrix3<f64>) -> [f64; 3] {
    let variances: Vector3<f64> = covariance.diagonal();
    [variances.x, variances.y, variances.z].map(|variance| variance.max(0.0).sqrt())
}

/// Where a number comes from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Read from the tracker or another instrument.
    Measured,
    /// Solved for here.
    Calibrated,
    /// Taken from the URDF or the profile and not checked.
    #[default]
    Assumed,
}

/// A direction of one transform that is not observable.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Unobservable {
    /// Unit twist [ω; v] in axes of the child.
    pub direction: [f64; 6],
    /// In words: "the rotation about its z axis is not observable; the value comes from the prior".
    pub text: String,
    /// What to record or to choose: an imperative sentence.
    pub remedy: String,
}

/// One term of a combination of parameters.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Term {
    /// A parameter's name.
    pub parameter: String,
    /// Its coefficient in the combination, in the parameter's SI unit.
    pub coefficient: f64,
}

/// What a direction that is not observable means for the user of the result.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Meaning {
    /// Equivalent parameter values: every prediction of a tracked body is the same with either.
    Convention,
    /// Not excited by the recordings: predictions that depend on it follow the nominal URDF, not the data.
    #[default]
    NotMeasured,
}

/// Why a combination of parameters is not observable. The words are made in `words/observability.rs`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Cause {
    /// No measurement depends on the parameter.
    NotMeasured,
    /// The joint did not move in the fitted recordings.
    JointNotMoved,
    /// The robot's base frame can be placed anywhere on the robot.
    WorldAgainstBase,
    /// A joint offset and the rotation of the joint's own origin about its axis.
    OffsetAgainstOwnOrigin,
    /// A joint offset and the rotation of the next frame about the joint axis.
    OffsetAgainstNeighbor,
    /// Translations of two origins along one axis.
    TranslationAlongAxis,
    /// Rotations of two origins about one axis.
    RotationAboutAxis,
    /// Translations along parallel axes.
    ParallelAxes,
    /// Offsets of joints whose axes coincide in every pose.
    CollinearAxes,
    /// The last joint's origin and the mount of the body behind it.
    ToolAgainstLastOrigin,
    /// The orientation of a body of which too few points are observed.
    PointOnlyTool,
    /// The markers of a body and the frame that only they define.
    MarkersAgainstMount,
    /// The tracker's pose and the mount of a body, with too few axes moved between them.
    WorldAgainstTool,
    /// A gain and a length.
    Scale,
    /// Masses and the compliances that yield to them.
    LoadsAgainstCompliances,
    /// A contact and what it touches.
    TableAgainstContact,
    /// A combination without a name.
    Combination,
    /// Not stated: a report of an earlier version.
    #[default]
    Unstated,
}

/// A combination of parameters that is not observable.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NotObservable {
    /// What it means for the user.
    #[serde(default)]
    pub meaning: Meaning,
    /// Why.
    #[serde(default)]
    pub cause: Cause,
    /// The parameter with the largest share, or the joint.
    pub subject: String,
    /// The direction in parameter space.
    pub direction: Vec<Term>,
    /// In words: "`shoulder.z` is confounded with `elbow.z`: the joint axes are parallel".
    pub text: String,
    /// What to record or to choose: an imperative sentence.
    pub remedy: String,
}

/// How well a parameter is identifiable.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// Determined by the data.
    Solid,
    /// Weakly identifiable: the prior contributes.
    Weak,
    /// Determined by the prior alone.
    Prior,
    /// An arbitrary convention: no prediction depends on the value.
    Convention,
    /// Not identifiable.
    #[default]
    NotObservable,
}

/// One scalar unknown.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Parameter {
    /// Unique: `shoulder.origin.x`.
    pub name: String,
    /// The joint of the URDF that it belongs to, if any.
    pub joint: Option<String>,
    /// `origin`, `joint_offset`, `gain`, `compliance`, `clock`, …
    pub kind: String,
    /// SI unit of the numbers.
    pub unit: Unit,
    /// Before.
    pub nominal: f64,
    /// After.
    pub value: f64,
    /// Standard deviation; null when it is unknown.
    pub sigma: Option<f64>,
    /// The same without trust in the noise model (CR2, postures as clusters); a cross-check that varies more by chance.
    #[serde(default)]
    pub sigma_cluster_robust: Option<f64>,
    /// 1 − posterior variance / prior variance; null without a prior.
    pub data_share: Option<f64>,
    /// How well it is identifiable.
    pub class: Class,
}

/// One number that differs between the original and the patched URDF.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Change {
    /// The joint of the URDF.
    pub joint: String,
    /// Which value: `origin x`, `origin yaw`, `zero offset`.
    pub what: String,
    /// SI unit of the numbers.
    pub unit: Unit,
    /// Before; null when the joint was added.
    pub old: Option<f64>,
    /// After.
    pub new: f64,
    /// new − old; null when the joint was added.
    pub delta: Option<f64>,
    /// Standard deviation of `delta`.
    pub sigma: Option<f64>,
    /// Fraction of the prior variance removed by the data, in [0, 1].
    pub data_share: Option<f64>,
}

/// A quantity by one estimator, compared with the value that the report uses.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EstimatorResult {
    /// What was estimated: `base center`.
    pub quantity: String,
    /// By which estimator: `sfe`, `hse`, `ml`.
    pub estimator: String,
    /// The components, SI; null when the estimator has no result.
    pub value: Option<Vec<f64>>,
    /// Their standard deviations.
    pub sigma: Option<Vec<f64>>,
    /// Whether it agrees with the value that the report uses, within both uncertainties. No result counts as not in agreement.
    pub agrees: bool,
    /// SI unit of the components.
    #[serde(default)]
    pub unit: Unit,
    /// Distance to the value that the report uses.
    #[serde(default)]
    pub distance: Option<f64>,
    /// Why it has no result or does not agree; empty otherwise.
    #[serde(default)]
    pub text: String,
}

/// The information of the data alone, without any prior: enough to compare this calibration with another of the same robot.
///
/// With the free parameters x (SI) and the whitened Jacobian J of the fit's residuals at the estimate x̂, U is upper
/// triangular with `UᵀU = JᵀJ`. The data alone would put x at x̃ with `UᵀU (x̃ − x̂) = P (x̂ − x₀)`, P = diag(1/σ²) of the
/// priors about the nominal values x₀; directions that are not observable are the null space of U.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DataInformation {
    /// Names of the free parameters as in `parameters`, in the order of the columns of U.
    pub parameters: Vec<String>,
    /// σ of each parameter's prior about its nominal value, in its unit; null where it has none.
    pub prior_sigma: Vec<Option<f64>>,
    /// Rows of U from the diagonal on: row i has its columns i, i + 1, … (one over the parameter's unit).
    pub root: Vec<Vec<f64>>,
    /// Degrees of freedom that the noise was found with.
    pub degrees_of_freedom: f64,
    /// Quantities of the robot that do not depend on the choice of frames.
    pub quantities: Vec<Quantity>,
    /// Signs of loads and approach, as `calib_effects` of the effects file counts them: 2; null in reports of versions that may have
    /// counted a compliance as lift, or a backlash with the direction of approach.
    #[serde(default)]
    pub effect_signs: Option<u32>,
}

/// A quantity of the robot that does not depend on the choice of frames, such as the distance between two axes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Quantity {
    /// Stable name: `distance.shoulder.elbow`.
    pub name: String,
    /// In words: "distance between the axes of shoulder and elbow".
    pub text: String,
    /// Of `value`.
    pub unit: Unit,
    /// At the estimate.
    pub value: f64,
    /// Its derivative by each parameter that it depends on.
    pub gradient: Vec<Term>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    #[test]
    fn sigma_of_the_origin_is_in_the_axes_it_is_printed_in() {
        // The child's x is the parent's y: what is uncertain along x of the child is uncertain along y of the parent.
        let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        let parent_from_child =
            Isometry3::from_parts(nalgebra::Translation3::new(1.0, 2.0, 3.0), rotation);
        let mut covariance = Matrix6::zeros();
        covariance[(3, 3)] = 4e-6;
        covariance[(2, 2)] = 9e-6;
        let transform = Transform::new(
            "t",
            "p",
            "c",
            &parent_from_child,
            Some(&covariance),
            Status::Calibrated,
        );
        let sigma = transform
            .sigma_translation_m
            .expect("a covariance was given");
        assert!(
            sigma[0].abs() < 1e-12 && (sigma[1] - 2e-3).abs() < 1e-12 && sigma[2].abs() < 1e-12,
            "{sigma:?}"
        );
        assert_eq!(transform.sigma_rotation_rad, Some([0.0, 0.0, 3e-3]));
        assert!((transform.rpy_rad[2] - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn a_covariance_that_is_not_finite_is_unknown() {
        let covariance = Matrix6::from_diagonal_element(f64::INFINITY);
        let transform = Transform::new(
            "t",
            "p",
            "c",
            &Isometry3::identity(),
            Some(&covariance),
            Status::Calibrated,
        );
        assert_eq!(transform.covariance, None);
        assert_eq!(transform.sigma_translation_m, None);
    }
}
