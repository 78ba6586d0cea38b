//! A folder of its own for every test, with the shipped robots in it and the program beside it.
//!
//! ```text
//! let dir = Scratch::new().robot("ripley").edit("robots/ripley.yaml", "sfe", "sfx");
//! let ran = dir.calib(["run", "robots/ripley.yaml"]);
//! ```

// Every test binary has its own copy and uses a part of it.
#![allow(dead_code)]

mod kept;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use serde_json::Value;

/// Root of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Every second data row of a table of more than 30 rows, every third of more than 100.
fn thinned(table: &str) -> String {
    let mut rows = 0;
    let of_data: Vec<Option<usize>> = table
        .lines()
        .map(|line| {
            rows += usize::from(!line.starts_with('#'));
            (!line.starts_with('#')).then(|| rows - 1)
        })
        .collect();
    let every = match rows {
        0..=31 => 1,
        32..=101 => 2,
        _ => 3,
    };
    // Row 0 is the header.
    let kept = |row: &Option<usize>| row.is_none_or(|row| row == 0 || (row - 1) % every == 0);
    let lines = table.lines().zip(&of_data);
    lines
        .filter(|(_, row)| kept(row))
        .map(|(line, _)| format!("{line}\n"))
        .collect()
}

/// Files below a folder, by path relative to it.
pub type Files = BTreeMap<String, Vec<u8>>;

/// A temporary folder that is the program's working folder.
pub struct Scratch(tempfile::TempDir);

/// What a call of the program gave.
pub struct Ran {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Scratch {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    /// A folder with these files.
    pub fn holding(files: Files) -> Self {
        files
            .into_iter()
            .fold(Self::new(), |dir, (name, bytes)| dir.file(&name, bytes))
    }

    /// Copies a shipped robot: `robots/<name>.yaml` and `robots/<name>/`.
    pub fn robot(self, name: &str) -> Self {
        let robots = root().join("robots");
        for (file, bytes) in files_below(&robots) {
            if file == format!("{name}.yaml") || file.starts_with(&format!("{name}/")) {
                self.write(&format!("robots/{file}"), &bytes);
            }
        }
        self
    }

    /// Copies a shipped robot with half of the poses of its recordings, a third of those of long ones: for tests of what does not depend
    /// on how many poses there are. A run takes half the time.
    pub fn brief(self, name: &str) -> Self {
        let dir = self.robot(name);
        for (file, bytes) in dir.files(&format!("robots/{name}")) {
            if file.ends_with(".csv") {
                let text = String::from_utf8(bytes).expect("a table is text");
                dir.write(&format!("robots/{name}/{file}"), thinned(&text).as_bytes());
            }
        }
        dir
    }

    /// Adds or replaces a file.
    pub fn file(self, path: &str, bytes: impl AsRef<[u8]>) -> Self {
        self.write(path, bytes.as_ref());
        self
    }

    pub fn without(self, path: &str) -> Self {
        fs::remove_file(self.path(path)).expect("the file is there");
        self
    }

    /// Replaces a text that must be there.
    pub fn edit(self, path: &str, from: &str, to: &str) -> Self {
        let text = self.read(path);
        assert!(text.contains(from), "{path} has no `{from}`");
        self.write(path, text.replacen(from, to, 1).as_bytes());
        self
    }

    /// Changes the cells of a table's data rows: `change(row, column, cell)`, rows and comments as in the file.
    pub fn cells(self, path: &str, change: impl Fn(usize, &str, &str) -> String) -> Self {
        let text = self.read(path);
        let mut header: Option<Vec<&str>> = None;
        let mut lines = Vec::new();
        let mut row = 0;
        for line in text.lines() {
            let cells: Vec<&str> = line.split(',').collect();
            match &header {
                _ if line.starts_with('#') => lines.push(line.to_owned()),
                None => {
                    lines.push(line.to_owned());
                    header = Some(cells);
                }
                Some(names) => {
                    let changed = names.iter().zip(cells).map(|(n, c)| change(row, n, c));
                    lines.push(changed.collect::<Vec<_>>().join(","));
                    row += 1;
                }
            }
        }
        self.write(path, (lines.join("\n") + "\n").as_bytes());
        self
    }

    pub fn path(&self, path: &str) -> PathBuf {
        self.0.path().join(path)
    }

    pub fn read(&self, path: &str) -> String {
        fs::read_to_string(self.path(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
    }

    pub fn json(&self, path: &str) -> Value {
        serde_json::from_str(&self.read(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
    }

    pub fn files(&self, folder: &str) -> Files {
        files_below(&self.path(folder))
    }

    /// Runs the program in this folder.
    pub fn calib<const N: usize>(&self, arguments: [&str; N]) -> Ran {
        self.calib_with(&arguments)
    }

    pub fn calib_with(&self, arguments: &[&str]) -> Ran {
        self.calib_in(arguments, &[])
    }

    /// Runs the program in this folder with environment variables.
    pub fn calib_in(&self, arguments: &[&str], variables: &[(&str, &str)]) -> Ran {
        self.ran("", arguments, variables)
    }

    /// Runs a command that a report quotes, in a folder below this one.
    pub fn quoted(&self, folder: &str, command: &str) -> Ran {
        let mut words = command.split_whitespace();
        assert_eq!(words.next(), Some("calib"), "{command}");
        self.ran(folder, &words.collect::<Vec<_>>(), &[])
    }

    fn ran(&self, folder: &str, arguments: &[&str], variables: &[(&str, &str)]) -> Ran {
        let output = Command::new(env!("CARGO_BIN_EXE_calib"))
            .args(arguments)
            .current_dir(self.path(folder))
            .env_remove("COLUMNS")
            .env_remove("RUST_LOG")
            .env_remove("NO_COLOR")
            .env_remove("CLICOLOR_FORCE")
            .envs(variables.iter().copied())
            .stdin(Stdio::null())
            .output()
            .expect("the program starts");
        Ran {
            code: output.status.code().expect("not ended by a signal"),
            stdout: String::from_utf8(output.stdout).expect("text"),
            stderr: String::from_utf8(output.stderr).expect("text"),
        }
    }

    /// The text without what differs from machine to machine: this folder.
    pub fn shown(&self, text: &str) -> String {
        text.replace(&self.0.path().display().to_string(), "[scratch]")
    }

    fn write(&self, path: &str, bytes: &[u8]) {
        let path = self.path(path);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, bytes).expect("a file");
    }
}

impl Ran {
    /// Panics with the program's own words when it did not end as it should.
    #[track_caller]
    pub fn expect(self, code: i32) -> Self {
        assert_eq!(
            self.code, code,
            "stdout:\n{}\nstderr:\n{}",
            self.stdout, self.stderr
        );
        self
    }

    /// Standard output without its line breaks.
    pub fn words(&self) -> String {
        self.stdout.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|e| panic!("{e} in {}", self.stdout))
    }
}

/// A finished run of a shipped robot, its results in `out`; made once per test binary.
pub struct Finished {
    pub dir: Scratch,
    pub ran: Ran,
    pub report: Value,
}

/// `calib run robots/<robot>.yaml --method <method> --out out`.
pub fn finished(robot: &str, method: &str) -> &'static Finished {
    static RUNS: [OnceLock<Finished>; 4] = [const { OnceLock::new() }; 4];
    let slot = usize::from(robot == "justin") * 2 + usize::from(method == "paper");
    RUNS[slot].get_or_init(|| {
        let dir = Scratch::new().robot(robot);
        let profile = format!("robots/{robot}.yaml");
        let ran = kept::run(&dir, &["run", &profile, "--method", method, "--out", "out"]);
        assert!(
            ran.code < 2,
            "{robot} {method}: {} {}",
            ran.code,
            ran.stderr
        );
        let report = dir.json("out/report.json");
        Finished { dir, ran, report }
    })
}

/// All files below a folder; empty when there is no folder.
pub fn files_below(folder: &Path) -> Files {
    let mut found = Files::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        let Ok(entries) = fs::read_dir(&next) else {
            continue;
        };
        for entry in entries {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("below the folder");
                found.insert(name.display().to_string(), fs::read(&path).expect("a file"));
            }
        }
    }
    found
}
