//! Studies that take minutes: are σ kept, are wrong twins seen, are effects found at the size that is stated?

use calib_twin::fault::Fault;
use calib_twin::replay::Replay;
use calib_twin::summary::Promise;
use calib_twin::{About, Options, Session, Source, Twin, twin};
use rayon::prelude::*;

use crate::robots::{Seen, arm, profile, recorded, robot, three};

fn made(session: &Session, trials: u64) -> Twin {
    let options = Options {
        trials,
        ..Options::default()
    };
    let made = twin(session, Source::Recordings, &options, &|_, _| {});
    made.unwrap_or_else(|e| panic!("{e}"))
}

/// Robots, and trials of each, from the variable `CALIB_STUDY`, as `20x200`.
pub fn sizes(usual: &str) -> (u64, u64) {
    let stated = std::env::var("CALIB_STUDY").unwrap_or_else(|_| usual.to_owned());
    let (robots, trials) = stated.split_once('x').expect("ROBOTSxTRIALS");
    let number = |text: &str| text.parse().expect("a number");
    (number(robots), number(trials))
}

#[test]
#[ignore = "20 robots of 200 trials: half an hour"]
fn promised_sigma_is_kept_on_random_robots() {
    let (robots, trials) = sizes("20x200");
    let designs = [
        Seen::Markers(4),
        Seen::Pose,
        Seen::Markers(1),
        Seen::Markers(3),
        Seen::Markers(2),
    ];
    let (mut kept, mut broken, mut all, mut least, mut most) = (0, 0, 0, f64::INFINITY, 0.0_f64);
    let (mut covered, mut tried, mut named, mut noticed, mut alarms, mut done) =
        (0.0, 0, 0, 0, 0, 0);
    for k in 0..robots {
        let joints = arm(k);
        let seen = designs[k as usize % designs.len()];
        let text = profile(joints.len(), seen, 40, k);
        let inputs = recorded(&robot(&joints, &text));
        let session = Session::new(inputs, About::Found, None, Vec::new());
        let session = session.unwrap_or_else(|e| panic!("{e}"));
        let found = made(&session, trials);
        let observed: Vec<_> = found.promises.iter().filter(|p| p.is_observed()).collect();
        let ratios: Vec<f64> = observed.iter().map(|p| p.ratio).collect();
        let of = |is: fn(&Promise) -> bool| observed.iter().filter(|p| is(p)).count();
        let (own, out) = (of(Promise::is_kept), of(Promise::is_broken));
        let coverage = observed.iter().map(|p| p.coverage).sum::<f64>();
        let low = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        let high = ratios.iter().copied().fold(0.0, f64::max);
        println!(
            "robot {k}: {} joints, {seen:?}: {} quantities, within 15 % {own}, beyond chance {out}, ratio {low:.3} to {high:.3}, covered {:.4}, refused {}, alarms {}, size factor {:?}",
            joints.len(),
            observed.len(),
            coverage / observed.len() as f64,
            found.refused,
            found.false_alarms,
            found.size_factor
        );
        for p in observed.iter().filter(|p| p.is_broken()) {
            println!("    {:?}: {:.3} ± {:.3}", p.of, p.ratio, p.ratio_sigma);
        }
        (kept, broken, all) = (kept + own, broken + out, all + observed.len());
        (least, most, covered) = (least.min(low), most.max(high), covered + coverage);
        let (own_named, own_noticed, own_tried) = at_size(&session, &found);
        (tried, named, noticed) = (tried + own_tried, named + own_named, noticed + own_noticed);
        (alarms, done) = (
            alarms + found.false_alarms,
            done + found.trials - found.refused,
        );
    }
    println!(
        "all: {kept} of {all} within 15 %, {broken} beyond chance; ratio {least:.3} to {most:.3}; covered {:.4}",
        covered / all as f64
    );
    println!(
        "effects at their 80 % size: {named} of {tried} named, {noticed} noticed; false alarms {alarms} of {done}"
    );
    assert_eq!(broken, 0);
}

/// Trials with effects of the 80 % size that is stated, others than those that the size was corrected by: named, noticed, tried.
fn at_size(session: &Session, found: &Twin) -> (usize, usize, usize) {
    /// Numbers of trials that no twin uses.
    const OTHERS: u64 = 1 << 20;
    let known = calib_twin::power::effects(&session.rows.robot.model);
    let one = |(k, power): (usize, &calib_twin::power::Power)| {
        let size = power.size()?;
        let fault = known.get(&power.name)?.fault(size);
        Some(session.injected(9, OTHERS + k as u64, (&fault, &power.name, size)))
    };
    let all: Vec<_> = found
        .powers
        .par_iter()
        .enumerate()
        .filter_map(one)
        .collect();
    let count = |is: fn(&calib_twin::trial::Injected) -> bool| all.iter().filter(|i| is(i)).count();
    (count(|i| i.named), count(|i| i.noticed), all.len())
}

/// Recordings of one simulated robot each, replayed from a first session, with or without a fault.
fn flagged(fault: Option<&Fault>, scale: f64, sessions: u64) -> usize {
    let flagged = (0..sessions).into_par_iter().map(|k| {
        let first = Session::new(
            three(Seen::Markers(3), 40, k),
            About::Found,
            None,
            Vec::new(),
        );
        let first = first.unwrap_or_else(|e| panic!("{e}"));
        let truth = first.draw(&mut Session::numbers(k, 1 << 40));
        let replay = Replay {
            inputs: &first.rows,
            tracks: &first.own.checked.tracks,
            robot: &truth.robot,
            noise: &first.noise,
            fault,
        };
        let inputs = replay.recordings(&mut Session::numbers(k, 1 << 41));
        let session = Session::new(inputs, About::Found, None, Vec::new());
        let session = session.unwrap_or_else(|e| panic!("{e}"));
        let done: Vec<_> = (0..60)
            .filter_map(|n| session.trial(k, n, scale).done)
            .collect();
        let marks: Vec<_> = done.iter().map(|d| &d.likeness).collect();
        usize::from(calib_twin::likeness::resemblance(&session.likeness, &marks).differs)
    });
    flagged.sum()
}

#[test]
#[ignore = "three times 100 sessions of 60 trials: ten minutes"]
fn wrong_twins_are_seen() {
    let sessions = std::env::var("CALIB_SESSIONS").map_or(100, |n| n.parse().expect("a number"));
    let clean = flagged(None, 1.0, sessions);
    println!("without a fault: {clean} of {sessions} flagged");
    let noisy = flagged(None, 2.0, sessions);
    println!("noise times 2: {noisy} of {sessions} flagged");
    let model = robot(crate::robots::THREE, &profile(3, Seen::Markers(3), 14, 1)).model;
    let known = calib_twin::power::effects(&model);
    let mut effects = 0;
    let mut of_effects = 0;
    for (name, size) in [
        ("j2.gain", 0.004),
        ("j1.eccentricity_sin", 0.004),
        ("j3.backlash", 0.002),
    ] {
        let fault = known[name].fault(size);
        let found = flagged(Some(&fault), 1.0, sessions);
        println!("{name} of {size}: {found} of {sessions} flagged");
        effects += found;
        of_effects += sessions as usize;
    }
    assert!(clean * 20 <= sessions as usize && noisy * 100 >= 95 * sessions as usize);
    assert!(effects * 100 >= 95 * of_effects);
}
