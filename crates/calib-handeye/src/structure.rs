//! Structural mistakes of two tables of poses: each is corrected, fitted, and named where the correction explains the residuals.
//!
//! ```text
//! score = ½ ln rms_t/s + ½ ln rms_r       over the three quarters of the poses that fit best                (7)
//! ```
//!
//! s is the factor that the correction puts on the measured positions: without it, small numbers would fit everything. A correction is
//! named where it lowers the geometric mean of both residuals by [`NAMED`] and what is left is plausible; others within
//! [`ALIKE`] of it are named beside it. That poses are inverted is named only where the poses show their direction ([`crate::direction`]).
//!
//! Exact equivalents: inverted poses of the one side and of the other (X and Z change places); millimeters on one side, and a factor of
//! thousand on the other. Two swapped sides, and inverted poses on both, fit as well as none: X and Z come out as each other's inverse, or
//! in each other's place, and no residual shows it.

use calib_estimator::Verdict;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::{
    correction::{Correction, Explanation, Side},
    direction::{self, EXACT, OpenDirection},
    judge,
    minimum::{Minimum, minimized},
    outcome::HandEye,
    problem::{HandEyeWeights, Weights},
    residuals::{Residuals, spread, squares},
};

/// Ratio of scores from which a correction is named: clean recordings do not reach 1.33.
const NAMED: f64 = 1.5;
/// Ratio of scores within which corrections are not distinguishable.
const ALIKE: f64 = 1.1;
/// Single corrections to which a second one is added.
const BEAM: usize = 6;
/// Poses that score a correction; more would not rank them better.
const SCORED: usize = 60;
/// Part of the poses that scores: gross errors of single rows must not hide a mistake of all.
const SCORING: f64 = 0.75;
/// Poses from which three quarters determine the fit.
const ENOUGH: usize = 8;

/// All single corrections.
fn singles() -> Vec<Correction> {
    let sides = [Side::Robot, Side::Measured, Side::Both];
    let one = [Side::Robot, Side::Measured];
    let mut all: Vec<Correction> = Vec::new();
    all.extend(sides.map(Correction::ScalarFirst));
    all.extend(sides.map(Correction::ScalarLast));
    all.extend(sides.map(Correction::InvertedRotations));
    all.extend(one.map(Correction::InvertedPoses));
    all.extend(one.map(Correction::Millimeters));
    all.extend(one.map(Correction::Thousandth));
    all.extend([1, -1].map(Correction::Rows));
    all
}

/// Both tables, corrected or not.
#[derive(Clone)]
struct Tables {
    robot: Vec<Isometry3<f64>>,
    measured: Vec<Isometry3<f64>>,
    /// Factor on the measured positions.
    scale: f64,
    /// The measured poses are used inverted: mistakes of the file are corrected before.
    inverted: bool,
}

impl Tables {
    fn measured_as_used(&self) -> Vec<Isometry3<f64>> {
        match self.inverted {
            true => self.measured.iter().map(Isometry3::inverse).collect(),
            false => self.measured.clone(),
        }
    }
}

impl Correction {
    fn apply(self, tables: &Tables) -> Tables {
        let mut out = tables.clone();
        let on = |out: &mut Tables, side: Side, f: &dyn Fn(&Isometry3<f64>) -> Isometry3<f64>| {
            if side != Side::Measured {
                out.robot.iter_mut().for_each(|p| *p = f(p));
            }
            if side != Side::Robot {
                out.measured.iter_mut().for_each(|p| *p = f(p));
            }
        };
        match self {
            Self::ScalarFirst(side) => on(&mut out, side, &|p| {
                let q = p.rotation.coords;
                turned(p, Quaternion::new(q.x, q.y, q.z, q.w))
            }),
            Self::ScalarLast(side) => on(&mut out, side, &|p| {
                let q = p.rotation.coords;
                turned(p, Quaternion::new(q.z, q.w, q.x, q.y))
            }),
            Self::InvertedRotations(side) => on(&mut out, side, &|p| {
                Isometry3::from_parts(p.translation, p.rotation.inverse())
            }),
            Self::InvertedPoses(side) => on(&mut out, side, &Isometry3::inverse),
            Self::Millimeters(side) => scaled(&mut out, side, 1e-3, on),
            Self::Thousandth(side) => scaled(&mut out, side, 1e3, on),
            // Fitted, not tried.
            Self::Scaled(_) | Self::BodyMoved(_) | Self::TrackerMoved(_) => {}
            Self::Rows(by) => {
                let n = out.robot.len();
                let by_rows = usize::from(by.unsigned_abs()).min(n);
                let (first, last) = (by_rows, n - by_rows);
                if by > 0 {
                    out.robot.truncate(last);
                    out.measured.drain(..first);
                } else {
                    out.robot.drain(..first);
                    out.measured.truncate(last);
                }
            }
        }
        out
    }
}

fn turned(p: &Isometry3<f64>, q: Quaternion<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(p.translation, UnitQuaternion::new_normalize(q))
}

fn scaled(
    out: &mut Tables,
    side: Side,
    by: f64,
    on: impl Fn(&mut Tables, Side, &dyn Fn(&Isometry3<f64>) -> Isometry3<f64>),
) {
    on(out, side, &|p| {
        Isometry3::from_parts(Translation3::from(p.translation.vector * by), p.rotation)
    });
    if side != Side::Robot {
        out.scale *= by;
    }
}

/// Corrections with their score (7).
#[derive(Clone)]
struct Scored {
    corrections: Vec<Correction>,
    tables: Tables,
    score: f64,
    residuals: Residuals,
    /// Poses behind them.
    rows: usize,
}

/// What the tables say of how they were written.
pub(crate) struct Structure {
    /// The corrections that explain the residuals, where some do.
    pub explanation: Option<Explanation>,
    /// The measured poses fit inverted as well.
    pub open_direction: Option<OpenDirection>,
}

fn scored(corrections: Vec<Correction>, tables: Tables, w: Weights) -> Option<Scored> {
    let stride = tables.robot.len().div_ceil(SCORED).max(1);
    let some = |poses: &[Isometry3<f64>]| -> Vec<Isometry3<f64>> {
        poses.iter().step_by(stride).copied().collect()
    };
    let (a, b) = (some(&tables.robot), some(&tables.measured_as_used()));
    if a.len() < 3 || crate::input::check_axes(&a).is_err() {
        return None;
    }
    let squares_of = |found: &Minimum| -> Vec<[f64; 2]> {
        let pairs = a.iter().zip(&b);
        pairs
            .map(|(a, b)| squares(a, b, &found.x, &found.z))
            .collect()
    };
    let mut of_rows = squares_of(&minimized(&a, &b, w));
    let mut rows: Vec<usize> = (0..a.len()).collect();
    let best = if a.len() < ENOUGH {
        a.len()
    } else {
        (SCORING * a.len() as f64).ceil() as usize
    };
    for _ in 0..3 {
        if best == a.len() {
            break;
        }
        let cost = |i: usize| w.translation * of_rows[i][0] + 2.0 * w.rotation * of_rows[i][1];
        rows = (0..a.len()).collect();
        rows.sort_by(|i, j| cost(*i).total_cmp(&cost(*j)));
        rows.truncate(best);
        let chosen = |poses: &[Isometry3<f64>]| -> Vec<Isometry3<f64>> {
            rows.iter().map(|&i| poses[i]).collect()
        };
        of_rows = squares_of(&minimized(&chosen(&a), &chosen(&b), w));
    }
    let rms = |k: usize| {
        let sum: f64 = rows.iter().map(|&i| of_rows[i][k]).sum();
        (sum / rows.len() as f64).sqrt()
    };
    let residuals = Residuals {
        rms_translation: rms(0),
        rms_rotation: rms(1),
    };
    let of_positions = (residuals.rms_translation / tables.scale).max(EXACT);
    let score = 0.5 * of_positions.ln() + 0.5 * residuals.rms_rotation.max(EXACT).ln();
    score.is_finite().then_some(Scored {
        corrections,
        tables,
        score,
        residuals,
        rows: rows.len(),
    })
}

/// What explains the residuals, and whether the direction shows. `plausible` judges what is left, and its tables.
pub(crate) fn structure(
    robot: &[Isometry3<f64>],
    measured: &[Isometry3<f64>],
    w: Weights,
    plausible: impl Fn(&Residuals, &[Isometry3<f64>], &[Isometry3<f64>]) -> bool,
) -> Structure {
    let given = Tables {
        robot: robot.to_vec(),
        measured: measured.to_vec(),
        scale: 1.0,
        inverted: false,
    };
    of(given, w, plausible)
}

/// An answer in doubt, explained by the table of measured poses as it was written, if that is used inverted (where a camera states a board's
/// poses): an order of quaternions is that of the file.
#[must_use]
pub fn explained_as_written(
    found: &HandEye,
    robot: &[Isometry3<f64>],
    written: &[Isometry3<f64>],
) -> HandEye {
    let mut out = found.clone();
    if out.verdict == Verdict::Ok || out.explanation.is_some() {
        return out;
    }
    let given = Tables {
        robot: robot.to_vec(),
        measured: written.to_vec(),
        scale: 1.0,
        inverted: true,
    };
    let w = Weights::of(HandEyeWeights::default());
    let plausible = |left: &Residuals, a: &[Isometry3<f64>], b: &[Isometry3<f64>]| {
        judge::plausible(left, [spread(a), spread(b)])
    };
    out.explanation = of(given, w, plausible).explanation;
    if let Some(reason) = judge::structural(&out) {
        out.reason = Some(reason);
    }
    out
}

fn of(
    given: Tables,
    w: Weights,
    plausible: impl Fn(&Residuals, &[Isometry3<f64>], &[Isometry3<f64>]) -> bool,
) -> Structure {
    let Some(none) = scored(Vec::new(), given, w) else {
        return Structure {
            explanation: None,
            open_direction: None,
        };
    };
    let passes =
        |s: &Scored| plausible(&s.residuals, &s.tables.robot, &s.tables.measured_as_used());
    let added = |to: &Scored| -> Vec<Scored> {
        let mut found: Vec<Scored> = singles()
            .into_iter()
            .filter(|c| !to.corrections.contains(c))
            .filter_map(|c| {
                let corrections = [to.corrections.as_slice(), &[c]].concat();
                scored(corrections, c.apply(&to.tables), w)
            })
            .collect();
        found.sort_by(|a, b| a.score.total_cmp(&b.score));
        found
    };
    // Of those that leave something plausible the best, and those that are not distinguishable from it.
    let explaining = |mut found: Vec<Scored>| -> Vec<Scored> {
        found.retain(|s| {
            passes(s) && none.score - s.score >= NAMED.ln() && shows_its_direction(&none, s, w)
        });
        let limit = found.first().map_or(0.0, |best| best.score + ALIKE.ln());
        found.retain(|s| s.score <= limit);
        found
    };
    let singles = added(&none);
    let open_direction = open_direction(&none, singles.iter().filter(|s| passes(s)));
    let mut found = explaining(singles.clone());
    if found.is_empty() && !passes(&none) {
        let mut pairs: Vec<Scored> = singles.iter().take(BEAM).flat_map(added).collect();
        pairs.sort_by(|a, b| a.score.total_cmp(&b.score));
        found = explaining(pairs);
    }
    Structure {
        explanation: explanation(&none, found),
        open_direction,
    }
}

/// Whether the poses show that a correction inverts them rightly; `true` of one that does not invert them.
fn shows_its_direction(none: &Scored, s: &Scored, w: Weights) -> bool {
    let inverts = |c: &Correction| matches!(c, Correction::InvertedPoses(_));
    if !s.corrections.iter().any(inverts) {
        return true;
    }
    let others = s.corrections.iter().filter(|c| !inverts(c));
    let others: Vec<Correction> = others.copied().collect();
    let tables = others.iter().fold(none.tables.clone(), |t, c| c.apply(&t));
    scored(others, tables, w)
        .is_none_or(|other| direction::shown(&s.residuals, &other.residuals, s.rows))
}

/// What the measured poses leave inverted, unless those as used leave less by more than chance. `plausible`: single corrections.
fn open_direction<'a>(
    none: &Scored,
    mut plausible: impl Iterator<Item = &'a Scored>,
) -> Option<OpenDirection> {
    let inverted =
        plausible.find(|s| s.corrections == [Correction::InvertedPoses(Side::Measured)])?;
    let open = OpenDirection {
        as_used: none.residuals,
        inverted: inverted.residuals,
    };
    (!direction::shown(&open.as_used, &open.inverted, none.rows)).then_some(open)
}

/// The corrections that were found, best first, each once.
fn explanation(none: &Scored, found: Vec<Scored>) -> Option<Explanation> {
    let after = found.first()?.residuals;
    let mut candidates: Vec<Vec<Correction>> = Vec::new();
    for s in found {
        // The same two in the other order are no other explanation.
        let known = |c: &Vec<Correction>| {
            c.len() == s.corrections.len() && s.corrections.iter().all(|x| c.contains(x))
        };
        if !candidates.iter().any(known) {
            candidates.push(s.corrections);
        }
    }
    Some(Explanation {
        candidates,
        before: none.residuals,
        after,
    })
}
