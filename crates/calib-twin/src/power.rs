//! How large an effect must be to be noticed: for the calibration to say that something is wrong.
//!
//! A fit without the effect tests for it: ĉ_k in trial k, z_k = ĉ_k r_k. An effect c shifts ĉ by c and nothing else, to first order, so that
//! every trial without it tells what it would have said with it:
//!
//! ```text
//! z_k(c) = (ĉ_k + c) r_k / √(1 + w_k),   w_k = (ĉ_k + c)² x_k,   x: share of χ² per c²                      (1)
//! power(c) = share of k with  p(z_k²) · tests < 0.001,  w_k/(1 + w_k) > 0.02,  and a possible sign            (2)
//! ```
//!
//! w is what the effect adds to χ²; the noise is estimated and takes it up. The noise model is chosen again as well, which (1) does not know:
//! trials that have effects of different sizes correct all sizes by one factor,
//!
//! ```text
//! noticed ~ Φ((ln c − ln f c₅₀)/s),   s = (ln c₈₀ − ln c₅₀)/Φ⁻¹(0.8),   f by maximum likelihood              (3)
//! ```
//!
//! What is noticed is not always named rightly: another effect may explain nearly the same.

use std::collections::BTreeMap;

use calib_core::effect::Source;
use calib_core::{EFFECTS, EffectKind, GoodnessOfFit};
use calib_finding::Unit;
use calib_urdf::{JointId, RobotModel};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use crate::fault::Fault;
use crate::quantity::unit_of;
use crate::trial::{Done, Injected, Tested};

/// Powers that sizes are stated for.
pub const POWERS: [f64; 4] = [0.2, 0.5, 0.8, 0.95];

/// How large an effect of a joint must be to be noticed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Power {
    /// Name of the test, `<joint>.<effect>`.
    pub name: String,
    /// Identity of the effect, as in the profile and the report.
    pub effect: String,
    /// The joint.
    pub joint: String,
    /// The joint that it is coupled to, of a coupling.
    pub other: Option<String>,
    /// Unit of the sizes.
    pub unit: Unit,
    /// Sizes that are noticed in 20, 50, 80 and 95 % of the recordings; null: no size up to a thousand σ is.
    pub sizes: [Option<f64>; 4],
    /// Of trials with the effect at about its 80 % size: how many there were, in how many something was noticed, and in how many it was named.
    pub tried: u32,
    /// See `tried`.
    pub named: u32,
    /// See `tried`.
    pub noticed: u32,
}

impl Power {
    /// The size that is noticed in 80 %.
    #[must_use]
    pub fn size(&self) -> Option<f64> {
        self.sizes[2]
    }
}

/// An effect of a joint that is tested.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Named {
    joint: JointId,
    kind: EffectKind,
    other: Option<JointId>,
}

impl Named {
    /// As a fault of a size.
    #[must_use]
    pub fn fault(&self, size: f64) -> Fault {
        Fault::Effect {
            joint: self.joint,
            kind: self.kind,
            other: self.other,
            size,
        }
    }
}

/// The effects that a replay can have, by the names of their tests.
#[must_use]
pub fn effects(model: &RobotModel) -> BTreeMap<String, Named> {
    let mut all = BTreeMap::new();
    let joints: Vec<JointId> = model.independent_joints().collect();
    let name = |joint: JointId| &model.joint(joint).name;
    for &joint in &joints {
        for term in EFFECTS.iter().flat_map(|effect| effect.terms) {
            let mut put = |called: String, other| {
                let kind = term.kind;
                all.insert(called, Named { joint, kind, other });
            };
            match term.source {
                // Rows have no speed here, and nobody supplies regressors.
                Source::Velocity | Source::Caller => {}
                Source::OtherJoint => {
                    for &other in joints.iter().filter(|other| **other != joint) {
                        let called = format!("{}.{}.{}", name(joint), term.name, name(other));
                        put(called, Some(other));
                    }
                }
                _ => put(format!("{}.{}", name(joint), term.name), None),
            }
        }
    }
    all
}

/// The sizes that are noticed, of every effect that the trials test.
#[must_use]
pub fn powers(model: &RobotModel, trials: &[&Done]) -> Vec<Power> {
    let mut of: BTreeMap<&str, Vec<&Tested>> = BTreeMap::new();
    let mut tests = 1;
    for done in trials {
        tests = tests.max(done.tests.len());
        for test in &done.tests {
            of.entry(&test.name).or_default().push(test);
        }
    }
    let level = GoodnessOfFit::SIGNIFICANT / tests as f64;
    let critical = ChiSquared::new(1.0).map_or(f64::INFINITY, |d| d.inverse_cdf(1.0 - level));
    let known = effects(model);
    let mut all = Vec::new();
    for (name, tested) in of {
        // Effects that only a part of the trials test have no power that could be stated.
        let Some(named) = known.get(name).filter(|_| 2 * tested.len() >= trials.len()) else {
            continue;
        };
        let joint = model.joint(named.joint);
        let term = named.kind.term();
        let one_sided = named.kind.effect().nonnegative;
        let found = |c: f64| share(&tested, c, critical, one_sided);
        all.push(Power {
            name: name.to_owned(),
            effect: named.kind.effect().id.to_owned(),
            joint: joint.name.clone(),
            other: named.other.map(|other| model.joint(other).name.clone()),
            unit: unit_of(term.quantity.unit(!joint.kind.turns())),
            sizes: POWERS.map(|power| size_of(power, &tested, &found)),
            tried: 0,
            named: 0,
            noticed: 0,
        });
    }
    all
}

/// Equation (2); of effects of either sign the mean of both.
fn share(tested: &[&Tested], c: f64, critical: f64, one_sided: bool) -> f64 {
    let is_found = |t: &&&Tested, c: f64| {
        let shifted = t.estimate + c;
        let added = shifted * shifted * t.explains;
        let z2 = (shifted * t.per_sigma).powi(2) / (1.0 + added);
        let explains = added / (1.0 + added);
        let possible = !one_sided || shifted >= 0.0;
        let moves = shifted * shifted * t.moves;
        let relevant = explains > GoodnessOfFit::RELEVANT || moves > GoodnessOfFit::MOVES;
        z2 > critical && relevant && possible
    };
    let of = |c: f64| tested.iter().filter(|t| is_found(t, c)).count() as f64;
    let n = tested.len() as f64;
    if one_sided {
        of(c) / n
    } else {
        (of(c) + of(-c)) / (2.0 * n)
    }
}

/// The size at which a share is reached.
fn size_of(power: f64, tested: &[&Tested], found: &dyn Fn(f64) -> f64) -> Option<f64> {
    /// Largest size that is looked at, in σ of the test.
    const MOST: f64 = 1e3;
    let mut sigmas: Vec<f64> = tested.iter().map(|t| 1.0 / t.per_sigma).collect();
    sigmas.sort_by(f64::total_cmp);
    let sigma = sigmas.get(sigmas.len() / 2)?;
    let (mut low, mut high) = (0.0, MOST * sigma);
    if found(high) < power {
        return None;
    }
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if found(middle) < power {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(high)
}

/// Parts of the 80 % size that follows from the tests which trials with effects have, in turn.
pub const TRIED: [f64; 4] = [0.9, 1.0, 1.1, 1.25];

/// Equation (3): f with its 95 % interval, from the sizes before the correction; `None` where too few trials have effects, or all or none
/// of them noticed it.
#[must_use]
pub fn factor(powers: &[Power], injected: &[Injected]) -> Option<[f64; 3]> {
    /// Fewer trials leave f open.
    const LEAST: usize = 20;
    /// Half of the 95 % quantile of χ² with one degree of freedom.
    const DROP: f64 = 1.92;
    /// Something else can hide an effect, or show one.
    const LAPSE: f64 = 0.01;
    /// Factors that are looked at: the first, the step, how many.
    const GRID: (f64, f64, i32) = (0.7, 1.005, 260);
    let normal = Normal::standard();
    let known = |i: &Injected| {
        let power = powers.iter().find(|p| p.name == i.what)?;
        let (half, most) = (power.sizes[1]?.ln(), power.sizes[2]?.ln());
        let slope = ((most - half) / normal.inverse_cdf(0.8)).max(1e-3);
        Some((i.size.ln() - half, slope, i.noticed))
    };
    let outcomes: Vec<(f64, f64, bool)> = injected.iter().filter_map(known).collect();
    let some = |wanted: bool| outcomes.iter().any(|o| o.2 == wanted);
    if outcomes.len() < LEAST || !some(true) || !some(false) {
        return None;
    }
    let likelihood = |f: f64| -> f64 {
        let one = |(above, slope, noticed): &(f64, f64, bool)| {
            let p = normal.cdf((above - f.ln()) / slope) * (1.0 - 2.0 * LAPSE) + LAPSE;
            if *noticed { p.ln() } else { (1.0 - p).ln() }
        };
        outcomes.iter().map(one).sum()
    };
    let (first, step, count) = GRID;
    let all = (0..count).map(|k| first * step.powi(k));
    let all: Vec<(f64, f64)> = all.map(|f| (f, likelihood(f))).collect();
    let best = all.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let inside = || all.iter().filter(|a| a.1 > best.1 - DROP).map(|a| a.0);
    Some([best.0, inside().next()?, inside().next_back()?])
}

/// Multiplies all sizes.
pub fn correct(powers: &mut [Power], factor: f64) {
    let sizes = powers.iter_mut().flat_map(|p| p.sizes.iter_mut().flatten());
    sizes.for_each(|size| *size *= factor);
}

/// Adds what the trials with effects say.
pub fn verify(powers: &mut [Power], injected: &[Injected]) {
    for power in powers {
        let of = injected.iter().filter(|i| i.what == power.name);
        for one in of {
            power.tried += 1;
            power.named += u32::from(one.named);
            power.noticed += u32::from(one.noticed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    /// Tests of an effect with this σ: ĉ is normal, and the share of χ² has the rows that it says.
    fn tested(sigma: f64, rows: f64, trials: usize) -> Vec<Tested> {
        let mut rng = rand_chacha::ChaCha12Rng::seed_from_u64(5);
        let one = |_| Tested {
            name: "a.gain".to_owned(),
            estimate: sigma * rng.sample::<f64, _>(StandardNormal),
            per_sigma: 1.0 / sigma,
            explains: 1.0 / (sigma * sigma * rows),
            moves: 0.0,
        };
        (0..trials).map(one).collect()
    }

    #[test]
    fn the_size_is_that_of_the_normal_distribution() {
        let all = tested(2.0, 1e5, 20_000);
        let all: Vec<&Tested> = all.iter().collect();
        // z beyond 4 in 80 %: c = (4 + 0.8416) σ; the share of χ² must be let through.
        let loose = |c: f64| {
            let of = |c: f64| all.iter().filter(|t| (t.estimate + c).abs() > 8.0).count();
            (of(c) + of(-c)) as f64 / (2 * all.len()) as f64
        };
        let size = size_of(0.8, &all, &loose).expect("found");
        assert!((size / (4.8416 * 2.0) - 1.0).abs() < 0.01, "{size}");
        // Of 100 000 rows, 2 % of χ² are 2000: z must be 45, not 4.
        let held = |c: f64| share(&all, c, 16.0, false);
        let size = size_of(0.5, &all, &held).expect("found");
        assert!(
            (size / (2.0 * (2000.0_f64 / 0.98).sqrt()) - 1.0).abs() < 0.01,
            "{size}"
        );
    }

    #[test]
    fn an_effect_of_one_sign_is_found_with_that_sign_only() {
        let all = tested(1.0, 30.0, 2000);
        let all: Vec<&Tested> = all.iter().collect();
        assert!(share(&all, -40.0, 10.0, true) == 0.0);
        assert!(share(&all, 40.0, 10.0, true) > 0.99 && share(&all, -40.0, 10.0, false) > 0.99);
    }

    #[test]
    fn the_factor_is_the_one_that_the_trials_have() {
        let power = Power {
            name: "a.gain".to_owned(),
            effect: "gain".to_owned(),
            joint: "a".to_owned(),
            other: None,
            unit: Unit::One,
            sizes: [0.9, 1.0, 1.1, 1.2].map(Some),
            tried: 0,
            named: 0,
            noticed: 0,
        };
        let normal = Normal::standard();
        let slope = 1.1_f64.ln() / normal.inverse_cdf(0.8);
        let real = 1.08_f64;
        let mut held = 0;
        for seed in 0..200 {
            let mut rng = rand_chacha::ChaCha12Rng::seed_from_u64(seed);
            let one = |k: usize| {
                let size = 1.1 * TRIED[k % TRIED.len()];
                let p = normal.cdf((size.ln() - real.ln()) / slope);
                Injected {
                    number: k as u64,
                    what: "a.gain".to_owned(),
                    size,
                    named: false,
                    noticed: rng.random::<f64>() < p,
                }
            };
            let trials: Vec<Injected> = (0..60).map(one).collect();
            let [_, low, high] = factor(std::slice::from_ref(&power), &trials).expect("both");
            held += u32::from(low <= real && real <= high);
        }
        // 190 of 200 expected; 99.9 % are above 180.
        assert!(held >= 180, "{held}");
    }
}
