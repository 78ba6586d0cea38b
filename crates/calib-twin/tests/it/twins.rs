//! Whole twins of a small robot.

use calib_pipeline::formulate::formulation::MlFit;
use calib_pipeline::options::Plugins;
use calib_pipeline::prepare::load::load_robot;
use calib_pipeline::verify::residuals::left_out;
use calib_plan::Known;
use calib_recording::{WriteOptions, write_poses};
use calib_twin::replay::Replay;
use calib_twin::{About, Options, Session, Source, Twin, quantity, terminal, twin, write};

use crate::robots::{Seen, THREE, profile, recorded, robot, three};

fn session(seed: u64) -> Session {
    let inputs = three(Seen::Markers(3), 14, seed);
    Session::new(inputs, About::Found, None, Vec::new()).unwrap_or_else(|e| panic!("{e}"))
}

fn made(session: &Session, options: &Options) -> Twin {
    let made = twin(session, Source::Recordings, options, &|_, _| {});
    made.unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_twin_that_was_stopped_goes_on_to_the_same_bytes_whatever_the_threads() {
    let session = session(4);
    let folder = tempfile::tempdir().expect("a folder");
    let options = |trials, threads, out: bool| Options {
        trials,
        threads: Some(threads),
        out: out.then(|| folder.path().to_path_buf()),
        sigma: Some(1e-4),
        ..Options::default()
    };
    let whole = made(&session, &options(10, 2, false));
    made(&session, &options(4, 1, true));
    let resumed = made(&session, &options(10, 1, true));
    let text = write::json(&whole).expect("JSON");
    assert_eq!(text, write::json(&resumed).expect("JSON"));
    // A line that was being written is made again.
    let state = folder.path().join("twin.state.jsonl");
    let bytes = std::fs::read(&state).expect("a state");
    std::fs::write(&state, &bytes[..bytes.len() - bytes.len() / 3]).expect("cut");
    let again = made(&session, &options(10, 2, true));
    assert_eq!(text, write::json(&again).expect("JSON"));
    assert_eq!(bytes, std::fs::read(&state).expect("a state"));
    let other = Options {
        seed: 2,
        ..options(10, 1, true)
    };
    let refused = twin(&session, Source::Recordings, &other, &|_, _| {}).expect_err("another seed");
    let said = refused.to_string();
    assert!(said.contains("another session: `--seed` differs"), "{said}");
    let elsewhere = self::session(5);
    let options = options(10, 1, true);
    let refused = twin(&elsewhere, Source::Recordings, &options, &|_, _| {});
    let said = refused.expect_err("other rows").to_string();
    assert!(
        said.contains("the postures of `poses` (recorded or planned)"),
        "{said}"
    );
    let screen = terminal::summary(&whole, "out", 80);
    assert!(screen.lines().count() <= 24, "{screen}");
    let schema = write::json_schema();
    let of = schema["properties"].as_object().expect("properties");
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    for key in value.as_object().expect("an object").keys() {
        assert!(of.contains_key(key), "{key}");
    }
}

#[test]
fn twice_the_noise_is_no_twin_of_the_recording() {
    // Of the sessions some have a statement of their own, and in some the joints' noise is found at 0.
    for seed in 4..9 {
        let session = session(seed);
        let trials: Vec<_> = (0..50)
            .filter_map(|k| session.trial(1, k, 2.0).done)
            .collect();
        let marks: Vec<_> = trials.iter().map(|t| &t.likeness).collect();
        let found = calib_twin::likeness::resemblance(&session.likeness, &marks);
        assert!(found.differs, "{seed}: {found:?}");
    }
}

#[test]
fn what_has_no_twin_says_why() {
    let text = profile(3, Seen::Markers(3), 14, 1);
    let paper = text.replace("solve:\n", "solve:\n  method: paper\n");
    let inputs = recorded(&robot(THREE, &paper));
    let made = Session::new(inputs, About::Found, None, Vec::new());
    let why = made.err().map(|e| e.to_string()).unwrap_or_default();
    assert!(why.contains("method: paper"), "{why}");
    let nothing = robot(THREE, text.split("simulate:").next().expect("a profile"));
    let none = calib_twin::session(nothing, None, Default::default(), None);
    let why = none.err().map(|e| e.to_string()).unwrap_or_default();
    assert!(why.contains("nothing is recorded"), "{why}");
}

/// Most trials take the statement that the session chose: they find what the whole calibration finds where that chooses and keeps the same.
#[test]
fn a_trial_with_the_statement_of_the_session_finds_what_a_whole_one_finds() {
    /// Errors and σ that are as near to each other, in σ, are the same.
    const SAME: f64 = 0.02;
    let repeated = |s: &Session| !s.trial(1, 1, 1.0).whole;
    let session = (6..16).map(session).find(repeated);
    let session = session.expect("a session whose noise is one statement");
    let of = |n: u64| session.trial(1, n, 1.0);
    let (whole, again): (Vec<_>, Vec<_>) = (0..12).map(of).partition(|t| t.whole);
    assert_eq!((whole.len(), again.len()), (2, 10));
    let (mut compared, mut agreed) = (0, 0);
    for trial in &again {
        let mut rng = Session::numbers(1, trial.number);
        let truth = session.draw(&mut rng);
        let replay = Replay {
            inputs: &session.rows,
            tracks: &session.own.checked.tracks,
            robot: &truth.robot,
            noise: &session.noise,
            fault: None,
        };
        let run = session.calibrate(replay.recordings(&mut rng));
        let run = run.unwrap_or_else(|e| panic!("{e}"));
        let fit = run.solved.fit.as_ref().expect("a fit");
        let own = session.fit().expect("a fit");
        let choice = |fit: &MlFit| (fit.noise.as_ref().map(|n| n.chosen), fit.levels.clone());
        if choice(fit) != choice(own) {
            continue;
        }
        compared += 1;
        let off = quantity::errors(&run, fit, &truth, &session.places);
        let done = trial.done.as_ref().expect("a result");
        let same = |(a, b): (&quantity::Off, &quantity::Off)| {
            a.of == b.of
                && (a.error - b.error).abs() < SAME * a.sigma
                && (a.sigma - b.sigma).abs() < SAME * a.sigma
        };
        let all = off.len() == done.off.len() && off.iter().zip(&done.off).all(same);
        agreed += usize::from(all);
    }
    // Of the others, one observation at the border of the gate was kept by one and not by the other.
    assert!(
        compared >= 5 && 10 * agreed >= 7 * compared,
        "{agreed} of {compared}"
    );
}

#[test]
fn postures_of_a_plan_are_recorded_by_the_robot_that_the_recordings_show() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    // Offsets that no gate lets pass.
    let text =
        profile(3, Seen::Markers(3), 30, 7).replace("joint_offset_deg: 0.3", "joint_offset_deg: 1");
    let text = text.replace("offset_deg: 0.3}", "offset_deg: 1}");
    let drawn = robot(THREE, &text);
    let tables = calib_sim::simulate(&drawn.profile, &drawn.model, None);
    for (name, table) in tables.expect("recordings").recordings {
        let written = write_poses(&table, &WriteOptions::micro()).expect("a table");
        std::fs::write(at(&format!("{name}.csv")), written).expect("written");
    }
    std::fs::write(at("arm.urdf"), &drawn.urdf_text).expect("written");
    std::fs::write(at("arm.yaml"), &text).expect("written");
    let loaded = load_robot(&at("arm.yaml")).unwrap_or_else(|e| panic!("{e}"));
    let known = Known::of(loaded.clone(), Plugins::Refused).unwrap_or_else(|e| panic!("{e}"));
    let asked = calib_plan::Options {
        poses: Some(12),
        candidates: 128,
        ..calib_plan::Options::default()
    };
    let plan = calib_plan::plan(&known, &asked).unwrap_or_else(|e| panic!("{e}"));
    let plan = plan.file(&known.robot.model);
    let (session, source) = calib_twin::session(loaded, Some(&plan), Plugins::Refused, None)
        .unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(source, Source::Plan);
    let fit = session.fit().expect("a fit");
    let rejected = left_out(fit);
    let planned = |name: &String| name.starts_with("planned");
    let of_plan = rejected
        .iter()
        .filter(|(recording, ..)| planned(recording))
        .count();
    let rows = fit
        .formulation
        .samples
        .iter()
        .filter(|(recording, _)| planned(recording));
    assert!(rows.count() >= 12);
    // 1 of 500 good ones is rejected.
    assert!(of_plan <= 2, "{rejected:?}");
}
