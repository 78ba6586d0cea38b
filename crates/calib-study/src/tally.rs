//! Sums over trials, and the statistics they give.
//!
//! ```text
//! MSE = mean |e|²,   efficiency = bound / MSE                                                  (1)
//! e*  = C Σ_k A_kᵀ Σ_k⁻¹ ε_k     the efficient linear estimator's error: E e* = 0, E |e*|² = bound   (2)
//! MSE = mean |e|² − β (mean |e*|² − bound),   β = cov(|e|², |e*|²) / var |e*|²                 (3)
//! ```
//!
//! Where a scene knows (2), it serves as a control variate: the same noise gives e and e*, so most of the Monte-Carlo
//! error of (1) cancels in (3), and likewise in the mean error. It need not be efficient for the method at hand: any
//! linear function of the noise with a known mean square will do, the closer the better.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::cell::{Cell, Quantity, Scene};

/// Trials from which on β is estimated: with few, it fits the noise and hides the Monte-Carlo error.
const ENOUGH_FOR_CONTROL: u64 = 20;

/// Sums over the trials of one cell.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(into = "Kept", from = "Kept")]
pub(crate) struct Tally {
    pub trials: u64,
    pub answered: u64,
    pub observable: u64,
    abs: f64,
    e: Vector3<f64>,
    e2: f64,
    e4: f64,
    /// Sums with the control variate; `controlled` counts its trials.
    controlled: u64,
    l: Vector3<f64>,
    l2: f64,
    l4: f64,
    e2l2: f64,
    el: Vector3<f64>,
    ee: Vector3<f64>,
    ll: Vector3<f64>,
    predicted: f64,
}

impl Tally {
    /// A trial whose verdict counts and whose error does not.
    pub fn verdict(&mut self, answered: bool, observable: bool) {
        self.trials += 1;
        self.answered += u64::from(answered);
        self.observable += u64::from(observable);
    }

    /// A trial with an answer: its error, the trace of its covariance, and (2).
    pub fn error(
        &mut self,
        observable: bool,
        error: Vector3<f64>,
        predicted: f64,
        linear: Option<Vector3<f64>>,
    ) {
        self.verdict(true, observable);
        let square = error.norm_squared();
        self.abs += square.sqrt();
        self.e += error;
        self.ee += error.component_mul(&error);
        self.e2 += square;
        self.e4 += square * square;
        self.predicted += predicted;
        if let Some(l) = linear {
            let l2 = l.norm_squared();
            self.controlled += 1;
            self.l += l;
            self.ll += l.component_mul(&l);
            self.el += error.component_mul(&l);
            self.l2 += l2;
            self.l4 += l2 * l2;
            self.e2l2 += square * l2;
        }
    }

    /// Adds the sums of later trials.
    pub fn join(&mut self, later: &Self) {
        self.trials += later.trials;
        self.answered += later.answered;
        self.observable += later.observable;
        self.abs += later.abs;
        self.e += later.e;
        self.e2 += later.e2;
        self.e4 += later.e4;
        self.controlled += later.controlled;
        self.l += later.l;
        self.l2 += later.l2;
        self.l4 += later.l4;
        self.e2l2 += later.e2l2;
        self.el += later.el;
        self.ee += later.ee;
        self.ll += later.ll;
        self.predicted += later.predicted;
    }

    /// The statistics. `bound`: variance (trace) of the Cramér–Rao bound. Without two answers with an error there are none.
    pub fn cell(&self, scene: &Scene, row: &Row) -> Cell {
        let mut cell = Cell {
            scene: scene.clone(),
            method: row.method.clone(),
            estimator: row.estimator.clone(),
            from_plugin: row.from_plugin,
            quantity: row.quantity,
            trials: self.trials,
            answered: self.answered,
            observable: self.observable,
            rms: None,
            rms_mc: None,
            mean_abs: None,
            bias: None,
            bias_mc: None,
            bound: row.bound.map(f64::sqrt),
            efficiency: None,
            efficiency_mc: None,
            covariance_ratio: None,
            unbiased_limit: None,
            second_order_limit: None,
        };
        if self.answered < 2 || self.e2 <= 0.0 {
            return cell;
        }
        let n = self.answered as f64;
        let plain = self.e2 / n;
        let mut mse = plain;
        let mut mse_variance = (self.e4 / n - plain * plain).max(0.0) / n;
        let mut mean = self.e / n;
        let mut mean_variance = ((self.ee / n - mean.component_mul(&mean)) / n).map(|v| v.max(0.0));
        // A trial without an answer is not a random one: the control's expectation holds only over all.
        let every_trial = self.answered == self.trials
            && self.controlled == self.trials
            && self.trials >= ENOUGH_FOR_CONTROL;
        if let (true, Some(control)) = (every_trial, row.control) {
            let l2 = self.l2 / n;
            let spread = self.l4 / n - l2 * l2;
            if spread > 0.0 {
                let together = self.e2l2 / n - plain * l2;
                let beta = together / spread;
                let corrected = plain - beta * (l2 - control);
                if corrected > 0.0 {
                    mse = corrected;
                    mse_variance = (mse_variance - beta * together / n).max(0.0);
                }
            }
            let l = self.l / n;
            for i in 0..3 {
                let spread = self.ll[i] / n - l[i] * l[i];
                if spread > 0.0 {
                    let together = self.el[i] / n - mean[i] * l[i];
                    mean[i] -= together / spread * l[i];
                    mean_variance[i] =
                        (mean_variance[i] - together * together / spread / n).max(0.0);
                }
            }
        }
        let mse_mc = mse_variance.sqrt();
        let rms = mse.sqrt();
        cell.rms = Some(rms);
        cell.rms_mc = Some(0.5 * mse_mc / rms);
        cell.mean_abs = Some(self.abs / n);
        cell.bias = Some(mean.norm());
        cell.bias_mc = Some(mean_variance.sum().sqrt());
        if let Some(bound) = row.bound {
            cell.efficiency = Some(bound / mse);
            cell.efficiency_mc = Some(bound / mse * mse_mc / mse);
        }
        if self.predicted.is_finite() && self.predicted > 0.0 {
            cell.covariance_ratio = Some(self.predicted / n / mse);
        }
        cell
    }
}

/// A tally as a shard keeps it: trials, answers, observable, with a control variate; then the sums, in the order of the fields.
#[derive(Serialize, Deserialize)]
struct Kept {
    counts: [u64; 4],
    sums: [Number; 7],
    vectors: [[Number; 3]; 5],
}

/// JSON has no words for what is not finite: `"NaN"`, `"inf"`.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Number {
    Finite(f64),
    Other(String),
}

impl From<f64> for Number {
    fn from(value: f64) -> Self {
        match value.is_finite() {
            true => Self::Finite(value),
            false => Self::Other(value.to_string()),
        }
    }
}

impl From<Number> for f64 {
    fn from(number: Number) -> Self {
        match number {
            Number::Finite(value) => value,
            Number::Other(word) => word.parse().unwrap_or(Self::NAN),
        }
    }
}

impl From<Tally> for Kept {
    fn from(t: Tally) -> Self {
        let vectors = [t.e, t.l, t.el, t.ee, t.ll];
        Self {
            counts: [t.trials, t.answered, t.observable, t.controlled],
            sums: [t.abs, t.e2, t.e4, t.l2, t.l4, t.e2l2, t.predicted].map(Number::from),
            vectors: vectors.map(|v| [v.x, v.y, v.z].map(Number::from)),
        }
    }
}

impl From<Kept> for Tally {
    fn from(kept: Kept) -> Self {
        let [trials, answered, observable, controlled] = kept.counts;
        let [abs, e2, e4, l2, l4, e2l2, predicted] = kept.sums.map(f64::from);
        let [e, l, el, ee, ll] = kept.vectors.map(|v| Vector3::from(v.map(f64::from)));
        Self {
            trials,
            answered,
            observable,
            abs,
            e,
            e2,
            e4,
            controlled,
            l,
            l2,
            l4,
            e2l2,
            el,
            ee,
            ll,
            predicted,
        }
    }
}

/// One line of an experiment: a method and a quantity of it.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    pub method: String,
    pub estimator: String,
    /// Whether a plugin offers the estimator.
    pub from_plugin: bool,
    pub quantity: Quantity,
    /// Trace of the Cramér–Rao bound, squared unit.
    pub bound: Option<f64>,
    /// Mean square of the control variate, where there is one: the bound of the data that it uses.
    pub control: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{cell::Part, noise::Noise};

    fn scene() -> Scene {
        Scene {
            part: Part::Grid,
            motion: "hand".into(),
            condition: String::new(),
            samples: 9,
            radius_m: 0.1,
            sigma_t_m: 1e-3,
            sigma_r_rad: 0.0,
        }
    }

    fn row(bound: f64) -> Row {
        Row {
            method: "m".into(),
            estimator: "m".to_owned(),
            from_plugin: false,
            quantity: Quantity::Center,
            bound: Some(bound),
            control: Some(bound),
        }
    }

    /// e = 2 e* + own noise: MSE = 4·3 + 3·0.09, with and without the control.
    fn tally(control: bool) -> Tally {
        let mut tally = Tally::default();
        for k in 0..2000 {
            let mut noise = Noise::of_trial(3, "tally", k);
            let l = noise.vector(1.0);
            let e = l * 2.0 + noise.vector(0.3);
            tally.error(true, e, 12.27, control.then_some(l));
        }
        tally
    }

    #[test]
    fn sums_are_kept_to_the_bit() {
        let mut tally = Tally::default();
        let error = Vector3::new(0.1, 1.0 / 3.0, -2e-300);
        tally.error(true, error, f64::INFINITY, Some(error * 0.7));
        tally.error(false, -error * 1e9, 3e-5, None);
        tally.verdict(false, true);
        let text = serde_json::to_string(&tally).expect("written");
        let read: Tally = serde_json::from_str(&text).expect("read");
        assert_eq!(format!("{read:?}"), format!("{tally:?}"));
        assert!(text.contains("\"inf\""), "{text}");
    }

    #[test]
    fn the_control_variate_changes_the_error_and_not_the_answer() {
        let plain = tally(false).cell(&scene(), &row(3.0));
        let precise = tally(true).cell(&scene(), &row(3.0));
        let truth = 3.0 / 12.27;
        for cell in [&plain, &precise] {
            let (value, mc) = (cell.efficiency.unwrap(), cell.efficiency_mc.unwrap());
            assert!((value - truth).abs() < 4.0 * mc, "{value} ± {mc}");
        }
        assert!(precise.efficiency_mc.unwrap() < 0.4 * plain.efficiency_mc.unwrap());
        assert!(precise.bias_mc.unwrap() < 0.2 * plain.bias_mc.unwrap());
        assert!(precise.bias.unwrap() < 4.0 * precise.bias_mc.unwrap());
    }

    #[test]
    fn joined_sums_are_the_sums() {
        let mut first = Tally::default();
        let mut second = Tally::default();
        let mut whole = Tally::default();
        for k in 0..10 {
            let e = Vector3::new(k as f64, 1.0, -2.0);
            whole.error(k % 2 == 0, e, 1.0, None);
            if k < 4 { &mut first } else { &mut second }.error(k % 2 == 0, e, 1.0, None);
        }
        first.join(&second);
        assert_eq!(
            first.cell(&scene(), &row(1.0)),
            whole.cell(&scene(), &row(1.0))
        );
        assert_eq!(whole.observable, 5);
    }

    #[test]
    fn a_single_answer_has_no_statistics() {
        let mut tally = Tally::default();
        tally.verdict(false, false);
        tally.error(true, Vector3::x(), 1.0, None);
        let cell = tally.cell(&scene(), &row(1.0));
        assert_eq!((cell.trials, cell.answered, cell.rms), (2, 1, None));
    }
}
