//! The view as a binary glTF 2.0 file: any viewer of 3-D files shows the robot, the markers and the errors.
//!
//! ```text
//! tracker (turned: glTF has y up)
//! ├── calibrated      links as nodes, each under its parent, with axes and outlines
//! ├── nominal         the same as it was described
//! ├── seen            markers where the tracker saw them
//! ├── errors ×k       an arrow per marker from where it was seen towards where it was predicted
//! └── sweeps, joints  points; spheres, circles and axes
//! ```
//!
//! The poses of the view are one animation, a second each, without anything between them: what was not recorded is not
//! shown. A lost marker has the size zero in its pose. Numbers are 32-bit, as the format wants: 0.1 µm in a meter.
//! Khronos, glTF 2.0 specification, 2021 (ISO/IEC 12113:2022).

use crate::view3d::{Axis, Circle, Sphere, View3d, ViewPose};
use crate::{ReportError, Scene};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};

/// Half of √2: the turn about x by −90° that makes z up into y up.
const HALF_ROOT: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Length of a frame's drawn axes, m: a hand's breadth on an arm.
const TRIAD_M: f64 = 0.05;

/// Radius of a drawn marker, m.
const MARKER_M: f64 = 0.007;

/// Corners of a drawn circle.
const CORNERS: usize = 48;

/// Colors of [`Color`], linear RGB.
const COLORS: [(&str, [f64; 3]); 6] = [
    ("calibrated", [0.0, 0.168, 0.445]),
    ("nominal", [0.565, 0.109, 0.0]),
    ("marker", [0.271, 0.040, 0.235]),
    ("error", [0.527, 0.0, 0.0]),
    ("joint", [0.0, 0.216, 0.107]),
    ("soft", [0.168, 0.168, 0.168]),
];

#[derive(Clone, Copy)]
enum Color {
    Calibrated,
    Nominal,
    Marker,
    Error,
    Joint,
    Soft,
}

/// Drawing modes of a primitive.
const POINTS: u32 = 0;
const LINES: u32 = 1;
const TRIANGLES: u32 = 4;

/// Component types of an accessor.
const UNSIGNED_SHORT: u32 = 5123;
const FLOAT: u32 = 5126;

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
    for (name, color, rows) in [
        (
            "calibrated",
            Color::Calibrated,
            (|pose| &pose.calibrated) as fn(&ViewPose) -> &Vec<[f64; 7]>,
        ),
        ("nominal", Color::Nominal, |pose| &pose.nominal),
    ] {
        if first.is_some_and(|pose| !rows(pose).is_empty()) {
            branches.push(file.robot(&view, (name, color), rows, triad));
        }
    }
    if first.is_some() {
        branches.extend(file.markers(&view, ball, arrow));
    }
    branches.extend(file.sweeps(&view));
    branches.extend(file.joints(&view));
    let root = file.node(json!({
        "name": if view.frame.is_empty() { "tracker" } else { &view.frame },
        "rotation": [-HALF_ROOT, 0.0, 0.0, HALF_ROOT],
        "children": branches,
    }));
    file.finish(scene, &view, root)
}

/// A glTF file that is being made.
#[derive(Default)]
struct File {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    channels: Vec<Value>,
    samplers: Vec<Value>,
    /// The accessor of the poses' times.
    times: Option<usize>,
}

impl File {
    fn push(list: &mut Vec<Value>, value: Value) -> usize {
        list.push(value);
        list.len() - 1
    }

    fn node(&mut self, node: Value) -> usize {
        Self::push(&mut self.nodes, node)
    }

    fn buffer_view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        // Accessors of floats begin at multiples of four.
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view =
            json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.bytes.extend_from_slice(bytes);
        Self::push(&mut self.views, view)
    }

    /// Floats in rows of N, with the smallest and largest of each column, which positions and times must have.
    fn floats<const N: usize>(&mut self, rows: &[[f64; N]], kind: &str, vertices: bool) -> usize {
        let rows: Vec<[f32; N]> = rows.iter().map(|row| row.map(narrow)).collect();
        let bytes: Vec<u8> = rows
            .iter()
            .flatten()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        /// `ARRAY_BUFFER`.
        const VERTICES: u32 = 34962;
        let view = self.buffer_view(&bytes, vertices.then_some(VERTICES));
        let over = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..N)
                .map(|k| rows.iter().map(|row| row[k]).reduce(pick).unwrap_or(0.0))
                .collect()
        };
        let (min, max) = (over(f32::min), over(f32::max));
        let accessor = json!({"bufferView": view, "componentType": FLOAT, "count": rows.len(), "type": kind, "min": min, "max": max});
        Self::push(&mut self.accessors, accessor)
    }

    fn primitive(&mut self, mode: u32, color: Color, points: &[[f64; 3]]) -> Value {
        let positions = self.floats(points, "VEC3", true);
        json!({"attributes": {"POSITION": positions}, "mode": mode, "material": color as usize})
    }

    /// `None` where there is nothing to draw: an accessor must not be empty.
    fn mesh(&mut self, name: &str, mode: u32, color: Color, points: &[[f64; 3]]) -> Option<usize> {
        if points.is_empty() {
            return None;
        }
        let primitive = self.primitive(mode, color, points);
        let mesh = json!({"name": name, "primitives": [primitive]});
        Some(Self::push(&mut self.meshes, mesh))
    }

    /// Three axes of a frame, red, green, blue as everywhere.
    fn triad(&mut self) -> usize {
        let colors = [Color::Error, Color::Joint, Color::Calibrated];
        let primitives: Vec<Value> = (0..3)
            .map(|k| {
                let mut end = [0.0; 3];
                end[k] = TRIAD_M;
                self.primitive(LINES, colors[k], &[[0.0; 3], end])
            })
            .collect();
        Self::push(
            &mut self.meshes,
            json!({"name": "frame", "primitives": primitives}),
        )
    }

    /// An arrow of length 1 along z.
    fn arrow(&mut self) -> usize {
        let tip = [0.0, 0.0, 1.0];
        let barb = |x: f64, y: f64| [tip, [x, y, 0.85]];
        let barbs = [
            barb(0.05, 0.0),
            barb(-0.05, 0.0),
            barb(0.0, 0.05),
            barb(0.0, -0.05),
        ];
        let points: Vec<[f64; 3]> = [[[0.0; 3], tip]]
            .into_iter()
            .chain(barbs)
            .flatten()
            .collect();
        let primitive = self.primitive(LINES, Color::Error, &points);
        Self::push(
            &mut self.meshes,
            json!({"name": "arrow", "primitives": [primitive]}),
        )
    }

    /// An octahedron of radius 1 with indices: a marker.
    fn ball(&mut self) -> usize {
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
        let mut primitive = self.primitive(TRIANGLES, Color::Marker, &corners);
        let bytes: Vec<u8> = faces.iter().flat_map(|i| i.to_le_bytes()).collect();
        /// `ELEMENT_ARRAY_BUFFER`.
        const INDICES: u32 = 34963;
        let view = self.buffer_view(&bytes, Some(INDICES));
        let accessor = json!({"bufferView": view, "componentType": UNSIGNED_SHORT, "count": faces.len(), "type": "SCALAR"});
        primitive["indices"] = Self::push(&mut self.accessors, accessor).into();
        Self::push(
            &mut self.meshes,
            json!({"name": "marker", "primitives": [primitive]}),
        )
    }

    /// One value a pose: the node jumps from one to the next.
    fn animate<const N: usize>(
        &mut self,
        node: usize,
        path: &str,
        kind: &str,
        values: &[[f64; N]],
    ) {
        // What does not move needs no motion.
        if values.windows(2).all(|pair| pair[0] == pair[1]) {
            return;
        }
        let times = match self.times {
            Some(times) => times,
            None => {
                let seconds: Vec<[f64; 1]> = (0..values.len()).map(|i| [i as f64]).collect();
                let times = self.floats(&seconds, "SCALAR", false);
                self.times = Some(times);
                times
            }
        };
        let output = self.floats(values, kind, false);
        let sampler = json!({"input": times, "output": output, "interpolation": "STEP"});
        let sampler = Self::push(&mut self.samplers, sampler);
        self.channels
            .push(json!({"sampler": sampler, "target": {"node": node, "path": path}}));
    }

    /// The links, each under its parent, with a line to each child.
    fn robot(
        &mut self,
        view: &View3d,
        (name, color): (&str, Color),
        rows: fn(&ViewPose) -> &Vec<[f64; 7]>,
        triad: usize,
    ) -> usize {
        let poses: Vec<&Vec<[f64; 7]>> = view.poses.iter().map(rows).collect();
        let whole: Vec<&Vec<[f64; 7]>> = poses.iter().copied().filter(|p| !p.is_empty()).collect();
        // A pose without this robot would shift the others in time: then it stands still.
        let shown = if whole.len() == poses.len() {
            &whole[..]
        } else {
            &whole[..1]
        };
        let suffix = match color {
            Color::Nominal => " (nominal)",
            _ => "",
        };
        let count = view.frames.len();
        let first = self.nodes.len();
        self.nodes.resize(first + count, Value::Null);
        let line = self.segment(color);
        for (i, frame) in view.frames.iter().enumerate() {
            let relative = |rows: &Vec<[f64; 7]>, k: usize, parent: Option<usize>| match parent {
                Some(parent) => isometry(&rows[parent]).inverse() * isometry(&rows[k]),
                None => isometry(&rows[k]),
            };
            let mut children = vec![self.node(json!({"mesh": triad}))];
            let lines: Vec<[f64; 3]> = view
                .outlines
                .iter()
                .filter(|outline| outline.frame == i)
                .flat_map(|outline| &outline.lines)
                .flat_map(|[ax, ay, az, bx, by, bz]| [[*ax, *ay, *az], [*bx, *by, *bz]])
                .collect();
            let outline = format!("{} outline{suffix}", frame.name);
            if let Some(mesh) = self.mesh(&outline, LINES, color, &lines) {
                children.push(self.node(json!({"name": outline, "mesh": mesh})));
            }
            for k in (0..count).filter(|k| view.frames[*k].parent == Some(i)) {
                children.push(first + k);
                let reach: Vec<Vector3<f64>> = shown
                    .iter()
                    .map(|rows| relative(rows, k, Some(i)).translation.vector)
                    .collect();
                let at = vec![[0.0; 3]; reach.len()];
                let name = format!("{} to {}{suffix}", frame.name, view.frames[k].name);
                children.push(self.aimed(&name, line, &at, &reach));
            }
            let poses: Vec<Isometry3<f64>> = shown
                .iter()
                .map(|rows| relative(rows, i, frame.parent))
                .collect();
            let places: Vec<[f64; 3]> = poses.iter().map(|p| p.translation.vector.into()).collect();
            let turns: Vec<[f64; 4]> = poses.iter().map(|p| xyzw(&p.rotation)).collect();
            self.nodes[first + i] = json!({
                "name": format!("{}{suffix}", frame.name),
                "translation": places[0],
                "rotation": turns[0],
                "children": children,
            });
            self.animate(first + i, "translation", "VEC3", &places);
            self.animate(first + i, "rotation", "VEC4", &turns);
        }
        let roots: Vec<usize> = (0..count)
            .filter(|i| view.frames[*i].parent.is_none())
            .map(|i| first + i)
            .collect();
        self.node(json!({"name": name, "children": roots}))
    }

    /// A mesh of length 1 along z, turned and stretched from a place along a vector, pose by pose.
    fn aimed(
        &mut self,
        name: &str,
        mesh: usize,
        from: &[[f64; 3]],
        along: &[Vector3<f64>],
    ) -> usize {
        let turns: Vec<[f64; 4]> =
            along
                .iter()
                .map(|v| {
                    let turn = UnitQuaternion::rotation_between(&Vector3::z(), v);
                    // Straight down: any turn by half a circle.
                    xyzw(&turn.unwrap_or_else(|| {
                        UnitQuaternion::new(Vector3::x() * std::f64::consts::PI)
                    }))
                })
                .collect();
        let sizes: Vec<[f64; 3]> = along.iter().map(|v| [v.norm(); 3]).collect();
        let node = self.node(json!({
            "name": name,
            "mesh": mesh,
            "translation": from[0],
            "rotation": turns[0],
            "scale": sizes[0],
        }));
        self.animate(node, "translation", "VEC3", from);
        self.animate(node, "rotation", "VEC4", &turns);
        self.animate(node, "scale", "VEC3", &sizes);
        node
    }

    /// Markers as they were seen, and their errors as arrows. Markers are those of the first pose; a marker keeps its name.
    fn markers(&mut self, view: &View3d, ball: usize, arrow: usize) -> [usize; 2] {
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
            let sizes: Vec<[f64; 3]> = track
                .iter()
                .map(|t| [if t.is_some() { MARKER_M } else { 0.0 }; 3])
                .collect();
            let node = self.node(
                json!({"name": name, "mesh": ball, "translation": places[0], "scale": sizes[0]}),
            );
            self.animate(node, "translation", "VEC3", &places);
            self.animate(node, "scale", "VEC3", &sizes);
            seen.push(node);
            errors.push(self.aimed(&format!("{name} error"), arrow, &places, &arrows));
        }
        let branch = |name: String, children: Vec<usize>| {
            if children.is_empty() {
                json!({ "name": name })
            } else {
                json!({"name": name, "children": children})
            }
        };
        [
            self.node(branch("seen".into(), seen)),
            self.node(branch(format!("errors ×{}", view.magnification), errors)),
        ]
    }

    /// Points of the sweeps.
    fn sweeps(&mut self, view: &View3d) -> Option<usize> {
        let children: Vec<usize> = view
            .clouds
            .iter()
            .filter_map(|cloud| {
                let mesh = self.mesh(&cloud.name, POINTS, Color::Soft, &cloud.points)?;
                Some(self.node(json!({"name": cloud.name, "mesh": mesh})))
            })
            .collect();
        (!children.is_empty()).then(|| self.node(json!({"name": "sweeps", "children": children})))
    }

    /// Spheres, circles and axes that stand still in the tracker's frame.
    fn joints(&mut self, view: &View3d) -> Option<usize> {
        let mut children = Vec::new();
        let mut put = |name: String, points: Vec<[f64; 3]>| {
            if let Some(mesh) = self.mesh(&name, LINES, Color::Joint, &points) {
                children.push(self.node(json!({"name": name, "mesh": mesh})));
            }
        };
        for Sphere {
            name,
            center,
            radius,
            ..
        } in &view.spheres
        {
            let rings = [Vector3::x(), Vector3::y(), Vector3::z()]
                .iter()
                .flat_map(|normal| ring(center, normal, *radius))
                .collect();
            put(format!("sphere of {name}"), rings);
        }
        for Circle {
            name,
            center,
            normal,
            radius,
        } in &view.circles
        {
            let points = ring(center, &Vector3::from(*normal), *radius);
            put(format!("circle of {name}"), points);
        }
        for axis in view.axes.iter().filter(|axis| axis.frame.is_none()) {
            put(format!("axis of {}", axis.name), ends(axis).to_vec());
        }
        (!children.is_empty()).then(|| self.node(json!({"name": "joints", "children": children})))
    }

    /// A line of length 1 along z.
    fn segment(&mut self, color: Color) -> usize {
        let primitive = self.primitive(LINES, color, &[[0.0; 3], [0.0, 0.0, 1.0]]);
        let name = format!("line of {}", COLORS[color as usize].0);
        Self::push(
            &mut self.meshes,
            json!({"name": name, "primitives": [primitive]}),
        )
    }

    /// JSON and binary chunk behind the twelve bytes of the header (§4.4 of the specification).
    fn finish(mut self, scene: &Scene, view: &View3d, root: usize) -> Result<Vec<u8>, ReportError> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let materials: Vec<Value> = COLORS
            .iter()
            .map(|(name, [r, g, b])| {
                json!({
                    "name": name,
                    "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0},
                    "extensions": {"KHR_materials_unlit": {}},
                })
            })
            .collect();
        let mut document = json!({
            "asset": {
                "version": "2.0",
                "generator": format!("{} {}", scene.provenance.tool, scene.provenance.version).trim(),
            },
            "extensionsUsed": ["KHR_materials_unlit"],
            "scene": 0,
            "scenes": [{
                "name": scene.name,
                "nodes": [root],
                "extras": {
                    "frame": view.frame,
                    "error_magnification": view.magnification,
                    "poses": view.poses.iter().map(|pose| &pose.name).collect::<Vec<_>>(),
                    "profile": scene.provenance.profile,
                    "robot": scene.robot.name,
                },
            }],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.bytes.len()}],
        });
        if !self.channels.is_empty() {
            document["animations"] =
                json!([{"name": "poses", "channels": self.channels, "samplers": self.samplers}]);
        }
        let mut json = document.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + json.len() + 8 + self.bytes.len();
        let length = |n: usize| {
            u32::try_from(n)
                .map(u32::to_le_bytes)
                .map_err(|_| ReportError::Json(format!("a glTF file of {total} bytes is too long")))
        };
        let mut out = Vec::with_capacity(total);
        out.extend_from_slice(b"glTF");
        out.extend_from_slice(&2u32.to_le_bytes());
        out.extend_from_slice(&length(total)?);
        out.extend_from_slice(&length(json.len())?);
        out.extend_from_slice(b"JSON");
        out.extend_from_slice(&json);
        out.extend_from_slice(&length(self.bytes.len())?);
        out.extend_from_slice(b"BIN\0");
        out.extend_from_slice(&self.bytes);
        Ok(out)
    }
}

fn isometry(row: &[f64; 7]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(row[6], row[3], row[4], row[5]));
    Isometry3::from_parts(Translation3::new(row[0], row[1], row[2]), rotation)
}

fn xyzw(q: &UnitQuaternion<f64>) -> [f64; 4] {
    [q.i, q.j, q.k, q.w]
}

/// What no 32-bit number holds becomes the largest that there is.
fn narrow(x: f64) -> f32 {
    x.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
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
