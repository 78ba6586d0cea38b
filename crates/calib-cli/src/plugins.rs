//! `calib plugins`: what there is, conformance of one, and new projects.

use std::fmt::Write as _;
use std::io::Write as _;

use calib_pipeline::estimate::estimators::Estimators;
use calib_pipeline::{ExitCode, PipelineError};
use calib_plugin::check::{Limits, check};
use calib_plugin::{HEADER, Host, Kind, Language, SearchPath, new_project};

use crate::arguments::Plugins;

fn emit(text: &str) {
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}

/// Runs `calib plugins …`.
pub fn run(what: Option<&Plugins>) -> Result<ExitCode, PipelineError> {
    match what {
        None => {
            emit(&list()?);
            Ok(ExitCode::Accepted)
        }
        Some(Plugins::Header) => {
            emit(HEADER);
            Ok(ExitCode::Accepted)
        }
        Some(Plugins::Check { plugin }) => {
            let host = Host::new(SearchPath::from_environment(None), true);
            let conformance = check(&host, plugin, &Limits::default());
            emit(&format!("{}\n", conformance.to_string().trim_end()));
            if !conformance.passed() {
                eprintln!(
                    "  help: give the library's file with its folder (`./libname.so`), or a name on CALIB_PLUGIN_PATH; the contract is `calib plugins header`"
                );
            }
            Ok(if conformance.passed() {
                ExitCode::Accepted
            } else {
                ExitCode::Plugin
            })
        }
        Some(Plugins::New { name, lang, out }) => {
            let usage = |e: calib_plugin::NewProjectError| PipelineError::Usage {
                finding: e.to_string(),
                remedy: "calib plugins new NAME --lang rust|c --out FOLDER".to_owned(),
            };
            let language = Language::from_name(lang).map_err(usage)?;
            let folder = new_project(name, language, out).map_err(usage)?;
            emit(&format!("{}\n", folder.display()));
            Ok(ExitCode::Accepted)
        }
    }
}

/// Built-in estimators and readers, and the library files on the search path (none is opened).
fn list() -> Result<String, PipelineError> {
    let estimators = Estimators::built_in()?;
    let mut text = String::new();
    let mut section = |kind: Kind, rows: Vec<(String, String)>| {
        let _ = writeln!(text, "{}s ({})", kind.word(), kind.id());
        for (name, what) in rows {
            let _ = writeln!(text, "  {name:<16} {what}");
        }
    };
    let cor = estimators
        .tables
        .cor
        .iter()
        .map(|e| (e.offer().name.clone(), e.offer().summary.clone()));
    section(Kind::Cor, cor.collect());
    let aor = estimators
        .tables
        .aor
        .iter()
        .map(|e| (e.offer().name.clone(), e.offer().summary.clone()));
    section(Kind::Aor, aor.collect());
    let readers = estimators
        .tables
        .reader
        .iter()
        .map(|e| (e.offer().name.clone(), e.offer().summary.clone()));
    section(Kind::Reader, readers.collect());
    let reports = estimators
        .tables
        .report
        .iter()
        .map(|e| (e.offer().name.clone(), e.offer().summary.clone()));
    section(Kind::Report, reports.collect());
    let found = Host::new(SearchPath::from_environment(None), true).discover();
    let _ = writeln!(
        text,
        "plugins on the search path: {}",
        if found.is_empty() { "none" } else { "" }
    );
    for plugin in found {
        let _ = writeln!(text, "  {:<16} {}", plugin.name, plugin.path.display());
    }
    Ok(text)
}
