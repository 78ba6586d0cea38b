//! Scalar unknowns: their names, units, priors and bounds.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::graph::effect::{Confounded, EffectKind};
use crate::graph::unit::Unit;

/// What a parameter describes; decides the words about it. Written as one word: `rotation`, `gain`, ….
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum ParameterKind {
    /// A rotation component of an unknown pose.
    Rotation,
    /// A translation component of an unknown pose.
    Translation,
    /// A coordinate of a point in its frame.
    Point,
    /// Coefficient of a joint effect.
    Effect(EffectKind),
    /// A first moment of masses that load the joints.
    Load,
}

impl ParameterKind {
    /// The word for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Rotation => "rotation",
            Self::Translation => "translation",
            Self::Point => "point",
            Self::Load => "first_moment",
            Self::Effect(kind) => kind.term().class,
        }
    }

    /// Whether it acts like a change of all lengths.
    #[must_use]
    pub fn is_scale(self) -> bool {
        matches!(self, Self::Effect(kind) if kind.effect().confounded == Confounded::Scale)
    }
}

impl Serialize for ParameterKind {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for ParameterKind {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let name = String::deserialize(from)?;
        [Self::Rotation, Self::Translation, Self::Point, Self::Load]
            .into_iter()
            .chain(EffectKind::all().map(Self::Effect))
            .find(|kind| kind.name() == name)
            .ok_or_else(|| D::Error::custom(format!("unknown parameter kind `{name}`")))
    }
}

/// One scalar of the problem. Pose components are displacements from the nominal pose (nominal 0).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Unique name, for instance `elbow.origin.z`.
    pub name: String,
    /// The joint it belongs to, where there is one.
    pub joint: Option<String>,
    /// What it describes.
    pub kind: ParameterKind,
    /// Its unit.
    pub unit: Unit,
    /// Center of the prior.
    pub nominal: f64,
    /// Where the solver starts.
    pub start: f64,
    /// σ of the Gaussian prior about `nominal`; `None`: the data alone decide.
    pub prior_sigma: Option<f64>,
    /// Physical limits `(lower, upper)`; `None`: unbounded.
    pub bounds: Option<(f64, f64)>,
    /// Held at `start`, not estimated.
    pub fixed: bool,
}

impl Parameter {
    /// Unit of length of this parameter in the observability analysis: its prior σ, else
    /// [`Unit::typical_deviation`].
    #[must_use]
    pub fn scale(&self) -> f64 {
        self.prior_sigma
            .unwrap_or_else(|| self.unit.typical_deviation())
    }
}
