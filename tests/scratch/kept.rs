//! Runs of the program on shipped robots, kept between test binaries: seven of them look at the same four.
//!
//! A run is found by all that it follows from: the program (its file's time and size), the arguments and the bytes of the folder.

use std::collections::hash_map::DefaultHasher;
use std::fs;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};

use super::{Ran, Scratch, files_below};

/// Runs the program in the folder, or copies what the same run wrote before.
pub fn run(dir: &Scratch, arguments: &[&str]) -> Ran {
    let program = fs::metadata(env!("CARGO_BIN_EXE_calib")).expect("the program");
    let program = hashed(&(program.modified().expect("a time"), program.len()));
    let before = dir.files("");
    let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join("kept");
    let place = kept.join(&program).join(hashed(&(arguments, &before)));
    if let Some(ran) = copied(dir, &place) {
        return ran;
    }
    let ran = dir.calib_with(arguments);
    forget_all_but(&kept, &program);
    keep(dir, &before, &ran, &place);
    ran
}

fn hashed(of: &impl Hash) -> String {
    let mut hasher = DefaultHasher::new();
    of.hash(&mut hasher);
    format!("{:016x}", hasher.finish())
}

/// Where the folder's own path stands in a kept text.
const FOLDER: &str = "[folder]";

fn copied(dir: &Scratch, place: &Path) -> Option<Ran> {
    let said = fs::read(place.join("said.json")).ok()?;
    let (code, stdout, stderr): (i32, String, String) =
        serde_json::from_slice(&said).expect("as it was kept");
    for (file, bytes) in files_below(&place.join("files")) {
        dir.write(&file, &bytes);
    }
    let here = dir.path("").display().to_string();
    Some(Ran {
        code,
        stdout: stdout.replace(FOLDER, &here),
        stderr: stderr.replace(FOLDER, &here),
    })
}

/// Renamed into its place when whole, so that no one finds half of it.
fn keep(dir: &Scratch, before: &super::Files, ran: &Ran, place: &Path) {
    let parent = place.parent().expect("a folder");
    fs::create_dir_all(parent).expect("a folder");
    let new = tempfile::tempdir_in(parent).expect("a folder");
    let write = |file: PathBuf, bytes: &[u8]| {
        fs::create_dir_all(file.parent().expect("a folder")).expect("a folder");
        fs::write(file, bytes).expect("a file");
    };
    for (file, bytes) in dir.files("") {
        if before.get(&file) != Some(&bytes) {
            write(new.path().join("files").join(file), &bytes);
        }
    }
    let here = dir.path("").display().to_string();
    let said = (
        ran.code,
        ran.stdout.replace(&here, FOLDER),
        ran.stderr.replace(&here, FOLDER),
    );
    write(
        new.path().join("said.json"),
        &serde_json::to_vec(&said).expect("text"),
    );
    // Another binary may have been faster.
    let _ = fs::rename(new.path(), place);
}

/// Removes the runs of older programs.
fn forget_all_but(kept: &Path, program: &str) {
    for old in fs::read_dir(kept).into_iter().flatten().flatten() {
        if old.file_name() != program {
            let _ = fs::remove_dir_all(old.path());
        }
    }
}
