//! A file that cannot be read, and what to do about it.

use std::fmt;
use std::io::{Error, ErrorKind};
use std::path::Path;

use calib_finding::nearest_word;

/// Who named a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NamedBy {
    /// The caller.
    Caller,
    /// `robot: urdf` of a profile.
    Urdf {
        /// The profile.
        profile: String,
    },
    /// `file` of a recording.
    Recording(String),
    /// `robot_log` of a recording.
    RobotLog(String),
}

/// Why a file cannot be read.
#[derive(Debug)]
pub enum WhyUnread {
    /// The operating system refused.
    Io(Error),
    /// It is a folder.
    Folder,
    /// More bytes than a profile or URDF has.
    TooLarge(u64),
}

/// A file that cannot be read.
#[derive(Debug)]
pub struct UnreadFile {
    /// The file.
    pub path: String,
    /// Who named it.
    pub named_by: NamedBy,
    /// Why it cannot be read.
    pub why: WhyUnread,
    /// The neighbor that was meant, for a file that is not there.
    pub meant: Option<String>,
}

impl UnreadFile {
    pub(super) fn new(path: &Path, named_by: NamedBy, why: WhyUnread) -> Self {
        let (why, meant) = match why {
            WhyUnread::Io(_) if path.is_dir() => (WhyUnread::Folder, None),
            WhyUnread::Io(e) if e.kind() == ErrorKind::NotFound => {
                (WhyUnread::Io(e), neighbor(path))
            }
            why => (why, None),
        };
        Self {
            path: path.display().to_string(),
            named_by,
            why,
            meant,
        }
    }

    /// What to do.
    #[must_use]
    pub fn remedy(&self) -> String {
        let first = match (&self.why, &self.meant) {
            (WhyUnread::Folder, _) => "name a file in it.".to_owned(),
            (_, Some(near)) => format!("did you mean `{near}`?"),
            (WhyUnread::Io(e), None)
                if e.kind() == ErrorKind::NotFound && self.path.contains('\\') =>
            {
                "correct the path: write `/` between folders, on Windows too.".to_owned()
            }
            (WhyUnread::Io(e), None) => match e.kind() {
                ErrorKind::NotFound => "correct the path.",
                ErrorKind::PermissionDenied => "grant read permission.",
                _ => OTHER_FILE,
            }
            .to_owned(),
            (WhyUnread::TooLarge(_), None) => OTHER_FILE.to_owned(),
        };
        match &self.named_by {
            NamedBy::Caller => first,
            NamedBy::Urdf { profile } => {
                format!("{first} `robot: urdf` in {profile} starts from the profile's folder")
            }
            NamedBy::Recording(_) => format!("{first} `file` starts from the profile's folder"),
            NamedBy::RobotLog(_) => {
                format!("{first} `robot_log: {{file: …}}` starts from the profile's folder")
            }
        }
    }
}

const OTHER_FILE: &str = "name another file, or look at the disk it is on.";

impl fmt::Display for UnreadFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.path)?;
        match &self.named_by {
            NamedBy::Caller | NamedBy::Urdf { .. } => {}
            NamedBy::Recording(name) => write!(f, "recording `{name}` ")?,
            NamedBy::RobotLog(name) => write!(f, "the robot's log of recording `{name}` ")?,
        }
        write!(f, "cannot be read: {}", self.why)
    }
}

impl fmt::Display for WhyUnread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io(e) => e.fmt(f),
            Self::Folder => f.write_str("it is a folder"),
            Self::TooLarge(bytes) => {
                write!(f, "{bytes} bytes are too many for a profile or URDF")
            }
        }
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
