//! Files read and written, and the commands about them.

use super::prose::{code, commands, counted, or};
use crate::{Component, Report};

pub(crate) fn changed(report: &Report) -> Vec<String> {
    let replaced = report.outputs.iter().filter_map(|output| {
        let original = output.changes.as_ref()?;
        Some(format!(
            "{} is new ({}); {} itself is unchanged.",
            code(&output.path),
            output.what,
            code(original)
        ))
    });
    let lines: Vec<String> = replaced.collect();
    if !lines.is_empty() {
        return lines;
    }
    let written = report.outputs.iter().map(|output| output.path.as_str());
    let written: Vec<&str> = written.collect();
    vec![if written.is_empty() {
        "None.".to_owned()
    } else {
        format!("None of yours. Written: {}.", written.join(", "))
    }]
}

pub(crate) fn reproduce(report: &Report) -> Vec<String> {
    let again: Vec<String> = commands(&report.reproduce);
    let again: Vec<String> = again
        .into_iter()
        .map(|command| format!("In the folder of the profile: {command}"))
        .collect();
    let mut lines = or(again, "Run the same profile again.");
    lines.extend(writes_to(report));
    lines.push(format!(
        "{}; {} identified by SHA-256 below.",
        version(report),
        counted(report.inputs.len(), "input")
    ));
    lines
}

/// Where the command to reproduce writes: the place of this report is no part of it, so that equal runs give equal reports.
pub(crate) fn writes_to(report: &Report) -> Option<String> {
    let name = std::path::Path::new(&report.profile).file_stem()?;
    let folder = code(&format!("results/{}", name.to_string_lossy()));
    Some(format!(
        "It writes to {folder} there; add `--out FOLDER` to write elsewhere."
    ))
}

/// Commands that run where the results are.
pub(crate) fn in_results(of: &[String]) -> Vec<String> {
    let with_place = |command| format!("In the folder of the results: {command}");
    commands(of).into_iter().map(with_place).collect()
}

/// The row of an estimator, reader or report writer: what it is, what used it, whose code it is, and the hash of that.
pub(crate) fn component(of: &Component, report: &Report) -> [String; 4] {
    let kind = match of.kind.as_str() {
        "calib.cor/1" => "center estimator",
        "calib.aor/1" => "axis estimator",
        "calib.reader/1" => "reader",
        "calib.report/1" => "report writer",
        other => other,
    };
    let (from, sha256) = match &of.plugin {
        None => (format!("calib {}", report.version), String::new()),
        Some(plugin) => (
            format!("plugin {} {}", plugin.name, plugin.version),
            plugin.sha256.clone().unwrap_or_default(),
        ),
    };
    let name = format!("{kind} {}", code(&of.name));
    [name, of.used_for.join(", "), from, sha256]
}

/// Program and seed, below the table of files.
pub(crate) fn program(report: &Report) -> String {
    format!(
        "{}. A report cannot contain its own digest.",
        version(report)
    )
}

/// The program's version, and the seed where something was random.
fn version(report: &Report) -> String {
    match report.seed {
        0 => format!("calib {}", report.version),
        seed => format!("calib {}, seed {seed}", report.version),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_is_named_only_where_something_was_random() {
        let mut report = Report {
            version: "1.2.3".to_owned(),
            ..Report::default()
        };
        assert_eq!(version(&report), "calib 1.2.3");
        report.seed = 7;
        assert_eq!(version(&report), "calib 1.2.3, seed 7");
    }
}
