//! The summary on the terminal: at most 24 lines. What is not compared with the surroundings is never cut.

use std::fmt::Write as _;

use calib_report::terminal::wrapped;

use crate::list::{Plan, Why};
use crate::note::Note;
use crate::words;

/// Columns of the names on the left.
const LEFT: usize = 15;
/// Lines for notes at the most.
const NOTES: usize = 9;

/// The summary of so many columns; `folder`: where the files are.
#[must_use]
pub fn summary(plan: &Plan, folder: &str, columns: usize) -> String {
    let mut text = String::new();
    let count = |why: Why| plan.postures.iter().filter(|p| p.why == why).count();
    let detours = count(Why::Detour);
    let measured = plan.postures.len() - detours;
    let title = format!(
        "Plan for {}: {measured} postures to record, {} to validate with",
        plan.robot,
        plan.held_out.len()
    );
    text += &wrapped(&title, columns, "", "  ");
    let mut line = |name: &str, said: &str| {
        let first = format!("{name:<LEFT$}");
        text += &wrapped(said, columns, &first, &" ".repeat(LEFT));
    };
    line("chosen for", words::goal(plan.goal));
    let [sigma, before] = [plan.sigma, plan.sigma_before].map(words::length);
    line("expected σ", &format!("{sigma} (before: {before})"));
    let stops = [12, 24].into_iter().filter(|n| *n < measured);
    let stops: Vec<String> = stops
        .map(|n| format!("{n}: {}", words::length(after(plan, n))))
        .collect();
    if !stops.is_empty() {
        line("if stopped at", &stops.join(", "));
    }
    let efficiency = format!(
        "at least {:.1} % of the best possible {} (certified)",
        (plan.efficiency * 1000.0).floor() / 10.0,
        words::efficiency_of(plan.goal)
    );
    line("efficiency", &efficiency);
    let postures = format!(
        "{} by information, {} space-filling, {} from both sides; {detours} detours",
        count(Why::Information),
        count(Why::SpaceFilling),
        count(Why::OtherSide)
    );
    line("postures", &postures);
    let candidates = format!(
        "{} of {} possible; {}",
        plan.counts.feasible,
        plan.counts.tried,
        words::removed(&plan.counts)
    );
    line("candidates", &candidates);
    let motion = format!("{:.0} s without the holds", plan.motion_time);
    line("motion", &motion);
    let weak = plan.weak();
    if !weak.is_empty() {
        let names: Vec<&str> = weak.iter().take(3).map(|p| p.name.as_str()).collect();
        let remain = format!(
            "{} parameters remain near their prior: {}",
            weak.len(),
            names.join(", ")
        );
        line("weak", &remain);
    }
    text + &last_lines(plan, folder, columns)
}

/// Notes, and what to do with the plan.
fn last_lines(plan: &Plan, folder: &str, columns: usize) -> String {
    let detours = plan.postures.iter().filter(|p| p.why == Why::Detour);
    let detours = detours.count();
    let last = words::record_them(folder, detours, plan.blocked.is_empty(), &plan.notes);
    let last = wrapped(&last, columns, "", "");
    let room = (NOTES + 1).saturating_sub(last.lines().count());
    let mut notes = String::new();
    // What motions are not checked for stands in the last lines.
    let others = plan.notes.iter().filter(|note| !words::is_unchecked(note));
    // First what endangers, then what is not written or not determined: the rest may stand on the page alone.
    let mut others: Vec<&Note> = others.collect();
    others.sort_by_key(|note| match note {
        note if is_danger(note) => 0,
        Note::NoClearMotion { .. } | Note::TaskOpen => 1,
        _ => 2,
    });
    for (k, note) in others.iter().enumerate() {
        let one = wrapped(&words::brief(note), columns, "note: ", "      ");
        if !is_danger(note) && notes.lines().count() + one.lines().count() > room {
            let _ = writeln!(notes, "note: {} more in plan.html", others.len() - k);
            break;
        }
        notes += &one;
    }
    notes + &last
}

/// Whether the robot may hit something that the user stated.
fn is_danger(note: &Note) -> bool {
    matches!(note, Note::SurroundingsUnchecked { .. })
}

/// σ after so many measured postures.
fn after(plan: &Plan, count: usize) -> Option<f64> {
    let mut measured = plan.postures.iter().filter(|p| p.why != Why::Detour);
    measured.nth(count - 1)?.sigma
}
