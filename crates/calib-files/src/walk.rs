//! Fails every change of the disk in turn: as an error of the system, and as a stop after which nothing is done any more.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::fault::{CALLS, FAULT, Fault};

use crate::{
    FileError, OutputFile, is_unfinished, new_folder, remove, replace, start, write_new,
    write_results,
};

type Files = BTreeMap<String, String>;

fn files_of(folder: &Path) -> Files {
    let mut found = Files::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy();
        match path.is_dir() {
            true => found.extend(
                files_of(&path)
                    .into_iter()
                    .map(|(inner, text)| (format!("{name}/{inner}"), text)),
            ),
            false => {
                let text = fs::read_to_string(&path).expect("a text");
                found.insert(name.into_owned(), text);
            }
        }
    }
    found
}

/// Runs `act` with each fault at each call, on a folder that `prepare` filled; returns how many there were.
fn walk(
    prepare: &dyn Fn(&Path),
    act: &dyn Fn(&Path) -> std::result::Result<(), FileError>,
) -> usize {
    let fresh = || {
        let folder = tempfile::tempdir().expect("a folder");
        prepare(folder.path());
        folder
    };
    let folder = fresh();
    let before = files_of(folder.path());
    act(folder.path()).expect("no fault");
    let after = files_of(folder.path());
    let mut points = 0;
    for kind in [Fault::Error, Fault::Stop] {
        for at in 0.. {
            let folder = fresh();
            CALLS.set(0);
            FAULT.set(kind(at));
            let done = act(folder.path());
            FAULT.set(Fault::None);
            if CALLS.get() <= at {
                break;
            }
            points += 1;
            let case = format!("{:?}", kind(at));
            let left = files_of(folder.path());
            for (name, text) in &left {
                let list = name.ends_with(crate::MANIFEST) && text.starts_with("# unfinished");
                let whole = list || [before.get(name), after.get(name)].contains(&Some(text));
                let leftover = name.contains(".part");
                assert!(whole || leftover, "{case}: {name} is torn: {text:?}");
                assert!(
                    !leftover || kind(at) == Fault::Stop(at),
                    "{case}: {name} was left"
                );
            }
            for name in before.keys() {
                let gone = left.contains_key(name) || !after.contains_key(name);
                assert!(gone, "{case}: {name} is lost");
            }
            // A removal that was done already cannot be repeated.
            if left == after && after.len() < before.len() {
                continue;
            }
            let again = act(folder.path());
            assert!(
                again.is_ok(),
                "{case}: the next call: {again:?}, after {done:?}"
            );
            assert_eq!(
                files_of(folder.path()),
                after,
                "{case}: after the next call"
            );
        }
    }
    points
}

fn two(version: &str) -> [OutputFile; 2] {
    [
        OutputFile::text("a.txt", format!("a of {version}\n")),
        OutputFile::text("b.txt", format!("b of {version}\n")),
    ]
}

#[test]
fn results_survive_every_fault() {
    let write = |folder: &Path| write_results(&folder.join("x/results"), &two("2")).map(drop);
    let fresh = walk(&|_| (), &write);
    let used = |folder: &Path| {
        write_results(&folder.join("x/results"), &two("1")).expect("a first run");
    };
    let again = walk(&used, &write);
    // Two folders; four files of two or three calls; one rename each; four times the folder itself.
    assert!(fresh > 40 && again > 35, "{fresh} and {again} points");
}

#[test]
fn a_used_folder_says_when_its_files_are_of_two_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    write_results(folder.path(), &two("1")).expect("a first run");
    let mut seen = 0;
    for at in 0..40 {
        CALLS.set(0);
        FAULT.set(Fault::Stop(at));
        let done = write_results(folder.path(), &two("2"));
        FAULT.set(Fault::None);
        let text = |name: &str| fs::read_to_string(folder.path().join(name)).expect("whole");
        let (a, b) = (text("a.txt"), text("b.txt"));
        if a.ends_with("2\n") != b.ends_with("2\n") {
            assert!(done.is_err() && is_unfinished(folder.path()));
            seen += 1;
        }
        write_results(folder.path(), &two("1")).expect("the old files again");
        assert!(!is_unfinished(folder.path()));
    }
    assert!(seen > 0, "no stop was between two renames");
}

#[test]
fn single_files_survive_every_fault() {
    let new = |folder: &Path| write_new(&folder.join("x"), &two("1")).map(drop);
    let nothing = |_: &Path| ();
    let one = |folder: &Path| fs::write(folder.join("a.txt"), "old").expect("a file");
    let over = |folder: &Path| replace(&folder.join("a.txt"), b"new");
    let gone = |folder: &Path| remove(&folder.join("a.txt"));
    let begun = |folder: &Path| {
        let path = folder.join("a.csv");
        let text = "t_s,a\n";
        if fs::read_to_string(&path).is_ok_and(|there| there == text) {
            // As the next call in the folder does.
            crate::staged::clean(folder);
            return Ok(());
        }
        start(&path, text.as_bytes()).map(drop)
    };
    let pieces = |folder: &Path| {
        crate::write_pieces(&folder.join("x/p.bin"), |sink| {
            let path = folder.join("x/p.bin");
            let write = |source| FileError::Write { path, source };
            let written = ["first ", "second ", "third"]
                .iter()
                .try_for_each(|piece| std::io::Write::write_all(sink, piece.as_bytes()));
            written.map_err(write)
        })
    };
    let project = |folder: &Path| {
        let files = [
            OutputFile::text("src/lib.rs", "//!"),
            OutputFile::text("x", "y"),
        ];
        match folder.join("p/x").exists() {
            true => Ok(()),
            false => new_folder(&folder.join("p"), &files),
        }
    };
    let mut points = walk(&nothing, &new);
    points += walk(&one, &over) + walk(&nothing, &over) + walk(&one, &gone);
    points += walk(&nothing, &begun) + walk(&nothing, &project);
    points += walk(&nothing, &pieces);
    assert!(points > 60, "{points} points");
}

#[test]
fn a_part_of_a_living_writer_is_not_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let living = crate::staged::Staged::file(folder.path(), b"being written").expect("a part");
    write_results(folder.path(), &two("1")).expect("another writer");
    living
        .place(&folder.path().join("c.txt"))
        .expect("it is still there");
}
