//! The glTF file: read again by a reader of its own, which checks it against the specification, and placed pose by pose where the view says.

use crate::examples;
use calib_report::view3d::{View3d, ViewPose, pose_row};
use calib_report::{Scene, glb::glb};
use gltf::animation::util::ReadOutputs;
use nalgebra::{Isometry3, Matrix4, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// Coordinates are 32-bit numbers within two meters, through a chain of seven links, m.
const ROUNDING: f64 = 5e-6;

struct Read {
    document: gltf::Document,
    blob: Vec<u8>,
}

impl Read {
    fn of(bytes: &[u8]) -> Self {
        let file = gltf::Gltf::from_slice(bytes).expect("valid glTF");
        let blob = file.blob.expect("a binary chunk");
        Self {
            document: file.document,
            blob,
        }
    }

    fn node(&self, name: &str) -> gltf::Node<'_> {
        let mut named = self.document.nodes().filter(|n| n.name() == Some(name));
        let node = named.next().unwrap_or_else(|| panic!("no node `{name}`"));
        assert!(named.next().is_none(), "`{name}` twice");
        node
    }

    /// The node in its parent at a pose: what the animation says, else what the node says.
    fn local(&self, node: &gltf::Node<'_>, pose: usize) -> Matrix4<f64> {
        let (mut t, mut r, mut s) = node.transform().decomposed();
        for channel in self.document.animations().flat_map(|a| a.channels()) {
            if channel.target().node().index() != node.index() {
                continue;
            }
            let reader = channel.reader(|_| Some(&self.blob));
            let times: Vec<f32> = reader.read_inputs().expect("times").collect();
            assert_eq!(times[pose], pose as f32, "a second each");
            match reader.read_outputs().expect("values") {
                ReadOutputs::Translations(mut list) => t = list.nth(pose).expect("a pose"),
                ReadOutputs::Rotations(list) => r = list.into_f32().nth(pose).expect("a pose"),
                ReadOutputs::Scales(mut list) => s = list.nth(pose).expect("a pose"),
                ReadOutputs::MorphTargetWeights(_) => panic!("nothing is morphed"),
            }
        }
        let [x, y, z, w] = r.map(f64::from);
        let pose = Isometry3::from_parts(
            Translation3::from(Vector3::from(t.map(f64::from))),
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
        );
        pose.to_homogeneous() * Matrix4::new_nonuniform_scaling(&Vector3::from(s.map(f64::from)))
    }

    /// The node in the file's world at a pose.
    fn world(&self, node: &gltf::Node<'_>, pose: usize) -> Matrix4<f64> {
        let above = self
            .document
            .nodes()
            .find(|n| n.children().any(|child| child.index() == node.index()));
        let local = self.local(node, pose);
        above.map_or(local, |above| self.world(&above, pose) * local)
    }
}

/// glTF has y up where we have z.
fn upright(p: [f64; 3]) -> Point3<f64> {
    Point3::new(p[0], p[2], -p[1])
}

#[test]
fn another_reader_finds_every_link_marker_and_error_where_the_view_has_it() {
    let view = examples::view();
    let bytes = glb(&examples::scene(), &view).expect("a file");
    let read = Read::of(&bytes);
    let origin = |m: &Matrix4<f64>| m.transform_point(&Point3::origin());
    for (i, pose) in view.poses.iter().enumerate() {
        for (frame, row) in view.frames.iter().zip(&pose.calibrated) {
            let place = read.world(&read.node(&frame.name), i);
            let off = origin(&place) - upright([row[0], row[1], row[2]]);
            assert!(off.norm() < ROUNDING, "{} in pose {i}: {off}", frame.name);
        }
        for marker in &pose.markers {
            let Some(observed) = marker.observed else {
                continue;
            };
            let node = read.node(&marker.name);
            let off = origin(&read.world(&node, i)) - upright(observed);
            assert!(off.norm() < ROUNDING, "{} in pose {i}: {off}", marker.name);
            // The tip of the unit arrow.
            let arrow = read.world(&read.node(&format!("{} error", marker.name)), i);
            let tip = arrow.transform_point(&Point3::new(0.0, 0.0, 1.0));
            let expected: [f64; 3] = std::array::from_fn(|k| {
                observed[k] + view.magnification * (marker.predicted[k] - observed[k])
            });
            let off = tip - upright(expected);
            assert!(
                off.norm() < 10.0 * ROUNDING,
                "{} in pose {i}: {off}",
                marker.name
            );
        }
    }
    let names: Vec<&str> = read.document.nodes().filter_map(|n| n.name()).collect();
    for name in [
        "vicon",
        "calibrated",
        "nominal",
        "seen",
        "errors ×100",
        "sweeps",
        "joints",
    ] {
        assert!(names.contains(&name), "{name} is not among {names:?}");
    }
}

#[test]
fn positions_carry_their_true_bounds_and_no_name_of_a_link_is_lost() {
    let bytes = glb(&examples::scene(), &examples::view()).expect("a file");
    let read = Read::of(&bytes);
    let mut primitives = 0;
    for mesh in read.document.meshes() {
        for primitive in mesh.primitives() {
            primitives += 1;
            let points: Vec<[f32; 3]> = primitive
                .reader(|_| Some(&read.blob))
                .read_positions()
                .expect("positions")
                .collect();
            let bounds = primitive.bounding_box();
            for k in 0..3 {
                let over = |pick: fn(f32, f32) -> f32| points.iter().map(|p| p[k]).reduce(pick);
                assert_eq!(over(f32::min), Some(bounds.min[k]), "{:?}", mesh.name());
                assert_eq!(over(f32::max), Some(bounds.max[k]), "{:?}", mesh.name());
            }
        }
    }
    assert!(primitives > 8, "{primitives}");
    assert_eq!(
        bytes,
        glb(&examples::scene(), &examples::view()).expect("the same")
    );
}

/// The volume inside closed faces that look outwards, m³: a missing or turned face changes it.
#[test]
fn links_are_filled_and_have_light_and_shadow() {
    let read = Read::of(&glb(&examples::scene(), &examples::view()).expect("a file"));
    let mesh = read.node("shoulder shape").mesh().expect("a shape");
    let primitive = mesh.primitives().next().expect("faces");
    assert_eq!(primitive.mode(), gltf::mesh::Mode::Triangles);
    let material = primitive.material();
    assert!(!material.unlit() && material.double_sided());
    let reader = primitive.reader(|_| Some(&read.blob));
    let corners: Vec<Vector3<f64>> = (reader.read_positions().expect("positions"))
        .map(|p| Vector3::from(p.map(f64::from)))
        .collect();
    let (faces, rest) = corners.as_chunks::<3>();
    assert!(rest.is_empty());
    let volume: f64 = faces.iter().map(|[a, b, c]| a.dot(&b.cross(c)) / 6.0).sum();
    assert!((volume - 0.08 * 0.1 * 0.4).abs() < 1e-8, "{volume}");
    let names: Vec<&str> = read.document.nodes().filter_map(|n| n.name()).collect();
    let shapes = names.iter().filter(|name| name.ends_with(" shape"));
    assert_eq!(shapes.count(), 3, "the calibrated robot's only: {names:?}");
}

#[test]
fn empty_and_odd_views_are_files_too() {
    Read::of(&glb(&Scene::default(), &View3d::default()).expect("nothing to show"));
    // One pose, a marker that was lost, a link straight below its parent, a nominal robot in no pose.
    let mut view = examples::view();
    view.poses.truncate(1);
    let pose = &mut view.poses[0];
    pose.nominal.clear();
    pose.markers[0].observed = None;
    pose.calibrated[1] = pose_row(&(Isometry3::translation(0.0, 0.0, -0.5)));
    pose.calibrated[0] = pose_row(&Isometry3::identity());
    let read = Read::of(&glb(&Scene::default(), &view).expect("a file"));
    assert_eq!(read.document.animations().count(), 0);
    let lost = read.node(&view.poses[0].markers[0].name);
    assert_eq!(
        lost.transform().decomposed().2,
        [0.0; 3],
        "a lost marker is not shown"
    );
    let down = read.node(&format!(
        "{} to {}",
        view.frames[0].name, view.frames[1].name
    ));
    let tip = read
        .world(&down, 0)
        .transform_point(&Point3::new(0.0, 0.0, 1.0));
    assert!((tip - upright([0.0, 0.0, -0.5])).norm() < ROUNDING, "{tip}");
    // Another pose without a nominal robot: it cannot be animated, but the file stays one.
    let mut view = examples::view();
    view.poses[1] = ViewPose {
        nominal: Vec::new(),
        ..view.poses[1].clone()
    };
    Read::of(&glb(&Scene::default(), &view).expect("a file"));
}
