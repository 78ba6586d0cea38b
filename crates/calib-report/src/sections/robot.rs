//! Results about the robot: changes, transforms, loops, other estimators, parameters.

use super::{Page, code};
use crate::table::Table;
use crate::{LoopClosure, LoopGroup, Report, RobotChange, Stats, Unit, number, words};

/// What changed of the robot itself.
pub(super) fn changes(page: &mut Page, report: &Report) {
    page.section("changes", "What changed");
    let effects = words::robot::effects(report);
    if report.robot_changes.is_empty() && effects.is_empty() {
        page.text("No dimension of the robot was estimated that no choice of frames changes.");
    } else {
        page.text("Dimensions of the robot that no choice of frames changes, and effects of its joints; the most significant first.");
    }
    let all = RobotChange::sorted([report.robot_changes.clone(), effects].concat());
    let (measured, open): (Vec<_>, Vec<_>) = all.into_iter().partition(|c| c.measured);
    page.table("", changed(&measured));
    if let Some(scale) = words::robot::scale(&measured) {
        page.text(scale);
    }
    if !open.is_empty() {
        let names: Vec<String> = open.iter().map(|c| c.text.clone()).collect();
        page.text(format!(
            "Not determined by the data alone: {}.",
            names.join("; ")
        ));
    }
    if let Some(line) = words::robot::parameters(report) {
        page.text(format!("{line} {}", words::robot::CONVENTIONS));
    }
}

fn changed(changes: &[RobotChange]) -> Table {
    let mut table = Table::new(&[
        "<quantity",
        ">nominal",
        ">calibrated ± σ",
        ">change ± σ",
        ">change",
    ]);
    for change in changes {
        let [before, after] = words::robot::before_and_after(change);
        let delta = change.change.map_or_else(
            || number::UNKNOWN.to_owned(),
            |delta| number::change(delta, change.sigma, change.unit),
        );
        let z = words::robot::significance(change);
        table.row([change.text.clone(), before, after, delta, z]);
    }
    table
}

/// The changed values of the URDF, conventions included.
pub(super) fn urdf(page: &mut Page, report: &Report) {
    page.section("urdf", "Changed values of the URDF");
    if report.changes.is_empty() {
        page.text("No value of the URDF changed.");
        return;
    }
    page.text("x, y, z along the axes of the parent link; rotations about the axes of the joint's original frame. Data share: fraction of the prior variance removed by the data (100 %: fully measured); a value with a small share is a convention or comes from its prior.");
    page.folded("Values before and after", urdf_values(report));
    if !report.urdf_diff.is_empty() {
        page.code("diff", &report.urdf_diff);
    }
}

fn urdf_values(report: &Report) -> Table {
    let mut table = Table::new(&[
        "<joint",
        "<value",
        ">before",
        ">after",
        ">change ± σ",
        ">data share",
    ]);
    for change in &report.changes {
        let plain = |x: f64| number::fixed_with_unit(x, change.unit, 3);
        // A value that was added has no change: its σ is shown with the value itself.
        let (old, new) = match change.old {
            Some(old) => (plain(old), plain(change.new)),
            None => (
                "none".to_owned(),
                change.sigma.map_or_else(
                    || plain(change.new),
                    |sigma| number::with_sigma(change.new, Some(sigma), change.unit),
                ),
            ),
        };
        let delta = change.delta.map_or_else(
            || "added".to_owned(),
            |delta| number::change(delta, change.sigma, change.unit),
        );
        table.row([
            code(&change.joint),
            change.what.clone(),
            old,
            new,
            delta,
            change
                .data_share
                .map_or_else(|| number::UNKNOWN.to_owned(), number::percent),
        ]);
    }
    table
}

pub(super) fn transforms(page: &mut Page, report: &Report) {
    if report.transforms.is_empty() {
        return;
    }
    page.section("transforms", "Transforms");
    page.text("`parent ← child`; translation ± σ along the axes of the parent; roll, pitch, yaw as in the URDF; σ of the rotation about the axes of the child. Partial: not every degree of freedom is observable, see What is not observable.");
    let mut table = Table::new(&[
        "<name",
        "<parent ← child",
        "<status",
        ">x",
        ">y",
        ">z",
        ">rpy",
        ">σ rotation",
    ]);
    for transform in &report.transforms {
        let place = |i: usize| {
            number::with_sigma(
                transform.translation_m[i],
                transform.sigma_translation_m.map(|sigma| sigma[i]),
                Unit::Meter,
            )
        };
        let finest = transform
            .sigma_rotation_rad
            .map(|sigma| sigma.into_iter().fold(f64::INFINITY, f64::min));
        let rpy = transform
            .rpy_rad
            .map(|angle| number::rounded_by_sigma(angle, finest, Unit::Radian))
            .join(", ");
        let sigma = transform.sigma_rotation_rad.map_or_else(
            || number::UNKNOWN.to_owned(),
            |sigma| {
                sigma
                    .map(|s| number::sigma(Some(s), Unit::Radian))
                    .join(", ")
            },
        );
        table.row([
            code(&transform.name),
            format!("{} ← {}", transform.parent, transform.child),
            crate::words::transforms::status(transform),
            place(0),
            place(1),
            place(2),
            rpy,
            sigma,
        ]);
    }
    page.table("", table);
}

pub(super) fn loops(page: &mut Page, report: &Report) {
    if report.loops.is_empty() {
        return;
    }
    page.section("loops", "Loop closures");
    page.text("Measurement compared with forward kinematics: e_t is the translation and e_θ the rotation angle of `measured⁻¹ · kinematic`.");
    for closure in &report.loops {
        let title = format!(
            "{}, {} poses, by {}:",
            code(&closure.name),
            closure.samples,
            if closure.grouped_by.is_empty() {
                "group"
            } else {
                &closure.grouped_by
            }
        );
        if !closure.groups.is_empty() {
            page.table(&title, by_group(closure));
        }
        let mut table = Table::new(&["<error", ">max", ">mean", ">std", ">rms"]);
        let mut stats = |name: &str, stats: &Stats, unit: Unit| {
            let cells =
                [stats.max, stats.mean, stats.std, stats.rms].map(|x| number::plain(x, unit));
            table.row([name.to_owned()].into_iter().chain(cells));
        };
        if let Some(norm) = &closure.norm_error_m {
            stats(
                "error of the norm, as in the paper (a lower bound)",
                norm,
                Unit::Meter,
            );
        }
        stats("vector error ‖e_t‖", &closure.translation_m, Unit::Meter);
        if let Some(rotation) = &closure.rotation_rad {
            stats("|e_θ|", rotation, Unit::Radian);
        }
        page.table(
            &format!("{}, all {} poses:", code(&closure.name), closure.samples),
            table,
        );
    }
}

/// The paper's Table 1: one row per statistic, one column per group.
fn by_group(closure: &LoopClosure) -> Table {
    let heads: Vec<String> = std::iter::once("<error".to_owned())
        .chain(
            closure
                .groups
                .iter()
                .map(|group| format!(">{} (n = {})", group.name, group.samples)),
        )
        .collect();
    let mut table = Table::new(&heads.iter().map(String::as_str).collect::<Vec<_>>());
    let mut row = |name: &str, cell: &dyn Fn(&LoopGroup) -> String| {
        table.row(std::iter::once(name.to_owned()).chain(closure.groups.iter().map(cell)))
    };
    row("max ‖e_t‖ (cm)", &|group| {
        number::centimeters(group.translation_m.max)
    });
    row("mean ‖e_t‖ (cm)", &|group| {
        number::centimeters(group.translation_m.mean)
    });
    row("std ‖e_t‖ (cm)", &|group| {
        number::centimeters(group.translation_m.std)
    });
    if closure
        .groups
        .iter()
        .any(|group| group.rotation_rad.is_some())
    {
        let angle = |group: &LoopGroup, of: fn(&Stats) -> f64| {
            group.rotation_rad.as_ref().map_or_else(
                || number::UNKNOWN.to_owned(),
                |stats| number::degrees(of(stats)),
            )
        };
        row("max |e_θ| (deg)", &|group| angle(group, |stats| stats.max));
        row("mean |e_θ| (deg)", &|group| {
            angle(group, |stats| stats.mean)
        });
        row("std |e_θ| (deg)", &|group| angle(group, |stats| stats.std));
    }
    table
}

pub(super) fn estimators(page: &mut Page, report: &Report) {
    if report.estimators.is_empty() {
        return;
    }
    page.section("estimators", "Cross-check with other estimators");
    page.text("Each result compared with the estimate used in this report: the distance, and whether the two uncertainties explain it.");
    let mut table = Table::new(&[
        "<quantity",
        "<estimator",
        ">value ± σ",
        ">distance",
        "<agrees",
        "<note",
    ]);
    for result in &report.estimators {
        let sigma = |i: usize| {
            result
                .sigma
                .as_ref()
                .and_then(|sigma| sigma.get(i))
                .copied()
        };
        let values = result.value.as_ref().map_or_else(
            || "no answer".to_owned(),
            |values| {
                values
                    .iter()
                    .enumerate()
                    .map(|(i, value)| number::with_sigma(*value, sigma(i), result.unit))
                    .collect::<Vec<_>>()
                    .join(", ")
            },
        );
        let distance = number::plain_or_unknown(result.distance, result.unit);
        let agrees = if result.agrees { "yes" } else { "no" };
        table.row([
            result.quantity.clone(),
            code(&result.estimator),
            values,
            distance,
            agrees.to_owned(),
            result.text.clone(),
        ]);
    }
    page.table("", table);
}

pub(super) fn parameters(page: &mut Page, report: &Report) {
    if report.parameters.is_empty() {
        return;
    }
    page.section("parameters", "Parameters");
    page.text("Origins and mounts are corrections to the nominal pose, in the axes of the child. Identifiable: at most 10 % of the prior variance remains; weakly identifiable: at most 50 %; prior only: more than 50 %; not identifiable: part of a combination that is not observable, or of a joint that did not move.");
    let mut table = Table::new(&[
        "<parameter",
        "<kind",
        ">nominal",
        ">value ± σ",
        ">data share",
        "<class",
    ]);
    for parameter in &report.parameters {
        let share = parameter
            .data_share
            .map_or_else(|| number::UNKNOWN.to_owned(), number::percent);
        let value = number::with_sigma(parameter.value, parameter.sigma, parameter.unit);
        table.row([
            code(&parameter.name),
            parameter.kind.clone(),
            number::plain(parameter.nominal, parameter.unit),
            value,
            share,
            parameter.class.word().to_owned(),
        ]);
    }
    page.folded("Every parameter of the fit", table);
    let fit = report.fit.as_ref();
    if let Some(ratio) = fit.and_then(|fit| fit.cluster_robust_ratio) {
        page.text(words::fit::cluster_robust(ratio));
    }
}
