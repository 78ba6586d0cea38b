//! The look of the links for the 3-D view: shapes of the URDF, meshes where their files are at hand.
//!
//! A picture decides nothing: what cannot be drawn is left out and named in one finding.

use std::path::{Path, PathBuf};

use calib_finding::{About, Fact, Finding, catalog};
use calib_report::view3d::Outline;
use calib_urdf::sha256_hex;
use calib_urdf::visual::{Geometry, Visual, visuals};

use crate::prepare::inputs::{Digest, RobotProfile};

/// A mesh file larger than this is a scan, not a drawing.
const MAX_BYTES: u64 = 128 << 20;

/// Shapes left out that the finding names.
const NAMED: usize = 3;

/// The outlines of all links, and the mesh files that were read for them.
///
/// A finding tells what was left out, and why.
#[must_use]
pub fn outlines(robot: &RobotProfile, findings: &mut Vec<Finding>) -> (Vec<Outline>, Vec<Digest>) {
    let (mut outlines, mut read) = (Vec::new(), Vec::new());
    let file = &robot.profile.urdf;
    // The model was read from the same text: it is XML.
    let Ok((shapes, faults)) = visuals(&robot.urdf_text, file) else {
        return (outlines, read);
    };
    let count = shapes.len() + faults.len();
    let mut left_out: Vec<String> = faults
        .iter()
        .map(|fault| format!("line {} ({}): {}", fault.place.line, fault.link, fault.text))
        .collect();
    for shape in &shapes {
        let Ok(link) = robot.model.link_id(&shape.link) else {
            continue;
        };
        match outline(robot, link.index(), shape) {
            Ok((outline, digest)) => {
                outlines.push(outline);
                read.extend(digest.filter(|d| !read.contains(d)));
            }
            Err(why) => left_out.push(format!("{}: {why}", shape.link)),
        }
    }
    if !left_out.is_empty() {
        let n = left_out.len();
        let more = (n > NAMED).then(|| Fact::count(n - NAMED));
        left_out.truncate(NAMED);
        findings.push(
            Finding::new(catalog::SHAPE_NOT_DRAWN, About::File(file.clone()))
                .with("missing", Fact::count(n))
                .with("total", Fact::count(count))
                .with("shapes", Fact::names(left_out))
                .with_some("more", more),
        );
    }
    (outlines, read)
}

fn outline(
    robot: &RobotProfile,
    frame: usize,
    shape: &Visual,
) -> Result<(Outline, Option<Digest>), String> {
    let at = &shape.link_from_visual;
    Ok(match &shape.geometry {
        Geometry::Box { size } => (Outline::cuboid(frame, at, *size), None),
        Geometry::Cylinder { radius, length } => {
            (Outline::cylinder(frame, at, *radius, *length), None)
        }
        Geometry::Sphere { radius } => (Outline::ball(frame, at, *radius), None),
        Geometry::Mesh { filename, scale } => {
            let told = |why: &str| format!("`{filename}`: {why}");
            let path = resolve(robot, filename).map_err(|why| told(&why))?;
            let is_stl = path
                .extension()
                .is_some_and(|e| e.eq_ignore_ascii_case("stl"));
            if !is_stl {
                return Err(told("only STL meshes are drawn"));
            }
            let size = std::fs::metadata(&path)
                .map_err(|e| told(&e.kind().to_string()))?
                .len();
            if size > MAX_BYTES {
                return Err(told("the file has more than 128 MB"));
            }
            let bytes = std::fs::read(&path).map_err(|e| told(&e.kind().to_string()))?;
            let outline =
                Outline::from_stl(frame, at, *scale, &bytes).map_err(|e| told(&e.to_string()))?;
            let digest = Digest {
                path: filename.clone(),
                sha256: sha256_hex(&bytes),
            };
            (outline, Some(digest))
        }
    })
}

/// The file that a URDF names: relative to the URDF, or in a package.
fn resolve(robot: &RobotProfile, filename: &str) -> Result<PathBuf, String> {
    let urdf = robot.folder.join(&robot.profile.urdf);
    let beside = urdf.parent().unwrap_or(Path::new(""));
    if let Some(path) = filename.strip_prefix("file://") {
        return Ok(PathBuf::from(path));
    }
    for scheme in ["package://", "model://"] {
        if let Some(rest) = filename.strip_prefix(scheme) {
            let (package, rest) = rest.split_once('/').ok_or("no path in the package")?;
            let folder = match robot.profile.packages.get(package) {
                Some(folder) => robot.folder.join(folder),
                None => find_package(beside, package).ok_or_else(|| {
                    format!("the package `{package}` is neither around the URDF nor under `robot.packages`")
                })?,
            };
            return Ok(folder.join(rest));
        }
    }
    match filename.split_once("://") {
        Some((scheme, _)) => Err(format!("`{scheme}://` is not read")),
        // An absolute path stays one.
        None => Ok(beside.join(filename)),
    }
}

/// A folder of the package's name among those above the URDF, or beside one of them, as packages lie in a workspace.
fn find_package(beside: &Path, package: &str) -> Option<PathBuf> {
    // A name from a file: no way out of the folders that are searched.
    if package.is_empty() || package == "." || package == ".." {
        return None;
    }
    let beside = beside.canonicalize().ok()?;
    beside.ancestors().find_map(|folder| {
        if folder.file_name().is_some_and(|name| name == package) {
            return Some(folder.to_owned());
        }
        let inside = folder.join(package);
        inside.is_dir().then_some(inside)
    })
}
