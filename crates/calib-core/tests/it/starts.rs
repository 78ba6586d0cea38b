//! Sweeps of one joint after another with backlash: the side from which a joint came before its first motion, and causes that look
//! alike beside each other.
//!
//! Power: backlash of 1 mrad in joints 2 and 3, four markers with 0.2 mm, six seeds; every pattern of sides over the seeds.

use crate::common::{Chain, Free, Handles, normal3, rng, six_r};
use calib_core::{
    ChangeSettings, EffectKind, MarkerObservation, OpenStart, Settings, Solution, StartChange,
    StartDirection, Suspect, solve,
};
use nalgebra::Vector3;
use rand::RngExt;

const SIGMA: f64 = 2e-4;
/// Half of the backlash of joints 2 and 3, rad.
const BACKLASH: f64 = 1e-3;
/// Postures of each joint's sweep; the held-out recording repeats the sweeps of another home.
const EACH: usize = 9;
const SIX: usize = 6 * EACH;

struct Sweeps {
    handles: Handles,
    /// The true sides of joints 2 and 3 in the fitted and in the held-out recording.
    sides: [[f64; 2]; 2],
}

/// What is wrong beside the geometry.
#[derive(Clone, Copy, PartialEq)]
enum Wrong {
    Backlash,
    /// The body steps where joint 3 begins to move.
    Slip,
}

/// What the model has of backlash.
#[derive(Clone, Copy, PartialEq)]
enum Model {
    /// Nothing: it is tested.
    Tested,
    Free,
    /// The same with the sides of the fitted recording as they were.
    Known,
}

fn sweeps(seed: u64, wrong: Wrong, model: Model) -> Sweeps {
    let mut r = rng(seed);
    let free = Free::frames_and_offsets(6);
    let mut chain = Chain::nominal(six_r()).posed(&mut r, 2 * SIX, 1.4);
    for part in 0..2 {
        let home: Vec<f64> = (0..6).map(|_| r.random_range(-0.8..0.8)).collect();
        for i in 0..SIX {
            let mut q = home.clone();
            q[i / EACH] = -1.2 + 2.4 * (i % EACH) as f64 / (EACH - 1) as f64;
            chain.q[part * SIX + i] = q;
        }
    }
    let chain = chain.deviate(&mut r, &free, 0.01, 0.005);
    let side = |bit: u64| if (seed >> bit) & 1 == 1 { -1.0 } else { 1.0 };
    // From above, and then up through its sweep, a joint's backlash is the zero of the next one to a fit of these data.
    let sides = [[1.0, 1.0], [side(0), side(1)]];
    let n = chain.q.len();
    let mut told = vec![vec![0.0; n]; 6];
    for (j, told) in told.iter_mut().enumerate() {
        for s in 1..n {
            let step = chain.q[s][j] - chain.q[s - 1][j];
            told[s] = match step {
                _ if s == SIX => 0.0,
                step if step.abs() > 1e-9 => step.signum(),
                _ => told[s - 1],
            };
        }
    }
    let mut handles = chain.problem(&free, SIGMA);
    let truth = told.clone();
    let moved = move |s: usize| -> Vec<f64> {
        let of = |j: usize| match (wrong, j) {
            (Wrong::Backlash, 1 | 2) => {
                let known = truth[j][s];
                let side = if known == 0.0 {
                    sides[s / SIX][j - 1]
                } else {
                    known
                };
                -BACKLASH * side
            }
            _ => 0.0,
        };
        (0..6).map(of).collect()
    };
    let mut noise = rng(seed + 1000);
    let mut seen = Vec::new();
    for (s, q) in chain.q.iter().enumerate() {
        let x = chain.tracker_from_body(q, &moved(s));
        let slipped = wrong == Wrong::Slip && s >= 2 * EACH;
        let slip = Vector3::y() * if slipped { 2e-3 } else { 0.0 };
        for (m, p) in chain.markers.iter().enumerate() {
            seen.push(MarkerObservation {
                sample: s,
                point: handles.points[m],
                position: x * (p + slip) + normal3(&mut noise) * SIGMA,
                shape: None,
            });
        }
    }
    let Handles {
        tracker,
        body,
        markers,
        ..
    } = handles;
    handles
        .problem
        .markers("body", tracker, body, markers, seen);
    handles.problem.held_out = (SIX..n).collect();
    if model == Model::Known {
        for j in [1, 2] {
            let unknown = told[j][..SIX].iter_mut().filter(|a| **a == 0.0);
            unknown.for_each(|a| *a = sides[0][j - 1]);
        }
    }
    for (j, edge) in handles.joints.clone().into_iter().enumerate() {
        let values: Vec<f64> = told[j].iter().map(|a| -a).collect();
        if model != Model::Tested {
            handles
                .problem
                .free_effect_with(edge, EffectKind::Backlash, values, Some(0.01));
        } else {
            handles
                .problem
                .candidate(edge, EffectKind::Backlash, values);
        }
        for part in 0..2 {
            let all = part * SIX..(part + 1) * SIX;
            let samples: Vec<usize> = all.filter(|s| told[j][*s] == 0.0).collect();
            if samples.len() > 2 {
                let by = vec![-1.0; samples.len()];
                let changes = vec![StartChange {
                    kind: EffectKind::Backlash,
                    by,
                }];
                handles.problem.open_start(OpenStart {
                    joint: edge,
                    samples,
                    changes,
                });
            }
        }
    }
    Sweeps { handles, sides }
}

fn fit(sweeps: &Sweeps) -> Solution {
    solve(&sweeps.handles.problem, &Settings::default()).unwrap()
}

/// The sides of joints 2 and 3 in one of the two recordings, as they are told.
fn told(sweeps: &Sweeps, part: usize) -> [f64; 2] {
    let solution = fit(sweeps);
    let starts = solution.model.problem().open_starts();
    let joint = |d: &StartDirection| {
        let of = |j: &usize| starts[d.start].joint == sweeps.handles.joints[*j];
        (0..6).find(of).expect("a joint")
    };
    let found = solution.start_directions();
    let own = |d: &&StartDirection| starts[d.start].samples[0] / SIX == part;
    let own: Vec<&StartDirection> = found.iter().filter(own).collect();
    // Joints without backlash have no side.
    assert!(own.iter().all(|d| [1, 2].contains(&joint(d))), "{own:?}");
    [1, 2].map(|j| {
        let of = own.iter().find(|d| joint(d) == j);
        of.map_or(0.0, |d| d.direction)
    })
}

#[test]
fn the_side_is_told_in_fitted_and_in_held_out_recordings() {
    for seed in 0..6 {
        let fitted = sweeps(seed, Wrong::Backlash, Model::Free);
        assert_eq!(told(&fitted, 0), fitted.sides[0], "{seed}");
        let held_out = sweeps(seed, Wrong::Backlash, Model::Known);
        assert_eq!(told(&held_out, 1), held_out.sides[1], "{seed}");
    }
}

#[test]
fn backlash_is_missing_with_the_side_that_suits_it_and_a_slip_explains_nothing_beside_it() {
    for seed in 0..6 {
        let solution = fit(&sweeps(seed, Wrong::Backlash, Model::Tested));
        let goodness = solution.goodness_of_fit().expect("evaluable");
        let names: Vec<&str> = goodness.missing.iter().map(|t| t.name.as_str()).collect();
        for name in ["j2.backlash", "j3.backlash"] {
            assert!(names.contains(&name), "{seed}: {names:?}");
        }
        let scan = solution.changes(&settings()).expect("evaluable");
        // Not significant beside the memory that the other joint's backlash is.
        let change = scan.changes.iter();
        let change = change.max_by(|a, b| a.score.total_cmp(&b.score));
        let change = change.expect("candidates");
        let suspects = [
            Suspect::Tested("j2.backlash"),
            Suspect::Tested("j3.backlash"),
            Suspect::Change(change),
        ];
        let contest = solution
            .contest(&suspects, Some(&scan), &[SIX])
            .expect("known");
        let (alone, _) = contest.score(2, &[]);
        let (beside, directions) = contest.score(2, &[0, 1]);
        assert!(alone > 40.0, "{seed}: {alone}");
        assert!(
            beside < contest.threshold(1e-3, directions),
            "{seed}: {beside}"
        );
        assert!(contest.explains(&[0, 1]) > 0.5, "{seed}");
    }
}

#[test]
fn beside_a_slip_nothing_is_missing() {
    for seed in 0..6 {
        let solution = fit(&sweeps(seed, Wrong::Slip, Model::Tested));
        let goodness = solution.goodness_of_fit().expect("evaluable");
        let scan = solution.changes(&settings()).expect("evaluable");
        let change = scan.significant().expect("a slip");
        assert!(
            change.first.abs_diff(2 * EACH) <= 1,
            "{seed}: {}",
            change.first
        );
        let mut suspects = vec![Suspect::Change(change)];
        suspects.extend(goodness.missing.iter().map(|t| Suspect::Tested(&t.name)));
        let contest = solution
            .contest(&suspects, Some(&scan), &[SIX])
            .expect("known");
        let others: Vec<usize> = (1..suspects.len()).collect();
        assert!(contest.score(0, &others).0 > 40.0, "{seed}");
        for other in others {
            let (score, directions) = contest.score(other, &[0]);
            let least = contest.threshold(1e-3 / goodness.tests.len() as f64, directions);
            assert!(
                score < least,
                "{seed}: {} {score}",
                goodness.missing[other - 1].name
            );
        }
    }
}

fn settings() -> ChangeSettings {
    let mut settings = ChangeSettings::default();
    settings.borders = vec![SIX];
    settings
}
