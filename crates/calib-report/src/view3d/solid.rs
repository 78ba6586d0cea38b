//! The shape of a link as filled faces: boxes, cylinders and balls of the URDF, and the surface of a mesh.
//!
//! A mesh has far more triangles than a page carries: its points are brought together in cells of a grid.

use nalgebra::{Isometry3, Matrix4, Point3, Vector3};
use serde::Serialize;
use std::collections::{BTreeSet, HashMap};

/// Faces that move with a frame.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Solid {
    /// Index into [`super::View3d::frames`].
    pub frame: usize,
    /// Places in the frame, m.
    pub points: Vec<[f64; 3]>,
    /// Convex polygons by the indices of their corners, counterclockwise seen from outside.
    pub faces: Vec<Vec<u32>>,
}

/// Faces of one mesh.
const FACES: usize = 2_500;

/// Sides of a drawn cylinder; a ball has half as many rings.
const SIDES: u32 = 20;

/// Cells along the longest edge that a mesh is first given.
const CELLS: f64 = 40.0;

impl Solid {
    /// A box around its center, edge lengths in m.
    #[must_use]
    pub fn cuboid(frame: usize, frame_from_box: &Isometry3<f64>, size_m: [f64; 3]) -> Self {
        let corner = |i: usize| {
            let half = |k: usize| [-0.5, 0.5][i >> k & 1] * size_m[k];
            place(frame_from_box, half(0), half(1), half(2))
        };
        let sides = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        Self {
            frame,
            points: (0..8).map(corner).collect(),
            faces: sides.map(Vec::from).into(),
        }
    }

    /// A cylinder around its center, along z.
    #[must_use]
    pub fn cylinder(
        frame: usize,
        frame_from_cylinder: &Isometry3<f64>,
        radius_m: f64,
        length_m: f64,
    ) -> Self {
        let rim = |end: f64| {
            around().map(move |(cos, sin)| {
                let (x, y) = (radius_m * cos, radius_m * sin);
                place(frame_from_cylinder, x, y, 0.5 * end * length_m)
            })
        };
        let mut faces = rings(0);
        faces.push((0..SIDES).rev().collect());
        faces.push((SIDES..2 * SIDES).collect());
        Self {
            frame,
            points: rim(-1.0).chain(rim(1.0)).collect(),
            faces,
        }
    }

    /// A ball around its center.
    #[must_use]
    pub fn ball(frame: usize, frame_from_ball: &Isometry3<f64>, radius_m: f64) -> Self {
        let rings_of = SIDES / 2;
        let circle = |k: u32| {
            let (out, up) = (f64::from(k) / f64::from(rings_of) * std::f64::consts::PI).sin_cos();
            around().map(move |(cos, sin)| {
                let (x, y) = (radius_m * out * cos, radius_m * out * sin);
                place(frame_from_ball, x, y, -radius_m * up)
            })
        };
        // The rings next to the poles are polygons of their own: a small flat cap.
        let mut faces: Vec<Vec<u32>> = (0..rings_of - 2).flat_map(rings).collect();
        faces.push((0..SIDES).rev().collect());
        faces.push(((rings_of - 2) * SIDES..(rings_of - 1) * SIDES).collect());
        Self {
            frame,
            points: (1..rings_of).flat_map(circle).collect(),
            faces,
        }
    }

    /// The surface of a mesh under the URDF's scale, with at most a few thousand faces.
    #[must_use]
    pub fn of_mesh(
        frame: usize,
        frame_from_mesh: &Isometry3<f64>,
        scale: [f64; 3],
        triangles: &[[Point3<f64>; 3]],
    ) -> Self {
        let scaled = Matrix4::new_nonuniform_scaling(&Vector3::from(scale));
        let frame_from_file = frame_from_mesh.to_homogeneous() * scaled;
        // A mirror turns the faces over.
        let mirrored = scale.iter().product::<f64>() < 0.0;
        let mut solid = Self {
            frame,
            ..Self::default()
        };
        // Points are equal when their bits are: exporters write the same numbers.
        let mut known: HashMap<[u64; 3], u32> = HashMap::new();
        for triangle in triangles {
            let mut face = triangle.map(|p| {
                let key = [p.x + 0.0, p.y + 0.0, p.z + 0.0].map(f64::to_bits);
                *known.entry(key).or_insert_with(|| {
                    let at = frame_from_file.transform_point(&p);
                    solid.points.push(at.into());
                    solid.points.len() as u32 - 1
                })
            });
            if mirrored {
                face.swap(1, 2);
            }
            solid.faces.push(face.into());
        }
        solid.thinned(FACES)
    }

    /// The same with at most so many faces: points in one cell of a grid become one, and what has no area is left out
    /// (Rossignac, Borrel, Multi-resolution 3D approximations for rendering complex scenes, 1993).
    #[must_use]
    pub fn thinned(&self, most: usize) -> Self {
        if self.faces.len() <= most {
            return self.clone();
        }
        let mut cells = CELLS;
        loop {
            let coarse = self.in_cells(cells);
            if coarse.faces.len() <= most || cells < 2.0 {
                return coarse;
            }
            // Faces of a surface grow with the square of its cells.
            let wanted = (most as f64 / coarse.faces.len() as f64).sqrt();
            cells *= 0.95 * wanted;
        }
    }

    /// One point for each cell, the longest edge of the solid in `cells` cells.
    fn in_cells(&self, cells: f64) -> Self {
        let over = |pick: fn(f64, f64) -> f64, k: usize| {
            self.points.iter().map(|p| p[k]).reduce(pick).unwrap_or(0.0)
        };
        let low: [f64; 3] = std::array::from_fn(|k| over(f64::min, k));
        let long = (0..3)
            .map(|k| over(f64::max, k) - low[k])
            .fold(0.0, f64::max);
        let edge = (long / cells).max(f64::MIN_POSITIVE);
        let mut index: HashMap<[i64; 3], u32> = HashMap::new();
        let mut sums: Vec<([f64; 3], f64)> = Vec::new();
        let mut cell_of = Vec::with_capacity(self.points.len());
        for point in &self.points {
            let cell = std::array::from_fn(|k| ((point[k] - low[k]) / edge) as i64);
            let new = sums.len() as u32;
            let cell = *index.entry(cell).or_insert(new);
            if cell == new {
                sums.push(([0.0; 3], 0.0));
            }
            let (sum, count) = &mut sums[cell as usize];
            (0..3).for_each(|k| sum[k] += point[k]);
            *count += 1.0;
            cell_of.push(cell);
        }
        let mut seen = BTreeSet::new();
        let mut faces = Vec::new();
        for face in &self.faces {
            let mut corners: Vec<u32> = face.iter().map(|i| cell_of[*i as usize]).collect();
            corners.dedup();
            if corners.len() > 1 && corners.first() == corners.last() {
                corners.pop();
            }
            let mut sorted = corners.clone();
            sorted.sort_unstable();
            if corners.len() > 2 && seen.insert(sorted) {
                faces.push(corners);
            }
        }
        Self {
            frame: self.frame,
            points: sums.iter().map(|(sum, n)| sum.map(|x| x / n)).collect(),
            faces,
        }
    }
}

fn place(at: &Isometry3<f64>, x: f64, y: f64, z: f64) -> [f64; 3] {
    (at * Point3::new(x, y, z)).into()
}

/// Cosine and sine of the corners of a circle.
fn around() -> impl Iterator<Item = (f64, f64)> {
    (0..SIDES).map(|i| {
        let (sin, cos) = (f64::from(i) / f64::from(SIDES) * std::f64::consts::TAU).sin_cos();
        (cos, sin)
    })
}

/// The faces between the circles `k` and `k + 1` above it.
fn rings(k: u32) -> Vec<Vec<u32>> {
    let face = |i: u32| {
        let (a, b) = (k * SIDES + i, k * SIDES + (i + 1) % SIDES);
        vec![a, b, b + SIDES, a + SIDES]
    };
    (0..SIDES).map(face).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume_m3(solid: &Solid) -> f64 {
        let p = |i: u32| Vector3::from(solid.points[i as usize]);
        let cone = |f: &Vec<u32>| -> f64 {
            let fan = f[1..].windows(2);
            fan.map(|w| p(f[0]).dot(&p(w[0]).cross(&p(w[1]))) / 6.0)
                .sum()
        };
        solid.faces.iter().map(cone).sum()
    }

    /// Faces that look inwards would count negative, a hole would change the sum with the place.
    #[test]
    fn simple_shapes_are_closed_look_outwards_and_have_their_volume() {
        let tau = std::f64::consts::TAU;
        // A regular polygon of n sides instead of the circle.
        let n = f64::from(SIDES);
        let polygon = 0.5 * n * (tau / n).sin();
        for at in [
            Isometry3::identity(),
            Isometry3::new(Vector3::new(1.0, -2.0, 3.0), Vector3::new(0.4, 0.1, -2.0)),
        ] {
            let cuboid = volume_m3(&Solid::cuboid(2, &at, [0.2, 0.4, 0.6]));
            assert!((cuboid - 0.048).abs() < 1e-12, "{cuboid}");
            let cylinder = volume_m3(&Solid::cylinder(0, &at, 0.5, 2.0));
            assert!((cylinder - polygon * 0.5).abs() < 1e-12, "{cylinder}");
            let ball = volume_m3(&Solid::ball(0, &at, 0.5));
            let whole = tau * 2.0 / 3.0 * 0.125;
            assert!((0.93..1.0).contains(&(ball / whole)), "{ball}");
        }
    }

    #[test]
    fn a_large_mesh_keeps_its_shape_with_few_faces() {
        // A ball of 120 000 triangles.
        let point = |i: i32, k: i32| {
            let (out, up) = (f64::from(i) / 200.0 * std::f64::consts::PI).sin_cos();
            let (sin, cos) = (f64::from(k) / 300.0 * std::f64::consts::TAU).sin_cos();
            Point3::new(out * cos, out * sin, -up)
        };
        let mut triangles = Vec::new();
        for i in 0..200 {
            for k in 0..300 {
                let [a, b] = [point(i, k), point(i, (k + 1) % 300)];
                let [c, d] = [point(i + 1, k), point(i + 1, (k + 1) % 300)];
                triangles.extend([[a, b, d], [a, d, c]]);
            }
        }
        let at = Isometry3::identity();
        let whole = 2.0 / 3.0 * std::f64::consts::TAU;
        for scale in [[0.1; 3], [0.1, -0.1, 0.1]] {
            let solid = Solid::of_mesh(0, &at, scale, &triangles);
            assert!(
                (800..=FACES).contains(&solid.faces.len()),
                "{}",
                solid.faces.len()
            );
            let volume = volume_m3(&solid) / (whole * 1e-3);
            assert!((0.97..1.0).contains(&volume), "{volume}");
            let few = solid.thinned(200);
            assert!((60..=200).contains(&few.faces.len()), "{}", few.faces.len());
        }
        let cube = Solid::cuboid(0, &at, [1.0; 3]);
        assert_eq!(cube.thinned(6), cube);
    }
}
