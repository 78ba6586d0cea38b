//! Complete or untouched, and never somebody else's file.

use std::fs;

use calib_files::{
    FileError, MANIFEST, OutputFile, ResultsFolder, StateFile, input, new_folder, replace, start,
    write_new, write_results,
};

#[test]
fn results_replace_their_own_files_and_no_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let files = |text: &str| [OutputFile::text("a.txt", text)];
    write_results(folder.path(), &files("1")).expect("an empty folder");
    write_results(folder.path(), &files("2")).expect("its own file");
    assert_eq!(fs::read_to_string(at("a.txt")).expect("a.txt"), "2");
    assert_eq!(fs::read_to_string(at(MANIFEST)).expect("list"), "a.txt\n");

    fs::write(at("b.txt"), "mine").expect("b.txt");
    let two = [
        OutputFile::text("a.txt", "3"),
        OutputFile::text("b.txt", "3"),
    ];
    let error = write_results(folder.path(), &two).expect_err("b.txt is not ours");
    assert!(matches!(error, FileError::Foreign { .. }), "{error}");
    assert_eq!(fs::read_to_string(at("a.txt")).expect("a.txt"), "2");
    let twice = [OutputFile::text("c", ""), OutputFile::text("c", "")];
    let error = write_results(folder.path(), &twice).expect_err("one name twice");
    assert!(matches!(error, FileError::SameName { .. }), "{error}");
}

/// What a run does not write any more does not remain, but for files that are not ours.
#[test]
fn files_of_an_earlier_run_that_must_not_remain_are_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let both = [
        OutputFile::text("a.txt", "1"),
        OutputFile::text("old.txt", "1"),
    ];
    write_results(folder.path(), &both).expect("an empty folder");
    fs::write(at("mine.txt"), "mine").expect("mine.txt");
    let results = ResultsFolder::open(folder.path()).expect("a folder");
    let results = results.without(&["old.txt", "mine.txt", "never.txt", "a.txt"]);
    let written = results.write(&both[..1]).expect("its own files");
    assert!(written.contains(&at("a.txt")) && at("a.txt").exists());
    assert!(!at("old.txt").exists());
    assert_eq!(fs::read_to_string(at("mine.txt")).expect("kept"), "mine");
    assert_eq!(fs::read_to_string(at(MANIFEST)).expect("list"), "a.txt\n");
}

#[test]
fn new_files_do_not_overwrite() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = [OutputFile::text("a.txt", "1")];
    write_new(folder.path(), &file).expect("nothing is there");
    write_new(folder.path(), &file).expect("the same bytes are there");
    let other = [OutputFile::text("a.txt", "2")];
    let error = write_new(folder.path(), &other).expect_err("it is there");
    assert!(matches!(error, FileError::Exists { .. }), "{error}");
}

#[cfg(unix)]
#[test]
fn a_replaced_file_keeps_its_permissions_and_a_link_stays_one() {
    use std::os::unix::fs::{PermissionsExt as _, symlink};
    let folder = tempfile::tempdir().expect("a folder");
    let (file, link) = (folder.path().join("file"), folder.path().join("link"));
    fs::write(&file, "old").expect("file");
    fs::set_permissions(&file, fs::Permissions::from_mode(0o640)).expect("permissions");
    symlink(&file, &link).expect("link");
    replace(&link, b"new").expect("the file behind the link");
    assert_eq!(fs::read(&file).expect("file"), b"new");
    assert!(link.is_symlink());
    let mode = fs::metadata(&file).expect("file").permissions().mode();
    assert_eq!(mode & 0o777, 0o640);
}

#[test]
fn a_computation_resumes_where_it_was_interrupted() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("below/x.state");
    let whole = |line: &str| line.ends_with('}');
    let (mut state, finished) = StateFile::open(&path, "settings", true, whole).expect("new");
    assert!(finished.is_empty());
    state.append("{2}").expect("a line");
    state.append("{1}").expect("a line");
    state.append("{3, cut o").expect("an interruption");
    drop(state);

    let error = StateFile::open(&path, "others", true, whole).expect_err("other settings");
    assert!(matches!(error, FileError::OtherState { .. }), "{error}");
    let (state, finished) = StateFile::open(&path, "settings", true, whole).expect("resumed");
    assert_eq!(finished, ["{2}", "{1}"]);
    state.close(&["{1}".into(), "{2}".into()]).expect("closed");
    let text = fs::read_to_string(&path).expect("the file");
    assert_eq!(text, "settings\n{1}\n{2}\n");
    let (_, finished) = StateFile::open(&path, "others", false, whole).expect("started over");
    assert!(finished.is_empty());
}

#[test]
fn a_second_run_into_a_folder_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let inner = folder.path().join("a/b");
    let first = ResultsFolder::open(&inner).expect("a free folder");
    let error = ResultsFolder::open(&inner).expect_err("it is taken");
    assert!(matches!(error, FileError::Busy { .. }), "{error}");
    drop(first);
    assert!(!folder.path().join("a").exists(), "nothing is left behind");
    let second = ResultsFolder::open(&inner).expect("it is free again");
    second
        .write(&[OutputFile::text("a.txt", "1")])
        .expect("written");
}

#[test]
fn names_that_no_folder_can_hold_are_refused_before_anything_is_made() {
    let folder = tempfile::tempdir().expect("a folder");
    let inner = folder.path().join("results");
    for name in ["", ".", "..", "a/b", "a\nb", "con.txt", "calib.manifest"] {
        let error = write_results(&inner, &[OutputFile::text(name, "1")]).expect_err(name);
        assert!(matches!(error, FileError::Name { .. }), "{error}");
    }
    let twice = [OutputFile::text("a.txt", ""), OutputFile::text("A.TXT", "")];
    let error = write_results(&inner, &twice).expect_err("one file on other systems");
    assert!(matches!(error, FileError::SameName { .. }), "{error}");
    assert!(!inner.exists());
}

#[cfg(unix)]
#[test]
fn planted_links_are_never_followed() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().expect("a folder");
    let (inside, outside) = (folder.path().join("in"), folder.path().join("out.txt"));
    fs::create_dir(&inside).expect("a folder");
    fs::write(&outside, "mine").expect("a file of somebody");
    for name in [".a.txt.part", ".calib-0123456789abcdef.part", "b.txt"] {
        symlink(&outside, inside.join(name)).expect("a link");
    }
    let a = [OutputFile::text("a.txt", "1")];
    write_results(&inside, &a).expect("written past the links");
    // A link in the place of a file of ours is replaced, one in the place of another is refused; a link to nothing too.
    fs::remove_file(inside.join("a.txt")).expect("a.txt");
    symlink(&outside, inside.join("a.txt")).expect("a link");
    write_results(&inside, &a).expect("the link is replaced");
    assert!(!inside.join("a.txt").is_symlink());
    symlink(folder.path().join("nowhere"), inside.join("c.txt")).expect("a link");
    for name in ["b.txt", "c.txt"] {
        let one = [OutputFile::text(name, "1")];
        let error = write_results(&inside, &one).expect_err("a link of somebody");
        assert!(matches!(error, FileError::Foreign { .. }), "{error}");
        let error = write_new(&inside, &one).expect_err("a link of somebody");
        assert!(matches!(error, FileError::Exists { .. }), "{error}");
    }
    assert_eq!(fs::read_to_string(&outside).expect("out.txt"), "mine");
    assert!(!folder.path().join("nowhere").exists());
}

#[cfg(unix)]
#[test]
fn only_regular_files_are_read_and_none_beyond_its_limit() {
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = folder.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.is_ok_and(|status| status.success()), "mkfifo");
    for path in [pipe.as_path(), std::path::Path::new("/dev/zero")] {
        let error = input::read(path, 10).expect_err("not regular");
        assert_eq!(error.kind(), std::io::ErrorKind::InvalidInput);
    }
    let file = folder.path().join("file");
    fs::write(&file, "12345").expect("a file");
    assert_eq!(input::read(&file, 5).expect("five bytes"), b"12345");
    let error = input::read(&file, 4).expect_err("too many");
    assert_eq!(error.kind(), std::io::ErrorKind::FileTooLarge);
    assert!(input::read(folder.path(), 10).is_err());
}

/// Every writer removes what killed writers left; none may take a living writer's file for that.
#[test]
fn many_writers_in_one_folder_do_not_disturb_each_other() {
    let dir = tempfile::tempdir().expect("a folder");
    std::thread::scope(|scope| {
        for writer in 0..8 {
            let folder = dir.path();
            scope.spawn(move || {
                for i in 0..60 {
                    let name = format!("{writer}-{i}");
                    start(&folder.join(&name), b"t_s,a\n").expect("a file that grows");
                    let file = [OutputFile::text("x", "y")];
                    new_folder(&folder.join(name + "-folder"), &file).expect("a folder");
                }
            });
        }
    });
    let left = std::fs::read_dir(dir.path()).expect("a folder").count();
    assert_eq!(left, 8 * 60 * 2, "files and folders");
}

#[test]
fn of_several_that_start_one_file_one_does() {
    let dir = tempfile::tempdir().expect("a folder");
    for round in 0..40 {
        let path = dir.path().join(format!("{round}.csv"));
        let started = std::thread::scope(|scope| {
            let all: Vec<_> = (0..6)
                .map(|_| scope.spawn(|| start(&path, b"t_s\n")))
                .collect();
            all.into_iter()
                .map(|one| one.join().expect("no panic"))
                .collect::<Vec<_>>()
        });
        let refused = started
            .iter()
            .filter(|s| matches!(s, Err(FileError::Exists { .. })))
            .count();
        assert_eq!(refused, 5, "{started:?}");
    }
}
