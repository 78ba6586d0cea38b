//! `calib plugins`.

use std::fmt::Write as _;
use std::path::PathBuf;

use calib_pipeline::ExitCode;
use calib_pipeline::prepare::estimators::Estimators;
use calib_plugin::check::{Limits, Row, check};
use calib_plugin::{HEADER, Host, Kind, Language, Offer, SearchPath, kind_from_name, new_project};

use clap::{Args, Subcommand};
use serde_json::json;

use crate::error::CliError;
use crate::terminal::{Console, emit, emit_paths, emit_raw, say};

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
        /// What it offers: center, axis, reader, report or effect
        #[arg(long, default_value = "center")]
        kind: String,
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
pub fn run(console: &Console, options: &PluginsCommand) -> Result<ExitCode, CliError> {
    let json = console.json;
    match &options.what {
        None => {
            let listed = Listed::new()?;
            emit(&if json { listed.json() } else { listed.text() })?;
            Ok(ExitCode::Accepted)
        }
        Some(Plugins::Header) => {
            if json {
                emit(&format!("{}\n", json!({"header": HEADER})))?;
            } else {
                emit_raw(HEADER)?;
            }
            Ok(ExitCode::Accepted)
        }
        Some(Plugins::Check { plugin }) => checked(json, plugin),
        Some(Plugins::New {
            name,
            kind,
            lang,
            out,
        }) => {
            let (kind, language) = (kind_from_name(kind)?, Language::from_name(lang)?);
            let folder = new_project(name, kind, language, out)?;
            emit_paths(json, &[folder])?;
            Ok(ExitCode::Accepted)
        }
    }
}

/// Prints what the checks of a plugin found.
fn checked(json: bool, plugin: &str) -> Result<ExitCode, CliError> {
    let host = Host::new(SearchPath::from_environment(None), true);
    let conformance = check(&host, plugin, &Limits::default());
    if json {
        let row = |row: &Row| {
            json!({
                "subject": row.subject,
                "test": row.test,
                "outcome": row.outcome.word(),
                "detail": row.detail,
            })
        };
        let rows: Vec<_> = conformance.rows.iter().map(row).collect();
        let all = json!({
            "plugin": conformance.plugin,
            "passed": conformance.passed(),
            "tests": rows,
        });
        emit(&format!("{all:#}\n"))?;
    } else {
        emit(&format!("{}\n", conformance.to_string().trim_end()))?;
    }
    if conformance.passed() {
        return Ok(ExitCode::Accepted);
    }
    let loaded = conformance.rows.len() > 1;
    if !json && loaded {
        say(
            "  help: the contract is `calib plugins header`; what each test asks is in the manual, under `plugins`",
        );
    } else if !json {
        say(
            "  help: give the library's file with its folder (`./libname.so`), or a name on CALIB_PLUGIN_PATH; the contract is `calib plugins header`",
        );
    }
    Ok(ExitCode::Plugin)
}

/// Built-in estimators and readers, and the library files on the search path (none is opened).
struct Listed {
    /// Names and summaries of each kind.
    kinds: Vec<(Kind, Vec<[String; 2]>)>,
    /// Names and paths.
    found: Vec<[String; 2]>,
}

impl Listed {
    fn new() -> Result<Self, CliError> {
        let estimators = Estimators::built_in()?;
        let tables = &estimators.tables;
        let row = |offer: &Offer| [offer.name.clone(), offer.summary.clone()];
        let kinds = vec![
            (
                Kind::Cor,
                tables.cor.iter().map(|e| row(e.offer())).collect(),
            ),
            (
                Kind::Aor,
                tables.aor.iter().map(|e| row(e.offer())).collect(),
            ),
            (
                Kind::Reader,
                tables.reader.iter().map(|e| row(e.offer())).collect(),
            ),
            (
                Kind::Report,
                tables.report.iter().map(|e| row(e.offer())).collect(),
            ),
        ];
        let found = Host::new(SearchPath::from_environment(None), true).discover();
        let found = found.into_iter();
        Ok(Self {
            kinds,
            found: found
                .map(|plugin| [plugin.name, plugin.path.display().to_string()])
                .collect(),
        })
    }

    fn text(&self) -> String {
        let mut text = String::new();
        for (kind, rows) in &self.kinds {
            let _ = writeln!(text, "{}s ({})", kind.word(), kind.id());
            for [name, what] in rows {
                let _ = writeln!(text, "  {name:<16} {what}");
            }
        }
        let none = if self.found.is_empty() { "none" } else { "" };
        let _ = writeln!(text, "plugins on the search path: {none}");
        for [name, path] in &self.found {
            let _ = writeln!(text, "  {name:<16} {path}");
        }
        text
    }

    fn json(&self) -> String {
        let row = |key: &str, [name, what]: &[String; 2]| json!({"name": name, key: what});
        let mut all = serde_json::Map::new();
        for (kind, rows) in &self.kinds {
            let rows = rows.iter().map(|r| row("summary", r)).collect();
            all.insert(kind.id().to_owned(), serde_json::Value::Array(rows));
        }
        let found = self.found.iter().map(|r| row("path", r)).collect();
        all.insert("plugins".to_owned(), serde_json::Value::Array(found));
        format!("{:#}\n", serde_json::Value::Object(all))
    }
}
