//! What a verdict depends on.

use statrs::distribution::{ChiSquared, ContinuousCDF};
use statrs::function::beta::beta_reg;

use crate::verdict::Improvement;
use crate::{FitEnd, Limit, Unit};

/// Everything that the rules look at. The default is a run that found nothing and knows nothing: not accepted.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Facts {
    /// The limits of the profile against what was measured.
    pub limits: Vec<Limit>,
    /// Held-out errors of each body, where there are several.
    pub of_bodies: Vec<BodyError>,
    /// How the solver ended; `None` with the closed forms.
    pub solver: Option<Solver>,
    /// Origins that the profile asks for and that were not determined.
    pub undetermined_origins: Vec<String>,
    /// Ids of the findings that are errors, one per finding.
    pub errors: Vec<String>,
    /// Ids of the findings that are warnings, one per finding.
    pub warnings: Vec<String>,
    /// Fitted measurements that the fit or the checks rejected.
    pub rejected: Share,
    /// What was rejected as a whole.
    pub rejected_parts: Vec<RejectedPart>,
    /// Held-out measurements that were screened out.
    pub screened: Share,
    /// Whether anything of the robot itself was estimated.
    pub freed: bool,
    /// Held-out errors, calibrated against registration only, quantity by quantity.
    pub improvements: Vec<Improvement>,
    /// Numbers far from their nominal values.
    pub changes: Vec<Change>,
    /// Held-out errors of the URDF alone; `None` where it holds everything that was found.
    pub urdf_alone: Option<UrdfAlone>,
    /// What the result was verified with.
    pub validation: Validation,
    /// Orientation of the last body on held-out poses.
    pub orientation: Orientation,
    /// Where one joint at a time moved.
    pub single_joint: SingleJoint,
    /// Joints that the fit moved and the held-out poses hardly move.
    pub not_verified: Vec<String>,
    /// Bodies that the fit used and no held-out pose shows.
    pub unseen_bodies: Vec<UnseenBody>,
    /// Goodness of fit; `None` with the closed forms.
    pub goodness: Option<Goodness>,
    /// How far predictions can be off; `None` with the closed forms, or where nothing was measured at the robot's end.
    pub prediction: Option<Prediction>,
    /// Held-out errors against what is stated of them; `None` without.
    pub agreement: Option<Agreement>,
}

/// Held-out position errors of one body.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BodyError {
    /// Its name.
    pub name: String,
    /// rms, m.
    pub rms: f64,
    /// 95 % interval of the rms, m.
    pub interval: (f64, f64),
}

/// A body that the fit used and no held-out pose shows.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct UnseenBody {
    /// Its name.
    pub name: String,
    /// The joints that nothing else verifies.
    pub joints: Vec<String>,
    /// Its mount is the one after a change, in place of which the one before may be verified.
    pub remounted: bool,
}

/// An rms position error over the joint ranges, m.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Predicted {
    /// Expected, given all data.
    pub rms: f64,
    /// Its 99 % upper limit.
    pub upper: f64,
}

/// How far predictions over the joint ranges can be off.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Prediction {
    /// The rms that the fit states, m.
    pub stated: f64,
    /// The rms by the joints' noise from pose to pose, m: it is in what follows, and no data can lessen it.
    pub joints: f64,
    /// By the parameters alone.
    pub alone: Predicted,
    /// With the effect that adds most, of those that the model does not have.
    pub with: Option<(Untested, Predicted)>,
}

/// Something that the model does not have.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Untested {
    /// What it is.
    pub effect: UntestedKind,
    /// Joint, body or tracker frame.
    pub of: String,
    /// The other joint of a coupling.
    pub other: Option<String>,
}

/// What is not in the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UntestedKind {
    /// Gain of a joint.
    Gain,
    /// Eccentricity of a joint.
    Eccentricity,
    /// A joint that yields under gravity.
    Compliance,
    /// A share of another joint's motion.
    Coupling,
    /// A step of a joint's zero.
    Step,
    /// A drift of the tracker.
    Drift,
    /// A step of the tracker.
    Bump,
    /// A step of the body on its link.
    Slip,
}

impl UntestedKind {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Gain,
        Self::Eccentricity,
        Self::Compliance,
        Self::Coupling,
        Self::Step,
        Self::Drift,
        Self::Bump,
        Self::Slip,
    ];

    /// As in `report.json`.
    #[must_use]
    pub const fn id(self) -> &'static str {
        match self {
            Self::Gain => "gain",
            Self::Eccentricity => "eccentricity",
            Self::Compliance => "compliance",
            Self::Coupling => "coupling",
            Self::Step => "step",
            Self::Drift => "drift",
            Self::Bump => "bump",
            Self::Slip => "slip",
        }
    }
}

/// χ² of all held-out errors together, parameters and noise as stated.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Agreement {
    /// χ² per degree of freedom.
    pub value: f64,
    /// What it exceeds once in a thousand validations if the stated uncertainty is right.
    pub high: f64,
}

impl Agreement {
    /// Of χ² over `rows` held-out numbers; the noise is known to as many degrees of freedom as the fit has.
    #[must_use]
    pub fn of(chi2: f64, rows: usize, degrees_of_freedom: f64) -> Self {
        let rows = rows.max(1) as f64;
        Self {
            value: chi2 / rows,
            high: quantile(rows, degrees_of_freedom),
        }
    }

    /// The largest χ² per degree of freedom that is left alone.
    #[must_use]
    pub fn accepted(&self) -> f64 {
        /// No stated σ is more exact than this, as a ratio of variances.
        const AGREES: f64 = 1.5;
        self.high.max(AGREES)
    }

    /// Whether held-out errors are larger than what is stated of them allows.
    #[must_use]
    pub fn is_beyond(&self) -> bool {
        self.value > self.accepted()
    }
}

/// 99.9 % quantile of F(h, ν), by the cube root of χ²/dof, which is nearly normal (Wilson & Hilferty; Paulson 1942).
///
/// ```text
/// x = F^⅓:   ((1 − b) x − (1 − a))² = z² (a + b x²),   a = 2/(9h),   b = 2/(9ν)
/// ```
fn quantile(h: f64, freedom: f64) -> f64 {
    /// 99.9 % quantile of the normal distribution.
    const Z: f64 = 3.0902;
    let (a, b) = (
        2.0 / (9.0 * h),
        2.0 / (9.0 * freedom.max(f64::MIN_POSITIVE)),
    );
    let (one_a, one_b) = (1.0 - a, 1.0 - b);
    let square = one_b * one_b - Z * Z * b;
    if square <= 0.0 || one_b <= 0.0 {
        return f64::INFINITY;
    }
    let root = (a * one_b * one_b + b * one_a * one_a - Z * Z * a * b).max(0.0);
    ((one_a * one_b + Z * root.sqrt()) / square).powi(3)
}

/// How the solver ended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Solver {
    /// How.
    pub ended: FitEnd,
    /// After how many iterations.
    pub iterations: usize,
}

/// A part of a whole, counted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Share {
    /// The part.
    pub part: usize,
    /// The whole.
    pub of: usize,
}

impl Share {
    /// Part of the whole, in [0, 1]; 0 of nothing.
    #[must_use]
    pub fn ratio(self) -> f64 {
        if self.of == 0 {
            0.0
        } else {
            self.part as f64 / self.of as f64
        }
    }

    /// Probability of so large a part or a larger one, if each has this chance: 2 of 12 are no proof of more than a tenth, 200 of
    /// 1200 are.
    #[must_use]
    pub fn chance_of_more(self, chance: f64) -> f64 {
        if self.part == 0 {
            return 1.0;
        }
        // P(k or more of n) = I_p(k, n − k + 1)
        let (part, of) = (self.part as f64, self.of.max(self.part) as f64);
        beta_reg(part, of - part + 1.0, chance)
    }
}

/// What was rejected as a whole.
#[derive(Debug, Clone, PartialEq)]
pub struct RejectedPart {
    /// What it is.
    pub part: Part,
    /// How many of its measurements were rejected.
    pub rejected: Share,
}

/// A part of the fitted data.
#[derive(Debug, Clone, PartialEq)]
pub enum Part {
    /// A body or marker in one recording.
    Subject {
        /// The recording.
        recording: String,
        /// The body or marker.
        subject: String,
    },
    /// A whole recording.
    Recording(String),
    /// A range of a joint.
    Range {
        /// The joint.
        joint: String,
        /// Lower end, rad or m.
        from: f64,
        /// Upper end, rad or m.
        to: f64,
        /// Unit of both.
        unit: Unit,
    },
}

/// Held-out errors of the patched URDF without the effects that it cannot hold.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct UrdfAlone {
    /// rms error of the URDF alone, m.
    pub rms: f64,
    /// rms error of the URDF that was fitted to be used without effects, m.
    pub refitted: Option<f64>,
    /// rms error with the effects, m.
    pub with_effects: f64,
    /// The profile's limit of the rms error, m.
    pub limit: Option<f64>,
}

/// A number that moved far from its nominal value.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// The parameter, or the joint whose axis was turned round.
    pub name: String,
    /// Found − nominal.
    pub change: f64,
    /// Its unit.
    pub unit: Unit,
    /// |change| in standard deviations of the prior; `None` where an axis was turned round.
    pub sigmas: Option<f64>,
}

/// What a result was verified with.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Validation {
    /// Nothing.
    #[default]
    None,
    /// Fitted poses, each left out in turn.
    LeaveOneOut {
        /// How many.
        postures: usize,
    },
    /// Recordings that were held out.
    Recordings {
        /// Postures in them.
        postures: usize,
        /// Those that repeat a fitted posture within the noise of the joint readings.
        repeated: usize,
    },
}

impl Validation {
    /// Postures that were verified.
    #[must_use]
    pub fn postures(self) -> usize {
        match self {
            Self::None => 0,
            Self::LeaveOneOut { postures } | Self::Recordings { postures, .. } => postures,
        }
    }
}

/// Orientation of the last body on held-out poses.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Orientation {
    /// rms error, rad; `None` where no orientation is measured.
    pub rms: Option<f64>,
    /// What noise alone would show, rad.
    pub expected: Option<f64>,
}

/// Where one joint at a time moved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SingleJoint {
    /// In all fitted recordings.
    pub fitted: bool,
    /// In all held-out poses.
    pub held_out: bool,
}

impl Goodness {
    /// Where χ²/dof lies in 99.9 % of the fits whose noise is as assumed; anywhere with less than one degree of freedom.
    #[must_use]
    pub fn band_of(degrees_of_freedom: f64) -> (f64, f64) {
        // With less than one, the data say nothing of the noise.
        if degrees_of_freedom < 1.0 {
            return (0.0, f64::INFINITY);
        }
        let of = ChiSquared::new(degrees_of_freedom);
        of.map_or((0.0, f64::INFINITY), |of| {
            let end = |p: f64| of.inverse_cdf(p) / degrees_of_freedom;
            (end(0.0005), end(0.9995))
        })
    }
}

/// χ² of the fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Goodness {
    /// χ² per degree of freedom at the noise that the stated uncertainty is made of.
    pub used: f64,
    /// 99.9 % band of that number.
    pub band: (f64, f64),
    /// The group whose noise is furthest above what the profile states.
    pub above_stated: Option<FoundNoise>,
    /// The group whose noise is furthest below it.
    pub below_stated: Option<FoundNoise>,
    /// The group of no stated noise that is furthest above the scatter of the markers about their own rigid bodies, in which no model of the robot is,
    /// with the noise over this scatter.
    pub above_scatter: Option<(String, f64)>,
}

/// A noise level of the fit beside the one that the profile states.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundNoise {
    /// The group of measurements.
    pub group: String,
    /// Found over stated.
    pub factor: f64,
    /// The same of single rows, where what was fitted are their means over holds; at least `factor`.
    pub of_rows: f64,
    /// Scatter of the markers about their own rigid bodies over the stated noise: no model of the robot is in it.
    pub rigid: Option<f64>,
    /// Number of samples, where they are so few that a wrong reading may be in them without a name.
    pub few: Option<usize>,
}
