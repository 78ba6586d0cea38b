//! Why a verdict is what it is: ids, effects and values.

use calib_finding::{Fact, Facts};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Names every reason once: variant, id, what it can do to the verdict.
macro_rules! reasons {
    ($( $(#[doc = $doc:literal])* $variant:ident = $id:literal: $($effect:ident)|+, )+) => {
        /// Which rule a reason is from.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
        #[serde(into = "String", from = "String")]
        #[schemars(with = "String")]
        #[non_exhaustive]
        pub enum ReasonId {
            $( $(#[doc = $doc])* $variant, )+
            /// A rule of another version of the program.
            Unknown,
        }

        impl ReasonId {
            /// Every id of this version.
            pub const ALL: &[Self] = &[$( Self::$variant ),+];

            /// The id as in `report.json` and in the book.
            #[must_use]
            pub const fn as_str(self) -> &'static str {
                match self {
                    $( Self::$variant => $id, )+
                    Self::Unknown => "unknown",
                }
            }

            /// What a reason of this id can do to the verdict.
            #[must_use]
            pub const fn effects(self) -> &'static [Effect] {
                match self {
                    $( Self::$variant => &[$( Effect::$effect ),+], )+
                    Self::Unknown => &[Effect::Supports],
                }
            }
        }
    };
}

reasons! {
    /// The solver ended before an optimum.
    NotConverged = "not-converged": Rejects,
    /// The profile asks for an origin that its sweep does not determine.
    OriginNotDetermined = "origin-not-determined": Rejects,
    /// The estimate itself is above a limit.
    LimitExceeded = "limit-exceeded": Rejects,
    /// Held-out errors after registration only are significantly lower.
    WorseThanRegistration = "worse-than-registration": Rejects,
    /// A recording, a body or a range of a joint was rejected as a whole.
    RejectedPart = "rejected-part": Rejects,
    /// Held-out orientation errors are gross, and no limit of the profile speaks of them.
    OrientationOff = "orientation-off": Rejects,
    /// An error among the findings.
    UnresolvedError = "unresolved-error": LeavesOpen,
    /// The profile sets no limits.
    NoLimits = "no-limits": LeavesOpen,
    /// A limit could not be evaluated.
    LimitNotEvaluated = "limit-not-evaluated": LeavesOpen,
    /// The estimate is within a limit, the upper end of its interval is not.
    LimitUndecided = "limit-undecided": LeavesOpen,
    /// Of one of several bodies, the interval lies above a limit that all bodies together do not exceed.
    BodyAboveLimit = "body-above-limit": LeavesOpen,
    /// Over the joint ranges the upper limit of the expected error is above a limit of the profile.
    PredictionUndecided = "prediction-undecided": Warns | LeavesOpen,
    /// The same with an effect that the model does not have and that the data do not exclude.
    EffectsNotExcluded = "effects-not-excluded": Warns | LeavesOpen,
    /// Held-out errors are larger than what is stated of them.
    HeldOutBeyondStated = "held-out-beyond-stated": Warns | LeavesOpen,
    /// What the data do not exclude is far above the uncertainty that the fit states.
    UncertaintyTooSmall = "uncertainty-too-small": Warns | LeavesOpen,
    /// Nothing was predicted that was not fitted.
    NoValidation = "no-validation": LeavesOpen,
    /// Held-out rows repeat fitted postures.
    ValidationRepeatsFit = "validation-repeats-fit": Warns | LeavesOpen,
    /// A number moved further from its nominal value than its prior allows.
    ImplausibleChange = "implausible-change": Warns | LeavesOpen,
    /// An axis was reversed.
    ReversedAxis = "reversed-axis": Warns | LeavesOpen,
    /// Too large a share of the fitted measurements was rejected.
    RejectedShare = "rejected-share": Warns | LeavesOpen,
    /// Held-out measurements were screened out.
    ScreenedHeldOut = "screened-held-out": Supports | Warns | LeavesOpen,
    /// χ² at the noise that was used is outside its band.
    GoodnessOfFit = "goodness-of-fit": Warns | LeavesOpen,
    /// The noise that was found is far above the noise that was stated.
    NoiseAboveStated = "noise-above-stated": Warns,
    /// The noise that was found is far below the noise that was stated.
    NoiseBelowStated = "noise-below-stated": Warns,
    /// No noise is stated, and the noise that was found is far above the scatter of the markers about their bodies.
    NoiseAboveScatter = "noise-above-scatter": Warns,
    /// Held-out errors after registration only are not significantly higher.
    NotBetterThanRegistration = "not-better-than-registration": Warns,
    /// Too few held-out postures to tell whether the calibration is better than registration only.
    TooFewToCompare = "too-few-to-compare": Warns,
    /// No recording is held out: every pose was left out in turn.
    LeaveOneOut = "leave-one-out": Warns,
    /// The orientation of the last body is not measured.
    OrientationNotMeasured = "orientation-not-measured": Warns,
    /// One joint at a time moved.
    SingleJointData = "single-joint-data": Warns | LeavesOpen,
    /// No held-out pose shows a body that the fit used.
    BodyNotVerified = "body-not-verified": Warns | LeavesOpen,
    /// Joints that the fit used hardly move in the held-out poses.
    JointsNotVerified = "joints-not-verified": Warns,
    /// What the URDF predicts without the effects that it cannot hold.
    UrdfAlone = "urdf-alone": Supports | Warns,
    /// A warning among the findings.
    WarningFinding = "warning-finding": Warns,
    /// How far predictions over the joint ranges are expected to be off.
    PredictionExpected = "prediction-expected": Supports,
    /// A limit is met with its whole interval.
    LimitMet = "limit-met": Supports,
}

impl From<ReasonId> for String {
    fn from(id: ReasonId) -> Self {
        id.as_str().to_owned()
    }
}

impl From<String> for ReasonId {
    fn from(id: String) -> Self {
        let known = Self::ALL.iter().find(|known| known.as_str() == id);
        known.copied().unwrap_or(Self::Unknown)
    }
}

/// What a reason does to the verdict, from nothing to the gravest.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    /// Nothing: it is said because it was asked.
    #[default]
    Supports,
    /// The result is accepted with warnings.
    Warns,
    /// The result is not decided.
    LeavesOpen,
    /// The result is rejected.
    Rejects,
}

/// One reason: data only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reason {
    /// The rule.
    pub id: ReasonId,
    /// What it does to the verdict.
    pub effect: Effect,
    /// Named values, SI.
    #[serde(default)]
    pub values: Facts,
}

impl Reason {
    /// A reason without values.
    #[must_use]
    pub fn new(id: ReasonId, effect: Effect) -> Self {
        Self {
            id,
            effect,
            values: Facts::new(),
        }
    }

    /// The same with one more value.
    #[must_use]
    pub fn with(mut self, key: &'static str, fact: Fact) -> Self {
        self.values.insert(key, fact);
        self
    }

    /// The same with a value where there is one.
    #[must_use]
    pub fn with_some(self, key: &'static str, fact: Option<Fact>) -> Self {
        match fact {
            Some(fact) => self.with(key, fact),
            None => self,
        }
    }
}
