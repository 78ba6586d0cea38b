//! What the parameters' uncertainty does to a point over postures: against the covariance of single predictions, and against
//! cases whose answer is known.

use crate::common::*;
use calib_core::{
    Chart, Configuration, LinearPoint, Placement, PostureSpread, Settings, Solution, Target, solve,
};
use nalgebra::Point3;

const POSTURES: usize = 24;

fn solved(free: &Free, noise: f64, seed: u64) -> (Solution, Handles) {
    let mut r = rng(seed);
    let chain = Chain::nominal(six_r()).posed(&mut r, 25, 1.2);
    let mut h = chain.problem(free, noise);
    chain.observe(&mut r, &mut h, noise, 0.0);
    let solution = solve(&h.problem, &Settings::plain()).expect("solved");
    (solution, h)
}

fn postures(h: &Handles) -> Vec<Configuration> {
    let at = |i: usize| {
        let joints = h.joints.iter().enumerate();
        joints.fold(Configuration::zero(), |at, (k, joint)| {
            at.with(*joint, (0.7 * (i * (k + 2)) as f64).sin())
        })
    };
    (0..POSTURES).map(at).collect()
}

fn spread(s: &Solution, h: &Handles, placement: Placement) -> PostureSpread {
    let points: Vec<LinearPoint> = postures(h)
        .iter()
        .map(|at| {
            s.linear_point(h.tracker, Target::Frame(h.body), at)
                .expect("a path")
        })
        .collect();
    s.spread(&points, placement).expect("postures")
}

#[test]
fn the_spread_is_that_of_single_predictions() {
    let mut free = Free::everything(6);
    free.prior = Some((0.02, 0.01));
    let (s, h) = solved(&free, 1e-3, 3);
    let spread = spread(&s, &h, Placement::Counts);
    let mut squares = 0.0;
    for (at, sigma) in postures(&h).iter().zip(&spread.sigma) {
        let one = s.predict_point(h.tracker, h.body, &Point3::origin(), at);
        let variance = one.expect("a path").covariance.expect("known").trace();
        assert!(
            (sigma * sigma / variance - 1.0).abs() < 1e-6,
            "{sigma} {variance}"
        );
        squares += variance / POSTURES as f64;
    }
    assert!((spread.rms.powi(2) / squares - 1.0).abs() < 1e-6);
    // The directions are independent: their squares add up, and none is worse than the first.
    let parts: f64 = spread.directions.iter().map(|d| d.rms * d.rms).sum();
    assert!((parts / squares - 1.0).abs() < 1e-6, "{parts} {squares}");
    assert!(spread.directions.is_sorted_by(|a, b| a.rms >= b.rms));
    assert!(
        spread
            .directions
            .iter()
            .all(|d| d.max >= d.rms && !d.terms.is_empty())
    );
    assert!(!spread.unbounded);
}

#[test]
fn a_prior_holds_what_the_data_do_not_see() {
    let share = |position: f64, noise: f64| {
        let mut free = Free::everything(6);
        (free.world, free.mount, free.points) = (Chart::none(), Chart::none(), false);
        free.prior = Some((position, position));
        let (s, h) = solved(&free, noise, 5);
        let spread = spread(&s, &h, Placement::Counts);
        let size = spread.size.expect("postures apart");
        assert!(size.sigma > 0.0);
        (spread.prior_share, size.prior_share)
    };
    // A tracker of 0.1 mm decides against priors of 100 mm; priors of 1 µm against a tracker of 10 mm.
    let (all, size) = share(0.1, 1e-4);
    assert!(all < 0.01 && size < 0.01, "{all} {size}");
    let (all, size) = share(1e-6, 1e-2);
    assert!(all > 0.5 && size > 0.9, "{all} {size}");
}

#[test]
fn where_the_robot_stands_is_no_part_of_its_shape() {
    let mut free = Free::nothing(6);
    free.world = Chart::full();
    let (s, h) = solved(&free, 1e-3, 7);
    let placed = spread(&s, &h, Placement::Counts);
    let shape = spread(&s, &h, Placement::Free);
    assert!(placed.rms > 1e-5, "{}", placed.rms);
    assert!(shape.rms < 1e-9 * placed.rms.max(1.0), "{}", shape.rms);
    assert!(placed.size.expect("apart").sigma < 1e-9);
}
