//! `calib record --plan`: a simulated robot goes where the program asks it to, a simulated tracker sees it, both over the loopback.

use crate::scratch;

use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader, Write as _};
use std::net::UdpSocket;
use std::process::{Child, ChildStdin};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use calib_pipeline::prepare::load::{RobotProfile, load_robot};
use nalgebra::Isometry3;
use scratch::Scratch;
use serde_json::Value;

use crate::record::{datagram, free_port, rows, start};

/// A four-axis arm without shapes: a plan takes no time.
const URDF: &str = r#"<robot name="arm"><link name="l0"/><link name="l1"/><link name="l2"/><link name="l3"/><link name="l4"/>
<joint name="j1" type="revolute"><parent link="l0"/><child link="l1"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="9" velocity="2"/></joint>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0.05 0 0.1"/><axis xyz="0 1 0"/>
<limit lower="-1.2" upper="1.2" effort="9" velocity="2"/></joint>
<joint name="j3" type="revolute"><parent link="l2"/><child link="l3"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
<limit lower="-1.4" upper="1.4" effort="9" velocity="2"/></joint>
<joint name="j4" type="revolute"><parent link="l3"/><child link="l4"/><origin xyz="0.3 0 0"/><axis xyz="1 0 0"/>
<limit lower="-2.5" upper="2.5" effort="9" velocity="2"/></joint></robot>
"#;

const PROFILE: &str = "calib: 1
robot: {name: arm, urdf: arm.urdf}
tracker: {frame: room, body_sigma_mm: 0.2, body_sigma_deg: 0.05}
bodies:
  hand: {link: l4, pose: true}
recordings:
  poses: {file: poses.csv, use: static, timing: {poses: settle, hold_s: 0.2}}
  checks: {file: checks.csv, use: validation, timing: {poses: settle, hold_s: 0.2}}
  sweep: {file: sweep.csv, use: sweep, joints: {j3_deg: [-60, 60], j4_deg: [-90, 90]}}
solve: {free: [bodies, tracker, joint_offsets, joint_axes]}
simulate:
  seed: 3
  tracker_from_root: {xyz_mm: [900, 200, 100], rpy_deg: [0, 0, 120]}
  mounts: {hand: {xyz_mm: [40, 10, 30]}}
  noise: {body_mm: 0.2, body_deg: 0.05}
  recordings:
    poses: {random: {j1_deg: [-90, 90]}, poses: 4}
";

/// The arm with a plan of so many postures.
fn planned(poses: &str) -> Scratch {
    planned_for(URDF, PROFILE, poses)
}

fn planned_for(urdf: &str, profile: &str, poses: &str) -> Scratch {
    let dir = Scratch::new()
        .file("arm.urdf", urdf)
        .file("arm.yaml", profile);
    let ran = dir.calib([
        "plan",
        "arm.yaml",
        "--poses",
        poses,
        "--candidates",
        "256",
        "--out",
        "plan",
    ]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    dir
}

/// The program, the robot that it guides and the tracker that sees it.
struct Cell {
    robot: RobotProfile,
    child: Child,
    stdin: Option<ChildStdin>,
    said: Receiver<String>,
    all: Vec<String>,
    socket: UdpSocket,
    /// Ports of tracker and robot.
    to: (u16, u16),
    sends_joints: bool,
    number: u64,
    q: BTreeMap<String, f64>,
}

impl Cell {
    /// Begins at this time of the tracker, in frames.
    fn new(dir: &Scratch, recording: &str, sends_joints: bool, number: u64, more: &[&str]) -> Self {
        let to = (free_port(), free_port());
        let (source, joints) = (format!("dtrack:{}", to.0), format!("udp:{}", to.1));
        let mut arguments = vec![
            "record",
            "arm.yaml",
            "--recording",
            recording,
            "--plan",
            "plan/plan.yaml",
            "--source",
            &source,
            "--map",
            "hand=body_0",
            "--hold",
            "0.04",
            "--json",
        ];
        if sends_joints {
            arguments.extend(["--joints", &joints]);
        }
        arguments.extend(more);
        let mut child = start(dir, &arguments);
        let (send, said) = channel();
        let stderr = child.stderr.take().expect("piped");
        std::thread::spawn(move || {
            for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                let line: Value = serde_json::from_str(&line).unwrap_or(Value::String(line));
                let text = line["progress"].as_str().map(str::to_owned);
                if send.send(text.unwrap_or(line.to_string())).is_err() {
                    return;
                }
            }
        });
        Self {
            robot: load_robot(&dir.path("arm.yaml")).expect("a profile"),
            stdin: child.stdin.take(),
            child,
            said,
            all: Vec::new(),
            socket: UdpSocket::bind("127.0.0.1:0").expect("a free port"),
            to,
            sends_joints,
            number,
            q: BTreeMap::new(),
        }
    }

    /// The tracker sends some frames; its clock runs faster than ours, so that the test is short.
    fn send(&mut self, frames: usize, visible: bool) {
        let model = &self.robot.model;
        let mut q = model.zero_positions();
        for (name, value) in &self.q {
            q[model.joint_id(name).expect("a joint").index()] = value.to_radians();
        }
        let simulated = self.robot.profile.simulate.as_ref().expect("a section");
        let link = self.robot.profile.bodies["hand"].link;
        let hand: Isometry3<f64> = simulated.tracker_from_root
            * model.root_from_link(&q, link)
            * simulated.mounts["hand"].link_from_body;
        let joints: Vec<String> = model
            .independent_joints()
            .map(|id| {
                format!(
                    "{}_deg={}",
                    model.joint(id).name,
                    q[id.index()].to_degrees()
                )
            })
            .collect();
        let bodies = [(0, hand)];
        for _ in 0..frames {
            if self.sends_joints {
                let _ = self
                    .socket
                    .send_to(joints.join(" ").as_bytes(), ("127.0.0.1", self.to.1));
            }
            let seen = &bodies[..usize::from(visible)];
            let bytes = datagram(self.number, self.number as f64 * 0.05, seen);
            let _ = self.socket.send_to(&bytes, ("127.0.0.1", self.to.0));
            self.number += 1;
            std::thread::sleep(Duration::from_millis(3));
        }
    }

    /// What the program has said since; sends meanwhile until it says `what`.
    fn until(&mut self, what: &str, visible: bool) -> String {
        let began = Instant::now();
        loop {
            self.send(3, visible);
            while let Ok(line) = self.said.try_recv() {
                self.all.push(line.clone());
                if line.contains(what) {
                    return line;
                }
            }
            let ended = matches!(self.child.try_wait(), Ok(Some(_)));
            let late = began.elapsed() > Duration::from_secs(60);
            assert!(!ended && !late, "no {what}: {:#?}", self.all);
        }
    }

    /// Goes to the posture that a line names.
    fn goes(&mut self, line: &str) {
        let words: Vec<&str> = line.split([' ', ',', ';']).collect();
        for (name, value) in words.iter().zip(&words[1..]) {
            if let Some(degrees) = value.strip_suffix('°') {
                let degrees = degrees.parse().expect("a number");
                self.q.insert((*name).to_owned(), degrees);
            }
        }
    }

    fn presses(&mut self, key: &str) {
        let stdin = self.stdin.as_mut().expect("open");
        stdin
            .write_all(format!("{key}\n").as_bytes())
            .expect("heard");
    }

    /// Goes through this many postures as they are asked for.
    fn follows(&mut self, postures: usize) {
        for _ in 0..postures {
            let line = self.until("pose ", true);
            self.goes(&line);
            if !self.sends_joints {
                self.presses("");
            }
            self.until("held ", true);
        }
    }

    /// How it ended, and everything that it said.
    fn ends(mut self) -> (Option<i32>, String) {
        drop(self.stdin.take());
        let status = self.child.wait().expect("ended");
        self.all.extend(self.said.iter());
        (status.code(), self.all.join("\n"))
    }
}

/// `0.123` of `σ of the tool: 0.123 mm now, …`.
fn sigma(said: &str) -> f64 {
    let last = said
        .lines()
        .rfind(|l| l.contains("σ of the tool: "))
        .expect("a σ");
    let after = last.split("σ of the tool: ").nth(1).expect("a number");
    let number = after.split(' ').next().expect("a number");
    number.parse().unwrap_or_else(|_| panic!("{last}"))
}

/// A robot that sends its joints: the list is followed, the rest chosen again after 15 postures, and the file is what `calib run` takes.
#[test]
fn a_plan_is_followed_to_its_end() {
    let dir = planned("17");
    let plan = dir.read("plan/plan.yaml");
    let expected = plan
        .lines()
        .find_map(|l| l.strip_prefix("sigma_after_mm: "));
    let expected: f64 = expected.expect("determined").parse().expect("a number");
    let mut cell = Cell::new(&dir, "poses", true, 100, &[]);
    cell.follows(17);
    let (code, said) = cell.ends();
    assert_eq!(code, Some(0), "{said}");
    let parts = [
        "17 postures of plan/plan.yaml to record",
        "pose 1/17: j1 ",
        "2 postures still to come were chosen again",
        "ended: all poses recorded",
        "and 17 of 17 poses in the file",
    ];
    for part in parts {
        assert!(said.contains(part), "{part}: {said}");
    }
    let reached = sigma(&said);
    assert!(
        (reached / expected - 1.0).abs() < 0.1,
        "{reached} {expected}"
    );
    // Every hold is one pose of the recording; a machine that stands still for long may cost some.
    let profile = PROFILE.split("  checks:").next().expect("a part");
    let ran = dir.file("arm.yaml", profile).calib(["check", "arm.yaml"]);
    // The cell computes what it sends from the nominal robot: that is no measurement, and nothing else is wrong.
    let errors = ran.stdout.matches("error[").count();
    let said = ran.stdout.contains("error[not-measured]");
    assert!(
        ran.code == 3 && errors == 1 && said,
        "{}{}",
        ran.stdout,
        ran.stderr
    );
    let poses = ran.stdout.split("static poses, ").nth(1);
    let poses = poses.and_then(|rest| rest.split(' ').next()?.parse().ok());
    assert!(poses.is_some_and(|n: usize| n > 12), "{}", ran.stdout);
}

/// An arm of seven joints, of which a grid would have 280 000 postures: the plan has its own.
#[test]
fn a_plan_of_seven_joints_is_followed() {
    let more: String = (5..8)
        .map(|k| {
            let axis = if k == 6 { "1 0 0" } else { "0 1 0" };
            format!(
                r#"<link name="l{k}"/><joint name="j{k}" type="revolute"><parent link="l{}"/><child link="l{k}"/><origin xyz="0.15 0 0.02"/><axis xyz="{axis}"/>
<limit lower="-1.5" upper="1.5" effort="9" velocity="2"/></joint>"#,
                k - 1
            )
        })
        .collect();
    let urdf = URDF.replace("</robot>", &format!("{more}</robot>"));
    let profile = PROFILE.replace("link: l4", "link: l7");
    let dir = planned_for(&urdf, &profile, "12");
    let mut cell = Cell::new(&dir, "poses", true, 100, &[]);
    cell.follows(2);
    cell.presses("q");
    let (code, said) = cell.ends();
    assert_eq!(code, Some(0), "{said}");
    let parts = ["12 postures of plan/plan.yaml to record", "pose 1/12: j1 "];
    for part in parts {
        assert!(said.contains(part), "{part}: {said}");
    }
}

/// A person who presses Enter: skips, is interrupted, goes on where the file ends, and stops at the asked σ.
#[test]
fn a_plan_goes_on_after_an_interruption_and_stops_at_the_asked_sigma() {
    let dir = planned("12");
    let mut cell = Cell::new(&dir, "poses", false, 100, &[]);
    cell.follows(2);
    let third = cell.until("pose 3/12", true);
    cell.presses("s");
    let other = cell.until("pose 3/11", true);
    assert_ne!(third.split(':').nth(1), other.split(':').nth(1));
    cell.presses("q");
    let number = cell.number;
    let (code, said) = cell.ends();
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("poses of the plan are still to come"),
        "{said}"
    );
    let before = rows(&dir.path("poses.csv")).len();
    // What it asks for now are the ten that the file does not have.
    let mut cell = Cell::new(
        &dir,
        "poses",
        false,
        number,
        &["--append", "--sigma-mm", "2"],
    );
    let line = cell.until("pose 3/12", true);
    cell.goes(&line);
    cell.presses("");
    cell.until("held ", true);
    while !cell.all.iter().any(|l| l.contains("is reached")) {
        let line = cell.until("", true);
        if line.contains("pose ") {
            cell.goes(&line);
            cell.presses("");
        }
    }
    let (code, said) = cell.ends();
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("ended: what was asked for is reached"),
        "{said}"
    );
    assert!(sigma(&said) <= 2.0, "{said}");
    let after = rows(&dir.path("poses.csv")).len();
    assert!(after > before, "{said}");
}

/// `n` takes another posture, which the file knows: what it replaced is not asked for after an interruption.
#[test]
fn a_posture_that_was_exchanged_is_not_asked_for_again() {
    let dir = planned("12");
    let asked = |line: &str| line.split(": ").nth(1).expect("a posture").to_owned();
    let mut cell = Cell::new(&dir, "poses", false, 100, &[]);
    cell.follows(1);
    let given_up = asked(&cell.until("pose 2/12", true));
    cell.presses("n");
    cell.until("Another posture takes the place", true);
    let other = cell.until("pose 2/12", true);
    assert_ne!(asked(&other), given_up);
    cell.goes(&other);
    cell.presses("");
    cell.until("held ", true);
    cell.presses("q");
    let number = cell.number;
    let (code, said) = cell.ends();
    assert_eq!(code, Some(0), "{said}");
    let joints = |line: &str| -> Vec<String> {
        let shown = line.split(';').next().unwrap_or_default();
        shown.split(", ").map(str::to_owned).collect()
    };
    let mut cell = Cell::new(&dir, "poses", false, number, &["--append"]);
    let mut line = cell.until("pose 3/12", true);
    for next in 4..=12 {
        assert_ne!(joints(&asked(&line)), joints(&given_up));
        cell.presses("s");
        // Skipped ones are out of the list, which gets shorter.
        line = cell.until("pose ", true);
        assert!(line.contains(&format!("/{}", 15 - next)), "{next}: {line}");
        if next == 12 {
            break;
        }
    }
    cell.presses("q");
    let (code, said) = cell.ends();
    assert_eq!(code, Some(0), "{said}");
}

/// The held-out postures go into the recording that validates; no σ follows from them.
#[test]
fn held_out_postures_are_asked_for_in_a_recording_that_validates() {
    let dir = planned("12");
    let mut cell = Cell::new(&dir, "checks", true, 100, &[]);
    // One that is asked for later comes at the end: nothing takes its place.
    let first = cell.until("pose 1/3: ", true);
    cell.presses("n");
    cell.until("This posture is asked for at the end.", true);
    let place = |line: &str| line.split([':', ';']).nth(1).map(str::to_owned);
    assert_ne!(place(&cell.until("pose 1/3: ", true)), place(&first));
    cell.presses("n");
    cell.until("pose 1/3: ", true);
    cell.presses("n");
    cell.follows(3);
    let (code, said) = cell.ends();
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("3 held-out postures of plan/plan.yaml"),
        "{said}"
    );
    assert!(!said.contains("σ of the tool"), "{said}");
}

#[test]
fn a_plan_that_does_not_fit_is_refused_before_anything_is_written() {
    let dir = planned("12").file("other.yaml", PROFILE.replace("name: arm", "name: leg"));
    let dir = dir
        .file(
            "narrow.yaml",
            PROFILE.to_owned() + "plan: {joints: {j2_deg: [0, 5]}}\n",
        )
        .file(
            "held.yaml",
            PROFILE.replace(
                "use: static, timing",
                "use: static, hold: {j3_deg: 5}, timing",
            ),
        )
        .file(
            "blocked.yaml",
            PROFILE.to_owned() + "plan: {ground_mm: 400}\n",
        )
        .file(
            "noisy.yaml",
            PROFILE.replace("body_sigma_mm: 0.2", "body_sigma_mm: 0.9"),
        )
        .file("none.yaml", "calib_plan: 2\n");
    let before = dir.files("");
    let cases = [
        (
            "other.yaml",
            "poses",
            "plan/plan.yaml",
            3,
            "the plan is for `arm`, other.yaml describes `leg`",
        ),
        (
            "narrow.yaml",
            "poses",
            "plan/plan.yaml",
            3,
            "outside the range that joint `j2` has now",
        ),
        (
            "noisy.yaml",
            "poses",
            "plan/plan.yaml",
            3,
            "have changed since",
        ),
        (
            "held.yaml",
            "poses",
            "plan/plan.yaml",
            2,
            "the plan moves joint `j3`, recording `poses` holds it",
        ),
        (
            "arm.yaml",
            "sweep",
            "plan/plan.yaml",
            2,
            "choose a recording with `use: static`",
        ),
        ("arm.yaml", "poses", "none.yaml", 3, "give the `plan.yaml`"),
        ("arm.yaml", "poses", "missing.yaml", 3, "missing.yaml"),
    ];
    for (profile, recording, plan, code, expected) in cases {
        let ran = dir.calib([
            "record",
            profile,
            "--recording",
            recording,
            "--plan",
            plan,
            "--source",
            "dtrack:0",
            "--patience",
            "0.1",
        ]);
        assert!(
            ran.code == code && ran.stderr.contains(expected),
            "{profile}: {} {}",
            ran.code,
            ran.stderr
        );
        assert!(ran.stderr.contains("help: "), "{}", ran.stderr);
    }
    assert_eq!(dir.files(""), before);
}
