//! The view as a binary glTF 2.0 file: any viewer of 3-D files shows the robot, the markers and the errors.
//!
//! ```text
//! tracker (turned: glTF has y up)
//! ├── calibrated      links as nodes, each under its parent, with axes and shapes
//! ├── nominal         the same as it was described
//! ├── seen            markers where the tracker saw them
//! ├── errors ×k       an arrow per marker from where it was seen towards where it was predicted
//! └── sweeps, joints  points; spheres, circles and axes
//! ```
//!
//! The poses of the view are one animation, a second each, without anything between them: what was not recorded is not
//! shown. A lost marker has the size zero in its pose. Numbers are 32-bit, as the format wants: 0.1 µm in a meter.
//! Khronos, glTF 2.0 specification, 2021 (ISO/IEC 12113:2022).

mod file;

use crate::view3d::{Axis, Circle, Sphere, View3d, ViewPose, pose_of};
use crate::{ReportError, Scene};
use file::{Color, File, named, narrow};
use gltf_json::Index;
use gltf_json::animation::Property;
use gltf_json::mesh::{Mesh, Mode};
use gltf_json::scene::{Node, UnitQuaternion as Turn};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use serde_json::json;

/// Half of √2: the rotation about x by −90° that makes z up into y up.
const HALF_ROOT: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Length of a frame's drawn axes, m: a hand's breadth on an arm.
const TRIAD_M: f64 = 0.05;

/// Radius of a drawn marker, m.
const MARKER_M: f64 = 0.007;

/// Corners of a drawn circle.
const CORNERS: usize = 48;

/// Poses of the links of one robot, in the order of the view's frames.
type Rows = fn(&ViewPose) -> &Vec<[f64; 7]>;

/// The view as the bytes of a `.glb` file; `scene` gives the provenance. Same input, same bytes.
///
/// # Errors
/// [`ReportError::Json`] when the file would have 4 GB or more.
pub fn glb(scene: &Scene, view: &View3d) -> Result<Vec<u8>, ReportError> {
    let view = view.thinned();
    let mut file = File::default();
    let triad = file.triad();
    let arrow = file.arrow();
    let ball = file.ball();
    let mut branches = Vec::new();
    let first = view.poses.first();
    let robots: [(Color, Rows); 2] = [
        (Color::Calibrated, |pose| &pose.calibrated),
        (Color::Nominal, |pose| &pose.nominal),
    ];
    for (color, rows) in robots {
        if first.is_some_and(|pose| !rows(pose).is_empty()) {
            branches.push(file.robot(&view, color, rows, triad));
        }
    }
    if first.is_some() {
        branches.extend(file.markers(&view, ball, arrow));
    }
    branches.extend(file.sweeps(&view));
    branches.extend(file.joints(&view));
    let frame = match view.frame.as_str() {
        "" => "tracker",
        frame => frame,
    };
    let top = file.node(Node {
        rotation: Some(Turn([-HALF_ROOT, 0.0, 0.0, HALF_ROOT])),
        children: Some(branches),
        ..named(frame)
    });
    let made = &scene.provenance;
    let generator = format!("{} {}", made.tool, made.version).trim().to_owned();
    let about = json!({
        "frame": view.frame,
        "error_magnification": view.magnification,
        "poses": view.poses.iter().map(|pose| &pose.name).collect::<Vec<_>>(),
        "profile": made.profile,
        "robot": scene.robot.name,
    });
    file.finish((&scene.name, generator), &about, top)
}

impl File {
    /// Three axes of a frame, red, green, blue as everywhere.
    fn triad(&mut self) -> Index<Mesh> {
        let colors = [Color::Error, Color::Joint, Color::Calibrated];
        let axis = |k: usize| {
            let mut end = [0.0; 3];
            end[k] = TRIAD_M;
            self.primitive(Mode::Lines, colors[k], &[[0.0; 3], end])
        };
        let primitives = (0..3).map(axis).collect();
        self.mesh_of("frame", primitives)
    }

    /// An arrow of length 1 along z.
    fn arrow(&mut self) -> Index<Mesh> {
        let tip = [0.0, 0.0, 1.0];
        let barb = |x: f64, y: f64| [tip, [x, y, 0.85]];
        let lines = [
            [[0.0; 3], tip],
            barb(0.05, 0.0),
            barb(-0.05, 0.0),
            barb(0.0, 0.05),
            barb(0.0, -0.05),
        ];
        let primitive = self.primitive(Mode::Lines, Color::Error, lines.as_flattened());
        self.mesh_of("arrow", vec![primitive])
    }

    /// An octahedron of radius 1 with indices: a marker.
    fn ball(&mut self) -> Index<Mesh> {
        let corners = [
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ];
        let faces: [u16; 24] = [
            0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5,
        ];
        let mut primitive = self.primitive(Mode::Triangles, Color::Marker, &corners);
        primitive.indices = Some(self.indices(&faces));
        self.mesh_of("marker", vec![primitive])
    }

    /// A line of length 1 along z.
    fn segment(&mut self, color: Color) -> Index<Mesh> {
        let primitive = self.primitive(Mode::Lines, color, &[[0.0; 3], [0.0, 0.0, 1.0]]);
        self.mesh_of(&format!("line of {}", color.name()), vec![primitive])
    }

    /// The links, each under its parent, with a line to each child.
    fn robot(
        &mut self,
        view: &View3d,
        color: Color,
        rows: Rows,
        triad: Index<Mesh>,
    ) -> Index<Node> {
        let all: Vec<&Vec<[f64; 7]>> = view.poses.iter().map(rows).collect();
        let whole: Vec<&Vec<[f64; 7]>> = all.iter().copied().filter(|p| !p.is_empty()).collect();
        // A pose without this robot would shift the others in time: then it stands still.
        let shown = if whole.len() == all.len() {
            &whole[..]
        } else {
            &whole[..1]
        };
        let suffix = if color == Color::Nominal {
            " (nominal)"
        } else {
            ""
        };
        let links = self.links(view.frames.len());
        let line = self.segment(color);
        for (i, frame) in view.frames.iter().enumerate() {
            let relative = |k: usize, parent: Option<usize>| -> Vec<Isometry3<f64>> {
                let of = |rows: &&Vec<[f64; 7]>| match parent {
                    Some(parent) => pose_of(&rows[parent]).inverse() * pose_of(&rows[k]),
                    None => pose_of(&rows[k]),
                };
                shown.iter().map(of).collect()
            };
            let mut children = vec![self.node(Node {
                mesh: Some(triad),
                ..Node::default()
            })];
            // One robot has the shapes: two that differ by less than a millimeter would flicker.
            if color == Color::Calibrated {
                children.extend(self.shape(view, i, &format!("{} shape", frame.name)));
            }
            for k in (0..links.len()).filter(|k| view.frames[*k].parent == Some(i)) {
                children.push(links[k]);
                let to_child = relative(k, Some(i));
                let reach: Vec<_> = to_child.iter().map(|p| p.translation.vector).collect();
                let at = vec![[0.0; 3]; reach.len()];
                let name = format!("{} to {}{suffix}", frame.name, view.frames[k].name);
                children.push(self.aimed(&name, line, &at, &reach));
            }
            let name = format!("{}{suffix}", frame.name);
            self.moving(links[i], name, &relative(i, frame.parent), children);
        }
        let is_root = |i: &usize| view.frames[*i].parent.is_none();
        let roots = (0..links.len()).filter(is_root).map(|i| links[i]);
        self.node(Node {
            children: Some(roots.collect()),
            ..named(color.name())
        })
    }

    /// Nodes to be filled: a parent names its children before they are made.
    fn links(&mut self, count: usize) -> Vec<Index<Node>> {
        (0..count).map(|_| self.node(Node::default())).collect()
    }

    /// The filled shape of a link, where it has one. Without normals, viewers shade each face as flat (§3.7.2.1).
    fn shape(&mut self, view: &View3d, link: usize, name: &str) -> Option<Index<Node>> {
        let of_link = view.solids.iter().filter(|solid| solid.frame == link);
        let corners = of_link.flat_map(|solid| {
            let point = |i: &u32| solid.points[*i as usize];
            solid.faces.iter().flat_map(move |face| {
                let pairs = face.get(1..).unwrap_or_default().windows(2);
                pairs.flat_map(move |pair| [point(&face[0]), point(&pair[0]), point(&pair[1])])
            })
        });
        let corners: Vec<[f64; 3]> = corners.collect();
        let mesh = self.mesh(name, Mode::Triangles, Color::Body, &corners)?;
        Some(self.node(Node {
            mesh: Some(mesh),
            ..named(name)
        }))
    }

    /// Fills the node of a link that moves in its parent.
    fn moving(
        &mut self,
        node: Index<Node>,
        name: String,
        poses: &[Isometry3<f64>],
        children: Vec<Index<Node>>,
    ) {
        let places: Vec<[f64; 3]> = poses.iter().map(|p| p.translation.vector.into()).collect();
        let turns: Vec<[f64; 4]> = poses.iter().map(|p| xyzw(&p.rotation)).collect();
        self.root.nodes[node.value()] = Node {
            translation: Some(places[0].map(narrow)),
            rotation: Some(Turn(turns[0].map(narrow))),
            children: Some(children),
            ..named(name)
        };
        self.animate(node, Property::Translation, &places);
        self.animate(node, Property::Rotation, &turns);
    }

    /// A mesh of length 1 along z, turned and stretched from a place along a vector, pose by pose.
    fn aimed(
        &mut self,
        name: &str,
        mesh: Index<Mesh>,
        from: &[[f64; 3]],
        along: &[Vector3<f64>],
    ) -> Index<Node> {
        // Straight down: any rotation by half a circle.
        let half = UnitQuaternion::new(Vector3::x() * std::f64::consts::PI);
        let turn = |v: &Vector3<f64>| {
            xyzw(&UnitQuaternion::rotation_between(&Vector3::z(), v).unwrap_or(half))
        };
        let turns: Vec<[f64; 4]> = along.iter().map(turn).collect();
        let sizes: Vec<[f64; 3]> = along.iter().map(|v| [v.norm(); 3]).collect();
        let node = self.node(Node {
            mesh: Some(mesh),
            translation: Some(from[0].map(narrow)),
            rotation: Some(Turn(turns[0].map(narrow))),
            scale: Some(sizes[0].map(narrow)),
            ..named(name)
        });
        self.animate(node, Property::Translation, from);
        self.animate(node, Property::Rotation, &turns);
        self.animate(node, Property::Scale, &sizes);
        node
    }

    /// Markers as they were seen, and their errors as arrows. Markers are those of the first pose; a marker keeps its name.
    fn markers(
        &mut self,
        view: &View3d,
        ball: Index<Mesh>,
        arrow: Index<Mesh>,
    ) -> [Index<Node>; 2] {
        let mut names: Vec<&str> = Vec::new();
        for marker in view.poses.iter().flat_map(|pose| &pose.markers) {
            if !names.contains(&marker.name.as_str()) {
                names.push(&marker.name);
            }
        }
        let (mut seen, mut errors) = (Vec::new(), Vec::new());
        for name in names {
            let of = |pose: &ViewPose| {
                let marker = pose.markers.iter().find(|marker| marker.name == name)?;
                let observed = marker.observed?;
                let error = Vector3::from(marker.predicted) - Vector3::from(observed);
                Some((observed, error * view.magnification))
            };
            let track: Vec<Option<([f64; 3], Vector3<f64>)>> = view.poses.iter().map(of).collect();
            let places: Vec<[f64; 3]> = track.iter().map(|t| t.map_or([0.0; 3], |t| t.0)).collect();
            let arrows: Vec<Vector3<f64>> = track
                .iter()
                .map(|t| t.map_or_else(Vector3::zeros, |t| t.1))
                .collect();
            let size = |t: &Option<_>| [if t.is_some() { MARKER_M } else { 0.0 }; 3];
            let sizes: Vec<[f64; 3]> = track.iter().map(size).collect();
            let node = self.node(Node {
                mesh: Some(ball),
                translation: Some(places[0].map(narrow)),
                scale: Some(sizes[0].map(narrow)),
                ..named(name)
            });
            self.animate(node, Property::Translation, &places);
            self.animate(node, Property::Scale, &sizes);
            seen.push(node);
            errors.push(self.aimed(&format!("{name} error"), arrow, &places, &arrows));
        }
        let errors_name = format!("errors ×{}", view.magnification);
        [("seen".to_owned(), seen), (errors_name, errors)].map(|(name, children)| {
            self.node(Node {
                children: Some(children).filter(|c| !c.is_empty()),
                ..named(name)
            })
        })
    }

    /// Meshes that stand still, under one node; `None` where there are none.
    fn still(
        &mut self,
        name: &str,
        (mode, color): (Mode, Color),
        parts: Vec<(String, Vec<[f64; 3]>)>,
    ) -> Option<Index<Node>> {
        let mut children = Vec::new();
        for (part, points) in parts {
            if let Some(mesh) = self.mesh(&part, mode, color, &points) {
                children.push(self.node(Node {
                    mesh: Some(mesh),
                    ..named(part)
                }));
            }
        }
        (!children.is_empty()).then(|| {
            self.node(Node {
                children: Some(children),
                ..named(name)
            })
        })
    }

    /// Points of the sweeps.
    fn sweeps(&mut self, view: &View3d) -> Option<Index<Node>> {
        let clouds = view.clouds.iter();
        let parts = clouds.map(|cloud| (cloud.name.clone(), cloud.points.clone()));
        self.still("sweeps", (Mode::Points, Color::Soft), parts.collect())
    }

    /// Spheres, circles and axes that stand still in the tracker's frame.
    fn joints(&mut self, view: &View3d) -> Option<Index<Node>> {
        let sphere = |s: &Sphere| {
            let normals = [Vector3::x(), Vector3::y(), Vector3::z()];
            let rings = normals.iter().flat_map(|n| ring(&s.center, n, s.radius));
            (format!("sphere of {}", s.name), rings.collect())
        };
        let circle = |c: &Circle| {
            let points = ring(&c.center, &Vector3::from(c.normal), c.radius);
            (format!("circle of {}", c.name), points)
        };
        let fixed = view.axes.iter().filter(|axis| axis.frame.is_none());
        let axis = |a: &Axis| (format!("axis of {}", a.name), ends(a).to_vec());
        let parts = view
            .spheres
            .iter()
            .map(sphere)
            .chain(view.circles.iter().map(circle))
            .chain(fixed.map(axis));
        self.still("joints", (Mode::Lines, Color::Joint), parts.collect())
    }
}

fn xyzw(q: &UnitQuaternion<f64>) -> [f64; 4] {
    [q.i, q.j, q.k, q.w]
}

/// A circle as line segments.
fn ring(center: &[f64; 3], normal: &Vector3<f64>, radius: f64) -> Vec<[f64; 3]> {
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), normal).unwrap_or_default();
    let corner = |i: usize| -> [f64; 3] {
        let (sin, cos) = (i as f64 / CORNERS as f64 * std::f64::consts::TAU).sin_cos();
        (Point3::from(*center) + turn * Vector3::new(cos, sin, 0.0) * radius).into()
    };
    (0..CORNERS)
        .flat_map(|i| [corner(i), corner(i + 1)])
        .collect()
}

fn ends(axis: &Axis) -> [[f64; 3]; 2] {
    let reach = Vector3::from(axis.direction) * axis.half_length;
    [-1.0, 1.0].map(|sign| (Point3::from(axis.point) + reach * sign).into())
}
