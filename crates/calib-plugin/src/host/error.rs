//! Everything that goes wrong with plugins, with the plugin's name and both sides.

use calib_finding::nearest_word;

use crate::{answer::Failure, offer::Kind, parameters::ParameterError};

/// What went wrong. Paths are as they were searched for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PluginError {
    /// Plugins are switched off.
    #[error(
        "plugin `{name}` is needed, but plugins are switched off (--no-plugins or CALIB_NO_PLUGINS)"
    )]
    Disabled {
        /// The plugin.
        name: String,
    },
    /// No such file.
    #[error(
        "plugin `{name}` was not found; looked for {}{}",
        if looked.is_empty() { "it nowhere: it is a name, and the search path is empty".to_owned() } else { looked.join(", ") },
        there(known)
    )]
    NotFound {
        /// As it was asked for.
        name: String,
        /// The files that were looked for.
        looked: Vec<String>,
        /// Plugins that are there.
        known: Vec<String>,
    },
    /// The profile names a file elsewhere, and no hash.
    #[error(
        "plugin `{name}` lies neither beside the profile nor in a plugin folder ({path}), and the profile does not pin it; add its `sha256`, or allow it with --allow-plugins"
    )]
    Foreign {
        /// As it was asked for.
        name: String,
        /// The file.
        path: String,
    },
    /// A pin that is no SHA-256.
    #[error("plugin `{name}`: `{pin}` is not a SHA-256 (64 hexadecimal digits)")]
    BadPin {
        /// The plugin.
        name: String,
        /// The pin.
        pin: String,
    },
    /// The file is not the pinned one.
    #[error("plugin {path}: the file has sha256 {found}, the profile pins {needed}")]
    Pin {
        /// The file.
        path: String,
        /// Of the file.
        found: String,
        /// Of the profile.
        needed: String,
    },
    /// The file cannot be read.
    #[error("plugin {path}: cannot be read: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// Why.
        reason: String,
    },
    /// The system does not open it as a library.
    #[error("plugin {path}: cannot be opened as a shared library: {reason}")]
    Open {
        /// The file.
        path: String,
        /// The chain of causes.
        reason: String,
    },
    /// This program is static: it has no loader of shared libraries.
    #[error(
        "plugin {path}: this program is static (musl) and cannot load plugins\n  help: use the release for `linux-gnu`, or build one: cargo install --path crates/calib-cli"
    )]
    StaticProgram {
        /// The file.
        path: String,
    },
    /// It is a library, but no plugin.
    #[error("plugin {path}: found a shared library, needed one that exports `{symbol}`: {reason}")]
    NoEntry {
        /// The file.
        path: String,
        /// The symbol of the contract.
        symbol: &'static str,
        /// The chain of causes.
        reason: String,
    },
    /// Another major version of the contract.
    #[error(
        "plugin {path}: found plugin contract {}.{}, needed {needed}.x; rebuild it with this version's calib_plugin.h",
        found.0,
        found.1
    )]
    Abi {
        /// The file.
        path: String,
        /// Major and minor of the plugin.
        found: (u32, u32),
        /// Major of this program.
        needed: u32,
    },
    /// What it says about itself breaks the contract.
    #[error("plugin {path}: its description breaks the contract: {problem}")]
    Description {
        /// The file.
        path: String,
        /// What is wrong.
        problem: String,
    },
    /// The plugin offers no such thing.
    #[error("plugin `{plugin}` offers no {} `{name}`; it offers {}", kind.word(), offers(known))]
    NotOffered {
        /// The plugin.
        plugin: String,
        /// What was sought.
        kind: Kind,
        /// Its name.
        name: String,
        /// What it offers of that kind.
        known: Vec<String>,
    },
    /// Nobody offers such a thing.
    #[error("unknown {} `{name}`, {}", kind.word(), expected(name, known))]
    Unknown {
        /// What was sought.
        kind: Kind,
        /// Its name.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// Two things of one kind with one name.
    #[error("two {}s are called `{name}`: one {first}, one {second}", kind.word())]
    Taken {
        /// What they are.
        kind: Kind,
        /// The name.
        name: String,
        /// Where the first comes from.
        first: String,
        /// Where the second comes from.
        second: String,
    },
    /// Something of the wrong kind is registered.
    #[error("`{name}` describes itself as {found}, registered as {needed}")]
    WrongKind {
        /// Its name.
        name: String,
        /// In its offer.
        found: &'static str,
        /// Of the registry.
        needed: &'static str,
    },
    /// Parameters that do not fit.
    #[error("{of}: {problem}")]
    Parameter {
        /// What they are for.
        of: String,
        /// What is wrong.
        problem: ParameterError,
    },
    /// A joint that cannot have an effect.
    #[error("{of}: not for the joint `{joint}`: {why}")]
    Joint {
        /// The effect.
        of: String,
        /// The joint.
        joint: String,
        /// Why.
        why: &'static str,
    },
    /// Data that it does not take.
    #[error("{of} takes {}, got {got}", takes.join(" or "))]
    Shape {
        /// What was called.
        of: String,
        /// What it takes.
        takes: Vec<&'static str>,
        /// What it was given.
        got: &'static str,
    },
    /// A call gave no answer.
    #[error("{of}: {failure}")]
    Call {
        /// What was called, with the plugin's name.
        of: String,
        /// What happened.
        failure: Failure,
    },
}

impl PluginError {
    /// The program's exit code: 2 for wrong names and parameters of a profile, 3 for input that was refused with a reason,
    /// 6 for everything that is the plugin's fault.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Parameter { .. }
            | Self::Unknown { .. }
            | Self::BadPin { .. }
            | Self::Joint { .. }
            | Self::Shape { .. }
            | Self::Call {
                failure: Failure::BadParameter(_),
                ..
            } => 2,
            Self::Call {
                failure: Failure::BadInput(_),
                ..
            } => 3,
            _ => 6,
        }
    }

    /// What to do.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Disabled { .. } => {
                "leave out `--no-plugins` and CALIB_NO_PLUGINS, or leave the plugin out"
            }
            Self::NotFound { .. } => {
                "give the library's file with its folder (`./libname.so`), or put its folder on the search path CALIB_PLUGIN_PATH; those of a profile lie in `plugins/` beside it"
            }
            Self::Foreign { .. } => "look at where the file comes from before you allow it",
            Self::BadPin { .. } => "`sha256sum` of the library's file gives it",
            Self::Pin { .. } => {
                "another build of the plugin: look at where it comes from, then pin the new hash"
            }
            Self::StaticProgram { .. } => "use the release for `linux-gnu`",
            Self::Taken { .. } => "rename what the plugin offers, or leave one of the two out",
            Self::NotOffered { .. } | Self::Unknown { .. } | Self::Parameter { .. } => {
                "`calib plugins --profile PROFILE` lists what the profile can name"
            }
            Self::Joint { .. } => {
                "take the effect out of `solve: {joints: …}`, or change what it needs"
            }
            Self::Shape { .. } => "name an estimator that takes these data",
            _ => "`calib plugins check PLUGIN` tests a plugin",
        }
    }

    /// True when somebody asked for the end.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        matches!(
            self,
            Self::Call {
                failure: Failure::Cancelled,
                ..
            }
        )
    }
}

/// What a name could have been.
fn expected(name: &str, known: &[String]) -> String {
    if known.is_empty() {
        return "and no plugin that is loaded offers one: name the plugin that does under `plugins`"
            .into();
    }
    match nearest_word(name, known.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`? expected one of {}", offers(known)),
        None => format!("expected one of {}", offers(known)),
    }
}

fn offers(names: &[String]) -> String {
    if names.is_empty() {
        return "none".into();
    }
    names
        .iter()
        .map(|n| format!("`{n}`"))
        .collect::<Vec<_>>()
        .join(", ")
}

fn there(known: &[String]) -> String {
    if known.is_empty() {
        String::new()
    } else {
        format!("; there are {}", offers(known))
    }
}

/// An error and its causes in one line: libloading's own text says only that dlopen failed.
pub(super) fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(": ");
        text.push_str(&error.to_string());
        cause = error.source();
    }
    text
}
