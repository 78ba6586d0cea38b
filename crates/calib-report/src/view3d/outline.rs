//! The outline of a link as lines: boxes and cylinders of the URDF, creases of an STL mesh.
//!
//! A mesh has far more triangles than a page carries or an eye wants: only edges where the surface bends or ends are kept.

use crate::ReportError;
use nalgebra::{Isometry3, Point3, Vector3};
use serde::Serialize;
use std::collections::BTreeMap;

/// Lines that move with a frame.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Outline {
    /// Index into [`super::View3d::frames`].
    pub frame: usize,
    /// From x, y, z to x, y, z in the frame, m.
    pub lines: Vec<[f64; 6]>,
}

/// Lines of one mesh in the page; the longest are kept.
const LINES: usize = 1500;

/// Triangles of a mesh that are looked at: beyond this it is a scan, not a drawing.
const TRIANGLES: usize = 2_000_000;

/// An edge is a crease where the surface bends by more than this: tessellated cylinders bend by 10–20° a face.
const CREASE_DEG: f64 = 30.0;

/// Sides of a drawn cylinder.
const SIDES: usize = 16;

impl Outline {
    /// A box around its center, edge lengths in m.
    #[must_use]
    pub fn cuboid(frame: usize, frame_from_box: &Isometry3<f64>, size_m: [f64; 3]) -> Self {
        let corner = |i: usize| {
            let half = |k: usize| {
                if i >> k & 1 == 1 {
                    0.5 * size_m[k]
                } else {
                    -0.5 * size_m[k]
                }
            };
            frame_from_box * Point3::new(half(0), half(1), half(2))
        };
        // Corners differ in one bit along an edge.
        let edges = (0..8)
            .flat_map(|i| (0..3).map(move |k| (i, i ^ (1 << k))))
            .filter(|(i, j)| i < j);
        Self {
            frame,
            lines: edges
                .map(|(i, j)| segment(&corner(i), &corner(j)))
                .collect(),
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
        let point = |i: usize, end: f64| {
            let (sin, cos) = (i as f64 / SIDES as f64 * std::f64::consts::TAU).sin_cos();
            frame_from_cylinder * Point3::new(radius_m * cos, radius_m * sin, 0.5 * end * length_m)
        };
        let rims = (0..SIDES)
            .flat_map(|i| [-1.0, 1.0].map(|end| segment(&point(i, end), &point(i + 1, end))));
        let sides = (0..SIDES)
            .step_by(SIDES / 4)
            .map(|i| segment(&point(i, -1.0), &point(i, 1.0)));
        Self {
            frame,
            lines: rims.chain(sides).collect(),
        }
    }

    /// A ball around its center: three great circles.
    #[must_use]
    pub fn ball(frame: usize, frame_from_ball: &Isometry3<f64>, radius_m: f64) -> Self {
        let point = |i: usize, axis: usize| {
            let (sin, cos) = (i as f64 / SIDES as f64 * std::f64::consts::TAU).sin_cos();
            let mut p = Point3::origin();
            p[(axis + 1) % 3] = radius_m * cos;
            p[(axis + 2) % 3] = radius_m * sin;
            frame_from_ball * p
        };
        let circles = (0..3).flat_map(|axis| (0..SIDES).map(move |i| (i, axis)));
        Self {
            frame,
            lines: circles
                .map(|(i, axis)| segment(&point(i, axis), &point(i + 1, axis)))
                .collect(),
        }
    }

    /// The creases and borders of an STL mesh, binary or text, under the URDF's scale.
    ///
    /// # Errors
    /// [`ReportError::Stl`] when the bytes are no STL, are cut off, or have numbers that are not finite.
    pub fn from_stl(
        frame: usize,
        frame_from_mesh: &Isometry3<f64>,
        scale: [f64; 3],
        stl: &[u8],
    ) -> Result<Self, ReportError> {
        let triangles = if is_binary(stl) {
            binary(stl)?
        } else {
            text(stl)?
        };
        let scaled = |p: &Point3<f64>| {
            frame_from_mesh * Point3::new(p.x * scale[0], p.y * scale[1], p.z * scale[2])
        };
        let mut lines: Vec<[f64; 6]> = creases(&triangles)
            .iter()
            .map(|(a, b)| segment(&scaled(a), &scaled(b)))
            .collect();
        let length = |line: &[f64; 6]| (0..3).map(|k| (line[k + 3] - line[k]).powi(2)).sum::<f64>();
        lines.sort_by(|a, b| length(b).total_cmp(&length(a)));
        lines.truncate(LINES);
        Ok(Self { frame, lines })
    }
}

fn segment(a: &Point3<f64>, b: &Point3<f64>) -> [f64; 6] {
    [a.x, a.y, a.z, b.x, b.y, b.z]
}

type Triangle = [Point3<f64>; 3];

/// A binary file may begin with `solid` too: its length is the better witness.
fn is_binary(stl: &[u8]) -> bool {
    let stated = stl
        .get(80..84)
        .and_then(|bytes| bytes.try_into().ok())
        .map(|bytes| u32::from_le_bytes(bytes) as usize);
    stated.is_some_and(|n| stl.len() == 84 + 50 * n)
        || !stl.trim_ascii_start().starts_with(b"solid")
}

fn binary(stl: &[u8]) -> Result<Vec<Triangle>, ReportError> {
    let broken = |text: String| ReportError::Stl(text);
    let header = stl.get(80..84).and_then(|bytes| bytes.try_into().ok());
    let n = header
        .map(|bytes| u32::from_le_bytes(bytes) as usize)
        .ok_or_else(|| broken(format!("{} bytes, an STL has at least 84", stl.len())))?;
    if n > TRIANGLES {
        return Err(broken(format!(
            "{n} triangles, at most {TRIANGLES} are read"
        )));
    }
    if stl.len() < 84 + 50 * n {
        return Err(broken(format!(
            "{} bytes, {n} triangles need {}",
            stl.len(),
            84 + 50 * n
        )));
    }
    let number = |at: usize| {
        stl.get(at..at + 4)
            .and_then(|bytes| bytes.try_into().ok())
            .map_or(f64::NAN, |bytes| f64::from(f32::from_le_bytes(bytes)))
    };
    let vertex = |i: usize, k: usize| {
        // 12 bytes of normal, then three vertices of 12 bytes.
        let at = 84 + 50 * i + 12 * (k + 1);
        Point3::new(number(at), number(at + 4), number(at + 8))
    };
    checked(
        (0..n)
            .map(|i| [vertex(i, 0), vertex(i, 1), vertex(i, 2)])
            .collect(),
    )
}

fn text(stl: &[u8]) -> Result<Vec<Triangle>, ReportError> {
    let mut vertices = Vec::new();
    for (i, line) in String::from_utf8_lossy(stl).lines().enumerate() {
        let Some(rest) = line.trim_start().strip_prefix("vertex") else {
            continue;
        };
        let numbers: Vec<f64> = rest
            .split_whitespace()
            .filter_map(|word| word.parse().ok())
            .collect();
        let [x, y, z] = numbers[..] else {
            return Err(ReportError::Stl(format!(
                "line {}: a vertex has three numbers, found `{}`",
                i + 1,
                rest.trim()
            )));
        };
        vertices.push(Point3::new(x, y, z));
    }
    let (triangles, rest) = vertices.as_chunks::<3>();
    if !rest.is_empty() || triangles.is_empty() || triangles.len() > TRIANGLES {
        return Err(ReportError::Stl(format!(
            "{} vertices are no triangles",
            vertices.len()
        )));
    }
    checked(triangles.to_vec())
}

fn checked(triangles: Vec<Triangle>) -> Result<Vec<Triangle>, ReportError> {
    match triangles.iter().position(|triangle| {
        triangle
            .iter()
            .any(|p| !p.coords.iter().all(|x| x.is_finite()))
    }) {
        Some(i) => Err(ReportError::Stl(format!(
            "triangle {} has a number that is not finite",
            i + 1
        ))),
        None => Ok(triangles),
    }
}

/// Edges with one face, more than two, or two that meet at an angle.
fn creases(triangles: &[Triangle]) -> Vec<(Point3<f64>, Point3<f64>)> {
    // Vertices are equal when their bits are: exporters write the same numbers.
    type Key = [u64; 3];
    type Side = (Vector3<f64>, [Point3<f64>; 2]);
    let key = |p: &Point3<f64>| -> Key { [p.x + 0.0, p.y + 0.0, p.z + 0.0].map(f64::to_bits) };
    let mut faces: BTreeMap<(Key, Key), Vec<Side>> = BTreeMap::new();
    for [a, b, c] in triangles {
        // A triangle without area has no direction and no say.
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else {
            continue;
        };
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let (p, q) = if key(p) <= key(q) { (p, q) } else { (q, p) };
            faces
                .entry((key(p), key(q)))
                .or_default()
                .push((normal, [*p, *q]));
        }
    }
    let flat = CREASE_DEG.to_radians().cos();
    let is_crease = |sides: &[Side]| match sides {
        [one, other] => one.0.dot(&other.0) < flat,
        _ => true,
    };
    faces
        .values()
        .filter(|sides| is_crease(sides))
        .filter_map(|sides| sides.first())
        .map(|(_, [p, q])| (*p, *q))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit cube of twelve triangles: its outline is twelve edges, no diagonals.
    fn cube() -> Vec<Triangle> {
        let p = |x: i32, y: i32, z: i32| Point3::new(f64::from(x), f64::from(y), f64::from(z));
        let quads = [
            [p(0, 0, 0), p(0, 1, 0), p(1, 1, 0), p(1, 0, 0)],
            [p(0, 0, 1), p(1, 0, 1), p(1, 1, 1), p(0, 1, 1)],
            [p(0, 0, 0), p(1, 0, 0), p(1, 0, 1), p(0, 0, 1)],
            [p(0, 1, 0), p(0, 1, 1), p(1, 1, 1), p(1, 1, 0)],
            [p(0, 0, 0), p(0, 0, 1), p(0, 1, 1), p(0, 1, 0)],
            [p(1, 0, 0), p(1, 1, 0), p(1, 1, 1), p(1, 0, 1)],
        ];
        quads
            .iter()
            .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
            .collect()
    }

    fn binary_stl(triangles: &[Triangle]) -> Vec<u8> {
        let mut bytes = b"solid, but binary".to_vec();
        bytes.resize(80, b' ');
        bytes.extend((triangles.len() as u32).to_le_bytes());
        for triangle in triangles {
            bytes.extend([0; 12]);
            for p in triangle {
                bytes.extend(
                    [p.x, p.y, p.z]
                        .iter()
                        .flat_map(|x| (*x as f32).to_le_bytes()),
                );
            }
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn text_stl(triangles: &[Triangle]) -> Vec<u8> {
        let facet = |t: &Triangle| {
            let vertices: String = t
                .iter()
                .map(|p| format!("      vertex {} {} {}\r\n", p.x, p.y, p.z))
                .collect();
            format!(
                "  facet normal 0 0 0\r\n    outer loop\r\n{vertices}    endloop\r\n  endfacet\r\n"
            )
        };
        format!(
            "solid cube\r\n{}endsolid\r\n",
            triangles.iter().map(facet).collect::<String>()
        )
        .into_bytes()
    }

    #[test]
    fn a_cube_has_twelve_edges_in_both_kinds_of_file() {
        for stl in [binary_stl(&cube()), text_stl(&cube())] {
            let outline = Outline::from_stl(0, &Isometry3::identity(), [1.0, 1.0, 2.0], &stl)
                .expect("an STL");
            assert_eq!(outline.lines.len(), 12);
            let upright = outline
                .lines
                .iter()
                .filter(|line| (line[5] - line[2]).abs() == 2.0)
                .count();
            assert_eq!(upright, 4, "the scale of the URDF is applied");
        }
    }

    #[test]
    fn what_is_no_mesh_is_an_error() {
        let mut cut = binary_stl(&cube());
        cut.truncate(300);
        cut[..5].copy_from_slice(b"mesh ");
        let mut not_finite = cube();
        not_finite[3][1].x = f64::NAN;
        let table: [(&[u8], &str); 6] = [
            (b"", "at least 84"),
            (b"solid x\nvertex 1 2\n", "line 2"),
            (b"solid x\nvertex 1 2 3\n", "no triangles"),
            (b"<html>", "at least 84"),
            (&cut, "12 triangles need 684"),
            (&binary_stl(&not_finite), "triangle 4"),
        ];
        for (stl, part) in table {
            let error = Outline::from_stl(0, &Isometry3::identity(), [1.0; 3], stl)
                .expect_err(part)
                .to_string();
            assert!(error.contains(part), "{error}");
        }
        let mut boast = vec![0; 84];
        boast[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(Outline::from_stl(0, &Isometry3::identity(), [1.0; 3], &boast).is_err());
    }

    #[test]
    fn simple_shapes_have_the_size_they_say() {
        let at = Isometry3::translation(1.0, 0.0, 0.0);
        let reach = |outline: &Outline, k: usize| {
            let ends = outline.lines.iter().flat_map(|line| [line[k], line[k + 3]]);
            ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            })
        };
        let cuboid = Outline::cuboid(2, &at, [0.2, 0.4, 0.6]);
        assert_eq!((cuboid.frame, cuboid.lines.len()), (2, 12));
        assert_eq!(
            (reach(&cuboid, 0), reach(&cuboid, 2)),
            ((0.9, 1.1), (-0.3, 0.3))
        );
        let cylinder = Outline::cylinder(0, &at, 0.5, 2.0);
        assert_eq!(reach(&cylinder, 2), (-1.0, 1.0));
        assert!((reach(&cylinder, 0).1 - 1.5).abs() < 1e-12);
        let ball = Outline::ball(0, &at, 0.5);
        assert!((0..3).all(|k| (reach(&ball, k).1 - reach(&ball, k).0 - 1.0).abs() < 1e-12));
    }
}
