//! Does the model explain the data, and if not, which physics is missing?
//!
//! For an effect with coefficient c that is not in the model, a = ∂e/∂c:
//!
//! ```text
//! U = Σ_s aᵀ V⁻¹ e,   I = Σ_s aᵀV⁻¹a − bᵀ C b,   b = Σ_s JᵀV⁻¹a                             (1)
//! ĉ = −U / I,   z² = U² / max(I, m Σ_s u_s²)  ~  χ²(1) if c = 0 (Rao's score test)          (2)
//! ```
//!
//! No refit is needed. `Σ u_s²` (u_s the sample's own share of U once parameters and effect are fitted) is the
//! variance that samples as clusters show: correlated residuals inside a sample cannot fake significance. Nor can
//! those of successive samples: m is how much more their sums scatter (`successive`). If the stated noise is too small, z² is divided by χ²/dof.

mod columns;
mod directions;
mod memory;
mod profile;

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::analysis::bends::Bend;
use crate::analysis::looked_at::LookedAt;
use crate::analysis::score::Scored;
use crate::analysis::solution::Solution;
use crate::analysis::successive::clustered;
use crate::graph::edge::EdgeKind;
use crate::graph::effect::{Drives, EFFECTS, EffectKind, Source};
use crate::graph::ids::EdgeId;
use crate::model::layout::Model;
use crate::solve::equations::NormalEquations;
use crate::solve::normal::add_prior;
use crate::solve::whitened::covariance_of;
use columns::Seen;

/// What a score test asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Physics {
    /// An effect of a joint; [`EffectKind::ClockOffset`] of all joints of a recording together.
    Effect(EffectKind),
    /// A drift of the measuring frame along one of its axes, over time.
    Drift,
}

/// One effect that was tested.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ScoreTest {
    /// What it is called, for instance `elbow.compliance`.
    pub name: String,
    /// The joint; `None` for drift of the whole frame and for the common clock.
    pub joint: Option<String>,
    /// The physics.
    pub physics: Physics,
    /// Coefficient that one step towards the better model gives (rad, 1, rad/Nm, s, m/s …).
    pub estimate: f64,
    /// z² of equation (2).
    pub z2: f64,
    /// Probability of so large a z² if the effect were absent.
    pub p_value: f64,
    /// The same after correction for the number of effects tested (Bonferroni).
    pub p_corrected: f64,
    /// Share of χ² that the effect would remove.
    pub explains: f64,
    /// Mean square of what the estimate moves the measurements by that it moves at all, in units of their noise, before the parameters
    /// adapt to it.
    pub moves: f64,
}

impl ScoreTest {
    /// Chance would show one as large in less than 1 of 1000 analyses.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        self.p_corrected < GoodnessOfFit::SIGNIFICANT
    }

    /// Whether the model lacks the effect: significant, relevant and possible.
    fn is_missing(&self) -> bool {
        self.is_significant() && self.is_relevant() && self.is_possible()
    }

    /// Whether it matters: by what it leaves, or by what the parameters took up of it. Of the gain of one joint of a hand the geometry
    /// takes up nearly all, and what is left is a small share of the χ² of all fingers; the geometry is then off by far more than its σ.
    fn is_relevant(&self) -> bool {
        self.explains > GoodnessOfFit::RELEVANT || self.moves > GoodnessOfFit::MOVES
    }

    /// Physics allows a coefficient of this sign.
    #[must_use]
    pub fn is_possible(&self) -> bool {
        let one_sided = matches!(self.physics, Physics::Effect(kind) if kind.effect().nonnegative);
        !one_sided || self.estimate >= 0.0
    }
}

/// Result of the goodness-of-fit analysis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct GoodnessOfFit {
    /// χ²/dof with the noise levels as stated.
    pub chi2_per_dof: f64,
    /// Probability of so large a χ² if model and stated noise are right; `None` when every noise level
    /// was estimated (χ²/dof is then 1 by construction).
    pub p_value: Option<f64>,
    /// Every effect tested, most significant first.
    pub tests: Vec<ScoreTest>,
    /// The tests of the effects that are missing, most significant first; empty when none is significant.
    pub missing: Vec<ScoreTest>,
}

impl GoodnessOfFit {
    /// An effect counts as missing when chance would show one as large in less than 1 of 1000 analyses…
    pub const SIGNIFICANT: f64 = 1e-3;
    /// …and when it explains this share of χ²: smaller ones are real but do not matter…
    pub const RELEVANT: f64 = 0.02;
    /// …unless they move the measurements by more than half of their noise, this is its square: the parameters then took up most of it.
    pub const MOVES: f64 = 0.25;
}

/// Numbers of whitened rows that are kept for a second look: 32 MB.
const KEPT: usize = 1 << 22;

/// What is regressed on.
#[derive(Clone)]
enum Effect {
    /// (edge, what is driven, regressor) of each joint that takes part.
    Joints(Vec<(usize, Drives, Vec<f64>)>),
    /// A drift of the measuring frame along one of its axes.
    Drift(usize, Vec<f64>),
    /// A smooth displacement of what stands at a place.
    Place(Bend),
}

#[derive(Clone)]
pub(crate) struct Candidate {
    name: String,
    joint: Option<String>,
    physics: Physics,
    effect: Effect,
    /// Regressors among which this one was chosen by the residuals.
    tries: f64,
}

impl Candidate {
    /// An effect of one joint by its regressor per sample.
    pub(crate) fn of_joint(joint: EdgeId, kind: EffectKind, values: Vec<f64>) -> Self {
        Self::of_joints(kind, vec![(joint, values)])
    }

    /// An effect of joints together, with one coefficient.
    pub(crate) fn of_joints(kind: EffectKind, joints: Vec<(EdgeId, Vec<f64>)>) -> Self {
        let part = |(joint, values): (EdgeId, _)| (joint.index(), kind.drives(), values);
        Self {
            name: String::new(),
            joint: None,
            physics: Physics::Effect(kind),
            effect: Effect::Joints(joints.into_iter().map(part).collect()),
            tries: 1.0,
        }
    }

    /// A smooth displacement by the place in the measuring frame.
    pub(crate) fn of_place(bend: Bend) -> Self {
        Self {
            name: String::new(),
            joint: None,
            physics: Physics::Drift,
            effect: Effect::Place(bend),
            tries: 1.0,
        }
    }

    /// Whether it is the test of that name.
    pub(crate) fn is_called(&self, name: &str) -> bool {
        self.name == name
    }

    /// The regressor of an effect of one joint; of others, nothing.
    pub(crate) fn values(&self) -> &[f64] {
        match &self.effect {
            Effect::Joints(parts) if parts.len() == 1 => &parts[0].2,
            _ => &[],
        }
    }
}

/// Regressors that were tried.
fn tries(candidates: &[Candidate]) -> f64 {
    candidates.iter().map(|c| c.tries).sum()
}

impl Solution {
    /// Degrees of freedom from which on the tests for effects and changes keep their level. Without this limit they name something in 13, 11, 8, 4, 0 and 0
    /// of 60 clean recordings of one marker on a robot with five joints, at 8 to 13 postures, which leave about 2, 4, 7, 10, 13 and 16 degrees of freedom.
    pub const TESTABLE: f64 = 12.0;

    /// Whether the residuals have enough [degrees of freedom](Solution::TESTABLE) to say whether an effect is missing or something changed.
    #[must_use]
    pub fn is_testable(&self) -> bool {
        self.degrees_of_freedom >= Self::TESTABLE
    }

    /// Score tests of every effect that the problem declares ([`Problem::candidate`](crate::Problem::candidate)) and of those that
    /// follow from the readings alone (gain, eccentricity), plus drift where times are given. Of long recordings
    /// they look at some thousand samples. `None` when the model cannot be evaluated, and where the fit
    /// [leaves too little](Solution::is_testable).
    #[must_use]
    pub fn goodness_of_fit(&self) -> Option<GoodnessOfFit> {
        if !self.is_testable() {
            return None;
        }
        let candidates = self.candidates();
        let mut tests = self.score_tests(&candidates, &self.looked_at())?;
        self.with_profiles(&candidates, &mut tests);
        tests.sort_by(|a, b| b.z2.total_cmp(&a.z2).then_with(|| a.name.cmp(&b.name)));
        self.with_memory(&candidates, &mut tests);
        let chi2_per_dof = self.chi2_stated / self.degrees_of_freedom.max(1.0);
        let all_estimated = self.noise.iter().all(|n| n.estimated);
        let p_value = (!all_estimated && self.degrees_of_freedom >= 1.0)
            .then(|| ChiSquared::new(self.degrees_of_freedom).ok())
            .flatten()
            .map(|d| d.sf(self.chi2_stated));
        let missing = tests.iter().filter(|t| t.is_missing()).cloned().collect();
        Some(GoodnessOfFit {
            chi2_per_dof,
            p_value,
            tests,
            missing,
        })
    }

    /// Where samples are few: each test at the level of noise that suits its effect, where it says more there.
    fn with_profiles(&self, candidates: &[Candidate], tests: &mut [ScoreTest]) {
        /// Of clean recordings of ten poses so many more than the level had a p below it: priors are wider than the errors that they stand for.
        const SAFE: f64 = 100.0;
        let Some(profiles) = self.profiled_tests(candidates) else {
            return;
        };
        for (candidate, profile) in candidates.iter().zip(profiles) {
            let p_value = (profile.p_value * SAFE).min(1.0);
            let same = |t: &&mut ScoreTest| t.name == candidate.name && t.p_value > p_value;
            if let Some(test) = tests.iter_mut().find(same) {
                let times = profile.estimate / test.estimate;
                test.moves *= if times.is_finite() {
                    times * times
                } else {
                    1.0
                };
                test.estimate = profile.estimate;
                test.z2 = profile.t2;
                test.p_value = p_value;
                test.p_corrected = (p_value * tries(candidates)).min(1.0);
                test.explains = profile.explains;
            }
        }
    }

    /// Every effect that is tested, where a direction of approach is open with the one that suits it best.
    pub(crate) fn candidates(&self) -> Vec<Candidate> {
        let mut candidates = candidates(&self.model);
        self.choose_directions(&mut candidates);
        candidates
    }

    fn score_tests(
        &self,
        candidates: &[Candidate],
        looked_at: &LookedAt,
    ) -> Option<Vec<ScoreTest>> {
        let model = &self.model;
        let (n, count) = (model.free(), candidates.len());
        let mut u = DVector::zeros(count);
        let (mut raw, mut moved) = (vec![0.0; count], vec![0_usize; count]);
        let mut b = DMatrix::zeros(n, count);
        let (mut h, mut g) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let samples = &looked_at.samples;
        // They are asked for twice.
        let keep = samples.len() * model.whole.max_rows * (n + count) <= KEPT;
        let mut kept = Vec::new();
        for seen in self.seen(candidates, samples) {
            let (s, alpha) = (&seen.rows, &seen.columns);
            for (k, own) in alpha.column_iter().enumerate() {
                u[k] += own.dot(&s.w);
                raw[k] += own.norm_squared();
                moved[k] += own.iter().filter(|by| **by != 0.0).count();
            }
            s.a.add_transposed_times(1.0, alpha, &mut b);
            if !looked_at.all {
                s.a.add_gram(1.0, &mut h);
                s.a.add_transposed_vector(&s.w, &mut g);
            }
            if keep {
                kept.push(seen);
            }
        }
        // From the minimum of all samples to that of those looked at, U ← U + bᵀδ.
        let (c, step) = if looked_at.all {
            (covariance_of(&self.held_curvature())?, None)
        } else {
            let (c, step) = self.to_own_minimum(&h, &g)?;
            u.gemv_tr(1.0, &b, &step, 1.0);
            (c, Some(step))
        };
        let taken = &c * &b;
        let information: Vec<f64> = (0..count)
            .map(|k| raw[k] - b.column(k).dot(&taken.column(k)))
            .collect();
        // Second pass: each sample's share of U once the effect has been taken out, so that a strong
        // effect does not count as its own noise.
        let estimates: Vec<f64> = (0..count).map(|k| u[k] / information[k]).collect();
        let share = |seen: Seen| shares(&seen, &taken, step.as_ref(), &estimates);
        let mut of_samples: Vec<Vec<f64>> = Vec::with_capacity(samples.len());
        let mut chi2 = 0.0;
        let mut add = |(cost, shares): (f64, Vec<f64>)| {
            chi2 += cost;
            of_samples.push(shares);
        };
        if keep {
            let all: Vec<(f64, Vec<f64>)> = kept.into_par_iter().map(share).collect();
            all.into_iter().for_each(add);
        } else {
            self.seen(candidates, samples)
                .for_each(|seen| add(share(seen)));
        }
        let chi2 = if looked_at.all { self.chi2 } else { chi2 };
        let excess = (self.chi2 / self.degrees_of_freedom.max(1.0)).max(1.0);
        let tried = tries(candidates);
        let mut out = Vec::new();
        for (k, candidate) in candidates.iter().enumerate() {
            let one = |value: f64| DMatrix::from_element(1, 1, value);
            let shares = of_samples.iter().map(|s| DVector::from_element(1, s[k]));
            let clusters = clustered(&shares.collect::<Vec<_>>(), 1);
            let scored = Scored {
                u: &DVector::from_element(1, u[k]),
                information: &one(information[k]),
                raw: &raw[k..=k],
                clusters: Some(&clusters),
                excess,
                samples: if looked_at.all {
                    model.problem.samples
                } else {
                    samples.len()
                },
            };
            // An effect that the parameters already imitate cannot be tested.
            let Some(tested) = scored.test() else {
                continue;
            };
            let information = information[k];
            out.push(ScoreTest {
                name: candidate.name.clone(),
                joint: candidate.joint.clone(),
                physics: candidate.physics,
                estimate: -u[k] / information,
                z2: tested.z2,
                p_value: tested.p_value,
                p_corrected: (tested.p_value * tried).min(1.0),
                explains: (u[k] * u[k] / information / chi2.max(1e-300)).min(1.0),
                moves: estimates[k].powi(2) * raw[k] / moved[k].max(1) as f64,
            });
        }
        Some(out)
    }

    /// C of some samples with the prior, and δ = −C g to their own minimum, from their H and g without it.
    pub(crate) fn to_own_minimum(
        &self,
        h: &DMatrix<f64>,
        g: &DVector<f64>,
    ) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let mut system = NormalEquations::of(h, g);
        add_prior(&self.model, &self.values, &mut system);
        let system = self.held(system);
        let c = covariance_of(&system)?;
        let step = -(&c * DVector::from_row_slice(&system.g));
        Some((c, step))
    }
}

/// |w|² of a sample at the minimum, `step` away, and its share of U for each effect, the effect's `estimates` taken out.
fn shares(
    seen: &Seen,
    taken: &DMatrix<f64>,
    step: Option<&DVector<f64>>,
    estimates: &[f64],
) -> (f64, Vec<f64>) {
    let (s, alpha) = (&seen.rows, &seen.columns);
    let left = alpha - s.a.times(taken);
    let moved = step.map(|step| &s.w + s.a.times_vector(step));
    let w = moved.as_ref().unwrap_or(&s.w);
    let of_effects = left.column_iter().zip(estimates);
    let shares = of_effects.map(|(own, estimate)| own.dot(w) - estimate * own.norm_squared());
    (w.norm_squared(), shares.collect())
}

fn candidates(model: &Model) -> Vec<Candidate> {
    let mut out = Vec::new();
    let mut clocks = BTreeMap::<&String, Vec<(usize, Drives, Vec<f64>)>>::new();
    let used: std::collections::BTreeSet<usize> = model
        .paths
        .iter()
        .flat_map(|p| &p.steps)
        .filter_map(|s| match s {
            crate::model::path::Step::Joint { edge, .. } => Some(*edge),
            _ => None,
        })
        .collect();
    for e in used {
        let EdgeKind::Joint(joint) = &model.problem.edges[e].kind else {
            continue;
        };
        let name = &model.problem.edges[e].name;
        let mut add = |kind: EffectKind, label: String, values: Vec<f64>| {
            out.push(Candidate {
                name: label,
                joint: Some(name.clone()),
                physics: Physics::Effect(kind),
                effect: Effect::Joints(vec![(e, kind.drives(), values)]),
                tries: 1.0,
            });
        };
        let modeled = |kind: EffectKind| joint.effects.iter().any(|f| f.kind == kind);
        for effect in EFFECTS.iter().filter(|e| e.testable.is_some()) {
            for term in effect.terms.iter().filter(|t| t.source == Source::Reading) {
                if !modeled(term.kind) && effect.applies_to(&joint.axis) {
                    let values = joint.q.iter().filter_map(|q| term.kind.of_reading(*q));
                    add(term.kind, format!("{name}.{}", term.name), values.collect());
                }
            }
        }
        for candidate in &joint.candidates {
            if candidate.kind == EffectKind::ClockOffset {
                let clock = clocks.entry(&candidate.name).or_default();
                clock.push((e, Drives::About, candidate.values.clone()));
            } else {
                add(
                    candidate.kind,
                    candidate.name.clone(),
                    candidate.values.clone(),
                );
            }
        }
    }
    out.extend(clocks.into_iter().map(|(name, parts)| Candidate {
        name: name.clone(),
        joint: None,
        physics: Physics::Effect(EffectKind::ClockOffset),
        effect: Effect::Joints(parts),
        tries: 1.0,
    }));
    if let Some(times) = &model.problem.times {
        let mean = times.iter().sum::<f64>() / times.len().max(1) as f64;
        let centered: Vec<f64> = times.iter().map(|t| t - mean).collect();
        for (axis, label) in ["x", "y", "z"].iter().enumerate() {
            out.push(Candidate {
                name: format!("drift.{label}"),
                joint: None,
                physics: Physics::Drift,
                effect: Effect::Drift(axis, centered.clone()),
                tries: 1.0,
            });
        }
    }
    out
}
