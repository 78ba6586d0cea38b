//! A linearized model without some of its columns, from the model with them: no sums are made again.
//!
//! ```text
//! S = C_BB,   C₋ = C − C_B S⁻¹ C_Bᵀ,   Q₋ = Q − A C_B S⁻¹ C_Bᵀ Aᵀ,   δ₋ = δ − C_B S⁻¹ (x̂ + δ − x₀)_B          (1)
//! ```
//!
//! B are the columns that are taken out; the others are as in [`linear`](super::linear).

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::analysis::select::linear::{Fitted, Losses};
use crate::analysis::select::stack::Stack;

/// What taking columns B out of a model does.
pub(super) struct Less {
    /// Places of B among the columns of the model.
    places: Vec<usize>,
    /// S⁻¹.
    information: DMatrix<f64>,
    /// The same without the prior: what the data say of B, given the rest.
    pub by_data: DMatrix<f64>,
    /// Diagonal of H_BB.
    pub raw: Vec<f64>,
    /// (x̂ + δ − x₀)_B.
    pub moved: DVector<f64>,
    /// δ₋ − δ of the model's columns.
    change: DVector<f64>,
}

impl Fitted<'_> {
    /// Losses of each sample predicted from the others, with all columns and without each of these sets of them: (with, without). Sets
    /// that cannot be taken out are `None`.
    pub(super) fn losses_without(&self, sets: &[Option<Less>]) -> (Losses, Vec<Option<Losses>>) {
        let of_sample = |stack: &Stack<'_>, i: usize| {
            let s = stack.samples[i];
            let w = self.residual(s);
            let kept = stack.remainder(i);
            let loss = |kept: DMatrix<f64>, w: &DVector<f64>| {
                Some(s.loss(&(Stack::inverse_of(kept)? * w)))
            };
            let without = sets.iter().map(|less| {
                let less = less.as_ref()?;
                let b = stack.along(i).select_columns(&less.places);
                let kept = &kept + &b * &less.information * b.transpose();
                loss(kept, &(&w + stack.own(i) * &less.change))
            });
            let without = without.collect::<Vec<_>>();
            (loss(kept.clone(), &w), without)
        };
        let per_sample = self.of_each(of_sample);
        let of_set = |(k, less): (usize, &Option<Less>)| {
            let own = per_sample.iter().map(|s| s.1[k]);
            less.as_ref().map(|_| own.collect())
        };
        let without = sets.iter().enumerate().map(of_set).collect();
        (per_sample.iter().map(|s| s.0).collect(), without)
    }

    /// What taking these columns out does.
    pub(super) fn less(&self, columns: &[usize]) -> Option<Less> {
        let place = |c: &usize| self.active.binary_search(c).ok();
        let places: Vec<usize> = columns.iter().map(place).collect::<Option<_>>()?;
        let of = self.c.select_columns(&places);
        let own = of.select_rows(&places);
        let information = Cholesky::new(own)?.inverse();
        let moved = columns.iter().map(|&c| self.delta[c] + self.linear.off[c]);
        let moved = DVector::from_iterator(columns.len(), moved);
        let h = &self.linear.h;
        let raw: Vec<f64> = columns.iter().map(|&c| h[(c, c)]).collect();
        let mut by_data = information.clone();
        for (i, &c) in columns.iter().enumerate() {
            by_data[(i, i)] -= self.linear.prior(c);
        }
        Some(Less {
            change: -(&of * (&information * &moved)),
            moved,
            by_data,
            raw,
            information,
            places,
        })
    }

    /// The model without these columns.
    pub(super) fn without(&self, columns: &[usize]) -> Option<Self> {
        let less = self.less(columns)?;
        let kept: Vec<usize> = (0..self.active.len())
            .filter(|i| !less.places.contains(i))
            .collect();
        let of = self.c.select_columns(&less.places);
        let c = &self.c - &of * &less.information * of.transpose();
        let mut delta = self.delta.clone();
        for (i, &column) in self.active.iter().enumerate() {
            delta[column] += less.change[i];
        }
        for &column in columns {
            delta[column] = -self.linear.off[column];
        }
        Some(Self {
            linear: self.linear,
            active: kept.iter().map(|&i| self.active[i]).collect(),
            c: c.select_rows(&kept).select_columns(&kept),
            delta,
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

    use crate::analysis::estimate::try_out;
    use crate::analysis::select::linear::{Linear, Linearization};
    use crate::analysis::settings::Settings;
    use crate::graph::axis::Axis;
    use crate::graph::chart::Chart;
    use crate::graph::edge::Role;
    use crate::graph::effect::EffectKind;
    use crate::graph::measurement::MarkerObservation;
    use crate::graph::problem::{NoiseKind, Problem};
    use crate::model::layout::Model;

    /// A joint with a marker, its readings spread over 2 rad.
    fn problem() -> Problem {
        const COUNT: usize = 24;
        let mut p = Problem::new(COUNT);
        let frames = ["tracker", "base", "link"].map(|name| p.frame(name));
        let base = Isometry3::from_parts(
            Vector3::new(0.4, -0.2, 0.9).into(),
            UnitQuaternion::from_euler_angles(0.2, -0.3, 0.5),
        );
        let edge = p.unknown("base", frames[0], frames[1], base, Chart::full());
        p.set_role(edge, Role::World, None);
        p.set_prior(edge, Some(0.1), Some(0.1));
        let q: Vec<f64> = (0..COUNT)
            .map(|s| 2.0 * s as f64 / COUNT as f64 - 0.7)
            .collect();
        let axis = Axis::Revolute(Vector3::z_axis());
        let joint = p.joint("arm", frames[1], frames[2], axis, q.clone());
        p.free_effect_with(joint, EffectKind::Gain, q.clone(), Some(0.01));
        let noise = p.noise_group("markers", NoiseKind::Position, 1e-3, true);
        let at = Point3::new(0.5, 0.1, 0.2);
        let point = p.unknown_point("marker", frames[2], at, Some(0.1));
        let seen = q.iter().enumerate().map(|(sample, &q)| {
            // Not noise, but nothing that the model can follow.
            let off = 1e-3 * Vector3::from_fn(|k, _| (17.0 * (3 * sample + k) as f64).sin());
            MarkerObservation {
                sample,
                point,
                position: base
                    * (UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.004 * q) * at)
                    + off,
                shape: None,
            }
        });
        let seen = seen.collect();
        p.markers("marker", frames[0], frames[2], noise, seen);
        p
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-7 * (a.abs() + b.abs()) + 1e-12
    }

    #[test]
    fn a_model_without_columns_is_the_one_that_never_had_them() {
        let problem = problem();
        let trial = try_out(&problem, None, &Settings::default()).expect("a fit");
        let model = Model::new(&problem).expect("a model");
        let all = Linearization::at(&trial, &trial.weights, model, &trial.theta, 1);
        let all = all.expect("evaluable");
        let linear: Linear<'_> = all.all();
        let columns: Vec<usize> = (0..linear.off.len()).collect();
        let whole = linear.fit(columns.clone()).expect("evaluable");
        for out in [vec![6], vec![2, 5], vec![0, 6, 8]] {
            let rest: Vec<usize> = columns
                .iter()
                .filter(|c| !out.contains(c))
                .copied()
                .collect();
            let fitted = linear.fit(rest).expect("evaluable");
            let without = whole.without(&out).expect("can be taken out");
            assert_eq!(without.active, fitted.active);
            let pairs = without.delta.iter().zip(&fitted.delta);
            assert!(pairs.clone().all(|(a, b)| close(*a, *b)), "{out:?}");
            assert!(without.c.iter().zip(&fitted.c).all(|(a, b)| close(*a, *b)));
            let (_, losses) = whole.losses_without(&[whole.less(&out)]);
            let direct = fitted.predicted();
            let losses = losses[0].as_ref().expect("can be taken out");
            assert_eq!(losses.len(), direct.len());
            for ((loss, e), s) in losses.iter().zip(&direct).zip(&linear.samples) {
                let own = e.as_ref().map(|e| s.loss(e));
                assert!(
                    close(loss.expect("a loss"), own.expect("a loss")),
                    "{out:?}"
                );
            }
        }
    }
}
