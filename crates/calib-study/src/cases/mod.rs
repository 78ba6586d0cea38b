//! `calib study justin|ripley`: a case study over many simulated robots, in the layout of the paper's Tables 1 and 2.
//!
//! Each robot is another draw of the profile's `simulate` section (its own errors, its own noise), calibrated by both methods as
//! `calib run` does it. What the paper could only compare with the robot's own kinematics is compared with the truth beside it.
//! Robot k has the seed `seed + k`: the result does not depend on the number of threads, nor on where the study was interrupted.

mod error;
mod render;
mod repeat;
mod state;
mod units;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use calib_pipeline::prepare::load::{RobotProfile, of_tables};
use calib_pipeline::run::{Plugins, RunOptions, run_on};
use calib_profile::Method;
use calib_report::{LoopClosure, Report, Stats};
use calib_sim::Simulated;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use error::CaseError;
pub use render::{csv, json, markdown, svg};
use state::State;
pub use units::Units;

/// Both ways of solving.
const METHODS: [(Method, &str); 2] = [(Method::Paper, "paper"), (Method::Ml, "ml")];

/// Settings of a case study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CaseOptions {
    /// The robot's profile, with a `simulate` section.
    pub profile: PathBuf,
    /// Name of the study, the stem of its files: `justin`.
    pub name: String,
    /// Robots drawn.
    pub robots: u64,
    /// How often each robot is recorded and calibrated: how far its results scatter is their repeatability, which one recording does not
    /// show.
    pub recorded: u64,
    /// Seed of the first.
    pub seed: u64,
    /// Threads; `None`: as many as there are processors.
    pub threads: Option<usize>,
    /// Folder of the state file, where finished robots are kept; `None`: nothing is written.
    pub out: Option<PathBuf>,
    /// Keep the finished robots of an earlier run with the same settings.
    pub resume: bool,
    /// Which plugins of the profile are loaded.
    pub plugins: Plugins,
}

/// Error of one found transform against the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Off {
    /// Distance of the origins, m.
    pub translation_m: f64,
    /// Angle between the frames, rad.
    pub rotation_rad: f64,
}

/// One robot, one method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotResult {
    /// Its seed.
    pub seed: u64,
    /// `paper` or `ml`.
    pub method: String,
    /// Why there is no result.
    pub failure: Option<String>,
    /// The loops, as in the report.
    pub loops: Vec<LoopClosure>,
    /// Found transforms against the truth, by the report's names.
    pub off: BTreeMap<String, Off>,
    /// How far the found transforms of this robot's recordings scatter: standard deviation of one; empty where it was recorded once, and
    /// where a recording has no result: those that succeed are not like the others.
    #[serde(default)]
    pub scatter: BTreeMap<String, Off>,
    /// Recordings after the first that have no result.
    #[serde(default)]
    pub failed_again: u64,
}

/// A finished case study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaseResult {
    /// Name.
    pub study: String,
    /// Robots drawn.
    pub robots: u64,
    /// Recordings of each.
    pub recorded: u64,
    /// Seed of the first.
    pub seed: u64,
    /// Robot by robot, method by method.
    pub results: Vec<RobotResult>,
}

/// Runs the study. `progress(done, total)` counts robots and is called from any thread.
///
/// # Errors
/// [`CaseError`] for a profile that cannot be read or simulated, for no robots, and for a state file that cannot be used. A robot that
/// cannot be calibrated is a result, not an error.
pub fn run_cases(
    units: &Units<'_>,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<CaseResult, CaseError> {
    let options = units.options;
    let state = Mutex::new(State::open(units)?);
    let threads = options.threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|source| CaseError::Threads { threads, source })?;
    let done = AtomicU64::new(0);
    let lock = || state.lock().unwrap_or_else(PoisonError::into_inner);
    let numbers: Vec<u64> = (0..options.robots).collect();
    let results: Vec<Vec<RobotResult>> = pool.install(|| {
        numbers
            .par_iter()
            .with_max_len(1)
            .map(|&k| {
                let known = lock().finished(units.seed(k));
                let both = match known {
                    Some(both) => both,
                    None => {
                        let both = units.one(k);
                        lock().append(&both)?;
                        both
                    }
                };
                progress(done.fetch_add(1, Ordering::Relaxed) + 1, options.robots);
                Ok(both)
            })
            .collect::<Result<_, CaseError>>()
    })?;
    Ok(units.result(results))
}

/// Draws a robot and calibrates it by both methods, from each of its recordings.
fn one_robot(robot: &RobotProfile, seed: u64, options: &CaseOptions) -> Vec<RobotResult> {
    let recorded =
        |again: u64| calib_sim::simulate_again(&robot.profile, &robot.model, Some(seed), again);
    let drawn: Result<Vec<Simulated>, _> = (0..options.recorded).map(recorded).collect();
    let mut out = Vec::new();
    for (method, word) in METHODS {
        let run = RunOptions {
            method: Some(method),
            force: true,
            strict: false,
            select: false,
            plugins: options.plugins,
            ..RunOptions::default()
        };
        let calibrated = |simulated: &Simulated| {
            let tables = simulated.recordings.clone();
            of_tables(robot.clone(), tables, options.plugins)
                .and_then(|inputs| run_on(inputs, &run, &mut |_| {}))
        };
        let mut result = RobotResult {
            seed,
            method: word.to_owned(),
            failure: None,
            loops: Vec::new(),
            off: BTreeMap::new(),
            scatter: BTreeMap::new(),
            failed_again: 0,
        };
        let first = match &drawn {
            Ok(drawn) => calibrated(&drawn[0]).map_err(|e| e.to_string()),
            Err(e) => Err(e.to_string()),
        };
        match (first, &drawn) {
            (Ok(output), Ok(drawn)) => {
                let first = transforms(&output.report);
                let found = |s: &Simulated| Some(transforms(&calibrated(s).ok()?.report));
                let again: Vec<Option<Found>> = drawn[1..].iter().map(found).collect();
                result.off = against(&first, &drawn[0].truth);
                result.failed_again = again.iter().filter(|a| a.is_none()).count() as u64;
                let all: Option<Vec<Found>> = std::iter::once(Some(first)).chain(again).collect();
                result.scatter = all.map(|all| repeat::scatter(&all)).unwrap_or_default();
                result.loops = output.report.loops;
            }
            (first, _) => result.failure = first.err(),
        }
        out.push(result);
    }
    out
}

/// Transforms of one calibration, by the report's names.
type Found = BTreeMap<String, Isometry3<f64>>;

fn transforms(report: &Report) -> Found {
    let of = |found: &calib_report::Transform| {
        let [x, y, z, w] = found.rotation_xyzw;
        let turn = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        let [x, y, z] = found.translation_m;
        let at = Isometry3::from_parts(Translation3::new(x, y, z), turn);
        (found.name.clone(), at)
    };
    report.transforms.iter().map(of).collect()
}

fn against(found: &Found, truth: &calib_sim::Truth) -> BTreeMap<String, Off> {
    found
        .iter()
        .filter_map(|(name, at)| {
            let truth = truth.transforms.get(name)?.isometry();
            let off = Off {
                translation_m: (at.translation.vector - truth.translation.vector).norm(),
                rotation_rad: at.rotation.angle_to(&truth.rotation),
            };
            Some((name.clone(), off))
        })
        .collect()
}

/// Mean and spread over robots of one number of each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Over {
    pub mean: f64,
    pub spread: f64,
    pub largest: f64,
}

impl Over {
    pub fn of(values: &[f64]) -> Option<Self> {
        let stats = Stats::of(values)?;
        Some(Self {
            mean: stats.mean,
            spread: stats.std,
            largest: stats.max,
        })
    }
}
