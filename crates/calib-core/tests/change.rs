//! A body that slips, a tracker that is bumped, an encoder that jumps: found, at the right row, and not where nothing moved.

mod common;

use calib_core::{ChangeScan, ChangeSettings, Moved, NoiseKind, Settings, Solution, solve};
use common::{Chain, Free, Handles, jitter, normal3, rng, six_r};
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
    /// The tracker moves evenly, m from first to last.
    Drift(f64),
    /// The tracker reads lengths too long by this ratio.
    Scale(f64),
}

#[derive(Clone, Copy, PartialEq)]
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
    let row = r.random_range(samples / 5..samples * 4 / 5);
    let mut h = chain.problem(&free, SIGMA);
    h.problem.group_mut(h.markers).estimate = true;
    let noise = h
        .problem
        .noise_group("joints", NoiseKind::Joint, JOINT, true);
    for joint in &h.joints {
        h.problem.joint_noise(*joint, noise);
    }
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
    for s in 0..samples {
        let later = s >= row;
        chain.true_mount = before;
        chain.true_world = after;
        let mut extra: Vec<f64> = (0..6).map(|_| common::normal(&mut r) * JOINT).collect();
        let mut scale = 1.0;
        match event {
            Event::Slip(m) if later => chain.true_mount = before * shift(m),
            Event::Bump(m) if later => chain.true_world = shift(m) * after,
            Event::Encoder(j, q) if later => extra[j] += q,
            Event::Drift(m) => chain.true_world = shift(m * s as f64 / samples as f64) * after,
            Event::Scale(ratio) => scale = 1.0 + ratio,
            _ => {}
        }
        let x = chain.tracker_from_body(&chain.q[s].clone(), &extra);
        for (m, p) in chain.markers.iter().enumerate() {
            seen.push(calib_core::MarkerObservation {
                sample: s,
                point: h.points[m],
                position: nalgebra::Point3::from((x * p).coords * scale + normal3(&mut r) * SIGMA),
                shape: None,
            });
        }
    }
    h.problem
        .markers("body", h.tracker, h.body, h.markers, seen);
    let mut settings = Settings::default();
    settings.robust.enabled = false;
    let solution = solve(&h.problem, &settings).expect("solves");
    let _ = jitter(&mut r, 0.0, 0.0);
    Case { h, solution, row }
}

fn scan(case: &Case) -> ChangeScan {
    case.solution
        .changes(&ChangeSettings::default())
        .expect("evaluable")
}

/// Cases of so many seeds in which the change was named, and its row found to ±1.
fn found(
    seeds: std::ops::Range<u64>,
    design: Design,
    event: Event,
    moved: impl Fn(&Handles) -> Moved,
) -> (usize, usize, usize) {
    let (mut any, mut named, mut row) = (0, 0, 0);
    for seed in seeds {
        let case = case(seed, design, event);
        let scan = scan(&case);
        if std::env::var_os("SHOW_CHANGES").is_some() {
            for c in scan.changes.iter().take(3) {
                println!(
                    "{seed} row {} {:?} {}..{} T {:.1} excess {:.1} of {:.1} {:?}",
                    case.row, c.moved, c.first, c.end, c.score, c.excess, scan.threshold, c.jump
                );
            }
        }
        if let Some(change) = scan.significant() {
            any += 1;
            named += usize::from(change.moved == moved(&case.h));
            row += usize::from(change.first.abs_diff(case.row) <= 1);
        }
    }
    (any, named, row)
}

#[test]
fn power() {
    for (name, design) in [
        ("40", Design::Random(40)),
        ("100", Design::Random(100)),
        ("sweeps", Design::Sweeps(8)),
    ] {
        let n = 0..20;
        println!(
            "{name} clean {:?}",
            found(0..60, design, Event::Nothing, |h| Moved::Body(h.body))
        );
        println!(
            "{name} slip 1σ {:?}",
            found(n.clone(), design, Event::Slip(SIGMA), |h| Moved::Body(
                h.body
            ))
        );
        println!(
            "{name} slip 2σ {:?}",
            found(
                n.clone(),
                design,
                Event::Slip(2.0 * SIGMA),
                |h| Moved::Body(h.body)
            )
        );
        println!(
            "{name} bump 2σ {:?}",
            found(n.clone(), design, Event::Bump(2.0 * SIGMA), |h| {
                Moved::Reference(h.tracker)
            })
        );
        println!(
            "{name} encoder {:?}",
            found(n.clone(), design, Event::Encoder(2, 3.5e-3), |h| {
                Moved::Joint(h.joints[2])
            })
        );
        println!(
            "{name} drift {:?}",
            found(n.clone(), design, Event::Drift(1e-3), |h| Moved::Drift(
                h.tracker
            ))
        );
        println!(
            "{name} scale {:?}",
            found(n.clone(), design, Event::Scale(2e-3), |h| Moved::Scale(
                h.tracker
            ))
        );
    }
}
