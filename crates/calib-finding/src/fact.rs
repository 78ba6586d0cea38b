//! Named values of a finding.

use crate::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// One value of a finding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[non_exhaustive]
pub enum Fact {
    /// A finite number in SI.
    Number {
        /// In `unit`.
        value: f64,
        /// SI.
        unit: Unit,
    },
    /// How many.
    Count(u64),
    /// The name of something, or one of a few choices that the program defines.
    Name(Cow<'static, str>),
    /// Several names.
    Names(Vec<String>),
    /// A number that is not finite.
    Unknown,
}

impl Fact {
    /// A number in SI.
    #[must_use]
    pub fn number(value: f64, unit: Unit) -> Self {
        if value.is_finite() {
            Fact::Number { value, unit }
        } else {
            Fact::Unknown
        }
    }

    /// A length in m.
    #[must_use]
    pub fn meters(value: f64) -> Self {
        Self::number(value, Unit::Meter)
    }

    /// An angle in rad.
    #[must_use]
    pub fn radians(value: f64) -> Self {
        Self::number(value, Unit::Radian)
    }

    /// A time in s.
    #[must_use]
    pub fn seconds(value: f64) -> Self {
        Self::number(value, Unit::Second)
    }

    /// A number without unit.
    #[must_use]
    pub fn ratio(value: f64) -> Self {
        Self::number(value, Unit::One)
    }

    /// How many.
    #[must_use]
    pub fn count(value: usize) -> Self {
        Fact::Count(value as u64)
    }

    /// The name of something in the data.
    pub fn name(value: impl Into<String>) -> Self {
        Fact::Name(Cow::Owned(value.into()))
    }

    /// One of a few words that the program defines.
    #[must_use]
    pub const fn choice(value: &'static str) -> Self {
        Fact::Name(Cow::Borrowed(value))
    }

    /// Names of things in the data.
    pub fn names<T: Into<String>>(values: impl IntoIterator<Item = T>) -> Self {
        Fact::Names(values.into_iter().map(Into::into).collect())
    }

    /// The number in SI, or the count.
    #[must_use]
    pub fn value(&self) -> Option<f64> {
        match self {
            Fact::Number { value, .. } => Some(*value),
            Fact::Count(count) => Some(*count as f64),
            _ => None,
        }
    }

    /// The name, where it is one.
    #[must_use]
    pub fn word(&self) -> Option<&str> {
        match self {
            Fact::Name(name) => Some(name),
            _ => None,
        }
    }
}

/// The values of a finding by key, in the order of the keys.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Facts(BTreeMap<Cow<'static, str>, Fact>);

impl Facts {
    /// No values.
    #[must_use]
    pub const fn new() -> Self {
        Facts(BTreeMap::new())
    }

    /// The value of a key.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&Fact> {
        self.0.get(key)
    }

    /// Sets the value of a key.
    pub fn insert(&mut self, key: &'static str, fact: Fact) {
        self.0.insert(Cow::Borrowed(key), fact);
    }

    /// Keys and values, in the order of the keys.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Fact)> {
        self.0.iter().map(|(key, fact)| (key.as_ref(), fact))
    }

    /// Whether there are no values.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
