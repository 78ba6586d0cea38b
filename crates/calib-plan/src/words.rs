//! Every sentence of a plan.

mod motions;

use calib_finding::number;
use calib_report::Unit;
use nalgebra::Vector3;

use crate::candidates::Counts;
use crate::list::{Goal, Why};
use crate::note::{JointNoiseOf, Note};

pub use motions::{is_unchecked, record_them};

/// A length with its unit; what is not determined says so.
#[must_use]
pub fn length(meters: Option<f64>) -> String {
    match meters {
        Some(m) => format!("{} mm", millimeters(m)),
        None => "not determined".to_owned(),
    }
}

/// σ before the postures of a plan and after them.
#[must_use]
pub fn sigmas([before, after]: [Option<f64>; 2]) -> String {
    format!(
        "σ is {} before its postures and {} after them",
        length(before),
        length(after)
    )
}

/// Three significant digits of a length, mm.
#[must_use]
pub fn millimeters(meters: f64) -> String {
    let mm = meters * 1e3;
    let digits = if mm > 0.0 {
        (2.0 - mm.log10().floor()).clamp(0.0, 6.0) as usize
    } else {
        0
    };
    number::fixed(mm, digits)
}

/// A region of the root's frame.
#[must_use]
pub fn region([low, high]: &[Vector3<f64>; 2]) -> String {
    let of = |i: usize| {
        let mm = |x: f64| number::fixed(x * 1e3, 0);
        format!(
            "{} … {} mm in {}",
            mm(low[i]),
            mm(high[i]),
            ["x", "y", "z"][i]
        )
    };
    [0, 1, 2].map(of).join(", ")
}

/// What each constraint removed.
#[must_use]
pub fn removed(counts: &Counts) -> String {
    let mut parts = Vec::new();
    let mut add = |count: usize, why: String| {
        if count > 0 {
            parts.push(format!("{why} removes {count}"));
        }
    };
    let pair = match &counts.worst_pair {
        Some([a, b]) => format!("self-collision (most often `{a}` with `{b}`)"),
        None => "self-collision".to_owned(),
    };
    add(counts.self_collision, pair);
    add(counts.ground, "the ground".to_owned());
    for (name, count) in &counts.keep_outs {
        add(*count, format!("keep-out `{name}`"));
    }
    add(counts.not_seen, "visibility".to_owned());
    if parts.is_empty() {
        return "no constraint removes any".to_owned();
    }
    parts.join(", ")
}

/// What to do about the constraint that removes most.
#[must_use]
pub fn most_removing(counts: &Counts) -> String {
    let keep_out = counts.keep_outs.iter().max_by_key(|(_, count)| **count);
    let by_box = keep_out.map_or(0, |k| *k.1);
    let largest = [
        counts.self_collision,
        counts.ground,
        by_box,
        counts.not_seen,
    ];
    let most = largest.iter().max().copied().unwrap_or(0);
    if most == 0 {
        "ask for fewer postures, or give more `--candidates`".to_owned()
    } else if counts.not_seen == most {
        "check place, direction and field of the cameras, `min_cameras` and `facing` under `plan`"
            .to_owned()
    } else if counts.self_collision == most {
        "check the collision shapes of these links in the URDF, or reduce `plan.clearance_mm`"
            .to_owned()
    } else if counts.ground == most {
        "check `plan.ground_mm`: it is a height in the frame of the robot's root".to_owned()
    } else {
        let name = keep_out.map_or("", |k| k.0.as_str());
        format!(
            "check place and size of `plan.keep_outs.{name}`: the box is in the frame of the robot's root"
        )
    }
}

/// What the reasons in `plan.csv` mean that a person must know who moves the robot.
pub const OF_TABLE: [&str; 2] = [
    "move from row to row in this order; `note` is the reason of each posture",
    "`detour`: only on the way around an obstacle, do not record",
];

/// Why a posture is in the list.
#[must_use]
pub fn why(why: Why) -> &'static str {
    match why {
        Why::Information => "information",
        Why::SpaceFilling => "space-filling",
        Why::Approach => "approach",
        Why::OtherSide => "other side",
        Why::Detour => "detour",
    }
}

/// What that means.
#[must_use]
pub fn why_in_full(why: Why) -> &'static str {
    match why {
        Why::Information => "adds most to what is known",
        Why::SpaceFilling => "fills the joint ranges, for effects that the model does not have",
        Why::Approach => {
            "all joints move past the posture that follows, which is then approached from the other side"
        }
        Why::OtherSide => {
            "an earlier posture again, approached from the other side: shows backlash and noise"
        }
        Why::Detour => "only on the way around an obstacle: do not record",
    }
}

/// What the postures are chosen for.
#[must_use]
pub fn goal(goal: Goal) -> &'static str {
    match goal {
        Goal::Task => "the tool's position over the task postures (I-optimal)",
        Goal::Parameters => "all parameters together (D-optimal)",
        Goal::Variances => "the mean variance of the parameters (A-optimal)",
        Goal::Weakest => "the least determined combination of the parameters (E-optimal)",
    }
}

/// The unit in which the efficiency is stated.
#[must_use]
pub fn efficiency_of(goal: Goal) -> &'static str {
    match goal {
        Goal::Task | Goal::Variances | Goal::Weakest => "in σ",
        Goal::Parameters => "per parameter",
    }
}

fn of_pairs(pairs: &[[String; 2]]) -> String {
    let of = |[a, b]: &[String; 2]| format!("`{a}` with `{b}`");
    pairs.iter().map(of).collect::<Vec<_>>().join(", ")
}

/// The noise of the joints, and where it is taken from.
#[must_use]
pub fn joint_noise(sigma: f64, of: JointNoiseOf) -> String {
    let sigma = number::plain(sigma, Unit::Radian);
    match of {
        JointNoiseOf::Recordings => {
            format!("Noise of the joints: {sigma}, as the recordings show it.")
        }
        JointNoiseOf::Solve => format!("Noise of the joints: {sigma} (`solve.noise.joint_deg`)."),
        JointNoiseOf::Simulation => {
            format!("Noise of the joints: {sigma} (`simulate.noise.joint_deg`).")
        }
        JointNoiseOf::Program => format!(
            "Noise of the joints: {sigma}, assumed. State `solve.noise.joint_deg` if you know it."
        ),
    }
}

/// What to do about shapes that could not be read.
const READ_THEM: &str = "Put the files where the URDF names them, or state the folders of their packages under `robot.packages`.";

/// Links with the files of their shapes.
fn of_shapes(shapes: &[(String, Option<String>)]) -> String {
    let of = |(link, file): &(String, Option<String>)| match file {
        Some(file) => format!("`{link}` ({file})"),
        None => format!("`{link}`"),
    };
    shapes.iter().map(of).collect::<Vec<_>>().join(", ")
}

fn names(names: &[String]) -> String {
    let quoted: Vec<String> = names.iter().map(|n| format!("`{n}`")).collect();
    quoted.join(", ")
}

/// `stated`, `links`, `unread`: the names, as they are listed.
fn surroundings_unchecked(stated: (&str, bool), links: &str, unread: &str) -> String {
    let is = if stated.1 { "is" } else { "are" };
    let mut text = format!("{} {is} not compared with", stated.0);
    if !links.is_empty() {
        text += &format!(" links without shapes: {links}");
    }
    if !unread.is_empty() {
        let also = if links.is_empty() { "" } else { ", nor with" };
        text += &format!("{also} shapes that could not be read: {unread}");
    }
    text += ". The plan may move them through.";
    if !links.is_empty() {
        text += " Give links `<collision>` shapes in the URDF.";
    }
    if !unread.is_empty() {
        text += &format!(" {READ_THEM}");
    }
    text
}

/// A note on a terminal: of many names the first ones.
#[must_use]
pub fn brief(of: &Note) -> String {
    /// So many lines has a terminal to spare.
    const MOST: usize = 3;
    match of {
        Note::SurroundingsUnchecked {
            stated,
            links,
            unread,
        } => {
            let unread: Vec<String> = unread.iter().map(|(link, _)| link.clone()).collect();
            surroundings_unchecked(
                (&some_of(stated, MOST), stated.len() == 1),
                &some_of(links, MOST),
                &some_of(&unread, MOST),
            )
        }
        other => note(other),
    }
}

/// A note as a sentence, with what to do.
#[must_use]
pub fn note(note: &Note) -> String {
    match note {
        Note::NotRecordedYet { recordings } => {
            format!("Not recorded yet: {}. The plan does not count on them.", names(recordings))
        }
        Note::RecordingsUnused { why } => format!(
            "The recordings that exist were not used: {}. `calib check` says more.",
            why.lines().next().unwrap_or_default().trim_end_matches('.')
        ),
        Note::FromSimulation => "Mounts, markers and the robot's place are taken from the profile's `simulate` section.".to_owned(),
        Note::MountAssumed { body } => format!(
            "It is not known where `{body}` is mounted: assumed at the origin of its link. State `mount` for a better plan."
        ),
        Note::LayoutAssumed { body } => format!(
            "It is not known where the markers of `{body}` are: assumed about 50 mm from its origin. State `template_mm` for a better plan."
        ),
        Note::NoiseAssumed => {
            "The tracker's noise is not stated: the σ are in proportion to the default noise. State `tracker.marker_sigma_mm` or `body_sigma_mm`.".to_owned()
        }
        Note::JointsStill { joints } => format!(
            "Held, because no recording moves them: {}. To move them, give their ranges under `plan.joints`.",
            names(joints)
        ),
        Note::NoShape { links } => format!(
            "Collisions are not checked for links without shapes: {}.",
            names(links)
        ),
        Note::SurroundingsUnchecked {
            stated,
            links,
            unread,
        } => surroundings_unchecked(
            (&names(stated), stated.len() == 1),
            &names(links),
            &of_shapes(unread),
        ),
        Note::StandsThere { stated, links } => format!(
            "In contact with {} in every posture, because no planned joint moves them, and not compared with it: {}.",
            names(stated),
            names(links)
        ),
        Note::NoRoom { joints } => format!(
            "Held, because their limits in the URDF leave no range: {}. Correct the limits to move them.",
            names(joints)
        ),
        Note::NarrowedByFollower { joints } => {
            let of = |[joint, follower]: &[String; 2]| format!("`{joint}` (`{follower}`)");
            let all: Vec<String> = joints.iter().map(of).collect();
            format!(
                "Ranges of `plan.joints` narrowed by the limits of a joint that follows: {}.",
                all.join(", ")
            )
        }
        Note::ShapeUnread { shapes } => format!(
            "Collisions are not checked for shapes that could not be read: {}. {READ_THEM}",
            of_shapes(shapes)
        ),
        Note::PairsNotCompared { pairs } => format!(
            "Not compared, because their capsules overlap in most postures: {}. Watch them in the first run.",
            of_pairs(pairs)
        ),
        Note::PairsAlwaysClose { pairs } => format!(
            "Nearer than the clearance in nearly all postures, and kept from touching only: {}.",
            of_pairs(pairs)
        ),
        Note::JointNoise { sigma, of } => joint_noise(*sigma, *of),
        Note::EverythingSeen => {
            "No cameras are stated: every marker counts as seen. State `plan.cameras` where markers can be hidden.".to_owned()
        }
        Note::FacingUnused => "`plan.facing` needs `plan.cameras`: it was not used.".to_owned(),
        Note::NoClearMotion { to } => {
            let all: Vec<String> = to.iter().map(usize::to_string).collect();
            format!(
                "No collision-free motion was found to pose {}: move there with a motion planner or by hand. `trajectory.json` is not written.",
                all.join(", ")
            )
        }
        Note::FewerPairs { planned, found } => format!(
            "{found} of {planned} postures could be planned from both sides: obstacles or joint limits are in the way."
        ),
        Note::PathTime {
            asked,
            found,
            most_s,
        } => format!(
            "{found} postures in place of {asked}: the motions between more of them take longer than {most_s} s."
        ),
        Note::TaskOpen => {
            "The tool's position depends on something that neither the plan nor a prior determines; its σ is not stated. Fix it in the profile or state a prior.".to_owned()
        }
    }
}

/// Why no joint moves.
#[must_use]
pub fn standing(held: &[String], fixed: &[String]) -> String {
    let quoted = |names: &[String]| {
        let all: Vec<String> = names.iter().map(|n| format!("`{n}`")).collect();
        all.join(", ")
    };
    let mut parts = Vec::new();
    if !fixed.is_empty() {
        parts.push(format!(
            "the URDF's limits leave no range to {}",
            quoted(fixed)
        ));
    }
    if !held.is_empty() {
        parts.push(format!("{} stand still", quoted(held)));
    }
    if parts.is_empty() {
        return "the links of the bodies hang on fixed joints".to_owned();
    }
    parts.join(", ")
}

/// How to let joints move.
#[must_use]
pub fn to_move(fixed: &[String]) -> &'static str {
    if fixed.is_empty() {
        "give ranges under `plan.joints`, take joints out of `plan.hold`, or put a body on a link that moves"
    } else {
        "correct `lower` and `upper` of these joints in the URDF"
    }
}

/// The nearest name, after what was not found.
#[must_use]
pub fn nearest(name: Option<&str>) -> String {
    name.map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}

/// The first `most` names.
#[must_use]
pub fn some_of(names: &[String], most: usize) -> String {
    let shown = names.iter().take(most).map(|n| format!("`{n}`"));
    let mut shown: Vec<String> = shown.collect();
    if names.len() > most {
        shown.push(format!("and {} more", names.len() - most));
    }
    shown.join(", ")
}

/// σ of a parameter in the unit in which it is read.
#[must_use]
pub fn parameter_sigma(sigma: Option<f64>, unit: calib_core::Unit) -> String {
    let unit = match unit {
        calib_core::Unit::Meter => Unit::Meter,
        calib_core::Unit::Radian => Unit::Radian,
        _ => return sigma.map_or_else(|| "—".to_owned(), |s| format!("{s:.2e}")),
    };
    number::sigma(sigma, unit)
}

/// Limits of a joint that turns more often than cables allow, rad.
#[must_use]
pub fn many_turns(low: f64, high: f64) -> String {
    let turns = (high - low) / std::f64::consts::TAU;
    format!("{low:.1} and {high:.1} rad ({turns:.0} turns)")
}

/// Why a place of the task has no posture.
#[must_use]
pub fn no_posture(
    nearest_mm: f64,
    nearest_deg: f64,
    starts: usize,
    oriented: bool,
    touching: bool,
) -> String {
    let orientation = if oriented {
        " with this orientation"
    } else {
        ""
    };
    let angle = match oriented {
        true => format!(" and {nearest_deg:.1}°"),
        false => String::new(),
    };
    if touching {
        return format!(
            "the postures found that bring the tool there{orientation} touch the robot itself, the ground or a keep-out\n  help: change the place, `plan.keep_outs` or `plan.clearance_mm`"
        );
    }
    format!(
        "of {starts} searches from other postures none brings the tool there{orientation}; the nearest ends {nearest_mm:.1} mm{angle} off\n  help: places are in the frame of the robot's root, in meters; widen `plan.joints` if the ranges are narrower than the robot's"
    )
}

/// What stands where the robot must not be, in the 3-D view.
pub const KEEP_OUTS: &str = "keep-outs";
/// The tracker's cameras, in the 3-D view.
pub const CAMERAS: &str = "cameras";

/// What a posture is called; `None`: nothing is recorded there.
#[must_use]
pub fn pose(number: Option<usize>) -> String {
    number.map_or_else(|| "on the way".to_owned(), |k| format!("pose {k}"))
}

/// What a posture to validate with is called.
#[must_use]
pub fn held_out_pose(number: usize) -> String {
    format!("validation {number}")
}

/// Why a posture is recorded, and σ after it.
#[must_use]
pub fn posture(why: &str, sigma: Option<f64>) -> String {
    format!("{why}; expected σ after it: {}", length(sigma))
}
