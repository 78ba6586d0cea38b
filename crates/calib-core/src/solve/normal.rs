//! Normal equations, summed part by part and sample by sample: the dense Jacobian of all samples never exists.
//!
//! ```text
//! H = Σ_s J_sᵀ V_s⁻¹ J_s + Λ,   g = Σ_s J_sᵀ V_s⁻¹ e_s + Λ (x − x₀),   Λ = diag(1/σ²)        (1)
//! F = ½ Σ_s e_sᵀ V_s⁻¹ e_s + ½ (x − x₀)ᵀ Λ (x − x₀)                                          (2)
//! ```

use std::ops::Range;
use std::sync::Arc;

use crate::model::cache::{EdgeCache, State};
use crate::model::layout::Model;
use crate::model::parts::Part;
use crate::model::path::Derivatives;
use crate::model::values::Values;
use crate::solve::chunks::{chunk_of, chunked, is_one_chunk};
use crate::solve::compressed::{accumulate_compressed, cost_compressed};
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::panel::Local;
use crate::solve::rows::SampleRows;
use crate::solve::structured::RandomPart;

/// Of more samples the random parts of V_s are computed again for every cost: kept, they would be most of the memory of a run.
const MOST_KEPT: usize = 4096;

/// Equation (1). `false` when some V_s is not positive definite or a number is not finite.
pub(crate) fn accumulate(
    objective: Objective,
    values: &Values,
    work: &mut Workspace,
    out: &mut NormalEquations,
) -> bool {
    let model = objective.model;
    out.h.fill(0.0);
    out.g.fill(0.0);
    out.data = 0.0;
    work.cache.update(&model.problem, values);
    let fine = if model.slots.is_empty() {
        accumulate_compressed(objective, values, work, out)
    } else {
        accumulate_rows(objective, values, work, out)
    };
    add_prior(model, values, out);
    fine && out.cost().is_finite()
}

/// The general way: every sample's rows, whitened by its V_s.
pub(crate) fn accumulate_rows(
    objective: Objective,
    values: &Values,
    work: &mut Workspace,
    out: &mut NormalEquations,
) -> bool {
    let model = objective.model;
    let count = model.problem.samples;
    let Workspace {
        cache,
        factors,
        linearized,
        ..
    } = work;
    let kept = count <= MOST_KEPT;
    *linearized = (!kept).then(|| (values.clone(), cache.clone()));
    let pass = Pass {
        objective,
        values,
        cache,
        kept,
    };
    let mut reused = factors.pop().unwrap_or_default();
    reused.clear();
    factors.clear();
    let mut add = |(sums, random): (Vec<Local>, Vec<f64>)| {
        for (part, sum) in model.parts.iter().zip(&sums) {
            add_sum(&part.columns, sum, out);
        }
        factors.push(random);
    };
    if is_one_chunk(count) {
        let sums = pass.sums(0..count, reused);
        let fine = sums.is_some();
        sums.into_iter().for_each(add);
        return fine;
    }
    chunked(count, |samples| pass.sums(samples, Vec::new()), &mut add).is_some()
}

/// Adds the sums of a part with these columns.
fn add_sum(columns: &[usize], sum: &Local, out: &mut NormalEquations) {
    let n = out.n;
    out.data += sum.cost;
    for (a, &row) in columns.iter().enumerate() {
        out.g[row] += sum.g[a];
        let to = &mut out.h[row * n..(row + 1) * n];
        for (b, &column) in columns.iter().enumerate().skip(a) {
            to[column] += sum.h[(a, b)];
        }
    }
}

/// Where the equations are wanted: the objective, the values, and the edges' poses at them.
struct Pass<'a> {
    objective: Objective<'a>,
    values: &'a Values,
    cache: &'a EdgeCache,
    /// Whether the random parts are kept.
    kept: bool,
}

/// Where the random part of V_s comes from.
#[derive(Clone, Copy)]
enum RandomAt<'a> {
    /// The values of the residuals themselves.
    Here,
    /// What a linearization kept of a chunk of samples.
    Kept(&'a [f64]),
    /// The values of a linearization.
    There(State<'a>),
}

impl Pass<'_> {
    /// H, g and cost of each part over some samples, and the random part of each V_s, appended to `factors`: part after part.
    fn sums(&self, samples: Range<usize>, mut factors: Vec<f64>) -> Option<(Vec<Local>, Vec<f64>)> {
        let parts = self.objective.model.parts.iter();
        let sums: Option<Vec<Local>> = parts
            .map(|part| self.sum(part, samples.clone(), &mut factors))
            .collect();
        Some((sums?, factors))
    }

    fn sum(
        &self,
        part: &Arc<Part>,
        samples: Range<usize>,
        factors: &mut Vec<f64>,
    ) -> Option<Local> {
        let Objective {
            model,
            weights,
            theta,
        } = self.objective;
        let (mut rows, mut random) = (SampleRows::of(model, part), RandomPart::default());
        let n = part.columns.len();
        let at = State::new(&model.problem, self.cache, self.values);
        let mut sum = Local::new(n, part.max_rows);
        for sample in samples {
            if model.of_sample[sample].is_empty() {
                continue;
            }
            rows.fill_turned(model, at, (weights, theta), sample, |rest| {
                sum.cost += rest.cost;
                rest.add_gram(&mut sum.h);
                for (own, g) in rest.own.iter().zip(rest.gradient) {
                    sum.g[own.column] += g;
                }
            });
            if rows.m == 0 {
                continue;
            }
            rows.whiten_blocks(model, weights, theta, true)?;
            rows.random_part(&mut random)?;
            if self.kept {
                random.store(&rows, factors);
            }
            let m = rows.m;
            random.whiten(&mut rows.r[..m]);
            sum.cost += rows.squared_norm();
            let (whitened, gradient) = sum.rows_and_gradient(m);
            random.whiten_rows(&rows.j[..m * n], n, whitened);
            for (row, r) in whitened.chunks_exact(n.max(1)).zip(&rows.r) {
                gradient.iter_mut().zip(row).for_each(|(g, j)| *g += j * r);
            }
        }
        sum.multiply();
        Some(sum)
    }

    /// eᵀV⁻¹e of some samples, with the random parts of V_s that are given; `None` where it cannot be computed.
    fn cost(&self, samples: Range<usize>, of: RandomAt<'_>) -> Option<f64> {
        let mut next = 0;
        let parts = self.objective.model.parts.iter();
        parts
            .map(|part| self.cost_of(part, samples.clone(), of, &mut next))
            .sum()
    }

    /// That of a part, whose random parts begin at `next` of what is kept.
    fn cost_of(
        &self,
        part: &Arc<Part>,
        samples: Range<usize>,
        of: RandomAt<'_>,
        next: &mut usize,
    ) -> Option<f64> {
        let (rows, random) = (
            &mut SampleRows::of(self.objective.model, part),
            &mut RandomPart::default(),
        );
        let Objective {
            model,
            weights,
            theta,
        } = self.objective;
        let at = State::new(&model.problem, self.cache, self.values);
        let wanted = match of {
            RandomAt::Here => Derivatives::Random,
            RandomAt::Kept(_) | RandomAt::There(_) => Derivatives::None,
        };
        let mut sum = 0.0;
        for sample in samples {
            if model.of_sample[sample].is_empty() {
                continue;
            }
            if let RandomAt::There(there) = of {
                rows.fill(model, there, weights, sample, Derivatives::Random);
                rows.whiten_blocks(model, weights, theta, false)?;
                rows.random_part(random)?;
            }
            rows.fill(model, at, weights, sample, wanted);
            if rows.m == 0 {
                continue;
            }
            rows.whiten_blocks(model, weights, theta, false)?;
            let m = rows.m;
            match of {
                RandomAt::Here => rows.random_part(random)?,
                RandomAt::Kept(factors) => *next += random.load(&factors[*next..], m),
                RandomAt::There(_) => {}
            }
            random.whiten(&mut rows.r[..m]);
            sum += rows.squared_norm();
        }
        Some(sum)
    }
}

pub(crate) fn add_prior(model: &Model, values: &Values, out: &mut NormalEquations) {
    let n = out.n;
    out.prior = 0.0;
    for (c, &p) in model.columns.iter().enumerate() {
        let parameter = &model.problem.parameters[p];
        if let Some(sigma) = parameter.prior_sigma {
            let information = 1.0 / (sigma * sigma);
            let off = values.0[p] - parameter.nominal;
            out.h[c * n + c] += information;
            out.g[c] += information * off;
            out.prior += information * off * off;
        }
    }
}

/// Equation (2), doubled, at trial values with the V_s of the last [`accumulate`]; infinite where it
/// cannot be computed.
pub(crate) fn cost(objective: Objective, values: &Values, work: &mut Workspace) -> f64 {
    let model = objective.model;
    let data = evaluate_cost(objective, values, work, !model.slots.is_empty());
    let sum = prior_cost(model, values, data);
    if sum.is_finite() { sum } else { f64::INFINITY }
}

/// What the priors of the free parameters cost, on top of a sum.
pub(crate) fn prior_cost(model: &Model, values: &Values, mut sum: f64) -> f64 {
    for &p in &model.columns {
        let parameter = &model.problem.parameters[p];
        if let Some(sigma) = parameter.prior_sigma {
            let z = (values.0[p] - parameter.nominal) / sigma;
            sum += z * z;
        }
    }
    sum
}

/// eᵀV⁻¹e over all samples with V_s at these values; infinite where it cannot be computed.
pub(crate) fn data_cost(objective: Objective, values: &Values, work: &mut Workspace) -> f64 {
    evaluate_cost(objective, values, work, false)
}

fn evaluate_cost(objective: Objective, values: &Values, work: &mut Workspace, stored: bool) -> f64 {
    let model = objective.model;
    let count = model.problem.samples;
    work.cache.update(&model.problem, values);
    if model.slots.is_empty() {
        return cost_compressed(objective, values, work);
    }
    let Workspace {
        cache,
        factors,
        linearized,
        ..
    } = work;
    let pass = Pass {
        objective,
        values,
        cache,
        kept: false,
    };
    let (factors, linearized) = (&*factors, linearized.as_ref());
    let of_chunk = |chunk: usize| match linearized {
        _ if !stored => RandomAt::Here,
        Some((values, cache)) => RandomAt::There(State::new(&model.problem, cache, values)),
        None => RandomAt::Kept(factors.get(chunk).map_or(&[][..], Vec::as_slice)),
    };
    if is_one_chunk(count) {
        let sum = pass.cost(0..count, of_chunk(0));
        return sum.unwrap_or(f64::INFINITY);
    }
    let mut sum = 0.0;
    let cost = |samples: Range<usize>| {
        let stored = of_chunk(chunk_of(samples.start));
        pass.cost(samples, stored)
    };
    match chunked(count, cost, |part| sum += part) {
        Some(()) => sum,
        None => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::*;
    use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

    /// Two measurements on one chain with known, unknown and anisotropic markers, some weights 0.
    fn problem() -> Problem {
        let q: Vec<f64> = (0..9).map(|i| f64::from(i) * 0.3 - 1.0).collect();
        let mut p = Problem::new(q.len());
        let base = p.frame("base");
        let a = p.frame("a");
        let b = p.frame("b");
        let x = Isometry3::new(Vector3::new(0.3, 0.1, 0.2), Vector3::new(0.2, -0.4, 0.5));
        p.unknown("first", base, a, x, Chart::full());
        let joint = p.joint("turn", a, b, Axis::Revolute(Vector3::z_axis()), q.clone());
        p.free_effect(joint, EffectKind::ZeroOffset, Some(0.1));
        p.free_effect(joint, EffectKind::Gain, None);
        let noise = p.noise_group("n", NoiseKind::Position, 1e-2, false);
        let points = [
            p.known_point("k1", b, Point3::new(0.3, 0.1, 0.0)),
            p.unknown_point("u1", b, Point3::new(0.1, -0.2, 0.3), None),
            p.unknown_point("u2", b, Point3::new(-0.1, 0.2, 0.1), Some(0.1)),
        ];
        for (name, shape) in [
            ("isotropic", None),
            (
                "depth",
                Some(Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 9.0))),
            ),
        ] {
            let seen = (0..q.len() * 3)
                .map(|i| MarkerObservation {
                    sample: i / 3,
                    point: points[i % 3],
                    position: Point3::new((i as f64).sin(), (i as f64 * 1.7).cos(), 0.1),
                    shape: shape.map(Box::new),
                })
                .collect();
            p.markers(name, base, b, noise, seen);
        }
        p
    }

    #[test]
    fn both_ways_to_the_normal_equations_agree() {
        let model = Model::new(&problem()).unwrap();
        let mut work = Workspace::new(&model);
        let theta = [1e-4];
        let weights: Vec<f64> = (0..model.observation_count())
            .map(|o| [1.0, 0.0, 0.3, 1.0, 2.0][o % 5])
            .collect();
        let mut values = model.start();
        for (i, v) in values.0.iter_mut().enumerate() {
            *v += 0.05 * (i as f64).sin();
        }
        let mut fast = NormalEquations::new(model.free());
        let mut slow = fast.clone();
        let objective = Objective {
            model: &model,
            weights: &weights,
            theta: &theta,
        };
        assert!(accumulate(objective, &values, &mut work, &mut fast));
        work.cache.update(&model.problem, &values);
        assert!(accumulate_rows(objective, &values, &mut work, &mut slow));
        add_prior(&model, &values, &mut slow);
        let size = slow.h.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        for (a, b) in fast.h.iter().zip(&slow.h) {
            assert!((a - b).abs() < 1e-12 * size, "{a} {b}");
        }
        for (a, b) in fast.g.iter().zip(&slow.g) {
            assert!((a - b).abs() < 1e-12 * size, "{a} {b}");
        }
        assert!((fast.cost() - slow.cost()).abs() < 1e-12 * slow.cost());
        let trial = cost(objective, &values, &mut work);
        assert!((trial - slow.cost()).abs() < 1e-12 * slow.cost());
    }
}
