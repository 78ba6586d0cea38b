//! Labels of two bodies that are exchanged in some rows: all of them, as when a tracker takes one body for the other, or one marker of each.
//!
//! A body's distances in the rows that most others agree with are its template. In a row in which two bodies differ from their templates, one arrangement
//! of their labels may give both back: then the labels are put right. Everything is compared in units of the noise of a distance, which its changes
//! from one row to the next show, so that bodies which are alike to some tenths of a millimeter are still distinguished.

use std::collections::{BTreeMap, BTreeSet};

use calib_checks::model::disagreement;
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_geometry::statistics::{SIGMA_PER_MAD, upper_median};
use calib_profile::{BodyKind, Usage};
use calib_urdf::{LinkId, RobotModel};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};

use crate::prepare::inputs::{Inputs, Loaded};

/// Rows that a template is learned from.
const ROWS: usize = 400;
/// Rows that a template is tried from.
const SEEDS: usize = 8;
/// Rows that agree with a template at least, and as a part of all.
const ENOUGH: (usize, f64) = (5, 0.25);
/// Root mean square of distances about a template, in σ, up to which a row agrees with it.
const AGREES: f64 = 4.0;
/// The same up to which the template is learned from a row, and from which on a row is looked at.
const OFF: f64 = 2.0;
/// How much smaller the sum of squares is, in σ², than that of the labels as they are and than that of any other arrangement: twice the logarithm of a
/// ratio of likelihoods, here of 10¹³.
const EVIDENCE: f64 = 60.0;
/// Rows that are compared with the robot's motion.
const COMPARED: usize = 64;
/// What the links of the other body leave at most of the disagreement with the robot's motion where two bodies have each other's names.
const CROSSED: f64 = 0.5;
/// Disagreement, rad, that errors of a nominal robot make: below it, no link is better than another.
const GOOD: f64 = 0.01;
/// Smallest σ of a distance, m.
const SMALLEST: f64 = 5e-5;
/// Markers of a body up to which every order of its labels is tried; beyond that, only the order of the profile.
const ORDERED: usize = 4;
/// Markers of a body, at least and at most.
const MARKERS: std::ops::RangeInclusive<usize> = 3..=24;

/// A row of a recording: the place of the recording, those that are fitted first, and of the row in it.
type Place = (usize, usize);

/// Puts the labels of bodies right in rows where they are exchanged; one finding for each exchange and recording.
pub(super) fn in_rows(inputs: &mut Inputs) -> Vec<Finding> {
    let stated = inputs.robot.profile.tracker.marker_coordinate();
    let bodies = inputs.robot.profile.bodies.iter();
    let bodies: Vec<Named<'_>> = bodies
        .filter_map(|(name, body)| match &body.kind {
            BodyKind::Markers { names, .. } if MARKERS.contains(&names.len()) => Some(Named {
                name,
                markers: names,
                link: body.link,
            }),
            _ => None,
        })
        .collect();
    if bodies.len() < 2 {
        return Vec::new();
    }
    // What is fitted comes first: of two arrangements that are as frequent, the earlier one is called right unless the robot tells.
    let mut tables: Vec<&mut Loaded> = inputs.recordings.values_mut().collect();
    tables.sort_by_key(|loaded| loaded.spec.usage == Usage::Validation);
    let exchanges = found(&inputs.robot.model, &tables, &bodies, stated);
    let mut by_kind: BTreeMap<(usize, Said), BTreeSet<u64>> = BTreeMap::new();
    for exchange in exchanges {
        let (table, row) = exchange.place;
        let loaded = &mut *tables[table];
        renamed(&mut loaded.poses.markers, row, &exchange.names);
        renamed(&mut loaded.shapes, row, &exchange.names);
        let rows = by_kind.entry((table, exchange.said)).or_default();
        rows.insert(loaded.poses.rows[row]);
    }
    let findings = by_kind.into_iter().map(|((table, said), rows)| {
        let (kind, [first, second]) = match said {
            Said::Bodies(names) => ("bodies_in_rows", names),
            Said::Markers(names) => ("markers_in_rows", names),
        };
        let subject = Subject::default().in_recording(&tables[table].name);
        Finding::of_kind(catalog::MARKER_SWAP_REPAIRED, kind, subject)
            .with("first", Fact::name(first))
            .with("second", Fact::name(second))
            .with("rows", Fact::count(rows.len()))
            .at_rows(rows)
    });
    findings.collect()
}

/// A body of the profile.
struct Named<'a> {
    name: &'a String,
    markers: &'a [String],
    link: LinkId,
}

/// The exchanges in all rows. Which of the two arrangements of a pair of bodies is right, the motion of the nominal robot tells.
fn found(
    model: &RobotModel,
    tables: &[&mut Loaded],
    bodies: &[Named<'_>],
    stated: Option<f64>,
) -> Vec<Exchange> {
    // Body → the rows that show it by its right names.
    let mut right: BTreeMap<String, BTreeSet<Place>> = BTreeMap::new();
    let learned = |right: &BTreeMap<String, BTreeSet<Place>>| -> Vec<Learned<'_>> {
        let of = |body| Learned::of(tables, body, stated, right);
        bodies.iter().filter_map(of).collect()
    };
    let as_named = learned(&right);
    let found = exchanges(&as_named);
    for (k, first) in as_named.iter().enumerate() {
        for second in &as_named[k + 1..] {
            let pair = [first, second];
            let said = Said::Bodies(pair.map(|body| body.named.name.clone()));
            let rows = found.iter().filter(|exchange| exchange.said == said);
            let rows: BTreeSet<Place> = rows.map(|exchange| exchange.place).collect();
            if !rows.is_empty() && is_crossed(model, tables, pair, &rows) {
                right.extend(pair.map(|body| (body.named.name.clone(), rows.clone())));
            }
        }
    }
    if right.is_empty() {
        return found;
    }
    exchanges(&learned(&right))
}

/// Whether two bodies follow each other's links in the rows that agree with their templates, and their own in those that are `exchanged`: then
/// these are the rows with the right names.
fn is_crossed(
    model: &RobotModel,
    tables: &[&mut Loaded],
    bodies: [&Learned<'_>; 2],
    exchanged: &BTreeSet<Place>,
) -> bool {
    let off = |place: &Place| bodies.iter().any(|body| body.off.contains(place));
    let all = (0..tables.len()).flat_map(|t| (0..tables[t].poses.len()).map(move |row| (t, row)));
    let agreeing: BTreeSet<Place> = all.filter(|place| !off(place)).collect();
    // Motions between the rows of one recording do not depend on where the tracker stood.
    let ratio = |t: usize, places: &BTreeSet<Place>| {
        let of_table: Vec<Place> = places
            .iter()
            .filter(|place| place.0 == t)
            .copied()
            .collect();
        follows_the_other(model, tables, bodies, &of_table)
    };
    let of_table = |t: usize| ratio(t, &agreeing) / ratio(t, exchanged);
    (0..tables.len()).map(of_table).product::<f64>() < CROSSED
}

/// The disagreement of two bodies with the motion of each other's links over that with their own, by the labels as they are; about 1 where the
/// motion does not tell, as where only joints before both of them moved.
fn follows_the_other(
    model: &RobotModel,
    tables: &[&mut Loaded],
    [a, b]: [&Learned<'_>; 2],
    places: &[Place],
) -> f64 {
    let step = places.len().div_ceil(COMPARED).max(1);
    let off = |body: &Learned<'_>, link: LinkId| {
        let rows = places.iter().step_by(step).filter_map(|&place| {
            let q = tables[place.0].q[place.1].as_ref()?;
            let seen = frame(&body.tracks.points(place));
            Some((seen, model.root_from_link(q, link)))
        });
        let (seen, poses): (Vec<_>, Vec<_>) = rows.unzip();
        // Where neither turns, they agree.
        disagreement(&seen, &poses).unwrap_or(0.0)
    };
    let (own, other) = (a.named.link, b.named.link);
    let by_other = off(a, other) + off(b, own);
    by_other.max(GOOD) / (off(a, own) + off(b, other)).max(GOOD)
}

/// A frame of three markers, fixed in the body.
fn frame(points: &Points) -> Option<Isometry3<f64>> {
    let [a, b, c] = [points[0]?, points[1]?, points[2]?];
    let turned = UnitQuaternion::face_towards(&(b - a), &(c - a));
    Some(Isometry3::from_parts(Translation3::from(a), turned))
}

/// What was exchanged.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Said {
    /// All markers of two bodies.
    Bodies([String; 2]),
    /// One marker of each.
    Markers([String; 2]),
}

/// New name and present name of each marker that is called wrong in a row.
type Names = Vec<(String, String)>;

struct Exchange {
    place: Place,
    said: Said,
    names: Names,
}

/// Gives values of a row other names.
fn renamed<T: Clone>(of_markers: &mut BTreeMap<String, Vec<Option<T>>>, row: usize, names: &Names) {
    let value = |name: &String| {
        of_markers
            .get(name)
            .and_then(|track| track.get(row)?.clone())
    };
    let values: Vec<Option<T>> = names.iter().map(|(_, present)| value(present)).collect();
    for ((name, _), value) in names.iter().zip(values) {
        if let Some(cell) = of_markers
            .get_mut(name)
            .and_then(|track| track.get_mut(row))
        {
            *cell = value;
        }
    }
}

/// A body with its template.
struct Learned<'a> {
    named: &'a Named<'a>,
    /// Distance of each pair of markers, m.
    template: Vec<f64>,
    /// Of a distance, m.
    sigma: f64,
    /// Where it was seen.
    tracks: Tracks<'a>,
    /// Rows that disagree with the template.
    off: BTreeSet<Place>,
}

/// The markers' points in a row, in the order of the body.
type Points = Vec<Option<Point3<f64>>>;

/// The markers of a body in each recording, in the order of the body; empty where a marker is missing.
struct Tracks<'a>(Vec<Vec<&'a [Option<Point3<f64>>]>>);

impl<'a> Tracks<'a> {
    fn of(tables: &'a [&mut Loaded], markers: &[String]) -> Self {
        let track = |table: &'a Loaded, marker: &String| -> &'a [Option<Point3<f64>>] {
            table.poses.markers.get(marker).map_or(&[], Vec::as_slice)
        };
        let of_table = |table: &'a &mut Loaded| markers.iter().map(|m| track(table, m)).collect();
        Self(tables.iter().map(of_table).collect())
    }

    fn points(&self, (table, row): Place) -> Points {
        let point = |track: &&[Option<Point3<f64>>]| *track.get(row)?;
        self.0[table].iter().map(point).collect()
    }
}

impl<'a> Learned<'a> {
    /// `None` where no template is agreed with often enough, or every row agrees. `right`: by body, the rows to learn the template from, where not all.
    fn of(
        tables: &'a [&mut Loaded],
        named: &'a Named<'a>,
        stated: Option<f64>,
        right: &BTreeMap<String, BTreeSet<Place>>,
    ) -> Option<Self> {
        let tracks = Tracks::of(tables, named.markers);
        let right = right.get(named.name);
        let length = |table: &Loaded| table.poses.len();
        let places =
            (0..tables.len()).flat_map(|t| (0..length(tables[t])).map(move |row| (t, row)));
        let places: Vec<Place> = places.collect();
        let looked_at = places
            .iter()
            .filter(|place| right.is_none_or(|rows| rows.contains(place)));
        let complete: Vec<Vec<f64>> = looked_at
            .step_by(places.len().div_ceil(ROWS).max(1))
            .filter_map(|place| distances(&tracks.points(*place)).into_iter().collect())
            .collect();
        let sigma = sigma(&complete)?.max(stated.unwrap_or(0.0) * std::f64::consts::SQRT_2);
        let enough = (ENOUGH.1 * complete.len() as f64).max(ENOUGH.0 as f64);
        let step = complete.len().div_ceil(SEEDS).max(1);
        let seeds = complete.iter().step_by(step).rev();
        let templates = seeds.filter_map(|seed| {
            // A single row has the noise of one more.
            let close = agreeing(&complete, seed, sigma * std::f64::consts::SQRT_2);
            let close = agreeing(&complete, &mean(&close)?, sigma);
            (close.len() as f64 >= enough).then(|| Some((close.len(), mean(&close)?)))?
        });
        // Of those that as many agree with, the first.
        let (_, template) = templates.max_by_key(|(rows, _)| *rows)?;
        let mut learned = Self {
            named,
            template,
            sigma,
            tracks,
            off: BTreeSet::new(),
        };
        let off = |place: &Place| {
            let misfit = learned.misfit(&learned.tracks.points(*place));
            misfit.is_some_and(|misfit| misfit.rms > OFF)
        };
        learned.off = places.into_iter().filter(off).collect();
        (!learned.off.is_empty()).then_some(learned)
    }

    /// `None` with fewer than three markers.
    fn misfit(&self, points: &Points) -> Option<Misfit> {
        let (mut sum, mut count) = (0.0, 0_u32);
        for (distance, template) in distances(points).into_iter().zip(&self.template) {
            if let Some(distance) = distance {
                sum += ((distance - template) / self.sigma).powi(2);
                count += 1;
            }
        }
        (count >= 3).then(|| Misfit {
            sum,
            rms: (sum / f64::from(count)).sqrt(),
        })
    }
}

/// How far distances are from a template: the sum of their squares and its root mean, σ² and σ.
#[derive(Debug, Clone, Copy)]
struct Misfit {
    sum: f64,
    rms: f64,
}

impl Misfit {
    /// Of two bodies together: the sum of both, the larger root mean.
    fn with(self, other: Self) -> Self {
        Self {
            sum: self.sum + other.sum,
            rms: self.rms.max(other.rms),
        }
    }
}

/// Of each pair of markers, m.
fn distances(points: &Points) -> Vec<Option<f64>> {
    let of_pair =
        |a: &Option<Point3<f64>>, b: &Option<Point3<f64>>| Some((a.as_ref()? - b.as_ref()?).norm());
    let from = |(k, a)| points[k + 1..].iter().map(move |b| of_pair(a, b));
    points.iter().enumerate().flat_map(from).collect()
}

/// σ of a distance, m, by what it changes from row to row; that of the quieter half of the pairs, as one marker of four may be loose.
fn sigma(rows: &[Vec<f64>]) -> Option<f64> {
    let pairs = rows.first()?.len();
    let of_pair = |pair: usize| {
        let mut changes: Vec<f64> = rows
            .windows(2)
            .map(|two| (two[1][pair] - two[0][pair]).abs())
            .collect();
        upper_median(&mut changes).map(|median| SIGMA_PER_MAD * median / std::f64::consts::SQRT_2)
    };
    let mut sigmas: Vec<f64> = (0..pairs).filter_map(of_pair).collect();
    sigmas.sort_by(f64::total_cmp);
    let quiet = sigmas.get(sigmas.len().checked_sub(1)? / 2)?;
    Some(quiet.max(SMALLEST))
}

fn agreeing<'r>(rows: &'r [Vec<f64>], template: &[f64], sigma: f64) -> Vec<&'r Vec<f64>> {
    let agrees = |row: &&Vec<f64>| {
        let squares = row
            .iter()
            .zip(template)
            .map(|(d, t)| ((d - t) / sigma).powi(2));
        squares.sum::<f64>() <= OFF * OFF * template.len() as f64
    };
    rows.iter().filter(agrees).collect()
}

fn mean(rows: &[&Vec<f64>]) -> Option<Vec<f64>> {
    let pairs = rows.first()?.len();
    let of_pair = |pair: usize| rows.iter().map(|row| row[pair]).sum::<f64>() / rows.len() as f64;
    Some((0..pairs).map(of_pair).collect())
}

fn exchanges(bodies: &[Learned<'_>]) -> Vec<Exchange> {
    let mut found = Vec::new();
    for (k, first) in bodies.iter().enumerate() {
        for second in &bodies[k + 1..] {
            let common = first.off.intersection(&second.off);
            found.extend(common.filter_map(|place| of_row([first, second], *place)));
        }
    }
    found
}

/// The exchange that gives both bodies back in a row.
fn of_row(bodies: [&Learned<'_>; 2], place: Place) -> Option<Exchange> {
    let [a, b] = bodies.map(|body| body.tracks.points(place));
    let together = |x: &Points, y: &Points| Some(bodies[0].misfit(x)?.with(bodies[1].misfit(y)?));
    let mut tried = Vec::new();
    for (i, name) in bodies[0].named.markers.iter().enumerate() {
        for (j, other) in bodies[1].named.markers.iter().enumerate() {
            let (mut x, mut y) = (a.clone(), b.clone());
            std::mem::swap(&mut x[i], &mut y[j]);
            if let Some(misfit) = together(&x, &y).filter(|_| a[i].is_some() && b[j].is_some()) {
                let names = vec![(name.clone(), other.clone()), (other.clone(), name.clone())];
                tried.push((misfit, Said::Markers([name.clone(), other.clone()]), names));
            }
        }
    }
    let of_second = best_order(&b, bodies[0]).filter(|_| a.len() == b.len());
    if let Some(((x, from_second), (y, from_first))) = of_second.zip(best_order(&a, bodies[1])) {
        let named = |order: Vec<usize>, to: &Learned<'_>, of: &Learned<'_>| -> Names {
            let pairs = to.named.markers.iter().zip(order);
            let names = pairs.map(|(name, k)| (name.clone(), of.named.markers[k].clone()));
            names.collect()
        };
        let mut names = named(from_second, bodies[0], bodies[1]);
        names.extend(named(from_first, bodies[1], bodies[0]));
        let said = Said::Bodies(bodies.map(|body| body.named.name.clone()));
        tried.push((x.with(y), said, names));
    }
    tried.sort_by(|x, y| x.0.sum.total_cmp(&y.0.sum));
    let next = tried.get(1).map_or(f64::INFINITY, |(next, ..)| next.sum);
    let rival = together(&a, &b)?.sum.min(next);
    let (misfit, said, names) = tried.into_iter().next()?;
    let clear = misfit.rms <= AGREES && misfit.sum + EVIDENCE <= rival;
    clear.then_some(Exchange { place, said, names })
}

/// The order of another body's points that fits a body best, and how: that of the profile where it fits; `None` where two others do.
fn best_order(points: &Points, body: &Learned<'_>) -> Option<(Misfit, Vec<usize>)> {
    let plain: Vec<usize> = (0..points.len()).collect();
    let misfit = |order: &[usize]| body.misfit(&order.iter().map(|k| points[*k]).collect());
    let as_it_is = misfit(&plain)?;
    if points.len() > ORDERED || as_it_is.rms <= AGREES {
        return Some((as_it_is, plain));
    }
    let all = orders(points.len()).into_iter();
    let mut all: Vec<(Misfit, Vec<usize>)> = all
        .filter_map(|order| Some((misfit(&order)?, order)))
        .collect();
    all.sort_by(|a, b| a.0.sum.total_cmp(&b.0.sum));
    let next = all.get(1).map_or(f64::INFINITY, |(next, _)| next.sum);
    let best = all.into_iter().next()?;
    (best.0.sum + EVIDENCE <= next).then_some(best)
}

/// All orders of so many things.
fn orders(count: usize) -> Vec<Vec<usize>> {
    if count == 0 {
        return vec![Vec::new()];
    }
    let mut all = Vec::new();
    for shorter in orders(count - 1) {
        for at in 0..count {
            let mut order = shorter.clone();
            order.insert(at, count - 1);
            all.push(order);
        }
    }
    all
}
