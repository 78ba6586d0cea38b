//! Labels of two bodies that are exchanged in a whole recording: a marker of the one is called like a marker of the other.
//!
//! Where the bodies move against each other, both change their shape from row to row, each by one marker. These two are exchanged where that leaves both
//! rigid; elsewhere nothing is changed, and the data checks name the markers that move. Recordings in which the bodies do not move against each
//! other are compared with the shapes that were found so.

use std::collections::BTreeMap;

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_geometry::statistics::{quantile_nearest, upper_median};
use calib_profile::BodyKind;
use nalgebra::Point3;

use crate::prepare::inputs::{Inputs, Loaded};

/// Change of a distance, m, from which on a body is not the one that it is called.
const ANOTHER: f64 = 5e-3;
/// The same of a body that is, and what is left of the change at most.
const SAME: (f64, f64) = (2e-3, 0.1);
/// Rows that are looked at.
const ROWS: usize = 400;
/// Rows from which a typical distance is worth something.
const ENOUGH: usize = 5;
/// Part of the rows of a recording that an exchange must make rigid: others may show a reflection.
const NEARLY: f64 = 0.9;

/// Puts exchanged labels right; one finding for each exchange.
pub(super) fn between_bodies(inputs: &mut Inputs) -> Vec<Finding> {
    let profile = inputs.robot.profile.bodies.values();
    let bodies: Vec<Vec<String>> = profile
        .filter_map(|body| match &body.kind {
            BodyKind::Markers { names, .. } if names.len() >= 3 => Some(names.clone()),
            _ => None,
        })
        .collect();
    let mut findings: Vec<Finding> = Vec::new();
    for (a, first) in bodies.iter().enumerate() {
        for second in &bodies[a + 1..] {
            let recordings = &mut inputs.recordings;
            findings.extend(of_bodies(recordings, [first, second]));
        }
    }
    findings
}

fn of_bodies(recordings: &mut BTreeMap<String, Loaded>, bodies: [&[String]; 2]) -> Vec<Finding> {
    let mut found = Vec::new();
    let mut known = None;
    for loaded in recordings.values_mut() {
        if let Some((pair, change)) = by_motion(loaded, bodies) {
            found.push(exchange(loaded, pair, change));
            known =
                known.or_else(|| Some((pair, bodies.map(|body| Shape::of(loaded, body, None)))));
        }
    }
    let Some((pair, shapes)) = known else {
        return found;
    };
    for loaded in recordings.values_mut() {
        if let Some(change) = by_shape(loaded, bodies, pair, &shapes) {
            found.push(exchange(loaded, pair, change));
        }
    }
    found
}

/// A marker of the first body and one of the second.
type Pair<'a> = (&'a String, &'a String);

/// The one marker of each body whose distances change, where exchanged both bodies are rigid, and by how much the distances changed, m.
fn by_motion<'a>(loaded: &Loaded, bodies: [&'a [String]; 2]) -> Option<(Pair<'a>, f64)> {
    let shapes = bodies.map(|body| Shape::of(loaded, body, None));
    let moving = |k: usize| Some(&bodies[k][shapes[k].moving()?]);
    let (x, y) = (moving(0)?, moving(1)?);
    let mut largest: f64 = 0.0;
    for ((body, pair), shape) in bodies.into_iter().zip([(x, y), (y, x)]).zip(&shapes) {
        let before = shape.change()?;
        // In nearly all rows: of an exchange in some of them, both arrangements are rigid in their own.
        let after = Shape::of(loaded, body, Some(pair)).most()?;
        if after > SAME.0.min(SAME.1 * before) {
            return None;
        }
        largest = largest.max(before);
    }
    Some(((x, y), largest))
}

/// By how much distances differ from those of these shapes, m, where both bodies have their shape with this pair exchanged and not as they are.
fn by_shape(
    loaded: &Loaded,
    bodies: [&[String]; 2],
    (x, y): Pair<'_>,
    shapes: &[Shape; 2],
) -> Option<f64> {
    let mut largest: f64 = 0.0;
    for ((body, pair), shape) in bodies.into_iter().zip([(x, y), (y, x)]).zip(shapes) {
        let as_it_is = Shape::of(loaded, body, None).apart(shape)?;
        let exchanged = Shape::of(loaded, body, Some(pair));
        let same = SAME.0.min(SAME.1 * as_it_is);
        if as_it_is < ANOTHER || exchanged.apart(shape)? > same || exchanged.most()? > same {
            return None;
        }
        largest = largest.max(as_it_is);
    }
    Some(largest)
}

fn exchange(loaded: &mut Loaded, (x, y): Pair<'_>, change: f64) -> Finding {
    exchanged(&mut loaded.poses.markers, (x, y));
    exchanged(&mut loaded.shapes, (x, y));
    let subject = Subject::default().in_recording(&loaded.name);
    Finding::of_kind(catalog::MARKER_SWAP_REPAIRED, "between_bodies", subject)
        .with("first", Fact::name(x))
        .with("second", Fact::name(y))
        .with("change", Fact::meters(change))
}

/// Exchanges what is known of two markers.
fn exchanged<T>(of_markers: &mut BTreeMap<String, T>, (x, y): Pair<'_>) {
    let (of_x, of_y) = (of_markers.remove(x), of_markers.remove(y));
    of_markers.extend(of_y.map(|of_y| (x.clone(), of_y)));
    of_markers.extend(of_x.map(|of_x| (y.clone(), of_x)));
}

/// The distances of the markers of a body from three of them, by their places in the list.
struct Shape(BTreeMap<(usize, usize), Distance>);

/// A distance over the rows of a recording, m.
struct Distance {
    /// Median.
    middle: f64,
    /// Median deviation from it.
    change: f64,
    /// Deviation that [`NEARLY`] all rows have at most.
    most: f64,
}

impl Shape {
    /// Of a body in a recording, where one of its markers is called like another one.
    fn of(loaded: &Loaded, body: &[String], instead: Option<Pair<'_>>) -> Self {
        let track = |marker: &String| -> &[Option<Point3<f64>>] {
            let name = match instead {
                Some((of, other)) if of == marker => other,
                _ => marker,
            };
            loaded.poses.markers.get(name).map_or(&[], Vec::as_slice)
        };
        let rows = loaded.poses.len();
        let step = rows.div_ceil(ROWS).max(1);
        let mut shape = BTreeMap::new();
        for from in [0, body.len() / 2, body.len() - 1] {
            for to in (0..body.len()).filter(|to| *to != from) {
                let (a, b) = (track(&body[from]), track(&body[to]));
                let seen = a.iter().zip(b).step_by(step);
                let distances = seen.filter_map(|(a, b)| Some((a.as_ref()? - b.as_ref()?).norm()));
                let mut distances: Vec<f64> = distances.collect();
                if distances.len() < ENOUGH {
                    continue;
                }
                let Some(middle) = upper_median(&mut distances) else {
                    continue;
                };
                let mut off: Vec<f64> = distances.iter().map(|d| (d - middle).abs()).collect();
                let of_distance = Distance {
                    middle,
                    change: upper_median(&mut off).unwrap_or(0.0),
                    most: quantile_nearest(&mut off, NEARLY).unwrap_or(0.0),
                };
                shape.insert((to, from), of_distance);
            }
        }
        Self(shape)
    }

    /// The largest change; `None` where nothing is seen often enough.
    fn change(&self) -> Option<f64> {
        self.0.values().map(|d| d.change).reduce(f64::max)
    }

    /// The largest change that nearly all rows show at most; `None` as for [`change`](Self::change).
    fn most(&self) -> Option<f64> {
        self.0.values().map(|d| d.most).reduce(f64::max)
    }

    /// The only marker of which all distances change.
    fn moving(&self) -> Option<usize> {
        let mut least: BTreeMap<usize, f64> = BTreeMap::new();
        for (&(marker, _), &Distance { change, .. }) in &self.0 {
            let own = least.entry(marker).or_insert(f64::INFINITY);
            *own = own.min(change);
        }
        let mut moving = least.into_iter().filter(|(_, change)| *change > ANOTHER);
        let (marker, _) = moving.next()?;
        moving.next().is_none().then_some(marker)
    }

    /// The largest difference from another shape; `None` where they have no distance in common.
    fn apart(&self, other: &Self) -> Option<f64> {
        let common = self.0.iter().filter_map(|(place, own)| {
            let known = other.0.get(place)?;
            Some((own.middle - known.middle).abs())
        });
        common.reduce(f64::max)
    }
}
