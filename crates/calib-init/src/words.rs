//! Every sentence of a proposal: in the profile's comments and on the terminal.

mod joints;
mod known;
mod mistakes;
mod turns;

pub use known::{next_of_absent, to_check, wrote};

use calib_finding::{Unit, number, shell_path};
use calib_recording::{AngleUnit, TimeUnit};

use crate::fact::{About, AngleHow, LengthHow, Rival};
use crate::labels::LOOSE;
use crate::yaml;

/// The first lines of a profile.
pub const HEAD: &str = "Made by `calib init`. Comments state the evidence. Lines with CHECK are guesses: confirm or correct each one, then delete the comment.";

/// Above what is free.
pub const FREE: &str = "What may differ from the URDF. Add compliance or backlash if the report names them as missing effects.";

/// A length, mm.
fn mm(meters: f64) -> String {
    number::plain(meters, Unit::Meter)
}

fn quoted(names: &[String]) -> String {
    const MOST: usize = 6;
    let mut shown: Vec<String> = names.iter().take(MOST).map(|n| format!("`{n}`")).collect();
    if names.len() > MOST {
        shown.push(format!("{} more", names.len() - MOST));
    }
    match shown.len() {
        0 | 1 => shown.concat(),
        n => format!("{} and {}", shown[..n - 1].join(", "), shown[n - 1]),
    }
}

fn plural(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// `3.4 times`.
fn times(ratio: f64) -> String {
    let digits = if ratio < 10.0 { 1 } else { 0 };
    format!("{} times", number::fixed(ratio.min(9999.0), digits))
}

fn worse(rival: &Rival, rms: f64) -> String {
    let ratio = rival.rms / rms.max(1e-9);
    format!(
        "`{}` leaves {}, {} as much",
        rival.link,
        mm(rival.rms),
        times(ratio)
    )
}

fn angle_unit(unit: AngleUnit) -> &'static str {
    match unit {
        AngleUnit::Rad => "rad",
        AngleUnit::Deg => "deg",
    }
}

/// A unit of length after a number or "in".
fn length_unit(name: &str) -> &str {
    match name {
        "in" => "inches",
        "ft" => "feet",
        "um" => "micrometers",
        other => other,
    }
}

/// The sentence of a fact, without the word CHECK.
#[must_use]
pub fn sentence(about: &About) -> String {
    match about {
        About::Joints { .. }
        | About::TooLarge { .. }
        | About::TipOfChain { .. }
        | About::LinkStated { .. }
        | About::Link { .. }
        | About::LinkUnknown { .. }
        | About::Unfollowed { .. }
        | About::Still { .. } => of_links(about),
        About::JointsByName { .. }
        | About::JointsByOrder { .. }
        | About::JointsMissing { .. }
        | About::JointAtItsLimit { .. }
        | About::Angles { .. }
        | About::Lengths { .. }
        | About::Time { .. }
        | About::Ignored { .. } => of_columns(about),
        About::Turns { .. } => turns::sentence(about),
        About::Corrected { .. } | About::NotCorrected { .. } | About::SignOrMirror { .. } => {
            mistakes::sentence(about)
        }
        About::Agrees {
            rms,
            rows,
            not,
            corrected,
        } => agree(*rms, *rows, *not, *corrected),
        About::TooFew { rows } => format!(
            "{} too few to test the order, signs and units of the joints.",
            plural(*rows, "pose is", "poses are")
        ),
        About::Disagrees { rms, limit } => format!(
            "The recordings fit the nominal robot to {} rms only; errors of 1° and 10 mm explain {}, and no single mistake explains it. See what `calib check` says.",
            mm(*rms),
            mm(*limit)
        ),
        About::LinkOfProfile { .. }
        | About::Listed
        | About::Replaced { .. }
        | About::Absent { .. }
        | About::NotSeen { .. }
        | About::MoreMarkers { .. }
        | About::OtherUse { .. }
        | About::NoNewBody { .. }
        | About::HeldAsElsewhere { .. }
        | About::StatedBodySigma { .. }
        | About::InventedMount
        | About::StatedSigma { .. } => known::sentence(about),
        _ => of_session(about),
    }
}

fn agree(rms: f64, rows: usize, not: usize, corrected: bool) -> String {
    let what = match corrected {
        true => "With the corrections below, order, signs and units of the joints",
        false => "Order, signs and units of the joints",
    };
    let (poses, rms) = (plural(rows, "pose", "poses"), mm(rms));
    match not {
        0 => format!(
            "{what} agree with the nominal robot: {poses} fit it to {rms} rms, and no mistake explains them better."
        ),
        not => format!(
            "{what} agree with the nominal robot in {} of {poses} only, which fit it to {rms} rms; the others do not fit it. See what `calib check` says.",
            rows - not
        ),
    }
}

fn of_links(about: &About) -> String {
    match about {
        About::Joints { .. } => joints::sentences(about),
        About::TooLarge { reach } => format!(
            "The robot of this URDF reaches {} m: probably its lengths are in millimeters, where a URDF has meters. Divide its origins, the limits of prismatic joints and the meshes by 1000 before anything else.",
            number::fixed(*reach, 0)
        ),
        About::TipOfChain {
            link,
            joints,
            others,
        } => {
            let rest = match others.is_empty() {
                true => String::new(),
                false => format!(" Other ends of chains: {}.", quoted(others)),
            };
            format!(
                "`{link}` is the end of the longest chain ({}). Name the link that carries the markers.{rest}",
                plural(*joints, "joint", "joints")
            )
        }
        About::LinkStated { link, rms, better } => {
            let fit = rms.map_or_else(String::new, |rms| {
                format!(", and explains the motion of this body to {} rms", mm(rms))
            });
            let better = better.as_ref().map_or_else(String::new, |b| {
                format!(" `{}` explains it better: {} rms.", b.link, mm(b.rms))
            });
            format!("`{link}` was named on the command line{fit}.{better}")
        }
        About::Link {
            link,
            rms,
            next,
            same,
        } => {
            let next = next
                .as_ref()
                .map_or_else(String::new, |n| format!("; {}", worse(n, *rms)));
            let same = match same.is_empty() {
                true => String::new(),
                false => format!(
                    " These recordings do not distinguish {} from it.",
                    quoted(same)
                ),
            };
            format!("The body follows `{link}` to {} rms{next}.{same}", mm(*rms))
        }
        About::LinkUnknown { link } => format!(
            "No pose shows this body together with moving joints. `{link}` is the last link that recorded joints move: name the link that carries it."
        ),
        About::Unfollowed { joints, body } => unfollowed(joints, body.as_deref()),
        About::Still { link, rms } => {
            format!(
                "The body stands still to {} rms: it is fixed to `{link}`, or stands beside the robot.",
                mm(*rms)
            )
        }
        _ => String::new(),
    }
}

fn unfollowed(joints: &[String], body: Option<&str>) -> String {
    let names = quoted(joints);
    let (one, it) = match joints.len() {
        1 => ("it", "the joint"),
        _ => ("one of them", "that joint"),
    };
    match body {
        Some(body) => format!(
            "The values of {names} change, and no body moves with {}. If `{body}` is mounted beyond {one}, {it} stood still: check the joint and its column.",
            if joints.len() == 1 { "it" } else { "them" },
        ),
        None => format!(
            "The values of {names} change, and no body moves with {}: the recordings show nothing of {}.",
            if joints.len() == 1 { "it" } else { "them" },
            if joints.len() == 1 {
                "this joint"
            } else {
                "these joints"
            },
        ),
    }
}

fn of_columns(about: &About) -> String {
    match about {
        About::JointsByName { count } => format!(
            "{} the name of a joint.",
            match count {
                1 => "1 column has".to_owned(),
                n => format!("{n} columns have"),
            }
        ),
        About::JointsByOrder { pairs } => {
            let pairs: Vec<String> = pairs
                .iter()
                .map(|(joint, column)| format!("{column} → {joint}"))
                .collect();
            format!(
                "No column has the name of a joint. Numbered columns are paired with the joints in their order from the root: {}.",
                pairs.join(", ")
            )
        }
        About::JointsMissing { joints } => format!(
            "{} {} no column and {} taken to stand at 0.",
            quoted(joints),
            if joints.len() == 1 { "has" } else { "have" },
            if joints.len() == 1 { "is" } else { "are" }
        ),
        About::JointAtItsLimit { joint, at, turns } => {
            let at = match turns {
                true => format!("{}°", yaml::number(at.to_degrees(), 1)),
                false => format!("{} mm", yaml::number(at * 1e3, 1)),
            };
            format!(
                "`{joint}` has no column and cannot stand at 0: it is taken to stand at {at}, the nearest end of its range."
            )
        }
        About::Angles { unit, how } => {
            let unit = angle_unit(*unit);
            match how {
                AngleHow::Named => {
                    format!("Angles are in {unit}: the names of the columns say so.")
                }
                AngleHow::Range { largest } => {
                    let largest = number::fixed(*largest, 2);
                    format!("Angles are in {unit}: the largest is {largest}.")
                }
            }
        }
        About::Lengths { unit, how } => {
            let unit = length_unit(unit.name());
            match how {
                LengthHow::Named => {
                    format!("Lengths are in {unit}: the names of the columns say so.")
                }
                LengthHow::Range { extent, reach } => format!(
                    "Lengths are in {unit}: the markers spread over {} {unit}, and the robot reaches {} m.",
                    number::fixed(*extent, 2),
                    number::fixed(*reach, 2)
                ),
            }
        }
        About::Time {
            column,
            unit,
            named,
        } => {
            let unit = match unit {
                TimeUnit::S => "s",
                TimeUnit::Ms => "ms",
                TimeUnit::Us => "us",
                TimeUnit::Ns => "ns",
            };
            let how = if *named { "" } else { ", by its numbers" };
            format!("`{column}` is the time in {unit}{how}.")
        }
        About::Ignored { .. } => ignored(about),
        _ => String::new(),
    }
}

fn of_computed(about: &About) -> String {
    let About::Computed {
        body,
        columns,
        rms: [own, next],
        other,
        ..
    } = about
    else {
        return String::new();
    };
    let what = match columns.is_empty() {
        true => format!("The coordinates of `{body}`"),
        false => quoted(columns),
    };
    format!(
        "{what} are left out: they fit the nominal robot to {}, `{other}` to {}. A controller computed them from its joints; they are no measurement.",
        mm(*own),
        mm(*next)
    )
}

/// Columns that nothing uses, and what some of them seem to be.
fn ignored(about: &About) -> String {
    let About::Ignored {
        columns,
        orientation,
        joints,
        times,
        parts,
    } = about
    else {
        return String::new();
    };
    let mut text = format!("Not used: {}.", quoted(columns));
    if !orientation.is_empty() {
        text += &format!(
            " {} seem to be an orientation: without it the body is a point. Write it as a quaternion, `<body>.qx` to `<body>.qw`, or map its columns.",
            quoted(orientation)
        );
    }
    if !joints.is_empty() {
        text += &format!(
            " {} are named like joints. If they hold the robot's joints, state it in the column map, and check which columns are read as joints now.",
            quoted(joints)
        );
    }
    if let Some(times) = times {
        text += &format!(
            " `{times}` seems to hold times as text: without times every row is a pose at rest. Write them in seconds, as `t_s`, or as dates with the year first (`2024-05-01T12:00:00.123Z`)."
        );
    }
    if let Some((whole, part)) = parts {
        text += &format!(
            " `{whole}` and `{part}` are the parts of one time: without times every row is a pose at rest. Write their sum in seconds, as `t_s`."
        );
    }
    text
}

fn of_session(about: &About) -> String {
    match about {
        About::Duplicate { marker, of } => {
            format!("`{marker}` repeats `{of}` in every row and is left out.")
        }
        About::Computed { .. } => of_computed(about),
        About::PoseOfMarkers { body } => {
            format!("The pose of `{body}` is computed from markers that are recorded too. It is left out: the same measurements would count twice.")
        }
        About::Seldom { markers } => {
            format!("Seen in fewer than four rows and left out: {}.", quoted(markers))
        }
        About::Rigid { markers, sigma } => {
            let to = sigma.map_or_else(String::new, |s| format!(" to {} per coordinate", mm(s)));
            match sigma {
                Some(sigma) if *sigma >= LOOSE => format!("{markers} markers keep their distances{to} only, more than a tracker's noise: a marker is loose, labels are exchanged, or these are no one body."),
                _ => format!("{markers} markers keep their distances{to}: one body."),
            }
        }
        About::LabelsExchanged { markers, rows } => format!(
            "The labels of {} are exchanged in {}: a run puts them right by the distances.",
            quoted(markers),
            plural(*rows, "row", "rows")
        ),
        About::Flat { left_out } => format!(
            "These markers keep their distances but lie on a line or at one point, so they give no orientation. Left out: {}.",
            quoted(left_out)
        ),
        About::Points { markers: 1 } => "One marker: a point, which shows no rotation about itself.".to_owned(),
        About::Points { markers } => format!("{markers} markers: points, which show no rotation about their line."),
        About::Pose => "A tracked body with six degrees of freedom.".to_owned(),
        About::MarkerSigma { sigma, rows } => format!(
            "The markers scatter about their bodies by {} per coordinate ({}).",
            mm(*sigma),
            plural(*rows, "row", "rows")
        ),
        About::BodySigma { position, orientation } => format!(
            "A body that stands still scatters by {} and {}.",
            mm(*position),
            number::plain(*orientation, Unit::Radian)
        ),
        About::Calculated => "The markers were calculated from a fitted body, so their distances do not show the noise: it is estimated by the fit.".to_owned(),
        About::SigmaUnknown => "Nothing shows the noise of the tracker before the fit: it is estimated. State it if you know it: `marker_sigma_mm`, or `body_sigma_mm` and `body_sigma_deg`.".to_owned(),
        About::Sweep { joints, rows } => format!(
            "Only {} {}: a sweep of {}.",
            quoted(joints),
            if joints.len() == 1 { "moves" } else { "move" },
            plural(*rows, "pose", "poses")
        ),
        About::Static { rows, moved } => format!(
            "{} with {}.",
            plural(*rows, "pose", "poses"),
            plural(*moved, "moving joint", "moving joints")
        ),
        About::ValidationByName { word, rows } => format!(
            "Held out because of `{word}` in its name: {}.",
            plural(*rows, "pose", "poses")
        ),
        About::ValidationSmallest { rows } => format!(
            "Held out to verify the calibration because it is the smallest recording: {}. Use `static` to fit it too.",
            plural(*rows, "pose", "poses")
        ),
        About::LeftOutInTurn => "No recording is held out: the report leaves every pose out in turn. Separate poses, recorded on another day, tell more.".to_owned(),
        About::LostByNumber { value, samples } => format!(
            "{} have {} in every coordinate, far from the others: taken as lost.",
            plural(*samples, "sample", "samples"),
            mm(*value)
        ),
        About::FarClocks { offset, searched } => format!(
            "The tracker's clock is {:.1} s {} the robot's, by the motion of the robot: `max_offset_s` lets a run look for it up to {searched:.0} s.",
            offset.abs(),
            if *offset < 0.0 { "behind" } else { "ahead of" }
        ),
        About::Holds { holds } => format!("A stream in which the robot holds {}: each gives one pose.", plural(*holds, "time", "times")),
        About::Continuous => "A stream of a motion: rows are taken from it.".to_owned(),
        About::Log { file, named, rows } => {
            let joints = match rows {
                Some(rows) => format!("The joints are in the robot's own log `{file}`: both files have {}, which are taken to be the same postures in the same order.", plural(*rows, "row", "rows")),
                None => format!("The joints are in the robot's own log `{file}`, with a clock of its own."),
            };
            match named {
                true => joints,
                false => format!("{joints} The names of the files do not tell which log belongs to which recording: they are paired in their order."),
            }
        }
        About::Limits { sigma } => format!(
            "The largest errors that you accept. Proposed: 5 and 14 times the noise of {}; your task decides.",
            mm(*sigma)
        ),
        About::NoLimits => "State the largest errors that you accept; without limits the verdict is `not_evaluated`.".to_owned(),
        About::Invented => "Mounts, errors and noise of the simulation are invented: put in what you expect. `calib simulate` writes these recordings, `calib plan` proposes better ones.".to_owned(),
        _ => String::new(),
    }
}

/// What to do next.
#[must_use]
pub fn next(file: &str, simulated: bool, errors: usize) -> String {
    let file = shell_path(file);
    match (simulated, errors) {
        (true, _) => format!("Next: calib plan {file}"),
        (false, 0) => format!("Next: calib run {file}"),
        (false, _) => format!("Next: correct the errors, then calib check {file}"),
    }
}

/// Where a fact belongs, as a key of the profile.
#[must_use]
pub fn place(place: &crate::fact::Place) -> String {
    use crate::fact::Place;
    match place {
        Place::Robot => "robot".to_owned(),
        Place::Tracker => "tracker".to_owned(),
        Place::Body(name) => format!("bodies.{name}"),
        Place::Recordings => "recordings".to_owned(),
        Place::Recording(name) => format!("recordings.{name}"),
        Place::Limits => "solve.limits".to_owned(),
        Place::Simulate => "simulate".to_owned(),
    }
}
