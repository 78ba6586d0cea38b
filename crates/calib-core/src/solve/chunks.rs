//! Sums over many samples on all cores, with the same bits for any number of them.

use std::ops::Range;

use rayon::prelude::*;

/// Samples that are summed one after the other: 1 to 2 ms, a hundred times what it takes to ask another thread.
const CHUNK: usize = 64;

/// Chunks whose sums are held at once.
const AT_ONCE: usize = 32;

/// Whether so many samples are one chunk.
pub(crate) fn is_one_chunk(count: usize) -> bool {
    count <= CHUNK
}

/// Number of the chunk that a sample is in.
pub(crate) fn chunk_of(sample: usize) -> usize {
    sample / CHUNK
}

/// Calls `sum` for the chunks of `0..count` on all cores, and `add` with what it gives in their order. `None`, and nothing further,
/// where `sum` gives `None`.
pub(crate) fn chunked<T: Send>(
    count: usize,
    sum: impl Fn(Range<usize>) -> Option<T> + Sync,
    mut add: impl FnMut(T),
) -> Option<()> {
    let firsts: Vec<usize> = (0..count).step_by(CHUNK).collect();
    for some in firsts.chunks(AT_ONCE) {
        let chunks = some.par_iter();
        let sums: Vec<Option<T>> = chunks
            .map(|first| sum(*first..count.min(first + CHUNK)))
            .collect();
        for sum in sums {
            add(sum?);
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_is_in_one_chunk_in_order() {
        for count in [0, 1, CHUNK, CHUNK + 1, 70 * CHUNK + 5] {
            let mut seen = Vec::new();
            let all = chunked(count, Some, |samples| seen.extend(samples));
            assert_eq!(all, Some(()));
            assert_eq!(seen, (0..count).collect::<Vec<_>>());
        }
        let mut seen = 0;
        let none = |samples: Range<usize>| (!samples.contains(&(3 * CHUNK))).then_some(());
        assert_eq!(chunked(5 * CHUNK, none, |()| seen += 1), None);
        assert_eq!(seen, 3);
    }
}
