//! A fleet: every robot calibrated, one row each, and what drifts in which series.
//!
//! ```text
//! members ── one (in parallel, each on one thread) ──► OUT/robots/NAME ── rows in order ──► statistics, files
//! ```
//!
//! A robot that cannot be calibrated is a row with its error. Rows are read one after another at the end: memory does not grow with the
//! number of robots but for the tables themselves.

mod error;
mod files;
mod members;
mod one;
mod page;
mod row;
mod statistics;
mod summary;
mod words;

pub use error::{BatchError, FleetFault};
pub use files::Files;
pub use members::{Member, members};
pub use one::{How, Keep};
pub use row::{Drifted, Failure, JointDrift, Quantity, Robot};
pub use statistics::{Alarm, FALSE_ALARMS, SeriesJoint, Statistics};
pub use summary::Summary;
pub use words::text;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use calib_files::ResultsFolder;

use crate::error::FleetError;
use crate::shard::{Identity, Shard};
use crate::shard_file::{Finished, ShardFile, file_name, write_shard};
use crate::store::Store;
use crate::work::{Kept, results};

/// The folder of the robots' folders.
const ROBOTS: &str = "robots";
/// The work in names of files and footers.
const KIND: &str = "batch";

/// Whether a shard of this work that is there was made from other files than those of the robots now. One of another work is refused, one that cannot be
/// read where it is merged.
fn changed(path: &Path, identity: &Identity, members: &[Member]) -> bool {
    let file = ShardFile::open(path).ok();
    let Some(file) = file.filter(|file| file.identity == *identity) else {
        return false;
    };
    let rows = file.filter_map(|unit| serde_json::from_str::<Robot>(&unit.ok()?.result).ok());
    let mut all = rows.zip(members);
    all.any(|(robot, member)| one::changed(member, &robot).is_some())
}

/// A batch.
pub struct Batch<'a> {
    /// The robots.
    pub members: &'a [Member],
    /// How they are calibrated.
    pub how: How<'a>,
    /// The folder to write to.
    pub out: &'a Path,
    /// Robots at a time; `None`: as many as there are processors.
    pub jobs: Option<usize>,
}

/// Called with the number of finished robots and of all, from any thread.
pub type Progress<'a> = &'a (dyn Fn(u64, u64) + Sync);

impl Batch<'_> {
    /// The work that shards of this batch belong to.
    #[must_use]
    pub fn identity(&self) -> Identity {
        use sha2::{Digest as _, Sha256};
        let mut text = format!("{} {:?}\n", self.how.settings(), self.how.keep);
        for member in self.members {
            let series = member.series.as_deref().unwrap_or_default();
            let profile = one::sha256_of(&member.profile).unwrap_or_default();
            let compared = member.earlier.is_some();
            // Writing to a String does not fail.
            let _ = writeln!(text, "{:?} {series:?} {profile} {compared}", member.name);
        }
        let digest = Sha256::digest(text.as_bytes());
        Identity {
            kind: KIND.to_owned(),
            seed: 0,
            inputs: digest.iter().map(|byte| format!("{byte:02x}")).collect(),
            units: self.members.len() as u64,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }

    /// Calibrates all robots that are not calibrated yet, and writes the tables and the page.
    ///
    /// # Errors
    /// [`BatchError`]; robots that are finished are kept.
    pub fn run(&self, progress: Progress<'_>) -> Result<Files, BatchError> {
        let folder = ResultsFolder::open(self.out)?;
        self.calibrate(self.members, progress)?;
        let rows = self.members.iter().map(|member| self.row(member));
        let mut files = files::Writing::new(folder, self.out)?;
        for row in rows {
            files.add(&row?)?;
        }
        files.write()
    }

    /// Writes the tables and the page from merged shards, without calibrating.
    ///
    /// # Errors
    /// [`BatchError`] where they are not those of this batch, or of files that are others now.
    pub fn from(&self, merged: &Path) -> Result<Files, BatchError> {
        let folder = ResultsFolder::open(self.out)?;
        let mut files = files::Writing::new(folder, self.out)?;
        for (place, robot) in results::<Robot>(merged, &self.identity())?.enumerate() {
            let robot = robot?;
            let member = self.members.get(place);
            if let Some(path) = member.and_then(|member| one::changed(member, &robot)) {
                return Err(BatchError::Changed {
                    robot: robot.name,
                    path,
                });
            }
            files.add(&robot)?;
        }
        files.write()
    }

    /// Calibrates the robots of one shard and writes its file, which is returned, and which is left in the `store` as well.
    ///
    /// # Errors
    /// [`BatchError`]; robots that are finished are kept.
    pub fn shard(
        &self,
        shard: Shard,
        store: Option<&Store>,
        progress: Progress<'_>,
    ) -> Result<PathBuf, BatchError> {
        let identity = self.identity();
        let name = file_name(KIND, shard);
        let folder = self.out.join(&name).with_extension("");
        let path = folder.join(name);
        let _locked = ResultsFolder::open(&folder)?;
        let kept = Kept {
            path: &path,
            identity: &identity,
            store,
        };
        let range = shard.range(identity.units);
        let place = |unit: u64| usize::try_from(unit).unwrap_or(usize::MAX);
        let members = &self.members[place(range.start)..place(range.end)];
        let again = self.how.restart || changed(&path, &identity, members);
        if kept.is_there(!again)? {
            return Ok(path);
        }
        self.calibrate(members, progress)?;
        let units = range.zip(members).map(|(unit, member)| {
            let row = self.row(member).map_err(|error| match error {
                BatchError::Work(error) => error,
                BatchError::Fleet { fleet, .. } => FleetError::Lost { path: fleet.into() },
                BatchError::Changed { path, .. } => FleetError::Lost { path },
            })?;
            Ok(Finished {
                unit,
                name: row.name.clone(),
                result: serde_json::to_string(&row)?,
            })
        });
        write_shard(&path, (&identity, shard), units)?;
        kept.leave()?;
        Ok(path)
    }

    fn row(&self, member: &Member) -> Result<Robot, BatchError> {
        let folder = one::folder(self.out, member);
        let lost = || FleetError::Lost {
            path: folder.clone(),
        };
        Ok(one::row(&folder).ok_or_else(lost)?)
    }

    /// Robots in parallel, each on one thread of its own: a run that waits for a part of itself does not begin another robot, which would
    /// hold the memory of both.
    fn calibrate(&self, members: &[Member], progress: Progress<'_>) -> Result<(), BatchError> {
        /// As that of a program's first thread.
        const STACK: usize = 8 << 20;
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let jobs = self
            .jobs
            .unwrap_or_else(cores)
            .clamp(1, members.len().max(1));
        let pool = || {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(1)
                .stack_size(STACK);
            pool.build().map_err(|source| FleetError::Threads {
                threads: jobs,
                source,
            })
        };
        let pools: Vec<rayon::ThreadPool> = (0..jobs).map(|_| pool()).collect::<Result<_, _>>()?;
        let (next, done) = (AtomicU64::new(0), AtomicU64::new(0));
        let stopped = AtomicBool::new(false);
        let failed: Mutex<Option<BatchError>> = Mutex::new(None);
        let total = members.len() as u64;
        let work = || {
            while !stopped.load(Ordering::SeqCst) {
                let place = usize::try_from(next.fetch_add(1, Ordering::SeqCst));
                let Some(member) = place.ok().and_then(|place| members.get(place)) else {
                    return;
                };
                let folder = one::folder(self.out, member);
                if let Err(error) = self.how.robot(member, &folder) {
                    stopped.store(true, Ordering::SeqCst);
                    let mut first = failed.lock().unwrap_or_else(PoisonError::into_inner);
                    first.get_or_insert(error);
                    return;
                }
                progress(done.fetch_add(1, Ordering::SeqCst) + 1, total);
            }
        };
        std::thread::scope(|scope| {
            for pool in &pools {
                scope.spawn(|| pool.install(work));
            }
        });
        let failed = failed.into_inner().unwrap_or_else(PoisonError::into_inner);
        failed.map_or(Ok(()), Err)
    }
}
