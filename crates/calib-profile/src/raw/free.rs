//! Keys that follow from the table of joint effects: what can be freed, and its prior standard deviations.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::LazyLock;

use calib_core::EFFECTS;
use calib_core::effect::{Effect, PriorKey};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error as _, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// What the solver may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum RawFree {
    /// Mounts of the tracking bodies on their links.
    Bodies,
    /// Pose of the robot's root in the tracker.
    Tracker,
    /// Axis lines of the moved joints.
    JointAxes,
    /// Whole origins of the moved joints.
    JointOrigins,
    /// First moments of the masses that load the joints.
    Masses,
    /// An effect of the moved joints.
    Effect(&'static Effect),
}

/// What of one joint is free.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum RawJointFree {
    /// Whole origin.
    Origin,
    /// Axis line only.
    Axis,
    /// An effect.
    Effect(&'static Effect),
}

/// (key, value, meaning) of every choice.
type Choices<T> = LazyLock<Vec<(&'static str, T, &'static str)>>;

static FREE: Choices<RawFree> = LazyLock::new(|| {
    let fixed = [
        (
            "bodies",
            RawFree::Bodies,
            "Mounts of the tracking bodies on their links.",
        ),
        (
            "tracker",
            RawFree::Tracker,
            "Pose of the robot's root in the tracker.",
        ),
        (
            "joint_axes",
            RawFree::JointAxes,
            "Axis lines of the moved joints: two tilts and two translations across the axis.",
        ),
        (
            "joint_origins",
            RawFree::JointOrigins,
            "Whole origins of the moved joints, six numbers each.",
        ),
        (
            "masses",
            RawFree::Masses,
            "First moments (mass times center) of what loads the compliant joints, about the masses of the URDF or assumed ones.",
        ),
    ];
    let effects = EFFECTS.iter().filter_map(|effect| {
        let keys = effect.profile.as_ref()?;
        Some((keys.all, RawFree::Effect(effect), keys.all_text))
    });
    fixed.into_iter().chain(effects).collect()
});

static JOINT_FREE: Choices<RawJointFree> = LazyLock::new(|| {
    let fixed = [
        ("origin", RawJointFree::Origin, "Whole origin."),
        ("axis", RawJointFree::Axis, "Axis line only."),
    ];
    let effects = EFFECTS.iter().filter_map(|effect| {
        let keys = effect.profile.as_ref()?;
        Some((keys.own, RawJointFree::Effect(effect), keys.own_text))
    });
    fixed.into_iter().chain(effects).collect()
});

static FREE_KEYS: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| FREE.iter().map(|c| c.0).collect());
static JOINT_FREE_KEYS: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| JOINT_FREE.iter().map(|c| c.0).collect());

/// One of a list of words, as serde derives it.
struct OneOf<T: 'static>(
    &'static [(&'static str, T, &'static str)],
    &'static [&'static str],
);

impl<T: Copy> Visitor<'_> for OneOf<T> {
    type Value = T;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(to, "one of {}", self.1.join(", "))
    }

    fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<T, E> {
        let found = self.0.iter().find(|(key, _, _)| *key == word);
        found
            .map(|(_, value, _)| *value)
            .ok_or_else(|| E::unknown_variant(word, self.1))
    }
}

fn key_of<T: PartialEq>(choices: &[(&'static str, T, &'static str)], value: &T) -> &'static str {
    choices.iter().find(|c| c.1 == *value).map_or("", |c| c.0)
}

fn choice_schema<T>(choices: &[(&'static str, T, &'static str)], description: &str) -> Schema {
    let one_of: Vec<Schema> = choices
        .iter()
        .map(|(key, _, text)| json_schema!({"description": text, "type": "string", "const": key}))
        .collect();
    json_schema!({"description": description, "oneOf": one_of})
}

impl<'de> Deserialize<'de> for RawFree {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_str(OneOf(&FREE, &FREE_KEYS))
    }
}

impl Serialize for RawFree {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(key_of(&FREE, self))
    }
}

impl JsonSchema for RawFree {
    fn schema_name() -> Cow<'static, str> {
        "RawFree".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        choice_schema(&FREE, "What the solver may change.")
    }
}

impl RawJointFree {
    /// As a profile states it.
    #[must_use]
    pub fn key(&self) -> &'static str {
        key_of(&JOINT_FREE, self)
    }
}

impl<'de> Deserialize<'de> for RawJointFree {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_str(OneOf(&JOINT_FREE, &JOINT_FREE_KEYS))
    }
}

impl Serialize for RawJointFree {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(key_of(&JOINT_FREE, self))
    }
}

impl JsonSchema for RawJointFree {
    fn schema_name() -> Cow<'static, str> {
        "RawJointFree".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        choice_schema(&JOINT_FREE, "What of one joint is free.")
    }
}

/// Prior of the position numbers of origins.
pub(crate) static POSITION: PriorKey = PriorKey {
    key: "position_mm",
    text: "Position numbers of joint origins, mm.",
    default: 10.0,
    si: 1e-3,
};

/// Prior of the orientation numbers of origins.
pub(crate) static ANGLE: PriorKey = PriorKey {
    key: "angle_deg",
    text: "Orientation numbers of joint origins, deg.",
    default: 1.0,
    si: std::f64::consts::PI / 180.0,
};

/// Prior of masses.
pub(crate) static MASS: PriorKey = PriorKey {
    key: "mass",
    text: "Masses of links, as a share of the ones that are given or assumed.",
    default: 0.5,
    si: 1.0,
};

/// Prior of centers of mass.
pub(crate) static MASS_CENTER: PriorKey = PriorKey {
    key: "mass_center_mm",
    text: "Centers of mass of links, mm.",
    default: 200.0,
    si: 1e-3,
};

/// Every key of `solve.prior` once.
pub(crate) static PRIOR_KEYS: LazyLock<Vec<&'static PriorKey>> = LazyLock::new(|| {
    let priors = EFFECTS.iter().filter_map(|e| e.prior.as_ref());
    let mut keys: Vec<&PriorKey> = vec![&POSITION, &ANGLE];
    for key in priors.flat_map(|p| [p.revolute, p.prismatic]) {
        if keys.iter().all(|known| known.key != key.key) {
            keys.push(key);
        }
    }
    keys.extend([&MASS, &MASS_CENTER]);
    keys
});

static PRIOR_WORDS: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| PRIOR_KEYS.iter().map(|k| k.key).collect());

/// Prior standard deviations of what is freed, in the units of their keys: those that the file states.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RawPrior(BTreeMap<&'static str, f64>);

impl RawPrior {
    /// Value of a key, in its unit.
    #[must_use]
    pub fn get(&self, key: &PriorKey) -> f64 {
        self.0.get(key.key).copied().unwrap_or(key.default)
    }

    /// Whether the file states this key.
    #[must_use]
    pub fn states(&self, key: &PriorKey) -> bool {
        self.0.contains_key(key.key)
    }
}

/// A key of `solve.prior`: refused at its own place in the file if it is unknown.
struct PriorWord(&'static str);

impl<'de> Deserialize<'de> for PriorWord {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Word;
        impl Visitor<'_> for Word {
            type Value = PriorWord;

            fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
                to.write_str("a key of `solve.prior`")
            }

            fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<PriorWord, E> {
                let found = PRIOR_WORDS.iter().find(|key| **key == word);
                found
                    .map(|key| PriorWord(key))
                    .ok_or_else(|| E::unknown_field(word, &PRIOR_WORDS))
            }
        }
        from.deserialize_identifier(Word)
    }
}

impl<'de> Deserialize<'de> for RawPrior {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Priors;
        impl<'de> Visitor<'de> for Priors {
            type Value = RawPrior;

            fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
                to.write_str("prior standard deviations by key")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<RawPrior, A::Error> {
                let mut prior = RawPrior::default();
                let mut seen: Vec<&'static str> = Vec::new();
                while let Some(PriorWord(key)) = map.next_key()? {
                    if seen.contains(&key) {
                        return Err(A::Error::duplicate_field(key));
                    }
                    seen.push(key);
                    prior.0.insert(key, map.next_value()?);
                }
                Ok(prior)
            }
        }
        from.deserialize_struct("RawPrior", &PRIOR_WORDS, Priors)
    }
}

impl Serialize for RawPrior {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(Some(PRIOR_KEYS.len()))?;
        for key in PRIOR_KEYS.iter() {
            map.serialize_entry(key.key, &self.get(key))?;
        }
        map.end()
    }
}

impl JsonSchema for RawPrior {
    fn schema_name() -> Cow<'static, str> {
        "RawPrior".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let property = |key: &&PriorKey| {
            let of = serde_json::json!({
                "description": key.text, "type": "number", "format": "double", "default": key.default,
            });
            (key.key.to_owned(), of)
        };
        let properties: serde_json::Map<_, _> = PRIOR_KEYS.iter().map(property).collect();
        json_schema!({
            "description": "Prior standard deviations of what is freed. One that is stated is used as it is; a default is multiplied by a factor from 0.1 to 10 where the data ask for it and predictions do not lose by it.",
            "type": "object",
            "properties": properties,
            "additionalProperties": false,
        })
    }
}
