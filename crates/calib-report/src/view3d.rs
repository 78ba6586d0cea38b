//! The 3-D view of `report.html` as data: all coordinates in the tracker's (or world's) frame, m and rad.

mod solid;
mod still;

pub use solid::Solid;

use crate::ReportError;
use crate::json::{rounded_to, to_value};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::Serialize;

/// What the 3-D view shows.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct View3d {
    /// The frame that all coordinates are in.
    pub frame: String,
    /// Initial magnification of the residual arrows and uncertainties.
    pub magnification: f64,
    /// Frames of the robot; lines to the parents are the links.
    pub frames: Vec<ViewFrame>,
    /// Shapes of the links; empty when only frames are drawn.
    pub solids: Vec<Solid>,
    /// Poses to step through, the validation poses first.
    pub poses: Vec<ViewPose>,
    /// Points of the sweeps.
    pub clouds: Vec<Cloud>,
    /// Spheres of centers of rotation.
    pub spheres: Vec<Sphere>,
    /// Circles of axes of rotation.
    pub circles: Vec<Circle>,
    /// Axes.
    pub axes: Vec<Axis>,
    /// Nothing is measured yet: what a marker's place says is whether it will be in sight.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub planned: bool,
}

/// A frame of the robot.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ViewFrame {
    /// Its name.
    pub name: String,
    /// Index of the parent in [`View3d::frames`]; a line is drawn to it.
    pub parent: Option<usize>,
}

/// The robot in one pose.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ViewPose {
    /// Its label.
    pub name: String,
    /// Its errors: "errors: gripM 0.31 mm".
    pub text: String,
    /// x, y, z, qx, qy, qz, qw of every frame with the delivered robot; empty when it is not shown.
    pub nominal: Vec<[f64; 7]>,
    /// The same with the calibrated robot.
    pub calibrated: Vec<[f64; 7]>,
    /// Observed markers or bodies.
    pub markers: Vec<ViewMarker>,
    /// Joint values by name, rad or m; the page does not show them.
    #[serde(skip)]
    pub joints: Vec<(String, f64)>,
}

/// A marker in one pose.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ViewMarker {
    /// Its name.
    pub name: String,
    /// Measured position; `None` when the tracker lost it.
    pub observed: Option<[f64; 3]>,
    /// Position predicted by the calibrated robot.
    pub predicted: [f64; 3],
}

impl ViewMarker {
    /// predicted − observed, m; `None` when the tracker lost it.
    #[must_use]
    pub fn residual_m(&self) -> Option<[f64; 3]> {
        let observed = self.observed?;
        Some(std::array::from_fn(|i| self.predicted[i] - observed[i]))
    }
}

/// Points of one marker or body over a sweep.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Cloud {
    /// The sweep and the marker.
    pub name: String,
    /// Places.
    pub points: Vec<[f64; 3]>,
}

/// A sphere around a center of rotation.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Sphere {
    /// The joint.
    pub name: String,
    /// Center.
    pub center: [f64; 3],
    /// m.
    pub radius: f64,
    /// σ of the center, m; `None` when it is unknown.
    pub sigma: Option<f64>,
}

/// A circle around an axis of rotation.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Circle {
    /// The joint.
    pub name: String,
    /// Center.
    pub center: [f64; 3],
    /// Unit normal.
    pub normal: [f64; 3],
    /// m.
    pub radius: f64,
}

/// An axis of rotation.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Axis {
    /// The joint.
    pub name: String,
    /// A point on it.
    pub point: [f64; 3],
    /// Unit direction.
    pub direction: [f64; 3],
    /// Half of the length that is drawn, m.
    pub half_length: f64,
    /// σ of the point across the axis, m.
    pub sigma_point: Option<f64>,
    /// σ of the direction, rad.
    pub sigma_direction: Option<f64>,
    /// The frame of point and direction, an index into [`View3d::frames`]: the axis moves with the calibrated robot.
    /// `None`: fixed in [`View3d::frame`].
    pub frame: Option<usize>,
}

impl Axis {
    /// The end of the drawn axis on the side of `sign`.
    fn end(&self, sign: f64) -> [f64; 3] {
        (Point3::from(self.point) + Vector3::from(self.direction) * (sign * self.half_length))
            .into()
    }
}

/// Digits of a coordinate in the page: 10 µm in a meter, less than a pixel.
const DIGITS: usize = 5;

/// Points of all clouds together in the page: 20 bytes each, a third of a megabyte.
const CLOUD_POINTS: usize = 15_000;

/// Faces of all links together in the page: 30 bytes each, a third of a megabyte.
const FACES: usize = 12_000;

/// Poses in the page.
const POSES: usize = 200;

/// Frames of all poses together in the page: 110 bytes each for both robots, a megabyte.
const POSE_FRAMES: usize = 9_000;

/// The row of [`ViewPose::calibrated`] for a frame.
#[must_use]
pub fn pose_row(world_from_frame: &Isometry3<f64>) -> [f64; 7] {
    let (t, q) = (
        world_from_frame.translation.vector,
        world_from_frame.rotation.coords,
    );
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
}

impl View3d {
    /// The same at a size that suits a page: every n-th point of the clouds, every n-th pose, without non-finite values and indices of missing frames.
    #[must_use]
    pub fn thinned(&self) -> Self {
        let mut view = self.clone();
        let total: usize = view.clouds.iter().map(|cloud| cloud.points.len()).sum();
        let step = total.div_ceil(CLOUD_POINTS).max(1);
        for cloud in &mut view.clouds {
            cloud.points = cloud
                .points
                .iter()
                .filter(|p| finite(p))
                .step_by(step)
                .copied()
                .collect();
        }
        let frames = view.frames.len();
        for frame in &mut view.frames {
            frame.parent = frame.parent.filter(|parent| *parent < frames);
        }
        view.solids.retain(|solid| {
            let corners = || solid.faces.iter().flatten();
            solid.frame < frames
                && solid.points.iter().all(finite)
                && corners().all(|i| (*i as usize) < solid.points.len())
        });
        view.solids = fewer(&view.solids, FACES);
        let fits = |rows: &Vec<[f64; 7]>| rows.len() == frames && rows.iter().all(finite);
        let most = POSES.min(POSE_FRAMES / frames.max(1)).max(1);
        let step = view.poses.len().div_ceil(most).max(1);
        view.poses = view
            .poses
            .into_iter()
            .step_by(step)
            .filter(|pose| fits(&pose.calibrated))
            .collect();
        for pose in &mut view.poses {
            if !fits(&pose.nominal) {
                pose.nominal.clear();
            }
            pose.markers
                .retain(|marker| finite(&marker.predicted) && marker.observed.iter().all(finite));
        }
        view.spheres
            .retain(|sphere| finite(&sphere.center) && sphere.radius.is_finite());
        view.circles.retain(|circle| {
            finite(&circle.center) && finite(&circle.normal) && circle.radius.is_finite()
        });
        view.axes.retain(|axis| {
            axis.frame.is_none_or(|frame| frame < frames)
                && finite(&axis.point)
                && finite(&axis.direction)
                && axis.half_length.is_finite()
        });
        if !(view.magnification.is_finite() && view.magnification >= 1.0) {
            view.magnification = 1.0;
        }
        view
    }

    /// The same with this pose first; as it is where no pose has the name.
    #[must_use]
    pub fn beginning_with(mut self, pose: &str) -> Self {
        if let Some(i) = self.poses.iter().position(|p| p.name == pose) {
            let first = self.poses.remove(i);
            self.poses.insert(0, first);
        }
        self
    }

    /// JSON for a `<script type="application/json">` element: one line, no `<`.
    ///
    /// # Errors
    /// [`ReportError::Json`] when it has no JSON form.
    pub(crate) fn embedded(&self) -> Result<String, ReportError> {
        let mut value = rounded_to(to_value(self)?, DIGITS);
        for (i, pose) in self.poses.iter().enumerate() {
            for (k, marker) in pose.markers.iter().enumerate() {
                // In digits of its own: 10 µm are nothing in a place, and much in a residual.
                let residual = marker.residual_m().map(|r| r.map(|x| x * 1e3));
                let residual = rounded_to(to_value(&residual)?, DIGITS);
                value["poses"][i]["markers"][k]["residual_mm"] = residual;
            }
        }
        Ok(value.to_string().replace('<', "\\u003c"))
    }
}

/// Shapes with at most about so many faces together, each its share.
fn fewer(solids: &[Solid], most: usize) -> Vec<Solid> {
    let total: usize = solids.iter().map(|solid| solid.faces.len()).sum();
    let share = |solid: &Solid| {
        let most = if total <= most {
            total
        } else {
            solid.faces.len() * most / total
        };
        solid.thinned(most.max(20))
    };
    solids.iter().map(share).collect()
}

pub(crate) fn pose_of(row: &[f64; 7]) -> Isometry3<f64> {
    let rotation =
        UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(row[6], row[3], row[4], row[5]));
    Isometry3::from_parts(Translation3::new(row[0], row[1], row[2]), rotation)
}

fn origin(row: &[f64; 7]) -> [f64; 3] {
    [row[0], row[1], row[2]]
}

fn finite<const N: usize>(numbers: &[f64; N]) -> bool {
    numbers.iter().all(|x| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_drawn_is_omitted() {
        let view = View3d {
            magnification: f64::NAN,
            frames: vec![ViewFrame {
                name: "a".into(),
                parent: Some(7),
            }],
            poses: vec![
                ViewPose {
                    calibrated: vec![[f64::NAN; 7]],
                    ..ViewPose::default()
                },
                ViewPose {
                    calibrated: vec![pose_row(&Isometry3::identity())],
                    nominal: vec![],
                    ..ViewPose::default()
                },
            ],
            clouds: vec![Cloud {
                name: "c".into(),
                points: vec![[0.0; 3]; 40_000],
            }],
            spheres: vec![Sphere {
                radius: f64::INFINITY,
                ..Sphere::default()
            }],
            ..View3d::default()
        };
        let thinned = view.thinned();
        assert_eq!(
            (
                thinned.frames[0].parent,
                thinned.poses.len(),
                thinned.spheres.len(),
                thinned.magnification
            ),
            (None, 1, 0, 1.0)
        );
        assert!(thinned.clouds[0].points.len() <= CLOUD_POINTS);
        assert!(!thinned.still().contains("NaN"));
    }

    #[test]
    fn an_empty_view_still_gives_an_image() {
        let text = View3d::default().thinned().still();
        roxmltree::Document::parse(&text).expect("well-formed");
    }

    #[test]
    fn embedded_data_cannot_end_its_script() {
        let view = View3d {
            frame: "</script>".into(),
            ..View3d::default()
        };
        let text = view.embedded().expect("JSON");
        assert!(!text.contains('<'));
        assert!(serde_json::from_str::<serde_json::Value>(&text).is_ok());
    }
}
