//! What is said of the joints of the URDF.

use super::{plural, quoted};
use crate::fact::About;

/// How many joints there are, and which limits they have.
pub(super) fn sentences(about: &About) -> String {
    let About::Joints {
        moving,
        unlimited,
        reversed,
        endless,
        no_range,
        in_degrees,
    } = about
    else {
        return String::new();
    };
    let joints = plural(*moving, "moving joint", "moving joints");
    let turn = |names: &[String]| if names.len() == 1 { "turns" } else { "turn" };
    let unusual = [unlimited, reversed, no_range, in_degrees];
    if unusual.iter().all(|names| names.is_empty()) {
        return match endless.as_slice() {
            [] => format!("The URDF has {joints}, all with limits."),
            _ => format!(
                "The URDF has {joints}; {} {} without limits.",
                quoted(endless),
                turn(endless)
            ),
        };
    }
    let mut text = format!("The URDF has {joints}.");
    if !unlimited.is_empty() {
        text += &format!(" No limits are given for {}.", quoted(unlimited));
    }
    if !reversed.is_empty() {
        text += &format!(
            " The lower limit of {} is above the upper one, so that no planned posture moves the joint: exchange `lower` and `upper` in the URDF.",
            quoted(reversed)
        );
    }
    if !no_range.is_empty() {
        text += &format!(
            " The limits of {} leave no range (`lower` is `upper`): correct them in the URDF, or no planned posture moves them.",
            quoted(no_range)
        );
    }
    if !in_degrees.is_empty() {
        text += &format!(
            " The limits of {} are more than two turns: probably degrees, where a URDF has radians. Correct them in the URDF; the ranges proposed here take them as degrees.",
            quoted(in_degrees)
        );
    }
    text
}
