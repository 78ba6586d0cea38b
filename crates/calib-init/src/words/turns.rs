//! What is said of orientations.

use calib_recording::AngleUnit;

use super::{angle_unit, mm, quoted};
use crate::fact::{About, Notation, TurnsHow};

/// How the columns of an orientation are read, and why so.
pub(super) fn sentence(about: &About) -> String {
    let About::Turns {
        columns,
        notation,
        unit,
        how,
    } = about
    else {
        return String::new();
    };
    let what = format!("{} are {}", quoted(columns), what(*notation, *unit));
    match how {
        TurnsHow::Named => format!("{what}."),
        TurnsHow::Motion { rms, next } => format!(
            "{what}: read so, the body follows the robot to {} rms, with the next best notation to {}.",
            mm(*rms),
            mm(*next)
        ),
        TurnsHow::AsOthers => format!("{what}, as those of the other bodies are."),
        TurnsHow::Assumed => format!(
            "{what}, as is usual for such names: the motion does not show which notation it is. Look it up in the manual of the tracker, and correct the column map if it is another."
        ),
    }
}

fn what(notation: Notation, unit: Option<AngleUnit>) -> String {
    let unit = unit.map_or_else(String::new, |unit| format!(" in {}", angle_unit(unit)));
    match notation {
        Notation::Quaternion { scalar_first: true } => "a quaternion, scalar first".to_owned(),
        Notation::Quaternion { .. } => "a quaternion, scalar last".to_owned(),
        Notation::Matrix => "a rotation matrix, row by row".to_owned(),
        Notation::AxisAngle => format!("an axis of rotation and the angle about it{unit}"),
        Notation::RotationVector => format!("a rotation vector{unit}"),
        Notation::Euler(axes) => {
            let [a, b, c] = axes.axes().map(|axis| ["x", "y", "z"][axis]);
            format!("Euler angles{unit} about {a}, the new {b} and the new {c}")
        }
    }
}
