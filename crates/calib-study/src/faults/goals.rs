//! The goals that the matrix was set, each on the cases that it is about.
//!
//! ```text
//! share of k in n cases, 95 % (Wilson 1927):   (k + z²/2)/(n + z²) ± z √(k(n − k)/n + z²/4)/(n + z²)        (1)
//! mean of shares c_i of n cases:               c̄ ± z s/√n                                                   (2)
//! ```
//!
//! A goal is met where the whole interval is on its side, not met where none of it is, else undecided.

use std::fmt::Write as _;

use super::design::{Body, Design};
use super::fault::{Class, Fault};
use super::outcome::{CaseResult, Outcome};
use super::robot::Errors;
use super::words::word;

/// Normal quantile of 97.5 %.
const Z: f64 = 1.96;
/// What a fault moves the registration of noise-free data by, at least, where the recordings can show it, m.
const SEEN: f64 = 2e-5;
/// From here on gains and couplings are to be named, m.
const LARGE: f64 = 1e-3;
/// Below, effects cannot be named and do no harm, m.
const SMALL: f64 = 2e-4;

/// ln of how many times likelier than everything else a discrete fault must be that a test can name.
const MILLION: f64 = 13.8;

/// What no test can exceed.
const BEST: &str = "the same, by the best test that knows the fault, its place and its size, at one false name in 1 000 clean recordings: named";

/// The side of a goal.
#[derive(Debug, Clone, Copy)]
enum Side {
    AtLeast(f64),
    AtMost(f64),
    Between(f64, f64),
}

struct Row {
    condition: String,
    cases: usize,
    share: f64,
    interval: (f64, f64),
    goal: Option<Side>,
}

impl Row {
    /// Of the cases of a condition, those that are as they should be.
    fn of(
        condition: impl Into<String>,
        cases: &[&CaseResult],
        goal: Option<Side>,
        is: &dyn Fn(&CaseResult) -> bool,
    ) -> Self {
        let n = cases.len() as f64;
        let k = cases.iter().filter(|r| is(r)).count() as f64;
        let middle = (k + Z * Z / 2.0) / (n + Z * Z);
        let half = Z * (k * (n - k) / n.max(1.0) + Z * Z / 4.0).sqrt() / (n + Z * Z);
        Self {
            condition: condition.into(),
            cases: cases.len(),
            share: k / n.max(1.0),
            interval: ((middle - half).max(0.0), (middle + half).min(1.0)),
            goal,
        }
    }

    /// Mean share of postures whose error lies within its interval.
    fn coverage(condition: &str, cases: &[&CaseResult], goal: Side) -> Self {
        let shares: Vec<f64> = cases.iter().filter_map(|r| r.covered).collect();
        Self::mean(condition, &shares, Some(goal))
    }

    /// What a test names that knows the fault, its place and its size; a fault without evidence always.
    fn best(condition: &str, cases: &[&CaseResult]) -> Self {
        let chance = |r: &&CaseResult| r.chance.unwrap_or(1.0);
        let chances: Vec<f64> = cases.iter().map(chance).collect();
        Self::mean(condition, &chances, None)
    }

    /// How often the best estimate of a row that knows all else is within one.
    fn best_place(condition: &str, cases: &[&CaseResult]) -> Self {
        let chances: Vec<f64> = cases.iter().filter_map(|r| r.row_chance).collect();
        Self::mean(condition, &chances, None)
    }

    /// Equation (2).
    fn mean(condition: &str, shares: &[f64], goal: Option<Side>) -> Self {
        let n = shares.len() as f64;
        let mean = shares.iter().sum::<f64>() / n.max(1.0);
        let squares: f64 = shares.iter().map(|c| (c - mean).powi(2)).sum();
        let half = Z * (squares / (n - 1.0).max(1.0) / n.max(1.0)).sqrt();
        Self {
            condition: condition.to_owned(),
            cases: shares.len(),
            share: mean,
            interval: ((mean - half).max(0.0), (mean + half).min(1.0)),
            goal,
        }
    }

    fn judged(&self) -> &'static str {
        let (low, high) = self.interval;
        let (met, missed) = match self.goal {
            Some(Side::AtLeast(goal)) => (low >= goal, high < goal),
            Some(Side::AtMost(goal)) => (high <= goal, low > goal),
            Some(Side::Between(from, to)) => (low >= from && high <= to, high < from || low > to),
            None => return "",
        };
        match (met, missed) {
            (true, _) => "met",
            (_, true) => "not met",
            _ => "undecided",
        }
    }

    fn line(&self) -> String {
        let percent = |x: f64| format!("{:.1}", 100.0 * x);
        let goal = match self.goal {
            Some(Side::AtLeast(goal)) => format!("≥ {} %", 100.0 * goal),
            Some(Side::AtMost(goal)) => format!("≤ {} %", 100.0 * goal),
            Some(Side::Between(from, to)) => format!("{}–{} %", 100.0 * from, 100.0 * to),
            None => String::new(),
        };
        format!(
            "| {} | {} | {} % ({}–{}) | {goal} | {} |\n",
            self.condition,
            self.cases,
            percent(self.share),
            percent(self.interval.0),
            percent(self.interval.1),
            self.judged()
        )
    }
}

/// The cases that the fault of a condition can be seen in.
fn seen(r: &CaseResult) -> bool {
    r.moved_m.is_some_and(|moved| moved >= SEEN)
}

fn discrete(all: &[&CaseResult]) -> Vec<Row> {
    let cases = |what: &dyn Fn(&CaseResult) -> bool| -> Vec<&CaseResult> {
        let shown = |r: &&&CaseResult| r.cell.fault.class() == Class::Discrete && seen(r);
        all.iter()
            .filter(shown)
            .filter(|r| what(r))
            .copied()
            .collect()
    };
    let near = |r: &CaseResult| r.cell.errors != Errors::Huge;
    let named = |r: &CaseResult| r.named;
    let nameable = |r: &CaseResult| r.named || r.odds.is_some_and(|odds| odds >= MILLION);
    let (ninety_nine, ninety_five) = (Some(Side::AtLeast(0.99)), Some(Side::AtLeast(0.95)));
    let mut rows = vec![Row::of(
        "one discrete fault, nominal errors up to 1°, 5 mm: named",
        &cases(&near),
        ninety_nine,
        &named,
    )];
    let shown = cases(&|r| near(r) && nameable(r));
    rows.push(Row::of(
        "the same, decidable: named",
        &shown,
        ninety_nine,
        &named,
    ));
    for design in Design::ALL {
        let own = cases(&|r| near(r) && r.cell.design == design);
        rows.push(Row::of(
            format!("the same, design {}", word(&design)),
            &own,
            ninety_nine,
            &named,
        ));
    }
    let one = cases(&|r| near(r) && r.cell.body == Body::One);
    rows.push(Row::of("the same, one marker", &one, ninety_nine, &named));
    let far = cases(&|r| !near(r));
    rows.push(Row::of(
        "one discrete fault, nominal errors of 3°, 20 mm: named",
        &far,
        ninety_five,
        &named,
    ));
    let shown = cases(&|r| !near(r) && nameable(r));
    rows.push(Row::of(
        "the same, decidable: named",
        &shown,
        ninety_five,
        &named,
    ));
    rows
}

fn effects(all: &[&CaseResult]) -> Vec<Row> {
    let of = |what: &dyn Fn(&CaseResult) -> bool| -> Vec<&CaseResult> {
        all.iter().filter(|r| what(r)).copied().collect()
    };
    let named = |r: &CaseResult| r.named;
    let transmission =
        |r: &CaseResult| [Fault::Gain, Fault::Crosstalk, Fault::Coupling].contains(&r.cell.fault);
    let large = of(&|r| transmission(r) && r.moved_m.is_some_and(|m| m >= LARGE));
    // Whole couplings are decidable.
    let shown = |r: &&&CaseResult| r.evidence.is_none() || decidable(r);
    let large_decidable: Vec<&CaseResult> = large.iter().filter(shown).copied().collect();
    let pairs = of(&|r| r.cell.fault.class() == Class::Pair);
    let small =
        of(&|r| r.cell.fault.class() == Class::Continuous && r.moved_m.is_some_and(|m| m < SMALL));
    let harmless = |r: &CaseResult| r.outcome == Outcome::Harmless;
    let without_harm =
        |r: &CaseResult| harmless(r) || (r.outcome == Outcome::Stopped && r.only_undecided());
    let slips = of(&|r| {
        r.cell.fault.class() == Class::Change
            && [Fault::Slip, Fault::SmallSlip].contains(&r.cell.fault)
            && ![Design::Few, Design::Six].contains(&r.cell.design)
    });
    let shown: Vec<&CaseResult> = slips.iter().filter(|r| decidable(r)).copied().collect();
    let row = |r: &CaseResult| r.named && r.row_off.is_some_and(|off| off.abs() <= 1);
    vec![
        Row::of(
            "gain or coupling that moves the registration residual by 1 mm or more: named",
            &large,
            Some(Side::AtLeast(0.95)),
            &named,
        ),
        Row::best(BEST, &large),
        Row::of(
            "the same, decidable: named",
            &large_decidable,
            Some(Side::AtLeast(0.95)),
            &named,
        ),
        Row::of(
            "two discrete faults: one of them named",
            &pairs,
            Some(Side::AtLeast(0.8)),
            &named,
        ),
        Row::of(
            "effect that moves the registration residual by less than 0.2 mm: harmless",
            &small,
            None,
            &harmless,
        ),
        Row::of(
            "the same: harmless, or refused as too few data to decide",
            &small,
            Some(Side::AtLeast(0.99)),
            &without_harm,
        ),
        Row::of(
            "body slips by 2 σ or more at 40 poses (all 34 to 69), by 1 σ or more at 100 (all 150): named",
            &slips,
            Some(Side::AtLeast(0.99)),
            &named,
        ),
        Row::best(BEST, &slips),
        Row::of(
            "the same, decidable: named",
            &shown,
            Some(Side::AtLeast(0.99)),
            &named,
        ),
        Row::of(
            "the same, decidable: named with the row ± 1",
            &shown,
            Some(Side::AtLeast(0.99)),
            &row,
        ),
        Row::best_place(
            "the same, by the best estimate that knows the slip, its size and all else but the row: within one",
            &shown,
        ),
    ]
}

/// A test that knows the fault would name it.
fn decidable(r: &CaseResult) -> bool {
    let both = r.evidence.zip(r.needed);
    both.is_some_and(|(evidence, needed)| evidence >= needed)
}

fn clean(all: &[&CaseResult]) -> Vec<Row> {
    let clean: Vec<&CaseResult> = all
        .iter()
        .filter(|r| r.cell.fault.class() == Class::Clean)
        .copied()
        .collect();
    vec![
        Row::of(
            "good data: a cause named that there is not",
            &clean,
            Some(Side::AtMost(0.005)),
            &CaseResult::false_name,
        ),
        Row::of(
            "good data: refused with an untrue reason",
            &clean,
            Some(Side::AtMost(0.01)),
            &CaseResult::false_refusal,
        ),
        Row::of(
            "good data: an untrue warning",
            &clean,
            Some(Side::AtMost(0.01)),
            &CaseResult::false_warning,
        ),
    ]
}

fn coverage(all: &[&CaseResult]) -> Vec<Row> {
    let of = |what: &dyn Fn(&CaseResult) -> bool| -> Vec<&CaseResult> {
        all.iter().filter(|r| what(r)).copied().collect()
    };
    let good = |r: &CaseResult| r.cell.fault.class() == Class::Clean;
    let few = |r: &CaseResult| r.cell.design == Design::Six;
    let dependent = |r: &CaseResult| {
        [Fault::RepeatedFrames, Fault::CopiedRows, Fault::Memory].contains(&r.cell.fault)
    };
    vec![
        Row::coverage(
            "good data, ten poses and more: error within the 95 % region of the fit",
            &of(&|r| good(r) && !few(r)),
            Side::Between(0.94, 0.96),
        ),
        Row::coverage(
            "good data, six poses: the same",
            &of(&|r| good(r) && few(r)),
            Side::AtLeast(0.93),
        ),
        Row::coverage(
            "rows that are not independent: the same",
            &of(&dependent),
            Side::AtLeast(0.92),
        ),
    ]
}

/// Effects and changes by what the recordings show.
fn by_evidence(all: &[&CaseResult]) -> String {
    let mut text = String::from(
        "## Effects and changes that the recordings show\n\nA test that knows the fault, its place and its size, but neither where tracker and body stand nor the robot's geometry beyond the profile's \
         priors, has an *evidence* of so many σ, computed from the case with and without the fault at the true noise; no test has more. The fault is *decidable* where such a test, which has \
         to find the noise as well, would be misled over all that is tried in 1 of 1 000 clean recordings, and would miss 1 fault in 200: from 7.5 σ on with many degrees of freedom ν, \
         10.8 σ with ν = 20, 19 σ with ν = 8. Below, no program can name it with that certainty.\n\n\
         | fault | cases | decidable | named of these | named of the others | not accepted of the others |\n|---|---|---|---|---|---|\n",
    );
    let share = |k: usize, n: usize| match n {
        0 => String::new(),
        _ => format!("{:.1} %", 100.0 * k as f64 / n as f64),
    };
    let mut line = |name: String, own: Vec<&&CaseResult>| {
        let (shown, hidden): (Vec<&&CaseResult>, Vec<&&CaseResult>) =
            own.iter().partition(|r| decidable(r));
        let named =
            |cases: &[&&CaseResult]| share(cases.iter().filter(|r| r.named).count(), cases.len());
        let refused = hidden
            .iter()
            .filter(|r| [Outcome::Named, Outcome::Stopped].contains(&r.outcome))
            .count();
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "| {name} | {} | {} | {} | {} | {} |",
            own.len(),
            shown.len(),
            named(&shown),
            named(&hidden),
            share(refused, hidden.len())
        );
    };
    let judged = |r: &&&CaseResult| r.evidence.is_some();
    for fault in Fault::ALL {
        let own: Vec<&&CaseResult> = all
            .iter()
            .filter(judged)
            .filter(|r| r.cell.fault == fault)
            .collect();
        if !own.is_empty() {
            line(word(&fault), own);
        }
    }
    for design in Design::ALL {
        let own: Vec<&&CaseResult> = all
            .iter()
            .filter(judged)
            .filter(|r| r.cell.design == design)
            .collect();
        if !own.is_empty() {
            line(format!("all, design {}", word(&design)), own);
        }
    }
    text + "\n"
}

/// The goals as tables.
pub(super) fn goals(results: &[CaseResult]) -> String {
    let all: Vec<&CaseResult> = results.iter().collect();
    let mut text = String::from(
        "## Goals\n\nEach goal on the cases that it is about; what a fault moves the registration residual by is that of noise-free data of the nominal robot, and discrete faults that move it by \
         less than 0.02 mm are the same as none on their recordings. One that was not named counts as *decidable* where the recordings are a million times likelier under it than under any other hypothesis or none, \
         the noise and the profile's priors known: with less, nobody can name it so that one clean recording in a thousand is given a name. What the best test names of effects and changes is the mean of its chances, by the \
         evidence below and at the same level of false names: where that is below a goal, the recordings are too short, too few or too noisy for it, whatever program reads them. Shares with their 95 % intervals; a goal is *met* where the whole interval is on its side, *not met* where none of it is.\n\n\
         | condition | cases | share | goal | |\n|---|---|---|---|---|\n",
    );
    let rows = [discrete(&all), effects(&all), clean(&all), coverage(&all)];
    for row in rows.iter().flatten().filter(|row| row.cases > 0) {
        text += &row.line();
    }
    text + "\n" + &by_evidence(&all)
}
