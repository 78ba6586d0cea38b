//! The study as Markdown, CSV and JSON.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use calib_report::verdict::ReasonId;

use super::design::{Body, Design};
use super::fault::{Class, Fault};
use super::goals::goals;
use super::outcome::{CaseResult, Outcome};
use super::run::FaultResult;
use super::words::word;
use crate::settings::StudyError;

/// How many cases ended how.
#[derive(Debug, Clone, Copy, Default)]
struct Count {
    cases: u64,
    named: u64,
    stopped: u64,
    harmless: u64,
    wrong: u64,
}

impl Count {
    fn of<'a>(results: impl Iterator<Item = &'a CaseResult>) -> Self {
        let mut count = Self::default();
        for result in results {
            count.cases += 1;
            match result.outcome {
                Outcome::Named => count.named += 1,
                Outcome::Stopped => count.stopped += 1,
                Outcome::Harmless => count.harmless += 1,
                Outcome::Wrong => count.wrong += 1,
            }
        }
        count
    }

    fn row(&self, name: &str) -> String {
        let share = |n: u64| format!("{:.1} %", 100.0 * n as f64 / self.cases.max(1) as f64);
        format!(
            "| {name} | {} | {} | {} | {} | {} |\n",
            self.cases,
            share(self.named),
            share(self.stopped),
            share(self.harmless),
            self.wrong
        )
    }
}

/// Of so many cases with true uncertainties, one has an error that is not covered.
const BY_CHANCE: f64 = 1000.0;

/// What is said of a case.
const CASES: &str = "- *named*: not accepted without reserve, and a finding names the cause, or what the data cannot distinguish from it;
- *stopped*: not accepted, and no finding names the cause;
- *harmless*: accepted, with or without warnings; the rms error at 24 new poses is within the limit, and the stated uncertainty covers it;
- *wrong*: accepted, and the error is above the limit or not covered.

The stated uncertainty is that of the fit, widened to the error that `prediction-expected` states, with Student's allowance where the noise is known from few data.";

/// The designs and the bodies of the tables below.
const DESIGNS: &str = "The recordings to be fitted are of six designs. *random*: 40 random poses. *few*: 10 random poses. *six*: 6 random poses. *sweeps*: one joint at a time from one posture, seven poses each. \
*both*: 20 random poses, and sweeps in a second recording. *stream*: a slow motion of all joints, 150 samples. The tracker sees *one*, *two*, *three* or *four* markers on the last link, or a body with position and \
orientation (*pose*).";

/// The tables of the book's page.
#[must_use]
pub fn markdown(result: &FaultResult) -> String {
    let mut text = String::new();
    let all = &result.results;
    let faulty = || all.iter().filter(|r| r.cell.fault.class() != Class::Clean);
    let clean: Vec<&CaseResult> = all
        .iter()
        .filter(|r| r.cell.fault.class() == Class::Clean)
        .collect();
    let wrong = Count::of(faulty()).wrong;
    let n = faulty().count();
    // Writing into a string cannot fail.
    let _ = writeln!(
        text,
        "# Faults: what `calib run` says of them\n\n{n} cases with a fault, {} without; seed {}. A case is:\n\n{CASES}\n\n{DESIGNS}\n",
        clean.len(),
        result.seed
    );
    let accepted = all
        .iter()
        .filter(|r| matches!(r.outcome, Outcome::Harmless | Outcome::Wrong))
        .count();
    let _ = writeln!(
        text,
        "Wrong: {wrong} of {n}{}. The uncertainty is held to what chance exceeds in one of {BY_CHANCE} cases, so of the {accepted} accepted cases about {:.1} \
         would be wrong if every model and every σ were true.\n",
        upper(wrong, n),
        accepted as f64 / BY_CHANCE
    );
    let silent = all.iter().filter(|r| r.confidently_wrong()).count();
    let refused = clean.iter().filter(|r| r.false_refusal()).count();
    let undecided = clean.iter().filter(|r| r.truly_undecided()).count();
    let harmful = clean.iter().filter(|r| r.outcome == Outcome::Wrong).count();
    let warned = clean.iter().filter(|r| r.false_warning()).count();
    let _ = writeln!(
        text,
        "Wrong without any warning: {silent} of {}. Of {} cases of good data: refused with an untrue reason {refused}; refused because they are too few to decide, \
         and nothing else, {undecided} (*undecided*: that is true of them, and the reason asks for more poses); with an untrue warning {warned}; wrong {harmful}.\n",
        all.len(),
        clean.len()
    );
    text += &goals(all);
    text += &table(
        "fault",
        Fault::ALL.map(|fault| {
            (
                word(&fault),
                Count::of(all.iter().filter(|r| r.cell.fault == fault)),
            )
        }),
    );
    text += &table(
        "design",
        Design::ALL.map(|design| {
            (
                word(&design),
                Count::of(faulty().filter(|r| r.cell.design == design)),
            )
        }),
    );
    text += &table(
        "body",
        Body::ALL.map(|body| {
            (
                word(&body),
                Count::of(faulty().filter(|r| r.cell.body == body)),
            )
        }),
    );
    text
}

/// Upper 95 % limit where nothing happened: equation (1) of the module.
fn upper(events: u64, n: usize) -> String {
    if events > 0 || n == 0 {
        return String::new();
    }
    let limit = 1.0 - 0.05_f64.powf(1.0 / n as f64);
    format!(" (upper 95 % limit {:.2} %)", 100.0 * limit)
}

fn table<const N: usize>(first: &str, rows: [(String, Count); N]) -> String {
    let mut text = format!(
        "## By {first}\n\n| {first} | cases | named | stopped | harmless | wrong |\n|---|---|---|---|---|---|\n"
    );
    for (name, count) in rows.iter().filter(|(_, count)| count.cases > 0) {
        text += &count.row(name);
    }
    text + "\n"
}

/// The ids of reasons, in one field.
fn words(reasons: &BTreeSet<ReasonId>) -> String {
    let ids: Vec<&str> = reasons.iter().map(|id| id.as_str()).collect();
    ids.join(" ")
}

/// One line per case.
#[must_use]
pub fn csv(result: &FaultResult) -> String {
    let mut text = String::from(
        "fault,design,validation,body,errors,number,outcome,named,verdict,rms_mm,worst_z,findings,reasons,refused_by\n",
    );
    for r in &result.results {
        let number = |x: Option<f64>, scale: f64| {
            x.map_or_else(String::new, |x| format!("{:.4}", x * scale))
        };
        let findings: Vec<&str> = r.findings.iter().map(String::as_str).collect();
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
            word(&r.cell.fault),
            word(&r.cell.design),
            word(&r.cell.validation),
            word(&r.cell.body),
            word(&r.cell.errors),
            r.number,
            word(&r.outcome),
            r.named,
            r.verdict,
            number(r.rms_m, 1e3),
            number(r.worst_z, 1.0),
            findings.join(" "),
            words(&r.reasons),
            words(&r.refused_by)
        );
    }
    text
}

/// Every case as JSON.
///
/// # Errors
/// [`StudyError::Unwritable`] for numbers that JSON does not have.
pub fn json(result: &FaultResult) -> Result<String, StudyError> {
    Ok(serde_json::to_string_pretty(result)? + "\n")
}
