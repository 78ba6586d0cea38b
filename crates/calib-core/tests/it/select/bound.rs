//! What any choice of effects could reach on the robots of the study.
//!
//! The study draws robots from known distributions: how many effects, which, how large, how far the geometry is off. A chooser that is told
//! these distributions and the noise has the posterior probability of every model and of every robot,
//!
//! ```text
//! P(m | y) ∝ P(m) ∫ p(y | x) p(x | m) dx                                                        (1)
//! share(m) = Σ_m' P(m' | y) P( |Φ(x̂_m − x)| ≤ limit |Φ(x̂_m' − x)|  |  m', y )                   (2)
//! ```
//!
//! with x̂_m the fit of model m, x the true robot and Φ its new poses. The model that maximizes (2) is right as often as any chooser can be:
//! the mean of its share over robots bounds every method. The problem is linearized at the nominal robot, whose deviations are small, and
//! the noise is known; both help the chooser.

use std::collections::BTreeMap;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector6};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{DEVIATION, Design, EFFECTS, PRIOR, Regressors, draw, scene};
use crate::common::{Chain, Free, normal, rng};

/// Models that (2) counts with, the likeliest.
const MODELS: usize = 60;
/// Robots drawn of each.
const DRAWN: usize = 100;
/// Steps of the search for likely models, from the true one.
const SEARCH: usize = 20_000;
/// Errors over those of the true model that count as good, and as not bad.
const LIMITS: [f64; 2] = [1.05, 1.2];
/// Effects at most.
const MOST: usize = 4;

/// One effect of one joint: place in [`EFFECTS`], and the other joint of a coupling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
struct Slot {
    joint: usize,
    effect: usize,
    other: usize,
}

/// Sorted slots.
type Chosen = Vec<Slot>;

fn slots() -> Vec<Slot> {
    let mut out = Vec::new();
    for joint in 0..6 {
        for (effect, of) in EFFECTS.iter().enumerate() {
            let others = (0..6).filter(|o| of.0 == "coupling" && *o != joint);
            let others: Vec<usize> = others.collect();
            match others.is_empty() {
                true => out.push(Slot {
                    joint,
                    effect,
                    other: 0,
                }),
                false => out.extend(others.into_iter().map(|other| Slot {
                    joint,
                    effect,
                    other,
                })),
            }
        }
    }
    out
}

/// The linearized problem of one recording: geometry first, then all effects.
struct Linear {
    /// AᵀV⁻¹A and AᵀV⁻¹y.
    h: DMatrix<f64>,
    g: DVector<f64>,
    /// √ΦᵀΦ.
    predict: DMatrix<f64>,
    geometry: usize,
    columns: BTreeMap<Slot, Vec<usize>>,
    /// 1/σ² of the draws of the geometry, and of the priors of a fit.
    drawn: Vec<f64>,
    prior: Vec<f64>,
    /// Smallest size over the largest.
    least: f64,
}

/// Rows of all markers at one sample: position before, and by every number of the geometry and every joint.
fn rows(chain: &Chain, free: &Free, s: usize) -> (DMatrix<f64>, DMatrix<f64>) {
    const STEP: f64 = 1e-6;
    let seen = |change: &dyn Fn(&mut Chain), extra: &[f64]| {
        let mut moved = nominal(chain);
        change(&mut moved);
        let x = moved.tracker_from_body(&chain.q[s], extra);
        let all = chain
            .markers
            .iter()
            .flat_map(|p| (x * p).coords.iter().copied().collect::<Vec<_>>());
        DVector::from_iterator(3 * chain.markers.len(), all)
    };
    let unit = |i: usize| Vector6::from_fn(|r, _| if r == i { STEP } else { 0.0 });
    let here = seen(&|_| {}, &[]);
    let mut geometry = Vec::new();
    for i in 0..6 {
        geometry.push(seen(
            &|c| c.true_world *= free.world.displacement(&unit(i)),
            &[],
        ));
        geometry.push(seen(
            &|c| c.true_mount *= free.mount.displacement(&unit(i)),
            &[],
        ));
    }
    for (k, chart) in free.origins.iter().enumerate() {
        for i in (0..6).filter(|i| chart.free()[*i]) {
            geometry.push(seen(
                &|c| c.true_origins[k] *= chart.displacement(&unit(i)),
                &[],
            ));
        }
    }
    let joints: Vec<DVector<f64>> = (0..6)
        .map(|j| {
            let mut extra = [0.0; 6];
            extra[j] = STEP;
            (seen(&|_| {}, &extra) - &here) / STEP
        })
        .collect();
    let geometry: Vec<DVector<f64>> = geometry.into_iter().map(|c| (c - &here) / STEP).collect();
    (
        DMatrix::from_columns(&geometry),
        DMatrix::from_columns(&joints),
    )
}

fn nominal(of: &Chain) -> Chain {
    let mut chain = Chain::nominal(of.links.clone());
    chain.markers.clone_from(&of.markers);
    chain
}

/// σ of each number of the geometry in the order of [`rows`] and of the offsets: of the draws and of the priors of a fit.
fn spreads(
    free: &Free,
    (rotation, translation): (f64, f64),
    frames: Option<(f64, f64)>,
) -> Vec<f64> {
    let of = |sigma: f64| sigma.powi(-2);
    let mut out = Vec::new();
    for i in 0..6 {
        let known = frames.map_or(0.0, |f| of(if i < 3 { f.0 } else { f.1 }));
        out.extend([known, known]);
    }
    for chart in &free.origins {
        let numbers = (0..6).filter(|i| chart.free()[*i]);
        out.extend(numbers.map(|i| of(if i < 3 { rotation } else { translation })));
    }
    out.extend([of(rotation); 6]);
    out
}

impl Linear {
    /// The recording of a robot that is drawn as the study draws it.
    fn new(seed: u64, design: Design, least: f64, truth: &[super::Truth]) -> (Self, Chosen) {
        let (chain, free, regressors) = scene(seed, design);
        let drawn = spreads(&free, DEVIATION, Some(DEVIATION));
        let prior = spreads(&free, PRIOR, None);
        let geometry = drawn.len();
        let mut columns = BTreeMap::new();
        let mut n = geometry;
        for slot in slots() {
            let own: Vec<usize> = (n..n + EFFECTS[slot.effect].1.len()).collect();
            n += own.len();
            columns.insert(slot, own);
        }
        let mut r = rng(seed + 7_000_001);
        let x = drawn_robot(&mut r, &drawn, &columns, n, truth);
        let mut h = DMatrix::zeros(n, n);
        let mut g = DVector::zeros(n);
        let mut phi = DMatrix::zeros(n, n);
        for s in 0..chain.q.len() {
            let (of_geometry, of_joints) = rows(&chain, &free, s);
            let a = whole(&of_geometry, &of_joints, &regressors, &columns, (n, s));
            if s >= design.poses {
                phi.gemm_tr(1.0, &a, &a, 1.0);
                continue;
            }
            let m = a.nrows();
            let v = DMatrix::identity(m, m) * design.sigma.powi(2)
                + &of_joints * of_joints.transpose() * design.joint_noise.powi(2);
            let l = Cholesky::new(v).expect("noise").l();
            let noise = DVector::from_fn(m, |_, _| normal(&mut r));
            let white = l.solve_lower_triangular(&a).expect("noise");
            let y = &white * &x + noise;
            h.gemm_tr(1.0, &white, &white, 1.0);
            g.gemv_tr(1.0, &white, &y, 1.0);
        }
        // A root of ΦᵀΦ, which may be singular: gauges of world and mount.
        let ridge = 1e-12 * phi.diagonal().max();
        let predict = Cholesky::new(phi + DMatrix::identity(n, n) * ridge)
            .expect("positive")
            .l()
            .transpose();
        let mut chosen: Chosen = truth.iter().map(slot_of).collect();
        chosen.sort_unstable();
        (
            Self {
                h,
                g,
                predict,
                geometry,
                columns,
                drawn,
                prior,
                least,
            },
            chosen,
        )
    }

    fn columns(&self, chosen: &Chosen) -> Vec<usize> {
        chosen
            .iter()
            .flat_map(|slot| self.columns[slot].clone())
            .collect()
    }

    /// The information of geometry and these effects, with these 1/σ².
    fn normal_equations(
        &self,
        chosen: &Chosen,
        geometry: &[f64],
        effects: &[f64],
    ) -> (Vec<usize>, DMatrix<f64>, DVector<f64>) {
        let mut all: Vec<usize> = (0..self.geometry).collect();
        all.extend(self.columns(chosen));
        let mut h = DMatrix::from_fn(all.len(), all.len(), |i, j| self.h[(all[i], all[j])]);
        for (i, p) in geometry.iter().chain(effects).enumerate() {
            h[(i, i)] += p;
        }
        let g = DVector::from_iterator(all.len(), all.iter().map(|&c| self.g[c]));
        (all, h, g)
    }

    /// √Φᵀ Φ x̂ of a model as a fit would have it.
    fn fitted(&self, chosen: &Chosen) -> DVector<f64> {
        let effects: Vec<f64> = self.per_column(chosen, |slot| EFFECTS[slot.effect].2.powi(-2));
        let (all, h, g) = self.normal_equations(chosen, &self.prior, &effects);
        let x = Cholesky::new(h).expect("determined").solve(&g);
        &self.predict * self.spread_out(&all, &x)
    }

    fn per_column(&self, chosen: &Chosen, of: impl Fn(&Slot) -> f64) -> Vec<f64> {
        chosen
            .iter()
            .flat_map(|slot| vec![of(slot); self.columns[slot].len()])
            .collect()
    }

    fn spread_out(&self, all: &[usize], x: &DVector<f64>) -> DVector<f64> {
        let mut out = DVector::zeros(self.g.len());
        for (&c, v) in all.iter().zip(x.iter()) {
            out[c] = *v;
        }
        out
    }

    /// 1/σ² of a normal density as wide as that of the draws.
    fn slab(&self, slot: &Slot) -> f64 {
        let (_, kinds, _, largest) = EFFECTS[slot.effect];
        let squares = (1.0 - self.least.powi(3)) / (3.0 * (1.0 - self.least)) * largest * largest;
        kinds.len() as f64 / squares
    }
}

fn slot_of(truth: &super::Truth) -> Slot {
    let effect = EFFECTS
        .iter()
        .position(|e| e.0 == truth.effect)
        .expect("drawn");
    let other = if truth.effect == "coupling" {
        truth.other
    } else {
        0
    };
    Slot {
        joint: truth.joint,
        effect,
        other,
    }
}

/// Every column at one sample.
fn whole(
    geometry: &DMatrix<f64>,
    joints: &DMatrix<f64>,
    regressors: &Regressors,
    columns: &BTreeMap<Slot, Vec<usize>>,
    (n, s): (usize, usize),
) -> DMatrix<f64> {
    let mut a = DMatrix::zeros(geometry.nrows(), n);
    a.columns_mut(0, geometry.ncols()).copy_from(geometry);
    a.columns_mut(geometry.ncols(), 6).copy_from(joints);
    for (slot, own) in columns {
        for (kind, &c) in EFFECTS[slot.effect].1.iter().zip(own) {
            let by = regressors.of(*kind, slot.joint, slot.other, s);
            a.column_mut(c).copy_from(&(joints.column(slot.joint) * by));
        }
    }
    a
}

fn drawn_robot(
    r: &mut ChaCha8Rng,
    drawn: &[f64],
    columns: &BTreeMap<Slot, Vec<usize>>,
    n: usize,
    truth: &[super::Truth],
) -> DVector<f64> {
    let mut x = DVector::zeros(n);
    for (i, p) in drawn.iter().enumerate() {
        x[i] = normal(r) / p.sqrt();
    }
    for t in truth {
        for (&c, value) in columns[&slot_of(t)].iter().zip(&t.coefficients) {
            x[c] = *value;
        }
    }
    x
}

/// Effects beside the geometry, which is integrated over.
struct Beside {
    h: DMatrix<f64>,
    g: DVector<f64>,
}

impl Beside {
    fn of(linear: &Linear) -> Self {
        let (k, n) = (linear.geometry, linear.g.len());
        let mut nn = linear.h.view((0, 0), (k, k)).into_owned();
        for (i, p) in linear.drawn.iter().enumerate() {
            nn[(i, i)] += p;
        }
        let ne = linear.h.view((0, k), (k, n - k)).into_owned();
        let factor = Cholesky::new(nn).expect("priors");
        let taken = factor.solve(&ne);
        Self {
            h: linear.h.view((k, k), (n - k, n - k)) - ne.tr_mul(&taken),
            g: linear.g.rows(k, n - k) - taken.tr_mul(&linear.g.rows(0, k).into_owned()),
        }
    }

    /// Precision, factor and mean of the effects of a model under normal draws.
    fn posterior(
        &self,
        linear: &Linear,
        chosen: &Chosen,
    ) -> (Cholesky<f64, Dyn>, DVector<f64>, f64) {
        let own: Vec<usize> = linear
            .columns(chosen)
            .iter()
            .map(|c| c - linear.geometry)
            .collect();
        let slab = linear.per_column(chosen, |slot| linear.slab(slot));
        let mut p = DMatrix::from_fn(own.len(), own.len(), |i, j| self.h[(own[i], own[j])]);
        for (i, s) in slab.iter().enumerate() {
            p[(i, i)] += s;
        }
        let g = DVector::from_iterator(own.len(), own.iter().map(|&c| self.g[c]));
        let factor = Cholesky::new(p).expect("priors");
        let mean = factor.solve(&g);
        let log_det: f64 = factor.l_dirty().diagonal().iter().map(|l| l.ln()).sum();
        let evidence =
            0.5 * g.dot(&mean) - log_det + slab.iter().map(|s| 0.5 * s.ln()).sum::<f64>();
        (factor, mean, evidence)
    }

    /// ln P(m) + ln of the integral of (1) under normal draws.
    fn likelihood(&self, linear: &Linear, chosen: &Chosen) -> f64 {
        self.posterior(linear, chosen).2 + prior_of(chosen)
    }
}

/// ln P(m): one to four effects alike, each set of so many joints and effects alike, a coupling to any of five joints.
fn prior_of(chosen: &Chosen) -> f64 {
    let sets: f64 = (0..chosen.len())
        .map(|i| ((36 - i) as f64 / (i + 1) as f64).ln())
        .sum();
    let couplings = chosen
        .iter()
        .filter(|s| EFFECTS[s.effect].0 == "coupling")
        .count();
    -sets - couplings as f64 * 5.0_f64.ln()
}

/// The likeliest models near the true one.
fn likely(linear: &Linear, beside: &Beside, truth: &Chosen, seed: u64) -> Vec<(Chosen, f64)> {
    let slots = slots();
    let mut r = rng(seed + 9_000_011);
    let mut known: BTreeMap<Chosen, f64> = BTreeMap::new();
    let mut now = truth.clone();
    let mut value = beside.likelihood(linear, &now);
    known.insert(now.clone(), value);
    for _ in 0..SEARCH {
        let mut next = now.clone();
        let (way, new): (usize, Slot) =
            (r.random_range(0..3), slots[r.random_range(0..slots.len())]);
        if way > 0 {
            next.remove(r.random_range(0..now.len()));
        }
        let taken = next
            .iter()
            .any(|s| (s.joint, s.effect) == (new.joint, new.effect));
        if way < 2 && !taken {
            next.push(new);
        }
        if next.is_empty() || next.len() > MOST {
            continue;
        }
        next.sort_unstable();
        let of_next = *known
            .entry(next.clone())
            .or_insert_with(|| beside.likelihood(linear, &next));
        if r.random_range(0.0..1.0_f64).ln() < of_next - value {
            (now, value) = (next, of_next);
        }
    }
    let mut all: Vec<(Chosen, f64)> = known.into_iter().collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.truncate(MODELS);
    all
}

/// Shares (2) of the best choice at each limit, and of the likeliest model.
fn shares(seed: u64, design: Design, least: f64, limits: [f64; 2]) -> [[f64; 2]; 2] {
    let truth = draw(seed, 1 + seed as usize % 4, least);
    let (linear, chosen) = Linear::new(1000 + seed, design, least, &truth);
    let beside = Beside::of(&linear);
    let models = likely(&linear, &beside, &chosen, seed);
    let fits: Vec<DVector<f64>> = models.iter().map(|(m, _)| linear.fitted(m)).collect();
    let mut r = rng(seed + 5_000_003);
    let mut sums = vec![[0.0; 2]; models.len()];
    let (mut all, mut likeliest) = (0.0, (0, f64::MIN));
    for (k, (m, value)) in models.iter().enumerate() {
        let drawn = posterior_draws(&linear, &beside, m, &mut r);
        let weight = (value - models[0].1).exp() / DRAWN as f64;
        let own: f64 = drawn.iter().map(|d| d.1).sum();
        if value + own.ln() > likeliest.1 {
            likeliest = (k, value + own.ln());
        }
        for (x, ratio) in drawn {
            let right = (&fits[k] - &x).norm();
            all += weight * ratio;
            for (sum, fit) in sums.iter_mut().zip(&fits) {
                let off = (fit - &x).norm() / right;
                for (s, limit) in sum.iter_mut().zip(limits) {
                    *s += weight * ratio * f64::from(u8::from(off <= limit));
                }
            }
        }
    }
    let best = |i: usize| sums.iter().map(|s| s[i]).fold(0.0, f64::max) / all;
    [[best(0), best(1)], sums[likeliest.0].map(|s| s / all)]
}

/// √ΦᵀΦ x of robots of one model as the data leave them, and how much likelier their sizes are than under normal draws.
fn posterior_draws(
    linear: &Linear,
    beside: &Beside,
    m: &Chosen,
    r: &mut ChaCha8Rng,
) -> Vec<(DVector<f64>, f64)> {
    let (factor, mean, _) = beside.posterior(linear, m);
    let slab = linear.per_column(m, |slot| linear.slab(slot));
    let (_, h, g) = linear.normal_equations(m, &linear.drawn, &slab);
    let k = linear.geometry;
    let geometry = Cholesky::new(h.view((0, 0), (k, k)).into_owned()).expect("priors");
    let mixed = h.view((0, k), (k, mean.len())).into_owned();
    let all: Vec<usize> = (0..k).chain(linear.columns(m)).collect();
    (0..DRAWN)
        .map(|_| {
            let noise = DVector::from_fn(mean.len(), |_, _| normal(r));
            let effects = &mean
                + factor
                    .l()
                    .transpose()
                    .solve_upper_triangular(&noise)
                    .expect("definite");
            let noise = DVector::from_fn(k, |_, _| normal(r));
            let rest = geometry.solve(&(g.rows(0, k) - &mixed * &effects))
                + geometry
                    .l()
                    .transpose()
                    .solve_upper_triangular(&noise)
                    .expect("definite");
            let mut ratio = 1.0;
            let mut at = 0;
            for slot in m {
                let n = linear.columns[slot].len();
                ratio *= of_sizes(linear, slot, effects.rows(at, n).norm());
                at += n;
            }
            let x = DVector::from_iterator(
                k + effects.len(),
                rest.iter().chain(effects.iter()).copied(),
            );
            (&linear.predict * linear.spread_out(&all, &x), ratio)
        })
        .collect()
}

/// Density of the draws over the normal one, at coefficients of this norm.
fn of_sizes(linear: &Linear, slot: &Slot, size: f64) -> f64 {
    let (_, kinds, _, largest) = EFFECTS[slot.effect];
    if !(linear.least * largest..largest).contains(&size) {
        return 0.0;
    }
    let across = (1.0 - linear.least) * largest;
    let (p, n) = (linear.slab(slot), kinds.len());
    let uniform = match n {
        1 => 0.5 / across,
        _ => 1.0 / (std::f64::consts::TAU * size * across),
    };
    let normal = (p / std::f64::consts::TAU).powf(0.5 * n as f64) * (-0.5 * p * size * size).exp();
    uniform / normal
}

/// `ROBOTS=24 cargo test --release -p calib-core --test it select::bound -- --ignored --nocapture`
#[test]
#[ignore = "a study: minutes"]
fn bound_of_every_choice() {
    let robots = std::env::var("ROBOTS").map_or(40, |n| n.parse::<u64>().expect("a number"));
    for poses in [25, 60] {
        for (label, least) in [("none to strong", 0.0), ("half to full strength", 0.5)] {
            let design = Design {
                poses,
                ..Design::default()
            };
            let each: Vec<_> = (0..robots)
                .map(|seed| shares(seed, design, least, LIMITS))
                .collect();
            let of = |which: usize, i: usize| {
                let n = each.len() as f64;
                let middle = each.iter().map(|s| s[which][i]).sum::<f64>() / n;
                let squares = each
                    .iter()
                    .map(|s| (s[which][i] - middle).powi(2))
                    .sum::<f64>();
                (100.0 * middle, 100.0 * (squares / (n - 1.0) / n).sqrt())
            };
            let show = |(share, error): (f64, f64)| format!("{share:.1} ± {error:.1} %");
            println!(
                "{poses} poses, {label}: {robots} robots; the best that any choice can do: ≤ 1.05 in {}, ≤ 1.2 in {}; the likeliest model: {}, {}",
                show(of(0, 0)),
                show(of(0, 1)),
                show(of(1, 0)),
                show(of(1, 1)),
            );
        }
    }
}
