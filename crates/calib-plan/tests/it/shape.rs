//! Capsules against points sampled in and on shapes.

use calib_plan::shape::{Capsule, capsules};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn vector(rng: &mut impl Rng, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-size..size))
}

fn pose(rng: &mut impl Rng) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_scaled_axis(vector(rng, 2.0));
    Isometry3::from_parts(vector(rng, 0.5).into(), rotation)
}

fn capsule(rng: &mut impl Rng) -> Capsule {
    Capsule {
        a: vector(rng, 1.0).into(),
        b: vector(rng, 1.0).into(),
        r: rng.random_range(0.0..0.3),
    }
}

/// Least distance over a grid of both segments: never below the true one, and above it by less than a step.
fn sampled(a: &Capsule, b: &Capsule) -> f64 {
    const STEPS: usize = 200;
    let at = |c: &Capsule, i: usize| c.a + (c.b - c.a) * (i as f64 / STEPS as f64);
    let mut least = f64::INFINITY;
    for i in 0..=STEPS {
        for j in 0..=STEPS {
            least = least.min((at(a, i) - at(b, j)).norm());
        }
    }
    least - a.r - b.r
}

#[test]
fn distances_are_those_of_sampled_segments() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for k in 0..60 {
        let a = capsule(&mut rng);
        let mut b = capsule(&mut rng);
        if k % 10 == 0 {
            // Parallel, and points.
            b.b = b.a + (a.b - a.a) * f64::from(k % 20) / 10.0;
        }
        let (exact, about) = (a.distance(&b), sampled(&a, &b));
        assert!(exact <= about + 1e-12, "{exact} {about}");
        assert!(about - exact < 0.03, "{exact} {about}");
    }
}

#[test]
fn distances_to_boxes_are_those_of_sampled_points() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..60 {
        let (c, place) = (capsule(&mut rng), pose(&mut rng));
        let size = vector(&mut rng, 0.4).abs().add_scalar(0.05);
        let mut about = f64::INFINITY;
        for i in 0..=2000 {
            let p = place.inverse() * (c.a + (c.b - c.a) * (f64::from(i) / 2000.0));
            let outside = (p.coords.abs() - size / 2.0).sup(&Vector3::zeros());
            about = about.min(outside.norm());
        }
        let exact = c.distance_to_box(&size, &place);
        assert!((exact - (about - c.r)).abs() < 2e-3, "{exact} {about}");
    }
}

#[test]
fn capsules_hold_the_whole_shape() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for k in 0..40 {
        // Rods, plates, cubes and clouds.
        let size = match k % 4 {
            0 => Vector3::new(1.0, 0.1, 0.08),
            1 => Vector3::new(0.9, 0.7, 0.03),
            2 => Vector3::new(0.2, 0.2, 0.2),
            _ => vector(&mut rng, 0.5).abs().add_scalar(0.02),
        };
        let place = pose(&mut rng);
        let corner = |i: usize| {
            let side = |k: usize| if i >> k & 1 == 1 { 0.5 } else { -0.5 };
            place * Point3::from(size.component_mul(&Vector3::new(side(0), side(1), side(2))))
        };
        let corners: Vec<Point3<f64>> = (0..8).map(corner).collect();
        let found = capsules(&corners);
        assert!(!found.is_empty());
        for _ in 0..300 {
            let inside = size.component_mul(&vector(&mut rng, 0.5));
            let p = place * Point3::from(inside);
            let point = Capsule { a: p, b: p, r: 0.0 };
            let depth = found.iter().map(|c| c.distance(&point));
            assert!(depth.fold(f64::INFINITY, f64::min) < 1e-9, "{size:?}");
        }
    }
    // A plate of 3 cm is no barrel: what is 10 cm above it is free.
    let plate = [-0.5, 0.5].iter().flat_map(|x| {
        let at = |y: f64, z: f64| Point3::new(*x, y, z);
        [at(-0.4, 0.0), at(0.4, 0.0), at(-0.4, 0.03), at(0.4, 0.03)]
    });
    let above = Point3::new(0.1, 0.1, 0.13);
    let above = Capsule {
        a: above,
        b: above,
        r: 0.0,
    };
    let plate: Vec<Point3<f64>> = plate.collect();
    assert!(capsules(&plate).iter().all(|c| c.distance(&above) > 0.05));
}

#[test]
fn nothing_has_no_capsule() {
    assert!(capsules(&[]).is_empty());
    assert!(capsules(&[Point3::new(f64::NAN, 0.0, 0.0)]).is_empty());
    let one = capsules(&[Point3::new(1.0, 2.0, 3.0)]);
    assert_eq!((one.len(), one[0].r), (1, 0.0));
}
