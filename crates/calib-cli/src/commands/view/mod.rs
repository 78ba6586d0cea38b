//! `calib view`.

pub mod error;
mod serve;

use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use calib_pipeline::ExitCode;
use clap::Args;

use crate::error::CliError;
use crate::terminal::{Console, emit};
use error::ViewError;

/// Arguments of `calib view`.
#[derive(Debug, Args)]
pub struct View {
    /// Folder of results, or a page in it
    folder: PathBuf,
    /// Serve the folder to this computer only, instead of opening the page; Ctrl-C ends it
    #[arg(long)]
    serve: bool,
    /// Port to serve on [default: a free one]
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    port: u16,
}

/// The page of a folder of results.
const PAGE: &str = "report.html";

/// Shows the page: by what the system opens pages with, or served where there is nothing.
pub fn run(console: &Console, options: &View) -> Result<ExitCode, CliError> {
    let page = page(&options.folder)?;
    if !options.serve && can_show() && open(&page) {
        tell(console, "opened", &page.display().to_string())?;
        return Ok(ExitCode::Accepted);
    }
    let port = options.port;
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port));
    let listener = listener.map_err(|source| ViewError::Port { port, source })?;
    let failed = |source| ViewError::Port { port, source };
    let port = listener.local_addr().map_err(failed)?.port();
    let name = page.file_name().unwrap_or_default().to_string_lossy();
    let folder = page.parent().unwrap_or(Path::new("/")).to_owned();
    tell(console, "url", &format!("http://127.0.0.1:{port}/{name}"))?;
    serve::serve(&listener, &folder, port);
    Ok(ExitCode::Accepted)
}

fn tell(console: &Console, what: &str, where_: &str) -> Result<(), CliError> {
    if console.json {
        emit(&format!("{}\n", serde_json::json!({what: where_})))
    } else {
        emit(&format!("{where_}\n"))
    }
}

/// The page's absolute path.
fn page(named: &Path) -> Result<PathBuf, ViewError> {
    let page = if named.is_dir() {
        named.join(PAGE)
    } else {
        named.to_owned()
    };
    let is_page = page.extension().is_some_and(|e| e == "html") && page.is_file();
    let found = is_page.then(|| page.canonicalize().ok()).flatten();
    found.ok_or(ViewError::NoReport { path: page })
}

/// Whether there is a screen: on Linux a session of X or Wayland.
fn can_show() -> bool {
    let set = |name| std::env::var_os(name).is_some_and(|v| !v.is_empty());
    !cfg!(target_os = "linux") || set("DISPLAY") || set("WAYLAND_DISPLAY")
}

/// Hands the page to the system's opener; false where there is none, or it refuses.
fn open(page: &Path) -> bool {
    let mut opener = if cfg!(target_os = "macos") {
        Command::new("open")
    } else if cfg!(target_os = "windows") {
        Command::new("explorer")
    } else {
        Command::new("xdg-open")
    };
    let done = opener
        .arg(page)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    // Explorer answers 1 whatever happens.
    done.is_ok_and(|status| status.success() || cfg!(target_os = "windows"))
}
