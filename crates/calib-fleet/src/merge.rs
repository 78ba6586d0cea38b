//! Shards put together: the same bytes as the work done at once.
//!
//! ```text
//! footers of all shards ──► one work, each part once ──► rows of 1/n, 2/n, …, n/n ──► file
//! ```
//!
//! One group of rows is held in memory, and one shard is open at a time.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::error::{FleetError, ShardError, ShardFault};
use crate::shard::{Difference, Identity, Of, Shard};
use crate::shard_file::{ShardFile, write_shard};

/// What was merged.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Merged {
    /// The work.
    pub identity: Identity,
    /// Shards that there were.
    pub shards: u64,
}

/// Merges all shards of a work into a file. `progress(done, total)` counts units.
///
/// # Errors
/// [`FleetError::Shard`] with the file for a shard that is torn, doubled or of another work; [`FleetError::Missing`]; nothing is written
/// then.
pub fn merge(
    files: &[PathBuf],
    out: &Path,
    progress: &dyn Fn(u64, u64),
) -> Result<Merged, FleetError> {
    let mut known = Vec::new();
    for path in files {
        let file = ShardFile::open(path)?;
        known.push((path.as_path(), file.identity, file.shard));
    }
    let Some((identity, of)) = of_most(&known) else {
        return Err(FleetError::NoShards);
    };
    let order = ordered(&known, (&identity, of))?;
    let total = identity.units;
    let units = order.iter().flat_map(|path| {
        // The iterator of a shard ends with its checksum: a changed byte stops the file before it gets its name.
        let (opened, failed) = match ShardFile::open(path) {
            Ok(file) => (Some(file), None),
            Err(error) => (None, Some(Err(error))),
        };
        failed.into_iter().chain(opened.into_iter().flatten())
    });
    let counted = units.map(|unit| {
        let unit = unit?;
        progress(unit.unit + 1, total);
        Ok(unit)
    });
    write_shard(out, (&identity, Shard::WHOLE), counted)?;
    Ok(Merged {
        identity,
        shards: of,
    })
}

type Known<'a> = (&'a Path, Identity, Shard);

/// The work that most of the files belong to, the first of equals.
fn of_most(known: &[Known<'_>]) -> Option<(Identity, u64)> {
    let mut counts: BTreeMap<(&Identity, u64), usize> = BTreeMap::new();
    for (_, identity, shard) in known {
        *counts.entry((identity, shard.of)).or_default() += 1;
    }
    let most = counts.values().copied().max()?;
    let first = known
        .iter()
        .map(|(_, identity, shard)| (identity, shard.of));
    let mut first = first.filter(|key| counts.get(key) == Some(&most));
    first.next().map(|(identity, of)| (identity.clone(), of))
}

/// The files in the order of their parts, each part once.
fn ordered(
    known: &[Known<'_>],
    (identity, of): (&Identity, u64),
) -> Result<Vec<PathBuf>, FleetError> {
    let mut parts: BTreeMap<u64, &Path> = BTreeMap::new();
    for (path, other, shard) in known {
        let shards = || {
            (shard.of != of).then(|| Difference {
                of: Of::Shards,
                found: shard.of.to_string(),
                expected: of.to_string(),
            })
        };
        if let Some(difference) = other.difference(identity).or_else(shards) {
            return Err(ShardError::new(path, ShardFault::Foreign(difference)).into());
        }
        if let Some(first) = parts.insert(shard.index, path) {
            let fault = ShardFault::Doubled {
                shard: *shard,
                first: first.to_path_buf(),
            };
            return Err(ShardError::new(path, fault).into());
        }
    }
    let missing: Vec<u64> = (1..=of).filter(|i| !parts.contains_key(i)).collect();
    if !missing.is_empty() {
        return Err(FleetError::Missing {
            kind: identity.kind.clone(),
            missing,
            of,
        });
    }
    Ok(parts.into_values().map(Path::to_path_buf).collect())
}
