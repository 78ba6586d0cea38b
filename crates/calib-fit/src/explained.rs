//! Whether one axis or center explains the motion at all.
//!
//! ```text
//! s² = Σ |x − x̄|² / (3n),   q = rms / s                                                                (1)
//! ```
//!
//! x: places of a marker, over the rows that were not rejected; for poses, those of the body's origin and of three points 100 mm from it along
//! its axes; s: spread of the motion, one coordinate; rms: that of the estimate's residuals, one coordinate. With a stated noise σ of one
//! coordinate (of stated covariances their mean), an answer is refused where
//!
//! ```text
//! rms > 3 σ   and   q > 0.2,   or   rms > 10 σ   and   q > 0.05                                          (2)
//! ```
//!
//! and without one where q > 0.2. Where two or more markers of one body are known, their distances show the noise ([`crate::marker_noise`]), and
//! residuals far beyond it are refused as well. Random postures of an arm leave q of 0.25 to 0.7; a sweep of a joint with millimeters of backlash, below 0.05.

use nalgebra::{Matrix3, Point3, Vector3};

use calib_cor::Pose;
use calib_estimator::Verdict;

use crate::TableRequest;
use crate::marker_noise::{About, LIMIT, MarkerNoise, marker_noise};
use crate::table::Table;

/// Residuals above this part of the motion are not noise about an axis or a center, unless so large a noise is stated.
const UNEXPLAINED: f64 = 0.2;
/// The same, where the residuals are far beyond what is stated.
const BEYOND_NOISE: f64 = 0.05;
/// Residuals up to this multiple of a stated noise are that noise: those of poses hold the orientation's share as well.
const STATED: f64 = 3.0;
/// Residuals above this multiple of a stated noise are no underestimate of it.
const FAR_BEYOND: f64 = 10.0;
/// Points that stand for a body without markers, m from its origin.
const LEVER: f64 = 0.1;

/// Residuals that are no noise about an axis or a center.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Unexplained {
    /// Residuals, rms, m.
    rms: f64,
    /// Spread of the motion, rms of one coordinate, m.
    spread: f64,
    /// Largest part of it that residuals may have.
    limit: f64,
    /// Noise that was stated, m.
    stated: Option<f64>,
}

/// What the data as a whole say of an axis or a center.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Against {
    unexplained: Option<Unexplained>,
    /// The noise that the markers' distances show.
    pub noise: Option<MarkerNoise>,
}

impl Against {
    /// Why there is no such axis or center. `what`: axis or center.
    pub fn reason(&self, what: &str) -> Option<String> {
        let refuted = self.noise.filter(|n| n.refuted);
        let of_noise = || refuted.map(|n| n.reason(what));
        self.unexplained.map(|u| u.reason(what)).or_else(of_noise)
    }

    /// The end of an answer's first line, before the estimate; empty where nothing speaks against it.
    fn head(&self, what: &str) -> String {
        let Some(reason) = self.reason(what) else {
            return String::new();
        };
        let remedy = match self.unexplained {
            Some(u) => u.remedy(what),
            None => format!(
                "{} Axes that do not meet, backlash and a base that moves leave such residuals.",
                recording(what)
            ),
        };
        format!(" {reason}\n  help: {remedy}\n  the best fit nevertheless:")
    }

    /// The line on residuals that are more than noise and refute nothing.
    pub fn note(&self) -> String {
        let noted = self.noise.filter(|n| n.is_exceeded() && !n.refuted);
        noted.map_or_else(String::new, |n| {
            format!(
                "  noise: the residuals are {:.1} times the noise of {:.3} mm that the distances of the markers show; sigma follows the residuals\n",
                n.ratio,
                n.sigma_m * 1e3
            )
        })
    }
}

impl MarkerNoise {
    fn reason(&self, what: &str) -> String {
        format!(
            "no single {what} explains the points: the residuals of {:.2} mm are {:.1} times the noise of {:.2} mm that the distances of the \
             markers show (limit {:.1} times)",
            self.residual_m * 1e3,
            self.ratio,
            self.sigma_m * 1e3,
            self.of_sight.max(LIMIT)
        )
    }
}

fn recording(what: &str) -> &'static str {
    match what {
        "axis" => {
            "Record a sweep of one joint with all others at rest, or give both sides of the joint with --parent and --child."
        }
        _ => {
            "Record a motion about one center, or give both sides of the joint with --parent and --child."
        }
    }
}

impl Unexplained {
    /// `what`: axis or center.
    fn reason(&self, what: &str) -> String {
        let mm = |x: f64| x * 1e3;
        let stated = self.stated.map_or_else(String::new, |s| {
            format!(", and {:.0} times the stated noise", self.rms / s)
        });
        format!(
            "no single {what} explains the points: the residuals of {:.2} mm rms are {:.0} % of their motion of {:.2} mm rms (limit {:.0} %){stated}",
            mm(self.rms),
            100.0 * self.rms / self.spread,
            mm(self.spread),
            100.0 * self.limit
        )
    }

    /// What to do.
    fn remedy(&self, what: &str) -> String {
        let recording = recording(what);
        match self.stated {
            None => format!(
                "{recording} If the tracker is that noisy, state its noise with --sigma-mm."
            ),
            Some(_) => recording.to_owned(),
        }
    }
}

/// An estimate as it is judged, with what the data as a whole say against it.
pub(crate) struct Judged {
    pub verdict: Verdict,
    /// Why it is not good.
    pub reason: Option<String>,
    /// What stands before the estimate in the answer's first line, with a space; empty where nothing does.
    pub head: String,
}

impl Judged {
    /// `what`: axis or center.
    pub fn new(own: (Verdict, Option<&str>), against: &Against, what: &str) -> Self {
        match against.reason(what) {
            Some(reason) => Self {
                verdict: Verdict::Weak,
                reason: Some(reason),
                head: against.head(what),
            },
            None => Self {
                verdict: own.0,
                reason: own.1.map(str::to_owned),
                head: String::new(),
            },
        }
    }

    pub fn is_observable(&self) -> bool {
        self.verdict == Verdict::Ok
    }
}

/// What the data say of an estimate with residuals of `rms`, m. `rejected`: numbers of the rows in the table's file.
pub(crate) fn against(
    request: &TableRequest,
    table: &Table,
    about: About,
    rms: f64,
    rejected: &[u64],
) -> Against {
    // A stated noise may be one that all markers of a body share.
    let is_stated = |n: &MarkerNoise| {
        let stated = request.sigma_m.unwrap_or(0.0);
        !table.covariances.is_empty() || n.residual_m <= STATED * stated
    };
    Against {
        unexplained: unexplained(request, table, rms, rejected),
        noise: marker_noise(table, rejected, about).filter(|n| !is_stated(n)),
    }
}

/// (2).
fn unexplained(
    request: &TableRequest,
    table: &Table,
    rms: f64,
    rejected: &[u64],
) -> Option<Unexplained> {
    let spread = spread(table, rejected);
    let stated = mean_noise(&table.covariances).or(request.sigma_m);
    let limit = match stated.map(|s| rms / s) {
        Some(times) if times <= STATED => return None,
        Some(times) if times > FAR_BEYOND => BEYOND_NOISE,
        _ => UNEXPLAINED,
    };
    (rms > limit * spread).then_some(Unexplained {
        rms,
        spread,
        limit,
        stated,
    })
}

/// One coordinate's noise of stated covariances, m.
fn mean_noise(covariances: &[Vec<Matrix3<f64>>]) -> Option<f64> {
    let all = covariances.iter().flatten();
    let (sum, n) = all.fold((0.0, 0.0), |(s, n), c| (s + c.trace() / 3.0, n + 1.0));
    (n > 0.0).then(|| f64::sqrt(sum / n))
}

/// (1).
fn spread(table: &Table, rejected: &[u64]) -> f64 {
    let tracks = match (&table.pair, &table.body) {
        (Some([parent, child]), _) => {
            let child_in_parent = parent.iter().zip(child).map(|(parent, child)| {
                let (parent, child) = (parent.as_ref()?, child.as_ref()?);
                let parent_from_world = parent.rotation.transpose();
                Some(Pose {
                    rotation: parent_from_world * child.rotation,
                    translation: parent_from_world * (child.translation - parent.translation),
                })
            });
            points_of(&child_in_parent.collect::<Vec<_>>())
        }
        (None, Some(body)) if table.origin_only => points_of(body),
        _ => table.tracks(),
    };
    let (mut squares, mut count) = (0.0, 0);
    for track in &tracks {
        let rows = track.iter().zip(&table.rows);
        let used: Vec<&Point3<f64>> = rows
            .filter(|(_, row)| !rejected.contains(row))
            .filter_map(|(point, _)| point.as_ref())
            .collect();
        let mean = used.iter().map(|p| p.coords).sum::<Vector3<f64>>() / used.len().max(1) as f64;
        squares += used
            .iter()
            .map(|p| (p.coords - mean).norm_squared())
            .sum::<f64>();
        count += used.len();
    }
    f64::sqrt(squares / (3 * count.max(1)) as f64)
}

/// Its origin and a point on each axis.
fn points_of(body: &[Option<Pose>]) -> Vec<Vec<Option<Point3<f64>>>> {
    let points = [
        Vector3::zeros(),
        Vector3::x() * LEVER,
        Vector3::y() * LEVER,
        Vector3::z() * LEVER,
    ];
    let place = |pose: &Pose, p: &Vector3<f64>| Point3::from(pose.rotation * p + pose.translation);
    points
        .iter()
        .map(|p| {
            body.iter()
                .map(|b| b.as_ref().map(|b| place(b, p)))
                .collect()
        })
        .collect()
}
