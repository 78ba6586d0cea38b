//! Replays: what the tracker would have seen of another robot.

use calib_pipeline::verify::residuals::residual_rows;
use calib_twin::fault::Fault;
use calib_twin::nalgebra::Vector3;
use calib_twin::noise::Noise;
use calib_twin::replay::Replay;
use calib_twin::{About, Session};

use crate::robots::{Seen, three};

const DESIGNS: [Seen; 5] = [
    Seen::Markers(1),
    Seen::Markers(2),
    Seen::Markers(3),
    Seen::Markers(4),
    Seen::Pose,
];

fn session(seen: Seen) -> Session {
    let inputs = three(seen, 16, 3);
    Session::new(inputs, About::Found, None, Vec::new()).unwrap_or_else(|e| panic!("{e}"))
}

/// rms of what the found robot leaves of a replay, m.
fn left(session: &Session, noise: &Noise, fault: Option<&Fault>) -> f64 {
    let fit = session.fit().expect("a fit");
    let truth = fit.calibration.clone();
    let replay = Replay {
        inputs: &session.rows,
        tracks: &session.own.checked.tracks,
        robot: &truth,
        noise,
        fault,
    };
    let mut inputs = replay.recordings(&mut Session::numbers(1, 1));
    // Poses of bodies are looked up in their tracks.
    let tracks = calib_pipeline::prepare::tracks::body_tracks(&inputs, &mut Vec::new());
    let mut tracks = tracks.unwrap_or_else(|e| panic!("{e}"));
    for (name, track) in &session.own.checked.tracks {
        let own = tracks.get_mut(name).expect("the same bodies");
        own.template.clone_from(&track.template);
    }
    inputs.findings.clear();
    let rows = residual_rows(&inputs, &tracks, &truth, None);
    let squares = rows.iter().flat_map(|r| r.residual_m).map(|x| x * x);
    (squares.sum::<f64>() / rows.len() as f64).sqrt()
}

#[test]
fn without_noise_the_found_robot_explains_its_replay_and_a_slip_of_a_millimeter_shows() {
    for seen in DESIGNS {
        let session = session(seen);
        let quiet = Noise::default();
        let exact = left(&session, &quiet, None);
        assert!(exact < 1e-9, "{seen:?}: {exact}");
        let slip = Fault::Slip {
            body: "hand".to_owned(),
            recording: "poses".to_owned(),
            row: 8,
            by: Vector3::new(1e-3, 0.0, 0.0),
        };
        let moved = left(&session, &quiet, Some(&slip));
        assert!(moved > 1e-4, "{seen:?}: {moved}");
        let noisy = left(&session, &session.noise, None);
        // 0.1 mm per coordinate of markers; of poses as well.
        assert!((1e-4..4e-4).contains(&noisy), "{seen:?}: {noisy}");
    }
}

#[test]
fn gaps_stay_gaps_and_what_was_seen_is_seen() {
    let session = session(Seen::Markers(3));
    let truth = session.draw(&mut Session::numbers(1, 2));
    let mut gappy = session.rows.clone();
    let poses = &mut gappy.recordings.get_mut("poses").expect("poses").poses;
    poses.markers.get_mut("f2").expect("f2")[5] = None;
    let replay = Replay {
        inputs: &gappy,
        tracks: &session.own.checked.tracks,
        robot: &truth.robot,
        noise: &session.noise,
        fault: None,
    };
    let replayed = replay.recordings(&mut Session::numbers(1, 3));
    for (name, before) in &gappy.recordings {
        let after = &replayed.recordings[name];
        for (marker, track) in &before.poses.markers {
            let seen = |t: &Vec<Option<_>>| t.iter().map(Option::is_some).collect::<Vec<_>>();
            assert_eq!(seen(track), seen(&after.poses.markers[marker]), "{marker}");
            assert_ne!(track, &after.poses.markers[marker], "{marker}");
        }
    }
}

#[test]
fn robots_are_drawn_as_far_about_the_found_one_as_it_is_known() {
    let session = session(Seen::Markers(4));
    let fit = session.fit().expect("a fit");
    let draws: Vec<_> = (0..400)
        .map(|k| session.draw(&mut Session::numbers(7, k)).values)
        .collect();
    for p in fit.solution.parameters.iter().filter(|p| p.sigma.is_some()) {
        let sigma = p.sigma.expect("known");
        let squares = draws.iter().map(|d| (d[&p.name] - p.value).powi(2));
        let ratio = (squares.sum::<f64>() / 400.0).sqrt() / sigma;
        // 1 ± 0.035 for 400 normal numbers; what nothing determines stays.
        let open = fit.solution.observability.nullity() > 0;
        assert!((0.85..1.15).contains(&ratio) || open, "{}: {ratio}", p.name);
    }
}
