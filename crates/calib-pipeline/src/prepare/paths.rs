//! What to do about a file that cannot be read or written.

use std::io::{Error, ErrorKind};
use std::path::Path;

use calib_urdf::nearest::nearest;

/// The remedy for a file that cannot be read; a missing one may have a neighbour that was meant.
pub(crate) fn reading(path: &Path, source: &Error) -> String {
    if path.is_dir() {
        return "name a file in it.".to_owned();
    }
    match source.kind() {
        ErrorKind::NotFound => match neighbour(path) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "correct the path.".to_owned(),
        },
        ErrorKind::PermissionDenied => "give yourself the right to read it.".to_owned(),
        _ => "name another file, or look at the disk it is on.".to_owned(),
    }
}

/// The remedy for a file or folder that cannot be written.
pub(crate) fn writing(path: &Path, source: &Error) -> String {
    if path.is_dir() {
        return "it is a folder: name a file in it".to_owned();
    }
    match source.kind() {
        ErrorKind::NotFound => "make its folder first, or correct the path".to_owned(),
        ErrorKind::PermissionDenied => {
            "choose a folder that you may write to, or change its rights".to_owned()
        }
        ErrorKind::AlreadyExists | ErrorKind::NotADirectory => {
            "a file stands where a folder is needed: choose another folder".to_owned()
        }
        ErrorKind::StorageFull => "make room, or choose another disk".to_owned(),
        _ => "choose another place".to_owned(),
    }
}

/// The file of the same folder whose name is nearest, as it would have to be written.
fn neighbour(path: &Path) -> Option<String> {
    let wrong = path.file_name()?.to_str()?;
    let folder = path.parent()?;
    let listed = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let names: Vec<String> = std::fs::read_dir(listed)
        .ok()?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    // Endings are alike anyway: the name before it must be.
    let stem = |name: &str| Path::new(name).file_stem()?.to_str().map(str::to_owned);
    let stems: Vec<String> = names.iter().filter_map(|name| stem(name)).collect();
    let near = nearest(&stem(wrong)?, stems.iter().map(String::as_str))?;
    let alike = names
        .iter()
        .filter(|name| stem(name).as_deref() == Some(near));
    let near = nearest(wrong, alike.map(String::as_str))?;
    Some(folder.join(near).display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_file_has_the_neighbour_that_was_meant() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/ripley");
        let near = |name: &str| {
            let path = neighbour(&folder.join(name))?;
            Some(path.rsplit('/').next().unwrap_or_default().to_owned())
        };
        assert_eq!(near("base_swep.csv").as_deref(), Some("base_sweep.csv"));
        assert_eq!(near("r17.rudf").as_deref(), Some("r17.urdf"));
        assert_eq!(near("wrst_sweep.tsv").as_deref(), Some("wrist_sweep.csv"));
        assert_eq!(near("torso_tests.csv"), None, "no neighbour was meant");
    }
}
