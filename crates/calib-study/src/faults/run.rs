//! Runs the matrix: cells in parallel, finished cases kept on disk.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::case::Cell;
use super::design::{Body, Design, Validation};
use super::fault::{Class, Fault};
use super::outcome::{CaseResult, run_case};
use super::robot::Errors;
use super::settings::FaultOptions;
use super::state::State;
use crate::settings::StudyError;

/// A finished study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FaultResult {
    /// Version of this layout.
    pub calib_fault_study: u32,
    /// Seed of all draws.
    pub seed: u64,
    /// Cases of each cell with a fault.
    pub cases: u64,
    /// Every case, in the order of the matrix.
    pub results: Vec<CaseResult>,
}

/// Cells of the matrix: every fault in every design it can have, with every body; the held-out design and the size of the
/// nominal errors alternate, so that each occurs with each. A part of the matrix has the cells of the whole.
pub(super) fn matrix(only: &[Fault]) -> Vec<Cell> {
    let validations = [Validation::Combined, Validation::Alike, Validation::Absent];
    let mut cells = Vec::new();
    let faults = Fault::ALL.iter().enumerate();
    for (f, fault) in faults.filter(|(_, f)| only.is_empty() || only.contains(f)) {
        for (d, design) in Design::ALL.into_iter().enumerate() {
            for (b, body) in Body::ALL.into_iter().enumerate() {
                let first = validations[(f + d + b) % 3];
                let order = std::iter::once(first).chain(validations);
                let fits = |v: &Validation| fault.applies(design, body, *v);
                if let Some(validation) = order.into_iter().find(fits) {
                    let cell = |errors| Cell {
                        fault: *fault,
                        design,
                        validation,
                        body,
                        errors,
                    };
                    let big = (f + d + 2 * b) % 3 == 0;
                    cells.push(cell(if big { Errors::Big } else { Errors::Small }));
                    // A third of the discrete faults once more with a robot that is far off.
                    if fault.class() == Class::Discrete && (f + 2 * d + b) % 3 == 0 {
                        cells.push(cell(Errors::Huge));
                    }
                }
            }
        }
    }
    cells
}

/// Runs the study. `progress(done, total)` counts cases and is called from any thread.
///
/// # Errors
/// [`StudyError`] for no cases, threads that cannot be started, and a state file that cannot be used. A run that stops is a
/// result, not an error.
pub fn run_faults(
    options: &FaultOptions,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<FaultResult, StudyError> {
    if options.cases == 0 {
        return Err(StudyError::NoTrials { got: 0 });
    }
    let plan = plan(options);
    let state = Mutex::new(State::open(options)?);
    let threads = options.threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|source| StudyError::Threads { threads, source })?;
    let done = AtomicU64::new(0);
    let total = plan.len() as u64;
    let lock = || state.lock().unwrap_or_else(PoisonError::into_inner);
    let results = pool.install(|| {
        plan.par_iter()
            .with_max_len(1)
            .map(|&(cell, number)| {
                let known = lock().finished(cell, number);
                let result = match known {
                    Some(result) => result,
                    None => {
                        let result = run_case(cell, number, options.seed);
                        lock().append(&result)?;
                        result
                    }
                };
                progress(done.fetch_add(1, Ordering::Relaxed) + 1, total);
                Ok(result)
            })
            .collect::<Result<Vec<_>, StudyError>>()
    })?;
    lock().close(&results)?;
    Ok(result(options, results))
}

/// The study from its cases, in the order of the matrix.
pub(super) fn result(options: &FaultOptions, results: Vec<CaseResult>) -> FaultResult {
    FaultResult {
        calib_fault_study: 3,
        seed: options.seed,
        cases: options.cases,
        results,
    }
}

/// Every case, in the order of the matrix.
pub(super) fn plan(options: &FaultOptions) -> Vec<(Cell, u64)> {
    let clean = |cell: &Cell| {
        if cell.fault.class() == Class::Clean {
            4
        } else {
            1
        }
    };
    matrix(&options.only)
        .into_iter()
        .flat_map(|cell| (0..options.cases * clean(&cell)).map(move |k| (cell, k)))
        .collect()
}
