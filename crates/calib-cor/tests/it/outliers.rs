//! Few points with gross outliers: an answer that nothing confirms is no answer.

use crate::common::{Noise, hand, marker};
use calib_cor::{Input, Options, Outcome, fit};
use nalgebra::{Point3, Vector3};

const CENTER: Vector3<f64> = Vector3::new(1.2, -0.8, 0.9);
const MM: f64 = 1e-3;

/// Nine points of the hand's range, some of them anywhere within half a meter of where they were.
fn nine(moved: &[usize], seed: u64) -> Vec<Option<Point3<f64>>> {
    let mut noise = Noise::new(seed);
    let mut track = marker(
        &hand(9),
        &CENTER,
        &Vector3::new(0.0, -0.1, 0.0),
        MM,
        &mut noise,
    );
    for k in moved {
        let off = Vector3::from_fn(|_, _| noise.uniform() - 0.5);
        track[*k] = track[*k].map(|p| p + off);
    }
    track
}

fn robust(track: Vec<Option<Point3<f64>>>, known: bool) -> Outcome {
    let options = Options {
        sigma_t: known.then_some(MM),
        ..Options::default()
    };
    fit("robust", &Input::Points(&[track]), &options).expect("robust")
}

/// The six points outside the middle row lie in one plane (half a turn apart): with two of the middle row wrong, any one of its three points makes
/// an exact sphere with them. Nobody can say which.
#[test]
fn a_center_that_rests_on_one_sample_is_refused() {
    let mut answered = Vec::new();
    for moved in [[3, 5], [3, 4], [4, 5]] {
        for seed in 0..30 {
            let outcome = robust(nine(&moved, seed), true);
            if outcome.estimate().is_some() {
                answered.push((moved, seed));
            }
        }
    }
    // Two outliers may happen to lie on one sphere with the plane's circle: then they do confirm each other.
    assert!(answered.len() <= 2, "{answered:?}");
    let outcome = robust(nine(&[3, 5], 1), true);
    let reason = outcome.reason().expect("a reason");
    assert!(
        reason.contains("rests on sample") || reason.contains("two centers"),
        "{reason}"
    );
}

/// Without outliers the same seven points are answered as they always were: nothing is chosen.
#[test]
fn a_sample_that_decides_is_trusted_where_nothing_is_left_out() {
    for seed in 0..30 {
        let mut track = nine(&[], seed);
        track[3] = None;
        track[5] = None;
        let outcome = robust(track, true);
        let estimate = outcome.estimate().expect("a center");
        let off = (estimate.center.coords - CENTER).norm();
        assert!(
            off < 10.0 * estimate.covariance.trace().sqrt(),
            "{seed}: {off}"
        );
    }
}

/// Three degrees of freedom do not tell four unknowns' noise from a lucky choice of seven among nine.
#[test]
fn two_of_nine_need_a_stated_noise() {
    let mut said = 0;
    for seed in 0..30 {
        let outcome = robust(nine(&[0, 7], seed), false);
        let chosen = outcome.estimate().map_or(0, |e| e.rejected.len());
        assert!(chosen < 2, "{seed}: {chosen} left out");
        let reason = outcome.reason().unwrap_or_default();
        said += usize::from(reason.contains("degrees of freedom"));
    }
    assert!(said > 0);
    let outcome = robust(nine(&[0, 7], 4), true);
    let estimate = outcome.estimate().expect("a center");
    assert_eq!(
        estimate.rejected.iter().map(|r| r.row).collect::<Vec<_>>(),
        [0, 7]
    );
    assert!((estimate.center.coords - CENTER).norm() < 6.0 * MM);
}

/// Answers that are wrong by more than five of their own σ, of all trials with two gross outliers anywhere: 28 of 558 answered ones were, before
/// the center had to rest on more than one sample.
fn confident_and_wrong(trials: u64) -> (usize, usize) {
    let (mut wrong, mut answered) = (0, 0);
    for seed in 0..trials {
        let mut which = Noise::new(seed + 10_000);
        let first = (9.0 * which.uniform()) as usize;
        let second = (first + 1 + (8.0 * which.uniform()) as usize) % 9;
        let outcome = robust(nine(&[first, second], seed), true);
        let Some(estimate) = outcome.estimate() else {
            continue;
        };
        answered += 1;
        let e = estimate.center.coords - CENTER;
        let d2 = estimate
            .covariance
            .cholesky()
            .map_or(f64::INFINITY, |c| e.dot(&c.solve(&e)));
        wrong += usize::from(d2 > 30.0);
    }
    println!("{wrong} wrong of {answered} answered of {trials}");
    (wrong, answered)
}

#[test]
fn nine_points_with_two_outliers_are_seldom_wrong() {
    let (wrong, answered) = confident_and_wrong(400);
    assert!(wrong <= 5, "{wrong}");
    assert!(answered >= 320, "{answered}: refusing all is no method");
}
