//! Noise along the line of sight: a camera, or several on one side, measure depth less precisely than the directions across the line.
//!
//! With d the distance of what is seen from the origin of the instrument's frame, u the direction of that line in axes of the rows, and d₀ the distance
//! at which the levels are stated:
//!
//! ```text
//! position      σ²_across  a² (I − u uᵀ) + σ²_along b² u uᵀ                                      (1)
//! orientation   σ²_tilt    b² (I − u uᵀ) + σ²_about a² u uᵀ                                      (2)
//! a = b = 1,  or  a = d/d₀,  b = (d/d₀)²                                                        (3)
//! rows          e ← B e,   B = [e₁ e₂ u]ᵀ,  e₁ and e₂ across u                                   (4)
//! ```
//!
//! In the axes (4) the covariance is diagonal, and each row has one level.
//!
//! Of an image, place across and rotation about the line are read in pixels, which grow with the distance; depth and tilt are read from the
//! differences that perspective leaves, which fade with its square (3).

use nalgebra::{Matrix3, Vector3};

use super::rows::tangent_basis;
use crate::graph::ids::GroupId;

/// Equations (1) to (3). The levels across the line of sight are those of the measurement's noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// σ of positions along it, m.
    pub along: GroupId,
    /// σ of orientations about it, rad; of poses.
    pub about: Option<GroupId>,
    /// How the noise grows.
    pub growth: Growth,
}

/// d₀ of equation (3), m, where noise grows with distance; `None` where it is the same at all.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Growth {
    /// Of positions.
    pub positions: Option<f64>,
    /// Of orientations.
    pub orientations: Option<f64>,
}

/// Factors of standard deviations at a distance, (3): of what is read in the image, and of what perspective tells.
#[must_use]
pub fn growth(grows_from: Option<f64>, distance: f64) -> [f64; 2] {
    match grows_from {
        Some(from) if from > 0.0 => [distance / from, (distance / from).powi(2)],
        _ => [1.0, 1.0],
    }
}

/// A vector of three standard normal numbers with these standard deviations across a line and along it.
#[must_use]
pub fn error_of_sight(
    drawn: &Vector3<f64>,
    line: &Vector3<f64>,
    [across, along]: [f64; 2],
) -> Vector3<f64> {
    let u = line.try_normalize(0.0).unwrap_or_else(Vector3::z);
    let part = u * u.dot(drawn);
    (drawn - part) * across + part * along
}

impl Sight {
    /// B of equation (4), of what lies at `seen` from the instrument.
    #[must_use]
    pub fn axes(seen: &Vector3<f64>) -> Matrix3<f64> {
        // At the instrument itself there is no line: any direction will do.
        let u = seen.try_normalize(0.0).unwrap_or_else(Vector3::z);
        let [e1, e2] = tangent_basis(&u);
        Matrix3::from_rows(&[e1.transpose(), e2.transpose(), u.transpose()])
    }

    /// Equation (1) in the axes (4), for three rows from `first` on.
    pub(super) fn positions(
        &self,
        (first, across): (usize, GroupId),
        seen: &Vector3<f64>,
        add: &mut dyn FnMut(usize, usize, GroupId, f64),
    ) {
        let [image, depth] = factors(self.growth.positions, seen);
        diagonal(first, (across, image), (self.along, depth), add);
    }

    /// Equation (2) in the axes (4), for three rows from `first` on.
    pub(super) fn orientations(
        &self,
        (first, tilt): (usize, GroupId),
        seen: &Vector3<f64>,
        add: &mut dyn FnMut(usize, usize, GroupId, f64),
    ) {
        let [image, depth] = factors(self.growth.orientations, seen);
        let about = self.about.unwrap_or(tilt);
        diagonal(first, (tilt, depth), (about, image), add);
    }
}

/// Equation (3) at what lies at `seen`.
fn factors(grows_from: Option<f64>, seen: &Vector3<f64>) -> [f64; 2] {
    /// No camera sees closer, in parts of d₀.
    const CLOSEST: f64 = 0.01;
    let closest = grows_from.map_or(0.0, |from| CLOSEST * from);
    growth(grows_from, seen.norm().max(closest))
}

/// Two rows of one level and a third of another, with the factors of their σ.
fn diagonal(
    first: usize,
    (across, of_across): (GroupId, f64),
    (along, of_along): (GroupId, f64),
    add: &mut dyn FnMut(usize, usize, GroupId, f64),
) {
    for row in first..first + 2 {
        add(row, row, across, of_across * of_across);
    }
    add(first + 2, first + 2, along, of_along * of_along);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_covariance_has_the_levels_along_and_across_the_line() {
        let sight = Sight {
            along: GroupId::of(1),
            about: Some(GroupId::of(2)),
            growth: Growth {
                positions: Some(0.5),
                orientations: None,
            },
        };
        let seen = Vector3::new(0.6, 0.0, 0.8);
        let mut v = Matrix3::zeros();
        let level = [1.0, 9.0];
        sight.positions((3, GroupId::of(0)), &seen, &mut |i, j, group, shape| {
            v[(i - 3, j - 3)] += level[group.index()] * shape;
        });
        let b = Sight::axes(&seen);
        let v = b.transpose() * v * b;
        let (u, across) = (seen, Vector3::y());
        // At twice the distance: 1 · 2² across, 9 · 4² along.
        assert!((v * u - u * 144.0).norm() < 1e-12);
        assert!((v * across - across * 4.0).norm() < 1e-12);
    }
}
