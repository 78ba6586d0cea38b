//! `calib init`.

use std::io::Read;
use std::path::{Component, Path, PathBuf};

use calib_files::{
    FileError, OutputFile, check_writable, folder_of, input, make_folder, replace, write_new,
};
use calib_init::checked::Checked;
use calib_init::edit::{Edited, edited};
use calib_init::{
    About, Fact, File, HEAD, InitError, Known, Proposal, Request, json, not_a_urdf, propose,
    terminal, write,
};
use calib_pipeline::check;
use calib_pipeline::options::Plugins;
use calib_pipeline::{ExitCode, PipelineError};
use calib_recording::ReadOptions;
use calib_report::DataChecks;
use calib_urdf::RobotModel;
use clap::Args;

use crate::error::CliError;
use crate::terminal::{Console, emit, look, spinner};

/// Arguments of `calib init`.
#[derive(Debug, Args)]
#[command(
    override_usage = "calib init [OPTIONS] <URDF> [RECORDINGS]...\n       calib init --edit <PROFILE> <RECORDINGS>..."
)]
pub struct Init {
    /// The robot's URDF; none with --edit
    #[arg(required_unless_present = "edit")]
    urdf: Option<PathBuf>,
    /// Recordings: tables with joints and markers, or a tracker's files and the robot's logs
    recordings: Vec<PathBuf>,
    /// The link that carries the markers [default: the link whose motion they follow, or the end of the longest chain]
    #[arg(long, value_name = "LINK")]
    markers_on: Option<String>,
    /// The profile to write; it must not exist [default: robots/ROBOT.yaml]
    #[arg(short, long)]
    out: Option<PathBuf>,
    /// Add the recordings to this profile, with the bodies that it lacks; nothing that stands in it changes
    #[arg(long, value_name = "PROFILE", conflicts_with = "out")]
    edit: Option<PathBuf>,
}

/// Writes or edits the profile, checks it, and says what it rests on.
pub fn run(console: &Console, options: &Init) -> Result<ExitCode, CliError> {
    match (&options.edit, &options.urdf) {
        (Some(profile), first) => {
            let given = first.iter().chain(&options.recordings);
            edit(console, profile, given, options.markers_on.clone())
        }
        (None, Some(urdf)) => write(console, options, urdf),
        // The arguments ask for one of them.
        (None, None) => Ok(ExitCode::Usage),
    }
}

fn write(console: &Console, options: &Init, urdf: &Path) -> Result<ExitCode, CliError> {
    let bar = spinner(console.quiet);
    bar.set_message("read the URDF");
    let shown = urdf.display().to_string();
    let model = robot(urdf, &shown)?;
    let out = options
        .out
        .clone()
        .unwrap_or_else(|| default_profile(&model, urdf));
    if out.symlink_metadata().is_ok() {
        return Err(FileError::Exists { path: out }.into());
    }
    let folder = folder_of(&out);
    bar.set_message("read the recordings");
    let files = options.recordings.iter().map(|path| file(folder, path));
    let files: Vec<File> = files.collect::<Result<_, _>>()?;
    bar.set_message("find joints, bodies and links");
    let stem = stem(&out);
    let schema = "profile.schema.json";
    let request = Request {
        name: (model.name().is_empty()).then(|| stem.clone()),
        urdf_shown: shown,
        urdf_path: relative(folder, urdf),
        schema: folder.join(schema).is_file().then(|| schema.to_owned()),
        markers_on: options.markers_on.clone(),
        folder: stem,
        known: None,
    };
    let proposal = propose(&model, &request, &files)?;
    let text = write::profile(&model, &proposal);
    make_folder(folder)?;
    let name = out.file_name().map_or_else(
        || "profile.yaml".to_owned(),
        |n| n.to_string_lossy().into_owned(),
    );
    write_new(folder, &[OutputFile::text(name, text)])?;
    bar.set_message("check the profile");
    let checked = (!files.is_empty()).then(|| check::check(&out, Plugins::default()));
    bar.finish_and_clear();
    said(console, &proposal, None, &out, checked)
}

/// Adds recordings to a profile.
fn edit<'p>(
    console: &Console,
    profile: &Path,
    given: impl Iterator<Item = &'p PathBuf>,
    markers_on: Option<String>,
) -> Result<ExitCode, CliError> {
    let bar = spinner(console.quiet);
    bar.set_message("read the profile");
    let shown = profile.display().to_string();
    let text = || {
        let bytes = input::read(profile, LARGEST_PROFILE).map_err(|source| {
            let file = shown.clone();
            InitError::Unread { file, source }
        })?;
        String::from_utf8(bytes).map_err(|error| {
            let offset = error.utf8_error().valid_up_to();
            let path = shown.clone();
            InitError::from(PipelineError::NotText { path, offset })
        })
    };
    let old = text()?;
    let folder = folder_of(profile);
    let raw = calib_profile::parse(&old, &shown).map_err(InitError::from)?;
    let urdf = folder.join(&raw.robot.urdf);
    let model = robot(&urdf, &urdf.display().to_string())?;
    let there = |path: &str| {
        let path = folder.join(path);
        (relative(folder, &path), path.is_file())
    };
    let known = Known::of(&model, &shown, &old, there).map_err(InitError::from)?;
    bar.set_message("read the recordings");
    let is_own = |path: &&PathBuf| relative(folder, path) == relative(folder, &urdf);
    let given: Vec<&PathBuf> = given.filter(|path| !is_own(path)).collect();
    if given.is_empty() {
        return Err(InitError::NothingToAdd { file: shown }.into());
    }
    let files = given.into_iter().map(|path| file(folder, path));
    let files: Vec<File> = files.collect::<Result<_, _>>()?;
    if let Some(second) = files.iter().find(|file| is_robot(file)) {
        let (file, of_profile) = (second.shown.clone(), raw.robot.urdf);
        return Err(InitError::SecondUrdf { file, of_profile }.into());
    }
    bar.set_message("find joints, bodies and links");
    let request = Request {
        urdf_shown: urdf.display().to_string(),
        urdf_path: raw.robot.urdf,
        markers_on,
        folder: stem(profile),
        known: Some(known.clone()),
        ..Request::default()
    };
    let mut proposal = propose(&model, &request, &files)?;
    let mut edited = edited(&model, &proposal, &known)?;
    proposal.facts.append(&mut edited.facts);
    if !edited.is_same() {
        if text()? != old {
            return Err(InitError::Changed { file: shown }.into());
        }
        check_writable(profile)?;
        replace(profile, edited.text.as_bytes())?;
    }
    bar.set_message("check the profile");
    let is_absent = |fact: &Fact| matches!(fact.about, About::Absent { .. });
    let is_whole = !proposal.facts.iter().any(is_absent);
    let checked = is_whole.then(|| check::check(profile, Plugins::default()));
    bar.finish_and_clear();
    said(console, &proposal, Some(&edited), profile, checked)
}

/// Read at most; what is too long for a profile is said where it is parsed.
const LARGEST_PROFILE: u64 = 1 << 26;

/// The file is a URDF.
fn is_robot(file: &File) -> bool {
    let head = &file.bytes[..file.bytes.len().min(HEAD)];
    String::from_utf8_lossy(head).contains("<robot")
}

/// Says what was found, and what the check says of it.
fn said(
    console: &Console,
    proposal: &Proposal,
    edited: Option<&Edited>,
    profile: &Path,
    checked: Option<Result<DataChecks, PipelineError>>,
) -> Result<ExitCode, CliError> {
    let shown = profile.display().to_string();
    // The profile stands written: an error of its check is said beside what was found.
    let (code, findings) = match &checked {
        None => (ExitCode::Accepted, Checked::Not),
        Some(Ok(checks)) => (
            check::exit_code(checks),
            Checked::Findings(&checks.findings),
        ),
        Some(Err(error)) => (error.exit_code(), Checked::Stopped(error.to_string())),
    };
    emit(&match (console.json, console.quiet) {
        (true, _) => {
            let json = json::proposal(proposal, edited, &shown, &findings);
            calib_report::json::pretty(&json) + "\n"
        }
        (false, true) => format!("{shown}\n"),
        (false, false) => {
            let columns = look(console.color).columns;
            terminal::summary(proposal, edited, &shown, &findings, columns)
        }
    })?;
    Ok(code)
}

/// The robot; where the file is none, what it is instead.
fn robot(path: &Path, shown: &str) -> Result<RobotModel, InitError> {
    RobotModel::from_urdf_file(path).map_err(|error| {
        let mut head = Vec::new();
        // What cannot be read has its error already.
        if let Ok(file) = input::open(path) {
            let _ = file.take(HEAD as u64).read_to_end(&mut head);
        }
        not_a_urdf(shown, error, &head)
    })
}

fn default_profile(model: &RobotModel, urdf: &Path) -> PathBuf {
    let name = match model.name() {
        "" => stem(urdf),
        name => name.replace(|c: char| !c.is_alphanumeric() && c != '-', "_"),
    };
    Path::new("robots").join(format!("{name}.yaml"))
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .map_or_else(|| "robot".to_owned(), |s| s.to_string_lossy().into_owned())
}

/// A recording with its bytes.
fn file(folder: &Path, path: &Path) -> Result<File, CliError> {
    let shown = path.display().to_string();
    let largest = ReadOptions::default().max_bytes;
    let bytes = input::read(path, largest).map_err(|source| InitError::Unread {
        file: shown.clone(),
        source,
    })?;
    Ok(File {
        path: relative(folder, path),
        shown,
        bytes,
    })
}

/// A path as seen from a folder, with `/`.
fn relative(folder: &Path, path: &Path) -> String {
    let (from, to) = (absolute(folder), absolute(path));
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = std::iter::repeat_n("..", from.len() - common).map(str::to_owned);
    let down = to[common..].iter().cloned();
    up.chain(down).collect::<Vec<_>>().join("/")
}

/// The parts of a path from the root, without `.` and `..`.
fn absolute(path: &Path) -> Vec<String> {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let mut parts = Vec::new();
    for part in path.components() {
        match part {
            Component::CurDir | Component::RootDir => {}
            Component::ParentDir => {
                parts.pop();
            }
            Component::Prefix(_) | Component::Normal(_) => {
                parts.push(part.as_os_str().to_string_lossy().into_owned());
            }
        }
    }
    parts
}
