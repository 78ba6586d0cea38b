//! A command is stopped or refused at its system calls, one after the other: every file is whole, old or new, and the next
//! command works. `strace` injects the faults; a test of `calib-files` does the same without it, inside the program.
//!
//! A sample of the calls is tried; `CALIB_ALL_STOPS=1` tries all (`cargo test -p calib-cli --test suite interruptions::`).

use crate::record::{free_port, still_body};
use crate::scratch;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use scratch::{Files, Scratch, files_below, finished};

/// Calls that change a disk, and what a disk may answer.
const CALLS: &[(&str, &[&str])] = &[
    ("openat", &["ENOSPC", "EACCES"]),
    ("mkdir", &["ENOSPC", "EACCES"]),
    ("write", &["ENOSPC"]),
    ("fsync", &["ENOSPC", "EIO"]),
    ("fdatasync", &["ENOSPC"]),
    ("ftruncate", &["EIO"]),
    ("chmod", &["EACCES"]),
    ("rename", &["ENOSPC", "EACCES"]),
    ("unlink", &["EACCES"]),
    ("rmdir", &["EACCES"]),
    ("flock", &["ENOLCK"]),
];

/// A command that is tried, in a folder of its own for every fault.
struct Trial<'a> {
    name: &'a str,
    prepare: &'a dyn Fn() -> Scratch,
    arguments: &'a [&'a str],
    /// How it ends without a fault.
    code: i32,
    /// Every n-th fault is tried.
    every: usize,
    /// Whether the whole state is an allowed one: files now, before, and after a command without a fault.
    check: &'a dyn Fn(&Files, &Files, &Files),
    /// What is done next, and that it works.
    next: &'a dyn Fn(&Scratch, &Files, &Files),
}

pub(crate) fn traced(dir: &Scratch, options: &[&str], arguments: &[&str]) -> Option<Output> {
    Command::new("strace")
        .args(["-f", "-qq", "-o", "trace.txt"])
        .args(options)
        .arg(env!("CARGO_BIN_EXE_calib"))
        .args(arguments)
        .current_dir(dir.path(""))
        .stdin(Stdio::null())
        .output()
        .ok()
}

/// The calls of the main thread by name: which of them change something.
fn calls(trace: &str) -> BTreeMap<String, Vec<bool>> {
    let mut found: BTreeMap<String, Vec<bool>> = BTreeMap::new();
    let main = trace.split_whitespace().next().unwrap_or_default();
    for line in trace.lines() {
        let Some(call) = line.strip_prefix(main) else {
            continue;
        };
        let call = call.trim_start();
        let name: String = call
            .chars()
            .take_while(char::is_ascii_alphanumeric)
            .collect();
        let reads = name == "openat" && !call.contains("O_CREAT");
        found.entry(name).or_default().push(!reads);
    }
    found
}

/// Every fault of a trial: the options of `strace`, and whether it kills.
fn faults(trace: &str) -> Vec<(String, bool)> {
    let mut all = Vec::new();
    for (name, changes) in calls(trace) {
        let Some((_, errors)) = CALLS.iter().find(|(call, _)| *call == name) else {
            continue;
        };
        for (n, _) in changes.iter().enumerate().filter(|(_, changes)| **changes) {
            let at = n + 1;
            all.push((format!("inject={name}:signal=SIGKILL:when={at}"), true));
            for error in *errors {
                all.push((format!("inject={name}:error={error}:when={at}"), false));
            }
        }
    }
    all
}

fn files(dir: &Scratch) -> Files {
    let mut files = files_below(&dir.path(""));
    files.remove("trace.txt");
    files
}

pub(crate) fn is_part(name: &str) -> bool {
    Path::new(name)
        .file_name()
        .is_some_and(|n| n.to_string_lossy().starts_with(".calib-"))
}

/// Old or new, each whole; nothing of ours is left over after an error.
fn old_or_new(now: &Files, before: &Files, after: &Files) {
    for (name, bytes) in now {
        let list = name.ends_with("calib.manifest") && bytes.starts_with(b"# unfinished");
        let whole = [before.get(name), after.get(name)].contains(&Some(bytes));
        assert!(
            whole || list || is_part(name),
            "{name} is torn: {} bytes",
            bytes.len()
        );
    }
    for name in before.keys() {
        assert!(
            now.contains_key(name) || !after.contains_key(name),
            "{name} is lost"
        );
    }
}

fn walk(trial: &Trial<'_>) {
    let dir = (trial.prepare)();
    let before = files(&dir);
    let names: Vec<&str> = CALLS.iter().map(|(name, _)| *name).collect();
    let watch = format!("trace={}", names.join(","));
    let Some(ran) = traced(&dir, &["-e", &watch], trial.arguments) else {
        return skipped_tests::skip("no strace");
    };
    if !dir.path("trace.txt").is_file() || dir.read("trace.txt").is_empty() {
        return skipped_tests::skip("strace may not trace");
    }
    assert_eq!(
        ran.status.code(),
        Some(trial.code),
        "{}: {ran:?}",
        trial.name
    );
    let after = files(&dir);
    let all = faults(&dir.read("trace.txt"));
    let every = match std::env::var_os("CALIB_ALL_STOPS") {
        Some(_) => 1,
        None => trial.every,
    };
    let mut tried = 0;
    for (fault, kills) in all.iter().step_by(every) {
        let dir = (trial.prepare)();
        let ran = traced(&dir, &["-e", &watch, "-e", fault], trial.arguments).expect("strace");
        tried += 1;
        let said = String::from_utf8_lossy(&ran.stderr).into_owned();
        let now = files(&dir);
        let seen = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            assert!(!said.contains("panicked"), "it panicked");
            (trial.check)(&now, &before, &after);
            assert!(*kills || !now.keys().any(|n| is_part(n)), "a part was left");
            (trial.next)(&dir, &before, &after);
        }));
        if let Err(why) = seen {
            eprintln!(
                "{} with {fault}: exit {:?}\n{said}",
                trial.name,
                ran.status.code()
            );
            std::panic::resume_unwind(why);
        }
    }
    println!("{}: {tried} of {} faults", trial.name, all.len());
    assert!(all.len() > 10, "{}: only {} faults", trial.name, all.len());
}

/// The same command again, without a fault, gives what it would have given.
fn again<'a>(arguments: &'a [&'a str], code: i32) -> impl Fn(&Scratch, &Files, &Files) + 'a {
    move |dir, _, after| {
        dir.calib_with(arguments).expect(code);
        let now = files(dir);
        let names: Vec<&String> = now.keys().filter(|n| !after.contains_key(*n)).collect();
        assert!(names.is_empty(), "left over: {names:?}");
        for (name, bytes) in after {
            assert_eq!(now.get(name), Some(bytes), "{name} after the next command");
        }
    }
}

const RUN: &[&str] = &[
    "run",
    "robots/ripley.yaml",
    "--method",
    "paper",
    "--out",
    "out",
    "-q",
];

#[test]
fn run_in_a_fresh_and_in_a_used_folder() {
    if !skipped_tests::thorough() {
        return;
    }
    // The used folder holds an earlier run of another method.
    let fresh = || Scratch::new().brief("ripley");
    let old = &finished("ripley", "ml").dir;
    let used = || {
        let filled = |dir: Scratch, (name, bytes): (String, Vec<u8>)| {
            dir.file(&format!("out/{name}"), bytes)
        };
        old.files("out").into_iter().fold(fresh(), filled)
    };
    let prepares: [(&str, &dyn Fn() -> Scratch, usize); 2] =
        [("fresh", &fresh, 97), ("used", &used, 61)];
    for (name, prepare, every) in prepares {
        walk(&Trial {
            name: &format!("run in a {name} folder"),
            prepare,
            arguments: RUN,
            code: 1,
            every,
            check: &old_or_new,
            next: &again(RUN, 1),
        });
    }
}

#[test]
fn simulate_and_convert() {
    let simulate = &["simulate", "robots/ripley.yaml", "--out", "sim"];
    let convert = &["convert", "robots/ripley/checks.csv", "out/checks.csv"];
    let fresh = || Scratch::new().brief("ripley");
    for (name, arguments, every) in [
        ("simulate", simulate as &[&str], 29),
        ("convert", convert, 7),
    ] {
        walk(&Trial {
            name,
            prepare: &fresh,
            arguments,
            code: 0,
            every,
            check: &old_or_new,
            next: &again(arguments, 0),
        });
    }
    let more = || {
        let dir = fresh();
        let table = dir.read("robots/ripley/arm_poses.csv");
        dir.file("june.csv", table)
    };
    let edit = &["init", "--edit", "robots/ripley.yaml", "june.csv"];
    walk(&Trial {
        name: "init --edit",
        prepare: &more,
        arguments: edit,
        code: 0,
        every: 11,
        check: &old_or_new,
        next: &again(edit, 0),
    });
}

const TARGET: &str = "mine/r17.urdf";
const RECORD: &str = "mine/r17.urdf.changes.json";
const APPLY: &[&str] = &["apply", "out", TARGET, "--in-place"];
const REVERT: &[&str] = &["revert", TARGET, "--in-place"];

/// A result, and the URDF that it was calibrated from.
fn result() -> Scratch {
    let done = &finished("ripley", "ml").dir;
    let mut dir = Scratch::new();
    for (name, bytes) in done.files("out") {
        if name.contains("calibrated.urdf") || name == "report.json" {
            dir = dir.file(&format!("out/{name}"), bytes);
        }
    }
    dir.file(TARGET, done.files("robots")["ripley/r17.urdf"].clone())
}

#[test]
fn apply_in_place_and_elsewhere() {
    // Both ways on: to the result, and back to the original.
    let both = |dir: &Scratch, before: &Files, after: &Files| {
        let stopped = files(dir);
        let reverted = dir.calib_with(REVERT);
        if stopped.contains_key(RECORD) {
            reverted.expect(0);
        }
        assert_eq!(dir.files("mine")["r17.urdf"], before[TARGET]);
        assert!(!dir.path(RECORD).exists());
        let copied = Scratch::holding(stopped);
        again(APPLY, 0)(&copied, before, after);
    };
    walk(&Trial {
        name: "apply --in-place",
        prepare: &result,
        arguments: APPLY,
        code: 0,
        every: 7,
        check: &old_or_new,
        next: &both,
    });
    let elsewhere = &["apply", "out", TARGET, "--out", "new/arm.urdf"];
    walk(&Trial {
        name: "apply --out",
        prepare: &result,
        arguments: elsewhere,
        code: 0,
        every: 13,
        check: &old_or_new,
        next: &again(elsewhere, 0),
    });
}

#[test]
fn apply_to_a_xacro_and_the_yaml_that_it_loads() {
    let targets = ["my_arm/urdf/arm.urdf.xacro", "my_arm/config/arm.yaml"];
    let apply = &["apply", crate::apply::RESULT, targets[0], "--in-place"];
    let both = |dir: &Scratch, before: &Files, after: &Files| {
        let stopped = files(dir);
        for target in targets {
            if dir.path(&format!("{target}.changes.json")).exists() {
                dir.calib(["revert", target, "--in-place"]).expect(0);
            }
            assert_eq!(files(dir)[target], before[target]);
        }
        let copied = Scratch::holding(stopped);
        again(apply, 0)(&copied, before, after);
    };
    walk(&Trial {
        name: "apply --in-place to a xacro with its YAML",
        prepare: &|| crate::apply::with_xacro(crate::apply::PROPERTIES),
        arguments: apply,
        code: 0,
        every: 11,
        check: &old_or_new,
        next: &both,
    });
}

/// Both files have a record already: each goes with its file, so that both can be reverted to what they were before the first calibration.
#[test]
fn a_second_apply_to_a_xacro_and_the_yaml_that_it_loads() {
    let targets = ["my_arm/urdf/arm.urdf.xacro", "my_arm/config/arm.yaml"];
    let originals = files(&crate::apply::with_xacro(crate::apply::PROPERTIES));
    let apply = &["apply", "next/r.calibrated.urdf", targets[0], "--in-place"];
    let both = |dir: &Scratch, before: &Files, after: &Files| {
        let copied = Scratch::holding(files(dir));
        for target in targets {
            dir.calib(["revert", target, "--in-place"]).expect(0);
            assert_eq!(files(dir)[target], originals[target]);
        }
        again(apply, 0)(&copied, before, after);
    };
    // A record that waits is whole as well.
    let check = |now: &Files, before: &Files, after: &Files| {
        let (waiting, others): (Files, Files) =
            (now.clone().into_iter()).partition(|(name, _)| name.ends_with(".next"));
        for (name, bytes) in &waiting {
            assert_eq!(
                after.get(name.trim_end_matches(".next")),
                Some(bytes),
                "{name}"
            );
        }
        old_or_new(&others, before, after);
    };
    walk(&Trial {
        name: "a second apply --in-place to a xacro with its YAML",
        prepare: &crate::apply::with_xacro_applied,
        arguments: apply,
        code: 0,
        every: 9,
        check: &check,
        next: &both,
    });
}

#[test]
fn revert_in_place_and_elsewhere() {
    let applied = || {
        let dir = result();
        dir.calib_with(APPLY).expect(0);
        dir
    };
    // After the record is gone there is nothing to revert, and the file is the original.
    let next = |dir: &Scratch, _: &Files, after: &Files| {
        if dir.path(RECORD).exists() {
            dir.calib_with(REVERT).expect(0);
        }
        assert_eq!(dir.files("mine")["r17.urdf"], after[TARGET]);
        dir.calib_with(APPLY).expect(0);
    };
    walk(&Trial {
        name: "revert --in-place",
        prepare: &applied,
        arguments: REVERT,
        code: 0,
        every: 5,
        check: &old_or_new,
        next: &next,
    });
    let elsewhere = &["revert", TARGET, "--out", "old/arm.urdf"];
    walk(&Trial {
        name: "revert --out",
        prepare: &applied,
        arguments: elsewhere,
        code: 0,
        every: 7,
        check: &old_or_new,
        next: &again(elsewhere, 0),
    });
}

#[test]
fn record() {
    if !skipped_tests::thorough() {
        return;
    }
    let port = free_port();
    let stop = Arc::new(AtomicBool::new(false));
    let sender = still_body(port, 0, stop.clone());
    let source = format!("dtrack:{port}");
    let profile = "robots/justin.yaml";
    let record = [
        "record",
        profile,
        "--source",
        &source,
        "--recording",
        "head_sweep",
        "--map",
        "heT=body_0",
        "--out",
        "new/sweep.csv",
        "--all",
        "--append",
        "--seconds",
        "0.1",
    ];
    // No two recordings are the same: a file has its whole header, or is not there.
    let check = |now: &Files, before: &Files, _: &Files| {
        if let Some(bytes) = now.get("new/sweep.csv") {
            let text = String::from_utf8_lossy(bytes);
            assert!(text.lines().any(|l| l.starts_with("frame,")), "{text}");
        }
        for (name, bytes) in before {
            assert_eq!(now.get(name), Some(bytes), "{name}");
        }
    };
    let ends = [0, 3];
    let next = |dir: &Scratch, _: &Files, _: &Files| {
        let ran = dir.calib_with(&record);
        assert!(
            ends.contains(&ran.code) && dir.path("new/sweep.csv").is_file(),
            "{}",
            ran.stderr
        );
        assert!(!files(dir).keys().any(|n| is_part(n)), "a part was left");
        dir.calib(["convert", "new/sweep.csv", "new/again.csv"])
            .expect(0);
    };
    walk(&Trial {
        name: "record",
        prepare: &|| Scratch::new().brief("justin"),
        arguments: &record,
        code: 3,
        every: 17,
        check: &check,
        next: &next,
    });
    stop.store(true, Ordering::Relaxed);
    sender.join().expect("sent");
}

#[test]
fn a_second_run_into_a_folder_ends_with_seven() {
    let dir = Scratch::new().brief("ripley");
    let held = calib_files::ResultsFolder::open(&dir.path("out")).expect("a free folder");
    let ran = dir.calib_with(RUN).expect(7);
    assert!(
        ran.stderr
            .contains("another run of this program is writing there"),
        "{}",
        ran.stderr
    );
    drop(held);
    dir.calib_with(RUN).expect(1);
}

#[test]
fn a_folder_of_two_runs_is_not_applied() {
    let dir = result().file(
        "out/calib.manifest",
        "# unfinished: run it again\nreport.json\n",
    );
    for arguments in [
        APPLY,
        &["drift", "out", "out"],
        &["apply", "out/ripley.calibrated.urdf", TARGET, "--in-place"],
    ] {
        let ran = dir.calib_with(arguments).expect(3);
        assert!(
            ran.stderr.contains("a run was stopped while it wrote here"),
            "{}",
            ran.stderr
        );
        assert!(!dir.path(RECORD).exists());
    }
}
