//! What a calibration must be compared with: the nominal robot, and the nominal robot placed where the tracker sees it.

use std::collections::BTreeSet;

use crate::graph::edge::{EdgeKind, Role};
use crate::graph::effect::EffectKind;
use crate::graph::problem::Problem;
use crate::graph::unit::{DEFAULT_ROTATION_SIGMA, DEFAULT_TRANSLATION_SIGMA};

/// How much of a problem is left free.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Baseline {
    /// Nothing: every parameter is held at nominal.
    Nominal,
    /// World frames, mounts and marker coordinates only: what a mere registration reaches. The held-out
    /// error of a calibration is worth what it gains against this.
    RegistrationOnly,
}

impl Problem {
    /// The same measurements with most parameters held at nominal.
    #[must_use]
    pub fn baseline(&self, baseline: Baseline) -> Self {
        let mut out = self.clone();
        let mut free = BTreeSet::new();
        if baseline == Baseline::RegistrationOnly {
            for edge in &self.edges {
                if let EdgeKind::Unknown(u) = &edge.kind
                    && matches!(u.role, Role::World | Role::Mount)
                {
                    free.extend(u.parameters.iter().flatten().map(|p| p.index()));
                }
            }
            for point in &self.points {
                free.extend(point.parameters.iter().flatten().map(|p| p.index()));
            }
        }
        for (i, p) in out.parameters.iter_mut().enumerate() {
            if !free.contains(&i) {
                p.fixed = true;
                p.start = p.nominal;
                p.bounds = None;
            }
        }
        out
    }

    /// Gives every parameter that the robot's description has a nominal value for, and no prior yet, the
    /// default one: 1° and 1 cm for joint origins, the typical deviation of its kind for joint effects. World frames,
    /// mounts and markers keep none: where they are is for the data to say.
    pub fn set_default_priors(&mut self) {
        let mut sigmas = Vec::new();
        for edge in &self.edges {
            match &edge.kind {
                EdgeKind::Unknown(u) if u.role == Role::JointOrigin => {
                    for (i, p) in u.parameters.iter().enumerate() {
                        if let Some(p) = p {
                            sigmas.push((
                                *p,
                                if i < 3 {
                                    DEFAULT_ROTATION_SIGMA
                                } else {
                                    DEFAULT_TRANSLATION_SIGMA
                                },
                            ));
                        }
                    }
                }
                EdgeKind::Joint(j) => {
                    for f in &j.effects {
                        // A clock has no nominal offset unless the recording says so.
                        if f.kind != EffectKind::ClockOffset {
                            let p = &self.parameters[f.parameter.index()];
                            sigmas.push((f.parameter, p.unit.typical_deviation()));
                        }
                    }
                }
                _ => {}
            }
        }
        for (p, sigma) in sigmas {
            self.parameters[p.index()].prior_sigma.get_or_insert(sigma);
        }
    }
}
