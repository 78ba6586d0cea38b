//! Faults of machines that work on a fleet: full disks, kills, clocks that are wrong, two coordinators. The result is that of a quiet run.

use std::fs::{File, FileTimes};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant, SystemTime};

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha12Rng;

use crate::fleet::{fleet, results, same};
use crate::interruptions::{is_part, traced};
use crate::scratch::{Files, Scratch};

const BATCH: &[&str] = &["batch", "old/*/r.yaml", "--out", "out", "--jobs", "2"];
const STUDY: &[&str] = &[
    "study", "aor", "--trials", "1", "--shard", "3/7", "--out", "out",
];

fn start(dir: &Scratch, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_calib"))
        .args(arguments)
        .current_dir(dir.path(""))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("it starts")
}

fn small_fleet() -> Scratch {
    let dir = Scratch::new();
    fleet(&dir, "old", 3, &[]);
    dir
}

/// Shards of a study, and the words that merge them.
fn shards(dir: &Scratch) -> Vec<String> {
    let mut words = vec!["merge".to_owned()];
    for i in 1..=3 {
        let shard = format!("{i}/3");
        let study = ["study", "aor", "--trials", "1", "--out", "shards"];
        let ran = dir.calib_with(&[&study[..], &["--shard", &shard]].concat());
        words.push(ran.expect(0).stdout.trim().to_owned());
    }
    words.extend(["--out", "out/aor.parquet"].map(str::to_owned));
    words
}

/// One call of the system is refused for want of space; the command says so, leaves whole files only, and works the next time. Returns how
/// often it was said.
fn full_disk(dir: &Scratch, arguments: &[&str]) -> Option<usize> {
    dir.calib_with(arguments).expect(0);
    let quiet = results(dir, "out");
    let mut said = 0;
    for call in ["write", "fsync", "mkdir"] {
        for at in [1, 2, 3, 4, 5, 6, 8, 11, 15, 20] {
            std::fs::remove_dir_all(dir.path("out")).expect("removed");
            let inject = format!("inject={call}:error=ENOSPC:when={at}");
            let ran = traced(
                dir,
                &["-e", &format!("trace={call}"), "-e", &inject],
                arguments,
            )?;
            let trace = dir.read("trace.txt");
            if trace.is_empty() {
                return None;
            }
            let text = String::from_utf8_lossy(&ran.stderr);
            assert!(!text.contains("panicked"), "{inject}: {text}");
            if text.contains("No space left") {
                assert!(!ran.status.success(), "{inject}: {text}");
                said += 1;
            }
            // `results` leaves folders of shards out: all files are looked at here.
            for (name, bytes) in dir.files("out") {
                assert!(!is_part(&name), "{inject}: {name} was left");
                let whole = quiet.get(&name).is_none_or(|quiet| *quiet == bytes);
                let list = bytes.starts_with(b"# unfinished");
                assert!(whole || list, "{inject}: {name} is torn");
            }
            dir.calib_with(arguments).expect(0);
            same(&quiet, &results(dir, "out"));
            if !trace.contains("INJECTED") {
                break;
            }
        }
    }
    Some(said)
}

#[test]
fn a_full_disk_stops_a_batch_a_shard_and_a_merge_and_spoils_nothing() {
    if !skipped_tests::thorough() {
        return;
    }
    let merge = Scratch::new();
    let words = shards(&merge);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    for (dir, arguments) in [
        (small_fleet(), BATCH),
        (Scratch::new(), STUDY),
        (merge, &words),
    ] {
        let Some(said) = full_disk(&dir, arguments) else {
            return skipped_tests::skip("no strace");
        };
        println!("{}: {said} times", arguments[0]);
        assert!(said >= 2, "{}: {said}", arguments[0]);
    }
}

/// Kills at random moments, several of one work, until there were `kills`; then the work is finished.
fn killed(dir: &Scratch, arguments: &[&str], kills: usize, expected: &Files, took: Duration) {
    let mut rng = ChaCha12Rng::seed_from_u64(1);
    let (mut stopped, mut rounds) = (0, 0);
    while stopped < kills {
        rounds += 1;
        assert!(rounds < 10 * kills, "only {stopped} kills came in time");
        std::fs::remove_dir_all(dir.path("out")).expect("removed");
        for _ in 0..4 {
            let mut child = start(dir, arguments);
            std::thread::sleep(took.mul_f64(rng.random_range(0.0..1.0)));
            child.kill().expect("it can be killed");
            stopped += usize::from(!child.wait().expect("it ends").success());
        }
        dir.calib_with(arguments).expect(0);
        same(expected, &results(dir, "out"));
    }
}

/// Wherever the program is killed, the next call ends with the bytes of a quiet one: 100 kills, of which a tenth where tests are to be short.
#[test]
fn kills_at_random_lose_nothing() {
    let part = if skipped_tests::thorough() { 1 } else { 10 };
    let merge = Scratch::new();
    let words = shards(&merge);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    for (dir, arguments, kills) in [
        (small_fleet(), BATCH, 50),
        (Scratch::new(), STUDY, 30),
        (merge, &words, 20),
    ] {
        let started = Instant::now();
        dir.calib_with(arguments).expect(0);
        let took = started.elapsed();
        let expected = results(&dir, "out");
        killed(&dir, arguments, kills / part, &expected, took);
    }
}

/// Sets the time at which a file was changed, to years before or after the start of 1970.
fn set_time(path: &Path, years: u64) {
    let year = Duration::from_secs(365 * 24 * 3600);
    let time = SystemTime::UNIX_EPOCH + year * u32::try_from(years).expect("few");
    let file = File::options().write(true).open(path).expect("a file");
    let times = FileTimes::new().set_modified(time).set_accessed(time);
    file.set_times(times).expect("a time");
}

/// Files of machines whose clocks are wrong: what is done again depends on their content alone.
#[test]
fn file_times_mean_nothing() {
    let dir = small_fleet();
    dir.calib_with(BATCH).expect(0);
    let quiet = results(&dir, "out");
    // Inputs in the future and results in the past, and the other way round.
    for [input, output] in [[150, 10], [10, 150]] {
        for (folder, years) in [("old", input), ("out", output)] {
            for name in dir.files(folder).keys() {
                set_time(&dir.path(&format!("{folder}/{name}")), years);
            }
        }
        let row = dir.path("out/robots/r000/row.json");
        let modified = || {
            let row = std::fs::metadata(&row).expect("a row");
            row.modified().expect("a time")
        };
        let before = modified();
        dir.calib_with(BATCH).expect(0);
        assert_eq!(modified(), before, "a finished robot was calibrated again");
        same(&quiet, &results(&dir, "out"));
    }
    // Another recording under the old name, older than the results of the first.
    std::fs::copy(
        dir.path("old/r001/holds.csv"),
        dir.path("old/r000/holds.csv"),
    )
    .expect("copied");
    set_time(&dir.path("old/r000/holds.csv"), 1);
    dir.calib_with(BATCH).expect(0);
    let continued = results(&dir, "out");
    assert!(
        continued["robots/r000/row.json"] != quiet["robots/r000/row.json"],
        "the new recording was not read"
    );
    std::fs::remove_dir_all(dir.path("out")).expect("removed");
    dir.calib_with(BATCH).expect(0);
    same(&results(&dir, "out"), &continued);
}

/// Two coordinators start the same batch, and the same shard, at once: one does it, the other ends with 7, or finds it done.
#[test]
fn two_coordinators_do_nothing_twice() {
    for (dir, arguments) in [(small_fleet(), BATCH), (Scratch::new(), STUDY)] {
        dir.calib_with(arguments).expect(0);
        let quiet = results(&dir, "out");
        std::fs::remove_dir_all(dir.path("out")).expect("removed");
        let both = [start(&dir, arguments), start(&dir, arguments)];
        let mut codes = both.map(|mut child| child.wait().expect("it ends").code());
        codes.sort_unstable();
        assert!(codes[0] == Some(0), "{codes:?}");
        assert!([Some(0), Some(7)].contains(&codes[1]), "{codes:?}");
        same(&quiet, &results(&dir, "out"));
    }
}
