//! A finished study as tables and pictures. Renderers compute nothing.

mod csv;
mod markdown;
mod svg;
pub(crate) mod text;

use std::path::{Path, PathBuf};

use calib_files::{make_folder, replace};

use crate::{run::StudyResult, settings::StudyError};

pub use csv::csv;
pub use markdown::{long_tables, markdown};
pub use svg::{Figure, svg};

/// All of the result, every bit kept.
#[must_use]
pub fn json(result: &StudyResult) -> String {
    // Numbers, words and options: nothing that serde_json could refuse.
    let mut text = serde_json::to_string_pretty(result).unwrap_or_default();
    text.push('\n');
    text
}

/// Writes `<study>.csv`, `.json`, `.md`, `<study>-tables.csv` and `<study>-<figure>.svg` into `folder`; returns the paths.
///
/// # Errors
/// [`StudyError::File`] where the folder or a file cannot be written.
pub fn write(result: &StudyResult, folder: &Path) -> Result<Vec<PathBuf>, StudyError> {
    make_folder(folder)?;
    let word = result.study.word();
    let mut files = vec![
        (format!("{word}.csv"), csv(result)),
        (format!("{word}.json"), json(result)),
        (format!("{word}.md"), markdown(result)),
        (
            markdown::long_tables_name(result.study),
            long_tables(result),
        ),
    ];
    for figure in svg(result) {
        files.push((format!("{}.svg", figure.name), figure.svg));
    }
    let mut written = Vec::new();
    for (name, text) in files {
        let path = folder.join(name);
        replace(&path, text.as_bytes())?;
        written.push(path);
    }
    Ok(written)
}
