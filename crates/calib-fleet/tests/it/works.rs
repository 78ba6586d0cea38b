//! Shards are resumed, locked, and made once.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use calib_files::FileError;
use calib_fleet::FleetError;
use calib_fleet::shard::{Identity, Shard};
use calib_fleet::work::{Asked, results, run_shard};

fn work() -> Identity {
    Identity {
        kind: "test".to_owned(),
        seed: 1,
        inputs: "abc".to_owned(),
        units: 40,
        version: "0.1.0".to_owned(),
    }
}

fn asked<'a>(identity: &'a Identity, out: &'a Path) -> Asked<'a> {
    Asked {
        identity,
        shard: Shard { index: 2, of: 3 },
        out,
        resume: true,
        threads: Some(2),
        store: None,
    }
}

fn square(unit: u64) -> Result<(String, String), serde_json::Error> {
    Ok((unit.to_string(), (unit * unit).to_string()))
}

#[test]
fn a_stopped_shard_goes_on_and_ends_with_the_same_bytes() {
    let work = work();
    let quiet = tempfile::tempdir().expect("a folder");
    let whole = run_shard(&asked(&work, quiet.path()), &square, &|_, _| {}).expect("made");
    let expected = std::fs::read(&whole).expect("bytes");
    let folder = whole.parent().expect("a folder");
    let left: Vec<_> = std::fs::read_dir(folder)
        .expect("a folder")
        .flatten()
        .collect();
    assert_eq!(left.len(), 1, "only the shard is left: {left:?}");

    let stopped = tempfile::tempdir().expect("a folder");
    let asked = asked(&work, stopped.path());
    for limit in [0, 1, 3, 4] {
        let made = AtomicU64::new(0);
        // A worker that fails after some units stands for one that is stopped.
        let failing = |unit| match made.fetch_add(1, Ordering::SeqCst) < limit {
            true => square(unit),
            false => Err(serde_json::from_str::<u64>("stopped").unwrap_err()),
        };
        let error = run_shard(&asked, &failing, &|_, _| {}).expect_err("it is stopped");
        assert!(matches!(error, FleetError::Unwritable(_)), "{error}");
        assert!(!asked.file().exists());
    }
    // A line that was being written when the power failed.
    let state = asked.folder().join("state.jsonl");
    let mut text = std::fs::read_to_string(&state).expect("finished units");
    let known = text.lines().count() as u64 - 1;
    assert_eq!(known, 8);
    text.push_str("{\"unit\":14,\"na");
    std::fs::write(&state, text).expect("a file");
    let made = AtomicU64::new(0);
    let counted = |unit| {
        made.fetch_add(1, Ordering::SeqCst);
        square(unit)
    };
    let path = run_shard(&asked, &counted, &|_, _| {}).expect("made");
    assert!(std::fs::read(&path).expect("bytes") == expected);
    let range = asked.shard.range(work.units);
    assert_eq!(made.load(Ordering::SeqCst), range.end - range.start - known);
    // Once made, it is only checked.
    let never = |_| -> Result<(String, String), serde_json::Error> { panic!("made twice") };
    assert_eq!(run_shard(&asked, &never, &|_, _| {}).expect("there"), path);
}

#[test]
fn two_coordinators_of_one_shard_are_one_too_many() {
    let work = work();
    let out = tempfile::tempdir().expect("a folder");
    let asked = asked(&work, out.path());
    let inner = |unit| {
        let second = run_shard(&asked, &square, &|_, _| {}).expect_err("it is being made");
        assert!(
            matches!(second, FleetError::File(FileError::Busy { .. })),
            "{second}"
        );
        assert_eq!(second.exit_code() as u8, 7);
        square(unit)
    };
    run_shard(&asked, &inner, &|_, _| {}).expect("made");
}

#[test]
fn a_folder_with_another_work_is_refused() {
    let work = work();
    let out = tempfile::tempdir().expect("a folder");
    run_shard(&asked(&work, out.path()), &square, &|_, _| {}).expect("made");
    let other = Identity {
        seed: 2,
        ..work.clone()
    };
    let mut asked = asked(&other, out.path());
    let error = run_shard(&asked, &square, &|_, _| {}).expect_err("another seed");
    assert_eq!(error.exit_code() as u8, 2);
    assert!(error.to_string().contains("--restart"), "{error}");
    asked.resume = false;
    run_shard(&asked, &square, &|_, _| {}).expect("started over");
}

#[test]
fn only_a_whole_work_has_results() {
    let work = work();
    let out = tempfile::tempdir().expect("a folder");
    let mut asked = asked(&work, out.path());
    let part = run_shard(&asked, &square, &|_, _| {}).expect("made");
    let error = results::<u64>(&part, &work).map(drop).expect_err("a part");
    assert!(
        error.to_string().contains("is shard 2/3, not a whole work"),
        "{error}"
    );
    asked.shard = Shard::WHOLE;
    let whole = run_shard(&asked, &square, &|_, _| {}).expect("made");
    let squares: Vec<u64> = (0..40).map(|k| k * k).collect();
    let read = results::<u64>(&whole, &work).expect("whole");
    assert_eq!(
        read.map(|unit| unit.expect("read")).collect::<Vec<_>>(),
        squares
    );
    let mut read = results::<String>(&whole, &work).expect("whole");
    let error = read.find_map(Result::err).expect("numbers");
    assert!(
        error
            .to_string()
            .contains("the result of unit 0 cannot be read"),
        "{error}"
    );
}
