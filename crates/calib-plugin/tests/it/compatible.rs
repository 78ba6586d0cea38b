//! Growth: older plugins in this host, newer minors in this host.

use std::collections::BTreeMap;

use calib_plugin::{Answer, Control, Source};

use crate::bed::{Bed, cubes};

#[test]
fn an_older_plugin_with_smaller_structs_loads() {
    let bed = Bed::new();
    if bed.build("tests/c/older.c", "older", &[]).is_none() {
        return;
    }
    let plugin = bed.load("older").unwrap();
    let names: Vec<_> = plugin
        .description
        .offers
        .iter()
        .map(|o| o.name.as_str())
        .collect();
    assert_eq!(names, ["size", "again"]);
    // What came later is empty, and not what stands behind the struct.
    assert!(
        plugin
            .description
            .offers
            .iter()
            .all(|o| o.example.is_empty())
    );
    let entry = plugin.reader("again").unwrap();
    assert!(!entry.recognizes(b"anything"));
    let reader = entry.with(&BTreeMap::new()).unwrap();
    let streams = reader
        .read(
            &Source {
                name: "x",
                bytes: b"12345",
            },
            &Control::default(),
        )
        .unwrap();
    assert_eq!(streams.joints[0].samples, [Some(5.0)]);
}

#[test]
fn a_newer_minor_loads_and_what_is_unknown_is_skipped_with_a_message() {
    let bed = Bed::new();
    if bed.build("tests/c/newer.c", "newer", &[]).is_none() {
        return;
    }
    let plugin = bed.load("newer").unwrap();
    assert_eq!(plugin.description.abi, (1, 7));
    assert_eq!(
        plugin.description.skipped,
        [
            "`beam` is skipped: this version knows no kind `calib.teleport/1`",
            "`vectors` is skipped: this version knows no parameter type 99",
            "`clouds` is skipped: it takes none of the data that this version has",
        ]
    );
    let grown = plugin.cor("grown").unwrap().with(&BTreeMap::new()).unwrap();
    let Answer::Found(fit) = grown.fit(&cubes().view(), &Control::default()).unwrap() else {
        panic!("a center")
    };
    assert_eq!(fit.center_m, [1.5, 2.5, 0.0]);
}
