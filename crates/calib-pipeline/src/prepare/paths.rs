//! What to do about a file that cannot be read.

use std::io::{Error, ErrorKind};
use std::path::Path;

use calib_finding::nearest_word;

/// The remedy for a file that cannot be read; a missing one may have a neighbor that was meant.
pub(crate) fn reading(path: &Path, source: &Error) -> String {
    if path.is_dir() {
        return "name a file in it.".to_owned();
    }
    match source.kind() {
        ErrorKind::NotFound => match neighbor(path) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "correct the path.".to_owned(),
        },
        ErrorKind::PermissionDenied => "grant read permission.".to_owned(),
        _ => "name another file, or look at the disk it is on.".to_owned(),
    }
}

/// The file of the same folder whose name is nearest, as it would have to be written.
fn neighbor(path: &Path) -> Option<String> {
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
    let near = nearest_word(&stem(wrong)?, stems.iter().map(String::as_str))?;
    let alike = names
        .iter()
        .filter(|name| stem(name).as_deref() == Some(near));
    let near = nearest_word(wrong, alike.map(String::as_str))?;
    Some(folder.join(near).display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_file_has_the_neighbor_that_was_meant() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/ripley");
        let near = |name: &str| {
            let path = neighbor(&folder.join(name))?;
            Some(path.rsplit('/').next().unwrap_or_default().to_owned())
        };
        assert_eq!(near("base_swep.csv").as_deref(), Some("base_sweep.csv"));
        assert_eq!(near("r17.rudf").as_deref(), Some("r17.urdf"));
        assert_eq!(near("wrst_sweep.tsv").as_deref(), Some("wrist_sweep.csv"));
        assert_eq!(near("torso_tests.csv"), None, "no neighbor was meant");
    }
}
