//! `calib convert`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use calib_files::{OutputFile, write_new};
use calib_pipeline::ExitCode;
use calib_pipeline::error::PipelineError;
use calib_pipeline::prepare::{estimators::Estimators, readers};
use calib_plugin::{Origin, typed};
use calib_recording::{
    ColumnMap, ReadOptions, Recording, WriteOptions, read_path_with, renamed_comment,
    write_recording,
};
use clap::Args;

use super::like::Like;
use super::names::names_of;
use super::plugin_options::NamedPlugins;
use crate::error::CliError;
use crate::terminal::{Console, byte_bar, emit_paths, say_note};

/// Arguments of `calib convert`.
#[derive(Debug, Args)]
pub struct Convert {
    /// The recording
    input: PathBuf,
    /// The CSV to write; it must not exist
    output: PathBuf,
    /// Reader to use [default: detected from the content]
    #[arg(long)]
    format: Option<String>,
    /// Column map of the recording
    #[command(flatten)]
    like: Like,
    /// Name to write for a body or marker and its name in the recording, as `gripM=body_0`
    #[arg(long, value_delimiter = ',')]
    map: Vec<String>,
    /// Plugins whose readers are asked first
    #[command(flatten)]
    plugins: NamedPlugins,
}

/// Converts, and prints the names of the tables.
pub fn run(console: &Console, options: &Convert) -> Result<ExitCode, CliError> {
    let bar = byte_bar(console.quiet);
    let progress = &mut |read, all| {
        bar.set_length(all);
        bar.set_position(read);
    };
    let converted = convert(options, progress);
    bar.finish_and_clear();
    let converted = converted?;
    for note in &converted.notes {
        say_note(console, note);
    }
    emit_paths(
        console.json,
        &write_new(&converted.folder, &converted.files)?,
    )?;
    Ok(ExitCode::Accepted)
}

/// What a conversion gives.
struct Converted {
    /// Folder to write to.
    folder: PathBuf,
    /// One table per clock; the first has the name asked for.
    files: Vec<OutputFile>,
    /// Conversions and findings, one line each.
    notes: Vec<String>,
}

/// Reads a recording with the reader of a plugin that is named, or that recognizes the file; `None` where no plugin's reader is meant.
fn read_by_plugin(
    input: &Path,
    format: Option<&str>,
    named: &NamedPlugins,
) -> Result<Option<Recording>, CliError> {
    let table = Estimators::with_plugins(&named.plugin)?.tables.reader;
    let largest = ReadOptions::default().max_bytes;
    // Why a file cannot be read is said where the built-in readers open it.
    let Ok(bytes) = calib_files::input::read(input, largest) else {
        return Ok(None);
    };
    let entry = match format {
        Some(id) => Some(table.get(id).map_err(PipelineError::from)?),
        None => table.recognizing(&bytes),
    };
    let Some(entry) = entry.filter(|e| *e.origin() != Origin::BuiltIn) else {
        return Ok(None);
    };
    let parameters = typed(&entry.offer().parameters, &named.parameter);
    let shown = input.display().to_string();
    Ok(Some(readers::read(entry, &parameters, &shown, &bytes)?))
}

/// The recording by the first map by which it can be read; else why not by the first one.
fn read_by_one(
    input: &Path,
    options: &ReadOptions,
    maps: &[ColumnMap],
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Recording, CliError> {
    let mut first = None;
    for map in maps {
        let options = ReadOptions {
            columns: Some(map.clone()),
            ..options.clone()
        };
        match read_path_with(input, &options, progress) {
            Ok(recording) => return Ok(recording),
            Err(error) => first = first.or(Some(error)),
        }
    }
    match first {
        Some(error) => Err(error.into()),
        None => Ok(read_path_with(input, options, progress)?),
    }
}

/// Reads a recording of any known format and renders it as canonical CSV; `progress(bytes read, bytes in all)` is told
/// how far the reading is.
fn convert(options: &Convert, progress: &mut dyn FnMut(u64, u64)) -> Result<Converted, CliError> {
    let Convert {
        input,
        output,
        format,
        like,
        map,
        plugins,
    } = options;
    let names = names_of(map)?;
    let written = like.written(input, false)?;
    let by_plugin = match plugins.plugin.is_empty() {
        true => None,
        false => read_by_plugin(input, format.as_deref(), plugins)?,
    };
    let mut recording = match by_plugin {
        Some(recording) => recording,
        None => {
            let options = ReadOptions {
                format: format.clone(),
                ..ReadOptions::default()
            };
            read_by_one(input, &options, &written.columns, progress)?
        }
    };
    recording.rename_all(&names)?;
    let mut notes = vec![format!("read as {}", recording.meta.format)];
    notes.extend(recording.meta.conversions.iter().cloned());
    if !written.held.is_empty() {
        let held: Vec<&str> = written.held.keys().map(String::as_str).collect();
        notes.push(format!(
            "not in the table: {}, which the profile holds (`hold`)",
            held.join(", ")
        ));
    }
    notes.extend(
        recording
            .meta
            .findings
            .iter()
            .map(|f| format!("{}: {}", f.id, f.text())),
    );
    let options = WriteOptions {
        comments: renamed(&recording, &names),
        ..WriteOptions::default()
    };
    let tables = write_recording(&recording, &options).map_err(|source| CliError::Table {
        file: input.display().to_string(),
        source,
        remedy: "rename the columns that a table cannot hold",
        code: ExitCode::Data,
    })?;
    let name = output.file_name().map_or_else(
        || "recording.csv".to_owned(),
        |n| n.to_string_lossy().into_owned(),
    );
    let stem = name.trim_end_matches(".csv").to_owned();
    let files = tables
        .into_iter()
        .enumerate()
        .map(|(i, (_, table))| {
            let name = if i == 0 {
                name.clone()
            } else {
                format!("{stem}.{}.csv", i + 1)
            };
            OutputFile::text(name, table)
        })
        .collect();
    let folder = output
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .map_or_else(|| PathBuf::from("."), Path::to_path_buf);
    Ok(Converted {
        folder,
        files,
        notes,
    })
}

/// What is to be said above the tables of names that are not the tracker's any more, so that nobody maps them a second time.
fn renamed(recording: &Recording, names: &BTreeMap<String, String>) -> Vec<String> {
    let of_file = recording.meta.renamed_comments();
    let mapped = names.iter().filter(|(name, from)| name != from);
    let mapped = mapped.map(|(name, from)| renamed_comment(name, from));
    of_file.chain(mapped).collect()
}
