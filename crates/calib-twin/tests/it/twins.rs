//! Whole twins of a small robot.

use calib_twin::{About, Options, Session, Source, Twin, terminal, twin, write};

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
    assert!(twin(&session, Source::Recordings, &other, &|_, _| {}).is_err());
    let screen = terminal::summary(&whole, "out");
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
    let session = session(5);
    let options = Options {
        trials: 50,
        noise: 2.0,
        ..Options::default()
    };
    let trials: Vec<_> = (0..options.trials)
        .filter_map(|k| session.trial(1, k, options.noise).done)
        .collect();
    let marks: Vec<_> = trials.iter().map(|t| &t.likeness).collect();
    let found = calib_twin::likeness::resemblance(&session.likeness, &marks);
    assert!(found.differs, "{found:?}");
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
