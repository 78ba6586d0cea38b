//! Bodies whose coordinates a controller computed from its joints: no measurement.

use calib_checks::structural::{BodyIndex, Chain, by_rounding_alone};
use calib_recording::{BodyColumns, Poses};

use crate::bodies::Found;
use crate::fact::{About, Fact, Notation, Place};
use crate::links::Scene;
use crate::source::Source;

/// What is written with one decimal of a millimeter, m, and joints with two of a degree.
const COMPUTED: f64 = 1e-4;
/// No tracker resolves less, m: the limit where no body shows the noise.
const RESOLVED: f64 = 3e-6;
/// Rows that leave a residual of a point on a link: 3 coordinates each, for a frame and the point.
const ROWS: usize = 8;
/// What a body that moves leaves on the root, m.
const MOVED: f64 = 0.01;
/// Part of the noise that the markers show: of as many coordinates as there are, none scatters so little by chance.
const OF_NOISE: f64 = 0.3;
/// The same of a pose, which a tracker computes from many markers, and part of what another body leaves.
const BELOW: f64 = 0.1;

/// Bodies from `fixed` on that follow the nominal robot closer than the tracker's noise, m, lets any measured body, while another one shows that the robot
/// is not that close to its drawing.
#[must_use]
pub fn computed(
    scene: &Scene<'_>,
    sources: &[Source],
    fixed: usize,
    noise: Option<f64>,
) -> Vec<(usize, Fact)> {
    let poses = |body: &Found| -> Vec<&BodyColumns> {
        let all = sources.iter().filter_map(|source| {
            let map = source.columns.as_ref()?;
            map.bodies.get(source.name_in_file(&body.name))
        });
        all.collect()
    };
    let columns = |body: &Found| -> Vec<String> {
        let maps = || sources.iter().filter_map(|source| source.columns.as_ref());
        let of = |marker: &String| maps().find_map(|map| map.markers.get(marker));
        let of_markers = body.markers.iter().filter_map(of).flatten().cloned();
        let pose = poses(body)
            .into_iter()
            .next()
            .filter(|_| body.markers.is_empty());
        let pose = pose.map(|pose| {
            let turns = Notation::of(pose).map_or_else(Vec::new, |(_, columns)| columns);
            [pose.position.to_vec(), turns].concat()
        });
        of_markers.chain(pose.into_iter().flatten()).collect()
    };
    // Controllers write angles, and round; a tracker that computes a pose from many markers mostly writes a quaternion.
    let is_quaternion = |body: &Found| {
        let mut notations = poses(body).into_iter().filter_map(Notation::of);
        notations.all(|(notation, _)| matches!(notation, Notation::Quaternion { .. }))
    };
    let limit = |of: &Found| {
        let part = match of.markers.is_empty() && is_quaternion(of) {
            true => BELOW,
            false => OF_NOISE,
        };
        noise.map_or(RESOLVED, |noise| COMPUTED.min(part * noise))
    };
    let count = scene.bodies.len();
    let Ok(chain) = Chain::from_model(scene.model) else {
        return Vec::new();
    };
    if count < 2 {
        return Vec::new();
    }
    // What the registration leaves, and how much of it rounding alone explains.
    let rms: Vec<Option<(f64, Option<f64>)>> = (0..count)
        .map(|body| {
            if rows(scene, &scene.bodies[body]) < ROWS {
                return None;
            }
            let choice = scene.choose(&chain, body)?;
            // One that hardly moves does not show what it follows.
            let of_root = choice
                .all
                .iter()
                .find(|(link, _)| *link == scene.model.root());
            let moves = of_root.is_some_and(|(_, rms)| *rms > MOVED);
            let rounded =
                || by_rounding_alone(&scene.data(&chain, &[(body, choice.link)]), BodyIndex(0));
            moves.then(|| (choice.rms, rounded()))
        })
        .collect();
    let found = (fixed..count).filter_map(|body| {
        let one = &scene.bodies[body];
        let (own, rounded) = rms[body]?;
        let own = Some(own).filter(|rms| *rms < limit(one)).or(rounded)?;
        let others = (0..count).filter(|other| *other != body);
        let others = others.filter_map(|other| Some((other, rms[other]?.0)));
        let (other, next) = others.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let about = About::Computed {
            body: one.name.clone(),
            columns: columns(one),
            markers: one.markers.clone(),
            rms: [own, next],
            other: scene.bodies[other].name.clone(),
        };
        (own < BELOW * next).then(|| (body, Fact::new(Place::Recordings, about)))
    });
    found.collect()
}

/// Rows that show a body, all tables together.
fn rows(scene: &Scene<'_>, body: &Found) -> usize {
    let of = |poses: &Poses| match body.markers.first() {
        Some(marker) => poses
            .markers
            .get(marker)
            .map_or(0, |track| track.iter().flatten().count()),
        None => poses
            .bodies
            .get(&body.name)
            .map_or(0, |track| track.iter().flatten().count()),
    };
    scene.tables.iter().map(of).sum()
}

/// Forgets these bodies, and what was said of them.
pub fn leave_out(
    computed: Vec<(usize, Fact)>,
    found: &mut Vec<Found>,
    of_bodies: &mut Vec<Fact>,
    of_files: &mut [Fact],
) {
    for (body, fact) in computed.into_iter().rev() {
        let place = Place::Body(found.remove(body).name);
        of_bodies.retain(|fact| fact.place != place);
        of_bodies.push(fact);
    }
    // What stands beside such a position in the file needs no quaternion; beside another point it may be the orientation of that one.
    if found.iter().any(|body| body.markers.len() == 1) {
        return;
    }
    for fact in of_files {
        if let About::Ignored { orientation, .. } = &mut fact.about {
            orientation.clear();
            *fact = Fact::new(fact.place.clone(), fact.about.clone());
        }
    }
}
