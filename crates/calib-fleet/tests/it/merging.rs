//! Shards: merged they are the work done at once, and whatever does not belong is named.

use std::path::{Path, PathBuf};

use calib_fleet::FleetError;
use calib_fleet::merge::merge;
use calib_fleet::shard::{Identity, Shard};
use calib_fleet::shard_file::{Finished, write_shard};

fn work(units: u64) -> Identity {
    Identity {
        kind: "test".to_owned(),
        seed: 7,
        inputs: "abc".to_owned(),
        units,
        version: "0.1.0".to_owned(),
    }
}

fn unit(unit: u64) -> Finished {
    Finished {
        unit,
        name: format!("unit {unit}"),
        // Lengths that differ, so that groups do not end at round numbers.
        result: format!("[{}]", "0.125,".repeat((unit * 37 % 101) as usize)),
    }
}

fn shard(folder: &Path, work: &Identity, shard: Shard) -> PathBuf {
    let path = folder.join(format!("{}-{}.parquet", shard.index, shard.of));
    let units = shard.range(work.units).map(|k| Ok(unit(k)));
    write_shard(&path, (work, shard), units).expect("a shard");
    path
}

fn shards(folder: &Path, work: &Identity, of: u64) -> Vec<PathBuf> {
    let all = (1..=of).map(|index| shard(folder, work, Shard { index, of }));
    all.collect()
}

fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).expect("a file")
}

#[test]
fn merged_shards_are_the_work_done_at_once() {
    for units in [0, 1, 63, 10_000] {
        let work = work(units);
        let folder = tempfile::tempdir().expect("a folder");
        let whole = shard(folder.path(), &work, Shard::WHOLE);
        for of in [1, 2, 7, 64] {
            let folder = tempfile::tempdir().expect("a folder");
            let mut files = shards(folder.path(), &work, of);
            files.reverse();
            let out = folder.path().join("merged.parquet");
            let merged = merge(&files, &out, &|_, _| {}).expect("merged");
            assert_eq!(merged.shards, of);
            assert!(bytes(&out) == bytes(&whole), "{units} units, {of} shards");
        }
    }
}

/// `cargo test --release -p calib-fleet --test it gigabytes -- --ignored --nocapture` prints how fast shards of 2 GB are merged, and what
/// memory that takes.
#[test]
#[ignore = "writes 4 GB"]
fn shards_of_gigabytes() {
    // The results of a scene of `study aor` have some 4 kB.
    let result = format!("[{}]", vec!["0.12345678901234567"; 200].join(","));
    let work = work(512 * 1024);
    let folder = tempfile::tempdir().expect("a folder");
    let of = 8;
    let mut size = 0;
    let mut files = Vec::new();
    for index in 1..=of {
        let path = folder.path().join(format!("{index}.parquet"));
        let part = Shard { index, of };
        let units = part.range(work.units).map(|k| {
            Ok(Finished {
                result: result.clone(),
                ..unit(k)
            })
        });
        write_shard(&path, (&work, part), units).expect("a shard");
        size += std::fs::metadata(&path).expect("a file").len();
        files.push(path);
    }
    let out = folder.path().join("merged.parquet");
    let started = std::time::Instant::now();
    merge(&files, &out, &|_, _| {}).expect("merged");
    let rate = size as f64 / 1e6 / started.elapsed().as_secs_f64();
    // Peak of the resident memory, kB, where the system says it.
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| {
        let text = line.strip_prefix("VmHWM:")?.trim();
        text.strip_suffix(" kB")?.parse::<u64>().ok()
    });
    println!("{} MB, {rate:.0} MB/s, peak {peak:?} kB", size / 1_000_000);
    assert!(size > 2_000_000_000 && rate > 200.0, "{rate:.0} MB/s");
    assert!(peak.is_none_or(|peak| peak < 300_000), "{peak:?} kB");
}

/// What is wrong is named with its file, and nothing is written.
#[track_caller]
fn refused(files: &[PathBuf], folder: &Path, file: Option<&Path>, said: &[&str]) {
    let out = folder.join("merged.parquet");
    let error = merge(files, &out, &|_, _| {}).expect_err("it does not belong");
    assert_eq!(error.exit_code() as u8, 3);
    assert_eq!(error.path(), file);
    let text = error.to_string();
    for part in said.iter().chain(&["\n  help: "]) {
        assert!(text.contains(part), "`{part}` in {text}");
    }
    assert!(!out.exists());
    let parts = std::fs::read_dir(folder).expect("a folder").flatten();
    let parts = parts.filter(|e| e.file_name().to_string_lossy().starts_with(".calib-"));
    assert_eq!(parts.count(), 0, "a part was left");
}

#[test]
fn a_missing_shard_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut files = shards(folder.path(), &work(100), 7);
    files.remove(4);
    refused(
        &files,
        folder.path(),
        None,
        &["of 7 shards of `test`, 5 is missing", "--shard i/7"],
    );
    files.remove(1);
    refused(&files, folder.path(), None, &["2 and 5 are missing"]);
}

#[test]
fn a_torn_shard_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = shards(folder.path(), &work(100), 3);
    let whole = bytes(&files[1]);
    for length in [0, 3, whole.len() / 2, whole.len() - 1] {
        std::fs::write(&files[1], &whole[..length]).expect("a file");
        refused(
            &files,
            folder.path(),
            Some(&files[1]),
            &["is not a whole Parquet file", "run that shard again"],
        );
    }
    // A changed byte of a result, which Parquet does not notice.
    let mut changed = whole.clone();
    let place = whole
        .windows(5)
        .position(|w| w == b"0.125")
        .expect("a result");
    changed[place] = b'9';
    std::fs::write(&files[1], changed).expect("a file");
    refused(
        &files,
        folder.path(),
        Some(&files[1]),
        &["the checksum differs"],
    );
}

#[test]
fn a_doubled_shard_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut files = shards(folder.path(), &work(100), 3);
    let copy = folder.path().join("copy.parquet");
    std::fs::copy(&files[0], &copy).expect("a copy");
    files.push(copy.clone());
    refused(
        &files,
        folder.path(),
        Some(&copy),
        &["is shard 1/3, and so is", "give each shard once"],
    );
}

#[test]
fn a_foreign_shard_is_named_with_what_differs() {
    let own = work(100);
    let others = [
        (
            Identity {
                seed: 8,
                ..own.clone()
            },
            "seed is `8`, that of the others `7`",
        ),
        (
            Identity {
                kind: "cor".to_owned(),
                ..own.clone()
            },
            "kind of work is `cor`",
        ),
        (
            Identity {
                inputs: "x".to_owned(),
                ..own.clone()
            },
            "checksum of settings and inputs is `x`",
        ),
        (
            Identity {
                units: 101,
                ..own.clone()
            },
            "number of units is `101`",
        ),
        (
            Identity {
                version: "9".to_owned(),
                ..own.clone()
            },
            "version of calib is `9`",
        ),
    ];
    for (other, said) in others {
        let folder = tempfile::tempdir().expect("a folder");
        let mut files = shards(folder.path(), &own, 3);
        std::fs::remove_file(&files[0]).expect("it is there");
        files[0] = shard(folder.path(), &other, Shard { index: 1, of: 3 });
        refused(
            &files,
            folder.path(),
            Some(&files[0]),
            &["belongs to another work", said],
        );
    }
    let folder = tempfile::tempdir().expect("a folder");
    let mut files = shards(folder.path(), &own, 3);
    files[2] = shard(folder.path(), &own, Shard { index: 3, of: 4 });
    refused(
        &files,
        folder.path(),
        Some(&files[2]),
        &["number of shards is `4`"],
    );
}

#[test]
fn a_merged_file_is_not_overwritten_by_another() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = shards(folder.path(), &work(100), 2);
    let out = folder.path().join("merged.parquet");
    let again = || merge(&files, &out, &|_, _| {});
    again().expect("merged");
    again().expect("the same bytes are there already");
    std::fs::write(&out, "mine").expect("a file");
    let error = again().expect_err("a file of somebody else");
    assert!(matches!(error, FleetError::File(_)), "{error}");
    assert_eq!(
        (error.exit_code() as u8, bytes(&out)),
        (7, b"mine".to_vec())
    );
}
