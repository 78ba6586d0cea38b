//! Columns of the score tests: each is a reading times the derivative by a reading, so none is ever written out.
//!
//! ```text
//! G_js = −q_s D_j  of a gain or coupling,   G = −Σ_j q̇_j D_j  of a lag, and of a latency over its joints, −D_j of a zero     (1)
//! Dᵀ V⁻¹ A = (1 + λ DᵀD)⁻¹ Dᵀ A,            V = 1 + λ D Dᵀ                                            (2)
//! ```
//!
//! (2) is computed once for an instant; the products of every test with the other columns are multiples of its rows.

use nalgebra::{DMatrix, DVector};

use super::ids::{JointIndex, RecordingIndex};
use super::whitened::JointNoise;

/// One test.
#[derive(Debug, Clone)]
pub(crate) enum Test {
    /// `reading_joint += k · reading_source`.
    Reading {
        joint: JointIndex,
        source: JointIndex,
    },
    /// Every reading of the recording as it was k seconds later.
    Lag { recording: RecordingIndex },
    /// The readings of these joints as they were k seconds later: of one, or of one and those that it carries.
    Latency { joints: Vec<JointIndex> },
    /// `reading_joint += k`, by more than the prior of the geometry allows.
    Zero { joint: JointIndex },
}

/// What the columns of an instant's tests depend on.
pub(super) struct Instant<'a> {
    pub readings: &'a [f64],
    pub recording: RecordingIndex,
    /// Of the readings, per second; `None` where they are not known.
    pub rates: Option<&'a [f64]>,
}

/// Products of the tests' columns with the others and with themselves, as they grow.
pub(super) struct TestedSums<'a> {
    lambda: f64,
    tests: &'a [Test],
    /// Columns of the model and the residual × tests.
    pub cross: DMatrix<f64>,
    /// Square of every test's column.
    pub own: DVector<f64>,
}

impl<'a> TestedSums<'a> {
    pub(super) fn new(lambda: f64, width: usize, tests: &'a [Test]) -> Self {
        Self {
            lambda,
            tests,
            cross: DMatrix::zeros(width, tests.len()),
            own: DVector::zeros(tests.len()),
        }
    }

    /// Adds the rows of one instant.
    pub(super) fn add(&mut self, noise: &JointNoise, instant: &Instant<'_>) {
        if self.tests.is_empty() {
            return;
        }
        let Some(whitened) = noise.whitened(self.lambda) else {
            return;
        };
        for (t, test) in self.tests.iter().enumerate() {
            match test {
                Test::Reading { joint, source } => {
                    self.add_joint(t, *joint, -instant.readings[source.0], noise, &whitened);
                }
                Test::Zero { joint } => self.add_joint(t, *joint, -1.0, noise, &whitened),
                Test::Latency { joints } => {
                    self.add_later(t, instant, noise, &whitened, |j| {
                        joints.contains(&JointIndex(j))
                    });
                }
                Test::Lag { recording } if instant.recording == *recording => {
                    self.add_later(t, instant, noise, &whitened, |_| true);
                }
                Test::Lag { .. } => {}
            }
        }
    }

    /// Adds the column of test `t`: what moves where the readings that are `late` were later.
    fn add_later(
        &mut self,
        t: usize,
        instant: &Instant<'_>,
        noise: &JointNoise,
        (with_block, with_itself): &(DMatrix<f64>, DMatrix<f64>),
        late: impl Fn(usize) -> bool,
    ) {
        let Some(rates) = instant.rates else {
            return;
        };
        let rate = |j: usize| match late(j) {
            true => -rates.get(j).copied().unwrap_or(0.0),
            false => 0.0,
        };
        let rates = DVector::from_iterator(with_itself.nrows(), noise.joints().map(rate));
        let column = with_block * &rates;
        self.cross.column_mut(t).axpy(1.0, &column, 1.0);
        self.own[t] += rates.dot(&(with_itself * &rates));
    }

    /// Adds the column of test `t`: `by` times the derivative by the joint's reading.
    fn add_joint(
        &mut self,
        t: usize,
        joint: JointIndex,
        by: f64,
        noise: &JointNoise,
        (with_block, with_itself): &(DMatrix<f64>, DMatrix<f64>),
    ) {
        if let Some(j) = noise.place(joint.0).filter(|_| by != 0.0) {
            let column = with_block.column(j);
            self.cross.column_mut(t).axpy(by, &column, 1.0);
            self.own[t] += by * by * with_itself[(j, j)];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The columns written out, by the inverse of V itself.
    #[test]
    fn sums_are_those_of_the_columns() {
        let (width, joints, instants) = (6, 3, 5);
        let of = |i: usize, k: usize, a: f64| (a * (1 + i * 7 + k * 3) as f64).sin();
        let mut tests: Vec<Test> = (0..joints)
            .flat_map(|j| (0..joints).map(move |s| (JointIndex(j), JointIndex(s))))
            .map(|(joint, source)| Test::Reading { joint, source })
            .collect();
        let recordings = [RecordingIndex(0), RecordingIndex(1)];
        tests.extend(recordings.map(|recording| Test::Lag { recording }));
        tests.extend((0..joints).map(|j| Test::Latency {
            joints: vec![JointIndex(j)],
        }));
        tests.push(Test::Latency {
            joints: vec![JointIndex(1), JointIndex(2)],
        });
        tests.extend((0..joints).map(|j| Test::Zero {
            joint: JointIndex(j),
        }));
        for (rows, lambda, weight) in [(3, 0.7, 1.0), (12, 0.7, 0.06), (6, 0.0, 1.0)] {
            let mut sums = TestedSums::new(lambda, width, &tests);
            let mut expected = DMatrix::<f64>::zeros(width, tests.len());
            let mut own = DVector::<f64>::zeros(tests.len());
            for n in 0..instants {
                let block = DMatrix::from_fn(rows, width, |i, k| of(i, k, 1.3 + n as f64));
                let d = DMatrix::from_fn(rows, joints, |i, k| of(i, k, 0.7 + n as f64));
                let readings: Vec<f64> = (0..joints).map(|k| of(n, k, 0.4)).collect();
                let rates: Vec<f64> = (0..joints).map(|k| of(n, k, 0.9)).collect();
                let instant = Instant {
                    readings: &readings,
                    recording: recordings[n % 2],
                    rates: (n != 4).then_some(rates.as_slice()),
                };
                sums.add(&JointNoise::of_columns(&d, &block, weight), &instant);
                let noise = &d * d.transpose() * (lambda * weight * weight);
                let v = DMatrix::identity(rows, rows) + noise;
                let inverse = v.try_inverse().expect("regular");
                for (t, test) in tests.iter().enumerate() {
                    let column: DVector<f64> = match test {
                        Test::Reading { joint, source } => d.column(joint.0) * -readings[source.0],
                        Test::Lag { recording } if recording.0 == n % 2 && n != 4 => {
                            &d * -DVector::from_column_slice(&rates)
                        }
                        Test::Latency { joints } if n != 4 => {
                            let own = joints.iter().map(|j| d.column(j.0) * -rates[j.0]);
                            own.fold(DVector::zeros(rows), |sum, own| sum + own)
                        }
                        Test::Zero { joint } => -d.column(joint.0),
                        Test::Lag { .. } | Test::Latency { .. } => DVector::zeros(rows),
                    };
                    let whitened = &inverse * &column;
                    expected.column_mut(t).gemv_tr(1.0, &block, &whitened, 1.0);
                    own[t] += column.dot(&whitened);
                }
            }
            for t in 0..tests.len() {
                for i in 0..width {
                    assert!((sums.cross[(i, t)] - expected[(i, t)]).abs() < 1e-11);
                }
                assert!((sums.own[t] - own[t]).abs() < 1e-11);
            }
        }
    }
}
