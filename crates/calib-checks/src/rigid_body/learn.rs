//! The template: where the markers sit on the body, learned from the rows.

use std::collections::BTreeSet;

use calib_geometry::decompose::symmetric_eigen_small;
use calib_geometry::registration::rigid_registration;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Spread across the best line, relative to the spread along it, below which markers count as lying on a line:
/// the turn about the line is then 50 times less certain than the others.
pub(super) const MIN_SPREAD_RATIO: f64 = 0.02;

/// Markers closer than this, m, are one point (a marker's own radius is a few millimeters).
const MIN_EXTENT: f64 = 1e-3;
/// On a body of less than ten times that, so are those closer than this part of it.
const SAME_PLACE: f64 = 0.1;

/// Rounds of registering and averaging; each divides the error by the number of rows or so, ten are usual.
const MAX_ROUNDS: usize = 200;

/// Change of the template, relative to its size, at which learning has converged…
const CONVERGED: f64 = 1e-13;
/// …or below which rounding is all that is left, where it no longer shrinks to…
const ROUNDING: f64 = 1e-9;
/// …this part of the change before: with many rows the mean is rounded by more than [`CONVERGED`].
const SHRINKS: f64 = 0.5;

/// Rows that the place of a marker is learned from at most, evenly over all of them: noise of 0.3 mm leaves 5 µm.
const ENOUGH_ROWS: usize = 4000;

/// The markers of a body in the body's frame, m.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    /// Marker names, in the order that defines the frame.
    pub names: Vec<String>,
    /// Points in the body's frame, m.
    pub points: Vec<Point3<f64>>,
}

/// How well one marker keeps its place on the body.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerFit {
    /// Its name.
    pub name: String,
    /// Rows in which it was seen and used.
    pub rows: usize,
    /// Root mean square distance from its place in the template, m.
    pub rms: f64,
    /// Largest such distance, m, and its row (from 0).
    pub worst: (f64, usize),
    /// Lower median over the other markers of the standard deviation of the distance to them, m: large for a
    /// marker that moves on the body, small for the markers it moves against.
    pub wandering: f64,
}

/// Why markers make no body.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotABody {
    /// Fewer than three markers.
    #[error("a body needs 3 markers, {got} are given")]
    TooFewMarkers {
        /// Markers given.
        got: usize,
    },
    /// A marker that the table does not have.
    #[error("there is no marker `{name}`; the recording has {known}{}", nearest.as_ref().map(|n| format!("; did you mean `{n}`?")).unwrap_or_default())]
    UnknownMarker {
        /// The name asked for.
        name: String,
        /// The table's markers.
        known: String,
        /// The nearest of them.
        nearest: Option<String>,
    },
    /// The tracks have different lengths.
    #[error("marker `{name}` has {got} rows, the others {expected}")]
    Length {
        /// The marker.
        name: String,
        /// Its rows.
        got: usize,
        /// Rows of the first marker.
        expected: usize,
    },
    /// A marker is never seen together with two others of the body.
    #[error(
        "marker `{name}` is never seen together with three markers of known place; rows seen: {seen}"
    )]
    NeverSeen {
        /// The marker.
        name: String,
        /// Rows in which it is seen at all.
        seen: usize,
    },
    /// No row shows three markers that are not on a line.
    #[error(
        "no row shows three markers that span a plane ({rows} rows, at most {most} markers in one)"
    )]
    NoRow {
        /// Rows.
        rows: usize,
        /// Most markers seen in one row.
        most: usize,
    },
    /// The markers lie on a line.
    #[error(
        "the markers lie on a line: {across_mm:.3} mm across, {along_mm:.1} mm along; the turn about it cannot be seen; mount one marker off the line"
    )]
    Collinear {
        /// Root mean square distance from the best line, mm.
        across_mm: f64,
        /// Root mean square extent along it, mm.
        along_mm: f64,
    },
    /// All markers are at one place.
    #[error("markers `{a}` and `{b}` are at the same place ({distance_mm:.3} mm apart)")]
    Coincident {
        /// One.
        a: String,
        /// The other.
        b: String,
        /// Distance, mm.
        distance_mm: f64,
    },
}

impl Template {
    /// A template that is known beforehand; the points are used in the frame they are given in.
    ///
    /// # Errors
    /// [`NotABody`] for fewer than three, coincident or collinear markers.
    pub fn given(names: Vec<String>, points: Vec<Point3<f64>>) -> Result<Template, NotABody> {
        if points.len() < 3 || names.len() != points.len() {
            return Err(NotABody::TooFewMarkers {
                got: points.len().min(names.len()),
            });
        }
        let template = Template { names, points };
        template.check_shape()?;
        Ok(template)
    }

    /// Learns the template from marker tracks (tracker frame, m, one entry per row, `None` = occluded) by
    /// alternating registration of all rows and averaging of the markers, eq. (1) of the crate; then moves it into
    /// the frame of eq. (1) of [this module](super).
    ///
    /// # Errors
    /// [`NotABody`] when the markers do not span a body or are not seen together.
    pub fn learn(
        names: &[String],
        tracks: &[&[Option<Point3<f64>>]],
    ) -> Result<Template, NotABody> {
        if names.len() < 3 || names.len() != tracks.len() {
            return Err(NotABody::TooFewMarkers {
                got: names.len().min(tracks.len()),
            });
        }
        let rows = tracks[0].len();
        if let Some(i) = tracks.iter().position(|track| track.len() != rows) {
            return Err(NotABody::Length {
                name: names[i].clone(),
                got: tracks[i].len(),
                expected: rows,
            });
        }
        let places = converged(start(tracks, rows)?, tracks, &enough_rows(tracks));
        if let Some(i) = places.iter().position(Option::is_none) {
            let seen = tracks[i].iter().flatten().count();
            return Err(NotABody::NeverSeen {
                name: names[i].clone(),
                seen,
            });
        }
        let mut template = Template {
            names: names.to_vec(),
            points: places.into_iter().flatten().collect(),
        };
        template.check_shape()?;
        template.move_into_own_frame()?;
        Ok(template)
    }

    fn check_shape(&self) -> Result<(), NotABody> {
        let pairs = self.points.iter().enumerate();
        let distances =
            pairs.flat_map(|(i, a)| self.points[..i].iter().map(move |b| (a - b).norm()));
        let extent = distances.fold(0.0, f64::max);
        // Markers of a body of a few millimeters are small, and as close.
        let near = match extent < MIN_EXTENT {
            true => MIN_EXTENT,
            false => MIN_EXTENT.min(SAME_PLACE * extent),
        };
        for i in 0..self.points.len() {
            for j in 0..i {
                let distance = (self.points[i] - self.points[j]).norm();
                if distance < near {
                    let (a, b) = (self.names[j].clone(), self.names[i].clone());
                    return Err(NotABody::Coincident {
                        a,
                        b,
                        distance_mm: distance * 1e3,
                    });
                }
            }
        }
        let (along, across) = spread(&self.points);
        if across < MIN_SPREAD_RATIO * along {
            return Err(NotABody::Collinear {
                across_mm: across * 1e3,
                along_mm: along * 1e3,
            });
        }
        Ok(())
    }

    /// Eq. (1) of the module.
    fn move_into_own_frame(&mut self) -> Result<(), NotABody> {
        let origin = self.points[0];
        let x = (self.points[1] - origin).normalize();
        let across = |point: &Point3<f64>| {
            let d = point - origin;
            d - x * d.dot(&x)
        };
        let size = extent(self.points.iter());
        let third = self.points[2..]
            .iter()
            .map(across)
            .find(|d| d.norm() > MIN_SPREAD_RATIO * size);
        let Some(y) = third.map(|d| d.normalize()) else {
            let (along, across) = spread(&self.points);
            return Err(NotABody::Collinear {
                across_mm: across * 1e3,
                along_mm: along * 1e3,
            });
        };
        let rotation =
            Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]));
        let old_from_new = Isometry3::from_parts(
            Translation3::from(origin.coords),
            UnitQuaternion::from_rotation_matrix(&rotation),
        );
        for point in &mut self.points {
            *point = old_from_new.inverse_transform_point(point);
        }
        Ok(())
    }
}

/// The row that shows most markers, as the first template.
fn start(
    tracks: &[&[Option<Point3<f64>>]],
    rows: usize,
) -> Result<Vec<Option<Point3<f64>>>, NotABody> {
    let mut best: Option<(usize, usize)> = None;
    let mut most = 0;
    for row in 0..rows {
        let seen: Vec<Point3<f64>> = tracks.iter().filter_map(|track| track[row]).collect();
        most = most.max(seen.len());
        if seen.len() >= 3 && best.is_none_or(|(count, _)| seen.len() > count) {
            let (along, across) = spread(&seen);
            // A row with noise is enough to see a line; coincident markers are reported with their names later.
            if along > 0.0 && (across > MIN_SPREAD_RATIO * along || seen.len() == tracks.len()) {
                best = Some((seen.len(), row));
            }
        }
    }
    let (_, row) = best.ok_or(NotABody::NoRow { rows, most })?;
    Ok(tracks.iter().map(|track| track[row]).collect())
}

/// Evenly spaced rows, and those of a marker that is seldom seen.
fn enough_rows(tracks: &[&[Option<Point3<f64>>]]) -> Vec<usize> {
    let every = |rows: Vec<usize>| {
        let stride = rows.len().div_ceil(ENOUGH_ROWS).max(1);
        rows.into_iter().step_by(stride)
    };
    let count = tracks.first().map_or(0, |track| track.len());
    let mut rows: BTreeSet<usize> = every((0..count).collect()).collect();
    for track in tracks {
        let shown = rows.iter().filter(|i| track[**i].is_some()).count();
        if 2 * shown < ENOUGH_ROWS {
            rows.extend(every((0..count).filter(|i| track[*i].is_some()).collect()));
        }
    }
    rows.into_iter().collect()
}

/// Averages over the rows until the places stand.
fn converged(
    mut places: Vec<Option<Point3<f64>>>,
    tracks: &[&[Option<Point3<f64>>]],
    rows: &[usize],
) -> Vec<Option<Point3<f64>>> {
    let mut before = f64::INFINITY;
    for _ in 0..MAX_ROUNDS {
        let next = average(&places, tracks, rows);
        let known_before = places.iter().flatten().count();
        let change = places
            .iter()
            .zip(&next)
            .filter_map(|(a, b)| Some((a.as_ref()? - b.as_ref()?).norm()));
        let change = change.fold(0.0, f64::max);
        let size = extent(next.iter().flatten());
        let grown = next.iter().flatten().count() > known_before;
        places = next;
        let rounding = change <= ROUNDING * size && change > SHRINKS * before;
        if !grown && (change <= CONVERGED * size || rounding) {
            break;
        }
        before = change;
    }
    places
}

/// Registers the rows on the places known, and averages the markers in the template's frame.
fn average(
    places: &[Option<Point3<f64>>],
    tracks: &[&[Option<Point3<f64>>]],
    rows: &[usize],
) -> Vec<Option<Point3<f64>>> {
    let mut sums: Vec<(Vector3<f64>, usize)> = vec![(Vector3::zeros(), 0); places.len()];
    for &row in rows {
        let pairs = places
            .iter()
            .zip(tracks)
            .filter_map(|(place, track)| Some((*place.as_ref()?, track[row]?)));
        let (from, to): (Vec<_>, Vec<_>) = pairs.unzip();
        let Some(tracker_from_body) = register(&from, &to) else {
            continue;
        };
        for (sum, track) in sums.iter_mut().zip(tracks) {
            if let Some(point) = track[row] {
                sum.0 += tracker_from_body.inverse_transform_point(&point).coords;
                sum.1 += 1;
            }
        }
    }
    sums.iter()
        .zip(places)
        .map(|((sum, n), place)| {
            if *n > 0 {
                Some(Point3::from(sum / *n as f64))
            } else {
                *place
            }
        })
        .collect()
}

/// `b_from_a` if the points determine it.
pub(super) fn register(a: &[Point3<f64>], b: &[Point3<f64>]) -> Option<Isometry3<f64>> {
    if a.len() < 3 {
        return None;
    }
    let (along, across) = spread(a);
    if along < MIN_EXTENT || across < MIN_SPREAD_RATIO * along {
        return None;
    }
    rigid_registration(a, b, None)
        .ok()
        .map(|registration| registration.b_from_a)
}

/// Root mean square extent along and across the best line through the points, m.
pub(super) fn spread(points: &[Point3<f64>]) -> (f64, f64) {
    let n = points.len().max(1) as f64;
    let center: Vector3<f64> = points
        .iter()
        .map(|point| point.coords)
        .sum::<Vector3<f64>>()
        / n;
    let scatter: Matrix3<f64> = points
        .iter()
        .map(|point| {
            let d = point.coords - center;
            d * d.transpose()
        })
        .sum::<Matrix3<f64>>()
        / n;
    let values = symmetric_eigen_small(&scatter).values;
    (values[2].max(0.0).sqrt(), values[1].max(0.0).sqrt())
}

fn extent<'a>(points: impl Iterator<Item = &'a Point3<f64>>) -> f64 {
    let points: Vec<_> = points.copied().collect();
    spread(&points).0
}
