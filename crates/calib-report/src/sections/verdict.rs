//! The verdict, the error on new poses, what is open.

use super::{Block, Page, code, mm, sentence};
use crate::answers::limit_sentence;
use crate::table::Table;
use crate::{Report, Verdict, answers, number};

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
    page.list(&report.reasons);
    if !report.scope.is_empty() {
        page.text("It holds for:");
        page.list(&report.scope);
    }
    if !report.limits.is_empty() {
        page.text("Limits:");
        page.list(report.limits.iter().map(limit_sentence));
    }
    let fit = report.fit.as_ref().map_or_else(String::new, |fit| {
        let chi2 = fit.chi2_per_dof.map_or_else(String::new, |chi2| {
            format!(", χ²/dof {}", number::fixed(chi2, 2))
        });
        format!(
            "; {} ({} observations, {} unknowns{chi2})",
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
    let quantity = if held_out.quantity.is_empty() {
        String::new()
    } else {
        format!("{}, ", held_out.quantity)
    };
    page.text(format!("{quantity}{} poses, mm.", held_out.n));
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
            pose.pose.clone(),
            pose.group.clone(),
            cell(pose.nominal_m),
            cell(pose.registration_only_m),
            cell(pose.calibrated_m),
            joints.join(", "),
        ]);
    }
    let title = if poses.len() > POSES {
        format!("The {POSES} worst of {} poses, mm:", poses.len())
    } else {
        "Every pose, the worst first, mm:".to_owned()
    };
    page.table(&title, table);
}

pub(super) fn open_ends(page: &mut Page, report: &Report) {
    page.section("not-observable", "What is not known");
    let mut items = Vec::new();
    for transform in &report.transforms {
        items.extend(transform.unobservable.iter().map(|item| {
            (
                transform.name.as_str(),
                item.text.as_str(),
                item.remedy.as_str(),
            )
        }));
    }
    items.extend(report.not_observable.iter().map(|item| {
        (
            item.subject.as_str(),
            item.text.as_str(),
            item.remedy.as_str(),
        )
    }));
    if items.is_empty() {
        let nothing = report.transforms.is_empty() && report.parameters.is_empty();
        page.text(if nothing {
            "Everything: nothing was solved."
        } else {
            "Everything that was asked for is observable."
        });
    }
    let item = |(subject, text, remedy): (&str, &str, &str)| {
        let remedy = if remedy.is_empty() {
            String::new()
        } else {
            sentence(remedy)
        };
        (format!("{}: {}", code(subject), sentence(text)), remedy)
    };
    if !items.is_empty() {
        page.push(Block::List(items.into_iter().map(item).collect()));
    }
    if !report.next_steps.is_empty() {
        page.section("next-steps", "What to do next");
        page.list(&report.next_steps);
    }
}
