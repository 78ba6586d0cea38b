//! A simulated laboratory: the arm of the tutorial, bodies on it, and recordings as files.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use calib_init::mistake::Mistake;
use calib_init::{About, Fact, File, Proposal, Request, propose};
use calib_profile::Profile;
use calib_recording::{Poses, WriteOptions, write_poses};
use calib_sim::{Motion, StreamPlan, Streams, simulate, simulate_streams};
use calib_urdf::RobotModel;

pub const URDF: &str = include_str!("../../../../book/src/tutorial/arm.urdf");

/// What is bolted to a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// So many markers.
    Markers(usize),
    /// A tracked pose.
    Pose,
}

pub const KINDS: [Kind; 5] = [
    Kind::Markers(1),
    Kind::Markers(2),
    Kind::Markers(3),
    Kind::Markers(4),
    Kind::Pose,
];

/// A body: its name, its link, and what it is.
pub type On = (&'static str, &'static str, Kind);

/// How the poses are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Design {
    /// All joints at random.
    Random,
    /// One recording for each joint.
    Sweeps,
    /// All joints at random by a few degrees: the numbers do not tell degrees from radians.
    Small,
}

pub fn arm() -> RobotModel {
    RobotModel::from_urdf_text(URDF, "arm.urdf").expect("the arm of the tutorial")
}

/// The profile of the laboratory as it really is.
fn profile(bodies: &[On], design: Design) -> String {
    let at = [[0, 0, 0], [82, 0, 0], [24, 66, 0], [47, 21, 39]];
    let (mut claims, mut mounts) = (String::new(), String::new());
    for (name, link, kind) in bodies {
        let Kind::Markers(count) = *kind else {
            let _ = writeln!(claims, "  {name}: {{link: {link}, pose: true}}");
            let _ = writeln!(
                mounts,
                "    {name}: {{xyz_mm: [35, -27, 46], rpy_deg: [12, -8, 25]}}"
            );
            continue;
        };
        let names: Vec<String> = (1..=count).map(|i| format!("{name}_{i}")).collect();
        let _ = writeln!(
            claims,
            "  {name}: {{link: {link}, markers: [{}]}}",
            names.join(", ")
        );
        let places: Vec<String> = names
            .iter()
            .zip(at)
            .map(|(n, p)| format!("{n}: {p:?}"))
            .collect();
        let _ = writeln!(
            mounts,
            "    {name}: {{xyz_mm: [35, -27, 46], rpy_deg: [12, -8, 25], markers_mm: {{{}}}}}",
            places.join(", ")
        );
    }
    let (mut files, mut protocols) = (String::new(), String::new());
    match design {
        Design::Small => {
            let _ = writeln!(files, "  poses: {{file: poses.csv, use: static}}");
            let ranges: Vec<String> = (1..=6).map(|j| format!("joint_{j}_deg: [-5, 5]")).collect();
            let _ = writeln!(
                protocols,
                "    poses: {{random: {{{}}}, poses: 24}}",
                ranges.join(", ")
            );
        }
        Design::Random => {
            for (name, poses) in [("poses", 24), ("more", 10)] {
                let _ = writeln!(files, "  {name}: {{file: {name}.csv, use: static}}");
                let _ = writeln!(
                    protocols,
                    "    {name}: {{random: {{joint_1_deg: [-120, 120], joint_2_deg: [-60, 60], joint_3_deg: [-100, 100], joint_4_deg: [-120, 120], joint_5_deg: [-80, 80], joint_6_deg: [-150, 150]}}, poses: {poses}}}"
                );
            }
        }
        Design::Sweeps => {
            for joint in 1..=6 {
                let _ = writeln!(
                    files,
                    "  turn_{joint}: {{file: turn_{joint}.csv, use: static}}"
                );
                let at = [20, 30, 40, 25, 50, 35]
                    .iter()
                    .enumerate()
                    .filter(|(i, _)| i + 1 != joint);
                let hold: Vec<String> = at
                    .map(|(i, q)| format!("joint_{}_deg: {q}", i + 1))
                    .collect();
                let _ = writeln!(
                    protocols,
                    "    turn_{joint}: {{grid: [{{joint: joint_{joint}_deg, from: -80, to: 80, poses: 11}}], hold: {{{}}}}}",
                    hold.join(", ")
                );
            }
        }
    }
    format!(
        "calib: 1
robot: {{name: lab, urdf: arm.urdf}}
tracker: {{frame: lab}}
bodies:
{claims}recordings:
{files}simulate:
  seed: 1
  tracker_from_root: {{xyz_mm: [812, -340, 715], rpy_deg: [1.4, -2.2, 37]}}
  mounts:
{mounts}  errors: {{joint_offset_deg: 0.2, axis_mm: 0.5, axis_deg: 0.1}}
  noise: {{marker_mm: 0.2, body_mm: 0.2, body_deg: 0.05, joint_deg: 0.01, occluded: 0.01}}
  recordings:
{protocols}"
    )
}

fn checked(text: &str, model: &RobotModel) -> Profile {
    let raw = calib_profile::parse(text, "lab.yaml").unwrap_or_else(|e| panic!("{e}\n{text}"));
    calib_profile::check(&raw, text, "lab.yaml", model).unwrap_or_else(|e| panic!("{e}"))
}

/// Recordings by name.
pub fn recordings(bodies: &[On], design: Design, seed: u64) -> BTreeMap<String, Poses> {
    let model = arm();
    let profile = checked(&profile(bodies, design), &model);
    simulate(&profile, &model, Some(seed))
        .expect("a section")
        .recordings
}

/// Two streams with two clocks.
pub fn streams(bodies: &[On], motion: Motion, offset: f64, seed: u64) -> Streams {
    let model = arm();
    let profile = checked(&profile(bodies, Design::Random), &model);
    let ranges = [
        (1, 90.0),
        (2, 50.0),
        (3, 80.0),
        (4, 90.0),
        (5, 70.0),
        (6, 100.0),
    ];
    let ranges = ranges.map(|(joint, range)| {
        let id = model
            .joint_id(&format!("joint_{joint}"))
            .expect("of the arm");
        (id, (f64::to_radians(-range), f64::to_radians(range)))
    });
    let plan = StreamPlan {
        motion,
        ranges: ranges.into_iter().collect(),
        bodies: bodies.iter().map(|b| b.0.to_owned()).collect(),
        duration: 60.0,
        tracker_hz: 20.0,
        robot_hz: 25.0,
        offset,
        drift: 0.0,
    };
    simulate_streams(&profile, &model, &plan, seed).expect("a section")
}

/// A table as our own CSV, angles in degrees.
pub fn text(poses: &Poses) -> String {
    let options = WriteOptions {
        degrees: true,
        ..WriteOptions::micro()
    };
    write_poses(poses, &options).expect("a table")
}

pub fn file(name: &str, text: impl Into<String>) -> File {
    File {
        shown: format!("{name}.csv"),
        path: format!("{name}.csv"),
        bytes: text.into().into_bytes(),
    }
}

pub fn files(recordings: &BTreeMap<String, Poses>) -> Vec<File> {
    recordings
        .iter()
        .map(|(name, poses)| file(name, text(poses)))
        .collect()
}

pub fn request() -> Request {
    Request {
        urdf_shown: "arm.urdf".to_owned(),
        urdf_path: "arm.urdf".to_owned(),
        folder: "arm".to_owned(),
        ..Request::default()
    }
}

pub fn proposed(files: &[File]) -> Proposal {
    propose(&arm(), &request(), files).unwrap_or_else(|e| panic!("{e}"))
}

/// Name of the link that a body was given.
pub fn link_of(proposal: &Proposal, body: &str) -> String {
    let model = arm();
    let found = proposal.bodies.iter().find(|b| b.name == body);
    let found = found.unwrap_or_else(|| panic!("no body {body} among {:?}", proposal.bodies));
    model.link(found.link).name.clone()
}

/// A table with other cells: `change(column, cell)`.
pub fn with_cells(table: &str, mut change: impl FnMut(&str, &str) -> String) -> String {
    let mut names: Option<Vec<String>> = None;
    let mut out = String::new();
    for line in table.lines() {
        if line.starts_with('#') {
            continue;
        }
        let cells: Vec<&str> = line.split(',').collect();
        match &names {
            None => {
                out += line;
                names = Some(cells.iter().map(|c| (*c).to_owned()).collect());
            }
            Some(names) => {
                let changed = names.iter().zip(cells).map(|(n, c)| change(n, c));
                out += &changed.collect::<Vec<_>>().join(",");
            }
        }
        out.push('\n');
    }
    out
}

/// A table with other names in its header.
pub fn with_names(table: &str, name: impl Fn(&str) -> String) -> String {
    let body: Vec<&str> = table.lines().filter(|l| !l.starts_with('#')).collect();
    let header: Vec<String> = body[0].split(',').map(name).collect();
    std::iter::once(header.join(","))
        .chain(body[1..].iter().map(|l| (*l).to_owned()))
        .map(|line| line + "\n")
        .collect()
}

/// The markers' scatter, which no wrong unit leaves as it is, and the link.
pub fn assert_read(proposal: &Proposal, what: &str) {
    let sigma = proposal.noise.marker.expect("a scatter");
    assert!((1e-4..4e-4).contains(&sigma), "{what}: {sigma}");
    assert_eq!(link_of(proposal, "hand"), "link_6", "{what}");
    let agrees = |f: &Fact| matches!(f.about, About::Agrees { rms, .. } if rms < 8e-3);
    assert!(
        proposal.facts.iter().any(agrees),
        "{what}: {:?}",
        proposal.facts
    );
}

/// The mistakes that were corrected.
pub fn corrected(proposal: &Proposal) -> Vec<&Mistake> {
    let of = proposal.facts.iter().filter_map(|fact| match &fact.about {
        About::Corrected { mistake, .. } => Some(mistake),
        _ => None,
    });
    of.collect()
}
