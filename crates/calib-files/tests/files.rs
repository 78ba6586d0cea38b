//! Complete or untouched, and never somebody else's file.

use std::fs;

use calib_files::{FileError, MANIFEST, OutputFile, StateFile, replace, write_new, write_results};

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

#[test]
fn new_files_do_not_overwrite() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = [OutputFile::text("a.txt", "1")];
    write_new(folder.path(), &file).expect("nothing is there");
    let error = write_new(folder.path(), &file).expect_err("it is there");
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
