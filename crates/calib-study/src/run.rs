//! Runs a study: scenes and pieces of them in parallel, the same result for any number of threads.

use std::sync::{
    Mutex,
    atomic::{AtomicU64, Ordering},
};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    aor,
    cell::{Cell, Quantity},
    claims::{self, Claim},
    cor,
    experiment::Experiment,
    held::{self, Standard},
    pieces::{Sums, cells, pieces, sums},
    settings::{Study, StudyError, StudyOptions},
    state::State,
    tried::Tried,
};

/// A finished study, as data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StudyResult {
    /// Version of this layout.
    pub calib_study: u32,
    /// Which study.
    pub study: Study,
    /// Estimators of plugins that were tried, with the plugins.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub plugins: Vec<String>,
    /// Trials of an ordinary cell.
    pub trials: u64,
    /// Seed of all draws.
    pub seed: u64,
    /// Estimates made in all trials of all cells.
    pub fits: u64,
    /// What the estimators are required to reach, and whether they do.
    pub standards: Vec<Standard>,
    /// What the paper says, beside what was measured.
    pub claims: Vec<Claim>,
    /// Every cell, in the order of the plan.
    pub cells: Vec<Cell>,
}

/// Runs a study. `progress(done, total)` counts trials and is called from any thread.
///
/// # Errors
/// [`StudyError`] for no trials, threads that cannot be started, and a state file that cannot be used.
pub fn run(
    study: Study,
    options: &StudyOptions,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<StudyResult, StudyError> {
    run_with(study, &Tried::default(), options, progress)
}

/// As [`run`], with estimators of plugins beside the built-in ones, on the scenes whose measurements they take.
///
/// # Errors
/// As [`run`].
pub fn run_with(
    study: Study,
    tried: &Tried,
    options: &StudyOptions,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<StudyResult, StudyError> {
    if options.trials == 0 {
        return Err(StudyError::NoTrials { got: 0 });
    }
    let mut plan = plan(study, tried);
    if !options.only.is_empty() {
        plan.retain(|e| {
            let id = e.scene().id();
            options.only.iter().any(|start| id.starts_with(start))
        });
    }
    let state = State::open(study, tried, options)?;
    let threads = options.threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|source| StudyError::Threads { threads, source })?;

    let total = plan.iter().map(|e| e.trials(options.trials)).sum();
    let done = AtomicU64::new(0);
    let advance = |trials: u64| {
        progress(done.fetch_add(trials, Ordering::Relaxed) + trials, total);
    };
    let state = Mutex::new(state);
    let cells: Vec<Vec<Cell>> = pool.install(|| {
        plan.par_iter()
            .with_max_len(1)
            .map(|experiment| {
                let id = experiment.scene().id();
                let known = lock(&state).finished(&id);
                if let Some(cells) = known {
                    advance(experiment.trials(options.trials));
                    return Ok(cells);
                }
                let cells = cells_of(experiment.as_ref(), options, &advance);
                lock(&state).append(&id, &cells)?;
                Ok(cells)
            })
            .collect::<Result<_, StudyError>>()
    })?;
    let order: Vec<String> = plan.iter().map(|e| e.scene().id()).collect();
    lock(&state).close(&order, &cells)?;

    Ok(result(study, tried, options, cells))
}

/// The study from the cells of its scenes, in the order of the plan.
pub(crate) fn result(
    study: Study,
    tried: &Tried,
    options: &StudyOptions,
    cells: Vec<Vec<Cell>>,
) -> StudyResult {
    let cells: Vec<Cell> = cells.into_iter().flatten().collect();
    let own = cells.iter().filter(|c| !c.from_plugin);
    let own: Vec<Cell> = own.cloned().collect();
    StudyResult {
        calib_study: 1,
        plugins: tried.names(),
        study,
        trials: options.trials,
        seed: options.seed,
        fits: fits(&cells),
        standards: held::standards(study, &own),
        claims: claims::claims(study, &own),
        cells,
    }
}

/// The scenes of a study, in the order of its report.
pub(crate) fn plan(study: Study, tried: &Tried) -> Vec<Box<dyn Experiment>> {
    match study {
        Study::Cor => cor::plan(tried),
        Study::Aor => aor::plan(tried),
    }
}

/// All trials of one scene.
fn cells_of(
    experiment: &dyn Experiment,
    options: &StudyOptions,
    advance: &(dyn Fn(u64) + Sync),
) -> Vec<Cell> {
    let pieces = pieces(experiment.trials(options.trials), options.trials);
    let made: Vec<Sums> = pieces
        .par_iter()
        .map(|piece| sums(experiment, options.seed, piece, advance))
        .collect();
    cells(experiment, made.iter())
}

/// An axis has two quantities, a frame too: one fit.
fn fits(cells: &[Cell]) -> u64 {
    cells
        .iter()
        .filter(|c| !matches!(c.quantity, Quantity::Offset | Quantity::Shift))
        .map(|c| c.trials)
        .sum()
}

/// A thread that panicked while writing has already ended the study: what it left is not used again.
fn lock(state: &Mutex<State>) -> std::sync::MutexGuard<'_, State> {
    state
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}
