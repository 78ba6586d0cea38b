//! Object stores: where workers without a common disk leave their shards.
//!
//! ```text
//! worker 1 ── cor-1-of-64.parquet ──►┐
//! worker 2 ── cor-2-of-64.parquet ──►│ s3://bucket/run ──► merge
//! …                                  ┘
//! ```
//!
//! An object is there whole or not at all, as the stores promise; a shard that was written twice has the same bytes both times. What is fetched is checked
//! as any other file of a shard. Built with the feature `object-store`; without it every address is refused.

pub(crate) mod error;
#[cfg(feature = "object-store")]
mod remote;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

pub use error::{StoreError, StoreFault};

use crate::error::FleetError;

/// Fetches that wait for the store at a time.
const AT_A_TIME: usize = 8;

/// Objects below one address.
#[derive(Debug)]
pub struct Store {
    url: String,
    #[cfg(feature = "object-store")]
    remote: remote::Remote,
}

impl Store {
    /// `s3://BUCKET/PREFIX`, with the keys, region and endpoint of the environment variables `AWS_…`, or `file:///FOLDER`. Nothing is asked of it yet.
    ///
    /// # Errors
    /// [`StoreFault::Address`], [`StoreFault::NotBuilt`].
    pub fn open(url: &str) -> Result<Self, StoreError> {
        let url = url.trim_end_matches('/');
        #[cfg(feature = "object-store")]
        return Ok(Self {
            url: url.to_owned(),
            remote: remote::Remote::open(url)?,
        });
        #[cfg(not(feature = "object-store"))]
        return Err(StoreError::new(url, StoreFault::NotBuilt));
    }

    /// The address of an object.
    #[must_use]
    pub fn address(&self, name: &str) -> String {
        format!("{}/{name}", self.url)
    }

    /// The names of all shards that it holds, sorted; what lies in deeper folders is not looked at.
    ///
    /// # Errors
    /// [`StoreError`]; [`StoreFault::Empty`].
    pub fn shards(&self) -> Result<Vec<String>, StoreError> {
        let mut names = self.names()?;
        names.retain(|name| name.ends_with(".parquet"));
        names.sort();
        match names.is_empty() {
            true => Err(StoreError::new(&self.url, StoreFault::Empty)),
            false => Ok(names),
        }
    }
}

impl Store {
    /// Fetches all shards into a folder, several at a time; returns their files in the order of their names. `progress(done, total)` counts shards
    /// and is called from any thread.
    ///
    /// # Errors
    /// [`FleetError::Store`], [`FleetError::File`].
    pub fn fetch_all(
        &self,
        folder: &Path,
        progress: &(dyn Fn(u64, u64) + Sync),
    ) -> Result<Vec<PathBuf>, FleetError> {
        let names = self.shards()?;
        let (done, total) = (AtomicU64::new(0), names.len() as u64);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(AT_A_TIME)
            .build();
        let pool = pool.map_err(|source| FleetError::Threads {
            threads: AT_A_TIME,
            source,
        })?;
        let one = |name: &String| {
            let path = folder.join(name);
            self.fetch(name, &path)?;
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, total);
            Ok(path)
        };
        pool.install(|| names.par_iter().with_max_len(1).map(one).collect())
    }
}

#[cfg(feature = "object-store")]
impl Store {
    fn names(&self) -> Result<Vec<String>, StoreError> {
        let failed = |fault| StoreError::new(&self.url, fault);
        self.remote.names().map_err(failed)
    }

    /// Whether there is an object of this name.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn holds(&self, name: &str) -> Result<bool, StoreError> {
        let failed = |fault| StoreError::new(&self.address(name), fault);
        self.remote.holds(name).map_err(failed)
    }

    /// Writes an object to a file that must not exist, whole or not at all.
    ///
    /// # Errors
    /// [`FleetError::Store`], [`FleetError::File`].
    pub fn fetch(&self, name: &str, to: &Path) -> Result<(), FleetError> {
        calib_files::write_pieces(to, |sink| {
            let failed = |fault| FleetError::Store(StoreError::new(&self.address(name), fault));
            self.remote.fetch(name, sink).map_err(failed)
        })
    }

    /// Writes a file to the store, in place of an object of the same name.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn put(&self, from: &Path, name: &str) -> Result<(), StoreError> {
        let failed = |fault| StoreError::new(&self.address(name), fault);
        self.remote.put(from, name).map_err(failed)
    }
}

/// A store that cannot be opened is never asked.
#[cfg(not(feature = "object-store"))]
impl Store {
    fn not_built(&self) -> StoreError {
        StoreError::new(&self.url, StoreFault::NotBuilt)
    }

    fn names(&self) -> Result<Vec<String>, StoreError> {
        Err(self.not_built())
    }

    /// Whether there is an object of this name.
    ///
    /// # Errors
    /// [`StoreFault::NotBuilt`].
    pub fn holds(&self, _: &str) -> Result<bool, StoreError> {
        Err(self.not_built())
    }

    /// Writes an object to a file that must not exist, whole or not at all.
    ///
    /// # Errors
    /// [`StoreFault::NotBuilt`].
    pub fn fetch(&self, _: &str, _: &Path) -> Result<(), FleetError> {
        Err(self.not_built().into())
    }

    /// Writes a file to the store, in place of an object of the same name.
    ///
    /// # Errors
    /// [`StoreFault::NotBuilt`].
    pub fn put(&self, _: &Path, _: &str) -> Result<(), StoreError> {
        Err(self.not_built())
    }
}
