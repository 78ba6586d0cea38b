//! Touches: loops that close through a plane, a line, a point or a ball bar instead of through the tracker.
//!
//! Its place and the point are unknowns where the profile gives them a prior. Where the rows say which point was touched, by
//! coordinates or by the name of a spot, the place is that of their common frame.

use std::collections::BTreeMap;

use calib_core::{
    Chart, EdgeId, EdgeKind, FrameId, GroupId, MarkerObservation, Measurement, MeasurementKind,
    NoiseKind, PointId, Problem, Role, measurement,
};
use calib_geometry::registration::rigid_registration;
use calib_profile::{ByRow, Contact, ContactBase, Spots, Touched};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::formulate::formulation::Formulation;
use crate::formulate::kinematics::Calibration;
use crate::prepare::inputs::{Inputs, Loaded};

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
        let (place, place_frame) = add_place(&mut formulation.problem, name, contact, base);
        if contact.touched == Touched::Listed && contact.place_sigma_rad.is_some() {
            start_place(formulation, inputs, contact, place);
        }
        let noise = formulation.problem.noise_group(
            &format!("contact {name}"),
            NoiseKind::Position,
            contact.sigma,
            !profile.solve.noise.known,
        );
        formulation.contacts.insert(name.clone(), place);
        let of = Touching {
            name,
            contact,
            point,
            link,
            noise,
        };
        match contact.spots() {
            Some(spots) if spots.sigma.is_some() || spots.at.is_empty() => {
                add_spots(formulation, inputs, &of, spots, place_frame);
            }
            _ => {
                let touches = touches(formulation, inputs, contact);
                of.measure(&mut formulation.problem, place_frame, touches);
            }
        }
    }
}

/// A contact whose parts in the problem are known.
struct Touching<'a> {
    name: &'a str,
    contact: &'a Contact,
    point: PointId,
    /// Link of the point.
    link: FrameId,
    noise: GroupId,
}

impl Touching<'_> {
    fn measure(&self, problem: &mut Problem, from: FrameId, touches: Vec<Touch>) {
        problem.add_measurement(Measurement {
            name: self.name.to_owned(),
            from,
            to: self.link,
            path: None,
            kind: touched(self.contact.touched, self.point, self.noise, touches),
        });
    }
}

/// A sample, and where the touched point is in the place's frame, m.
type Touch = (usize, Point3<f64>);

/// The spots of a contact as unknown places: with their prior, or with nothing known but that they are the same ones.
fn add_spots(
    formulation: &mut Formulation,
    inputs: &Inputs,
    of: &Touching<'_>,
    spots: &Spots,
    place: FrameId,
) {
    let mut touches: BTreeMap<&String, Vec<usize>> = BTreeMap::new();
    for (sample, (recording, row)) in formulation.samples.iter().enumerate() {
        let labels = inputs.recordings[recording]
            .poses
            .labels
            .get(&spots.named_in);
        let here = of.contact.recordings.contains(recording);
        if let Some(spot) = labels.map(|l| &l[*row]).filter(|s| here && !s.is_empty()) {
            touches.entry(spot).or_default().push(sample);
        }
    }
    for (spot, samples) in touches {
        let stated = spots.at.get(spot).copied();
        let Some(at) = stated.or_else(|| first_touched(formulation, inputs, of.contact, &samples))
        else {
            // Touched in held-out rows only: nothing says where it is.
            continue;
        };
        let name = format!("{}.{spot}", of.name);
        let problem = &mut formulation.problem;
        let frame = problem.frame(&format!("contact {} spot {spot}", of.name));
        let at = Isometry3::from(at);
        let edge = problem.unknown(&name, place, frame, at, Chart::of(SHIFTS));
        problem.set_role(edge, Role::World, None);
        problem.set_prior(edge, None, spots.sigma);
        let samples = samples.into_iter().map(|s| (s, Point3::origin()));
        of.measure(problem, frame, samples.collect());
        let known = formulation.spots.entry(of.name.to_owned()).or_default();
        known.insert(spot.clone(), edge);
    }
}

/// A place without orientation: its rotations about and translations along x, y, z.
const SHIFTS: [bool; 6] = [false, false, false, true, true, true];

/// Where the nominal robot has its point in these fitted samples on average, in what the touched thing is fixed to, m.
fn first_touched(
    formulation: &Formulation,
    inputs: &Inputs,
    contact: &Contact,
    samples: &[usize],
) -> Option<Point3<f64>> {
    let held_out = &formulation.problem.held_out;
    let fitted = samples.iter().filter(|s| !held_out.contains(s));
    let tips: Vec<_> = fitted
        .filter_map(|s| nominal_tip(formulation, inputs, contact, *s))
        .collect();
    let sum: Vector3<f64> = tips.iter().map(|tip| tip.coords).sum();
    (!tips.is_empty()).then(|| Point3::from(sum / tips.len() as f64))
}

/// Where the nominal robot has the touching point in a sample, in what the touched thing is fixed to, m.
fn nominal_tip(
    formulation: &Formulation,
    inputs: &Inputs,
    contact: &Contact,
    sample: usize,
) -> Option<Point3<f64>> {
    let (recording, row) = &formulation.samples[sample];
    let q = inputs.recordings[recording].q[*row].as_ref()?;
    let tip = inputs.robot.profile.points.get(&contact.point)?;
    let root_from_link = inputs.robot.model.forward_kinematics(q);
    let base_from_root = match contact.on {
        ContactBase::Link(base) => root_from_link[base.index()].inverse(),
        ContactBase::Tracker => match &formulation.problem.edges()[formulation.root.index()].kind {
            EdgeKind::Unknown(root) => root.nominal,
            _ => return None,
        },
    };
    Some(base_from_root * root_from_link[tip.link.index()] * tip.at)
}

/// An artifact may lie anywhere: its place starts where the nominal robot's touches fit it best.
fn start_place(formulation: &mut Formulation, inputs: &Inputs, contact: &Contact, place: EdgeId) {
    let touches = touches(formulation, inputs, contact);
    let fitted = touches
        .into_iter()
        .filter(|(s, _)| !formulation.problem.held_out.contains(s));
    let pairs = fitted.filter_map(|(s, at)| {
        let tip = nominal_tip(formulation, inputs, contact, s)?;
        Some((at, tip))
    });
    let (at, tips): (Vec<_>, Vec<_>) = pairs.unzip();
    if let Ok(found) = rigid_registration(&at, &tips, None) {
        formulation.problem.set_start(place, &found.b_from_a);
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

/// The samples in which the contact holds, and where the touched point is where that is stated.
fn touches(formulation: &Formulation, inputs: &Inputs, contact: &Contact) -> Vec<Touch> {
    let samples = formulation.samples.iter().enumerate();
    let here = samples.filter(|(_, (recording, _))| contact.recordings.contains(recording));
    let touch = |(sample, (recording, row)): (usize, &(String, usize))| {
        let stated = contact.spots().map(|spots| &spots.at);
        let at = touched_at(contact, stated, (&inputs.recordings[recording], *row))?;
        Some((sample, at))
    };
    here.filter_map(touch).collect()
}

/// Where the point that a row touches is in the frame of the touched thing, m, `spots` being known; `None` where it touches
/// nothing that is known.
#[must_use]
pub fn touched_at(
    contact: &Contact,
    spots: Option<&BTreeMap<String, Point3<f64>>>,
    (loaded, row): (&Loaded, usize),
) -> Option<Point3<f64>> {
    match &contact.by_row {
        None => Some(Point3::origin()),
        Some(ByRow::Coordinates(columns)) => loaded.poses.markers.get(columns)?[row],
        Some(ByRow::Spots(of)) => {
            let spot = &loaded.poses.labels.get(&of.named_in)?[row];
            spots?.get(spot).copied()
        }
    }
}

/// Where the touched thing is: an unknown with the prior of the profile, and its frame.
fn add_place(
    problem: &mut Problem,
    name: &str,
    contact: &Contact,
    base: FrameId,
) -> (EdgeId, FrameId) {
    let frame = problem.frame(&format!("contact {name} place"));
    let name = format!("{name}.place");
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
    touches: Vec<Touch>,
) -> MeasurementKind {
    let at = touches.iter().copied();
    let samples = touches.iter().map(|(sample, _)| *sample).collect();
    match touched {
        Touched::Plane => MeasurementKind::Plane(measurement::Plane {
            point,
            normal: Vector3::z_axis(),
            noise,
            observations: at.map(|(s, _)| (s, 0.0)).collect(),
        }),
        Touched::Line => MeasurementKind::Line(measurement::Line {
            point,
            through: Point3::origin(),
            direction: Vector3::z_axis(),
            noise,
            samples,
        }),
        Touched::Point | Touched::Listed | Touched::Unknown => {
            let seen = |(sample, position)| MarkerObservation {
                sample,
                point,
                position,
                shape: None,
            };
            MeasurementKind::Markers(measurement::Markers {
                noise,
                own: BTreeMap::new(),
                sight: None,
                observations: at.map(seen).collect(),
            })
        }
        Touched::Distance(distance) => MeasurementKind::Distance(measurement::Distance {
            point,
            anchor: Point3::origin(),
            noise,
            observations: at.map(|(s, _)| (s, distance)).collect(),
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
/// such contact, or the row touches nothing that is known.
#[must_use]
pub fn miss(
    inputs: &Inputs,
    name: &str,
    robot: &Calibration,
    root_from_link: &[Isometry3<f64>],
    row: (&Loaded, usize),
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
    let at = touched_at(contact, robot.spots.get(name), row)?;
    let p = tracker_from_place.inverse_transform_point(&touching) - at;
    let off = contact.touched.off(&p);
    Some(tracker_from_place.rotation * off)
}
