//! Random robots with something that the model lacks: how often does the twin say that it does not resemble the recording?
//!
//! An effect has the size at which it moves the tracked hand by so many times the tracker's noise, root mean square over the coordinates
//! of all postures. A free parameter can take up a part of that: z is what remains, in σ of the test for this effect alone.

use calib_twin::fault::Fault;
use calib_twin::likeness::{Likeness, resemblance};
use calib_twin::noise::Noise;
use calib_twin::power::effects;
use calib_twin::replay::Replay;
use calib_twin::truth::Truth;
use calib_twin::{About, Session};
use rand::RngExt;
use rayon::prelude::*;

use crate::robots::{Seen, arm, profile, recorded, weighted};
use crate::studies::sizes;

/// Movement of the hand by an effect, in σ of the tracker.
const MOVED: f64 = 2.0;
/// σ of the tracker in these profiles, m.
const SIGMA: f64 = 1e-4;
/// Below this z what remains of an effect is nothing that data could show: free parameters predict the same.
const ABSORBED: f64 = 6.0;
/// Kinds of effects, by a part of the names of their tests.
const KINDS: [&str; 5] = [
    ".gain",
    ".coupling.",
    ".backlash",
    ".eccentricity_",
    ".compliance",
];

/// One comparison of a recording with its twin.
struct Case {
    what: String,
    /// What remains of an effect, in σ of its test; infinite for noise, 0 for nothing.
    z: f64,
    /// p of the comparison.
    p: f64,
    differs: bool,
    /// The number that differs most.
    most: String,
}

fn session(inputs: calib_pipeline::prepare::inputs::Inputs) -> Session {
    let session = Session::new(inputs, About::Found, None, Vec::new());
    session.unwrap_or_else(|e| panic!("{e}"))
}

/// A robot drawn from a session, before a tracker.
fn replay<'a>(
    of: &'a Session,
    truth: &'a Truth,
    noise: &'a Noise,
    fault: Option<&'a Fault>,
) -> Replay<'a> {
    Replay {
        inputs: &of.rows,
        tracks: &of.own.checked.tracks,
        robot: &truth.robot,
        noise,
        fault,
    }
}

/// Root mean square movement of the hand by a fault, per coordinate, m.
fn moved(of: &Session, truth: &Truth, fault: &Fault) -> f64 {
    let quiet = of.noise.clone().times(0.0);
    let [with, without] = [Some(fault), None].map(|fault| {
        let rng = &mut Session::numbers(1, 1);
        replay(of, truth, &quiet, fault).recordings(rng)
    });
    let (mut sum, mut count) = (0.0, 0);
    for (name, a) in &with.recordings {
        let b = &without.recordings[name];
        let hand = |name: &&String| name.starts_with('f');
        for marker in a.poses.markers.keys().filter(hand) {
            let pairs = a.poses.markers[marker].iter().zip(&b.poses.markers[marker]);
            for (a, b) in pairs.filter_map(|(a, b)| a.as_ref().zip(b.as_ref())) {
                sum += (a - b).norm_squared();
                count += 3;
            }
        }
        for body in a.poses.bodies.keys() {
            let pairs = a.poses.bodies[body].iter().zip(&b.poses.bodies[body]);
            for (a, b) in pairs.filter_map(|(a, b)| a.as_ref().zip(b.as_ref())) {
                sum += (a.translation.vector - b.translation.vector).norm_squared();
                count += 3;
            }
        }
    }
    (sum / f64::from(count.max(1))).sqrt()
}

fn compared(what: String, z: f64, own: &Session, scale: f64, trials: u64) -> Case {
    let done: Vec<Likeness> = (0..trials)
        .into_par_iter()
        .filter_map(|n| own.trial(1, n, scale).done.map(|d| d.likeness))
        .collect();
    let found = resemblance(&own.likeness, &done.iter().collect::<Vec<_>>());
    let most = found.marks.first();
    Case {
        what,
        z,
        p: found.p_value.unwrap_or(1.0),
        differs: found.differs,
        most: most.map_or_else(String::new, |m| {
            format!("{:?} {:+.1}", m.mark, m.distance())
        }),
    }
}

/// All cases of one robot.
fn of_robot(k: u64, seen: Seen, trials: u64) -> Vec<Case> {
    let joints = arm(k);
    let text = profile(joints.len(), seen, 40, k);
    let first = session(recorded(&weighted(&joints, &text)));
    let mut rng = Session::numbers(k, 1 << 40);
    let truth = first.draw(&mut rng);
    let recorded_with = |fault: Option<&Fault>, stream: u64| {
        let rng = &mut Session::numbers(k, (1 << 41) + stream);
        session(replay(&first, &truth, &first.noise, fault).recordings(rng))
    };
    let clean = recorded_with(None, 0);
    let mut cases = vec![
        compared("nothing".to_owned(), 0.0, &clean, 1.0, trials),
        compared("noise x 2".to_owned(), f64::INFINITY, &clean, 2.0, trials),
        compared("noise x 0.5".to_owned(), f64::INFINITY, &clean, 0.5, trials),
    ];
    let known = effects(&first.rows.robot.model);
    let done = clean.trial(1, 0, 1.0).done.expect("a result");
    for (stream, kind) in (1..).zip(KINDS) {
        let tests: Vec<_> = done
            .tests
            .iter()
            .filter(|t| t.name.contains(kind))
            .collect();
        if tests.is_empty() {
            continue;
        }
        let test = tests[rng.random_range(0..tests.len())];
        let named = &known[&test.name];
        // A size at which every effect acts as its linearization.
        let small = 1e-6;
        let size = small * MOVED * SIGMA / moved(&first, &truth, &named.fault(small));
        if !size.is_finite() {
            continue;
        }
        let own = recorded_with(Some(&named.fault(size)), stream);
        let z = size * test.per_sigma;
        let what = format!("{} of {size:.2e}", test.name);
        cases.push(compared(what, z, &own, 1.0, trials));
    }
    cases
}

/// `CALIB_STUDY=20x60` sets robots, and trials of each comparison.
#[test]
#[ignore = "twenty robots of eight comparisons of 60 trials: half an hour"]
fn what_the_model_lacks_is_flagged_on_random_robots() {
    let (robots, trials) = sizes("20x60");
    let designs = [
        Seen::Markers(4),
        Seen::Pose,
        Seen::Markers(1),
        Seen::Markers(3),
    ];
    let (mut wrong, mut flagged, mut clean, mut falsely, mut absorbed) = (0, 0, 0, 0, 0);
    for k in 0..robots {
        let seen = designs[k as usize % designs.len()];
        for case in of_robot(k, seen, trials) {
            println!(
                "robot {k}, {seen:?}: {}, z {:.1}: p {:.3}{} ({})",
                case.what,
                case.z,
                case.p,
                if case.differs { " differs" } else { "" },
                case.most
            );
            let differs = usize::from(case.differs);
            if case.z == 0.0 {
                (clean, falsely) = (clean + 1, falsely + differs);
            } else if case.z < ABSORBED {
                absorbed += 1;
            } else {
                (wrong, flagged) = (wrong + 1, flagged + differs);
            }
        }
        println!(
            "so far: {flagged} of {wrong} wrong, {falsely} of {clean} clean, {absorbed} absorbed"
        );
    }
    assert!(flagged * 100 >= 95 * wrong, "{flagged} of {wrong}");
    assert!(falsely * 20 <= clean, "{falsely} of {clean}");
}
