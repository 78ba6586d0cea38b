//! Why there is no profile.

use calib_finding::{Unit, number, shell_path, shell_word};
use calib_pipeline::PipelineError;
use calib_pipeline::error::ExitCode;
use calib_profile::ProfileError;
use calib_urdf::ReadError;

/// What was given in place of a URDF.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Instead {
    /// A recording in a format that a reader knows by its first bytes: the reader's name.
    Recording(&'static str),
    /// A table of numbers with these columns.
    Table(Vec<String>),
    /// A table of two sets of poses, as the poses of a flange and of a tracked body.
    Pairs([String; 2]),
    /// Bytes that are no text.
    Binary,
    /// A profile of calib.
    Profile,
    /// Text that is no XML.
    Text,
}

/// What was given in place of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoRecording {
    /// A URDF or a xacro.
    Robot,
    /// A profile of calib.
    Profile,
}

impl NoRecording {
    fn what(self) -> &'static str {
        match self {
            Self::Robot => "a URDF",
            Self::Profile => "a profile of calib",
        }
    }

    fn remedy(self, file: &str) -> String {
        match self {
            Self::Robot => "a profile has one robot: give its URDF first, and then recordings; for a second robot run `calib init` again".to_owned(),
            Self::Profile => format!(
                "give the files of the tracker and of the robot; to add recordings to this profile: `calib init --edit {} RECORDING...`",
                shell_path(file)
            ),
        }
    }
}

/// Why there is no profile.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InitError {
    /// The URDF.
    #[error(transparent)]
    Urdf(#[from] ReadError),
    /// The first file is a recording, or no XML at all.
    #[error(
        "{file}: this is {}, not a URDF\n  help: {}",
        instead(found),
        instead_of_urdf(found, file)
    )]
    NotAUrdf {
        /// The file.
        file: String,
        /// What it is.
        found: Instead,
    },
    /// A robot or a profile was given as a recording.
    #[error("{file}: this is {}, not a recording\n  help: {}", found.what(), found.remedy(file))]
    NotARecording {
        /// The file.
        file: String,
        /// What it is.
        found: NoRecording,
    },
    /// A recording cannot be read, and is no table with a header either.
    #[error(transparent)]
    Recording(#[from] calib_recording::Error),
    /// A recording cannot be opened.
    #[error("{file}: {source}\n  help: correct the path, or grant read permission")]
    Unread {
        /// The file.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// A recording does not fit the robot, or its clocks cannot be brought together.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The profile that was made is not valid: a name that YAML or the robot refuses.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// The robot has nothing to calibrate.
    #[error(
        "{file}: no joint of this robot moves\n  help: give the URDF of the robot, with its revolute and prismatic joints"
    )]
    NothingMoves {
        /// The URDF.
        file: String,
    },
    /// No joint that carries the body has a range, and nothing is recorded.
    #[error(
        "{file}: the limits leave no range to {}, so that there are no postures to record\n  help: correct `lower` and `upper` of these joints in the URDF", listed(.joints)
    )]
    NoRange {
        /// The URDF.
        file: String,
        /// The joints.
        joints: Vec<String>,
    },
    /// A link that the robot does not have.
    #[error("{unknown}\n  help: {}", instead_of_link(.unknown.nearest.as_deref(), tips))]
    NoSuchLink {
        /// What was asked for, with the nearest name.
        unknown: calib_urdf::UnknownName,
        /// Ends of chains.
        tips: Vec<String>,
    },
    /// A joint's name in place of a link's.
    #[error(
        "`{joint}` is a joint; its link is `{link}`\n  help: if that link carries the markers: `--markers-on {}`",
        shell_word(link)
    )]
    JointForLink {
        /// The joint.
        joint: String,
        /// The link that it moves.
        link: String,
    },
    /// Markers on a link that no joint moves, and nothing is recorded.
    #[error(
        "no joint moves `{link}`: markers there show nothing of the robot\n  help: name the link that carries the markers; the chains end at {}", listed(.tips)
    )]
    StillLink {
        /// The link.
        link: String,
        /// Ends of chains.
        tips: Vec<String>,
    },
    /// The lengths of the URDF are not in meters.
    #[error(
        "the robot of the URDF reaches {} m, and the recordings show it {} times smaller: they fit it to {} rms, and in meters to {}\n  help: lengths of a URDF are in meters: divide its origins, the limits of prismatic joints and the meshes by {}",
        number::fixed(*.reach, 0), number::fixed(*.ratio, 0), number::plain(.rms.0, Unit::Meter), number::plain(.rms.1 / .ratio, Unit::Meter), number::fixed(*.ratio, 0)
    )]
    RobotTooLarge {
        /// Its reach as the URDF has it, m.
        reach: f64,
        /// How many times too large it is.
        ratio: f64,
        /// Residuals of the registration as it is, and with the recordings made larger by the ratio, rms, m.
        rms: (f64, f64),
    },
    /// Columns, but none is a joint of the robot, and no robot log is given.
    #[error(
        "{file}: no column is a joint of this robot (columns: {}; joints: {})\n  help: give the robot's own log as another file, or name the columns as the joints: `{}_deg`",
        listed(.columns), listed(.joints), .joints.first().map_or("joint", String::as_str)
    )]
    NoJoints {
        /// The recording.
        file: String,
        /// What it has.
        columns: Vec<String>,
        /// Joints of the robot.
        joints: Vec<String>,
    },
    /// A table of two sets of poses and no joints: a hand-eye problem.
    #[error(
        "{file}: no column is a joint of this robot, but `{first}` and `{second}` are poses\n  help: poses of a flange and of a tracked body give where both are fixed: `calib fit handeye {file} --robot {first} --measured {second}`; for a profile of the robot record its joints"
    )]
    HandEye {
        /// The recording.
        file: String,
        /// Name of a body.
        first: String,
        /// Name of the other.
        second: String,
    },
    /// Nothing of the tracker in a recording.
    #[error("{file}: nothing was tracked (columns: {})\n  help: give the tracker's file too; markers need columns `<marker>.x_mm`, `.y_mm`, `.z_mm`", listed(.columns))]
    NothingTracked {
        /// The recording.
        file: String,
        /// What it has.
        columns: Vec<String>,
    },
    /// Nothing is seen often enough to be a body.
    #[error(
        "{}: no marker and no body is seen in four poses or more\n  help: record at least ten poses that differ",
        .files.join(", ")
    )]
    NothingSeen {
        /// The recordings.
        files: Vec<String>,
    },
    /// The robot stood still.
    #[error(
        "{}: no joint moves in any row, so that no link can be found\n  help: name the link that carries the markers: `--markers-on {tip}`; for a calibration record poses that differ",
        .files.join(", ")
    )]
    NoMotion {
        /// The recordings.
        files: Vec<String>,
        /// The end of the longest chain.
        tip: String,
    },
    /// A tracker's file and a robot's log that have neither clocks nor the same number of rows.
    #[error(
        "{file} has {} rows and {log} has {}: neither do their rows belong together, nor do they have times of streams\n  help: give files with one row for every posture, in the same order, or streams with a time column in both",
        .rows.0, .rows.1
    )]
    RowsDiffer {
        /// The tracker's file.
        file: String,
        /// The robot's log.
        log: String,
        /// Rows of both.
        rows: (usize, usize),
    },
    /// Two files that cannot be brought together because the times of one are not read.
    #[error(
        "{file}: its times are not read ({}), and its rows are not those of the other file\n  help: write them as one column `t_s` in seconds, or as dates with the year first (`2024-05-01T12:00:00.123Z`)",
        listed(.columns)
    )]
    TimesNotRead {
        /// The file.
        file: String,
        /// The columns that seem to hold times.
        columns: Vec<String>,
    },
    /// The text of an edited profile has no place for what is to be added: its section is an alias, or written in an unusual way.
    #[error(
        "{file}: the text of `{section}` cannot be changed without changing something else (an alias, an anchor that others use, or an unusual style), so that nothing was written\n  help: write `{section}` out, then add there:\n{}", .lines.join("\n")
    )]
    NotInserted {
        /// The profile.
        file: String,
        /// Where the lines belong.
        section: String,
        /// The lines.
        lines: Vec<String>,
    },
    /// A file alone is no recording, and the recordings that were given with it stand in the profile and stay as they are.
    #[error(
        "{file}: this file alone is no recording; what was given with it is in the profile already and stays as it is: {}\n  help: complete the entry in the profile by hand (`robot_log: {{file: …}}`), or delete it and repeat the command",
        listed(.recordings)
    )]
    BesideListed {
        /// The file.
        file: String,
        /// The recordings of the profile.
        recordings: Vec<String>,
    },
    /// Nothing was given to add to a profile.
    #[error(
        "{file}: no recording was given to add to it\n  help: give recordings: `calib init --edit {} RECORDING...`",
        shell_path(file)
    )]
    NothingToAdd {
        /// The profile.
        file: String,
    },
    /// A URDF was given beside a profile that names one.
    #[error(
        "{file}: a URDF was given, and the profile has its own (`robot.urdf: {of_profile}`)\n  help: leave it out, or correct `robot.urdf` in the profile first"
    )]
    SecondUrdf {
        /// The URDF that was given.
        file: String,
        /// That of the profile.
        of_profile: String,
    },
    /// The profile was changed by somebody else while it was edited.
    #[error(
        "{file}: the file changed while recordings were read; nothing was written\n  help: repeat the command"
    )]
    Changed {
        /// The profile.
        file: String,
    },
    /// Two recordings are the same file.
    #[error("{file} is given twice\n  help: give every recording once")]
    Twice {
        /// The file.
        file: String,
    },
}

/// At most eight names.
fn listed(names: &[String]) -> String {
    const MOST: usize = 8;
    if names.is_empty() {
        return "none".to_owned();
    }
    let mut shown: Vec<String> = names.iter().take(MOST).map(|n| format!("`{n}`")).collect();
    if names.len() > MOST {
        shown.push(format!("and {} more", names.len() - MOST));
    }
    shown.join(", ")
}

/// What to write for a link that the robot does not have.
fn instead_of_link(nearest: Option<&str>, tips: &[String]) -> String {
    let ends = format!("the chains end at {}", listed(tips));
    match nearest {
        Some(nearest) => format!(
            "write `--markers-on {}`, or name another link that carries the markers; {ends}",
            shell_word(nearest)
        ),
        None => format!("name the link that carries the markers; {ends}"),
    }
}

/// What was given in place of a URDF.
fn instead(found: &Instead) -> String {
    match found {
        Instead::Recording(format) => format!("a recording ({format})"),
        Instead::Table(columns) => {
            format!("a recording (a table with the columns {})", listed(columns))
        }
        Instead::Pairs([first, second]) => {
            format!("a recording (a table of poses of `{first}` and `{second}`, without joints)")
        }
        Instead::Profile => "a profile of calib".to_owned(),
        Instead::Binary => "a binary file".to_owned(),
        Instead::Text => "text that is not XML".to_owned(),
    }
}

fn instead_of_urdf(found: &Instead, file: &str) -> String {
    let file = shell_path(file);
    let order = format!("`calib init robot.urdf {file}`");
    match found {
        Instead::Recording(_) | Instead::Table(_) => {
            format!("give the URDF of the robot first, then its recordings: {order}")
        }
        Instead::Pairs([first, second]) => format!(
            "hand-eye calibration needs no URDF: `calib fit handeye {file} --robot {} --measured {}`; for a profile give the URDF of the robot first, and a recording of its joints",
            shell_word(first),
            shell_word(second)
        ),
        Instead::Profile => format!(
            "it needs no other profile: `calib check {file}`, or add recordings to it: `calib init --edit {file} RECORDING...`; for a new profile give the URDF of the robot"
        ),
        Instead::Binary | Instead::Text => {
            "give the URDF of the robot: an XML file that begins with `<robot name=…>`".to_owned()
        }
    }
}

impl InitError {
    /// The file that it is about; `None`: the error inside knows.
    #[must_use]
    pub fn file(&self) -> Option<&str> {
        match self {
            Self::NotAUrdf { file, .. }
            | Self::NotARecording { file, .. }
            | Self::NothingMoves { file }
            | Self::NoRange { file, .. }
            | Self::Unread { file, .. }
            | Self::NoJoints { file, .. }
            | Self::HandEye { file, .. }
            | Self::NothingTracked { file, .. }
            | Self::RowsDiffer { file, .. }
            | Self::NotInserted { file, .. }
            | Self::NothingToAdd { file }
            | Self::BesideListed { file, .. }
            | Self::SecondUrdf { file, .. }
            | Self::Changed { file }
            | Self::Twice { file } => Some(file),
            Self::NoMotion { files, .. } | Self::NothingSeen { files } => {
                files.first().map(String::as_str)
            }
            _ => None,
        }
    }

    /// The exit code of the program.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Pipeline(error) => error.exit_code(),
            Self::Recording(_)
            | Self::NotARecording { .. }
            | Self::NoJoints { .. }
            | Self::HandEye { .. }
            | Self::NothingTracked { .. }
            | Self::RowsDiffer { .. }
            | Self::BesideListed { .. }
            | Self::NothingSeen { .. }
            | Self::NoMotion { .. } => ExitCode::Data,
            Self::Changed { .. } => ExitCode::NotWritten,
            _ => ExitCode::Usage,
        }
    }
}
