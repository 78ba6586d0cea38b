//! Options as parameters that a profile can set by name.

use crate::{frame::PlaneFit, option_id::OptionId, options::Options};

/// The value of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Yes or no.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// A finite number.
    Number(f64),
    /// A text.
    Text(String),
}

/// One parameter of an estimator. Its type is the type of its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Its name, with its unit.
    pub name: String,
    /// One line.
    pub summary: String,
    /// The default; of a required parameter: an example.
    pub value: Value,
    /// Smallest and largest number, both included.
    pub limits: Option<(f64, f64)>,
    /// The texts that are allowed; empty: any.
    pub choices: Vec<String>,
    /// The profile must give it.
    pub required: bool,
}

/// Names of the fits of a plane, as a profile writes them.
const PLANE_FITS: [(&str, PlaneFit); 3] = [
    ("planar_radial", PlaneFit::PlanarRadial),
    ("plane", PlaneFit::Plane),
    ("common_line", PlaneFit::CommonLine),
];

/// The parameter that sets an option; `None` for options that come with the recording.
#[must_use]
pub fn parameter(option: OptionId) -> Option<Parameter> {
    let default = Options::default();
    let (name, summary, value, limits) = match option {
        OptionId::NoisePerMarker => (
            "noise_per_marker",
            "one noise level for each marker",
            Value::Bool(default.noise_per_marker),
            None,
        ),
        OptionId::Separation => (
            "separation",
            "rows between the two samples of a pair; 0: all pairs",
            Value::Integer(0),
            Some((0.0, 1e6)),
        ),
        OptionId::Significance => (
            "significance",
            "probability of calling an unanswerable recording answerable",
            Value::Number(default.significance),
            Some((1e-12, 0.5)),
        ),
        OptionId::WeakFraction => (
            "weak_fraction",
            "σ of the weakest direction, as a part of the size, above which the verdict is weak",
            Value::Number(default.weak_fraction),
            Some((1e-9, 1e3)),
        ),
        OptionId::WeakAngle => (
            "weak_angle_deg",
            "σ of a direction above which the verdict is weak, degrees",
            Value::Number(10.0),
            Some((1e-6, 90.0)),
        ),
        OptionId::Seed => (
            "seed",
            "seed of random starts and subsets",
            Value::Integer(default.seed as i64),
            Some((0.0, 9e15)),
        ),
        OptionId::Subsets => (
            "subsets",
            "random subsets that are drawn",
            Value::Integer(default.subsets as i64),
            Some((1.0, 1e6)),
        ),
        OptionId::PlaneFit => (
            "plane_fit",
            "how the axis of each plane of circles is fitted",
            Value::Text(PLANE_FITS[0].0.to_owned()),
            None,
        ),
        OptionId::SameAngle => (
            "same_angle_deg",
            "angles closer than this are one grid line, degrees",
            Value::Number(default.same_angle.to_degrees()),
            Some((1e-6, 90.0)),
        ),
        OptionId::SigmaT
        | OptionId::SigmaR
        | OptionId::Covariances
        | OptionId::Weights
        | OptionId::Center
        | OptionId::Angles
        | OptionId::Towards
        | OptionId::Axes => return None,
    };
    Some(Parameter {
        name: name.to_owned(),
        summary: summary.to_owned(),
        value,
        limits,
        choices: match option {
            OptionId::PlaneFit => PLANE_FITS.iter().map(|(n, _)| (*n).to_owned()).collect(),
            _ => Vec::new(),
        },
        required: false,
    })
}

/// Sets an option; the value has the type and the limits of its [`parameter`].
pub fn set(options: &mut Options, option: OptionId, value: &Value) {
    match (option, value) {
        (OptionId::NoisePerMarker, Value::Bool(v)) => options.noise_per_marker = *v,
        (OptionId::Separation, Value::Integer(v)) => {
            options.separation = usize::try_from(*v).ok().filter(|rows| *rows > 0);
        }
        (OptionId::Significance, Value::Number(v)) => options.significance = *v,
        (OptionId::WeakFraction, Value::Number(v)) => options.weak_fraction = *v,
        (OptionId::WeakAngle, Value::Number(v)) => options.weak_angle = v.to_radians(),
        (OptionId::Seed, Value::Integer(v)) => options.seed = v.unsigned_abs(),
        (OptionId::Subsets, Value::Integer(v)) => {
            options.subsets = usize::try_from(*v).unwrap_or(options.subsets);
        }
        (OptionId::PlaneFit, Value::Text(v)) => {
            if let Some((_, fit)) = PLANE_FITS.iter().find(|(name, _)| name == v) {
                options.plane_fit = *fit;
            }
        }
        (OptionId::SameAngle, Value::Number(v)) => options.same_angle = v.to_radians(),
        _ => {}
    }
}
