//! A joint without a column: most rows say where it stood, and those that it was swept in look like outliers beside them.

use std::collections::BTreeSet;

use super::correct::{correct, empty_rows};
use super::data::Data;
use super::hypothesis::{Hypothesis, Scoped};
use super::ids::SampleIndex;
use super::outcome::{Evidence, Named};
use super::ranking::ratio;
use super::scan::Scan;
use super::score::penalized;
use super::special;

/// Rows that a place for all of them leaves as outliers before readings of their own are asked.
const SOME_ROWS: usize = 3;
/// Readings of their own leave as little of all samples, to this factor, as one place leaves without its outliers.
const AS_LITTLE: f64 = 1.5;

/// A joint without a column that stood where most rows have it, and moved in those that were taken for outliers beside it: in a
/// sweep of that joint, for example. Readings of their own explain all rows then.
pub(super) fn moved_after_all(mut named: Named, data: &Data, screened: &[SampleIndex]) -> Named {
    let [scoped] = named.correction[..] else {
        return named;
    };
    let Hypothesis::StoodAt { joint, .. } = scoped.hypothesis else {
        return named;
    };
    let empty = empty_rows(scoped.scope, joint, data);
    let rows: BTreeSet<usize> = screened.iter().map(|sample| sample.row).collect();
    if empty.iter().filter(|row| rows.contains(row)).count() < SOME_ROWS {
        return named;
    }
    let scan = Scan::new(data, &[]);
    let filled = special::estimated_beside(correct(&scoped, data), joint, &empty, screened);
    let score = penalized(&scan, empty.len(), scan.fit_corrected(&filled).score);
    if score.rms <= AS_LITTLE * named.evidence.best {
        let none = scan.none().rms;
        named.evidence = Evidence {
            none,
            best: score.rms,
            next: None,
            ratio: ratio(none, score.rms),
        };
        named.correction = vec![Scoped {
            hypothesis: Hypothesis::MissingColumn { joint },
            ..scoped
        }];
        (named.equivalent, named.alternatives) = (Vec::new(), Vec::new());
    }
    named
}
