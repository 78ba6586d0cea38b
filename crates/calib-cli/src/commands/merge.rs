//! `calib merge`.

use std::path::{Path, PathBuf};

use calib_files::ScratchFolder;
use calib_fleet::merge::merge;
use calib_fleet::store::Store;
use calib_fleet::{FleetError, ShardFault};
use calib_pipeline::ExitCode;
use clap::Args;

use crate::error::CliError;
use crate::terminal::{Console, Counted, emit_paths};

/// Arguments of `calib merge`.
#[derive(Debug, Args)]
pub struct Merge {
    /// Files of all shards, in any order
    #[arg(required_unless_present = "store", value_name = "SHARD")]
    shards: Vec<PathBuf>,
    /// Take the shards that an object store holds as well: s3://BUCKET/PREFIX
    #[arg(long, value_name = "URL")]
    store: Option<String>,
    /// File to write, which must not exist
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
}

/// The shards of a store, until they are read.
struct Fetched {
    store: Store,
    scratch: ScratchFolder,
}

impl Fetched {
    /// Where a file came from.
    fn origin(&self, path: &Path) -> PathBuf {
        let name = path
            .file_name()
            .filter(|_| path.starts_with(self.scratch.path()));
        name.map_or_else(
            || path.to_path_buf(),
            |name| PathBuf::from(self.store.address(&name.to_string_lossy())),
        )
    }

    /// An error about a file that was fetched names the object: the file is gone by then.
    fn told(&self, error: FleetError) -> FleetError {
        match error {
            FleetError::Shard(mut error) => {
                error.path = self.origin(&error.path);
                if let ShardFault::Doubled { first, .. } = &mut *error.fault {
                    *first = self.origin(first);
                }
                FleetError::Shard(error)
            }
            other => other,
        }
    }
}

/// Merges shards.
pub fn run(console: &Console, options: &Merge) -> Result<ExitCode, CliError> {
    let mut shards = options.shards.clone();
    let fetched = match &options.store {
        Some(url) => {
            let store = Store::open(url).map_err(FleetError::from)?;
            let scratch = ScratchFolder::beside(&options.out)?;
            let bar = Counted::new(console, "shards fetched");
            let progress = |done, total| bar.at(done, total);
            shards.extend(store.fetch_all(scratch.path(), &progress)?);
            bar.end();
            Some(Fetched { store, scratch })
        }
        None => None,
    };
    let bar = Counted::new(console, "results");
    let merged = merge(&shards, &options.out, &|done, total| bar.at(done, total));
    merged.map_err(|error| match &fetched {
        Some(fetched) => fetched.told(error),
        None => error,
    })?;
    bar.end();
    emit_paths(console.json, std::slice::from_ref(&options.out))?;
    Ok(ExitCode::Accepted)
}
