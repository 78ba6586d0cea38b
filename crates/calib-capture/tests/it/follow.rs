//! A session whose postures a planner chooses: what it is told, what it is asked, and what the operator reads.

use std::cell::RefCell;
use std::rc::Rc;

use calib_capture::{Held, Key, Outcome, Planner, Progress, Session, Step, Table};

use crate::session::{Scene, plan, read};
use calib_capture::JointSource;

/// A list, and what was said to it.
#[derive(Debug, Default)]
struct List {
    rest: Vec<Step>,
    held: Vec<(Held, Step)>,
    told: Rc<RefCell<Vec<&'static str>>>,
    last: Rc<RefCell<Vec<Held>>>,
    reached_after: usize,
}

impl List {
    fn tell(&self, what: &'static str) {
        self.told.borrow_mut().push(what);
    }
}

impl Planner for List {
    fn rest(&self) -> Vec<Step> {
        self.rest.clone()
    }

    fn held(&mut self, held: Held) -> Outcome {
        self.tell("held");
        self.last.borrow_mut().push(held.clone());
        self.held.push((held, self.rest.remove(0)));
        Outcome {
            progress: Some(Progress {
                sigma: Some(1e-3 / self.held.len() as f64),
                expected: Some(1e-4),
            }),
            reached: (self.held.len() == self.reached_after).then_some(5e-4),
            replanned: false,
        }
    }

    fn passed(&mut self) {
        self.tell("passed");
        self.rest.remove(0);
    }

    fn forget(&mut self) {
        self.tell("forget");
        self.rest.extend(self.held.pop().map(|h| h.1));
        self.rest.rotate_right(1);
    }

    fn skipped(&mut self) {
        self.tell("skipped");
        self.rest.remove(0);
    }

    fn offer(&mut self) -> Option<Step> {
        Some(Step::at(vec![0.25]))
    }

    fn instead(&mut self) -> bool {
        self.tell("instead");
        self.rest[0] = Step::at(vec![0.25]);
        true
    }
}

/// Steps at these positions of the waist.
fn list(at: &[f64]) -> List {
    List {
        rest: at.iter().map(|q| Step::at(vec![*q])).collect(),
        ..List::default()
    }
}

fn scene(path: &std::path::Path, list: List) -> Scene {
    let mut plan = plan(JointSource::Udp(0), 1);
    plan.guide.steps.clear();
    let mut scene = Scene::new(&path.with_extension("unused"), plan.clone());
    let table = Table::create(path, &["test".to_string()], &plan.header()).expect("made");
    scene.session = Session::new(plan, table).following(Box::new(list));
    scene
}

fn said(scene: &Scene) -> String {
    scene
        .said
        .0
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn the_planner_is_told_what_was_held_and_decides_what_comes_next() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("poses.csv");
    let mut list = list(&[-0.3, 0.0, 0.1, 0.4]);
    list.rest[1].through = true;
    list.rest[2].blocked = true;
    list.reached_after = 2;
    let (told, last) = (list.told.clone(), list.last.clone());
    let mut scene = scene(&path, list);
    scene.go(-0.3);
    scene.stay(120);
    assert_eq!(*told.borrow(), ["held"]);
    // The way leads through the next one, where nothing is recorded.
    scene.go(0.1);
    assert_eq!(*told.borrow(), ["held", "passed"]);
    scene.stay(120);
    assert_eq!(*told.borrow(), ["held", "passed", "held"]);
    let said = said(&scene);
    let parts = [
        "on the way, not recorded: waist 0.0°; move through it",
        "pose 2/3: waist 5.73°; move there and hold still The straight motion may touch something",
        "σ of the tool: 1.00 mm now, 0.100 mm expected at the end",
        "The asked σ of 0.500 mm is reached.",
    ];
    for part in parts {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(scene.session.is_finished() && !said.contains("pose 3/3"));
    let held = last.borrow();
    assert!((held[1].joints["waist"] - 0.1).abs() < 1e-9, "{held:?}");
    assert!((held[1].joints["elbow"] - 0.2).abs() < 1e-9);
    assert!(held[1].seen.contains("hand") && held[1].seen.contains("tip"));
    let holds = &read(&path).timelines[0].labels["hold"];
    assert!(holds.contains(&"1".to_owned()) && holds.contains(&"2".to_owned()));
    // The same by the file that is gone on with.
    drop(said);
    drop(scene);
    let header = plan(JointSource::Udp(0), 1).header();
    let table = Table::append(&path, &header, None).expect("gone on with");
    assert_eq!(table.holds.len(), 2);
    for (of_file, live) in table.holds.iter().zip(held.iter()) {
        assert_eq!(of_file.seen, live.seen);
        for (name, q) in &live.joints {
            assert!((of_file.joints[name] - q).abs() < 1e-6, "{name}");
        }
    }
}

#[test]
fn a_hidden_body_is_said_with_what_to_do_and_the_last_pose_comes_again() {
    let folder = tempfile::tempdir().expect("folder");
    let list = list(&[-0.4, -0.2, 0.0, 0.2]);
    let told = list.told.clone();
    let mut scene = scene(&folder.path().join("poses.csv"), list);
    scene.go(-0.4);
    (0..280).for_each(|_| scene.frame_of(false, true));
    assert!(!said(&scene).contains("hidden"), "{}", said(&scene));
    (0..280).for_each(|_| scene.frame_of(false, true));
    let hint = "hand is hidden in this posture. n Enter = record the next best posture instead (waist 14.32°); s Enter";
    assert_eq!(said(&scene).matches(hint).count(), 1, "{}", said(&scene));
    scene.key(Key::Instead);
    assert!(
        said(&scene).contains("pose 1/4: waist 14.32°"),
        "{}",
        said(&scene)
    );
    scene.go(0.25);
    scene.stay(120);
    scene.key(Key::Repeat);
    scene.stay(120);
    scene.key(Key::Skip);
    let told = told.borrow();
    assert_eq!(*told, ["instead", "held", "forget", "held", "skipped"]);
    assert!(
        said(&scene).contains("pose 2/3: waist 0.0°"),
        "{}",
        said(&scene)
    );
}

/// A body that the plan knows to be hidden in a posture does not hold it up.
#[test]
fn a_body_that_is_expected_to_be_hidden_need_not_be_seen() {
    let folder = tempfile::tempdir().expect("folder");
    let mut list = list(&[-0.4, -0.2]);
    list.rest[0].unseen = vec![0];
    let told = list.told.clone();
    let mut scene = scene(&folder.path().join("poses.csv"), list);
    scene.go(-0.4);
    (0..120).for_each(|_| scene.frame_of(false, true));
    assert_eq!(*told.borrow(), ["held"]);
}
