//! Meshes as URDFs name them: STL, Wavefront OBJ and Collada, as triangles.
//!
//! Only the surface is read: no colors, textures or animations. A file that is not what its name says is an error, never a
//! panic: meshes come from elsewhere (`book/src/decisions/meshes.md`).

mod dae;
mod obj;
mod stl;

use nalgebra::{Matrix4, Point3};
use thiserror::Error;

/// Three corners, in the file's own unit; Collada states its unit and is given in m.
pub type Triangle = [Point3<f64>; 3];

/// Triangles of a mesh that are read: beyond this it is a scan, not a drawing.
pub const TRIANGLES: usize = 2_000_000;

/// What is wrong with a mesh, with the place where it is known.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct MeshError(String);

/// A kind of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshFormat {
    /// Binary or text.
    Stl,
    /// Wavefront.
    Obj,
    /// Collada.
    Dae,
}

impl MeshFormat {
    /// The format that files of an extension have, in upper or lower case.
    #[must_use]
    pub fn of_extension(extension: &str) -> Option<Self> {
        match extension.to_ascii_lowercase().as_str() {
            "stl" => Some(Self::Stl),
            "obj" => Some(Self::Obj),
            "dae" => Some(Self::Dae),
            _ => None,
        }
    }

    /// The triangles of a file of this format.
    ///
    /// # Errors
    /// [`MeshError`] when the bytes are not of the format, are cut off, have no triangle or more than [`TRIANGLES`], or
    /// have numbers that are not finite.
    ///
    /// ```
    /// use calib_urdf::mesh::MeshFormat;
    /// let obj = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n";
    /// assert_eq!(MeshFormat::Obj.triangles(obj)?.len(), 2);
    /// assert!(MeshFormat::Stl.triangles(obj).is_err());
    /// # Ok::<(), calib_urdf::mesh::MeshError>(())
    /// ```
    pub fn triangles(self, bytes: &[u8]) -> Result<Vec<Triangle>, MeshError> {
        let triangles = match self {
            Self::Stl => stl::read(bytes)?,
            Self::Obj => obj::read(bytes)?,
            Self::Dae => dae::read(bytes)?,
        };
        if triangles.is_empty() {
            return Err(MeshError("no triangles".to_owned()));
        }
        let finite = |p: &Point3<f64>| p.coords.iter().all(|x| x.is_finite());
        match triangles.iter().position(|t| !t.iter().all(finite)) {
            Some(i) => Err(MeshError(format!(
                "triangle {} has a number that is not finite",
                i + 1
            ))),
            None => Ok(triangles),
        }
    }
}

fn too_many(n: usize) -> MeshError {
    MeshError(format!("{n} triangles, at most {TRIANGLES} are read"))
}

/// A convex polygon as triangles around its first corner.
fn fan(corners: &[Point3<f64>], triangles: &mut Vec<Triangle>) {
    for pair in corners.get(1..).unwrap_or_default().windows(2) {
        triangles.push([corners[0], pair[0], pair[1]]);
    }
}

/// Triangles at another place.
fn moved<'a>(
    triangles: &'a [Triangle],
    to_from: &'a Matrix4<f64>,
) -> impl Iterator<Item = Triangle> + 'a {
    (triangles.iter()).map(move |t| t.map(|p| Point3::from((to_from * p.to_homogeneous()).xyz())))
}

#[cfg(test)]
mod tests;
