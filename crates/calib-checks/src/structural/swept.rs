//! A joint without a column: most rows say where it stood, and those that it was swept in look like outliers beside them.

use std::collections::BTreeSet;

use super::correct::{correct, empty_rows, open_rows, stuck_at};
use super::data::Data;
use super::hypothesis::{Hypothesis, Scoped};
use super::ids::{JointIndex, SampleIndex};
use super::outcome::{Evidence, Named};
use super::ranking::ratio;
use super::scan::Scan;
use super::score::penalized;
use super::special;

/// Rows that a place for all of them leaves as outliers before readings of their own are asked.
const SOME_ROWS: usize = 3;
/// Readings of their own leave as little of all samples, to this factor, as one place leaves without its outliers.
const AS_LITTLE: f64 = 1.5;

/// Readings of their own explain a joint that never changed better than another zero where they leave so many times less.
const CLEARLY: f64 = 1.2;

/// A joint without a column that stood where most rows have it, and moved in those that were taken for outliers beside it: in a
/// sweep of that joint, for example. Readings of their own explain all rows then.
pub(super) fn moved_after_all(mut named: Named, data: &Data, screened: &[SampleIndex]) -> Named {
    let [scoped] = named.correction[..] else {
        return named;
    };
    let joint = match scoped.hypothesis {
        Hypothesis::StoodAt { joint, .. } => joint,
        Hypothesis::Offset { joint, .. } => {
            return moved_though_stuck(named, data, screened, joint);
        }
        _ => return named,
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
        let hypothesis = Hypothesis::MissingColumn { joint };
        rename(
            &mut named,
            Scoped {
                hypothesis,
                ..scoped
            },
            scan.none().rms,
            score.rms,
        );
    }
    named
}

/// Another zero of a joint whose readings never change there: if readings of its own explain clearly more, it moved in spite of them.
fn moved_though_stuck(
    mut named: Named,
    data: &Data,
    screened: &[SampleIndex],
    joint: JointIndex,
) -> Named {
    let scoped = Scoped {
        hypothesis: Hypothesis::MissingColumn { joint },
        scope: named.correction[0].scope,
    };
    if stuck_at(scoped.scope, joint, data).is_none() {
        return named;
    }
    let scan = Scan::new(data, screened);
    let rows = open_rows(scoped.scope, joint, data).len();
    let filled = special::apply(&scoped, data);
    let score = penalized(&scan, rows, scan.fit_corrected(&filled).score);
    if CLEARLY * score.rms < named.evidence.best {
        let none = named.evidence.none;
        rename(&mut named, scoped, none, score.rms);
    }
    named
}

/// Another name, with what it leaves, m.
fn rename(named: &mut Named, scoped: Scoped, none: f64, best: f64) {
    named.evidence = Evidence {
        none,
        best,
        next: None,
        ratio: ratio(none, best),
    };
    named.correction = vec![scoped];
    (named.equivalent, named.alternatives) = (Vec::new(), Vec::new());
}
