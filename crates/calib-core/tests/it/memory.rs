//! Rows that share errors with their neighbors: a tracker with a filter, joints that stop off their readings while many rows are taken. Nothing moved, and
//! nothing is named; what did move is.

use crate::common::{Chain, Free, normal, normal3, rng, six_r};
use calib_core::{ChangeSettings, MarkerObservation, Moved, Settings, Solution, solve};
use nalgebra::Vector3;

/// Marker noise, m.
const SIGMA: f64 = 3e-4;
/// Joint noise, rad (0.01°).
const JOINT: f64 = 1.7e-4;

/// How rows are recorded, and what is wrong with them.
#[derive(Clone, Copy)]
struct Rows {
    count: usize,
    /// Rows from one random posture to the next; 0: every row is one.
    motion: usize,
    /// ρ of the noise of every marker coordinate from row to row.
    rho: f64,
    /// Rows that share the error of the joints.
    shared: usize,
    /// The tracker moves by so much in the middle, m.
    bump: f64,
    /// Everything that is seen wanders by this σ, m, with a memory of 0.9.
    wander: f64,
}

const STATIC: Rows = Rows {
    count: 60,
    motion: 0,
    rho: 0.0,
    shared: 1,
    bump: 0.0,
    wander: 0.0,
};

fn fit(seed: u64, rows: Rows) -> Solution {
    let mut r = rng(seed);
    let free = Free::everything(6);
    let mut chain = Chain::nominal(six_r())
        .posed(&mut r, rows.count, 1.4)
        .deviate(&mut r, &free, 0.005, 0.002);
    if rows.motion > 0 {
        let q = chain.q.clone();
        for (s, own) in chain.q.iter_mut().enumerate() {
            let part = (s % rows.motion) as f64 / rows.motion as f64;
            let (from, to) = (&q[s / rows.motion], &q[s / rows.motion + 1]);
            let between = from.iter().zip(to).map(|(a, b)| a + (b - a) * part);
            *own = between.collect();
        }
    }
    let mut h = chain.problem(&free, SIGMA);
    h.problem.group_mut(h.markers).estimate = true;
    h.scattering_joints(JOINT);
    let mut state: Vec<Vector3<f64>> = chain.markers.iter().map(|_| normal3(&mut r)).collect();
    let bump = normal3(&mut r).normalize() * rows.bump;
    let mut wander = match rows.wander {
        0.0 => Vector3::zeros(),
        sigma => normal3(&mut r) * sigma,
    };
    let mut off = Vec::new();
    let mut markers = Vec::new();
    for (sample, q) in chain.q.iter().enumerate() {
        if sample % rows.shared == 0 {
            off = q.iter().map(|_| normal(&mut r) * JOINT).collect();
        }
        let x = chain.tracker_from_body(q, &off);
        if rows.wander > 0.0 {
            let new = normal3(&mut r) * rows.wander;
            wander = wander * 0.9 + new * 0.19_f64.sqrt();
        }
        for (m, p) in chain.markers.iter().enumerate() {
            let new = normal3(&mut r) * (1.0 - rows.rho * rows.rho).sqrt();
            state[m] = state[m] * rows.rho + new;
            let moved = if 2 * sample < rows.count { 0.0 } else { 1.0 };
            markers.push(MarkerObservation {
                sample,
                point: h.points[m],
                position: x * p + state[m] * SIGMA + bump * moved + wander,
                shape: None,
            });
        }
    }
    let p = &mut h.problem;
    p.markers("body", h.tracker, h.body, h.markers, markers);
    solve(&h.problem, &Settings::default()).expect("solves")
}

/// Of some robots, those whose recordings are said to have a change, or to lack an effect.
fn named(robots: u64, rows: Rows) -> (usize, usize) {
    let (mut changed, mut missing) = (0, 0);
    for seed in 0..robots {
        let solution = fit(seed, rows);
        let scan = solution.changes(&ChangeSettings::default());
        changed += usize::from(scan.expect("evaluable").significant().is_some());
        let goodness = solution.goodness_of_fit().expect("evaluable");
        missing += usize::from(!goodness.missing.is_empty());
    }
    (changed, missing)
}

/// As many robots as decide, or a few of them.
fn robots(all: u64) -> u64 {
    if skipped_tests::thorough() {
        all
    } else {
        all.div_ceil(4)
    }
}

/// Before memory was asked for, 15 of 40, 15 of 20, all and all of these recordings were called changed.
#[test]
fn memory_is_neither_a_change_nor_an_effect() {
    let rho = 0.9;
    let static_poses = Rows { rho, ..STATIC };
    let short = Rows {
        motion: 10,
        ..static_poses
    };
    let long = Rows {
        count: 1000,
        motion: 20,
        ..static_poses
    };
    assert_eq!(named(robots(40), static_poses), (0, 0));
    assert_eq!(named(robots(20), short), (0, 0));
    assert_eq!(
        named(
            robots(20),
            Rows {
                count: 200,
                ..short
            }
        ),
        (0, 0)
    );
    assert_eq!(named(robots(10), long), (0, 0));
    assert_eq!(named(robots(10), Rows { rho: 0.5, ..long }), (0, 0));
}

/// A stand that moves slowly is no step. The noise of single markers has no memory.
#[test]
fn what_wanders_is_no_change() {
    for (count, wander) in [(60, SIGMA), (200, SIGMA), (200, 2.0 * SIGMA)] {
        let rows = Rows {
            count,
            wander,
            ..STATIC
        };
        let all = robots(20);
        let (changed, missing) = named(all, rows);
        // With 60 rows 2 of 20, with 200 none.
        assert!(
            changed as u64 <= all.div_ceil(8) && missing == 0,
            "{count} rows, {wander}: {changed}, {missing}"
        );
    }
}

/// Joints that err by the same in twenty rows: the noise of the markers has no memory.
#[test]
fn joint_errors_that_rows_share_are_no_change() {
    let rows = Rows {
        count: 1000,
        motion: 20,
        shared: 20,
        ..STATIC
    };
    let (changed, missing) = named(robots(20), rows);
    assert!(changed <= 1, "{changed}");
    assert_eq!(missing, 0);
}

#[test]
fn a_bump_is_named_beside_memory() {
    let long = Rows {
        count: 1000,
        motion: 20,
        rho: 0.9,
        shared: 1,
        bump: 0.5e-3,
        wander: 0.0,
    };
    let held = Rows {
        shared: 20,
        rho: 0.0,
        ..long
    };
    let independent = Rows {
        bump: 0.5e-3,
        ..STATIC
    };
    let (mut z2, mut count) = (0.0, 0.0);
    for (rows, robots) in [(long, 6), (held, 6), (independent, 12)] {
        for seed in 0..robots {
            let solution = fit(seed, rows);
            let scan = solution.changes(&ChangeSettings::default());
            let scan = scan.expect("evaluable");
            let change = scan.significant().expect("a bump");
            let moved = matches!(change.moved, Moved::Reference(_) | Moved::Drift(_));
            assert!(moved, "{seed}: {change:?}");
            if rows.count > STATIC.count && matches!(change.moved, Moved::Reference(_)) {
                let length = Vector3::from_column_slice(&change.jump[3..]).norm();
                let sigma = Vector3::from_column_slice(&change.sigma[3..]).norm();
                z2 += ((length - rows.bump) / sigma).powi(2);
                count += 1.0;
            }
        }
    }
    // ± of rows that were taken for independent was 4 to 5 times too small.
    assert!(count > 6.0 && z2 / count < 3.0, "{}", z2 / count);
}
