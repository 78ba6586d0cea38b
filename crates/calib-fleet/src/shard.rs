//! Which part of a work, and which work it is a part of.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Part i of n, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Shard {
    /// Which, from 1.
    pub index: u64,
    /// Of how many.
    pub of: u64,
}

/// A text that is not `i/n`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("expected i/n with 1 ≤ i ≤ n ≤ {MOST}, as `3/64`, got `{0}`")]
pub struct NotAShard(String);

/// Shards of a work, at the most: each is a file and a row of what is missing.
const MOST: u64 = 100_000;

impl Shard {
    /// The whole work.
    pub const WHOLE: Self = Self { index: 1, of: 1 };

    /// Its units of `all`: ranges of shards follow each other, and their lengths differ by one at the most.
    #[must_use]
    pub fn range(self, all: u64) -> Range<u64> {
        // ⌊all · i / n⌋; the product of two u64 may need 128 bits, the quotient is at most `all`.
        let end = |i: u64| (u128::from(all) * u128::from(i) / u128::from(self.of)) as u64;
        end(self.index - 1)..end(self.index)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

impl FromStr for Shard {
    type Err = NotAShard;

    fn from_str(text: &str) -> Result<Self, NotAShard> {
        let bad = || NotAShard(text.to_owned());
        let (index, of) = text.split_once('/').ok_or_else(bad)?;
        let number = |text: &str| {
            let digits = text.bytes().all(|b| b.is_ascii_digit());
            digits.then(|| text.parse::<u64>().ok()).flatten()
        };
        let index = number(index).ok_or_else(bad)?;
        let of = number(of).ok_or_else(bad)?;
        match (1..=of).contains(&index) && of <= MOST {
            true => Ok(Self { index, of }),
            false => Err(bad()),
        }
    }
}

/// What must be the same for shards to belong together.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Identity {
    /// What is done: `cor`, `twin`, `batch`.
    pub kind: String,
    /// Seed of all draws; 0 where nothing is drawn.
    pub seed: u64,
    /// SHA-256 of the settings and of everything that is read.
    pub inputs: String,
    /// Units of the whole work: parts of scenes, cases, trials, robots.
    pub units: u64,
    /// Version of the program.
    pub version: String,
}

/// Facts of a shard's footer.
pub(crate) const KIND: &str = "calib.kind";
pub(crate) const SEED: &str = "calib.seed";
pub(crate) const INPUTS: &str = "calib.inputs";
pub(crate) const UNITS: &str = "calib.units";
pub(crate) const VERSION: &str = "calib.version";
pub(crate) const SHARD: &str = "calib.shard";

impl Identity {
    /// As a footer states it.
    pub(crate) fn facts(&self, shard: Shard) -> BTreeMap<String, String> {
        let facts = [
            (KIND, self.kind.clone()),
            (SEED, self.seed.to_string()),
            (INPUTS, self.inputs.clone()),
            (UNITS, self.units.to_string()),
            (VERSION, self.version.clone()),
            (SHARD, shard.to_string()),
        ];
        let owned = facts
            .into_iter()
            .map(|(key, value)| (key.to_owned(), value));
        owned.collect()
    }

    /// As a footer stated it; the name of the fact that is not there or cannot be read.
    pub(crate) fn of(facts: &BTreeMap<String, String>) -> Result<(Self, Shard), &'static str> {
        let text = |key: &'static str| facts.get(key).ok_or(key);
        let number = |key: &'static str| text(key)?.parse::<u64>().map_err(|_| key);
        let identity = Self {
            kind: text(KIND)?.clone(),
            seed: number(SEED)?,
            inputs: text(INPUTS)?.clone(),
            units: number(UNITS)?,
            version: text(VERSION)?.clone(),
        };
        let shard = text(SHARD)?.parse().map_err(|_| SHARD)?;
        Ok((identity, shard))
    }

    /// The first thing that differs: what it is, here and there.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Option<Difference> {
        let pairs = [
            (Of::Kind, self.kind.clone(), other.kind.clone()),
            (Of::Version, self.version.clone(), other.version.clone()),
            (Of::Seed, self.seed.to_string(), other.seed.to_string()),
            (Of::Units, self.units.to_string(), other.units.to_string()),
            (Of::Inputs, self.inputs.clone(), other.inputs.clone()),
        ];
        let mut pairs = pairs.into_iter();
        let (of, found, expected) = pairs.find(|(_, a, b)| a != b)?;
        Some(Difference {
            of,
            found,
            expected,
        })
    }
}

/// In what two works differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Of {
    /// What is done.
    Kind,
    /// Version of the program.
    Version,
    /// Seed of all draws.
    Seed,
    /// How many units there are.
    Units,
    /// Checksum of settings and inputs.
    Inputs,
    /// Into how many shards it is divided.
    Shards,
}

/// How two works differ.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// In what.
    pub of: Of,
    /// In this one.
    pub found: String,
    /// In the other ones.
    pub expected: String,
}

impl Of {
    /// In words, without an article.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Kind => "kind of work",
            Self::Version => "version of calib",
            Self::Seed => "seed",
            Self::Units => "number of units",
            Self::Inputs => "checksum of settings and inputs",
            Self::Shards => "number of shards",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_follow_each_other_and_are_alike() {
        for of in [1, 2, 7, 64, 1000] {
            for all in [0, 1, 6, 64, 997, u64::MAX] {
                let ranges: Vec<_> = (1..=of)
                    .map(|index| Shard { index, of }.range(all))
                    .collect();
                assert_eq!((ranges[0].start, ranges[ranges.len() - 1].end), (0, all));
                assert!(ranges.windows(2).all(|w| w[0].end == w[1].start));
                let lengths = || ranges.iter().map(|r| r.end - r.start);
                assert!(lengths().max().unwrap() - lengths().min().unwrap() <= 1);
            }
        }
    }

    #[test]
    fn a_shard_is_read_strictly() {
        assert_eq!("3/64".parse(), Ok(Shard { index: 3, of: 64 }));
        for bad in [
            "", "3", "0/4", "5/4", "1/0", "+1/2", "1/-2", "1/2/3", "1/100001", "1 /2",
        ] {
            assert_eq!(bad.parse::<Shard>(), Err(NotAShard(bad.to_owned())));
        }
    }
}
