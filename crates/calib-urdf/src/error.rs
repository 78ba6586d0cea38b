//! What can be wrong with a URDF, where, and what to do about it.

use std::fmt;
use thiserror::Error;

/// A place in a text file, counted from 1; the column counts characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub struct Place {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
}

impl Place {
    /// The place of a byte offset of `text`; a byte-order mark takes no column.
    #[must_use]
    pub fn of_byte(text: &str, offset: usize) -> Self {
        let before = text.get(..offset).unwrap_or(text);
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        Self {
            line: before.matches('\n').count() + 1,
            column: before[line_start..]
                .trim_start_matches('\u{feff}')
                .chars()
                .count()
                + 1,
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.line, self.column)
    }
}

/// What is wrong with a file that should be a URDF.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each variant's text is its documentation")]
pub enum Problem {
    #[error("cannot be read: {reason}")]
    Unreadable { reason: String },
    #[error("cannot be read: it is a folder, not a file")]
    Folder,
    #[error("the file is empty")]
    Empty,
    #[error("the file has {bytes} bytes, more than the {limit} that a URDF may have")]
    TooLarge { bytes: u64, limit: u64 },
    #[error("byte {offset} (0x{byte:02x}) is not UTF-8")]
    NotUtf8 { offset: usize, byte: u8 },
    #[error("the text is UTF-16, not UTF-8")]
    Utf16,
    #[error("not well-formed XML: {reason}")]
    Xml { reason: String },
    #[error("elements are nested in more than {limit} levels")]
    TooDeep { limit: usize },
    #[error("the file has a document type definition (<!DOCTYPE>), which is not read")]
    Dtd,
    #[error("the root element is <{found}>, expected <robot>")]
    NotARobot { found: String },
    #[error("this is a xacro file: {evidence}")]
    Xacro { evidence: String },
    #[error("the robot has no <link>")]
    NoLinks,
    #[error("<{element}> has no attribute `{attribute}`{hint}")]
    MissingAttribute {
        element: String,
        attribute: &'static str,
        hint: Hint,
    },
    #[error("{owner} has no <{element}>")]
    MissingElement {
        owner: String,
        element: &'static str,
    },
    #[error("{owner} has two <{element}>, the first in line {first_line}")]
    RepeatedElement {
        owner: String,
        element: &'static str,
        first_line: usize,
    },
    #[error("{kind} `{name}` is defined twice, first in line {first_line}")]
    DuplicateName {
        kind: &'static str,
        name: String,
        first_line: usize,
    },
    #[error(
        "joint `{joint}` has the type `{found}`, expected one of revolute, continuous, prismatic, fixed{hint}"
    )]
    UnknownJointType {
        joint: String,
        found: String,
        hint: Hint,
    },
    #[error("joint `{joint}` is of type `{found}`, which is not supported")]
    UnsupportedJointType { joint: String, found: String },
    #[error("joint `{joint}` names the {role} link `{link}`, which does not exist{hint}")]
    UnknownLink {
        joint: String,
        role: &'static str,
        link: String,
        hint: Hint,
    },
    #[error(
        "link `{link}` is the child of two joints, `{first}` (line {first_line}) and `{second}`"
    )]
    TwoParents {
        link: String,
        first: String,
        first_line: usize,
        second: String,
    },
    #[error("the links form a circle: {}", circle(path))]
    Cycle { path: Vec<String> },
    #[error("the robot has {} root links ({}), expected one", roots.len(), quoted(roots))]
    SeveralRoots { roots: Vec<String> },
    #[error("`{attribute}` of {owner} is \"{found}\", expected {expected}: {reason}")]
    BadNumber {
        owner: String,
        attribute: String,
        found: String,
        expected: &'static str,
        reason: String,
    },
    #[error("<{element}> of {owner} has the attribute `{found}`, expected {expected}{hint}")]
    UnknownAttribute {
        owner: String,
        element: &'static str,
        found: String,
        expected: &'static str,
        hint: Hint,
    },
    #[error("the axis of joint `{joint}` is zero, so it has no direction")]
    ZeroAxis { joint: String },
    #[error("the quaternion of {owner} is zero, so it is not a rotation")]
    ZeroQuaternion { owner: String },
    #[error("the origin of {owner} gives its rotation twice, as `rpy` and as `quat_xyzw`")]
    TwoRotations { owner: String },
    #[error("the lower limit {lower} of joint `{joint}` is above its upper limit {upper}")]
    LimitsReversed {
        joint: String,
        lower: String,
        upper: String,
    },
    #[error("joint `{joint}` mimics the joint `{source_joint}`, which does not exist{hint}")]
    UnknownMimic {
        joint: String,
        source_joint: String,
        hint: Hint,
    },
    #[error("joint `{joint}` mimics the fixed joint `{source_joint}`, which never moves")]
    MimicOfFixed { joint: String, source_joint: String },
    #[error("the joints mimic each other in a circle: {}", circle(path))]
    MimicCycle { path: Vec<String> },
    #[error("the mass of link `{link}` is negative ({found})")]
    NegativeMass { link: String, found: String },
}

/// "; did you mean `x`?", or nothing.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Hint(pub Option<String>);

impl fmt::Display for Hint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Some(name) => write!(f, "; did you mean `{name}`?"),
            None => Ok(()),
        }
    }
}

fn quoted(names: &[String]) -> String {
    /// More names than this do not help a reader.
    const SHOWN: usize = 6;
    let mut text = names
        .iter()
        .take(SHOWN)
        .map(|name| format!("`{name}`"))
        .collect::<Vec<_>>()
        .join(", ");
    if names.len() > SHOWN {
        text.push_str(&format!(" and {} more", names.len() - SHOWN));
    }
    text
}

fn circle(path: &[String]) -> String {
    path.iter()
        .chain(path.first())
        .map(String::as_str)
        .collect::<Vec<_>>()
        .join(" → ")
}

impl Problem {
    /// What the person can do about it, as one sentence; empty where the finding says it already.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Unreadable { .. } => "check the path and that you may read the file",
            Self::Folder => "name a file in it",
            Self::Empty => "export the URDF again; the copy or download was probably cut off",
            Self::TooLarge { .. } => {
                "give the URDF itself; meshes and recordings are files of their own"
            }
            Self::NotUtf8 { .. } => "save the file as UTF-8 (for example: iconv -f latin1 -t utf8)",
            Self::Utf16 => "save the file as UTF-8 (for example: iconv -f utf16 -t utf8)",
            Self::Xml { .. } => {
                "correct the XML here or just before: an unclosed tag, quote or comment is detected only later"
            }
            Self::TooDeep { .. } => "this is not a URDF; export the nominal URDF again",
            Self::Dtd => "delete it, and write the text of each entity where it is used",
            Self::NotARobot { found } if found == "sdf" => "convert the SDF to URDF first",
            Self::NotARobot { found } if found == "mujoco" => "convert the MJCF to URDF first",
            Self::NotARobot { .. } => "give the URDF file of the robot",
            Self::Xacro { .. } => "expand it first: xacro robot.urdf.xacro > robot.urdf",
            Self::NoLinks => "a robot needs at least one <link name=\"…\"/> directly under <robot>",
            Self::MissingAttribute { .. }
            | Self::UnknownAttribute { .. }
            | Self::BadNumber { .. } => "",
            Self::MissingElement { .. } => {
                "a joint needs <parent link=\"…\"/> and <child link=\"…\"/>"
            }
            Self::RepeatedElement { .. } => "delete one; readers disagree on which one counts",
            Self::DuplicateName { .. } => "rename one; names have to be unique",
            Self::UnknownJointType { .. } => "",
            Self::UnsupportedJointType { found, .. } if found == "floating" => {
                "delete this joint: the tracker measures where the base is, so the model starts at the base"
            }
            Self::UnsupportedJointType { .. } => {
                "replace it by two or three revolute or prismatic joints with massless links between"
            }
            Self::UnknownLink { .. } => "define the link, or correct the name",
            Self::TwoParents { .. } => {
                "a URDF is a tree: leave one of the joints out and describe the closed loop elsewhere"
            }
            Self::Cycle { .. } => {
                "the parent of one of these joints is wrong: a tree grows away from one root link"
            }
            Self::SeveralRoots { .. } => {
                "join the parts by a fixed joint, or delete the part that does not belong"
            }
            Self::ZeroAxis { .. } => {
                "write a direction such as xyz=\"0 0 1\", or make the joint fixed"
            }
            Self::ZeroQuaternion { .. } => "no rotation is quat_xyzw=\"0 0 0 1\"",
            Self::TwoRotations { .. } => "keep one of them",
            Self::LimitsReversed { .. } => "exchange the two numbers",
            Self::UnknownMimic { .. } => "correct the name, or delete <mimic>",
            Self::MimicOfFixed { .. } => "mimic a joint that moves, or make this joint fixed",
            Self::MimicCycle { .. } => {
                "one joint of the circle has to move on its own: delete its <mimic>"
            }
            Self::NegativeMass { .. } => "masses are in kg and not negative",
        }
    }
}

/// A [`Problem`] with its place and the line that shows it.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct ReadProblem {
    /// Where it was found; `None` when the file as a whole is wrong.
    pub place: Option<Place>,
    /// The text of that line, cut to what fits a screen around `caret`.
    pub line_text: String,
    /// Characters of `line_text` before the finding.
    pub caret: usize,
    /// What is wrong.
    pub problem: Problem,
}

impl ReadProblem {
    pub(crate) fn at(text: &str, offset: usize, problem: Problem) -> Self {
        /// A line is shown up to this many characters before and after the finding.
        const AROUND: usize = 60;
        let place = Place::of_byte(text, offset);
        let line = text
            .lines()
            .nth(place.line - 1)
            .unwrap_or("")
            .trim_start_matches('\u{feff}');
        let before = place.column - 1;
        let indent = line
            .chars()
            .take_while(|c| c.is_whitespace())
            .count()
            .min(before);
        let skipped = indent.max(before.saturating_sub(AROUND));
        let shown: String = line
            .chars()
            .skip(skipped)
            .take(before - skipped + AROUND)
            .collect();
        Self {
            place: Some(place),
            line_text: shown.replace('\t', " ").trim_end().to_owned(),
            caret: before - skipped,
            problem,
        }
    }

    pub(crate) fn of_file(problem: Problem) -> Self {
        Self {
            place: None,
            line_text: String::new(),
            caret: 0,
            problem,
        }
    }
}

/// Everything that is wrong with one file; never empty.
///
/// `Display` gives, for each finding, `file:line:column: finding`, the line with a caret under the place, and what to do.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct ReadError {
    /// The name of the file as the caller gave it.
    pub file: String,
    /// The findings, in the order of the file.
    pub problems: Vec<ReadProblem>,
}

impl ReadError {
    /// These findings, of which there is at least one, in a file.
    #[must_use]
    pub fn new(file: &str, problems: Vec<ReadProblem>) -> Self {
        Self {
            file: file.to_owned(),
            problems,
        }
    }

    pub(crate) fn one(file: &str, problem: ReadProblem) -> Self {
        Self {
            file: file.to_owned(),
            problems: vec![problem],
        }
    }
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// A file in the wrong encoding or format would fill the screen otherwise.
        const SHOWN: usize = 10;
        for (i, found) in self.problems.iter().take(SHOWN).enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            match found.place {
                Some(place) => {
                    writeln!(f, "{}:{place}: {}", self.file, found.problem)?;
                    let number = place.line.to_string();
                    writeln!(f, "{number} | {}", found.line_text)?;
                    write!(
                        f,
                        "{} | {}^",
                        " ".repeat(number.len()),
                        " ".repeat(found.caret)
                    )?;
                }
                None => write!(f, "{}: {}", self.file, found.problem)?,
            }
            let remedy = found.problem.remedy();
            if !remedy.is_empty() {
                write!(f, "\n  help: {remedy}")?;
            }
        }
        if self.problems.len() > SHOWN {
            write!(
                f,
                "
… and more findings"
            )?;
        }
        Ok(())
    }
}

impl std::error::Error for ReadError {}
