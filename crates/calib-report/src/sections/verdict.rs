//! The verdict, the errors on held-out poses, what is not observable.

use super::{Block, Page, code, mm};
use crate::table::Table;
use crate::words;
use crate::words::observability::grouped;
use crate::words::prose::{full_stop, sentence};
use crate::{Meaning, Report, Unit, Verdict, number};

/// Held-out poses in the table; `report.json` has all of them.
const POSES: usize = 10;

pub(super) fn head(page: &mut Page, report: &Report) {
    page.section(
        "verdict",
        format!("Calibration of {}: {}", report.robot, report.verdict_line()),
    );
    if report.verdict == Verdict::NotEvaluated {
        page.text("Nothing says that the result is wrong, and the evidence that it is right does not suffice: it is not accepted.");
    }
    if let Some(diagnosis) = words::diagnosis::diagnosis(report) {
        page.text(format!("Diagnosis: {}", diagnosis.join(" ")));
    }
    // The table of limits already lists what was met.
    let remarks = words::remarks::remarks(report).into_iter();
    let remarks: Vec<_> = remarks.map(|r| (r.text, r.remedy)).collect();
    if !remarks.is_empty() {
        page.push(Block::List(remarks));
    }
    let mut limits = Table::new(&["<limit", ">value", ">limit", "<", "<reason"]);
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
    page.text("Valid for:");
    page.list(words::scope::valid_for(report));
    if let Some(excluded) = words::scope::not_for_line(report) {
        page.text(excluded);
    }
    let identification = words::headline::identification(report);
    if !identification.is_empty() {
        page.text(format!("{}.", words::prose::capital(&identification)));
    }
    let fit = report
        .fit
        .as_ref()
        .map_or_else(String::new, |fit| format!("; {}", words::fit::summary(fit)));
    page.text(format!(
        "Profile {}, method `{}`{fit}.",
        code(&report.profile),
        report.method.name()
    ));
}

/// The patched URDF without the effects that it cannot hold.
const ALONE: &str = "URDF without effects";

/// The URDF that was fitted to be used without them.
const REFITTED: &str = "URDF fitted without effects";

pub(super) fn held_out(page: &mut Page, report: &Report) {
    page.section("held-out", "Errors on held-out poses");
    let Some(held_out) = &report.verification.held_out else {
        page.text(words::held_out::missing(report));
        return;
    };
    page.text(words::held_out::table_intro(held_out));
    let mut table = Table::new(&["<model", ">mean", ">rms", ">95 %", ">max"]);
    for (name, stats) in [
        ("nominal", held_out.nominal),
        ("registration only", held_out.registration_only),
        (ALONE, held_out.urdf_alone),
        (REFITTED, held_out.urdf_refitted),
        ("calibrated", held_out.calibrated),
    ] {
        // Not a row of its own where the URDF holds everything.
        if stats.is_none() && [ALONE, REFITTED].contains(&name) {
            continue;
        }
        let cells = match stats {
            Some(stats) => [stats.mean_m, stats.rms_m, stats.p95_m, stats.max_m].map(mm),
            None => std::array::from_fn(|_| number::UNKNOWN.to_owned()),
        };
        table.row([name.to_owned()].into_iter().chain(cells));
    }
    page.table("", table);
    page.text(
        "Nominal: the nominal URDF, with the bodies placed by closed-form estimators. Registration only: the nominal URDF after the best fit of the tracker and the bodies. Calibrated: this result.",
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
            "Orientation of the same bodies, predicted minus measured, deg:",
            table,
        );
    }
    page.text(format!(
        "Expected on a new pose: {}",
        words::held_out::expected_error(report).join(" ")
    ));

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
        // Empty, not a dash: the column of a model without errors is dropped.
        let cell = |error: Option<f64>| error.map_or_else(String::new, mm);
        table.row([
            pose.label(),
            pose.group.clone(),
            cell(pose.nominal_m),
            cell(pose.registration_only_m),
            cell(pose.calibrated_m),
            pose.calibrated_rad
                .map_or_else(String::new, |angle| number::plain(angle, Unit::Radian)),
            words::held_out::joints(&pose.joints),
        ]);
    }
    page.table(&words::held_out::worst_poses(POSES, poses.len()), table);
}

pub(super) fn open_ends(page: &mut Page, report: &Report) {
    page.section("not-observable", "What is not observable");
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
            "Not measured: predictions that depend on these parameters follow the nominal URDF, not the data.",
            of(Meaning::NotMeasured),
        ),
        (
            "Degrees of freedom of transforms (rotation or translation of the second frame) that are not observable:",
            transforms,
        ),
        (
            "Arbitrary conventions: equivalent parameter values; every prediction of a tracked body is the same with any of them.",
            of(Meaning::Convention),
        ),
    ];
    if parts.iter().all(|(_, items)| items.is_empty()) {
        let nothing = report.transforms.is_empty() && report.parameters.is_empty();
        page.text(if nothing {
            "Nothing was solved."
        } else {
            words::observability::ALL_OBSERVABLE
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
        page.section("next-steps", "Next steps");
        page.list(report.next_steps.iter().map(|step| sentence(step)));
    }
}

/// A remedy shared by consecutive items is shown once, at the last of them.
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
