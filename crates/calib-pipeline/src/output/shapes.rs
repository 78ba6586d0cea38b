//! The look of the links for the 3-D view: shapes of the URDF, meshes where their files are at hand.
//!
//! A picture decides nothing: what cannot be drawn is left out and named, in one finding per cause.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use calib_files::input;
use calib_finding::{About, Fact, Finding, catalog};
use calib_report::view3d::Solid;
use calib_urdf::mesh::{MeshFormat, Triangle};
use calib_urdf::sha256_hex;
use calib_urdf::visual::{Geometry, Visual, collisions, visuals};

use crate::prepare::inputs::{Digest, RobotProfile};

/// A mesh file larger than this is a scan, not a drawing.
const MAX_BYTES: u64 = 128 << 20;

/// Shapes left out that the finding names.
const NAMED: usize = 3;

/// Why a shape is not drawn; each is a form of [`catalog::SHAPE_NOT_DRAWN`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum NotDrawn {
    NoPackage,
    Scheme,
    Format,
    Outside,
    Unreadable,
    TooLarge,
    Damaged,
    Undefined,
}

impl NotDrawn {
    fn form(self) -> &'static str {
        match self {
            Self::NoPackage => "no_package",
            Self::Scheme => "scheme",
            Self::Format => "format",
            Self::Outside => "outside",
            Self::Unreadable => "unreadable",
            Self::TooLarge => "too_large",
            Self::Damaged => "damaged",
            Self::Undefined => "undefined",
        }
    }
}

/// The shapes of all links, and the mesh files that were read for them.
///
/// Findings tell what was left out, and why.
#[must_use]
pub fn solids(robot: &RobotProfile, findings: &mut Vec<Finding>) -> (Vec<Solid>, Vec<Digest>) {
    let (mut solids, mut read) = (Vec::new(), Vec::new());
    let file = &robot.profile.urdf;
    // The model was read from the same text: it is XML.
    let Ok((shapes, faults)) = visuals(&robot.urdf_text, file) else {
        return (solids, read);
    };
    let count = shapes.len() + faults.len();
    let mut left_out: BTreeMap<NotDrawn, Vec<String>> = BTreeMap::new();
    for fault in faults {
        let links = left_out.entry(NotDrawn::Undefined).or_default();
        links.push(fault.link);
    }
    for shape in &shapes {
        let Ok(link) = robot.model.link_id(&shape.link) else {
            continue;
        };
        match solid(robot, link.index(), shape) {
            Ok((solid, digest)) => {
                solids.push(solid);
                read.extend(digest.filter(|d| !read.contains(d)));
            }
            Err((mesh, why)) => left_out.entry(why).or_default().push(mesh),
        }
    }
    for (why, mut names) in left_out {
        let missing = names.len();
        let more = (missing > NAMED).then(|| Fact::count(missing - NAMED));
        names.truncate(NAMED);
        let about = About::File(file.clone());
        findings.push(
            Finding::of_kind(catalog::SHAPE_NOT_DRAWN, why.form(), about)
                .with("missing", Fact::count(missing))
                .with("total", Fact::count(count))
                .with("shapes", Fact::names(names))
                .with_some("more", more),
        );
    }
    (solids, read)
}

/// A shape of a link that could not be read.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Unread {
    /// The link.
    pub link: String,
    /// The mesh file, as the URDF names it; absent: the URDF states the shape wrongly.
    pub file: Option<String>,
}

/// The shapes that stand for the links where collisions are looked for: those of `<collision>`, else of `<visual>`, link by link.
/// Also what could not be read.
#[must_use]
pub fn collision_solids(robot: &RobotProfile) -> (Vec<Solid>, Vec<Unread>) {
    let file = &robot.profile.urdf;
    let (Ok((stated, bad)), Ok((drawn, faults))) = (
        collisions(&robot.urdf_text, file),
        visuals(&robot.urdf_text, file),
    ) else {
        return (Vec::new(), Vec::new());
    };
    let has_own = |link: &String| stated.iter().any(|shape| shape.link == *link);
    let drawn = drawn.iter().filter(|shape| !has_own(&shape.link));
    let (mut solids, mut unread) = (Vec::new(), Vec::new());
    let without_file = |link: String| Unread { link, file: None };
    unread.extend(bad.into_iter().map(|fault| without_file(fault.link)));
    let faults = faults.into_iter().filter(|fault| !has_own(&fault.link));
    unread.extend(faults.map(|fault| without_file(fault.link)));
    for shape in stated.iter().chain(drawn) {
        let Ok(link) = robot.model.link_id(&shape.link) else {
            continue;
        };
        match solid(robot, link.index(), shape) {
            Ok((solid, _)) => solids.push(solid),
            Err((file, _)) => unread.push(Unread {
                link: shape.link.clone(),
                file: Some(file),
            }),
        }
    }
    unread.sort();
    unread.dedup();
    (solids, unread)
}

/// One shape and the file that was read for it; else the file, and why it is not drawn.
fn solid(
    robot: &RobotProfile,
    frame: usize,
    shape: &Visual,
) -> Result<(Solid, Option<Digest>), (String, NotDrawn)> {
    let at = &shape.link_from_visual;
    Ok(match &shape.geometry {
        Geometry::Box { size } => (Solid::cuboid(frame, at, *size), None),
        Geometry::Cylinder { radius, length } => {
            (Solid::cylinder(frame, at, *radius, *length), None)
        }
        Geometry::Sphere { radius } => (Solid::ball(frame, at, *radius), None),
        Geometry::Mesh { filename, scale } => {
            let named = |why: NotDrawn| (filename.clone(), why);
            let (triangles, bytes) = mesh(robot, filename).map_err(named)?;
            let digest = Digest {
                path: filename.clone(),
                sha256: sha256_hex(&bytes),
            };
            (Solid::of_mesh(frame, at, *scale, &triangles), Some(digest))
        }
    })
}

/// The triangles of a mesh, and the bytes of its file.
fn mesh(robot: &RobotProfile, filename: &str) -> Result<(Vec<Triangle>, Vec<u8>), NotDrawn> {
    let path = resolve(robot, filename)?;
    let extension = path.extension().and_then(|e| e.to_str());
    let format = extension.and_then(MeshFormat::of_extension);
    let format = format.ok_or(NotDrawn::Format)?;
    // Behind all links: a URDF from elsewhere names no other files of this computer.
    let path = path.canonicalize().map_err(|_| NotDrawn::Unreadable)?;
    if !roots(robot).iter().any(|root| path.starts_with(root)) {
        return Err(NotDrawn::Outside);
    }
    let bytes = input::read(&path, MAX_BYTES).map_err(|error| match error.kind() {
        ErrorKind::FileTooLarge => NotDrawn::TooLarge,
        _ => NotDrawn::Unreadable,
    })?;
    let triangles = format.triangles(&bytes);
    Ok((triangles.map_err(|_| NotDrawn::Damaged)?, bytes))
}

/// The folders whose files a URDF may name: its own, the packages around it, and those that the profile gives.
fn roots(robot: &RobotProfile) -> Vec<PathBuf> {
    let urdf = robot.folder.join(&robot.profile.urdf);
    let given = robot.profile.packages.values();
    let mut roots: Vec<PathBuf> = given
        .filter_map(|folder| robot.folder.join(folder).canonicalize().ok())
        .collect();
    if let Some(beside) = urdf.canonicalize().ok().as_deref().and_then(Path::parent) {
        roots.push(beside.to_owned());
        let package = beside.ancestors().find(|folder| is_package(folder));
        if let Some(package) = package {
            roots.push(package.to_owned());
            // Packages lie beside each other in a workspace.
            let siblings = package.parent().and_then(|p| std::fs::read_dir(p).ok());
            let siblings = siblings.into_iter().flatten().flatten();
            roots.extend(
                siblings
                    .map(|e| e.path())
                    .filter(|folder| is_package(folder)),
            );
        }
    }
    roots
}

fn is_package(folder: &Path) -> bool {
    folder.join("package.xml").is_file()
}

/// The file that a URDF names: relative to the URDF, or in a package.
fn resolve(robot: &RobotProfile, filename: &str) -> Result<PathBuf, NotDrawn> {
    let urdf = robot.folder.join(&robot.profile.urdf);
    let beside = urdf.parent().unwrap_or(Path::new(""));
    if let Some(path) = filename.strip_prefix("file://") {
        return Ok(PathBuf::from(path));
    }
    for scheme in ["package://", "model://"] {
        if let Some(rest) = filename.strip_prefix(scheme) {
            let (package, rest) = rest.split_once('/').ok_or(NotDrawn::NoPackage)?;
            let folder = match robot.profile.packages.get(package) {
                Some(folder) => robot.folder.join(folder),
                None => find_package(beside, package).ok_or(NotDrawn::NoPackage)?,
            };
            return Ok(folder.join(rest));
        }
    }
    match filename.split_once("://") {
        Some(_) => Err(NotDrawn::Scheme),
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
