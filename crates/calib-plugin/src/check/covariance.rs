//! Whether the covariance that an estimator states is the scatter of its answers.
//!
//! ```text
//! s_i = √(Σ e_i² / n)        scatter of component i over n noisy motions of a known joint           (1)
//! c_i = √(Σ C_ii / n)        what the estimator states                                            (2)
//! d²  = Σ eᵀ C⁻¹ e / (n f)   all f components together, correlations included: 1 where C is right  (3)
//! ```
//!
//! Components of a center are its coordinates, m; of an axis, its direction (rad) and its point (m) in two directions across it.

use std::time::{Duration, Instant};

use super::{
    motions::{self, CENTER, DIRECTION, POINT},
    subject::{Input, Reply, text},
};
use crate::{
    answer::{Answer, AorFit, CorFit},
    motion::{MotionData, Shape},
};

/// Noisy motions of each case. The scatter of so many has itself an error of 6 %.
const TRIALS: u64 = 120;
/// Samples of each.
const SAMPLES: usize = 100;
/// Noise of a coordinate, m, and of an orientation about each axis, rad: those of an ordinary tracker. So small that the answers are linear
/// in it.
const NOISE: (f64, f64) = (2e-4, 5e-4);
/// Stated and found σ may differ by this factor: eight standard errors of the scatter, which no honest covariance reaches.
const FACTOR: f64 = 1.5;
/// Answers that there must be: an estimator that answers nothing but exact data is of no use.
const ANSWERED: f64 = 0.5;

/// How the check ended.
pub(super) enum Stated {
    /// As the scatter is.
    Right,
    /// Otherwise, or not in every answer.
    Wrong(String),
    /// None is stated, or there was no time.
    Unknown(String),
}

/// Calls an estimator.
type Ask<'a> = dyn Fn(Input) -> Result<Reply, String> + 'a;

/// Compares what the estimator states with its scatter, for each shape, and with and without the tracker's σ.
pub(super) fn judge(ask: &Ask<'_>, shapes: &[Shape], axis: bool, limit: Duration) -> Stated {
    let began = Instant::now();
    for shape in shapes {
        for sigma in [true, false] {
            let mut tally = Tally::default();
            for trial in 0..TRIALS {
                if began.elapsed() > limit {
                    let calls = 2 * shapes.len() as u64 * TRIALS;
                    return Stated::Unknown(format!("{calls} calls take longer than {limit:?}"));
                }
                let motion = noisy(*shape, axis, sigma, trial);
                match ask(Input::Motion(Box::new(motion))) {
                    Ok(reply) => tally.take(&reply),
                    Err(problem) => return Stated::Wrong(problem),
                }
            }
            match tally.ended() {
                Stated::Right => {}
                Stated::Wrong(why) => {
                    let known = if sigma { "stated" } else { "not stated" };
                    return Stated::Wrong(format!(
                        "{}, σ of the tracker {known}: {why}",
                        shape.word()
                    ));
                }
                unknown @ Stated::Unknown(_) => return unknown,
            }
        }
    }
    Stated::Right
}

/// The motion of a known joint as a tracker with noise sees it.
fn noisy(shape: Shape, axis: bool, sigma: bool, trial: u64) -> MotionData {
    let (joint, rotations) = match axis {
        true => (&POINT, motions::hinge(SAMPLES)),
        false => (&CENTER, motions::ball(SAMPLES)),
    };
    let clean = motions::seen(shape, joint, &rotations);
    let mut data = motions::disturbed(&clean, NOISE, trial + 1);
    if axis {
        data.angles_rad = motions::angles(SAMPLES);
    }
    if sigma {
        data.sigma_t_m = Some(NOISE.0);
        data.sigma_r_rad = shape.is_poses().then_some(NOISE.1);
    }
    data.seed = trial + 1;
    data
}

/// What the trials gave.
#[derive(Default)]
struct Tally {
    answers: usize,
    refused: Vec<String>,
    without: usize,
    /// Sums of (1) and (2), by component.
    squares: Vec<f64>,
    variances: Vec<f64>,
    /// Sum of (3); infinite where a covariance is singular.
    distance: f64,
    axis: bool,
}

impl Tally {
    fn take(&mut self, reply: &Reply) {
        let found = match reply {
            Reply::Cor(answer) => match &**answer {
                Answer::Found(fit) => Some(of_center(fit)),
                Answer::NotObservable(_) => None,
            },
            Reply::Aor(answer) => match &**answer {
                Answer::Found(fit) => {
                    self.axis = true;
                    Some(of_axis(fit))
                }
                Answer::NotObservable(_) => None,
            },
            _ => None,
        };
        let Some((error, covariance)) = found else {
            self.refused.push(text(reply));
            return;
        };
        self.answers += 1;
        let Some(covariance) = covariance else {
            self.without += 1;
            return;
        };
        self.squares.resize(error.len(), 0.0);
        self.variances.resize(error.len(), 0.0);
        for (i, e) in error.iter().enumerate() {
            self.squares[i] += e * e;
            self.variances[i] += covariance[i][i];
        }
        self.distance += squared_distance(&covariance, &error).unwrap_or(f64::INFINITY);
    }

    fn ended(&self) -> Stated {
        let all = self.answers + self.refused.len();
        if (self.answers as f64) < ANSWERED * all as f64 {
            let said = self.refused.first().map_or("", String::as_str);
            let noise = 1e3 * NOISE.0;
            return Stated::Wrong(format!(
                "{} of {all} motions with noise of {noise} mm were answered ({said})",
                self.answers
            ));
        }
        if self.without == self.answers {
            return Stated::Unknown(
                "no covariance is stated; a run puts the σ of the prior in its place (finding origin-without-covariance)".to_owned(),
            );
        }
        if self.without > 0 {
            return Stated::Wrong(format!(
                "a covariance is stated in {} of {} answers",
                self.answers - self.without,
                self.answers
            ));
        }
        let n = self.answers as f64;
        for (i, (squares, variances)) in self.squares.iter().zip(&self.variances).enumerate() {
            let (scatter, stated) = ((squares / n).sqrt(), (variances / n).sqrt());
            // A NaN fails the comparison.
            if !(stated <= FACTOR * scatter && scatter <= FACTOR * stated) {
                let (what, unit) = component(self.axis, i);
                return Stated::Wrong(format!(
                    "{what}: the stated σ is {:.2e} {unit}, the scatter of {} answers {:.2e} {unit}",
                    stated, self.answers, scatter
                ));
            }
        }
        let ratio = (self.distance / (n * self.squares.len() as f64)).sqrt();
        if ratio <= FACTOR && FACTOR * ratio >= 1.0 {
            return Stated::Right;
        }
        Stated::Wrong(format!(
            "errors of {} answers are {ratio:.2} times what the covariance says (1 is right): its correlations are wrong",
            self.answers
        ))
    }
}

/// Name and unit of a component of (1).
fn component(axis: bool, i: usize) -> (&'static str, &'static str) {
    match (axis, i) {
        (false, 0) => ("x", "m"),
        (false, 1) => ("y", "m"),
        (false, _) => ("z", "m"),
        (true, 0 | 1) => ("direction", "rad"),
        (true, _) => ("point across the axis", "m"),
    }
}

/// An error and the covariance that is stated of it.
type Error = (Vec<f64>, Option<Vec<Vec<f64>>>);

fn of_center(fit: &CorFit) -> Error {
    let error = (0..3).map(|i| fit.center_m[i] - CENTER[i]).collect();
    let covariance = fit.covariance_m2.map(|c| c.map(Vec::from).to_vec());
    (error, covariance)
}

fn of_axis(fit: &AorFit) -> Error {
    let across = across(&DIRECTION);
    // The sign of a direction is a choice where the angles did not decide it.
    let sign = dot(&fit.line.direction, &DIRECTION).signum();
    let direction: [f64; 3] = std::array::from_fn(|i| sign * fit.line.direction[i] - DIRECTION[i]);
    let point: [f64; 3] = std::array::from_fn(|i| fit.line.point_m[i] - POINT[i]);
    // Rows of P, which takes [direction; point] to the four components. At a point away from the reference along the axis the true line
    // is where the reference's is: e = uᵀ (p − p₀) whatever the distance along it.
    let row = |at: usize, u: &[f64; 3]| -> [f64; 6] {
        std::array::from_fn(|i| match i.checked_sub(at) {
            Some(k) if k < 3 => u[k] * if at == 0 { sign } else { 1.0 },
            _ => 0.0,
        })
    };
    let p = [
        row(0, &across[0]),
        row(0, &across[1]),
        row(3, &across[0]),
        row(3, &across[1]),
    ];
    let error = vec![
        dot(&across[0], &direction),
        dot(&across[1], &direction),
        dot(&across[0], &point),
        dot(&across[1], &point),
    ];
    // P C Pᵀ
    let projected = |c: &[[f64; 6]; 6]| {
        let entry = |a: &[f64; 6], b: &[f64; 6]| -> f64 {
            let rows = (0..6).map(|i| a[i] * (0..6).map(|j| c[i][j] * b[j]).sum::<f64>());
            rows.sum()
        };
        let rows = p.iter().map(|a| p.iter().map(|b| entry(a, b)).collect());
        rows.collect()
    };
    (error, fit.covariance.as_ref().map(projected))
}

/// Two directions across an axis.
fn across(n: &[f64; 3]) -> [[f64; 3]; 2] {
    // n × x, which is not small: the axis is not along x.
    let length = (n[1] * n[1] + n[2] * n[2]).sqrt();
    let u = [0.0, n[2] / length, -n[1] / length];
    let v = [
        n[1] * u[2] - n[2] * u[1],
        n[2] * u[0] - n[0] * u[2],
        n[0] * u[1] - n[1] * u[0],
    ];
    [u, v]
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

/// `eᵀ C⁻¹ e` by elimination; `None` where C is not positive definite.
fn squared_distance(c: &[Vec<f64>], e: &[f64]) -> Option<f64> {
    let n = e.len();
    // C = L D Lᵀ, L y = e: d² = Σ y_i² / D_i
    let mut l = vec![vec![0.0; n]; n];
    let (mut d, mut y) = (vec![0.0; n], vec![0.0; n]);
    let mut sum = 0.0;
    for (i, error) in e.iter().enumerate() {
        for j in 0..i {
            let before: f64 = (0..j).map(|k| l[i][k] * l[j][k] * d[k]).sum();
            l[i][j] = (c[i][j] - before) / d[j];
        }
        d[i] = c[i][i] - (0..i).map(|k| l[i][k] * l[i][k] * d[k]).sum::<f64>();
        if d[i].is_nan() || d[i] <= 0.0 {
            return None;
        }
        y[i] = error - (0..i).map(|k| l[i][k] * y[k]).sum::<f64>();
        sum += y[i] * y[i] / d[i];
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_the_inverse() {
        // The inverse of [[4, 2], [2, 3]] is [[3, −2], [−2, 4]] / 8.
        let c = vec![vec![4.0, 2.0], vec![2.0, 3.0]];
        let d = squared_distance(&c, &[1.0, 2.0]).unwrap();
        assert!((d - (3.0 - 8.0 + 16.0) / 8.0).abs() < 1e-12, "{d}");
        assert!(squared_distance(&[vec![0.0]], &[1.0]).is_none());
        assert!(squared_distance(&[vec![f64::NAN]], &[1.0]).is_none());
    }

    #[test]
    fn noise_has_the_stated_size() {
        let clean = motions::seen(Shape::Poses, &CENTER, &motions::ball(SAMPLES));
        let mut sums = [0.0; 2];
        for trial in 0..TRIALS {
            let noisy = noisy(Shape::Poses, false, true, trial);
            let (a, b) = (clean.view(), noisy.view());
            for (a, b) in a.poses(0).flatten().zip(b.poses(0).flatten()) {
                sums[0] += (0..3)
                    .map(|i| (a.translation_m[i] - b.translation_m[i]).powi(2))
                    .sum::<f64>();
                // ‖R − R'‖² = 2 θ² for a small rotation.
                let change = |i: usize, j: usize| a.rotation[i][j] - b.rotation[i][j];
                let all = (0..3).flat_map(|i| (0..3).map(move |j| change(i, j).powi(2)));
                sums[1] += 0.5 * all.sum::<f64>();
            }
        }
        let n = 3.0 * TRIALS as f64 * SAMPLES as f64;
        let sigma = sums.map(|s| (s / n).sqrt());
        assert!((sigma[0] / NOISE.0 - 1.0).abs() < 0.02, "{sigma:?}");
        assert!((sigma[1] / NOISE.1 - 1.0).abs() < 0.02, "{sigma:?}");
    }
}
