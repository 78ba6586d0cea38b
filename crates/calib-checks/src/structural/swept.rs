//! Joints without a column, or with one that never changes, that a first name does not do justice to: most rows say where such a joint stood, and those that
//! it was swept in look like outliers beside them; other readings for it can be stated in many ways.

use std::collections::BTreeSet;

use super::correct::{correct, empty_rows, open_rows, stuck_at};
use super::data::Data;
use super::hypothesis::{Hypothesis, Scoped};
use super::ids::SampleIndex;
use super::outcome::{Evidence, Named};
use super::ranking::ratio;
use super::scan::{Scan, Scored};
use super::score::{penalized, stood_at};
use super::special;

/// Rows that a place for all of them leaves as outliers before readings of their own are asked.
const SOME_ROWS: usize = 3;
/// Readings of their own leave as little of all samples, to this factor, as one place leaves without its outliers.
const AS_LITTLE: f64 = 1.5;

/// Readings of their own explain a joint that never changed better than one place where they leave so many times less.
const CLEARLY: f64 = 1.2;

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

/// A name that only states other readings for a joint whose readings never change in its scope: the joint stood elsewhere, or moved in spite of them.
pub(super) fn at_rest(named: &Named, data: &Data, screened: &[SampleIndex]) -> Option<Scored> {
    let [Scoped { hypothesis, scope }] = named.correction[..] else {
        return None;
    };
    let joint = match hypothesis {
        Hypothesis::Sign { joint }
        | Hypothesis::Offset { joint, .. }
        | Hypothesis::Unit { joint, .. } => joint,
        Hypothesis::Coupling { joint, source, .. } => {
            stuck_at(scope, source, data)?;
            joint
        }
        _ => return None,
    };
    let read = stuck_at(scope, joint, data)?;
    let scoped = Scoped {
        hypothesis: Hypothesis::MissingColumn { joint },
        scope,
    };
    let scan = Scan::new(data, screened);
    let (stood, _) = stood_at(&scan, scoped, joint, read);
    let rows = open_rows(scope, joint, data).len();
    let filled = special::apply(&scoped, data);
    let score = penalized(&scan, rows, scan.fit_corrected(&filled).score);
    let best = named.evidence.best;
    if CLEARLY * score.rms < best.min(stood.score.rms) {
        return Some(Scored { scoped, score });
    }
    (stood.score.rms <= best).then_some(stood)
}
