//! What is said of mistakes in the recordings, corrected or not.

use calib_finding::{Unit, number};

use super::{length_unit, mm, plural};
use crate::fact::{About, Residuals, Reversed};
use crate::mistake::Mistake;
use crate::yaml;

/// A mistake that was found, with what was done about it.
pub(super) fn sentence(about: &About) -> String {
    match about {
        About::Corrected {
            mistake,
            residuals,
            equivalent,
        } => corrected(mistake, residuals, equivalent),
        About::NotCorrected {
            mistake,
            residuals,
            equivalent,
        } => format!(
            "{} It explains the recordings ({}). The profile as written does not correct it: correct the table, or do what `calib check` says.{}",
            found(mistake),
            improvement(residuals),
            not_distinguished(equivalent)
        ),
        About::SignOrMirror {
            joints,
            mistakes,
            residuals,
            equivalent,
        } => sign_or_mirror(
            joints,
            mistakes,
            &improvement(residuals),
            &not_distinguished(equivalent),
        ),
        _ => String::new(),
    }
}

/// What is wrong, as a sentence.
fn found(mistake: &Mistake) -> String {
    match mistake {
        Mistake::Sign { joint } => format!("Joint `{joint}` counts against the axis of the URDF."),
        Mistake::Exchange { first, second } => {
            format!("The columns of `{first}` and `{second}` are exchanged.")
        }
        Mistake::Order { columns } => {
            let of = columns
                .iter()
                .map(|(joint, column)| format!("`{joint}` in `{column}`"));
            let of: Vec<String> = of.collect();
            format!(
                "Joint columns are in another order: the values of {}.",
                of.join(", ")
            )
        }
        Mistake::Unit {
            joint: Some(joint),
            unit,
        } => format!("The column of `{joint}` is in {unit}."),
        Mistake::Unit { joint: None, unit } => format!("The joint columns are in {unit}."),
        Mistake::TrackerUnit { unit } => {
            format!("The tracker's lengths are in {}.", length_unit(unit))
        }
        Mistake::Offset {
            joint,
            value,
            turns,
        } => {
            let unit = if *turns { Unit::Radian } else { Unit::Meter };
            let value = number::plain(*value, unit);
            format!("The zero of `{joint}` is off: {value} must be added.")
        }
        Mistake::Gain { joint, factor } => {
            format!("Joint `{joint}` moves {factor:.3} times what its column says.")
        }
        Mistake::Rows { rows } => format!(
            "Joint values and tracker rows are paired {} off.",
            plural(rows.unsigned_abs().into(), "row", "rows")
        ),
        Mistake::Mirrored => "The tracker's frame is left-handed.".to_owned(),
        Mistake::TrackerMoved => {
            "The tracker moved, or its axes changed, between recordings.".to_owned()
        }
        Mistake::Remounted { body } => {
            format!("`{body}` moved on its link between recordings.")
        }
        Mistake::Quaternions { first: true } => {
            "The quaternions are written scalar first: w, x, y, z.".to_owned()
        }
        Mistake::Quaternions { first: false } => {
            "The quaternions are written scalar last: x, y, z, w.".to_owned()
        }
        Mistake::Inverted => {
            "The poses are those of the tracker in the body, not of the body in the tracker's frame."
                .to_owned()
        }
        Mistake::Poses => "The convention of the tracked poses was misread.".to_owned(),
        Mistake::MissingColumn { joint } => {
            format!("Joint `{joint}` moved, and no column has its readings.")
        }
        Mistake::StoodAt {
            joint,
            value,
            turns,
        } => {
            let unit = if *turns { Unit::Radian } else { Unit::Meter };
            format!(
                "Joint `{joint}` stood at {}; no column says so.",
                number::plain(*value, unit)
            )
        }
        Mistake::Link { body, link } => format!("`{body}` is on `{link}`."),
        Mistake::Bodies { first, second } => {
            format!("`{first}` and `{second}` are exchanged.")
        }
        Mistake::Other => "A mistake in the recordings stands out.".to_owned(),
    }
}

fn improvement(residuals: &Residuals) -> String {
    let next = residuals.next.map_or_else(String::new, |next| {
        format!(", the next best explanation leaves {}", mm(next))
    });
    format!(
        "{} rms without, {} with it{next}",
        mm(residuals.none),
        mm(residuals.best)
    )
}

/// The corrections that explain the recordings as well.
fn not_distinguished(equivalent: &[Vec<Mistake>]) -> String {
    const MOST: usize = 3;
    let mut others: Vec<String> = equivalent
        .iter()
        .take(MOST)
        .map(|all| all.iter().map(found).collect::<Vec<_>>().join(" "))
        .collect();
    if equivalent.len() > MOST {
        others.push(format!("{} more.", equivalent.len() - MOST));
    }
    match others.is_empty() {
        true => String::new(),
        false => format!(
            " These recordings do not distinguish it from: {}",
            others.join(" Or: ")
        ),
    }
}

fn corrected(mistake: &Mistake, residuals: &Residuals, equivalent: &[Vec<Mistake>]) -> String {
    let others = not_distinguished(equivalent);
    let doubt = residuals.over.map_or_else(String::new, |limit| {
        format!(
            " This is not certain: errors of 1° and 10 mm explain {} only, so that another mistake may be behind it.",
            mm(limit)
        )
    });
    format!(
        "{} Corrected here ({}).{doubt}{others}",
        found(mistake),
        improvement(residuals)
    )
}

/// Joints that count the other way, or a left-handed tracker: what decides it, and what to do then.
fn sign_or_mirror(
    joints: &[Reversed],
    mistakes: &[Mistake],
    improvement: &str,
    others: &str,
) -> String {
    let all: Vec<String> = mistakes.iter().map(found).collect();
    let names: Vec<&str> = joints.iter().map(|r| r.joint.as_str()).collect();
    let of_kind = |key: &str, turns: bool| {
        let own = joints.iter().filter(|r| r.turns == turns);
        let pairs = own.map(|r| format!("{}: {}", yaml::text(&r.joint), yaml::text(&r.column)));
        let pairs: Vec<String> = pairs.collect();
        (!pairs.is_empty()).then(|| format!("{key}: {{{}}}, ", pairs.join(", ")))
    };
    let maps = [of_kind("joints", true), of_kind("prismatic", false)];
    let map = format!(
        "columns: {{{}reversed: [{}]}}",
        maps.into_iter().flatten().collect::<String>(),
        names.join(", ")
    );
    format!(
        "{} It explains the recordings ({improvement}).{others} Nothing is corrected, because the real robot moves differently in these cases. Move `{}` by a positive amount: if it moves against its axis in the URDF, write `{map}` in each recording; if it moves along it, another of these is the mistake. Where no joint is reversed, correct the axes of the tracker's export.",
        all.join(" "),
        names.first().copied().unwrap_or_default()
    )
}
