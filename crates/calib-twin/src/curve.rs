//! σ of the tool against the number of postures.
//!
//! ```text
//! M_n = Qᵀ Λ Q + Σ_{s ≤ n} (Y_s Q)ᵀ Y_s Q,   σ_n = √tr(B M_n⁻¹ Bᵀ),   B = G Q / √K                        (1)
//! ```
//!
//! Y, Q and Λ as in [`calib_plan::basis`]; the samples s of the fit in random order (mean over several orders), and the whole session again and
//! again beyond it. G is the derivative of the tool's position over K postures: those of the validation, else of the session.

use calib_core::{Parameter, Target};
use calib_pipeline::formulate::formulation::MlFit;
use calib_pipeline::prepare::inputs::Inputs;
use calib_pipeline::verify::accuracy::tool_link;
use calib_plan::basis::{Basis, sigma};
use nalgebra::{DMatrix, DVector};
use rand::seq::SliceRandom;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::session::Session;

/// Orders of the samples.
const ORDERS: u64 = 8;
/// How often the session is repeated at most.
const REPEATED: usize = 16;
/// Task postures at most.
const TASK: usize = 60;

/// σ of the tool after a number of postures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Point {
    /// Postures.
    pub postures: usize,
    /// σ of the tool's position, m; null: not determined.
    pub sigma_m: Option<f64>,
}

/// The curve.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Curve {
    /// The body that stands for the tool.
    pub body: String,
    /// Postures of the session.
    pub postures: usize,
    /// From few postures to several sessions.
    pub points: Vec<Point>,
    /// What was asked for, m.
    pub asked_m: Option<f64>,
    /// Postures like those of the session that reach it at the least; null: no number up to sixteen sessions does, or nothing was asked.
    pub needed: Option<usize>,
}

/// The linearized session.
struct Linear {
    /// One after the other, information of each sample.
    samples: Vec<DMatrix<f64>>,
    before: DMatrix<f64>,
    b: DMatrix<f64>,
}

impl Linear {
    fn of(inputs: &Inputs, fit: &MlFit) -> Option<(String, Self)> {
        let (formulation, solution) = (&fit.formulation, &fit.solution);
        let model = &solution.model;
        let tool = tool_link(inputs)?;
        let mut bodies = inputs.robot.profile.bodies.iter();
        let (name, _) = bodies.find(|(_, body)| body.link == tool)?;
        let point = formulation.points.get(name).and_then(|p| p.values().next());
        let target = formulation.bodies.get(name).map(|f| Target::Frame(*f));
        let target = target.or(point.map(|p| Target::Point(*p)))?;
        let variances = &solution.theta;
        let all = model.whitened_rows(&solution.values, variances, 0..formulation.samples.len())?;
        let held_out = |s: &usize| model.is_held_out(*s);
        let (task, fitted): (Vec<usize>, Vec<usize>) = (0..all.len()).partition(held_out);
        let task = if task.is_empty() {
            fitted.clone()
        } else {
            task
        };
        let step = task.len().div_ceil(TASK).max(1);
        let task: Vec<usize> = task.into_iter().step_by(step).collect();
        let parameters = model.problem().parameters();
        let free = || model.free_parameters().iter().map(|p| &parameters[*p]);
        let scale = DVector::from_iterator(model.free(), free().map(Parameter::scale));
        let has_prior: Vec<bool> = free().map(|p| p.prior_sigma.is_some()).collect();
        let rows: Vec<DMatrix<f64>> = fitted.iter().map(|s| all[*s].clone()).collect();
        let basis = Basis::new(scale, &has_prior, &[&rows]);
        let mut b = DMatrix::zeros(3 * task.len(), model.free());
        for (k, s) in task.iter().enumerate() {
            let between = (formulation.tracker, target);
            let point = model.linear_points(&solution.values, between, *s..*s + 1);
            let point = point.ok()?.pop()?;
            let part = point.jacobian / (task.len() as f64).sqrt();
            b.rows_mut(3 * k, 3).copy_from(&part);
        }
        let samples = rows.iter().filter(|y| y.nrows() > 0);
        let samples = samples.map(|y| {
            let y = basis.of(y);
            y.transpose() * y
        });
        let linear = Self {
            samples: samples.collect(),
            before: basis.prior(&has_prior),
            b: basis.of(&b),
        };
        Some((name.clone(), linear))
    }

    /// σ after the first samples of an order, the session repeated where that is more.
    fn after(&self, count: usize, order: &[usize]) -> Option<f64> {
        let n = self.samples.len().max(1);
        let (whole, rest) = (count / n, count % n);
        let mut m = self.before.clone();
        for (place, s) in order.iter().enumerate() {
            let times = whole + usize::from(place < rest);
            if times > 0 {
                m += &self.samples[*s] * times as f64;
            }
        }
        sigma(&m, &self.b)
    }

    /// Mean over the orders; `None` where one of them leaves it open.
    fn mean(&self, count: usize, orders: &[Vec<usize>]) -> Option<f64> {
        let each: Option<Vec<f64>> = orders.iter().map(|o| self.after(count, o)).collect();
        each.map(|each| each.iter().sum::<f64>() / each.len() as f64)
    }
}

/// The curve of a session, and how many postures a σ needs.
#[must_use]
pub fn curve(session: &Session, seed: u64, asked: Option<f64>) -> Option<Curve> {
    /// Stream of random numbers of the orders.
    const STREAM: u64 = u64::MAX;
    let fit = session.fit()?;
    let (body, linear) = Linear::of(&session.own.inputs, fit)?;
    let n = linear.samples.len();
    let mut rng = Session::numbers(seed, STREAM);
    let orders = (0..ORDERS).map(|_| {
        let mut order: Vec<usize> = (0..n).collect();
        order.shuffle(&mut rng);
        order
    });
    let orders: Vec<Vec<usize>> = orders.collect();
    let mut counts = vec![n, 2 * n, 4 * n];
    let mut count = 6.0;
    while (count as usize) < n {
        counts.push(count as usize);
        count *= 1.4;
    }
    counts.sort_unstable();
    counts.dedup();
    let point = |postures: usize| Point {
        postures,
        sigma_m: linear.mean(postures, &orders),
    };
    let reaches = |count: usize| {
        let sigma = linear.mean(count, &orders);
        asked
            .zip(sigma)
            .is_some_and(|(asked, sigma)| sigma <= asked)
    };
    let most = REPEATED * n;
    let needed = (asked.is_some() && reaches(most)).then(|| {
        let (mut low, mut high) = (0, most);
        while high - low > 1 {
            let middle = low.midpoint(high);
            if reaches(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        high
    });
    Some(Curve {
        body,
        postures: n,
        points: counts.into_iter().map(point).collect(),
        asked_m: asked,
        needed,
    })
}
