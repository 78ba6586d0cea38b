//! What a terminal shows of a fleet.

use calib_finding::printable_line;
use std::fmt::Write as _;

use super::summary::Summary;

/// Robots that are named, at the most: the others stand in the table.
const NAMED: usize = 20;

/// The fleet in some lines.
#[must_use]
pub fn text(summary: &Summary) -> String {
    let mut out = String::new();
    let counts = summary.verdicts.iter();
    let counts = counts.map(|(verdict, n)| format!("{n} {}", verdict.replace('_', " ")));
    let counts: Vec<String> = counts.collect();
    // Writing to a String does not fail.
    let _ = writeln!(out, "{} robots: {}", summary.robots, counts.join(", "));
    for (id, n) in &summary.failures {
        let _ = writeln!(out, "  {n} without a result: {id}");
    }
    let drift = &summary.drift;
    let familywise = drift.alarms.iter().filter(|a| a.familywise).count();
    let unknown = drift.not_compared.len();
    if unknown > 0 {
        let names = drift.not_compared.iter().take(NAMED);
        let names: Vec<String> = names.map(|name| printable_line(name).to_string()).collect();
        let more = match unknown.saturating_sub(NAMED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let _ = writeln!(
            out,
            "{unknown} could not be compared with the last calibration (why: `not_compared` in fleet.csv): {}{more}",
            names.join(", "),
        );
    }
    if drift.compared == 0 {
        out.push_str("none compared with an earlier calibration: nothing is known of changes\n");
        return out;
    }
    let _ = writeln!(
        out,
        "{} compared with their last calibration: {} changed (false alarms: 1 % of robots), {familywise} of them at 1 % for the whole fleet",
        drift.compared,
        drift.alarms.len(),
    );
    for alarm in drift.alarms.iter().filter(|a| a.familywise).take(NAMED) {
        let joint = alarm.joint.as_deref().unwrap_or("no single joint");
        let alarm = format!("{} ({}): {joint}", alarm.name, alarm.series);
        let _ = writeln!(out, "  {}", printable_line(&alarm));
    }
    if familywise > NAMED {
        let _ = writeln!(out, "  and {} more, in fleet.csv", familywise - NAMED);
    }
    for effect in drift.series.iter().filter(|effect| effect.drifts) {
        let _ = writeln!(
            out,
            "series {}: joint {} changed in {} of {} robots, of which chance alone explains about {:.0}",
            printable_line(&effect.series),
            printable_line(&effect.joint),
            effect.changed,
            effect.robots,
            drift.by_chance(effect),
        );
    }
    out
}
