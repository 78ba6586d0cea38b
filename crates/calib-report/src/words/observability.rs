//! What is not observable.

use super::prose::{SHOWN, code, counted, full_stop, or, sentence, short};
use crate::{Meaning, NotObservable, Report, Transform};

/// Where nothing is missing.
pub(crate) const ALL_OBSERVABLE: &str = "All requested quantities are observable.";

pub(crate) fn unobservable(report: &Report, rest: &str) -> Vec<String> {
    if report.transforms.is_empty() && report.parameters.is_empty() {
        return vec!["Nothing was solved.".to_owned()];
    }
    let of = |meaning: Meaning| {
        report
            .not_observable
            .iter()
            .filter(move |item| item.meaning == meaning)
    };
    let items: Vec<String> = of(Meaning::NotMeasured)
        .map(|item| sentence(&item.in_short()))
        .collect();
    let mut lines = short(&items, rest);
    let open: Vec<&Transform> = report.transforms.iter().filter(|t| !t.observable).collect();
    let directions: usize = open.iter().map(|t| t.unobservable.len()).sum();
    if directions > SHOWN {
        let count =
            |t: &&Transform| format!("{} of the 6 of {}", t.unobservable.len(), code(&t.name));
        let transforms: Vec<String> = open.iter().map(count).collect();
        lines.push(format!(
            "Degrees of freedom of transforms: {}.",
            transforms.join(", ")
        ));
    } else {
        lines.extend(open.iter().flat_map(|t| {
            t.unobservable
                .iter()
                .map(|u| format!("`{}`: {}", t.name, full_stop(&u.text)))
        }));
    }
    let conventions = of(Meaning::Convention).count();
    if conventions > 0 {
        let are = if conventions == 1 {
            "is an arbitrary convention; no prediction depends on it"
        } else {
            "are arbitrary conventions; no prediction depends on them"
        };
        let n = counted(conventions, "parameter combination");
        lines.push(format!("{n} {are}."));
    }
    or(lines, ALL_OBSERVABLE)
}

impl NotObservable {
    /// The text, preceded by the subject where the text does not name it.
    pub(crate) fn words(&self) -> String {
        if self.text.contains(&format!("`{}`", self.subject)) {
            self.text.clone()
        } else {
            format!("`{}`: {}", self.subject, self.text)
        }
    }

    /// The same without the parameters that it is confounded with: the long report lists those.
    pub(crate) fn in_short(&self) -> String {
        match self.text.rsplit_once(": ") {
            Some((trade, reason)) if trade.contains(Self::TRADES) => {
                format!("`{}`: {reason}", self.subject)
            }
            _ => self.words(),
        }
    }

    /// Between a parameter and those that it is confounded with.
    pub(crate) const TRADES: &str = " trades against ";
}

/// Combinations with the same reason and the same remedy as one item; everything else unchanged.
pub(crate) fn grouped(items: &[&NotObservable]) -> Vec<(String, String)> {
    let mut out: Vec<(String, String)> = Vec::new();
    let mut groups: Vec<(&str, &str, Vec<String>)> = Vec::new();
    for item in items {
        let Some((trade, reason)) = item
            .text
            .rsplit_once(": ")
            .filter(|(trade, _)| trade.contains(NotObservable::TRADES))
        else {
            out.push((item.words(), item.remedy.clone()));
            continue;
        };
        let trade = trade.replacen(NotObservable::TRADES, " against ", 1);
        match groups
            .iter_mut()
            .find(|(r, remedy, _)| *r == reason && *remedy == item.remedy)
        {
            Some((_, _, trades)) => trades.push(trade),
            None => groups.push((reason, &item.remedy, vec![trade])),
        }
    }
    out.extend(groups.into_iter().map(|(reason, remedy, trades)| {
        (
            format!("{reason}: {}", trades.join("; ")),
            remedy.to_owned(),
        )
    }));
    out
}
