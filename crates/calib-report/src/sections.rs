//! What the long report says, in the order in which a reader doubts: text, lists and tables that Markdown and HTML share.
//!
//! Text is plain but for one mark: what stands between backticks is a name, a path or a key.

use crate::answers::limit_sentence;
use crate::table::Table;
use crate::{LoopClosure, LoopGroup, Report, Stats, Unit, Verdict, answers, number};

/// Held-out poses in the table; all of them stand in `report.json`.
const POSES: usize = 10;

/// Row numbers in a table cell before the rest is counted.
const ROWS: usize = 8;

/// A part of the report under one heading.
#[derive(Debug, Clone)]
pub(crate) struct Section {
    /// Stable id of the heading.
    pub(crate) id: &'static str,
    pub(crate) title: String,
    pub(crate) blocks: Vec<Block>,
}

/// What stands in a section.
#[derive(Debug, Clone)]
pub(crate) enum Block {
    Text(String),
    /// Statements, each with what to do about it (or nothing).
    List(Vec<(String, String)>),
    /// A table under its caption; the caption may be empty.
    Table(String, Table),
    /// Language and text.
    Code(&'static str, String),
}

/// All sections; the first is the verdict.
pub(crate) fn sections(report: &Report) -> Vec<Section> {
    let mut page = Page(Vec::new());
    head(&mut page, report);
    held_out(&mut page, report);
    open_ends(&mut page, report);
    changes(&mut page, report);
    transforms(&mut page, report);
    loops(&mut page, report);
    estimators(&mut page, report);
    data(&mut page, report);
    residuals(&mut page, report);
    accuracy(&mut page, report);
    parameters(&mut page, report);
    files(&mut page, report);
    page.0
}

struct Page(Vec<Section>);

impl Page {
    fn section(&mut self, id: &'static str, title: impl Into<String>) {
        self.0.push(Section {
            id,
            title: title.into(),
            blocks: Vec::new(),
        });
    }

    fn push(&mut self, block: Block) {
        if let Some(section) = self.0.last_mut() {
            section.blocks.push(block);
        }
    }

    fn text(&mut self, text: impl Into<String>) {
        self.push(Block::Text(text.into()));
    }

    fn list<T: AsRef<str>>(&mut self, items: impl IntoIterator<Item = T>) {
        let items: Vec<_> = items
            .into_iter()
            .map(|item| (item.as_ref().to_owned(), String::new()))
            .collect();
        if !items.is_empty() {
            self.push(Block::List(items));
        }
    }

    fn table(&mut self, caption: &str, table: Table) {
        if !table.is_empty() {
            self.push(Block::Table(
                caption.to_owned(),
                table.without_empty_columns(),
            ));
        }
    }

    fn code(&mut self, language: &'static str, text: &str) {
        self.push(Block::Code(
            language,
            text.trim_end_matches('\n').to_owned(),
        ));
    }
}

/// A name, a path or a key as code.
fn code(text: &str) -> String {
    if text.is_empty() {
        String::new()
    } else {
        format!("`{}`", text.replace('`', "'"))
    }
}

/// One line that ends like a sentence.
fn sentence(text: &str) -> String {
    let text = text.trim();
    if text.ends_with(['.', '!', '?']) {
        text.to_owned()
    } else {
        format!("{text}.")
    }
}

fn mm(metres: f64) -> String {
    number::bare(metres, Unit::Metre)
}

fn head(page: &mut Page, report: &Report) {
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

fn held_out(page: &mut Page, report: &Report) {
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

fn open_ends(page: &mut Page, report: &Report) {
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

fn changes(page: &mut Page, report: &Report) {
    page.section("changes", "What changed");
    if report.changes.is_empty() {
        page.text("No number of the URDF changed.");
    }
    let mut table = Table::new(&[
        "<joint",
        "<what",
        ">before",
        ">after",
        ">change ± σ",
        ">from the data",
    ]);
    for change in &report.changes {
        let plain = |x: f64| number::fixed_with_unit(x, change.unit, 3);
        let old = change.old.map_or_else(|| "added".to_owned(), plain);
        let delta = change.delta.map_or_else(
            || number::UNKNOWN.to_owned(),
            |delta| number::change(delta, change.sigma, change.unit),
        );
        table.row([
            code(&change.joint),
            change.what.clone(),
            old,
            plain(change.new),
            delta,
            change
                .data_share
                .map_or_else(|| number::UNKNOWN.to_owned(), number::percent),
        ]);
    }
    page.table("", table);
    if !report.urdf_diff.is_empty() {
        page.code("diff", &report.urdf_diff);
    }
}

fn transforms(page: &mut Page, report: &Report) {
    if report.transforms.is_empty() {
        return;
    }
    page.section("transforms", "Transforms");
    page.text("`parent ← child`; translation ± σ along the parent's axes; roll, pitch, yaw of the URDF; σ of the rotation about the child's axes.");
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
                Unit::Metre,
            )
        };
        let rpy = transform
            .rpy_rad
            .map(|angle| number::fixed_in(angle, Unit::Radian, 3))
            .join(", ")
            + "°";
        let sigma = transform.sigma_rotation_rad.map_or_else(
            || number::UNKNOWN.to_owned(),
            |sigma| {
                sigma
                    .map(|s| number::sigma(Some(s), Unit::Radian))
                    .join(", ")
            },
        );
        let status = if transform.observable {
            transform.status.word().to_owned()
        } else {
            format!("{}, in part", transform.status.word())
        };
        table.row([
            code(&transform.name),
            format!("{} ← {}", transform.parent, transform.child),
            status,
            place(0),
            place(1),
            place(2),
            rpy,
            sigma,
        ]);
    }
    page.table("", table);
}

fn loops(page: &mut Page, report: &Report) {
    if report.loops.is_empty() {
        return;
    }
    page.section("loops", "Loop closures");
    page.text("Measured against forward kinematics: e_t the translation, e_θ the rotation angle of `measured⁻¹ · kinematic`.");
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
            stats("norm error, the paper's (a lower bound)", norm, Unit::Metre);
        }
        stats("vector error ‖e_t‖", &closure.translation_m, Unit::Metre);
        if let Some(rotation) = &closure.rotation_rad {
            stats("|e_θ|", rotation, Unit::Radian);
        }
        page.table(
            &format!("{}, all {} poses:", code(&closure.name), closure.samples),
            table,
        );
    }
}

/// The paper's Table 1: a row per number, a column per group.
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
        number::centimetres(group.translation_m.max)
    });
    row("mean ‖e_t‖ (cm)", &|group| {
        number::centimetres(group.translation_m.mean)
    });
    row("std ‖e_t‖ (cm)", &|group| {
        number::centimetres(group.translation_m.std)
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

fn estimators(page: &mut Page, report: &Report) {
    if report.estimators.is_empty() {
        return;
    }
    page.section("estimators", "The same by other estimators");
    let mut table = Table::new(&[
        "<quantity",
        "<estimator",
        ">value ± σ",
        ">distance",
        "<agrees",
        "<why",
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

fn data(page: &mut Page, report: &Report) {
    page.section("data", "The data");
    let mut table = Table::new(&[
        "<recording",
        "<for",
        ">rows",
        ">used",
        ">rejected",
        "<lost by the tracker",
    ]);
    for recording in &report.recordings {
        let lost: Vec<String> = recording
            .lost
            .iter()
            .map(|lost| format!("{} {} of {}", lost.subject, lost.lost, lost.of))
            .collect();
        let [rows, used, rejected] =
            [recording.rows, recording.used, recording.rejected].map(|n| n.to_string());
        table.row([
            code(&recording.name),
            recording.used_for.word().to_owned(),
            rows,
            used,
            rejected,
            if lost.is_empty() {
                "nothing".to_owned()
            } else {
                lost.join(", ")
            },
        ]);
    }
    page.table("", table);

    let mut table = Table::new(&["<joint", ">from", ">to", ">limits", ">covered", ">samples"]);
    for joint in &report.coverage {
        let limits = match (joint.lower_limit, joint.upper_limit) {
            (Some(lower), Some(upper)) => format!(
                "{} to {}",
                number::plain(lower, joint.unit),
                number::plain(upper, joint.unit)
            ),
            _ => "none".to_owned(),
        };
        let share = joint
            .share
            .map_or_else(|| number::UNKNOWN.to_owned(), number::percent);
        table.row([
            code(&joint.joint),
            number::plain(joint.min, joint.unit),
            number::plain(joint.max, joint.unit),
            limits,
            share,
            joint.samples.to_string(),
        ]);
    }
    page.table("Where the joints were:", table);

    let mut table = Table::new(&["<noise", ">found σ", ">stated σ", ">samples", "<how"]);
    for noise in &report.noise {
        let [found, stated] =
            [noise.sigma, noise.stated].map(|sigma| number::plain_or_unknown(sigma, noise.unit));
        table.row([
            noise.group.clone(),
            found,
            stated,
            noise.samples.to_string(),
            noise.text.clone(),
        ]);
    }
    page.table("Noise, per component:", table);

    let clocks = answers(report)
        .into_iter()
        .find(|answer| answer.id == "clocks");
    page.text(format!(
        "Did the clocks agree? {}",
        clocks.map_or_else(String::new, |answer| answer.lines.join("; "))
    ));

    let mut table = Table::new(&["<recording", "<what", "<rows", "<why"]);
    for rejected in &report.rejected {
        let what = if rejected.subject.is_empty() {
            "whole row".to_owned()
        } else {
            code(&rejected.subject)
        };
        table.row([
            code(&rejected.recording),
            what,
            rows(&rejected.rows),
            rejected.reason.clone(),
        ]);
    }
    page.table("Thrown out:", table);

    let mut table = Table::new(&[
        "<severity",
        "<finding",
        "<about",
        "<rows",
        "<what was found",
        "<what to do",
    ]);
    for finding in &report.findings {
        table.row([
            finding.severity.word().to_owned(),
            code(&finding.id),
            finding.subject.clone(),
            rows(&finding.rows),
            finding.text.clone(),
            finding.remedy.clone(),
        ]);
    }
    page.table("Findings:", table);
}

fn rows(rows: &[u64]) -> String {
    let shown: Vec<String> = rows.iter().take(ROWS).map(ToString::to_string).collect();
    let more = if rows.len() > ROWS {
        format!(" and {} more", rows.len() - ROWS)
    } else {
        String::new()
    };
    shown.join(", ") + &more
}

fn residuals(page: &mut Page, report: &Report) {
    if report.residuals.is_empty() {
        return;
    }
    page.section("residuals", "Residuals of the fit");
    page.text("Predicted − observed, mm; over joints and time as pictures in `report.html`, row by row in `residuals.csv`.");
    let mut table = Table::new(&["<of", ">samples", ">mean", ">rms", ">95 %", ">max"]);
    let directions = report
        .residuals
        .by_direction
        .iter()
        .map(|group| (format!("along {} (signed mean)", group.name), group));
    let groups = report
        .residuals
        .all
        .iter()
        .chain(&report.residuals.by_marker)
        .map(|group| (code(&group.name), group));
    for (name, group) in groups.chain(directions) {
        let cells = [group.mean_m, group.rms_m, group.p95_m, group.max_m].map(mm);
        table.row([name, group.samples.to_string()].into_iter().chain(cells));
    }
    page.table("", table);
}

fn accuracy(page: &mut Page, report: &Report) {
    if let Some(workspace) = &report.workspace {
        page.section("workspace", "Uncertainty over the workspace");
        page.text(format!(
            "{} in {}, {} places: σ {} rms, {} at the worst.",
            code(&workspace.link),
            code(&workspace.frame),
            workspace.points.len(),
            number::plain(workspace.rms_sigma_m, Unit::Metre),
            number::plain(workspace.max_sigma_m, Unit::Metre)
        ));
    }
    if report.accuracy_limits.is_empty() {
        return;
    }
    page.section("accuracy", "What limits the accuracy now");
    let mut table = Table::new(&[
        "<source",
        ">σ at the tool",
        ">share",
        "<how it was found",
        "<what would help",
    ]);
    for limit in &report.accuracy_limits {
        let share = limit
            .share
            .map_or_else(|| number::UNKNOWN.to_owned(), number::percent);
        table.row([
            limit.source.clone(),
            number::plain_or_unknown(limit.sigma_m, Unit::Metre),
            share,
            limit.text.clone(),
            limit.remedy.clone(),
        ]);
    }
    page.table("", table);
}

fn parameters(page: &mut Page, report: &Report) {
    if report.parameters.is_empty() {
        return;
    }
    page.section("parameters", "Parameters");
    let mut table = Table::new(&[
        "<parameter",
        "<kind",
        ">nominal",
        ">value ± σ",
        ">from the data",
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
    page.table("", table);
}

fn files(page: &mut Page, report: &Report) {
    for (id, title, commands) in [
        ("how-to-reproduce", "How to reproduce it", &report.reproduce),
        ("how-to-undo", "How to undo it", &report.undo),
    ] {
        if !commands.is_empty() {
            page.section(id, title);
            page.code("sh", &commands.join("\n"));
        }
    }
    page.section("files", "Files");
    let mut table = Table::new(&["<read", "<SHA-256"]);
    for input in &report.inputs {
        table.row([code(&input.path), input.sha256.clone()]);
    }
    page.table("", table);
    let mut table = Table::new(&["<written", "<what", "<SHA-256"]);
    for output in &report.outputs {
        table.row([
            code(&output.path),
            output.what.clone(),
            output.sha256.clone().unwrap_or_default(),
        ]);
    }
    page.table("", table);
    page.text(format!("calib {}, seed {}.", report.version, report.seed));
}
