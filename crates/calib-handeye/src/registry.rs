//! The hand-eye estimator in the table of all estimators.

use calib_estimator::{
    Estimate, EstimatorError, EstimatorInfo, Input, InputKind, Kind,
    OptionId::{SigmaR, SigmaT},
    Options, Outcome, Verdict, find,
};

use crate::{
    input::HandEyeError,
    moving::{HandEye, solve_ax_zb},
    problem::HandEyeWeights,
};

/// One estimator of hand-eye transforms.
pub type HandEyeInfo = EstimatorInfo<HandEye>;

const ID: &str = "handeye";

const TABLE: &[HandEyeInfo] = &[HandEyeInfo {
    id: ID,
    name: "robot–world and hand–eye, certified",
    input: InputKind::PosePairs,
    options: &[SigmaT, SigmaR],
    summary: "both transforms of A X = Z B at once, with a proof of optimality",
    source: "quadratic cost with orthogonality constraints, see the book",
    fit: by_input,
}];

/// All estimators of hand-eye transforms.
#[must_use]
pub fn estimators() -> &'static [HandEyeInfo] {
    TABLE
}

/// The estimator called `id`.
///
/// # Errors
/// [`EstimatorError::Unknown`] with the names of the table.
pub fn estimator(id: &str) -> Result<&'static HandEyeInfo, EstimatorError> {
    find(Kind::HandEye, TABLE, id)
}

/// [`solve_ax_zb`] on [`Input::PosePairs`]; the noise that is stated gives the weights.
fn by_input(input: &Input<'_>, options: &Options) -> Result<Outcome<HandEye>, EstimatorError> {
    options.check()?;
    let Input::PosePairs { robot, measured } = *input else {
        return Err(input.wrong(InputKind::PosePairs));
    };
    let none = HandEyeWeights::default();
    let weights = HandEyeWeights {
        sigma_rotation: options.sigma_r.unwrap_or(none.sigma_rotation),
        sigma_translation: options.sigma_t.unwrap_or(none.sigma_translation),
    };
    match solve_ax_zb(robot, measured, weights) {
        Ok(found) => Ok(Outcome::Estimate(Box::new(found))),
        Err(error @ HandEyeError::TooFew { .. }) => {
            Ok(Outcome::none(ID, Verdict::TooFew, error.to_string(), ()))
        }
        Err(error @ HandEyeError::OneAxis { .. }) => Ok(Outcome::none(
            ID,
            Verdict::SingleAxis,
            error.to_string(),
            (),
        )),
        Err(HandEyeError::Lengths { a, b }) => Err(calib_estimator::measured::DataError::Lengths {
            what: "poses of the robot and of the tracker",
            left: a,
            right: b,
        }
        .into()),
        Err(HandEyeError::NotFinite { index }) => {
            Err(calib_estimator::measured::DataError::NotFinite {
                marker: 0,
                row: index,
            }
            .into())
        }
    }
}

impl Estimate for HandEye {
    type Known = ();

    const NOTHING: () = ();

    fn estimator(&self) -> &'static str {
        ID
    }

    fn verdict(&self) -> Verdict {
        Verdict::Ok
    }

    fn reason(&self) -> Option<&str> {
        None
    }

    fn is_finite(&self) -> bool {
        let finite =
            |t: &nalgebra::Isometry3<f64>| t.to_homogeneous().iter().all(|v| v.is_finite());
        finite(&self.x)
            && finite(&self.z)
            && self.covariance.iter().flatten().all(|v| v.is_finite())
            && [
                self.rms_translation,
                self.rms_rotation,
                self.gap,
                self.least_eigenvalue,
            ]
            .iter()
            .all(|v| v.is_finite())
    }
}
