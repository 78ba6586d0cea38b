//! A guided sweep without a network: frames and keys in, rows and lines out.

use calib_capture::{
    Frame, Guide, JointColumn, JointListener, JointSource, Key, Lines, Moved, Plan, Screen,
    Session, Table, Unit, Watched, WatchedKind, grid,
};
use calib_recording::{Filled, ReadOptions, Recording, read_path};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::path::Path;

pub(crate) fn plan(joints: JointSource, poses: usize) -> Plan {
    let ranges = vec![(-0.5, 0.5)];
    let column = |name: &str, fixed| JointColumn {
        name: name.into(),
        unit: Unit::Angle,
        fixed,
    };
    Plan {
        columns: vec![column("waist", None), column("elbow", Some(0.2))],
        joints,
        guide: Guide {
            joints: vec![0],
            steps: grid(&ranges, poses),
            ranges,
        },
        watched: vec![
            Watched {
                name: "hand".into(),
                from: "body_0".into(),
                kind: WatchedKind::Body,
            },
            Watched {
                name: "tip".into(),
                from: "body_3".into(),
                kind: WatchedKind::Marker,
            },
        ],
        moved: vec![Moved {
            name: "hand".into(),
            parts: vec![0],
        }],
        continuous: false,
        hold: 0.5,
        near: (0.02, 0.002),
        all: false,
        patience: 5.0,
        longest: None,
    }
}

fn at(waist: f64) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), waist);
    Isometry3::from_parts(
        Translation3::from(rotation * Vector3::new(0.8, 0.1, 1.0)),
        rotation,
    )
}

/// Keeps what the operator reads, and shows it on a screen where there is one.
#[derive(Default)]
pub(crate) struct Said(pub(crate) String, pub(crate) Option<Box<dyn Screen>>);

impl Screen for Said {
    fn line(&mut self, text: &str) {
        self.0 += text;
        self.0.push('\n');
        if let Some(screen) = &mut self.1 {
            screen.line(text);
        }
    }

    fn status(&mut self, text: &str, now: f64) {
        if let Some(screen) = &mut self.1 {
            screen.status(text, now);
        }
    }
}

/// A robot under a tracker of 100 Hz.
pub(crate) struct Scene {
    pub(crate) session: Session<'static>,
    pub(crate) said: Said,
    listener: Option<JointListener>,
    number: u64,
    waist: f64,
    /// What the robot says beside where the body is, rad.
    said_beside: f64,
}

impl Scene {
    pub(crate) fn new(path: &Path, plan: Plan) -> Scene {
        let table = Table::create(path, &["test".to_string()], &plan.header()).expect("made");
        let listener = matches!(plan.joints, JointSource::Udp(_))
            .then(|| JointListener::open(0).expect("a free port"));
        Scene {
            session: Session::new(plan, table),
            said: Said::default(),
            listener,
            number: 0,
            waist: -0.5,
            said_beside: 0.0,
        }
    }

    fn now(&self) -> f64 {
        1000.0 + self.number as f64 * 0.01
    }

    pub(crate) fn key(&mut self, key: Key) {
        self.session.key(key, &mut self.said).expect("written");
    }

    fn frame(&mut self, with_tip: bool) {
        self.frame_of(true, with_tip);
    }

    pub(crate) fn frame_of(&mut self, with_hand: bool, with_tip: bool) {
        let now = self.now();
        if let Some(listener) = &mut self.listener {
            let waist = self.waist + self.said_beside;
            listener.datagram(format!("waist_rad={waist}").as_bytes(), now);
        }
        let mut frame = Frame {
            number: Some(self.number),
            device: Some(self.number as f64 * 0.01),
            ..Frame::default()
        };
        if with_hand {
            frame.bodies.insert("body_0".into(), at(self.waist));
        }
        if with_tip {
            frame.bodies.insert("body_3".into(), at(self.waist + 0.1));
        }
        self.number += 1;
        self.session
            .frame(&frame, now, self.listener.as_ref(), &mut self.said)
            .expect("written");
        self.said.status(&self.session.status(now), now);
    }

    pub(crate) fn go(&mut self, to: f64) {
        while (to - self.waist).abs() > 1e-9 {
            self.waist += (to - self.waist).clamp(-0.01, 0.01);
            self.frame(true);
        }
    }

    pub(crate) fn stay(&mut self, frames: usize) {
        (0..frames).for_each(|i| self.frame(i % 4 != 0));
    }
}

pub(crate) fn read(path: &Path) -> Recording {
    read_path(path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_guided_sweep_with_commanded_joints() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("sweep.csv");
    let mut scene = Scene::new(&path, plan(JointSource::Targets, 3));
    let mut out = Lines::new(Vec::new());
    scene.session.announce(&mut out);
    scene.stay(100);
    // Nobody said that the robot is there: nothing is written.
    assert_eq!(scene.session.summary().rows, 0);
    scene.key(Key::There);
    scene.stay(80);
    scene.go(0.0);
    scene.key(Key::Skip);
    scene.go(0.5);
    scene.key(Key::There);
    // It moves once more while it is held.
    scene.stay(45);
    scene.go(0.52);
    scene.go(0.5);
    scene.stay(120);
    assert!(scene.session.is_finished());
    scene.session.report(&mut scene.said);
    drop(scene.session);
    let recording = read(&path);
    let timeline = &recording.timelines[0];
    let holds = &timeline.labels["hold"];
    assert!(holds.iter().all(|h| h == "1" || h == "3"), "{holds:?}");
    let t = timeline.t.as_ref().expect("device times");
    let host = timeline.received.as_ref().expect("host times");
    assert!(
        t.iter()
            .zip(host)
            .all(|(t, host)| (host - t - 1000.0).abs() < 1e-6)
    );
    let poses = recording.poses(Filled::Exclude).expect("a table");
    for (row, hold) in holds.iter().enumerate() {
        let target = if hold == "1" { -0.5 } else { 0.5 };
        assert!((poses.joints["waist"][row].expect("held") - target).abs() < 1e-6);
        assert!((poses.joints["elbow"][row].expect("fixed") - 0.2).abs() < 1e-6);
        let hand = poses.bodies["hand"][row].expect("seen");
        assert!((hand.translation.vector - at(target).translation.vector).norm() < 2e-3);
    }
    assert!(poses.markers["tip"].iter().any(Option::is_none));
}

#[test]
fn the_lines_of_a_sweep() {
    let folder = tempfile::tempdir().expect("folder");
    let mut scene = Scene::new(&folder.path().join("a.csv"), plan(JointSource::Targets, 2));
    let lines = {
        let mut buffer = Vec::new();
        let mut screen = Lines::new(&mut buffer);
        let session = &mut scene.session;
        session.announce(&mut screen);
        session.foreign(
            "4 bytes that begin `ping`, expected `fr <number>`",
            &mut screen,
        );
        session.foreign("again", &mut screen);
        session.key(Key::There, &mut screen).expect("written");
        let mut number = 0;
        let mut run =
            |session: &mut Session, screen: &mut Lines<&mut Vec<u8>>, n: u64, waist: f64| {
                for _ in 0..n {
                    number += 1;
                    let mut frame = Frame {
                        number: Some(2 * number),
                        device: Some(number as f64 * 0.01),
                        unlabeled: 1,
                        ..Frame::default()
                    };
                    frame.bodies.insert("body_0".into(), at(waist));
                    session
                        .frame(&frame, 50.0 + number as f64 * 0.01, None, screen)
                        .expect("written");
                }
            };
        run(session, &mut screen, 80, -0.5);
        use calib_capture::Screen as _;
        screen.line(&session.status(50.9));
        session.key(Key::There, &mut screen).expect("written");
        run(session, &mut screen, 90, 0.5);
        screen.line(&session.status(51.8));
        session.report(&mut screen);
        String::from_utf8(buffer).expect("text")
    };
    assert!(lines.lines().all(|line| line.chars().count() <= 80));
    insta::assert_snapshot!(lines);
}

#[test]
fn measured_joints_say_when_the_robot_is_there() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("sweep.csv");
    let mut scene = Scene::new(&path, plan(JointSource::Udp(0), 3));
    for target in [-0.5, 0.0, 0.5] {
        scene.go(target);
        scene.stay(110);
    }
    assert!(scene.session.is_finished());
    assert_eq!(scene.session.summary().poses, 3);
    let (low, high) = scene.session.summary().covered["waist"];
    assert!((low + 0.5).abs() < 0.03 && (high - 0.5).abs() < 0.03);
}

#[test]
fn a_joint_that_moves_is_not_held_though_the_bodies_stand_still() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("sweep.csv");
    let mut scene = Scene::new(&path, plan(JointSource::Udp(0), 3));
    // 0.02 rad/s, within what is near the target.
    for i in 0..80 {
        scene.said_beside = 0.0002 * f64::from(i);
        scene.stay(1);
    }
    assert_eq!(scene.session.summary().poses, 0, "{}", scene.said.0);
    let why = "waist moved by 0.3°: the hold starts over.";
    assert!(scene.said.0.contains(why), "{}", scene.said.0);
    scene.stay(60);
    assert_eq!(scene.session.summary().poses, 1, "{}", scene.said.0);
}

#[test]
fn a_pose_away_from_the_target_is_not_taken() {
    let folder = tempfile::tempdir().expect("folder");
    let mut scene = Scene::new(&folder.path().join("a.csv"), plan(JointSource::Udp(0), 3));
    scene.go(-0.3);
    scene.stay(300);
    assert_eq!(scene.session.summary().rows, 0);
}

#[test]
fn poses_of_ones_own_choice() {
    let folder = tempfile::tempdir().expect("folder");
    let mut free = plan(JointSource::Udp(0), 3);
    free.guide = Guide::default();
    let mut scene = Scene::new(&folder.path().join("a.csv"), free);
    scene.stay(300);
    // One pose, however long it is held.
    assert_eq!(scene.session.summary().poses, 1);
    scene.go(0.3);
    scene.stay(100);
    assert_eq!(scene.session.summary().poses, 2);
    assert!(!scene.session.is_finished());
}

#[test]
fn everything_is_written_when_asked() {
    let folder = tempfile::tempdir().expect("folder");
    let mut all = plan(JointSource::Udp(0), 3);
    all.all = true;
    let mut scene = Scene::new(&folder.path().join("a.csv"), all);
    scene.go(0.0);
    scene.stay(50);
    assert_eq!(scene.session.summary().rows, scene.number);
}

#[test]
fn what_was_held_before_is_left_out() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("a.csv");
    let mut scene = Scene::new(&path, plan(JointSource::Udp(0), 3));
    scene.stay(100);
    assert_eq!(scene.session.summary().poses, 1);
    drop(scene);
    let plan = plan(JointSource::Udp(0), 3);
    let table = Table::append(&path, &plan.header(), None).unwrap_or_else(|e| panic!("{e}"));
    assert!(table.rows > 40, "{}", table.rows);
    let session = Session::new(plan, table);
    assert_eq!(session.step().map(|s| s.targets[0]), Some(0.0));
}

/// Rows of each hold, in the order of the file.
fn holds(path: &Path) -> Vec<(String, usize)> {
    let recording = read(path);
    let mut counts: Vec<(String, usize)> = Vec::new();
    for hold in &recording.timelines[0].labels["hold"] {
        match counts.last_mut() {
            Some((last, count)) if last == hold => *count += 1,
            _ => counts.push((hold.clone(), 1)),
        }
    }
    counts
}

#[test]
fn a_pose_in_which_the_swept_body_is_hidden_does_not_count() {
    for (visible, counts) in [(0, false), (5, false), (60, true)] {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("sweep.csv");
        let mut scene = Scene::new(&path, plan(JointSource::Targets, 2));
        scene.key(Key::There);
        scene.stay(40);
        // The hold has begun; from now on the hand is seen in so many of a hundred frames.
        for i in 0..120 {
            scene.frame_of(i % 100 < visible, true);
        }
        let summary = scene.session.summary();
        assert_eq!((summary.poses == 1), counts, "{visible}");
        assert_eq!(summary.missing, if counts { vec![2] } else { vec![1, 2] });
        // Whatever was seen, no part of a hold that does not count is in the file.
        drop(scene);
        let text = std::fs::read_to_string(&path).expect("there");
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        assert_eq!(lines.count() > 1, counts, "{visible}");
    }
}

#[test]
fn a_hidden_body_is_waited_for_and_said() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("sweep.csv");
    let mut scene = Scene::new(&path, plan(JointSource::Targets, 2));
    scene.stay(10);
    assert!(
        scene
            .session
            .status(scene.now())
            .contains("press Enter at the pose")
    );
    scene.key(Key::There);
    (0..100).for_each(|_| scene.frame_of(false, true));
    assert!(scene.session.status(scene.now()).contains("hand is hidden"));
    assert_eq!(scene.session.summary().poses, 0);
    // It comes back: the pose is held without another key.
    scene.stay(110);
    assert_eq!(scene.session.summary().poses, 1);
    // The next one is taken without it, as the operator wants.
    scene.go(0.5);
    scene.key(Key::There);
    (0..60).for_each(|_| scene.frame_of(false, true));
    assert_eq!(scene.session.summary().poses, 1);
    scene.key(Key::Keep);
    (0..110).for_each(|_| scene.frame_of(false, true));
    assert!(scene.session.is_finished());
    drop(scene);
    let names: Vec<String> = holds(&path).into_iter().map(|(hold, _)| hold).collect();
    assert_eq!(names, ["1", "2"]);
}

#[test]
fn the_broken_part_of_a_hold_is_not_in_the_file() {
    for all in [false, true] {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("sweep.csv");
        let mut everything = plan(JointSource::Targets, 2);
        everything.all = all;
        let mut scene = Scene::new(&path, everything);
        scene.key(Key::There);
        scene.stay(60);
        scene.go(-0.47);
        scene.go(-0.5);
        scene.stay(110);
        assert_eq!(scene.session.summary().poses, 1);
        let (rows, frames) = (scene.session.summary().rows, scene.number);
        drop(scene);
        let of_hold: Vec<(String, usize)> =
            holds(&path).into_iter().filter(|(h, _)| h == "1").collect();
        assert_eq!(of_hold.len(), 1, "one piece: {of_hold:?}");
        assert!((50..=52).contains(&of_hold[0].1), "{of_hold:?}");
        if all {
            assert_eq!(rows, frames);
        }
    }
}

#[test]
fn the_last_pose_is_repeated_and_stands_once_in_the_file() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("sweep.csv");
    let mut scene = Scene::new(&path, plan(JointSource::Udp(0), 3));
    scene.stay(110);
    scene.go(0.0);
    scene.stay(110);
    assert_eq!(scene.session.summary().poses, 2);
    scene.key(Key::Repeat);
    assert_eq!(scene.session.summary().missing, [2, 3]);
    // Only the last one: the first is no longer at hand.
    scene.key(Key::Repeat);
    assert_eq!(scene.session.summary().poses, 1);
    let first = scene.number;
    scene.stay(110);
    scene.go(0.5);
    scene.stay(110);
    assert!(scene.session.is_finished());
    drop(scene);
    let names: Vec<String> = holds(&path).into_iter().map(|(hold, _)| hold).collect();
    assert_eq!(names, ["1", "2", "3"]);
    let recording = read(&path);
    let timeline = &recording.timelines[0];
    let t = timeline.t.as_ref().expect("times");
    let second = timeline.labels["hold"]
        .iter()
        .position(|h| h == "2")
        .expect("held");
    assert!(t[second] >= first as f64 * 0.01, "its first rows are gone");
}

#[test]
fn what_is_missing_in_a_file_is_asked_for_again() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("a.csv");
    let mut scene = Scene::new(&path, plan(JointSource::Udp(0), 4));
    scene.stay(100);
    scene.key(Key::Skip);
    scene.go(0.5 / 3.0);
    scene.stay(100);
    assert_eq!(scene.session.summary().missing, [2, 4]);
    // Half a hold of the last one.
    scene.go(0.5);
    scene.stay(50);
    drop(scene);
    let again = plan(JointSource::Udp(0), 4);
    let table = Table::append(&path, &again.header(), None).unwrap_or_else(|e| panic!("{e}"));
    let session = Session::new(again, table);
    assert_eq!(session.missing(), [2, 4]);
    assert!((session.step().expect("a pose").targets[0] + 0.5 / 3.0).abs() < 1e-12);
}

#[test]
fn the_status_says_what_a_pose_waits_for() {
    let folder = tempfile::tempdir().expect("folder");
    let mut scene = Scene::new(&folder.path().join("a.csv"), plan(JointSource::Udp(0), 3));
    let mut statuses = Vec::new();
    let mut note = |scene: &Scene| statuses.push(scene.session.status(scene.now()));
    scene.go(-0.3);
    note(&scene);
    // The robot's program stops.
    scene.listener = Some(JointListener::open(0).expect("a free port"));
    let silent = |scene: &mut Scene, names: &str| {
        let now = scene.now();
        let mut frame = Frame {
            number: Some(scene.number),
            device: Some(scene.number as f64 * 0.01),
            ..Frame::default()
        };
        frame.bodies.insert("body_0".into(), at(scene.waist));
        scene.number += 1;
        let listener = scene.listener.as_mut().expect("open");
        listener.datagram(names.as_bytes(), now);
        let listener = scene.listener.as_ref();
        scene
            .session
            .frame(&frame, now, listener, &mut scene.said)
            .expect("written");
    };
    silent(&mut scene, "hello");
    note(&scene);
    silent(&mut scene, "waist_x_deg=3 lift_m=0.2");
    note(&scene);
    // It is there, but still trembles: ten times a second. From frame to frame it would be noise of the tracker.
    scene.go(-0.5);
    for i in 0..40 {
        scene.waist = -0.5 + 0.004 * f64::from(i / 5 % 2);
        scene.frame(true);
    }
    note(&scene);
    insta::assert_snapshot!(statuses.join("\n"));
}

#[test]
fn a_motion_has_no_poses() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("a.csv");
    let mut motion = plan(JointSource::Udp(0), 3);
    motion.guide = Guide::default();
    motion.moved.clear();
    motion.continuous = true;
    let mut scene = Scene::new(&path, motion);
    scene.go(0.5);
    scene.stay(100);
    assert!(!scene.session.is_finished());
    let status = scene.session.status(scene.now());
    assert!(
        status.starts_with(&format!("{} rows · recording", scene.number)),
        "{status}"
    );
    assert_eq!(scene.session.summary().rows, scene.number);
    drop(scene);
    assert_eq!(holds(&path).len(), 1);
}

#[test]
fn after_a_restart_of_the_tracker_nothing_advises_to_append() {
    for restarts in [false, true] {
        let folder = tempfile::tempdir().expect("folder");
        let mut scene = Scene::new(&folder.path().join("a.csv"), plan(JointSource::Targets, 3));
        scene.key(Key::There);
        scene.stay(110);
        scene.go(0.0);
        scene.key(Key::Skip);
        if restarts {
            scene.number = 0;
            scene.stay(60);
        }
        scene.session.report(&mut scene.said);
        let said = &scene.said.0;
        assert!(said.contains("missing: pose 2"), "{said}");
        assert_eq!(said.contains("in a new file"), restarts, "{said}");
        assert_eq!(said.contains("--append"), !restarts, "{said}");
    }
}
