//! A X = Z B and A X = X B: exact data, noise, certificate, degenerate motions, and real recordings.

use calib_handeye::{HandEyeError, HandEyeWeights, relative_motions, solve_ax_xb, solve_ax_zb};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

fn normal3(rng: &mut impl Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(rng))
}

fn pose(x: f64, y: f64, z: f64, roll: f64, pitch: f64, yaw: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

/// A displacement with rotation σ (rad) and translation σ (m) per component.
fn jitter(rng: &mut impl Rng, rotation: f64, translation: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(normal3(rng) * translation),
        UnitQuaternion::from_scaled_axis(normal3(rng) * rotation),
    )
}

struct Case {
    a: Vec<Isometry3<f64>>,
    b: Vec<Isometry3<f64>>,
    x: Isometry3<f64>,
    z: Isometry3<f64>,
}

fn random_pose(r: &mut impl Rng, angle: f64) -> Isometry3<f64> {
    let axis = normal3(r).normalize();
    Isometry3::from_parts(
        Translation3::from(normal3(r) * 0.5),
        UnitQuaternion::from_scaled_axis(axis * r.random_range(0.0..angle)),
    )
}

fn case(seed: u64, n: usize, rotation: f64, translation: f64) -> Case {
    let mut r = rng(seed);
    let (x, z) = (random_pose(&mut r, 3.1), random_pose(&mut r, 3.1));
    let a: Vec<_> = (0..n).map(|_| random_pose(&mut r, 1.5)).collect();
    let b = a
        .iter()
        .map(|a| z.inverse() * a * x * jitter(&mut r, rotation, translation))
        .collect();
    Case { a, b, x, z }
}

fn distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    (
        (a.translation.vector - b.translation.vector).norm(),
        a.rotation.angle_to(&b.rotation),
    )
}

#[test]
fn exact_data_give_both_transforms_and_a_proof() {
    for seed in 0..30 {
        let c = case(seed, 4 + seed as usize % 10, 0.0, 0.0);
        let s = solve_ax_zb(&c.a, &c.b, HandEyeWeights::default()).unwrap();
        for (found, truth) in [(s.x, c.x), (s.z, c.z)] {
            let (t, r) = distance(&found, &truth);
            assert!(t < 1e-8 && r < 1e-8, "seed {seed}: {t} {r}");
        }
        assert!(s.certified, "seed {seed}: {} {}", s.gap, s.least_eigenvalue);
    }
}

#[test]
fn noisy_data_are_certified_in_almost_every_instance() {
    let mut certified = 0;
    let runs = 72;
    for seed in 0..runs {
        let c = case(100 + seed, 12, 0.02, 0.01);
        let s = solve_ax_zb(
            &c.a,
            &c.b,
            HandEyeWeights {
                sigma_rotation: 0.02,
                sigma_translation: 0.01,
            },
        )
        .unwrap();
        let (t, r) = distance(&s.x, &c.x);
        assert!(t < 0.1 && r < 0.1, "seed {seed}: {t} {r}");
        certified += usize::from(s.certified);
    }
    // The relaxation itself was tight in 71 of 72 such instances.
    assert!(certified >= 70, "{certified}");
}

#[test]
fn a_wrong_optimum_is_not_certified() {
    // The certificate of unrelated poses must not claim anything.
    let mut r = rng(3);
    let a: Vec<_> = (0..6).map(|_| random_pose(&mut r, 3.0)).collect();
    let b: Vec<_> = (0..6).map(|_| random_pose(&mut r, 3.0)).collect();
    let s = solve_ax_zb(&a, &b, HandEyeWeights::default()).unwrap();
    assert!(s.rms_translation > 0.05);
    if s.certified {
        // Certified then means: no other pair is better. Try many.
        let cost = |x: &Isometry3<f64>, z: &Isometry3<f64>| -> f64 {
            a.iter()
                .zip(&b)
                .map(|(a, b)| {
                    let (l, r) = (a * x, z * b);
                    let d = l.rotation.to_rotation_matrix().matrix()
                        - r.rotation.to_rotation_matrix().matrix();
                    0.5e6 * d.norm_squared()
                        + 1e6 * (l.translation.vector - r.translation.vector).norm_squared()
                })
                .sum()
        };
        let best = cost(&s.x, &s.z);
        for _ in 0..2000 {
            assert!(
                cost(&random_pose(&mut r, 3.1), &random_pose(&mut r, 3.1)) >= best * (1.0 - 1e-6)
            );
        }
    }
}

#[test]
fn the_covariance_is_what_simulation_shows() {
    let weights = HandEyeWeights {
        sigma_rotation: 2e-3,
        sigma_translation: 1e-3,
    };
    let mut z2 = 0.0;
    let runs = 150;
    for seed in 0..runs {
        let c = case(500 + seed, 20, 2e-3, 1e-3);
        let s = solve_ax_zb(&c.a, &c.b, weights).unwrap();
        let cov = s.covariance.unwrap();
        let d = c.x.inverse() * s.x;
        let xi = calib_geometry::se3::log(&d);
        let block = cov.view((0, 0), (6, 6)).into_owned();
        z2 += (xi.0.transpose() * block.try_inverse().unwrap() * xi.0)[0] / 6.0 / runs as f64;
    }
    assert!((z2 - 1.0).abs() < 0.2, "{z2}");
}

#[test]
fn moving_and_relative_motions_agree() {
    let c = case(9, 15, 0.0, 0.0);
    let x = solve_ax_xb(&relative_motions(&c.a), &relative_motions(&c.b)).unwrap();
    let (t, r) = distance(&x, &c.x);
    assert!(t < 1e-9 && r < 1e-9);
}

#[test]
fn degenerate_motions_have_names() {
    let c = case(1, 10, 0.0, 0.0);
    assert!(matches!(
        solve_ax_zb(&c.a[..9], &c.b, HandEyeWeights::default()),
        Err(HandEyeError::Lengths { a: 9, b: 10 })
    ));
    assert!(matches!(
        solve_ax_zb(&c.a[..2], &c.b[..2], HandEyeWeights::default()),
        Err(HandEyeError::TooFew {
            found: 2,
            needed: 3
        })
    ));
    let mut broken = c.a.clone();
    broken[4].translation.vector.x = f64::NAN;
    assert!(matches!(
        solve_ax_zb(&broken, &c.b, HandEyeWeights::default()),
        Err(HandEyeError::NotFinite { index: 4 })
    ));
    let one_axis: Vec<_> = (0..8)
        .map(|i| pose(0.1 * f64::from(i), 0.0, 0.2, 0.0, 0.0, 0.3 * f64::from(i)))
        .collect();
    let b: Vec<_> = one_axis.iter().map(|a| c.z.inverse() * a * c.x).collect();
    assert!(matches!(
        solve_ax_zb(&one_axis, &b, HandEyeWeights::default()),
        Err(HandEyeError::OneAxis { .. })
    ));
    assert!(matches!(
        solve_ax_xb(&relative_motions(&one_axis), &relative_motions(&b)),
        Err(HandEyeError::OneAxis { .. })
    ));
    let still = vec![Isometry3::identity(); 5];
    assert!(matches!(
        solve_ax_zb(&still, &still, HandEyeWeights::default()),
        Err(HandEyeError::NoRotation)
    ));
}

#[test]
fn real_ur10() {
    let root = std::env::var_os("CALIB_REAL_DATA").map_or_else(
        || std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        std::path::PathBuf::from,
    );
    let folder = root.join("ur10_handeye");
    if !folder.is_dir() {
        println!("skipped: no real data `ur10_handeye` (set CALIB_REAL_DATA)");
        return;
    }
    let text = std::fs::read_to_string(folder.join("ur10_axzb.csv")).unwrap();
    let (mut a, mut b) = (Vec::new(), Vec::new());
    for line in text.lines().skip(1).filter(|l| !l.trim().is_empty()) {
        let v: Vec<f64> = line.split(',').map(|x| x.trim().parse().unwrap()).collect();
        let p = |v: &[f64]| {
            Isometry3::from_parts(
                Translation3::new(v[0], v[1], v[2]),
                UnitQuaternion::new_normalize(nalgebra::Quaternion::new(v[6], v[3], v[4], v[5])),
            )
        };
        a.push(p(&v[..7]));
        b.push(p(&v[7..14]));
    }
    assert_eq!(a.len(), 23);
    // The published fit counts position only: orientation gets a small weight.
    let s = solve_ax_zb(
        &a,
        &b,
        HandEyeWeights {
            sigma_rotation: 1.0,
            sigma_translation: 1e-3,
        },
    )
    .unwrap();
    println!(
        "rms {:.4} mm, {:.3} mrad, gap {:.1e}",
        s.rms_translation * 1e3,
        s.rms_rotation * 1e3,
        s.gap
    );
    assert!(s.rms_translation < 3.85e-3, "{}", s.rms_translation);
    assert!(s.gap < 1e-9, "{}", s.gap);
}
