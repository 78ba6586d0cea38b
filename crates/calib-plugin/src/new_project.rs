//! A complete plugin project: build, test, README. It needs nothing that is not in it but a compiler.

use std::path::{Path, PathBuf};

use calib_files::{FileError, OutputFile, new_folder};

use crate::offer::Kind;

/// The language of a new plugin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Language {
    /// Cargo project with the author's side of the contract inside.
    Rust,
    /// One C file, a Makefile, and the header.
    C,
}

impl Language {
    /// The language with this name.
    ///
    /// # Errors
    /// [`NewProjectError::Language`].
    pub fn from_name(name: &str) -> Result<Self, NewProjectError> {
        match name {
            "rust" => Ok(Self::Rust),
            "c" => Ok(Self::C),
            other => Err(NewProjectError::Language {
                got: other.to_string(),
            }),
        }
    }
}

/// The kind with this short name: `center`, `axis`, `reader`, `report` or `effect`.
///
/// # Errors
/// [`NewProjectError::Kind`].
pub fn kind_from_name(name: &str) -> Result<Kind, NewProjectError> {
    match name {
        "center" => Ok(Kind::Cor),
        "axis" => Ok(Kind::Aor),
        "reader" => Ok(Kind::Reader),
        "report" => Ok(Kind::Report),
        "effect" => Ok(Kind::Effect),
        other => Err(NewProjectError::Kind {
            got: other.to_string(),
        }),
    }
}

/// Why no project was made.
#[derive(Debug, thiserror::Error)]
pub enum NewProjectError {
    /// Not a language there is a template for.
    #[error("unknown language `{got}`, expected one of `rust`, `c`")]
    Language {
        /// What was asked for.
        got: String,
    },
    /// Not a kind there is a template for.
    #[error("unknown kind `{got}`, expected one of `center`, `axis`, `reader`, `report`, `effect`")]
    Kind {
        /// What was asked for.
        got: String,
    },
    /// Not a name for a library, a crate and a plugin at once.
    #[error(
        "`{got}` is not a plugin name: lower-case letters, digits and `-`, a letter first, at most 64"
    )]
    Name {
        /// What was asked for.
        got: String,
    },
    /// What the plugin would offer has a name that the program itself gives.
    #[error(
        "`{got}` is built in, and a plugin of that name cannot be used beside it\n  help: choose another name"
    )]
    BuiltIn {
        /// What was asked for.
        got: String,
    },
    /// Something is there already, or the files cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

/// `calib-plugin/src` of a Rust project: this crate's own files.
const AUTHOR_SIDE: &[(&str, &str)] = &[
    ("abi.rs", include_str!("abi.rs")),
    ("answer.rs", include_str!("answer.rs")),
    ("author/aor.rs", include_str!("author/aor.rs")),
    ("author/border.rs", include_str!("author/border.rs")),
    ("author/cor.rs", include_str!("author/cor.rs")),
    ("author/effect.rs", include_str!("author/effect.rs")),
    ("author/estimator.rs", include_str!("author/estimator.rs")),
    ("author/exported.rs", include_str!("author/exported.rs")),
    ("author/mod.rs", include_str!("author/mod.rs")),
    ("author/motion.rs", include_str!("author/motion.rs")),
    ("author/reader.rs", include_str!("author/reader.rs")),
    ("author/report.rs", include_str!("author/report.rs")),
    ("call.rs", include_str!("call.rs")),
    ("effect.rs", include_str!("effect.rs")),
    ("kinds.rs", include_str!("kinds.rs")),
    (
        "lib.rs",
        include_str!("../templates/rust/calib-plugin.rs.in"),
    ),
    ("motion.rs", include_str!("motion.rs")),
    ("offer.rs", include_str!("offer.rs")),
    ("streams.rs", include_str!("streams.rs")),
];

/// Name under which a profile finds what a new plugin of this name offers.
#[must_use]
pub fn offered_name(name: &str) -> String {
    name.replace('-', "_")
}

/// Makes the folder `folder/name` with a complete project, and returns its path.
///
/// # Errors
/// [`NewProjectError`]; then nothing is left behind.
pub fn new_project(
    name: &str,
    kind: Kind,
    language: Language,
    folder: &Path,
) -> Result<PathBuf, NewProjectError> {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let good = name.starts_with(|c: char| c.is_ascii_lowercase()) && name.chars().all(plain);
    // The two crates of a Rust project must differ.
    if !good || name.len() > 64 || name == "calib-plugin" {
        return Err(NewProjectError::Name {
            got: name.to_string(),
        });
    }
    let project = folder.join(name);
    let files: Vec<OutputFile> = files(name, kind, language)
        .into_iter()
        .map(|(name, text)| OutputFile::text(name, text))
        .collect();
    new_folder(&project, &files)?;
    Ok(project)
}

/// What differs from kind to kind: the templates, and how a profile uses the result.
struct Template {
    rust: &'static str,
    c: &'static str,
    c_test: &'static str,
    used: &'static str,
}

fn template(kind: Kind) -> Template {
    match kind {
        Kind::Cor => Template {
            rust: include_str!("../templates/rust/center.rs.in"),
            c: include_str!("../templates/c/center.c.in"),
            c_test: include_str!("../templates/c/test.center.c.in"),
            used: "origins:\n  wrist: {center: @OFFER@}     # beside its other keys",
        },
        Kind::Aor => Template {
            rust: include_str!("../templates/rust/axis.rs.in"),
            c: include_str!("../templates/c/axis.c.in"),
            c_test: include_str!("../templates/c/test.axis.c.in"),
            used: "origins:\n  wrist: {axis: @OFFER@}       # beside its other keys",
        },
        Kind::Reader => Template {
            rust: include_str!("../templates/rust/reader.rs.in"),
            c: include_str!("../templates/c/reader.c.in"),
            c_test: include_str!("../templates/c/test.reader.c.in"),
            used: "recordings:\n  sweep: {file: sweep.txt, use: sweep, reader: @OFFER@}",
        },
        Kind::Report => Template {
            rust: include_str!("../templates/rust/report.rs.in"),
            c: include_str!("../templates/c/report.c.in"),
            c_test: include_str!("../templates/c/test.report.c.in"),
            used: "outputs:\n  reports: {@OFFER@: {}}",
        },
        Kind::Effect => Template {
            rust: include_str!("../templates/rust/effect.rs.in"),
            c: include_str!("../templates/c/effect.c.in"),
            c_test: include_str!("../templates/c/test.effect.c.in"),
            used: "solve:\n  joints:\n    elbow: {effects: {@OFFER@: {order: 3}}}     # beside its other keys",
        },
    }
}

fn files(name: &str, kind: Kind, language: Language) -> Vec<(String, String)> {
    let offer = offered_name(name);
    let library = format!(
        "{}{}{}",
        std::env::consts::DLL_PREFIX,
        name.replace('-', "_"),
        std::env::consts::DLL_SUFFIX
    );
    let of_kind = template(kind);
    let used = format!("plugins: {{@NAME@: {{}}}}\n{}", of_kind.used);
    let entry = include_str!("../templates/c/entry.c.in");
    let filled = |path: &str, template: &str| {
        let text = template
            .replace("@ENTRY@\n", entry)
            .replace("@USE@", &used)
            .replace("@WORD@", kind.word())
            .replace("@NAME@", name)
            .replace("@OFFER@", &offer)
            .replace("@LIBRARY@", &library)
            .replace("@VERSION@", env!("CARGO_PKG_VERSION"));
        (path.to_string(), text)
    };
    match language {
        Language::Rust => {
            let mut files = vec![
                filled(
                    "Cargo.toml",
                    include_str!("../templates/rust/Cargo.toml.in"),
                ),
                filled("README.md", include_str!("../templates/rust/README.md.in")),
                filled("src/lib.rs", of_kind.rust),
                (".gitignore".to_string(), "target/\n".to_string()),
                filled(
                    "calib-plugin/Cargo.toml",
                    include_str!("../templates/rust/calib-plugin.toml.in"),
                ),
            ];
            files.extend(
                AUTHOR_SIDE
                    .iter()
                    .map(|(path, text)| (format!("calib-plugin/src/{path}"), (*text).to_string())),
            );
            files
        }
        Language::C => vec![
            filled("plugin.c", of_kind.c),
            filled("test.c", of_kind.c_test),
            filled("host.h", include_str!("../templates/c/host.h.in")),
            filled("Makefile", include_str!("../templates/c/Makefile.in")),
            filled("README.md", include_str!("../templates/c/README.md.in")),
            (
                ".gitignore".to_string(),
                "*.so\n*.dylib\ntest-plugin\n".to_string(),
            ),
            (
                "include/calib_plugin.h".to_string(),
                crate::HEADER.to_string(),
            ),
        ],
    }
}
