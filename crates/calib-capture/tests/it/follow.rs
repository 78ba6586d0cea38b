//! A session whose postures a planner chooses: what it is told, what it is asked, and what the operator reads.

use std::cell::RefCell;
use std::rc::Rc;

use calib_capture::{
    Held, Instead, Key, Outcome, Planner, Progress, Session, Step, Table, Terminal,
};

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

    fn instead(&mut self) -> Instead {
        self.tell("instead");
        self.rest[0] = Step::at(vec![0.25]);
        Instead::Exchanged
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
    let path = folder.path().join("poses.csv");
    let mut scene = scene(&path, list);
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
    // The file knows what was not recorded, and reads as before.
    drop(told);
    drop(scene);
    let header = plan(JointSource::Udp(0), 1).header();
    let table = Table::append(&path, &header, None).expect("gone on with");
    let expected = [("waist".to_owned(), -0.4)].into();
    assert_eq!(table.exchanged, [expected]);
    assert_eq!(table.holds.len(), 1);
    assert!(!read(&path).timelines.is_empty());
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

/// A terminal of 24 rows, 80 columns: what is seen of the bytes that were written.
#[derive(Clone, Debug, Default)]
struct Rows(Rc<RefCell<Vec<u8>>>);

impl std::io::Write for Rows {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.borrow_mut().extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Rows {
    fn seen(&self) -> Vec<String> {
        const ROWS: usize = 24;
        const COLUMNS: usize = 80;
        let written = String::from_utf8(self.0.borrow().clone()).expect("text");
        let lines = written.split('\n').map(|line| {
            // A status line is erased and written again.
            line.rsplit("\r\x1b[K").next().unwrap_or_default()
        });
        let mut rows: Vec<String> = Vec::new();
        for line in lines {
            let letters: Vec<char> = line.chars().collect();
            match letters.is_empty() {
                true => rows.push(String::new()),
                false => rows.extend(letters.chunks(COLUMNS).map(|c| c.iter().collect())),
            }
        }
        rows.split_off(rows.len().saturating_sub(ROWS))
    }
}

/// Bodies are hidden, the robot trembles, postures are exchanged and repeated: what is asked, what is known and the state stay on the screen.
#[test]
fn a_terminal_of_24_rows_shows_the_question_the_state_and_sigma() {
    let folder = tempfile::tempdir().expect("folder");
    let list = list(&[-0.4, -0.2, 0.0, 0.2, 0.4]);
    let mut scene = scene(&folder.path().join("poses.csv"), list);
    let rows = Rows::default();
    scene.said.1 = Some(Box::new(Terminal::new(rows.clone())));
    scene.go(-0.4);
    scene.stay(120);
    let visible = |scene: &Scene, number: usize, waist: &str| {
        let seen = rows.seen();
        let question = format!("pose {number}/5: waist {waist}");
        let state = format!("pose {number}/5 · ");
        assert!(
            seen.iter().any(|r| r.starts_with(&question)),
            "{question}: {seen:#?}"
        );
        assert!(
            seen.iter().any(|r| r.contains("σ of the tool: ")),
            "{seen:#?}"
        );
        assert!(
            seen.last().is_some_and(|r| r.starts_with(&state)),
            "{seen:#?}"
        );
        assert!(scene.said.0.contains(&question));
    };
    visible(&scene, 2, "-11.46°");
    scene.go(-0.2);
    // Thirty holds are begun, and the robot moves in each.
    for _ in 0..30 {
        scene.stay(60);
        scene.go(-0.19);
        scene.go(-0.2);
    }
    visible(&scene, 2, "-11.46°");
    // The body is hidden in half of as many.
    for _ in 0..30 {
        scene.stay(25);
        (0..40).for_each(|_| scene.frame_of(false, true));
    }
    (0..400).for_each(|_| scene.frame_of(false, true));
    visible(&scene, 2, "-11.46°");
    scene.key(Key::Instead);
    scene.frame_of(true, true);
    visible(&scene, 2, "14.32°");
    scene.go(0.25);
    scene.stay(120);
    visible(&scene, 3, "0.0°");
    scene.key(Key::Repeat);
    scene.frame_of(true, true);
    visible(&scene, 2, "14.32°");
}
