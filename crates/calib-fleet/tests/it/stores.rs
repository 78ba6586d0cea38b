//! Shards by way of an object store: a folder, and S3 where a server is named (`CALIB_S3`, its buckets being made beforehand).

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use calib_fleet::merge::merge;
use calib_fleet::shard::{Identity, Shard};
use calib_fleet::store::{Store, StoreFault};
use calib_fleet::work::{Asked, run_shard};
use calib_fleet::{FleetError, ShardFault};

/// What stands in for a long work: results that compress badly, of some 100 bytes each.
fn result(unit: u64) -> Result<(String, String), serde_json::Error> {
    let number = |k: u64| (unit * 97 + k).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let text: String = (0..6).map(|k| format!("{:016x}", number(k))).collect();
    Ok((unit.to_string(), format!("{text:?}")))
}

fn work(units: u64) -> Identity {
    Identity {
        kind: "test".to_owned(),
        seed: 1,
        inputs: "abc".to_owned(),
        units,
        version: "0.1.0".to_owned(),
    }
}

fn asked<'a>(
    identity: &'a Identity,
    (index, of): (u64, u64),
    out: &'a Path,
    store: Option<&'a Store>,
) -> Asked<'a> {
    Asked {
        identity,
        shard: Shard { index, of },
        out,
        resume: true,
        threads: Some(1),
        store,
    }
}

/// Stores to test with: a folder, and a bucket's folder of this name where there is a server.
fn stores(folder: &Path, name: &str) -> Vec<String> {
    let mut all = vec![format!("file://{}/shards/{name}", folder.display())];
    match std::env::var("CALIB_S3") {
        Ok(bucket) => all.push(format!("{}/{name}", bucket.trim_end_matches('/'))),
        Err(_) => skipped_tests::skip(
            "no S3 server is named (CALIB_S3; tests/checkers/store.sh starts one)",
        ),
    }
    all
}

#[test]
fn machines_without_a_common_disk_make_the_same_bytes() {
    let root = tempfile::tempdir().expect("a folder");
    // The last size is sent in several parts.
    for (name, units, of) in [("few", 40, 3), ("empty", 2, 5), ("large", 90_000, 1)] {
        let work = work(units);
        let quiet = root.path().join(name);
        let one = asked(&work, (1, 1), &quiet, None);
        let expected = run_shard(&one, &result, &|_, _| {}).expect("made");
        let expected = std::fs::read(expected).expect("bytes");
        for (k, url) in stores(root.path(), name).iter().enumerate() {
            let machine = |index: u64| root.path().join(format!("{name}-{k}-machine-{index}"));
            for index in 1..=of {
                let store = Store::open(url).expect("opened");
                let out = machine(index);
                let asked = asked(&work, (index, of), &out, Some(&store));
                run_shard(&asked, &result, &|_, _| {}).expect("made");
                std::fs::remove_dir_all(out).expect("the machine is gone");
            }
            // Another one takes what is there.
            let store = Store::open(&format!("{url}/")).expect("opened");
            let made = AtomicU64::new(0);
            let counted = |unit| {
                made.fetch_add(1, Ordering::SeqCst);
                result(unit)
            };
            let out = machine(1);
            let again = asked(&work, (1, of), &out, Some(&store));
            run_shard(&again, &counted, &|_, _| {}).expect("there");
            assert_eq!(made.into_inner(), 0);
            let fetched = root.path().join(format!("{name}-{k}-fetched"));
            let files = store.fetch_all(&fetched, &|_, _| {}).expect("fetched");
            assert_eq!(files.len() as u64, of);
            let all = root.path().join(format!("{name}-{k}.parquet"));
            merge(&files, &all, &|_, _| {}).expect("merged");
            assert!(std::fs::read(&all).expect("bytes") == expected, "{url}");
        }
    }
}

#[test]
fn what_is_no_shard_of_this_work_is_refused_and_named() {
    let root = tempfile::tempdir().expect("a folder");
    let (mine, other) = (work(40), {
        Identity {
            seed: 2,
            ..work(40)
        }
    });
    for url in stores(root.path(), "foreign") {
        let store = Store::open(&url).expect("opened");
        let (first, second) = (root.path().join("first"), root.path().join("second"));
        let of_other = asked(&other, (2, 3), &first, Some(&store));
        run_shard(&of_other, &result, &|_, _| {}).expect("made");
        let of_mine = asked(&mine, (2, 3), &second, Some(&store));
        let error = run_shard(&of_mine, &result, &|_, _| {}).expect_err("another seed");
        let FleetError::Store(error) = &error else {
            panic!("{error}");
        };
        assert_eq!(error.url, format!("{url}/test-2-of-3.parquet"));
        assert!(error.to_string().contains("the seed `2`"), "{error}");
        // Nothing of it is left here; started over, it is written in its place.
        let mut of_mine = of_mine;
        assert!(!of_mine.file().exists());
        of_mine.resume = false;
        run_shard(&of_mine, &result, &|_, _| {}).expect("made");
        // Torn on its way by whoever copied it.
        let bytes = std::fs::read(of_mine.file()).expect("bytes");
        let torn = root.path().join("torn");
        std::fs::write(&torn, &bytes[..bytes.len() / 2]).expect("a file");
        store.put(&torn, "test-2-of-3.parquet").expect("left");
        let third = root.path().join("third");
        let again = asked(&mine, (2, 3), &third, Some(&store));
        let error = run_shard(&again, &result, &|_, _| {}).expect_err("torn");
        assert!(matches!(error, FleetError::Store(_)), "{error}");
        // Of the refused one there is nothing left that the next store would meet.
        assert!(!third.join("test-2-of-3").exists());
        for folder in [first, second] {
            std::fs::remove_dir_all(folder).expect("gone");
        }
    }
}

#[test]
fn a_call_that_was_stopped_before_the_store_is_repeated() {
    let root = tempfile::tempdir().expect("a folder");
    let work = work(40);
    for url in stores(root.path(), "stopped") {
        let store = Store::open(&url).expect("opened");
        let out = root.path().join("out");
        let alone = asked(&work, (1, 1), &out, None);
        run_shard(&alone, &result, &|_, _| {}).expect("made");
        assert!(!store.holds("test-1-of-1.parquet").expect("asked"));
        let with = asked(&work, (1, 1), &out, Some(&store));
        run_shard(&with, &result, &|_, _| {}).expect("left");
        assert_eq!(store.shards().expect("listed"), ["test-1-of-1.parquet"]);
        std::fs::remove_dir_all(out).expect("gone");
    }
}

#[test]
fn addresses_that_nobody_could_mean_are_refused() {
    for url in [
        "",
        "shards",
        "ftp://a/b",
        "s3://",
        "s3://a b/run",
        "file://shards",
    ] {
        let error = Store::open(url).expect_err(url);
        assert!(matches!(error.fault, StoreFault::Address(_)), "{error}");
        assert_eq!(error.exit_code() as u8, 2);
    }
    let root = tempfile::tempdir().expect("a folder");
    if std::env::var("CALIB_S3").is_ok() {
        // Known before anything is calculated, and not only when a result is left.
        let store = Store::open("s3://no-such-bucket/run").expect("opened");
        let error = store.holds("a.parquet").expect_err("no bucket");
        assert_eq!(error.fault, StoreFault::Missing, "{error}");
        let error = store.shards().expect_err("no bucket");
        assert_eq!(error.fault, StoreFault::Missing, "{error}");
    }
    let store = Store::open(&format!("file://{}", root.path().display())).expect("opened");
    let error = store.shards().expect_err("nothing there");
    assert_eq!(error.fault, StoreFault::Empty);
    let error = store.fetch("a.parquet", &root.path().join("b.parquet"));
    let FleetError::Store(error) = error.expect_err("nothing there") else {
        panic!("another error");
    };
    assert_eq!(error.fault, StoreFault::Missing);
    assert!(!root.path().join("b.parquet").exists());
}

#[test]
fn a_doubled_shard_is_found_among_fetched_ones() {
    let root = tempfile::tempdir().expect("a folder");
    let work = work(4);
    let url = format!("file://{}/doubled", root.path().display());
    let store = Store::open(&url).expect("opened");
    let out = root.path().join("out");
    let file = run_shard(
        &asked(&work, (1, 1), &out, Some(&store)),
        &result,
        &|_, _| {},
    );
    store
        .put(&file.expect("made"), "copy.parquet")
        .expect("left");
    let files = store
        .fetch_all(&root.path().join("f"), &|_, _| {})
        .expect("fetched");
    let error = merge(&files, &root.path().join("all"), &|_, _| {}).expect_err("twice");
    let FleetError::Shard(error) = error else {
        panic!("{error}");
    };
    assert!(
        matches!(*error.fault, ShardFault::Doubled { .. }),
        "{error}"
    );
}
