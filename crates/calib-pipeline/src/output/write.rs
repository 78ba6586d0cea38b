//! Writes results: each file beside its place, then renamed, so that nothing is ever half-written.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::error::PipelineError;

/// A file to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputFile {
    /// Name within the output folder.
    pub name: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

impl OutputFile {
    /// A text file.
    pub fn text(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            bytes: text.into().into_bytes(),
        }
    }
}

/// Name of the list that a folder of results carries: what this program wrote there and may replace.
pub const MANIFEST: &str = "calib.manifest";

/// Writes all files or none that is incomplete; returns their paths.
///
/// Files of an earlier run, listed in the folder's manifest, are replaced; anything else of the same name is kept
/// and the call fails before a byte is written.
///
/// # Errors
/// [`PipelineError::Exists`] or [`PipelineError::Write`]; [`PipelineError::Usage`] for two files of one name.
pub fn write_all(folder: &Path, files: &[OutputFile]) -> Result<Vec<PathBuf>, PipelineError> {
    let ours: Vec<String> = std::fs::read_to_string(folder.join(MANIFEST))
        .map(|text| text.lines().map(str::to_owned).collect())
        .unwrap_or_default();
    for (i, file) in files.iter().enumerate() {
        if files[..i].iter().any(|earlier| earlier.name == file.name) {
            return Err(PipelineError::Usage {
                finding: format!("two results would be written to `{}`", file.name),
                remedy: "give each output of the profile a name of its own".to_owned(),
            });
        }
        let path = folder.join(&file.name);
        if path.exists() && !ours.contains(&file.name) {
            return Err(PipelineError::Exists {
                path: path.display().to_string(),
                remedy: "it was not made by this program: choose another folder with --out",
            });
        }
    }
    std::fs::create_dir_all(folder).map_err(|e| PipelineError::write(folder, e))?;
    let mut staged = Vec::new();
    for file in files {
        match stage(folder, file) {
            Ok(temporary) => staged.push((temporary, folder.join(&file.name))),
            Err(error) => {
                for (temporary, _) in &staged {
                    let _ = std::fs::remove_file(temporary);
                }
                return Err(error);
            }
        }
    }
    let mut names: Vec<&str> = files.iter().map(|f| f.name.as_str()).collect();
    names.extend(
        ours.iter()
            .map(String::as_str)
            .filter(|n| folder.join(n).exists()),
    );
    names.sort_unstable();
    names.dedup();
    let manifest = OutputFile::text(MANIFEST, names.join("\n") + "\n");
    staged.push((stage(folder, &manifest)?, folder.join(MANIFEST)));
    let mut written = Vec::new();
    for (temporary, path) in staged {
        std::fs::rename(&temporary, &path).map_err(|e| PipelineError::write(&path, e))?;
        written.push(path);
    }
    Ok(written)
}

fn stage(folder: &Path, file: &OutputFile) -> Result<PathBuf, PipelineError> {
    let temporary = folder.join(format!(".{}.part", file.name));
    let mut out =
        std::fs::File::create(&temporary).map_err(|e| PipelineError::write(&temporary, e))?;
    let result = out.write_all(&file.bytes).and_then(|()| out.sync_all());
    match result {
        Ok(()) => Ok(temporary),
        Err(error) => {
            let _ = std::fs::remove_file(&temporary);
            Err(PipelineError::write(&folder.join(&file.name), error))
        }
    }
}

/// Writes files that must not exist yet, outside a folder of results: no manifest is kept.
///
/// # Errors
/// [`PipelineError::Exists`] or [`PipelineError::Write`].
pub fn write_new(folder: &Path, files: &[OutputFile]) -> Result<Vec<PathBuf>, PipelineError> {
    for file in files {
        let path = folder.join(&file.name);
        if path.exists() {
            return Err(PipelineError::Exists {
                path: path.display().to_string(),
                remedy: "choose another name, or move it away",
            });
        }
    }
    std::fs::create_dir_all(folder).map_err(|e| PipelineError::write(folder, e))?;
    let mut written = Vec::new();
    for file in files {
        let temporary = stage(folder, file)?;
        let path = folder.join(&file.name);
        std::fs::rename(&temporary, &path).map_err(|e| PipelineError::write(&path, e))?;
        written.push(path);
    }
    Ok(written)
}

/// Writes a file beside its place and renames it there; whatever stood there is gone, its permissions stay.
///
/// # Errors
/// [`PipelineError::Write`]; the old file is untouched then.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), PipelineError> {
    // A link stays a link: the file behind it is replaced.
    let path = &std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let file = OutputFile {
        name: name.into_owned(),
        bytes: bytes.to_vec(),
    };
    let temporary = stage(folder, &file)?;
    let kept = std::fs::metadata(path).map(|old| old.permissions());
    let done = kept
        .map_or(Ok(()), |permissions| {
            std::fs::set_permissions(&temporary, permissions)
        })
        .and_then(|()| std::fs::rename(&temporary, path));
    done.map_err(|e| {
        let _ = std::fs::remove_file(&temporary);
        PipelineError::write(path, e)
    })
}
