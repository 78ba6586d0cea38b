//! The tracker, the body or the zero of a joint moves at one row, too far for a fit to follow: named with its row, or silent.

use crate::robots::*;
use calib_checks::structural::*;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn motion(rng: &mut ChaCha8Rng, angle: f64, distance: f64) -> Isometry3<f64> {
    let mut unit = || Vector3::new(normal(rng), normal(rng), normal(rng)).normalize();
    let turn = UnitQuaternion::from_scaled_axis(unit() * angle);
    Isometry3::from_parts(Translation3::from(unit() * distance), turn)
}

/// Rows of `data` until `first`, and of `later` from there on.
fn spliced(data: &Data, later: &Data, first: usize) -> Data {
    let mut out = data.clone();
    for (own, other) in out.bodies.iter_mut().zip(&later.bodies) {
        match (&mut own.measured, &other.measured) {
            (Measured::Markers(own), Measured::Markers(other)) => {
                own[first..].clone_from_slice(&other[first..]);
            }
            (
                Measured::Poses {
                    tracker_from_body: own,
                    ..
                },
                Measured::Poses {
                    tracker_from_body: other,
                    ..
                },
            ) => own[first..].clone_from_slice(&other[first..]),
            _ => unreachable!("of one robot"),
        }
    }
    out
}

#[derive(Debug, Default)]
struct Counts {
    right: usize,
    left_to_the_fit: usize,
    silent: usize,
    wrong: Vec<String>,
}

#[test]
fn a_jump_is_named_with_its_row() {
    let mut counts = Counts::default();
    for seed in 0..96_u64 {
        let mut rng = ChaCha8Rng::seed_from_u64(61_000 + seed);
        let body = BODIES[(seed % 4) as usize];
        let poses = [20, 40][(seed / 4) as usize % 2];
        let errors = [SMALL, BIG][(seed / 8) as usize % 2];
        let setting = Setting::new(61_000 + seed, Plan::Poses(poses), body, errors);
        let first = rng.random_range(6..poses - 6);
        let angle = rng.random_range(0.3..0.9);
        let (data, truth) = match seed / 16 % 3 {
            0 => {
                let later = setting.moved(&motion(&mut rng, angle, 0.3));
                let data = spliced(&setting.data(true), &later.data(true), first);
                (data, Moved::Tracker)
            }
            1 => {
                let later = setting.remounted(&motion(&mut rng, angle, 0.06));
                let data = spliced(&setting.data(true), &later.data(true), first);
                (data, Moved::Body(BodyIndex(0)))
            }
            _ => {
                let joint = rng.random_range(0..setting.nominal.joints().len());
                let mut data = setting.data(true);
                let size = match data.chain.turns(joint) {
                    Some(true) => rng.random_range(0.4..0.9),
                    _ => rng.random_range(0.1..0.3),
                };
                for row in &mut data.readings[first..] {
                    row[joint] = row[joint].map(|q| q + size);
                }
                (data, Moved::Joint(JointIndex(joint)))
            }
        };
        let mut options = Options::default();
        options.list_invisible = false;
        let outcome = explain(&data, &options).unwrap();
        let about = || format!("{seed} {body:?} {poses} {errors:?} row {first} {truth:?}");
        match (&outcome.jump, &outcome.decision) {
            (Some(jump), _) => {
                let named = jump.moved == truth || jump.rivals.contains(&truth);
                let row = jump.after.abs_diff(first) <= 1;
                if named && row {
                    counts.right += 1;
                } else {
                    counts.wrong.push(format!("{} {jump:?}", about()));
                }
            }
            (None, Decision::Named(named)) => {
                let found = format!("{:?} {:?}", named.correction, named.evidence);
                counts.wrong.push(format!("{} {found}", about()));
            }
            // What nominal errors explain as well is found by the fit.
            (None, Decision::Consistent { .. }) => counts.left_to_the_fit += 1,
            _ => {
                println!("{} silent", about());
                counts.silent += 1;
            }
        }
    }
    assert!(counts.wrong.is_empty(), "{counts:?}");
    assert!(counts.right >= 55 && counts.silent <= 4, "{counts:?}");
}
