//! The trials of a scene in pieces that do not depend on each other, and the cells from their sums.
//!
//! ```text
//! scene = piece 1 … piece P;   piece = block 1 … block B;   block = 50 trials;   P ≤ 1024 of an ordinary scene      (1)
//! ```
//!
//! Sums are joined block by block within a piece, then piece by piece, whoever made them: the same bits for any number of threads and machines.

use std::ops::Range;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{cell::Cell, experiment::Experiment, noise::Noise, tally::Tally};

/// Trials that one thread does at a stretch.
const BLOCK: u64 = 50;
/// Pieces of an ordinary scene at the most: many trials are divided, and few sums are kept.
const PIECES: u64 = 1024;

/// The sums of a piece, for each row of its scene.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Sums(Vec<Tally>);

/// The pieces of a scene: ranges of its trials that follow each other, in all scenes of a study of `base` trials equally long.
pub(crate) fn pieces(trials: u64, base: u64) -> Vec<Range<u64>> {
    let length = base.div_ceil(BLOCK).div_ceil(PIECES).max(1) * BLOCK;
    let starts = (0..trials.div_ceil(length)).map(|piece| piece * length);
    starts
        .map(|start| start..trials.min(start + length))
        .collect()
}

/// Makes the trials of a piece; `advance` is told how many are done.
pub(crate) fn sums(
    experiment: &dyn Experiment,
    seed: u64,
    piece: &Range<u64>,
    advance: &(dyn Fn(u64) + Sync),
) -> Sums {
    let id = experiment.scene().id();
    let length = piece.end - piece.start;
    let blocks: Vec<Vec<Tally>> = (0..length.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let mut tallies = vec![Tally::default(); experiment.rows().len()];
            let start = piece.start + block * BLOCK;
            let range = start..piece.end.min(start + BLOCK);
            let length = range.end - range.start;
            for number in range {
                let mut noise = Noise::of_trial(seed, &id, number);
                experiment.trial(number, &mut noise, &mut tallies);
            }
            advance(length);
            tallies
        })
        .collect();
    joined(experiment, blocks.iter())
}

/// The cells of a scene from the sums of all of its pieces, in their order.
pub(crate) fn cells<'a>(
    experiment: &dyn Experiment,
    pieces: impl Iterator<Item = &'a Sums>,
) -> Vec<Cell> {
    let Sums(sums) = joined(experiment, pieces.map(|piece| &piece.0));
    experiment
        .rows()
        .iter()
        .zip(&sums)
        .map(|(row, sum)| {
            let mut cell = sum.cell(experiment.scene(), row);
            let limits = experiment.limits();
            cell.unbiased_limit = limits.unbiased;
            cell.second_order_limit = limits.second_order;
            cell
        })
        .collect()
}

fn joined<'a>(experiment: &dyn Experiment, parts: impl Iterator<Item = &'a Vec<Tally>>) -> Sums {
    let mut sums = vec![Tally::default(); experiment.rows().len()];
    for part in parts {
        for (sum, tally) in sums.iter_mut().zip(part) {
            sum.join(tally);
        }
    }
    Sums(sums)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_whole_blocks_that_follow_each_other() {
        for trials in [0_u64, 1, 49, 50, 51, 1500, 51_200, 51_201, 1_000_003] {
            let base = trials.div_ceil(3);
            let all = pieces(trials, base);
            assert!(all.len() as u64 <= 3 * PIECES);
            assert!(all.windows(2).all(|w| w[0].end == w[1].start));
            assert!(all.iter().all(|p| p.start % BLOCK == 0 && p.start < p.end));
            assert_eq!(all.first().map_or(0, |p| p.start), 0);
            assert_eq!(all.last().map_or(0, |p| p.end), trials);
        }
    }
}
