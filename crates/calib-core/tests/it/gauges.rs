//! Constructed chains whose unobservable directions are known beforehand: how many, which family, which
//! parameters, and never a parameter called identified that is not.

use crate::common::{Chain, Free, Link, axis, pose, prismatic, revolute, rng, six_r};
use calib_core::{
    Chart, EffectKind, Gauge, Measurement, MeasurementKind, NoiseKind, ParameterClass, PoseNoise,
    Settings, Solution, measurement, solve,
};
use nalgebra::{Isometry3, Point3};

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

fn along(a: [f64; 3]) -> nalgebra::Unit<nalgebra::Vector3<f64>> {
    axis(a[0], a[1], a[2])
}

/// A serial arm with offsets of 0.3 m along the link axis and the given joint axes.
fn arm(axes: &[[f64; 3]]) -> Vec<Link> {
    axes.iter()
        .enumerate()
        .map(|(i, a)| revolute(pose(0.05 * i as f64, 0.02, 0.3, 0.0, 0.0, 0.0), along(*a)))
        .collect()
}

fn coincident(axes: &[[f64; 3]]) -> Vec<Link> {
    axes.iter()
        .map(|a| revolute(Isometry3::identity(), along(*a)))
        .collect()
}

struct Expected {
    nullity: usize,
    /// (family, parameters that must take part), in any order.
    directions: Vec<(Gauge, Vec<&'static str>)>,
}

struct Case {
    name: &'static str,
    links: Vec<Link>,
    free: Free,
    markers: Vec<Point3<f64>>,
    /// Joints held at 0.
    still: Vec<usize>,
    pose_head: bool,
    expected: Expected,
}

impl Case {
    fn new(name: &'static str, links: Vec<Link>) -> Self {
        let n = links.len();
        Self {
            name,
            links,
            free: Free::nothing(n),
            markers: crate::common::square_markers(),
            still: Vec::new(),
            pose_head: false,
            expected: Expected {
                nullity: 0,
                directions: Vec::new(),
            },
        }
    }

    fn world(mut self) -> Self {
        self.free.world = Chart::full();
        self
    }

    fn world_chart(mut self, chart: Chart) -> Self {
        self.free.world = chart;
        self
    }

    fn mount(mut self) -> Self {
        self.free.mount = Chart::full();
        self
    }

    fn mount_chart(mut self, chart: Chart) -> Self {
        self.free.mount = chart;
        self
    }

    fn origin(mut self, i: usize, chart: Chart) -> Self {
        self.free.origins[i - 1] = chart;
        self
    }

    fn origins(mut self, chart: &Chart) -> Self {
        for o in &mut self.free.origins {
            *o = chart.clone();
        }
        self
    }

    fn offset(mut self, i: usize) -> Self {
        self.free.offsets[i - 1] = true;
        self
    }

    fn offsets(mut self) -> Self {
        self.free.offsets.fill(true);
        self
    }

    fn markers(mut self, m: Vec<Point3<f64>>) -> Self {
        self.markers = m;
        self
    }

    fn unknown_points(mut self) -> Self {
        self.free.points = true;
        self
    }

    fn still(mut self, joints: &[usize]) -> Self {
        self.still = joints.to_vec();
        self
    }

    fn poses(mut self) -> Self {
        self.pose_head = true;
        self
    }

    fn null(mut self, n: usize) -> Self {
        self.expected.nullity = n;
        self
    }

    fn says(mut self, gauge: Gauge, parameters: &[&'static str]) -> Self {
        self.expected.directions.push((gauge, parameters.to_vec()));
        self
    }

    fn solve(&self) -> Solution {
        let mut r = rng(42);
        let mut chain = Chain::nominal(self.links.clone()).posed(&mut r, 25, 1.3);
        chain.markers = self.markers.clone();
        for row in &mut chain.q {
            for &s in &self.still {
                row[s - 1] = 0.0;
            }
        }
        let mut h = chain.problem(&self.free, 1e-4);
        if self.pose_head {
            chain.observe_poses(&mut r, &mut h, 1e-3, 1e-4, 0.0);
        } else {
            chain.observe(&mut r, &mut h, 1e-4, 0.0);
        }
        solve(&h.problem, &Settings::plain()).unwrap()
    }

    fn check(&self) {
        let s = self.solve();
        let o = &s.observability;
        let name = |t: &calib_core::Term| s.parameters[t.parameter.index()].name.as_str();
        let names = |d: &calib_core::Direction| d.terms.iter().map(name).collect::<Vec<_>>();
        let directions: Vec<_> = o.null.iter().map(|d| (d.gauge, names(d))).collect();
        assert_eq!(
            o.nullity(),
            self.expected.nullity,
            "{}: {directions:#?}\n{:?}",
            self.name,
            s.information.singular_values()
        );
        let mut left: Vec<&calib_core::Direction> = o.null.iter().collect();
        for (gauge, parameters) in &self.expected.directions {
            let found = left
                .iter()
                .position(|d| d.gauge == *gauge && parameters.iter().all(|p| names(d).contains(p)));
            let Some(found) = found else {
                panic!(
                    "{}: no {gauge:?} with {parameters:?} among {:#?}",
                    self.name,
                    left.iter().map(|d| (d.gauge, names(d))).collect::<Vec<_>>()
                );
            };
            left.remove(found);
        }
        for d in &o.null {
            assert_eq!(d.sigma_ratio, None);
            for t in &d.terms {
                let p = &s.parameters[t.parameter.index()];
                assert_eq!(p.id, t.parameter);
                assert_eq!(
                    p.class,
                    ParameterClass::NotObservable,
                    "{}: {} is called {:?}",
                    self.name,
                    p.name,
                    p.class
                );
                assert!(
                    p.sigma.is_none(),
                    "{}: {} has a sigma without prior",
                    self.name,
                    p.name
                );
            }
        }
    }
}

fn one_marker() -> Vec<Point3<f64>> {
    vec![Point3::new(0.05, 0.02, 0.03)]
}

fn marker_at_origin() -> Vec<Point3<f64>> {
    vec![Point3::origin()]
}

fn two_markers() -> Vec<Point3<f64>> {
    vec![Point3::new(0.05, 0.0, 0.0), Point3::new(-0.05, 0.0, 0.0)]
}

fn wrist() -> Vec<Link> {
    // Three axes through one point.
    coincident(&[Z, Y, Z])
}

fn cases() -> Vec<Case> {
    use Gauge::*;
    let full = Chart::full();
    let c = Case::new;
    vec![
        // Complete, minimal problems: nothing to complain about.
        c("frames and inner offsets", six_r())
            .world()
            .mount()
            .offset(2)
            .offset(3)
            .offset(4)
            .offset(5),
        c("known frames, all offsets", six_r()).offsets(),
        c("pose measurement, frames and inner offsets", six_r())
            .poses()
            .world()
            .mount()
            .offset(2)
            .offset(3),
        c("two skew axes, frames", arm(&[Z, X])).world().mount(),
        c("three markers, unknown layout, mount held", six_r())
            .world()
            .unknown_points(),
        c("origins as axis lines", six_r())
            .origin(2, Chart::axis_line(&along(Y)))
            .origin(4, Chart::axis_line(&axis(1.0, 0.1, 0.0))),
        // World against base.
        c("first offset against the tracker's frame", six_r())
            .world()
            .mount()
            .offset(1)
            .null(1)
            .says(WorldAgainstBase, &["j1.offset", "tracker_from_base.rz"]),
        c("first origin against the tracker's frame", six_r())
            .world()
            .origin(1, full.clone())
            .null(6)
            .says(WorldAgainstBase, &["j1.origin.z", "tracker_from_base.z"]),
        c("first origin's height only", six_r())
            .world()
            .origin(1, Chart::slide(&along(Z)))
            .null(1)
            .says(WorldAgainstBase, &["j1.origin.z", "tracker_from_base.z"]),
        c("first origin's turn only", six_r())
            .world()
            .origin(1, Chart::turn(&along(Z)))
            .null(1)
            .says(WorldAgainstBase, &["j1.origin.rz", "tracker_from_base.rz"]),
        c("position of the first origin", six_r())
            .world()
            .origin(1, Chart::position())
            .null(3),
        // Offset against own origin.
        c("offset and turn of the own origin", six_r())
            .offset(3)
            .origin(3, Chart::turn(&axis(0.0, 1.0, 0.2)))
            .null(1)
            .says(OffsetAgainstOwnOrigin, &["j3.offset"]),
        c("offset and whole own origin", six_r())
            .offset(5)
            .origin(5, full.clone())
            .null(1)
            .says(OffsetAgainstOwnOrigin, &["j5.offset", "j5.origin.rz"]),
        c("offset and own orientation", six_r())
            .offset(6)
            .origin(6, Chart::orientation())
            .null(1)
            .says(OffsetAgainstOwnOrigin, &["j6.offset", "j6.origin.ry"]),
        c("three offsets and their own origins", six_r())
            .offset(2)
            .offset(5)
            .offset(6)
            .origin(2, Chart::orientation())
            .origin(5, Chart::orientation())
            .origin(6, Chart::orientation())
            .null(3)
            .says(OffsetAgainstOwnOrigin, &["j2.offset"])
            .says(OffsetAgainstOwnOrigin, &["j5.offset"])
            .says(OffsetAgainstOwnOrigin, &["j6.offset"]),
        // Offset against what follows.
        c("last offset against the mount", six_r())
            .world()
            .mount()
            .offset(6)
            .null(1)
            .says(OffsetAgainstNeighbor, &["j6.offset", "body_mount.ry"]),
        c("last offset against the mount, poses", six_r())
            .poses()
            .mount()
            .offset(6)
            .null(1)
            .says(OffsetAgainstNeighbor, &["j6.offset"]),
        c("offset against the next origin", six_r())
            .offset(5)
            .origin(6, full.clone())
            .null(1)
            .says(OffsetAgainstNeighbor, &["j5.offset", "j6.origin.rz"]),
        c("both ends' offsets", six_r())
            .world()
            .mount()
            .offsets()
            .null(2)
            .says(WorldAgainstBase, &["j1.offset"])
            .says(OffsetAgainstNeighbor, &["j6.offset"]),
        // Slide and turn along an axis.
        c("slide along the axis into the next", arm(&[Z, X, Z]))
            .origin(1, Chart::position())
            .origin(2, Chart::position())
            .null(1)
            .says(TranslationAlongAxis, &["j1.origin.z", "j2.origin.z"]),
        c("slide and turn of full neighbors", arm(&[Z, X, Y]))
            .origin(1, full.clone())
            .origin(2, full.clone())
            .null(2)
            .says(RotationAboutAxis, &["j1.origin.rz", "j2.origin.rz"])
            .says(TranslationAlongAxis, &["j1.origin.z", "j2.origin.z"]),
        c("a skew axis slides too", arm(&[[0.6, 0.0, 0.8], X, Y]))
            .origin(1, Chart::position())
            .origin(2, Chart::position())
            .null(1)
            .says(
                TranslationAlongAxis,
                &["j1.origin.x", "j1.origin.z", "j2.origin.x", "j2.origin.z"],
            ),
        c("axis lines do not slide", arm(&[Z, X, Y]))
            .origin(1, Chart::axis_line(&along(Z)))
            .origin(2, Chart::axis_line(&along(X))),
        // Parallel axes.
        c("two parallel axes, positions", arm(&[Y, Y, X]))
            .origin(1, Chart::position())
            .origin(2, Chart::position())
            .null(1)
            .says(ParallelAxes, &["j1.origin.y", "j2.origin.y"]),
        c("three parallel axes, shifts along them", arm(&[Y, Y, Y, X]))
            .origin(1, Chart::slide(&along(Y)))
            .origin(2, Chart::slide(&along(Y)))
            .origin(3, Chart::slide(&along(Y)))
            .null(2)
            .says(ParallelAxes, &["j1.origin.y"])
            .says(ParallelAxes, &["j2.origin.y"]),
        c("parallel axes not next to each other", arm(&[Y, Y, Y, X]))
            .origin(1, Chart::slide(&along(Y)))
            .origin(3, Chart::slide(&along(Y)))
            .null(1)
            .says(ParallelAxes, &["j1.origin.y", "j3.origin.y"]),
        c("parallel shift through a still joint", arm(&[Y, X, Y, Z]))
            .still(&[2])
            .origin(1, Chart::slide(&along(Y)))
            .origin(3, Chart::slide(&along(Y)))
            .null(1)
            .says(ParallelAxes, &["j1.origin.y", "j3.origin.y"]),
        c("crossed axes separate the shifts", arm(&[Y, X, Y, Z]))
            .origin(1, Chart::slide(&along(Y)))
            .origin(3, Chart::slide(&along(Y))),
        // Torso parallel to the first arm joint.
        c("torso parallel to the first arm joint", arm(&[Z, Z, Y, X]))
            .world()
            .mount()
            .origin(2, Chart::slide(&along(Z)))
            .null(1)
            .says(WorldAgainstBase, &["j2.origin.z", "tracker_from_base.z"]),
        c(
            "torso turn and arm offset are distinguished",
            arm(&[Z, Z, Y, X]),
        )
        .world()
        .mount()
        .offset(2),
        // Collinear 3-5-7.
        c("joints 3, 5 on one axis with 4 still", arm_357())
            .still(&[4])
            .offset(3)
            .offset(5)
            .null(1)
            .says(CollinearAxes, &["j3.offset", "j5.offset"]),
        c("joints 3, 5, 7 on one axis with 4, 6 still", arm_357())
            .still(&[4, 6])
            .offset(3)
            .offset(5)
            .offset(7)
            .null(2)
            .says(CollinearAxes, &["j3.offset", "j5.offset"])
            .says(CollinearAxes, &["j7.offset"]),
        c("with 4 and 6 moving all three are seen", arm_357())
            .offset(3)
            .offset(5)
            .offset(7),
        // Point-only tools.
        c("one marker, unknown mount", six_r())
            .mount()
            .markers(one_marker())
            .null(3)
            .says(PointOnlyTool, &["body_mount.rx"])
            .says(PointOnlyTool, &["body_mount.ry"])
            .says(PointOnlyTool, &["body_mount.rz"]),
        c("one marker at the frame's origin", six_r())
            .mount()
            .markers(marker_at_origin())
            .null(3)
            .says(PointOnlyTool, &["body_mount.rx"])
            .says(PointOnlyTool, &["body_mount.ry"])
            .says(PointOnlyTool, &["body_mount.rz"]),
        c("one marker, position of the mount", six_r())
            .mount_chart(Chart::position())
            .markers(one_marker()),
        c("two markers, unknown mount", six_r())
            .mount()
            .markers(two_markers())
            .null(1)
            .says(PointOnlyTool, &["body_mount.rx"]),
        c("wrist with one marker on the last axis", wrist())
            .mount_chart(Chart::position())
            .offset(3)
            .markers(vec![Point3::origin()])
            .null(1)
            .says(OffsetAgainstNeighbor, &["j3.offset"]),
        c("wrist with one marker, last offset alone", wrist_on_axis())
            .offset(3)
            .markers(marker_at_origin())
            .null(1)
            .says(NotMeasured, &["j3.offset"]),
        c("three markers make the wrist whole", wrist()).mount_chart(Chart::position()),
        // Markers against mount.
        c("unknown layout and unknown mount", six_r())
            .mount()
            .unknown_points()
            .null(6)
            .says(MarkersAgainstMount, &["body_mount.x"]),
        c("one unknown marker and its mount's position", six_r())
            .mount_chart(Chart::position())
            .unknown_points()
            .markers(one_marker())
            .null(3)
            .says(MarkersAgainstMount, &["body_mount.x", "m1.x"]),
        c("unknown layout against the last origin", six_r())
            .unknown_points()
            .origin(6, Chart::slide(&along(Y)))
            .null(1)
            .says(ToolAgainstLastOrigin, &["j6.origin.y", "m1.x"]),
        c("unknown layout and last offset", six_r())
            .unknown_points()
            .offset(6)
            .null(1)
            .says(OffsetAgainstNeighbor, &["j6.offset"]),
        // Tool body against last origin.
        c("mount and last origin", six_r())
            .mount()
            .origin(6, full.clone())
            .null(2)
            .says(ToolAgainstLastOrigin, &["j6.origin.y"])
            .says(ToolAgainstLastOrigin, &["j6.origin.ry"]),
        c("mount and last origin, positions", six_r())
            .mount_chart(Chart::position())
            .origin(6, Chart::position())
            .null(1)
            .says(ToolAgainstLastOrigin, &["j6.origin.y"]),
        // Too few axes.
        c("one joint between two unknown frames", arm(&[Z]))
            .world()
            .mount()
            .null(2)
            .says(WorldAgainstTool, &["tracker_from_base.rz", "body_mount.rz"])
            .says(WorldAgainstTool, &["tracker_from_base.z", "body_mount.z"]),
        c("planar arm", arm(&[Z, Z, Z]))
            .world()
            .mount()
            .null(1)
            .says(WorldAgainstTool, &["tracker_from_base.z", "body_mount.z"]),
        c("planar arm with inner offset", arm(&[Z, Z, Z]))
            .world()
            .mount()
            .offset(2)
            .null(1)
            .says(WorldAgainstTool, &["tracker_from_base.z", "body_mount.z"]),
        c(
            "a slide between two unknown frames",
            vec![prismatic(pose(0.1, 0.0, 0.2, 0.0, 0.0, 0.0), along(X))],
        )
        .world()
        .mount()
        .null(4)
        .says(WorldAgainstTool, &["tracker_from_base.rx"]),
        c("gantry of three slides", gantry())
            .world()
            .mount()
            .null(3),
        c("prismatic offset against the mount", gantry())
            .mount_chart(Chart::position())
            .offset(3)
            .null(1)
            .says(OffsetAgainstNeighbor, &["j3.offset", "body_mount.z"]),
        c("prismatic offsets along the tracker's frame", gantry())
            .world_chart(Chart::position())
            .offset(1)
            .null(1)
            .says(WorldAgainstBase, &["j1.offset"]),
        // Still joints.
        c("still joints are contracted", six_r())
            .still(&[3, 4])
            .offsets()
            .world()
            .mount()
            .null(2),
        c("all origins of a UR-like arm", ur_like())
            .world()
            .mount()
            .origins(&full)
            .offsets()
            .null(24),
        c("all origins of a six-axis arm", six_r())
            .world()
            .mount()
            .origins(&full)
            .offsets()
            .null(24),
        c("every origin, ends known", six_r())
            .origins(&full)
            .null(10),
    ]
}

fn arm_357() -> Vec<Link> {
    // S-R-S arm: at q4 = q6 = 0 the axes 3, 5, 7 coincide (all Z, on one line).
    let z = |h: f64| pose(0.0, 0.0, h, 0.0, 0.0, 0.0);
    vec![
        revolute(z(0.3), along(Z)),
        revolute(z(0.1), along(Y)),
        revolute(z(0.2), along(Z)),
        revolute(z(0.2), along(Y)),
        revolute(z(0.2), along(Z)),
        revolute(z(0.2), along(Y)),
        revolute(z(0.1), along(Z)),
    ]
}

fn wrist_on_axis() -> Vec<Link> {
    let mut links = coincident(&[Z, Y]);
    // The last axis passes through the marker: mount at the nominal puts the body's origin off it, so
    // the joint's origin is placed where the mount ends.
    links.push(revolute(Isometry3::identity(), along(MOUNT_DIRECTION)));
    links
}

/// Direction of the mount's translation (0.03, −0.02, 0.08) in [`Chain::nominal`].
const MOUNT_DIRECTION: [f64; 3] = [0.03, -0.02, 0.08];

fn gantry() -> Vec<Link> {
    let o = pose(0.1, 0.0, 0.2, 0.0, 0.0, 0.0);
    vec![
        prismatic(o, along(X)),
        prismatic(o, along(Y)),
        prismatic(o, along(Z)),
    ]
}

fn ur_like() -> Vec<Link> {
    vec![
        revolute(pose(0.0, 0.0, 0.128, 0.0, 0.0, 0.0), along(Z)),
        revolute(pose(0.0, 0.22, 0.0, 0.0, 1.57, 0.0), along(Y)),
        revolute(pose(0.0, -0.17, 0.612, 0.0, 0.0, 0.0), along(Y)),
        revolute(pose(0.0, 0.0, 0.572, 0.0, 1.57, 0.0), along(Y)),
        revolute(pose(0.0, 0.115, 0.0, 0.0, 0.0, 0.0), along(Z)),
        revolute(pose(0.0, 0.0, 0.116, 0.0, 0.0, 0.0), along(Y)),
    ]
}

#[test]
fn constructed_gauges_have_the_right_dimension_and_words() {
    let cases = cases();
    assert!(cases.len() >= 50, "{}", cases.len());
    let mut failures = Vec::new();
    for case in &cases {
        if let Err(e) = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| case.check())) {
            let text = e
                .downcast_ref::<String>()
                .cloned()
                .unwrap_or_else(|| "?".to_owned());
            failures.push(format!("{}: {text}", case.name));
        }
    }
    assert!(
        failures.is_empty(),
        "{} cases fail:\n{}",
        failures.len(),
        failures.join("\n")
    );
}

#[test]
fn a_table_and_a_contact_offset_are_one_number() {
    // A stylus of unknown length touches a table of unknown height.
    let mut r = rng(5);
    let chain = Chain::nominal(six_r()).posed(&mut r, 20, 0.6);
    let mut free = Free::nothing(6);
    free.mount = Chart::none();
    let mut h = chain.problem(&free, 1e-4);
    let p = &mut h.problem;
    let table = p.frame("table");
    let surface = p.frame("surface");
    p.known(
        "tracker_from_table",
        h.tracker,
        table,
        pose(0.0, 0.0, -1.0, 0.0, 0.0, 0.0),
    );
    p.unknown(
        "table_height",
        table,
        surface,
        Isometry3::identity(),
        Chart::slide(&along(Z)),
    );
    let group = p.noise_group("contact", NoiseKind::Position, 1e-4, false);
    // The tool always points straight down at contact, so its length only adds to the height.
    let tcp = p.frame("tcp");
    let poses = (0..20)
        .map(|s| {
            let at = chain.tracker_from_body(&chain.q[s], &[]).translation;
            Some(Isometry3::from_parts(
                at,
                nalgebra::UnitQuaternion::identity(),
            ))
        })
        .collect();
    let flange = p.frame("flange");
    p.measured("flange_seen", h.tracker, flange, poses, None);
    p.unknown(
        "stylus",
        flange,
        tcp,
        pose(0.0, 0.0, -0.1, 0.0, 0.0, 0.0),
        Chart::slide(&along(Z)),
    );
    let tip = p.known_point("tip", tcp, Point3::origin());
    let seen = (0..20)
        .map(|s| {
            (
                s,
                chain.tracker_from_body(&chain.q[s], &[]).translation.z - 0.1 + 1.0,
            )
        })
        .collect();
    p.add_measurement(Measurement {
        name: "contact".into(),
        from: surface,
        to: tcp,
        path: None,
        kind: MeasurementKind::Plane(measurement::Plane {
            point: tip,
            normal: along(Z),
            noise: group,
            observations: seen,
        }),
    });
    let s = solve(&h.problem, &Settings::plain()).unwrap();
    assert_eq!(s.observability.nullity(), 1);
    let d = &s.observability.null[0];
    assert_eq!(d.gauge, Gauge::TableAgainstContact);
    let name = |t: &calib_core::Term| s.parameters[t.parameter.index()].name.as_str();
    let names: Vec<&str> = d.terms.iter().map(name).collect();
    assert!(names.contains(&"table_height.z") && names.contains(&"stylus.z"));
}

#[test]
fn a_gain_and_a_size_are_one_number_when_no_length_is_known() {
    // One slide of unknown gain seen along a line of unknown scale: the distance measurement sees gain·q only.
    let mut p = calib_core::Problem::new(10);
    let base = p.frame("base");
    let link = p.frame("link");
    let tip_frame = p.frame("tip");
    let q: Vec<f64> = (0..10).map(|i| 0.1 * f64::from(i)).collect();
    let j = p.joint(
        "slide",
        base,
        link,
        calib_core::Axis::Prismatic(along(X)),
        q.clone(),
    );
    p.free_effect(j, EffectKind::Gain, None);
    p.free_effect_with(j, EffectKind::Coupling, q.clone(), None);
    p.known("tip", link, tip_frame, Isometry3::identity());
    let o = p.noise_group("o", NoiseKind::Orientation, 1e-3, false);
    let t = p.noise_group("t", NoiseKind::Position, 1e-4, false);
    let seen = q
        .iter()
        .enumerate()
        .map(|(sample, q)| calib_core::PoseObservation {
            sample,
            pose: Isometry3::translation(1.02 * q, 0.0, 0.0),
            inverse: false,
        })
        .collect();
    p.poses(
        "tip",
        base,
        tip_frame,
        PoseNoise::Split {
            orientation: o,
            position: t,
        },
        seen,
    );
    let s = solve(&p, &Settings::plain()).unwrap();
    assert_eq!(s.observability.nullity(), 1);
    assert_eq!(s.observability.null[0].gauge, Gauge::Scale);
}

#[test]
fn joints_that_never_moved_are_listed_and_held() {
    let s = Case::new("still", six_r())
        .still(&[2, 5])
        .world()
        .mount()
        .offsets()
        .origins(&Chart::full())
        .solve();
    let edges = s.model.problem().edges();
    let unmoved = s.observability.unmoved.iter();
    let names: Vec<&str> = unmoved.map(|e| edges[e.index()].name.as_str()).collect();
    assert_eq!(names, ["j2", "j5"]);
    for p in &s.parameters {
        if p.joint.as_deref() == Some("j2") || p.joint.as_deref() == Some("j5") {
            assert_eq!(p.value, p.nominal);
            assert_eq!(p.class, ParameterClass::NotObservable);
            assert!(p.sigma.is_none());
        }
    }
}

#[test]
fn predictions_do_not_depend_on_the_gauge() {
    // Three ways to fix the 24 gauges of a six-axis arm: same tool, same axis distances.
    let mut r = rng(7);
    let all = {
        let mut f = Free::everything(6);
        f.prior = None;
        f
    };
    let chain = Chain::nominal(six_r())
        .posed(&mut r, 30, 1.3)
        .deviate(&mut r, &all, 0.005, 0.003);
    let lines = {
        // Each origin a line across its axis; frames and mount whole; offsets held.
        let mut f = all.clone();
        f.offsets = vec![false; 6];
        f
    };
    let shifted = {
        let mut f = all.clone();
        f.world = Chart::none();
        f.offsets = vec![true; 6];
        f
    };
    let mut found = Vec::new();
    for free in [&all, &lines, &shifted] {
        let mut h = chain.problem(free, 1e-4);
        chain.observe(&mut rng(70), &mut h, 1e-4, 0.0);
        let s = solve(&h.problem, &Settings::plain()).unwrap();
        assert!(s.status.is_converged());
        let tips: Vec<_> = (0..5)
            .map(|k| {
                let mut at = calib_core::Configuration::zero();
                for (i, j) in h.joints.iter().enumerate() {
                    at = at.with(*j, 0.3 * f64::from(k) - 0.1 * i as f64);
                }
                let t = s
                    .predict_point(h.tracker, h.body, &Point3::new(0.0, 0.05, 0.1), &at)
                    .unwrap();
                assert!(t.estimable);
                (t.position, t.covariance.unwrap())
            })
            .collect();
        found.push((tips, s.chi2));
    }
    for other in &found[1..] {
        for (a, b) in found[0].0.iter().zip(&other.0) {
            assert!((a.0 - b.0).norm() < 1e-9, "{}", (a.0 - b.0).norm());
            assert!((a.1 - b.1).amax() < 1e-6 * a.1.amax());
        }
        assert!((found[0].1 - other.1).abs() < 1e-6 * found[0].1);
    }
}

#[test]
fn priors_do_not_hide_a_gauge() {
    let mut free = Free::everything(6);
    free.prior = Some((0.02, 0.01));
    let mut r = rng(3);
    let chain = Chain::nominal(six_r()).posed(&mut r, 30, 1.3);
    let mut h = chain.problem(&free, 1e-4);
    chain.observe(&mut r, &mut h, 1e-4, 0.0);
    let s = solve(&h.problem, &Settings::plain()).unwrap();
    assert_eq!(s.observability.nullity(), 24);
    let offset = s.parameters.iter().find(|p| p.name == "j3.offset").unwrap();
    assert_eq!(offset.class, ParameterClass::NotObservable);
    // With a prior it has a σ, and the share of the data is what the sum of the two leaves.
    assert!(offset.sigma.is_some() && offset.data_share < 0.6);
}
