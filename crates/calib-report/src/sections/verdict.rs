//! The verdict, the error on new poses, what is open.

use super::{Block, Page, code, mm};
use crate::table::Table;
use crate::words::held_out::held_out_of;
use crate::words::observability::grouped;
use crate::words::prose::{full_stop, sentence};
use crate::{Meaning, Report, Unit, Verdict, answers, number};

/// Held-out poses in the table; all of them stand in `report.json`.
const POSES: usize = 10;

pub(super) fn head(page: &mut Page, report: &Report) {
    page.section(
        "verdict",
        format!("Calibration of {}: {}", report.robot, report.verdict.word()),
    );
    if report.verdict == Verdict::NotEvaluated {
        page.text("Not a pass: nothing was exceeded, but not every limit could be evaluated.");
    }
    // What was met stands in the table of limits already.
    if report.verdict != Verdict::Accepted || report.limits.is_empty() {
        page.list(report.reasons.iter().map(|reason| sentence(reason)));
    }
    let mut limits = Table::new(&["<limit", ">found", ">allowed", "<", "<why"]);
    for limit in &report.limits {
        limits.row([
            limit.quantity.clone(),
            number::plain_or_unknown(limit.value, limit.unit),
            number::plain(limit.limit, limit.unit),
            limit.outcome.word().to_owned(),
            limit.reason.clone(),
        ]);
    }
    page.table("", limits);
    if !report.scope.is_empty() {
        page.text("It holds for:");
        page.list(report.scope.iter().map(|scope| sentence(scope)));
    }
    let fit = report.fit.as_ref().map_or_else(String::new, |fit| {
        let chi2 = fit.chi2_per_dof.map_or_else(String::new, |chi2| {
            format!(", χ²/dof {}", number::fixed(chi2, 2))
        });
        format!(
            "; {} ({} measured poses and points, {} unknowns{chi2})",
            fit.status, fit.observations, fit.unknowns
        )
    });
    page.text(format!(
        "Profile {}, method `{}`{fit}.",
        code(&report.profile),
        report.method.name()
    ));
}

pub(super) fn held_out(page: &mut Page, report: &Report) {
    page.section("held-out", "Error on poses that were not fitted");
    let Some(held_out) = &report.verification.held_out else {
        let reason = if report.verification.reason.is_empty() {
            "no pose was held out."
        } else {
            &report.verification.reason
        };
        page.text(format!("Not evaluated: {}", reason));
        return;
    };
    page.text(sentence(&format!(
        "{}; predicted against measured, in mm",
        held_out_of(held_out)
    )));
    let mut table = Table::new(&["<model", ">mean", ">rms", ">95 %", ">max"]);
    for (name, stats) in [
        ("nominal", held_out.nominal),
        ("registration only", held_out.registration_only),
        ("calibrated", held_out.calibrated),
    ] {
        let cells = match stats {
            Some(stats) => [stats.mean_m, stats.rms_m, stats.p95_m, stats.max_m].map(mm),
            None => std::array::from_fn(|_| number::UNKNOWN.to_owned()),
        };
        table.row([name.to_owned()].into_iter().chain(cells));
    }
    page.table("", table);
    page.text(
        "Nominal: the robot as described, its bodies placed by closed forms. Registration only: the robot as described after the best fit of the tracker's place and of the bodies. Calibrated: this result.",
    );
    if let Some(orientation) = &held_out.orientation {
        let mut table = Table::new(&["<model", ">mean", ">rms", ">95 %", ">max"]);
        for (name, stats) in [
            ("nominal", orientation.nominal),
            ("registration only", orientation.registration_only),
            ("calibrated", orientation.calibrated),
        ] {
            let cells = match stats {
                Some(stats) => {
                    [stats.mean_rad, stats.rms_rad, stats.p95_rad, stats.max_rad].map(deg)
                }
                None => std::array::from_fn(|_| number::UNKNOWN.to_owned()),
            };
            table.row([name.to_owned()].into_iter().chain(cells));
        }
        page.table(
            "Orientation of the same bodies, predicted against measured, deg:",
            table,
        );
    }
    if let Some(answer) = answers(report)
        .into_iter()
        .find(|answer| answer.id == "expected-error")
    {
        page.text(format!("On a new pose: {}", answer.lines.join(" ")));
    }

    let mut poses: Vec<_> = held_out.poses.iter().collect();
    poses.sort_by(|a, b| {
        b.calibrated_m
            .unwrap_or(-1.0)
            .total_cmp(&a.calibrated_m.unwrap_or(-1.0))
    });
    let mut table = Table::new(&[
        "<pose",
        "<group",
        ">nominal",
        ">registration only",
        ">calibrated",
        ">orientation",
        "<joints",
    ]);
    for pose in poses.iter().take(POSES) {
        // Empty, not a dash: a model that no pose has loses its column.
        let cell = |error: Option<f64>| error.map_or_else(String::new, mm);
        let joints: Vec<String> = pose
            .joints
            .iter()
            .map(|joint| format!("{} {}", joint.joint, number::plain(joint.value, joint.unit)))
            .collect();
        table.row([
            pose.label(),
            pose.group.clone(),
            cell(pose.nominal_m),
            cell(pose.registration_only_m),
            cell(pose.calibrated_m),
            pose.calibrated_rad
                .map_or_else(String::new, |angle| number::plain(angle, Unit::Radian)),
            joints.join(", "),
        ]);
    }
    let title = if poses.len() > POSES {
        format!(
            "The {POSES} worst of {}, mm (orientation: calibrated):",
            poses.len()
        )
    } else {
        "Every pose, the worst first, mm:".to_owned()
    };
    page.table(&title, table);
}

pub(super) fn open_ends(page: &mut Page, report: &Report) {
    page.section("not-observable", "What is not known");
    let transforms: Vec<(String, String)> = report
        .transforms
        .iter()
        .flat_map(|transform| {
            transform.unobservable.iter().map(|item| {
                (
                    format!("{}: {}", code(&transform.name), full_stop(&item.text)),
                    item.remedy.clone(),
                )
            })
        })
        .collect();
    let of = |meaning: Meaning| {
        let items = report.not_observable.iter();
        grouped(
            &items
                .filter(|item| item.meaning == meaning)
                .collect::<Vec<_>>(),
        )
    };
    let parts = [
        (
            "Not measured: what depends on it is predicted as described, not as found.",
            of(Meaning::NotMeasured),
        ),
        (
            "Directions of transforms (a turn or a shift of the second frame) that no measurement shows:",
            transforms,
        ),
        (
            "By convention: several descriptions of one robot; the tracked bodies are predicted the same with any of them.",
            of(Meaning::Convention),
        ),
    ];
    if parts.iter().all(|(_, items)| items.is_empty()) {
        let nothing = report.transforms.is_empty() && report.parameters.is_empty();
        page.text(if nothing {
            "Everything: nothing was solved."
        } else {
            "Everything that was asked for is observable."
        });
    }
    for (intro, items) in parts {
        if items.is_empty() {
            continue;
        }
        page.text(intro);
        let items = shared_remedies(items);
        let finished = |(text, remedy): (String, String)| {
            let remedy = if remedy.is_empty() {
                remedy
            } else {
                full_stop(&remedy)
            };
            (sentence(&text), remedy)
        };
        page.push(Block::List(items.into_iter().map(finished).collect()));
    }
    if !report.next_steps.is_empty() {
        page.section("next-steps", "What to do next");
        page.list(report.next_steps.iter().map(|step| sentence(step)));
    }
}

/// A remedy that the next item repeats stands once, at the last.
fn shared_remedies(mut items: Vec<(String, String)>) -> Vec<(String, String)> {
    for i in 1..items.len() {
        if items[i - 1].1 == items[i].1 {
            items[i - 1].1.clear();
        }
    }
    items
}

fn deg(radians: f64) -> String {
    number::bare(radians, Unit::Radian)
}
