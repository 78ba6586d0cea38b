//! Couplings that the profile declares: their factor is unknown, so the one that the registration fits best is taken, where it fits clearly better.
//! A small coupling is hidden under the errors of the nominal robot, and a factor that fits these is none.

use calib_checks::structural::{Chain, Data, JointIndex, registration_residual, thin};

use crate::prepare::inputs::Inputs;

/// Factors between which a coupling is looked for; beyond ±1 only unusual transmissions lie.
const RANGE: f64 = 2.0;
/// Steps of the first search: the residual has one minimum within a step.
const STEPS: i32 = 8;
/// Golden-section steps: 0.618²⁰ of a step is 2e-5.
const REFINEMENTS: usize = 20;
/// A coupling that is not small divides the residual by more: the ratio that names a mistake.
const CLEARLY: f64 = 1.5;
/// Rows that a factor needs: it is one number.
const ROWS: usize = 200;

/// A coupling `q_joint += factor · reading_source` that the profile declares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coupling {
    /// Joint that moves too.
    pub joint: JointIndex,
    /// Joint that moves it.
    pub source: JointIndex,
    /// rad or m per rad or m.
    pub factor: f64,
}

/// The declared couplings, one after the other.
#[must_use]
pub fn couplings(inputs: &Inputs, data: &Data) -> Vec<Coupling> {
    let mut found = Vec::new();
    let mut data = thin(data, ROWS);
    for (joint, exception) in &inputs.robot.profile.solve.joints {
        for source in &exception.coupled_to {
            let (joint, source) = (JointIndex::from(*joint), JointIndex::from(*source));
            if let Some(factor) = best_factor(&data, joint, source) {
                data.chain = data.chain.with_coupling(joint, source, factor);
                found.push(Coupling {
                    joint,
                    source,
                    factor,
                });
            }
        }
    }
    found
}

/// The chain with the couplings.
#[must_use]
pub fn coupled(chain: Chain, couplings: &[Coupling]) -> Chain {
    couplings.iter().fold(chain, |chain, c| {
        chain.with_coupling(c.joint, c.source, c.factor)
    })
}

fn best_factor(data: &Data, joint: JointIndex, source: JointIndex) -> Option<f64> {
    let mut with = data.clone();
    let mut residual = |factor: f64| {
        with.chain = data.chain.clone().with_coupling(joint, source, factor);
        registration_residual(&with).ok()
    };
    let step = RANGE / f64::from(STEPS);
    let without = residual(0.0)?;
    let mut best = (without, 0.0);
    for k in -STEPS..=STEPS {
        let factor = step * f64::from(k);
        let r = residual(factor)?;
        if r < best.0 {
            best = (r, factor);
        }
    }
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (best.1 - step, best.1 + step);
    for _ in 0..REFINEMENTS {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if residual(a)? < residual(b)? {
            high = b;
        } else {
            low = a;
        }
    }
    let found = 0.5 * (low + high);
    (CLEARLY * residual(found)? < without).then_some(found)
}
