//! Options of commands whose work other machines can share: `--shard` and `--from`.

use std::path::{Path, PathBuf};

use calib_fleet::FleetError;
use calib_fleet::shard::{Identity, Shard};
use calib_fleet::store::Store;
use calib_fleet::work::{Asked, Unit, run_shard};
use calib_pipeline::ExitCode;
use calib_urdf::sha256_hex;
use clap::Args;

use crate::error::CliError;
use crate::terminal::{Console, Counted, emit_paths};

/// Which part of the work is done here.
#[derive(Debug, Args)]
pub struct ShardOptions {
    /// Do part I of N only (`3/64`), and write its results to a file for `calib merge`
    #[arg(long, value_name = "I/N", conflicts_with = "from")]
    pub shard: Option<Shard>,
    /// Take the results from a file of `calib merge` instead of computing them
    #[arg(long, value_name = "FILE")]
    pub from: Option<PathBuf>,
    /// Leave the file of the shard in an object store as well, s3://BUCKET/PREFIX, or take it from there
    #[arg(long, value_name = "URL", requires = "shard")]
    store: Option<String>,
}

impl ShardOptions {
    /// The store, where there is one.
    pub fn store(&self) -> Result<Option<Store>, CliError> {
        let store = self.store.as_deref().map(Store::open).transpose();
        Ok(store.map_err(FleetError::from)?)
    }
}

/// The work that shards belong to.
pub fn identity(kind: &str, seed: u64, units: u64, settings: &str) -> Identity {
    Identity {
        kind: kind.to_owned(),
        seed,
        inputs: sha256_hex(settings.as_bytes()),
        units,
        version: env!("CARGO_PKG_VERSION").to_owned(),
    }
}

/// How a shard is made.
pub struct Making<'a> {
    /// The work.
    pub identity: &'a Identity,
    /// The folder.
    pub out: &'a Path,
    /// Keep what is finished.
    pub resume: bool,
    /// Threads.
    pub threads: Option<usize>,
    /// Where the file is left as well.
    pub store: Option<&'a Store>,
    /// What is counted, in words.
    pub counted: &'static str,
}

/// Makes a shard and prints its file.
pub fn make(
    console: &Console,
    shard: Shard,
    making: &Making<'_>,
    one: Unit<'_>,
) -> Result<ExitCode, CliError> {
    let asked = Asked {
        identity: making.identity,
        shard,
        out: making.out,
        resume: making.resume,
        threads: making.threads,
        store: making.store,
    };
    let bar = Counted::new(console, making.counted);
    let path = run_shard(&asked, one, &|done, total| bar.at(done, total))?;
    bar.end();
    emit_paths(console.json, &[path])?;
    Ok(ExitCode::Accepted)
}
