//! Noise levels of their own for markers, on arms with one marker that scatters unlike the others.

use crate::common::{Chain, Free, normal3, rng, six_r};
use calib_core::{MeasurementKind, NoiseKind, PointId, Settings, Solution, solve};

const MARKER: f64 = 2e-4;
/// Joint noise, rad.
const JOINT: f64 = 2e-4;

/// How the poses lie.
#[derive(Debug, Clone, Copy)]
enum Design {
    Random,
    Sweeps,
}

/// An arm with `markers` markers, the second of which has so many times the noise of the others.
fn solved(seed: u64, design: Design, markers: usize, ratio: f64) -> (Solution, PointId) {
    let mut r = rng(seed);
    let free = Free {
        prior: Some((0.0175, 0.01)),
        ..Free::frames_and_offsets(6)
    };
    let mut chain = Chain::nominal(six_r()).posed(&mut r, 40, 1.4);
    chain.markers.truncate(markers);
    if let Design::Sweeps = design {
        // One joint moves at a time.
        let still = [0.2, -0.5, 0.7, 0.1, 0.6, -0.3];
        let moved = chain.q.iter().enumerate();
        let swept = moved.map(|(s, q)| {
            let mut at = still.to_vec();
            at[s % 6] = q[s % 6];
            at
        });
        chain.q = swept.collect();
    }
    let chain = chain.deviate(&mut r, &free, 0.005, 0.001);
    let mut h = chain.problem(&free, MARKER);
    h.problem.group_mut(h.markers).estimate = true;
    let joints = h
        .problem
        .noise_group("joint", NoiseKind::Joint, JOINT, true);
    for j in &h.joints {
        h.problem.joint_noise(*j, joints);
    }
    chain.observe(&mut r, &mut h, MARKER, JOINT);
    let bad = h.points[1];
    let more = (ratio * ratio - 1.0).max(0.0).sqrt() * MARKER;
    for measurement in h.problem.measurements_mut() {
        if let MeasurementKind::Markers(seen) = &mut measurement.kind {
            for o in seen.observations.iter_mut().filter(|o| o.point == bad) {
                o.position += normal3(&mut r) * more;
            }
        }
    }
    (solve(&h.problem, &Settings::default()).unwrap(), bad)
}

#[test]
fn a_marker_that_scatters_more_has_its_own_noise() {
    let mut wrong = Vec::new();
    for (design, markers) in [
        (Design::Random, 4),
        (Design::Random, 3),
        (Design::Sweeps, 4),
        (Design::Sweeps, 3),
    ] {
        for (seed, ratio) in [(40, 2.5), (41, 6.0)] {
            let cell = format!("{design:?}, {markers} markers, {ratio} times");
            let (solution, bad) = solved(seed, design, markers, ratio);
            let Some((own, apart)) = solution.with_levels_by_marker(&Settings::default()) else {
                wrong.push(format!("{cell}: not found"));
                continue;
            };
            // 120 coordinates of the marker: 6.5 %.
            let level = own.noise.last().expect("its level");
            let (sigma, others) = (level.sigma / (ratio * MARKER), own.noise[0].sigma / MARKER);
            if apart != [bad] || (sigma - 1.0).abs() > 0.25 || (others - 1.0).abs() > 0.2 {
                wrong.push(format!(
                    "{cell}: {apart:?}, {sigma:.2} and {others:.2} of the truth"
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn markers_that_scatter_alike_share_their_noise() {
    for (design, markers) in [
        (Design::Random, 4),
        (Design::Sweeps, 3),
        (Design::Random, 2),
    ] {
        for seed in 0..4 {
            let (solution, _) = solved(80 + seed, design, markers, 1.0);
            let own = solution.with_levels_by_marker(&Settings::default());
            assert!(own.is_none(), "{design:?}, {markers} markers, {seed}");
        }
    }
}
