//! The first pose as an image that needs no script, for paper and for readers without JavaScript.

use super::{Cloud, View3d, ViewPose, origin, pose_of};
use crate::number;
use crate::svg::Body;
use nalgebra::{Point3, Rotation3, UnitQuaternion, Vector3};

/// Faces of all links: 60 bytes each, half of them seen.
const STILL_FACES: usize = 2_500;

/// Brightnesses of a face: the classes `f0` (dark) … `f7` of the page.
const SHADES: usize = 8;

/// From where the light comes to the viewer's eye: from the left, from above.
const LIGHT: [f64; 3] = [-0.4, 0.5, 1.0];

/// x to the right, y up, z to the viewer: from the front right, slightly above.
fn camera() -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::x_axis(), -65f64.to_radians())
        * Rotation3::from_axis_angle(&Vector3::z_axis(), 40f64.to_radians())
}

impl View3d {
    /// The first pose as an image that needs no script: parallel projection from the front right, slightly above.
    pub(crate) fn still(&self) -> String {
        const SIZE: [f64; 2] = [640.0, 400.0];
        let camera = camera();
        let flat = |p: &[f64; 3]| {
            let p = camera * Point3::from(*p);
            [p.x, -p.y]
        };
        let robot = self.poses.first().into_iter().flat_map(|pose| {
            let seen = pose.markers.iter().filter_map(|marker| marker.observed);
            let shapes = self.corners(pose);
            pose.calibrated.iter().map(origin).chain(seen).chain(shapes)
        });
        // Sweeps and centers would make the robot small.
        let bare = self.poses.is_empty();
        let clouds: &[Cloud] = if bare { &self.clouds } else { &[] };
        let swept = clouds.iter().flat_map(|cloud| cloud.points.iter().copied());
        let still = || self.axes.iter().filter(|axis| bare && axis.frame.is_none());
        let axes = still().flat_map(|axis| [axis.end(-1.0), axis.end(1.0)]);
        let everything = robot.chain(swept).chain(axes);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for place in everything.map(|p| flat(&p)) {
            for k in 0..2 {
                low[k] = low[k].min(place[k]);
                high[k] = high[k].max(place[k]);
            }
        }
        if low[0] > high[0] {
            (low, high) = ([-1.0; 2], [1.0; 2]);
        }
        let scale = (0..2)
            .map(|k| 0.86 * SIZE[k] / (high[k] - low[k]).max(1e-6))
            .fold(f64::INFINITY, f64::min);
        let place = |p: &[f64; 3]| {
            let at = flat(p);
            [0, 1].map(|k| 0.5 * SIZE[k] + scale * (at[k] - 0.5 * (low[k] + high[k])))
        };
        let mut body = Body(String::new());
        for cloud in clouds {
            // The static image shows an impression of the sweep, not every point.
            for point in cloud
                .points
                .iter()
                .step_by(cloud.points.len().div_ceil(200).max(1))
            {
                body.circle("dot", place(point), 1.2);
            }
        }
        for sphere in self.spheres.iter().filter(|_| bare) {
            body.circle("thin", place(&sphere.center), sphere.radius * scale);
        }
        for circle in self.circles.iter().filter(|_| bare) {
            let turn =
                UnitQuaternion::rotation_between(&Vector3::z(), &Vector3::from(circle.normal))
                    .unwrap_or_default();
            let around = (0..=48).map(|i| {
                let (sin, cos) = (f64::from(i) / 48.0 * std::f64::consts::TAU).sin_cos();
                place(
                    &(Point3::from(circle.center)
                        + turn * Vector3::new(cos, sin, 0.0) * circle.radius)
                        .into(),
                )
            });
            body.path("thin", &around.collect::<Vec<_>>());
        }
        for axis in still() {
            body.line("line s2", place(&axis.end(-1.0)), place(&axis.end(1.0)));
        }
        if let Some(pose) = self.poses.first() {
            self.draw_pose(&mut body, pose, &place);
        }
        let [left, bottom] = [16.0, SIZE[1] - 16.0];
        let bar = round_length(90.0 / scale);
        body.line("axis", [left, bottom], [left + bar * scale, bottom]);
        body.text(
            "tick",
            left,
            bottom - 6.0,
            &number::plain(bar, crate::Unit::Meter),
        );
        format!(
            "<svg role=\"img\" viewBox=\"0 0 {} {}\" aria-label=\"The robot in the pose with the largest error: calibrated solid, nominal dashed, markers as dots, errors as magnified lines\">{}</svg>",
            SIZE[0], SIZE[1], body.0
        )
    }

    /// The robot in a pose: shapes, links as lines, markers with their errors.
    fn draw_pose(&self, body: &mut Body, pose: &ViewPose, place: &dyn Fn(&[f64; 3]) -> [f64; 2]) {
        self.draw_solids(body, pose, place);
        for (class, rows) in [
            (
                ["line thick s0", "line s0"][usize::from(!self.solids.is_empty())],
                &pose.calibrated,
            ),
            ("line dashed s1", &pose.nominal),
        ] {
            for (row, frame) in rows.iter().zip(&self.frames) {
                if let Some(parent) = frame.parent.and_then(|parent| rows.get(parent)) {
                    body.line(class, place(&origin(parent)), place(&origin(row)));
                }
            }
        }
        for marker in &pose.markers {
            let Some(observed) = marker.observed else {
                continue;
            };
            body.circle("mark s3", place(&observed), 3.0);
            let k = self.magnification;
            let end = [0, 1, 2].map(|i| observed[i] + k * (marker.predicted[i] - observed[i]));
            body.line("line error", place(&observed), place(&end));
        }
    }

    /// The corners of all shapes in a pose.
    fn corners(&self, pose: &ViewPose) -> impl Iterator<Item = [f64; 3]> {
        let shown = self.solids.iter();
        let shown = shown.filter_map(|solid| Some((solid, pose.calibrated.get(solid.frame)?)));
        shown.flat_map(|(solid, row)| {
            let world_from_frame = pose_of(row);
            let moved = move |p: &[f64; 3]| (world_from_frame * Point3::from(*p)).into();
            solid.points.iter().map(moved)
        })
    }

    /// The faces that look to the viewer, the farthest first, each as bright as its side to the light.
    fn draw_solids(&self, body: &mut Body, pose: &ViewPose, place: &dyn Fn(&[f64; 3]) -> [f64; 2]) {
        let (camera, light) = (camera(), Vector3::from(LIGHT).normalize());
        let mut shown = Vec::new();
        for solid in super::fewer(&self.solids, STILL_FACES) {
            let Some(row) = pose.calibrated.get(solid.frame) else {
                continue;
            };
            let world_from_frame = pose_of(row);
            let world = |i: &u32| world_from_frame * Point3::from(solid.points[*i as usize]);
            for face in &solid.faces {
                let corners: Vec<Point3<f64>> = face.iter().map(world).collect();
                let [a, b, c, ..] = corners[..] else { continue };
                let normal = camera * (b - a).cross(&(c - a));
                if normal.z <= 0.0 {
                    continue;
                }
                let depth = |p: &Point3<f64>| (camera * p).z;
                let depth = corners.iter().map(depth).sum::<f64>() / corners.len() as f64;
                let bright = light.dot(&normal.normalize()).max(0.0);
                let level = ((bright * SHADES as f64) as usize).min(SHADES - 1);
                let flat: Vec<[f64; 2]> = corners.iter().map(|p| place(&(*p).into())).collect();
                shown.push((depth, level, flat));
            }
        }
        shown.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, level, corners) in &shown {
            body.path(&format!("f{level}"), corners);
        }
    }
}

/// The largest of 1, 2, 5 × 10ⁿ m that is not above a length.
fn round_length(m: f64) -> f64 {
    let power = 10f64.powf(m.max(1e-6).log10().floor());
    let digit = [5.0, 2.0].into_iter().find(|d| d * power <= m);
    digit.unwrap_or(1.0) * power
}
