//! One shard of a work: its units in parallel, what is finished kept, one file at the end.
//!
//! ```text
//! OUT/cor-3-of-64/                      locked while the shard runs
//!     state.jsonl                       finished units, until the file is there
//!     cor-3-of-64.parquet               all of them, whole or not there
//! ```
//!
//! Where machines have no disk in common, the file is also left in a store: `STORE/cor-3-of-64.parquet`.
//!
//! A unit's result depends on its number and the settings only, so a shard that was stopped anywhere and runs again ends with the same
//! bytes as one that was not stopped.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use calib_files::{FileError, ResultsFolder, StateFile};
use rayon::prelude::*;
use serde::Serialize;

use crate::error::{FleetError, ShardError, ShardFault};
use crate::shard::{Identity, Shard};
use crate::shard_file::{Finished, ShardFile, file_name, write_shard};
use crate::store::{Store, StoreError, StoreFault};

/// Name of the file of finished units.
const STATE: &str = "state.jsonl";

/// Which shard is made, and where.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    /// The work.
    pub identity: &'a Identity,
    /// Which part of it.
    pub shard: Shard,
    /// The folder in which the shard has a folder of its own.
    pub out: &'a Path,
    /// Keep what is finished.
    pub resume: bool,
    /// Threads; `None`: as many as there are processors.
    pub threads: Option<usize>,
    /// Where the file is left as well, and taken from if it is there already.
    pub store: Option<&'a Store>,
}

/// What must be the same for finished units to be kept.
#[derive(Serialize)]
struct Header<'a> {
    calib_shard: u32,
    shard: String,
    work: &'a Identity,
}

/// Name and result, as JSON, of a unit.
pub type Unit<'a> = &'a (dyn Fn(u64) -> Result<(String, String), serde_json::Error> + Sync);

impl Asked<'_> {
    /// The folder of the shard.
    #[must_use]
    pub fn folder(&self) -> PathBuf {
        self.out
            .join(file_name(&self.identity.kind, self.shard))
            .with_extension("")
    }

    /// The file of the shard.
    #[must_use]
    pub fn file(&self) -> PathBuf {
        let name = file_name(&self.identity.kind, self.shard);
        self.folder().join(name)
    }
}

/// Makes a shard and returns its file; a shard that is there already, or in the store, is only checked. `progress(done, total)` counts units and
/// is called from any thread.
///
/// # Errors
/// [`FileError::Busy`] while another process makes this shard; [`FileError::OtherState`] where the folder holds one of another work;
/// [`FleetError::Store`].
pub fn run_shard(
    asked: &Asked<'_>,
    one: Unit<'_>,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<PathBuf, FleetError> {
    let (folder, path) = (asked.folder(), asked.file());
    let _locked = ResultsFolder::open(&folder)?;
    let state = folder.join(STATE);
    let kept = Kept {
        path: &path,
        identity: asked.identity,
        store: asked.store,
    };
    if !kept.is_there(asked.resume)? {
        let units = finished(asked, &state, one, progress)?;
        let units = units.into_values().map(Ok);
        write_shard(&path, (asked.identity, asked.shard), units)?;
        kept.leave()?;
    }
    if state.exists() {
        calib_files::remove(&state)?;
    }
    Ok(path)
}

/// Where the file of a shard is kept.
pub(crate) struct Kept<'a> {
    /// The file.
    pub(crate) path: &'a Path,
    /// The work.
    pub(crate) identity: &'a Identity,
    /// See [`Asked::store`].
    pub(crate) store: Option<&'a Store>,
}

impl Kept<'_> {
    fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    }

    /// Whether the shard is there, here and in the store; one of another work is refused. Not to `resume` removes it here first.
    pub(crate) fn is_there(&self, resume: bool) -> Result<bool, FleetError> {
        if !resume && self.path.exists() {
            calib_files::remove(self.path)?;
        }
        if self.path.exists() {
            is_this(self.identity, self.path)?;
            // A call that was stopped between file and store is repeated.
            self.leave()?;
            return Ok(true);
        }
        let name = self.name();
        let Some(store) = self.store.filter(|_| resume) else {
            return Ok(false);
        };
        if !store.holds(&name)? {
            return Ok(false);
        }
        store.fetch(&name, self.path)?;
        if let Err(error) = is_this(self.identity, self.path) {
            calib_files::remove(self.path)?;
            let why = error.to_string();
            let why = why.lines().next().unwrap_or_default();
            let here = format!("{}: ", self.path.display());
            let why = why.strip_prefix(&here).unwrap_or(why).to_owned();
            let fault = StoreFault::Foreign(why);
            return Err(StoreError::new(&store.address(&name), fault).into());
        }
        Ok(true)
    }

    /// Leaves the file in the store.
    pub(crate) fn leave(&self) -> Result<(), FleetError> {
        let left = self.store.map(|store| store.put(self.path, &self.name()));
        Ok(left.unwrap_or(Ok(()))?)
    }
}

/// Reads the file that is there to its end.
fn is_this(identity: &Identity, path: &Path) -> Result<(), FleetError> {
    let file = ShardFile::open(path)?;
    if let Some(difference) = file.identity.difference(identity) {
        return Err(FileError::OtherState {
            path: path.to_path_buf(),
            found: format!("the {} `{}`", difference.of.word(), difference.found),
            expected: format!("`{}`", difference.expected),
        }
        .into());
    }
    for unit in file {
        unit?;
    }
    Ok(())
}

/// All units of the shard, those of the state file included.
fn finished(
    asked: &Asked<'_>,
    state: &Path,
    one: Unit<'_>,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<BTreeMap<u64, Finished>, FleetError> {
    let range = asked.shard.range(asked.identity.units);
    let total = range.end - range.start;
    let header = serde_json::to_string(&Header {
        calib_shard: 1,
        shard: asked.shard.to_string(),
        work: asked.identity,
    })?;
    let parsed = |line: &str| serde_json::from_str::<Finished>(line).ok();
    let opened = StateFile::open(state, &header, asked.resume, |line| parsed(line).is_some());
    let (file, lines) = opened?;
    let known = lines.iter().filter_map(|line| parsed(line));
    let known = known.filter(|unit| range.contains(&unit.unit));
    let known: BTreeMap<u64, Finished> = known.map(|unit| (unit.unit, unit)).collect();
    let left: Vec<u64> = range.filter(|unit| !known.contains_key(unit)).collect();
    let done = AtomicU64::new(known.len() as u64);
    progress(known.len() as u64, total);
    let kept = Mutex::new((file, known));
    let step = |&unit: &u64| -> Result<(), FleetError> {
        let (name, result) = one(unit)?;
        let finished = Finished { unit, name, result };
        let line = serde_json::to_string(&finished)?;
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.0.append(&line)?;
        kept.1.insert(unit, finished);
        drop(kept);
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, total);
        Ok(())
    };
    let threads = asked.threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|source| FleetError::Threads { threads, source })?;
    pool.install(|| left.par_iter().with_max_len(1).try_for_each(step))?;
    let kept = kept.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(kept.1)
}

/// The results of a whole work in their order, from the file of its only shard or of its merged ones.
///
/// # Errors
/// [`ShardError`] for a file that is a part of the work only, or belongs to another work, or cannot be read to its end.
pub fn whole(
    path: &Path,
    identity: &Identity,
) -> Result<impl Iterator<Item = Result<Finished, ShardError>>, ShardError> {
    let file = ShardFile::open(path)?;
    if file.shard != Shard::WHOLE {
        return Err(ShardError::new(path, ShardFault::Part(file.shard)));
    }
    if let Some(difference) = file.identity.difference(identity) {
        return Err(ShardError::new(path, ShardFault::OtherWork(difference)));
    }
    Ok(file)
}

/// As [`whole`], each result read from its JSON.
///
/// # Errors
/// As [`whole`]; [`ShardFault::Result`].
pub fn results<T: serde::de::DeserializeOwned>(
    path: &Path,
    identity: &Identity,
) -> Result<impl Iterator<Item = Result<T, ShardError>>, ShardError> {
    let read = |unit: Result<Finished, ShardError>| {
        let Finished { unit, result, .. } = unit?;
        serde_json::from_str(&result)
            .map_err(|source| ShardError::new(path, ShardFault::Result { unit, source }))
    };
    Ok(whole(path, identity)?.map(read))
}
