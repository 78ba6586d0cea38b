//! Noise along the line of sight, so long that the sphere bends within the cloud of one sample: bias, covariance, and the limits nobody passes.

use crate::common::{Noise, Tally, hand};
use calib_cor::{Input, Options, bounds, fit};
use nalgebra::{Matrix3, Point3, Vector3};

const CENTER: Vector3<f64> = Vector3::new(1.2, -0.8, 0.9);
const MM: f64 = 1e-3;

/// n samples on the hand's range, each `copies` times; σ across the line of sight, `ratio` σ along it.
#[derive(Clone, Copy)]
struct Cell {
    n: usize,
    copies: usize,
    reach: f64,
    sigma: f64,
    ratio: f64,
}

impl Cell {
    /// Root of the covariance.
    fn root(&self) -> Matrix3<f64> {
        let sight = Vector3::new(0.55, 0.8, -0.25).normalize();
        (Matrix3::identity() + sight * sight.transpose() * (self.ratio - 1.0)) * self.sigma
    }

    fn arms(&self) -> Vec<Vector3<f64>> {
        let turns = hand(self.n);
        let arms = turns
            .iter()
            .map(|r| r * Vector3::new(0.0, -self.reach, 0.0));
        arms.flat_map(|a| std::iter::repeat_n(a, self.copies))
            .collect()
    }

    fn bounds(&self) -> bounds::SphereBounds {
        let arms = self.arms();
        let noise = vec![self.root() * self.root(); arms.len()];
        bounds::sphere_center_weighted(&[arms], &[noise]).expect("bounds")
    }

    fn run(&self, trials: u64) -> Tally {
        let (root, arms) = (self.root(), self.arms());
        let options = Options {
            covariances: vec![vec![root * root; arms.len()]],
            ..Options::default()
        };
        let mut tally = Tally::default();
        for seed in 0..trials {
            let mut noise = Noise::new(seed);
            let track: Vec<_> = arms
                .iter()
                .map(|a| Some(Point3::from(CENTER + a + root * noise.vector(1.0))))
                .collect();
            let outcome = fit("sphere_eiv", &Input::Points(&[track]), &options).expect("eiv");
            if let Some(e) = outcome.estimate() {
                tally.add(e.center.coords - CENTER, &e.covariance);
            }
        }
        tally
    }
}

const WORST: Cell = Cell {
    n: 63,
    copies: 1,
    reach: 0.1,
    sigma: 5.0 * MM,
    ratio: 5.0,
};

fn cells() -> [Cell; 6] {
    let cell = |n, reach, mm: f64, ratio| Cell {
        n,
        copies: 1,
        reach,
        sigma: mm * MM,
        ratio,
    };
    [
        WORST,
        cell(63, 0.1, 5.0, 3.0),
        cell(63, 0.25, 5.0, 5.0),
        cell(16, 0.1, 2.5, 5.0),
        cell(9, 0.1, 2.5, 5.0),
        cell(9, 0.25, 5.0, 5.0),
    ]
}

fn study(trials: u64) {
    for cell in cells() {
        let bounds = cell.bounds();
        let tally = cell.run(trials);
        let c = bounds.cramer_rao.trace();
        let (efficiency, mc) = tally.efficiency(c);
        let (unbiased, second) = (c / bounds.unbiased.trace(), c / bounds.second_order.trace());
        let d2 = tally.mahalanobis / tally.n;
        let inside = tally.inside95 / tally.n;
        let what = format!(
            "n {} r {} σ {} × {}",
            cell.n, cell.reach, cell.sigma, cell.ratio
        );
        println!(
            "{what}: {efficiency:.3} ± {mc:.3} of {unbiased:.3}, {second:.3}; d² {d2:.2}, in 95 %: {inside:.3}"
        );
        assert!(
            efficiency > second - 0.01 - 3.0 * mc,
            "{what}: {efficiency} of {second}"
        );
        // The mean of χ² with three degrees of freedom, whose own variance is 6.
        let error = (6.0 / tally.n).sqrt();
        assert!((d2 - 3.0).abs() < 0.3 + 3.0 * error, "{what}: d² {d2}");
        assert!(
            inside > 0.94 - 3.0 * (0.05 / tally.n).sqrt(),
            "{what}: {inside} in 95 %"
        );
    }
}

#[test]
fn depth_noise_reaches_what_can_be_had_and_says_how_far_it_is_off() {
    study(400);
}

#[test]
#[ignore = "study: half a minute"]
fn depth_noise_reaches_what_can_be_had_in_full() {
    study(10_000);
}

/// Ten times the samples: the bias of the bend does not fall with their number, so it is taken off.
#[test]
fn the_bend_does_not_push_the_center_of_many_samples() {
    let many = Cell {
        copies: 10,
        ..WORST
    };
    let tally = many.run(80);
    let d2 = tally.mahalanobis / tally.n;
    println!("bias {:.2} mm, d² {d2:.2}", tally.bias() / MM);
    // 3 where the covariance is true; 4.3 with what the bend does left in and unsaid.
    assert!(d2 < 3.75, "d² {d2}");
}

/// (4) ≥ (3), both the more the longer the noise; no matter in which unit and how the frame lies.
#[test]
fn limits_are_ordered_and_have_no_unit() {
    let mut last = 1.0;
    for mm in [0.1, 0.5, 1.0, 2.5, 5.0, 8.0] {
        let cell = Cell {
            sigma: mm * MM,
            ..WORST
        };
        let b = cell.bounds();
        let share = b.cramer_rao.trace() / b.unbiased.trace();
        assert!(share < last, "{mm} mm: {share} of {last}");
        assert!(b.second_order.trace() > b.cramer_rao.trace());
        last = share;
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, -1.2, 2.0).into_inner();
        let (root, arms) = (cell.root(), cell.arms());
        let noise = turn * root * root * turn.transpose() * 1e6;
        let moved: Vec<_> = arms.iter().map(|a| turn * a * 1e3).collect();
        let n = moved.len();
        let other = bounds::sphere_center_weighted(&[moved], &[vec![noise; n]]).expect("bounds");
        for (a, b) in [
            (b.cramer_rao, other.cramer_rao),
            (b.unbiased, other.unbiased),
            (b.second_order, other.second_order),
        ] {
            let back = turn.transpose() * b * turn / 1e6;
            // The feet of (4) lie on a grid whose direction is the frame's.
            assert!((a - back).norm() < 2e-3 * a.norm(), "{a} {back}");
        }
    }
    // Little noise: the plain bound.
    assert!(last < 0.8);
    let cell = Cell {
        sigma: 0.01 * MM,
        ..WORST
    };
    let b = cell.bounds();
    assert!((b.cramer_rao.trace() / b.unbiased.trace() - 1.0).abs() < 1e-4);
    assert!((b.cramer_rao.trace() / b.second_order.trace() - 1.0).abs() < 1e-4);
}

#[test]
fn equal_noise_gives_the_bound_of_equal_noise() {
    let cell = Cell {
        ratio: 1.0,
        ..WORST
    };
    let plain = bounds::sphere_center(&[cell.arms()], cell.sigma).expect("a bound");
    assert!((cell.bounds().cramer_rao - plain).norm() < 1e-12 * plain.norm());
}

#[test]
fn no_bounds_without_a_center() {
    let circle: Vec<_> = (0..12)
        .map(|k| Vector3::new(f64::from(k).cos(), f64::from(k).sin(), 0.0))
        .collect();
    let noise = vec![Matrix3::identity() * 1e-6; 12];
    let of = |a: &[Vector3<f64>], c: &[Matrix3<f64>]| {
        bounds::sphere_center_weighted(&[a.to_vec()], &[c.to_vec()])
    };
    assert_eq!(of(&circle, &noise), None, "one plane");
    assert_eq!(of(&circle, &noise[1..]), None, "numbers differ");
    assert_eq!(of(&[], &[]), None, "nothing");
    let arms = WORST.arms();
    assert_eq!(
        of(&arms, &vec![Matrix3::zeros(); arms.len()]),
        None,
        "no noise at all"
    );
    assert_eq!(
        of(&[Vector3::zeros(); 5], &noise[..5]),
        None,
        "no directions"
    );
}

/// With one covariance for all that is the same in every direction, the answer is that without.
#[test]
fn isotropic_covariances_change_nothing() {
    let (arms, sigma) = (WORST.arms(), 1.0 * MM);
    let mut noise = Noise::new(5);
    let track: Vec<_> = arms
        .iter()
        .map(|a| Some(Point3::from(CENTER + a + noise.vector(sigma))))
        .collect();
    let tracks = [track];
    let center = |options: Options| {
        let outcome = fit("sphere_eiv", &Input::Points(&tracks), &options).expect("eiv");
        outcome.estimate().expect("a center").center
    };
    let plain = center(Options {
        sigma_t: Some(sigma),
        ..Options::default()
    });
    let weighed = center(Options {
        covariances: vec![vec![Matrix3::identity() * (sigma * sigma); arms.len()]],
        ..Options::default()
    });
    assert!(
        (plain - weighed).norm() < 1e-6 * MM,
        "{}",
        (plain - weighed).norm()
    );
}

/// A row that is the mean of k readings has the k-th part of their covariance, said either way.
#[test]
fn weights_divide_covariances() {
    let (root, arms) = (WORST.root() * 0.2, WORST.arms());
    let worth: Vec<f64> = (0..arms.len()).map(|k| [1.0, 4.0, 2.5][k % 3]).collect();
    let mut noise = Noise::new(3);
    let tracks = [arms
        .iter()
        .zip(&worth)
        .map(|(a, w)| {
            Some(Point3::from(
                CENTER + a + root * noise.vector(w.sqrt().recip()),
            ))
        })
        .collect::<Vec<_>>()];
    let estimate = |options: Options| {
        let outcome = fit("sphere_eiv", &Input::Points(&tracks), &options).expect("eiv");
        outcome.estimate().expect("a center").clone()
    };
    let weighed = estimate(Options {
        covariances: vec![vec![root * root; arms.len()]],
        weights: worth.clone(),
        ..Options::default()
    });
    let divided = estimate(Options {
        covariances: vec![worth.iter().map(|w| root * root / *w).collect()],
        ..Options::default()
    });
    let off = (weighed.center - divided.center).norm();
    assert!(off < 1e-9, "{off}");
    let scale = divided.covariance.norm();
    // The test of planes, which shares the weakest direction's noise out, sees weights but not covariances.
    let differ = (weighed.covariance - divided.covariance).norm();
    assert!(differ < 1e-2 * scale, "{differ} of {scale}");
}
