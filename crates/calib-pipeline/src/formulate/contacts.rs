//! Touches: loops that close through a plane, a line, a point or a ball bar instead of through the tracker.
//!
//! Its place and the point are unknowns where the profile gives them a prior.

use calib_core::{
    Chart, EdgeId, FrameId, GroupId, MarkerObservation, Measurement, MeasurementKind, NoiseKind,
    PointId, Problem, Role, measurement,
};
use calib_profile::{Contact, ContactBase, Touched};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::formulate::formulation::Formulation;
use crate::formulate::kinematics::Calibration;
use crate::prepare::inputs::Inputs;

/// Adds every contact of the profile to the problem.
pub fn add_contacts(formulation: &mut Formulation, inputs: &Inputs) {
    add_points(formulation, inputs);
    let profile = &inputs.robot.profile;
    for (name, contact) in &profile.contacts {
        let base = match contact.on {
            ContactBase::Tracker => Some(formulation.tracker),
            ContactBase::Link(link) => formulation.links[link.index()],
        };
        let Some(&point) = formulation.contact_points.get(&contact.point) else {
            continue;
        };
        let carrier = profile.points[&contact.point].link;
        let (Some(base), Some(link)) = (base, formulation.links[carrier.index()]) else {
            continue;
        };
        let touches = touches(formulation, contact);
        let problem = &mut formulation.problem;
        let (place, place_frame) = add_place(problem, name, contact, base);
        let noise = problem.noise_group(
            &format!("contact {name}"),
            NoiseKind::Position,
            contact.sigma,
            !profile.solve.noise.known,
        );
        problem.add_measurement(Measurement {
            name: name.clone(),
            from: place_frame,
            to: link,
            path: None,
            kind: touched(contact.touched, point, noise, touches),
        });
        formulation.contacts.insert(name.clone(), place);
    }
}

/// The points of the robot that touch something, unknown where the profile gives them a prior.
fn add_points(formulation: &mut Formulation, inputs: &Inputs) {
    for (name, tip) in &inputs.robot.profile.points {
        let Some(link) = formulation.links[tip.link.index()] else {
            continue;
        };
        let point = match tip.sigma {
            Some(sigma) => formulation
                .problem
                .unknown_point(name, link, tip.at, Some(sigma)),
            None => formulation.problem.known_point(name, link, tip.at),
        };
        formulation.contact_points.insert(name.clone(), point);
    }
}

/// The samples of the recordings in which the contact holds.
fn touches(formulation: &Formulation, contact: &Contact) -> Vec<usize> {
    formulation
        .samples
        .iter()
        .enumerate()
        .filter(|(_, (recording, _))| contact.recordings.contains(recording))
        .map(|(sample, _)| sample)
        .collect()
}

/// Where the touched thing is: an unknown with the prior of the profile, and its frame.
fn add_place(
    problem: &mut Problem,
    name: &str,
    contact: &Contact,
    base: FrameId,
) -> (EdgeId, FrameId) {
    let name = format!("{name}.place");
    let frame = problem.frame(&name);
    let chart = place_chart(contact);
    let place = problem.unknown(&name, base, frame, contact.base_from_place, chart);
    problem.set_role(place, Role::World, None);
    problem.set_prior(place, contact.place_sigma_rad, contact.place_sigma);
    (place, frame)
}

/// The measurement of each kind of touched thing, which lies in its place's origin and along z.
fn touched(
    touched: Touched,
    point: PointId,
    noise: GroupId,
    samples: Vec<usize>,
) -> MeasurementKind {
    match touched {
        Touched::Plane => MeasurementKind::Plane(measurement::Plane {
            point,
            normal: Vector3::z_axis(),
            noise,
            observations: samples.into_iter().map(|s| (s, 0.0)).collect(),
        }),
        Touched::Line => MeasurementKind::Line(measurement::Line {
            point,
            through: Point3::origin(),
            direction: Vector3::z_axis(),
            noise,
            samples,
        }),
        Touched::Point => MeasurementKind::Markers(measurement::Markers {
            noise,
            observations: samples
                .into_iter()
                .map(|sample| MarkerObservation {
                    sample,
                    point,
                    position: Point3::origin(),
                    shape: None,
                })
                .collect(),
        }),
        Touched::Distance(distance) => MeasurementKind::Distance(measurement::Distance {
            point,
            anchor: Point3::origin(),
            noise,
            observations: samples.into_iter().map(|s| (s, distance)).collect(),
        }),
        Touched::Cylinder(radius) => MeasurementKind::Cylinder(measurement::Cylinder {
            point,
            through: Point3::origin(),
            direction: Vector3::z_axis(),
            radius,
            noise,
            samples,
        }),
    }
}

/// The directions of the touched thing that contacts can tell, where the profile frees them.
fn place_chart(contact: &Contact) -> Chart {
    let (turns, shifts) = contact.touched.seen();
    let turns = turns.map(|seen| seen && contact.place_sigma_rad.is_some());
    let shifts = shifts.map(|seen| seen && contact.place_sigma.is_some());
    let [a, b, c] = turns;
    let [x, y, z] = shifts;
    Chart::of([a, b, c, x, y, z])
}

/// How far a touch misses: predicted − touched, tracker frame, m; `None` where the robot knows no
/// such contact.
#[must_use]
pub fn miss(
    inputs: &Inputs,
    name: &str,
    robot: &Calibration,
    root_from_link: &[Isometry3<f64>],
) -> Option<Vector3<f64>> {
    let profile = &inputs.robot.profile;
    let contact = profile.contacts.get(name)?;
    let carrier = profile.points.get(&contact.point)?.link;
    let tracker_from_base = match contact.on {
        ContactBase::Tracker => Isometry3::identity(),
        ContactBase::Link(link) => robot.tracker_from_root * root_from_link[link.index()],
    };
    let tracker_from_place = tracker_from_base * robot.places.get(name)?;
    let tip = robot.contact_points.get(&contact.point)?;
    let touching = robot.tracker_from_root * root_from_link[carrier.index()] * tip;
    let p = tracker_from_place.inverse_transform_point(&touching).coords;
    let off = contact.touched.off(&p);
    Some(tracker_from_place.rotation * off)
}
