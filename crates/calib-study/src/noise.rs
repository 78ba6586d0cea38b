//! Random draws that are the same on every machine, whatever thread makes them.

use nalgebra::{UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// The draws of one trial.
pub(crate) struct Noise(ChaCha8Rng);

impl Noise {
    /// Draws of trial `number` of the experiment called `id`: no other trial shares them, and none depends on the order.
    pub fn of_trial(seed: u64, id: &str, number: u64) -> Self {
        // FNV-1a of the name, then one SplitMix64 step for each part.
        let name = id.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| {
            (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
        });
        Self(ChaCha8Rng::seed_from_u64(mix(
            mix(mix(seed) ^ name) ^ number
        )))
    }

    /// Three independent normal coordinates.
    pub fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| {
            let x: f64 = StandardNormal.sample(&mut self.0);
            sigma * x
        })
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0.random::<f64>()
    }

    /// Uniform between two numbers.
    pub fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.uniform()
    }

    /// Log-uniform between two positive numbers.
    pub fn log_between(&mut self, from: f64, to: f64) -> f64 {
        from * (to / from).powf(self.uniform())
    }

    /// Uniform in 0..n (n ≥ 1).
    pub fn below(&mut self, n: usize) -> usize {
        ((self.uniform() * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// A direction, all equally likely.
    pub fn direction(&mut self) -> Vector3<f64> {
        self.vector(1.0)
            .try_normalize(0.0)
            .unwrap_or_else(Vector3::x)
    }

    /// A rotation by independent normal angles.
    pub fn turn(&mut self, sigma: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(self.vector(sigma))
    }
}

fn mix(x: u64) -> u64 {
    let mut z = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
