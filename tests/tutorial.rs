//! The exports of the book's tutorial are simulated: a six-axis arm before a tracker, each with its own clock, written as Vicon Nexus and the
//! robot's controller write them. `UPDATE_BOOK=1` writes them again; they lie beside the page, so that a reader needs nothing else.

use crate::scratch;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;

use calib_pipeline::prepare::load::load_robot;
use calib_recording::Poses;
use calib_sim::{Motion, StreamPlan, Streams, simulate_streams};
use scratch::{Scratch, root};

/// Where the exports lie.
const FOLDER: &str = "book/src/tutorial";

/// Origins of the nominal URDF, and of the arm that the exports are simulated of (joint by joint: offsets of zeros as rotations about the
/// joint's axis, tilted and displaced axes).
const TRUE_ORIGINS: [(&str, &str); 5] = [
    (
        r#"xyz="0 0.12 0" rpy="0 0 0""#,
        r#"xyz="0.0006 0.12 0" rpy="0.0011 0.0062 0""#,
    ),
    (
        r#"xyz="0 0 0.43" rpy="0 0 0""#,
        r#"xyz="0.0004 0 0.4309" rpy="-0.0014 -0.0048 0.0009""#,
    ),
    (
        r#"xyz="0.03 0 0.2" rpy="0 0 0""#,
        r#"xyz="0.0305 0.0004 0.2" rpy="0.0008 -0.0012 0.0041""#,
    ),
    (
        r#"xyz="0 0 0.21" rpy="0 0 0""#,
        r#"xyz="-0.0004 0 0.2106" rpy="0.0007 0.0035 -0.0006""#,
    ),
    (
        r#"xyz="0 0 0.09" rpy="0 0 0""#,
        r#"xyz="0.0003 -0.0002 0.09" rpy="-0.0009 0.0005 0""#,
    ),
];

/// What a collision in summer did to the arm: the zero of joint 5 moved by 0.15°.
const COLLISION: (&str, &str) = (
    r#"rpy="0.0007 0.0035 -0.0006""#,
    r#"rpy="0.0007 0.006118 -0.0006""#,
);

/// The simulated laboratory: no errors beyond those of the true URDF, and other places of tracker and plate in each campaign.
fn laboratory(tracker: &str, plate: &str) -> String {
    format!(
        "calib: 1
robot: {{name: lab_arm, urdf: true.urdf}}
tracker: {{frame: vicon, marker_sigma_mm: 0.15}}
bodies:
  plate: {{link: flange, markers: [P1, P2, P3, P4]}}
recordings:
  all: {{file: all.csv, use: static}}
solve: {{free: [bodies, tracker]}}
simulate:
  seed: 1
  tracker_from_root: {tracker}
  mounts:
    plate:
      {plate}
      markers_mm: {{P1: [0, 0, 0], P2: [82, 0, 0], P3: [24, 66, 0], P4: [47, 21, 39]}}
  noise: {{marker_mm: 0.15, joint_deg: 0.005, occluded: 0.005}}
  recordings:
    all: {{random: {{joint_1_deg: [-90, 90]}}, poses: 2}}
"
    )
}

/// A campaign: its name in the files, where tracker and plate are, whether the arm has collided, and the seed of its noise.
struct Campaign {
    name: &'static str,
    tracker: &'static str,
    plate: &'static str,
    collided: bool,
    seed: u64,
}

const CAMPAIGNS: [Campaign; 2] = [
    Campaign {
        name: "2026-05",
        tracker: "{xyz_mm: [812, -340, 715], rpy_deg: [0.4, -0.2, 37]}",
        plate: "xyz_mm: [-38, -27, 16]\n      rpy_deg: [2, -1, 15]",
        collided: false,
        seed: 512,
    },
    Campaign {
        name: "2026-11",
        tracker: "{xyz_mm: [640, 125, 716], rpy_deg: [-0.3, 0.1, -12]}",
        plate: "xyz_mm: [-41, -25, 16]\n      rpy_deg: [1, 2, 21]",
        collided: true,
        seed: 1103,
    },
];

/// Postures: those to fit and those to check.
const PARTS: [(&str, u32, u64); 2] = [("fit", 32, 0), ("check", 20, 1)];
const HOLD_S: f64 = 1.6;
const TRAVEL_S: f64 = 2.0;
/// Both machines at a tenth of their usual rate: the exports are small.
const RATE_HZ: f64 = 10.0;

fn streams(campaign: &Campaign, postures: u32, part: u64) -> Streams {
    let mut urdf = fs::read_to_string(root().join(FOLDER).join("arm.urdf")).expect("committed");
    let collision = campaign.collided.then_some(COLLISION);
    for (nominal, real) in TRUE_ORIGINS.into_iter().chain(collision) {
        assert_eq!(urdf.matches(nominal).count(), 1, "{nominal}");
        urdf = urdf.replace(nominal, real);
    }
    let dir = Scratch::new()
        .file("true.urdf", urdf)
        .file("all.csv", "pose,joint_1_deg\n")
        .file("lab.yaml", laboratory(campaign.tracker, campaign.plate));
    let robot = load_robot(&dir.path("lab.yaml")).expect("a profile");
    let ranges = [
        ("joint_1", 90.0),
        ("joint_2", 50.0),
        ("joint_3", 80.0),
        ("joint_4", 90.0),
        ("joint_5", 70.0),
        ("joint_6", 100.0),
    ];
    let plan = StreamPlan {
        motion: Motion::StopAndGo {
            hold: HOLD_S,
            travel: TRAVEL_S,
        },
        ranges: ranges
            .into_iter()
            .map(|(joint, range)| {
                let id = robot.model.joint_id(joint).expect("of the arm");
                (id, (f64::to_radians(-range), f64::to_radians(range)))
            })
            .collect(),
        bodies: vec!["plate".to_owned()],
        duration: f64::from(postures) * (HOLD_S + TRAVEL_S) - TRAVEL_S,
        tracker_hz: RATE_HZ,
        robot_hz: RATE_HZ,
        // The files have clocks of their own, see `LOG_AHEAD_MS`.
        offset: 0.0,
        drift: 0.0,
    };
    let seed = campaign.seed + part;
    simulate_streams(&robot.profile, &robot.model, &plan, seed).expect("a section")
}

/// Frames of the tracker are numbered from 1 at its start; the controller's log was started so much earlier.
const LOG_AHEAD_MS: f64 = 2713.0;

/// As Vicon Nexus exports trajectories: rate, two rows of names, units, and frames from 1 at an even rate.
fn vicon(poses: &Poses) -> String {
    let names: Vec<&String> = poses.markers.keys().collect();
    let mut text = format!("Trajectories\r\n{RATE_HZ}\r\n,");
    for name in &names {
        let _ = write!(text, ",Plate:{name},,");
    }
    text += "\r\nFrame,Sub Frame";
    text += &",X,Y,Z".repeat(names.len());
    text += "\r\n,";
    text += &",mm,mm,mm".repeat(names.len());
    text += "\r\n";
    for row in 0..poses.rows.len() {
        let _ = write!(text, "{},0", row + 1);
        for name in &names {
            match poses.markers[*name][row] {
                Some(p) => {
                    let [x, y, z] = [p.x, p.y, p.z].map(|v| v * 1e3);
                    let _ = write!(text, ",{x:.2},{y:.2},{z:.2}");
                }
                None => text += ",,,",
            }
        }
        text += "\r\n";
    }
    text
}

/// As the controller logs: its own time in ms, joints A1 to A6 in degrees, semicolons.
fn controller(poses: &Poses) -> String {
    let times = poses.t.as_ref().expect("a stream has times");
    let joints: BTreeMap<&String, &Vec<Option<f64>>> = poses.joints.iter().collect();
    let mut text = String::from("time_ms");
    for joint in joints.keys() {
        let _ = write!(text, ";{}", joint.replace("joint_", "A"));
    }
    text += "\n";
    for (row, t) in times.iter().enumerate() {
        let _ = write!(text, "{:.0}", t * 1e3 + LOG_AHEAD_MS);
        for values in joints.values() {
            let value = values[row].expect("a controller misses nothing");
            let _ = write!(text, ";{:.4}", value.to_degrees());
        }
        text += "\n";
    }
    text
}

#[test]
fn the_exports_of_the_tutorial_are_what_the_simulation_writes() {
    for campaign in &CAMPAIGNS {
        for (part, postures, number) in PARTS {
            let streams = streams(campaign, postures, number);
            for (machine, text) in [
                ("vicon", vicon(&streams.tracker)),
                ("robot", controller(&streams.robot)),
            ] {
                let name = format!("{FOLDER}/{}-{part}-{machine}.csv", campaign.name);
                let file = root().join(&name);
                if std::env::var_os("UPDATE_BOOK").is_some() {
                    fs::write(&file, &text).expect("the export can be written");
                }
                let written = fs::read_to_string(&file).unwrap_or_default();
                assert!(
                    written == text,
                    "{name} is old: UPDATE_BOOK=1 cargo test -p calib-cli --test suite tutorial::"
                );
            }
        }
    }
}

#[test]
fn the_tutorial_shows_the_profile_that_lies_beside_it() {
    let page = fs::read_to_string(root().join("book/src/tutorial.md")).expect("the page");
    let profile =
        fs::read_to_string(root().join(FOLDER).join("arm.yaml")).expect("the profile lies there");
    assert!(
        page.contains(&format!("```yaml\n{profile}```")),
        "book/src/tutorial.md shows another profile than {FOLDER}/arm.yaml"
    );
}

/// One report gives one number for one thing: postures that count, what was excluded and what the fit rejected, and clocks that differ.
#[test]
fn the_report_of_the_tutorial_does_not_contradict_itself() {
    let files = ["arm.urdf", "arm.yaml"].map(str::to_owned).into_iter();
    let exports = ["fit", "check"]
        .into_iter()
        .flat_map(|part| ["vicon", "robot"].map(|machine| format!("2026-05-{part}-{machine}.csv")));
    let dir = files.chain(exports).fold(Scratch::new(), |dir, name| {
        let text = fs::read(root().join(FOLDER).join(&name)).expect("committed");
        dir.file(&name, text)
    });
    dir.calib(["run", "arm.yaml", "-o", "out"]).expect(0);
    let report = dir.read("out/report.json");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let postures = &report["verification"]["held_out"]["postures"];
    let verified = format!("Verified on {postures} held-out postures");
    let scope = report["scope"].as_array().expect("a list");
    let says = |line: &serde_json::Value| line.as_str().is_some_and(|l| l.contains(&verified));
    assert!(scope.iter().any(says), "{verified}: {scope:?}");
    // Every recording's clocks are 2.7 s apart, and a finding says so.
    for clock in report["clocks"].as_array().expect("a list") {
        assert_eq!(clock["agrees"], false, "{clock}");
    }
    let text = dir.read("out/report.md");
    for said in [
        "12 of 128 (9 %) measurements of the fitted recordings were excluded before the fit or rejected by it.",
        "It writes to `results/arm` there",
        "no, but they were aligned by the motion",
    ] {
        assert!(text.contains(said), "`{said}` is not in\n{text}");
    }
}
