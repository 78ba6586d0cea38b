//! Tests that need something that is not part of the project (measurements of other laboratories, a browser, a
//! compiler) and that cannot run without it, and tests of many trials, which run where they are asked for.
//!
//! Rust's test harness knows no third outcome: such a test returns early and counts as passed. Here it is counted as
//! skipped as well:
//!
//! ```text
//! let Some(file) = skipped_tests::real_data("hinge.csv") else { return };      in the test
//! 12 tests skipped: 9 no measurements of other laboratories (CALIB_REAL_DATA), 3 no Chromium
//! ```
//!
//! Every skip is a line of `<target>/skipped/<run>`, where `<run>` names the process that started the test binary
//! (Cargo) and the time it was started at. The test target `summary` of this package has no harness. Cargo runs it
//! last, after the other packages' tests and before the doctests, which skip nothing. It prints the line above and
//! removes the file. A run of single packages (`cargo test -p …`) prints no summary; its file goes with the next one.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Why a test was skipped where `CALIB_REAL_DATA` is missing.
pub const NO_REAL_DATA: &str = "no measurements of other laboratories (CALIB_REAL_DATA)";
/// Why a test was skipped where no browser is installed.
pub const NO_BROWSER: &str = "no Chromium";

/// Why a test was skipped where a format's reference checker is missing.
pub const NO_CHECKER: &str = "no reference checkers of output formats (CALIB_CHECKERS)";

/// Why a test of many trials was skipped where `CALIB_TESTS` is not `all`.
pub const NOT_THOROUGH: &str = "of many trials (CALIB_TESTS=all)";

/// Files of runs that printed no summary are removed after a day.
const STALE: Duration = Duration::from_secs(24 * 3600);

/// Records that the running test skips itself, or a part of itself, and why.
///
/// # Panics
/// When the record cannot be written: a skip that nobody counts must not pass for a test that ran.
pub fn skip(reason: &str) {
    let program = std::env::current_exe().expect("a test binary has a path");
    let binary = binary_name(&program);
    let test = std::thread::current().name().unwrap_or("?").to_owned();
    println!("skipped: {reason}");
    record(&run_file(&program), &binary, &test, reason).expect("target/skipped is writable");
}

/// Whether tests of many trials run, those with more than some 3 s of processor time: where `CALIB_TESTS` is `all`, as it is where it is decided what
/// lands. They are counted as skipped elsewhere.
#[must_use]
pub fn thorough() -> bool {
    let all = std::env::var_os("CALIB_TESTS").is_some_and(|asked| asked == "all");
    if !all {
        skip(NOT_THOROUGH);
    }
    all
}

/// A file or folder of measurements of other laboratories; `None`, counted as skipped, where it is not there.
///
/// They lie in the folder that `CALIB_REAL_DATA` names, or in `../shared/data` beside the workspace.
#[must_use]
pub fn real_data(path: &str) -> Option<PathBuf> {
    find("CALIB_REAL_DATA", "data", path, NO_REAL_DATA)
}

/// The reference checker of an output format: a program in the folder that `CALIB_CHECKERS` names, filled by
/// `tests/checkers/install.sh`. `None`, counted as skipped, where it is not there.
#[must_use]
pub fn checker(format: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("CALIB_CHECKERS").map(PathBuf::from);
    let program = folder.map(|f| f.join(format)).filter(|p| p.is_file());
    if program.is_none() {
        skip(NO_CHECKER);
    }
    program
}

/// A file of independent results: in the folder that `CALIB_GOLDEN` names, else in `tests/golden`.
#[must_use]
pub fn golden(path: &str) -> PathBuf {
    let own = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../golden");
    let named = std::env::var_os("CALIB_GOLDEN").map(PathBuf::from);
    named.unwrap_or_else(own).join(path)
}

fn find(variable: &str, beside: &str, path: &str, reason: &str) -> Option<PathBuf> {
    let found = located(std::env::var_os(variable), beside, path);
    if found.is_none() {
        skip(reason);
    }
    found
}

/// A path in the folder that a variable names, or in that one beside the workspace, if it exists.
fn located(named: Option<OsString>, beside: &str, path: &str) -> Option<PathBuf> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = named.map_or_else(|| shared.join(beside), PathBuf::from);
    Some(folder.join(path)).filter(|found| found.exists())
}

/// `target/debug/deps/golden-0123456789abcdef` is the binary `golden`.
fn binary_name(program: &Path) -> String {
    let name = program.file_stem().unwrap_or_default().to_string_lossy();
    match name.rsplit_once('-') {
        Some((name, hash)) if hash.len() == 16 => name.to_owned(),
        _ => name.into_owned(),
    }
}

/// The file of this run: beside the profile folders of the target directory.
#[must_use]
pub fn run_file(program: &Path) -> PathBuf {
    // <target>/<profile>/deps/<binary>
    let target = program.ancestors().nth(3).unwrap_or(Path::new("target"));
    target.join("skipped").join(run_id())
}

/// The process that started this one, and when it was started: process ids are used again.
fn run_id() -> String {
    #[cfg(unix)]
    {
        let parent = std::os::unix::process::parent_id();
        // Field 22 of stat is the start time; the name in field 2 may hold spaces and brackets.
        let started = fs::read_to_string(format!("/proc/{parent}/stat")).ok();
        let started = started.as_deref().and_then(|stat| {
            let after_name = &stat[stat.rfind(')')? + 1..];
            after_name.split_whitespace().nth(19).map(str::to_owned)
        });
        match started {
            Some(started) => format!("{parent}-{started}"),
            None => parent.to_string(),
        }
    }
    #[cfg(not(unix))]
    {
        "run".to_owned()
    }
}

/// Appends one line; lines of several threads and processes do not mix.
fn record(file: &Path, binary: &str, test: &str, reason: &str) -> std::io::Result<()> {
    if let Some(folder) = file.parent() {
        fs::create_dir_all(folder)?;
    }
    let line = format!("{binary}\t{test}\t{reason}\n");
    fs::OpenOptions::new()
        .create(true)
        .append(true)
        .open(file)?
        .write_all(line.as_bytes())
}

/// One line: how many tests were skipped, and why. A test that skipped several parts of itself counts once.
#[must_use]
pub fn summary(records: &str) -> String {
    let mut reasons: BTreeMap<(&str, &str), &str> = BTreeMap::new();
    for record in records.lines() {
        let mut fields = record.splitn(3, '\t');
        if let (Some(binary), Some(test), Some(reason)) =
            (fields.next(), fields.next(), fields.next())
        {
            reasons.entry((binary, test)).or_insert(reason);
        }
    }
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for reason in reasons.values() {
        *counts.entry(reason).or_default() += 1;
    }
    let total = reasons.len();
    let listed: Vec<String> = counts
        .iter()
        .map(|(reason, count)| format!("{count} {reason}"))
        .collect();
    match total {
        0 => "0 tests skipped".to_owned(),
        1 => format!("1 test skipped: {}", listed.join(", ")),
        _ => format!("{total} tests skipped: {}", listed.join(", ")),
    }
}

/// The summary of a run, whose file is removed, as are those of old runs.
#[must_use]
pub fn finish(file: &Path) -> String {
    let records = fs::read_to_string(file).unwrap_or_default();
    // No file: nothing was skipped.
    let _ = fs::remove_file(file);
    let others = file.parent().and_then(|folder| fs::read_dir(folder).ok());
    for other in others.into_iter().flatten().flatten() {
        let age = other
            .metadata()
            .and_then(|data| data.modified())
            .ok()
            .and_then(|modified| SystemTime::now().duration_since(modified).ok());
        if age.is_some_and(|age| age > STALE) {
            let _ = fs::remove_file(other.path());
        }
    }
    summary(&records)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_test_counts_once_with_its_reason() {
        let records =
            "golden\ta\tno Chromium\ngolden\ta\tno make\nreal\ta\tno Chromium\nreal\tb\tno make\n";
        assert_eq!(
            summary(records),
            "3 tests skipped: 2 no Chromium, 1 no make"
        );
        assert_eq!(summary("x\ty\tno make\n"), "1 test skipped: 1 no make");
        assert_eq!(summary(""), "0 tests skipped");
    }

    #[test]
    fn records_of_many_threads_are_counted_and_removed() {
        let file = std::env::temp_dir().join(format!("skipped-tests-{}", std::process::id()));
        std::thread::scope(|scope| {
            for thread in 0..8 {
                let file = &file;
                scope.spawn(move || {
                    for k in 0..25 {
                        record(file, "b", &format!("{thread}-{k}"), "no make").expect("written");
                    }
                });
            }
        });
        let records = fs::read_to_string(&file).expect("the file is there");
        assert_eq!(summary(&records), "200 tests skipped: 200 no make");
        fs::remove_file(&file).expect("it was written");
    }

    #[test]
    fn the_run_is_the_same_for_all_binaries_of_one_cargo() {
        let a = run_file(Path::new("t/debug/deps/a-0123456789abcdef"));
        let b = run_file(Path::new("t/debug/deps/b-0123456789abcdef"));
        assert_eq!(a, b);
        assert!(a.starts_with("t/skipped"), "{}", a.display());
        assert_eq!(
            binary_name(Path::new("d/golden-0123456789abcdef")),
            "golden"
        );
        assert_eq!(binary_name(Path::new("d/two-words")), "two-words");
    }

    #[test]
    fn only_what_exists_is_located() {
        let here = Some(OsString::from(env!("CARGO_MANIFEST_DIR")));
        assert!(located(here.clone(), "data", "src/lib.rs").is_some());
        assert_eq!(located(here, "data", "src/absent.rs"), None);
        assert_eq!(located(None, "no such folder", "x"), None);
    }
}
