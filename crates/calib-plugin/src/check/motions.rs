//! Motions of known joints, made by hand: no noise, so that any honest estimator finds them to 10⁻⁶ m.

use crate::motion::{BodyPose, MotionData, Shape};

type Matrix = [[f64; 3]; 3];
type Vector = [f64; 3];

/// Center of the ball joint; not at the origin, so that a wrong frame shows.
pub(super) const CENTER: Vector = [1.0, -2.0, 0.5];
/// A point of the hinge.
pub(super) const POINT: Vector = [0.5, -0.2, 1.0];
/// Direction of the hinge: of unit length with exact thirds.
pub(super) const DIRECTION: Vector = [1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0];
/// Markers on the moving body, seen from the joint.
const MARKERS: [Vector; 3] = [[0.3, 0.0, 0.05], [0.0, 0.25, 0.1], [0.1, -0.1, -0.3]];
/// The joint, seen from the moving body.
const BODY_POINT: Vector = [0.05, 0.1, -0.2];

pub(super) fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

pub(super) fn turned(r: &Matrix, v: &Vector) -> Vector {
    std::array::from_fn(|i| (0..3).map(|k| r[i][k] * v[k]).sum())
}

pub(super) fn plus(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| a[i] + b[i])
}

fn minus(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| a[i] - b[i])
}

/// Rodrigues: `R = I + sin θ [n]ₓ + (1 − cos θ) [n]ₓ²`
fn rotation(axis: &Vector, angle: f64) -> Matrix {
    let [x, y, z] = *axis;
    let cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    let square = multiply(&cross, &cross);
    let (s, c) = angle.sin_cos();
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            f64::from(u8::from(i == j)) + s * cross[i][j] + (1.0 - c) * square[i][j]
        })
    })
}

/// Rotations about two axes, a grid of ±0.6 rad.
pub(super) fn ball(samples: usize) -> Vec<Matrix> {
    let side = (samples as f64).sqrt().ceil().max(2.0);
    (0..samples)
        .map(|i| {
            let (row, column) = ((i as f64 / side).floor(), i as f64 % side);
            let angle = |k: f64| 1.2 * k / (side - 1.0) - 0.6;
            multiply(
                &rotation(&[1.0, 0.0, 0.0], angle(row)),
                &rotation(&[0.0, 1.0, 0.0], angle(column)),
            )
        })
        .collect()
}

/// Angles over 1.8 rad.
pub(super) fn angles(samples: usize) -> Vec<f64> {
    (0..samples)
        .map(|i| 1.8 * i as f64 / samples.max(2) as f64)
        .collect()
}

/// Rotations about the hinge.
pub(super) fn hinge(samples: usize) -> Vec<Matrix> {
    angles(samples)
        .iter()
        .map(|angle| rotation(&DIRECTION, *angle))
        .collect()
}

/// What a tracker sees of a body that turns about `joint`.
pub(super) fn seen(shape: Shape, joint: &Vector, rotations: &[Matrix]) -> MotionData {
    let markers = || -> Vec<Vec<Option<Vector>>> {
        let track = |marker: &Vector| {
            rotations
                .iter()
                .map(|r| Some(plus(joint, &turned(r, marker))))
                .collect()
        };
        MARKERS.iter().map(track).collect()
    };
    let poses = |joint: &Vector| -> Vec<BodyPose> {
        let pose = |r: &Matrix| BodyPose {
            rotation: *r,
            // R p + t = joint
            translation_m: minus(joint, &turned(r, &BODY_POINT)),
        };
        rotations.iter().map(pose).collect()
    };
    match shape {
        Shape::Points => MotionData::points(&markers()),
        Shape::Markers => MotionData::markers(&markers()),
        Shape::Poses => MotionData::poses(&poses(joint).into_iter().map(Some).collect::<Vec<_>>()),
        Shape::TwoBodies => {
            // The parent wanders too; the joint is fixed in the parent.
            let parent: Vec<BodyPose> = (0..rotations.len())
                .map(|i| BodyPose {
                    rotation: rotation(&[0.0, 0.6, 0.8], 0.01 * (i % 70) as f64),
                    translation_m: [0.02 * (i % 11) as f64, 0.3, -0.01 * (i % 7) as f64],
                })
                .collect();
            // tracker_from_child = tracker_from_parent · parent_from_child
            let child = parent.iter().zip(poses(joint)).map(|(parent, child)| {
                Some(BodyPose {
                    rotation: multiply(&parent.rotation, &child.rotation),
                    translation_m: plus(
                        &parent.translation_m,
                        &turned(&parent.rotation, &child.translation_m),
                    ),
                })
            });
            let child: Vec<_> = child.collect();
            let parent: Vec<_> = parent.into_iter().map(Some).collect();
            MotionData::two_bodies(&parent, &child)
        }
    }
}

/// The same shape with every sample lost.
pub(super) fn lost(shape: Shape, samples: usize) -> MotionData {
    let (points, poses) = (vec![None; samples], vec![None; samples]);
    match shape {
        Shape::Points => MotionData::points(&[points]),
        Shape::Markers => MotionData::markers(&[points.clone(), points.clone(), points]),
        Shape::Poses => MotionData::poses(&poses),
        Shape::TwoBodies => MotionData::two_bodies(&poses, &poses),
    }
}

/// The same motion with noise of these σ on every coordinate, m, and every orientation about each axis, rad; the same for the same seed.
pub(super) fn disturbed(
    data: &MotionData,
    (sigma_m, sigma_rad): (f64, f64),
    seed: u64,
) -> MotionData {
    let mut state = seed;
    let mut vector = |sigma: f64| -> Vector { std::array::from_fn(|_| sigma * normal(&mut state)) };
    let motion = data.view();
    if motion.shape.is_poses() {
        let mut pose = |p: BodyPose| BodyPose {
            rotation: {
                let w = vector(sigma_rad);
                let angle = w.iter().map(|x| x * x).sum::<f64>().sqrt();
                // exp([w]ₓ) R
                multiply(&rotation(&w.map(|x| x / angle), angle), &p.rotation)
            },
            translation_m: plus(&p.translation_m, &vector(sigma_m)),
        };
        let mut track =
            |k: usize| -> Vec<_> { motion.poses(k).map(|p| p.map(&mut pose)).collect() };
        let first = track(0);
        return match motion.shape {
            Shape::TwoBodies => MotionData::two_bodies(&first, &track(1)),
            _ => MotionData::poses(&first),
        };
    }
    let mut point = |p: Vector| plus(&p, &vector(sigma_m));
    let mut track = |k: usize| -> Vec<_> { motion.points(k).map(|p| p.map(&mut point)).collect() };
    let tracks: Vec<_> = (0..motion.tracks).map(&mut track).collect();
    match motion.shape {
        Shape::Markers => MotionData::markers(&tracks),
        _ => MotionData::points(&tracks),
    }
}

/// A number of the standard normal distribution: Box and Muller, of two uniform numbers by Knuth's multiplicative congruence.
fn normal(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        // The high 53 bits; never 0.
        ((*state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    };
    let (a, b) = (uniform(), uniform());
    (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}
