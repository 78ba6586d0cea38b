//! STL, binary and text.

use super::{MeshError, TRIANGLES, Triangle, too_many};
use nalgebra::Point3;

/// A binary file may begin with `solid` too: its length is the better witness.
pub(super) fn read(stl: &[u8]) -> Result<Vec<Triangle>, MeshError> {
    let stated = stl.get(80..84).and_then(|bytes| bytes.try_into().ok());
    let stated = stated.map(|bytes| u32::from_le_bytes(bytes) as usize);
    let fits = stated.is_some_and(|n| stl.len() == 84 + 50 * n);
    if !fits && stl.trim_ascii_start().starts_with(b"solid") {
        return text(stl);
    }
    let n = stated.ok_or_else(|| {
        let bytes = stl.len();
        MeshError(format!("{bytes} bytes, an STL has at least 84"))
    })?;
    if n > TRIANGLES {
        return Err(too_many(n));
    }
    if stl.len() < 84 + 50 * n {
        return Err(MeshError(format!(
            "{} bytes, {n} triangles need {}",
            stl.len(),
            84 + 50 * n
        )));
    }
    let number = |at: usize| {
        let bytes = stl.get(at..at + 4).and_then(|bytes| bytes.try_into().ok());
        bytes.map_or(f64::NAN, |bytes| f64::from(f32::from_le_bytes(bytes)))
    };
    let vertex = |i: usize, k: usize| {
        // 12 bytes of normal, then three vertices of 12 bytes.
        let at = 84 + 50 * i + 12 * (k + 1);
        Point3::new(number(at), number(at + 4), number(at + 8))
    };
    Ok((0..n)
        .map(|i| [vertex(i, 0), vertex(i, 1), vertex(i, 2)])
        .collect())
}

fn text(stl: &[u8]) -> Result<Vec<Triangle>, MeshError> {
    let mut vertices = Vec::new();
    for (i, line) in String::from_utf8_lossy(stl).lines().enumerate() {
        let Some(rest) = line.trim_start().strip_prefix("vertex") else {
            continue;
        };
        let words = rest.split_whitespace();
        let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
        let [x, y, z] = numbers[..] else {
            return Err(MeshError(format!(
                "line {}: a vertex has three numbers, found `{}`",
                i + 1,
                rest.trim()
            )));
        };
        vertices.push(Point3::new(x, y, z));
    }
    let (triangles, rest) = vertices.as_chunks::<3>();
    if !rest.is_empty() {
        let n = vertices.len();
        return Err(MeshError(format!("{n} vertices are no triangles")));
    }
    if triangles.len() > TRIANGLES {
        return Err(too_many(triangles.len()));
    }
    Ok(triangles.to_vec())
}
