//! The sums and the score against dense factors.

mod parts;

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Vector3};

use crate::graph::measurement::{Growth, Sight};
use crate::model::layout::Model;
use crate::model::values::Values;
use crate::solve::components::{Sums, sums};
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::normal::accumulate;
use crate::solve::whitened::{Whitened, covariance_of, whitened};
use crate::*;

/// Markers on a body: two are rows of their own, more are turned into six; the first three lie on a line.
const MARKERS: [usize; 4] = [2, 3, 4, 6];

/// Markers and a body pose behind two noisy joints; everything that can be wrong in a sum is different here.
fn problem(markers: usize) -> Problem {
    let n = 14;
    let q = |a: f64| (0..n).map(|i| (f64::from(i) * a).sin()).collect::<Vec<_>>();
    let mut p = Problem::new(n as usize);
    let base = p.frame("base");
    let a = p.frame("a");
    let b = p.frame("b");
    let c = p.frame("c");
    let d = p.frame("d");
    let x = Isometry3::new(Vector3::new(0.3, 0.1, 0.2), Vector3::new(0.2, -0.4, 0.5));
    p.unknown("first", base, a, x, Chart::full());
    let turn = p.joint("turn", a, b, Axis::Revolute(Vector3::z_axis()), q(0.9));
    p.known("elbow", b, c, x);
    let tilt = p.joint("tilt", c, d, Axis::Revolute(Vector3::x_axis()), q(0.53));
    p.free_effect(turn, EffectKind::ZeroOffset, Some(0.1));
    let joint = p.noise_group("joint", NoiseKind::Joint, 4e-3, true);
    p.joint_noise(turn, joint);
    p.joint_noise(tilt, joint);
    let marker = p.noise_group("marker", NoiseKind::Position, 2e-3, true);
    let orientation = p.noise_group("orientation", NoiseKind::Orientation, 3e-3, true);
    let position = p.noise_group("position", NoiseKind::Position, 1e-3, false);
    let known = Point3::new(0.3, 0.1, 0.0);
    let first = Point3::new(0.1, -0.2, 0.3);
    let points: Vec<_> = (0..markers)
        .map(|i| match i {
            0 => p.known_point("k", d, known),
            1 => p.unknown_point("u", d, first, None),
            2 => p.known_point("between", d, nalgebra::center(&known, &first)),
            _ => {
                let at = Point3::new(0.1 * i as f64, 0.3, (i as f64).sin());
                p.unknown_point(&format!("u{i}"), d, at, Some(0.1))
            }
        })
        .collect();
    let seen = (0..markers * n as usize)
        .map(|i| MarkerObservation {
            sample: i / markers,
            point: points[i % markers],
            position: Point3::new((i as f64).sin(), (i as f64 * 1.7).cos(), 0.1),
            shape: None,
        })
        .collect();
    p.markers("hand", base, d, marker, seen);
    let noise = PoseNoise::Split {
        orientation,
        position,
    };
    let poses = (0..n as usize)
        .map(|sample| PoseObservation {
            sample,
            pose: x,
            inverse: false,
        })
        .collect();
    p.poses("arm", base, b, noise, poses);
    along_sight(&mut p, (base, c), points[0], noise);
    p
}

/// A pose and a marker with levels of their own along the line of sight, of which those of positions grow.
fn along_sight(p: &mut Problem, (from, to): (FrameId, FrameId), known: PointId, noise: PoseNoise) {
    let along = p.noise_group("along", NoiseKind::Position, 5e-3, true);
    let about = p.noise_group("about", NoiseKind::Orientation, 1e-3, true);
    let mut sight = Sight {
        along,
        about: Some(about),
        growth: Growth {
            positions: Some(0.7),
            orientations: None,
        },
    };
    let at = |sample: usize| Vector3::new(0.3, (sample as f64).cos(), 1.0);
    let poses = (0..p.samples())
        .map(|sample| PoseObservation {
            sample,
            pose: Isometry3::new(at(sample), Vector3::new(0.1, 0.0, (sample as f64).sin())),
            inverse: sample % 2 == 1,
        })
        .collect();
    p.poses("camera", from, to, noise, poses);
    p.noise_along_sight(sight);
    let PoseNoise::Split { position, .. } = noise else {
        return;
    };
    sight.about = None;
    let seen = (0..p.samples())
        .map(|sample| MarkerObservation {
            sample,
            point: known,
            position: at(sample).into(),
            shape: None,
        })
        .collect();
    let of_known = p.points()[known.index()].frame;
    p.markers("depth", from, of_known, position, seen);
    p.noise_along_sight(sight);
}

/// A model at its start, with the noise that was stated; every observation of its own weight.
struct Case {
    model: Model,
    values: Values,
    weights: Vec<f64>,
    theta: Vec<f64>,
    work: Workspace,
}

impl Case {
    fn new(markers: usize, weight: impl Fn(usize) -> f64) -> Self {
        let model = Model::new(&problem(markers)).unwrap();
        let sigmas = model.problem.groups.iter().map(|g| g.sigma);
        Self {
            values: model.start(),
            weights: (0..model.observation_count()).map(weight).collect(),
            theta: sigmas.map(|s| s.powi(2)).collect(),
            work: Workspace::new(&model),
            model,
        }
    }

    fn system(&mut self) -> NormalEquations {
        let mut system = NormalEquations::new(self.model.free());
        let objective = Objective {
            model: &self.model,
            weights: &self.weights,
            theta: &self.theta,
        };
        assert!(accumulate(
            objective,
            &self.values,
            &mut self.work,
            &mut system
        ));
        system
    }

    /// Every sample in dense factors, at other variances than the stated ones.
    fn dense(&mut self, theta: &[f64]) -> Vec<Whitened> {
        let (model, values, work) = (&self.model, &self.values, &mut self.work);
        work.cache.update(&model.problem, values);
        let objective = Objective {
            model,
            weights: &self.weights,
            theta,
        };
        (0..model.problem.samples)
            .map(|s| whitened(objective, values, s, work).unwrap())
            .collect()
    }

    /// Variances of which one is `factor` times what was stated.
    fn scaled(&self, group: usize, factor: f64) -> Vec<f64> {
        let mut theta = self.theta.clone();
        theta[group] *= factor;
        theta
    }

    /// Diagonal of the prior's information.
    fn prior(&self, column: usize) -> f64 {
        let sigma = self.model.problem.parameters[self.model.columns[column]].prior_sigma;
        sigma.map_or(0.0, |s| 1.0 / (s * s))
    }

    /// −½ [ Σ log det V + log det H + Σ eᵀV⁻¹e ] by dense factors: what (2) is the gradient of at fixed values.
    fn likelihood(&mut self, theta: &[f64]) -> f64 {
        let n = self.model.free();
        let mut h = DMatrix::from_fn(n, n, |i, j| if i == j { self.prior(i) } else { 0.0 });
        let mut sum = 0.0;
        for s in self.dense(theta) {
            s.a.add_gram(1.0, &mut h);
            sum += s.log_det + s.w.norm_squared();
        }
        let cholesky = nalgebra::Cholesky::new(h).unwrap();
        -0.5 * (sum + 2.0 * cholesky.l().diagonal().map(f64::ln).sum())
    }
}

/// Groups of [`problem`] that are estimated: joint, marker, orientation.
const GROUPS: [usize; 3] = [0, 1, 2];

fn unequal_weights(observation: usize) -> f64 {
    [1.0, 0.3, 2.0, 0.0, 0.7][observation % 5]
}

fn sums_of(case: &mut Case) -> Sums {
    let objective = Objective {
        model: &case.model,
        weights: &case.weights,
        theta: &case.theta,
    };
    sums(objective, &case.values, &GROUPS, &mut case.work).unwrap()
}

#[test]
fn the_score_is_the_gradient_of_the_restricted_likelihood() {
    MARKERS.into_iter().for_each(score_is_gradient);
}

fn score_is_gradient(markers: usize) {
    let mut case = Case::new(markers, unequal_weights);
    let system = case.system();
    let c = covariance_of(&system).unwrap();
    let sums = sums_of(&mut case);
    // Position noise is stated here: it goes into the rest, and the sum is still all of H.
    let own = sums.normal_equations(&case.model, &case.values);
    let scale = system.h.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    for (a, b) in own.h.iter().zip(&system.h) {
        assert!((a - b).abs() < 1e-10 * scale);
    }
    let taken = sums.traces_with(&c);
    for (i, &g) in GROUPS.iter().enumerate() {
        let score = 0.5 * (sums.squares[i] - sums.traces[i] + taken[i]);
        const STEP: f64 = 1e-4;
        let mut at = |step: f64| {
            let theta = case.scaled(g, step.exp());
            case.likelihood(&theta)
        };
        let slope = (at(STEP) - at(-STEP)) / (2.0 * STEP);
        assert!(
            (score - slope).abs() < 1e-5 * slope.abs().max(1.0),
            "{g}: {score} {slope}"
        );
    }
}

/// The sums of (3) against dense factors: tr(V_g V⁻¹) and tr(V_g V⁻¹ V_h V⁻¹), in log θ.
#[test]
fn the_expected_information_is_that_of_dense_factors() {
    MARKERS.into_iter().for_each(information_is_dense);
}

fn information_is_dense(markers: usize) {
    let mut case = Case::new(markers, unequal_weights);
    let sums = sums_of(&mut case);
    let at = case.dense(&case.theta.clone());
    // B_g = L⁻¹ (∂V/∂log θ_g) L⁻ᵀ; V is linear in θ, so the difference to twice θ_g is the derivative.
    let changes: Vec<Vec<DMatrix<f64>>> = GROUPS
        .iter()
        .map(|&g| {
            let twice = case.dense(&case.scaled(g, 2.0));
            let of_sample = |(s, twice): (&Whitened, &Whitened)| {
                let change = &twice.l * twice.l.transpose() - &s.l * s.l.transpose();
                &s.l_inverse * change * s.l_inverse.transpose()
            };
            at.iter().zip(&twice).map(of_sample).collect()
        })
        .collect();
    for g in 0..GROUPS.len() {
        let trace: f64 = changes[g].iter().map(DMatrix::trace).sum();
        assert!((sums.traces[g] - trace).abs() < 1e-9 * trace, "{g}");
        for h in 0..GROUPS.len() {
            // tr(B_g B_h) of symmetric matrices
            let pairs = changes[g].iter().zip(&changes[h]);
            let dense: f64 = pairs.map(|(a, b)| a.dot(b)).sum();
            let found = sums.products[(g, h)];
            assert!(
                dense > 0.0,
                "groups {g} and {h} share no row: nothing is tested"
            );
            assert!(
                (found - dense).abs() < 1e-9 * dense,
                "{g} {h}: {found} {dense}"
            );
        }
    }
}

#[test]
fn dense_and_structured_whitening_give_the_same_normal_equations() {
    MARKERS.into_iter().for_each(equations_are_dense);
}

fn equations_are_dense(markers: usize) {
    let mut case = Case::new(markers, |_| 0.7);
    let system = case.system();
    let n = case.model.free();
    let (mut h, mut g, mut cost) = (DMatrix::zeros(n, n), DVector::zeros(n), 0.0);
    for s in case.dense(&case.theta.clone()) {
        s.a.add_gram(1.0, &mut h);
        s.a.add_transposed_vector(&s.w, &mut g);
        cost += s.w.norm_squared();
    }
    let scale = h.amax();
    for a in 0..n {
        for b in a..n {
            let prior = if a == b { case.prior(a) } else { 0.0 };
            assert!((system.h[a * n + b] - prior - h[(a, b)]).abs() < 1e-11 * scale);
        }
        assert!((system.g[a] - g[a]).abs() < 1e-10 * g.amax());
    }
    assert!((system.data - cost).abs() < 1e-11 * cost);
    // A step is judged by the V that proposed it.
    let objective = Objective {
        model: &case.model,
        weights: &case.weights,
        theta: &case.theta,
    };
    let again = crate::solve::normal::cost(objective, &case.values, &mut case.work);
    assert!((again - system.cost()).abs() < 1e-11 * cost);
    // So is one that goes somewhere else.
    let mut moved = case.values.clone();
    let columns = case.model.columns.iter();
    columns.for_each(|p| moved.0[*p] += 0.01 * (*p as f64).cos());
    let there = crate::solve::normal::cost(objective, &moved, &mut case.work);
    let residuals = case.model.residuals(&moved);
    let (mut expected, mut first) = (0.0, 0);
    for s in case.dense(&case.theta.clone()) {
        let m = s.w.len();
        expected += (&s.l_inverse * residuals.rows(first, m)).norm_squared();
        first += m;
    }
    for (c, p) in case.model.columns.iter().enumerate() {
        let off = moved.0[*p] - case.model.problem.parameters[*p].nominal;
        expected += case.prior(c) * off * off;
    }
    assert!(
        (there - expected).abs() < 1e-10 * expected,
        "{markers}: {there} {expected}"
    );
}
