//! The direction of few poses, and covariances that cover.

use calib_estimator::{Input, Options, Verdict, chance::f_quantile};
use calib_handeye::{Correction, Covariance, HandEye, estimator, estimators};
use nalgebra::{Isometry3, SVector, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Seeds of a thorough test, or of one that is not.
fn of(all: u64, some: u64) -> u64 {
    if skipped_tests::thorough() { all } else { some }
}

/// Poses, range of the rotations about each axis (rad), noise of positions (m) and orientations (rad).
#[derive(Debug, Clone, Copy)]
struct Design(usize, f64, f64, f64);

struct Case {
    robot: Vec<Isometry3<f64>>,
    measured: Vec<Isometry3<f64>>,
    x: Isometry3<f64>,
    z: Isometry3<f64>,
}

fn case(seed: u64, Design(n, range, sigma_t, sigma_r): Design) -> Case {
    let mut r = ChaCha8Rng::seed_from_u64(seed);
    let normal = |r: &mut ChaCha8Rng| Vector3::from_fn(|_, _| StandardNormal.sample(r));
    let any = |r: &mut ChaCha8Rng| UnitQuaternion::from_scaled_axis(normal(r) * 2.0);
    let uniform = |r: &mut ChaCha8Rng, by: f64| Vector3::from_fn(|_, _| r.random_range(-by..by));
    let (rx, rz, first) = (any(&mut r), any(&mut r), any(&mut r));
    let x = Isometry3::from_parts(Translation3::from(uniform(&mut r, 0.2)), rx);
    let z = Isometry3::from_parts(Translation3::from(uniform(&mut r, 2.0)), rz);
    let poses = |_| {
        let rotation = first * UnitQuaternion::from_scaled_axis(uniform(&mut r, range));
        Isometry3::from_parts(Translation3::from(uniform(&mut r, 0.4)), rotation)
    };
    let robot: Vec<Isometry3<f64>> = (0..n).map(poses).collect();
    let mut r = ChaCha8Rng::seed_from_u64(!seed);
    let seen = |a: &Isometry3<f64>| {
        let b = z.inverse() * a * x;
        let (place, turn) = (normal(&mut r) * sigma_t, normal(&mut r) * sigma_r);
        Isometry3::from_parts(
            Translation3::from(b.translation.vector + place),
            b.rotation * UnitQuaternion::from_scaled_axis(turn),
        )
    };
    let measured = robot.iter().map(seen).collect();
    Case {
        robot,
        measured,
        x,
        z,
    }
}

fn fit(id: &str, robot: &[Isometry3<f64>], measured: &[Isometry3<f64>]) -> HandEye {
    let input = Input::PosePairs { robot, measured };
    let outcome = estimator(id)
        .expect("in the table")
        .run(&input, &Options::default());
    outcome
        .expect("poses")
        .estimate()
        .expect("two axes")
        .clone()
}

fn says_inverted(e: &HandEye) -> bool {
    let candidates = e.explanation.iter().flat_map(|x| &x.candidates).flatten();
    candidates
        .into_iter()
        .any(|c| matches!(c, Correction::InvertedPoses(_)))
}

fn inverted(poses: &[Isometry3<f64>]) -> Vec<Isometry3<f64>> {
    poses.iter().map(Isometry3::inverse).collect()
}

#[test]
fn three_poses_do_not_show_their_direction() {
    for design in [Design(3, 0.8, 3e-4, 9e-4), Design(3, 0.8, 1e-3, 5e-3)] {
        for seed in 0..of(100, 30) {
            let c = case(seed, design);
            let right = fit("handeye", &c.robot, &c.measured);
            let wrong = fit("handeye", &c.robot, &inverted(&c.measured));
            for e in [&right, &wrong] {
                assert!(!says_inverted(e), "{design:?} {seed}: {:?}", e.reason);
            }
            assert!(right.open_direction.is_some(), "{design:?} {seed}");
            assert!(
                wrong.open_direction.is_some() || wrong.verdict != Verdict::Ok,
                "{design:?} {seed}: a wrong direction is accepted without a word"
            );
        }
    }
}

#[test]
fn a_direction_is_named_where_the_poses_show_it() {
    let designs = [
        Design(4, 0.8, 3e-4, 9e-4),
        Design(4, 0.5, 1e-3, 5e-3),
        Design(5, 0.8, 1e-3, 5e-3),
        Design(10, 0.6, 1e-3, 5e-3),
        Design(30, 0.2, 1e-3, 5e-3),
    ];
    for design in designs {
        let (mut open, mut named) = (0, 0);
        let seeds = of(100, 20);
        for seed in 0..seeds {
            let c = case(seed, design);
            let right = fit("handeye", &c.robot, &c.measured);
            let wrong = fit("handeye", &c.robot, &inverted(&c.measured));
            assert!(!says_inverted(&right), "{design:?} {seed}");
            open += u64::from(right.open_direction.is_some());
            named += u64::from(says_inverted(&wrong));
            assert!(
                wrong.open_direction.is_some() || wrong.verdict != Verdict::Ok,
                "{design:?} {seed}: a wrong direction is accepted without a word"
            );
        }
        println!("{design:?}: open {open}, named {named} of {seeds}");
        assert!(open == 0 && named == seeds, "{design:?}: {open} {named}");
    }
}

/// Right perturbation of both transforms that leads from the estimate to the truth.
fn error(e: &HandEye, c: &Case) -> SVector<f64, 12> {
    let mut out = SVector::<f64, 12>::zeros();
    for (k, d) in [e.x.inverse() * c.x, e.z.inverse() * c.z]
        .iter()
        .enumerate()
    {
        out.fixed_rows_mut::<3>(6 * k)
            .copy_from(&d.rotation.scaled_axis());
        out.fixed_rows_mut::<3>(6 * k + 3)
            .copy_from(&d.translation.vector);
    }
    out
}

#[test]
fn regions_of_every_estimator_cover() {
    let designs = [
        Design(30, 0.2, 1e-3, 5.2e-3),
        Design(12, 0.8, 1e-4, 8.7e-3),
        Design(10, 0.3, 1e-3, 5.2e-3),
        Design(15, 1.0, 5e-3, 17e-3),
        Design(6, 0.5, 1e-3, 5.2e-3),
        Design(12, 0.8, 3e-3, 3.5e-4),
    ];
    let trials = of(60, 20);
    for info in estimators() {
        for design in designs {
            let (mut of_x, mut of_all) = (0_u32, 0_u32);
            let (mut stated, mut reached) = (0.0, 0.0);
            for seed in 0..trials {
                let c = case(seed, design);
                let e = fit(info.id, &c.robot, &c.measured);
                let (off, dof) = (error(&e, &c), e.noise.degrees_of_freedom);
                let covariance: Covariance = e.covariance.expect("two axes");
                let inside = |at: usize, rows: usize| {
                    let d = off.rows(at, rows).into_owned();
                    let block = covariance.view((at, at), (rows, rows)).into_owned();
                    let solved = block.cholesky().expect("definite").solve(&d);
                    let k = rows as f64;
                    d.dot(&solved) / k <= f_quantile(0.05, k, dof)
                };
                of_x += u32::from(inside(3, 3));
                of_all += u32::from(inside(0, 12));
                stated += (3..6).map(|k| covariance[(k, k)]).sum::<f64>();
                reached += off.rows(3, 3).norm_squared();
            }
            let part = |k: u32| f64::from(k) / trials as f64;
            println!(
                "{} {design:?}: X position {:.3}, all {:.3}; stated {:.2} mm, reached {:.2} mm",
                info.id,
                part(of_x),
                part(of_all),
                1e3 * (stated / trials as f64).sqrt(),
                1e3 * (reached / trials as f64).sqrt()
            );
            // 95 %, less three Monte-Carlo errors.
            let least = 0.95 - 3.0 * f64::sqrt(0.95 * 0.05 / trials as f64);
            assert!(
                part(of_x) > least && part(of_all) > least,
                "{} {design:?}",
                info.id
            );
        }
    }
}
