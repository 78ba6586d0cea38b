//! Wavefront OBJ, read by `tobj`.

use super::{MeshError, TRIANGLES, Triangle, too_many};
use nalgebra::Point3;

pub(super) fn read(obj: &[u8]) -> Result<Vec<Triangle>, MeshError> {
    // Names and comments are in any code page.
    let text = String::from_utf8_lossy(obj);
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_lines: true,
        ignore_points: true,
        ..tobj::LoadOptions::default()
    };
    // Colors are not needed: no other file is opened.
    let no_material = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
    let read = tobj::load_obj_buf(&mut text.as_bytes(), &options, no_material);
    let (models, _) = read.map_err(|error| MeshError(error.to_string()))?;
    let count: usize = models.iter().map(|m| m.mesh.indices.len() / 3).sum();
    if count > TRIANGLES {
        return Err(too_many(count));
    }
    let mut triangles = Vec::with_capacity(count);
    for tobj::Model { mesh, .. } in &models {
        let (places, _) = mesh.positions.as_chunks::<3>();
        let (corners, _) = mesh.indices.as_chunks::<3>();
        for corners in corners {
            let corner = |i: u32| {
                places
                    .get(i as usize)
                    .map(|p| Point3::from(p.map(f64::from)))
            };
            let [a, b, c] = corners.map(corner);
            let (Some(a), Some(b), Some(c)) = (a, b, c) else {
                return Err(MeshError(
                    "a face names a vertex that is not there".to_owned(),
                ));
            };
            triangles.push([a, b, c]);
        }
    }
    Ok(triangles)
}
