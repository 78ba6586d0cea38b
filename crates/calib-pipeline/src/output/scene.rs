//! The calibrated world for a situation model.

use std::collections::BTreeMap;

use calib_core::{Configuration, FrameId, Target};
use calib_profile::{Contact, ContactBase, Touched};
use calib_report::scene::{
    Provenance, SceneBody, SceneFrame, SceneJoint, SceneMarker, SceneRobot, SceneTip, SceneTouched,
    SceneVerdict, TouchedShape,
};
use calib_report::{Input, Report, Scene, Status};
use calib_urdf::{JointId, RobotModel};
use nalgebra::{Isometry3, Matrix6, Point3};

use crate::formulate::formulation::MlFit;
use crate::formulate::found::Found;
use crate::formulate::kinematics::Calibration;
use crate::formulate::solved::Solved;
use crate::output::model_file::{fitted_range, mimic, motion, outward};
use crate::output::points::{body_frame, point_frames};
use crate::prepare::inputs::{Digest, Inputs};
use crate::prepare::named;
use crate::prepare::tracks::BodyTrack;

/// The calibrated world: tracker, robot root, bodies, origins, touched things, and links at the zero position.
#[must_use]
pub fn scene(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    solved: &Solved,
    report: &Report,
) -> Scene {
    let (robot, fit) = (&solved.robot, solved.fit.as_ref());
    let profile = &inputs.robot.profile;
    let model = robot.urdf_model();
    let root = model.link(model.root()).name.clone();
    let world = World { inputs, robot, fit };
    let mut frames = vec![
        world.tracker(),
        world.base(&root, solved.root_covariance.as_ref()),
    ];
    frames.extend(world.link_frames(&model));
    frames.extend(world.body_frames(&model));
    frames.extend(point_frames(inputs, robot, &model));
    frames.extend(world.place_frames(&model));
    frames.extend(origin_frames(inputs, robot, &model, &solved.found));
    Scene {
        name: inputs.robot.file.clone(),
        verdict: Some(SceneVerdict::of(report)),
        robot: SceneRobot {
            name: profile.robot.clone(),
            urdf: profile.outputs.urdf.clone(),
            base: root,
            joints: Vec::new(),
            has_masses: inputs.robot.model.every_link_has_mass(),
        },
        frames,
        joints: world.joints(&model),
        bodies: scene_bodies(inputs, tracks, robot, &model),
        tips: world.tips(&model),
        touched: world.touched(&model),
        objects: Vec::new(),
        provenance: provenance(inputs),
        ..Scene::default()
    }
}

/// What the scene is made of.
#[derive(Debug, Clone, Copy)]
struct World<'a> {
    inputs: &'a Inputs,
    robot: &'a Calibration,
    fit: Option<&'a MlFit>,
}

/// What a fit knows of one frame in another: covariance in [ω; v] of the frame, and the unit twists that nothing tells.
type KnownPose = (Option<Matrix6<f64>>, Vec<[f64; 6]>);

impl World<'_> {
    /// The frame that everything is seen from: where nothing is tracked, it only stands for the place of the robot.
    fn tracker(&self) -> SceneFrame {
        let profile = &self.inputs.robot.profile;
        let status = match profile.bodies.is_empty() {
            true => Status::Assumed,
            false => Status::Measured,
        };
        SceneFrame::root(profile.tracker.frame.clone(), status)
    }

    /// The robot's root in it.
    fn base(&self, root: &str, of_closed_form: Option<&Matrix6<f64>>) -> SceneFrame {
        let Self { inputs, robot, .. } = *self;
        let profile = &inputs.robot.profile;
        let own = self.fit.and_then(|fit| {
            let root = fit.formulation.links[inputs.robot.model.root().index()]?;
            self.known(fit.formulation.tracker, root)
        });
        let (covariance, unobservable) = own.unwrap_or_default();
        let covariance = covariance.as_ref().or(of_closed_form);
        let status = match covariance.is_none() && profile.bodies.is_empty() {
            true => Status::Assumed,
            false => Status::Calibrated,
        };
        SceneFrame::new(
            root,
            profile.tracker.frame.clone(),
            &robot.tracker_from_root,
            covariance,
            status,
        )
        .with_known(covariance, covariance, unobservable)
    }

    /// What the fit knows of `to` in `from` at position 0.
    fn known(&self, from: FrameId, to: FrameId) -> Option<KnownPose> {
        let solution = &self.fit?.solution;
        let pose = solution.relative_pose(from, to, &Configuration::zero());
        let pose = pose.ok()?;
        let covariance = pose.covariance.filter(|c| c.iter().any(|x| *x != 0.0));
        let twists = pose.unobservable.iter();
        Some((covariance, twists.map(|t| t.0.into()).collect()))
    }

    /// The same by what the frames are of.
    fn known_between(&self, parent: FrameOf<'_>, child: FrameOf<'_>) -> KnownPose {
        let of = |frame: FrameOf<'_>| {
            let formulation = &self.fit?.formulation;
            match frame {
                FrameOf::Link(index) => formulation.links[index],
                FrameOf::Body(name) => formulation.bodies.get(name).copied(),
                FrameOf::Tracker => Some(formulation.tracker),
                FrameOf::Place(name) => {
                    let edge = formulation.contacts.get(name)?;
                    Some(formulation.problem.edges()[edge.index()].child)
                }
            }
        };
        let frames = of(parent).zip(of(child));
        let known = frames.and_then(|(parent, child)| self.known(parent, child));
        known.unwrap_or_default()
    }

    /// The links, each after its parent; at zero a child link stands where its joint's origin is.
    fn link_frames(&self, model: &RobotModel) -> Vec<SceneFrame> {
        let nominal = &self.inputs.robot.model;
        let frame = |id: JointId| {
            let joint = model.joint(id);
            let same = joint.parent_link_from_joint == nominal.joint(id).parent_link_from_joint;
            let status = match same {
                true => Status::Assumed,
                false => Status::Calibrated,
            };
            let link = |link: calib_urdf::LinkId| FrameOf::Link(link.index());
            let (covariance, unobservable) =
                self.known_between(link(joint.parent), link(joint.child));
            let (in_root, _) = self.known_between(FrameOf::Tracker, link(joint.child));
            let frame = SceneFrame::new(
                model.link(joint.child).name.clone(),
                model.link(joint.parent).name.clone(),
                &joint.parent_link_from_joint,
                None,
                status,
            );
            frame
                .with_known(covariance.as_ref(), in_root.as_ref(), unobservable)
                .in_urdf()
        };
        outward(model).into_iter().map(frame).collect()
    }

    /// The joints, each after the one that carries it.
    fn joints(&self, model: &RobotModel) -> Vec<SceneJoint> {
        let joint = |id: JointId| {
            let joint = model.joint(id);
            SceneJoint {
                name: joint.name.clone(),
                motion: motion(joint),
                parent: model.link(joint.parent).name.clone(),
                child: model.link(joint.child).name.clone(),
                axis: joint.kind.axis().map(|axis| axis.into_inner().into()),
                limits: joint.limits.range().map(|(low, high)| [low, high]),
                fitted_range: fitted_range(self.inputs, id),
                mimic: mimic(model, joint),
                has_effects: !self.robot.effects[id.index()].fits_into_urdf(),
            }
        };
        outward(model).into_iter().map(joint).collect()
    }

    /// The bodies on their links.
    fn body_frames(&self, model: &RobotModel) -> Vec<SceneFrame> {
        let frame = |(name, mount): (&String, &Isometry3<f64>)| {
            let body = &self.inputs.robot.profile.bodies[name];
            let status = match body.mount.is_some() {
                true => Status::Assumed,
                false => Status::Calibrated,
            };
            let link = FrameOf::Link(body.link.index());
            let (covariance, unobservable) = self.known_between(link, FrameOf::Body(name));
            let (in_root, _) = self.known_between(FrameOf::Tracker, FrameOf::Body(name));
            SceneFrame::new(
                body_frame(model, name),
                model.link(body.link).name.clone(),
                mount,
                None,
                status,
            )
            .with_known(covariance.as_ref(), in_root.as_ref(), unobservable)
        };
        self.robot.mounts.iter().map(frame).collect()
    }

    /// The touched things on what carries them.
    fn place_frames(&self, model: &RobotModel) -> Vec<SceneFrame> {
        let profile = &self.inputs.robot.profile;
        let frame = |(name, contact): (&String, &Contact)| {
            let (parent, base) = match contact.on {
                ContactBase::Tracker => (profile.tracker.frame.clone(), FrameOf::Tracker),
                ContactBase::Link(link) => {
                    (model.link(link).name.clone(), FrameOf::Link(link.index()))
                }
            };
            let (covariance, unobservable) = self.known_between(base, FrameOf::Place(name));
            let (in_root, _) = self.known_between(FrameOf::Tracker, FrameOf::Place(name));
            let status = match covariance.is_some() {
                true => Status::Calibrated,
                false => Status::Assumed,
            };
            let place = self.robot.places.get(name);
            SceneFrame::new(
                place_frame(name),
                parent,
                place.unwrap_or(&contact.base_from_place),
                None,
                status,
            )
            .with_known(covariance.as_ref(), in_root.as_ref(), unobservable)
        };
        profile.contacts.iter().map(frame).collect()
    }

    /// What was touched.
    fn touched(&self, model: &RobotModel) -> Vec<SceneTouched> {
        let thing = |(name, contact): (&String, &Contact)| {
            let (shape, radius_m) = match contact.touched {
                Touched::Plane => (TouchedShape::Plane, None),
                Touched::Line => (TouchedShape::Line, None),
                Touched::Point => (TouchedShape::Point, None),
                Touched::Distance(radius) => (TouchedShape::Sphere, Some(radius)),
                Touched::Cylinder(radius) => (TouchedShape::Cylinder, Some(radius)),
                Touched::Listed | Touched::Unknown => (TouchedShape::Points, None),
            };
            let spots = self.robot.spots.get(name).into_iter().flatten();
            SceneTouched {
                name: name.clone(),
                frame: place_frame(name),
                tip: body_frame(model, &contact.point),
                shape,
                radius_m,
                spots_m: spots.map(|(s, at)| (s.clone(), at.coords.into())).collect(),
            }
        };
        let contacts = self.inputs.robot.profile.contacts.iter();
        contacts.map(thing).collect()
    }

    /// The points of the profile.
    fn tips(&self, model: &RobotModel) -> Vec<SceneTip> {
        let tip = |(name, tip): (&String, &calib_profile::Tip)| {
            let known = self.fit.filter(|_| tip.sigma.is_some()).and_then(|fit| {
                let point = *fit.formulation.contact_points.get(name)?;
                let link = fit.formulation.links[tip.link.index()]?;
                let target = Target::Point(point);
                let known = fit
                    .solution
                    .known_point(link, target, &Configuration::zero());
                known.ok()
            });
            let covariance = known.as_ref().and_then(|known| known.covariance);
            let rows = |c: nalgebra::Matrix3<f64>| {
                std::array::from_fn(|i| std::array::from_fn(|j| c[(i, j)]))
            };
            let at = self.robot.contact_points.get(name).copied();
            SceneTip {
                name: body_frame(model, name),
                link: model.link(tip.link).name.clone(),
                xyz_m: at.unwrap_or(tip.at).coords.into(),
                covariance: covariance.map(rows),
                observable: known.is_some_and(|known| known.estimable),
                status: match tip.sigma.is_some() {
                    true => Status::Calibrated,
                    false => Status::Assumed,
                },
            }
        };
        self.inputs.robot.profile.points.iter().map(tip).collect()
    }
}

/// A frame of the fit.
#[derive(Debug, Clone, Copy)]
enum FrameOf<'a> {
    Link(usize),
    Body(&'a str),
    Tracker,
    Place(&'a str),
}

/// Name of a touched thing's frame in the scene: no link and no body is called so.
fn place_frame(contact: &str) -> String {
    format!("{contact}_place")
}

/// The origins that the profile asks for, in their bodies.
fn origin_frames(
    inputs: &Inputs,
    robot: &Calibration,
    model: &RobotModel,
    found: &[Found],
) -> Vec<SceneFrame> {
    let origins = &inputs.robot.profile.origins;
    let asked = |f: &&Found| origins.contains_key(&f.child) && robot.mounts.contains_key(&f.parent);
    let frame = |f: &Found| {
        SceneFrame::new(
            format!("{}_origin", f.child),
            body_frame(model, &f.parent),
            &f.pose,
            f.covariance.as_ref(),
            f.status,
        )
    };
    found.iter().filter(asked).map(frame).collect()
}

/// The bodies with their markers.
fn scene_bodies(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    robot: &Calibration,
    model: &RobotModel,
) -> Vec<SceneBody> {
    let markers = |name: &String| {
        let template = tracks[name].template.iter();
        let named = template.flat_map(|t| t.names.iter().zip(&t.points));
        let marker = |(name, point): (&String, &Point3<f64>)| SceneMarker {
            name: name.clone(),
            xyz_m: point.coords.into(),
        };
        named.map(marker).collect()
    };
    let body = |name: &String| SceneBody {
        name: body_frame(model, name),
        link: model
            .link(inputs.robot.profile.bodies[name].link)
            .name
            .clone(),
        markers: markers(name),
    };
    robot.mounts.keys().map(body).collect()
}

fn provenance(inputs: &Inputs) -> Provenance {
    let input = |d: &Digest| Input {
        path: d.path.clone(),
        sha256: d.sha256.clone(),
    };
    Provenance {
        tool: "calib".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        profile: inputs.robot.file.clone(),
        inputs: inputs.digests.iter().map(input).collect(),
        components: named::components(inputs),
        date: inputs.robot.profile.identification.date.clone(),
    }
}
