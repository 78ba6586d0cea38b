//! `calib plugins`.

use std::fmt::Write as _;
use std::path::PathBuf;

use calib_pipeline::ExitCode;
use calib_pipeline::prepare::estimators::Estimators;
use calib_pipeline::prepare::load::load_robot;
use calib_plugin::{
    HEADER, Host, Kind, Language, NewProjectError, Origin, SearchPath, kind_from_name, new_project,
    offered_name,
};

use clap::{Args, Subcommand};
use serde_json::json;

use super::plugin_check;
use super::plugin_options::PluginOptions;
use crate::error::CliError;
use crate::terminal::{Console, emit, emit_paths, emit_raw, say};

/// Arguments of `calib plugins`.
#[derive(Debug, Args)]
pub struct PluginsCommand {
    /// What to do; lists everything if not given
    #[command(subcommand)]
    what: Option<Plugins>,
    /// List what the plugins of this profile offer, too
    #[arg(long)]
    profile: Option<PathBuf>,
    /// Which plugins are loaded
    #[command(flatten)]
    plugins: PluginOptions,
}

/// What to do with plugins.
#[derive(Debug, Subcommand)]
enum Plugins {
    /// Check the conformance of a plugin; exit code 6 if a check fails
    Check {
        /// Path of the plugin, or its name on the search path
        plugin: String,
        /// Make the tests in this process, and print each step as a line of JSON
        #[arg(long, hide = true)]
        steps: bool,
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
    if options.what.is_some() && options.profile.is_some() {
        return Err(CliError::OnlyListed);
    }
    match &options.what {
        None => {
            let listed = Listed::new(options)?;
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
        Some(Plugins::Check {
            plugin,
            steps: true,
        }) => plugin_check::steps(plugin),
        Some(Plugins::Check { plugin, .. }) => plugin_check::run(json, plugin),
        Some(Plugins::New {
            name,
            kind,
            lang,
            out,
        }) => {
            let (kind, language) = (kind_from_name(kind)?, Language::from_name(lang)?);
            is_free(kind, name)?;
            let folder = new_project(name, kind, language, out)?;
            let readme = folder.join("README.md");
            emit_paths(json, &[folder])?;
            if !json && !console.quiet {
                let readme = readme.display();
                say(&format!("{readme} says how to build, check and use it."));
            }
            Ok(ExitCode::Accepted)
        }
    }
}

/// Whether nothing that is built in has the name.
fn is_free(kind: Kind, name: &str) -> Result<(), CliError> {
    let offered = offered_name(name);
    match Estimators::built_in()?.has(kind, &offered) {
        true => Err(NewProjectError::BuiltIn { got: offered }.into()),
        false => Ok(()),
    }
}

/// Everything that a profile can name, and the library files on the search path (none of these is opened).
struct Listed {
    /// Names and summaries of each kind, and the plugin of each.
    kinds: Vec<(Kind, Vec<Offered>)>,
    /// Names and paths.
    found: Vec<[String; 2]>,
    /// Whether the plugins of a profile are among them.
    of_profile: bool,
}

/// Name, summary, and the plugin that offers it.
type Offered = (String, String, Option<Origin>);

impl Listed {
    fn new(options: &PluginsCommand) -> Result<Self, CliError> {
        let (estimators, folder) = match &options.profile {
            None => (Estimators::built_in()?, None),
            Some(profile) => {
                let robot = load_robot(profile)?;
                let plugins = options.plugins.plugins();
                let all = Estimators::of_profile(&robot.profile, &robot.folder, plugins)?;
                (all, Some(robot.folder))
            }
        };
        let list = estimators.tables.list();
        let of = |kind: Kind| {
            let all = list.iter().filter(|(offer, _)| offer.kind == kind);
            let all = all.map(|(offer, origin)| {
                let plugin = (**origin != Origin::BuiltIn).then(|| (*origin).clone());
                (offer.name.clone(), offer.summary.clone(), plugin)
            });
            (kind, all.collect())
        };
        let search = SearchPath::from_environment(folder.as_deref());
        let found = Host::new(search, true).discover().into_iter();
        Ok(Self {
            kinds: Kind::ALL.into_iter().map(of).collect(),
            found: found
                .map(|plugin| [plugin.name, plugin.path.display().to_string()])
                .collect(),
            of_profile: options.profile.is_some(),
        })
    }

    fn text(&self) -> String {
        let mut text = String::new();
        for (kind, rows) in self.kinds.iter().filter(|(_, rows)| !rows.is_empty()) {
            let _ = writeln!(text, "{}s ({})", kind.word(), kind.id());
            for (name, what, plugin) in rows {
                let from = plugin.as_ref().map(|origin| format!(" ({origin})"));
                let _ = writeln!(text, "  {name:<16} {what}{}", from.unwrap_or_default());
            }
        }
        let none = if self.found.is_empty() { "none" } else { "" };
        let _ = writeln!(text, "plugins on the search path: {none}");
        for [name, path] in &self.found {
            let _ = writeln!(text, "  {name:<16} {path}");
        }
        if !self.of_profile {
            text += "what the plugins of a profile offer: calib plugins --profile PROFILE\n";
        }
        text
    }

    fn json(&self) -> String {
        let mut all = serde_json::Map::new();
        for (kind, rows) in &self.kinds {
            let row = |(name, what, origin): &Offered| {
                let plugin = match origin {
                    Some(Origin::Plugin { plugin, .. }) => Some(plugin),
                    _ => None,
                };
                json!({"name": name, "summary": what, "plugin": plugin})
            };
            let rows = rows.iter().map(row).collect();
            all.insert(kind.id().to_owned(), serde_json::Value::Array(rows));
        }
        let found = self.found.iter();
        let found = found.map(|[name, path]| json!({"name": name, "path": path}));
        all.insert("plugins".to_owned(), found.collect());
        format!("{:#}\n", serde_json::Value::Object(all))
    }
}
