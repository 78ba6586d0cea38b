//! Shards put together: the same bytes as the work done at once.
//!
//! ```text
//! footers of all shards ──► one work, each part once ──► rows of 1/n, 2/n, …, n/n ──► file
//! ```
//!
//! One shard is open at a time. It is read, and its checksum computed, while the part before it is written: in memory are a group of
//! rows that is read, one that is written, and few pieces between them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc;

use crate::error::{FleetError, ShardError, ShardFault};
use crate::shard::{Difference, Identity, Of, Shard};
use crate::shard_file::{Finished, ShardFile, write_shard};

/// Bytes of results that the reader hands over at a time: some thousand times what handing them over costs.
const PIECE: usize = 1 << 20;
/// What a unit takes besides its result.
const UNIT: usize = 64;
/// Pieces that wait for the writer.
const AHEAD: usize = 4;

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
    std::thread::scope(|scope| {
        let (sender, read) = mpsc::sync_channel(AHEAD);
        scope.spawn(move || send(&order, &sender));
        let mut found = 0;
        let mut units = read.into_iter().flatten();
        let counted = std::iter::from_fn(|| match units.next() {
            Some(Ok(unit)) => {
                found = unit.unit + 1;
                progress(found, total);
                Some(Ok(unit))
            }
            Some(Err(error)) => Some(Err(error)),
            // The reader ended before it said why.
            None if found < total => {
                let fault = ShardFault::Rows {
                    expected: total,
                    found,
                };
                Some(Err(FleetError::unusable(out, fault)))
            }
            None => None,
        });
        write_shard(out, (&identity, Shard::WHOLE), counted)
    })?;
    Ok(Merged {
        identity,
        shards: of,
    })
}

type Piece = Vec<Result<Finished, FleetError>>;

/// Reads the shards one after another, until there are no more, one is not whole, or nobody listens.
fn send(order: &[PathBuf], to: &mpsc::SyncSender<Piece>) {
    for path in order {
        let mut file = match ShardFile::open(path) {
            Ok(file) => file,
            Err(error) => {
                let _ = to.send(vec![Err(error.into())]);
                return;
            }
        };
        // The iterator of a shard ends with its checksum: a changed byte stops the file before it gets its name.
        loop {
            let (mut piece, mut bytes) = (Piece::new(), 0);
            while bytes < PIECE {
                let Some(unit) = file.next() else {
                    break;
                };
                bytes += unit.as_ref().map_or(PIECE, |unit| unit.result.len() + UNIT);
                piece.push(unit.map_err(FleetError::from));
            }
            let failed = piece.last().is_some_and(Result::is_err);
            let ended = piece.is_empty();
            if ended {
                break;
            }
            if to.send(piece).is_err() || failed {
                return;
            }
        }
    }
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
