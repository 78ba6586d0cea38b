//! The conformance check tells good plugins from bad ones.

use std::time::Duration;

use calib_plugin::{
    Host, SearchPath,
    check::{Conformance, Limits, Outcome, check},
};

use crate::bed::Bed;

fn limits() -> Limits {
    // Small enough for a test, with the same tests as the real one.
    Limits {
        call: Duration::from_secs(3),
        cancel: Duration::from_secs(1),
        // Long enough for a busy machine: the plugins here answer in microseconds.
        describe: Duration::from_millis(100),
        huge: 20_000,
    }
}

fn checked(bed: &Bed, name: &str) -> Conformance {
    let search = SearchPath {
        environment: vec![bed.path().to_path_buf()],
        ..SearchPath::default()
    };
    check(&Host::new(search, true), name, &limits())
}

/// Tests that failed, as `test: detail`.
fn failures(table: &Conformance) -> Vec<String> {
    let failed = |row: &&calib_plugin::check::Row| row.outcome == Outcome::Failed;
    table
        .rows
        .iter()
        .filter(failed)
        .map(|row| format!("{}: {}", row.test, row.detail))
        .collect()
}

#[test]
fn a_plugin_that_does_not_load_has_one_row() {
    let bed = Bed::new();
    if bed.build("tests/c/cor.c", "abi", &["WRONG_ABI"]).is_none() {
        return;
    }
    let table = checked(&bed, "abi");
    assert_eq!((table.rows.len(), table.exit_code()), (1, 6));
    insta::assert_snapshot!(bed.tidy(&table));
}

#[test]
fn a_mean_is_no_center() {
    let bed = Bed::new();
    if bed.build("tests/c/cor.c", "mean", &[]).is_none() {
        return;
    }
    let table = checked(&bed, "mean");
    insta::with_settings!({filters => vec![(r"CorFit \{.*", "CorFit { … }")]}, {
        insta::assert_snapshot!(table);
    });
    assert_eq!(table.exit_code(), 6);
}

/// The outcome of one test, and why.
fn row(table: &Conformance, test: &str) -> (Outcome, String) {
    let mut rows = table.rows.iter().filter(|row| row.test == test);
    let row = rows.next().unwrap_or_else(|| panic!("no {test}: {table}"));
    (row.outcome, row.detail.clone())
}

/// The center of a known sphere with the stated σ: right, twice as large, half as large, with wrong correlations, in some answers, in none.
#[test]
fn a_covariance_is_compared_with_the_scatter() {
    let bed = Bed::new();
    if bed.build("tests/c/stated.c", "right", &[]).is_none() {
        return;
    }
    let right = row(&checked(&bed, "right"), "covariance");
    assert_eq!(right, (Outcome::Passed, String::new()));
    for (deed, outcome, said) in [
        (
            "TWICE",
            Outcome::Failed,
            "points, σ of the tracker stated: x: the stated σ is ",
        ),
        ("HALF", Outcome::Failed, "the scatter of 120 answers "),
        ("CORRELATED", Outcome::Failed, "its correlations are wrong"),
        ("SOMETIMES", Outcome::Failed, "a covariance is stated in "),
        ("NEVER", Outcome::Skipped, "origin-without-covariance"),
        (
            "EXACT_ONLY",
            Outcome::Failed,
            "0 of 120 motions with noise of 0.2 mm were answered",
        ),
    ] {
        bed.build("tests/c/stated.c", deed, &[deed]).unwrap();
        let found = row(&checked(&bed, deed), "covariance");
        assert_eq!(found.0, outcome, "{deed}: {}", found.1);
        assert!(found.1.contains(said), "{deed}: {}", found.1);
    }
}

#[test]
fn leaks_and_state_are_found() {
    let bed = Bed::new();
    if bed.build("tests/c/cor.c", "leaks", &["LEAKS"]).is_none() {
        return;
    }
    let leaks = failures(&checked(&bed, "leaks"));
    assert!(
        leaks.iter().any(|row| row.starts_with("memory: grew by")),
        "{leaks:?}"
    );
    bed.build("tests/c/cor.c", "state", &["KEEPS_STATE"])
        .unwrap();
    let state = failures(&checked(&bed, "state"));
    assert!(
        state
            .iter()
            .any(|row| row.starts_with("same answer twice: first")),
        "{state:?}"
    );
    assert!(
        state.iter().any(|row| row.starts_with("eight threads")),
        "{state:?}"
    );
}

#[test]
fn broken_answers_and_endless_calls_are_found() {
    if !skipped_tests::thorough() {
        return;
    }
    let bed = Bed::new();
    if bed
        .build("tests/c/cor.c", "nan", &["NOT_A_NUMBER"])
        .is_none()
    {
        return;
    }
    let nan = failures(&checked(&bed, "nan"));
    assert!(
        nan[0].ends_with("breaks the contract: center_m[1] is NaN"),
        "{nan:?}"
    );

    bed.build("tests/c/cor.c", "hangs", &["HANGS"]).unwrap();
    let hangs = failures(&checked(&bed, "hangs"));
    assert!(hangs[0].ends_with("did not return within 3s"), "{hangs:?}");
}

#[test]
fn one_that_does_not_ask_cancelled_is_found() {
    let bed = Bed::new();
    if bed
        .build("tests/c/cor.c", "deaf", &["HANGS_FOR_EVER"])
        .is_none()
    {
        return;
    }
    let mut limits = limits();
    limits.huge = 400_000;
    let search = SearchPath {
        environment: vec![bed.path().to_path_buf()],
        ..SearchPath::default()
    };
    let table = check(&Host::new(search, true), "deaf", &limits);
    let failed = failures(&table);
    assert!(
        failed.contains(&"stops when cancelled: did not return within 1s".to_string()),
        "{failed:?}"
    );
    assert!(table.rows.iter().any(|row| row.outcome == Outcome::Skipped));
}

#[test]
fn readers_and_writers_are_checked() {
    let bed = Bed::new();
    if bed.build("tests/c/others.c", "others", &[]).is_none() {
        return;
    }
    let table = checked(&bed, "others");
    let of = |subject: &str| {
        table
            .rows
            .iter()
            .filter(|r| r.subject == subject)
            .map(|r| r.outcome)
            .collect::<Vec<_>>()
    };
    assert_eq!(of("calib.reader/1 two"), [Outcome::Passed; 7]);
    assert_eq!(of("calib.report/1 copy"), [Outcome::Passed; 7], "{table}");
    assert!(of("calib.aor/1 up").contains(&Outcome::Failed));

    bed.build("tests/c/others.c", "scaled", &["SCALED", "NO_FILE"])
        .unwrap();
    let failed = failures(&checked(&bed, "scaled"));
    assert!(
        failed.iter().any(|row| row.contains("is not a rotation")),
        "{failed:?}"
    );
    assert!(
        failed.iter().any(|row| row.contains("no file was made")),
        "{failed:?}"
    );
}
