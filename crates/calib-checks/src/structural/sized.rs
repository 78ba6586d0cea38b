//! Mistakes of one joint that have a size of their own, larger than errors of a nominal robot: a zero that is off by any angle or length, where an
//! encoder was mounted or homed otherwise; readings that are a multiple of the motion, where the gear or the counts of a turn are others; and a
//! fraction of another joint's motion, as of belts and parallel links.
//!
//! ```text
//! size = argmin f(reading_j + size),    argmin f(size · reading_j),    argmin f(reading_j + size · reading_i)
//!                                                     f: the residual of the registration, per joint and, of the first two, scope
//! ```
//!
//! A fit that estimates the zeros finds such an offset, too; here it is asked whether it is the whole of what is wrong.

use std::f64::consts::{FRAC_PI_2, PI};

use rayon::prelude::*;

use super::Options;
use super::candidates::{Candidate, everywhere, span};
use super::data::Data;
use super::hypothesis::{Hypothesis, Scope};
use super::ids::{JointIndex, SampleIndex};
use super::scan::Scan;

/// Places of the whole turn where the search of a zero starts; it goes on between the neighbors of the best.
const TURN_STARTS: usize = 24;
/// Half the length that is searched for a joint that slides, m.
const STROKE: f64 = 0.6;
/// The largest gain, and the inverse of the least.
const LARGEST_GAIN: f64 = 32.0;
/// Gains between its inverse and it where the search starts.
const GAIN_STARTS: usize = 40;
/// Steps of the search: the range shrinks to 0.62 of itself in each.
const STEPS: usize = 18;
/// An offset within this of one or two quarter turns, rad, is taken for these.
const NEAR_QUARTER: f64 = 0.17;
/// An offset of less than so many σ of the priors is an error of the nominal robot.
const BEYOND_PRIOR: f64 = 2.0;
/// Logarithm of the least gain that is asked here: smaller ones are linear enough for a score test.
const LEAST_GAIN: f64 = 0.1;

/// Readings that differ by less, rad or m, are of a joint that stands.
const STANDS: f64 = 0.01;
/// The largest share of another joint's motion.
const LARGEST_SHARE: f64 = 2.0;
/// Shares between its opposite and it where the search starts.
const SHARE_STARTS: usize = 20;
/// The least share that is asked here, and the distance from those of ±1, which are hypotheses of their own.
const LEAST_SHARE: f64 = 0.05;

/// What has a size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Zero,
    Gain,
    Share { source: JointIndex },
}

impl Kind {
    /// The hypothesis of a size: rad or m, or the logarithm of a gain.
    fn hypothesis(self, joint: JointIndex, size: f64) -> Hypothesis {
        match self {
            Self::Zero => Hypothesis::Zero {
                joint,
                offset: size,
            },
            Self::Gain => Hypothesis::Gain {
                joint,
                factor: size.exp(),
            },
            Self::Share { source } => Hypothesis::Coupling {
                joint,
                source,
                factor: size,
            },
        }
    }

    /// The sizes where the search starts, and the distance between them.
    fn starts(self, data: &Data, joint: JointIndex) -> (Vec<f64>, f64) {
        let (half, count) = match self {
            Self::Zero if data.chain.turns(joint.0) == Some(false) => (STROKE, TURN_STARTS),
            Self::Zero => (PI, TURN_STARTS),
            Self::Gain => (LARGEST_GAIN.ln(), GAIN_STARTS),
            Self::Share { .. } => (LARGEST_SHARE, SHARE_STARTS),
        };
        let step = 2.0 * half / count as f64;
        let starts = (0..count).map(|k| -half + step * k as f64);
        (starts.collect(), step)
    }

    /// Whether a size is more than an error of a nominal robot, and not a quarter turn, which is a hypothesis of its own.
    fn plausible(self, data: &Data, joint: JointIndex, size: f64, options: &Options) -> bool {
        match (self, data.chain.turns(joint.0) == Some(true)) {
            (Self::Zero, true) => {
                let quarters = (size / FRAC_PI_2).round();
                let near = (size - quarters * FRAC_PI_2).abs() < NEAR_QUARTER;
                size.abs() > BEYOND_PRIOR * options.prior_angle && (quarters == 0.0 || !near)
            }
            (Self::Zero, false) => size.abs() > BEYOND_PRIOR * options.prior_length,
            (Self::Gain, _) => (LEAST_GAIN..LARGEST_GAIN.ln()).contains(&size.abs()),
            (Self::Share { .. }, _) => {
                let share = size.abs();
                (LEAST_SHARE..LARGEST_SHARE).contains(&share) && (share - 1.0).abs() > LEAST_SHARE
            }
        }
    }
}

/// For each joint that moves, the zero, the gain and the shares of others' motion that leave least, and the first two in a part of the data, where they leave
/// clearly less.
pub(super) fn of_sizes(data: &Data, screened: &[SampleIndex], options: &Options) -> Vec<Candidate> {
    let scan = Scan::new(data, screened);
    let joints = data.relevant_joints().into_iter();
    let moving = joints.filter(|j| data.chain.turns(j.0).is_some() && span(data, *j) > 1e-6);
    let scopes = everywhere(data);
    let moving: Vec<JointIndex> = moving.collect();
    let alone = moving
        .iter()
        .flat_map(|joint| [(Kind::Zero, *joint), (Kind::Gain, *joint)])
        .flat_map(|(kind, joint)| scopes.iter().map(move |scope| (kind, joint, *scope)));
    let limbs: Vec<Vec<JointIndex>> = (data.bodies.iter())
        .map(|body| data.chain.readings_of(body.link))
        .collect();
    // Belts and parallel links are within a limb.
    let alike = &|joint: JointIndex, source: JointIndex| {
        let mut limbs = limbs.iter();
        let one = limbs.any(|limb| limb.contains(&joint) && limb.contains(&source));
        one && joint != source && data.chain.turns(source.0) == data.chain.turns(joint.0)
    };
    let pairs = moving.iter().flat_map(|&joint| {
        let sources = moving.iter().filter(move |s| alike(joint, **s));
        sources.map(move |source| (Kind::Share { source: *source }, joint, Scope::All))
    });
    let tells = |(kind, joint, scope): &(Kind, JointIndex, Scope)| {
        // Of a joint that stands, any gain is a place.
        *kind != Kind::Gain || moves_within(data, *joint, *scope)
    };
    let asked: Vec<(Kind, JointIndex, Scope)> = alone.filter(tells).chain(pairs).collect();
    let found: Vec<Found> = asked
        .into_par_iter()
        .map(|(kind, joint, scope)| best(&scan, kind, joint, scope))
        .collect();
    let everywhere = |kind: Kind, joint: JointIndex| {
        let all = |f: &&Found| f.kind == kind && f.joint == joint && f.scope == Scope::All;
        found.iter().find(all).map_or(f64::INFINITY, |f| f.left)
    };
    let kept = found.iter().filter(|f| {
        let part = f.scope != Scope::All;
        let clearly = !part || everywhere(f.kind, f.joint) > options.name_ratio * f.left;
        clearly && f.kind.plausible(data, f.joint, f.size, options)
    });
    kept.map(|f| (f.kind.hypothesis(f.joint, f.size), vec![f.scope]))
        .collect()
}

/// Whether the readings of a joint differ within the rows of a scope.
fn moves_within(data: &Data, joint: JointIndex, scope: Scope) -> bool {
    let rows = data.readings.iter().zip(&data.recording);
    let within = rows.filter(|(_, recording)| scope.contains(**recording));
    let readings: Vec<f64> = within.filter_map(|(row, _)| row[joint.0]).collect();
    let least = readings.iter().copied().fold(f64::INFINITY, f64::min);
    readings.iter().any(|q| q - least > STANDS)
}

/// The candidates with the sizes of other data.
pub(super) fn again(
    candidates: &[Candidate],
    data: &Data,
    screened: &[SampleIndex],
    options: &Options,
) -> Vec<Candidate> {
    let others = candidates.iter().filter(|c| !c.0.is_sized()).cloned();
    others.chain(of_sizes(data, screened, options)).collect()
}

/// A size with what it leaves, m.
struct Found {
    kind: Kind,
    joint: JointIndex,
    scope: Scope,
    left: f64,
    size: f64,
}

/// The least residual and its size, by golden-section search from the best of a grid.
fn best(scan: &Scan<'_>, kind: Kind, joint: JointIndex, scope: Scope) -> Found {
    let left = |size: f64| {
        let scored = scan.score(&kind.hypothesis(joint, size), &[scope], f64::INFINITY);
        scored.first().map_or(f64::INFINITY, |s| s.score.score)
    };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (starts, step) = kind.starts(scan.data, joint);
    let start = starts
        .into_iter()
        .map(|size| (left(size), size))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(0.0, |best| best.1);
    let (mut low, mut high) = (start - step, start + step);
    for _ in 0..STEPS {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if left(a) < left(b) {
            high = b;
        } else {
            low = a;
        }
    }
    let size = 0.5 * (low + high);
    Found {
        kind,
        joint,
        scope,
        left: left(size),
        size,
    }
}
