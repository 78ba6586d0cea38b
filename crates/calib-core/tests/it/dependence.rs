//! Noise with a memory: noticed, measured, and the intervals cover again; noise without one is left alone.

use crate::common::{Chain, Free, Handles, normal, normal3, rng, six_r};
use calib_core::{
    Configuration, Dependence, NoiseKind, PoseNoise, PoseObservation, Settings, Solution, solve,
};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;

/// Marker noise, m.
const SIGMA: f64 = 3e-4;
/// Orientation noise of a body that is measured as a pose, rad.
const TURN: f64 = 1e-3;
/// Joint noise, rad (0.01°).
const JOINT: f64 = 1.7e-4;
/// Two-sided 95 %.
const Z95: f64 = 1.96;

struct Case {
    chain: Chain,
    h: Handles,
    solution: Solution,
}

/// What the tracker reports.
#[derive(Clone, Copy, PartialEq)]
enum Seen {
    Markers,
    Poses,
    /// Markers whose noise has no memory; all of them move together by so many times it, slowly.
    Wander(f64),
}

/// `poses` random poses; the noise of positions is an autoregression of first order by rows, along the axes of the tracker.
fn case(seen: Seen, seed: u64, poses: usize, rho: f64) -> Case {
    case_of(Free::everything(6), seen, (seed, 1.0), poses, rho)
}

/// The same with what is `known`, and lengths times a factor.
fn case_of(free: Free, seen: Seen, (seed, factor): (u64, f64), poses: usize, rho: f64) -> Case {
    let mut r = rng(seed);
    let chain = Chain::nominal(six_r())
        .posed(&mut r, poses, 1.4)
        .deviate(&mut r, &free, 0.005, 0.002);
    let mut h = chain.problem(&free, SIGMA);
    h.problem.group_mut(h.markers).estimate = true;
    h.scattering_joints(JOINT);
    let mut stand = match seen {
        Seen::Wander(_) => normal3(&mut r),
        _ => Vector3::zeros(),
    };
    let mut state: Vec<Vector3<f64>> = chain.markers.iter().map(|_| normal3(&mut r)).collect();
    let (mut markers, mut bodies) = (Vec::new(), Vec::new());
    for (sample, q) in chain.q.iter().enumerate() {
        let extra: Vec<f64> = q.iter().map(|_| normal(&mut r) * JOINT).collect();
        let x = chain.tracker_from_body(q, &extra);
        for state in &mut state {
            *state = *state * rho + normal3(&mut r) * (1.0 - rho * rho).sqrt();
        }
        if let Seen::Wander(size) = seen {
            stand = stand * rho + normal3(&mut r) * (1.0 - rho * rho).sqrt();
            for state in &mut state {
                *state = normal3(&mut r) + stand * size;
            }
        }
        for (m, p) in chain.markers.iter().enumerate() {
            markers.push(calib_core::MarkerObservation {
                sample,
                point: h.points[m],
                position: (x * p + state[m] * SIGMA) * factor,
                shape: None,
            });
        }
        let turned = UnitQuaternion::from_scaled_axis(normal3(&mut r) * TURN);
        let at = Translation3::from((x.translation.vector + state[0] * SIGMA) * factor);
        let pose = Isometry3::from_parts(at, x.rotation * turned);
        bodies.push(PoseObservation {
            sample,
            pose,
            inverse: false,
        });
    }
    let p = &mut h.problem;
    match seen {
        Seen::Markers | Seen::Wander(_) => p.markers("body", h.tracker, h.body, h.markers, markers),
        Seen::Poses => {
            let orientation = p.noise_group("turn", NoiseKind::Orientation, TURN, true);
            let noise = PoseNoise::Split {
                orientation,
                position: h.markers,
            };
            p.poses("body", h.tracker, h.body, noise, bodies);
        }
    }
    let mut settings = Settings::default();
    settings.robust.enabled = false;
    let solution = solve(&h.problem, &settings).expect("solves");
    Case { chain, h, solution }
}

/// Part of the coordinates of a marker at new poses within their 95 % intervals, and the mean square of their z.
fn coverage(case: &Case, solution: &Solution, seed: u64) -> (f64, f64) {
    let mut r = rng(1000 + seed);
    let (mut inside, mut z2, mut count) = (0.0, 0.0, 0.0);
    for _ in 0..30 {
        let q: Vec<f64> = (0..6).map(|_| r.random_range(-1.4..1.4)).collect();
        let mut at = Configuration::zero();
        for (joint, q) in case.h.joints.iter().zip(&q) {
            at = at.with(*joint, *q);
        }
        let p = Point3::origin();
        let found = solution
            .predict_point(case.h.tracker, case.h.body, &p, &at)
            .expect("a path");
        let truth = case.chain.tracker_from_body(&q, &[0.0; 6]) * p;
        let covariance = found.covariance.expect("estimable");
        for i in 0..3 {
            let z = (found.position[i] - truth[i]) / covariance[(i, i)].sqrt();
            inside += f64::from(z.abs() < Z95);
            z2 += z * z;
            count += 1.0;
        }
    }
    (inside / count, z2 / count)
}

/// Mean coverage over robots: as the fit states it, and under the memory found; and how often one is significant.
fn mean_coverage(
    seen: Seen,
    robots: u64,
    poses: usize,
    rho: f64,
) -> ([f64; 2], [f64; 2], usize, f64) {
    let (mut naive, mut under, mut significant, mut decay) = ([0.0; 2], [0.0; 2], 0, 0.0);
    let part = 1.0 / robots as f64;
    for seed in 0..robots {
        let case = case(seen, seed, poses, rho);
        let found: Dependence = case.solution.dependence(&[]).expect("enough samples");
        significant += usize::from(found.is_significant());
        decay += part * found.decay;
        let mended = case.solution.under(&found, &[]).expect("evaluable");
        for (sum, solution) in [(&mut naive, &case.solution), (&mut under, &mended)] {
            let (inside, z2) = coverage(&case, solution, seed);
            sum[0] += part * inside;
            sum[1] += part * z2;
        }
    }
    (naive, under, significant, decay)
}

#[test]
fn noise_with_a_memory_is_measured_and_covered() {
    for poses in [40, 100] {
        let (naive, under, significant, decay) = mean_coverage(Seen::Markers, 16, poses, 0.9);
        assert_eq!(significant, 16);
        assert!((decay - 0.9).abs() < 0.05, "{decay}");
        assert!(naive[0] < 0.88, "the fault is there: {naive:?}");
        // 16 robots × 90 coordinates that share their fit: ± 1.5 %
        assert!((0.93..0.985).contains(&under[0]), "{poses}: {under:?}");
    }
}

/// The memory of positions stands still in the tracker's frame, and turns in the body's.
#[test]
fn positions_of_poses_with_a_memory_are_covered() {
    for poses in [40, 100] {
        let (naive, under, significant, decay) = mean_coverage(Seen::Poses, 16, poses, 0.9);
        assert_eq!(significant, 16);
        assert!((decay - 0.9).abs() < 0.05, "{decay}");
        assert!(naive[0] < 0.85, "the fault is there: {naive:?}");
        assert!((0.93..0.985).contains(&under[0]), "{poses}: {under:?}");
    }
}

/// A stand or air that moves all markers alike. With a memory of 33 samples the parameters take up most of what would show it.
#[test]
fn what_moves_together_is_covered() {
    for (size, rho, poses, often, least) in [
        (1.0, 0.9, 60, 13, 0.93),
        (2.0, 0.9, 150, 16, 0.93),
        (0.5, 0.97, 150, 10, 0.72),
        (1.0, 0.97, 150, 16, 0.8),
    ] {
        let seen = Seen::Wander(size);
        let (naive, under, significant, decay) = mean_coverage(seen, 16, poses, rho);
        let case = format!("{size}, {rho}, {poses}: {naive:?}, {under:?}, {decay}");
        println!("{case}");
        assert!(significant >= often, "{case}: {significant}");
        assert!(naive[0] < 0.8, "the fault is there: {case}");
        assert!(under[0] >= least, "{case}");
    }
}

#[test]
fn noise_without_a_memory_is_left_alone() {
    left_alone(Seen::Markers);
    left_alone(Seen::Poses);
}

fn left_alone(seen: Seen) {
    let (naive, under, significant, _) = mean_coverage(seen, 30, 40, 0.0);
    assert_eq!(significant, 0);
    assert!((0.92..0.975).contains(&naive[0]), "{naive:?}");
    // Even where it is not significant, what is found hardly changes the intervals.
    assert!((naive[0] - under[0]).abs() < 0.02, "{naive:?} {under:?}");
}

/// A memory ends where a recording ends: pairs across a border are not counted.
#[test]
fn borders_cut_the_memory() {
    let case = case(Seen::Markers, 1, 40, 0.9);
    let every: Vec<usize> = (1..40).collect();
    assert_eq!(case.solution.dependence(&every), None);
}

/// Robots that are known from their drawings in many directions: in some of these a memory adds next to nothing, of either sign.
#[test]
fn what_a_memory_adds_does_not_depend_on_rounding() {
    let mut free = Free::everything(6);
    free.prior = Some((0.01, 0.005));
    let mut found = 0;
    for (seed, seen) in (0..12).map(|seed| (seed, [Seen::Markers, Seen::Poses][seed as usize % 2]))
    {
        let sigmas = |factor: f64| {
            let case = case_of(free.clone(), seen, (seed, factor), 14, 0.9);
            let memory = case.solution.dependence(&[])?;
            let under = case.solution.under(&memory, &[])?;
            let significant = memory.is_significant();
            Some((
                significant,
                under.parameters.iter().map(|p| p.sigma).collect::<Vec<_>>(),
            ))
        };
        let (Some((significant, one)), Some((_, other))) = (sigmas(1.0), sigmas(1.0 + 1e-14))
        else {
            continue;
        };
        found += usize::from(significant);
        for (k, (one, other)) in one.iter().zip(&other).enumerate() {
            if let (Some(one), Some(other)) = (one, other) {
                // Lengths differ by 10⁻¹⁴. Where rounding chose the directions, σ differed by 3·10⁻⁶.
                let off = (one / other - 1.0).abs();
                assert!(off < 1e-7, "{seed}: {k}: {one:e} {other:e}");
            }
        }
    }
    assert!(found > 5, "{found}");
}

/// A covariance that allows for noise of another form already, as that of the clusters does, is added to: a product of the two would be many times larger.
#[test]
fn memory_adds_to_a_covariance_that_is_wider_already() {
    let case = case(Seen::Markers, 5, 150, 0.8);
    let found = case.solution.dependence(&[]).expect("enough samples");
    assert!(found.is_significant(), "{found:?}");
    let wide = case.solution.with_cluster_covariance().expect("evaluable");
    let sigmas = |solution: &Solution| -> Vec<f64> {
        let of = solution.parameters.iter().filter_map(|p| p.sigma);
        of.collect()
    };
    let under = |solution: &Solution| sigmas(&solution.under(&found, &[]).expect("evaluable"));
    let (plain, wider) = (sigmas(&case.solution), sigmas(&wide));
    let (mended, both) = (under(&case.solution), under(&wide));
    let mut apart = 0;
    for i in 0..plain.len() {
        let expected =
            mended[i].powi(2) + found.level * (wider[i].powi(2) - plain[i].powi(2)).max(0.0);
        // Priors take a little of it.
        assert!(
            both[i].powi(2) < 1.02 * expected,
            "{i}: {} {} {} {}",
            plain[i],
            wider[i],
            mended[i],
            both[i]
        );
        apart += usize::from(wider[i] > 1.05 * plain[i]);
    }
    assert!(apart >= 3, "{apart} are wider");
    // No parameter is known worse than its prior says, but for how far the estimate went.
    let parameters = case.h.problem.parameters();
    for (parameter, sigma) in case.solution.parameters.iter().zip(&both) {
        let prior = parameters.iter().find(|p| p.name == parameter.name);
        if let Some(prior) = prior.and_then(|p| p.prior_sigma) {
            let off = parameter.value - parameter.nominal;
            assert!(*sigma < 1.001 * prior.hypot(off), "{}", parameter.name);
        }
    }
}
