//! Several joints that count the other way: a reversed joint can look like another one, and two reversed joints like a third.
//!
//! The structural hypotheses name the single mistake that explains the recordings best. Where it leaves more than errors of a nominal robot explain,
//! all pairs of reversed joints are compared with it: a pair that leaves clearly less is taken, and what explains the recordings about as well is said.

use calib_checks::structural::{
    Chain, Correction, Data, Hypothesis, JointIndex, Scope, Scoped, apply_all,
    registration_residual, thin,
};
use calib_urdf::{JointId, LinkId};

use crate::fact::Residuals;
use crate::links::{Assigned, Scene};

/// Rows that the pairs are compared on.
const ROWS: usize = 150;
/// Residuals within this factor do not decide between patterns of signs.
const SAME: f64 = 1.5;

/// Reversed joints, and the residual that is left, rms, m.
#[derive(Debug, Clone, PartialEq)]
pub struct Pattern {
    /// The corrections.
    pub correction: Correction,
    /// The residual.
    pub rms: f64,
}

/// What the signs of up to two joints explain.
#[derive(Debug, Clone, PartialEq)]
pub struct Signs {
    /// The pattern that leaves least.
    pub best: Pattern,
    /// Others that leave about as little.
    pub others: Vec<Pattern>,
    /// What the best pattern leaves that is none of these; `None`: there is no other.
    pub next: Option<f64>,
    /// What is left without a correction.
    pub none: f64,
}

/// Whether a correction is about signs alone.
#[must_use]
pub fn is_of_signs(correction: &Correction) -> bool {
    let is_sign = |scoped: &Scoped| matches!(scoped.hypothesis, Hypothesis::Sign { .. });
    correction.iter().all(is_sign)
}

/// The best pattern of one or two reversed joints.
#[must_use]
pub fn search(scene: &Scene<'_>, assigned: &Assigned) -> Option<Signs> {
    let chain = Chain::from_model(scene.model).ok()?;
    let of = |on: &Vec<(usize, LinkId)>| thin(&scene.data(&chain, on), ROWS);
    let data: Vec<Data> = places(scene, assigned).iter().map(of).collect();
    // A reversed joint makes the choice of the link wrong as well.
    let least = |correction: &[Scoped]| -> Option<f64> {
        let left = data.iter().map(|d| apply_all(correction, d));
        let left = left.filter_map(|d| registration_residual(&d).ok());
        left.min_by(f64::total_cmp)
    };
    let none = least(&[])?;
    let sign = |joint: &JointId| Scoped {
        hypothesis: Hypothesis::Sign {
            joint: JointIndex::from(*joint),
        },
        scope: Scope::All,
    };
    let moving: Vec<Scoped> = scene.moving().iter().map(sign).collect();
    let single = moving.iter().map(|s| vec![*s]);
    let pairs = moving.iter().enumerate();
    let pairs = pairs.flat_map(|(i, a)| {
        let later = &moving[i + 1..];
        later.iter().map(move |b| vec![*a, *b])
    });
    let mut all: Vec<Pattern> = single
        .chain(pairs)
        .filter_map(|correction| {
            let rms = least(&correction)?;
            Some(Pattern { correction, rms })
        })
        .collect();
    // The fewer joints come first where both leave the same.
    all.sort_by(|a, b| {
        let by_rms = a.rms.total_cmp(&b.rms);
        by_rms.then(a.correction.len().cmp(&b.correction.len()))
    });
    let mut all = all.into_iter();
    let best = all.next()?;
    let (others, rest): (Vec<Pattern>, Vec<Pattern>) =
        all.partition(|pattern| pattern.rms < SAME * best.rms);
    Some(Signs {
        next: rest.first().map(|pattern| pattern.rms),
        best,
        others,
        none,
    })
}

/// The assignment, and it with each body at the end of each chain.
fn places(scene: &Scene<'_>, assigned: &Assigned) -> Vec<Vec<(usize, LinkId)>> {
    let mut all = vec![assigned.on.clone()];
    for tip in scene.recorded_tips() {
        for at in 0..assigned.on.len() {
            let mut on = assigned.on.clone();
            on[at].1 = tip;
            if !all.contains(&on) {
                all.push(on);
            }
        }
    }
    all
}

impl Signs {
    /// What the best pattern explains, where errors of a nominal robot explain `limit`, m.
    #[must_use]
    pub fn residuals(&self, limit: Option<f64>) -> Residuals {
        Residuals {
            none: self.none,
            best: self.best.rms,
            next: self.next,
            over: limit.filter(|limit| self.best.rms > *limit),
        }
    }

    /// The patterns that leave about as much as another correction does.
    #[must_use]
    pub fn like(&self, rms: f64) -> Vec<Correction> {
        let all = std::iter::once(&self.best).chain(&self.others);
        let near = all.filter(|pattern| pattern.rms < SAME * rms);
        near.map(|pattern| pattern.correction.clone()).collect()
    }

    /// It leaves clearly less than another correction does.
    #[must_use]
    pub fn is_better_than(&self, rms: f64) -> bool {
        SAME * self.best.rms < rms
    }
}
