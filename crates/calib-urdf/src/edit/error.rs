//! Why a change is refused.

use crate::error::{Hint, Place, ReadError};
use crate::model::UnknownName;
use thiserror::Error;

/// Why a text is not patched. Nothing is changed then.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each variant's text is its documentation")]
pub enum EditError {
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error(
        "{file}: {source}\n  help: give the URDF of the robot that was calibrated; the names in this one differ"
    )]
    UnknownName { file: String, source: UnknownName },
    #[error(
        "the new {what} of joint `{joint}` is not a finite number: the solution must not be written\n  help: run the calibration again and check its verdict"
    )]
    NotFinite { joint: String, what: &'static str },
    #[error("joint `{joint}` is given two new values for its {what}\n  help: give one")]
    EditedTwice { joint: String, what: &'static str },
    #[error(
        "{file}:{place}: joint `{joint}` is fixed, so it has no axis to set\n  help: give the URDF in which this joint moves"
    )]
    NoAxis {
        file: String,
        place: Place,
        joint: String,
    },
    #[error(
        "{file}:{place}: joint `{joint}` has no <limit>\n  help: write <limit lower=\"…\" upper=\"…\" effort=\"…\" velocity=\"…\"/>; effort and velocity cannot be guessed"
    )]
    NoLimit {
        file: String,
        place: Place,
        joint: String,
    },
    #[error(
        "{file}:{place}: joint `{joint}` is {kind}, so it has no position limits\n  help: leave its limits as they are"
    )]
    NoPositionLimits {
        file: String,
        place: Place,
        joint: String,
        kind: String,
    },
    #[error(
        "the new lower limit {lower} of joint `{joint}` is above the new upper limit {upper}\n  help: swap them"
    )]
    LimitsReversed {
        joint: String,
        lower: String,
        upper: String,
    },
    #[error(
        "{file}: the {kind} `{name}` exists already and is not the frame to be added\n  help: choose another name for the frame, for example with a prefix"
    )]
    NameTaken {
        file: String,
        kind: &'static str,
        name: String,
    },
    #[error(
        "the frame `{name}` is to be added twice\n  help: name each body once under `outputs: {{add_bodies: …}}`"
    )]
    FrameTwice { name: String },
    #[error("a {kind} cannot be named `{name}`: {reason}\n  help: rename the body in the profile")]
    BadName {
        kind: &'static str,
        name: String,
        reason: &'static str,
    },
    #[error(
        "{file}:{place}: `{attribute}` of joint `{joint}` is \"{found}\", which xacro computes, so there is not a finite number to replace\n  help: patch the expanded URDF, or the property that the expression uses"
    )]
    XacroExpression {
        file: String,
        place: Place,
        joint: String,
        attribute: String,
        found: String,
    },
    #[error(
        "{file}:{place}: the call that gives joint `{joint}` leaves `{parameter}` at its default, which other calls share\n  help: write `{parameter}=\"…\"` with its present value into this call, and apply again"
    )]
    XacroNotGiven {
        file: String,
        place: Place,
        joint: String,
        parameter: String,
    },
    #[error(
        "{file}:{place}: the origin of joint `{joint}` comes from the block `{block}`, and the text does not show one `<origin>` of this joint alone\n  help: give the call of the macro an `<origin>` of its own for this block, or patch the expanded URDF"
    )]
    XacroBlock {
        file: String,
        place: Place,
        joint: String,
        block: String,
    },
    #[error(
        "{file}:{place}: the origin of joint `{joint}` is given by `<xacro:{element}>`: the text does not show which one counts\n  help: write one `<origin>` into the joint itself, or patch the expanded URDF"
    )]
    XacroChosen {
        file: String,
        place: Place,
        joint: String,
        element: String,
    },
    #[error(
        "{file}:{place}: the origin or axis of joint `{joint}` takes {value}, which is {}: a new value would change more than this joint\n  help: give this origin a {} of its own, or patch the expanded URDF",
        value_uses(lines, included),
        value.noun()
    )]
    XacroShared {
        file: String,
        place: Place,
        joint: String,
        value: Box<SharedValue>,
        lines: Box<[usize]>,
        included: Box<[String]>,
    },
    #[error(
        "{file}:{place}: the origin or axis of joint `{joint}` takes its numbers from `{argument}`, which was not found\n  help: name that YAML file yourself (calib apply … --yaml FILE)"
    )]
    XacroYamlNotFound {
        file: String,
        place: Place,
        joint: String,
        argument: String,
    },
    #[error(
        "{file}:{place}: not well-formed YAML: {reason}\n  help: correct the YAML there, or give another file"
    )]
    Yaml {
        file: String,
        place: Place,
        reason: String,
    },
    #[error(
        "{file}:{place}: `{keys}`, which holds the origin of joint `{joint}`, cannot be replaced: {fault}\n  help: write one plain number there, `x: 0.1`"
    )]
    YamlValue {
        file: String,
        place: Place,
        joint: String,
        keys: String,
        fault: &'static str,
    },
    #[error(
        "{file}: there is no origin of joint `{joint}`: no key {keys} has x, y, z, roll, pitch, yaw{hint}\n  help: give the file that holds this joint, or the URDF or xacro"
    )]
    YamlNoJoint {
        file: String,
        joint: String,
        keys: String,
        hint: Hint,
    },
    #[error(
        "{file}: the origin of joint `{joint}` stands in several places (lines {}), of which one cannot be chosen\n  help: give the file that holds this robot alone",
        comma_list(lines)
    )]
    YamlSeveral {
        file: String,
        joint: String,
        lines: Vec<usize>,
    },
    #[error(
        "{file}: a kinematics YAML holds origins of joints, and nothing else can be set in it\n  help: apply to the URDF or xacro"
    )]
    YamlOnlyOrigins { file: String },
    #[error(
        "{file}:{place}: joint `{joint}` comes from `{template}`, whose name xacro computes\n  help: patch the expanded URDF"
    )]
    XacroTemplate {
        file: String,
        place: Place,
        joint: String,
        template: String,
    },
    #[error(
        "{file}:{place}: this file has no joint `{joint}`: `{template}` is `{named}` here\n  help: name the file whose xacro gives `{joint}`, or apply the result to the expanded URDF"
    )]
    XacroNamed {
        file: String,
        place: Place,
        joint: String,
        template: String,
        named: String,
    },
    #[error(
        "{file}:{place}: joint `{joint}` stands in the macro `{macro_name}`, which is used {}: one text, several joints\n  help: patch the expanded URDF, or give the macro a parameter for this origin",
        uses(lines)
    )]
    XacroMacro {
        file: String,
        place: Place,
        joint: String,
        macro_name: String,
        lines: Vec<usize>,
    },
    #[error(
        "{file}: joint `{joint}` is written in several places (lines {}), of which xacro chooses\n  help: patch the expanded URDF",
        comma_list(lines)
    )]
    XacroAmbiguous {
        file: String,
        joint: String,
        lines: Vec<usize>,
    },
    #[error(
        "{file}: the frame of link `{link}` is {translation_m:.1e} m and {rotation_rad:.1e} rad away from what was asked for after re-reading ({reader})"
    )]
    NotReproduced {
        file: String,
        link: String,
        translation_m: Rounded,
        rotation_rad: Rounded,
        reader: &'static str,
    },
    #[error("{file}: after the patch, {what}")]
    StructureChanged { file: String, what: String },
}

/// A value that several expressions of a xacro read.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum SharedValue {
    /// The value of a `<xacro:property>`.
    Property {
        /// The property.
        name: String,
    },
    /// A parameter that its macro uses more than once.
    Parameter {
        /// The parameter.
        name: String,
    },
    /// A value of a YAML file that the xacro loads.
    Yaml {
        /// Its keys, separated by points.
        keys: String,
        /// The file, as named in messages.
        file: String,
    },
}

impl SharedValue {
    fn noun(&self) -> &'static str {
        match self {
            Self::Property { .. } => "property",
            Self::Parameter { .. } => "parameter",
            Self::Yaml { .. } => "value",
        }
    }
}

impl std::fmt::Display for SharedValue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Property { name } => write!(f, "the property `{name}`"),
            Self::Parameter { name } => write!(f, "the parameter `{name}` of the macro"),
            Self::Yaml { keys, file } => write!(f, "`{keys}` of {file}"),
        }
    }
}

/// A number in a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rounded(pub f64);

impl Eq for Rounded {}

impl std::fmt::LowerExp for Rounded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::LowerExp::fmt(&self.0, f)
    }
}

fn comma_list(lines: &[usize]) -> String {
    lines
        .iter()
        .map(ToString::to_string)
        .collect::<Vec<_>>()
        .join(", ")
}

fn value_uses(lines: &[usize], included: &[String]) -> String {
    match (lines, included) {
        ([] | [_], []) => "perhaps used by the included files too".to_owned(),
        (_, []) => format!("used {}", uses(lines)),
        _ => format!("used by {} too", included.join(", ")),
    }
}

fn uses(lines: &[usize]) -> String {
    let mut distinct = lines.to_vec();
    distinct.dedup();
    match distinct.as_slice() {
        [] => "nowhere in this file, so perhaps more than once elsewhere".to_owned(),
        [line] => format!("{} times (line {line})", lines.len()),
        _ => format!("{} times (lines {})", lines.len(), comma_list(&distinct)),
    }
}
