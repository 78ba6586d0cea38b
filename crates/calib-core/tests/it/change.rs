//! A body that slips, a tracker that is bumped, an encoder that jumps: found, at the right row, and not where nothing moved.

use crate::common::{Chain, Free, Handles, normal3, rng, six_r};
use calib_core::{Change, ChangeScan, ChangeSettings, Moved, Settings, Solution, solve};
use nalgebra::{Isometry3, Translation3};
use rand::RngExt;

/// Marker noise, m.
const SIGMA: f64 = 3e-4;
/// Joint noise, rad (0.01°).
const JOINT: f64 = 1.7e-4;

/// What happens from a sample on.
#[derive(Clone, Copy)]
enum Event {
    Nothing,
    /// The body moves on its link, m.
    Slip(f64),
    /// The tracker moves, m.
    Bump(f64),
    /// A joint's zero moves, rad.
    Encoder(usize, f64),
    /// The zeros of all joints move, rad: each by ± this, up to twice.
    Homed(f64),
    /// The tracker moves evenly, m from first to last.
    Drift(f64),
    /// The tracker moves as what warms up, m in the end: with this time constant, in parts of all samples.
    Warming(f64, f64),
    /// The tracker reads lengths too long by this ratio.
    Scale(f64),
    /// A joint is off its reading by this σ, rad: in every row, or in every stop of the joint.
    Scatter(usize, f64, Draws),
}

#[derive(Clone, Copy, PartialEq)]
enum Draws {
    Rows,
    Stops,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Design {
    Random(usize),
    /// So many poses of each joint, the others at rest.
    Sweeps(usize),
}

struct Case {
    h: Handles,
    solution: Solution,
    row: usize,
}

fn case(seed: u64, design: Design, event: Event) -> Case {
    case_with(seed, design, event, Fitted::All)
}

/// How a case is fitted.
#[derive(Clone, Copy, PartialEq)]
enum Fitted {
    /// Every row counts; the change is anywhere in the middle.
    All,
    /// Robustly; the change is so many rows before the end.
    Robustly(usize),
    /// Robustly, with so many gross outliers at random rows, 20 mm.
    WithOutliers(usize),
}

fn case_with(seed: u64, design: Design, event: Event, fitted: Fitted) -> Case {
    let mut r = rng(seed);
    let free = Free::everything(6);
    let mut chain = Chain::nominal(six_r());
    match design {
        Design::Random(poses) => chain = chain.posed(&mut r, poses, 1.4),
        Design::Sweeps(each) => {
            let home: Vec<f64> = (0..6).map(|_| r.random_range(-0.6..0.6)).collect();
            for joint in 0..6 {
                for i in 0..each {
                    let mut q = home.clone();
                    q[joint] += 2.4 * (i as f64 / (each - 1) as f64 - 0.5);
                    chain.q.push(q);
                }
            }
        }
    }
    let chain = chain.deviate(&mut r, &free, 0.005, 0.002);
    let samples = chain.q.len();
    let mut row = r.random_range(samples / 5..samples * 4 / 5);
    if let Fitted::Robustly(last) = fitted {
        row = samples - last;
    }
    let mut gross = Vec::new();
    if let Fitted::WithOutliers(count) = fitted {
        gross = (0..count).map(|_| r.random_range(0..samples)).collect();
        // The end is where a change would be taken for.
        gross.extend([samples - 1, samples - 2, samples - 3]);
    }
    let mut h = chain.problem(&free, SIGMA);
    h.problem.group_mut(h.markers).estimate = true;
    h.scattering_joints(JOINT);
    let direction = normal3(&mut r).normalize();
    let shift = |m: f64| {
        Isometry3::from_parts(
            Translation3::from(direction * m),
            nalgebra::UnitQuaternion::identity(),
        )
    };
    let (before, after) = (chain.true_mount, chain.true_world);
    let mut seen = Vec::new();
    let mut chain = chain;
    let mut error = 0.0;
    for s in 0..samples {
        let later = s >= row;
        chain.true_mount = before;
        chain.true_world = after;
        let mut extra: Vec<f64> = (0..6)
            .map(|_| crate::common::normal(&mut r) * JOINT)
            .collect();
        let mut scale = 1.0;
        match event {
            Event::Slip(m) if later => chain.true_mount = before * shift(m),
            Event::Bump(m) if later => chain.true_world = shift(m) * after,
            Event::Encoder(j, q) if later => extra[j] += q,
            Event::Homed(q) if later => extra.iter_mut().zip(HOMED).for_each(|(e, h)| *e += q * h),
            Event::Drift(m) => chain.true_world = shift(m * s as f64 / samples as f64) * after,
            Event::Warming(m, part) => {
                let t = s as f64 / samples as f64;
                chain.true_world = shift(m * (1.0 - (-t / part).exp())) * after;
            }
            Event::Scale(ratio) => scale = 1.0 + ratio,
            Event::Scatter(j, sigma, draws) => {
                let stays = s > 0 && chain.q[s][j] == chain.q[s - 1][j];
                if draws == Draws::Rows || !stays {
                    error = sigma * crate::common::normal(&mut r);
                }
                extra[j] += error;
            }
            _ => {}
        }
        let x = chain.tracker_from_body(&chain.q[s].clone(), &extra);
        for (m, p) in chain.markers.iter().enumerate() {
            let off = if gross.contains(&s) {
                normal3(&mut r).normalize() * 0.02
            } else {
                nalgebra::Vector3::zeros()
            };
            seen.push(calib_core::MarkerObservation {
                sample: s,
                point: h.points[m],
                position: nalgebra::Point3::from(
                    (x * p).coords * scale + normal3(&mut r) * SIGMA + off,
                ),
                shape: None,
            });
        }
    }
    h.problem
        .markers("body", h.tracker, h.body, h.markers, seen);
    let mut settings = Settings::default();
    settings.robust.enabled = fitted != Fitted::All;
    let solution = solve(&h.problem, &settings).expect("solves");
    Case { h, solution, row }
}

fn scan(case: &Case) -> ChangeScan {
    case.solution
        .changes(&ChangeSettings::default())
        .expect("evaluable")
}

/// Cases of so many seeds in which a change was seen, the right one was named first, its row was found to ±1, and the right one was
/// named first or as a rival that explains the data as well.
fn found(
    seeds: std::ops::Range<u64>,
    design: Design,
    event: Event,
    moved: impl Fn(&Handles) -> Moved,
) -> (usize, usize, usize, usize) {
    let (mut any, mut first, mut row, mut named) = (0, 0, 0, 0);
    for seed in seeds {
        let case = case(seed, design, event);
        let scan = scan(&case);
        if let Some(change) = scan.significant() {
            any += 1;
            let right = |c: &Change| c.moved == moved(&case.h);
            first += usize::from(right(change));
            named += usize::from(right(change) || scan.rivals().into_iter().any(right));
            row += usize::from(change.first.abs_diff(case.row) <= 1);
        }
    }
    (any, first, row, named)
}

/// Where the zeros of a homed robot went, in parts of the size.
const HOMED: [f64; 6] = [1.0, -1.4, 0.8, 2.0, -1.0, 1.2];

/// Two standard deviations of a marker: what must be found at 40 poses.
const TWO: f64 = 2.0 * SIGMA;

#[test]
fn where_nothing_moved_nothing_is_named() {
    // 1 % of 90: more than three would be seen in fewer than two of a hundred such tests.
    let body = |h: &Handles| Moved::Body(h.body);
    let (random, ..) = found(0..60, Design::Random(40), Event::Nothing, body);
    let (sweeps, ..) = found(0..30, Design::Sweeps(8), Event::Nothing, body);
    assert!(
        random + sweeps <= 3,
        "{random} of 60 random, {sweeps} of 30 sweeps"
    );
}

/// One σ for all joints does not describe them, and a stretch of rows in which one of them stopped on one side is no step.
#[test]
fn a_joint_that_scatters_is_no_change() {
    let (mut named, mut right, mut said, mut cases) = (Vec::new(), 0, 0, 0);
    let designs = [
        (Design::Random(40), Draws::Rows),
        (Design::Sweeps(8), Draws::Rows),
        // A joint that rests while others are swept keeps its error.
        (Design::Sweeps(8), Draws::Stops),
    ];
    for (k, (design, draws)) in designs.into_iter().enumerate() {
        for joint in [1, 2, 4] {
            // 0.06° and 0.3°
            for sigma in [1e-3, 5e-3] {
                for seed in 0..3 {
                    let case = case(100 + seed, design, Event::Scatter(joint, sigma, draws));
                    let scan = scan(&case);
                    cases += 1;
                    if let Some(change) = scan.significant() {
                        named.push((k, joint, sigma, seed, change.excess - scan.threshold));
                    } else if let Some(scatter) = scan.scatter {
                        let near = (scatter.sigma / sigma).ln().abs() < 2.0_f64.ln();
                        said += 1;
                        right += usize::from(scatter.joint == case.h.joints[joint] && near);
                    }
                }
            }
        }
    }
    // Of so many cases without scatter, none or one would be named.
    assert!(named.len() <= 2, "of {cases}: {named:?}");
    // The fit takes most of it for noise of all joints; where it seems to be a change, the joint is named.
    assert!(said >= 5 && right * 10 >= said * 8, "{right} of {said}");
}

#[test]
fn a_change_is_named_with_its_row() {
    if !skipped_tests::thorough() {
        return;
    }
    let n = 10;
    for design in [Design::Random(40), Design::Random(100)] {
        let body = found(0..n, design, Event::Slip(TWO), |h| Moved::Body(h.body));
        let tracker = found(0..n, design, Event::Bump(TWO), |h| {
            Moved::Reference(h.tracker)
        });
        // 0.2°
        let joint = found(0..n, design, Event::Encoder(2, 3.5e-3), |h| {
            Moved::Joint(h.joints[2])
        });
        for (any, first, row, named) in [body, tracker, joint] {
            let all = n as usize;
            assert_eq!((any, named), (all, all), "{body:?} {tracker:?} {joint:?}");
            // At 40 poses a joint can explain a slip of two standard deviations as well as the body.
            assert!(first + 1 >= all, "{body:?} {tracker:?} {joint:?}");
            // The row is that of the change or its neighbor, but for a pose that both sides explain.
            assert!(row + 2 >= all, "{body:?} {tracker:?} {joint:?}");
        }
    }
}

/// A hundred postures in 25 files: what moved is named at its row, and with the files behind it.
#[test]
fn of_many_recordings_those_behind_a_change_are_found() {
    const EACH: usize = 4;
    let mut settings = ChangeSettings::default();
    settings.borders = (1..25).map(|file| EACH * file).collect();
    let scan = |case: &Case| case.solution.changes(&settings).expect("evaluable");
    let mut clean = 0;
    for seed in 0..8 {
        let nothing = case(seed, Design::Random(100), Event::Nothing);
        clean += usize::from(scan(&nothing).significant().is_some());
        let case = case(seed, Design::Random(100), Event::Slip(1.5 * TWO));
        let found = scan(&case);
        let change = found.significant().expect("a change");
        assert_eq!(change.moved, Moved::Body(case.h.body), "seed {seed}");
        // A change between two files is in no file: the files behind it say where it is.
        let earliest = change.also.iter().fold(change.first, |a, b| a.min(*b));
        assert!(earliest.abs_diff(case.row) <= 1, "seed {seed}");
        // A file next to the row, or one of four poses that do not show on which side they are, may be on the other side.
        let behind = |first: &&usize| **first > case.row + EACH;
        let expected = settings.borders.iter().filter(behind).count();
        let right = change.also.iter().filter(behind).count();
        assert!(right + 1 >= expected, "seed {seed}: {right} of {expected}");
        assert!(
            change.also.len() <= right + 3,
            "seed {seed}: {:?}",
            change.also
        );
    }
    assert!(clean <= 1, "{clean}");
}

/// More files than samples that are simulated: which of them fit the other side better is chance.
#[test]
fn in_many_recordings_chance_is_no_change() {
    let mut settings = ChangeSettings::default();
    settings.borders = (1..300).map(|file| 2 * file).collect();
    for seed in 0..2 {
        let case = case(seed, Design::Random(600), Event::Nothing);
        let scan = case.solution.changes(&settings).expect("evaluable");
        assert_eq!(scan.significant(), None, "seed {seed}");
    }
}

/// The robust fit rejects the last eight rows, which are those after the change.
#[test]
fn a_change_whose_rows_were_rejected_is_named() {
    for seed in 0..6 {
        for (event, slips) in [(Event::Slip(6e-3), true), (Event::Bump(6e-3), false)] {
            let case = case_with(seed, Design::Random(50), event, Fitted::Robustly(8));
            let moved = if slips {
                Moved::Body(case.h.body)
            } else {
                Moved::Reference(case.h.tracker)
            };
            let rejected = case.solution.rejected.iter();
            let after = rejected.filter(|r| r.sample >= case.row).count();
            assert!(after > 8, "seed {seed}: the fit kept the rows: {after}");
            let scan = scan(&case);
            let change = scan.significant().expect("a change");
            assert_eq!(
                (change.moved, change.first),
                (moved, case.row),
                "seed {seed}"
            );
        }
    }
}

/// To first order a turn by 10° has a size that is wrong by many of its standard deviations.
#[test]
fn a_step_that_turns_far_has_its_size() {
    let mut far = Vec::new();
    let mut cases = 0;
    for design in [Design::Random(40), Design::Sweeps(8)] {
        for joint in [1, 2] {
            // 1°, 5°, 10°
            for size in [0.0175, 0.087, 0.175] {
                for (seed, fitted) in [
                    (1, Fitted::All),
                    (2, Fitted::Robustly(8)),
                    (3, Fitted::Robustly(15)),
                ] {
                    let case = case_with(seed, design, Event::Encoder(joint, size), fitted);
                    let scan = scan(&case);
                    cases += 1;
                    // While joints behind it are swept, the tracker may have turned about its axis instead.
                    let own = Moved::Joint(case.h.joints[joint]);
                    let mut named = scan.significant().into_iter().chain(scan.rivals());
                    let found = named.find(|change| change.moved == own);
                    let off = found.map(|c| (c.jump[0] - size) / c.sigma[0]);
                    if off.is_none_or(|off| off.abs() > 3.5) {
                        let first = scan.significant().map(|c| c.moved);
                        far.push((design, joint, size, seed, off, first));
                    }
                }
            }
        }
    }
    assert!(far.len() <= 1, "of {cases}: {far:?}");
}

/// A robot that was homed: all zeros are others, and neither the tracker nor a body moved.
#[test]
fn a_robot_that_was_homed_is_no_tracker_that_moved() {
    let (mut wrong, mut far, mut cases) = (Vec::new(), Vec::new(), 0);
    for design in [Design::Random(40), Design::Sweeps(8)] {
        // 0.1° and 1°
        for size in [1.7e-3, 1.7e-2] {
            for seed in 0..8 {
                let case = case(seed, design, Event::Homed(size));
                let scan = scan(&case);
                cases += 1;
                let mut named = scan.significant().into_iter().chain(scan.rivals());
                let Some(change) = named.find(|c| c.moved == Moved::Zeros) else {
                    let first = scan.significant().map(|c| (c.moved, c.excess));
                    let zeros = scan.changes.iter().find(|c| c.moved == Moved::Zeros);
                    let zeros = zeros.map(|c| c.excess);
                    wrong.push((design, size, seed, first, zeros));
                    continue;
                };
                assert_eq!(change.joints, case.h.joints);
                let steps = change.jump.iter().zip(&change.sigma).zip(HOMED);
                far.extend(steps.filter_map(|((step, sigma), times)| {
                    let off = (step - size * times) / sigma;
                    (off.abs() > 3.5).then_some((design, size, seed, off))
                }));
            }
        }
    }
    assert!(wrong.len() <= 2, "of {cases}: {wrong:?}");
    assert!(far.len() <= 4, "of {} steps: {far:?}", 6 * cases);
}

/// Gross outliers that follow each other are no change: nothing that moved once explains them.
#[test]
fn gross_outliers_are_no_change() {
    let named = (0..20).filter(|seed| {
        let fitted = Fitted::WithOutliers(2);
        let case = case_with(*seed, Design::Random(40), Event::Nothing, fitted);
        scan(&case).significant().is_some()
    });
    assert!(named.count() <= 1);
}

#[test]
fn in_sweeps_a_change_is_seen_and_its_rivals_are_named() {
    let (any, ..) = found(0..15, Design::Sweeps(8), Event::Slip(TWO), |h| {
        Moved::Body(h.body)
    });
    assert_eq!(any, 15);
    for seed in 0..15 {
        let case = case(seed, Design::Sweeps(8), Event::Slip(TWO));
        let scan = scan(&case);
        let best = scan.significant().expect("counted above");
        let rivals = scan.rivals();
        let named = std::iter::once(best)
            .chain(rivals)
            .any(|c| c.moved == Moved::Body(case.h.body));
        assert!(named, "seed {seed}: {:?}", scan.changes);
    }
}

#[test]
fn drift_and_scale_of_the_tracker_are_named() {
    for design in [Design::Random(40), Design::Random(100)] {
        let drift = found(0..8, design, Event::Drift(1e-3), |h| {
            Moved::Drift(h.tracker)
        });
        let scale = found(0..8, design, Event::Scale(3e-3), |h| {
            Moved::Scale(h.tracker)
        });
        assert_eq!((drift.1, scale.1), (8, 8));
    }
}

/// The size of a jump, and that its σ is right.
/// A tracker that warms up is no tracker that was bumped.
#[test]
fn a_tracker_that_warms_up_is_no_step() {
    for design in [Design::Random(60), Design::Sweeps(20)] {
        for (part, least) in [(0.15, 10), (0.3, 10), (0.6, 10)] {
            let mut named = 0;
            for seed in 0..12 {
                let case = case(4100 + seed, design, Event::Warming(1e-3, part));
                let scan = scan(&case);
                let Some(change) = scan.significant() else {
                    continue;
                };
                let drifts = matches!(change.moved, Moved::Drift(_) | Moved::Settling(_));
                println!("{design:?} {part}: {:?} {:.1}", change.moved, change.excess);
                named += usize::from(drifts);
            }
            assert!(named >= least, "{design:?}, {part}: {named}");
        }
    }
}

#[test]
fn the_jump_is_as_large_as_it_was() {
    for seed in 0..10 {
        let case = case(seed, Design::Random(60), Event::Encoder(3, 4e-3));
        let scan = scan(&case);
        let change = scan.significant().expect("0.23° is seen");
        let z = (change.jump[0].abs() - 4e-3) / change.sigma[0];
        assert!(z.abs() < 4.0, "seed {seed}: z {z}");
    }
}

/// Samples beyond the edges of the coarse scan: the row is still exact.
#[test]
fn a_long_recording_is_refined_to_the_row() {
    let case = case(3, Design::Random(1000), Event::Slip(TWO));
    let change = scan(&case).significant().cloned().expect("seen");
    assert_eq!(change.moved, Moved::Body(case.h.body));
    assert!(
        change.first.abs_diff(case.row) <= 1,
        "{} for {}",
        change.first,
        case.row
    );
}

#[test]
#[ignore = "prints rates over hundreds of seeds; a minute"]
fn rates() {
    let designs = [
        ("40", Design::Random(40)),
        ("100", Design::Random(100)),
        ("sweeps", Design::Sweeps(8)),
    ];
    for (name, design) in designs {
        let body = |h: &Handles| Moved::Body(h.body);
        println!(
            "{name} clean of 300 {:?}",
            found(0..300, design, Event::Nothing, body)
        );
        println!(
            "{name} slip 1σ of 100 {:?}",
            found(0..100, design, Event::Slip(SIGMA), body)
        );
        println!(
            "{name} slip 2σ of 200 {:?}",
            found(0..200, design, Event::Slip(TWO), body)
        );
        println!(
            "{name} bump 2σ of 100 {:?}",
            found(0..100, design, Event::Bump(TWO), |h| Moved::Reference(
                h.tracker
            ))
        );
    }
}
