//! `calib plugins`.

use std::fmt::Write as _;
use std::path::PathBuf;

use calib_pipeline::ExitCode;
use calib_pipeline::prepare::estimators::Estimators;
use calib_plugin::check::{Limits, check};
use calib_plugin::{HEADER, Host, Kind, Language, SearchPath, new_project};

use clap::{Args, Subcommand};

use crate::error::CliError;
use crate::terminal::{emit, emit_raw, say};

/// Arguments of `calib plugins`.
#[derive(Debug, Args)]
pub struct PluginsCommand {
    /// What to do; lists everything if not given
    #[command(subcommand)]
    what: Option<Plugins>,
}

/// What to do with plugins.
#[derive(Debug, Subcommand)]
enum Plugins {
    /// Check the conformance of a plugin; exit code 6 if a check fails
    Check {
        /// Path of the plugin, or its name on the search path
        plugin: String,
    },
    /// Create a plugin project
    New {
        /// Name of the plugin: lower-case letters, digits, hyphens
        name: String,
        /// Language: rust or c
        #[arg(long, default_value = "rust")]
        lang: String,
        /// Folder to create it in
        #[arg(short, long, default_value = ".")]
        out: PathBuf,
    },
    /// Print the C header of the plugin interface, calib_plugin.h
    Header,
}

/// Lists, checks or creates plugins.
pub fn run(options: &PluginsCommand) -> Result<ExitCode, CliError> {
    match &options.what {
        None => {
            emit(&list()?)?;
            Ok(ExitCode::Accepted)
        }
        Some(Plugins::Header) => {
            emit_raw(HEADER)?;
            Ok(ExitCode::Accepted)
        }
        Some(Plugins::Check { plugin }) => {
            let host = Host::new(SearchPath::from_environment(None), true);
            let conformance = check(&host, plugin, &Limits::default());
            emit(&format!("{}\n", conformance.to_string().trim_end()))?;
            if !conformance.passed() {
                say(
                    "  help: give the library's file with its folder (`./libname.so`), or a name on CALIB_PLUGIN_PATH; the contract is `calib plugins header`",
                );
            }
            Ok(if conformance.passed() {
                ExitCode::Accepted
            } else {
                ExitCode::Plugin
            })
        }
        Some(Plugins::New { name, lang, out }) => {
            let folder = new_project(name, Language::from_name(lang)?, out)?;
            emit(&format!("{}\n", folder.display()))?;
            Ok(ExitCode::Accepted)
        }
    }
}

/// Built-in estimators and readers, and the library files on the search path (none is opened).
fn list() -> Result<String, CliError> {
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
